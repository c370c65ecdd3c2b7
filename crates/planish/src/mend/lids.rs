//! Lids over boundary loops of a surface.
//!
//! 1. triangles of least area (Barequet and Sharir 1995, *Filling Gaps in the Boundary of a Polyhedron*)
//! 2. edges longer than those around are split, and edges flipped to Delaunay's, until the lid is as fine as the
//!    surface (Liepa 2003, *Filling Holes in Meshes*, §4)
//! 3. new vertices go where the surface bends least (the same, §5): least squares of the umbrella operators of all
//!    vertices of the lid, those of the boundary with their neighbours in the surface, so that the lid goes on as the
//!    surface comes in
//!
//! Departs from Liepa: edges are split in their middles, which needs no test of triangles; neighbours weigh by the inverse
//! of their distance, as boundaries of scans have short and long edges.

use crate::linalg::SparseCholesky;
use crate::mesh::change::Changing;
use crate::mesh::disjoint::{Taken, disjoint};
use glam::DVec3;
use std::collections::BTreeMap;

/// An edge this many times the usual length is split: its halves are then as far below it.
const SPLIT_LENGTH: f64 = 1.4;
/// Rounds of splitting; each halves the longest edges.
const SPLIT_ROUNDS: usize = 16;
/// Rounds of flipping after each; most lids settle in three.
const FLIP_ROUNDS: usize = 8;
/// Angles that are a little more than two right ones, as those of a square's corners are by rounding, turn no edge.
const SQUARE: f64 = 1e-6;
/// Neighbours closer than this share of the usual length weigh no more.
const CLOSEST: f64 = 0.1;

/// Triangles of least area over a loop of points, as places in it, counter-clockwise as the loop runs. `None` where all
/// would use an edge that is `taken`. Cubic in the number of points.
pub(super) fn least_area(points: &[DVec3], taken: impl Fn(usize, usize) -> bool) -> Option<Vec<[usize; 3]>> {
    let n = points.len();
    let mut cost = vec![vec![(0.0, 0usize); n]; n];
    for gap in 2..n {
        for i in 0..n - gap {
            let k = i + gap;
            let mut best = (f64::INFINITY, 0);
            if !taken(i, k) {
                for j in i + 1..k {
                    let area = (points[j] - points[i]).cross(points[k] - points[i]).length() / 2.0;
                    let sum = cost[i][j].0 + cost[j][k].0 + area;
                    if sum < best.0 {
                        best = (sum, j);
                    }
                }
            }
            cost[i][k] = best;
        }
    }
    if !cost[0][n - 1].0.is_finite() {
        return None;
    }
    let mut out = Vec::new();
    let mut open = vec![(0, n - 1)];
    while let Some((i, k)) = open.pop() {
        if k > i + 1 {
            let j = cost[i][k].1;
            out.push([i, j, k]);
            open.extend([(i, j), (j, k)]);
        }
    }
    Some(out)
}

/// A lid: the points of its boundary, then its own, and triangles over both.
pub(super) struct Lid {
    pub points: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
}

/// The lid of the triangles `flat` over a boundary, as fine and as smooth as the surface around.
/// * `beside` - for each point of the boundary its neighbours in the surface, without those of the boundary
pub(super) fn lid(rim: &[DVec3], beside: &[Vec<DVec3>], flat: &[[usize; 3]]) -> Lid {
    let n = rim.len();
    let mut lid = Lid { points: rim.to_vec(), triangles: flat.iter().map(|t| t.map(|v| v as u32)).collect() };
    let around = (0..n).flat_map(|k| beside[k].iter().map(move |p| p.distance(rim[k])));
    let (sum, count) = around.fold((0.0, 0.0), |(sum, count), d| (sum + d, count + 1.0));
    let length = if sum > 0.0 { sum / count } else { return lid };
    let mut mesh = Changing::new(&lid.triangles, n, &[]);
    for _ in 0..SPLIT_ROUNDS {
        let split = split(&mut mesh, &mut lid.points, SPLIT_LENGTH * length);
        for _ in 0..FLIP_ROUNDS {
            if flip(&mut mesh, &lid.points, n as u32) == 0 {
                break;
            }
        }
        if split == 0 {
            break;
        }
    }
    lid.triangles = mesh.into_triangles();
    smooth(&mut lid, n, beside, length);
    lid
}

/// The inner edges of a lid, each as the first triangle that has it, its place there, and the triangle beyond.
fn inner(mesh: &Changing) -> impl Iterator<Item = (u32, usize, u32)> {
    let edges = (0..mesh.len()).flat_map(|t| (0..3).map(move |k| (t, k)));
    edges.filter_map(|(t, k)| {
        let other = mesh.beyond(t, edge(mesh, t, k))?;
        (t < other).then_some((t, k, other))
    })
}

fn edge(mesh: &Changing, t: u32, k: usize) -> [u32; 2] {
    let corners = mesh.corners(t);
    [corners[k], corners[(k + 1) % 3]]
}

/// Splits inner edges longer than `longest`, at most one of each triangle; returns their number.
fn split(mesh: &mut Changing, points: &mut Vec<DVec3>, longest: f64) -> usize {
    let length = |t: u32, k: usize| {
        let [a, b] = edge(mesh, t, k).map(|v| points[v as usize]);
        a.distance(b)
    };
    let mut long: Vec<(f64, u32, usize, u32)> =
        inner(mesh).map(|(t, k, other)| (length(t, k), t, k, other)).filter(|x| x.0 > longest).collect();
    long.sort_by(|x, y| y.0.total_cmp(&x.0).then((x.1, x.2).cmp(&(y.1, y.2))));
    let (chosen, _) = disjoint(long, |x| vec![x.1, x.3], Some);
    for &(_, t, k, _) in &chosen {
        let [a, b] = edge(mesh, t, k).map(|v| points[v as usize]);
        points.push(a.midpoint(b));
        mesh.split(t, k);
    }
    chosen.len()
}

/// Flips inner edges whose opposite angles are more than two right ones, at most one of each triangle; returns their
/// number. No edge joins two of the first `n` points, the boundary: the surface may have it.
fn flip(mesh: &mut Changing, points: &[DVec3], n: u32) -> usize {
    let mut busy = Taken::default();
    let mut count = 0;
    for (t, k) in (0..mesh.len()).flat_map(|t| (0..3).map(move |k| (t, k))) {
        let Some(flip) = mesh.flip_of(t, k) else { continue };
        let [pa, pb, pc, pd] = [flip.edge[0], flip.edge[1], flip.tips[0], flip.tips[1]].map(|v| points[v as usize]);
        let angle = (pa - pc).angle_between(pb - pc) + (pa - pd).angle_between(pb - pd);
        let is_first = flip.triangles[0] < flip.triangles[1] && busy.spares(&flip.triangles);
        if is_first && angle > std::f64::consts::PI * (1.0 + SQUARE) && flip.tips.iter().any(|&v| v >= n) {
            mesh.flip(&flip);
            busy.add(&flip.triangles);
            count += 1;
        }
    }
    count
}

/// Moves the points of a lid behind its first `n`, its boundary, where the umbrellas of all are least. They stay where they are
/// if that is not decided.
fn smooth(lid: &mut Lid, n: usize, beside: &[Vec<DVec3>], length: f64) {
    let free = lid.points.len() - n;
    if free == 0 {
        return;
    }
    let mut edges: Vec<[u32; 2]> = lid
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .flat_map(|[a, b]| [[a, b], [b, a]])
        .collect();
    edges.sort_unstable();
    edges.dedup();
    let weight = |d: f64| length / d.max(CLOSEST * length);
    // Rows of the least squares: what an umbrella takes from free points, and its fixed rest.
    let mut lower: BTreeMap<(usize, usize), f64> = BTreeMap::new();
    let mut right = vec![0.0; 3 * free];
    for own in edges.chunk_by(|x, y| x[0] == y[0]) {
        let v = own[0][0] as usize;
        let p = lid.points[v];
        let mut row: Vec<(usize, f64)> = Vec::new();
        let (mut rest, mut total) = (DVec3::ZERO, 0.0);
        for &[_, w] in own {
            let q = lid.points[w as usize];
            let share = weight(p.distance(q));
            total += share;
            match (w as usize).checked_sub(n) {
                Some(free) => row.push((free, share)),
                None => rest += share * q,
            }
        }
        for q in beside.get(v).into_iter().flatten() {
            let share = weight(p.distance(*q));
            total += share;
            rest += share * *q;
        }
        match v.checked_sub(n) {
            Some(free) => row.push((free, -total)),
            None => rest -= total * p,
        }
        let scale = 1.0 / total;
        for &(i, a) in &row {
            for &(j, b) in row.iter().filter(|x| x.0 <= i) {
                *lower.entry((i, j)).or_default() += a * b * scale * scale;
            }
            for k in 0..3 {
                right[k * free + i] -= a * rest[k] * scale * scale;
            }
        }
    }
    let lower: Vec<(usize, usize, f64)> = lower.into_iter().map(|((i, j), a)| (i, j, a)).collect();
    if let Ok(factor) = SparseCholesky::factor(free, &lower) {
        factor.solve(&mut right);
        if right.iter().all(|x| x.is_finite()) {
            for i in 0..free {
                lid.points[n + i] = DVec3::new(right[i], right[free + i], right[2 * free + i]);
            }
        }
    }
}
