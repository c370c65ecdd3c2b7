//! Pulls an edit point of a curve; the edit section around it relaxes ([K98] §3.8.1).

use crate::edit::check::{self, Range, within};
use crate::edit::network::{Editor, Holds, Stretch};
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, CurveName, CurveNumber, Forces, RelaxedCurve};
use crate::mesh::move_point_on_surface;
use crate::observe::Observer;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Pulls a point of a curve; a section around it relaxes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DragCurve {
    /// The curve.
    pub curve: CurveName,
    /// Share of its length; 0 or 1 for an end of a feature curve, which then goes along its side.
    pub at: f64,
    /// World units.
    pub by: [f64; 3],
    /// Share of the length that relaxes.
    #[serde(default = "usual_width")]
    pub width: f64,
    /// How it relaxes.
    #[serde(default)]
    pub forces: Forces,
    /// Shares of the length where the curve stays where it is.
    #[serde(default)]
    pub pins: Vec<f64>,
    /// Stretches with weights of their own.
    #[serde(default)]
    pub stiffness: Vec<Stretch>,
}

fn usual_width() -> f64 {
    0.6
}

impl Command for DragCurve {
    fn check(&self) -> Result<(), ApplyError> {
        check::curve(&self.curve)?;
        within("at", self.at, Range::Share)?;
        check::finite("by", &self.by)?;
        within("width", self.width, Range::Positive)?;
        check::forces(&self.forces)?;
        check::holds(&self.pins, &self.stiffness)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let (curve, by) = (work.curve(&self.curve)?, work.shift(&self.by)?);
        let section = Some((self.at, self.width));
        let holds = Holds { section, field: None, pins: &self.pins, stiffness: &self.stiffness };
        let params = self.forces.params();
        let is_feature = matches!(curve, CurveNumber::Feature(_));
        let change = |e: &mut Editor, curve: u32, observer: &dyn Observer| match [0.0, 1.0]
            .iter()
            .position(|&end| end == self.at)
        {
            // The ends of a feature curve are no corners that others share: they are dragged with it.
            Some(end) if is_feature => {
                let at = e.network.corners[end].place;
                let to = move_point_on_surface(e.mesh, e.adjacency, at, by);
                let all = e.drag_corner(end as u32, to, self.width, &params, observer)?;
                Ok(all.first().map(|&(_, relaxed)| relaxed))
            }
            _ => e.drag_curve(curve, (self.at, by), &holds, &params, observer).map(Some),
        };
        let relaxed = work.edit_curve(curve, change)?;
        work.relaxed.extend(relaxed.map(|relaxed| RelaxedCurve { curve, relaxed }));
        Ok(())
    }

    fn only_moves(&self) -> bool {
        true
    }
}
