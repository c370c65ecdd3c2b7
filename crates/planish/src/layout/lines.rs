//! Fixed lines: the sharp edges that bound patches.
//!
//! An edge of a machined part is sharp at every scale; a wrinkle, a scale or a scanner's noise is sharp from one
//! face to the next and flat a few faces further out. So an edge has to be sharp twice: between its two faces,
//! and between the mean normals of the surface to its left and right. See `docs/methods/layout.md`, step 1.

use super::LayoutParams;
use super::proxy::EQUILATERAL;
use crate::mesh::sets::Sets;
use crate::mesh::{Adjacency, NONE, TriMesh, next, sharp_edges};
use crate::observe::{Cancelled, Observer};
use crate::sharp::{Fineness, bridge_gaps, cut_spikes};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// How far the mean normals reach, in edges of the mesh around. Weights fall to 0 there, so they come from half as far in the mean,
/// as from two thirds of four edges where all count alike; four edges are chosen. Nor do they reach farther than the shortest line
/// that counts is long.
const NORMAL_REACH_EDGES: f64 = 16.0 / 3.0;

/// Parts of faces are no longer than this part of the reach; chosen: the volume of a cone is found within a fiftieth.
const PART_TO_REACH: f64 = 0.25;

/// The angle between the mean normals, against the angle asked for between the faces: the surfaces beside an
/// edge may bend away from it.
const WIDE_ANGLE: f64 = 0.75;

/// A line without loose ends is kept from this part of the length asked for: a closed line is rarely an accident.
const CLOSED_SHARE: f64 = 0.5;

/// A spike of a line ([`cut_spikes`]) is shorter around than this part of the length asked for.
const SPIKE_SHARE: f64 = 0.25;

/// Marks the half-edges on sharp edges that belong to a line worth keeping; gaps of lines are bridged.
/// Noise makes short lines with loose ends and small meshes of lines; a part's edges close or meet others.
/// * `tagged` - the half-edges that are sharp, where somebody knows; else the angles tell
pub(super) fn feature_lines(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    tagged: &[bool],
    params: &LayoutParams,
    observer: &dyn Observer,
) -> Result<Vec<bool>, Cancelled> {
    let shortest = params.feature_length * mesh.bounds().diagonal();
    if tagged.contains(&true) {
        let inner = |h: usize| adjacency.opposite[h] != NONE;
        let mut kept: Vec<bool> = tagged.iter().enumerate().map(|(h, &t)| t && inner(h)).collect();
        drop_detail((mesh, adjacency), Fineness::OfMesh, shortest, &mut kept, observer)?;
        return Ok(kept);
    }
    let sharp = sharp_edges(mesh, adjacency, params.sharp_angle_deg);
    let least = (WIDE_ANGLE * params.sharp_angle_deg).to_radians().cos();
    let mut kept: Vec<bool> = (0..sharp.len() as u32)
        .into_par_iter()
        .map(|h| {
            let o = adjacency.opposite[h as usize];
            if !sharp[h as usize] || o < h {
                return false;
            }
            let reach = shortest.min(NORMAL_REACH_EDGES * edge_around(mesh, adjacency, h));
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
    drop_detail((mesh, adjacency), Fineness::OfLine, shortest, &mut kept, observer)?;
    Ok(kept)
}

/// How long edges are around half-edge `h`, whatever the shape of the faces: as in equal-sided triangles with the mean area of those
/// at its ends.
fn edge_around(mesh: &TriMesh, adjacency: &Adjacency, h: u32) -> f64 {
    let around = [mesh.origin(h), mesh.origin(next(h))].into_iter().flat_map(|v| adjacency.fan(v));
    let (sum, count) = around.fold((0.0, 0.0), |(sum, count), g| (sum + mesh.area(g as usize / 3), count + 1.0));
    (sum / count / EQUILATERAL).sqrt()
}

/// Mean unit normal of the surface to the left of sharp half-edge `h`, up to the next sharp edge; of its face, if `reach` is 0.
/// The weight of a place falls from the middle of the edge to 0 at `reach`.
fn mean_normal(mesh: &TriMesh, adjacency: &Adjacency, sharp: &[bool], h: u32, reach: f64) -> DVec3 {
    let face = h / 3;
    if reach == 0.0 {
        return mesh.normal(face as usize);
    }
    let (a, b) = (mesh.points[mesh.origin(h) as usize], mesh.points[mesh.origin(next(h)) as usize]);
    let middle = a.midpoint(b);
    let inward = mesh.normal(face as usize).cross(b - a);
    let weight = |p: DVec3| {
        let out = p - middle;
        if out.dot(inward) > 0.0 { (1.0 - out.length() / reach).max(0.0) } else { 0.0 }
    };
    let mut seen = vec![face];
    let mut sum = DVec3::ZERO;
    let mut at = 0;
    while at < seen.len() {
        let f = seen[at];
        at += 1;
        let part = mean_weight(mesh.corners(f as usize), middle, reach, &weight);
        if part == 0.0 {
            continue;
        }
        sum += mesh.area_vector(f as usize) * part;
        for g in 3 * f..3 * f + 3 {
            let o = adjacency.opposite[g as usize];
            if o != NONE && !sharp[g as usize] && !seen.contains(&(o / 3)) {
                seen.push(o / 3);
            }
        }
    }
    sum.normalize_or_zero()
}

/// Mean of a weight over a triangle, which is parted until it is small against the distance `reach` from `center`, beyond which
/// the weight is 0.
fn mean_weight(corners: [DVec3; 3], center: DVec3, reach: f64, weight: &impl Fn(DVec3) -> f64) -> f64 {
    let lengths = [0, 1, 2].map(|k| corners[k].distance(corners[(k + 1) % 3]));
    let longest = (0..3).max_by(|&i, &j| lengths[i].total_cmp(&lengths[j])).unwrap_or(0);
    let mean = corners.into_iter().sum::<DVec3>() / 3.0;
    if lengths[longest] <= PART_TO_REACH * reach {
        return weight(mean);
    }
    // No corner is farther from the mean than the longest side.
    if mean.distance(center) > reach + lengths[longest] {
        return 0.0;
    }
    let [p, q, r] = [0, 1, 2].map(|k| corners[(longest + k) % 3]);
    let middle = p.midpoint(q);
    let halves = [[p, middle, r], [middle, q, r]];
    halves.into_iter().map(|half| mean_weight(half, center, reach, weight)).sum::<f64>() / 2.0
}

/// Bridges gaps of lines, and clears what is surface detail: lines with a loose end that are shorter than `shortest`, the
/// lines around regions smaller than a circle of half that length around, spikes a quarter of it around, and connected
/// lines shorter than half of it together.
fn drop_detail(
    (mesh, adjacency): (&TriMesh, &Adjacency),
    fineness: Fineness,
    shortest: f64,
    sharp: &mut [bool],
    observer: &dyn Observer,
) -> Result<(), Cancelled> {
    let around = CLOSED_SHARE * shortest;
    let smallest = around * around / (4.0 * std::f64::consts::PI);
    bridge_gaps(mesh, adjacency, fineness, sharp, observer)?;
    observer.check()?;
    cut_spikes(mesh, adjacency, SPIKE_SHARE * shortest, sharp);
    while drop_loose(mesh, adjacency, shortest, sharp) | drop_regions(mesh, adjacency, smallest, sharp) {}
    drop_short(mesh, adjacency, around, sharp);
    Ok(())
}

fn clear(adjacency: &Adjacency, sharp: &mut [bool], h: u32) {
    sharp[h as usize] = false;
    sharp[adjacency.opposite[h as usize] as usize] = false;
}

/// Clears lines with a loose end, the shortest first: what is left of a fork is one longer line. True if there were
/// any. An end on the boundary of the mesh is not loose.
fn drop_loose(mesh: &TriMesh, adjacency: &Adjacency, shortest: f64, sharp: &mut [bool]) -> bool {
    let mut dropped = false;
    loop {
        let mut around: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for h in (0..sharp.len() as u32).filter(|&h| sharp[h as usize]) {
            around.entry(mesh.origin(h)).or_default().push(h);
        }
        let mut lines: Vec<(f64, Vec<u32>, u32)> = Vec::new();
        for (&v, out) in &around {
            if out.len() != 1 || adjacency.is_boundary_vertex(v) {
                continue;
            }
            let (mut line, mut end) = (vec![out[0]], mesh.origin(next(out[0])));
            while let [a, b] = around[&end][..]
                && !adjacency.is_boundary_vertex(end)
            {
                let back = adjacency.opposite[line[line.len() - 1] as usize];
                line.push(if a == back { b } else { a });
                end = mesh.origin(next(line[line.len() - 1]));
            }
            let total = line.iter().map(|&h| mesh.edge_length(h)).sum();
            if total < shortest {
                lines.push((total, line, end));
            }
        }
        lines.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
        let mut changed: BTreeSet<u32> = BTreeSet::new();
        for (_, line, end) in &lines {
            if changed.insert(*end) {
                line.iter().for_each(|&h| clear(adjacency, sharp, h));
            }
        }
        if lines.is_empty() {
            return dropped;
        }
        dropped = true;
    }
}

/// Joins every region between lines that is smaller than `smallest` to the neighbour it shares most of its boundary with.
/// True if there were any.
fn drop_regions(mesh: &TriMesh, adjacency: &Adjacency, smallest: f64, sharp: &mut [bool]) -> bool {
    let faces = mesh.triangles.len();
    let mut sets = Sets::new(faces);
    for h in 0..sharp.len() as u32 {
        let o = adjacency.opposite[h as usize];
        if o != NONE && !sharp[h as usize] {
            sets.join(h / 3, o / 3);
        }
    }
    let root: Vec<u32> = (0..faces as u32).map(|f| sets.root(f)).collect();
    let mut area = vec![0.0; faces];
    for f in 0..faces {
        area[root[f] as usize] += mesh.area(f);
    }
    let mut rims: BTreeMap<u32, BTreeMap<u32, (f64, Vec<u32>)>> = BTreeMap::new();
    for h in (0..sharp.len() as u32).filter(|&h| sharp[h as usize]) {
        let (own, other) = (root[h as usize / 3], root[adjacency.opposite[h as usize] as usize / 3]);
        if own != other && area[own as usize] < smallest {
            let rim = rims.entry(own).or_default().entry(other).or_default();
            rim.0 += mesh.edge_length(h);
            rim.1.push(h);
        }
    }
    for neighbours in rims.values() {
        let longest = neighbours.iter().max_by(|a, b| a.1.0.total_cmp(&b.1.0).then(b.0.cmp(a.0)));
        let (_, (_, rim)) = longest.expect("a rim has another side");
        rim.iter().for_each(|&h| clear(adjacency, sharp, h));
    }
    !rims.is_empty()
}

/// Clears connected lines shorter together than `shortest`.
fn drop_short(mesh: &TriMesh, adjacency: &Adjacency, shortest: f64, sharp: &mut [bool]) {
    let edges: Vec<u32> =
        (0..sharp.len() as u32).filter(|&h| sharp[h as usize] && h < adjacency.opposite[h as usize]).collect();
    let mut sets = Sets::new(mesh.points.len());
    for &h in &edges {
        sets.join(mesh.origin(h), mesh.origin(next(h)));
    }
    let mut total = vec![0.0; mesh.points.len()];
    for &h in &edges {
        total[sets.root(mesh.origin(h)) as usize] += mesh.edge_length(h);
    }
    for &h in &edges {
        if total[sets.root(mesh.origin(h)) as usize] < shortest {
            clear(adjacency, sharp, h);
        }
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::synthetic::shapes;

    /// Marks the edges along a chain of places of a sheet.
    pub fn mark(mesh: &TriMesh, adjacency: &Adjacency, sharp: &mut [bool], places: &[(f64, f64)]) {
        let near = |p: &DVec3, q: (f64, f64)| p.truncate().distance(glam::DVec2::new(q.0, q.1)) < 1e-9;
        let vertex = |q| mesh.points.iter().position(|p| near(p, q)).expect("a vertex there") as u32;
        for w in places.windows(2) {
            let (a, b) = (vertex(w[0]), vertex(w[1]));
            for h in 0..sharp.len() as u32 {
                let ends = (mesh.origin(h), mesh.origin(next(h)));
                sharp[h as usize] |= (ends == (a, b) || ends == (b, a)) && adjacency.opposite[h as usize] != NONE;
            }
        }
    }

    #[test]
    fn the_mean_weight_of_a_triangle_around_the_center_is_that_of_a_cone() {
        // A cone of height 1 over the unit disk has a third of the volume of a cylinder.
        let corners = [DVec3::new(-20.0, -10.0, 0.0), DVec3::new(20.0, -10.0, 0.0), DVec3::new(0.0, 30.0, 0.0)];
        let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length() / 2.0;
        let mean = mean_weight(corners, DVec3::ZERO, 1.0, &|p: DVec3| (1.0 - p.length()).max(0.0));
        assert!((mean * area / (std::f64::consts::PI / 3.0) - 1.0).abs() < 0.02, "{}", mean * area);
    }

    #[test]
    fn loose_lines_need_their_length_and_closed_ones_half_of_it() {
        let mesh = shapes::rectangle(1.0, 1.0, 10, 10);
        let corner = mesh.bounds().min;
        let at = |i: usize, j: usize| (corner.x + i as f64 / 10.0, corner.y + j as f64 / 10.0);
        let adjacency = Adjacency::new(&mesh);
        for (places, shortest, kept) in [
            ((2..=5).map(|i| at(i, 5)).collect::<Vec<_>>(), 0.4, 0),
            ((2..=8).map(|i| at(i, 5)).collect(), 0.4, 6),
            // From the boundary to nowhere, and from boundary to boundary.
            ((0..=3).map(|i| at(i, 5)).collect(), 0.4, 0),
            ((0..=10).map(|i| at(i, 5)).collect(), 0.4, 10),
            (vec![at(4, 4), at(5, 4), at(5, 5), at(4, 5), at(4, 4)], 1.0, 0),
            (vec![at(3, 3), at(4, 3), at(5, 3), at(5, 4), at(5, 5), at(4, 5), at(3, 5), at(3, 4), at(3, 3)], 1.0, 8),
        ] {
            let mut sharp = vec![false; adjacency.opposite.len()];
            mark(&mesh, &adjacency, &mut sharp, &places);
            drop_detail((&mesh, &adjacency), Fineness::OfLine, shortest, &mut sharp, &crate::Silent).unwrap();
            assert_eq!(sharp.iter().filter(|&&s| s).count() / 2, kept, "{places:?}");
        }
    }

    #[test]
    fn a_line_that_spikes_around_a_face_of_0_34_is_led_straight_if_that_is_less_than_asked_for() {
        let mesh = shapes::rectangle(1.0, 1.0, 10, 10);
        let corner = mesh.bounds().min;
        let at = |i: usize, j: usize| (corner.x + i as f64 / 10.0, corner.y + j as f64 / 10.0);
        let adjacency = Adjacency::new(&mesh);
        let places =
            [(0..=3).map(|i| at(i, 5)).collect(), vec![at(4, 6)], (4..=10).map(|i| at(i, 5)).collect()].concat();
        for (longest, kept) in [(0.33, 11), (0.35, 10)] {
            let mut sharp = vec![false; adjacency.opposite.len()];
            mark(&mesh, &adjacency, &mut sharp, &places);
            assert_eq!(sharp.iter().filter(|&&s| s).count() / 2, 11);
            cut_spikes(&mesh, &adjacency, longest, &mut sharp);
            assert_eq!(sharp.iter().filter(|&&s| s).count() / 2, kept);
        }
    }
}
