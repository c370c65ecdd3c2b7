//! Schema version 3: tables of a project, and a model to and from them. Version 1 had no sketch and no steps, version 2 no
//! layers of the relief.

use super::ProjectError;
use super::array::{Array, Arrays, Loaded, add_places, damaged, places};
use super::{layers, steps};
use planish::grid::Grid;
use planish::mesh::{Attribute, TriMesh};
use planish::network::{Corner, Curve, CurveKind, Network, Patch};
use planish::relief::Relief;
use planish::surface::Surface;
use planish::{HistoryEntry, Model, Units};
use rusqlite::{Connection, Transaction, params};
use serde::{Deserialize, Serialize};

/// Columns named after arrays hold the number of a row of `array`.
const TABLES: &str = "
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE array (id INTEGER PRIMARY KEY, kind TEXT NOT NULL, count INTEGER NOT NULL, checksum INTEGER NOT NULL,
    data BLOB NOT NULL);
CREATE TABLE mesh (id INTEGER PRIMARY KEY, points INTEGER NOT NULL, triangles INTEGER NOT NULL);
CREATE TABLE attribute (id INTEGER PRIMARY KEY, name TEXT NOT NULL, width INTEGER NOT NULL, numbers INTEGER NOT NULL);
CREATE TABLE network (id INTEGER PRIMARY KEY, json TEXT NOT NULL, faces INTEGER NOT NULL, weights INTEGER NOT NULL);
CREATE TABLE grid (patch INTEGER PRIMARY KEY, rows INTEGER NOT NULL, cols INTEGER NOT NULL, points INTEGER NOT NULL,
    faces INTEGER NOT NULL, weights INTEGER NOT NULL);
CREATE TABLE surface (patch INTEGER PRIMARY KEY, rows INTEGER NOT NULL, cols INTEGER NOT NULL,
    control INTEGER NOT NULL, knots_u INTEGER NOT NULL, knots_v INTEGER NOT NULL);
CREATE TABLE relief (patch INTEGER PRIMARY KEY, rows INTEGER NOT NULL, cols INTEGER NOT NULL, vectors INTEGER NOT NULL);
CREATE TABLE layer_map (id INTEGER PRIMARY KEY, maps INTEGER NOT NULL, patch INTEGER NOT NULL, rows INTEGER NOT NULL,
    cols INTEGER NOT NULL, vectors INTEGER NOT NULL);
CREATE TABLE history (sequence INTEGER PRIMARY KEY, parent INTEGER REFERENCES history, command TEXT NOT NULL,
    parameters TEXT NOT NULL);
CREATE TABLE pool (id INTEGER PRIMARY KEY, lengths INTEGER NOT NULL, faces INTEGER NOT NULL, weights INTEGER NOT NULL);
CREATE TABLE step (id INTEGER PRIMARY KEY, stack TEXT NOT NULL, command TEXT NOT NULL, parameters TEXT NOT NULL,
    drawing TEXT NOT NULL);
";

/// A network without its places: these are arrays, first those of the corners, then those of the curves.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Layout {
    corners: usize,
    curves: Vec<CurveLayout>,
    patches: Vec<Patch>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CurveLayout {
    corners: [u32; 2],
    kind: CurveKind,
    points: usize,
}

/// Writes a model into an empty database.
pub(super) fn write(transaction: &Transaction, model: &Model) -> Result<(), ProjectError> {
    transaction.execute_batch(TABLES)?;
    let mut arrays = Arrays::default();
    let sketch = serde_json::to_string(&model.sketch).map_err(std::io::Error::other)?;
    let layers = layers::stacks_json(&model.layers)?;
    let shift = serde_json::to_string(&model.shift.to_array()).map_err(std::io::Error::other)?;
    for (key, value) in [
        ("generator", concat!("planish ", env!("CARGO_PKG_VERSION"))),
        ("params", &model.params),
        ("layers", &layers),
        ("sketch", &sketch),
        ("shift", &shift),
        ("units", model.units.symbol()),
    ] {
        transaction.execute("INSERT INTO meta VALUES (?1, ?2)", params![key, value])?;
    }
    if !model.studio.is_empty() {
        transaction.execute("INSERT INTO meta VALUES ('studio', ?1)", params![model.studio])?;
    }
    let mesh = &model.mesh;
    let points = arrays.add(Array::points(&mesh.points));
    let triangles = arrays.add(Array::U32(mesh.triangles.iter().flatten().copied().collect()));
    transaction.execute("INSERT INTO mesh VALUES (1, ?1, ?2)", params![points, triangles])?;
    for (k, attribute) in mesh.attributes.iter().enumerate() {
        let numbers = arrays.add(Array::F32(attribute.values.clone()));
        let row = params![k as i64, attribute.name, attribute.width as i64, numbers];
        transaction.execute("INSERT INTO attribute VALUES (?1, ?2, ?3, ?4)", row)?;
    }
    write_network(transaction, &model.network, &mut arrays)?;
    for (p, grid) in model.grids.iter().enumerate() {
        let points = arrays.add(Array::points(&grid.points));
        let (faces, weights) = add_places(&mut arrays, grid.places.iter());
        let row = params![p as i64, grid.rows as i64, grid.cols as i64, points, faces, weights];
        transaction.prepare_cached("INSERT INTO grid VALUES (?1, ?2, ?3, ?4, ?5, ?6)")?.execute(row)?;
    }
    for (p, surface) in model.surfaces.iter().enumerate() {
        let control = arrays.add(Array::points(&surface.control));
        let knots_u = arrays.add(Array::F64(surface.knots_u.clone()));
        let knots_v = arrays.add(Array::F64(surface.knots_v.clone()));
        let row = params![p as i64, surface.rows as i64, surface.cols as i64, control, knots_u, knots_v];
        transaction.prepare_cached("INSERT INTO surface VALUES (?1, ?2, ?3, ?4, ?5, ?6)")?.execute(row)?;
    }
    for (p, relief) in model.reliefs.iter().enumerate() {
        let vectors = arrays.add(Array::points(&relief.vectors));
        let row = params![p as i64, relief.rows as i64, relief.cols as i64, vectors];
        transaction.prepare_cached("INSERT INTO relief VALUES (?1, ?2, ?3, ?4)")?.execute(row)?;
    }
    layers::write(transaction, &model.layers, &mut arrays)?;
    for (k, entry) in model.history.iter().enumerate() {
        // Undo makes branches; what a model holds is one line of them.
        let parent = (k > 0).then_some(k as i64);
        let row = params![k as i64 + 1, parent, entry.command, entry.parameters];
        transaction.prepare_cached("INSERT INTO history VALUES (?1, ?2, ?3, ?4)")?.execute(row)?;
    }
    steps::write(transaction, model, &mut arrays)?;
    arrays.write(transaction)
}

fn write_network(transaction: &Transaction, network: &Network, arrays: &mut Arrays) -> Result<(), ProjectError> {
    let curve = |c: &Curve| CurveLayout { corners: c.corners, kind: c.kind, points: c.points.len() };
    let layout = Layout {
        corners: network.corners.len(),
        curves: network.curves.iter().map(curve).collect(),
        patches: network.patches.clone(),
    };
    let json = serde_json::to_string(&layout).map_err(std::io::Error::other)?;
    let corners = network.corners.iter().map(|c| &c.place);
    let (faces, weights) = add_places(arrays, corners.chain(network.curves.iter().flat_map(|c| &c.points)));
    transaction.execute("INSERT INTO network VALUES (1, ?1, ?2, ?3)", params![json, faces, weights])?;
    Ok(())
}

/// Refuses what computes when it is read: views, triggers, virtual tables and columns made of others. The tables of a project
/// hold what they hold.
fn only_tables(connection: &Connection) -> Result<(), ProjectError> {
    let odd = connection.query_row(
        "SELECT name FROM sqlite_master WHERE type NOT IN ('table', 'index') OR sql LIKE 'CREATE VIRTUAL%' \
         OR sql LIKE '% AS (%' OR sql LIKE '% GENERATED %' LIMIT 1",
        [],
        |row| row.get::<_, String>(0),
    );
    match odd {
        Err(rusqlite::Error::QueryReturnedNoRows) => Ok(()),
        odd => Err(damaged(format!("\"{}\" is no plain table", odd?), "sqlite_master", 0)),
    }
}

/// Reads a model and checks that its parts fit together.
/// * `bytes` - size of the file
pub(super) fn read(connection: &Connection, version: u32, bytes: u64) -> Result<Model, ProjectError> {
    only_tables(connection)?;
    let mut arrays = Loaded::new(connection, bytes);
    let meta = |key: &str| -> Result<String, ProjectError> {
        Ok(connection.query_row("SELECT value FROM meta WHERE key = ?1", [key], |row| row.get(0))?)
    };
    let units = meta("units")?;
    let units: Units = units.parse().map_err(|_| damaged(format!("unknown unit \"{units}\""), "meta", 0))?;
    let any = |key: &str| match meta(key) {
        Err(ProjectError::Database(rusqlite::Error::QueryReturnedNoRows)) => Ok(None),
        found => found.map(Some),
    };
    // Files of older versions have none.
    let shift = any("shift")?.map(|json| serde_json::from_str::<[f64; 3]>(&json)).transpose();
    let shift = shift.map_err(|e| damaged(e.to_string(), "meta", 0))?.unwrap_or_default().into();
    let studio = any("studio")?.unwrap_or_default();
    let mesh = read_mesh(connection, &mut arrays)?;
    let faces = mesh.triangles.len();
    let network = read_network(connection, &mut arrays, faces)?;
    let mut model = Model { mesh, network, units, shift, params: meta("params")?, studio, ..Default::default() };
    for (p, rows, cols, [points, f, w, ..]) in sized(connection, "SELECT * FROM grid ORDER BY patch", 3)? {
        let points = arrays.points(points, Some(rows * cols))?;
        let places = places(&mut arrays, f, w, faces)?;
        if places.len() != points.len() {
            return Err(damaged("points and places differ in number".into(), "grid", p));
        }
        model.grids.push(Grid { rows, cols, points, places });
    }
    for (p, rows, cols, [control, u, v]) in sized(connection, "SELECT * FROM surface ORDER BY patch", 3)? {
        let control = arrays.points(control, Some(rows * cols))?;
        let surface = Surface { rows, cols, control, knots_u: arrays.f64(u)?, knots_v: arrays.f64(v)? };
        surface.check().map_err(|e| damaged(e.to_string(), "surface", p))?;
        model.surfaces.push(surface);
    }
    for (_, rows, cols, [vectors, ..]) in sized(connection, "SELECT * FROM relief ORDER BY patch", 1)? {
        model.reliefs.push(Relief { rows, cols, vectors: arrays.points(vectors, Some(rows * cols))? });
    }
    let patches = model.network.patches.len();
    for (table, count) in
        [("grid", model.grids.len()), ("surface", model.surfaces.len()), ("relief", model.reliefs.len())]
    {
        if count != 0 && count != patches {
            return Err(damaged(format!("{count} rows for {patches} patches"), table, count as i64));
        }
    }
    let mut select = connection.prepare("SELECT command, parameters FROM history ORDER BY sequence")?;
    let entry = |row: &rusqlite::Row| Ok(HistoryEntry { command: row.get(0)?, parameters: row.get(1)? });
    model.history = select.query_map([], entry)?.collect::<Result<_, _>>()?;
    if version >= 2 {
        model.sketch = serde_json::from_str(&meta("sketch")?).map_err(|e| damaged(e.to_string(), "meta", 0))?;
        steps::check_sketch(&model.sketch, faces).map_err(|what| damaged(what, "meta", 0))?;
        steps::read(connection, &mut arrays, &mut model)?;
    }
    if version >= 3 {
        model.layers = layers::read(connection, &mut arrays, &meta("layers")?, patches)?;
    }
    Ok(model)
}

type Sized3 = (i64, usize, usize, [i64; 3]);

/// Rows of a table of patches: number, rows, columns and `arrays` numbers of arrays; the numbers run from 0.
fn sized(connection: &Connection, query: &str, arrays: usize) -> Result<Vec<Sized3>, ProjectError> {
    let mut select = connection.prepare(query)?;
    let rows = select.query_map([], |row| {
        let mut ids = [0; 3];
        for (k, id) in ids.iter_mut().enumerate().take(arrays) {
            *id = row.get(3 + k)?;
        }
        Ok((row.get::<_, i64>(0)?, row.get::<_, u32>(1)? as usize, row.get::<_, u32>(2)? as usize, ids))
    })?;
    let rows: Vec<Sized3> = rows.collect::<Result<_, _>>()?;
    match rows.iter().enumerate().find(|(k, row)| row.0 != *k as i64) {
        Some((k, row)) => Err(damaged(format!("row {} stands where {k} should", row.0), "patch", row.0)),
        None => Ok(rows),
    }
}

fn read_mesh(connection: &Connection, arrays: &mut Loaded) -> Result<TriMesh, ProjectError> {
    let ids = connection.query_row("SELECT points, triangles FROM mesh WHERE id = 1", [], |row| {
        Ok((row.get::<_, i64>(0)?, row.get::<_, i64>(1)?))
    })?;
    let points = arrays.points(ids.0, None)?;
    let corners = arrays.u32(ids.1)?;
    if corners.len() % 3 != 0 || corners.iter().any(|&v| v as usize >= points.len()) {
        return Err(damaged("the triangles name vertices that are not there".into(), "mesh", 1));
    }
    let mut mesh = TriMesh::new(points, corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect());
    let mut select = connection.prepare("SELECT id, name, width, numbers FROM attribute ORDER BY id")?;
    let rows = select.query_map([], |row| {
        Ok((row.get::<_, i64>(0)?, row.get::<_, String>(1)?, row.get::<_, u32>(2)?, row.get::<_, i64>(3)?))
    })?;
    for row in rows {
        let (id, name, width, numbers) = row?;
        let (width, values) = (width as usize, arrays.f32(numbers)?);
        if values.len() != width * mesh.points.len() {
            return Err(damaged(format!("\"{name}\" does not have {width} numbers per vertex"), "attribute", id));
        }
        mesh.attributes.push(Attribute { name, width, values });
    }
    Ok(mesh)
}

fn read_network(connection: &Connection, arrays: &mut Loaded, face_count: usize) -> Result<Network, ProjectError> {
    let (json, faces, weights) =
        connection.query_row("SELECT json, faces, weights FROM network WHERE id = 1", [], |row| {
            Ok((row.get::<_, String>(0)?, row.get::<_, i64>(1)?, row.get::<_, i64>(2)?))
        })?;
    let layout: Layout = serde_json::from_str(&json).map_err(|e| damaged(e.to_string(), "network", 1))?;
    let mut places = places(arrays, faces, weights, face_count)?.into_iter();
    let wanted = layout.curves.iter().map(|c| c.points).fold(layout.corners, usize::saturating_add);
    if wanted != places.len() {
        return Err(damaged(format!("{wanted} places are named and {} are there", places.len()), "network", 1));
    }
    let corners: Vec<Corner> = places.by_ref().take(layout.corners).map(|place| Corner { place }).collect();
    let mut curves = Vec::new();
    for (c, curve) in layout.curves.iter().enumerate() {
        if curve.corners.iter().any(|&k| k as usize >= corners.len()) {
            return Err(damaged(format!("curve {c} names a corner that is not there"), "network", 1));
        }
        let points = places.by_ref().take(curve.points).collect();
        curves.push(Curve { corners: curve.corners, kind: curve.kind, points });
    }
    let names = |patch: &Patch| patch.sides.iter().all(|side| (side.curve as usize) < curves.len());
    if let Some(p) = layout.patches.iter().position(|patch| !names(patch)) {
        return Err(damaged(format!("patch {p} names a curve that is not there"), "network", 1));
    }
    Ok(Network { corners, curves, patches: layout.patches })
}
