//! Ground floor: linear algebra.

mod banded_cholesky;
mod dense;
mod eigen3;
pub(crate) mod envelope;
pub(crate) mod small_cholesky;

pub use banded_cholesky::{Banded, BandedCholesky};
pub use dense::solve_dense;
pub(crate) use eigen3::eigen3;
pub use planish_sparse::{SparseCholesky, SparseError, SparsePattern};
