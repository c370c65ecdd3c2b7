//! Deletes all corners and curves of a drawing (`docs/guide/edit.md`).

use crate::edit::work::Work;
use crate::edit::{ApplyError, Command};
use crate::network::Network;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Deletes all corners and curves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Clear {}

impl Command for Clear {
    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        work.drawing.network = Network::default();
        Ok(())
    }
}
