//! Misaligned views: one surface, scanned twice, with an offset above the noise.
//!
//! Two sheets side by side are a plate, a gap, or one surface that was measured twice. The rest of the scan tells: its winding
//! number is the same on both sides of a plate; a surface that was seen twice leaves a hole in the rest, through which the number
//! steps from outside to inside. See `docs/methods/samples.md`, section 5.

use super::Hints;
use crate::cloud::Dipoles;
use crate::cloud::local::fitted::Fit;
use crate::cloud::sites::front::other_sheet;
use crate::geom::KdTree;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Distances from the sheets at which the two sides are looked at, in radii of the fits.
const LOOK_RADII: [f64; 2] = [1.0, 3.0];
/// Pairs of sheets within this many of these distances are the surface in the hole.
const HOLE_REACH: f64 = 8.0;
/// Least step of the winding number, and its share of what a hole of this shape has.
const LEAST_WINDING_STEP: f64 = 0.15;
const LEAST_WINDING_SHARE: f64 = 0.5;
/// A scanner sees one side of a sheet for sure if the cosine of its ray and the normal is above this.
const GRAZING: f64 = 0.2;
/// Times that pairs are asked.
const PAIR_ROUNDS: usize = 8;

/// Sites whose two sheets are one surface, seen twice, and the distance of the sheets there.
///
/// * `sign` - 1 or -1 for the normal of every fit
pub(crate) fn aside(fits: &[Fit], sign: &[f64], hints: &Hints) -> Vec<(u32, f64)> {
    let layered = |i: usize| fits[i].gap.is_finite();
    let pairs: Vec<usize> =
        (0..fits.len()).filter(|&i| layered(i) && other_sheet(fits, i) == Some(i + 1) && layered(i + 1)).collect();
    if pairs.is_empty() {
        return Vec::new();
    }
    let middles: Vec<DVec3> = pairs.iter().map(|&i| (fits[i].center + fits[i + 1].center) / 2.0).collect();
    let area = |k: usize| (hints.areas[pairs[k]] + hints.areas[pairs[k] + 1]) / 2.0;
    let tree = KdTree::new(&middles);
    let mut rest: Vec<(DVec3, DVec3)> = (0..fits.len())
        .filter(|&i| !layered(i))
        .map(|i| (fits[i].center, sign[i] * hints.areas[i] * fits[i].normal))
        .collect();
    // Of each pair the way that it looks as one surface, 1 or -1 for the normal of its first sheet, 0 while it is a plate.
    let told: Vec<Option<f64>> = pairs.iter().map(|&i| seen(fits, i, hints)).collect();
    let mut way: Vec<f64> = told.iter().map(|t| t.unwrap_or(0.0)).collect();
    let mut fresh: Vec<usize> = (0..pairs.len()).filter(|&k| way[k] != 0.0).collect();
    // What is one surface helps to tell what is around it.
    for _ in 0..PAIR_ROUNDS {
        rest.extend(fresh.iter().map(|&k| (middles[k], way[k] * area(k) * fits[pairs[k]].normal)));
        let dipoles = Dipoles::new(&rest);
        let looks = |k: usize| -> Option<f64> {
            let (f, n) = (&fits[pairs[k]], fits[pairs[k]].normal);
            LOOK_RADII.into_iter().find_map(|away| {
                let h = away * f.radius;
                let sides = [middles[k] - h * n, middles[k] + h * n];
                let mut own = 0.0;
                tree.within(middles[k], HOLE_REACH * h, |j, c, _| {
                    let j = j as usize;
                    let m = fits[pairs[j]].normal;
                    if way[j] == 0.0 {
                        let of = |p: DVec3| (c - p).dot(m) / (c - p).length().powi(3);
                        own += area(j) * n.dot(m).signum() * (of(sides[0]) - of(sides[1])) / (4.0 * PI);
                    }
                });
                let step = dipoles.number(sides[0], 0.0) - dipoles.number(sides[1], 0.0);
                (step.abs() > f64::max(LEAST_WINDING_STEP, LEAST_WINDING_SHARE * (1.0 - own))).then_some(step.signum())
            })
        };
        let asked = (0..pairs.len()).into_par_iter().filter(|&k| told[k].is_none() && way[k] == 0.0);
        let found: Vec<(usize, f64)> = asked.filter_map(|k| Some((k, looks(k)?))).collect();
        if found.is_empty() {
            break;
        }
        found.iter().for_each(|&(k, w)| way[k] = w);
        fresh = found.into_iter().map(|l| l.0).collect();
    }
    (0..pairs.len()).filter(|&k| way[k] != 0.0).map(|k| (fits[pairs[k]].site, fits[pairs[k]].gap)).collect()
}

/// The way that two sheets look as one surface if scanners see them from the same side, zero for a plate; `None` where they
/// do not tell.
fn seen(fits: &[Fit], first: usize, hints: &Hints) -> Option<f64> {
    let (f, g, toward) = (&fits[first], &fits[first + 1], hints.toward?);
    let (a, b) = (toward[first].dot(f.normal), toward[first + 1].dot(g.normal));
    let same = a * b * f.normal.dot(g.normal) > 0.0;
    (a.abs().min(b.abs()) > GRAZING).then_some(if same { a.signum() } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Quadric;

    const LEAST_WINDING_STEP: f64 = 0.05;

    fn fit(center: DVec3, normal: DVec3, site: usize, gap: f64) -> Fit {
        Fit {
            quadric: Quadric::plane(center, 1.0, normal),
            center,
            normal,
            radius: 2.0 * LEAST_WINDING_STEP,
            noise: 0.003,
            thickness: 1.0,
            error: 1e-4,
            irregularity: 0.0,
            class: 0,
            site: site as u32,
            sheets: if gap.is_finite() { 2 } else { 1 },
            gap,
            owned: 10,
        }
    }

    /// Samples on a square, with two sheets within `hole` of its middle and one elsewhere up to `size`; signs as for a plate.
    fn square(hole: f64, size: f64) -> (Vec<Fit>, Vec<f64>) {
        let (mut fits, mut sign) = (Vec::new(), Vec::new());
        let count = (2.0 * size / LEAST_WINDING_STEP).round() as usize;
        for k in 0..count * count {
            let p = LEAST_WINDING_STEP * DVec3::new((k % count) as f64 + 0.5, (k / count) as f64 + 0.5, 0.0)
                - DVec3::new(size, size, 0.0);
            if p.abs().max_element() < hole {
                fits.extend([-1.0, 1.0].map(|s| fit(p + 0.006 * s * DVec3::Z, DVec3::Z, k, 0.012)));
                sign.extend([-1.0, 1.0]);
            } else {
                fits.push(fit(p, DVec3::Z, k, f64::INFINITY));
                sign.push(1.0);
            }
        }
        (fits, sign)
    }

    fn found(hole: f64, size: f64, toward: Option<[DVec3; 2]>) -> usize {
        let (fits, sign) = square(hole, size);
        let areas: Vec<f64> = fits.iter().map(|_| LEAST_WINDING_STEP * LEAST_WINDING_STEP).collect();
        let toward: Option<Vec<DVec3>> =
            toward.map(|t| fits.iter().map(|f| t[usize::from(f.center.z > 0.0)]).collect());
        let hints = Hints { toward: toward.as_deref(), normals: None, areas: &areas };
        let found = aside(&fits, &sign, &hints);
        assert!(found.iter().all(|f| f.1 == 0.012));
        found.len()
    }

    #[test]
    fn two_sheets_in_a_hole_of_one_are_one_surface_and_two_alone_are_a_plate() {
        assert_eq!(found(0.3, 1.0, None), 144);
        assert_eq!(found(0.3, 0.3, None), 0);
    }

    #[test]
    fn scanners_tell_a_plate_from_a_surface_that_was_seen_twice() {
        assert_eq!(found(0.3, 0.3, Some([DVec3::Z; 2])), 144);
        assert_eq!(found(0.3, 1.0, Some([-DVec3::Z, DVec3::Z])), 0);
    }
}
