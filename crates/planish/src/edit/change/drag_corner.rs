//! Drags a corner; its curves follow as snakes, and on a boundary or sharp line it slides.
//!
//! [K98] §3.8.1; `docs/methods/curves.md`, "Sliding corners".

use crate::edit::check::{self, Range, within};
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, CurveNumber, Forces, Name, RelaxedCurve, Spot};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Moves a corner; its curves follow.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DragCorner {
    /// The corner.
    pub corner: Name,
    /// Where to.
    pub to: Spot,
    /// Share of each curve that relaxes.
    #[serde(default = "usual_reach")]
    pub reach: f64,
    /// How it relaxes.
    #[serde(default)]
    pub forces: Forces,
}

fn usual_reach() -> f64 {
    0.6
}

impl Command for DragCorner {
    fn check(&self) -> Result<(), ApplyError> {
        check::name(&self.corner)?;
        check::spot("to", &self.to)?;
        within("reach", self.reach, Range::Positive)?;
        check::forces(&self.forces)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let (corner, to) = (work.corner(&self.corner)?, work.place(&self.to)?);
        let params = self.forces.params();
        let relaxed = work.edit(|e, _, observer| e.drag_corner(corner, to, self.reach, &params, observer))?;
        work.relaxed.extend(
            relaxed.into_iter().map(|(curve, relaxed)| RelaxedCurve { curve: CurveNumber::Curve(curve), relaxed }),
        );
        Ok(())
    }

    fn only_moves(&self) -> bool {
        true
    }
}
