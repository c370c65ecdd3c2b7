//! Spring grids: a four-sided patch resampled to a regular grid on the mesh.

use crate::mesh::FacePoint;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A patch resampled to `rows x cols` points of the mesh.
///
/// Row-major: point `(i, j)` with `i` along `u` and `j` along `v` is `points[j * cols + i]`; `i = 0` is side 3
/// of the patch, `i = cols - 1` side 1, `j = 0` side 0, `j = rows - 1` side 2.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// Points along `v`.
    pub rows: usize,
    /// Points along `u`.
    pub cols: usize,
    /// Positions, world units.
    pub points: Vec<DVec3>,
    /// The same points as places on the input mesh.
    pub places: Vec<FacePoint>,
}
