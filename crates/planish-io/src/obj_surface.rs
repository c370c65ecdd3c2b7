//! OBJ with free-form surfaces: the patches themselves, without triangles.
//!
//! Wavefront, *Object Files*, "Free-form curve/surface attributes": `cstype bspline`, `deg`, `surf` with the control points of
//! the lower left row first and `u` fastest, `parm` with all knots. Places that are equal are one vertex, so patches share the
//! vertices of their seam.

use crate::mapped::patch_name;
use crate::mesh_file::WriteOptions;
use crate::{Place, WriteError, atomic};
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
