//! A mesh that loses vertices between fixed lines, step by step, until it is as coarse as wanted.
//!
//! A vertex goes to the neighbour that leaves the best triangles (Lee et al., *MAPS*, 1998), one of a line to a neighbour
//! on the line. Which one goes next is told by how crowded it is (Yuksel, *Sample Elimination for Generating Poisson Disk
//! Sample Sets*, 2015; here neighbours of the mesh count only), and diagonals are turned where that makes the angles
//! opposite to them smaller (Lawson 1977). Every step is kept, so that what is drawn on the coarse mesh can be carried
//! back ([`super::strands`]).

use super::refine::{Refined, has_greater_angles};
use super::strands::{Star, Step, unfolded};
use crate::geom::predicates::orient2d;
use crate::mesh::{Adjacency, NONE};
use crate::observe::Observer;
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::rc::Rc;

/// Greatest length of a new edge, and greatest distance to the neighbour that a vertex goes to, in wanted edges.
const LONGEST: f64 = 1.7;
const NEAR: f64 = 1.4;

/// Neighbours further than this, in wanted edges, do not crowd a vertex; the power is Yuksel's.
const CROWD_REACH: f64 = 1.5;
const CROWD_POWER: i32 = 8;

/// A neighbour on the line counts as much as these on a surface, where there are three times as many.
const LINE_CROWD: f64 = 3.0;

/// Cosine of the greatest turn of a face: limbs and ridges stay.
const FACE_TURN_COSINE: f64 = 0.8;

/// Cosine of the greatest angle between the faces of a diagonal that is turned.
const FLAT_COSINE: f64 = 0.9;

/// Greatest turn of a line at a vertex, radians: a circle keeps eleven.
const LINE_TURN: f64 = 0.61;

/// Teeth of lines that are no higher than this, in wanted edges, go: rims of scans are jagged. Chosen on scans at .25 % noise,
/// where a tenth left teeth of the noise's height.
const LINE_DETAIL: f64 = 0.25;

/// Greatest number of neighbours.
const VALENCE: usize = 12;

/// Least shape of a new face (1 for an equilateral triangle), unless it was worse before: the next one is for what is still
/// finer than wanted.
const LEAST_FACE_SHAPES: [f64; 3] = [0.45, 0.3, 0.15];

/// A face of less than this, lower than what lines may leave out, is a sliver.
const SLIVER_SHAPE: f64 = LEAST_FACE_SHAPES[2];

/// Vertices taken out between two looks at the observer: some milliseconds.
const LOOK_EVERY: usize = 4096;

/// What a vertex is to the lines.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// On none.
    Free,
    /// Inside one: it may go along the line.
    Inside,
    /// A corner, an end or a junction.
    Fixed,
}

/// A mesh that loses vertices.
#[derive(Clone)]
pub(super) struct Melt {
    /// The mesh before.
    pub work: Rc<Refined>,
    pub work_adjacency: Rc<Adjacency>,
    pub triangles: Vec<[u32; 3]>,
    /// For each half-edge whether it is on a line or the boundary.
    pub tagged: Vec<bool>,
    /// Faces around each vertex; none around one that is gone.
    pub around: Vec<Vec<u32>>,
    kind: Vec<Kind>,
    /// Length of an edge wanted at each vertex.
    edge: Vec<f64>,
    /// Least shape of a new face, of [`LEAST_FACE_SHAPES`].
    least: f64,
    pub steps: Vec<Step>,
    /// Faces that are left.
    pub left: usize,
}

impl Melt {
    /// The whole mesh.
    /// * `tagged` - half-edges on lines and on the boundary, the former from both sides
    pub fn new(work: Rc<Refined>, work_adjacency: Rc<Adjacency>, tagged: Vec<bool>) -> Melt {
        let mesh = &work.mesh;
        let mut around = vec![Vec::new(); mesh.points.len()];
        for (f, t) in mesh.triangles.iter().enumerate() {
            t.iter().for_each(|&v| around[v as usize].push(f as u32));
        }
        let mut melt = Melt {
            triangles: mesh.triangles.clone(),
            tagged,
            around,
            kind: Vec::new(),
            edge: Vec::new(),
            least: LEAST_FACE_SHAPES[0],
            steps: Vec::new(),
            left: mesh.triangles.len(),
            work,
            work_adjacency,
        };
        let kind = |v: u32| match melt.line_ends(v)[..] {
            [] => Kind::Free,
            [_, _] => Kind::Inside,
            _ => Kind::Fixed,
        };
        melt.kind = (0..melt.around.len() as u32).map(kind).collect();
        melt
    }

    /// Wants edges of these lengths from now on.
    pub fn want(&mut self, edge: impl Fn(DVec3) -> f64) {
        self.edge = self.work.mesh.points.iter().map(|&p| edge(p)).collect();
    }

    /// Takes out vertices until no more than `wanted` faces are left, or none can go.
    pub fn run(&mut self, wanted: usize, observer: &dyn Observer) {
        for least in LEAST_FACE_SHAPES {
            self.least = least;
            self.pass(wanted, observer);
        }
        let all: Vec<u32> = (0..self.triangles.len() as u32).filter(|&f| self.is_live(f)).collect();
        self.turn_around(all, &mut Vec::new());
    }

    /// Takes out vertices until no more than `wanted` faces are left, or none can go without leaving faces of poor shapes.
    pub fn thin(&mut self, wanted: usize, observer: &dyn Observer) {
        self.least = LEAST_FACE_SHAPES[0];
        self.pass(wanted, observer);
    }

    fn pass(&mut self, wanted: usize, observer: &dyn Observer) {
        let count = self.around.len();
        let key = |crowd: f64, v: u32| (crowd.to_bits(), Reverse(v));
        let mut queue: BinaryHeap<_> = (0..count as u32).filter_map(|v| Some(key(self.crowd(v)?, v))).collect();
        let mut queued = vec![true; count];
        let mut stale = vec![false; count];
        let (mut touched, mut gone) = (Vec::new(), 0);
        while self.left > wanted
            && let Some((_, Reverse(v))) = queue.pop()
        {
            // Vertices get less crowded as others go, so it is enough to look again at those that come first.
            if std::mem::take(&mut stale[v as usize]) {
                queue.extend(self.crowd(v).map(|crowd| key(crowd, v)));
                continue;
            }
            queued[v as usize] = false;
            let Some(star) = self.plan(v) else { continue };
            touched.clear();
            touched.extend_from_slice(&star.ring);
            let faces = star.fan().to_vec();
            self.take_out(star);
            self.turn_around(faces, &mut touched);
            for &t in &touched {
                stale[t as usize] = true;
                if !std::mem::replace(&mut queued[t as usize], true) {
                    queue.extend(self.crowd(t).map(|crowd| key(crowd, t)));
                }
            }
            gone += 1;
            if gone % LOOK_EVERY == 0 && observer.cancelled() {
                return;
            }
        }
    }

    /// False for a face that is gone.
    pub fn is_live(&self, f: u32) -> bool {
        self.around[self.triangles[f as usize][0] as usize].contains(&f)
    }

    fn at(&self, v: u32) -> DVec3 {
        self.work.mesh.points[v as usize]
    }

    fn on_line(&self, v: u32) -> bool {
        self.kind[v as usize] != Kind::Free
    }

    /// The neighbours of a vertex on lines and on the boundary.
    fn line_ends(&self, v: u32) -> Vec<u32> {
        let mut ends = Vec::new();
        for &f in &self.around[v as usize] {
            let t = self.triangles[f as usize];
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                if self.tagged[3 * f as usize + k] && (a == v || b == v) && !ends.contains(&(a ^ b ^ v)) {
                    ends.push(a ^ b ^ v);
                }
            }
        }
        ends
    }

    /// How crowded a vertex is, if it may go at all.
    fn crowd(&self, v: u32) -> Option<f64> {
        let reach = CROWD_REACH * self.edge[v as usize];
        let here = self.at(v);
        let one = |w: u32| (1.0 - self.at(w).distance(here) / reach).max(0.0).powi(CROWD_POWER);
        match self.kind[v as usize] {
            _ if self.around[v as usize].is_empty() => None,
            Kind::Fixed => None,
            Kind::Free => {
                let neighbour = |&f: &u32| {
                    let t = self.triangles[f as usize];
                    one(t[(t.iter().position(|&x| x == v).unwrap_or(0) + 1) % 3])
                };
                Some(self.around[v as usize].iter().map(neighbour).sum())
            }
            Kind::Inside => Some(LINE_CROWD * self.line_ends(v).into_iter().map(one).sum::<f64>()),
        }
    }

    /// How vertex `v` can be taken out best, if it can.
    fn plan(&self, v: u32) -> Option<Star> {
        let mut star = self.star(v)?;
        let here = self.at(v);
        let flat = star.flat(&self.work.mesh.points);
        let n = star.ring.len();
        let old = (0..n).filter(|&i| star.faces[i] != NONE);
        let at = |i: usize| self.at(star.ring[i]);
        let old = old.map(|i| shape([here, at(i), at((i + 1) % n)])).fold(f64::INFINITY, f64::min);
        let apexes = match star.line {
            Some(m) if self.is_straight(v, star.ring[0], star.ring[m]) => vec![0, m],
            Some(_) => return None,
            None => (0..n).collect(),
        };
        let near = NEAR * self.edge[v as usize];
        let mut best: Option<(f64, usize)> = None;
        for apex in apexes.into_iter().filter(|&i| at(i).distance(here) < near) {
            let beat = best.map_or(0.0, |b| b.0);
            if let Some(least) = self.fan_shape(&star, &flat, apex, self.least.min(old).max(beat)) {
                best = Some((least, apex));
            }
        }
        let (_, apex) = best?;
        star.ring.rotate_left(apex);
        star.faces.rotate_left(apex);
        star.line = star.line.map(|m| if apex == 0 { m } else { n - m });
        Some(star)
    }

    /// True if the line gets no sharp turn when `v` between `a` and `b` is gone; or none that is sharper than before, where
    /// it leaves out no more than a detail of a line that is straight beyond it.
    fn is_straight(&self, v: u32, a: u32, b: u32) -> bool {
        let turn = |[p, q, r]: [u32; 3]| (self.at(q) - self.at(p)).angle_between(self.at(r) - self.at(q));
        // What a line that goes on to `to` turns by at `a`.
        let at_end = |a: u32, to: u32| match self.kind[a as usize] {
            Kind::Fixed => 0.0,
            _ => {
                let before = self.line_ends(a).into_iter().filter(|&w| w != v);
                before.map(|w| turn([w, a, to])).fold(0.0, f64::max)
            }
        };
        let (here, after) = (turn([a, v, b]), at_end(a, b).max(at_end(b, a)));
        if here.max(after) < LINE_TURN {
            return true;
        }
        let (to, chord) = (self.at(v) - self.at(a), self.at(b) - self.at(a));
        let along = (to.dot(chord) / chord.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let is_detail = to.distance(along * chord) < LINE_DETAIL * self.edge[v as usize];
        is_detail
            && after <= here.max(at_end(a, v)).max(at_end(b, v))
            && turn([self.away(v, a), v, self.away(v, b)]) < LINE_TURN
    }

    /// The first vertex of a line from `v` over `a` that is a wanted edge away from `v`, or where the line ends before.
    fn away(&self, v: u32, a: u32) -> u32 {
        let (mut before, mut here) = (v, a);
        while self.kind[here as usize] == Kind::Inside && self.at(here).distance(self.at(v)) < self.edge[v as usize] {
            match self.line_ends(here).into_iter().find(|&w| w != before) {
                Some(next) if next != v => (before, here) = (here, next),
                _ => break,
            }
        }
        here
    }

    /// The least shape of a face of the fan from corner `apex` of the ring; `None` unless it is above `least` and the
    /// fan is allowed.
    fn fan_shape(&self, star: &Star, flat: &[glam::DVec2], apex: usize, least: f64) -> Option<f64> {
        let n = star.ring.len();
        let ring = |i: usize| (apex + i) % n;
        let name = |i: usize| star.ring[ring(i)];
        let at = |i: usize| self.at(name(i % n));
        let (here, top) = (self.at(star.vertex), at(0));
        let far = star.line.map(|m| if apex == 0 { m } else { n - m });
        let normal = |i: usize| match star.faces[ring(i)] {
            NONE => DVec3::ZERO,
            _ => (at(i) - here).cross(at(i + 1) - here),
        };
        let sides = [0..far.unwrap_or(n), far.unwrap_or(n)..n];
        let means = sides.map(|side| side.map(normal).sum::<DVec3>().normalize_or_zero());
        // Where a line is jagged there are slivers, which have no direction: they go next, one by one.
        let detail = LINE_DETAIL * self.edge[star.vertex as usize];
        let is_near = top.distance(here) < detail;
        let mut shapes = f64::INFINITY;
        for i in 1..n - 1 {
            let (p, q) = (at(i), at(i + 1));
            let face = (p - top).cross(q - top);
            let mean = means[far.is_some_and(|m| i >= m) as usize];
            let lines = [0, i, i + 1].iter().all(|&k| self.on_line(name(k)));
            if lines || orient2d(flat[ring(0)], flat[ring(i)], flat[ring(i + 1)]) <= 0.0 {
                return None;
            }
            let longest = top.distance(p).max(top.distance(q)).max(p.distance(q));
            let own = shape([top, p, q]);
            if is_near && face.length() < detail * longest && own < SLIVER_SHAPE {
                continue;
            }
            shapes = shapes.min(own);
            if shapes <= least || face.dot(mean) <= FACE_TURN_COSINE * face.length() || normal(i).dot(face) < 0.0 {
                return None;
            }
        }
        let longest = LONGEST * self.edge[star.vertex as usize];
        let spans = |i: usize| {
            let lines = self.on_line(name(0)) && self.on_line(name(i)) && far != Some(i);
            top.distance(at(i)) < longest && !lines && !self.joined(name(0), name(i))
        };
        // An edge inside the fan, or the new piece of a line, which the boundary has at its rim.
        let full = self.around[name(0) as usize].len() + n > VALENCE + 4;
        let thin = |i: usize| !self.on_line(name(i)) && self.around[name(i) as usize].len() <= 3;
        let fits = (2..n - 1).chain(far.filter(|&m| m == 1 || m == n - 1)).all(spans);
        (fits && !(full || thin(1) || thin(n - 1) || n == 3 && thin(0))).then_some(shapes)
    }

    /// The faces around a vertex, in order, from an end of its line if it is on one.
    fn star(&self, v: u32) -> Option<Star> {
        let around = &self.around[v as usize];
        if around.is_empty() || around.len() > VALENCE {
            return None;
        }
        let mut space = [(0, 0); VALENCE];
        let corners = &mut space[..around.len()];
        for (corner, &f) in corners.iter_mut().zip(around) {
            let t = self.triangles[f as usize];
            let k = t.iter().position(|&x| x == v).unwrap_or(0);
            *corner = (t[(k + 1) % 3], t[(k + 2) % 3]);
        }
        let first = corners.iter().find(|c| !corners.iter().any(|d| d.1 == c.0));
        let mut at = first.unwrap_or(&corners[0]).0;
        let mut star = Star {
            vertex: v,
            ring: Vec::with_capacity(around.len() + 1),
            faces: Vec::with_capacity(around.len() + 1),
            line: None,
        };
        for _ in 0..around.len() {
            let i = corners.iter().position(|c| c.0 == at)?;
            star.ring.push(at);
            star.faces.push(around[i]);
            at = corners[i].1;
        }
        if at != star.ring[0] {
            star.ring.push(at);
            star.faces.push(NONE);
        }
        let n = star.ring.len();
        if self.kind[v as usize] == Kind::Inside {
            let ends = self.line_ends(v);
            let place = |w: u32| star.ring.iter().position(|&r| r == w);
            let (a, b) = (place(*ends.first()?)?, place(*ends.last()?)?);
            let (a, b) = (a.min(b), a.max(b));
            star.ring.rotate_left(a);
            star.faces.rotate_left(a);
            star.line = Some(b - a);
            // Neighbours beside each other leave no room for the new piece of the line, but on the boundary.
            let close = b - a == 1 && star.faces[0] != NONE || b - a == n - 1 && star.faces[n - 1] != NONE;
            if close {
                return None;
            }
        } else if star.faces.contains(&NONE) {
            return None;
        }
        (n >= 3).then_some(star)
    }

    /// True if an edge joins two vertices.
    fn joined(&self, a: u32, b: u32) -> bool {
        self.around[a as usize].iter().any(|&f| self.triangles[f as usize].contains(&b))
    }

    fn take_out(&mut self, star: Star) {
        let n = star.ring.len();
        let apex = star.ring[0];
        let tag_of = |melt: &Melt, i: usize| match star.faces[i] {
            NONE => true,
            f => {
                let k = melt.triangles[f as usize].iter().position(|&x| x == star.vertex).unwrap_or(0);
                melt.tagged[3 * f as usize + (k + 1) % 3]
            }
        };
        let rim: Vec<bool> = (0..n).map(|i| tag_of(self, i)).collect();
        let spoke = |i: usize| match i {
            1 => rim[0],
            _ if i == n - 1 => rim[n - 1],
            _ => star.line == Some(i),
        };
        for (i, &f) in (1..).zip(star.fan()) {
            self.triangles[f as usize] = [apex, star.ring[i], star.ring[i + 1]];
            self.tagged[3 * f as usize..3 * f as usize + 3].copy_from_slice(&[spoke(i), rim[i], spoke(i + 1)]);
        }
        let gone = [star.faces[0], star.faces[n - 1]];
        for v in [apex, star.ring[1], star.ring[n - 1]] {
            self.around[v as usize].retain(|f| !gone.contains(f));
        }
        self.around[apex as usize].extend_from_slice(star.fan());
        self.around[star.vertex as usize] = Vec::new();
        self.left -= gone.iter().filter(|&&f| f != NONE).count();
        self.steps.push(Step::Out(star));
    }

    /// Turns diagonals of `faces` and, where one is turned, of those beside it; adds the vertices that gain or lose a
    /// face to `touched`.
    fn turn_around(&mut self, mut faces: Vec<u32>, touched: &mut Vec<u32>) {
        while let Some(f) = faces.pop() {
            for k in 0..3 {
                if let Some((ring, pair)) = self.turn(f, k) {
                    for v in ring {
                        if !touched.contains(&v) {
                            touched.push(v);
                        }
                    }
                    faces.extend(pair);
                    break;
                }
            }
        }
    }

    /// Turns an edge of a face if that makes the angles opposite to it smaller and is allowed.
    fn turn(&mut self, f: u32, k: usize) -> Option<([u32; 4], [u32; 2])> {
        if self.tagged[3 * f as usize + k] {
            return None;
        }
        let t = self.triangles[f as usize];
        let (a, b, c) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
        let other = |&&g: &&u32| g != f && self.triangles[g as usize].contains(&b);
        let &g = self.around[a as usize].iter().find(other)?;
        let j = self.triangles[g as usize].iter().position(|&x| x == b)?;
        let d = self.triangles[g as usize][(j + 2) % 3];
        let [p, q, r, s] = [a, d, b, c].map(|v| self.at(v));
        if !has_greater_angles([p, r], [q, s]) || self.on_line(c) && self.on_line(d) {
            return None;
        }
        let thin = |v: u32| !self.on_line(v) && self.around[v as usize].len() <= 4;
        let unit = |a: DVec3, b: DVec3, c: DVec3| (b - a).cross(c - a).normalize_or_zero();
        let (one, two) = (unit(p, q, r), unit(r, s, p));
        let (fresh_one, fresh_two) = (unit(q, r, s), unit(s, p, q));
        let mean = (one + two).normalize_or_zero();
        let flat = unfolded([p, q, r, s]);
        let allowed = one.dot(two) > FLAT_COSINE
            && fresh_one.dot(mean) > FLAT_COSINE
            && fresh_two.dot(mean) > FLAT_COSINE
            && orient2d(flat[1], flat[2], flat[3]) > 0.0
            && orient2d(flat[3], flat[0], flat[1]) > 0.0
            && !thin(a)
            && !thin(b)
            && self.around[c as usize].len().max(self.around[d as usize].len()) < VALENCE
            && !self.joined(c, d);
        if !allowed {
            return None;
        }
        let tag = |f: u32, i: usize| self.tagged[3 * f as usize + i % 3];
        let rim = [tag(g, j + 1), tag(g, j + 2), tag(f, k + 1), tag(f, k + 2)];
        self.triangles[g as usize] = [d, b, c];
        self.triangles[f as usize] = [c, a, d];
        self.tagged[3 * g as usize..3 * g as usize + 3].copy_from_slice(&[rim[1], rim[2], false]);
        self.tagged[3 * f as usize..3 * f as usize + 3].copy_from_slice(&[rim[3], rim[0], false]);
        self.around[a as usize].retain(|&x| x != g);
        self.around[b as usize].retain(|&x| x != f);
        self.around[c as usize].push(g);
        self.around[d as usize].push(f);
        self.steps.push(Step::Turn([a, d, b, c], [g, f]));
        Some(([a, d, b, c], [g, f]))
    }
}

/// Shape of a triangle: 1 for an equilateral one, 0 for one without area.
pub(super) fn shape([a, b, c]: [DVec3; 3]) -> f64 {
    let longest = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
    if longest > 0.0 { 2.0 * 3f64.sqrt() * (b - a).cross(c - a).length() / longest } else { 0.0 }
}
