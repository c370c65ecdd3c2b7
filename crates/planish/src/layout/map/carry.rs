//! An injective map is carried over to other places of its corners without losing that.
//!
//! What is held moves in a straight line, and all that is free follows so that the barrier energy stays least: its second
//! derivatives say how ([`super::newton`]). A step ends where a face would lose most of its area; then steps of Newton's
//! method spread the strain before the next one. So cones and lines get to whole numbers from an injective map, and no face
//! ever turns over: to turn it back could wind it around a vertex. (Continuation by predictor and corrector: Allgower and
//! Georg, *Numerical Continuation Methods*, 1990, chapter 2.)

use super::energy::Maps;
use super::newton::Newton;
use super::seams::Seams;
use super::untangle::{dot, fall};
use crate::observe::{Cancelled, Observer};

/// Part of its area that every face keeps in one step, as interior-point methods keep from their bounds.
const KEPT: f64 = 0.2;

/// The map is stuck if so small a part of the way is too far.
const LEAST_STEP: f64 = 1.0 / 256.0;

/// Steps of Newton's method at one place of the way at most; most places of the measured maps took one, the worst eleven.
const MOST_CORRECTIONS: usize = 12;

/// Newton's method has settled once no face has more than so many times the area that it had before a step. Chosen: a face may
/// then lose four fifths in the next step.
const GAINED: f64 = 1.5;

/// Where a map got to.
pub(super) enum Carried {
    /// Where it was to go: its free unknowns.
    There(Vec<f64>),
    /// Nowhere: these faces would lose all of their area.
    Stuck(Vec<u32>),
}

/// The free unknowns of an injective map with the equations of `maps`, from one with those of `start`.
pub(super) fn carry(
    maps: &Maps,
    (start, mut free): (&Seams, Vec<f64>),
    observer: &dyn Observer,
) -> Result<Carried, Cancelled> {
    let Some(newton) = Newton::new(maps, observer)? else { return Ok(Carried::Stuck(Vec::new())) };
    let moved = start.moved(maps.seams);
    let (mut way, mut step) = (0.0, 1.0);
    while way < 1.0 {
        let seams = start.between(maps.seams, way);
        let (mut corrections, mut is_settled) = (0, false);
        let (before, follow) = loop {
            observer.check()?;
            let x = seams.coordinates(&free);
            let Some(hessian) = newton.at(&x, observer)? else { return Ok(Carried::Stuck(Vec::new())) };
            if is_settled || corrections == MOST_CORRECTIONS || maps.is_spent() {
                break (x, hessian.following(&moved));
            }
            corrections += 1;
            let (energy, gradient) = maps.barrier(&x, 0.0);
            let correction = hessian.step(&gradient);
            let evaluate = |free: &[f64]| maps.barrier(&seams.coordinates(free), 0.0);
            let taken = fall(&evaluate, &free, &correction, (energy, dot(&correction, &gradient)));
            is_settled = taken.is_none_or(|taken| {
                free = taken.free;
                taken.length == 1.0 && maps.growth(&x, &seams.coordinates(&free)).iter().all(|g| *g <= GAINED)
            });
        };
        step = f64::min(2.0 * step, 1.0 - way);
        loop {
            let ahead: Vec<f64> = free.iter().zip(&follow).map(|(x, s)| x + step * s).collect();
            let growth = maps.growth(&before, &start.between(maps.seams, way + step).coordinates(&ahead));
            let keeps = |f: u32| growth[f as usize] > KEPT;
            let lost: Vec<u32> = (0..growth.len() as u32).filter(|&f| !keeps(f)).collect();
            if lost.is_empty() {
                (free, way) = (ahead, if step == 1.0 - way { 1.0 } else { way + step });
                break;
            }
            step /= 2.0;
            if step < LEAST_STEP {
                return Ok(Carried::Stuck(lost));
            }
        }
    }
    Ok(Carried::There(free))
}
