//! The first cells of a layout: a centroidal partition of the faces into disks that respects sharp lines.
//!
//! 1. sites by farthest-point sampling, at least one per region between sharp lines;
//! 2. Lloyd's iteration: grow all cells from their sites, move every site to the middle of its cell;
//! 3. wherever a cell is no disk, or meets itself across a sharp line, add sites there and grow again; also where
//!    its front first closes around the hole or handle.
//!
//! Eck and Hoppe, *Automatic Reconstruction of B-Spline Surfaces of Arbitrary Topological Type*, 1996, start from such
//! cells, too.

pub(super) mod outline;
pub(super) mod polygon;
pub(super) mod tips;

use super::LayoutError;
use crate::geom::graph::{Dense, Reached, Search};
use crate::mesh::{Adjacency, NONE, TriMesh, next, previous};
use crate::observe::Observer;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};

/// Rounds of Lloyd relaxation; the cells hardly change after these.
const LLOYD_ROUNDS: usize = 5;

/// Rounds of adding sites one per bad cell before they are added by the handful.
const GENTLE_ROUNDS: usize = 40;

/// Fewest cells of a closed component: those of a cube.
const CLOSED_CELLS: usize = 6;

/// What the partition works on.
pub(super) struct Ground<'a> {
    pub mesh: &'a TriMesh,
    pub adjacency: &'a Adjacency,
    /// Half-edges on sharp lines.
    pub sharp: &'a [bool],
    centroid: Vec<DVec3>,
    area: Vec<f64>,
}

impl<'a> Ground<'a> {
    pub fn new(mesh: &'a TriMesh, adjacency: &'a Adjacency, sharp: &'a [bool]) -> Ground<'a> {
        let faces = 0..mesh.triangles.len();
        let centroid = faces.clone().map(|f| mesh.corners(f).into_iter().sum::<DVec3>() / 3.0).collect();
        Ground { mesh, adjacency, sharp, centroid, area: faces.map(|f| mesh.area(f)).collect() }
    }

    fn neighbours(&self, f: u32) -> impl Iterator<Item = u32> + '_ {
        (3 * f..3 * f + 3).filter_map(|h| {
            let o = self.adjacency.opposite[h as usize];
            (o != NONE && !self.sharp[h as usize]).then_some(o / 3)
        })
    }

    /// Vertices next to a vertex.
    pub fn around(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        self.adjacency.fan(v).flat_map(|h| [self.mesh.origin(next(h)), self.mesh.origin(previous(h))])
    }

    /// True for a vertex on a sharp line or on the boundary.
    pub fn is_fixed(&self, v: u32) -> bool {
        self.adjacency.is_boundary_vertex(v) || self.adjacency.fan(v).any(|h| self.sharp[h as usize])
    }

    /// Area that belongs to a vertex: a third of each face around.
    pub fn share(&self, v: u32) -> f64 {
        self.adjacency.fan(v).map(|h| self.area[h as usize / 3]).sum::<f64>() / 3.0
    }

    /// Shortens ways by those from `sources`, faces with the names of their cells; the last step to a face is the name of
    /// its cell.
    fn grow(&self, sources: &[(u32, u32)], ways: &mut Dense) {
        let mut search = Search::over(ways);
        for &(f, cell) in sources {
            // A site is its own even where another lies at the same place.
            search.reached.set(f, f64::INFINITY, NONE);
            search.reach(f, 0.0, cell);
        }
        while let Some((f, d)) = search.settle() {
            let cell = search.reached.via(f);
            for g in self.neighbours(f) {
                search.reach(g, d + self.centroid[f as usize].distance(self.centroid[g as usize]), cell);
            }
        }
    }

    /// Cells grown from `sites`.
    fn cells(&self, sites: &[u32]) -> Dense {
        let sources: Vec<_> = sites.iter().enumerate().map(|(l, &f)| (f, l as u32)).collect();
        let mut ways = Dense::new(self.area.len());
        self.grow(&sources, &mut ways);
        ways
    }

    /// For each cell the face nearest to its centroid.
    fn middles(&self, label: &[u32], count: usize) -> Vec<u32> {
        let mut sum = vec![(DVec3::ZERO, 0.0); count];
        for (f, &l) in label.iter().enumerate() {
            let s = &mut sum[l as usize];
            // A degenerate face still counts a little, so that a cell of such faces has a middle.
            let w = self.area[f] + f64::MIN_POSITIVE;
            *s = (s.0 + self.centroid[f] * w, s.1 + w);
        }
        let mut best = vec![(f64::INFINITY, NONE); count];
        for (f, &l) in label.iter().enumerate() {
            let (s, w) = sum[l as usize];
            let d = self.centroid[f].distance_squared(s / w);
            if d < best[l as usize].0 || best[l as usize].1 == NONE {
                best[l as usize] = (d, f as u32);
            }
        }
        best.into_iter().map(|b| b.1).collect()
    }

    /// Sites by farthest-point sampling: one per region (more where the surface is closed), then up to `count` and
    /// until no face is further than `reach` from its site or there are `most`.
    fn sample(&self, count: usize, reach: f64, most: usize) -> Vec<u32> {
        let n = self.area.len();
        let mut region = vec![NONE; n];
        let mut closed = Vec::new();
        let mut first = Vec::new();
        for f in 0..n as u32 {
            if region[f as usize] != NONE {
                continue;
            }
            let r = first.len() as u32;
            first.push(f);
            region[f as usize] = r;
            let (mut stack, mut open) = (vec![f], false);
            while let Some(f) = stack.pop() {
                open |=
                    (3 * f..3 * f + 3).any(|h| self.sharp[h as usize] || self.adjacency.opposite[h as usize] == NONE);
                for g in self.neighbours(f) {
                    if region[g as usize] == NONE {
                        region[g as usize] = r;
                        stack.push(g);
                    }
                }
            }
            closed.push(!open);
        }
        let mut ways = Dense::new(n);
        let mut sites = Vec::new();
        let mut add = |f: u32, ways: &mut Dense| {
            self.grow(&[(f, sites.len() as u32)], ways);
            sites.push(f);
        };
        let nearer = |ways: &Dense, a: u32, b: u32| ways.distance(a).total_cmp(&ways.distance(b)).then(b.cmp(&a));
        for (r, &f) in first.iter().enumerate() {
            add(f, &mut ways);
            if closed[r] {
                let members: Vec<u32> = (0..n as u32).filter(|&f| region[f as usize] == r as u32).collect();
                for _ in 1..CLOSED_CELLS.min(members.len()) {
                    let far = members.iter().copied().max_by(|&a, &b| nearer(&ways, a, b));
                    add(far.expect("a face"), &mut ways);
                }
            }
        }
        let mut left = count.saturating_sub(first.len());
        let mut room = most.saturating_sub(first.len()).max(left);
        while room > 0 {
            room -= 1;
            match (0..n as u32).max_by(|&a, &b| nearer(&ways, a, b)) {
                Some(f) if ways.distance(f) > if left > 0 { 0.0 } else { reach } => add(f, &mut ways),
                _ => break,
            }
            left = left.saturating_sub(1);
        }
        sites
    }

    /// True for half-edges between two cells, on sharp lines and on the boundary.
    pub fn barriers(&self, label: &[u32]) -> Vec<bool> {
        (0..self.sharp.len())
            .map(|h| {
                let o = self.adjacency.opposite[h];
                o == NONE || self.sharp[h] || label[h / 3] != label[o as usize / 3]
            })
            .collect()
    }

    /// For each cell marked `bad` the face where its front, growing from the site, first closes around a hole or a
    /// handle: the nearest edge of the cell's cut graph, which is what no path from the site crosses, without its loose
    /// ends.
    fn meetings(&self, label: &[u32], distance: &[f64], barrier: &[bool], bad: &[bool]) -> Vec<u32> {
        let is_cut = |h: u32| {
            let o = self.adjacency.opposite[h as usize];
            !barrier[h as usize]
                && self.parent(distance, barrier, h / 3) != h
                && self.parent(distance, barrier, o / 3) != o
        };
        let cut: Vec<u32> = (0..label.len() as u32)
            .into_par_iter()
            .filter(|&f| bad[label[f as usize] as usize])
            .flat_map_iter(|f| (3 * f..3 * f + 3).filter(|&h| h < self.adjacency.opposite[h as usize] && is_cut(h)))
            .collect();
        let ends = |h: u32| [self.mesh.origin(h), self.mesh.origin(next(h))];
        let mut at: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (i, &h) in cut.iter().enumerate() {
            ends(h).iter().for_each(|&v| at.entry(v).or_default().push(i));
        }
        // The boundary of a cell holds what ends there.
        let rim = |v: u32| self.adjacency.fan(v).any(|h| barrier[h as usize] || barrier[previous(h) as usize]);
        let mut loose: Vec<u32> =
            at.iter().filter(|(v, edges)| edges.len() == 1 && !rim(**v)).map(|(&v, _)| v).collect();
        let mut held = vec![true; cut.len()];
        while let Some(v) = loose.pop() {
            let Some(&i) = at[&v].iter().find(|&&i| held[i]) else { continue };
            held[i] = false;
            let other = ends(cut[i]).into_iter().find(|&w| w != v).expect("two ends");
            if at[&other].iter().filter(|&&j| held[j]).count() == 1 && !rim(other) {
                loose.push(other);
            }
        }
        let cut = cut.into_iter().zip(held).filter(|x| x.1).map(|x| x.0);
        let mut nearest: BTreeMap<u32, (f64, u32)> = BTreeMap::new();
        for f in cut.flat_map(|h| [h / 3, self.adjacency.opposite[h as usize] / 3]) {
            let here = (distance[f as usize], f);
            let best = nearest.entry(label[f as usize]).or_insert(here);
            if here.0.total_cmp(&best.0).then(here.1.cmp(&best.1)).is_lt() {
                *best = here;
            }
        }
        nearest.into_values().map(|n| n.1).collect()
    }

    /// The half-edge of face `f` towards its site: the neighbour that is nearest to it. [`NONE`] at the site.
    fn parent(&self, distance: &[f64], barrier: &[bool], f: u32) -> u32 {
        let near = |h: u32| {
            (distance[self.adjacency.opposite[h as usize] as usize / 3], self.adjacency.opposite[h as usize] / 3)
        };
        let own = (distance[f as usize], f);
        let less = |a: (f64, u32), b: (f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).is_lt();
        (3 * f..3 * f + 3)
            .filter(|&h| !barrier[h as usize] && less(near(h), own))
            .min_by(|&g, &h| near(g).0.total_cmp(&near(h).0).then(near(g).1.cmp(&near(h).1)))
            .unwrap_or(NONE)
    }

    /// Faces where a site is wanted because their cell is no disk or meets itself across a sharp line.
    fn wanted(&self, label: &[u32], distance: &[f64], count: usize, eager: bool) -> Vec<u32> {
        let barrier = self.barriers(label);
        // Euler characteristic of the cell cut open along its barriers: inner vertices - inner edges + faces.
        let mut euler = vec![0i64; count];
        let mut far: Vec<(f64, u32)> = vec![(-1.0, NONE); count];
        let mut own: HashMap<u32, [u32; 2]> = HashMap::new();
        for f in 0..label.len() {
            let c = label[f] as usize;
            euler[c] += 1;
            if distance[f] > far[c].0 {
                far[c] = (distance[f], f as u32);
            }
        }
        for h in 0..barrier.len() {
            let o = self.adjacency.opposite[h];
            if o == NONE || (o as usize) < h {
                continue;
            }
            if !barrier[h] {
                euler[label[h / 3] as usize] -= 1;
            } else if label[h / 3] == label[o as usize / 3] {
                own.entry(label[h / 3]).or_insert([h as u32 / 3, o / 3]);
            }
        }
        for v in 0..self.mesh.points.len() as u32 {
            let mut inner = !self.adjacency.is_boundary_vertex(v);
            let mut last = NONE;
            for h in self.adjacency.fan(v) {
                inner &= !barrier[h as usize] && !barrier[previous(h) as usize];
                last = label[h as usize / 3];
            }
            if inner && last != NONE {
                euler[last as usize] += 1;
            }
        }
        let mut wanted = Vec::new();
        let mut bad = vec![false; count];
        for c in 0..count as u32 {
            if euler[c as usize] != 1 {
                bad[c as usize] = true;
                wanted.push(far[c as usize].1);
            }
            if let Some(pair) = own.get(&c) {
                wanted.extend(pair);
            }
        }
        wanted.extend(self.meetings(label, distance, &barrier, &bad));
        if eager {
            let mut bad = vec![false; count];
            wanted.iter().for_each(|&f| bad[label[f as usize] as usize] = true);
            wanted.extend((0..label.len() as u32).filter(|&f| f % 7 == 0 && bad[label[f as usize] as usize]));
        }
        wanted.sort_unstable();
        wanted.dedup();
        wanted
    }
}

/// Parts the faces into about `count` cells (up to `most` where one would reach further than `reach`), each a disk that does not
/// meet itself: a label per face and the number of labels.
pub(super) fn partition(
    ground: &Ground,
    count: usize,
    (reach, most): (f64, usize),
    observer: &dyn Observer,
) -> Result<(Vec<u32>, usize), LayoutError> {
    let mut sites = ground.sample(count, reach, most);
    for _ in 0..LLOYD_ROUNDS {
        observer.check()?;
        sites = ground.middles(&ground.cells(&sites).via, sites.len());
    }
    let mut ways = ground.cells(&sites);
    let mut is_site = vec![false; ways.via.len()];
    sites.iter().for_each(|&f| is_site[f as usize] = true);
    for round in 0.. {
        observer.check()?;
        let mut wanted = ground.wanted(&ways.via, &ways.distance, sites.len(), round >= GENTLE_ROUNDS);
        wanted.retain(|&f| !std::mem::replace(&mut is_site[f as usize], true));
        if wanted.is_empty() {
            return Ok((ways.via, sites.len()));
        }
        let first = sites.len() as u32;
        let sources: Vec<(u32, u32)> = wanted.iter().enumerate().map(|(i, &f)| (f, first + i as u32)).collect();
        ground.grow(&sources, &mut ways);
        sites.extend(wanted);
    }
    unreachable!("the rounds end when every face is its own cell")
}

/// The next half-edge around a cell after boundary half-edge `h`.
pub(super) fn next_around(adjacency: &Adjacency, barrier: &[bool], h: u32) -> u32 {
    let mut g = next(h);
    while !barrier[g as usize] {
        g = next(adjacency.opposite[g as usize]);
    }
    g
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Silent;
    use crate::synthetic::shapes;

    #[test]
    fn a_strip_of_1_to_1e6_gets_30_cells_where_30_are_the_most_and_not_one_for_each_face() {
        let strip = shapes::rectangle(1e6, 1.0, 300, 1);
        let adjacency = Adjacency::new(&strip);
        let sharp = vec![false; 3 * strip.triangles.len()];
        let ground = Ground::new(&strip, &adjacency, &sharp);
        let (_, count) = partition(&ground, 2, (10.0, 30), &Silent).unwrap();
        assert!((29..=30).contains(&count), "{count}");
    }
}
