//! Ground floor: boxes, trees and the one tolerance.

mod aabb;
mod bvh;
pub mod tolerance;

pub use aabb::Aabb;
pub use bvh::{Bvh, RayHit, SurfaceHit};
