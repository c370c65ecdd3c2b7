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
    regions: u8,
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
    let Boundary { region, sides, .. } = &boundary;
    // Regions that are reached from `start` without passing a loop for which `stop` holds.
    let reach = |start: usize, stop: &dyn Fn(usize) -> bool| {
        let mut seen = 1u8 << start;
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
        None => {
            let size = |r: usize| region.iter().filter(|&&x| x == r).count();
            (0..8).filter(|&r| size(r) > 0).max_by_key(|&r| (size(r), 8 - r)).unwrap_or(0)
        }
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
    /// As of [`regions`].
    region: [usize; 8],
    /// The two regions beside each loop: that of the body and that of free space.
    sides: Vec<[usize; 2]>,
}

/// A part of a face between its segments: a polygon, counter-clockwise seen from outside the cell.
struct Piece {
    face: usize,
    /// Corners of the cell among its vertices.
    corners: Vec<usize>,
    outline: Vec<Node>,
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

/// Cuts every face along its segments.
fn pieces(corners: &[DVec3; 8], loops: &[&[Corner]]) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for f in 0..6 {
        // The segments of the face: from an entering edge to a leaving one, over face points.
        let mut chains: Vec<Vec<Corner>> = Vec::new();
        for l in loops {
            for start in 0..l.len() {
                if l[start].edge == FACE_POINT || l[start].face as usize != f {
                    continue;
                }
                let mut chain = vec![l[start]];
                let mut at = (start + 1) % l.len();
                while l[at].edge == FACE_POINT {
                    chain.push(l[at]);
                    at = (at + 1) % l.len();
                }
                chain.push(l[at]);
                chains.push(chain);
            }
        }
        // Walk the outline; at a hit, either follow its segment or stay on the outline.
        let mut ring: Vec<(Node, Option<usize>, Option<usize>)> = Vec::new();
        for m in 0..4 {
            let c = FACES[f][m];
            ring.push((Node { key: c as u64, p: corners[c] }, Some(c), None));
            let e = FACE_EDGES[f][m] as u8;
            for (n, chain) in chains.iter().enumerate() {
                for end in [chain.first(), chain.last()].into_iter().flatten() {
                    if end.edge == e {
                        ring.push((node(end), None, Some(n)));
                    }
                }
            }
        }
        let mut used = [false; 4];
        for m in 0..4 {
            if used[m] {
                continue;
            }
            let mut piece = Piece { face: f, corners: Vec::new(), outline: Vec::new() };
            let start = ring.iter().position(|r| r.1 == Some(FACES[f][m])).unwrap_or(0);
            let mut at = start;
            loop {
                let (n, corner, chain) = ring[at];
                piece.outline.push(n);
                if let Some(c) = corner {
                    piece.corners.push(c);
                    used[FACES[f].iter().position(|&x| x == c).unwrap_or(0)] = true;
                }
                if let Some(c) = chain {
                    // Across to the other end of the segment.
                    let chain = &chains[c];
                    let forward = node(&chain[0]).key == n.key;
                    let inner: Vec<&Corner> = chain[1..chain.len() - 1].iter().collect();
                    if forward {
                        piece.outline.extend(inner.iter().map(|c| node(c)));
                    } else {
                        piece.outline.extend(inner.iter().rev().map(|c| node(c)));
                    }
                    let other = node(if forward { &chain[chain.len() - 1] } else { &chain[0] });
                    piece.outline.push(other);
                    at = ring.iter().position(|r| r.0.key == other.key).unwrap_or(at);
                }
                at = (at + 1) % ring.len();
                if at == start {
                    break;
                }
            }
            pieces.push(piece);
        }
    }
    pieces
}

/// For each corner of the cell the region of the boundary it lies in, named by its least corner.
fn regions(pieces: &[Piece]) -> [usize; 8] {
    let mut region = [0, 1, 2, 3, 4, 5, 6, 7];
    loop {
        let before = region;
        for piece in pieces {
            let least = piece.corners.iter().map(|&c| region[c]).min().unwrap_or(0);
            for &c in &piece.corners {
                region[c] = least;
            }
        }
        if region == before {
            return region;
        }
    }
}

/// Regions on the body's side and on the free side of a loop.
fn beside(l: &[Corner], pieces: &[Piece], region: &[usize; 8], config: u8) -> [usize; 2] {
    let mut sides = [0, 0];
    for piece in pieces {
        let touches = |c: &Corner| {
            c.edge != FACE_POINT && c.face as usize == piece.face && piece.outline.iter().any(|n| n.key == node(c).key)
        };
        if l.iter().any(touches) {
            for &c in &piece.corners {
                sides[(config >> c & 1 == 0) as usize] = region[c];
            }
        }
    }
    sides
}

/// For each corner of the cell its region between the loops.
pub fn regions_of(corners: &[DVec3; 8], loops: &[&[Corner]]) -> [usize; 8] {
    regions(&pieces(corners, loops))
}

/// The two loops that lie between two regions next to a common third: those that a tunnel between the regions joins.
pub fn loops_between(
    corners: &[DVec3; 8],
    config: u8,
    loops: &[&[Corner]],
    from: usize,
    to: usize,
) -> Option<[usize; 2]> {
    let Boundary { region, sides, .. } = Boundary::new(corners, config, loops);
    let (from, to) = (region[from], region[to]);
    for (l, a) in sides.iter().enumerate() {
        for (m, b) in sides.iter().enumerate() {
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
        let pieces = pieces(corners, loops);
        let region = regions(&pieces);
        let sides = loops.iter().map(|l| beside(l, &pieces, &region, config)).collect();
        Boundary { loops, pieces, region, sides }
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
        for piece in &self.pieces {
            let own = piece.corners.first().is_some_and(|&c| patch.regions >> self.region[c] & 1 != 0);
            if !own {
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
