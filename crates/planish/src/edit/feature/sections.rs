//! Sets the numbers of cells between the feature curves of a patch ([K98] §5.11.4: a section refined alone).

use crate::edit::check;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, Spot};
use crate::grid;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Cells of a section at most: a grid as fine as the finest displacement maps.
const MOST_CELLS: usize = 2048;

/// Gives the numbers of cells between the feature curves of a patch; empty lists take them back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sections {
    /// A place in the patch.
    pub at: Spot,
    /// Along u.
    #[serde(default)]
    pub u: Vec<usize>,
    /// Along v.
    #[serde(default)]
    pub v: Vec<usize>,
}

impl Command for Sections {
    fn check(&self) -> Result<(), ApplyError> {
        check::spot("at", &self.at)?;
        self.u.iter().chain(&self.v).try_for_each(|&c| match c {
            2..=MOST_CELLS => Ok(()),
            c => Err(ApplyError::OutOfRange {
                what: "the number of cells of a section",
                value: c as f64,
                wanted: "between 2 and 2048",
            }),
        })
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let (patch, cut) = work.patch_at(&work.place(&self.at)?)?;
        let sections = &mut work.drawing.sketch.sections;
        sections.retain(|s| s.0 != patch);
        if !self.u.is_empty() || !self.v.is_empty() {
            sections.push((patch, grid::Sections { u: self.u.clone(), v: self.v.clone() }));
        }
        work.check_features(patch, &cut)
    }
}
