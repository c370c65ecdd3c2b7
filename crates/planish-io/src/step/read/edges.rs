//! Edges of a STEP file as polylines, the same for both faces on them.

use super::entities::Entities;
use super::exchange::fault;
use super::shape::Curve;
use crate::{Place, ReadError};
use glam::DVec3;
use std::collections::HashMap;

/// Halvings of a piece of a curve at most.
const MOST_HALVINGS: usize = 14;
/// Points of all faces at most: a mesh of them takes half a gigabyte.
const MOST_POINTS: usize = 8_000_000;
/// Share of the period of a closed curve within which two parameters are one.
const SAME_PARAMETER: f64 = 1e-9;

/// How near triangles are to what they stand for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fineness {
    /// Largest distance that one direction leaves, in the coordinates of the file.
    pub distance: f64,
    /// Largest turn from one piece to the next, radians.
    pub turn: f64,
}

/// The points of a mesh as it grows.
#[derive(Default)]
pub(super) struct Points {
    pub all: Vec<DVec3>,
    /// By the numbers of vertices and edges; looked up only, so their order does not matter.
    vertices: HashMap<u64, u32>,
    edges: HashMap<u64, Vec<u32>>,
}

impl Points {
    pub fn add(&mut self, point: DVec3) -> Result<u32, ReadError> {
        if self.all.len() >= MOST_POINTS {
            let (count, limit) = (self.all.len() as u64 + 1, MOST_POINTS as u64);
            return Err(ReadError::TooLarge {
                what: "points of faces",
                count,
                limit,
                place: Place::Item("point", self.all.len()),
            });
        }
        self.all.push(point);
        Ok(self.all.len() as u32 - 1)
    }

    /// Forgets which point belongs to which vertex and edge: the next part is in another place.
    pub fn part(&mut self) {
        self.vertices.clear();
        self.edges.clear();
    }

    /// The point of a `VERTEX_POINT`.
    fn vertex(&mut self, entities: &Entities, id: u64) -> Result<u32, ReadError> {
        if let Some(&known) = self.vertices.get(&id) {
            return Ok(known);
        }
        let record = entities.file.record(id)?;
        let point = entities.point(record.reference(record.of("VERTEX_POINT", 1)?)?)?;
        let found = self.add(point)?;
        self.vertices.insert(id, found);
        Ok(found)
    }

    /// The points of a loop, around once.
    pub fn ring(&mut self, entities: &Entities, id: u64, fineness: Fineness) -> Result<Vec<u32>, ReadError> {
        let record = entities.file.record(id)?;
        match record.name() {
            "VERTEX_LOOP" => Ok(vec![self.vertex(entities, record.reference(record.value(1)?)?)?]),
            "POLY_LOOP" => {
                let points = record.references(record.value(1)?)?;
                points.into_iter().map(|p| self.corner(entities, p)).collect()
            }
            "EDGE_LOOP" => {
                let mut ring = Vec::new();
                for id in record.references(record.value(1)?)? {
                    let oriented = entities.file.record(id)?;
                    let edge = oriented.reference(oriented.of("ORIENTED_EDGE", 3)?)?;
                    let mut points = self.edge(entities, edge, fineness)?;
                    if !oriented.flag(oriented.of("ORIENTED_EDGE", 4)?)? {
                        points.reverse();
                    }
                    if ring.last().is_some_and(|last| *last != points[0]) {
                        return Err(fault(id, "the edge does not begin where the one before it ends"));
                    }
                    ring.pop();
                    ring.extend(points);
                }
                match (ring.first(), ring.last()) {
                    (Some(first), Some(last)) if first == last => ring.pop(),
                    _ => return Err(fault(id, "the loop of edges is not closed")),
                };
                Ok(ring)
            }
            other => Err(fault(id, format!("{other} is no loop that is read"))),
        }
    }

    /// The point of a polygon, by its `CARTESIAN_POINT`.
    fn corner(&mut self, entities: &Entities, id: u64) -> Result<u32, ReadError> {
        if let Some(&known) = self.vertices.get(&id) {
            return Ok(known);
        }
        let found = self.add(entities.point(id)?)?;
        self.vertices.insert(id, found);
        Ok(found)
    }

    fn edge(&mut self, entities: &Entities, id: u64, fineness: Fineness) -> Result<Vec<u32>, ReadError> {
        if let Some(known) = self.edges.get(&id) {
            return Ok(known.clone());
        }
        let record = entities.file.record(id)?;
        let reference = |k: usize| record.reference(record.of("EDGE_CURVE", k)?);
        let ends = [self.vertex(entities, reference(1)?)?, self.vertex(entities, reference(2)?)?];
        let is_forward = record.flag(record.of("EDGE_CURVE", 4)?)?;
        let curve = entities.curve(reference(3)?)?;
        let places = ends.map(|e| self.all[e as usize]);
        let between = between(&curve, places, is_forward, ends[0] == ends[1], fineness);
        let mut points = vec![ends[0]];
        for point in between {
            points.push(self.add(point)?);
        }
        points.push(ends[1]);
        self.edges.insert(id, points.clone());
        Ok(points)
    }
}

/// Places of a curve between two others on it, in order.
fn between(curve: &Curve, places: [DVec3; 2], is_forward: bool, is_whole: bool, fineness: Fineness) -> Vec<DVec3> {
    let [from, to] = curve.range();
    if !(to - from).is_finite() {
        return Vec::new();
    }
    let period = curve.period();
    let [mut start, mut end] = places.map(|p| curve.parameter(p));
    if !is_forward {
        (start, end) = (end, start);
    }
    match period {
        Some(_) if is_whole => end = start + (to - from),
        Some(period) if end - start <= SAME_PARAMETER * period => end += period,
        None if is_whole => (start, end) = (from, to),
        _ => {}
    }
    let at = |t: f64| curve.at(if period.is_some() && t > to { t - (to - from) } else { t });
    let mut breaks: Vec<f64> = curve.breaks();
    if let Some(period) = period {
        breaks.extend(curve.breaks().iter().map(|b| b + period));
    }
    let inside = |b: &f64| {
        *b > start.min(end) + SAME_PARAMETER * (to - from) && *b < start.max(end) - SAME_PARAMETER * (to - from)
    };
    let mut stops: Vec<f64> = breaks.into_iter().filter(inside).collect();
    stops.sort_by(f64::total_cmp);
    stops.dedup_by(|a, b| (*a - *b).abs() <= SAME_PARAMETER * (to - from));
    if end < start {
        stops.reverse();
    }
    stops.insert(0, start);
    stops.push(end);
    let mut found = Vec::new();
    for pair in stops.windows(2) {
        divided(&at, [pair[0], pair[1]], 0, fineness, &mut found);
        found.push(pair[1]);
    }
    found.pop();
    if !is_forward {
        found.reverse();
    }
    found.into_iter().map(at).collect()
}

/// Parameters that divide a piece of a curve finely enough, its ends left out.
pub(super) fn parameters_between(at: &dyn Fn(f64) -> DVec3, ends: [f64; 2], fineness: Fineness) -> Vec<f64> {
    let mut found = Vec::new();
    divided(at, ends, 0, fineness, &mut found);
    found
}

/// Adds the parameters at which a piece of a curve has to be divided, without its ends.
fn divided(at: &dyn Fn(f64) -> DVec3, [a, b]: [f64; 2], depth: usize, fineness: Fineness, found: &mut Vec<f64>) {
    let [p, q, m, r, s] = [0.0, 0.25, 0.5, 0.75, 1.0].map(|k| at(a + (b - a) * k));
    let chord = s - p;
    let off = |x: DVec3| (x - p).reject_from_normalized(chord.normalize_or_zero()).length();
    let is_near = [q, m, r].into_iter().all(|x| off(x) <= fineness.distance);
    let is_bent = (m - p).angle_between(s - m) > fineness.turn;
    let is_short = p.distance(m) + m.distance(s) <= fineness.distance;
    if depth >= MOST_HALVINGS || is_short || (is_near && !is_bent) {
        return;
    }
    let middle = (a + b) / 2.0;
    divided(at, [a, middle], depth + 1, fineness, found);
    found.push(middle);
    divided(at, [middle, b], depth + 1, fineness, found);
}
