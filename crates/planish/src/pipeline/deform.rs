//! Surfaces with moved control points, and everything that goes along: relief, mesh, network, grids.
//!
//! [K98] §7.2: displacements are stored in the frame of the surface so that they move and deform with it.

use super::PipelineError;
use crate::grid::Grid;
use crate::mesh::{Attribute, FacePoint, TriMesh};
use crate::model::Model;
use crate::network::{Curve, Network};
use crate::observe::Observer;
use crate::relief::{self, PatchedMesh, ReliefError, maps};
use crate::surface::Surface;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A control point that is moved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Move {
    /// The patch.
    pub patch: usize,
    /// Number of the control point along `u`.
    pub i: usize,
    /// Number of the control point along `v`.
    pub j: usize,
    /// By how much, units of the model.
    pub by: [f64; 3],
}

/// Surfaces with control points moved; those on a seam move in all patches that meet there.
/// # Errors
/// [`ReliefError::Edit`] for a control point that is not there.
pub fn moved(network: &Network, surfaces: &[Surface], moves: &[Move]) -> Result<Vec<Surface>, ReliefError> {
    let shapes: Vec<[usize; 2]> = surfaces.iter().map(|s| [s.rows, s.cols]).collect();
    let seams = relief::seam_nodes(network, &shapes)?;
    let mut out = surfaces.to_vec();
    for &Move { patch, i, j, by } in moves {
        let by = DVec3::from(by);
        let there = shapes.get(patch).is_some_and(|&[rows, cols]| j < rows && i < cols) && by.is_finite();
        if !there {
            let what = format!("patch {patch} has no control point {i}, {j}, or it is moved by no number");
            return Err(ReliefError::Edit { what });
        }
        let own = (patch as u32, (j * shapes[patch][1] + i) as u32);
        let together = seams.iter().find(|members| members.contains(&own));
        for &(p, n) in together.map_or(&[own][..], |members| members) {
            out[p as usize].control[n as usize] += by;
        }
    }
    Ok(out)
}

/// Gives control points that loaded surfaces share along seams their mean; returns how far they were apart.
/// # Errors
/// [`ReliefError::Mismatch`] where counts differ along a curve, [`ReliefError::Count`], [`ReliefError::Surface`].
pub fn join(network: &Network, surfaces: &mut [Surface]) -> Result<f64, ReliefError> {
    surfaces.iter().try_for_each(Surface::check)?;
    let shapes: Vec<[usize; 2]> = surfaces.iter().map(|s| [s.rows, s.cols]).collect();
    let mut apart: f64 = 0.0;
    for members in relief::seam_nodes(network, &shapes)? {
        let points: Vec<DVec3> = members.iter().map(|&(p, n)| surfaces[p as usize].control[n as usize]).collect();
        let mean = points.iter().sum::<DVec3>() / points.len() as f64;
        let far = points.iter().map(|p| p.distance(points[0])).fold(0.0, f64::max);
        if far > 0.0 {
            apart = apart.max(far);
            members.iter().for_each(|&(p, n)| surfaces[p as usize].control[n as usize] = mean);
        }
    }
    Ok(apart)
}

/// The model on other surfaces of its network. The relief is carried along in their frames; the displaced surface becomes the
/// mesh, on whose vertices network and grids lie. Feature curves, symmetry and edits of curves that could be taken back belonged to the
/// old mesh and are gone; layers of the relief stay.
/// # Errors
/// If the surfaces do not fit the network.
pub fn deform(model: &Model, surfaces: Vec<Surface>, observer: &dyn Observer) -> Result<Model, PipelineError> {
    let shapes: Vec<[usize; 2]> = model.reliefs.iter().map(|r| [r.rows, r.cols]).collect();
    let PatchedMesh { mut mesh, patches } =
        relief::displaced_patches(&model.network, &surfaces, &model.reliefs, observer)?;
    let places = vertex_places(&mesh);
    for name in model.mesh.attributes.iter().map(|a| &a.name) {
        let Some(all) = maps::attribute_maps(&model.mesh, &model.grids, name, &shapes)? else { continue };
        let width = all.first().map_or(1, |m| m.channels);
        let mut values = vec![0.0; mesh.points.len() * width];
        for (nodes, map) in patches.iter().zip(&all) {
            for (k, &v) in nodes.vertices.iter().enumerate() {
                values[v as usize * width..][..width].copy_from_slice(map.texel(k));
            }
        }
        mesh.attributes.push(Attribute { name: name.clone(), width, values });
    }
    let grid = |nodes: &relief::PatchNodes| Grid {
        rows: nodes.rows,
        cols: nodes.cols,
        points: nodes.vertices.iter().map(|&v| mesh.points[v as usize]).collect(),
        places: nodes.vertices.iter().map(|&v| places[v as usize]).collect(),
    };
    let grids = patches.iter().map(grid).collect();
    let network = on_nodes(&model.network, &patches, &places);
    let Model { reliefs, layers, units, shift, params, history, .. } = model.clone();
    Ok(Model { mesh, network, grids, surfaces, reliefs, layers, units, shift, params, history, ..Model::default() })
}

/// For each vertex its place as a corner of one of its triangles. A vertex that lost all of its triangles to welding has that of the
/// vertex before it.
fn vertex_places(mesh: &TriMesh) -> Vec<FacePoint> {
    let mut last = FacePoint::corner(0, 0);
    let mut out = Vec::with_capacity(mesh.points.len());
    let mut found: Vec<Option<FacePoint>> = vec![None; mesh.points.len()];
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        for (k, &v) in triangle.iter().enumerate() {
            found[v as usize].get_or_insert(FacePoint::corner(t as u32, k));
        }
    }
    for place in found {
        last = place.unwrap_or(last);
        out.push(last);
    }
    out
}

/// The network with its corners and curves on the nodes of the patches.
fn on_nodes(network: &Network, patches: &[relief::PatchNodes], places: &[FacePoint]) -> Network {
    let mut out = network.clone();
    let mut known = vec![false; out.curves.len()];
    for (p, nodes) in patches.iter().enumerate() {
        for (k, side) in network.patches[p].sides.iter().enumerate() {
            let curve = side.curve as usize;
            if std::mem::replace(&mut known[curve], true) {
                continue;
            }
            let n = if k % 2 == 0 { nodes.cols } else { nodes.rows };
            let at = |i: usize| places[nodes.vertices[crate::surface::node(nodes.rows, nodes.cols, k, i, 0)] as usize];
            let mut points: Vec<FacePoint> = (0..n).map(at).collect();
            if side.reversed {
                points.reverse();
            }
            let Curve { corners: [first, last], .. } = out.curves[curve];
            (out.corners[first as usize].place, out.corners[last as usize].place) = (points[0], points[n - 1]);
            out.curves[curve].points = points;
        }
    }
    out
}
