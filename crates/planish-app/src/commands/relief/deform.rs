//! `planish deform`: other control points, the same relief.

use super::super::Session;
use super::super::edit::read_text;
use super::{finish, open, wrong};
use crate::args::relief::Deform;
use crate::failure::{Failure, Status};
use crate::files;
use crate::progress::Interrupt;
use planish::model::{HistoryEntry, Model};
use planish::pipeline::{self, Move};
use planish::surface::Surface;
use planish_io::report::{Report, number};
use serde::Deserialize;

/// A list of moves as it stands in its file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Moves {
    /// The moves.
    #[serde(rename = "move")]
    moves: Vec<Move>,
}

pub fn deform(session: &Session, args: &Deform) -> Result<Status, Failure> {
    files::check_extension(&args.output, &["planish"])?;
    files::check_extension(&args.to, &["obj", "planish", "step", "stp", "toml"])?;
    let (model, read) = open(session, &args.model)?;
    let mut report = Report::new("deform", files::model_facts(&args.model, &model, model.units));
    let ((model, told), record) = session.step("deform", || {
        let (surfaces, told) = surfaces(&model, args)?;
        let failed = |e: pipeline::PipelineError| Failure::input(&args.to, super::super::with_hint(&e.to_string()));
        let mut deformed = pipeline::deform(&model, surfaces, &Interrupt).map_err(failed)?;
        let name = args.to.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let parameters = serde_json::json!({ "to": name }).to_string();
        deformed.history.push(HistoryEntry { command: "deform".into(), parameters });
        Ok((deformed, told))
    })?;
    report.stages = vec![read, record];
    finish(session, &args.output, &model, report, vec![("deformed".into(), told)])
}

/// The surfaces that are asked for, and what to tell of them.
fn surfaces(model: &Model, args: &Deform) -> Result<(Vec<Surface>, String), Failure> {
    let failed = |e| wrong(&args.to, e);
    let extension = args.to.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let mut loaded = match extension.as_str() {
        "toml" => {
            let Moves { moves } = toml::from_str(&read_text(&args.to)?).map_err(|e| {
                let what = e.message().trim().replace('\n', ", ");
                Failure::input(&args.to, what).hint("write `[[move]]` tables with patch, i, j and by = [x, y, z]")
            })?;
            let surfaces = pipeline::moved(&model.network, &model.surfaces, &moves).map_err(failed)?;
            return Ok((surfaces, format!("{} control points moved", moves.len())));
        }
        "planish" => files::model(&args.to)?.surfaces,
        "step" | "stp" => {
            let (mut surfaces, units) =
                planish_io::read_step_surfaces(&args.to).map_err(|e| Failure::input(&args.to, e))?;
            let scale = units.metres() / model.units.metres();
            surfaces.iter_mut().flat_map(|s| &mut s.control).for_each(|p| *p = scale * *p - model.shift);
            surfaces
        }
        _ => {
            let mut surfaces = planish_io::read_obj_surfaces(&args.to).map_err(|e| Failure::input(&args.to, e))?;
            surfaces.iter_mut().flat_map(|s| &mut s.control).for_each(|p| *p -= model.shift);
            surfaces
        }
    };
    if loaded.len() != model.surfaces.len() {
        let what = format!("has {} surfaces for the {} patches of the model", loaded.len(), model.surfaces.len());
        return Err(Failure::input(&args.to, what).hint("give surfaces of the same network, in its order"));
    }
    if matches!(extension.as_str(), "step" | "stp") {
        // CAD programs keep neither the order of faces nor their parameters.
        loaded = pipeline::matched(&model.surfaces, &loaded);
    }
    let apart = pipeline::join(&model.network, &mut loaded).map_err(failed)?;
    Ok((loaded, format!("surfaces loaded; their seams were apart by {} {} at most", number(apart), model.units)))
}
