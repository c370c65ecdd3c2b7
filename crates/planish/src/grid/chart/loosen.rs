//! Triangles that a chart squeezes flat, opened again.
//!
//! Tutte's map leaves no triangle turned over, but it may leave one that is wide on the surface a thousand times as
//! thin in the square: beside slivers of a boundary, and where single vertices had to be mended. Whatever is drawn straight
//! in the square then bends sharply on the surface. Here single vertices move, one after the other, to where the
//! triangles around them keep their shapes better (MIPS: Hormann and Greiner 2000, the sum of the squared stretches
//! over twice their product), which is without bound where a triangle turns over.

use super::Chart;
use super::locate::orientation;
use crate::mesh::Adjacency;
use glam::{DMat2, DVec2, DVec3};

/// Distortion of a triangle above which its corners move.
const SQUEEZED: f64 = 6.0;
/// Sweeps over such corners, and the part of their energy that a sweep has to win.
const LOOSEN_SWEEPS: usize = 60;
const LEAST_GAIN: f64 = 1e-3;
/// Halvings of a step.
const HALVINGS: usize = 12;

/// A triangle as one of its vertices sees it: the other two in the square, the cotangents across from them and from
/// the vertex (half of each), and its area on the surface.
struct Wing {
    ends: [DVec2; 2],
    cot: [f64; 3],
    area: f64,
}

impl Wing {
    /// Distortion with the vertex at `p`, and its gradient; nothing if the triangle turns over.
    fn distortion(&self, p: DVec2) -> Option<(f64, DVec2, f64)> {
        let [a, b] = self.ends;
        if orientation(p, a, b) <= 0.0 {
            return None;
        }
        let double = (a - p).perp_dot(b - p);
        let [ca, cb, cp] = self.cot;
        let f =
            (cb * (p - a).length_squared() + ca * (p - b).length_squared() + cp * (a - b).length_squared()) / double;
        let by_double = (b - a).perp();
        let gradient = ((p - a) * cb + (p - b) * ca) * 2.0 - by_double * f;
        Some((f, gradient / double, 2.0 * (ca + cb) / double)).filter(|x| x.0.is_finite())
    }
}

/// Opens the squeezed triangles of `chart`, whose sides are `lengths` long along u and v.
pub fn loosen(chart: &mut Chart, boundary: &[bool], lengths: DVec2) {
    let adjacency = Adjacency::of(&chart.triangles, chart.points.len());
    let shapes: Vec<([f64; 3], f64)> =
        chart.triangles.iter().map(|t| shape(t.map(|v| chart.points[v as usize]))).collect();
    let total: f64 = shapes.iter().map(|s| s.1).sum();
    let wings = |chart: &Chart, v: u32| -> Vec<Wing> {
        let wing = |h: u32| {
            let (t, k) = (h as usize / 3, h as usize % 3);
            let at = |k: usize| chart.uv[chart.triangles[t][k % 3] as usize] * lengths;
            let (cot, area) = shapes[t];
            Wing { ends: [at(k + 1), at(k + 2)], cot: [cot[(k + 1) % 3], cot[(k + 2) % 3], cot[k]], area: area / total }
        };
        adjacency.fan(v).map(wing).collect()
    };
    let energy = |wings: &[Wing], p: DVec2| -> Option<f64> {
        wings.iter().map(|w| w.distortion(p).map(|d| w.area * d.0 * d.0)).sum()
    };
    for _ in 0..LOOSEN_SWEEPS {
        let (mut before, mut after) = (0.0, 0.0);
        for v in (0..chart.points.len() as u32).filter(|&v| !boundary[v as usize]) {
            let wings = wings(chart, v);
            let start = chart.uv[v as usize] * lengths;
            let worst = wings.iter().map(|w| w.distortion(start).map_or(f64::INFINITY, |d| d.0)).fold(0.0, f64::max);
            if worst < SQUEEZED {
                continue;
            }
            let Some(e) = energy(&wings, start) else { continue };
            let mut gradient = DVec2::ZERO;
            let mut curvature = DMat2::ZERO;
            for w in &wings {
                let Some((f, g, c)) = w.distortion(start) else { continue };
                gradient += g * (w.area * f);
                curvature +=
                    DMat2::from_cols(g * g.x, g * g.y) * w.area + DMat2::from_diagonal(DVec2::splat(c * f * w.area));
            }
            let step = -(curvature.inverse() * gradient);
            before += e;
            let mut reached = e;
            for halving in 0..HALVINGS {
                let p = start + step * 0.5f64.powi(halving as i32);
                if let Some(trial) = energy(&wings, p).filter(|t| *t < e)
                    && wings.iter().all(|w| orientation(p / lengths, w.ends[0] / lengths, w.ends[1] / lengths) > 0.0)
                {
                    chart.uv[v as usize] = p / lengths;
                    reached = trial;
                    break;
                }
            }
            after += reached;
        }
        if after >= before * (1.0 - LEAST_GAIN) {
            break;
        }
    }
}

/// Half the cotangents of a triangle's corners, and its area.
fn shape(p: [DVec3; 3]) -> ([f64; 3], f64) {
    let double = (p[1] - p[0]).cross(p[2] - p[0]).length();
    let cot = |k: usize| (p[(k + 1) % 3] - p[k]).dot(p[(k + 2) % 3] - p[k]) / double.max(f64::MIN_POSITIVE) / 2.0;
    ([cot(0), cot(1), cot(2)], double / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::chart::tests::chart;

    #[test]
    fn triangles_squeezed_to_a_500th_are_distorted_by_less_than_6_afterwards() {
        let mut flat = chart(|s, t| DVec3::new(s, t, 0.0));
        let boundary: Vec<bool> = flat.points.iter().map(|p| p.x * (1.0 - p.x) * p.y * (1.0 - p.y) < 1e-9).collect();
        let worst = |chart: &Chart| {
            let distortion = |t: &[u32; 3]| {
                let (cot, _) = shape(t.map(|v| chart.points[v as usize]));
                let [p, a, b] = t.map(|v| chart.uv[v as usize]);
                Wing { ends: [a, b], cot: [cot[1], cot[2], cot[0]], area: 1.0 }
                    .distortion(p)
                    .map_or(f64::INFINITY, |d| d.0)
            };
            chart.triangles.iter().map(distortion).fold(0.0, f64::max)
        };
        // The vertex in the middle, 1/20 from the next.
        flat.uv[10 * 21 + 10].x += 0.0499;
        assert!(worst(&flat) > 200.0);
        loosen(&mut flat, &boundary, DVec2::ONE);
        assert!(worst(&flat) < SQUEEZED, "{}", worst(&flat));
    }

    #[test]
    fn a_sheet_that_is_nowhere_squeezed_keeps_its_bits_whatever_its_sides() {
        let mut wide = chart(|s, t| DVec3::new(8.0 * s, t, 0.3 * s * s));
        let before = wide.uv.clone();
        let boundary = vec![false; before.len()];
        loosen(&mut wide, &boundary, DVec2::new(8.0, 1.0));
        assert_eq!(wide.uv, before);
    }
}
