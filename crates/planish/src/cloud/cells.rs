//! What the surface looks like around every site: one sheet, or a body cut out of several.
//!
//! Every site asks which nested maxima and minima (`nest`) of the oriented samples around explain its points. The blend of
//! these functions keeps edges sharp, and where one site errs its neighbours outvote it.

use super::front::{PRICE, VARIATION_PRICE};
use super::fit::{Weighted, sheet};
use super::nest::{self, LIMIT, Seen, cost, nest};
use super::sites::{Sites, in_pieces};
use super::{Quadric, Sample};
use crate::geom::KdTree;
use crate::observe::Observer;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// The points that a cell explains lie within this many supports: a fillet and an edge differ only from afar.
const HEARD: f64 = 1.3;
/// Most sheets of a cell.
const MOST: usize = nest::MOST;
/// Samples within this many supports are candidates.
const ASIDE: f64 = 2.0;
/// A sheet is fitted again to at least this many points of its own: twice the parameters of a height field.
const FEWEST_OWN: usize = 12;
/// Rounds of that, and what a round may cost more, in squared noise levels.
const REFINED: usize = 3;
const WORSE: f64 = 4.0;
/// Candidates at most.
const ASKED: usize = 16;
/// A cell with one sheet is taken as it is if its points cost at most this much each, in squared noise levels.
const PLAIN: f64 = 1.05;
/// Of one sheet if the normals differ by less than this cosine (8 degrees) and the offsets by less than so many levels.
const SAME_TURN: f64 = 0.99;
const SAME_LEVEL: f64 = 0.7;

/// The surface around a site: nested maxima and minima of sheets.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Middle of the points of the site, world units.
    pub center: DVec3,
    /// Radius within which it takes part in the blend, world units.
    pub support: f64,
    /// Weight in the blend.
    pub trust: f64,
    /// The sheets, positive outside; the first `count` hold.
    pub sheets: [Quadric; MOST],
    /// Number of sheets.
    pub count: u8,
    /// Bit k: sheet k is joined to those before it by the minimum (a concave edge), else by the maximum (a convex one).
    pub concave: u8,
}

/// The cells of all sites. `None` if cancelled.
pub(super) fn cells(
    points: &[DVec3],
    tree: &KdTree,
    sites: &Sites,
    samples: &[Sample],
    of_site: &[u32],
    observer: &dyn Observer,
) -> Option<Vec<Cell>> {
    let centers: Vec<DVec3> = samples.iter().map(|s| s.center).collect();
    let sample_tree = KdTree::new(&centers);
    let mut owned = vec![(DVec3::ZERO, 0usize); sites.point.len()];
    for (p, &o) in points.iter().zip(&sites.owner) {
        if o != u32::MAX {
            owned[o as usize].0 += *p;
            owned[o as usize].1 += 1;
        }
    }
    let mut own: Vec<Vec<u32>> = vec![Vec::new(); sites.point.len()];
    of_site.iter().enumerate().for_each(|(i, &s)| own[s as usize].push(i as u32));
    let made = in_pieces(sites.point.len(), (0.0, 1.0), observer, |_, site| {
        let (sum, count) = owned[site];
        let center = if count > 0 { sum / count as f64 } else { sites.survey[site].quadric.center };
        let support = sites.support(site);
        let noise = sites.prior[site].noise.min(sites.survey[site].noise).max(1e-9 * support);
        cell(center, support, noise, tree, samples, &sample_tree, &own[site])
    })?;
    Some(made.into_iter().flatten().collect())
}

fn cell(
    center: DVec3,
    support: f64,
    noise: f64,
    tree: &KdTree,
    samples: &[Sample],
    sample_tree: &KdTree,
    own: &[u32],
) -> Option<Cell> {
    let mut ball = Vec::new();
    tree.within(center, HEARD * support, |_, q, _| ball.push(q));
    let residuals = |q: &Quadric| -> Vec<f64> { ball.iter().map(|&x| q.distance(x).0 / noise).collect() };
    let finish = |found: &[Quadric], error: f64, concave: u8, total: f64| {
        let mut sheets = [found[0]; MOST];
        sheets[..found.len()].copy_from_slice(found);
        // What the points show beyond noise is bias of the cell.
        let excess = (total / ball.len().max(1) as f64 - 1.0).max(0.0);
        let trust = support * support / (error * error + 0.25 * excess * noise * noise).max(1e-12 * support * support);
        Cell { center, support, trust: trust.min(1e12), sheets, count: found.len() as u8, concave }
    };
    if own.len() == 1 {
        let total = cost(&residuals(&samples[own[0] as usize].quadric));
        if total < PLAIN * ball.len() as f64 {
            let s = &samples[own[0] as usize];
            return Some(finish(&[s.quadric], s.error, 0, total));
        }
    }
    // Candidates, those of the site first, then by distance.
    let mut near: Vec<(f64, u32)> = Vec::new();
    sample_tree.within(center, ASIDE * support, |i, _, d2| near.push((if own.contains(&i) { 0.0 } else { d2 }, i)));
    near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut asked: Vec<u32> = Vec::new();
    for &(_, i) in &near {
        let (d, n) = samples[i as usize].quadric.distance(center);
        let known = asked.iter().any(|&k| {
            let (e, m) = samples[k as usize].quadric.distance(center);
            n.dot(m) > SAME_TURN && (d - e).abs() < SAME_LEVEL * noise
        });
        if !known && d.abs() < support {
            asked.push(i);
            if asked.len() == ASKED {
                break;
            }
        }
    }
    if asked.is_empty() {
        return None;
    }
    let all: Vec<Seen> = asked
        .iter()
        .map(|&i| {
            let q = &samples[i as usize].quadric;
            let price = PRICE + VARIATION_PRICE * q.variation(samples[i as usize].center, HEARD * support);
            Seen { residuals: residuals(q), normal: q.distance(center).1, price }
        })
        .collect();
    let found = nest(&all, false, MOST)?;
    let mut sheets: Vec<Quadric> = found.order.iter().map(|&k| samples[asked[k] as usize].quadric).collect();
    let errors = found.order.iter().map(|&k| samples[asked[k] as usize].error.powi(2)).sum::<f64>();
    let error = (errors / sheets.len() as f64).sqrt();
    let mut total = found.cost;
    if sheets.len() > 1 {
        // Every point tells of the sheet that decides at it, and of no other; then once more.
        for _ in 0..REFINED {
            let better = refined(&sheets, found.concave, center, HEARD * support, &ball, noise);
            let next = ball.iter().map(|&q| (joined(&better, found.concave, q).1 / noise).powi(2).min(LIMIT * LIMIT)).sum();
            if next > total + WORSE {
                break;
            }
            (sheets, total) = (better, next);
        }
    }
    Some(finish(&sheets, error, found.concave, total))
}

/// The sheet that decides at a point and its signed distance.
fn joined(sheets: &[Quadric], concave: u8, p: DVec3) -> (usize, f64) {
    let mut best = (0, sheets[0].distance(p).0);
    for (k, s) in sheets.iter().enumerate().skip(1) {
        let d = s.distance(p).0;
        if (d < best.1) == (concave >> k & 1 == 1) {
            best = (k, d);
        }
    }
    best
}

/// Every sheet fitted again to the points at which it decides.
fn refined(
    sheets: &[Quadric],
    concave: u8,
    center: DVec3,
    radius: f64,
    ball: &[DVec3],
    noise: f64,
) -> Vec<Quadric> {
    let mut points: Vec<Vec<Weighted>> = vec![Vec::new(); sheets.len()];
    for &q in ball {
        let (k, d) = joined(sheets, concave, q);
        if d.abs() < LIMIT * noise {
            points[k].push(Weighted { y: (q - center) / radius, weight: 1.0 });
        }
    }
    sheets
        .iter()
        .zip(&points)
        .map(|(old, own)| {
            if own.len() < FEWEST_OWN {
                return *old;
            }
            let Some(found) = sheet(center, radius, own, Some(old), noise / radius, Some(1)) else { return *old };
            let foot = found.quadric.project(center).0;
            let fresh = found.quadric.normalized_at(foot);
            if fresh.distance(foot).1.dot(old.distance(foot).1) > 0.0 { fresh } else { fresh.flipped() }
        })
        .collect()
}
