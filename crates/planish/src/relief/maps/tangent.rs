//! The tangent space that renderers of meshes use: MikkTSpace (Mikkelsen 2008, *Simulation of Wrinkled Surfaces
//! Revisited*), of the base mesh of one patch.

use super::super::frame::Frame;
use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{DVec3, Vec3};

/// A patch as a mesh whose texture coordinates run with its nodes.
struct Mesh<'a> {
    points: &'a [DVec3],
    normals: &'a [DVec3],
    triangles: &'a [[u32; 3]],
    rows: usize,
    cols: usize,
    /// For each node the tangent of one of its corners, and whether the frame is right-handed.
    found: Vec<Option<(Vec3, bool)>>,
}

impl Geometry for Mesh<'_> {
    fn num_faces(&self) -> usize {
        self.triangles.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.points[self.triangles[face][corner] as usize].as_vec3().to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.normals[self.triangles[face][corner] as usize].as_vec3().to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        let node = self.triangles[face][corner] as usize;
        [
            ((node % self.cols) as f64 / (self.cols - 1) as f64) as f32,
            ((node / self.cols) as f64 / (self.rows - 1) as f64) as f32,
        ]
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        let node = self.triangles[face][corner] as usize;
        if let (Some(space), None) = (space, self.found[node]) {
            self.found[node] = Some((Vec3::from(space.tangent()), space.is_orientation_preserving()));
        }
    }
}

/// The tangent frames of the nodes of a patch: `N` the given normal, `T` by MikkTSpace, `B = N x T`, turned round where
/// the texture is mirrored. Where a node has no triangle with an area the frame is that of the surface.
///
/// * `own` - the frames of the surface, whose normals the mesh has
pub(super) fn tangent_frames(
    points: &[DVec3],
    own: Vec<Frame>,
    triangles: &[[u32; 3]],
    shape: [usize; 2],
) -> Vec<Frame> {
    let normals: Vec<DVec3> = own.iter().map(|f| f.normal).collect();
    let [rows, cols] = shape;
    let found = vec![None; points.len()];
    let mut mesh = Mesh { points, normals: &normals, triangles, rows, cols, found };
    // It refuses only meshes without triangles, whose nodes keep the frames of the surface.
    let _ = generate_tangents(&mut mesh);
    let found = mesh.found;
    let frame = |(own, found): (Frame, Option<(Vec3, bool)>)| {
        let Some((tangent, right)) = found else { return own };
        let along = tangent.as_dvec3();
        let Some(tangent) = (along - own.normal * own.normal.dot(along)).try_normalize() else { return own };
        let bitangent = own.normal.cross(tangent);
        Frame { tangent, bitangent: if right { bitangent } else { -bitangent }, normal: own.normal }
    };
    own.into_iter().zip(found).map(frame).collect()
}
