//! Solids: shapes given by formulas, and what is made of them.
//!
//! [K01] §3: union is the least of two values, intersection the greatest, difference the greatest of one and the other
//! negated. Primitives are true distances, so gradients are unit vectors in closed form and a box of space is skipped
//! where the interval of values over it has one sign (a distance changes by no more than the way). A formula of the user's own
//! (`formula`) is no distance; its intervals come from the formula itself.

mod formula;

pub use formula::{Formula, FormulaError};

use super::Field;
use super::polygon::Polygon;
use crate::geom::Aabb;
use glam::{DQuat, DVec2, DVec3};

/// A solid. Lengths in world units; every primitive sits around the origin.
#[derive(Clone, Debug, PartialEq)]
pub enum Solid {
    /// A ball around the origin.
    Sphere {
        /// Its radius.
        radius: f64,
    },
    /// A box centred at the origin.
    Cuboid {
        /// Its edges.
        size: DVec3,
        /// Radius by which its edges and corners are rounded; 0 for sharp ones.
        round: f64,
    },
    /// A cylinder around the z axis, centred at the origin.
    Cylinder {
        /// Its radius.
        radius: f64,
        /// Its height.
        height: f64,
    },
    /// A cone, cut or not, around the z axis, centred at half its height.
    Cone {
        /// Radius at the bottom.
        bottom: f64,
        /// Radius at the top; 0 for a point.
        top: f64,
        /// Its height.
        height: f64,
    },
    /// A ring around the z axis.
    Torus {
        /// Radius of its middle line.
        major: f64,
        /// Radius of its tube.
        minor: f64,
    },
    /// Everything below a plane: against its normal.
    Plane {
        /// Unit normal, out of the body.
        normal: DVec3,
        /// Distance of the plane from the origin along the normal.
        offset: f64,
    },
    /// All points within a radius of a segment.
    Capsule {
        /// One end.
        from: DVec3,
        /// Other end.
        to: DVec3,
        /// The radius.
        radius: f64,
    },
    /// A polygon in the xy plane extended along z, from 0 to the height.
    Extrusion {
        /// The outline.
        polygon: Polygon,
        /// Height.
        height: f64,
    },
    /// Where a formula is negative. It has no end by itself, and where it has no value nothing is known.
    Formula(Formula),
    /// A solid scaled, then turned, then moved.
    Placed {
        /// The solid.
        solid: Box<Solid>,
        /// Scale.
        scale: f64,
        /// Rotation about the origin.
        turn: DQuat,
        /// Translation.
        shift: DVec3,
    },
    /// All points within a distance of a solid; a negative one takes away.
    Offset {
        /// The solid.
        solid: Box<Solid>,
        /// The distance.
        distance: f64,
    },
    /// All of them together.
    Union(Vec<Solid>),
    /// What they share.
    Intersection(Vec<Solid>),
    /// The first without the others.
    Difference(Vec<Solid>),
}

impl Solid {
    /// Where a formula is negative, within a box.
    pub fn of_formula(formula: Formula, bounds: &Aabb) -> Solid {
        let cut = Solid::Cuboid { size: bounds.size(), round: 0.0 }.moved(bounds.center());
        Solid::Formula(formula).intersection(cut)
    }

    /// True if its values are those of a formula, which is no distance.
    pub fn has_formula(&self) -> bool {
        match self {
            Solid::Formula(_) => true,
            Solid::Placed { solid, .. } | Solid::Offset { solid, .. } => solid.has_formula(),
            Solid::Union(parts) | Solid::Intersection(parts) | Solid::Difference(parts) => {
                parts.iter().any(Solid::has_formula)
            }
            _ => false,
        }
    }

    /// The solid moved.
    pub fn moved(self, shift: DVec3) -> Solid {
        Solid::Placed { solid: Box::new(self), scale: 1.0, turn: DQuat::IDENTITY, shift }
    }

    /// The solid turned about an axis through the origin.
    pub fn turned(self, axis: DVec3, angle_deg: f64) -> Solid {
        let turn = DQuat::from_axis_angle(axis.normalize(), angle_deg.to_radians());
        Solid::Placed { solid: Box::new(self), scale: 1.0, turn, shift: DVec3::ZERO }
    }

    /// The solid scaled about the origin.
    pub fn scaled(self, scale: f64) -> Solid {
        Solid::Placed { solid: Box::new(self), scale, turn: DQuat::IDENTITY, shift: DVec3::ZERO }
    }

    /// The solid with everything within `distance`.
    pub fn offset(self, distance: f64) -> Solid {
        Solid::Offset { solid: Box::new(self), distance }
    }

    /// Together with another.
    pub fn union(self, other: Solid) -> Solid {
        Solid::Union(vec![self, other])
    }

    /// What both share.
    pub fn intersection(self, other: Solid) -> Solid {
        Solid::Intersection(vec![self, other])
    }

    /// Without another.
    pub fn difference(self, other: Solid) -> Solid {
        Solid::Difference(vec![self, other])
    }

    /// Value and unit gradient at `p`.
    pub fn evaluate(&self, p: DVec3) -> (f64, DVec3) {
        match self {
            Solid::Sphere { radius } => around(p, DVec3::Z, *radius),
            Solid::Cuboid { size, round } => cuboid(p, *size / 2.0, *round),
            Solid::Cylinder { radius, height } => {
                let (rho, out) = radial(p);
                let (d, g) = rectangle(DVec2::new(rho, p.z.abs()), DVec2::new(*radius, height / 2.0));
                (d, out * g.x + DVec3::Z * g.y * side(p.z))
            }
            Solid::Cone { bottom, top, height } => {
                let (rho, out) = radial(p);
                let (d, g) = frustum(DVec2::new(rho, p.z), *bottom, *top, height / 2.0);
                (d, out * g.x + DVec3::Z * g.y)
            }
            Solid::Torus { major, minor } => {
                let (rho, out) = radial(p);
                let q = DVec2::new(rho - major, p.z);
                let l = q.length();
                let g = if l > 0.0 { q / l } else { DVec2::X };
                (l - minor, out * g.x + DVec3::Z * g.y)
            }
            Solid::Plane { normal, offset } => (normal.dot(p) - offset, *normal),
            Solid::Capsule { from, to, radius } => {
                let d = *to - *from;
                let s = if d == DVec3::ZERO { 0.0 } else { ((p - *from).dot(d) / d.length_squared()).clamp(0.0, 1.0) };
                around(p - *from - d * s, d.any_orthogonal_vector(), *radius)
            }
            Solid::Extrusion { polygon, height } => {
                let (flat, g) = polygon.distance(p.truncate());
                let half = height / 2.0;
                let (z, up) = ((p.z - half).abs() - half, side(p.z - half));
                let g = g.extend(0.0);
                if flat > 0.0 && z > 0.0 {
                    let l = flat.hypot(z);
                    (l, (g * flat + DVec3::Z * up * z) / l)
                } else if flat > z {
                    (flat, g)
                } else {
                    (z, DVec3::Z * up)
                }
            }
            Solid::Formula(formula) => formula.evaluate(p),
            Solid::Placed { solid, scale, turn, shift } => {
                let (d, g) = solid.evaluate(turn.inverse() * (p - *shift) / *scale);
                (d * scale, *turn * g)
            }
            Solid::Offset { solid, distance } => {
                let (d, g) = solid.evaluate(p);
                (d - distance, g)
            }
            Solid::Union(parts) => best(parts, p, |a, b| a < b, 1.0),
            Solid::Intersection(parts) => best(parts, p, |a, b| a > b, 1.0),
            Solid::Difference(parts) => {
                let Some((first, rest)) = parts.split_first() else { return NOWHERE };
                let (d, g) = first.evaluate(p);
                match rest.is_empty() {
                    true => (d, g),
                    false => {
                        let (e, f) = best(rest, p, |a, b| a > b, -1.0);
                        if e > d || e.is_nan() { (e, f) } else { (d, g) }
                    }
                }
            }
        }
    }

    /// Least and greatest value that the solid may have in a box.
    pub fn interval(&self, aabb: &Aabb) -> [f64; 2] {
        match self {
            Solid::Union(parts) => parts.iter().map(|s| s.interval(aabb)).fold([f64::INFINITY; 2], least),
            Solid::Intersection(parts) => parts.iter().map(|s| s.interval(aabb)).fold([f64::NEG_INFINITY; 2], greatest),
            Solid::Difference(parts) => {
                let Some((first, rest)) = parts.split_first() else { return [f64::INFINITY; 2] };
                rest.iter().fold(first.interval(aabb), |all, s| {
                    let [a, b] = s.interval(aabb);
                    greatest(all, [-b, -a])
                })
            }
            Solid::Offset { solid, distance } => solid.interval(aabb).map(|v| v - distance),
            Solid::Placed { solid, scale, turn, shift } if *turn == DQuat::IDENTITY => {
                let back = |p: DVec3| (p - *shift) / *scale;
                solid.interval(&Aabb { min: back(aabb.min), max: back(aabb.max) }).map(|v| v * scale)
            }
            Solid::Formula(formula) => formula.interval(aabb),
            // Turned, the box of a formula's variables is the one around the turned box.
            Solid::Placed { solid, scale, turn, shift } if solid.has_formula() => {
                let corners: [DVec3; 8] = std::array::from_fn(|c| {
                    let pick = |k: usize| if c >> k & 1 == 0 { aabb.min[k] } else { aabb.max[k] };
                    turn.inverse() * (DVec3::new(pick(0), pick(1), pick(2)) - *shift) / *scale
                });
                solid.interval(&Aabb::of(&corners)).map(|v| v * scale)
            }
            _ => {
                let d = self.evaluate(aabb.center()).0;
                let reach = aabb.diagonal() / 2.0;
                [d - reach, d + reach]
            }
        }
    }

    /// A box around the body; infinite along axes where the body has no end.
    pub fn bounding_box(&self) -> Aabb {
        let centred = |half: DVec3| Aabb { min: -half, max: half };
        match self {
            Solid::Sphere { radius } => centred(DVec3::splat(*radius)),
            Solid::Cuboid { size, .. } => centred(*size / 2.0),
            Solid::Cylinder { radius, height } => centred(DVec3::new(*radius, *radius, height / 2.0)),
            Solid::Cone { bottom, top, height } => {
                let r = bottom.max(*top);
                centred(DVec3::new(r, r, height / 2.0))
            }
            Solid::Torus { major, minor } => centred(DVec3::new(major + minor, major + minor, *minor)),
            Solid::Plane { normal, offset } => {
                let mut all = centred(DVec3::INFINITY);
                for axis in 0..3 {
                    if normal[axis] == 1.0 {
                        all.max[axis] = *offset;
                    } else if normal[axis] == -1.0 {
                        all.min[axis] = -offset;
                    }
                }
                all
            }
            Solid::Capsule { from, to, radius } => Aabb { min: from.min(*to) - *radius, max: from.max(*to) + *radius },
            Solid::Extrusion { polygon, height } => {
                let [low, high] = polygon.bounds();
                Aabb { min: low.extend(0.0), max: high.extend(*height) }
            }
            Solid::Formula(_) => centred(DVec3::INFINITY),
            Solid::Placed { solid, scale, turn, shift } => {
                let b = solid.bounding_box();
                if *turn != DQuat::IDENTITY && !(b.min.is_finite() && b.max.is_finite()) {
                    return centred(DVec3::INFINITY);
                }
                let corners = (0..8).map(|c| {
                    let pick = |k: usize| if c >> k & 1 == 0 { b.min[k] } else { b.max[k] };
                    let p = DVec3::new(pick(0), pick(1), pick(2)) * *scale;
                    if *turn == DQuat::IDENTITY { p + *shift } else { *turn * p + *shift }
                });
                Aabb::of(&corners.collect::<Vec<_>>())
            }
            Solid::Offset { solid, distance } => {
                let b = solid.bounding_box();
                Aabb { min: b.min - *distance, max: b.max + *distance }
            }
            Solid::Union(parts) => parts
                .iter()
                .map(Solid::bounding_box)
                .fold(Aabb::EMPTY, |a, b| Aabb { min: a.min.min(b.min), max: a.max.max(b.max) }),
            Solid::Intersection(parts) => parts
                .iter()
                .map(Solid::bounding_box)
                .fold(centred(DVec3::INFINITY), |a, b| Aabb { min: a.min.max(b.min), max: a.max.min(b.max) }),
            Solid::Difference(parts) => parts.first().map_or(Aabb::EMPTY, Solid::bounding_box),
        }
    }
}

/// What nothing evaluates to.
const NOWHERE: (f64, DVec3) = (f64::INFINITY, DVec3::ZERO);

/// Bounds of a value that may be missing.
const ANY: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

fn least(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    if a == ANY || b == ANY { ANY } else { [a[0].min(b[0]), a[1].min(b[1])] }
}

fn greatest(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    if a == ANY || b == ANY { ANY } else { [a[0].max(b[0]), a[1].max(b[1])] }
}

fn side(x: f64) -> f64 {
    if x < 0.0 { -1.0 } else { 1.0 }
}

/// The best of the parts, their values and gradients times `sign`; the first of equal ones.
fn best(parts: &[Solid], p: DVec3, better: impl Fn(f64, f64) -> bool, sign: f64) -> (f64, DVec3) {
    let mut found: Option<(f64, DVec3)> = None;
    for part in parts {
        let (d, g) = part.evaluate(p);
        // Where a formula has no value, what is made of it has none, either.
        if found.is_none_or(|f| better(d * sign, f.0) || d.is_nan()) {
            found = Some((d * sign, g * sign));
        }
    }
    found.unwrap_or(NOWHERE)
}

/// Distance from a ball around the origin; `any` is the gradient in its centre.
fn around(p: DVec3, any: DVec3, radius: f64) -> (f64, DVec3) {
    let l = p.length();
    (l - radius, if l > 0.0 { p / l } else { any.normalize_or(DVec3::Z) })
}

/// Distance from the z axis and the direction away from it.
fn radial(p: DVec3) -> (f64, DVec3) {
    let rho = p.truncate().length();
    (rho, if rho > 0.0 { DVec3::new(p.x / rho, p.y / rho, 0.0) } else { DVec3::X })
}

fn cuboid(p: DVec3, half: DVec3, round: f64) -> (f64, DVec3) {
    let sign = DVec3::new(side(p.x), side(p.y), side(p.z));
    let q = p.abs() - (half - round);
    let out = q.max(DVec3::ZERO);
    let l = out.length();
    if l > 0.0 {
        return (l - round, out / l * sign);
    }
    let k = if q.x >= q.y && q.x >= q.z {
        0
    } else if q.y >= q.z {
        1
    } else {
        2
    };
    let mut g = DVec3::ZERO;
    g[k] = sign[k];
    (q[k] - round, g)
}

/// Distance from a rectangle with corners at +-half, in its positive quadrant.
fn rectangle(p: DVec2, half: DVec2) -> (f64, DVec2) {
    let q = p - half;
    let out = q.max(DVec2::ZERO);
    let l = out.length();
    if l > 0.0 {
        (l, out / l)
    } else if q.x > q.y {
        (q.x, DVec2::X)
    } else {
        (q.y, DVec2::Y)
    }
}

/// Distance from the half section of a cut cone: `p.x` from the axis, `p.y` along it.
fn frustum(p: DVec2, bottom: f64, top: f64, half: f64) -> (f64, DVec2) {
    let corners = [DVec2::new(0.0, -half), DVec2::new(bottom, -half), DVec2::new(top, half), DVec2::new(0.0, half)];
    // The convex outline: planes inside, segments outside. The axis is no side of it.
    let mut inside = f64::NEG_INFINITY;
    let mut normal = DVec2::Y;
    let mut outside = f64::INFINITY;
    let mut nearest = DVec2::ZERO;
    for k in 0..3 {
        let (a, b) = (corners[k], corners[k + 1]);
        let d = b - a;
        if d == DVec2::ZERO {
            continue;
        }
        let n = DVec2::new(d.y, -d.x).normalize();
        let height = n.dot(p - a);
        if height > inside {
            (inside, normal) = (height, n);
        }
        let q = a + d * ((p - a).dot(d) / d.length_squared()).clamp(0.0, 1.0);
        let l = q.distance(p);
        if l < outside {
            (outside, nearest) = (l, q);
        }
    }
    if inside <= 0.0 {
        return (inside, normal);
    }
    (outside, if outside > 0.0 { (p - nearest) / outside } else { normal })
}

impl Field for Solid {
    fn bounds(&self) -> Aabb {
        self.bounding_box()
    }

    fn value(&self, p: DVec3) -> f64 {
        self.evaluate(p).0
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        self.evaluate(p).1
    }

    fn crosses(&self, aabb: &Aabb) -> bool {
        let [low, high] = self.interval(aabb);
        low < 0.0 && high >= 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;

    fn solids() -> Vec<(&'static str, Solid)> {
        let star = [(0.0, -1.0), (0.3, -0.3), (1.0, 0.0), (0.3, 0.3), (0.0, 1.0), (-0.4, 0.0)];
        let polygon = Polygon::new(star.map(|(x, y)| DVec2::new(x, y)).to_vec()).unwrap();
        vec![
            ("sphere", Solid::Sphere { radius: 0.8 }),
            ("box", Solid::Cuboid { size: DVec3::new(1.0, 1.4, 0.8), round: 0.0 }),
            ("rounded box", Solid::Cuboid { size: DVec3::new(1.0, 1.4, 0.8), round: 0.2 }),
            ("cylinder", Solid::Cylinder { radius: 0.5, height: 1.2 }),
            ("cone", Solid::Cone { bottom: 0.7, top: 0.0, height: 1.3 }),
            ("cut cone", Solid::Cone { bottom: 0.3, top: 0.6, height: 1.0 }),
            ("torus", Solid::Torus { major: 0.7, minor: 0.2 }),
            ("plane", Solid::Plane { normal: DVec3::new(0.6, 0.0, 0.8), offset: 0.2 }),
            (
                "capsule",
                Solid::Capsule { from: DVec3::new(-0.5, 0.0, 0.1), to: DVec3::new(0.4, 0.3, 0.0), radius: 0.3 },
            ),
            ("extrusion", Solid::Extrusion { polygon, height: 0.6 }),
            (
                "placed",
                Solid::Torus { major: 0.7, minor: 0.2 }
                    .scaled(0.7)
                    .turned(DVec3::new(1.0, 2.0, 3.0), 40.0)
                    .moved(DVec3::new(0.2, 0.0, -0.1)),
            ),
            (
                "tree",
                Solid::Cuboid { size: DVec3::splat(1.2), round: 0.0 }
                    .difference(Solid::Cylinder { radius: 0.3, height: 2.0 })
                    .union(Solid::Sphere { radius: 0.4 }.moved(DVec3::splat(0.6)))
                    .intersection(Solid::Sphere { radius: 1.0 }.offset(0.05)),
            ),
        ]
    }

    fn place(n: u64) -> DVec3 {
        (DVec3::new(random::unit(9, 3 * n), random::unit(9, 3 * n + 1), random::unit(9, 3 * n + 2)) - 0.5) * 2.6
    }

    #[test]
    fn gradients_are_unit_and_agree_with_differences_to_1e_5() {
        for (name, solid) in solids() {
            let mut off = 0;
            for n in 0..500 {
                let p = place(n);
                let g = solid.gradient(p);
                assert!((g.length() - 1.0).abs() < 1e-9, "{name} {p}");
                let e = 1e-6;
                let along = |d: DVec3| (solid.value(p + d * e) - solid.value(p - d * e)) / (2.0 * e);
                let difference = DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z));
                off += (difference.distance(g) > 1e-5) as usize;
            }
            // On the crease of a distance there is no gradient: next to none of the places lies there.
            assert!(off <= 1, "{name}: {off}");
        }
    }

    #[test]
    fn intervals_hold_all_values_and_boxes_hold_the_body() {
        for (name, solid) in solids() {
            let bounds = solid.bounding_box();
            for n in 0..300 {
                let c = place(n);
                let aabb = Aabb { min: c - 0.1, max: c + 0.15 };
                let [low, high] = solid.interval(&aabb);
                for m in 0..10u64 {
                    let r = |k: u64| random::unit(n, 3 * m + k);
                    let p = aabb.min + (aabb.max - aabb.min) * DVec3::new(r(0), r(1), r(2));
                    let d = solid.value(p);
                    assert!(low <= d && d <= high, "{name}");
                    if d < 0.0 {
                        assert!(p.cmpge(bounds.min).all() && p.cmple(bounds.max).all(), "{name} {p}");
                    }
                }
            }
        }
    }

    #[test]
    fn formulas_turned_and_combined_keep_their_intervals_and_lose_no_unknown_place() {
        let formula = |text: &str| Solid::Formula(Formula::parse(text).unwrap());
        let bounds = Aabb { min: DVec3::splat(-0.9), max: DVec3::new(0.7, 0.8, 0.9) };
        let wavy = Solid::of_formula(Formula::parse("sin(4*x) + y*z - 0.2").unwrap(), &bounds);
        let all = [
            wavy.clone().turned(DVec3::new(1.0, 2.0, 3.0), 40.0).scaled(0.8).moved(DVec3::splat(0.1)),
            Solid::Sphere { radius: 0.9 }.difference(wavy.clone()),
            Solid::Sphere { radius: 0.4 }.union(wavy.clone()).turned(DVec3::X, 20.0),
        ];
        for solid in all {
            for n in 0..200 {
                let c = place(n);
                let aabb = Aabb { min: c - 0.1, max: c + 0.15 };
                let [low, high] = solid.interval(&aabb);
                for m in 0..10u64 {
                    let r = |k: u64| random::unit(n, 3 * m + k);
                    let d = solid.value(aabb.min + (aabb.max - aabb.min) * DVec3::new(r(0), r(1), r(2)));
                    assert!(low <= d && d <= high);
                }
            }
        }
        assert_eq!(wavy.bounding_box().size(), bounds.size());
        let half = formula("sqrt(x)");
        let p = DVec3::new(-0.1, 0.0, 0.0);
        let ball = Solid::Sphere { radius: 1.0 };
        for solid in [ball.clone().union(half.clone()), half.clone().intersection(ball.clone()), ball.difference(half)]
        {
            assert!(solid.value(p).is_nan() && solid.crosses(&Aabb { min: p - 0.01, max: p + 0.01 }));
        }
    }

    #[test]
    fn a_without_a_is_empty_and_a_with_a_is_a() {
        for (_, a) in solids() {
            let none = a.clone().difference(a.clone());
            let both = a.clone().union(a.clone());
            for n in 0..200 {
                assert!(none.value(place(n)) >= 0.0);
                assert_eq!(both.evaluate(place(n)), a.evaluate(place(n)));
            }
        }
    }
}
