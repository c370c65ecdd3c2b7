//! Spring grids: a four-sided patch resampled to a regular grid of points that lie on the mesh.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, ch. 5.
//! 1. sides resampled by arc length      - §5.4, [`side`]
//! 2. start grid                         - §5.4, [`chart`]: a convex map of the patch to the unit square
//!    without the triangles that such a map squeezes flat - beyond the paper, `chart::loosen`
//! 3. relax, subdivide, relax            - §5.5 and 5.6, `net::springs`, `net::settle`
//! 4. points moved onto missed detail      - beyond the paper, `net::catch`
//! 5. small edits of a patch's curves      - beyond the paper, [`follow`]
//! 6. number of points along every side  - §5.4 and 5.6, [`sizes`], and more where detail is missed, [`resample`]
//!
//! Departs from [K98]: the start is a convex map instead of crossings of shortest paths (those cross twice or run
//! along a side on curved patches and fold the grid), and points move in that chart, where every step can be
//! checked exactly for folds, instead of walking over the triangles. The fairness force and its schedule of weights are
//! replaced, and aspect ratios are those of chords: `docs/methods/grids.md`.

mod chart;
mod divide;
mod feature;
mod follow;
mod net;
mod quality;
mod resample;
mod side;
mod sizes;

pub use divide::{DivideError, divide};
pub use feature::curve::{FeatureGrid, Sections, relax_with_features};
pub use feature::network::{Drawn, Here, check_features, family_of};
pub use feature::{Family, FeatureCurve, FeatureError};
pub use follow::follow;
pub use quality::{GridQuality, folds, measure};
pub use resample::{Relaxer, densify, resample, resample_by};
pub use sizes::choose_sizes;

use crate::grid::chart::locate::Spot;
use crate::mesh::{FacePoint, TriMesh};
use crate::network::PatchMesh;
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use net::springs;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicUsize, Ordering};

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

/// How patches are resampled.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GridParams {
    /// Grid points per vertex of the patches, over the whole network, to begin with.
    #[schemars(range(min = 0.01, max = 100.0), extend("unit" = "points per vertex"))]
    pub density: f64,
    /// Grids that leave a vertex of their patch further off than this are made finer, in up to three rounds: by 1.25 to
    /// 2 times along a side in each, and until all grids together have three times the points that `density` gave them.
    #[schemars(range(min = 1e-6, max = 1.0), extend("unit" = "diagonal"))]
    pub miss: f64,
    /// Rounds in which rows or columns are doubled where the tolerance of the surfaces needs more control points than the grids
    /// carry. None for a scan unless asked for: beyond the points of its mesh there is noise.
    #[schemars(range(min = 0, max = 8))]
    pub denser_rounds: usize,
    /// Least number of points along a side.
    #[schemars(range(min = 4, max = 1025))]
    pub min_side: usize,
    /// Greatest number of points along a side.
    #[schemars(range(min = 4, max = 8193))]
    pub max_side: usize,
    /// Greatest number of points of all grids together; the density gives way.
    #[schemars(range(min = 1000, max = 4_000_000_000u64))]
    pub max_points: usize,
    /// Weight of square cells against even spacing along the iso-curves: at 45 degrees off square a cell counts as
    /// much as an edge whose length is off by the root of this. Higher values give squarer, less even grids.
    #[schemars(range(min = 0.0001, max = 10.0))]
    pub squareness: f64,
    /// Weight of straight iso-curves: at 32 cells a sideways bend of one edge length counts as much as an edge
    /// whose length is off by this fraction.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub fairness: f64,
}

impl Default for GridParams {
    fn default() -> GridParams {
        GridParams {
            density: 2.0,
            miss: 1.5e-3,
            denser_rounds: 3,
            min_side: 17,
            max_side: 1025,
            max_points: 8_000_000,
            squareness: 0.03,
            fairness: 0.1,
        }
    }
}

impl GridParams {
    /// Checks the values against each other.
    /// # Errors
    /// [`GridError::Sides`].
    pub fn validate(&self) -> Result<(), GridError> {
        if self.min_side > self.max_side {
            return Err(GridError::Sides { least: self.min_side, most: self.max_side });
        }
        Ok(())
    }
}

/// Why patches could not be resampled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GridError {
    /// The number of sizes is not the number of patches.
    #[error("{patches} patches but {sizes} grid sizes; give one size per patch")]
    SizeCount {
        /// Patches given.
        patches: usize,
        /// Sizes given.
        sizes: usize,
    },
    /// The least number of points along a side is above the greatest.
    #[error("sides of at least {least} and at most {most} points are asked for; lower the first or raise the second")]
    Sides {
        /// The least number.
        least: usize,
        /// The greatest.
        most: usize,
    },
    /// A grid needs two points in each direction.
    #[error("patch {patch} was asked for a grid of {cols} x {rows} points; give at least 2 x 2")]
    TooSmall {
        /// Index of the patch.
        patch: usize,
        /// Points along `u`.
        cols: usize,
        /// Points along `v`.
        rows: usize,
    },
    /// A patch mesh is not a disk with four sides.
    #[error("patch {patch} is not a disk with four sides: {reason}; cut it anew from its network")]
    NotADisk {
        /// Index of the patch.
        patch: usize,
        /// What is wrong.
        reason: &'static str,
    },
    /// A side has no length.
    #[error("side {side} of patch {patch} has no length; move its corners apart")]
    DegenerateSide {
        /// Index of the patch.
        patch: usize,
        /// Side, 0 to 3.
        side: usize,
    },
    /// The patch could not be flattened without folds.
    #[error("patch {patch} could not be flattened: {triangles} triangles stay folded; divide it by another curve")]
    Folded {
        /// Index of the patch.
        patch: usize,
        /// Triangles with the wrong orientation.
        triangles: usize,
    },
    /// The observer no longer wanted the result.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// What is wrong with one patch; becomes a [`GridError`] with its index.
#[derive(Debug)]
enum Fault {
    NotADisk(&'static str),
    DegenerateSide(usize),
    Folded(usize),
    Cancelled(Cancelled),
}

impl From<Cancelled> for Fault {
    fn from(cancelled: Cancelled) -> Fault {
        Fault::Cancelled(cancelled)
    }
}

impl Fault {
    fn of_patch(self, patch: usize) -> GridError {
        match self {
            Fault::NotADisk(reason) => GridError::NotADisk { patch, reason },
            Fault::DegenerateSide(side) => GridError::DegenerateSide { patch, side },
            Fault::Folded(triangles) => GridError::Folded { patch, triangles },
            Fault::Cancelled(c) => c.into(),
        }
    }
}

/// Resamples every patch to a regular grid of points on the mesh.
///
/// * `input` - the mesh that places refer to
/// * `patches` - exact sub-meshes of `input`
/// * `sizes` - for each patch `(cols, rows)`, points along `u` and `v`, see [`choose_sizes`]
///
/// Returns one grid per patch. Points on a side lie at equal arc length and have the same bits in both patches of
/// a curve if those have the same number of points along it.
/// # Errors
/// See [`GridError`]; of several faulty patches the first is reported.
/// Source: [K98] §5.4 to 5.6.
pub fn relax(
    input: &TriMesh,
    patches: &[PatchMesh],
    sizes: &[(usize, usize)],
    params: &GridParams,
    observer: &dyn Observer,
) -> Result<Vec<Grid>, GridError> {
    relax_at(input, patches, sizes, &[], params, observer)
}

/// For each side the shares of its length at which a node is to lie, with the node.
type SideStops = [side::Stops; 4];

/// As [`relax`], with stops of the sides of each patch; an empty slice for none at all.
fn relax_at(
    input: &TriMesh,
    patches: &[PatchMesh],
    sizes: &[(usize, usize)],
    stops: &[SideStops],
    params: &GridParams,
    observer: &dyn Observer,
) -> Result<Vec<Grid>, GridError> {
    if patches.len() != sizes.len() {
        return Err(GridError::SizeCount { patches: patches.len(), sizes: sizes.len() });
    }
    let jobs: Vec<Job> = patches.iter().zip(sizes).enumerate().map(|(k, (patch, &size))| (k, patch, size)).collect();
    relax_jobs(input, &jobs, stops, params, observer)
}

/// Vertices that are missed by more than this part of what is allowed are caught.
const CAUGHT: f64 = 0.3;

/// Index of a patch, the patch, and the size of its grid.
type Job<'a> = (usize, &'a PatchMesh, (usize, usize));

fn relax_jobs(
    input: &TriMesh,
    jobs: &[Job],
    stops: &[SideStops],
    params: &GridParams,
    observer: &dyn Observer,
) -> Result<Vec<Grid>, GridError> {
    let none = SideStops::default();
    let caught = CAUGHT * params.miss * input.bounds().diagonal();
    let total: usize = jobs.iter().map(|j| j.1.mesh.triangles.len()).sum::<usize>().max(1);
    let done = AtomicUsize::new(0);
    let results: Vec<Result<Grid, GridError>> = jobs
        .par_iter()
        .with_max_len(1)
        .map(|&(k, patch, (cols, rows))| {
            observer.check()?;
            if cols < 2 || rows < 2 {
                return Err(GridError::TooSmall { patch: k, cols, rows });
            }
            let stops = stops.get(k).unwrap_or(&none);
            let made = relax_patch((input, patch), (cols, rows), stops, params, caught, observer);
            let grid = made.map_err(|f| f.of_patch(k))?;
            let size = patch.mesh.triangles.len();
            observer.progress((done.fetch_add(size, Ordering::Relaxed) + size) as f64 / total as f64);
            Ok(grid)
        })
        .collect();
    results.into_iter().collect()
}

/// Index of the `n`-th point along side `k`, in the direction of the side.
fn rim_node(k: usize, n: usize, cols: usize, rows: usize) -> usize {
    match k {
        0 => n,
        1 => n * cols + cols - 1,
        2 => (rows - 1) * cols + cols - 1 - n,
        _ => (rows - 1 - n) * cols,
    }
}

fn relax_patch(
    (input, patch): (&TriMesh, &PatchMesh),
    (cols, rows): (usize, usize),
    stops: &SideStops,
    params: &GridParams,
    caught: f64,
    observer: &dyn Observer,
) -> Result<Grid, Fault> {
    let chart = chart::flatten(input, patch, stops, [cols, rows], observer)?;
    let spots = springs::relax(&chart, cols, rows, params, caught, observer)?;
    Ok(laid(&chart, &spots, patch, (cols, rows), stops))
}

/// The grid with its nodes at `spots`, those of the sides at their exact places.
fn laid(
    chart: &chart::Chart,
    spots: &[Spot],
    patch: &PatchMesh,
    (cols, rows): (usize, usize),
    stops: &SideStops,
) -> Grid {
    let mut grid = Grid {
        rows,
        cols,
        points: spots.iter().map(|&s| chart.position(s)).collect(),
        places: spots.iter().map(|&s| chart.place(s)).collect(),
    };
    for (k, chain) in patch.sides.iter().enumerate() {
        let count = if k % 2 == 0 { cols } else { rows };
        let points: Vec<DVec3> = chain.iter().map(|&v| patch.mesh.points[v as usize]).collect();
        let samples = side::resample_at(&points, count, &stops[k]);
        for n in 0..count {
            let node = rim_node(k, n, cols, rows);
            let (triangle, corner) = chart.rim[k][samples.segment[n] as usize];
            let mut bary = [0.0; 3];
            bary[corner as usize] = 1.0 - samples.fraction[n];
            bary[(corner as usize + 1) % 3] = samples.fraction[n];
            grid.points[node] = samples.points[n];
            grid.places[node] = chart.place(Spot { triangle, bary });
        }
    }
    grid
}
