//! IGES 5.3: B-spline patches as solids with shared edges where they are closed, as surfaces where they are open.
//!
//! US PRO, *Initial Graphics Exchange Specification 5.3* (1996): surfaces 128 with curves 126; for a closed component a solid
//! 186 of one shell 514 of faces 510 with a loop 508 each, one list of edges 504 and one of vertices 502. Every edge brings its
//! line 110 in the parameters of the faces beside it. Names are properties 406 of form 15, colours definitions 314.
//!
//! Patches of an open component are surfaces 128 by themselves: none of them is trimmed, and the format's trimmed
//! surfaces 143 and 144 share no edges either.

mod records;

use crate::topology::{self, Component, Topology};
use crate::{Place, WriteError, atomic};
use planish::Units;
use planish::geom::Aabb;
use planish::network::Network;
use planish::render;
use planish::surface::Surface;
use records::{Mark, Records, Role, coordinates, real, text};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Accuracy that the file claims at least, as a fraction of the diagonal: what CAD kernels work with.
const ACCURACY: f64 = 1e-7;

/// What an IGES file is made of.
#[derive(Clone, Copy, Debug)]
pub struct IgesInput<'a> {
    /// Which patch meets which along which curve.
    pub network: &'a Network,
    /// One surface per patch of the network.
    pub surfaces: &'a [Surface],
    /// What one unit of a coordinate is; the numbers are written as they are.
    pub units: Units,
    /// Name of the product.
    pub name: &'a str,
}

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct IgesSummary {
    /// Closed components, each a solid.
    pub solids: usize,
    /// Faces of the solids.
    pub faces: usize,
    /// Surfaces of open components.
    pub surfaces: usize,
}

/// Writes patches as IGES 5.3. Names and colours are those of [`crate::write_step`], but for edges, which the format gives none;
/// their curves have labels. Normals point outside. The time in the file is fixed, so that the same model gives the same
/// bytes. The file appears whole or not at all.
/// # Errors
/// As [`crate::write_step`], and `WriteError::Value` for more than the format can count.
pub fn write_iges(path: impl AsRef<Path>, input: &IgesInput) -> Result<IgesSummary, WriteError> {
    let topology = Topology::new(input.network, input.surfaces)?;
    let mut records = Records::default();
    let mut summary = IgesSummary::default();
    let marks = marks(&mut records, input.surfaces.len());
    for (number, Component { patches, closed }) in (1..).zip(&topology.components) {
        if *closed {
            let shell = shell(&mut records, input, &topology, (patches, &marks))?;
            let mark = Mark { name: Some(name(&mut records, &format!("piece {number}"))), ..Mark::default() };
            records.add([186, 0], Role::Free, mark, &[shell.to_string(), "1".into(), "0".into()]);
            summary.solids += 1;
            summary.faces += patches.len();
        } else {
            for &p in patches {
                surface(&mut records, &input.surfaces[p], marks[p], Role::Free);
                summary.surfaces += 1;
            }
        }
    }
    let file = records.finish("B-spline patches", &global(input, topology.gap_max))?;
    atomic::write(path.as_ref(), |out: &mut BufWriter<File>| -> Result<(), WriteError> {
        Ok(out.write_all(file.as_bytes())?)
    })?;
    Ok(summary)
}

/// The global section.
fn global(input: &IgesInput, gap_max: f64) -> Vec<String> {
    let bounds = Aabb::of(input.surfaces.iter().flat_map(|s| &s.control));
    // The control rows of a seam may differ by rounding: the accuracy covers it.
    let accuracy = (ACCURACY * bounds.diagonal()).max(2.0 * gap_max);
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
    let (unit, name) = match input.units {
        Units::In => ("1", "IN"),
        Units::Mm => ("2", "MM"),
        Units::M => ("6", "M"),
        Units::Cm => ("10", "CM"),
    };
    let (product, program) = (text(input.name), text(concat!("planish ", env!("CARGO_PKG_VERSION"))));
    // Integers of 32 bits; powers of ten and digits of single and of double precision.
    let numbers = ["32", "38", "6", "308", "15"].map(String::from);
    let time = text("19700101.000000");
    let mut values = vec!["1H,".into(), "1H;".into(), product.clone(), product.clone(), program.clone(), program];
    values.extend(numbers);
    values.extend([product, "1.".into(), unit.into(), text(name), "1".into(), real(0.0), time.clone()]);
    // Resolution, largest coordinate, author, organisation, version 5.3, no drafting standard, time of the model.
    values.extend([real(accuracy), real(largest), String::new(), String::new(), "11".into(), "0".into(), time]);
    values
}

/// Label, name and colour of every patch.
fn marks(records: &mut Records, count: usize) -> Vec<Mark> {
    let mut colors = BTreeMap::new();
    let mark = |(p, color): (usize, [u8; 3])| {
        let percent = color.map(|byte| real(f64::from(byte) / 2.55));
        let color =
            *colors.entry(color).or_insert_with(|| records.add([314, 0], Role::Definition, Mark::default(), &percent));
        let name = name(records, &format!("patch {p}"));
        Mark { label: Some(("PATCH", p)), color: Some(color), name: Some(name) }
    };
    render::even_colors(count).into_iter().enumerate().map(mark).collect()
}

/// A name that entities may point to.
fn name(records: &mut Records, words: &str) -> usize {
    records.add([406, 15], Role::Definition, Mark::default(), &["1".into(), text(words)])
}

/// The shell of a closed component.
fn shell(
    records: &mut Records,
    input: &IgesInput,
    topology: &Topology,
    (patches, marks): (&[usize], &[Mark]),
) -> Result<usize, WriteError> {
    let list = edges(records, input, topology, patches)?;
    let lines = side_lines(records);
    let mut shell = vec![patches.len().to_string()];
    for &p in patches {
        let on = surface(records, &input.surfaces[p], Mark { name: None, ..marks[p] }, Role::Part);
        let sides = input.network.patches[p].sides.iter().enumerate();
        // A collapsed side is a point, which its neighbours already end at.
        let uses: Vec<_> = sides.filter_map(|(k, side)| Some((k, side, *list.numbers.get(&side.curve)?))).collect();
        let mut ring = vec![uses.len().to_string()];
        for (k, side, number) in uses {
            let agrees = if side.reversed { "0" } else { "1" };
            // An edge: the list and its number in it, its direction, one line in the parameters, which is not isoparametric
            // by its own account: readers then take it as it is.
            ring.extend(["0".into(), list.pointer.to_string(), number.to_string(), agrees.into()]);
            ring.extend(["1".into(), "0".into(), lines[k].to_string()]);
        }
        let ring = records.add([508, 1], Role::Part, Mark::default(), &ring);
        let face = [on.to_string(), "1".into(), "1".into(), ring.to_string()];
        shell.extend([records.add([510, 1], Role::Part, marks[p], &face).to_string(), "1".into()]);
    }
    Ok(records.add([514, 1], Role::Part, Mark::default(), &shell))
}

/// A list of edges.
struct Edges {
    pointer: usize,
    /// For each curve that is an edge its number in the list, from 1.
    numbers: BTreeMap<u32, usize>,
}

/// The edges of a component with their vertices.
fn edges(
    records: &mut Records,
    input: &IgesInput,
    topology: &Topology,
    patches: &[usize],
) -> Result<Edges, WriteError> {
    let mut numbers = BTreeMap::new();
    for side in patches.iter().flat_map(|&p| &input.network.patches[p].sides) {
        if topology.curves[side.curve as usize].as_ref().is_some_and(|row| !row.collapsed) {
            numbers.insert(side.curve, 0);
        }
    }
    numbers.values_mut().enumerate().for_each(|(k, number)| *number = k + 1);
    let mut corners: BTreeMap<u32, usize> = BTreeMap::new();
    for &c in numbers.keys() {
        corners.extend(input.network.curves[c as usize].corners.map(|corner| (corner, 0)));
    }
    corners.values_mut().enumerate().for_each(|(k, number)| *number = k + 1);
    let mut vertices = vec![corners.len().to_string()];
    for &corner in corners.keys() {
        let place = topology.corners[corner as usize].ok_or_else(|| WriteError::Inconsistent {
            what: "the corner has no patch".into(),
            place: Place::Item("corner", corner as usize),
        })?;
        vertices.extend(coordinates(place));
    }
    let vertices = records.add([502, 1], Role::Part, Mark::default(), &vertices);
    let mut values = vec![numbers.len().to_string()];
    for &c in numbers.keys() {
        let Some(row) = &topology.curves[c as usize] else { continue };
        values.push(curve(records, row, c as usize).to_string());
        for corner in input.network.curves[c as usize].corners {
            values.extend([vertices.to_string(), corners[&corner].to_string()]);
        }
    }
    Ok(Edges { pointer: records.add([504, 1], Role::Part, Mark::default(), &values), numbers })
}

fn curve(records: &mut Records, row: &topology::Row, number: usize) -> usize {
    let closed = if row.is_closed() { "1" } else { "0" };
    let mut values = vec![(row.control.len() - 1).to_string(), "3".into()];
    // Not planar as far as anybody knows, closed or not, polynomial, not periodic.
    values.extend(["0", closed, "1", "0"].map(String::from));
    values.extend(row.knots.iter().map(|&t| real(t)));
    values.extend(row.control.iter().map(|_| real(1.0)));
    values.extend(row.control.iter().flat_map(|&p| coordinates(p)));
    values.extend([row.knots[0], row.knots[row.knots.len() - 1], 0.0, 0.0, 0.0].map(real));
    let mark = Mark { label: Some(("CURVE", number)), ..Mark::default() };
    records.add([126, 0], Role::Part, mark, &values)
}

/// A B-spline surface with its knots: control points with `u` fastest, as ours.
fn surface(records: &mut Records, surface: &Surface, mark: Mark, role: Role) -> usize {
    let flag = |closed: bool| if closed { "1" } else { "0" };
    let (closed_u, closed_v) = topology::closed(surface);
    let mut values = vec![(surface.cols - 1).to_string(), (surface.rows - 1).to_string()];
    // Degrees; closed or not; polynomial; not periodic.
    values.extend(["3", "3", flag(closed_u), flag(closed_v), "1", "0", "0"].map(String::from));
    values.extend(surface.knots_u.iter().chain(&surface.knots_v).map(|&t| real(t)));
    values.extend(surface.control.iter().map(|_| real(1.0)));
    values.extend(surface.control.iter().flat_map(|&p| coordinates(p)));
    let (u, v) = (&surface.knots_u, &surface.knots_v);
    values.extend([u[3], u[surface.cols], v[3], v[surface.rows]].map(real));
    records.add([128, 0], role, mark, &values)
}

/// The sides of the square of parameters along the way around a patch.
fn side_lines(records: &mut Records) -> [usize; 4] {
    const CORNERS: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    std::array::from_fn(|k| {
        let ends = [CORNERS[k], CORNERS[(k + 1) % 4]];
        let values: Vec<String> = ends.iter().flat_map(|[u, v]| [*u, *v, 0.0]).map(real).collect();
        records.add([110, 0], Role::Flat, Mark::default(), &values)
    })
}
