//! OBJ with free-form surfaces: the patches themselves, without triangles.
//!
//! Wavefront, *Object Files*, "Free-form curve/surface attributes": `cstype bspline`, `deg`, `surf` with the control points of
//! the lower left row first and `u` fastest, `parm` with all knots. Places that are equal are one vertex, so patches share the
//! vertices of their seam.

use crate::mapped::patch_name;
use crate::mesh_file::WriteOptions;
use crate::{Place, ReadError, WriteError, atomic};
use planish::DVec3;
use planish::surface::Surface;
use std::collections::HashMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Writes surfaces as the free-form surfaces of OBJ, a group for each, named after its displacement map. Numbers are in the
/// shortest form that reads back the same. The file appears whole or not at all.
/// # Errors
/// `WriteError::Nothing` without surfaces; `WriteError::Inconsistent` for a surface that cannot be evaluated.
pub fn write_obj_surfaces(path: impl AsRef<Path>, surfaces: &[Surface]) -> Result<(), WriteError> {
    if surfaces.is_empty() {
        return Err(WriteError::Nothing("the model has no surfaces"));
    }
    for (p, surface) in surfaces.iter().enumerate() {
        let place = Place::Item("patch", p);
        surface.check().map_err(|e| WriteError::Inconsistent { what: e.to_string(), place })?;
    }
    atomic::write(path.as_ref(), |out: &mut BufWriter<File>| write(out, surfaces))
}

fn write<W: Write>(out: &mut W, surfaces: &[Surface]) -> Result<(), WriteError> {
    writeln!(out, "# {}", WriteOptions::default().generator())?;
    // Numbers of the vertices by their bits: looked up only, so its order does not matter.
    let mut known = HashMap::new();
    for p in surfaces.iter().flat_map(|s| &s.control) {
        let next = known.len() + 1;
        if *known.entry(p.to_array().map(f64::to_bits)).or_insert(next) == next {
            writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
        }
    }
    writeln!(out, "cstype bspline\ndeg 3 3")?;
    for (p, surface) in surfaces.iter().enumerate() {
        let (u, v) = (&surface.knots_u, &surface.knots_v);
        let bounds = [u[3], u[surface.cols], v[3], v[surface.rows]];
        write!(out, "g {}\nsurf", patch_name(p))?;
        bounds.iter().try_for_each(|t| write!(out, " {t}"))?;
        for point in &surface.control {
            write!(out, " {}", known[&point.to_array().map(f64::to_bits)])?;
        }
        for (axis, knots) in [("u", u), ("v", v)] {
            write!(out, "\nparm {axis}")?;
            knots.iter().try_for_each(|t| write!(out, " {t}"))?;
        }
        writeln!(out, "\nend")?;
    }
    Ok(())
}

/// Reads the bicubic B-spline surfaces of an OBJ, in their order.
/// # Errors
/// `ReadError` for what is no such file: other degrees or kinds, missing vertices, knots that do not fit.
pub fn read_obj_surfaces(path: impl AsRef<Path>) -> Result<Vec<Surface>, ReadError> {
    let bytes = crate::mesh_file::content(path.as_ref())?;
    let text = String::from_utf8_lossy(&bytes);
    let mut reading = Reading::default();
    for (k, line) in text.lines().enumerate() {
        let wrong = |what: String| ReadError::Syntax { what, place: Place::Line(k + 1) };
        reading.line(line.split('#').next().unwrap_or_default()).map_err(wrong)?;
    }
    if reading.surfaces.is_empty() {
        let hint = "write one with `planish export MODEL.planish --surface spline -o FILE.obj`";
        return Err(ReadError::Unsupported {
            what: "an OBJ without B-spline surfaces".into(),
            place: Place::Line(1),
            hint,
        });
    }
    Ok(reading.surfaces)
}

/// What was read of an OBJ so far.
#[derive(Default)]
struct Reading {
    points: Vec<DVec3>,
    control: Vec<DVec3>,
    knots: [Vec<f64>; 2],
    surfaces: Vec<Surface>,
}

impl Reading {
    fn line(&mut self, line: &str) -> Result<(), String> {
        let mut words = line.split_whitespace();
        let keyword = words.next().unwrap_or_default();
        let numbers = |words: &mut std::str::SplitWhitespace| -> Result<Vec<f64>, String> {
            let number =
                |w: &str| w.parse().ok().filter(|x: &f64| x.is_finite()).ok_or(format!("\"{w}\" is no number"));
            words.map(number).collect()
        };
        match keyword {
            "v" => match numbers(&mut words)?[..] {
                [x, y, z, ..] => self.points.push(DVec3::new(x, y, z)),
                _ => return Err("a vertex has three coordinates".into()),
            },
            "cstype" if line.split_whitespace().collect::<Vec<_>>() != ["cstype", "bspline"] => {
                return Err("only surfaces of the kind bspline are read".into());
            }
            "deg" if numbers(&mut words)? != [3.0, 3.0] => return Err("only surfaces of degree 3 are read".into()),
            "surf" => {
                let vertex = |w: &str| {
                    let number = w.split('/').next().and_then(|n| n.parse::<usize>().ok());
                    let point = number.and_then(|n| self.points.get(n.checked_sub(1)?));
                    point.copied().ok_or(format!("vertex {w} is not there"))
                };
                self.control = words.skip(4).map(vertex).collect::<Result<_, _>>()?;
            }
            "parm" => match words.next() {
                Some("u") => self.knots[0] = numbers(&mut words)?,
                Some("v") => self.knots[1] = numbers(&mut words)?,
                _ => return Err("parameters are of u or of v".into()),
            },
            "end" if !self.control.is_empty() => {
                let [knots_u, knots_v] = std::mem::take(&mut self.knots);
                let (cols, rows) = (knots_u.len().saturating_sub(4), knots_v.len().saturating_sub(4));
                let surface = Surface { rows, cols, control: std::mem::take(&mut self.control), knots_u, knots_v };
                surface.check().map_err(|e| e.to_string())?;
                self.surfaces.push(surface);
            }
            _ => {}
        }
        Ok(())
    }
}
