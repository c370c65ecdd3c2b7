//! The last resort of a cell: patches pushed in from its boundary.
//!
//! The loops of a cell are disjoint simple polygons on its boundary and part it into regions. With one region as the
//! root, every loop bounds a cap, the part of the boundary beyond it. The cap, shrunk a little towards the middle of the
//! cell, with a collar of quadrilaterals between the loop and its shrunk copy, is a patch that spans the loop; caps
//! within caps shrink less. All these patches are embedded and disjoint whatever the loops are: rays from the middle
//! meet each at most once, in the order of their depths. Two loops that a tunnel joins are spanned by the region
//! between them in the same way. The result is coarse but right, and rarely needed.
//!
//! See `docs/decisions/0006-certified-cells.md`.

use super::{FACE_EDGES, FACES};
use crate::geom::predicates::orient2d;
use glam::{DVec2, DVec3};

/// One vertex of a loop.
#[derive(Clone, Copy, Debug)]
pub struct Corner {
    /// Name of the vertex in the mesh.
    pub id: u32,
    /// Position.
    pub p: DVec3,
    /// Normal of the hit; zero for a face point.
    pub n: DVec3,
    /// Bits of the faces of the cell on which it lies.
    pub faces: u8,
    /// Edge of the cell on which it lies; [`FACE_POINT`] for a face point.
    pub edge: u8,
    /// Face in which the segment to the next vertex lies.
    pub face: u8,
    /// True for a face point on a sharp line; others are bends that are no features.
    pub tagged: bool,
}

/// Edge of a vertex that lies inside a face.
pub const FACE_POINT: u8 = u8::MAX;

/// A patch over one loop, or over two that a tunnel joins.
struct Patch {
    loops: Vec<usize>,
    /// Bits of its regions.
    regions: u64,
    depth: usize,
}

/// Depth by which caps shrink, as a fraction of the way to the middle, for each level of nesting.
const PUSH: f64 = 0.12;

/// Patches for all loops of a cell.
/// * `corners`, `config` - the cell's eight positions and the bits of the inside ones
/// * `loops` - closed chains on its boundary, each counter-clockwise around its patch seen from outside the body
/// * `tunnel` - two loops that one patch spans, if any
/// * `vertex` - makes a new vertex and names it
/// * `triangle` - takes a triangle
pub fn caps(
    corners: &[DVec3; 8],
    config: u8,
    loops: &[&[Corner]],
    tunnel: Option<[usize; 2]>,
    vertex: &mut dyn FnMut(DVec3) -> u32,
    triangle: &mut dyn FnMut([u32; 3]),
) {
    let middle = (corners[0] + corners[7]) / 2.0;
    let boundary = Boundary::new(corners, config, loops);
    let Boundary { sides, .. } = &boundary;
    // Regions that are reached from `start` without passing a loop for which `stop` holds.
    let reach = |start: usize, stop: &dyn Fn(usize) -> bool| {
        let mut seen = 1u64 << start;
        loop {
            let before = seen;
            for (l, [a, b]) in sides.iter().enumerate() {
                if !stop(l) && (seen >> a & 1 != 0 || seen >> b & 1 != 0) {
                    seen |= 1 << a | 1 << b;
                }
            }
            if seen == before {
                return seen;
            }
        }
    };
    let root = match tunnel {
        // Any region but the one between the two.
        Some([l, m]) => sides[l].into_iter().find(|r| !sides[m].contains(r)).unwrap_or(sides[l][0]),
        None => boundary.largest(),
    };
    let mut patches: Vec<Patch> = Vec::new();
    for l in 0..loops.len() {
        let near = reach(root, &|m| m == l);
        let beyond = if near >> sides[l][0] & 1 == 0 { sides[l][0] } else { sides[l][1] };
        match tunnel {
            Some([a, b]) if l == a || l == b => {
                if l == a {
                    let between = sides[a].into_iter().find(|r| sides[b].contains(r)).unwrap_or(beyond);
                    let regions = reach(between, &|m| m == a || m == b);
                    patches.push(Patch { loops: vec![a, b], regions, depth: 0 });
                }
            }
            _ => patches.push(Patch { loops: vec![l], regions: reach(beyond, &|m| m == l), depth: 0 }),
        }
    }
    // Deeper than every patch within.
    for _ in 0..patches.len() {
        for p in 0..patches.len() {
            let within = |q: &Patch| q.regions & patches[p].regions == q.regions && q.regions != patches[p].regions;
            patches[p].depth = 1 + patches.iter().filter(|q| within(q)).map(|q| q.depth).max().unwrap_or(0);
        }
    }
    for patch in &patches {
        boundary.push_in(patch, middle, vertex, triangle);
    }
}

/// The boundary of a cell, cut along the loops on it.
struct Boundary<'a> {
    loops: &'a [&'a [Corner]],
    pieces: Vec<Piece>,
    /// For each piece the region of the boundary that it is part of, named by its first piece.
    region: Vec<usize>,
    /// The two regions beside each loop: that of the body and that of free space.
    sides: Vec<[usize; 2]>,
}

/// A part of a face between its segments: a polygon, counter-clockwise seen from outside the cell.
struct Piece {
    face: usize,
    /// Corners of the cell among its vertices.
    corners: Vec<usize>,
    outline: Vec<Node>,
    /// True if it lies in the body.
    inside: bool,
    /// Loops along it.
    loops: Vec<usize>,
    /// Its parts of the edges of the cell, by the keys of their ends.
    rims: Vec<[u64; 2]>,
}

#[derive(Clone, Copy)]
struct Node {
    /// A name that is the same for the same vertex in all pieces: corners of the cell are 0..8.
    key: u64,
    p: DVec3,
}

fn node(c: &Corner) -> Node {
    Node { key: c.id as u64 + 8, p: c.p }
}

/// A vertex on the outline of a face.
struct OnRing {
    node: Node,
    /// The corner of the cell that it is.
    corner: Option<usize>,
    /// The segment that it ends.
    segment: Option<usize>,
}

/// A segment of a face: from a hit over face points to a hit, and its loop.
type Segment = (Vec<Corner>, usize);

/// The segments of a face.
fn segments(face: usize, loops: &[&[Corner]]) -> Vec<Segment> {
    let mut segments: Vec<Segment> = Vec::new();
    for (number, l) in loops.iter().enumerate() {
        for start in 0..l.len() {
            if l[start].edge == FACE_POINT || l[start].face as usize != face {
                continue;
            }
            let mut chain = vec![l[start]];
            let mut at = (start + 1) % l.len();
            while l[at].edge == FACE_POINT {
                chain.push(l[at]);
                at = (at + 1) % l.len();
            }
            chain.push(l[at]);
            segments.push((chain, number));
        }
    }
    segments
}

/// The outline of a face, counter-clockwise.
fn ring(corners: &[DVec3; 8], face: usize, segments: &[Segment]) -> Vec<OnRing> {
    let mut ring: Vec<OnRing> = Vec::new();
    for m in 0..4 {
        let c = FACES[face][m];
        ring.push(OnRing { node: Node { key: c as u64, p: corners[c] }, corner: Some(c), segment: None });
        let (e, first) = (FACE_EDGES[face][m] as u8, ring.len());
        for (n, (chain, _)) in segments.iter().enumerate() {
            for end in [chain.first(), chain.last()].into_iter().flatten().filter(|end| end.edge == e) {
                ring.push(OnRing { node: node(end), corner: None, segment: Some(n) });
            }
        }
        let from = |n: &OnRing| n.node.p.distance_squared(corners[c]);
        ring[first..].sort_by(|a, b| from(a).total_cmp(&from(b)));
    }
    ring
}

/// Cuts every face along its segments.
fn pieces(corners: &[DVec3; 8], config: u8, loops: &[&[Corner]]) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for face in 0..6 {
        let segments = segments(face, loops);
        let ring = ring(corners, face, &segments);
        // Whether the outline after each vertex lies in the body.
        let mut is_inside = false;
        let inside: Vec<bool> = (ring.iter())
            .map(|n| {
                is_inside = n.corner.map_or(!is_inside, |c| config >> c & 1 != 0);
                is_inside
            })
            .collect();
        let mut used = vec![false; ring.len()];
        for start in 0..ring.len() {
            if used[start] {
                continue;
            }
            let (outline, corners, loops, rims) = Default::default();
            let mut piece = Piece { face, corners, outline, inside: inside[start], loops, rims };
            let mut at = start;
            loop {
                // Along the outline; at a hit across, to the other end of its segment.
                used[at] = true;
                piece.outline.push(ring[at].node);
                piece.corners.extend(ring[at].corner);
                let next = (at + 1) % ring.len();
                let ends = [ring[at].node.key, ring[next].node.key];
                piece.rims.push([ends[0].min(ends[1]), ends[0].max(ends[1])]);
                at = next;
                if let Some((chain, own)) = ring[at].segment.map(|n| &segments[n]) {
                    piece.loops.push(*own);
                    piece.outline.push(ring[at].node);
                    let is_forward = node(&chain[0]).key == ring[at].node.key;
                    let inner = chain[1..chain.len() - 1].iter().map(node);
                    let other = if is_forward {
                        piece.outline.extend(inner);
                        &chain[chain.len() - 1]
                    } else {
                        piece.outline.extend(inner.rev());
                        &chain[0]
                    };
                    at = ring.iter().position(|n| n.node.key == node(other).key).unwrap_or(at);
                }
                if at == start {
                    break;
                }
            }
            pieces.push(piece);
        }
    }
    pieces
}

/// For each piece its region: pieces of two faces with a common part of an edge are of one.
fn regions(pieces: &[Piece]) -> Vec<usize> {
    let mut region: Vec<usize> = (0..pieces.len()).collect();
    loop {
        let before = region.clone();
        for (p, piece) in pieces.iter().enumerate() {
            for (q, other) in pieces[..p].iter().enumerate() {
                if piece.rims.iter().any(|rim| other.rims.contains(rim)) {
                    let least = region[p].min(region[q]);
                    (region[p], region[q]) = (least, least);
                }
            }
        }
        if region == before {
            return region;
        }
    }
}

/// For each corner of the cell its region between the loops, named by its least corner.
pub fn regions_of(corners: &[DVec3; 8], config: u8, loops: &[&[Corner]]) -> [usize; 8] {
    let boundary = Boundary::new(corners, config, loops);
    std::array::from_fn(|c| boundary.least_corner(boundary.at_corner(c)).unwrap_or(c))
}

/// The two loops that lie between two regions next to a common third: those that a tunnel between the regions joins.
pub fn loops_between(
    corners: &[DVec3; 8],
    config: u8,
    loops: &[&[Corner]],
    from: usize,
    to: usize,
) -> Option<[usize; 2]> {
    let boundary = Boundary::new(corners, config, loops);
    let (from, to) = (boundary.at_corner(from), boundary.at_corner(to));
    for (l, a) in boundary.sides.iter().enumerate() {
        for (m, b) in boundary.sides.iter().enumerate() {
            if l != m
                && a.contains(&from)
                && b.contains(&to)
                && a.iter().any(|r| *r != from && *r != to && b.contains(r))
            {
                return Some([l, m]);
            }
        }
    }
    None
}

impl<'a> Boundary<'a> {
    fn new(corners: &[DVec3; 8], config: u8, loops: &'a [&'a [Corner]]) -> Boundary<'a> {
        let pieces = pieces(corners, config, loops);
        let region = regions(&pieces);
        let mut sides = vec![[0, 0]; loops.len()];
        for (piece, &own) in pieces.iter().zip(&region) {
            piece.loops.iter().for_each(|&l| sides[l][usize::from(!piece.inside)] = own);
        }
        Boundary { loops, pieces, region, sides }
    }

    /// The region of a corner of the cell.
    fn at_corner(&self, corner: usize) -> usize {
        let piece = self.pieces.iter().position(|piece| piece.corners.contains(&corner));
        piece.map_or(0, |p| self.region[p])
    }

    /// The corners of the cell in a region, some more than once.
    fn corners_of(&self, region: usize) -> impl Iterator<Item = usize> + '_ {
        let own = self.pieces.iter().zip(&self.region).filter(move |(_, r)| **r == region);
        own.flat_map(|(piece, _)| piece.corners.iter().copied())
    }

    fn least_corner(&self, region: usize) -> Option<usize> {
        self.corners_of(region).min()
    }

    /// The region with most corners of the cell.
    fn largest(&self) -> usize {
        let size = |&r: &usize| (self.corners_of(r).count(), self.least_corner(r).map(std::cmp::Reverse));
        self.region.iter().copied().max_by_key(size).unwrap_or(0)
    }

    /// Makes a patch: its caps, shrunk towards the middle, and the collars around them.
    fn push_in(
        &self,
        patch: &Patch,
        middle: DVec3,
        vertex: &mut dyn FnMut(DVec3) -> u32,
        triangle: &mut dyn FnMut([u32; 3]),
    ) {
        let scale = 1.0 - PUSH * patch.depth as f64;
        let mut made: Vec<(u64, u32)> = Vec::new();
        let mut shrunk = |n: Node, vertex: &mut dyn FnMut(DVec3) -> u32| match made.iter().find(|m| m.0 == n.key) {
            Some(m) => m.1,
            None => {
                let id = vertex(middle + (n.p - middle) * scale);
                made.push((n.key, id));
                id
            }
        };
        for &l in &patch.loops {
            let l = self.loops[l];
            for k in 0..l.len() {
                let (a, b) = (&l[k], &l[(k + 1) % l.len()]);
                let (sa, sb) = (shrunk(node(a), vertex), shrunk(node(b), vertex));
                triangle([a.id, b.id, sb]);
                triangle([a.id, sb, sa]);
            }
        }
        // The side on which the loops see the patch: a cap of the body is seen from the middle.
        let Some(first) = patch.loops.first().map(|&l| self.sides[l]) else { return };
        let body = patch.regions >> first[0] & 1 != 0;
        for (piece, &region) in self.pieces.iter().zip(&self.region) {
            if patch.regions >> region & 1 == 0 {
                continue;
            }
            let axis = piece.face / 2;
            let flat = |p: DVec3| {
                let q = DVec2::new(p[(axis + 1) % 3], p[(axis + 2) % 3]);
                // Faces with an odd number look along their axis.
                if piece.face % 2 == 1 { q } else { DVec2::new(q.y, q.x) }
            };
            let outline: Vec<DVec2> = piece.outline.iter().map(|n| flat(n.p)).collect();
            for t in ears(&outline) {
                let ids = t.map(|k| shrunk(piece.outline[k], vertex));
                triangle(if body { [ids[0], ids[2], ids[1]] } else { ids });
            }
        }
    }
}

/// Cuts ears off a simple polygon that runs counter-clockwise.
fn ears(outline: &[DVec2]) -> Vec<[usize; 3]> {
    let mut rest: Vec<usize> = (0..outline.len()).collect();
    let mut triangles = Vec::new();
    while rest.len() > 2 {
        let n = rest.len();
        let three = |k: usize| [rest[(k + n - 1) % n], rest[k], rest[(k + 1) % n]];
        let free = |k: usize| {
            let [a, b, c] = three(k).map(|v| outline[v]);
            orient2d(a, b, c) > 0.0
                && rest.iter().filter(|v| !three(k).contains(v)).all(|&v| {
                    let p = outline[v];
                    orient2d(a, b, p) < 0.0 || orient2d(b, c, p) < 0.0 || orient2d(c, a, p) < 0.0
                })
        };
        let k = (0..n).find(|&k| free(k)).unwrap_or(0);
        triangles.push(three(k));
        rest.remove(k);
    }
    triangles
}
