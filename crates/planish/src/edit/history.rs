//! Edits of the history, undo and redo: they go to the model, not to its drawing (`docs/guide/edit.md`).

use super::work::Work;
use super::{ApplyError, Command};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Takes back the last edits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Undo {
    /// How many.
    #[serde(default = "once")]
    pub count: usize,
}

/// Makes edits again that were taken back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Redo {
    /// How many.
    #[serde(default = "once")]
    pub count: usize,
}

fn once() -> usize {
    1
}

impl Command for Undo {
    fn apply(&self, _: &mut Work) -> Result<(), ApplyError> {
        Err(ApplyError::NotADrawing)
    }
}

impl Command for Redo {
    fn apply(&self, _: &mut Work) -> Result<(), ApplyError> {
        Err(ApplyError::NotADrawing)
    }
}
