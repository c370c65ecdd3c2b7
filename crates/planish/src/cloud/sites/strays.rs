//! Points that lie alone: they would be fitted to whatever is around.
//!
//! Breunig, Kriegel, Ng, Sander, *LOF: Identifying Density-Based Local Outliers*, 2000: a point is a stray if its
//! neighbours are far away from it, measured by how far theirs are from them. Here with the distance to the neighbour of
//! one rank, and its median over a larger neighbourhood, which strays side by side do not move: the surface is close
//! enough to outnumber them. A wall that the scanner grazed is as thin as that, too; its points stay, for their neighbours
//! lie around them in a plane.

use crate::cloud::FEWEST_POINTS;
use crate::geom::KdTree;
use crate::linalg::eigen3;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// The neighbour whose distance tells.
const STRAY_RANK: usize = 8;
/// Neighbours whose distances are the measure.
const MEASURE_NEIGHBOURS: usize = 128;
/// A stray is this many times as far from its neighbours as they are from theirs. Points of the tail of the noise, four
/// levels out, reach 3 where the noise is of the size of the spacing.
const STRAY_RATIO: f64 = 4.0;

/// Neighbours that tell whether a point is part of a thin surface.
const SURFACE_NEIGHBOURS: usize = 16;
/// Mean squared sine of the angles between the ways to them and a plane: 8 degrees.
const SURFACE_SINE_SQUARED: f64 = 0.02;
/// Length of the mean way to them: they are on all sides and not over there.
const AMID: f64 = 0.6;

/// What is this many times as sparse as most of the scan may be a volume of strays.
const SPARSE: f64 = 7.0;
/// Neighbours that tell a sparse surface from a volume, and the mean squared sine there: a volume has a sixth at least,
/// a surface with noise of half its spacing a twentieth.
const VOLUME_NEIGHBOURS: usize = 48;
const VOLUME_SINE_SQUARED: f64 = 0.12;

/// Do the neighbours lie in a plane through a point, and around it?
/// * `level` - mean squared sine of the angles between the ways to them and the plane, at most
/// * `amid` - length of their mean unit vector, at most
fn flat(p: DVec3, near: impl Iterator<Item = DVec3>, level: f64, amid: f64) -> bool {
    let (mut spread, mut sum, mut count) = (DMat3::ZERO, DVec3::ZERO, 0.0);
    for way in near.filter_map(|q| (q - p).try_normalize()) {
        spread += DMat3::from_cols(way * way.x, way * way.y, way * way.z);
        sum += way;
        count += 1.0;
    }
    count > 0.0 && eigen3(spread).0[0] < level * count && sum.length() <= amid * count
}

/// The points that do not lie alone, in the order of their tree, with their indices; all, if nearly all would go.
pub(crate) fn without(points: Vec<DVec3>, ids: Vec<u32>) -> (Vec<DVec3>, Vec<u32>, KdTree) {
    let tree = KdTree::new(&points);
    let far: Vec<f64> = points
        .par_iter()
        .map_init(Default::default, |(near, last), &p| {
            tree.nearest_after(p, STRAY_RANK + 1, last, near);
            near.last().map_or(0.0, |n| n.0.sqrt())
        })
        .collect();
    let mut sorted = far.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let (low, middle) = (sorted[sorted.len() / 4], sorted[sorted.len() / 2]);
    let stays: Vec<bool> = (0..points.len())
        .into_par_iter()
        .map_init(
            || (Vec::new(), Vec::new()),
            |(near, around), i| {
                // Most points are closer to their neighbours than any stray could be.
                if far[i] <= STRAY_RATIO * low {
                    return true;
                }
                tree.nearest(points[i], MEASURE_NEIGHBOURS + 1, near);
                around.clear();
                around.extend(near.iter().filter(|n| n.1 as usize != i).map(|n| far[n.1 as usize]));
                around.sort_unstable_by(f64::total_cmp);
                let within = |count: usize| near.iter().take(count + 1).map(|n| points[n.1 as usize]);
                let p = points[i];
                // Where strays have only strays around they fill a volume.
                let alike = around.get(around.len() / 2).is_none_or(|&usual| far[i] <= STRAY_RATIO * usual);
                let crowd = far[i] <= SPARSE * middle || flat(p, within(VOLUME_NEIGHBOURS), VOLUME_SINE_SQUARED, 1.0);
                (alike && crowd) || flat(p, within(SURFACE_NEIGHBOURS), SURFACE_SINE_SQUARED, AMID)
            },
        )
        .collect();
    let count = stays.iter().filter(|&&s| s).count();
    if count == points.len() || count < FEWEST_POINTS.max(points.len() / 2) {
        return (points, ids, tree);
    }
    let keep = |i: &usize| stays[*i];
    let (points, ids): (Vec<DVec3>, Vec<u32>) = (0..points.len()).filter(keep).map(|i| (points[i], ids[i])).unzip();
    let tree = KdTree::new(&points);
    (points, ids, tree)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;

    fn grid(n: usize, step: f64) -> Vec<DVec3> {
        (0..n * n).map(|k| DVec3::new((k % n) as f64 * step, (k / n) as f64 * step, 0.0)).collect()
    }

    #[test]
    fn of_300_strays_above_a_dense_plane_99_of_100_go_and_no_point_of_the_plane() {
        let mut points = grid(100, 0.01);
        let strays = 300;
        points.extend((0..strays as u64).map(|i| {
            let [x, y, z] = [0, 1, 2].map(|k| random::unit(5, 3 * i + k));
            DVec3::new(x, y, 0.1 + 0.9 * z)
        }));
        let ids = (0..points.len() as u32).collect();
        let (_, left, _) = without(points, ids);
        assert_eq!(left.iter().filter(|&&i| i < 10_000).count(), 10_000);
        let stray = left.iter().filter(|&&i| i >= 10_000).count();
        assert!(stray <= strays / 100, "{stray} strays are left");
    }

    #[test]
    fn a_wall_30_times_as_thin_as_the_plane_beside_it_stays() {
        let mut points = grid(100, 0.01);
        points.extend(grid(18, 0.055).iter().map(|p| DVec3::new(p.x, 0.0, p.y + 0.055)));
        let ids = (0..points.len() as u32).collect();
        let (_, left, _) = without(points, ids);
        let wall = left.iter().filter(|&&i| i >= 10_000).count();
        // Its rim has neighbours on one side only.
        assert!(wall >= 16 * 16, "{wall} of 324 points of the wall are left");
    }
}
