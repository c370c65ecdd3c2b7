//! Normal equations of a few unknowns among many.

/// Normal equations of a few unknowns.
pub(crate) struct Sums {
    /// The unknowns, rising.
    unknowns: Vec<usize>,
    /// Lower triangle, row after row.
    pub lower: Vec<f64>,
    rhs: Vec<f64>,
}

impl Sums {
    pub fn new(mut unknowns: Vec<usize>) -> Sums {
        unknowns.sort_unstable();
        unknowns.dedup();
        let n = unknowns.len();
        Sums { unknowns, lower: vec![0.0; n * (n + 1) / 2], rhs: vec![0.0; n] }
    }

    /// The number of an unknown among these.
    pub fn rank(&self, unknown: usize) -> usize {
        self.unknowns.partition_point(|&u| u < unknown)
    }

    /// Adds at a row and a column (ranks, the column at most the row).
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        self.lower[row * (row + 1) / 2 + column] += value;
    }

    /// Adds on the right side, at a rank.
    pub fn add_right(&mut self, row: usize, value: f64) {
        self.rhs[row] += value;
    }

    /// Row and column of every entry of `lower`, as unknowns.
    pub fn places(&self) -> impl Iterator<Item = (usize, usize)> {
        self.unknowns.iter().enumerate().flat_map(|(rank, &a)| self.unknowns[..=rank].iter().map(move |&b| (a, b)))
    }

    /// The right side by unknowns.
    pub fn right(&self) -> impl Iterator<Item = (usize, f64)> {
        self.unknowns.iter().copied().zip(self.rhs.iter().copied())
    }
}
