//! Where bricks lie while they are worked.

use super::{Brick, BrickCells, BrickFacts, BrickSamples, BrickStands, Partition};
use crate::cloud::Cloud;
use crate::geom::Aabb;
use std::sync::{Arc, Mutex, PoisonError};

/// What was kept of a scan cannot be had: a disk that is full, a folder that is gone.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct StoreError(pub String);

/// The points of a scan in bricks, and the samples of each once they are made.
///
/// Bricks are those of [`Partition::new`], and what is around one comes in the order of the scan: what is made of them is the
/// same wherever they lie.
pub trait BrickStore: Sync {
    /// The bricks.
    fn bricks(&self) -> &[Brick];
    /// The points in a brick or within `halo` of it, with what their file tells of the outside.
    /// # Errors
    /// If they cannot be read.
    fn around(&self, brick: usize, halo: f64) -> Result<Cloud, StoreError>;
    /// The points of a brick with all that their file tells of them.
    /// # Errors
    /// If they cannot be read.
    fn points_in(&self, brick: usize) -> Result<Cloud, StoreError>;
    /// Keeps the samples of a brick, in the place of those that were kept before.
    /// # Errors
    /// If they cannot be written.
    fn keep(&self, brick: usize, samples: BrickSamples) -> Result<(), StoreError>;
    /// What is known of the samples of a brick.
    /// # Errors
    /// If they were not kept, or cannot be read.
    fn facts(&self, brick: usize) -> Result<BrickFacts, StoreError>;
    /// Where they stand.
    /// # Errors
    /// As of [`BrickStore::facts`].
    fn stands(&self, brick: usize) -> Result<Arc<BrickStands>, StoreError>;
    /// How they join.
    /// # Errors
    /// As of [`BrickStore::facts`].
    fn cells(&self, brick: usize) -> Result<Arc<BrickCells>, StoreError>;
    /// Memory that is held for each point, bytes.
    fn held(&self) -> u64;
}

/// Number of points in bricks.
pub fn points_of(bricks: &[Brick]) -> usize {
    bricks.last().map_or(0, |b| b.range.end)
}

/// Box of the points in bricks.
pub fn bounds_of(bricks: &[Brick]) -> Aabb {
    Aabb::of(bricks.iter().flat_map(|b| [&b.bounds.min, &b.bounds.max]))
}

/// A scan in memory.
pub struct CloudStore<'a> {
    cloud: &'a Cloud,
    partition: Partition,
    kept: Vec<Mutex<Option<Kept>>>,
}

#[derive(Clone)]
struct Kept {
    facts: BrickFacts,
    stands: Arc<BrickStands>,
    cells: Arc<BrickCells>,
}

/// A point, its index, and its share of samples and cells.
const HELD: u64 = 60;

impl<'a> CloudStore<'a> {
    /// A scan in bricks of at most `most` points.
    pub fn new(cloud: &'a Cloud, most: usize) -> CloudStore<'a> {
        let partition = Partition::new(&cloud.points, most);
        let kept = partition.bricks.iter().map(|_| Mutex::default()).collect();
        CloudStore { cloud, partition, kept }
    }

    fn kept(&self, brick: usize) -> Result<Kept, StoreError> {
        let kept = self.kept[brick].lock().unwrap_or_else(PoisonError::into_inner);
        kept.clone().ok_or_else(|| StoreError(format!("brick {brick} has no samples yet")))
    }
}

impl BrickStore for CloudStore<'_> {
    fn bricks(&self) -> &[Brick] {
        &self.partition.bricks
    }

    fn around(&self, brick: usize, halo: f64) -> Result<Cloud, StoreError> {
        Ok(self.cloud.select(&self.partition.around(&self.cloud.points, brick, halo)))
    }

    fn points_in(&self, brick: usize) -> Result<Cloud, StoreError> {
        self.around(brick, 0.0)
    }

    fn keep(&self, brick: usize, samples: BrickSamples) -> Result<(), StoreError> {
        let BrickSamples { facts, stands, cells } = samples;
        let kept = Kept { facts, stands: Arc::new(stands), cells: Arc::new(cells) };
        *self.kept[brick].lock().unwrap_or_else(PoisonError::into_inner) = Some(kept);
        Ok(())
    }

    fn facts(&self, brick: usize) -> Result<BrickFacts, StoreError> {
        Ok(self.kept(brick)?.facts)
    }

    fn stands(&self, brick: usize) -> Result<Arc<BrickStands>, StoreError> {
        Ok(self.kept(brick)?.stands)
    }

    fn cells(&self, brick: usize) -> Result<Arc<BrickCells>, StoreError> {
        Ok(self.kept(brick)?.cells)
    }

    fn held(&self) -> u64 {
        HELD
    }
}
