//! How many quarter turns a sector between two lines is to have.
//!
//! The next whole number, but one at least. Only where a boundary passes through it goes by what the boundary turns within
//! a radius: the border of a scan is ragged, and its teeth are no corners.

use super::sectors::Sector;
use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_2, PI};

use crate::mesh::{TriMesh, previous};

/// A boundary that turns by less than this within the radius has no corner: half of a quarter turn, and what noise may
/// add, radians.
const CORNER_TURN: f64 = PI / 4.0 + 0.05;

/// The sectors as chains: which follows which on the same side of a line.
struct Chains<'a> {
    mesh: &'a TriMesh,
    sectors: &'a [Sector],
    /// Whether nothing but the boundary passes through at the vertex of each sector.
    passes: Vec<bool>,
    /// The next sector and the one before.
    ways: [Vec<Option<usize>>; 2],
}

impl<'a> Chains<'a> {
    fn new(mesh: &'a TriMesh, sectors: &'a [Sector], is_boundary: impl Fn(u32) -> bool) -> Chains<'a> {
        let mut count = vec![0u8; mesh.points.len()];
        sectors.iter().for_each(|s| count[s.vertex as usize] = count[s.vertex as usize].saturating_add(1));
        let passes = |s: &Sector| is_boundary(s.vertex) && count[s.vertex as usize] == 1;
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

    /// The sectors within `radius` of one along its boundary on both sides, itself first, up to where lines meet.
    fn near(&self, start: usize, radius: f64) -> Vec<usize> {
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
                i = n;
            }
        }
        near
    }
}

/// The width of each sector in quarter turns.
pub(super) fn widths(mesh: &TriMesh, sectors: &[Sector], is_boundary: impl Fn(u32) -> bool, radius: f64) -> Vec<i32> {
    let chains = Chains::new(mesh, sectors, is_boundary);
    let mut width: Vec<i32> = sectors.iter().map(|s| ((s.angle / FRAC_PI_2).round() as i32).max(1)).collect();
    let mut turn: Vec<f64> = sectors.iter().map(|s| PI - s.angle).collect();
    let mut passing: Vec<usize> = (0..sectors.len()).filter(|&i| chains.passes[i]).collect();
    passing.iter().for_each(|&i| width[i] = 2);
    // The sharpest places first: each is a corner for all that turns around it.
    passing.sort_by(|&a, &b| turn[b].abs().total_cmp(&turn[a].abs()).then(a.cmp(&b)));
    for i in passing {
        let near = chains.near(i, radius);
        let sum: f64 = near.iter().map(|&n| turn[n]).sum();
        let sharpest = near.iter().all(|&n| turn[n].abs() <= turn[i].abs());
        if sharpest && sum.abs() > CORNER_TURN {
            width[i] = (2 - (sum / FRAC_PI_2).round() as i32).max(1);
            near.iter().for_each(|&n| turn[n] = 0.0);
        }
    }
    width
}
