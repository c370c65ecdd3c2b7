//! Vertex attributes of the mesh (colours and others) in the same texels as the relief.

use super::super::ReliefError;
use super::super::resample::Between;
use super::PatchMap;
use crate::grid::Grid;
use crate::mesh::TriMesh;
use rayon::prelude::*;

/// Maps of one attribute: its values at the places of the grids on the mesh, and bilinear between.
///
/// * `name` - of the attribute; `None` if the mesh has none of that name
/// * `shapes` - texels of each patch along `v` and along `u`
///
/// # Errors
/// [`ReliefError::Count`] if grids and shapes differ in number, [`ReliefError::Shape`] for a grid without places.
pub fn attribute_maps(
    mesh: &TriMesh,
    grids: &[Grid],
    name: &str,
    shapes: &[[usize; 2]],
) -> Result<Option<Vec<PatchMap>>, ReliefError> {
    let Some(attribute) = mesh.attributes.iter().find(|a| a.name == name) else { return Ok(None) };
    if grids.len() != shapes.len() {
        return Err(ReliefError::Count { what: "shapes", found: shapes.len(), wanted: grids.len() });
    }
    if let Some(patch) = grids.iter().position(|g| g.places.len() != g.rows * g.cols || g.rows < 2 || g.cols < 2) {
        let Grid { rows, cols, ref places, .. } = grids[patch];
        return Err(ReliefError::Shape { patch, rows, cols, found: places.len() });
    }
    let width = attribute.width;
    let one = |(grid, &[rows, cols]): (&Grid, &[usize; 2])| {
        let at = |node: usize, k: usize| {
            let place = grid.places[node];
            let corners = mesh.triangles[place.face as usize];
            let share = |c: usize| place.bary[c] * attribute.values[corners[c] as usize * width + k] as f64;
            share(0) + share(1) + share(2)
        };
        let mut values = Vec::with_capacity(rows * cols * width);
        for j in 0..rows {
            let up = Between::new(j, rows, grid.rows);
            for i in 0..cols {
                let along = Between::new(i, cols, grid.cols);
                for k in 0..width {
                    values.push(up.value(|j| along.value(|i| at(j * grid.cols + i, k))) as f32);
                }
            }
        }
        PatchMap { rows, cols, channels: width, values }
    };
    Ok(Some(grids.par_iter().zip(shapes).map(one).collect()))
}
