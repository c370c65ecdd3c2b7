//! Triangle meshes as directed fields: every triangle is rasterised into the lattice lines of the three axes.
//!
//! [K01] §3.1 shoots rays; here a triangle hits the lines whose nodes lie in its projection (`docs/methods/fields.md`).
//! Nodes on an edge of a projection, and hits on a node, are decided by one symbolic shift of all nodes
//! (Edelsbrunner and Mücke 1990, *Simulation of Simplicity*): node + (e, e², e³) for an infinitely small e. With
//! exact signs every line then crosses a closed surface consistently, and the three axes agree on every node.
//!
//! 1. `rasterise` the triangles into crossings, per axis
//! 2. count along the lines: a node is inside where the winding number is above zero
//! 3. keep one hit on each edge whose ends differ
//!
//! Meshes whose edges do not cancel (holes, cracks) take the sides from the generalised winding number
//! ([`super::winding`]) and keep the rasterised hits; gaps are closed where it passes one half.

use super::directed::{self, Directed, Hit, Hits, Placed, Sides, Thin};
use super::winding::Winding;
use super::{FieldError, Lattice};
use crate::geom::Aabb;
use crate::geom::predicates::{orient2d, orient3d};
use crate::mesh::TriMesh;
use crate::observe::{Cancelled, Observer};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Where a line of the lattice passes a triangle.
#[derive(Clone, Copy)]
struct Crossing {
    /// Line of the axis.
    line: u32,
    /// Edge of the line: that which begins at this node; -1 before the first.
    edge: i32,
    /// Coordinate along the axis.
    x: f64,
    face: u32,
    /// +1 from inside to outside along the axis.
    out: i32,
}

/// A triangle mesh made ready for sampling.
pub struct MeshField<'a> {
    mesh: &'a TriMesh,
    balanced: bool,
    /// -1 for a closed mesh that is inside out.
    turn: i32,
}

impl<'a> MeshField<'a> {
    /// Looks at the mesh: whether its edges cancel, and which way it is turned.
    /// # Errors
    /// [`FieldError::Mesh`] for damaged meshes.
    pub fn new(mesh: &'a TriMesh) -> Result<MeshField<'a>, FieldError> {
        crate::mesh::soup::check_some(mesh).map_err(FieldError::Mesh)?;
        let balanced = is_balanced(mesh);
        let center = mesh.bounds().center();
        let volume: f64 = (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t).map(|p| p - center);
                a.dot(b.cross(c))
            })
            .sum();
        Ok(MeshField { mesh, balanced, turn: if balanced && volume < 0.0 { -1 } else { 1 } })
    }

    /// True if every edge is passed as often one way as the other: sides then follow from counting alone.
    pub fn is_balanced(&self) -> bool {
        self.balanced
    }

    /// The box of the mesh.
    pub fn bounds(&self) -> Aabb {
        Aabb::of(self.mesh.triangles.iter().flatten().map(|&v| &self.mesh.points[v as usize]))
    }

    /// The sharp edges of the mesh on `lattice`: those between normals whose cosine is below `sharp`.
    pub fn creases(&self, lattice: &Lattice, sharp: f64) -> super::MeshCreases {
        super::MeshCreases::new(self.mesh, self.turn as f64, lattice, sharp)
    }

    /// Samples the mesh on `lattice`.
    /// # Errors
    /// [`FieldError::Cancelled`].
    pub fn sample(&self, lattice: &Lattice, observer: &dyn Observer) -> Result<Directed, FieldError> {
        let normals: Vec<DVec3> =
            (0..self.mesh.triangles.len()).into_par_iter().map(|t| self.mesh.normal(t) * self.turn as f64).collect();
        let crossings = rasterise(self.mesh, lattice, observer)?;
        observer.progress(0.5);
        observer.check()?;
        let mut field = if self.balanced {
            self.by_counting(lattice, &crossings, &normals)
        } else {
            self.by_winding(lattice, &crossings, &normals, observer)?
        };
        field.thin = thin(&crossings, self.balanced);
        observer.progress(1.0);
        Ok(field)
    }

    /// Sides by counting along x; hits of all axes.
    fn by_counting(&self, lattice: &Lattice, crossings: &[Vec<Crossing>; 3], normals: &[DVec3]) -> Directed {
        let sides = {
            let lines = lattice.rows();
            let start = starts(&crossings[0], lines);
            Sides::from_rows((0..lines).map(|line| {
                let (mut changes, mut winding) = (Vec::new(), 0);
                for run in crossings[0][start[line]..start[line + 1]].chunk_by(|a, b| a.edge == b.edge) {
                    let before = winding > 0;
                    winding -= run.iter().map(|c| c.out * self.turn).sum::<i32>();
                    if (winding > 0) != before {
                        changes.push(((run[0].edge + 1) as u32) << 2 | (winding > 0) as u32);
                    }
                }
                changes
            }))
        };
        let [(x, xx), (y, yy), (z, zz)] =
            [0, 1, 2].map(|axis| self.hits(lattice, axis, &crossings[axis], normals).into());
        let missing = |axis: usize, [i, j, k]: [usize; 3]| self.nearest_normal(lattice, axis, [i, j, k]);
        Directed { twice: [xx, yy, zz], ..Directed::assemble(*lattice, sides, [x, y, z], &missing) }
    }

    /// One hit for each edge that has any: the last at which the winding number passes between in and out. And where both ends
    /// of an edge are on one side, the two between which it is on the other for longest.
    fn hits(&self, lattice: &Lattice, axis: usize, crossings: &[Crossing], normals: &[DVec3]) -> [Hits; 2] {
        let (mut placed, mut twice) = (Vec::with_capacity(crossings.len()), Vec::new());
        for line in crossings.chunk_by(|a, b| a.line == b.line) {
            let mut winding = 0;
            for run in line.chunk_by(|a, b| a.edge == b.edge) {
                let mut chosen = None;
                let mut passes: Vec<&Crossing> = Vec::new();
                for c in run {
                    let before = winding > 0;
                    winding -= c.out * self.turn;
                    if (winding > 0) != before || chosen.is_none() {
                        chosen = Some(c);
                    }
                    if (winding > 0) != before {
                        passes.push(c);
                    }
                }
                let Some(c) = chosen.filter(|c| c.edge >= 0 && (c.edge as usize) < lattice.cells[axis]) else {
                    continue;
                };
                let [i, j, k] = place(lattice, axis, c.line as usize, c.edge as usize);
                let part = |c: &Crossing| {
                    directed::clear((c.x - lattice.coordinate(axis, c.edge as usize)) / lattice.step[axis])
                };
                let hit = |c: &Crossing| Hit { t: part(c), normal: normals[c.face as usize] };
                let place = |hit: Hit| Placed { row: lattice.row(j, k) as u32, at: i as u32, hit };
                placed.push(place(hit(c)));
                if passes.len().is_multiple_of(2) {
                    let width = |pair: &&[&Crossing]| part(pair[1]) - part(pair[0]);
                    let widest = passes.chunks_exact(2).max_by(|a, b| width(a).total_cmp(&width(b)));
                    let seen = widest.filter(|pair| width(pair) > directed::CLEARANCE);
                    twice.extend(seen.into_iter().flatten().map(|c| place(hit(c))));
                }
            }
        }
        [placed, twice].map(|placed| Hits::sorted(lattice.rows(), placed))
    }

    /// The guess where counting gives two different sides but no crossing lies between them: the middle.
    fn nearest_normal(&self, lattice: &Lattice, axis: usize, [i, j, k]: [usize; 3]) -> Hit {
        let mut p = lattice.node(i, j, k);
        p[axis] += lattice.step[axis] / 2.0;
        let distance = |t: usize| (self.mesh.corners(t).iter().sum::<DVec3>() / 3.0).distance_squared(p);
        let nearest = (0..self.mesh.triangles.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        Hit { t: 0.5, normal: nearest.map_or(DVec3::ZERO, |t| self.mesh.normal(t) * self.turn as f64) }
    }

    /// Sides from the generalised winding number.
    fn by_winding(
        &self,
        lattice: &Lattice,
        crossings: &[Vec<Crossing>; 3],
        normals: &[DVec3],
        observer: &dyn Observer,
    ) -> Result<Directed, FieldError> {
        let winding = Winding::new(self.mesh);
        let sides = super::sample::sides(&winding, lattice, observer)?;
        let axes = [0, 1, 2].map(|axis| {
            // Counting tells nothing of what lies between two nodes here.
            let [hits, _] = self.hits(lattice, axis, &crossings[axis], normals);
            hits
        });
        let missing = |axis: usize, at: [usize; 3]| super::sample::hit_on_edge(&winding, lattice, axis, at);
        Ok(Directed::assemble(*lattice, sides, axes, &missing))
    }
}

/// What the surface does between two nodes: edges that it passes there and back.
/// * `keeps_two` - two passes of an edge are kept
fn thin(crossings: &[Vec<Crossing>; 3], keeps_two: bool) -> Thin {
    let (mut widths, mut edges, mut lost, mut all) = (Vec::new(), 0, 0, 0);
    for run in crossings.iter().flat_map(|c| c.chunk_by(|a, b| (a.line, a.edge) == (b.line, b.edge))) {
        let before = widths.len();
        widths.extend(run.windows(2).filter(|p| p[0].out != p[1].out).map(|p| p[1].x - p[0].x));
        let is_thin = widths.len() > before;
        edges += is_thin as usize;
        lost += (is_thin && !(keeps_two && run.len() == 2)) as usize;
        all += 1;
    }
    let middle = widths.len() / 2;
    let width = if widths.is_empty() { 0.0 } else { *widths.select_nth_unstable_by(middle, f64::total_cmp).1 };
    Thin { edges, lost, lost_share: lost as f64 / f64::max(all as f64, 1.0), width }
}

/// True if for every pair of positions as many edges run one way as the other.
fn is_balanced(mesh: &TriMesh) -> bool {
    // Welding adds up what is balanced by names.
    if is_balanced_by_names(mesh) {
        return true;
    }
    let (welded, _) = crate::mend::weld(mesh);
    let mut keyed: Vec<(u64, i32)> = welded
        .triangles
        .par_iter()
        .flat_map_iter(|t| {
            (0..3).filter_map(move |k| {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                (a != b).then(|| (((a.min(b) as u64) << 32) | a.max(b) as u64, if a < b { 1 } else { -1 }))
            })
        })
        .collect();
    keyed.par_sort_unstable();
    keyed.chunk_by(|a, b| a.0 == b.0).all(|run| run.iter().map(|e| e.1).sum::<i32>() == 0)
}

/// True if for every pair of vertices as many edges run one way as the other.
fn is_balanced_by_names(mesh: &TriMesh) -> bool {
    // Edges in buckets by their lower vertex, a handful each.
    let edges = || {
        let of = |t: &[u32; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
        mesh.triangles.iter().flat_map(of).filter(|(a, b)| a != b)
    };
    let mut start = vec![0u32; mesh.points.len() + 1];
    edges().for_each(|(a, b)| start[a.min(b) as usize + 1] += 1);
    for v in 0..mesh.points.len() {
        start[v + 1] += start[v];
    }
    let mut next = start.clone();
    let mut others = vec![(0u32, 0i32); start[mesh.points.len()] as usize];
    for (a, b) in edges() {
        let at = &mut next[a.min(b) as usize];
        others[*at as usize] = (a.max(b), if a < b { 1 } else { -1 });
        *at += 1;
    }
    start.windows(2).all(|ends| {
        let bucket = &mut others[ends[0] as usize..ends[1] as usize];
        bucket.sort_unstable();
        bucket.chunk_by(|a, b| a.0 == b.0).all(|run| run.iter().map(|e| e.1).sum::<i32>() == 0)
    })
}

/// Lines of an axis are numbered so that sorting by line keeps rows in order: x lines by (k, j), y lines by (i, k),
/// z lines by (i, j).
fn line_of(lattice: &Lattice, axis: usize, u: usize, v: usize) -> u32 {
    match axis {
        // (u, v) are the next two axes in cyclic order.
        0 => (v * lattice.nodes(1) + u) as u32,
        1 => (v * lattice.nodes(2) + u) as u32,
        _ => (u * lattice.nodes(1) + v) as u32,
    }
}

/// The lower node of edge number `edge` of a line.
fn place(lattice: &Lattice, axis: usize, line: usize, edge: usize) -> [usize; 3] {
    match axis {
        0 => [edge, line % lattice.nodes(1), line / lattice.nodes(1)],
        1 => [line / lattice.nodes(2), edge, line % lattice.nodes(2)],
        _ => [line / lattice.nodes(1), line % lattice.nodes(1), edge],
    }
}

/// First crossing of each line.
fn starts(crossings: &[Crossing], lines: usize) -> Vec<usize> {
    let mut start = vec![0usize; lines + 1];
    for c in crossings {
        start[c.line as usize + 1] += 1;
    }
    for l in 0..lines {
        start[l + 1] += start[l];
    }
    start
}

/// Triangles a task takes at once.
const TRIANGLES_PER_CHUNK: usize = 1 << 12;

/// All crossings of each axis, sorted along its lines.
fn rasterise(mesh: &TriMesh, lattice: &Lattice, observer: &dyn Observer) -> Result<[Vec<Crossing>; 3], Cancelled> {
    let parts: Result<Vec<[Vec<Crossing>; 3]>, Cancelled> = (0..mesh.triangles.len().div_ceil(TRIANGLES_PER_CHUNK))
        .into_par_iter()
        .map(|c| {
            observer.check()?;
            let mut out: [Vec<Crossing>; 3] = Default::default();
            for t in c * TRIANGLES_PER_CHUNK..((c + 1) * TRIANGLES_PER_CHUNK).min(mesh.triangles.len()) {
                rasterise_one(mesh.corners(t), t as u32, lattice, &mut out);
            }
            Ok(out)
        })
        .collect();
    let mut parts = parts?;
    Ok([0, 1, 2].map(|axis| {
        let own: Vec<Vec<Crossing>> = parts.iter_mut().map(|part| std::mem::take(&mut part[axis])).collect();
        sorted(lattice, axis, &own)
    }))
}

/// The crossings of one axis in the order of its lines, and along each of them.
fn sorted(lattice: &Lattice, axis: usize, parts: &[Vec<Crossing>]) -> Vec<Crossing> {
    let lines = (0..3).filter(|&a| a != axis).map(|a| lattice.nodes(a)).product();
    // A counting sort by line, then a handful each.
    let mut start = vec![0u32; lines + 1];
    for c in parts.iter().flatten() {
        start[c.line as usize + 1] += 1;
    }
    for l in 0..lines {
        start[l + 1] += start[l];
    }
    let total = start[lines] as usize;
    let mut sorted = vec![Crossing { line: 0, edge: 0, x: 0.0, face: 0, out: 0 }; total];
    let mut fill = start;
    for c in parts.iter().flatten() {
        sorted[fill[c.line as usize] as usize] = *c;
        fill[c.line as usize] += 1;
    }
    let mut rest = sorted.as_mut_slice();
    while !rest.is_empty() {
        let line = rest[0].line;
        let count = rest.iter().position(|c| c.line != line).unwrap_or(rest.len());
        let (run, others) = rest.split_at_mut(count);
        run.sort_unstable_by(|a, b| {
            (a.edge, a.x, a.face).partial_cmp(&(b.edge, b.x, b.face)).unwrap_or(std::cmp::Ordering::Equal)
        });
        rest = others;
    }
    sorted
}

/// Coordinates nearer to a node than this fraction of a cell are compared by exact signs.
const NEAR_NODE: f64 = 1e-6;
/// Rounding of the difference of two products of differences, relative to the sum of their sizes (Shewchuk 1997,
/// `ccwerrboundA`, with room to spare).
const ROUNDING: f64 = 2.0 * f64::EPSILON;

/// The greatest whole number that is not above `x`.
#[inline]
fn floor(x: f64) -> i64 {
    // Rounds towards zero, and is no call on any processor.
    let whole = x as i64;
    whole - (x < whole as f64) as i64
}

/// The crossings of one triangle with the lines of all axes.
#[inline]
fn rasterise_one(corners: [DVec3; 3], face: u32, lattice: &Lattice, out: &mut [Vec<Crossing>; 3]) {
    let (low, high) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
    let nodes = [0, 1, 2].map(|a| {
        let (o, h) = (lattice.origin[a], lattice.step[a]);
        // One node more on both sides than rounding could take away.
        let first = floor((low[a] - o) / h - 0.001) + 1;
        let last = floor((high[a] - o) / h + 0.001);
        [first.max(0), last.min(lattice.cells[a] as i64)]
    });
    for axis in 0..3 {
        let (u, v) = (nodes[(axis + 1) % 3], nodes[(axis + 2) % 3]);
        if u[0] <= u[1] && v[0] <= v[1] {
            rasterise_along(corners, face, lattice, axis, [u, v].map(|n| n.map(|n| n as usize)), &mut out[axis]);
        }
    }
}

/// The crossings of one triangle with the lines of one axis.
/// * `u`, `v` - first and last nodes of its box along the next two axes
#[inline]
fn rasterise_along(
    corners: [DVec3; 3],
    face: u32,
    lattice: &Lattice,
    axis: usize,
    [[u0, u1], [v0, v1]]: [[usize; 2]; 2],
    out: &mut Vec<Crossing>,
) {
    let (ua, va) = ((axis + 1) % 3, (axis + 2) % 3);
    let flat = corners.map(|p| DVec2::new(p[ua], p[va]));
    let turn = orient2d(flat[0], flat[1], flat[2]);
    if turn == 0.0 {
        return;
    }
    let side = turn.signum();
    let wide = (u1 - u0 + 1) * (v1 - v0 + 1) > 12;
    for v in v0..=v1 {
        let y = lattice.coordinate(va, v);
        let (mut from, mut to) = (u0, u1);
        if wide {
            // Only where the edges leave room on this line.
            let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
            for k in 0..3 {
                let (a, b) = (flat[k], flat[(k + 1) % 3]);
                let slack = 0.001 * lattice.step[va];
                if (a.y.min(b.y) - slack) <= y && y <= a.y.max(b.y) + slack {
                    let s = if a.y == b.y { 0.0 } else { ((y - a.y) / (b.y - a.y)).clamp(0.0, 1.0) };
                    let x = a.x + s * (b.x - a.x);
                    let (l, r) = if (b.y - a.y).abs() <= 4.0 * slack { (a.x.min(b.x), a.x.max(b.x)) } else { (x, x) };
                    left = left.min(l);
                    right = right.max(r);
                }
            }
            let slack = 0.01 * lattice.step[ua];
            if left > right {
                continue;
            }
            from = from.max(((left - slack - lattice.origin[ua]) / lattice.step[ua]).ceil().max(0.0) as usize);
            let end = ((right + slack - lattice.origin[ua]) / lattice.step[ua]).floor();
            if end < 0.0 {
                continue;
            }
            to = to.min(end as usize);
        }
        for u in from..=to {
            let q = DVec2::new(lattice.coordinate(ua, u), y);
            let d = flat.map(|p| p - q);
            let products = [1, 2, 0].map(|k| (d[k].x * d[(k + 1) % 3].y, d[k].y * d[(k + 1) % 3].x));
            let mut weights = products.map(|(l, r)| l - r);
            let bounds = products.map(|(l, r)| (l.abs() + r.abs()) * ROUNDING);
            // One branch for all three: most nodes of the box are outside for certain.
            if (0..3).fold(false, |out, k| out | (weights[k] * side < -bounds[k])) {
                continue;
            }
            if !(0..3).fold(true, |sure, k| sure & (weights[k] * side > bounds[k])) {
                // All three on the side of the triangle, or on the edge and shifted to it.
                let inside = (0..3).all(|k| {
                    let (a, b) = (flat[(k + 1) % 3], flat[(k + 2) % 3]);
                    weights[k] = orient2d(a, b, q);
                    let s = if weights[k] != 0.0 { weights[k] } else { shifted(a, b, ua, va) };
                    (s > 0.0) == (turn > 0.0) && s != 0.0
                });
                if !inside {
                    continue;
                }
            }
            let sum = weights[0] + weights[1] + weights[2];
            let mix = |w: [f64; 3]| corners[0][axis] * w[0] + corners[1][axis] * w[1] + corners[2][axis] * w[2];
            let least = corners.iter().map(|c| c[axis]).fold(f64::INFINITY, f64::min);
            let most = corners.iter().map(|c| c[axis]).fold(f64::NEG_INFINITY, f64::max);
            let x = (mix(weights) / sum).clamp(least, most);
            let along = (x - lattice.origin[axis]) / lattice.step[axis];
            let mut edge = floor(along) as i32;
            let nearest = floor(along + 0.5) as f64;
            if (along - nearest).abs() < NEAR_NODE || !along.is_finite() {
                let node = nearest.clamp(-1.0, lattice.cells[axis] as f64 + 1.0) as i32;
                let mut at = DVec3::ZERO;
                at[ua] = q.x;
                at[va] = q.y;
                at[axis] = lattice.origin[axis] + lattice.step[axis] * node as f64;
                edge = if after(corners, at, turn) { node - 1 } else { node };
            }
            out.push(Crossing {
                line: line_of(lattice, axis, u, v),
                edge: edge.clamp(-1, lattice.cells[axis] as i32),
                x,
                face,
                out: if turn > 0.0 { 1 } else { -1 },
            });
        }
    }
}

/// The sign of `orient2d(a, b, q)` for a `q` on the line that is shifted by (e, e², e³) in space; `u` and `v` are the
/// axes of the plane.
fn shifted(a: DVec2, b: DVec2, u: usize, v: usize) -> f64 {
    let (du, dv) = (a.y - b.y, b.x - a.x);
    // The derivative along the axis that is shifted most, then along the other. The signs of the differences of two
    // coordinates are exact.
    let (first, second) = if u < v { (du, dv) } else { (dv, du) };
    if first != 0.0 { first } else { second }
}

/// True if the (shifted) node `at` lies behind the triangle along the axis.
fn after(corners: [DVec3; 3], at: DVec3, turn: f64) -> bool {
    let mut s = orient3d(corners[0], corners[1], corners[2], at);
    // In the plane: the components of the normal in the order of the shifts.
    for k in 0..3 {
        if s != 0.0 {
            break;
        }
        let [a, b, c] = corners.map(|p| DVec2::new(p[(k + 1) % 3], p[(k + 2) % 3]));
        s = orient2d(a, b, c);
    }
    // On the side of the normal, whose component along the axis has the sign of `turn`.
    (s > 0.0) == (turn > 0.0)
}
