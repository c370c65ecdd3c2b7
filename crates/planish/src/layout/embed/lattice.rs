//! An integer-grid map on a lattice of binary fractions, where every sum and every sign is exact; and its vertices moved,
//! in the map only, until each integer point has one.

use super::EmbedError;
use crate::layout::map::{SeamlessMap, quarter_turn};
use crate::mesh::{Adjacency, NONE, TriMesh, next, previous};
use glam::DVec2;
use std::f64::consts::{PI, TAU};

/// The lattice's step is a unit square's side by 2 to this power: far below the size of a triangle, and products of three
/// hundred million units still fit.
const BITS: u32 = 30;
/// Side of a unit square in steps.
pub(super) const UNIT: i64 = 1 << BITS;

/// What rounding may have moved a number of the map by that is to be whole, unit squares.
const NEARLY_WHOLE: f64 = 1e-4;

/// Rounds of making room for a vertex at an integer point, and how many rings around the point take part.
const ROOM_ROUNDS: usize = 12;
const ROOM_RINGS: usize = 3;

/// A place in a chart, in steps of the lattice.
pub(super) type Spot = [i64; 2];

pub(super) fn minus(a: Spot, b: Spot) -> Spot {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn plus(a: Spot, b: Spot) -> Spot {
    [a[0] + b[0], a[1] + b[1]]
}

pub(super) fn cross(a: Spot, b: Spot) -> i128 {
    a[0] as i128 * b[1] as i128 - a[1] as i128 * b[0] as i128
}

/// `p` turned counter-clockwise by quarters.
pub(super) fn turned(p: Spot, turns: u8) -> Spot {
    match turns % 4 {
        0 => p,
        1 => [-p[1], p[0]],
        2 => [-p[0], -p[1]],
        _ => [p[1], -p[0]],
    }
}

/// True on the integer points of the map.
pub(super) fn is_whole(p: Spot) -> bool {
    p[0] % UNIT == 0 && p[1] % UNIT == 0
}

/// A change from one chart to another: first turned, then moved.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Change {
    pub turns: u8,
    pub shift: Spot,
}

impl Change {
    pub fn of(self, p: Spot) -> Spot {
        plus(turned(p, self.turns), self.shift)
    }

    pub fn then(self, other: Change) -> Change {
        Change { turns: (self.turns + other.turns) % 4, shift: other.of(self.shift) }
    }

    pub fn inverse(self) -> Change {
        let turns = (4 - self.turns) % 4;
        Change { turns, shift: turned([-self.shift[0], -self.shift[1]], turns) }
    }
}

/// Where a vertex may go in the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Freedom {
    Free,
    /// Along its line.
    Slides,
    /// A cone, or a corner, junction or end of lines.
    Stays,
}

/// The map.
pub(super) struct Lattice<'a> {
    pub mesh: &'a TriMesh,
    pub adjacency: &'a Adjacency,
    /// For each half-edge whether it is on a line or on the boundary.
    pub line: Vec<bool>,
    pub uv: Vec<[Spot; 3]>,
    /// For each half-edge the change from its triangle's chart to that of the opposite half-edge.
    pub change: Vec<Change>,
    pub freedom: Vec<Freedom>,
}

impl<'a> Lattice<'a> {
    pub fn new(
        mesh: &'a TriMesh,
        adjacency: &'a Adjacency,
        lines: &[bool],
        map: &SeamlessMap,
    ) -> Result<Lattice<'a>, EmbedError> {
        let area = |t: &[DVec2; 3]| (t[1] - t[0]).perp_dot(t[2] - t[0]);
        // Angles around vertices mean nothing where triangles are turned over.
        if let Some(f) = map.uv.iter().position(|t| area(t).is_nan() || area(t) <= 0.0) {
            return Err(EmbedError::Flipped { face: f as u32 });
        }
        let line = (0..lines.len()).map(|h| match adjacency.opposite[h] {
            NONE => true,
            o => lines[h] || lines[o as usize],
        });
        let mut lattice = Lattice {
            mesh,
            adjacency,
            line: line.collect(),
            uv: vec![[[0; 2]; 3]; map.uv.len()],
            change: changes(adjacency, map)?,
            freedom: vec![Freedom::Free; mesh.points.len()],
        };
        for v in (0..mesh.points.len() as u32).filter(|&v| adjacency.outgoing[v as usize] != NONE) {
            lattice.freedom[v as usize] = freedom(&lattice, map, v);
            let lined = adjacency.fan(v).any(|h| lattice.line[h as usize]);
            let turns = lattice.corners(v).1.map(|around| around.turns);
            if lattice.freedom[v as usize] == Freedom::Stays && !lined && turns == Some(0) {
                return Err(EmbedError::Wound { vertex: v });
            }
            lattice.snap(map, v)?;
        }
        match (0..map.uv.len()).find(|&f| !lattice.is_upright(lattice.uv[f])) {
            Some(f) => Err(EmbedError::Flipped { face: f as u32 }),
            None => Ok(lattice),
        }
    }

    /// Place of the vertex at the start of a half-edge in its triangle's chart.
    pub fn at(&self, h: u32) -> Spot {
        self.uv[h as usize / 3][h as usize % 3]
    }

    pub fn is_upright(&self, [a, b, c]: [Spot; 3]) -> bool {
        cross(minus(b, a), minus(c, a)) > 0
    }

    /// The corners around a vertex, with the change from the chart of the first to each, and that around to the first
    /// again.
    pub fn corners(&self, v: u32) -> (Vec<(u32, Change)>, Option<Change>) {
        let mut change = Change::default();
        let mut corners = Vec::new();
        for h in self.adjacency.fan(v) {
            corners.push((h, change));
            change = change.then(self.change[previous(h) as usize]);
        }
        (corners, (!self.adjacency.is_boundary_vertex(v)).then_some(change))
    }

    /// Puts a vertex on the lattice, on integers as far as lines, cones and corners ask for it.
    fn snap(&mut self, map: &SeamlessMap, v: u32) -> Result<(), EmbedError> {
        let (corners, around) = self.corners(v);
        let h = corners[0].0;
        let place = map.uv[h as usize / 3][h as usize % 3];
        let mut whole = [self.freedom[v as usize] == Freedom::Stays; 2];
        let mut bind = |e: u32, change: Change| {
            // Of a line along the first axis the second number is whole.
            let along = edge(map, e);
            let axis = (along.x.abs() > along.y.abs()) as usize;
            whole[(axis + change.turns as usize) % 2] |= self.line[e as usize];
        };
        for &(h, change) in &corners {
            bind(h, change);
            bind(previous(h), change);
        }
        let place = [0, 1].map(|i| {
            let x = place[i];
            let near = (x - x.round()).abs() < NEARLY_WHOLE;
            (!whole[i] || near)
                .then(|| if whole[i] { x.round() as i64 * UNIT } else { (x * UNIT as f64).round() as i64 })
        });
        let [Some(x), Some(y)] = place else { return Err(EmbedError::NotWhole { vertex: v }) };
        if around.is_some_and(|around| around.of([x, y]) != [x, y]) {
            return Err(EmbedError::NotWhole { vertex: v });
        }
        for (h, change) in corners {
            self.uv[h as usize / 3][h as usize % 3] = change.of([x, y]);
        }
        Ok(())
    }

    /// The places of the vertex of corner `h` in all its triangles if it were at `p` there; `None` unless all triangles
    /// stay upright and it stays on its line.
    fn moved(&self, h: u32, p: Spot) -> Option<Vec<(u32, Spot)>> {
        let v = self.mesh.origin(h);
        let (corners, _) = self.corners(v);
        let back = corners.iter().find(|c| c.0 == h)?.1.inverse();
        let first = back.of(p);
        let mut places = Vec::with_capacity(corners.len());
        for (h, change) in corners {
            let (own, p) = (self.at(h), change.of(first));
            let (ahead, behind) = (self.at(next(h)), self.at(previous(h)));
            let by = minus(p, own);
            let off = |e: u32, along: Spot| self.line[e as usize] && cross(along, by) != 0;
            if off(h, minus(ahead, own)) || off(previous(h), minus(behind, own)) || !self.is_upright([p, ahead, behind])
            {
                return None;
            }
            places.push((h, p));
        }
        Some(places)
    }

    fn put(&mut self, places: Vec<(u32, Spot)>) {
        places.into_iter().for_each(|(h, p)| self.uv[h as usize / 3][h as usize % 3] = p);
    }

    /// Moves vertices in the map until every integer point has one.
    pub fn occupy(&mut self) -> Result<(), EmbedError> {
        let mut taken: Vec<bool> = vec![false; self.mesh.points.len()];
        for h in 0..self.change.len() as u32 {
            taken[self.mesh.origin(h) as usize] |= is_whole(self.at(h));
        }
        for lines_only in [true, false] {
            let mut room = false;
            loop {
                let (mut made, mut left) = (0, Vec::new());
                for f in 0..self.uv.len() as u32 {
                    for p in self.vacant(f, lines_only) {
                        match self.occupy_one(f, p, &mut taken, room) {
                            true => made += 1,
                            false => left.push(f),
                        }
                    }
                }
                match made {
                    0 if left.is_empty() => break,
                    0 if room => {
                        left.dedup();
                        return Err(EmbedError::Crowded { faces: left });
                    }
                    0 => room = true,
                    _ => {}
                }
            }
        }
        Ok(())
    }

    /// The integer points of a triangle where it has no vertex; those on an edge belong to one of its two triangles.
    fn vacant(&self, f: u32, lines_only: bool) -> Vec<Spot> {
        let corners = self.uv[f as usize];
        let range = |i: usize| {
            let x = corners.map(|p| p[i]);
            let (low, high) = (x.iter().min().copied().unwrap_or(0), x.iter().max().copied().unwrap_or(0));
            -(-low).div_euclid(UNIT)..=high.div_euclid(UNIT)
        };
        let mut found = Vec::new();
        for (i, j) in range(0).flat_map(|i| range(1).map(move |j| (i, j))) {
            let p = [i * UNIT, j * UNIT];
            let side = |k: usize| cross(minus(corners[(k + 1) % 3], corners[k]), minus(p, corners[k]));
            let sides = [0, 1, 2].map(side);
            if corners.contains(&p) || sides.iter().any(|&s| s < 0) {
                continue;
            }
            let on = (0..3).find(|&k| sides[k] == 0).map(|k| 3 * f + k as u32);
            let own = on.is_none_or(|h| self.adjacency.opposite[h as usize] > h);
            if own && (!lines_only || on.is_some_and(|h| self.line[h as usize])) {
                found.push(p);
            }
        }
        found
    }

    /// Brings a vertex to the integer point `p` of triangle `f`: the nearest that may go there. True if `p` needs none
    /// any more. With `room` its neighbours are spread evenly if that helps.
    fn occupy_one(&mut self, f: u32, p: Spot, taken: &mut [bool], room: bool) -> bool {
        let corners = self.uv[f as usize];
        let side = |k: usize| cross(minus(corners[(k + 1) % 3], corners[k]), minus(p, corners[k]));
        if corners.contains(&p) || (0..3).any(|k| side(k) < 0) {
            return true; // another move has changed the triangle: the next pass finds the point again
        }
        for round in 0..if room { ROOM_ROUNDS } else { 1 } {
            if round > 0 {
                self.spread(f, taken);
            }
            // The point may have passed to another triangle meanwhile.
            let Some((f, p)) = self.holder(f, p) else { return false };
            let mut corners: Vec<(u32, Spot)> = (3 * f..3 * f + 3).map(|h| (h, p)).collect();
            for h in 3 * f..3 * f + 3 {
                let o = self.adjacency.opposite[h as usize];
                if o != NONE && cross(minus(self.at(next(h)), self.at(h)), minus(p, self.at(h))) == 0 {
                    corners.push((previous(o), self.change[h as usize].of(p)));
                }
            }
            let distance = |&(h, p): &(u32, Spot)| {
                let [x, y] = minus(self.at(h), p).map(|x| x as i128);
                (x * x + y * y, h)
            };
            corners.sort_by_key(distance);
            for (h, p) in corners {
                let v = self.mesh.origin(h) as usize;
                if taken[v] || self.freedom[v] == Freedom::Stays {
                    continue;
                }
                if let Some(places) = self.moved(h, p) {
                    self.put(places);
                    taken[v] = true;
                    return true;
                }
            }
        }
        false
    }

    /// The triangle that holds point `p` of the chart of `f`, and the point in its chart.
    fn holder(&self, f: u32, p: Spot) -> Option<(u32, Spot)> {
        let (mut f, mut p) = (f, p);
        for _ in 0..self.uv.len() {
            let outside = |&h: &u32| cross(minus(self.at(next(h)), self.at(h)), minus(p, self.at(h))) < 0;
            let Some(h) = (3 * f..3 * f + 3).find(outside) else { return Some((f, p)) };
            if self.adjacency.opposite[h as usize] == NONE {
                return None;
            }
            p = self.change[h as usize].of(p);
            f = self.adjacency.opposite[h as usize] / 3;
        }
        None
    }

    /// Moves the vertices around triangle `f` that are not taken to the middle of their neighbours in the map.
    fn spread(&mut self, f: u32, taken: &[bool]) {
        let mut near: Vec<u32> = self.mesh.triangles[f as usize].to_vec();
        let mut from = 0;
        for _ in 0..ROOM_RINGS {
            let to = near.len();
            for i in from..to {
                for h in self.adjacency.fan(near[i]) {
                    for w in [next(h), previous(h)].map(|g| self.mesh.origin(g)) {
                        if !near.contains(&w) {
                            near.push(w);
                        }
                    }
                }
            }
            from = to;
        }
        for v in near {
            let (corners, _) = self.corners(v);
            let first = corners[0].0;
            let own = self.at(first);
            let (mut sum, mut count) = ([0; 2], 0);
            let mut step = |h: u32, e: u32, change: Change| {
                let by = turned(minus(self.at(h), self.at(e)), (4 - change.turns) % 4);
                sum = plus(sum, by);
                count += 1;
            };
            match self.freedom[v as usize] {
                _ if taken[v as usize] => continue,
                Freedom::Stays => continue,
                Freedom::Free => corners.iter().for_each(|&(h, change)| step(next(h), h, change)),
                Freedom::Slides => {
                    for &(h, change) in &corners {
                        if self.line[h as usize] {
                            step(next(h), h, change);
                        }
                        if self.line[previous(h) as usize] && self.adjacency.opposite[previous(h) as usize] == NONE {
                            step(previous(h), h, change);
                        }
                    }
                }
            }
            let p = plus(own, sum.map(|s| s / count.max(1)));
            if !is_whole(p)
                && let Some(places) = self.moved(first, p)
            {
                self.put(places);
            }
        }
    }
}

/// The edge vector of a half-edge in its triangle's chart.
fn edge(map: &SeamlessMap, h: u32) -> DVec2 {
    let corners = map.uv[h as usize / 3];
    corners[(h as usize % 3 + 1) % 3] - corners[h as usize % 3]
}

/// The changes between charts: the map says how they are turned and, but for rounding, how far moved.
fn changes(adjacency: &Adjacency, map: &SeamlessMap) -> Result<Vec<Change>, EmbedError> {
    let at = |h: u32| map.uv[h as usize / 3][h as usize % 3];
    let mut change = vec![Change::default(); map.jump.len()];
    for h in 0..map.jump.len() as u32 {
        let o = adjacency.opposite[h as usize];
        if o == NONE || o < h {
            continue;
        }
        let turns = map.jump[h as usize] % 4;
        let ends = [(h, next(o)), (next(h), o)].map(|(own, other)| at(other) - quarter_turn(at(own), turns));
        let whole = ends[0].round();
        if ends.iter().any(|e| (*e - whole).abs().max_element() > NEARLY_WHOLE) {
            return Err(EmbedError::Torn { half_edge: h });
        }
        change[h as usize] = Change { turns, shift: [whole.x as i64 * UNIT, whole.y as i64 * UNIT] };
        change[o as usize] = change[h as usize].inverse();
    }
    Ok(change)
}

/// Where a vertex may go, by the angles of the map around it: half a turn on each side of a line, else a whole one.
fn freedom(lattice: &Lattice, map: &SeamlessMap, v: u32) -> Freedom {
    let fan: Vec<u32> = lattice.adjacency.fan(v).collect();
    let angle = |h: u32| edge(map, h).angle_to(-edge(map, previous(h)));
    let Some(start) = fan.iter().position(|&h| lattice.line[h as usize]) else {
        let whole = fan.iter().map(|&h| angle(h)).sum::<f64>();
        return if (whole - TAU).abs() < 0.1 { Freedom::Free } else { Freedom::Stays };
    };
    let (mut sectors, mut flat, mut sum) = (0, 0, 0.0);
    for i in 0..fan.len() {
        let h = fan[(start + i) % fan.len()];
        sum += angle(h);
        if lattice.line[previous(h) as usize] {
            sectors += 1;
            flat += ((sum - PI).abs() < 0.1) as u32;
            sum = 0.0;
        }
    }
    let sides = if lattice.adjacency.is_boundary_vertex(v) { 1 } else { 2 };
    if sectors == sides && flat == sides { Freedom::Slides } else { Freedom::Stays }
}
