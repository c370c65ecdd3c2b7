//! Meshes grown ring by ring: closed polylines around an axis, joined by strips of even triangles.
//!
//! Rings may have different numbers of points, so triangles stay even where the girth changes, and a ring that
//! lies on a rim makes that rim an exact chain of edges.

use crate::mesh::TriMesh;
use glam::DVec3;
use std::f64::consts::TAU;

/// A closed ring: vertices with rising angles; the ring goes on after `TAU`.
#[derive(Clone, Debug)]
pub(super) struct Ring {
    /// Vertex indices.
    pub vertices: Vec<u32>,
    /// Angle of each vertex, rising, all within one turn.
    pub angles: Vec<f64>,
}

/// Adds a ring of `count` points at even angles, shifted by half a step if `shifted`.
pub(super) fn add_ring(mesh: &mut TriMesh, count: usize, shifted: bool, at: impl Fn(f64) -> DVec3) -> Ring {
    let shift = if shifted { 0.5 } else { 0.0 };
    let angles: Vec<f64> = (0..count).map(|k| (k as f64 + shift) * TAU / count as f64).collect();
    let first = mesh.points.len() as u32;
    mesh.points.extend(angles.iter().map(|&a| at(a)));
    Ring { vertices: (first..first + count as u32).collect(), angles }
}

/// Joins two rings with a strip. Triangles face outward when angles rise counter-clockwise seen from outside
/// with `upper` on the left of `lower`.
pub(super) fn join(mesh: &mut TriMesh, lower: &Ring, upper: &Ring) {
    let (n, m) = (lower.vertices.len(), upper.vertices.len());
    // Angle of the k-th vertex when the ring is walked on and on.
    let angle = |ring: &Ring, k: usize| {
        let len = ring.vertices.len();
        ring.angles[k % len] + TAU * (k / len) as f64
    };
    // Begin the upper ring at the vertex nearest in angle to the first of the lower one.
    let start = (0..m)
        .min_by(|&a, &b| {
            let off = |k: usize| {
                let d = (angle(upper, k) - lower.angles[0]).rem_euclid(TAU);
                d.min(TAU - d)
            };
            off(a).total_cmp(&off(b)).then(a.cmp(&b))
        })
        .unwrap_or(0);
    // Turns that bring the start next to the lower ring's first vertex.
    let turn = ((lower.angles[0] - upper.angles[start]) / TAU).round() * TAU;
    let (mut i, mut j) = (0, 0);
    while i < n || j < m {
        // Step along the ring whose next edge has its midpoint first.
        let low = angle(lower, i) + angle(lower, i + 1);
        let up = angle(upper, start + j) + angle(upper, start + j + 1) + 2.0 * turn;
        let a = lower.vertices[i % n];
        let b = upper.vertices[(start + j) % m];
        if j == m || (i < n && low <= up) {
            mesh.triangles.push([a, lower.vertices[(i + 1) % n], b]);
            i += 1;
        } else {
            mesh.triangles.push([a, upper.vertices[(start + j + 1) % m], b]);
            j += 1;
        }
    }
}

/// Closes a ring with a fan around a new vertex, on the left of the ring.
pub(super) fn close(mesh: &mut TriMesh, ring: &Ring, pole: DVec3) {
    let top = mesh.points.len() as u32;
    mesh.points.push(pole);
    let n = ring.vertices.len();
    for k in 0..n {
        mesh.triangles.push([ring.vertices[k], ring.vertices[(k + 1) % n], top]);
    }
}

/// Number of steps of about `step` over `length`, at least one.
pub(super) fn steps(length: f64, step: f64) -> usize {
    (length / step).round().max(1.0) as usize
}

/// Height of an equilateral triangle over its side: the distance of rings for even triangles.
pub(super) const ROW: f64 = 0.866;

/// Fewest points of a ring: fewer would give needles at poles.
pub(super) const FEWEST_RING_POINTS: usize = 6;

/// Number of points of a ring of the given girth for edges of about `step`.
pub(super) fn girth_count(girth: f64, step: f64) -> usize {
    steps(girth, step).max(FEWEST_RING_POINTS)
}

/// Grows a strip of rings over a surface of revolution-like `at(s, angle)`, `s` from 0 to 1, starting from
/// `first` (which lies at `s = 0`) to `last`; `length` and `girth(s)` set the number of rings and of their points.
/// The last ring is `last` if given, else a new one at `s = 1`; it is returned.
pub(super) fn grow(
    mesh: &mut TriMesh,
    (first, last): (Ring, Option<Ring>),
    step: f64,
    length: f64,
    girth: impl Fn(f64) -> f64,
    at: impl Fn(f64, f64) -> DVec3,
) -> Ring {
    // An even number, so that the rim at the end (unshifted) is half a step off the ring before it.
    let rows = match steps(length, step * ROW) {
        1 => 1,
        n => 2 * (n as f64 / 2.0).round() as usize,
    };
    let mut ring = first;
    for row in 1..rows {
        let s = row as f64 / rows as f64;
        let upper = add_ring(mesh, girth_count(girth(s), step), row % 2 == 1, |a| at(s, a));
        join(mesh, &ring, &upper);
        ring = upper;
    }
    let last = last.unwrap_or_else(|| add_ring(mesh, girth_count(girth(1.0), step), false, |a| at(1.0, a)));
    join(mesh, &ring, &last);
    last
}

/// Grows rings of a flat disk inward from `first` (around `center`, at angle-dependent places `rim(angle)`)
/// and closes it in the middle.
pub(super) fn grow_disk(
    mesh: &mut TriMesh,
    first: Ring,
    step: f64,
    radius: f64,
    center: DVec3,
    rim: impl Fn(f64) -> DVec3,
) {
    let rows = steps(radius, step * ROW);
    let mut ring = first;
    for row in 1..rows {
        let s = row as f64 / rows as f64;
        let count = girth_count((1.0 - s) * radius * TAU, step);
        let upper = add_ring(mesh, count, row % 2 == 1, |a| rim(a).lerp(center, s));
        join(mesh, &ring, &upper);
        ring = upper;
    }
    close(mesh, &ring, center);
}
