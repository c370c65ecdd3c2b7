//! `planish fit`: mesh and network to a model; or the surfaces of a model, and its grids where it has none.

use super::missed::{self, Reach};
use super::run::{From, Job, Made, fitted, own_network, seam_rows, summary, verdict};
use super::{Session, pipeline_failure};
use crate::args::{AllStages, Fit};
use crate::failure::{Failure, Status};
use crate::files;
use crate::placed::Placed;
use crate::products::Staged;
use crate::tolerance::Scale;
use planish::mesh::Adjacency;
use planish::model::{HistoryEntry, Model};
use planish::network::diagnose;
use planish::pipeline::{self, PipelineParams, ScanParams};
use planish::surface::SeamQuality;
use planish_io::Up;
use planish_io::report::Report;
use std::path::Path;

pub fn fit(session: &Session, args: &Fit) -> Result<Status, Failure> {
    files::check_extension(&args.output, &["planish"])?;
    let staged = Staged::file(&args.output)?;
    let own_report = session.stage_report()?;
    let (mut report, model, reach) =
        if files::is_model(&args.input) { refit(session, args)? } else { anew(session, args)? };
    report.stages.push(session.write_model(&staged, &model, &args.output)?);
    if session.hand_over([staged], own_report, &report)? {
        let mut table = summary(&report, reach);
        table.row("model", args.output.display().to_string());
        table.print();
    }
    Ok(verdict(&report, reach))
}

/// A model of a mesh.
fn anew(session: &Session, args: &Fit) -> Result<(Report, Model, Option<Reach>), Failure> {
    let (placed, read) = session.step("read", || Placed::read(&args.input))?;
    let units = session.units_of(&args.input);
    let network = own_network(args.network.as_deref(), &placed.mesh, &args.stages, &args.seams)?;
    let job = Job {
        command: "fit",
        path: &args.input,
        network_path: args.network.as_deref(),
        params: args.stages.run_params(ScanParams::default(), session.common.seed, units),
        units,
        demanded: args.stages.demanded_tolerance(),
        demanded_angle: args.stages.demanded_angle(),
        wanted_patches: args.stages.wanted_patches(),
        output: &args.output,
        up: Up::default(),
        truth: None,
    };
    let from = From {
        input: placed.input(network),
        size: (0, 0.0),
        shift: placed.shift,
        warning: placed.warning(units.symbol()),
    };
    let Made { report, model, reach, .. } = fitted(session, &job, from, vec![read], None)?;
    Ok((report, model, reach))
}

/// A model with the mesh, network and grids of another, and surfaces of its own; with grids of its own, if there are none.
fn refit(session: &Session, args: &Fit) -> Result<(Report, Model, Option<Reach>), Failure> {
    if args.network.is_some() {
        return Err(Failure::usage("--network", "does not go with a model, which has its own")
            .hint("fit its mesh: `planish export MODEL.planish --surface mesh -o MESH.ply`"));
    }
    let (mut model, read) = session.step("read", || files::model(&args.input))?;
    let gridded = !model.grids.is_empty();
    let stored = match model.params.as_str() {
        "" => PipelineParams::default(),
        json => AllStages::stored(json).map_err(|e| Failure::input(&args.input, e).hint("fit its mesh"))?,
    };
    if let Some(units) = session.common.units {
        model.units = units.into();
    }
    let scale = Scale { diagonal: model.mesh.bounds().diagonal(), units: model.units };
    let params = args.stages.params_over(stored, gridded, session.common.seed, scale)?;
    args.stages.check_curves(&model.network)?;
    args.seams.apply(&mut model.network)?;
    if !gridded {
        finished(&args.input, &model)?;
    }
    let mut report = Report::new("fit", files::model_facts(&args.input, &model, model.units));
    let wrong = |e| pipeline_failure(&args.input, None, e);
    report.stages = vec![read];
    let found = if gridded {
        report.stages.extend(pipeline::refit(&mut model, &params, &session.bars).map_err(wrong)?);
        pipeline::assess(&model, &session.bars).map_err(wrong)?
    } else {
        pipeline::rework(&mut model, None, &params, &session.bars).map_err(wrong)?
    };
    report.stages.extend(found.stages);
    report.quality = found.quality;
    report.warnings = found.warnings;
    let reach = tell_fit(&mut report, &mut model, &params, &found.seams, &args.stages)?;
    let command = if gridded { "refit" } else { "fit" };
    model.history.push(HistoryEntry { command: command.into(), parameters: model.params.clone() });
    Ok((report, model, reach))
}

/// Tells in the report what a fit of a model misses and how its patches meet, and keeps its parameters in the model.
pub fn tell_fit(
    report: &mut Report,
    model: &mut Model,
    params: &PipelineParams,
    seams: &[SeamQuality],
    stages: &AllStages,
) -> Result<Option<Reach>, Failure> {
    let reach = Reach::new(stages.demanded_tolerance(), params.fit.tolerance_of, report, model.units);
    report.warnings.extend(missed::tolerance(model, params, reach, report.input.diagonal));
    report.warnings.extend(missed::angle(model, seams, params, stages.demanded_angle()));
    report.warnings.extend(missed::inexact(seams, params));
    report.seams = seam_rows(model, seams);
    model.params = serde_json::to_string(params).map_err(Failure::fault)?;
    Ok(reach)
}

/// Refuses a model whose network does not part the mesh into four-sided patches.
fn finished(path: &Path, model: &Model) -> Result<(), Failure> {
    let left = diagnose(&model.mesh, &Adjacency::new(&model.mesh), &model.network);
    if left.is_finished() && !model.network.patches.is_empty() {
        return Ok(());
    }
    let what = match left.faults.len() {
        _ if model.network.curves.is_empty() => "has no network".to_owned(),
        1 => format!("has an unfinished network: {}", left.faults[0]),
        n => format!("has an unfinished network with {n} things to put right"),
    };
    Err(Failure::input(path, what).hint("`planish info` tells what is left to do with `planish edit`"))
}
