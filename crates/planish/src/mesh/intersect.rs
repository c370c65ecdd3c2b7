//! Self-intersections of a mesh, by exact signs.
//!
//! Triangles are sorted into the cells of a grid; pairs that share a cell and whose boxes meet are asked
//! ([`triangles_meet`]). Triangles with common vertices count if they meet in more than those.
//!
//! Exact signs as in `geom::predicates`; `docs/decisions/0006-certified-cells.md` says why zero is promised.

use super::{Adjacency, NONE, TriMesh};
use crate::geom::predicates::triangles_meet;
use crate::observe::{Cancelled, Observer, Silent};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// All pairs of triangles that meet in more than the vertices they share, ascending.
///
/// A triangle without area is a segment or a point, and counts as such. Vertices are told apart by their index: weld
/// first where cracks shall not count.
pub fn self_intersections(mesh: &TriMesh) -> Vec<[u32; 2]> {
    match intersections_of(mesh, |_| true, &Silent) {
        Ok(pairs) => pairs,
        Err(Cancelled) => unreachable!("nobody cancels"),
    }
}

/// Neighbours whose normals are farther apart, degrees, are folded back on one another.
const FOLDED_BACK_DEG: f64 = 175.0;

/// The half-edges, one of each edge, whose two triangles are folded back on one another: their normals are more than 175 degrees apart.
/// Exact signs pass a triangle that was turned over beside its neighbour, within their plane.
pub fn folded_back(mesh: &TriMesh, adjacency: &Adjacency) -> Vec<u32> {
    let normals: Vec<DVec3> = (0..mesh.triangles.len()).into_par_iter().map(|t| mesh.normal(t)).collect();
    let limit = FOLDED_BACK_DEG.to_radians().cos();
    let is_folded = |&h: &u32| {
        let o = adjacency.opposite[h as usize];
        o != NONE && h < o && normals[h as usize / 3].dot(normals[o as usize / 3]) < limit
    };
    (0..adjacency.opposite.len() as u32).filter(is_folded).collect()
}

/// As [`self_intersections`], of pairs of which one is `active`, where an observer may stop it.
/// # Errors
/// [`Cancelled`].
pub(crate) fn intersections_of(
    mesh: &TriMesh,
    active: impl Fn(u32) -> bool + Sync,
    observer: &dyn Observer,
) -> Result<Vec<[u32; 2]>, Cancelled> {
    observer.check()?;
    let active: Vec<bool> = (0..mesh.triangles.len() as u32).into_par_iter().map(&active).collect();
    let boxes: Vec<[DVec3; 2]> = (0..mesh.triangles.len())
        .into_par_iter()
        .map(|t| {
            let [a, b, c] = mesh.corners(t);
            [a.min(b).min(c), a.max(b).max(c)]
        })
        .collect();
    let Some(usual) = cell_size(&boxes) else { return Ok(Vec::new()) };
    let origin = boxes.iter().fold(DVec3::INFINITY, |m, b| m.min(b[0]));
    let end = boxes.iter().fold(DVec3::NEG_INFINITY, |m, b| m.max(b[1]));
    let size = usual.max((end - origin).max_element() / MOST_CELLS);
    let cell = |p: DVec3| ((p - origin) / size).to_array().map(|x| x as u64);
    let cells = |b: &[DVec3; 2]| {
        let (low, high) = (cell(b[0]), cell(b[1]));
        let rows = (low[2]..=high[2]).flat_map(move |z| (low[1]..=high[1]).map(move |y| (y, z)));
        rows.flat_map(move |(y, z)| (low[0]..=high[0]).map(move |x| packed([x, y, z])))
    };
    let actives: Vec<usize> = (0..boxes.len()).filter(|&t| active[t]).collect();
    let mut wanted: Vec<u64> = actives.par_iter().flat_map_iter(|&t| cells(&boxes[t])).collect();
    observer.check()?;
    wanted.par_sort_unstable();
    wanted.dedup();
    // A table of hashes rules out nearly all cells that are not.
    let slots = (4 * wanted.len()).next_power_of_two() as u64;
    let mut table = vec![false; slots as usize];
    let slot = |c: u64| (c.wrapping_mul(SPREAD) >> 32 & (slots - 1)) as usize;
    wanted.iter().for_each(|&c| table[slot(c)] = true);
    let is_wanted = |c: &u64| table[slot(*c)] && wanted.binary_search(c).is_ok();
    observer.check()?;
    let mut entries: Vec<(u64, u32)> = boxes
        .par_iter()
        .enumerate()
        .flat_map_iter(|(t, b)| cells(b).filter(is_wanted).map(move |c| (c, t as u32)))
        .collect();
    observer.check()?;
    entries.par_sort_unstable();
    let runs: Vec<&[(u64, u32)]> = entries.chunk_by(|a, b| a.0 == b.0).filter(|r| r.len() > 1).collect();
    let stopped = AtomicBool::new(false);
    let mut found: Vec<[u32; 2]> = runs
        .par_iter()
        .flat_map_iter(|run| {
            let (boxes, active) = (&boxes, &active);
            let run: &[(u64, u32)] = if observer.cancelled() {
                stopped.store(true, Ordering::Relaxed);
                &[]
            } else {
                run
            };
            run.iter().enumerate().flat_map(move |(n, &(at, s))| {
                run[..n].iter().filter_map(move |&(_, t)| {
                    let (a, b) = (&boxes[s as usize], &boxes[t as usize]);
                    let (low, high) = (a[0].max(b[0]), a[1].min(b[1]));
                    // Each pair once: in the cell that holds the least corner of what the boxes share.
                    if !(active[s as usize] || active[t as usize]) || low.cmpgt(high).any() || packed(cell(low)) != at {
                        return None;
                    }
                    let corners = |t: u32| mesh.corners(t as usize);
                    let names = |t: u32| mesh.triangles[t as usize];
                    triangles_meet(corners(s), names(s), corners(t), names(t)).then(|| [s.min(t), s.max(t)])
                })
            })
        })
        .collect();
    if stopped.into_inner() {
        return Err(Cancelled);
    }
    found.par_sort_unstable();
    Ok(found)
}

/// Bits of a cell's place along an axis, and most cells along one.
const BITS: u32 = 21;
const MOST_CELLS: f64 = 1e6;

/// 2^64 over the golden ratio: Knuth's multiplicative hashing.
const SPREAD: u64 = 0x9e37_79b9_7f4a_7c15;

fn packed([x, y, z]: [u64; 3]) -> u64 {
    z << (2 * BITS) | y << BITS | x
}

/// Cells hold a few triangles each.
fn cell_size(boxes: &[[DVec3; 2]]) -> Option<f64> {
    let mut sizes: Vec<f64> = boxes.iter().map(|b| (b[1] - b[0]).max_element()).filter(|s| s.is_finite()).collect();
    if sizes.is_empty() {
        return None;
    }
    let mean = sizes.iter().sum::<f64>() / sizes.len() as f64;
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    let size = (2.0 * *median).max(mean);
    Some(if size > 0.0 { size } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::shapes;

    #[test]
    fn sound_shapes_have_none_and_two_crossing_spheres_have_a_ring_of_them() {
        let sphere = shapes::sphere(1.0, 3);
        assert_eq!(self_intersections(&sphere), Vec::<[u32; 2]>::new());
        assert_eq!(self_intersections(&shapes::torus(2.0, 0.7, 48, 24)), Vec::<[u32; 2]>::new());
        let mut two = sphere.clone();
        let n = two.points.len() as u32;
        two.points.extend(sphere.points.iter().map(|p| *p + DVec3::new(0.7, 0.01, 0.02)));
        two.triangles.extend(sphere.triangles.iter().map(|t| t.map(|v| v + n)));
        let pairs = self_intersections(&two);
        assert!(pairs.len() > 60, "{}", pairs.len());
        let count = sphere.triangles.len() as u32;
        assert!(pairs.iter().all(|[a, b]| *a < count && *b >= count));
    }

    #[test]
    fn a_face_turned_over_onto_its_neighbour_is_folded_back_once() {
        let points = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.3, 0.4)].map(|(x, y)| DVec3::new(x, y, 0.0));
        let mesh = TriMesh::new(points.to_vec(), vec![[0, 1, 2], [2, 1, 3]]);
        assert_eq!(folded_back(&mesh, &Adjacency::new(&mesh)).len(), 1);
    }
}
