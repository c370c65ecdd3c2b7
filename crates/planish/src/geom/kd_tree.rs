//! Neighbours of points: a balanced k-d tree over its own copy of the points.
//!
//! [Bentley 1975] *Multidimensional binary search trees*; split at the median of the longest side of the box of
//! the points, so equal points and flat clouds keep the tree balanced.
//!
//! Departs from it: the points of a leaf lie side by side, and ties are broken by the coordinates. The order of the
//! tree therefore depends on the points alone and not on the order in which they came.

use crate::geom::Aabb;
use glam::DVec3;
use rayon::prelude::*;
use std::cmp::Ordering;

/// Points per leaf: a leaf is scanned in about the time of one step down the tree.
const POINTS_PER_LEAF: usize = 16;
/// Subtrees above this size are built by another thread.
const PARALLEL_POINTS: usize = 1 << 13;

/// A k-d tree.
#[derive(Clone, Debug, Default)]
pub struct KdTree {
    points: Vec<DVec3>,
    ids: Vec<u32>,
    nodes: Vec<Node>,
}

/// A node in preorder; the left child follows it.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// First point and number of points.
    start: u32,
    count: u32,
    /// Node of the right child; 0 for a leaf.
    right: u32,
}

impl KdTree {
    /// A tree over `points`; ids are their indices.
    pub fn new(points: &[DVec3]) -> KdTree {
        let mut items: Vec<(DVec3, u32)> = points.iter().enumerate().map(|(i, &p)| (p, i as u32)).collect();
        let blank = Node { low: DVec3::ZERO, high: DVec3::ZERO, start: 0, count: 0, right: 0 };
        let mut nodes = vec![blank; if items.is_empty() { 0 } else { node_count(items.len()) }];
        if !items.is_empty() {
            build(&mut items, &mut nodes, 0, 0);
        }
        KdTree { points: items.iter().map(|i| i.0).collect(), ids: items.iter().map(|i| i.1).collect(), nodes }
    }

    /// Ids in the order of the tree: near in the order is near in space.
    pub fn order(&self) -> &[u32] {
        &self.ids
    }

    /// Calls `visit(id, point, squared distance)` for every point within `radius` of `at`, in the order of the tree.
    pub fn within(&self, at: DVec3, radius: f64, mut visit: impl FnMut(u32, DVec3, f64)) {
        let limit = radius * radius;
        let mut stack = [0u32; 64];
        let mut top = usize::from(!self.nodes.is_empty());
        while top > 0 {
            top -= 1;
            let id = stack[top];
            let node = &self.nodes[id as usize];
            if box_distance2(node, at) > limit {
                continue;
            }
            if node.right == 0 {
                for slot in node.start as usize..(node.start + node.count) as usize {
                    let d2 = self.points[slot].distance_squared(at);
                    if d2 <= limit {
                        visit(self.ids[slot], self.points[slot], d2);
                    }
                }
            } else {
                stack[top] = node.right;
                stack[top + 1] = id + 1;
                top += 2;
            }
        }
    }

    /// The `k` nearest points as (squared distance, id), nearest first, ties by id.
    pub fn nearest(&self, at: DVec3, k: usize, found: &mut Vec<(f64, u32)>) {
        self.nearest_within(at, k, f64::INFINITY, found);
    }

    /// As [`KdTree::nearest`], of the points within `radius`.
    pub fn nearest_within(&self, at: DVec3, k: usize, radius: f64, found: &mut Vec<(f64, u32)>) {
        found.clear();
        if k == 0 || self.nodes.is_empty() {
            return;
        }
        // A binary heap with the worst on top.
        let mut stack = [(0u32, 0.0f64); 64];
        stack[0] = (0, box_distance2(&self.nodes[0], at));
        let mut top = 1;
        let worst = |found: &Vec<(f64, u32)>| if found.len() < k { radius * radius } else { found[0].0 };
        while top > 0 {
            top -= 1;
            let (id, near) = stack[top];
            if near > worst(found) {
                continue;
            }
            let node = &self.nodes[id as usize];
            if node.right == 0 {
                for slot in node.start as usize..(node.start + node.count) as usize {
                    let item = (self.points[slot].distance_squared(at), self.ids[slot]);
                    if item.0 > radius * radius {
                        continue;
                    }
                    if found.len() < k {
                        found.push(item);
                        sift_up(found);
                    } else if compare(&item, &found[0]) == Ordering::Less {
                        found[0] = item;
                        sift_down(found);
                    }
                }
            } else {
                let left = (id + 1, box_distance2(&self.nodes[id as usize + 1], at));
                let right = (node.right, box_distance2(&self.nodes[node.right as usize], at));
                let (near, far) = if left.1 <= right.1 { (left, right) } else { (right, left) };
                stack[top] = far;
                stack[top + 1] = near;
                top += 2;
            }
        }
        found.sort_unstable_by(compare);
    }

    /// As [`KdTree::nearest`], for places that come one after the other: those of the last one bound where the next ones are.
    /// * `last` - the last place and the distance of its farthest neighbour; takes those of this one
    pub fn nearest_after(&self, at: DVec3, k: usize, last: &mut Option<(DVec3, f64)>, found: &mut Vec<(f64, u32)>) {
        // With room for rounding.
        let radius = last.map_or(f64::INFINITY, |(p, far)| (p.distance(at) + far) * (1.0 + 1e-9));
        self.nearest_within(at, k, radius, found);
        *last = found.last().filter(|_| found.len() == k).map(|f| (at, f.0.sqrt()));
    }

    /// Id of the nearest point, ties by id; `None` for an empty tree.
    pub fn closest(&self, at: DVec3) -> Option<u32> {
        let mut found = Vec::with_capacity(1);
        self.nearest(at, 1, &mut found);
        found.first().map(|f| f.1)
    }
}

/// Number of nodes of a tree over `n > 0` points.
fn node_count(n: usize) -> usize {
    if n <= POINTS_PER_LEAF { 1 } else { 1 + node_count(n / 2) + node_count(n - n / 2) }
}

fn build(items: &mut [(DVec3, u32)], nodes: &mut [Node], start: u32, at: u32) {
    let bounds = Aabb::of(items.iter().map(|i| &i.0));
    nodes[0] = Node { low: bounds.min, high: bounds.max, start, count: items.len() as u32, right: 0 };
    if items.len() <= POINTS_PER_LEAF {
        items.sort_unstable_by(|a, b| by_axis(a, b, 0));
        return;
    }
    let size = bounds.size();
    let axis = (0..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
    let mid = items.len() / 2;
    items.select_nth_unstable_by(mid, |a, b| by_axis(a, b, axis));
    let left_nodes = node_count(mid);
    nodes[0].right = at + 1 + left_nodes as u32;
    let (a, b) = items.split_at_mut(mid);
    let (na, nb) = nodes[1..].split_at_mut(left_nodes);
    let mut left = || build(a, na, start, at + 1);
    let mut right = || build(b, nb, start + mid as u32, at + 1 + left_nodes as u32);
    if mid > PARALLEL_POINTS {
        rayon::join(left, right);
    } else {
        left();
        right();
    }
}

/// Along `axis` first, then along the others, then by id.
fn by_axis(a: &(DVec3, u32), b: &(DVec3, u32), axis: usize) -> Ordering {
    let [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
    a.0[axis]
        .total_cmp(&b.0[axis])
        .then_with(|| a.0[i].total_cmp(&b.0[i]))
        .then_with(|| a.0[j].total_cmp(&b.0[j]))
        .then(a.1.cmp(&b.1))
}

#[inline]
fn box_distance2(node: &Node, at: DVec3) -> f64 {
    (node.low - at).max(at - node.high).max(DVec3::ZERO).length_squared()
}

fn compare(a: &(f64, u32), b: &(f64, u32)) -> Ordering {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
}

fn sift_up(heap: &mut [(f64, u32)]) {
    let mut i = heap.len() - 1;
    while i > 0 {
        let parent = (i - 1) / 2;
        if compare(&heap[i], &heap[parent]) != Ordering::Greater {
            break;
        }
        heap.swap(i, parent);
        i = parent;
    }
}

fn sift_down(heap: &mut [(f64, u32)]) {
    let mut i = 0;
    loop {
        let mut child = 2 * i + 1;
        if child >= heap.len() {
            break;
        }
        if child + 1 < heap.len() && compare(&heap[child + 1], &heap[child]) == Ordering::Greater {
            child += 1;
        }
        if compare(&heap[child], &heap[i]) != Ordering::Greater {
            break;
        }
        heap.swap(i, child);
        i = child;
    }
}

/// Distance of every point of `at` to its nearest point of the tree.
pub fn nearest_distances(tree: &KdTree, at: &[DVec3]) -> Vec<f64> {
    at.par_iter()
        .map(|&p| {
            let mut found = Vec::with_capacity(1);
            tree.nearest(p, 1, &mut found);
            found.first().map_or(f64::INFINITY, |f| f.0.sqrt())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;

    fn points(n: u64) -> Vec<DVec3> {
        (0..n).map(|i| DVec3::from_array([0, 1, 2].map(|k| random::unit(3, 3 * i + k)))).collect()
    }

    #[test]
    fn neighbours_are_those_of_a_full_search_for_2000_points() {
        let mut cloud = points(2000);
        cloud.extend_from_within(..100); // repeated places
        let tree = KdTree::new(&cloud);
        let (mut found, mut last) = (Vec::new(), None);
        for &p in points(50).iter().chain(&cloud[..20]) {
            let mut all: Vec<(f64, u32)> =
                cloud.iter().enumerate().map(|(i, q)| (q.distance_squared(p), i as u32)).collect();
            all.sort_unstable_by(compare);
            tree.nearest(p, 17, &mut found);
            assert_eq!(found, all[..17]);
            tree.nearest_after(p, 17, &mut last, &mut found);
            assert_eq!(found, all[..17]);
            let mut inside = Vec::new();
            tree.within(p, 0.2, |i, _, d2| inside.push((d2, i)));
            inside.sort_unstable_by(compare);
            assert_eq!(inside, all.iter().take_while(|a| a.0 <= 0.04).copied().collect::<Vec<_>>());
        }
    }

    #[test]
    fn the_order_depends_on_the_points_and_not_on_how_they_come() {
        let cloud = points(5000);
        let turned: Vec<DVec3> = cloud.iter().rev().copied().collect();
        let (a, b) = (KdTree::new(&cloud), KdTree::new(&turned));
        assert!(a.order().iter().zip(b.order()).all(|(&i, &j)| cloud[i as usize] == turned[j as usize]));
    }

    #[test]
    fn equal_flat_and_missing_points_are_fine() {
        assert_eq!(KdTree::new(&[]).closest(DVec3::ZERO), None);
        let same = KdTree::new(&[DVec3::ONE; 1000]);
        let mut found = Vec::new();
        same.nearest(DVec3::ZERO, 3, &mut found);
        assert_eq!(found, [(3.0, 0), (3.0, 1), (3.0, 2)]);
        let mut count = 0;
        same.within(DVec3::ONE, 0.0, |_, _, _| count += 1);
        assert_eq!(count, 1000);
    }
}
