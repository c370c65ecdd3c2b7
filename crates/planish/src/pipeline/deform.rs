//! Surfaces with moved control points, and everything that goes along: relief, mesh, network, grids.
//!
//! [K98] §7.2: displacements are stored in the frame of the surface so that they move and deform with it.

use super::PipelineError;
use crate::geom::Aabb;
use crate::grid::Grid;
use crate::mesh::{Attribute, FacePoint, TriMesh};
use crate::model::Model;
use crate::network::{Curve, Network};
use crate::observe::Observer;
use crate::relief::{self, PatchedMesh, ReliefError, maps};
use crate::surface::Surface;
use glam::DVec3;
use rayon::prelude::*;
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

/// Samples along each side of a patch that tell which surface is which: more than the corners, which a turn may leave alike.
const COMPARED: usize = 5;
/// A model that is thinner than this share of its length is flat: what it has there is rounding.
const FLAT: f64 = 1e-6;

/// Loaded surfaces as those of the model that they are: in their order, with `u` and `v` running as theirs. Each is the one that is nearest
/// in its nearest direction, once the boxes around both models are one: moves and stretches of all do not count. Where two are
/// nearest to the same one, they are taken in their own order. There must be as many as the model has.
pub fn matched(surfaces: &[Surface], loaded: &[Surface]) -> Vec<Surface> {
    let at = |k: usize| k as f64 / (COMPARED - 1) as f64;
    let samples = |s: &Surface, bounds: &Aabb| -> Vec<DVec3> {
        let size = bounds.max - bounds.min;
        let places = (0..COMPARED * COMPARED).map(|k| s.point(at(k % COMPARED), at(k / COMPARED)));
        let size = size.max(DVec3::splat(FLAT * size.max_element()));
        places.map(|p| (p - bounds.min) / size).collect()
    };
    let bounds = |all: &[Surface]| Aabb::of(all.iter().flat_map(|s| &s.control));
    let [own_bounds, their_bounds] = [bounds(surfaces), bounds(loaded)];
    let own: Vec<Vec<DVec3>> = surfaces.iter().map(|s| samples(s, &own_bounds)).collect();
    let theirs: Vec<[Vec<DVec3>; 8]> =
        loaded.par_iter().map(|s| std::array::from_fn(|way| samples(&run(s, way), &their_bounds))).collect();
    let apart = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(p, q)| p.distance_squared(*q)).sum::<f64>();
    let nearest_way = |k: usize, p: usize| {
        let all = theirs[k].iter().enumerate().map(|(way, samples)| (apart(samples, &own[p]), way));
        all.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0))
    };
    let nearest = |k: usize| {
        let all = (0..own.len()).map(|p| (nearest_way(k, p).0, p));
        all.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(k, |(_, p)| p)
    };
    let found: Vec<usize> = (0..loaded.len()).into_par_iter().map(nearest).collect();
    let mut of: Vec<Option<usize>> = vec![None; own.len()];
    found.iter().enumerate().for_each(|(k, &p)| of[p] = Some(k));
    let is_clear = of.iter().all(Option::is_some);
    let one = |p: usize| {
        let k = if is_clear { of[p].unwrap_or(p) } else { p };
        run(&loaded[k], nearest_way(k, p).1)
    };
    (0..own.len().min(loaded.len())).map(one).collect()
}

/// The same surface with its parameters run in one of eight ways: along `u` backwards (1), along `v` backwards (2), then exchanged (4).
fn run(surface: &Surface, way: usize) -> Surface {
    let back = |knots: &[f64], is_back: bool| match is_back {
        true => knots.iter().rev().map(|t| 1.0 - t).collect(),
        false => knots.to_vec(),
    };
    let (u, v) = (back(&surface.knots_u, way & 1 > 0), back(&surface.knots_v, way & 2 > 0));
    let (cols, rows) = (surface.cols, surface.rows);
    let at = |i: usize, j: usize| {
        let (i, j) = (if way & 1 > 0 { cols - 1 - i } else { i }, if way & 2 > 0 { rows - 1 - j } else { j });
        surface.control[j * cols + i]
    };
    if way & 4 > 0 {
        let control = (0..cols).flat_map(|i| (0..rows).map(move |j| (i, j))).map(|(i, j)| at(i, j)).collect();
        return Surface { rows: cols, cols: rows, control, knots_u: v, knots_v: u };
    }
    let control = (0..rows).flat_map(|j| (0..cols).map(move |i| (i, j))).map(|(i, j)| at(i, j)).collect();
    Surface { rows, cols, control, knots_u: u, knots_v: v }
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
