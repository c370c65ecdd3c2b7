//! The shape of a cell and what it costs.
//!
//! The energy of `docs/methods/layout.md`, with its formula there.

use crate::geom::polyline;
use glam::DVec3;
use std::f64::consts::FRAC_PI_2;

/// The direction of a curve at its end is taken at this part of its length: beyond the faces, before its bends.
const HEAD: f64 = 0.2;

/// A corner further off square than this makes a surface that is hard to fit, and costs steeply.
pub(super) const STEEP_DEG: f64 = 45.0;

/// Weight of the squared logarithms of a pair of opposite sides, against corners that are all 45 degrees off.
const TAPER_COST: f64 = 0.5;

/// Weight of the squared logarithm of the area over the product of the sides: a cell with a limb inside has too
/// much of it, a slanted or winding one too little.
const SPREAD_COST: f64 = 2.0;

/// Weight of the squared logarithm of a cell's area over the mean.
const SIZE_COST: f64 = 0.4;

/// A curve between two corners.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Trace {
    pub length: f64,
    /// The place a fifth of the way from the start, and from the end.
    pub heads: [DVec3; 2],
}

impl Trace {
    /// The trace of a polyline.
    pub fn of(points: &[DVec3]) -> Trace {
        let length = polyline::length(points.iter().copied());
        let at = |target: f64| polyline::at_length(points, target);
        Trace { length, heads: [at(HEAD * length), at((1.0 - HEAD) * length)] }
    }

    pub fn reversed(self) -> Trace {
        Trace { heads: [self.heads[1], self.heads[0]], ..self }
    }
}

/// A four-sided cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub corners: [DVec3; 4],
    /// From each corner to the next.
    pub sides: [Trace; 4],
    /// Normals of the surface within the cell at the corners.
    pub normals: [DVec3; 4],
    pub area: f64,
}

/// What an angle costs in place of a right one.
fn angle_cost(angle: f64) -> f64 {
    let off = (angle.to_degrees() - 90.0).abs();
    (off / 45.0).powi(2) + ((off - STEEP_DEG).max(0.0) / 15.0).powi(2)
}

/// What ground of some flatness ([`super::fitness`]) around a node costs: as much as corners that are off square by the angle that
/// its normals have, in the mean, to their mean.
pub(super) fn ground_cost(flatness: f64) -> f64 {
    angle_cost(FRAC_PI_2 - flatness.clamp(-1.0, 1.0).acos())
}

impl Shape {
    /// The angles at the corners, radians: less than 0 where sides are turned over.
    pub fn angles(&self) -> [f64; 4] {
        std::array::from_fn(|k| {
            let p = self.corners[k];
            let (a, b) = (self.sides[k].heads[0] - p, self.sides[(k + 3) % 4].heads[1] - p);
            let angle = self.normals[k].dot(a.cross(b)).atan2(a.dot(b));
            if angle < -0.5 { angle + std::f64::consts::TAU } else { angle }
        })
    }

    /// What the cell costs where patches have `mean_area`.
    pub fn cost(&self, mean_area: f64) -> f64 {
        let corners: f64 = self.angles().into_iter().map(|angle| angle_cost(angle) / 4.0).sum();
        let tiny = 1e-6 * mean_area.sqrt();
        let [a, b, c, d] = self.sides.map(|s| s.length.max(tiny));
        let (along, across) = ((a + c) / 2.0, (b + d) / 2.0);
        let taper = (a / c).ln().powi(2) + (b / d).ln().powi(2);
        let area = self.area.max(tiny * tiny);
        let size = area / mean_area;
        // By area where a cell is too large, or parting it would never pay.
        corners
            + (along / across).ln().powi(2)
            + TAPER_COST * taper
            + SPREAD_COST * (area / (along * across)).ln().powi(2)
            + SIZE_COST * size.max(1.0) * size.ln().powi(2)
    }
}

/// Badness of the flat quad with these corners; `normal` points out of the surface.
pub(super) fn flat_cost(corners: [DVec3; 4], normal: DVec3) -> f64 {
    let mut sum = 0.0;
    for k in 0..4 {
        let (a, b) = (corners[(k + 1) % 4] - corners[k], corners[(k + 3) % 4] - corners[k]);
        let mut angle = normal.dot(a.cross(b)).atan2(a.dot(b));
        if angle < -0.5 {
            angle += std::f64::consts::TAU;
        }
        sum += angle_cost(angle);
    }
    let side = |k: usize| corners[k].distance(corners[(k + 1) % 4]);
    let aspect = ((side(0) + side(2)) / (side(1) + side(3)).max(f64::MIN_POSITIVE)).max(f64::MIN_POSITIVE).ln();
    sum / 4.0 + aspect * aspect
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The flat quad between four corners, of which it takes `part` of the area.
    fn quad(corners: [[f64; 2]; 4], part: f64) -> Shape {
        let corners = corners.map(|[x, y]| DVec3::new(x, y, 0.0));
        let area = (corners[2] - corners[0]).cross(corners[3] - corners[1]).length() / 2.0;
        let sides = [0, 1, 2, 3].map(|k| Trace::of(&[corners[k], corners[(k + 1) % 4]]));
        Shape { corners, sides, normals: [DVec3::Z; 4], area: part * area }
    }

    #[test]
    fn a_square_costs_nothing_and_each_fault_more_than_0_1() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        assert!(quad(square, 1.0).cost(1.0).abs() < 1e-9);
        for (fault, shape, mean) in [
            ("long", quad([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]], 1.0), 2.0),
            ("slanted", quad([[0.0, 0.0], [1.0, 0.0], [1.6, 0.8], [0.6, 0.8]], 1.0), 0.8),
            ("with a limb inside", quad(square, 3.0), 3.0),
            ("large", quad(square, 1.0), 0.4),
            ("tapered", quad([[0.0, 0.0], [1.0, 0.0], [0.7, 1.0], [0.3, 1.0]], 1.0), 0.7),
        ] {
            assert!(shape.cost(mean) > 0.1, "{fault}: {}", shape.cost(mean));
        }
        let flat = quad([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0]], 1.0);
        assert!(flat.cost(1.0) > 3.0, "{}", flat.cost(1.0));
    }

    #[test]
    fn ground_costs_what_corners_do_that_are_as_far_off_square_as_its_normals_are_off_their_mean() {
        for off_deg in [0.0_f64, 20.0, 45.0, 60.0] {
            assert!((ground_cost(off_deg.to_radians().cos()) - angle_cost((90.0 + off_deg).to_radians())).abs() < 1e-9);
        }
        assert!((ground_cost(0.5_f64.sqrt()) - 1.0).abs() < 1e-9);
    }
}
