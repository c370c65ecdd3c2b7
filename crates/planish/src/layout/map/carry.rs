//! An injective map is carried over to other places of its corners without losing that.
//!
//! What is held moves in a straight line, and with it the whole map by the smoothest shift there is. A step ends where a
//! face would lose most of its area; then the barrier energy spreads the strain before the next one. So cones and lines get
//! to whole numbers from an injective map, and no face ever turns over: to turn it back could wind it around a vertex.

use super::energy::Maps;
use super::seams::Seams;
use crate::observe::{Cancelled, Observer};
use planish_sparse::SparseCholesky;

/// Part of its area that every face keeps in one step, as interior-point methods keep from their bounds.
const KEPT: f64 = 0.2;

/// The map is stuck if so small a part of the way is too far.
const LEAST_STEP: f64 = 1.0 / 256.0;

/// Lowers the barrier energy of the map with these equations, by its free unknowns.
pub(super) type Settle<'a> = dyn Fn(&Seams, &mut Vec<f64>) -> Result<(), Cancelled> + 'a;

/// Where a map got to.
pub(super) enum Carried {
    /// Where it was to go: its free unknowns.
    There(Vec<f64>),
    /// Nowhere: these faces would lose all of their area.
    Stuck(Vec<u32>),
}

/// The free unknowns of an injective map with the equations of `maps`, from one with those of `start`.
/// * `settle` - lowers the barrier energy with given equations
pub(super) fn carry(
    maps: &Maps,
    laplacian: &SparseCholesky,
    (start, mut free): (&Seams, Vec<f64>),
    settle: &Settle,
    observer: &dyn Observer,
) -> Result<Carried, Cancelled> {
    let shift = maps.shift(laplacian, &start.moved(maps.seams));
    let (mut way, mut step) = (0.0, 1.0);
    settle(start, &mut free)?;
    while way < 1.0 {
        observer.check()?;
        let before = start.between(maps.seams, way).coordinates(&free);
        step = f64::min(2.0 * step, 1.0 - way);
        let (seams, moved) = loop {
            let seams = start.between(maps.seams, way + step);
            let moved: Vec<f64> = free.iter().zip(&shift).map(|(x, s)| x + step * s).collect();
            let lost = maps.losing(&before, &seams.coordinates(&moved), KEPT);
            if lost.is_empty() {
                break (seams, moved);
            }
            step /= 2.0;
            if step < LEAST_STEP {
                return Ok(Carried::Stuck(lost));
            }
        };
        (free, way) = (moved, if step == 1.0 - way { 1.0 } else { way + step });
        settle(&seams, &mut free)?;
    }
    Ok(Carried::There(free))
}
