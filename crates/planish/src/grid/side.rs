//! Boundary nodes: a side of a patch resampled by arc length.
//!
//! Two patches that share a curve hold the same points in opposite order and must get the same bits. Every sum
//! therefore runs in one canonical direction, the lexicographically smaller reading of the chain.
//!
//! [K98] §5.4 and §5.6.

use crate::geom::polyline::{self, Along};
use glam::DVec3;

/// A segment shorter than this fraction of the mean one is taken as that long in the chart, so that the chart's
/// boundary stays strictly monotone where a chain repeats a point. Far below any real edge, far above rounding.
const SHORTEST_SEGMENT: f64 = 1e-9;

/// A side resampled by arc length, in the direction of the side.
pub struct SideSamples {
    /// Positions; the first and the last are the ends of the chain.
    pub points: Vec<DVec3>,
    /// For each point the segment of the chain that it lies on (from vertex `k` to vertex `k + 1`) ...
    pub segment: Vec<u32>,
    /// ... and where on it, 0 to 1.
    pub fraction: Vec<f64>,
}

/// True if the chain reads smaller, point by point, from its end.
fn runs_backwards(chain: &[DVec3]) -> bool {
    for (a, b) in chain.iter().zip(chain.iter().rev()) {
        for (x, y) in a.to_array().into_iter().zip(b.to_array()) {
            if x != y {
                return x > y;
            }
        }
    }
    false
}

/// Length of a chain, the same bits for both directions.
pub fn length(chain: &[DVec3]) -> f64 {
    if runs_backwards(chain) {
        return polyline::length(chain.iter().rev().copied());
    }
    polyline::length(chain.iter().copied())
}

/// Stops of a side: shares of its length, rising, with the node that lies there. Shares are multiples of
/// [`STOP_STEP`], so that both directions of a chain have the same bits.
pub type Stops = Vec<(f64, usize)>;

/// Step of the shares of stops.
const STOP_STEP: f64 = 1.0 / (1u64 << 40) as f64;

/// The multiple of [`STOP_STEP`] nearest to a share.
pub fn stop_share(share: f64) -> f64 {
    (share / STOP_STEP).round() * STOP_STEP
}

/// The stops of a side read from its other end.
pub fn turned(stops: &Stops, count: usize) -> Stops {
    stops.iter().rev().map(|&(s, k)| (1.0 - s, count - 1 - k)).collect()
}

/// Share of the length at node `k` of `count`: even between stops.
fn share_at(k: usize, count: usize, stops: &Stops) -> f64 {
    let after = stops.iter().position(|s| s.1 > k).unwrap_or(stops.len());
    let low = if after > 0 { stops[after - 1] } else { (0.0, 0) };
    let high = stops.get(after).copied().unwrap_or((1.0, count - 1));
    if high.1 == low.1 {
        return low.0;
    }
    low.0 + (high.0 - low.0) * ((k - low.1) as f64 / (high.1 - low.1) as f64)
}

/// Place in the chart, 0 to 1, of a share of the length: nodes lie evenly in the chart.
fn chart_at(share: f64, count: usize, stops: &Stops) -> f64 {
    let after = stops.iter().position(|s| s.0 > share).unwrap_or(stops.len());
    let low = if after > 0 { stops[after - 1] } else { (0.0, 0) };
    let high = stops.get(after).copied().unwrap_or((1.0, count - 1));
    let t = if high.0 > low.0 { (share - low.0) / (high.0 - low.0) } else { 0.0 };
    (low.1 as f64 + t * (high.1 - low.1) as f64) / (count - 1) as f64
}

/// `count >= 2` points of `chain` at equal arc length.
#[cfg(test)]
pub fn resample(chain: &[DVec3], count: usize) -> SideSamples {
    resample_at(chain, count, &Stops::new())
}

/// `count >= 2` points of `chain` at equal arc length between stops.
pub fn resample_at(chain: &[DVec3], count: usize, stops: &Stops) -> SideSamples {
    let backwards = runs_backwards(chain);
    let canonical: Vec<DVec3> = if backwards { chain.iter().rev().copied().collect() } else { chain.to_vec() };
    let stops = if backwards { turned(stops, count) } else { stops.clone() };
    let mut along = Along::new(canonical.iter().copied());
    let total = along.length();
    let segments = canonical.len() - 1;
    let mut out = SideSamples { points: Vec::new(), segment: Vec::new(), fraction: Vec::new() };
    for k in 0..count {
        let share = if stops.is_empty() { k as f64 / (count - 1) as f64 } else { share_at(k, count, &stops) };
        let target = total * share;
        let (s, t) = along.advance(target);
        let (segment, t, point) = match k {
            0 => (0, 0.0, canonical[0]),
            _ if k + 1 == count => (segments - 1, 1.0, canonical[segments]),
            _ => (s, t, canonical[s] + (canonical[s + 1] - canonical[s]) * t),
        };
        out.points.push(point);
        out.segment.push(if backwards { segments - 1 - segment } else { segment } as u32);
        out.fraction.push(if backwards { 1.0 - t } else { t });
    }
    if backwards {
        out.points.reverse();
        out.segment.reverse();
        out.fraction.reverse();
    }
    out
}

/// Place of every vertex of `chain` in the chart: 0 to 1, strictly rising, by arc length between stops.
pub fn fractions_at(chain: &[DVec3], count: usize, stops: &Stops) -> Vec<f64> {
    let mut at = fractions(chain);
    if !stops.is_empty() {
        at.iter_mut().for_each(|s| *s = chart_at(*s, count, stops));
    }
    at
}

/// Arc length of every vertex of `chain` over its whole length: 0 to 1, strictly rising.
pub fn fractions(chain: &[DVec3]) -> Vec<f64> {
    let lengths: Vec<f64> = chain.windows(2).map(|p| p[0].distance(p[1])).collect();
    let floor = SHORTEST_SEGMENT * lengths.iter().sum::<f64>() / lengths.len() as f64;
    let mut sums = vec![0.0];
    for l in &lengths {
        sums.push(sums[sums.len() - 1] + l.max(floor));
    }
    let total = sums[sums.len() - 1];
    let last = sums.len() - 1;
    for s in &mut sums {
        *s /= total;
    }
    sums[last] = 1.0;
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_directions_of_a_chain_of_40_segments_give_the_same_17_points_bit_for_bit() {
        let chain: Vec<DVec3> = (0..41)
            .map(|k| {
                let t = (k as f64 / 40.0).powf(1.7) * 2.0;
                DVec3::new((3.1 * t).sin(), (1.3 * t).cos(), t * t)
            })
            .collect();
        let turned: Vec<DVec3> = chain.iter().rev().copied().collect();
        let (a, mut b) = (resample(&chain, 17), resample(&turned, 17));
        b.points.reverse();
        assert_eq!(a.points, b.points);
        assert_eq!(length(&chain).to_bits(), length(&turned).to_bits());
        assert_eq!((a.points[0], a.points[16]), (chain[0], chain[40]));
        for k in 0..17 {
            let (s, t) = (a.segment[k] as usize, a.fraction[k]);
            assert!(chain[s].lerp(chain[s + 1], t).distance(a.points[k]) < 1e-14);
        }
    }

    #[test]
    fn a_closed_curve_gives_the_same_points_in_both_directions() {
        let chain: Vec<DVec3> = (0..=12)
            .map(|k| {
                let a = (k % 12) as f64 / 12.0 * std::f64::consts::TAU;
                DVec3::new(a.cos(), a.sin(), (2.0 * a + 0.3).sin())
            })
            .collect();
        let turned: Vec<DVec3> = chain.iter().rev().copied().collect();
        let mut b = resample(&turned, 9).points;
        b.reverse();
        assert_eq!(resample(&chain, 9).points, b);
    }

    #[test]
    fn repeated_points_keep_the_chart_fractions_strictly_rising() {
        let p = DVec3::X;
        let f = fractions(&[DVec3::ZERO, p, p, p, 2.0 * p]);
        assert!(f.windows(2).all(|w| w[0] < w[1]));
        assert_eq!((f[0], f[4]), (0.0, 1.0));
    }
}
