//! The one bare epsilon of the library. Every length threshold is this, scaled by a bounding box, or a
//! named constant beside its method.
//!
//! See CONTRIBUTING.md, "Code".

/// Relative size below which two positions count as the same: a few thousand times the rounding of an
/// `f64` coordinate, far below what any scanner or CAD kernel resolves.
pub const RELATIVE: f64 = 1e-12;

/// The length below which two points of a model with this bounding-box diagonal are the same point.
pub fn length(diagonal: f64) -> f64 {
    RELATIVE * diagonal
}
