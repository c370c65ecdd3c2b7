//! Closest point and ray queries on triangles.
//!
//! A tree of boxes with up to four children per node, split where the surface-area heuristic over bins is least
//! (Wald 2007, *On fast Construction of SAH-based Bounding Volume Hierarchies*); four children share a node as in
//! Dammertz, Hanika and Keller (2008, *Shallow Bounding Volume Hierarchies*), so that one operation on four lanes
//! looks at all of them. Rays use the watertight test of Woop, Benthin and Wald (2013, *Watertight Ray/Triangle
//! Intersection*): no ray slips through a shared edge or vertex.
//!
//! Boxes are `f32`, in units of half the diagonal around the middle of the mesh, and grown by more than the rounding
//! ([`PAD`]); they only rule out. What counts, the distance to a triangle, is `f64` in world units.

use super::{Aabb, FacePoint};
use crate::observe::{Cancelled, Observer, Silent};
use glam::{DVec3, Vec3A, Vec4};
use rayon::prelude::*;

/// The triangles a tree is built over; a mesh is one of the things that turn into it.
#[derive(Clone, Copy, Debug)]
pub struct Triangles<'a> {
    /// Positions of the vertices.
    pub points: &'a [DVec3],
    /// Vertices of each triangle.
    pub triangles: &'a [[u32; 3]],
}

impl Triangles<'_> {
    fn corners(&self, t: usize) -> [DVec3; 3] {
        self.triangles[t].map(|v| self.points[v as usize])
    }
}

/// A bounding volume hierarchy over the triangles of one mesh, with its own copy of their corners.
pub struct Bvh {
    nodes: Vec<Node>,
    /// Corners in the order of the leaves.
    corners: Vec<[DVec3; 3]>,
    /// Triangle of each.
    faces: Vec<u32>,
    unit: Unit,
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

/// Children of a node.
const CHILDREN: usize = 4;

/// The boxes of up to four children, one per lane; lanes without a child hold an inverted box.
#[derive(Clone, Copy)]
struct Node {
    min: [Vec4; 3],
    max: [Vec4; 3],
    /// Inner child: its node. Leaf: first triangle.
    link: [u32; CHILDREN],
    /// Triangles of a leaf; 0 for an inner child.
    count: [u32; CHILDREN],
}

impl Node {
    const EMPTY: Node =
        Node { min: [Vec4::INFINITY; 3], max: [Vec4::NEG_INFINITY; 3], link: [0; CHILDREN], count: [0; CHILDREN] };

    fn low(&self, k: usize) -> DVec3 {
        DVec3::new(self.min[0][k] as f64, self.min[1][k] as f64, self.min[2][k] as f64)
    }

    fn high(&self, k: usize) -> DVec3 {
        DVec3::new(self.max[0][k] as f64, self.max[1][k] as f64, self.max[2][k] as f64)
    }
}

/// World units to the units of the boxes.
#[derive(Clone, Copy)]
struct Unit {
    center: DVec3,
    /// Boxes' units per world unit.
    scale: f64,
}

impl Unit {
    fn of(bounds: &Aabb) -> Unit {
        let half = bounds.diagonal() / 2.0;
        let scale = if half > 0.0 && (1.0 / half).is_finite() { 1.0 / half } else { 1.0 };
        Unit { center: bounds.center(), scale }
    }

    fn tree_from_world(&self, p: DVec3) -> DVec3 {
        (p - self.center) * self.scale
    }
}

/// A triangle while the tree is built: its box.
#[derive(Clone, Copy)]
struct Item {
    min: Vec3A,
    max: Vec3A,
    face: u32,
}

/// Boxes grow by this: coordinates are at most 1, their rounding is 2^-24 at most, and so is that of a query near
/// them.
const PAD: f32 = 4.0 / (1 << 24) as f32;
/// Bins per split: more do not make better trees.
const BINS: usize = 16;
/// Triangles in a leaf at most: a box is far cheaper to rule out than a triangle.
const TRIANGLES_PER_LEAF: usize = 2;
/// Below this many triangles a subtree is built by one thread.
const SERIAL_TRIANGLES: usize = 1 << 13;
/// From this depth on nodes are split in halves by count: 16 levels more at most, for 2^32 triangles.
const HALVE: usize = 24;
/// Places on the stack of a query: three brothers a level stay behind.
const STACK: usize = (HALVE + 17) * (CHILDREN - 1) + 1;

impl Bvh {
    /// Builds the tree.
    /// # Panics
    /// If there is no triangle.
    pub fn new<'a>(surface: impl Into<Triangles<'a>>) -> Bvh {
        match Bvh::watched(surface, &Silent) {
            Ok(tree) => tree,
            Err(Cancelled) => unreachable!("nobody cancels"),
        }
    }

    /// As [`Bvh::new`], where an observer may stop it.
    /// # Errors
    /// [`Cancelled`].
    /// # Panics
    /// If there is no triangle.
    pub fn watched<'a>(surface: impl Into<Triangles<'a>>, observer: &dyn Observer) -> Result<Bvh, Cancelled> {
        let mesh = surface.into();
        assert!(!mesh.triangles.is_empty(), "a mesh with triangles");
        let unit = Unit::of(&Aabb::of(mesh.triangles.iter().flatten().map(|&v| &mesh.points[v as usize])));
        let mut items: Vec<Item> = (0..mesh.triangles.len())
            .into_par_iter()
            .map(|t| {
                let [a, b, c] = mesh.corners(t).map(|p| unit.tree_from_world(p).as_vec3a());
                Item { min: a.min(b).min(c) - PAD, max: a.max(b).max(c) + PAD, face: t as u32 }
            })
            .collect();
        let nodes = build(&mut items, 0, 0, observer)?;
        let faces: Vec<u32> = items.par_iter().map(|i| i.face).collect();
        let corners = faces.par_iter().map(|&f| mesh.corners(f as usize)).collect();
        Ok(Bvh { nodes, corners, faces, unit })
    }

    /// The place of the surface closest to `point`.
    pub fn closest(&self, point: DVec3) -> SurfaceHit {
        let own = self.unit.tree_from_world(point);
        let (i, bary) = if own.abs().max_element() < NEAR_DIAGONALS {
            let interval = Interval::of(own);
            self.nearest(point, |node| interval.squares(node).to_array().map(f64::from))
        } else {
            self.nearest(point, |node| {
                std::array::from_fn(|k| own.distance_squared(own.clamp(node.low(k), node.high(k))))
            })
        };
        let [a, b, c] = self.corners[i];
        let position = a * bary[0] + b * bary[1] + c * bary[2];
        let place = FacePoint { face: self.faces[i], bary };
        SurfaceHit { place, position, distance: point.distance(position) }
    }

    /// Place in the leaves and weights of the closest place; `squares` are lower bounds of the squared distances of
    /// a node's children in the units of the boxes.
    fn nearest(&self, point: DVec3, squares: impl Fn(&Node) -> [f64; CHILDREN]) -> (usize, [f64; 3]) {
        let mut best = f64::INFINITY;
        // The same in the units of the boxes, a little more than that; no child is infinitely far, but a lane without.
        let mut reach = f64::MAX;
        let mut found = (0, [1.0, 0.0, 0.0]);
        let mut stack = [(0u32, 0u32, 0f64); STACK];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let (link, count, away) = stack[top];
            if away > reach {
                continue;
            }
            if count > 0 {
                let first = link as usize;
                for (i, corners) in self.corners[first..first + count as usize].iter().enumerate() {
                    let (d, bary) = closest_in_triangle(corners, point);
                    if d < best {
                        best = d;
                        found = (first + i, bary);
                        reach = (best.sqrt() * self.unit.scale * (1.0 + 1e-6)).powi(2).min(f64::MAX);
                    }
                }
                continue;
            }
            let node = &self.nodes[link as usize];
            // The farthest first, so that the nearest lies on top.
            let base = top;
            for (k, away) in squares(node).into_iter().enumerate() {
                // Not so for a point that is no number.
                if away <= reach {
                    put(&mut stack, base, &mut top, (node.link[k], node.count[k], away));
                }
            }
        }
        found
    }

    /// The first triangle met from `origin` along the unit vector `direction` within `reach`.
    pub fn first_hit(&self, origin: DVec3, direction: DVec3, reach: f64) -> Option<RayHit> {
        let ray = Ray::new(origin, direction);
        let start = self.unit.tree_from_world(origin);
        let mut best = reach;
        let mut found = None;
        let mut stack = [(0u32, 0u32, 0.0); STACK];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let (link, count, near) = stack[top];
            if near > best * self.unit.scale * (1.0 + 1e-9) {
                continue;
            }
            if count > 0 {
                for i in link as usize..(link + count) as usize {
                    if let Some(t) = ray.meets(&self.corners[i])
                        && (t < best || (t == best && found.is_none()))
                    {
                        best = t;
                        found = Some(i);
                    }
                }
                continue;
            }
            let node = &self.nodes[link as usize];
            let base = top;
            for k in 0..CHILDREN {
                // A lane without a child: between its planes lies everything.
                if node.min[0][k] > node.max[0][k] {
                    continue;
                }
                let Some(near) = ray.enters(node, k, start) else { continue };
                put(&mut stack, base, &mut top, (node.link[k], node.count[k], near));
            }
        }
        found.map(|i| RayHit { face: self.faces[i], distance: best })
    }
}

/// Puts a child (link, count, distance) on a stack above its brothers from `base` on that are further away.
#[inline]
fn put(stack: &mut [(u32, u32, f64); STACK], base: usize, top: &mut usize, child: (u32, u32, f64)) {
    let mut at = *top;
    while at > base && stack[at - 1].2 < child.2 {
        stack[at] = stack[at - 1];
        at -= 1;
    }
    stack[at] = child;
    *top += 1;
}

/// Points within so many half diagonals are told apart by `f32`; from afar `f64` is needed to.
const NEAR_DIAGONALS: f64 = 8.0;

/// A query point in the units of the boxes, as the interval that surely holds it.
struct Interval {
    low: [Vec4; 3],
    high: [Vec4; 3],
}

impl Interval {
    fn of(p: DVec3) -> Interval {
        // Rounding is 2^-24 of a coordinate at most.
        let slack = p.abs().max_element() as f32 * PAD;
        let p = p.as_vec3().to_array();
        Interval { low: p.map(|x| Vec4::splat(x - slack)), high: p.map(|x| Vec4::splat(x + slack)) }
    }

    /// Squared distances from the four boxes, or a little less.
    fn squares(&self, node: &Node) -> Vec4 {
        let away = |k: usize| (node.min[k] - self.high[k]).max(self.low[k] - node.max[k]).max(Vec4::ZERO);
        let (x, y, z) = (away(0), away(1), away(2));
        (x * x + y * y + z * z) * (1.0 - 1e-6)
    }
}

/// The nodes of a subtree, the root first; `base` is the place of its first item among all.
fn build(items: &mut [Item], base: usize, depth: usize, observer: &dyn Observer) -> Result<Vec<Node>, Cancelled> {
    observer.check()?;
    if items.len() <= SERIAL_TRIANGLES {
        let mut nodes = Vec::with_capacity(items.len() / 2 + 1);
        grow(items, base, depth, &mut nodes);
        return Ok(nodes);
    }
    let (mut root, mut parts) = (Node::EMPTY, Vec::new());
    let mut rest = items;
    let mut first = base;
    for (k, size) in divide(rest, depth, &mut root, base).into_iter().enumerate() {
        let (part, others) = rest.split_at_mut(size);
        rest = others;
        if size > 0 && root.count[k] == 0 {
            parts.push((k, part, first));
        }
        first += size;
    }
    let subtree = |(k, part, first)| Ok((k, build(part, first, depth + 1, observer)?));
    let subtrees: Vec<(usize, Vec<Node>)> = parts.into_par_iter().map(subtree).collect::<Result<_, Cancelled>>()?;
    let mut nodes = Vec::with_capacity(1 + subtrees.iter().map(|s| s.1.len()).sum::<usize>());
    nodes.push(root);
    for (k, subtree) in subtrees {
        let at = nodes.len() as u32;
        nodes[0].link[k] = at;
        nodes.extend(subtree.into_iter().map(|mut node| {
            for k in (0..CHILDREN).filter(|&k| node.count[k] == 0) {
                node.link[k] += at;
            }
            node
        }));
    }
    Ok(nodes)
}

/// Appends a subtree to `nodes`, its root first.
fn grow(items: &mut [Item], base: usize, depth: usize, nodes: &mut Vec<Node>) {
    let at = nodes.len();
    let mut node = Node::EMPTY;
    let sizes = divide(items, depth, &mut node, base);
    nodes.push(node);
    let mut first = 0;
    for (k, size) in sizes.into_iter().enumerate() {
        if size > 0 && node.count[k] == 0 {
            nodes[at].link[k] = nodes.len() as u32;
            grow(&mut items[first..first + size], base + first, depth + 1, nodes);
        }
        first += size;
    }
}

/// Parts the items among the children of `node`, whose boxes and leaves it fills in; returns how many each has.
fn divide(items: &mut [Item], depth: usize, node: &mut Node, base: usize) -> [usize; CHILDREN] {
    let mut bounds = [(0, bounds_of(items)); CHILDREN];
    bounds[0].0 = items.len();
    let mut parts = 1;
    while parts < CHILDREN {
        // The child that rays and spheres meet most often; those that fit a leaf stay.
        let weight = |b: &(usize, (Vec3A, Vec3A))| if b.0 > TRIANGLES_PER_LEAF { half_area(b.1) } else { -1.0 };
        let pick = (0..parts).fold(0, |m, k| if weight(&bounds[k]) > weight(&bounds[m]) { k } else { m });
        if bounds[pick].0 <= TRIANGLES_PER_LEAF {
            break;
        }
        let first: usize = bounds[..pick].iter().map(|b| b.0).sum();
        let part = &mut items[first..first + bounds[pick].0];
        let middle = if depth < HALVE { split(part) } else { part.len() / 2 };
        let (left, right) = part.split_at(middle);
        let halves = [(left.len(), bounds_of(left)), (right.len(), bounds_of(right))];
        bounds.copy_within(pick + 1..parts, pick + 2);
        bounds[pick..pick + 2].copy_from_slice(&halves);
        parts += 1;
    }
    let mut sizes = [0; CHILDREN];
    let mut first = base;
    for (k, &(size, (min, max))) in bounds[..parts].iter().enumerate() {
        for axis in 0..3 {
            node.min[axis][k] = min[axis];
            node.max[axis][k] = max[axis];
        }
        if size <= TRIANGLES_PER_LEAF {
            node.link[k] = first as u32;
            node.count[k] = size as u32;
        }
        sizes[k] = size;
        first += size;
    }
    sizes
}

fn bounds_of(items: &[Item]) -> (Vec3A, Vec3A) {
    items.iter().fold((Vec3A::INFINITY, Vec3A::NEG_INFINITY), |b, i| (b.0.min(i.min), b.1.max(i.max)))
}

/// Half the surface of a box; 0 if it is empty.
fn half_area((min, max): (Vec3A, Vec3A)) -> f32 {
    let d = (max - min).max(Vec3A::ZERO);
    d.x * d.y + d.y * d.z + d.z * d.x
}

/// Parts the items where the surface-area heuristic is least; returns the size of the first part.
fn split(items: &mut [Item]) -> usize {
    let center = |i: &Item| i.min + i.max;
    let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    for i in items.iter() {
        low = low.min(center(i));
        high = high.max(center(i));
    }
    let extent = high - low;
    let axis = (0..3).fold(0, |m, k| if extent[k] > extent[m] { k } else { m });
    let bins = BINS.min(2 * items.len());
    let scale = bins as f32 / extent[axis];
    if !(extent[axis] > 0.0 && scale.is_finite()) {
        return items.len() / 2;
    }
    let bin = |i: &Item| (((center(i)[axis] - low[axis]) * scale) as usize).min(bins - 1);
    const NONE: ((Vec3A, Vec3A), usize) = ((Vec3A::INFINITY, Vec3A::NEG_INFINITY), 0);
    let mut filled = [NONE; BINS];
    for i in items.iter() {
        let b = &mut filled[bin(i)];
        *b = ((b.0.0.min(i.min), b.0.1.max(i.max)), b.1 + 1);
    }
    let add = |sum: &mut ((Vec3A, Vec3A), usize), b: &((Vec3A, Vec3A), usize)| {
        *sum = ((sum.0.0.min(b.0.0), sum.0.1.max(b.0.1)), sum.1 + b.1);
        half_area(sum.0) * sum.1 as f32
    };
    // Costs of the parts before and from each bin on.
    let (mut before, mut sum) = ([0.0; BINS], NONE);
    for k in 1..bins {
        before[k] = add(&mut sum, &filled[k - 1]);
    }
    let (mut cut, mut least, mut sum) = (bins / 2, f32::INFINITY, NONE);
    for k in (1..bins).rev() {
        let cost = before[k] + add(&mut sum, &filled[k]);
        if cost < least {
            (cut, least) = (k, cost);
        }
    }
    // In place from both ends: the order depends on that of the triangles alone.
    let (mut first, mut last) = (0, items.len());
    while first < last {
        if bin(&items[first]) < cut {
            first += 1;
        } else {
            last -= 1;
            items.swap(first, last);
        }
    }
    if first == 0 || first == items.len() { items.len() / 2 } else { first }
}

/// Squared distance to a triangle and the weights of its closest place, by the region of the point (Ericson,
/// *Real-Time Collision Detection*, 2005, §5.1.5). Triangles without area are taken as their edges.
pub(crate) fn closest_in_triangle(&[a, b, c]: &[DVec3; 3], p: DVec3) -> (f64, [f64; 3]) {
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

    /// Where the ray enters the box of a child, from its origin in the units of the boxes.
    fn enters(&self, node: &Node, k: usize, start: DVec3) -> Option<f64> {
        let (s, t) = ((node.low(k) - start) * self.inverse, (node.high(k) - start) * self.inverse);
        let near = s.min(t).max_element().max(0.0);
        // The far side grows by the rounding of the three operations (Ize 2013), so flat boxes are not missed.
        let far = s.max(t).min_element() * (1.0 + 4.0 * f64::EPSILON);
        (near <= far).then_some(near)
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
