//! From a seamless map to an integer-grid map: cones and corners of lines come to lie on whole numbers.
//!
//! 1. the mesh is thinned out in the map until only cones and corners of lines are left ([`thin`], on [`flat`]);
//! 2. the edges of the triangles that are left get whole vectors, at a scale at which all triangles are upright; walks over
//!    the triangles then make them as short as can be ([`walks`]), or of the size asked for with isolines turned least ([`form`]);
//! 3. every corner of the mesh goes where the stretched triangle takes it ([`charts`]).
//!
//! Coudert-Osmont, Desobry, Heistermann, Bommes, Ray, Sokolov 2024, *Quad Mesh Quantization Without a T-Mesh*.

mod charts;
mod flat;
mod form;
#[cfg(test)]
mod tests;
mod thin;
mod walks;

use crate::geom::is_positive;
use crate::layout::map::SeamlessMap;
use crate::mesh::{Adjacency, NONE, TriMesh, previous};
use crate::observe::{Cancelled, Observer};
use flat::Flat;
use glam::DVec2;
use walks::Whole;

/// How large the unit squares are to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Scale {
    /// As few squares as the cones and lines allow.
    Coarsest,
    /// About so many squares.
    Squares(usize),
}

/// A map in which the grid of whole numbers is a mesh of quads.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct IntegerMap {
    /// Corners of each triangle in its chart, unit squares. The charts are turned as those of the seamless map, whose
    /// jumps hold; from chart to chart the shift is whole, and so is what lies across lines. Exact to the last bit. A
    /// triangle may be turned over where its corners lie in different triangles of the thinned mesh.
    pub uv: Vec<[DVec2; 3]>,
    /// Vertices that lie on whole numbers: cones, ends, bends and junctions of lines, and a few that could not be taken
    /// out.
    pub kept: Vec<u32>,
    /// Number of unit squares.
    pub squares: usize,
}

/// Why there is no integer-grid map.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum QuantizeError {
    /// The map is not injective.
    #[error("triangle {triangle} has no area in the map - hint: untangle the map first")]
    Flipped {
        /// The first such triangle.
        triangle: usize,
    },
    /// Whole numbers were not found.
    #[error(
        "{triangles} triangles between cones and lines could not all be kept upright on whole numbers - hint: fewer lines"
    )]
    Stuck {
        /// Triangles of the thinned mesh.
        triangles: usize,
    },
    /// The map does not fit along its seams.
    #[error("the map does not fit along its seams by more than rounding - hint: its jumps and corners must agree")]
    Torn,
    /// Stopped by the observer.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// Prices of a square that are tried on the way towards the number of squares asked for, and how near is near enough.
const MAX_PRICES: usize = 10;
const NEAR: f64 = 0.04;

/// The first price of all squares asked for, against an energy of 1 of the whole map.
const FIRST_PRICE: f64 = 0.1;

/// Turns of flips and walks.
const FLIP_ROUNDS: usize = 6;

/// Stretches an injective seamless map so that cones, ends, junctions and bends of lines lie on whole numbers and every
/// transition between charts is by whole numbers.
/// * `lines` - for each half-edge whether it lies on a line that the squares must follow; boundaries always do
/// # Errors
/// [`QuantizeError`]; among others `Flipped` if a triangle of the map is not counter-clockwise.
pub(super) fn quantize(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    map: &SeamlessMap,
    lines: &[bool],
    scale: Scale,
    observer: &dyn Observer,
) -> Result<IntegerMap, QuantizeError> {
    let area = |t: &[DVec2; 3]| (t[1] - t[0]).perp_dot(t[2] - t[0]) / 2.0;
    if let Some(triangle) = map.uv.iter().position(|t| !is_positive(area(t))) {
        return Err(QuantizeError::Flipped { triangle });
    }
    let mut flat = Flat::new(mesh, adjacency, map, lines);
    let line = flat.line.clone();
    let stays = thin::corners(&flat);
    thin::thin(&mut flat, &stays, observer)?;
    let flat = flat.compact();
    observer.progress(0.4);
    let total: f64 = map.uv.iter().map(area).sum();
    let triangles = flat.len();
    let whole = integers(flat, &parts(mesh, map), total, scale, observer)?.ok_or(QuantizeError::Stuck { triangles })?;
    let flat = &whole.flat;
    observer.progress(0.8);
    let edges: Vec<DVec2> = whole.q.iter().map(|q| q.as_dvec2()).collect();
    let shapes = charts::shapes(&charts::Stretch::new(flat, &edges), map);
    let kept: Vec<bool> = flat.outgoing.iter().map(|&h| h != NONE).collect();
    let uv = charts::place(mesh, adjacency, map, shapes, &kept, &line).ok_or(QuantizeError::Torn)?;
    let squares = whole.squares() as usize;
    Ok(IntegerMap { uv, kept: (0..kept.len() as u32).filter(|&v| kept[v as usize]).collect(), squares })
}

/// The least number of squares that a map can have, by Euler's formula: each corner of lines is a vertex of theirs, and quads
/// with `i` vertices inside and `b` on boundaries number `i + b/2` less the Euler number.
/// * `lines` - as in [`quantize`]
pub(super) fn least_squares(mesh: &TriMesh, adjacency: &Adjacency, map: &SeamlessMap, lines: &[bool]) -> usize {
    let flat = Flat::new(mesh, adjacency, map, lines);
    let twice = |(v, is_kept): (usize, bool)| match flat.fan(v as u32) {
        fan if !is_kept || !fan.iter().any(|&h| flat.line[h as usize]) => 0,
        fan if fan.iter().any(|&h| flat.opposite[previous(h) as usize] == NONE) => 1,
        _ => 2,
    };
    let sum: i64 = thin::corners(&flat).into_iter().enumerate().map(twice).sum();
    let used = adjacency.outgoing.iter().filter(|h| **h != NONE).count();
    let open = adjacency.opposite.iter().filter(|o| **o == NONE).count();
    // There are `(3 faces + open) / 2` edges.
    let euler = used as i64 - (mesh.triangles.len() + open) as i64 / 2;
    ((sum + 1) / 2 - euler).max(0) as usize
}

/// The parts that each face has of the area of the surface and of the map.
fn parts(mesh: &TriMesh, map: &SeamlessMap) -> Vec<DVec2> {
    let areas: Vec<DVec2> = (map.uv.iter().enumerate())
        .map(|(f, [a, b, c])| DVec2::new(mesh.area(f), (*b - *a).perp_dot(*c - *a) / 2.0))
        .collect();
    let sum: DVec2 = areas.iter().sum();
    areas.into_iter().map(|area| area / sum).collect()
}

/// Whole edge vectors for a thinned mesh; `None` if there are none with all triangles upright.
/// * `parts` - [`parts`]
/// * `area` - of the map
fn integers(
    flat: Flat,
    parts: &[DVec2],
    area: f64,
    scale: Scale,
    observer: &dyn Observer,
) -> Result<Option<Whole>, Cancelled> {
    let asked = match scale {
        Scale::Coarsest => flat.len() as f64 / 2.0,
        Scale::Squares(count) => count as f64,
    };
    let ratio = (asked / area).sqrt();
    let Some(mut whole) = Whole::start(flat, ratio, observer)? else { return Ok(None) };
    if scale == Scale::Coarsest {
        shrink(&mut whole, observer)?;
        return Ok(Some(whole));
    }
    let off = |w: &Whole| (w.squares() as f64 / asked).ln();
    let mut best: Option<Whole> = None;
    // What a square costs; what gave too few and too many of them; and by how much it changes until both are known.
    let (mut price, mut high, mut low) = (0.0, None, None);
    let mut change = FIRST_PRICE / asked;
    for _ in 0..MAX_PRICES {
        settle(&mut whole, parts, ratio, price, observer)?;
        if best.as_ref().is_none_or(|b| off(&whole).abs() < off(b).abs()) {
            best = Some(whole.clone());
        }
        if off(&whole).abs() <= NEAR {
            break;
        }
        let are_few = off(&whole) < 0.0;
        *(if are_few { &mut high } else { &mut low }) = Some(price);
        price = match (low, high) {
            (Some(low), Some(high)) => (low + high) / 2.0,
            _ => price + if are_few { -change } else { change },
        };
        change *= 2.0;
    }
    Ok(best)
}

/// Brings the vectors near to the map at a scale, where each square has a price: walks and flips in turn.
fn settle(
    whole: &mut Whole,
    parts: &[DVec2],
    scale: f64,
    price: f64,
    observer: &dyn Observer,
) -> Result<(), Cancelled> {
    for _ in 0..FLIP_ROUNDS {
        form::descend(whole, parts, scale, price, observer)?;
        if !whole.flip_edges() {
            break;
        }
    }
    Ok(())
}

/// Makes the vectors as short as walks and flips can.
fn shrink(whole: &mut Whole, observer: &dyn Observer) -> Result<(), Cancelled> {
    whole.wish_least();
    for _ in 0..FLIP_ROUNDS {
        whole.descend(observer)?;
        if !whole.flip_edges() {
            break;
        }
    }
    whole.descend_far(observer)
}
