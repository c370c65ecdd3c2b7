//! A part as it is cast and then drilled: a housing on a flange.
//!
//! A rounded box, open at the top, stands with a fillet on a flange with rounded corners; in it a boss and two ribs,
//! with smaller fillets. The flange has four holes, the boss a bore through the floor, one wall a hole. Cut and drilled
//! edges are sharp at 90 degrees, the top edges of the ribs fade into their fillets, all others are round.

use super::form::Form;
use super::{dimension, mesh};
use crate::contour::MeshingError;
use crate::field::Solid;
use crate::mesh::TriMesh;
use glam::{DVec2, DVec3};

/// Usual dimensions; the seed moves them. The length of the part is 144.
const FLANGE: [f64; 2] = [144.0, 114.0];
const FLANGE_CORNER: f64 = 12.0;
const FLANGE_HEIGHT: f64 = 9.0;
const HOUSING: [f64; 2] = [100.0, 74.0];
const HOUSING_CORNER: f64 = 10.0;
const HOUSING_HEIGHT: f64 = 36.0;
const WALL: f64 = 8.0;
/// Fillets: around the housing, in the cavity, and at boss and ribs.
const FOOT: f64 = 7.0;
const CAVITY: f64 = 6.0;
const INNER: f64 = 5.0;
const BOSS: f64 = 14.0;
const BOSS_HEIGHT: f64 = 26.0;
const BORE: f64 = 8.0;
const RIB: f64 = 8.0;
const RIB_HEIGHT: f64 = 20.0;
const HOLE: f64 = 5.5;
/// From the edges of the flange to the middle of its holes.
const HOLE_IN: f64 = 11.0;
const WINDOW: f64 = 6.5;
const WINDOW_HEIGHT: f64 = 24.0;
/// Where the window sits, from the middle of the part along it.
const WINDOW_ASIDE: f64 = 26.0;
/// How much the seed moves a dimension, at most: by more the holes of the flange would reach the fillet of the housing.
const SPREAD: f64 = 0.03;
/// Where what stands on the floor begins, as a share of its height.
const DEEP: f64 = 0.9;
/// Longer than anything of the part.
const FAR: f64 = 500.0;

/// A housing on a flange with fillets, a boss, ribs and six holes (its genus is 6), in world units of which it is about
/// 144 long.
///
/// * `seed` - moves the dimensions by up to 3 %
/// * `cells` - cells of the mesh along its length
/// # Errors
/// [`MeshingError`] if so many cells are more than memory allows, or too few to have a surface.
pub fn casting(seed: u64, cells: usize) -> Result<TriMesh, MeshingError> {
    mesh(&form(seed), cells)
}

fn form(seed: u64) -> Form {
    let own = |counter: u64, usual: f64| dimension(seed, counter, usual, SPREAD);
    let flange = DVec2::new(own(0, FLANGE[0]), own(1, FLANGE[1]));
    let housing = DVec2::new(own(2, HOUSING[0]), own(3, HOUSING[1]));
    let (floor, top, wall) = (own(4, FLANGE_HEIGHT), own(5, HOUSING_HEIGHT), own(6, WALL));
    // What stands on the floor begins below its top, but not as deep as its underside: a fillet would fill in there.
    let foot = DEEP * floor;
    let outside = Form::from(plate(flange, own(7, FLANGE_CORNER), 0.0, floor))
        .union(plate(housing, HOUSING_CORNER, foot, top), own(8, FOOT));
    let inside = housing - 2.0 * wall;
    // Open at the top: the cavity reaches as far above the wall as it goes into it.
    let depth = 2.0 * (top - floor);
    let cavity = Solid::Cuboid { size: inside.extend(depth), round: own(9, CAVITY) }.moved(DVec3::Z * top);

    let boss = upright(own(10, BOSS), foot, own(11, BOSS_HEIGHT));
    let rib_top = own(13, RIB_HEIGHT);
    let rib = Solid::Cuboid { size: DVec3::new(inside.x + wall, own(12, RIB), rib_top - foot), round: 0.0 }
        .moved(DVec3::Z * (foot + rib_top) / 2.0);
    let inner = own(14, INNER);
    let body = outside.difference(cavity).union(Form::from(boss).union(rib, inner), inner);

    let mut cuts = vec![upright(own(15, BORE), -FAR, FAR)];
    let at = flange / 2.0 - HOLE_IN;
    let hole = own(16, HOLE);
    cuts.extend(
        [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            .map(|(x, y)| upright(hole, -FAR, FAR).moved(DVec3::new(x * at.x, y * at.y, 0.0))),
    );
    // From far away to the middle of the gap between wall and boss.
    let from = -(inside.y / 2.0 + own(10, BOSS)) / 2.0;
    let window = upright(own(17, WINDOW), 0.0, FAR).turned(DVec3::X, 90.0);
    cuts.push(window.moved(DVec3::new(own(18, WINDOW_ASIDE), from, own(19, WINDOW_HEIGHT))));
    body.difference(Solid::Union(cuts))
}

/// A plate between two heights whose upright edges are rounded.
fn plate(size: DVec2, corner: f64, from: f64, to: f64) -> Solid {
    let rounded = Solid::Cuboid { size: size.extend(to - from + 4.0 * corner), round: corner };
    let top = Solid::Plane { normal: DVec3::Z, offset: to };
    let bottom = Solid::Plane { normal: -DVec3::Z, offset: -from };
    Solid::Intersection(vec![rounded.moved(DVec3::Z * (from + to) / 2.0), top, bottom])
}

/// A cylinder around the z axis between two heights.
fn upright(radius: f64, from: f64, to: f64) -> Solid {
    Solid::Cylinder { radius, height: to - from }.moved(DVec3::Z * (from + to) / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Adjacency, diagnose, next, self_intersections, sharp_edges};
    use std::f64::consts::TAU;

    /// Length of all edges: rims of flange, housing and cavity, circles of boss, bore, holes and window, and the top
    /// edges of the ribs up to their fillets.
    fn edges(seed: u64) -> f64 {
        let own = |counter: u64, usual: f64| dimension(seed, counter, usual, SPREAD);
        let around = |x: f64, y: f64, corner: f64| 2.0 * (x + y) - (8.0 - TAU) * corner;
        let (housing, wall, inner) = ([own(2, HOUSING[0]), own(3, HOUSING[1])], own(6, WALL), own(14, INNER));
        let inside = housing.map(|side| side - 2.0 * wall);
        let flange = 2.0 * around(own(0, FLANGE[0]), own(1, FLANGE[1]), own(7, FLANGE_CORNER));
        let rims = around(housing[0], housing[1], HOUSING_CORNER) + around(inside[0], inside[1], own(9, CAVITY));
        let round = own(10, BOSS) + 2.0 * own(15, BORE) + 8.0 * own(16, HOLE) + 2.0 * own(17, WINDOW);
        let at_boss = ((own(10, BOSS) + inner).powi(2) - (own(12, RIB) / 2.0).powi(2)).sqrt();
        flange + rims + TAU * round + 4.0 * (inside[0] / 2.0 - inner - at_boss)
    }

    #[test]
    fn sharp_edges_of_a_casting_have_their_length_within_15_thousandths_and_its_genus_is_6() {
        for seed in 1..=3 {
            let mesh = casting(seed, 180).unwrap();
            // The edges of the ribs fade within their fillets.
            let sharp = sharp_edges(&mesh, &Adjacency::new(&mesh), 80.0);
            let at = |h: usize| mesh.points[mesh.origin(h as u32) as usize];
            let ends = (0..sharp.len()).filter(|&h| sharp[h]).map(|h| at(h).distance(at(next(h as u32) as usize)));
            let (length, wanted) = (ends.sum::<f64>() / 2.0, edges(seed));
            assert!((length / wanted - 1.0).abs() < 1.5e-2, "{length} for {wanted}");
            let facts = diagnose(&mesh);
            assert!(facts.watertight && facts.manifold && facts.components == 1);
            assert_eq!(facts.genus, Some(6));
            assert!(self_intersections(&mesh).is_empty());
        }
    }
}
