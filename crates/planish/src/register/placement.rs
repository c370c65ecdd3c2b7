//! Affine moves of shapes, and the rigid one that brings points onto others.
//!
//! The rigid move is the least-squares one of Arun, Huang and Blostein (*Least-Squares Fitting of Two 3-D Point Sets*,
//! 1987): the turn comes from the singular vectors of the correlation of the centred pairs.
//!
//! Departs from it: the third pair of vectors is the cross product of the first two, so that points of a plane have their
//! turn as well and no mirror image is ever taken.

use crate::cloud::Cloud;
use crate::geom::tolerance;
use crate::linalg::eigen3;
use crate::mesh::{Attribute, TriMesh};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// A move: `p -> linear p + shift`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// Turn, scale, mirror.
    pub linear: DMat3,
    /// What is added, world units.
    pub shift: DVec3,
}

/// Why there is no move.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlacementError {
    /// Too few pairs.
    #[error("{found} pairs of points; at least 3 are needed")]
    TooFew {
        /// How many there are.
        found: usize,
    },
    /// The points do not say how to turn.
    #[error("the points lie on a line, which leaves the turn around it open; add a pair beside it")]
    OnALine,
}

/// Points whose second singular value is below this share of the first lie on a line: the turn around it would be made of
/// rounding, whose square root this is.
const ON_A_LINE: f64 = 1e-7;

impl Placement {
    /// The move that leaves all where it is.
    pub const IDENTITY: Placement = Placement { linear: DMat3::IDENTITY, shift: DVec3::ZERO };

    /// `linear` around a place that stays.
    pub fn about(linear: DMat3, place: DVec3) -> Placement {
        Placement { linear, shift: place - linear * place }
    }

    /// Where a point goes.
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.linear * p + self.shift
    }

    /// This move after `first`.
    pub fn after(&self, first: &Placement) -> Placement {
        Placement { linear: self.linear * first.linear, shift: self.point(first.shift) }
    }

    /// Angle of its turn, degrees; of a move without scale and mirror.
    pub fn turn_deg(&self) -> f64 {
        // From sine and cosine: the arc cosine of the trace alone loses half of the digits of small turns.
        let m = self.linear;
        let axis = DVec3::new(m.y_axis.z - m.z_axis.y, m.z_axis.x - m.x_axis.z, m.x_axis.y - m.y_axis.x).length() / 2.0;
        axis.atan2((m.x_axis.x + m.y_axis.y + m.z_axis.z - 1.0) / 2.0).to_degrees()
    }

    /// The rigid move that brings the first point of each pair nearest to the second, in the mean square.
    /// # Errors
    /// [`PlacementError`] for fewer than three pairs, or pairs on a line.
    pub fn of_pairs(pairs: &[[DVec3; 2]]) -> Result<Placement, PlacementError> {
        if pairs.len() < 3 {
            return Err(PlacementError::TooFew { found: pairs.len() });
        }
        let middle = |k: usize| pairs.iter().map(|pair| pair[k]).sum::<DVec3>() / pairs.len() as f64;
        let (from, to) = (middle(0), middle(1));
        // H maps directions of the first set to those of the second: its columns are sums of q p_x, q p_y, q p_z.
        let h = pairs.iter().fold(DMat3::ZERO, |h, [p, q]| {
            let (p, q) = (*p - from, *q - to);
            h + DMat3::from_cols(q * p.x, q * p.y, q * p.z)
        });
        let (values, v) = eigen3(h.transpose() * h);
        let (v1, v2) = (v[2], v[1]);
        let is_spread = values[1].max(0.0).sqrt() > ON_A_LINE * values[2].max(0.0).sqrt();
        if !is_spread {
            return Err(PlacementError::OnALine);
        }
        let u1 = (h * v1).normalize_or_zero();
        let u2 = h * v2;
        let u2 = (u2 - u1 * u1.dot(u2)).normalize_or_zero();
        let (u, v) = (DMat3::from_cols(u1, u2, u1.cross(u2)), DMat3::from_cols(v1, v2, v1.cross(v2)));
        let linear = u * v.transpose();
        Ok(Placement { linear, shift: to - linear * from })
    }

    /// Moves a mesh; a mirror image has its triangles turned, so that they are counter-clockwise seen from outside again.
    pub fn mesh(&self, mesh: &mut TriMesh) {
        mesh.points.iter_mut().for_each(|p| *p = self.point(*p));
        if self.linear.determinant() < 0.0 {
            mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        mesh.attributes.iter_mut().for_each(|a| self.normals(a));
    }

    /// Moves a scan with its scanners; `Cloud::shift` stays.
    pub fn cloud(&self, cloud: &mut Cloud) {
        cloud.points.iter_mut().chain(&mut cloud.scanners).for_each(|p| *p = self.point(*p));
        cloud.attributes.iter_mut().for_each(|a| self.normals(a));
    }

    /// Turns normals along: they go with the inverse transpose.
    fn normals(&self, attribute: &mut Attribute) {
        if attribute.name != "normal" || attribute.width != 3 {
            return;
        }
        // The inverse transpose but for a factor, which is the sign that matters: of a mirror image, outside stays outside.
        let [x, y, z] = [self.linear.x_axis, self.linear.y_axis, self.linear.z_axis];
        let side = self.linear.determinant().signum();
        let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * side;
        for value in attribute.values.chunks_exact_mut(3) {
            let n = cofactors * DVec3::new(value[0] as f64, value[1] as f64, value[2] as f64);
            // What is no direction stays none.
            let n = n / tolerance::divisor(n.length());
            value.copy_from_slice(&n.to_array().map(|x| x as f32));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::shapes;

    fn turned() -> Placement {
        let linear = DMat3::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 2.0);
        Placement { linear, shift: DVec3::new(3.0, -7.0, 11.0) }
    }

    #[test]
    fn a_move_is_found_again_from_three_pairs_in_a_plane_within_1e_12() {
        let points = [DVec3::new(1.0, 0.0, 5.0), DVec3::new(0.0, 4.0, 5.0), DVec3::new(-2.0, -1.0, 5.0)];
        let found = Placement::of_pairs(&points.map(|p| [p, turned().point(p)])).unwrap();
        assert!(found.linear.abs_diff_eq(turned().linear, 1e-12) && found.shift.abs_diff_eq(turned().shift, 1e-12));
        assert!((found.turn_deg() - 2.0f64.to_degrees()).abs() < 1e-10);
        assert_eq!(Placement::of_pairs(&[[DVec3::X; 2]; 2]), Err(PlacementError::TooFew { found: 2 }));
        let line = [0.0, 1.0, 3.0, 4.0].map(|x| [DVec3::splat(x); 2]);
        assert_eq!(Placement::of_pairs(&line), Err(PlacementError::OnALine));
    }

    #[test]
    fn pairs_that_a_mirror_would_fit_best_are_turned_and_not_mirrored() {
        let points = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE];
        let found = Placement::of_pairs(&points.map(|p| [p, p * DVec3::new(1.0, 1.0, -1.0)])).unwrap();
        assert!((found.linear.determinant() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_mirrored_and_stretched_box_keeps_its_outside_and_its_normals_are_those_of_its_faces() {
        let mut mesh = shapes::cuboid(DVec3::new(1.0, 2.0, 3.0), 2);
        let values = mesh.vertex_normals().iter().flat_map(|n| n.to_array().map(|x| x as f32)).collect();
        mesh.attributes.push(Attribute { name: "normal".into(), width: 3, values });
        let before = crate::mesh::diagnose(&mesh).volume.unwrap();
        let stretch = DMat3::from_diagonal(DVec3::new(-2.0, 1.0, 0.5));
        Placement::about(stretch, DVec3::ONE).mesh(&mut mesh);
        assert!((crate::mesh::diagnose(&mesh).volume.unwrap() - before).abs() < 1e-12);
        let own = mesh.vertex_normals();
        // In the middle of a face the normal is that of the face.
        for (k, n) in own.iter().enumerate().filter(|(_, n)| n.abs().max_element() > 0.999_999) {
            let told: Vec<f64> = mesh.attributes[0].values[3 * k..3 * k + 3].iter().map(|x| *x as f64).collect();
            assert!(n.distance(DVec3::from_slice(&told)) < 1e-6, "{n} {told:?}");
        }
    }
}
