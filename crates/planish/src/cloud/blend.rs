//! The blend of cells at a point.
//!
//! [X03] Xie et al. 2003, §4.2 eq. 4: modified Shepard blend of the local quadrics. Ohtake et al., *Multi-level Partition
//! of Unity Implicits*, 2003: near edges and corners the blended functions are themselves maxima and minima.
//! * value: weighted mean of the cells whose support holds the point; those that disagree with it lose weight by degrees, since a
//!   cell that knows one face of an edge goes on where the face has ended
//! * gradient: mean of the normals that decide in these cells, on the heaviest cell's side of an edge
//!
//! Departs from [X03]: one blend over all quadrics rounds every crease by the width of the supports. The price is
//! that the field is not C1, that the gradient is not the derivative of the value, and that at most 64 cells are
//! weighed anew (`docs/methods/samples.md`).

use super::Cell;
use crate::geom::{Aabb, is_positive};
use glam::DVec3;
use std::ops::Range;

/// Normals of cells that differ by less than this cosine are one side of an edge.
const SAME_SIDE_COSINE: f64 = 0.85;
/// Cells in a leaf of the tree.
const CELLS_PER_LEAF: usize = 4;
/// Cells at one point that are told apart.
const MOST_CELLS_HEARD: usize = 64;
/// A cell that is so many of its errors off the mean has a quarter of its weight left (squared Cauchy weights).
const OUTLIER_ERRORS: f64 = 3.5;
/// Rounds of that: a fixed number, so that the blend stays as smooth as its weights.
const REWEIGHTINGS: usize = 2;

/// Cells in a tree over their supports.
#[derive(Clone, Debug, Default)]
pub struct Blend {
    /// In the order of the tree.
    cells: Vec<Cell>,
    reaches: Vec<Reach>,
    nodes: Vec<Node>,
}

/// What the cells say at a point.
#[derive(Clone, Copy, Debug)]
pub struct Blended {
    /// Pseudo-distance, positive outside, world units.
    pub value: f64,
    /// Distance to the nearest centre of a cell over the support of that cell, squared.
    pub aside: f64,
    /// The heaviest cell.
    pub cell: usize,
    /// The plain mean, and the sum of its weights.
    pub mean: f64,
    /// See `mean`.
    pub weight: f64,
}

/// How far a cell reaches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    center: DVec3,
    /// One over the squared support.
    inverse: f64,
    trust: f64,
}

impl Reach {
    pub(crate) fn of(cell: &Cell) -> Reach {
        Reach { center: cell.center, inverse: 1.0 / (cell.support * cell.support), trust: cell.trust }
    }

    /// Squared distance of `p` over the squared support.
    #[inline]
    fn share(&self, p: DVec3) -> f64 {
        self.center.distance_squared(p) * self.inverse
    }

    /// Weight in the blend at `p`.
    pub(crate) fn weight(&self, p: DVec3) -> f64 {
        self.bell(self.share(p))
    }

    /// Weight in the blend at such a share.
    #[inline]
    fn bell(&self, t2: f64) -> f64 {
        // C1 at the rim; a wide bell, since the mean of many cells has less noise than any of them.
        (1.0 - t2).max(0.0).powi(2) * self.trust
    }

    /// One over the squared error that is expected there: it grows with the distance.
    #[inline]
    fn sure(&self, t2: f64) -> f64 {
        self.trust * self.inverse / ((1.0 + t2) * (1.0 + t2))
    }
}

/// A node of the tree over the supports, in preorder; the left child follows it.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    start: u32,
    count: u32,
    /// Node of the right child; 0 for a leaf.
    right: u32,
}

impl Blend {
    /// A tree over cells.
    pub fn new(cells: &[Cell]) -> Blend {
        let mut cells = cells.to_vec();
        let mut nodes = Vec::new();
        if !cells.is_empty() {
            build(&mut cells, 0, &mut nodes);
        }
        Blend { reaches: cells.iter().map(Reach::of).collect(), cells, nodes }
    }

    /// The cells, in the order of the tree.
    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// Calls `visit(indices)` for all leaves of the tree that are not `apart`, nor any node above them.
    #[inline]
    fn leaves(&self, apart: impl Fn(&Node) -> bool, mut visit: impl FnMut(Range<u32>)) {
        let mut stack = [0u32; 64];
        let mut top = usize::from(!self.nodes.is_empty());
        while top > 0 {
            top -= 1;
            let id = stack[top];
            let node = &self.nodes[id as usize];
            if apart(node) {
                continue;
            }
            if node.right == 0 {
                visit(node.start..node.start + node.count);
            } else {
                stack[top] = node.right;
                stack[top + 1] = id + 1;
                top += 2;
            }
        }
    }

    /// Calls `visit(index, squared distance over squared support)` for all cells whose support holds `p`.
    fn around(&self, p: DVec3, mut visit: impl FnMut(usize, f64)) {
        let apart = |node: &Node| (p.cmplt(node.low) | p.cmpgt(node.high)).any();
        self.leaves(apart, |cells| {
            for i in cells.start as usize..cells.end as usize {
                let t2 = self.reaches[i].share(p);
                if t2 < 1.0 {
                    visit(i, t2);
                }
            }
        });
    }

    /// The value at `p`; `None` where no cell reaches.
    pub fn at(&self, p: DVec3) -> Option<Blended> {
        let mut heard = Heard::new(p);
        self.around(p, |i, t2| heard.add(self, i, t2));
        heard.blended()
    }

    /// The same bits by these cells alone, if all that reach `p` are among them.
    /// * `cells` - indices, ascending
    pub fn at_of(&self, cells: &[u32], p: DVec3) -> Option<Blended> {
        let mut heard = Heard::new(p);
        for &i in cells {
            let t2 = self.reaches[i as usize].share(p);
            if t2 < 1.0 {
                heard.add(self, i as usize, t2);
            }
        }
        heard.blended()
    }

    /// Unit gradient at `p`, where cells said `here`: that of the sheets on the heaviest side of an edge.
    /// * `cells` - indices of all that reach `p`, and of others, ascending
    pub fn normal_of(&self, cells: &[u32], p: DVec3, here: &Blended) -> DVec3 {
        let lead = self.cells[here.cell].evaluate(p).1;
        let mut sum = DVec3::ZERO;
        for &i in cells {
            let (reach, cell) = (&self.reaches[i as usize], &self.cells[i as usize]);
            let t2 = reach.share(p);
            if t2 < 1.0 {
                let (d, n) = cell.evaluate(p);
                if d.is_finite() && n.dot(lead) > SAME_SIDE_COSINE {
                    sum += reach.bell(t2) * n;
                }
            }
        }
        sum.normalize_or(lead)
    }

    /// As [`Blend::normal_of`] among all cells.
    pub fn normal(&self, p: DVec3, here: &Blended) -> DVec3 {
        let mut cells = Vec::new();
        self.around(p, |i, _| cells.push(i as u32));
        self.normal_of(&cells, p, here)
    }

    /// The cells whose supports reach into a box, ascending.
    pub fn reaching(&self, aabb: &Aabb) -> Vec<u32> {
        let mut found = Vec::with_capacity(64);
        let apart = |node: &Node| (aabb.max.cmplt(node.low) | aabb.min.cmpgt(node.high)).any();
        self.leaves(apart, |cells| found.extend(cells.filter(|&i| self.cells[i as usize].reaches(aabb))));
        found
    }
}

/// The cells that are heard at a point.
struct Heard {
    p: DVec3,
    values: [f64; MOST_CELLS_HEARD],
    weights: [f64; MOST_CELLS_HEARD],
    /// One over the variance of each value, and over the square of [`OUTLIER_ERRORS`].
    sure: [f64; MOST_CELLS_HEARD],
    count: usize,
    sum: f64,
    weight: f64,
    aside: f64,
    /// The heaviest: its weight and index.
    lead: (f64, usize),
}

impl Heard {
    #[inline]
    fn new(p: DVec3) -> Heard {
        let none = [0.0; MOST_CELLS_HEARD];
        let lead = (0.0, 0);
        Heard { p, values: none, weights: none, sure: none, count: 0, sum: 0.0, weight: 0.0, aside: 1.0, lead }
    }

    #[inline]
    fn add(&mut self, blend: &Blend, i: usize, t2: f64) {
        let d = blend.cells[i].evaluate(self.p).0;
        if d.is_finite() {
            let reach = &blend.reaches[i];
            let w = reach.bell(t2);
            self.sum += w * d;
            self.weight += w;
            self.aside = self.aside.min(t2);
            if w > self.lead.0 {
                self.lead = (w, i);
            }
            if self.count < MOST_CELLS_HEARD {
                self.values[self.count] = d;
                self.weights[self.count] = w;
                self.sure[self.count] = reach.sure(t2) / (OUTLIER_ERRORS * OUTLIER_ERRORS);
                self.count += 1;
            }
        }
    }

    fn blended(&self) -> Option<Blended> {
        if !is_positive(self.weight) {
            return None;
        }
        let n = self.count;
        let mean = self.sum / self.weight;
        let mut value = mean;
        for _ in 0..REWEIGHTINGS {
            let (mut sum, mut weight) = (0.0, 0.0);
            for ((d, w), sure) in self.values[..n].iter().zip(&self.weights[..n]).zip(&self.sure[..n]) {
                let off = 1.0 + (d - value) * (d - value) * sure;
                let heeded = w / (off * off);
                sum += heeded * d;
                weight += heeded;
            }
            value = sum / weight;
        }
        Some(Blended { value, aside: self.aside, cell: self.lead.1, mean, weight: self.weight })
    }
}

fn build(cells: &mut [Cell], start: u32, nodes: &mut Vec<Node>) {
    let at = nodes.len();
    let reach = |c: &Cell, s: f64| c.center + DVec3::splat(s * c.support);
    let low = cells.iter().map(|c| reach(c, -1.0)).fold(DVec3::INFINITY, DVec3::min);
    let high = cells.iter().map(|c| reach(c, 1.0)).fold(DVec3::NEG_INFINITY, DVec3::max);
    nodes.push(Node { low, high, start, count: cells.len() as u32, right: 0 });
    if cells.len() <= CELLS_PER_LEAF {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Quadric;

    #[test]
    fn one_cell_of_nine_that_is_twenty_errors_off_moves_the_blend_by_less_than_half_an_error() {
        let error = 0.01;
        let cell = |k: u32, height: f64| Cell {
            center: DVec3::new(0.1 * f64::from(k % 3), 0.1 * f64::from(k / 3), 0.0),
            support: 1.0,
            trust: 1.0 / (error * error),
            sheets: [Quadric::plane(DVec3::Z * height, 1.0, DVec3::Z); 4],
            count: 1,
            concave: 0,
        };
        let cells: Vec<Cell> = (0..9).map(|k| cell(k, if k == 4 { 20.0 * error } else { 0.0 })).collect();
        let found = Blend::new(&cells).at(DVec3::new(0.1, 0.1, 0.0)).unwrap();
        assert!(found.mean.abs() > 2.0 * error, "{}", found.mean);
        assert!(found.value.abs() < 0.5 * error, "{}", found.value);
    }
}
