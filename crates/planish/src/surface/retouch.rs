//! Surfaces fitted again after an edit of some curves: those beside these curves alone, on the seams of all others.
//!
//! Goes beyond [K98]: the boundary of a surface is a curve of the network, so what lies around the edited patches keeps
//! its control points, bit for bit, and the model stays without gaps. Seams are smoothed by [`super::stitch`] when the
//! edit is done.

use super::fit::{Directions, project, surface_of};
use super::fold::folds;
use super::network_fit::{SMOOTHING, fill, fit_curve, patch_directions};
use super::params::FitParams;
use super::sides::{along_curve, check, corners_of, knots, side_len};
use super::{FitError, Surface};
use crate::grid::Grid;
use crate::network::Network;
use crate::observe::Observer;
use glam::DVec3;
use rayon::prelude::*;

/// Fits the surfaces on both sides of `curves` again, with as many control points as they have.
///
/// * `grids`, `surfaces` - one per patch; grids beside `curves` may be new, with the same numbers of nodes
/// * `curves` - those whose nodes are new; the boundaries along all others stay as they are, bit for bit
///
/// Returns the numbers of the patches, rising, each with its surface.
/// # Errors
/// Lists that do not fit the network or each other, or the observer's wish.
pub fn retouch(
    network: &Network,
    grids: &[Grid],
    surfaces: &[Surface],
    curves: &[u32],
    params: &FitParams,
    observer: &dyn Observer,
) -> Result<Vec<(usize, Surface)>, FitError> {
    let shapes: Vec<_> = grids.iter().map(|g| (g.rows, g.cols, g.points.len())).collect();
    let nodes = check(network, "grids", &shapes)?;
    let shapes: Vec<_> = surfaces.iter().map(|s| (s.rows, s.cols, s.control.len())).collect();
    let counts = check(network, "surfaces", &shapes)?;
    let is_new = |c: u32| curves.contains(&c);
    let which: Vec<usize> =
        (0..surfaces.len()).filter(|&p| network.patches[p].sides.iter().any(|s| is_new(s.curve))).collect();
    let knots = knots(network, surfaces, &which)?;
    let directions = Directions::new(which.iter().flat_map(|&p| &network.patches[p].sides).map(|s| {
        let c = s.curve as usize;
        (nodes[c], knots[c].clone())
    }))?;
    // A corner at which a curve stays is where the surfaces have it, which smooth seams may have moved.
    let others = (0..network.curves.len()).filter(|&c| !is_new(c as u32));
    let stays: Vec<u32> = others.flat_map(|c| network.curves[c].corners).collect();
    let corners = corners_of(network, surfaces, |_, corner| stays.contains(&corner));
    let mut boundary: Vec<Vec<DVec3>> = vec![Vec::new(); network.curves.len()];
    for &p in &which {
        for (k, side) in network.patches[p].sides.iter().enumerate() {
            let c = side.curve as usize;
            if !boundary[c].is_empty() {
                continue;
            }
            boundary[c] = if is_new(side.curve) {
                let (points, rows, cols) = (&grids[p].points, grids[p].rows, grids[p].cols);
                let points = along_curve(points, rows, cols, k, side.reversed, 0);
                let direction = directions.get(nodes[c], &knots[c]);
                let direction = &direction.smoothed(params.smoothing)?;
                let ends = network.curves[c].corners.map(|k| corners[k as usize]);
                direction.with_ends(fit_curve(&points, direction), ends)
            } else {
                let s = &surfaces[p];
                debug_assert_eq!(side_len(s.rows, s.cols, k), counts[c]);
                along_curve(&s.control, s.rows, s.cols, k, side.reversed, 0)
            };
        }
    }
    let made: Vec<Result<(usize, Surface), FitError>> = which
        .par_iter()
        .map(|&p| {
            let (patch, grid) = (&network.patches[p], &grids[p]);
            let [along_u, along_v] = patch_directions(patch, grid, &directions, &knots);
            let projection = project(&grid.points, along_u, along_v);
            let made = |weight: f64| -> Result<Surface, FitError> {
                let (u, v) = (along_u.smoothed(weight)?, along_v.smoothed(weight)?);
                Ok(surface_of(fill(patch, &boundary, &projection, &u, &v), along_u, along_v))
            };
            let mut best = made(params.smoothing)?;
            let mut fewest = folds(&best, grid);
            for weight in SMOOTHING.into_iter().filter(|&w| w > params.smoothing) {
                observer.check()?;
                if fewest == 0 {
                    break;
                }
                let trial = made(weight)?;
                let count = folds(&trial, grid);
                // As for whole networks: detail is not given up for a fold that smoothing does not at least halve.
                if 2 * count <= fewest {
                    (best, fewest) = (trial, count);
                }
            }
            Ok((p, best))
        })
        .collect();
    made.into_iter().collect()
}
