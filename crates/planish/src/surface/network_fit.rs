//! Fits a whole network without gaps.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §6.2 and §8.1.3.
//!
//! Departs from [K98]: instead of averaging the boundary control points of neighbours after the fit, each curve of
//! the network is fitted once, from corner to corner, and both patches fit their inside for it. So seams are
//! exact, and no patch pays for its neighbour.

use super::fit::{Direction, Directions, project, solve_inside, surface_of};
use super::resolution::{self, Resolution};
use super::sides::{check_grids, curve_nodes, diagonal, node, side_len};
use super::{FitError, Surface, deviation_of};
use crate::grid::Grid;
use crate::network::{Network, Patch};
use crate::observe::Observer;
use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Rounds that may raise the counts after the first choice: the fixed boundaries cost little, so that two do.
const ROUNDS: usize = 3;

/// How to fit the surfaces of a network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FitParams {
    /// How many control points, directly or by a tolerance.
    pub resolution: Resolution,
}

impl Default for FitParams {
    /// A tolerance of 1/2000 of the diagonal: the coarse shape; the relief has the rest.
    fn default() -> FitParams {
        FitParams { resolution: Resolution::Tolerance(5e-4) }
    }
}

/// Fits one surface to each grid of a network; neighbours share their boundary control points bit for bit.
///
/// * `grids` - one per patch, their boundary nodes the same on both sides of a curve
///
/// # Errors
/// Grids that do not fit the network or each other, more control points than nodes, or the observer's wish.
///
/// Source: [K98] §6.2.
pub fn fit_network(
    network: &Network,
    grids: &[Grid],
    params: &FitParams,
    observer: &dyn Observer,
) -> Result<Vec<Surface>, FitError> {
    let nodes = check_grids(network, grids)?;
    let size = diagonal(grids);
    let mut counts = resolution::counts(network, grids, &nodes, &params.resolution, size)?;
    let &Resolution::Tolerance(fraction) = &params.resolution else {
        return fit_counts(network, grids, &nodes, &counts, observer);
    };
    for _ in 0..ROUNDS {
        let surfaces = fit_counts(network, grids, &nodes, &counts, observer)?;
        let over: Vec<bool> =
            surfaces.par_iter().zip(grids).map(|(s, g)| deviation_of(s, g).rms > fraction * size).collect();
        let mut raised = counts.clone();
        for (patch, _) in network.patches.iter().zip(&over).filter(|(_, over)| **over) {
            for c in patch.sides.map(|side| side.curve as usize) {
                raised[c] = resolution::finer(counts[c]);
            }
        }
        let raised = resolution::level(network, &nodes, raised, true);
        if raised == counts {
            return Ok(surfaces);
        }
        counts = raised;
    }
    fit_counts(network, grids, &nodes, &counts, observer)
}

/// Fits with known counts of nodes and control points along the curves.
fn fit_counts(
    network: &Network,
    grids: &[Grid],
    nodes: &[usize],
    counts: &[usize],
    observer: &dyn Observer,
) -> Result<Vec<Surface>, FitError> {
    let used = nodes.iter().zip(counts).filter(|(n, _)| **n > 0).map(|(&n, &c)| (n, c));
    let directions = Directions::new(used)?;
    let uses = network.uses();
    let curves: Vec<Vec<DVec3>> = curve_nodes(network, &uses, grids)
        .into_par_iter()
        .zip(counts)
        .map(|(nodes, &count)| match nodes.len() {
            0 => Vec::new(),
            n => fit_curve(&nodes, directions.get(n, count)),
        })
        .collect();
    let done = AtomicUsize::new(0);
    let surfaces: Vec<Option<Surface>> = network
        .patches
        .par_iter()
        .zip(grids)
        .map(|(patch, grid)| {
            if observer.cancelled() {
                return None;
            }
            let [along_u, along_v] = patch_directions(patch, grid, &directions, counts);
            let projection = project(&grid.points, along_u, along_v);
            let net = fill(patch, &curves, &projection, along_u, along_v);
            observer.progress((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / grids.len() as f64);
            Some(surface_of(net, along_u, along_v))
        })
        .collect();
    surfaces.into_iter().collect::<Option<Vec<_>>>().ok_or(FitError::Cancelled)
}

/// The directions along `u` and `v` of a patch.
pub(crate) fn patch_directions<'a>(
    patch: &Patch,
    grid: &Grid,
    directions: &'a Directions,
    counts: &[usize],
) -> [&'a Direction; 2] {
    [
        directions.get(grid.cols, counts[patch.sides[0].curve as usize]),
        directions.get(grid.rows, counts[patch.sides[1].curve as usize]),
    ]
}

/// A curve through the first and the last node, as near as it can to the others.
fn fit_curve(nodes: &[DVec3], direction: &Direction) -> Vec<DVec3> {
    let mut net = vec![DVec3::ZERO; direction.control()];
    net[0] = nodes[0];
    *net.last_mut().expect("at least 4 control points") = nodes[nodes.len() - 1];
    direction.fit_curve(nodes.iter().copied(), &mut net, 1);
    net
}

/// The net of a patch with its boundary from `curves` and its inside fitted for that.
pub(crate) fn fill(
    patch: &Patch,
    curves: &[Vec<DVec3>],
    projection: &[DVec3],
    along_u: &Direction,
    along_v: &Direction,
) -> Vec<DVec3> {
    let (rows, cols) = (along_v.control(), along_u.control());
    let mut net = vec![DVec3::ZERO; rows * cols];
    for (k, side) in patch.sides.iter().enumerate() {
        let curve = &curves[side.curve as usize];
        let n = side_len(rows, cols, k);
        for i in 0..n {
            net[node(rows, cols, k, i, 0)] = curve[if side.reversed { n - 1 - i } else { i }];
        }
    }
    solve_inside(&mut net, projection, along_u, along_v, 1);
    net
}
