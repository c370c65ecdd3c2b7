//! The generalised winding number of any triangle soup, as a field.
//!
//! Jacobson, Kavan and Sorkine-Hornung 2013, *Robust Inside-Outside Segmentation using Generalized Winding Numbers*:
//! the sum of the solid angles of all triangles over 4 pi, one inside a closed surface and zero outside, and passing
//! one half in the middle of a gap. Far groups of triangles count as one dipole each (Barill et al. 2018, *Fast Winding
//! Numbers for Soups and Clouds*, first order); near ones are summed exactly (van Oosterom and Strackee 1983).

use super::Field;
use crate::geom::Aabb;
use crate::mesh::TriMesh;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// A tree over the triangles.
pub struct Winding {
    nodes: Vec<Node>,
    corners: Vec<[DVec3; 3]>,
    bounds: Aabb,
}

#[derive(Clone, Copy)]
struct Node {
    bounds: Aabb,
    /// Centre weighted by area, and the greatest distance of a corner from it.
    center: DVec3,
    radius: f64,
    /// Sum of the area vectors, and of the areas.
    vector: DVec3,
    area: f64,
    /// Triangles of the node.
    first: u32,
    count: u32,
    /// Second child; the first follows its parent. 0 for a leaf.
    second: u32,
}

/// A group counts as one dipole from this many radii on: the first order is then right to about 5e-4.
const FAR_RADII: f64 = 3.5;
/// Triangles in a leaf at most.
const TRIANGLES_PER_LEAF: usize = 8;
/// What the dipoles may be wrong together.
const SLACK: f64 = 0.02;
/// Step of the differences for the gradient, as a fraction of the diagonal.
const GRADIENT_STEP: f64 = 1e-5;

impl Winding {
    /// Builds the tree.
    pub fn new(mesh: &TriMesh) -> Winding {
        let mut corners: Vec<[DVec3; 3]> = (0..mesh.triangles.len()).map(|t| mesh.corners(t)).collect();
        let mut nodes = Vec::new();
        build(&mut corners, 0, &mut nodes);
        let bounds = nodes.first().map_or(Aabb::EMPTY, |n| n.bounds);
        Winding { nodes, corners, bounds }
    }

    /// The winding number at `p`.
    pub fn number(&self, p: DVec3) -> f64 {
        let mut sum = 0.0;
        let mut stack = [0u32; 64];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let at = stack[top] as usize;
            let node = &self.nodes[at];
            let away = node.center - p;
            let d2 = away.length_squared();
            if d2 > (FAR_RADII * node.radius).powi(2) {
                sum += node.vector.dot(away) / (d2 * d2.sqrt());
            } else if node.second == 0 {
                let (a, b) = (node.first as usize, (node.first + node.count) as usize);
                sum += self.corners[a..b].iter().map(|t| solid_angle(t, p)).sum::<f64>();
            } else {
                stack[top] = node.second;
                stack[top + 1] = at as u32 + 1;
                top += 2;
            }
        }
        sum / (4.0 * PI)
    }

    /// A bound of how much the winding number differs between the centre of a box and any point of it; infinite if
    /// triangles may reach into the box.
    fn variation(&self, aabb: &Aabb, enough: f64) -> f64 {
        let reach = aabb.diagonal() / 2.0;
        let mut sum = 0.0;
        let mut stack = [0u32; 64];
        let mut top = 1;
        while top > 0 && sum < enough {
            top -= 1;
            let at = stack[top] as usize;
            let node = &self.nodes[at];
            let gap = (node.bounds.min - aabb.max).max(aabb.min - node.bounds.max).max(DVec3::ZERO).length();
            // The gradient of a dipole is at most twice its moment over the cube of the distance.
            let bound = reach * 2.0 * node.area / (4.0 * PI * gap.powi(3));
            if gap > node.radius || (node.second == 0 && gap > 0.0) {
                sum += bound;
            } else if node.second == 0 {
                return f64::INFINITY;
            } else {
                stack[top] = node.second;
                stack[top + 1] = at as u32 + 1;
                top += 2;
            }
        }
        sum
    }
}

impl Field for Winding {
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn value(&self, p: DVec3) -> f64 {
        0.5 - self.number(p)
    }

    fn values(&self, points: &[DVec3], values: &mut [f64]) {
        values.par_iter_mut().zip(points).for_each(|(v, &p)| *v = self.value(p));
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        let e = GRADIENT_STEP * self.bounds.diagonal();
        let along = |d: DVec3| self.value(p + d * e) - self.value(p - d * e);
        DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)).normalize_or_zero()
    }

    fn crosses(&self, aabb: &Aabb) -> bool {
        let margin = (self.value(aabb.center())).abs() - SLACK;
        margin <= 0.0 || self.variation(aabb, margin) >= margin
    }
}

fn build(corners: &mut [[DVec3; 3]], first: usize, nodes: &mut Vec<Node>) {
    let at = nodes.len();
    let bounds = Aabb::of(corners.iter().flatten());
    let (mut vector, mut area, mut center) = (DVec3::ZERO, 0.0, DVec3::ZERO);
    for [a, b, c] in corners.iter() {
        let v = (b - a).cross(c - a) / 2.0;
        vector += v;
        area += v.length();
        center += (a + b + c) / 3.0 * v.length();
    }
    center = if area > 0.0 { center / area } else { bounds.center() };
    let radius = corners.iter().flatten().map(|p| p.distance(center)).fold(0.0, f64::max);
    let count = corners.len() as u32;
    nodes.push(Node { bounds, center, radius, vector, area, first: first as u32, count, second: 0 });
    if corners.len() <= TRIANGLES_PER_LEAF {
        return;
    }
    let size = bounds.size();
    let axis = (0..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
    let middle = corners.len() / 2;
    let key = |t: &[DVec3; 3]| t[0][axis] + t[1][axis] + t[2][axis];
    corners.select_nth_unstable_by(middle, |a, b| {
        let corner = |t: &[DVec3; 3]| t.map(|p| p.to_array());
        key(a).total_cmp(&key(b)).then_with(|| corner(a).partial_cmp(&corner(b)).unwrap_or(std::cmp::Ordering::Equal))
    });
    let (left, right) = corners.split_at_mut(middle);
    build(left, first, nodes);
    nodes[at].second = nodes.len() as u32;
    build(right, first + middle, nodes);
}

fn solid_angle([a, b, c]: &[DVec3; 3], p: DVec3) -> f64 {
    let (a, b, c) = (a - p, b - p, c - p);
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let det = a.dot(b.cross(c));
    let under = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * det.atan2(under)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::shapes;

    #[test]
    fn closed_sphere_has_winding_number_one_inside_and_zero_outside_within_1_percent() {
        let w = Winding::new(&shapes::sphere(1.0, 4));
        for p in [DVec3::ZERO, DVec3::new(0.5, 0.3, -0.7), DVec3::new(0.0, 0.99, 0.0)] {
            assert!((w.number(p) - 1.0).abs() < 0.01, "{}", w.number(p));
        }
        for p in [DVec3::splat(2.0), DVec3::new(0.0, 1.02, 0.0)] {
            assert!(w.number(p).abs() < 0.01, "{}", w.number(p));
        }
    }

    #[test]
    fn boxes_that_do_not_cross_hold_no_change_of_side_in_an_open_cube() {
        let mut cube = shapes::cuboid(DVec3::ONE, 8);
        cube.triangles.truncate(cube.triangles.len() * 5 / 6);
        let w = Winding::new(&cube);
        let mut skipped = 0;
        for n in 0..2000u64 {
            let r = |k: u64| crate::geom::random::unit(3, 4 * n + k);
            let c = (DVec3::new(r(0), r(1), r(2)) - 0.5) * 3.0;
            let aabb = Aabb { min: c - 0.2 * r(3), max: c + 0.2 * r(3) };
            if !w.crosses(&aabb) {
                skipped += 1;
                let side = w.side(aabb.center());
                for m in 0..20u64 {
                    let q = |k: u64| crate::geom::random::unit(n, 3 * m + k);
                    let p = aabb.min + (aabb.max - aabb.min) * DVec3::new(q(0), q(1), q(2));
                    assert_eq!(w.side(p), side, "{p}");
                }
            }
        }
        assert!(skipped > 500, "{skipped}");
    }
}
