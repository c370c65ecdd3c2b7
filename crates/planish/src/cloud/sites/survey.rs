//! The first pass: how far a single quadric holds around a point, and how noisy the points are.
//!
//! [X03] §6.1 asks for a feature size from the data; [M73] Mallows, *Some Comments on Cp*, 1973, is the rule here.
//! 1. nested balls, each 1.3 times as wide, one sum of monomials each
//! 2. the height field of each ball; its residuals averaged in sectors of equal area: what is left in the averages
//!    beyond noise is bias, what is left inside the sectors is noise
//! 3. two sheets close together where the residuals have a dip (`layers`)
//! 4. the ball of least variance plus squared bias
//! 5. the scatter is the noise for sure where nothing speaks of more: no bias, and fourth moments as of a normal
//!    spread
//!
//! Departs from [X03]: no feature size is set by hand, and the noise is measured in every place by itself.

use super::SMALLEST;
use super::layers::{Layers, PEAKED, split};
use super::rounding::{self, Steps};
use crate::cloud::Quadric;
use crate::cloud::local::height::{Frame, Height, framed_height};
use crate::cloud::local::moments::Moments;
use crate::cloud::local::points::Points;
use crate::geom::{KdTree, is_positive};
use glam::DVec3;

/// A ball of so many points leaves a tenth of the noise; if it is this many noise levels wide it grows no further.
pub(crate) const PLENTY_OF_POINTS: usize = 700;
pub(crate) const WIDEST_NOISE: f64 = 10.0;
/// Ratio of the radii of two balls, one after the other.
const BALL_GROWTH: f64 = 1.3;
/// Largest number of balls: 18 points become 1.69^11 = 320 times as many.
const BALLS: usize = 12;
/// Balls per query of neighbours.
const STRIDE: usize = 3;
/// A ball must be this many noise levels wide: below it the points fill a volume.
const NOISE_RADII: f64 = 4.0;
/// Noise levels that a ball must be wide where the noise of the region is known: scatter above it then is shape. The
/// scouts, which go first and know nothing, begin with as many; afterwards those among them that are sure of their
/// noise tell it to the others.
const KNOWN_RADII: f64 = 3.0;
/// But a ball is this many times as wide as its own scatter: one full of points is sqrt(5) times.
const NO_VOLUME: f64 = 2.6;
/// The search ends when the error has grown to this many times the least one.
const HOPELESS: f64 = 6.0;
/// Share of the noise of the region that every place has at least.
const KNOWN: f64 = 0.8;
/// Scatter above this many times the usual noise is more than noise: another sheet, or relief finer than the sectors.
const THICKER: f64 = 1.15;
/// A place is sure that its scatter is noise if its ball has `MANY` points, the averages of its sectors hold less
/// than `UNBIASED` squared noise levels beyond noise, and its fourth moment is that of a normal distribution within
/// `NORMAL` standard deviations and within `LACK`, half of what two sheets three levels apart lack.
const MANY: f64 = 100.0;
const UNBIASED: f64 = 6.0;
const NORMAL: f64 = 2.0;
const LACK: f64 = 0.5;
/// Parameters of a height field: its error at the centre is about this times the noise over the points.
const PARAMETERS: f64 = 6.0;

/// What is known of the surface around a point after the first pass.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Survey {
    /// Radius over which one quadric holds, world units.
    pub radius: f64,
    /// Standard deviation of the points, world units.
    pub noise: f64,
    /// The part of it that rounding adds and the points do not show, world units.
    pub hidden: f64,
    /// Expected squared error of the fit, world units squared.
    pub error: f64,
    /// Local spacing of the points, world units.
    pub spacing: f64,
    /// The height field.
    pub quadric: Quadric,
    /// A second sheet close to it: then this is the sheet of the place itself, and both are one plate or one gap.
    pub layer: Option<Quadric>,
    /// All the scatter is noise: one sheet without bias, normally spread.
    pub sure: bool,
}

/// Buffers of one thread.
#[derive(Default)]
pub(crate) struct Scratch {
    near: Vec<(f64, u32)>,
    /// Points of a ball, world units.
    pub around: Vec<DVec3>,
    /// Those of the balls so far, local coordinates, and those of the next ones alone.
    ball: Points,
    fresh: [Points; STRIDE],
    ones: Vec<f64>,
    rows: [Vec<f64>; 3],
}

/// What is known around a place before it is surveyed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prior {
    /// Noise of the region, world units; 0 where nothing is known.
    pub noise: f64,
    /// Places around were sure of it: what scatters more is no noise.
    pub sure: bool,
    /// Two sheets side by side are one surface there, seen twice.
    pub one: bool,
    /// How the points were rounded.
    pub steps: Steps,
}

/// Surveys the surface near one point.
///
/// * `reach` - bounds the radius, world units
/// * `prior` - the region; a ball narrower than its noise would take the noise for a surface
///
/// `None` where no ball determines a surface.
pub(crate) fn survey(tree: &KdTree, p: DVec3, reach: f64, prior: Prior, scratch: &mut Scratch) -> Option<Survey> {
    tree.nearest(p, SMALLEST, &mut scratch.near);
    let mut r0 = scratch.near.last()?.0.sqrt();
    if !is_positive(r0) || scratch.near.len() < SMALLEST {
        return None;
    }
    let floor = KNOWN * prior.noise;
    let start = if prior.sure { KNOWN_RADII * prior.noise } else { NOISE_RADII * floor };
    let start = start.max(NOISE_RADII * rounding::variance(&prior.steps).sqrt());
    let mut p = p;
    if start > r0 {
        r0 = start;
        p = onto_plane(tree, p, r0, scratch);
    }
    let radius = |j: usize| r0 * BALL_GROWTH.powi(j as i32);
    let quadric = |h: &Height| Quadric { center: p, scale: r0, a: h.implicit() };
    let mut sums = Moments::ZERO;
    let (mut best, mut least): (Option<Survey>, f64) = (None, f64::INFINITY);
    let Scratch { around, ball: inner, fresh, ones, rows, .. } = scratch;
    inner.clear();
    let mut done = 0.0;
    // The noise of the region, or the least of the balls so far.
    let mut usual = if prior.noise > 0.0 { prior.noise / r0 } else { f64::INFINITY };
    'rounds: for first in (0..BALLS).step_by(STRIDE) {
        let last = first + STRIDE - 1;
        let limits: [f64; STRIDE] = std::array::from_fn(|k| BALL_GROWTH.powi(2 * (first + k) as i32));
        fresh.iter_mut().for_each(Points::clear);
        around.clear();
        tree.within(p, radius(last) * (1.0 + 1e-12), |_, q, _| around.push(q));
        for &q in &*around {
            let y = (q - p) / r0;
            let d2 = y.length_squared();
            if d2 > done {
                let k = limits.iter().position(|&l| d2 <= l * (1.0 + 1e-12)).unwrap_or(STRIDE - 1);
                fresh[k].push(y);
            }
        }
        done = limits[STRIDE - 1] * (1.0 + 1e-12);
        for (k, points) in fresh.iter().enumerate() {
            ones.clear();
            ones.resize(points.len(), 1.0);
            sums.join(&points.moments(ones));
            inner.append(points);
            let j = first + k;
            if j > 0
                && (radius(j) > reach
                    || (inner.len() > PLENTY_OF_POINTS && BALL_GROWTH.powi(j as i32) > WIDEST_NOISE * usual))
            {
                break 'rounds;
            }
            let Some(ball) = Ball::fit(&sums, inner, BALL_GROWTH.powi(j as i32), prior, r0, rows) else { continue };
            usual = usual.min(ball.noise);
            let error = ball.error(usual);
            if error < least {
                least = error;
                best = Some(Survey {
                    radius: radius(j),
                    noise: ball.noise * r0,
                    hidden: ball.hidden.sqrt() * r0,
                    error: error * r0 * r0,
                    spacing: radius(j) * ball.spacing(),
                    sure: ball.is_sure(),
                    quadric: quadric(ball.layers.as_ref().map_or(&ball.height, |l| &l.sheets[0])),
                    layer: ball.layers.map(|l| quadric(&l.sheets[1])),
                });
            } else if error > HOPELESS * least {
                break 'rounds;
            }
        }
    }
    best
}

/// Moves a point onto the plane of the ball around it, twice: one aside of the surface sees one side of the noise.
fn onto_plane(tree: &KdTree, mut p: DVec3, radius: f64, scratch: &mut Scratch) -> DVec3 {
    let Scratch { around, ball, ones, .. } = scratch;
    for _ in 0..2 {
        around.clear();
        tree.within(p, radius, |_, q, _| around.push(q));
        ball.refill(around);
        ball.localize(p, radius, DVec3::ZERO, ones);
        ones.fill(1.0);
        let m = ball.moments(ones);
        if m.weight() >= SMALLEST as f64 {
            let n = Frame::of_moments(&m).n;
            p += radius * n * m.mean().dot(n);
        }
    }
    p
}

/// A ball as its points tell of it; lengths in units of the first ball's radius.
struct Ball {
    height: Height,
    layers: Option<Layers>,
    noise: f64,
    /// Squared noise that the rounding of the points hides: the same error for all of them.
    hidden: f64,
    excess: f64,
    kurtosis: f64,
    count: usize,
}

impl Ball {
    /// `None` if the points determine no sheet, or the ball is so narrow that noise would pass for its shape.
    /// * `ball` - its radius; `unit` - the unit of length, world units
    fn fit(
        sums: &Moments,
        inner: &Points,
        ball: f64,
        prior: Prior,
        unit: f64,
        rows: &mut [Vec<f64>; 3],
    ) -> Option<Ball> {
        let height = framed_height(&sums.matrix(), Frame::of_moments(sums))?;
        let hides =
            |scatter: f64| rounding::hidden(&prior.steps, height.frame.n, scatter * unit * unit) / (unit * unit);
        let Scatter { noise, hidden, excess, kurtosis } = bias(&height, inner, ball, hides, rows);
        let layers = if prior.one || kurtosis >= PEAKED { None } else { split(&height, inner, &rows[2]) };
        let two = |l: &Layers| {
            let apart = l.sheets[0].residual(DVec3::ZERO) - l.sheets[1].residual(DVec3::ZERO);
            !rounding::is_one(&prior.steps, height.frame.n, apart.abs() * unit)
        };
        let layers = layers.filter(two);
        let floor = KNOWN * prior.noise;
        let (noise, hidden, excess) = match &layers {
            None => (noise.max(floor / unit), hidden, excess),
            // Each sheet has half of the points, and its bias is not measured: that of both together is.
            Some(l) => {
                let hidden = hides(l.noise * l.noise);
                let shown = if hidden > 0.0 { l.noise.hypot(hidden.sqrt()) } else { l.noise };
                (shown.max(floor / unit), hidden, PARAMETERS + 2.0 * layer_bias(l, inner, ball, rows))
            }
        };
        let (radii, own) = match prior.sure {
            true => (KNOWN_RADII, noise.min(prior.noise / unit)),
            false if prior.noise > 0.0 => (NOISE_RADII, noise),
            false => (KNOWN_RADII, noise),
        };
        let wide = (radii * own).max(NO_VOLUME * noise);
        // The first ball is as wide as the noise asks, but for rounding.
        let is_narrow = ball * (1.0 + 1e-9) < wide;
        (!is_narrow).then_some(Ball { height, layers, noise, hidden, excess, kurtosis, count: inner.len() })
    }

    /// Expected squared error where `usual` is the noise of the region.
    fn error(&self, usual: f64) -> f64 {
        // Two standard deviations of a noise level from this many points pass as chance.
        let chance = THICKER + (2.0 / self.count as f64).sqrt();
        let thick = (self.noise * self.noise - (chance * usual).powi(2)).max(0.0);
        self.noise * self.noise * (PARAMETERS + self.excess) / self.count as f64 + thick + self.hidden
    }

    /// Distance between points, in radii of the ball.
    fn spacing(&self) -> f64 {
        (std::f64::consts::PI * if self.layers.is_some() { 2.0 } else { 1.0 } / self.count as f64).sqrt()
    }

    /// True if the noise is what the points scatter and no shape.
    fn is_sure(&self) -> bool {
        self.layers.is_none()
            && self.hidden == 0.0
            && self.count as f64 > MANY
            && self.excess < UNBIASED
            && (self.kurtosis - 3.0).abs() < LACK.min(NORMAL * (24.0 / self.count as f64).sqrt())
    }
}

/// What the averages of the sectors hold beyond noise if every point belongs to the nearer of two sheets.
fn layer_bias(layers: &Layers, points: &Points, ball: f64, rows: &mut [Vec<f64>; 3]) -> f64 {
    let own = |k: usize| -> Points {
        let [a, b] = [k, 1 - k].map(|i| &layers.sheets[i]);
        points.iter().filter(|&y| a.residual(y).abs() <= b.residual(y).abs()).collect()
    };
    (0..2).map(|k| bias(&layers.sheets[k], &own(k), ball, |_| 0.0, rows).excess).sum::<f64>() / 2.0
}

/// What the residuals of a ball show.
struct Scatter {
    /// Standard deviation inside the sectors, with what is hidden, local units.
    noise: f64,
    /// The square of what rounding hides of it.
    hidden: f64,
    /// What the averages of the sectors hold beyond it, in units of the squared noise.
    excess: f64,
    /// Fourth moment of the residuals over the square of the second: 3 of normal noise.
    kurtosis: f64,
}

/// Noise inside the sectors and what the averages of the sectors hold beyond it.
/// * `hides` - squared noise that the points do not show, for what they show
/// * `rows` - takes coordinates and residuals ([`Points::heights`])
fn bias(height: &Height, points: &Points, ball: f64, hides: impl Fn(f64) -> f64, rows: &mut [Vec<f64>; 3]) -> Scatter {
    const SURVEY_SECTORS: usize = 16;
    // Two rings of equal area want five points in each part.
    let rings = points.len() >= 5 * SURVEY_SECTORS;
    let half = ball * ball / 2.0;
    let mut sums = [(0.0, 0.0); SURVEY_SECTORS];
    let (mut squares, mut fourths) = (0.0, 0.0);
    points.heights(height, rows);
    let [us, vs, rs] = &*rows;
    for ((&u, &v), &r) in us.iter().zip(vs).zip(rs) {
        let mut at = usize::from(u > 0.0) | usize::from(v > 0.0) << 1 | usize::from(u.abs() > v.abs()) << 2;
        if rings && u * u + v * v > half {
            at |= 8;
        }
        sums[at].0 += 1.0;
        sums[at].1 += r;
        squares += r * r;
        fourths += (r * r) * (r * r);
    }
    let parts = sums.iter().filter(|s| s.0 > 0.0).count() as f64;
    let between: f64 = sums.iter().filter(|s| s.0 > 0.0).map(|s| s.1 * s.1 / s.0).sum();
    let n = points.len() as f64;
    let shown = ((squares - between) / (n - parts).max(1.0)).max(0.0);
    let hidden = hides(shown);
    let within = shown + hidden;
    // The averages can take up this many of the six parameters, so the fit has removed their share.
    let freedom = (parts - if rings { 5.0 } else { 4.0 }).max(1.0);
    let excess = if within > 0.0 { (between / within - freedom).max(0.0) } else { 0.0 };
    let kurtosis = if squares > 0.0 { n * fourths / (squares * squares) } else { 3.0 };
    Scatter { noise: within.sqrt(), hidden, excess, kurtosis }
}
