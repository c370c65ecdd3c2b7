//! Cones beside lines and beside each other are moved off, to where they have room.
//!
//! On whole numbers a cone may come to lie level with a line that it does not touch. A triangle between an edge of the line
//! and the cone then has no area, however the rest of the map is shaped; so has one between two cones and a line. Around a
//! cone with only free vertices beside it no triangle has three corners that are bound.

use crate::mesh::{Adjacency, NONE, TriMesh, next};
use crate::network::field::CrossField;
use crate::network::field::cones::Matching;
use std::collections::{HashMap, VecDeque};

/// Rings around the way of a cone in which the field is made smooth again: some times the way, which is one or two edges. A
/// choice, not measured.
const SMOOTHED_RINGS: usize = 5;

/// Sweeps of making it smooth: each face takes the mean of its neighbours, and what was turned by a quarter is spread over
/// the rings after about the square of their number.
const SMOOTHING_SWEEPS: usize = 2 * SMOOTHED_RINGS * SMOOTHED_RINGS;

/// A mesh whose cones are moved.
pub(super) struct Room<'a> {
    mesh: &'a TriMesh,
    adjacency: &'a Adjacency,
    /// For each half-edge whether it lies on a line or on the boundary.
    bound_edge: Vec<bool>,
    /// For each vertex whether it lies on a line or on the boundary.
    on_line: Vec<bool>,
}

impl<'a> Room<'a> {
    pub fn new(mesh: &'a TriMesh, adjacency: &'a Adjacency, lines: &[bool]) -> Room<'a> {
        let bound_edge: Vec<bool> = adjacency.opposite.iter().zip(lines).map(|(&o, &line)| line || o == NONE).collect();
        let mut on_line = vec![false; mesh.points.len()];
        for h in (0..bound_edge.len() as u32).filter(|&h| bound_edge[h as usize]) {
            on_line[mesh.origin(h) as usize] = true;
            on_line[mesh.origin(next(h)) as usize] = true;
        }
        Room { mesh, adjacency, bound_edge, on_line }
    }

    fn beside(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        self.adjacency.fan(v).map(|h| self.mesh.origin(next(h)))
    }

    /// The cones that have no room: those that stand beside a line or another cone, and those with fewer faces around them
    /// than right angles, which would be mapped to flat ones.
    /// * `index` - of each vertex
    pub fn tight(&self, index: &[i32]) -> Vec<u32> {
        let is_tight = |v: &u32| {
            let is_beside = |w: u32| self.on_line[w as usize] || index[w as usize] != 0;
            let is_cone = index[*v as usize] != 0 && !self.on_line[*v as usize];
            is_cone && self.beside(*v).any(is_beside) || self.is_short_of_faces(*v, index[*v as usize])
        };
        (0..index.len() as u32).filter(is_tight).collect()
    }

    /// True if a vertex with this index has fewer faces than right angles, and more of these than a regular one.
    fn is_short_of_faces(&self, v: u32, index: i32) -> bool {
        let regular = if self.adjacency.is_boundary_vertex(v) { 2 } else { 4 };
        index < 0 && (self.adjacency.fan(v).count() as i32) < regular - index
    }

    /// Moves `cones` to the nearest vertices with room, if there are any, and makes `theta` smooth again around their ways.
    /// Lines keep their sectors.
    pub fn move_off(
        &self,
        cones: &[u32],
        field: &CrossField,
        matching: &mut Matching,
        index: &mut [i32],
        theta: &mut [f64],
    ) {
        let mut touched = vec![false; self.mesh.points.len()];
        for &cone in cones {
            let Some(way) = self.way(cone, index) else { continue };
            for &h in &way {
                let o = self.adjacency.opposite[h as usize] as usize;
                let moved = index[self.mesh.origin(h) as usize];
                matching.turn(h as usize, o, -moved);
                index[self.mesh.origin(h) as usize] -= moved;
                index[self.mesh.origin(next(h)) as usize] += moved;
                touched[self.mesh.origin(h) as usize] = true;
                touched[self.mesh.origin(next(h)) as usize] = true;
            }
        }
        if touched.contains(&true) {
            self.smooth(touched, field, matching, theta);
        }
    }

    /// Lets vertices beside each other, off lines, share their indices evenly: opposite cones cancel, and one with two patches or
    /// fewer becomes several. Then `theta` is made smooth around all cones: where crosses were averaged away to next to nothing
    /// they may be a quarter turn off what any map can follow.
    pub fn settle(&self, field: &CrossField, matching: &mut Matching, index: &mut [i32], theta: &mut [f64]) {
        let mut touched: Vec<bool> = index.iter().map(|i| *i != 0).collect();
        let ends = |h: u32| [self.mesh.origin(h) as usize, self.mesh.origin(next(h)) as usize];
        let inner: Vec<u32> =
            (0..self.bound_edge.len() as u32).filter(|&h| ends(h).iter().all(|&v| !self.on_line[v])).collect();
        loop {
            let mut is_done = true;
            for &h in &inner {
                let [a, b] = ends(h);
                // The squares of the indices fall by each step, so there is a last one.
                if index[a] - index[b] >= 2 {
                    matching.turn(h as usize, self.adjacency.opposite[h as usize] as usize, -1);
                    index[a] -= 1;
                    index[b] += 1;
                    (touched[a], touched[b], is_done) = (true, true, false);
                }
            }
            if is_done {
                break;
            }
        }
        self.smooth(touched, field, matching, theta);
    }

    /// The half-edges from a cone to the nearest vertex with room.
    fn way(&self, cone: u32, index: &[i32]) -> Option<Vec<u32>> {
        if self.on_line[cone as usize] {
            return None;
        }
        let is_bound = |v: u32| self.on_line[v as usize] || (index[v as usize] != 0 && v != cone);
        let index_of_cone = index[cone as usize];
        let has_room = |v: u32| !self.beside(v).any(is_bound) && !self.is_short_of_faces(v, index_of_cone);
        let mut from: HashMap<u32, u32> = HashMap::from([(cone, NONE)]);
        let mut queue = VecDeque::from([cone]);
        while let Some(v) = queue.pop_front() {
            if has_room(v) {
                let mut way = Vec::new();
                let mut h = from[&v];
                while h != NONE {
                    way.push(h);
                    h = from[&self.mesh.origin(h)];
                }
                way.reverse();
                return Some(way);
            }
            for h in self.adjacency.fan(v) {
                let w = self.mesh.origin(next(h));
                if !is_bound(w) && !from.contains_key(&w) {
                    from.insert(w, h);
                    queue.push_back(w);
                }
            }
        }
        None
    }

    /// Gives each face near touched vertices the mean of its neighbours' directions, as they match; faces beside lines stay.
    fn smooth(&self, mut touched: Vec<bool>, field: &CrossField, matching: &mut Matching, theta: &mut [f64]) {
        for _ in 1..SMOOTHED_RINGS {
            let before = touched.clone();
            for h in 0..self.bound_edge.len() as u32 {
                touched[self.mesh.origin(h) as usize] |= before[self.mesh.origin(next(h)) as usize];
                touched[self.mesh.origin(next(h)) as usize] |= before[self.mesh.origin(h) as usize];
            }
        }
        let faces: Vec<usize> = (0..theta.len())
            .filter(|&f| self.mesh.triangles[f].iter().any(|&v| touched[v as usize]))
            .filter(|&f| (3 * f..3 * f + 3).all(|h| !self.bound_edge[h]))
            .collect();
        for _ in 0..SMOOTHING_SWEEPS {
            for &f in &faces {
                let drift = |h: usize| matching.drift[h] - field.opening[h];
                let step = (3 * f..3 * f + 3).map(drift).sum::<f64>() / 3.0;
                theta[f] += step;
                for h in 3 * f..3 * f + 3 {
                    matching.drift[h] -= step;
                    matching.drift[self.adjacency.opposite[h] as usize] += step;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::field::{FieldParams, field};
    use crate::observe::Silent;
    use crate::synthetic::shapes;

    /// A field on a square sheet without a cone, and how it matches.
    fn calm() -> (TriMesh, Adjacency, CrossField, Matching) {
        let mesh = shapes::rectangle(1.0, 1.0, 16, 16);
        let (adjacency, lines) = (Adjacency::new(&mesh), vec![false; 3 * mesh.triangles.len()]);
        let params = FieldParams { curvature: 0.0, smoothing: 1.0, radius: 0.1, pair_distance: 0.0 };
        let field = field(&mesh, &adjacency, &lines, &params, &Silent).unwrap();
        let matching = Matching::new(&adjacency, &field);
        (mesh, adjacency, field, matching)
    }

    /// The vertex nearest to a place of the sheet, from 0 to 1 along its sides.
    fn at(mesh: &TriMesh, x: f64, y: f64) -> u32 {
        let place = mesh.bounds().min.truncate() + glam::DVec2::new(x, y);
        let off = |v: &u32| mesh.points[*v as usize].truncate().distance_squared(place);
        (0..mesh.points.len() as u32).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap()
    }

    #[test]
    fn cones_beside_each_other_cancel_and_one_of_one_patch_becomes_three() {
        let (mesh, adjacency, field, mut matching) = calm();
        // Three quarter turns to one end of an edge and one to the other of the next, with their opposites far away.
        let column: Vec<u32> = (4..=12).map(|k| at(&mesh, 0.5, f64::from(k) / 16.0)).collect();
        for (k, pair) in column.windows(2).enumerate() {
            let h = adjacency.fan(pair[0]).find(|&h| mesh.origin(next(h)) == pair[1]).unwrap();
            matching.turn(h as usize, adjacency.opposite[h as usize] as usize, if k == 0 { 3 } else { 4 });
        }
        let mut index = matching.indices(&mesh, &adjacency);
        assert_eq!([0, 1, 8].map(|k| index[column[k] as usize]), [3, 1, -4]);
        let room = Room::new(&mesh, &adjacency, &vec![false; 3 * mesh.triangles.len()]);
        let mut theta = field.theta.clone();
        let sum = index.iter().sum::<i32>();
        room.settle(&field, &mut matching, &mut index, &mut theta);
        assert_eq!((index.iter().sum::<i32>(), &index), (sum, &matching.indices(&mesh, &adjacency)));
        let cones = |sign: i32| (0..index.len()).filter(|&v| !room.on_line[v] && index[v] == sign).count();
        assert_eq!((cones(1), cones(-1)), (4, 4));
    }

    #[test]
    fn directions_around_a_pair_of_cones_turn_evenly_after_settling() {
        let (mesh, adjacency, field, mut matching) = calm();
        let column: Vec<u32> = (4..=12).map(|k| at(&mesh, 0.5, f64::from(k) / 16.0)).collect();
        for pair in column.windows(2) {
            let h = adjacency.fan(pair[0]).find(|&h| mesh.origin(next(h)) == pair[1]).unwrap();
            matching.turn(h as usize, adjacency.opposite[h as usize] as usize, 1);
        }
        // All that the field turns by lies on the edges between the two.
        let most = |matching: &Matching| matching.drift.iter().fold(0.0f64, |m, d| m.max(d.abs()));
        assert!((most(&matching) - std::f64::consts::FRAC_PI_2).abs() < 1e-6);
        let (mut index, mut theta) = (matching.indices(&mesh, &adjacency), field.theta.clone());
        Room::new(&mesh, &adjacency, &vec![false; 3 * mesh.triangles.len()]).settle(
            &field,
            &mut matching,
            &mut index,
            &mut theta,
        );
        assert!(most(&matching) < 0.5, "{}", most(&matching));
    }

    #[test]
    fn a_cone_beside_the_rim_moves_to_where_it_has_room_and_the_indices_keep_their_sum() {
        let (mesh, adjacency, field, mut matching) = calm();
        let lines = vec![false; 3 * mesh.triangles.len()];
        // A pair of cones, drawn apart: one beside the rim, the other far inside.
        let column: Vec<u32> = (1..=8).map(|k| at(&mesh, 0.5, f64::from(k) / 16.0)).collect();
        for pair in column.windows(2) {
            let h = adjacency.fan(pair[0]).find(|&h| mesh.origin(next(h)) == pair[1]).unwrap();
            matching.turn(h as usize, adjacency.opposite[h as usize] as usize, 1);
        }
        let mut index = matching.indices(&mesh, &adjacency);
        assert_eq!((index[column[0] as usize], index[column[7] as usize]), (1, -1));
        let room = Room::new(&mesh, &adjacency, &lines);
        let tight = room.tight(&index);
        assert_eq!(tight, [column[0]]);
        let (before, mut theta) = (index.iter().sum::<i32>(), field.theta.clone());
        room.move_off(&tight, &field, &mut matching, &mut index, &mut theta);
        assert_eq!(index.iter().sum::<i32>(), before);
        assert_eq!(index, matching.indices(&mesh, &adjacency));
        assert!(room.tight(&index).is_empty());
        let moved = (0..index.len()).find(|&v| index[v] == 1 && !room.on_line[v]).unwrap();
        assert!(mesh.points[moved].distance(mesh.points[column[0] as usize]) < 2.5 / 16.0);
    }
}
