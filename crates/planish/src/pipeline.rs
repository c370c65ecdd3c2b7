//! The whole way from a scan or a mesh to a model: the only room that knows the order of the stages.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, fig. 1.3: curves, grids, surfaces,
//! displacement maps; before it a mesh of the scan, its repair and an automatic network, after it the measuring.
//!
//! 1. [`run`], everything: a scan is meshed as [`mesh_scan`] does, its points are brought to the surface, and the parameters of
//!    what follows are those that suit its noise ([`params_for`])
//! 2. [`fit`], from a mesh on: repair, layout, imprint, grids, surfaces, seams, relief, measure. [`layout()`] stops at the
//!    network, for one that is edited before
//! 3. [`rework`], a model whose curves were edited: from the imprint on, or [`remake`] without the measuring; [`refit`], surfaces, seams and relief anew on the
//!    grids that are there; [`assess`], the measuring alone
//!
//! A [`PipelineObserver`] hears which stage runs and how far the run is, and may stop it; [`StageRecord`] keeps what each
//! took and made, [`Quality`] what came of it.

mod bricks;
mod deform;
mod hint;
pub mod key;
mod quality;
mod record;
mod rework;
mod scan;
mod sound;
mod trial;
mod truth;

pub use bricks::{
    BRICK_POINTS, BrickMesh, BrickPlan, BrickWelder, TakePoints, clean_brick, clean_bricks, mesh_bricks, mesh_planned,
    mesh_scan, project_bricks,
};
pub use deform::{Move, deform, join, matched, moved};
pub use quality::{
    FOLDED_DEG, displaced_mesh, displaced_patches, inner_angles, span_count, surface_mesh, surface_mesh_cut,
    surface_patches, worst_seams,
};
pub use record::{Figure, PipelineObserver, Quality, StageRecord, Warning};
pub use rework::{Earlier, Remade, remake, rework};
pub use scan::{
    ScanError, ScanFacts, ScanMeshed, ScanParams, field_of, mesh_samples, params_for, sample_figures, scan_figures,
    voxel_for,
};
pub use truth::{EdgesFound, Zone, edge_reach, edges_found, truth_figures, zone};

use crate::cloud::bricks::{BrickStore, CloudStore};
use crate::cloud::{self, Cloud, CloudError, PointFacts};
use crate::grid::{self, FeatureError, Grid, GridError, GridParams, Relaxer};
use crate::layout::{self, Known, Layout, LayoutError, LayoutParams};
use crate::mend::{self, MendParams, Repairs};
use crate::mesh::{CompareError, FeatureTags, MeshError, TriMesh, next};
use crate::model::Model;
use crate::network::{self, ImprintError, Network};
use crate::observe::{Cancelled, Observer, Part};
use crate::pipeline::record::Clock;
use crate::pipeline::scan::run_figures;
use crate::relief::{self, ReliefError};
use crate::surface::{self, Continuity, FitError, FitParams, KnotSpacing, SeamQuality, StitchParams};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of all stages.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PipelineParams {
    /// What is done to the mesh before.
    pub mend: MendParams,
    /// The automatic network.
    pub layout: LayoutParams,
    /// The grids.
    pub grid: GridParams,
    /// The surfaces.
    pub fit: FitParams,
    /// The seams between them.
    pub stitch: StitchParams,
}

/// What a run starts from.
pub enum Input<'a> {
    /// Points: they are cleaned and meshed first.
    Scan(&'a Cloud),
    /// Points in bricks, for what does not fit into memory.
    Bricks(&'a dyn BrickStore),
    /// A mesh.
    Mesh {
        /// Any triangle mesh; it is repaired first.
        mesh: &'a TriMesh,
        /// Its sharp edges where they are known: an automatic network follows them.
        tags: Option<&'a FeatureTags>,
        /// A network on the mesh as [`mend::repair`] leaves it; `None` for an automatic one.
        network: Option<Network>,
    },
}

impl<'a> From<&'a TriMesh> for Input<'a> {
    fn from(mesh: &'a TriMesh) -> Input<'a> {
        Input::Mesh { mesh, tags: None, network: None }
    }
}

/// Parameters of a run.
pub struct RunParams<'a> {
    /// How a scan is meshed.
    pub scan: ScanParams,
    /// Parameters of the stages after the mesh. The function is given those that suit the input (the noise of a scan has a
    /// say in them; for a mesh they are the defaults) with the diagonal of the mesh, and sets what is wanted otherwise.
    pub stages: Box<dyn Fn(PipelineParams, f64) -> PipelineParams + 'a>,
}

impl Default for RunParams<'_> {
    fn default() -> Self {
        RunParams { scan: ScanParams::default(), stages: Box::new(|suited, _| suited) }
    }
}

/// What [`run`] makes.
#[derive(Clone, Debug)]
pub struct Run {
    /// The model with its figures, those of the scan among them.
    pub fitted: Fitted,
    /// The parameters of the stages after the mesh.
    pub params: PipelineParams,
    /// What became of a scan.
    pub scan: Option<Scanned>,
}

/// A scan on its way to a model.
#[derive(Clone, Debug)]
pub struct Scanned {
    /// The samples and the mesh that was made of them.
    pub meshed: ScanMeshed,
    /// What is known of its points on their surface.
    pub points: PointFacts,
}

/// Everything, from a scan or a mesh to a model.
/// # Errors
/// The first stage that fails; [`Cancelled::is_cause_of`] tells one that was stopped.
pub fn run(input: Input, params: &RunParams, observer: &dyn PipelineObserver) -> Result<Run, PipelineError> {
    run_with_points(input, params, &mut |_, _| Ok(()), observer)
}

/// As [`run`], and gives the points of a scan on its surface to `take`: all at once, or brick by brick where it is worked so.
/// # Errors
/// As [`run`], or what `take` says.
pub fn run_with_points(
    input: Input,
    params: &RunParams,
    take: &mut TakePoints,
    observer: &dyn PipelineObserver,
) -> Result<Run, PipelineError> {
    let weights = [&SCAN_WEIGHTS[..], &WEIGHTS].concat();
    let mut clock = Clock::new(observer, &weights);
    let scanned = match input {
        Input::Mesh { mesh, tags, network } => {
            let params = (params.stages)(PipelineParams::default(), mesh.bounds().diagonal());
            let fitted = fit(mesh, tags, network, &params, observer)?;
            return Ok(Run { fitted, params, scan: None });
        }
        Input::Scan(cloud) if cloud.points.len() > BRICK_POINTS => {
            in_bricks(&CloudStore::new(cloud, BRICK_POINTS), &params.scan, take, &mut clock)?
        }
        Input::Scan(cloud) => in_one_piece(cloud, &params.scan, take, &mut clock)?,
        Input::Bricks(store) => in_bricks(store, &params.scan, take, &mut clock)?,
    };
    let extracted = &scanned.meshed.meshed.extracted;
    let params = (params.stages)(params_for(&scanned.meshed), extracted.mesh.bounds().diagonal());
    let mut fitted = fit_with(&extracted.mesh, Some(&extracted.tags), None, None, &params, &mut clock)?;
    // Outliers are no part of the shape: its size is that of the mesh.
    run_figures(&scanned.meshed, &scanned.points, extracted.mesh.bounds().diagonal(), &mut fitted);
    Ok(Run { fitted, params, scan: Some(scanned) })
}

/// The mesh of a scan in one piece, and its points on the surface.
fn in_one_piece(
    cloud: &Cloud,
    params: &ScanParams,
    take: &mut TakePoints,
    clock: &mut Clock,
) -> Result<Scanned, PipelineError> {
    let meshed = clock.stage("mesh", |o| scan::mesh_at_once(cloud, params, o), triangles)?;
    let points = clock.stage(
        "points",
        |o| {
            let made = cloud::project(cloud, &meshed.samples, params.clean.outlier, &params.points, o)?;
            let facts = made.facts.clone();
            take(cloud, made)?;
            Ok::<PointFacts, CloudError>(facts)
        },
        |points| [("points", points.kept)],
    )?;
    Ok(Scanned { meshed, points })
}

/// The same of a scan in bricks.
fn in_bricks(
    store: &dyn BrickStore,
    params: &ScanParams,
    take: &mut TakePoints,
    clock: &mut Clock,
) -> Result<Scanned, PipelineError> {
    let (plan, meshed) = clock.stage(
        "mesh",
        |o| {
            let plan = clean_bricks(store, params, &Part::new(o, 0.0, 0.6))?;
            let meshed = mesh_planned(store, &plan, params, &Part::new(o, 0.6, 0.4))?;
            Ok::<(BrickPlan, ScanMeshed), ScanError>((plan, meshed))
        },
        |(_, meshed)| triangles(meshed),
    )?;
    let points =
        clock.stage("points", |o| project_bricks(store, &plan, params, take, o), |points| [("points", points.kept)])?;
    Ok(Scanned { meshed, points })
}

fn triangles(made: &ScanMeshed) -> [(&'static str, usize); 1] {
    [("triangles", made.meshed.extracted.mesh.triangles.len())]
}

/// Stages from a scan to its mesh, with their shares of the time in the measure of [`WEIGHTS`].
const SCAN_WEIGHTS: [(&str, f64); 2] = [("mesh", 60.0), ("points", 5.0)];

/// Stages in their order, each with its usual share of the time.
const WEIGHTS: [(&str, f64); 8] = [
    ("repair", 2.0),
    ("layout", 40.0),
    ("imprint", 3.0),
    ("grids", 25.0),
    ("surfaces", 5.0),
    ("seams", 10.0),
    ("relief", 2.0),
    ("measure", 13.0),
];

/// What [`fit`] makes.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The model, on the repaired mesh.
    pub model: Model,
    /// The stages that ran.
    pub stages: Vec<StageRecord>,
    /// Figures of quality.
    pub quality: Quality,
    /// How the patches meet, in the order of the curves.
    pub seams: Vec<SeamQuality>,
    /// What a user should know.
    pub warnings: Vec<Warning>,
}

/// Why there is no model.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The mesh cannot be repaired.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// There is no automatic network.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// The network does not fit the mesh.
    #[error(transparent)]
    Network(#[from] ImprintError),
    /// A patch cannot be resampled.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// A patch cannot follow its feature curves.
    #[error(transparent)]
    Feature(#[from] FeatureError),
    /// The surfaces cannot be fitted.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The reliefs cannot be made.
    #[error(transparent)]
    Relief(#[from] ReliefError),
    /// The result cannot be measured.
    #[error(transparent)]
    Compare(#[from] CompareError),
    /// The scan gives no mesh.
    #[error(transparent)]
    Scan(#[from] ScanError),
    /// The points of the scan cannot be brought to its surface.
    #[error(transparent)]
    Cloud(#[from] CloudError),
    /// The observer no longer wanted the result.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// Fits a model to a mesh.
///
/// * `input` - any triangle mesh; it is repaired first
/// * `tags` - its sharp edges where they are known: an automatic network follows them
/// * `network` - on the mesh as [`mend::repair`] leaves it; `None` for an automatic one
///
/// # Errors
/// The first stage that fails; [`Cancelled::is_cause_of`] tells one that was stopped.
pub fn fit(
    input: &TriMesh,
    tags: Option<&FeatureTags>,
    network: Option<Network>,
    params: &PipelineParams,
    observer: &dyn PipelineObserver,
) -> Result<Fitted, PipelineError> {
    fit_with(input, tags, network, None, params, &mut Clock::new(observer, &WEIGHTS))
}

/// As [`fit`] on a network, with its patches relaxed by `relaxer`: grids are most of the work that can be shared out.
/// # Errors
/// As [`fit`], and those of `relaxer`.
pub fn fit_by(
    relaxer: &dyn Relaxer,
    input: &TriMesh,
    network: Network,
    params: &PipelineParams,
    observer: &dyn PipelineObserver,
) -> Result<Fitted, PipelineError> {
    fit_with(input, None, Some(network), Some(relaxer), params, &mut Clock::new(observer, &WEIGHTS))
}

/// As [`fit`], with the clock of a longer run.
fn fit_with(
    input: &TriMesh,
    tags: Option<&FeatureTags>,
    network: Option<Network>,
    relaxer: Option<&dyn Relaxer>,
    params: &PipelineParams,
    clock: &mut Clock,
) -> Result<Fitted, PipelineError> {
    // A network that is given lies on the mesh as it is.
    let mend = if network.is_some() { MendParams::default() } else { params.mend.clone() };
    let Mended { mesh, sharp, repairs, evened } = mended(input, tags, &mend, clock)?;
    let (network, pieces) = match network {
        Some(network) => (network, Vec::new()),
        None => {
            let Layout { network, pieces } = draw(&mesh, &sharp, &params.layout, clock)?;
            (network, pieces)
        }
    };
    let patches = clock.stage("imprint", |o| network::imprint(&mesh, &network, o), |p| [("patches", p.len())])?;
    let grids = clock.stage(
        "grids",
        |o| resampled(relaxer, (&mesh, &network, &patches), (&[], &[]), params, o),
        |grids| [("points", grids.iter().map(|g| g.points.len()).sum())],
    )?;
    let mut model = Model { mesh, network, grids, ..Model::default() };
    surfaces(&mut model, params, clock)?;
    let mut measured =
        clock.stage("measure", |o| quality::measure(&model, &patches, &repairs, o), |m| [("seams", m.seams.len())])?;
    quality::method_figures(&pieces, &mut measured.quality, &mut measured.warnings);
    quality::border_figures(evened, mend.even_border, &mut measured.quality, &mut measured.warnings);
    Ok(Fitted {
        model,
        stages: std::mem::take(&mut clock.records),
        quality: measured.quality,
        seams: measured.seams,
        warnings: measured.warnings,
    })
}

/// Finer grids that leave more than this part of a miss do not help: the form has an edge there, or is rough at every scale. A
/// smooth form leaves a sixteenth, a kink half.
const DENSER_HELPS: f64 = 0.7;

/// Grids as they are by themselves, and finer ones along the chords where they carry too few control points for the tolerance.
fn resampled(
    relaxer: Option<&dyn Relaxer>,
    (mesh, network, patches): (&TriMesh, &Network, &[network::PatchMesh]),
    drawn: grid::Drawn,
    params: &PipelineParams,
    observer: &dyn Observer,
) -> Result<Vec<Grid>, PipelineError> {
    let here = grid::Here { input: mesh, network, patches, drawn, params: &params.grid };
    let relaxer = relaxer.unwrap_or(&here);
    let first = Part::new(observer, 0.0, 0.7);
    let mut grids = grid::resample_by(relaxer, (mesh, network, patches), drawn, &params.grid, &first)?;
    let start = grids.iter().map(|g| g.points.len()).sum();
    let mut before: Vec<f64> = Vec::new();
    for round in 0..params.grid.denser_rounds {
        let part = Part::new(observer, 1.0 - 0.3 * 0.5f64.powi(round as i32), 0.15 * 0.5f64.powi(round as i32));
        let mut need = surface::starved(network, &grids, &params.fit, &part)?;
        for (need, before) in need.iter_mut().zip(&before) {
            // What was not made finer for itself is not asked again.
            if *before == 0.0 || *need > DENSER_HELPS * before {
                *need = 0.0;
            }
        }
        let drawn_grids = (&mut grids[..], start);
        if !grid::densify(relaxer, (network, drawn), drawn_grids, &need, &params.grid, &part)? {
            break;
        }
        before = need;
    }
    Ok(grids)
}

/// What [`layout`] makes.
#[derive(Clone, Debug)]
pub struct Drafted {
    /// The repaired mesh, on which the network lies.
    pub mesh: TriMesh,
    /// The network.
    pub network: Network,
    /// The stages that ran.
    pub stages: Vec<StageRecord>,
    /// Figures of quality.
    pub quality: Quality,
    /// What a user should know.
    pub warnings: Vec<Warning>,
}

/// The stages up to the network, for one that is edited before it goes on to [`fit`]; it follows the sharp
/// edges of `tags` where there are any.
/// # Errors
/// As [`fit`].
pub fn layout(
    input: &TriMesh,
    tags: Option<&FeatureTags>,
    params: &LayoutParams,
    observer: &dyn PipelineObserver,
) -> Result<Drafted, PipelineError> {
    let mut clock = Clock::new(observer, &WEIGHTS[..2]);
    let draft = |clock: &mut Clock| {
        let Mended { mesh, sharp, repairs, .. } = mended(input, tags, &MendParams::default(), clock)?;
        let laid = draw(&mesh, &sharp, params, clock)?;
        Ok::<_, PipelineError>((mesh, repairs, laid))
    };
    let (mesh, repairs, Layout { network, pieces }) = draft(&mut clock)?;
    let (mut quality, mut warnings) = (Quality::new(), Vec::new());
    quality::mesh_figures(&mesh, &network, &repairs, &mut quality, &mut warnings);
    quality::network_figures(&network, &mut quality);
    quality::method_figures(&pieces, &mut quality, &mut warnings);
    Ok(Drafted { mesh, network, stages: clock.records, quality, warnings })
}

/// Fits surfaces, seams and reliefs of a model anew and keeps its mesh, network and grids.
///
/// Returns the stages that ran. On an error the model is what it was.
/// # Errors
/// As [`fit`].
pub fn refit(
    model: &mut Model,
    params: &PipelineParams,
    observer: &dyn PipelineObserver,
) -> Result<Vec<StageRecord>, PipelineError> {
    let mut clock = Clock::new(observer, &WEIGHTS);
    surfaces(model, params, &mut clock)?;
    Ok(clock.records)
}

/// Parts a model at a wavelength (units of the model): what is longer goes to new surfaces, what is shorter to the relief, so
/// that a bump sits wholly in the map.
///
/// The grids are freed of the shorter waves over all patches at once ([`relief::long_waves`]), and the surfaces are fitted to what is
/// left, with four to eight knot spans for each wave, by how many they had before. Edits of the relief stay as they are. On an
/// error the model is what it was.
/// # Errors
/// As [`fit`]; [`ReliefError::Edit`] for a wavelength that the grids cannot carry, with the shortest that they can, and for one that
/// is longer than the model.
///
/// Source: [K98] §7.5 and fig. 7.2: a least-squares surface takes part of what seems detail.
pub fn part_at(
    model: &mut Model,
    wavelength: f64,
    params: &PipelineParams,
    observer: &dyn PipelineObserver,
) -> Result<Vec<StageRecord>, PipelineError> {
    let sides = sides(model);
    let spans = |side: &Side| SPANS_PER_WAVE * side.length / wavelength;
    let carried = |side: &Side| (side.nodes + 1).saturating_sub(surface::FEWEST_CONTROL) as f64;
    if !sides.iter().all(|side| spans(side) <= carried(side)) {
        let shortest = sides.iter().map(|side| SPANS_PER_WAVE * side.length / carried(side)).fold(0.0, f64::max);
        // Three digits, rounded up: what is told must do.
        let digits = (2.0 - shortest.log10().floor()).max(0.0) as usize;
        let digit = 10f64.powi(-(digits as i32));
        let shortest = format!("{:.digits$}", (shortest / digit).ceil() * digit);
        let what =
            format!("waves of {wavelength} are too short for the grids of the patches; the shortest is {shortest}");
        return Err(ReliefError::Edit { what }.into());
    }
    let size = relief::diagonal(&model.surfaces);
    if wavelength > size {
        let what = format!("waves of {wavelength} are longer than the model ({size:.3})");
        return Err(ReliefError::Edit { what }.into());
    }
    let control = |side: &Side| {
        let for_spans = |spans: f64| spans.ceil().clamp(1.0, carried(side)) as usize + surface::FEWEST_CONTROL - 1;
        side.control.clamp(for_spans(spans(side)), for_spans(2.0 * spans(side)))
    };
    let control: Vec<usize> = sides.iter().map(control).collect();
    let counts = part_counts(&model.network, &sides, &control, wavelength);
    let fine = surface::Resolution::PerCurve(control);
    let smoothing = params.fit.smoothing.min(PART_SMOOTHING);
    let fine = FitParams { resolution: fine, control_at: Vec::new(), smoothing, ..params.fit.clone() };
    let mut clock = Clock::new(observer, &WEIGHTS);
    let long = clock.stage(
        "waves",
        |o| relief::long_waves(&model.network, &model.grids, &model.surfaces, (&counts, wavelength), o),
        |grids: &Vec<Grid>| [("points", grids.iter().map(|g| g.points.len()).sum())],
    )?;
    let grids = std::mem::take(&mut model.grids);
    let made = surfaces_through(model, (&long, &grids), &PipelineParams { fit: fine, ..params.clone() }, &mut clock);
    model.grids = grids;
    made.map(|()| clock.records)
}

/// Knot spans of a parted surface for each of the shortest waves that it takes: cubic splines hold these to about a hundredth then,
/// and waves three times as long to 1e-4.
const SPANS_PER_WAVE: f64 = 4.0;
/// Most smoothing of a parted surface. Bends of a wave of four spans count four times the smoothing, against half of the points'
/// weight: so it loses a hundredth of its height by that, and one three times as long 1e-4.
const PART_SMOOTHING: f64 = 1e-3;

/// Nodes for each of the shortest waves that are looked for: frequencies are known to a hundredth then.
const NODES_PER_WAVE: f64 = 16.0;

/// Nodes along each curve that waves are parted on: as many as waves and control points need, and no more than the grids have.
fn part_counts(network: &Network, sides: &[Side], control: &[usize], wavelength: f64) -> Vec<usize> {
    let chords = network.chords();
    let mut of_chord = vec![0; chords.len()];
    for ((side, &control), &chord) in sides.iter().zip(control).zip(&chords) {
        let waves = (NODES_PER_WAVE * side.length / wavelength).ceil() as usize + 1;
        let needed = waves.max(control + 1).min(side.nodes);
        of_chord[chord as usize] = needed.max(of_chord[chord as usize]);
    }
    chords.iter().map(|&chord| of_chord[chord as usize]).collect()
}

/// A curve as the grids have it.
struct Side {
    /// World units.
    length: f64,
    /// Nodes along it.
    nodes: usize,
    /// Control points of the surfaces along it.
    control: usize,
}

/// The curves of a network as the grids beside them have them, in their order.
fn sides(model: &Model) -> Vec<Side> {
    let mut sides: Vec<Side> =
        model.network.curves.iter().map(|_| Side { length: 0.0, nodes: surface::FEWEST_CONTROL, control: 0 }).collect();
    for ((patch, grid), surface) in model.network.patches.iter().zip(&model.grids).zip(&model.surfaces) {
        for (k, side) in patch.sides.iter().enumerate() {
            let control = if k % 2 == 0 { surface.cols } else { surface.rows };
            let nodes = if k % 2 == 0 { grid.cols } else { grid.rows };
            let points = (0..nodes).map(|i| grid.points[surface::node(grid.rows, grid.cols, k, i, 0)]);
            sides[side.curve as usize] = Side { length: crate::geom::polyline::length(points), nodes, control };
        }
    }
    sides
}

/// Fits surfaces of another resolution to the displaced ones: the same shape with its edits on another level of control points.
///
/// The relief becomes one layer, since layers were meant above other surfaces. On an error the model is what it was.
/// # Errors
/// As [`fit`].
///
/// Source: [K98] §7.6, fig. 7.4.
pub fn relevel(
    model: &mut Model,
    params: &PipelineParams,
    observer: &dyn PipelineObserver,
) -> Result<Vec<StageRecord>, PipelineError> {
    let mut clock = Clock::new(observer, &WEIGHTS);
    let displaced: Vec<Grid> = (model.surfaces.iter().zip(&model.reliefs))
        .map(|(s, r)| Ok(Grid { rows: r.rows, cols: r.cols, points: relief::displace(s, r)?, places: Vec::new() }))
        .collect::<Result<_, ReliefError>>()?;
    let layers = std::mem::take(&mut model.layers);
    let made = surfaces_through(model, (&displaced, &displaced), params, &mut clock);
    if made.is_err() {
        model.layers = layers;
    } else {
        // What is no longer baked from the grids is a layer of its own, so that it outlives the next fit.
        model.layers.begin(&model.reliefs);
    }
    made.map(|()| clock.records)
}

/// What [`assess`] finds.
#[derive(Clone, Debug)]
pub struct Assessed {
    /// The stages that ran.
    pub stages: Vec<StageRecord>,
    /// Figures of quality.
    pub quality: Quality,
    /// How the patches meet, in the order of the curves.
    pub seams: Vec<SeamQuality>,
    /// What a user should know.
    pub warnings: Vec<Warning>,
}

/// Measures a finished model against its mesh, as [`fit`] does at its end.
/// # Errors
/// If the parts of the model do not belong together.
pub fn assess(model: &Model, observer: &dyn PipelineObserver) -> Result<Assessed, PipelineError> {
    let mut clock = Clock::new(observer, &WEIGHTS);
    let measured = measure(model, &mut clock)?;
    let quality::Measured { quality, seams, warnings } = measured;
    Ok(Assessed { stages: clock.records, quality, seams, warnings })
}

fn measure(model: &Model, clock: &mut Clock) -> Result<quality::Measured, PipelineError> {
    let (mesh, network) = (&model.mesh, &model.network);
    let patches = clock.stage("imprint", |o| network::imprint(mesh, network, o), |p| [("patches", p.len())])?;
    let repairs = Repairs::default();
    clock.stage("measure", |o| quality::measure(model, &patches, &repairs, o), |m| [("seams", m.seams.len())])
}

/// A mesh that is ready for patches.
struct Mended {
    mesh: TriMesh,
    /// For each half-edge whether it is tagged as sharp; empty without tags.
    sharp: Vec<bool>,
    repairs: Repairs,
    /// Part of the area that went with ragged borders.
    evened: f64,
}

fn mended(
    input: &TriMesh,
    tags: Option<&FeatureTags>,
    params: &MendParams,
    clock: &mut Clock,
) -> Result<Mended, PipelineError> {
    let work = |o: &dyn Observer| {
        let (mut mesh, repairs) = mend::repair(input, o)?;
        let mut sharp = tags.map(|tags| tags.half_edges(input, &mesh)).unwrap_or_default();
        let mut evened = 0.0;
        if params.even_border > 0.0 {
            let ends = |h: usize| [mesh.origin(h as u32), mesh.origin(next(h as u32))];
            let edges: Vec<[u32; 2]> = (0..sharp.len()).filter(|&h| sharp[h]).map(ends).collect();
            let mut tags = FeatureTags::from_edges(mesh.points.len(), edges);
            let radius = params.even_border * mesh.bounds().diagonal();
            evened = mend::even_borders(&mut mesh, &mut tags, radius, o)?;
            if !sharp.is_empty() {
                sharp = tags.on(&mesh);
            }
        }
        Ok::<_, PipelineError>(Mended { mesh, sharp, repairs, evened })
    };
    clock.stage("repair", work, |mended| [("triangles", mended.mesh.triangles.len())])
}

/// Patches that a layout is asked for at most; where more are wanted, each of fewer is divided. Layouts are made on a mesh of some
/// thousand triangles, and its vertices are their corners: ten triangles are left for each patch then.
const MOST_LAID: usize = 600;

/// * `sharp` - for each half-edge whether it is sharp, if that is known
fn draw(mesh: &TriMesh, sharp: &[bool], params: &LayoutParams, clock: &mut Clock) -> Result<Layout, PipelineError> {
    let lay = |params: &LayoutParams, o: &dyn Observer| {
        layout::layout(mesh, Known { sharp, ..Known::default() }, params, Some(&trial::Coarse), o)
    };
    let laid = |o: &dyn Observer| -> Result<Layout, PipelineError> {
        let by = (params.patches as f64 / MOST_LAID as f64).sqrt().ceil() as usize;
        if by > 1 && !params.coarsest {
            let fewer = LayoutParams { patches: params.patches / (by * by), ..params.clone() };
            let Layout { network, pieces } = lay(&fewer, &Part::new(o, 0.0, 0.6))?;
            match grid::divide(mesh, &network, by, &GridParams::default(), &Part::new(o, 0.6, 0.4)) {
                Ok(network) if layout::count_is_near(network.patches.len(), params.patches) => {
                    return Ok(Layout { network, pieces });
                }
                Err(e) if Cancelled::is_cause_of(&e) => return Err(Cancelled.into()),
                // Where a grid is folded its curves cross.
                _ => {}
            }
        }
        Ok(lay(params, o)?)
    };
    clock.stage("layout", laid, |laid| [("patches", laid.network.patches.len())])
}

/// The stages from the grids to the reliefs.
fn surfaces(model: &mut Model, params: &PipelineParams, clock: &mut Clock) -> Result<(), PipelineError> {
    let grids = std::mem::take(&mut model.grids);
    let made = surfaces_through(model, (&grids, &grids), params, clock);
    model.grids = grids;
    made
}

/// As [`surfaces`], fitted to the grids `form` with the relief that leads to the grids `target`.
fn surfaces_through(
    model: &mut Model,
    (form, target): (&[Grid], &[Grid]),
    params: &PipelineParams,
    clock: &mut Clock,
) -> Result<(), PipelineError> {
    let (network, grids) = (&model.network, form);
    let control = |s: &Vec<surface::Surface>| [("control_points", s.iter().map(|s| s.control.len()).sum())];
    let symmetric = |leveled: bool, surfaces: &mut Vec<surface::Surface>| {
        if let Some(plane) = &model.sketch.symmetry {
            surface::mirror_surfaces(&model.mesh, network, plane, leveled, surfaces);
        }
    };
    let mut fit = params.fit.clone();
    if model.sketch.symmetry.is_some() {
        // What crosses the plane is its own image only with knots that are.
        fit.knots = KnotSpacing::Even;
    }
    let (smoothing, tolerance) = (fit.smoothing, fit.rms_allowed(grids));
    let stitch = StitchParams { smoothing, tolerance, ..params.stitch.clone() };
    let mut fitted = clock.stage("surfaces", |o| surface::fit_network(network, grids, &fit, o), control)?;
    // Seams are smoothed between images already, and what that takes from their symmetry is given back.
    symmetric(true, &mut fitted);
    let made = |o: &dyn Observer| match params.fit.continuity {
        Continuity::C0 => Ok((fitted.clone(), 0)),
        Continuity::G1 | Continuity::G1Double => Ok((surface::stitch(network, grids, &fitted, &stitch, o)?, 0)),
        Continuity::G1Exact => {
            let mut smooth = surface::stitch(network, grids, &fitted, &stitch, &Part::new(o, 0.0, 0.3))?;
            symmetric(false, &mut smooth);
            // What is fitted to images is its own image.
            let mut form = grids.to_vec();
            if let Some(plane) = &model.sketch.symmetry {
                surface::mirror_grids(&model.mesh, network, plane, &mut form);
            }
            let exact = surface::exact(network, &form, &smooth, &stitch, &Part::new(o, 0.3, 0.7))?;
            Ok::<_, FitError>((exact.surfaces, exact.seams.len()))
        }
    };
    // What the fit loses to its seams, along the normal, as a share of what it missed.
    let percent = |smooth: &[surface::Surface]| {
        let [is, was] = [smooth, &fitted[..]].map(|surfaces| surface::normal_rms(surfaces, grids));
        if was > 0.0 { (100.0 * is / was).round() as usize } else { 100 }
    };
    let counts = |(smooth, exact): &(Vec<surface::Surface>, usize)| {
        [("curves", network.curves.len()), ("exact", *exact), ("rms_percent", percent(smooth))]
    };
    let (mut smooth, _) = clock.stage("seams", made, counts)?;
    symmetric(false, &mut smooth);
    let reliefs = clock.stage(
        "relief",
        |o| relief::bake_network(target, &smooth, o),
        |reliefs| [("texels", reliefs.iter().map(|r| r.vectors.len()).sum())],
    )?;
    Ok(model.set_baked(smooth, reliefs)?)
}
