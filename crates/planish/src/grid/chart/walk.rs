//! Walks over a chart: straight in the square, to measure curves, and straight on the surface, to move points.
//!
//! MovePointOnSurface of [K98] appendix A, within the chart of a patch.

use super::Chart;
use super::locate::{Spot, orientation};
use crate::mesh::{NONE, next, previous};
use glam::{DVec2, DVec3};

impl Chart {
    /// Place of a spot in the square.
    pub fn uv_of(&self, spot: Spot) -> DVec2 {
        let [a, b, c] = self.triangles[spot.triangle as usize].map(|v| self.uv[v as usize]);
        a * spot.bary[0] + b * spot.bary[1] + c * spot.bary[2]
    }

    /// Visits the surface along the straight segment from `p` (in triangle `start`) to `q` in the square: calls
    /// `visit` with the fraction of the segment and the position wherever it crosses an edge, ends excluded.
    pub fn trace(&self, p: DVec2, start: u32, q: DVec2, visit: &mut dyn FnMut(f64, DVec3)) {
        self.cross(p, start, q, &mut |fraction, h, w| {
            let [a, b] = [h, next(h)].map(|h| self.points[self.tail(h) as usize]);
            visit(fraction, a.lerp(b, w));
        });
    }

    /// The spots where the straight segment from `p` (in triangle `start`) to `q` in the square crosses edges, in their order.
    pub fn crossings(&self, p: DVec2, start: u32, q: DVec2) -> Vec<Spot> {
        let mut spots = Vec::new();
        self.cross(p, start, q, &mut |_, h, w| {
            let mut bary = [0.0; 3];
            bary[h as usize % 3] = 1.0 - w;
            bary[next(h) as usize % 3] = w;
            spots.push(Spot { triangle: h / 3, bary });
        });
        spots
    }

    fn tail(&self, h: u32) -> u32 {
        self.triangles[h as usize / 3][h as usize % 3]
    }

    /// Calls `visit` with the fraction of the segment, the half-edge that it crosses, and the share of that.
    fn cross(&self, p: DVec2, start: u32, q: DVec2, visit: &mut dyn FnMut(f64, u32, f64)) {
        let line = q - p;
        let square = line.length_squared();
        if square == 0.0 {
            return;
        }
        let side = |v: u32| line.perp_dot(self.uv[v as usize] - p);
        let beyond = |h: u32| {
            let t = &self.triangles[h as usize / 3];
            let (a, b) = (t[h as usize % 3], t[next(h) as usize % 3]);
            orientation(self.uv[a as usize], self.uv[b as usize], q) < 0.0
        };
        let tail = |h: u32| self.tail(h);
        let mut out = NONE;
        for h in 3 * start..3 * start + 3 {
            if beyond(h) && side(tail(h)) <= 0.0 && side(tail(next(h))) >= 0.0 {
                out = h;
            }
        }
        for _ in 0..self.triangles.len() {
            if out == NONE {
                return;
            }
            let (a, b) = (tail(out), tail(next(out)));
            let (below, above) = (side(a), side(b));
            let w = if above > below { (-below / (above - below)).clamp(0.0, 1.0) } else { 0.5 };
            let at = self.uv[a as usize].lerp(self.uv[b as usize], w);
            let fraction = (at - p).dot(line) / square;
            visit(fraction.clamp(0.0, 1.0), out, w);
            let entered = self.opposite[out as usize];
            if entered == NONE {
                return;
            }
            let (one, two) = (next(entered), previous(entered));
            // The line enters between the apex and one end of the edge; it leaves across the edge on its side.
            let exit = if side(tail(two)) > 0.0 { one } else { two };
            out = if beyond(exit) { exit } else { NONE };
        }
    }

    /// Moves from `from` straight over the surface by `step`, a vector near the tangent plane: laid into the
    /// triangle with its length kept and unfolded over every edge (MovePointOnSurface of [K98]). Ends at
    /// the boundary, and after as many triangles as the chart has: it goes around a spike then.
    pub fn advance(&self, from: Spot, step: DVec3) -> Spot {
        let mut spot = from;
        let mut left = step.length();
        let mut direction = step;
        let mut entered = 3;
        for _ in 0..self.triangles.len() {
            let corners = self.triangles[spot.triangle as usize].map(|v| self.points[v as usize]);
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a);
            let square = normal.length_squared();
            let flat = direction - normal * (direction.dot(normal) / square);
            let d = flat.normalize_or_zero() * left;
            // Rates of the three weights along d.
            let rates = [(c - b).cross(d), (a - c).cross(d), (b - a).cross(d)].map(|w| w.dot(normal) / square);
            if !rates.iter().all(|r| r.is_finite()) || left == 0.0 {
                return spot;
            }
            let mut hit = (1.0, 3);
            for k in (0..3).filter(|&k| k != entered && rates[k] < 0.0) {
                let t = spot.bary[k] / -rates[k];
                if t < hit.0 {
                    hit = (t, k);
                }
            }
            let (t, k) = hit;
            for (weight, rate) in spot.bary.iter_mut().zip(rates) {
                *weight = (*weight + t * rate).max(0.0);
            }
            if k == 3 {
                let sum: f64 = spot.bary.iter().sum();
                spot.bary = spot.bary.map(|w| w / sum);
                return spot;
            }
            spot.bary[k] = 0.0;
            let sum: f64 = spot.bary.iter().sum();
            spot.bary = spot.bary.map(|w| w / sum);
            let out = 3 * spot.triangle + (k as u32 + 1) % 3;
            let opposite = self.opposite[out as usize];
            if opposite == NONE {
                return spot;
            }
            let (i, j) = (out as usize % 3, next(out) as usize % 3);
            let edge = (corners[j] - corners[i]).normalize_or_zero();
            left *= 1.0 - t;
            let along = d.dot(edge) / d.length();
            let g = opposite as usize % 3;
            let apex = self.points[self.triangles[opposite as usize / 3][(g + 2) % 3] as usize] - corners[i];
            let inward = (apex - edge * apex.dot(edge)).normalize_or_zero();
            direction = edge * along + inward * (1.0 - along * along).max(0.0).sqrt();
            let mut bary = [0.0; 3];
            bary[g] = spot.bary[j];
            bary[(g + 1) % 3] = spot.bary[i];
            spot = Spot { triangle: opposite / 3, bary };
            entered = (g + 2) % 3;
        }
        spot
    }
}

#[cfg(test)]
mod tests {
    use crate::DVec3;
    use crate::grid::chart::tests::chart;

    #[test]
    fn a_step_over_a_flat_sheet_lands_at_the_sum_within_1e_12() {
        let chart = chart(|s, t| DVec3::new(s, t, 0.0));
        let from = chart.locate(glam::DVec2::new(0.21, 0.33), 0);
        let step = DVec3::new(0.512, 0.247, 0.0);
        let want = chart.position(from) + step;
        assert!(chart.position(chart.advance(from, step)).distance(want) < 1e-12);
    }

    #[test]
    fn a_step_around_a_cylinder_keeps_its_height_and_its_length_within_1_percent() {
        let turn = |a: f64, z: f64| DVec3::new(-a.cos(), z, a.sin());
        let chart = chart(|s, t| turn(2.0 * s, t));
        let from = chart.locate(glam::DVec2::new(0.25, 0.5), 0);
        let there = chart.position(chart.advance(from, DVec3::new(0.5f64.sin(), 0.0, 0.5f64.cos())));
        // One unit of arc from the angle 0.5.
        assert!(there.distance(turn(1.5, 0.5)) < 0.01, "{there}");
    }

    #[test]
    fn a_step_beyond_the_rim_ends_on_it() {
        let chart = chart(|s, t| DVec3::new(s, t, 0.0));
        let from = chart.locate(glam::DVec2::new(0.9, 0.41), 0);
        let there = chart.position(chart.advance(from, DVec3::new(5.0, 0.0, 0.0)));
        assert!(there.distance(DVec3::new(1.0, 0.41, 0.0)) < 1e-12, "{there}");
    }

    #[test]
    fn a_trace_measures_a_roof_of_two_slopes_within_1e_12() {
        // Slopes of 45 degrees: the length over the ridge is the square root of 2 times the run.
        let chart = chart(|s, t| DVec3::new(s, t, 0.5 - (s - 0.5).abs()));
        let (p, q) = (glam::DVec2::new(0.03, 0.5), glam::DVec2::new(0.93, 0.5));
        let (a, b) = (chart.locate(p, 0), chart.locate(q, 0));
        let mut last = chart.position(a);
        let run = chart.position(b).x - last.x;
        let mut sum = 0.0;
        chart.trace(p, a.triangle, q, &mut |_, x| {
            sum += last.distance(x);
            last = x;
        });
        sum += last.distance(chart.position(b));
        assert!((sum - run * 2f64.sqrt()).abs() < 1e-12, "{sum}");
    }
}
