//! Heights of the mesh above the surface, along the normals of the surface.
//!
//! [K98] §7.2 and fig. 7.1 tell why this alone does not do: a ray may miss the mesh, or meet another sheet of it. Here
//! the sheet nearest to the relief is taken, and where none is met the relief's own part along the normal.

use super::super::frame::at_nodes;
use super::super::{Displaced, Relief, ReliefError};
use super::PatchMap;
use super::texels::{local, scalars};
use crate::geom::Bvh;
use crate::mesh::TriMesh;
use crate::observe::Observer;
use crate::surface::Surface;
use glam::DVec3;
use rayon::prelude::*;

/// Rays reach so many times as far as the longest displacement: a hit further away is another part of the mesh.
const REACH: f64 = 2.0;

/// Maps of heights.
pub(super) fn heights(
    displaced: &Displaced,
    mesh: &TriMesh,
    shapes: &[[usize; 2]],
    observer: &dyn Observer,
) -> Result<Vec<PatchMap>, ReliefError> {
    let Displaced { surfaces, reliefs, .. } = *displaced;
    let tree = Bvh::watched(mesh, observer)?;
    let longest = reliefs.iter().flat_map(|r| &r.vectors).map(|d| d.length()).fold(0.0, f64::max);
    let reach = REACH * longest + crate::geom::tolerance::length(mesh.bounds().diagonal());
    let one = |((surface, relief), &shape): ((&Surface, &Relief), &[usize; 2])| {
        observer.check()?;
        let mut fine = local(surface, relief, shape);
        at_nodes(surface, shape[0], shape[1], &mut fine, |d, at, frame| {
            d.z = height(&tree, mesh, (at, frame.normal), d.z, reach);
        });
        Ok(scalars(shape, fine.iter().map(|d| d.z)))
    };
    surfaces.par_iter().zip(reliefs).zip(shapes).map(one).collect()
}

/// The height nearest to `expected` at which the mesh is met from its outside; `expected` where it is not met.
fn height(tree: &Bvh, mesh: &TriMesh, (at, normal): (DVec3, DVec3), expected: f64, reach: f64) -> f64 {
    let met = |way: f64| {
        // A start a little behind the surface meets a mesh that lies on it, too.
        let hit = tree.first_hit(at - normal * (way * reach * f64::EPSILON.sqrt()), normal * way, reach)?;
        let faces = mesh.area_vector(hit.face as usize).dot(normal) > 0.0;
        faces.then(|| way * (hit.distance - reach * f64::EPSILON.sqrt()))
    };
    let near = |a: &f64, b: &f64| (a - expected).abs().total_cmp(&(b - expected).abs());
    [met(1.0), met(-1.0)].into_iter().flatten().min_by(near).unwrap_or(expected)
}
