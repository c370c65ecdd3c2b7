//! Thinning a flat surface out to its cones and the corners of its lines.
//!
//! After Coudert-Osmont, Desobry, Heistermann, Bommes, Ray, Sokolov 2024, *Quad Mesh
//! Quantization Without a T-Mesh*, §4. Where the paper collapses edges, a vertex here is taken out and the hole is
//! triangulated anew as well as can be: in a surface that may be glued to itself this always works but at the last
//! vertex of a line or a torus, and where a sliver would be left.

use super::flat::{FLIPPED, Flat, Patch, quality};
use crate::mesh::{NONE, next, previous};
use crate::observe::{Cancelled, Observer};
use glam::DVec2;
use std::f64::consts::FRAC_PI_2;

/// Least area of a new triangle against the square of its longest edge (an equilateral one has .43), round by round.
/// Good triangles first, so that the last ones have room.
const QUALITY: [f64; 8] = [0.3, 0.15, 0.07, 0.03, 0.01, 1e-3, 1e-4, 1e-6];
/// Passes with one threshold.
const PASSES: usize = 4;
/// Corners of a hole: the best triangulation takes the cube of their number.
const CORNERS: usize = 40;
/// An edge is flipped if the cotangents against it sum to less than this: below zero by more than rounding, else squares
/// would be flipped for ever.
const FLIP: f64 = -1e-9;

/// For each vertex whether it must stay: cones, ends, bends and junctions of lines.
pub(super) fn corners(flat: &Flat) -> Vec<bool> {
    (0..flat.outgoing.len() as u32).map(|v| is_corner(flat, &flat.fan(v))).collect()
}

fn is_corner(flat: &Flat, fan: &[u32]) -> bool {
    let Some(&last) = fan.last() else { return false };
    let quarters = |part: &[u32]| {
        let angle = |&h: &u32| flat.edge[h as usize].angle_to(-flat.edge[previous(h) as usize]).abs();
        (part.iter().map(angle).sum::<f64>() / FRAC_PI_2).round()
    };
    let spokes: Vec<usize> = (0..fan.len()).filter(|&i| flat.line[fan[i] as usize]).collect();
    let open = flat.opposite[previous(last) as usize] == NONE;
    match (spokes.as_slice(), open) {
        ([], false) => quarters(fan) != 4.0,
        ([0], true) => quarters(fan) != 2.0,
        (&[i, j], false) => quarters(&fan[i..j]) != 2.0 || quarters(&[&fan[j..], &fan[..i]].concat()) != 2.0,
        _ => true,
    }
}

/// Takes out all vertices but those that must stay, and the few that resist.
/// # Errors
/// [`Cancelled`] by the observer.
pub(super) fn thin(flat: &mut Flat, stays: &[bool], observer: &dyn Observer) -> Result<(), Cancelled> {
    let mut left: Vec<u32> = (0..stays.len() as u32).filter(|&v| !stays[v as usize]).collect();
    for least in QUALITY {
        for _ in 0..PASSES {
            observer.check()?;
            let before = left.len();
            left.retain(|&v| {
                open_loops(flat, v, least);
                flat.outgoing[v as usize] != NONE && !take_out(flat, v, least)
            });
            make_delaunay(flat, observer)?;
            if left.len() == before {
                break;
            }
        }
    }
    Ok(())
}

/// Takes a vertex out if triangles of at least this quality can fill the hole.
fn take_out(flat: &mut Flat, v: u32, least: f64) -> bool {
    let mut fan = flat.fan(v);
    let open = flat.opposite[fan[0] as usize] == NONE;
    let spokes: Vec<usize> = (0..fan.len()).filter(|&i| flat.line[fan[i] as usize]).collect();
    let across = match spokes[..] {
        [i, j] if !open => {
            fan.rotate_left(i);
            Some([0, j - i])
        }
        _ => None,
    };
    if fan.len() > CORNERS {
        return false;
    }
    let Some(patch) = flat.star(&fan) else { return false };
    let count = patch.places.len();
    let whole: Vec<usize> = (0..count).collect();
    let filled = match across {
        None => fill(&patch.places, &whole, least),
        Some([_, j]) => {
            let beyond: Vec<usize> = (j..count).chain([0]).collect();
            fill(&patch.places, &whole[..=j], least).and_then(|mut near| {
                near.extend(fill(&patch.places, &beyond, least)?);
                Some(near)
            })
        }
    };
    let Some(filled) = filled else { return false };
    flat.replace(&patch, &filled, across);
    flat.outgoing[v as usize] = NONE;
    true
}

/// Flips the edges that run from a vertex to itself: it cannot be taken out as long as it has any.
fn open_loops(flat: &mut Flat, v: u32, least: f64) {
    for h in flat.fan(v) {
        if flat.origin[h as usize] != v || flat.origin[next(h) as usize] != v || flat.line[h as usize] {
            continue;
        }
        let Some(patch) = flat.pair(h) else { continue };
        if let Some(flipped) = other_diagonal(&patch, least) {
            flat.replace(&patch, &flipped, None);
        }
    }
}

/// The triangulation of a polygon whose worst triangle is best, if that has at least a quality (by tables over its
/// diagonals, as for matrix chains).
/// * `corners` - of the polygon, counter-clockwise, in `places`
fn fill(places: &[DVec2], corners: &[usize], least: f64) -> Option<Vec<[usize; 3]>> {
    let count = corners.len();
    if count < 3 {
        return None;
    }
    let mut best = vec![(f64::INFINITY, 0); count * count];
    for wide in 2..count {
        for i in 0..count - wide {
            let j = i + wide;
            let mut found = (0.0, 0);
            for k in i + 1..j {
                let below = best[i * count + k].0.min(best[k * count + j].0);
                if below > found.0 && below >= least {
                    let worst = quality([i, k, j].map(|n| places[corners[n]])).min(below);
                    if worst > found.0 {
                        found = (worst, k);
                    }
                }
            }
            best[i * count + j] = found;
        }
    }
    let is_fine = best[count - 1].0 >= least;
    if !is_fine {
        return None;
    }
    let (mut triangles, mut stack) = (Vec::new(), vec![(0, count - 1)]);
    while let Some((i, j)) = stack.pop() {
        if j > i + 1 {
            let k = best[i * count + j].1;
            triangles.push([i, k, j].map(|n| corners[n]));
            stack.extend([(i, k), (k, j)]);
        }
    }
    Some(triangles)
}

/// Flips edges off the lines until each is Delaunay.
fn make_delaunay(flat: &mut Flat, observer: &dyn Observer) -> Result<(), Cancelled> {
    let mut waiting: Vec<u32> = (0..3 * flat.len() as u32).collect();
    let mut steps = 0u32;
    while let Some(h) = waiting.pop() {
        steps += 1;
        if steps.is_multiple_of(1 << 14) {
            observer.check()?;
        }
        if flat.origin[h as usize] == NONE || flat.line[h as usize] || !asks_for_flip(flat, h) {
            continue;
        }
        let Some(patch) = flat.pair(h) else { continue };
        if let Some(flipped) = other_diagonal(&patch, 0.0) {
            flat.replace(&patch, &flipped, None);
            waiting.extend(patch.triangles.iter().flat_map(|t| 3 * t..3 * t + 3));
        }
    }
    Ok(())
}

/// True if the cotangents of the angles against an inner edge sum to less than [`FLIP`].
fn asks_for_flip(flat: &Flat, h: u32) -> bool {
    let one = |h: u32| {
        let (a, b) = (flat.edge[previous(h) as usize], -flat.edge[next(h) as usize]);
        a.dot(b) / a.perp_dot(b).abs()
    };
    one(h) + one(flat.opposite[h as usize]) < FLIP
}

/// The other two triangles of a pair, if both are counter-clockwise and better than `least`.
fn other_diagonal(patch: &Patch, least: f64) -> Option<[[usize; 3]; 2]> {
    let fine = |t: &[usize; 3]| quality(t.map(|i| patch.places[i])) > least;
    FLIPPED.iter().all(fine).then_some(FLIPPED)
}
