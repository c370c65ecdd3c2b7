//! Which sectors follow each other along a line.

use super::sectors::Sector;
use crate::mesh::{TriMesh, previous};
use std::collections::{HashMap, VecDeque};

/// The sectors as chains: which follows which on the same side of a line.
pub(super) struct Chains<'a> {
    mesh: &'a TriMesh,
    pub sectors: &'a [Sector],
    /// Whether nothing but one line or the boundary passes through at the vertex of each sector.
    pub passes: Vec<bool>,
    /// The next sector and the one before.
    pub ways: [Vec<Option<usize>>; 2],
}

impl<'a> Chains<'a> {
    pub fn new(mesh: &'a TriMesh, sectors: &'a [Sector], is_boundary: impl Fn(u32) -> bool) -> Chains<'a> {
        let mut count = vec![0u8; mesh.points.len()];
        sectors.iter().for_each(|s| count[s.vertex as usize] = count[s.vertex as usize].saturating_add(1));
        let passes = |s: &Sector| count[s.vertex as usize] == if is_boundary(s.vertex) { 1 } else { 2 };
        let ends: HashMap<u32, usize> =
            sectors.iter().enumerate().map(|(i, s)| (previous(s.spokes[s.spokes.len() - 1]), i)).collect();
        let next: Vec<Option<usize>> = sectors.iter().map(|s| ends.get(&s.spokes[0]).copied()).collect();
        let mut before = vec![None; sectors.len()];
        for (i, n) in next.iter().enumerate() {
            if let Some(n) = n {
                before[*n] = Some(i);
            }
        }
        Chains { mesh, sectors, passes: sectors.iter().map(passes).collect(), ways: [next, before] }
    }

    /// The sectors within `radius` of one along its boundary or line on both sides, itself first, up to where lines meet.
    /// * `goes_on` - where the radius begins anew
    pub fn near(&self, start: usize, radius: f64, goes_on: impl Fn(usize) -> bool) -> Vec<usize> {
        let mut near = vec![start];
        let at = |i: usize| self.mesh.points[self.sectors[i].vertex as usize];
        for way in &self.ways {
            let (mut i, mut length) = (start, 0.0);
            while let Some(n) = way[i] {
                length += at(i).distance(at(n));
                if length > radius || !self.passes[n] || n == start || near.contains(&n) {
                    break;
                }
                near.push(n);
                if goes_on(n) {
                    length = 0.0;
                }
                i = n;
            }
        }
        near
    }

    /// Distance between the vertices of two sectors.
    pub fn distance(&self, i: usize, j: usize) -> f64 {
        let [i, j] = [i, j].map(|i| self.mesh.points[self.sectors[i].vertex as usize]);
        i.distance(j)
    }

    /// The length of line that a sector stands for, half of that to each neighbour.
    pub fn length(&self, i: usize) -> f64 {
        self.ways.iter().filter_map(|way| way[i]).map(|n| self.distance(i, n) / 2.0).sum()
    }

    /// Of `some` the runs of those that pass and follow each other.
    pub fn runs(&self, some: &[usize]) -> Vec<Vec<usize>> {
        let mut is_left = vec![false; self.sectors.len()];
        some.iter().for_each(|&i| is_left[i] = self.passes[i]);
        let mut runs = Vec::new();
        for &start in some {
            let mut run = VecDeque::new();
            let mut at = Some(start);
            while let Some(i) = at.filter(|&i| is_left[i]) {
                is_left[i] = false;
                run.push_back(i);
                at = self.ways[0][i];
            }
            let mut at = self.ways[1][start];
            while let Some(i) = at.filter(|&i| is_left[i]) {
                is_left[i] = false;
                run.push_front(i);
                at = self.ways[1][i];
            }
            if !run.is_empty() {
                runs.push(run.into());
            }
        }
        runs
    }
}
