//! Point-wise fields onto a lattice: which bricks to look at, sides of their nodes, hits on their edges.
//!
//! [K01] §3.1, implicit surfaces: one univariate root per edge. Whole bricks are left out where the field promises
//! that the surface does not cross them, so the work grows with the surface.

mod root;

use super::directed::{self, Directed, Hit, Hits, Sides};
use super::{Field, FieldError, Lattice, Side};
use crate::geom::Aabb;
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;
use root::{Bracket, outward, root_within, steady};
use std::sync::atomic::{AtomicUsize, Ordering};

pub use root::root;

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
    if field.in_batches() {
        let open = |_: usize, _: [usize; 3]| Hit { t: 0.5, normal: DVec3::X };
        let mut found = Directed::assemble(*lattice, sides, [none(), none(), none()], &open);
        hits_in_batches(field, &mut found, observer)?;
        (found.mended, found.noise_deg) = (0, field.noise_deg());
        return Ok(found);
    }
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
    Hit { t: directed::clear(t), normal: steady(field.gradient(p), axis, outward(f0)) }
}

/// Edges whose hits are sought at once in a field that answers many points at a time.
const BATCH: usize = 1 << 16;

/// The hits on all edges at once, for a field that answers many points at a time.
fn hits_in_batches(field: &dyn Field, found: &mut Directed, observer: &dyn Observer) -> Result<(), Cancelled> {
    let lattice = found.lattice;
    let count = found.hit_count().max(1);
    let mut done = 0;
    for axis in 0..3 {
        let Hits { start, at, hits } = &mut found.axes[axis];
        let rows = start.windows(2).enumerate();
        let edges: Vec<[DVec3; 2]> = rows
            .flat_map(|(row, ends)| {
                let (j, k) = (row % lattice.nodes(1), row / lattice.nodes(1));
                at[ends[0] as usize..ends[1] as usize].iter().map(move |&i| {
                    let mut end = [i as usize, j, k];
                    let low = lattice.node(end[0], j, k);
                    end[axis] += 1;
                    [low, lattice.node(end[0], end[1], end[2])]
                })
            })
            .collect();
        for (edges, hits) in edges.chunks(BATCH).zip(hits.chunks_mut(BATCH)) {
            seek(field, axis, lattice.step[axis], edges, hits, observer)?;
            done += edges.len();
            observer.progress(0.7 + 0.3 * done as f64 / count as f64);
        }
    }
    Ok(())
}

/// The hits on edges along `axis`, each between two nodes.
fn seek(
    field: &dyn Field,
    axis: usize,
    step: f64,
    edges: &[[DVec3; 2]],
    hits: &mut [Hit],
    observer: &dyn Observer,
) -> Result<(), Cancelled> {
    let at = |low: DVec3, t: f64| {
        let mut p = low;
        p[axis] += t * step;
        p
    };
    let values = |points: &[DVec3]| {
        let mut values = vec![0.0; points.len()];
        field.values(points, &mut values);
        values
    };
    let [low, high] = [0, 1].map(|k| edges.iter().map(|e| e[k]).collect::<Vec<DVec3>>());
    let ends = values(&low).into_iter().zip(values(&high));
    let (ways, mut brackets): (Vec<f64>, Vec<Bracket>) =
        ends.map(|(f0, f1)| (outward(f0), Bracket::new(field.precision(), f0, f1))).unzip();
    loop {
        observer.check()?;
        let open: Vec<(usize, f64)> = brackets.iter().enumerate().filter_map(|(n, b)| Some((n, b.ask()?))).collect();
        if open.is_empty() {
            break;
        }
        let points: Vec<DVec3> = open.iter().map(|&(n, t)| at(low[n], t)).collect();
        open.iter().zip(values(&points)).for_each(|(&(n, t), f)| brackets[n].tell(t, f));
    }
    let points: Vec<DVec3> = low.iter().zip(&brackets).map(|(&p, b)| at(p, b.place())).collect();
    let mut normals = vec![DVec3::ZERO; points.len()];
    field.gradients(&points, &mut normals);
    for (n, hit) in hits.iter_mut().enumerate() {
        let normal = steady(normals[n], axis, ways[n]);
        *hit = Hit { t: directed::clear(brackets[n].place()), normal };
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball of radius .7 that answers in batches, or point by point.
    struct Ball(bool);

    impl Field for Ball {
        fn bounds(&self) -> Aabb {
            Aabb { min: DVec3::splat(-0.7), max: DVec3::splat(0.7) }
        }

        fn value(&self, p: DVec3) -> f64 {
            p.length() - 0.7
        }

        fn gradient(&self, p: DVec3) -> DVec3 {
            p.normalize_or_zero()
        }

        fn in_batches(&self) -> bool {
            self.0
        }
    }

    #[test]
    fn hits_sought_in_batches_are_those_sought_one_by_one_bit_for_bit() {
        let lattice = Lattice::around(&Ball(false).bounds(), super::super::Spacing::Resolution(17)).unwrap();
        let [one, many] = [false, true].map(|b| sample(&Ball(b), &lattice, &crate::observe::Silent).unwrap());
        assert!(many.hit_count() > 1000);
        for axis in 0..3 {
            assert!(
                one.axes[axis].at == many.axes[axis].at && one.axes[axis].hits == many.axes[axis].hits,
                "axis {axis}"
            );
        }
        assert_eq!((one.mended, one.thin.edges), (many.mended, many.thin.edges));
    }
}
