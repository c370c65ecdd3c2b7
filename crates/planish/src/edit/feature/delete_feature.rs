//! Deletes a feature curve ([K98] §5.10).

use super::forget_cells;
use crate::edit::check;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, Name};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Deletes a feature curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DeleteFeature {
    /// Its number.
    pub feature: Name,
}

impl Command for DeleteFeature {
    fn check(&self) -> Result<(), ApplyError> {
        check::name(&self.feature)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let feature = work.feature(&self.feature)?;
        delete(work, feature);
        Ok(())
    }
}

/// Deletes a feature curve that is there.
pub(in crate::edit) fn delete(work: &mut Work, feature: u32) {
    let sketch = &mut work.drawing.sketch;
    let gone = sketch.features.remove(feature as usize);
    forget_cells(&mut sketch.sections, gone.patch, gone.family);
}
