//! The mesh of an open scan, finished: ragged boundaries and what lies far from all points cut off, small holes closed.
//!
//! A field is known as far as the widest support reaches, so the mesh of an open scan hangs over its data by several
//! spacings and ends in the steps of cells. See `docs/methods/mend.md`, "Open scans".
//! 1. a function is zero on the boundary and where no raw point is near, one elsewhere, and is smoothed over the
//!    surface by means of neighbours; the mesh is cut along one of its level lines ([`mend::trim`]), which takes
//!    steps, tongues and spikes
//! 2. small holes are closed before, so that they do not grow, and after ([`mend::close_holes`])

use super::part_fans;
use crate::geom::KdTree;
use crate::mend;
use crate::mesh::{self, FeatureTags, TriMesh};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;

/// A hole is small if it is at most this share of the diagonal around: less than a thirtieth wide, half of a patch.
const SMALL_HOLE: f64 = 0.1;
/// The surface reaches so many times as far from a raw point as its eighth neighbour is: one and a half times as far as a
/// surface between points has to.
const POINT_REACH: f64 = 2.0;
/// And so many cells, whatever the points: what they say of the next cell is sure.
const LEAST_REACH_CELLS: f64 = 1.5;
/// Neighbours of a raw point that tell its density.
const NEIGHBOURS: usize = 9;
/// Rounds of warming each vertex by its neighbours: cold gets 2.8 cells far, and steps of cells are gone.
const WARMING_ROUNDS: usize = 32;
/// What is colder than this is cut off, the surface being at one and the boundary at zero: a cell of a straight boundary, strips
/// narrower than five.
const COLD: f64 = 0.3;

/// Trims the mesh of an open scan; with `lids` closes its small holes. Returns how many were closed.
/// # Errors
/// [`Cancelled`]; the mesh is then half trimmed.
pub(crate) fn finish(
    mesh: &mut TriMesh,
    tags: &mut FeatureTags,
    points: &[DVec3],
    voxel: f64,
    lids: bool,
    observer: &dyn Observer,
) -> Result<usize, Cancelled> {
    let longest = SMALL_HOLE * mesh.bounds().diagonal();
    part(mesh, tags);
    let seen = mesh.points.len();
    let mut closed = if lids { mend::close_holes(mesh, tags, longest, observer)? } else { 0 };
    let warmth = warmth(mesh, seen, points, voxel, observer)?;
    observer.check()?;
    mend::trim(mesh, tags, &warmth.iter().map(|w| w - COLD).collect::<Vec<f64>>());
    observer.check()?;
    part(mesh, tags);
    if lids {
        closed += mend::close_holes(mesh, tags, longest, observer)?;
    }
    Ok(closed)
}

/// How warm each vertex stays. Vertices from `seen` on belong to lids, which no points stand for.
fn warmth(
    mesh: &TriMesh,
    seen: usize,
    points: &[DVec3],
    voxel: f64,
    observer: &dyn Observer,
) -> Result<Vec<f64>, Cancelled> {
    let adjacency = mesh::Adjacency::new(mesh);
    let tree = KdTree::new(points);
    let reach = reaches(&tree, points, observer)?;
    let cold: Result<Vec<bool>, Cancelled> = (0..mesh.points.len() as u32)
        .into_par_iter()
        .map(|v| {
            observer.check()?;
            let p = mesh.points[v as usize];
            let far = |i: u32| {
                p.distance(points[i as usize]) > (POINT_REACH * reach[i as usize]).max(LEAST_REACH_CELLS * voxel)
            };
            Ok(adjacency.is_boundary_vertex(v) || ((v as usize) < seen && tree.closest(p).is_none_or(far)))
        })
        .collect();
    let cold = cold?;
    let warmth = cold.iter().map(|&c| if c { 0.0 } else { 1.0 }).collect();
    averaged(mesh, warmth, |v| cold[v], WARMING_ROUNDS, observer)
}

/// Values at vertices after rounds that take each half-way to the mean of its neighbours.
/// * `is_held` - vertices that keep theirs
pub(super) fn averaged(
    mesh: &TriMesh,
    mut values: Vec<f64>,
    is_held: impl Fn(usize) -> bool + Sync,
    rounds: usize,
    observer: &dyn Observer,
) -> Result<Vec<f64>, Cancelled> {
    let mut neighbours: Vec<[u32; 2]> =
        mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, a], [b, c], [c, b], [c, a], [a, c]]).collect();
    neighbours.par_sort_unstable();
    neighbours.dedup();
    let mut first = vec![0usize; mesh.points.len() + 1];
    neighbours.iter().for_each(|n| first[n[0] as usize + 1] += 1);
    (0..mesh.points.len()).for_each(|v| first[v + 1] += first[v]);
    for _ in 0..rounds {
        observer.check()?;
        values = (0..mesh.points.len())
            .into_par_iter()
            .map(|v| {
                let around = &neighbours[first[v]..first[v + 1]];
                if is_held(v) || around.is_empty() {
                    return values[v];
                }
                let sum: f64 = around.iter().map(|n| values[n[1] as usize]).sum();
                0.5 * (values[v] + sum / around.len() as f64)
            })
            .collect();
    }
    Ok(values)
}

/// For each raw point the distance of its eighth neighbour; the middle one of those of its neighbours, so that a point that
/// lies alone does not count.
fn reaches(tree: &KdTree, points: &[DVec3], observer: &dyn Observer) -> Result<Vec<f64>, Cancelled> {
    let own = per_point(tree, points, observer, |found| found.last().map_or(0.0, |f| f.0.sqrt()))?;
    per_point(tree, points, observer, |found| {
        let mut around: Vec<f64> = found.iter().map(|f| own[f.1 as usize]).collect();
        around.sort_unstable_by(f64::total_cmp);
        around.get(around.len() / 2).copied().unwrap_or(0.0)
    })
}

/// What `of` makes of the neighbours of each point.
fn per_point(
    tree: &KdTree,
    points: &[DVec3],
    observer: &dyn Observer,
    of: impl Fn(&[(f64, u32)]) -> f64 + Sync,
) -> Result<Vec<f64>, Cancelled> {
    let one = |found: &mut Vec<(f64, u32)>, &p: &DVec3| {
        observer.check()?;
        tree.nearest(p, NEIGHBOURS, found);
        Ok(of(found))
    };
    points.par_iter().map_init(Vec::new, one).collect()
}

/// Parts surfaces that touch in a point, as they do where what is known of a scan ends.
pub(super) fn part(mesh: &mut TriMesh, tags: &mut FeatureTags) {
    let (parted, source) = part_fans(mesh);
    if parted.points.len() == mesh.points.len() {
        return;
    }
    let sharp = |[a, b]: [u32; 2]| {
        let (a, b) = (source[a as usize], source[b as usize]);
        tags.edges.binary_search(&[a.min(b), a.max(b)]).is_ok()
    };
    let sides = parted.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let mut edges: Vec<[u32; 2]> = sides.filter(|s| sharp(*s)).map(|[a, b]| [a.min(b), a.max(b)]).collect();
    edges.sort_unstable();
    edges.dedup();
    *tags = FeatureTags { vertices: source.iter().map(|&v| tags.vertices[v as usize]).collect(), edges };
    *mesh = parted;
}
