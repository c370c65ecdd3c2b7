//! Milling jobs: `[stock]`, `[[tool]]`, `[[path]]`.

use super::ScriptError;
use super::gcode::{self, Motion};
use super::toml::{Table, Value};
use planish::field::{Milling, Move, Tool};
use planish::geom::Aabb;
use planish::{DVec3, Units};
use std::path::Path;

/// The job and the number of its moves.
pub fn read(root: &Table, folder: &Path, units: Option<Units>) -> Result<(Milling, usize), ScriptError> {
    root.only(&["units", "stock", "tool", "path"])?;
    let stock_at = root.required("stock")?;
    let table = stock_at.table()?;
    table.only(&["from", "to"])?;
    let (from, to) = (table.required("from")?.vector()?, table.required("to")?.vector()?);
    if !(to - from).cmpgt(DVec3::ZERO).all() {
        return Err(stock_at.fault("\"to\" must lie beyond \"from\" along every axis", "give two opposite corners"));
    }
    let mut names = Vec::new();
    let mut tools = Vec::new();
    for table in root.optional("tool").map(|t| t.tables()).transpose()?.unwrap_or_default() {
        table.only(&["name", "kind", "radius", "diameter", "corner"])?;
        let name = table.required("name")?;
        if names.contains(&name.text()?.to_owned()) {
            return Err(name.fault(format!("there are two tools \"{}\"", name.text()?), "give each its own name"));
        }
        names.push(name.text()?.to_owned());
        tools.push(tool(&table)?);
    }
    let mut moves = Vec::new();
    for table in root.optional("path").map(|p| p.tables()).transpose()?.unwrap_or_default() {
        table.only(&["tool", "points", "gcode"])?;
        let wanted = table.required("tool")?;
        let Some(tool) = names.iter().position(|n| wanted.text().is_ok_and(|w| w == n)) else {
            let known = if names.is_empty() {
                "write [[tool]] first".into()
            } else {
                format!("tools are {}", names.join(", "))
            };
            return Err(wanted.fault(format!("there is no tool \"{}\"", wanted.text()?), known));
        };
        match (table.optional("points"), table.optional("gcode")) {
            (Some(points), None) => {
                let points: Vec<DVec3> = points.points::<3>()?.into_iter().map(DVec3::from_array).collect();
                add(&mut moves, tool, &points, &wanted)?;
            }
            (None, Some(file)) => from_gcode(&mut moves, tool, &file, folder, units)?,
            _ => {
                return Err(wanted.fault("a path needs either points or gcode", "give one of the two"));
            }
        }
    }
    let count = moves.len();
    Ok((Milling::new(Aabb { min: from, max: to }, tools, moves), count))
}

fn tool(table: &Table) -> Result<Tool, ScriptError> {
    let kind = table.required("kind")?;
    let radius = match (table.optional("radius"), table.optional("diameter")) {
        (Some(r), None) => r.positive()?,
        (None, Some(d)) => d.positive()? / 2.0,
        _ => return Err(kind.fault("a tool needs a radius or a diameter", "give one of the two")),
    };
    let corner = table.optional("corner");
    match (kind.text()?, corner) {
        ("ball", None) => Ok(Tool::Ball { radius }),
        ("flat", None) => Ok(Tool::Flat { radius }),
        ("bull", Some(c)) => {
            let corner = c.positive()?;
            if corner >= radius {
                return Err(
                    c.fault(format!("a corner of {corner} does not fit a radius of {radius}"), "use a ball end")
                );
            }
            Ok(Tool::Bull { radius, corner })
        }
        ("bull", None) => Err(kind.fault("a bull-nose tool needs a corner", "give corner = its radius")),
        ("ball" | "flat", Some(c)) => Err(c.fault("only a bull-nose tool has a corner", "use kind = \"bull\"")),
        (other, _) => Err(kind.fault(format!("unknown kind of tool \"{other}\""), "kinds are ball, flat and bull")),
    }
}

/// Moves from point to point.
fn add(moves: &mut Vec<Move>, tool: usize, points: &[DVec3], at: &Value) -> Result<(), ScriptError> {
    match points {
        [] => Err(at.fault("a path needs at least one point", "give points")),
        [p] => {
            moves.push(Move { from: *p, to: *p, tool });
            Ok(())
        }
        _ => {
            moves.extend(points.windows(2).map(|w| Move { from: w[0], to: w[1], tool }));
            Ok(())
        }
    }
}

fn from_gcode(
    moves: &mut Vec<Move>,
    tool: usize,
    file: &Value,
    folder: &Path,
    units: Option<Units>,
) -> Result<(), ScriptError> {
    let name = file.text()?;
    let fault = |fault: String| ScriptError::Companion { name: name.to_owned(), fault, line: file.line() };
    let whole = crate::mesh_file::content(&folder.join(name));
    let bytes = whole.map_err(|e| fault(e.to_string().split(" - hint: ").next().unwrap_or_default().to_owned()))?;
    let scale = |inches: bool| match (units.unwrap_or_default(), inches) {
        (Units::Mm, false) | (Units::In, true) => 1.0,
        (Units::Mm, true) => 25.4,
        (Units::Cm, false) => 0.1,
        (Units::Cm, true) => 2.54,
        (Units::M, false) => 0.001,
        (Units::M, true) => 0.0254,
        (Units::In, false) => 1.0 / 25.4,
    };
    let motions = gcode::read(&bytes).map_err(|e| fault(e.to_string()))?;
    for Motion { from, to, inches } in motions {
        let s = scale(inches);
        moves.push(Move { from: from * s, to: to * s, tool });
    }
    Ok(())
}
