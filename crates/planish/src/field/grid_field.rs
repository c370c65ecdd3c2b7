//! Scalar grids (volume images) as directed fields.
//!
//! [K01] §4.1: hits by linear interpolation along the edges, exactly where the trilinear interpolant passes them.
//! Gradients by one of the paper's two estimates; the first keeps features sharper, the second is smoother.

use super::directed::{self, Directed, Hit, Hits, Placed, Sides, Thin, changes_of};
use super::{FieldError, Lattice};
use crate::observe::Observer;
use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A regular grid of numbers, x fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct ScalarGrid {
    /// Samples along each axis.
    pub size: [usize; 3],
    /// Position of the first sample, world units.
    pub origin: DVec3,
    /// Distance between samples along each axis, world units.
    pub spacing: DVec3,
    /// The numbers.
    pub values: Vec<f32>,
}

/// How gradients are estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GradientRule {
    /// Of the trilinear interpolant: the exact difference along the edge
    #[default]
    Trilinear,
    /// Central differences at the nodes, interpolated: smoother
    Central,
}

/// On which side of the level the body lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Body {
    /// Where numbers are below the level, as in distance fields
    #[default]
    Below,
    /// Where numbers are above the level, as in tomography
    Above,
}

/// How a grid is read as a field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GridParams {
    /// The level of the surface, in the grid's numbers
    pub iso: f64,
    /// On which side of the level the body lies
    pub body: Body,
    /// How normals are estimated
    pub gradient: GradientRule,
    /// Close the surface where it meets the border of the grid
    pub close: bool,
}

impl Default for GridParams {
    fn default() -> Self {
        GridParams { iso: 0.0, body: Body::Below, gradient: GradientRule::Trilinear, close: true }
    }
}

/// Samples a grid: its samples are the nodes of the lattice.
/// # Errors
/// [`FieldError::Grid`] if size and numbers disagree, [`FieldError::Cancelled`].
pub fn sample_grid(grid: &ScalarGrid, params: &GridParams, observer: &dyn Observer) -> Result<Directed, FieldError> {
    let [nx, ny, nz] = grid.size;
    let fault = |what: String| Err(FieldError::Grid { what });
    if nx < 2 || ny < 2 || nz < 2 {
        return fault(format!("{nx} x {ny} x {nz} samples are no volume; at least 2 along each axis are needed"));
    }
    if nx * ny * nz != grid.values.len() {
        return fault(format!("{nx} x {ny} x {nz} samples are {}, but {} are there", nx * ny * nz, grid.values.len()));
    }
    if !(grid.spacing.min_element() > 0.0) || !grid.spacing.is_finite() || !grid.origin.is_finite() {
        return fault(format!("a spacing of {:?} is none", grid.spacing.to_array()));
    }
    let (values, lattice) = shifted(grid, params);
    let [nx, ny, nz] = [0, 1, 2].map(|a| lattice.nodes(a));
    let value = |i: usize, j: usize, k: usize| values[lattice.row(j, k) * nx + i];
    let planes: Vec<Option<Plane>> = (0..nz)
        .into_par_iter()
        .map(|k| {
            if observer.cancelled() {
                return None;
            }
            let mut out: [Vec<Placed>; 3] = Default::default();
            let mut rows = Vec::with_capacity(ny);
            for j in 0..ny {
                let row = lattice.row(j, k);
                let here = &values[row * nx..(row + 1) * nx];
                let bits = signs(here);
                let known: Vec<u64> = numbers(here);
                rows.push(changes_of(&bits, &known, nx));
                let mut crossing = directed::shift(&bits);
                let mut collect = |crossing: &mut Vec<u64>, axis: usize, count: usize, from: &[u64]| {
                    for w in 0..crossing.len() {
                        crossing[w] ^= from[w];
                    }
                    directed::mask_past(crossing, count);
                    for w in 0..crossing.len() {
                        let mut rest = crossing[w];
                        while rest != 0 {
                            let i = 64 * w + rest.trailing_zeros() as usize;
                            rest &= rest - 1;
                            let hit = hit(&value, &lattice, axis, [i, j, k], params.gradient);
                            out[axis].push(Placed { row: row as u32, at: i as u32, hit });
                        }
                    }
                };
                collect(&mut crossing, 0, nx - 1, &bits);
                for (axis, inside, other) in [(1, j + 1 < ny, (j + 1, k)), (2, k + 1 < nz, (j, k + 1))] {
                    if inside {
                        let other = lattice.row(other.0, other.1);
                        collect(&mut signs(&values[other * nx..(other + 1) * nx]), axis, nx, &bits);
                    }
                }
            }
            Some((rows, out))
        })
        .collect();
    let planes: Option<Vec<_>> = planes.into_iter().collect();
    let Some(planes) = planes else { return Err(FieldError::Cancelled) };
    let (rows, hits): (Vec<_>, Vec<_>) = planes.into_iter().unzip();
    let sides = Sides::from_rows(rows.into_iter().flatten());
    let unknown = sides.unknown;
    let axes = [0, 1, 2].map(|axis| in_order(lattice.rows(), hits.iter().map(|h| &h[axis])));
    let mut field = if unknown {
        let none = |axis: usize, at: [usize; 3]| hit(&value, &lattice, axis, at, params.gradient);
        Directed::assemble(lattice, sides, axes, &none)
    } else {
        Directed { lattice, axes, sides, noise_deg: 0.0, values: None, mended: 0, thin: Thin::default() }
    };
    field.values = Some(Arc::new(values));
    observer.progress(1.0);
    Ok(field)
}

/// Changes of side of the rows of one plane, and its hits along the three axes.
type Plane = (Vec<Vec<u32>>, [Vec<Placed>; 3]);

/// Hits that come row by row already.
fn in_order<'a>(rows: usize, planes: impl Iterator<Item = &'a Vec<Placed>>) -> Hits {
    let mut all = Hits { start: vec![0; rows + 1], ..Hits::default() };
    for p in planes.flatten() {
        all.start[p.row as usize + 1] += 1;
        all.at.push(p.at);
        all.hits.push(p.hit);
    }
    for r in 0..rows {
        all.start[r + 1] += all.start[r];
    }
    all
}

/// Numbers less the level, negative in the body; with a layer of free space around if the surface is to be closed.
fn shifted(grid: &ScalarGrid, params: &GridParams) -> (Vec<f32>, Lattice) {
    let sign = if params.body == Body::Below { 1.0 } else { -1.0 };
    let level = |v: f32| (sign * (v as f64 - params.iso)) as f32;
    let [nx, ny, nz] = grid.size;
    if !params.close {
        let lattice = Lattice { origin: grid.origin, step: grid.spacing, cells: [nx - 1, ny - 1, nz - 1] };
        return (grid.values.par_iter().map(|&v| level(v)).collect(), lattice);
    }
    let far = grid.values.par_iter().map(|&v| level(v).abs()).filter(|v| v.is_finite()).reduce(|| 1e-30, f32::max);
    let (mx, my, mz) = (nx + 2, ny + 2, nz + 2);
    let mut values = vec![far; mx * my * mz];
    values.par_chunks_mut(mx).enumerate().for_each(|(row, out)| {
        let (j, k) = (row % my, row / my);
        if (1..=ny).contains(&j) && (1..=nz).contains(&k) {
            let from = ((k - 1) * ny + j - 1) * nx;
            for (o, &v) in out[1..=nx].iter_mut().zip(&grid.values[from..from + nx]) {
                *o = level(v);
            }
        }
    });
    (values, Lattice { origin: grid.origin - grid.spacing, step: grid.spacing, cells: [mx - 1, my - 1, mz - 1] })
}

/// Bits of the values below zero.
fn signs(row: &[f32]) -> Vec<u64> {
    row.chunks(64).map(|c| c.iter().enumerate().fold(0, |w, (b, &v)| w | ((v < 0.0) as u64) << b)).collect()
}

/// Bits of the values that are numbers.
fn numbers(row: &[f32]) -> Vec<u64> {
    row.chunks(64).map(|c| c.iter().enumerate().fold(0, |w, (b, &v)| w | (!v.is_nan() as u64) << b)).collect()
}

fn hit(
    value: &impl Fn(usize, usize, usize) -> f32,
    lattice: &Lattice,
    axis: usize,
    at: [usize; 3],
    rule: GradientRule,
) -> Hit {
    let mut end = at;
    end[axis] += 1;
    let get = |p: [usize; 3]| value(p[0], p[1], p[2]) as f64;
    let (f0, f1) = (get(at), get(end));
    let t = f0 / (f0 - f1);
    // Central differences at a node, one-sided at the border and beside what is not known.
    let central = |p: [usize; 3], a: usize| {
        let (mut low, mut high) = (p, p);
        low[a] = p[a].saturating_sub(1);
        high[a] = (p[a] + 1).min(lattice.cells[a]);
        let (mut g, mut steps) = (get(high) - get(low), (high[a] - low[a]) as f64);
        if g.is_nan() {
            let (up, down) = (get(high) - get(p), get(p) - get(low));
            (g, steps) = if up.is_nan() { (if down.is_nan() { 0.0 } else { down }, 1.0) } else { (up, 1.0) };
        }
        g / (steps * lattice.step[a])
    };
    let mut normal = DVec3::ZERO;
    for a in 0..3 {
        normal[a] = if a == axis && rule == GradientRule::Trilinear {
            (f1 - f0) / lattice.step[a]
        } else {
            central(at, a) * (1.0 - t) + central(end, a) * t
        };
    }
    let mut fallback = DVec3::ZERO;
    fallback[axis] = if f1 > f0 { 1.0 } else { -1.0 };
    Hit { t: directed::clear(t), normal: normal.try_normalize().unwrap_or(fallback) }
}
