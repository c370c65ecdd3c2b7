//! What is longer than a wavelength, as the least of an energy.
//!
//! With the discrete Laplacian `y = M^-1 L x` the energy `sum m |x - p|^2 + t^3 y^T L y` lets a wave of frequency `w` pass by
//! the share `1 / (1 + t^3 w^6)`. Places on lines are given, and `y` counts only between places beside them: what the energy
//! costs is the change of curvature, so that a form may bend up to its edges and borders, however it goes on beyond. The
//! Laplacian alone would turn away from a border at a right angle.

use crate::linalg::SparseCholesky;
use crate::observe::Observer;
use crate::relief::ReliefError;
use crate::relief::laplacian::{Bond, smoother};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// The filter takes its own high part this many times: a wave twice as long as the cut-off loses 2e-4 of its height then and
/// not 1.5e-2, for three times the time.
const PASSES: usize = 3;
/// Largest stiffness of a place against its mass: three of them follow each other in the energy and leave 4 of the 16 digits of a
/// number. A place among 16 for each wave has 100; those that stand much closer, or in slivers, get more mass.
const STIFFEST: f64 = 1e4;
/// Error of the detail, against its root mean square, at which the solver stops.
const CONVERGED: f64 = 1e-5;
/// Most steps of the solver. Its preconditioner is within a factor of 4 of the energy for waves, so that some tens do.
const MAX_STEPS: usize = 400;

/// Masses and stiffnesses of places, which may be those of a surface or of lines.
#[derive(Default)]
pub struct Pieces {
    /// Area or length of each place.
    pub mass: Vec<f64>,
    /// True for places that are given.
    pub fixed: Vec<bool>,
    /// The stiffness.
    pub bonds: Vec<Bond>,
    /// As `bonds`, of those elements alone that have no place that is given.
    pub inner: Vec<Bond>,
}

impl Pieces {
    /// Of places without mass and stiffness, none of them given.
    pub fn of(places: usize) -> Pieces {
        Pieces { mass: vec![0.0; places], fixed: vec![false; places], ..Pieces::default() }
    }
}

/// A symmetric matrix whose rows sum to 0.
struct Stiffness {
    starts: Vec<u32>,
    entries: Vec<(u32, f64)>,
}

impl Stiffness {
    fn new(places: usize, bonds: &[Bond]) -> Stiffness {
        let mut both: Vec<Bond> = bonds.iter().flat_map(|&(i, j, w)| [(i, j, w), (j, i, w)]).collect();
        both.par_sort_by_key(|&(i, j, _)| (i, j));
        let mut starts = vec![0; places + 1];
        let mut entries: Vec<(u32, f64)> = Vec::with_capacity(both.len() / 2);
        let mut last = None;
        for (i, j, w) in both {
            if last == Some((i, j)) {
                entries.last_mut().expect("an entry before one of its place").1 += w;
            } else {
                entries.push((j, w));
                last = Some((i, j));
            }
            starts[i as usize + 1] = entries.len() as u32;
        }
        for i in 0..places {
            starts[i + 1] = starts[i + 1].max(starts[i]);
        }
        Stiffness { starts, entries }
    }

    /// Row `i` times `x`.
    fn row(&self, i: usize, x: &[DVec3]) -> DVec3 {
        let entries = &self.entries[self.starts[i] as usize..self.starts[i + 1] as usize];
        entries.iter().map(|&(j, w)| (x[i] - x[j as usize]) * w).sum()
    }
}

/// The energy for one wavelength: `M + t^3 L M^-1 L' M^-1 L`.
pub struct Energy {
    mass: Vec<f64>,
    fixed: Vec<bool>,
    stiff: Stiffness,
    inner: Stiffness,
    /// `t^3`.
    weight: f64,
    /// `M + t L` over the places that are not given, in their order.
    smoother: SparseCholesky,
    /// The same with the inner stiffness.
    inner_smoother: SparseCholesky,
    free: Vec<u32>,
}

impl Energy {
    /// For the places of `pieces`, some of which are not given.
    /// # Errors
    /// [`ReliefError::Cancelled`].
    pub fn new(pieces: Pieces, wavelength: f64, observer: &dyn Observer) -> Result<Energy, ReliefError> {
        let Pieces { mut mass, fixed, bonds, inner } = pieces;
        // At the wavelength half is to pass: `1 - (1 - share)^PASSES = 1/2`.
        let share = 1.0 - 0.5f64.powf(1.0 / PASSES as f64);
        let weight = (1.0 / share - 1.0) * (wavelength / TAU).powi(6);
        let time = weight.cbrt();
        let mut stiffness = vec![0.0; mass.len()];
        bonds.iter().for_each(|&(i, j, w)| [i, j].iter().for_each(|&k| stiffness[k as usize] += w.abs()));
        mass.iter_mut().zip(&stiffness).for_each(|(m, w)| *m = m.max(w * time / STIFFEST));
        let free: Vec<u32> = (0..mass.len() as u32).filter(|&i| !fixed[i as usize]).collect();
        let mut rows = vec![u32::MAX; mass.len()];
        free.iter().enumerate().for_each(|(k, &i)| rows[i as usize] = k as u32);
        let of = |bonds: &[Bond]| smoother(&mass, bonds, &rows, time, observer);
        let (smoother, inner_smoother) = (of(&bonds)?, of(&inner)?);
        let (stiff, inner) = (Stiffness::new(mass.len(), &bonds), Stiffness::new(mass.len(), &inner));
        Ok(Energy { mass, fixed, stiff, inner, weight, smoother, inner_smoother, free })
    }

    /// What is longer than the wavelength of `places`; those that are given stay.
    /// # Errors
    /// [`ReliefError::Cancelled`]; [`ReliefError::Edit`] if the solver does not come to an end.
    pub fn low_pass(&self, places: &[DVec3], observer: &dyn Observer) -> Result<Vec<DVec3>, ReliefError> {
        let mut high = places.to_vec();
        for _ in 0..PASSES {
            high = self.high_pass(&high, observer)?;
        }
        Ok(places.iter().zip(&high).map(|(p, h)| *p - *h).collect())
    }

    /// What one pass takes away: `(M + t^3 A)^-1 t^3 A x`, with `A` the matrix of `y^T L y`; nothing where places are given.
    fn high_pass(&self, x: &[DVec3], observer: &dyn Observer) -> Result<Vec<DVec3>, ReliefError> {
        let mut residual = self.bend(x);
        let mut high = vec![DVec3::ZERO; x.len()];
        let mut ahead = self.precondition(&residual);
        let mut direction = ahead.clone();
        let mut rest = dot(&residual, &ahead);
        let mut step = 0;
        // The energy of the error, which is above the sum of its squares by masses; that of the detail's short waves says nothing of
        // the error of the long ones.
        while rest.element_sum() > CONVERGED * CONVERGED * self.square(&high) {
            if step == MAX_STEPS {
                let what = format!("the waves are not parted after {MAX_STEPS} steps: patches are folded or slivers");
                return Err(ReliefError::Edit { what });
            }
            observer.check()?;
            observer.progress(step as f64 / MAX_STEPS as f64);
            let mut image = self.bend(&direction);
            image.iter_mut().zip(&direction).zip(&self.mass).for_each(|((a, d), m)| *a += *d * *m);
            let along = quotient(rest, dot(&direction, &image));
            high.iter_mut().zip(&direction).for_each(|(h, d)| *h += *d * along);
            residual.iter_mut().zip(&image).for_each(|(r, a)| *r -= *a * along);
            ahead = self.precondition(&residual);
            let next = dot(&residual, &ahead);
            let turn = quotient(next, rest);
            direction.iter_mut().zip(&ahead).for_each(|(d, a)| *d = *a + *d * turn);
            rest = next;
            step += 1;
        }
        Ok(high)
    }

    /// Sum of squares by masses.
    fn square(&self, x: &[DVec3]) -> f64 {
        x.iter().zip(&self.mass).map(|(x, m)| x.length_squared() * m).sum()
    }

    /// `t^3 A x`; 0 where places are given.
    fn bend(&self, x: &[DVec3]) -> Vec<DVec3> {
        let per_mass = |of: &Stiffness, x: &[DVec3]| -> Vec<DVec3> {
            let one = |i: usize| if self.fixed[i] { DVec3::ZERO } else { of.row(i, x) / self.mass[i] };
            (0..x.len()).into_par_iter().map(one).collect()
        };
        let change = per_mass(&self.inner, &per_mass(&self.stiff, x));
        let one = |i: usize| if self.fixed[i] { DVec3::ZERO } else { self.stiff.row(i, &change) * self.weight };
        (0..x.len()).into_par_iter().map(one).collect()
    }

    /// `S M S' M S r` with the smoothers `S = (M + t L)^-1` and `S' = (M + t L')^-1`: for each wave the inverse of
    /// `M (1 + t w^2)^3`, which is between once and four times the energy. With `S` for `S'` lines would cost hundreds of steps.
    fn precondition(&self, residual: &[DVec3]) -> Vec<DVec3> {
        let n = self.free.len();
        let mut columns: Vec<f64> =
            (0..3).flat_map(|k| self.free.iter().map(move |&i| residual[i as usize][k])).collect();
        self.smoother.solve(&mut columns);
        for smoother in [&self.inner_smoother, &self.smoother] {
            let masses = self.free.iter().map(|&i| self.mass[i as usize]).cycle();
            columns.iter_mut().zip(masses).for_each(|(c, m)| *c *= m);
            smoother.solve(&mut columns);
        }
        let mut out = vec![DVec3::ZERO; residual.len()];
        for (k, &i) in self.free.iter().enumerate() {
            out[i as usize] = DVec3::new(columns[k], columns[n + k], columns[2 * n + k]);
        }
        out
    }
}

/// Scalar products of the coordinates, each by itself.
fn dot(a: &[DVec3], b: &[DVec3]) -> DVec3 {
    a.iter().zip(b).map(|(a, b)| *a * *b).sum()
}

/// Quotients; 0 where there is nothing left to divide.
fn quotient(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::select(b.cmpeq(DVec3::ZERO), DVec3::ZERO, a / b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::Silent;

    /// Strips a twentieth of the wavelength wide between lines, 160 places for each wave. Each bends as a parabola, which is form
    /// however short it is, since its curvature does not change; every other place stands out, which is not.
    #[test]
    fn narrow_strips_between_lines_keep_their_bend_and_lose_what_is_short() {
        const ROWS: usize = 200;
        const COLS: usize = 33;
        const STRIP: usize = 8;
        // The column within the strip; 0 is a line.
        let across = |i: usize| i % COLS % STRIP;
        let mut pieces = Pieces::of(ROWS * COLS);
        let mut bond = |i: usize, j: usize| {
            pieces.bonds.push((i as u32, j as u32, 1.0));
            if across(i) != 0 && across(j) != 0 {
                pieces.inner.push((i as u32, j as u32, 1.0));
            }
        };
        for (row, col) in (0..ROWS).flat_map(|row| (0..COLS).map(move |col| (row, col))) {
            let i = row * COLS + col;
            if col + 1 < COLS {
                bond(i, i + 1);
            }
            if row + 1 < ROWS {
                bond(i, i + COLS);
            }
        }
        pieces.mass.fill(1.0);
        pieces.fixed = (0..ROWS * COLS).map(|i| across(i) == 0).collect();
        let bend = |i: usize| {
            let x = across(i) as f64 / STRIP as f64;
            4.0 * x * (1.0 - x)
        };
        let stands_out = |i: usize| if across(i) == 0 { 0.0 } else { 0.2 * ((i + i / COLS) % 2) as f64 };
        let places: Vec<DVec3> = (0..ROWS * COLS).map(|i| DVec3::Z * (bend(i) + stands_out(i))).collect();
        let energy = Energy::new(pieces, 160.0, &Silent).unwrap();
        let form = energy.low_pass(&places, &Silent).unwrap();
        let between = (0..ROWS * COLS).filter(|&i| across(i) != 0);
        let off = between.map(|i| (form[i].z - bend(i) - 0.1).abs()).fold(0.0, f64::max);
        assert!(off < 0.05, "{off}");
    }
}
