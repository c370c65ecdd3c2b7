//! Planes of symmetry: given or found, and places and curves mirrored across them.
//!
//! Finding: from every candidate (principal axes and even directions through the centroid) mirrored sample points
//! are matched with the surface and the plane is fitted to the pairs, again and again (iterated closest points for
//! mirrors); the one that misses least wins.
//!
//! Besl and McKay, *A Method for Registration of 3-D Shapes*, 1992, is the iteration; see `docs/methods/curves.md`.

use super::{CurveError, SurfaceCurve};
use crate::geom::Bvh;
use crate::linalg::eigen3;
use crate::mesh::{Adjacency, FacePoint, TriMesh};
use crate::observe::Observer;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A plane through `point` with unit normal `normal`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Plane {
    /// A point of the plane, world units.
    #[schemars(with = "[f64; 3]")]
    pub point: DVec3,
    /// Unit normal.
    #[schemars(with = "[f64; 3]")]
    pub normal: DVec3,
}

/// Sample points that a plane is judged by.
const SAMPLES: usize = 1500;
/// Rounds of matching per candidate, and for the best at the end.
const MATCH_ROUNDS: usize = 12;
const LAST_ROUNDS: usize = 40;
/// A plane is one of symmetry if mirrored points miss the surface by less than this in the mean, over the diagonal.
pub const SYMMETRIC: f64 = 0.01;

impl Plane {
    /// Mirror image of a position.
    pub fn mirror(&self, p: DVec3) -> DVec3 {
        p - self.normal * (2.0 * (p - self.point).dot(self.normal))
    }

    /// Distance to the plane, positive on the side that the normal points to.
    pub fn height(&self, p: DVec3) -> f64 {
        (p - self.point).dot(self.normal)
    }

    /// The place that a place is mirrored to: nearest to its mirror image.
    pub fn mirror_place(&self, mesh: &TriMesh, bvh: &Bvh, place: &FacePoint) -> FacePoint {
        bvh.closest(self.mirror(place.position(mesh))).place
    }

    /// A curve mirrored: with as many places, in the opposite order, so that what lay to its left lies there again.
    /// # Errors
    /// As [`SurfaceCurve::trace`].
    pub fn mirror_curve(
        &self,
        mesh: &TriMesh,
        adjacency: &Adjacency,
        bvh: &Bvh,
        curve: &SurfaceCurve,
    ) -> Result<SurfaceCurve, CurveError> {
        curve.check(mesh)?;
        let mut points: Vec<FacePoint> = curve.points.iter().map(|p| self.mirror_place(mesh, bvh, p)).collect();
        points.reverse();
        let mirrored = SurfaceCurve { points, closed: curve.closed };
        mirrored.trace(mesh, adjacency)?;
        Ok(mirrored)
    }
}

/// Mean distance of mirrored sample points from the surface, world units.
pub fn miss(mesh: &TriMesh, bvh: &Bvh, plane: &Plane) -> f64 {
    let samples = samples(mesh);
    let each: Vec<f64> = samples.par_iter().map(|&p| bvh.closest(plane.mirror(p)).distance).collect();
    each.iter().sum::<f64>() / each.len().max(1) as f64
}

/// The plane of symmetry of a mesh and its mean miss, world units.
/// # Errors
/// `NotSymmetric` if the best plane misses by more than [`SYMMETRIC`] of the diagonal; `Cancelled`.
pub fn find(mesh: &TriMesh, bvh: &Bvh, observer: &dyn Observer) -> Result<(Plane, f64), CurveError> {
    let samples = samples(mesh);
    let (center, axes) = principal_axes(mesh);
    let mut candidates: Vec<DVec3> = axes.to_vec();
    for x in -1..=1 {
        for y in -1..=1 {
            for z in -1..=1 {
                let d = DVec3::new(x as f64, y as f64, z as f64);
                // One of each pair of opposite directions.
                if (x, y, z) > (0, 0, 0) {
                    candidates.push(d.normalize());
                }
            }
        }
    }
    let mut best: Option<(f64, Plane)> = None;
    for (k, &normal) in candidates.iter().enumerate() {
        observer.check()?;
        observer.progress(k as f64 / candidates.len() as f64);
        let (plane, miss) = refine(bvh, &samples, Plane { point: center, normal }, MATCH_ROUNDS);
        if best.as_ref().is_none_or(|b| miss < b.0) {
            best = Some((miss, plane));
        }
    }
    let diagonal = mesh.bounds().diagonal();
    let Some((_, plane)) = best else { return Err(CurveError::NotSymmetric { miss: 1.0 }) };
    let (plane, found) = refine(bvh, &samples, plane, LAST_ROUNDS);
    observer.progress(1.0);
    if found > SYMMETRIC * diagonal {
        return Err(CurveError::NotSymmetric { miss: found / diagonal });
    }
    Ok((plane, found))
}

fn samples(mesh: &TriMesh) -> Vec<DVec3> {
    let step = (mesh.points.len() / SAMPLES).max(1);
    mesh.points.iter().step_by(step).copied().collect()
}

/// Matches and fits; returns the plane and its mean miss.
fn refine(bvh: &Bvh, samples: &[DVec3], plane: Plane, rounds: usize) -> (Plane, f64) {
    let judge = |plane: &Plane| -> (f64, Vec<(DVec3, DVec3)>) {
        let pairs: Vec<(DVec3, DVec3, f64)> = samples
            .par_iter()
            .map(|&p| {
                let hit = bvh.closest(plane.mirror(p));
                (p, hit.position, hit.distance)
            })
            .collect();
        let miss = pairs.iter().map(|p| p.2).sum::<f64>() / pairs.len().max(1) as f64;
        (miss, pairs.into_iter().map(|p| (p.0, p.1)).collect())
    };
    let (mut best, mut pairs) = judge(&plane);
    let mut plane = plane;
    for _ in 0..rounds {
        // The reflection that takes p to q best: over the normals n, the sum of (p - c) . n (q - c) . n is least,
        // with c the mean of all points.
        let n = pairs.len().max(1) as f64;
        let (cp, cq) = pairs.iter().fold((DVec3::ZERO, DVec3::ZERO), |(a, b), (p, q)| (a + *p, b + *q));
        let (cp, cq) = (cp / n, cq / n);
        let mut m = DMat3::ZERO;
        for (p, q) in &pairs {
            let (a, b) = (*p - cp, *q - cq);
            m += DMat3::from_cols(a * b.x + b * a.x, a * b.y + b * a.y, a * b.z + b * a.z);
        }
        let (_, vectors) = eigen3(m);
        let trial = Plane { point: (cp + cq) / 2.0, normal: vectors[0] };
        let (miss, matched) = judge(&trial);
        if miss >= best * (1.0 - 1e-9) {
            break;
        }
        (best, plane, pairs) = (miss, trial, matched);
    }
    (plane, best)
}

/// Centroid and principal axes of the surface.
fn principal_axes(mesh: &TriMesh) -> (DVec3, [DVec3; 3]) {
    let parts: Vec<(f64, DVec3)> =
        (0..mesh.triangles.len()).map(|t| (mesh.area(t), mesh.corners(t).into_iter().sum::<DVec3>() / 3.0)).collect();
    let area: f64 = parts.iter().map(|p| p.0).sum();
    let center = parts.iter().map(|p| p.1 * p.0).sum::<DVec3>() / area.max(f64::MIN_POSITIVE);
    let mut m = DMat3::ZERO;
    for (w, p) in &parts {
        let d = *p - center;
        m += DMat3::from_cols(d * d.x, d * d.y, d * d.z) * *w;
    }
    (center, eigen3(m).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::Silent;
    use crate::synthetic::shapes;

    #[test]
    fn the_one_plane_of_symmetry_of_a_lopsided_body_is_found_within_a_thousandth() {
        // Fatter to one end and bulging to one side: only y = 0 is left.
        let mut mesh = shapes::sphere(1.0, 4);
        for p in &mut mesh.points {
            *p = DVec3::new(1.8 * p.x, p.y * (1.0 + 0.35 * p.x), p.z * (1.0 - 0.2 * p.x) + 0.4 * p.x * p.x);
        }
        let turn = glam::DQuat::from_axis_angle(DVec3::new(0.3, 0.8, -0.4).normalize(), 0.9);
        let shift = DVec3::new(3.0, -1.0, 2.0);
        for p in &mut mesh.points {
            *p = turn * *p + shift;
        }
        let (plane, miss) = find(&mesh, &Bvh::new(&mesh), &Silent).unwrap();
        let normal = turn * DVec3::Y;
        assert!(plane.normal.cross(normal).length() < 1e-3, "{:?} {normal}", plane.normal);
        assert!(plane.height(shift).abs() < 1e-3 && miss < 1e-3, "{miss}");
    }

    #[test]
    fn a_body_without_symmetry_is_refused_with_its_miss() {
        let mut mesh = shapes::sphere(1.0, 3);
        for p in &mut mesh.points {
            let bulge = |c: DVec3, s: f64| s * (-4.0 * p.distance_squared(c)).exp();
            let b =
                bulge(DVec3::X, 1.5) + bulge(DVec3::new(0.0, 0.8, 0.6), 1.0) + bulge(DVec3::new(-0.3, 0.5, -0.8), 0.7);
            *p = *p * (1.0 + b) * DVec3::new(1.0, 1.3 + 0.3 * p.x, 0.7);
        }
        assert!(
            matches!(find(&mesh, &Bvh::new(&mesh), &Silent), Err(CurveError::NotSymmetric { miss }) if miss > SYMMETRIC)
        );
    }
}
