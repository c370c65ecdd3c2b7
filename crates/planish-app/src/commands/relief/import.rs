//! `planish relief import`: images that were edited elsewhere become a layer.

use super::super::Session;
use super::{displaced, finish, open, shape, wrong};
use crate::args::relief::ReliefImport;
use crate::failure::{Failure, Status};
use crate::files;
use crate::progress::Interrupt;
use planish::model::{HistoryEntry, Model};
use planish::pipeline::Warning;
use planish::relief::{self, Displaced, Relief, maps};
use planish_io::maps::{ReadMaps, as_read, read_maps, relief_sum, surfaces_sum};
use planish_io::report::{Report, count};

pub fn import(session: &Session, args: &ReliefImport) -> Result<Status, Failure> {
    files::check_extension(&args.output, &["planish"])?;
    let (mut model, read) = open(session, &args.model)?;
    let mut report = Report::new("relief import", files::model_facts(&args.model, &model, model.units));
    let (told, record) = session.step("import", || {
        let found = read_maps(&args.maps).map_err(|e| Failure::input(&args.maps, e))?;
        take_over(&mut model, args, found, &mut report.warnings)
    })?;
    report.stages = vec![read, record];
    finish(session, &args.output, &model, report, vec![("imported".into(), told)])
}

fn take_over(
    model: &mut Model,
    args: &ReliefImport,
    found: ReadMaps,
    warnings: &mut Vec<Warning>,
) -> Result<String, Failure> {
    let ReadMaps { sidecar, maps: edited } = found;
    let other =
        |what: String| Err(Failure::input(&args.maps, what).hint("import them into the model they were exported from"));
    if edited.len() != model.reliefs.len() {
        return other(format!("has maps of {} patches for a model of {}", edited.len(), model.reliefs.len()));
    }
    if sidecar.surfaces != surfaces_sum(&model.surfaces) {
        return other("has maps of other surfaces than this model's".into());
    }
    let failed = |e| wrong(&args.maps, e);
    let now = displaced(model);
    let mesh = shape(model, &sidecar.params, &args.model)?;
    let made = maps::render(&now, &mesh, &sidecar.params, &Interrupt).map_err(failed)?;
    if made.iter().zip(&edited).any(|(a, b)| (a.rows, a.cols) != (b.rows, b.cols)) {
        return other("has maps of another size than the model's relief has now".into());
    }
    let made = as_read(made, &sidecar);
    let changed: usize = edited
        .iter()
        .zip(&made)
        .map(|(a, b)| {
            let texels = a.values.chunks_exact(a.channels).zip(b.values.chunks_exact(b.channels));
            texels.filter(|(x, y)| x != y).count()
        })
        .sum();
    let mut reliefs = maps::read_back(&now, &sidecar.params, &edited, &made, &Interrupt).map_err(failed)?;
    if changed == 0 {
        return Ok("nothing was changed".into());
    }
    relief::agree(&model.network, &model.surfaces, &mut reliefs, args.seams.into()).map_err(failed)?;
    Displaced { reliefs: &reliefs, ..now }.check_lengths().map_err(failed)?;
    if sidecar.relief.is_some_and(|sum| sum != relief_sum(&model.reliefs)) {
        let text = "The relief was edited after these maps were exported: where they differ, the maps undo these edits. \
                    Export again, paint, and import that.";
        warnings.push(Warning::new("maps_older_than_model", text, args.maps.display().to_string()));
    }
    model.layers.begin(&model.reliefs);
    let shapes: Vec<[usize; 2]> = reliefs.iter().map(|r| [r.rows, r.cols]).collect();
    model.layers.stack = model.layers.reshaped(&model.network, &model.surfaces, &shapes).map_err(failed)?;
    let below = model.layers.sum().unwrap_or_default();
    let difference = |(new, old): (&Relief, &Relief)| Relief {
        vectors: new.vectors.iter().zip(&old.vectors).map(|(a, b)| *a - *b).collect(),
        ..*new
    };
    let layer: Vec<Relief> = reliefs.iter().zip(&below).map(difference).collect();
    let stack = model.layers.with("import", layer);
    let entry = HistoryEntry {
        command: "relief import".into(),
        parameters: serde_json::json!({ "kind": sidecar.params.kind.word(), "texels": changed }).to_string(),
    };
    model.record_relief(entry, stack);
    Ok(format!("{} changed texels", count(changed as u64)))
}
