//! Random numbers of a seed, and what is drawn from them.

use planish::geom::random;

/// A stream of random numbers.
pub struct Dice {
    seed: u64,
    count: u64,
}

impl Dice {
    pub fn new(seed: u64) -> Dice {
        Dice { seed, count: 0 }
    }

    /// From 0 to 1.
    pub fn unit(&mut self) -> f64 {
        self.count += 1;
        random::unit(self.seed, self.count)
    }

    /// From -1 to 1.
    pub fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// A whole number below `n`; 0 if there is none.
    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    /// True with this chance.
    pub fn is(&mut self, chance: f64) -> bool {
        self.unit() < chance
    }

    pub fn one<'a, T>(&mut self, of: &'a [T]) -> &'a T {
        &of[self.below(of.len())]
    }

    /// A power of ten with its exponent in a range.
    pub fn power(&mut self, from: i32, to: i32) -> f64 {
        10f64.powi(from + self.below((to - from + 1) as usize) as i32)
    }

    pub fn place(&mut self) -> [f64; 3] {
        [0; 3].map(|_| self.signed())
    }

    /// A number that a person would not write: none, endless, beyond its range, or an ordinary one.
    pub fn odd(&mut self) -> f64 {
        let usual = self.signed() * 10.0;
        *self.one(&[
            0.0,
            -0.0,
            -1.0,
            1.0,
            1e-300,
            1e-30,
            1e-9,
            1e9,
            1e30,
            1e300,
            f64::MAX,
            f64::NAN,
            f64::INFINITY,
            usual,
            usual,
        ])
    }
}
