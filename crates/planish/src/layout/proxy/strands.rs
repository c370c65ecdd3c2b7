//! Arcs on a mesh that loses and regains vertices.
//!
//! Taking a vertex out of a mesh changes the faces of one polygon only, and so does putting it back. What runs
//! through the polygon is drawn again in its other faces. Where it enters and leaves and on which side it passes the
//! vertex decides which edges it meets and in which order, so nothing ever crosses, whatever the rounding.
//!
//! See `docs/methods/layout.md`, step 5.

use crate::geom::predicates::orient2d;
use crate::layout::complex::Complex;
use crate::layout::recut::keep_apart;
use crate::mesh::{Adjacency, NONE, TriMesh, next};
use crate::network::imprint::{Place, Shared, canonical, half_edge, shared_face};
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

/// What meets one edge of a polygon keeps at least this distance from its ends and from each other, as a fraction of
/// the edge (less where many meet it).
const MEETINGS_APART: f64 = 0.05;

/// Angle at a vertex between a neighbour at the same place and the next one, radians: some positive number.
const NO_ANGLE: f64 = 1e-3;

/// A vertex and the faces around it, counter-clockwise: `faces[i]` has the corners `vertex, ring[i], ring[i + 1]`.
/// Without the vertex the polygon is a fan from `ring[0]`: `faces[i]` has the corners `ring[0], ring[i], ring[i + 1]`,
/// the first and the last are gone.
///
/// A vertex of a line or of the boundary goes to one of its two neighbours there. The other one is `ring[m]`, and the
/// edge between them takes the place of the line. On the boundary one of the two sectors is outside the mesh: one step of
/// the ring, whose face is [`NONE`].
#[derive(Clone, Debug)]
pub(in crate::layout) struct Star {
    pub vertex: u32,
    pub ring: Vec<u32>,
    pub faces: Vec<u32>,
    /// The number `m` for a vertex of a line.
    pub line: Option<usize>,
}

/// A change of the mesh that runs can be carried back over.
#[derive(Clone, Debug)]
pub(in crate::layout) enum Step {
    /// A vertex was taken out.
    Out(Star),
    /// The diagonal of four vertices, counter-clockwise, was turned from the first and third to the second and fourth.
    /// Before, the first face had the corners 0, 1, 2 and the second 2, 3, 0; since then 1, 2, 3 and 3, 0, 1.
    Turn([u32; 4], [u32; 2]),
}

impl Star {
    /// The ring in the plane around the vertex at the origin: lengths are kept, and angles but for one factor, on each
    /// side of a line its own, so that the line is straight.
    pub fn flat(&self, points: &[DVec3]) -> Vec<DVec2> {
        let at = |i: usize| points[self.ring[i] as usize] - points[self.vertex as usize];
        let n = self.ring.len();
        let mut angles: Vec<f64> = (0..n).map(|i| at(i).angle_between(at((i + 1) % n))).collect();
        // A neighbour at the same place has no direction.
        angles.iter_mut().filter(|a| a.is_nan()).for_each(|a| *a = NO_ANGLE);
        let (sides, turn) = match self.line {
            Some(m) => (vec![0..m, m..n], std::f64::consts::PI),
            None => (vec![0..n; 1], std::f64::consts::TAU),
        };
        for side in sides {
            let scale = turn / angles[side.clone()].iter().sum::<f64>();
            angles[side].iter_mut().for_each(|a| *a *= scale);
        }
        let mut turned = 0.0;
        let place = |i: usize| {
            let place = DVec2::from_angle(turned) * at(i).length();
            turned += angles[i];
            place
        };
        (0..n).map(place).collect()
    }

    /// True if these places on the ring, in rising order, are the ends of the line that goes through the vertex.
    fn is_line(&self, ends: [f64; 2]) -> bool {
        self.line.is_some_and(|m| ends == [0.0, m as f64])
    }

    /// The faces of the fan.
    pub fn fan(&self) -> &[u32] {
        &self.faces[1..self.faces.len() - 1]
    }

    /// Where a spot lies on the ring: the number of the vertex before it and the part of the way to the next.
    fn along(&self, spot: Spot) -> Option<f64> {
        match spot {
            Spot::Vertex(v) => self.ring.iter().position(|&r| r == v).map(|i| i as f64),
            Spot::Edge(a, b, t) => {
                let i = self.ring.iter().position(|&r| r == a)?;
                let n = self.ring.len();
                if self.ring[(i + 1) % n] == b {
                    Some(i as f64 + t)
                } else {
                    (self.ring[(i + n - 1) % n] == b).then(|| ((i + n - 1) % n + 1) as f64 - t)
                }
            }
        }
    }

    /// The edge of the ring that both places lie on, if any; the first is the lower.
    fn edge_of(&self, [a, b]: [f64; 2]) -> Option<usize> {
        let last = self.ring.len() - 1;
        match () {
            _ if b <= a.floor() + 1.0 => Some(a as usize),
            _ if a == 0.0 && b >= last as f64 => Some(last),
            _ => None,
        }
    }
}

/// Two triangles 0, 1, 2 and 2, 3, 0 laid in the plane: the first corner at the origin, the third on the first axis.
pub(in crate::layout) fn unfolded([a, b, c, d]: [DVec3; 4]) -> [DVec2; 4] {
    let axis = (c - a).normalize_or_zero();
    let beside = |p: DVec3, sign: f64| {
        let along = (p - a).dot(axis);
        DVec2::new(along, sign * (p - a - along * axis).length())
    };
    [DVec2::ZERO, beside(b, -1.0), DVec2::new(a.distance(c), 0.0), beside(d, 1.0)]
}

/// Where a strand is tied down.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Spot {
    Vertex(u32),
    /// On the edge between two vertices, this part of the way from the first.
    Edge(u32, u32, f64),
}

#[derive(Clone, Copy, Debug)]
struct Knot {
    at: Spot,
    before: u32,
    next: u32,
    /// The face that the link to the next knot runs through or along.
    face: u32,
}

/// A way through a polygon, from the lower place on the ring to the higher one.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// Knots at its ends.
    knots: [u32; 2],
    ends: [f64; 2],
    /// The strand runs the other way.
    reversed: bool,
}

/// A new way through the polygon: edges from the apex met one after the other, by the corners of the ring where they
/// end, each with the distances along the ring from there back and on to the ends of the way; and the faces between.
struct Way {
    met: Vec<(usize, [f64; 2])>,
    faces: Vec<u32>,
}

/// Arcs as strands of knots, linked through single faces.
#[derive(Clone, Debug)]
pub(in crate::layout) struct Strands {
    knots: Vec<Knot>,
    /// First knot of every arc.
    first: Vec<u32>,
    /// Links in every face, by the knots where they start.
    links: Vec<Vec<u32>>,
}

impl Strands {
    /// The arcs of `complex` on `mesh`, whose vertices and faces have the lasting names `vertex` and `face`, the latter
    /// below `faces`. `None` if a place lies inside a face.
    pub fn new(
        (mesh, adjacency): (&TriMesh, &Adjacency),
        complex: &Complex,
        (vertex, face): (&[u32], &[u32]),
        faces: usize,
    ) -> Option<Strands> {
        let mut strands = Strands { knots: Vec::new(), first: Vec::new(), links: vec![Vec::new(); faces] };
        for arc in &complex.arcs {
            let start = strands.knots.len() as u32;
            strands.first.push(if arc.is_some() { start } else { NONE });
            let Some(arc) = arc else { continue };
            for place in &arc.chain {
                let at = match *place {
                    Place::Vertex(v) => Spot::Vertex(vertex[v as usize]),
                    Place::Edge(h, t) => {
                        let ends = [mesh.origin(h), mesh.origin(next(h))].map(|v| vertex[v as usize]);
                        Spot::Edge(ends[0], ends[1], t)
                    }
                    Place::Face(_) => return None,
                };
                strands.knots.push(Knot { at, before: NONE, next: NONE, face: NONE });
            }
            for (k, pair) in (start..).zip(arc.chain.windows(2)) {
                let through = match shared_face(adjacency, &mesh.triangles, &pair[0], &pair[1])? {
                    Shared::Face(f) => f,
                    Shared::Edge => crate::layout::common_face(adjacency, &mesh.triangles, pair),
                };
                strands.link(k, k + 1, face[through as usize]);
            }
        }
        Some(strands)
    }

    /// Gives the arcs of `complex` their places on `mesh`, where the vertices with the lasting names have the numbers
    /// `number`. `None` if a strand runs where the mesh has no edge.
    pub fn put(
        &self,
        (mesh, adjacency): (&TriMesh, &Adjacency),
        number: impl Fn(u32) -> u32,
        complex: &mut Complex,
    ) -> Option<()> {
        for (arc, &first) in complex.arcs.iter_mut().zip(&self.first) {
            let Some(arc) = arc else { continue };
            arc.chain.clear();
            let mut k = first;
            while k != NONE {
                let knot = &self.knots[k as usize];
                arc.chain.push(match knot.at {
                    Spot::Vertex(v) => Place::Vertex(number(v)),
                    Spot::Edge(a, b, t) => {
                        let (a, b) = (number(a), number(b));
                        match half_edge(&mesh.triangles, adjacency, a, b) {
                            Some(h) => canonical(adjacency, h, t),
                            None => canonical(adjacency, half_edge(&mesh.triangles, adjacency, b, a)?, 1.0 - t),
                        }
                    }
                });
                k = knot.next;
            }
        }
        Some(())
    }

    /// Draws what runs through a polygon in its fan.
    pub fn take_out(&mut self, star: &Star, points: &[DVec3]) {
        let runs = loop {
            let runs = self.runs(star, &star.faces);
            match runs.iter().find_map(|run| Some((run, star.edge_of(run.ends)?))) {
                Some((run, edge)) => self.pull(run, star.faces[edge]),
                None => break runs,
            }
        };
        let n = star.ring.len();
        let face = |i: usize| star.faces[i.clamp(1, n - 2)];
        self.hand_over(star, &star.faces, face);
        if runs.is_empty() {
            return;
        }
        let flat = star.flat(points);
        let way = |&Run { ends: [s, e], .. }: &Run| {
            if s == 0.0 {
                return Way { met: Vec::new(), faces: vec![face(e as usize)] }; // from the apex
            }
            let met = (2..n - 1).filter(|&m| s < m as f64 && (m as f64) < e);
            let met: Vec<_> = met.map(|m| (m, [m as f64 - s, e - m as f64])).collect();
            let faces = std::iter::once(s as usize).chain(met.iter().map(|x| x.0)).map(face).collect();
            Way { met, faces }
        };
        let ways = runs.iter().map(way).collect();
        self.draw(star, &runs, ways, (star.ring[0], flat[0]), &flat);
    }

    /// Draws what runs through a polygon in the faces around its vertex.
    pub fn put_in(&mut self, star: &Star, points: &[DVec3]) {
        let runs = self.runs(star, star.fan());
        self.hand_over(star, star.fan(), |i| star.faces[i]);
        if runs.is_empty() {
            return;
        }
        let n = star.ring.len() as i64;
        let flat = star.flat(points);
        let face = |i: i64| star.faces[i.rem_euclid(n) as usize];
        let way = |run: &Run| {
            let [s, e] = run.ends;
            if star.is_line(run.ends) {
                // Along the line, by faces that have its two edges.
                let faces = [[0, n - 1], [e as i64 - 1, e as i64]];
                let faces = faces.map(|[a, b]| if face(a) == NONE { face(b) } else { face(a) });
                Way { met: Vec::new(), faces: faces.to_vec() }
            } else if !self.goes_around(star, run, &flat) {
                let met = (s as i64 + 1..).take_while(|&m| (m as f64) < e);
                let met: Vec<_> = met.map(|m| (m as usize, [m as f64 - s, e - m as f64])).collect();
                let faces = std::iter::once(s as i64).chain(met.iter().map(|x| x.0 as i64)).map(face).collect();
                Way { met, faces }
            } else {
                let end = e - n as f64;
                let start = s.ceil() as i64 - 1;
                let passed: Vec<i64> = (end.floor() as i64 + 1..=start).rev().collect();
                let met = |&m: &i64| (m.rem_euclid(n) as usize, [m as f64 - end, s - m as f64]);
                let faces = std::iter::once(start).chain(passed.iter().map(|m| m - 1)).map(face).collect();
                Way { met: passed.iter().map(met).collect(), faces }
            }
        };
        let ways = runs.iter().map(way).collect();
        self.draw(star, &runs, ways, (star.vertex, DVec2::ZERO), &flat);
    }

    /// Takes back a change of the mesh.
    pub fn undo(&mut self, step: &Step, points: &[DVec3]) {
        let idle = |f: &u32| *f == NONE || self.links[*f as usize].is_empty();
        match step {
            Step::Out(star) if !star.fan().iter().all(idle) => self.put_in(star, points),
            Step::Turn(ring, faces) if !faces.iter().all(idle) => self.turn_back(ring, *faces, points),
            _ => {}
        }
    }

    /// Draws what runs through two faces on both sides of their other diagonal.
    fn turn_back(&mut self, ring: &[u32; 4], faces: [u32; 2], points: &[DVec3]) {
        let star = Star { vertex: NONE, ring: ring.to_vec(), faces: Vec::new(), line: None };
        let face = |x: f64| faces[(x >= 2.0) as usize];
        let runs = loop {
            let runs = self.runs(&star, &faces);
            match runs.iter().find_map(|run| Some((run, star.edge_of(run.ends)?))) {
                Some((run, edge)) => self.pull(run, face(edge as f64)),
                None => break runs,
            }
        };
        self.hand_over(&star, &faces, |i| face(i as f64));
        let way = |&Run { ends: [s, e], .. }: &Run| match () {
            _ if s == 0.0 => Way { met: Vec::new(), faces: vec![faces[(e > 2.0) as usize]] },
            _ if s < 2.0 && e > 2.0 => Way { met: vec![(2, [2.0 - s, e - 2.0])], faces: faces.to_vec() },
            _ => Way { met: Vec::new(), faces: vec![face(s)] },
        };
        let ways = runs.iter().map(way).collect();
        let flat = unfolded(ring.map(|v| points[v as usize]));
        self.draw(&star, &runs, ways, (ring[0], flat[0]), &flat);
    }

    /// True if the vertex lies between a run through the fan and the part of the ring from its lower to its higher end,
    /// so that the way to its higher end leads down around the vertex.
    fn goes_around(&self, star: &Star, run: &Run, flat: &[DVec2]) -> bool {
        let n = star.ring.len();
        let [s, e] = run.ends;
        let place = |x: f64| flat[x as usize].lerp(flat[(x as usize + 1) % n], x.fract());
        // What does not run along a line stays on its side of it.
        if let Some(m) = star.line {
            return s == 0.0 && e > m as f64;
        }
        if s == 0.0 {
            return orient2d(flat[0], place(e), DVec2::ZERO) < 0.0;
        }
        // The face of the fan that the vertex lies in, and its part of the ring.
        let home = (2..n - 1).find(|&m| orient2d(flat[0], flat[m], DVec2::ZERO) < 0.0).unwrap_or(n - 1) - 1;
        let low = if home == 1 { 0.0 } else { home as f64 };
        let high = if home == n - 2 { n as f64 } else { home as f64 + 1.0 };
        if e <= low || s >= high {
            return false;
        }
        let crossing = |m: usize| {
            let (mut k, last) = if run.reversed { (run.knots[1], run.knots[0]) } else { (run.knots[0], run.knots[1]) };
            let apex = star.ring[0];
            while k != last {
                k = self.knots[k as usize].next;
                match self.knots[k as usize].at {
                    Spot::Edge(a, b, t) if a == apex && b == star.ring[m] => return flat[0].lerp(flat[m], t),
                    Spot::Edge(a, b, t) if b == apex && a == star.ring[m] => return flat[m].lerp(flat[0], t),
                    _ => {}
                }
            }
            flat[0].midpoint(flat[m])
        };
        let from = if s >= low { place(s) } else { crossing(home) };
        let to = if e <= high { place(e) } else { crossing(home + 1) };
        orient2d(from, to, DVec2::ZERO) < 0.0
    }

    /// The ways through `faces` between places of the ring of `star`; links along the ring are none.
    fn runs(&self, star: &Star, faces: &[u32]) -> Vec<Run> {
        let mut runs = Vec::new();
        for &first in faces.iter().flat_map(|&f| &self.links[f as usize]) {
            let Some(from) = star.along(self.knots[first as usize].at) else { continue };
            let mut last = first;
            let to = loop {
                last = self.knots[last as usize].next;
                if let Some(to) = star.along(self.knots[last as usize].at) {
                    break to;
                }
            };
            let reversed = from > to;
            let (knots, ends) = if reversed { ([last, first], [to, from]) } else { ([first, last], [from, to]) };
            let run = Run { knots, ends, reversed };
            if !self.is_along(star, first) {
                runs.push(run);
            }
        }
        runs
    }

    /// True for a link along an edge of the ring.
    fn is_along(&self, star: &Star, link: u32) -> bool {
        let knot = &self.knots[link as usize];
        let (Spot::Vertex(a), Spot::Vertex(b)) = (knot.at, self.knots[knot.next as usize].at) else { return false };
        let place = |v: u32| star.along(Spot::Vertex(v));
        let (Some(a), Some(b)) = (place(a), place(b)) else { return false };
        let ends = [a.min(b), a.max(b)];
        star.edge_of(ends).is_some() && !star.is_line(ends)
    }

    /// Names for links along the ring in `faces` the face that has their edge from now on.
    fn hand_over(&mut self, star: &Star, faces: &[u32], face: impl Fn(usize) -> u32) {
        let links: Vec<u32> = faces.iter().flat_map(|&f| &self.links[f as usize]).copied().collect();
        for link in links {
            if self.is_along(star, link) {
                let (from, to) = (link, self.knots[link as usize].next);
                let [a, b] = [from, to].map(|k| star.along(self.knots[k as usize].at).expect("a corner of the ring"));
                let edge = star.edge_of([a.min(b), a.max(b)]).expect("an edge of the ring");
                self.unlink(link);
                self.link(from, to, face(edge));
            }
        }
    }

    /// Pulls a run tight whose ends lie on one edge of the ring, which has face `face`.
    fn pull(&mut self, run: &Run, face: u32) {
        let [mut a, mut b] = run.knots;
        if run.reversed {
            (a, b) = (b, a);
        }
        self.cut_between(a, b);
        let mut face = face;
        // As long as both ends lie on one edge, nothing is between them and it.
        while let Some(edge) = self.one_edge(a, b) {
            if edge == [true, true] {
                break;
            }
            // Ends inside the edge go: the strand does not reach it any more.
            if !edge[0] {
                let before = self.knots[a as usize].before;
                face = self.knots[before as usize].face;
                self.unlink(before);
                a = before;
            }
            if !edge[1] {
                let next = self.knots[b as usize].next;
                face = self.knots[b as usize].face;
                self.unlink(b);
                b = next;
            }
        }
        self.link(a, b, face);
    }

    /// Whether each of two knots is a vertex, if they lie on one edge or are both vertices.
    fn one_edge(&self, a: u32, b: u32) -> Option<[bool; 2]> {
        match (self.knots[a as usize].at, self.knots[b as usize].at) {
            (Spot::Vertex(_), Spot::Vertex(_)) => Some([true, true]),
            (Spot::Vertex(v), Spot::Edge(p, q, _)) if v == p || v == q => Some([true, false]),
            (Spot::Edge(p, q, _), Spot::Vertex(v)) if v == p || v == q => Some([false, true]),
            (Spot::Edge(p, q, _), Spot::Edge(r, s, _)) if (p, q) == (r, s) || (p, q) == (s, r) => Some([false, false]),
            _ => None,
        }
    }

    /// Puts new ways in the place of `runs`; `apex` is the vertex where all edges inside the polygon end.
    fn draw(&mut self, star: &Star, runs: &[Run], ways: Vec<Way>, apex: (u32, DVec2), flat: &[DVec2]) {
        let n = star.ring.len();
        let place = |x: f64| flat[x as usize].lerp(flat[(x as usize + 1) % n], x.fract());
        // For every edge what meets it: the distances along the ring tell which is nearer to the ring.
        let mut met: BTreeMap<usize, Vec<([f64; 2], usize, usize)>> = BTreeMap::new();
        for (r, way) in ways.iter().enumerate() {
            for (i, &(m, reach)) in way.met.iter().enumerate() {
                met.entry(m).or_default().push((reach, r, i));
            }
        }
        let mut knots: Vec<Vec<u32>> = ways.iter().map(|way| vec![NONE; way.met.len()]).collect();
        for (m, mut here) in met {
            here.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]).then(a.0[1].total_cmp(&b.0[1])).then(a.1.cmp(&b.1)));
            let mut part: Vec<f64> = here
                .iter()
                .map(|&(_, r, _)| {
                    let [from, to] = runs[r].ends.map(place);
                    let (edge, chord) = (apex.1 - flat[m], to - from);
                    let part = (from - flat[m]).perp_dot(chord) / edge.perp_dot(chord);
                    if part.is_finite() { part } else { 0.5 }
                })
                .collect();
            part.sort_by(f64::total_cmp);
            keep_apart(&mut part, MEETINGS_APART);
            for (&(_, r, i), part) in here.iter().zip(part) {
                knots[r][i] = self.knots.len() as u32;
                let at = Spot::Edge(star.ring[m], apex.0, part);
                self.knots.push(Knot { at, before: NONE, next: NONE, face: NONE });
            }
        }
        for ((run, way), mut inner) in runs.iter().zip(ways).zip(knots) {
            if way.faces.len() > inner.len() + 1 {
                // Along a line, through the vertex.
                inner.push(self.knots.len() as u32);
                self.knots.push(Knot { at: Spot::Vertex(apex.0), before: NONE, next: NONE, face: NONE });
            }
            let mut chain: Vec<u32> = std::iter::once(run.knots[0]).chain(inner).chain([run.knots[1]]).collect();
            let mut faces = way.faces;
            if run.reversed {
                chain.reverse();
                faces.reverse();
            }
            self.cut_between(chain[0], chain[chain.len() - 1]);
            for (pair, face) in chain.windows(2).zip(faces) {
                self.link(pair[0], pair[1], face);
            }
        }
    }

    /// Takes out what is between two knots of a strand.
    fn cut_between(&mut self, from: u32, to: u32) {
        let mut k = from;
        while k != to {
            let next = self.knots[k as usize].next;
            self.unlink(k);
            k = next;
        }
    }

    fn link(&mut self, from: u32, to: u32, face: u32) {
        self.knots[from as usize].next = to;
        self.knots[from as usize].face = face;
        self.knots[to as usize].before = from;
        self.links[face as usize].push(from);
    }

    fn unlink(&mut self, from: u32) {
        let links = &mut self.links[self.knots[from as usize].face as usize];
        links.retain(|&k| k != from);
    }
}
