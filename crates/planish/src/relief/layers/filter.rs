//! Parts of a wavelength on the whole surface: filters over all patches at once, by the Laplacian of their mesh.
//!
//! Taubin 1995, *A Signal Processing Approach to Fair Surface Design*, for filters as functions of the Laplacian. Instead
//! of polynomials of the Laplacian itself, whose degree grows with the fineness of the mesh, polynomials of the smoother
//! `A = (M + t L)^-1 M`: its eigenvalues `s = 1 / (1 + t w^2)` lie in `(0, 1]` whatever the mesh, and at the cut-off
//! `w = 2 pi / wavelength` is `s = 1/2` for `t = 1 / w^2`. A step at 1/2 as a sum of Chebyshev polynomials cuts there.

use super::super::{PatchNodes, PatchedMesh, ReliefError, surface_patches};
use crate::linalg::SparseCholesky;
use crate::network::Network;
use crate::observe::{Cancelled, Observer};
use crate::surface::Surface;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Half width of the step in `s`: a wave of twice the cut-off passes to 5e-5, one of half of it is left to 5e-5.
const WIDTH: f64 = 0.03;
/// Terms of the sum: beyond, a step of that width has nothing left above 1e-7.
const TERMS: usize = 80;
/// Least thickness of a triangle against its length, for its cotangents.
const THINNEST: f64 = 1e-3;
/// Longest standard deviation and cut-off in diagonals of the surface: the waves that fit on it are left to 1e-4 by one step of
/// that smoother. Beyond, the masses would be lost in the rounding of the stiffnesses.
const REACH: f64 = 30.0;
/// Least mass of a vertex against the mean: vertices of collapsed cells have none of their own.
const LEAST_MASS: f64 = 1e-9;

/// The mesh of all patches with its masses and stiffnesses.
pub struct Filter {
    /// The patches as one mesh.
    pub(super) base: PatchedMesh,
    mass: Vec<f64>,
    /// Lower triangle of the cotangent matrix.
    stiff: Vec<(usize, usize, f64)>,
}

impl Filter {
    /// * `shapes` - nodes of each patch along `v` and along `u`
    /// # Errors
    /// As [`surface_patches`].
    pub fn new(
        network: &Network,
        surfaces: &[Surface],
        shapes: &[[usize; 2]],
        observer: &dyn Observer,
    ) -> Result<Filter, ReliefError> {
        let base = surface_patches(network, surfaces, shapes, observer)?;
        let mut mass = vec![0.0; base.mesh.points.len()];
        let mut stiff = Vec::new();
        for patch in &base.patches {
            let cols = patch.cols;
            for cell in (0..patch.rows - 1).flat_map(|j| (0..cols - 1).map(move |i| j * cols + i)) {
                let [a, b, c, d] = [cell, cell + 1, cell + cols + 1, cell + cols].map(|n| patch.vertices[n]);
                // Both diagonals by halves: with one of them masses would depend on which.
                for triangle in [[a, b, c], [a, c, d], [a, b, d], [b, c, d]] {
                    add_half(&base.mesh.points, triangle, &mut mass, &mut stiff);
                }
            }
        }
        let mean = mass.iter().sum::<f64>() / mass.len().max(1) as f64;
        mass.iter_mut().for_each(|m| *m = m.max(LEAST_MASS * mean));
        Ok(Filter { base, mass, stiff })
    }

    /// For each patch and node its number among `values` of [`Filter::gather`].
    fn patches(&self) -> &[PatchNodes] {
        &self.base.patches
    }

    /// Vectors of the nodes of all patches as vectors of the places; of several nodes at a place the first counts.
    pub fn gather(&self, nodes: &[Vec<DVec3>]) -> Vec<DVec3> {
        let mut values = vec![DVec3::NAN; self.mass.len()];
        for (patch, vectors) in self.patches().iter().zip(nodes) {
            for (&v, &d) in patch.vertices.iter().zip(vectors) {
                let value = &mut values[v as usize];
                if value.is_nan() {
                    *value = d;
                }
            }
        }
        values
    }

    /// Vectors of the places as vectors of the nodes of all patches.
    pub fn scatter(&self, values: &[DVec3]) -> Vec<Vec<DVec3>> {
        self.patches().iter().map(|p| p.vertices.iter().map(|&v| values[v as usize]).collect()).collect()
    }

    /// Root mean square over the surface.
    pub fn rms(&self, values: &[DVec3]) -> f64 {
        let sum: f64 = values.iter().zip(&self.mass).map(|(d, m)| d.length_squared() * m).sum();
        (sum / self.mass.iter().sum::<f64>()).sqrt()
    }

    /// What is longer than `wavelength` of `values`.
    /// # Errors
    /// [`Cancelled`].
    pub fn low_pass(
        &self,
        values: &[DVec3],
        wavelength: f64,
        observer: &dyn Observer,
    ) -> Result<Vec<DVec3>, Cancelled> {
        let smoother = self.smoother((wavelength / TAU).powi(2), observer)?;
        let terms = step_terms();
        // p(1) = 1: what is even everywhere stays to the digit.
        let total: f64 = terms.iter().sum();
        let shifted = |y: &[f64]| {
            let mut a = y.to_vec();
            self.smooth(&smoother, &mut a);
            a.iter_mut().zip(y).for_each(|(a, y)| *a = 2.0 * *a - y);
            a
        };
        let mut before = columns(values);
        let mut now = shifted(&before);
        let mut sum: Vec<f64> = before.iter().zip(&now).map(|(b, n)| b * terms[0] + n * terms[1]).collect();
        for (k, term) in terms.iter().enumerate().skip(2) {
            observer.check()?;
            observer.progress(k as f64 / TERMS as f64);
            let mut next = shifted(&now);
            next.iter_mut().zip(&before).for_each(|(n, b)| *n = 2.0 * *n - b);
            sum.iter_mut().zip(&next).for_each(|(s, n)| *s += n * term);
            (before, now) = (now, next);
        }
        sum.iter_mut().for_each(|s| *s /= total);
        Ok(vectors(&sum))
    }

    /// `values` blurred with a standard deviation: two steps of the smoother, which fall off alike for long waves.
    /// # Errors
    /// [`Cancelled`].
    pub fn blur(&self, values: &[DVec3], deviation: f64, observer: &dyn Observer) -> Result<Vec<DVec3>, Cancelled> {
        let smoother = self.smoother(deviation * deviation / 4.0, observer)?;
        let mut y = columns(values);
        self.smooth(&smoother, &mut y);
        self.smooth(&smoother, &mut y);
        Ok(vectors(&y))
    }

    fn smoother(&self, time: f64, observer: &dyn Observer) -> Result<SparseCholesky, Cancelled> {
        let time = time.min((REACH * self.base.mesh.bounds().diagonal()).powi(2));
        let masses = self.mass.iter().enumerate().map(|(i, &m)| (i, i, m));
        let lower = masses.chain(self.stiff.iter().map(|&(i, j, w)| (i, j, w * time))).collect();
        let cancelled = || observer.cancelled();
        let factor = SparseCholesky::factor_watched(self.mass.len(), lower, &cancelled).ok_or(Cancelled)?;
        // Masses above 0 and a matrix that is never negative: it is positive.
        Ok(factor.expect("a mass matrix with a Laplacian is positive definite"))
    }

    fn smooth(&self, smoother: &SparseCholesky, columns: &mut [f64]) {
        columns.iter_mut().zip(self.mass.iter().cycle()).for_each(|(y, m)| *y *= m);
        smoother.solve(columns);
    }
}

/// Adds half a triangle to masses and cotangent matrix.
fn add_half(points: &[DVec3], triangle: [u32; 3], mass: &mut [f64], stiff: &mut Vec<(usize, usize, f64)>) {
    let [a, b, c] = triangle.map(|v| points[v as usize]);
    let double = (b - a).cross(c - a).length();
    triangle.iter().for_each(|&v| mass[v as usize] += double / 12.0);
    // Slivers would have cotangents without end: here they are at least a thousandth as thick as they are long.
    let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    let area = double.max(THINNEST * longest);
    if area == 0.0 {
        return;
    }
    for (k, (p, q, r)) in [(a, b, c), (b, c, a), (c, a, b)].into_iter().enumerate() {
        let weight = (q - p).dot(r - p) / area / 4.0;
        let (i, j) = (triangle[(k + 1) % 3] as usize, triangle[(k + 2) % 3] as usize);
        if i != j {
            stiff.extend([(i, i, weight), (j, j, weight), (i.max(j), i.min(j), -weight)]);
        }
    }
}

/// Coordinates one after the other.
fn columns(values: &[DVec3]) -> Vec<f64> {
    (0..3).flat_map(|k| values.iter().map(move |v| v[k])).collect()
}

fn vectors(columns: &[f64]) -> Vec<DVec3> {
    let n = columns.len() / 3;
    (0..n).map(|i| DVec3::new(columns[i], columns[n + i], columns[2 * n + i])).collect()
}

/// Chebyshev coefficients of a smooth step at 1/2 over `[0, 1]`.
fn step_terms() -> [f64; TERMS] {
    /// Places at which the step is taken; enough for products with the highest term.
    const PLACES: usize = 4 * TERMS;
    let mut terms = [0.0; TERMS];
    for place in 0..PLACES {
        let angle = PI * (place as f64 + 0.5) / PLACES as f64;
        let s = (angle.cos() + 1.0) / 2.0;
        let step = 1.0 / (1.0 + ((0.5 - s) / WIDTH).exp());
        for (k, term) in terms.iter_mut().enumerate() {
            let weight = if k == 0 { 1.0 } else { 2.0 };
            *term += weight / PLACES as f64 * step * (k as f64 * angle).cos();
        }
    }
    terms
}
