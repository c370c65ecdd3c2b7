//! A part as it is milled from a bar: an angle bracket.
//!
//! Two flanges at a right angle, a gusset between them, two holes in each. All edges are sharp, convex and concave, at
//! 90 degrees, but for the chamfered corners and the feet of the gusset at 45; only the outer edge of the angle is round.

use super::form::Form;
use super::{dimension, mesh};
use crate::contour::MeshingError;
use crate::field::Solid;
use crate::mesh::TriMesh;
use glam::DVec3;

/// Usual dimensions; the seed moves them. The length of the part is 90.
const LENGTH: f64 = 90.0;
const HEIGHT: f64 = 76.0;
const WIDTH: f64 = 56.0;
const THICKNESS: f64 = 10.0;
/// Of the outer edge.
const ROUND: f64 = 12.0;
const CHAMFER: f64 = 12.0;
/// Length of the gusset along both flanges, and how thick it is.
const GUSSET: f64 = 42.0;
const GUSSET_THICKNESS: f64 = 8.0;
const HOLE: f64 = 5.5;
/// From the free end of each flange to the middle of its holes, and from its sides.
const HOLE_IN: f64 = 22.0;
const HOLE_ASIDE: f64 = 13.0;
/// How much the seed moves a dimension, at most.
const SPREAD: f64 = 0.06;
/// Longer than anything of the part.
const FAR: f64 = 500.0;

/// The dimensions of one bracket.
struct Bracket {
    length: f64,
    height: f64,
    width: f64,
    thickness: f64,
    round: f64,
    chamfer: f64,
    gusset: f64,
    gusset_thickness: f64,
    hole: f64,
    hole_in: f64,
    hole_aside: f64,
}

/// An angle bracket with a gusset, one rounded edge, two chamfers and four holes (its genus is 4), in world units of
/// which it is about 90 long.
///
/// * `seed` - moves the dimensions by up to 6 %
/// * `cells` - cells of the mesh along its longest side
/// # Errors
/// [`MeshingError`] if so many cells are more than memory allows, or too few to have a surface.
pub fn bracket(seed: u64, cells: usize) -> Result<TriMesh, MeshingError> {
    mesh(&Bracket::new(seed).form(), cells)
}

impl Bracket {
    fn new(seed: u64) -> Bracket {
        let own = |counter: u64, usual: f64| dimension(seed, counter, usual, SPREAD);
        Bracket {
            length: own(0, LENGTH),
            height: own(1, HEIGHT),
            width: own(2, WIDTH),
            thickness: own(3, THICKNESS),
            round: own(4, ROUND),
            chamfer: own(5, CHAMFER),
            gusset: own(6, GUSSET),
            gusset_thickness: own(7, GUSSET_THICKNESS),
            hole: own(8, HOLE),
            hole_in: own(9, HOLE_IN),
            hole_aside: own(10, HOLE_ASIDE),
        }
    }

    /// The flanges run along x and z from the origin, their width along y on both sides of it.
    fn form(&self) -> Form {
        let Bracket { length, height, width, thickness, .. } = *self;
        let below = |normal: DVec3, offset: f64| Solid::Plane { normal, offset };
        let outside = Form::from(below(-DVec3::X, 0.0)).intersection(below(-DVec3::Z, 0.0), self.round);
        let slant = DVec3::new(0.0, 1.0, 1.0).normalize();
        // The plane of a chamfer passes this far from the origin.
        let corner = slant.dot(DVec3::new(0.0, width / 2.0, height)) - self.chamfer / 2f64.sqrt();
        let block = Solid::Intersection(vec![
            Solid::Cuboid { size: DVec3::new(2.0 * length, width, 2.0 * height), round: 0.0 },
            below(slant, corner),
            below(slant * DVec3::new(1.0, -1.0, 1.0), corner),
        ]);
        let free = Solid::Cuboid { size: DVec3::splat(FAR), round: 0.0 }.moved(DVec3::new(
            thickness + FAR / 2.0,
            0.0,
            thickness + FAR / 2.0,
        ));
        let flanges = outside.intersection(block, 0.0).difference(free);
        let body = flanges.union(self.gusset(), 0.0);
        let (x, y, z) = (length - self.hole_in, width / 2.0 - self.hole_aside, height - self.hole_in);
        let drill = Solid::Cylinder { radius: self.hole, height: 4.0 * thickness };
        let holes = [y, -y].into_iter().flat_map(|y| {
            [
                drill.clone().moved(DVec3::new(x, y, 0.0)),
                drill.clone().turned(DVec3::Y, 90.0).moved(DVec3::new(0.0, y, z)),
            ]
        });
        body.difference(Solid::Union(holes.collect()))
    }

    /// A triangle between the flanges, which reaches half into both.
    fn gusset(&self) -> Solid {
        let (from, to) = (self.thickness / 2.0, self.thickness + self.gusset + self.thickness / 2.0);
        // Its slanted side is a plane: the intersection has true distances on both of its edges.
        let slant = DVec3::new(1.0, 0.0, 1.0).normalize();
        let size = DVec3::new(to - from, self.gusset_thickness, to - from);
        Solid::Intersection(vec![
            Solid::Cuboid { size, round: 0.0 }.moved(DVec3::new((from + to) / 2.0, 0.0, (from + to) / 2.0)),
            Solid::Plane {
                normal: slant,
                offset: slant.dot(DVec3::new(self.thickness + self.gusset, 0.0, self.thickness)),
            },
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Adjacency, diagnose, next, self_intersections, sharp_edges};
    use std::f64::consts::{PI, SQRT_2};

    impl Bracket {
        /// Length of all edges but the round one.
        fn edges(&self) -> f64 {
            let Bracket { length, height, width, thickness, round, chamfer, gusset, gusset_thickness, hole, .. } =
                *self;
            let across = 2.0 * width + 2.0 * (width - 2.0 * chamfer) + width - gusset_thickness;
            let outline = (length - round) + thickness + (length - thickness) + PI / 2.0 * round;
            let upright = (height - chamfer - thickness) + (height - chamfer - round);
            let chamfers = 4.0 * (chamfer * SQRT_2 + thickness);
            let gusset = 2.0 * (gusset * SQRT_2 + 2.0 * gusset) + 2.0 * gusset_thickness;
            across + 2.0 * (outline + upright) + chamfers + gusset + 16.0 * PI * hole
        }
    }

    #[test]
    fn sharp_edges_of_a_bracket_have_their_length_within_3_thousandths_and_its_genus_is_4() {
        for seed in 1..=3 {
            let mesh = bracket(seed, 180).unwrap();
            let sharp = sharp_edges(&mesh, &Adjacency::new(&mesh), 40.0);
            let at = |h: usize| mesh.points[mesh.origin(h as u32) as usize];
            let ends = (0..sharp.len()).filter(|&h| sharp[h]).map(|h| at(h).distance(at(next(h as u32) as usize)));
            let (length, wanted) = (ends.sum::<f64>() / 2.0, Bracket::new(seed).edges());
            assert!((length / wanted - 1.0).abs() < 3e-3, "{length} for {wanted}");
            let facts = diagnose(&mesh);
            assert!(facts.watertight && facts.manifold && facts.components == 1);
            assert_eq!(facts.genus, Some(4));
            assert!(self_intersections(&mesh).is_empty());
        }
    }
}
