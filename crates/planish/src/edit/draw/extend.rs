//! Leads a curve on from its free end through more picks ([K98] §3.2).

use crate::curve::{PaintMode, SurfaceCurve};
use crate::edit::check::{self, Range, within};
use crate::edit::place::usual_snap;
use crate::edit::stroke::Brush;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, CurveName, CurveNumber, Magnetism, Spot};
use crate::network::CurveKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Leads a curve on from its free end through more picks, as [`super::Paint`] would.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Extend {
    /// The curve; the end that it was painted towards is meant if both are free, and of a feature curve always.
    pub curve: CurveName,
    /// The picks, in order.
    #[serde(default)]
    pub picks: Vec<Spot>,
    /// How the way between picks is found.
    #[serde(default)]
    pub mode: PaintMode,
    /// True to lead it on to its own other end.
    #[serde(default)]
    pub closed: bool,
    /// What a magnetic stroke is drawn to.
    #[serde(default)]
    pub magnet: Option<Magnetism>,
    /// Share of the diagonal.
    #[serde(default = "usual_snap")]
    pub snap: f64,
}

impl Command for Extend {
    fn check(&self) -> Result<(), ApplyError> {
        check::curve(&self.curve)?;
        check::picks(&self.picks)?;
        check::magnetism(self.magnet.as_ref(), self.mode)?;
        within("snap", self.snap, Range::NotNegative)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let brush = Brush { mode: self.mode, magnet: self.magnet.as_ref(), snap: self.snap };
        match work.curve(&self.curve)? {
            CurveNumber::Curve(curve) => self.extend_curve(work, curve, &brush),
            CurveNumber::Feature(feature) if self.closed => Err(ApplyError::SideToSide { feature }),
            CurveNumber::Feature(feature) => {
                let mut points = work.drawing.sketch.features[feature as usize].points.clone();
                let brush = Brush { snap: 0.0, ..brush };
                let way = work.stroke_between(points.last().copied(), &self.picks, None, false, &brush)?;
                let known = points.len().min(1);
                points.extend_from_slice(way.points.get(known..).unwrap_or_default());
                work.redraw_feature(feature, points)
            }
        }
    }
}

impl Extend {
    fn extend_curve(&self, work: &mut Work, curve: u32, brush: &Brush) -> Result<(), ApplyError> {
        let network = &work.drawing.network;
        let [start, end] = network.curves[curve as usize].corners;
        let ends = |k: u32| network.curves.iter().flat_map(|c| c.corners).filter(|&c| c == k).count();
        let free = [end, start].into_iter().find(|&k| ends(k) == 1).ok_or(ApplyError::NotFree { curve })?;
        let place = |k: u32| network.corners[k as usize].place;
        let other = if free == end { start } else { end };
        let to = self.closed.then(|| place(other));
        let mut way = work.stroke_between(Some(place(free)), &self.picks, to, false, brush)?;
        take_back_spur(work, curve, free, &mut way);
        work.edit(|e, diagonal, _| -> Result<(), ApplyError> {
            e.draw_curve(&way, CurveKind::Smooth, self.snap * diagonal)?;
            let ends = e.ends_at(free);
            if ends.len() == 2 && ends[0] / 2 != ends[1] / 2 {
                e.join(free)?;
            }
            Ok(())
        })
    }
}

/// A way that is drawn to something may go back along the curve that it leads on: the corner `free` between them
/// goes back to where they part.
fn take_back_spur(work: &mut Work, curve: u32, free: u32, way: &mut SurfaceCurve) {
    let mesh = work.ground.canvas.mesh;
    let network = &mut work.drawing.network;
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
