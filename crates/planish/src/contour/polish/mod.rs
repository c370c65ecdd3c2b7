//! Feature vertices that belong outside their cell are brought there, if exact signs allow it.
//!
//! A sharp edge may poke through a face of a cell without changing the side of a node: the hits then show two
//! surfaces that meet beyond the cell, and the certified mesh has a vertex that was clamped ([K01] lets it lie outside,
//! and folds can follow). Here it is moved after all. A line that passes close to an edge of the lattice is clamped in
//! the cell on its wrong side, in three vertices where one would do: they move together, or are merged along the line.
//! Each step is kept only if the mesh stays embedded ([`Local`]), so the certificate holds.
//!
//! 1. corners of the source that no vertex took     2. vertices that were clamped: together, one by one, merged
//! 3. what is left: a part of the way     4. lines that follow those of the source, with new vertices where one was
//!    missed, loose ends joined ([`super::polish::lines`])
//! 5. triangles without area: merged away

mod lines;
pub(crate) mod local;
mod refine;

pub use refine::FieldCreases;

use super::cell::face::Wish;
use super::polish::lines::{Lines, TAKEN, follow, insert_missing, join_ends};
use super::polish::local::{CellRange, GONE, Lean, Local};
use crate::field::{Creases, Directed};
use crate::geom::KdTree;
use crate::mesh::{DEGENERATE_AREA, FeatureKind, FeatureTags, TriMesh};
use glam::DVec3;
use std::collections::{BTreeSet, HashMap};

/// Parts of the way that are tried in the end.
const WAYS: [f64; 3] = [1.0, 0.6, 0.3];
/// Rounds: a neighbour that moved may make room.
const MOVE_ROUNDS: usize = 8;
/// So many vertices move together at most.
const TOGETHER: usize = 24;
/// A corner calls vertices of lines from this distance, in cells, and so many of them at most.
const CALL: f64 = 0.9;
const CALLED: usize = 4;
/// In the end a corner calls any vertex from this distance, in cells.
const CALL_ANY: f64 = 0.5;

/// What was done.
#[derive(Clone, Copy, Debug, Default)]
pub struct Polished {
    /// Feature vertices that came where they belong, also by being merged with one that is there.
    pub moved: usize,
    /// Feature vertices that did not.
    pub kept: usize,
}

/// What the source knows of its sharp lines, and what counts as sharp.
pub struct Source<'a> {
    /// Its corners and lines, if it lists them.
    pub creases: Option<&'a dyn Creases>,
    /// Cosine below which two normals make a feature.
    pub sharp: f64,
}

/// Brings the vertices of `wishes` to their places, and merges triangles without area away.
/// * `tags` - the features; changed along with the mesh, edges in any order
/// * `cells` - makes the list of all cells with triangles, in the order of z, y, x
pub fn polish(
    mesh: &mut TriMesh,
    tags: &mut FeatureTags,
    field: &Directed,
    wishes: &[Wish],
    cells: impl FnOnce() -> Vec<CellRange>,
    source: &Source,
) -> Polished {
    let size = field.lattice.step.max_element();
    let mut lines = Lines::new(std::mem::take(tags), size);
    let creases = source.creases;
    let corners = creases.map(|c| c.corners()).unwrap_or_default();
    let crowded = creases.map(|c| c.crowded()).unwrap_or_default();
    let on_lines = (0..lines.kinds.len()).filter(|&v| lines.kinds[v] != FeatureKind::None);
    let (calls, untaken) = calls(&corners, size, CALL, on_lines.map(|v| (v as u32, mesh.points[v])));
    let thin = thin(mesh);
    let mut seeds: Vec<u32> = wishes.iter().map(|w| w.0).collect();
    seeds.extend(calls.iter().flat_map(|c| &c.1));
    seeds.extend(thin.iter().flat_map(|&t| mesh.triangles[t as usize]));
    let places: Vec<DVec3> = untaken.iter().copied().chain(crowded.iter().map(|c| c.0)).collect();
    seeds.extend(beside_places(&mesh.points, field.lattice.origin.z, &places, size));
    for (v, beside) in lines.special() {
        // A corner may call the next vertices of the lines.
        seeds.push(v);
        seeds.extend(beside.iter().flat_map(|&w| lines.beside(w)).chain(beside));
    }
    if seeds.is_empty() {
        *tags = lines.into_tags();
        return Polished::default();
    }
    let mut local = Local::new(mesh, field, cells(), &seeds);
    let mut targets: HashMap<u32, DVec3> = wishes.iter().copied().collect();
    let count = targets.len();
    let mut open: Vec<u32> = wishes.iter().map(|w| w.0).collect();
    open.sort_unstable();
    open.dedup();

    answer(&mut local, &mut lines, &calls, &mut targets, &mut open);
    make_room(&mut local, &mut lines, &targets, &mut open);
    let asked = corners.is_empty();
    let (corners, mut came) = match creases {
        Some(creases) if asked => (ask_corners(&mut local, &mut lines, creases, &mut open), Vec::new()),
        _ if asked => Default::default(),
        _ => (corners, call_again(&mut local, &mut lines, &untaken, &mut open)),
    };
    approach(&mut local, &targets, &mut open);
    let kept = open.len();
    gather(&mut local, &mut lines, &corners);
    if let Some(creases) = creases.filter(|_| !asked) {
        came.extend(insert_missing(&mut local, &mut lines, &crowded));
        follow(&mut local, &mut lines, source.sharp, creases, &corners, &came);
    }
    join_ends(&mut local, &mut lines, source.sharp);
    merge_thin(&mut local, &mut lines, thin);

    mesh.triangles.retain(|t| *t != GONE);
    *tags = lines.into_tags();
    Polished { moved: count.saturating_sub(kept), kept }
}

/// The points within a cell's size of some places: any of them may be needed there.
/// * `bottom` - z at which the layers of cells begin
fn beside_places(points: &[DVec3], bottom: f64, places: &[DVec3], size: f64) -> Vec<u32> {
    if places.is_empty() {
        return Vec::new();
    }
    // Places by layers of their size: most points are near none.
    let layer = |p: &DVec3| ((p.z - bottom) / size).floor().max(0.0) as usize;
    let mut layers: Vec<Vec<DVec3>> = vec![Vec::new(); places.iter().map(layer).max().unwrap_or(0) + 2];
    for p in places {
        let at = layer(p);
        layers[at.saturating_sub(1)..=at + 1].iter_mut().for_each(|layer| layer.push(*p));
    }
    let near = |p: &DVec3| layers.get(layer(p)).is_some_and(|l| l.iter().any(|c| c.distance(*p) < size));
    (0..points.len()).filter(|&v| near(&points[v])).map(|v| v as u32).collect()
}

/// The first vertex that each corner calls comes there; if none has room, the nearest is to come later.
fn answer(
    local: &mut Local,
    lines: &mut Lines,
    calls: &[(DVec3, Vec<u32>)],
    targets: &mut HashMap<u32, DVec3>,
    open: &mut Vec<u32>,
) {
    let mut arrived: Vec<u32> = Vec::new();
    for (p, vertices) in calls {
        let free = |v: u32, arrived: &[u32]| !arrived.contains(&v);
        if let Some(&v) = vertices.iter().find(|&&v| free(v, &arrived) && local.shift(&[(v, *p)], Lean::NoMore)) {
            lines.kinds[v as usize] = FeatureKind::Corner;
            arrived.push(v);
            open.retain(|&o| o != v);
        } else if let Some(&v) = vertices.iter().find(|&&v| free(v, &arrived)) {
            lines.kinds[v as usize] = FeatureKind::Corner;
            targets.insert(v, *p);
            if open.binary_search(&v).is_err() {
                open.push(v);
                open.sort_unstable();
            }
        }
    }
}

/// Vertices go where they belong: together, one by one, merged along their lines, with flips; again while some come.
fn make_room(local: &mut Local, lines: &mut Lines, targets: &HashMap<u32, DVec3>, open: &mut Vec<u32>) {
    let [mut single, mut merged, mut flipped] =
        [(); 3].map(|()| Tried { names: open.clone(), at: vec![None; open.len()] });
    for _ in 0..MOVE_ROUNDS {
        let before = open.len();
        together(local, lines, targets, open);
        open.retain(|&v| !single.again(local, lines, targets, v) || !local.shift(&[(v, targets[&v])], Lean::NoMore));
        merge_along(local, lines, targets, open, &mut merged);
        open.retain(|&v| {
            let fixed = |a: u32, b: u32| lines.beside(a).contains(&b);
            !flipped.again(local, lines, targets, v) || !local.flip_and_shift(v, targets[&v], fixed)
        });
        if open.is_empty() || open.len() == before {
            break;
        }
    }
}

/// Corners of the source that no vertex is at, each with the nearest of some vertices; and also those that have none of
/// them within `reach` cells.
fn calls(
    corners: &[DVec3],
    size: f64,
    reach: f64,
    vertices: impl Iterator<Item = (u32, DVec3)>,
) -> (Vec<(DVec3, Vec<u32>)>, Vec<DVec3>) {
    if corners.is_empty() {
        return Default::default();
    }
    let tree = KdTree::new(corners);
    let mut near: Vec<Vec<(f64, u32)>> = vec![Vec::new(); corners.len()];
    for (v, at) in vertices {
        tree.within(at, reach * size, |c, p, _| near[c as usize].push((at.distance(p), v)));
    }
    near.iter_mut().for_each(|near| near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))));
    let taken: BTreeSet<u32> = near.iter().flatten().filter(|n| n.0 <= TAKEN * size).map(|n| n.1).collect();
    let (mut calls, mut untaken) = (Vec::new(), Vec::new());
    for (&p, near) in corners.iter().zip(near) {
        if near.first().is_none_or(|n| n.0 > TAKEN * size) {
            untaken.push(p);
        }
        if near.first().is_some_and(|n| n.0 > TAKEN * size) {
            calls.push((p, near.iter().map(|n| n.1).filter(|v| !taken.contains(v)).take(CALLED).collect()));
        }
    }
    (calls, untaken)
}

/// Corners of the source that no vertex is at yet call once more: first vertices of lines, which have come nearer since,
/// then any. Returns those that came.
fn call_again(local: &mut Local, lines: &mut Lines, corners: &[DVec3], open: &mut Vec<u32>) -> Vec<u32> {
    let mut came = Vec::new();
    let mut ask = |local: &mut Local, lines: &mut Lines, calls: Vec<(DVec3, Vec<u32>)>| {
        for (p, vertices) in calls {
            let fixed = |a: u32, b: u32| lines.beside(a).contains(&b);
            let first = vertices
                .into_iter()
                .find(|&v| local.shift(&[(v, p)], Lean::NoMore) || local.flip_and_shift(v, p, fixed));
            if let Some(v) = first {
                lines.kinds[v as usize] = FeatureKind::Corner;
                open.retain(|&o| o != v);
                came.push(v);
            }
        }
    };
    let on_lines = lines.vertices().map(|(v, _)| (v, local.position(v)));
    let (again, untaken) = calls(corners, lines.size, CALL, on_lines);
    ask(local, lines, again);
    if !untaken.is_empty() {
        let all = (0..local.mesh.points.len() as u32).filter(|&v| !local.star(v).is_empty());
        let (again, _) = calls(&untaken, lines.size, CALL_ANY, all.map(|v| (v, local.position(v))));
        ask(local, lines, again);
    }
    came
}

/// When vertices were tried in vain: only what changes near a vertex can make room for it.
struct Tried {
    names: Vec<u32>,
    /// For each the number of changes that there were.
    at: Vec<Option<usize>>,
}

impl Tried {
    /// True if `v` was not tried yet, or something changed near it since; it counts as tried now.
    fn again(&mut self, local: &Local, lines: &Lines, targets: &HashMap<u32, DVec3>, v: u32) -> bool {
        let Ok(n) = self.names.binary_search(&v) else { return true };
        let places = lines.beside(v).iter().chain([&v]).filter_map(|w| targets.get(w).copied());
        let again = self.at[n].is_none_or(|since| local.changed(since, v, places));
        self.at[n] = Some(local.changes());
        again
    }
}

/// Neighbours on a line move together.
fn together(local: &mut Local, lines: &Lines, targets: &HashMap<u32, DVec3>, open: &mut Vec<u32>) {
    let mut seen: BTreeSet<u32> = BTreeSet::new();
    let mut arrived: BTreeSet<u32> = BTreeSet::new();
    for &first in open.iter() {
        if seen.contains(&first) {
            continue;
        }
        let mut group = vec![first];
        let mut at = 0;
        while at < group.len() {
            for &w in lines.beside(group[at]) {
                if open.binary_search(&w).is_ok() && !group.contains(&w) && !seen.contains(&w) && group.len() < TOGETHER
                {
                    group.push(w);
                }
            }
            at += 1;
        }
        seen.extend(&group);
        if group.len() > 1 {
            let moves: Vec<(u32, DVec3)> = group.iter().map(|&v| (v, targets[&v])).collect();
            if local.shift(&moves, Lean::NoMore) {
                arrived.extend(group);
            }
        }
    }
    open.retain(|v| !arrived.contains(v));
}

/// Vertices that find no room are merged with their neighbours on the line.
fn merge_along(
    local: &mut Local,
    lines: &mut Lines,
    targets: &HashMap<u32, DVec3>,
    open: &mut Vec<u32>,
    tried: &mut Tried,
) {
    let mut at = 0;
    while at < open.len() {
        let v = open[at];
        if !tried.again(local, lines, targets, v) {
            at += 1;
            continue;
        }
        let is_corner = |v: u32| lines.kinds[v as usize] == FeatureKind::Corner;
        let is_open = |v: u32, open: &[u32]| open.binary_search(&v).is_ok();
        let mut done = false;
        for w in lines.beside(v).to_vec() {
            if is_corner(v) {
                // Others make room for a corner.
                if !is_corner(w) && local.merge(w, v, targets[&v]) {
                    lines.merge(w, v);
                    open.retain(|&o| o != w && o != v);
                    done = true;
                    break;
                }
                continue;
            }
            let places = if is_open(w, open) {
                let own = (!is_corner(w)).then(|| targets[&v]);
                [Some(targets[&w]), own]
            } else {
                [Some(local.position(w)), None]
            };
            if places.into_iter().flatten().any(|p| local.merge(v, w, p)) {
                lines.merge(v, w);
                open.retain(|&o| o != w && o != v);
                done = true;
                break;
            }
        }
        if !done {
            at += 1;
        } else {
            at = at.min(open.len());
        }
    }
}

/// A part of the way, also where triangles lean for a while; where they stay turned the vertex goes back.
fn approach(local: &mut Local, targets: &HashMap<u32, DVec3>, open: &mut Vec<u32>) {
    let starts: Vec<(u32, DVec3)> = open.iter().map(|&v| (v, local.position(v))).collect();
    for _ in 0..MOVE_ROUNDS {
        let before = open.len();
        open.retain(|&v| {
            let (start, target) = (local.position(v), targets[&v]);
            !WAYS.into_iter().any(|way| {
                let p = if way == 1.0 { target } else { start.lerp(target, way) };
                local.shift(&[(v, p)], Lean::Any) && way == 1.0
            })
        });
        if open.len() == before {
            break;
        }
    }
    for _ in 0..MOVE_ROUNDS {
        let mut back = false;
        for &(v, start) in &starts {
            let here = local.position(v);
            let turned = local.turned(v);
            if turned == 0 || here == start || local.star(v).is_empty() {
                continue;
            }
            if local.shift(&[(v, start)], Lean::Any) {
                if local.turned(v) >= turned {
                    local.shift(&[(v, here)], Lean::Any);
                    continue;
                }
                back = true;
                if !open.contains(&v) {
                    open.push(v);
                }
            }
        }
        if !back {
            break;
        }
    }
}

/// Asks the source for the corners near vertices where lines end, meet or seem to have a corner, and brings the nearest
/// vertex of a line there. Returns the corners.
fn ask_corners(local: &mut Local, lines: &mut Lines, creases: &dyn Creases, open: &mut Vec<u32>) -> Vec<DVec3> {
    let size = lines.size;
    let special: Vec<u32> = lines.special().map(|(v, _)| v).collect();
    let mut corners: Vec<DVec3> = Vec::new();
    for v in special {
        let mut ring = local.neighbours(v);
        ring.extend(ring.clone().iter().flat_map(|&w| local.neighbours(w)));
        ring.sort_unstable();
        ring.dedup();
        let hits: Vec<(DVec3, DVec3)> =
            ring.iter().filter_map(|&w| Some((local.position(w), local.normal(w)?))).collect();
        let Some(corner) = creases.corner_near(local.position(v), size, &hits) else { continue };
        if corners.iter().any(|c| c.distance(corner) < TAKEN * size) {
            continue;
        }
        corners.push(corner);
        let mut near: Vec<(f64, u32)> = ring
            .iter()
            .filter(|w| !lines.beside(**w).is_empty())
            .map(|&w| (local.position(w).distance(corner), w))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let taken = near.first().is_some_and(|n| n.0 < TAKEN * size);
        for &(_, w) in near.iter().take(CALLED).filter(|_| !taken) {
            if local.shift(&[(w, corner)], Lean::NoMore)
                || local.flip_and_shift(w, corner, |a, b| lines.beside(a).contains(&b))
            {
                lines.kinds[w as usize] = FeatureKind::Corner;
                open.retain(|&o| o != w);
                break;
            }
        }
    }
    corners
}

/// Vertices that pose as corners beside a corner of the source are merged into the one that is there.
fn gather(local: &mut Local, lines: &mut Lines, corners: &[DVec3]) {
    if corners.is_empty() {
        return;
    }
    let size = lines.size;
    let tree = KdTree::new(corners);
    // Distance of the nearest corner within reach.
    let off = |p: DVec3| {
        let mut least = f64::INFINITY;
        tree.within(p, (CALL + TAKEN) * size, |_, c, _| least = least.min(c.distance(p)));
        least
    };
    let mut posing: Vec<u32> = Vec::new();
    for v in lines.vertices().map(|(v, _)| v).collect::<Vec<_>>() {
        let off = off(local.position(v));
        if off < TAKEN * size {
            lines.kinds[v as usize] = FeatureKind::Corner;
        } else if off.is_finite() && lines.kinds[v as usize] == FeatureKind::Corner {
            posing.push(v);
        }
    }
    for v in posing {
        let p = local.position(v);
        // The vertex at the nearest corner, if there is one within reach of a flip.
        let mut ring = local.neighbours(v);
        ring.extend(
            local
                .star(v)
                .to_vec()
                .iter()
                .flat_map(|&t| local.mesh.triangles[t as usize])
                .flat_map(|w| local.neighbours(w))
                .collect::<Vec<_>>(),
        );
        ring.sort_unstable();
        ring.dedup();
        let taken = |w: u32| lines.kinds[w as usize] == FeatureKind::Corner && off(local.position(w)) < TAKEN * size;
        let goal = ring
            .into_iter()
            .filter(|&w| w != v && taken(w) && local.position(w).distance(p) < CALL * size)
            .min_by(|a, b| local.position(*a).distance(p).total_cmp(&local.position(*b).distance(p)).then(a.cmp(b)));
        if let Some(w) = goal
            && local.flip_and_merge(v, w)
        {
            lines.merge(v, w);
        }
    }
}

/// Triangles that a task looks at.
const TRIANGLES_PER_CHUNK: usize = 1 << 14;

/// Triangles of next to no area.
fn thin(mesh: &TriMesh) -> Vec<u32> {
    use rayon::prelude::*;
    let least = 2.0 * DEGENERATE_AREA * mesh.bounds().diagonal().powi(2);
    let has_area = |t: &[u32; 3]| {
        let [a, b, c] = *t;
        let (a, b, c) = (mesh.points[a as usize], mesh.points[b as usize], mesh.points[c as usize]);
        (b - a).cross(c - a).length() / 2.0 > least
    };
    let parts: Vec<Vec<u32>> = mesh
        .triangles
        .par_chunks(TRIANGLES_PER_CHUNK)
        .enumerate()
        .map(|(n, part)| {
            (0..part.len()).filter(|&t| !has_area(&part[t])).map(|t| (n * TRIANGLES_PER_CHUNK + t) as u32).collect()
        })
        .collect();
    parts.concat()
}

/// Merges the ends of the shortest edge of each triangle without area.
fn merge_thin(local: &mut Local, lines: &mut Lines, thin: Vec<u32>) {
    for t in thin {
        let names = local.mesh.triangles[t as usize];
        if names == GONE {
            continue;
        }
        let mut sides: Vec<(f64, u32, u32)> = (0..3)
            .map(|k| (names[k], names[(k + 1) % 3]))
            .flat_map(|(a, b)| [(a, b), (b, a)])
            .map(|(a, b)| (local.position(a).distance(local.position(b)), a, b))
            .collect();
        sides.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, v, w) in sides {
            let free = match lines.kinds[v as usize] {
                FeatureKind::None => true,
                FeatureKind::Edge => lines.beside(v).contains(&w),
                FeatureKind::Corner => false,
            };
            if free && local.merge(v, w, local.position(w)) {
                lines.merge(v, w);
                break;
            }
        }
    }
}
