//! Two sheets close together: the sides of a thin plate, or of a narrow gap.
//!
//! One quadric through both calls their distance noise; its residuals have a dip in the middle, which noise has not.
//! 1. two means of the residuals; a dip between them, and both sides present all around (at a crease they are not)
//! 2. a height field for each side, points to the nearer one, and once more
//!
//! See `docs/methods/samples.md`, section 2.

use crate::cloud::local::height::{Frame, Height, framed_height};
use crate::cloud::local::moments::Moments;
use crate::cloud::local::points::Points;
use glam::DVec3;

/// Fewest points: a dip in fewer is chance.
const FEWEST_LAYER_POINTS: usize = 48;
/// Kurtosis above which there is no dip to look for: noise has 3, two sheets three levels apart 2.
pub(crate) const PEAKED: f64 = 2.4;
/// Half width of the windows in the dip and on the sheets, of half the distance of the sheets.
const DIP_WINDOW: f64 = 0.35;
/// Points in the dip over those on a sheet, at most: noise has 1.3, an even spread 1, sheets three levels apart two
/// thirds.
const DIP_RATIO: f64 = 0.7;
/// And the difference in standard deviations of its counts: a scan asks a hundred thousand times.
const DIP_DEVIATIONS: f64 = 3.0;
/// Sectors around, how many must have both sheets, and the least share of the rarer one there.
const LAYER_SECTORS: usize = 8;
const SECTORS_WITH_BOTH: usize = 6;
const RARER_SHARE: f64 = 0.2;
/// Least distance of the two sheets at any point, in noise levels.
pub(crate) const LEAST_LAYER_GAP: f64 = 1.2;
/// Times that points choose the nearer sheet.
const CHOICE_ROUNDS: usize = 2;

/// Two sheets in one ball.
pub(crate) struct Layers {
    /// The sheet nearer to the origin, and the other one.
    pub sheets: [Height; 2],
    /// Standard deviation of the points from their sheets.
    pub noise: f64,
}

/// Tells whether points that one height field was fitted to are two sheets.
/// * `points` - local coordinates
/// * `r` - residuals of the points
pub(crate) fn split(height: &Height, points: &Points, r: &[f64]) -> Option<Layers> {
    if points.len() < FEWEST_LAYER_POINTS {
        return None;
    }
    let n = r.len() as f64;
    let (squares, fourths) = r.iter().fold((0.0, 0.0), |(s, f), x| (s + x * x, f + x * x * x * x));
    let is_dipped = fourths * n < PEAKED * squares * squares;
    if !is_dipped {
        return None;
    }
    let (mut low, mut high) = (0.0, 0.0);
    let mut middle = 0.0;
    for _ in 0..4 {
        let (mut sums, mut counts) = ([0.0; 2], [0.0; 2]);
        for &x in r {
            let k = usize::from(x > middle);
            sums[k] += x;
            counts[k] += 1.0;
        }
        if counts[0] == 0.0 || counts[1] == 0.0 {
            return None;
        }
        (low, high) = (sums[0] / counts[0], sums[1] / counts[1]);
        middle = (low + high) / 2.0;
    }
    let half = (high - low) / 2.0;
    let within = |at: f64| r.iter().filter(|x| (*x - at).abs() < DIP_WINDOW * half).count() as f64;
    let (dip, beside) = (within(middle), (within(low) + within(high)) / 2.0);
    if dip > DIP_RATIO * beside || beside - dip < DIP_DEVIATIONS * (dip + beside / 2.0).sqrt() {
        return None;
    }
    let mut sectors = [[0.0f64; 2]; LAYER_SECTORS];
    for (y, &x) in points.iter().zip(r) {
        let (u, v) = (height.frame.u.dot(y), height.frame.v.dot(y));
        let at = usize::from(u > 0.0) | usize::from(v > 0.0) << 1 | usize::from(u.abs() > v.abs()) << 2;
        sectors[at][usize::from(x > middle)] += 1.0;
    }
    if sectors.iter().filter(|s| s[0].min(s[1]) > RARER_SHARE * (s[0] + s[1])).count() < SECTORS_WITH_BOTH {
        return None;
    }
    let mut side: Vec<bool> = r.iter().map(|&x| x > middle).collect();
    let mut sheets = [*height; 2];
    for round in 0..=CHOICE_ROUNDS {
        let mut sums = [Moments::ZERO; 2];
        for (y, &s) in points.iter().zip(&side) {
            sums[usize::from(s)].add(y, 1.0);
        }
        for (sheet, sum) in sheets.iter_mut().zip(&sums) {
            *sheet = framed_height(&sum.matrix(), Frame::of(height.frame.n))?;
        }
        if round < CHOICE_ROUNDS {
            for (y, s) in points.iter().zip(&mut side) {
                *s = sheets[1].residual(y).abs() < sheets[0].residual(y).abs();
            }
        }
    }
    let left: f64 = points.iter().map(|y| sheets[0].residual(y).abs().min(sheets[1].residual(y).abs()).powi(2)).sum();
    let noise = (left / (n - 12.0)).sqrt();
    // Side by side everywhere: sheets that cross are the faces of an edge.
    let apart = |y: DVec3| sheets[0].residual(y) - sheets[1].residual(y);
    let way = apart(DVec3::ZERO).signum();
    if points.iter().any(|y| way * apart(y) < LEAST_LAYER_GAP * noise) {
        return None;
    }
    if sheets[1].residual(DVec3::ZERO).abs() < sheets[0].residual(DVec3::ZERO).abs() {
        sheets.swap(0, 1);
    }
    Some(Layers { sheets, noise })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;

    fn gauss(n: u64) -> f64 {
        random::normal(random::unit(4, 2 * n), random::unit(4, 2 * n + 1))
    }

    /// Points in the unit disk on `of(u, v, k)`, noise .03.
    fn patch(seed: u64, count: u64, of: impl Fn(f64, f64, u64) -> f64) -> (Height, Points, Vec<f64>) {
        let points: Points = (0..count)
            .map(|k| {
                let (r, a) = (random::unit(seed, 2 * k).sqrt(), std::f64::consts::TAU * random::unit(seed, 2 * k + 1));
                let (u, v) = (r * a.cos(), r * a.sin());
                DVec3::new(u, v, of(u, v, k) + 0.03 * gauss(count * seed + k))
            })
            .collect();
        let mut m = Moments::ZERO;
        points.iter().for_each(|p| m.add(p, 1.0));
        let height = framed_height(&m.matrix(), Frame::of_moments(&m)).unwrap();
        let r = points.iter().map(|p| height.residual(p)).collect();
        (height, points, r)
    }

    #[test]
    fn of_20_pairs_of_sheets_four_noise_levels_apart_14_are_told_apart_and_placed_within_two_thirds_of_the_noise() {
        let mut told = 0;
        for seed in 0..20 {
            let (h, points, r) = patch(seed, 200, |u, _, k| 0.2 * u * u + if k % 2 == 0 { 0.06 } else { -0.06 });
            let Some(found) = split(&h, &points, &r) else { continue };
            told += 1;
            assert!((found.noise / 0.03 - 1.0).abs() < 0.2, "{}", found.noise);
            let mut at = found.sheets.map(|s| -s.residual(DVec3::ZERO) * s.frame.n.z.signum());
            at.sort_by(f64::total_cmp);
            assert!((at[0] + 0.06).abs() < 0.02 && (at[1] - 0.06).abs() < 0.02, "{at:?}");
        }
        // With 200 points a dip may be missed by chance.
        assert!(told >= 14, "{told} of 20");
    }

    #[test]
    fn noise_an_even_spread_and_an_edge_are_one_sheet_in_200_seeds_each() {
        for seed in 0..200 {
            let (h, points, r) = patch(seed, 150, |u, v, _| 0.2 * u * v);
            assert!(split(&h, &points, &r).is_none(), "noise, seed {seed}");
            let (h, points, r) = patch(seed, 150, |_, _, k| 0.2 * random::unit(77 + seed, k));
            assert!(split(&h, &points, &r).is_none(), "even, seed {seed}");
            let (h, points, r) = patch(seed, 150, |u, _, _| -u.abs());
            assert!(split(&h, &points, &r).is_none(), "edge, seed {seed}");
        }
    }
}
