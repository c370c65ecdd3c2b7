//! Relief: what a surface leaves out of its grid, as a vector displacement map.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A vector displacement map at the nodes of a grid, row-major as [`crate::grid::Grid`].
///
/// A vector `(t, b, n)` is meant in the orthonormal frame `T = S_u / |S_u|`, `B = N x T`,
/// `N = S_u x S_v / |S_u x S_v|` of the surface at the node.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Relief {
    /// Nodes along `v`.
    pub rows: usize,
    /// Nodes along `u`.
    pub cols: usize,
    /// Displacements `(t, b, n)`, world units.
    pub vectors: Vec<DVec3>,
}
