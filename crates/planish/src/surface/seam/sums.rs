//! Normal equations of a few unknowns among many.

/// Normal equations of a few unknowns.
pub(crate) struct Sums {
    /// The unknowns, rising.
    pub unknowns: Vec<usize>,
    /// Lower triangle of a square matrix, row-major.
    pub matrix: Vec<f64>,
    pub rhs: Vec<f64>,
}

impl Sums {
    pub fn new(mut unknowns: Vec<usize>) -> Sums {
        unknowns.sort_unstable();
        unknowns.dedup();
        let n = unknowns.len();
        Sums { unknowns, matrix: vec![0.0; n * n], rhs: vec![0.0; n] }
    }

    /// The number of an unknown among these.
    pub fn rank(&self, unknown: usize) -> usize {
        self.unknowns.partition_point(|&u| u < unknown)
    }

    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        self.matrix[row * self.rhs.len() + column] += value;
    }

    pub fn done(self) -> Terms {
        let n = self.rhs.len();
        let lower = (0..n).flat_map(|a| (0..=a).map(move |b| (a, b)));
        let lower = lower.map(|(a, b)| (self.unknowns[a], self.unknowns[b], self.matrix[a * n + b])).collect();
        (lower, self.unknowns.iter().copied().zip(self.rhs.iter().copied()).collect())
    }
}

/// What a part adds to the normal equations: lower triangle and right side.
pub(crate) type Terms = (Vec<(usize, usize, f64)>, Vec<(usize, f64)>);
