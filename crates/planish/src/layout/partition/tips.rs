//! Tips of limbs: places where a patch would have to swallow a whole finger, unless a node stands there.
//!
//! Around a tip the surface has far less area than a plane has within the same distance. Candidates with a small
//! disk climb to the place furthest from the boundary of their disk; a boundary in two pieces belongs to the middle of a
//! limb, not to its end. See `docs/methods/layout.md`, step 4.

use super::Ground;
use crate::geom::graph::Search;
use crate::layout::fill::{Gain, Scale};
use crate::layout::recut::{Bench, Change};
use crate::mesh::NONE;
use crate::mesh::disjoint::disjoint;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Radii of the disks, in sides of a patch: fingers and limbs.
const TIP_RADII: [f64; 2] = [0.5, 1.0];

/// Greatest area of a disk, against the flat one of its radius: that of a cone with an angle of 70 degrees.
const SLENDER: f64 = 0.55;

/// The outer part of the disk that is its boundary.
const RIM_SHARE: f64 = 0.8;

/// Candidates lie this far apart, in radii, and tips that far: a blunt end has one.
const CANDIDATES_APART: f64 = 0.3;
const TIPS_APART: f64 = 0.8;

/// Vertices whose distance from the boundary is this little less than the greatest are equally far out.
const END: f64 = 0.1;

/// Steps of climbing; two reach the end of any limb within the disk.
const CLIMBS: usize = 3;

/// Vertices with their distances from a start, in rising order.
type Disc = Vec<(u32, f64)>;

/// The vertices within `radius` of `starts` along edges, nearest first. `inside`, if given, bounds the search.
fn disc(ground: &Ground, starts: &[u32], radius: f64, inside: Option<&BTreeMap<u32, f64>>) -> Disc {
    let mut search = Search::sparse();
    starts.iter().for_each(|&v| search.reach(v, 0.0, NONE));
    let mut found = Disc::new();
    while let Some((v, d)) = search.settle() {
        found.push((v, d));
        for w in ground.around(v) {
            let e = d + ground.mesh.points[v as usize].distance(ground.mesh.points[w as usize]);
            if e <= radius && inside.is_none_or(|set| set.contains_key(&w)) {
                search.reach(w, e, v);
            }
        }
    }
    found
}

/// Area of a disk over that of the flat one; `None` if it meets a fixed line or its boundary is in several pieces.
fn slenderness(ground: &Ground, disc: &Disc, radius: f64) -> Option<f64> {
    if disc.iter().any(|&(v, _)| ground.is_fixed(v)) {
        return None;
    }
    let area: f64 = disc.iter().map(|&(v, _)| ground.share(v)).sum();
    let rim: BTreeMap<u32, f64> = disc.iter().filter(|x| x.1 > RIM_SHARE * radius).copied().collect();
    let (&first, _) = rim.first_key_value()?;
    let whole = super::tips::disc(ground, &[first], f64::INFINITY, Some(&rim)).len() == rim.len();
    whole.then_some(area / (std::f64::consts::PI * radius * radius))
}

/// The tip that `start` climbs to, with its slenderness.
fn climb(ground: &Ground, start: u32, radius: f64) -> Option<(f64, u32)> {
    let mut at = start;
    for _ in 0..CLIMBS {
        let around = disc(ground, &[at], radius, None);
        if slenderness(ground, &around, radius)? > SLENDER {
            return None;
        }
        let rim: Vec<u32> = around.iter().filter(|x| x.1 > RIM_SHARE * radius).map(|x| x.0).collect();
        let inside: BTreeMap<u32, f64> = around.into_iter().collect();
        let end = end(ground, &disc(ground, &rim, f64::INFINITY, Some(&inside)))?;
        if end == at {
            break;
        }
        at = end;
    }
    let ratio = slenderness(ground, &disc(ground, &[at], radius, None), radius)?;
    (ratio < SLENDER).then_some((ratio, at))
}

/// The middle of the vertices furthest out in a search: lengths along edges do not tell them apart.
fn end(ground: &Ground, found: &Disc) -> Option<u32> {
    let furthest = found.last()?.1;
    let at = |v: u32| ground.mesh.points[v as usize];
    let far: Vec<u32> = found.iter().filter(|x| x.1 >= (1.0 - END) * furthest).map(|x| x.0).collect();
    let mean = far.iter().map(|&v| at(v)).sum::<DVec3>() / far.len() as f64;
    let nearer =
        |a: &u32, b: &u32| at(*a).distance_squared(mean).total_cmp(&at(*b).distance_squared(mean)).then(a.cmp(b));
    far.into_iter().min_by(nearer)
}

/// Tips of limbs, the most slender first; `side` is that of a patch.
pub(in crate::layout) fn tips(ground: &Ground, side: f64) -> Vec<u32> {
    let mut tips: Vec<u32> = Vec::new();
    for radius in TIP_RADII.map(|r| r * side) {
        let mut covered = vec![false; ground.mesh.points.len()];
        let mut starts = Vec::new();
        for v in 0..covered.len() as u32 {
            if !covered[v as usize] {
                starts.push(v);
                disc(ground, &[v], CANDIDATES_APART * radius, None)
                    .into_iter()
                    .for_each(|(w, _)| covered[w as usize] = true);
            }
        }
        let mut found: Vec<(f64, u32)> = starts.into_par_iter().filter_map(|v| climb(ground, v, radius)).collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, v) in found {
            if !disc(ground, &[v], TIPS_APART * radius, None).iter().any(|(w, _)| tips.contains(w)) {
                tips.push(v);
            }
        }
    }
    tips
}

/// Puts a node on every tip: the nearest one moves there, or a new one is made, whichever leaves better cells.
pub(in crate::layout) fn plant(bench: &mut Bench, tips: &[u32], patches: usize) {
    let mut waiting = tips.to_vec();
    while !waiting.is_empty() {
        let scale = Scale::new(bench, patches);
        let best: Vec<Option<Gain>> = waiting.par_iter().map(|&tip| best(bench, &scale, tip)).collect();
        let planned = waiting.into_iter().zip(best).filter_map(|(tip, best)| Some((tip, best?.1)));
        let (now, later) = disjoint(planned, |(_, change)| change.cells.clone(), |(_, change)| Some(change));
        bench.apply(&now);
        waiting = later.into_iter().map(|x| x.0).collect();
    }
}

/// The best change that puts a node on vertex `tip`.
fn best(bench: &Bench, scale: &Scale, tip: u32) -> Option<Gain> {
    let complex = &bench.complex;
    let cells = bench.embedding.cells_at(tip);
    let mut unions: Vec<Change> = Vec::new();
    for &h in cells.iter().flat_map(|&c| complex.loop_of(c)) {
        let node = complex.from(h);
        let star =
            crate::layout::improve::star_change(complex, &complex.star(node)).filter(|change| change.pin.is_none());
        unions.extend(star);
        let arc = complex.arc(h);
        if arc.kind.is_smooth() && arc.cells[0] != arc.cells[1] {
            unions.push(Change { cells: arc.cells.to_vec(), removed: vec![h / 2], ..Change::default() });
        }
    }
    // Only a union that has the tip inside can have a node there.
    unions.retain(|change| cells.iter().all(|c| change.cells.contains(c)));
    let found = unions.into_iter().filter_map(|change| scale.best(&Change { pin: Some(tip), stays: true, ..change }));
    found.max_by(|a, b| a.0.total_cmp(&b.0).then_with(|| b.1.cells.cmp(&a.1.cells)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Adjacency, TriMesh};
    use crate::synthetic::shapes;

    fn tips_of(mesh: &TriMesh, side: f64) -> Vec<u32> {
        let adjacency = Adjacency::new(mesh);
        let sharp = vec![false; adjacency.opposite.len()];
        tips(&Ground::new(mesh, &adjacency, &sharp), side)
    }

    #[test]
    fn a_finger_of_four_radii_has_one_tip_within_0_7_radii_of_its_end() {
        let mesh = shapes::snout(4.0, 4000);
        let found = tips_of(&mesh, 4.0);
        assert_eq!(found.len(), 1);
        let end = mesh.points.iter().copied().max_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
        let off = mesh.points[found[0] as usize].distance(end);
        assert!(off < 0.7, "{off} at {}", mesh.points[found[0] as usize]);
    }

    #[test]
    fn spheres_and_tori_wider_than_a_patch_have_no_tips() {
        assert!(tips_of(&shapes::sphere(1.0, 4), 0.5).is_empty());
        assert!(tips_of(&shapes::torus(1.0, 0.4, 60, 30), 0.5).is_empty());
    }
}
