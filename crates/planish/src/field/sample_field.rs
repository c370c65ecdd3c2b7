//! Samples as a field: a blend of cells, each a sheet or nested maxima and minima of sheets.
//!
//! [X03] Xie et al. 2003, §4.2 eq. 4: modified Shepard blend of the local quadrics. Ohtake et al., *Multi-level Partition
//! of Unity Implicits*, 2003: near edges and corners the blended functions are themselves maxima and minima.
//! * value: weighted mean of the cells whose support holds the point
//! * gradient: that of the sheets that decide in these cells, the heaviest side of an edge alone
//!
//! Departs from [X03]: one blend over all quadrics rounds every crease by the width of the supports. Far from all samples
//! the field is unknown, or, where holes are to be closed, follows the winding number of the samples.

use super::Field;
use crate::cloud::{Cell, Dipoles, Samples};
use crate::geom::Aabb;
use glam::DVec3;
use rayon::prelude::*;

/// Normals of cells that differ by less than this cosine are one side of an edge.
const SAME: f64 = 0.85;
/// The pseudo-distance changes by at most this much per length near the surface.
const STEEP: f64 = 1.5;
/// From this share of the support on a point is beside the data.
const BESIDE: f64 = 0.5;
/// The winding number decides where it is this far from one half.
const CERTAIN: f64 = 0.3;
/// Cells in a leaf of the tree.
const LEAF: usize = 4;
/// Cells at one point whose normals are told apart.
const ASKED: usize = 64;

/// The blended field of oriented samples.
pub struct SampleField {
    /// In the order of the tree.
    cells: Vec<Cell>,
    nodes: Vec<Node>,
    bounds: Aabb,
    /// Widest support.
    widest: f64,
    noise_deg: f64,
    /// Winding number of the samples, where holes are closed.
    closing: Option<Dipoles>,
}

/// A node of the tree over the supports, in preorder; the left child follows it.
#[derive(Clone, Copy)]
struct Node {
    low: DVec3,
    high: DVec3,
    start: u32,
    count: u32,
    /// Node of the right child; 0 for a leaf.
    right: u32,
}

impl SampleField {
    /// The field of `samples`. With `close`, places without data get their side from the winding number.
    pub fn new(samples: &Samples, close: bool) -> SampleField {
        let mut cells = samples.cells.clone();
        let mut nodes = Vec::new();
        if !cells.is_empty() {
            build(&mut cells, 0, &mut nodes);
        }
        let widest = cells.iter().map(|s| s.support).fold(0.0, f64::max);
        let mut bounds = Aabb::of(samples.samples.iter().map(|s| &s.center));
        bounds.min -= DVec3::splat(0.5 * widest);
        bounds.max += DVec3::splat(0.5 * widest);
        let closing = close.then(|| {
            Dipoles::new(&samples.samples.iter().map(|s| (s.center, s.normal * s.area)).collect::<Vec<_>>())
        });
        SampleField { cells, nodes, bounds, widest, noise_deg: samples.normal_noise_deg, closing }
    }

    /// Calls `visit(index, squared distance over squared support)` for all cells whose support holds `p`.
    fn around(&self, p: DVec3, mut visit: impl FnMut(usize, f64)) {
        let mut stack = [0u32; 64];
        let mut top = usize::from(!self.nodes.is_empty());
        while top > 0 {
            top -= 1;
            let id = stack[top];
            let node = &self.nodes[id as usize];
            if (p.cmplt(node.low) | p.cmpgt(node.high)).any() {
                continue;
            }
            if node.right == 0 {
                for i in node.start as usize..(node.start + node.count) as usize {
                    let c = &self.cells[i];
                    let t2 = c.center.distance_squared(p) / (c.support * c.support);
                    if t2 < 1.0 {
                        visit(i, t2);
                    }
                }
            } else {
                stack[top] = node.right;
                stack[top + 1] = id + 1;
                top += 2;
            }
        }
    }

    /// Value and unit normal of a cell.
    fn cell(&self, i: usize, p: DVec3) -> (f64, DVec3) {
        let c = &self.cells[i];
        let sheets = &c.sheets;
        let mut best = sheets[0].distance(p);
        for k in 1..c.count as usize {
            let next = sheets[k].distance(p);
            if (next.0 < best.0) == (c.concave >> k & 1 == 1) {
                best = next;
            }
        }
        best
    }

    /// Value and unit gradient at `p`; NaN where nothing is known.
    pub fn evaluate(&self, p: DVec3) -> (f64, DVec3) {
        let mut seen = [(0.0, DVec3::ZERO); ASKED];
        let mut count = 0;
        let (mut sum, mut weight, mut closest) = (0.0, 0.0, 1.0f64);
        self.around(p, |i, t2| {
            let (d, n) = self.cell(i, p);
            if d.is_finite() {
                // C2 at the rim; a steep bell, so that a point hears the cells beside it.
                let w = (1.0 - t2).powi(4) * self.cells[i].trust;
                sum += w * d;
                weight += w;
                closest = closest.min(t2);
                if count < ASKED {
                    seen[count] = (w, n);
                    count += 1;
                }
            }
        });
        if !(weight > 0.0) {
            return self.beyond(p);
        }
        let value = sum / weight;
        let seen = &seen[..count];
        let lead = seen.iter().fold(seen[0], |a, b| if b.0 > a.0 { *b } else { a }).1;
        let normal: DVec3 = seen.iter().filter(|s| s.1.dot(lead) > SAME).map(|s| s.0 * s.1).sum();
        let normal = normal.normalize_or(lead);
        // Away from the data the samples together know better than a fit carried on beyond its points.
        if closest > BESIDE * BESIDE
            && let Some(dipoles) = &self.closing
        {
            let winding = dipoles.number(p, 0.0);
            let outside = winding < 0.5;
            if outside != (value >= 0.0) && (winding - 0.5).abs() > CERTAIN {
                let size = value.abs().max(0.01 * self.widest);
                return (if outside { size } else { -size }, normal);
            }
        }
        (value, normal)
    }

    /// Where no cell reaches.
    fn beyond(&self, p: DVec3) -> (f64, DVec3) {
        match &self.closing {
            None => (f64::NAN, DVec3::ZERO),
            Some(dipoles) => {
                let value = |p: DVec3| (0.5 - dipoles.number(p, 0.0)) * self.widest;
                let e = 1e-3 * self.widest;
                let along = |d: DVec3| value(p + d * e) - value(p - d * e);
                let g = DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z));
                (value(p), g.normalize_or_zero())
            }
        }
    }

    /// May a support reach into this box?
    fn reached(&self, low: DVec3, high: DVec3) -> bool {
        let mut stack = vec![0u32; usize::from(!self.nodes.is_empty())];
        while let Some(id) = stack.pop() {
            let node = &self.nodes[id as usize];
            if (high.cmplt(node.low) | low.cmpgt(node.high)).any() {
                continue;
            }
            if node.right == 0 {
                return true;
            }
            stack.push(node.right);
            stack.push(id + 1);
        }
        false
    }
}

fn build(cells: &mut [Cell], start: u32, nodes: &mut Vec<Node>) {
    let at = nodes.len();
    let reach = |c: &Cell, s: f64| c.center + DVec3::splat(s * c.support);
    let low = cells.iter().map(|c| reach(c, -1.0)).fold(DVec3::INFINITY, DVec3::min);
    let high = cells.iter().map(|c| reach(c, 1.0)).fold(DVec3::NEG_INFINITY, DVec3::max);
    nodes.push(Node { low, high, start, count: cells.len() as u32, right: 0 });
    if cells.len() <= LEAF {
        return;
    }
    let size = Aabb::of(cells.iter().map(|c| &c.center)).size();
    let axis = (0..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
    let mid = cells.len() / 2;
    cells.select_nth_unstable_by(mid, |a, b| {
        let [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
        let (p, q) = (a.center, b.center);
        p[axis].total_cmp(&q[axis]).then(p[i].total_cmp(&q[i])).then(p[j].total_cmp(&q[j]))
    });
    let (a, b) = cells.split_at_mut(mid);
    build(a, start, nodes);
    nodes[at].right = nodes.len() as u32;
    build(b, start + mid as u32, nodes);
}

impl Field for SampleField {
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn value(&self, p: DVec3) -> f64 {
        self.evaluate(p).0
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        self.evaluate(p).1
    }

    fn values(&self, points: &[DVec3], values: &mut [f64]) {
        values.par_iter_mut().zip(points).for_each(|(v, &p)| *v = self.evaluate(p).0);
    }

    fn crosses(&self, aabb: &Aabb) -> bool {
        let reach = aabb.diagonal() / 2.0;
        let value = self.evaluate(aabb.center()).0;
        if value.is_nan() {
            return self.reached(aabb.min, aabb.max);
        }
        value.abs() <= STEEP * reach
    }

    fn noise_deg(&self) -> f64 {
        self.noise_deg
    }
}
