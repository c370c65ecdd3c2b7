//! Volumes beside sharp edges: hits and normals from the side on which the numbers go on straight.
//!
//! Beside an edge of a body its distance is the greater or the lesser of two smooth ones. Differences that reach over the
//! place where one takes over from the other blend both gradients, and the linear hit of an edge of the lattice from one
//! to the other lies on neither surface. [H87] Harten, Engquist, Osher, Chakravarthy, *Uniformly High Order Accurate
//! Essentially Non-oscillatory Schemes III*: differences are taken from the side whose own second difference is the least.
//! [H89] Harten, *ENO Schemes with Subcell Resolution*: what is found left and right of a kink is carried on into the
//! cell and tells where the level is passed.
//!
//! Departs from [H87]: first order only; the two nodes of an edge choose together, as they see one surface; and a step
//! (second differences of opposite signs side by side, as in volumes of ones and zeros) is no kink.

use glam::DVec3;

/// Slopes and differences are those of a kink if they change by more than this within a step, as a fraction of the
/// gradient: surfaces whose radius is above ten steps bend by less.
const KINK_CHANGE: f64 = 0.1;
/// A side goes on straight if its own second difference is below this fraction of that at the kink.
const STRAIGHT_SHARE: f64 = 0.5;

/// True if numbers beside an edge of the lattice bend as they do at a kink.
/// * `below`, `above` - the numbers a step beside both ends of the edge
/// * `t` - place on the edge where the level is passed
/// * `rise` - what the numbers rise by in a step along the gradient
pub fn is_bent(below: [f64; 2], above: [f64; 2], t: f64, rise: f64) -> bool {
    let (low, high) = (below[0] + above[0], below[1] + above[1]);
    let twist = (above[1] - below[1]) - (above[0] - below[0]);
    (low + (high - low) * t).abs().max(twist.abs() / 2.0) > KINK_CHANGE * rise
}

/// The numbers around an edge of the lattice, at least two steps on all sides.
pub struct Around<'a, F: Fn(usize) -> f64> {
    /// The number of a node, less the level.
    pub get: &'a F,
    /// The ends of the edge.
    pub ends: [usize; 2],
    /// From a node to the next along each axis.
    pub stride: [usize; 3],
    /// Distance between nodes along each axis.
    pub step: DVec3,
    /// Axis of the edge.
    pub axis: usize,
}

impl<F: Fn(usize) -> f64> Around<'_, F> {
    /// Numbers from two steps below a node to two above.
    fn line(&self, n: usize, axis: usize) -> [f64; 5] {
        let s = self.stride[axis];
        [n - 2 * s, n - s, n, n + s, n + 2 * s].map(self.get)
    }

    /// Where the level is passed, and the gradient of the surface that passes it; the latter is NaN where numbers are
    /// not known.
    pub fn hit(&self) -> (f64, DVec3) {
        let (t, slope, piece) = self.along();
        let mut gradient = DVec3::ZERO;
        gradient[self.axis] = slope / self.step[self.axis];
        for a in [(self.axis + 1) % 3, (self.axis + 2) % 3] {
            let [low, high] = self.ends.map(|n| slopes(self.line(n, a)));
            // The one whose numbers bend least; of both ends together also the ones that agree best.
            let mut best = (f64::INFINITY, f64::NAN);
            let mut consider = |cost: f64, slope: f64| {
                if cost < best.0 {
                    best = (cost, slope);
                }
            };
            match piece {
                Some(end) => [low, high][end].iter().for_each(|s| consider(s.off, s.slope)),
                None => low.iter().for_each(|l| {
                    let slope = |h: &Slope| l.slope * (1.0 - t) + h.slope * t;
                    high.iter().for_each(|h| consider((l.slope - h.slope).abs() + l.off + h.off, slope(h)));
                }),
            }
            gradient[a] = best.1 / self.step[a];
        }
        (t, gradient)
    }

    /// Where the edge passes the level, with which slope, and if there is a kink between, on the piece of which end.
    fn along(&self) -> (f64, f64, Option<usize>) {
        let [low, high] = self.ends.map(|n| self.line(n, self.axis));
        let (f0, f1) = (low[2], high[2]);
        let (left, slope, right) = (f0 - low[1], f1 - f0, high[3] - f1);
        let linear = (f0 / (f0 - f1), slope, None);
        // Second differences at both ends, and beyond them.
        let (at, beyond) = ([slope - left, right - slope], [left - (low[1] - low[0]), (high[4] - high[3]) - right]);
        let straight = |k: usize| beyond[k].abs() < STRAIGHT_SHARE * at[k].abs();
        if !(at[0] * at[1] > 0.0 && straight(0) && straight(1)) {
            return linear;
        }
        // The greater of two lines that rise passes zero where the first of them does, the lesser where the last does.
        let first = at[0] * slope > 0.0;
        let never = if first { f64::INFINITY } else { f64::NEG_INFINITY };
        let passes = |slope: f64, t: f64| if slope * (f1 - f0) > 0.0 { t } else { never };
        let (l, r) = (passes(left, -f0 / left), passes(right, 1.0 - f1 / right));
        let found = if (l < r) == first { (l, left, Some(0)) } else { (r, right, Some(1)) };
        if found.0 > 0.0 && found.0 < 1.0 { found } else { linear }
    }
}

/// A difference at a node.
#[derive(Clone, Copy)]
struct Slope {
    slope: f64,
    /// How far it may be off.
    off: f64,
}

/// The mean of both differences at the middle one of five nodes, and each of them.
fn slopes(f: [f64; 5]) -> [Slope; 3] {
    let d = [f[1] - f[0], f[2] - f[1], f[3] - f[2], f[4] - f[3]];
    let (below, here, above) = (d[1] - d[0], d[2] - d[1], d[3] - d[2]);
    // Beside a step the other side bends back.
    let back = |other: f64| (-other * here.signum()).max(0.0);
    [
        Slope { slope: (d[1] + d[2]) / 2.0, off: STRAIGHT_SHARE * here.abs() },
        Slope { slope: d[1], off: below.abs() + back(above) },
        Slope { slope: d[2], off: above.abs() + back(below) },
    ]
}

#[cfg(test)]
mod tests {
    use super::super::{GradientRule, GridParams, ScalarGrid, sample_grid};
    use crate::Silent;
    use crate::geom::random;
    use glam::DVec3;
    use std::sync::Arc;

    const N: usize = 24;

    fn volume(value: impl Fn(DVec3) -> f64) -> ScalarGrid {
        let at = |v: usize| DVec3::new((v % N) as f64, (v / N % N) as f64, (v / N / N) as f64);
        let values = (0..N * N * N).map(|v| value(at(v)) as f32).collect();
        ScalarGrid { size: [N; 3], origin: DVec3::ZERO, spacing: DVec3::ONE, values: Arc::new(values) }
    }

    /// How far hits of the greater (`turn` 1) or the lesser (-1) of two planes are off the nearer of both, and the angle
    /// of their normals from that of the plane that they are on: how many are off by more than 1e-3 or 6 degrees, and of
    /// how many.
    fn off(gradient: GradientRule, turn: f64) -> [usize; 2] {
        let (mut off, mut all) = (0, 0);
        for seed in 0..20 {
            let r = |k: u64| random::unit(23, 8 * seed + k) - 0.5;
            let [a, b] = [0, 3].map(|k| DVec3::new(r(k), r(k + 1), r(k + 2)).normalize());
            let middle = DVec3::splat(N as f64 / 2.0);
            let parts = |p: DVec3| [a, b].map(|n| n.dot(p - middle) * turn);
            let grid = volume(|p| turn * parts(p)[0].max(parts(p)[1]));
            let field =
                sample_grid(&grid, &GridParams { gradient, close: false, ..Default::default() }, &Silent).unwrap();
            for axis in 0..3 {
                for row in 0..field.lattice.rows() {
                    for n in field.axes[axis].start[row]..field.axes[axis].start[row + 1] {
                        let (p, hit) = (field.position(axis, row, n as usize), field.axes[axis].hits[n as usize]);
                        // At the border the one-sided rule has too few numbers.
                        if p.min_element() < 4.0 || p.max_element() > N as f64 - 5.0 {
                            continue;
                        }
                        let [f, g] = parts(p);
                        let normal = if f > g { a } else { b };
                        let wrong = f.max(g).abs() > 1e-3 || hit.normal.distance(normal) > 0.1;
                        off += wrong as usize;
                        all += 1;
                    }
                }
            }
        }
        [off, all]
    }

    #[test]
    fn hits_of_two_planes_lie_on_one_of_them_with_its_normal_within_6_degrees() {
        for turn in [1.0, -1.0] {
            let [one_sided, all] = off(GradientRule::OneSided, turn);
            let [trilinear, _] = off(GradientRule::Trilinear, turn);
            assert!(one_sided == 0 && trilinear * 10 > all, "{one_sided}, {trilinear} of {all}");
        }
    }

    #[test]
    fn volumes_of_ones_and_zeros_and_of_spheres_of_twelve_steps_have_no_kinks() {
        let ball = |p: DVec3| p.distance(DVec3::splat(N as f64 / 2.0 + 0.3)) - 8.0;
        let zeros = volume(|p| if ball(p) < 0.0 { -0.5 } else { 0.5 });
        let far = volume(|p| p.distance(DVec3::splat(1.3)) - 14.0);
        for grid in [zeros, far] {
            let [a, b] = [GradientRule::OneSided, GradientRule::Trilinear]
                .map(|gradient| sample_grid(&grid, &GridParams { gradient, ..Default::default() }, &Silent).unwrap());
            assert!((0..3).all(|axis| a.axes[axis].hits == b.axes[axis].hits));
        }
    }
}
