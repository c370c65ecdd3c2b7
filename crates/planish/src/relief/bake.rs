//! From a grid and its surface to a relief, and back.

use super::{Relief, ReliefError, frames};
use crate::grid::Grid;
use crate::surface::Surface;
use crate::surface::basis::uniform_parameters;
use glam::DVec3;

/// The relief of `grid` over `surface`: `P - S` at every node, in the frame of the surface there.
///
/// # Errors
/// [`ReliefError::Shape`] if the grid's points are not `rows * cols`.
///
/// Source: [K98] §7.2, eq. 7.1 with an orthonormal frame.
pub fn bake(grid: &Grid, surface: &Surface) -> Result<Relief, ReliefError> {
    let Grid { rows, cols, ref points, .. } = *grid;
    check(rows, cols, points.len())?;
    let base = surface.sample(&uniform_parameters(cols), &uniform_parameters(rows), [0, 0]);
    let vectors = frames(surface, rows, cols)
        .iter()
        .zip(points.iter().zip(&base))
        .map(|(frame, (&p, &s))| frame.local_from_world(p - s))
        .collect();
    Ok(Relief { rows, cols, vectors })
}

/// The displaced nodes: the grid that the relief was baked from, to rounding.
///
/// # Errors
/// [`ReliefError::Shape`] if the relief's vectors are not `rows * cols`.
///
/// Source: [K98] §7.1.
pub fn displace(surface: &Surface, relief: &Relief) -> Result<Vec<DVec3>, ReliefError> {
    let Relief { rows, cols, ref vectors } = *relief;
    check(rows, cols, vectors.len())?;
    let mut points = surface.sample(&uniform_parameters(cols), &uniform_parameters(rows), [0, 0]);
    for ((p, frame), &vector) in points.iter_mut().zip(frames(surface, rows, cols)).zip(vectors) {
        *p += frame.world_from_local(vector);
    }
    Ok(points)
}

pub(super) fn check(rows: usize, cols: usize, found: usize) -> Result<(), ReliefError> {
    if rows < 2 || cols < 2 || found != rows * cols {
        return Err(ReliefError::Shape { patch: 0, rows, cols, found });
    }
    Ok(())
}
