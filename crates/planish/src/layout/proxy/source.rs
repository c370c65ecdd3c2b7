//! Proxies of one mesh, of any lengths of edges, made from what they have in common.
//!
//! The input is refined and taken to the edges of [`LEVELS`] once; a proxy begins with the coarsest level that is finer than it is
//! anywhere, and one that was made is given again.

use super::melt::Melt;
use super::refine::{self, Refined};
use super::{Proxy, Sizing};
use crate::layout::carry;
use crate::mesh::{Adjacency, NONE, TriMesh, next};
use crate::observe::Observer;
use glam::DVec3;
use std::f64::consts::SQRT_2;
use std::rc::Rc;

/// Longest edge of the refined mesh in edges of the proxy: short enough to choose from.
const FINE: f64 = 0.6;

/// Triangles of the refined mesh at most, besides those of the input, for each one of the proxy. Halving edges until none is
/// longer than [`FINE`] leaves up to 4 / FINE^2 = 11 even ones; twice as many are for thin triangles. Needles, which would
/// take any number, stay longer.
const REFINED_PER_PROXY: usize = 22;

/// Rounds of splitting; each halves an edge.
const SPLIT_ROUNDS: usize = 14;

/// Edges of the even proxy to those of a level, the finest first. By [`FINE`] proxies with edges of a quarter of the length somewhere
/// begin with the last. Chosen: with a level of a quarter scans had other networks, with seams that bent more (decision 0058).
const LEVELS: [usize; 2] = [16, 8];

/// What proxies of a mesh are made from.
pub(in crate::layout) struct Source<'a> {
    pub mesh: &'a TriMesh,
    /// For each half-edge whether it is on a sharp line.
    sharp: &'a [bool],
    even: Sizing,
    /// What was made so far.
    stock: Option<Stock>,
}

struct Stock {
    /// Proxies with the lengths of their edges, the even one first.
    made: Vec<(Sizing, Rc<Proxy>)>,
    /// Between the refined input and the even proxy, with the lengths of edges, the coarsest last.
    levels: Vec<(f64, Melt)>,
}

impl<'a> Source<'a> {
    /// For even proxies of so many triangles, and for finer ones.
    /// * `sharp` - for each half-edge whether it is on a sharp line
    pub fn new(mesh: &'a TriMesh, sharp: &'a [bool], triangles: usize) -> Source<'a> {
        Source { mesh, sharp, even: Sizing::even(mesh, triangles), stock: None }
    }

    /// Edges as long everywhere.
    pub fn even(&self) -> &Sizing {
        &self.even
    }

    /// A proxy with edges of about this length: longer ones are not possible where lines are dense.
    ///
    /// No edge but those of lines and of the boundary joins two vertices on them, and no triangle has two edges on them.
    /// * `sizing` - [`Source::even`], or shorter
    ///
    /// `None` if cancelled, or if the mesh has no area.
    pub fn proxy(&mut self, sizing: &Sizing, observer: &dyn Observer) -> Option<Rc<Proxy>> {
        if !(sizing.edge.is_finite() && sizing.edge > 0.0) {
            return None;
        }
        if self.stock.is_none() {
            self.stock = Some(self.stocked(observer)?);
        }
        let stock = self.stock.as_ref()?;
        if let Some((_, proxy)) = stock.made.iter().find(|(other, _)| other == sizing) {
            return Some(proxy.clone());
        }
        let melt = self.level(stock, sizing).unwrap_or_else(|| self.refined(sizing));
        observer.progress(0.2);
        let proxy = made(melt, sizing, observer)?;
        self.stock.as_mut()?.made.push((sizing.clone(), proxy.clone()));
        Some(proxy)
    }

    /// The even proxy, with the levels on the way to it. `None` if cancelled.
    fn stocked(&self, observer: &dyn Observer) -> Option<Stock> {
        let mut melt = self.refined(&self.even);
        observer.progress(0.2);
        let mut levels = Vec::with_capacity(LEVELS.len());
        let triangles = self.even.triangles(&melt.work.mesh);
        for parts in LEVELS {
            let wanted = parts * parts * triangles;
            if wanted < melt.left {
                let edge = self.even.edge / parts as f64;
                melt.want(|_| edge);
                melt.thin(wanted, observer);
                levels.push((edge, melt.clone()));
            }
        }
        let even = made(melt, &self.even, observer)?;
        Some(Stock { made: vec![(self.even.clone(), even)], levels })
    }

    /// The coarsest of all levels, the refined input among them, that is fine enough for a proxy.
    fn level(&self, stock: &Stock, sizing: &Sizing) -> Option<Melt> {
        let even = &stock.made.first()?.1;
        let (work, adjacency) = (&even.work, &even.work_adjacency);
        // Where the input is coarse it is refined anew.
        if long(work, adjacency, |p| FINE * sizing.at(p)).contains(&true) {
            return None;
        }
        let least = FINE * sizing.least();
        let level = stock.levels.iter().rev().find(|(edge, _)| *edge <= least);
        let melt = level.map(|(_, melt)| melt.clone());
        Some(melt.unwrap_or_else(|| Melt::new(work.clone(), adjacency.clone(), tags(work, adjacency, self.sharp))))
    }

    /// The input without edges longer than a part of those wanted, as far as there may be so many triangles, and without what
    /// a map cannot use; nothing is taken out yet.
    fn refined(&self, sizing: &Sizing) -> Melt {
        let mut work = Refined::new(self.mesh);
        let (bound, _) = lines(&work, self.sharp);
        refine::split_faces(&mut work, |f| (0..3).all(|k| bound[3 * f as usize + k]));
        let (tagged, on_line) = lines(&work, self.sharp);
        let joins = work.edges(|h, [a, b]| on_line[a as usize] && on_line[b as usize] && !tagged[h as usize]);
        work = refine::split(&work, &joins).0;
        let most = |work: &TriMesh| {
            self.mesh.triangles.len().saturating_add(REFINED_PER_PROXY.saturating_mul(sizing.triangles(work)))
        };
        for _ in 0..SPLIT_ROUNDS {
            let chosen = long(&work, &Adjacency::new(&work.mesh), |p| FINE * sizing.at(p));
            if refine::count(&work, &chosen) > most(&work.mesh) {
                break;
            }
            let (finer, from) = refine::split(&work, &chosen);
            if from.len() == work.parent.len() {
                break;
            }
            work = finer;
            let (_, on_line) = lines(&work, self.sharp);
            refine::turn_inner(&mut work, &on_line);
        }
        let adjacency = Adjacency::new(&work.mesh);
        let tagged = tags(&work, &adjacency, self.sharp);
        Melt::new(Rc::new(work), Rc::new(adjacency), tagged)
    }
}

/// The proxy that a mesh becomes. `None` if cancelled.
fn made(mut melt: Melt, sizing: &Sizing, observer: &dyn Observer) -> Option<Rc<Proxy>> {
    melt.want(|p| sizing.at(p));
    melt.run(sizing.triangles(&melt.work.mesh), observer);
    (!observer.cancelled()).then(|| Rc::new(Proxy::of(melt)))
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
fn long(work: &Refined, adjacency: &Adjacency, longest: impl Fn(DVec3) -> f64) -> Vec<bool> {
    let mut length = vec![0.0; adjacency.opposite.len()];
    for (h, &o) in (0u32..).zip(&adjacency.opposite) {
        let [a, b] = [h, next(h)].map(|h| work.mesh.points[work.mesh.origin(h) as usize]);
        length[h as usize] = if o < h { length[o as usize] } else { a.distance(b) / longest(a.midpoint(b)) };
    }
    let length = |h: u32| length[h as usize];
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
    use super::*;
    use crate::Silent;
    use crate::layout::proxy::even;
    use crate::synthetic::shapes;

    #[test]
    fn proxies_of_one_mesh_are_as_fine_as_asked_where_they_are_asked_and_begin_with_the_coarsest_level_that_allows_it()
    {
        let mesh = shapes::sphere(1.0, 5);
        let sharp = vec![false; 3 * mesh.triangles.len()];
        let mut source = Source::new(&mesh, &sharp, 70);
        let even = source.even().clone();
        let whole = source.proxy(&even, &Silent).expect("a proxy");
        assert!(whole.mesh.triangles.len() <= 70);
        let place = mesh.points[0];
        for (parts, begins) in [(2.0, 1), (4.0, 1), (5.0, 0), (7.0, 0)] {
            let mut finer = even.clone();
            assert!(finer.shorten(vec![(place, even.edge / parts)]));
            let stock = source.stock.as_ref().expect("levels");
            let steps = |level: usize| stock.levels.get(level).map_or(0, |(_, melt)| melt.steps.len());
            assert_eq!(source.level(stock, &finer).map(|melt| melt.steps.len()), Some(steps(begins)));
            let proxy = source.proxy(&finer, &Silent).expect("a proxy");
            let of = |p: &Proxy, f: usize| p.mesh.corners(f).iter().map(|c| c.distance(place)).fold(0.0, f64::max);
            let near = |p: &Proxy| (0..p.mesh.triangles.len()).filter(|&f| of(p, f) < even.edge).count();
            assert!(near(&proxy) as f64 > parts * near(&whole) as f64, "{parts}: {} {}", near(&proxy), near(&whole));
            let expected = finer.triangles(&mesh);
            assert!((9 * expected / 10..=expected).contains(&proxy.mesh.triangles.len()));
        }
        // Shorter than the mesh allows: it is refined anew.
        let mut finest = even.clone();
        assert!(finest.shorten(vec![(place, even.edge / 40.0)]));
        assert!(source.level(source.stock.as_ref().expect("levels"), &finest).is_none());
        assert!(source.proxy(&finest, &Silent).is_some_and(|p| !Rc::ptr_eq(&p.work, &whole.work)));
    }

    #[test]
    fn a_strip_of_1_to_1e6_and_a_vertex_at_1e9_are_refined_to_22_triangles_for_each_one_wanted_at_most() {
        let strip = shapes::rectangle(1e6, 1.0, 60, 1);
        let mut wild = shapes::sphere(1.0, 3);
        wild.points[40] = DVec3::new(1e9, 0.0, 0.0);
        for mesh in [strip, wild] {
            let p = even(&mesh, &vec![false; 3 * mesh.triangles.len()], 1000);
            let most = mesh.triangles.len() + REFINED_PER_PROXY * 1000;
            assert!(p.work.mesh.triangles.len() <= most, "{} > {most}", p.work.mesh.triangles.len());
        }
    }

    #[test]
    fn a_needle_of_64_lengths_is_cut_across_into_127_triangles() {
        let (tip, end) = (DVec3::ZERO, |y: f64| DVec3::new(64.0, y, 0.0));
        let mut work = Refined::new(&TriMesh::new(vec![tip, end(-0.05), end(0.05)], vec![[0, 1, 2]]));
        for _ in 0..6 {
            work = refine::split(&work, &long(&work, &Adjacency::new(&work.mesh), |_| 1.01)).0;
            let free = vec![false; work.mesh.points.len()];
            refine::turn_inner(&mut work, &free);
        }
        assert_eq!(work.mesh.triangles.len(), 127);
        assert!(!long(&work, &Adjacency::new(&work.mesh), |_| 1.01).contains(&true));
    }
}
