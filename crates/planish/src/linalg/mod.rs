//! Ground floor: linear algebra.

mod banded_cholesky;
mod dense;

pub use banded_cholesky::{Banded, BandedCholesky};
pub use dense::solve_dense;
pub use planish_sparse::{SparseCholesky, SparseError};
