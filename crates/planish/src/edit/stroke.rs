//! Strokes of edits: picks brought onto what is there, and curves led on from their ends.

use super::apply::Work;
use super::{ApplyError, Magnetism, Scalar, Spot};
use crate::curve::{Magnet, PaintMode, PaintParams, SnapTargets, Stroke, SurfaceCurve, snap};
use crate::mesh::{FacePoint, sharp_edges};
use crate::network::CurveKind;

/// How a stroke of an edit is painted.
pub(super) struct Brush<'a> {
    pub mode: PaintMode,
    pub magnet: Option<&'a Magnetism>,
    /// Share of the diagonal; nothing to leave picks where they are.
    pub snap: f64,
}

impl Work<'_, '_> {
    /// The place of a pick: on a corner, a curve or a sharp edge within the snap distance, else where it was picked.
    fn pick(&self, spot: &Spot, brush: &Brush) -> Result<FacePoint, ApplyError> {
        let place = self.place(spot)?;
        if !(brush.snap > 0.0) || matches!(spot, Spot::Corner { .. }) {
            return Ok(place);
        }
        let network = &self.drawing.network;
        let corners: Vec<FacePoint> = network.corners.iter().map(|c| c.place).collect();
        let curves: Vec<&[FacePoint]> = network.curves.iter().map(|c| &c.points[..]).collect();
        let targets = SnapTargets { corners: &corners, curves: &curves, lines: self.ground.sharp() };
        let params = PaintParams { snap: brush.snap, ..PaintParams::default() };
        Ok(snap(&self.ground.canvas, place, &targets, &params).0)
    }

    fn magnet(&self, brush: &Brush) -> Result<Option<Magnet>, ApplyError> {
        let canvas = &self.ground.canvas;
        Ok(match (brush.mode, brush.magnet) {
            (PaintMode::Magnetic, Some(Magnetism::Sharp(angle))) => {
                Some(Magnet::of_lines(canvas.mesh, &sharp_edges(canvas.mesh, &canvas.adjacency, *angle)))
            }
            (PaintMode::Magnetic, Some(Magnetism::Scalar(scalar))) => Some(Magnet::of_scalar(&self.field(scalar)?)),
            (PaintMode::Magnetic, _) => Some(Magnet::of_scalar(&self.field(&Scalar::MaximumCurvature)?)),
            _ => None,
        })
    }

    /// A stroke from `from` on, if there is one, through picks, and to `to` or closed.
    fn stroke_between(
        &self,
        from: Option<FacePoint>,
        picks: &[Spot],
        to: Option<FacePoint>,
        closed: bool,
        brush: &Brush,
    ) -> Result<SurfaceCurve, ApplyError> {
        let canvas = &self.ground.canvas;
        let magnet = self.magnet(brush)?;
        let params = PaintParams { mode: brush.mode, ..PaintParams::default() };
        let mut stroke = Stroke::new();
        let places = picks.iter().map(|pick| self.pick(pick, brush));
        for place in from.into_iter().map(Ok).chain(places).chain(to.into_iter().map(Ok)) {
            stroke.add(canvas, place?, &params, magnet.as_ref())?;
        }
        if closed {
            stroke.close(canvas, &params, magnet.as_ref())?;
        }
        let curve = stroke.curve(canvas);
        curve.check(canvas.mesh)?;
        Ok(curve)
    }

    /// A stroke through picks.
    pub(super) fn stroke(&self, picks: &[Spot], closed: bool, brush: &Brush) -> Result<SurfaceCurve, ApplyError> {
        self.stroke_between(None, picks, None, closed, brush)
    }

    /// Leads a curve on from its free end through picks, and to its other end if `closed`.
    pub(super) fn extend(&mut self, curve: u32, picks: &[Spot], closed: bool, brush: &Brush) -> Result<(), ApplyError> {
        let network = &self.drawing.network;
        let [start, end] = network.curves[curve as usize].corners;
        let ends = |k: u32| network.curves.iter().flat_map(|c| c.corners).filter(|&c| c == k).count();
        let free = [end, start].into_iter().find(|&k| ends(k) == 1).ok_or(ApplyError::NotFree { curve })?;
        let place = |k: u32| network.corners[k as usize].place;
        let other = if free == end { start } else { end };
        let mut way = self.stroke_between(Some(place(free)), picks, closed.then(|| place(other)), false, brush)?;
        self.take_back_spur(curve, free, &mut way);
        let snap = brush.snap;
        self.edit(|e, diagonal, _| -> Result<(), ApplyError> {
            e.draw_curve(&way, CurveKind::Smooth, snap * diagonal)?;
            let ends = e.ends_at(free);
            if ends.len() == 2 && ends[0] / 2 != ends[1] / 2 {
                e.join(free)?;
            }
            Ok(())
        })
    }

    /// A way that is drawn to something may go back along the curve that it leads on: the corner `free` between them
    /// goes back to where they part.
    fn take_back_spur(&mut self, curve: u32, free: u32, way: &mut SurfaceCurve) {
        let mesh = self.ground.canvas.mesh;
        let network = &mut self.drawing.network;
        let old = &mut network.curves[curve as usize];
        let at_start = old.corners[0] == free;
        if at_start {
            old.points.reverse();
        }
        let end = old.points.len() - 1;
        let same = |k: usize| old.points[end - k].position(mesh) == way.points[k].position(mesh);
        let spur = (1..=end.min(way.points.len() - 1) / 2).take_while(|&k| same(k)).count();
        old.points.truncate(end + 1 - spur);
        way.points.drain(..spur);
        way.points[0] = old.points[end - spur];
        network.corners[free as usize].place = way.points[0];
        if at_start {
            old.points.reverse();
        }
    }
}
