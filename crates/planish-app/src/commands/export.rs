//! `planish export`: a model in another program's format.

use super::{Session, commit_report};
use crate::args::{Export, SurfaceWord};
use crate::failure::{Failure, Status};
use crate::files;
use crate::products::Staged;
use crate::summary::Summary;
use planish::pipeline;
use planish_io::WriteOptions;
use planish_io::report::Report;

/// Formats that hold the surfaces themselves.
const SURFACE_FORMATS: [&str; 2] = ["step", "stp"];
/// Formats that hold a mesh.
const MESH_FORMATS: [&str; 4] = ["ply", "obj", "stl", "glb"];

pub fn export(session: &Session, args: &Export) -> Result<Status, Failure> {
    let own_report = session.stage_report()?;
    let extension = args.output.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let maps = extension.is_empty();
    if !maps {
        files::check_extension(&args.output, &[&SURFACE_FORMATS[..], &MESH_FORMATS[..]].concat())?;
    }
    let staged = if maps { Staged::folder(&args.output)? } else { Staged::file(&args.output)? };
    let (mut model, read) = session.step("read", || files::model(&args.model))?;
    if let Some(units) = session.common.units {
        model.units = units.into();
    }
    let options = WriteOptions {
        units: model.units,
        name: args.model.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        ..WriteOptions::default()
    };
    let wrong = |e: planish_io::WriteError| Failure::usage(&args.output, e);
    let unfit = |e: pipeline::PipelineError| Failure::input(&args.model, e).hint("fit it again with `planish fit`");
    let ((), write) = session.step("write", || {
        if maps {
            return planish_io::write_relief(staged.path(""), &model).map_err(wrong);
        }
        if SURFACE_FORMATS.contains(&extension.as_str()) {
            return planish_io::write_step(staged.file_path(), &model, &options).map_err(wrong);
        }
        let mesh = match args.surface {
            SurfaceWord::Displaced => &pipeline::displaced_mesh(&model).map_err(unfit)?,
            SurfaceWord::Base => &pipeline::surface_mesh(&model).map_err(unfit)?,
            SurfaceWord::Mesh => &model.mesh,
        };
        planish_io::write_mesh(staged.file_path(), mesh, &options).map_err(wrong)
    })?;
    staged.commit()?;
    let mut report = Report::new("export", files::model_facts(&args.model, &model, model.units));
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
