//! Axis-aligned bounding boxes.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// An axis-aligned box; empty when `min > max`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Aabb {
    /// Least corner.
    pub min: DVec3,
    /// Greatest corner.
    pub max: DVec3,
}

impl Aabb {
    /// The box of no points.
    pub const EMPTY: Aabb = Aabb { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The smallest box around `points`.
    pub fn of<'a>(points: impl IntoIterator<Item = &'a DVec3>) -> Aabb {
        points.into_iter().fold(Aabb::EMPTY, |b, p| Aabb { min: b.min.min(*p), max: b.max.max(*p) })
    }

    /// Extent along the axes; zero for an empty box.
    pub fn size(&self) -> DVec3 {
        (self.max - self.min).max(DVec3::ZERO)
    }

    /// Length of the diagonal, `D` of the methods; zero for an empty box.
    pub fn diagonal(&self) -> f64 {
        self.size().length()
    }

    /// True if the two share a point.
    pub fn meets(&self, other: &Aabb) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// Is a point in the box, or on its border?
    pub fn contains(&self, p: DVec3) -> bool {
        p.cmpge(self.min).all() && p.cmple(self.max).all()
    }

    /// Midpoint of the box.
    pub fn center(&self) -> DVec3 {
        (self.min + self.max) / 2.0
    }
}
