//! How many points the grids get along every side.
//!
//! [K98] §5.4.
//!
//! Departs from [K98]: the aspect ratio is that of a chord of the network and not of each patch, since neighbours
//! share the nodes of their curve; that is what makes seams exact.

use super::{GridParams, side};
use crate::network::{Network, PatchMesh};
use glam::DVec3;

/// Power of the mean over the patches of a chord: above one, so that the patch which needs most has most say, yet
/// one patch alone does not refine a long chord to its own need.
const CHORD_POWER: f64 = 3.0;
/// Rounds of scaling all chords to the wanted total; the bounds of the sides disturb a single one.
const SCALE_ROUNDS: usize = 12;

/// Chooses `(cols, rows)` for every patch.
///
/// Opposite sides, and so all curves of a chord, get the same number of points: neighbouring grids share all nodes
/// of their curve. A patch wants `density` points per vertex, divided between its directions by the longer of each
/// pair of opposite sides (§5.4); a chord takes the power mean of its patches; then all are scaled together until
/// the grids have as many points as wanted, within the bounds of `params`.
pub fn choose_sizes(network: &Network, patches: &[PatchMesh], params: &GridParams) -> Vec<(usize, usize)> {
    let chords = network.chords();
    let mut sums = vec![(0.0, 0.0); chords.len()];
    let mut vertices = 0.0;
    for (patch, sides) in patches.iter().zip(&network.patches) {
        let length = |k: usize| {
            let chain: Vec<DVec3> = patch.sides[k].iter().map(|&v| patch.mesh.points[v as usize]).collect();
            side::length(&chain)
        };
        let (along_u, along_v) = (length(0).max(length(2)), length(1).max(length(3)));
        let aspect = if along_u > 0.0 && along_v > 0.0 { along_u / along_v } else { 1.0 };
        let count = patch.mesh.points.len() as f64;
        vertices += count;
        for (k, wanted) in [(0, (count * aspect).sqrt()), (1, (count / aspect).sqrt())] {
            let sum = &mut sums[chords[sides.sides[k].curve as usize] as usize];
            sum.0 += wanted.powf(CHORD_POWER);
            sum.1 += 1.0;
        }
    }
    let wanted: Vec<f64> =
        sums.iter().map(|&(s, n)| if n > 0.0 { (s / n).powf(1.0 / CHORD_POWER) } else { 0.0 }).collect();
    let [least, most] = bounds(params);
    let sizes = |scale: f64| -> Vec<(usize, usize)> {
        let count =
            |curve: u32| ((wanted[chords[curve as usize] as usize] * scale).round() as usize).clamp(least, most);
        network.patches.iter().map(|p| (count(p.sides[0].curve), count(p.sides[1].curve))).collect()
    };
    let target = (vertices * params.density).min(params.max_points as f64);
    let mut scale = 1.0;
    let mut best = sizes(scale);
    for _ in 0..SCALE_ROUNDS {
        let total = total(&best) as f64;
        scale *= (target / total).sqrt().clamp(0.25, 4.0);
        best = sizes(scale);
    }
    best
}

/// Least and greatest number of points along a side.
pub fn bounds(params: &GridParams) -> [usize; 2] {
    [params.min_side.max(2), params.max_side.max(params.min_side).max(2)]
}

/// Points of all grids together.
pub fn total(sizes: &[(usize, usize)]) -> usize {
    sizes.iter().map(|(c, r)| c * r).sum()
}
