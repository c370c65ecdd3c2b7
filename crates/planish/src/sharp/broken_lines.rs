//! Sharp lines that noise broke: gaps are bridged; spurs, spikes and jogs are cut.
//!
//! Noise hides a few edges of a line, or shifts it by an edge. A gap costs more than its length: a line with a loose end is
//! taken for surface detail, or two patches run into one another there. Four greedy repairs, each to its fixed point:
//! `docs/methods/layout.md`, step 1.

use crate::geom::graph::{Reached, Search};
use crate::mesh::disjoint::disjoint;
use crate::mesh::{Adjacency, NONE, TriMesh, next, path, previous};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use std::collections::BTreeMap;

/// Greatest cost of a bridge over a gap, edges ([`Fineness`]): a sharp edge costs its length, a flat one twice that.
const WIDEST_GAP: f64 = 8.0;
/// Factor on the cost of a bridge to the middle of a line or to the boundary: a line may as well end in the open there.
const SIDE_TARGET_FACTOR: f64 = 2.0;
/// A line must be this many times as long as its bridge costs; nor does a bridge lead to a place on its own line nearer than that.
const LINE_PER_GAP: f64 = 3.0;
/// Length over which the direction of a line at its end is taken, edges; so many of its edges tell how long they are.
const LAST: f64 = 4.0;
/// Cosine of the greatest angle (50 degrees) between a bridge and the direction in which its line ends; bridges shorter than
/// `SHORTEST` edges may have any.
const AHEAD: f64 = 0.64;
const SHORTEST: f64 = 1.5;
/// A branch with a loose end shorter than this, edges, is a spur.
const SPUR: f64 = 1.5;
/// A last edge shorter than this share of an edge tells no direction: noise turns it anywhere.
const STUB: f64 = 0.2;
/// A line that comes back within this angle around a single face is a spike.
const SPIKE_ANGLE: f64 = 80.0 / 180.0 * std::f64::consts::PI;

/// A line that leaves its way for up to so many edges on each side of a vertex, and comes back to within an edge, is cut short
/// if that costs less than this share of the way: less than at the corner of a face of 20 degrees, whose own edges are bent.
const JOG: usize = 3;
const JOG_COST: f64 = 0.35;

/// How long edges are at the end of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fineness {
    /// As in the mean of the mesh: meshes of scans are even.
    OfMesh,
    /// As the last edges of the line, and no longer than in the mean of the mesh: in meshes of CAD programs lines are as fine as they
    /// bend, whatever the faces beside.
    OfLine,
}

/// The last part of a line with a loose end.
struct End {
    /// Its vertices from the end on, with their distances along the line.
    tail: Vec<(u32, f64)>,
    /// Where the line would go on; a unit vector.
    direction: DVec3,
    /// How long edges are there.
    edge: f64,
}

struct Bridge {
    cost: f64,
    vertices: Vec<u32>,
}

/// The half-edges on sharp lines that leave each vertex.
fn lines_at(mesh: &TriMesh, sharp: &[bool]) -> BTreeMap<u32, Vec<u32>> {
    let mut lines: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for h in (0..sharp.len() as u32).filter(|&h| sharp[h as usize]) {
        lines.entry(mesh.origin(h)).or_default().push(h);
    }
    lines
}

/// The half-edges on sharp lines that leave each vertex, and the loose ends of these lines.
fn loose_ends(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    sharp: &[bool],
    (fineness, mean_edge): (Fineness, f64),
) -> (BTreeMap<u32, Vec<u32>>, BTreeMap<u32, End>) {
    let lines = lines_at(mesh, sharp);
    let loose = |v: &u32| lines[v].len() == 1 && !adjacency.is_boundary_vertex(*v);
    let ends =
        lines.keys().copied().filter(loose).map(|v| (v, End::new(mesh, &lines, v, (fineness, mean_edge)))).collect();
    (lines, ends)
}

/// Clears or marks the edges between vertices of a chain.
fn mark(mesh: &TriMesh, adjacency: &Adjacency, chain: &[u32], sharp: &mut [bool], is_sharp: bool) {
    for pair in chain.windows(2) {
        let between = path::neighbours(mesh, adjacency, pair[0]).find(|n| n.0 == pair[1]);
        let (_, h) = between.expect("a chain runs along edges");
        sharp[h as usize] = is_sharp;
        sharp[adjacency.opposite[h as usize] as usize] = is_sharp;
    }
}

/// Clears spurs, the shortest at each fork first: without it the fork is one line again, and the other end of a gap may be led on
/// to it. Clears last edges of loose ends that are next to nothing, too.
fn cut_spurs(mesh: &TriMesh, adjacency: &Adjacency, edges: (Fineness, f64), sharp: &mut [bool]) {
    loop {
        let (lines, ends) = loose_ends(mesh, adjacency, sharp, edges);
        let mut spurs: BTreeMap<u32, &End> = BTreeMap::new();
        for end in ends.values().filter(|end| end.length() < SPUR * end.edge) {
            let fork = end.tail[end.tail.len() - 1].0;
            if lines[&fork].len() > 2 && spurs.get(&fork).is_none_or(|known| end.length() < known.length()) {
                spurs.insert(fork, end);
            }
        }
        let stubs = ends.values().filter(|end| end.tail[1].1 < STUB * end.edge).map(|end| &end.tail[..2]);
        let cut: Vec<&[(u32, f64)]> = spurs.values().map(|spur| &spur.tail[..]).chain(stubs).collect();
        if cut.is_empty() {
            return;
        }
        for tail in cut {
            mark(mesh, adjacency, &tail.iter().map(|t| t.0).collect::<Vec<u32>>(), sharp, false);
        }
    }
}

/// Leads loose ends of sharp lines on to the loose ends that face them, to a line ahead, or to the boundary, where these are
/// a few edges away; spurs are cut first. Returns how many gaps were bridged.
/// * `sharp` - for each half-edge whether it is on a sharp line; both halves of an edge alike
pub fn bridge_gaps(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    fineness: Fineness,
    sharp: &mut [bool],
    observer: &dyn Observer,
) -> Result<usize, Cancelled> {
    let edges = (fineness, mesh.mean_edge());
    cut_spurs(mesh, adjacency, edges, sharp);
    let mut bridged = 0;
    loop {
        let (lines, ends) = loose_ends(mesh, adjacency, sharp, edges);
        let mut bridges: Vec<Bridge> = Vec::new();
        for &v in ends.keys() {
            observer.check()?;
            bridges.extend(bridge(mesh, adjacency, &lines, &ends, v));
        }
        bridges.sort_by(|a, b| a.cost.total_cmp(&b.cost).then_with(|| a.vertices.cmp(&b.vertices)));
        // One at each place and time: others may lead elsewhere after it.
        let (now, _) = disjoint(bridges, |bridge| bridge.vertices.clone(), Some);
        now.iter().for_each(|bridge| mark(mesh, adjacency, &bridge.vertices, sharp, true));
        bridged += now.len();
        if now.is_empty() {
            return Ok(bridged);
        }
    }
}

impl End {
    fn new(mesh: &TriMesh, lines: &BTreeMap<u32, Vec<u32>>, v: u32, (fineness, mean_edge): (Fineness, f64)) -> End {
        let mut tail = vec![(v, 0.0)];
        let (mut h, mut along) = (lines[&v][0], 0.0);
        loop {
            along += mesh.edge_length(h);
            let to = mesh.origin(next(h));
            tail.push((to, along));
            let on = lines[&to].iter().find(|&&g| mesh.origin(next(g)) != mesh.origin(h));
            match on {
                Some(&g) if lines[&to].len() == 2 && along < LINE_PER_GAP * WIDEST_GAP * mean_edge && to != v => h = g,
                _ => break,
            }
        }
        let last = (LAST as usize).min(tail.len() - 1);
        let edge = match fineness {
            Fineness::OfMesh => mean_edge,
            Fineness::OfLine => mean_edge.min(tail[last].1 / last as f64),
        };
        let from = tail.iter().find(|t| t.1 >= LAST * edge).unwrap_or(&tail[tail.len() - 1]).0;
        let at = |v: u32| mesh.points[v as usize];
        End { direction: (at(v) - at(from)).normalize_or_zero(), tail, edge }
    }

    /// Length of the line, as far as it matters.
    fn length(&self) -> f64 {
        self.tail.last().map_or(0.0, |t| t.1)
    }

    fn leads_to(&self, way: DVec3) -> bool {
        way.length() <= SHORTEST * self.edge || way.dot(self.direction) > AHEAD * way.length()
    }
}

/// The cheapest bridge from the loose end `v`; `None` if nothing is in reach.
fn bridge(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    lines: &BTreeMap<u32, Vec<u32>>,
    ends: &BTreeMap<u32, End>,
    v: u32,
) -> Option<Bridge> {
    let end = &ends[&v];
    let at = |v: u32| mesh.points[v as usize];
    let reach = (WIDEST_GAP * end.edge).min(end.length() / LINE_PER_GAP);
    let mut search = Search::sparse();
    search.reach(v, 0.0, NONE);
    let mut best: Option<(f64, u32)> = None;
    while let Some((w, cost)) = search.settle() {
        if best.is_some_and(|b| b.0 <= cost) {
            break;
        }
        if w != v && (lines.contains_key(&w) || adjacency.is_boundary_vertex(w)) {
            let near = end.tail.iter().any(|t| t.0 == w && t.1 < LINE_PER_GAP * cost);
            let price = match ends.get(&w) {
                Some(other) if other.leads_to(at(v) - at(w)) && LINE_PER_GAP * cost <= other.length() => cost,
                _ => SIDE_TARGET_FACTOR * cost,
            };
            if !near && price <= reach && end.leads_to(at(w) - at(v)) && best.is_none_or(|b| price < b.0) {
                best = Some((price, w));
            }
            continue;
        }
        for (x, h) in path::neighbours(mesh, adjacency, w) {
            let cost = cost + mesh.edge_length(h) * (2.0 - bend(mesh, adjacency, h));
            if cost <= reach {
                search.reach(x, cost, w);
            }
        }
    }
    let (cost, target) = best?;
    Some(Bridge { cost, vertices: search.reached.chain(target) })
}

/// How much the surface bends at an edge: the sine of the angle there, 1 beyond a right angle.
fn bend(mesh: &TriMesh, adjacency: &Adjacency, h: u32) -> f64 {
    let o = adjacency.opposite[h as usize];
    if o == NONE {
        return 0.0;
    }
    let (m, n) = (mesh.normal(h as usize / 3), mesh.normal(o as usize / 3));
    if m.dot(n) < 0.0 { 1.0 } else { m.cross(n).length() }
}

/// Leads lines that turn back on themselves around a single face along its third edge instead, if the face is less
/// than `longest` around, and cuts jogs no longer than that around: edges of noise zigzag.
pub fn cut_spikes(mesh: &TriMesh, adjacency: &Adjacency, longest: f64, sharp: &mut [bool]) {
    cut_jogs(mesh, adjacency, longest, sharp);
    let mut degree = vec![0u32; mesh.points.len()];
    (0..sharp.len() as u32).filter(|&h| sharp[h as usize]).for_each(|h| degree[mesh.origin(h) as usize] += 1);
    let mut faces: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
    while !faces.is_empty() {
        let mut changed = Vec::new();
        for f in faces {
            for h in 3 * f..3 * f + 3 {
                let (g, third) = (previous(h), next(h));
                let across = adjacency.opposite[third as usize];
                let [tip, a, b] = [h, third, g].map(|h| mesh.origin(h));
                if !sharp[h as usize]
                    || !sharp[g as usize]
                    || sharp[third as usize]
                    || across == NONE
                    || degree[tip as usize] != 2
                    || adjacency.is_boundary_vertex(tip)
                {
                    continue;
                }
                let [p, q, r] = [tip, a, b].map(|v| mesh.points[v as usize]);
                if (q - p).angle_between(r - p) < SPIKE_ANGLE && p.distance(q) + q.distance(r) + r.distance(p) < longest
                {
                    sharp[h as usize] = false;
                    sharp[adjacency.opposite[h as usize] as usize] = false;
                    sharp[g as usize] = false;
                    sharp[adjacency.opposite[g as usize] as usize] = false;
                    sharp[third as usize] = true;
                    sharp[across as usize] = true;
                    degree[tip as usize] = 0;
                    changed.push(across / 3);
                }
            }
        }
        faces = changed;
    }
}

/// A detour of a line: what going straight saves, its half-edges, and the half-edge that takes their place.
type Jog = (f64, Vec<u32>, u32);

/// Cuts jogs: replaces detours of a few edges by the straight way, those first that cost most against it.
fn cut_jogs(mesh: &TriMesh, adjacency: &Adjacency, longest: f64, sharp: &mut [bool]) {
    let cost = |h: u32| mesh.edge_length(h) * (2.0 - bend(mesh, adjacency, h));
    loop {
        let lines = lines_at(mesh, sharp);
        // Half-edges from a vertex on, until the line ends or forks.
        let leg = |mut h: u32| {
            let mut leg = vec![h];
            while leg.len() < JOG {
                let back = adjacency.opposite[h as usize];
                match lines[&mesh.origin(next(h))][..] {
                    [a, b] if a == back || b == back => h = if a == back { b } else { a },
                    _ => break,
                }
                leg.push(h);
            }
            leg
        };
        let mut jogs: Vec<Jog> = Vec::new();
        for (v, out) in lines.iter().filter(|l| l.1.len() == 2 && !adjacency.is_boundary_vertex(*l.0)) {
            let legs = [leg(out[0]), leg(out[1])];
            for (i, &a) in legs[0].iter().enumerate() {
                let from = mesh.origin(next(a));
                for (to, h) in path::neighbours(mesh, adjacency, from) {
                    let Some(j) = legs[1].iter().position(|&b| mesh.origin(next(b)) == to) else { continue };
                    let detour = [&legs[0][..=i], &legs[1][..=j]].concat();
                    let way: f64 = detour.iter().map(|&h| mesh.edge_length(h)).sum::<f64>() + mesh.edge_length(h);
                    let saved = JOG_COST * detour.iter().map(|&h| cost(h)).sum::<f64>() - cost(h);
                    let is_free = !sharp[h as usize] && adjacency.opposite[h as usize] != NONE && to != *v;
                    if is_free && way < longest && saved > 0.0 {
                        jogs.push((saved, detour, h));
                    }
                }
            }
        }
        jogs.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
        let around = |jog: &Jog| jog.1.iter().flat_map(|&h| [mesh.origin(h), mesh.origin(next(h))]).collect();
        let (now, _) = disjoint(jogs, around, Some);
        for (_, detour, short) in &now {
            for (&h, is_sharp) in detour.iter().map(|h| (h, false)).chain([(short, true)]) {
                sharp[h as usize] = is_sharp;
                sharp[adjacency.opposite[h as usize] as usize] = is_sharp;
            }
        }
        if now.is_empty() {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::shapes;

    const CELLS: usize = 60;

    /// Half-edges of a sheet of 60 x 60 cells along chains of its vertices.
    fn lines(chains: &[&[(usize, usize)]]) -> (TriMesh, Adjacency, Vec<bool>) {
        let mesh = shapes::rectangle(1.0, 1.0, CELLS, CELLS);
        let adjacency = Adjacency::new(&mesh);
        let low = mesh.bounds().min;
        let vertex = |(i, j): (usize, usize)| {
            let p = low + DVec3::new(i as f64, j as f64, 0.0) / CELLS as f64;
            mesh.points.iter().position(|q| q.distance(p) < 1e-9).expect("a vertex there") as u32
        };
        let mut sharp = vec![false; adjacency.opposite.len()];
        for pair in chains.iter().flat_map(|c| c.windows(2)) {
            let (a, b) = (vertex(pair[0]), vertex(pair[1]));
            for h in 0..sharp.len() as u32 {
                let ends = (mesh.origin(h), mesh.origin(next(h)));
                sharp[h as usize] |= ends == (a, b) || ends == (b, a);
            }
        }
        (mesh, adjacency, sharp)
    }

    fn row(j: usize, from: usize, to: usize) -> Vec<(usize, usize)> {
        (from..=to).map(|i| (i, j)).collect()
    }

    fn bridged(chains: &[&[(usize, usize)]]) -> (usize, usize) {
        let (mesh, adjacency, mut sharp) = lines(chains);
        let before = sharp.iter().filter(|&&s| s).count() / 2;
        let count = bridge_gaps(&mesh, &adjacency, Fineness::OfLine, &mut sharp, &crate::Silent).unwrap();
        (count, sharp.iter().filter(|&&s| s).count() / 2 - before)
    }

    #[test]
    fn a_gap_of_three_edges_is_bridged_by_them_and_one_of_six_is_none() {
        assert_eq!(bridged(&[&row(30, 5, 25), &row(30, 28, 55)]), (1, 3));
        assert_eq!(bridged(&[&row(30, 5, 25), &row(30, 31, 55)]), (0, 0));
    }

    #[test]
    fn ends_that_face_elsewhere_and_lines_no_longer_than_the_gap_stay_apart() {
        // Both end at the same column, three edges apart, and go left.
        assert_eq!(bridged(&[&row(28, 5, 30), &row(31, 5, 30)]), (0, 0));
        assert_eq!(bridged(&[&row(30, 20, 25), &row(30, 28, 33)]), (0, 0));
    }

    #[test]
    fn an_end_right_before_a_line_leads_to_it() {
        let column: Vec<(usize, usize)> = (5..=55).map(|j| (31, j)).collect();
        assert_eq!(bridged(&[&row(30, 5, 30), &column]), (1, 1));
        assert_eq!(bridged(&[&row(30, 5, 27), &column]), (0, 0));
    }

    #[test]
    fn an_end_with_a_spur_beside_it_is_led_on_and_the_spur_goes() {
        // The line ends two edges before a column, and an edge of noise leaves it two edges before its end.
        let column: Vec<(usize, usize)> = (5..=55).map(|j| (31, j)).collect();
        let (mesh, adjacency, mut sharp) = lines(&[&row(30, 5, 30), &[(28, 30), (28, 31)], &column]);
        assert_eq!(bridge_gaps(&mesh, &adjacency, Fineness::OfLine, &mut sharp, &crate::Silent).unwrap(), 1);
        let degree = |i: usize, j: usize| {
            let p = mesh.bounds().min + DVec3::new(i as f64, j as f64, 0.0) / CELLS as f64;
            (0..sharp.len() as u32)
                .filter(|&h| sharp[h as usize] && mesh.points[mesh.origin(h) as usize].distance(p) < 1e-9)
                .count()
        };
        assert_eq!([degree(28, 30), degree(28, 31), degree(30, 30), degree(31, 30)], [2, 0, 2, 3]);
    }

    #[test]
    fn the_last_edge_of_an_end_goes_if_it_is_next_to_nothing() {
        let (mut mesh, adjacency, mut sharp) = lines(&[&row(30, 5, 30)]);
        let place = |i: usize| mesh.bounds().min + DVec3::new(i as f64, 30.0, 0.0) / CELLS as f64;
        let (last, before) = (place(30), place(29));
        let v = mesh.points.iter().position(|p| p.distance(last) < 1e-9).expect("a vertex there");
        let count = |sharp: &[bool]| sharp.iter().filter(|&&s| s).count() / 2;
        bridge_gaps(&mesh, &adjacency, Fineness::OfLine, &mut sharp, &crate::Silent).unwrap();
        assert_eq!(count(&sharp), 25);
        mesh.points[v] = before.lerp(last, 0.1);
        bridge_gaps(&mesh, &adjacency, Fineness::OfLine, &mut sharp, &crate::Silent).unwrap();
        assert_eq!(count(&sharp), 24);
    }

    #[test]
    fn a_line_of_fine_edges_between_large_faces_keeps_its_loose_end() {
        // Columns are ever closer: the first edge of the line is a hundred times shorter than the last.
        let mesh = shapes::sheet(20, 20, false, false, |u, v| DVec3::new(u.powi(3), v, 0.0));
        let adjacency = Adjacency::new(&mesh);
        let is_on_row = |v: u32| {
            let p = mesh.points[v as usize];
            (p.y - 0.5).abs() < 1e-9 && p.x > 1e-9
        };
        let halves = 0..adjacency.opposite.len() as u32;
        let mut sharp: Vec<bool> =
            halves.map(|h| is_on_row(mesh.origin(h)) && is_on_row(mesh.origin(next(h)))).collect();
        let before = sharp.clone();
        bridge_gaps(&mesh, &adjacency, Fineness::OfLine, &mut sharp, &crate::Silent).unwrap();
        let lost = before.iter().zip(&sharp).filter(|(before, after)| **before && !**after).count() / 2;
        assert_eq!((before.iter().filter(|s| **s).count() / 2, lost), (19, 0));
    }

    #[test]
    fn a_line_that_goes_back_beside_itself_is_led_straight_on() {
        let back = [(31, 31), (30, 31), (29, 31)];
        let (mesh, adjacency, mut sharp) = lines(&[&[row(30, 5, 31), back.to_vec(), row(32, 29, 55)].concat()]);
        let count = |sharp: &[bool]| sharp.iter().filter(|&&s| s).count() / 2;
        assert_eq!(count(&sharp), 26 + 1 + 2 + 1 + 26);
        cut_spikes(&mesh, &adjacency, 0.05, &mut sharp);
        assert_eq!(count(&sharp), 26 + 1 + 2 + 1 + 26, "what is longer than asked for stays");
        cut_spikes(&mesh, &adjacency, 0.2, &mut sharp);
        assert_eq!(count(&sharp), 24 + 2 + 26);
    }
}
