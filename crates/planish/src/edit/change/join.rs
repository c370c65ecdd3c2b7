//! Joins the two curves at a corner into one (`docs/guide/edit.md`).

use crate::edit::check;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, Name};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Joins the two curves at a corner.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Join {
    /// The corner.
    pub corner: Name,
}

impl Command for Join {
    fn check(&self) -> Result<(), ApplyError> {
        check::name(&self.corner)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let corner = work.corner(&self.corner)?;
        work.edit(|e, _, _| e.join(corner)).map(drop)
    }
}
