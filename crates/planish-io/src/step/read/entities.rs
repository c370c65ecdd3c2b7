//! Curves, surfaces, placements and units of a STEP file from its records.

use super::exchange::{Exchange, Record, Value, fault};
use super::shape::{CLOSED, Curve, Frame, Surface};
use super::spline::{Basis, SplineCurve, SplineSurface};
use crate::{Place, ReadError};
use glam::{DMat3, DVec3, DVec4};

/// Curves on curves at most: trimmed, on surfaces.
const MOST_BASES: usize = 8;

/// That a file has what is not read.
pub(super) fn unread(id: u64, name: &str) -> ReadError {
    ReadError::Unsupported {
        what: format!("the kind {name}"),
        place: Place::Item("entity", id as usize),
        hint: "export it with B-spline and elementary faces, or as a mesh",
    }
}

/// Reads geometry; angles are in the unit of the file.
pub(super) struct Entities<'a> {
    pub file: &'a Exchange<'a>,
    /// Radians of a unit of angle.
    pub angle: f64,
}

impl<'a> Entities<'a> {
    /// The entities of a file.
    pub fn new(file: &'a Exchange<'a>) -> Result<Entities<'a>, ReadError> {
        let [_, angle] = Entities::units(file)?;
        Ok(Entities { file, angle: angle.unwrap_or(1.0) })
    }

    /// A `CARTESIAN_POINT`.
    pub fn point(&self, id: u64) -> Result<DVec3, ReadError> {
        let record = self.file.record(id)?;
        match record.numbers(record.of("CARTESIAN_POINT", 1)?)?[..] {
            [x, y, z] => Ok(DVec3::new(x, y, z)),
            _ => Err(fault(id, "a point has no three coordinates")),
        }
    }

    fn direction(&self, id: u64) -> Result<DVec3, ReadError> {
        let record = self.file.record(id)?;
        match record.numbers(record.of("DIRECTION", 1)?)?[..] {
            [x, y, z] => {
                let unit = DVec3::new(x, y, z).try_normalize();
                unit.ok_or_else(|| fault(id, "a direction has no length"))
            }
            _ => Err(fault(id, "a direction has no three coordinates")),
        }
    }

    fn vector(&self, id: u64) -> Result<DVec3, ReadError> {
        let record = self.file.record(id)?;
        let length = record.number(record.of("VECTOR", 2)?)?;
        let vector = self.direction(record.reference(record.of("VECTOR", 1)?)?)? * length;
        (vector != DVec3::ZERO).then_some(vector).ok_or_else(|| fault(id, "a vector has no length"))
    }

    fn direction_or(&self, record: &Record, value: &Value, usual: DVec3) -> Result<DVec3, ReadError> {
        if *value == Value::Absent { Ok(usual) } else { self.direction(record.reference(value)?) }
    }

    /// An `AXIS2_PLACEMENT_3D` or `AXIS1_PLACEMENT`; a first direction that is missing is any.
    pub fn frame(&self, id: u64) -> Result<Frame, ReadError> {
        let record = self.file.record(id)?;
        let origin = self.point(record.reference(record.value(1)?)?)?;
        let z = self.direction_or(&record, record.value(2)?, DVec3::Z)?;
        let first = match record.name() {
            "AXIS2_PLACEMENT_3D" => self.direction_or(&record, record.value(3)?, DVec3::X)?,
            "AXIS1_PLACEMENT" => z.any_orthonormal_vector(),
            other => return Err(unread(id, other)),
        };
        let x = (first - z * first.dot(z)).try_normalize().unwrap_or_else(|| z.any_orthonormal_vector());
        Ok(Frame { origin, axes: DMat3::from_cols(x, z.cross(x), z) })
    }

    fn placed(&self, record: &Record) -> Result<Frame, ReadError> {
        self.frame(record.reference(record.value(1)?)?)
    }

    fn radius(&self, record: &Record, k: usize) -> Result<f64, ReadError> {
        let radius = record.number(record.value(k)?)?;
        (radius > 0.0).then_some(radius).ok_or_else(|| fault(record.id, "a radius is not above 0"))
    }

    /// A curve in space.
    pub fn curve(&self, id: u64) -> Result<Curve, ReadError> {
        let mut id = id;
        for _ in 0..MOST_BASES {
            let record = self.file.record(id)?;
            let reference = |k: usize| record.reference(record.value(k)?);
            return match record.name() {
                "LINE" => Ok(Curve::Line { origin: self.point(reference(1)?)?, along: self.vector(reference(2)?)? }),
                "CIRCLE" => {
                    let radius = self.radius(&record, 2)?;
                    Ok(Curve::Ellipse { frame: self.placed(&record)?, radii: [radius; 2] })
                }
                "ELLIPSE" => {
                    let radii = [self.radius(&record, 2)?, self.radius(&record, 3)?];
                    Ok(Curve::Ellipse { frame: self.placed(&record)?, radii })
                }
                "POLYLINE" => {
                    let points = record.references(record.value(1)?)?;
                    let points = points.into_iter().map(|p| self.point(p)).collect::<Result<Vec<_>, _>>()?;
                    let is_line = points.len() >= 2;
                    is_line.then_some(Curve::Polyline(points)).ok_or_else(|| fault(id, "a polyline has one point"))
                }
                // Those that lie on surfaces, and parts of others: edges say where they begin and end.
                "SURFACE_CURVE" | "SEAM_CURVE" | "INTERSECTION_CURVE" | "TRIMMED_CURVE" => {
                    id = reference(1)?;
                    continue;
                }
                _ if record.is("B_SPLINE_CURVE_WITH_KNOTS") => self.spline_curve(&record),
                other => Err(unread(id, other)),
            };
        }
        Err(fault(id, "curves refer to curves without end"))
    }

    fn basis(
        &self,
        record: &Record,
        degree: usize,
        [times, knots]: [&Value; 2],
        control: usize,
    ) -> Result<Basis, ReadError> {
        let knots: Vec<f64> = record.list(knots)?.iter().map(|k| record.number(k)).collect::<Result<_, _>>()?;
        let times: Vec<usize> = record.list(times)?.iter().map(|k| record.count(k)).collect::<Result<_, _>>()?;
        let all: usize = times.iter().fold(0, |sum, &n| sum.saturating_add(n));
        let wrong = || fault(record.id, "knots, degree and control points do not fit");
        if times.len() != knots.len() || all != control.saturating_add(degree).saturating_add(1) {
            return Err(wrong());
        }
        let knots = knots.iter().zip(times).flat_map(|(&k, n)| std::iter::repeat_n(k, n)).collect();
        Basis::new(degree, knots, control).ok_or_else(wrong)
    }

    fn weighted(&self, record: &Record, points: &[u64], weights: Vec<f64>) -> Result<Vec<DVec4>, ReadError> {
        if weights.len() != points.len() || weights.iter().any(|w| *w <= 0.0) {
            return Err(fault(record.id, "weights are missing or not above 0"));
        }
        let one = |(&p, w): (&u64, f64)| Ok((self.point(p)? * w).extend(w));
        points.iter().zip(weights).map(one).collect()
    }

    fn spline_curve(&self, record: &Record) -> Result<Curve, ReadError> {
        // A simple record has a name before the parameters of all types, a record of several types has none.
        let (shape, knots, first, after) = match record.is("B_SPLINE_CURVE") {
            true => ("B_SPLINE_CURVE", "B_SPLINE_CURVE_WITH_KNOTS", 0, 0),
            false => ("B_SPLINE_CURVE_WITH_KNOTS", "B_SPLINE_CURVE_WITH_KNOTS", 1, 6),
        };
        let degree = record.count(record.of(shape, first)?)?;
        let points = record.references(record.of(shape, first + 1)?)?;
        let weights = match record.is("RATIONAL_B_SPLINE_CURVE") {
            true => record.numbers(record.of("RATIONAL_B_SPLINE_CURVE", 0)?)?,
            false => vec![1.0; points.len()],
        };
        let lists = [record.of(knots, after)?, record.of(knots, after + 1)?];
        let basis = self.basis(record, degree, lists, points.len())?;
        Ok(Curve::Spline(SplineCurve { basis, control: self.weighted(record, &points, weights)? }))
    }

    /// A surface.
    pub fn surface(&self, id: u64) -> Result<Surface, ReadError> {
        let record = self.file.record(id)?;
        let reference = |k: usize| record.reference(record.value(k)?);
        match record.name() {
            "PLANE" => Ok(Surface::Plane(self.placed(&record)?)),
            "CYLINDRICAL_SURFACE" => {
                Ok(Surface::Cone { frame: self.placed(&record)?, radius: self.radius(&record, 2)?, slope: 0.0 })
            }
            "CONICAL_SURFACE" => {
                let (radius, half) = (record.number(record.value(2)?)?, record.number(record.value(3)?)?);
                let slope = (half * self.angle).tan();
                let is_cone = radius >= 0.0 && slope.is_finite() && slope != 0.0;
                let frame = self.placed(&record)?;
                is_cone
                    .then_some(Surface::Cone { frame, radius, slope })
                    .ok_or_else(|| fault(id, "a cone has no angle"))
            }
            "SPHERICAL_SURFACE" => {
                Ok(Surface::Torus { frame: self.placed(&record)?, major: 0.0, minor: self.radius(&record, 2)? })
            }
            "TOROIDAL_SURFACE" => {
                let (major, minor) = (self.radius(&record, 2)?, self.radius(&record, 3)?);
                Ok(Surface::Torus { frame: self.placed(&record)?, major, minor })
            }
            "SURFACE_OF_REVOLUTION" => {
                Ok(Surface::Revolution { curve: self.curve(reference(1)?)?, frame: self.frame(reference(2)?)? })
            }
            "SURFACE_OF_LINEAR_EXTRUSION" => {
                Ok(Surface::Extrusion { curve: self.curve(reference(1)?)?, along: self.vector(reference(2)?)? })
            }
            "RECTANGULAR_TRIMMED_SURFACE" => {
                let basis = reference(1)?;
                if self.file.record(basis)?.name() == record.name() {
                    Err(unread(id, record.name()))
                } else {
                    self.surface(basis)
                }
            }
            _ if record.is("B_SPLINE_SURFACE_WITH_KNOTS") => self.spline_surface(&record),
            other => Err(unread(id, other)),
        }
    }

    fn spline_surface(&self, record: &Record) -> Result<Surface, ReadError> {
        let (shape, knots, first, after) = match record.is("B_SPLINE_SURFACE") {
            true => ("B_SPLINE_SURFACE", "B_SPLINE_SURFACE_WITH_KNOTS", 0, 0),
            false => ("B_SPLINE_SURFACE_WITH_KNOTS", "B_SPLINE_SURFACE_WITH_KNOTS", 1, 8),
        };
        let degrees = [record.count(record.of(shape, first)?)?, record.count(record.of(shape, first + 1)?)?];
        // Lists along v, one for each place along u.
        let rows = record.list(record.of(shape, first + 2)?)?;
        let lists: Vec<Vec<u64>> = rows.iter().map(|row| record.references(row)).collect::<Result<_, _>>()?;
        let across = lists.first().map_or(0, Vec::len);
        if lists.iter().any(|row| row.len() != across) {
            return Err(fault(record.id, "rows of control points are of different lengths"));
        }
        let turned = |at: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
            (0..across).flat_map(|j| (0..lists.len()).map(move |i| (i, j))).map(|(i, j)| at(i, j)).collect()
        };
        let weights = match record.is("RATIONAL_B_SPLINE_SURFACE") {
            true => {
                let rows = record.list(record.of("RATIONAL_B_SPLINE_SURFACE", 0)?)?;
                let rows: Vec<Vec<f64>> = rows.iter().map(|row| record.numbers(row)).collect::<Result<_, _>>()?;
                turned(&|i, j| rows.get(i).and_then(|row| row.get(j)).copied().unwrap_or(0.0))
            }
            false => vec![1.0; lists.len() * across],
        };
        let points: Vec<u64> = (0..across).flat_map(|j| lists.iter().map(move |row| row[j])).collect();
        let values = [0, 1, 2, 3].map(|k| record.of(knots, after + k));
        let [times_u, times_v, knots_u, knots_v] = values;
        let basis = [
            self.basis(record, degrees[0], [times_u?, knots_u?], lists.len())?,
            self.basis(record, degrees[1], [times_v?, knots_v?], across)?,
        ];
        let spline = SplineSurface { basis, control: self.weighted(record, &points, weights)? };
        let at = |c: &DVec4| c.truncate() / c.w;
        let size = spline.control.iter().map(|c| at(c).distance(at(&spline.control[0]))).fold(0.0, f64::max);
        let closed = [0, 1].map(|axis| spline.is_closed(axis, CLOSED * size));
        Ok(Surface::Spline { spline, closed })
    }

    /// Metres of a unit of length and radians of a unit of angle, as the first context of the file says that has one.
    pub fn units(file: &Exchange) -> Result<[Option<f64>; 2], ReadError> {
        let mut units = [None; 2];
        for context in file.of_type(|name| name == "GLOBAL_UNIT_ASSIGNED_CONTEXT") {
            let record = file.record(context)?;
            for unit in record.references(record.of("GLOBAL_UNIT_ASSIGNED_CONTEXT", 0)?)? {
                for (kind, found) in ["LENGTH_UNIT", "PLANE_ANGLE_UNIT"].into_iter().zip(&mut units) {
                    // Contexts of curves in parameters have units of their own, which are not lengths.
                    if file.record(unit)?.is(kind) && found.is_none() {
                        *found = Some(unit_size(file, unit, 0)?);
                    }
                }
            }
        }
        Ok(units)
    }
}

/// A unit of length or angle in metres or radians.
fn unit_size(file: &Exchange, id: u64, depth: usize) -> Result<f64, ReadError> {
    let record = file.record(id)?;
    if record.is("SI_UNIT") {
        let power = match record.of("SI_UNIT", 0)? {
            Value::Absent => 0,
            Value::Word("KILO") => 3,
            Value::Word("DECI") => -1,
            Value::Word("CENTI") => -2,
            Value::Word("MILLI") => -3,
            Value::Word("MICRO") => -6,
            Value::Word("NANO") => -9,
            _ => return Err(unread(id, "of this unit")),
        };
        return Ok(10f64.powi(power));
    }
    if !record.is("CONVERSION_BASED_UNIT") || depth > MOST_BASES {
        return Err(unread(id, record.name()));
    }
    let measure = file.record(record.reference(record.of("CONVERSION_BASED_UNIT", 1)?)?)?;
    let name = if measure.is("MEASURE_WITH_UNIT") { "MEASURE_WITH_UNIT" } else { measure.name() };
    let number = measure.number(measure.of(name, 0)?)?;
    let size = number * unit_size(file, measure.reference(measure.of(name, 1)?)?, depth + 1)?;
    (size > 0.0).then_some(size).ok_or_else(|| fault(id, "a unit is not above 0"))
}
