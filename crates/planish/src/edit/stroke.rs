//! Strokes of edits: picks brought onto corners, curves and sharp lines, and the way between them ([K98] §3.2).

use super::work::Work;
use super::{ApplyError, Magnetism, Scalar, Spot};
use crate::curve::{Magnet, PaintMode, PaintParams, SnapTargets, Stroke, SurfaceCurve, snap};
use crate::geom::is_positive;
use crate::mesh::{FacePoint, sharp_edges};

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
        if !is_positive(brush.snap) || matches!(spot, Spot::Corner { .. }) {
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
    pub(super) fn stroke_between(
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
}
