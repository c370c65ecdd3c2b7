//! Sharp lines of a mesh made of a noisy scan, moved to where their flanks meet.
//!
//! Where two sheets of a scan meet, each has the points of one side only, so the surface is least sure right beside a
//! sharp line, and the line itself is where two unsure sheets meet. But most flanks go on smoothly for many cells. So
//! 1. each side of each vertex of a line gets an estimate from far around ([`flanks`](super::flanks)); lines whose
//!    flanks tell of a rounded edge are dropped ([`rounded`](super::rounded));
//! 2. the vertex goes to where its flanks meet; vertices within some cells of the line go towards the flanks beside
//!    them;
//! 3. a move that turns a triangle over is halved, one that makes two triangles meet is taken back;
//! 4. vertices in the way are merged into their neighbours ([`merging`](super::merging)), and moves that were taken
//!    back are tried again.
//!
//! See `docs/methods/sharp.md`, steps 2 to 5.

use super::flanks::{Flank, Plane, ScanScale};
use super::lines::{Lines, Seen};
use super::merging::{Fault, Merging};
use super::rounded::{self, meet};
use crate::mesh::intersect::intersections_of;
use crate::mesh::{FeatureTags, TriMesh};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;

/// The flanks are followed within so many cells of the line, fully within half of that.
const FLANK_REACH_CELLS: f64 = 4.0;
/// A vertex of a line moves by so many noise levels at most: farther off is not where it was seen.
const FARTHEST_MOVE_NOISE: f64 = 2.0;
/// Others are drawn less the farther they are from the flank, beyond one noise level not at all: that is structure.
const STRUCTURE_NOISE: f64 = 1.0;
/// Variance of a flank's slope that counts as none: that of .7 degrees.
const NO_SLOPE_VARIANCE: f64 = 1.6e-4;
/// A triangle may turn so far from what is expected of it (cosine) if it was no farther before.
const FACE_TURN_COSINE: f64 = 0.7;
/// A triangle keeps so much of its area.
const KEPT_AREA: f64 = 0.1;
/// Rounds in which vertices go back half of the way, and rounds in all.
const HALVES: usize = 6;
const BACK_ROUNDS: usize = 24;
/// A vertex this near to where it should be is there, in cells.
const THERE_CELLS: f64 = 1e-3;
/// Vertices are merged over edges of so many cells at most, and triangles with an edge shorter than so many cells are too small.
const LONGEST_MERGED_CELLS: f64 = 1.0;
const CRAMPED_CELLS: f64 = 0.2;
/// Rounds of that.
const MERGE_ROUNDS: usize = 24;

/// Moves the lines of `tags` to where the surfaces beside them meet, and what is within four cells of them onto these surfaces;
/// vertices that are in the way are merged into others. Lines along rounded edges are dropped, and the mesh is smooth
/// there. Returns the number of vertices that moved.
///
/// No triangle turns over, and none comes to meet another. A mesh without noise stays as it is.
/// # Errors
/// [`Cancelled`]; the mesh is then half done.
pub fn fair_lines(
    mesh: &mut TriMesh,
    tags: &mut FeatureTags,
    scale: &ScanScale,
    observer: &dyn Observer,
) -> Result<usize, Cancelled> {
    let usable = [scale.noise, scale.spacing, scale.cell].iter().all(|x| *x > 0.0 && x.is_finite());
    if tags.edges.is_empty() || !usable {
        return Ok(0);
    }
    let mut lines = Lines::new(mesh, tags);
    let mut flanks = lines.flanks(scale, observer)?;
    observer.check()?;
    let [sharp, round] = rounded::split(&lines, &tags.edges, &flanks, scale);
    if !round.is_empty() {
        *tags = tags.with_edges(sharp);
        lines.mark(tags);
        flanks.retain(|f| lines.on_line[f.0 as usize]);
    }
    let mut wishes = wishes(&lines, &flanks, scale, observer)?;
    wishes.add(mesh, rounded::smoothed(&lines, &round, scale));
    let mut moved = vec![false; mesh.points.len()];
    settle(mesh, &wishes, &mut moved, observer)?;
    tidy(mesh, tags, &mut wishes, observer)?;
    settle(mesh, &wishes, &mut moved, observer)?;
    let mut stays = vec![false; mesh.points.len()];
    mesh.triangles.iter().flatten().for_each(|&v| stays[v as usize] = true);
    tags.keep(mesh, &stays);
    Ok(moved.into_iter().zip(stays).filter(|x| x.0 && x.1).count())
}

struct Wishes {
    /// Vertices and where they should be, ascending.
    moves: Vec<(u32, DVec3)>,
    /// For each triangle its normal by the flanks; zero away from them.
    expected: Vec<DVec3>,
    /// Edge of a cell.
    cell: f64,
}

impl Wishes {
    /// Adds vertices with their places and normals, ascending, in place of what was wished there.
    fn add(&mut self, mesh: &TriMesh, others: Vec<(u32, Plane)>) {
        if others.is_empty() {
            return;
        }
        let find = |v: u32| others.binary_search_by_key(&v, |o| o.0).ok();
        self.moves.retain(|m| find(m.0).is_none());
        self.moves.extend(others.iter().map(|(v, plane)| (*v, mesh.points[*v as usize] - plane.normal * plane.off)));
        self.moves.sort_unstable_by_key(|m| m.0);
        for (expected, triangle) in self.expected.iter_mut().zip(&mesh.triangles) {
            if let [Some(a), Some(b), Some(c)] = triangle.map(find) {
                *expected = [a, b, c].iter().map(|&i| others[i].1.normal).sum::<DVec3>().normalize_or_zero();
            }
        }
    }

    /// True if a triangle that had this normal looks the wrong way with these corners.
    fn is_turned(&self, t: u32, normal: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
        // What is expected leaves room; where nothing is, the triangle itself is.
        let expected = self.expected[t as usize];
        let wanted = if expected == DVec3::ZERO { normal } else { expected };
        let now = (b - a).cross(c - a).normalize_or_zero();
        now.dot(wanted) <= FACE_TURN_COSINE.min(normal.dot(wanted) - 1e-9)
    }
}

/// What all flanks around say of one side of a vertex on a line.
#[derive(Clone, Default)]
struct Shared {
    /// The last that was heard, counted from 1.
    last: usize,
    weight: f64,
    normal: DVec3,
    off: f64,
}

impl Shared {
    fn add(&mut self, n: usize, weight: f64, normal: DVec3, off: f64) {
        if std::mem::replace(&mut self.last, n + 1) != n + 1 {
            self.weight += weight;
            self.normal += normal * weight;
            self.off += off * weight;
        }
    }
}

fn wishes(
    lines: &Lines,
    flanks: &[(u32, Vec<Flank>)],
    scale: &ScanScale,
    observer: &dyn Observer,
) -> Result<Wishes, Cancelled> {
    let mesh = lines.mesh;
    let reach = FLANK_REACH_CELLS * scale.cell;
    // What each flank says of the faces beside it.
    let beside: Result<Vec<Vec<Vec<u32>>>, Cancelled> = flanks
        .par_iter()
        .map_init(
            || Seen::new(mesh.triangles.len()),
            |seen, (_, flanks)| {
                observer.check()?;
                let one = |f: &Flank, seen: &mut Seen| {
                    let near = |t: u32| mesh.corners(t as usize).iter().any(|p| p.distance(f.at) < reach);
                    lines.grow(&f.sector, seen, |t| near(t) && lines.is_facing(t, f.axes[2]))
                };
                Ok(flanks.iter().map(|f| one(f, seen)).collect())
            },
        )
        .collect();
    let beside = beside?;
    let count = mesh.points.len();
    let mut expected = vec![DVec3::ZERO; mesh.triangles.len()];
    let (mut sum, mut weight, mut least) = (vec![DVec3::ZERO; count], vec![0.0; count], vec![f64::INFINITY; count]);
    let mut last = vec![usize::MAX; count];
    // Of each corner on a line the flank there, and what all flanks say of that one.
    let mut own = vec![usize::MAX; 3 * mesh.triangles.len()];
    for (n, (v, flank)) in flanks.iter().flat_map(|(v, f)| f.iter().map(move |f| (*v, f))).enumerate() {
        for h in flank.sector.iter().flat_map(|&t| 3 * t..3 * t + 3).filter(|&h| mesh.origin(h) == v) {
            own[h as usize] = n;
        }
    }
    let mut shared = vec![Shared::default(); flanks.iter().map(|f| f.1.len()).sum()];
    let all = flanks.iter().flat_map(|(_, f)| f).zip(beside.iter().flatten());
    for (n, (flank, faces)) in all.enumerate() {
        observer.check()?;
        for &t in faces {
            let corners = mesh.corners(t as usize);
            let center = corners.into_iter().sum::<DVec3>() / 3.0;
            let near = (1.0 - center.distance(flank.at) / reach).max(0.0);
            expected[t as usize] += flank.normal(center) * near.powi(4);
            for (k, p) in corners.into_iter().enumerate() {
                let v = mesh.triangles[t as usize][k] as usize;
                let far = p.distance(flank.at) / reach;
                if far >= 1.0 {
                    continue;
                }
                let w = (1.0 - far * far).powi(2) / (flank.variance + NO_SLOPE_VARIANCE);
                let (off, normal) = flank.beside(p);
                if lines.on_line[v] {
                    if let Some(shared) = shared.get_mut(own[3 * t as usize + k]) {
                        shared.add(n, w, normal, off);
                    }
                    continue;
                }
                // Once for each flank.
                if std::mem::replace(&mut last[v], n) == n {
                    continue;
                }
                let t = off / (STRUCTURE_NOISE * scale.noise);
                // Tukey's weight.
                let keep = (1.0 - t * t).max(0.0).powi(2);
                sum[v] -= normal * (off * w * keep);
                weight[v] += w;
                least[v] = least[v].min(far);
            }
        }
    }
    let mut moves: Vec<(u32, DVec3)> = (0..count)
        .filter(|&v| weight[v] > 0.0)
        .map(|v| {
            let t = (2.0 * least[v] - 1.0).max(0.0);
            (v as u32, mesh.points[v] + sum[v] / weight[v] * (1.0 - t * t * (3.0 - 2.0 * t)))
        })
        .collect();
    let mut at = 0;
    for (v, flanks) in flanks {
        let from = mesh.points[*v as usize];
        let side = |s: &Shared| (s.normal.normalize_or_zero(), s.off / s.weight.max(f64::MIN_POSITIVE));
        let way = meet(shared[at..at + flanks.len()].iter().map(side));
        at += flanks.len();
        if way.length() <= FARTHEST_MOVE_NOISE * scale.noise {
            moves.push((*v, from + way));
        }
    }
    moves.sort_unstable_by_key(|m| m.0);
    expected.iter_mut().for_each(|n| *n = n.normalize_or_zero());
    Ok(Wishes { moves, expected, cell: scale.cell })
}

/// Moves vertices as far as the triangles allow, and marks them.
fn settle(mesh: &mut TriMesh, wishes: &Wishes, moved: &mut [bool], observer: &dyn Observer) -> Result<(), Cancelled> {
    let before = mesh.points.clone();
    let mut share = vec![0.0; mesh.points.len()];
    let is_there = |v: u32, p: DVec3| before[v as usize].distance(p) <= THERE_CELLS * wishes.cell;
    wishes.moves.iter().filter(|m| !is_there(m.0, m.1)).for_each(|m| share[m.0 as usize] = 1.0);
    let moves =
        |t: u32, share: &[f64], mesh: &TriMesh| mesh.triangles[t as usize].iter().any(|&v| share[v as usize] > 0.0);
    let touched: Vec<u32> = (0..mesh.triangles.len() as u32).filter(|&t| moves(t, &share, mesh)).collect();
    let was: Vec<(DVec3, f64)> = touched.iter().map(|&t| (mesh.normal(t as usize), mesh.area(t as usize))).collect();
    // Vertices whose triangles were not asked yet whether they meet others.
    let mut fresh: Vec<bool> = share.iter().map(|s| *s > 0.0).collect();
    for round in 0..BACK_ROUNDS {
        observer.check()?;
        for &(v, p) in &wishes.moves {
            mesh.points[v as usize] = before[v as usize].lerp(p, share[v as usize]);
        }
        let is_bad = |(&t, (normal, area)): (&u32, &(DVec3, f64))| {
            let fits =
                !wishes.is_turned(t, *normal, mesh.corners(t as usize)) && mesh.area(t as usize) >= KEPT_AREA * area;
            moves(t, &share, mesh) && !fits
        };
        let mut bad: Vec<u32> = touched.par_iter().zip(&was).filter(|x| is_bad(*x)).map(|(&t, _)| t).collect();
        let mut left = if round < HALVES { 0.5 } else { 0.0 };
        if bad.is_empty() {
            let is_fresh = |t: u32| mesh.triangles[t as usize].iter().any(|&v| fresh[v as usize]);
            let pairs = intersections_of(mesh, is_fresh, observer)?.into_iter();
            bad = pairs.filter(|pair| pair.iter().any(|&t| moves(t, &share, mesh))).flatten().collect();
            fresh.fill(false);
            left = 0.0;
        }
        if bad.is_empty() {
            (0..share.len()).filter(|&v| share[v] > 0.0).for_each(|v| moved[v] = true);
            return Ok(());
        }
        let mut back: Vec<u32> = bad.iter().flat_map(|&t| mesh.triangles[t as usize]).collect();
        back.sort_unstable();
        back.dedup();
        for &v in &back {
            fresh[v as usize] |= share[v as usize] > 0.0;
            share[v as usize] *= left;
        }
    }
    mesh.points = before;
    Ok(())
}

/// Merges vertices and flips edges where triangles look the wrong way or are too small.
fn tidy(
    mesh: &mut TriMesh,
    tags: &mut FeatureTags,
    wishes: &mut Wishes,
    observer: &dyn Observer,
) -> Result<(), Cancelled> {
    let mut merging = Merging::new(mesh, &tags.vertices, &tags.edges);
    let fault = |t: u32, corners: [DVec3; 3]| {
        let [a, b, c] = corners;
        let least = a.distance(b).min(b.distance(c)).min(c.distance(a));
        match wishes.expected[t as usize] {
            DVec3::ZERO => Fault::None,
            normal if wishes.is_turned(t, normal, corners) => Fault::Turned,
            _ if least < CRAMPED_CELLS * wishes.cell => Fault::Cramped,
            _ => Fault::None,
        }
    };
    let all = 0..mesh.triangles.len() as u32;
    let mut faulty: Vec<u32> = all.filter(|&t| fault(t, mesh.corners(t as usize)) != Fault::None).collect();
    for _ in 0..MERGE_ROUNDS {
        observer.check()?;
        faulty = merging.round(&faulty, fault, LONGEST_MERGED_CELLS * wishes.cell, 0.0, observer)?;
    }
    let merged = merging.mesh;
    let mut t = 0;
    wishes.expected.retain(|_| {
        t += 1;
        merged.get(t - 1).is_some()
    });
    tags.edges = merged.lines.iter().copied().collect();
    mesh.triangles = merged.into_triangles();
    Ok(())
}
