//! Fans: within a small disk around a node its arcs are drawn anew, so that they leave it at even angles and without hooks.
//!
//! Lines that are straight in the map of large cells can turn anywhere near its corners, where the map is that of single
//! triangles. The disk is mapped to a circle; from even angles at the node the arcs go over smoothly to where they leave
//! the disk. Angles keep their order all the way, so arcs do not cross. See `docs/methods/layout.md`, step 8.

use super::complex::Complex;
use super::improve::star_change;
use super::recut::{Bench, Embedding, tighten};
use crate::geom::graph::Search;
use crate::geom::polyline;
use crate::mesh::NONE;
use crate::mesh::disjoint::disjoint;
use crate::network::disk::Disk;
use crate::network::imprint::Place;
use glam::DVec2;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// Radii of the disks that are tried, in parts of the shortest arc at the node: disks of neighbours stay apart.
const FAN_RADII: [f64; 3] = [0.3, 0.2, 0.12];

/// Fewest faces of a disk: with less than three rings of them there is no smooth way to turn.
const FEWEST_FAN_FACES: usize = 60;

/// How far from where it leaves the disk an arc may leave its node, radians.
const GREATEST_TURN: f64 = 0.9;

/// Parts of the radius at which the way of an arc is given.
const FAN_STOPS: [f64; 4] = [0.2, 0.4, 0.6, 0.8];

/// New chains of the half-arcs at a node, from the node.
type Fan = Vec<(u32, Vec<Place>)>;

/// Spreads the arcs of every node away from lines and boundaries. Where that cannot be drawn they stay as they are.
pub(super) fn spread(bench: &mut Bench) {
    let mut waiting: Vec<Vec<u32>> =
        bench.complex.stars().into_iter().filter(|star| star_change(&bench.complex, star).is_some()).collect();
    while !waiting.is_empty() {
        let arcs = |star: &Vec<u32>| star.iter().map(|h| h / 2).collect();
        let (now, later) = disjoint(waiting, arcs, Some);
        let fans: Vec<Fan> = now.par_iter().filter_map(|star| fan(bench, star)).collect();
        bench.commit(fans, put);
        waiting = later;
    }
}

/// Puts the chains of a fan into the complex; returns the arcs.
fn put(complex: &mut Complex, fan: &Fan) -> Vec<u32> {
    for (h, chain) in fan {
        let mut chain = chain.clone();
        if h % 2 == 1 {
            chain.reverse();
        }
        complex.arcs[*h as usize / 2].as_mut().expect("a live arc").chain = chain;
    }
    fan.iter().map(|x| x.0 / 2).collect()
}

/// The half-arcs of `star` drawn anew near their node.
fn fan(bench: &Bench, star: &[u32]) -> Option<Fan> {
    let embedding = &bench.embedding;
    let length =
        |chain: &[u32]| -> f64 { polyline::length(chain.iter().map(|&v| embedding.cut.mesh.points[v as usize])) };
    let chains: Vec<Vec<u32>> = star.iter().map(|&h| embedding.chain(h)).collect();
    let shortest = chains.iter().map(|c| length(c)).fold(f64::INFINITY, f64::min);
    FAN_RADII.into_iter().find_map(|part| within(bench, star, &chains, part * shortest))
}

/// The same within a disk of `radius`.
fn within(bench: &Bench, star: &[u32], chains: &[Vec<u32>], radius: f64) -> Option<Fan> {
    let embedding = &bench.embedding;
    let disk = disc(embedding, star, chains[0][0], radius)?;
    let local: BTreeMap<u32, u32> = disk.vertices.iter().enumerate().map(|(i, &v)| (v, i as u32)).collect();
    let mut rim = vec![NONE; disk.vertices.len()];
    disk.boundary.iter().enumerate().for_each(|(i, &v)| rim[v as usize] = i as u32);
    let center = *local.get(&chains[0][0])?;
    // Where each arc leaves the disk for good: its boundary is ragged.
    let exits: Vec<usize> =
        chains.iter().map(|chain| chain.iter().rposition(|v| local.contains_key(v))).collect::<Option<Vec<_>>>()?;
    let on_rim = |v: u32| rim[local[&v] as usize] != NONE;
    if on_rim(chains[0][0]) || chains.iter().zip(&exits).any(|(chain, &exit)| !on_rim(chain[exit])) {
        return None;
    }
    let at = |v: u32| embedding.cut.mesh.points[disk.vertices[v as usize] as usize];
    let n = disk.boundary.len();
    let step: Vec<f64> = (0..n).map(|i| at(disk.boundary[i]).distance(at(disk.boundary[(i + 1) % n]))).collect();
    let total: f64 = step.iter().sum();
    let mut angles = Vec::with_capacity(n);
    let mut run = 0.0;
    for s in step {
        angles.push(TAU * run / total);
        run += s;
    }
    let uv = disk.circle_map(&embedding.cut.mesh.points, &angles)?;
    let middle = uv[center as usize];
    let ends: Vec<u32> = chains.iter().zip(&exits).map(|(chain, &exit)| local[&chain[exit]]).collect();
    let rays: Vec<DVec2> = ends.iter().map(|&v| uv[v as usize] - middle).collect();
    let turns = turns(&rays)?;
    let mut fan = Fan::new();
    for (k, &h) in star.iter().enumerate() {
        let way = |part: f64| {
            let smooth = part * part * (3.0 - 2.0 * part);
            middle + DVec2::from_angle(turns[k] * (1.0 - smooth)).rotate(rays[k]) * part
        };
        let mut chain =
            embedding.polyline((bench.mesh, bench.adjacency), (&disk, &uv), [center, ends[k]], &FAN_STOPS.map(way))?;
        let rest = &chains[k][exits[k] + 1..];
        chain.extend(rest.iter().map(|&v| embedding.cut.origin[v as usize]));
        if chain.iter().any(|p| matches!(p, Place::Face(_))) {
            return None;
        }
        fan.push((h, tighten(bench.mesh, bench.adjacency, chain)));
    }
    Some(fan)
}

/// The disk around a node: `None` if it is none, or other arcs than those of `star` run in it.
fn disc(embedding: &Embedding, star: &[u32], node: u32, radius: f64) -> Option<Disk> {
    let (cut, adjacency) = (&embedding.cut, &embedding.adjacency);
    let mut search = Search::sparse();
    search.reach(node, 0.0, NONE);
    while let Some((v, d)) = search.settle() {
        for h in adjacency.fan(v) {
            let t = cut.mesh.triangles[h as usize / 3];
            for w in t.into_iter().filter(|&w| w != v) {
                let e = d + cut.mesh.points[v as usize].distance(cut.mesh.points[w as usize]);
                if e <= radius {
                    search.reach(w, e, v);
                }
            }
        }
    }
    let near = search.reached;
    let whole = |f: &u32| cut.mesh.triangles[*f as usize].iter().all(|v| near.contains_key(v));
    let mut faces: Vec<u32> = near.keys().flat_map(|&v| adjacency.fan(v).map(|h| h / 3)).filter(whole).collect();
    faces.sort_unstable();
    faces.dedup();
    if faces.len() < FEWEST_FAN_FACES {
        return None;
    }
    let inside = |h: u32| {
        let o = adjacency.opposite[h as usize];
        o != NONE && faces.binary_search(&(o / 3)).is_ok()
    };
    let halves = || faces.iter().flat_map(|f| 3 * f..3 * f + 3);
    let foreign = |h: u32| {
        let a = embedding.half_arc[h as usize];
        a != NONE && !star.iter().any(|s| s / 2 == a / 2)
    };
    if halves().any(|h| inside(h) && foreign(h)) {
        return None;
    }
    let start = halves().find(|&h| !inside(h))?;
    Disk::new(&cut.mesh.triangles, adjacency, &faces, |h| !inside(h), start)
}

/// How far each ray of a counter-clockwise star turns to be even with the others. `None` if they are not in order.
fn turns(rays: &[DVec2]) -> Option<Vec<f64>> {
    let n = rays.len();
    let sector = |k: usize| rays[k].angle_to(rays[(k + 1) % n]).rem_euclid(TAU);
    if ((0..n).map(sector).sum::<f64>() - TAU).abs() > 1e-6 {
        return None;
    }
    // Each ray's own angle less its even one, from the first ray on.
    let mut off = Vec::with_capacity(n);
    let mut angle = 0.0;
    for k in 0..n {
        off.push(TAU * k as f64 / n as f64 - angle);
        angle += sector(k);
    }
    let mean = off.iter().sum::<f64>() / n as f64;
    let most = off.iter().map(|x| (x - mean).abs()).fold(0.0, f64::max);
    // All by the same part, so that their order stays.
    let share = (GREATEST_TURN / most.max(f64::MIN_POSITIVE)).min(1.0);
    (most < PI).then(|| off.into_iter().map(|x| (x - mean) * share).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_at_20_and_160_degrees_turn_towards_even_sectors_and_keep_their_order() {
        let angles = [0.0f64, 20.0, 180.0, 200.0];
        let rays: Vec<DVec2> = angles.iter().map(|a| DVec2::from_angle(a.to_radians())).collect();
        let turned: Vec<f64> =
            turns(&rays).expect("in order").iter().zip(angles).map(|(t, a)| a + t.to_degrees()).collect();
        for (k, pair) in turned.windows(2).enumerate() {
            assert!((pair[1] - pair[0] - 90.0).abs() < 1e-9, "sector {k}: {turned:?}");
        }
        let swapped = [rays[1], rays[0], rays[2], rays[3]];
        assert_eq!(turns(&swapped), None);
    }
}
