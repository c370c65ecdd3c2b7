//! How well a grid can cover the patches of a layout: what decides how many patches a form needs.

use super::complex::Complex;
use super::recut::Bench;
use super::shape::{STEEP_DEG, Shape, ground_cost};
use super::strips::{self, chords::PATCH_COST};
use crate::geom::polyline;
use crate::mesh::TriMesh;
use crate::network::CurveKind;
use glam::DVec3;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::HashSet;
use std::f64::consts::FRAC_2_PI;

/// Part of the patches that has to be covered well: more squares are tried until it is.
const KEPT: f64 = 0.9;

/// The least flatness of a patch that a grid covers well: that of half a cylinder. What goes further around has limbs inside.
const LEAST_FLATNESS: f64 = FRAC_2_PI;

/// A patch with a corner further off square than this, in degrees, is worse than any number of patches. Chosen: corners of other quad
/// layouts are up to 75 to 90 off.
const MOST_CORNER_OFF_DEG: f64 = 55.0;

/// What a grid meets on a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cover {
    /// Greatest angle off a right one at the corners, degrees. Corners between two sharp lines do not count: the form gives them.
    pub corner_deg: f64,
    /// Length of the sum of all normals, by area, as a part of the area: 1 for a plane, 2/pi for half a cylinder, 1/2 for
    /// half a ball.
    pub flatness: f64,
    /// True if none of its corners lies on a line or a boundary.
    pub is_open: bool,
}

impl Cover {
    /// True if a grid covers the patch well.
    pub fn is_good(&self) -> bool {
        self.corner_deg <= STEEP_DEG && self.flatness >= LEAST_FLATNESS
    }
}

/// What a grid meets on each patch of a layout of four-sided cells.
pub(super) fn covers(bench: &Bench) -> Vec<Cover> {
    let shapes = bench.shapes();
    let cells: Vec<u32> = bench.complex.live_cells().collect();
    let is_sharp = |half: u32| bench.complex.arc(half).kind == CurveKind::Feature;
    let on_line: HashSet<u32> = (cells.iter().flat_map(|&c| bench.complex.loop_of(c)))
        .filter(|&&half| bench.complex.arc(half).kind != CurveKind::Smooth)
        .flat_map(|&half| [bench.complex.from(half), bench.complex.from(half ^ 1)])
        .collect();
    let cover = |&c: &u32| {
        let shape = shapes[c as usize].as_ref()?;
        let sides = bench.complex.loop_of(c);
        let is_given = |k: usize| is_sharp(sides[k]) && is_sharp(sides[(k + 3) % 4]);
        let off = shape.angles().into_iter().enumerate().filter(|(k, _)| !is_given(*k));
        let corner_deg = off.map(|(_, angle)| (angle.to_degrees() - 90.0).abs()).fold(0.0, f64::max);
        let flatness = flatness(&bench.embedding.cut.mesh, &bench.embedding.members[c as usize]);
        let is_open = !sides.iter().any(|&half| on_line.contains(&bench.complex.from(half)));
        Some(Cover { corner_deg, flatness, is_open })
    };
    cells.par_iter().filter_map(cover).collect()
}

/// Sum of the normals of some faces, by area, and of their areas.
fn sum_of_normals(mesh: &TriMesh, faces: &[u32]) -> (DVec3, f64) {
    let normals = faces.iter().map(|&f| mesh.area_vector(f as usize));
    normals.fold((DVec3::ZERO, 0.0), |(sum, area), n| (sum + n, area + n.length()))
}

/// Length of the sum of the normals of some faces as a part of their area.
fn flatness(mesh: &TriMesh, faces: &[u32]) -> f64 {
    let (sum, area) = sum_of_normals(mesh, faces);
    sum.length() / area.max(f64::MIN_POSITIVE)
}

/// The complex without the rows of curves that no grid needs: the cells beside them, joined, are flat enough, and so
/// straight are their sides. The rows whose cells become most nearly square go first.
/// * `fewest` - cells that are left at least
pub(super) fn joined(bench: &Bench, fewest: usize) -> Complex {
    let mesh = &bench.embedding.cut.mesh;
    let normals = |faces: &Vec<u32>| sum_of_normals(mesh, faces);
    let cells: Vec<(DVec3, f64)> = bench.embedding.members.iter().map(normals).collect();
    let flat = |members: [&Vec<u32>; 2]| {
        let all = members.into_iter().flatten().map(|&c| cells[c as usize]);
        let (sum, area) = all.fold((DVec3::ZERO, 0.0), |(sum, area), (n, a)| (sum + n, area + a));
        sum.length() >= LEAST_FLATNESS * area
    };
    let mut complex = bench.complex.clone();
    strips::join(&mut complex, |complex, pairs, members| {
        if complex.live_cells().count() < fewest + pairs.len() {
            return None;
        }
        let off_square = |&[a, b]: &[u32; 2]| {
            let sides = joined_sides(bench.mesh, complex, a, b)?;
            let straight = sides.iter().all(|s| s.chord >= LEAST_FLATNESS * s.length);
            let aspect = (sides[1].length + sides[3].length) / (sides[0].length + sides[2].length);
            (straight && flat([&members[a as usize], &members[b as usize]])).then(|| aspect.ln().powi(2))
        };
        let sum: Option<f64> = pairs.iter().map(off_square).sum();
        Some(sum? / pairs.len() as f64)
    });
    complex
}

/// A side of a cell.
#[derive(Clone, Copy)]
struct SideLength {
    length: f64,
    /// Distance of its ends.
    chord: f64,
}

/// The sides of two cells that share one, joined: that across from it in the first, then counter-clockwise.
fn joined_sides(mesh: &TriMesh, complex: &Complex, a: u32, b: u32) -> Option<[SideLength; 4]> {
    let from = |c: u32, other: u32| complex.loop_of(c).iter().position(|&h| complex.cell(h ^ 1) == other);
    let (i, j) = (from(a, b)?, from(b, a)?);
    let place = |half: u32| mesh.points[complex.nodes[complex.from(half) as usize].vertex as usize];
    let side = |c: u32, k: usize| {
        let half = complex.loop_of(c)[k % 4];
        let points = complex.arc(half).chain.iter().map(|p| p.position(mesh));
        (polyline::length(points), place(half), place(half ^ 1))
    };
    // Counter-clockwise the second cell comes after the last side of the first.
    let one = |s: (f64, DVec3, DVec3)| SideLength { length: s.0, chord: s.1.distance(s.2) };
    let both = |s: (f64, DVec3, DVec3), t: (f64, DVec3, DVec3)| one((s.0 + t.0, s.1, t.2));
    Some([
        one(side(a, i + 2)),
        both(side(a, i + 3), side(b, j + 1)),
        one(side(b, j + 2)),
        both(side(b, j + 3), side(a, i + 1)),
    ])
}

/// What a network costs where patches have a price.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Price {
    /// Patches with a corner more than [`MOST_CORNER_OFF_DEG`] off square.
    bad: usize,
    /// [`PATCH_COST`] for each patch, and what its shape and its ground cost; its size does not matter.
    cost: f64,
}

impl Price {
    pub fn of(bench: &Bench) -> Price {
        let covers = covers(bench);
        let shapes = bench.shapes();
        let shape = |s: &Shape| PATCH_COST + s.cost(s.area);
        let ground: f64 = covers.iter().map(|c| ground_cost(c.flatness)).sum();
        Price {
            bad: covers.iter().filter(|c| c.corner_deg > MOST_CORNER_OFF_DEG).count(),
            cost: ground + shapes.iter().flatten().map(shape).sum::<f64>(),
        }
    }
}

impl PartialOrd for Price {
    /// Less is what costs less and has no more bad patches; of two networks neither may be.
    fn partial_cmp(&self, other: &Price) -> Option<Ordering> {
        match self.cost.partial_cmp(&other.cost)? {
            Ordering::Less if self.bad <= other.bad => Some(Ordering::Less),
            Ordering::Greater if self.bad >= other.bad => Some(Ordering::Greater),
            Ordering::Equal if self.bad == other.bad => Some(Ordering::Equal),
            _ => None,
        }
    }
}

/// Part of the patches that a grid covers well.
pub(super) fn good_part(covers: &[Cover]) -> f64 {
    covers.iter().filter(|c| c.is_good()).count() as f64 / covers.len().max(1) as f64
}

/// True if most cells lie on open surface, away from lines and boundaries.
pub(super) fn is_open(covers: &[Cover]) -> bool {
    2 * covers.iter().filter(|c| c.is_open).count() > covers.len()
}

/// True if so large a part of the patches is good that more of them are not needed.
pub(super) fn is_good(good_part: f64) -> bool {
    good_part >= KEPT
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::shapes;

    #[test]
    fn a_layout_is_open_if_more_than_half_of_its_cells_are() {
        let cells = |open: usize, on_lines: usize| {
            let cover = |is_open| Cover { corner_deg: 0.0, flatness: 1.0, is_open };
            [vec![cover(true); open], vec![cover(false); on_lines]].concat()
        };
        assert!(is_open(&cells(3, 2)) && !is_open(&cells(2, 2)) && !is_open(&[]));
    }

    #[test]
    fn a_network_that_costs_less_is_better_unless_it_has_more_bad_patches() {
        let price = |bad, cost| Price { bad, cost };
        assert!(price(2, 9.0) < price(2, 10.0) && price(1, 9.0) < price(2, 10.0));
        assert_eq!(price(3, 9.0).partial_cmp(&price(2, 10.0)), None);
        assert!(price(2, 10.0) > price(2, 9.0) && price(2, 9.0) == price(2, 9.0));
    }

    #[test]
    fn half_a_ball_has_a_flatness_of_a_half_and_half_a_cylinder_2_by_pi_within_1_percent() {
        let ball = shapes::sphere(1.0, 5);
        let upper = |mesh: &TriMesh, f: usize| mesh.corners(f).iter().all(|p| p.y > -1e-9);
        let half: Vec<u32> = (0..ball.triangles.len()).filter(|&f| upper(&ball, f)).map(|f| f as u32).collect();
        assert!((flatness(&ball, &half) - 0.5).abs() < 0.01, "{}", flatness(&ball, &half));
        let around = |u: f64| (std::f64::consts::PI * u).sin_cos();
        let wall = shapes::sheet(101, 2, false, false, |u, v| DVec3::new(around(u).1, around(u).0, v));
        let faces: Vec<u32> = (0..wall.triangles.len() as u32).collect();
        assert!((flatness(&wall, &faces) - FRAC_2_PI).abs() < 0.01 * FRAC_2_PI, "{}", flatness(&wall, &faces));
    }
}
