//! What a mesh of patches brings besides places: texture coordinates that fit the displacement maps, and normals.
//!
//! The texture coordinates lie on the texels that [`crate::write_relief`] writes the same place to: an image of `n` pixels has
//! the value at the parameter `u` at `(u (n - 1) + 1/2) / n`. They count from the lower left corner of the image, whose top row
//! is `v = 1`; formats that count from the upper left turn them.

use planish::DVec3;
use planish::relief::{PatchNodes, PatchedMesh, Relief};

/// Normals of two patches at a place are one if they differ by less, degrees; a seam that is meant sharp stays one.
const SHARP_DEG: f64 = 30.0;

/// A mesh of patches with a texture coordinate and a normal for each node of each patch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MappedMesh {
    /// The mesh and its patches.
    pub patched: PatchedMesh,
    /// For each patch and node its texture coordinates, from the lower left corner of the map.
    pub uvs: Vec<Vec<[f32; 2]>>,
    /// For each patch and node the unit normal.
    pub normals: Vec<Vec<DVec3>>,
}

impl MappedMesh {
    /// * `reliefs` - the maps of the patches, if there are any: without them each patch has a map with a texel for each of its nodes
    pub fn new(patched: PatchedMesh, reliefs: &[Relief]) -> MappedMesh {
        let sizes = |p: usize, nodes: &PatchNodes| match reliefs.get(p) {
            Some(relief) => [relief.rows, relief.cols],
            None => [nodes.rows, nodes.cols],
        };
        let uvs = patched.patches.iter().enumerate().map(|(p, nodes)| texels(nodes, sizes(p, nodes))).collect();
        let normals = normals(&patched);
        MappedMesh { patched, uvs, normals }
    }

    /// Moves it.
    pub fn shifted(mut self, by: DVec3) -> MappedMesh {
        self.patched.mesh.points.iter_mut().for_each(|p| *p += by);
        self
    }
}

/// Name of a patch in files: that of its displacement map.
pub(crate) fn patch_name(patch: usize) -> String {
    format!("patch_{patch:04}")
}

/// The texture coordinates of nodes that are even in the parameters.
fn texels(nodes: &PatchNodes, [rows, cols]: [usize; 2]) -> Vec<[f32; 2]> {
    let along = |k: usize, count: usize, pixels: usize| {
        let parameter = k as f64 / (count.max(2) - 1) as f64;
        ((parameter * (pixels.max(1) - 1) as f64 + 0.5) / pixels.max(1) as f64) as f32
    };
    (0..nodes.rows)
        .flat_map(|j| (0..nodes.cols).map(move |i| [i, j]))
        .map(|[i, j]| [along(i, nodes.cols, cols), along(j, nodes.rows, rows)])
        .collect()
}

/// Unit normals of all nodes: that of the triangles of the patch around a node, joined with those of the other patches there
/// unless the seam is sharp.
fn normals(patched: &PatchedMesh) -> Vec<Vec<DVec3>> {
    let points = &patched.mesh.points;
    let area = |nodes: &PatchNodes| {
        let mut sums = vec![DVec3::ZERO; nodes.vertices.len()];
        for triangle in &nodes.triangles {
            let [a, b, c] = triangle.map(|n| points[nodes.vertices[n as usize] as usize]);
            triangle.iter().for_each(|&n| sums[n as usize] += (b - a).cross(c - a));
        }
        sums
    };
    let own: Vec<Vec<DVec3>> = patched.patches.iter().map(area).collect();
    // The area vectors of the nodes at each vertex, one vertex after the other.
    let mut first = vec![0; points.len() + 1];
    for &v in patched.patches.iter().flat_map(|nodes| &nodes.vertices) {
        first[v as usize + 1] += 1;
    }
    (0..points.len()).for_each(|v| first[v + 1] += first[v]);
    let mut next = first.clone();
    let mut around = vec![DVec3::ZERO; first[points.len()]];
    for (&v, &n) in patched.patches.iter().flat_map(|nodes| &nodes.vertices).zip(own.iter().flatten()) {
        around[next[v as usize]] = n;
        next[v as usize] += 1;
    }
    let sharp = SHARP_DEG.to_radians().cos();
    let joined = |v: u32, own: DVec3| {
        let here = &around[first[v as usize]..first[v as usize + 1]];
        let is_one = |n: &&DVec3| own == DVec3::ZERO || n.dot(own) >= sharp * n.length() * own.length();
        // A node without triangles beside others without any: some unit vector, as the formats want.
        here.iter().filter(is_one).sum::<DVec3>().try_normalize().unwrap_or(DVec3::Z)
    };
    let of_patch = |(nodes, own): (&PatchNodes, &Vec<DVec3>)| {
        nodes.vertices.iter().zip(own).map(|(&v, &n)| joined(v, n)).collect()
    };
    patched.patches.iter().zip(&own).map(of_patch).collect()
}
