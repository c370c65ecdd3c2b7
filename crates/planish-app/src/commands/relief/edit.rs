//! `planish relief edit`: a script of edits, each a layer with an entry of the history.

use super::super::Session;
use super::super::edit::read_text;
use super::{finish, folds, open, wrong};
use crate::args::relief::ReliefEdit as Args;
use crate::failure::{Failure, Status};
use crate::files;
use crate::pictures::{self, View};
use crate::products::Staged;
use planish::model::{HistoryEntry, Model};
use planish::pipeline::Warning;
use planish::relief::layers::{self, Layered, Picture, ReliefEdit};
use planish_io::report::Report;
use serde::Deserialize;
use std::path::Path;
use toml::Spanned;

/// A script as it stands in its file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Script {
    /// The edits, one after the other.
    #[serde(default)]
    step: Vec<Spanned<toml::Value>>,
    /// What a picture shows.
    #[serde(default)]
    view: View,
}

/// A step: an edit, or going back or on.
#[derive(Debug)]
enum Step {
    Edit(Box<ReliefEdit>),
    Undo(usize),
    Redo(usize),
}

/// `undo` and `redo`
#[derive(Deserialize)]
#[serde(tag = "edit", rename_all = "snake_case", deny_unknown_fields)]
enum Back {
    Undo {
        #[serde(default = "one")]
        count: usize,
    },
    Redo {
        #[serde(default = "one")]
        count: usize,
    },
}

fn one() -> usize {
    1
}

pub fn edit(session: &Session, args: &Args) -> Result<Status, Failure> {
    files::check_extension(&args.output, &["planish"])?;
    let (steps, view) = read_script(&args.script)?;
    let (mut model, read) = open(session, &args.model)?;
    let mut report = Report::new("relief edit", files::model_facts(&args.model, &model, model.units));
    report.stages.push(read);
    let warnings = &mut report.warnings;
    let (told, record) = session.step("edit", || replay(session, args, &steps, &mut model, warnings))?;
    report.stages.push(record);
    folds(&model, &mut report, &args.model)?;
    if let Some(file) = &args.picture {
        draw(&model, &view, file, args)?;
    }
    finish(session, &args.output, &model, report, told)
}

/// Draws the displaced surface and the borders of its patches; red is what is displaced beyond the focal radius.
fn draw(model: &Model, view: &View, file: &Path, args: &Args) -> Result<(), Failure> {
    let patched = planish::pipeline::displaced_patches(model, &crate::progress::Interrupt)
        .map_err(|e| Failure::input(&args.model, e))?;
    let point = |nodes: &planish::relief::PatchNodes, k: usize| patched.mesh.points[nodes.vertices[k] as usize];
    let borders = patched.patches.iter().flat_map(|nodes| {
        let (rows, cols) = (nodes.rows, nodes.cols);
        let row = |j: usize| (0..cols).map(|i| point(nodes, j * cols + i)).collect::<Vec<_>>();
        let column = |i: usize| (0..rows).map(|j| point(nodes, j * cols + i)).collect::<Vec<_>>();
        [row(0), row(rows - 1), column(0), column(cols - 1)]
    });
    let mut beyond = vec![false; patched.mesh.points.len()];
    for ((nodes, surface), relief) in patched.patches.iter().zip(&model.surfaces).zip(&model.reliefs) {
        let folded = planish::relief::fold_over(surface, relief).map_err(|e| wrong(&args.model, e))?;
        folded.into_iter().for_each(|node| beyond[nodes.vertices[node] as usize] = true);
    }
    let png = pictures::clay(&patched.mesh, borders.collect(), &beyond, view)?;
    let staged = Staged::file(file)?;
    std::fs::write(staged.file_path(), png).map_err(|e| Failure::usage(file, e))?;
    staged.commit()
}

fn read_script(path: &Path) -> Result<(Vec<(Step, usize)>, View), Failure> {
    let text = read_text(path)?;
    let line = |at: usize| text[..at.min(text.len())].matches('\n').count() + 1;
    let failed = |message: &str, line: Option<usize>| {
        let place = line.map_or(String::new(), |n| format!(" (line {n})"));
        let message = message.trim().replace('\n', ", ");
        Failure::input(path, format!("{message}{place}")).hint("see docs/guide/relief.md for the edits")
    };
    let script: Script = toml::from_str(&text).map_err(|e| failed(e.message(), e.span().map(|s| line(s.start))))?;
    let mut steps = Vec::with_capacity(script.step.len());
    for (k, step) in script.step.into_iter().enumerate() {
        let line = line(step.span().start);
        let value = step.into_inner();
        let word = value.get("edit").and_then(|w| w.as_str()).unwrap_or_default().to_owned();
        let parsed = match word.as_str() {
            "undo" | "redo" => value.try_into().map(|back| match back {
                Back::Undo { count } => Step::Undo(count),
                Back::Redo { count } => Step::Redo(count),
            }),
            _ => value.try_into().map(|edit| Step::Edit(Box::new(edit))),
        };
        let parsed = parsed.map_err(|e| failed(&format!("step {}: {}", k + 1, e.message()), Some(line)))?;
        steps.push((parsed, line));
    }
    Ok((steps, script.view))
}

fn replay(
    session: &Session,
    args: &Args,
    steps: &[(Step, usize)],
    model: &mut Model,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<(String, String)>, Failure> {
    let mut told = Vec::new();
    if steps.is_empty() {
        warnings.push(Warning::new("nothing_edited", "The script has no steps.", args.script.display().to_string()));
    }
    for (k, (step, line)) in steps.iter().enumerate() {
        let number = format!("step {}", k + 1);
        let nothing =
            |what: &str| Failure::input(&args.script, format!("{number} (line {line}): {what}")).hint("ask for fewer");
        match step {
            Step::Undo(count) => {
                if (0..*count).any(|_| !model.undo_relief()) {
                    return Err(nothing("there is nothing left to take back"));
                }
                told.push((number, "undo".into()));
            }
            Step::Redo(count) => {
                if (0..*count).any(|_| !model.redo_relief()) {
                    return Err(nothing("there is nothing left to make again"));
                }
                told.push((number, "redo".into()));
            }
            Step::Edit(edit) => {
                let made = make(session, args, edit, model).map_err(|e| match e {
                    planish::relief::ReliefError::Edit { what } => {
                        Failure::input(&args.script, format!("{number} ({}, line {line}): {what}", edit.name()))
                            .hint("see docs/guide/relief.md")
                    }
                    other => wrong(&args.model, other),
                })?;
                // What brings nothing back is told by its count.
                if made.idle && !matches!(**edit, ReliefEdit::Limit(_)) {
                    let text = format!("The {} of {number} moves no texel: nothing lies where it would.", edit.name());
                    warnings.push(Warning::new("nothing_edited", text, format!("line {line}")));
                }
                told.push((number, edit.name().into()));
                told.extend(made.told.into_iter().map(|line| (String::new(), line)));
            }
        }
    }
    Ok(told)
}

fn make(
    session: &Session,
    args: &Args,
    edit: &ReliefEdit,
    model: &mut Model,
) -> Result<Layered, planish::relief::ReliefError> {
    let picture = |name: &str| -> Result<Picture, String> {
        let path = args.script.parent().unwrap_or(Path::new("")).join(name);
        planish_io::maps::read_picture(&path).map_err(|e| format!("the image {name}: {e}"))
    };
    model.layers.begin(&model.reliefs);
    let parts = (&model.network, &model.surfaces[..]);
    let made = layers::edit(&mut model.layers, parts, edit, &picture, &session.bars)?;
    let parameters = serde_json::to_string(edit).unwrap_or_default();
    model.record_relief(HistoryEntry { command: edit.name().into(), parameters }, made.stack.clone());
    Ok(made)
}
