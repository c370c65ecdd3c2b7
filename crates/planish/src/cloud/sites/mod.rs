//! Where fits are made: as dense as the surface needs, not as dense as the points are.
//!
//! A fit of radius R says the same a little aside, so fits stand a fixed share of R apart. Every point belongs to the
//! nearest site; together the sites own all points.
//!
//! Departs from [X03] §5, which fits at every point: `docs/decisions/0008-fits-at-sites.md`.

pub(crate) mod front;
mod layers;
mod rounding;
pub(crate) mod strays;
pub(crate) mod survey;

use super::sites::rounding::{Rounding, Steps};
use super::sites::survey::{Prior, Scratch, Survey, survey};
use crate::geom::KdTree;
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;

/// Points in the smallest ball of a survey.
const SMALLEST: usize = 18;
/// Distance between sites over the radius of the fits: the blend then meets about eight fits everywhere.
pub(crate) const SITE_DISTANCE: f64 = 0.5;
/// Sites stand no closer than for this share of the usual radius: creases have narrow balls, not finer shapes.
const USUAL: f64 = 0.8;
/// One point in this many is surveyed to learn the radii.
const SCOUT: usize = 24;
/// A fit may be this much wider than the scouts around saw.
const WIDEST_BY_SCOUTS: f64 = 1.7;
/// Scouts that tell the radii of a region.
const SCOUTS: usize = 15;
/// Scouts that are sure of their noise and tell that of a region, and the share of them that says less: what shape there
/// is around adds to some of them, never takes away.
const SURE_SCOUTS: usize = 40;
const BELOW: f64 = 0.2;
/// The nearest ones of them: what is this many times less than their middle is the noise of another region.
const NEAREST: usize = 8;
const ANOTHER: f64 = 1.35;
/// Noise is known if at least this share of all scouts are sure.
const SURE_SCOUT_SHARE: f64 = 0.05;
/// Points per piece of parallel work between two looks at the observer.
pub(crate) const POINTS_PER_CHUNK: usize = 512;

/// Sites and the points they own.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sites {
    /// The point that each site stands on.
    pub point: Vec<u32>,
    /// The survey there.
    pub survey: Vec<Survey>,
    /// The region there.
    pub prior: Vec<Prior>,
    /// Distance that it keeps other sites away.
    pub gap: Vec<f64>,
    /// Owning site of each point; `u32::MAX` where no site is.
    pub owner: Vec<u32>,
}

/// Runs `work` over `0..count` in parallel pieces, in order.
pub(crate) fn in_pieces<T: Send>(
    count: usize,
    span: (f64, f64),
    observer: &dyn Observer,
    work: impl Fn(&mut Scratch, usize) -> T + Sync,
) -> Result<Vec<T>, Cancelled> {
    let mut all = Vec::with_capacity(count);
    // Large pieces keep the threads busy, small ones keep the observer informed.
    let piece = POINTS_PER_CHUNK * rayon::current_num_threads().max(1) * 2;
    let watched = |scratch: &mut Scratch, k: usize| observer.check().map(|()| work(scratch, k));
    while all.len() < count {
        let range = all.len()..(all.len() + piece).min(count);
        let made = range.into_par_iter().with_min_len(16).map_init(Scratch::default, watched);
        all.append(&mut made.collect::<Result<Vec<T>, Cancelled>>()?);
        observer.progress(span.0 + (span.1 - span.0) * all.len() as f64 / count as f64);
    }
    Ok(all)
}

/// Chooses and surveys the sites of points in the order of their tree.
pub(crate) fn choose(points: &[DVec3], tree: &KdTree, observer: &dyn Observer) -> Result<Sites, Cancelled> {
    let scouts: Vec<u32> = (0..points.len() as u32).step_by(SCOUT.min(points.len() / 8 + 1)).collect();
    let rounding = Rounding::of(points, tree, SCOUT);
    let first = in_pieces(scouts.len(), (0.0, 0.2), observer, |s, i| {
        let p = points[scouts[i] as usize];
        let blank = Prior { noise: 0.0, sure: false, one: false, steps: rounding.at(p) };
        survey(tree, p, f64::INFINITY, blank, s)
    })?;
    // A narrow ball has little noise by chance; with the noise of those around the scouts look again.
    let (known, places): (Vec<Survey>, Vec<DVec3>) =
        first.iter().zip(&scouts).filter_map(|(s, &i)| Some(((*s)?, points[i as usize]))).unzip();
    let seen = if known.is_empty() {
        first
    } else {
        let regions = Regions::new(&places, &known, &rounding);
        in_pieces(scouts.len(), (0.2, 0.4), observer, |s, i| {
            let p = points[scouts[i] as usize];
            survey(tree, p, f64::INFINITY, regions.at(p).prior, s)
        })?
    };
    let (known, places): (Vec<Survey>, Vec<DVec3>) =
        seen.into_iter().zip(&scouts).filter_map(|(s, &i)| Some((s?, points[i as usize]))).unzip();
    if known.is_empty() {
        return Ok(Sites { owner: vec![u32::MAX; points.len()], ..Sites::default() });
    }
    let regions = Regions::new(&places, &known, &rounding);
    let mut there = Vec::new();
    let chosen = cover(points, tree, |i| {
        let region = regions.at(points[i]);
        there.push(region);
        SITE_DISTANCE * region.least
    });
    let surveys = in_pieces(chosen.len(), (0.4, 1.0), observer, |s, i| {
        let Region { reach, prior, .. } = there[i];
        survey(tree, points[chosen[i] as usize], reach, prior, s)
    })?;
    let mut sites = Sites::default();
    for ((&point, region), survey) in chosen.iter().zip(&there).zip(surveys) {
        let Some(survey) = survey else { continue };
        sites.point.push(point);
        sites.survey.push(survey);
        sites.prior.push(region.prior);
        sites.gap.push(SITE_DISTANCE * region.least);
    }
    let places: Vec<DVec3> = sites.point.iter().map(|&i| points[i as usize]).collect();
    let site_tree = KdTree::new(&places);
    let closest = |(near, last): &mut (Vec<(f64, u32)>, _), &p: &DVec3| {
        site_tree.nearest_after(p, 1, last, near);
        near.first().map_or(u32::MAX, |n| n.1)
    };
    sites.owner = points.par_iter().map_init(Default::default, closest).collect();
    sites.even(&places, &site_tree);
    Ok(sites)
}

/// What the scouts around a place say of it.
#[derive(Clone, Copy)]
struct Region {
    /// Least radius around, world units.
    least: f64,
    /// The farthest that a fit may reach, world units.
    reach: f64,
    prior: Prior,
}

/// What is known of all places by scouts.
///
/// Where a plate or a rib is as thin as the noise every scout takes it for noise; those that are sure of theirs are a
/// little farther off.
struct Regions<'a> {
    known: &'a [Survey],
    tree: KdTree,
    rounding: &'a Rounding,
    /// The noise at every scout, where it is sure.
    certain: Option<Vec<f64>>,
}

impl Regions<'_> {
    fn new<'a>(places: &[DVec3], known: &'a [Survey], rounding: &'a Rounding) -> Regions<'a> {
        Regions { known, tree: KdTree::new(places), rounding, certain: certain_noise(places, known) }
    }

    fn at(&self, p: DVec3) -> Region {
        let mut near = Vec::with_capacity(SCOUTS);
        self.tree.nearest(p, SCOUTS, &mut near);
        let sorted = |of: &dyn Fn(&Survey) -> f64| {
            let mut all: Vec<f64> = near.iter().map(|n| of(&self.known[n.1 as usize])).collect();
            all.sort_unstable_by(f64::total_cmp);
            all
        };
        let least = near.iter().take(3).map(|n| self.known[n.1 as usize].radius).fold(f64::INFINITY, f64::min);
        let radii = sorted(&|s| s.radius);
        let steps: Steps = self.rounding.at(p);
        let prior = match &self.certain {
            Some(noise) => Prior { noise: noise[near[0].1 as usize], sure: true, one: false, steps },
            None => Prior { noise: sorted(&|s| s.noise)[near.len() / 2], sure: false, one: false, steps },
        };
        // A scout in a crease sees next to nothing; sites there stand as for half of the usual radius.
        let least = least.max(USUAL * radii[radii.len() / 2]);
        Region { least, reach: WIDEST_BY_SCOUTS * radii[radii.len() - 1], prior }
    }
}

/// The noise at every scout by those around that are sure of theirs; `None` if these are few.
fn certain_noise(places: &[DVec3], known: &[Survey]) -> Option<Vec<f64>> {
    let (certain, at): (Vec<f64>, Vec<DVec3>) =
        known.iter().zip(places).filter(|k| k.0.sure).map(|k| (k.0.noise, *k.1)).unzip();
    if certain.len() < SURE_SCOUTS || (certain.len() as f64) < SURE_SCOUT_SHARE * known.len() as f64 {
        return None;
    }
    let tree = KdTree::new(&at);
    let of = |near: &mut Vec<(f64, u32)>, p: &DVec3| {
        tree.nearest(*p, SURE_SCOUTS, near);
        let mut said: Vec<f64> = near.iter().map(|n| certain[n.1 as usize]).collect();
        said[..NEAREST].sort_unstable_by(f64::total_cmp);
        let least = said[NEAREST / 2] / ANOTHER;
        said.retain(|&n| n >= least);
        said.sort_unstable_by(f64::total_cmp);
        said[(BELOW * said.len() as f64) as usize]
    };
    Some(places.par_iter().map_init(Vec::new, of).collect())
}

/// Points in their order such that none is within `gap(point)` of an earlier one and all are within that of one.
pub(crate) fn cover(points: &[DVec3], tree: &KdTree, mut gap: impl FnMut(usize) -> f64) -> Vec<u32> {
    let mut covered = vec![false; points.len()];
    let mut chosen = Vec::new();
    for i in 0..points.len() {
        if !covered[i] {
            chosen.push(i as u32);
            tree.within(points[i], gap(i), |j, _, _| covered[j as usize] = true);
        }
    }
    chosen
}

/// Support over the radius of the fit, and over the distance of sites.
const SUPPORT: f64 = 1.15;
const SUPPORT_GAPS: f64 = 2.3;

impl Sites {
    /// Surveys sites again whose two sheets, so far apart, are one surface.
    pub(crate) fn join(&mut self, tree: &KdTree, twice: &[(u32, f64)]) {
        let fresh: Vec<(Prior, Option<Survey>)> = twice
            .par_iter()
            .map_init(Scratch::default, |scratch, &(site, apart)| {
                let old = &self.survey[site as usize];
                let steps = self.prior[site as usize].steps;
                let prior = Prior { noise: old.noise.hypot(apart / 2.0), sure: false, one: true, steps };
                (prior, survey(tree, old.quadric.center, f64::INFINITY, prior, scratch))
            })
            .collect();
        for (&(site, _), (prior, new)) in twice.iter().zip(fresh) {
            self.prior[site as usize] = prior;
            let survey = &mut self.survey[site as usize];
            *survey = new.unwrap_or(Survey { layer: None, ..*survey });
        }
    }

    /// Standard deviation of the points: that of the region, or less.
    pub(crate) fn noise(&self, site: usize) -> f64 {
        self.prior[site].noise.min(self.survey[site].noise)
    }

    /// Radius of what a site speaks for; cells hear points and are heard a little farther.
    pub(crate) fn support(&self, site: usize) -> f64 {
        (SUPPORT * self.survey[site].radius).max(SUPPORT_GAPS * self.gap[site])
    }

    /// A radius is one draw of a noisy choice: it becomes the lower middle of those around, grown by the way there.
    fn even(&mut self, places: &[DVec3], tree: &KdTree) {
        const SLOPE: f64 = 0.5;
        const QUANTILE: f64 = 0.4;
        let radii: Vec<f64> = (0..places.len())
            .into_par_iter()
            .map(|i| {
                let mut around = Vec::new();
                tree.within(places[i], 0.8 * self.survey[i].radius, |j, _, d2| {
                    around.push(self.survey[j as usize].radius + SLOPE * d2.sqrt());
                });
                around.sort_unstable_by(f64::total_cmp);
                around[(QUANTILE * (around.len() - 1) as f64) as usize]
            })
            .collect();
        for (s, r) in self.survey.iter_mut().zip(radii) {
            // The error of a narrower fit grows as its points get fewer.
            let ratio = (s.radius / r).powi(2).max(1.0);
            s.error *= ratio;
            s.radius = r;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;
    use crate::observe::Silent;

    fn gauss(i: u64) -> DVec3 {
        DVec3::from_array(
            [0, 1, 2].map(|k| random::normal(random::unit(7, 6 * i + 2 * k), random::unit(7, 6 * i + 2 * k + 1))),
        )
    }

    fn sites_of(points: Vec<DVec3>) -> (Vec<DVec3>, Sites) {
        let order = KdTree::new(&points);
        let points: Vec<DVec3> = order.order().iter().map(|&i| points[i as usize]).collect();
        let sites = choose(&points, &KdTree::new(&points), &Silent).unwrap();
        (points, sites)
    }

    fn share(all: &[usize], good: impl Fn(usize) -> bool) -> f64 {
        all.iter().filter(|&&s| good(s)).count() as f64 / all.len() as f64
    }

    #[test]
    fn on_a_plate_of_three_noise_levels_the_noise_is_that_of_the_rest_within_15_percent_and_balls_have_six_levels() {
        // A sphere of 50 noise levels, and aside a plate.
        let (noise, count) = (0.02, 40_000u64);
        let place = |i: u64| {
            let r = |k: u64| 2.0 * random::unit(5, 4 * i + k) - 1.0;
            if i % 5 < 3 {
                let (z, a) = (r(0), std::f64::consts::PI * r(1));
                let s = (1.0 - z * z).sqrt();
                return DVec3::new(s * a.cos(), s * a.sin(), z);
            }
            DVec3::new(3.0 + r(0), r(1), 1.5 * noise * if i % 5 == 3 { 1.0 } else { -1.0 })
        };
        let (points, sites) = sites_of((0..count).map(|i| place(i) + noise * gauss(i)).collect());
        let plate: Vec<usize> = (0..sites.point.len())
            .filter(|&s| (points[sites.point[s] as usize] - DVec3::new(3.0, 0.0, 0.0)).abs().max_element() < 0.8)
            .collect();
        assert!(plate.len() > 50, "{}", plate.len());
        let known = share(&plate, |s| (sites.prior[s].noise / noise - 1.0).abs() < 0.15);
        assert!(known > 0.9, "{known}");
        let narrow = share(&plate, |s| sites.survey[s].radius < 6.0 * noise);
        assert!(narrow > 0.9, "{narrow}");
    }

    #[test]
    fn noise_three_times_as_high_beyond_a_line_is_known_within_a_third_on_both_sides() {
        let place = |i: u64| {
            let r = |k: u64| 2.0 * random::unit(3, 2 * i + k) - 1.0;
            let p = DVec3::new(r(0), r(1), 0.0);
            p + if p.x < 0.0 { 0.005 } else { 0.015 } * gauss(i)
        };
        let (points, sites) = sites_of((0..40_000).map(place).collect());
        for (side, noise) in [(-1.0, 0.005), (1.0, 0.015)] {
            let there: Vec<usize> =
                (0..sites.point.len()).filter(|&s| side * points[sites.point[s] as usize].x > 0.06).collect();
            let known = share(&there, |s| (sites.prior[s].noise / noise - 1.0).abs() < 0.33);
            assert!(there.len() > 50 && known > 0.97, "{known}");
        }
    }
}
