//! The equations of a seamless map, solved: every corner of every chart by the unknowns that are free.
//!
//! Charts that are not cut apart share their corners. Across a cut both sides of an edge are the same but for quarter
//! turns and one translation; on a line the coordinate across is the same at both ends of each edge. All these hold
//! exactly for any values of the free unknowns.

use super::cones::Charts;
use super::eliminate::Elimination;
use super::quarter_turn;
use crate::mesh::sets::Sets;
use crate::mesh::{Adjacency, NONE, TriMesh, next};
use crate::network::field::edge_angles;
use glam::DVec2;
use rayon::prelude::*;
use std::collections::{BTreeMap, VecDeque};
use std::f64::consts::FRAC_PI_2;

/// What is held of a map.
#[derive(Clone, Copy)]
pub(super) enum Held<'a> {
    /// One corner of each component, at the origin.
    Origin,
    /// Corners of patches, lines and translations, where this map has them. Its charts are joined where they are not cut apart.
    At(&'a [[DVec2; 3]]),
    /// The same at the whole numbers they are next to.
    Whole(&'a [[DVec2; 3]]),
}

/// The corners of all charts as linear functions of free unknowns.
#[derive(Clone)]
pub(super) struct Seams {
    /// The place of each corner of each face, among all different ones.
    pub place: Vec<[u32; 3]>,
    /// Rows by coordinate: `2 place` for u and `2 place + 1` for v; `start[row]..start[row + 1]` are its terms.
    start: Vec<u32>,
    terms: Vec<(u32, f64)>,
    constant: Vec<f64>,
    /// For each unknown the rows that it is in, transposed.
    rows_of: Vec<Vec<(u32, f64)>>,
    /// For each free unknown the coordinate that it is, or [`NONE`] for a translation.
    pub coordinate: Vec<u32>,
}

impl Seams {
    /// The equations of `charts`. `None` if they contradict each other.
    ///
    /// What is `held` beside the equations decides what is free: a map with the same charts that holds the same has the same
    /// free unknowns.
    pub fn new(mesh: &TriMesh, adjacency: &Adjacency, lines: &[bool], charts: &Charts, held: Held) -> Option<Seams> {
        Seams::solved(mesh, adjacency, lines, charts, (held, false))
    }

    /// As [`Seams::new`], with corners that hang on few unknowns each where there are many cones.
    ///
    /// The cut is a tree as a rule, with cones for ends. A translation far from the ends is the sum of those of all ends behind it: as
    /// unknowns these would be dragged along to every corner there. So of translations that meet, that with the fewest ends behind it
    /// is expressed by the others, and cones by translations: a corner of a gear hangs on 27 unknowns at most for 119.
    pub fn sparse(mesh: &TriMesh, adjacency: &Adjacency, lines: &[bool], charts: &Charts) -> Option<Seams> {
        Seams::solved(mesh, adjacency, lines, charts, (Held::Origin, true))
    }

    fn solved(
        mesh: &TriMesh,
        adjacency: &Adjacency,
        lines: &[bool],
        charts: &Charts,
        (held, is_sparse): (Held, bool),
    ) -> Option<Seams> {
        let held = match held {
            Held::Origin => None,
            Held::At(uv) => Some((uv, false)),
            Held::Whole(uv) => Some((uv, true)),
        };
        let exact = |at: DVec2| if held.is_some_and(|h| h.1) { at.round() } else { at };
        let (place, count) = places(adjacency, charts, mesh.triangles.len());
        let cuts: Vec<u32> = (0..charts.cut.len() as u32)
            .filter(|&h| charts.cut[h as usize] && h < adjacency.opposite[h as usize])
            .collect();
        let coordinates = 2 * count;
        let mut system = if is_sparse {
            let ends = ends_behind(cuts.iter().map(|&h| [mesh.origin(h), mesh.origin(next(h))]));
            Elimination::sparse(coordinates, ends.into_iter().flat_map(|n| [n; 2]).collect())
        } else {
            Elimination::new((coordinates + 2 * cuts.len() as u32) as usize, coordinates)
        };
        let corner = |h: u32, axis: u32| 2 * place[h as usize / 3][h as usize % 3] + axis;
        let mut consistent = true;
        if let Some((uv, _)) = held {
            for (v, _) in charts.corners().into_iter().enumerate().filter(|c| c.1) {
                let h = adjacency.outgoing[v];
                let at = exact(uv[h as usize / 3][h as usize % 3]);
                consistent &= system.demand(vec![(corner(h, 0), 1.0)], -at.x);
                consistent &= system.demand(vec![(corner(h, 1), 1.0)], -at.y);
            }
        }
        for place in origins(adjacency, &place, charts, held.is_some()) {
            consistent &= system.demand(vec![(2 * place, 1.0)], 0.0);
            consistent &= system.demand(vec![(2 * place + 1, 1.0)], 0.0);
        }
        for (i, &h) in cuts.iter().enumerate() {
            let o = adjacency.opposite[h as usize];
            let moved = coordinates + 2 * i as u32;
            if let Some((uv, _)) = held {
                let [here, there] = [h, next(o)].map(|h| uv[h as usize / 3][h as usize % 3]);
                let t = exact(there - quarter_turn(here, charts.jump[h as usize]));
                consistent &= system.demand(vec![(moved, 1.0)], -t.x);
                consistent &= system.demand(vec![(moved + 1, 1.0)], -t.y);
            }
            // Turned, u and v of this side are these coordinates with these signs.
            let turned = match charts.jump[h as usize] {
                0 => [(0, 1.0), (1, 1.0)],
                1 => [(1, -1.0), (0, 1.0)],
                2 => [(0, -1.0), (1, -1.0)],
                _ => [(1, 1.0), (0, -1.0)],
            };
            for (here, there) in [(h, next(o)), (next(h), o)] {
                for axis in 0..2 {
                    let (source, sign) = turned[axis as usize];
                    let terms = vec![(corner(there, axis), 1.0), (corner(here, source), -sign), (moved + axis, -1.0)];
                    consistent &= system.demand(terms, 0.0);
                }
            }
        }
        let angle = edge_angles(mesh);
        for h in 0..angle.len() as u32 {
            let o = adjacency.opposite[h as usize];
            if o == NONE || (lines[h as usize] && h < o) {
                let quarters = ((angle[h as usize] - charts.axis[h as usize / 3]) / FRAC_PI_2).round() as i64;
                let across = 1 - quarters.rem_euclid(2) as u32;
                let terms = vec![(corner(h, across), 1.0), (corner(next(h), across), -1.0)];
                consistent &= system.demand(terms, 0.0);
                if let Some((uv, _)) = held {
                    let level = exact(uv[h as usize / 3][h as usize % 3])[across as usize];
                    consistent &= system.demand(vec![(corner(h, across), 1.0)], -level);
                }
            }
        }
        consistent.then(|| Seams::of(place, coordinates, system))
    }

    /// Numbers what is left free.
    fn of(place: Vec<[u32; 3]>, coordinates: u32, mut system: Elimination) -> Seams {
        let mut number = std::collections::HashMap::new();
        let mut seams = Seams {
            place,
            start: vec![0],
            terms: Vec::new(),
            constant: Vec::new(),
            rows_of: Vec::new(),
            coordinate: Vec::new(),
        };
        for row in 0..coordinates {
            let value = system.value(row);
            for (unknown, c) in value.terms {
                let n = *number.entry(unknown).or_insert_with(|| {
                    seams.rows_of.push(Vec::new());
                    seams.coordinate.push(if unknown < coordinates { unknown } else { NONE });
                    seams.rows_of.len() as u32 - 1
                });
                seams.terms.push((n, c));
                seams.rows_of[n as usize].push((row, c));
            }
            seams.constant.push(value.constant);
            seams.start.push(seams.terms.len() as u32);
        }
        seams
    }

    /// The equations on the way from these to `to`, which hold the same at other places.
    pub fn between(&self, to: &Seams, part: f64) -> Seams {
        let constant = self.constant.iter().zip(&to.constant).map(|(a, b)| a + part * (b - a)).collect();
        Seams { constant, ..to.clone() }
    }

    /// How far the coordinates move from here to `to` while all that is free stays.
    pub fn moved(&self, to: &Seams) -> Vec<f64> {
        self.constant.iter().zip(&to.constant).map(|(a, b)| b - a).collect()
    }

    /// Number of free unknowns.
    pub fn free(&self) -> usize {
        self.rows_of.len()
    }

    /// The terms of a coordinate and its constant.
    pub fn row(&self, row: u32) -> (&[(u32, f64)], f64) {
        let range = self.start[row as usize] as usize..self.start[row as usize + 1] as usize;
        (&self.terms[range], self.constant[row as usize])
    }

    /// All coordinates from the free unknowns.
    pub fn coordinates(&self, free: &[f64]) -> Vec<f64> {
        let value = |row: u32| {
            let (terms, constant) = self.row(row);
            terms.iter().map(|&(n, c)| c * free[n as usize]).sum::<f64>() + constant
        };
        (0..self.constant.len() as u32).into_par_iter().with_min_len(1024).map(value).collect()
    }

    /// The gradient by the free unknowns from that by the coordinates.
    pub fn pull_back(&self, gradient: &[f64]) -> Vec<f64> {
        let sum = |rows: &Vec<(u32, f64)>| rows.iter().map(|&(row, c)| c * gradient[row as usize]).sum();
        self.rows_of.par_iter().with_min_len(1024).map(sum).collect()
    }

    /// Free unknowns that give these places of corners, if any do: those that are coordinates are read off, translations
    /// are not asked for.
    pub fn read(&self, uv: &[[DVec2; 3]]) -> Option<Vec<f64>> {
        let mut value = vec![f64::NAN; self.constant.len()];
        for (places, corners) in self.place.iter().zip(uv) {
            for (place, at) in places.iter().zip(corners) {
                value[2 * *place as usize] = at.x;
                value[2 * *place as usize + 1] = at.y;
            }
        }
        let free: Vec<f64> =
            self.coordinate.iter().map(|&c| value.get(c as usize).copied().unwrap_or(f64::NAN)).collect();
        free.iter().all(|v| v.is_finite()).then_some(free)
    }

    /// Corners of all faces from the free unknowns.
    pub fn corners(&self, free: &[f64]) -> Vec<[DVec2; 3]> {
        let x = self.coordinates(free);
        let at = |place: u32| DVec2::new(x[2 * place as usize], x[2 * place as usize + 1]);
        self.place.iter().map(|p| p.map(at)).collect()
    }
}

/// The places of all corners: those around a vertex are one unless a cut parts them. And their number.
fn places(adjacency: &Adjacency, charts: &Charts, faces: usize) -> (Vec<[u32; 3]>, u32) {
    let mut sets = Sets::new(3 * faces);
    for h in 0..3 * faces as u32 {
        let o = adjacency.opposite[h as usize];
        if o != NONE && !charts.cut[h as usize] {
            sets.join(h, next(o));
        }
    }
    let mut number = vec![NONE; 3 * faces];
    let mut count = 0;
    let place = (0..faces as u32)
        .map(|f| {
            [0, 1, 2].map(|k| {
                let root = sets.root(3 * f + k) as usize;
                if number[root] == NONE {
                    number[root] = count;
                    count += 1;
                }
                number[root]
            })
        })
        .collect();
    (place, count)
}

/// For each edge of a graph the number of its ends (vertices of one edge) behind it, on the side that comes free of loops first;
/// [`NONE`] for edges of loops and between them.
fn ends_behind(edges: impl Iterator<Item = [u32; 2]>) -> Vec<u32> {
    let edges: Vec<[u32; 2]> = edges.collect();
    let mut around: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (i, ends) in edges.iter().enumerate() {
        ends.iter().for_each(|v| around.entry(*v).or_default().push(i));
    }
    let mut left: BTreeMap<u32, usize> = around.iter().map(|(&v, list)| (v, list.len())).collect();
    let mut behind = vec![NONE; edges.len()];
    let mut bare: VecDeque<u32> = left.iter().filter(|(_, n)| **n == 1).map(|(&v, _)| v).collect();
    while let Some(v) = bare.pop_front() {
        let known = around[&v].iter().filter(|&&i| behind[i] != NONE).map(|&i| behind[i]).sum::<u32>();
        let Some(&i) = around[&v].iter().find(|&&i| behind[i] == NONE) else { continue };
        behind[i] = known.max(1);
        let other = edges[i][usize::from(edges[i][0] == v)];
        for v in [v, other] {
            left.entry(v).and_modify(|n| *n -= 1);
        }
        if left[&other] == 1 {
            bare.push_back(other);
        }
    }
    behind
}

/// One place of each component of the mesh; with `loose`, of those components only that have no corner.
fn origins(adjacency: &Adjacency, place: &[[u32; 3]], charts: &Charts, loose: bool) -> Vec<u32> {
    let mut sets = Sets::new(place.len());
    for h in 0..3 * place.len() as u32 {
        let o = adjacency.opposite[h as usize];
        if o != NONE {
            sets.join(h / 3, o / 3);
        }
    }
    let mut has_corner = vec![false; place.len()];
    for (v, _) in charts.corners().into_iter().enumerate().filter(|c| loose && c.1) {
        has_corner[sets.root(adjacency.outgoing[v] / 3) as usize] = true;
    }
    let components = (0..place.len() as u32).filter(|&f| sets.root(f) == f && !has_corner[f as usize]);
    components.map(|f| place[f as usize][0]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn behind_an_edge_of_a_tree_are_the_ends_of_its_smaller_side_and_a_loop_has_none() {
        // A path 0-1-2-3-4 with twigs 5 and 6 at 2 and 7 at 3, and a triangle that hangs on 8.
        let tree = [[0, 1], [1, 2], [2, 3], [3, 4], [2, 5], [2, 6], [3, 7]];
        assert_eq!(ends_behind(tree.into_iter()), [1, 1, 2, 1, 1, 1, 1]);
        assert_eq!(ends_behind([[8, 9], [9, 10], [10, 11], [11, 9]].into_iter()), [1, NONE, NONE, NONE]);
    }
}
