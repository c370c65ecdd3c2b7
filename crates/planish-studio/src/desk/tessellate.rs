//! Arrays of what is shown: meshes with normals that keep sharp edges, surfaces at the nodes of their grids, lines.

use crate::protocol::frame::Arrays;
use planish::DVec3;
use planish::cloud::Cloud;
use planish::curve::vertex_curvature;
use planish::grid::Grid;
use planish::mesh::{Adjacency, DecimateParams, DecimateTarget, FacePoint, NONE, TriMesh, decimate, next, sharp_edges};
use planish::model::Model;
use planish::observe::Silent;
use planish::relief::{self, Relief};
use rayon::prelude::*;

/// Edges sharper than this are shown with an edge, degrees.
const SHARP_DEG: f64 = 40.0;
/// Triangles of the mesh that is shown while the view moves: twenty pictures a second where a processor draws them.
const COARSE_TRIANGLES: usize = 80_000;
/// Points of a scan that are shown at most.
const MOST_POINTS: usize = 300_000;
/// Nodes of all surfaces that are shown at most, and of one surface along a side.
const MOST_NODES: usize = 200_000;
const NODES_PER_SIDE: [usize; 2] = [9, 65];
/// Iso-curves of a grid in each direction, besides its sides.
const ISOLINES_PER_DIRECTION: usize = 7;

/// Points of a scan, as many as can be shown.
/// * `known` - the same points with what is known of them
pub fn points(cloud: &Cloud, known: Option<&Cloud>, center: DVec3) -> Arrays {
    let step = cloud.points.len().div_ceil(MOST_POINTS).max(1);
    let mut arrays = Arrays::default();
    let shown = cloud.points.iter().step_by(step);
    arrays.floats("position", 3, shown.flat_map(|p| relative(*p, center)));
    let found = [("normal", 3), ("noise", 1), ("confidence", 1), ("segment", 1), ("outlier", 1)];
    let known = known.filter(|k| k.points.len() == cloud.points.len());
    for (attribute, width) in
        known.iter().flat_map(|k| found.iter().filter_map(|&(n, w)| Some((k.attribute(n, w)?, w))))
    {
        arrays.floats(
            &attribute.name,
            width as u32,
            attribute.values.chunks_exact(width).step_by(step).flatten().copied(),
        );
    }
    if let Some(color) = cloud.attribute("color", 3) {
        arrays.floats("color", 3, color.values.chunks_exact(3).step_by(step).flatten().copied());
    }
    arrays
}

fn relative(p: DVec3, center: DVec3) -> [f32; 3] {
    (p - center).as_vec3().to_array()
}

/// A mesh. Vertices at sharp edges come once for each side.
/// * `measured` - with the mean curvature
pub fn mesh(mesh: &TriMesh, center: DVec3, measured: bool) -> Arrays {
    let adjacency = Adjacency::new(mesh);
    let (of_corner, origin) = split_vertices(mesh, &adjacency);
    let mut normals = vec![DVec3::ZERO; origin.len()];
    for t in 0..mesh.triangles.len() {
        let area = mesh.area_vector(t);
        (0..3).for_each(|k| normals[of_corner[3 * t + k] as usize] += area);
    }
    let mut arrays = Arrays::default();
    arrays.floats("position", 3, origin.iter().flat_map(|&v| relative(mesh.points[v as usize], center)));
    arrays.floats("normal", 3, normals.iter().flat_map(|n| n.normalize_or_zero().as_vec3().to_array()));
    arrays.numbers("index", 1, of_corner.iter().copied());
    if measured {
        let curvature = vertex_curvature(mesh, &adjacency);
        let mean = |v: &u32| (0.5 * (curvature[*v as usize].most + curvature[*v as usize].least)) as f32;
        arrays.floats("curvature", 1, origin.iter().map(mean));
    }
    arrays
}

/// For each corner of a triangle its vertex, and for each vertex the one of the mesh that it stands for.
fn split_vertices(mesh: &TriMesh, adjacency: &Adjacency) -> (Vec<u32>, Vec<u32>) {
    let corners = 3 * mesh.triangles.len();
    let mut parent: Vec<u32> = (0..corners as u32).collect();
    fn root(parent: &mut [u32], mut c: u32) -> u32 {
        while parent[c as usize] != c {
            parent[c as usize] = parent[parent[c as usize] as usize];
            c = parent[c as usize];
        }
        c
    }
    let sharp = sharp_edges(mesh, adjacency, SHARP_DEG);
    for h in 0..corners as u32 {
        let other = adjacency.opposite[h as usize];
        if other == NONE || other < h || sharp[h as usize] {
            continue;
        }
        for (a, b) in [(h, next(other)), (next(h), other)] {
            let (a, b) = (root(&mut parent, a), root(&mut parent, b));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let (mut number, mut origin) = (vec![NONE; corners], Vec::new());
    let of_corner = (0..corners as u32)
        .map(|c| {
            let root = root(&mut parent, c) as usize;
            if number[root] == NONE {
                number[root] = origin.len() as u32;
                origin.push(mesh.origin(c));
            }
            number[root]
        })
        .collect();
    (of_corner, origin)
}

/// A mesh of fewer triangles. One that cannot be decimated is shown as it is.
pub fn coarse(full: &TriMesh, center: DVec3) -> Arrays {
    let params = DecimateParams { target: DecimateTarget::Triangles(COARSE_TRIANGLES), ..DecimateParams::default() };
    match decimate(full, None, &params, &Silent) {
        Ok(less) => mesh(&less.mesh, center, false),
        Err(_) => mesh(full, center, false),
    }
}

/// Courses of curves: all their points, and where each begins.
pub fn courses<'p>(mesh: &TriMesh, center: DVec3, curves: impl Iterator<Item = &'p [FacePoint]>) -> Arrays {
    let course = |points: &[FacePoint]| points.iter().map(|p| p.position(mesh)).collect::<Vec<_>>();
    lines(curves.map(course), center)
}

fn lines(lines: impl Iterator<Item = Vec<DVec3>>, center: DVec3) -> Arrays {
    let (mut positions, mut offsets) = (Vec::new(), vec![0u32]);
    for line in lines {
        positions.extend(line.iter().flat_map(|p| relative(*p, center)));
        offsets.push((positions.len() / 3) as u32);
    }
    let mut arrays = Arrays::default();
    arrays.floats("position", 3, positions);
    arrays.numbers("offset", 1, offsets);
    arrays
}

/// Nodes of a grid that are shown, along u and along v.
fn nodes(grid: &Grid, patches: usize) -> [Vec<usize>; 2] {
    let most = (MOST_NODES / patches.max(1)).isqrt().clamp(NODES_PER_SIDE[0], NODES_PER_SIDE[1]);
    [grid.cols, grid.rows].map(|count| even(count, most))
}

/// `most` of `count` numbers, the first and the last among them.
pub(super) fn even(count: usize, most: usize) -> Vec<usize> {
    let shown = count.min(most).max(2);
    (0..shown).map(|k| (k * (count - 1) + (shown - 1) / 2) / (shown - 1)).collect()
}

/// A surface at its nodes: position, unit normal, distance of the grid along it, mean curvature.
struct Node {
    at: DVec3,
    normal: DVec3,
    deviation: f64,
    curvature: f64,
}

/// The fitted surfaces.
pub fn surfaces(model: &Model, center: DVec3) -> Arrays {
    let patches: Vec<Vec<Node>> = model
        .surfaces
        .par_iter()
        .zip(&model.grids)
        .map(|(surface, grid)| {
            let [us, vs] = nodes(grid, model.grids.len());
            let share = |k: usize, count: usize| k as f64 / (count - 1) as f64;
            let at = vs.iter().flat_map(|&j| us.iter().map(move |&i| (i, j)));
            at.map(|(i, j)| {
                let jet = surface.jet(share(i, grid.cols), share(j, grid.rows));
                let normal = jet.area_vector().normalize_or_zero();
                let point = grid.points[j * grid.cols + i];
                let curvature = jet.curvatures().map_or(0.0, |[a, b]| 0.5 * (a + b));
                Node { at: jet.point, normal, deviation: (point - jet.point).dot(normal), curvature }
            })
            .collect()
        })
        .collect();
    let all = || patches.iter().flatten();
    let mut arrays = Arrays::default();
    arrays.floats("position", 3, all().flat_map(|n| relative(n.at, center)));
    arrays.floats("normal", 3, all().flat_map(|n| n.normal.as_vec3().to_array()));
    arrays.floats("deviation", 1, all().map(|n| n.deviation as f32));
    arrays.floats("curvature", 1, all().map(|n| n.curvature as f32));
    add_lattices(model, &mut arrays);
    arrays
}

/// The surfaces with their relief: the grids, or with other reliefs.
pub fn displaced(model: &Model, reliefs: Option<&[Relief]>, center: DVec3) -> Arrays {
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    let made: Option<Vec<Vec<DVec3>>> = reliefs.and_then(|reliefs| {
        let each = model.surfaces.par_iter().zip(reliefs);
        each.map(|(surface, relief)| relief::displace(surface, relief)).collect::<Result<_, _>>().ok()
    });
    for (k, grid) in model.grids.iter().enumerate() {
        let [us, vs] = nodes(grid, model.grids.len());
        let points = made.as_ref().and_then(|m| m.get(k)).unwrap_or(&grid.points);
        let at = |i: usize, j: usize| points[vs[j] * grid.cols + us[i]];
        for j in 0..vs.len() {
            for i in 0..us.len() {
                let (a, b) = (i.saturating_sub(1), (i + 1).min(us.len() - 1));
                let (c, d) = (j.saturating_sub(1), (j + 1).min(vs.len() - 1));
                let normal = (at(b, j) - at(a, j)).cross(at(i, d) - at(i, c)).normalize_or_zero();
                positions.extend(relative(at(i, j), center));
                normals.extend(normal.as_vec3().to_array());
            }
        }
    }
    let mut arrays = Arrays::default();
    arrays.floats("position", 3, positions);
    arrays.floats("normal", 3, normals);
    add_lattices(model, &mut arrays);
    arrays
}

/// Triangles over the nodes of all patches, and for each node its patch.
fn add_lattices(model: &Model, arrays: &mut Arrays) {
    let (mut index, mut patch, mut from) = (Vec::new(), Vec::new(), 0u32);
    for (p, grid) in model.grids.iter().enumerate() {
        let [us, vs] = nodes(grid, model.grids.len());
        let (cols, rows) = (us.len() as u32, vs.len() as u32);
        for j in 0..rows - 1 {
            for i in 0..cols - 1 {
                let a = from + j * cols + i;
                index.extend([a, a + 1, a + cols + 1, a, a + cols + 1, a + cols]);
            }
        }
        patch.extend((0..cols * rows).map(|_| p as f32));
        from += cols * rows;
    }
    arrays.floats("patch", 1, patch);
    arrays.numbers("index", 1, index);
}

/// Iso-curves of the grids.
pub fn isolines(model: &Model, center: DVec3) -> Arrays {
    let each = model.grids.iter().flat_map(|grid| {
        let [us, vs] = nodes(grid, model.grids.len());
        let [along_u, along_v] = [grid.cols, grid.rows].map(|count| even(count, ISOLINES_PER_DIRECTION + 2));
        let at = |i: usize, j: usize| grid.points[j * grid.cols + i];
        let of_u = along_v.into_iter().map(|j| us.iter().map(|&i| at(i, j)).collect::<Vec<_>>());
        let of_v = along_u.into_iter().map(|i| vs.iter().map(|&j| at(i, j)).collect::<Vec<_>>());
        of_u.chain(of_v).collect::<Vec<_>>()
    });
    lines(each, center)
}

/// Control nets.
pub fn nets(model: &Model, center: DVec3) -> Arrays {
    let each = model.surfaces.iter().flat_map(|s| {
        let rows = (0..s.rows).map(|j| (0..s.cols).map(|i| s.at(i, j)).collect::<Vec<_>>());
        let cols = (0..s.cols).map(|i| (0..s.rows).map(|j| s.at(i, j)).collect::<Vec<_>>());
        rows.chain(cols).collect::<Vec<_>>()
    });
    lines(each, center)
}

#[cfg(test)]
mod tests {
    use super::*;
    use planish::synthetic::shapes;

    #[test]
    fn a_cube_has_24_vertices_times_its_faces_and_a_sphere_as_many_as_its_mesh() {
        let cube = shapes::cuboid(DVec3::ONE, 1);
        let (_, origin) = split_vertices(&cube, &Adjacency::new(&cube));
        assert_eq!((cube.points.len(), origin.len()), (8, 24));
        let sphere = shapes::sphere(1.0, 3);
        let (corners, origin) = split_vertices(&sphere, &Adjacency::new(&sphere));
        assert_eq!(origin.len(), sphere.points.len());
        assert!((0..corners.len()).all(|c| origin[corners[c] as usize] == sphere.origin(c as u32)));
    }

    #[test]
    fn shown_nodes_begin_and_end_with_the_grid_and_rise() {
        for (count, most) in [(2, 9), (9, 9), (100, 33), (65, 64)] {
            let shown = even(count, most);
            assert_eq!((shown[0], shown[shown.len() - 1]), (0, count - 1));
            assert!(shown.len() == count.min(most) && shown.windows(2).all(|w| w[0] < w[1]));
        }
    }
}
