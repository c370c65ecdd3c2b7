//! The best rigid fit of one shape on another.
//!
//! Iterated closest points with distances along normals: Chen and Medioni (*Object Modelling by Registration of Multiple Range
//! Images*, 1992), the turn linearised in each round and then taken whole. Pairs are weighted by Tukey's biweight at a scale
//! from the median of the distances, so that what has no counterpart does not pull.
//!
//! Departs from it: besides the place where the shape is, it starts from its middle on that of the other, and from its main axes
//! on those of the other in all 24 ways, with a few samples each; the best start is refined with all samples. A start
//! further along in this list has to be better by [`BETTER`] to be taken: of a symmetric shape the least move wins.

use super::{Placement, Reference, Shape};
use crate::geom::{Aabb, tolerance};
use crate::linalg::{eigen3, small_cholesky};
use crate::mesh::MeshError;
use crate::mesh::compare::AreaSampler;
use crate::observe::{Cancelled, Observer};
use glam::{DMat3, DQuat, DVec3};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How to fit.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AlignParams {
    /// Samples of the moving shape.
    #[schemars(range(min = 10), extend("unit" = "count"))]
    pub samples: usize,
    /// Start only from where the shape is.
    pub near: bool,
    /// Seed of the samples.
    pub seed: u64,
}

impl Default for AlignParams {
    fn default() -> Self {
        AlignParams { samples: 20_000, near: false, seed: 0 }
    }
}

/// Why there is no fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AlignError {
    /// A mesh is damaged or empty.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Too few places.
    #[error("{found} places to fit; at least 6 are needed")]
    TooFew {
        /// How many there are.
        found: usize,
    },
    /// The observer wants no result any more.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// A fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aligned {
    /// What brings the moving shape onto the other.
    pub placement: Placement,
    /// Median distance of the samples before and after, world units.
    pub median: [f64; 2],
    /// Rounds of the refinement.
    pub rounds: usize,
    /// True if the last round moved nothing by more than [`SETTLED`] of the size.
    pub settled: bool,
}

/// Samples that try a start: enough for the six numbers of a move, few enough for 26 starts.
const TRIAL: usize = 400;
/// Rounds of a trial and of the refinement, at most: a plane sliding on a plane would never end.
const TRIAL_ROUNDS: usize = 25;
const ROUNDS: usize = 100;
/// A later start must be better by this factor.
const BETTER: f64 = 0.9;
/// A round that moves no sample by more than this share of the size ends the refinement: far below what any scanner resolves.
const SETTLED: f64 = 1e-10;
/// Samples beyond this many deviations count nothing: 95 % as good as least squares for normal errors (Tukey).
const TUKEY: f64 = 4.685;
/// Deviations in a median of absolute distances, for normal errors.
const MEDIAN: f64 = 1.4826;
/// What holds directions in which the shape slides freely (the turn of a ball), as a share of the mean stiffness.
const HOLD: f64 = 1e-9;

/// Finds the rigid move that brings `moving` onto `fixed`.
/// # Errors
/// [`AlignError`] for damaged meshes, too few points, or if cancelled.
pub fn align(
    moving: &Shape,
    fixed: &Shape,
    params: &AlignParams,
    observer: &dyn Observer,
) -> Result<Aligned, AlignError> {
    let reference = Reference::new(fixed, observer)?;
    let samples = samples(moving, params.samples, params.seed);
    if samples.len() < 6 {
        return Err(AlignError::TooFew { found: samples.len() });
    }
    let others = self::samples(fixed, params.samples, params.seed);
    let size = tolerance::divisor(Aabb::of(&samples).diagonal());
    let few: Vec<DVec3> = samples.iter().step_by(samples.len().div_ceil(TRIAL)).copied().collect();
    let mut starts = vec![Placement::IDENTITY];
    if !params.near {
        starts.extend(far_starts(&samples, &others));
    }
    let mut best = (Placement::IDENTITY, f64::INFINITY);
    let count = starts.len();
    for (k, start) in starts.into_iter().enumerate() {
        observer.progress(0.5 * k as f64 / count as f64);
        let tried = rounds(&few, &reference, start, size, TRIAL_ROUNDS, observer)?;
        let score = mean_of_near(&few, &reference, &tried.0);
        // What a fit that has come to rest leaves is no difference: of exact data all good starts end there.
        if score < BETTER * best.1 - SETTLED * size {
            best = (tried.0, score);
        }
    }
    let (placement, made, settled) = rounds(&samples, &reference, best.0, size, ROUNDS, observer)?;
    observer.progress(1.0);
    let median = [Placement::IDENTITY, placement].map(|p| median(distances(&samples, &reference, &p)));
    Ok(Aligned { placement, median, rounds: made, settled })
}

/// Places of a shape: even by area, or points of a scan, evenly through the file.
fn samples(shape: &Shape, count: usize, seed: u64) -> Vec<DVec3> {
    match shape {
        Shape::Points(cloud) => {
            let finite: Vec<DVec3> = cloud.points.iter().filter(|p| p.is_finite()).copied().collect();
            let step = finite.len().div_ceil(count.max(1)).max(1);
            finite.into_iter().step_by(step).collect()
        }
        Shape::Surface(mesh) if (0..mesh.triangles.len()).any(|t| mesh.area(t) > 0.0) => {
            let sampler = AreaSampler::new(mesh);
            (0..count).map(|n| sampler.sample(seed, n as u64, count).0).collect()
        }
        Shape::Surface(_) => Vec::new(),
    }
}

/// The middle of the points, and their main axes with the greatest first.
fn frame(points: &[DVec3]) -> (DVec3, DMat3) {
    let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let spread = points.iter().fold(DMat3::ZERO, |m, p| {
        let d = *p - middle;
        m + DMat3::from_cols(d * d.x, d * d.y, d * d.z)
    });
    let (_, [c, b, _]) = eigen3(spread);
    let a = b.cross(c);
    (middle, DMat3::from_cols(a, b, c))
}

/// Middle on middle, and axes on axes in the 24 ways in which a cube lies on itself, the main axes on each other first.
fn far_starts(from: &[DVec3], to: &[DVec3]) -> Vec<Placement> {
    let ((p, own), (q, other)) = (frame(from), frame(to));
    let on = |linear: DMat3| Placement { linear, shift: q - linear * p };
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let mut starts = vec![on(DMat3::IDENTITY)];
    for [i, j] in [[0, 1], [0, 2], [1, 0], [1, 2], [2, 0], [2, 1]] {
        for (s, t) in [(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)] {
            let (x, y) = (axes[i] * s, axes[j] * t);
            starts.push(on(other * DMat3::from_cols(x, y, x.cross(y)) * own.transpose()));
        }
    }
    starts
}

/// Rounds from a start: the move, how many, and whether it came to rest.
fn rounds(
    samples: &[DVec3],
    reference: &Reference,
    start: Placement,
    size: f64,
    most: usize,
    observer: &dyn Observer,
) -> Result<(Placement, usize, bool), Cancelled> {
    let mut placement = start;
    for round in 0..most {
        observer.check()?;
        let (step, moved) = round_step(samples, reference, &placement, size);
        placement = step.after(&placement);
        // Rounding does not add up over the rounds: the turn is a turn.
        placement.linear = DMat3::from_quat(DQuat::from_mat3(&placement.linear).normalize());
        if moved <= SETTLED {
            return Ok((placement, round + 1, true));
        }
    }
    Ok((placement, most, false))
}

/// The move of one round, and its greatest motion as a share of the size.
fn round_step(samples: &[DVec3], reference: &Reference, at: &Placement, size: f64) -> (Placement, f64) {
    let pairs: Vec<(DVec3, DVec3, f64)> = samples
        .par_iter()
        .map(|s| {
            let p = at.point(*s);
            let near = reference.nearest(p);
            let normal = near.normal.try_normalize().unwrap_or((p - near.position).normalize_or_zero());
            (p, normal, (p - near.position).dot(normal))
        })
        .collect();
    let away: Vec<f64> = pairs.iter().map(|pair| pair.2.abs()).collect();
    let reach = TUKEY * (MEDIAN * median(away)).max(tolerance::length(size));
    let middle = pairs.iter().map(|pair| pair.0).sum::<DVec3>() / pairs.len() as f64;
    let (mut a, mut b) = ([[0.0; 6]; 6], [0.0; 6]);
    for (p, n, d) in pairs {
        let u = d / reach;
        if u.is_nan() || u.abs() >= 1.0 {
            continue;
        }
        let weight = (1.0 - u * u).powi(2);
        // Lengths in units of the size, so that turns and moves weigh alike.
        let r = (p - middle) / size;
        let turn = r.cross(n);
        let row = [turn.x, turn.y, turn.z, n.x, n.y, n.z];
        for i in 0..6 {
            for j in 0..=i {
                a[i][j] += weight * row[i] * row[j];
            }
            b[i] -= weight * row[i] * d / size;
        }
    }
    let hold = HOLD * (0..6).map(|i| a[i][i]).sum::<f64>() / 6.0;
    (0..6).for_each(|i| a[i][i] += hold);
    if !small_cholesky::solve(&mut a, &mut b) {
        return (Placement::IDENTITY, 0.0);
    }
    let (turn, shift) = (DVec3::new(b[0], b[1], b[2]), DVec3::new(b[3], b[4], b[5]) * size);
    let linear = DMat3::from_quat(DQuat::from_scaled_axis(turn));
    let mut step = Placement::about(linear, middle);
    step.shift += shift;
    (step, turn.length() + shift.length() / size)
}

fn distances(samples: &[DVec3], reference: &Reference, at: &Placement) -> Vec<f64> {
    samples.par_iter().map(|s| reference.nearest(at.point(*s)).distance).collect()
}

/// Root mean square of the nearest nine tenths: what a start is worth, also where some samples have no counterpart.
fn mean_of_near(samples: &[DVec3], reference: &Reference, at: &Placement) -> f64 {
    let mut away = distances(samples, reference, at);
    away.sort_unstable_by(f64::total_cmp);
    away.truncate((away.len() * 9).div_ceil(10));
    (away.iter().map(|d| d * d).sum::<f64>() / away.len().max(1) as f64).sqrt()
}

fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::observe::Silent;
    use crate::synthetic::shapes;

    fn moved(mesh: &crate::mesh::TriMesh, turn_deg: f64, shift: DVec3) -> (Shape, Placement) {
        let linear = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -1.0).normalize(), turn_deg.to_radians());
        let placement = Placement { linear, shift };
        let mut mesh = mesh.clone();
        placement.mesh(&mut mesh);
        (Shape::Surface(mesh), placement)
    }

    fn worst(points: &[DVec3], found: &Placement, made: &Placement) -> f64 {
        points.iter().map(|p| found.point(made.point(*p)).distance(*p)).fold(0.0, f64::max)
    }

    #[test]
    fn a_box_turned_by_8_degrees_and_one_by_160_degrees_far_away_come_back_within_1e_8_of_their_size() {
        let mesh = shapes::cuboid(DVec3::new(1.0, 2.0, 3.5), 6);
        let fixed = Shape::Surface(mesh.clone());
        let params = AlignParams { samples: 3000, ..AlignParams::default() };
        let (near, made) = moved(&mesh, 8.0, DVec3::new(0.05, -0.1, 0.02));
        let found = align(&near, &fixed, &params, &Silent).unwrap();
        assert!(found.settled && worst(&mesh.points, &found.placement, &made) < 1e-8, "{found:?}");
        assert!(found.median[0] > 0.01 && found.median[1] < 1e-9, "{found:?}");
        // A box lies on itself in four ways: how far its surface is away is what counts.
        let (far, made) = moved(&mesh, 160.0, DVec3::new(50.0, -10.0, 20.0));
        let found = align(&far, &fixed, &params, &Silent).unwrap();
        let reference = Reference::new(&fixed, &Silent).unwrap();
        let away = mesh.points.iter().map(|p| reference.nearest(found.placement.point(made.point(*p))).distance);
        assert!(away.fold(0.0, f64::max) < 1e-8, "{found:?}");
    }

    #[test]
    fn a_part_of_a_scan_with_strays_finds_its_place_on_the_mesh_within_1e_4_of_its_size() {
        let mesh = shapes::cuboid(DVec3::new(1.0, 2.0, 3.5), 20);
        let made = moved(&mesh, 5.0, DVec3::new(0.02, 0.03, -0.04)).1;
        let mut points: Vec<DVec3> = samples(&Shape::Surface(mesh.clone()), 4000, 5);
        points.retain(|p| p.z > -1.0);
        points.iter_mut().for_each(|p| *p = made.point(*p));
        // One point in ten is wrong.
        let count = points.len();
        points.extend((0..count / 10).map(|k| DVec3::new(2.0, 0.01 * (k % 100) as f64, 0.3)));
        let scan = Shape::Points(Cloud::new(points));
        let found = align(&scan, &Shape::Surface(mesh.clone()), &AlignParams::default(), &Silent).unwrap();
        assert!(worst(&mesh.points, &found.placement, &made) < 4e-4, "{found:?}");
    }

    #[test]
    fn a_ball_keeps_its_turn_and_too_few_points_are_refused() {
        let ball = shapes::sphere(1.0, 3);
        let mut other = ball.clone();
        other.points.iter_mut().for_each(|p| *p += DVec3::new(0.1, 0.0, 0.0));
        let params = AlignParams { near: true, ..AlignParams::default() };
        let found = align(&Shape::Surface(other), &Shape::Surface(ball.clone()), &params, &Silent).unwrap();
        assert!(found.placement.shift.distance(DVec3::new(-0.1, 0.0, 0.0)) < 1e-3, "{found:?}");
        let three = Shape::Points(Cloud::new(vec![DVec3::ZERO; 3]));
        assert_eq!(
            align(&three, &Shape::Surface(ball), &params, &Silent).unwrap_err(),
            AlignError::TooFew { found: 3 }
        );
    }
}
