//! How the crosses of neighbouring faces match, and the cones where they cannot match all around a vertex.
//!
//! Ray, Vallet, Li, Lévy, *N-Symmetry Direction Field Design*, 2008, for the index of a vertex.

use super::sectors::corner_angle;
use super::{CrossField, Energy};
use crate::mesh::{Adjacency, NONE, TriMesh};
use crate::observe::{Cancelled, Observer};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Rounds of smoothing around pairs of cones; each takes a wider piece of the surface.
const PAIRING_ROUNDS: usize = 3;

/// Radius of the first such piece, in distances between the two cones.
const PAIRING_REACH: f64 = 1.5;

/// How crosses match across edges.
pub(crate) struct Matching {
    /// For each half-edge the quarter turns, counter-clockwise, from the direction `theta` of its face to that of the face
    /// across: 0 to 3; 0 on the boundary.
    pub turns: Vec<u8>,
    /// For each half-edge what the field turns by on the way across beyond that, radians.
    pub drift: Vec<f64>,
}

impl Matching {
    pub fn new(adjacency: &Adjacency, field: &CrossField) -> Matching {
        let count = adjacency.opposite.len();
        let (mut turns, mut drift) = (vec![0u8; count], vec![0.0; count]);
        for h in 0..count {
            let o = adjacency.opposite[h];
            if o == NONE || o < h as u32 {
                continue;
            }
            let turn = field.theta[o as usize / 3] - field.theta[h / 3] - field.transport[h];
            let quarters = (turn / FRAC_PI_2).round();
            turns[h] = (quarters as i64).rem_euclid(4) as u8;
            turns[o as usize] = (4 - turns[h]) % 4;
            drift[h] = turn - quarters * FRAC_PI_2 + field.opening[h];
            drift[o as usize] = -drift[h];
        }
        Matching { turns, drift }
    }

    /// Turns the match across half-edge `h`, with opposite `o`, by quarters: that many more are missing around its start,
    /// and that many fewer around its end.
    pub fn turn(&mut self, h: usize, o: usize, quarters: i32) {
        self.turns[h] = (i32::from(self.turns[h]) + quarters).rem_euclid(4) as u8;
        self.turns[o] = (4 - self.turns[h]) % 4;
        self.drift[h] -= f64::from(quarters) * FRAC_PI_2;
        self.drift[o] += f64::from(quarters) * FRAC_PI_2;
    }

    /// For each inner vertex the quarter turns that are missing around it: 1 where three patches meet, -1 where five do, 0
    /// where four do; for each vertex of the boundary those that are missing to half a turn. On a closed mesh they sum to four
    /// times its Euler number, and so they do on one with boundaries.
    pub fn indices(&self, mesh: &TriMesh, adjacency: &Adjacency) -> Vec<i32> {
        let index = |v: u32| {
            if adjacency.outgoing[v as usize] == NONE {
                return 0;
            }
            let whole = if adjacency.is_boundary_vertex(v) { PI } else { TAU };
            // Around a vertex edges are crossed out of the faces before them.
            let around = adjacency.fan(v).map(|h| {
                let o = adjacency.opposite[h as usize];
                corner_angle(mesh, h) - if o == NONE { 0.0 } else { self.drift[o as usize] }
            });
            ((whole - around.sum::<f64>()) / FRAC_PI_2).round() as i32
        };
        (0..mesh.points.len() as u32).map(index).collect()
    }
}

/// Smooths the field around pairs of opposite cones that are nearer to each other than `distance`, away from lines: most of
/// them are noise and go. A round that does not lessen the number of cones is taken back.
pub(super) fn drop_pairs(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    energy: &Energy,
    field: &mut CrossField,
    distance: f64,
    observer: &dyn Observer,
) -> Result<(), Cancelled> {
    let mut on_line = vec![false; mesh.points.len()];
    for (f, _) in energy.fixed.iter().enumerate().filter(|f| f.1.is_some()) {
        mesh.triangles[f].iter().for_each(|&v| on_line[v as usize] = true);
    }
    let middle: Vec<_> = (0..mesh.triangles.len()).map(|f| mesh.corners(f).iter().sum::<glam::DVec3>() / 3.0).collect();
    for round in 0..PAIRING_ROUNDS {
        let index = Matching::new(adjacency, field).indices(mesh, adjacency);
        let count = index.iter().filter(|i| **i != 0).count();
        let cones = |sign: i32| {
            let of = |v: &u32| index[*v as usize] * sign > 0 && !on_line[*v as usize];
            (0..mesh.points.len() as u32).filter(of).map(|v| mesh.points[v as usize]).collect::<Vec<_>>()
        };
        let (plus, minus) = (cones(1), cones(-1));
        let pairs: Vec<_> = plus
            .iter()
            .flat_map(|p| minus.iter().map(move |m| (p.midpoint(*m), p.distance(*m))))
            .filter(|pair| pair.1 < distance)
            .collect();
        if pairs.is_empty() {
            return Ok(());
        }
        let reach = PAIRING_REACH * (1 + round) as f64;
        let loose: Vec<bool> = middle.iter().map(|m| pairs.iter().any(|p| m.distance(p.0) < reach * p.1)).collect();
        let theta = energy.smooth_there(&field.theta, &loose, observer)?;
        let before = std::mem::replace(&mut field.theta, theta);
        let after = Matching::new(adjacency, field).indices(mesh, adjacency);
        if after.iter().filter(|i| **i != 0).count() >= count {
            field.theta = before;
        }
    }
    Ok(())
}
