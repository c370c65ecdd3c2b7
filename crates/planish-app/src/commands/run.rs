//! `planish run`: everything, from a mesh to all products.

use super::{Session, commit_report, pipeline_failure, write_text};
use crate::args::Run;
use crate::failure::{Failure, Status};
use crate::files;
use crate::pictures;
use crate::products::Staged;
use crate::summary::Summary;
use planish::DVec3;
use planish::mesh::{FeatureTags, TriMesh};
use planish::model::{HistoryEntry, Model};
use planish::network::Network;
use planish::pipeline::{self, Fitted, PipelineParams, StageRecord};
use planish_io::report::{self, Report, SeamRow, count, distance, number, percent};
use planish_io::{StepInput, Up, WriteOptions};
use std::path::Path;

pub fn run(session: &Session, args: &Run) -> Result<Status, Failure> {
    let staged = Staged::folder(&args.output)?;
    let mut params = args.stages.params(session.common.seed)?;
    let mut before = Vec::new();
    let mut extra = None;
    let (input, tags) = if planish_io::is_scan(&args.input) {
        let (scan, read) = session.step("read", || files::scan(&args.input, &args.scan))?;
        let Scanned { mesh, tags, facts, suited, records } =
            from_scan(session, &args.input, &scan, args.holes.choice(), &staged)?;
        params = args.stages.params_suiting(suited, session.common.seed)?;
        before.push(read);
        before.extend(records);
        extra = Some(facts);
        (mesh, Some(tags))
    } else {
        args.holes.refuse("close the holes of a mesh with `planish mesh` first")?;
        let (tagged, read) = session.step("read", || files::tagged_mesh(&args.input))?;
        before.push(read);
        tagged
    };
    let network = files::optional_network(args.network.as_deref(), &input)?;
    let job = Job {
        command: "run",
        path: &args.input,
        input: &input,
        tags: tags.as_ref(),
        network: network.zip(args.network.as_deref()),
        params,
        demanded: args.stages.demanded_tolerance(),
        output: &args.output,
        up: args.up.into(),
        scan: extra,
        truth: None,
    };
    produce(session, job, staged, before)
}

/// A scan on its way to a model.
pub struct Scanned {
    /// The mesh that was made of it.
    pub mesh: TriMesh,
    /// Its sharp edges.
    pub tags: FeatureTags,
    /// What was found.
    pub facts: ScanFacts,
    /// The parameters that suit it.
    pub suited: PipelineParams,
    /// The stages that ran.
    pub records: Vec<StageRecord>,
}

/// What the stages before the mesh found.
pub struct ScanFacts {
    /// Facts of the input.
    pub input: report::Input,
    /// Figures of the scan.
    pub quality: pipeline::Quality,
    /// Warnings of the scan.
    pub warnings: Vec<pipeline::Warning>,
    /// The raw points, in parts: on the surface, and outliers.
    pub points: [Vec<DVec3>; 2],
}

/// The stages from a scan to a mesh; leaves `points.ply`.
pub fn from_scan(
    session: &Session,
    path: &Path,
    scan: &planish::cloud::Cloud,
    close: Option<bool>,
    staged: &Staged,
) -> Result<Scanned, Failure> {
    let params = pipeline::ScanParams {
        clean: Default::default(),
        contour: Default::default(),
        voxel: None,
        resolution: None,
        memory: super::mesh::default_memory(),
        close,
    };
    let fault = |e: &dyn std::fmt::Display| Failure::input(path, super::with_hint(&e.to_string()));
    let (made, record) = session.bars.step("mesh", |o| pipeline::mesh_scan(scan, &params, o));
    if crate::progress::interrupted() {
        return Err(Failure::interrupted());
    }
    let made = made.map_err(|e| fault(&e))?;
    let (points, project) = session
        .bars
        .step("points", |o| planish::cloud::project(scan, &made.samples, params.clean.outlier, &Default::default(), o));
    if crate::progress::interrupted() {
        return Err(Failure::interrupted());
    }
    let mut points = points.map_err(|e| fault(&e))?;
    // All products lie in one place.
    points.cloud.shift = DVec3::ZERO;
    planish_io::write_scan(staged.path("points.ply"), &points.cloud).map_err(|e| Failure::usage(path, e))?;
    let mut facts = ScanFacts {
        input: super::clean::scan_facts(path, scan, session.units()),
        quality: Default::default(),
        warnings: Vec::new(),
        points: Default::default(),
    };
    pipeline::scan_figures(&made, &mut facts.quality, &mut facts.warnings);
    facts.warnings.extend(super::clean::moved(scan));
    facts.quality.insert("scan.outliers".into(), pipeline::Figure::Count(points.outliers as u64));
    facts.quality.insert("scan.moved_rms".into(), pipeline::Figure::Number(points.moved_rms));
    for (p, &off) in scan.points.iter().zip(&points.strays) {
        facts.points[usize::from(off)].push(*p);
    }
    let suited = pipeline::params_for(&made);
    let (mesh, tags) = (made.meshed.extracted.mesh, made.meshed.extracted.tags);
    Ok(Scanned { mesh, tags, facts, suited, records: vec![record, project] })
}

/// A mesh on its way to a model.
pub struct Job<'a> {
    /// Name of the command.
    pub command: &'static str,
    /// The mesh's path as the user gave it.
    pub path: &'a Path,
    /// The mesh.
    pub input: &'a TriMesh,
    /// Its sharp edges, where the file tells them.
    pub tags: Option<&'a FeatureTags>,
    /// A network of the user's own, with its path.
    pub network: Option<(Network, &'a Path)>,
    /// Parameters of all stages.
    pub params: PipelineParams,
    /// Tolerance that the user demanded, as a fraction of the diagonal.
    pub demanded: Option<f64>,
    /// Where the products go.
    pub output: &'a Path,
    /// Axis that points up.
    pub up: Up,
    /// What the stages before the mesh found, if the input is a scan.
    pub scan: Option<ScanFacts>,
    /// The surface that was scanned, where it is known.
    pub truth: Option<&'a TriMesh>,
}

/// Fits a model and writes all products.
pub fn produce(session: &Session, job: Job, staged: Staged, before: Vec<StageRecord>) -> Result<Status, Failure> {
    let own_report = session.stage_report()?;
    let (path, output, demanded, up) = (job.path, job.output, job.demanded, job.up);
    let mut job = job;
    let raw = job.scan.as_mut().map(|s| std::mem::take(&mut s.points));
    let (mut report, model) = fitted(session, job, before)?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let options = WriteOptions { units: model.units, up, name };
    let ((), write) = session.step("write", || write_products(&staged, output, &model, &options))?;
    let (pictures, draw) = session.step("pictures", || pictures::pictures(&model, raw.as_ref(), &report, up))?;
    report.stages.extend([write, draw]);
    write_text(&staged.path("report.json"), &report.to_json())?;
    write_text(&staged.path("report.html"), &report::html(&report, &pictures))?;
    staged.commit()?;
    commit_report(own_report, &report)?;
    let status = verdict(&report, demanded);
    if !session.common.quiet {
        session.tell_warnings(&report);
        let mut summary = summary(&report, demanded);
        summary.row("products", output.display().to_string());
        summary.row("look at", output.join("report.html").display().to_string());
        summary.print();
    }
    Ok(status)
}

/// Fits a model: its report so far, and itself with units and history.
pub fn fitted(session: &Session, job: Job, before: Vec<StageRecord>) -> Result<(Report, Model), Failure> {
    let units = session.units();
    let mut report = Report::new(job.command, files::mesh_facts(job.path, job.input, units));
    let (network, network_path) = job.network.unzip();
    let Fitted { mut model, stages, quality, seams, warnings } =
        pipeline::fit_tagged(job.input, job.tags, network, &job.params, &session.bars)
            .map_err(|e| pipeline_failure(job.path, network_path, e))?;
    report.stages = before;
    report.stages.extend(stages);
    report.quality = quality;
    report.warnings = warnings;
    report.seams = seam_rows(&model, &seams);
    if let Some(truth) = job.truth {
        let noise = job.scan.as_ref().and_then(|s| s.quality.get("scan.noise")).map_or(0.0, |f| f.value());
        // An edge has its seam within two noise levels; without noise within a thousandth of the diagonal.
        let within = (2.0 * noise).max(1e-3 * truth.bounds().diagonal());
        let (found, record) =
            session.bars.step("truth", |o| pipeline::truth_figures(truth, job.input, &model, within, o));
        if crate::progress::interrupted() {
            return Err(Failure::interrupted());
        }
        report.quality.extend(found.map_err(Failure::fault)?);
        report.stages.push(record);
    }
    if let Some(scan) = job.scan {
        // Outliers are no part of the shape: its size is that of the mesh, for all figures.
        let diagonal = report.input.diagonal;
        report.input = report::Input { diagonal, ..scan.input };
        report.quality.extend(scan.quality);
        for key in ["scan.noise", "scan.spacing", "scan.moved_rms", "scan.to_mesh_rms", "scan.to_mesh_mean"] {
            if let Some(x) = report.figure(key) {
                report.quality.insert(format!("{key}_rel"), pipeline::Figure::Number(x / diagonal));
            }
        }
        report.warnings.extend(scan.warnings);
    }
    model.units = units;
    model.params = serde_json::to_string(&job.params).map_err(Failure::fault)?;
    model.history.push(HistoryEntry { command: "fit".into(), parameters: model.params.clone() });
    Ok((report, model))
}

/// Done, or the demanded tolerance is missed.
pub fn verdict(report: &Report, demanded: Option<f64>) -> Status {
    match (demanded, report.figure("surface.patch_rms_max_rel")) {
        (Some(wanted), Some(reached)) if reached > wanted => Status::Missed,
        _ => Status::Done,
    }
}

/// The table of a fit.
pub fn summary(report: &Report, demanded: Option<f64>) -> Summary {
    let mut table = Summary::default();
    let (unit, diagonal) = (report.input.units.as_str(), report.input.diagonal);
    let figure = |key: &str| report.figure(key).unwrap_or(0.0);
    let length = |key: &str| distance(figure(key), diagonal, unit);
    let closed = if report.flag("mesh.watertight") == Some(true) { "watertight" } else { "open" };
    let triangles = format!("{} triangles, {closed}", count(figure("mesh.triangles") as u64));
    match report.input.counts.get("points") {
        Some(&points) => {
            table.row("input", format!("{}: {} points", report.input.path, count(points)));
            table.row("noise", length("scan.noise"));
            table.row("orientation", format!("{} of the evidence agrees", percent(figure("scan.confidence"))));
            table.row("points to mesh", format!("{} RMS", length("scan.to_mesh_rms")));
            if figure("scan.lids") > 0.0 {
                table.row("holes", format!("{} small ones closed", count(figure("scan.lids") as u64)));
            }
            table.row("mesh", triangles);
        }
        None => {
            table.row("input", format!("{}: {triangles}", report.input.path));
        }
    }
    table.row("patches", count(figure("patches.count") as u64));
    table.row("control points", count(figure("surface.control_points") as u64));
    table.row("grids", format!("{} points, {} folds", count(figure("grid.points") as u64), figure("grid.folds")));
    table.row("surface, RMS", length("surface.rms"));
    table.row("surface, largest", length("surface.max"));
    table.row("displaced, RMS", length("displaced.rms"));
    table.row("displaced, largest", length("displaced.max"));
    table.row(
        "seams",
        format!(
            "gap {} {unit}, angle {} degrees at most, {} RMS",
            number(figure("seam.gap_max")),
            number(figure("seam.angle_max_deg")),
            number(figure("seam.angle_rms_deg"))
        ),
    );
    if let Some(wanted) = demanded {
        let reached = figure("surface.patch_rms_max_rel");
        let word = if reached > wanted { "missed" } else { "kept" };
        table.row("tolerance", format!("{word}: {} for {} of the diagonal", number(reached), number(wanted)));
    }
    if report.figure("truth.displaced_rms").is_some() {
        table.row("to the truth", format!("{} RMS", length("truth.displaced_rms")));
        table.row(
            "true sharp edges",
            format!(
                "{} have a seam, {} with their angle",
                percent(figure("truth.sharp_found")),
                percent(figure("truth.sharp_met"))
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
    pipeline::worst_seams(seams)
        .into_iter()
        .map(|s| {
            let sides = &uses[s.curve as usize];
            SeamRow {
                curve: s.curve,
                patches: [sides[0].0, sides[1].0],
                feature: s.kind != planish::network::CurveKind::Smooth,
                length: s.length,
                gap_max: s.gap_max,
                angle_max_deg: s.angle_max_deg,
                angle_rms_deg: s.angle_rms_deg,
            }
        })
        .collect()
}

fn write_products(staged: &Staged, output: &Path, model: &Model, options: &WriteOptions) -> Result<(), Failure> {
    let wrong = |name: &str, e: &dyn std::fmt::Display| Failure::usage(output.join(name), e);
    let mesh = |name: &str, mesh: &TriMesh| {
        planish_io::write_mesh(staged.path(name), mesh, options).map_err(|e| wrong(name, &e))
    };
    let step = StepInput {
        network: &model.network,
        surfaces: &model.surfaces,
        units: model.units,
        name: &options.name,
        time: None,
    };
    mesh("mesh.ply", &model.mesh)?;
    planish_io::write_model(staged.path("model.planish"), model).map_err(|e| wrong("model.planish", &e))?;
    planish_io::write_step(staged.path("surface.step"), &step).map_err(|e| wrong("surface.step", &e))?;
    planish_io::write_relief(staged.path("relief"), &model.reliefs, model.units).map_err(|e| wrong("relief", &e))?;
    mesh("preview.glb", &pipeline::displaced_mesh(model, &crate::progress::Interrupt).map_err(Failure::fault)?)
}
