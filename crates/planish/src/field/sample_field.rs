//! Samples as a field: fits blended inside one sheet only, sheets joined by their maximum or minimum.
//!
//! [X03] Xie et al. 2003, §4.2 eq. 4: modified Shepard blend of the local quadrics.
//! 1. the fits whose support holds the point, with their distances and gradients there
//! 2. fits that say the same are one sheet; each sheet is blended by itself
//! 3. sheets that lie behind each other meet in a convex edge (maximum), those in front of each other in a concave one
//!    (minimum); three and more are nested
//!
//! Departs from [X03]: one blend over all fits rounds every crease by the width of the supports. Far from all samples the
//! field is unknown, or, where holes are to be closed, follows the winding number of the samples.

use super::Field;
use crate::cloud::{Dipoles, Sample, Samples};
use crate::geom::{Aabb, KdTree};
use glam::DVec3;
use rayon::prelude::*;

/// Samples asked at one point.
const ASKED: usize = 28;
/// Cosine above which the gradients of two fits may be of one sheet.
const SAME: f64 = 0.82;
/// Difference of two distances, over the distance of the centres, up to which they may be of one sheet.
const LEVEL: f64 = 0.3;
/// The pseudo-distance changes by at most this much per length near the surface.
const STEEP: f64 = 1.5;
/// From this share of the support on a point is beside the data.
const BESIDE: f64 = 0.5;
/// The winding number decides where it is this far from one half.
const CERTAIN: f64 = 0.3;
/// Most sheets at one point; weaker ones are left out.
const SHEETS: usize = 5;
/// A sheet with less than this share of the weight of the strongest is left out: noise of a single fit.
const FAINT: f64 = 0.02;

/// The blended field of oriented samples.
pub struct SampleField {
    samples: Vec<Sample>,
    tree: KdTree,
    bounds: Aabb,
    /// Widest support.
    widest: f64,
    noise_deg: f64,
    /// Winding number of the samples, where holes are closed.
    closing: Option<Dipoles>,
}

/// One fit at a point.
#[derive(Clone, Copy)]
struct Seen {
    id: u32,
    weight: f64,
    distance: f64,
    normal: DVec3,
    sheet: u32,
}

/// One sheet at a point.
#[derive(Clone, Copy, Default)]
struct Sheet {
    weight: f64,
    distance: f64,
    normal: DVec3,
}

impl SampleField {
    /// The field of `samples`. With `close`, places without data get their side from the winding number.
    pub fn new(samples: &Samples, close: bool) -> SampleField {
        let items = samples.samples.clone();
        let centers: Vec<DVec3> = items.iter().map(|s| s.center).collect();
        let tree = KdTree::new(&centers);
        let widest = items.iter().map(|s| s.support).fold(0.0, f64::max);
        let mut bounds = Aabb::of(&centers);
        bounds.min -= DVec3::splat(0.5 * widest);
        bounds.max += DVec3::splat(0.5 * widest);
        let closing =
            close.then(|| Dipoles::new(&items.iter().map(|s| (s.center, s.normal * s.area)).collect::<Vec<_>>()));
        SampleField { samples: items, tree, bounds, widest, noise_deg: samples.normal_noise_deg, closing }
    }

    /// Value and unit gradient at `p`; NaN where nothing is known.
    pub fn evaluate(&self, p: DVec3) -> (f64, DVec3) {
        let mut near = Vec::with_capacity(ASKED);
        self.evaluate_with(p, &mut near)
    }

    fn evaluate_with(&self, p: DVec3, near: &mut Vec<(f64, u32)>) -> (f64, DVec3) {
        self.tree.nearest_within(p, ASKED, self.widest, near);
        let mut seen = [Seen { id: 0, weight: 0.0, distance: 0.0, normal: DVec3::ZERO, sheet: 0 }; ASKED];
        let mut count = 0;
        for &(d2, id) in near.iter() {
            let s = &self.samples[id as usize];
            let t2 = d2 / (s.support * s.support);
            if t2 < 1.0 {
                let (distance, normal) = s.quadric.distance(p);
                if distance.is_finite() {
                    // C2 at the rim; a steep bell, so that a point hears the fits beside it.
                    let w = (1.0 - t2).powi(4) * s.trust;
                    seen[count] = Seen { id, weight: w, distance, normal, sheet: u32::MAX };
                    count += 1;
                }
            }
        }
        let seen = &mut seen[..count];
        if seen.is_empty() {
            return self.beyond(p);
        }
        let sheets = self.part(seen);
        let (value, normal) = self.join(seen, sheets);
        // Away from the data the samples together know better than a fit carried on beyond its points.
        let off = near.first().map_or(f64::INFINITY, |n| n.0.sqrt());
        let own = &self.samples[seen[0].id as usize];
        if off > BESIDE * own.support
            && let Some(dipoles) = &self.closing
        {
            let winding = dipoles.number(p, 0.0);
            let outside = winding < 0.5;
            if outside != (value >= 0.0) && (winding - 0.5).abs() > CERTAIN {
                let size = value.abs().max(0.05 * own.support);
                return (if outside { size } else { -size }, normal);
            }
        }
        (value, normal)
    }

    /// Parts the fits into sheets, the heaviest first; returns how many there are.
    fn part(&self, seen: &mut [Seen]) -> usize {
        let mut count = 0u32;
        loop {
            // The heaviest fit without a sheet begins one; those that agree with a member join it.
            let mut lead: Option<usize> = None;
            for i in 0..seen.len() {
                if seen[i].sheet == u32::MAX && lead.is_none_or(|l| seen[i].weight > seen[l].weight) {
                    lead = Some(i);
                }
            }
            let Some(lead) = lead else { break };
            seen[lead].sheet = count;
            let mut fresh = [0usize; ASKED];
            fresh[0] = lead;
            let (mut done, mut top) = (0, 1);
            while done < top {
                let i = fresh[done];
                done += 1;
                for j in 0..seen.len() {
                    if seen[j].sheet == u32::MAX && self.agree(&seen[i], &seen[j]) {
                        seen[j].sheet = count;
                        fresh[top] = j;
                        top += 1;
                    }
                }
            }
            count += 1;
        }
        count as usize
    }

    /// Are two fits of one sheet, as seen from the point?
    fn agree(&self, a: &Seen, b: &Seen) -> bool {
        if a.normal.dot(b.normal) < SAME {
            return false;
        }
        let (s, t) = (&self.samples[a.id as usize], &self.samples[b.id as usize]);
        let apart = s.center.distance(t.center);
        (a.distance - b.distance).abs() < LEVEL * apart + 2.0 * (s.error + t.error)
    }

    /// Blends each sheet and joins them.
    fn join(&self, seen: &[Seen], count: usize) -> (f64, DVec3) {
        let mut all = [Sheet::default(); ASKED];
        for s in seen {
            let sheet = &mut all[s.sheet as usize];
            sheet.weight += s.weight;
            sheet.distance += s.weight * s.distance;
            sheet.normal += s.weight * s.normal;
        }
        for s in &mut all[..count] {
            s.distance /= s.weight;
            s.normal = s.normal.normalize_or_zero();
        }
        if count == 1 {
            return (all[0].distance, all[0].normal);
        }
        let most = all[..count].iter().map(|s| s.weight).fold(0.0, f64::max);
        let mut ids = [0usize; SHEETS];
        let mut kept = 0;
        for i in 0..count {
            if all[i].weight > FAINT * most && kept < SHEETS {
                ids[kept] = i;
                kept += 1;
            }
        }
        if kept == 1 {
            return (all[ids[0]].distance, all[ids[0]].normal);
        }
        // relation > 0: in front of each other (concave), < 0: behind each other (convex).
        let mut relation = [[0.0; SHEETS]; SHEETS];
        for a in 0..kept {
            for b in 0..a {
                let mut sum = 0.0;
                for s in seen.iter().filter(|s| s.sheet as usize == ids[a]) {
                    for t in seen.iter().filter(|t| t.sheet as usize == ids[b]) {
                        let (f, g) = (&self.samples[s.id as usize], &self.samples[t.id as usize]);
                        let side = f.quadric.distance(g.center).0 + g.quadric.distance(f.center).0;
                        if side.is_finite() {
                            sum += s.weight * t.weight * side;
                        }
                    }
                }
                relation[a][b] = sum;
                relation[b][a] = sum;
            }
        }
        nest(&mut ids[..kept].to_vec(), &all, &relation, &(0..kept).collect::<Vec<_>>())
    }

    /// Where no fit reaches.
    fn beyond(&self, p: DVec3) -> (f64, DVec3) {
        match &self.closing {
            None => (f64::NAN, DVec3::ZERO),
            Some(dipoles) => {
                let value = |p: DVec3| (0.5 - dipoles.number(p, 0.0)) * self.widest;
                let e = 1e-3 * self.widest;
                let along = |d: DVec3| value(p + d * e) - value(p - d * e);
                let g = DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z));
                (value(p), g.normalize_or_zero())
            }
        }
    }
}

/// Nested maxima and minima: the sheet that stands to all others in the same way is joined last.
fn nest(ids: &mut Vec<usize>, all: &[Sheet], relation: &[[f64; SHEETS]; SHEETS], rows: &[usize]) -> (f64, DVec3) {
    if rows.len() == 1 {
        let s = &all[ids[rows[0]]];
        return (s.distance, s.normal);
    }
    // How much of a row's relations has the sign of their sum; the most one-sided stands outermost.
    let (mut outer, mut best) = (0, -1.0);
    for (k, &a) in rows.iter().enumerate() {
        let (mut sum, mut size) = (0.0f64, 0.0f64);
        for &b in rows {
            if a != b {
                sum += relation[a][b];
                size += relation[a][b].abs();
            }
        }
        let one_sided = if size > 0.0 { sum.abs() / size } else { 1.0 };
        if one_sided > best {
            (outer, best) = (k, one_sided);
        }
    }
    let a = rows[outer];
    let sum: f64 = rows.iter().filter(|&&b| b != a).map(|&b| relation[a][b]).sum();
    let rest: Vec<usize> = rows.iter().copied().filter(|&b| b != a).collect();
    let inner = nest(ids, all, relation, &rest);
    let own = (all[ids[a]].distance, all[ids[a]].normal);
    let take_own = if sum > 0.0 { own.0 < inner.0 } else { own.0 > inner.0 };
    if take_own { own } else { inner }
}

impl Field for SampleField {
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn value(&self, p: DVec3) -> f64 {
        self.evaluate(p).0
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        self.evaluate(p).1
    }

    fn values(&self, points: &[DVec3], values: &mut [f64]) {
        values
            .par_iter_mut()
            .zip(points)
            .for_each_init(|| Vec::with_capacity(ASKED), |near, (v, &p)| *v = self.evaluate_with(p, near).0);
    }

    fn crosses(&self, aabb: &Aabb) -> bool {
        let reach = aabb.diagonal() / 2.0;
        let mut near = Vec::with_capacity(ASKED);
        let value = self.evaluate_with(aabb.center(), &mut near).0;
        if value.is_nan() {
            self.tree.nearest_within(aabb.center(), 1, reach + self.widest, &mut near);
            return !near.is_empty();
        }
        value.abs() <= STEEP * reach
    }

    fn noise_deg(&self) -> f64 {
        self.noise_deg
    }
}
