//! What is in a mesh and what is wrong with it; takes any triangle soup. What repair does about it: `docs/methods/mend.md`.

use super::soup::{fans, keyed_edges, mates, orient, origin, repeats};
use super::{NONE, TriMesh};
use crate::geom::Aabb;
use serde::{Deserialize, Serialize};

/// A triangle counts as degenerate below this share of the squared diagonal: its normal is then mostly the
/// rounding of single-precision coordinates.
pub const DEGENERATE_AREA: f64 = 1e-12;

/// Facts about a mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// Vertices, unreferenced ones included.
    pub vertices: usize,
    /// Triangles, bad ones included.
    pub triangles: usize,
    /// Bounding box of the referenced vertices.
    pub bounds: Aabb,
    /// Its diagonal, world units.
    pub diagonal: f64,
    /// Pieces connected over edges.
    pub components: usize,
    /// Closed chains of boundary edges.
    pub boundary_loops: usize,
    /// Edges with one triangle.
    pub boundary_edges: usize,
    /// Referenced vertices - edges + triangles.
    pub euler: i64,
    /// Handles, summed over pieces; of manifold, consistently oriented meshes only.
    pub genus: Option<i64>,
    /// Every edge has exactly two triangles.
    pub watertight: bool,
    /// No non-manifold edge and no non-manifold vertex.
    pub manifold: bool,
    /// Edges with more than two triangles.
    pub non_manifold_edges: usize,
    /// Vertices whose triangles form more than one fan.
    pub non_manifold_vertices: usize,
    /// Triangles that repeat the three vertices of another.
    pub duplicate_faces: usize,
    /// Triangles that name a vertex twice or have less area than [`DEGENERATE_AREA`] of the squared diagonal.
    pub degenerate_faces: usize,
    /// Triangles that run against the majority of their piece.
    pub flipped_faces: usize,
    /// Closed pieces whose volume is negative: inside out, or a void inside another piece.
    pub inverted_components: usize,
    /// Vertices that no triangle uses.
    pub unreferenced_vertices: usize,
    /// Vertices with a position that is not finite.
    pub non_finite_vertices: usize,
    /// Triangles with a vertex index out of range (left out of all other counts).
    pub bad_indices: usize,
    /// Total area, squared world units.
    pub area: f64,
    /// Enclosed volume, cubic world units; of watertight meshes only.
    pub volume: Option<f64>,
}

/// Examines `mesh`; never fails, whatever the triangles.
pub fn diagnose(mesh: &TriMesh) -> Diagnosis {
    let vertices = mesh.points.len();
    let triangles: Vec<[u32; 3]> =
        mesh.triangles.iter().copied().filter(|t| t.iter().all(|&v| (v as usize) < vertices)).collect();
    let mut used = vec![false; vertices];
    triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
    let finite = |v: &usize| mesh.points[*v].is_finite();
    let bounds = Aabb::of((0..vertices).filter(|&v| used[v]).filter(finite).map(|v| &mesh.points[v]));
    let diagonal = bounds.diagonal();
    let edges = Edges::new(&triangles);
    let (fan_count, solid) = fan_counts(&triangles, &edges.mate, vertices);
    let non_manifold_vertices = fan_count.iter().filter(|&&n| n > 1).count();
    // A vertex on an edge of three triangles is counted by its edge.
    let manifold = edges.over == 0 && non_manifold_vertices == 0;
    let boundary_loops = loops(&triangles, &edges.boundary, vertices);
    let pieces = Pieces::new(mesh, &triangles, &edges.mate, &bounds);
    let flipped_faces = pieces.sides.iter().map(|s| s[0].min(s[1])).sum::<usize>();
    let referenced = fan_count.iter().filter(|&&n| n > 0).count();
    let euler = referenced as i64 - edges.count as i64 + solid as i64;
    let components = pieces.sides.len() - pieces.bare;
    let watertight = edges.boundary.is_empty() && edges.over == 0 && solid > 0;
    let oriented = flipped_faces == 0 && !pieces.conflict;
    let mut sorted: Vec<[u32; 3]> = triangles.iter().map(|t| sorted_triple(*t)).collect();
    sorted.sort_unstable();
    sorted.dedup();
    Diagnosis {
        vertices,
        triangles: mesh.triangles.len(),
        bounds,
        diagonal,
        components,
        boundary_loops,
        boundary_edges: edges.boundary.len(),
        euler,
        genus: (manifold && oriented).then(|| components as i64 - (euler + boundary_loops as i64) / 2),
        watertight,
        manifold,
        non_manifold_edges: edges.over,
        non_manifold_vertices,
        duplicate_faces: triangles.len() - sorted.len(),
        degenerate_faces: pieces.degenerate,
        flipped_faces,
        inverted_components: pieces.open.iter().zip(&pieces.volumes).filter(|(open, v)| !**open && **v < 0.0).count(),
        unreferenced_vertices: used.iter().filter(|&&u| !u).count(),
        non_finite_vertices: (0..vertices).filter(|v| !finite(v)).count(),
        bad_indices: mesh.triangles.len() - triangles.len(),
        area: pieces.area,
        volume: watertight.then(|| pieces.volumes.iter().sum()),
    }
}

/// Edges by how many triangles they have.
struct Edges {
    count: usize,
    /// Half-edges of one triangle alone.
    boundary: Vec<u32>,
    /// Edges of more than two.
    over: usize,
    /// For each half-edge that of the other triangle.
    mate: Vec<u32>,
}

impl Edges {
    fn new(triangles: &[[u32; 3]]) -> Edges {
        let keyed = keyed_edges(triangles);
        let mut edges = Edges { count: 0, boundary: Vec::new(), over: 0, mate: mates(&keyed, 3 * triangles.len()) };
        for run in keyed.chunk_by(|x, y| x.0 == y.0) {
            edges.count += 1;
            match run.len() {
                1 => edges.boundary.push(run[0].1),
                2 => {}
                _ => edges.over += 1,
            }
        }
        edges
    }
}

/// Fans around each vertex, of triangles with three different vertices, and the number of these.
fn fan_counts(triangles: &[[u32; 3]], mate: &[u32], vertices: usize) -> (Vec<u32>, usize) {
    let fan = fans(triangles, mate);
    let mut count = vec![0u32; vertices];
    let mut solid = 0;
    for (t, tri) in triangles.iter().enumerate().filter(|(_, t)| !repeats(t)) {
        solid += 1;
        for k in 0..3 {
            count[tri[k] as usize] += (fan[3 * t + k] == (3 * t + k) as u32) as u32;
        }
    }
    (count, solid)
}

/// Number of loops that half-edges of the boundary make.
fn loops(triangles: &[[u32; 3]], boundary: &[u32], vertices: usize) -> usize {
    let mut sets = super::sets::Sets::new(vertices);
    let mut on_boundary = Vec::new();
    for &h in boundary {
        let (a, b) = (origin(triangles, h), origin(triangles, super::next(h)));
        sets.join(a, b);
        on_boundary.extend([a, b]);
    }
    let mut roots: Vec<u32> = on_boundary.into_iter().map(|v| sets.root(v)).collect();
    roots.sort_unstable();
    roots.dedup();
    roots.len()
}

/// Connected pieces, and what is summed over all triangles.
struct Pieces {
    /// Triangles of each piece that agree with its first, and those that do not.
    sides: Vec<[usize; 2]>,
    /// Pieces with a boundary.
    open: Vec<bool>,
    /// Enclosed volumes, as far as the pieces are closed.
    volumes: Vec<f64>,
    /// Pieces that are one triangle with a repeated vertex.
    bare: usize,
    /// A piece has no orientation that all its triangles agree with.
    conflict: bool,
    area: f64,
    /// Triangles with a repeated vertex or without area.
    degenerate: usize,
}

impl Pieces {
    fn new(mesh: &TriMesh, triangles: &[[u32; 3]], mate: &[u32], bounds: &Aabb) -> Pieces {
        let orientation = orient(triangles, mate);
        let diagonal = bounds.diagonal();
        let center = if diagonal > 0.0 { bounds.center() } else { glam::DVec3::ZERO };
        let count = orientation.pieces;
        let mut all = Pieces {
            sides: vec![[0usize; 2]; count],
            open: vec![false; count],
            volumes: vec![0.0; count],
            bare: 0,
            conflict: false,
            area: 0.0,
            degenerate: 0,
        };
        for (t, tri) in triangles.iter().enumerate() {
            let piece = orientation.piece[t] as usize;
            let [a, b, c] = tri.map(|v| mesh.points[v as usize] - center);
            let area = (b - a).cross(c - a).length() / 2.0;
            all.area += area;
            let has_area = area > DEGENERATE_AREA * diagonal * diagonal;
            all.degenerate += (repeats(tri) || !has_area) as usize;
            if repeats(tri) {
                all.bare += 1;
                continue;
            }
            all.sides[piece][orientation.turned[t] as usize] += 1;
            all.volumes[piece] += a.dot(b.cross(c)) / 6.0;
            for h in 3 * t as u32..3 * t as u32 + 3 {
                let g = mate[h as usize];
                all.open[piece] |= g == NONE;
                if g != NONE {
                    let agree = origin(triangles, g) != origin(triangles, h);
                    all.conflict |= agree == (orientation.turned[t] != orientation.turned[g as usize / 3]);
                }
            }
        }
        all
    }
}

/// A triangle's vertices in rising order.
pub(crate) fn sorted_triple(mut t: [u32; 3]) -> [u32; 3] {
    t.sort_unstable();
    t
}
