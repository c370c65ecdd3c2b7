//! Lays out every region that is no patch yet (`docs/methods/curves.md`, "Completing").

use crate::edit::check::{Range, count, within};
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command};
use crate::layout::LayoutParams;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Lays out everything that is not parted yet.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Complete {
    /// Patches to aim at, over the whole mesh.
    pub patches: usize,
    /// Edges sharper than this become curves, degrees.
    #[serde(default = "usual_sharp")]
    pub sharp_angle_deg: f64,
}

fn usual_sharp() -> f64 {
    40.0
}

impl Command for Complete {
    fn check(&self) -> Result<(), ApplyError> {
        count("patches", self.patches, 1, "1 or more")?;
        within("sharp_angle_deg", self.sharp_angle_deg, Range::Angle)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let Complete { patches, sharp_angle_deg } = *self;
        let params = LayoutParams { patches, sharp_angle_deg, ..LayoutParams::default() };
        work.edit(|e, _, observer| e.complete(&params, observer))
    }
}
