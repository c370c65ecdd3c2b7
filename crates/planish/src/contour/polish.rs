//! Feature vertices that belong outside their cell are moved there, if exact signs allow it.
//!
//! A sharp edge may poke through a face of a cell without changing the side of a node: the hits then show two
//! surfaces that meet beyond the cell, and the certified mesh has a vertex that was clamped ([K01] lets it lie outside,
//! and folds can follow). Here it is moved after all, one vertex after the other, and each move is kept only if no
//! triangle around the vertex then meets any other triangle nearby in more than they share. So the certificate holds
//! after every step.

use super::patch::Wish;
use crate::field::Directed;
use crate::geom::predicates::triangles_meet;
use crate::mesh::TriMesh;
use glam::DVec3;

/// Parts of the way that are tried.
const WAYS: [f64; 3] = [1.0, 0.6, 0.3];
/// Rounds: a neighbour that moved may make room.
const ROUNDS: usize = 8;

struct Polish<'a> {
    mesh: &'a mut TriMesh,
    field: &'a Directed,
    /// First name of the hits of each axis.
    base: [u32; 3],
    /// Cells in the order of z, y, x with the range of their triangles.
    cells: Vec<([u32; 3], u32, u32)>,
}

/// Moves the vertices of `wishes`; returns how many arrived where they belong.
pub fn polish(
    mesh: &mut TriMesh,
    field: &Directed,
    base: [u32; 3],
    cells: Vec<([u32; 3], u32, u32)>,
    wishes: &[Wish],
) -> usize {
    if wishes.is_empty() {
        return 0;
    }
    let stars = stars(mesh, wishes);
    let starts: Vec<DVec3> = wishes.iter().map(|(v, _)| mesh.points[*v as usize]).collect();
    let polish = Polish { mesh, field, base, cells };
    let mut open: Vec<usize> = (0..wishes.len()).collect();
    let mut arrived = vec![false; wishes.len()];
    for _ in 0..ROUNDS {
        open.retain(|&w| {
            let (v, target) = wishes[w];
            let start = polish.mesh.points[v as usize];
            for way in WAYS {
                polish.mesh.points[v as usize] = if way == 1.0 { target } else { start.lerp(target, way) };
                if polish.allowed(&stars[w]) {
                    arrived[w] = way == 1.0;
                    return way != 1.0;
                }
            }
            polish.mesh.points[v as usize] = start;
            true
        });
    }
    // A vertex that moved before its neighbours turns triangles for a while. Where that stayed, it goes back.
    for _ in 0..ROUNDS {
        for (w, &(v, _)) in wishes.iter().enumerate() {
            let here = polish.mesh.points[v as usize];
            let turned = polish.turned_in(&stars[w]);
            if turned == 0 || here == starts[w] {
                continue;
            }
            polish.mesh.points[v as usize] = starts[w];
            if polish.turned_in(&stars[w]) < turned && polish.allowed(&stars[w]) {
                arrived[w] = false;
            } else {
                polish.mesh.points[v as usize] = here;
            }
        }
    }
    arrived.into_iter().filter(|&a| a).count()
}

/// Triangles around each vertex that wants to move.
fn stars(mesh: &TriMesh, wishes: &[Wish]) -> Vec<Vec<u32>> {
    let mut which = vec![u32::MAX; mesh.points.len()];
    for (w, (v, _)) in wishes.iter().enumerate() {
        which[*v as usize] = w as u32;
    }
    let mut stars = vec![Vec::new(); wishes.len()];
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        for &v in triangle {
            if let Some(star) = stars.get_mut(which[v as usize] as usize) {
                star.push(t as u32);
            }
        }
    }
    stars
}

impl Polish<'_> {
    /// True if the triangles of `star`, as they are now, meet nothing.
    fn allowed(&self, star: &[u32]) -> bool {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &t in star {
            let corners = self.mesh.corners(t as usize);
            low = corners.into_iter().fold(low, DVec3::min);
            high = corners.into_iter().fold(high, DVec3::max);
        }
        let all = self.near(low, high);
        star.iter().all(|&s| {
            let (p, names) = (self.mesh.corners(s as usize), self.mesh.triangles[s as usize]);
            let (low, high) = (p[0].min(p[1]).min(p[2]), p[0].max(p[1]).max(p[2]));
            all.iter().filter(|&&t| t != s).all(|&t| {
                let q = self.mesh.corners(t as usize);
                let apart = q[0].min(q[1]).min(q[2]).cmpgt(high).any() || q[0].max(q[1]).max(q[2]).cmplt(low).any();
                apart || !triangles_meet(p, names, q, self.mesh.triangles[t as usize])
            })
        })
    }

    /// Triangles of `star` that face against their hits.
    fn turned_in(&self, star: &[u32]) -> usize {
        star.iter().filter(|&&t| self.turned(t, self.mesh.corners(t as usize))).count()
    }

    /// True if a triangle faces against the normals of all hits among its corners.
    fn turned(&self, t: u32, corners: [DVec3; 3]) -> bool {
        let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let normals = self.mesh.triangles[t as usize].iter().filter_map(|&v| self.normal(v));
        let mut any = false;
        for m in normals {
            if m.dot(n) > 0.0 {
                return false;
            }
            any = true;
        }
        any
    }

    fn normal(&self, v: u32) -> Option<DVec3> {
        let axis = (0..3).rev().find(|&a| v >= self.base[a])?;
        self.field.axes[axis].hits.get((v - self.base[axis]) as usize).map(|h| h.normal)
    }

    /// Triangles that may reach into a box: those of its cells and of the next around, as moved vertices leave their
    /// cell by one at most.
    fn near(&self, low: DVec3, high: DVec3) -> Vec<u32> {
        let l = &self.field.lattice;
        let cell = |p: DVec3| ((p - l.origin) / l.step).floor();
        let (a, b) = (cell(low) - 1.0, cell(high) + 1.0);
        let clamp = |x: f64, axis: usize| x.clamp(0.0, l.cells[axis] as f64) as u32;
        let mut found = Vec::new();
        for z in clamp(a.z, 2)..=clamp(b.z, 2) {
            for y in clamp(a.y, 1)..=clamp(b.y, 1) {
                let (x0, x1) = (clamp(a.x, 0), clamp(b.x, 0));
                let first = self.cells.partition_point(|(c, ..)| [c[2], c[1], c[0]] < [z, y, x0]);
                for &(c, first, end) in &self.cells[first..] {
                    if c[2] != z || c[1] != y || c[0] > x1 {
                        break;
                    }
                    found.extend(first..end);
                }
            }
        }
        // Merged cells name their triangles in each of their parts.
        found.sort_unstable();
        found.dedup();
        found
    }
}
