//! `planish export`: a model in another program's format.

use super::{Session, write_failure, write_relief};
use crate::args::{Export, ExportWord};
use crate::failure::{Failure, Status};
use crate::files;
use crate::placed;
use crate::products::Staged;
use crate::progress::Interrupt;
use crate::summary::Summary;
use planish::Model;
use planish::pipeline::{self, PipelineError};
use planish::relief::PatchedMesh;
use planish_io::report::Report;
use planish_io::{ExportKind, IgesInput, MappedMesh, StepInput, UsdInput, WriteError, WriteOptions};

pub fn export(session: &Session, args: &Export) -> Result<Status, Failure> {
    let own_report = session.stage_report()?;
    let wrong = |e: WriteError| write_failure(&args.model, &args.output, e);
    let kind = planish_io::export_kind(&args.output).map_err(wrong)?;
    let staged = if kind == ExportKind::Relief { Staged::folder(&args.output)? } else { Staged::file(&args.output)? };
    let (mut model, read) = session.step("read", || files::model(&args.model))?;
    if let Some(units) = session.common.units {
        model.units = units.into();
    }
    let options = WriteOptions {
        units: model.units,
        name: args.model.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        up: args.up.into(),
    };
    let mut report = Report::new("export", files::model_facts(&args.model, &model, model.units));
    let unfit = |e: PipelineError| Failure::input(&args.model, e).hint("fit it again with `planish fit`");
    let ((), write) = session.step("write", || match kind {
        ExportKind::Relief => write_relief(&staged.path(""), &model, &mut report.quality).map_err(wrong),
        ExportKind::Network if model.network.patches.is_empty() => {
            Err(Failure::input(&args.model, "has no patches yet").hint("finish its network with `planish edit`"))
        }
        ExportKind::Network => {
            planish_io::write_network(staged.file_path(), &model.network, &model.mesh).map_err(wrong)
        }
        ExportKind::Step => {
            let (network, surfaces) = (&model.network, placed::surfaces(&model));
            let step = StepInput { network, surfaces: &surfaces, units: model.units, name: &options.name, time: None };
            planish_io::write_step(staged.file_path(), &step).map(drop).map_err(wrong)
        }
        ExportKind::Iges => {
            let (network, surfaces) = (&model.network, placed::surfaces(&model));
            let iges = IgesInput { network, surfaces: &surfaces, units: model.units, name: &options.name };
            planish_io::write_iges(staged.file_path(), &iges).map(drop).map_err(wrong)
        }
        ExportKind::Usd => {
            let mesh = named_mesh(&model, args.surface).map_err(unfit)?;
            let mesh = mesh.as_ref().map(|(name, mesh)| (*name, mesh));
            let usd =
                UsdInput { surfaces: &model.surfaces, mesh, shift: model.shift, materials: &[], options: &options };
            planish_io::write_usd(staged.file_path(), &usd).map_err(wrong)
        }
        ExportKind::Mesh => match named_mesh(&model, args.surface).map_err(unfit)? {
            Some((_, mesh)) => {
                let moved = placed::write_patches(&staged.file_path(), mesh, model.shift, &options).map_err(wrong)?;
                report.warnings.extend(moved);
                Ok(())
            }
            None => planish_io::write_obj_surfaces(staged.file_path(), &placed::surfaces(&model)).map_err(wrong),
        },
    })?;
    report.stages = vec![read, write];
    if session.hand_over([staged], own_report, &report)? {
        let mut table = Summary::default();
        table.row("model", args.model.display().to_string());
        table.row("written", args.output.display().to_string());
        table.row("units", model.units.symbol());
        table.print();
    }
    Ok(Status::Done)
}

/// The mesh that is asked for, near the origin, and its name; none for the splines.
fn named_mesh(model: &Model, word: ExportWord) -> Result<Option<(&'static str, MappedMesh)>, PipelineError> {
    let (name, patched) = match word {
        ExportWord::Displaced => ("displaced", pipeline::displaced_patches(model, &Interrupt)?),
        ExportWord::Base => ("base", pipeline::surface_patches(model, &Interrupt)?),
        ExportWord::Mesh => ("mesh", PatchedMesh { mesh: model.mesh.clone(), patches: Vec::new() }),
        ExportWord::Spline => return Ok(None),
    };
    Ok(Some((name, MappedMesh::new(patched, &model.reliefs))))
}
