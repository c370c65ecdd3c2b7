//! `planish fit`: mesh and network to a model; or the surfaces of a model, and its grids where it has none.

use super::run::{Job, Made, fitted, seam_rows, summary, verdict};
use super::{Session, commit_report, pipeline_failure};
use crate::args::Fit;
use crate::failure::{Failure, Status};
use crate::files;
use crate::products::Staged;
use planish::mesh::Adjacency;
use planish::model::{HistoryEntry, Model};
use planish::network::diagnose;
use planish::pipeline::{self, Input, PipelineParams, ScanParams};
use planish_io::Up;
use planish_io::report::Report;
use std::path::Path;

pub fn fit(session: &Session, args: &Fit) -> Result<Status, Failure> {
    files::check_extension(&args.output, &["planish"])?;
    let staged = Staged::file(&args.output)?;
    let own_report = session.stage_report()?;
    let (mut report, model) = if files::is_model(&args.input) { refit(session, args)? } else { anew(session, args)? };
    let write = || planish_io::write_model(staged.file_path(), &model).map_err(|e| Failure::usage(&args.output, e));
    let ((), record) = session.step("write", write)?;
    report.stages.push(record);
    staged.commit()?;
    commit_report(own_report, &report)?;
    let demanded = args.stages.demanded_tolerance();
    if !session.common.quiet {
        session.tell_warnings(&report);
        let mut table = summary(&report, demanded);
        table.row("model", args.output.display().to_string());
        table.print();
    }
    Ok(verdict(&report, demanded))
}

/// A model of a mesh.
fn anew(session: &Session, args: &Fit) -> Result<(Report, Model), Failure> {
    args.stages.params(session.common.seed)?;
    let ((mesh, tags), read) = session.step("read", || files::tagged_mesh(&args.input))?;
    let network = files::optional_network(args.network.as_deref(), &mesh)?;
    let job = Job {
        command: "fit",
        path: &args.input,
        network_path: args.network.as_deref(),
        params: args.stages.run_params(ScanParams::default(), session.common.seed),
        demanded: args.stages.demanded_tolerance(),
        output: &args.output,
        up: Up::default(),
        truth: None,
    };
    let input = Input::Mesh { mesh: &mesh, tags: tags.as_ref(), network };
    let Made { report, model, .. } = fitted(session, &job, input, vec![read])?;
    Ok((report, model))
}

/// A model with the mesh, network and grids of another, and surfaces of its own; with grids of its own, if there are none.
fn refit(session: &Session, args: &Fit) -> Result<(Report, Model), Failure> {
    if args.network.is_some() {
        return Err(Failure::usage("--network", "does not go with a model, which has its own")
            .hint("fit its mesh: `planish export MODEL.planish --surface mesh -o MESH.ply`"));
    }
    let (mut model, read) = session.step("read", || files::model(&args.input))?;
    let gridded = !model.grids.is_empty();
    let stored = match model.params.as_str() {
        "" => PipelineParams::default(),
        json => serde_json::from_str(json).map_err(|e| {
            Failure::input(&args.input, format!("has parameters of another version ({e})")).hint("fit its mesh")
        })?,
    };
    let params = args.stages.params_over(stored, gridded, session.common.seed)?;
    if !gridded {
        finished(&args.input, &model)?;
    }
    if let Some(units) = session.common.units {
        model.units = units.into();
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
    report.seams = seam_rows(&model, &found.seams);
    model.params = serde_json::to_string(&params).map_err(Failure::fault)?;
    let command = if gridded { "refit" } else { "fit" };
    model.history.push(HistoryEntry { command: command.into(), parameters: model.params.clone() });
    Ok((report, model))
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
