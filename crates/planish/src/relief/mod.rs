//! Relief: what a surface leaves out of its grid, as a vector displacement map.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, ch. 7 and §8.2.
//! 1. a frame at every node - `frame`      2. bake and displace - `bake`, eq. 7.1
//! 3. maps of one number, folds - `scalar`      4. one mesh of all patches - `weld`
//! 5. images of any size and kind - `maps`, `resample`      6. one sample on both sides of a seam - `seam`, §8.2
//! 7. edits as layers - `layers`, §7.6      8. places of the surfaces closest to points - `closest`
//!
//! Departs from [K98]: its frame `(S_u, S_v, N)` with dot products (eq. 7.1) is exact only where `S_u` and `S_v` are
//! orthogonal; an orthonormal frame is exact everywhere.

mod bake;
mod closest;
mod frame;
mod laplacian;
pub mod layers;
pub mod maps;
mod resample;
mod scalar;
mod seam;
mod waves;
mod weld;

pub use bake::{bake, bake_network, displace};
pub use closest::{SurfacePlace, closest};
pub use frame::{Frame, frame_at, frames};
pub use resample::{resample, resample_all};
pub use scalar::{fold_over, length, normal_component};
pub use seam::{Agreement, agree, seam_nodes, widest_crack};
pub use waves::long_waves;
pub use weld::{
    PatchNodes, PatchedMesh, displaced_mesh, displaced_patches, patch_mesh, span_shapes, surface_mesh, surface_patches,
};

use crate::network::Network;
use crate::observe::Cancelled;
use crate::surface::{FitError, Surface};
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

/// A network with its surfaces and reliefs, one of each per patch.
#[derive(Clone, Copy, Debug)]
pub struct Displaced<'a> {
    /// Which patches meet where.
    pub network: &'a Network,
    /// The surfaces.
    pub surfaces: &'a [Surface],
    /// The displacements.
    pub reliefs: &'a [Relief],
}

impl Displaced<'_> {
    /// Checks that there is one sound surface and one relief per patch.
    /// # Errors
    /// [`ReliefError::Count`], [`ReliefError::Shape`], [`ReliefError::Surface`].
    pub fn check(&self) -> Result<(), ReliefError> {
        let wanted = self.network.patches.len();
        for (what, found) in [("surfaces", self.surfaces.len()), ("reliefs", self.reliefs.len())] {
            if found != wanted {
                return Err(ReliefError::Count { what, found, wanted });
            }
        }
        for (patch, r) in self.reliefs.iter().enumerate() {
            if r.rows < 2 || r.cols < 2 || r.vectors.len() != r.rows * r.cols {
                return Err(ReliefError::Shape { patch, rows: r.rows, cols: r.cols, found: r.vectors.len() });
            }
        }
        Ok(self.surfaces.iter().try_for_each(Surface::check)?)
    }

    /// Checks that no place is displaced by more than the model is long: nobody means that.
    /// # Errors
    /// [`ReliefError::Edit`] with the patch and both lengths.
    pub fn check_lengths(&self) -> Result<(), ReliefError> {
        let most = diagonal(self.surfaces);
        for (patch, relief) in self.reliefs.iter().enumerate() {
            // Numbers that are none are not shorter, either.
            let is_shorter = |length: f64| length <= most;
            let found = relief.vectors.iter().map(|d| d.length()).find(|length| !is_shorter(*length));
            if let Some(length) = found {
                let size = if most < 1e6 { format!("{most:.3}") } else { format!("{most:.3e}") };
                let what = format!("patch {patch} would be displaced by {length:.3e}, and the model is {size} long");
                return Err(ReliefError::Edit { what });
            }
        }
        Ok(())
    }
}

/// Diagonal of the box around the control points of surfaces.
pub(crate) fn diagonal(surfaces: &[Surface]) -> f64 {
    crate::geom::Aabb::of(surfaces.iter().flat_map(|s| &s.control)).diagonal()
}

/// Errors of the relief stage.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReliefError {
    /// One list entry per patch is needed.
    #[error("{found} {what} were given for {wanted} patches; give one each")]
    Count {
        /// What the list holds.
        what: &'static str,
        /// Entries found.
        found: usize,
        /// Patches.
        wanted: usize,
    },
    /// An array's length is not `rows * cols`, or there are fewer than 2 rows or columns.
    #[error("patch {patch} has {found} points for {rows} x {cols} nodes; bake it again")]
    Shape {
        /// The patch.
        patch: usize,
        /// Nodes along `v`.
        rows: usize,
        /// Nodes along `u`.
        cols: usize,
        /// Entries found.
        found: usize,
    },
    /// Two patches disagree on the number of nodes along their curve.
    #[error("curve {curve} has {first} nodes on one side and {second} on the other; give its chord one count")]
    Mismatch {
        /// The curve.
        curve: usize,
        /// Nodes on the first side.
        first: usize,
        /// Nodes on another.
        second: usize,
    },
    /// A surface that cannot be evaluated.
    #[error(transparent)]
    Surface(#[from] FitError),
    /// A side names a curve or a corner that does not exist.
    #[error("patch {patch} uses a curve or corner that the network does not have")]
    Network {
        /// The patch.
        patch: usize,
    },
    /// A map of normals.
    #[error("a map of normals holds no displacements; read back a vector, scalar, length or height map")]
    NoHeights,
    /// An edit that cannot be made.
    #[error("{what}")]
    Edit {
        /// What is wrong with it.
        what: String,
    },
    /// The observer no longer wanted the result.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}
