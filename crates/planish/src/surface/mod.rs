//! B-spline surfaces fitted to grids, and their seams.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, ch. 4, 6 and 8.
//! 1. basis and evaluation - `basis`, `evaluate`      2. one grid - `fit`, eq. 4.4
//! 3. a network without gaps and folds - `params`, `network_fit`, `resolution`, `spacing`, `fold`
//! 4. smooth seams - `seam`, §8.1      5. how good it is - `quality`, eq. 6.1
//! 6. exact mirror images where there is a plane of symmetry - `mirrored`      7. after small edits - `retouch`
//! 8. that none turns over, and which cross - `sound`

pub mod basis;
mod error;
mod evaluate;
mod exact;
mod fit;
mod fold;
mod mirrored;
mod network_fit;
mod params;
mod quality;
mod resolution;
mod retouch;
mod seam;
mod sides;
mod sound;
mod spacing;

pub use error::FitError;
pub use evaluate::Jet;
pub(crate) use evaluate::RowSampler;
pub use exact::{EXACT_DEG, Exact, exact};
pub use fit::{FEWEST_CONTROL, fit};
pub use fold::folds;
pub use mirrored::{mirror_grids, mirror_surfaces};
pub use network_fit::{fit_network, starved};
pub use params::{Continuity, FitParams, KnotSpacing, Measure, Resolution};
pub use quality::{
    Deviation, SeamAngle, SeamQuality, deviation, deviation_of, measure_seams, measure_seams_apart,
    normal_deviation_of, normal_rms, seam_angles,
};
pub use retouch::retouch;
pub use seam::{BENT_DEG, EDGE_ANGLE_DEG, EdgeInSeam, StitchParams, edges_in_seams, stitch, stitch_near};
pub(crate) use sides::{check, check_grids, node};
pub use sound::{Crossing, Facet, Turning, crossings, facet_error, turning};

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A tensor-product cubic B-spline surface over `[0, 1]²` with clamped knots.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Surface {
    /// Control points along `v`.
    pub rows: usize,
    /// Control points along `u`.
    pub cols: usize,
    /// Control points, row-major: `(i, j)` with `i` along `u`, `j` along `v` is `control[j * cols + i]`.
    pub control: Vec<DVec3>,
    /// Knots along `u`, `cols + 4` of them, from 0 to 1.
    pub knots_u: Vec<f64>,
    /// Knots along `v`, `rows + 4` of them, from 0 to 1.
    pub knots_v: Vec<f64>,
}
