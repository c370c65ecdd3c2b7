//! Deletes a corner without curves, or joins the two curves at it (`docs/guide/edit.md`).

use crate::edit::check;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, Name};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Deletes a corner without curves or between two.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DeleteCorner {
    /// The corner.
    pub corner: Name,
}

impl Command for DeleteCorner {
    fn check(&self) -> Result<(), ApplyError> {
        check::name(&self.corner)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let corner = work.corner(&self.corner)?;
        work.edit(|e, _, _| e.delete_corner(corner))
    }
}
