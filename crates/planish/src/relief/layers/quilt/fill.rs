//! Blocks of an image laid over an open canvas, each where it fits best what is there: [EF01], joined as in [K03].
//!
//! Departs from [K03], whose colours hide a step at a cut that light on a surface shows: cuts keep away from the borders of the
//! overlap, and the two sides fade into each other around them.

use super::super::region::fade;
use super::canvas::{Canvas, Pixel};
use super::cut::{Cell, old_side};
use crate::geom::random;
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;

/// Places of the image that are compared first, about.
const PLACES: f64 = 2000.0;
/// Pixels that two blocks are compared at, at most, about.
const COMPARED: usize = 1024;
/// Places whose surroundings are looked through.
const BEST: usize = 12;
/// Blocks that fit by a tenth less well than the best are as good ([EF01] §2.1); of squares.
const AS_GOOD: f64 = 1.21;
/// Steps of the largest cost of a cut.
const COST_STEPS: f64 = 1e4;
/// How far from a cut the two sides fade into each other, and how near it comes to the borders of an overlap; share of the overlap.
const SOFT: f64 = 0.25;

/// A block on the canvas.
struct Block {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
}

/// Fills a canvas.
/// * `block` - pixels along a side of a block, at most those of the image; neighbours share the canvas's margin
/// * `seed` - of the choice among places that fit equally well
pub(super) fn fill(
    canvas: &mut Canvas,
    image: &Canvas,
    block: usize,
    seed: u64,
    observer: &dyn Observer,
) -> Result<(), Cancelled> {
    let step = (block - canvas.margin).max(1);
    let starts = |n: usize| {
        let size = block.min(n);
        let count = (n - size).div_ceil(step) + 1;
        (0..count).map(|k| (k * step).min(n - size)).collect::<Vec<usize>>()
    };
    let (width, height) = (block.min(canvas.width), block.min(canvas.height));
    let mut number = 0;
    for y in starts(canvas.height) {
        observer.check()?;
        for x in starts(canvas.width) {
            number += 1;
            let block = Block { x, y, width, height };
            let known: Vec<usize> =
                (0..width * height).filter(|&k| canvas.known[at(canvas, &block, k)] != Pixel::Open).collect();
            if known.len() < width * height {
                let place = choose(canvas, image, &block, &known, random::bits(seed, number));
                lay(canvas, image, &block, place);
            }
        }
    }
    Ok(())
}

/// Index on the canvas of a pixel of a block.
fn at(canvas: &Canvas, block: &Block, k: usize) -> usize {
    (block.y + k / block.width) * canvas.width + block.x + k % block.width
}

/// Index in the image of a pixel of a block that lies at a place of it.
fn from(image: &Canvas, block: &Block, [x, y]: [usize; 2], k: usize) -> usize {
    (y + k / block.width) * image.width + x + k % block.width
}

/// Where in the image a block is taken from: any of the places that fit what is known almost as well as the best.
fn choose(canvas: &Canvas, image: &Canvas, block: &Block, known: &[usize], draw: u64) -> [usize; 2] {
    let room = [image.width - block.width, image.height - block.height];
    let any = |salt: u64, n: usize| (random::unit(draw, salt) * (n + 1) as f64) as usize;
    if known.is_empty() {
        return [any(0, room[0]), any(1, room[1])];
    }
    // One of each few, not every n-th: those would lie on lines if n divided the width.
    let few = known.chunks(known.len().div_ceil(COMPARED)).enumerate();
    let sparse: Vec<usize> = few.map(|(k, few)| few[any(5 + k as u64, few.len() - 1).min(few.len() - 1)]).collect();
    let misfit = |place: [usize; 2]| {
        let far = |&k: &usize| {
            image.values[from(image, block, place, k)].distance_squared(canvas.values[at(canvas, block, k)])
        };
        sparse.iter().map(far).sum::<f64>()
    };
    let stride = (((room[0] + 1) * (room[1] + 1)) as f64 / PLACES).sqrt().ceil().max(1.0) as usize;
    let first = [any(2, (stride - 1).min(room[0])), any(3, (stride - 1).min(room[1]))];
    let places: Vec<[usize; 2]> = (first[1]..=room[1])
        .step_by(stride)
        .flat_map(|y| (first[0]..=room[0]).step_by(stride).map(move |x| [x, y]))
        .collect();
    let mut rated: Vec<(f64, [usize; 2])> = places.par_iter().map(|&p| (misfit(p), p)).collect();
    let order = |a: &(f64, [usize; 2]), b: &(f64, [usize; 2])| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
    rated.sort_by(order);
    rated.truncate(BEST);
    let around = |&(_, [x, y]): &(f64, [usize; 2])| {
        let range = |at: usize, room: usize| at.saturating_sub(stride - 1)..=(at + stride - 1).min(room);
        let near = range(y, room[1]).flat_map(|y| range(x, room[0]).map(move |x| [x, y]));
        near.map(|p| (misfit(p), p)).min_by(order)
    };
    let mut best: Vec<(f64, [usize; 2])> = rated.par_iter().filter_map(around).collect();
    best.sort_by(order);
    best.dedup();
    let good = best.iter().take_while(|b| b.0 <= best[0].0 * AS_GOOD).count();
    best[any(4, good - 1).min(good - 1)].1
}

/// Lays a block and cuts it to what is there where the two are most alike.
///
/// Source: [K03] §3, eq. 1, with pixels that stay.
fn lay(canvas: &mut Canvas, image: &Canvas, block: &Block, place: [usize; 2]) {
    let count = block.width * block.height;
    let here: Vec<usize> = (0..count).map(|k| at(canvas, block, k)).collect();
    let new: Vec<DVec3> = (0..count).map(|k| image.values[from(image, block, place, k)]).collect();
    let is_open = |k: usize| canvas.known[here[k]] == Pixel::Open;
    // Where the block ends within what is filled, what is there goes on.
    let ends = |k: usize| {
        let (x, y) = (k % block.width, k / block.width);
        let known = |is: bool, at: usize| is && canvas.known[at] != Pixel::Open;
        let (right, top) = (block.x + block.width, block.y + block.height);
        known(x == 0 && block.x > 0, here[k].wrapping_sub(1))
            || known(y == 0 && block.y > 0, here[k].wrapping_sub(canvas.width))
            || known(x + 1 == block.width && right < canvas.width, here[k] + 1)
            || known(y + 1 == block.height && top < canvas.height, here[k] + canvas.width)
    };
    let soft = (SOFT * canvas.margin as f64).max(1.0);
    let to_open = distances(block.width, (0..count).map(is_open));
    let to_old =
        distances(block.width, (0..count).map(|k| canvas.known[here[k]] == Pixel::Fixed || !is_open(k) && ends(k)));
    let cell = |k: usize| match canvas.known[here[k]] {
        Pixel::Open => Cell::Out,
        Pixel::Fixed => Cell::Old,
        Pixel::Filled if to_open[k] <= soft && to_open[k] <= to_old[k] => Cell::New,
        Pixel::Filled if to_old[k] <= soft => Cell::Old,
        Pixel::Filled => Cell::Free,
    };
    let cells: Vec<Cell> = (0..count).map(cell).collect();
    let far: Vec<f64> =
        (0..count).map(|k| if is_open(k) { 0.0 } else { new[k].distance(canvas.values[here[k]]) }).collect();
    let most = far.iter().copied().fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    // One more, so that of equal cuts the shortest is taken.
    let cost = |a: usize, b: usize| 1 + ((far[a] + far[b]) / most * COST_STEPS) as u64;
    let old = old_side(block.width, &cells, cost);
    let stays = |k: usize| cells[k] != Cell::Out && old[k];
    let to_new = distances(block.width, (0..count).map(|k| !stays(k)));
    let to_staying = distances(block.width, (0..count).map(stays));
    let share = |k: usize| {
        let beyond = if stays(k) { 0.5 - to_new[k] } else { to_staying[k] - 0.5 };
        if is_open(k) { 1.0 } else { fade(beyond + soft, 2.0 * soft) }
    };
    let shares: Vec<f64> = (0..count).map(share).collect();
    for k in (0..count).filter(|&k| shares[k] > 0.0 && cells[k] != Cell::Old) {
        canvas.values[here[k]] = canvas.values[here[k]].lerp(new[k], shares[k]);
        canvas.known[here[k]] = Pixel::Filled;
    }
}

/// For each pixel of a block the way to the nearest that is one of those, in pixels; infinite if none is.
///
/// Source: Borgefors, *Distance Transformations in Digital Images*, CVGIP 34, 1986, with steps of 1 and the root of 2.
fn distances(width: usize, is: impl Iterator<Item = bool>) -> Vec<f64> {
    let mut far: Vec<f64> = is.map(|is| if is { 0.0 } else { f64::INFINITY }).collect();
    let across = std::f64::consts::SQRT_2;
    for _ in 0..2 {
        for k in 0..far.len() {
            let (x, first) = (k % width, k < width);
            let before = [
                (x > 0, 1, 1.0),
                (!first, width, 1.0),
                (!first && x > 0, width + 1, across),
                (!first && x + 1 < width, width - 1, across),
            ];
            for (_, back, step) in before.into_iter().filter(|b| b.0) {
                far[k] = far[k].min(far[k - back] + step);
            }
        }
        // The second time from the last pixel to the first, and turned round again.
        far.reverse();
    }
    far
}
