//! A virtual range scanner: what a scan of a known surface looks like, so that results can be held against the truth.
//!
//! 1. stations one after the other where they see most of what none before has seen, as an operator would
//! 2. each sees the first surface along the rays of a square picture, so the density differs from place to place and what
//!    nobody sees stays empty; hits at grazing angles get lost, and where many stations see the same their points are
//!    thinned, as programs do that merge scans
//! 3. noise runs along the rays, some ranges are wrong altogether, and every station is a little misplaced

use crate::cloud::{Cloud, CloudError};
use crate::geom::{Bvh, KdTree, random};
use crate::mesh::TriMesh;
use crate::observe::{Cancelled, Observer};
use glam::{DQuat, DVec3};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// How a virtual scan is made. Lengths are fractions of the diagonal of the shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ScannerParams {
    /// Stations around the shape
    #[schemars(range(min = 1, max = 160))]
    pub stations: usize,
    /// Points of all stations, about
    #[schemars(range(min = 5_000, max = 5_000_000))]
    pub points: usize,
    /// Standard deviation of the points along the ray
    #[schemars(range(min = 0.0, max = 0.1), extend("unit" = "diagonal"))]
    pub noise: f64,
    /// Share of the hits whose range is wrong
    #[schemars(range(min = 0.0, max = 0.5), extend("unit" = "share"))]
    pub outliers: f64,
    /// Standard deviation of the misplacement of a station along each axis
    #[schemars(range(min = 0.0, max = 0.1), extend("unit" = "diagonal"))]
    pub shift: f64,
    /// Standard deviation of the turn of a station about the middle of the shape
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "degrees"))]
    pub turn_deg: f64,
    /// Seed of everything random
    pub seed: u64,
}

impl Default for ScannerParams {
    /// A structured-light scanner on a part: noise of .05 %, registration of .01 % and .01 degrees, 1 % wrong ranges.
    fn default() -> ScannerParams {
        ScannerParams {
            stations: 20,
            points: 60_000,
            noise: 5e-4,
            outliers: 0.01,
            shift: 1e-4,
            turn_deg: 0.01,
            seed: 0,
        }
    }
}

/// A scan of a known surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VirtualScan {
    /// The points with their stations.
    pub cloud: Cloud,
    /// For each point whether its range is wrong.
    pub stray: Vec<bool>,
}

/// Distance of a station from the middle, in diagonals: the whole shape is in the picture, and perspective shows.
const AWAY: f64 = 2.5;
/// Places where a station may stand, and spots of the surface that tell what it sees there.
const STATION_PLACES: usize = 160;
const SPOTS: usize = 5_000;
/// What a station adds to the spots that it sees, of the chance that their hits are kept.
const MEETINGS: f32 = 1.0;
/// Pixels along a side of the first look, which tells how many are needed for the points wanted.
const TRIAL: usize = 64;
/// Pixels along a side at most.
const MOST_PIXELS: usize = 16_384;
/// Hits flatter than the first angle begin to get lost, beyond the second all are, degrees from the normal.
const GRAZE_DEG: [f64; 2] = [70.0, 85.0];
/// Spots looked at for one whose normal is like that of a hit, and the cosine between those.
const AROUND: usize = 12;
const ALIKE: f64 = 0.8;
/// Places are thinned to this many times the density of those that are seen least, this part of the surface: a bore keeps
/// far fewer points than the face around it even so.
const EVEN_DENSITY: f64 = 2.0;
const LEAST_SEEN: f64 = 0.05;
/// Random numbers per pixel.
const DRAWS: u64 = 8;

/// Scans `truth` from stations all around.
/// # Errors
/// [`CloudError::TooFew`] if nothing is seen, [`CloudError::Cancelled`].
pub fn virtual_scan(
    truth: &TriMesh,
    params: &ScannerParams,
    observer: &dyn Observer,
) -> Result<VirtualScan, CloudError> {
    let nothing = CloudError::TooFew { given: 0, distinct: 0, needed: crate::cloud::FEWEST_POINTS };
    if truth.triangles.is_empty() || params.stations == 0 {
        return Err(nothing);
    }
    let tree = Bvh::watched(truth, observer)?;
    let bounds = truth.bounds();
    let (center, size) = (bounds.center(), bounds.diagonal());
    let (places, thinning) = chosen(truth, &tree, params, observer)?;
    let stations: Vec<Station> =
        places.into_iter().enumerate().map(|(k, out)| Station::new(k, out, center, size, params)).collect();
    let mut seen = 0.0;
    for station in &stations {
        observer.check()?;
        seen += station.look(truth, &tree, &thinning, TRIAL).iter().map(|h| h.chance).sum::<f64>();
    }
    if seen == 0.0 {
        return Err(nothing);
    }
    let wanted = (params.points.max(1) as f64 / seen).sqrt() * TRIAL as f64;
    let pixels = (wanted.round() as usize).clamp(8, MOST_PIXELS);
    let mut scan = VirtualScan::default();
    for (k, station) in stations.iter().enumerate() {
        observer.check()?;
        observer.progress(k as f64 / stations.len() as f64);
        scan.cloud.scanners.push(station.placed(station.eye));
        for hit in station.look(truth, &tree, &thinning, pixels) {
            let draw = |n: u64| random::unit(station.seed, DRAWS * hit.pixel + n);
            if draw(0) >= hit.chance {
                continue;
            }
            let stray = draw(1) < params.outliers;
            let range = match stray {
                // Anywhere along the ray where the shape might be.
                true => size * (AWAY - 0.5 + draw(2)),
                false => hit.range + params.noise * size * random::normal(draw(3), draw(4)),
            };
            scan.cloud.points.push(station.placed(station.eye + hit.ray * range));
            scan.cloud.seen_by.push(k as u32);
            scan.stray.push(stray);
        }
    }
    observer.progress(1.0);
    Ok(scan)
}

/// Directions from the middle to the stations, and what is kept where many of them see the same.
fn chosen(
    truth: &TriMesh,
    tree: &Bvh,
    params: &ScannerParams,
    observer: &dyn Observer,
) -> Result<(Vec<DVec3>, Thinning), Cancelled> {
    let bounds = truth.bounds();
    let (center, size) = (bounds.center(), bounds.diagonal());
    let start = TAU * random::unit(params.seed, u64::MAX);
    let places: Vec<DVec3> = (0..STATION_PLACES)
        .map(|k| {
            let height = 1.0 - (2 * k + 1) as f64 / STATION_PLACES as f64;
            let (sin, cos) = (PI * (1.0 + 5f64.sqrt()) * k as f64 + start).sin_cos();
            let flat = (1.0 - height * height).sqrt();
            DVec3::new(flat * cos, flat * sin, height)
        })
        .collect();
    let sums = truth.area_sums();
    let total = sums.last().copied().unwrap_or(0.0);
    let spots: Vec<(DVec3, DVec3)> = (0..SPOTS as u64)
        .map(|i| {
            let draw = |n: u64| random::unit(params.seed ^ 1, 4 * i + n);
            let t = sums.partition_point(|&s| s <= draw(0) * total).min(sums.len() - 1);
            let [a, b, c] = truth.corners(t);
            let r = draw(1).sqrt();
            (a * (1.0 - r) + b * (r * (1.0 - draw(2))) + c * (r * draw(2)), truth.normal(t))
        })
        .collect();
    let chances: Result<Vec<Vec<f32>>, Cancelled> = places
        .par_iter()
        .map(|&out| {
            observer.check()?;
            let eye = center + out * AWAY * size;
            let sees = |&(p, n): &(DVec3, DVec3)| {
                let (far, ray) = ((p - eye).length(), (p - eye).normalize());
                let chance = kept(-n.dot(ray));
                let clear = chance > 0.0
                    && tree.first_hit(eye, ray, f64::INFINITY).is_some_and(|h| h.distance > far - 1e-6 * size);
                if clear { chance as f32 } else { 0.0 }
            };
            Ok(spots.iter().map(sees).collect())
        })
        .collect();
    let chances = chances?;
    let mut seen = vec![0f32; SPOTS];
    let mut density = vec![0.0; SPOTS];
    let places = (0..params.stations)
        .map(|_| {
            let gain = |k: usize| chances[k].iter().zip(&seen).map(|(c, s)| (c - s).max(0.0) as f64).sum::<f64>();
            // Where nothing new is to be seen the stations fall back to an even spread.
            let even = |k: usize| 1e-9 * random::unit(params.seed ^ 2, k as u64);
            let best = (0..STATION_PLACES)
                .map(|k| (gain(k) + even(k), k))
                .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))
                .map_or(0, |b| b.1);
            // Grazing views add up.
            seen.iter_mut().zip(&chances[best]).for_each(|(s, c)| *s = (*s + MEETINGS * c).min(1.0).max(*s));
            for ((d, &chance), &(p, n)) in density.iter_mut().zip(&chances[best]).zip(&spots) {
                let ray = (p - center - places[best] * AWAY * size).normalize();
                *d += chance as f64 * n.dot(ray).abs();
            }
            places[best]
        })
        .collect();
    Ok((places, Thinning::new(spots, density)))
}

/// How much of the hits around each spot is kept.
struct Thinning {
    tree: KdTree,
    normals: Vec<DVec3>,
    keep: Vec<f64>,
}

impl Thinning {
    /// * `density` - of hits at every spot, to any scale
    fn new(spots: Vec<(DVec3, DVec3)>, density: Vec<f64>) -> Thinning {
        let mut sorted: Vec<f64> = density.iter().copied().filter(|&d| d > 0.0).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let even = sorted.get((LEAST_SEEN * sorted.len() as f64) as usize).map_or(1.0, |d| EVEN_DENSITY * d);
        let keep = density.into_iter().map(|d| if d > even { even / d } else { 1.0 }).collect();
        let (points, normals): (Vec<DVec3>, Vec<DVec3>) = spots.into_iter().unzip();
        Thinning { tree: KdTree::new(&points), normals, keep }
    }

    /// The part of the hits that is kept at a place with this normal: that of the nearest spot on the same side.
    fn kept(&self, p: DVec3, normal: DVec3, near: &mut Vec<(f64, u32)>) -> f64 {
        self.tree.nearest(p, AROUND, near);
        let alike = near.iter().find(|n| self.normals[n.1 as usize].dot(normal) > ALIKE);
        alike.or(near.first()).map_or(1.0, |n| self.keep[n.1 as usize])
    }
}

/// Chance that a hit at this cosine between ray and normal is not lost.
fn kept(facing: f64) -> f64 {
    let [keep, lose] = GRAZE_DEG.map(|a| a.to_radians().cos());
    ((facing - lose) / (keep - lose)).clamp(0.0, 1.0)
}

struct Station {
    eye: DVec3,
    right: DVec3,
    up: DVec3,
    forward: DVec3,
    /// Half the width of the picture at unit distance.
    slope: f64,
    center: DVec3,
    /// Misplacement: a turn about the middle and a shift.
    turn: DQuat,
    shift: DVec3,
    seed: u64,
}

struct Hit {
    pixel: u64,
    ray: DVec3,
    range: f64,
    /// Chance that it is not lost.
    chance: f64,
}

impl Station {
    fn new(k: usize, out: DVec3, center: DVec3, size: f64, params: &ScannerParams) -> Station {
        let seed = random::bits(params.seed, k as u64);
        let draw = |n: u64| random::unit(seed, u64::MAX - n);
        let forward = -out;
        let side = out.any_orthonormal_vector();
        let roll = TAU * draw(0);
        let right = side * roll.cos() + forward.cross(side) * roll.sin();
        let gauss = |n: u64| random::normal(draw(n), draw(n + 1));
        let axis = DVec3::new(gauss(1), gauss(3), gauss(5)).normalize_or(DVec3::Z);
        Station {
            eye: center + out * AWAY * size,
            right,
            up: forward.cross(right),
            forward,
            slope: (0.5 / AWAY).asin().tan(),
            center,
            turn: DQuat::from_axis_angle(axis, params.turn_deg.to_radians() * gauss(7)),
            shift: params.shift * size * DVec3::new(gauss(9), gauss(11), gauss(13)),
            seed,
        }
    }

    /// Where a place comes out in the registered scan.
    fn placed(&self, p: DVec3) -> DVec3 {
        self.turn * (p - self.center) + self.center + self.shift
    }

    fn look(&self, truth: &TriMesh, tree: &Bvh, thinning: &Thinning, pixels: usize) -> Vec<Hit> {
        let across = |k: usize| (2.0 * (k as f64 + 0.5) / pixels as f64 - 1.0) * self.slope;
        let row = |j: usize| {
            let mut near = Vec::new();
            (0..pixels).filter_map(move |i| {
                let ray = (self.forward + self.right * across(i) + self.up * across(j)).normalize();
                let hit = tree.first_hit(self.eye, ray, f64::INFINITY)?;
                let normal = truth.normal(hit.face as usize);
                let thin = thinning.kept(self.eye + ray * hit.distance, normal, &mut near);
                let chance = kept(normal.dot(ray).abs()) * thin;
                Some(Hit { pixel: (j * pixels + i) as u64, ray, range: hit.distance, chance })
            })
        };
        (0..pixels).into_par_iter().flat_map_iter(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::Silent;
    use crate::synthetic::shapes;

    /// A scanner without any fault.
    fn exact() -> ScannerParams {
        ScannerParams { points: 20_000, noise: 0.0, outliers: 0.0, shift: 0.0, turn_deg: 0.0, ..Default::default() }
    }

    #[test]
    fn a_perfect_scan_lies_on_the_surface_within_1e_12_and_has_the_wanted_number_of_points_within_3_percent() {
        let truth = shapes::torus(1.0, 0.35, 96, 48);
        let params = exact();
        let scan = virtual_scan(&truth, &params, &Silent).unwrap();
        let tree = Bvh::new(&truth);
        assert!(scan.cloud.points.iter().all(|&p| tree.closest(p).distance < 1e-12));
        assert!((scan.cloud.points.len() as f64 / 20_000.0 - 1.0).abs() < 0.03, "{}", scan.cloud.points.len());
        assert_eq!(scan.cloud.scanners.len(), 20);
    }

    #[test]
    fn noise_runs_along_the_rays_with_the_wanted_deviation_within_3_percent() {
        let truth = shapes::sphere(1.0, 5);
        let quiet = exact();
        let noisy = ScannerParams { noise: 2e-3, ..quiet.clone() };
        let (a, b) = (virtual_scan(&truth, &quiet, &Silent).unwrap(), virtual_scan(&truth, &noisy, &Silent).unwrap());
        assert_eq!(a.cloud.points.len(), b.cloud.points.len());
        let diagonal = truth.bounds().diagonal();
        let mut sum = 0.0;
        for (i, (p, q)) in a.cloud.points.iter().zip(&b.cloud.points).enumerate() {
            let eye = a.cloud.scanners[a.cloud.seen_by[i] as usize];
            assert!((*q - *p).cross((*p - eye).normalize()).length() < 1e-12);
            sum += p.distance_squared(*q);
        }
        let deviation = (sum / a.cloud.points.len() as f64).sqrt() / diagonal;
        assert!((deviation / 2e-3 - 1.0).abs() < 0.03, "{deviation}");
    }

    #[test]
    fn what_no_station_sees_stays_empty_and_the_share_of_strays_is_as_wanted_within_a_fifth() {
        // A ball inside a ball is never seen.
        let (outer, inner) = (shapes::sphere(1.0, 4), shapes::sphere(0.5, 4));
        let mut truth = outer.clone();
        let first = truth.points.len() as u32;
        truth.points.extend(&inner.points);
        truth.triangles.extend(inner.triangles.iter().map(|t| t.map(|v| v + first)));
        let params = ScannerParams { points: 20_000, outliers: 0.02, ..Default::default() };
        let scan = virtual_scan(&truth, &params, &Silent).unwrap();
        let strays = scan.stray.iter().filter(|&&s| s).count() as f64 / scan.stray.len() as f64;
        assert!((strays / 0.02 - 1.0).abs() < 0.2, "{strays}");
        let within = scan.cloud.points.iter().zip(&scan.stray).filter(|(p, s)| !**s && p.length() < 0.9).count();
        assert_eq!(within, 0);
    }

    #[test]
    fn the_same_seed_gives_the_same_scan_on_1_and_3_threads_and_another_seed_another() {
        let truth = shapes::sphere(1.0, 3);
        let run = |seed: u64, threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let params = ScannerParams { points: 3_000, seed, ..Default::default() };
            pool.install(|| virtual_scan(&truth, &params, &Silent).unwrap())
        };
        assert_eq!(run(3, 1), run(3, 3));
        assert_ne!(run(3, 1), run(4, 1));
    }
}
