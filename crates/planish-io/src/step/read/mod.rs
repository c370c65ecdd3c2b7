//! Faces of a STEP file as triangles.
//!
//! 1. records by number - `exchange`, `entities`                  2. edges as polylines, one for both faces - `edges`
//! 3. rings of a face in the parameters of its surface - `trim`   4. triangles between them - `faces`
//! 5. shells in their places, those of assemblies in all of them - `parts`
//!
//! Curves and surfaces themselves: `shape`, `spline`. Neighbours share the points of their edge, so that a closed shell is a
//! closed mesh. Read are lines, circles, ellipses, polylines and B-splines; planes, cylinders, cones, spheres, tori, surfaces of
//! revolution and extrusion, and B-splines.

mod edges;
mod entities;
mod exchange;
mod faces;
mod parts;
mod shape;
mod spline;
mod surfaces;
mod trim;

use crate::{Place, ReadError};
use edges::{Fineness, Points};
use entities::{Entities, unread};
use exchange::{Exchange, Record, fault};
use faces::{Corner, FaceFault, FaceMesh};
use planish::Units;
use planish::geom::Aabb;
use planish::mesh::TriMesh;
use rayon::prelude::*;
use shape::Surface;
pub use surfaces::read_step_surfaces;
use trim::{Limits, Node};

/// Largest distance of the triangles from their surfaces, as a share of the diagonal.
const SURFACE_TOLERANCE: f64 = 2e-5;
/// Largest turn from one triangle to the next along a bend, radians: 15 degrees.
const TURN: f64 = std::f64::consts::PI / 12.0;
/// Distance within which places of a file are one, as a share of the diagonal.
const SAME_PLACE: f64 = 1e-7;

/// Reads the shells of a file: their triangles, in the unit of the file.
/// # Errors
/// Damaged text, kinds of geometry that are not read, faces that their edges do not bound.
pub(crate) fn read(bytes: &[u8]) -> Result<TriMesh, ReadError> {
    let file = Exchange::new(bytes)?;
    let entities = Entities::new(&file)?;
    let scale = unit(&file)?.1;
    let limits = limits(diagonal(&file, &entities)?);
    let mut points = Points::default();
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for part in parts::parts(&entities)? {
        let from = points.all.len();
        let mut faces = Vec::new();
        for (shell, is_turned) in part.shells {
            let record = file.record(shell)?;
            for face in record.references(record.value(1)?)? {
                faces.push(face_of(&entities, face, is_turned, &mut points, limits)?);
            }
        }
        let made: Vec<_> =
            faces.par_iter().map(|f| faces::triangulated(&f.surface, &f.rings, limits.fineness)).collect();
        for (face, made) in faces.iter().zip(made) {
            add(face, made, &mut points, &mut triangles)?;
        }
        points.all[from..].iter_mut().for_each(|p| *p = part.placement.transform_point3(*p));
        points.part();
    }
    if triangles.is_empty() {
        return Err(ReadError::NoFaces { vertices: points.all.len(), faces: 0 });
    }
    points.all.iter_mut().for_each(|p| *p *= scale);
    Ok(TriMesh { points: points.all, triangles, attributes: Vec::new() })
}

/// How near and how fine the faces of a file of this diagonal are read.
fn limits(diagonal: f64) -> Limits {
    // What both directions leave adds up: along an edge, and across it up to the first line, which may be a margin farther away.
    let both = 1.0 + (1.0 + faces::MARGIN).powi(2);
    let fineness = Fineness { distance: SURFACE_TOLERANCE * diagonal / both, turn: TURN };
    Limits { tolerance: SAME_PLACE * diagonal, fineness }
}

/// The unit of the coordinates that [`read`] gives.
/// # Errors
/// As [`read`], of the units alone.
pub(crate) fn units(bytes: &[u8]) -> Result<Units, ReadError> {
    Ok(unit(&Exchange::new(bytes)?)?.0)
}

/// A unit that planish knows, and what brings the file's own to it: millimetres where it is another.
fn unit(file: &Exchange) -> Result<(Units, f64), ReadError> {
    let metres = Entities::units(file)?[0].unwrap_or(1e-3);
    let is = |u: &Units| (u.metres() / metres - 1.0).abs() < 1e-6;
    let known = [Units::Mm, Units::Cm, Units::M, Units::In].into_iter().find(is);
    Ok(known.map_or((Units::Mm, metres / Units::Mm.metres()), |u| (u, 1.0)))
}

/// The diagonal of all vertices; where these are one, as on a ball, of all points and around all balls and tori.
fn diagonal(file: &Exchange, entities: &Entities) -> Result<f64, ReadError> {
    let mut points = Vec::new();
    for id in file.of_type(|name| name == "VERTEX_POINT") {
        let record = file.record(id)?;
        points.push(entities.point(record.reference(record.value(1)?)?)?);
    }
    if Aabb::of(&points).diagonal() == 0.0 {
        // Points of curves in parameters have two coordinates.
        points.extend(
            file.of_type(|name| name == "CARTESIAN_POINT").into_iter().filter_map(|id| entities.point(id).ok()),
        );
    }
    for (kind, radii) in [("SPHERICAL_SURFACE", 1), ("TOROIDAL_SURFACE", 2)] {
        for id in file.of_type(|name| name == kind) {
            let record = file.record(id)?;
            let frame = entities.frame(record.reference(record.value(1)?)?)?;
            let radius: f64 = (0..radii).map(|k| record.number(record.value(2 + k)?)).sum::<Result<f64, _>>()?;
            points.extend([frame.origin - radius, frame.origin + radius]);
        }
    }
    let diagonal = Aabb::of(&points).diagonal();
    match diagonal > 0.0 && diagonal.is_finite() {
        true => Ok(diagonal),
        false => Err(ReadError::NoFaces { vertices: points.len(), faces: 0 }),
    }
}

/// A face: its surface, its rings in parameters, and whether its triangles turn against the surface.
struct Face {
    id: u64,
    surface: Surface,
    rings: Vec<Vec<Node>>,
    is_turned: bool,
}

fn unbounded(id: u64) -> ReadError {
    fault(id, "the edges of the face do not bound a part of its surface")
}

fn face_of(
    entities: &Entities,
    id: u64,
    is_turned: bool,
    points: &mut Points,
    limits: Limits,
) -> Result<Face, ReadError> {
    let record = entities.file.record(id)?;
    if !matches!(record.name(), "ADVANCED_FACE" | "FACE_SURFACE") {
        return Err(unread(id, record.name()));
    }
    let surface = entities.surface(record.reference(record.value(2)?)?)?;
    let is_same = record.flag(record.value(3)?)?;
    let mut rings = Vec::new();
    for bound in record.references(record.value(1)?)? {
        rings.push(bound_ring(entities, bound, is_same, points, limits.fineness)?);
    }
    let rings = trim::rings(&surface, &rings, points, limits)?.ok_or_else(|| unbounded(id))?;
    Ok(Face { id, surface, rings, is_turned: is_turned == is_same })
}

/// Adds the triangles of a face to those of the others.
fn add(
    face: &Face,
    made: Result<FaceMesh, FaceFault>,
    points: &mut Points,
    triangles: &mut Vec<[u32; 3]>,
) -> Result<(), ReadError> {
    let made = made.map_err(|e| match e {
        FaceFault::Unbounded => unbounded(face.id),
        FaceFault::TooMany(count) => {
            let (count, place) = (count as u64, Place::Item("entity", face.id as usize));
            ReadError::TooLarge { what: "points of a face", count, limit: faces::MOST_INSIDE as u64, place }
        }
    })?;
    let own = made.points.into_iter().map(|p| points.add(p)).collect::<Result<Vec<u32>, _>>()?;
    let number = |corner: Corner| match corner {
        Corner::Ring(point) => point,
        Corner::Own(k) => own[k as usize],
    };
    triangles.extend(made.triangles.into_iter().map(|t| {
        let [a, b, c] = t.map(number);
        if face.is_turned { [a, c, b] } else { [a, b, c] }
    }));
    Ok(())
}

/// The ring of a bound, with the face on its left seen from where the surface's own normal points.
fn bound_ring(
    entities: &Entities,
    id: u64,
    is_same: bool,
    points: &mut Points,
    fineness: Fineness,
) -> Result<Vec<u32>, ReadError> {
    let record: Record = entities.file.record(id)?;
    let mut ring = points.ring(entities, record.reference(record.value(1)?)?, fineness)?;
    if record.flag(record.value(2)?)? != is_same {
        ring.reverse();
    }
    Ok(ring)
}
