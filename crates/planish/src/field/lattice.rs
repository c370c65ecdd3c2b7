//! The lattice on which fields are sampled, and what sampling on it costs.
//!
//! The uniform grid `g_ijk` of [K01] §3.

use crate::geom::Aabb;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A regular lattice of cubic cells.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lattice {
    /// Position of node (0, 0, 0), world units.
    pub origin: DVec3,
    /// Edge of a cell along each axis, world units (`h` of [K01]).
    pub step: DVec3,
    /// Cells along each axis; there is one node more.
    pub cells: [usize; 3],
}

/// Empty cells around the surface: it must not touch the outermost nodes.
const MARGIN: f64 = 1.0;
/// Faces of parts are rarely at these fractions of a cell, so that vertices rarely fall on nodes.
const SHIFT: DVec3 = DVec3::new(0.381_966, 0.414_214, 0.449_490);
/// Nodes along one axis at most: edges are named by 21 bits along each axis.
pub const MOST_NODES: usize = 1 << 20;

/// Why there is no such lattice.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LatticeError {
    /// The step is not a positive number.
    #[error("a voxel of {step} is no size; give a number above 0")]
    Step {
        /// The step.
        step: f64,
    },
    /// There is nothing to sample.
    #[error("the field has no extent (its box is {size:?}); check the input")]
    Empty {
        /// Size of the box.
        size: [f64; 3],
    },
    /// More cells along an axis than can be named.
    #[error("{cells} cells along one axis are more than the {} that are possible; use a larger voxel", MOST_NODES - 1)]
    TooFine {
        /// Cells along the axis that has most.
        cells: f64,
    },
    /// More cells than memory allows.
    #[error(
        "{} x {} x {} cells need about {} MB, {} MB are allowed; use a larger voxel or allow more memory",
        cells[0], cells[1], cells[2], needed >> 20, allowed >> 20
    )]
    Memory {
        /// Cells along the axes.
        cells: [usize; 3],
        /// Bytes needed, about.
        needed: u64,
        /// Bytes allowed.
        allowed: u64,
    },
}

/// The size of cells as a user gives it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Spacing {
    /// Edge of a cell
    Voxel(#[schemars(extend("exclusiveMinimum" = 0.0, "unit" = "input units"))] f64),
    /// Cells along the longest side
    Resolution(#[schemars(range(min = 1))] usize),
}

impl Lattice {
    /// A lattice of cubes around `bounds`, with a margin of empty cells.
    /// # Errors
    /// [`LatticeError`] if the box is empty, the step is no size, or more cells come out than can be named.
    pub fn around(bounds: &Aabb, spacing: Spacing) -> Result<Lattice, LatticeError> {
        let size = bounds.size();
        let long = size.max_element();
        if !(long > 0.0 && long.is_finite()) {
            return Err(LatticeError::Empty { size: size.to_array() });
        }
        let h = match spacing {
            Spacing::Voxel(h) => h,
            Spacing::Resolution(n) => long / n.max(1) as f64,
        };
        if !(h > 0.0 && h.is_finite()) {
            return Err(LatticeError::Step { step: h });
        }
        let cells = (size / h).to_array().map(|s| (s + 2.0 * MARGIN + 1.0).ceil());
        let most = cells.into_iter().fold(0.0, f64::max);
        if most >= MOST_NODES as f64 {
            return Err(LatticeError::TooFine { cells: most });
        }
        let origin = bounds.min - (MARGIN + SHIFT) * h;
        Ok(Lattice { origin, step: DVec3::splat(h), cells: cells.map(|c| c as usize) })
    }

    /// Bytes that a directed field of this lattice and its mesh take, about, for a surface of a body that fills its
    /// box like most do (`area` square world units if known).
    pub fn bytes(&self, area: Option<f64>) -> u64 {
        let [x, y, z] = self.cells.map(|c| c as f64);
        // A closed body's surface crosses about three edges for every two faces of its box.
        let faces = area.map_or(2.0 * (x * y + y * z + z * x), |a| a / (self.step.x * self.step.y));
        let hits = 1.6 * faces;
        (hits * BYTES_PER_HIT + (y + 1.0) * (z + 1.0) * BYTES_PER_ROW) as u64
    }

    /// Refuses a lattice whose field would take more than `allowed` bytes.
    /// # Errors
    /// [`LatticeError::Memory`].
    pub fn check_memory(&self, area: Option<f64>, allowed: u64) -> Result<(), LatticeError> {
        let needed = self.bytes(area);
        if needed > allowed { Err(LatticeError::Memory { cells: self.cells, needed, allowed }) } else { Ok(()) }
    }

    /// Nodes along an axis.
    pub fn nodes(&self, axis: usize) -> usize {
        self.cells[axis] + 1
    }

    /// Coordinate of node `i` along `axis`. The one place where it is computed: all neighbours get the same bits.
    pub fn coordinate(&self, axis: usize, i: usize) -> f64 {
        self.origin[axis] + self.step[axis] * i as f64
    }

    /// Position of a node.
    pub fn node(&self, i: usize, j: usize, k: usize) -> DVec3 {
        DVec3::new(self.coordinate(0, i), self.coordinate(1, j), self.coordinate(2, k))
    }

    /// Rows along x: `(nodes along y) x (nodes along z)`.
    pub fn rows(&self) -> usize {
        self.nodes(1) * self.nodes(2)
    }

    /// Number of the row of nodes `(., j, k)`.
    pub fn row(&self, j: usize, k: usize) -> usize {
        k * self.nodes(1) + j
    }

    /// Words of 64 bits that hold one bit for each node of a row.
    pub fn words(&self) -> usize {
        self.nodes(0).div_ceil(64)
    }

    /// The box of all nodes.
    pub fn bounds(&self) -> Aabb {
        Aabb { min: self.origin, max: self.node(self.cells[0], self.cells[1], self.cells[2]) }
    }
}

/// A hit while it is sorted, in its row, and as a vertex with two triangles, while features are brought to their place:
/// 8.9 GB were measured for 27 million.
const BYTES_PER_HIT: f64 = 330.0;
/// Starts of a row in the four tables.
const BYTES_PER_ROW: f64 = 40.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lattice_of_resolution_65_has_cells_of_a_65th_of_the_longest_side_and_a_margin() {
        let bounds = Aabb { min: DVec3::ZERO, max: DVec3::new(6.5, 3.0, 1.0) };
        let l = Lattice::around(&bounds, Spacing::Resolution(65)).unwrap();
        assert!((l.step.x - 0.1).abs() < 1e-15);
        assert!((bounds.min - l.origin).min_element() >= 0.1);
        assert!((l.bounds().max - bounds.max).min_element() >= 0.1);
        assert!(l.cells[0] <= 69);
    }

    #[test]
    fn no_extent_no_size_and_too_much_memory_are_refused() {
        let bounds = Aabb { min: DVec3::ZERO, max: DVec3::ONE };
        assert!(matches!(Lattice::around(&Aabb::EMPTY, Spacing::Voxel(1.0)), Err(LatticeError::Empty { .. })));
        assert!(matches!(Lattice::around(&bounds, Spacing::Voxel(0.0)), Err(LatticeError::Step { .. })));
        assert!(matches!(Lattice::around(&bounds, Spacing::Voxel(1e-9)), Err(LatticeError::TooFine { .. })));
        let l = Lattice::around(&bounds, Spacing::Resolution(1024)).unwrap();
        assert!(matches!(l.check_memory(None, 1 << 20), Err(LatticeError::Memory { .. })));
        assert!(l.check_memory(None, 8 << 30).is_ok());
    }
}
