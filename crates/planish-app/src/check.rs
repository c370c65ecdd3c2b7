//! Options are checked before anything is read: each in its range by the parser, then against each other here.

use crate::args::relief::ReliefCommand;
use crate::args::{Command, Export, ExportWord, ScanArgs};
use crate::failure::Failure;
use crate::files;
use planish_io::{ExportKind, MeshFormat};

/// Checks the options of a command.
/// # Errors
/// The first that a stage refuses, or that does not go with another.
pub fn check(command: &Command) -> Result<(), Failure> {
    match command {
        Command::Demo(a) => {
            a.scanner.params(None)?;
            a.meshing.params().map(drop)
        }
        Command::Run(a) => {
            a.stages.params(None)?;
            a.stages.check_curves_known(a.network.is_some())?;
            a.seams.check(a.network.is_some())?;
            a.points.params(None)?;
            columns(&a.scan)?;
            a.meshing.params().map(drop)
        }
        Command::Clean(a) => {
            a.clean.params(None)?;
            columns(&a.options)?;
            a.project.params(None).map(drop)
        }
        Command::Mesh(a) => {
            a.volume.params(None)?;
            columns(&a.scan)?;
            a.meshing.params().map(drop)
        }
        Command::Smooth(a) => a.smooth.params(None).map(drop),
        Command::Decimate(a) => a.decimate.params(None).map(drop),
        Command::Layout(a) => a.layout.params(None).map(drop),
        Command::Fit(a) => {
            a.stages.params(None)?;
            let known = a.network.is_some() || files::is_model(&a.input);
            a.stages.check_curves_known(known)?;
            a.seams.check(known)
        }
        Command::Edit(a) => a.stages.params(None).map(drop),
        Command::Relief(a) => match &a.command {
            ReliefCommand::Export(a) => a.maps.params(None).map(drop),
            ReliefCommand::Level(a) => a.stages.params(None).map(drop),
            _ => Ok(()),
        },
        Command::Export(a) => splines(a),
        Command::Compare(a) => columns(&a.scan),
        Command::Transform(a) => columns(&a.scan),
        Command::Deform(_) | Command::Info(_) | Command::Studio(_) => Ok(()),
        Command::Completions(_) | Command::Man(_) => Ok(()),
    }
}

/// Checks that the format holds splines where they are asked for.
fn splines(export: &Export) -> Result<(), Failure> {
    let is_mesh = matches!(planish_io::export_kind(&export.output), Ok(ExportKind::Mesh));
    match MeshFormat::of(&export.output).filter(|_| is_mesh) {
        Some(format) if export.surface == ExportWord::Spline && format != MeshFormat::Obj => {
            let what = format!(".{} holds no splines", format.extension());
            Err(Failure::usage("--surface spline", what).hint("write .obj, .usda or .step"))
        }
        _ => Ok(()),
    }
}

/// Checks the names of columns.
fn columns(scan: &ScanArgs) -> Result<(), Failure> {
    let Some(names) = &scan.columns else { return Ok(()) };
    planish_io::check_columns(names).map_err(|e| Failure::usage("--columns", e))
}
