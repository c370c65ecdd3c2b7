//! The patches of one cell, accepted only if they are embedded.
//!
//! A fan from a point strictly inside a cell over a simple loop on its boundary is always embedded: the boundary is
//! convex, so every ray from that point meets it once. Flat triangulations without an inner vertex are accepted if
//! they are one-to-one seen along their normal and no diagonal lies in a face. Different patches of one cell must be
//! disjoint by exact signs; else they are made anew without features, and as [`super::caps`] in the last resort. As
//! cells are convex and meet in shared polylines, the whole mesh is then manifold and free of self-intersections.
//!
//! See `docs/decisions/0006-certified-cells.md`; [K01] §4.3 makes the fan and does not test it.

use super::caps::{self, Corner, FACE_POINT};
use super::crossings::{joined, values};
use super::face::{FacePoints, Wish};
use super::feature::{Shape, classify, solve};
use super::topology::Trilinear;
use super::twice::{Passes, TwicePassed};
use super::{AMBIGUOUS, CROSSED, EDGE_FACES, MARGIN, UNMOVED_SHARE, links};
use crate::contour::Thresholds;
use crate::contour::polish::local::CellRange;
use crate::contour::walk::Cell;
use crate::field::{Creases, Directed};
use crate::geom::predicates::triangles_meet;
use crate::mesh::FeatureKind;
use glam::DVec3;

/// A vertex inside a cell.
#[derive(Clone, Copy, Debug)]
pub struct Inner {
    /// Position, strictly inside its cell.
    pub p: DVec3,
    /// What it marks.
    pub kind: FeatureKind,
}

/// Inner vertices are named from here until their number in the mesh is known.
pub const FIRST_INNER: u32 = 1 << 31;

/// What the cells of a few layers give.
#[derive(Default)]
pub struct Sheet {
    /// Triangles; names of inner vertices begin at [`FIRST_INNER`].
    pub triangles: Vec<[u32; 3]>,
    /// Inner vertices.
    pub inner: Vec<Inner>,
    /// Feature edges.
    pub edges: Vec<[u32; 2]>,
    /// Inner vertices that were clamped.
    pub wishes: Vec<Wish>,
    /// Cells with triangles, and the numbers of their first triangle and of that after the last.
    pub cells: Vec<CellRange>,
    /// For each cell the triangles of smooth cells before it.
    pub before: Vec<u32>,
    /// Cells whose feature had to be given up.
    pub fallbacks: usize,
    /// Cells whose patches were pushed in from the boundary.
    pub pushed: usize,
}

/// Everything that is the same for all cells.
pub struct Patcher<'a> {
    pub field: &'a Directed,
    /// Positions of the hits, by their names.
    pub points: &'a [DVec3],
    pub limits: &'a Thresholds,
    pub faces: &'a FacePoints,
    pub refine: Option<&'a dyn Creases>,
    /// First name of the hits of each axis.
    pub base: [u32; 3],
    /// Cells with edges that are passed twice.
    pub twice: &'a TwicePassed,
}

/// Buffers that are used again for every cell.
#[derive(Default)]
pub struct Scratch {
    corners: Vec<Corner>,
    /// Ends of the loops in `corners`.
    ends: Vec<usize>,
    normals: Vec<DVec3>,
    planes: Vec<(DVec3, DVec3)>,
    local: Vec<[u32; 3]>,
    /// Ends of the patches in `local`.
    parts: Vec<usize>,
}

/// Vertices farther from their cell than this are no feature of it, in cells.
const FARTHEST_FEATURE: f64 = 1.0;

impl Patcher<'_> {
    /// Appends the patches of `cell` to `sheet`.
    pub fn patch(&self, cell: &Cell, scratch: &mut Scratch, sheet: &mut Sheet) {
        let first = sheet.triangles.len() as u32;
        self.patches(cell, scratch, sheet);
        sheet.cells.push((cell.at.map(|x| x as u32), first, sheet.triangles.len() as u32));
    }

    fn patches(&self, cell: &Cell, scratch: &mut Scratch, sheet: &mut Sheet) {
        self.loops(cell, scratch);
        let count = scratch.ends.len();
        if count == 1 {
            let mut corners = std::mem::take(&mut scratch.corners);
            self.one(cell, &mut corners, scratch, sheet, true);
            scratch.corners = corners;
            sheet.triangles.append(&mut scratch.local);
            return;
        }
        let [low, high] = self.bounds(cell);
        let tunnel = self.tunnel(cell, scratch, [low, high]);
        let inner = sheet.inner.len();
        let (edges, wishes) = (sheet.edges.len(), sheet.wishes.len());
        let all = std::mem::take(&mut scratch.corners);
        if tunnel.is_none() {
            for features in [true, false] {
                scratch.parts.clear();
                let mut first = 0;
                for l in 0..count {
                    let mut own = all[first..scratch.ends[l]].to_vec();
                    first = scratch.ends[l];
                    self.one(cell, &mut own, scratch, sheet, features);
                    scratch.parts.push(scratch.local.len());
                }
                if self.disjoint(&all, scratch, sheet) {
                    sheet.triangles.append(&mut scratch.local);
                    sheet.fallbacks += !features as usize;
                    scratch.corners = all;
                    return;
                }
                scratch.local.clear();
                sheet.inner.truncate(inner);
                sheet.edges.truncate(edges);
                sheet.wishes.truncate(wishes);
            }
        }
        // Face points belong to the loops of both neighbours: they stay.
        let mut loops: Vec<Vec<Corner>> = Vec::new();
        let mut first = 0;
        for &end in &scratch.ends {
            loops.push(self.with_face_points(cell, &all[first..end]));
            first = end;
        }
        let loops: Vec<&[Corner]> = loops.iter().map(Vec::as_slice).collect();
        let positions = cell_corners(low, high);
        let tunnel = tunnel.and_then(|[a, b]| caps::loops_between(&positions, cell.config, &loops, a, b));
        let (inner, triangles) = (&mut sheet.inner, &mut sheet.triangles);
        let mut vertex = |p: DVec3| {
            inner.push(Inner { p, kind: FeatureKind::None });
            FIRST_INNER + inner.len() as u32 - 1
        };
        caps::caps(&positions, cell.config, &loops, tunnel, &mut vertex, &mut |t| triangles.push(t));
        sheet.pushed += 1;
        scratch.corners = all;
    }

    /// The lowest and the highest corner of a cell.
    fn bounds(&self, cell: &Cell) -> [DVec3; 2] {
        let [i, j, k] = cell.at;
        [self.field.lattice.node(i, j, k), self.field.lattice.node(i + 1, j + 1, k + 1)]
    }

    /// Fills the loops of a cell, without face points.
    fn loops(&self, cell: &Cell, scratch: &mut Scratch) {
        scratch.corners.clear();
        scratch.ends.clear();
        if self.twice.contains(cell.at) {
            return self.loops_over(cell, &self.twice.passes(self.field, cell), scratch);
        }
        let ambiguous = AMBIGUOUS[cell.config as usize];
        let joined = if ambiguous == 0 { 0 } else { joined(self.field, cell, ambiguous) };
        let chain = links(cell.config, joined);
        let mut rest = CROSSED[cell.config as usize];
        while rest != 0 {
            let first = rest.trailing_zeros() as usize;
            let mut e = first;
            loop {
                rest &= !(1 << e);
                let (id, p, n) = self.hit(cell, e);
                let face = chain.face[e];
                scratch.corners.push(Corner { id, p, n, faces: EDGE_FACES[e], edge: e as u8, face, tagged: false });
                e = chain.next[e] as usize;
                if e == first {
                    break;
                }
            }
            scratch.ends.push(scratch.corners.len());
        }
    }

    /// The same with edges that are passed twice; points between two hits on one edge are in the loops already.
    fn loops_over(&self, cell: &Cell, Passes { hits, next }: &Passes, scratch: &mut Scratch) {
        let mut is_left = vec![true; hits.len()];
        while let Some(first) = is_left.iter().position(|left| *left) {
            let mut at = first;
            while is_left[at] {
                is_left[at] = false;
                let (hit, (to, face)) = (&hits[at], next[at]);
                let faces = EDGE_FACES[hit.edge as usize];
                let own = Corner { id: hit.id, p: hit.p, n: hit.n, faces, edge: hit.edge, face, tagged: false };
                scratch.corners.push(own);
                if hits[to].edge == hit.edge {
                    scratch.corners.extend(self.face_point(cell, &own, hits[to].id));
                }
                at = to;
            }
            scratch.ends.push(scratch.corners.len());
        }
    }

    /// The point of a face between two hits, if there is one.
    fn face_point(&self, cell: &Cell, from: &Corner, to: u32) -> Option<Corner> {
        let (id, p, tagged) = self.faces.find(self.field, cell, from.face as usize, from.id, to)?;
        let (n, face) = (DVec3::ZERO, from.face);
        Some(Corner { id, p, n, faces: 1 << face, edge: FACE_POINT, face, tagged })
    }

    /// Name, position and normal of the hit on edge `e`.
    fn hit(&self, cell: &Cell, e: usize) -> (u32, DVec3, DVec3) {
        let axis = e / 4;
        let n = cell.hit[e];
        let hit = &self.field.axes[axis].hits[n as usize];
        let id = self.base[axis] + n;
        (id, self.points[id as usize], hit.normal)
    }

    fn with_face_points(&self, cell: &Cell, l: &[Corner]) -> Vec<Corner> {
        let mut out = Vec::with_capacity(l.len() + 4);
        for (k, c) in l.iter().enumerate() {
            out.push(*c);
            let next = &l[(k + 1) % l.len()];
            if c.edge != FACE_POINT && next.edge != FACE_POINT && c.n.dot(next.n) < self.limits.faint {
                out.extend(self.face_point(cell, c, next.id));
            }
        }
        out
    }

    /// The patch of one loop, into `scratch.local`.
    fn one(&self, cell: &Cell, l: &mut Vec<Corner>, scratch: &mut Scratch, sheet: &mut Sheet, features: bool) {
        let [low, high] = self.bounds(cell);
        scratch.normals.clear();
        let is_hit = |c: &&Corner| c.edge != FACE_POINT;
        scratch.normals.extend(l.iter().filter(is_hit).map(|c| c.n));
        let mut shape = classify(&scratch.normals, self.limits.sharp, self.limits.corner);
        if shape == Shape::Smooth {
            // A bend that only the source knows.
            if self.limits.faint > self.limits.sharp && bends(l, self.limits.faint) {
                let with = self.with_face_points(cell, l);
                if with.len() > l.len() {
                    *l = with;
                    self.bend(l, scratch, sheet, [low, high]);
                    return;
                }
            }
            if !flat(l, &mut scratch.local) {
                let p = inside(center(l), low, high).0;
                fan(l, self.inner(sheet, p, FeatureKind::None), &mut scratch.local);
            }
            return;
        }
        scratch.planes.clear();
        scratch.planes.extend(l.iter().filter(is_hit).map(|c| (c.p, c.n)));
        *l = self.with_face_points(cell, l);
        let points: Vec<DVec3> = l.iter().filter(|c| c.tagged).map(|c| c.p).collect();
        let hits = scratch.planes.iter().map(|p| p.0).sum::<DVec3>() / scratch.planes.len() as f64;
        let middle = if points.len() >= 2 { points.iter().sum::<DVec3>() / points.len() as f64 } else { hits };
        let near = if shape == Shape::Edge { middle } else { hits };
        let mut p = solve(&scratch.planes, near, shape);
        if shape == Shape::Corner && points.len() == 2 {
            // A bent edge looks like a corner; it is one only if that explains the hits much better.
            let rms = |p: DVec3| scratch.planes.iter().map(|(s, n)| n.dot(p - s).powi(2)).sum::<f64>();
            let edge = solve(&scratch.planes, middle, Shape::Edge);
            if rms(edge) < CORNER_GAIN * rms(p) || !within(p, low, high, POKE) {
                (shape, p) = (Shape::Edge, edge);
            }
        } else if shape == Shape::Edge && points.len() > 2 {
            shape = Shape::Corner;
            let corner = solve(&scratch.planes, middle, shape);
            if within(corner, low, high, 0.5) {
                p = corner;
            }
        }
        if let Some(refine) = self.refine {
            p = refine.inner_point(p, &points, shape == Shape::Corner, [low, high], &scratch.planes).unwrap_or(p);
        }
        let kind = if shape == Shape::Corner { FeatureKind::Corner } else { FeatureKind::Edge };
        let (clamped, moved) = inside(p, low, high);
        let mut apex = clamped;
        let along = |r: &dyn Creases| r.nearest(clamped, (high - low).max_element(), &scratch.planes);
        let mut wish = moved.then(|| self.refine.filter(|_| shape == Shape::Edge).and_then(along).unwrap_or(p));
        let mut given_up = !features || !p.is_finite() || !within(p, low, high, FARTHEST_FEATURE);
        if !given_up && turned(l, apex) {
            // A clamped apex may see its fan from the wrong side, the free one not.
            apex = inside(middle, low, high).0;
            given_up = turned(l, apex) && !moved;
        }
        if given_up {
            apex = inside(if features { middle } else { center(l) }, low, high).0;
            wish = None;
            sheet.fallbacks += features as usize;
        }
        let kind = if given_up && points.is_empty() { FeatureKind::None } else { kind };
        let id = self.inner(sheet, apex, kind);
        if let Some(wish) = wish {
            sheet.wishes.push((id, wish));
        }
        for c in l.iter().filter(|c| c.tagged) {
            sheet.edges.push([id, c.id]);
        }
        fan(l, id, &mut scratch.local);
    }

    /// The patch of a loop that is smooth by its hits, but that bends or sharp lines pass of which the source knows.
    fn bend(&self, l: &[Corner], scratch: &mut Scratch, sheet: &mut Sheet, [low, high]: [DVec3; 2]) {
        let points: Vec<DVec3> = l.iter().filter(|c| c.edge == FACE_POINT).map(|c| c.p).collect();
        let middle = points.iter().sum::<DVec3>() / points.len() as f64;
        let found = self.refine.and_then(|r| r.bend(middle, low, high)).unwrap_or(middle);
        let mut apex = inside(found, low, high).0;
        if turned(l, apex) {
            apex = inside(center(l), low, high).0;
        }
        let tagged = l.iter().any(|c| c.tagged);
        let id = self.inner(sheet, apex, if tagged { FeatureKind::Edge } else { FeatureKind::None });
        for c in l.iter().filter(|c| c.tagged) {
            sheet.edges.push([id, c.id]);
        }
        fan(l, id, &mut scratch.local);
    }

    fn inner(&self, sheet: &mut Sheet, p: DVec3, kind: FeatureKind) -> u32 {
        sheet.inner.push(Inner { p, kind });
        FIRST_INNER + sheet.inner.len() as u32 - 1
    }

    /// Position of a vertex by its name.
    fn position(&self, id: u32, all: &[Corner], sheet: &Sheet) -> DVec3 {
        if id >= FIRST_INNER {
            return sheet.inner[(id - FIRST_INNER) as usize].p;
        }
        match all.iter().find(|c| c.id == id) {
            Some(c) => c.p,
            None => self.faces.position(id),
        }
    }

    /// True if no triangle of one patch meets one of another.
    fn disjoint(&self, all: &[Corner], scratch: &Scratch, sheet: &Sheet) -> bool {
        let mut first = 0;
        let mut own: Vec<(usize, [u32; 3], [DVec3; 3])> = Vec::with_capacity(scratch.local.len());
        for (part, &end) in scratch.parts.iter().enumerate() {
            for t in &scratch.local[first..end] {
                own.push((part, *t, t.map(|id| self.position(id, all, sheet))));
            }
            first = end;
        }
        own.iter().enumerate().all(|(n, (part, t, p))| {
            own[..n].iter().filter(|(other, ..)| other != part).all(|(_, u, q)| {
                let low = |p: &[DVec3; 3]| p[0].min(p[1]).min(p[2]);
                let high = |p: &[DVec3; 3]| p[0].max(p[1]).max(p[2]);
                let apart = low(p).cmpgt(high(q)).any() || low(q).cmpgt(high(p)).any();
                apart || !triangles_meet(*p, *t, *q, *u)
            })
        })
    }

    /// Two corners of the cell that a tunnel joins, where the source is a scalar grid and says so.
    fn tunnel(&self, cell: &Cell, scratch: &Scratch, [low, high]: [DVec3; 2]) -> Option<[usize; 2]> {
        let f = values(self.field, cell)?;
        let trilinear = Trilinear::new(f);
        let mut loops: Vec<&[Corner]> = Vec::new();
        let mut first = 0;
        for &end in &scratch.ends {
            loops.push(&scratch.corners[first..end]);
            first = end;
        }
        let region = caps::regions_of(&cell_corners(low, high), cell.config, &loops);
        // Euler number of the part of the boundary below: each region is a sphere with a hole per loop on its boundary.
        let below = boundary_euler(cell.config, &region, loops.len());
        if 2 * trilinear.euler_below() - below >= loops.len() as i32 {
            return None;
        }
        trilinear.joined_corners(&region)
    }
}

/// A corner may poke out of its cell by so much, in cells.
const POKE: f64 = 0.5;
/// A corner must explain the hits so many times better than an edge (squared distances).
const CORNER_GAIN: f64 = 16.0;

/// Euler number of the inside part of the cell's boundary between `loops` loops.
fn boundary_euler(config: u8, region: &[usize; 8], loops: usize) -> i32 {
    // Regions and loops form a tree; each loop borders one inside region, so the sum over inside regions of
    // 2 - (loops around it) is twice their number less the number of loops.
    let inside = (0..8).filter(|&c| region[c] == c && config >> c & 1 != 0).count();
    2 * inside as i32 - loops as i32
}

/// The eight corners of a cell.
pub fn cell_corners(low: DVec3, high: DVec3) -> [DVec3; 8] {
    std::array::from_fn(|c| {
        let pick = |axis: usize| if c >> axis & 1 == 0 { low[axis] } else { high[axis] };
        DVec3::new(pick(0), pick(1), pick(2))
    })
}

/// `p` kept clear of the faces of the cell, and whether it had to be moved.
pub fn inside(p: DVec3, low: DVec3, high: DVec3) -> (DVec3, bool) {
    let margin = (high - low) * MARGIN;
    if p.is_nan() {
        return ((low + high) / 2.0, true);
    }
    let q = p.clamp(low + margin, high - margin);
    // A vertex that is inside already stays where it is, however near to a face.
    if p.cmpgt(low + margin * UNMOVED_SHARE).all() && p.cmplt(high - margin * UNMOVED_SHARE).all() {
        (p, false)
    } else {
        (q, q != p)
    }
}

/// True if the normals of two hits that follow each other have a cosine below `faint`.
fn bends(l: &[Corner], faint: f64) -> bool {
    let pairs = (0..l.len()).map(|k| [&l[k], &l[(k + 1) % l.len()]]);
    let mut of_hits = pairs.filter(|pair| pair.iter().all(|c| c.edge != FACE_POINT));
    of_hits.any(|[a, b]| a.n.dot(b.n) < faint)
}

fn within(p: DVec3, low: DVec3, high: DVec3, reach: f64) -> bool {
    let slack = (high - low) * reach;
    p.cmpge(low - slack).all() && p.cmple(high + slack).all()
}

pub fn center(l: &[Corner]) -> DVec3 {
    l.iter().map(|c| c.p).sum::<DVec3>() / l.len() as f64
}

pub fn fan(l: &[Corner], apex: u32, out: &mut Vec<[u32; 3]>) {
    for k in 0..l.len() {
        out.push([apex, l[k].id, l[(k + 1) % l.len()].id]);
    }
}

/// True if the fan from `apex` has a triangle against the normals of its hits.
fn turned(l: &[Corner], apex: DVec3) -> bool {
    (0..l.len()).any(|k| {
        let (a, b) = (&l[k], &l[(k + 1) % l.len()]);
        let n = (a.p - apex).cross(b.p - apex);
        let against = |c: &Corner| c.edge == FACE_POINT || c.n.dot(n) < 0.0;
        (a.edge != FACE_POINT || b.edge != FACE_POINT) && against(a) && against(b)
    })
}

/// Triangulates a loop without an inner vertex; false if there is no safe way.
pub fn flat(l: &[Corner], out: &mut Vec<[u32; 3]>) -> bool {
    let n = l.len();
    if n == 3 {
        out.push([l[0].id, l[1].id, l[2].id]);
        return true;
    }
    let points: Vec<DVec3> = l.iter().map(|c| c.p).collect();
    let free = |s: usize, k: usize| l[s].faces & l[k].faces == 0;
    let Some(s) = best_fan(&points, free) else { return false };
    for k in 1..n - 1 {
        out.push([l[s].id, l[(s + k) % n].id, l[(s + k + 1) % n].id]);
    }
    true
}

/// The vertex of a loop whose fan to all others is the flattest, if there is a safe one.
/// * `free` - no face holds both of two vertices
#[inline(always)]
pub fn best_fan(points: &[DVec3], free: impl Fn(usize, usize) -> bool) -> Option<usize> {
    let n = points.len();
    let mut normal = DVec3::ZERO;
    for k in 1..n - 1 {
        normal += (points[k] - points[0]).cross(points[k + 1] - points[0]);
    }
    let mut best: Option<(f64, usize)> = None;
    for s in 0..if n == 4 { 2 } else { n } {
        let at = |k: usize| points[(s + k) % n];
        if !(2..n - 1).all(|k| free(s, (s + k) % n)) {
            continue;
        }
        let o = at(0);
        let cross = |a: DVec3, b: DVec3| (a - o).cross(b - o).dot(normal);
        // Seen along the normal: a fan within half a turn, every triangle the right way round.
        let safe =
            n == 4 || (2..n).all(|k| cross(at(1), at(k)) > 0.0) && (2..n - 1).all(|k| cross(at(k), at(k + 1)) > 0.0);
        if !safe {
            continue;
        }
        // The least area is the flattest.
        let area: f64 = (1..n - 1).map(|k| (at(k) - o).cross(at(k + 1) - o).length()).sum();
        if best.is_none_or(|b| area < b.0) {
            best = Some((area, s));
        }
    }
    best.map(|b| b.1)
}
