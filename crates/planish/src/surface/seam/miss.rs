//! What fits miss, which seams may add a share to.

use crate::grid::Grid;
use crate::surface::Surface;
use crate::surface::quality::heights;
use crate::surface::sides::diagonal;
use rayon::prelude::*;

/// The loss is measured against a fit that misses by this share of the diagonal at least: rounding.
const EXACT: f64 = 1e-9;

/// What a fit misses along the normal, as moves go: sideways a surface may lie off its grid and still be on the mesh.
pub(crate) struct Misses {
    /// For each patch the sum of the squared distances of its nodes along the normal, and their number.
    squares: Vec<(f64, f64)>,
    /// The mean over all nodes.
    mean: f64,
    /// The largest distance of all along the normal.
    pub most: f64,
}

impl Misses {
    /// * `grids` - those that `surfaces` were fitted to
    pub fn new(surfaces: &[Surface], grids: &[Grid]) -> Misses {
        let each: Vec<Vec<f64>> = surfaces.par_iter().zip(grids).map(|(s, g)| heights(s, g)).collect();
        let squares: Vec<(f64, f64)> =
            each.iter().map(|of| (of.iter().map(|h| h * h).sum(), of.len() as f64)).collect();
        let most = each.iter().flatten().copied().fold(0.0, f64::max);
        let (sum, count) = squares.iter().fold((0.0, 0.0), |(a, b), (c, d)| (a + c, b + d));
        let mean = sum / count + (EXACT * diagonal(grids)).powi(2);
        Misses { squares, mean, most }
    }

    /// The squared move per node that a patch can afford: half by what it misses itself, half by what all miss.
    pub fn afford(&self, patch: usize) -> f64 {
        let (sum, count) = self.squares[patch];
        (sum / count + self.mean) / 2.0
    }

    /// The squared move per node that a tolerance (RMS, world units) leaves a patch beside what it misses itself.
    pub fn left_of(&self, tolerance: f64, patch: usize) -> f64 {
        let (sum, count) = self.squares[patch];
        (tolerance * tolerance - sum / count).max(0.0)
    }

    /// [`Misses::afford`] for all its nodes.
    pub fn afford_all(&self, patch: usize) -> f64 {
        self.afford(patch) * self.squares[patch].1
    }
}

/// The largest distance of a surface from its grid along the normal.
pub(crate) fn farthest(surface: &Surface, grid: &Grid) -> f64 {
    heights(surface, grid).into_iter().fold(0.0, f64::max)
}
