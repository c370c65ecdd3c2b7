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
use super::levels::Levels;
use super::scalar_grid::{GradientRule, GridParams, ScalarGrid};
use super::{FieldError, Lattice};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;

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
    if !(grid.spacing.min_element() > 0.0 && grid.spacing.is_finite() && grid.origin.is_finite()) {
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
    let slabs = slabs.ok_or(Cancelled)?;
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
    let twice = Default::default();
    Ok(Directed { lattice, axes, twice, sides, noise_deg: 0.0, values: Some(levels), mended: 0, thin })
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
                values: std::sync::Arc::new(values),
            };
            for close in [false, true] {
                let below = GridParams { iso: 0.1, close, ..Default::default() };
                let above = GridParams { iso: -0.1, body: crate::field::Body::Above, ..below.clone() };
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
