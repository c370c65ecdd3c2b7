//! A surface as Bézier patches, one for each knot span.
//!
//! A Bézier point is the polar form of the span's cubic at ends of the span (Ramshaw 1989, *Blossoms are polar forms*, §6).

use crate::surface::Surface;
use glam::DVec3;

/// A bicubic Bézier patch.
#[derive(Clone, Copy)]
pub(super) struct Bezier {
    /// Control points, `[along v][along u]`.
    pub net: [[DVec3; 4]; 4],
    /// Where it begins and ends in the parameters of its surface.
    pub u: [f64; 2],
    pub v: [f64; 2],
}

impl Bezier {
    /// Differences along `u`, a third of the derivative: degree 2 along `u`, 3 along `v`.
    pub fn along_u(&self) -> [[DVec3; 3]; 4] {
        self.net.map(|row| std::array::from_fn(|i| row[i + 1] - row[i]))
    }

    /// Differences along `v`.
    pub fn along_v(&self) -> [[DVec3; 4]; 3] {
        std::array::from_fn(|j| std::array::from_fn(|i| self.net[j + 1][i] - self.net[j][i]))
    }

    /// Its four quarters (de Casteljau's scheme at the middle).
    pub fn quarters(&self) -> [Bezier; 4] {
        let middle = |r: [f64; 2]| (r[0] + r[1]) / 2.0;
        let ranges = |r: [f64; 2]| [[r[0], middle(r)], [middle(r), r[1]]];
        let (us, vs) = (ranges(self.u), ranges(self.v));
        let halves = |net: &[[DVec3; 4]; 4]| {
            let cut = net.map(halved);
            [cut.map(|c| c[0]), cut.map(|c| c[1])]
        };
        let [left, right] = halves(&self.net).map(|half| halves(&turned(&half)).map(|net| turned(&net)));
        let part = |net: [[DVec3; 4]; 4], a: usize, b: usize| Bezier { net, u: us[a], v: vs[b] };
        [part(left[0], 0, 0), part(right[0], 1, 0), part(left[1], 0, 1), part(right[1], 1, 1)]
    }

    /// Bounds of the second derivatives by `uu`, `uv` and `vv` in the parameters of the surface.
    pub fn bends(&self) -> [f64; 3] {
        let (along_u, along_v) = (self.along_u(), self.along_v());
        let longest = |steps: &mut dyn Iterator<Item = DVec3>| steps.map(DVec3::length).fold(0.0, f64::max);
        let uu = longest(&mut along_u.iter().flat_map(|r| [r[1] - r[0], r[2] - r[1]]));
        let uv = longest(&mut along_v.iter().flat_map(|r| [r[1] - r[0], r[2] - r[1], r[3] - r[2]]));
        let vv = longest(&mut (0..4).flat_map(|i| [along_v[1][i] - along_v[0][i], along_v[2][i] - along_v[1][i]]));
        let (hu, hv) = (self.u[1] - self.u[0], self.v[1] - self.v[0]);
        [6.0 * uu / (hu * hu), 9.0 * uv / (hu * hv), 6.0 * vv / (hv * hv)]
    }
}

/// Both halves of a cubic.
fn halved(p: [DVec3; 4]) -> [[DVec3; 4]; 2] {
    let [a, b, c] = std::array::from_fn(|k| (p[k] + p[k + 1]) / 2.0);
    let [d, e] = [(a + b) / 2.0, (b + c) / 2.0];
    let middle = (d + e) / 2.0;
    [[p[0], a, d, middle], [middle, e, c, p[3]]]
}

fn turned(net: &[[DVec3; 4]; 4]) -> [[DVec3; 4]; 4] {
    std::array::from_fn(|i| std::array::from_fn(|j| net[j][i]))
}

/// A knot span: where it is, its first control point, and the weights of four control points in its four Bézier points.
struct Span {
    range: [f64; 2],
    first: usize,
    weights: [[f64; 4]; 4],
}

fn spans(knots: &[f64]) -> Vec<Span> {
    let control = knots.len() - 4;
    let span = |s: usize| {
        let [a, b] = [knots[s], knots[s + 1]];
        let weights = [[a, a, a], [a, a, b], [a, b, b], [b, b, b]].map(|args| blossom(knots, s, args));
        Span { range: [a, b], first: s - 3, weights }
    };
    (3..control).filter(|&s| knots[s] < knots[s + 1]).map(span).collect()
}

/// Weights of control points `s - 3 ..= s` in the polar form of the cubic on span `s`.
fn blossom(knots: &[f64], s: usize, args: [f64; 3]) -> [f64; 4] {
    let mut d: [[f64; 4]; 4] = std::array::from_fn(|k| std::array::from_fn(|i| if i == k { 1.0 } else { 0.0 }));
    for (r, x) in (1..4).zip(args) {
        for j in (r..4).rev() {
            let i = s - 3 + j;
            let share = (x - knots[i]) / (knots[i + 4 - r] - knots[i]);
            d[j] = std::array::from_fn(|k| d[j - 1][k] * (1.0 - share) + d[j][k] * share);
        }
    }
    d[3]
}

/// The Bézier patches of a surface, row by row of its knot spans.
pub(super) fn patches(surface: &Surface) -> Vec<Bezier> {
    let (us, vs) = (spans(&surface.knots_u), spans(&surface.knots_v));
    let mut all = Vec::with_capacity(us.len() * vs.len());
    for v in &vs {
        for u in &us {
            let sum = |at: &dyn Fn(usize) -> DVec3, w: &[f64; 4]| -> DVec3 { (0..4).map(|k| at(k) * w[k]).sum() };
            let rows: [[DVec3; 4]; 4] = std::array::from_fn(|j| {
                let row = &surface.control[(v.first + j) * surface.cols + u.first..];
                u.weights.map(|w| sum(&|k| row[k], &w))
            });
            let net = v.weights.map(|w| std::array::from_fn(|i| sum(&|k| rows[k][i], &w)));
            all.push(Bezier { net, u: u.range, v: v.range });
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::basis::Knots;

    #[test]
    fn corners_of_pieces_and_of_their_quarters_lie_on_the_surface_to_rounding() {
        let at = |i: usize, j: usize| DVec3::new(i as f64, j as f64, ((3 * i + 5 * j) % 7) as f64 / 3.0);
        let control = (0..6).flat_map(|j| (0..8).map(move |i| at(i, j))).collect();
        let knots_u = Knots::double(8).list().to_vec();
        let surface = Surface { rows: 6, cols: 8, control, knots_u, knots_v: Knots::uniform(6).list().to_vec() };
        let all = patches(&surface);
        assert_eq!(all.len(), 3 * 3);
        for piece in all.iter().flat_map(Bezier::quarters) {
            for (a, b) in [(0, 0), (3, 0), (0, 3), (3, 3)] {
                let off = piece.net[b][a].distance(surface.jet(piece.u[a / 3], piece.v[b / 3]).point);
                assert!(off < 1e-14 * 16.0, "{off}");
            }
            let jet = surface.jet(piece.u[0] * (1.0 + 1e-12) + 1e-12, piece.v[0] + 1e-12);
            let [uu, uv, vv] = piece.bends();
            assert!(jet.uu.length() <= uu * 1.001 && jet.uv.length() <= uv * 1.001 && jet.vv.length() <= vv * 1.001);
        }
    }
}
