//! How good a grid is.
//!
//! The criteria of [K98] §5.2: spacing along iso-curves, angles, folds.

use super::Grid;
use super::net::fold::Sheet;
use crate::geom::{Aabb, Bvh};
use crate::mesh::TriMesh;
use crate::network::PatchMesh;
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Measures of one grid, see [`measure`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GridQuality {
    /// Cells that turn over against the surface.
    pub folds: usize,
    /// Standard deviation over mean of the spacing along an iso-curve, mean over all iso-curves.
    pub spacing_cv: f64,
    /// The same for the worst iso-curve.
    pub spacing_cv_worst: f64,
    /// Deviation of the angles of cells from a right angle that 95 % of the cells stay within, degrees.
    pub angle_p95_deg: f64,
    /// Standard deviation over mean of the areas of the cells.
    pub area_cv: f64,
    /// Greatest distance of a vertex of the patch from the grid's surface, over the diagonal of the patch.
    pub miss_max: f64,
    /// Root mean square of these distances, over the diagonal of the patch.
    pub miss_rms: f64,
}

/// Measures `grid` against its `patch`.
///
/// The grid's surface has two triangles per cell, divided along the shorter diagonal. A cell counts as a fold if one
/// of its corner triangles points against the mean normal of the cells up to two away and against that of the patch at
/// its corners (but not the triangle at a corner of the patch, whose angle is given): rough relief tilts single cells,
/// only a fold turns a corner right over. That the grid is one-to-one on the patch is a matter of construction: every
/// cell is convex in the chart, by exact predicates, but for those around folds that were opened along the surface.
pub fn measure(grid: &Grid, patch: &PatchMesh) -> GridQuality {
    let (rows, cols) = (grid.rows, grid.cols);
    let at = |i: usize, j: usize| grid.points[j * cols + i];
    let mut variations: Vec<f64> =
        (0..rows).map(|j| variation((1..cols).map(|i| at(i - 1, j).distance(at(i, j))))).collect();
    variations.extend((0..cols).map(|i| variation((1..rows).map(|j| at(i, j - 1).distance(at(i, j))))));
    let mut angles: Vec<f64> = Vec::with_capacity((rows - 1) * (cols - 1));
    let mut areas = Vec::with_capacity(angles.capacity());
    for j in 0..rows - 1 {
        for i in 0..cols - 1 {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            let (e, f) = (b - a + c - d, d - a + c - b);
            areas.push(cell_vector([a, b, c, d]).length());
            let sides = e.length() * f.length();
            angles.push(if sides > 0.0 { (e.dot(f) / sides).clamp(-1.0, 1.0).asin().abs().to_degrees() } else { 90.0 });
        }
    }
    angles.sort_by(f64::total_cmp);
    let (miss_max, miss_rms) = miss(grid, patch);
    let diagonal = Aabb::of(&patch.mesh.points).diagonal().max(f64::MIN_POSITIVE);
    GridQuality {
        folds: folds(grid, patch),
        spacing_cv: variations.iter().sum::<f64>() / variations.len() as f64,
        spacing_cv_worst: variations.iter().copied().fold(0.0, f64::max),
        angle_p95_deg: angles[(angles.len() * 95 / 100).min(angles.len() - 1)],
        area_cv: variation(areas.into_iter()),
        miss_max: miss_max / diagonal,
        miss_rms: miss_rms / diagonal,
    }
}

/// Twice the area vector of a cell.
fn cell_vector([a, b, c, d]: [DVec3; 4]) -> DVec3 {
    (c - a).cross(d - b)
}

/// Standard deviation over mean.
fn variation(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let (count, sum) = values.clone().fold((0.0, 0.0), |(n, s), x| (n + 1.0, s + x));
    let mean = sum / count;
    let square: f64 = values.map(|x| (x - mean) * (x - mean)).sum();
    if mean > 0.0 { (square / count).sqrt() / mean } else { 0.0 }
}

/// The grid's surface: two triangles per cell, in the order of the cells, divided along the shorter diagonal.
pub fn surface(points: &[DVec3], cols: usize, rows: usize) -> TriMesh {
    let (stride, mut triangles) = (cols as u32, Vec::with_capacity(2 * points.len()));
    for j in 0..rows as u32 - 1 {
        for i in 0..stride - 1 {
            let a = j * stride + i;
            let corners = [a, a + 1, a + 1 + stride, a + stride];
            triangles.extend(halves(corners.map(|k| points[k as usize])).map(|t| t.map(|k| corners[k])));
        }
    }
    TriMesh::new(points.to_vec(), triangles)
}

/// The two triangles of a cell, as numbers of its corners.
pub fn halves([p, q, r, s]: [DVec3; 4]) -> [[usize; 3]; 2] {
    if p.distance_squared(r) <= q.distance_squared(s) { [[0, 1, 2], [0, 2, 3]] } else { [[0, 1, 3], [1, 2, 3]] }
}

/// Number of cells that turn over, see [`measure`].
pub fn folds(grid: &Grid, patch: &PatchMesh) -> usize {
    // Pieces of one face lie in its plane: any of them has its normal.
    let mut normals: BTreeMap<u32, DVec3> = BTreeMap::new();
    for (f, &face) in patch.face_origin.iter().enumerate() {
        *normals.entry(face).or_default() += patch.mesh.area_vector(f);
    }
    let normal = |k: usize| normals.get(&grid.places[k].face).map_or(DVec3::ZERO, |n| n.normalize_or_zero());
    Sheet { points: &grid.points, normal: &normal, cols: grid.cols, rows: grid.rows }.folded_cells().len()
}

/// Greatest and root mean square distance of the patch's vertices from the grid's surface.
pub fn miss(grid: &Grid, patch: &PatchMesh) -> (f64, f64) {
    let surface = Bvh::new(&surface(&grid.points, grid.cols, grid.rows));
    let points = &patch.mesh.points;
    let distances: Vec<f64> = points.par_iter().map(|&p| surface.closest(p).distance).collect();
    let square: f64 = distances.iter().map(|d| d * d).sum();
    let greatest = distances.iter().copied().fold(0.0, f64::max);
    (greatest, (square / distances.len().max(1) as f64).sqrt())
}
