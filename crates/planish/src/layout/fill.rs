//! The best way to fill the union of a few cells with quads: every filling is drawn in the map of the union, and
//! what its cells cost is measured there.
//!
//! See `docs/methods/layout.md`, step 6.

use super::partition::polygon::{self, Sectors, VALENCE_COST};
use super::recut::{Bench, Change, Union, outline_with_cells};
use super::shape::{Shape, Trace, ground_cost};
use super::slide::Slide;
use crate::geom::polyline;
use crate::network::disk::Met;
use crate::network::imprint::Place;
use glam::{DVec2, DVec3};
use std::cell::RefCell;
use std::collections::BTreeMap;

/// Pressure on the number of patches: what one patch too many costs when there are a tenth too many.
const COUNT_COST: f64 = 2.0;

/// Steps of a node to a better place, as parts of the way along its arcs.
const NODE_STEPS: [f64; 2] = [0.35, 0.12];

/// A node is on flat ground if the surface is flat this far around it, in sides of a cell: half as far as directions of curves
/// are taken.
const GROUND_TO_SIDE: f64 = 0.1;

/// Whether it counts how flat the ground around a node is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Footing {
    Counts,
    /// As on coarse meshes: their edges are longer than that.
    Ignored,
}

/// What the layout is measured by.
pub(super) struct Scale<'a> {
    pub bench: &'a Bench<'a>,
    pub sectors: Sectors,
    /// Cost of every cell as it is.
    costs: Vec<f64>,
    mean_area: f64,
    /// What another patch costs.
    another: f64,
}

/// A filling and what it gains over the cells as they are.
pub(super) type Gain = (f64, Change);

impl<'a> Scale<'a> {
    pub fn new(bench: &'a Bench<'a>, patches: usize) -> Scale<'a> {
        let shapes = bench.shapes();
        let count = shapes.iter().flatten().count();
        let mean_area = shapes.iter().flatten().map(|s| s.area).sum::<f64>() / patches.max(1) as f64;
        let costs = shapes.iter().map(|s| s.as_ref().map_or(0.0, |s| s.cost(mean_area))).collect();
        let sectors = Sectors::new(bench.mesh, bench.adjacency, &bench.complex);
        let another = COUNT_COST * 10.0 * (count as f64 / patches.max(1) as f64).ln();
        Scale { bench, sectors, costs, mean_area, another }
    }

    /// The best filling of the union of `change` (its lines and spokes do not matter), if any is better than what is
    /// there. With a pin, it has a node there; otherwise it may have one or none.
    pub fn best(&self, change: &Change) -> Option<Gain> {
        let complex = &self.bench.complex;
        let around = outline_with_cells(complex, change)?;
        let n = around.len();
        if n < 4 || n % 2 == 1 || change.cells.iter().any(|&c| complex.loop_of(c).len() != 4) {
            return None;
        }
        let before = self.cost_of(change);
        let pin_before = change.center.map(|node| complex.nodes[node as usize]).filter(|n| n.stays).map(|n| n.vertex);
        let mut fill = Fill::new(self, change, &around)?;
        let mut best: Option<Gain> = None;
        for (lines, spokes) in fill.fillings(change) {
            let as_it_is =
                lines.is_empty() && !spokes.is_empty() && spokes == change.spokes && change.pin == pin_before;
            if let Some(cost) = fill.cost(&lines, &spokes).filter(|_| !as_it_is) {
                let gain = before - cost;
                if best.as_ref().is_none_or(|b| gain > b.0) {
                    best = Some((gain, Change { lines, spokes, ..change.clone() }));
                }
            }
        }
        best
    }

    /// What the cells of a change cost as they are.
    fn cost_of(&self, change: &Change) -> f64 {
        let complex = &self.bench.complex;
        let mut cost: f64 = change.cells.iter().map(|&c| self.costs[c as usize]).sum();
        cost += self.another * change.cells.len() as f64;
        if let Some(node) = change.center {
            // All arcs at the node are smooth and go: it has one sector.
            let arc = change.removed[0];
            let half = if complex.from(2 * arc) == node { 2 * arc } else { 2 * arc + 1 };
            cost += self.sectors.cost(self.sectors.of[half as usize], 0.0);
        }
        cost
    }

    /// What drawing the lines and spokes of `change` gains, its node, unless pinned, where it gains most.
    pub fn redrawn(&self, change: &Change, footing: Footing) -> Option<Gain> {
        let around = outline_with_cells(&self.bench.complex, change)?;
        let mut fill = Fill::new(self, change, &around)?;
        let n = around.len();
        let mut before = self.cost_of(change);
        let mut least = fill.cost(&change.lines, &change.spokes);
        let mut change = change.clone();
        if !change.spokes.is_empty() && change.pin.is_none() {
            let mut best = *fill.vertex.get(n)?;
            let radius = GROUND_TO_SIDE * (fill.area() / change.cells.len() as f64).sqrt();
            let ground = |fill: &Fill, v: u32| match footing {
                Footing::Counts => ground_cost(fill.flatness(v, radius)),
                Footing::Ignored => 0.0,
            };
            before += ground(&fill, fill.vertex_of(change.center?)?);
            least = least.map(|least| least + ground(&fill, best));
            let free = self.bench.embedding.free_vertices(&fill.union.disk);
            for step in NODE_STEPS {
                loop {
                    let from = fill.union.uv[best as usize];
                    let mut found = best;
                    for &corner in &change.spokes {
                        let target = from.lerp(fill.union.uv[fill.vertex[corner] as usize], step);
                        let far = |v: u32| fill.union.uv[v as usize].distance_squared(target);
                        let v = free.iter().copied().min_by(|&v, &w| far(v).total_cmp(&far(w)))?;
                        if v == found || v == best {
                            continue;
                        }
                        fill.move_node(v);
                        let cost = fill.cost(&change.lines, &change.spokes).map(|cost| cost + ground(&fill, v));
                        if let Some(cost) = cost.filter(|&c| least.is_none_or(|l| c < l)) {
                            (least, found) = (Some(cost), v);
                        }
                    }
                    if found == best {
                        break;
                    }
                    best = found;
                }
            }
            change.pin = Some(fill.union.disk.vertices[best as usize]);
        }
        Some((before - least?, change))
    }

    /// The place of its line where the cells of a slide cost least, and what they then cost less; `None` if that is where it is.
    pub fn slid(&self, slide: &Slide) -> Option<(f64, usize)> {
        let points = &self.bench.mesh.points;
        let along = polyline::arc_lengths(slide.line.iter().map(|&v| points[v as usize]));
        let last = along.len() - 1;
        let outlines = slide.sides.iter().map(|flank| outline_with_cells(&self.bench.complex, &flank.change));
        let outlines = outlines.collect::<Option<Vec<_>>>()?;
        let fills = slide.sides.iter().zip(&outlines).map(|(flank, around)| Fill::new(self, &flank.change, around));
        let mut fills = fills.collect::<Option<Vec<_>>>()?;
        let mut cost = |at: usize| -> Option<f64> {
            let costs = slide.sides.iter().zip(&mut fills).map(|(flank, fill)| {
                fill.move_corner(flank.corner, slide.position(&fill.union.disk, &fill.union.corners, flank, at)?);
                fill.cost(&flank.change.lines, &[])
            });
            costs.sum()
        };
        // As it would be drawn anew where it stands: arcs may have been straighter than in the map of a union.
        let before = cost(slide.at)?;
        let (mut least, mut best) = (before, slide.at);
        for step in NODE_STEPS {
            loop {
                let from = best;
                // Steps of the shorter way, at least to the next vertex: what is crowded spreads bit by bit, with its cells.
                let step = step * along[from].min(along[last] - along[from]);
                let back = (1..from).rev().find(|&i| along[i - 1] < along[from] - step);
                let ahead = (from + 1..last).find(|&i| along[i + 1] > along[from] + step);
                for at in back.into_iter().chain(ahead) {
                    if let Some(cost) = cost(at).filter(|cost| *cost < least) {
                        (least, best) = (cost, at);
                    }
                }
                if best == from {
                    break;
                }
            }
        }
        (best != slide.at).then_some((before - least, best))
    }

    /// What the sectors at the outline cost more when corner `i` goes from `cells[i]` cells to `now[i]`.
    fn sector_cost(&self, around: &[(u32, usize)], now: &[usize]) -> f64 {
        let mut more: BTreeMap<u32, f64> = BTreeMap::new();
        for (&(h, was), &now) in around.iter().zip(now) {
            *more.entry(self.sectors.of[h as usize]).or_default() += now as f64 - was as f64;
        }
        more.iter().map(|(&s, &m)| self.sectors.cost(s, m) - self.sectors.cost(s, 0.0)).sum()
    }
}

/// Lines between corners of an outline, and the corners joined to a node inside.
type Filling = (Vec<(usize, usize)>, Vec<usize>);

/// A triangle of a union.
struct Facet {
    /// Its middle in the map.
    uv: DVec2,
    middle: DVec3,
    /// Its normal, as long as its area.
    area: DVec3,
}

/// The union of a change, in which fillings are measured. Corners are numbered as in the outline; one past the last
/// is the node inside.
struct Fill<'a> {
    scale: &'a Scale<'a>,
    around: &'a [(u32, usize)],
    union: Union,
    /// Vertex of the disk of each corner; the node inside comes last.
    vertex: Vec<u32>,
    triangles: Vec<Facet>,
    traces: RefCell<BTreeMap<(usize, usize), Option<Trace>>>,
    costs: RefCell<BTreeMap<[usize; 4], f64>>,
}

impl<'a> Fill<'a> {
    fn new(scale: &'a Scale<'a>, change: &Change, around: &'a [(u32, usize)]) -> Option<Fill<'a>> {
        let embedding = &scale.bench.embedding;
        let union = embedding.map(&scale.bench.complex, change)?;
        let mut vertex: Vec<u32> = union.corners.iter().map(|&i| union.disk.boundary[i]).collect();
        vertex.extend(embedding.place_inside(&union, change.pin));
        let facet = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| embedding.position(&union, v));
            let uv = t.iter().map(|&v| union.uv[v as usize]).sum::<DVec2>() / 3.0;
            Facet { uv, middle: (a + b + c) / 3.0, area: (b - a).cross(c - a) / 2.0 }
        };
        let triangles = union.disk.triangles.iter().map(facet).collect();
        if change.pin.is_some() && vertex.len() == around.len() {
            return None;
        }
        Some(Fill { scale, around, union, vertex, triangles, traces: RefCell::default(), costs: RefCell::default() })
    }

    /// Moves the node inside to a vertex of the disk.
    fn move_node(&mut self, v: u32) {
        let n = self.around.len();
        self.vertex[n] = v;
        self.forget(n);
    }

    /// Moves a corner of the outline to a place of the boundary.
    fn move_corner(&mut self, corner: usize, place: usize) {
        self.union.corners[corner] = place;
        self.vertex[corner] = self.union.disk.boundary[place];
        self.forget(corner);
    }

    /// The vertex of the disk where a node of the complex stands.
    fn vertex_of(&self, node: u32) -> Option<u32> {
        let bench = self.scale.bench;
        let place = Place::Vertex(bench.complex.nodes[node as usize].vertex);
        let is_there = |v: &u32| bench.embedding.cut.origin[*v as usize] == place;
        self.union.disk.vertices.iter().position(is_there).map(|v| v as u32)
    }

    fn area(&self) -> f64 {
        self.triangles.iter().map(|t| t.area.length()).sum()
    }

    /// Length of the sum of all normals, by area, as a part of the area: of the triangles at a vertex, and of those within a
    /// distance of it.
    fn flatness(&self, v: u32, distance: f64) -> f64 {
        let (at, corners) = (self.position(v), &self.union.disk.triangles);
        let near = self.triangles.iter().zip(corners);
        let near = near.filter(|(own, t)| own.middle.distance_squared(at) < distance * distance || t.contains(&v));
        let (sum, area) =
            near.fold((DVec3::ZERO, 0.0), |(sum, all), (own, _)| (sum + own.area, all + own.area.length()));
        sum.length() / area.max(f64::MIN_POSITIVE)
    }

    /// Forgets what was measured with a corner.
    fn forget(&mut self, corner: usize) {
        self.traces.borrow_mut().retain(|&(i, j), _| i != corner && j != corner);
        self.costs.borrow_mut().retain(|quad, _| !quad.contains(&corner));
    }

    /// The fillings worth a look: the best one without a node inside, and those with one node, joined to every
    /// other corner of the outline, or of the outline less one quad.
    fn fillings(&mut self, change: &Change) -> Vec<Filling> {
        let n = self.around.len();
        let mut found: Vec<Filling> = Vec::new();
        if change.pin.is_none() {
            let extra: Vec<f64> = self
                .around
                .iter()
                .map(|&(h, was)| {
                    let s = self.scale.sectors.of[h as usize];
                    let base = 1.0 - was as f64;
                    self.scale.sectors.cost(s, base + 1.0) - self.scale.sectors.cost(s, base)
                })
                .collect();
            found.push((polygon::part_polygon(n, |quad| self.cell(quad), &extra), Vec::new()));
        }
        if n >= 6 && self.vertex.len() > n {
            let whole: Vec<usize> = (0..n).collect();
            for first in 0..2 {
                found.push((Vec::new(), whole.iter().copied().skip(first).step_by(2).collect()));
            }
            for ear in (0..n).filter(|_| n >= 8) {
                let rest: Vec<usize> =
                    whole.iter().copied().filter(|&i| i != (ear + 1) % n && i != (ear + 2) % n).collect();
                for first in 0..2 {
                    found.push((
                        vec![(ear.min((ear + 3) % n), ear.max((ear + 3) % n))],
                        rest.iter().copied().skip(first).step_by(2).collect(),
                    ));
                }
            }
        }
        found
    }

    /// What a filling costs; `None` if it cannot be drawn.
    fn cost(&self, lines: &[(usize, usize)], spokes: &[usize]) -> Option<f64> {
        let n = self.around.len();
        let mut now = vec![1; n];
        lines.iter().for_each(|&(i, j)| [i, j].into_iter().for_each(|i| now[i] += 1));
        spokes.iter().for_each(|&i| now[i] += 1);
        let mut faces: Vec<Vec<usize>> = vec![(0..n).collect()];
        let uv = |i: usize| self.union.uv[self.vertex[i] as usize];
        for &(i, j) in lines {
            // The node inside must not lie in the quad cut off.
            let side = |p: DVec2| (uv(j) - uv(i)).perp_dot(p - uv(i)) > 0.0;
            if !spokes.is_empty() && side(uv(n)) != spokes.iter().any(|&k| k != i && k != j && side(uv(k))) {
                return None;
            }
            let k = faces.iter().position(|f| f.contains(&i) && f.contains(&j))?;
            let mut face = faces.swap_remove(k);
            let start = face.iter().position(|&x| x == i)?;
            face.rotate_left(start);
            let mut rest = face.split_off(face.iter().position(|&x| x == j)?);
            face.push(j);
            rest.push(i);
            faces.extend([face, rest]);
        }
        let mut sum = 0.0;
        if !spokes.is_empty() {
            let k = faces.iter().position(|f| spokes.iter().all(|i| f.contains(i)))?;
            let face = faces.swap_remove(k);
            let m = face.len();
            let start = face.iter().position(|&x| x == spokes[0])?;
            for k in (0..m).step_by(2) {
                faces.push(vec![face[(start + k) % m], face[(start + k + 1) % m], face[(start + k + 2) % m], n]);
            }
            sum += VALENCE_COST * (spokes.len() as f64 - 4.0).powi(2);
        }
        sum += self.scale.another * faces.len() as f64;
        for face in &faces {
            let quad: [usize; 4] = face[..].try_into().ok()?;
            sum += self.cell(quad);
        }
        sum.is_finite().then(|| sum + self.scale.sector_cost(self.around, &now))
    }

    /// What the quad between four corners costs; infinite if it cannot be drawn.
    fn cell(&self, quad: [usize; 4]) -> f64 {
        let least = (0..4).min_by_key(|&k| quad[k]).unwrap_or(0);
        let quad = [0, 1, 2, 3].map(|k| quad[(least + k) % 4]);
        if let Some(&known) = self.costs.borrow().get(&quad) {
            return known;
        }
        let swallows = polygon::swallows(&self.union.outline, quad);
        let cost = self.shape(quad).filter(|_| !swallows).map_or(f64::INFINITY, |s| s.cost(self.scale.mean_area));
        self.costs.borrow_mut().insert(quad, cost);
        cost
    }

    fn shape(&self, quad: [usize; 4]) -> Option<Shape> {
        let n = self.around.len();
        let next = |k: usize| quad[(k + 1) % 4];
        let mut sides = [Trace::default(); 4];
        let mut chords: Vec<(DVec2, DVec2)> = Vec::new();
        let uv = |i: usize| self.union.uv[self.vertex[i] as usize];
        for k in 0..4 {
            sides[k] = self.trace(quad[k], next(k))?;
            if quad[k] == n || next(k) == n || next(k) != (quad[k] + 1) % n {
                chords.push((uv(quad[k]), uv(next(k))));
            }
        }
        let left = |(a, b): (DVec2, DVec2), p: DVec2| (b - a).perp_dot(p - a) > 0.0;
        // At the node inside the corner of a cell may be reflex: then one of its two sides is enough.
        let spokes: Vec<_> = (0..4).filter(|&k| quad[k] == n).map(|k| (quad[(k + 3) % 4], next(k))).collect();
        let reflex = spokes.iter().any(|&(before, after)| !left((uv(before), uv(n)), uv(after)));
        let (at_node, others): (Vec<_>, Vec<_>) =
            chords.into_iter().partition(|c| !spokes.is_empty() && (c.0 == uv(n) || c.1 == uv(n)));
        let inside = |p: DVec2| {
            let wedge = if reflex { at_node.iter().any(|&c| left(c, p)) } else { at_node.iter().all(|&c| left(c, p)) };
            wedge && others.iter().all(|&c| left(c, p))
        };
        let area = self.triangles.iter().filter(|t| inside(t.uv)).map(|t| t.area.length()).sum();
        let normals = quad.map(|i| {
            let (mut own, mut all) = (DVec3::ZERO, DVec3::ZERO);
            for h in self.union.disk.adjacency.fan(self.vertex[i]) {
                let Facet { uv, area, .. } = self.triangles[h as usize / 3];
                all += area;
                if inside(uv) {
                    own += area;
                }
            }
            if own == DVec3::ZERO { all.normalize_or_zero() } else { own.normalize_or_zero() }
        });
        let corners = quad.map(|i| self.position(self.vertex[i]));
        Some(Shape { corners, sides, normals, area })
    }

    fn position(&self, v: u32) -> DVec3 {
        self.scale.bench.embedding.position(&self.union, v)
    }

    /// The way from corner `i` to corner `j`: along the outline or straight through the map.
    fn trace(&self, i: usize, j: usize) -> Option<Trace> {
        if let Some(&known) = self.traces.borrow().get(&(i, j)) {
            return known;
        }
        let n = self.around.len();
        let disk = &self.union.disk;
        let trace = if i < n && j == (i + 1) % n {
            let (from, to) = (self.union.corners[i], self.union.corners[j]);
            let m = disk.boundary.len();
            let count = (to + m - from - 1) % m + 1;
            Some(Trace::of(&(0..=count).map(|k| self.position(disk.boundary[(from + k) % m])).collect::<Vec<_>>()))
        } else if j < n && i == (j + 1) % n {
            self.trace(j, i).map(Trace::reversed)
        } else {
            let (a, b) = (self.vertex[i], self.vertex[j]);
            disk.straight(&self.union.uv, a, b).map(|met| {
                let mut points = vec![self.position(a)];
                points.extend(met.iter().map(|m| match *m {
                    Met::Vertex(v) => self.position(v),
                    Met::Edge(p, q, t) => self.position(p).lerp(self.position(q), t),
                }));
                points.push(self.position(b));
                Trace::of(&points)
            })
        };
        self.traces.borrow_mut().insert((i, j), trace);
        trace
    }
}
