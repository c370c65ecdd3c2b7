//! Points spread evenly over a known surface, with noise in all directions: a scan without the faults of a scanner.

use crate::cloud::Cloud;
use crate::geom::random;
use crate::mesh::TriMesh;
use glam::DVec3;

/// Random numbers per point.
const DRAWS: u64 = 9;

/// Bare points evenly by area, each moved by normal noise.
/// * `noise` - standard deviation along each axis, world units
pub fn even_scan(truth: &TriMesh, points: usize, noise: f64, seed: u64) -> Cloud {
    let sums = truth.area_sums();
    let total = sums.last().copied().unwrap_or(0.0);
    let point = |i: u64| {
        let [pick, q, s, r @ ..]: [f64; DRAWS as usize] =
            std::array::from_fn(|k| random::unit(seed, DRAWS * i + k as u64));
        let [a, b, c] = truth.corners(sums.partition_point(|&sum| sum <= pick * total).min(sums.len() - 1));
        let q = q.sqrt();
        let off = DVec3::from_array([0, 1, 2].map(|k| random::normal(r[2 * k], r[2 * k + 1])));
        a * (1.0 - q) + b * (q * (1.0 - s)) + c * (q * s) + noise * off
    };
    if truth.triangles.is_empty() { Cloud::default() } else { Cloud::new((0..points as u64).map(point).collect()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::shapes;

    #[test]
    fn points_of_a_ball_have_noise_of_one_hundredth_across_it_within_3_percent() {
        let cloud = even_scan(&shapes::sphere(1.0, 6), 20_000, 0.01, 1);
        // The mean of the distances is the radius of the facets; across the ball lies one of three axes.
        let mean = cloud.points.iter().map(|p| p.length()).sum::<f64>() / 20_000.0;
        let variance = cloud.points.iter().map(|p| (p.length() - mean).powi(2)).sum::<f64>() / 20_000.0;
        assert!((variance.sqrt() / 0.01 - 1.0).abs() < 0.03, "{}", variance.sqrt());
        let middle = cloud.points.iter().sum::<DVec3>() / 20_000.0;
        assert!(middle.length() < 0.02, "{middle}");
    }
}
