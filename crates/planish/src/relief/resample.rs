//! Reliefs at other resolutions: the bilinear reconstruction of [K98] §7.2, of the world vectors.
//!
//! Interpolating the numbers of a map would turn the vectors with the frame, and the two sides of a seam would part
//! between the nodes. World vectors are the same on both sides, and shares in whole numbers are the same from both
//! ends of a curve.

use super::bake::check;
use super::frame::at_nodes;
use super::{Displaced, Relief, ReliefError};
use crate::surface::Surface;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::{Add, Div, Mul};

/// Where a sample lies between two nodes: the node before it and the shares of it and of the next, in whole numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Between {
    node: usize,
    shares: [f64; 2],
}

impl Between {
    /// Sample `i` of `samples` over `nodes` (each at least 2) from end to end.
    pub fn new(i: usize, samples: usize, nodes: usize) -> Between {
        let whole = samples - 1;
        let (node, part) = (i * (nodes - 1) / whole, i * (nodes - 1) % whole);
        if part == 0 {
            return Between { node, shares: [1.0, 0.0] };
        }
        Between { node, shares: [(whole - part) as f64, part as f64] }
    }

    /// The value there; `at` gives those of the nodes.
    pub fn value<T>(&self, at: impl Fn(usize) -> T) -> T
    where
        T: Add<Output = T> + Mul<f64, Output = T> + Div<f64, Output = T>,
    {
        let [a, b] = self.shares;
        if b == 0.0 { at(self.node) } else { (at(self.node) * a + at(self.node + 1) * b) / (a + b) }
    }
}

/// The bilinear interpolation of `rows x cols` values at `[rows, cols]` of `shape`.
pub(super) fn spread<T>(values: &[T], [rows, cols]: [usize; 2], shape: [usize; 2]) -> Vec<T>
where
    T: Copy + Send + Sync + Add<Output = T> + Mul<f64, Output = T> + Div<f64, Output = T>,
{
    if [rows, cols] == shape {
        return values.to_vec();
    }
    let across: Vec<Between> = (0..shape[1]).map(|i| Between::new(i, shape[1], cols)).collect();
    let row = |j: usize| {
        let up = Between::new(j, shape[0], rows);
        let narrow: Vec<T> = (0..cols).map(|i| up.value(|j| values[j * cols + i])).collect();
        across.iter().map(|b| b.value(|i| narrow[i])).collect::<Vec<T>>()
    };
    (0..shape[0]).into_par_iter().flat_map_iter(row).collect()
}

/// The displacements as world vectors.
pub(super) fn world_vectors(surface: &Surface, relief: &Relief) -> Vec<DVec3> {
    let mut out = relief.vectors.clone();
    at_nodes(surface, relief.rows, relief.cols, &mut out, |d, _, frame| *d = frame.world_from_local(*d));
    out
}

/// World vectors as a relief.
pub(super) fn from_world(surface: &Surface, [rows, cols]: [usize; 2], mut vectors: Vec<DVec3>) -> Relief {
    at_nodes(surface, rows, cols, &mut vectors, |d, _, frame| *d = frame.local_from_world(*d));
    Relief { rows, cols, vectors }
}

/// One relief at `shape` (`[rows, cols]`, each at least 2); at its own shape it is what it was, to the bit.
///
/// # Errors
/// [`ReliefError::Shape`], [`ReliefError::Surface`] if they are malformed.
pub fn resample(surface: &Surface, relief: &Relief, shape: [usize; 2]) -> Result<Relief, ReliefError> {
    check(relief.rows, relief.cols, relief.vectors.len())?;
    check(shape[0], shape[1], shape[0] * shape[1])?;
    surface.check()?;
    if [relief.rows, relief.cols] == shape {
        return Ok(relief.clone());
    }
    let world = world_vectors(surface, relief);
    Ok(from_world(surface, shape, spread(&world, [relief.rows, relief.cols], shape)))
}

/// All reliefs, each at its shape.
///
/// # Errors
/// As [`resample`], and [`ReliefError::Count`].
pub fn resample_all(displaced: &Displaced, shapes: &[[usize; 2]]) -> Result<Vec<Relief>, ReliefError> {
    let Displaced { network, surfaces, reliefs } = *displaced;
    displaced.check()?;
    if shapes.len() != network.patches.len() {
        return Err(ReliefError::Count { what: "shapes", found: shapes.len(), wanted: network.patches.len() });
    }
    surfaces.par_iter().zip(reliefs).zip(shapes).map(|((s, r), &shape)| resample(s, r, shape)).collect()
}
