//! The working mesh of a layout: the input with long edges split, so that curves have room to move.
//!
//! See `docs/methods/layout.md`, step 1.

use crate::geom::predicates::orient2d;
use crate::mesh::change::{Changing, Flip};
use crate::mesh::{Adjacency, FacePoint, NONE, TriMesh, next};
use glam::{DVec2, DVec3};
use std::collections::HashMap;

/// Rounds of splitting; each halves an edge, so this reaches a 4096th of the longest edge.
const SPLIT_ROUNDS: usize = 12;

/// Sweeps over the edges inside faces of the input, of which each turns those that are worse than the other diagonal. Few are
/// needed between two rounds of splitting; faces without area might never end.
const MAX_TURN_SWEEPS: usize = 32;

/// The cotangents of the angles opposite to an edge must sum to less than this for it to be turned; below zero, so that
/// four points on a circle stay as they are.
const TURN_BELOW: f64 = -1e-3;

/// The refined mesh with the way back.
#[derive(Clone)]
pub(in crate::layout) struct Refined {
    pub mesh: TriMesh,
    /// For each triangle the input face, and its corners as barycentric coordinates of that face.
    pub parent: Vec<(u32, [[f64; 3]; 3])>,
}

/// Splits every edge longer than `longest` at its middle until none is left or there would be more than `most` triangles:
/// halving both long edges of a needle makes three of it, so that one of n lengths ends as n^1.6 triangles. Edges with both
/// ends on a fixed line (`fixed`, per vertex) are split once in any case: a curve across a narrow strip needs an inner vertex.
pub(in crate::layout) fn refine(mesh: &TriMesh, longest: f64, fixed: &[bool], most: usize) -> Refined {
    let mut work = Refined::new(mesh);
    for round in 0..SPLIT_ROUNDS {
        let chosen = work.edges(|h, [a, b]| {
            let narrow = round == 0 && fixed[a as usize] && fixed[b as usize];
            narrow || work.mesh.edge_length(h) > longest
        });
        if round > 0 && count(&work, &chosen) > most {
            break;
        }
        let (finer, from) = split(&work, &chosen);
        if from.len() == work.parent.len() {
            break;
        }
        work = finer;
    }
    work
}

/// Triangles that [`split`] would leave.
pub(super) fn count(work: &Refined, chosen: &[bool]) -> usize {
    work.mesh.triangles.len() + chosen.iter().filter(|c| **c).count()
}

/// Splits the edges of the half-edges `chosen`, which are so from both sides, at their middle. Returns the finer mesh and for
/// each of its faces the face that it is a part of.
pub(in crate::layout) fn split(work: &Refined, chosen: &[bool]) -> (Refined, Vec<u32>) {
    let adjacency = Adjacency::new(&work.mesh);
    let mut middle: HashMap<u32, u32> = HashMap::new();
    let mut points = work.mesh.points.clone();
    for h in 0..adjacency.opposite.len() as u32 {
        let o = adjacency.opposite[h as usize];
        let (a, b) = (work.mesh.origin(h), work.mesh.origin(next(h)));
        // From the lower vertex, so that the place does not depend on the face.
        let (a, b) = (a.min(b), a.max(b));
        if (o == NONE || h < o) && chosen[h as usize] {
            let m = points.len() as u32;
            points.push(points[a as usize].midpoint(points[b as usize]));
            middle.insert(h, m);
            if o != NONE {
                middle.insert(o, m);
            }
        }
    }
    let mut from = Vec::with_capacity(work.parent.len());
    let mut triangles = Vec::with_capacity(work.mesh.triangles.len());
    let mut parent = Vec::with_capacity(work.parent.len());
    for (f, (&tri, &(face, bary))) in work.mesh.triangles.iter().zip(&work.parent).enumerate() {
        let mids: [Option<u32>; 3] = std::array::from_fn(|k| middle.get(&(3 * f as u32 + k as u32)).copied());
        let half = |k: usize| -> [f64; 3] { std::array::from_fn(|i| (bary[k][i] + bary[(k + 1) % 3][i]) / 2.0) };
        // Corners 0..3 are the triangle's, 3..6 the middles of its edges.
        let names = [tri[0], tri[1], tri[2], mids[0].unwrap_or(NONE), mids[1].unwrap_or(NONE), mids[2].unwrap_or(NONE)];
        let places = [bary[0], bary[1], bary[2], half(0), half(1), half(2)];
        let split: Vec<usize> = (0..3).filter(|&k| mids[k].is_some()).collect();
        let pieces: Vec<[usize; 3]> = match split[..] {
            [] => vec![[0, 1, 2]],
            [k] => vec![[k, 3 + k, (k + 2) % 3], [3 + k, (k + 1) % 3, (k + 2) % 3]],
            [_, _] => {
                let k = (0..3).find(|&k| mids[k].is_none()).expect("one edge is whole");
                let (a, b, c) = (k, (k + 1) % 3, (k + 2) % 3);
                let (m, n) = (3 + b, 3 + c); // on b-c and c-a
                let at = |i: usize| points[names[i] as usize];
                if at(a).distance(at(m)) <= at(b).distance(at(n)) {
                    vec![[m, c, n], [a, b, m], [a, m, n]]
                } else {
                    vec![[m, c, n], [a, b, n], [b, m, n]]
                }
            }
            _ => vec![[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
        };
        for piece in pieces {
            triangles.push(piece.map(|i| names[i]));
            parent.push((face, piece.map(|i| places[i])));
            from.push(f as u32);
        }
    }
    (Refined { mesh: TriMesh::new(points, triangles), parent }, from)
}

/// Turns edges inside faces of the input where that makes the angles opposite to them smaller (Lawson 1977): the surface
/// stays as it is. None comes to join two vertices that are `on_line`.
pub(super) fn turn_inner(work: &mut Refined, on_line: &[bool]) {
    let mut changing = Changing::new(&work.mesh.triangles, work.mesh.points.len(), &[]);
    let inputs = work.parent.iter().map(|p| p.0 as usize + 1).max().unwrap_or(0);
    let mut pieces = vec![0u32; inputs];
    work.parent.iter().for_each(|p| pieces[p.0 as usize] += 1);
    let parted: Vec<u32> = (0..changing.len()).filter(|&t| pieces[work.parent[t as usize].0 as usize] > 1).collect();
    for _ in 0..MAX_TURN_SWEEPS {
        let mut is_done = true;
        for &t in &parted {
            for k in 0..3 {
                let free = |flip: &Flip| !flip.tips.iter().all(|&v| on_line[v as usize]);
                let Some(flip) = changing.flip_of(t, k).filter(free) else { continue };
                let Some(corners) = turned(work, &changing, &flip) else { continue };
                flip.triangles.iter().zip(corners).for_each(|(&f, corners)| work.parent[f as usize].1 = corners);
                changing.flip(&flip);
                is_done = false;
            }
        }
        if is_done {
            break;
        }
    }
    work.mesh.triangles = changing.into_triangles();
}

/// The corners of both triangles in their face of the input once an edge is turned; `None` if it is on an edge of that face,
/// or no worse than the one in its place.
fn turned(work: &Refined, changing: &Changing, flip: &Flip) -> Option<[[[f64; 3]; 3]; 2]> {
    let [f, g] = flip.triangles;
    if work.parent[f as usize].0 != work.parent[g as usize].0 {
        return None;
    }
    let at = |v: u32| work.mesh.points[v as usize];
    let is_worse = has_greater_angles(flip.edge.map(at), flip.tips.map(at));
    let place = |v: u32| {
        let t = if changing.corners(f).contains(&v) { f } else { g };
        let k = changing.corners(t).iter().position(|&x| x == v).expect("a corner of one of both");
        work.parent[t as usize].1[k]
    };
    // Two weights of three are coordinates in the face, exact on its edges.
    let is_left = |corners: [[f64; 3]; 3]| {
        let [a, b, c] = corners.map(|weights| DVec2::new(weights[1], weights[2]));
        orient2d(a, b, c) > 0.0
    };
    let corners = flip.corners.map(|names| names.map(place));
    (is_worse && corners.into_iter().all(is_left)).then_some(corners)
}

/// True if the angles opposite to an edge, at the tips of its triangles, are greater together than those of the edge between
/// the tips would be; false where a triangle has no area.
pub(super) fn has_greater_angles([a, b]: [DVec3; 2], tips: [DVec3; 2]) -> bool {
    let cotangent = |tip: DVec3| (a - tip).dot(b - tip) / (a - tip).cross(b - tip).length();
    cotangent(tips[0]) + cotangent(tips[1]) < TURN_BELOW
}

/// Splits the faces that `chosen` accepts into three at their middle.
pub(super) fn split_faces(work: &mut Refined, chosen: impl Fn(u32) -> bool) {
    for f in (0..work.parent.len()).filter(|&f| chosen(f as u32)) {
        let (face, bary) = work.parent[f];
        let tri = work.mesh.triangles[f];
        let m = work.mesh.points.len() as u32;
        let middle = std::array::from_fn(|i| (bary[0][i] + bary[1][i] + bary[2][i]) / 3.0);
        work.mesh.points.push(work.mesh.corners(f).into_iter().sum::<DVec3>() / 3.0);
        for k in 0..3 {
            let (triangle, corners) = ([tri[k], tri[(k + 1) % 3], m], [bary[k], bary[(k + 1) % 3], middle]);
            if k == 0 {
                work.mesh.triangles[f] = triangle;
                work.parent[f] = (face, corners);
            } else {
                work.mesh.triangles.push(triangle);
                work.parent.push((face, corners));
            }
        }
    }
}

impl Refined {
    /// The mesh as it is.
    pub fn new(mesh: &TriMesh) -> Refined {
        let unit = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        Refined {
            mesh: TriMesh::new(mesh.points.clone(), mesh.triangles.clone()),
            parent: (0..mesh.triangles.len() as u32).map(|f| (f, unit)).collect(),
        }
    }

    /// Splits the edge of these half-edges, one of the boundary or two that are opposite to each other, at its middle. Each of
    /// their faces keeps the part at the start of its half-edge; the other parts come after all faces there are.
    pub fn split_edge(&mut self, halves: &[u32]) {
        let [a, b] = [halves[0], next(halves[0])].map(|h| self.mesh.origin(h));
        let middle = self.mesh.points.len() as u32;
        self.mesh.points.push(self.mesh.points[a as usize].midpoint(self.mesh.points[b as usize]));
        for &h in halves {
            let (f, k) = (h as usize / 3, h as usize % 3);
            let end = (k + 1) % 3;
            let (mut names, (face, mut places)) = (self.mesh.triangles[f], self.parent[f]);
            let half = std::array::from_fn(|i| (places[k][i] + places[end][i]) / 2.0);
            (self.mesh.triangles[f][end], self.parent[f].1[end]) = (middle, half);
            (names[k], places[k]) = (middle, half);
            self.mesh.triangles.push(names);
            self.parent.push((face, places));
        }
    }

    /// For each half-edge whether `chosen` accepts it; it is given the ends too, the lower vertex first.
    pub fn edges(&self, chosen: impl Fn(u32, [u32; 2]) -> bool) -> Vec<bool> {
        let ends = |h: u32| {
            let (a, b) = (self.mesh.origin(h), self.mesh.origin(next(h)));
            [a.min(b), a.max(b)]
        };
        (0..3 * self.mesh.triangles.len() as u32).map(|h| chosen(h, ends(h))).collect()
    }

    /// The half-edge of the input that a half-edge is a piece of, if it is on an edge of the input.
    pub fn edge_of(&self, h: u32) -> Option<u32> {
        let (face, corners) = self.parent[h as usize / 3];
        let (a, b) = (corners[h as usize % 3], corners[next(h) as usize % 3]);
        // On the edge opposite to corner i both ends have weight zero there (exactly: halves of zeros).
        (0..3).find(|&i| a[i] == 0.0 && b[i] == 0.0).map(|i| 3 * face + (i as u32 + 1) % 3)
    }

    /// The place of barycentric `bary` in refined face `f`, as a face point of the input mesh.
    pub fn to_input(&self, f: u32, bary: [f64; 3]) -> FacePoint {
        let (face, corners) = self.parent[f as usize];
        let weights = std::array::from_fn(|i| (0..3).map(|k| bary[k] * corners[k][i]).sum());
        FacePoint { face, bary: weights }
    }
}
