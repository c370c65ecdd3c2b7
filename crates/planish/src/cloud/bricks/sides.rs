//! One outside for all bricks.
//!
//! Nodes are the bodies of every brick, mostly parts of one. A sample in the halo of one brick stands where the neighbour has one of
//! its own: whether the normals of the two agree is a vote of their bodies. The votes are solved as those of samples are
//! ([X03] §7, [`super::super::orient`]); then bodies get their outside from a thinned set of all samples.

use super::{BrickFacts, BrickStore, StoreError};
use crate::cloud::Quadric;
use crate::cloud::local::fitted::Fit;
use crate::cloud::orient::link::{Vote, components};
use crate::cloud::orient::{Hints, contracted, outward};
use crate::cloud::stand::Stand;
use crate::geom::KdTree;
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Samples near one of another brick that may be the same place of the surface.
const SAME_PLACE_ASKED: usize = 4;
/// They are it if they lie within this share of its radius, beside its plane by at most this share of that, ...
const SAME_PLACE_RADII: f64 = 0.6;
const SAME_PLACE_ASIDE: f64 = 0.25;
/// ... and their normals differ by less than this cosine.
const SAME_PLACE_COSINE: f64 = 0.8;
/// Samples that bodies get their outside from, at most: their sums have the error of their root.
const MOST_ASKED: usize = 1 << 17;

/// Which way the pieces of all bricks look.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sides {
    /// For each brick and piece of it 1, or -1 if it is inside out.
    pub signs: Vec<Vec<f64>>,
    /// And the body that it belongs to, by falling area.
    pub segments: Vec<Vec<u32>>,
    /// Whether the largest body is closed.
    pub closed: bool,
    /// Number of bodies.
    pub bodies: usize,
}

impl Sides {
    /// Settles the sides of all pieces.
    /// * `store` - with the samples of all bricks
    /// # Errors
    /// If they cannot be read.
    pub fn new(store: &dyn BrickStore) -> Result<Sides, StoreError> {
        let count = store.bricks().len();
        let facts = (0..count).map(|b| store.facts(b)).collect::<Result<Vec<BrickFacts>, _>>()?;
        let mut first = vec![0u32];
        facts.iter().for_each(|f| first.push(first[first.len() - 1] + f.pieces));
        // What a file tells of the outside is one more piece, which everything told agrees with.
        let told = first[count];
        let mut sums: BTreeMap<(u32, u32), f64> = BTreeMap::new();
        let met = (0..count).into_par_iter().map(|b| meetings(b, store, &facts, &first));
        for (i, j, agree) in met.collect::<Result<Vec<_>, _>>()?.into_iter().flatten() {
            *sums.entry((i.min(j), i.max(j))).or_insert(0.0) += agree;
        }
        for b in (0..count).filter(|&b| facts[b].told) {
            store.stands(b)?.own.iter().for_each(|s| *sums.entry((first[b] + s.segment, told)).or_insert(0.0) += 1.0);
        }
        let vote = |((a, b), sum): (&(u32, u32), &f64)| Vote {
            a: *a,
            b: *b,
            sign: sum.signum(),
            weight: sum.abs(),
            smooth: true,
        };
        let votes: Vec<Vote> = sums.iter().filter(|s| *s.1 != 0.0).map(vote).collect();
        let mut sign = contracted(told as usize + 1, &votes);
        let agreed = votes.iter().filter(|v| v.sign * sign[v.a as usize] * sign[v.b as usize] > 0.0);
        let body = components(sign.len(), agreed.map(|v| (v.a, v.b)));
        let turned =
            body.iter().zip(&sign).map(|(b, s)| if *b == body[told as usize] { s * sign[told as usize] } else { *s });
        sign = turned.collect();
        let asked = Asked::new(store, &facts, &first)?;
        let (closed, inside_out) = outside(&asked, &body, &sign);
        sign.iter_mut().zip(&body).filter(|(_, b)| inside_out[**b as usize]).for_each(|(s, _)| *s = -*s);
        let mut areas: BTreeMap<u32, f64> = BTreeMap::new();
        for (area, body) in asked.areas.iter().zip(&body) {
            *areas.entry(*body).or_insert(0.0) += area;
        }
        let mut bodies: Vec<(u32, f64)> = areas.into_iter().collect();
        bodies.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let place: BTreeMap<u32, u32> = bodies.iter().zip(0..).map(|(b, k)| (b.0, k)).collect();
        let of_bricks = |w: &[u32]| w[0] as usize..w[1] as usize;
        Ok(Sides {
            signs: first.windows(2).map(|w| sign[of_bricks(w)].to_vec()).collect(),
            segments: first.windows(2).map(|w| body[of_bricks(w)].iter().map(|b| place[b]).collect()).collect(),
            closed,
            bodies: bodies.len(),
        })
    }

    /// Samples of a brick with their outside, and the body of the scan that they belong to.
    pub(super) fn turned(&self, brick: usize, stands: &[Stand]) -> impl Iterator<Item = Stand> {
        stands.iter().map(move |s| Stand {
            normal: self.signs[brick][s.segment as usize] * s.normal,
            segment: self.segments[brick][s.segment as usize],
            ..*s
        })
    }
}

/// Where samples in halos of others stand in a brick: both pieces, and whether they agree (1) or not (-1).
fn meetings(
    b: usize,
    store: &dyn BrickStore,
    facts: &[BrickFacts],
    first: &[u32],
) -> Result<Vec<(u32, u32, f64)>, StoreError> {
    let here = &store.bricks()[b];
    let stands = store.stands(b)?;
    let own = &stands.own;
    let tree = KdTree::new(&own.iter().map(|s| s.center).collect::<Vec<_>>());
    let mut near = Vec::new();
    let mut found = Vec::new();
    for a in (0..facts.len()).filter(|&a| a != b && facts[a].beyond.meets(&here.aabb)) {
        for s in store.stands(a)?.beyond.iter().filter(|s| here.holds(s.center)) {
            tree.nearest_within(s.center, SAME_PLACE_ASKED, SAME_PLACE_RADII * s.radius, &mut near);
            let aside = |t: &Stand| (t.center - s.center).dot(s.normal).abs();
            let same = near.iter().map(|n| &own[n.1 as usize]).filter(|t| {
                aside(t) < SAME_PLACE_ASIDE * SAME_PLACE_RADII * s.radius
                    && t.normal.dot(s.normal).abs() > SAME_PLACE_COSINE
            });
            if let Some(t) = same.min_by(|t, u| aside(t).total_cmp(&aside(u))) {
                found.push((first[a] + s.segment, first[b] + t.segment, t.normal.dot(s.normal).signum()));
            }
        }
    }
    Ok(found)
}

/// Samples that tell where the outside is.
struct Asked {
    /// Every `step`-th of all, with its piece.
    stands: Vec<(Stand, usize)>,
    step: usize,
    /// Area of the samples of each piece.
    areas: Vec<f64>,
}

impl Asked {
    fn new(store: &dyn BrickStore, facts: &[BrickFacts], first: &[u32]) -> Result<Asked, StoreError> {
        let count: usize = facts.iter().map(|f| f.samples).sum();
        let step = count.div_ceil(MOST_ASKED).max(1);
        let mut stands = Vec::new();
        let mut before = 0usize;
        let mut areas = vec![0.0; first[facts.len()] as usize];
        for (b, from) in (0..facts.len()).zip(first) {
            let own = &store.stands(b)?.own;
            let skipped = before.next_multiple_of(step) - before;
            stands.extend(own.iter().skip(skipped).step_by(step).map(|s| (*s, (from + s.segment) as usize)));
            own.iter().for_each(|s| areas[(from + s.segment) as usize] += s.area);
            before += own.len();
        }
        Ok(Asked { stands, step, areas })
    }
}

/// Whether the largest body is closed, and for each body, by its label, whether it is inside out.
fn outside(asked: &Asked, body: &[u32], sign: &[f64]) -> (bool, Vec<bool>) {
    let told = body[body.len() - 1];
    let Asked { stands: asked, step, .. } = asked;
    let fits: Vec<Fit> = asked.iter().map(|(s, _)| as_fit(s)).collect();
    let areas: Vec<f64> = asked.iter().map(|(s, _)| *step as f64 * s.area).collect();
    let before: Vec<f64> = asked.iter().map(|(_, piece)| sign[*piece]).collect();
    let known: Vec<DVec3> = asked
        .iter()
        .map(|(s, piece)| if body[*piece] == told { sign[*piece] * s.normal } else { DVec3::ZERO })
        .collect();
    // Bodies are labelled by their first sample.
    let mut least = vec![u32::MAX; body.len()];
    asked.iter().enumerate().for_each(|(i, (_, piece))| {
        let of = &mut least[body[*piece] as usize];
        *of = (*of).min(i as u32);
    });
    let label: Vec<u32> = asked.iter().map(|(_, piece)| least[body[*piece] as usize]).collect();
    let mut after = before.clone();
    let hints = Hints { toward: None, normals: Some(&known), areas: &areas };
    let (_, closed) = outward(&fits, &mut after, &label, &hints);
    let mut inside_out = vec![false; body.len()];
    for (i, (_, piece)) in asked.iter().enumerate() {
        inside_out[body[*piece] as usize] = before[i] != after[i];
    }
    (closed.first().copied().unwrap_or(false), inside_out)
}

/// A sample as what sides are decided from: of a fit that needs no more than its place, normal, reach and gap.
fn as_fit(s: &Stand) -> Fit {
    Fit {
        quadric: Quadric::plane(s.center, s.radius, s.normal),
        center: s.center,
        normal: s.normal,
        radius: s.radius,
        noise: 0.0,
        thickness: 1.0,
        error: 0.0,
        irregularity: 0.0,
        class: 0,
        site: 0,
        sheets: 1,
        gap: if s.plate { 0.0 } else { f64::INFINITY },
        owned: 0,
    }
}
