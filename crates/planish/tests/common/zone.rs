//! How well a mesh keeps the sharp edges of another.

use glam::DVec3;
use planish::geom::{Aabb, Bvh, random};
use planish::mesh::{Adjacency, TriMesh, next, sharp_edges};

/// Figures of [`measure`]; distances as percent of the diagonal.
#[derive(Clone, Copy, Debug)]
#[allow(dead_code)]
pub struct Zone {
    /// Mean angle between normals within 1.5 cells of a true sharp edge, degrees.
    pub normal_deg: f64,
    /// Share of the zone whose normals are off by more than 30 degrees, percent.
    pub off_30: f64,
    /// From places on true edges to the mesh: root mean square and greatest.
    pub edge_rms: f64,
    pub edge_max: f64,
    /// Between the surfaces, both ways: root mean square and greatest.
    pub rms: f64,
    pub max: f64,
}

/// Sharp edges of the true mesh: dihedral angles from this on.
const SHARP_DEG: f64 = 26.0;
const SAMPLES: u64 = 200_000;

/// Measures `made` against `truth`; `cell` is the edge of a cell.
pub fn measure(truth: &TriMesh, made: &TriMesh, cell: f64) -> Zone {
    let diagonal = Aabb::of(&truth.points).diagonal();
    let adjacency = Adjacency::new(truth);
    let sharp = sharp_edges(truth, &adjacency, SHARP_DEG);
    let edges: Vec<[DVec3; 2]> = (0..sharp.len() as u32)
        .filter(|&h| sharp[h as usize] && adjacency.opposite[h as usize] > h)
        .map(|h| [truth.points[truth.origin(h) as usize], truth.points[truth.origin(next(h)) as usize]])
        .collect();
    let (true_bvh, made_bvh) = (Bvh::new(truth), Bvh::new(made));
    // Sharp edges as triangles without area answer for the nearest edge.
    let lines = (!edges.is_empty()).then(|| {
        let points = edges.iter().flatten().copied().collect();
        Bvh::new(&TriMesh::new(points, (0..edges.len() as u32).map(|e| [2 * e, 2 * e + 1, 2 * e + 1]).collect()))
    });
    let (mut sum, mut count, mut off) = (0.0, 0.0, 0.0);
    let (mut squares, mut n, mut max) = (0.0, 0.0, 0.0f64);
    for (p, normal) in samples(made) {
        let hit = true_bvh.closest(p);
        squares += hit.distance * hit.distance;
        n += 1.0;
        max = max.max(hit.distance);
        if lines.as_ref().is_some_and(|l| l.closest(p).distance < 1.5 * cell) {
            let m = truth.normal(hit.place.face as usize);
            let angle = m.cross(normal).length().atan2(m.dot(normal)).to_degrees();
            sum += angle;
            count += 1.0;
            off += (angle > 30.0) as u32 as f64;
        }
    }
    for (p, _) in samples(truth) {
        let d = made_bvh.closest(p).distance;
        squares += d * d;
        n += 1.0;
        max = max.max(d);
    }
    let (mut edge_squares, mut edge_n, mut edge_max) = (0.0, 0.0f64, 0.0f64);
    for [a, b] in &edges {
        let steps = (a.distance(*b) / (0.1 * cell)).ceil().max(1.0);
        for s in 0..=steps as usize {
            let d = made_bvh.closest(a.lerp(*b, s as f64 / steps)).distance;
            edge_squares += d * d;
            edge_n += 1.0;
            edge_max = edge_max.max(d);
        }
    }
    let percent = 100.0 / diagonal;
    Zone {
        normal_deg: sum / f64::max(count, 1.0),
        off_30: 100.0 * off / f64::max(count, 1.0),
        edge_rms: (edge_squares / edge_n.max(1.0)).sqrt() * percent,
        edge_max: edge_max * percent,
        rms: f64::sqrt(squares / n) * percent,
        max: max * percent,
    }
}

/// Places spread evenly over a mesh, with their normals.
fn samples(mesh: &TriMesh) -> Vec<(DVec3, DVec3)> {
    let areas: Vec<f64> = (0..mesh.triangles.len())
        .scan(0.0, |sum, t| {
            *sum += mesh.area(t);
            Some(*sum)
        })
        .collect();
    let total = areas[areas.len() - 1];
    (0..SAMPLES)
        .map(|k| {
            let goal = (k as f64 + random::unit(1, 3 * k)) / SAMPLES as f64 * total;
            let t = areas.partition_point(|&a| a <= goal).min(areas.len() - 1);
            let (r, s) = (random::unit(1, 3 * k + 1).sqrt(), random::unit(1, 3 * k + 2));
            let [a, b, c] = mesh.corners(t);
            (a * (1.0 - r) + b * (r * (1.0 - s)) + c * (r * s), mesh.normal(t))
        })
        .collect()
}
