//! The cubic B-spline basis on clamped knots over `[0, 1]`.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §4.3.2: the entries `B_i(u_k)`.

use std::cmp::Ordering;
use std::sync::Arc;

/// Clamped uniform knots for `control >= 4` control points: `control + 4` numbers from 0 to 1.
pub fn uniform_knots(control: usize) -> Vec<f64> {
    let spans = (control - 3) as f64;
    (0..control + 4).map(|i| (i.saturating_sub(3) as f64 / spans).min(1.0)).collect()
}

/// How many steps between 0 and 1 knots are told apart by: `1 - k` differs from the knot that it stands for by rounding.
const KNOT_STEPS: f64 = (1u64 << 40) as f64;

/// The knots of a direction: clamped, rising from 0 to 1, as many as control points and four more.
///
/// Two lists are equal if no knot differs by more than rounding.
#[derive(Clone, Debug)]
pub struct Knots(Arc<[f64]>);

impl Knots {
    /// Those of [`uniform_knots`].
    pub fn uniform(control: usize) -> Knots {
        Knots(uniform_knots(control).into())
    }

    /// Each inner knot twice, at equal steps: the tangent plane is continuous, curvature need not be. `control` is even.
    pub fn double(control: usize) -> Knots {
        let spans = (control - 2) / 2;
        Knots((0..control + 4).map(|i| ((i / 2).saturating_sub(1) as f64 / spans as f64).min(1.0)).collect())
    }

    /// Knots at `breaks`, which rise from 0 to 1; inner ones stand twice if `is_double`.
    pub fn at(breaks: &[f64], is_double: bool) -> Knots {
        let inner =
            breaks[1..breaks.len() - 1].iter().flat_map(|&b| std::iter::repeat_n(b, 1 + usize::from(is_double)));
        Knots([0.0; 4].into_iter().chain(inner).chain([1.0; 4]).collect())
    }

    /// The knots of a surface.
    pub fn of(list: &[f64]) -> Knots {
        Knots(list.into())
    }

    /// `control() + 4` numbers from 0 to 1.
    pub fn list(&self) -> &[f64] {
        &self.0
    }

    /// Control points of a direction with these knots.
    pub fn control(&self) -> usize {
        self.0.len() - 4
    }

    /// Where spans begin and end, from 0 to 1.
    pub fn breaks(&self) -> Vec<f64> {
        let mut breaks = self.0.to_vec();
        breaks.dedup();
        breaks
    }

    /// The same seen from the other end; the list itself where that is equal.
    pub fn reversed(&self) -> Knots {
        let turned = Knots(self.0.iter().rev().map(|k| 1.0 - k).collect());
        if turned == *self { self.clone() } else { turned }
    }

    fn steps(&self) -> impl Iterator<Item = u64> {
        self.0.iter().map(|k| (k * KNOT_STEPS).round() as u64)
    }
}

impl PartialEq for Knots {
    fn eq(&self, other: &Knots) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Knots {}

impl PartialOrd for Knots {
    fn partial_cmp(&self, other: &Knots) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Knots {
    fn cmp(&self, other: &Knots) -> Ordering {
        self.steps().cmp(other.steps())
    }
}

/// `count` parameters from 0 to 1 at equal steps: where the nodes of a grid lie.
pub fn uniform_parameters(count: usize) -> Vec<f64> {
    let last = count.saturating_sub(1).max(1) as f64;
    (0..count).map(|i| i as f64 / last).collect()
}

/// Places of samples: the breaks of `knots` and between two of them `per_span - 1` at equal steps.
pub fn span_samples(breaks: &[f64], per_span: usize) -> Vec<f64> {
    let inside = |w: &[f64]| {
        let [a, b] = [w[0], w[1]];
        (0..per_span).map(move |k| a + (b - a) * k as f64 / per_span as f64)
    };
    breaks.windows(2).flat_map(inside).chain([1.0]).collect()
}

/// The four basis functions that are not zero at `u` and their first and second derivatives.
///
/// `u` is clamped to `[0, 1]`. Returns the index of the first of the four and `[order][function]`.
pub fn basis_at(knots: &[f64], u: f64) -> (usize, [[f64; 4]; 3]) {
    let u = u.clamp(0.0, 1.0);
    let inner = &knots[4..knots.len() - 4];
    let mut s = 3 + inner.partition_point(|&k| k <= u);
    while s > 3 && knots[s] >= knots[s + 1] {
        s -= 1;
    }
    let t = |i: usize| knots[i];
    // Cox-de Boor, degree by degree; every denominator spans [t_s, t_s+1] and is positive.
    let rise = |i: usize, d: usize| (u - t(i)) / (t(i + d) - t(i));
    let n1 = [1.0 - rise(s, 1), rise(s, 1)];
    let (a, b) = (rise(s - 1, 2), rise(s, 2));
    let n2 = [(1.0 - a) * n1[0], a * n1[0] + (1.0 - b) * n1[1], b * n1[1]];
    let (a, b, c) = (rise(s - 2, 3), rise(s - 1, 3), rise(s, 3));
    let n3 = [(1.0 - a) * n2[0], a * n2[0] + (1.0 - b) * n2[1], b * n2[1] + (1.0 - c) * n2[2], c * n2[2]];
    // Derivative of a basis function of degree d: d (N_i / (t_i+d - t_i) - N_i+1 / (t_i+d+1 - t_i+1)).
    let mut slope2 = [0.0; 3];
    for r in 0..2 {
        let e = 2.0 * n1[r] / (t(s + r + 1) - t(s + r - 1));
        slope2[r] -= e;
        slope2[r + 1] += e;
    }
    let (mut d1, mut d2) = ([0.0; 4], [0.0; 4]);
    for r in 0..3 {
        let e = 3.0 / (t(s + r + 1) - t(s + r - 2));
        d1[r] -= e * n2[r];
        d1[r + 1] += e * n2[r];
        d2[r] -= e * slope2[r];
        d2[r + 1] += e * slope2[r];
    }
    (s - 3, [n3, d1, d2])
}

/// Rows of the basis matrix at many parameters.
#[derive(Clone, Debug)]
pub struct BasisRows {
    /// For each parameter the first control point that counts.
    pub first: Vec<usize>,
    /// The weights of the four.
    pub weights: Vec<[f64; 4]>,
}

impl BasisRows {
    /// Rows of the `order`-th derivative (0, 1 or 2) at `parameters`.
    pub fn new(knots: &[f64], parameters: &[f64], order: usize) -> BasisRows {
        let (first, weights) = parameters
            .iter()
            .map(|&u| {
                let (first, values) = basis_at(knots, u);
                (first, values[order])
            })
            .unzip();
        BasisRows { first, weights }
    }

    /// Number of parameters.
    pub fn len(&self) -> usize {
        self.first.len()
    }

    /// True without parameters.
    pub fn is_empty(&self) -> bool {
        self.first.is_empty()
    }
}
