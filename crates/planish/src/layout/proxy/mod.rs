//! Other meshes of the same surface to lay out on: finer where the input is too coarse, coarser where it is finer than a
//! layout needs, each with the way back.
//!
//! A *proxy* is an even mesh of some thousand triangles. The input is refined first ([`refine`]): edges much longer than
//! wanted are split, needles across, and so is what a map cannot use: edges between two vertices of lines that are no line themselves,
//! for both ends are bound; triangles with two edges on lines, for their corner has nothing to bend. Then vertices are
//! taken out one by one ([`melt`]). Curves drawn on the proxy are carried back through the same steps ([`strands`]).

pub(super) mod coarse;
mod melt;
pub(super) mod refine;
mod regain;
mod strands;

use self::melt::Melt;
use self::refine::Refined;
use self::regain::History;
use self::strands::{Step, Strands};
use crate::layout::complex::Complex;
use crate::layout::{carry, network};
use crate::mesh::{Adjacency, NONE, TriMesh, next};
use crate::network::Network;
use crate::observe::Observer;
use glam::DVec3;
use std::cell::OnceCell;
use std::collections::HashSet;
use std::f64::consts::SQRT_2;
use std::rc::Rc;

/// Longest edge of the refined mesh in edges of the proxy: short enough to choose from.
const FINE: f64 = 0.6;

/// Area of an equilateral triangle with edges of length 1.
pub(super) const EQUILATERAL: f64 = 0.433_012_701_892_219_3;

/// Places with shorter edges at most: every length looks at all of them. Where more ask for room, as in soups of triangles,
/// all of the mesh is too coarse, and shorter edges here and there help no longer.
const MOST_SPOTS: usize = 256;

/// How fast edges get longer away from a spot: neighbours differ by a third, which leaves room for good triangles.
const GRADE: f64 = 0.3;

/// Triangles of the refined mesh at most, besides those of the input, for each one of the proxy. Halving edges until none is
/// longer than [`FINE`] leaves up to 4 / FINE^2 = 11 even ones; twice as many are for thin triangles. Needles, which would
/// take any number, stay longer.
const REFINED_PER_PROXY: usize = 22;

/// Rounds of splitting; each halves an edge.
const SPLIT_ROUNDS: usize = 14;

/// An even mesh of the input's surface, with the way back.
pub(super) struct Proxy {
    /// Nearly equilateral triangles.
    pub mesh: TriMesh,
    pub adjacency: Adjacency,
    /// For each half-edge whether it lies on a sharp line; not those of the boundary.
    pub lines: Vec<bool>,
    /// The refined input, which the proxy is made from by `steps`.
    work: Rc<Refined>,
    work_adjacency: Rc<Adjacency>,
    steps: Rc<Vec<Step>>,
    history: Rc<OnceCell<History>>,
    /// Numbers of the steps that were taken back ([`Proxy::regained`]).
    taken_back: HashSet<u32>,
    /// For each vertex and face of the proxy that of the refined input.
    vertex: Vec<u32>,
    face: Vec<u32>,
}

/// How long the edges of a proxy are to be.
#[derive(Clone, Debug)]
pub(super) struct Sizing {
    /// Far from all spots.
    edge: f64,
    /// Places with shorter edges.
    spots: Vec<(DVec3, f64)>,
}

impl Sizing {
    /// Edges for so many even triangles.
    pub fn even(mesh: &TriMesh, triangles: usize) -> Sizing {
        let area: f64 = (0..mesh.triangles.len()).map(|f| mesh.area(f)).sum();
        Sizing { edge: (area / (EQUILATERAL * triangles.max(1) as f64)).sqrt(), spots: Vec::new() }
    }

    /// True if edges are as long everywhere.
    pub fn is_even(&self) -> bool {
        self.spots.is_empty()
    }

    /// Asks for edges of at most these lengths at some places, and for longer ones again at a distance. False, and nothing
    /// changes, if they are that short already, within what one edge may differ by from the next, or there would be too many
    /// places.
    pub fn shorten(&mut self, mut places: Vec<(DVec3, f64)>) -> bool {
        // The shortest first: around these many others have what they want.
        places.sort_by(|a, b| a.1.total_cmp(&b.1));
        let before = self.spots.len();
        for (place, edge) in places {
            if edge * (1.0 + GRADE) < self.at(place) {
                self.spots.push((place, edge));
            }
        }
        let has_room = self.spots.len() <= MOST_SPOTS;
        if !has_room {
            self.spots.truncate(before);
        }
        has_room && self.spots.len() > before
    }

    /// Length wanted at a place.
    pub fn at(&self, place: DVec3) -> f64 {
        self.spots.iter().map(|&(p, edge)| edge + GRADE * p.distance(place)).fold(self.edge, f64::min)
    }

    /// Triangles of these edges that cover `mesh`.
    pub fn triangles(&self, mesh: &TriMesh) -> usize {
        let count = |f: usize| {
            let [a, b, c] = mesh.corners(f);
            mesh.area(f) / (EQUILATERAL * self.at((a + b + c) / 3.0).powi(2))
        };
        (0..mesh.triangles.len()).map(count).sum::<f64>().round() as usize
    }
}

/// A proxy of `mesh` with edges of about this length: longer ones are not possible where lines are dense.
///
/// No edge but those of lines and of the boundary joins two vertices on them, and no triangle has two edges on them.
/// * `sharp` - for each half-edge whether it is on a sharp line
/// * `corners` - for each vertex whether it stays; may be empty
///
/// `None` if cancelled, or if the mesh has no area.
pub(super) fn proxy(
    mesh: &TriMesh,
    sharp: &[bool],
    corners: &[bool],
    sizing: &Sizing,
    observer: &dyn Observer,
) -> Option<Proxy> {
    if !(sizing.edge.is_finite() && sizing.edge > 0.0) {
        return None;
    }
    let most =
        |work: &TriMesh| mesh.triangles.len().saturating_add(REFINED_PER_PROXY.saturating_mul(sizing.triangles(work)));
    let work = refined(mesh, sharp, |p| FINE * sizing.at(p), most);
    let work_adjacency = Adjacency::new(&work.mesh);
    let tagged = tags(&work, &work_adjacency, sharp);
    observer.progress(0.2);
    let edge = work.mesh.points.iter().map(|&p| sizing.at(p)).collect();
    let mut melt = Melt::new(&work.mesh, tagged, corners, edge);
    melt.run(sizing.triangles(&work.mesh), observer);
    if observer.cancelled() {
        return None;
    }
    let used = |v: &u32| !melt.around[*v as usize].is_empty();
    let vertex: Vec<u32> = (0..work.mesh.points.len() as u32).filter(used).collect();
    let face: Vec<u32> = (0..melt.triangles.len() as u32).filter(|&f| melt.is_live(f)).collect();
    let mut number = vec![NONE; work.mesh.points.len()];
    vertex.iter().enumerate().for_each(|(i, &v)| number[v as usize] = i as u32);
    let points = vertex.iter().map(|&v| work.mesh.points[v as usize]).collect();
    let triangles = face.iter().map(|&f| melt.triangles[f as usize].map(|v| number[v as usize])).collect();
    let tagged: Vec<bool> =
        face.iter().flat_map(|&f| (0..3).map(move |k| 3 * f + k)).map(|h| melt.tagged[h as usize]).collect();
    let steps = Rc::new(std::mem::take(&mut melt.steps));
    let mesh = TriMesh::new(points, triangles);
    let adjacency = Adjacency::new(&mesh);
    let lines = tagged.iter().zip(&adjacency.opposite).map(|(&tag, &o)| tag && o != NONE).collect();
    let (work, work_adjacency) = (Rc::new(work), Rc::new(work_adjacency));
    let (history, taken_back) = (Rc::default(), HashSet::new());
    Some(Proxy { mesh, adjacency, lines, work, work_adjacency, steps, history, taken_back, vertex, face })
}

impl Proxy {
    /// The refined input mesh, where [`Proxy::back`] draws.
    pub fn fine(&self) -> (&TriMesh, &Adjacency) {
        (&self.work.mesh, &self.work_adjacency)
    }

    /// A complex on the proxy, drawn on the refined input: what runs along lines stays on them. `None` if a place of it
    /// lies inside a triangle, or it crosses a line between nodes.
    pub fn back(&self, complex: &Complex) -> Option<Complex> {
        let names = (&self.vertex[..], &self.face[..]);
        let mut strands = Strands::new((&self.mesh, &self.adjacency), complex, names, self.work.mesh.triangles.len())?;
        for (i, step) in self.steps.iter().enumerate().rev() {
            if !self.taken_back.contains(&(i as u32)) {
                strands.undo(step, &self.work.mesh.points);
            }
        }
        let mut complex = complex.clone();
        complex.nodes.iter_mut().for_each(|n| n.vertex = self.vertex[n.vertex as usize]);
        strands.put(self.fine(), |v| v, &mut complex)?;
        Some(complex)
    }

    /// A complex on the refined input as a network on the input.
    pub fn network(&self, complex: &Complex) -> Network {
        network(&self.work, &self.work_adjacency, complex)
    }
}

/// The input without edges longer than `longest` at their middle, as far as `most` triangles allow, and without what a map
/// cannot use.
fn refined(
    mesh: &TriMesh,
    sharp: &[bool],
    longest: impl Fn(DVec3) -> f64,
    most: impl Fn(&TriMesh) -> usize,
) -> Refined {
    let mut work = Refined::new(mesh);
    let (bound, _) = lines(&work, sharp);
    refine::split_faces(&mut work, |f| (0..3).all(|k| bound[3 * f as usize + k]));
    let (tagged, on_line) = lines(&work, sharp);
    let joins = work.edges(|h, [a, b]| on_line[a as usize] && on_line[b as usize] && !tagged[h as usize]);
    work = refine::split(&work, &joins).0;
    for _ in 0..SPLIT_ROUNDS {
        let chosen = long(&work, &longest);
        if refine::count(&work, &chosen) > most(&work.mesh) {
            break;
        }
        let (finer, from) = refine::split(&work, &chosen);
        if from.len() == work.parent.len() {
            break;
        }
        work = finer;
        let (_, on_line) = lines(&work, sharp);
        refine::turn_inner(&mut work, &on_line);
    }
    work
}

/// For each half-edge of the refined mesh whether it is on a line or the boundary, and the vertices of those.
fn lines(work: &Refined, sharp: &[bool]) -> (Vec<bool>, Vec<bool>) {
    let mesh = &work.mesh;
    let tagged = tags(work, &Adjacency::new(mesh), sharp);
    let mut on_line = vec![false; mesh.points.len()];
    for h in (0..tagged.len() as u32).filter(|&h| tagged[h as usize]) {
        on_line[mesh.origin(h) as usize] = true;
        on_line[mesh.origin(next(h)) as usize] = true;
    }
    (tagged, on_line)
}

/// The half-edges that are to be split: those longer than `longest` at their middle. Edges inside faces of the input may be
/// as long as the diagonal of a square of such, and wait where a needle is being cut along its long sides: splitting its
/// diagonals as well would leave a needle of n lengths in n^1.6 triangles, and not in 2 n.
fn long(work: &Refined, longest: impl Fn(DVec3) -> f64) -> Vec<bool> {
    let adjacency = Adjacency::new(&work.mesh);
    let length = |h: u32| {
        let [a, b] = [h, next(h)].map(|h| work.mesh.points[work.mesh.origin(h) as usize]);
        a.distance(b) / longest(a.midpoint(b))
    };
    let is_needle = |f: u32| {
        let mut sides = 3 * f..3 * f + 3;
        sides.clone().any(|h| length(h) <= 1.0) && sides.any(|h| work.edge_of(h).is_some() && length(h) > 1.0)
    };
    let needle: Vec<bool> = (0..work.mesh.triangles.len() as u32).map(is_needle).collect();
    work.edges(|h, _| match (work.edge_of(h), adjacency.opposite[h as usize]) {
        (Some(_), _) | (None, NONE) => length(h) > 1.0,
        (None, o) => length(h) > SQRT_2 && !needle[h as usize / 3] && !needle[o as usize / 3],
    })
}

/// The half-edges of the refined mesh on sharp lines and on the boundary.
fn tags(work: &Refined, adjacency: &Adjacency, sharp: &[bool]) -> Vec<bool> {
    let mut tagged = carry(work, sharp);
    for (h, &o) in adjacency.opposite.iter().enumerate() {
        if o == NONE {
            tagged[h] = true;
        } else if tagged[h] {
            tagged[o as usize] = true;
        }
    }
    tagged
}

#[cfg(test)]
mod tests {
    use super::melt::shape;
    use super::*;
    use crate::Silent;
    use crate::mesh::sharp_edges;
    use crate::synthetic::shapes;
    use glam::DVec3;

    fn made(mesh: &TriMesh, wanted: usize) -> Proxy {
        let sharp = sharp_edges(mesh, &Adjacency::new(mesh), 40.0);
        proxy(mesh, &sharp, &[], &Sizing::even(mesh, wanted), &Silent).expect("a proxy")
    }

    /// Half-edges on lines and on the boundary.
    fn tagged(p: &Proxy) -> Vec<bool> {
        p.lines.iter().zip(&p.adjacency.opposite).map(|(&line, &o)| line || o == NONE).collect()
    }

    #[test]
    fn edges_are_shortened_where_they_are_too_long_and_only_there_and_at_no_more_places_than_are_allowed() {
        let mesh = shapes::rectangle(1.0, 1.0, 4, 4);
        let mut sizing = Sizing::even(&mesh, 200);
        let (edge, here) = (sizing.edge, DVec3::ZERO);
        assert!(!sizing.shorten(vec![(here, edge)]) && !sizing.shorten(Vec::new()) && sizing.is_even());
        // The second has what it wants from the first.
        assert!(sizing.shorten(vec![(here, edge / 2.0), (here, edge / 4.0)]) && sizing.spots.len() == 1);
        assert!(sizing.at(here) == edge / 4.0 && sizing.at(DVec3::X) == edge.min(edge / 4.0 + GRADE));
        let many = (0..=MOST_SPOTS).map(|i| (DVec3::X * 10.0 * (i + 1) as f64, edge / 2.0)).collect();
        assert!(!sizing.shorten(many) && sizing.spots.len() == 1);
    }

    #[test]
    fn boxes_of_12_and_of_40_000_triangles_become_even_ones_with_their_12_lines() {
        for n in [1, 58] {
            let p = made(&shapes::cuboid(DVec3::new(1.0, 2.0, 3.0), n), 5_000);
            assert!((4_999..=5_000).contains(&p.mesh.triangles.len()), "{}", p.mesh.triangles.len());
            let least = (0..p.mesh.triangles.len()).map(|f| shape(p.mesh.corners(f))).fold(1.0, f64::min);
            assert!(least > 0.4, "{least}");
            let length: f64 =
                (0..p.lines.len() as u32).filter(|&h| p.lines[h as usize]).map(|h| p.mesh.edge_length(h)).sum();
            assert!((length - 2.0 * 24.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_strip_of_1_to_1e6_and_a_vertex_at_1e9_are_refined_to_22_triangles_for_each_one_wanted_at_most() {
        let strip = shapes::rectangle(1e6, 1.0, 60, 1);
        let mut wild = shapes::sphere(1.0, 3);
        wild.points[40] = DVec3::new(1e9, 0.0, 0.0);
        for mesh in [strip, wild] {
            let p = made(&mesh, 1000);
            let most = mesh.triangles.len() + REFINED_PER_PROXY * 1000;
            assert!(p.work.mesh.triangles.len() <= most, "{} > {most}", p.work.mesh.triangles.len());
        }
    }

    #[test]
    fn no_edge_joins_two_lines_and_no_triangle_has_two_edges_on_lines() {
        let fan = TriMesh::new(
            vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::new(0.0, 1.0, 0.5)],
            vec![[0, 1, 2], [0, 2, 3]],
        );
        let tip = 15f64.to_radians();
        let wedge = TriMesh::new(
            vec![DVec3::ZERO, DVec3::X, DVec3::new(tip.cos(), tip.sin(), 0.0), DVec3::new(1.0, 0.1, 1.0)],
            vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        );
        for mesh in [
            fan,
            wedge,
            shapes::cylinder(1.0, 0.3, 48),
            shapes::faceted_cylinder(1.0, 0.3, 48),
            shapes::annulus(0.4, 1.0, 40),
            shapes::rectangle(1.0, 0.01, 30, 1),
        ] {
            let p = made(&mesh, 800);
            let tagged = tagged(&p);
            let mut on_line = vec![false; p.mesh.points.len()];
            for h in (0..tagged.len() as u32).filter(|&h| tagged[h as usize]) {
                on_line[p.mesh.origin(h) as usize] = true;
                on_line[p.mesh.origin(next(h)) as usize] = true;
            }
            let joins = |h: u32| on_line[p.mesh.origin(h) as usize] && on_line[p.mesh.origin(next(h)) as usize];
            assert!((0..tagged.len() as u32).all(|h| tagged[h as usize] || !joins(h)));
            assert!(tagged.chunks(3).all(|t| t.iter().filter(|&&t| t).count() <= 1));
        }
    }

    #[test]
    fn a_needle_of_64_lengths_is_cut_across_into_127_triangles() {
        let (tip, end) = (DVec3::ZERO, |y: f64| DVec3::new(64.0, y, 0.0));
        let mut work = Refined::new(&TriMesh::new(vec![tip, end(-0.05), end(0.05)], vec![[0, 1, 2]]));
        for _ in 0..6 {
            work = refine::split(&work, &long(&work, |_| 1.01)).0;
            let free = vec![false; work.mesh.points.len()];
            refine::turn_inner(&mut work, &free);
        }
        assert_eq!(work.mesh.triangles.len(), 127);
        assert!(!long(&work, |_| 1.01).contains(&true));
    }

    #[test]
    fn rims_of_a_cylinder_keep_11_vertices_or_more_and_no_triangle_spans_them() {
        let p = made(&shapes::cylinder(1.0, 2.0, 200), 400);
        let rim = |z: f64| {
            let at = |h: u32| p.mesh.points[p.mesh.origin(h) as usize];
            (0..p.lines.len() as u32).filter(|&h| p.lines[h as usize] && (at(h).z - z).abs() < 1e-9).count() / 2
        };
        assert!(rim(0.0) >= 11 && rim(2.0) >= 11 && rim(0.0) < 60, "{} {}", rim(0.0), rim(2.0));
    }
}
