//! Feature lines: the sharp edges that bound patches.
//!
//! An edge of a machined part is sharp at every scale; a wrinkle, a scale or a scanner's noise is sharp from one
//! face to the next and flat a few faces further out. So an edge has to be sharp twice: between its two faces,
//! and between the mean normals of the surface to its left and right.

use super::LayoutParams;
use crate::mesh::{Adjacency, TriMesh, next, sharp_edges};
use glam::DVec3;
use rayon::prelude::*;

/// How far the mean normals reach, in mean edge lengths of the mesh.
const REACH: f64 = 4.0;

/// The angle between the mean normals, against the angle asked for between the faces: the surfaces beside an
/// edge may bend away from it.
const WIDE_ANGLE: f64 = 0.75;

/// Marks the half-edges on sharp edges that belong to a line worth keeping, and counts the sharp edges left
/// out. Connected sharp edges shorter together than `feature_length` of the diagonal are surface detail.
pub(super) fn feature_lines(mesh: &TriMesh, adjacency: &Adjacency, params: &LayoutParams) -> (Vec<bool>, usize) {
    let sharp = sharp_edges(mesh, adjacency, params.sharp_angle_deg);
    let found = sharp.iter().filter(|&&s| s).count();
    let edges: f64 = (0..sharp.len() as u32).map(|h| length(mesh, h)).sum();
    let reach = REACH * edges / sharp.len().max(1) as f64;
    let least = (WIDE_ANGLE * params.sharp_angle_deg).to_radians().cos();
    let mut kept: Vec<bool> = (0..sharp.len() as u32)
        .into_par_iter()
        .map(|h| {
            let o = adjacency.opposite[h as usize];
            if !sharp[h as usize] || o < h {
                return false;
            }
            let left = mean_normal(mesh, adjacency, &sharp, h, reach);
            let right = mean_normal(mesh, adjacency, &sharp, o, reach);
            left.dot(right) < least
        })
        .collect();
    for h in 0..kept.len() {
        if kept[h] {
            kept[adjacency.opposite[h] as usize] = true;
        }
    }
    drop_short(mesh, adjacency, params.feature_length * mesh.bounds().diagonal(), &mut kept);
    let left = kept.iter().filter(|&&s| s).count();
    (kept, (found - left) / 2)
}

fn length(mesh: &TriMesh, h: u32) -> f64 {
    mesh.points[mesh.origin(h) as usize].distance(mesh.points[mesh.origin(next(h)) as usize])
}

/// Mean unit normal of the surface to the left of sharp half-edge `h`, up to `reach` from its middle and to the
/// next sharp edge.
fn mean_normal(mesh: &TriMesh, adjacency: &Adjacency, sharp: &[bool], h: u32, reach: f64) -> DVec3 {
    let face = h / 3;
    let (a, b) = (mesh.points[mesh.origin(h) as usize], mesh.points[mesh.origin(next(h)) as usize]);
    let middle = a.midpoint(b);
    let inward = mesh.normal(face as usize).cross(b - a);
    let mut seen = vec![face];
    let mut sum = DVec3::ZERO;
    let mut at = 0;
    while at < seen.len() {
        let f = seen[at];
        at += 1;
        sum += mesh.area_vector(f as usize);
        for g in 3 * f..3 * f + 3 {
            let o = adjacency.opposite[g as usize];
            if o == crate::mesh::NONE || sharp[g as usize] || seen.contains(&(o / 3)) {
                continue;
            }
            let out = mesh.corners(o as usize / 3).into_iter().sum::<DVec3>() / 3.0 - middle;
            if out.length() < reach && out.dot(inward) > 0.0 {
                seen.push(o / 3);
            }
        }
    }
    sum.normalize_or_zero()
}

/// Clears connected lines shorter than `shortest`.
fn drop_short(mesh: &TriMesh, adjacency: &Adjacency, shortest: f64, sharp: &mut [bool]) {
    let mut parent: Vec<u32> = (0..mesh.points.len() as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    let edges: Vec<u32> =
        (0..sharp.len() as u32).filter(|&h| sharp[h as usize] && h < adjacency.opposite[h as usize]).collect();
    for &h in &edges {
        let (a, b) = (root(&mut parent, mesh.origin(h)), root(&mut parent, mesh.origin(next(h))));
        let (low, high) = (a.min(b), a.max(b));
        parent[high as usize] = low;
    }
    let mut total = vec![0.0; mesh.points.len()];
    for &h in &edges {
        total[root(&mut parent, mesh.origin(h)) as usize] += length(mesh, h);
    }
    for &h in &edges {
        if total[root(&mut parent, mesh.origin(h)) as usize] < shortest {
            sharp[h as usize] = false;
            sharp[adjacency.opposite[h as usize] as usize] = false;
        }
    }
}
