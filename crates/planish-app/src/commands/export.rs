//! `planish export`: a model in another program's format.

use super::{Session, commit_report, write_relief};
use crate::args::{Export, SurfaceWord};
use crate::failure::{Failure, Status};
use crate::files;
use crate::products::Staged;
use crate::summary::Summary;
use planish::pipeline;
use planish_io::report::Report;
use planish_io::{ExportKind, StepInput, WriteError, WriteOptions};

pub fn export(session: &Session, args: &Export) -> Result<Status, Failure> {
    let own_report = session.stage_report()?;
    let wrong = |e: WriteError| Failure::usage(&args.output, e);
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
    let unfit = |e: pipeline::PipelineError| Failure::input(&args.model, e).hint("fit it again with `planish fit`");
    let ((), write) = session.step("write", || match kind {
        ExportKind::Relief => write_relief(&staged.path(""), &model, &mut report.quality).map_err(wrong),
        ExportKind::Network if model.network.patches.is_empty() => {
            Err(Failure::input(&args.model, "has no patches yet").hint("finish its network with `planish edit`"))
        }
        ExportKind::Network => {
            planish_io::write_network(staged.file_path(), &model.network, &model.mesh).map_err(wrong)
        }
        ExportKind::Step => {
            let (network, surfaces) = (&model.network, model.surfaces.as_slice());
            let step = StepInput { network, surfaces, units: model.units, name: &options.name, time: None };
            planish_io::write_step(staged.file_path(), &step).map(drop).map_err(wrong)
        }
        ExportKind::Mesh => {
            let mesh = match args.surface {
                SurfaceWord::Displaced => {
                    &pipeline::displaced_mesh(&model, &crate::progress::Interrupt).map_err(unfit)?
                }
                SurfaceWord::Base => &pipeline::surface_mesh(&model, &crate::progress::Interrupt).map_err(unfit)?,
                SurfaceWord::Mesh => &model.mesh,
            };
            planish_io::write_mesh(staged.file_path(), mesh, &options).map_err(wrong)
        }
    })?;
    staged.commit()?;
    report.stages = vec![read, write];
    commit_report(own_report, &report)?;
    if !session.common.quiet {
        let mut table = Summary::default();
        table.row("model", args.model.display().to_string());
        table.row("written", args.output.display().to_string());
        table.row("units", model.units.symbol());
        table.print();
    }
    Ok(Status::Done)
}
