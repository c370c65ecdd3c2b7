//! Which triangle of a chart holds a point: a visibility walk with exact orientations.
//!
//! Devillers, Pion, Teillaud, *Walking in a Triangulation*, 2002.

use super::Chart;
use crate::mesh::NONE;
use glam::DVec2;
use robust::{Coord, orient2d};

/// Twice the signed area of three chart points, its sign exact.
pub fn orientation(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let coord = |p: DVec2| Coord { x: p.x, y: p.y };
    orient2d(coord(a), coord(b), coord(c))
}

/// A triangle of the chart and the weights of its corners (not negative, sum one).
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// Triangle of the chart.
    pub triangle: u32,
    /// Weights of its corners.
    pub bary: [f64; 3],
}

impl Spot {
    /// The spot with weights proportional to `areas`, negative ones taken as zero.
    fn of(triangle: u32, areas: [f64; 3]) -> Spot {
        let w = areas.map(|a| a.max(0.0));
        let sum = w[0] + w[1] + w[2];
        Spot { triangle, bary: if sum > 0.0 { w.map(|a| a / sum) } else { [1.0 / 3.0; 3] } }
    }
}

impl Chart {
    /// The triangle that holds `p`, walking from triangle `hint`. The chart is a triangulated unit square, so the
    /// walk leaves it only for a point outside; that point then gets the nearest place of the last triangle.
    pub fn locate(&self, p: DVec2, hint: u32) -> Spot {
        let mut t = hint;
        let mut entered = NONE;
        // A visibility walk may run in circles where the triangulation is not Delaunay; turning the order of the
        // edges from step to step breaks the circles, and the scan below ends those that remain.
        let limit = 64 + 8 * (self.triangles.len() as f64).sqrt() as usize;
        for step in 0..limit {
            let [a, b, c] = self.triangles[t as usize].map(|v| self.uv[v as usize]);
            let corners = [a, b, c];
            let turn = (step.wrapping_mul(0x9E37_79B9) >> 7) % 3;
            let mut areas = [0.0; 3];
            let mut out = NONE;
            for k in 0..3 {
                let k = (k + turn) % 3;
                let area = orientation(corners[k], corners[(k + 1) % 3], p);
                areas[(k + 2) % 3] = area;
                let h = 3 * t + k as u32;
                if area < 0.0 && h != entered {
                    out = h;
                    break;
                }
            }
            if out == NONE || self.opposite[out as usize] == NONE {
                if out != NONE {
                    areas = areas_of(corners, p);
                }
                return Spot::of(t, areas);
            }
            entered = self.opposite[out as usize];
            t = entered / 3;
        }
        self.scan(p)
    }

    /// The triangle that holds `p`, by looking at all: the one whose smallest area is largest.
    fn scan(&self, p: DVec2) -> Spot {
        let mut best = (f64::NEG_INFINITY, 0, [0.0; 3]);
        for (t, triangle) in self.triangles.iter().enumerate() {
            let areas = areas_of(triangle.map(|v| self.uv[v as usize]), p);
            let least = areas[0].min(areas[1]).min(areas[2]);
            if least > best.0 {
                best = (least, t as u32, areas);
            }
            if least >= 0.0 {
                break;
            }
        }
        Spot::of(best.1, best.2)
    }
}

fn areas_of([a, b, c]: [DVec2; 3], p: DVec2) -> [f64; 3] {
    [orientation(b, c, p), orientation(c, a, p), orientation(a, b, p)]
}
