//! Charts: small pieces of a mesh that do not reach over a bend, and the surface that each is a sample of.
//!
//! A chart is what is nearest to a seed, where a way over a bend is longer; seeds are the farthest points from those
//! before (Gonzalez 1985; on meshes Moenning, Dodgson 2003). The surface is a quadric over the chart's own plane.

use super::flanks::{Estimate, Moments};
use super::lines::Lines;
use crate::geom::graph::{Dense, Search};
use crate::mesh::{NONE, next};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BinaryHeap;

/// A chart reaches so many cells from its seed: a dozen cells determine the six terms of a quadric, and a hole of that radius
/// is covered by six charts.
pub(super) const RADIUS_CELLS: f64 = 6.0;

/// For each half-edge the angle between the faces beside it, radians; 0 at the boundary.
pub(super) fn bends(lines: &Lines) -> Vec<f64> {
    let between = |h: usize| match lines.adjacency.opposite[h] {
        NONE => 0.0,
        o => {
            let [m, n] = [h / 3, o as usize / 3].map(|f| lines.areas[f]);
            m.cross(n).length().atan2(m.dot(n))
        }
    };
    (0..lines.adjacency.opposite.len()).into_par_iter().map(between).collect()
}

/// For each face the chart that it is in, and how many charts there are.
/// * `bends` - angles between faces; * `sharp` - a bend by this angle is as far as a whole chart
pub(super) fn charts(lines: &Lines, bends: &[f64], sharp: f64, cell: f64) -> (Vec<u32>, u32) {
    let faces = lines.centers.len();
    let radius = RADIUS_CELLS * cell;
    let mut reached = Dense::new(faces);
    let mut chart = vec![NONE; faces];
    let mut count = 0;
    // The farthest face; entries are out of date where the distance fell since.
    let mut far: BinaryHeap<(u64, std::cmp::Reverse<u32>)> = BinaryHeap::new();
    let key = |d: f64| if d.is_finite() { d.to_bits() } else { u64::MAX };
    let is_calm = |f: usize| (3 * f..3 * f + 3).all(|h| bends[h] < sharp);
    // Faces between bends are no seeds unless nothing else reaches them.
    (0..faces).filter(|&f| is_calm(f)).for_each(|f| far.push((u64::MAX, std::cmp::Reverse(f as u32))));
    let mut rest = 0;
    loop {
        let seed = match far.pop() {
            Some((was, std::cmp::Reverse(f))) => {
                let now = key(reached.distance[f as usize]);
                if now != was {
                    far.push((now, std::cmp::Reverse(f)));
                    continue;
                }
                if reached.distance[f as usize] <= radius {
                    far.clear();
                    continue;
                }
                f
            }
            None => {
                while rest < faces && chart[rest] != NONE {
                    rest += 1;
                }
                if rest == faces {
                    return (chart, count);
                }
                rest as u32
            }
        };
        let mut search = Search::over(&mut reached);
        search.reach(seed, 0.0, NONE);
        while let Some((f, distance)) = search.settle() {
            chart[f as usize] = count;
            for h in 3 * f..3 * f + 3 {
                let o = lines.adjacency.opposite[h as usize];
                if o != NONE {
                    let step = lines.centers[f as usize].distance(lines.centers[o as usize / 3]);
                    let turn = bends[h as usize] / sharp;
                    search.reach(o / 3, distance + step + radius * turn * turn, f);
                }
            }
        }
        count += 1;
    }
}

/// The surface that a chart is a sample of.
#[derive(Clone)]
pub(super) struct Surface {
    at: DVec3,
    axes: [DVec3; 3],
    estimate: Estimate,
    cell: f64,
}

impl Surface {
    /// The quadric, or plane, nearest to faces by their areas; `None` if they do not determine one.
    /// * `weight` - of a face in the fit
    pub fn fit(lines: &Lines, faces: &[u32], cell: f64, weight: impl Fn(u32) -> f64) -> Option<Surface> {
        let of = |f: u32| lines.areas[f as usize].length() * weight(f);
        let whole: f64 = faces.iter().map(|&f| of(f)).sum();
        let at = faces.iter().map(|&f| lines.centers[f as usize] * of(f)).sum::<DVec3>() / whole;
        let normal = faces.iter().map(|&f| lines.areas[f as usize] * weight(f)).sum::<DVec3>().try_normalize()?;
        let x = normal.any_orthonormal_vector();
        let axes = [x, normal.cross(x), normal];
        let mut sums = Moments::default();
        for &f in faces {
            let p = (lines.centers[f as usize] - at) / cell;
            sums.add(p.dot(axes[0]), p.dot(axes[1]), p.dot(axes[2]), of(f) / (cell * cell));
        }
        let terms = if whole > FEWEST_QUADRIC_CELLS * cell * cell { 6 } else { 3 };
        let estimate = sums.fit(terms, 1.0).or_else(|| sums.fit(3, 1.0))?;
        at.is_finite().then_some(Surface { at, axes, estimate, cell })
    }

    /// How far a place is from the surface, to first order, positive outside, and the unit normal beside it.
    pub fn beside(&self, p: DVec3) -> (f64, DVec3) {
        let d = (p - self.at) / self.cell;
        let (height, normal) = self.estimate.beside(d.dot(self.axes[0]), d.dot(self.axes[1]), self.axes);
        ((d.dot(self.axes[2]) - height) * self.cell * normal.dot(self.axes[2]), normal)
    }
}

/// A quadric needs so many cells of area: two for each of its terms.
const FEWEST_QUADRIC_CELLS: f64 = 12.0;

/// The vertices of a half-edge.
pub(super) fn ends(lines: &Lines, h: u32) -> [u32; 2] {
    [lines.mesh.origin(h), lines.mesh.origin(next(h))]
}
