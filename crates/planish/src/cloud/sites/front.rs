//! The prioritised front: regular places first, each class leaning on what is fitted already.
//!
//! [X03] §5, fig. 7; `docs/methods/samples.md`, section 4.
//! 1. irregularity of every site from its survey, classes by quantiles
//! 2. class by class, in rounds: a site takes its own fit or, where they explain its points better, the sheets of
//!    fitted neighbours carried on to here (these also have a say inside the fits: `guides`)
//! 3. every sheet grows: the ball widens by steps, points that do not belong to the sheet lose their weight, and the
//!    widest ball stays in which the points that do belong show noise and no bias
//!
//! Departs from [X03]: classes are fixed by the survey, so no point goes back to a later class (fig. 7, lines 7 to
//! 10), and the front does not grow from neighbour to neighbour: a class is worked off in one round, whose sites see
//! only what was fitted before it. So they are fitted in parallel, and the result is the same on any number of
//! threads. Where nothing fitted is near, a site stands on its own fit, which is the seed of [X03] (lines 14 to 16).
//! Supports follow from the data and not from factors c_i (§6.1).

use super::survey::{PLENTY_OF_POINTS, WIDEST_NOISE};
use super::{SITE_DISTANCE, Sites, in_pieces, layers, rounding};
use crate::cloud::Quadric;
use crate::cloud::local::fit::{Ball, Sheet, localized, sheet};
use crate::cloud::local::fitted::{Fit, GUIDE_ERROR_NOISE};
use crate::cloud::local::guides::guides;
use crate::cloud::local::height::Frame;
use crate::cloud::local::joints::RESIDUAL_LIMIT;
use crate::cloud::local::nest::{Seen, cost, nest};
use crate::cloud::local::points::Points;
use crate::geom::KdTree;
use crate::geom::tolerance::divisor;
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;

/// Quantiles of irregularity that part the classes.
const CLASSES: [f64; 5] = [0.4, 0.6, 0.75, 0.85, 0.94];
/// Weight of the variation of the gradient in the irregularity (a_1 of [X03]).
const VARIATION: f64 = 0.25;
/// Weight of noise over radius (a_2).
const ROUGHNESS: f64 = 1.0;
/// What a carried-on sheet must explain, in squared noise levels: the freedom of its choice.
pub(crate) const SHEET_PRICE: f64 = 14.0;
/// And for every change of its direction by one within the ball: what is flat is likelier than what is round.
pub(crate) const VARIATION_PRICE: f64 = 10.0;
/// Most sheets at one site whose signs are not known yet.
const MOST_SITE_SHEETS: usize = 2;
/// What a fit of its own must explain: six parameters, each worth two.
const OWN_PRICE: f64 = 12.0;
/// A fit of its own is not questioned if its points cost at most this much each, in squared noise levels.
const UNQUESTIONED_COST: f64 = 1.05;
/// Sheets explain points that cost at most this much each, in squared noise levels, and what chance adds.
const EXPLAINED_COST: f64 = 1.15;
/// The points of a crease are looked at this many times as far as one sheet holds, at most.
const CREASE_REACH: f64 = 2.0;
/// Cosine of 20 degrees: sheets that meet flatter are one, with a bend.
const CREASE_COSINE: f64 = 0.94;
/// Points that must be nearest to a sheet.
const FEWEST_NEAREST: u32 = 3;
/// Fits near a point that are asked which of them explains it.
const RIVAL_FITS: usize = 10;
/// Neighbours asked whether they carry a sheet on, how many must, and how far off they may be over their distance.
const COMPANY_ASKED: usize = 16;
const COMPANY_NEEDED: usize = 4;
const COMPANY_OFFSET: f64 = 0.12;
/// Sheets of fitted neighbours that are asked.
const MOST_CARRIED: usize = 16;
/// Fitted neighbours are sought within this many radii.
const CARRIED_REACH: f64 = 3.0;
/// A carried-on sheet begins with the ball that it has, at most this many times that of the site.
const CARRIED_BALL: f64 = 3.0;
/// Points of less weight are left out.
const LEAST_POINT_WEIGHT: f64 = 1e-3;
/// Density of points that belong to no sheet, as that of a sheet three noise levels away.
const STRAY: f64 = 0.011;
/// Ratio of one ball to the next when a sheet grows, and how often it grows at most.
const GROWTH_RATIO: f64 = 1.35;
const GROWTH_STEPS: usize = 3;

/// Fits sites, leaning on what is fitted already, and adds what it found.
/// * `open` - the sites, ascending
pub(crate) fn grow(
    tree: &KdTree,
    sites: &Sites,
    open: &[u32],
    mut closed: Vec<Fit>,
    observer: &dyn Observer,
) -> Result<Vec<Fit>, Cancelled> {
    let irregularity: Vec<f64> = sites
        .survey
        .iter()
        .map(|s| {
            let v = s.quadric.variation(s.quadric.center, s.radius);
            VARIATION * v + ROUGHNESS * s.noise / s.radius
        })
        .collect();
    let mut ranks: Vec<u32> = (0..irregularity.len() as u32).collect();
    ranks.sort_by(|&a, &b| irregularity[a as usize].total_cmp(&irregularity[b as usize]).then(a.cmp(&b)));
    let ends = CLASSES.map(|q| (q * ranks.len() as f64).round() as usize);
    let mut class = vec![0; ranks.len()];
    for (rank, &site) in ranks.iter().enumerate() {
        class[site as usize] = ends.iter().filter(|&&end| end <= rank).count() as u8;
    }
    let mut done = 0;
    for now in 0..=CLASSES.len() as u8 {
        let fresh: Vec<u32> = open.iter().copied().filter(|&site| class[site as usize] == now).collect();
        let span = [done, done + fresh.len()].map(|x| x as f64 / open.len().max(1) as f64);
        done += fresh.len();
        let closed_tree = KdTree::new(&closed.iter().map(|f| f.center).collect::<Vec<_>>());
        let known = Known { points: tree, fits: &closed, closed: &closed_tree };
        let fitted = in_pieces(fresh.len(), (span[0], span[1]), observer, |s, k| {
            let site = fresh[k] as usize;
            fit_site(known, sites, site, irregularity[site], now, &mut s.around)
        })?;
        closed.extend(fitted.into_iter().flatten());
    }
    Ok(closed)
}

/// What sites are fitted from: the points, and what is fitted already.
#[derive(Clone, Copy)]
struct Known<'a> {
    /// Tree of the points.
    points: &'a KdTree,
    fits: &'a [Fit],
    /// Tree of the fits.
    closed: &'a KdTree,
}

/// The other sheet of the site of a fit, if it has one: both stand side by side.
pub(crate) fn other_sheet(fits: &[Fit], i: usize) -> Option<usize> {
    [i.wrapping_sub(1), i + 1].into_iter().find(|&j| fits.get(j).is_some_and(|g| g.site == fits[i].site))
}

/// All but sheets that hardly any point is nearest to, or no neighbour carries on, each with the points that it owns.
pub(crate) fn supported(points: &[DVec3], mut fits: Vec<Fit>) -> Vec<Fit> {
    let mut owner = vec![u32::MAX; points.len()];
    own(points, &mut fits, &mut owner);
    keep(upheld(&fits), &mut fits, &mut owner);
    keep(accompanied(&fits), &mut fits, &mut owner);
    // The points of those that are dropped are still there: without them a surface has less area beside its edges.
    own(points, &mut fits, &mut owner);
    // A sheet whose other one is dropped is no side of a plate.
    for i in 0..fits.len() {
        if other_sheet(&fits, i).is_none() {
            fits[i].gap = f64::INFINITY;
        }
    }
    fits
}

/// Drops all fits but these; their points have none then.
fn keep(kept: Vec<usize>, fits: &mut Vec<Fit>, owner: &mut [u32]) {
    let mut place = vec![u32::MAX; fits.len()];
    kept.iter().enumerate().for_each(|(k, &i)| place[i] = k as u32);
    owner.iter_mut().filter(|o| **o != u32::MAX).for_each(|o| *o = place[*o as usize]);
    *fits = kept.into_iter().map(|i| fits[i]).collect();
}

/// Gives every point that has none the fit that explains it best.
fn own(points: &[DVec3], fits: &mut [Fit], owner: &mut [u32]) {
    let tree = KdTree::new(&fits.iter().map(|f| f.center).collect::<Vec<_>>());
    let all: &[Fit] = fits;
    let homeless = points.par_iter().zip(&mut *owner).filter(|o| *o.1 == u32::MAX);
    homeless.for_each_init(Default::default, |(near, last), (&p, own)| {
        tree.nearest_after(p, RIVAL_FITS, last, near);
        let off = |n: &(f64, u32)| {
            let f = &all[n.1 as usize];
            (f.quadric.distance(p).0 / divisor(f.noise)).powi(2) + 9.0 * n.0 / (f.radius * f.radius)
        };
        let best = near.iter().map(|n| (off(n), n.1)).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        *own = best.map_or(u32::MAX, |b| b.1);
    });
    fits.iter_mut().for_each(|f| f.owned = 0);
    owner.iter().filter(|&&o| o != u32::MAX).for_each(|&o| fits[o as usize].owned += 1);
}

/// The fits that enough points are nearest to.
///
/// Where sites stand as densely as points, a fit has one or two by chance. Then its sheet tells: the fit and those that carry it
/// on must have as many points together as the poorest sheet of others, and the fit half of their mean.
fn upheld(fits: &[Fit]) -> Vec<usize> {
    let poor: Vec<usize> = (0..fits.len()).filter(|&i| (1..FEWEST_NEAREST).contains(&fits[i].owned)).collect();
    let is_upheld = around(fits, &poor, |i, near| {
        let sheet = near.iter().filter(|&&j| carries_on(&fits[i], &fits[j])).chain([&i]);
        let (points, count) = sheet.fold((0, 0), |(points, count), &j| (points + fits[j].owned, count + 1));
        points >= FEWEST_NEAREST * (COMPANY_NEEDED as u32 + 1) && 2 * fits[i].owned * count >= points
    });
    let mut kept: Vec<usize> = (0..fits.len()).filter(|&i| fits[i].owned >= FEWEST_NEAREST).collect();
    kept.extend(poor.into_iter().zip(is_upheld).filter_map(|(i, upheld)| upheld.then_some(i)));
    kept.sort_unstable();
    kept
}

/// All but sheets that hardly any neighbour carries on: a fit across a crease stands alone, a face does not.
fn accompanied(fits: &[Fit]) -> Vec<usize> {
    let all: Vec<usize> = (0..fits.len()).collect();
    let company = around(fits, &all, |i, near| near.iter().filter(|&&j| carries_on(&fits[i], &fits[j])).count());
    all.into_iter().filter(|&i| company[i] >= COMPANY_NEEDED).collect()
}

/// What those nearest to it tell of each of `some` fits.
fn around<T: Send>(fits: &[Fit], some: &[usize], tell: impl Fn(usize, &[usize]) -> T + Sync) -> Vec<T> {
    let tree = KdTree::new(&fits.iter().map(|f| f.center).collect::<Vec<_>>());
    let one = |(near, others): &mut (Vec<_>, Vec<usize>), &i: &usize| {
        tree.nearest(fits[i].center, COMPANY_ASKED + 1, near);
        others.clear();
        others.extend(near.iter().map(|n| n.1 as usize).filter(|&j| j != i));
        tell(i, others)
    };
    some.par_iter().map_init(Default::default, one).collect()
}

/// Is one fit the other's sheet, a little aside?
fn carries_on(f: &Fit, g: &Fit) -> bool {
    let ((d, m), (e, k)) = (f.quadric.distance(g.center), g.quadric.distance(f.center));
    let slack = COMPANY_OFFSET * f.center.distance(g.center) + 2.0 * (f.error + g.error);
    m.dot(g.normal).abs() > CREASE_COSINE && k.dot(f.normal).abs() > CREASE_COSINE && d.abs() < slack && e.abs() < slack
}

fn fit_site(known: Known, sites: &Sites, site: usize, irregularity: f64, class: u8, near: &mut Vec<DVec3>) -> Vec<Fit> {
    let survey = &sites.survey[site];
    let p = survey.quadric.center;
    let noise = divisor(sites.noise(site));
    let starts = if let Some(layer) = survey.layer {
        [survey.quadric, layer].map(|sheet| Start { sheet, at: sheet.project(p).0, radius: survey.radius }).to_vec()
    } else if class == 0 {
        vec![Start { sheet: survey.quadric, at: p, radius: survey.radius }]
    } else {
        choose(known, survey.radius, sites.gap[site] / SITE_DISTANCE, survey.quadric, noise, near)
    };
    let sheets = starts.len() as u8;
    let all: Vec<Quadric> = starts.iter().map(|s| s.sheet).collect();
    let mut fits: Vec<Fit> = starts
        .into_iter()
        .enumerate()
        .filter_map(|(k, start)| {
            let others: Vec<Quadric> = (0..all.len()).filter(|&i| i != k).map(|i| all[i]).collect();
            let (s, radius, error) = widen(known, &start, &others, noise, near)?;
            let (center, normal) = s.quadric.project(start.at);
            Some(Fit {
                quadric: s.quadric.normalized_at(center),
                center,
                normal,
                radius,
                noise: s.rms.max(survey.hidden),
                thickness: (s.rms.max(survey.hidden) / divisor(sites.prior[site].noise)).max(1.0),
                error,
                irregularity,
                class,
                site: site as u32,
                sheets,
                gap: f64::INFINITY,
                owned: 0,
            })
        })
        .collect();
    if let [f, g] = &mut fits[..] {
        // The two are a plate or a gap if they still are side by side: each sees the other on the side that it is seen on.
        let ((d, n), (e, m)) = (f.quadric.distance(g.center), g.quadric.distance(f.center));
        let turns = [n.dot(g.normal), m.dot(f.normal)];
        let alike = turns.iter().all(|t| t.abs() > SIDE_BY_SIDE && d * e * t < 0.0);
        let one = rounding::is_one(&sites.prior[site].steps, f.normal, d.abs().min(e.abs()));
        if alike && !one && d.abs().min(e.abs()) > layers::LEAST_LAYER_GAP * noise {
            (f.gap, g.gap) = (d.abs(), e.abs());
        }
    }
    fits
}

/// Sheets side by side turn by less than this cosine (30 degrees) from each other: the flanks of a wedge do so, too.
pub(crate) const SIDE_BY_SIDE: f64 = 0.866;

/// Middles of the points of two sheets are at most this far from each other along them, as a share of the ball, where the
/// sheets lie above each other. Side by side, halves of a disk have .85.
const MIXED: f64 = 0.4;

/// The sheets that explain the points around a site, each with the middle of the points that are nearest to it there.
fn choose(known: Known, radius: f64, usual: f64, own: Quadric, noise: f64, around: &mut Vec<DVec3>) -> Vec<Start> {
    let p = own.center;
    let alone = vec![Start { sheet: own, at: p, radius }];
    // A crease has a narrow ball because one sheet is no model there; with the right sheets a usual ball will do.
    let wide = usual.clamp(radius, CREASE_REACH * radius);
    around.clear();
    known.points.within(p, wide, |_, q, _| around.push(q));
    let mut ball = Points::default();
    ball.refill(around);
    let residuals = |q: &Quadric| ball.levels(q, noise);
    let count = ball.len() as f64;
    let good = count * (EXPLAINED_COST + 2.0 * (2.0 / count).sqrt());
    let own_cost = cost(&residuals(&own));
    if own_cost < UNQUESTIONED_COST * count {
        return alone;
    }
    let mut near = Vec::with_capacity(4 * MOST_CARRIED);
    known.closed.within(p, CARRIED_REACH * wide, |i, _, d2| near.push((d2, i)));
    near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut asked: Vec<(Quadric, f64)> = Vec::new();
    for &(_, i) in &near {
        let f = &known.fits[i as usize];
        if f.error > GUIDE_ERROR_NOISE * noise {
            continue;
        }
        let (d, n) = f.quadric.distance(p);
        // Two that say the same here are one: same offset within the noise, same direction within 8 degrees.
        let is_asked = asked.iter().any(|a| {
            let (e, m) = a.0.distance(p);
            let turn = n.dot(m);
            turn.abs() > 0.99 && (d - e * turn.signum()).abs() < 0.7 * noise
        });
        if !is_asked && d.abs() < wide {
            asked.push((f.quadric, f.radius));
            if asked.len() == MOST_CARRIED {
                break;
            }
        }
    }
    let all: Vec<Seen> = asked
        .iter()
        .map(|a| Seen { residuals: residuals(&a.0), normal: a.0.distance(p).1, price: SHEET_PRICE })
        .collect();
    let Some(found) = nest(&all, true, MOST_SITE_SHEETS) else { return alone };
    // The points nearest to each sheet tell where it begins to grow.
    let mut middle = vec![(0usize, DVec3::ZERO); found.order.len()];
    for (i, q) in ball.iter().enumerate() {
        let (d, k) = (0..found.order.len())
            .map(|k| (all[found.order[k]].residuals[i].abs(), k))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .expect("a nesting has a sheet");
        if d < RESIDUAL_LIMIT {
            middle[k].0 += 1;
            middle[k].1 += q;
        }
    }
    middle.iter_mut().filter(|m| m.0 > 0).for_each(|m| m.1 /= m.0 as f64);
    // Points of two sheets that lie above each other are a fold, which is no misfit. Next to each other they are a step.
    let fold = match found.order[..] {
        [a, _] => (middle[0].1 - middle[1].1).reject_from(all[a].normal).length() < MIXED * wide,
        _ => false,
    };
    let misfit = found.cost - if fold { found.folds } else { 0.0 };
    if misfit > good || found.cost + SHEET_PRICE * (found.order.len() - 1) as f64 > own_cost + OWN_PRICE {
        return alone;
    }
    found
        .order
        .iter()
        .zip(&middle)
        .filter(|(_, m)| m.0 > 0)
        .map(|(&k, m)| Start { sheet: asked[k].0, at: m.1, radius: asked[k].1.min(CARRIED_BALL * radius).max(radius) })
        .collect()
}

/// Where a sheet begins to grow.
#[derive(Clone, Copy)]
struct Start {
    sheet: Quadric,
    at: DVec3,
    radius: f64,
}

/// Fits a sheet from a first guess and widens its ball while its own points show no bias: sheet, radius, expected error.
fn widen(
    known: Known,
    start: &Start,
    others: &[Quadric],
    noise: f64,
    near: &mut Vec<DVec3>,
) -> Option<(Sheet, f64, f64)> {
    let p = start.at;
    let mut best: Option<(Sheet, f64, f64)> = None;
    let mut guess = start.sheet;
    let (mut ball, mut weights) = (Points::default(), Vec::new());
    let (mut own, mut other, mut all) = (Vec::new(), Vec::new(), Vec::new());
    for step in 0..=GROWTH_STEPS {
        let r = start.radius * GROWTH_RATIO.powi(step as i32);
        // The second ball is asked in nearly every case, and it holds the first.
        if step != 1 {
            near.clear();
            let reach = if step == 0 { start.radius * GROWTH_RATIO } else { r };
            known.points.within(p, reach, |_, q, _| near.push(q));
        }
        if step == 0 {
            ball.clear();
            near.iter().filter(|q| q.distance_squared(p) <= r * r).for_each(|&q| ball.push(q));
        } else {
            ball.refill(near);
        }
        // Along the sheet alone: at the rim of a ball the noise would say which points of a bent sheet are in it.
        ball.localize(p, r, guess.distance(p).1, &mut weights);
        if !others.is_empty() {
            // The chance that each point belongs to this sheet and to none of the others.
            let sigma = noise / r;
            let chance = |s: &Quadric, out: &mut Vec<f64>| {
                ball.distances(&localized(s, p, r), out);
                out.iter_mut().for_each(|d| *d = (-0.5 * (*d / sigma).powi(2)).exp());
            };
            chance(&guess, &mut own);
            all.clear();
            all.resize(ball.len(), STRAY);
            for s in others {
                chance(s, &mut other);
                all.iter_mut().zip(&other).for_each(|(a, c)| *a += c);
            }
            all.iter_mut().zip(&own).for_each(|(a, c)| *a += c);
            weights.iter_mut().zip(own.iter().zip(&all)).for_each(|(w, (own, all))| *w *= own / all);
        }
        ball.keep_above(LEAST_POINT_WEIGHT, &mut weights);
        // Enough points: more of them cost more than they tell.
        if step > 0 && ball.len() > PLENTY_OF_POINTS && r > WIDEST_NOISE * noise {
            break;
        }
        let guides = guides(known.fits, known.closed, p, r, noise);
        let part = Ball { center: p, scale: r, points: &ball, weights: &weights, guides: &guides, noise: noise / r };
        let Some(found) = sheet(&part, &guess, if step == 0 { 2 } else { 1 }) else {
            if best.is_none() && step < GROWTH_STEPS {
                continue;
            }
            break;
        };
        let error = expected(&found, p, r, &ball, noise);
        if best.as_ref().is_some_and(|b| error >= b.2) {
            break;
        }
        guess = found.quadric;
        best = Some((found, r, error));
    }
    best
}

/// Expected error of a sheet at its centre: its parameters and the bias that the averages of the sectors of its own
/// points show.
fn expected(s: &Sheet, p: DVec3, radius: f64, ball: &Points, noise: f64) -> f64 {
    let q = localized(&s.quadric, p, radius);
    let sigma = noise / radius;
    let frame = Frame::of(q.value(DVec3::ZERO).1.normalize_or(DVec3::Z));
    let mut sums = [(0.0, 0.0); 16];
    let mut count = 0.0;
    let mut distances = Vec::new();
    ball.distances(&q, &mut distances);
    for (y, d) in ball.iter().zip(&distances) {
        let r = d / sigma;
        if r.abs() < RESIDUAL_LIMIT {
            let (u, v) = (frame.u.dot(y), frame.v.dot(y));
            let mut at = usize::from(u > 0.0) | usize::from(v > 0.0) << 1 | usize::from(u.abs() > v.abs()) << 2;
            if ball.len() >= 80 && u * u + v * v > 0.5 {
                at |= 8;
            }
            sums[at].0 += 1.0;
            sums[at].1 += r;
            count += 1.0;
        }
    }
    let parts = sums.iter().filter(|s| s.0 > 0.0).count() as f64;
    let between: f64 = sums.iter().filter(|s| s.0 > 0.0).map(|s| s.1 * s.1 / s.0).sum();
    let freedom = (parts - if ball.len() >= 80 { 5.0 } else { 4.0 }).max(1.0);
    let excess = (between - freedom).max(0.0);
    noise * ((s.parameters + excess) / f64::max(count, 1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{KdTree, sites};
    use crate::geom::random;
    use crate::observe::Silent;

    #[test]
    fn fits_of_a_box_with_noise_own_all_of_its_points_and_have_its_area_within_3_percent() {
        let noise = 0.004;
        let place = |i: u64| {
            let of = |k: u64| random::unit(11, 9 * i + k);
            let mut p = DVec3::new(of(0), of(1), of(2));
            p[i as usize % 3] = (i / 3 % 2) as f64;
            let gauss = |k: u64| random::normal(of(k), of(k + 1));
            p + noise * DVec3::new(gauss(3), gauss(5), gauss(7))
        };
        let points: Vec<DVec3> = (0..30_000).map(place).collect();
        let tree = KdTree::new(&points);
        let points: Vec<DVec3> = tree.order().iter().map(|&i| points[i as usize]).collect();
        let tree = KdTree::new(&points);
        let sites = sites::choose(&points, &tree, &Silent).unwrap();
        let open: Vec<u32> = (0..sites.point.len() as u32).collect();
        let fits = supported(&points, grow(&tree, &sites, &open, Vec::new(), &Silent).unwrap());
        assert_eq!(fits.iter().map(|f| f.owned as usize).sum::<usize>(), points.len());
        let area: f64 = fits.iter().map(|f| f64::from(f.owned) * sites.survey[f.site as usize].spacing.powi(2)).sum();
        assert!((area / 6.0 - 1.0).abs() < 0.03, "{area}");
    }

    /// How many of two fitted planes 3.5 noise levels apart are chosen for points of which the i-th, at x, is on `side(i, x)`.
    fn chosen(side: impl Fn(u64, f64) -> usize) -> usize {
        let noise = 0.01;
        let plane = |center: DVec3| Fit {
            quadric: Quadric::plane(center, 1.0, DVec3::Z),
            center,
            normal: DVec3::Z,
            radius: 10.0 * noise,
            noise,
            thickness: 1.0,
            error: 0.1 * noise,
            irregularity: 0.0,
            class: 0,
            site: 0,
            sheets: 1,
            gap: f64::INFINITY,
            owned: 10,
        };
        let sides = [1.75 * noise, -1.75 * noise];
        let fits = sides.map(|z| plane(DVec3::new(0.1, 0.0, z)));
        let place = |i: u64| {
            let of = |k: u64| 2.0 * random::unit(13, 4 * i + k) - 1.0;
            let gauss = random::normal(random::unit(13, 4 * i + 2), random::unit(13, 4 * i + 3));
            let x = 0.2 * of(0);
            DVec3::new(x, 0.2 * of(1), sides[side(i, x)] + noise * gauss)
        };
        let points: Vec<DVec3> = (0..2000).map(place).collect();
        let closed = KdTree::new(&fits.map(|f| f.center));
        let points = KdTree::new(&points);
        let known = Known { points: &points, fits: &fits, closed: &closed };
        let own = Quadric::plane(DVec3::ZERO, 1.0, DVec3::Z);
        let found = choose(known, 10.0 * noise, 10.0 * noise, own, noise, &mut Vec::new());
        let is_fitted = |s: &&Start| (s.sheet.distance(DVec3::ZERO).0.abs() - sides[0]).abs() < 1e-12;
        found.iter().filter(is_fitted).count()
    }

    #[test]
    fn points_of_two_fitted_planes_that_lie_above_each_other_take_both() {
        assert_eq!(chosen(|i, _| i as usize % 2), 2);
    }

    #[test]
    fn the_two_sides_of_a_step_are_no_plate() {
        assert_eq!(chosen(|_, x| usize::from(x > 0.0)), 0);
    }
}
