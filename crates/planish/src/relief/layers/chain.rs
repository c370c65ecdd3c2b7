//! Chains of places, which strokes and tubes run along.

use super::ground::{Ground, Texel};
use crate::geom::Aabb;
use glam::DVec3;

/// True if a patch comes as near as `reach` to the box of some points.
pub(super) fn comes_near(ground: &Ground, patch: usize, points: &[DVec3], reach: f64) -> bool {
    let (patch, path) = (&ground.boxes[patch], Aabb::of(points));
    (patch.min - path.max).max(path.min - patch.max).max(DVec3::ZERO).length() <= reach
}

/// Distance of a node to a chain of places with their normals; infinite where it looks away, as the other side of a thin wall does.
pub(super) fn distance_along(path: &[(DVec3, DVec3)], (at, frame): &Texel) -> f64 {
    let (distance, normal) = nearest(path, *at);
    if frame.normal.dot(normal) <= 0.0 { f64::INFINITY } else { distance }
}

/// Distance to a chain of points, and its normal there.
fn nearest(path: &[(DVec3, DVec3)], at: DVec3) -> (f64, DVec3) {
    let mut best = (path[0].0.distance(at), path[0].1);
    for pair in path.windows(2) {
        let (a, along) = (pair[0].0, pair[1].0 - pair[0].0);
        let t = if along == DVec3::ZERO { 0.0 } else { ((at - a).dot(along) / along.length_squared()).clamp(0.0, 1.0) };
        let distance = (a + along * t).distance(at);
        if distance < best.0 {
            best = (distance, pair[0].1.lerp(pair[1].1, t));
        }
    }
    best
}
