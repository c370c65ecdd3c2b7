//! One outside for all samples.
//!
//! [X03] §7, fig. 12, solved globally: all meetings of samples are signed votes.
//! 1. the signs of a maximum spanning tree of the votes; then samples and whole patches turn while that satisfies more
//! 2. parts without a vote between them: scanner positions where known; else closed parts by the winding number of the
//!    larger ones around them; open parts by it, too, if they fill a hole of others, else upwards
//! 3. patches that scanners, normals or, in closed parts, the winding number of all contradict turn (`wind`)
//!
//! Departs from [X03]: patches are not merged one after the other, where a single wrong meeting turns a whole patch.

use super::dipoles::Dipoles;
use super::front::Fit;
use super::link::{Vote, components, middle, root};
use super::wind::wind;
use glam::DVec3;

/// What decides between inside and outside.
pub(super) struct Hints<'a> {
    /// For each sample the direction to the scanner that saw it, if known.
    pub toward: Option<&'a [DVec3]>,
    /// For each sample the normal of the file, if known.
    pub normals: Option<&'a [DVec3]>,
    /// Area that each sample stands for.
    pub areas: &'a [f64],
}

/// The result of [`orient`].
pub(super) struct Oriented {
    /// 1 or -1 per sample.
    pub sign: Vec<f64>,
    /// Part of each sample, parts numbered by falling area.
    pub part: Vec<u32>,
    /// Share of satisfied votes around each sample, 0 to 1.
    pub confidence: Vec<f64>,
    /// Whether each part is closed: the winding number says the same on all of its inside.
    pub closed: Vec<bool>,
}

/// Samples whose votes may turn in one sweep, at most this often.
pub(super) const SWEEPS: usize = 12;
/// A part whose normals cancel to this share of its area may be closed.
const CANCELS: f64 = 0.15;
/// And its volume is above this share of what its area and size allow.
const HOLLOW: f64 = 0.05;
/// Scanner positions and normals of the file decide a part if their sum is above this share of its area.
pub(super) const DECIDED: f64 = 0.05;
/// An open part is in a hole of the others if their winding number differs this much between its sides.
const STEP: f64 = 0.1;

/// Orients the samples.
pub(super) fn orient(fits: &[Fit], votes: &[Vote], hints: &Hints) -> Oriented {
    let mut sign = spanning(fits.len(), votes);
    improve(&mut sign, votes);
    let label = components(fits.len(), votes.iter().map(|v| (v.a, v.b)));
    let (part, count) = by_area(&label, hints.areas);
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); count];
    part.iter().enumerate().for_each(|(i, &p)| members[p as usize].push(i as u32));
    let mut settled: Vec<(DVec3, DVec3)> = Vec::new();
    let mut closed = Vec::with_capacity(count);
    for own in &members {
        let is_closed = decide(own, fits, &mut sign, hints, &settled);
        closed.push(is_closed);
        settled.extend(own.iter().map(|&i| {
            let i = i as usize;
            (fits[i].center, sign[i] * hints.areas[i] * fits[i].normal)
        }));
    }
    wind(&mut sign, fits, votes, hints, |i| closed[part[i] as usize]);
    let confidence = confidence(&sign, votes);
    Oriented { sign, part, confidence, closed }
}

/// Signs along a spanning tree of the strongest votes (Kruskal).
fn spanning(count: usize, votes: &[Vote]) -> Vec<f64> {
    let mut order: Vec<u32> = (0..votes.len() as u32).collect();
    order.sort_unstable_by(|&i, &j| votes[j as usize].weight.total_cmp(&votes[i as usize].weight).then(i.cmp(&j)));
    let mut parent: Vec<u32> = (0..count as u32).collect();
    let mut edges: Vec<Vec<(u32, f64)>> = vec![Vec::new(); count];
    for i in order {
        let v = votes[i as usize];
        let (a, b) = (root(&mut parent, v.a), root(&mut parent, v.b));
        if a != b {
            parent[a.max(b) as usize] = a.min(b);
            edges[v.a as usize].push((v.b, v.sign));
            edges[v.b as usize].push((v.a, v.sign));
        }
    }
    let mut sign = vec![0.0; count];
    for start in 0..count {
        if sign[start] != 0.0 {
            continue;
        }
        sign[start] = 1.0;
        let mut stack = vec![start as u32];
        while let Some(i) = stack.pop() {
            for &(j, s) in &edges[i as usize] {
                if sign[j as usize] == 0.0 {
                    sign[j as usize] = sign[i as usize] * s;
                    stack.push(j);
                }
            }
        }
    }
    sign
}

/// Turns single samples, then whole smooth patches, while more votes are satisfied.
fn improve(sign: &mut [f64], votes: &[Vote]) {
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); sign.len()];
    for (k, v) in votes.iter().enumerate() {
        around[v.a as usize].push(k as u32);
        around[v.b as usize].push(k as u32);
    }
    for _ in 0..SWEEPS {
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
pub(super) fn patches(sign: &[f64], votes: &[Vote]) -> Vec<u32> {
    let agreed = votes.iter().filter(|v| v.smooth && v.sign * sign[v.a as usize] * sign[v.b as usize] > 0.0);
    components(sign.len(), agreed.map(|v| (v.a, v.b)))
}

/// Numbers the parts by falling area, ties by the least sample.
fn by_area(label: &[u32], areas: &[f64]) -> (Vec<u32>, usize) {
    let mut sum = vec![0.0; label.len()];
    for (l, a) in label.iter().zip(areas) {
        sum[*l as usize] += a;
    }
    let mut roots: Vec<u32> = (0..label.len() as u32).filter(|&i| label[i as usize] == i).collect();
    roots.sort_by(|&a, &b| sum[b as usize].total_cmp(&sum[a as usize]).then(a.cmp(&b)));
    let mut rank = vec![0; label.len()];
    roots.iter().enumerate().for_each(|(r, &l)| rank[l as usize] = r as u32);
    (label.iter().map(|&l| rank[l as usize]).collect(), roots.len())
}

/// Decides which side of a part is outside; returns whether it is closed.
fn decide(own: &[u32], fits: &[Fit], sign: &mut [f64], hints: &Hints, settled: &[(DVec3, DVec3)]) -> bool {
    let area: f64 = own.iter().map(|&i| hints.areas[i as usize]).sum();
    let sum = |of: &dyn Fn(usize) -> f64| own.iter().map(|&i| hints.areas[i as usize] * of(i as usize)).sum::<f64>();
    let total = own.iter().map(|&i| i as usize).map(|i| sign[i] * hints.areas[i] * fits[i].normal).sum::<DVec3>();
    let center = middle(own.iter().map(|&i| (fits[i as usize].center, hints.areas[i as usize])));
    let volume = sum(&|i| sign[i] * fits[i].normal.dot(fits[i].center - center));
    let extent = sum(&|i| (fits[i].center - center).length());
    // A plate has next to no volume; that it has two sides is known.
    let plate: f64 = sum(&|i| f64::from(u8::from(fits[i].gap.is_finite())));
    let closed = total.length() < CANCELS * area && (volume.abs() > HOLLOW * extent || plate > area / 2.0);
    let outward = |known: &[DVec3]| sum(&|i| sign[i] * fits[i].normal.dot(known[i]));
    let mut verdict = 0.0;
    for known in [hints.normals, hints.toward].into_iter().flatten() {
        let s = outward(known);
        if verdict == 0.0 && s.abs() > DECIDED * area {
            verdict = s;
        }
    }
    if verdict == 0.0 && closed {
        let around = Dipoles::new(settled);
        let inside = sum(&|i| around.number(fits[i].center, 0.0)) / area.max(1e-300);
        // Inside a body a closed part is a cavity, whose outside is its own inside.
        verdict = if inside > 0.5 { -volume } else { volume };
    }
    if verdict == 0.0 && !settled.is_empty() {
        // An open part in a hole of what is settled has the inside of that behind it.
        let around = Dipoles::new(settled);
        let step = sum(&|i| {
            let aside = sign[i] * fits[i].radius * fits[i].normal;
            around.number(fits[i].center - aside, 0.0) - around.number(fits[i].center + aside, 0.0)
        });
        if step.abs() > STEP * area {
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
