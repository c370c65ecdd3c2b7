//! B-spline surfaces fitted to grids, and their seams.

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
