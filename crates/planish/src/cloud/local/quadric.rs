//! A quadric around a centre, as every local fit is one.
//!
//! [X03] Xie et al., *Piecewise C1 Continuous Surface Reconstruction of Noisy Point Clouds via Local Implicit
//! Quadric Regression*, 2003: curvature §8.1 eq. 5, 6; variation of the gradient §8.2 (the exact form of its footnote).
//! Distances are Taubin's first-order ones, |f| / |grad f|.

use crate::linalg::eigen3;
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// f(y) = a · (xx, xy, xz, yy, yz, zz, x, y, z, 1) at y = (p - center) / scale.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quadric {
    /// Origin of the local coordinates, world units.
    pub center: DVec3,
    /// Length of one local unit, world units.
    pub scale: f64,
    /// The ten coefficients.
    pub a: [f64; 10],
}

impl Quadric {
    /// A plane through `center`.
    pub fn plane(center: DVec3, scale: f64, normal: DVec3) -> Quadric {
        let n = normal;
        Quadric { center, scale, a: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, n.x, n.y, n.z, 0.0] }
    }

    /// Value and gradient, both in local units.
    #[inline]
    pub fn value(&self, p: DVec3) -> (f64, DVec3) {
        let a = &self.a;
        let y = (p - self.center) * (1.0 / self.scale);
        let h = DVec3::new(a[0] * y.x + a[1] * y.y + a[2] * y.z, a[3] * y.y + a[4] * y.z, a[5] * y.z);
        let g = DVec3::new(
            a[0] * y.x + h.x + a[6],
            a[1] * y.x + a[3] * y.y + h.y + a[7],
            a[2] * y.x + a[4] * y.y + a[5] * y.z + h.z + a[8],
        );
        (h.dot(y) + a[6] * y.x + a[7] * y.y + a[8] * y.z + a[9], g)
    }

    /// First-order signed distance (world units) and unit gradient; infinite where the gradient vanishes.
    #[inline]
    pub fn distance(&self, p: DVec3) -> (f64, DVec3) {
        let (f, g) = self.value(p);
        let length = g.length();
        if length > 0.0 { (self.scale * f / length, g / length) } else { (f64::INFINITY, DVec3::Z) }
    }

    /// The place on the quadric near `p` and the unit gradient there, by Newton steps along the gradient.
    pub fn project(&self, p: DVec3) -> (DVec3, DVec3) {
        let mut foot = p;
        let mut normal = DVec3::Z;
        // Steps shrink quadratically; a step above the support means that there is no surface near.
        for _ in 0..8 {
            let (d, n) = self.distance(foot);
            normal = n;
            let is_near = d.abs() < self.scale;
            if !is_near {
                break;
            }
            foot -= d * n;
            if d.abs() < 1e-13 * self.scale {
                break;
            }
        }
        (foot, normal)
    }

    /// The Hessian in local units; it is the same everywhere.
    pub fn hessian(&self) -> [[f64; 3]; 3] {
        let a = &self.a;
        [[2.0 * a[0], a[1], a[2]], [a[1], 2.0 * a[3], a[4]], [a[2], a[4], 2.0 * a[5]]]
    }

    /// Gaussian and mean curvature at `p` (1 / world units squared, 1 / world units). The mean curvature of a sphere
    /// whose gradient points outward is positive.
    /// Source: [X03] eq. 5, 6, with the sign of the mean curvature turned.
    pub fn curvature(&self, p: DVec3) -> (f64, f64) {
        let m = self.hessian();
        let (_, g) = self.value(p);
        let g = g.to_array();
        let square: f64 = g.iter().map(|x| x * x).sum();
        if square == 0.0 {
            return (0.0, 0.0);
        }
        let cofactor = |i: usize, j: usize| {
            let [r, s] = [(i + 1) % 3, (i + 2) % 3];
            let [t, u] = [(j + 1) % 3, (j + 2) % 3];
            m[r][t] * m[s][u] - m[r][u] * m[s][t]
        };
        let trace = m[0][0] + m[1][1] + m[2][2];
        let (mut gauss, mut mean) = (0.0, 0.0);
        for i in 0..3 {
            for j in 0..3 {
                gauss += g[i] * cofactor(i, j) * g[j];
                mean += g[i] * (m[i][j] - if i == j { trace } else { 0.0 }) * g[j];
            }
        }
        let s = self.scale;
        (gauss / (square * square) / (s * s), -mean / (2.0 * square * square.sqrt()) / s)
    }

    /// Variation of the gradient over a ball of `radius` around `p`, against the gradient there.
    /// Source: [X03] eq. 10 with the largest eigenvalue of its footnote.
    pub fn variation(&self, p: DVec3, radius: f64) -> f64 {
        let (values, _) = eigen3(DMat3::from_cols_array_2d(&self.hessian()));
        let (_, g) = self.value(p);
        let s = values[0].abs().max(values[2].abs());
        if s == 0.0 { 0.0 } else { radius / self.scale * s / g.length() }
    }

    /// The surface that noise has blurred into this one, as seen from `at`.
    ///
    /// * `noise` - standard deviation of the points in every direction, world units
    ///
    /// A fit to noisy points follows the mean of the surface over the noise along it: it lies inside of what bulges, a sphere
    /// of radius r by noise^2 / r. The second derivatives tell by how much.
    pub fn sharpened(mut self, at: DVec3, noise: f64) -> Quadric {
        let m = self.hessian();
        let n = self.value(at).1.normalize_or_zero().to_array();
        let trace: f64 = (0..3).map(|i| m[i][i]).sum();
        let along: f64 = (0..9).map(|k| n[k / 3] * m[k / 3][k % 3] * n[k % 3]).sum();
        // The noise along the surface takes away what the noise across it adds.
        self.a[9] -= 0.5 * (noise / self.scale).powi(2) * (trace - 2.0 * along);
        self
    }

    /// The same surface with the other side outside.
    pub fn flipped(mut self) -> Quadric {
        self.a = self.a.map(|x| -x);
        self
    }

    /// The same surface with a gradient of length one at `p`.
    pub fn normalized_at(mut self, p: DVec3) -> Quadric {
        let length = self.value(p).1.length();
        if length > 0.0 {
            self.a = self.a.map(|x| x / length);
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curvatures_of_a_sphere_and_a_cylinder_are_exact_to_1e_14() {
        let c = DVec3::new(1.0, 2.0, 3.0);
        let sphere = Quadric { center: c, scale: 1.0, a: [1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, -4.0] };
        let (k, h) = sphere.curvature(c + DVec3::new(0.0, 2.0, 0.0));
        assert!((k - 0.25).abs() < 1e-14 && (h - 0.5).abs() < 1e-14, "{k} {h}");
        // The same sphere in local units of 2.
        let sphere = Quadric { center: c, scale: 2.0, a: [1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0] };
        let (k, h) = sphere.curvature(c + DVec3::new(0.0, 2.0, 0.0));
        assert!((k - 0.25).abs() < 1e-14 && (h - 0.5).abs() < 1e-14, "{k} {h}");
        let pipe = Quadric { center: c, scale: 1.0, a: [1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -4.0] };
        let (k, h) = pipe.curvature(c + DVec3::new(2.0, 0.0, 7.0));
        assert!(k.abs() < 1e-14 && (h - 0.25).abs() < 1e-14, "{k} {h}");
        assert!((pipe.variation(c + DVec3::new(2.0, 0.0, 0.0), 0.5) - 0.25).abs() < 1e-14);
    }

    #[test]
    fn a_blurred_paraboloid_and_a_blurred_sphere_come_back_within_a_thousandth_of_the_noise() {
        // Height fields: the mean of -(x^2 + y^2) / 2 r over the noise lies noise^2 / r below it.
        let (r, noise) = (3.0, 0.1);
        let c = 0.5 / r;
        let bowl =
            |drop: f64| Quadric { center: DVec3::ZERO, scale: 1.0, a: [c, 0.0, 0.0, c, 0.0, 0.0, 0.0, 0.0, 1.0, drop] };
        let back = bowl(noise * noise / r).sharpened(DVec3::ZERO, noise);
        assert!((back.a[9] - bowl(0.0).a[9]).abs() < 1e-15, "{}", back.a[9]);
        // Of a sphere the values themselves have the mean of the squared noise across, too: half of the drop.
        let ball = |size: f64| Quadric {
            center: DVec3::ZERO,
            scale: 2.0,
            a: [4.0, 0.0, 0.0, 4.0, 0.0, 4.0, 0.0, 0.0, 0.0, -size * size],
        };
        let seen = (r * r - noise * noise).sqrt();
        let (foot, _) = ball(seen).sharpened(DVec3::Z * r, noise).project(DVec3::Z * r);
        assert!((foot.z - r).abs() < 1e-3 * noise, "{}", foot.z - r);
    }

    #[test]
    fn value_and_gradient_agree_with_differences_to_1e_8() {
        let q = Quadric {
            center: DVec3::new(0.3, -0.2, 0.1),
            scale: 0.7,
            a: [0.3, -0.5, 0.2, 0.9, 0.4, -0.6, 0.1, 0.7, -0.3, 0.05],
        };
        let p = DVec3::new(0.5, 0.4, -0.2);
        let (_, g) = q.value(p);
        for k in 0..3 {
            let mut step = DVec3::ZERO;
            step[k] = 1e-5;
            let slope = (q.value(p + step).0 - q.value(p - step).0) / 2e-5 * q.scale;
            assert!((slope - g[k]).abs() < 1e-8, "{slope} {}", g[k]);
        }
        let (foot, _) = q.project(p);
        assert!(q.distance(foot).0.abs() < 1e-12);
    }
}
