//! Counter-based random numbers: the n-th number of a seed costs the same as the first, so parallel work
//! draws the same numbers on any number of threads.
//!
//! The mixing step is Steele, Lea and Flood's SplitMix64 finaliser (*Fast Splittable Pseudorandom Number
//! Generators*, 2014) applied to seed and counter.

/// 64 well-mixed bits for `counter` of the stream `seed`.
pub fn bits(seed: u64, counter: u64) -> u64 {
    mix(mix(seed.wrapping_add(GOLDEN)).wrapping_add(counter.wrapping_mul(GOLDEN)))
}

/// A uniform number in `[0, 1)`.
pub fn unit(seed: u64, counter: u64) -> f64 {
    // The upper 53 bits are the mantissa of a number in [0, 1).
    (bits(seed, counter) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// A normally distributed number of mean 0 and deviation 1 from two uniform ones (Box and Muller 1958).
pub fn normal(u: f64, v: f64) -> f64 {
    (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// Odd part of 2^64 divided by the golden ratio: consecutive multiples spread evenly.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_numbers_of_one_seed_have_mean_half_and_variance_one_twelfth() {
        let n = 100_000;
        let draw: Vec<f64> = (0..n).map(|k| unit(7, k)).collect();
        let mean = draw.iter().sum::<f64>() / n as f64;
        let variance = draw.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n as f64;
        assert!((mean - 0.5).abs() < 0.005, "{mean}");
        assert!((variance - 1.0 / 12.0).abs() < 0.002, "{variance}");
        assert!(draw.iter().all(|x| (0.0..1.0).contains(x)));
    }

    #[test]
    fn neighbouring_seeds_draw_unrelated_numbers() {
        let n = 20_000;
        let product: f64 = (0..n).map(|k| (unit(1, k) - 0.5) * (unit(2, k) - 0.5)).sum::<f64>() / n as f64;
        assert!(product.abs() < 0.003, "{product}");
    }
}
