//! How many quarter turns a sector between two lines is to have.
//!
//! The next whole number, but one at least. Only at the knots of a line, where corners follow each other within a reach, it
//! goes by what the line turns within it; and on the boundary ([`super::rims`]).

use super::chains::Chains;
use super::rims::{CORNER_TURN, rims};
use super::sectors::Sector;
use crate::mesh::TriMesh;
use std::f64::consts::{FRAC_PI_2, PI};

/// What the sectors are to be.
pub(super) struct Widths {
    /// Quarter turns of each.
    pub width: Vec<i32>,
    /// How much wider each is than those, radians; a corner of the boundary with what turns beside it.
    pub excess: Vec<f64>,
    /// What the field is to turn by besides in each, radians: a closed form.
    pub ironed: Vec<f64>,
}

/// The widths of the sectors.
/// * `narrow` - reach of what is one corner
/// * `wide` - reach of what is one corner of a ragged boundary
pub(super) fn widths(
    mesh: &TriMesh,
    sectors: &[Sector],
    is_boundary: impl Fn(u32) -> bool,
    narrow: f64,
    wide: f64,
) -> Widths {
    let chains = Chains::new(mesh, sectors, &is_boundary);
    let mut width: Vec<i32> = sectors.iter().map(|s| ((s.angle / FRAC_PI_2).round() as i32).max(1)).collect();
    let turn: Vec<f64> = sectors.iter().map(|s| PI - s.angle).collect();
    let (border, mut bent): (Vec<usize>, Vec<usize>) =
        (0..sectors.len()).filter(|&i| chains.passes[i]).partition(|&i| is_boundary(sectors[i].vertex));
    bent.retain(|&i| width[i] != 2);
    // The sharpest places first: each is a corner for all that turns around it.
    bent.sort_by(|&a, &b| turn[b].abs().total_cmp(&turn[a].abs()).then(a.cmp(&b)));
    let whole = |sum: f64| if sum.abs() > CORNER_TURN { (2 - (sum / FRAC_PI_2).round() as i32).max(1) } else { 2 };
    let mut is_bent = vec![false; sectors.len()];
    bent.iter().for_each(|&i| is_bent[i] = true);
    for i in bent {
        let near = chains.near(i, narrow, |n| is_bent[n]);
        let sum: f64 = near.iter().map(|&n| turn[n]).sum();
        let knot: Vec<usize> = near.into_iter().filter(|&n| is_bent[n]).collect();
        // What turns by more is a form of its own.
        if is_bent[i] && (knot.len() > 1 || sum.abs() <= CORNER_TURN) && sum.abs() < 1.5 * FRAC_PI_2 {
            knot.iter().for_each(|&n| (width[n], is_bent[n]) = (2, false));
            width[i] = whole(sum);
        }
    }
    let mut excess: Vec<f64> = sectors.iter().zip(&width).map(|(s, &w)| s.angle - f64::from(w) * FRAC_PI_2).collect();
    let rims = rims(&chains, &border, narrow, wide);
    for (i, rim) in rims.width.into_iter().enumerate() {
        if let Some(rim) = rim {
            (width[i], excess[i]) = (rim, rims.excess[i]);
        }
    }
    Widths { width, excess, ironed: rims.ironed }
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
        let width = widths(&mesh, &sectors, |v| adjacency.is_boundary_vertex(v), 2.5, 2.5).width;
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
