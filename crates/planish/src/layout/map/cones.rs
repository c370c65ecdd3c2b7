//! Cones of a cross field, charts that agree with each other, and the cut where they cannot.
//!
//! `docs/methods/layout.md`, step 3.

use super::conformal;
use super::effort::Effort;
use super::room::Room;
use crate::mesh::{Adjacency, NONE, TriMesh, next};
use crate::network::field::CrossField;
use crate::network::field::cones::Matching;
use crate::network::field::sectors::{Sector, sectors};
use std::collections::VecDeque;
use std::f64::consts::FRAC_PI_2;

/// The field as charts: one of its four directions is the first axis of each face.
pub(in crate::layout) struct Charts {
    /// Angle of the first axis from the first edge of each face, radians.
    pub axis: Vec<f64>,
    /// For each half-edge the quarter turns to the chart across, as in [`super::SeamlessMap`].
    pub jump: Vec<u8>,
    /// For each half-edge whether charts are cut there; both sides say the same, boundaries are not cut.
    pub cut: Vec<bool>,
    /// Quarter turns that are missing around each vertex ([`Matching::indices`]).
    pub index: Vec<i32>,
    /// Sectors between lines with their width in quarter turns.
    pub sectors: Vec<(Sector, i32)>,
    /// Cones of the field that stand beside a line or another cone ([`Room`]).
    pub tight: Vec<u32>,
    /// For each face how much a map along the field stretches it ([`conformal`]).
    pub scale: Vec<f64>,
    /// What has gone into maps of this layout, those of other charts among them.
    pub effort: Effort,
}

/// What is done to the cones of a field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::layout) struct ConeCare {
    /// Those beside lines and each other are moved off ([`Room::move_off`]).
    pub roomy: bool,
    /// Those beside each other share what they turn by, and directions around all are made smooth ([`Room::settle`]).
    pub settled: bool,
}

impl Charts {
    /// The charts of `field`, with its cones treated as `care` says.
    pub fn new(mesh: &TriMesh, adjacency: &Adjacency, lines: &[bool], field: &CrossField, care: ConeCare) -> Charts {
        let mut matching = Matching::new(adjacency, field);
        let mut index = matching.indices(mesh, adjacency);
        let mut theta = field.theta.clone();
        let room = Room::new(mesh, adjacency, lines);
        let tight = room.tight(&index);
        if care.roomy {
            room.move_off(&tight, field, &mut matching, &mut index, &mut theta);
        }
        if care.settled {
            room.settle(field, &mut matching, &mut index, &mut theta);
        }
        let Matching { turns, drift } = matching;
        let scale = conformal::scales(mesh, adjacency, lines, &drift);
        let mut jump: Vec<u8> = turns.iter().map(|t| (4 - t) % 4).collect();
        let width = |s: &Sector| {
            let drift: f64 = s.spokes[1..].iter().map(|&h| drift[adjacency.opposite[h as usize] as usize]).sum();
            ((s.angle - drift) / FRAC_PI_2).round() as i32
        };
        let sectors =
            sectors(mesh, adjacency, lines).into_iter().map(|s| (width(&s), s)).map(|(w, s)| (s, w)).collect();
        let (turned, tree) = comb(adjacency, &jump);
        for (h, (jump, &o)) in jump.iter_mut().zip(&adjacency.opposite).enumerate() {
            if o != NONE {
                *jump = (*jump + turned[h / 3] + 4 - turned[o as usize / 3]) % 4;
            }
        }
        let axis = theta.iter().zip(&turned).map(|(theta, &m)| theta + f64::from(m) * FRAC_PI_2).collect();
        let cut = prune(mesh, adjacency, &jump, &index, &tree);
        Charts { axis, jump, cut, index, sectors, tight, scale, effort: Effort::new(1.0) }
    }

    /// The same for maps that share the effort of others.
    pub fn with_effort(self, effort: &Effort) -> Charts {
        Charts { effort: effort.clone(), ..self }
    }

    /// Vertices where a map has to have a corner of a patch: cones, and places where lines end, meet or turn.
    pub fn corners(&self) -> Vec<bool> {
        let mut corner: Vec<bool> = self.index.iter().map(|&i| i != 0).collect();
        let mut around = vec![0; corner.len()];
        for (sector, width) in &self.sectors {
            around[sector.vertex as usize] += 1;
            corner[sector.vertex as usize] |= *width != 2;
        }
        corner.iter_mut().zip(around).for_each(|(c, n)| *c |= n > 2);
        corner
    }
}

/// Quarter turns of each face's chart after which the charts of neighbours in a tree agree, and the tree (per half-edge).
fn comb(adjacency: &Adjacency, jump: &[u8]) -> (Vec<u8>, Vec<bool>) {
    let faces = jump.len() / 3;
    let mut turned = vec![u8::MAX; faces];
    let mut tree = vec![false; jump.len()];
    for root in 0..faces {
        if turned[root] != u8::MAX {
            continue;
        }
        turned[root] = 0;
        let mut queue = VecDeque::from([root]);
        while let Some(f) = queue.pop_front() {
            for h in 3 * f..3 * f + 3 {
                let o = adjacency.opposite[h];
                if o != NONE && turned[o as usize / 3] == u8::MAX {
                    turned[o as usize / 3] = (turned[f] + jump[h]) % 4;
                    (tree[h], tree[o as usize]) = (true, true);
                    queue.push_back(o as usize / 3);
                }
            }
        }
    }
    (turned, tree)
}

/// The edges off the tree without those that end in the open: a cut with a loose end at a vertex that is no cone is none.
fn prune(mesh: &TriMesh, adjacency: &Adjacency, jump: &[u8], index: &[i32], tree: &[bool]) -> Vec<bool> {
    let mut cut: Vec<bool> = (0..jump.len()).map(|h| adjacency.opposite[h] != NONE && !tree[h]).collect();
    let mut degree = vec![0u32; mesh.points.len()];
    for h in 0..jump.len() as u32 {
        degree[mesh.origin(h) as usize] += u32::from(cut[h as usize]);
    }
    let is_loose =
        |v: u32, degree: &[u32]| degree[v as usize] == 1 && index[v as usize] == 0 && !adjacency.is_boundary_vertex(v);
    let mut loose: Vec<u32> = (0..mesh.points.len() as u32).filter(|&v| is_loose(v, &degree)).collect();
    while let Some(v) = loose.pop() {
        if !is_loose(v, &degree) {
            continue;
        }
        let Some(h) = adjacency.fan(v).find(|&h| cut[h as usize] && jump[h as usize] == 0) else { continue };
        let to = mesh.origin(next(h));
        (cut[h as usize], cut[adjacency.opposite[h as usize] as usize]) = (false, false);
        degree[v as usize] -= 1;
        degree[to as usize] -= 1;
        if is_loose(to, &degree) {
            loose.push(to);
        }
    }
    cut
}
