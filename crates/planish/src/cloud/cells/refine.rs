//! The sheets of a cell, fitted again to what each of them explains.
//!
//! Expectation and maximization (Dempster, Laird, Rubin 1977): every point tells of each sheet as far as it may be of it
//! ([`Chances`]). The wider the ball the less luck has a say, as long as the points around the site agree: Akaike's
//! criterion, here with points of which some are not asked.
//!
//! See `docs/methods/samples.md`, section 6.

use super::chance::Chances;
use super::{Place, Sheet};
use crate::cloud::local::fit::{Ball, sheet};
use crate::cloud::local::joints::decided_cost;
use crate::cloud::local::nest::{self, Face};
use crate::cloud::local::points::Points;
use glam::DVec3;

/// A sheet is fitted again to at least this many points of its own: twice the parameters of a height field.
const FEWEST_OWN_POINTS: f64 = 12.0;
/// A point of which a sheet has a lesser share is none of its own.
const LEAST_SHARE: f64 = 0.01;
/// Rounds, and the balls that are tried in the first, over that whose points are asked.
const REFIT_ROUNDS: usize = 3;
const BALL_WIDTHS: [f64; 3] = [1.0, 1.5, WIDEST_BALL];
pub(crate) const WIDEST_BALL: f64 = 2.2;

/// Sheets that are joined.
pub(crate) struct Nested {
    /// From the innermost outwards.
    pub sheets: Vec<Sheet>,
    /// What each must explain.
    pub prices: Vec<f64>,
    /// Bit k: sheet k is joined by the minimum.
    pub concave: u8,
    /// What the points cost, without prices.
    pub cost: f64,
}

impl Nested {
    /// Fits the sheets again, and drops those that then explain less than their prices.
    /// * `radius`, `ball` - the ball whose points are asked, and these
    /// * `wide` - points within [`WIDEST_BALL`] radii
    pub fn refine(&mut self, place: &Place, radius: f64, ball: &Points, mut wide: Points) {
        let mut seen = look(&self.sheets, place, ball);
        let mut least = worth(&Vec::from_iter(&seen), self.concave);
        let mut widths = BALL_WIDTHS.to_vec();
        for _ in 0..REFIT_ROUNDS {
            let own = own(&self.sheets, self.concave, place, &wide);
            let tried = widths.iter().map(|&width| {
                let better = refined(&self.sheets, place, width * radius, &own);
                let seen = look(&better, place, ball);
                (worth(&Vec::from_iter(&seen), self.concave), width, better, seen)
            });
            let Some(best) = tried.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|b| b.0 < least) else { break };
            (least, self.sheets, seen) = (best.0, best.2, best.3);
            if widths.len() > 1 {
                widths = vec![best.1];
                wide = wide.iter().filter(|q| q.distance(place.center) <= best.1 * radius).collect();
            }
            // What better sheets leave nothing to explain for goes: it may lie on another one, turned over.
            while self.sheets.len() > 1 {
                let fewer = (0..seen.len()).map(|k| {
                    let rest = seen.iter().enumerate().filter(|s| s.0 != k).map(|s| s.1).collect::<Vec<_>>();
                    (worth(&rest, without(self.concave, k)), k)
                });
                let saved = |f: &(f64, usize)| f.0 - self.prices[f.1];
                let fewest = fewer.min_by(|a, b| saved(a).total_cmp(&saved(b)));
                let Some((rest, k)) = fewest.filter(|f| saved(f) < least) else { break };
                (least, self.concave) = (rest, without(self.concave, k));
                self.prices.remove(k);
                self.sheets.remove(k);
                seen.remove(k);
            }
        }
        self.cost = cost(&Vec::from_iter(&seen), self.concave);
    }
}

/// What the points of a ball cost with a nesting.
pub(crate) fn explained(sheets: &[Sheet], concave: u8, place: &Place, ball: &Points) -> f64 {
    cost(&Vec::from_iter(&look(sheets, place, ball)), concave)
}

/// One sheet of a cell as its points see it.
struct Spread {
    /// Signed distances, in noise levels.
    residuals: Vec<f64>,
    normal: DVec3,
    /// Twice the variance of the fit, in squared noise levels.
    luck: f64,
}

fn look(sheets: &[Sheet], place: &Place, points: &Points) -> Vec<Spread> {
    let one = |s: &Sheet| Spread {
        residuals: points.levels(&s.0, place.noise),
        normal: s.0.distance(place.center).1,
        luck: 2.0 * (s.2 / place.noise).powi(2),
    };
    sheets.iter().map(one).collect()
}

/// What the points cost by the surface they are nearest to.
fn cost(sheets: &[&Spread], concave: u8) -> f64 {
    decided(sheets, concave).0 + folds(sheets, concave)
}

/// What they cost, and what they owe to luck.
fn worth(sheets: &[&Spread], concave: u8) -> f64 {
    let (cost, lucky) = decided(sheets, concave);
    cost + lucky + folds(sheets, concave)
}

fn decided(sheets: &[&Spread], concave: u8) -> (f64, f64) {
    let rows: Vec<(&[f64], f64)> = sheets.iter().map(|s| (&s.residuals[..], s.luck)).collect();
    decided_cost(&rows, concave)
}

fn folds(sheets: &[&Spread], concave: u8) -> f64 {
    let faces: Vec<Face> =
        sheets.iter().map(|s| Face { residuals: &s.residuals, sign: 1.0, normal: s.normal }).collect();
    nest::folds(&faces, concave)
}

/// How the other sheets of a nesting are joined without its sheet `k`.
fn without(concave: u8, k: usize) -> u8 {
    let below = concave & ((1 << k) - 1);
    (below | (concave >> (k + 1)) << k) & !1
}

/// For each sheet the points that it has a share of, from the middle of the site, and that share.
fn own(sheets: &[Sheet], concave: u8, place: &Place, points: &Points) -> Vec<Vec<(DVec3, f64)>> {
    let seen = look(sheets, place, points);
    let shares = Chances::new(seen.iter().map(|s| (&s.residuals[..], s.normal)), concave).shares();
    let of = |row: &Vec<f64>| {
        let mut felt = Vec::with_capacity(points.len());
        let own = points.iter().zip(row).filter(|x| *x.1 > LEAST_SHARE);
        felt.extend(own.map(|(p, &share)| (p - place.center, share)));
        felt
    };
    shares.iter().map(of).collect()
}

/// Every sheet fitted again to what it has of the points in a ball.
fn refined(sheets: &[Sheet], place: &Place, radius: f64, own: &[Vec<(DVec3, f64)>]) -> Vec<Sheet> {
    let inverse = 1.0 / radius;
    let (mut points, mut weights) = (Points::default(), Vec::new());
    sheets
        .iter()
        .zip(own)
        .map(|(old, own)| {
            points.clear();
            weights.clear();
            let (mut sum, mut count) = (DVec3::ZERO, 0.0);
            for &(p, share) in own {
                let y = p * inverse;
                if y.length_squared() <= 1.0 {
                    points.push(y);
                    weights.push(share);
                    sum += share * y;
                    count += share;
                }
            }
            if count < FEWEST_OWN_POINTS {
                return *old;
            }
            let noise = place.noise / radius;
            let ball =
                Ball { center: place.center, scale: radius, points: &points, weights: &weights, guides: &[], noise };
            let Some(found) = sheet(&ball, &old.0, 1) else { return *old };
            let middle = place.center + radius * sum / count;
            let foot = found.quadric.project(middle).0;
            let fresh = found.quadric.normalized_at(foot);
            let fresh = if fresh.distance(foot).1.dot(old.0.distance(foot).1) > 0.0 { fresh } else { fresh.flipped() };
            (fresh, foot, place.noise * (found.parameters / count).sqrt())
        })
        .collect()
}
