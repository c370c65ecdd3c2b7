//! Numbers of a rank among so many that they are only passed by.

use std::io;

/// Bits that one pass settles.
const DIGIT: u32 = 16;

/// Numbers that can be passed by as often as wanted, `N` at a time.
pub(crate) type Passed<'a, const N: usize> = dyn Fn(&mut dyn FnMut([f64; N])) -> io::Result<()> + 'a;

/// Of each of the `N` columns the number of this rank, from 0, in the order of [`f64::total_cmp`]: digit by digit, by counting those
/// with the digits that are known (Knuth, *The Art of Computer Programming* 3, 5.2.5).
/// # Errors
/// Those of the passes.
pub(crate) fn ranked<const N: usize>(rank: u64, pass: &Passed<N>) -> io::Result<[f64; N]> {
    let mut known = [0u64; N];
    let mut left = [rank; N];
    for digit in (0..u64::BITS / DIGIT).rev() {
        let below = digit * DIGIT;
        let mut counts = vec![0u64; N << DIGIT];
        pass(&mut |numbers| {
            for k in 0..N {
                let key = key(numbers[k]);
                if digit + 1 == u64::BITS / DIGIT || (key ^ known[k]) >> (below + DIGIT) == 0 {
                    counts[k << DIGIT | (key >> below) as usize & ((1 << DIGIT) - 1)] += 1;
                }
            }
        })?;
        for k in 0..N {
            let mut of = counts[k << DIGIT..(k + 1) << DIGIT].iter().zip(0u64..);
            let found = of.find(|(count, _)| {
                let here = **count > left[k];
                if !here {
                    left[k] -= **count;
                }
                here
            });
            known[k] |= found.map_or(0, |f| f.1) << below;
        }
    }
    Ok(known.map(number))
}

/// Whole numbers in the order of [`f64::total_cmp`].
fn key(x: f64) -> u64 {
    let bits = x.to_bits();
    if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
}

fn number(key: u64) -> f64 {
    f64::from_bits(if key >> 63 == 1 { key ^ 1 << 63 } else { !key })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rank_of_numbers_of_all_kinds_is_that_of_the_sorted_ones() {
        let mut numbers = vec![0.0, -0.0, 1.0, -1.0, 1e-300, -1e300, 5e-324, f64::INFINITY, f64::NEG_INFINITY];
        numbers.extend((0..50).map(|k| (k as f64).sin() * 10f64.powi(k % 7)));
        numbers.extend([3.5; 20]);
        let pass = |see: &mut dyn FnMut([f64; 2])| {
            numbers.iter().for_each(|&x| see([x, -x]));
            Ok(())
        };
        let sorted = |numbers: &[f64]| {
            let mut sorted = numbers.to_vec();
            sorted.sort_by(f64::total_cmp);
            sorted
        };
        let (up, down) = (sorted(&numbers), sorted(&numbers.iter().map(|x| -x).collect::<Vec<_>>()));
        for rank in 0..numbers.len() {
            let found = ranked(rank as u64, &pass).unwrap();
            assert_eq!(found.map(f64::to_bits), [up[rank], down[rank]].map(f64::to_bits), "{rank}");
        }
    }
}
