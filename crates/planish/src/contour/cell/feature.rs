//! Feature test and feature vertex of one loop ([K01] §4.2 and §4.3).

use crate::linalg::eigen3;
use glam::{DMat3, DVec3};

/// What the normals of a loop tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// No feature.
    Smooth,
    /// A sharp edge.
    Edge,
    /// Three or more surfaces meet.
    Corner,
}

/// Normals closer than this (cosine) are one sample: how often a plane is hit must not weigh in the solution.
const SAME_NORMAL_COSINE: f64 = 0.9999;
/// Singular values below this fraction of the greatest do not count.
const SINGULAR_RATIO: f64 = 1e-3;

/// Classifies a loop by the opening angle of its normals ([K01] §4.2).
/// * `sharp` - cosine below which two normals make a feature (theta_sharp)
/// * `corner` - deviation from the plane of the most opposed two above which it is a corner (phi_corner)
pub fn classify(normals: &[DVec3], sharp: f64, corner: f64) -> Shape {
    let mut theta = sharp;
    let mut pair = None;
    for (i, a) in normals.iter().enumerate() {
        for b in &normals[..i] {
            let d = a.dot(*b);
            if d < theta {
                theta = d;
                pair = Some((*a, *b));
            }
        }
    }
    let Some((a, b)) = pair else { return Shape::Smooth };
    let across = a.cross(b).normalize_or_zero();
    // Opposite normals span no plane; whatever else there is lies across them.
    let phi = if across == DVec3::ZERO {
        normals.iter().map(|n| n.cross(a).length()).fold(0.0, f64::max)
    } else {
        normals.iter().map(|n| n.dot(across).abs()).fold(0.0, f64::max)
    };
    if phi > corner { Shape::Corner } else { Shape::Edge }
}

/// The feature vertex: the point with the least squared distances from the tangent planes, nearest to `near` where they
/// leave it free ([K01] §4.3, eq. 1). For an edge the smallest singular value counts as zero.
/// * `planes` - points and unit normals
pub fn solve(planes: &[(DVec3, DVec3)], near: DVec3, shape: Shape) -> DVec3 {
    // Planes that are hit more than once are averaged first.
    let mut groups: Vec<(DVec3, DVec3, f64)> = Vec::with_capacity(planes.len());
    for &(p, n) in planes {
        let d = n.dot(p - near);
        match groups.iter_mut().find(|g| g.1.dot(n) > SAME_NORMAL_COSINE) {
            Some(g) => {
                g.0.x += d;
                g.2 += 1.0;
            }
            None => groups.push((DVec3::new(d, 0.0, 0.0), n, 1.0)),
        }
    }
    if let Some(x) = in_closed_form(&groups) {
        return near + x;
    }
    let mut a = DMat3::ZERO;
    let mut b = DVec3::ZERO;
    for (sum, n, count) in &groups {
        a += DMat3::from_cols(*n * n.x, *n * n.y, *n * n.z);
        b += *n * (sum.x / count);
    }
    let (values, vectors) = eigen3(a);
    let rank = if shape == Shape::Edge { 2 } else { 3 };
    // Squares of the singular values.
    let limit = SINGULAR_RATIO * SINGULAR_RATIO * values[2];
    let mut x = DVec3::ZERO;
    for k in (3 - rank..3).rev() {
        if values[k] > limit {
            x += vectors[k] * (vectors[k].dot(b) / values[k]);
        }
    }
    near + x
}

/// The nearest point that two planes have in common, where they do not nearly coincide: what the singular values give.
fn in_closed_form(groups: &[(DVec3, DVec3, f64)]) -> Option<DVec3> {
    let [(d, m, k), (e, n, l)] = groups else { return None };
    let (d, e, c) = (d.x / k, e.x / l, m.dot(*n));
    // Squares of the singular values are 1 + c and 1 - c.
    let apart = 1.0 - c * c;
    (apart > SINGULAR_RATIO).then(|| (*m * (d - c * e) + *n * (e - c * d)) / apart)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_planes_meet_in_their_corner_and_two_in_the_point_of_their_line_nearest_to_the_start() {
        let corner = DVec3::new(0.3, -0.2, 0.9);
        let normals = [DVec3::new(1.0, 0.1, 0.0), DVec3::new(-0.2, 1.0, 0.3), DVec3::new(0.0, 0.4, 1.0)];
        let planes: Vec<_> =
            normals.iter().map(|n| (corner + n.any_orthogonal_vector() * 0.7, n.normalize())).collect();
        let found = solve(&planes, DVec3::ZERO, Shape::Corner);
        assert!(found.distance(corner) < 1e-12, "{found}");
        let along = normals[0].cross(normals[1]).normalize();
        let found = solve(&planes[..2], DVec3::ZERO, Shape::Edge);
        assert!(found.distance(corner - along * along.dot(corner)) < 1e-12, "{found}");
    }

    #[test]
    fn normals_within_25_degrees_are_smooth_two_planes_an_edge_and_three_a_corner() {
        let turned = |deg: f64| DVec3::new(deg.to_radians().sin(), 0.0, deg.to_radians().cos());
        assert_eq!(classify(&[turned(0.0), turned(12.0), turned(25.0)], 0.9, 0.7), Shape::Smooth);
        assert_eq!(classify(&[turned(0.0), turned(30.0), turned(30.0)], 0.9, 0.7), Shape::Edge);
        assert_eq!(classify(&[DVec3::X, DVec3::Y, DVec3::Z], 0.9, 0.7), Shape::Corner);
    }
}
