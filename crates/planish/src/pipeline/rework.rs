//! A model whose curves were edited: everything that follows from them made anew, or only what the edit has changed.
//!
//! Grids of patches whose curves have moved follow them ([`grid::follow`]), and only these patches are cut out of the mesh
//! ([`network::reimprint`]). Surfaces and seams are those of the whole network: a tolerance deals its control points out over
//! whole chords of patches.

use super::record::Clock;
use super::{Assessed, PipelineError, PipelineObserver, PipelineParams, StageRecord, WEIGHTS, quality, surfaces};
use crate::grid::{self, Grid, GridError, GridParams};
use crate::mend::Repairs;
use crate::mesh::{Adjacency, TriMesh};
use crate::model::{Model, Sketch};
use crate::network::{self, Network, PatchMesh};
use crate::observe::Observer;
use rayon::prelude::*;
use std::sync::Arc;

/// What a model was before an edit, as far as its grids can be made from it.
#[derive(Clone, Debug)]
pub struct Earlier {
    network: Network,
    grids: Vec<Grid>,
    sketch: Sketch,
    /// Faces of the mesh under each patch; nothing where they are not known.
    covered: Vec<Arc<[u32]>>,
}

impl Earlier {
    /// The state of a model with grids; nothing for one without.
    pub fn of(model: &Model) -> Option<Earlier> {
        let Model { network, grids, sketch, .. } = model;
        let covered = Vec::new();
        let (network, sketch) = (network.clone(), sketch.clone());
        (!grids.is_empty()).then(|| Earlier { network, grids: grids.clone(), sketch, covered })
    }

    /// Patches of an edited model whose curves have moved; nothing where its grids cannot follow these.
    fn changed(&self, model: &Model) -> Option<Vec<usize>> {
        let drawn = |s: &Sketch| !s.features.is_empty() || !s.sections.is_empty();
        let which = network::changed_patches(&self.network, &model.network)?;
        let follows = !drawn(&self.sketch) && !drawn(&model.sketch) && self.grids.len() == model.network.patches.len();
        follows.then_some(which)
    }
}

/// Makes grids, surfaces, seams and reliefs of a model whose network or feature curves were edited, and measures it.
///
/// * `earlier` - the model before the edit, made with the same grid parameters. Where the edit moved a few curves and nothing
///   else, grids of the patches beside them follow ([`grid::follow`]) and all others are kept; if one that followed is folded
///   or misses its patch by more than is allowed, all are made from nothing, as they are with `None`.
///
/// On an error the model is what it was.
/// # Errors
/// As [`fit`]; the network must part the whole mesh into four-sided patches.
pub fn rework(
    model: &mut Model,
    earlier: Option<&Earlier>,
    params: &PipelineParams,
    observer: &dyn PipelineObserver,
) -> Result<Assessed, PipelineError> {
    let mut clock = Clock::new(observer, &WEIGHTS);
    let measured = or_as_before(model, |model| {
        let (patches, _) = remade(model, earlier, params, &mut clock)?;
        let repairs = Repairs::default();
        clock.stage("measure", |o| quality::measure(model, &patches, &repairs, o), |m| [("seams", m.seams.len())])
    })?;
    let quality::Measured { quality, seams, warnings } = measured;
    Ok(Assessed { stages: clock.records, quality, seams, warnings })
}

/// Stages of [`WEIGHTS`] before the measuring.
const STAGES: usize = WEIGHTS.len() - 1;

/// What [`remake`] makes beside the model.
#[derive(Clone, Debug)]
pub struct Remade {
    /// The stages that ran.
    pub stages: Vec<StageRecord>,
    /// The model as it is now, for the next edit.
    pub earlier: Option<Earlier>,
}

/// As [`rework`] without measures, which take longest: for surfaces that are to follow a hand. [`assess`] measures afterwards,
/// and finds what [`rework`] would have told, to the bit; the model is the same to the bit, too.
///
/// * `adjacency` - of the mesh of the model
/// * `earlier` - what this made last: then only patches with moved curves are cut out of the mesh
///
/// On an error the model is what it was.
/// # Errors
/// As [`rework`].
pub fn remake(
    model: &mut Model,
    adjacency: &Adjacency,
    earlier: Option<&Earlier>,
    params: &PipelineParams,
    observer: &dyn PipelineObserver,
) -> Result<Remade, PipelineError> {
    let mut clock = Clock::new(observer, &WEIGHTS[..STAGES]);
    let covered = or_as_before(model, |model| match earlier {
        Some(earlier) if earlier.covered.len() == earlier.grids.len() => {
            match followed_alone(model, adjacency, earlier, params, &mut clock)? {
                Some(covered) => surfaces(model, params, &mut clock).map(|()| covered),
                None => remade(model, None, params, &mut clock).map(|made| made.1),
            }
        }
        earlier => remade(model, earlier, params, &mut clock).map(|made| made.1),
    })?;
    let earlier = Earlier::of(model).map(|earlier| Earlier { covered, ..earlier });
    Ok(Remade { stages: clock.records, earlier })
}

/// Runs `make`; on an error the model gets its grids, surfaces and reliefs back.
fn or_as_before<T>(
    model: &mut Model,
    make: impl FnOnce(&mut Model) -> Result<T, PipelineError>,
) -> Result<T, PipelineError> {
    let before =
        (std::mem::take(&mut model.grids), std::mem::take(&mut model.surfaces), std::mem::take(&mut model.reliefs));
    let made = make(model);
    if made.is_err() {
        (model.grids, model.surfaces, model.reliefs) = before;
    }
    made
}

/// Faces under each patch.
type Covered = Vec<Arc<[u32]>>;

fn covered(patch: &PatchMesh) -> Arc<[u32]> {
    let mut faces = patch.face_origin.clone();
    faces.sort_unstable();
    faces.dedup();
    faces.into()
}

fn remade(
    model: &mut Model,
    earlier: Option<&Earlier>,
    params: &PipelineParams,
    clock: &mut Clock,
) -> Result<(Vec<PatchMesh>, Covered), PipelineError> {
    let (mesh, network) = (&model.mesh, &model.network);
    let patches = clock.stage("imprint", |o| network::imprint(mesh, network, o), |p| [("patches", p.len())])?;
    let drawn = (&model.sketch.features[..], &model.sketch.sections[..]);
    model.grids = clock.stage(
        "grids",
        |o| -> Result<_, PipelineError> {
            if let Some(earlier) = earlier
                && let Some(which) = earlier.changed(model)
            {
                let some: Vec<PatchMesh> = which.iter().map(|&p| patches[p].clone()).collect();
                if let Some(grids) = followed(mesh, earlier, &which, &some, &params.grid, o)? {
                    return Ok(grids);
                }
            }
            super::resampled(None, (mesh, network, &patches), drawn, params, o)
        },
        |grids| [("points", grids.iter().map(|g| g.points.len()).sum())],
    )?;
    surfaces(model, params, clock)?;
    let covered = patches.iter().map(covered).collect();
    Ok((patches, covered))
}

/// Grids of an edited model, of which only the patches with moved curves are cut out of the mesh; nothing where all must be.
fn followed_alone(
    model: &mut Model,
    adjacency: &Adjacency,
    earlier: &Earlier,
    params: &PipelineParams,
    clock: &mut Clock,
) -> Result<Option<Covered>, PipelineError> {
    let Some(which) = earlier.changed(model) else { return Ok(None) };
    let (mesh, network) = (&model.mesh, &model.network);
    let some = clock.stage(
        "imprint",
        |o| {
            if which.is_empty() {
                return Ok(Vec::new());
            }
            let before: Vec<u32> = which.iter().flat_map(|&p| earlier.covered[p].iter().copied()).collect();
            network::reimprint_over(mesh, adjacency, network, &before, &which, o)
        },
        |p: &Vec<PatchMesh>| [("patches", p.len())],
    )?;
    let grids = clock.stage(
        "grids",
        |o| followed(mesh, earlier, &which, &some, &params.grid, o),
        |grids| [("points", grids.iter().flatten().map(|g| g.points.len()).sum())],
    )?;
    let Some(grids) = grids else { return Ok(None) };
    model.grids = grids;
    let mut all = earlier.covered.clone();
    which.into_iter().zip(&some).for_each(|(p, patch)| all[p] = covered(patch));
    Ok(Some(all))
}

/// Grids of an edited model from those that it had; nothing where they must be made from nothing.
/// * `which`, `some` - the patches that the edit has changed, as they are now
fn followed(
    mesh: &TriMesh,
    earlier: &Earlier,
    which: &[usize],
    some: &[PatchMesh],
    params: &GridParams,
    observer: &dyn Observer,
) -> Result<Option<Vec<Grid>>, GridError> {
    let old: Vec<Grid> = which.iter().map(|&p| earlier.grids[p].clone()).collect();
    let made = grid::follow(mesh, some, &old, params, observer)?;
    let allowed = params.miss * mesh.bounds().diagonal();
    let is_good = |(grid, patch): (&Grid, &PatchMesh)| {
        let found = grid::measure(grid, patch);
        found.folds == 0 && found.miss_max * patch.mesh.bounds().diagonal() <= allowed
    };
    if !made.par_iter().zip(some).all(is_good) {
        return Ok(None);
    }
    let mut grids = earlier.grids.clone();
    which.iter().zip(made).for_each(|(&p, grid)| grids[p] = grid);
    Ok(Some(grids))
}
