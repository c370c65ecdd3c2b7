//! Slivers beside lines: what is narrower than a mesh can tell of is taken out.
//!
//! A vertex next to another, or to an edge, says nothing that the other does not say, but the triangle between them looks
//! anywhere, and a line over it turns by any angle. Vertices are merged, edges flipped, and a line that passes a vertex is led
//! over it, as in [`merging`](super::merging); what is expected of a triangle is the mean normal of those around it on its
//! side of the lines. See `docs/methods/sharp.md`, step 5.

use super::flanks::ScanScale;
use super::lines::{Lines, Seen};
use super::merging::{Fault, Merging};
use crate::mesh::{FeatureTags, TriMesh};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;

/// Edges shorter than this and triangles lower than this, in cells, are too small. Extraction puts about three vertices on
/// the length of a cell: the first is half of that distance, the second the way that a chord of a third of a cell leaves
/// a line of the smallest radius that a mesh can tell of, one cell: (1/3)^2 / 8, and as much for what noise adds.
const SHORTEST_CELLS: f64 = 0.16;
const LOWEST_CELLS: f64 = 0.03;
/// What is expected of a triangle is told by those within so many cells.
const AROUND_CELLS: f64 = 1.0;
/// A triangle that looks away from what is expected by more than this (cosine of 60 degrees) is turned.
const TURNED_COSINE: f64 = 0.5;
/// Rounds of changes.
const TIDY_ROUNDS: usize = 24;

/// Takes out what is too small beside the lines of `tags`, at which no triangle comes to look another way or to meet others.
/// Returns how many triangles went.
/// # Errors
/// [`Cancelled`]; the mesh is then as it was.
pub fn tidy_lines(
    mesh: &mut TriMesh,
    tags: &mut FeatureTags,
    scale: &ScanScale,
    observer: &dyn Observer,
) -> Result<usize, Cancelled> {
    let count = mesh.triangles.len();
    let (triangles, edges) = {
        let lines = Lines::new(mesh, tags);
        let expected = expected(&lines, scale.cell, observer)?;
        let fault = |t: u32, [a, b, c]: [DVec3; 3]| {
            let normal = expected[t as usize];
            if normal == DVec3::ZERO {
                return Fault::None;
            }
            let (area, lengths) = ((b - a).cross(c - a), [a.distance(b), b.distance(c), c.distance(a)]);
            let (short, long) = lengths.iter().fold((f64::INFINITY, 0.0f64), |(s, l), &x| (s.min(x), l.max(x)));
            let is_small = short < SHORTEST_CELLS * scale.cell || area.length() < LOWEST_CELLS * scale.cell * long;
            match area.dot(normal) <= TURNED_COSINE * area.length() {
                true => Fault::Turned,
                false if is_small => Fault::Cramped,
                false => Fault::None,
            }
        };
        let is_faulty = |&t: &u32| {
            let touches = mesh.triangles[t as usize].iter().any(|&v| lines.on_line[v as usize]);
            touches && fault(t, mesh.corners(t as usize)) != Fault::None
        };
        let mut faulty: Vec<u32> = (0..count as u32).filter(is_faulty).collect();
        let mut merging = Merging::new(mesh, &tags.vertices, &tags.edges);
        for _ in 0..TIDY_ROUNDS {
            if faulty.is_empty() {
                break;
            }
            observer.check()?;
            faulty = merging.round(&faulty, fault, scale.cell, LOWEST_CELLS * scale.cell, observer)?;
        }
        let edges: Vec<[u32; 2]> = merging.mesh.lines.iter().copied().collect();
        (merging.mesh.into_triangles(), edges)
    };
    *tags = tags.with_edges(edges);
    mesh.triangles = triangles;
    let mut stays = vec![false; mesh.points.len()];
    mesh.triangles.iter().flatten().for_each(|&v| stays[v as usize] = true);
    tags.keep(mesh, &stays);
    Ok(count - mesh.triangles.len())
}

/// What is expected of the triangles near lines: the mean normal of those around each that no line parts from it; zero elsewhere.
fn expected(lines: &Lines, cell: f64, observer: &dyn Observer) -> Result<Vec<DVec3>, Cancelled> {
    let mesh = lines.mesh;
    // Two rings: what is changed, and what is around it.
    let mut near = lines.on_line.clone();
    for _ in 0..2 {
        let was = near.clone();
        let touched = mesh.triangles.iter().filter(|t| t.iter().any(|&v| was[v as usize]));
        touched.flatten().for_each(|&v| near[v as usize] = true);
    }
    let reach = AROUND_CELLS * cell;
    let one = |seen: &mut Seen, t: u32| {
        observer.check()?;
        if !mesh.triangles[t as usize].iter().any(|&v| near[v as usize]) {
            return Ok(DVec3::ZERO);
        }
        let at = lines.centers[t as usize];
        let around = lines.grow(&[t], seen, |f| lines.centers[f as usize].distance(at) < reach);
        Ok(around.into_iter().map(|f| lines.areas[f as usize]).sum::<DVec3>().normalize_or_zero())
    };
    let seen = || Seen::new(mesh.triangles.len());
    (0..mesh.triangles.len() as u32).into_par_iter().map_init(seen, one).collect()
}
