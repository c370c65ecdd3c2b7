//! Displacements at the texels of a map, and maps of one number.

use super::super::Relief;
use super::super::frame::at_nodes;
use super::super::resample::{spread, world_vectors};
use super::PatchMap;
use crate::surface::Surface;
use glam::DVec3;

/// A map of one number per texel.
pub(super) fn scalars([rows, cols]: [usize; 2], numbers: impl Iterator<Item = f64>) -> PatchMap {
    PatchMap { rows, cols, channels: 1, values: numbers.map(|x| x as f32).collect() }
}

/// Displacements `(t, b, n)` at another shape.
pub(super) fn local(surface: &Surface, relief: &Relief, shape: [usize; 2]) -> Vec<DVec3> {
    let own = [relief.rows, relief.cols];
    if own == shape {
        return relief.vectors.clone();
    }
    let mut fine = spread(&world_vectors(surface, relief), own, shape);
    at_nodes(surface, shape[0], shape[1], &mut fine, |d, _, frame| *d = frame.local_from_world(*d));
    fine
}
