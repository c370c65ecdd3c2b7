//! How much a map has to stretch each face so that its isolines can run along a field.
//!
//! Where the map follows the directions of a field and is the same length along both, its derivative is
//! `exp(phi - i alpha)`, with `alpha` the angle of the field. That is an analytic function, so the slope of `phi` is that of
//! `alpha` turned by a quarter (Cauchy and Riemann): the field alone tells the scale. Around a cone with five patches
//! it is `r^(1/4)`, as for `z^(5/4)`. In the sum around a vertex this is the equation of metrics with given cones by
//! Ben-Chen, Gotsman, Bunin, *Conformal Flattening by Curvature Prescription and Metric Scaling*, 2008, eq. 5.

use crate::mesh::{Adjacency, NONE, TriMesh, next};
use planish_sparse::SparseCholesky;

/// Weight of each vertex's own scale beside its neighbours': it only makes the answer one.
const PINNED: f64 = 1e-9;

/// For each face the scale of the map, the mean of whose square over the surface is 1; 1 everywhere if the equations have
/// no answer.
/// * `drift` - for each half-edge the angle by which the field turns from its face to that across, radians
/// * `lines` - for each half-edge whether it lies on a line, across which nothing is known
pub(super) fn scales(mesh: &TriMesh, adjacency: &Adjacency, lines: &[bool], drift: &[f64]) -> Vec<f64> {
    let vertices = mesh.points.len();
    let mut entries: Vec<(usize, usize, f64)> = Vec::new();
    let mut own = vec![PINNED; vertices];
    let mut phi = vec![0.0; vertices];
    for h in 0..adjacency.opposite.len() {
        let o = adjacency.opposite[h];
        if o == NONE || lines[h] {
            continue;
        }
        let (a, b) = (mesh.origin(h as u32) as usize, mesh.origin(next(h as u32)) as usize);
        // Distance between the middles of the two faces, if they are about as long as they are wide, as a part of the edge.
        let areas = mesh.area(h / 3) + mesh.area(o as usize / 3);
        let width = 2.0 / 3.0 * areas / mesh.points[a].distance_squared(mesh.points[b]).max(f64::MIN_POSITIVE);
        own[a] += width;
        if b < a {
            entries.push((a, b, -width));
        }
        phi[a] -= drift[h];
    }
    entries.extend(own.iter().enumerate().map(|(a, &w)| (a, a, w)));
    let faces = 0..mesh.triangles.len();
    let Ok(system) = SparseCholesky::factor(vertices, &entries) else { return vec![1.0; faces.len()] };
    system.solve(&mut phi);
    // Of corners at which only lines meet nothing is known.
    let known = |v: &&u32| own[**v as usize] > PINNED;
    let scale = |f: usize| {
        let corners = mesh.triangles[f].iter().filter(known);
        let (sum, count) = corners.fold((0.0, 0), |(sum, count), &v| (sum + phi[v as usize], count + 1));
        (sum / f64::from(count.max(1))).exp()
    };
    let scale: Vec<f64> = faces.clone().map(scale).collect();
    let areas = faces.clone().map(|f| mesh.area(f));
    let (area, stretched) = areas.zip(&scale).fold((0.0, 0.0), |(a, s), (area, x)| (a + area, s + area * x * x));
    let whole = (area / stretched).sqrt();
    scale.into_iter().map(|s| s * whole).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn a_field_that_turns_evenly_along_x_is_stretched_by_the_exponential_of_y() {
        // With alpha = x the map is exp(-i z), whose scale is exp(y).
        let (columns, rows, edge) = (30u32, 30u32, 0.05);
        let at = |i: u32, j: u32| {
            DVec3::new(f64::from(i) + f64::from(j % 2) / 2.0, f64::from(j) * 0.75f64.sqrt(), 0.0) * edge
        };
        let points = (0..=rows).flat_map(|j| (0..=columns).map(move |i| at(i, j))).collect();
        let id = |i: u32, j: u32| j * (columns + 1) + i;
        let squares = (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j)));
        let triangles = squares.flat_map(|(i, j)| {
            let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            if j % 2 == 0 { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] }
        });
        let mesh = TriMesh::new(points, triangles.collect());
        let adjacency = Adjacency::new(&mesh);
        let middle = |f: usize| mesh.corners(f).into_iter().sum::<DVec3>() / 3.0;
        let opposite = |h: usize| adjacency.opposite[h];
        let drift =
            |h: usize| if opposite(h) == NONE { 0.0 } else { middle(opposite(h) as usize / 3).x - middle(h / 3).x };
        let drift: Vec<f64> = (0..adjacency.opposite.len()).map(drift).collect();
        let found = scales(&mesh, &adjacency, &vec![false; drift.len()], &drift);
        // Two faces have a corner without an inner edge.
        let inner = |f: &usize| adjacency.opposite[3 * f..3 * f + 3].iter().filter(|o| **o == NONE).count() < 2;
        let by: Vec<f64> = (0..found.len()).filter(inner).map(|f| found[f].ln() - middle(f).y).collect();
        let off = by.iter().fold(0.0, |m: f64, b| m.max((b - by[0]).abs()));
        assert!(off < 1e-6, "{off}");
        let squares: f64 = (0..found.len()).map(|f| mesh.area(f) * found[f] * found[f]).sum();
        let area: f64 = (0..found.len()).map(|f| mesh.area(f)).sum();
        assert!((squares / area - 1.0).abs() < 1e-12);
    }
}
