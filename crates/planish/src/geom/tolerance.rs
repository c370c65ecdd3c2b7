//! The one bare epsilon of the library, and what counts as "on an edge" and "at a vertex". Every length threshold is the
//! first, scaled by a bounding box, or a named constant beside its method.

/// Relative size below which two positions count as the same: a few thousand times the rounding of an
/// `f64` coordinate, far below what any scanner or CAD kernel resolves.
pub const RELATIVE: f64 = 1e-12;

/// A barycentric weight no greater than this is zero: the place lies on the edge, or at the vertex. The rounding of weights,
/// with room for those that come from one of the faces of an edge to the other.
pub const ON_EDGE: f64 = 1e-12;

/// A crossing nearer to the end of an edge than this share of it goes through the vertex: nearer ones would make triangles
/// without area where a curve is imprinted.
pub const AT_VERTEX: f64 = 1e-9;

/// What stands for zero where it divides: its inverse times any length, area or noise is a number still.
const DIVISOR: f64 = 1e-300;

/// The length below which two points of a model with this bounding-box diagonal are the same point.
pub fn length(diagonal: f64) -> f64 {
    RELATIVE * diagonal
}

/// True above zero. False for what is not a number, so that `!is_positive(x)` refuses that as well.
pub fn is_positive(x: f64) -> bool {
    x > 0.0
}

/// A size that is not negative, kept off zero so that it can divide.
pub fn divisor(size: f64) -> f64 {
    size.max(DIVISOR)
}
