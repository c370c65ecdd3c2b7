//! Networks tried before one is taken: surfaces over coarse grids, and where these fold.

use super::quality::{FOLDED_DEG, inner_angles_of};
use super::{PipelineError, PipelineParams};
use crate::grid::{self, GridParams};
use crate::layout::Trial;
use crate::mesh::TriMesh;
use crate::network::{self, Network};
use crate::observe::{Cancelled, Observer};
use crate::surface::{self, StitchParams};
use rayon::prelude::*;

/// Surfaces of the default parameters over grids of the least size.
pub(super) struct Coarse;

impl Trial for Coarse {
    fn folds(&self, mesh: &TriMesh, network: &Network, observer: &dyn Observer) -> Result<usize, Cancelled> {
        match folds(mesh, network, observer) {
            Err(e) if Cancelled::is_cause_of(&e) => Err(Cancelled),
            // Where surfaces cannot be made no patch is any good.
            found => Ok(found.unwrap_or(network.patches.len())),
        }
    }
}

fn folds(mesh: &TriMesh, network: &Network, observer: &dyn Observer) -> Result<usize, PipelineError> {
    let PipelineParams { grid, fit, stitch, .. } = PipelineParams::default();
    let least = GridParams { max_side: grid.min_side, ..grid };
    let patches = network::imprint(mesh, network, observer)?;
    let sizes = grid::choose_sizes(network, &patches, &least);
    let grids = grid::relax(mesh, &patches, &sizes, &least, observer)?;
    let cells: usize = grids.par_iter().zip(&patches).map(|(grid, patch)| grid::folds(grid, patch)).sum();
    let fitted = surface::fit_network(network, &grids, &fit, observer)?;
    let stitch = StitchParams { smoothing: fit.smoothing, tolerance: fit.rms_allowed(&grids), ..stitch };
    let surfaces = surface::stitch(network, &grids, &fitted, &stitch, observer)?;
    let mut angles = inner_angles_of(network, &surfaces, mesh.bounds().diagonal());
    angles.retain(|&curve, found| network.curves[curve as usize].kind.is_smooth() && found.0 > FOLDED_DEG);
    Ok(cells + angles.len())
}
