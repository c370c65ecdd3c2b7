//! Where the sharp edges of a mesh pass the planes of a lattice: hits on faces, as the directed field has hits on edges.
//!
//! Two hits in a face and their tangents tell where a feature passes it to second order in the cell size, and not at all
//! where it bends in between. A mesh knows its sharp edges: each is cut by the planes of nodes once, and the cuts are
//! kept by plane and cell.
//!
//! See `docs/methods/fields.md`, "Creases of sources".

use super::{Creases, Lattice};
use crate::geom::{Bvh, KdTree, Triangles};
use crate::mesh::{Adjacency, NONE, TriMesh, next};
use glam::DVec3;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BTreeMap;

/// Sharp edges of one mesh on one lattice.
pub struct MeshCreases {
    lattice: Lattice,
    /// Cuts with the planes of each axis, sorted by plane and cell.
    cuts: [Vec<Cut>; 3],
    /// Vertices where sharp edges meet, end or bend, sorted by cell.
    corners: Vec<([i64; 3], DVec3)>,
    /// The sharp edges as triangles without area.
    lines: Option<Bvh>,
    /// The same of all edges that bend, and the vertices where they meet, sorted by cell.
    bends: Option<Bvh>,
    knots: Vec<([i64; 3], DVec3)>,
    /// Places where lines share faces of cells, with the normals beside them.
    crowded: Vec<(DVec3, [DVec3; 2])>,
}

#[derive(Clone, Copy)]
struct Cut {
    /// Plane, then the cell in the plane: along the second and the first of the other two axes.
    key: [i64; 3],
    p: DVec3,
    /// Normals of the two faces beside the edge.
    normals: [DVec3; 2],
    /// False for a bend that is no feature.
    tagged: bool,
    /// Edge of the mesh: one of its two half-edges.
    edge: u32,
}

/// A sharp line that turns by more than this at a vertex has a corner there (cosine of 35 degrees).
const BEND: f64 = 0.82;
/// Sharp lines go on over edges whose normals have a cosine below this (15 degrees): the facets of a coarse mesh turn by
/// less.
const FADING: f64 = 0.966;
/// Other edges whose normals have a cosine below this (5 degrees) are bends: facets larger than a cell keep their edges.
const BEND_COSINE: f64 = 0.9962;
/// Normals of two hits may differ by less than those beside the faint edge between them (cosine of 4 degrees).
const FAINT_HITS: f64 = 0.9976;
/// A hit beside a faint edge has the normal of its side within this (cosine of 18 degrees).
const FAINT_AGREE: f64 = 0.95;
/// Normals of the hits and of the faces beside the edge agree if their cosine is above this: facets of curved surfaces
/// turn within a cell.
const AGREE: f64 = 0.75;
/// Around a face that several lines pass, they are told apart within this distance, in cells.
const CROWD_CELLS: f64 = 2.0;
/// Cuts of one edge that are farther apart than this, in cells, have another place between them.
const HALF: f64 = 0.5;
/// The lines are followed within this distance of the guess, in cells.
const LINE_REACH_CELLS: f64 = 0.9;

impl MeshCreases {
    /// Collects the sharp edges of `mesh`: those between faces whose normals have a cosine below `sharp`, and where a
    /// line of them ends, the edges that carry it on while it fades (hysteresis as in Canny 1986, *A Computational
    /// Approach to Edge Detection*).
    /// * `turn` - -1 if the mesh is inside out
    pub fn new(mesh: &TriMesh, turn: f64, lattice: &Lattice, sharp: f64) -> MeshCreases {
        let adjacency = Adjacency::new(mesh);
        let mut cuts: [Vec<Cut>; 3] = Default::default();
        let mut edges: Vec<[u32; 2]> = Vec::new();
        let of_faces: Vec<DVec3> = (0..mesh.triangles.len()).into_par_iter().map(|t| mesh.normal(t) * turn).collect();
        let normals = |h: u32| [h, adjacency.opposite[h as usize]].map(|h| of_faces[h as usize / 3]);
        let mut sharp_edges: Vec<u32> = Vec::new();
        let mut faint_edges: Vec<(f64, u32)> = Vec::new();
        for h in 0..adjacency.opposite.len() as u32 {
            let g = adjacency.opposite[h as usize];
            if g == NONE || g < h {
                continue;
            }
            let n = normals(h);
            let cosine = n[0].dot(n[1]);
            if cosine >= sharp.max(BEND_COSINE) || n.contains(&DVec3::ZERO) {
                continue;
            }
            if cosine < sharp {
                sharp_edges.push(h);
            } else {
                faint_edges.push((cosine, h));
            }
        }
        carry_on(mesh, &mut sharp_edges, &faint_edges);
        sharp_edges.sort_unstable();
        faint_edges.retain(|(_, h)| sharp_edges.binary_search(h).is_err());
        let ends = |h: u32| [mesh.origin(h), mesh.origin(next(h))];
        for &h in &sharp_edges {
            edges.push(ends(h));
            cut(mesh, h, normals(h), true, lattice, &mut cuts);
        }
        let mut bent = edges.clone();
        for &(_, h) in &faint_edges {
            bent.push(ends(h));
            cut(mesh, h, normals(h), false, lattice, &mut cuts);
        }
        for list in &mut cuts {
            list.sort_by(|a, b| {
                a.key.cmp(&b.key).then_with(|| a.p.to_array().partial_cmp(&b.p.to_array()).unwrap_or(a.key.cmp(&b.key)))
            });
        }
        let tree = |edges: &[[u32; 2]]| {
            (!edges.is_empty()).then(|| {
                let points: Vec<DVec3> = edges.iter().flatten().map(|&v| mesh.points[v as usize]).collect();
                let flat: Vec<[u32; 3]> = (0..edges.len() as u32).map(|e| [2 * e, 2 * e + 1, 2 * e + 1]).collect();
                Bvh::new(Triangles { points: &points, triangles: &flat })
            })
        };
        let by_cell = |points: Vec<DVec3>| {
            let mut all: Vec<([i64; 3], DVec3)> = points.into_iter().map(|p| (cell_of(lattice, p), p)).collect();
            all.sort_by_key(|c| c.0);
            all
        };
        let corners_of_lines = by_cell(corners(mesh, &edges));
        let knots = by_cell(corners(mesh, &bent));
        let (lines, bends) = (tree(&edges), tree(&bent));
        let crowded = crowded(mesh, lattice, &cuts);
        MeshCreases { lattice: *lattice, cuts, corners: corners_of_lines, lines, bends, knots, crowded }
    }
}

/// Where two lines pass one face, places on all lines around with the normals beside them. Lines of edges shorter than a
/// cell turn too much within it, and where more than two pass, a smaller voxel is the way.
fn crowded(mesh: &TriMesh, lattice: &Lattice, cuts: &[Vec<Cut>; 3]) -> Vec<(DVec3, [DVec3; 2])> {
    let size = lattice.step.max_element();
    let ends = |h: u32| [mesh.origin(h), mesh.origin(next(h))].map(|v| mesh.points[v as usize]);
    let is_long = |c: &Cut| {
        let [a, b] = ends(c.edge);
        a.distance(b) > size
    };
    let faces = cuts.iter().flat_map(|cuts| cuts.chunk_by(|a, b| a.key == b.key));
    let lines = |face: &&[Cut]| {
        let mut lines = face.iter().filter(|c| c.tagged);
        lines.clone().count() == 2 && lines.all(is_long)
    };
    let shared: Vec<DVec3> = faces.filter(lines).flatten().map(|c| c.p).collect();
    if shared.is_empty() {
        return Vec::new();
    }
    let tree = KdTree::new(&shared);
    let mut found = Vec::new();
    let mut near = |p: DVec3| {
        tree.nearest_within(p, 1, CROWD_CELLS * size, &mut found);
        !found.is_empty()
    };
    let mut all: Vec<&Cut> = cuts.iter().flatten().filter(|c| c.tagged && near(c.p)).collect();
    // And half way between two of one edge: cells are longer across.
    let order = |a: &Cut, b: &Cut| a.p.to_array().partial_cmp(&b.p.to_array()).unwrap_or(Ordering::Equal);
    all.sort_by(|a, b| a.edge.cmp(&b.edge).then_with(|| order(a, b)));
    let halves: Vec<_> = all
        .windows(2)
        .filter(|c| c[0].edge == c[1].edge && c[0].p.distance(c[1].p) > HALF * size)
        .map(|c| ((c[0].p + c[1].p) / 2.0, c[0].normals))
        .collect();
    all.iter().map(|c| (c.p, c.normals)).chain(halves).collect()
}

/// Adds to lines that end the faint edge that goes on most nearly straight and is the sharpest, again and again.
fn carry_on(mesh: &TriMesh, lines: &mut Vec<u32>, faint: &[(f64, u32)]) {
    let ends_of = |h: u32| [mesh.origin(h), mesh.origin(next(h))];
    let mut at: BTreeMap<u32, Vec<(f64, u32)>> = BTreeMap::new();
    for &(cosine, h) in faint.iter().filter(|f| f.0 < FADING) {
        for v in ends_of(h) {
            at.entry(v).or_default().push((cosine, h));
        }
    }
    let mut degree: BTreeMap<u32, usize> = BTreeMap::new();
    for v in lines.iter().flat_map(|&h| ends_of(h)) {
        *degree.entry(v).or_default() += 1;
    }
    let point = |v: u32| mesh.points[v as usize];
    let mut open: Vec<(u32, u32)> = Vec::new();
    for &h in lines.iter() {
        let [a, b] = ends_of(h);
        open.extend([(a, b), (b, a)].into_iter().filter(|(_, end)| degree[end] == 1));
    }
    while let Some((from, end)) = open.pop() {
        let way = (point(end) - point(from)).normalize_or_zero();
        let beyond = |h: u32| {
            let [a, b] = ends_of(h);
            if a == end { b } else { a }
        };
        let straight = |h: u32| (point(beyond(h)) - point(end)).normalize_or_zero().dot(way) > BEND;
        let found = at.get(&end).into_iter().flatten().filter(|(_, h)| straight(*h)).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some(&(_, h)) = found else { continue };
        let to = beyond(h);
        lines.push(h);
        *degree.entry(end).or_default() += 1;
        let met = degree.entry(to).or_default();
        *met += 1;
        if *met == 1 {
            open.push((end, to));
        }
    }
}

fn cell_of(lattice: &Lattice, p: DVec3) -> [i64; 3] {
    ((p - lattice.origin) / lattice.step).floor().to_array().map(|x| x as i64)
}

/// Cuts an edge with all planes between its ends.
fn cut(mesh: &TriMesh, edge: u32, normals: [DVec3; 2], tagged: bool, lattice: &Lattice, cuts: &mut [Vec<Cut>; 3]) {
    let [a, b] = [mesh.origin(edge), mesh.origin(next(edge))].map(|v| mesh.points[v as usize]);
    for axis in 0..3 {
        let (low, high) = (a[axis].min(b[axis]), a[axis].max(b[axis]));
        let to_plane = |x: f64| (x - lattice.origin[axis]) / lattice.step[axis];
        let (first, last) = (to_plane(low).ceil().max(0.0), to_plane(high).floor().min(lattice.cells[axis] as f64));
        let mut plane = first;
        while plane <= last {
            let level = lattice.coordinate(axis, plane as usize);
            let s = if high > low { ((level - a[axis]) / (b[axis] - a[axis])).clamp(0.0, 1.0) } else { 0.5 };
            let mut p = a.lerp(b, s);
            p[axis] = level;
            cuts[axis].push(Cut { key: key(lattice, axis, plane as i64, p), p, normals, tagged, edge });
            plane += 1.0;
        }
    }
}

fn key(lattice: &Lattice, axis: usize, plane: i64, p: DVec3) -> [i64; 3] {
    let cell = cell_of(lattice, p);
    [plane, cell[(axis + 2) % 3], cell[(axis + 1) % 3]]
}

/// Vertices where other than two sharp edges meet, or two at an angle.
fn corners(mesh: &TriMesh, edges: &[[u32; 2]]) -> Vec<DVec3> {
    let mut ends: Vec<(u32, u32)> = edges.iter().flat_map(|&[a, b]| [(a, b), (b, a)]).collect();
    ends.sort_unstable();
    ends.chunk_by(|x, y| x.0 == y.0)
        .filter(|run| {
            let at = |v: u32| mesh.points[v as usize];
            let p = at(run[0].0);
            match run {
                [(_, a), (_, b)] => (p - at(*a)).normalize_or_zero().dot((at(*b) - p).normalize_or_zero()) < BEND,
                // An edge that fades out is no corner to be met.
                [_] => false,
                _ => true,
            }
        })
        .map(|run| mesh.points[run[0].0 as usize])
        .collect()
}

impl MeshCreases {
    /// Where edges cut the square from `low` to `high`, which is perpendicular to `axis`.
    fn cuts_of(&self, axis: usize, low: DVec3, high: DVec3) -> impl Iterator<Item = &Cut> {
        let plane = ((low[axis] - self.lattice.origin[axis]) / self.lattice.step[axis]).round() as i64;
        let [_, v, u] = key(&self.lattice, axis, plane, (low + high) / 2.0);
        let cuts = &self.cuts[axis];
        let first = cuts.partition_point(|c| c.key < [plane, v, u]);
        cuts[first..].iter().take_while(move |c| c.key == [plane, v, u])
    }
}

impl Creases for MeshCreases {
    fn face_point(&self, axis: usize, guess: DVec3, a: (DVec3, DVec3), b: (DVec3, DVec3), size: f64) -> Option<DVec3> {
        let plane = ((guess[axis] - self.lattice.origin[axis]) / self.lattice.step[axis]).round() as i64;
        let [_, v, u] = key(&self.lattice, axis, plane, guess);
        let cuts = &self.cuts[axis];
        let mut best: Option<(f64, DVec3)> = None;
        for dv in -1..=1 {
            let first = cuts.partition_point(|c| c.key < [plane, v + dv, u - 1]);
            let here = cuts[first..].iter().take_while(|c| c.key <= [plane, v + dv, u + 1]);
            for c in here.filter(|c| c.tagged) {
                let agree = |m: DVec3, n: DVec3| a.1.dot(m) > AGREE && b.1.dot(n) > AGREE;
                if !agree(c.normals[0], c.normals[1]) && !agree(c.normals[1], c.normals[0]) {
                    continue;
                }
                let d = c.p.distance(guess);
                if d < LINE_REACH_CELLS * size && best.is_none_or(|b| d < b.0) {
                    best = Some((d, c.p));
                }
            }
        }
        best.map(|b| b.1)
    }

    fn inner_point(
        &self,
        guess: DVec3,
        through: &[DVec3],
        _corner: bool,
        [low, high]: [DVec3; 2],
        _hits: &[(DVec3, DVec3)],
    ) -> Option<DVec3> {
        let cell = cell_of(&self.lattice, (low + high) / 2.0);
        let size = (high - low).max_element();
        let first = self.corners.partition_point(|c| c.0 < cell);
        let here = self.corners[first..].iter().take_while(|c| c.0 == cell).map(|c| c.1);
        if let Some(p) = here.min_by(|p, q| p.distance_squared(guess).total_cmp(&q.distance_squared(guess))) {
            return Some(p);
        }
        let near = if through.len() == 2 { (through[0] + through[1]) / 2.0 } else { guess };
        let hit = self.lines.as_ref()?.closest(near);
        (hit.distance < LINE_REACH_CELLS * size).then_some(hit.position)
    }

    fn nearest(&self, p: DVec3, reach: f64, _hits: &[(DVec3, DVec3)]) -> Option<DVec3> {
        let hit = self.lines.as_ref()?.closest(p);
        (hit.distance < reach).then_some(hit.position)
    }
    fn faint(&self) -> f64 {
        if self.bends.is_some() { FAINT_HITS } else { -1.0 }
    }

    fn faint_point(
        &self,
        axis: usize,
        low: DVec3,
        high: DVec3,
        a: (DVec3, DVec3),
        b: (DVec3, DVec3),
    ) -> Option<(DVec3, bool)> {
        let beside = |m: DVec3, n: DVec3| {
            a.1.dot(m) > FAINT_AGREE && b.1.dot(n) > FAINT_AGREE && a.1.dot(m) >= a.1.dot(n) && b.1.dot(n) >= b.1.dot(m)
        };
        let mut here = self
            .cuts_of(axis, low, high)
            .filter(|c| beside(c.normals[0], c.normals[1]) || beside(c.normals[1], c.normals[0]));
        // More than one line through a face is for a smaller voxel.
        let found = here.next()?;
        here.next().is_none().then_some((found.p, found.tagged))
    }

    fn tip_point(&self, axis: usize, [low, high]: [DVec3; 2], a: (DVec3, DVec3), b: (DVec3, DVec3)) -> Option<DVec3> {
        let here = || self.cuts_of(axis, low, high).filter(|c| c.tagged);
        // Where the surface of a hit ends: it may be one line for both.
        let end = |(p, n): (DVec3, DVec3)| {
            let own = here().filter(|c| c.normals.iter().any(|m| m.dot(n) > AGREE)).map(|c| c.p);
            own.min_by(|x, y| x.distance_squared(p).total_cmp(&y.distance_squared(p)))
        };
        Some((end(a)? + end(b)?) / 2.0)
    }

    fn bend(&self, guess: DVec3, low: DVec3, high: DVec3) -> Option<DVec3> {
        let cell = cell_of(&self.lattice, (low + high) / 2.0);
        let first = self.knots.partition_point(|c| c.0 < cell);
        let here = self.knots[first..].iter().take_while(|c| c.0 == cell).map(|c| c.1);
        let knot = here.min_by(|p, q| p.distance_squared(guess).total_cmp(&q.distance_squared(guess)));
        let near = || {
            let hit = self.bends.as_ref()?.closest(guess);
            (hit.distance < LINE_REACH_CELLS * (high - low).max_element()).then_some(hit.position)
        };
        knot.or_else(near)
    }

    fn corners(&self) -> Vec<DVec3> {
        self.corners.iter().map(|c| c.1).collect()
    }

    fn crowded(&self) -> Vec<(DVec3, [DVec3; 2])> {
        self.crowded.clone()
    }
}
