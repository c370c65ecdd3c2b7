//! Closest point and ray queries on triangles.

use crate::mesh::{FacePoint, TriMesh};
use glam::DVec3;
use parry3d_f64::math::Pose;
use parry3d_f64::query::{PointQueryWithLocation, Ray, RayCast};
use parry3d_f64::shape::{TriMesh as ParryMesh, TrianglePointLocation};

/// A bounding volume hierarchy over the triangles of one mesh.
pub struct Bvh {
    shape: ParryMesh,
}

/// The place of a surface closest to a point.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceHit {
    /// The place.
    pub place: FacePoint,
    /// Its position.
    pub position: DVec3,
    /// Distance to the query point.
    pub distance: f64,
}

/// The first triangle that a ray meets.
#[derive(Clone, Copy, Debug)]
pub struct RayHit {
    /// Index of the triangle.
    pub face: u32,
    /// Distance along the (unit) direction.
    pub distance: f64,
}

impl Bvh {
    /// Builds the tree.
    /// # Panics
    /// If the mesh has no triangle.
    pub fn new(mesh: &TriMesh) -> Bvh {
        Bvh { shape: ParryMesh::new(mesh.points.clone(), mesh.triangles.clone()).expect("a mesh with triangles") }
    }

    /// The place of the surface closest to `point`.
    pub fn closest(&self, point: DVec3) -> SurfaceHit {
        let (projection, (face, location)) = self.shape.project_local_point_and_get_location(point, true);
        let bary = match location {
            TrianglePointLocation::OnVertex(k) => FacePoint::corner(face, k as usize).bary,
            other => other.barycentric_coordinates().unwrap_or([1.0 / 3.0; 3]),
        };
        SurfaceHit {
            place: FacePoint { face, bary },
            position: projection.point,
            distance: point.distance(projection.point),
        }
    }

    /// The first triangle met from `origin` along the unit vector `direction` within `reach`.
    pub fn first_hit(&self, origin: DVec3, direction: DVec3, reach: f64) -> Option<RayHit> {
        let hit = self.shape.cast_ray_and_get_normal(&Pose::IDENTITY, &Ray::new(origin, direction), reach, true)?;
        let count = self.shape.num_triangles() as u32;
        let face = match hit.feature {
            parry3d_f64::shape::FeatureId::Face(f) => f % count,
            _ => return None,
        };
        Some(RayHit { face, distance: hit.time_of_impact })
    }
}
