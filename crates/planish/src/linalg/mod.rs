//! Ground floor: linear algebra.

mod banded_cholesky;
mod dense;
mod sparse;

pub use banded_cholesky::{Banded, BandedCholesky};
pub use dense::solve_dense;
pub use sparse::{SparseCholesky, SparseError};
