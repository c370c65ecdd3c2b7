//! Sharp lines as borders of a labelling (`docs/methods/sharp.md`, step 1).

use super::charts;
use super::flanks::ScanScale;
use super::labels::Labels;
use super::lines::{Lines, Seen};
use crate::mesh::sets::Sets;
use crate::mesh::{FeatureTags, NONE, TriMesh, next};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A loose end costs as much as so many cells of a flat border: a gap of a chart's radius is closed, one that is longer is no gap,
/// for then a chart on it has seen no edge.
const LOOSE_END_CELLS: f64 = charts::RADIUS_CELLS / 2.0;

/// Marks the borders of sheets at which these meet at an angle.
/// * `sharp_rad` - the least angle
/// # Errors
/// [`Cancelled`]; the tags are then as they were.
pub fn find_lines(
    mesh: &TriMesh,
    tags: &mut FeatureTags,
    scale: &ScanScale,
    sharp_rad: f64,
    observer: &dyn Observer,
) -> Result<usize, Cancelled> {
    let usable = [scale.noise, scale.spacing, scale.cell].iter().all(|x| *x > 0.0 && x.is_finite());
    if !usable {
        return Ok(0);
    }
    let mut lines = Lines::new(mesh, &FeatureTags::from_edges(mesh.points.len(), []));
    // Where extraction saw two sheets in a cell they bend by the angle that it asks for, however the faces lie.
    let mut bends = charts::bends(&lines);
    bends.iter_mut().zip(tags.on(mesh)).filter(|x| x.1).for_each(|(bend, _)| *bend = bend.max(sharp_rad));
    let labels = Labels::new(&lines, &bends, scale, sharp_rad, observer)?;
    // What is beside a border does not reach over another one that is bent.
    let is_border = |h: usize| {
        let o = lines.adjacency.opposite[h];
        o != NONE && labels.of[h / 3] != labels.of[o as usize / 3] && bends[h] >= sharp_rad
    };
    lines.tagged = (0..bends.len()).map(is_border).collect();
    let edges = borders(&lines, &labels, sharp_rad, scale.cell);
    let count = edges.len();
    *tags = FeatureTags::from_edges(mesh.points.len(), edges);
    Ok(count)
}

/// A connected border between two labels.
struct Piece {
    edges: Vec<[u32; 2]>,
    /// What speaks for a sharp line, cells: for each cell of length how far the angle of the sheets is above the least one, as
    /// a share of that, at most 1.
    evidence: f64,
}

/// The borders that are lines: what speaks for them against what loose ends cost, as good as changing one piece at a time gets.
fn borders(lines: &Lines, labels: &Labels, sharp: f64, cell: f64) -> Vec<[u32; 2]> {
    let pieces = all_pieces(lines, labels, sharp, cell);
    let mut on: Vec<bool> = pieces.iter().map(|p| p.evidence > 0.0).collect();
    let mut degree = vec![0i32; lines.mesh.points.len()];
    let mut touching: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (i, piece) in pieces.iter().enumerate() {
        for (v, times) in piece.degrees() {
            touching.entry(v).or_default().push(i);
            degree[v as usize] += if on[i] { times } else { 0 };
        }
    }
    let inner = |v: u32| !lines.adjacency.is_boundary_vertex(v);
    // What it would gain to change a piece.
    let gain = |i: usize, on: &[bool], degree: &[i32]| {
        let sign = if on[i] { -1 } else { 1 };
        let loose = |d: i32| i32::from(d == 1);
        let ends = pieces[i].degrees().into_iter().filter(|d| inner(d.0));
        let more: i32 = ends.map(|(v, n)| loose(degree[v as usize] + sign * n) - loose(degree[v as usize])).sum();
        f64::from(sign) * pieces[i].evidence - LOOSE_END_CELLS * f64::from(more)
    };
    let mut gains: Vec<f64> = (0..pieces.len()).map(|i| gain(i, &on, &degree)).collect();
    while let Some(best) = (0..gains.len()).max_by(|&a, &b| gains[a].total_cmp(&gains[b]).then(b.cmp(&a)))
        && gains[best] > 0.0
    {
        let sign = if on[best] { -1 } else { 1 };
        on[best] = !on[best];
        let changed = pieces[best].degrees();
        changed.iter().for_each(|(&v, n)| degree[v as usize] += sign * n);
        for i in changed.keys().flat_map(|v| &touching[v]) {
            gains[*i] = gain(*i, &on, &degree);
        }
    }
    pieces.into_iter().zip(on).filter(|p| p.1).flat_map(|p| p.0.edges).collect()
}

impl Piece {
    /// The vertices, and how many of its edges meet there.
    fn degrees(&self) -> BTreeMap<u32, i32> {
        let mut degrees = BTreeMap::new();
        self.edges.iter().flatten().for_each(|&v| *degrees.entry(v).or_default() += 1);
        degrees
    }
}

/// The connected pieces of the borders between every two labels.
fn all_pieces(lines: &Lines, labels: &Labels, sharp: f64, cell: f64) -> Vec<Piece> {
    let opposite = &lines.adjacency.opposite;
    let mut between: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
    for h in 0..opposite.len() as u32 {
        let o = opposite[h as usize];
        if o == NONE || o < h {
            continue;
        }
        let [a, b] = [h, o].map(|h| labels.of[h as usize / 3]);
        if a != b {
            between.entry([a.min(b), a.max(b)]).or_default().push(h);
        }
    }
    let all: Vec<Vec<u32>> = between.values().flat_map(|edges| pieces(lines, edges)).collect();
    let one = |seen: &mut Seen, piece: Vec<u32>| {
        let evidence = piece.iter().map(|&h| evidence(lines, labels, h, sharp, cell, seen)).sum();
        Piece { evidence, edges: piece.into_iter().map(|h| charts::ends(lines, h)).collect() }
    };
    all.into_par_iter().map_init(|| Seen::new(labels.of.len()), one).collect()
}

/// What speaks for an edge of a border to be sharp, cells. The angle is that of the sheets, or that of the faces beside it if it
/// is less: sheets that are no quadrics disagree where the mesh is smooth, faces beside noise where the sheets are one.
fn evidence(lines: &Lines, labels: &Labels, h: u32, sharp: f64, cell: f64, seen: &mut Seen) -> f64 {
    let [p, q] = charts::ends(lines, h).map(|v| lines.mesh.points[v as usize]);
    let middle = p.midpoint(q);
    let o = lines.adjacency.opposite[h as usize];
    let sides = [[h, o], [o, h]].map(|[h, o]| {
        let [own, other] = [h, o].map(|h| labels.of[h as usize / 3]);
        let normal = labels.sheets[own as usize].as_ref().map(|sheet| sheet.beside(middle).1);
        let inwards =
            lines.areas[h as usize / 3].cross(lines.mesh.points[lines.mesh.origin(next(h)) as usize] - middle);
        let is_beyond =
            |f: u32| labels.of[f as usize] == other || (lines.centers[f as usize] - middle).dot(inwards) < 0.0;
        [side(lines, h / 3, middle, cell, is_beyond, seen), normal.unwrap_or_default()]
    });
    let between = |k: usize| sides[0][k].cross(sides[1][k]).length().atan2(sides[0][k].dot(sides[1][k]));
    p.distance(q) / cell * (between(0).min(between(1)) / sharp - 1.0).min(1.0)
}

/// The normal right beside a border: the mean one up to a cell away, and half of what that differs from the mean one a cell
/// farther on. Where a surface bends evenly the first is told half a cell away, the second one and a half.
/// * `is_beyond` - whether a face lies on the other side
fn side(lines: &Lines, face: u32, middle: DVec3, cell: f64, is_beyond: impl Fn(u32) -> bool, seen: &mut Seen) -> DVec3 {
    let off = |f: u32| lines.centers[f as usize].distance(middle);
    let around = lines.grow(&[face], seen, |f| off(f) < 2.0 * cell && !is_beyond(f));
    let (near, far): (Vec<u32>, Vec<u32>) = around.into_iter().partition(|&f| off(f) < cell);
    let [near, far] = [near, far].map(|faces| faces.into_iter().map(|f| lines.areas[f as usize]).sum::<DVec3>());
    // A sheet that ends there tells of no bend.
    let far = if far.length() < near.length() { near } else { far };
    (1.5 * near.normalize_or_zero() - 0.5 * far.normalize_or_zero()).normalize_or_zero()
}

/// The connected pieces of some edges.
fn pieces(lines: &Lines, edges: &[u32]) -> Vec<Vec<u32>> {
    let mut names: Vec<u32> = edges.iter().flat_map(|&h| charts::ends(lines, h)).collect();
    names.sort_unstable();
    names.dedup();
    let name = |v: u32| names.binary_search(&v).unwrap_or(0) as u32;
    let mut sets = Sets::new(names.len());
    edges.iter().map(|&h| charts::ends(lines, h)).for_each(|[a, b]| _ = sets.join(name(a), name(b)));
    let mut pieces: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    edges.iter().for_each(|&h| pieces.entry(sets.root(name(lines.mesh.origin(h)))).or_default().push(h));
    pieces.into_values().collect()
}
