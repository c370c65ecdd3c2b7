//! Triangles without height: removed by collapsing or flipping edges, so that the surface stays whole.
//!
//! See `docs/methods/mend.md`, "Repair", step 6.

use super::repairs::Repairs;
use crate::geom::{Aabb, tolerance};
use crate::mesh::TriMesh;
use crate::mesh::change::Changing;
use crate::mesh::disjoint::Taken;
use crate::observe::{Cancelled, Observer};
use glam::DVec3;

/// Each pass can free only triangles that do not touch each other; clusters of them are short in practice.
const SLIVER_PASSES: usize = 12;

/// Removes triangles lower than the library's tolerance from an oriented manifold.
pub(super) fn remove(
    mesh: &TriMesh,
    triangles: &mut Vec<[u32; 3]>,
    source: &[u32],
    done: &mut Repairs,
    observer: &dyn Observer,
) -> Result<(), Cancelled> {
    let at = |v: u32| mesh.points[source[v as usize] as usize];
    let flat = tolerance::length(Aabb::of(&mesh.points).diagonal());
    let is_low = |corners: [u32; 3]| height(corners.map(at)).0 <= flat;
    done.degenerate_left = triangles.iter().filter(|&&t| is_low(t)).count();
    if done.degenerate_left == 0 {
        return Ok(());
    }
    let mut mending = Mending { mesh: Changing::new(triangles, source.len(), &[]), at, flat, done };
    for _ in 0..SLIVER_PASSES {
        observer.check()?;
        let all = 0..mending.mesh.len();
        let low: Vec<u32> = all.filter(|&t| mending.mesh.get(t).is_some_and(is_low)).collect();
        mending.done.degenerate_left = low.len();
        if low.is_empty() || !mending.pass(&low) {
            break;
        }
    }
    *triangles = mending.mesh.into_triangles();
    done.degenerate_left = triangles.iter().filter(|&&t| is_low(t)).count();
    Ok(())
}

/// Height over the longest edge, and the number of that edge.
fn height([a, b, c]: [DVec3; 3]) -> (f64, usize) {
    let lengths = [a.distance(b), b.distance(c), c.distance(a)];
    let longest = (0..3).fold(0, |m, k| if lengths[k] > lengths[m] { k } else { m });
    let twice = (b - a).cross(c - a).length();
    (if lengths[longest] > 0.0 { twice / lengths[longest] } else { 0.0 }, longest)
}

/// A mesh whose low triangles are removed.
struct Mending<'a, P> {
    mesh: Changing,
    at: P,
    /// Triangles no higher than this have no height.
    flat: f64,
    done: &'a mut Repairs,
}

impl<P: Fn(u32) -> DVec3> Mending<'_, P> {
    /// Removes low triangles that do not touch each other; true if anything was changed.
    fn pass(&mut self, low: &[u32]) -> bool {
        let mut touched = Taken::default();
        let mut changed = false;
        for &t in low {
            if let Some(corners) = self.mesh.get(t)
                && touched.spares(&corners)
            {
                changed |= self.mend(t, corners, &mut touched);
            }
        }
        changed
    }

    /// Removes one low triangle, if that can be done without what was touched.
    fn mend(&mut self, t: u32, corners: [u32; 3], touched: &mut Taken) -> bool {
        let (low, longest) = height(corners.map(&self.at));
        let length = |k: usize| (self.at)(corners[k]).distance((self.at)(corners[(k + 1) % 3]));
        let shortest = (1..3).fold(0, |m, k| if length(k) < length(m) { k } else { m });
        if length(shortest) <= self.flat {
            let (a, b) = (corners[shortest], corners[(shortest + 1) % 3]);
            let around = [self.mesh.around(a), self.mesh.around(b)].concat();
            let is_free = touched.spares(&around) && self.mesh.is_collapsible(b, a);
            if is_free {
                self.mesh.collapse(b, a);
                touched.add(&around);
                self.done.collapsed_edges += 1;
            }
            return is_free;
        }
        // The corner over the longest edge lies on it.
        if self.mesh.beyond(t, [corners[longest], corners[(longest + 1) % 3]]).is_none() {
            self.mesh.drop(t);
            touched.add(&corners);
            self.done.trimmed_faces += 1;
            return true;
        }
        let Some(flip) = self.mesh.flip_of(t, longest) else { return false };
        let worst = flip.corners.map(|c| height(c.map(&self.at)).0).into_iter().fold(f64::INFINITY, f64::min);
        let other = height(self.mesh.corners(flip.triangles[1]).map(&self.at)).0;
        if !touched.spares(&flip.tips) || worst <= low.min(other) {
            return false;
        }
        self.mesh.flip(&flip);
        touched.add(&[flip.edge, flip.tips].concat());
        self.done.flipped_edges += 1;
        true
    }
}
