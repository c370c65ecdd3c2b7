//! `planish relief`: displacement maps exported, read back, edited, parted, transferred.

mod deform;
mod edit;
mod export;
mod import;
mod points;
mod refit;
mod transfer;

pub use deform::deform;

use super::Session;
use crate::args::relief::{Relief, ReliefCommand};
use crate::failure::{Failure, Status};
use crate::files;
use crate::products::Staged;
use crate::progress::Interrupt;
use crate::summary::Summary;
use planish::mesh::TriMesh;
use planish::model::Model;
use planish::observe::Cancelled;
use planish::pipeline::{StageRecord, Warning};
use planish::relief::maps::{MapKind, MapParams};
use planish::relief::{Displaced, ReliefError};
use planish_io::report::{Report, count};
use std::borrow::Cow;
use std::path::Path;

pub fn relief(args: &Relief) -> Result<Status, Failure> {
    let session = Session::new(args.command.common())?;
    match &args.command {
        ReliefCommand::Export(a) => export::export(&session, a),
        ReliefCommand::Import(a) => import::import(&session, a),
        ReliefCommand::Edit(a) => edit::edit(&session, a),
        ReliefCommand::Part(a) => refit::part(&session, a),
        ReliefCommand::Level(a) => refit::level(&session, a),
        ReliefCommand::Transfer(a) => transfer::transfer(&session, a),
    }
}

/// Reads a model with a relief.
fn open(session: &Session, path: &Path) -> Result<(Model, StageRecord), Failure> {
    let (mut model, record) = session.step("read", || files::model(path))?;
    if let Some(units) = session.common.units {
        model.units = units.into();
    }
    if model.reliefs.is_empty() || model.surfaces.is_empty() {
        return Err(Failure::input(path, "has no relief yet").hint("fit it first with `planish fit`"));
    }
    Ok((model, record))
}

fn displaced(model: &Model) -> Displaced<'_> {
    Displaced { network: &model.network, surfaces: &model.surfaces, reliefs: &model.reliefs }
}

/// The shape that heights are measured to: the mesh that was fitted, or, where the relief was edited since, the displaced surface.
fn shape<'a>(model: &'a Model, params: &MapParams, path: &Path) -> Result<Cow<'a, TriMesh>, Failure> {
    if params.kind != MapKind::Height || model.layers.stack.is_empty() {
        return Ok(Cow::Borrowed(&model.mesh));
    }
    let Displaced { network, surfaces, reliefs } = displaced(model);
    let mesh = planish::relief::displaced_mesh(network, surfaces, reliefs, &Interrupt);
    mesh.map(Cow::Owned).map_err(|e| wrong(path, e))
}

/// Tells where the relief folds the surface over.
pub fn folds(model: &Model, report: &mut Report, path: &Path) -> Result<(), Failure> {
    let mut found: Vec<(usize, usize)> = Vec::new();
    for (p, (s, r)) in model.surfaces.iter().zip(&model.reliefs).enumerate() {
        let here = planish::relief::fold_over(s, r).map_err(|e| wrong(path, e))?.len();
        found.extend((here > 0).then_some((p, here)));
    }
    if found.is_empty() {
        return Ok(());
    }
    let texels: usize = found.iter().map(|f| f.1).sum();
    let text =
        format!("{texels} texels displace the surface beyond its focal radius. The edit `limit` brings them back.");
    let places: Vec<String> = found.iter().take(8).map(|f| f.0.to_string()).collect();
    report.warnings.push(Warning::new("relief_folds", text, format!("patches {}", places.join(", "))));
    Ok(())
}

/// What a failed edit of a relief is to the user.
fn wrong(path: &Path, error: ReliefError) -> Failure {
    match error {
        e if Cancelled::is_cause_of(&e) => Failure::interrupted(),
        e => Failure::input(path, super::with_hint(&e.to_string())),
    }
}

/// Writes the model and the report, and tells what was made.
/// * `told` - lines for the table
fn finish(
    session: &Session,
    output: &Path,
    model: &Model,
    mut report: Report,
    told: Vec<(String, String)>,
) -> Result<Status, Failure> {
    let own_report = session.stage_report()?;
    let staged = Staged::file(output)?;
    report.stages.push(session.write_model(&staged, model, output)?);
    if session.hand_over([staged], own_report, &report)? {
        let mut table = Summary::default();
        for (name, value) in told {
            table.row(name, value);
        }
        let texels: usize = model.reliefs.iter().map(|r| r.vectors.len()).sum();
        table.row("relief", format!("{} texels", count(texels as u64)));
        let layer = |l: &planish::relief::layers::Layer| match l.amount {
            1.0 => l.name.clone(),
            amount => format!("{} x {amount}", l.name),
        };
        if !model.layers.stack.is_empty() {
            let names: Vec<String> = model.layers.stack.iter().map(layer).collect();
            table.row("layers", names.join(", "));
            let (back, again) = (model.layers.undo.len(), model.layers.redo.len());
            table.row("history", format!("{back} to take back, {again} to make again"));
        }
        table.row("model", output.display().to_string());
        table.print();
    }
    Ok(Status::Done)
}
