//! Paints a curve through picks ([K98] §3.2).

use crate::curve::PaintMode;
use crate::edit::check::{self, Range, within};
use crate::edit::place::usual_snap;
use crate::edit::stroke::Brush;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, Magnetism, Spot};
use crate::network::CurveKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Paints a curve through picks. Picks go to corners, curves and sharp edges within `snap` of the diagonal; where
/// the curve meets others, corners divide both.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Paint {
    /// The picks, in order.
    pub picks: Vec<Spot>,
    /// How the way between picks is found.
    #[serde(default)]
    pub mode: PaintMode,
    /// True for a closed curve.
    #[serde(default)]
    pub closed: bool,
    /// What a magnetic stroke is drawn to.
    #[serde(default)]
    pub magnet: Option<Magnetism>,
    /// Share of the diagonal.
    #[serde(default = "usual_snap")]
    pub snap: f64,
}

impl Command for Paint {
    fn check(&self) -> Result<(), ApplyError> {
        check::picks(&self.picks)?;
        check::magnetism(self.magnet.as_ref(), self.mode)?;
        within("snap", self.snap, Range::NotNegative)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let brush = Brush { mode: self.mode, magnet: self.magnet.as_ref(), snap: self.snap };
        let curve = work.stroke(&self.picks, self.closed, &brush)?;
        work.add(&curve, CurveKind::Smooth, self.snap)
    }
}
