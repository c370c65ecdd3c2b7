//! What each edit does to a drawing.

use super::mirror::{Images, ON_PLANE};
use super::network::{EditError, Editor, Holds};
use super::stroke::Brush;
use super::{
    ApplyError, Edit, Forces, LINE_KIND, Made, Name, Others, Pull, RelaxedCurve, Scalar, SplineMove, Spot,
    carry_network, keep, mirror_network,
};
use crate::curve::carry::LandmarkMap;
use crate::curve::{Canvas, CurveError, ScalarField, SnakeParams, SplineEdit, SurfaceCurve, section, symmetry};
use crate::geom::Bvh;
use crate::grid::{Family, FeatureCurve, Sections, check_features, family_of};
use crate::layout::LayoutParams;
use crate::mesh::{FacePoint, TriMesh, sharp_edges};
use crate::model::Drawing;
use crate::network::{CurveKind, Network, PatchMesh, imprint};
use crate::observe::Observer;
use glam::DVec3;
use std::collections::BTreeSet;
use std::sync::OnceLock;

/// A position further off the mesh than this share of its diagonal is a mistake: of units, or of axes.
const FAR: f64 = 0.25;
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

impl Forces {
    fn params(&self) -> SnakeParams {
        let Forces { fairness, curvature, arc_length, sweeps, settle, sweep } = *self;
        SnakeParams { fairness, curvature, arc_length, sweeps, settle, sweep, attraction: 0.0 }
    }
}

/// An edit at work.
pub(super) struct Work<'a, 'm> {
    pub(super) ground: &'a Ground<'m>,
    pub(super) drawing: &'a mut Drawing,
    observer: &'a dyn Observer,
    relaxed: Vec<RelaxedCurve>,
    /// After a mirroring: the plane, and what became of the curves.
    images: Option<(symmetry::Plane, Images)>,
}

/// Makes one edit, and tells what it did. On an error the drawing is what it was. Patches are those of the curves
/// afterwards.
/// * `others` - models that [`Edit::Carry`] names
/// # Errors
/// See [`ApplyError`].
pub fn apply(
    drawing: &mut Drawing,
    edit: &Edit,
    ground: &Ground,
    others: &Others,
    observer: &dyn Observer,
) -> Result<Made, ApplyError> {
    super::check::check(edit)?;
    let before = drawing.clone();
    let mut work = Work { ground, drawing, observer, relaxed: Vec::new(), images: None };
    let made = work.make(edit, others);
    let (images, relaxed) = (work.images.take(), std::mem::take(&mut work.relaxed));
    if observer.cancelled() || made.is_err() {
        *drawing = before;
        return Err(made.err().unwrap_or(ApplyError::Cancelled));
    }
    let canvas = &ground.canvas;
    let moved = drawing.network.corners != before.network.corners || drawing.network.curves != before.network.curves;
    let mut faults = None;
    if moved || images.is_some() {
        let mut editor = Editor::new(canvas.mesh, &canvas.adjacency, std::mem::take(&mut drawing.network));
        faults = Some(editor.diagnose().faults);
        drawing.network = editor.network;
        match &images {
            Some((plane, images)) => keep::mirror(ground, drawing, &before, plane, images),
            None => keep::keep(edit, drawing, &before),
        }
    }
    Ok(Made { relaxed, faults, ..Made::between(&before, drawing) })
}

impl Work<'_, '_> {
    fn mesh(&self) -> &TriMesh {
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

    fn nearest(&self, p: [f64; 3]) -> Result<FacePoint, ApplyError> {
        let found = self.ground.bvh.closest(DVec3::from_array(p));
        let away = found.distance / self.mesh().bounds().diagonal().max(f64::MIN_POSITIVE);
        if away > FAR { Err(ApplyError::OffMesh { place: p, away }) } else { Ok(found.place) }
    }

    /// A vector of a move, no longer than the diagonal.
    fn shift(&self, by: &[f64; 3]) -> Result<DVec3, ApplyError> {
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

    fn corner(&self, name: &Name) -> Result<u32, ApplyError> {
        let corners = &self.drawing.network.corners;
        let found = self.named(name, "corner", corners.iter().map(|c| std::slice::from_ref(&c.place)))?;
        match corners.len() {
            count if found as usize >= count => Err(ApplyError::NoSuchCorner { corner: found, count }),
            _ => Ok(found),
        }
    }

    fn curve(&self, name: &Name) -> Result<u32, ApplyError> {
        let curves = &self.drawing.network.curves;
        let found = self.named(name, "curve", curves.iter().map(|c| &c.points[..]))?;
        match curves.len() {
            count if found as usize >= count => {
                Err(EditError::NoSuchPart { what: "curve", index: found, count }.into())
            }
            _ => Ok(found),
        }
    }

    fn feature(&self, name: &Name) -> Result<u32, ApplyError> {
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

    fn add(&mut self, curve: &SurfaceCurve, kind: CurveKind, snap: f64) -> Result<(), ApplyError> {
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

    fn pull(&self, pull: &Pull) -> Result<ScalarField, ApplyError> {
        let field = self.field(&pull.scalar)?;
        let field = if pull.low { field.negated() } else { field };
        Ok(field.smoothed(self.mesh(), &self.ground.canvas.adjacency, pull.blending))
    }

    /// The finished patch that a place lies in, and its number.
    fn patch_at(&self, place: &FacePoint) -> Result<(u32, PatchMesh), ApplyError> {
        let nowhere = || ApplyError::NoPatch { place: place.position(self.mesh()).to_array() };
        let mut cut = imprint(self.mesh(), &self.drawing.network).map_err(|_| nowhere())?;
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
    fn check_features(&self, number: u32, patch: &PatchMesh) -> Result<(), ApplyError> {
        let sketch = &self.drawing.sketch;
        let sections = sketch.sections.iter().find(|s| s.0 == number).map(|s| &s.1);
        Ok(check_features(self.mesh(), (number, patch), &sketch.features, sections)?)
    }

    fn make(&mut self, edit: &Edit, others: &Others) -> Result<(), ApplyError> {
        let canvas = &self.ground.canvas;
        let (mesh, adjacency) = (canvas.mesh, &canvas.adjacency);
        match edit {
            Edit::Paint { picks, mode, closed, magnet, snap } => {
                let brush = Brush { mode: *mode, magnet: magnet.as_ref(), snap: *snap };
                let curve = self.stroke(picks, *closed, &brush)?;
                self.add(&curve, CurveKind::Smooth, *snap)
            }
            Edit::Extend { curve, picks, mode, closed, magnet, snap } => {
                let curve = self.curve(curve)?;
                self.extend(curve, picks, *closed, &Brush { mode: *mode, magnet: magnet.as_ref(), snap: *snap })
            }
            Edit::Cut { through, normal, snap } => {
                let place = self.place(through)?;
                let point = place.position(mesh);
                let curve = section::cut_plane(mesh, adjacency, point, DVec3::from_array(*normal), place.face)?;
                self.add(&curve, CurveKind::Smooth, *snap)
            }
            Edit::Project { points, direction, snap } => {
                let direction = DVec3::from_array(*direction);
                if direction == DVec3::ZERO {
                    points.iter().try_for_each(|p| self.nearest(*p).map(drop))?;
                }
                let points: Vec<DVec3> = points.iter().map(|p| DVec3::from_array(*p)).collect();
                let curve = section::project(mesh, adjacency, &self.ground.bvh, &points, direction, canvas.edge)?;
                self.add(&curve, CurveKind::Smooth, *snap)
            }
            Edit::Boundaries {} => self.edit(|e, _, _| e.add_boundaries()).map(drop),
            Edit::FeatureLines { angle_deg, shortest } => {
                let lines = section::lines(mesh, adjacency, &sharp_edges(mesh, adjacency, *angle_deg));
                let least = shortest * mesh.bounds().diagonal();
                let lines = lines.iter().filter(|l| l.length(mesh) >= least);
                for line in lines.flat_map(|l| uncovered(mesh, l, &self.drawing.network)).collect::<Vec<_>>() {
                    self.add(&line, LINE_KIND, crate::geom::tolerance::RELATIVE)?;
                }
                Ok(())
            }
            Edit::AddCorner { at, snap } => {
                let place = self.place(at)?;
                self.edit(|e, diagonal, _| e.add_corner(place, snap * diagonal)).map(drop)
            }
            Edit::SplitCurve { curve, at } => {
                let curve = self.curve(curve)?;
                self.edit(|e, _, _| e.split_curve(curve, *at)).map(drop)
            }
            Edit::Join { corner } => {
                let corner = self.corner(corner)?;
                self.edit(|e, _, _| e.join(corner)).map(drop)
            }
            Edit::DeleteCurves { curves } => {
                let mut curves = curves.iter().map(|c| self.curve(c)).collect::<Result<Vec<_>, _>>()?;
                curves.sort_unstable();
                curves.dedup();
                self.edit(|e, _, _| curves.iter().rev().try_for_each(|&c| e.delete_curve(c)))
            }
            Edit::DeleteCorner { corner } => {
                let corner = self.corner(corner)?;
                self.edit(|e, _, _| e.delete_corner(corner))
            }
            Edit::Clear {} => {
                self.drawing.network = Default::default();
                Ok(())
            }
            Edit::DragCorner { corner, to, reach, forces } => {
                let (corner, to) = (self.corner(corner)?, self.place(to)?);
                let relaxed = self.edit(|e, _, o| e.drag_corner(corner, to, *reach, &forces.params(), o))?;
                self.relaxed.extend(relaxed.into_iter().map(|(curve, relaxed)| RelaxedCurve { curve, relaxed }));
                Ok(())
            }
            Edit::DragCurve { curve, at, by, width, forces, pins, stiffness } => {
                let (curve, by) = (self.curve(curve)?, self.shift(by)?);
                let holds = Holds { section: Some((*at, *width)), field: None, pins, stiffness };
                let relaxed = self.edit(|e, _, o| e.drag_curve(curve, *at, by, &holds, &forces.params(), o))?;
                self.relaxed.push(RelaxedCurve { curve, relaxed });
                Ok(())
            }
            Edit::Relax { curve, section, forces, pull, pins, stiffness } => {
                let field = pull.as_ref().map(|p| self.pull(p)).transpose()?;
                let attraction = pull.as_ref().map_or(0.0, |p| p.weight);
                let params = SnakeParams { attraction, ..forces.params() };
                let section = section.map(|s| (s[0], s[1]));
                let holds = Holds { section, field: field.as_ref(), pins, stiffness };
                let Some(curve) = curve else { return self.relax_all(&holds, &params) };
                let curve = self.curve(curve)?;
                let relaxed = self.edit(|e, _, o| e.relax_curve(curve, &holds, &params, o))?;
                self.relaxed.push(RelaxedCurve { curve, relaxed });
                Ok(())
            }
            Edit::Spline { curve, control, moves } => {
                let curve = self.curve(curve)?;
                moves.iter().try_for_each(|m| match m {
                    SplineMove::Control { by, .. } | SplineMove::Edit { by, .. } => self.shift(by).map(drop),
                })?;
                self.spline(curve, *control, moves)
            }
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
            Edit::Feature { picks, family, mode, magnet } => {
                let curve = self.stroke(picks, false, &Brush { mode: *mode, magnet: magnet.as_ref(), snap: 0.0 })?;
                let middle = curve.points[curve.points.len() / 2];
                let (patch, cut) = self.patch_at(&middle)?;
                let family = family.unwrap_or_else(|| family_of(mesh, &cut, &curve.points));
                let feature = FeatureCurve { patch, family, points: curve.points };
                let sketch = &mut self.drawing.sketch;
                sketch.features.push(feature);
                forget_cells(&mut sketch.sections, patch, family);
                self.check_features(patch, &cut)
            }
            Edit::DeleteFeature { feature } => {
                let feature = self.feature(feature)?;
                let sketch = &mut self.drawing.sketch;
                let gone = sketch.features.remove(feature as usize);
                forget_cells(&mut sketch.sections, gone.patch, gone.family);
                Ok(())
            }
            Edit::Sections { at, u, v } => {
                let (patch, cut) = self.patch_at(&self.place(at)?)?;
                let sections = &mut self.drawing.sketch.sections;
                sections.retain(|s| s.0 != patch);
                if !u.is_empty() || !v.is_empty() {
                    sections.push((patch, Sections { u: u.clone(), v: v.clone() }));
                }
                self.check_features(patch, &cut)
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
    fn relax_all(&mut self, holds: &Holds, params: &SnakeParams) -> Result<(), ApplyError> {
        let mesh = self.ground.canvas.mesh;
        let plane = self.drawing.sketch.symmetry;
        let near = ON_PLANE * mesh.bounds().diagonal();
        let mut all = Vec::new();
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
                let (before, corner) = (curve.points.clone(), curve.corners[0]);
                let start = e.network.corners[corner as usize].clone();
                let relaxed = match e.relax_curve(c as u32, holds, params, observer) {
                    Ok(relaxed) => relaxed,
                    // It shrinks to nothing: it stays as well.
                    Err(EditError::Shrunk { .. }) => continue,
                    Err(e) => return Err(e.into()),
                };
                let after = e.glance().faults.len();
                if after > faults {
                    e.network.curves[c].points = before;
                    e.network.corners[corner as usize] = start;
                } else {
                    faults = after;
                    all.push(RelaxedCurve { curve: c as u32, relaxed });
                }
            }
            Ok(())
        })?;
        self.relaxed = all;
        Ok(())
    }

    fn spline(&mut self, curve: u32, control: usize, moves: &[SplineMove]) -> Result<(), ApplyError> {
        let canvas = &self.ground.canvas;
        let (mesh, adjacency) = (canvas.mesh, &canvas.adjacency);
        self.edit(|e, _, _| -> Result<(), ApplyError> {
            let course = e.course(curve);
            let even = course.spaced(mesh, adjacency, canvas.edge)?;
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

/// Takes back the cells that are given across curves of a family: with one curve more or less they are of other
/// sections.
fn forget_cells(sections: &mut Vec<(u32, Sections)>, patch: u32, family: Family) {
    for (_, cells) in sections.iter_mut().filter(|s| s.0 == patch) {
        match family {
            Family::V => cells.u.clear(),
            Family::U => cells.v.clear(),
        }
    }
    sections.retain(|(_, cells)| !cells.u.is_empty() || !cells.v.is_empty());
}

/// The parts of a line along edges where no curve runs yet.
fn uncovered(mesh: &TriMesh, line: &SurfaceCurve, network: &Network) -> Vec<SurfaceCurve> {
    let vertex = |p: &FacePoint| (0..3).find(|&k| p.bary[k] == 1.0).map(|k| mesh.triangles[p.face as usize][k]);
    let edge = |w: &[FacePoint]| match [vertex(&w[0]), vertex(&w[1])] {
        [Some(a), Some(b)] => Some((a.min(b), a.max(b))),
        _ => None,
    };
    let taken: BTreeSet<(u32, u32)> =
        network.curves.iter().flat_map(|c| c.points.windows(2)).filter_map(edge).collect();
    let mut points = line.points.clone();
    points.extend(line.points.first().filter(|_| line.closed));
    let is_free = |w: &[FacePoint]| edge(w).is_none_or(|e| !taken.contains(&e));
    if points.windows(2).all(is_free) {
        return vec![line.clone()];
    }
    let mut parts: Vec<Vec<FacePoint>> = Vec::new();
    let mut goes_on = false;
    for w in points.windows(2) {
        match (is_free(w), parts.last_mut().filter(|_| goes_on)) {
            (true, Some(part)) => part.push(w[1]),
            (true, None) => parts.push(w.to_vec()),
            (false, _) => {}
        }
        goes_on = is_free(w);
    }
    parts.into_iter().map(SurfaceCurve::open).collect()
}
