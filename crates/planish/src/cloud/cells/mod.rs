//! The surface around every site: one sheet, or a body cut out of several.
//!
//! Ohtake, Belyaev, Alexa, Turk, Seidel, *Multi-level Partition of Unity Implicits*, 2003, §4, with likelihoods in
//! place of angles; `docs/methods/samples.md`, section 6.
//! 1. every site asks which nested maxima and minima (`nest`) of the oriented samples around explain its points; the
//!    sheets are fitted again to their shares of the points (`refine`, `chance`)
//! 2. a plate ends where its points do (`rim`); a step gets a wall where the points change over (`step`)
//! 3. where sheets face cells on both sides, these ask the points up to them alone, as a cell of Ohtake et al. is divided
//! 4. a cell that neighbours of several sheets contradict loses nearly all of its weight
//!
//! The blend of these functions keeps edges sharp, and where one site errs its neighbours outvote it.

mod chance;
mod refine;
mod rim;
mod step;

use super::blend::Reach;
use super::cells::refine::{Nested, WIDEST_BALL, explained};
use super::cells::rim::rim;
use super::cells::step::{is_alike, step};
use super::local::joints::{RESIDUAL_LIMIT, capped, nearest_cost};
use super::local::nest::{self, Seen, cost, nest};
use super::local::points::Points;
use super::sites::front::{SHEET_PRICE, SIDE_BY_SIDE, VARIATION_PRICE};
use super::sites::{Sites, in_pieces};
use super::{Blend, Quadric, Sample};
use crate::geom::{Aabb, KdTree};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The points that a cell explains lie within this many supports: a fillet and an edge differ only from afar.
const HEARD: f64 = 1.3;
/// And it takes part in the blend within so many: nearly as far as its points.
const BLENDED: f64 = 1.2;
/// A cell between sheets on both sides reaches at least this many distances of sites: no place of the surface is farther than one
/// from a site, and half of one more lets cells overlap everywhere.
const COVERED_GAPS: f64 = 1.5;
/// Most sheets of a cell.
const MOST_SHEETS: usize = nest::MOST_NESTED;
/// Samples within this many supports are candidates.
const CANDIDATE_SUPPORTS: f64 = 2.0;
/// Passes over all cells: the second chooses among what the first has found, but for cells whose points cost less than this
/// each, in squared noise levels. They hardly ever find better ones.
const CELL_PASSES: usize = 2;
const KEPT: f64 = 1.2;
/// The middle of the points of a cell is at most this many supports from its surface: at a corner of 90 degrees a tenth.
const MIDDLE_OFF_SUPPORTS: f64 = 0.25;
/// Squared bias of a cell in the blend for the cost of its points beyond one.
const BIAS: f64 = 0.5;
/// Points of a cell at most: these many tell the sheets apart.
const MOST_CELL_POINTS: usize = 200;
/// And at most of the widest ball that sheets are fitted again to: they leave a tenth of the noise to chance.
const MOST_BALL_POINTS: usize = 1000;
/// Candidates at most.
const MOST_CANDIDATES: usize = 16;
/// A cell with one sheet is taken as it is if its points cost at most this much each, in squared noise levels, and what
/// chance adds.
const ONE_SHEET_COST: f64 = 1.05;
/// Steps are looked for where points cost more than this each, in squared noise levels.
const UNEXPLAINED: f64 = 1.3;
/// A higher sheet, the wall joined by the maximum, the lower one by the minimum.
const WALLED: u8 = 0b100;
/// Candidates are other sheets if their normals differ by the cosine of an edge (26 degrees) or their offsets by more than noise
/// does, in levels: without these first, the nearest of a small bore would all be of its wall.
const OTHER_SHEET: (f64, f64) = (0.9, RESIDUAL_LIMIT);
/// And other fits of a sheet if they differ by 8 degrees or so many levels.
const OTHER_FIT: (f64, f64) = (0.99, 0.7);

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
    pub sheets: [Quadric; MOST_SHEETS],
    /// Number of sheets.
    pub count: u8,
    /// Bit k: sheet k is joined to those before it by the minimum (a concave edge), else by the maximum (a convex one).
    pub concave: u8,
}

impl Cell {
    /// Signed distance, positive outside, and unit normal of the sheet that decides.
    pub fn evaluate(&self, p: DVec3) -> (f64, DVec3) {
        let mut best = self.sheets[0].distance(p);
        for k in 1..self.count as usize {
            let next = self.sheets[k].distance(p);
            if (next.0 < best.0) == (self.concave >> k & 1 == 1) {
                best = next;
            }
        }
        best
    }

    /// The same surface with its other side outside.
    pub(crate) fn flipped(mut self) -> Cell {
        self.sheets = self.sheets.map(Quadric::flipped);
        self.concave = !self.concave;
        self
    }

    /// Weight in the blend at `p`.
    pub(crate) fn weight(&self, p: DVec3) -> f64 {
        Reach::of(self).weight(p)
    }

    /// Does its support reach into a box?
    pub fn reaches(&self, aabb: &Aabb) -> bool {
        self.center.clamp(aabb.min, aabb.max).distance_squared(self.center) < self.support * self.support
    }
}

/// The cells of all sites.
pub(crate) fn cells(
    points: &[DVec3],
    tree: &KdTree,
    sites: &Sites,
    samples: &[Sample],
    of_site: &[u32],
    observer: &dyn Observer,
) -> Result<Vec<Cell>, Cancelled> {
    let mut owned = vec![(DVec3::ZERO, 0usize); sites.point.len()];
    for (p, &o) in points.iter().zip(&sites.owner) {
        if o != u32::MAX {
            owned[o as usize].0 += *p;
            owned[o as usize].1 += 1;
        }
    }
    let mut places: Vec<Place> = (0..sites.point.len())
        .map(|site| {
            let (sum, count) = owned[site];
            let support = sites.support(site);
            Place {
                center: if count > 0 { sum / count as f64 } else { sites.survey[site].quadric.center },
                support,
                noise: sites.noise(site).max(1e-9 * support),
                apart: sites.gap[site],
            }
        })
        .collect();
    let candidate =
        |(s, &site): (&Sample, &u32)| Candidate { quadric: s.quadric, at: s.center, error: s.error, owner: site };
    let mut candidates: Vec<Candidate> = samples.iter().zip(of_site).map(candidate).collect();
    let mut made: Vec<Option<Found>> = vec![None; places.len()];
    for pass in 0..CELL_PASSES {
        let around = KdTree::new(&candidates.iter().map(|c| c.at).collect::<Vec<_>>());
        let span = [pass, pass + 1].map(|k| k as f64 / CELL_PASSES as f64);
        let before = &made;
        let known = Known { tree, candidates: &candidates, around: &around };
        let fresh = in_pieces(places.len(), (span[0], span[1]), observer, |s, site| {
            let old = &before[site];
            if old.as_ref().is_some_and(|f| f.cost < KEPT) {
                return old.clone();
            }
            let new = known.find(&places[site], site as u32, pass > 0, &mut s.around);
            match (old, new) {
                (Some(o), Some(n)) => Some(if n.total < o.total { n } else { o.clone() }),
                (o, n) => n.or_else(|| o.clone()),
            }
        })?;
        made = fresh;
        // What the cells found is better than the samples were: faces without what curls at their edges.
        candidates = made
            .iter()
            .enumerate()
            .flat_map(|(site, f)| {
                f.iter().flat_map(move |f| {
                    f.sheets.iter().map(move |s| Candidate { quadric: s.0, at: s.1, error: s.2, owner: site as u32 })
                })
            })
            .collect();
    }
    candidates.extend(samples.iter().zip(of_site).map(candidate));
    narrow(&mut places, &mut made, samples, tree, &candidates, observer)?;
    let home =
        made.iter().zip(&places).filter_map(|(f, p)| Some((f.as_ref().filter(|f| f.at_home(p))?.cell(p), p.noise)));
    let (cells, noise): (Vec<Cell>, Vec<f64>) = home.unzip();
    Ok(outvoted(cells, &noise))
}

/// Asks fewer points where sheets face cells on both sides: a wider ball of a stack of fins holds more sheets than a cell
/// nests. What explains its points better is taken.
fn narrow(
    places: &mut [Place],
    made: &mut [Option<Found>],
    samples: &[Sample],
    tree: &KdTree,
    candidates: &[Candidate],
    observer: &dyn Observer,
) -> Result<(), Cancelled> {
    let faced = KdTree::new(&samples.iter().map(|s| s.center).collect::<Vec<_>>());
    let clear = |(place, found): (&Place, &Option<Found>)| {
        found.as_ref().and_then(|f| clearance(place, f, samples, &faced)).map(|clear| (place.center, clear))
    };
    let (hemmed, clear): (Vec<DVec3>, Vec<f64>) =
        places.par_iter().zip(&*made).filter_map(clear).collect::<Vec<_>>().into_iter().unzip();
    let hemmed = KdTree::new(&hemmed);
    let around = KdTree::new(&candidates.iter().map(|c| c.at).collect::<Vec<_>>());
    let known = Known { tree, candidates, around: &around };
    let fresh = in_pieces(places.len(), (1.0, 1.0), observer, |s, site| {
        let place = &places[site];
        let old = made[site].as_ref().filter(|f| f.cost > UNEXPLAINED)?;
        // Rims and roots of fins are faced on one side or none.
        let mut nearest = f64::INFINITY;
        hemmed.within(place.center, HEARD * place.support, |i, _, _| nearest = nearest.min(clear[i as usize]));
        let support = (nearest / HEARD).max(COVERED_GAPS * place.apart);
        let place = Place { support, ..*place };
        let new =
            if support < places[site].support { known.find(&place, site as u32, false, &mut s.around) } else { None };
        new.filter(|n| n.cost < old.cost).map(|n| (place, n))
    })?;
    for (site, (place, found)) in fresh.into_iter().enumerate().filter_map(|(site, f)| Some((site, f?))) {
        places[site] = place;
        made[site] = Some(found);
    }
    Ok(())
}

/// How far the nearer of two sheets is that face a cell, one from its inside and one from its outside; `None` without
/// both.
fn clearance(place: &Place, found: &Found, samples: &[Sample], tree: &KdTree) -> Option<f64> {
    let (own, d) = joined(&found.sheets, found.concave, place.center);
    let n = found.sheets[own].0.distance(place.center).1;
    let foot = place.center - d * n;
    let mut nearest = [f64::INFINITY; 2];
    tree.within(foot, HEARD * place.support, |i, c, _| {
        let high = n.dot(c - foot);
        if samples[i as usize].normal.dot(n) < -SIDE_BY_SIDE && high.abs() > RESIDUAL_LIMIT * place.noise {
            let side = &mut nearest[usize::from(high > 0.0)];
            *side = side.min(high.abs());
        }
    });
    let [inside, outside] = nearest;
    inside.max(outside).is_finite().then_some(inside.min(outside))
}

/// How far beside a cell its neighbours are asked, in noise levels, and how sure they must be of the other side.
const VOTE_REACH_NOISE: f64 = 3.0;
const VOTE_MARGIN_NOISE: f64 = 1.0;
/// What is left of the trust of a cell that they contradict, and rounds.
const OUTVOTED: f64 = 1e-3;
const VOTES: usize = 3;

/// The cells, those with hardly a say whose neighbours see another side right beside them.
///
/// Where two sheets are closer than the noise, as at the tip of a wedge, a single one explains the points, and faces
/// either way; the cells around that know both sheets tell that there is no inside behind it.
fn outvoted(cells: Vec<Cell>, noise: &[f64]) -> Vec<Cell> {
    let mut now = cells.clone();
    for _ in 0..VOTES {
        let voters: Vec<Cell> = now.iter().filter(|c| c.count > 1).copied().collect();
        let blend = Blend::new(&voters);
        now = (0..cells.len())
            .into_par_iter()
            .map(|i| {
                let mut cell = cells[i];
                let (d, n) = cell.evaluate(cell.center);
                let foot = cell.center - d * n;
                let contradicted = [-VOTE_REACH_NOISE, VOTE_REACH_NOISE].into_iter().any(|side| {
                    let p = foot + side * noise[i] * n;
                    let own = cell.evaluate(p).0;
                    let weight = if cell.count > 1 { now[i].weight(p) } else { 0.0 };
                    blend.at(p).is_some_and(|all| {
                        let others = (all.mean * all.weight - own * weight) / (all.weight - weight);
                        others * own < 0.0 && others.abs() > VOTE_MARGIN_NOISE * noise[i]
                    })
                });
                cell.trust *= if contradicted { OUTVOTED } else { 1.0 };
                cell
            })
            .collect();
    }
    now
}

/// Where a cell is.
pub(crate) struct Place {
    pub center: DVec3,
    pub support: f64,
    pub noise: f64,
    /// Distance of sites.
    pub apart: f64,
}

/// A sheet of a cell: quadric, middle of its points and expected error.
pub(crate) type Sheet = (Quadric, DVec3, f64);

/// A sheet that a cell may take.
struct Candidate {
    quadric: Quadric,
    at: DVec3,
    error: f64,
    owner: u32,
}

impl Candidate {
    fn sheet(&self) -> Sheet {
        (self.quadric, self.at, self.error)
    }
}

/// What a cell takes.
#[derive(Clone)]
struct Found {
    sheets: Vec<Sheet>,
    concave: u8,
    /// Cost and prices.
    total: f64,
    /// What its points cost on the average, in squared noise levels.
    cost: f64,
}

impl Found {
    /// Is the surface where the points of the site are? Those of a stray are not.
    fn at_home(&self, place: &Place) -> bool {
        let off = joined(&self.sheets, self.concave, place.center).1.abs();
        off < (RESIDUAL_LIMIT * place.noise).max(MIDDLE_OFF_SUPPORTS * place.support)
    }

    fn cell(&self, place: &Place) -> Cell {
        let support = BLENDED * place.support;
        let mut sheets = [self.sheets[0].0; MOST_SHEETS];
        sheets.iter_mut().zip(&self.sheets).for_each(|(s, f)| *s = f.0.sharpened(f.1, place.noise));
        let error = self.sheets.iter().map(|s| s.2 * s.2).sum::<f64>() / self.sheets.len() as f64;
        // What the points show beyond noise is bias of the cell.
        let bias = BIAS * (self.cost - 1.0).max(0.0) * place.noise * place.noise;
        let trust = support * support / (error + bias).max(1e-12 * support * support);
        Cell {
            center: place.center,
            support,
            trust: trust.min(1e12),
            sheets,
            count: self.sheets.len() as u8,
            concave: self.concave,
        }
    }
}

/// What cells are found from.
#[derive(Clone, Copy)]
struct Known<'a> {
    /// Tree of the points.
    tree: &'a KdTree,
    /// Sheets that a cell may take.
    candidates: &'a [Candidate],
    /// Tree of these.
    around: &'a KdTree,
}

impl Known<'_> {
    /// The sheets of a cell at `place`.
    /// * `again` - true if the candidates are what the cells have found before
    fn find(&self, place: &Place, site: u32, again: bool, scratch: &mut Vec<DVec3>) -> Option<Found> {
        let Known { tree, candidates, around } = *self;
        let &Place { center, support, noise, .. } = place;
        let ball = around_place(center, HEARD * support, MOST_CELL_POINTS, tree, scratch);
        let count = ball.len().max(1) as f64;
        let residuals = |q: &Quadric| ball.levels(q, noise);
        // Candidates, those of the site first, then by distance.
        let mut near: Vec<(f64, u32)> = Vec::with_capacity(4 * MOST_CANDIDATES);
        around.within(center, CANDIDATE_SUPPORTS * support, |i, _, d2| {
            near.push((if candidates[i as usize].owner == site { 0.0 } else { d2 }, i));
        });
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        if let Some(first) = near.first()
            && near.get(1).is_none_or(|n| n.0 > 0.0)
        {
            let c = &candidates[first.1 as usize];
            let total = cost(&residuals(&c.quadric));
            if c.owner == site && total < ONE_SHEET_COST * count + count.sqrt() {
                let sheets = vec![(c.quadric, c.at, c.error)];
                return Some(Found { sheets, concave: 0, total, cost: total / count });
            }
        }
        let (asked, seen) = different(candidates, &near, place);
        if asked.is_empty() {
            return None;
        }
        let all: Vec<Seen> = asked
            .iter()
            .zip(&seen)
            .map(|(c, s)| {
                let price = SHEET_PRICE + VARIATION_PRICE * c.quadric.variation(c.at, HEARD * support);
                Seen { residuals: residuals(&c.quadric), normal: s.1, price }
            })
            .collect();
        let found = nest(&all, false, MOST_SHEETS)?;
        let mut nested = Nested {
            sheets: found.order.iter().map(|&k| asked[k].sheet()).collect(),
            prices: found.order.iter().map(|&k| all[k].price).collect(),
            concave: found.concave,
            cost: found.cost,
        };
        // What the site has found before is refined already.
        let known = again && found.order.iter().all(|&k| asked[k].owner == site);
        if nested.sheets.len() > 1 && !known {
            let wide = around_place(center, WIDEST_BALL * HEARD * support, MOST_BALL_POINTS, tree, scratch);
            nested.refine(place, HEARD * support, &ball, wide);
        }
        let Nested { mut sheets, prices, mut concave, cost: mut spent } = nested;
        // A plate ends where its points do: no sheet says so, if it is as thin as the noise.
        let found = sheets.len();
        while found > 1 && sheets.len() < MOST_SHEETS {
            let bare: Vec<Quadric> = sheets.iter().map(|s| s.0).collect();
            let Some(end) = rim(&bare, concave, center, HEARD * support, &ball, noise) else { break };
            concave |= u8::from(end.groove) << sheets.len();
            let normal = if end.groove { -end.normal } else { end.normal };
            sheets.push((Quadric::plane(end.at, support, normal), end.at, sheets[0].2));
        }
        let mut total = spent + prices.iter().sum::<f64>();
        if spent > UNEXPLAINED * count
            && let Some(found) = stepped(&asked, &all, place, &ball, total)
        {
            (sheets, concave, spent, total) = found;
        }
        Some(Found { sheets, concave, total, cost: spent / count })
    }
}

/// The candidates that a cell tries, the nearest of every other sheet first, then what differs from these; and of each the signed
/// distance and the normal at the middle of the cell.
/// * `near` - indices of candidates, the nearest first
fn different<'a>(
    candidates: &'a [Candidate],
    near: &[(f64, u32)],
    place: &Place,
) -> (Vec<&'a Candidate>, Vec<(f64, DVec3)>) {
    let mut asked: Vec<&Candidate> = Vec::new();
    let mut seen: Vec<(f64, DVec3)> = Vec::new();
    let passes = |&(_, i): &(f64, u32)| {
        let c = &candidates[i as usize];
        let (d, n) = c.quadric.distance(place.center);
        (d.abs() < place.support).then_some((c, d, n))
    };
    let passing: Vec<(&Candidate, f64, DVec3)> = near.iter().filter_map(passes).collect();
    for (turn, level) in [OTHER_SHEET, OTHER_FIT] {
        for &(c, d, n) in &passing {
            let known = seen.iter().any(|(e, m)| n.dot(*m) > turn && (d - e).abs() < level * place.noise);
            if !known {
                asked.push(c);
                seen.push((d, n));
                if asked.len() == MOST_CANDIDATES {
                    return (asked, seen);
                }
            }
        }
    }
    (asked, seen)
}

/// A step that explains the points for less than `most`, prices included: its sheets, how they are joined, cost, and cost with
/// prices.
fn stepped(
    asked: &[&Candidate],
    seen: &[Seen],
    place: &Place,
    ball: &Points,
    most: f64,
) -> Option<(Vec<Sheet>, u8, f64, f64)> {
    let squares: Vec<Vec<f64>> = seen.iter().map(|s| capped(&s.residuals)).collect();
    let (mut best, mut least) = (None, most);
    for (i, j) in (1..asked.len()).flat_map(|j| (0..j).map(move |i| (i, j))) {
        if !is_alike([i, j].map(|k| seen[k].normal)) {
            continue;
        }
        let price = seen[i].price + seen[j].price + SHEET_PRICE;
        // Hardly a point is explained by the wall alone.
        if nearest_cost(&[&squares[i], &squares[j]], least - price) + price >= least {
            continue;
        }
        let pair = [i, j].map(|k| (&asked[k].quadric, &seen[k]));
        let Some(step) = step(pair, ball, place.center, HEARD * place.support, place.noise) else { continue };
        let [higher, lower] = if step.higher == 0 { [i, j] } else { [j, i] }.map(|k| asked[k].sheet());
        let wall = (Quadric::plane(step.at, place.support, step.normal), step.at, higher.2.max(lower.2));
        let sheets = vec![higher, wall, lower];
        let cost = explained(&sheets, WALLED, place, ball);
        if cost + price < least {
            least = cost + price;
            best = Some((sheets, WALLED, cost, least));
        }
    }
    best
}

/// The sheet that decides at a point and its signed distance.
fn joined(sheets: &[Sheet], concave: u8, p: DVec3) -> (usize, f64) {
    nest::joined(sheets.iter().map(|s| s.0.distance(p).0), concave)
}

/// The points of a ball, or every so many of them: at most `enough`.
fn around_place(center: DVec3, radius: f64, enough: usize, tree: &KdTree, near: &mut Vec<DVec3>) -> Points {
    near.clear();
    tree.within(center, radius, |_, q, _| near.push(q));
    let step = near.len().div_ceil(enough).max(1);
    Points::every(near, step)
}
