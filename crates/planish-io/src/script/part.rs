//! `[solid.NAME]`: shapes, combinations, and where they are.

use super::ScriptError;
use super::toml::{Table, Value};
use planish::field::csg::Operation;
use planish::field::{Formula, MeshBody, Part, Polygon, Solid};
use planish::geom::Aabb;
use planish::{DVec2, DVec3};
use std::cell::Cell;
use std::collections::BTreeSet;
use std::path::Path;

const SHAPES: [&str; 14] = [
    "sphere",
    "box",
    "cylinder",
    "cone",
    "torus",
    "plane",
    "capsule",
    "extrusion",
    "formula",
    "mesh",
    "union",
    "intersection",
    "difference",
    "copy",
];
const CHANGES: [&str; 4] = ["offset", "scale", "rotate", "move"];
/// Solids within solids at most.
const DEEPEST: usize = 200;
/// Shapes of a part at most: twenty lines that each use the one before twice have a million.
const MOST_SHAPES: usize = 20_000;

/// The solid named `result`, or the last one.
pub fn read(root: &Table, folder: &Path) -> Result<(Part, usize), ScriptError> {
    root.only(&["units", "result", "solid"])?;
    let Some(solids) = root.optional("solid") else {
        return Err(root.fault("the script is empty: it has no [solid.NAME]", "write [solid.part] and a shape"));
    };
    let solids = solids.table()?.values();
    let Some(last) = solids.last() else {
        return Err(root.fault("the script is empty: it has no [solid.NAME]", "write [solid.part] and a shape"));
    };
    let reader = Reader { solids: &solids, folder, shapes: Cell::new(0) };
    // All of them are looked at, so that no fault hides in one that is not used.
    for solid in &solids {
        reader.check(solid)?;
    }
    let part = match root.optional("result") {
        Some(name) => reader.named(name.text()?, &name, &mut Vec::new())?,
        None => reader.named(last.name(), last, &mut Vec::new())?,
    };
    Ok((part, solids.len()))
}

struct Reader<'a> {
    solids: &'a [Value<'a>],
    folder: &'a Path,
    /// Shapes that the part has so far: a solid counts as often as others use it.
    shapes: Cell<usize>,
}

impl Reader<'_> {
    fn check(&self, solid: &Value) -> Result<(), ScriptError> {
        let table = solid.table()?;
        let known: Vec<&str> = SHAPES.iter().chain(&CHANGES).copied().collect();
        table.only(&known)?;
        let shapes: Vec<&str> = SHAPES.into_iter().filter(|s| table.has(s)).collect();
        match shapes[..] {
            [_] => Ok(()),
            [] => Err(solid.fault(
                format!("solid \"{}\" has no shape", solid.name()),
                format!("give one of {}", known[..SHAPES.len()].join(", ")),
            )),
            _ => Err(solid.fault(
                format!("solid \"{}\" has {} shapes ({})", solid.name(), shapes.len(), shapes.join(", ")),
                "give each its own [solid.NAME] and combine them",
            )),
        }
    }

    /// The solid of this name; `from` asks for it, `above` are those that it is part of.
    fn named(&self, name: &str, from: &Value, above: &mut Vec<String>) -> Result<Part, ScriptError> {
        let Some(solid) = self.solids.iter().find(|s| s.name() == name) else {
            return Err(from.fault(format!("there is no solid \"{name}\""), format!("write [solid.{name}]")));
        };
        if above.iter().any(|a| a == name) {
            return Err(from.fault(format!("solid \"{name}\" is part of itself"), "remove the circle"));
        }
        if above.len() >= DEEPEST {
            return Err(from.fault("solids are nested too deep", format!("use at most {DEEPEST} levels")));
        }
        above.push(name.to_owned());
        let table = solid.table()?;
        let shape = SHAPES.into_iter().find_map(|s| table.optional(s));
        let Some(shape) = shape else {
            return Err(solid.fault(format!("solid \"{name}\" has no shape"), "give it one"));
        };
        let mut part = self.shape(&shape, above)?;
        if let Some(distance) = table.optional("offset") {
            if matches!(&part, Part::Solid(solid) if solid.has_formula()) {
                let what = "an offset needs distances, and the values of a formula are none";
                return Err(distance.fault(what, "change the formula itself"));
            }
            part = part.offset(distance.number()?);
        }
        let scale = table.optional("scale").map(|s| s.positive()).transpose()?.unwrap_or(1.0);
        let turn = table.optional("rotate").map(|r| rotation(&r)).transpose()?.unwrap_or(glam::DQuat::IDENTITY);
        let shift = table.optional("move").map(|m| m.vector()).transpose()?.unwrap_or(DVec3::ZERO);
        above.pop();
        part.placed(scale, turn, shift).map_err(|e| solid.fault(e.to_string(), "check the mesh and its scale"))
    }

    fn shape(&self, shape: &Value, above: &mut Vec<String>) -> Result<Part, ScriptError> {
        let operation = match shape.name() {
            "union" => Some(Operation::Union),
            "intersection" => Some(Operation::Intersection),
            "difference" => Some(Operation::Difference),
            _ => None,
        };
        if let Some(operation) = operation {
            let mut names = shape.names()?;
            if operation != Operation::Difference {
                // A union or intersection with itself is what it is.
                let mut seen = BTreeSet::new();
                names.retain(|name| seen.insert(*name));
            }
            let parts: Result<Vec<Part>, _> = names.into_iter().map(|name| self.named(name, shape, above)).collect();
            return Ok(Part::combined(operation, parts?));
        }
        if shape.name() != "copy" {
            self.shapes.set(self.shapes.get() + 1);
            if self.shapes.get() > MOST_SHAPES {
                let what = format!(
                    "the part has more than {MOST_SHAPES} shapes, for solids count as often as others use them"
                );
                return Err(shape.fault(what, "use fewer copies of copies"));
            }
        }
        match shape.name() {
            "copy" => self.named(shape.text()?, shape, above),
            "mesh" => {
                let name = shape.text()?;
                let fault = |fault: String| ScriptError::Companion { name: name.to_owned(), fault, line: shape.line() };
                let mesh = crate::read_mesh(self.folder.join(name)).map_err(|e| fault(e.to_string()))?;
                let body = MeshBody::new(mesh).map_err(|e| fault(e.to_string()))?;
                Ok(Part::Mesh(Box::new(body)))
            }
            _ => Ok(Part::Solid(primitive(shape)?)),
        }
    }
}

fn primitive(shape: &Value) -> Result<Solid, ScriptError> {
    let t = shape.table()?;
    Ok(match shape.name() {
        "sphere" => {
            t.only(&["radius"])?;
            Solid::Sphere { radius: t.positive("radius")? }
        }
        "box" => {
            t.only(&["size", "round"])?;
            let size = t.required("size")?.vector()?;
            if size.min_element() <= 0.0 {
                return Err(shape.fault("the size of a box must be above 0", "give three lengths above 0"));
            }
            let round = t.optional("round").map(|r| r.number()).transpose()?.unwrap_or(0.0);
            if !(0.0..=size.min_element() / 2.0).contains(&round) {
                let most = size.min_element() / 2.0;
                return Err(
                    shape.fault(format!("a box of this size cannot be rounded by {round}"), format!("use 0 to {most}"))
                );
            }
            Solid::Cuboid { size, round }
        }
        "cylinder" => {
            t.only(&["radius", "height"])?;
            Solid::Cylinder { radius: t.positive("radius")?, height: t.positive("height")? }
        }
        "cone" => {
            t.only(&["bottom", "top", "height"])?;
            let radius = |key: &str| -> Result<f64, ScriptError> {
                let v = t.optional(key).map(|v| v.number()).transpose()?.unwrap_or(0.0);
                if v < 0.0 {
                    Err(shape.fault(format!("\"{key}\" must not be negative"), "give a radius"))
                } else {
                    Ok(v)
                }
            };
            let (bottom, top) = (radius("bottom")?, radius("top")?);
            if bottom == 0.0 && top == 0.0 {
                return Err(shape.fault("a cone needs a radius at the bottom or at the top", "give bottom or top"));
            }
            Solid::Cone { bottom, top, height: t.positive("height")? }
        }
        "torus" => {
            t.only(&["major", "minor"])?;
            Solid::Torus { major: t.positive("major")?, minor: t.positive("minor")? }
        }
        "plane" => {
            t.only(&["normal", "offset"])?;
            let normal = t.required("normal")?.vector()?;
            let Some(unit) = normal.try_normalize() else {
                return Err(shape.fault("the normal of a plane must not be zero", "give its direction"));
            };
            Solid::Plane { normal: unit, offset: t.optional("offset").map(|o| o.number()).transpose()?.unwrap_or(0.0) }
        }
        "capsule" => {
            t.only(&["from", "to", "radius"])?;
            let (from, to) = (t.required("from")?.vector()?, t.required("to")?.vector()?);
            Solid::Capsule { from, to, radius: t.positive("radius")? }
        }
        "formula" => {
            t.only(&["text", "from", "to"])?;
            let text = t.required("text")?;
            let formula = Formula::parse(text.text()?)
                .map_err(|e| text.fault(format!("{} (column {} of the formula)", e.what, e.column), e.hint))?;
            let (from, to) = (t.required("from")?.vector()?, t.required("to")?.vector()?);
            if !(to - from).cmpgt(DVec3::ZERO).all() {
                return Err(
                    shape.fault("\"to\" must lie beyond \"from\" along every axis", "give two opposite corners")
                );
            }
            Solid::of_formula(formula, &Aabb { min: from, max: to })
        }
        _ => {
            t.only(&["points", "height"])?;
            let points = t.required("points")?.points::<2>()?.into_iter().map(DVec2::from_array).collect();
            let polygon = Polygon::new(points).map_err(|e| shape.fault(e.to_string(), "mend the points"))?;
            Solid::Extrusion { polygon, height: t.positive("height")? }
        }
    })
}

fn rotation(value: &Value) -> Result<glam::DQuat, ScriptError> {
    let t = value.table()?;
    t.only(&["axis", "angle_deg"])?;
    let axis = t.required("axis")?.vector()?;
    let Some(axis) = axis.try_normalize() else {
        return Err(value.fault("the axis of a rotation must not be zero", "give its direction"));
    };
    Ok(glam::DQuat::from_axis_angle(axis, t.required("angle_deg")?.number()?.to_radians()))
}
