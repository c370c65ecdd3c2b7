//! Triangles that are too small or look the wrong way: vertices merged into neighbours and edges flipped, one disk at a time.
//!
//! See `docs/methods/sharp.md`, step 5.

use crate::mesh::change::{Change, Changing};
use crate::mesh::disjoint::Taken;
use crate::mesh::intersect::intersections_of;
use crate::mesh::{FeatureKind, TriMesh};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use std::collections::BTreeSet;

/// Height of a triangle over its longest edge that is enough.
const GOOD_SHAPE: f64 = 0.1;
/// What is lower than that keeps so much of it: to merge vertices that are next to each other changes what is around by next
/// to nothing, but not by nothing.
const KEPT_SHAPE: f64 = 0.8;

/// How bad a triangle is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Fault {
    /// It may stay.
    None,
    /// It is too small.
    Cramped,
    /// It looks the wrong way.
    Turned,
}

/// A mesh whose vertices are merged and whose edges are flipped. No vertex moves.
pub(super) struct Merging<'a> {
    points: &'a [DVec3],
    kinds: &'a [FeatureKind],
    /// The triangles and the edges of lines.
    pub mesh: Changing,
}

impl<'a> Merging<'a> {
    /// * `kinds` - of the vertices; corners stay
    /// * `lines` - edges of sharp lines: a vertex on one is merged along it only, and they are not flipped
    pub fn new(mesh: &'a TriMesh, kinds: &'a [FeatureKind], lines: &[[u32; 2]]) -> Merging<'a> {
        Merging { points: &mesh.points, kinds, mesh: Changing::new(&mesh.triangles, mesh.points.len(), lines) }
    }

    /// Changes what is around faulty triangles where that leaves fewer faults; no triangle comes to meet another.
    /// Returns triangles that may be faulty still; empty if nothing changed.
    /// * `fault` - of a triangle with these corners
    /// * `longest` - vertices are merged over edges that are at most so long
    /// * `low` - a line may be led by way of a vertex that is nearer to it than this
    pub fn round(
        &mut self,
        faulty: &[u32],
        fault: impl Fn(u32, [DVec3; 3]) -> Fault,
        longest: f64,
        low: f64,
        observer: &dyn Observer,
    ) -> Result<Vec<u32>, Cancelled> {
        let mut taken = Taken::default();
        let mut changes: Vec<Change> = Vec::new();
        for &t in faulty {
            let Some(corners) = self.mesh.get(t) else { continue };
            if fault(t, corners.map(|v| self.points[v as usize])) == Fault::None {
                continue;
            }
            let around: Vec<u32> = corners.iter().flat_map(|&v| self.mesh.around(v)).chain(corners).collect();
            if !taken.spares(&around) {
                continue;
            }
            let change = self.merge_any(corners, &fault, longest).or_else(|| self.flip_any(t, corners, &fault));
            let change = change.or_else(|| self.part_any(t, low, &fault));
            if let Some(change) = change {
                taken.add(&around);
                changes.push(change);
            }
        }
        let back = self.undo_meeting(&mut changes, observer)?;
        if changes.is_empty() {
            return Ok(Vec::new());
        }
        let changed = changes.iter().flat_map(Change::triangles);
        let next: BTreeSet<u32> = faulty.iter().copied().chain(changed).collect();
        Ok(next.difference(&back).copied().collect())
    }

    /// Takes back changes whose triangles meet others; returns the triangles of these.
    fn undo_meeting(&mut self, changes: &mut Vec<Change>, observer: &dyn Observer) -> Result<BTreeSet<u32>, Cancelled> {
        let mut undone = BTreeSet::new();
        while !changes.is_empty() {
            let left: Vec<u32> = (0..self.mesh.len()).filter(|&t| self.mesh.get(t).is_some()).collect();
            let triangles = left.iter().map(|&t| self.mesh.corners(t)).collect();
            let mesh = TriMesh { points: self.points.to_vec(), triangles, attributes: Vec::new() };
            let mut changed = vec![false; self.mesh.len() as usize];
            changes.iter().flat_map(Change::triangles).for_each(|t| changed[t as usize] = true);
            let meeting = intersections_of(&mesh, |t| changed[left[t as usize] as usize], observer)?;
            let meeting: BTreeSet<u32> = meeting.into_iter().flatten().map(|t| left[t as usize]).collect();
            let meets = |c: &Change| c.triangles().any(|t| meeting.contains(&t));
            let (back, stay): (Vec<Change>, Vec<Change>) = std::mem::take(changes).into_iter().partition(meets);
            *changes = stay;
            if back.is_empty() {
                break;
            }
            for change in back {
                undone.extend(change.triangles());
                self.mesh.undo(change);
            }
        }
        Ok(undone)
    }

    fn places(&self, corners: [u32; 3]) -> [DVec3; 3] {
        corners.map(|v| self.points[v as usize])
    }

    /// Merges a vertex of a triangle into another where that helps, over the shortest edge.
    fn merge_any(
        &mut self,
        [a, b, c]: [u32; 3],
        fault: &impl Fn(u32, [DVec3; 3]) -> Fault,
        longest: f64,
    ) -> Option<Change> {
        let mut ways: Vec<(f64, u32, u32)> = [(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)]
            .into_iter()
            .map(|(v, w)| (self.points[v as usize].distance(self.points[w as usize]), v, w))
            .filter(|way| way.0 <= longest)
            .collect();
        ways.sort_by(|x, y| x.0.total_cmp(&y.0).then((x.1, x.2).cmp(&(y.1, y.2))));
        let (_, v, w) = ways.into_iter().find(|&(_, v, w)| self.is_mergeable(v, w) && self.helps(v, w, fault))?;
        Some(self.mesh.collapse(v, w))
    }

    /// True if the mesh stays a manifold with its lines when `v` becomes `w`.
    fn is_mergeable(&self, v: u32, w: u32) -> bool {
        let (own, other) = (self.mesh.around(v), self.mesh.around(w));
        let is_inner = self.mesh.is_inner(v) && self.mesh.is_inner(w);
        let both: Vec<u32> = own.iter().copied().filter(|x| other.binary_search(x).is_ok()).collect();
        let beside: Vec<u32> = own.iter().copied().filter(|&x| self.mesh.is_line(v, x)).collect();
        let keeps_lines = match beside[..] {
            [] => self.kinds[v as usize] != FeatureKind::Corner,
            [a, b] => {
                // A line around a triangle that goes is led along its third edge, unless one runs there.
                let is_free = |x: &u32| !beside.contains(x) || !self.mesh.is_line(w, *x);
                let is_along = a == w || b == w;
                self.kinds[v as usize] != FeatureKind::Corner && is_along && both.iter().all(is_free)
            }
            _ => false,
        };
        // No vertex is left with three neighbours.
        is_inner && keeps_lines && own.len() + other.len() > 7 && self.mesh.is_collapsible(v, w)
    }

    /// True if there are fewer faults when `v` becomes `w`, nothing comes to be turned, and what is at fault still is no thinner.
    fn helps(&self, v: u32, w: u32, fault: &impl Fn(u32, [DVec3; 3]) -> Fault) -> bool {
        let (mut before, mut after) = (0, 0);
        for &t in self.mesh.star(v) {
            let corners = self.mesh.corners(t);
            let at = self.places(corners);
            let was = fault(t, at);
            before += was as usize;
            if corners.contains(&w) {
                continue;
            }
            let then = self.places(corners.map(|x| if x == v { w } else { x }));
            let left = fault(t, then);
            let is_thinner = shape(then) < KEPT_SHAPE * shape(at).min(GOOD_SHAPE);
            if (left == Fault::Turned && was != Fault::Turned) || is_thinner {
                return false;
            }
            after += left as usize;
        }
        after < before
    }

    /// Leads the line along an edge of a triangle by way of its tip where that is so near that it might as well lie on it, and
    /// flips the edge: the line is parted by the tip.
    /// * `low` - the greatest height of such a tip over its edge
    fn part_any(&mut self, t: u32, low: f64, fault: &impl Fn(u32, [DVec3; 3]) -> Fault) -> Option<Change> {
        for k in 0..3 {
            let corners = self.mesh.get(t)?;
            let [a, b, c] = [0, 1, 2].map(|i| corners[(k + i) % 3]);
            let [p, q, r] = self.places([a, b, c]);
            let e = q - p;
            let along = (r - p).dot(e) / e.length_squared();
            let is_tip = e.cross(r - p).length() < low * e.length() && (0.0..1.0).contains(&along);
            let on_line = self.mesh.star(c).iter().flat_map(|&s| self.mesh.corners(s)).any(|x| self.mesh.is_line(c, x));
            if !is_tip || on_line || !self.mesh.is_line(a, b) || self.kinds[c as usize] != FeatureKind::None {
                continue;
            }
            let Some(other) = self.mesh.beyond(t, [a, b]) else { continue };
            let d = self.mesh.corners(other).into_iter().find(|&x| x != a && x != b)?;
            let new = [[a, d, c], [d, b, c]].map(|corners| fault(other, self.places(corners)));
            if self.mesh.joined(c, d) || new.contains(&Fault::Turned) || !self.mesh.is_inner(c) {
                continue;
            }
            return self.mesh.part_line(t, k);
        }
        None
    }

    /// Flips an edge of `t = [a, b, c]` where that helps.
    fn flip_any(&mut self, t: u32, corners: [u32; 3], fault: &impl Fn(u32, [DVec3; 3]) -> Fault) -> Option<Change> {
        let flip = (0..3).filter_map(|k| self.mesh.flip_of(t, k)).find(|flip| {
            let [own, new] = flip.corners.map(|c| self.places(c));
            let [t, other] = flip.triangles;
            let was = [corners, self.mesh.corners(other)].map(|c| self.places(c));
            let faults = [fault(t, own), fault(other, new)];
            let before = fault(t, was[0]) as usize + fault(other, was[1]) as usize;
            let is_shaped = shape(own).min(shape(new)) >= shape(was[0]).min(shape(was[1])).min(GOOD_SHAPE);
            let is_better = faults.iter().map(|&f| f as usize).sum::<usize>() < before;
            let keeps_four = flip.edge.iter().all(|&v| self.mesh.around(v).len() >= 4);
            keeps_four && is_better && is_shaped && !faults.contains(&Fault::Turned)
        })?;
        Some(self.mesh.flip(&flip))
    }
}

/// Height over the longest edge.
fn shape([a, b, c]: [DVec3; 3]) -> f64 {
    let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    (b - a).cross(c - a).length() / longest.max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{FeatureTags, diagnose, self_intersections};
    use crate::synthetic::shapes;

    /// A sheet of 8 x 8 cells of size 1, whose middle vertex lies at `middle`.
    fn sheet(middle: DVec3) -> (TriMesh, u32) {
        let mut mesh = shapes::rectangle(8.0, 8.0, 8, 8);
        let center = mesh.bounds().center();
        let v = (0..mesh.points.len())
            .min_by(|&a, &b| mesh.points[a].distance(center).total_cmp(&mesh.points[b].distance(center)));
        let v = v.unwrap();
        mesh.points.iter_mut().for_each(|p| *p -= center);
        mesh.points[v] = middle;
        (mesh, v as u32)
    }

    fn merged(
        mesh: &TriMesh,
        lines: &[[u32; 2]],
        fault: impl Fn(u32, [DVec3; 3]) -> Fault,
    ) -> (TriMesh, Vec<[u32; 2]>) {
        let tags = FeatureTags::from_edges(mesh.points.len(), lines.iter().copied());
        let mut merging = Merging::new(mesh, &tags.vertices, &tags.edges);
        let mut faulty: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
        while !faulty.is_empty() {
            faulty = merging.round(&faulty, &fault, 2.0, 0.0, &crate::Silent).unwrap();
        }
        let lines = merging.mesh.lines.iter().copied().collect();
        let triangles = merging.mesh.into_triangles();
        (TriMesh { points: mesh.points.clone(), triangles, attributes: Vec::new() }, lines)
    }

    fn cramped(_: u32, [a, b, c]: [DVec3; 3]) -> Fault {
        let least = a.distance(b).min(b.distance(c)).min(c.distance(a));
        if least < 0.3 { Fault::Cramped } else { Fault::None }
    }

    #[test]
    fn a_vertex_too_near_to_another_becomes_that_and_the_sheet_stays_whole() {
        let (mesh, _) = sheet(DVec3::new(0.9, 0.0, 0.0));
        let (got, _) = merged(&mesh, &[], cramped);
        assert_eq!(got.triangles.len(), mesh.triangles.len() - 2);
        let (was, now) = (diagnose(&mesh), diagnose(&got));
        assert_eq!((now.boundary_loops, now.components), (was.boundary_loops, was.components));
        let area: f64 = (0..got.triangles.len()).map(|t| got.area(t)).sum();
        assert!((area - 64.0).abs() < 1e-9);
    }

    #[test]
    fn a_vertex_on_a_line_is_merged_along_it_alone() {
        let (mesh, v) = sheet(DVec3::new(0.9, 0.0, 0.0));
        let at = |p: DVec3| mesh.points.iter().position(|q| q.distance(p) < 1e-9).unwrap() as u32;
        // A line from the left to the right goes on through the vertex beside it; one from below to above stays at its place.
        let along = [[at(DVec3::new(-1.0, 0.0, 0.0)), v], [v, at(DVec3::new(1.0, 0.0, 0.0))]];
        let sorted = |e: &[[u32; 2]]| e.iter().map(|e| [e[0].min(e[1]), e[0].max(e[1])]).collect::<Vec<_>>();
        let (got, lines) = merged(&mesh, &sorted(&along), cramped);
        assert_eq!((got.triangles.len(), lines.len()), (mesh.triangles.len() - 2, 1));
        let across = sorted(&[[at(DVec3::new(0.0, -1.0, 0.0)), v], [v, at(DVec3::new(0.0, 1.0, 0.0))]]);
        let (_, lines) = merged(&mesh, &across, cramped);
        let mut was = across;
        was.sort_unstable();
        assert_eq!(lines, was);
    }

    #[test]
    fn what_would_meet_another_triangle_is_taken_back() {
        let (mut mesh, _) = sheet(DVec3::new(0.0, 0.0, 0.9));
        // Only the tip itself may go: what comes to it in place of a neighbour is too long.
        let flat = |_: u32, t: [DVec3; 3]| {
            let longest = (0..3).map(|k| t[k].distance(t[(k + 1) % 3])).fold(0.0, f64::max);
            match t.iter().any(|p| p.z > 0.5) {
                true if longest > 1.9 => Fault::Turned,
                true => Fault::Cramped,
                false => Fault::None,
            }
        };
        let is_high = |mesh: &TriMesh| (0..mesh.triangles.len()).any(|t| mesh.corners(t).iter().any(|p| p.z > 0.5));
        assert!(!is_high(&merged(&mesh, &[], flat).0));
        // Under the tent a triangle stands that reaches through the level of the sheet.
        let first = mesh.points.len() as u32;
        mesh.points.extend([(-0.05, -0.1), (0.05, -0.1), (0.0, 0.3)].map(|(x, z)| DVec3::new(x, 0.02, z)));
        mesh.triangles.push([first, first + 1, first + 2]);
        let (got, _) = merged(&mesh, &[], flat);
        assert!(is_high(&got));
        assert!(self_intersections(&got).is_empty());
    }
}
