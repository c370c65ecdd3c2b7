//! Scalar grids (volume images) as directed fields.
//!
//! [K01] §4.1: hits by linear interpolation along the edges, exactly where the trilinear interpolant passes them.
//! Gradients by one of the paper's two estimates; the first keeps features sharper, the second is smoother. Departs from
//! [K01]: both blend what lies on the two sides of a sharp edge; hits and gradients there come from one of them ([`kink`](super)).
//!
//! The numbers are read once, from where they are: a slab of planes at a time, every row as words of 64 signs. Edges that
//! change side are the bits in which two words differ (in the spirit of flying edges, Schroeder et al. 2015), and their
//! hits are made while the planes around them are still in the cache.

use super::directed::{self, Directed, Hit, Hits, Sides, Thin};
use super::kink::{Around, is_bent};
use super::{FieldError, Lattice};
use crate::observe::Observer;
use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, OnceLock};

/// A regular grid of numbers, x fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct ScalarGrid {
    /// Samples along each axis.
    pub size: [usize; 3],
    /// Position of the first sample, world units.
    pub origin: DVec3,
    /// Distance between samples along each axis, world units.
    pub spacing: DVec3,
    /// The numbers. Shared: fields and meshes made from a volume do not copy it.
    pub values: Arc<Vec<f32>>,
}

/// How gradients are estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GradientRule {
    /// As trilinear, but beside sharp edges from the side on which the numbers go on straight; hits, too
    #[default]
    OneSided,
    /// Of the trilinear interpolant: the exact difference along the edge
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
        GridParams { iso: 0.0, body: Body::Below, gradient: GradientRule::OneSided, close: true }
    }
}

/// Planes of nodes that a task takes at once. Each task reads one plane that is not its own.
const PLANES: usize = 16;

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
    let levels = Levels::new(grid, params);
    let lattice = levels.lattice(grid);
    let planes = lattice.nodes(2);
    let slabs: Option<Vec<Slab>> = (0..planes.div_ceil(PLANES))
        .into_par_iter()
        .map(|s| {
            let slab = Slabs { levels: &levels, lattice: &lattice, rule: params.gradient };
            (!observer.cancelled()).then(|| slab.read(s * PLANES, ((s + 1) * PLANES).min(planes)))
        })
        .collect();
    let Some(slabs) = slabs else { return Err(FieldError::Cancelled) };
    let (sides, axes): (Vec<Sides>, Vec<[Hits; 3]>) = slabs.into_iter().unzip();
    let [mut x, mut y, mut z] = [const { Vec::new() }; 3];
    for [a, b, c] in axes {
        x.push(a);
        y.push(b);
        z.push(c);
    }
    let axes = [x, y, z].map(Hits::joined);
    let (sides, thin) = (Sides::joined(sides), Thin::default());
    observer.progress(1.0);
    Ok(Directed { lattice, axes, sides, noise_deg: 0.0, values: Some(levels), mended: 0, thin })
}

/// The numbers of a grid less the level, negative in the body; with a layer of free space around if the surface is to be
/// closed. What the trilinear interpolant does inside cells.
#[derive(Clone, Debug)]
pub struct Levels {
    values: Arc<Vec<f32>>,
    size: [usize; 3],
    /// Layers of free space around.
    pad: usize,
    iso: f64,
    /// 1 where the body lies below the level, -1 above.
    sign: f64,
    /// Numbers times the sign lie in the body if below this: what rounding makes of the level.
    bound: f32,
    /// The number of free space.
    far: OnceLock<f32>,
}

impl Levels {
    fn new(grid: &ScalarGrid, params: &GridParams) -> Levels {
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

    fn lattice(&self, grid: &ScalarGrid) -> Lattice {
        let cells = grid.size.map(|n| n - 1 + 2 * self.pad);
        Lattice { origin: grid.origin - grid.spacing * self.pad as f64, step: grid.spacing, cells }
    }

    fn level(&self, v: f32) -> f32 {
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
    fn bits(&self, j: usize, k: usize, inside: &mut [u64], known: &mut [u64]) {
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

/// Sides and hits of the rows of a slab.
type Slab = (Sides, [Hits; 3]);

/// What is the same for all slabs.
struct Slabs<'a> {
    levels: &'a Levels,
    lattice: &'a Lattice,
    rule: GradientRule,
}

impl Slabs<'_> {
    /// Reads the planes `from..to`.
    fn read(&self, from: usize, to: usize) -> Slab {
        let lattice = self.lattice;
        let (words, nx, ny) = (lattice.words(), lattice.nodes(0), lattice.nodes(1));
        let mut axes = [(); 3].map(|()| Hits { start: vec![0], ..Hits::default() });
        let mut sides = Sides { start: vec![0], ..Sides::default() };
        let plane = |k: usize, inside: &mut [u64], known: &mut [u64]| {
            let rows = inside.chunks_exact_mut(words).zip(known.chunks_exact_mut(words));
            rows.enumerate().for_each(|(j, (inside, known))| self.levels.bits(j, k, inside, known));
        };
        let [mut here, mut known, mut above, mut known_above] = [(); 4].map(|()| vec![0; words * ny]);
        plane(from, &mut here, &mut known);
        for k in from..to {
            if k < lattice.cells[2] {
                plane(k + 1, &mut above, &mut known_above);
            }
            for j in 0..ny {
                let (row, next) = (j * words..(j + 1) * words, (j + 1) * words..(j + 2) * words);
                let (a, n) = (&here[row.clone()], &known[row.clone()]);
                sides.push(a, n, nx);
                let past = |bits: &[u64], w: usize| bits[w] >> 1 | bits.get(w + 1).map_or(0, |b| b << 63);
                let mut collect = |axis: usize, last: usize, inside: &[u64], known: &[u64]| {
                    let hits = &mut axes[axis];
                    for w in 0..inside.len() {
                        let (b, m) = if axis == 0 { (past(a, w), past(n, w)) } else { (inside[w], known[w]) };
                        let mut rest = (a[w] ^ b) & n[w] & m & directed::below(last, w);
                        while rest != 0 {
                            let i = 64 * w + rest.trailing_zeros() as usize;
                            rest &= rest - 1;
                            hits.at.push(i as u32);
                            hits.hits.push(hit(self.levels, lattice, axis, [i, j, k], self.rule));
                        }
                    }
                    hits.start.push(hits.at.len() as u32);
                };
                collect(0, nx - 1, a, n);
                // Past the last row and the last plane there are no edges.
                let next = if j < lattice.cells[1] { next } else { 0..0 };
                collect(1, nx, &here[next.clone()], &known[next]);
                let row = if k < lattice.cells[2] { row } else { 0..0 };
                collect(2, nx, &above[row.clone()], &known_above[row]);
            }
            std::mem::swap(&mut here, &mut above);
            std::mem::swap(&mut known, &mut known_above);
        }
        (sides, axes)
    }
}

fn hit(levels: &Levels, lattice: &Lattice, axis: usize, at: [usize; 3], rule: GradientRule) -> Hit {
    let central = rule == GradientRule::Central;
    if let Some(hit) = (!central).then(|| inner_hit(levels, lattice, axis, at, rule)).flatten() {
        return hit;
    }
    let mut end = at;
    end[axis] += 1;
    let get = |p: [usize; 3]| levels.at(p);
    let (f0, f1) = (get(at), get(end));
    let t = f0 / (f0 - f1);
    // Central differences at a node, one-sided at the border and beside what is not known.
    let difference = |p: [usize; 3], a: usize| {
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
        normal[a] = if a == axis && !central {
            (f1 - f0) / lattice.step[a]
        } else {
            difference(at, a) * (1.0 - t) + difference(end, a) * t
        };
    }
    let mut fallback = DVec3::ZERO;
    fallback[axis] = if f1 > f0 { 1.0 } else { -1.0 };
    Hit { t: directed::clear(t), normal: normal.try_normalize().unwrap_or(fallback) }
}

/// [`hit`] by the trilinear rule on an edge with known samples all around: the same numbers by fewer steps. Beside a kink
/// by the one-sided rule, if there are samples for two steps all around.
fn inner_hit(levels: &Levels, lattice: &Lattice, axis: usize, at: [usize; 3], rule: GradientRule) -> Option<Hit> {
    let size = levels.size;
    let has = |steps: usize| {
        let beyond = |a: usize| at[a] + 1 + steps + levels.pad + (a == axis) as usize;
        (0..3).all(|a| at[a] >= steps + levels.pad && beyond(a) <= size[a] + 2 * levels.pad)
    };
    if !has(1) {
        return None;
    }
    let stride = [1, size[0], size[0] * size[1]];
    let low = (at[2] - levels.pad) * stride[2] + (at[1] - levels.pad) * stride[1] + at[0] - levels.pad;
    let high = low + stride[axis];
    let get = |n: usize| levels.level(levels.values[n]) as f64;
    let (f0, f1) = (get(low), get(high));
    let t = f0 / (f0 - f1);
    let mut normal = DVec3::ZERO;
    normal[axis] = (f1 - f0) / lattice.step[axis];
    let beside = [(axis + 1) % 3, (axis + 2) % 3].map(|a| {
        let [below, above] = [[low, high].map(|n| get(n - stride[a])), [low, high].map(|n| get(n + stride[a]))];
        let central = |k: usize| (above[k] - below[k]) / (2.0 * lattice.step[a]);
        normal[a] = central(0) * (1.0 - t) + central(1) * t;
        (a, below, above)
    });
    if normal.is_nan() {
        return None;
    }
    let length = normal.length();
    let bent = |(a, below, above): &(usize, [f64; 2], [f64; 2])| is_bent(*below, *above, t, length * lattice.step[*a]);
    if rule == GradientRule::OneSided && beside.iter().any(bent) && has(2) {
        let (t, gradient) = Around { get: &get, ends: [low, high], stride, step: lattice.step, axis }.hit();
        if let Some(normal) = gradient.try_normalize() {
            return Some(Hit { t: directed::clear(t), normal });
        }
    }
    Some(Hit { t: directed::clear(t), normal: normal.try_normalize()? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Silent;
    use crate::geom::random;

    #[test]
    fn rows_of_2_to_130_numbers_have_the_sides_of_their_numbers_closed_or_not_and_above_as_below_of_the_negative() {
        for nx in [2, 3, 61, 62, 63, 64, 65, 66, 127, 128, 130] {
            let number = |v: usize| match random::unit(nx as u64, v as u64) {
                r if r < 0.05 => f32::NAN,
                r => (r - 0.5) as f32,
            };
            let values: Vec<f32> = (0..nx * 6).map(number).collect();
            let grid = |values: Vec<f32>| ScalarGrid {
                size: [nx, 3, 2],
                origin: DVec3::ZERO,
                spacing: DVec3::ONE,
                values: Arc::new(values),
            };
            for close in [false, true] {
                let below = GridParams { iso: 0.1, close, ..Default::default() };
                let above = GridParams { iso: -0.1, body: Body::Above, ..below.clone() };
                let field = sample_grid(&grid(values.clone()), &below, &Silent).unwrap();
                let turned = sample_grid(&grid(values.iter().map(|v| -v).collect()), &above, &Silent).unwrap();
                assert_eq!(field.sides.changes, turned.sides.changes);
                assert!((0..3).all(|a| field.axes[a].hits == turned.axes[a].hits));
                let pad = close as usize;
                let words = field.lattice.words();
                let (mut inside, mut known) = (vec![0; words], vec![0; words]);
                for (row, numbers) in values.chunks(nx).enumerate() {
                    let row = field.lattice.row(row % 3 + pad, row / 3 + pad);
                    field.sides.bits(row, &mut inside, &mut known);
                    for (i, v) in numbers.iter().enumerate() {
                        let bit = |bits: &[u64]| bits[(i + pad) / 64] >> ((i + pad) % 64) & 1 == 1;
                        assert_eq!(bit(&known), !v.is_nan(), "{nx} {close} {i}");
                        assert_eq!(bit(&known) && bit(&inside), (*v as f64) < 0.1, "{nx} {close} {i}");
                    }
                }
            }
        }
    }
}
