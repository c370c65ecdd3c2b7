//! How many quarter turns a sector between two lines is to have.
//!
//! The next whole number, but one at least. Only where a boundary passes through it goes by what the boundary turns within
//! a radius: the border of a scan is ragged, and its teeth are no corners. So it does at the knots of a line, where corners
//! follow each other within the radius.

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
    /// Whether nothing but one line or the boundary passes through at the vertex of each sector.
    passes: Vec<bool>,
    /// The next sector and the one before.
    ways: [Vec<Option<usize>>; 2],
}

impl<'a> Chains<'a> {
    fn new(mesh: &'a TriMesh, sectors: &'a [Sector], is_boundary: impl Fn(u32) -> bool) -> Chains<'a> {
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
    fn near(&self, start: usize, radius: f64, goes_on: impl Fn(usize) -> bool) -> Vec<usize> {
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
}

/// The width of each sector in quarter turns.
pub(super) fn widths(mesh: &TriMesh, sectors: &[Sector], is_boundary: impl Fn(u32) -> bool, radius: f64) -> Vec<i32> {
    let chains = Chains::new(mesh, sectors, &is_boundary);
    let mut width: Vec<i32> = sectors.iter().map(|s| ((s.angle / FRAC_PI_2).round() as i32).max(1)).collect();
    let mut turn: Vec<f64> = sectors.iter().map(|s| PI - s.angle).collect();
    let (mut border, mut bent): (Vec<usize>, Vec<usize>) =
        (0..sectors.len()).filter(|&i| chains.passes[i]).partition(|&i| is_boundary(sectors[i].vertex));
    bent.retain(|&i| width[i] != 2);
    // The sharpest places first: each is a corner for all that turns around it.
    let sort = |places: &mut Vec<usize>, turn: &[f64]| {
        places.sort_by(|&a, &b| turn[b].abs().total_cmp(&turn[a].abs()).then(a.cmp(&b)));
    };
    let whole = |sum: f64| if sum.abs() > CORNER_TURN { (2 - (sum / FRAC_PI_2).round() as i32).max(1) } else { 2 };
    sort(&mut bent, &turn);
    let mut is_bent = vec![false; sectors.len()];
    bent.iter().for_each(|&i| is_bent[i] = true);
    for i in bent {
        let near = chains.near(i, radius, |n| is_bent[n]);
        let sum: f64 = near.iter().map(|&n| turn[n]).sum();
        let knot: Vec<usize> = near.into_iter().filter(|&n| is_bent[n]).collect();
        // What turns by more is a form of its own.
        if is_bent[i] && (knot.len() > 1 || sum.abs() <= CORNER_TURN) && sum.abs() < 1.5 * FRAC_PI_2 {
            knot.iter().for_each(|&n| (width[n], is_bent[n]) = (2, false));
            width[i] = whole(sum);
        }
    }
    border.iter().for_each(|&i| width[i] = 2);
    sort(&mut border, &turn);
    for i in border {
        let near = chains.near(i, radius, |_| false);
        let sum: f64 = near.iter().map(|&n| turn[n]).sum();
        let sharpest = near.iter().all(|&n| turn[n].abs() <= turn[i].abs());
        if sharpest && sum.abs() > CORNER_TURN {
            width[i] = whole(sum);
            near.iter().for_each(|&n| turn[n] = 0.0);
        }
    }
    width
}

#[cfg(test)]
mod tests {
    use super::super::sectors::sectors;
    use super::*;
    use crate::mesh::{Adjacency, next};
    use crate::synthetic::shapes;
    use glam::DVec2;

    /// Widths other than half a turn of the sectors along a line over these points of a sheet with 12 by 12 squares.
    fn bends(line: &[[i32; 2]]) -> Vec<i32> {
        let mesh = shapes::rectangle(12.0, 12.0, 12, 12);
        let adjacency = Adjacency::new(&mesh);
        let low = mesh.bounds().min.truncate();
        let at = |v: u32| (mesh.points[v as usize].truncate() - low).round();
        let place = |p: [i32; 2]| DVec2::new(f64::from(p[0]), f64::from(p[1]));
        let joins = |h: u32, w: &[[i32; 2]]| {
            let ends = [at(mesh.origin(h)), at(mesh.origin(next(h)))];
            ends == [place(w[0]), place(w[1])] || ends == [place(w[1]), place(w[0])]
        };
        let lines: Vec<bool> =
            (0..3 * mesh.triangles.len() as u32).map(|h| line.windows(2).any(|w| joins(h, w))).collect();
        assert_eq!(lines.iter().filter(|l| **l).count(), 2 * (line.len() - 1));
        let sectors = sectors(&mesh, &adjacency, &lines);
        let width = widths(&mesh, &sectors, |v| adjacency.is_boundary_vertex(v), 2.5);
        let ends = [line[0], line[line.len() - 1]].map(place);
        let inside = |v: u32| !adjacency.is_boundary_vertex(v) && !ends.contains(&at(v));
        let mut bends: Vec<i32> =
            sectors.iter().zip(width).filter(|(s, w)| inside(s.vertex) && *w != 2).map(|s| s.1).collect();
        bends.sort_unstable();
        bends
    }

    #[test]
    fn a_corner_of_a_line_is_one_on_both_sides_and_a_tooth_of_one_edge_is_none() {
        assert_eq!(bends(&[[2, 5], [3, 5], [4, 5], [5, 5], [6, 5], [7, 5]]), [0; 0]);
        assert_eq!(bends(&[[2, 2], [3, 2], [4, 2], [5, 2], [5, 3], [5, 4], [5, 5]]), [1, 3]);
        assert_eq!(bends(&[[2, 5], [3, 5], [4, 5], [4, 6], [5, 6], [5, 5], [6, 5], [7, 5]]), [0; 0]);
    }
}
