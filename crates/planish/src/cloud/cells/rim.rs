//! Rims: where the two sides of a plate, or of a groove, end.
//!
//! Two sheets of a cell that face away from each other go on to the end of their supports, although the points stop: the face
//! between them is as narrow as the noise, and no fit stands on it. The plane across both beyond which no point lies takes its
//! place, if many points are missing there. It stands where as much of the two sheets lies beyond a place well inside as the
//! points beyond that place need at the density inside. See `docs/methods/samples.md`, section 6.

use crate::cloud::Quadric;
use crate::cloud::local::nest;
use crate::cloud::local::points::Points;
use glam::DVec3;

/// Two sheets are the sides of a plate if the angle between their normals is above 135 degrees.
const PLATE_COSINE: f64 = -0.7;
/// Places on each sheet.
const PLACES_PER_SHEET: usize = 96;
/// Directions that are tried, and rounds that halve the angle between them.
const RIM_DIRECTIONS: usize = 24;
const ANGLE_HALVINGS: usize = 4;
/// Points that must be missing, and share of the places without: chance leaves no such gap.
const FEWEST_MISSING: f64 = 20.0;
const BARE_SHARE: f64 = 0.12;
/// A place lies on the surface if the nesting is this close to zero, in noise levels.
const ON_SURFACE_NOISE: f64 = 0.25;
/// The density is that of what lies deeper than this many noise levels below the last point.
const DEEP_NOISE: f64 = 5.0;

/// Where two sheets end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rim {
    /// Unit normal of the plane, out of the data.
    pub normal: DVec3,
    /// A point of the plane, world units.
    pub at: DVec3,
    /// What lies between the sheets is outside.
    pub groove: bool,
}

/// The plane that ends the sheets in the ball of `radius` around `center`.
///
/// * `sheets`, `concave` - the nesting
/// * `points` - those of the ball
/// * `noise` - standard deviation of the points, world units
pub(crate) fn rim(
    sheets: &[Quadric],
    concave: u8,
    center: DVec3,
    radius: f64,
    points: &Points,
    noise: f64,
) -> Option<Rim> {
    let normals: Vec<DVec3> = sheets.iter().map(|s| s.distance(center).1).collect();
    let facing = (1..sheets.len()).flat_map(|k| (0..k).map(move |j| (j, k)));
    let (a, b) = facing.min_by(|p, q| normals[p.0].dot(normals[p.1]).total_cmp(&normals[q.0].dot(normals[q.1])))?;
    if normals[a].dot(normals[b]) > PLATE_COSINE {
        return None;
    }
    let across = (normals[a] - normals[b]).normalize();
    let u = across.any_orthonormal_vector();
    let v = across.cross(u);
    let surface: Vec<DVec3> = [a, b]
        .into_iter()
        .flat_map(|k| {
            (0..PLACES_PER_SHEET).filter_map(move |i| {
                // Vogel's spiral: equal areas.
                let r = radius * ((i as f64 + 0.5) / PLACES_PER_SHEET as f64).sqrt();
                let (s, c) = (i as f64 * 2.399_963_229_728_653).sin_cos();
                let foot = sheets[k].project(center + r * (c * u + s * v)).0;
                let (own, value) = nest::joined(sheets.iter().map(|q| q.distance(foot).0), concave);
                let on = own == k || value.abs() < ON_SURFACE_NOISE * noise;
                (on && foot.distance(center) < radius).then_some(foot)
            })
        })
        .collect();
    let count = surface.len() as f64;
    let bare = |angle: f64| {
        let w = angle.cos() * u + angle.sin() * v;
        let end = points.iter().map(|p| w.dot(p)).fold(f64::NEG_INFINITY, f64::max);
        (surface.iter().filter(|s| w.dot(**s) > end).count(), w, end)
    };
    let turn = std::f64::consts::TAU / RIM_DIRECTIONS as f64;
    let most = |angles: &mut dyn Iterator<Item = f64>| {
        angles.map(|t| (t, bare(t))).max_by(|p, q| p.1.0.cmp(&q.1.0).then(q.0.total_cmp(&p.0)))
    };
    let mut best = most(&mut (0..RIM_DIRECTIONS).map(|i| i as f64 * turn))?;
    for round in 1..=ANGLE_HALVINGS {
        let step = turn / f64::from(1 << round);
        best = most(&mut [-step, 0.0, step].into_iter().map(|d| best.0 + d))?;
    }
    let (missing, w, end) = best.1;
    let share = missing as f64 / count;
    if share < BARE_SHARE || points.len() as f64 * share / (1.0 - share) < FEWEST_MISSING {
        return None;
    }
    let deep = end - DEEP_NOISE * noise;
    let mut beyond: Vec<f64> = surface.iter().map(|s| w.dot(*s)).filter(|d| *d > deep).collect();
    beyond.sort_unstable_by(f64::total_cmp);
    let last = points.iter().filter(|p| w.dot(*p) > deep).count() as f64;
    let (inside, area) = (points.len() as f64 - last, count - beyond.len() as f64);
    if inside < FEWEST_MISSING || area < 1.0 {
        return None;
    }
    let needed = (last * area / inside).round() as usize;
    let at = beyond.get(needed).copied().unwrap_or(end).min(end);
    Some(Rim { normal: w, at: center + (at - w.dot(center)) * w, groove: concave >> b & 1 == 1 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;

    /// Both sides of a plate `thick` noise levels thick that ends at x = `end`, in a ball of radius 40 levels.
    fn plate(thick: f64, end: f64, seed: u64) -> (Vec<Quadric>, Points) {
        let normal = |k: u64| random::normal(random::unit(seed, 2 * k), random::unit(seed, 2 * k + 1));
        let points = (0..800u64)
            .map(|i| {
                let r = |k: u64| 80.0 * random::unit(seed + 1, 4 * i + k) - 40.0;
                (i, DVec3::new(r(0), r(1), if i % 2 == 0 { 0.0 } else { -thick }))
            })
            .filter(|(_, p)| p.x < end)
            .map(|(i, p)| p + DVec3::new(normal(3 * i), normal(3 * i + 1), normal(3 * i + 2)))
            .filter(|p| p.length() < 40.0)
            .collect();
        let side = |z: f64, up: f64| Quadric::plane(DVec3::new(0.0, 0.0, z), 40.0, DVec3::new(0.0, 0.0, up));
        (vec![side(0.0, 1.0), side(-thick, -1.0)], points)
    }

    #[test]
    fn a_plate_of_four_noise_levels_ends_within_two_levels_of_where_its_points_stop() {
        for seed in 0..10 {
            let (sheets, points) = plate(4.0, 5.0, 100 * seed);
            let end = rim(&sheets, 0, DVec3::ZERO, 40.0, &points, 1.0).unwrap();
            assert!(end.normal.x > 0.98 && !end.groove, "{end:?}");
            assert!((end.at.dot(end.normal) - 5.0 * end.normal.x).abs() < 2.0, "{end:?}");
        }
    }

    #[test]
    fn a_plate_that_goes_on_and_a_single_sheet_have_no_rim() {
        for seed in 0..10 {
            let (sheets, points) = plate(4.0, 60.0, 100 * seed);
            assert_eq!(rim(&sheets, 0, DVec3::ZERO, 40.0, &points, 1.0), None);
            assert_eq!(rim(&sheets[..1], 0, DVec3::ZERO, 40.0, &points, 1.0), None);
        }
    }
}
