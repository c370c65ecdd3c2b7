//! Adds a corner; on a curve it divides it. Corners and curves are those of [K98] §3 and fig. 1.3.

use crate::edit::check::{self, Range, within};
use crate::edit::place::usual_snap;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, Spot};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A corner; on a curve it divides it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AddCorner {
    /// Where.
    pub at: Spot,
    /// Share of the diagonal.
    #[serde(default = "usual_snap")]
    pub snap: f64,
}

impl Command for AddCorner {
    fn check(&self) -> Result<(), ApplyError> {
        check::spot("at", &self.at)?;
        within("snap", self.snap, Range::NotNegative)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let place = work.place(&self.at)?;
        work.edit(|e, diagonal, _| e.add_corner(place, self.snap * diagonal)).map(drop)
    }
}
