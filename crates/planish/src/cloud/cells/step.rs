//! Steps whose wall is too narrow for a fit: a shallow pocket, an embossed letter, a wall that no scanner saw.
//!
//! Two sheets of a cell at different heights, each with its points on one side of a line, have a wall between them, though hardly
//! a point lies on it: the plane through that line upright on both. See `docs/methods/samples.md`, section 6.

use crate::cloud::Quadric;
use crate::cloud::local::joints::RESIDUAL_LIMIT;
use crate::cloud::local::nest::Seen;
use crate::cloud::local::points::Points;
use glam::DVec3;

/// Sheets of a step face the same way within this cosine (60 degrees).
const SAME_WAY_COSINE: f64 = 0.5;
/// Points that each of them must have for its own.
const FEWEST_OWN_POINTS: usize = 12;
/// The wall is so many noise levels high: less is no step.
const LEAST_WALL_NOISE: f64 = 4.0;
/// Middles of the points of the two are this far from each other, as a share of the ball: .85 for the halves of a disk.
const LEAST_APART_RADII: f64 = 0.4;
/// Share of the points that lie on the wrong side of the wall at most, and of each side that does not say where it is.
const ASTRAY: f64 = 0.04;
/// Directions of the wall that are tried, each this much from the last, and rounds that halve that.
const WALL_TURNS: i32 = 4;
const WALL_TURN: f64 = 0.25;
const TURN_HALVINGS: usize = 3;

/// A step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Step {
    /// Which of the two sheets is the higher one.
    pub higher: usize,
    /// Unit normal of the wall, from the higher sheet to the lower one.
    pub normal: DVec3,
    /// A point of the wall, halfway up, world units.
    pub at: DVec3,
}

/// True if two sheets may be those of a step.
pub(crate) fn is_alike([a, b]: [DVec3; 2]) -> bool {
    a.dot(b) >= SAME_WAY_COSINE
}

/// The step between two sheets in a ball of `radius` around `center`, if their points lie on two sides of a line.
/// * `points` - those of the ball
/// * `noise` - standard deviation of the points, world units
pub(crate) fn step(
    sheets: [(&Quadric, &Seen); 2],
    points: &Points,
    center: DVec3,
    radius: f64,
    noise: f64,
) -> Option<Step> {
    let normals = sheets.map(|s| s.1.normal);
    if !is_alike(normals) {
        return None;
    }
    let up = (normals[0] + normals[1]).try_normalize()?;
    let [a, b] = sheets.map(|s| &s.1.residuals);
    let mut own: [Vec<DVec3>; 2] = Default::default();
    for ((p, x), y) in points.iter().zip(a).zip(b) {
        match [x.abs() < RESIDUAL_LIMIT, y.abs() < RESIDUAL_LIMIT] {
            [true, false] => own[0].push(p - center),
            [false, true] => own[1].push(p - center),
            _ => {}
        }
    }
    if own.iter().any(|o| o.len() < FEWEST_OWN_POINTS) {
        return None;
    }
    let [m, n] = [0, 1].map(|k| own[k].iter().sum::<DVec3>() / own[k].len() as f64);
    let between = (n - m).reject_from(up);
    if between.length() < LEAST_APART_RADII * radius {
        return None;
    }
    let u = between.normalize();
    let v = up.cross(u);
    // Where the wall stands in a direction, and how many points lie beyond it.
    let mut along: [Vec<f64>; 2] = Default::default();
    let mut wall = |angle: f64| {
        let w = angle.cos() * u + angle.sin() * v;
        for (along, own) in along.iter_mut().zip(&own) {
            along.clear();
            along.extend(own.iter().map(|p| w.dot(*p)));
        }
        let last = (along[0].len() - 1) as f64;
        let [s, t] = [0, 1].map(|k| ASTRAY * along[k].len() as f64);
        let mut ranked = |k: usize, rank: f64| *along[k].select_nth_unstable_by(rank as usize, f64::total_cmp).1;
        let at = (ranked(0, last - s) + ranked(1, t)) / 2.0;
        let beyond = along[0].iter().filter(|x| **x > at).count() + along[1].iter().filter(|x| **x < at).count();
        (beyond, at, w)
    };
    let mut best_of = |angles: &mut dyn Iterator<Item = f64>| {
        angles.map(|t| (t, wall(t))).min_by(|p, q| p.1.0.cmp(&q.1.0).then(p.0.abs().total_cmp(&q.0.abs())))
    };
    let mut best = best_of(&mut (-WALL_TURNS..=WALL_TURNS).map(|i| f64::from(i) * WALL_TURN))?;
    for round in 1..=TURN_HALVINGS {
        let turn = WALL_TURN / f64::from(1 << round);
        best = best_of(&mut [-turn, 0.0, turn].into_iter().map(|d| best.0 + d))?;
    }
    let (beyond, at, w) = best.1;
    if beyond as f64 > ASTRAY * (own[0].len() + own[1].len()) as f64 {
        return None;
    }
    let at = center + at * w;
    // A place is farther outside of what is lower.
    let [x, y] = sheets.map(|s| s.0.distance(at).0);
    if (x - y).abs() < LEAST_WALL_NOISE * noise {
        return None;
    }
    let higher = usize::from(y < x);
    Some(Step { higher, normal: if higher == 0 { w } else { -w }, at: at - (x + y) / 2.0 * up })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;

    /// Two planes, 0 and `-deep` noise levels high, the points of the first where x + y < 0 if `apart`, else anywhere; in a ball
    /// of radius 40 levels.
    fn found(deep: f64, apart: bool, seed: u64) -> Option<Step> {
        let gauss = |k: u64| random::normal(random::unit(seed, 2 * k), random::unit(seed, 2 * k + 1));
        let points: Points = (0..400u64)
            .map(|i| {
                let r = |k: u64| 80.0 * random::unit(seed + 1, 4 * i + k) - 40.0;
                let lower = if apart { r(0) + r(1) > 0.0 } else { i % 2 == 0 };
                let z = if lower { -deep } else { 0.0 };
                DVec3::new(r(0), r(1), z) + DVec3::new(gauss(3 * i), gauss(3 * i + 1), gauss(3 * i + 2))
            })
            .filter(|p| p.length() < 40.0)
            .collect();
        let planes = [-deep, 0.0].map(|z| Quadric::plane(DVec3::new(0.0, 0.0, z), 40.0, DVec3::Z));
        let seen = planes.map(|q| Seen { residuals: points.levels(&q, 1.0), normal: DVec3::Z, price: 14.0 });
        step([(&planes[0], &seen[0]), (&planes[1], &seen[1])], &points, DVec3::ZERO, 40.0, 1.0)
    }

    #[test]
    fn the_wall_of_a_step_without_a_point_on_it_stands_within_four_noise_levels_and_ten_degrees() {
        for seed in 0..10 {
            let step = found(12.0, true, 10 * seed).unwrap();
            let w = DVec3::new(1.0, 1.0, 0.0).normalize();
            assert_eq!(step.higher, 1);
            assert!(step.normal.dot(w) > 0.985 && step.at.dot(w).abs() < 4.0, "{step:?}");
            assert!((step.at.z + 6.0).abs() < 1e-9, "{step:?}");
        }
    }

    #[test]
    fn a_plate_and_a_step_of_three_noise_levels_have_no_wall() {
        for seed in 0..10 {
            assert_eq!(found(12.0, false, 10 * seed), None);
            assert_eq!(found(3.0, true, 10 * seed), None);
        }
    }
}
