//! `planish edit`: a script of edits applied to a model, as one history.

use super::fit::tell_fit;
use super::run::{summary, verdict};
use super::{Session, pipeline_failure};
use crate::args::{AllStages, Edit as EditArgs};
use crate::failure::{Failure, Status};
use crate::files;
use crate::outputs;
use crate::pictures::{self, View};
use crate::placed::Placed;
use crate::products::Staged;
use crate::summary::Summary;
use crate::tolerance::Scale;
use planish::edit::{self, ApplyError, Edit, Ground, Made, Redo, Undo};
use planish::model::{Drawing, HistoryEntry, Model};
use planish::network::{Diagnosis, diagnose};
use planish::observe::Cancelled;
use planish::pipeline::{self, Earlier, PipelineParams, Warning};
use planish_io::report::{EditRow, RelaxedRow, Report, count, number};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// A script as it stands in its file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    /// The edits, one after the other.
    #[serde(default)]
    step: Vec<Spanned<toml::Value>>,
    /// What pictures show.
    #[serde(default)]
    view: View,
}

/// A script.
struct Script {
    /// The edits, one after the other, with their lines.
    steps: Vec<(Edit, usize)>,
    /// What pictures show.
    view: View,
}

pub fn edit(session: &Session, args: &EditArgs) -> Result<Status, Failure> {
    let from_mesh = !files::is_model(&args.input);
    let output = match &args.output {
        Some(output) => output.clone(),
        None if from_mesh => {
            return Err(Failure::usage("--output", "is needed with a mesh").hint("name a .planish file with -o"));
        }
        None => args.input.clone(),
    };
    files::check_extension(&output, &["planish"])?;
    let script = read_script(&args.script)?;
    let own_report = session.stage_report()?;
    let (mut model, read) = session.step("read", || start(session, args))?;
    let params = params(session, args, &model)?;
    // With other parameters the grids of the model are of no use.
    let earlier = if args.stages.none_given() { Earlier::of(&model) } else { None };
    let mut report = Report::new("edit", files::model_facts(&args.input, &model, model.units));
    report.stages.push(read);
    let (Replayed { found, pictures, rows }, record) =
        session.step("edit", || replay(session, args, &script, &mut model))?;
    report.stages.push(record);
    report.edits = rows;
    for fault in &found.faults {
        report.warnings.push(Warning::new("network_unfinished", fault.to_string(), ""));
    }
    let finished = found.is_finished() && !model.network.patches.is_empty();
    let mut reach = None;
    if finished && !args.no_fit && model.grids.is_empty() {
        let wrong = |e| pipeline_failure(&args.input, None, e);
        args.stages.check_curves(&model.network)?;
        let made = pipeline::rework(&mut model, earlier.as_ref(), &params, &session.bars).map_err(wrong)?;
        report.stages.extend(made.stages);
        report.quality = made.quality;
        report.warnings.extend(made.warnings);
        reach = tell_fit(&mut report, &mut model, &params, &made.seams, &args.stages)?;
    } else if !args.stages.none_given() {
        // What was asked for now counts when the model is fitted.
        model.params = serde_json::to_string(&params).map_err(Failure::fault)?;
    }
    let staged = Staged::file(&output)?;
    report.stages.push(session.write_model(&staged, &model, &output)?);
    if let Some(folder) = &args.pictures {
        std::fs::create_dir_all(folder).map_err(|e| Failure::usage(folder, format!("cannot be made ({e})")))?;
    }
    let files: Vec<PathBuf> = pictures.iter().map(|(file, _)| file.clone()).collect();
    outputs::allow(&[&args.input, &args.script, &output], &files, session.common.policy())?;
    for (file, png) in &pictures {
        std::fs::write(file, png).map_err(|e| Failure::usage(file, e))?;
    }
    if session.hand_over([staged], own_report, &report)? {
        let mut table = if model.surfaces.is_empty() { Summary::default() } else { summary(&report, reach) };
        let network = &model.network;
        for row in &report.edits {
            table.row(format!("step {}", row.step), told_row(row));
        }
        table.row(
            "network",
            format!(
                "{} corners, {} curves, {} patches{}",
                count(network.corners.len() as u64),
                count(network.curves.len() as u64),
                count(network.patches.len() as u64),
                if finished { ", finished" } else { ", not finished" }
            ),
        );
        if !model.sketch.features.is_empty() {
            table.row("feature curves", count(model.sketch.features.len() as u64));
        }
        table.row("history", format!("{} to take back, {} to make again", model.undo.len(), model.redo.len()));
        table.row("model", output.display().to_string());
        table.print();
    }
    Ok(if model.surfaces.is_empty() { Status::Done } else { verdict(&report, reach) })
}

fn read_script(path: &Path) -> Result<Script, Failure> {
    let text = read_text(path)?;
    let line = |at: usize| text[..at.min(text.len())].matches('\n').count() + 1;
    let wrong = |message: &str, line: Option<usize>| {
        let place = line.map_or(String::new(), |n| format!(" (line {n})"));
        let mut message = message.trim().replace('\n', ", ");
        for (name, words) in [("usize", "a whole number, 0 or more"), ("u32", "a whole number, 0 or more")] {
            message = message.replace(&format!("expected {name}"), &format!("expected {words}"));
        }
        Failure::input(path, format!("{message}{place}")).hint("see docs/guide/edit.md for the edits")
    };
    let script: Text = toml::from_str(&text).map_err(|e| wrong(e.message(), e.span().map(|s| line(s.start))))?;
    let mut steps = Vec::with_capacity(script.step.len());
    for (k, step) in script.step.into_iter().enumerate() {
        let line = line(step.span().start);
        let edit =
            step.into_inner().try_into().map_err(|e| wrong(&format!("step {}: {}", k + 1, e.message()), Some(line)))?;
        steps.push((edit, line));
    }
    Ok(Script { steps, view: script.view })
}

/// Names of the edits of a script, in their order.
/// # Errors
/// If it is no script of edits.
pub fn step_names(path: &Path) -> Result<Vec<String>, Failure> {
    Ok(read_script(path)?.steps.iter().map(|(edit, _)| edit.name()).collect())
}

/// The text of a script.
/// # Errors
/// If it cannot be read, or is no text.
pub fn read_text(path: &Path) -> Result<String, Failure> {
    let bytes = planish_io::read_bytes(path).map_err(|e| Failure::input(path, e))?;
    String::from_utf8(bytes).map_err(|e| {
        let line = e.as_bytes()[..e.utf8_error().valid_up_to()].iter().filter(|&&b| b == b'\n').count() + 1;
        Failure::input(path, format!("is no text in UTF-8 (line {line})")).hint("save it as UTF-8 in your editor")
    })
}

/// The model to start from.
fn start(session: &Session, args: &EditArgs) -> Result<Model, Failure> {
    if files::is_model(&args.input) {
        let mut model = files::model(&args.input)?;
        if let Some(units) = session.common.units {
            model.units = units.into();
        }
        return Ok(model);
    }
    let placed = Placed::new(files::mesh(&args.input)?, None);
    let (mesh, _) =
        planish::mend::repair(&placed.mesh, &crate::progress::Interrupt).map_err(|e| Failure::input(&args.input, e))?;
    Ok(Model { mesh, units: session.units_of(&args.input), shift: placed.shift, ..Model::default() })
}

/// The model's own parameters, with the options given in place.
fn params(session: &Session, args: &EditArgs, model: &Model) -> Result<PipelineParams, Failure> {
    let scale = Scale { diagonal: model.mesh.bounds().diagonal(), units: model.units };
    let given = args.stages.params_suiting(PipelineParams::default(), session.common.seed, scale)?;
    match model.params.as_str() {
        "" => Ok(given),
        json if args.stages.none_given() => {
            AllStages::stored(json).map_err(|e| Failure::input(&args.input, e).hint("give them as options"))
        }
        _ => Ok(given),
    }
}

/// Pictures with the files that they go to.
type Pictures = Vec<(PathBuf, Vec<u8>)>;

/// What came of a script.
struct Replayed {
    /// What is left to do on the network.
    found: Diagnosis,
    /// The pictures, if they are asked for.
    pictures: Pictures,
    /// What every edit did.
    rows: Vec<EditRow>,
}

/// Applies the edits.
fn replay(session: &Session, args: &EditArgs, script: &Script, model: &mut Model) -> Result<Replayed, Failure> {
    // The mesh stays as it is, so that all edits share what is made ready of it.
    let mesh = std::mem::take(&mut model.mesh);
    let ground = Ground::new(&mesh);
    let others = |name: &str| other(&args.script, name);
    let mut pictures = Pictures::new();
    let mut rows = Vec::with_capacity(script.steps.len());
    let mut step = |k: usize, edit: &Edit, line: usize| -> Result<(), Failure> {
        let wrong = |e| told(&args.script, k, line, edit, e);
        let made = one(model, edit, &ground, &others, session).map_err(wrong)?;
        rows.push(row(k, edit, line, made));
        if let Some(folder) = &args.pictures {
            let file = folder.join(format!("{:02}-{}.png", k + 1, edit.name()));
            pictures.push((file, pictures::drawing(&mesh, &model.drawing(), &script.view)?));
        }
        Ok(())
    };
    let outcome = script.steps.iter().enumerate().try_for_each(|(k, (edit, line))| step(k, edit, *line));
    let found = diagnose(&mesh, &ground.canvas.adjacency, &model.network);
    drop(ground);
    model.mesh = mesh;
    outcome?;
    Ok(Replayed { found, pictures, rows })
}

/// What an edit did, for the report.
fn row(k: usize, edit: &Edit, line: usize, made: Made) -> EditRow {
    let relaxed = made.relaxed.iter().map(|r| RelaxedRow {
        curve: r.curve,
        sweeps: r.relaxed.sweeps,
        settled: r.relaxed.settled,
        last_move: r.relaxed.last_move,
        energy: r.relaxed.energy.map(|e| e.total()),
        terms: r.relaxed.energy.map(|e| [e.fairness, e.curvature, e.arc_length]),
    });
    EditRow {
        step: k + 1,
        line,
        edit: edit.name(),
        changed: made.changed,
        corners: made.corners,
        curves: made.curves,
        features: made.features,
        relaxed: relaxed.collect(),
        faults: made.faults.map(|f| f.len()),
    }
}

/// Where an edit changes more runs of numbers than this the table tells how many; the report has them all.
const MOST_RUNS: usize = 8;

/// What an edit did, in words.
fn told_row(row: &EditRow) -> String {
    let mut parts = Vec::new();
    for (what, list) in [("corner", &row.corners), ("curve", &row.curves), ("feature curve", &row.features)] {
        let s = if list.len() > 1 { "s" } else { "" };
        match runs(list) {
            runs if runs.is_empty() => {}
            runs if runs.len() > MOST_RUNS => parts.push(format!("{} {what}s", list.len())),
            runs => parts.push(format!("{what}{s} {}", runs.join(", "))),
        }
    }
    match &row.relaxed[..] {
        [] => {}
        [one] => parts.push(format!(
            "{} after {} sweeps, energy {} to {}",
            if one.settled { "at rest" } else { "not at rest" },
            one.sweeps,
            number(one.energy[0]),
            number(one.energy[1])
        )),
        all => {
            let settled = all.iter().filter(|r| r.settled).count();
            parts.push(format!("{settled} of {} curves at rest", all.len()));
        }
    }
    match row.faults {
        Some(0) => parts.push("all patches".into()),
        Some(n) => parts.push(format!("{n} to put right")),
        None => {}
    }
    let name = &row.edit;
    if !row.changed {
        return format!("{name}: nothing to change");
    }
    if parts.is_empty() { name.clone() } else { format!("{name}: {}", parts.join(", ")) }
}

/// Numbers with their runs drawn together: `3`, `5 to 9`.
fn runs(list: &[u32]) -> Vec<String> {
    let mut runs: Vec<[u32; 2]> = Vec::new();
    for &k in list {
        match runs.last_mut() {
            Some(run) if run[1] + 1 == k => run[1] = k,
            _ => runs.push([k, k]),
        }
    }
    let word = |&[a, b]: &[u32; 2]| match b - a {
        0 => a.to_string(),
        1 => format!("{a}, {b}"),
        _ => format!("{a} to {b}"),
    };
    runs.iter().map(word).collect()
}

enum Wrong {
    Apply(ApplyError),
    Nothing(&'static str),
}

impl From<ApplyError> for Wrong {
    fn from(e: ApplyError) -> Wrong {
        Wrong::Apply(e)
    }
}

fn one(
    model: &mut Model,
    edit: &Edit,
    ground: &Ground,
    others: &edit::Others,
    session: &Session,
) -> Result<Made, Wrong> {
    let before: Drawing = model.drawing();
    let moved = match edit {
        Edit::Undo(Undo { count }) => (0..*count).try_for_each(|_| match model.undo() {
            true => Ok(()),
            false => Err(Wrong::Nothing("there is nothing left to take back")),
        }),
        Edit::Redo(Redo { count }) => (0..*count).try_for_each(|_| match model.redo() {
            true => Ok(()),
            false => Err(Wrong::Nothing("there is nothing left to make again")),
        }),
        edit => {
            let mut drawing = before;
            let made = edit::apply(&mut drawing, edit, ground, others, &session.bars)?;
            model.record(HistoryEntry { command: edit.name(), parameters: edit.parameters() }, drawing);
            return Ok(made);
        }
    };
    moved.map(|()| Made::between(&before, &model.drawing()))
}

fn told(script: &Path, k: usize, line: usize, edit: &Edit, wrong: Wrong) -> Failure {
    let name = format!("{}, line {line}", edit.name());
    match wrong {
        Wrong::Apply(e) if Cancelled::is_cause_of(&e) => Failure::interrupted(),
        Wrong::Apply(e) => {
            Failure::input(script, format!("step {} ({name}): {}", k + 1, super::with_hint(&e.to_string())))
        }
        Wrong::Nothing(what) => {
            Failure::input(script, format!("step {} ({name}): {what}", k + 1)).hint("ask for fewer")
        }
    }
}

/// Another model, named relative to the script.
fn other(script: &Path, name: &str) -> Result<(planish::mesh::TriMesh, Drawing), String> {
    let path = script.parent().unwrap_or(Path::new("")).join(name);
    let model = planish_io::read_model(&path).map_err(|e| e.to_string())?;
    let drawing = model.drawing();
    Ok((model.mesh, drawing))
}
