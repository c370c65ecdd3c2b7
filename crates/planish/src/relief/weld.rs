//! One triangle mesh of all patches, welded by topology.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §8.2.
//!
//! Departs from [K98]: no averaging of boundary rows. A node on a curve or corner is one vertex because the network
//! says so, whatever its distance; its position is that of the first patch that has it. Both patches have the same grid nodes and
//! control points there, so baked maps agree; rows of maps that were edited need not (`docs/methods/relief.md`).

use super::{Relief, ReliefError, displace};
use crate::grid::Grid;
use crate::mesh::{Attribute, TriMesh};
use crate::network::Network;
use crate::observe::{Cancelled, Observer};
use crate::surface::basis::uniform_parameters;
use crate::surface::{Facet, FitError, Surface, check, node};
use glam::DVec3;
use rayon::prelude::*;

const NONE: u32 = u32::MAX;

/// One mesh of all patches that still tells which node of which patch each corner of a triangle is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PatchedMesh {
    /// The mesh. Its triangles are those of the patches, in their order.
    pub mesh: TriMesh,
    /// One entry per patch of the network.
    pub patches: Vec<PatchNodes>,
}

impl PatchedMesh {
    /// Vectors of the nodes of all patches as vectors of the vertices; of several nodes at a vertex the first counts.
    pub fn gather(&self, nodes: &[Vec<DVec3>]) -> Vec<DVec3> {
        let mut values = vec![DVec3::NAN; self.mesh.points.len()];
        for (patch, vectors) in self.patches.iter().zip(nodes) {
            for (&v, &d) in patch.vertices.iter().zip(vectors) {
                let value = &mut values[v as usize];
                if value.is_nan() {
                    *value = d;
                }
            }
        }
        values
    }

    /// For each triangle its patch and the parameters of its middle, if the nodes are even steps in the parameters.
    pub fn facets(&self) -> Vec<Facet> {
        let one = |(p, patch): (usize, &PatchNodes)| {
            let middle = |t: &[u32; 3], of: &dyn Fn(usize) -> usize, count: usize| {
                t.iter().map(|&n| of(n as usize)).sum::<usize>() as f64 / (3 * (count - 1)) as f64
            };
            let facet = |t: &[u32; 3]| {
                let u = middle(t, &|n| n % patch.cols, patch.cols);
                let v = middle(t, &|n| n / patch.cols, patch.rows);
                Facet { patch: p as u32, place: [u, v] }
            };
            patch.triangles.iter().map(facet).collect::<Vec<_>>()
        };
        self.patches.iter().enumerate().flat_map(one).collect()
    }

    /// Vectors of the vertices as vectors of the nodes of all patches.
    pub fn scatter(&self, values: &[DVec3]) -> Vec<Vec<DVec3>> {
        self.patches.iter().map(|p| p.vertices.iter().map(|&v| values[v as usize]).collect()).collect()
    }
}

/// The nodes of one patch of a [`PatchedMesh`], row-major as [`Grid`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PatchNodes {
    /// Nodes along `v`.
    pub rows: usize,
    /// Nodes along `u`.
    pub cols: usize,
    /// For each node its vertex of the mesh; nodes on a curve share theirs with the patch beside.
    pub vertices: Vec<u32>,
    /// Triangles of nodes of this patch.
    pub triangles: Vec<[u32; 3]>,
}

/// The displaced grids of all patches as one mesh: for a closed network a closed manifold one.
///
/// # Errors
/// Lists that are not one per patch, or counts that differ along a curve; [`ReliefError::Cancelled`].
pub fn displaced_mesh(
    network: &Network,
    surfaces: &[Surface],
    reliefs: &[Relief],
    observer: &dyn Observer,
) -> Result<TriMesh, ReliefError> {
    displaced_patches(network, surfaces, reliefs, observer).map(|patched| patched.mesh)
}

/// As [`displaced_mesh`], with the patches.
///
/// # Errors
/// As [`displaced_mesh`].
pub fn displaced_patches(
    network: &Network,
    surfaces: &[Surface],
    reliefs: &[Relief],
    observer: &dyn Observer,
) -> Result<PatchedMesh, ReliefError> {
    one_per_patch(network, [("surfaces", surfaces.len()), ("reliefs", reliefs.len())])?;
    let one = |(s, r): (&Surface, &Relief)| {
        observer.check()?;
        displace(s, r)
    };
    let arrays: Vec<Result<Vec<DVec3>, ReliefError>> = surfaces.par_iter().zip(reliefs).map(one).collect();
    let mut nodes = Vec::with_capacity(network.patches.len());
    for (patch, (points, relief)) in arrays.into_iter().zip(reliefs).enumerate() {
        let points = points.map_err(|e| match e {
            ReliefError::Shape { rows, cols, found, .. } => ReliefError::Shape { patch, rows, cols, found },
            other => other,
        })?;
        nodes.push(Grid { rows: relief.rows, cols: relief.cols, points, places: Vec::new() });
    }
    weld(network, &nodes)
}

/// Refuses lists that are not one per patch.
fn one_per_patch(network: &Network, lists: [(&'static str, usize); 2]) -> Result<(), ReliefError> {
    let wanted = network.patches.len();
    match lists.into_iter().find(|list| list.1 != wanted) {
        Some((what, found)) => Err(ReliefError::Count { what, found, wanted }),
        None => Ok(()),
    }
}

/// The smooth surfaces of all patches as one mesh.
///
/// * `shapes` - per patch the nodes along `v` and along `u`, equal along every curve; see [`span_shapes`]
///
/// # Errors
/// Lists that are not one per patch, or counts that differ along a curve; [`ReliefError::Cancelled`].
pub fn surface_mesh(
    network: &Network,
    surfaces: &[Surface],
    shapes: &[[usize; 2]],
    observer: &dyn Observer,
) -> Result<TriMesh, ReliefError> {
    surface_patches(network, surfaces, shapes, observer).map(|patched| patched.mesh)
}

/// As [`surface_mesh`], with the patches.
///
/// # Errors
/// As [`surface_mesh`].
pub fn surface_patches(
    network: &Network,
    surfaces: &[Surface],
    shapes: &[[usize; 2]],
    observer: &dyn Observer,
) -> Result<PatchedMesh, ReliefError> {
    one_per_patch(network, [("surfaces", surfaces.len()), ("shapes", shapes.len())])?;
    surfaces.iter().try_for_each(Surface::check)?;
    let one = |(surface, &[rows, cols]): (&Surface, &[usize; 2])| {
        observer.check()?;
        let points = surface.sample(&uniform_parameters(cols), &uniform_parameters(rows), [0, 0]);
        Ok(Grid { rows, cols, points, places: Vec::new() })
    };
    let nodes: Result<Vec<Grid>, Cancelled> = surfaces.par_iter().zip(shapes).map(one).collect();
    weld(network, &nodes?)
}

/// Nodes along `v` and `u` of each surface with `per_span` (at least 1) quads per knot span.
pub fn span_shapes(surfaces: &[Surface], per_span: usize) -> Vec<[usize; 2]> {
    let nodes = |control: usize| control.saturating_sub(3).max(1) * per_span.max(1) + 1;
    surfaces.iter().map(|s| [nodes(s.rows), nodes(s.cols)]).collect()
}

/// One patch as a mesh of its own with a `"uv"` attribute of width 2.
///
/// The texture coordinates put node `(i, j)` on a texel centre of an image with one texel per node,
/// `((i + 1/2) / cols, (j + 1/2) / rows)`, so that a node map reads back without blur.
pub fn patch_mesh(points: Vec<DVec3>, rows: usize, cols: usize) -> Result<TriMesh, ReliefError> {
    super::bake::check(rows, cols, points.len())?;
    let ids: Vec<u32> = (0..points.len() as u32).collect();
    let triangles = split_quads(&points, &ids, rows, cols, [4; 4]);
    let values = (0..rows * cols)
        .flat_map(|n| [(n % cols) as f32 + 0.5, (n / cols) as f32 + 0.5].into_iter().zip([cols, rows]))
        .map(|(texel, size)| texel / size as f32)
        .collect();
    Ok(TriMesh { points, triangles, attributes: vec![Attribute { name: "uv".into(), width: 2, values }] })
}

/// Joins arrays of nodes along the curves and corners of the network.
fn weld(network: &Network, nodes: &[Grid]) -> Result<PatchedMesh, ReliefError> {
    let shapes: Vec<_> = nodes.iter().map(|g| (g.rows, g.cols, g.points.len())).collect();
    let counts = check(network, "grids", &shapes).map_err(|e| match e {
        FitError::Count { what, found, wanted } => ReliefError::Count { what, found, wanted },
        FitError::Shape { patch, rows, cols, points } => ReliefError::Shape { patch, rows, cols, found: points },
        FitError::Mismatch { curve, first, second } => ReliefError::Mismatch { curve, first, second },
        FitError::NoSuchCurve { patch, .. } => ReliefError::Network { patch },
        other => unreachable!("checking shapes says {other}"),
    })?;
    let mut valence = vec![0; network.corners.len()];
    for p in 0..network.patches.len() {
        for k in 0..4 {
            *valence.get_mut(network.corner(p, k) as usize).ok_or(ReliefError::Network { patch: p })? += 1;
        }
    }
    let mut corner_ids = vec![NONE; network.corners.len()];
    let mut curve_ids: Vec<Vec<u32>> = counts.iter().map(|&n| vec![NONE; n]).collect();
    let PatchedMesh { mut mesh, mut patches } = PatchedMesh::default();
    for (p, (patch, grid)) in network.patches.iter().zip(nodes).enumerate() {
        let mut ids = vec![NONE; grid.points.len()];
        for (k, side) in patch.sides.iter().enumerate() {
            let n = if k % 2 == 0 { grid.cols } else { grid.rows };
            for i in 0..n {
                let here = node(grid.rows, grid.cols, k, i, 0);
                let along = if side.reversed { n - 1 - i } else { i };
                let ends = network.curves[side.curve as usize].corners;
                let shared = match along {
                    0 => corner_ids.get_mut(ends[0] as usize),
                    a if a == n - 1 => corner_ids.get_mut(ends[1] as usize),
                    a => curve_ids[side.curve as usize].get_mut(a),
                };
                let shared = shared.ok_or(ReliefError::Network { patch: p })?;
                if *shared == NONE {
                    *shared = mesh.points.len() as u32;
                    mesh.points.push(grid.points[here]);
                }
                ids[here] = *shared;
            }
        }
        for (id, &point) in ids.iter_mut().zip(&grid.points) {
            if *id == NONE {
                *id = mesh.points.len() as u32;
                mesh.points.push(point);
            }
        }
        let valences = std::array::from_fn(|k| valence[network.corner(p, k) as usize]);
        let triangles = split_quads(&mesh.points, &ids, grid.rows, grid.cols, valences);
        mesh.triangles.extend(triangles.iter().map(|t| t.map(|n| ids[n as usize])));
        patches.push(PatchNodes { rows: grid.rows, cols: grid.cols, vertices: ids, triangles });
    }
    Ok(PatchedMesh { mesh, patches })
}

/// Splits each quad along its shorter diagonal (on a tie the one from the lower left) and leaves out triangles
/// that have lost a corner to welding; the triangles are of nodes.
///
/// `ids` are the vertices of the nodes.
/// `valences` are the numbers of patch corners around the four corners. Around one of valence 2 both quads have
/// the same other diagonal, which must not become an edge of four triangles: they are split through the corner.
/// At one of valence 1 the corner's own quad is folded shut and its two neighbours are in that position.
fn split_quads(points: &[DVec3], ids: &[u32], rows: usize, cols: usize, valences: [u32; 4]) -> Vec<[u32; 3]> {
    let mut triangles = Vec::new();
    let id = |n: u32| ids[n as usize];
    let corners = [(0, 0), (cols - 2, 0), (cols - 2, rows - 2), (0, rows - 2)];
    for j in 0..rows - 1 {
        for i in 0..cols - 1 {
            let at = |di: usize, dj: usize| ((j + dj) * cols + i + di) as u32;
            let (a, b, c, d) = (at(0, 0), at(1, 0), at(1, 1), at(0, 1));
            let length = |p: u32, q: u32| points[id(p) as usize].distance_squared(points[id(q) as usize]);
            let forced = (0..4).find(|&k| {
                let away = corners[k].0.abs_diff(i) + corners[k].1.abs_diff(j);
                valences[k] < 3 && away == 2 - valences[k] as usize
            });
            let forced = forced.map(|k| k % 2 == 0);
            let rising = forced.unwrap_or_else(|| length(a, c) <= length(b, d));
            let halves = if rising { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
            let is_whole = |t: &[u32; 3]| id(t[0]) != id(t[1]) && id(t[1]) != id(t[2]) && id(t[2]) != id(t[0]);
            triangles.extend(halves.into_iter().filter(is_whole));
        }
    }
    triangles
}
