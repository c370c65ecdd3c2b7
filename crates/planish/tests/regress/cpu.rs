//! Computing time in units of a fixed piece of work, so that figures of different machines may be held together.

use std::hint::black_box;

/// Time that this thread has spent computing, seconds; nothing where the system does not tell (it is Linux that does).
pub fn seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(stat.split(' ').next()?.parse::<f64>().ok()? * 1e-9)
}

/// Computing time of the fixed piece of work, seconds.
pub fn calibration() -> Option<f64> {
    let start = seconds()?;
    black_box(work(black_box(1)));
    Some(seconds()? - start)
}

/// Cells along the sides of the volume, and sweeps over it.
const SIDE: usize = 64;
const SWEEPS: usize = 24;
/// Numbers that are sorted, and links of the chain that is followed.
const SORTED: usize = 1 << 19;
const LINKS: usize = 1 << 20;

/// What the library does, in small: sweeps over numbers in a row, comparing, and jumps about the memory. It uses
/// nothing of the library, which may become faster.
fn work(seed: u64) -> f64 {
    let mut state = seed;
    let mut next = || {
        // Knuth's MMIX generator; the upper bits are the good ones.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        state >> 33
    };
    let mut volume: Vec<f64> = (0..SIDE * SIDE * SIDE).map(|_| next() as f64).collect();
    for _ in 0..SWEEPS {
        for i in SIDE * SIDE..volume.len() - SIDE * SIDE {
            let around = volume[i - 1] + volume[i + 1] + volume[i - SIDE] + volume[i + SIDE];
            volume[i] = (around + volume[i - SIDE * SIDE] + volume[i + SIDE * SIDE]) / 6.0;
        }
    }
    let mut sorted: Vec<f64> = (0..SORTED).map(|_| next() as f64).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    // A single cycle through all links (Sattolo 1986).
    let mut links: Vec<u32> = (0..LINKS as u32).collect();
    for i in (1..LINKS).rev() {
        links.swap(i, next() as usize % i);
    }
    let end = (0..LINKS).fold(0, |at, _| links[at as usize]);
    volume[volume.len() / 2] + sorted[SORTED / 2] + end as f64
}
