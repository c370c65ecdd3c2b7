//! A mesh in parts: what some of its triangles are by themselves, and tiles, which are cubes of space.

use super::{FeatureTags, TriMesh};
use glam::DVec3;
use std::collections::{BTreeMap, HashSet};

/// Tiles that a mesh falls into at most: more files in a folder are of use to nobody.
pub const MOST_TILES: usize = 100_000;

/// Up to here every whole number is one of double precision.
const WHOLE: f64 = (1u64 << f64::MANTISSA_DIGITS) as f64;

/// Some triangles of a mesh as a mesh of their own.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshPart {
    /// The triangles in their order, the vertices as these name them first, with their attributes.
    pub mesh: TriMesh,
    /// Sharp edges that a triangle of the part has.
    pub tags: FeatureTags,
    /// For each vertex the one of the whole.
    pub vertices: Vec<u32>,
}

/// Takes parts from a mesh.
pub struct MeshParts<'a> {
    mesh: &'a TriMesh,
    tags: &'a FeatureTags,
    sharp: HashSet<[u32; 2]>,
    /// For each vertex its name in the part that is being made.
    names: Vec<u32>,
}

impl<'a> MeshParts<'a> {
    /// * `tags` - of the mesh, or empty
    pub fn new(mesh: &'a TriMesh, tags: &'a FeatureTags) -> MeshParts<'a> {
        let sharp = tags.edges.iter().copied().collect();
        MeshParts { mesh, tags, sharp, names: vec![u32::MAX; mesh.points.len()] }
    }

    /// A part.
    /// * `faces` - triangles of the mesh, each once
    pub fn part(&mut self, faces: &[u32]) -> MeshPart {
        let mut vertices: Vec<u32> = Vec::new();
        let mut edges: Vec<[u32; 2]> = Vec::new();
        let mut triangles = Vec::with_capacity(faces.len());
        for &f in faces {
            let corners = self.mesh.triangles[f as usize];
            let named = corners.map(|v| {
                let name = &mut self.names[v as usize];
                if *name == u32::MAX {
                    *name = vertices.len() as u32;
                    vertices.push(v);
                }
                *name
            });
            for k in 0..3 {
                let [a, b] = [corners[k], corners[(k + 1) % 3]];
                if self.sharp.contains(&[a.min(b), a.max(b)]) {
                    let [a, b] = [named[k], named[(k + 1) % 3]];
                    edges.push([a.min(b), a.max(b)]);
                }
            }
            triangles.push(named);
        }
        vertices.iter().for_each(|&v| self.names[v as usize] = u32::MAX);
        edges.sort_unstable();
        edges.dedup();
        let of = |v: &u32| self.tags.vertices.get(*v as usize).copied().unwrap_or_default();
        let tags = FeatureTags { vertices: vertices.iter().map(of).collect(), edges };
        let mut mesh = TriMesh::new(vertices.iter().map(|&v| self.mesh.points[v as usize]).collect(), triangles);
        mesh.attributes = self.mesh.attributes.iter().map(|a| a.picked(&vertices)).collect();
        MeshPart { mesh, tags, vertices }
    }
}

/// Why a mesh is not cut into tiles.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TileError {
    /// The side is no length.
    #[error("a tile of side {0}: a length above 0 is needed")]
    Size(f64),
    /// Too many.
    #[error("tiles of side {size} would be more than {MOST_TILES}; larger ones are needed")]
    Many {
        /// The side.
        size: f64,
    },
}

/// Triangles by the tile that their middle lies in: tile `[i, j, k]` is the cube of side `size` from `size * [i, j, k]` on. In the
/// order of the tiles; each triangle is in one.
/// * `shift` - added to the points first: what a mesh was moved by
/// # Errors
/// [`TileError`].
pub fn tiles(mesh: &TriMesh, size: f64, shift: DVec3) -> Result<BTreeMap<[i64; 3], Vec<u32>>, TileError> {
    if !(size.is_finite() && size > 0.0) {
        return Err(TileError::Size(size));
    }
    let reach = mesh.points.iter().map(|&p| (p + shift).abs().max_element()).fold(0.0, f64::max);
    if reach / size >= WHOLE {
        return Err(TileError::Many { size });
    }
    let mut found: BTreeMap<[i64; 3], Vec<u32>> = BTreeMap::new();
    for (f, corners) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = corners.map(|v| mesh.points[v as usize]);
        let tile = (((a + b + c) / 3.0 + shift) / size).floor().to_array().map(|x| x as i64);
        found.entry(tile).or_default().push(f as u32);
        if found.len() > MOST_TILES {
            return Err(TileError::Many { size });
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Adjacency, diagnose, next, sharp_edges};
    use crate::synthetic::shapes::cuboid;

    #[test]
    fn tiles_of_a_cuboid_hold_all_of_it_and_meet_in_the_same_vertices() {
        let mut mesh = cuboid(DVec3::new(4.0, 2.0, 2.0), 8);
        let values = (0..mesh.points.len()).map(|v| v as f32).collect();
        mesh.attributes.push(crate::mesh::Attribute { name: "number".into(), width: 1, values });
        let sharp = sharp_edges(&mesh, &Adjacency::new(&mesh), 30.0);
        let edges = (0..sharp.len() as u32).filter(|&h| sharp[h as usize]);
        let tags = FeatureTags::from_edges(mesh.points.len(), edges.map(|h| [mesh.origin(h), mesh.origin(next(h))]));
        let tiles = tiles(&mesh, 8.0, DVec3::new(0.0, 0.0, 80.0)).unwrap();
        assert_eq!(tiles.len(), 8);
        assert_eq!(*tiles.keys().next().unwrap(), [-1, -1, 9]);
        let mut parts = MeshParts::new(&mesh, &tags);
        let (mut triangles, mut area, mut edges) = (0, 0.0, std::collections::BTreeSet::new());
        for faces in tiles.values() {
            let part = parts.part(faces);
            triangles += part.mesh.triangles.len();
            area += diagnose(&part.mesh).area;
            for (v, &whole) in part.vertices.iter().enumerate() {
                assert_eq!(part.mesh.points[v], mesh.points[whole as usize]);
                assert_eq!(part.mesh.attributes[0].values[v], whole as f32);
                assert_eq!(part.tags.vertices[v], tags.vertices[whole as usize]);
            }
            edges.extend(part.tags.edges.iter().map(|e| {
                let [a, b] = e.map(|v| part.vertices[v as usize]);
                [a.min(b), a.max(b)]
            }));
        }
        assert_eq!(triangles, mesh.triangles.len());
        assert!((area - 40.0).abs() < 1e-12, "{area}");
        assert!(edges.into_iter().eq(tags.edges.iter().copied()));
    }

    #[test]
    fn sides_that_are_none_and_tiles_without_number_are_refused() {
        let mesh = cuboid(DVec3::ONE, 200);
        for size in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(tiles(&mesh, size, DVec3::ZERO), Err(TileError::Size(_))), "{size}");
        }
        for size in [1e-300, 1e-3] {
            assert_eq!(tiles(&mesh, size, DVec3::ZERO), Err(TileError::Many { size }));
        }
    }
}
