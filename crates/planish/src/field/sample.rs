//! Point-wise fields onto a lattice: which bricks to look at, sides of their nodes, hits on their edges.
//!
//! [K01] §3.1, implicit surfaces: one univariate root per edge. Whole bricks are left out where the field promises
//! that the surface does not cross them, so the work grows with the surface.

use super::directed::{self, Directed, Hit, Hits, Sides};
use super::{Field, FieldError, Lattice, Side};
use crate::geom::Aabb;
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Nodes along an edge of a brick: small enough to follow the surface, large enough for batches.
const BRICK: usize = 8;
/// Bricks are ruled out in groups of so many along x and y first.
const GROUPS: [usize; 2] = [8, 2];
/// Nodes along an edge of the smallest boxes of fields that get faster in them.
const FEW: usize = 2;

/// Samples a field on a lattice.
/// # Errors
/// [`FieldError::Cancelled`].
pub fn sample(field: &dyn Field, lattice: &Lattice, observer: &dyn Observer) -> Result<Directed, FieldError> {
    let sides = sides(field, lattice, observer)?;
    observer.check()?;
    let none = || Hits { start: vec![0; lattice.rows() + 1], ..Hits::default() };
    let cancelled = std::sync::atomic::AtomicBool::new(false);
    let row = |j: usize, k: usize| -> directed::Missing {
        if observer.cancelled() {
            cancelled.store(true, Ordering::Relaxed);
        }
        if cancelled.load(Ordering::Relaxed) {
            return Box::new(|_, _| Hit { t: 0.5, normal: DVec3::X });
        }
        // The field around a few nodes of the row, where it answers faster there.
        let mut near: Vec<Option<Option<Box<dyn Field + '_>>>> = Vec::new();
        near.resize_with(lattice.nodes(0).div_ceil(BRICK), || None);
        Box::new(move |axis, i| {
            let part = near[i / BRICK].get_or_insert_with(|| {
                let from = i / BRICK * BRICK;
                let to = [from + BRICK, j + 1, k + 1];
                field.within(&Aabb { min: lattice.node(from, j, k), max: lattice.node(to[0], to[1], to[2]) })
            });
            hit_on_edge(part.as_deref().unwrap_or(field), lattice, axis, [i, j, k])
        })
    };
    let mut found = Directed::assemble_rows(*lattice, sides, [none(), none(), none()], &row);
    if cancelled.into_inner() || observer.cancelled() {
        return Err(Cancelled.into());
    }
    found.mended = 0;
    found.noise_deg = field.noise_deg();
    observer.progress(1.0);
    Ok(found)
}

/// The sides of all nodes.
/// # Errors
/// [`FieldError::Cancelled`].
pub fn sides(field: &dyn Field, lattice: &Lattice, observer: &dyn Observer) -> Result<Sides, FieldError> {
    let (ny, nz) = (lattice.nodes(1), lattice.nodes(2));
    let slabs = nz.div_ceil(BRICK);
    let done = AtomicUsize::new(0);
    let rows: Vec<Option<Vec<Vec<u32>>>> = (0..slabs)
        .into_par_iter()
        .map(|s| {
            if observer.cancelled() {
                return None;
            }
            let slab = Slab { field, lattice, observer, k0: s * BRICK, k1: ((s + 1) * BRICK).min(nz) };
            let rows = slab.sides()?;
            let n = done.fetch_add(1, Ordering::Relaxed);
            observer.progress(0.7 * (n + 1) as f64 / slabs as f64);
            Some(rows)
        })
        .collect();
    let rows: Option<Vec<Vec<Vec<u32>>>> = rows.into_iter().collect();
    let rows = rows.ok_or(Cancelled)?;
    debug_assert_eq!(rows.iter().map(Vec::len).sum::<usize>(), ny * nz);
    Ok(Sides::from_rows(rows.into_iter().flatten()))
}

/// A few planes of nodes.
struct Slab<'a> {
    field: &'a dyn Field,
    lattice: &'a Lattice,
    observer: &'a dyn Observer,
    k0: usize,
    k1: usize,
}

impl Slab<'_> {
    fn sides(&self) -> Option<Vec<Vec<u32>>> {
        let (nx, ny, words) = (self.lattice.nodes(0), self.lattice.nodes(1), self.lattice.words());
        let rows = ny * (self.k1 - self.k0);
        let mut bits = Bits { inside: vec![0; rows * words], known: vec![!0; rows * words], words, ny };
        let group = GROUPS[0] * BRICK;
        for j in (0..ny).step_by(group) {
            if self.observer.cancelled() {
                return None;
            }
            for i in (0..nx).step_by(group) {
                self.divide(self.field, [i, j], [(i + group).min(nx), (j + group).min(ny)], 1, &mut bits);
            }
        }
        let row = |r: usize| {
            let (a, b) = (r * words, (r + 1) * words);
            directed::changes_of(&bits.inside[a..b], &bits.known[a..b], nx)
        };
        Some((0..rows).map(row).collect())
    }

    /// Settles the nodes `from..to` of all planes of the slab; `field` is good for them.
    fn divide(&self, field: &dyn Field, from: [usize; 2], to: [usize; 2], level: usize, bits: &mut Bits) {
        let low = self.lattice.node(from[0], from[1], self.k0);
        let high = self.lattice.node(to[0] - 1, to[1] - 1, self.k1 - 1);
        let aabb = Aabb { min: low, max: high };
        let near = field.within(&aabb);
        let field = near.as_deref().unwrap_or(field);
        if !field.crosses(&aabb) {
            let side = field.side(aabb.center());
            if side != Side::Outside {
                for k in self.k0..self.k1 {
                    for j in from[1]..to[1] {
                        bits.put(from[0]..to[0], j, k - self.k0, side);
                    }
                }
            }
            return;
        }
        if level <= GROUPS.len() {
            let step = GROUPS.get(level).map_or(BRICK, |g| g * BRICK);
            for j in (from[1]..to[1]).step_by(step) {
                for i in (from[0]..to[0]).step_by(step) {
                    self.divide(field, [i, j], [(i + step).min(to[0]), (j + step).min(to[1])], level + 1, bits);
                }
            }
            return;
        }
        if near.is_some() {
            self.halve(field, [from[0], from[1], self.k0], [to[0], to[1], self.k1], bits);
        } else {
            self.ask(field, [from[0], from[1], self.k0], [to[0], to[1], self.k1], bits);
        }
    }

    /// Settles the nodes `from..to` by halves, down to a few nodes: for a field that gets faster in small boxes.
    fn halve(&self, field: &dyn Field, from: [usize; 3], to: [usize; 3], bits: &mut Bits) {
        let node = |n: [usize; 3]| self.lattice.node(n[0], n[1], n[2]);
        let aabb = Aabb { min: node(from), max: node(to.map(|n| n - 1)) };
        let near = field.within(&aabb);
        let field = near.as_deref().unwrap_or(field);
        if !field.crosses(&aabb) {
            let side = field.side(aabb.center());
            for (j, k) in (from[1]..to[1]).flat_map(|j| (from[2]..to[2]).map(move |k| (j, k))) {
                bits.put(from[0]..to[0], j, k - self.k0, side);
            }
            return;
        }
        let axis = (0..3).fold(0, |best, a| if to[a] - from[a] > to[best] - from[best] { a } else { best });
        if to[axis] - from[axis] <= FEW {
            self.ask(field, from, to, bits);
            return;
        }
        let middle = from[axis].midpoint(to[axis]);
        let (mut end, mut start) = (to, from);
        (end[axis], start[axis]) = (middle, middle);
        self.halve(field, from, end, bits);
        self.halve(field, start, to, bits);
    }

    /// Asks the field for the nodes `from..to`.
    fn ask(&self, field: &dyn Field, from: [usize; 3], to: [usize; 3], bits: &mut Bits) {
        let mut points = Vec::with_capacity((0..3).map(|a| to[a] - from[a]).product());
        for k in from[2]..to[2] {
            for j in from[1]..to[1] {
                points.extend((from[0]..to[0]).map(|i| self.lattice.node(i, j, k)));
            }
        }
        let mut values = vec![0.0; points.len()];
        field.values(&points, &mut values);
        let mut values = values.into_iter();
        for k in from[2]..to[2] {
            for j in from[1]..to[1] {
                for (i, value) in (from[0]..to[0]).zip(&mut values) {
                    bits.put(i..i + 1, j, k - self.k0, super::side_of(value));
                }
            }
        }
    }
}

struct Bits {
    inside: Vec<u64>,
    known: Vec<u64>,
    words: usize,
    ny: usize,
}

impl Bits {
    fn put(&mut self, nodes: std::ops::Range<usize>, j: usize, k: usize, side: Side) {
        let base = (k * self.ny + j) * self.words;
        for i in nodes {
            match side {
                Side::Inside => self.inside[base + i / 64] |= 1 << (i % 64),
                Side::Unknown => self.known[base + i / 64] &= !(1 << (i % 64)),
                Side::Outside => {}
            }
        }
    }
}

/// The hit on an edge whose ends are on different sides.
pub fn hit_on_edge(field: &dyn Field, lattice: &Lattice, axis: usize, [i, j, k]: [usize; 3]) -> Hit {
    let low = lattice.node(i, j, k);
    let at = |t: f64| {
        let mut p = low;
        p[axis] += t * lattice.step[axis];
        p
    };
    let mut end = [i, j, k];
    end[axis] += 1;
    let high = lattice.node(end[0], end[1], end[2]);
    let near = field.within(&Aabb { min: low, max: high });
    let field = near.as_deref().unwrap_or(field);
    let (f0, f1) = (field.value(low), field.value(high));
    let t = root_within(field.precision(), |t| field.value(at(t)), f0, f1);
    let p = at(t);
    let mut normal = field.gradient(p);
    if normal == DVec3::ZERO || !normal.is_finite() {
        // A flat spot: from inside to outside along the edge.
        normal = DVec3::ZERO;
        normal[axis] = if f0 < 0.0 { 1.0 } else { -1.0 };
    }
    Hit { t: directed::clear(t), normal }
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

/// Where `f` passes zero between 0 and 1, to `precision`, by interpolation kept within a shrinking bracket (Oliveira and Takahashi
/// 2020, *An Enhancement of the Bisection Method Average Performance Preserving Minmax Optimality*): never more steps
/// than bisection plus one.
fn root_within(precision: f64, f: impl Fn(f64) -> f64, f0: f64, f1: f64) -> f64 {
    let sign = if f0 < f1 { 1.0 } else { -1.0 };
    let (mut a, mut b, mut fa, mut fb) = (0.0, 1.0, sign * f0, sign * f1);
    if fa.is_nan() || fb.is_nan() {
        return 0.5;
    }
    let most = (0.5 / precision).log2().ceil() as i32 + 1;
    for n in 0..=most {
        if b - a <= 2.0 * precision {
            break;
        }
        let middle = (a + b) / 2.0;
        let room = (precision * 2f64.powi(most - n) - (b - a) / 2.0).max(0.0);
        let falsi = if fb > fa { (fb * a - fa * b) / (fb - fa) } else { middle };
        let direction = if middle >= falsi { 1.0 } else { -1.0 };
        let cut = CUT * (b - a) * (b - a);
        let truncated = if cut <= (middle - falsi).abs() { falsi + direction * cut } else { middle };
        let x = if (truncated - middle).abs() <= room { truncated } else { middle - direction * room };
        let x = x.clamp(a, b);
        let fx = sign * f(x);
        if fx > 0.0 {
            (b, fb) = (x, fx);
        } else if fx < 0.0 {
            (a, fa) = (x, fx);
        } else if fx == 0.0 {
            return x;
        } else {
            // Unknown in between: the middle is as good as any other place.
            return middle;
        }
    }
    (a + b) / 2.0
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
