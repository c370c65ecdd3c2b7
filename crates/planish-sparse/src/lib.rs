//! Sparse symmetric positive definite systems: the one crate that knows faer, so that nothing else waits for faer to be
//! compiled.

use faer::linalg::solvers::SolveCore;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{Argsort, Pair, SparseColMat, SymbolicSparseColMat, Triplet};
use faer::{Conj, MatMut, Side};
use std::sync::Arc;
use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

/// Unknowns from which a factorisation may take longer than the time in which a stage must notice cancelling.
const WATCHED_SIZE: usize = 30_000;
/// How often a running factorisation asks whether it is still wanted.
const WATCH_EVERY: Duration = Duration::from_millis(40);

/// Why a system could not be solved.
#[derive(Debug, thiserror::Error)]
pub enum SparseError {
    /// A row or column index is not below `n`.
    #[error("the matrix entries do not fit {n} unknowns")]
    Shape {
        /// Number of unknowns.
        n: usize,
    },
    /// The matrix is singular or indefinite.
    #[error("the matrix of {n} unknowns is not positive definite")]
    NotPositive {
        /// Number of unknowns.
        n: usize,
    },
}

/// A factored symmetric positive definite matrix.
pub struct SparseCholesky {
    n: usize,
    factor: Llt<usize, f64>,
}

impl SparseCholesky {
    /// Factors the `n x n` matrix whose lower triangle (`row >= column`) is the sum of `lower`.
    /// # Errors
    /// If an index is out of range or the matrix is not positive definite.
    pub fn factor(n: usize, lower: &[(usize, usize, f64)]) -> Result<SparseCholesky, SparseError> {
        let entries: Vec<Triplet<usize, usize, f64>> = lower.iter().map(|&(r, c, v)| Triplet::new(r, c, v)).collect();
        let matrix = SparseColMat::try_new_from_triplets(n, n, &entries).map_err(|_| SparseError::Shape { n })?;
        let order = SymbolicLlt::try_new(matrix.symbolic(), Side::Lower).map_err(|_| SparseError::Shape { n })?;
        SparseCholesky::of(n, &matrix, order)
    }

    fn of(
        n: usize,
        matrix: &SparseColMat<usize, f64>,
        order: SymbolicLlt<usize>,
    ) -> Result<SparseCholesky, SparseError> {
        // Two threads make faer's sparse factorisation several times slower.
        faer::set_global_parallelism(faer::Par::Seq);
        let factor = Llt::try_new_with_symbolic(order, matrix.as_ref(), Side::Lower);
        Ok(SparseCholesky { n, factor: factor.map_err(|_| SparseError::NotPositive { n })? })
    }

    /// As [`SparseCholesky::factor`], but gives up with `None` as soon as `cancelled` says so. A large matrix is
    /// factored on a thread of its own; after giving up that thread ends by itself with its result unused.
    /// # Errors
    /// As [`SparseCholesky::factor`].
    pub fn factor_watched(
        n: usize,
        lower: Vec<(usize, usize, f64)>,
        cancelled: &dyn Fn() -> bool,
    ) -> Option<Result<SparseCholesky, SparseError>> {
        watched(n, cancelled, move || SparseCholesky::factor(n, &lower))
    }

    /// Solves in place for `rhs.len() / n` right-hand sides stored one after the other.
    pub fn solve(&self, rhs: &mut [f64]) {
        assert_eq!(rhs.len() % self.n.max(1), 0, "right-hand sides of {} unknowns", self.n);
        let columns = rhs.len() / self.n.max(1);
        self.factor.solve_in_place_with_conj(Conj::No, MatMut::from_column_major_slice_mut(rhs, self.n, columns));
    }
}

/// Where the entries of matrices lie, and the order of elimination: worked out once for all matrices that have them at the
/// same places.
pub struct SparsePattern {
    n: usize,
    /// Entries as they are given.
    entries: usize,
    places: SymbolicSparseColMat<usize>,
    /// From entries as they are given to those places.
    sorted: Argsort<usize>,
    order: SymbolicLlt<usize>,
}

impl SparsePattern {
    /// Of `n x n` matrices with entries at `lower` (`row >= column`); what is listed twice is summed. Gives up with `None` as
    /// [`SparseCholesky::factor_watched`].
    /// # Errors
    /// If an index is out of range.
    pub fn watched(
        n: usize,
        lower: Vec<(usize, usize)>,
        cancelled: &dyn Fn() -> bool,
    ) -> Option<Result<SparsePattern, SparseError>> {
        watched(n, cancelled, move || {
            let entries = lower.len();
            let places: Vec<Pair<usize, usize>> = lower.into_iter().map(|(r, c)| Pair::new(r, c)).collect();
            let found = SymbolicSparseColMat::try_new_from_indices(n, n, &places);
            let (places, sorted) = found.map_err(|_| SparseError::Shape { n })?;
            let order = SymbolicLlt::try_new(places.as_ref(), Side::Lower).map_err(|_| SparseError::Shape { n })?;
            Ok(SparsePattern { n, entries, places, sorted, order })
        })
    }

    /// Factors the matrix with these values, in the order in which the places were listed, and gives up with `None` as
    /// [`SparseCholesky::factor_watched`].
    /// # Errors
    /// If there are more or fewer values than places, or the matrix is not positive definite.
    pub fn factor_watched(
        self: &Arc<SparsePattern>,
        values: Vec<f64>,
        cancelled: &dyn Fn() -> bool,
    ) -> Option<Result<SparseCholesky, SparseError>> {
        let (n, pattern) = (self.n, self.clone());
        watched(n, cancelled, move || {
            if values.len() != pattern.entries {
                return Err(SparseError::Shape { n });
            }
            let matrix = SparseColMat::new_from_argsort(pattern.places.clone(), &pattern.sorted, &values);
            SparseCholesky::of(n, &matrix.map_err(|_| SparseError::Shape { n })?, pattern.order.clone())
        })
    }
}

/// What `work` on a matrix of `n` unknowns comes to, or `None` as soon as `cancelled` says so.
fn watched<T: Send + 'static>(
    n: usize,
    cancelled: &dyn Fn() -> bool,
    work: impl FnOnce() -> Result<T, SparseError> + Send + 'static,
) -> Option<Result<T, SparseError>> {
    if n < WATCHED_SIZE {
        return (!cancelled()).then(work);
    }
    let (send, receive) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        // The receiver is gone after cancelling; nobody then wants the result.
        let _ = send.send(work());
    });
    loop {
        match receive.recv_timeout(WATCH_EVERY) {
            Ok(result) => return Some(result),
            Err(RecvTimeoutError::Timeout) if cancelled() => return None,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Some(Err(SparseError::NotPositive { n })),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_a_3x3_system_for_two_sides_within_1e_14() {
        let lower = [(0, 0, 4.0), (1, 0, 1.0), (1, 1, 3.0), (2, 1, 1.0), (2, 2, 5.0)];
        let factor = SparseCholesky::factor(3, &lower).unwrap();
        let mut x = vec![6.0, 10.0, 17.0, 4.0, 1.0, 0.0];
        factor.solve(&mut x);
        for (got, want) in x.iter().zip([1.0, 2.0, 3.0]) {
            assert!((got - want).abs() < 1e-14);
        }
        let r = [4.0 * x[3] + x[4] - 4.0, x[3] + 3.0 * x[4] + x[5] - 1.0, x[4] + 5.0 * x[5]];
        assert!(r.iter().all(|r| r.abs() < 1e-14));
    }

    #[test]
    fn one_pattern_serves_two_matrices_and_sums_what_is_listed_twice() {
        let places = [(0, 0), (1, 1), (1, 0), (0, 0)];
        let pattern = Arc::new(SparsePattern::watched(2, places.to_vec(), &|| false).unwrap().unwrap());
        for (values, x) in [([1.0, 3.0, 1.0, 3.0], [7.0, 9.0]), ([2.0, 5.0, -1.0, 0.0], [1.0, 2.0])] {
            let factor = pattern.factor_watched(values.to_vec(), &|| false).unwrap().unwrap();
            let [a, b, c] = [values[0] + values[3], values[1], values[2]];
            let mut rhs = [a * x[0] + c * x[1], c * x[0] + b * x[1]];
            factor.solve(&mut rhs);
            assert!(rhs.iter().zip(x).all(|(got, want)| (got - want).abs() < 1e-14));
        }
        assert!(pattern.factor_watched(vec![1.0; 3], &|| false).unwrap().is_err());
        assert!(pattern.factor_watched(vec![1.0; 4], &|| true).is_none());
        assert!(SparsePattern::watched(2, vec![(2, 0)], &|| false).unwrap().is_err());
    }

    #[test]
    fn an_indefinite_matrix_is_an_error() {
        assert!(SparseCholesky::factor(2, &[(0, 0, 1.0), (1, 0, 2.0), (1, 1, 1.0)]).is_err());
    }
}
