//! `planish run`: everything, from a scan or a mesh to all products.

use super::missed::{self, Reach};
use super::{Session, commit_report, pipeline_failure, write_failure, write_relief, write_text};
use crate::args::{AllStages, Run, SeamArgs};
use crate::failure::{Failure, Status};
use crate::files::{self, PointsFile, Scan};
use crate::pictures::{self, Raw};
use crate::placed::{self, Placed};
use crate::products::Staged;
use crate::summary::Summary;
use crate::tolerance::Tolerance;
use planish::DVec3;
use planish::cloud::bricks::StoreError;
use planish::cloud::{Cleaned, Cloud};
use planish::mesh::{FeatureTags, TriMesh};
use planish::model::{HistoryEntry, Model, Units};
use planish::network::Network;
use planish::pipeline::key;
use planish::pipeline::{self, Figure, Fitted, Input, RunParams, ScanParams, StageRecord};
use planish_io::report::{self, Report, SeamRow, count, distance, number, percent};
use planish_io::{StepInput, Up, WriteError, WriteOptions};
use std::path::Path;

pub fn run(session: &Session, args: &Run) -> Result<Status, Failure> {
    let input = &args.inputs[0];
    // The first to come and the last to go: it removes a folder that was made in vain.
    let room = Staged::folder(&args.output)?;
    let staged = Staged::folder(&args.output)?;
    let scan = ScanParams { points: args.points.params(None)?, ..args.meshing.params()? };
    let units = session.units_of(input);
    let params = args.stages.run_params(scan, session.common.seed, units);
    let job = Job {
        command: "run",
        path: input,
        network_path: args.network.as_deref(),
        params,
        units,
        demanded: args.stages.demanded_tolerance(),
        demanded_angle: args.stages.demanded_angle(),
        wanted_patches: args.stages.wanted_patches(),
        output: &args.output,
        up: args.up.into(),
        truth: None,
    };
    if planish_io::is_scan(input) {
        if args.network.is_some() {
            return Err(Failure::usage("--network", "lies on a mesh, and the input is a scan")
                .hint("use `planish mesh` first, and give its mesh"));
        }
        let ((scan, warning), read) = session.watched("read", |o| Scan::read(input, &args.scan, Some(&room), o))?;
        let of_scan = match &scan {
            Scan::Whole(cloud) => Input::Scan(cloud),
            Scan::Bricks(bricks) => Input::Bricks(bricks),
        };
        let from = From { input: of_scan, size: scan.size(), shift: scan.shift(), warning };
        return produce(session, job, from, staged, vec![read]);
    }
    args.meshing.refuse("use `planish mesh` first")?;
    if let Some(flag) = args.points.first_given() {
        return Err(Failure::usage(flag, "is for scans, and the input is none").hint("leave it out"));
    }
    let (placed, read) = session.step("read", || Placed::read(input))?;
    let network = own_network(args.network.as_deref(), &placed.mesh, &args.stages, &args.seams)?;
    let from = From {
        input: placed.input(network),
        size: (0, 0.0),
        shift: placed.shift,
        warning: placed.warning(units.symbol()),
    };
    produce(session, job, from, staged, vec![read])
}

/// The user's own network on a mesh, if one is given: its curves checked, its seams as they are to be.
pub fn own_network(
    path: Option<&Path>,
    mesh: &TriMesh,
    stages: &AllStages,
    seams: &SeamArgs,
) -> Result<Option<Network>, Failure> {
    let mut network = files::optional_network(path, mesh)?;
    if let Some(network) = &mut network {
        stages.check_curves(network)?;
        seams.apply(network)?;
    }
    Ok(network)
}

/// What a model is made of.
pub struct From<'a> {
    /// The input, near the origin.
    pub input: Input<'a>,
    /// Of a scan the number of points, and the diagonal of their box.
    pub size: (u64, f64),
    /// What brings it back to its place.
    pub shift: DVec3,
    /// What is to be told of it.
    pub warning: Option<pipeline::Warning>,
}

impl<'a> From<'a> {
    /// A scan.
    pub fn scan(scan: &'a planish::cloud::Cloud) -> From<'a> {
        let size = (scan.points.len() as u64, scan.bounds().diagonal());
        From { input: Input::Scan(scan), size, shift: scan.shift, warning: None }
    }
}

/// A shape on its way to a model.
pub struct Job<'a> {
    /// Name of the command.
    pub command: &'static str,
    /// The input's path as the user gave it.
    pub path: &'a Path,
    /// Path of the user's own network.
    pub network_path: Option<&'a Path>,
    /// Parameters of all stages.
    pub params: RunParams<'a>,
    /// What one unit of the input is.
    pub units: Units,
    /// Tolerance that the user demanded.
    pub demanded: Option<Tolerance>,
    /// Tolerance of the angle along smooth seams that the user demanded, degrees.
    pub demanded_angle: Option<f64>,
    /// Number of patches that the user asked for.
    pub wanted_patches: Option<u64>,
    /// Where the products go.
    pub output: &'a Path,
    /// Axis that points up.
    pub up: Up,
    /// The surface that was scanned, where it is known.
    pub truth: Option<Truth<'a>>,
}

/// What is known of a synthetic scan.
pub struct Truth<'a> {
    /// The surface that was scanned.
    pub mesh: &'a TriMesh,
    /// Points with a wrong range.
    pub outliers: usize,
    /// Noise, of the diagonal.
    pub noise_rel: f64,
}

/// Fits a model and writes all products.
pub fn produce(
    session: &Session,
    job: Job,
    from: From,
    staged: Staged,
    before: Vec<StageRecord>,
) -> Result<Status, Failure> {
    let own_report = session.stage_report()?;
    let mut points = match from.input {
        Input::Mesh { .. } => None,
        _ => Some(Points::new(&staged.path(POINTS), from.size.0, job.units)?),
    };
    let Made { mut report, model, reach } = fitted(session, &job, from, before, points.as_mut())?;
    report.warnings.extend(placed::moved(model.shift, "preview.glb lies"));
    let wrong = |e| write_failure(job.path, &job.output.join(POINTS), e);
    let raw = points.map(Points::finish).transpose().map_err(wrong)?;
    let name = job.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let options = WriteOptions { units: model.units, up: job.up, name };
    let ((), write) = session.step("write", || write_products(&staged, &job, &model, &options, &mut report))?;
    let (pictures, draw) = session.step("pictures", || pictures::pictures(&model, raw.as_ref(), &report, job.up))?;
    report.stages.extend([write, draw]);
    write_text(&staged.path("report.json"), &report.to_json())?;
    write_text(&staged.path("report.html"), &report::html(&report, &pictures))?;
    staged.commit()?;
    commit_report(own_report, &report)?;
    let status = verdict(&report, reach);
    if !session.common.quiet {
        session.tell_warnings(&report);
        let mut summary = summary(&report, reach);
        summary.row("products", job.output.display().to_string());
        summary.row("look at", job.output.join("report.html").display().to_string());
        summary.print();
    }
    Ok(status)
}

/// Name of the cleaned points of a scan among the products.
const POINTS: &str = "points.ply";

/// The points of a scan on their way to their file, and to their picture.
pub struct Points {
    file: PointsFile,
    raw: Raw,
}

impl Points {
    fn new(path: &Path, total: u64, units: Units) -> Result<Points, Failure> {
        let file = PointsFile::create(path, units).map_err(|e| Failure::usage(path, e))?;
        Ok(Points { file, raw: Raw::new(total) })
    }

    fn take(&mut self, raw: &Cloud, cleaned: Cleaned) -> Result<(), StoreError> {
        self.raw.add(&raw.points, &cleaned.strays);
        self.file.add(cleaned.cloud)
    }

    fn finish(self) -> Result<Raw, WriteError> {
        self.file.finish()?;
        Ok(self.raw)
    }
}

/// A model with its report so far.
pub struct Made {
    /// The report.
    pub report: Report,
    /// The model, with units and history.
    pub model: Model,
    /// What is reached of a demanded tolerance.
    pub reach: Option<Reach>,
}

/// Runs the pipeline on an input.
/// * `points` - takes those of a scan
pub fn fitted(
    session: &Session,
    job: &Job,
    from: From,
    before: Vec<StageRecord>,
    mut points: Option<&mut Points>,
) -> Result<Made, Failure> {
    let (units, From { input, size, shift, warning }) = (job.units, from);
    let facts = match &input {
        Input::Scan(_) | Input::Bricks(_) => super::clean::scan_facts(job.path, size, units),
        Input::Mesh { mesh, .. } => files::mesh_facts(job.path, mesh, units),
    };
    let guessed = session.guessed_units(job.path, facts.diagonal, shift != DVec3::ZERO).filter(|_| job.truth.is_none());
    let mut report = Report::new(job.command, facts);
    let mut take = |raw: &Cloud, cleaned: Cleaned| points.as_mut().map_or(Ok(()), |points| points.take(raw, cleaned));
    let run = pipeline::run_with_points(input, &job.params, &mut take, &session.bars);
    let run = run.map_err(|e| match points.and_then(|points| points.file.failure()) {
        Some(e) => write_failure(job.path, &job.output.join(POINTS), e),
        None => pipeline_failure(job.path, job.network_path, e),
    })?;
    let Fitted { mut model, stages, quality, seams, warnings } = run.fitted;
    report.stages = before;
    report.stages.extend(stages);
    report.quality = quality;
    report.warnings = warnings;
    report.warnings.extend(guessed.into_iter().chain(warning));
    report.seams = seam_rows(&model, &seams);
    let meshed = run.scan.as_ref().map(|s| &s.meshed.meshed.extracted.mesh);
    if let Some(meshed) = meshed {
        // Outliers are no part of the shape: its size is that of the mesh, for all figures.
        report.input.diagonal = meshed.bounds().diagonal();
    }
    if let (Some(truth), Some(meshed)) = (&job.truth, meshed) {
        report.quality.insert(key::TRUTH_OUTLIERS.into(), Figure::Count(truth.outliers as u64));
        report.quality.insert(key::TRUTH_NOISE_REL.into(), Figure::Number(truth.noise_rel));
        let noise = report.figure(key::SCAN_NOISE).unwrap_or(0.0);
        // An edge has its seam within two noise levels; without noise within a thousandth of the diagonal.
        let within = (2.0 * noise).max(1e-3 * truth.mesh.bounds().diagonal());
        let (found, record) =
            session.bars.step("truth", |o| pipeline::truth_figures(truth.mesh, meshed, &model, within, o));
        if crate::progress::interrupted() {
            return Err(Failure::interrupted());
        }
        report.quality.extend(found.map_err(Failure::fault)?);
        report.stages.push(record);
    }
    let reach = Reach::new(job.demanded, run.params.fit.tolerance_of, &report, units);
    report.warnings.extend(missed::tolerance(&model, &run.params, reach, report.input.diagonal));
    report.warnings.extend(missed::angle(&model, &seams, &run.params, job.demanded_angle));
    report.warnings.extend(missed::inexact(&seams, &run.params));
    report.warnings.extend(missed::patches(&model.network, job.wanted_patches));
    (model.units, model.shift) = (units, shift);
    model.params = serde_json::to_string(&run.params).map_err(Failure::fault)?;
    model.history.push(HistoryEntry { command: "fit".into(), parameters: model.params.clone() });
    Ok(Made { report, model, reach })
}

/// Done, or a demanded tolerance is missed: that of the distance, or that of the angle.
pub fn verdict(report: &Report, reach: Option<Reach>) -> Status {
    let is_missed = reach.is_some_and(Reach::is_missed) || report.warnings.iter().any(|w| w.code == missed::ANGLE);
    if is_missed { Status::Missed } else { Status::Done }
}

/// The table of a fit.
pub fn summary(report: &Report, reach: Option<Reach>) -> Summary {
    let mut table = Summary::default();
    let (unit, diagonal) = (report.input.units.as_str(), report.input.diagonal);
    let figure = |key: &str| report.figure(key).unwrap_or(0.0);
    let length = |key: &str| distance(figure(key), diagonal, unit);
    let closed = if report.flag(key::MESH_WATERTIGHT) == Some(true) { "watertight" } else { "open" };
    let triangles = format!("{} triangles, {closed}", count(figure(key::MESH_TRIANGLES) as u64));
    match report.input.counts.get("points") {
        Some(&points) => {
            table.row("input", format!("{}: {} points", report.input.path, count(points)));
            table.row("noise", report.length(key::SCAN_NOISE));
            table.row("orientation", format!("{} of the evidence agrees", percent(figure(key::SCAN_CONFIDENCE))));
            table.row("points to mesh", format!("{} RMS", length(key::SCAN_TO_MESH_RMS)));
            if figure(key::SCAN_LIDS) > 0.0 {
                table.row("holes", format!("{} small ones closed", count(figure(key::SCAN_LIDS) as u64)));
            }
            table.row("mesh", triangles);
        }
        None => {
            table.row("input", format!("{}: {triangles}", report.input.path));
        }
    }
    table.row("patches", count(figure(key::PATCHES_COUNT) as u64));
    table.row("control points", count(figure(key::SURFACE_CONTROL_POINTS) as u64));
    table.row("grids", format!("{} points, {} folds", count(figure(key::GRID_POINTS) as u64), figure(key::GRID_FOLDS)));
    table.row("surface, RMS", length(key::SURFACE_RMS));
    table.row("surface, largest", length(key::SURFACE_MAX));
    table.row("displaced, RMS", length(key::DISPLACED_RMS));
    table.row("displaced, largest", length(key::DISPLACED_MAX));
    table.row(
        "seams",
        format!(
            "gap {} {unit}, angle {} degrees at most, {} RMS",
            number(figure(key::SEAM_GAP_MAX)),
            number(figure(key::SEAM_INNER_ANGLE_MAX_DEG)),
            number(figure(key::SEAM_ANGLE_RMS_DEG))
        ),
    );
    if figure(key::SEAM_FOLDED) > 0.0 {
        table.row("folded seams", count(figure(key::SEAM_FOLDED) as u64));
    }
    let (state, reasons) = planish_io::report::verdict(report);
    let why: Vec<&str> = reasons.iter().map(|r| r.1.as_str()).collect();
    let why = if why.is_empty() { String::new() } else { format!(": {}", why.join("; ")) };
    table.row("verdict", format!("{}{why}", state.word().to_lowercase()));
    if let Some(reach) = reach {
        let word = if reach.is_missed() { "missed" } else { "kept" };
        let lengths = [reach.reached, reach.wanted].map(|share| distance(share * diagonal, diagonal, unit));
        table.row("tolerance", format!("{word}: {} where {} is demanded", lengths[0], lengths[1]));
    }
    if report.figure(key::TRUTH_DISPLACED_RMS).is_some() {
        table.row("to the truth", format!("{} RMS", length(key::TRUTH_DISPLACED_RMS)));
        table.row(
            "true sharp edges",
            format!(
                "{} have a seam, {} with their angle",
                percent(figure(key::TRUTH_SHARP_FOUND)),
                percent(figure(key::TRUTH_SHARP_MET))
            ),
        );
    }
    let seconds: f64 = report.stages.iter().map(|s| s.seconds).sum();
    table.row("time", format!("{} s", number(seconds)));
    table
}

/// The seams of a report, worst first.
pub fn seam_rows(model: &Model, seams: &[planish::surface::SeamQuality]) -> Vec<SeamRow> {
    let uses = model.network.uses();
    let inner = pipeline::inner_angles(model);
    pipeline::worst_seams(seams)
        .into_iter()
        .map(|s| {
            let sides = &uses[s.curve as usize];
            let inner_angle_max_deg = inner.get(&s.curve).map_or(0.0, |found| found.0);
            SeamRow {
                curve: s.curve,
                patches: [sides[0].0, sides[1].0],
                feature: !s.kind.is_smooth(),
                length: s.length,
                gap_max: s.gap_max,
                angle_max_deg: s.angle_max_deg,
                angle_rms_deg: s.angle_rms_deg,
                inner_angle_max_deg,
                folded: s.kind.is_smooth() && inner_angle_max_deg > pipeline::FOLDED_DEG,
            }
        })
        .collect()
}

fn write_products(
    staged: &Staged,
    job: &Job,
    model: &Model,
    options: &WriteOptions,
    report: &mut Report,
) -> Result<(), Failure> {
    let wrong = |name: &str, e: WriteError| write_failure(job.path, &job.output.join(name), e);
    let mesh = |name: &str, mesh: &TriMesh| {
        placed::write(&staged.path(name), mesh, &FeatureTags::default(), model.shift, options)
            .map_err(|e| wrong(name, e))
    };
    let surfaces = placed::surfaces(model);
    let step =
        StepInput { network: &model.network, surfaces: &surfaces, units: model.units, name: &options.name, time: None };
    mesh("mesh.ply", &model.mesh)?;
    planish_io::write_model(staged.path("model.planish"), model)
        .map_err(|e| Failure::usage(job.output.join("model.planish"), e))?;
    planish_io::write_step(staged.path("surface.step"), &step).map_err(|e| wrong("surface.step", e))?;
    write_relief(&staged.path("relief"), model, &mut report.quality).map_err(|e| wrong("relief", e))?;
    mesh("preview.glb", &pipeline::displaced_mesh(model, &crate::progress::Interrupt).map_err(Failure::fault)?)
        .map(drop)
}
