//! Files made of the model for download, and the script of a session.

use super::Table;
use super::exports::Ready;
use super::jobs::Outcome;
use super::keep::strokes::entry_of;
use super::project::{Fit, NO_PROJECT, Project};
use crate::protocol::{Format, Why};
use crate::web::hub::Client;
use planish::model::{HistoryEntry, Model};
use planish::observe::Observer;
use planish::pipeline;
use planish_io::report::{self, Input, Report};
use planish_io::{IgesInput, MappedMesh, StepInput, Up, UsdInput, WriteOptions};
use std::fmt::Display;
use std::path::Path;

impl<'env> Table<'_, '_, 'env> {
    pub(super) fn export(&mut self, client: &Client, id: u32, format: Format) {
        let Some(project) = self.project else { return self.refuse(client, id, Why::of(NO_PROJECT)) };
        if project.model.surfaces.is_empty() {
            let why = "there are no surfaces of these curves - hint: finish the patches and fit them first";
            return self.refuse(client, id, Why::of(why));
        }
        let model = project.whole();
        let (name, mut report) = (stem(&project.file), report(project));
        let job = self.desk.jobs.start(self.scope, ("export", "Writing the file"), move |watch| {
            if format == Format::Report && report.quality.is_empty() {
                match pipeline::assess(&model, watch) {
                    Ok(found) => (report.quality, report.warnings) = (found.quality, found.warnings),
                    Err(why) => return Outcome::Exported(Err(why.to_string())),
                }
            }
            Outcome::Exported(write(&model, format, &name, &report, watch))
        });
        self.wait_for(client, id, job);
    }
}

fn stem(file: &Path) -> String {
    file.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn write(model: &Model, format: Format, name: &str, report: &Report, observer: &dyn Observer) -> Result<Ready, String> {
    let told = |e: &dyn Display| e.to_string();
    let folder = tempfile::tempdir().map_err(|e| told(&e))?;
    let extension = match format {
        Format::Step => "step",
        Format::Iges => "igs",
        Format::Usd => "usda",
        Format::Glb => "glb",
        Format::Ply => "ply",
        Format::Report => "html",
    };
    let file = format!("{name}.{extension}");
    let path = folder.path().join(&file);
    let options = WriteOptions { units: model.units, up: Up::Z, name: name.into() };
    let mut surfaces = model.surfaces.clone();
    surfaces.iter_mut().flat_map(|s| &mut s.control).for_each(|p| *p += model.shift);
    let mesh = || -> Result<MappedMesh, String> {
        let displaced = pipeline::displaced_patches(model, observer).map_err(|e| e.to_string())?;
        Ok(MappedMesh::new(displaced, &model.reliefs))
    };
    let (network, units) = (&model.network, model.units);
    match format {
        Format::Step => {
            let step = StepInput { network, surfaces: &surfaces, units, name, time: None };
            planish_io::write_step(&path, &step).map(drop).map_err(|e| told(&e))?;
        }
        Format::Iges => {
            let iges = IgesInput { network, surfaces: &surfaces, units, name };
            planish_io::write_iges(&path, &iges).map(drop).map_err(|e| told(&e))?;
        }
        Format::Usd => {
            let mesh = mesh()?;
            let mesh = Some(("displaced", &mesh));
            let usd =
                UsdInput { surfaces: &model.surfaces, mesh, shift: model.shift, materials: &[], options: &options };
            planish_io::write_usd(&path, &usd).map_err(|e| told(&e))?;
        }
        Format::Glb => planish_io::write_patches(&path, &mesh()?, &options).map_err(|e| told(&e))?,
        Format::Ply => {
            planish_io::write_patches(&path, &mesh()?.shifted(model.shift), &options).map_err(|e| told(&e))?;
        }
        Format::Report => std::fs::write(&path, report::html(report, &[])).map_err(|e| told(&e))?,
    }
    Ok(Ready { folder, name: file })
}

/// The report of a project.
fn report(project: &Project) -> Report {
    let control: usize = project.model.surfaces.iter().map(|s| s.control.len()).sum();
    let counts = [
        ("triangles", project.mesh.triangles.len()),
        ("vertices", project.mesh.points.len()),
        ("patches", project.model.network.patches.len()),
        ("control points", control),
    ];
    let mut report = Report::new(
        "studio",
        Input {
            path: project.file.display().to_string(),
            kind: "model".into(),
            counts: counts.map(|(what, n)| (what.to_owned(), n as u64)).into(),
            units: project.model.units.symbol().into(),
            diagonal: project.mesh.bounds().diagonal(),
        },
    );
    if let Some(Fit { quality, warnings, .. }) = &project.fit {
        report.quality = quality.clone();
        report.warnings = warnings.clone();
    }
    report
}

/// The edits of a project as a script for `planish edit`, or those of its relief for `planish relief edit`.
/// # Errors
/// If a number cannot be written.
pub fn script(project: &Project, relief: bool) -> Result<String, String> {
    let (command, entries): (_, Vec<HistoryEntry>) = match relief {
        true => ("relief edit", project.kept.relief.iter().map(entry_of).collect()),
        false => ("edit", project.model.undo.iter().map(|step| step.entry.clone()).collect()),
    };
    let mut text = format!("# Edits of a session in the studio, for `planish {command}`.\n");
    for entry in entries {
        let value: serde_json::Value = serde_json::from_str(&entry.parameters).map_err(|e| e.to_string())?;
        let mut table = toml::Table::new();
        table.insert("edit".into(), toml::Value::String(entry.command));
        for (key, value) in value.as_object().into_iter().flatten() {
            if let Some(value) = as_toml(value) {
                table.insert(key.clone(), value);
            }
        }
        text.push_str("\n[[step]]\n");
        for (key, value) in &table {
            text.push_str(&format!("{key} = {value}\n"));
        }
    }
    Ok(text)
}

/// A value of JSON in TOML, which has no null.
fn as_toml(value: &serde_json::Value) -> Option<toml::Value> {
    use serde_json::Value as Json;
    Some(match value {
        Json::Null => return None,
        Json::Bool(b) => toml::Value::Boolean(*b),
        Json::Number(n) => match n.as_i64() {
            Some(i) => toml::Value::Integer(i),
            None => toml::Value::Float(n.as_f64()?),
        },
        Json::String(s) => toml::Value::String(s.clone()),
        Json::Array(list) => toml::Value::Array(list.iter().filter_map(as_toml).collect()),
        Json::Object(map) => {
            toml::Value::Table(map.iter().filter_map(|(k, v)| Some((k.clone(), as_toml(v)?))).collect())
        }
    })
}
