//! What each edit does to a drawing.

use super::keep;
use super::mirror::{Images, ON_PLANE};
use super::{ApplyError, Edit, Forces, LINE_KIND, Magnetism, Others, Pull, Scalar, SplineMove, Spot};
use super::{carry_network, mirror_network};
use crate::curve::{
    Canvas, CurveError, Magnet, PaintMode, PaintParams, ScalarField, SnakeParams, SplineEdit, Stroke, SurfaceCurve,
    carry::LandmarkMap, section, symmetry,
};
use crate::geom::Bvh;
use crate::grid::{FeatureCurve, Sections};
use crate::mesh::{FacePoint, TriMesh, sharp_edges};
use crate::model::Drawing;
use crate::network::{CurveKind, Editor, LayoutParams, imprint};
use crate::observe::Observer;
use glam::DVec3;

/// A position further off the mesh than this share of its diagonal is a mistake: of units, or of axes.
const FAR: f64 = 0.25;

/// A mesh made ready for edits.
pub struct Ground<'m> {
    /// The mesh ready for painting.
    pub canvas: Canvas<'m>,
    /// Nearest places and rays.
    pub bvh: Bvh,
}

impl<'m> Ground<'m> {
    /// Makes a mesh ready, once for many edits.
    pub fn new(mesh: &'m TriMesh) -> Ground<'m> {
        let (canvas, bvh) = rayon::join(|| Canvas::new(mesh), || Bvh::new(mesh));
        Ground { canvas, bvh }
    }
}

impl Forces {
    fn params(&self) -> SnakeParams {
        let Forces { fairness, curvature, sweeps, sweep } = *self;
        SnakeParams { fairness, curvature, sweeps, sweep, ..SnakeParams::default() }
    }
}

/// An edit at work.
struct Work<'a, 'm> {
    ground: &'a Ground<'m>,
    drawing: &'a mut Drawing,
    observer: &'a dyn Observer,
    /// After a mirroring: the plane, and what became of the curves.
    images: Option<(symmetry::Plane, Images)>,
}

/// Makes one edit. On an error the drawing is what it was. Patches are those of the curves afterwards.
/// * `others` - models that [`Edit::Carry`] names
/// # Errors
/// See [`ApplyError`].
pub fn apply(
    drawing: &mut Drawing,
    edit: &Edit,
    ground: &Ground,
    others: &Others,
    observer: &dyn Observer,
) -> Result<(), ApplyError> {
    super::check::check(edit)?;
    let before = drawing.clone();
    let mut work = Work { ground, drawing, observer, images: None };
    let made = work.make(edit, others);
    let images = work.images.take();
    if observer.cancelled() || made.is_err() {
        *drawing = before;
        return made.and(Err(ApplyError::Cancelled));
    }
    let canvas = &ground.canvas;
    let moved = drawing.network.corners != before.network.corners || drawing.network.curves != before.network.curves;
    if moved || images.is_some() {
        let mut editor = Editor::new(canvas.mesh, &canvas.adjacency, std::mem::take(&mut drawing.network));
        editor.diagnose();
        drawing.network = editor.network;
        match &images {
            Some((plane, images)) => keep::mirror(ground, drawing, &before, plane, images),
            None => keep::keep(edit, drawing, &before),
        }
    }
    Ok(())
}

impl Work<'_, '_> {
    fn mesh(&self) -> &TriMesh {
        self.ground.canvas.mesh
    }

    fn place(&self, spot: &Spot) -> Result<FacePoint, ApplyError> {
        let faces = self.mesh().triangles.len();
        match *spot {
            Spot::Position(p) => {
                let found = self.ground.bvh.closest(DVec3::from_array(p));
                let away = found.distance / self.mesh().bounds().diagonal().max(f64::MIN_POSITIVE);
                if away > FAR { Err(ApplyError::OffMesh { place: p, away }) } else { Ok(found.place) }
            }
            Spot::Place(p) if (p.face as usize) < faces => Ok(p),
            Spot::Place(p) => Err(CurveError::NoSuchFace { face: p.face, faces }.into()),
            Spot::Corner { corner } => {
                let corners = &self.drawing.network.corners;
                let found = corners.get(corner as usize).map(|c| c.place);
                found.ok_or(ApplyError::NoSuchCorner { corner, count: corners.len() })
            }
        }
    }

    /// Lets `change` work on the network.
    fn edit<T, E>(
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

    fn add(&mut self, curve: &SurfaceCurve, kind: CurveKind, snap: f64) -> Result<(), ApplyError> {
        self.edit(|e, diagonal, _| e.add_curve(curve, kind, snap.max(0.0) * diagonal)).map(drop)
    }

    fn field(&self, scalar: &Scalar) -> Result<ScalarField, ApplyError> {
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

    fn pull(&self, pull: &Pull) -> Result<ScalarField, ApplyError> {
        let field = self.field(&pull.scalar)?;
        let field = if pull.low { field.negated() } else { field };
        Ok(field.smoothed(self.mesh(), &self.ground.canvas.adjacency, pull.blending))
    }

    fn stroke(
        &self,
        picks: &[Spot],
        mode: PaintMode,
        closed: bool,
        magnet: Option<&Magnetism>,
    ) -> Result<SurfaceCurve, ApplyError> {
        let canvas = &self.ground.canvas;
        let magnet = match (mode, magnet) {
            (PaintMode::Magnetic, Some(Magnetism::Sharp(angle))) => {
                Some(Magnet::of_lines(canvas.mesh, &sharp_edges(canvas.mesh, &canvas.adjacency, *angle)))
            }
            (PaintMode::Magnetic, Some(Magnetism::Scalar(scalar))) => Some(Magnet::of_scalar(&self.field(scalar)?)),
            (PaintMode::Magnetic, _) => Some(Magnet::of_scalar(&self.field(&Scalar::MaximumCurvature)?)),
            _ => None,
        };
        let params = PaintParams { mode, ..PaintParams::default() };
        let mut stroke = Stroke::new();
        for pick in picks {
            stroke.add(canvas, self.place(pick)?, &params, magnet.as_ref())?;
        }
        if closed {
            stroke.close(canvas, &params, magnet.as_ref())?;
        }
        let curve = stroke.curve(canvas);
        curve.check(canvas.mesh)?;
        Ok(curve)
    }

    /// The finished patch that a place lies in.
    fn patch_at(&self, place: &FacePoint) -> Result<u32, ApplyError> {
        let nowhere = || ApplyError::NoPatch { place: place.position(self.mesh()).to_array() };
        let cut = imprint(self.mesh(), &self.drawing.network).map_err(|_| nowhere())?;
        let p = place.position(self.mesh());
        // The patch with the part of the face that is nearest to the place.
        let near = cut.iter().enumerate().flat_map(|(k, patch)| {
            let own = (0..patch.face_origin.len()).filter(|&t| patch.face_origin[t] == place.face);
            own.map(move |t| {
                let middle = patch.mesh.corners(t).into_iter().sum::<DVec3>() / 3.0;
                (middle.distance(p), k as u32)
            })
        });
        near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|x| x.1).ok_or_else(nowhere)
    }

    fn make(&mut self, edit: &Edit, others: &Others) -> Result<(), ApplyError> {
        let canvas = &self.ground.canvas;
        let (mesh, adjacency) = (canvas.mesh, &canvas.adjacency);
        match edit {
            Edit::Paint { picks, mode, closed, magnet, snap } => {
                let curve = self.stroke(picks, *mode, *closed, magnet.as_ref())?;
                self.add(&curve, CurveKind::Smooth, *snap)
            }
            Edit::Cut { through, normal, snap } => {
                let place = self.place(through)?;
                let point = place.position(mesh);
                let curve = section::cut_plane(mesh, adjacency, point, DVec3::from_array(*normal), place.face)?;
                self.add(&curve, CurveKind::Smooth, *snap)
            }
            Edit::Project { points, direction, snap } => {
                let points: Vec<DVec3> = points.iter().map(|p| DVec3::from_array(*p)).collect();
                let direction = DVec3::from_array(*direction);
                let curve = section::project(mesh, adjacency, &self.ground.bvh, &points, direction, canvas.edge)?;
                self.add(&curve, CurveKind::Smooth, *snap)
            }
            Edit::Boundaries {} => self.edit(|e, _, _| e.add_boundaries()).map(drop),
            Edit::FeatureLines { angle_deg, shortest } => {
                let lines = section::lines(mesh, adjacency, &sharp_edges(mesh, adjacency, *angle_deg));
                let least = shortest * mesh.bounds().diagonal();
                for line in lines.iter().filter(|l| l.length(mesh) >= least) {
                    self.add(line, LINE_KIND, crate::geom::tolerance::RELATIVE)?;
                }
                Ok(())
            }
            Edit::AddCorner { at, snap } => {
                let place = self.place(at)?;
                self.edit(|e, diagonal, _| e.add_corner(place, snap * diagonal)).map(drop)
            }
            Edit::SplitCurve { curve, at } => self.edit(|e, _, _| e.split_curve(*curve, *at)).map(drop),
            Edit::Join { corner } => self.edit(|e, _, _| e.join(*corner)).map(drop),
            Edit::DeleteCurves { curves } => {
                let mut curves = curves.clone();
                curves.sort_unstable();
                curves.dedup();
                self.edit(|e, _, _| curves.iter().rev().try_for_each(|&c| e.delete_curve(c)))
            }
            Edit::DeleteCorner { corner } => self.edit(|e, _, _| e.delete_corner(*corner)),
            Edit::Clear {} => {
                self.drawing.network = Default::default();
                Ok(())
            }
            Edit::DragCorner { corner, to, reach, forces } => {
                let to = self.place(to)?;
                self.edit(|e, _, o| e.drag_corner(*corner, to, *reach, &forces.params(), o))
            }
            Edit::DragCurve { curve, at, by, width, forces } => {
                let by = DVec3::from_array(*by);
                self.edit(|e, _, o| e.drag_curve(*curve, *at, by, *width, &forces.params(), o))
            }
            Edit::Relax { curve, section, forces, pull } => {
                let field = pull.as_ref().map(|p| self.pull(p)).transpose()?;
                let attraction = pull.as_ref().map_or(0.0, |p| p.weight);
                let params = SnakeParams { attraction, ..forces.params() };
                let section = section.map(|s| (s[0], s[1]));
                match curve {
                    Some(curve) => self.edit(|e, _, o| e.relax_curve(*curve, section, field.as_ref(), &params, o)),
                    None => self.relax_all(section, field.as_ref(), &params),
                }
            }
            Edit::Spline { curve, control, moves } => self.spline(*curve, *control, moves),
            Edit::SplitRegion { at, from } => {
                let place = self.place(at)?;
                let from = *from;
                self.edit(|e, _, _| {
                    let region = e.region_at(&place)?;
                    e.split_region(region, from)
                })
                .map(drop)
            }
            Edit::Complete { patches, sharp_angle_deg } => {
                let params =
                    LayoutParams { patches: *patches, sharp_angle_deg: *sharp_angle_deg, ..LayoutParams::default() };
                self.edit(|e, _, o| e.complete(&params, o))
            }
            Edit::Feature { picks, family, mode } => {
                let curve = self.stroke(picks, *mode, false, None)?;
                let middle = curve.points[curve.points.len() / 2];
                let patch = self.patch_at(&middle)?;
                let feature = FeatureCurve { patch, family: *family, points: curve.points };
                self.drawing.sketch.features.push(feature);
                Ok(())
            }
            Edit::DeleteFeature { feature } => {
                let features = &mut self.drawing.sketch.features;
                if *feature as usize >= features.len() {
                    return Err(ApplyError::NoSuchFeature { feature: *feature, count: features.len() });
                }
                features.remove(*feature as usize);
                Ok(())
            }
            Edit::Sections { at, u, v } => {
                let patch = self.patch_at(&self.place(at)?)?;
                let sections = &mut self.drawing.sketch.sections;
                sections.retain(|s| s.0 != patch);
                if !u.is_empty() || !v.is_empty() {
                    sections.push((patch, Sections { u: u.clone(), v: v.clone() }));
                }
                Ok(())
            }
            Edit::Symmetry { plane } => {
                let plane = match plane {
                    Some(plane) => symmetry::Plane { normal: plane.normal.normalize_or_zero(), ..*plane },
                    None => symmetry::find(mesh, &self.ground.bvh, self.observer)?.0,
                };
                self.drawing.sketch.symmetry = Some(plane);
                Ok(())
            }
            Edit::Mirror { swap } => {
                let mut plane = self.drawing.sketch.symmetry.ok_or(ApplyError::NoPlane)?;
                if *swap {
                    plane.normal = -plane.normal;
                }
                let (network, images) = mirror_network(self.ground, &self.drawing.network, &plane)?;
                self.drawing.network = network;
                self.images = Some((plane, images));
                Ok(())
            }
            Edit::Carry { from, landmarks } => {
                let (other, drawing) = others(from).map_err(|what| ApplyError::Other { name: from.clone(), what })?;
                let [a, b] = [0, 1].map(|k| landmarks.iter().map(|l| DVec3::from_array(l[k])).collect::<Vec<_>>());
                let map = LandmarkMap::new(&a, &b)?;
                self.drawing.network = carry_network(&map, &other, &drawing.network, self.ground, self.observer)?;
                Ok(())
            }
            Edit::Undo { .. } | Edit::Redo { .. } => Err(ApplyError::NotADrawing),
        }
    }

    /// Relaxes one curve after the other; one that would run into another stays as it is.
    fn relax_all(
        &mut self,
        section: Option<(f64, f64)>,
        field: Option<&ScalarField>,
        params: &SnakeParams,
    ) -> Result<(), ApplyError> {
        let mesh = self.ground.canvas.mesh;
        let plane = self.drawing.sketch.symmetry;
        let near = ON_PLANE * mesh.bounds().diagonal();
        self.edit(|e, _, observer| -> Result<(), ApplyError> {
            let count = e.network.curves.len();
            let mut faults = e.glance().faults.len();
            for c in 0..count {
                observer.progress(c as f64 / count as f64);
                let curve = &e.network.curves[c];
                let in_plane =
                    |plane: symmetry::Plane| curve.points.iter().all(|p| plane.height(p.position(mesh)).abs() < near);
                if curve.kind != CurveKind::Smooth || plane.is_some_and(in_plane) {
                    continue;
                }
                let before = curve.points.clone();
                e.relax_curve(c as u32, section, field, params, observer)?;
                let after = e.glance().faults.len();
                if after > faults {
                    e.network.curves[c].points = before;
                } else {
                    faults = after;
                }
            }
            Ok(())
        })
    }

    fn spline(&mut self, curve: u32, control: usize, moves: &[SplineMove]) -> Result<(), ApplyError> {
        let canvas = &self.ground.canvas;
        let (mesh, adjacency) = (canvas.mesh, &canvas.adjacency);
        self.edit(|e, _, _| -> Result<(), ApplyError> {
            let count = e.network.curves.len();
            let found = e.network.curves.get(curve as usize);
            let found = found.ok_or(CurveError::NoSuchPart { what: "curve", index: curve as usize, count })?;
            let open = SurfaceCurve::open(found.points.clone());
            let even = open.spaced(mesh, adjacency, canvas.edge)?;
            // A short curve still has as many places as its spline has vertices.
            let even = even.resampled(mesh, adjacency, even.points.len().max(2 * control))?;
            let mut spline = SplineEdit::fit(mesh, &even, control)?;
            for m in moves {
                match *m {
                    SplineMove::Control { vertex, by } => {
                        let at = spline.control.get(vertex).copied().unwrap_or_default();
                        spline.move_control(vertex, at + DVec3::from_array(by))?;
                    }
                    SplineMove::Edit { at, by } => {
                        spline.move_edit_point(at, spline.position(at) + DVec3::from_array(by));
                    }
                }
            }
            Ok(e.replace_curve(curve, &spline.carry(mesh, adjacency, &even))?)
        })
    }
}
