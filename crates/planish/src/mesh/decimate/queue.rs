//! A queue of edges by cost, nearly in order.
//!
//! Costs fall into buckets of a sixty-fourth of an octave; within a bucket the last comes first. A heap of a million
//! entries costs more than everything else that a collapse does, and so small a disorder changes nothing that counts.
//!
//! See `docs/methods/contour.md`, "Decimation".

/// Bits of the mantissa that tell buckets apart.
const MANTISSA: u32 = 6;
/// Octaves below the greatest cost that are told apart: lower costs are all alike.
const OCTAVES: usize = 96;
const BUCKETS: usize = OCTAVES << MANTISSA;

/// An edge with the state of its ends when it was put in.
#[derive(Clone, Copy)]
pub struct Entry {
    pub half_edge: u32,
    pub stamp: u32,
}

/// Edges by cost.
pub struct Queue {
    buckets: Vec<Vec<Entry>>,
    /// No bucket before this has an entry.
    least: usize,
    /// Bits of the lowest cost that is told apart.
    floor: u64,
}

impl Queue {
    /// An empty queue for costs up to `greatest`.
    pub fn new(greatest: f64) -> Queue {
        let top = greatest.max(f64::MIN_POSITIVE).to_bits() >> (52 - MANTISSA);
        let floor = top.saturating_sub(BUCKETS as u64 - 1);
        Queue { buckets: vec![Vec::new(); BUCKETS], least: BUCKETS, floor }
    }

    /// Puts an edge in; costs are not negative.
    pub fn push(&mut self, cost: f64, entry: Entry) {
        let bucket = self.bucket(cost);
        self.buckets[bucket].push(entry);
        self.least = self.least.min(bucket);
    }

    /// True if edges of lower costs, by more than a bucket, may be waiting.
    pub fn passed(&self, cost: f64) -> bool {
        self.bucket(cost) > self.least + 1
    }

    fn bucket(&self, cost: f64) -> usize {
        // The bits of numbers that are not negative are in their order.
        let bits = cost.to_bits() >> (52 - MANTISSA);
        (bits.saturating_sub(self.floor) as usize).min(BUCKETS - 1)
    }

    /// Takes out an edge of the lowest bucket.
    pub fn pop(&mut self) -> Option<Entry> {
        loop {
            if let Some(entry) = self.buckets.get_mut(self.least)?.pop() {
                return Some(entry);
            }
            self.least += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;

    #[test]
    fn a_thousand_costs_come_in_order_within_a_sixty_fourth_of_an_octave() {
        let cost = |k: u32| random::unit(3, k as u64).powi(20);
        let mut queue = Queue::new(1.0);
        for k in 0..1000 {
            queue.push(cost(k), Entry { half_edge: k, stamp: 0 });
        }
        let mut before = 0.0;
        for n in 0..1000 {
            let here = cost(queue.pop().unwrap().half_edge);
            assert!(here > before / 1.02 - 1e-20, "{n}: {here} after {before}");
            before = here.max(before);
        }
        assert!(queue.pop().is_none());
        queue.push(0.5, Entry { half_edge: 1, stamp: 7 });
        queue.push(0.0, Entry { half_edge: 2, stamp: 7 });
        assert_eq!(queue.pop().unwrap().half_edge, 2);
        assert_eq!(queue.pop().unwrap().half_edge, 1);
    }
}
