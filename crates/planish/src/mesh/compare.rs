//! How far two surfaces are from each other: distances both ways and angles between normals.
//!
//! Samples are drawn evenly by area (the square-root map of Osada et al., *Shape Distributions*, 2002, eq. 1) and
//! each is measured against the closest place of the other surface, in the sense of Metro (Cignoni, Rocchini,
//! Scopigno 1998).

use super::{TriMesh, check};
use crate::geom::{Aabb, Bvh, random};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How to compare.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CompareParams {
    /// Samples drawn on each surface.
    #[schemars(range(min = 1), extend("unit" = "count"))]
    pub samples: usize,
    /// Seed of the samples.
    pub seed: u64,
}

impl Default for CompareParams {
    fn default() -> Self {
        CompareParams { samples: 200_000, seed: 0 }
    }
}

/// Why surfaces cannot be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CompareError {
    /// A mesh is damaged.
    #[error("mesh {which}: {error}")]
    Mesh {
        /// `a` or `b`.
        which: char,
        /// What is wrong with it.
        error: super::MeshError,
    },
    /// A mesh has no area.
    #[error("mesh {which} has no area ({triangles} triangles); a surface is needed")]
    NoArea {
        /// `a` or `b`.
        which: char,
        /// Number of its triangles.
        triangles: usize,
    },
    /// No samples are asked for.
    #[error("0 samples asked for; at least 1 is needed")]
    NoSamples,
    /// The observer wants no result any more.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// Spread of distances, world units unless said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// 95 of 100 samples are nearer.
    pub p95: f64,
    /// Greatest of the samples.
    pub max: f64,
}

/// The result of [`compare`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Bounding-box diagonal of `a`, world units.
    pub diagonal: f64,
    /// Samples on each surface.
    pub samples: usize,
    /// From samples of `a` to `b`.
    pub a_to_b: Spread,
    /// From samples of `b` to `a`.
    pub b_to_a: Spread,
    /// All samples of both.
    pub both: Spread,
    /// `both` as fractions of the diagonal.
    pub both_rel: Spread,
    /// Angle between the normals at a sample and at its closest place, degrees; of all samples of both.
    pub normal_deg: Spread,
    /// Share of samples whose normals differ by more than 90 degrees.
    pub flipped_share: f64,
}

/// A place of one surface against the closest of the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The place, world units.
    pub place: DVec3,
    /// Distance to the closest place of the other surface, world units.
    pub distance: f64,
    /// Angle between the normals there, degrees.
    pub angle_deg: f64,
}

/// Samples between two looks at the observer.
const SAMPLES_PER_CHUNK: usize = 1 << 14;

/// Compares two surfaces both ways.
/// # Errors
/// [`CompareError`] for damaged or empty meshes, no samples, or if cancelled.
pub fn compare(
    a: &TriMesh,
    b: &TriMesh,
    params: &CompareParams,
    observer: &dyn Observer,
) -> Result<Comparison, CompareError> {
    Ok(compare_samples(a, b, params, observer)?.0)
}

/// As [`compare`], with the samples: first those of `a`, then those of `b`.
/// # Errors
/// As [`compare`].
pub fn compare_samples(
    a: &TriMesh,
    b: &TriMesh,
    params: &CompareParams,
    observer: &dyn Observer,
) -> Result<(Comparison, Vec<Sample>), CompareError> {
    if params.samples == 0 {
        return Err(CompareError::NoSamples);
    }
    for (which, mesh) in [('a', a), ('b', b)] {
        check(mesh).map_err(|error| CompareError::Mesh { which, error })?;
    }
    let (a, b) = (Side::new(a, 'a', observer)?, Side::new(b, 'b', observer)?);
    let diagonal = Aabb::of(&a.sampler.mesh.points).diagonal();
    let mut samples = measure(&a, &b, params, 0, observer)?;
    samples.extend(measure(&b, &a, params, 1, observer)?);
    observer.progress(1.0);

    let (ab, ba) = samples.split_at(params.samples);
    let distances = |samples: &[Sample]| spread(samples.iter().map(|s| s.distance).collect());
    let both = distances(&samples);
    let flipped = samples.iter().filter(|s| s.angle_deg > 90.0).count();
    let comparison = Comparison {
        diagonal,
        samples: params.samples,
        a_to_b: distances(ab),
        b_to_a: distances(ba),
        both,
        both_rel: Spread {
            mean: both.mean / diagonal,
            rms: both.rms / diagonal,
            p95: both.p95 / diagonal,
            max: both.max / diagonal,
        },
        normal_deg: spread(samples.iter().map(|s| s.angle_deg).collect()),
        flipped_share: flipped as f64 / samples.len() as f64,
    };
    Ok((comparison, samples))
}

/// One of the two surfaces: its triangles of some area, and the tree.
struct Side {
    sampler: AreaSampler,
    bvh: Bvh,
}

impl Side {
    fn new(mesh: &TriMesh, which: char, observer: &dyn Observer) -> Result<Side, CompareError> {
        observer.check()?;
        let sampler = AreaSampler::new(mesh);
        if sampler.mesh.triangles.is_empty() {
            return Err(CompareError::NoArea { which, triangles: mesh.triangles.len() });
        }
        let bvh = Bvh::watched(&sampler.mesh, observer)?;
        Ok(Side { sampler, bvh })
    }
}

/// Draws places of a mesh evenly by area: its triangles of some area, and their summed areas.
pub(crate) struct AreaSampler {
    mesh: TriMesh,
    sums: Vec<f64>,
}

impl AreaSampler {
    pub(crate) fn new(mesh: &TriMesh) -> AreaSampler {
        // Only the vertices in use, so that the box is that of the surface.
        let mut id = vec![u32::MAX; mesh.points.len()];
        let mut points = Vec::new();
        let triangles = (0..mesh.triangles.len())
            .filter(|&t| mesh.area(t) > 0.0)
            .map(|t| {
                mesh.triangles[t].map(|v| {
                    if id[v as usize] == u32::MAX {
                        id[v as usize] = points.len() as u32;
                        points.push(mesh.points[v as usize]);
                    }
                    id[v as usize]
                })
            })
            .collect();
        let mesh = TriMesh::new(points, triangles);
        let sums = mesh.area_sums();
        AreaSampler { mesh, sums }
    }

    /// Sample number `n` of `count` of the stream `seed`: position and normal.
    pub(crate) fn sample(&self, seed: u64, n: u64, count: usize) -> (DVec3, DVec3) {
        let [pick, r, s] = [0, 1, 2].map(|k| random::unit(seed, 3 * n + k));
        // The n-th sample lies in the n-th of equal shares of the area: less spread than free choice, and
        // neighbours in the mesh are asked one after the other.
        let goal = (n as f64 + pick) / count as f64 * self.sums[self.sums.len() - 1];
        let t = self.sums.partition_point(|&sum| sum <= goal).min(self.sums.len() - 1);
        let [a, b, c] = self.mesh.corners(t);
        let r = r.sqrt();
        (a * (1.0 - r) + b * (r * (1.0 - s)) + c * (r * s), self.mesh.normal(t))
    }
}

/// Samples of `from` against `to`.
fn measure(
    from: &Side,
    to: &Side,
    params: &CompareParams,
    pass: u64,
    observer: &dyn Observer,
) -> Result<Vec<Sample>, CompareError> {
    // The two directions draw from different streams.
    let seed = random::bits(params.seed, pass);
    let mut result = Vec::with_capacity(params.samples);
    while result.len() < params.samples {
        observer.check()?;
        observer.progress((pass as f64 + result.len() as f64 / params.samples as f64) / 2.0);
        let range = result.len()..(result.len() + SAMPLES_PER_CHUNK).min(params.samples);
        result.par_extend(range.into_par_iter().map(|n| {
            let (place, m) = from.sampler.sample(seed, n as u64, params.samples);
            let hit = to.bvh.closest(place);
            let n = to.sampler.mesh.normal(hit.place.face as usize);
            Sample { place, distance: hit.distance, angle_deg: m.cross(n).length().atan2(m.dot(n)).to_degrees() }
        }));
    }
    Ok(result)
}

pub(crate) fn spread(mut values: Vec<f64>) -> Spread {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let rms = (values.iter().map(|v| v * v).sum::<f64>() / n).sqrt();
    values.sort_unstable_by(f64::total_cmp);
    // Between the two order statistics around 95 %.
    let x = 0.95 * (n - 1.0);
    let (low, high) = (values[x.floor() as usize], values[x.ceil() as usize]);
    Spread { mean, rms, p95: low + (high - low) * x.fract(), max: values[values.len() - 1] }
}
