//! Large scans in bricks: only some of them are worked at a time, so memory grows with the points and not with what is made of
//! them on the way.
//!
//! 1. boxes of at most [`BRICK_POINTS`] points, and samples of each, with a halo ([`cloud::bricks`])
//! 2. one outside for all ([`cloud::bricks::Sides`])
//! 3. the mesh of each brick, some cells beyond it, on one lattice: the field there is that of the cells of all bricks that
//!    reach it, so neighbours extract the same triangles
//! 4. each brick keeps the triangles whose middles it holds; what was one before is one again ([`weld`](self))
//! 5. the points of each brick on the surface ([`project_bricks`])
//!
//! Bricks follow from the points: memory and threads decide how many are worked at once, and the mesh is the same.
//! See `docs/methods/bricks.md`.

mod weld;

use super::scan::{self, MEASURED_POINTS, ScanError, ScanFacts, ScanMeshed, ScanParams};
use crate::cloud::bricks::{
    Brick, BrickFacts, BrickSamples, BrickStore, CloudStore, Sides, StoreError, bounds_of, bring, halo, points_of,
};
use crate::cloud::{
    Brought, Cell, CleanParams, Cleaned, Cloud, CloudError, Dipoles, Gathered, PointFacts, PointScale, Samples,
};
use crate::contour::{self, ContourCounts, ContourError, Extracted, Meshed, MeshingError};
use crate::field::{FieldScale, Lattice, SampleField, Spacing, Thin};
use crate::geom::Aabb;
use crate::mesh::TriMesh;
use crate::observe::{Observer, Part};
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use weld::{Piece, Welder};

/// Points of a brick at most: some 600 along each side, with a halo of 25 that the neighbours work on, too.
pub const BRICK_POINTS: usize = 1 << 19;
/// Bytes of a brick at work, for each of its points: measured at 840.
const WORK_BYTES: u64 = 1000;
/// Bytes of the mesh for each point of the scan.
const MESH_BYTES: u64 = 40;
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
        mesh_bricks(&CloudStore::new(cloud, BRICK_POINTS), params, observer)
    } else {
        scan::mesh_at_once(cloud, params, observer)
    }
}

/// Meshes a scan that lies in bricks.
/// # Errors
/// [`ScanError`].
pub fn mesh_bricks(
    store: &dyn BrickStore,
    params: &ScanParams,
    observer: &dyn Observer,
) -> Result<ScanMeshed, ScanError> {
    let plan = clean_bricks(store, params, &Part::new(observer, 0.0, 0.62))?;
    mesh_planned(store, &plan, params, &Part::new(observer, 0.62, 0.38))
}

/// As [`mesh_bricks`], for bricks that are clean.
/// # Errors
/// [`ScanError`].
pub fn mesh_planned(
    store: &dyn BrickStore,
    plan: &BrickPlan,
    params: &ScanParams,
    observer: &dyn Observer,
) -> Result<ScanMeshed, ScanError> {
    let mut welding = BrickWelder::new(plan);
    let meshed = |k: usize, o: &dyn Observer| plan.mesh(store, k, params, o);
    in_groups(store, params, &Part::new(observer, 0.0, 0.92), meshed, |made| {
        welding.add(made);
        Ok(())
    })?;
    let made = welding.finish()?;
    observer.progress(1.0);
    Ok(made)
}

/// Cleans all bricks, and settles what one cannot know.
/// # Errors
/// [`ScanError`].
pub fn clean_bricks(
    store: &dyn BrickStore,
    params: &ScanParams,
    observer: &dyn Observer,
) -> Result<BrickPlan, ScanError> {
    bricks_at_once(store, params.memory)?;
    let halo = halo(store, &params.clean, &Part::new(observer, 0.0, 0.05))?;
    let cleaned = |k: usize, o: &dyn Observer| Ok(clean_brick(store, k, halo, &params.clean, o)?);
    in_groups(store, params, &Part::new(observer, 0.05, 0.94), cleaned, |()| Ok(()))?;
    let plan = BrickPlan::new(store, halo, params)?;
    observer.check()?;
    observer.progress(1.0);
    Ok(plan)
}

/// What takes the points of a scan, brick by brick: as they came, and as they are on the surface.
pub type TakePoints<'a> = dyn FnMut(&Cloud, Cleaned) -> Result<(), StoreError> + 'a;

/// Brings the points of a scan in bricks to its surface.
/// * `plan` - as of [`clean_bricks`]
/// # Errors
/// [`ScanError`], or what `take` says.
pub fn project_bricks(
    store: &dyn BrickStore,
    plan: &BrickPlan,
    params: &ScanParams,
    take: &mut TakePoints,
    observer: &dyn Observer,
) -> Result<PointFacts, ScanError> {
    let mut gathered = Gathered::new(plan.facts.spacing, &params.points);
    let brought = |k: usize, o: &dyn Observer| plan.brought(store, k, params, o);
    in_groups(store, params, observer, brought, |(cloud, brought)| {
        let cleaned = gathered.add(&cloud, brought);
        take(&cloud, cleaned).map_err(|e| ScanError::Cloud(e.into()))
    })?;
    Ok(gathered.finish())
}

/// Cleans a brick and keeps its samples.
/// * `halo` - as of [`halo`]
/// # Errors
/// [`CloudError`].
pub fn clean_brick(
    store: &dyn BrickStore,
    brick: usize,
    halo: f64,
    params: &CleanParams,
    observer: &dyn Observer,
) -> Result<(), CloudError> {
    let near = store.around(brick, halo)?;
    let samples = BrickSamples::clean(&near, &store.bricks()[brick], params, observer)?;
    Ok(store.keep(brick, samples)?)
}

/// How many bricks may be worked at once.
/// # Errors
/// [`ScanError::Memory`] if there is none.
fn bricks_at_once(store: &dyn BrickStore, memory: u64) -> Result<usize, ScanError> {
    let points = points_of(store.bricks());
    let largest = store.bricks().iter().map(|b| b.range.len()).max().unwrap_or(0) as u64;
    let kept = (store.held() + MESH_BYTES) * points as u64;
    let one = WORK_BYTES * largest;
    if kept + one > memory {
        return Err(ScanError::Memory { points, needed: kept + one, allowed: memory });
    }
    Ok(((memory - kept) / one.max(1)).min(rayon::current_num_threads() as u64).max(1) as usize)
}

/// Runs `work` over all bricks, as many at a time as memory allows, and gives what it made to `take`, in order.
fn in_groups<T: Send>(
    store: &dyn BrickStore,
    params: &ScanParams,
    observer: &dyn Observer,
    work: impl Fn(usize, &dyn Observer) -> Result<T, ScanError> + Sync,
    mut take: impl FnMut(T) -> Result<(), ScanError>,
) -> Result<(), ScanError> {
    let (count, at_once) = (store.bricks().len(), bricks_at_once(store, params.memory)?);
    for from in (0..count).step_by(at_once) {
        observer.check()?;
        let done = from as f64 / count as f64;
        observer.progress(done);
        let one = |k: usize| work(k, &Part::new(observer, done, 0.0));
        let group = (from..(from + at_once).min(count)).into_par_iter().with_max_len(1);
        for made in group.map(one).collect::<Vec<_>>() {
            take(made?)?;
        }
    }
    observer.progress(1.0);
    Ok(())
}

/// What every brick needs to be meshed: what was settled for all of them.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct BrickPlan {
    bricks: Vec<Brick>,
    /// Of each brick the box that its cells reach.
    reach: Vec<Aabb>,
    sides: Sides,
    facts: ScanFacts,
    scale: FieldScale,
    lattice: Lattice,
    closed: bool,
    closing: Option<Arc<Dipoles>>,
    /// Width of the border that the fits of a brick reach into, and of the one that its mesh does, world units.
    fit_halo: f64,
    mesh_halo: f64,
}

/// The mesh of a brick; nothing where no surface passes it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct BrickMesh {
    piece: Option<Piece>,
    counts: ContourCounts,
    mended: usize,
    lids: usize,
}

impl BrickPlan {
    /// Settles what one brick cannot know: sides, lattice, whether holes are closed.
    /// * `store` - with the samples of all bricks
    /// * `halo` - that they were made with
    /// # Errors
    /// [`ScanError`] if there are no samples, or if they cannot be read.
    pub fn new(store: &dyn BrickStore, halo: f64, params: &ScanParams) -> Result<BrickPlan, ScanError> {
        let bricks = store.bricks().to_vec();
        let bad = |e: StoreError| ScanError::Cloud(e.into());
        let each = (0..bricks.len()).map(|k| store.facts(k)).collect::<Result<Vec<BrickFacts>, _>>().map_err(bad)?;
        let sides = Sides::new(store).map_err(bad)?;
        let facts = facts_of(&bricks, &each, &sides);
        if facts.samples == 0 {
            return Err(CloudError::NoSurface { points: points_of(&bricks) }.into());
        }
        let closed = params.close.unwrap_or(sides.closed);
        let mut dipoles = Vec::new();
        for k in (0..bricks.len()).filter(|_| closed) {
            dipoles.extend(store.stands(k).map_err(bad)?.dipoles(&sides.signs[k]));
        }
        let closing = closed.then(|| Arc::new(Dipoles::new(&dipoles)));
        let widest = each.iter().map(|f| f.widest).fold(0.0, f64::max);
        let bounds = bounds(each.iter().filter(|f| f.samples > 0).map(|f| f.bounds));
        let scale = FieldScale { bounds, widest, noise_deg: facts.normal_noise_deg };
        let around = Aabb { min: bounds.min - 0.5 * widest, max: bounds.max + 0.5 * widest };
        let spacing = params.cells.unwrap_or_else(|| Spacing::Voxel(facts.voxel()));
        let lattice = exact(&Lattice::around(&around, spacing).map_err(MeshingError::from)?);
        let mesh_halo = halo.max(MESH_HALO as f64 * lattice.step.x);
        let reach = bricks.iter().zip(&each).map(|(b, f)| b.reach(f.widest)).collect();
        Ok(BrickPlan { bricks, reach, sides, facts, scale, lattice, closed, closing, fit_halo: halo, mesh_halo })
    }

    /// What is known of all bricks together.
    pub fn facts(&self) -> &ScanFacts {
        &self.facts
    }

    /// Number of bricks.
    pub fn bricks(&self) -> usize {
        self.bricks.len()
    }

    /// The points of a brick on the surface, with what is known of them alone.
    /// # Errors
    /// [`ScanError`].
    pub fn project(
        &self,
        store: &dyn BrickStore,
        k: usize,
        params: &ScanParams,
        observer: &dyn Observer,
    ) -> Result<Cleaned, ScanError> {
        let (cloud, brought) = self.brought(store, k, params, observer)?;
        let mut gathered = Gathered::new(self.facts.spacing, &params.points);
        let cleaned = gathered.add(&cloud, brought);
        Ok(Cleaned { facts: gathered.finish(), ..cleaned })
    }

    fn brought(
        &self,
        store: &dyn BrickStore,
        k: usize,
        params: &ScanParams,
        observer: &dyn Observer,
    ) -> Result<(Cloud, Brought), ScanError> {
        let ScanFacts { noise, spacing, diagonal, .. } = self.facts;
        let scale = PointScale { noise, spacing, diagonal, outlier: params.clean.outlier };
        Ok(bring(store, k, (&self.sides, self.fit_halo), &scale, observer)?)
    }

    /// The mesh of a brick.
    /// # Errors
    /// [`ScanError`].
    pub fn mesh(
        &self,
        store: &dyn BrickStore,
        k: usize,
        params: &ScanParams,
        observer: &dyn Observer,
    ) -> Result<BrickMesh, ScanError> {
        let [low, high] = self.cells_of(k);
        let from = low.map(|n| n.saturating_sub(MESH_HALO));
        let to = [0, 1, 2].map(|a| (high[a] + MESH_HALO).min(self.lattice.cells[a]));
        if (0..3).any(|a| low[a] >= high[a]) {
            return Ok(BrickMesh::default());
        }
        let Lattice { step, .. } = self.lattice;
        let lattice = Lattice {
            origin: self.lattice.node(from[0], from[1], from[2]),
            step,
            cells: [0, 1, 2].map(|a| to[a] - from[a]),
        };
        lattice.check_memory(None, params.memory).map_err(MeshingError::from)?;
        let here = lattice.bounds();
        let mut cells: Vec<Cell> = Vec::new();
        for j in (0..self.bricks.len()).filter(|&j| self.reach[j].meets(&here)) {
            store.cells(j).map_err(CloudError::from)?.reaching(&here, &self.sides.signs[j], &mut cells);
        }
        if cells.is_empty() {
            return Ok(BrickMesh::default());
        }
        let field = SampleField::of_cells(&cells, &self.scale, self.closing.clone());
        let mut meshed = match contour::on_lattice(&field, &lattice, &params.contour, observer) {
            Ok(meshed) => meshed,
            Err(MeshingError::Contour(ContourError::Nothing { .. })) => return Ok(BrickMesh::default()),
            Err(e) => return Err(e.into()),
        };
        drop((field, cells));
        let near = store.around(k, self.mesh_halo).map_err(CloudError::from)?.points;
        let lids = scan::complete(&mut meshed, &self.facts, (&near, self.closed), params, observer)?;
        let own: Vec<DVec3> = near.into_iter().filter(|p| self.bricks[k].holds(*p)).collect();
        let step = points_of(&self.bricks).div_ceil(MEASURED_POINTS).max(1);
        let reached = scan::reach(&own, step, &meshed.extracted.mesh, observer)?;
        let inner = [low, high].map(|n| self.lattice.node(n[0], n[1], n[2]));
        let kept = self.kept(&meshed.extracted.mesh, low, high, inner);
        let Extracted { mesh, tags, counts } = meshed.extracted;
        let piece = Some(Piece::cut(mesh, tags, &kept, &reached));
        Ok(BrickMesh { piece, counts, mended: meshed.mended, lids })
    }

    /// The cells of a brick: from, and up to, along each axis.
    fn cells_of(&self, k: usize) -> [[usize; 3]; 2] {
        let Aabb { min, max } = self.bricks[k].aabb;
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

/// The facts of all bricks together: of middles the middle, by the samples that each has.
fn facts_of(bricks: &[Brick], each: &[BrickFacts], sides: &Sides) -> ScanFacts {
    let count: usize = each.iter().map(|f| f.samples).sum();
    let share = |part: f64, of: &dyn Fn(&BrickFacts) -> f64| {
        let mut all: Vec<(f64, usize)> = each.iter().filter(|f| f.samples > 0).map(|f| (of(f), f.samples)).collect();
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
        confidence: each.iter().map(|f| f.confidence).sum::<f64>() / count.max(1) as f64,
        segments: sides.bodies,
        noise: share(0.5, &|f| f.noise),
        spacing: share(0.5, &|f| f.spacing),
        normal_noise_deg: share(0.5, &|f| f.normal_noise_deg),
        gap: share(0.05, &|f| f.gap),
        diagonal: bounds_of(bricks).diagonal(),
    }
}

fn bounds(boxes: impl Iterator<Item = Aabb>) -> Aabb {
    Aabb::of(&boxes.flat_map(|b| [b.min, b.max]).collect::<Vec<_>>())
}

/// Meshes of bricks on their way to be one.
pub struct BrickWelder<'a> {
    plan: &'a BrickPlan,
    welder: Welder,
    counts: ContourCounts,
    mended: usize,
    lids: usize,
}

impl<'a> BrickWelder<'a> {
    /// Nothing yet.
    pub fn new(plan: &'a BrickPlan) -> BrickWelder<'a> {
        let welder = Welder::new(plan.lattice.step.x);
        BrickWelder { plan, welder, counts: ContourCounts::default(), mended: 0, lids: 0 }
    }

    /// Adds the mesh of a brick. They come in the order of the bricks, or the mesh is another one.
    pub fn add(&mut self, made: BrickMesh) {
        self.counts += made.counts;
        self.mended += made.mended;
        self.lids += made.lids;
        if let Some(piece) = made.piece {
            self.welder.add(piece);
        }
    }

    /// The mesh of the scan.
    /// # Errors
    /// [`ContourError::Nothing`] if no brick has a surface.
    pub fn finish(self) -> Result<ScanMeshed, ScanError> {
        let BrickPlan { facts, lattice, closed, bricks, .. } = self.plan;
        let welded = self.welder.finish();
        let (mut mesh, mut tags) = (welded.mesh, welded.tags);
        if mesh.triangles.is_empty() {
            return Err(MeshingError::from(ContourError::Nothing { cells: lattice.cells }).into());
        }
        let to_points = scan::distances(&welded.reached);
        let specks = scan::drop_specks(&mut mesh, &mut tags, &welded.reached);
        tags.mark(&mut mesh);
        let extracted = Extracted { mesh, tags, counts: self.counts };
        Ok(ScanMeshed {
            samples: Samples::default(),
            facts: *facts,
            meshed: Meshed { extracted, lattice: *lattice, mended: self.mended, thin: Thin::default() },
            bricks: bricks.len(),
            specks,
            closed: *closed,
            lids: self.lids,
            to_points,
        })
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
