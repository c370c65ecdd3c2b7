//! Steps that can be taken back or made again: each holds the drawing on its other side.
//!
//! Most curves are the same from step to step, so all chains of places stand once in a pool, and a drawing names them
//! by number.

use super::ProjectError;
use super::array::{Array, Arrays, Loaded, add_places, are_weights, damaged, places};
use planish::grid::FeatureCurve;
use planish::mesh::FacePoint;
use planish::model::{Drawing, HistoryEntry, Model, Sketch, Step};
use planish::network::{Corner, Curve, CurveKind, Network, Patch};
use rusqlite::{Connection, Transaction, params};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Drawn {
    /// Chain of the corners.
    corners: usize,
    curves: Vec<DrawnCurve>,
    patches: Vec<Patch>,
    /// The sketch with empty feature curves, and the chains of these.
    sketch: Sketch,
    features: Vec<usize>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct DrawnCurve {
    corners: [u32; 2],
    kind: CurveKind,
    chain: usize,
}

/// Chains by their content.
#[derive(Default)]
struct Pool {
    numbers: BTreeMap<Vec<(u32, [u64; 3])>, usize>,
    chains: Vec<Vec<FacePoint>>,
}

impl Pool {
    fn add(&mut self, chain: &[FacePoint]) -> usize {
        let key = chain.iter().map(|p| (p.face, p.bary.map(f64::to_bits))).collect();
        *self.numbers.entry(key).or_insert_with(|| {
            self.chains.push(chain.to_vec());
            self.chains.len() - 1
        })
    }

    fn add_drawing(&mut self, drawing: &Drawing) -> Drawn {
        let places: Vec<FacePoint> = drawing.network.corners.iter().map(|c| c.place).collect();
        let mut sketch = drawing.sketch.clone();
        let features = drawing.sketch.features.iter().map(|f| self.add(&f.points)).collect();
        sketch.features.iter_mut().for_each(|f| f.points.clear());
        Drawn {
            corners: self.add(&places),
            curves: (drawing.network.curves.iter())
                .map(|c| DrawnCurve { corners: c.corners, kind: c.kind, chain: self.add(&c.points) })
                .collect(),
            patches: drawing.network.patches.clone(),
            sketch,
            features,
        }
    }
}

pub(super) fn write(transaction: &Transaction, model: &Model, arrays: &mut Arrays) -> Result<(), ProjectError> {
    let mut pool = Pool::default();
    let steps = model.undo.iter().map(|s| ("undo", s)).chain(model.redo.iter().map(|s| ("redo", s)));
    for (k, (stack, step)) in steps.enumerate() {
        let drawn = serde_json::to_string(&pool.add_drawing(&step.other)).map_err(std::io::Error::other)?;
        let row = params![k as i64 + 1, stack, step.entry.command, step.entry.parameters, drawn];
        transaction.prepare_cached("INSERT INTO step VALUES (?1, ?2, ?3, ?4, ?5)")?.execute(row)?;
    }
    if !pool.chains.is_empty() {
        let lengths = arrays.add(Array::U32(pool.chains.iter().map(|c| c.len() as u32).collect()));
        let (faces, weights) = add_places(arrays, pool.chains.iter().flatten());
        transaction.execute("INSERT INTO pool VALUES (1, ?1, ?2, ?3)", params![lengths, faces, weights])?;
    }
    Ok(())
}

pub(super) fn read(connection: &Connection, arrays: &mut Loaded, model: &mut Model) -> Result<(), ProjectError> {
    let faces = model.mesh.triangles.len();
    let mut select = connection.prepare("SELECT lengths, faces, weights FROM pool ORDER BY id")?;
    let rows = select.query_map([], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)))?;
    let mut chains: Vec<Vec<FacePoint>> = Vec::new();
    for row in rows {
        let (lengths, f, w): (i64, i64, i64) = row?;
        let lengths = arrays.u32(lengths)?;
        let mut places = places(arrays, f, w, faces)?.into_iter();
        if lengths.iter().map(|&l| l as usize).fold(0, usize::saturating_add) != places.len() {
            return Err(damaged("the chains are not as long as they should be".into(), "pool", 1));
        }
        chains.extend(lengths.iter().map(|&l| places.by_ref().take(l as usize).collect::<Vec<_>>()));
    }
    let mut select = connection.prepare("SELECT id, stack, command, parameters, drawing FROM step ORDER BY id")?;
    let rows = select.query_map([], |row| {
        let entry = HistoryEntry { command: row.get(2)?, parameters: row.get(3)? };
        Ok((row.get::<_, i64>(0)?, row.get::<_, String>(1)?, entry, row.get::<_, String>(4)?))
    })?;
    for row in rows {
        let (id, stack, entry, json) = row?;
        let drawn: Drawn = serde_json::from_str(&json).map_err(|e| damaged(e.to_string(), "step", id))?;
        let other = drawing(drawn, &chains, faces).map_err(|what| damaged(what, "step", id))?;
        let step = Step { entry, other };
        match stack.as_str() {
            "undo" => model.undo.push(step),
            "redo" => model.redo.push(step),
            other => return Err(damaged(format!("unknown stack \"{other}\""), "step", id)),
        }
    }
    Ok(())
}

fn drawing(drawn: Drawn, chains: &[Vec<FacePoint>], faces: usize) -> Result<Drawing, String> {
    let chain = |k: usize| chains.get(k).cloned().ok_or_else(|| format!("chain {k} is not there"));
    let corners: Vec<Corner> = chain(drawn.corners)?.into_iter().map(|place| Corner { place }).collect();
    let mut curves = Vec::with_capacity(drawn.curves.len());
    for curve in drawn.curves {
        if curve.corners.iter().any(|&k| k as usize >= corners.len()) {
            return Err("a curve names a corner that is not there".into());
        }
        curves.push(Curve { corners: curve.corners, kind: curve.kind, points: chain(curve.chain)? });
    }
    if drawn.patches.iter().flat_map(|p| &p.sides).any(|s| s.curve as usize >= curves.len()) {
        return Err("a patch names a curve that is not there".into());
    }
    let mut sketch = drawn.sketch;
    if drawn.features.len() != sketch.features.len() {
        return Err("feature curves and their chains differ in number".into());
    }
    for (feature, k) in sketch.features.iter_mut().zip(drawn.features) {
        feature.points = chain(k)?;
    }
    check_sketch(&sketch, faces)?;
    Ok(Drawing { network: Network { corners, curves, patches: drawn.patches }, sketch })
}

/// Tells what is wrong with a sketch on a mesh of `faces` triangles.
pub(super) fn check_sketch(sketch: &Sketch, faces: usize) -> Result<(), String> {
    let wrong = |f: &FeatureCurve| f.points.iter().any(|p| p.face as usize >= faces || !are_weights(&p.bary));
    match sketch.features.iter().position(wrong) {
        Some(k) => Err(format!("feature curve {k} is not on the mesh")),
        None => Ok(()),
    }
}
