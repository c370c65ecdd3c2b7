//! Points that were rounded: depths of a camera in whole steps of its disparity, heights in whole centimetres.
//!
//! They lie on parallel layers. Within one layer they are an exact plane, so a narrow ball sees no noise at all, and a
//! surface where there is a step. What rounding adds has a variance of a twelfth of the squared step (Widrow and Kollár,
//! *Quantization Noise*, 2008, §4.1); a ball shows it as far as its points are spread over several layers, the rest is hidden.
//! 1. places whose nearest points lie exactly in a plane; the directions of these planes
//! 2. a direction is rounded if nearly all points of the scan lie on layers across it, and the layers are as far apart as
//!    the marks of a ruler, whose step may change slowly
//!
//! Layers that are spheres around a scanner, and points that were turned after they were rounded and rounded again,
//! are not found. See `docs/methods/samples.md`, section 2.

use super::SMALLEST;
use crate::geom::{Aabb, KdTree};
use crate::linalg::eigen3;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Points that must lie in one plane: those of the smallest ball of the survey.
const LAYER_POINTS: usize = SMALLEST;
/// What is closer than this share of the size of the scan is the same: files have coordinates of 24 bits, and turning a scan
/// rounds them a few times more.
const SAME_SHARE: f64 = 1.0 / (1 << 20) as f64;
/// One place in this many must lie in a layer.
const LAYERED_PLACES: usize = 50;
/// Planes whose normals differ by less than this cosine are parallel: the nearest points are a thousandth of the scan wide, at
/// least, and off by a millionth.
const PARALLEL: f64 = 1.0 - 1e-6;
/// Directions at most: those of the axes.
const MOST_RULERS: usize = 3;
/// Planes whose directions are counted to find these.
const CANDIDATE_PLANES: usize = 64;
/// Share of the points that lie on layers of `LAYER_POINTS`.
const ON_LAYERS: f64 = 0.9;
/// Layers are farther apart than so many widths of one.
const CLEAR_WIDTHS: f64 = 16.0;
/// Distances of layers around one that tell the step there, and how far they are off its multiples, in steps. Of layers at
/// random two fifths are that near.
const GAPS_AROUND: usize = 8;
const OFF_MARK: f64 = 0.2;
/// Distances of more steps tell nothing, as the step may change.
const MOST_STEPS: f64 = 3.5;
/// Fewest distances, and the share of them that are multiples: of layers at random one ruler in a thousand has that.
const FEWEST_GAPS: usize = 12;
const ON_MARKS: f64 = 0.8;

/// Directions along which the points of a place were rounded, and the steps, world units; no step is zero.
pub(crate) type Steps = [(DVec3, f64); MOST_RULERS];

/// How the points of a scan were rounded.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rounding {
    rulers: Vec<Ruler>,
}

/// Layers across one direction.
#[derive(Clone, Debug)]
struct Ruler {
    way: DVec3,
    /// Where the layers are along it, ascending, and the step at each.
    marks: Vec<f64>,
    steps: Vec<f64>,
}

impl Rounding {
    /// What the points themselves tell.
    /// * `every` - one point in so many is asked
    pub(crate) fn of(points: &[DVec3], tree: &KdTree, every: usize) -> Rounding {
        let same = SAME_SHARE * Aabb::of(points).diagonal();
        let asked: Vec<usize> = (0..points.len()).step_by(every).collect();
        let flat: Vec<(DVec3, DMat3)> = asked
            .par_iter()
            .map_init(Default::default, |(near, last), &i| {
                tree.nearest_after(points[i], LAYER_POINTS, last, near);
                let spread = near.iter().fold(DMat3::ZERO, |sum, n| {
                    let d = points[n.1 as usize] - points[i];
                    sum + DMat3::from_cols(d * d.x, d * d.y, d * d.z)
                });
                let (values, axes) = eigen3(spread);
                let most = same * same * near.len() as f64;
                (values[0] < most && values[1] > CLEAR_WIDTHS * CLEAR_WIDTHS * most).then_some((axes[0], spread))
            })
            .collect::<Vec<_>>()
            .into_iter()
            .flatten()
            .collect();
        if flat.len() * LAYERED_PLACES < asked.len() {
            return Rounding::default();
        }
        // Of the planes every so many is a candidate: what is frequent is among them. Rows of pixels are planes, too.
        let candidates = flat.iter().step_by(flat.len().div_ceil(CANDIDATE_PLANES));
        let mut ways: Vec<(DVec3, DMat3, usize)> = Vec::new();
        for (n, _) in candidates {
            if ways.iter().all(|w| w.0.dot(*n).abs() <= PARALLEL) {
                let own = || flat.iter().filter(|f| f.0.dot(*n).abs() > PARALLEL);
                ways.push((*n, own().map(|f| f.1).sum(), own().count()));
            }
        }
        // The most frequent first; they are found in the order of the points.
        ways.sort_by_key(|w| std::cmp::Reverse(w.2));
        let rulers = ways.iter().take(MOST_RULERS).filter_map(|w| Ruler::of(points, eigen3(w.1).1[0], same));
        Rounding { rulers: rulers.collect() }
    }

    /// The steps at a place.
    pub(crate) fn at(&self, p: DVec3) -> Steps {
        let mut steps = [(DVec3::ZERO, 0.0); MOST_RULERS];
        steps.iter_mut().zip(&self.rulers).for_each(|(s, r)| *s = (r.way, r.step(p.dot(r.way))));
        steps
    }
}

impl Ruler {
    fn of(points: &[DVec3], way: DVec3, same: f64) -> Option<Ruler> {
        let mut along: Vec<f64> = points.iter().map(|p| p.dot(way)).collect();
        along.par_sort_unstable_by(f64::total_cmp);
        let mut marks = Vec::new();
        let mut on_layers = 0;
        let mut rest = &along[..];
        while let Some(&first) = rest.first() {
            let count = rest.partition_point(|&t| t <= first + 2.0 * same);
            marks.push(rest[count / 2]);
            on_layers += if count >= LAYER_POINTS { count } else { 0 };
            rest = &rest[count..];
        }
        if (on_layers as f64) < ON_LAYERS * points.len() as f64 {
            return None;
        }
        let gaps: Vec<f64> = marks.windows(2).map(|w| w[1] - w[0]).collect();
        let around = |i: usize| &gaps[i.saturating_sub(GAPS_AROUND / 2)..(i + GAPS_AROUND / 2).min(gaps.len())];
        let steps: Vec<f64> =
            (0..marks.len()).map(|i| around(i).iter().copied().fold(f64::INFINITY, f64::min)).collect();
        let (mut told, mut good) = (0, 0);
        for (gap, step) in gaps.iter().zip(&steps) {
            let count = gap / step;
            if count < MOST_STEPS {
                told += 1;
                good += usize::from((count - count.round()).abs() < OFF_MARK && *gap > CLEAR_WIDTHS * same);
            }
        }
        (told >= FEWEST_GAPS && good as f64 > ON_MARKS * told as f64).then_some(Ruler { way, marks, steps })
    }

    /// The step at a place along the ruler.
    fn step(&self, t: f64) -> f64 {
        let i = self.marks.partition_point(|&m| m < t).min(self.marks.len() - 1);
        let before = i.saturating_sub(1);
        self.steps[if t - self.marks[before] < self.marks[i] - t { before } else { i }]
    }
}

/// Variance of what rounding adds along a normal, whatever that is: at most this.
pub(crate) fn variance(steps: &Steps) -> f64 {
    steps.iter().map(|s| s.1 * s.1).fold(0.0, f64::max) / 12.0
}

/// Variance that the rounding of points adds along a normal and that they do not show, as those of one layer or of terraces that
/// are wider than a sector, world units squared.
/// * `scatter` - variance that they show
pub(crate) fn hidden(steps: &Steps, normal: DVec3, scatter: f64) -> f64 {
    let added: f64 = steps.iter().map(|s| (s.1 * s.0.dot(normal)).powi(2) / 12.0).sum();
    (added - scatter).max(0.0)
}

/// Are two sheets so far apart along a normal two layers of one surface?
/// * `gap` - world units
pub(crate) fn is_one(steps: &Steps, normal: DVec3, gap: f64) -> bool {
    steps.iter().any(|s| gap < 1.5 * s.1 * s.0.dot(normal).abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;

    fn found(points: &[DVec3]) -> Rounding {
        Rounding::of(points, &KdTree::new(points), 8)
    }

    /// A bent surface in 200 x 200 points, .01 apart.
    fn bent(height: impl Fn(f64) -> f64) -> Vec<DVec3> {
        let at = |i: u64, k: u64| random::unit(3, 2 * i + k) * 0.01;
        (0..40_000u64)
            .map(|i| {
                let (x, y) = ((i % 200) as f64 * 0.01 + at(i, 0), (i / 200) as f64 * 0.01 + at(i, 1));
                DVec3::new(x, y, height(1.0 + 0.5 * x + 0.1 * y * y))
            })
            .collect()
    }

    #[test]
    fn depths_in_whole_steps_are_found_also_where_the_step_grows_and_the_scan_was_turned() {
        let turn = glam::DQuat::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), 0.9);
        let even = bent(|z| (z / 0.03).round() * 0.03);
        let grown = bent(|z| 1.0 / ((120.0 / z).round() / 120.0));
        for (points, step) in [(&even, [0.03, 0.03]), (&grown, [1.0 / 120.0, 4.0 / 120.0])] {
            let turned: Vec<DVec3> = points.iter().map(|p| turn * *p).collect();
            for (points, way) in [(points, DVec3::Z), (&turned, turn * DVec3::Z)] {
                let rounding = found(points);
                assert_eq!(rounding.rulers.len(), 1);
                assert!(rounding.rulers[0].way.dot(way).abs() > 1.0 - 1e-9);
                for (place, z) in [(0, 1.0), (1, 2.0)] {
                    let told = rounding.at(z * way)[0].1;
                    assert!((told / step[place] - 1.0).abs() < 0.15, "{told} for {}", step[place]);
                }
            }
        }
    }

    #[test]
    fn smooth_points_an_exact_box_and_a_grid_of_heights_are_not_rounded() {
        assert!(found(&bent(|z| z)).rulers.is_empty());
        let face = |i: u64| {
            let mut p = DVec3::from_array([0, 1, 2].map(|k| random::unit(4, 3 * i + k)));
            p[i as usize % 3] = (i / 3 % 2) as f64;
            p
        };
        assert!(found(&(0..20_000).map(face).collect::<Vec<_>>()).rulers.is_empty());
        let grid = |i: usize| DVec3::new((i % 150) as f64, (i / 150) as f64, 20.0 * (i as f64 / 3e3).sin());
        assert!(found(&(0..22_500).map(grid).collect::<Vec<_>>()).rulers.is_empty());
    }
}
