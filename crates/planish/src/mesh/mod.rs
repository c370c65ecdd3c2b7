//! Triangle meshes: flat arrays, adjacency, places on the surface.

mod adjacency;
pub(crate) mod change;
pub mod compare;
pub mod decimate;
pub(crate) mod diagnose;
pub(crate) mod disjoint;
mod features;
pub(crate) mod intersect;
pub mod path;
pub(crate) mod sets;
pub mod smooth;
pub(crate) mod soup;
mod tags;
mod tiles;
mod walk;

pub use adjacency::{Adjacency, Fan, NONE, next, previous};
pub use compare::{CompareError, CompareParams, Comparison, compare, compare_samples};
pub use decimate::{DecimateError, DecimateParams, DecimateTarget, Decimated, decimate};
pub use diagnose::{DEGENERATE_AREA, Diagnosis, diagnose};
pub use features::{boundary_loops, components, sharp_edges};
pub use intersect::{folded_back, self_intersections};
pub use smooth::{SmoothError, SmoothParams, Smoothed, smooth};
pub use soup::check;
pub use tags::{FEATURE, FeatureKind, FeatureTags};
pub use tiles::{MOST_TILES, MeshPart, MeshParts, TileError, tiles};
pub use walk::{CurvePlace, move_point_on_curve, move_point_on_surface};

pub use crate::geom::FacePoint;

use crate::geom::{Aabb, Triangles};
use crate::observe::Cancelled;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A triangle mesh with flat arrays. Triangles run counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriMesh {
    /// Vertex positions, world units.
    pub points: Vec<DVec3>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Named scalars or vectors per vertex (colour, normal, confidence ...), carried through.
    pub attributes: Vec<Attribute>,
}

/// One named quantity per vertex.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Attribute {
    /// `"normal"` (width 3), `"color"` (width 3 or 4, 0 to 1), or the name found in the file.
    pub name: String,
    /// Numbers per vertex.
    pub width: usize,
    /// `width` numbers per vertex, vertex after vertex.
    pub values: Vec<f32>,
}

impl Attribute {
    /// That of some vertices, in their order.
    pub(crate) fn picked(&self, vertices: &[u32]) -> Attribute {
        let of = |&v: &u32| &self.values[v as usize * self.width..][..self.width];
        Attribute {
            name: self.name.clone(),
            width: self.width,
            values: vertices.iter().flat_map(of).copied().collect(),
        }
    }
}

/// Why a mesh cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// A triangle names a vertex that is not there.
    #[error("triangle {triangle} names vertex {vertex}, but there are {count} vertices; the file is damaged")]
    BadIndex {
        /// The triangle.
        triangle: usize,
        /// The index it holds.
        vertex: u32,
        /// Number of vertices.
        count: usize,
    },
    /// A position is infinite or not a number.
    #[error("vertex {vertex} has a position that is not a finite number; remove it and the triangles around it")]
    NotFinite {
        /// The vertex.
        vertex: u32,
    },
    /// Nothing is left.
    #[error("no triangle with three different vertices; a mesh with faces is needed")]
    Empty,
    /// The observer no longer wanted the result.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

impl TriMesh {
    /// A mesh without attributes.
    pub fn new(points: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> TriMesh {
        TriMesh { points, triangles, attributes: Vec::new() }
    }

    /// Vertex at the start of half-edge `h = 3 t + k`.
    pub fn origin(&self, h: u32) -> u32 {
        self.triangles[h as usize / 3][h as usize % 3]
    }

    /// Length of the edge of half-edge `h`.
    pub fn edge_length(&self, h: u32) -> f64 {
        let (t, k) = (h as usize / 3, h as usize % 3);
        let [from, to] = [k, (k + 1) % 3].map(|k| self.points[self.triangles[t][k] as usize]);
        from.distance(to)
    }

    /// Mean length of the edges, those of two triangles counted twice; 0 without triangles.
    pub fn mean_edge(&self) -> f64 {
        let around = |t: usize| {
            let [a, b, c] = self.corners(t);
            a.distance(b) + b.distance(c) + c.distance(a)
        };
        let count = self.triangles.len();
        (0..count).map(around).sum::<f64>() / (3 * count).max(1) as f64
    }

    /// Bounding box of all vertices.
    pub fn bounds(&self) -> Aabb {
        Aabb::of(&self.points)
    }

    /// The three corner positions of triangle `t`.
    #[inline]
    pub fn corners(&self, t: usize) -> [DVec3; 3] {
        self.triangles[t].map(|v| self.points[v as usize])
    }

    /// Twice the area vector of triangle `t`: its length is twice the area, its direction the normal.
    #[inline]
    pub fn area_vector(&self, t: usize) -> DVec3 {
        let [a, b, c] = self.corners(t);
        (b - a).cross(c - a)
    }

    /// Unit normal of triangle `t`; zero for a degenerate one.
    #[inline]
    pub fn normal(&self, t: usize) -> DVec3 {
        self.area_vector(t).normalize_or_zero()
    }

    /// Area of triangle `t`.
    #[inline]
    pub fn area(&self, t: usize) -> f64 {
        self.area_vector(t).length() / 2.0
    }

    /// Running sums of the areas, triangle by triangle: to pick triangles by their share of the whole.
    pub(crate) fn area_sums(&self) -> Vec<f64> {
        let mut total = 0.0;
        (0..self.triangles.len())
            .map(|t| {
                total += self.area(t);
                total
            })
            .collect()
    }

    /// Unit vertex normals, weighted by the area of the triangles around.
    pub fn vertex_normals(&self) -> Vec<DVec3> {
        let mut sum = vec![DVec3::ZERO; self.points.len()];
        for (t, triangle) in self.triangles.iter().enumerate() {
            let n = self.area_vector(t);
            for &v in triangle {
                sum[v as usize] += n;
            }
        }
        sum.into_iter().map(DVec3::normalize_or_zero).collect()
    }
}

impl FacePoint {
    /// Weights of the corners of another face that the place lies on.
    pub fn weights_on(&self, mesh: &TriMesh, face: u32) -> [f64; 3] {
        if self.face == face {
            return self.bary;
        }
        let (from, to) = (mesh.triangles[self.face as usize], mesh.triangles[face as usize]);
        to.map(|v| from.iter().position(|&w| w == v).map_or(0.0, |k| self.bary[k]))
    }

    /// World position.
    pub fn position(&self, mesh: &TriMesh) -> DVec3 {
        let [a, b, c] = mesh.corners(self.face as usize);
        a * self.bary[0] + b * self.bary[1] + c * self.bary[2]
    }
}

impl<'a> From<&'a TriMesh> for Triangles<'a> {
    fn from(mesh: &'a TriMesh) -> Triangles<'a> {
        Triangles { points: &mesh.points, triangles: &mesh.triangles }
    }
}
