//! The cubic B-spline basis on clamped knots over `[0, 1]`.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §4.3.2: the entries `B_i(u_k)`.

/// Clamped uniform knots for `control >= 4` control points: `control + 4` numbers from 0 to 1.
pub fn uniform_knots(control: usize) -> Vec<f64> {
    let spans = (control - 3) as f64;
    (0..control + 4).map(|i| (i.saturating_sub(3) as f64 / spans).min(1.0)).collect()
}

/// True if `knots` are what [`uniform_knots`] makes, to rounding.
pub fn is_uniform(knots: &[f64]) -> bool {
    knots.len() >= 8 && uniform_knots(knots.len() - 4).iter().zip(knots).all(|(a, b)| (a - b).abs() < 1e-9)
}

/// How often each inner knot of a direction stands. All stand at equal steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Knots {
    /// Once: two derivatives are continuous.
    Simple,
    /// Twice: the tangent plane is continuous, curvature need not be. What a bicubic surface needs along a seam that ends
    /// in a corner where not four patches meet.
    Double,
}

impl Knots {
    /// The knots of `control >= 4` control points, which are even in number where knots are double: `control + 4` numbers
    /// from 0 to 1.
    pub fn list(self, control: usize) -> Vec<f64> {
        match self {
            Knots::Simple => uniform_knots(control),
            Knots::Double => {
                let spans = self.spans(control);
                (0..control + 4).map(|i| ((i / 2).saturating_sub(1) as f64 / spans as f64).min(1.0)).collect()
            }
        }
    }

    /// Knot spans of a direction with so many control points.
    pub fn spans(self, control: usize) -> usize {
        match self {
            Knots::Simple => control - 3,
            Knots::Double => (control - 2) / 2,
        }
    }

    /// Which of the two these knots are, to rounding; `None` if neither.
    pub fn of(knots: &[f64]) -> Option<Knots> {
        let is = |kind: Knots| kind.list(knots.len() - 4).iter().zip(knots).all(|(a, b)| (a - b).abs() < 1e-9);
        if is_uniform(knots) {
            return Some(Knots::Simple);
        }
        (knots.len() >= 8 && knots.len().is_multiple_of(2) && is(Knots::Double)).then_some(Knots::Double)
    }

    /// The nearest number of control points that such knots can have, one more rather than one less unless that is above
    /// `most`.
    pub fn possible(self, control: usize, most: usize) -> usize {
        match self {
            Knots::Double if control % 2 == 1 => {
                if control < most {
                    control + 1
                } else {
                    control - 1
                }
            }
            _ => control,
        }
    }
}

/// `count` parameters from 0 to 1 at equal steps: where the nodes of a grid lie.
pub fn uniform_parameters(count: usize) -> Vec<f64> {
    let last = count.saturating_sub(1).max(1) as f64;
    (0..count).map(|i| i as f64 / last).collect()
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
