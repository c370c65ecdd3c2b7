//! Splits a region of three, five or six sides into four-sided patches (`docs/methods/curves.md`, "Regions").

use crate::edit::check;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, Spot};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Splits a region of 3, 5 or 6 sides into four-sided patches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SplitRegion {
    /// A place in the region.
    pub at: Spot,
    /// Turns the split; absent for the flattest corner.
    #[serde(default)]
    pub from: Option<usize>,
}

impl Command for SplitRegion {
    fn check(&self) -> Result<(), ApplyError> {
        check::spot("at", &self.at)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let place = work.place(&self.at)?;
        let split = work.edit(|e, _, _| {
            let region = e.region_at(&place)?;
            e.split_region(region, self.from)
        });
        split.map(drop)
    }
}
