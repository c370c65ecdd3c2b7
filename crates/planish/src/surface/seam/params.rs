//! How far seams are smoothed, and what that may cost.

use crate::surface::FitError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Angle along a smooth seam above which a person is told, and above which it may have what the tolerance of the fit leaves its
/// patches, degrees: the default of a common CAD program. Below, surfaces that follow the form are worth more.
pub const BENT_DEG: f64 = 0.5;

/// How to smooth seams.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StitchParams {
    /// Largest angle between the normals along smooth seams, degrees.
    #[schemars(extend("exclusiveMinimum" = 0.0, "unit" = "degrees"))]
    pub angle_tolerance: f64,
    /// Largest angle by which a sharp seam's sides may turn from the normals of their own grids, degrees.
    #[schemars(extend("exclusiveMinimum" = 0.0, "unit" = "degrees"))]
    pub sharp_tolerance: f64,
    /// Share by which the RMS of the fit may grow for the seams' sake. For a seam that bends by more than half a
    /// degree, the RMS of a patch may grow by this share of what the tolerance of the fit leaves it.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub fit_loss: f64,
    /// Weight of the bends of moves beside their squares: that which the fit had for its own
    /// ([`crate::surface::FitParams::smoothing`]). Without it seams are left with waves beside them on what spans do not follow.
    #[serde(skip)]
    #[schemars(skip)]
    pub smoothing: f64,
    /// The tolerance of the fit, RMS, world units ([`crate::surface::FitParams::rms_allowed`]); 0 if it has none.
    #[serde(skip)]
    #[schemars(skip)]
    pub tolerance: f64,
    /// Read from models of earlier versions, and not used.
    #[serde(skip_serializing)]
    #[schemars(skip)]
    pub stiffness: Option<f64>,
}

impl Default for StitchParams {
    /// .05 degrees, which reflections do not show; a degree for sharp seams; a tenth.
    fn default() -> StitchParams {
        StitchParams {
            angle_tolerance: 0.05,
            sharp_tolerance: 1.0,
            fit_loss: 0.1,
            smoothing: 0.0,
            tolerance: 0.0,
            stiffness: None,
        }
    }
}

impl StitchParams {
    pub(crate) fn check(&self) -> Result<(), FitError> {
        let above = |name, value: f64, wanted, is: bool| match is && value.is_finite() {
            true => Ok(()),
            false => Err(FitError::Parameter { name, value, wanted }),
        };
        above("angle_tolerance", self.angle_tolerance, "above 0", self.angle_tolerance > 0.0)?;
        above("sharp_tolerance", self.sharp_tolerance, "above 0", self.sharp_tolerance > 0.0)?;
        above("fit_loss", self.fit_loss, "0 or more", self.fit_loss >= 0.0)
    }
}
