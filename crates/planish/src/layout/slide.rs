//! Sliding nodes along sharp lines and boundaries: the line is fixed, the places where smooth arcs end on it
//! are not. See `docs/methods/layout.md`, step 7.

use super::complex::Complex;
use super::recut::{Bench, Change, outline};
use crate::geom::polyline;
use crate::mesh::disjoint::disjoint;
use crate::mesh::{NONE, TriMesh};
use crate::network::imprint::Place;
use rayon::prelude::*;

/// A node keeps this fraction of the line between its neighbours to either side.
const KEPT_FRACTION: f64 = 0.15;

/// How much even spacing along the line counts against lying across from the other ends of the smooth arcs.
const EVEN_WEIGHT: f64 = 0.5;

/// A node's move along its line.
#[derive(Clone, Debug)]
pub(super) struct Slide {
    pub node: u32,
    /// Vertex of the working mesh that it moves to.
    pub vertex: u32,
    /// The line through the node, from its neighbour before to its neighbour after, as vertices.
    pub line: Vec<u32>,
    /// The half-arcs that leave the node along the line: back and forth.
    pub along: [u32; 2],
    /// Each side of the line with smooth arcs: the union of its cells, and the smooth half-arcs with the outline
    /// position where each ends.
    pub sides: Vec<(Change, Vec<(u32, usize)>)>,
}

/// Slides the nodes that lie inside a line once, in batches of disjoint ones. Returns how many moved.
pub(super) fn slide(bench: &mut Bench, nodes: &[u32]) -> usize {
    let mut waiting = nodes.to_vec();
    let mut made = 0;
    while !waiting.is_empty() {
        let complex = &bench.complex;
        let stars = complex.stars();
        let cells = |&node: &u32| {
            let around = stars[node as usize].iter().flat_map(|&h| [complex.cell(h), complex.cell(h ^ 1)]);
            around.filter(|&c| c != NONE).collect()
        };
        let (now, later) = disjoint(waiting, cells, |node| plan(bench.mesh, complex, &stars[node as usize]));
        made += apply(bench, &now);
        waiting = later;
    }
    made
}

/// Where the node of `star` should go; `None` if it is fixed or well placed.
fn plan(mesh: &TriMesh, complex: &Complex, star: &[u32]) -> Option<Slide> {
    let node = complex.from(*star.first()?);
    if complex.nodes[node as usize].stays {
        return None;
    }
    let fixed: Vec<usize> = (0..star.len()).filter(|&i| !complex.arc(star[i]).kind.is_smooth()).collect();
    let [x, y] = fixed[..] else { return None };
    if complex.arc(star[x]).kind != complex.arc(star[y]).kind || star[x] / 2 == star[y] / 2 {
        return None;
    }
    let vertices = |h: u32| -> Option<Vec<u32>> {
        let chain = complex.arc(h).chain.iter().map(|p| match p {
            Place::Vertex(v) => Some(*v),
            _ => None,
        });
        let mut list = chain.collect::<Option<Vec<u32>>>()?;
        if h % 2 == 1 {
            list.reverse();
        }
        Some(list)
    };
    let mut line = vertices(star[x])?;
    line.reverse();
    let old = line.len() - 1;
    line.extend_from_slice(&vertices(star[y])?[1..]);
    let along = polyline::arc_lengths(line.iter().map(|&v| mesh.points[v as usize]));
    let total = along[along.len() - 1];
    // Across from the other ends of the smooth arcs.
    let (mut sum, mut count) = (0.0, 0.0);
    for &h in star.iter().filter(|&&h| complex.arc(h).kind.is_smooth()) {
        let far = mesh.points[complex.nodes[complex.to(h) as usize].vertex as usize];
        let near = (0..line.len())
            .min_by(|&i, &j| {
                let d = |i: usize| mesh.points[line[i] as usize].distance_squared(far);
                d(i).total_cmp(&d(j))
            })
            .expect("a line has vertices");
        sum += along[near];
        count += 1.0;
    }
    if count == 0.0 {
        return None;
    }
    let target = EVEN_WEIGHT * total / 2.0 + (1.0 - EVEN_WEIGHT) * sum / count;
    let target = target.clamp(KEPT_FRACTION * total, (1.0 - KEPT_FRACTION) * total);
    let best = (1..line.len() - 1)
        .min_by(|&i, &j| (along[i] - target).abs().total_cmp(&(along[j] - target).abs()))
        .filter(|&i| i != old)?;
    let mut sides = Vec::new();
    for (from, to) in [(x, y), (y, x)] {
        let mut halves = Vec::new();
        let mut i = from;
        loop {
            halves.push(star[i]);
            i = (i + 1) % star.len();
            if i == to {
                break;
            }
        }
        if halves.len() < 2 {
            continue;
        }
        let mut cells: Vec<u32> = halves.iter().map(|&h| complex.cell(h)).collect();
        cells.sort_unstable();
        cells.dedup();
        if cells.len() != halves.len() {
            return None;
        }
        let change = Change { cells, removed: halves[1..].iter().map(|h| h / 2).collect(), ..Change::default() };
        let around = outline(complex, &change)?;
        let ends = halves[1..]
            .iter()
            .map(|&h| Some((h, around.iter().position(|&g| g == complex.following(h))?)))
            .collect::<Option<Vec<_>>>()?;
        sides.push((change, ends));
    }
    Some(Slide { node, vertex: line[best], line, along: [star[x], star[y]], sides })
}

/// Makes slides of nodes whose cells are disjoint. Returns how many were made.
fn apply(bench: &mut Bench, slides: &[Slide]) -> usize {
    if slides.is_empty() {
        return 0;
    }
    let drawn: Vec<_> = slides.par_iter().map(|slide| draw(bench, slide)).collect();
    let edits = slides.iter().zip(drawn).filter_map(|(slide, chains)| Some((slide, chains?))).collect();
    bench.commit(edits, |complex, (slide, chains)| {
        complex.nodes[slide.node as usize].vertex = slide.vertex;
        let at = slide.line.iter().position(|&v| v == slide.vertex).expect("a vertex of the line");
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
    })
}

/// Draws a slide: the new chain of each smooth half-arc at the node, from the node.
fn draw(bench: &Bench, slide: &Slide) -> Option<Vec<(u32, Vec<Place>)>> {
    let embedding = &bench.embedding;
    let mut chains = Vec::new();
    for (change, ends) in &slide.sides {
        let (disk, outline, mut corners) = embedding.union(&bench.complex, change)?;
        let n = disk.boundary.len();
        let moved = slide.along.iter().find_map(|&h| outline.iter().position(|&g| g == h))?;
        let k = corners.len();
        // The new place lies between the corners before and after, cyclically.
        let (before, after) = (corners[(moved + k - 1) % k], corners[(moved + 1) % k]);
        let span = (after + n - before - 1) % n + 1;
        let place =
            (1..span).map(|i| before + i).find(|&i| disk.vertices[disk.boundary[i % n] as usize] == slide.vertex)?;
        corners[moved] = place % n;
        let targets: Vec<usize> = ends.iter().map(|&(_, i)| corners[i]).collect();
        let mut turned = corners.clone();
        turned.rotate_left(moved);
        for i in 1..k {
            while turned[i] < turned[i - 1] {
                turned[i] += n;
            }
        }
        let uv = disk.circle_map(&embedding.cut.mesh.points, &embedding.angles(&disk, &turned))?;
        for (&(h, _), &target) in ends.iter().zip(&targets) {
            let line = embedding.line(
                bench.mesh,
                bench.adjacency,
                &disk,
                &uv,
                disk.boundary[place % n],
                disk.boundary[target],
            )?;
            chains.push((h, line));
        }
    }
    Some(chains)
}
