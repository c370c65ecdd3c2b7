//! From a grid and its surface to a relief, and back: [K98] §7.1 and 7.2, eq. 7.1 in an orthonormal frame.

use super::frame::at_nodes;
use super::{Relief, ReliefError};
use crate::grid::Grid;
use crate::observe::Observer;
use crate::surface::Surface;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The relief of `grid` over `surface`: `P - S` at every node, in the frame of the surface there.
///
/// # Errors
/// [`ReliefError::Shape`] if the grid's points are not `rows * cols`, [`ReliefError::Surface`] if the surface is
/// malformed.
///
/// Source: [K98] §7.2, eq. 7.1 with an orthonormal frame.
pub fn bake(grid: &Grid, surface: &Surface) -> Result<Relief, ReliefError> {
    let Grid { rows, cols, ref points, .. } = *grid;
    check(rows, cols, points.len())?;
    surface.check()?;
    let mut vectors = points.clone();
    at_nodes(surface, rows, cols, &mut vectors, |p, s, frame| *p = frame.local_from_world(*p - s));
    Ok(Relief { rows, cols, vectors })
}

/// The displaced nodes: the grid that the relief was baked from, to rounding.
///
/// # Errors
/// [`ReliefError::Shape`] if the relief's vectors are not `rows * cols`, [`ReliefError::Surface`] if the surface is malformed.
///
/// Source: [K98] §7.1.
pub fn displace(surface: &Surface, relief: &Relief) -> Result<Vec<DVec3>, ReliefError> {
    let Relief { rows, cols, ref vectors } = *relief;
    check(rows, cols, vectors.len())?;
    surface.check()?;
    let mut points = vectors.clone();
    at_nodes(surface, rows, cols, &mut points, |d, s, frame| *d = s + frame.world_from_local(*d));
    Ok(points)
}

/// The displacement maps of all patches, in their order ([`bake`]).
/// # Errors
/// The first that cannot be baked; [`ReliefError::Cancelled`].
pub fn bake_network(grids: &[Grid], surfaces: &[Surface], observer: &dyn Observer) -> Result<Vec<Relief>, ReliefError> {
    let done = AtomicUsize::new(0);
    let one = |(grid, surface): (&Grid, &Surface)| {
        observer.check()?;
        let relief = bake(grid, surface)?;
        observer.progress((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / grids.len() as f64);
        Ok(relief)
    };
    grids.par_iter().zip(surfaces).map(one).collect()
}

pub(super) fn check(rows: usize, cols: usize, found: usize) -> Result<(), ReliefError> {
    if rows < 2 || cols < 2 || found != rows * cols {
        return Err(ReliefError::Shape { patch: 0, rows, cols, found });
    }
    Ok(())
}
