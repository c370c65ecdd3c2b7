//! Small holes of a surface, closed with lids that go on as the surface does.
//!
//! A hole is told from the boundary of a piece by what lies around it: more surface than fits within it, and a surface that
//! looks the way a lid would. The end of a pipe is no hole, for its sides look away from its axis. See
//! `docs/methods/mend.md`, "Lids".

use super::lids::{Lid, least_area, lid};
use crate::mesh::{Adjacency, FeatureKind, FeatureTags, TriMesh, boundary_loops, components, next};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;

/// A piece has at least this many times the area of a disk with the boundary of its hole.
const PIECE_OVER_DISK: f64 = 4.0;
/// Area vector of a lid, along the mean of the normals around, over the area of the lid; one for a hole in a plane.
const LID_FACING: f64 = 0.3;
/// Holes of so few edges are cracks, whatever lies around them.
const CRACK: usize = 6;
/// The first triangles of a lid cost the third power of the edges around.
const MOST_EDGES: usize = 400;

/// Closes the holes of an oriented manifold that are at most `longest` around; returns their number.
/// # Errors
/// [`Cancelled`]; the mesh is then as it was.
pub fn close_holes(
    mesh: &mut TriMesh,
    tags: &mut FeatureTags,
    longest: f64,
    observer: &dyn Observer,
) -> Result<usize, Cancelled> {
    let adjacency = Adjacency::new(mesh);
    let (piece, pieces) = components(&adjacency);
    let mut area = vec![0.0; pieces];
    (0..mesh.triangles.len()).for_each(|t| area[piece[t] as usize] += mesh.area(t));
    let loops = boundary_loops(&adjacency);
    let made: Result<Vec<_>, Cancelled> = loops
        .par_iter()
        .map(|around| {
            observer.check()?;
            let length: f64 = around.iter().map(|&h| step(mesh, h).length()).sum();
            let disk = length * length / (4.0 * std::f64::consts::PI);
            if length > longest
                || around.len() > MOST_EDGES
                || area[piece[around[0] as usize / 3] as usize] < PIECE_OVER_DISK * disk
            {
                return Ok(None);
            }
            // A lid runs against the edges of its hole.
            let rim: Vec<u32> = around.iter().rev().map(|&h| mesh.origin(h)).collect();
            Ok(lid_over(mesh, &adjacency, around, &rim, true).map(|lid| (rim, lid)))
        })
        .collect();
    let mut count = 0;
    for (rim, lid) in made?.into_iter().flatten() {
        cover(mesh, tags, &rim, &lid);
        count += 1;
    }
    Ok(count)
}

/// Closes the hole of an oriented manifold whose boundary comes nearest to a place, as somebody has asked for it: whatever lies
/// around. False, and the mesh as it was, if its boundary touches itself or has too many edges.
pub fn close_hole(mesh: &mut TriMesh, tags: &mut FeatureTags, near: DVec3) -> bool {
    let adjacency = Adjacency::new(mesh);
    let away = |h: &u32| mesh.points[mesh.origin(*h) as usize].distance_squared(near);
    let nearest = |around: &Vec<u32>| around.iter().map(away).fold(f64::INFINITY, f64::min);
    let loops = boundary_loops(&adjacency);
    let Some(around) = loops.iter().min_by(|a, b| nearest(a).total_cmp(&nearest(b))) else { return false };
    if around.len() > MOST_EDGES {
        return false;
    }
    let rim: Vec<u32> = around.iter().rev().map(|&h| mesh.origin(h)).collect();
    let found = lid_over(mesh, &adjacency, around, &rim, false);
    found.inspect(|lid| cover(mesh, tags, &rim, lid)).is_some()
}

/// Closes the holes of an oriented manifold all of whose boundary vertices are `wanted`, whatever lies around; returns their number.
pub(crate) fn close_around(mesh: &mut TriMesh, tags: &mut FeatureTags, wanted: impl Fn(u32) -> bool) -> usize {
    let adjacency = Adjacency::new(mesh);
    let made: Vec<_> = boundary_loops(&adjacency)
        .iter()
        .filter(|around| around.len() <= MOST_EDGES && around.iter().all(|&h| wanted(mesh.origin(h))))
        .filter_map(|around| {
            let rim: Vec<u32> = around.iter().rev().map(|&h| mesh.origin(h)).collect();
            lid_over(mesh, &adjacency, around, &rim, false).map(|lid| (rim, lid))
        })
        .collect();
    made.iter().for_each(|(rim, lid)| cover(mesh, tags, rim, lid));
    made.len()
}

/// Puts a lid on its rim.
fn cover(mesh: &mut TriMesh, tags: &mut FeatureTags, rim: &[u32], lid: &Lid) {
    let first = mesh.points.len() as u32;
    let name = |v: u32| rim.get(v as usize).copied().unwrap_or_else(|| first + v - rim.len() as u32);
    mesh.triangles.extend(lid.triangles.iter().map(|t| t.map(name)));
    let own = &lid.points[rim.len()..];
    mesh.points.extend(own);
    tags.vertices.extend(own.iter().map(|_| FeatureKind::None));
    for a in &mut mesh.attributes {
        let at = |v: u32, k: usize| a.values[v as usize * a.width + k];
        let mean = |k: usize| rim.iter().map(|&v| at(v, k)).sum::<f32>() / rim.len() as f32;
        let value: Vec<f32> = (0..a.width).map(mean).collect();
        own.iter().for_each(|_| a.values.extend(&value));
    }
}

fn step(mesh: &TriMesh, h: u32) -> DVec3 {
    mesh.points[mesh.origin(next(h)) as usize] - mesh.points[mesh.origin(h) as usize]
}

/// The lid over a boundary, if that is a hole of the surface around.
/// * `told` - true to tell holes from ends by what lies around
fn lid_over(mesh: &TriMesh, adjacency: &Adjacency, around: &[u32], rim: &[u32], told: bool) -> Option<Lid> {
    let n = rim.len();
    let points: Vec<DVec3> = rim.iter().map(|&v| mesh.points[v as usize]).collect();
    let beside: Vec<Vec<u32>> = rim
        .iter()
        .map(|&v| {
            let ring = adjacency.fan(v).flat_map(|h| mesh.triangles[h as usize / 3]);
            let mut ring: Vec<u32> = ring.filter(|&w| w != v).collect();
            ring.sort_unstable();
            ring.dedup();
            ring
        })
        .collect();
    let taken = |i: usize, j: usize| {
        let next_to = j == i + 1 || (i == 0 && j == n - 1);
        !next_to && beside[i].binary_search(&rim[j]).is_ok()
    };
    // The two sides of a cut are no hole.
    let mut places: Vec<[u64; 3]> = points.iter().map(|p| p.to_array().map(f64::to_bits)).collect();
    places.sort_unstable();
    if places.windows(2).any(|w| w[0] == w[1]) {
        return None;
    }
    let flat = least_area(&points, taken)?;
    if told && n > CRACK {
        let area: f64 = flat.iter().map(|t| cross(&points, t).length()).sum();
        let lid: DVec3 = flat.iter().map(|t| cross(&points, t)).sum();
        let sides: DVec3 = around.iter().map(|&h| mesh.area_vector(h as usize / 3)).sum();
        let size: f64 = around.iter().map(|&h| mesh.area_vector(h as usize / 3).length()).sum();
        let goes_on = lid.dot(sides) > LID_FACING * area * size;
        if !goes_on {
            return None;
        }
    }
    let beside: Vec<Vec<DVec3>> = (0..n)
        .map(|k| {
            let on_rim = [rim[(k + 1) % n], rim[(k + n - 1) % n]];
            beside[k].iter().filter(|w| !on_rim.contains(w)).map(|&w| mesh.points[w as usize]).collect()
        })
        .collect();
    Some(lid(&points, &beside, &flat))
}

/// Twice the area vector of a triangle of a lid.
fn cross(points: &[DVec3], t: &[usize; 3]) -> DVec3 {
    (points[t[1]] - points[t[0]]).cross(points[t[2]] - points[t[0]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::diagnose;
    use crate::synthetic::shapes;

    /// The sphere of radius 1 without the triangles that have a corner within `radius` of the north pole.
    fn holed_sphere(radius: f64) -> TriMesh {
        let mut mesh = shapes::sphere(1.0, 5);
        let points = &mesh.points;
        mesh.triangles.retain(|t| t.iter().all(|&v| points[v as usize].distance(DVec3::Z) > radius));
        crate::mend::repair(&mesh, &crate::Silent).unwrap().0
    }

    #[test]
    fn a_pipe_gets_lids_on_those_of_its_two_ends_that_are_asked_for() {
        let mut mesh = shapes::cylinder(1.0, 3.0, 24);
        let normal = |t: usize, m: &TriMesh| m.area_vector(t).normalize().z.abs();
        let sides: Vec<[u32; 3]> =
            (0..mesh.triangles.len()).filter(|&t| normal(t, &mesh) < 0.5).map(|t| mesh.triangles[t]).collect();
        mesh.triangles = sides;
        let mut mesh = crate::mend::repair(&mesh, &crate::Silent).unwrap().0;
        let mut tags = FeatureTags::from_edges(mesh.points.len(), []);
        assert_eq!(close_holes(&mut mesh, &mut tags, 100.0, &crate::Silent).unwrap(), 0);
        assert_eq!(boundary_loops(&Adjacency::new(&mesh)).len(), 2);
        let top = mesh.bounds().max.z;
        assert!(close_hole(&mut mesh, &mut tags, DVec3::new(0.0, 0.0, 10.0)));
        let left = boundary_loops(&Adjacency::new(&mesh));
        assert_eq!(left.len(), 1);
        assert!(left[0].iter().all(|&h| mesh.points[mesh.origin(h) as usize].z < top - 1.0));
        assert!(close_hole(&mut mesh, &mut tags, DVec3::ZERO) && diagnose(&mesh).watertight);
        assert!(!close_hole(&mut mesh, &mut tags, DVec3::ZERO));
    }

    #[test]
    fn the_lid_of_a_sphere_lies_within_2_percent_of_the_radius_and_is_as_fine_as_the_sphere() {
        let mut mesh = holed_sphere(0.25);
        let before = mesh.triangles.len();
        let kept = mesh.points.clone();
        let mut tags = FeatureTags::from_edges(mesh.points.len(), []);
        assert_eq!(close_holes(&mut mesh, &mut tags, 2.0, &crate::Silent).unwrap(), 1);
        let facts = diagnose(&mesh);
        assert!(facts.watertight && facts.manifold && facts.genus == Some(0));
        assert_eq!(tags.vertices.len(), mesh.points.len());
        assert_eq!(mesh.points[..kept.len()], kept);
        let off = mesh.points.iter().map(|p| (p.length() - 1.0).abs()).fold(0.0, f64::max);
        assert!(off < 0.02, "{off}");
        // As many triangles as the part of the sphere had, a third more or less.
        let (made, gone) = (mesh.triangles.len() - before, shapes::sphere(1.0, 5).triangles.len() - before);
        assert!(made * 3 > gone * 2 && made * 3 < gone * 4, "{made} for {gone}");
        for t in before..mesh.triangles.len() {
            let out = mesh.corners(t).into_iter().sum::<DVec3>().normalize();
            assert!(mesh.normal(t).dot(out) > 0.9, "triangle {t}");
        }
    }

    #[test]
    fn long_holes_ends_of_pipes_and_the_rims_of_pieces_stay_open() {
        let mut mesh = holed_sphere(0.25);
        let mut tags = FeatureTags::from_edges(mesh.points.len(), []);
        assert_eq!(close_holes(&mut mesh, &mut tags, 1.0, &crate::Silent).unwrap(), 0);
        let mut sheet = shapes::rectangle(1.0, 1.0, 10, 10);
        assert_eq!(close_holes(&mut sheet, &mut FeatureTags::from_edges(121, []), 100.0, &crate::Silent).unwrap(), 0);
        let mut pipe = shapes::cylinder(0.1, 4.0, 48);
        let caps = pipe.clone();
        pipe.triangles.retain(|t| {
            let z = t.map(|v| caps.points[v as usize].z);
            z.iter().any(|&a| (a - z[0]).abs() > 1e-9)
        });
        let (mut pipe, _) = crate::mend::repair(&pipe, &crate::Silent).unwrap();
        let mut tags = FeatureTags::from_edges(pipe.points.len(), []);
        assert_eq!(diagnose(&pipe).boundary_loops, 2);
        assert_eq!(close_holes(&mut pipe, &mut tags, 100.0, &crate::Silent).unwrap(), 0);
    }
}
