//! Ground floor: boxes, trees, random numbers and the one tolerance.

mod aabb;
mod bvh;
mod kd_tree;
pub mod predicates;
pub mod random;
pub mod tolerance;

pub use aabb::Aabb;
pub(crate) use bvh::closest_in_triangle;
pub use bvh::{Bvh, RayHit, SurfaceHit};
pub use kd_tree::{KdTree, nearest_distances};
