//! Closest point and ray queries on triangles.
//!
//! A binary tree of boxes, split where the surface-area heuristic over bins is least (Wald 2007, *On fast
//! Construction of SAH-based Bounding Volume Hierarchies*). Rays use the watertight test of Woop, Benthin and
//! Wald (2013, *Watertight Ray/Triangle Intersection*): no ray slips through a shared edge or vertex.

use crate::mesh::{FacePoint, TriMesh};
use glam::DVec3;

/// A bounding volume hierarchy over the triangles of one mesh, with its own copy of their corners.
pub struct Bvh {
    nodes: Vec<Node>,
    /// Corners in the order of the leaves.
    corners: Vec<[DVec3; 3]>,
    /// Triangle of each.
    faces: Vec<u32>,
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

#[derive(Clone, Copy)]
struct Node {
    min: DVec3,
    max: DVec3,
    /// Inner node: how many nodes on the right child is (the left one is the next node). Leaf: first triangle.
    link: u32,
    /// Triangles of a leaf; 0 for an inner node.
    count: u32,
}

/// A triangle while the tree is built.
#[derive(Clone, Copy)]
struct Item {
    min: DVec3,
    max: DVec3,
    face: u32,
}

/// Bins per split: more do not make better trees.
const BINS: usize = 16;
/// Triangles in a leaf at most.
const LEAF: usize = 4;
/// Below this many triangles a subtree is built by one thread.
const ALONE: usize = 1 << 13;
/// Depth of the stack of a query; splits are by at least one triangle, and the tree is forced to halve below.
const DEEPEST: usize = 96;
/// From this depth on nodes are split in halves by count, so that the depth stays below [`DEEPEST`].
const HALVE: usize = 56;

impl Bvh {
    /// Builds the tree.
    /// # Panics
    /// If the mesh has no triangle.
    pub fn new(mesh: &TriMesh) -> Bvh {
        assert!(!mesh.triangles.is_empty(), "a mesh with triangles");
        let mut items: Vec<Item> = (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                Item { min: a.min(b).min(c), max: a.max(b).max(c), face: t as u32 }
            })
            .collect();
        let nodes = build(&mut items, 0, 0);
        let faces: Vec<u32> = items.iter().map(|i| i.face).collect();
        let corners = faces.iter().map(|&f| mesh.corners(f as usize)).collect();
        Bvh { nodes, corners, faces }
    }

    /// The place of the surface closest to `point`.
    pub fn closest(&self, point: DVec3) -> SurfaceHit {
        let square = |n: &Node| point.distance_squared(point.clamp(n.min, n.max));
        let mut best = f64::INFINITY;
        let mut found = (0, [1.0, 0.0, 0.0]);
        let mut stack = [(0u32, 0.0); DEEPEST];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let (at, near) = stack[top];
            if near >= best {
                continue;
            }
            let mut at = at;
            loop {
                let node = &self.nodes[at as usize];
                if node.count > 0 {
                    for i in node.link as usize..(node.link + node.count) as usize {
                        let (d, bary) = closest_in_triangle(&self.corners[i], point);
                        if d < best {
                            best = d;
                            found = (i, bary);
                        }
                    }
                    break;
                }
                let (l, r) = (at + 1, at + node.link);
                let (dl, dr) = (square(&self.nodes[l as usize]), square(&self.nodes[r as usize]));
                let (near, far) = if dl <= dr { ((l, dl), (r, dr)) } else { ((r, dr), (l, dl)) };
                if far.1 < best {
                    stack[top] = far;
                    top += 1;
                }
                if near.1 >= best {
                    break;
                }
                at = near.0;
            }
        }
        let (i, bary) = found;
        let [a, b, c] = self.corners[i];
        let position = a * bary[0] + b * bary[1] + c * bary[2];
        let place = FacePoint { face: self.faces[i], bary };
        SurfaceHit { place, position, distance: point.distance(position) }
    }

    /// The first triangle met from `origin` along the unit vector `direction` within `reach`.
    pub fn first_hit(&self, origin: DVec3, direction: DVec3, reach: f64) -> Option<RayHit> {
        let ray = Ray::new(origin, direction);
        let mut best = reach;
        let mut found = None;
        let mut stack = [(0u32, 0.0); DEEPEST];
        let mut top = 0;
        if let Some(t) = ray.enters(&self.nodes[0], best) {
            stack[0] = (0, t);
            top = 1;
        }
        while top > 0 {
            top -= 1;
            let (mut at, near) = stack[top];
            if near > best {
                continue;
            }
            loop {
                let node = &self.nodes[at as usize];
                if node.count > 0 {
                    for i in node.link as usize..(node.link + node.count) as usize {
                        if let Some(t) = ray.meets(&self.corners[i])
                            && (t < best || (t == best && found.is_none()))
                        {
                            best = t;
                            found = Some(i);
                        }
                    }
                    break;
                }
                let (l, r) = (at + 1, at + node.link);
                let enters = |n: u32| ray.enters(&self.nodes[n as usize], best);
                match (enters(l), enters(r)) {
                    (Some(tl), Some(tr)) => {
                        let (near, far) = if tl <= tr { (l, (r, tr)) } else { (r, (l, tl)) };
                        stack[top] = far;
                        top += 1;
                        at = near;
                    }
                    (Some(_), None) => at = l,
                    (None, Some(_)) => at = r,
                    (None, None) => break,
                }
            }
        }
        found.map(|i| RayHit { face: self.faces[i], distance: best })
    }
}

/// The nodes of a subtree, links relative to their node; `base` is the place of its first item among all.
fn build(items: &mut [Item], base: usize, depth: usize) -> Vec<Node> {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for i in items.iter() {
        min = min.min(i.min);
        max = max.max(i.max);
    }
    if items.len() <= LEAF {
        return vec![Node { min, max, link: base as u32, count: items.len() as u32 }];
    }
    let middle = if depth < HALVE { split(items) } else { items.len() / 2 };
    let (left, right) = items.split_at_mut(middle);
    let (left, right) = if left.len() + right.len() > ALONE {
        rayon::join(|| build(left, base, depth + 1), || build(right, base + middle, depth + 1))
    } else {
        (build(left, base, depth + 1), build(right, base + middle, depth + 1))
    };
    let mut nodes = Vec::with_capacity(1 + left.len() + right.len());
    nodes.push(Node { min, max, link: 1 + left.len() as u32, count: 0 });
    nodes.extend(left);
    nodes.extend(right);
    nodes
}

/// Parts the items where the surface-area heuristic is least; returns the size of the first part.
fn split(items: &mut [Item]) -> usize {
    let center = |i: &Item| i.min + i.max;
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for i in items.iter() {
        low = low.min(center(i));
        high = high.max(center(i));
    }
    let extent = high - low;
    let axis = (0..3).fold(0, |m, k| if extent[k] > extent[m] { k } else { m });
    let scale = BINS as f64 / extent[axis];
    if !(extent[axis] > 0.0) || !scale.is_finite() {
        return items.len() / 2;
    }
    let bin = |i: &Item| (((center(i)[axis] - low[axis]) * scale) as usize).min(BINS - 1);
    let mut bins = [(DVec3::INFINITY, DVec3::NEG_INFINITY, 0usize); BINS];
    for i in items.iter() {
        let b = &mut bins[bin(i)];
        *b = (b.0.min(i.min), b.1.max(i.max), b.2 + 1);
    }
    let cost = |part: &[(DVec3, DVec3, usize)]| {
        let whole =
            part.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY, 0), |s, b| (s.0.min(b.0), s.1.max(b.1), s.2 + b.2));
        let d = (whole.1 - whole.0).max(DVec3::ZERO);
        (d.x * d.y + d.y * d.z + d.z * d.x) * whole.2 as f64
    };
    let cut = (1..BINS).min_by(|&a, &b| {
        let of = |k: usize| cost(&bins[..k]) + cost(&bins[k..]);
        of(a).total_cmp(&of(b))
    });
    let cut = cut.unwrap_or(BINS / 2);
    // A stable parting, so that the tree depends on the order of the triangles alone.
    let (first, second): (Vec<Item>, Vec<Item>) = items.iter().partition(|i| bin(i) < cut);
    let middle = first.len();
    if middle == 0 || second.is_empty() {
        return items.len() / 2;
    }
    items[..middle].copy_from_slice(&first);
    items[middle..].copy_from_slice(&second);
    middle
}

/// Squared distance to a triangle and the weights of its closest place, by the region of the point (Ericson,
/// *Real-Time Collision Detection*, 2005, §5.1.5). Triangles without area are taken as their edges.
fn closest_in_triangle(&[a, b, c]: &[DVec3; 3], p: DVec3) -> (f64, [f64; 3]) {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    let measured = |bary: [f64; 3]| {
        // Relative to a corner: nothing of the accuracy is lost far from the origin.
        ((ap - ab * bary[1] - ac * bary[2]).length_squared(), bary)
    };
    if d1 <= 0.0 && d2 <= 0.0 {
        return measured([1.0, 0.0, 0.0]);
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return measured([0.0, 1.0, 0.0]);
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return measured([0.0, 0.0, 1.0]);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 && d1 > d3 {
        let v = d1 / (d1 - d3);
        return measured([1.0 - v, v, 0.0]);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 && d2 > d6 {
        let w = d2 / (d2 - d6);
        return measured([1.0 - w, 0.0, w]);
    }
    let va = d3 * d6 - d5 * d4;
    let (e1, e2) = (d4 - d3, d5 - d6);
    if va <= 0.0 && e1 >= 0.0 && e2 >= 0.0 && e1 + e2 > 0.0 {
        let w = e1 / (e1 + e2);
        return measured([0.0, 1.0 - w, w]);
    }
    let sum = va + vb + vc;
    if va >= 0.0 && vb >= 0.0 && vc >= 0.0 && sum > 0.0 {
        let (v, w) = (vb / sum, vc / sum);
        return measured([(1.0 - v - w).max(0.0), v, w]);
    }
    // No plane: the best of the three edges.
    let along = |o: DVec3, e: DVec3| {
        let square = e.length_squared();
        if square > 0.0 { ((p - o).dot(e) / square).clamp(0.0, 1.0) } else { 0.0 }
    };
    let (r, s, t) = (along(a, ab), along(b, c - b), along(c, a - c));
    let edges = [[1.0 - r, r, 0.0], [0.0, 1.0 - s, s], [t, 0.0, 1.0 - t]].map(measured);
    edges.into_iter().fold(edges[0], |m, e| if e.0 < m.0 { e } else { m })
}

/// A ray made ready for boxes and triangles.
struct Ray {
    origin: DVec3,
    inverse: DVec3,
    /// Axes, the last one along the greatest component of the direction, and the shear that makes it a unit axis.
    axes: [usize; 3],
    shear: DVec3,
}

impl Ray {
    fn new(origin: DVec3, direction: DVec3) -> Ray {
        let size = direction.abs();
        let z = (0..3).fold(0, |m, k| if size[k] > size[m] { k } else { m });
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if direction[z] < 0.0 {
            std::mem::swap(&mut x, &mut y);
        }
        let shear = DVec3::new(direction[x], direction[y], 1.0) / direction[z];
        // Zero becomes the least number whose inverse times zero is zero still.
        let away = |d: f64| if d.abs() < 1e-300 { 1e300 } else { 1.0 / d };
        let inverse = DVec3::new(away(direction.x), away(direction.y), away(direction.z));
        Ray { origin, inverse, axes: [x, y, z], shear }
    }

    /// Where the ray enters a box, if it does before `reach`.
    fn enters(&self, node: &Node, reach: f64) -> Option<f64> {
        let (s, t) = ((node.min - self.origin) * self.inverse, (node.max - self.origin) * self.inverse);
        let near = s.min(t).max_element().max(0.0);
        // The far side grows by the rounding of the three operations (Ize 2013), so flat boxes are not missed.
        let far = s.max(t).min_element() * (1.0 + 4.0 * f64::EPSILON);
        (near <= far && near <= reach).then_some(near)
    }

    /// Distance at which the ray meets a triangle, from either side, edges and corners included.
    fn meets(&self, corners: &[DVec3; 3]) -> Option<f64> {
        let [x, y, z] = self.axes;
        let [a, b, c] = corners.map(|p| {
            let p = p - self.origin;
            (p[x] - self.shear.x * p[z], p[y] - self.shear.y * p[z], p[z])
        });
        let u = c.0 * b.1 - c.1 * b.0;
        let v = a.0 * c.1 - a.1 * c.0;
        let w = b.0 * a.1 - b.1 * a.0;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let det = u + v + w;
        if det == 0.0 {
            return None;
        }
        let t = (u * a.2 + v * b.2 + w * c.2) * self.shear.z / det;
        (t >= 0.0).then_some(t)
    }
}
