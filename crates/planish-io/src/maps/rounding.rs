//! Displacements as multiples of a step, within a bound and easy to predict: what `--max-error` asks for.
//!
//! A step of `2 e / sqrt(c)` in each of `c` channels keeps the nearest multiples within `e` of any vector; mostly other
//! multiples lie within `e`, too. Of them the one is taken that its neighbours predict best, as PNG predicts (Paeth's filter):
//! 1. nearest multiples      2. a sweep from the upper left: each texel as near to its own prediction as may be
//! 3. sweeps that also look at the predictions it has a part in, and lower the sum of all differences
//!
//! Texels on the border of a patch keep the nearest multiples, so that what two patches share stays one.

use super::image::{MapFile, paeth};
use planish::relief::maps::PatchMap;
use rayon::prelude::*;

/// Sweeps over a map at most: the first brings most, and each of the last ones less than a hundredth of the bytes.
const MOST_SWEEPS: usize = 7;
/// Room between the bound and the distance to the nearest multiples, as a share: more than single precision takes away from
/// numbers of 16 bits, 2^-25 of 65535 steps.
const BOUND_ROOM: f64 = 1.0 / 256.0;

/// Maps of multiples of a step.
#[derive(Clone, Debug)]
pub(super) struct Rounded {
    /// The maps with rounded numbers.
    pub maps: Vec<PatchMap>,
    /// The step.
    pub step: f64,
    /// Least and largest multiple.
    pub range: [i64; 2],
}

/// Steps from the least to the largest number that floats may take: single precision holds no finer multiples exactly.
const MOST_STEPS: f64 = (1u32 << 24) as f64;

/// Numbers of a texel.
fn channels(maps: &[PatchMap]) -> usize {
    maps.first().map_or(1, |m| m.channels)
}

/// True if there is something to round: floats whose digits are coarser than the step are as exact as they can be.
pub(super) fn is_coarse(maps: &[PatchMap], error: f64, file: MapFile) -> bool {
    let step = step_of(error, channels(maps), file);
    step >= f64::from(f32::MIN_POSITIVE) && super::most(maps) <= MOST_STEPS * step
}

/// The least error that 16-bit whole numbers keep everywhere.
pub(super) fn least_whole(maps: &[PatchMap]) -> f64 {
    let all = || maps.iter().flat_map(|m| &m.values).map(|&x| f64::from(x));
    let (low, high) = (all().fold(0.0, f64::min), all().fold(0.0, f64::max));
    // One step less: both ends are rounded outwards at worst.
    let step = (high - low) / f64::from(super::image::largest(16) - 1.0);
    step / 2.0 * (channels(maps) as f64).sqrt() / (1.0 - BOUND_ROOM)
}

/// Rounds maps so that no texel moves by more than `error`, units of the model.
pub(super) fn rounded(maps: &[PatchMap], error: f64, file: MapFile) -> Rounded {
    let step = step_of(error, channels(maps), file);
    let one = |map: &PatchMap| {
        let multiples = multiples(map, error / step, step);
        let range = multiples.iter().fold([0, 0], |[low, high], &k| [low.min(k), high.max(k)]);
        let values = multiples.iter().map(|&k| (k as f64 * step) as f32).collect();
        (PatchMap { values, ..*map }, range)
    };
    let (maps, ranges): (Vec<PatchMap>, Vec<[i64; 2]>) = maps.par_iter().map(one).unzip();
    let range = ranges.iter().fold([0, 0], |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    Rounded { maps, step, range }
}

/// The step whose nearest multiples are at most `error` from any vector of `channels` numbers. Floats get a power of two: its
/// multiples are exact in few bits and end in zeros, which compress.
fn step_of(error: f64, channels: usize, file: MapFile) -> f64 {
    let most = 2.0 * error / (channels as f64).sqrt();
    if file.is_whole() {
        return most * (1.0 - BOUND_ROOM);
    }
    most.log2().floor().exp2()
}

/// The multiples of a map, row by row as there; `error` in steps.
fn multiples(map: &PatchMap, error: f64, step: f64) -> Vec<i64> {
    let PatchMap { rows, cols, channels, .. } = *map;
    // Rows from above, as they stand in the image.
    let exact: Vec<f64> =
        map.values.chunks_exact(cols * channels).rev().flatten().map(|&x| f64::from(x) / step).collect();
    let mut plane = Plane { width: cols * channels, channels, at: exact.iter().map(|x| x.round() as i64).collect() };
    let within = (error * (1.0 - BOUND_ROOM)).powi(2);
    let mut choices = Choices::default();
    for sweep in 0..MOST_SWEEPS {
        let mut changed = false;
        for y in 1..rows - 1 {
            for x in 1..cols - 1 {
                let first = y * plane.width + x * channels;
                choices.list(&mut plane, &exact, (first, error), sweep > 0);
                if let Some(best) = choices.best(within) {
                    changed |= *best != plane.at[first..first + channels];
                    plane.at[first..first + channels].copy_from_slice(best);
                }
            }
        }
        if !changed {
            break;
        }
    }
    plane.at.chunks_exact(cols * channels).rev().flatten().copied().collect()
}

/// Numbers of an image, row by row, with those of a texel beside one another.
struct Plane {
    width: usize,
    channels: usize,
    at: Vec<i64>,
}

impl Plane {
    /// How far the number `k`, neither in the first row nor first of its row, is from what those to the left and above predict.
    fn surprise(&self, k: usize) -> i64 {
        let (left, up) = (self.at[k - self.channels], self.at[k - self.width]);
        let both = self.at[k - self.width - self.channels];
        (self.at[k] - paeth(left, up, both)).abs()
    }

    /// The surprises that a number inside the map has a part in: its own and, if they are set `ahead`, those to the right and
    /// below.
    fn surprises(&self, k: usize, ahead: bool) -> i64 {
        if !ahead {
            return self.surprise(k);
        }
        let (right, down) = (self.channels, self.width);
        [k, k + right, k + down, k + down + right].into_iter().map(|k| self.surprise(k)).sum()
    }
}

/// The multiples that the numbers of one texel may be.
#[derive(Default)]
struct Choices {
    /// Per channel: a multiple, its squared distance in steps, and its surprises.
    each: Vec<Vec<(i64, f64, i64)>>,
    best: Vec<i64>,
}

impl Choices {
    /// Lists all within `error` steps, channel by channel.
    fn list(&mut self, plane: &mut Plane, exact: &[f64], (first, error): (usize, f64), ahead: bool) {
        self.each.resize(plane.channels, Vec::new());
        for (c, list) in self.each.iter_mut().enumerate() {
            list.clear();
            let (k, x) = (first + c, exact[first + c]);
            let was = plane.at[k];
            for multiple in (x - error).ceil() as i64..=(x + error).floor() as i64 {
                plane.at[k] = multiple;
                list.push((multiple, (multiple as f64 - x).powi(2), plane.surprises(k, ahead)));
            }
            plane.at[k] = was;
        }
    }

    /// Of those at most `within` (squared) away the one of least surprise; of several the nearest.
    fn best(&mut self, within: f64) -> Option<&[i64]> {
        let mut found: Option<(i64, f64, usize)> = None;
        let all: usize = self.each.iter().map(Vec::len).product();
        for number in 0..all {
            let (mut rest, mut far, mut surprise) = (number, 0.0, 0);
            for list in &self.each {
                let (_, d, s) = list[rest % list.len()];
                rest /= list.len();
                far += d;
                surprise += s;
            }
            let better = |&(least, nearest, _): &(i64, f64, usize)| (surprise, far) < (least, nearest);
            if far <= within && found.as_ref().is_none_or(better) {
                found = Some((surprise, far, number));
            }
        }
        let (_, _, number) = found?;
        let mut rest = number;
        self.best.clear();
        for list in &self.each {
            self.best.push(list[rest % list.len()].0);
            rest /= list.len();
        }
        Some(&self.best)
    }
}
