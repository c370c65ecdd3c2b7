//! Deletes curves; regions on both sides become one (`docs/guide/edit.md`).

use crate::edit::check;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, CurveName, CurveNumber, feature};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Deletes curves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DeleteCurves {
    /// The curves, numbered as before the edit; feature curves among them.
    pub curves: Vec<CurveName>,
}

impl Command for DeleteCurves {
    fn check(&self) -> Result<(), ApplyError> {
        self.curves.iter().try_for_each(check::curve)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let (mut curves, mut features) = (BTreeSet::new(), BTreeSet::new());
        for name in &self.curves {
            match work.curve(name)? {
                CurveNumber::Curve(curve) => curves.insert(curve),
                CurveNumber::Feature(feature) => features.insert(feature),
            };
        }
        features.iter().rev().for_each(|&f| feature::delete(work, f));
        work.edit(|e, _, _| curves.iter().rev().try_for_each(|&c| e.delete_curve(c)))
    }
}
