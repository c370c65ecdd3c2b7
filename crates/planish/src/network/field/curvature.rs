//! Principal directions at the scale of a patch, with the confidence that a field may have in them.
//!
//! The curvature tensor of a piece of a mesh is the mean over its edges of the angle across each edge times its direction
//! (Cohen-Steiner and Morvan, *Restricted Delaunay Triangulations and Normal Cycle*, 2003). It is taken over three pieces of
//! growing radius, and the radius at which it turns least is taken (Campen, Ibing, Ebke, Zorin, Kobbelt, *Scale-Invariant
//! Directional Alignment of Surface Parametrizations*, 2016). Pieces end at sharp lines.

use super::flat;
use crate::mesh::{Adjacency, NONE, TriMesh};
use crate::observe::{Cancelled, Observer};
use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

/// Radii of the pieces, in parts of the radius asked for.
const RADII: [f64; 3] = [0.6, 1.0, 1.6];

/// A surface that bends by less than this angle within the radius has no direction that counts in full, radians.
const FULL_BEND: f64 = 0.3;

/// Faces between two looks at the observer.
const CHUNK: usize = 512;

/// Per face the angle of a principal direction from its first edge, radians, and its confidence: 0 on a plane, a ball or
/// noise, 1/2 on a cylinder, 1 on a saddle. Which of the two directions it is does not matter to a cross.
pub(super) fn principal_directions(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    lines: &[bool],
    radius: f64,
    observer: &dyn Observer,
) -> Result<Vec<(f64, f64)>, Cancelled> {
    let normal: Vec<DVec3> = (0..mesh.triangles.len()).map(|f| mesh.normal(f)).collect();
    let middle: Vec<DVec3> = (0..mesh.triangles.len()).map(|f| mesh.corners(f).iter().sum::<DVec3>() / 3.0).collect();
    let bend = |h: u32| {
        let (f, g) = (h / 3, adjacency.opposite[h as usize] / 3);
        let [from, to] = [h, crate::mesh::next(h)].map(|h| mesh.points[mesh.origin(h) as usize]);
        let (m, n) = (normal[f as usize], normal[g as usize]);
        let along = to - from;
        // Half of the edge: its other face adds the other half.
        let angle = m.cross(n).dot(along.normalize_or_zero()).atan2(m.dot(n));
        let along = along * (0.5 * angle / along.length().max(f64::MIN_POSITIVE)).abs().sqrt();
        let square = DMat3::from_cols(along * along.x, along * along.y, along * along.z);
        if angle < 0.0 { -square } else { square }
    };
    let is_open = |h: u32| adjacency.opposite[h as usize] != NONE && !lines[h as usize];
    let own: Vec<DMat3> = (0..mesh.triangles.len() as u32)
        .map(|f| (3 * f..3 * f + 3).filter(|&h| is_open(h)).map(bend).fold(DMat3::ZERO, |a, b| a + b))
        .collect();
    let out: Vec<Option<(f64, f64)>> = (0..mesh.triangles.len())
        .into_par_iter()
        .with_min_len(CHUNK)
        .map(|f| {
            if f % CHUNK == 0 && observer.cancelled() {
                return None;
            }
            let pieces = grow(adjacency, &is_open, &middle, f as u32, radius * RADII[2]);
            let found = RADII.map(|part| {
                let near = pieces.iter().filter(|p| p.1 <= radius * part);
                let (sum, area) = near.fold((DMat3::ZERO, 0.0), |(sum, area), p| {
                    (sum + own[p.0 as usize], area + mesh.area(p.0 as usize))
                });
                direction(mesh, f, sum, area, radius * part)
            });
            Some(steadiest(found))
        })
        .collect();
    out.into_iter().map(|d| d.ok_or(Cancelled)).collect()
}

/// The faces around `start` with their distances from it, up to `radius`, reached without crossing a line.
fn grow(
    adjacency: &Adjacency,
    is_open: &impl Fn(u32) -> bool,
    middle: &[DVec3],
    start: u32,
    radius: f64,
) -> Vec<(u32, f64)> {
    let mut seen = std::collections::HashSet::from([start]);
    let mut pieces = vec![(start, 0.0)];
    let mut at = 0;
    while at < pieces.len() {
        let f = pieces[at].0;
        at += 1;
        for h in (3 * f..3 * f + 3).filter(|&h| is_open(h)) {
            let g = adjacency.opposite[h as usize] / 3;
            let distance = middle[g as usize].distance(middle[start as usize]);
            if distance <= radius && seen.insert(g) {
                pieces.push((g, distance));
            }
        }
    }
    pieces
}

/// Direction and confidence from the sum of bends over a piece of this area and radius.
fn direction(mesh: &TriMesh, f: usize, sum: DMat3, area: f64, radius: f64) -> (f64, f64) {
    let [a, b, _] = mesh.corners(f);
    let x = (b - a).normalize_or_zero();
    let y = mesh.normal(f).cross(x);
    let tensor = sum * (1.0 / area.max(f64::MIN_POSITIVE));
    let (xx, xy, yy) = (x.dot(tensor * x), x.dot(tensor * y), y.dot(tensor * y));
    let double = DVec2::new(xx - yy, 2.0 * xy);
    // Half the sum and half the difference of the principal curvatures.
    let (mean, half) = ((xx + yy) / 2.0, double.length() / 2.0);
    let squares = 2.0 * (mean * mean + half * half);
    if squares <= f64::MIN_POSITIVE || flat(mesh, f)[2].y <= 0.0 {
        return (0.0, 0.0);
    }
    let bend = radius * (mean.abs() + half);
    (double.to_angle() / 2.0, 2.0 * half * half / squares * (bend / FULL_BEND).min(1.0))
}

/// Of the directions at growing radii that which turns least from one to the next; its confidence falls with its turn.
fn steadiest(found: [(f64, f64); 3]) -> (f64, f64) {
    let cross = found.map(|(angle, confidence)| confidence * DVec2::from_angle(4.0 * angle));
    let agree = |i: usize, j: usize| cross[i].dot(cross[j]).max(0.0).sqrt();
    let (fine, coarse) = (agree(0, 1), agree(1, 2));
    let sum = if fine >= coarse { cross[0] + cross[1] } else { cross[1] + cross[2] };
    (sum.to_angle() / 4.0, fine.max(coarse))
}
