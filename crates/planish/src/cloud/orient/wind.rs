//! Patches that look the wrong way as a whole.
//!
//! Where a patch and the rest of a scan meet in votes of opposite points alone, as horns do whose roots no view has seen, one
//! wrong vote turns all of it. What the file knows of the outside decides; else the winding number: on a surface it is one
//! half, and a patch adds its share to that of the rest, which with the other sign it would take away (Barill et al. 2018).

use super::link::Vote;
use super::{DECIDED_WINDING, FLIP_SWEEPS, Hints, patches};
use crate::cloud::Dipoles;
use crate::cloud::local::fitted::Fit;
use crate::geom::tolerance::divisor;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Least number of samples of a patch that is asked, and how many of them at most.
const FEWEST_PATCH_SAMPLES: usize = 30;
const MOST_PATCH_SAMPLES: usize = 1000;
/// Samples within this share of the width that a sample stands for say nothing of its winding number: that is itself. Others
/// count, though their planes may go through it: the rims of a short bore are not much farther away.
const SKIP: f64 = 0.5;
/// A patch turns from such a product of its own winding number and of what the rest has above one half: where it looks the
/// right way the two cancel but for the error e of the rest, so own (e - own) is at most e^2 / 4. Holes between views made e
/// .13 (a dragon) and .12 (four views of a part), .06 in whole scans; parts of scans that looked the wrong way had .014 and more.
const GAIN: f64 = 0.16 * 0.16 / 4.0;

/// Turns patches over, one after the other, the most certain first.
///
/// * `is_closed` - whether a sample belongs to a closed part: on an open one the winding number is anything
pub(crate) fn wind(
    sign: &mut [f64],
    fits: &[Fit],
    votes: &[Vote],
    hints: &Hints,
    is_closed: impl Fn(usize) -> bool + Sync,
) {
    for _ in 0..FLIP_SWEEPS {
        let mut members: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        patches(sign, votes).iter().enumerate().for_each(|(i, &p)| members.entry(p).or_default().push(i));
        let dipole = |i: usize| (fits[i].center, sign[i] * hints.areas[i] * fits[i].normal);
        let all = Dipoles::new(&(0..fits.len()).map(dipole).collect::<Vec<_>>());
        let gain = |own: &[usize]| -> f64 {
            let area: f64 = own.iter().map(|&i| hints.areas[i]).sum();
            for known in [hints.toward, hints.normals].into_iter().flatten() {
                let outward: f64 = own.iter().map(|&i| dipole(i).1.dot(known[i])).sum();
                if outward.abs() > DECIDED_WINDING * area {
                    return -outward / area;
                }
            }
            if !is_closed(own[0]) {
                return 0.0;
            }
            let alone = Dipoles::new(&own.iter().map(|&i| dipole(i)).collect::<Vec<_>>());
            let (mut gain, mut asked) = (0.0, 0.0);
            for &i in own.iter().step_by(own.len().div_ceil(MOST_PATCH_SAMPLES)) {
                asked += hints.areas[i];
                // Between two sheets side by side the number of samples says nothing.
                if fits[i].gap.is_finite() {
                    continue;
                }
                let [all, own] = [&all, &alone].map(|d| d.number(fits[i].center, SKIP * hints.areas[i].sqrt()));
                gain += hints.areas[i] * own * (all - own - 0.5);
            }
            gain / divisor(asked)
        };
        let gains: Vec<(f64, &Vec<usize>)> =
            members.par_iter().filter(|m| m.1.len() >= FEWEST_PATCH_SAMPLES).map(|(_, own)| (gain(own), own)).collect();
        let best = gains.into_iter().max_by(|a, b| a.0.total_cmp(&b.0).then(b.1[0].cmp(&a.1[0])));
        let Some((_, own)) = best.filter(|b| b.0 > GAIN) else { break };
        own.iter().for_each(|&i| sign[i] = -sign[i]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Quadric;
    use glam::DVec3;

    fn fit(center: DVec3, normal: DVec3, site: u32) -> Fit {
        Fit {
            quadric: Quadric::plane(center, 1.0, normal),
            center,
            normal,
            radius: 0.1,
            noise: 0.01,
            thickness: 1.0,
            error: 1e-3,
            irregularity: 0.0,
            class: 0,
            site,
            sheets: 1,
            gap: f64::INFINITY,
            owned: 10,
        }
    }

    /// A ball of samples that look outwards, those above `z` joined among themselves, the others, too, and both not.
    fn ball(z: f64) -> (Vec<Fit>, Vec<Vote>) {
        let fits: Vec<Fit> = (0..2000)
            .map(|k| {
                let h = 1.0 - (2 * k + 1) as f64 / 2000.0;
                let (s, c) = (2.399963 * k as f64).sin_cos();
                let normal = DVec3::new((1.0 - h * h).sqrt() * c, (1.0 - h * h).sqrt() * s, h);
                fit(normal, normal, k)
            })
            .collect();
        let votes = (1..2000u32)
            .filter(|&b| (fits[b as usize].center.z > z) == (fits[b as usize - 1].center.z > z))
            .map(|b| Vote { a: b - 1, b, sign: 1.0, weight: 1.0, smooth: true })
            .collect();
        (fits, votes)
    }

    fn turned(z: f64, toward: Option<&[DVec3]>, closed: bool) -> Vec<f64> {
        let (fits, votes) = ball(z);
        let areas = vec![4.0 * std::f64::consts::PI / 2000.0; 2000];
        let mut sign: Vec<f64> = fits.iter().map(|f| if f.center.z > z { -1.0 } else { 1.0 }).collect();
        wind(&mut sign, &fits, &votes, &Hints { toward, normals: None, areas: &areas }, |_| closed);
        sign
    }

    #[test]
    fn a_cap_of_a_ball_that_looks_inwards_turns_over_whether_small_or_large() {
        for z in [0.8, 0.0, -0.5] {
            assert!(turned(z, None, true).iter().all(|s| *s == 1.0), "{z}");
        }
    }

    #[test]
    fn a_bore_as_short_as_samples_are_apart_looks_inwards_and_stays_so() {
        // A plate of 14 x 14 x 1.3 with a bore of radius 2.15; samples .65 apart, those of the faces .18 off its rims.
        let (half, high, bore, step, aside, keep_off) = (7.15, 0.65, 2.15, 0.65, 0.15, 0.18);
        let grid = |half: f64| {
            let n = (2.0 * half / step).round();
            (0..n as usize).map(move |k| half * ((2 * k + 1) as f64 / n - 1.0))
        };
        let mut at: Vec<(DVec3, DVec3)> = Vec::new();
        for (x, y) in grid(half)
            .flat_map(|x| grid(half).map(move |y| (x, y)))
            .filter(|(x, y)| (x - aside).hypot(*y) > bore + keep_off)
        {
            at.extend([1.0, -1.0].map(|s| (DVec3::new(x, y, s * high), DVec3::Z * s)));
        }
        for (x, z) in grid(half).flat_map(|x| grid(high).map(move |z| (x, z))) {
            for s in [1.0, -1.0] {
                at.push((DVec3::new(s * half, x, z), DVec3::X * s));
                at.push((DVec3::new(x, s * half, z), DVec3::Y * s));
            }
        }
        let outside = at.len();
        for (k, z) in (0..21).flat_map(|k| grid(high).map(move |z| (k, z))) {
            let (sin, cos) = (k as f64 * std::f64::consts::TAU / 21.0).sin_cos();
            let out = DVec3::new(cos, sin, 0.0);
            at.push((DVec3::new(aside, 0.0, z) + bore * out, -out));
        }
        let fits: Vec<Fit> = at.iter().enumerate().map(|(k, x)| fit(x.0, x.1, k as u32)).collect();
        let votes: Vec<Vote> = (1..fits.len())
            .filter(|&b| b != outside)
            .map(|b| Vote { a: b as u32 - 1, b: b as u32, sign: 1.0, weight: 1.0, smooth: true })
            .collect();
        let mut sign = vec![1.0; fits.len()];
        let areas = vec![step * step; fits.len()];
        wind(&mut sign, &fits, &votes, &Hints { toward: None, normals: None, areas: &areas }, |_| true);
        assert!(sign.iter().all(|s| *s == 1.0));
    }

    #[test]
    fn a_bowl_in_an_open_scan_stays_as_it_is() {
        assert!(turned(0.8, None, false).iter().any(|s| *s == -1.0));
    }

    #[test]
    fn scanners_come_before_the_winding_number() {
        let center: Vec<DVec3> = ball(0.0).0.iter().map(|f| -f.center).collect();
        assert!(turned(0.5, Some(&center), true).iter().all(|s| *s == -1.0));
    }
}
