//! Divides a curve at a share of its length (`docs/guide/edit.md`).

use crate::edit::check::{self, Range, within};
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, CurveName, CurveNumber};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Divides a curve at a share of its length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SplitCurve {
    /// The curve.
    pub curve: CurveName,
    /// 0 to 1.
    pub at: f64,
}

impl Command for SplitCurve {
    fn check(&self) -> Result<(), ApplyError> {
        check::curve(&self.curve)?;
        within("at", self.at, Range::Share)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        match work.curve(&self.curve)? {
            CurveNumber::Curve(curve) => work.edit(|e, _, _| e.split_curve(curve, self.at)).map(drop),
            CurveNumber::Feature(feature) => Err(ApplyError::SideToSide { feature }),
        }
    }
}
