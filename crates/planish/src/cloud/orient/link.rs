//! Which samples see each other, and what they say of each other's direction.
//!
//! [X03] §7: normals agree along a sheet by the gradient of the neighbour's model at the sample; across an edge the
//! reflection of one normal along the line to the other tells; besides, both must lie on the same side of each other.

use crate::cloud::local::fitted::Fit;
use crate::geom::KdTree;
use crate::geom::tolerance::divisor;
use glam::DVec3;
use rayon::prelude::*;

/// Neighbours of a sample that are asked.
const VOTING_NEIGHBOURS: usize = 14;
/// Cosine above which two sheets may be one.
const ONE_SHEET_COSINE: f64 = 0.8;
/// Offset of one sheet at the other's centre, over their distance, up to which they may be one.
const ONE_SHEET_OFFSET: f64 = 0.05;

/// Cosine between a normal and the reflection of the other from which they are opposite points ([X03] §7: sqrt(3) / 2).
const OPPOSITE: f64 = 0.866;

/// Weight of the vote of two sheets of one plate or gap: more than any other has.
const PLATE_VOTE: f64 = 4.0;
/// A sheet goes on at most this share of the gap aside.
const SIDE: f64 = 0.4;

/// Power of the ratio of the noise of two samples, and of that of the region to theirs, in the weight of their vote.
const THICK: i32 = 6;

/// What one sample says of another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vote {
    pub a: u32,
    pub b: u32,
    /// 1: same orientation as fitted, -1: one of them is inside out.
    pub sign: f64,
    /// 0 to 1.
    pub weight: f64,
    /// Both are parts of one sheet.
    pub smooth: bool,
}

/// Votes between neighbouring samples, each pair once, in the order of the samples.
pub(crate) fn votes(fits: &[Fit], tree: &KdTree) -> Vec<Vote> {
    let all: Vec<Vec<Vote>> = (0..fits.len())
        .into_par_iter()
        .map_init(Vec::new, |near, i| {
            let f = &fits[i];
            tree.nearest(f.center, VOTING_NEIGHBOURS + 1, near);
            near.iter().filter(|n| n.1 as usize != i).filter_map(|n| vote(fits, i, n.1 as usize)).collect()
        })
        .collect();
    let mut votes: Vec<Vote> = all.into_iter().flatten().collect();
    votes.sort_unstable_by_key(|v| (v.a, v.b));
    votes.dedup_by_key(|v| (v.a, v.b));
    votes
}

fn vote(fits: &[Fit], i: usize, j: usize) -> Option<Vote> {
    let (i, j) = (i.min(j), i.max(j));
    let (f, g) = (&fits[i], &fits[j]);
    let apart = f.center.distance(g.center);
    let reach = f.radius.max(g.radius);
    if apart > 2.0 * reach {
        return None;
    }
    let (d, n) = f.quadric.distance(g.center);
    let (e, m) = g.quadric.distance(f.center);
    let turn = n.dot(g.normal) + m.dot(f.normal);
    // A fit through two sheets at once is thicker than what is around it, and speaks for neither.
    let ratio = f.noise.min(g.noise) / divisor(f.noise.max(g.noise)) / (f.thickness * g.thickness);
    let alike = ratio.powi(THICK).max(1e-6);
    let near = (1.0 - apart / (2.0 * reach)).max(0.01) * alike;
    // The two sides of a plate or a gap that were found as such look away from each other, and nothing speaks louder.
    if f.site == g.site && f.gap.is_finite() && g.gap.is_finite() {
        let sign = -turn.signum();
        return Some(Vote { a: i as u32, b: j as u32, sign, weight: PLATE_VOTE, smooth: false });
    }
    let slack = ONE_SHEET_OFFSET * apart + 3.0 * (f.error + g.error);
    if turn.abs() > 2.0 * ONE_SHEET_COSINE && d.abs() < slack && e.abs() < slack {
        // No sheet of a plate goes on as the other one.
        if d.abs().max(e.abs()) > SIDE * f.gap.min(g.gap) {
            return None;
        }
        let level = 1.0 - d.abs().max(e.abs()) / slack;
        let straight = (turn.abs() / 2.0 - ONE_SHEET_COSINE) / (1.0 - ONE_SHEET_COSINE);
        return Some(Vote {
            a: i as u32,
            b: j as u32,
            sign: turn.signum(),
            weight: (0.05 + 3.0 * level * straight) * near,
            smooth: true,
        });
    }
    // The reflection of one normal along the line to the other must be the other normal or its opposite, and both must
    // lie on the same side of each other: else these two are no opposite points and tell nothing.
    let way = (g.center - f.center) / divisor(apart);
    let mirrored = (f.normal - 2.0 * f.normal.dot(way) * way).dot(g.normal);
    let sign = (d * e).signum();
    let like = (mirrored * sign - OPPOSITE) / (1.0 - OPPOSITE);
    let clear = (d.abs().min(e.abs()) / divisor(apart)).min(1.0);
    let evidence = clear * near * 0.5 * like;
    (evidence > 0.0 && evidence.is_finite()).then_some(Vote {
        a: i as u32,
        b: j as u32,
        sign,
        weight: evidence,
        smooth: false,
    })
}

/// Sets of samples joined by pairs, as a label per sample: the least sample of each set.
pub(crate) fn components(count: usize, pairs: impl Iterator<Item = (u32, u32)>) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..count as u32).collect();
    for (a, b) in pairs {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[a.max(b) as usize] = a.min(b);
    }
    (0..count as u32).map(|i| root(&mut parent, i)).collect()
}

fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

/// Middle of points weighted by area.
pub(crate) fn middle(points: impl Iterator<Item = (DVec3, f64)>) -> DVec3 {
    let (sum, area) = points.fold((DVec3::ZERO, 0.0), |(s, a), (p, w)| (s + p * w, a + w));
    if area > 0.0 { sum / area } else { DVec3::ZERO }
}
