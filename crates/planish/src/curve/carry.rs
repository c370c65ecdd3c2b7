//! Curves of one shape carried to another of its class, by landmarks.
//!
//! A map of space that takes landmarks to landmarks and bends least between them (triharmonic kernel `r^3` in space,
//! Duchon 1977, with an affine part) brings the curves near; places slide to the surface from the nearest one and a
//! snake evens them.

use super::snake::{Snake, SnakeParams};
use super::{CurveError, SurfaceCurve, slide_to};
use crate::geom::Bvh;
use crate::linalg::solve_dense;
use crate::mesh::{Adjacency, FacePoint, TriMesh};
use crate::observe::Observer;
use glam::DVec3;

/// A map of space by landmarks.
#[derive(Clone, Debug)]
pub struct LandmarkMap {
    from: Vec<DVec3>,
    /// Weights of the kernels, then of 1, x, y and z.
    weights: Vec<DVec3>,
    center: DVec3,
    scale: f64,
}

impl LandmarkMap {
    /// The map that takes `from[k]` to `to[k]`, world units of either shape.
    /// # Errors
    /// `Landmarks` for fewer than four, coinciding or coplanar ones.
    pub fn new(from: &[DVec3], to: &[DVec3]) -> Result<LandmarkMap, CurveError> {
        let count = from.len();
        let wrong = |why| CurveError::Landmarks { count, why };
        if count != to.len() {
            return Err(wrong("the two shapes have different numbers of them"));
        }
        if count < 4 {
            return Err(wrong("they are too few"));
        }
        let center = from.iter().sum::<DVec3>() / count as f64;
        let scale = from.iter().map(|p| p.distance(center)).fold(0.0, f64::max);
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(wrong("they coincide"));
        }
        let from: Vec<DVec3> = from.iter().map(|p| (*p - center) / scale).collect();
        let n = count + 4;
        let mut matrix = vec![0.0; n * n];
        let mut rhs = vec![0.0; 3 * n];
        for i in 0..count {
            for j in 0..count {
                matrix[i * n + j] = from[i].distance(from[j]).powi(3);
            }
            for (k, x) in [1.0, from[i].x, from[i].y, from[i].z].into_iter().enumerate() {
                matrix[i * n + count + k] = x;
                matrix[(count + k) * n + i] = x;
            }
            rhs[3 * i..3 * i + 3].copy_from_slice(&to[i].to_array());
        }
        if !solve_dense(&mut matrix, &mut rhs, n, 3) {
            return Err(wrong("two coincide or all lie in a plane"));
        }
        Ok(LandmarkMap { from, weights: rhs.chunks_exact(3).map(DVec3::from_slice).collect(), center, scale })
    }

    /// Where a position goes.
    pub fn apply(&self, p: DVec3) -> DVec3 {
        let q = (p - self.center) / self.scale;
        let n = self.from.len();
        let bend: DVec3 = (0..n).map(|k| self.weights[k] * q.distance(self.from[k]).powi(3)).sum();
        let w = &self.weights[n..];
        bend + w[0] + w[1] * q.x + w[2] * q.y + w[3] * q.z
    }
}

/// Carries a place of one mesh to another.
pub fn carry_place(map: &LandmarkMap, from: &TriMesh, to: &Bvh, place: &FacePoint) -> FacePoint {
    to.closest(map.apply(place.position(from))).place
}

/// Carries a curve of one mesh to another with as many places; `ends` of an open one go where they are told, else
/// where the map takes them.
/// # Errors
/// As [`SurfaceCurve::resampled`]; `Cancelled`.
pub fn carry_curve(
    map: &LandmarkMap,
    from: &TriMesh,
    to: (&TriMesh, &Adjacency, &Bvh),
    curve: &SurfaceCurve,
    ends: Option<[FacePoint; 2]>,
    observer: &dyn Observer,
) -> Result<SurfaceCurve, CurveError> {
    curve.check(from)?;
    let (mesh, adjacency, bvh) = to;
    let mut points: Vec<FacePoint> = Vec::with_capacity(curve.points.len());
    for place in &curve.points {
        let target = map.apply(place.position(from));
        let nearest = bvh.closest(target);
        let fresh = nearest.place;
        // The place before slides along, which keeps to the sheet that the curve is on; only if that leaves it
        // behind is the nearest place taken.
        let place = points.last().map(|&last| slide_to(mesh, adjacency, last, target));
        let near = nearest.position.distance(target);
        points.push(match place {
            Some(p) if p.position(mesh).distance(target) <= SAME_SHEET * near => p,
            _ => fresh,
        });
    }
    if let Some([a, b]) = ends
        && !curve.closed
    {
        let last = points.len() - 1;
        (points[0], points[last]) = (a, b);
    }
    let carried = SurfaceCurve { points, closed: curve.closed };
    let even = carried.resampled(mesh, adjacency, curve.points.len().max(3))?;
    let mut snake = Snake::new(mesh, adjacency, &even)?;
    let params = SnakeParams { fairness: 0.0, curvature: 1.0, sweeps: SMOOTHING_SWEEPS, ..SnakeParams::default() };
    for _ in 0..SMOOTHING_SWEEPS {
        snake.step(&params, super::Sweep::Single);
        observer.check()?;
    }
    Ok(snake.curve())
}

/// A place that slid along counts if it is at most this much further from its target than the nearest one.
const SAME_SHEET: f64 = 1.5;
/// Sweeps of a stiff wire that take out the jitter of the nearest places and leave the course.
const SMOOTHING_SWEEPS: usize = 12;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_landmarks_go_where_they_are_told_and_an_affine_map_is_kept_within_1e_10() {
        let from: Vec<DVec3> =
            (0..7).map(|k| DVec3::new((k * k % 5) as f64, (k * 3 % 7) as f64 / 2.0, (k % 3) as f64 - 0.4)).collect();
        let affine = |p: DVec3| DVec3::new(2.0 * p.x + p.z, p.y - 0.3 * p.x + 4.0, 1.5 * p.z + 0.2 * p.y);
        let to: Vec<DVec3> = from.iter().map(|&p| affine(p)).collect();
        let map = LandmarkMap::new(&from, &to).unwrap();
        let p = DVec3::new(1.7, 0.4, 0.9);
        assert!(map.apply(p).distance(affine(p)) < 1e-10);
        let bent: Vec<DVec3> = to.iter().enumerate().map(|(k, p)| *p + DVec3::Z * (k % 2) as f64).collect();
        let map = LandmarkMap::new(&from, &bent).unwrap();
        assert!(from.iter().zip(&bent).all(|(p, q)| map.apply(*p).distance(*q) < 1e-10));
        assert!(LandmarkMap::new(&from[..3], &to[..3]).is_err());
        let flat: Vec<DVec3> = from.iter().map(|p| p.with_z(0.0)).collect();
        assert!(LandmarkMap::new(&flat, &to).is_err());
    }
}
