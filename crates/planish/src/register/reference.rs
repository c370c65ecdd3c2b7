//! The closest place of a surface or a scan, and on which side of it a point lies.
//!
//! The side of a surface is that of the normal at the closest place, which at an edge or a vertex is the mean of the faces
//! around, weighted by their angles: Baerentzen and Aanaes (*Signed Distance Computation Using the Angle Weighted
//! Pseudonormal*, 2005) show that its sign is right everywhere around a closed mesh.
//!
//! A scan has no surface: each of its points stands for a disc in the plane of its nearest neighbours, as far as the last of
//! them. Distances are those from the disc of the nearest point; sides are known where the file has normals.

use crate::cloud::Cloud;
use crate::geom::{Bvh, KdTree};
use crate::linalg::eigen3;
use crate::mesh::{MeshError, TriMesh, check, next, previous};
use crate::observe::{Cancelled, Observer};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// What is compared or fitted: a surface, or the points of a scan.
#[derive(Clone, Debug)]
pub enum Shape {
    /// A mesh.
    Surface(TriMesh),
    /// A scan.
    Points(Cloud),
}

impl Shape {
    /// Its vertices or points.
    pub fn points(&self) -> &[DVec3] {
        match self {
            Shape::Surface(mesh) => &mesh.points,
            Shape::Points(cloud) => &cloud.points,
        }
    }

    /// Its vertices or points.
    pub fn points_mut(&mut self) -> &mut [DVec3] {
        match self {
            Shape::Surface(mesh) => &mut mesh.points,
            Shape::Points(cloud) => &mut cloud.points,
        }
    }

    /// True for a scan.
    pub fn is_scan(&self) -> bool {
        matches!(self, Shape::Points(_))
    }

    /// Outward normals of its vertices or points, where they are known.
    pub fn normals(&self) -> Option<Vec<DVec3>> {
        match self {
            Shape::Surface(mesh) => Some(mesh.vertex_normals()),
            Shape::Points(cloud) => {
                let normals = cloud.attribute("normal", 3)?;
                let vector = |v: &[f32]| DVec3::new(v[0] as f64, v[1] as f64, v[2] as f64).normalize_or_zero();
                Some(normals.values.chunks_exact(3).map(vector).collect())
            }
        }
    }
}

/// Neighbours that make the disc of a point: those around it on a square grid.
const AROUND: usize = 8;
/// Points between two looks at the observer.
const CHUNK: usize = 1 << 14;

/// A shape that distances are measured from.
pub enum Reference {
    /// A surface, its tree, and the normals at its edges and vertices.
    Surface(Box<Sided>),
    /// Points with their discs.
    Discs(Discs),
}

/// A surface whose sides are told apart.
pub struct Sided {
    mesh: TriMesh,
    tree: Bvh,
    vertices: Vec<DVec3>,
    /// Of edges, by their two vertices.
    edges: HashMap<[u32; 2], DVec3>,
}

/// Points and their discs.
pub struct Discs {
    tree: KdTree,
    points: Vec<DVec3>,
    /// Unit normals of the discs; outward where `sided`.
    normals: Vec<DVec3>,
    radii: Vec<f64>,
    sided: bool,
}

/// The closest place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// Where it is.
    pub position: DVec3,
    /// Its distance, world units.
    pub distance: f64,
    /// Unit normal there, of the face for a surface; zero where there is none.
    pub normal: DVec3,
    /// 1 outside, -1 inside, 0 where nobody knows.
    pub side: f64,
}

impl Reference {
    /// Builds the trees.
    /// # Errors
    /// If a mesh is damaged or without triangles, or if cancelled.
    pub fn new(shape: &Shape, observer: &dyn Observer) -> Result<Reference, MeshError> {
        match shape {
            Shape::Surface(mesh) => {
                check(mesh)?;
                let triangles: Vec<[u32; 3]> =
                    (0..mesh.triangles.len()).filter(|&t| mesh.area(t) > 0.0).map(|t| mesh.triangles[t]).collect();
                if triangles.is_empty() {
                    return Err(MeshError::Empty);
                }
                let mesh = TriMesh::new(mesh.points.clone(), triangles);
                let tree = Bvh::watched(&mesh, observer)?;
                let (vertices, edges) = pseudonormals(&mesh);
                Ok(Reference::Surface(Box::new(Sided { mesh, tree, vertices, edges })))
            }
            Shape::Points(cloud) => Ok(Reference::Discs(discs(cloud, shape.normals(), observer)?)),
        }
    }

    /// The place closest to a point.
    pub fn nearest(&self, p: DVec3) -> Near {
        match self {
            Reference::Surface(own) => own.nearest(p),
            Reference::Discs(own) => own.nearest(p),
        }
    }
}

impl Sided {
    fn nearest(&self, p: DVec3) -> Near {
        let hit = self.tree.closest(p);
        let t = self.mesh.triangles[hit.place.face as usize];
        let normal = self.mesh.normal(hit.place.face as usize);
        let on: Vec<u32> = (0..3).filter(|&k| hit.place.bary[k] > 0.0).map(|k| t[k]).collect();
        let outward = match on[..] {
            [v] => self.vertices[v as usize],
            [a, b] => self.edges.get(&[a.min(b), a.max(b)]).copied().unwrap_or(normal),
            _ => normal,
        };
        let side = if (p - hit.position).dot(outward) < 0.0 { -1.0 } else { 1.0 };
        Near { position: hit.position, distance: hit.distance, normal, side }
    }
}

impl Discs {
    fn nearest(&self, p: DVec3) -> Near {
        let Some(i) = self.tree.closest(p) else {
            return Near { position: p, distance: f64::INFINITY, normal: DVec3::ZERO, side: 0.0 };
        };
        let (q, n, r) = (self.points[i as usize], self.normals[i as usize], self.radii[i as usize]);
        let height = (p - q).dot(n);
        let along = (p - q) - n * height;
        let position = q + along.clamp_length_max(r);
        let side = match (self.sided, height < 0.0) {
            (false, _) => 0.0,
            (true, true) => -1.0,
            (true, false) => 1.0,
        };
        Near { position, distance: p.distance(position), normal: n, side }
    }
}

/// Normals at vertices and edges: the sums of those of the faces around, by their angles.
fn pseudonormals(mesh: &TriMesh) -> (Vec<DVec3>, HashMap<[u32; 2], DVec3>) {
    let mut vertices = vec![DVec3::ZERO; mesh.points.len()];
    let mut edges: HashMap<[u32; 2], DVec3> = HashMap::with_capacity(3 * mesh.triangles.len() / 2);
    for t in 0..mesh.triangles.len() {
        let n = mesh.normal(t);
        for h in 3 * t as u32..3 * t as u32 + 3 {
            let [a, b, c] = [h, next(h), previous(h)].map(|h| mesh.origin(h));
            let at = |v: u32| mesh.points[v as usize];
            vertices[a as usize] += n * (at(b) - at(a)).angle_between(at(c) - at(a));
            *edges.entry([a.min(b), a.max(b)]).or_default() += n;
        }
    }
    (vertices, edges)
}

/// The discs of a scan's points that are numbers.
fn discs(cloud: &Cloud, normals: Option<Vec<DVec3>>, observer: &dyn Observer) -> Result<Discs, Cancelled> {
    let ids: Vec<usize> = (0..cloud.points.len()).filter(|&i| cloud.points[i].is_finite()).collect();
    let points: Vec<DVec3> = ids.iter().map(|&i| cloud.points[i]).collect();
    let tree = KdTree::new(&points);
    let mut found: Vec<(DVec3, f64)> = Vec::with_capacity(points.len());
    while found.len() < points.len() {
        observer.check()?;
        let range = found.len()..(found.len() + CHUNK).min(points.len());
        found.par_extend(range.into_par_iter().map(|i| disc(&tree, &points, i)));
    }
    let radii = found.iter().map(|f| f.1).collect();
    let sided = normals.is_some();
    let normals = match normals {
        Some(normals) => ids.iter().map(|&i| normals[i]).collect(),
        None => found.into_iter().map(|f| f.0).collect(),
    };
    Ok(Discs { tree, points, normals, radii, sided })
}

/// Normal and radius of the disc of a point.
fn disc(tree: &KdTree, points: &[DVec3], i: usize) -> (DVec3, f64) {
    let mut near = Vec::with_capacity(AROUND + 1);
    tree.nearest(points[i], AROUND + 1, &mut near);
    let middle = near.iter().map(|n| points[n.1 as usize]).sum::<DVec3>() / near.len() as f64;
    let spread = near.iter().fold(DMat3::ZERO, |m, n| {
        let d = points[n.1 as usize] - middle;
        m + DMat3::from_cols(d * d.x, d * d.y, d * d.z)
    });
    (eigen3(spread).1[0], near.last().map_or(0.0, |n| n.0.sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;
    use crate::mesh::Attribute;
    use crate::observe::Silent;
    use crate::synthetic::shapes;

    #[test]
    fn sides_of_a_box_are_right_at_faces_edges_and_corners_and_distances_are_those_of_the_box() {
        let half = DVec3::new(0.5, 1.0, 1.5);
        let shape = Shape::Surface(shapes::cuboid(2.0 * half, 3));
        let reference = Reference::new(&shape, &Silent).unwrap();
        for k in 0..2000 {
            let at = |j: u64| 2.0 * random::unit(3, 3 * k + j) - 1.0;
            let p = 1.6 * half * DVec3::new(at(0), at(1), at(2));
            let away = p.abs() - half;
            let outside = away.max(DVec3::ZERO).length();
            let signed = if outside > 0.0 { outside } else { away.max_element() };
            let near = reference.nearest(p);
            assert!((near.side * near.distance - signed).abs() < 1e-12, "{p}: {near:?}, not {signed}");
        }
    }

    #[test]
    fn discs_of_a_plane_of_points_measure_the_height_over_the_plane_and_the_way_to_its_rim() {
        let (n, h) = (20, 0.1);
        let points: Vec<DVec3> = (0..n * n).map(|k| DVec3::new((k % n) as f64 * h, (k / n) as f64 * h, 0.0)).collect();
        let mut cloud = Cloud::new(points);
        let place = DVec3::new(0.77, 0.63, 0.4);
        let near = Reference::new(&Shape::Points(cloud.clone()), &Silent).unwrap().nearest(place);
        assert!((near.distance - 0.4).abs() < 1e-12 && near.side == 0.0);
        cloud.attributes.push(Attribute { name: "normal".into(), width: 3, values: [0.0, 0.0, 1.0].repeat(n * n) });
        let reference = Reference::new(&Shape::Points(cloud), &Silent).unwrap();
        assert_eq!([place, place * DVec3::new(1.0, 1.0, -1.0)].map(|p| reference.nearest(p).side), [1.0, -1.0]);
        // Beside the rim: from the last point as far as its disc, whose eighth neighbour lies two steps inside.
        let beside = reference.nearest(DVec3::new(1.9 + 1.0, 0.9, 0.0)).distance;
        assert!((beside - 0.8).abs() < 1e-9, "{beside}");
    }
}
