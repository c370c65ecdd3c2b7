//! Roundings: lines of a scan's mesh along a fillet a cell or two wide, which the mesh makes sharp.
//!
//! The mesh says nothing of what is finer than its cells, so a fillet of that size gets a line along it that looks as sharp as
//! an edge. But its flanks meet elsewhere: at an edge the surface reaches the place where they meet, at a rounding it stops
//! short of it. See `docs/methods/sharp.md`, step 3.

use super::flanks::{Flank, Moments, Plane, ScanScale};
use super::lines::{Lines, Seen};
use crate::mesh::TriMesh;
use crate::mesh::sets::Sets;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// An edge is rounded if the surface stays short of it by so many noise levels, and by such a share of a cell, ...
const SHORT_NOISE: f64 = 1.0;
const SHORT_CELLS: f64 = 0.1;
/// ... by so many standard deviations of what its flanks say ...
const SHORT_DEVIATIONS: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// ... and goes on to be so where it stays short by this share of that.
const WEAK_SHARE: f64 = 0.5;
/// Half of the vertices of a line within so many cells decide; no shorter piece is other than what is around it.
const DECIDING_CELLS: f64 = 6.0;
/// Vertices are made smooth within so many cells of a rounding, as told by what is this far across it and along it.
const SMOOTHED_CELLS: f64 = 2.0;
const SMOOTHING_WINDOW_CELLS: [f64; 2] = [2.0, 6.0];
/// Damping of the place where flanks meet: two at less than two degrees have none.
const MEETING_DAMPING: f64 = 1e-3;

/// Splits the edges of lines into those of edges and those of roundings.
/// * `flanks` - of the vertices of `lines`
pub(super) fn split(
    lines: &Lines,
    edges: &[[u32; 2]],
    flanks: &[(u32, Vec<Flank>)],
    scale: &ScanScale,
) -> [Vec<[u32; 2]>; 2] {
    let short: BTreeMap<u32, (f64, f64)> =
        flanks.iter().filter_map(|(v, f)| Some((*v, shortfall(lines, f)?))).collect();
    let least = (SHORT_NOISE * scale.noise).max(SHORT_CELLS * scale.cell);
    // 2 if half of the vertices around are short for certain, 1 if they may be.
    let verdict = |v: u32| {
        let known: Vec<_> =
            lines.around(v, DECIDING_CELLS * scale.cell).iter().filter_map(|v| short.get(v)).copied().collect();
        let half =
            |is: fn(f64, f64, f64) -> bool| 2 * known.iter().filter(|k| is(k.0, k.1, least)).count() > known.len();
        if half(|short, deviation, least| short > least && short > SHORT_DEVIATIONS * deviation) {
            2
        } else {
            u8::from(half(|short, _, least| short > WEAK_SHARE * least))
        }
    };
    let verdicts: BTreeMap<u32, u8> = short.keys().map(|&v| (v, verdict(v))).collect();
    let of = |e: &[u32; 2]| e.iter().filter_map(|v| verdicts.get(v)).min().copied().unwrap_or(0);
    let (weak, mut sharp): (Vec<[u32; 2]>, Vec<[u32; 2]>) = edges.iter().partition(|e| of(e) > 0);
    let is_sure = |piece: &Vec<[u32; 2]>| piece.iter().any(|e| of(e) > 1);
    let (sure, unsure): (Vec<_>, Vec<_>) = pieces(lines.mesh, &weak).into_iter().partition(is_sure);
    let mut round = sure.concat();
    sharp.extend(unsure.concat());
    join_short(lines.mesh, &mut round, &mut sharp, DECIDING_CELLS * scale.cell);
    join_short(lines.mesh, &mut sharp, &mut round, DECIDING_CELLS * scale.cell);
    [sharp, round]
}

/// The connected pieces of lines.
fn pieces(mesh: &TriMesh, edges: &[[u32; 2]]) -> Vec<Vec<[u32; 2]>> {
    let mut sets = Sets::new(mesh.points.len());
    edges.iter().for_each(|e| _ = sets.join(e[0], e[1]));
    let mut pieces: BTreeMap<u32, Vec<[u32; 2]>> = BTreeMap::new();
    edges.iter().for_each(|e| pieces.entry(sets.root(e[0])).or_default().push(*e));
    pieces.into_values().collect()
}

/// Gives the pieces shorter than `length` that touch `others` to these.
fn join_short(mesh: &TriMesh, edges: &mut Vec<[u32; 2]>, others: &mut Vec<[u32; 2]>, length: f64) {
    let ends: BTreeSet<u32> = others.iter().flatten().copied().collect();
    let of = |e: &[u32; 2]| mesh.points[e[0] as usize].distance(mesh.points[e[1] as usize]);
    let joins = |piece: &Vec<[u32; 2]>| {
        piece.iter().map(of).sum::<f64>() < length && piece.iter().flatten().any(|v| ends.contains(v))
    };
    let (short, long): (Vec<_>, Vec<_>) = pieces(mesh, edges).into_iter().partition(joins);
    *edges = long.concat();
    others.extend(short.concat());
}

/// How far a vertex stays short of where its two flanks meet, as told by what is beyond a rounding, and the standard deviation
/// of that.
fn shortfall(lines: &Lines, flanks: &[Flank]) -> Option<(f64, f64)> {
    let [a, b] = flanks else { return None };
    let planes = [a.beyond?, b.beyond?];
    let between = (planes[0].normal + planes[1].normal).try_normalize()?;
    let way = meet(planes.map(|plane| (plane.normal, plane.off))).dot(between);
    // The planes meet off the vertex along `between` by the sum of their distances over twice the cosine to it.
    let deviation = (planes[0].variance + planes[1].variance).sqrt() / (2.0 * between.dot(planes[0].normal)).max(0.1);
    let inwards = b.sector.iter().map(|&t| lines.centers[t as usize] - b.at).sum::<DVec3>();
    let is_convex = inwards.dot(planes[0].normal) < 0.0;
    Some((if is_convex { way } else { -way }, deviation))
}

/// Way of a vertex to where planes beside it meet: each with its unit normal, and how far outside the vertex is.
pub(super) fn meet(planes: impl IntoIterator<Item = (DVec3, f64)>) -> DVec3 {
    let (mut matrix, mut rhs) = (DMat3::from_diagonal(DVec3::splat(MEETING_DAMPING)), DVec3::ZERO);
    for (n, off) in planes {
        matrix += DMat3::from_cols(n * n.x, n * n.y, n * n.z);
        rhs -= n * off;
    }
    matrix.inverse() * rhs
}

/// The surface at the vertices on and beside roundings, ascending.
/// * `round` - the edges that are lines no more
pub(super) fn smoothed(lines: &Lines, round: &[[u32; 2]], scale: &ScanScale) -> Vec<(u32, Plane)> {
    let mesh = lines.mesh;
    // The nearest edge of each vertex: its distance and direction.
    let mut nearest: BTreeMap<u32, (f64, DVec3)> = BTreeMap::new();
    let mut seen = Seen::new(mesh.triangles.len());
    for e in round {
        let [a, b] = e.map(|v| mesh.points[v as usize]);
        let reach = SMOOTHED_CELLS * scale.cell + a.distance(b);
        let near = |t: u32| mesh.corners(t as usize).iter().any(|p| p.distance(a) < reach);
        for v in lines.grow(&lines.star(e[0]), &mut seen, near).into_iter().flat_map(|t| mesh.triangles[t as usize]) {
            let p = mesh.points[v as usize];
            let t = ((p - a).dot(b - a) / a.distance_squared(b)).clamp(0.0, 1.0);
            let off = p.distance(a.lerp(b, t));
            let known = nearest.entry(v).or_insert((SMOOTHED_CELLS * scale.cell, DVec3::ZERO));
            if off < known.0 {
                *known = (off, b - a);
            }
        }
    }
    let is_near = |(v, near): &(u32, (f64, DVec3))| near.1 != DVec3::ZERO && !lines.on_line[*v as usize];
    let near: Vec<(u32, (f64, DVec3))> = nearest.into_iter().filter(is_near).collect();
    let one = |seen: &mut Seen, (v, (_, along))| Some((v, surface(lines, v, along, scale, seen)?));
    near.into_par_iter().map_init(|| Seen::new(mesh.triangles.len()), one).flatten().collect()
}

/// The surface at `v`: a quadric over its tangent plane, from a window that is longer along a rounding than across it.
fn surface(lines: &Lines, v: u32, along: DVec3, scale: &ScanScale, seen: &mut Seen) -> Option<Plane> {
    let at = lines.mesh.points[v as usize];
    let star = lines.star(v);
    let [across, length] = SMOOTHING_WINDOW_CELLS;
    let near = lines.grow(&star, seen, |f| lines.centers[f as usize].distance(at) < across * scale.cell);
    let outwards = near.iter().map(|&f| lines.areas[f as usize]).sum::<DVec3>().try_normalize()?;
    let y = (along - outwards * outwards.dot(along)).try_normalize()?;
    let x = outwards.cross(y);
    // Place of a face in cells, and how far that is in terms of the window.
    let place = |f: u32| {
        let p = (lines.centers[f as usize] - at) / scale.cell;
        let p = DVec3::new(p.dot(x), p.dot(y), p.dot(outwards));
        (p, (p.x * p.x + p.z * p.z) / (across * across) + p.y * p.y / (length * length))
    };
    let mut sums = Moments::default();
    for f in lines.grow(&star, seen, |f| place(f).1 < 1.0 && lines.is_facing(f, outwards)) {
        let (p, far) = place(f);
        let bell = (1.0 - far).max(0.0).powi(2);
        sums.add(p.x, p.y, p.z, bell * lines.areas[f as usize].length() / (scale.spacing * scale.spacing));
    }
    Some(sums.fit(6, scale.noise / scale.cell)?.plane([x, y, outwards], scale.cell))
}
