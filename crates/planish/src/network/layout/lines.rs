//! Feature lines: the sharp edges that bound patches.

use super::LayoutParams;
use crate::mesh::{Adjacency, NONE, TriMesh, next};

/// Marks the half-edges on sharp edges that belong to a line worth keeping, and counts the sharp edges left
/// out. An edge is sharp above `sharp_angle_deg`; connected sharp edges shorter together than
/// `feature_length` of the diagonal are surface detail (scanner noise, scales, wrinkles), not features.
pub(super) fn feature_lines(mesh: &TriMesh, adjacency: &Adjacency, params: &LayoutParams) -> (Vec<bool>, usize) {
    let least = params.sharp_angle_deg.to_radians().cos();
    let from = |h: u32| mesh.triangles[h as usize / 3][h as usize % 3];
    let mut sharp = vec![false; adjacency.opposite.len()];
    for h in 0..adjacency.opposite.len() as u32 {
        let o = adjacency.opposite[h as usize];
        if o != NONE && h < o {
            let (m, n) = (mesh.normal(h as usize / 3), mesh.normal(o as usize / 3));
            if m.dot(n) < least && m.length_squared() > 0.0 && n.length_squared() > 0.0 {
                sharp[h as usize] = true;
                sharp[o as usize] = true;
            }
        }
    }
    let mut parent: Vec<u32> = (0..mesh.points.len() as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    for h in (0..sharp.len() as u32).filter(|&h| sharp[h as usize]) {
        let (a, b) = (root(&mut parent, from(h)), root(&mut parent, from(next(h))));
        let (low, high) = (a.min(b), a.max(b));
        parent[high as usize] = low;
    }
    let mut length = vec![0.0; mesh.points.len()];
    for h in (0..sharp.len() as u32).filter(|&h| sharp[h as usize] && h < adjacency.opposite[h as usize]) {
        let (a, b) = (from(h), from(next(h)));
        length[root(&mut parent, a) as usize] += mesh.points[a as usize].distance(mesh.points[b as usize]);
    }
    let shortest = params.feature_length * mesh.bounds().diagonal();
    let mut dropped = 0;
    for h in 0..sharp.len() as u32 {
        if sharp[h as usize] && length[root(&mut parent, from(h)) as usize] < shortest {
            sharp[h as usize] = false;
            dropped += 1;
        }
    }
    (sharp, dropped / 2)
}
