//! Samples of scans that are too large to be worked at once, brick by brick.
//!
//! 1. [`Partition`]: boxes of space with at most so many points
//! 2. [`BrickSamples::clean`]: the samples of a brick, from its points and those of a halo that its fits reach into; what stands in
//!    the halo is the neighbour's
//! 3. [`Sides`]: bricks see the same surface in their halos, so these tell how the pieces of one are turned against those of the
//!    next; then bodies have their outside as in one piece
//! 4. [`bring`]: the points of a brick on the surface of the samples of all around
//!
//! Points and samples lie in a [`BrickStore`]: in memory, or in files.
//!
//! See `docs/methods/bricks.md`.

mod partition;
mod sides;
mod store;

pub use partition::{Brick, Partition};
pub use sides::Sides;
pub use store::{BrickStore, CloudStore, StoreError, bounds_of, points_of};

use super::local::nest::MOST_NESTED;
use super::stand::Stand;
use super::{Brought, Cell, CleanParams, Cloud, CloudError, FEWEST_POINTS, PointScale, Quadric, Samples, clean};
use crate::geom::{Aabb, KdTree};
use crate::observe::{Observer, Part};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A halo is this many of the widest supports wide: fits hear points within two of theirs, a cell asks samples within two of its
/// own.
const HALO_SUPPORTS: f64 = 4.0;
/// All but so many of a hundred supports are no wider than the widest one that counts.
const WIDEST_PERCENT: usize = 99;
/// Places that are looked at for the width of the halo, and points in each.
const PILOTS: usize = 3;
const PILOT_POINTS: usize = 30_000;

/// Width of the halo around bricks, world units: from the supports of a few places of the scan.
/// # Errors
/// [`CloudError`] if there are no samples in any of them, if the points cannot be read, or if cancelled.
pub fn halo(store: &dyn BrickStore, params: &CleanParams, observer: &dyn Observer) -> Result<f64, CloudError> {
    let mut widest: f64 = 0.0;
    let mut failed = None;
    let count = store.bricks().len();
    let pilots = PILOTS.min(count);
    for k in 0..pilots {
        let own = store.around(k * (count - 1) / (pilots - 1).max(1), 0.0)?.points;
        let parts = Partition::new(&own, PILOT_POINTS);
        let pilot = &parts.bricks[parts.bricks.len() / 2];
        let points = parts.order[pilot.range.clone()].iter().map(|&i| own[i as usize]).collect();
        match clean(&Cloud::new(points), params, &Part::new(observer, k as f64 / pilots as f64, 1.0 / pilots as f64)) {
            Ok(samples) => {
                let mut supports: Vec<f64> = samples.samples.iter().map(|s| s.support).collect();
                supports.sort_unstable_by(f64::total_cmp);
                widest = widest.max(supports[(supports.len() - 1) * WIDEST_PERCENT / 100]);
            }
            Err(CloudError::Cancelled(c)) => return Err(c.into()),
            Err(e) => failed = Some(e),
        }
    }
    match failed {
        Some(e) if widest == 0.0 => Err(e),
        _ => Ok(HALO_SUPPORTS * widest),
    }
}

/// A cell without the room for sheets that it has not.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Packed {
    center: DVec3,
    support: f64,
    trust: f64,
    first_sheet: u32,
    count: u8,
    concave: u8,
    piece: u32,
}

/// What is known of the samples of a brick together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BrickFacts {
    /// Samples in the brick.
    pub samples: usize,
    /// Box of their centres.
    pub bounds: Aabb,
    /// Box of the samples in its halo.
    beyond: Aabb,
    /// Widest support of its cells, world units.
    pub widest: f64,
    /// Standard deviation and distance of the points, world units: the middle of all places.
    pub noise: f64,
    /// See `noise`.
    pub spacing: f64,
    /// Typical error of the normals, degrees.
    pub normal_noise_deg: f64,
    /// As of [`Samples`].
    pub gap: f64,
    /// Sum of the confidence of its samples.
    pub confidence: f64,
    /// Bodies; in a brick mostly parts of one.
    pieces: u32,
    /// Whether the file told of the outside.
    told: bool,
}

/// Where the samples of a brick stand.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BrickStands {
    /// In the brick, and in its halo.
    own: Vec<Stand>,
    beyond: Vec<Stand>,
}

impl BrickStands {
    /// Centre, and outward normal times area, of the samples in the brick.
    /// * `signs` - as of [`BrickCells::reaching`]
    pub fn dipoles(&self, signs: &[f64]) -> impl Iterator<Item = (DVec3, DVec3)> {
        self.own.iter().map(|s| (s.center, signs[s.segment as usize] * s.area * s.normal))
    }
}

/// How the sheets join in a brick: its share of the field.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BrickCells {
    cells: Vec<Packed>,
    sheets: Vec<Quadric>,
}

impl BrickCells {
    /// Adds the cells that reach into a box, each with the outside that its piece has.
    /// * `signs` - for each piece 1, or -1 if it is inside out
    pub fn reaching(&self, aabb: &Aabb, signs: &[f64], into: &mut Vec<Cell>) {
        for c in &self.cells {
            let sheets = &self.sheets[c.first_sheet as usize..][..c.count as usize];
            let mut cell = Cell {
                center: c.center,
                support: c.support,
                trust: c.trust,
                sheets: [sheets[0]; MOST_NESTED],
                count: c.count,
                concave: c.concave,
            };
            if !cell.reaches(aabb) {
                continue;
            }
            cell.sheets[..sheets.len()].copy_from_slice(sheets);
            into.push(if signs[c.piece as usize] < 0.0 { cell.flipped() } else { cell });
        }
    }
}

/// The samples of a brick.
#[derive(Clone, Debug, PartialEq)]
pub struct BrickSamples {
    /// All of them together.
    pub facts: BrickFacts,
    /// Where they stand.
    pub stands: BrickStands,
    /// How they join.
    pub cells: BrickCells,
}

impl BrickSamples {
    /// The samples of one brick; none if its points are too few or no surface.
    /// * `cloud` - its points and those of its halo
    /// # Errors
    /// [`CloudError::Cancelled`].
    pub fn clean(
        cloud: &Cloud,
        brick: &Brick,
        params: &CleanParams,
        observer: &dyn Observer,
    ) -> Result<BrickSamples, CloudError> {
        let none = || BrickSamples::of(&Samples::default(), brick, false);
        if cloud.points.len() < FEWEST_POINTS {
            return Ok(none());
        }
        match clean(cloud, params, observer) {
            Ok(samples) => Ok(BrickSamples::of(&samples, brick, is_told(cloud, params))),
            Err(CloudError::Cancelled(c)) => Err(c.into()),
            Err(_) => Ok(none()),
        }
    }

    fn of(samples: &Samples, brick: &Brick, told: bool) -> BrickSamples {
        let mut stands = BrickStands::default();
        let mut confidence = 0.0;
        for s in &samples.samples {
            let stand = Stand::of(s);
            if brick.holds(s.center) {
                stands.own.push(stand);
                confidence += s.confidence;
            } else {
                stands.beyond.push(stand);
            }
        }
        let tree = KdTree::new(&samples.samples.iter().map(|s| s.center).collect::<Vec<_>>());
        let mut kept = BrickCells::default();
        for cell in samples.cells.iter().filter(|c| brick.holds(c.center)) {
            let piece = tree.closest(cell.center).map_or(0, |i| samples.samples[i as usize].segment);
            let Cell { center, support, trust, sheets, count, concave } = *cell;
            let first_sheet = kept.sheets.len() as u32;
            kept.cells.push(Packed { center, support, trust, first_sheet, count, concave, piece });
            kept.sheets.extend(&sheets[..count as usize]);
        }
        let around = |stands: &[Stand]| Aabb::of(stands.iter().map(|s| &s.center));
        let facts = BrickFacts {
            samples: stands.own.len(),
            bounds: around(&stands.own),
            beyond: around(&stands.beyond),
            widest: kept.cells.iter().map(|c| c.support).fold(0.0, f64::max),
            noise: samples.noise,
            spacing: samples.spacing,
            normal_noise_deg: samples.normal_noise_deg,
            gap: samples.gap,
            confidence,
            pieces: samples.closed.len() as u32,
            told,
        };
        BrickSamples { facts, stands, cells: kept }
    }
}

/// Brings the points of a brick to the surface of the samples of all bricks around.
/// * `halo` - as of [`halo`]
/// # Errors
/// [`CloudError`] if cancelled, or if points or samples cannot be read.
pub(crate) fn bring(
    store: &dyn BrickStore,
    brick: usize,
    (sides, halo): (&Sides, f64),
    scale: &PointScale,
    observer: &dyn Observer,
) -> Result<(Cloud, Brought), CloudError> {
    let cloud = store.points_in(brick)?;
    let Aabb { min, max } = store.bricks()[brick].bounds;
    let around = Aabb { min: min - halo, max: max + halo };
    let (mut stands, mut cells) = (Vec::new(), Vec::new());
    for k in 0..store.bricks().len() {
        let facts = store.facts(k)?;
        if facts.samples > 0 && facts.bounds.meets(&around) {
            stands.extend(sides.turned(k, &store.stands(k)?.own).filter(|s| around.contains(s.center)));
        }
        if store.bricks()[k].reach(facts.widest).meets(&around) {
            store.cells(k)?.reaching(&around, &sides.signs[k], &mut cells);
        }
    }
    let brought = Brought::new(&cloud, stands, &cells, scale, observer)?;
    Ok((cloud, brought))
}

/// Does the file tell of the outside?
fn is_told(cloud: &Cloud, params: &CleanParams) -> bool {
    let normals = !params.ignore_normals && super::given_normals(cloud).is_some();
    normals || super::toward_scanner(cloud).is_some()
}
