//! Parts of a wavelength on the whole surface: filters over all patches at once, by the Laplacian of their mesh.
//!
//! Taubin 1995, *A Signal Processing Approach to Fair Surface Design*, for filters as functions of the Laplacian. Instead
//! of polynomials of the Laplacian itself, whose degree grows with the fineness of the mesh, polynomials of the smoother
//! `A = (M + t L)^-1 M`: its eigenvalues `s = 1 / (1 + t w^2)` lie in `(0, 1]` whatever the mesh, and at the cut-off
//! `w = 2 pi / wavelength` is `s = 1/2` for `t = 1 / w^2`. A step at 1/2 as a sum of Chebyshev polynomials cuts there.

use super::super::laplacian::{Bond, elements, give_least_mass, smoother};
use super::super::{PatchedMesh, ReliefError, surface_patches};
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
/// Longest standard deviation and cut-off in diagonals of the surface: the waves that fit on it are left to 1e-4 by one step of
/// that smoother. Beyond, the masses would be lost in the rounding of the stiffnesses.
const REACH: f64 = 30.0;

/// The mesh of all patches with its masses and stiffnesses.
pub struct Filter {
    /// The patches as one mesh.
    pub base: PatchedMesh,
    mass: Vec<f64>,
    bonds: Vec<Bond>,
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
        let mut bonds = Vec::new();
        for element in elements(&base) {
            element.vertices.iter().for_each(|&v| mass[v as usize] += element.mass);
            bonds.extend(element.bonds());
        }
        give_least_mass(&mut mass);
        Ok(Filter { base, mass, bonds })
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
        let rows: Vec<u32> = (0..self.mass.len() as u32).collect();
        smoother(&self.mass, &self.bonds, &rows, time, observer)
    }

    fn smooth(&self, smoother: &SparseCholesky, columns: &mut [f64]) {
        columns.iter_mut().zip(self.mass.iter().cycle()).for_each(|(y, m)| *y *= m);
        smoother.solve(columns);
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
