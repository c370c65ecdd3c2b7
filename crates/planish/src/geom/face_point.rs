//! Places on triangles: a face and barycentric coordinates, the face points of [K98] §3.1.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A place on a mesh: a face and barycentric coordinates that are not negative and sum to one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FacePoint {
    /// Index of the triangle.
    pub face: u32,
    /// Weights of its three corners.
    pub bary: [f64; 3],
}

impl FacePoint {
    /// Corner `k` of `face`.
    pub fn corner(face: u32, k: usize) -> FacePoint {
        let mut bary = [0.0; 3];
        bary[k] = 1.0;
        FacePoint { face, bary }
    }
}
