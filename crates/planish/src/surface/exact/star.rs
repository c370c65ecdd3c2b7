//! Gluing functions: how the derivatives across a seam and the one along it hang together.
//!
//! A seam is smooth if `a_0 F^0_u + a_1 F^1_u + b G' = 0` along it, with `F^0_u`, `F^1_u` the derivatives from the curve `G` into
//! both patches and `a_0`, `a_1` above 0. At a corner all derivatives lie in one plane, and the equation between three vectors of
//! a plane gives `a` and `b` there: `a_0` is the area that the two sides of patch 1 span, `a_1` that of patch 0. In between `a`
//! and `b` are linear, so that cubics with double knots keep their full order of approximation (Collin, Sangalli, Takacs 2016,
//! *Analysis-suitable G1 multi-patch parametrizations*).
//!
//! Around a corner of an even number of patches the equations of its seams, derived along them, have solutions for the mixed
//! derivatives only if a sum of what they hold beside these vanishes (vertex enclosure: Peters 2002, *Geometric continuity*). Its
//! normal part does for curves on one surface; for the part in the plane the slopes of `b` there change by as little as it takes,
//! over two knot spans.

use crate::network::Network;
use crate::surface::Surface;
use crate::surface::seam::corner::{Sector, ends, sectors};
use crate::surface::sides::{knots_along, place};
use glam::DVec3;

/// Least `a` of a side where both add up to 2: below it one side is so flat or pointed beside the other that small moves of its
/// control points would turn the other over.
const LEAST_SHARE: f64 = 0.15;
/// Least sine between the sides of a patch at a corner: 5 degrees. At 0 it spans no plane there.
const LEAST_SINE: f64 = 0.087;
/// Fewest knot spans along a seam: what changes the slope of `b` at an end takes two.
const FEWEST_SPANS: usize = 2;

/// The gluing functions of one seam.
#[derive(Clone, Debug)]
pub(super) struct Gluing {
    /// `a` of both sides, and `b`, at the start and at the end of the curve.
    a: [[f64; 2]; 2],
    b: [f64; 2],
    /// What the slope of `b` has at both ends beside the linear one.
    slopes: [f64; 2],
    breaks: Vec<f64>,
}

impl Gluing {
    /// `a` of both sides and `b` at `t` (0 to 1) along the curve.
    pub fn at(&self, t: f64) -> ([f64; 2], f64) {
        let linear = |[from, to]: [f64; 2]| from * (1.0 - t) + to * t;
        let last = self.breaks.len() - 1;
        let start = rise(t, self.breaks[1], self.breaks[2]);
        let end = -rise(1.0 - t, 1.0 - self.breaks[last - 1], 1.0 - self.breaks[last - 2]);
        let b = linear(self.b) + self.slopes[0] * start + self.slopes[1] * end;
        ([0, 1].map(|k| linear([self.a[0][k], self.a[1][k]])), b)
    }
}

/// The quadratic spline with knots at 0, `first` and `second` that rises from 0 by a slope of 1 and is 0, with its slope, from
/// `second` on.
fn rise(t: f64, first: f64, second: f64) -> f64 {
    let (h, k) = (first, second - first);
    let d = h / (2.0 * k * (h + k));
    let c = (1.0 + 2.0 * d * k) / (2.0 * h);
    if t <= first { t - c * t * t } else { d * (second - t).max(0.0).powi(2) }
}

/// A patch at one of its corners, in the plane there.
#[derive(Clone, Copy)]
struct Wedge {
    /// The derivatives away from the corner along the side that starts there and along the one before.
    next: DVec3,
    before: DVec3,
    /// The second derivative along the side that starts there.
    bend: DVec3,
    /// What both sides span.
    area: f64,
}

/// One end of a seam: `a` of its sides and `b`, with the curve running away from the corner.
#[derive(Clone, Copy)]
struct End {
    a: [f64; 2],
    b: f64,
}

/// Works out gluing functions of all seams for which `is_seam` holds, from where the surfaces stand, none for seams that cannot
/// have any.
pub(super) fn gluings(network: &Network, surfaces: &[Surface], is_seam: &dyn Fn(usize) -> bool) -> Vec<Option<Gluing>> {
    let uses = network.uses();
    let stars = sectors(network, &|c, _| is_seam(c));
    let mut wedges: Vec<Option<Wedge>> = vec![None; 4 * surfaces.len()];
    for star in &stars {
        let flat = in_plane(surfaces, star);
        star.wedges.iter().zip(flat).for_each(|(&w, wedge)| wedges[w] = wedge);
    }
    let end_of = |c: usize, e: usize| -> Option<End> {
        let at = [0, 1].map(|k| wedge_at(network, uses[c][k], e));
        let both =
            [0, 1].map(|k| wedges[at[k].0].map(|w| if at[k].1 { (w.next, w.before) } else { (w.before, w.next) }));
        let areas = [0, 1].map(|k| wedges[at[k].0].map_or(0.0, |w| w.area));
        let [Some((along, f0)), Some((_, f1))] = both else { return None };
        let a = [areas[1], areas[0]].map(|area| 2.0 * area / (areas[0] + areas[1]));
        let b = -(f0 * a[0] + f1 * a[1]).dot(along) / along.length_squared();
        (a.iter().all(|a| *a >= LEAST_SHARE)).then_some(End { a, b })
    };
    let mut found: Vec<Option<Gluing>> = vec![None; uses.len()];
    for (c, found) in found.iter_mut().enumerate().filter(|(c, _)| is_seam(*c)) {
        let knots = knots_along(network, surfaces, uses[c][0]);
        let breaks = knots.breaks();
        let is_double = knots.list().len() - 8 == 2 * (breaks.len() - 2);
        if let (Some(start), Some(end), true) = (end_of(c, 0), end_of(c, 1), is_double && breaks.len() > FEWEST_SPANS) {
            *found = Some(Gluing { a: [start.a, end.a], b: [start.b, -end.b], slopes: [0.0; 2], breaks });
        }
    }
    for star in stars.iter().filter(|star| star.closed && star.wedges.len().is_multiple_of(2)) {
        for ((c, e), change) in enclosure(network, star, &uses, (&wedges, &found)).unwrap_or_default() {
            found[c].as_mut().expect("a seam of the star").slopes[e] = change;
        }
    }
    found
}

/// The wedge of a patch at end `e` of the curve on its side, and whether that side starts there.
fn wedge_at(network: &Network, (patch, side): (u32, u8), e: usize) -> (usize, bool) {
    let (p, k) = (patch as usize, side as usize);
    let starts = (e == 0) != network.patches[p].sides[k].reversed;
    (4 * p + if starts { k } else { (k + 1) % 4 }, starts)
}

/// The wedges of a star, projected to its plane; `None` for those that are turned over there or span nothing.
fn in_plane(surfaces: &[Surface], star: &Sector) -> Vec<Option<Wedge>> {
    let one = |&w: &usize| {
        let (u, v) = place(w % 4, false, 0.0);
        let jet = surfaces[w / 4].jet(u, v);
        let (du, dv) = (jet.u * (1.0 - 2.0 * u), jet.v * (1.0 - 2.0 * v));
        let area = jet.area_vector();
        match (w % 4).is_multiple_of(2) {
            true => (du, dv, jet.uu, area),
            false => (dv, du, jet.vv, area),
        }
    };
    let all: Vec<_> = star.wedges.iter().map(one).collect();
    let normal = all.iter().map(|w| w.3.normalize_or_zero()).sum::<DVec3>().normalize_or_zero();
    let flat = |x: DVec3| x - normal * normal.dot(x);
    let project = |&(next, before, bend, _): &(DVec3, DVec3, DVec3, DVec3)| {
        let (next, before, bend) = (flat(next), flat(before), flat(bend));
        let area = normal.dot(next.cross(before));
        let spans = area > LEAST_SINE * next.length() * before.length();
        spans.then_some(Wedge { next, before, bend, area })
    };
    all.iter().map(project).collect()
}

/// Least changes of the slopes of `b` with which the equations of the seams around a corner have solutions in its plane.
///
/// With the seams in their order around the corner, each between the patches before and after it, what is left beside the mixed
/// derivatives is `r = a'_0 F^0_u + a'_1 F^1_u + b' G' + b G''`. Going around once with factors `y` that cancel the mixed
/// derivatives leaves `sum y r = 0`.
fn enclosure(
    network: &Network,
    star: &Sector,
    uses: &[Vec<(u32, u8)>],
    (wedges, gluings): (&[Option<Wedge>], &[Option<Gluing>]),
) -> Option<Vec<((usize, usize), f64)>> {
    let order = around(network, star)?;
    let n = order.len();
    let seam = |i: usize| {
        let (after, before) = (order[i], order[(i + n - 1) % n]);
        let (c, e) = ends(network, after / 4, after % 4)[0];
        let gluing = gluings[c].as_ref()?;
        // Which of the two sides of the curve is the patch after it.
        let k = (0..2).find(|&k| wedge_at(network, uses[c][k], e) == (after, true))?;
        Some((c, e, gluing, k, wedges[after]?, wedges[before]?))
    };
    let mut factor = 1.0;
    let (mut rest, mut pulls) = (DVec3::ZERO, Vec::new());
    for i in 0..n {
        let (c, e, gluing, k, after, before) = seam(i)?;
        let (here, far) = (gluing.a[e], gluing.a[1 - e]);
        let sign = if e == 0 { 1.0 } else { -1.0 };
        let left = after.before * (far[k] - here[k])
            + before.next * (far[1 - k] - here[1 - k])
            + after.next * (gluing.b[1] - gluing.b[0])
            + after.bend * (sign * gluing.b[e]);
        rest += left * factor;
        pulls.push(((c, e), after.next, factor));
        let (_, next_e, next, next_k, ..) = seam((i + 1) % n)?;
        factor *= -here[k] / next.a[next_e][1 - next_k];
    }
    // Least squares of the changes times the lengths of the derivatives.
    let unit = |(_, along, y): &((usize, usize), DVec3, f64)| along.normalize() * *y;
    let (x, y) = {
        let x = pulls[0].1.normalize();
        let across = pulls.iter().map(|p| p.1 - x * x.dot(p.1)).max_by(|a, b| a.length().total_cmp(&b.length()))?;
        (x, across.try_normalize()?)
    };
    let sum = |of: &dyn Fn(DVec3) -> f64| pulls.iter().map(|p| of(unit(p))).sum::<f64>();
    let (xx, xy, yy) = (sum(&|u| u.dot(x).powi(2)), sum(&|u| u.dot(x) * u.dot(y)), sum(&|u| u.dot(y).powi(2)));
    let (p, q) = (-rest.dot(x), -rest.dot(y));
    let det = xx * yy - xy * xy;
    let way = x * ((p * yy - q * xy) / det) + y * ((q * xx - p * xy) / det);
    Some(pulls.iter().map(|pull| (pull.0, unit(pull).dot(way) / pull.1.length())).collect())
}

/// The wedges of a closed star counter-clockwise.
fn around(network: &Network, star: &Sector) -> Option<Vec<usize>> {
    let both = |w: usize| ends(network, w / 4, w % 4);
    let mut order = vec![*star.wedges.first()?];
    while order.len() < star.wedges.len() {
        let last = both(order[order.len() - 1])[1];
        order.push(*star.wedges.iter().find(|w| !order.contains(w) && both(**w)[0] == last)?);
    }
    (both(order[order.len() - 1])[1] == both(order[0])[0]).then_some(order)
}
