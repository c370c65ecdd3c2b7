//! What the surface looks like around every site: one sheet, or a body cut out of several.
//!
//! Every site asks which nested maxima and minima (`nest`) of the oriented samples around explain its points. The blend of
//! these functions keeps edges sharp, and where one site errs its neighbours outvote it.

use super::nest::{self, Seen, cost, nest};
use super::sites::{Sites, in_pieces};
use super::{Quadric, Sample};
use crate::geom::KdTree;
use crate::observe::Observer;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// The points that a cell explains lie within this share of its support; beyond it the blend hardly hears it.
const HEARD: f64 = 0.75;
/// Most sheets of a cell.
pub(crate) const MOST: usize = nest::MOST;
/// What one sheet more must explain, in squared noise levels.
const PRICE: f64 = 14.0;
/// Candidates at most.
const ASKED: usize = 12;
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
    /// Samples whose quadrics are the sheets; the first `count` hold.
    pub sheets: [u32; MOST],
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
    let finish = |ids: &[u32], concave: u8, total: f64| {
        let mut sheets = [0; MOST];
        sheets[..ids.len()].copy_from_slice(ids);
        let error = ids.iter().map(|&i| samples[i as usize].error.powi(2)).sum::<f64>() / ids.len() as f64;
        // What the points show beyond noise is bias of the cell.
        let excess = (total / ball.len().max(1) as f64 - 1.0).max(0.0);
        let trust = (support * support / (error + 0.25 * excess * noise * noise).max(1e-12 * support * support)).min(1e12);
        Cell { center, support, trust, sheets, count: ids.len() as u8, concave }
    };
    if own.len() == 1 {
        let total = cost(&residuals(&samples[own[0] as usize].quadric));
        if total < PLAIN * ball.len() as f64 {
            return Some(finish(own, 0, total));
        }
    }
    // Candidates, those of the site first, then by distance.
    let mut near: Vec<(f64, u32)> = Vec::new();
    sample_tree.within(center, support, |i, _, d2| near.push((if own.contains(&i) { 0.0 } else { d2 }, i)));
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
            Seen { residuals: residuals(q), normal: q.distance(center).1 }
        })
        .collect();
    let found = nest(&all, false, PRICE)?;
    let ids: Vec<u32> = found.order.iter().map(|&k| asked[k]).collect();
    Some(finish(&ids, found.concave, found.cost))
}
