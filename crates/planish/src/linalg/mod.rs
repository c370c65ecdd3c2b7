//! Ground floor: linear algebra.

mod sparse;

pub use sparse::{SparseCholesky, SparseError};
