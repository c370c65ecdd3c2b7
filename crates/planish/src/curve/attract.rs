//! CurveAttract: every place of a surface curve slides to the place nearest to its attractor in space.
//!
//! [K98] §3.3.1. Places slide over the faces (MovePointOnSurface) and never leave them, so a curve cannot jump to
//! another sheet of the surface.

use crate::geom::polyline::Along;
use crate::mesh::{Adjacency, FacePoint, TriMesh, move_point_on_surface};
use glam::DVec3;
use rayon::prelude::*;

/// Slides of one place at most; each follows a face plane to the foot of the attractor, so a few are the rule.
const SLIDES: usize = 48;
/// A slide shorter than this share of the distance to the attractor ends the sliding.
const LEAST_SLIDE: f64 = 1e-7;
/// Halvings of a slide that would lead away (over a ridge).
const HALVINGS: usize = 6;
/// Places that one task slides at least.
const PARALLEL_LENGTH: usize = 64;

/// Slides `place` over the surface to a place from which `target` is nearest.
pub fn slide_to(mesh: &TriMesh, adjacency: &Adjacency, place: FacePoint, target: DVec3) -> FacePoint {
    slide_within(mesh, adjacency, place, target, 0.0)
}

/// As [`slide_to`], done when a slide is shorter than `tolerance` (world units).
pub(crate) fn slide_within(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    place: FacePoint,
    target: DVec3,
    tolerance: f64,
) -> FacePoint {
    let mut at = place;
    let mut p = at.position(mesh);
    let mut away = p.distance(target);
    for _ in 0..SLIDES {
        let mut step = target - p;
        let mut better = None;
        for _ in 0..HALVINGS {
            let trial = move_point_on_surface(mesh, adjacency, at, step);
            let q = trial.position(mesh);
            let d = q.distance(target);
            if d < away {
                better = Some((trial, q, d));
                break;
            }
            step /= 2.0;
        }
        let Some((trial, q, d)) = better else { break };
        let moved = p.distance(q);
        (at, p, away) = (trial, q, d);
        if moved <= (LEAST_SLIDE * away).max(tolerance) {
            break;
        }
    }
    at
}

/// Slides every place of a curve to its attractor; `attractors` holds one position (world units) per place.
/// Source: [K98] §3.3.1, CurveAttract.
pub fn attract(mesh: &TriMesh, adjacency: &Adjacency, points: &[FacePoint], attractors: &[DVec3]) -> Vec<FacePoint> {
    points
        .par_iter()
        .zip(attractors)
        .with_min_len(PARALLEL_LENGTH)
        .map(|(&p, &a)| slide_to(mesh, adjacency, p, a))
        .collect()
}

/// `count` positions at equal arc length along a polyline; its ends are kept.
pub fn sample_polyline(points: &[DVec3], count: usize) -> Vec<DVec3> {
    let mut along = Along::new(points.iter().copied());
    let total = along.length();
    (0..count)
        .map(|k| {
            if points.len() < 2 {
                return points[0];
            }
            let target = total * k as f64 / (count - 1).max(1) as f64;
            let (s, t) = along.advance(target);
            points[s].lerp(points[s + 1], t)
        })
        .collect()
}
