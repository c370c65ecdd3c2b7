//! Points that lie alone: they would be fitted to whatever is around.
//!
//! Breunig, Kriegel, Ng, Sander, *LOF: Identifying Density-Based Local Outliers*, 2000: a point is a stray if its
//! neighbours are far away from it, measured by how far theirs are from them. Here with the distance to the neighbour of
//! one rank, and its median over a larger neighbourhood, which strays side by side do not move: the surface is close
//! enough to outnumber them.

use super::FEWEST;
use crate::geom::KdTree;
use glam::DVec3;
use rayon::prelude::*;

/// The neighbour whose distance tells.
const RANK: usize = 8;
/// Neighbours whose distances are the measure.
const AROUND: usize = 128;
/// A stray is this many times as far from its neighbours as they are from theirs. Points of the tail of the noise, four
/// levels out, reach 3 where the noise is of the size of the spacing.
const ALONE: f64 = 4.0;

/// The points that do not lie alone, in the order of their tree, with their indices; all, if nearly all would go.
pub(super) fn without(points: Vec<DVec3>, ids: Vec<u32>) -> (Vec<DVec3>, Vec<u32>, KdTree) {
    let tree = KdTree::new(&points);
    let far: Vec<f64> = points
        .par_iter()
        .map_init(Vec::new, |near, &p| {
            tree.nearest(p, RANK + 1, near);
            near.last().map_or(0.0, |n| n.0.sqrt())
        })
        .collect();
    let mut sorted = far.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let low = sorted[sorted.len() / 4];
    let stays: Vec<bool> = (0..points.len())
        .into_par_iter()
        .map_init(
            || (Vec::new(), Vec::new()),
            |(near, around), i| {
                // Most points are closer to their neighbours than any stray could be.
                if far[i] <= ALONE * low {
                    return true;
                }
                tree.nearest(points[i], AROUND + 1, near);
                around.clear();
                around.extend(near.iter().filter(|n| n.1 as usize != i).map(|n| far[n.1 as usize]));
                around.sort_unstable_by(f64::total_cmp);
                around.get(around.len() / 2).is_none_or(|&usual| far[i] <= ALONE * usual)
            },
        )
        .collect();
    let count = stays.iter().filter(|&&s| s).count();
    if count == points.len() || count < FEWEST.max(points.len() / 2) {
        return (points, ids, tree);
    }
    let keep = |i: &usize| stays[*i];
    let (points, ids): (Vec<DVec3>, Vec<u32>) =
        (0..points.len()).filter(keep).map(|i| (points[i], ids[i])).unzip();
    let tree = KdTree::new(&points);
    (points, ids, tree)
}
