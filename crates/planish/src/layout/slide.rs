//! Sliding nodes along sharp lines and boundaries: the line is fixed, the places where smooth arcs end on it
//! are not. See `docs/methods/layout.md`, step 7.

use super::complex::Complex;
use super::recut::{Bench, Change, outline};
use crate::geom::polyline;
use crate::mesh::disjoint::disjoint;
use crate::mesh::{NONE, TriMesh};
use crate::network::disk::Disk;
use crate::network::imprint::Place;
use rayon::prelude::*;

/// A node keeps this fraction of the line between its neighbours to either side.
const KEPT_FRACTION: f64 = 0.15;

/// How much even spacing along the line counts against lying across from the other ends of the smooth arcs.
const EVEN_WEIGHT: f64 = 0.5;

/// A node inside a line, which may move along it.
#[derive(Clone, Debug)]
pub(super) struct Slide {
    pub node: u32,
    /// The line through the node, from its neighbour before to its neighbour after, as vertices of the working mesh.
    pub line: Vec<u32>,
    /// Where in it the node stands.
    pub at: usize,
    /// The half-arcs that leave the node along the line: back and forth.
    pub along: [u32; 2],
    /// What lies on either side; one, on a boundary.
    pub sides: Vec<Flank>,
}

/// The cells on one side of a line at a node.
#[derive(Clone, Debug)]
pub(super) struct Flank {
    /// Their union, with the smooth arcs at the node as its lines.
    pub change: Change,
    /// The half-arcs of these lines, which leave the node.
    pub halves: Vec<u32>,
    /// Number of the node in the outline.
    pub corner: usize,
}

impl Slide {
    /// The slide of the node of `star`; `None` if it does not lie inside a line or has to stay.
    pub fn new(complex: &Complex, star: &[u32]) -> Option<Slide> {
        let node = complex.from(*star.first()?);
        if complex.nodes[node as usize].stays {
            return None;
        }
        let fixed: Vec<usize> = (0..star.len()).filter(|&i| !complex.arc(star[i]).kind.is_smooth()).collect();
        let [x, y] = fixed[..] else { return None };
        if complex.arc(star[x]).kind != complex.arc(star[y]).kind || star[x] / 2 == star[y] / 2 {
            return None;
        }
        let mut line = vertices(complex, star[x])?;
        line.reverse();
        let at = line.len() - 1;
        line.extend_from_slice(&vertices(complex, star[y])?[1..]);
        let sides = [(x, y), (y, x)].into_iter().filter(|&(from, _)| complex.cell(star[from]) != NONE);
        let sides = sides.map(|(from, to)| Flank::new(complex, star, from, to)).collect::<Option<Vec<_>>>()?;
        Some(Slide { node, line, at, along: [star[x], star[y]], sides })
    }

    /// The cells on both sides.
    pub fn cells(&self) -> Vec<u32> {
        self.sides.iter().flat_map(|flank| flank.change.cells.iter().copied()).collect()
    }

    /// The place of the line halfway between even spacing and lying across from the other ends of the smooth arcs; `None` if
    /// the node is there.
    fn across(&self, mesh: &TriMesh, complex: &Complex) -> Option<usize> {
        let point = |v: u32| mesh.points[v as usize];
        let along = polyline::arc_lengths(self.line.iter().map(|&v| point(v)));
        let total = along[along.len() - 1];
        let halves: Vec<u32> = self.sides.iter().flat_map(|flank| flank.halves.iter().copied()).collect();
        if halves.is_empty() {
            return None;
        }
        let nearest = |half: &u32| {
            let far = point(complex.nodes[complex.to(*half) as usize].vertex);
            let off = |i: &usize| point(self.line[*i]).distance_squared(far);
            along[(0..self.line.len()).min_by(|i, j| off(i).total_cmp(&off(j))).expect("a line has vertices")]
        };
        let mean = halves.iter().map(nearest).sum::<f64>() / halves.len() as f64;
        let target = EVEN_WEIGHT * total / 2.0 + (1.0 - EVEN_WEIGHT) * mean;
        let target = target.clamp(KEPT_FRACTION * total, (1.0 - KEPT_FRACTION) * total);
        let off = |i: &usize| (along[*i] - target).abs();
        (1..self.line.len() - 1).min_by(|i, j| off(i).total_cmp(&off(j))).filter(|&at| at != self.at)
    }

    /// Where in the boundary of the union of a flank, between its corners, the node stands `at` a place of the line.
    pub fn position(&self, disk: &Disk, corners: &[usize], flank: &Flank, at: usize) -> Option<usize> {
        let (n, k) = (disk.boundary.len(), corners.len());
        let [before, after] = [k - 1, 1].map(|step| corners[(flank.corner + step) % k]);
        let span = (after + n - before - 1) % n + 1;
        let is_there = |i: &usize| disk.vertices[disk.boundary[i % n] as usize] == self.line[at];
        (before + 1..before + span).find(is_there).map(|i| i % n)
    }

    /// The chain of each smooth half-arc at the node, from the node, with the node `at` a place of the line.
    fn draw(&self, bench: &Bench, at: usize) -> Option<Vec<(u32, Vec<Place>)>> {
        let embedding = &bench.embedding;
        let mut chains = Vec::new();
        for flank in self.sides.iter().filter(|flank| !flank.halves.is_empty()) {
            let (disk, _, mut corners) = embedding.union(&bench.complex, &flank.change)?;
            let n = disk.boundary.len();
            corners[flank.corner] = self.position(&disk, &corners, flank, at)?;
            let mut turned = corners.clone();
            turned.rotate_left(flank.corner);
            for i in 1..turned.len() {
                while turned[i] < turned[i - 1] {
                    turned[i] += n;
                }
            }
            let uv = disk.circle_map(&embedding.cut.mesh.points, &embedding.angles(&disk, &turned))?;
            let place = |corner: usize| disk.boundary[corners[corner]];
            for (&half, &(from, to)) in flank.halves.iter().zip(&flank.change.lines) {
                let ground = (bench.mesh, bench.adjacency);
                let line = embedding.line(ground, (&disk, &uv), [from, to].map(place))?;
                chains.push((half, line));
            }
        }
        Some(chains)
    }
}

impl Flank {
    /// The flank from half-arc `from` of the line, counter-clockwise in the star, to half-arc `to`.
    fn new(complex: &Complex, star: &[u32], from: usize, to: usize) -> Option<Flank> {
        let count = (to + star.len() - from) % star.len();
        let halves: Vec<u32> = (0..count).map(|k| star[(from + k) % star.len()]).collect();
        let mut cells: Vec<u32> = halves.iter().map(|&h| complex.cell(h)).collect();
        cells.sort_unstable();
        cells.dedup();
        if cells.len() != halves.len() {
            return None;
        }
        let removed = halves[1..].iter().map(|h| h / 2).collect();
        let mut change = Change { cells, removed, ..Change::default() };
        let around = outline(complex, &change)?;
        let position = |h: u32| around.iter().position(|&g| g == h);
        let corner = position(halves[0])?;
        let ends = halves[1..].iter().map(|&h| position(complex.following(h)));
        change.lines = ends.map(|end| Some((corner, end?))).collect::<Option<Vec<_>>>()?;
        Some(Flank { change, halves: halves[1..].to_vec(), corner })
    }
}

/// The vertices of a half-arc that follows edges.
fn vertices(complex: &Complex, half: u32) -> Option<Vec<u32>> {
    let vertex = |place: &Place| match place {
        Place::Vertex(v) => Some(*v),
        _ => None,
    };
    let mut list = complex.arc(half).chain.iter().map(vertex).collect::<Option<Vec<u32>>>()?;
    if half % 2 == 1 {
        list.reverse();
    }
    Some(list)
}

/// Slides the nodes inside lines once, each across from the other ends of its arcs, in batches of disjoint ones.
pub(super) fn slide_across(bench: &mut Bench, nodes: &[u32]) {
    let mut waiting = nodes.to_vec();
    while !waiting.is_empty() {
        let complex = &bench.complex;
        let stars = complex.stars();
        let cells = |&node: &u32| {
            let around = stars[node as usize].iter().flat_map(|&h| [complex.cell(h), complex.cell(h ^ 1)]);
            around.filter(|&c| c != NONE).collect()
        };
        let (now, later) = disjoint(waiting, cells, |node| {
            let slide = Slide::new(complex, &stars[node as usize])?;
            let at = slide.across(bench.mesh, complex)?;
            Some((slide, at))
        });
        apply(bench, &now);
        waiting = later;
    }
}

/// Makes slides of nodes with different cells, each to a place of its line, if it can be drawn.
pub(super) fn apply(bench: &mut Bench, slides: &[(Slide, usize)]) {
    let drawn = slides.par_iter().map(|(slide, at)| Some((slide, *at, slide.draw(bench, *at)?)));
    let edits = drawn.flatten().collect();
    bench.commit(edits, |complex, (slide, at, chains)| put(complex, slide, *at, chains));
}

/// Makes a slide; returns the arcs that it touched.
fn put(complex: &mut Complex, slide: &Slide, at: usize, chains: &[(u32, Vec<Place>)]) -> Vec<u32> {
    complex.nodes[slide.node as usize].vertex = slide.line[at];
    let places: Vec<Place> = slide.line.iter().map(|&v| Place::Vertex(v)).collect();
    let back = (slide.along[0], places[..=at].iter().rev().copied().collect());
    let ahead = (slide.along[1], places[at..].to_vec());
    let mut touched = Vec::new();
    for (h, chain) in chains.iter().chain([&back, &ahead]) {
        let mut chain: Vec<Place> = chain.clone();
        if h % 2 == 1 {
            chain.reverse();
        }
        complex.arcs[*h as usize / 2].as_mut().expect("a live arc").chain = chain;
        touched.push(h / 2);
    }
    touched
}
