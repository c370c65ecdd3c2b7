//! A proxy that gets some of its vertices back, and a map with it.
//!
//! A step of [`super::melt`] is taken back after all later ones that changed the same faces. The vertex that returns is put
//! into the map where it lies in the fan that it left, or where it sees most of the fan's polygon: upright triangles stay
//! upright, and charts stay whole numbers apart.

use super::Proxy;
use super::refine::Refined;
use super::strands::{Star, Step};
use crate::geom::predicates::orient2d;
use crate::layout::map::{SeamlessMap, quarter_turn};
use crate::mesh::{Adjacency, NONE, TriMesh, next};
use glam::{DVec2, DVec3};
use std::collections::{HashMap, HashSet};
use std::rc::Rc;

/// Thirds that are cut off the interval in which the place furthest from the sides is looked for: a 40 000th of it is left.
const CUTS: usize = 26;

/// The steps that changed each face, in their order.
pub(super) struct History {
    /// For each face the start of its steps, and the end of the last.
    start: Vec<u32>,
    steps: Vec<u32>,
}

impl History {
    fn new(steps: &[Step], faces: usize) -> History {
        let mut start = vec![0; faces + 1];
        let changed = |step: &Step| changed(step).iter().copied().filter(|f| *f != NONE).collect::<Vec<u32>>();
        steps.iter().flat_map(changed).for_each(|f| start[f as usize + 1] += 1);
        (0..faces).for_each(|f| start[f + 1] += start[f]);
        let mut end = start.clone();
        let mut of_face = vec![0; start[faces] as usize];
        for (i, step) in (0..).zip(steps) {
            for f in changed(step) {
                of_face[end[f as usize] as usize] = i;
                end[f as usize] += 1;
            }
        }
        History { start, steps: of_face }
    }

    fn of(&self, face: u32) -> &[u32] {
        match self.start.get(face as usize..face as usize + 2) {
            Some(range) => &self.steps[range[0] as usize..range[1] as usize],
            // A face from a split, which comes before all steps.
            None => &[],
        }
    }
}

/// The faces that a step changed or took out.
fn changed(step: &Step) -> &[u32] {
    match step {
        Step::Out(star) => &star.faces,
        Step::Turn(_, pair) => pair,
    }
}

/// A face with its corners in its chart.
#[derive(Clone, Copy)]
struct Face {
    corners: [u32; 3],
    uv: [DVec2; 3],
}

impl Face {
    /// Place of a corner.
    fn at(&self, v: u32) -> DVec2 {
        self.uv[self.corners.iter().position(|&c| c == v).expect("a corner of the face")]
    }

    fn is_upright(&self) -> bool {
        let [a, b, c] = self.uv;
        orient2d(a, b, c) > 0.0
    }
}

/// The proxy on its way back, by the lasting names of vertices and faces.
#[derive(Clone)]
struct Regain {
    faces: HashMap<u32, Face>,
    /// Edges on lines, the lower name first.
    lines: HashSet<[u32; 2]>,
    /// Steps that were taken back.
    taken_back: HashSet<u32>,
    /// The refined input, with edges split since.
    work: Rc<Refined>,
}

fn edge(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

impl Proxy {
    /// The proxy with at least one vertex more in or beside each of these faces, and the map on it. Where none was ever taken out
    /// edges are split.
    /// * `map` - all triangles upright
    /// * `longest` - length of an edge on the map that is not split any more
    ///
    /// `None` if there is nothing to be had.
    pub fn regained(&self, faces: &[u32], map: &SeamlessMap, longest: f64) -> Option<(Proxy, SeamlessMap)> {
        let named = |v: u32| self.vertex[v as usize];
        let face = |f: usize| Face { corners: self.mesh.triangles[f].map(named), uv: map.uv[f] };
        let lined = (0..self.lines.len() as u32).filter(|&h| self.lines[h as usize]);
        let mut state = Regain {
            faces: (0..self.face.len()).map(|f| (self.face[f], face(f))).collect(),
            lines: lined.map(|h| edge(named(self.mesh.origin(h)), named(self.mesh.origin(next(h))))).collect(),
            taken_back: self.taken_back.clone(),
            work: Rc::clone(&self.work),
        };
        for &f in faces {
            let around = self.mesh.triangles[f as usize].map(|v| self.adjacency.outgoing[v as usize]);
            let around = around.iter().flat_map(|&h| self.adjacency.fan(self.mesh.origin(h)).map(|h| h / 3));
            // What is not there any more has got a vertex from a face before.
            let beside = around.map(|f| self.face[f as usize]).filter_map(|f| self.last_out(f, &state));
            let mut beside: Vec<u32> = beside.collect();
            beside.sort_unstable();
            beside.dedup();
            let own = self.last_out(self.face[f as usize], &state);
            let back = own.into_iter().chain(beside.into_iter().rev()).find_map(|step| self.with_vertex(step, &state));
            let back = back.or_else(|| self.with_split(self.face[f as usize], longest, &state));
            state = back.unwrap_or(state);
        }
        let is_same = state.faces.len() == self.face.len();
        (!is_same).then(|| state.proxy(self))
    }

    /// The step that last took a vertex out of a face.
    fn last_out(&self, face: u32, state: &Regain) -> Option<u32> {
        let is_out = |i: &&u32| !state.taken_back.contains(*i) && matches!(self.steps[**i as usize], Step::Out(_));
        self.history().of(face).iter().rev().find(is_out).copied()
    }

    fn history(&self) -> &History {
        self.history.get_or_init(|| History::new(&self.steps, self.work.mesh.triangles.len()))
    }

    /// The state with a step taken back, and all later ones that changed what it left. `None` if a face would be turned over.
    fn with_vertex(&self, step: u32, state: &Regain) -> Option<Regain> {
        let mut state = state.clone();
        let (mut undone, mut open) = (HashSet::from([step]), vec![step]);
        while let Some(i) = open.pop() {
            let later = changed(&self.steps[i as usize]).iter().filter(|f| **f != NONE);
            let later = later.flat_map(|&f| self.history().of(f)).filter(|j| **j > i && !state.taken_back.contains(j));
            open.extend(later.filter(|j| undone.insert(**j)));
        }
        let mut undone: Vec<u32> = undone.into_iter().collect();
        undone.sort_unstable();
        for &i in undone.iter().rev() {
            match &self.steps[i as usize] {
                Step::Out(star) => state.put_in(star)?,
                Step::Turn(ring, pair) => state.turn_back(*ring, *pair)?,
            }
        }
        state.taken_back.extend(undone);
        Some(state)
    }

    /// The state with the longest edge of a face split at its middle, if it is longer than `longest` on the map. `None` if the
    /// face has changed since the input was refined, or the one beside it cannot become what it was.
    fn with_split(&self, face: u32, longest: f64, state: &Regain) -> Option<Regain> {
        let is_changed = |state: &Regain, f: u32| self.history().of(f).iter().any(|i| !state.taken_back.contains(i));
        if is_changed(state, face) {
            return None;
        }
        let on_map = state.faces[&face];
        let length = |k: &usize| on_map.uv[*k].distance(on_map.uv[(*k + 1) % 3]);
        let k = (0..3).max_by(|a, b| length(a).total_cmp(&length(b))).filter(|k| length(k) > longest)?;
        let ends = [on_map.corners[k], on_map.corners[(k + 1) % 3]];
        let half = |work: &Refined, f: u32| {
            (3 * f..3 * f + 3)
                .find(|&h| ends.contains(&work.mesh.origin(h)) && ends.contains(&work.mesh.origin(next(h))))
        };
        let mut state = state.clone();
        let mut halves = vec![half(&state.work, face)?];
        let is_beside =
            |(f, on_map): &(&u32, &Face)| **f != face && ends.iter().all(|end| on_map.corners.contains(end));
        if let Some((&other, _)) = state.faces.iter().find(is_beside) {
            let first = self.history().of(other).iter().find(|i| !state.taken_back.contains(i));
            if let Some(&first) = first {
                state = self.with_vertex(first, &state)?;
            }
            halves.push(half(&state.work, other)?);
        }
        state.split(&halves, ends);
        Some(state)
    }
}

impl Regain {
    /// Puts the vertex of a star back. `None` if no place in the map sees all of its polygon.
    fn put_in(&mut self, star: &Star) -> Option<()> {
        let n = star.ring.len();
        let apex = star.ring[0];
        // The polygon in the chart of the fan's first face.
        let first = self.faces[&star.faces[1]];
        let mut polygon = vec![first.at(apex), first.at(star.ring[1])];
        for i in 1..n - 1 {
            let face = self.faces[&star.faces[i]];
            let [from, spoke, to] = [apex, star.ring[i], star.ring[i + 1]].map(|v| face.at(v));
            polygon.push(polygon[0] + quarter_turn(to - from, turn(spoke - from, polygon[i] - polygon[0])));
        }
        let place = carried(star, &polygon, &self.work.mesh.points).or_else(|| middle(&polygon, star.line))?;
        for (i, &f) in star.faces.iter().enumerate().filter(|(_, f)| **f != NONE) {
            let j = (i + 1) % n;
            let corners = [star.vertex, star.ring[i], star.ring[j]];
            let face = Face { corners, uv: [place, polygon[i], polygon[j]] };
            if !face.is_upright() {
                return None;
            }
            self.faces.insert(f, face);
        }
        // The boundary has no line.
        if let Some(m) = star.line
            && self.lines.remove(&edge(apex, star.ring[m]))
        {
            self.lines.extend([edge(apex, star.vertex), edge(star.vertex, star.ring[m])]);
        }
        Some(())
    }

    /// Splits the edge of these half-edges of the refined input, between these ends.
    fn split(&mut self, halves: &[u32], ends: [u32; 2]) {
        let middle = self.work.mesh.points.len() as u32;
        let before = self.work.mesh.triangles.len() as u32;
        Rc::make_mut(&mut self.work).split_edge(halves);
        for (h, new) in halves.iter().zip(before..) {
            let old = self.faces[&(h / 3)];
            let place = ends.map(|v| old.at(v));
            let at = |v: u32| if v == middle { place[0].midpoint(place[1]) } else { old.at(v) };
            for f in [h / 3, new] {
                let corners = self.work.mesh.triangles[f as usize];
                self.faces.insert(f, Face { corners, uv: corners.map(at) });
            }
        }
        if self.lines.remove(&edge(ends[0], ends[1])) {
            self.lines.extend(ends.map(|end| edge(end, middle)));
        }
    }

    /// Turns a diagonal back. `None` if it does not lie between its faces in the map.
    fn turn_back(&mut self, [a, b, c, d]: [u32; 4], [f, g]: [u32; 2]) -> Option<()> {
        let [one, two] = [self.faces[&f], self.faces[&g]];
        let turns = turn(two.at(d) - two.at(b), one.at(d) - one.at(b));
        let [b_at, c_at, d_at] = [b, c, d].map(|v| one.at(v));
        let a_at = b_at + quarter_turn(two.at(a) - two.at(b), turns);
        let back = [
            (f, Face { corners: [a, b, c], uv: [a_at, b_at, c_at] }),
            (g, Face { corners: [c, d, a], uv: [c_at, d_at, a_at] }),
        ];
        back.iter().all(|(_, face)| face.is_upright()).then(|| self.faces.extend(back))
    }

    /// The proxy of this state, which comes from `before`.
    fn proxy(self, before: &Proxy) -> (Proxy, SeamlessMap) {
        let mut face: Vec<u32> = self.faces.keys().copied().collect();
        face.sort_unstable();
        let mut vertex: Vec<u32> = self.faces.values().flat_map(|face| face.corners).collect();
        vertex.sort_unstable();
        vertex.dedup();
        let number = |v: u32| vertex.binary_search(&v).expect("a vertex of a face") as u32;
        let points = vertex.iter().map(|&v| self.work.mesh.points[v as usize]).collect();
        let triangles = face.iter().map(|f| self.faces[f].corners.map(number)).collect();
        let mesh = TriMesh::new(points, triangles);
        let adjacency = Adjacency::new(&mesh);
        let uv: Vec<[DVec2; 3]> = face.iter().map(|f| self.faces[f].uv).collect();
        let along = |h: u32| uv[h as usize / 3][(h as usize % 3 + 1) % 3] - uv[h as usize / 3][h as usize % 3];
        let ends = |h: u32| [h, next(h)].map(|h| vertex[mesh.origin(h) as usize]);
        let is_line = |h: u32| {
            adjacency.opposite[h as usize] != NONE && {
                let [a, b] = ends(h);
                self.lines.contains(&edge(a, b))
            }
        };
        let jump = |h: u32| match adjacency.opposite[h as usize] {
            NONE => 0,
            o => turn(along(h), -along(o)),
        };
        let halves = 0..adjacency.opposite.len() as u32;
        let lines = halves.clone().map(is_line).collect();
        let jump = halves.map(jump).collect();
        let Regain { work, taken_back, .. } = self;
        let work_adjacency = match Rc::ptr_eq(&work, &before.work) {
            true => Rc::clone(&before.work_adjacency),
            false => Rc::new(Adjacency::new(&work.mesh)),
        };
        let (steps, history) = (Rc::clone(&before.steps), Rc::clone(&before.history));
        let proxy = Proxy { mesh, adjacency, lines, work, work_adjacency, steps, history, taken_back, vertex, face };
        (proxy, SeamlessMap { uv, jump })
    }
}

/// The quarter turns that bring `from` to `to`.
fn turn(from: DVec2, to: DVec2) -> u8 {
    let off = |turns: &u8| quarter_turn(from, *turns).distance_squared(to);
    (0..4).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0)
}

/// How far a place lies to the left of all sides of a polygon, but of the one that a boundary runs along, which has nothing
/// beyond it.
fn reach(polygon: &[DVec2], line: Option<usize>, place: DVec2) -> f64 {
    let n = polygon.len();
    let is_rim = |i: usize| line == Some(1) && i == 0 || line == Some(n - 1) && i == n - 1;
    let from = |i: usize| (polygon[(i + 1) % n] - polygon[i]).normalize_or_zero().perp_dot(place - polygon[i]);
    (0..n).filter(|&i| !is_rim(i)).map(from).fold(f64::INFINITY, f64::min)
}

/// Where the vertex of a star lies in the fan, in the map of that; `None` if it does not see all of the polygon.
fn carried(star: &Star, polygon: &[DVec2], points: &[DVec3]) -> Option<DVec2> {
    let flat = star.flat(points);
    let place = match star.line {
        Some(m) => polygon[0].lerp(polygon[m], flat[0].length() / (flat[0].length() + flat[m].length())),
        None => {
            let weights = |i: usize| {
                let [a, b, c] = [flat[0], flat[i], flat[i + 1]];
                [b.perp_dot(c), c.perp_dot(a), a.perp_dot(b)]
            };
            let i = (1..flat.len() - 1).find(|&i| weights(i).iter().all(|w| *w >= 0.0))?;
            let [a, b, c] = weights(i);
            (a * polygon[0] + b * polygon[i] + c * polygon[i + 1]) / (a + b + c)
        }
    };
    (reach(polygon, star.line, place) > 0.0).then_some(place)
}

/// The place in a polygon furthest from the lines of its sides, or the furthest on the way from the first of its corners to
/// the one that `line` says. `None` if no place sees all of it.
fn middle(polygon: &[DVec2], line: Option<usize>) -> Option<DVec2> {
    let reach = |p: DVec2| reach(polygon, line, p);
    let place = match line {
        Some(m) => {
            let on_line = |part: f64| polygon[0].lerp(polygon[m], part);
            on_line(greatest([0.0, 1.0], |part| reach(on_line(part))))
        }
        None => {
            let low = polygon.iter().fold(polygon[0], |low, p| low.min(*p));
            let high = polygon.iter().fold(polygon[0], |high, p| high.max(*p));
            let above = |x: f64| DVec2::new(x, greatest([low.y, high.y], |y| reach(DVec2::new(x, y))));
            above(greatest([low.x, high.x], |x| reach(above(x))))
        }
    };
    (reach(place) > 0.0).then_some(place)
}

/// Where in an interval a concave function is greatest.
fn greatest([mut low, mut high]: [f64; 2], of: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..CUTS {
        let third = (high - low) / 3.0;
        if of(low + third) < of(high - third) { low += third } else { high -= third }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::proxy::even;
    use crate::synthetic::shapes;

    /// A proxy of a square, mapped by its own coordinates.
    fn sheet(triangles: usize) -> (Proxy, SeamlessMap) {
        let mut mesh = shapes::rectangle(1.0, 1.0, 31, 29);
        // No three in a row, but on the rim.
        mesh.points.iter_mut().for_each(|p| {
            let [x, y] = [p.x, p.y];
            let inside = 0.3 * x * (1.0 - x) * y * (1.0 - y);
            *p += inside * DVec3::new((70.0 * y + 9.0 * x).sin(), (80.0 * x).sin(), 0.0) / 3.0;
        });
        let none = vec![false; 3 * mesh.triangles.len()];
        let proxy = Rc::into_inner(even(&mesh, &none, triangles)).expect("the only one");
        let uv = (0..proxy.mesh.triangles.len()).map(|f| proxy.mesh.corners(f).map(DVec3::truncate)).collect();
        let jump = vec![0; proxy.lines.len()];
        (proxy, SeamlessMap { uv, jump })
    }

    #[test]
    fn vertices_come_back_to_their_places_in_a_flat_map_with_few_others_and_all_triangles_upright() {
        let (proxy, map) = sheet(200);
        let (finer, carried) = proxy.regained(&[17, 60], &map, f64::INFINITY).expect("two vertices at least");
        let more = finer.mesh.points.len() - proxy.mesh.points.len();
        assert!((2..60).contains(&more), "{more}");
        for (f, uv) in carried.uv.iter().enumerate() {
            assert!(orient2d(uv[0], uv[1], uv[2]) > 0.0);
            let places = finer.mesh.corners(f).map(DVec3::truncate);
            assert!(uv.iter().zip(places).all(|(uv, p)| uv.distance(p) < 1e-12));
        }
        assert!(carried.jump.iter().all(|j| *j == 0));
    }

    #[test]
    fn a_proxy_that_gets_all_of_its_vertices_back_is_the_mesh_that_it_was_made_of() {
        let (mut proxy, mut map) = sheet(100);
        while proxy.taken_back.len() < proxy.steps.len() {
            let all: Vec<u32> = (0..proxy.mesh.triangles.len() as u32).collect();
            let Some(finer) = proxy.regained(&all, &map, f64::INFINITY) else { break };
            (proxy, map) = finer;
        }
        let sorted = |mesh: &TriMesh| {
            let turned = |&[a, b, c]: &[u32; 3]| match a.min(b).min(c) {
                least if least == a => [a, b, c],
                least if least == b => [b, c, a],
                _ => [c, a, b],
            };
            let mut triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(turned).collect();
            triangles.sort_unstable();
            triangles
        };
        assert_eq!(sorted(&proxy.mesh), sorted(&proxy.work.mesh));
    }

    #[test]
    fn the_middle_of_a_square_and_of_a_polygon_with_a_notch_is_as_far_from_all_sides_as_can_be() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]].map(DVec2::from);
        assert!(middle(&square, None).is_some_and(|p| p.distance(DVec2::ONE) < 1e-4));
        assert!(middle(&square, Some(2)).is_some_and(|p| p.distance(DVec2::ONE) < 1e-4));
        // An L of two arms one wide: only the unit square in its corner sees all of it.
        let bent = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]].map(DVec2::from);
        assert!(middle(&bent, None).is_some_and(|p| p.distance(DVec2::splat(0.5)) < 1e-4));
        let folded = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [3.0, 2.0], [3.0, 3.0], [0.0, 3.0]];
        assert_eq!(middle(&folded.map(DVec2::from), None), None);
    }
}
