//! Scalar grids (volume images), and how they are read.
//!
//! Input of [K01] §4.1; see `docs/methods/fields.md`.

use super::lattice::{Lattice, LatticeError, Spacing};
use super::{Field, FieldError};
use crate::observe::Observer;
use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A regular grid of numbers, x fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct ScalarGrid {
    /// Samples along each axis.
    pub size: [usize; 3],
    /// Position of the first sample, world units.
    pub origin: DVec3,
    /// Distance between samples along each axis, world units.
    pub spacing: DVec3,
    /// The numbers. Shared: fields and meshes made from a volume do not copy it.
    pub values: Arc<Vec<f32>>,
}

impl ScalarGrid {
    /// The values of a field at the nodes of a lattice around its surface, NaN where it does not know.
    /// * `memory` - bytes that the numbers may take
    /// # Errors
    /// [`FieldError::Lattice`] if there is no such lattice or too little memory; [`FieldError::Cancelled`].
    pub fn of_field(
        field: &dyn Field,
        spacing: Spacing,
        memory: u64,
        observer: &dyn Observer,
    ) -> Result<ScalarGrid, FieldError> {
        let lattice = Lattice::around(&field.bounds(), spacing)?;
        let size = [0, 1, 2].map(|axis| lattice.nodes(axis));
        let needed = size.iter().map(|&n| n as u64).product::<u64>() * size_of::<f32>() as u64;
        if needed > memory {
            return Err(LatticeError::Memory { cells: lattice.cells, needed, allowed: memory }.into());
        }
        let [nx, ny, nz] = size;
        let layer = |k: usize| -> Result<Vec<f32>, FieldError> {
            observer.check()?;
            let points: Vec<DVec3> = (0..nx * ny).map(|n| lattice.node(n % nx, n / nx, k)).collect();
            let mut values = vec![0.0; points.len()];
            // Rows, so that a slow field is asked again soon whether it is still wanted.
            for (points, values) in points.chunks(nx * ROWS).zip(values.chunks_mut(nx * ROWS)) {
                observer.check()?;
                field.values(points, values);
            }
            Ok(values.into_iter().map(|v| v as f32).collect())
        };
        let layers: Vec<Vec<f32>> = (0..nz).into_par_iter().map(layer).collect::<Result<_, _>>()?;
        observer.progress(1.0);
        let values = Arc::new(layers.concat());
        Ok(ScalarGrid { size, origin: lattice.origin, spacing: lattice.step, values })
    }
}

/// Rows of a lattice that a field is asked for at a time.
const ROWS: usize = 16;

/// How gradients are estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GradientRule {
    /// As trilinear, but beside sharp edges from the side on which the numbers go on straight; hits, too
    #[default]
    OneSided,
    /// Of the trilinear interpolant: the exact difference along the edge
    Trilinear,
    /// Central differences at the nodes, interpolated: smoother
    Central,
}

/// On which side of the level the body lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Body {
    /// Where numbers are below the level, as in distance fields
    #[default]
    Below,
    /// Where numbers are above the level, as in tomography
    Above,
}

/// How a grid is read as a field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GridParams {
    /// The level of the surface, in the grid's numbers
    pub iso: f64,
    /// On which side of the level the body lies
    pub body: Body,
    /// How normals are estimated
    pub gradient: GradientRule,
    /// Close the surface where it meets the border of the grid
    pub close: bool,
}

impl Default for GridParams {
    fn default() -> Self {
        GridParams { iso: 0.0, body: Body::Below, gradient: GradientRule::OneSided, close: true }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Silent;
    use crate::field::{Solid, sample_grid};

    #[test]
    fn the_surface_of_a_sampled_ball_is_where_it_was_within_a_twentieth_of_a_cell() {
        let ball = Solid::Sphere { radius: 2.0 };
        let grid = ScalarGrid::of_field(&ball, Spacing::Resolution(40), 1 << 30, &Silent).unwrap();
        assert_eq!(grid.values.len(), grid.size.iter().product::<usize>());
        let found = sample_grid(&grid, &GridParams::default(), &Silent).unwrap();
        let mut hits = 0;
        for axis in 0..3 {
            for row in 0..found.lattice.rows() {
                for n in found.axes[axis].start[row]..found.axes[axis].start[row + 1] {
                    let off = (found.position(axis, row, n as usize).length() - 2.0).abs();
                    assert!(off < 0.05 * grid.spacing.x, "{off}");
                    hits += 1;
                }
            }
        }
        assert!(hits > 3000, "{hits}");
        assert!(matches!(
            ScalarGrid::of_field(&ball, Spacing::Resolution(40), 1000, &Silent),
            Err(FieldError::Lattice(LatticeError::Memory { .. }))
        ));
    }
}
