//! What a scalar grid says at the nodes of its lattice: the distance of each number from the level, and the signs of whole
//! rows as bits.
//!
//! Input of [K01] §4.1; see `docs/methods/fields.md`.

use super::Lattice;
use super::scalar_grid::{Body, GridParams, ScalarGrid};
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// The numbers of a grid less the level, negative in the body; with a layer of free space around if the surface is to be
/// closed. What the trilinear interpolant does inside cells.
#[derive(Clone, Debug)]
pub struct Levels {
    pub(super) values: Arc<Vec<f32>>,
    pub(super) size: [usize; 3],
    /// Layers of free space around.
    pub(super) pad: usize,
    iso: f64,
    /// 1 where the body lies below the level, -1 above.
    sign: f64,
    /// Numbers times the sign lie in the body if below this: what rounding makes of the level.
    bound: f32,
    /// The number of free space.
    far: OnceLock<f32>,
}

impl Levels {
    pub(super) fn new(grid: &ScalarGrid, params: &GridParams) -> Levels {
        let sign = if params.body == Body::Below { 1.0 } else { -1.0 };
        let (values, size, iso) = (grid.values.clone(), grid.size, params.iso);
        let pad = params.close as usize;
        let mut levels = Levels { values, size, pad, iso, sign, bound: 0.0, far: OnceLock::new() };
        // The least number that is not below, a step or two of rounding from the level.
        let below = |v: f32| levels.level((sign * v as f64) as f32) < 0.0;
        let mut bound = (sign * iso) as f32;
        while below(bound) && bound < f32::MAX {
            bound = bound.next_up();
        }
        if !below(bound.next_down()) {
            bound = bound.next_down();
        }
        levels.bound = bound;
        levels
    }

    pub(super) fn lattice(&self, grid: &ScalarGrid) -> Lattice {
        let cells = grid.size.map(|n| n - 1 + 2 * self.pad);
        Lattice { origin: grid.origin - grid.spacing * self.pad as f64, step: grid.spacing, cells }
    }

    pub(crate) fn level(&self, v: f32) -> f32 {
        (self.sign * (v as f64 - self.iso)) as f32
    }

    /// The value at a node.
    pub fn at(&self, [i, j, k]: [usize; 3]) -> f64 {
        // Below the first sample wraps around to far beyond the last.
        let (i, j, k) = (i.wrapping_sub(self.pad), j.wrapping_sub(self.pad), k.wrapping_sub(self.pad));
        if i >= self.size[0] || j >= self.size[1] || k >= self.size[2] {
            return self.far() as f64;
        }
        self.level(self.values[(k * self.size[1] + j) * self.size[0] + i]) as f64
    }

    /// As far outside as any number is from the level; asked for only where the surface meets the border.
    fn far(&self) -> f32 {
        let level = |&v: &f32| self.level(v).abs();
        *self.far.get_or_init(|| self.values.par_iter().map(level).filter(|v| v.is_finite()).reduce(|| 1e-30, f32::max))
    }

    /// Bits of the nodes of row `(., j, k)` that are inside, and of those that are known.
    pub(super) fn bits(&self, j: usize, k: usize, inside: &mut [u64], known: &mut [u64]) {
        inside.fill(0);
        known.fill(!0);
        let [nx, ny, nz] = self.size;
        let (j, k) = (j.wrapping_sub(self.pad), k.wrapping_sub(self.pad));
        if j >= ny || k >= nz {
            return;
        }
        let row = &self.values[(k * ny + j) * nx..][..nx];
        let (sign, bound) = (self.sign as f32, self.bound);
        for (w, chunk) in row.chunks(64).enumerate() {
            inside[w] = mask(chunk, |v| sign * v < bound);
            if chunk.iter().fold(false, |any, v| any | v.is_nan()) {
                known[w] = !mask(chunk, f32::is_nan);
            }
        }
        if self.pad == 1 {
            for w in (0..inside.len()).rev() {
                let (a, b) = if w > 0 { (inside[w - 1], known[w - 1]) } else { (0, !0) };
                inside[w] = inside[w] << 1 | a >> 63;
                known[w] = known[w] << 1 | b >> 63;
            }
        }
    }
}

/// One bit for each of up to 64 numbers.
#[inline(always)]
fn mask(row: &[f32], test: impl Fn(f32) -> bool) -> u64 {
    let mut bytes = [0u8; 64];
    for (b, &v) in bytes.iter_mut().zip(row) {
        *b = test(v) as u8;
    }
    let mut word = 0;
    for (n, eight) in bytes.chunks_exact(8).enumerate() {
        // The product gathers the lowest bits of eight bytes in its highest byte.
        let eight = eight.iter().rev().fold(0, |all, &b| all << 8 | b as u64);
        word |= (eight.wrapping_mul(0x0102_0408_1020_4080) >> 56) << (8 * n);
    }
    word
}
