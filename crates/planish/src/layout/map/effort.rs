//! What the maps of a layout may cost together.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Faces whose energy is asked for at most. Chosen, not derived: some ten thousand steps on a proxy of usual size, with room
/// for their halvings. The measured meshes that were tried have the same bytes without it.
const MOST_EFFORT: u64 = 400_000_000;

/// Faces whose energy was asked for, over all maps of a layout together: what most of their time goes by, and the same on
/// any machine.
#[derive(Clone, Debug)]
pub(in crate::layout) struct Effort {
    spent: Arc<AtomicU64>,
    most: u64,
}

impl Effort {
    /// For a piece with this share of the area of a mesh.
    pub fn new(share: f64) -> Effort {
        Effort { spent: Arc::default(), most: (share * MOST_EFFORT as f64) as u64 }
    }

    pub fn add(&self, faces: usize) {
        self.spent.fetch_add(faces as u64, Ordering::Relaxed);
    }

    /// True once the maps of a layout have had their share of work: those that are not there by then are given up.
    pub fn is_spent(&self) -> bool {
        self.spent.load(Ordering::Relaxed) > self.most
    }
}
