//! The relief of a model: edits, layers of arrays, detail of other models; each gives another model.

use crate::error::{class, hinted, told};
use crate::surface::PyRelief;
use crate::{array, json, watch};
use planish::DVec3;
use planish::geom::is_positive;
use planish::model::{HistoryEntry, Model};
use planish::observe::Observer;
use planish::relief::layers::{self, Ground, Layer, Layers, Place, PlacePair, ReliefEdit};
use planish::relief::{Displaced, Relief, ReliefError};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use serde_json::{Value, json};

/// How far detail of another model is looked for unless the caller says, share of the diagonal: as on the command line.
const REACH: f64 = 0.02;
/// The same with pairs of places.
const REACH_OF_POINTS: f64 = 0.1;

/// Refuses a model without relief.
fn check(py: Python, model: &Model) -> PyResult<()> {
    if !model.reliefs.is_empty() && model.reliefs.len() == model.surfaces.len() {
        return Ok(());
    }
    let message = "the model has no relief yet - hint: fit it first";
    Err(hinted(py, class::ReliefError::new_err(message), message))
}

fn shapes(reliefs: &[Relief]) -> Vec<[usize; 2]> {
    reliefs.iter().map(|r| [r.rows, r.cols]).collect()
}

/// Pairs of places of an array (n, 2, 3).
fn pairs_of(given: &Bound<PyAny>) -> PyResult<Vec<PlacePair>> {
    let read = array::reals(given, "points", &[0, 2, 3])?;
    let place = |p: DVec3| Place::Space(p.to_array());
    Ok(read.vectors().chunks_exact(2).map(|p| PlacePair { from: place(p[0]), to: place(p[1]) }).collect())
}

/// The model with the detail of another.
/// * `reach` - further away than this nothing is taken over, world units
/// * `points` - places of the other model and of this one in turn, for models of a similar shape
pub fn transferred(
    py: Python,
    model: &Model,
    from: &Model,
    (reach, points): (Option<f64>, Option<&Bound<PyAny>>),
    progress: Option<&Bound<PyAny>>,
) -> PyResult<(Model, Value)> {
    check(py, model)?;
    check(py, from)?;
    let pairs = points.map(|given| pairs_of(given)).transpose()?;
    let share = if pairs.is_some() { REACH_OF_POINTS } else { REACH };
    let reach = reach.unwrap_or(share * model.mesh.bounds().diagonal());
    if !is_positive(reach) {
        return Err(PyValueError::new_err(format!("reach={reach}: a length above 0 is needed")));
    }
    let (maps, missed) = watch::run(py, "transfer", progress, |o| -> Result<_, ReliefError> {
        let ground = Ground::new(&model.network, &model.surfaces, shapes(&model.reliefs))?;
        let source = Displaced { network: &from.network, surfaces: &from.surfaces, reliefs: &from.reliefs };
        let warp = pairs.as_ref().map(|pairs| layers::warp(&ground, &source, pairs, o.one())).transpose()?;
        layers::transfer(&ground, &source, warp.as_ref(), reach, o.one())
    })?;
    let texels: usize = maps.iter().map(|m| m.vectors.len()).sum();
    let parameters = json!({ "reach": reach, "points": pairs });
    let made = recorded(model, "relief transfer", &parameters, |all| all.with("transfer", maps));
    Ok((made, json!({ "texels": texels, "missed": missed })))
}

/// The model with other maps: what they differ by from the present ones is a layer.
pub fn replaced(py: Python, model: &Model, given: &[PyRef<PyRelief>], name: &str) -> PyResult<Model> {
    check(py, model)?;
    let wanted = shapes(&model.reliefs);
    if given.len() != wanted.len() {
        let what = format!("reliefs: {} are given, and the model has {} patches", given.len(), wanted.len());
        return Err(PyValueError::new_err(what));
    }
    let mut maps: Vec<Relief> = given.iter().map(|r| r.relief().clone()).collect();
    for (k, (map, shape)) in maps.iter().zip(&wanted).enumerate() {
        if [map.rows, map.cols] != *shape {
            let found = [map.rows, map.cols];
            return Err(PyValueError::new_err(format!(
                "reliefs[{k}]: its shape is {found:?}, and {shape:?} is needed"
            )));
        }
    }
    let agree = planish::relief::agree(&model.network, &model.surfaces, &mut maps, Default::default());
    agree.map_err(|e| told(py, &e))?;
    for (map, old) in maps.iter_mut().zip(&model.reliefs) {
        map.vectors.iter_mut().zip(&old.vectors).for_each(|(new, old)| *new -= *old);
    }
    Ok(recorded(model, "relief set", &json!({ "name": name }), |all| all.with(name, maps)))
}

/// A step: an edit of the relief, or going back or on.
pub fn edited(py: Python, model: &Model, step: Value, progress: Option<&Bound<PyAny>>) -> PyResult<(Model, Value)> {
    check(py, model)?;
    let name = step.get("edit").and_then(Value::as_str).unwrap_or("").to_owned();
    let mut next = model.clone();
    if let Some(go) = match name.as_str() {
        "undo" => Some(Model::undo_relief as fn(&mut Model) -> bool),
        "redo" => Some(Model::redo_relief as fn(&mut Model) -> bool),
        _ => None,
    } {
        let count = step.get("count").map_or(Some(1), Value::as_u64);
        let count = count.ok_or_else(|| PyValueError::new_err("count: a whole number is needed"))?;
        if (0..count).any(|_| !go(&mut next)) {
            let message = format!("there is nothing left to {name} - hint: ask for fewer");
            return Err(hinted(py, class::ReliefError::new_err(message.clone()), &message));
        }
        return Ok((next, json!({})));
    }
    let edit: ReliefEdit = serde_json::from_value(step).map_err(|e| {
        let text = format!("{name}: {e}");
        if text.contains("unknown field") { PyTypeError::new_err(text) } else { PyValueError::new_err(text) }
    })?;
    next.layers.begin(&next.reliefs);
    let picture =
        |path: &str| planish_io::maps::read_picture(std::path::Path::new(path)).map_err(|e| format!("{path}: {e}"));
    let mut all = std::mem::take(&mut next.layers);
    let made = watch::run(py, "relief", progress, |o| {
        let parts = (&next.network, &next.surfaces[..]);
        layers::edit(&mut all, parts, &edit, &picture, o.one() as &dyn Observer)
    });
    next.layers = all;
    let made = made?;
    let parameters = serde_json::to_string(&edit).unwrap_or_default();
    next.record_relief(HistoryEntry { command: edit.name().into(), parameters }, made.stack);
    Ok((next, json!({ "told": made.told })))
}

fn recorded(model: &Model, command: &str, parameters: &Value, stack: impl FnOnce(&mut Layers) -> Vec<Layer>) -> Model {
    let mut next = model.clone();
    next.layers.begin(&next.reliefs);
    let stack = stack(&mut next.layers);
    next.record_relief(HistoryEntry { command: command.into(), parameters: parameters.to_string() }, stack);
    next
}

/// What an edit is told, from Python's keywords.
pub fn step(name: &str, fields: Option<&Bound<pyo3::types::PyDict>>) -> PyResult<Value> {
    let mut step = fields.map(|f| json::of(f.as_any())).transpose()?.unwrap_or(json!({}));
    step["edit"] = json!(name);
    Ok(step)
}
