//! The form without its short waves: [K98] §7.5, where a fit to the smoothed grid is what a user expects of one.

use super::ReliefError;
use super::layers::Filter;
use crate::grid::Grid;
use crate::network::Network;
use crate::observe::Observer;
use crate::surface::Surface;
use crate::surface::basis::uniform_parameters;
use glam::DVec3;
use rayon::prelude::*;

/// The grids with only the waves that `first` has and those longer than `wavelength` of the rest.
///
/// * `first` - surfaces too stiff for shorter waves
///
/// # Errors
/// As [`super::surface_patches`]; [`ReliefError::Cancelled`].
pub fn long_waves(
    network: &Network,
    grids: &[Grid],
    first: &[Surface],
    wavelength: f64,
    observer: &dyn Observer,
) -> Result<Vec<Grid>, ReliefError> {
    let shapes: Vec<[usize; 2]> = grids.iter().map(|g| [g.rows, g.cols]).collect();
    let filter = Filter::new(network, first, &shapes, observer)?;
    let stiff = |(s, g): (&Surface, &Grid)| s.sample(&uniform_parameters(g.cols), &uniform_parameters(g.rows), [0, 0]);
    let stiff: Vec<Vec<DVec3>> = first.par_iter().zip(grids).map(stiff).collect();
    let rest: Vec<Vec<DVec3>> =
        stiff.iter().zip(grids).map(|(s, g)| g.points.iter().zip(s).map(|(p, s)| *p - *s).collect()).collect();
    let long = filter.scatter(&filter.low_pass(&filter.gather(&rest), wavelength, observer)?);
    let one = |((grid, stiff), long): ((&Grid, &Vec<DVec3>), &Vec<DVec3>)| Grid {
        points: stiff.iter().zip(long).map(|(s, d)| *s + *d).collect(),
        ..grid.clone()
    };
    Ok(grids.iter().zip(&stiff).zip(&long).map(one).collect())
}
