//! What a map costs: how far it is from the directions of the field, and how far its triangles are from their shape and
//! from being flipped.

use super::cones::Charts;
use super::effort::Effort;
use super::seams::Seams;
use crate::mesh::TriMesh;
use crate::network::field::flat;
use glam::{DMat2, DVec2};
use planish_sparse::SparseCholesky;
use rayon::prelude::*;

/// Entries of a system at most. A face has 9 for each axis where its corners are unknowns of their own, some 100 000 on a
/// usual mesh; where places hang on many others, as along thousands of rims, they would be any number. These take 200 MB.
const MOST_ENTRIES: usize = 8_000_000;

/// Weight of the change of area beside the change of angles in [`Maps::barrier`] (the authors' choice is a half or less).
pub(super) const AREA_WEIGHT: f64 = 0.3;

/// Weight of the field's directions in [`Maps::barrier`]: enough to keep isolines along it where nothing is folded.
pub(super) const HOLD: f64 = 0.5;

/// Faces that a map stretches by more than this, or by less than its inverse, are not to stay so. Chosen.
const MOST_STRETCHED: f64 = 3.0;

/// A variable that has to stay positive, as barriers see it.
struct Guarded {
    /// Nearly the variable where it is positive, finite and positive where it is not; comes nearer with less softness.
    chi: f64,
    /// Change of `chi` with the variable.
    slope: f64,
}

impl Guarded {
    /// Garanzha et al. 2021, eq. 3; `None` where no softness is left for a variable that is not positive.
    fn new(x: f64, softness: f64) -> Option<Guarded> {
        let root = (softness * softness + x * x).sqrt();
        // Without cancellation where the variable is negative.
        let chi = if x > 0.0 { (x + root) / 2.0 } else { softness * softness / (2.0 * (root - x)) };
        (chi > 0.0).then(|| Guarded { chi, slope: chi / root })
    }
}

/// The faces of a mesh as they are mapped.
pub(super) struct Maps<'a> {
    pub seams: &'a Seams,
    /// Gradients of the corner functions of each face, in the frame of its field: with corners `x`, the Jacobian is
    /// the sum of `x[k] gradient[k]^T`.
    pub gradient: Vec<[DVec2; 3]>,
    /// Areas as parts of the whole.
    pub share: Vec<f64>,
    /// Whether the barrier keeps every face within a quarter turn of its field, too.
    within_quarter: bool,
    effort: Effort,
}

impl<'a> Maps<'a> {
    /// * `scale` - units of the map for a world unit
    /// * `within_quarter` - whether the barrier keeps every face within a quarter turn of its field, too
    pub fn new(mesh: &TriMesh, charts: &Charts, seams: &'a Seams, scale: f64, within_quarter: bool) -> Maps<'a> {
        let faces = mesh.triangles.len();
        let area: Vec<f64> = (0..faces).map(|f| mesh.area(f)).collect();
        let whole: f64 = area.iter().sum();
        // A face without area pulls at nothing; its shape is taken as that of a tiny regular one.
        let least = 1e-9 * whole / faces.max(1) as f64;
        let gradient = |f: usize| {
            let [a, b, c] = flat(mesh, f);
            let back = DVec2::from_angle(-charts.axis[f]);
            let double = 2.0 * area[f].max(least) * scale;
            [c - b, a - c, b - a].map(|edge| back.rotate(edge.perp()) / double)
        };
        let gradient = (0..faces).map(gradient).collect();
        let share = area.iter().map(|a| a.max(least) / whole).collect();
        Maps { seams, gradient, share, within_quarter, effort: charts.effort.clone() }
    }

    /// The same with faces that are to be stretched so along and across their field.
    pub fn stretched(mut self, stretch: &[DVec2]) -> Maps<'a> {
        for (gradients, &stretch) in self.gradient.iter_mut().zip(stretch) {
            gradients.iter_mut().for_each(|g| *g /= stretch);
        }
        self
    }

    /// How much each face is stretched along and across its field, at the corners `x`, as far as [`MOST_STRETCHED`] goes.
    pub fn stretches(&self, x: &[f64]) -> Vec<DVec2> {
        let each = |f: usize| {
            let j = self.jacobian(f, x);
            let (least, most) = (DVec2::splat(1.0 / MOST_STRETCHED), DVec2::splat(MOST_STRETCHED));
            DVec2::new(j.x_axis.length(), j.y_axis.length()).clamp(least, most)
        };
        (0..self.gradient.len()).map(each).collect()
    }

    pub fn faces(&self) -> usize {
        self.gradient.len()
    }

    /// Counts work that takes as long as so many energies of all faces.
    pub fn count_effort(&self, energies: usize) {
        self.effort.add(energies * self.gradient.len());
    }

    /// True once no more work may go into the maps.
    pub fn is_spent(&self) -> bool {
        self.effort.is_spent()
    }

    /// Jacobian of face `f`, columns along and across its field, from the corners of all faces.
    pub fn jacobian(&self, f: usize, x: &[f64]) -> DMat2 {
        let mut j = DMat2::ZERO;
        for (place, g) in self.seams.place[f].iter().zip(&self.gradient[f]) {
            let at = DVec2::new(x[2 * *place as usize], x[2 * *place as usize + 1]);
            j += DMat2::from_cols(at * g.x, at * g.y);
        }
        j
    }

    /// The system of the map that follows the field best, and of any step: `sum share |J|^2` by the free unknowns.
    pub fn laplacian(&self) -> Option<SparseCholesky> {
        self.system(&self.share)
    }

    /// The system of `sum weight |J|^2`. `None` if it is not positive or has more than [`MOST_ENTRIES`].
    fn system(&self, weight: &[f64]) -> Option<SparseCholesky> {
        if self.is_too_large() {
            return None;
        }
        let entries: Vec<Vec<(usize, usize, f64)>> = (0..self.gradient.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|f| {
                let mut entries = Vec::new();
                for axis in 0..2 {
                    let rows = self.seams.place[f].map(|p| self.seams.row(2 * p + axis).0);
                    for i in 0..3 {
                        for j in 0..3 {
                            let weight = weight[f] * self.gradient[f][i].dot(self.gradient[f][j]);
                            for &(a, c) in rows[i] {
                                let below = rows[j].iter().filter(|t| t.0 <= a);
                                entries.extend(below.map(|&(b, d)| (a as usize, b as usize, weight * c * d)));
                            }
                        }
                    }
                }
                entries
            })
            .collect();
        SparseCholesky::factor(self.seams.free(), &entries.concat()).ok()
    }

    /// True if the systems have more than [`MOST_ENTRIES`].
    pub fn is_too_large(&self) -> bool {
        self.entries() > MOST_ENTRIES
    }

    /// Entries of the system at most, before those of one place are added up.
    fn entries(&self) -> usize {
        let of = |f: usize, axis: u32| -> usize {
            let terms: usize = self.seams.place[f].iter().map(|p| self.seams.row(2 * p + axis).0.len()).sum();
            terms * terms
        };
        (0..self.gradient.len()).map(|f| of(f, 0) + of(f, 1)).sum()
    }

    /// The free unknowns of the map that follows the field best if each face is stretched by its scale. What a face misses
    /// counts as a part of its scale. `None` if the equations have no one answer.
    pub fn follow(&self, scale: &[f64]) -> Option<Vec<f64>> {
        let weight: Vec<f64> = self.share.iter().zip(scale).map(|(share, s)| share / (s * s)).collect();
        let none = self.seams.coordinates(&vec![0.0; self.seams.free()]);
        let mut gradient = vec![0.0; none.len()];
        for f in 0..self.gradient.len() {
            let miss = DMat2::from_diagonal(DVec2::splat(scale[f])) - self.jacobian(f, &none);
            self.add(f, weight[f] * miss, &mut gradient);
        }
        let mut free = self.seams.pull_back(&gradient);
        self.system(&weight)?.solve(&mut free);
        Some(free)
    }

    /// How many times its determinant each face has after a change of the corners.
    pub fn growth(&self, before: &[f64], after: &[f64]) -> Vec<f64> {
        let grown = |f: usize| self.jacobian(f, after).determinant() / self.jacobian(f, before).determinant();
        (0..self.gradient.len()).into_par_iter().with_min_len(512).map(grown).collect()
    }

    /// Adds the gradient by the corners of face `f` from that by its Jacobian.
    fn add(&self, f: usize, by_jacobian: DMat2, gradient: &mut [f64]) {
        for (place, g) in self.seams.place[f].iter().zip(&self.gradient[f]) {
            let sum = by_jacobian * *g;
            gradient[2 * *place as usize] += sum.x;
            gradient[2 * *place as usize + 1] += sum.y;
        }
    }

    /// Energy with a barrier against flipped faces, and its gradient by the free unknowns, at the corners `x`.
    ///
    /// Garanzha, Kaporin, Kudryavtseva, Protais, Ray, Sokolov, *Foldover-free Maps in 50 Lines of Code*, 2021, eq. 2 to 4:
    /// with `chi(det)` in place of the determinant the energy is finite on flipped faces, too, and comes nearer to the true one
    /// as `softness` goes to 0.
    ///
    /// Upright faces alone may still wind around a vertex twice, or run back along a line. Where they do, some are turned
    /// half around against the field; while the trace of every Jacobian is positive none is. So the trace has a barrier of
    /// the same form, least at the identity, if the map is to stay within a quarter turn.
    pub fn barrier(&self, x: &[f64], softness: f64) -> (f64, Vec<f64>) {
        self.effort.add(self.gradient.len());
        let each = |f: usize| barrier_of(&self.jacobian(f, x), softness, self.within_quarter);
        let infinite = (f64::INFINITY, DMat2::ZERO);
        let each = |f: usize| each(f).map_or(infinite, |(e, by)| (self.share[f] * e, self.share[f] * by));
        let parts: Vec<(f64, DMat2)> = (0..self.gradient.len()).into_par_iter().with_min_len(512).map(each).collect();
        let mut gradient = vec![0.0; x.len()];
        let mut energy = 0.0;
        for (f, &(part, by_jacobian)) in parts.iter().enumerate() {
            energy += part;
            self.add(f, by_jacobian, &mut gradient);
        }
        (energy, self.seams.pull_back(&gradient))
    }

    /// Least of what the barrier guards: determinants of all Jacobians, and half their traces.
    pub fn least_guarded(&self, x: &[f64]) -> f64 {
        let least = |f: usize| {
            let j = self.jacobian(f, x);
            let turn = if self.within_quarter { half_trace(&j) } else { f64::INFINITY };
            j.determinant().min(turn)
        };
        (0..self.gradient.len()).into_par_iter().with_min_len(512).map(least).reduce(|| f64::INFINITY, f64::min)
    }

    /// Mean over the surface of the angle between the isolines of the map and the field, degrees.
    pub fn deviation_deg(&self, x: &[f64]) -> f64 {
        let each = |f: usize| {
            // Isolines of u run across its gradient; the rows of the Jacobian are the gradients.
            let rows = self.jacobian(f, x).transpose();
            let off = [rows.x_axis, rows.y_axis.perp()].map(|g| g.to_angle().abs().to_degrees());
            let off = off.map(|a| (a % 90.0).min(90.0 - a % 90.0));
            self.share[f] * (off[0] + off[1]) / 2.0
        };
        (0..self.gradient.len()).map(each).sum()
    }
}

/// The energy of a face by its area, and its gradient by the Jacobian; `None` if it is infinite.
pub(super) fn barrier_of(j: &DMat2, softness: f64, within_quarter: bool) -> Option<(f64, DMat2)> {
    let det = j.determinant();
    let Guarded { chi, slope } = Guarded::new(det, softness)?;
    let squares = j.x_axis.length_squared() + j.y_axis.length_squared();
    let shape = (squares + AREA_WEIGHT * (det * det + 1.0)) / (2.0 * chi);
    let by_det = AREA_WEIGHT * det / chi - shape / chi * slope;
    let cofactor = DMat2::from_cols(DVec2::new(j.y_axis.y, -j.y_axis.x), DVec2::new(-j.x_axis.y, j.x_axis.x));
    let off = *j - DMat2::IDENTITY;
    let miss = off.x_axis.length_squared() + off.y_axis.length_squared();
    let mut energy = shape + HOLD * miss;
    let mut by_jacobian = *j * (1.0 / chi) + cofactor * by_det + off * (2.0 * HOLD);
    if within_quarter {
        let half = half_trace(j);
        let Guarded { chi, slope } = Guarded::new(half, softness)?;
        let turning = (half * half + 1.0) / (2.0 * chi);
        energy += turning;
        by_jacobian += DMat2::from_diagonal(DVec2::splat((half - turning * slope) / (2.0 * chi)));
    }
    Some((energy, by_jacobian))
}

fn half_trace(j: &DMat2) -> f64 {
    (j.x_axis.x + j.y_axis.y) / 2.0
}
