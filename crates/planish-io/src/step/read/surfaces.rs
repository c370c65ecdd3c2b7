//! The faces of a STEP file as the B-spline surfaces that they are: what a CAD program gave other control points.

use super::entities::Entities;
use super::exchange::{Exchange, fault};
use super::shape;
use super::spline::{Basis, SplineSurface};
use super::trim::{Node, SAME_PARAMETER};
use super::{Points, diagonal, face_of, limits, parts, unit};
use crate::{Place, ReadError, mesh_file};
use glam::DVec4;
use planish::Units;
use planish::surface::Surface;
use std::path::Path;

/// The faces of all parts in the order of the file, as surfaces over the unit square, and the unit of their coordinates.
/// # Errors
/// Those of a STEP file that is read as triangles; faces that are no bicubic B-splines without weights, or only parts of them.
pub fn read_step_surfaces(path: impl AsRef<Path>) -> Result<(Vec<Surface>, Units), ReadError> {
    let bytes = mesh_file::content(path.as_ref())?;
    let file = Exchange::new(&bytes)?;
    let entities = Entities::new(&file)?;
    let (units, scale) = unit(&file)?;
    let limits = limits(diagonal(&file, &entities)?);
    let mut found = Vec::new();
    for part in parts::parts(&entities)? {
        let mut points = Points::default();
        for (shell, is_turned) in part.shells {
            let record = file.record(shell)?;
            for id in record.references(record.value(1)?)? {
                let face = face_of(&entities, id, is_turned, &mut points, limits)?;
                let shape::Surface::Spline { spline, .. } = &face.surface else { return Err(other(id)) };
                let mut surface = bicubic(spline).ok_or_else(|| other(id))?;
                if !is_whole(spline, &face.rings) {
                    return Err(fault(id, "the face is only a part of its surface"));
                }
                surface.control.iter_mut().for_each(|p| *p = scale * part.placement.transform_point3(*p));
                surface.check().map_err(|e| fault(id, e.to_string()))?;
                found.push(surface);
            }
        }
    }
    if found.is_empty() {
        return Err(ReadError::NoFaces { vertices: 0, faces: 0 });
    }
    Ok((found, units))
}

fn other(id: u64) -> ReadError {
    ReadError::Unsupported {
        what: "a face that is no bicubic B-spline without weights".into(),
        place: Place::Item("entity", id as usize),
        hint: "give the faces that `planish export MODEL.planish -o FILE.step` wrote, with other control points",
    }
}

/// The surface over the unit square, if it is of degree 3 along both directions and all weights are the same.
fn bicubic(spline: &SplineSurface) -> Option<Surface> {
    let weight = spline.control[0].w;
    let is_plain = |c: &DVec4| (c.w / weight - 1.0).abs() <= f64::EPSILON;
    if spline.basis.iter().any(|b| b.degree != 3) || !spline.control.iter().all(is_plain) {
        return None;
    }
    let unit = |basis: &Basis| {
        let [from, to] = basis.range();
        basis.knots.iter().map(|t| ((t - from) / (to - from)).clamp(0.0, 1.0)).collect()
    };
    let cols = spline.cols();
    Some(Surface {
        rows: spline.control.len() / cols,
        cols,
        control: spline.control.iter().map(|c| c.truncate() / c.w).collect(),
        knots_u: unit(&spline.basis[0]),
        knots_v: unit(&spline.basis[1]),
    })
}

/// Whether one ring runs along all four borders of the surface.
fn is_whole(spline: &SplineSurface, rings: &[Vec<Node>]) -> bool {
    let [ring] = rings else { return false };
    (0..2).all(|axis| {
        let [from, to] = spline.basis[axis].range();
        let reached = |t: f64| ring.iter().any(|node| (node.0[axis] - t).abs() <= SAME_PARAMETER * (to - from));
        reached(from) && reached(to)
    })
}
