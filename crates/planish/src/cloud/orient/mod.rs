//! One outside for all samples.
//!
//! [X03] §7, fig. 12, solved globally: all meetings of samples are signed votes.
//! 1. groups of samples join where their votes are clearest in sum; then samples and whole patches turn while that
//!    satisfies more
//! 2. bodies and what goes with them (`segments`): scanner positions where known; else closed parts by the winding number of
//!    the larger ones around them; open parts by it, too, if they fill a hole of others, else upwards
//! 3. patches that scanners, normals or, in closed parts, the winding number of all contradict turn (`wind`)
//!
//! Departs from [X03]: patches are not merged one after the other, where a single wrong meeting turns a whole patch.

mod dipoles;
pub(crate) mod link;
mod segments;
pub(crate) mod views;
mod wind;

pub use dipoles::Dipoles;

use super::local::fitted::Fit;
use super::orient::link::{Vote, components};
use super::orient::segments::{Shape, by_area, segments};
use super::orient::wind::wind;
use crate::geom::tolerance::divisor;
use glam::DVec3;
use std::cmp::{Ordering, Reverse};
use std::collections::{BTreeMap, BinaryHeap};

/// What decides between inside and outside.
pub(crate) struct Hints<'a> {
    /// For each sample the direction to the scanner that saw it, if known.
    pub toward: Option<&'a [DVec3]>,
    /// For each sample the normal of the file, if known.
    pub normals: Option<&'a [DVec3]>,
    /// Area that each sample stands for.
    pub areas: &'a [f64],
}

/// The result of [`orient`].
pub(crate) struct Oriented {
    /// 1 or -1 per sample.
    pub sign: Vec<f64>,
    /// Segment of each sample, numbered by falling area.
    pub segment: Vec<u32>,
    /// Share of satisfied votes around each sample, 0 to 1.
    pub confidence: Vec<f64>,
    /// Whether each segment is closed: its normals cancel, and it has a volume or two sides.
    pub closed: Vec<bool>,
}

/// Samples whose votes may turn in one sweep, at most this often.
pub(crate) const FLIP_SWEEPS: usize = 12;
/// Scanner positions and normals of the file decide a part if their sum is above this share of its area.
pub(crate) const DECIDED_WINDING: f64 = 0.05;
/// An open part is in a hole of the others if their winding number differs this much between its sides.
const HOLE_WINDING_STEP: f64 = 0.1;

/// Orients the samples.
pub(crate) fn orient(fits: &[Fit], votes: &[Vote], hints: &Hints) -> Oriented {
    let mut sign = contracted(fits.len(), votes);
    improve(&mut sign, votes);
    let label = segments(&sign, fits, votes, hints.areas);
    let is_closed = outward(fits, &mut sign, &label, hints).0;
    wind(&mut sign, fits, votes, hints, |i| is_closed[i]);
    let confidence = confidence(&sign, votes);
    let (segment, members) = by_area(&segments(&sign, fits, votes, hints.areas), hints.areas);
    let closed = members.iter().map(|own| Shape::of(own, fits, &sign, hints.areas).closed).collect();
    Oriented { sign, segment, confidence, closed }
}

/// Decides which side of every body is outside, the largest first. Returns for each sample whether its body is closed, and that
/// of each body by falling area.
/// * `label` - the body of each sample, by the least of its samples
pub(crate) fn outward(fits: &[Fit], sign: &mut [f64], label: &[u32], hints: &Hints) -> (Vec<bool>, Vec<bool>) {
    let mut settled = Settled::default();
    let mut is_closed = vec![false; fits.len()];
    let mut bodies = Vec::new();
    for own in by_area(label, hints.areas).1 {
        let closed = decide(&own, fits, sign, hints, &settled);
        own.iter().for_each(|&i| is_closed[i as usize] = closed);
        bodies.push(closed);
        settled.add(own.iter().map(|&i| {
            let i = i as usize;
            (fits[i].center, sign[i] * hints.areas[i] * fits[i].normal)
        }));
    }
    (is_closed, bodies)
}

/// Signs by contraction: the two groups whose votes for each other are clearest in sum become one, again and again. What
/// contradicts itself cancels out on the way, so a few wrong votes at a place do not stand against many at others.
/// Source: Keuper et al., *Efficient Decomposition of Image and Mesh Graphs by Lifted Multicuts*, 2015 (greedy additive edge
/// contraction), here with signs.
pub(crate) fn contracted(count: usize, votes: &[Vote]) -> Vec<f64> {
    // Votes between groups, with the signs that their first samples have.
    let mut groups: Vec<BTreeMap<u32, f64>> = vec![BTreeMap::new(); count];
    let mut heap = BinaryHeap::with_capacity(votes.len());
    for v in votes {
        groups[v.a as usize].insert(v.b, v.sign * v.weight);
        groups[v.b as usize].insert(v.a, v.sign * v.weight);
        heap.push(Meeting { sum: v.sign * v.weight, a: v.a, b: v.b });
    }
    let mut joined: Vec<Option<(u32, f64)>> = vec![None; count];
    while let Some(Meeting { sum, a, b }) = heap.pop() {
        // Sums that have changed since are in the heap once more.
        if groups[a as usize].get(&b) != Some(&sum) {
            continue;
        }
        let (a, b) = if groups[a as usize].len() < groups[b as usize].len() { (b, a) } else { (a, b) };
        joined[b as usize] = Some((a, sum.signum()));
        groups[a as usize].remove(&b);
        for (c, w) in std::mem::take(&mut groups[b as usize]) {
            if c == a {
                continue;
            }
            let all = groups[a as usize].entry(c).or_insert(0.0);
            *all += sum.signum() * w;
            let sum = *all;
            groups[c as usize].remove(&b);
            groups[c as usize].insert(a, sum);
            heap.push(Meeting { sum, a, b: c });
        }
    }
    let sign = |mut i: usize| {
        let mut sign = 1.0;
        while let Some((to, s)) = joined[i] {
            (i, sign) = (to as usize, sign * s);
        }
        sign
    };
    (0..count).map(sign).collect()
}

/// The votes between two groups, the clearest first.
struct Meeting {
    sum: f64,
    a: u32,
    b: u32,
}

impl Ord for Meeting {
    fn cmp(&self, other: &Meeting) -> Ordering {
        let ends = |m: &Meeting| Reverse((m.a.min(m.b), m.a.max(m.b)));
        self.sum.abs().total_cmp(&other.sum.abs()).then_with(|| ends(self).cmp(&ends(other)))
    }
}

impl PartialOrd for Meeting {
    fn partial_cmp(&self, other: &Meeting) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Meeting {
    fn eq(&self, other: &Meeting) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Meeting {}

/// Turns single samples, then whole smooth patches, while more votes are satisfied.
fn improve(sign: &mut [f64], votes: &[Vote]) {
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); sign.len()];
    for (k, v) in votes.iter().enumerate() {
        around[v.a as usize].push(k as u32);
        around[v.b as usize].push(k as u32);
    }
    for _ in 0..FLIP_SWEEPS {
        let mut turned = 0;
        for i in 0..sign.len() {
            let balance: f64 = around[i]
                .iter()
                .map(|&k| {
                    let v = &votes[k as usize];
                    v.weight * v.sign * sign[v.a as usize] * sign[v.b as usize]
                })
                .sum();
            if balance < 0.0 {
                sign[i] = -sign[i];
                turned += 1;
            }
        }
        let patch = patches(sign, votes);
        let mut balance = vec![0.0; sign.len()];
        for v in votes {
            let (a, b) = (patch[v.a as usize], patch[v.b as usize]);
            if a != b {
                let s = v.weight * v.sign * sign[v.a as usize] * sign[v.b as usize];
                balance[a as usize] += s;
                balance[b as usize] += s;
            }
        }
        // The patch that gains most turns alone, so that two neighbours do not turn against each other.
        let worst = (0..balance.len()).min_by(|&i, &j| balance[i].total_cmp(&balance[j]).then(i.cmp(&j)));
        if let Some(w) = worst
            && balance[w] < 0.0
        {
            for i in 0..sign.len() {
                if patch[i] as usize == w {
                    sign[i] = -sign[i];
                }
            }
            turned += 1;
        }
        if turned == 0 {
            break;
        }
    }
}

/// Patches: samples joined by satisfied smooth votes, as a label per sample.
pub(crate) fn patches(sign: &[f64], votes: &[Vote]) -> Vec<u32> {
    let agreed = votes.iter().filter(|v| v.smooth && v.sign * sign[v.a as usize] * sign[v.b as usize] > 0.0);
    components(sign.len(), agreed.map(|v| (v.a, v.b)))
}

/// Samples whose sides are decided, in trees each at least twice as large as the next, so that a thousand parts are added
/// without a thousand trees of all (Bentley and Saxe, *Decomposable Searching Problems*, 1980).
#[derive(Default)]
struct Settled {
    trees: Vec<(Vec<(DVec3, DVec3)>, Dipoles)>,
}

impl Settled {
    fn is_empty(&self) -> bool {
        self.trees.is_empty()
    }

    /// Adds a part: centres and normals times areas.
    fn add(&mut self, part: impl Iterator<Item = (DVec3, DVec3)>) {
        let mut all: Vec<(DVec3, DVec3)> = part.collect();
        while let Some((last, _)) = self.trees.pop_if(|t| t.0.len() < 2 * all.len()) {
            all = [last, all].concat();
        }
        let tree = Dipoles::new(&all);
        self.trees.push((all, tree));
    }

    /// Their winding number.
    fn number(&self, p: DVec3) -> f64 {
        self.trees.iter().map(|t| t.1.number(p, 0.0)).sum()
    }
}

/// Decides which side of a part is outside; returns whether it is closed.
fn decide(own: &[u32], fits: &[Fit], sign: &mut [f64], hints: &Hints, settled: &Settled) -> bool {
    let area: f64 = own.iter().map(|&i| hints.areas[i as usize]).sum();
    let sum = |of: &dyn Fn(usize) -> f64| own.iter().map(|&i| hints.areas[i as usize] * of(i as usize)).sum::<f64>();
    let Shape { total, volume, closed } = Shape::of(own, fits, sign, hints.areas);
    let outward = |known: &[DVec3]| sum(&|i| sign[i] * fits[i].normal.dot(known[i]));
    let mut verdict = 0.0;
    for known in [hints.normals, hints.toward].into_iter().flatten() {
        let s = outward(known);
        if verdict == 0.0 && s.abs() > DECIDED_WINDING * area {
            verdict = s;
        }
    }
    if verdict == 0.0 && closed {
        let inside = sum(&|i| settled.number(fits[i].center)) / divisor(area);
        // Inside a body a closed part is a cavity, whose outside is its own inside.
        verdict = if inside > 0.5 { -volume } else { volume };
    }
    if verdict == 0.0 && !settled.is_empty() {
        // An open part in a hole of what is settled has the inside of that behind it.
        let step = sum(&|i| {
            let aside = sign[i] * fits[i].radius * fits[i].normal;
            settled.number(fits[i].center - aside) - settled.number(fits[i].center + aside)
        });
        if step.abs() > HOLE_WINDING_STEP * area {
            verdict = step;
        }
    }
    if verdict == 0.0 {
        verdict = total.z;
    }
    if verdict < 0.0 {
        own.iter().for_each(|&i| sign[i as usize] = -sign[i as usize]);
    }
    closed
}

fn confidence(sign: &[f64], votes: &[Vote]) -> Vec<f64> {
    let mut good = vec![0.0; sign.len()];
    let mut all = vec![0.0; sign.len()];
    for v in votes {
        let s = v.sign * sign[v.a as usize] * sign[v.b as usize];
        for i in [v.a as usize, v.b as usize] {
            all[i] += v.weight;
            good[i] += if s > 0.0 { v.weight } else { 0.0 };
        }
    }
    good.iter().zip(&all).map(|(g, a)| if *a > 0.0 { g / a } else { 0.0 }).collect()
}
