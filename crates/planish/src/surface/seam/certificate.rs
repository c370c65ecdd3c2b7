//! Bounds on how two surfaces meet along a seam: between samples, too.
//!
//! Along a knot span the boundary of a bicubic surface and its derivative across are cubics, so its normal there, the cross
//! product of that derivative and the boundary's own, is a polynomial of degree 5, and the cross and the dot product of both
//! sides' normals are of degree 10. A polynomial lies in the hull of its Bernstein coefficients (Farin 2002, *Curves and
//! Surfaces for CAGD*, ch. 6): the longest of the one over the least of the other bounds the tangent of the angle. Intervals
//! are halved until that bound is near what the angle is somewhere.

use crate::surface::Surface;
use crate::surface::sides::along_curve;
use glam::DVec3;

/// How far above an angle that the seam has somewhere its bound may stay, as a share.
const TIGHT: f64 = 0.02;
/// Angles that are not told apart from nothing, radians: rounding of products of ten factors.
const NOTHING: f64 = 1e-9;
/// How often a knot span is halved at most; where a normal vanishes the bound never comes near.
const HALVINGS: u32 = 16;

/// One side of a seam, in the direction of its curve.
pub(crate) struct Rim {
    knots: Vec<f64>,
    /// The control points on the seam, and the steps from them to the next row.
    on: Vec<DVec3>,
    inward: Vec<DVec3>,
    /// -1 where the patch sees the curve reversed.
    sign: f64,
}

impl Rim {
    /// Side `side` of a surface, which runs against the curve if `reversed`.
    pub fn new(surface: &Surface, side: usize, reversed: bool) -> Rim {
        let row = |depth| along_curve(&surface.control, surface.rows, surface.cols, side, reversed, depth);
        let on = row(0);
        let inward = row(1).iter().zip(&on).map(|(a, b)| *a - *b).collect();
        let knots = if side.is_multiple_of(2) { &surface.knots_u } else { &surface.knots_v };
        let knots = match (side >= 2) != reversed {
            true => knots.iter().rev().map(|k| 1.0 - k).collect(),
            false => knots.clone(),
        };
        Rim { knots, on, inward, sign: if reversed { -1.0 } else { 1.0 } }
    }

    /// Bernstein coefficients on `[a, b]`, within one knot span, of the boundary and of the derivative across it up to a
    /// positive factor.
    fn cubics(&self, [a, b]: [f64; 2]) -> [[DVec3; 4]; 2] {
        let inner = &self.knots[4..self.knots.len() - 4];
        let s = 3 + inner.partition_point(|&k| k <= (a + b) / 2.0);
        let args = [[a, a, a], [a, a, b], [a, b, b], [b, b, b]];
        [&self.on, &self.inward].map(|net| args.map(|args| self.blossom(&net[s - 3..=s], s, args)))
    }

    /// The polar form of the cubic on knot span `s` (de Boor's scheme with an argument of its own at each step).
    fn blossom(&self, net: &[DVec3], s: usize, args: [f64; 3]) -> DVec3 {
        let mut d: [DVec3; 4] = std::array::from_fn(|k| net[k]);
        for (r, x) in (1..4).zip(args) {
            for j in (r..4).rev() {
                let i = s - 3 + j;
                let share = (x - self.knots[i]) / (self.knots[i + 4 - r] - self.knots[i]);
                d[j] = d[j - 1] * (1.0 - share) + d[j] * share;
            }
        }
        d[3]
    }
}

/// Binomial coefficients.
const fn choose(n: usize, k: usize) -> f64 {
    let (mut value, mut i) = (1.0, 0);
    while i < k {
        value = value * (n - i) as f64 / (i + 1) as f64;
        i += 1;
    }
    value
}

/// Bernstein coefficients of a product from those of its factors.
fn product<A: Copy, B: Copy, C>(
    a: &[A],
    b: &[B],
    zero: C,
    times: impl Fn(A, B) -> C,
    add: impl Fn(C, C, f64) -> C,
) -> Vec<C>
where
    C: Copy,
{
    let (m, n) = (a.len() - 1, b.len() - 1);
    let mut sums = vec![zero; m + n + 1];
    for (i, &x) in a.iter().enumerate() {
        for (j, &y) in b.iter().enumerate() {
            let weight = choose(m, i) * choose(n, j) / choose(m + n, i + j);
            sums[i + j] = add(sums[i + j], times(x, y), weight);
        }
    }
    sums
}

fn cross(a: &[DVec3], b: &[DVec3]) -> Vec<DVec3> {
    product(a, b, DVec3::ZERO, DVec3::cross, |sum, x, w| sum + x * w)
}

fn dot(a: &[DVec3], b: &[DVec3]) -> Vec<f64> {
    product(a, b, 0.0, DVec3::dot, |sum, x, w| sum + x * w)
}

/// Knots of both sides within `[from, to]`, and these two.
fn breaks(rims: &[Rim; 2], [from, to]: [f64; 2]) -> Vec<f64> {
    let inner = |k: &f64| *k > from && *k < to;
    let mut all: Vec<f64> = rims.iter().flat_map(|r| r.knots.iter().copied().filter(inner)).collect();
    all.extend([from, to]);
    all.sort_unstable_by(f64::total_cmp);
    // Knots of the two directions of one side differ by rounding.
    all.dedup_by(|b, a| *b - *a < 1e-12);
    all
}

/// A distance that the two sides are nowhere farther apart at equal parameters.
pub(crate) fn gap_bound(rims: &[Rim; 2]) -> f64 {
    let on = |span: &[f64]| {
        let [a, b] = [0, 1].map(|k: usize| rims[k].cubics([span[0], span[1]])[0]);
        a.iter().zip(&b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
    };
    breaks(rims, [0.0, 1.0]).windows(2).map(on).fold(0.0, f64::max)
}

/// An angle that the normals of the two sides nowhere on `range` of the seam exceed, radians, at most a fiftieth above the
/// largest there; half a turn where a normal vanishes.
/// * `known` - an angle that they have somewhere there
pub(crate) fn angle_bound(rims: &[Rim; 2], range: [f64; 2], known: f64) -> f64 {
    let mut best = known.max(NOTHING);
    let mut bound = 0.0f64;
    let mut open: Vec<([f64; 2], u32)> = breaks(rims, range).windows(2).rev().map(|w| ([w[0], w[1]], 0)).collect();
    while let Some((span, halvings)) = open.pop() {
        let (ends, above) = angles(rims, span);
        best = best.max(ends);
        if above <= best * (1.0 + TIGHT) || halvings == HALVINGS {
            bound = bound.max(above);
        } else {
            let middle = (span[0] + span[1]) / 2.0;
            open.extend([([middle, span[1]], halvings + 1), ([span[0], middle], halvings + 1)]);
        }
    }
    bound
}

/// The larger of the angles at the ends of an interval, and a bound on those between.
fn angles(rims: &[Rim; 2], span: [f64; 2]) -> (f64, f64) {
    let [a, b] = [0, 1].map(|k: usize| {
        let [on, inward] = rims[k].cubics(span);
        let along: Vec<DVec3> = on.windows(2).map(|w| (w[1] - w[0]) * rims[k].sign).collect();
        cross(&along, &inward)
    });
    let (sines, cosines) = (cross(&a, &b), dot(&a, &b));
    let angle = |k: usize| sines[k].length().atan2(cosines[k]);
    let longest = sines.iter().map(|x| x.length()).fold(0.0, f64::max);
    let least = cosines.iter().copied().fold(f64::INFINITY, f64::min);
    let above = if least > 0.0 { longest.atan2(least) } else { std::f64::consts::PI };
    // Where a normal vanishes there is no angle.
    let at = |k: usize| if cosines[k] == 0.0 { 0.0 } else { angle(k) };
    (at(0).max(at(10)), above)
}
