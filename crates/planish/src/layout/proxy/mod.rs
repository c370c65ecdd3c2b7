//! Other meshes of the same surface to lay out on: finer where the input is too coarse, coarser where it is finer than a
//! layout needs, each with the way back.
//!
//! A *proxy* is an even mesh of some thousand triangles. The input is refined first ([`refine`]): edges much longer than
//! wanted are split, needles across, and so is what a map cannot use: edges between two vertices of lines that are no line themselves,
//! for both ends are bound; triangles with two edges on lines, for their corner has nothing to bend. Then vertices are
//! taken out one by one ([`melt`]); what the proxies of one mesh have in common is done once ([`source`]). Curves drawn on the proxy
//! are carried back through the same steps ([`strands`]).

pub(super) mod coarse;
mod melt;
pub(super) mod refine;
mod regain;
mod source;
mod strands;

use self::melt::Melt;
use self::refine::Refined;
use self::regain::History;
pub(super) use self::source::Source;
use self::strands::{Step, Strands};
use crate::layout::complex::Complex;
use crate::layout::network;
use crate::mesh::{Adjacency, NONE, TriMesh};
use crate::network::Network;
use glam::DVec3;
use std::cell::OnceCell;
use std::collections::HashSet;
use std::rc::Rc;

/// Area of an equilateral triangle with edges of length 1.
pub(super) const EQUILATERAL: f64 = 0.433_012_701_892_219_3;

/// Places with shorter edges at most: every length looks at all of them. Where more ask for room, as in soups of triangles,
/// all of the mesh is too coarse, and shorter edges here and there help no longer.
const MOST_SPOTS: usize = 256;

/// How fast edges get longer away from a spot: neighbours differ by a third, which leaves room for good triangles.
const GRADE: f64 = 0.3;

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
#[derive(Clone, Debug, PartialEq)]
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

    /// The shortest wanted.
    fn least(&self) -> f64 {
        self.spots.iter().map(|spot| spot.1).fold(self.edge, f64::min)
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

impl Proxy {
    /// What is left of a mesh.
    fn of(melt: Melt) -> Proxy {
        let work = melt.work.clone();
        let used = |v: &u32| !melt.around[*v as usize].is_empty();
        let vertex: Vec<u32> = (0..work.mesh.points.len() as u32).filter(used).collect();
        let face: Vec<u32> = (0..melt.triangles.len() as u32).filter(|&f| melt.is_live(f)).collect();
        let mut number = vec![NONE; work.mesh.points.len()];
        vertex.iter().enumerate().for_each(|(i, &v)| number[v as usize] = i as u32);
        let points = vertex.iter().map(|&v| work.mesh.points[v as usize]).collect();
        let triangles = face.iter().map(|&f| melt.triangles[f as usize].map(|v| number[v as usize])).collect();
        let tagged = face.iter().flat_map(|&f| (0..3).map(move |k| 3 * f + k)).map(|h| melt.tagged[h as usize]);
        let mesh = TriMesh::new(points, triangles);
        let adjacency = Adjacency::new(&mesh);
        let lines = tagged.zip(&adjacency.opposite).map(|(tag, &o)| tag && o != NONE).collect();
        let (history, taken_back) = (Rc::default(), HashSet::new());
        let (work_adjacency, steps) = (melt.work_adjacency, Rc::new(melt.steps));
        Proxy { mesh, adjacency, lines, work, work_adjacency, steps, history, taken_back, vertex, face }
    }

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

/// A proxy of so many triangles with edges as long everywhere.
#[cfg(test)]
pub(super) fn even(mesh: &TriMesh, sharp: &[bool], triangles: usize) -> Rc<Proxy> {
    let mut source = Source::new(mesh, sharp, triangles);
    let sizing = source.even().clone();
    source.proxy(&sizing, &crate::Silent).expect("a proxy")
}

#[cfg(test)]
mod tests {
    use super::melt::shape;
    use super::*;
    use crate::mesh::{next, sharp_edges};
    use crate::synthetic::shapes;
    use glam::DVec3;

    fn made(mesh: &TriMesh, wanted: usize) -> Rc<Proxy> {
        even(mesh, &sharp_edges(mesh, &Adjacency::new(mesh), 40.0), wanted)
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
        assert!(!sizing.shorten(vec![(here, edge)]) && !sizing.shorten(Vec::new()) && sizing.spots.is_empty());
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
    fn rims_of_a_cylinder_keep_11_vertices_or_more_and_no_triangle_spans_them() {
        let p = made(&shapes::cylinder(1.0, 2.0, 200), 400);
        let rim = |z: f64| {
            let at = |h: u32| p.mesh.points[p.mesh.origin(h) as usize];
            (0..p.lines.len() as u32).filter(|&h| p.lines[h as usize] && (at(h).z - z).abs() < 1e-9).count() / 2
        };
        assert!(rim(0.0) >= 11 && rim(2.0) >= 11 && rim(0.0) < 60, "{} {}", rim(0.0), rim(2.0));
    }
}
