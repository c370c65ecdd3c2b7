//! Vertices at exactly the same place become one.

use glam::DVec3;
use rayon::prelude::*;

/// For each point the index of its merged vertex, and for each merged vertex the point that it was made of:
/// the first at its place. Merged vertices keep the order of first appearance. `-0` equals `0`.
///
/// Sorts instead of hashing: the same result on any number of threads, and no input makes it slow.
pub(crate) fn weld(points: &[DVec3]) -> (Vec<u32>, Vec<u32>) {
    // Adding zero turns -0 into 0; the order of the bit patterns is a total order, NaN included.
    let key = |p: DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
    let mut order: Vec<([u64; 3], u32)> = points.par_iter().enumerate().map(|(v, &p)| (key(p), v as u32)).collect();
    order.par_sort_unstable();
    let mut first = vec![0u32; points.len()];
    for run in order.chunk_by(|a, b| a.0 == b.0) {
        for &(_, v) in run {
            first[v as usize] = run[0].1;
        }
    }
    let mut merged = vec![0u32; points.len()];
    let mut source = Vec::new();
    for v in 0..points.len() {
        if first[v] as usize == v {
            merged[v] = source.len() as u32;
            source.push(v as u32);
        } else {
            merged[v] = merged[first[v] as usize];
        }
    }
    (merged, source)
}
