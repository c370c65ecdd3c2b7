//! Ground floor: linear algebra.

mod banded_cholesky;
mod sparse;

pub use banded_cholesky::{Banded, BandedCholesky};
pub use sparse::{SparseCholesky, SparseError};
