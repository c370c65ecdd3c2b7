//! A mesh made ready for painting: shortest chains of edges in a time that depends on the chain, not on the mesh.
//!
//! A* with landmarks (Goldberg and Harrelson 2005, *Computing the shortest path: A* search meets graph theory*):
//! distances from a few far places, made once, bound the way ahead from below much better than the straight line
//! where the surface bends, and the search stays near the path.

use super::{CurveError, ScalarField};
use crate::geom::graph::Queue;
use crate::mesh::path::neighbours;
use crate::mesh::{Adjacency, NONE, TriMesh, next};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Mutex;

/// Landmarks: the two ends of the shape along each of these directions.
const DIRECTIONS: [DVec3; 5] = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, 1.0, 1.0), DVec3::new(1.0, -1.0, -1.0)];
/// Their number: one cache line of distances per vertex holds both ends of all directions.
const LANDMARKS: usize = 2 * DIRECTIONS.len();
/// Width of a bucket of the distance search, in mean edges.
const BUCKET: f64 = 1.0;

/// The way ahead counts as this much longer than its bound: chains are at most as much longer than the shortest, and
/// far fewer vertices are looked at.
const HASTE: f64 = 1.03;

/// What draws a magnetic path: a number per vertex, 0 (nothing) to 1 (all).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Magnet {
    /// One number per vertex.
    pub pull: Vec<f32>,
    /// Cost of an edge between two vertices of pull 1 against one of pull 0; above 0, at most 1.
    pub least_cost: f64,
}

/// Cost of the most drawing edges: a path may be five times longer along a line than beside it.
const LEAST_COST: f64 = 0.2;
/// Shares of the vertices below the values of no pull and of full pull.
const MIDDLE: f64 = 0.5;
const FULL_PULL_SHARE: f64 = 0.95;
/// A magnetic search looks ahead as if edges cost at least this: it may miss the cheapest path by as much as this is
/// above the least cost, and looks at a small part of the mesh instead of most of it.
const EAGER: f64 = 0.7;

impl Magnet {
    /// Drawn to the marked half-edges (sharp lines, creases).
    pub fn of_lines(mesh: &TriMesh, lines: &[bool]) -> Magnet {
        let mut pull = vec![0.0; mesh.points.len()];
        for h in (0..lines.len() as u32).filter(|&h| lines[h as usize]) {
            pull[mesh.origin(h) as usize] = 1.0;
            pull[mesh.origin(next(h)) as usize] = 1.0;
        }
        Magnet { pull, least_cost: LEAST_COST }
    }

    /// Drawn to high values of a scalar: from its middle value (nothing) to the highest twentieth (all).
    pub fn of_scalar(field: &ScalarField) -> Magnet {
        let mut sorted: Vec<f64> = field.values.iter().copied().filter(|s| s.is_finite()).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| sorted.get((share * sorted.len() as f64) as usize).copied().unwrap_or(0.0);
        let (low, high) = (at(MIDDLE), at(FULL_PULL_SHARE));
        let scale = if high > low { 1.0 / (high - low) } else { 0.0 };
        let pull = field.values.iter().map(|s| ((s - low) * scale).clamp(0.0, 1.0) as f32).collect();
        Magnet { pull, least_cost: LEAST_COST }
    }

    fn weight(&self, a: u32, b: u32) -> f64 {
        let pull = self.pull[a as usize].min(self.pull[b as usize]) as f64;
        1.0 - (1.0 - self.least_cost) * pull
    }
}

/// A mesh with what painting needs.
pub struct Canvas<'m> {
    /// The mesh.
    pub mesh: &'m TriMesh,
    /// Its adjacency.
    pub adjacency: Adjacency,
    /// Mean edge length, world units.
    pub edge: f64,
    /// Neighbours of vertex `v` with their distances: `links[start[v]..start[v + 1]]`.
    start: Vec<u32>,
    links: Vec<(u32, f32)>,
    /// For each vertex its distances from the landmarks, infinite where none leads.
    landmarks: Vec<[f32; LANDMARKS]>,
    scratch: Mutex<Scratch>,
}

/// A vertex as a search sees it.
#[derive(Clone, Copy)]
struct Label {
    /// Twice the number of the search that set it, one more once the vertex is done; older ones count as unset.
    stamp: u32,
    /// The vertex before it.
    before: u32,
    distance: f64,
    /// Bound of the way ahead.
    ahead: f64,
}

/// Labels of one search, kept from one to the next so that a search costs what it visits.
#[derive(Default)]
struct Scratch {
    stamp: u32,
    labels: Vec<Label>,
}

impl Scratch {
    fn begin(&mut self, vertices: usize) {
        if self.labels.len() != vertices || self.stamp >= u32::MAX - 2 {
            let unset = Label { stamp: 0, before: NONE, distance: f64::INFINITY, ahead: 0.0 };
            *self = Scratch { stamp: 0, labels: vec![unset; vertices] };
        }
        self.stamp += 2;
    }

    fn is_done(&self, v: u32) -> bool {
        self.labels[v as usize].stamp == self.stamp + 1
    }

    /// Sets a shorter distance; `ahead` is asked for a vertex met for the first time. Returns the estimate of the
    /// whole way, or nothing if the vertex is done or known at no more.
    fn shorten(&mut self, v: u32, distance: f64, before: u32, ahead: impl FnOnce() -> f64) -> Option<f64> {
        let stamp = self.stamp;
        let label = &mut self.labels[v as usize];
        if label.stamp < stamp {
            *label = Label { stamp, before, distance, ahead: ahead() };
        } else if label.stamp == stamp && distance < label.distance {
            (label.distance, label.before) = (distance, before);
        } else {
            return None;
        }
        Some(distance + label.ahead)
    }

    fn chain(&self, to: u32) -> Vec<u32> {
        let mut chain = vec![to];
        let mut at = to;
        while self.labels[at as usize].before != NONE {
            at = self.labels[at as usize].before;
            chain.push(at);
        }
        chain.reverse();
        chain
    }
}

impl<'m> Canvas<'m> {
    /// Makes a mesh ready: time and memory in proportion to its size, once.
    pub fn new(mesh: &'m TriMesh) -> Canvas<'m> {
        Canvas::with_adjacency(mesh, Adjacency::new(mesh))
    }

    /// As [`Canvas::new`] with an adjacency that is there already.
    pub fn with_adjacency(mesh: &'m TriMesh, adjacency: Adjacency) -> Canvas<'m> {
        let n = mesh.points.len();
        let counts: Vec<u32> = (0..n as u32)
            .into_par_iter()
            .map(|v| match adjacency.outgoing[v as usize] {
                NONE => 0,
                _ => neighbours(mesh, &adjacency, v).count() as u32,
            })
            .collect();
        let mut start = vec![0u32; n + 1];
        for v in 0..n {
            start[v + 1] = start[v] + counts[v];
        }
        let links: Vec<(u32, f32)> = (0..n as u32)
            .into_par_iter()
            .filter(|&v| counts[v as usize] > 0)
            .flat_map_iter(|v| {
                let p = mesh.points[v as usize];
                neighbours(mesh, &adjacency, v).map(move |(w, _)| (w, p.distance(mesh.points[w as usize]) as f32))
            })
            .collect();
        let edge = links.iter().map(|l| l.1 as f64).sum::<f64>() / links.len().max(1) as f64;
        let mut canvas =
            Canvas { mesh, adjacency, edge, start, links, landmarks: Vec::new(), scratch: Mutex::default() };
        let ends: Vec<u32> = DIRECTIONS.iter().flat_map(|&d| canvas.ends(d)).collect();
        let fields: Vec<Vec<f32>> = ends.par_iter().map(|&v| canvas.distances(v)).collect();
        canvas.landmarks = (0..n)
            .into_par_iter()
            .map(|v| std::array::from_fn(|k| fields.get(k).map_or(f32::INFINITY, |f| f[v])))
            .collect();
        canvas
    }

    /// The vertices furthest along `direction` and against it, of those that have triangles.
    fn ends(&self, direction: DVec3) -> Vec<u32> {
        let (mut low, mut high) = ((f64::INFINITY, NONE), (f64::NEG_INFINITY, NONE));
        for (v, p) in self.mesh.points.iter().enumerate() {
            if self.start[v] < self.start[v + 1] {
                let x = p.dot(direction);
                if x < low.0 {
                    low = (x, v as u32);
                }
                if x > high.0 {
                    high = (x, v as u32);
                }
            }
        }
        [low.1, high.1].into_iter().filter(|&v| v != NONE).collect()
    }

    /// Neighbours of `v` with the lengths of the edges.
    pub fn links(&self, v: u32) -> &[(u32, f32)] {
        &self.links[self.start[v as usize] as usize..self.start[v as usize + 1] as usize]
    }

    /// Distances along edges from `source`: buckets of vertices at about the same distance, a bucket again until it
    /// is empty.
    fn distances(&self, source: u32) -> Vec<f32> {
        let width = (BUCKET * self.edge).max(f64::MIN_POSITIVE) as f32;
        let mut distance = vec![f32::INFINITY; self.mesh.points.len()];
        let mut buckets: Vec<Vec<u32>> = vec![vec![source]];
        distance[source as usize] = 0.0;
        let mut at = 0;
        while at < buckets.len() {
            let mut batch = std::mem::take(&mut buckets[at]);
            while !batch.is_empty() {
                for v in batch {
                    let d = distance[v as usize];
                    if (d / width) as usize != at {
                        continue;
                    }
                    for &(w, l) in self.links(v) {
                        let reached = d + l;
                        if reached < distance[w as usize] {
                            distance[w as usize] = reached;
                            let k = (reached / width) as usize;
                            if k >= buckets.len() {
                                buckets.resize_with(k + 1, Vec::new);
                            }
                            buckets[k].push(w);
                        }
                    }
                }
                batch = std::mem::take(&mut buckets[at]);
            }
            at += 1;
        }
        distance
    }

    /// A short chain of edges between two vertices, at most a few hundredths longer than the shortest; with a magnet a
    /// cheap one.
    /// # Errors
    /// `NoWay` if there is none.
    pub fn path(&self, from: u32, to: u32, magnet: Option<&Magnet>) -> Result<Vec<u32>, CurveError> {
        let points = &self.mesh.points;
        let no_way =
            || CurveError::NoWay { from: points[from as usize].to_array(), to: points[to as usize].to_array() };
        let goal = points[to as usize];
        let goal_marks = self.landmarks[to as usize];
        let least = magnet.map_or(HASTE, |m| m.least_cost.max(EAGER));
        // Infinite where a landmark tells that the two lie on different pieces.
        let ahead = |v: u32| {
            let mut bound = points[v as usize].distance(goal) as f32;
            for (&a, &b) in self.landmarks[v as usize].iter().zip(&goal_marks) {
                if a.is_finite() != b.is_finite() {
                    return f64::INFINITY;
                }
                if a.is_finite() {
                    bound = bound.max((a - b).abs());
                }
            }
            least * bound as f64
        };
        let first = ahead(from);
        if first == f64::INFINITY {
            return Err(no_way());
        }
        let mut own = Scratch::default();
        let mut held = self.scratch.try_lock();
        let scratch = match &mut held {
            Ok(guard) => &mut **guard,
            Err(_) => &mut own,
        };
        scratch.begin(points.len());
        scratch.shorten(from, 0.0, NONE, || first);
        let mut queue = Queue::default();
        queue.push(first, from, 0.0);
        while let Some((v, distance)) = queue.pop() {
            if scratch.is_done(v) {
                continue;
            }
            scratch.labels[v as usize].stamp += 1;
            if v == to {
                return Ok(scratch.chain(to));
            }
            for &(w, length) in self.links(v) {
                if scratch.is_done(w) {
                    continue;
                }
                let d = distance + length as f64 * magnet.map_or(1.0, |m| m.weight(v, w));
                if let Some(estimate) = scratch.shorten(w, d, v, || ahead(w)) {
                    queue.push(estimate, w, d);
                }
            }
        }
        Err(no_way())
    }

    /// The chain that always steps to the neighbour nearest to `to`; nothing where that comes no nearer.
    /// Source: [K98] §3.2.
    pub fn greedy(&self, from: u32, to: u32) -> Option<Vec<u32>> {
        let points = &self.mesh.points;
        let goal = points[to as usize];
        let mut chain = vec![from];
        let (mut v, mut away) = (from, points[from as usize].distance(goal));
        while v != to {
            let nearest = self
                .links(v)
                .iter()
                .map(|&(w, _)| (if w == to { -1.0 } else { points[w as usize].distance(goal) }, w))
                .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let (d, w) = nearest.filter(|n| n.0 < away)?;
            chain.push(w);
            (v, away) = (w, d);
        }
        Some(chain)
    }
}
