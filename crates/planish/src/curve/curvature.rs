//! Principal curvatures at the vertices.
//!
//! Rusinkiewicz 2004, *Estimating curvatures and their derivatives on triangle meshes*: in every triangle the change
//! of the vertex normals along its edges gives a shape operator (least squares); those around a vertex are turned
//! into its tangent plane and blended by area.

use crate::geom::is_positive;
use crate::mesh::{Adjacency, TriMesh};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Curvatures at a vertex, 1 / world unit, positive where the surface is convex.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VertexCurvature {
    /// The greater principal curvature.
    pub most: f64,
    /// The lesser one.
    pub least: f64,
    /// Direction of the greater one, a unit vector.
    pub direction: DVec3,
}

/// Curvatures of every vertex; zero at vertices without triangles.
pub fn vertex_curvature(mesh: &TriMesh, adjacency: &Adjacency) -> Vec<VertexCurvature> {
    let normals = mesh.vertex_normals();
    let operators: Vec<Option<[f64; 3]>> =
        (0..mesh.triangles.len()).into_par_iter().map(|t| of_triangle(mesh, t, &normals)).collect();
    (0..mesh.points.len() as u32)
        .into_par_iter()
        .map(|v| {
            let n = normals[v as usize];
            if adjacency.outgoing[v as usize] == crate::mesh::NONE || n == DVec3::ZERO {
                return VertexCurvature::default();
            }
            let (a, b) = n.any_orthonormal_pair();
            let (mut sum, mut area) = ([0.0; 3], 0.0);
            for h in adjacency.fan(v) {
                let t = h as usize / 3;
                let Some([e, f, g]) = operators[t] else { continue };
                let m = mesh.normal(t);
                let (x, y) = frame(mesh, t, m);
                // The triangle's plane is turned into the tangent plane, about the line that they share.
                let turn = glam::DQuat::from_rotation_arc(n, m);
                let (p, q) = (turn * a, turn * b);
                let (p, q) = (DVec2::new(p.dot(x), p.dot(y)), DVec2::new(q.dot(x), q.dot(y)));
                let form = |s: DVec2, r: DVec2| e * s.x * r.x + f * (s.x * r.y + s.y * r.x) + g * s.y * r.y;
                let w = mesh.area(t);
                for (sum, value) in sum.iter_mut().zip([form(p, p), form(p, q), form(q, q)]) {
                    *sum += w * value;
                }
                area += w;
            }
            if !is_positive(area) {
                return VertexCurvature::default();
            }
            let [e, f, g] = sum.map(|s| s / area);
            let (mean, half) = ((e + g) / 2.0, (e - g) / 2.0);
            let root = half.hypot(f);
            let angle = f.atan2(half) / 2.0;
            VertexCurvature { most: mean + root, least: mean - root, direction: a * angle.cos() + b * angle.sin() }
        })
        .collect()
}

/// Two orthonormal directions in the plane of a triangle.
fn frame(mesh: &TriMesh, t: usize, normal: DVec3) -> (DVec3, DVec3) {
    let [a, b, _] = mesh.corners(t);
    let x = (b - a).normalize_or_zero();
    (x, normal.cross(x))
}

/// The symmetric operator `[e, f; f, g]` in [`frame`] that best tells the change of the normals; `None` for a
/// triangle without area.
fn of_triangle(mesh: &TriMesh, t: usize, normals: &[DVec3]) -> Option<[f64; 3]> {
    let m = mesh.normal(t);
    if m == DVec3::ZERO {
        return None;
    }
    let (x, y) = frame(mesh, t, m);
    let corners = mesh.corners(t);
    let n = mesh.triangles[t].map(|v| normals[v as usize]);
    // Normal equations of the six equations E u = dn.
    let (mut uu, mut uv, mut vv) = (0.0, 0.0, 0.0);
    let mut rhs = [0.0; 3];
    for k in 0..3 {
        let d = corners[(k + 1) % 3] - corners[k];
        let dn = n[(k + 1) % 3] - n[k];
        let (u, v) = (d.dot(x), d.dot(y));
        let (p, q) = (dn.dot(x), dn.dot(y));
        uu += u * u;
        uv += u * v;
        vv += v * v;
        rhs[0] += u * p;
        rhs[1] += v * p + u * q;
        rhs[2] += v * q;
    }
    // [uu uv 0; uv uu+vv uv; 0 uv vv] [e f g] = rhs
    let det = uu * ((uu + vv) * vv - uv * uv) - uv * uv * vv;
    if det.is_nan() || det.abs() <= f64::MIN_POSITIVE {
        return None;
    }
    let [r0, r1, r2] = rhs;
    let f = (uu * vv * r1 - uv * vv * r0 - uv * uu * r2) / det;
    let e = (r0 - uv * f) / uu;
    let g = (r2 - uv * f) / vv;
    (e.is_finite() && f.is_finite() && g.is_finite()).then_some([e, f, g])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::shapes;

    #[test]
    fn a_sphere_of_radius_2_has_both_curvatures_one_half_within_7_percent() {
        let mesh = shapes::sphere(2.0, 4);
        for c in vertex_curvature(&mesh, &Adjacency::new(&mesh)) {
            assert!((c.most - 0.5).abs() < 0.035 && (c.least - 0.5).abs() < 0.035, "{c:?}");
        }
    }

    #[test]
    fn a_tube_is_bent_once_around_and_straight_along_within_2_percent() {
        let mesh = shapes::sheet(96, 40, true, false, |s, t| {
            let a = s * std::f64::consts::TAU;
            DVec3::new(0.5 * a.cos(), 0.5 * a.sin(), 3.0 * t)
        });
        let adjacency = Adjacency::new(&mesh);
        let sign = if mesh.normal(0).dot(mesh.points[0].with_z(0.0)) > 0.0 { 1.0 } else { -1.0 };
        for (v, c) in vertex_curvature(&mesh, &adjacency).iter().enumerate() {
            if !adjacency.is_boundary_vertex(v as u32) {
                let (around, along) = if sign > 0.0 { (c.most, c.least) } else { (-c.least, -c.most) };
                assert!((around - 2.0).abs() < 0.04 && along.abs() < 0.04, "{c:?}");
            }
        }
    }
}
