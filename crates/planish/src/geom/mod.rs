//! Ground floor: boxes, trees, shortest paths, polylines, random numbers and the one tolerance.

mod aabb;
mod bvh;
pub mod cut;
mod face_point;
pub mod graph;
mod kd_tree;
pub mod polyline;
pub mod predicates;
pub mod random;
pub mod tolerance;

pub use aabb::Aabb;
pub(crate) use bvh::closest_in_triangle;
pub use bvh::{Bvh, RayHit, SurfaceHit, Triangles};
pub use face_point::FacePoint;
pub use kd_tree::{KdTree, nearest_distances};
pub use tolerance::is_positive;

/// "No such": an index where there is nothing.
pub const NONE: u32 = u32::MAX;
