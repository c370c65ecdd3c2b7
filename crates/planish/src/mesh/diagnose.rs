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

    let keyed = keyed_edges(&triangles);
    let (mut edges, mut boundary, mut over) = (0, Vec::new(), 0);
    for run in keyed.chunk_by(|x, y| x.0 == y.0) {
        edges += 1;
        match run.len() {
            1 => boundary.push(run[0].1),
            2 => {}
            _ => over += 1,
        }
    }
    let mate = mates(&keyed, 3 * triangles.len());
    drop(keyed);
    let orientation = orient(&triangles, &mate);
    let fan = fans(&triangles, &mate);

    // Fans per vertex, of triangles with three different vertices.
    let mut fan_count = vec![0u32; vertices];
    let mut solid = 0;
    for (t, tri) in triangles.iter().enumerate().filter(|(_, t)| !repeats(t)) {
        solid += 1;
        for k in 0..3 {
            fan_count[tri[k] as usize] += (fan[3 * t + k] == (3 * t + k) as u32) as u32;
        }
    }
    let non_manifold_vertices = fan_count.iter().filter(|&&n| n > 1).count();
    // A vertex on an edge of three triangles is counted by its edge.
    let manifold = over == 0 && non_manifold_vertices == 0;

    let mut loops = super::sets::Sets::new(vertices);
    let mut on_boundary = Vec::new();
    for &h in &boundary {
        let (a, b) = (origin(&triangles, h), origin(&triangles, super::next(h)));
        loops.join(a, b);
        on_boundary.extend([a, b]);
    }
    let boundary_loops = {
        let mut roots: Vec<u32> = on_boundary.into_iter().map(|v| loops.root(v)).collect();
        roots.sort_unstable();
        roots.dedup();
        roots.len()
    };

    let mut sides = vec![[0usize; 2]; orientation.pieces];
    let mut open = vec![false; orientation.pieces];
    let mut volumes = vec![0.0; orientation.pieces];
    let mut conflict = false;
    let center = if diagonal > 0.0 { bounds.center() } else { glam::DVec3::ZERO };
    let (mut area, mut degenerate_faces, mut bare_pieces) = (0.0, 0, 0);
    for (t, tri) in triangles.iter().enumerate() {
        let piece = orientation.piece[t] as usize;
        let [a, b, c] = tri.map(|v| mesh.points[v as usize] - center);
        let twice = (b - a).cross(c - a).length();
        area += twice / 2.0;
        let thin = !(twice / 2.0 > DEGENERATE_AREA * diagonal * diagonal);
        degenerate_faces += (repeats(tri) || thin) as usize;
        if repeats(tri) {
            bare_pieces += 1;
            continue;
        }
        sides[piece][orientation.turned[t] as usize] += 1;
        volumes[piece] += a.dot(b.cross(c)) / 6.0;
        for h in 3 * t as u32..3 * t as u32 + 3 {
            let g = mate[h as usize];
            open[piece] |= g == NONE;
            if g != NONE {
                let agree = origin(&triangles, g) != origin(&triangles, h);
                conflict |= agree == (orientation.turned[t] != orientation.turned[g as usize / 3]);
            }
        }
    }
    let flipped_faces = sides.iter().map(|s| s[0].min(s[1])).sum::<usize>();
    let referenced = fan_count.iter().filter(|&&n| n > 0).count();
    let euler = referenced as i64 - edges as i64 + solid as i64;
    let components = orientation.pieces - bare_pieces;
    let watertight = boundary.is_empty() && over == 0 && solid > 0;
    let oriented = flipped_faces == 0 && !conflict;
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
        boundary_edges: boundary.len(),
        euler,
        genus: (manifold && oriented).then(|| components as i64 - (euler + boundary_loops as i64) / 2),
        watertight,
        manifold,
        non_manifold_edges: over,
        non_manifold_vertices,
        duplicate_faces: triangles.len() - sorted.len(),
        degenerate_faces,
        flipped_faces,
        inverted_components: (0..orientation.pieces).filter(|&p| !open[p] && volumes[p] < 0.0).count(),
        unreferenced_vertices: used.iter().filter(|&&u| !u).count(),
        non_finite_vertices: (0..vertices).filter(|v| !finite(v)).count(),
        bad_indices: mesh.triangles.len() - triangles.len(),
        area,
        volume: watertight.then(|| volumes.iter().sum()),
    }
}

/// A triangle's vertices in rising order.
pub(crate) fn sorted_triple(mut t: [u32; 3]) -> [u32; 3] {
    t.sort_unstable();
    t
}
