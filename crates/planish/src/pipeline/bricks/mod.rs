//! Large scans in bricks: only some of them are worked at a time, so memory grows with the points and not with what is made of
//! them on the way.
//!
//! 1. boxes of at most [`BRICK_POINTS`] points, and samples of each, with a halo ([`cloud::bricks`])
//! 2. one outside for all ([`cloud::bricks::Sides`])
//! 3. the mesh of each brick, some cells beyond it, on one lattice: the field there is that of the cells of all bricks that
//!    reach it, so neighbours extract the same triangles
//! 4. each brick keeps the triangles whose middles it holds; what was one before is one again ([`weld`](self))
//!
//! Bricks follow from the points: memory and threads decide how many are worked at once, and the mesh is the same.
//! See `docs/methods/bricks.md`.

mod weld;

use super::scan::{self, MEASURED_POINTS, ScanError, ScanFacts, ScanMeshed, ScanParams};
use crate::cloud::bricks::{BrickSamples, Partition, Sides, halo};
use crate::cloud::{Cell, Cloud, CloudError, Dipoles, Samples};
use crate::contour::{self, ContourCounts, ContourError, Extracted, Meshed, MeshingError};
use crate::field::{FieldScale, Lattice, SampleField, Spacing, Thin};
use crate::geom::Aabb;
use crate::mesh::TriMesh;
use crate::observe::{Observer, Part};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Arc;
use weld::{Piece, Welder};

/// Points of a brick at most: some 600 along each side, with a halo of 25 that the neighbours work on, too.
pub const BRICK_POINTS: usize = 1 << 19;
/// Bytes of a brick at work, for each of its points: measured at 840.
const WORK_BYTES: u64 = 1000;
/// Bytes for each point of the scan that stay: the point, its number, its share of the samples and of the mesh.
const KEPT_BYTES: u64 = 100;
/// A brick is meshed so many cells beyond its box: lines are found and made even by what is around, and where neighbours find
/// others their triangles do not fit.
const MESH_HALO: usize = 24;
/// Bits of the size of a cell: positions of nodes are whole multiples of it, without rounding.
const CELL_BITS: i32 = 20;

/// Meshes a scan; one of more than [`BRICK_POINTS`] points in bricks.
/// # Errors
/// [`ScanError`].
pub fn mesh_scan(cloud: &Cloud, params: &ScanParams, observer: &dyn Observer) -> Result<ScanMeshed, ScanError> {
    if cloud.points.len() > BRICK_POINTS {
        mesh_in_bricks(cloud, BRICK_POINTS, params, observer)
    } else {
        scan::mesh_at_once(cloud, params, observer)
    }
}

/// Meshes a scan in bricks of at most `most` points.
/// # Errors
/// [`ScanError`].
pub fn mesh_in_bricks(
    cloud: &Cloud,
    most: usize,
    params: &ScanParams,
    observer: &dyn Observer,
) -> Result<ScanMeshed, ScanError> {
    let partition = Partition::new(&cloud.points, most);
    let at_once = bricks_at_once(&partition, params.memory)?;
    let part = |from: f64, to: f64| Part::new(observer, from, to - from);
    let halo = halo(cloud, &partition, &params.clean, &part(0.0, 0.03))?;
    let count = partition.bricks.len();
    let mut samples = Vec::with_capacity(count);
    let cleaned = |k: usize, o: &dyn Observer| {
        let near = cloud.select(&partition.around(&cloud.points, k, halo));
        Ok(BrickSamples::clean(&near, &partition.bricks[k], &params.clean, o)?)
    };
    in_groups(count, at_once, &part(0.03, 0.6), cleaned, |brick| samples.push(brick))?;
    let sides = Sides::new(&partition.bricks, &samples);
    let facts = facts_of(&partition, &samples, &sides);
    if facts.samples == 0 {
        return Err(CloudError::NoSurface { points: partition.order.len() }.into());
    }
    observer.check()?;
    let whole = Whole::new(cloud, (partition, halo), (samples, sides), facts, params)?;
    let mut welder = Welder::new(whole.lattice.step.x);
    let mut counts = ContourCounts::default();
    let (mut mended, mut lids) = (0, 0);
    let meshed = |k: usize, o: &dyn Observer| whole.brick(k, params, o);
    in_groups(count, at_once, &part(0.62, 0.97), meshed, |made| {
        let Some(brick) = made else { return };
        counts += brick.counts;
        mended += brick.mended;
        lids += brick.lids;
        welder.add(brick.piece);
    })?;
    let welded = welder.finish();
    let (mut mesh, mut tags) = (welded.mesh, welded.tags);
    if mesh.triangles.is_empty() {
        return Err(MeshingError::from(ContourError::Nothing { cells: whole.lattice.cells }).into());
    }
    let to_points = scan::distances(&welded.reached);
    let specks = scan::drop_specks(&mut mesh, &mut tags, &welded.reached);
    tags.mark(&mut mesh);
    observer.progress(1.0);
    let extracted = Extracted { mesh, tags, counts };
    let meshed = Meshed { extracted, lattice: whole.lattice, mended, thin: Thin::default() };
    let closed = whole.closed;
    Ok(ScanMeshed { samples: Samples::default(), facts, meshed, bricks: count, specks, closed, lids, to_points })
}

/// How many bricks may be worked at once.
/// # Errors
/// [`ScanError::Memory`] if there is none.
fn bricks_at_once(partition: &Partition, memory: u64) -> Result<usize, ScanError> {
    let points = partition.order.len();
    let largest = partition.bricks.iter().map(|b| b.range.len()).max().unwrap_or(0) as u64;
    let kept = KEPT_BYTES * points as u64;
    let one = WORK_BYTES * largest;
    if kept + one > memory {
        return Err(ScanError::Memory { points, needed: kept + one, allowed: memory });
    }
    Ok(((memory - kept) / one.max(1)).min(rayon::current_num_threads() as u64).max(1) as usize)
}

/// Runs `work` over `0..count`, so many at a time, and gives what it made to `take`, in order.
fn in_groups<T: Send>(
    count: usize,
    at_once: usize,
    observer: &dyn Observer,
    work: impl Fn(usize, &dyn Observer) -> Result<T, ScanError> + Sync,
    mut take: impl FnMut(T),
) -> Result<(), ScanError> {
    for from in (0..count).step_by(at_once) {
        observer.check()?;
        let done = from as f64 / count as f64;
        observer.progress(done);
        let one = |k: usize| work(k, &Part::new(observer, done, 0.0));
        let group = (from..(from + at_once).min(count)).into_par_iter().with_max_len(1);
        for made in group.map(one).collect::<Vec<_>>() {
            take(made?);
        }
    }
    observer.progress(1.0);
    Ok(())
}

/// The facts of all bricks together: of middles the middle, by the samples that each has.
fn facts_of(partition: &Partition, samples: &[BrickSamples], sides: &Sides) -> ScanFacts {
    let count: usize = samples.iter().map(BrickSamples::len).sum();
    let share = |part: f64, of: &dyn Fn(&BrickSamples) -> f64| {
        let mut all: Vec<(f64, usize)> = samples.iter().filter(|s| !s.is_empty()).map(|s| (of(s), s.len())).collect();
        all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut before = 0;
        let reached = |a: &&(f64, usize)| {
            before += a.1;
            before as f64 > part * count as f64
        };
        all.iter().find(reached).map_or(f64::INFINITY, |a| a.0)
    };
    ScanFacts {
        samples: count,
        confidence: samples.iter().map(|s| s.confidence).sum::<f64>() / count.max(1) as f64,
        segments: sides.bodies,
        noise: share(0.5, &|s| s.noise),
        spacing: share(0.5, &|s| s.spacing),
        normal_noise_deg: share(0.5, &|s| s.normal_noise_deg),
        gap: share(0.05, &|s| s.gap),
        diagonal: bounds(partition.bricks.iter().map(|b| b.bounds)).diagonal(),
    }
}

fn bounds(boxes: impl Iterator<Item = Aabb>) -> Aabb {
    Aabb::of(&boxes.flat_map(|b| [b.min, b.max]).collect::<Vec<_>>())
}

/// What every brick needs to be meshed.
struct Whole<'a> {
    cloud: &'a Cloud,
    partition: Partition,
    samples: Vec<BrickSamples>,
    sides: Sides,
    facts: ScanFacts,
    scale: FieldScale,
    lattice: Lattice,
    closed: bool,
    closing: Option<Arc<Dipoles>>,
    /// Width of what the points of a brick are sought in, world units.
    halo: f64,
}

/// The mesh of a brick.
struct Made {
    piece: Piece,
    counts: ContourCounts,
    mended: usize,
    lids: usize,
}

impl<'a> Whole<'a> {
    fn new(
        cloud: &'a Cloud,
        (partition, halo): (Partition, f64),
        (samples, sides): (Vec<BrickSamples>, Sides),
        facts: ScanFacts,
        params: &ScanParams,
    ) -> Result<Whole<'a>, ScanError> {
        let closed = params.close.unwrap_or(sides.closed);
        let dipoles = || samples.iter().zip(&sides.signs).flat_map(|(s, signs)| s.dipoles(signs)).collect::<Vec<_>>();
        let closing = closed.then(|| Arc::new(Dipoles::new(&dipoles())));
        let widest = samples.iter().map(BrickSamples::widest).fold(0.0, f64::max);
        let bounds = bounds(samples.iter().filter(|s| !s.is_empty()).map(BrickSamples::bounds));
        let scale = FieldScale { bounds, widest, noise_deg: facts.normal_noise_deg };
        let around = Aabb { min: bounds.min - 0.5 * widest, max: bounds.max + 0.5 * widest };
        let spacing = params.cells.unwrap_or_else(|| Spacing::Voxel(facts.voxel()));
        let lattice = exact(&Lattice::around(&around, spacing).map_err(MeshingError::from)?);
        let halo = halo.max(MESH_HALO as f64 * lattice.step.x);
        Ok(Whole { cloud, partition, samples, sides, facts, scale, lattice, closed, closing, halo })
    }

    /// The mesh of a brick; nothing where no surface passes it.
    fn brick(&self, k: usize, params: &ScanParams, observer: &dyn Observer) -> Result<Option<Made>, ScanError> {
        let [low, high] = self.cells_of(k);
        let from = low.map(|n| n.saturating_sub(MESH_HALO));
        let to = [0, 1, 2].map(|a| (high[a] + MESH_HALO).min(self.lattice.cells[a]));
        if (0..3).any(|a| low[a] >= high[a]) {
            return Ok(None);
        }
        let Lattice { step, .. } = self.lattice;
        let lattice = Lattice {
            origin: self.lattice.node(from[0], from[1], from[2]),
            step,
            cells: [0, 1, 2].map(|a| to[a] - from[a]),
        };
        lattice.check_memory(None, params.memory).map_err(MeshingError::from)?;
        let mut cells: Vec<Cell> = Vec::new();
        for (s, signs) in self.samples.iter().zip(&self.sides.signs) {
            s.reaching(&lattice.bounds(), signs, &mut cells);
        }
        if cells.is_empty() {
            return Ok(None);
        }
        let field = SampleField::of_cells(&cells, &self.scale, self.closing.clone());
        let mut meshed = match contour::on_lattice(&field, &lattice, &params.contour, observer) {
            Ok(meshed) => meshed,
            Err(MeshingError::Contour(ContourError::Nothing { .. })) => return Ok(None),
            Err(e) => return Err(e.into()),
        };
        drop((field, cells));
        let near: Vec<DVec3> = self
            .partition
            .around(&self.cloud.points, k, self.halo)
            .into_iter()
            .map(|i| self.cloud.points[i as usize])
            .collect();
        let lids = scan::complete(&mut meshed, &self.facts, (&near, self.closed), params, observer)?;
        let own: Vec<DVec3> = self.partition.order[self.partition.bricks[k].range.clone()]
            .iter()
            .map(|&i| self.cloud.points[i as usize])
            .collect();
        let step = self.partition.order.len().div_ceil(MEASURED_POINTS).max(1);
        let reached = scan::reach(&own, step, &meshed.extracted.mesh, observer)?;
        let inner = [low, high].map(|n| self.lattice.node(n[0], n[1], n[2]));
        let kept = self.kept(&meshed.extracted.mesh, low, high, inner);
        let Extracted { mesh, tags, counts } = meshed.extracted;
        Ok(Some(Made { piece: Piece::cut(mesh, tags, &kept, &reached), counts, mended: meshed.mended, lids }))
    }

    /// The cells of a brick: from, and up to, along each axis.
    fn cells_of(&self, k: usize) -> [[usize; 3]; 2] {
        let Aabb { min, max } = self.partition.bricks[k].aabb;
        [min, max].map(|p| {
            [0, 1, 2].map(|a| {
                let n = ((p[a] - self.lattice.origin[a]) / self.lattice.step[a]).ceil();
                n.clamp(0.0, self.lattice.cells[a] as f64) as usize
            })
        })
    }

    /// Whether each triangle has its middle in the box of a brick, which has no end where the lattice ends.
    fn kept(&self, mesh: &TriMesh, low: [usize; 3], high: [usize; 3], inner: [DVec3; 2]) -> Vec<bool> {
        let middle_in = |t: usize| {
            let middle = mesh.corners(t).iter().sum::<DVec3>() / 3.0;
            (0..3).all(|a| {
                (low[a] == 0 || middle[a] >= inner[0][a])
                    && (high[a] == self.lattice.cells[a] || middle[a] < inner[1][a])
            })
        };
        (0..mesh.triangles.len()).map(middle_in).collect()
    }
}

/// The same lattice with cells a little larger, of so few bits that all nodes are placed without rounding: parts of it have the
/// same nodes.
fn exact(lattice: &Lattice) -> Lattice {
    let h = lattice.step.x;
    let unit = 2f64.powi(h.log2().floor() as i32 - CELL_BITS);
    let h = (h / unit).ceil() * unit;
    Lattice { origin: (lattice.origin / h).floor() * h, step: DVec3::splat(h), cells: lattice.cells.map(|n| n + 1) }
}
