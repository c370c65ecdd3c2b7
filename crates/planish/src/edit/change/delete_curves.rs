//! Deletes curves; regions on both sides become one (`docs/guide/edit.md`).

use crate::edit::check;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, Name};
use serde::{Deserialize, Serialize};

/// Deletes curves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeleteCurves {
    /// The curves, numbered as before the edit.
    pub curves: Vec<Name>,
}

impl Command for DeleteCurves {
    fn check(&self) -> Result<(), ApplyError> {
        self.curves.iter().try_for_each(check::name)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let mut curves = self.curves.iter().map(|c| work.curve(c)).collect::<Result<Vec<_>, _>>()?;
        curves.sort_unstable();
        curves.dedup();
        work.edit(|e, _, _| curves.iter().rev().try_for_each(|&c| e.delete_curve(c)))
    }
}
