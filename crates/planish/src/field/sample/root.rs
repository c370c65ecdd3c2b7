//! Roots along edges, and the normals of hits.

use glam::DVec3;

/// The way out along an edge whose lower end has the value `f0`: 1 or -1.
pub fn outward(f0: f64) -> f64 {
    if f0 < 0.0 { 1.0 } else { -1.0 }
}

/// The normal of a hit; at a flat spot from inside to outside along its edge.
pub fn steady(gradient: DVec3, axis: usize, outward: f64) -> DVec3 {
    if gradient != DVec3::ZERO && gradient.is_finite() {
        return gradient;
    }
    let mut normal = DVec3::ZERO;
    normal[axis] = outward;
    normal
}

/// The place is known to this fraction of the edge.
const ROOT: f64 = 1e-13;

/// How far a step goes beyond where a straight line is zero, to bracket it from both sides: fields are nearly straight along
/// an edge, and .2, as in the source, takes a fifth more values.
const CUT: f64 = 0.01;

/// Where `f` passes zero between 0 and 1, to 1e-13.
pub fn root(f: impl Fn(f64) -> f64, f0: f64, f1: f64) -> f64 {
    root_within(ROOT, f, f0, f1)
}

/// Where `f` passes zero between 0 and 1, to `precision`.
pub fn root_within(precision: f64, f: impl Fn(f64) -> f64, f0: f64, f1: f64) -> f64 {
    let mut bracket = Bracket::new(precision, f0, f1);
    while let Some(x) = bracket.ask() {
        bracket.tell(x, f(x));
    }
    bracket.place()
}

/// The search for a root between 0 and 1 by interpolation kept within a shrinking bracket (Oliveira and Takahashi 2020, *An
/// Enhancement of the Bisection Method Average Performance Preserving Minmax Optimality*): never more steps than bisection
/// plus one. Values are asked for and told, so that many searches can go on at once.
pub struct Bracket {
    a: f64,
    b: f64,
    fa: f64,
    fb: f64,
    sign: f64,
    precision: f64,
    step: i32,
    most: i32,
}

impl Bracket {
    /// A search to `precision`, between values of different sides.
    pub fn new(precision: f64, f0: f64, f1: f64) -> Bracket {
        let sign = if f0 < f1 { 1.0 } else { -1.0 };
        let most = (0.5 / precision).log2().ceil() as i32 + 1;
        let mut bracket = Bracket { a: 0.0, b: 1.0, fa: sign * f0, fb: sign * f1, sign, precision, step: 0, most };
        if bracket.fa.is_nan() || bracket.fb.is_nan() {
            bracket.end(0.5);
        }
        bracket
    }

    /// Where the value is wanted next; nothing once the root is found.
    pub fn ask(&self) -> Option<f64> {
        let Bracket { a, b, fa, fb, precision, .. } = *self;
        if self.step > self.most || b - a <= 2.0 * precision {
            return None;
        }
        let middle = (a + b) / 2.0;
        let room = (precision * 2f64.powi(self.most - self.step) - (b - a) / 2.0).max(0.0);
        let falsi = if fb > fa { (fb * a - fa * b) / (fb - fa) } else { middle };
        let direction = if middle >= falsi { 1.0 } else { -1.0 };
        let cut = CUT * (b - a) * (b - a);
        let truncated = if cut <= (middle - falsi).abs() { falsi + direction * cut } else { middle };
        let x = if (truncated - middle).abs() <= room { truncated } else { middle - direction * room };
        Some(x.clamp(a, b))
    }

    /// The value `f` at `x`, where it was asked for.
    pub fn tell(&mut self, x: f64, f: f64) {
        let f = self.sign * f;
        self.step += 1;
        if f > 0.0 {
            (self.b, self.fb) = (x, f);
        } else if f < 0.0 {
            (self.a, self.fa) = (x, f);
        } else if f == 0.0 {
            self.end(x);
        } else {
            // Unknown in between: the middle is as good as any other place.
            self.end((self.a + self.b) / 2.0);
        }
    }

    fn end(&mut self, x: f64) {
        (self.a, self.b) = (x, x);
    }

    /// The root.
    pub fn place(&self) -> f64 {
        (self.a + self.b) / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn root_of_a_smooth_function_takes_few_steps_and_of_a_jump_finds_it_to_1e_12() {
        let count = std::cell::Cell::new(0);
        let smooth = |t: f64| {
            count.set(count.get() + 1);
            (t * 1.3).exp() - 1.9
        };
        let t = root(smooth, smooth(0.0), smooth(1.0));
        assert!((t - 1.9f64.ln() / 1.3).abs() < 1e-12, "{t}");
        assert!(count.get() < 16, "{} steps", count.get());
        let jump = |t: f64| if t < 0.123456789 { -0.4 } else { 0.6 };
        assert!((root(jump, jump(0.0), jump(1.0)) - 0.123456789).abs() < 1e-12);
        assert!((root(|t| 0.7 - t, 0.7, -0.3) - 0.7).abs() < 1e-12);
    }
}
