//! What a fit is asked for: how fine, how close, how smooth.

use super::FitError;
use super::quality::Deviation;
use super::sides::diagonal;
use crate::grid::Grid;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Most control points along a curve.
const MOST_CONTROL: usize = 8193;

/// How to fit the surfaces of a network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FitParams {
    /// How many control points, directly or by a tolerance.
    pub resolution: Resolution,
    /// Which distance of a patch the tolerance bounds: the root of the mean square, that which 95 of 100 do not exceed, or the
    /// largest.
    pub tolerance_of: Measure,
    /// Where the knots of a tolerance stand: `fitted`, close where the shape bends much, or `even`, at equal steps.
    pub knots: KnotSpacing,
    /// Control points of single patches: the patch, those along `u` and those along `v`, at least 4 each. They go over all else,
    /// along the chords of the patch; of two patches on a chord the larger number counts.
    #[schemars(extend("per_patch" = true))]
    pub control_at: Vec<[usize; 3]>,
    /// Most control points of all surfaces together that a tolerance may take; it is widened until they do.
    #[schemars(range(min = 16))]
    pub max_control: Option<usize>,
    /// Fewest grid cells per knot span in each direction; a tolerance that asks for more control points is not
    /// reached. Spans of a cell or two follow the noise of a scan and swing between its points.
    #[schemars(range(min = 1.0, max = 1e3), extend("unit" = "cells"))]
    pub cells_per_span: f64,
    /// Weight of bends of the control net against the distances of the grid's points: 0 for plain least squares, but
    /// inside patches that would fold; more leaves more of the detail to the relief. A hundredth of what the points of a
    /// span weigh keeps control points still that few points decide, and the noise of a scan out of them.
    #[schemars(range(min = 0.0, max = 1e4))]
    pub smoothing: f64,
    /// How surfaces meet along smooth seams.
    pub continuity: Continuity,
}

/// How surfaces meet along smooth seams.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Continuity {
    /// Without gaps; the angle is what the fit of each patch makes of it.
    C0,
    /// With one tangent plane along each seam, to the tolerance of the angle.
    #[default]
    G1,
    /// As `g1`, with double knots in chords that end in a corner where not four patches meet: there the angle can go to nothing
    /// with more control points, which with simple knots it cannot, but with as many control points both the angle and the
    /// distance are larger.
    G1Double,
    /// With one tangent plane along each seam to a thousandth of a degree, by double knots along all of them and conditions in place of weights
    /// ([`super::exact`]). With as many control points the distance is a few times larger.
    G1Exact,
}

impl Default for FitParams {
    /// A tolerance of 1/1000 of the diagonal and four cells per span: the smooth shape; the relief has the rest.
    fn default() -> FitParams {
        FitParams {
            resolution: Resolution::Tolerance(1e-3),
            tolerance_of: Measure::Rms,
            knots: KnotSpacing::Fitted,
            control_at: Vec::new(),
            max_control: None,
            cells_per_span: 4.0,
            smoothing: 0.01,
            continuity: Continuity::G1,
        }
    }
}

impl FitParams {
    pub(super) fn check(&self) -> Result<(), FitError> {
        let (cells, smoothing) = (self.cells_per_span, self.smoothing);
        let wrong = |name, value, wanted| Err(FitError::Parameter { name, value, wanted });
        match self.resolution {
            Resolution::Tolerance(share) if !(share > 0.0 && share.is_finite()) => wrong("tolerance", share, "above 0"),
            _ if self.control_at.iter().any(|[_, u, v]| *u.max(v) > MOST_CONTROL) => {
                let most = self.control_at.iter().map(|[_, u, v]| *u.max(v)).fold(0, usize::max);
                wrong("control_at", most as f64, "8193 or less along each direction")
            }
            _ if !(cells >= 1.0 && cells.is_finite()) => wrong("cells_per_span", cells, "1 or more"),
            _ if !(smoothing >= 0.0 && smoothing.is_finite()) => wrong("smoothing", smoothing, "0 or more"),
            _ => Ok(()),
        }
    }

    /// The distance that a tolerance of the RMS allows, world units; 0 without such a one.
    pub fn rms_allowed(&self, grids: &[Grid]) -> f64 {
        if self.tolerance_of == Measure::Rms { self.allowed(grids) } else { 0.0 }
    }

    /// The distance that the tolerance allows, world units; 0 without one.
    pub(super) fn allowed(&self, grids: &[Grid]) -> f64 {
        match self.resolution {
            Resolution::Tolerance(share) => share * diagonal(grids),
            _ => 0.0,
        }
    }
}

/// How fine the control nets are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Resolution {
    /// Control points along `u` and along `v` of every patch, each at least 4. A chord that runs along `u` in
    /// one patch and along `v` in another gets the larger number.
    Control(#[schemars(inner(range(min = 4, max = 8193)))] [usize; 2]),
    /// Control points along every curve of the network, each at least 4. A chord gets the largest number
    /// among its curves.
    PerCurve(#[schemars(inner(range(min = 4, max = 8193)))] Vec<usize>),
    /// Largest distance of a patch from its grid along the normal, as a fraction of the bounding-box diagonal;
    /// [`FitParams::tolerance_of`] says which distance.
    #[schemars(description = "Largest distance of a patch along the normal, as --tolerance-of says")]
    Tolerance(#[schemars(extend("exclusiveMinimum" = 0.0, "tolerance" = "share"))] f64),
}

/// Which of the distances of a patch a tolerance bounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// The root of their mean square.
    #[default]
    Rms,
    /// That which 95 of 100 do not exceed.
    P95,
    /// The largest.
    Max,
}

impl Measure {
    /// Its short name.
    pub fn name(self) -> &'static str {
        match self {
            Measure::Rms => "RMS",
            Measure::P95 => "at 95 %",
            Measure::Max => "at most",
        }
    }

    /// The one of three measures that this is.
    pub fn among(self, deviation: &Deviation) -> f64 {
        match self {
            Measure::Rms => deviation.rms,
            Measure::P95 => deviation.p95,
            Measure::Max => deviation.max,
        }
    }

    /// The measure of some distances; 0 of none.
    pub fn of(self, distances: &[f64]) -> f64 {
        let n = distances.len();
        match self {
            _ if n == 0 => 0.0,
            Measure::Rms => (distances.iter().map(|d| d * d).sum::<f64>() / n as f64).sqrt(),
            Measure::P95 => {
                let mut all = distances.to_vec();
                *all.select_nth_unstable_by((n - 1) * 95 / 100, f64::total_cmp).1
            }
            Measure::Max => distances.iter().copied().fold(0.0, f64::max),
        }
    }
}

/// Where the knots of a tolerance stand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum KnotSpacing {
    /// Close where the shape bends much and far apart where it does not.
    #[default]
    Fitted,
    /// At equal steps.
    Even,
}
