//! Bodies: connected sets of samples whose votes agree ([X03] §7 merges patches), where two spheres that touch come apart.
//!
//! See `docs/methods/samples.md`, section 5.

use super::link::{Vote, components, middle};
use crate::cloud::local::fitted::Fit;
use crate::geom::KdTree;
use glam::DVec3;
use std::collections::BTreeMap;

/// A part whose normals cancel to this share of its area may be closed.
const CANCELS: f64 = 0.15;
/// And its volume is above this share of what its area and size allow.
const HOLLOW: f64 = 0.05;
/// Cosine of the turn between normals (105 degrees) from which two samples that see each other face a gap: what is less
/// steep may be a groove of one body.
const GAP_COSINE: f64 = 0.25;
/// Votes of less weight join no pieces.
const LEAST_VOTE: f64 = 0.001;
/// Fewer samples are no body.
const BODY: usize = 8;

/// Segments: bodies, each with the open pieces that go with it.
///
/// Samples joined by votes that hold are one piece, but not across a gap: what looks at each other there has the outside
/// between it, so two bodies that touch come apart. A piece that is not closed is no body of its own and goes with the piece
/// that it has most votes with, satisfied or not.
pub(crate) fn segments(sign: &[f64], fits: &[Fit], votes: &[Vote], areas: &[f64]) -> Vec<u32> {
    let faces = |i: usize, j: usize| {
        let (f, g) = (&fits[i], &fits[j]);
        let turn = sign[i] * sign[j] * f.normal.dot(g.normal);
        turn < -GAP_COSINE
            && sign[i] * f.quadric.distance(g.center).0 > 0.0
            && sign[j] * g.quadric.distance(f.center).0 > 0.0
    };
    let joins = votes.iter().filter(|v| {
        let (i, j) = (v.a as usize, v.b as usize);
        v.weight > LEAST_VOTE && v.sign * sign[i] * sign[j] > 0.0 && !faces(i, j)
    });
    let (piece, members) = by_area(&components(fits.len(), joins.map(|v| (v.a, v.b))), areas);
    let is_body = |own: &Vec<u32>| own.len() >= BODY && Shape::of(own, fits, sign, areas).closed;
    let body: Vec<bool> = members.iter().map(is_body).collect();
    let mut votes_with: Vec<BTreeMap<u32, f64>> = vec![BTreeMap::new(); members.len()];
    for v in votes {
        let [a, b] = [v.a, v.b].map(|i| piece[i as usize]);
        for (from, to) in [(a, b), (b, a)] {
            if from != to && !body[from as usize] {
                *votes_with[from as usize].entry(to).or_insert(0.0) += v.weight;
            }
        }
    }
    let pairs = votes_with.iter().enumerate().filter_map(|(from, with)| {
        let most = with.iter().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(a.0)))?;
        Some((from as u32, *most.0))
    });
    let joined = components(members.len(), pairs.chain(crumbs(fits, &piece, &members, &votes_with)));
    // As labels of samples: the least one of each set.
    let mut least = vec![u32::MAX; members.len()];
    piece.iter().enumerate().for_each(|(i, &p)| {
        let of = &mut least[joined[p as usize] as usize];
        *of = (*of).min(i as u32);
    });
    piece.iter().map(|&p| least[joined[p as usize] as usize]).collect()
}

/// Pieces of a few samples without votes, each with the piece of the nearest sample within twice the radius.
fn crumbs(fits: &[Fit], piece: &[u32], members: &[Vec<u32>], votes_with: &[BTreeMap<u32, f64>]) -> Vec<(u32, u32)> {
    let tree = KdTree::new(&fits.iter().map(|f| f.center).collect::<Vec<_>>());
    let few = (0..members.len()).filter(|&k| members[k].len() < BODY && votes_with[k].is_empty());
    let mut near = Vec::new();
    few.filter_map(|k| {
        let nearest = members[k].iter().filter_map(|&i| {
            let f = &fits[i as usize];
            tree.nearest_within(f.center, BODY, 2.0 * f.radius, &mut near);
            near.iter().map(|n| (n.0, piece[n.1 as usize])).find(|n| n.1 as usize != k)
        });
        let nearest = nearest.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
        Some((k as u32, nearest.1))
    })
    .collect()
}

/// Sets by falling area, ties by the least sample: the number of the set of each sample, and the samples of each.
pub(crate) fn by_area(label: &[u32], areas: &[f64]) -> (Vec<u32>, Vec<Vec<u32>>) {
    let mut sum = vec![0.0; label.len()];
    for (l, a) in label.iter().zip(areas) {
        sum[*l as usize] += a;
    }
    let mut roots: Vec<u32> = (0..label.len() as u32).filter(|&i| label[i as usize] == i).collect();
    roots.sort_by(|&a, &b| sum[b as usize].total_cmp(&sum[a as usize]).then(a.cmp(&b)));
    let mut rank = vec![0; label.len()];
    roots.iter().enumerate().for_each(|(r, &l)| rank[l as usize] = r as u32);
    let number: Vec<u32> = label.iter().map(|&l| rank[l as usize]).collect();
    let mut members = vec![Vec::new(); roots.len()];
    number.iter().enumerate().for_each(|(i, &n)| members[n as usize].push(i as u32));
    (number, members)
}

/// Sums over some samples that tell a body from an open sheet.
pub(crate) struct Shape {
    /// Of the normals, each times its area.
    pub total: DVec3,
    /// Three times the volume.
    pub volume: f64,
    pub closed: bool,
}

impl Shape {
    pub(crate) fn of(own: &[u32], fits: &[Fit], sign: &[f64], areas: &[f64]) -> Shape {
        let sum = |of: &dyn Fn(usize) -> f64| own.iter().map(|&i| areas[i as usize] * of(i as usize)).sum::<f64>();
        let area = sum(&|_| 1.0);
        let total = own.iter().map(|&i| i as usize).map(|i| sign[i] * areas[i] * fits[i].normal).sum::<DVec3>();
        let center = middle(own.iter().map(|&i| (fits[i as usize].center, areas[i as usize])));
        let volume = sum(&|i| sign[i] * fits[i].normal.dot(fits[i].center - center));
        let extent = sum(&|i| (fits[i].center - center).length());
        // A plate has next to no volume; that it has two sides is known.
        let plate = sum(&|i| f64::from(u8::from(fits[i].gap.is_finite())));
        let closed = total.length() < CANCELS * area && (volume.abs() > HOLLOW * extent || plate > area / 2.0);
        Shape { total, volume, closed }
    }
}
