//! A flat surface in pieces: triangles with a chart each, glued along edges by quarter turns.
//!
//! The same as an intrinsic triangulation (Fisher, Springborn, Schröder, Bobenko 2006, *An Algorithm for the Construction
//! of Intrinsic Delaunay Triangulations*): an edge may run from a vertex to itself and two vertices may have many edges in
//! common, so a mesh can be thinned out to its cones whatever they are. Places are kept as edge vectors, which no shift of
//! a chart touches.

use crate::geom::is_positive;
use crate::geom::predicates::orient2d;
use crate::layout::map::{SeamlessMap, quarter_turn};
use crate::mesh::{Adjacency, NONE, TriMesh, next, previous};
use glam::DVec2;

/// A point of the surface that is carried along while triangles change: one inside each triangle of the input.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mark {
    /// Triangle of the input.
    pub face: u32,
    /// Place, from the first corner of the triangle that holds it, in its chart.
    pub at: DVec2,
    /// Quarter turns from the chart of `face` to the chart of the triangle that holds it.
    pub turns: u8,
}

/// The two triangles at the other diagonal of [`Flat::pair`], in corners of its outline.
pub(super) const FLIPPED: [[usize; 3]; 2] = [[0, 1, 3], [1, 2, 3]];

/// Triangles, half-edges `3 t + k` as everywhere; a triangle that is gone has `origin` [`NONE`].
#[derive(Clone)]
pub(super) struct Flat {
    /// Vertex at the start of each half-edge.
    pub origin: Vec<u32>,
    /// Opposite half-edge, [`NONE`] on the boundary.
    pub opposite: Vec<u32>,
    /// Vector of each half-edge in the chart of its triangle.
    pub edge: Vec<DVec2>,
    /// Quarter turns from the chart of each half-edge's triangle to that of its opposite.
    pub jump: Vec<u8>,
    /// Whether each half-edge lies on a line; boundaries do.
    pub line: Vec<bool>,
    /// A half-edge that leaves each vertex, [`NONE`] where the vertex is gone.
    pub outgoing: Vec<u32>,
    /// What lies in each triangle.
    pub marks: Vec<Vec<Mark>>,
}

/// A disk of triangles laid out in one chart.
pub(super) struct Patch {
    /// The triangles.
    pub triangles: Vec<u32>,
    /// Where the first corner of each triangle lies.
    pub base: Vec<DVec2>,
    /// Corners of its outline, counter-clockwise: vertex and place.
    pub names: Vec<u32>,
    pub places: Vec<DVec2>,
    /// For each corner the half-edge of the outline that leaves it; [`NONE`] if that is not there yet.
    pub outline: Vec<u32>,
}

impl Flat {
    /// The surface of a map.
    pub fn new(mesh: &TriMesh, adjacency: &Adjacency, map: &SeamlessMap, lines: &[bool]) -> Flat {
        let count = 3 * mesh.triangles.len();
        let edge = |h: usize| map.uv[h / 3][(h % 3 + 1) % 3] - map.uv[h / 3][h % 3];
        let mark = |t: usize| {
            let [a, b, c] = map.uv[t];
            // Weights that keep numbers with few digits exact, unlike thirds.
            vec![Mark { face: t as u32, at: (b - a) * 0.25 + (c - a) * 0.5, turns: 0 }]
        };
        let is_line = |h: usize| match adjacency.opposite[h] {
            NONE => true,
            o => lines.get(h) == Some(&true) || lines.get(o as usize) == Some(&true),
        };
        Flat {
            origin: mesh.triangles.iter().flatten().copied().collect(),
            opposite: adjacency.opposite.clone(),
            edge: (0..count).map(edge).collect(),
            jump: map.jump.clone(),
            line: (0..count).map(is_line).collect(),
            outgoing: adjacency.outgoing.clone(),
            marks: (0..mesh.triangles.len()).map(mark).collect(),
        }
    }

    /// Number of triangles, those that are gone included.
    pub fn len(&self) -> usize {
        self.marks.len()
    }

    /// Corners of a triangle in its chart, the first at the origin.
    pub fn corners(&self, t: usize) -> [DVec2; 3] {
        [DVec2::ZERO, self.edge[3 * t], -self.edge[3 * t + 2]]
    }

    /// Half-edges that leave a vertex, counter-clockwise; on the boundary from the one without a triangle before it.
    pub fn fan(&self, v: u32) -> Vec<u32> {
        let start = self.outgoing[v as usize];
        if start == NONE {
            return Vec::new();
        }
        let mut first = start;
        while self.opposite[first as usize] != NONE {
            first = next(self.opposite[first as usize]);
            if first == start {
                break;
            }
        }
        let mut fan = vec![first];
        loop {
            let turned = self.opposite[previous(fan[fan.len() - 1]) as usize];
            if turned == NONE || turned == first {
                return fan;
            }
            fan.push(turned);
        }
    }

    /// Turns the chart of a triangle by quarters.
    fn turn(&mut self, t: u32, turns: u8) {
        if turns.is_multiple_of(4) {
            return;
        }
        for h in 3 * t..3 * t + 3 {
            self.edge[h as usize] = quarter_turn(self.edge[h as usize], turns);
            self.jump[h as usize] = (self.jump[h as usize] + 4 - turns % 4) % 4;
            let o = self.opposite[h as usize];
            if o != NONE {
                self.jump[o as usize] = (self.jump[o as usize] + turns) % 4;
            } else {
                self.jump[h as usize] = 0;
            }
        }
        for mark in &mut self.marks[t as usize] {
            mark.at = quarter_turn(mark.at, turns);
            mark.turns = (mark.turns + turns) % 4;
        }
    }

    /// Turns the chart beyond a half-edge so that the jump across it is 0.
    fn straighten(&mut self, h: u32) {
        let o = self.opposite[h as usize];
        self.turn(o / 3, (4 - self.jump[h as usize]) % 4);
    }

    /// The triangles around a vertex in one chart with the vertex at the origin; `None` if they are no disk with the
    /// vertex inside, or on its boundary.
    /// * `fan` - half-edges that leave the vertex, counter-clockwise
    pub fn star(&mut self, fan: &[u32]) -> Option<Patch> {
        let v = self.origin[*fan.first()? as usize];
        let loops = |&h: &u32| self.origin[next(h) as usize] == v || self.origin[previous(h) as usize] == v;
        if fan.iter().any(loops) {
            return None;
        }
        for &h in &fan[..fan.len() - 1] {
            self.straighten(previous(h));
        }
        let last = previous(fan[fan.len() - 1]);
        let mut patch = Patch {
            triangles: fan.iter().map(|h| h / 3).collect(),
            base: fan.iter().map(|&h| self.base_of(h, DVec2::ZERO)).collect(),
            names: fan.iter().map(|&h| self.origin[next(h) as usize]).collect(),
            places: fan.iter().map(|&h| self.edge[h as usize]).collect(),
            outline: fan.iter().map(|&h| next(h)).collect(),
        };
        if self.opposite[last as usize] == NONE {
            patch.names.push(self.origin[last as usize]);
            patch.places.push(-self.edge[last as usize]);
            patch.outline.push(NONE);
        }
        Some(patch)
    }

    /// The two triangles at a half-edge in one chart; `None` if there are not two.
    pub fn pair(&mut self, h: u32) -> Option<Patch> {
        let o = self.opposite[h as usize];
        if o == NONE || o / 3 == h / 3 {
            return None;
        }
        self.straighten(h);
        let outline = vec![next(h), previous(h), next(o), previous(o)];
        let b = self.edge[h as usize];
        let c = b + self.edge[next(h) as usize];
        let d = self.edge[next(o) as usize];
        Some(Patch {
            triangles: vec![h / 3, o / 3],
            base: vec![self.base_of(h, DVec2::ZERO), self.base_of(o, b)],
            names: outline.iter().map(|&h| self.origin[h as usize]).collect(),
            places: vec![b, c, DVec2::ZERO, d],
            outline,
        })
    }

    /// Where the first corner of a triangle lies if half-edge `h` of it begins at `place`.
    fn base_of(&self, h: u32, place: DVec2) -> DVec2 {
        place - self.corners(h as usize / 3)[h as usize % 3]
    }

    /// Puts other triangles in the place of those of a patch.
    /// * `triangles` - corners of the outline, counter-clockwise; no more of them than there were
    /// * `line` - an edge between two corners that lies on a line
    pub fn replace(&mut self, patch: &Patch, triangles: &[[usize; 3]], line: Option<[usize; 2]>) {
        let marks = self.lift_marks(patch);
        let count = patch.places.len();
        let saved: Vec<(u32, u8, bool)> = patch.outline.iter().map(|&h| self.beyond(h)).collect();
        // What an edge between two corners has become.
        let mut made: Vec<([usize; 2], u32)> = Vec::with_capacity(3 * triangles.len());
        for (&t, corners) in patch.triangles.iter().zip(triangles) {
            for k in 0..3 {
                let (h, [i, j]) = (3 * t + k as u32, [corners[k], corners[(k + 1) % 3]]);
                self.origin[h as usize] = patch.names[i];
                self.edge[h as usize] = patch.places[j] - patch.places[i];
                self.outgoing[patch.names[i] as usize] = h;
                made.push(([i, j], h));
            }
        }
        let find = |ends: [usize; 2]| made.iter().find(|m| m.0 == ends).map_or(NONE, |m| m.1);
        for &([i, j], h) in &made {
            let outer = j == (i + 1) % count && patch.outline[i] != NONE;
            let (opposite, jump, on_line) = if outer {
                let (o, jump, on_line) = saved[i];
                // An outline may be glued to itself.
                let own = patch.outline.iter().position(|&g| g == o && o != NONE);
                (own.map_or(o, |n| find([n, (n + 1) % count])), jump, on_line)
            } else {
                let o = find([j, i]);
                (o, 0, o == NONE || line.is_some_and(|l| l == [i, j] || l == [j, i]))
            };
            (self.opposite[h as usize], self.jump[h as usize], self.line[h as usize]) = (opposite, jump, on_line);
            if opposite != NONE {
                self.opposite[opposite as usize] = h;
            }
        }
        for &t in &patch.triangles[triangles.len()..] {
            self.origin[3 * t as usize..3 * t as usize + 3].fill(NONE);
        }
        self.drop_marks(marks, patch, triangles);
    }

    /// Opposite, jump and line of a half-edge.
    fn beyond(&self, h: u32) -> (u32, u8, bool) {
        match h {
            NONE => (NONE, 0, true),
            h => (self.opposite[h as usize], self.jump[h as usize], self.line[h as usize]),
        }
    }

    /// Takes the marks out of a patch, in its chart.
    fn lift_marks(&mut self, patch: &Patch) -> Vec<Mark> {
        let mut lifted = Vec::new();
        for (&t, &base) in patch.triangles.iter().zip(&patch.base) {
            lifted.extend(self.marks[t as usize].drain(..).map(|m| Mark { at: base + m.at, ..m }));
        }
        lifted
    }

    /// Puts marks into the new triangles of a patch.
    fn drop_marks(&mut self, marks: Vec<Mark>, patch: &Patch, triangles: &[[usize; 3]]) {
        for mark in marks {
            // The triangle of which the place is least outside; on an edge the first of the two.
            let depth = |corners: &[usize; 3]| {
                let p = corners.map(|i| patch.places[i]);
                (0..3).map(|k| orient2d(p[k], p[(k + 1) % 3], mark.at)).fold(f64::INFINITY, f64::min)
            };
            let mut best = (f64::NEG_INFINITY, 0);
            for (n, corners) in triangles.iter().enumerate() {
                let deep = depth(corners);
                if deep > best.0 {
                    best = (deep, n);
                }
                if deep >= 0.0 {
                    break;
                }
            }
            let (t, first) = (patch.triangles[best.1], triangles[best.1][0]);
            self.marks[t as usize].push(Mark { at: mark.at - patch.places[first], ..mark });
        }
    }

    /// The surface with only the triangles that are there, in their order.
    pub fn compact(self) -> Flat {
        let alive: Vec<usize> = (0..self.len()).filter(|&t| self.origin[3 * t] != NONE).collect();
        let mut slot = vec![NONE; self.len()];
        for (n, &t) in alive.iter().enumerate() {
            slot[t] = n as u32;
        }
        let renamed = |h: u32| if h == NONE { NONE } else { 3 * slot[h as usize / 3] + h % 3 };
        let halves: Vec<usize> = alive.iter().flat_map(|t| 3 * t..3 * t + 3).collect();
        let mut marks = self.marks;
        Flat {
            origin: halves.iter().map(|&h| self.origin[h]).collect(),
            opposite: halves.iter().map(|&h| renamed(self.opposite[h])).collect(),
            edge: halves.iter().map(|&h| self.edge[h]).collect(),
            jump: halves.iter().map(|&h| self.jump[h]).collect(),
            line: halves.iter().map(|&h| self.line[h]).collect(),
            outgoing: self.outgoing.iter().map(|&h| renamed(h)).collect(),
            marks: alive.iter().map(|&t| std::mem::take(&mut marks[t])).collect(),
        }
    }
}

/// Area against the square of the longest edge; 0 if not counter-clockwise.
pub(super) fn quality([a, b, c]: [DVec2; 3]) -> f64 {
    let twice = orient2d(a, b, c);
    if !is_positive(twice) {
        return 0.0;
    }
    0.5 * twice / (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared())
}
