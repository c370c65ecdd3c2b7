//! Pulls an edit point of a curve; the edit section around it relaxes ([K98] §3.8.1).

use crate::edit::check::{self, Range, within};
use crate::edit::network::{Holds, Stretch};
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, Forces, Name, RelaxedCurve};
use serde::{Deserialize, Serialize};

/// Pulls a point of a curve; a section around it relaxes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DragCurve {
    /// The curve.
    pub curve: Name,
    /// Share of its length.
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
        check::name(&self.curve)?;
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
        let relaxed = work.edit(|e, _, observer| e.drag_curve(curve, self.at, by, &holds, &params, observer))?;
        work.relaxed.push(RelaxedCurve { curve, relaxed });
        Ok(())
    }

    fn only_moves(&self) -> bool {
        true
    }
}
