//! Layers of the relief: their stacks as JSON, their maps once each in a table.

use super::ProjectError;
use super::array::{Array, Arrays, Loaded, damaged};
use planish::relief::Relief;
use planish::relief::layers::{Layer, Layers, Past};
use rusqlite::{Connection, Transaction, params};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stacks {
    stack: Vec<Layer>,
    undo: Vec<Past>,
    redo: Vec<Past>,
}

pub(super) fn stacks_json(layers: &Layers) -> Result<String, ProjectError> {
    let Layers { stack, undo, redo, .. } = layers.clone();
    Ok(serde_json::to_string(&Stacks { stack, undo, redo }).map_err(std::io::Error::other)?)
}

pub(super) fn write(transaction: &Transaction, layers: &Layers, arrays: &mut Arrays) -> Result<(), ProjectError> {
    let maps =
        layers.pool.iter().enumerate().flat_map(|(k, maps)| maps.iter().enumerate().map(move |(p, r)| (k, p, r)));
    for (id, (k, p, relief)) in maps.enumerate() {
        let vectors = arrays.add(Array::points(&relief.vectors));
        let row = params![id as i64, k as i64, p as i64, relief.rows as i64, relief.cols as i64, vectors];
        transaction.prepare_cached("INSERT INTO layer_map VALUES (?1, ?2, ?3, ?4, ?5, ?6)")?.execute(row)?;
    }
    Ok(())
}

pub(super) fn read(
    connection: &Connection,
    arrays: &mut Loaded,
    json: &str,
    patches: usize,
) -> Result<Layers, ProjectError> {
    let Stacks { stack, undo, redo } = serde_json::from_str(json).map_err(|e| damaged(e.to_string(), "meta", 0))?;
    let mut layers = Layers { pool: Vec::new(), stack, undo, redo };
    let mut select = connection.prepare("SELECT maps, patch, rows, cols, vectors FROM layer_map ORDER BY id")?;
    let rows = select.query_map([], |row| {
        let size = (row.get::<_, u32>(2)? as usize, row.get::<_, u32>(3)? as usize);
        Ok((row.get::<_, i64>(0)?, row.get::<_, i64>(1)?, size, row.get::<_, i64>(4)?))
    })?;
    for (id, row) in rows.enumerate() {
        let (k, p, (rows, cols), vectors) = row?;
        if p == 0 {
            layers.pool.push(Vec::with_capacity(patches.min(1 << 16)));
        }
        let last = layers.pool.len() as i64 - 1;
        match layers.pool.last_mut() {
            Some(maps) if k == last && p == maps.len() as i64 => {
                maps.push(Relief { rows, cols, vectors: arrays.points(vectors, None)? });
            }
            _ => {
                return Err(damaged(
                    format!("maps {k} of patch {p} stand where others should"),
                    "layer_map",
                    id as i64,
                ));
            }
        }
    }
    if !layers.fits(patches) {
        return Err(damaged("the layers of the relief do not fit the patches".into(), "layer_map", 0));
    }
    Ok(layers)
}
