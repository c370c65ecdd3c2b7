//! A relief in bands of wavelengths that sum exactly.
//!
//! Displacements are rounded to multiples of one small power of two first; sums and differences of such numbers have no
//! rounding of their own, so that the bands sum to the relief to the bit, in any order.

use super::super::frame::at_nodes;
use super::super::resample::world_vectors;
use super::super::{Displaced, Relief, ReliefError};
use super::filter::Filter;
use crate::observe::Observer;
use glam::DVec3;
use rayon::prelude::*;

/// Binary digits of the largest displacement: sums of a few thousand layers still fit the 53 of a number.
const DIGITS: i32 = 40;

/// A band.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// It holds what is shorter than this, if there is a bound.
    pub below: Option<f64>,
    /// It holds what is longer than this, if there is a bound.
    pub above: Option<f64>,
    /// Its displacements.
    pub maps: Vec<Relief>,
    /// Root mean square of its displacement over the surface.
    pub rms: f64,
}

/// Splits reliefs at wavelengths (units of the model, any order); the band of the longest waves comes first.
///
/// # Errors
/// [`ReliefError`] if the parts do not fit together; [`ReliefError::Cancelled`].
pub fn split(displaced: &Displaced, wavelengths: &[f64], observer: &dyn Observer) -> Result<Vec<Band>, ReliefError> {
    displaced.check()?;
    let Displaced { network, surfaces, reliefs } = *displaced;
    let shapes: Vec<[usize; 2]> = reliefs.iter().map(|r| [r.rows, r.cols]).collect();
    let filter = Filter::new(network, surfaces, &shapes, observer)?;
    let world: Vec<Vec<DVec3>> = surfaces.par_iter().zip(reliefs).map(|(s, r)| world_vectors(s, r)).collect();
    let whole = filter.base.gather(&world);
    let mut cuts = wavelengths.to_vec();
    cuts.sort_by(|a, b| b.total_cmp(a));
    cuts.dedup();
    let step = step_of(reliefs);
    let mut bands: Vec<Band> = Vec::with_capacity(cuts.len() + 1);
    let mut rest: Vec<Relief> = reliefs.iter().map(|r| rounded(r, step)).collect();
    let mut below = None;
    let mut passed = vec![DVec3::ZERO; whole.len()];
    for &cut in &cuts {
        let longer = filter.low_pass(&whole, cut, observer)?;
        let band: Vec<DVec3> = longer.iter().zip(&passed).map(|(a, b)| *a - *b).collect();
        let local = |(s, (mut vectors, &[rows, cols])): (&crate::surface::Surface, (Vec<DVec3>, &[usize; 2]))| {
            at_nodes(s, rows, cols, &mut vectors, |d, _, frame| *d = frame.local_from_world(*d));
            rounded(&Relief { rows, cols, vectors }, step)
        };
        let nodes = filter.base.scatter(&band);
        let maps: Vec<Relief> = surfaces.par_iter().zip(nodes.into_par_iter().zip(&shapes)).map(local).collect();
        for (rest, map) in rest.iter_mut().zip(&maps) {
            rest.vectors.iter_mut().zip(&map.vectors).for_each(|(a, b)| *a -= *b);
        }
        bands.push(Band { below, above: Some(cut), rms: filter.rms(&band), maps });
        (below, passed) = (Some(cut), longer);
    }
    let left: Vec<DVec3> = whole.iter().zip(&passed).map(|(a, b)| *a - *b).collect();
    bands.push(Band { below, above: None, rms: filter.rms(&left), maps: rest });
    Ok(bands)
}

/// The power of two that displacements are rounded to.
fn step_of(reliefs: &[Relief]) -> f64 {
    let most = reliefs.iter().flat_map(|r| &r.vectors).map(|d| d.abs().max_element()).fold(0.0, f64::max);
    if most > 0.0 { (most.log2().ceil() - DIGITS as f64).exp2() } else { 0.0 }
}

fn rounded(relief: &Relief, step: f64) -> Relief {
    let round = |d: &DVec3| if step > 0.0 { (*d / step).round() * step } else { *d };
    Relief { vectors: relief.vectors.iter().map(round).collect(), ..*relief }
}
