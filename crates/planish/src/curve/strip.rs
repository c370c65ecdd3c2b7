//! Strips of faces: the shortest way between two places within a strip, and strips turned around vertices until
//! the way is straight everywhere on the surface.
//!
//! 1. a strip follows a chain of edges; 2. laid out flat, the funnel of its edges gives the shortest way in it;
//! 3. where the way bends around a vertex and the surface on the other side opens by less than 180 degrees, the
//!    strip is turned to that side; 4. again, until no vertex is left: the way is a geodesic.
//!
//! The turns are those that edge flips make in an intrinsic triangulation (Sharp and Crane 2020, *You can find
//! geodesic paths in triangle meshes by just flipping edges*), done on the faces themselves: only faces that the
//! way crosses are looked at.

use super::CurveError;
use crate::geom::graph::{Reached, Search};
use crate::geom::polyline;
use crate::geom::tolerance::{AT_VERTEX, ON_EDGE};
use crate::mesh::path::neighbours;
use crate::mesh::{Adjacency, FacePoint, NONE, TriMesh, next, previous};
use glam::DVec2;
use std::collections::HashMap;

/// Slack on the angle of 180 degrees, radians: a way this straight is straight.
const STRAIGHT: f64 = 1e-9;
/// Rounds of turning per face of the strip before the way is taken as it is.
const ROUNDS_PER_FACE: usize = 2;
const LEAST_ROUNDS: usize = 64;

/// Vertex that a place lies on, if it does exactly.
pub(crate) fn vertex_of(mesh: &TriMesh, place: &FacePoint) -> Option<u32> {
    (0..3).find(|&k| place.bary[k] == 1.0).map(|k| mesh.triangles[place.face as usize][k])
}

/// The corner of a place's face that is nearest to it.
pub(crate) fn nearest_corner(mesh: &TriMesh, place: &FacePoint) -> u32 {
    let p = place.position(mesh);
    let corners = mesh.corners(place.face as usize);
    let k = (0..3).min_by(|&i, &j| corners[i].distance_squared(p).total_cmp(&corners[j].distance_squared(p)));
    mesh.triangles[place.face as usize][k.unwrap_or(0)]
}

/// Places from `from` to `to`, both included, along a geodesic of the surface near the shortest chain of edges;
/// neighbours share a face.
/// # Errors
/// `NoWay` if the two lie on different pieces of the mesh.
pub fn connect(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    from: FacePoint,
    to: FacePoint,
) -> Result<Vec<FacePoint>, CurveError> {
    if from.face == to.face {
        return Ok(vec![from, to]);
    }
    // Most neighbours of a curve lie on adjacent faces.
    let beside = (3 * from.face..3 * from.face + 3).find(|&h| {
        let o = adjacency.opposite[h as usize];
        o != NONE && o / 3 == to.face
    });
    let (a, b) = (nearest_corner(mesh, &from), nearest_corner(mesh, &to));
    let along = |a: u32, b: u32| {
        let chain = local_path(mesh, adjacency, a, b)?;
        straighten(mesh, adjacency, from, &chain, to)
    };
    let first = match beside {
        Some(h) => straightened(mesh, adjacency, from, vec![h], to),
        None => along(a, b).ok_or_else(|| no_way(mesh, &from, &to))?,
    };
    let straight = from.position(mesh).distance(to.position(mesh));
    let mut best = (length(mesh, &first), first);
    if best.0 <= BENT * straight || best.1.len() > NEAR {
        return Ok(best.1);
    }
    // Past a tip there are several geodesics; the nearest corners need not tell which is shortest.
    for v in mesh.triangles[from.face as usize] {
        for w in mesh.triangles[to.face as usize] {
            let other = if (v, w) == (a, b) && beside.is_none() { None } else { along(v, w) };
            if let Some(way) = other {
                let reached = length(mesh, &way);
                if reached < best.0 {
                    best = (reached, way);
                }
            }
        }
    }
    Ok(best.1)
}

/// A way between near places longer than this times the segment is compared with those by other corners, ...
const BENT: f64 = 1.02;
/// ... unless it has more places than this: they do not lie near each other.
const NEAR: usize = 24;

fn length(mesh: &TriMesh, places: &[FacePoint]) -> f64 {
    polyline::length(places.iter().map(|p| p.position(mesh)))
}

pub(crate) fn no_way(mesh: &TriMesh, from: &FacePoint, to: &FacePoint) -> CurveError {
    CurveError::NoWay { from: from.position(mesh).to_array(), to: to.position(mesh).to_array() }
}

/// Pulls the chain of vertices `chain`, which begins at a corner of the face of `from` and ends at one of the face of
/// `to`, to a geodesic between these places. Neighbours of the result share a face. `None` if the chain is no chain
/// of edges.
pub fn straighten(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    from: FacePoint,
    chain: &[u32],
    to: FacePoint,
) -> Option<Vec<FacePoint>> {
    let portals = strip_along(mesh, adjacency, from.face, chain, to.face)?;
    Some(straightened(mesh, adjacency, from, portals, to))
}

/// A half-edge that a strip leaves a face by, from `a` to `b`, with the place of the third vertex of the face beyond:
/// it lies at `a + (b - a) * beyond` in the plane, as complex numbers.
#[derive(Clone, Copy, Debug)]
struct Gate {
    half_edge: u32,
    beyond: DVec2,
}

impl Gate {
    fn new(mesh: &TriMesh, adjacency: &Adjacency, half_edge: u32) -> Gate {
        let o = adjacency.opposite[half_edge as usize];
        let point = |h: u32| mesh.points[mesh.origin(h) as usize];
        let (a, apex) = (point(half_edge), point(previous(o)));
        let (edge, c) = (point(o) - a, apex - a);
        let square = edge.length_squared();
        // On an edge without length nothing can be laid out; its face has no area, and is passed by.
        let beyond = if square > 0.0 { DVec2::new(c.dot(edge), -c.cross(edge).length()) / square } else { DVec2::ZERO };
        Gate { half_edge, beyond }
    }
}

/// Half-edges that a strip leaves its faces by, from `first` along `chain` to `last`.
fn strip_along(mesh: &TriMesh, adjacency: &Adjacency, first: u32, chain: &[u32], last: u32) -> Option<Vec<u32>> {
    let mut portals = Vec::with_capacity(2 * chain.len());
    let mut face = first;
    for (k, &v) in chain.iter().enumerate() {
        let has = |f: u32| match chain.get(k + 1) {
            Some(&w) => mesh.triangles[f as usize].contains(&w),
            None => f == last,
        };
        face = turn(mesh, adjacency, face, v, has, &mut portals)?;
    }
    (face == last).then_some(portals)
}

/// Turns around `v` from `face` to a face for which `there` holds, the way with fewer faces; adds the half-edges
/// crossed to `portals`. `None` if there is no such face around `v`.
fn turn(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    face: u32,
    v: u32,
    there: impl Fn(u32) -> bool,
    portals: &mut Vec<u32>,
) -> Option<u32> {
    if there(face) {
        return Some(face);
    }
    let k = mesh.triangles[face as usize].iter().position(|&w| w == v)? as u32;
    // Counter-clockwise a face is left by the half-edge that enters the vertex, clockwise by the one that leaves it.
    let on: [fn(u32) -> u32; 2] = [previous, next];
    let (mut passed, mut out) = ([Vec::new(), Vec::new()], [Some(previous(3 * face + k)), Some(3 * face + k)]);
    while out != [None, None] {
        for way in 0..2 {
            let Some(h) = out[way] else { continue };
            passed[way].push(h);
            let g = adjacency.opposite[h as usize];
            out[way] = (g != NONE && g / 3 != face).then(|| on[way](g));
            if out[way].is_some() && there(g / 3) {
                push_all(adjacency, portals, &passed[way]);
                return Some(g / 3);
            }
        }
    }
    None
}

/// Appends half-edges to a strip; going back over the last one takes it away.
fn push_all(adjacency: &Adjacency, portals: &mut Vec<u32>, more: &[u32]) {
    for &h in more {
        match portals.last() {
            Some(&g) if adjacency.opposite[g as usize] == h => {
                portals.pop();
            }
            _ => portals.push(h),
        }
    }
}

/// A strip laid out in the plane.
#[derive(Default)]
struct Layout {
    start: DVec2,
    end: DVec2,
    /// For each half-edge crossed the vertex on the left and its place, then the same on the right.
    left: Vec<(u32, DVec2)>,
    right: Vec<(u32, DVec2)>,
}

/// A bend of the shortest way within a strip.
struct Bend {
    /// Last half-edge crossed that has the vertex.
    portal: usize,
    on_left: bool,
    at: DVec2,
}

impl Layout {
    /// Lays out the strip from `from` through `gates` to `to`.
    fn lay(&mut self, mesh: &TriMesh, adjacency: &Adjacency, from: &FacePoint, gates: &[Gate], to: &FacePoint) {
        let weigh = |flat: [DVec2; 3], w: [f64; 3]| flat[0] * w[0] + flat[1] * w[1] + flat[2] * w[2];
        self.left.clear();
        self.right.clear();
        let [a, b, c] = mesh.corners(from.face as usize);
        let base = a.distance(b);
        let along = if base > 0.0 { (c - a).dot(b - a) / base } else { 0.0 };
        // Counter-clockwise: the third corner lies to the left of the first edge.
        let mut flat = [DVec2::ZERO, DVec2::new(base, 0.0), DVec2::new(along, (c - a).length_squared())];
        flat[2].y = (flat[2].y - along * along).max(0.0).sqrt();
        self.start = weigh(flat, from.bary);
        // Corners of the face that is reached, and the half-edge that its first corner starts.
        let mut names = mesh.triangles[from.face as usize];
        let mut first = 3 * from.face;
        for gate in gates {
            let h = gate.half_edge;
            // The faces of a strip hang together: the half-edge is one of the face that is reached.
            let k = (0..3).find(|&k| turned_by(first, k) == h).unwrap_or(0);
            let (a, b) = (k, (k + 1) % 3);
            let (fa, fb) = (flat[a], flat[b]);
            self.right.push((names[a], fa));
            self.left.push((names[b], fb));
            let edge = fb - fa;
            first = adjacency.opposite[h as usize];
            let apex = fa
                + DVec2::new(
                    edge.x * gate.beyond.x - edge.y * gate.beyond.y,
                    edge.x * gate.beyond.y + edge.y * gate.beyond.x,
                );
            names = [names[b], names[a], mesh.origin(previous(first))];
            flat = [fb, fa, apex];
        }
        let shift = (3 - first as usize % 3) % 3;
        self.end = weigh([0, 1, 2].map(|k| flat[(k + shift) % 3]), to.bary);
    }
}

/// The half-edge `k` steps on from `h` in its face.
fn turned_by(h: u32, k: usize) -> u32 {
    match k {
        0 => h,
        1 => next(h),
        _ => previous(h),
    }
}

/// Bends of the shortest way through a laid-out strip (the funnel of Lee and Preparata).
fn funnel(lay: &Layout, bends: &mut Vec<Bend>) {
    let count = lay.left.len();
    let sides = |i: usize| if i < count { (lay.left[i].1, lay.right[i].1) } else { (lay.end, lay.end) };
    bends.clear();
    let mut apex = lay.start;
    if count == 0 {
        return;
    }
    let (mut l, mut r) = sides(0);
    let (mut li, mut ri) = (0, 0);
    let mut i = 1;
    while i <= count {
        let (left, right) = sides(i);
        if (r - apex).perp_dot(right - apex) >= 0.0 {
            if apex == r || (l - apex).perp_dot(right - apex) < 0.0 {
                (r, ri) = (right, i);
            } else {
                bends.push(Bend { portal: li, on_left: true, at: l });
                apex = l;
                i = li + 1;
                (l, r) = (apex, apex);
                ri = li;
                continue;
            }
        }
        if (l - apex).perp_dot(left - apex) <= 0.0 {
            if apex == l || (r - apex).perp_dot(left - apex) > 0.0 {
                (l, li) = (left, i);
            } else {
                bends.push(Bend { portal: ri, on_left: false, at: r });
                apex = r;
                i = ri + 1;
                (l, r) = (apex, apex);
                li = ri;
                continue;
            }
        }
        i += 1;
    }
    // The funnel may name the end itself, or one vertex twice.
    bends.retain(|b| b.portal < count);
    bends.dedup_by(|b, a| a.at == b.at);
}

/// Turns the strip until its shortest way is straight; returns the places of that way.
fn straightened(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    from: FacePoint,
    mut portals: Vec<u32>,
    to: FacePoint,
) -> Vec<FacePoint> {
    let ends = [from, to];
    let (mut from, mut to) = (from, to);
    beyond_their_edges(adjacency, [&mut from, &mut to], &mut portals, |&h| h);
    let mut gates: Vec<Gate> = portals.into_iter().map(|h| Gate::new(mesh, adjacency, h)).collect();
    let mut turned: Vec<Gate> = Vec::with_capacity(gates.len());
    let mut lay = Layout::default();
    let mut bends: Vec<Bend> = Vec::new();
    let mut angles: HashMap<u32, f64> = HashMap::new();
    let rounds = ROUNDS_PER_FACE * gates.len() + LEAST_ROUNDS;
    for round in 0..=rounds {
        lay.lay(mesh, adjacency, &from, &gates, &to);
        funnel(&lay, &mut bends);
        turned.clear();
        let mut done = 0;
        for (k, bend) in bends.iter().enumerate().take_while(|_| round < rounds) {
            let side = if bend.on_left { &lay.left } else { &lay.right };
            let w = side[bend.portal].0;
            let first = (0..=bend.portal).rev().take_while(|&i| side[i].0 == w).last().unwrap_or(bend.portal);
            let last = (bend.portal..side.len()).take_while(|&i| side[i].0 == w).last().unwrap_or(bend.portal);
            if first < done {
                continue;
            }
            let before = if k > 0 { bends[k - 1].at } else { lay.start };
            let after = bends.get(k + 1).map_or(lay.end, |b| b.at);
            let mut around = |w: u32| *angles.entry(w).or_insert_with(|| whole_angle(mesh, adjacency, w));
            let turn = Turn { bend, gates: [first, last], arms: [before, after] };
            if let Some(other) = other_side(adjacency, &lay, &gates, &turn, &mut around) {
                push_gates(adjacency, &mut turned, gates[done..first].iter().copied());
                push_gates(adjacency, &mut turned, other.into_iter().map(|h| Gate::new(mesh, adjacency, h)));
                done = last + 1;
            }
        }
        if done == 0 {
            break;
        }
        push_gates(adjacency, &mut turned, gates[done..].iter().copied());
        std::mem::swap(&mut gates, &mut turned);
        // An end on an edge that is crossed now would lie between the sides of the funnel, in line with them.
        beyond_their_edges(adjacency, [&mut from, &mut to], &mut gates, |g| g.half_edge);
    }
    let mut places = places(mesh, &from, &gates, &to, &lay, &bends);
    let last = places.len() - 1;
    (places[0], places[last]) = (ends[0], ends[1]);
    places
}

/// Appends gates to a strip; going back through the last one takes it away.
fn push_gates(adjacency: &Adjacency, strip: &mut Vec<Gate>, more: impl Iterator<Item = Gate>) {
    for gate in more {
        match strip.last() {
            Some(last) if adjacency.opposite[last.half_edge as usize] == gate.half_edge => {
                strip.pop();
            }
            _ => strip.push(gate),
        }
    }
}

/// Angle of the surface around a vertex, radians.
fn whole_angle(mesh: &TriMesh, adjacency: &Adjacency, w: u32) -> f64 {
    let p = mesh.points[w as usize];
    let corner = |h: u32| {
        let (e, f) =
            (mesh.points[mesh.origin(next(h)) as usize] - p, mesh.points[mesh.origin(previous(h)) as usize] - p);
        e.cross(f).length().atan2(e.dot(f))
    };
    adjacency.fan(w).map(corner).sum()
}

/// Names ends of a strip that lie on the first (or last) edge crossed on the face beyond; such edges are no longer
/// crossed then, or the way would name the place twice.
fn beyond_their_edges<G>(
    adjacency: &Adjacency,
    [from, to]: [&mut FacePoint; 2],
    gates: &mut Vec<G>,
    half_edge: impl Fn(&G) -> u32,
) {
    let beyond = |at: &mut FacePoint, h: u32| {
        // The half-edge of the face that the place is named on, and the one beyond.
        if h / 3 != at.face || at.bary[previous(h) as usize % 3] > ON_EDGE {
            return false;
        }
        let g = adjacency.opposite[h as usize];
        let mut bary = [0.0; 3];
        let (a, b) = (at.bary[h as usize % 3], at.bary[next(h) as usize % 3]);
        (bary[next(g) as usize % 3], bary[g as usize % 3]) = (a / (a + b), b / (a + b));
        *at = FacePoint { face: g / 3, bary };
        true
    };
    let first = gates.iter().take_while(|g| beyond(from, half_edge(g))).count();
    gates.drain(..first);
    let last = gates.iter().rev().take_while(|g| beyond(to, adjacency.opposite[half_edge(g) as usize])).count();
    gates.truncate(gates.len() - last);
}

/// A bend with what is around it.
struct Turn<'a> {
    bend: &'a Bend,
    /// The first and the last of the gates that have its vertex.
    gates: [usize; 2],
    /// The bends before and after it, or the ends of the way.
    arms: [DVec2; 2],
}

/// The half-edges that pass the vertex of a bend on its other side, if the surface opens by less than 180 degrees
/// there.
fn other_side(
    adjacency: &Adjacency,
    lay: &Layout,
    gates: &[Gate],
    &Turn { bend, gates: [first, last], arms: [before, after] }: &Turn,
    around: &mut dyn FnMut(u32) -> f64,
) -> Option<Vec<u32>> {
    let (own, far) = if bend.on_left { (&lay.left, &lay.right) } else { (&lay.right, &lay.left) };
    let w = own[bend.portal].0;
    if before == bend.at || after == bend.at || adjacency.is_boundary_vertex(w) {
        return None;
    }
    let mut inside = 0.0;
    let mut arm = before - bend.at;
    for x in (first..=last).map(|i| far[i].1).chain([after]) {
        let edge = x - bend.at;
        inside += arm.perp_dot(edge).abs().atan2(arm.dot(edge));
        arm = edge;
    }
    if around(w) - inside >= std::f64::consts::PI - STRAIGHT {
        return None;
    }
    let goal = adjacency.opposite[gates[last].half_edge as usize] / 3;
    let mut crossed = Vec::new();
    let entry = gates[first].half_edge;
    let mut out = if bend.on_left { next(entry) } else { previous(entry) };
    for _ in 0..3 * (last - first) + 64 {
        crossed.push(out);
        let g = adjacency.opposite[out as usize];
        if g == NONE {
            return None;
        }
        if g / 3 == goal {
            return Some(crossed);
        }
        out = if bend.on_left { next(g) } else { previous(g) };
    }
    // A vertex with a great many faces.
    None
}

/// The places where the way crosses the half-edges of its strip.
fn places(
    mesh: &TriMesh,
    from: &FacePoint,
    gates: &[Gate],
    to: &FacePoint,
    lay: &Layout,
    bends: &[Bend],
) -> Vec<FacePoint> {
    let mut out = vec![*from];
    let mut last_vertex = vertex_of(mesh, from);
    let (mut a, mut bend) = (lay.start, 0);
    for (i, h) in gates.iter().map(|g| g.half_edge).enumerate() {
        while bend < bends.len() && bends[bend].portal < i {
            a = bends[bend].at;
            bend += 1;
        }
        let b = bends.get(bend).map_or(lay.end, |b| b.at);
        let (l, r) = (lay.left[i].1, lay.right[i].1);
        let share = if l == a || l == b {
            0.0
        } else if r == a || r == b {
            1.0
        } else {
            let d = b - a;
            let over = (r - l).perp_dot(d);
            let s = (a - l).perp_dot(d) / over;
            if s.is_finite() { s.clamp(0.0, 1.0) } else { 0.5 }
        };
        let k = if share <= AT_VERTEX {
            Some(next(h))
        } else if share >= 1.0 - AT_VERTEX {
            Some(h)
        } else {
            None
        };
        let place = match k {
            Some(k) => FacePoint::corner(k / 3, k as usize % 3),
            None => {
                let mut bary = [0.0; 3];
                bary[h as usize % 3] = share;
                bary[next(h) as usize % 3] = 1.0 - share;
                FacePoint { face: h / 3, bary }
            }
        };
        let vertex = k.map(|k| mesh.origin(k));
        if vertex.is_none() || vertex != last_vertex {
            out.push(place);
        }
        last_vertex = vertex;
    }
    if last_vertex.is_none() || vertex_of(mesh, to) != last_vertex || out.len() == 1 {
        out.push(*to);
    } else if let Some(last) = out.last_mut() {
        *last = *to;
    }
    out
}

/// Shortest chain of edges between two vertices that lie near each other (A*); memory grows with what is visited.
fn local_path(mesh: &TriMesh, adjacency: &Adjacency, from: u32, to: u32) -> Option<Vec<u32>> {
    let goal = mesh.points[to as usize];
    let mut search = Search::sparse();
    search.reach(from, 0.0, NONE);
    while let Some((v, distance)) = search.settle() {
        if v == to {
            let mut chain = search.reached.chain(to);
            chain.reverse();
            return Some(chain);
        }
        let p = mesh.points[v as usize];
        for (w, _) in neighbours(mesh, adjacency, v) {
            let q = mesh.points[w as usize];
            search.reach_towards(w, distance + p.distance(q), v, q.distance(goal));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::shapes;
    use glam::DVec3;

    #[test]
    fn a_way_over_a_flat_sheet_is_the_straight_segment_within_1e_12() {
        let mesh = shapes::rectangle(2.0, 1.0, 23, 17);
        let adjacency = Adjacency::new(&mesh);
        for k in 0..40u32 {
            let faces = mesh.triangles.len() as u32;
            let at = |i: u32| FacePoint { face: i * 7919 % faces, bary: [0.2, 0.3, 0.5] };
            let (p, q) = (at(k + 1), at(3 * k + 5));
            let way = connect(&mesh, &adjacency, p, q).unwrap();
            let straight = p.position(&mesh).distance(q.position(&mesh));
            assert!((length(&mesh, &way) - straight).abs() < 1e-12, "{k}");
        }
    }

    #[test]
    fn a_way_over_a_cube_unfolds_to_the_straight_line_of_length_root_5() {
        // From the middle of a lower edge of one face over the opposite upper edge of the next: 1 across, 2 up.
        let mesh = shapes::cuboid(DVec3::ONE, 6);
        let adjacency = Adjacency::new(&mesh);
        let find = |p: DVec3| {
            let v = (0..mesh.points.len())
                .min_by(|&a, &b| mesh.points[a].distance(p).total_cmp(&mesh.points[b].distance(p)));
            let h = adjacency.outgoing[v.unwrap()];
            FacePoint::corner(h / 3, h as usize % 3)
        };
        let low = mesh.bounds();
        let (a, b) = (low.min, low.max);
        let p = find(a);
        let q = find(b);
        let way = connect(&mesh, &adjacency, p, q).unwrap();
        assert!((length(&mesh, &way) - 5f64.sqrt()).abs() < 1e-12, "{}", length(&mesh, &way));
    }

    #[test]
    fn neighbours_of_a_way_share_a_face_and_ends_are_kept() {
        let mesh = shapes::double_torus(6);
        let adjacency = Adjacency::new(&mesh);
        let faces = mesh.triangles.len() as u32;
        for k in 0..60u32 {
            let p = FacePoint { face: (k * 104_729) % faces, bary: [0.1, 0.3, 0.6] };
            let q = FacePoint { face: (k * 7_907 + 13) % faces, bary: [0.5, 0.5, 0.0] };
            let way = connect(&mesh, &adjacency, p, q).unwrap();
            assert_eq!((way[0], way[way.len() - 1]), (p, q));
            for pair in way.windows(2) {
                let faces = |x: &FacePoint| -> Vec<u32> {
                    let near: Vec<usize> = (0..3).filter(|&k| x.bary[k] > 0.0).collect();
                    let t = mesh.triangles[x.face as usize];
                    match near[..] {
                        [i] => adjacency.fan(t[i]).map(|h| h / 3).collect(),
                        [i, j] => (0..faces)
                            .filter(|&f| [t[i], t[j]].iter().all(|v| mesh.triangles[f as usize].contains(v)))
                            .collect(),
                        _ => vec![x.face],
                    }
                };
                let other = faces(&pair[1]);
                assert!(faces(&pair[0]).iter().any(|f| other.contains(f)), "{k}");
            }
        }
    }

    #[test]
    fn a_way_from_an_edge_over_a_rough_surface_never_turns_back_by_more_than_90_degrees() {
        let mut mesh = shapes::sphere(1.0, 4);
        for (k, p) in mesh.points.iter_mut().enumerate() {
            *p *= 1.0 + 0.004 * ((k as f64 * 12.9898).sin() * 43_758.545_3).fract();
        }
        let adjacency = Adjacency::new(&mesh);
        let faces = mesh.triangles.len() as u32;
        for k in 0..3000u32 {
            let mut bary = [0.0, 0.5070568822340139, 0.4929431177659861];
            bary.rotate_left(k as usize % 3);
            let p = FacePoint { face: k * 1031 % faces, bary };
            // Some faces on, over an edge or a vertex.
            let fan: Vec<u32> = adjacency.fan(mesh.triangles[p.face as usize][k as usize / 3 % 3]).collect();
            let h = previous(adjacency.opposite[fan[k as usize % fan.len()] as usize]);
            let q = FacePoint { face: adjacency.opposite[h as usize] / 3, bary: [0.0, 0.5, 0.5] };
            let way = connect(&mesh, &adjacency, p, q).unwrap();
            let at: Vec<DVec3> = way.iter().map(|x| x.position(&mesh)).collect();
            for w in at.windows(3) {
                let (d, e) = (w[1] - w[0], w[2] - w[1]);
                let short = d.length().min(e.length()) < 1e-9;
                assert!(short || d.angle_between(e).to_degrees() < 90.0, "{k}: {way:?}");
            }
        }
    }
}
