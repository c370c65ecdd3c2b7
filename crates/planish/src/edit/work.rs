//! A drawing under an edit: the mesh made ready, and what the names and places of a script mean on it (`docs/guide/edit.md`).

use super::{ApplyError, CurveName, CurveNumber, Images, Name, Others, Pull, RelaxedCurve, Scalar, Spot};
use crate::curve::symmetry::Plane;
use crate::curve::{Canvas, CurveError, ScalarField, SurfaceCurve};
use crate::edit::network::{EditError, Editor};
use crate::geom::Bvh;
use crate::grid::check_features;
use crate::mesh::{FacePoint, TriMesh, sharp_edges};
use crate::model::Drawing;
use crate::network::{Corner, Curve, CurveKind, ImprintError, Network, PatchMesh, imprint};
use crate::observe::Observer;
use glam::DVec3;
use std::sync::OnceLock;

/// A position further off the mesh than this share of its diagonal is a mistake: of units, or of axes.
const FARTHEST_OFF_MESH: f64 = 0.25;
/// Picks go to edges sharper than this, degrees.
const SHARP_DEG: f64 = 40.0;

/// A mesh made ready for edits.
pub struct Ground<'m> {
    /// The mesh ready for painting.
    pub canvas: Canvas<'m>,
    /// Nearest places and rays.
    pub bvh: Bvh,
    /// Sharp half-edges, once they are asked for.
    sharp: OnceLock<Vec<bool>>,
}

impl<'m> Ground<'m> {
    /// Makes a mesh ready, once for many edits.
    pub fn new(mesh: &'m TriMesh) -> Ground<'m> {
        let (canvas, bvh) = rayon::join(|| Canvas::new(mesh), || Bvh::new(mesh));
        Ground { canvas, bvh, sharp: OnceLock::new() }
    }

    /// For each half-edge whether it is sharp: lines that picks go to.
    pub(super) fn sharp(&self) -> &[bool] {
        self.sharp.get_or_init(|| sharp_edges(self.canvas.mesh, &self.canvas.adjacency, SHARP_DEG))
    }
}

/// An edit at work.
pub struct Work<'a, 'm> {
    pub(super) ground: &'a Ground<'m>,
    pub(super) drawing: &'a mut Drawing,
    /// Models that an edit may name.
    pub(super) others: &'a Others<'a>,
    pub(super) observer: &'a dyn Observer,
    /// What was relaxed.
    pub(super) relaxed: Vec<RelaxedCurve>,
    /// After a mirroring: the plane, and what became of the curves.
    pub(super) images: Option<(Plane, Images)>,
}

impl Work<'_, '_> {
    pub(super) fn mesh(&self) -> &TriMesh {
        self.ground.canvas.mesh
    }

    pub(super) fn place(&self, spot: &Spot) -> Result<FacePoint, ApplyError> {
        let faces = self.mesh().triangles.len();
        match *spot {
            Spot::Position(p) => self.nearest(p),
            Spot::Place(p) if (p.face as usize) < faces => Ok(p),
            Spot::Place(p) => Err(CurveError::NoSuchFace { face: p.face, faces }.into()),
            Spot::Corner { corner } => {
                let corners = &self.drawing.network.corners;
                let found = corners.get(corner as usize).map(|c| c.place);
                found.ok_or(ApplyError::NoSuchCorner { corner, count: corners.len() })
            }
        }
    }

    pub(super) fn nearest(&self, p: [f64; 3]) -> Result<FacePoint, ApplyError> {
        let found = self.ground.bvh.closest(DVec3::from_array(p));
        let away = found.distance / self.mesh().bounds().diagonal().max(f64::MIN_POSITIVE);
        if away > FARTHEST_OFF_MESH { Err(ApplyError::OffMesh { place: p, away }) } else { Ok(found.place) }
    }

    /// A vector of a move, no longer than the diagonal.
    pub(super) fn shift(&self, by: &[f64; 3]) -> Result<DVec3, ApplyError> {
        let by = DVec3::from_array(*by);
        let share = by.length() / self.mesh().bounds().diagonal().max(f64::MIN_POSITIVE);
        if share > 1.0 { Err(ApplyError::TooFar { share }) } else { Ok(by) }
    }

    /// Number of the one nearest to a place among lists of places.
    fn named<'p>(
        &self,
        name: &Name,
        what: &'static str,
        lists: impl ExactSizeIterator<Item = &'p [FacePoint]>,
    ) -> Result<u32, ApplyError> {
        let near = match *name {
            Name::Number(k) => return Ok(k),
            Name::Near { near } => near,
        };
        self.nearest(near)?;
        let (mesh, p) = (self.mesh(), DVec3::from_array(near));
        let away = |list: &[FacePoint]| {
            let at: Vec<DVec3> = list.iter().map(|q| q.position(mesh)).collect();
            let pieces = at.windows(2).map(|w| {
                let d = w[1] - w[0];
                let share = (p - w[0]).dot(d) / d.length_squared().max(f64::MIN_POSITIVE);
                (w[0] + d * share.clamp(0.0, 1.0)).distance(p)
            });
            pieces.chain(at.first().map(|q| q.distance(p))).fold(f64::INFINITY, f64::min)
        };
        let found = lists.enumerate().map(|(k, list)| (away(list), k as u32));
        let found = found.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.map(|x| x.1).ok_or(ApplyError::NoneYet { what })
    }

    pub(super) fn corner(&self, name: &Name) -> Result<u32, ApplyError> {
        let corners = &self.drawing.network.corners;
        let found = self.named(name, "corner", corners.iter().map(|c| std::slice::from_ref(&c.place)))?;
        match corners.len() {
            count if found as usize >= count => Err(ApplyError::NoSuchCorner { corner: found, count }),
            _ => Ok(found),
        }
    }

    pub(super) fn curve(&self, name: &CurveName) -> Result<CurveNumber, ApplyError> {
        match name {
            CurveName::Network(name) => self.network_curve(name).map(CurveNumber::Curve),
            CurveName::Feature { feature } => self.feature(feature).map(CurveNumber::Feature),
        }
    }

    pub(super) fn network_curve(&self, name: &Name) -> Result<u32, ApplyError> {
        let curves = &self.drawing.network.curves;
        let found = self.named(name, "curve", curves.iter().map(|c| &c.points[..]))?;
        match curves.len() {
            count if found as usize >= count => {
                Err(EditError::NoSuchPart { what: "curve", index: found, count }.into())
            }
            _ => Ok(found),
        }
    }

    pub(super) fn feature(&self, name: &Name) -> Result<u32, ApplyError> {
        let features = &self.drawing.sketch.features;
        let found = self.named(name, "feature curve", features.iter().map(|f| &f.points[..]))?;
        match features.len() {
            count if found as usize >= count => Err(ApplyError::NoSuchFeature { feature: found, count }),
            _ => Ok(found),
        }
    }

    /// Lets `change` work on the network.
    pub(super) fn edit<T, E>(
        &mut self,
        change: impl FnOnce(&mut Editor, f64, &dyn Observer) -> Result<T, E>,
    ) -> Result<T, ApplyError>
    where
        ApplyError: From<E>,
    {
        let canvas = &self.ground.canvas;
        let network = std::mem::take(&mut self.drawing.network);
        let mut editor = Editor::new(canvas.mesh, &canvas.adjacency, network);
        let made = change(&mut editor, canvas.mesh.bounds().diagonal(), self.observer);
        self.drawing.network = editor.network;
        Ok(made?)
    }

    /// Lets `change` work on one curve. A feature curve is the only curve of a network for that time, and its patch
    /// must be able to follow it afterwards.
    pub(super) fn edit_curve<T, E>(
        &mut self,
        curve: CurveNumber,
        change: impl FnOnce(&mut Editor, u32, &dyn Observer) -> Result<T, E>,
    ) -> Result<T, ApplyError>
    where
        ApplyError: From<E>,
    {
        let feature = match curve {
            CurveNumber::Curve(curve) => return self.edit(|e, _, observer| change(e, curve, observer)),
            CurveNumber::Feature(feature) => feature,
        };
        let canvas = &self.ground.canvas;
        let points = self.drawing.sketch.features[feature as usize].points.clone();
        let [first, .., last] = points[..] else {
            return Err(CurveError::TooFewPoints { found: points.len(), needed: 2 }.into());
        };
        let alone = Network {
            corners: [first, last].map(|place| Corner { place }).to_vec(),
            curves: vec![Curve { corners: [0, 1], kind: CurveKind::Smooth, points }],
            ..Network::default()
        };
        let mut editor = Editor::new(canvas.mesh, &canvas.adjacency, alone);
        let made = change(&mut editor, 0, self.observer)?;
        self.redraw_feature(feature, std::mem::take(&mut editor.network.curves[0].points))?;
        Ok(made)
    }

    /// Gives a feature curve another course that its patch can follow.
    pub(super) fn redraw_feature(&mut self, feature: u32, points: Vec<FacePoint>) -> Result<(), ApplyError> {
        let changed = &mut self.drawing.sketch.features[feature as usize];
        let mesh = self.ground.canvas.mesh;
        let middle = points.get(points.len() / 2).map_or(DVec3::ZERO, |p| p.position(mesh));
        changed.points = points;
        let number = changed.patch;
        let cut = match imprint(mesh, &self.drawing.network, self.observer) {
            Err(ImprintError::Cancelled(cancelled)) => return Err(cancelled.into()),
            other => other.ok(),
        };
        let patch = cut.as_ref().and_then(|patches| patches.get(number as usize));
        self.check_features(number, patch.ok_or(ApplyError::NoPatch { place: middle.to_array() })?)
    }

    pub(super) fn add(&mut self, curve: &SurfaceCurve, kind: CurveKind, snap: f64) -> Result<(), ApplyError> {
        self.edit(|e, diagonal, _| e.draw_curve(curve, kind, snap * diagonal)).map(drop)
    }

    pub(super) fn field(&self, scalar: &Scalar) -> Result<ScalarField, ApplyError> {
        let (mesh, adjacency) = (self.mesh(), &self.ground.canvas.adjacency);
        let attribute = |name: &str| {
            mesh.attributes.iter().find(|a| a.name == name).ok_or_else(|| ApplyError::NoSuchAttribute {
                name: name.into(),
                there: match &mesh.attributes[..] {
                    [] => "curvature, which every mesh has".into(),
                    list => list.iter().map(|a| a.name.clone()).collect::<Vec<_>>().join(", "),
                },
            })
        };
        Ok(match scalar {
            Scalar::Luminance => ScalarField::luminance(mesh, attribute("color")?)?,
            Scalar::Channel { attribute: name, channel } => ScalarField::channel(mesh, attribute(name)?, *channel)?,
            Scalar::MeanCurvature => ScalarField::mean_curvature(mesh, adjacency),
            Scalar::GaussianCurvature => ScalarField::gaussian_curvature(mesh, adjacency),
            Scalar::MaximumCurvature => ScalarField::maximum_curvature(mesh, adjacency),
            Scalar::Values(values) => ScalarField::new(mesh, values.clone())?,
        })
    }

    pub(super) fn pull(&self, pull: &Pull) -> Result<ScalarField, ApplyError> {
        let field = self.field(&pull.scalar)?;
        let field = if pull.low { field.negated() } else { field };
        Ok(field.smoothed(self.mesh(), &self.ground.canvas.adjacency, pull.blending))
    }

    /// The finished patch that a place lies in, and its number.
    pub(super) fn patch_at(&self, place: &FacePoint) -> Result<(u32, PatchMesh), ApplyError> {
        let nowhere = || ApplyError::NoPatch { place: place.position(self.mesh()).to_array() };
        let mut cut = imprint(self.mesh(), &self.drawing.network, self.observer).map_err(|e| match e {
            ImprintError::Cancelled(c) => c.into(),
            _ => nowhere(),
        })?;
        let p = place.position(self.mesh());
        // The patch with the part of the face that is nearest to the place.
        let near = cut.iter().enumerate().flat_map(|(k, patch)| {
            let own = (0..patch.face_origin.len()).filter(|&t| patch.face_origin[t] == place.face);
            own.map(move |t| {
                let middle = patch.mesh.corners(t).into_iter().sum::<DVec3>() / 3.0;
                (middle.distance(p), k as u32)
            })
        });
        let found = near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|x| x.1);
        let found = found.ok_or_else(nowhere)?;
        Ok((found, cut.swap_remove(found as usize)))
    }

    /// Looks whether the feature curves and sections of a patch suit it.
    pub(super) fn check_features(&self, number: u32, patch: &PatchMesh) -> Result<(), ApplyError> {
        let sketch = &self.drawing.sketch;
        let sections = sketch.sections.iter().find(|s| s.0 == number).map(|s| &s.1);
        Ok(check_features(self.mesh(), (number, patch), &sketch.features, sections)?)
    }
}
