//! Exact answers about points, segments and triangles: signs of determinants that rounding cannot turn.
//!
//! The signs come from adaptive-precision arithmetic (Shewchuk 1997, *Adaptive Precision Floating-Point Arithmetic
//! and Fast Robust Geometric Predicates*). Whether two triangles meet is decided from such signs alone (after
//! Guigue and Devillers 2003, *Fast and Robust Triangle-Triangle Overlap Test*), so the answer is exact for the
//! coordinates as they are.

use glam::{DVec2, DVec3};
use robust::{Coord, Coord3D};

/// Positive where `c` lies to the left of the line from `a` to `b`, negative to its right, zero on it. Only the sign
/// is exact.
pub fn orient2d(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let at = |p: DVec2| Coord { x: p.x, y: p.y };
    robust::orient2d(at(a), at(b), at(c))
}

/// Positive where `d` lies on the side of the plane of `a`, `b`, `c` to which their normal points (counter-clockwise
/// seen from there), negative on the other, zero in the plane. Only the sign is exact.
pub fn orient3d(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let at = |p: DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    -robust::orient3d(at(a), at(b), at(c), at(d))
}

/// True if two triangles meet in more than what they share by name.
///
/// Corners are told apart by their names, not by their positions: without a common name any touching counts, with one
/// common name any common point beside that corner, with two any common point beside that edge. Two triangles of the
/// same three names always meet.
pub fn triangles_meet(p: [DVec3; 3], p_names: [u32; 3], q: [DVec3; 3], q_names: [u32; 3]) -> bool {
    let shared = Shared::new(p_names, q_names);
    let Shared { of_p, of_q, .. } = shared;
    if shared.count < 3 && (is_clearly_apart(p, q, of_p, of_q) || is_clearly_apart(q, p, of_q, of_p)) {
        return false;
    }
    meets_exactly(p, q, &shared.pairs[..shared.count])
}

/// [`triangles_meet`] by exact signs alone.
/// * `shared` - corners of the first with those of the second that have their names
fn meets_exactly(p: [DVec3; 3], q: [DVec3; 3], shared: &[(usize, usize)]) -> bool {
    match shared.len() {
        0 => apart_in_names(p, q),
        1 => {
            let (i, j) = shared[0];
            let (a, b) = (p[(i + 1) % 3], p[(i + 2) % 3]);
            let (c, d) = (q[(j + 1) % 3], q[(j + 2) % 3]);
            // All but the common corner strictly on one side of the other's plane: they meet there alone.
            if one_side(a, b, q) || one_side(c, d, p) {
                return false;
            }
            segment_meets(a, b, q) || segment_meets(c, d, p) || same_ray(p[i], [a, b], [c, d])
        }
        2 => {
            let (i, j) = (3 - shared[0].0 - shared[1].0, 3 - shared[0].1 - shared[1].1);
            let (a, b) = (p[shared[0].0], p[shared[1].0]);
            orient3d(a, b, p[i], q[j]) == 0.0 && same_side(a, b, p[i], q[j])
        }
        _ => true,
    }
}

/// Rounding of a triple product of differences, relative to the product of their greatest components: seven roundings
/// of six products, with room to spare.
const TRIPLE: f64 = 64.0 * f64::EPSILON;
/// What may be lost where products fall below all numbers.
const TINY: f64 = 1e-280;

/// Normal of a plane with the size of its rounding: that of a sum of products of differences from a point of the plane.
#[derive(Clone, Copy, Debug)]
struct Plane {
    normal: DVec3,
    size: f64,
}

impl Plane {
    fn new(a: DVec3, b: DVec3) -> Plane {
        Plane { normal: a.cross(b), size: TRIPLE * a.abs().max_element() * b.abs().max_element() }
    }

    /// The side on which `d` lies, if it is certain, else 0.
    fn side(&self, d: DVec3) -> i32 {
        let (s, bound) = (self.normal.dot(d), self.size * d.abs().max_element() + TINY);
        (s > bound) as i32 - (s < -bound) as i32
    }
}

/// A triangle with its plane and those through its edges along its normal. Most other triangles are told apart from it
/// by one of them, without exact arithmetic.
#[derive(Clone, Copy, Debug)]
pub struct Walled {
    p: [DVec3; 3],
    names: [u32; 3],
    own: Plane,
    /// Through the edge from corner k to the next; `None` if it is not certain that the third corner lies inside.
    walls: [Option<Plane>; 3],
}

impl Walled {
    /// The triangle with corners `p` of these names.
    pub fn new(p: [DVec3; 3], names: [u32; 3]) -> Walled {
        let own = Plane::new(p[1] - p[0], p[2] - p[0]);
        let walls = [0, 1, 2].map(|k| {
            let wall = Plane::new(p[(k + 1) % 3] - p[k], own.normal);
            (wall.side(p[(k + 2) % 3] - p[k]) == -1).then_some(wall)
        });
        Walled { p, names, own, walls }
    }

    /// [`triangles_meet`] of this one and another.
    pub fn meets(&self, q: [DVec3; 3], q_names: [u32; 3]) -> bool {
        let shared = Shared::new(self.names, q_names);
        if shared.count < 3 && (self.parts(q, &shared) || is_clearly_apart(q, self.p, shared.of_q, shared.of_p)) {
            return false;
        }
        meets_exactly(self.p, q, &shared.pairs[..shared.count])
    }

    /// [`is_clearly_apart`].
    fn parts(&self, q: [DVec3; 3], shared: &Shared) -> bool {
        let own = |k: &usize| shared.of_q >> k & 1 == 0;
        let sides: i32 = (0..3).filter(own).map(|k| self.own.side(q[k] - self.p[0])).sum();
        let on_edge = |k: usize| shared.of_p >> ((k + 2) % 3) & 1 == 0;
        sides.unsigned_abs() as usize == 3 - shared.count
            || (0..3).any(|k| match &self.walls[k] {
                Some(wall) => on_edge(k) && (0..3).filter(own).all(|j| wall.side(q[j] - self.p[k]) == 1),
                None => false,
            })
    }
}

/// What two triangles have in common.
struct Shared {
    /// Corners of the first with those of the second that have their names.
    pairs: [(usize, usize); 3],
    count: usize,
    /// Bits of the corners of each.
    of_p: u32,
    of_q: u32,
}

impl Shared {
    fn new(p: [u32; 3], q: [u32; 3]) -> Shared {
        let mut shared = Shared { pairs: [(0, 0); 3], count: 0, of_p: 0, of_q: 0 };
        for (i, a) in p.iter().enumerate() {
            if let Some(j) = q.iter().position(|b| a == b) {
                shared.pairs[shared.count] = (i, j);
                shared.count += 1;
                shared.of_p |= 1 << i;
                shared.of_q |= 1 << j;
            }
        }
        shared
    }
}

/// True if a plane certainly parts two triangles but for the corners that they share: the plane of `p`, or one through
/// an edge of `p` along its normal.
/// * `of_p`, `of_q` - bits of the corners that the other one has, too
fn is_clearly_apart(p: [DVec3; 3], q: [DVec3; 3], of_p: u32, of_q: u32) -> bool {
    let plane = Plane::new(p[1] - p[0], p[2] - p[0]);
    let own = |k: &usize| of_q >> k & 1 == 0;
    let (mut all, mut sides) = (0, 0);
    for k in (0..3).filter(own) {
        all += 1;
        sides += plane.side(q[k] - p[0]);
    }
    if i32::abs(sides) == all {
        return true;
    }
    (0..3).any(|k| {
        // What they share must lie on the edge.
        if of_p >> ((k + 2) % 3) & 1 != 0 {
            return false;
        }
        let wall = Plane::new(p[(k + 1) % 3] - p[k], plane.normal);
        wall.side(p[(k + 2) % 3] - p[k]) == -1 && (0..3).filter(own).all(|j| wall.side(q[j] - p[k]) == 1)
    })
}

/// True if `a` and `b` lie strictly on the same side of the plane of `t`.
fn one_side(a: DVec3, b: DVec3, t: [DVec3; 3]) -> bool {
    let (a, b) = (orient3d(t[0], t[1], t[2], a), orient3d(t[0], t[1], t[2], b));
    (a > 0.0 && b > 0.0) || (a < 0.0 && b < 0.0)
}

/// Two triangles that share the corner `v`: an edge of one may lie along an edge of the other.
fn same_ray(v: DVec3, ends: [DVec3; 2], others: [DVec3; 2]) -> bool {
    ends.iter().any(|&a| {
        others.iter().any(|&c| {
            let collinear = (0..3).all(|k| orient2d(drop_axis(v, k), drop_axis(a, k), drop_axis(c, k)) == 0.0);
            collinear && (a - v).dot(c - v) > 0.0
        })
    })
}

/// Coplanar `c` and `d` on the same side of the line through `a` and `b` (or one of them on it).
fn same_side(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> bool {
    // A projection in which the first triangle has area.
    for k in 0..3 {
        let [a, b, c, d] = [a, b, c, d].map(|x| drop_axis(x, k));
        let (s, t) = (orient2d(a, b, c), orient2d(a, b, d));
        if s != 0.0 {
            return t == 0.0 || (s > 0.0) == (t > 0.0);
        }
    }
    true
}

fn apart_in_names(p: [DVec3; 3], q: [DVec3; 3]) -> bool {
    let side_q = q.map(|x| orient3d(p[0], p[1], p[2], x));
    if side_q.iter().all(|&s| s > 0.0) || side_q.iter().all(|&s| s < 0.0) {
        return false;
    }
    let side_p = p.map(|x| orient3d(q[0], q[1], q[2], x));
    if side_p.iter().all(|&s| s > 0.0) || side_p.iter().all(|&s| s < 0.0) {
        return false;
    }
    (0..3).any(|k| segment_meets(p[k], p[(k + 1) % 3], q)) || (0..3).any(|k| segment_meets(q[k], q[(k + 1) % 3], p))
}

/// True if the closed segment from `a` to `b` has a point of the closed triangle `t`.
pub fn segment_meets(a: DVec3, b: DVec3, t: [DVec3; 3]) -> bool {
    let (sa, sb) = (orient3d(t[0], t[1], t[2], a), orient3d(t[0], t[1], t[2], b));
    if sa == 0.0 && sb == 0.0 {
        return coplanar_meets(a, b, t);
    }
    if (sa > 0.0 && sb > 0.0) || (sa < 0.0 && sb < 0.0) {
        return false;
    }
    // The line passes the triangle's edges on the same side of each.
    let around = [0, 1, 2].map(|k| orient3d(a, b, t[k], t[(k + 1) % 3]));
    around.iter().all(|&s| s >= 0.0) || around.iter().all(|&s| s <= 0.0)
}

/// [`segment_meets`] in the plane of the triangle.
fn coplanar_meets(a: DVec3, b: DVec3, t: [DVec3; 3]) -> bool {
    // A projection in which the triangle has area; a triangle without any is three segments.
    let flat = (0..3).find(|&k| orient2d(drop_axis(t[0], k), drop_axis(t[1], k), drop_axis(t[2], k)) != 0.0);
    let axes: Vec<usize> = flat.map_or_else(|| vec![0, 1, 2], |k| vec![k]);
    axes.iter().all(|&k| {
        let (a, b, t) = (drop_axis(a, k), drop_axis(b, k), t.map(|x| drop_axis(x, k)));
        let inside = |p: DVec2| {
            let s = [0, 1, 2].map(|k| orient2d(t[k], t[(k + 1) % 3], p));
            flat.is_some() && (s.iter().all(|&s| s >= 0.0) || s.iter().all(|&s| s <= 0.0))
        };
        inside(a) || inside(b) || (0..3).any(|k| segments_meet(a, b, t[k], t[(k + 1) % 3]))
    })
}

/// True if two closed segments of the plane have a point in common.
pub fn segments_meet(a: DVec2, b: DVec2, c: DVec2, d: DVec2) -> bool {
    let (sc, sd) = (orient2d(a, b, c), orient2d(a, b, d));
    let (sa, sb) = (orient2d(c, d, a), orient2d(c, d, b));
    let opposite = |x: f64, y: f64| (x > 0.0 && y < 0.0) || (x < 0.0 && y > 0.0);
    if opposite(sc, sd) && opposite(sa, sb) {
        return true;
    }
    let on = |p: DVec2, q: DVec2, x: DVec2| p.min(q).cmple(x).all() && x.cmple(p.max(q)).all();
    (sc == 0.0 && on(a, b, c)) || (sd == 0.0 && on(a, b, d)) || (sa == 0.0 && on(c, d, a)) || (sb == 0.0 && on(c, d, b))
}

/// `p` without coordinate `k`, the other two in cyclic order.
fn drop_axis(p: DVec3, k: usize) -> DVec2 {
    DVec2::new(p[(k + 1) % 3], p[(k + 2) % 3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;

    fn v(x: f64, y: f64, z: f64) -> DVec3 {
        DVec3::new(x, y, z)
    }

    const T: [DVec3; 3] = [DVec3::new(0.0, 0.0, 0.0), DVec3::new(1.0, 0.0, 0.0), DVec3::new(0.0, 1.0, 0.0)];

    #[test]
    fn orientation_is_positive_on_the_side_of_the_normal_and_exact_within_one_rounding() {
        assert!(orient3d(T[0], T[1], T[2], v(0.3, 0.3, f64::MIN_POSITIVE)) > 0.0);
        assert!(orient3d(T[0], T[1], T[2], v(0.3, 0.3, -f64::MIN_POSITIVE)) < 0.0);
        assert_eq!(orient3d(T[0], T[1], T[2], v(0.1, 0.7, 0.0)), 0.0);
    }

    #[test]
    fn triangles_without_common_corners_meet_when_they_cross_touch_or_overlap_in_their_plane() {
        let meets = |q: [DVec3; 3]| triangles_meet(T, [0, 1, 2], q, [3, 4, 5]);
        assert!(meets([v(0.2, 0.2, -1.0), v(0.2, 0.2, 1.0), v(2.0, 2.0, 0.5)]));
        assert!(meets([v(0.2, 0.2, 0.0), v(0.2, 0.2, 1.0), v(0.3, 0.2, 1.0)]));
        assert!(meets([v(0.1, 0.1, 0.0), v(0.2, 0.1, 0.0), v(0.1, 0.2, 0.0)]));
        assert!(!meets([v(0.2, 0.2, 1e-300), v(0.2, 0.2, 1.0), v(0.3, 0.2, 1.0)]));
        assert!(!meets([v(1.1, 0.1, 0.0), v(2.0, 0.1, 0.0), v(1.5, 0.5, 0.0)]));
        assert!(!meets([v(0.8, 0.8, -1.0), v(0.8, 0.8, 1.0), v(2.0, 2.0, 0.0)]));
    }

    #[test]
    fn neighbours_meet_only_beyond_what_they_share() {
        let one = |c: DVec3, d: DVec3| triangles_meet(T, [0, 1, 2], [T[0], c, d], [0, 4, 5]);
        assert!(!one(v(-1.0, 0.0, 0.0), v(0.0, -1.0, 0.5)));
        assert!(!one(v(0.2, 0.2, 1.0), v(0.3, 0.2, 1.0)));
        assert!(one(v(0.2, 0.2, -1.0), v(0.2, 0.3, 1.0)));
        assert!(one(v(0.4, 0.0, 0.0), v(0.4, 0.0, 1.0)), "along an edge");
        let two = |d: DVec3| triangles_meet(T, [0, 1, 2], [T[1], T[0], d], [1, 0, 5]);
        assert!(!two(v(0.0, 0.3, 1e-300)));
        assert!(!two(v(0.3, -1.0, 0.0)));
        assert!(two(v(0.3, 0.2, 0.0)), "folded over");
    }

    #[test]
    fn what_is_told_apart_by_rounded_numbers_is_apart_by_exact_signs_in_100_000_pairs_many_of_which_touch() {
        let (mut apart, mut meet) = (0, 0);
        for n in 0..200_000u64 {
            // Few places, so that many triangles touch, overlap, or lie in one plane; half of them shifted a little.
            let at = |k: u64| {
                let c = [0, 1, 2].map(|a| (random::unit(5, 24 * n + 3 * k + a) * 4.0).floor());
                DVec3::from(c) * 0.1 + if n % 2 == 0 { DVec3::ZERO } else { DVec3::new(1e-16, 3e-17, 2e-16) * k as f64 }
            };
            let (p, mut q) = ([0, 1, 2].map(at), [3, 4, 5].map(at));
            let count = (n / 2 % 3) as usize;
            let mut names = [3, 4, 5];
            let shared: Vec<(usize, usize)> = (0..count).map(|k| (k, (k + n as usize / 6) % 3)).collect();
            for &(i, j) in &shared {
                (q[j], names[j]) = (p[i], i as u32);
            }
            // What has no area may be taken to meet by its signs in three projections.
            if [p, q].iter().any(|t| (t[1] - t[0]).cross(t[2] - t[0]).length() < 1e-12) {
                continue;
            }
            let exact = meets_exactly(p, q, &shared);
            assert_eq!(triangles_meet(p, [0, 1, 2], q, names), exact, "{n}: {p:?} {q:?} {names:?}");
            assert_eq!(Walled::new(p, [0, 1, 2]).meets(q, names), exact, "{n}: {p:?} {q:?} {names:?}");
            (apart, meet) = (apart + !exact as u32, meet + exact as u32);
        }
        assert!(apart > 100_000 && meet > 30_000, "{apart} {meet}");
    }
}
