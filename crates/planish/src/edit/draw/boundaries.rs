//! Draws the boundaries of the mesh as curves, where there are none yet (`docs/guide/edit.md`).

use crate::edit::work::Work;
use crate::edit::{ApplyError, Command};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The boundaries of the mesh as curves, where there are none yet.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Boundaries {}

impl Command for Boundaries {
    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        work.edit(|e, _, _| e.add_boundaries()).map(drop)
    }
}
