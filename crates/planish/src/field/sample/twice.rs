//! Edges of the lattice that the surface of a point-wise field passes there and back: thin walls and tips between two nodes of one
//! side.
//!
//! Only where the values of both nodes are together less than values change along an edge, the surface may come between them. There
//! the edge is halved, and parts of it are left out by the same reason or by the field's own word for a box.

use super::root::{outward, root_within, steady};
use crate::field::directed::{self, Hit, Hits, Placed};
use crate::field::{Field, Lattice};
use crate::geom::Aabb;
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;

/// A node near the surface.
#[derive(Clone, Copy, Debug)]
pub struct Near {
    /// Its number: x runs fastest.
    node: u64,
    value: f64,
    /// By how much values of neighbours around it differ at most.
    change: f64,
}

/// Halvings of an edge: a millionth of it is told, as far as values tell where to look.
const HALVINGS: usize = 20;
/// Parts of an edge that are halved at once; more are left where the surface runs along the edge, and it is given up. Chosen.
const MOST_PARTS: usize = 16;

/// Adds the nodes of a box that are near the surface.
/// * `from`, `to` - the first nodes along the axes, and those after the last
/// * `values` - of its nodes, x fastest
pub fn add_near(lattice: &Lattice, from: [usize; 3], to: [usize; 3], values: &[f64], near: &mut Vec<Near>) {
    let size = [0, 1, 2].map(|a| to[a] - from[a]);
    let step = [1, size[0], size[0] * size[1]];
    let place = |n: usize| [n % size[0], n / step[1] % size[1], n / step[2]];
    // Those of distances are known, and of other values these tell.
    let mut change = lattice.step.max_element();
    for (n, value) in values.iter().enumerate() {
        for a in (0..3).filter(|&a| place(n)[a] + 1 < size[a]) {
            change = f64::max(change, (values[n + step[a]] - value).abs());
        }
    }
    for (n, &value) in values.iter().enumerate().filter(|(_, v)| v.abs() <= change) {
        let [i, j, k] = [0, 1, 2].map(|a| from[a] + place(n)[a]);
        let node = (lattice.row(j, k) * lattice.nodes(0) + i) as u64;
        near.push(Near { node, value, change });
    }
}

/// Two hits on each edge that is passed twice, by axis.
/// # Errors
/// [`Cancelled`].
pub fn hits(
    field: &dyn Field,
    lattice: &Lattice,
    mut near: Vec<Near>,
    observer: &dyn Observer,
) -> Result<[Hits; 3], Cancelled> {
    near.par_sort_unstable_by_key(|n| n.node);
    let nodes = [0, 1, 2].map(|a| lattice.nodes(a) as u64);
    let step = [1, nodes[0], nodes[0] * nodes[1]];
    let mut found: [Hits; 3] = Default::default();
    for (axis, found) in found.iter_mut().enumerate() {
        let pair = |one: &Near| -> Option<[Placed; 2]> {
            if observer.cancelled() || one.node / step[axis] % nodes[axis] + 1 == nodes[axis] {
                return None;
            }
            let next = one.node + step[axis];
            let other = near[near.binary_search_by_key(&next, |n| n.node).ok()?];
            let change = one.change.max(other.change);
            let is_open = (one.value < 0.0) == (other.value < 0.0) && one.value.abs() + other.value.abs() <= change;
            if !is_open {
                return None;
            }
            let (row, at) = (one.node / nodes[0], one.node % nodes[0]);
            let (j, k) = (row % nodes[1], row / nodes[1]);
            let low = lattice.node(at as usize, j as usize, k as usize);
            let edge = Edge { field, axis, low, length: lattice.step[axis], change };
            let place = |hit: Hit| Placed { row: row as u32, at: at as u32, hit };
            edge.passes(one.value, other.value).map(|hits| hits.map(place))
        };
        let pairs: Vec<[Placed; 2]> = near.par_iter().filter_map(pair).collect();
        *found = Hits::sorted(lattice.rows(), pairs.into_iter().flatten().collect());
    }
    observer.check()?;
    Ok(found)
}

/// An edge of the lattice.
struct Edge<'a> {
    field: &'a dyn Field,
    axis: usize,
    low: DVec3,
    length: f64,
    /// By how much values change along it at most.
    change: f64,
}

impl Edge<'_> {
    fn at(&self, t: f64) -> DVec3 {
        let mut p = self.low;
        p[self.axis] += t * self.length;
        p
    }

    /// Both hits on an edge whose ends are on one side; `None` if it has none.
    fn passes(&self, f0: f64, f1: f64) -> Option<[Hit; 2]> {
        let near = self.field.within(&Aabb { min: self.low, max: self.at(1.0) });
        let field = near.as_deref().unwrap_or(self.field);
        let (middle, value) = self.beyond(field, f0, f1)?;
        let root = |[from, to]: [f64; 2], [f0, f1]: [f64; 2]| {
            let place = |t: f64| from + t * (to - from);
            let t = place(root_within(field.precision(), |t| field.value(self.at(place(t))), f0, f1));
            let normal = steady(field.gradient(self.at(t)), self.axis, outward(f0));
            Hit { t: directed::clear(t), normal }
        };
        let hits = [root([0.0, middle], [f0, value]), root([middle, 1.0], [value, f1])];
        (hits[1].t - hits[0].t > directed::CLEARANCE).then_some(hits)
    }

    /// A place of the edge on the other side than its ends, with its value.
    fn beyond(&self, field: &dyn Field, f0: f64, f1: f64) -> Option<(f64, f64)> {
        let mut parts = vec![(0.0, f0, 1.0, f1)];
        for _ in 0..HALVINGS {
            let mut halves = Vec::with_capacity(2 * parts.len());
            for (a, fa, b, fb) in parts {
                let is_far = f64::abs(fa) + f64::abs(fb) > self.change * (b - a);
                if is_far || !field.crosses(&Aabb { min: self.at(a), max: self.at(b) }) {
                    continue;
                }
                let (middle, value) = ((a + b) / 2.0, field.value(self.at((a + b) / 2.0)));
                if value.is_nan() {
                    return None;
                }
                if (value < 0.0) != (f0 < 0.0) {
                    return Some((middle, value));
                }
                halves.extend([(a, fa, middle, value), (middle, value, b, fb)]);
            }
            if halves.len() > MOST_PARTS {
                return None;
            }
            parts = halves;
        }
        None
    }
}
