//! Trees of solids whose joints may be rounded: fillets where two solids join, rounds where two share.
//!
//! Where the gradients of two distances are at right angles, the surface at which a ball of a radius touches both is
//! the zero of `r - |(r - a, r - b)|`: a fillet of exactly that radius, tangent to both. (Circular blend of Rockwood
//! and Owen, *Blending Surfaces in Solid Modeling*, 1987, for blending range and radius alike.)

use crate::field::{Field, Solid};
use crate::geom::Aabb;
use glam::DVec3;

/// A solid, or two forms put together.
pub(super) enum Form {
    /// A solid alone.
    Solid(Solid),
    /// Both together; the corner between them is filled by a fillet of this radius, 0 for a sharp edge.
    Union(Box<[Form; 2]>, f64),
    /// What both share; the edge between them is rounded by this radius, 0 for a sharp edge.
    Intersection(Box<[Form; 2]>, f64),
    /// The first without the second.
    Difference(Box<[Form; 2]>),
}

impl From<Solid> for Form {
    fn from(solid: Solid) -> Form {
        Form::Solid(solid)
    }
}

impl Form {
    /// Together with another, with a fillet of this radius between them.
    pub fn union(self, other: impl Into<Form>, fillet: f64) -> Form {
        Form::Union(Box::new([self, other.into()]), fillet)
    }

    /// What both share, the edge between them rounded by this radius.
    pub fn intersection(self, other: impl Into<Form>, round: f64) -> Form {
        Form::Intersection(Box::new([self, other.into()]), round)
    }

    /// Without another.
    pub fn difference(self, other: impl Into<Form>) -> Form {
        Form::Difference(Box::new([self, other.into()]))
    }

    /// Value and unit gradient at `p`.
    fn evaluate(&self, p: DVec3) -> (f64, DVec3) {
        match self {
            Form::Solid(solid) => solid.evaluate(p),
            Form::Union(parts, fillet) => joined(parts[0].evaluate(p), parts[1].evaluate(p), *fillet),
            Form::Intersection(parts, round) => {
                negative(joined(negative(parts[0].evaluate(p)), negative(parts[1].evaluate(p)), *round))
            }
            Form::Difference(parts) => negative(joined(negative(parts[0].evaluate(p)), parts[1].evaluate(p), 0.0)),
        }
    }
}

fn negative((d, g): (f64, DVec3)) -> (f64, DVec3) {
    (-d, -g)
}

/// The union of two values with their gradients; `radius` of the ball that rolls between them.
fn joined((a, m): (f64, DVec3), (b, n): (f64, DVec3), radius: f64) -> (f64, DVec3) {
    let (u, v) = (radius - a, radius - b);
    if u > 0.0 && v > 0.0 && radius > 0.0 {
        return (radius - u.hypot(v), (m * u + n * v).normalize_or_zero());
    }
    if a <= b { (a, m) } else { (b, n) }
}

/// A value changes by at most this times the way: that of a blend by more than 1 where gradients are not at right angles.
const STEEPEST: f64 = std::f64::consts::SQRT_2;

impl Field for Form {
    fn bounds(&self) -> Aabb {
        match self {
            Form::Solid(solid) => solid.bounding_box(),
            // A fillet lies in the corner between its solids, within the box around both.
            Form::Union(parts, _) => {
                let [a, b] = [parts[0].bounds(), parts[1].bounds()];
                Aabb { min: a.min.min(b.min), max: a.max.max(b.max) }
            }
            Form::Intersection(parts, _) => {
                let [a, b] = [parts[0].bounds(), parts[1].bounds()];
                Aabb { min: a.min.max(b.min), max: a.max.min(b.max) }
            }
            Form::Difference(parts) => parts[0].bounds(),
        }
    }

    fn value(&self, p: DVec3) -> f64 {
        self.evaluate(p).0
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        self.evaluate(p).1
    }

    fn crosses(&self, aabb: &Aabb) -> bool {
        self.value(aabb.center()).abs() <= STEEPEST * aabb.diagonal() / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn below(normal: DVec3) -> Form {
        Solid::Plane { normal, offset: 0.0 }.into()
    }

    #[test]
    fn a_fillet_of_radius_2_between_floor_and_wall_lies_2_from_its_axis_and_touches_both() {
        let form = below(DVec3::Z).union(below(DVec3::X), 2.0);
        for k in 0..=20 {
            let (sin, cos) = (std::f64::consts::FRAC_PI_2 * k as f64 / 20.0).sin_cos();
            let (d, g) = form.evaluate(DVec3::new(2.0 - 2.0 * cos, 5.0, 2.0 - 2.0 * sin));
            assert!(d.abs() < 1e-12 && g.distance(DVec3::new(cos, 0.0, sin)) < 1e-12, "{d} {g}");
        }
        assert_eq!(form.evaluate(DVec3::new(3.0, 0.0, 0.5)), (0.5, DVec3::Z));
    }

    #[test]
    fn a_round_of_radius_2_is_the_fillet_of_what_is_left() {
        let form = below(DVec3::Z).intersection(below(DVec3::X), 2.0);
        let slant = (DVec3::X + DVec3::Z).normalize();
        let (d, g) = form.evaluate(DVec3::new(-2.0, 1.0, -2.0) + 2.0 * slant);
        assert!(d.abs() < 1e-12 && g.distance(slant) < 1e-12);
        assert_eq!(below(DVec3::Z).intersection(below(DVec3::X), 0.0).value(DVec3::new(-1.0, 0.0, -3.0)), -1.0);
    }
}
