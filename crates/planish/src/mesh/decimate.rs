//! Fewer triangles: edges collapsed in the order of their quadric error, features kept.
//!
//! Garland and Heckbert 1997, *Surface Simplification Using Quadric Error Metrics* (area-weighted planes, the best
//! place of the merged vertex), of the planes that are there now and not those of the input, as Lindstrom and Turk
//! 1998, *Fast and Memory Efficient Polygonal Simplification*: a fifth less error; features as in Kobbelt et al.
//! 2001, §5.3: a vertex on a sharp line collapses along the line only, a corner stays.
//!
//! Refuses what would change the topology (link condition), turn a triangle, or leave a sliver; and as that does not
//! yet rule out that two sheets touch, the result is checked by exact signs, and made again with the neighbourhood of
//! what meets locked.

mod collapse;
mod queue;

use super::intersect::intersections_of;
use super::soup::check_some;
use super::{FeatureTags, MeshError, TriMesh, self_intersections};
use crate::geom::Bvh;
use crate::observe::{Cancelled, Observer};
use collapse::Collapse;
use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DecimateTarget {
    /// Keep this share of the triangles
    Ratio(#[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0, "unit" = "share"))] f64),
    /// Keep this many triangles
    Triangles(#[schemars(range(min = 4))] usize),
    /// Go as far as no place of the input is farther from the result than this
    Tolerance(#[schemars(extend("exclusiveMinimum" = 0.0, "tolerance" = "length"))] f64),
}

/// How to decimate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DecimateParams {
    /// When to stop
    pub target: DecimateTarget,
    /// Edges whose triangles differ by more than this count as features where the mesh has no tags
    #[schemars(range(min = 0.0, max = 180.0), extend("unit" = "degrees"))]
    pub feature_angle_deg: f64,
}

impl Default for DecimateParams {
    fn default() -> Self {
        DecimateParams { target: DecimateTarget::Ratio(0.1), feature_angle_deg: 40.0 }
    }
}

/// Why a mesh cannot be decimated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DecimateError {
    /// The mesh is damaged.
    #[error("{0}")]
    Mesh(#[from] MeshError),
    /// The mesh is not manifold.
    #[error("{edges} edges have more than two triangles or run the same way; repair the mesh first")]
    NotManifold {
        /// Edges that are not sound.
        edges: usize,
    },
    /// A target that is none.
    #[error("a {what} of {value} is no target; give {range}")]
    Target {
        /// Which target.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What is possible.
        range: &'static str,
    },
    /// The observer wants no result any more.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// A decimated mesh.
#[derive(Clone, Debug)]
pub struct Decimated {
    /// The mesh; attributes are carried along.
    pub mesh: TriMesh,
    /// Its features.
    pub tags: FeatureTags,
    /// Pairs of triangles that meet: those of the input that could not be resolved; 0 for a sound input.
    pub self_intersections: usize,
    /// Greatest distance from a vertex of the input to the result, world units; measured for a tolerance only.
    pub distance: Option<f64>,
}

/// Rounds in which the neighbourhood of what meets is locked, and tolerances are tightened where the result is too far.
const LOCKING_ROUNDS: usize = 12;
/// Factor by which they are tightened.
const TIGHTEN: f64 = 0.5;

/// Decimates a manifold mesh.
/// * `tags` - its features; found by the angle of the parameters if there are none
/// # Errors
/// [`DecimateError`] for meshes that are no manifold, targets that are none, or if cancelled.
pub fn decimate(
    mesh: &TriMesh,
    tags: Option<&FeatureTags>,
    params: &DecimateParams,
    observer: &dyn Observer,
) -> Result<Decimated, DecimateError> {
    check_some(mesh)?;
    let wrong = |what, value, range| Err(DecimateError::Target { what, value, range });
    let (count, allowed) = match params.target {
        DecimateTarget::Ratio(r) if r > 0.0 && r <= 1.0 => ((mesh.triangles.len() as f64 * r) as usize, None),
        DecimateTarget::Ratio(r) => return wrong("ratio", r, "a number above 0 and at most 1"),
        DecimateTarget::Triangles(n) if n >= 4 => (n, None),
        DecimateTarget::Triangles(n) => return wrong("number of triangles", n as f64, "at least 4"),
        DecimateTarget::Tolerance(t) if t > 0.0 && t.is_finite() => (0, Some(t)),
        DecimateTarget::Tolerance(t) => return wrong("tolerance", t, "a length above 0"),
    };
    let found;
    let tags = match tags {
        Some(tags) if tags.vertices.len() == mesh.points.len() => tags,
        _ => {
            found = sharp_tags(mesh, params.feature_angle_deg);
            &found
        }
    };
    let mut locked = vec![false; mesh.points.len()];
    let mut before = None;
    let mut log = Vec::new();
    let mut tolerances = vec![allowed.unwrap_or(f64::INFINITY); mesh.points.len()];
    for round in 0..=LOCKING_ROUNDS {
        let mut collapse = Collapse::new(mesh, tags, &locked, tolerances.clone(), &log)?;
        collapse.run(count, observer)?;
        let done = collapse.take_log();
        let (result, result_tags, source) = collapse.finish();
        let mut distance = None;
        if let Some(allowed) = allowed {
            let nearest = nearest(mesh, &result);
            let farthest = nearest.iter().map(|n| n.1).fold(0.0, f64::max);
            if farthest > allowed && round < LOCKING_ROUNDS {
                tighten(&result, &nearest, allowed, &mut tolerances);
                log = done;
                continue;
            }
            distance = Some(farthest);
        }
        let meeting = intersections_of(&result, |_| true, observer)?;
        if !meeting.is_empty() && round < LOCKING_ROUNDS {
            // What the input has already is not ours to mend.
            let own = *before.get_or_insert_with(|| self_intersections(mesh).len());
            if meeting.len() > own {
                // What a locked vertex rules out is left out; all else is done again, and more of it.
                log = done;
                lock(mesh, &result, &source, &meeting, &mut locked);
                continue;
            }
        }
        observer.progress(1.0);
        let mut result = result;
        result_tags.mark(&mut result);
        return Ok(Decimated { mesh: result, tags: result_tags, self_intersections: meeting.len(), distance });
    }
    unreachable!("the last round returns")
}

/// Features by the angle between neighbours.
fn sharp_tags(mesh: &TriMesh, angle_deg: f64) -> FeatureTags {
    let adjacency = super::Adjacency::new(mesh);
    let sharp = super::sharp_edges(mesh, &adjacency, angle_deg);
    let edges =
        (0..sharp.len() as u32).filter(|&h| sharp[h as usize]).map(|h| [mesh.origin(h), mesh.origin(super::next(h))]);
    FeatureTags::from_edges(mesh.points.len(), edges)
}

/// For each vertex of `from` that is in use the triangle of `to` next to it, and how far that is.
fn nearest(from: &TriMesh, to: &TriMesh) -> Vec<(Option<u32>, f64)> {
    let bvh = Bvh::new(to);
    let mut used = vec![false; from.points.len()];
    from.triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
    let to = |(&p, used): (&DVec3, bool)| {
        let hit = bvh.closest(p);
        if used { (Some(hit.place.face), hit.distance) } else { (None, 0.0) }
    };
    from.points.par_iter().zip(used).map(to).collect()
}

/// Tightens the tolerances of what became the triangles that something is farther from than `allowed`, and of what became
/// their neighbours.
fn tighten(result: &TriMesh, nearest: &[(Option<u32>, f64)], allowed: f64, tolerances: &mut [f64]) {
    let mut wrong = vec![false; result.points.len()];
    for t in nearest.iter().filter(|n| n.1 > allowed).filter_map(|n| n.0) {
        result.triangles[t as usize].iter().for_each(|&v| wrong[v as usize] = true);
    }
    for (tolerance, (triangle, _)) in tolerances.iter_mut().zip(nearest) {
        if triangle.is_some_and(|t| result.triangles[t as usize].iter().any(|&v| wrong[v as usize])) {
            *tolerance *= TIGHTEN;
        }
    }
}

/// Locks the vertices of the input around the corners of triangles that meet.
fn lock(mesh: &TriMesh, result: &TriMesh, source: &[u32], meeting: &[[u32; 2]], locked: &mut [bool]) {
    let mut ring = vec![false; locked.len()];
    for &v in meeting.iter().flatten().flat_map(|&t| &result.triangles[t as usize]) {
        ring[source[v as usize] as usize] = true;
    }
    // Everything that was merged nearby is within a few rings.
    for _ in 0..3 {
        let before = ring.clone();
        for t in mesh.triangles.iter().filter(|t| t.iter().any(|&v| before[v as usize])) {
            t.iter().for_each(|&v| ring[v as usize] = true);
        }
    }
    locked.iter_mut().zip(ring).for_each(|(l, r)| *l |= r);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Silent;
    use crate::mesh::diagnose;
    use crate::synthetic::shapes;

    fn to(target: DecimateTarget) -> DecimateParams {
        DecimateParams { target, ..Default::default() }
    }

    #[test]
    fn cube_of_4800_triangles_becomes_one_of_12_with_its_8_corners() {
        let cube = shapes::cuboid(glam::DVec3::new(1.0, 2.0, 3.0), 20);
        let found = decimate(&cube, None, &to(DecimateTarget::Triangles(12)), &Silent).unwrap();
        assert_eq!(found.mesh.triangles.len(), 12);
        let d = diagnose(&found.mesh);
        assert!(d.watertight && d.manifold && (d.volume.unwrap() - 6.0).abs() < 1e-9);
        assert_eq!(found.tags.edges.len(), 12);
    }

    #[test]
    fn sphere_to_a_tenth_stays_within_half_a_percent_closed_and_free_of_self_intersections() {
        let sphere = shapes::sphere(1.0, 5);
        let found = decimate(&sphere, None, &to(DecimateTarget::Ratio(0.1)), &Silent).unwrap();
        let d = diagnose(&found.mesh);
        assert!(d.watertight && d.manifold && d.genus == Some(0) && d.flipped_faces == 0);
        assert!((found.mesh.triangles.len() as i64 - 2048).abs() <= 1, "{}", found.mesh.triangles.len());
        assert!(nearest(&sphere, &found.mesh).iter().all(|n| n.1 < 0.005));
        assert_eq!(found.self_intersections, 0);
    }

    #[test]
    fn a_wavy_form_to_a_tenth_is_off_by_less_than_four_ten_thousandths_of_its_size_in_the_mean() {
        let mut wavy = shapes::sphere(1.0, 5);
        wavy.points
            .iter_mut()
            .for_each(|p| *p *= 1.0 + 0.15 * (5.0 * p.x).sin() * (4.0 * p.y).cos() * (6.0 * p.z).sin());
        let found = decimate(&wavy, None, &to(DecimateTarget::Ratio(0.1)), &Silent).unwrap();
        let off = nearest(&wavy, &found.mesh).iter().map(|n| n.1 * n.1).sum::<f64>() / wavy.points.len() as f64;
        // .00047 with costs out of date, .00041 with the planes of the input.
        let rms = off.sqrt() / wavy.bounds().diagonal();
        assert!(rms < 0.00036, "{rms}");
    }

    #[test]
    fn a_tolerance_is_kept_and_the_rim_of_an_open_mesh_stays() {
        let disk = shapes::annulus(1.0, 2.0, 96);
        let found = decimate(&disk, None, &to(DecimateTarget::Tolerance(0.01)), &Silent).unwrap();
        assert!(found.distance.unwrap() <= 0.01);
        let (a, b) = (diagnose(&disk), diagnose(&found.mesh));
        assert_eq!(b.boundary_loops, a.boundary_loops);
        assert!((a.area - b.area).abs() < 0.01 * a.area && b.triangles * 3 < a.triangles);
    }

    #[test]
    fn two_bowls_that_touch_in_their_tips_stay_joined_there() {
        let mut points = vec![glam::DVec3::ZERO];
        let mut triangles = Vec::new();
        for side in [1.0, -1.0] {
            let first = points.len() as u32;
            for row in 1..=8 {
                for k in 0..32 {
                    let (r, a) = (0.1 * row as f64, std::f64::consts::TAU * k as f64 / 32.0);
                    points.push(glam::DVec3::new(r * a.cos(), side * r * a.sin(), side * (r / 2.0 + r * r)));
                }
            }
            for k in 0..32u32 {
                let at = |row: u32, k: u32| first + 32 * row + k % 32;
                triangles.push([0, at(0, k), at(0, k + 1)]);
                for row in 0..7 {
                    triangles.push([at(row, k), at(row + 1, k), at(row + 1, k + 1)]);
                    triangles.push([at(row, k), at(row + 1, k + 1), at(row, k + 1)]);
                }
            }
        }
        let bowls = TriMesh::new(points, triangles);
        let found = decimate(&bowls, None, &to(DecimateTarget::Ratio(0.1)), &Silent).unwrap();
        assert_eq!(found.mesh.triangles.len() * 10, bowls.triangles.len());
        let tip = found.mesh.points.iter().position(|p| *p == glam::DVec3::ZERO).unwrap() as u32;
        let around = |side: f64| {
            let beyond = |t: &[u32; 3]| t.iter().all(|&v| found.mesh.points[v as usize].z * side >= 0.0);
            let there = |t: &&[u32; 3]| t.contains(&tip) && beyond(t);
            found.mesh.triangles.iter().filter(there).count()
        };
        assert!(around(1.0) > 2 && around(-1.0) > 2, "{} and {} triangles", around(1.0), around(-1.0));
    }

    #[test]
    fn targets_that_are_none_are_refused() {
        let cube = shapes::cuboid(glam::DVec3::ONE, 2);
        for target in [DecimateTarget::Ratio(0.0), DecimateTarget::Triangles(1), DecimateTarget::Tolerance(f64::NAN)] {
            assert!(matches!(decimate(&cube, None, &to(target), &Silent), Err(DecimateError::Target { .. })));
        }
    }
}
