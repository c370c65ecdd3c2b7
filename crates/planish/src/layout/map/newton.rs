//! Second derivatives of the barrier energy, and steps by them.
//!
//! Around a cone triangles are often a hundred times smaller than elsewhere. They are stiff, and weigh nothing in the
//! Laplacian: a step that is smooth by the Laplacian alone turns them over. Second derivatives know how stiff each is.
//! They are made positive face by face from their eigenvalues in closed form (Smith, de Goes, Kim, *Analytic Eigensystems for
//! Isotropic Distortion Energies*, 2019, section 4).

use super::energy::{AREA_WEIGHT, HOLD, Maps};
use crate::linalg::{SparseCholesky, SparsePattern};
use crate::observe::{Cancelled, Observer};
use glam::{DMat2, DVec2};
use rayon::prelude::*;
use std::sync::Arc;

/// What a system and its factors cost, in energies of all faces: 20 ms against .7 on a map of 6 100 unknowns, where it was
/// measured.
const COST: usize = 30;

/// The systems of a map without the barrier on its traces.
pub(super) struct Newton<'a> {
    maps: &'a Maps<'a>,
    pattern: Arc<SparsePattern>,
}

/// Second derivatives at one map.
pub(super) struct Hessian<'a> {
    maps: &'a Maps<'a>,
    /// Of each face by u and v of its corners.
    faces: Vec<[[f64; 6]; 6]>,
    factor: SparseCholesky,
}

impl<'a> Newton<'a> {
    /// Their entries are up to twice those of the Laplacian. `None` if they cannot be factored.
    /// # Errors
    /// `Cancelled`.
    pub fn new(maps: &'a Maps<'a>, observer: &dyn Observer) -> Result<Option<Newton<'a>>, Cancelled> {
        let mut places = Vec::new();
        for f in 0..maps.faces() {
            each_entry(maps, f, |_, _, (a, b), _| places.push((a as usize, b as usize)));
        }
        let pattern = SparsePattern::watched(maps.seams.free(), places, &|| observer.cancelled()).ok_or(Cancelled)?;
        Ok(pattern.ok().map(|pattern| Newton { maps, pattern: Arc::new(pattern) }))
    }

    /// The second derivatives at the corners `x` of an injective map; `None` if they have no inverse.
    /// # Errors
    /// `Cancelled`.
    pub fn at(&self, x: &[f64], observer: &dyn Observer) -> Result<Option<Hessian<'a>>, Cancelled> {
        let maps = self.maps;
        maps.count_effort(COST);
        let faces: Vec<[[f64; 6]; 6]> =
            (0..maps.faces()).into_par_iter().with_min_len(256).map(|f| face_hessian(maps, f, x)).collect();
        let mut values = Vec::new();
        for (f, face) in faces.iter().enumerate() {
            each_entry(maps, f, |p, q, _, c| values.push(c * face[p][q]));
        }
        let factor = self.pattern.factor_watched(values, &|| observer.cancelled()).ok_or(Cancelled)?;
        Ok(factor.ok().map(|factor| Hessian { maps, faces, factor }))
    }
}

impl Hessian<'_> {
    /// The step of the free unknowns against a gradient.
    pub fn step(&self, gradient: &[f64]) -> Vec<f64> {
        let mut step: Vec<f64> = gradient.iter().map(|g| -g).collect();
        self.factor.solve(&mut step);
        step
    }

    /// How the free unknowns follow where the coordinates of what is held move by `moved`, so that the energy stays least.
    pub fn following(&self, moved: &[f64]) -> Vec<f64> {
        let mut gradient = vec![0.0; moved.len()];
        for (face, places) in self.faces.iter().zip(&self.maps.seams.place) {
            let at = |p: usize| 2 * places[p / 2] as usize + p % 2;
            for p in 0..6 {
                gradient[at(p)] += (0..6).map(|q| face[p][q] * moved[at(q)]).sum::<f64>();
            }
        }
        self.step(&self.maps.seams.pull_back(&gradient))
    }
}

/// Second derivatives of the barrier energy of face `f` without softness, by u and v of its corners, without eigenvalues below
/// zero.
fn face_hessian(maps: &Maps, f: usize, x: &[f64]) -> [[f64; 6]; 6] {
    let by = by_jacobian(&maps.jacobian(f, x));
    let part = |p: usize, column: usize| maps.gradient[f][p / 2][column];
    let mut found = [[0.0; 6]; 6];
    for (p, row) in found.iter_mut().enumerate() {
        for (q, value) in row.iter_mut().enumerate() {
            for (m, n) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                *value += maps.share[f] * part(p, m) * part(q, n) * by[2 * m + p % 2][2 * n + q % 2];
            }
        }
    }
    found
}

/// The free unknowns of u and v of each corner of a face.
fn rows<'a>(maps: &'a Maps, f: usize) -> [&'a [(u32, f64)]; 6] {
    let place = maps.seams.place[f];
    [0, 1, 2, 3, 4, 5].map(|p| maps.seams.row(2 * place[p / 2] + p as u32 % 2).0)
}

/// Calls `entry` for each pair of coordinates of a face and of free unknowns that these hang on, below the diagonal, with the
/// product of their coefficients.
fn each_entry(maps: &Maps, f: usize, mut entry: impl FnMut(usize, usize, (u32, u32), f64)) {
    let rows = rows(maps, f);
    for (p, row) in rows.iter().enumerate() {
        for (q, other) in rows.iter().enumerate() {
            for &(a, c) in *row {
                other.iter().filter(|t| t.0 <= a).for_each(|&(b, d)| entry(p, q, (a, b), c * d));
            }
        }
    }
}

/// Second derivatives of the energy of a face by its Jacobian (columns one after the other), without softness and without the
/// barrier on its trace, with eigenvalues below zero set to zero.
fn by_jacobian(j: &DMat2) -> [[f64; 4]; 4] {
    let [a, b, c, d] = j.to_cols_array();
    // J = U S V^T with turns U and V.
    let sum = DVec2::new(a + d, b - c);
    let difference = DVec2::new(a - d, b + c);
    let [s, t] = [(sum.length() + difference.length()) / 2.0, (sum.length() - difference.length()) / 2.0];
    let (turn, lean) = (sum.y.atan2(sum.x), difference.y.atan2(difference.x));
    let u = DMat2::from_angle((turn + lean) / 2.0);
    let v = DMat2::from_angle((lean - turn) / 2.0);
    let p = s * t;
    let squares = s * s + t * t;
    // By the singular values.
    let own = |s: f64, t: f64| t / s.powi(3) + AREA_WEIGHT / (s.powi(3) * t);
    let mixed = -(1.0 / (s * s) + 1.0 / (t * t)) / 2.0 + AREA_WEIGHT / 2.0 * (1.0 + 1.0 / (p * p));
    let (first, second) = (own(s, t), own(t, s));
    // By shear and by turning.
    let shear = 1.0 / p + squares / (2.0 * p * p) + AREA_WEIGHT / 2.0 * (1.0 / (p * p) - 1.0);
    let turned = 1.0 / p - squares / (2.0 * p * p) + AREA_WEIGHT / 2.0 * (1.0 - 1.0 / (p * p));
    // Eigenvectors of the pair of singular values.
    let angle = (2.0 * mixed).atan2(first - second) / 2.0;
    let (sin, cos) = angle.sin_cos();
    let middle = (first + second) / 2.0;
    let spread = ((first - second) / 2.0).hypot(mixed);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let modes = [
        (middle + spread, [cos, 0.0, 0.0, sin]),
        (middle - spread, [-sin, 0.0, 0.0, cos]),
        (shear, [0.0, half, half, 0.0]),
        (turned, [0.0, half, -half, 0.0]),
    ];
    let mut sum = [[0.0; 4]; 4];
    for (value, mode) in modes.into_iter().filter(|m| m.0 > 0.0) {
        let mode = (u * DMat2::from_cols_array(&mode) * v.transpose()).to_cols_array();
        for i in 0..4 {
            for k in 0..4 {
                sum[i][k] += value * mode[i] * mode[k];
            }
        }
    }
    for (i, row) in sum.iter_mut().enumerate() {
        row[i] += 2.0 * HOLD;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::energy;
    use super::*;

    #[test]
    fn second_derivatives_are_the_differences_of_gradients_within_1e_6_where_the_energy_is_convex() {
        for j in [
            DMat2::from_cols_array(&[1.3, 0.1, -0.2, 1.2]),
            DMat2::from_cols_array(&[1.5, 0.05, 0.1, 1.6]),
            DMat2::from_angle(0.4) * DMat2::from_cols_array(&[1.4, 0.0, 0.3, 1.2]),
        ] {
            let found = by_jacobian(&j);
            let step = 1e-5;
            for k in 0..4 {
                let moved = |by: f64| {
                    let mut c = j.to_cols_array();
                    c[k] += by;
                    energy::barrier_of(&DMat2::from_cols_array(&c), 0.0, false).expect("finite").1.to_cols_array()
                };
                let (ahead, behind) = (moved(step), moved(-step));
                for i in 0..4 {
                    let want = (ahead[i] - behind[i]) / (2.0 * step);
                    assert!((found[i][k] - want).abs() < 1e-6 * (1.0 + want.abs()), "{i} {k}: {} {want}", found[i][k]);
                }
            }
        }
    }

    #[test]
    fn second_derivatives_of_any_face_are_positive() {
        for j in [[5.0, 1.0, -3.0, 0.2], [0.01, 0.0, 0.3, 1.0], [-1.0, 0.1, 0.2, -2.0]] {
            let found = by_jacobian(&DMat2::from_cols_array(&j));
            for v in [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, -1.0, 0.0], [1.0, 0.0, 0.0, -1.0], [0.3, -2.0, 1.0, 0.7]] {
                let value: f64 = (0..4).map(|i| (0..4).map(|k| v[i] * found[i][k] * v[k]).sum::<f64>()).sum();
                assert!(value > 0.0, "{j:?}");
            }
        }
    }
}
