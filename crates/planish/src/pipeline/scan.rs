//! From a scan to a mesh: samples, their field, its surface.
//!
//! See `docs/methods/samples.md`, section 9, and `docs/methods/sharp.md`.

use super::key;
use super::record::Figure;
use super::{Fitted, PipelineParams, Quality, Warning};
use crate::cloud::{self, CleanParams, Cloud, CloudError, PointFacts, ProjectParams, Samples};
use crate::contour::{self, ContourParams, Meshed, MeshingError, Sampling};
use crate::field::{SampleField, Spacing};
use crate::geom::Bvh;
use crate::grid::GridParams;
use crate::layout;
use crate::mend::{MendParams, finish};
use crate::mesh::sets::Sets;
use crate::mesh::{FeatureTags, TriMesh};
use crate::observe::{Cancelled, Observer, Part};
use crate::sharp::{self, ScanScale};
use crate::surface::{FitParams, KnotSpacing, Resolution};
use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Why a scan gives no mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ScanError {
    /// No samples.
    #[error(transparent)]
    Cloud(#[from] CloudError),
    /// No surface.
    #[error(transparent)]
    Mesh(#[from] MeshingError),
    /// More points than memory allows.
    #[error("{points} points need about {} MB, {} MB are allowed; allow more memory or thin the scan", needed >> 20, allowed >> 20)]
    Memory {
        /// Number of points.
        points: usize,
        /// Bytes needed, about.
        needed: u64,
        /// Bytes allowed.
        allowed: u64,
    },
    /// The observer no longer wanted the result.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// How a scan is meshed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ScanParams {
    /// The samples
    pub clean: CleanParams,
    /// The extraction
    pub contour: ContourParams,
    /// The points that come along with the mesh
    pub points: ProjectParams,
    /// Size of the cells; from spacing and noise of the scan if not given
    pub cells: Option<Spacing>,
    /// Close all holes (true), leave them open (false), or as the scan is if not given: those of a closed one are closed,
    /// of an open one the small ones
    #[schemars(extend("by_hand" = true))]
    pub close: Option<bool>,
    /// Memory that may be used
    #[schemars(extend("unit" = "bytes", "by_hand" = true))]
    pub memory: u64,
}

impl Default for ScanParams {
    /// Eight gigabytes.
    fn default() -> ScanParams {
        ScanParams {
            clean: CleanParams::default(),
            contour: ContourParams::default(),
            points: ProjectParams::default(),
            cells: None,
            close: None,
            memory: 8 << 30,
        }
    }
}

/// What is known of all samples of a scan together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ScanFacts {
    /// Number of samples.
    pub samples: usize,
    /// Mean of their confidence, 0 to 1.
    pub confidence: f64,
    /// Number of bodies.
    pub segments: usize,
    /// Standard deviation of the points, world units.
    pub noise: f64,
    /// Distance of neighbouring points, world units.
    pub spacing: f64,
    /// Typical error of the normals, degrees.
    pub normal_noise_deg: f64,
    /// Distance of sheets side by side, as of [`Samples::gap`].
    pub gap: f64,
    /// Bounding-box diagonal of the points, world units.
    pub diagonal: f64,
}

impl ScanFacts {
    /// The facts of samples.
    pub fn of(samples: &Samples) -> ScanFacts {
        let count = samples.samples.len();
        ScanFacts {
            samples: count,
            confidence: samples.samples.iter().map(|s| s.confidence).sum::<f64>() / count.max(1) as f64,
            segments: samples.closed.len(),
            noise: samples.noise,
            spacing: samples.spacing,
            normal_noise_deg: samples.normal_noise_deg,
            gap: samples.gap,
            diagonal: samples.diagonal,
        }
    }

    /// The edge of a cell that suits the samples.
    pub fn voxel(&self) -> f64 {
        let usual = (CELL_SPACINGS * self.spacing).max(CELL_NOISE * self.noise);
        let gap = if self.gap < TWICE * self.noise { f64::INFINITY } else { self.gap };
        usual.min(CELL_GAPS * gap).max(FINEST_CELL * usual)
    }

    /// How closely a surface is fitted to the scan, as a share of the diagonal.
    fn fit_tolerance(&self) -> f64 {
        (FIT_NOISE * self.noise / self.diagonal).max(FIT_CLOSEST)
    }
}

/// What [`super::mesh_scan`] makes.
#[derive(Clone, Debug)]
pub struct ScanMeshed {
    /// The samples; none if the scan was meshed in bricks.
    pub samples: Samples,
    /// What is known of them together.
    pub facts: ScanFacts,
    /// The mesh, without specks.
    pub meshed: Meshed,
    /// Bricks that it was made in; 0 if in one piece.
    pub bricks: usize,
    /// Specks that were left out.
    pub specks: usize,
    /// Whether holes were closed.
    pub closed: bool,
    /// Small holes of an open scan that got a lid.
    pub lids: usize,
    /// Root mean square and mean distance of the raw points to the mesh, world units.
    pub to_points: (f64, f64),
}

/// A cell is this many spacings wide: the samples say nothing finer.
const CELL_SPACINGS: f64 = 1.6;
/// A cell is this many noise levels wide.
const CELL_NOISE: f64 = 1.0;
/// Cells are at most this many gaps between close sheets wide: walls thinner than a cell break.
const CELL_GAPS: f64 = 0.6;
/// Sheets closer than this many noise levels are one that was scanned twice, the scans a little apart.
const TWICE: f64 = 2.5;
/// But not finer than this share of what suits the points: 16 times as many cells.
const FINEST_CELL: f64 = 0.25;
/// Components below this share of the area of the largest are specks of noise.
const SPECK_AREA: f64 = 0.005;
/// So are those with less than this share of the points that their area has elsewhere: what a blend leaves beside the data.
const BARE_SPECK: f64 = 0.1;
/// Raw points that are measured against the mesh.
pub(super) const MEASURED_POINTS: usize = 50_000;

/// The edge of a cell that suits the samples.
pub fn voxel_for(samples: &Samples) -> f64 {
    ScanFacts::of(samples).voxel()
}

/// The field of the samples of a scan, and whether its holes are closed.
pub fn field_of(samples: &Samples, params: &ScanParams) -> (SampleField, bool) {
    let closed = params.close.unwrap_or_else(|| samples.closed.first().copied().unwrap_or(false));
    (SampleField::new(samples, closed), closed)
}

/// Meshes a scan of any size as a whole.
/// # Errors
/// [`ScanError`].
pub(super) fn mesh_at_once(
    scan: &Cloud,
    params: &ScanParams,
    observer: &dyn Observer,
) -> Result<ScanMeshed, ScanError> {
    let samples = cloud::clean(scan, &params.clean, &Part::new(observer, 0.0, 0.6))?;
    mesh_samples(scan, samples, params, &Part::new(observer, 0.6, 0.4))
}

/// Meshes the samples of a scan: [`super::mesh_scan`] from there on, as a whole.
/// * `scan` - the points that the samples were made from
/// # Errors
/// [`ScanError`].
pub fn mesh_samples(
    scan: &Cloud,
    samples: Samples,
    params: &ScanParams,
    observer: &dyn Observer,
) -> Result<ScanMeshed, ScanError> {
    let (field, closed) = field_of(&samples, params);
    let facts = ScanFacts::of(&samples);
    let spacing = params.cells.unwrap_or_else(|| Spacing::Voxel(facts.voxel()));
    let sampling = Sampling { spacing, memory: params.memory };
    let mut meshed = contour::from_field(&field, sampling, &params.contour, &Part::new(observer, 0.0, 0.88))?;
    let lids = complete(&mut meshed, &facts, (&scan.points, closed), params, &Part::new(observer, 0.88, 0.1))?;
    let step = scan.points.len().div_ceil(MEASURED_POINTS).max(1);
    let mut reached = reach(&scan.points, step, &meshed.extracted.mesh, observer)?;
    let specks = drop_specks(&mut meshed.extracted.mesh, &mut meshed.extracted.tags, &reached);
    if specks > 0 {
        reached = reach(&scan.points, step, &meshed.extracted.mesh, observer)?;
    }
    observer.progress(1.0);
    let to_points = distances(&reached);
    Ok(ScanMeshed { samples, facts, meshed, bricks: 0, specks, closed, lids, to_points })
}

/// Root mean square and mean of what [`reach`] found.
pub(super) fn distances(reached: &[(f64, u32)]) -> (f64, f64) {
    let n = reached.len().max(1) as f64;
    let squares = reached.iter().map(|r| r.0 * r.0).sum::<f64>();
    ((squares / n).sqrt(), reached.iter().map(|r| r.0).sum::<f64>() / n)
}

/// Takes the mesh of a scan from its extraction to its sharp lines. Returns how many small holes got a lid.
/// * `scan` - the points, and whether their holes are closed
pub(super) fn complete(
    meshed: &mut Meshed,
    facts: &ScanFacts,
    scan: (&[DVec3], bool),
    params: &ScanParams,
    observer: &dyn Observer,
) -> Result<usize, ScanError> {
    let (points, closed) = scan;
    let cell = meshed.lattice.step.x;
    let contour::Extracted { mesh, tags, .. } = &mut meshed.extracted;
    let mut lids = 0;
    if !closed {
        let points: Vec<DVec3> = points.iter().copied().filter(|p| p.is_finite()).collect();
        lids = finish(mesh, tags, &points, cell, params.close.is_none(), observer)?;
    }
    observer.progress(0.2);
    let scale = ScanScale { noise: facts.noise, spacing: facts.spacing, cell };
    if !params.contour.plain {
        sharp::find_lines(mesh, tags, &scale, params.contour.sharp.acos(), observer)?;
    }
    sharp::tidy_lines(mesh, tags, &scale, observer)?;
    sharp::fair_lines(mesh, tags, &scale, observer)?;
    sharp::tidy_lines(mesh, tags, &scale, observer)?;
    observer.progress(0.8);
    sharp::split_bent(mesh, tags, BENT_TOLERANCE * facts.fit_tolerance() * facts.diagonal, observer)?;
    tags.mark(mesh);
    observer.progress(1.0);
    Ok(lids)
}

/// A surface fitted to a scan follows its mesh along the normal to this share of the noise, within these shares of the diagonal:
/// a quarter of what kept distances at equal parameters as near, of which most goes sideways.
const FIT_NOISE: f64 = 0.125;
const FIT_CLOSEST: f64 = 5e-5;
const FIT_FARTHEST: f64 = 2.5e-4;
/// Edges of the mesh of a scan that pass more than this share of that beside the surface are split.
const BENT_TOLERANCE: f64 = 0.8;
/// Smoothing at noise of a thousandth of the diagonal; it goes with the square of the noise, as in Wiener's filter. Less leaves
/// the noise beside sharp edges, more flattens what bends there.
const FIT_SMOOTHING: f64 = 0.05;

/// Grids of the mesh of a scan have so many points, but at most so many per vertex: beside its sharp edges the surface
/// is mended within two cells, and what a coarse grid leaves out there is angle of the edge.
const GRID_POINTS: f64 = 3e5;
const GRID_DENSITY: f64 = 6.0;

/// Half of the width that is kept everywhere where borders of scans are cut even, in sides of a patch of a typical layout. Chosen.
const BORDER_TO_SIDE: f64 = 0.2;

/// The parameters that suit the mesh of a scan: how even its borders are made, how fine its grids are, and how closely surfaces are fitted to it.
pub fn params_for(made: &ScanMeshed) -> PipelineParams {
    let usual = PipelineParams::default();
    let noise = made.facts.noise / made.facts.diagonal;
    let resolution = match usual.fit.resolution {
        Resolution::Tolerance(most) => Resolution::Tolerance(made.facts.fit_tolerance().min(FIT_FARTHEST).min(most)),
        other => other,
    };
    let smoothing = (FIT_SMOOTHING * (noise / 1e-3).powi(2)).clamp(usual.fit.smoothing, 1.0);
    let vertices = made.meshed.extracted.mesh.points.len().max(1);
    let density = (GRID_POINTS / vertices as f64).min(GRID_DENSITY).max(usual.grid.density);
    let mesh = &made.meshed.extracted.mesh;
    let area: f64 = (0..mesh.triangles.len()).map(|f| mesh.area(f)).sum();
    let side = (area / layout::TYPICAL_PATCHES).sqrt();
    let even_border = (BORDER_TO_SIDE * side / mesh.bounds().diagonal()).min(1.0);
    PipelineParams {
        mend: MendParams { even_border },
        fit: FitParams { resolution, smoothing, knots: KnotSpacing::Even, ..usual.fit },
        grid: GridParams { density, denser_rounds: 0, ..usual.grid },
        ..usual
    }
}

/// Leaves out the components whose area is next to nothing, or which hardly any point stands for; returns how many.
pub(super) fn drop_specks(mesh: &mut TriMesh, tags: &mut FeatureTags, reached: &[(f64, u32)]) -> usize {
    let mut sets = Sets::new(mesh.points.len());
    for t in &mesh.triangles {
        sets.join(t[0], t[1]);
        sets.join(t[0], t[2]);
    }
    let label: Vec<u32> = (0..mesh.points.len() as u32).map(|i| sets.root(i)).collect();
    let component = |face: usize| label[mesh.triangles[face][0] as usize] as usize;
    let mut area = vec![0.0; mesh.points.len()];
    (0..mesh.triangles.len()).for_each(|t| area[component(t)] += mesh.area(t));
    let mut points = vec![0.0; mesh.points.len()];
    reached.iter().for_each(|r| points[component(r.1 as usize)] += 1.0);
    let most = area.iter().copied().fold(0.0, f64::max);
    let density = reached.len() as f64 / area.iter().sum::<f64>();
    let stays = |v: u32| {
        let c = label[v as usize] as usize;
        area[c] >= SPECK_AREA * most && points[c] >= BARE_SPECK * density * area[c]
    };
    let specks = (0..label.len()).filter(|&i| label[i] == i as u32 && area[i] > 0.0 && !stays(i as u32)).count();
    if specks == 0 {
        return 0;
    }
    let stays: Vec<bool> = (0..mesh.points.len() as u32).map(stays).collect();
    tags.keep(mesh, &stays);
    specks
}

/// Distance of every `step`th raw point to a mesh, and the face that is closest.
pub(super) fn reach(
    points: &[DVec3],
    step: usize,
    mesh: &TriMesh,
    observer: &dyn Observer,
) -> Result<Vec<(f64, u32)>, Cancelled> {
    if mesh.triangles.is_empty() {
        return Ok(Vec::new());
    }
    let bvh = Bvh::watched(mesh, observer)?;
    let finite: Vec<_> = points.iter().step_by(step).filter(|p| p.is_finite()).collect();
    let one = |p: &&DVec3| {
        observer.check()?;
        let hit = bvh.closest(**p);
        Ok((hit.distance, hit.place.face))
    };
    finite.par_iter().map(one).collect()
}

/// The figures and warnings of a scan that was meshed.
pub fn scan_figures(made: &ScanMeshed, quality: &mut Quality, warnings: &mut Vec<Warning>) {
    sample_figures(&made.facts, quality, warnings);
    if made.bricks > 0 {
        quality.insert(key::SCAN_BRICKS.into(), Figure::Count(made.bricks as u64));
    }
    quality.insert(key::SCAN_SPECKS.into(), Figure::Count(made.specks as u64));
    quality.insert(key::SCAN_CLOSED.into(), Figure::Flag(made.closed));
    quality.insert(key::SCAN_LIDS.into(), Figure::Count(made.lids as u64));
    for (key, x) in [("rms", made.to_points.0), ("mean", made.to_points.1)] {
        quality.insert(format!("scan.to_mesh_{key}"), Figure::Number(x));
        quality.insert(format!("scan.to_mesh_{key}_rel"), Figure::Number(x / made.facts.diagonal));
    }
}

/// The figures and warnings of a scan in a run, among those of its model.
/// * `diagonal` - of the mesh
pub(super) fn run_figures(made: &ScanMeshed, points: &PointFacts, diagonal: f64, fitted: &mut Fitted) {
    let mut found = Quality::new();
    scan_figures(made, &mut found, &mut fitted.warnings);
    found.insert(key::SCAN_OUTLIERS.into(), Figure::Count(points.outliers as u64));
    found.insert(key::SCAN_MOVED_RMS.into(), Figure::Number(points.moved_rms));
    // Noise and spacing are those of the samples, whatever is made of these.
    for key in [key::SCAN_MOVED_RMS, key::SCAN_TO_MESH_RMS, key::SCAN_TO_MESH_MEAN] {
        if let Some(x) = found.get(key).map(|f| f.value()) {
            found.insert(format!("{key}_rel"), Figure::Number(x / diagonal));
        }
    }
    fitted.quality.extend(found);
}

/// The figures of samples alone.
pub fn sample_figures(facts: &ScanFacts, quality: &mut Quality, warnings: &mut Vec<Warning>) {
    let numbers = [
        (key::SCAN_NOISE, facts.noise),
        (key::SCAN_NOISE_REL, facts.noise / facts.diagonal),
        (key::SCAN_SPACING, facts.spacing),
        (key::SCAN_SPACING_REL, facts.spacing / facts.diagonal),
        (key::SCAN_CONFIDENCE, facts.confidence),
        (key::SCAN_NORMAL_NOISE_DEG, facts.normal_noise_deg),
    ];
    quality.extend(numbers.map(|(key, x)| (key.to_owned(), Figure::Number(x))));
    quality.insert(key::SCAN_SAMPLES.into(), Figure::Count(facts.samples as u64));
    quality.insert(key::SCAN_SEGMENTS.into(), Figure::Count(facts.segments as u64));
    if facts.confidence < UNSURE_ORIENTATION {
        let text = format!(
            "The orientation of the points is unsure: {:.1} % of the evidence agrees. Normals or scanner positions in the \
             file would decide it.",
            100.0 * facts.confidence
        );
        warnings.push(Warning::new("unsure_orientation", text, ""));
    }
}

/// Below this share of evidence that agrees the orientation is told to be unsure.
const UNSURE_ORIENTATION: f64 = 0.95;
