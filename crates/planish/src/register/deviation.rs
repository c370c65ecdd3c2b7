//! How far two shapes are apart, each a surface or a scan, with sides: positive where A lies outside of B.
//!
//! Surfaces are sampled evenly by area as in [`crate::mesh::compare`], of a scan every point is taken. Between a surface and
//! a scan the distances of the scan's points count: what the scan has not seen is no deviation.

use super::{Reference, Shape};
use crate::geom::Aabb;
use crate::mesh::MeshError;
use crate::mesh::compare::{AreaSampler, CompareParams, Spread, spread};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Why shapes cannot be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DeviationError {
    /// A mesh is damaged or empty.
    #[error("{which}: {error}")]
    Mesh {
        /// `a` or `b`.
        which: char,
        /// What is wrong with it.
        error: MeshError,
    },
    /// A scan has no points.
    #[error("{which} has no point whose coordinates are numbers")]
    NoPoints {
        /// `a` or `b`.
        which: char,
    },
    /// The observer wants no result any more.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// How far two shapes are apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Deviation {
    /// Bounding-box diagonal of A, world units.
    pub diagonal: f64,
    /// From places of A to B.
    pub a_to_b: Spread,
    /// From places of B to A.
    pub b_to_a: Spread,
    /// What counts: both ways, but between a surface and a scan from the points alone.
    pub both: Spread,
    /// Angles between the normals, degrees; of places where both have one that is known.
    pub normal_deg: Option<Spread>,
    /// Share of these whose normals differ by more than 90 degrees.
    pub flipped_share: Option<f64>,
    /// True if the values below have sides.
    pub signed: bool,
    /// The distances that count, ascending; of two surfaces or two scans those from A to B. Below zero where A lies inside of B.
    pub values: Vec<f64>,
    /// All distances that count for the tolerance, ascending, without sides.
    pub sizes: Vec<f64>,
}

/// Shares of values in even classes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Histogram {
    /// Bounds of the classes, ascending, one more than shares; the first and the last class hold what lies beyond as well.
    pub bounds: Vec<f64>,
    /// Share of each class.
    pub shares: Vec<f64>,
}

/// Places between two looks at the observer.
const CHUNK: usize = 1 << 14;
/// Share of the values that the bounds of a histogram hold: the rest, wild ones, would make one class of all others.
const SHOWN: f64 = 0.98;

impl Deviation {
    /// Share of the distances that are at most `tolerance`.
    pub fn share_within(&self, tolerance: f64) -> f64 {
        self.sizes.partition_point(|d| *d <= tolerance) as f64 / self.sizes.len().max(1) as f64
    }

    /// Mean and standard deviation of the values.
    pub fn mean_and_deviation(&self) -> [f64; 2] {
        let n = self.values.len().max(1) as f64;
        let mean = self.values.iter().sum::<f64>() / n;
        [mean, (self.values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()]
    }

    /// The values in `classes` classes, around zero where they have sides.
    pub fn histogram(&self, classes: usize) -> Histogram {
        let mut sizes: Vec<f64> = self.values.iter().map(|v| v.abs()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        let reach = sizes.get((sizes.len() as f64 * SHOWN) as usize).or(sizes.last()).copied().unwrap_or(0.0);
        let low = if self.signed { -reach } else { 0.0 };
        let bounds: Vec<f64> = (0..=classes).map(|k| low + (reach - low) * k as f64 / classes as f64).collect();
        // Values ascend: a class is what lies between the places of its bounds.
        let at: Vec<usize> = (0..=classes)
            .map(|k| match k {
                0 => 0,
                k if k == classes => self.values.len(),
                k => self.values.partition_point(|v| *v < bounds[k]),
            })
            .collect();
        let shares = at.windows(2).map(|w| (w[1] - w[0]) as f64 / self.values.len().max(1) as f64).collect();
        Histogram { bounds, shares }
    }
}

/// A place of one shape against the other.
#[derive(Clone, Copy)]
struct Reading {
    distance: f64,
    /// From the measured shape: 1 outside of the other, -1 inside, 0 unknown.
    side: f64,
    angle_deg: f64,
}

/// Compares two shapes both ways.
/// # Errors
/// [`DeviationError`] for damaged or empty shapes, or if cancelled.
pub fn deviation(
    a: &Shape,
    b: &Shape,
    params: &CompareParams,
    observer: &dyn Observer,
) -> Result<Deviation, DeviationError> {
    let reference = |which: char, shape: &Shape| {
        if shape.is_scan() && !shape.points().iter().any(|p| p.is_finite()) {
            return Err(DeviationError::NoPoints { which });
        }
        Reference::new(shape, observer).map_err(|error| match error {
            MeshError::Cancelled(c) => DeviationError::Cancelled(c),
            error => DeviationError::Mesh { which, error },
        })
    };
    let (near_a, near_b) = (reference('a', a)?, reference('b', b)?);
    let ab = measure(a, &near_b, params, 0, observer)?;
    let ba = measure(b, &near_a, params, 1, observer)?;
    observer.progress(1.0);
    let of = |readings: &[&Reading]| spread(readings.iter().map(|r| r.distance).collect());
    let (all_a, all_b): (Vec<&Reading>, Vec<&Reading>) = (ab.iter().collect(), ba.iter().collect());
    let decisive: Vec<&Reading> = match (a.is_scan(), b.is_scan()) {
        (true, false) => all_a.clone(),
        (false, true) => all_b.clone(),
        _ => all_a.iter().chain(&all_b).copied().collect(),
    };
    // What has sides is told from A: a point of B that lies inside of A tells that A lies outside of B.
    let (counted, turn) = if b.is_scan() && !a.is_scan() { (&ba, -1.0) } else { (&ab, 1.0) };
    let signed = counted.iter().all(|r| r.side != 0.0);
    let value = |r: &Reading| if signed { r.distance * r.side * turn } else { r.distance };
    let angles: Vec<f64> = decisive.iter().map(|r| r.angle_deg).filter(|a| a.is_finite()).collect();
    let finite = |shape: &Shape| Aabb::of(shape.points().iter().filter(|p| p.is_finite())).diagonal();
    Ok(Deviation {
        diagonal: finite(a),
        a_to_b: of(&all_a),
        b_to_a: of(&all_b),
        both: of(&decisive),
        flipped_share: (!angles.is_empty())
            .then(|| angles.iter().filter(|a| **a > 90.0).count() as f64 / angles.len() as f64),
        normal_deg: (!angles.is_empty()).then(|| spread(angles)),
        signed,
        values: sorted(counted.iter().map(value).collect()),
        sizes: sorted(decisive.iter().map(|r| r.distance).collect()),
    })
}

fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.par_sort_unstable_by(f64::total_cmp);
    values
}

/// Distance of each vertex or point of A from B, below zero inside; without sides where neither B nor A has any. What is no
/// number has none.
/// # Errors
/// As [`deviation`].
pub fn column(a: &Shape, b: &Shape, observer: &dyn Observer) -> Result<Vec<f64>, DeviationError> {
    let reference = Reference::new(b, observer).map_err(|error| DeviationError::Mesh { which: 'b', error })?;
    let (points, normals) = (a.points(), a.normals());
    let mut values: Vec<f64> = Vec::with_capacity(points.len());
    while values.len() < points.len() {
        observer.check()?;
        let range = values.len()..(values.len() + CHUNK).min(points.len());
        values.par_extend(range.into_par_iter().map(|i| {
            if !points[i].is_finite() {
                return f64::NAN;
            }
            let read = reading(points[i], normals.as_ref().map(|n| n[i]), &reference);
            if read.side < 0.0 { -read.distance } else { read.distance }
        }));
    }
    Ok(values)
}

fn measure(
    from: &Shape,
    to: &Reference,
    params: &CompareParams,
    pass: u64,
    observer: &dyn Observer,
) -> Result<Vec<Reading>, Cancelled> {
    let (sampler, normals) = match from {
        Shape::Surface(mesh) => (Some(AreaSampler::new(mesh)), None),
        Shape::Points(_) => (None, from.normals()),
    };
    let points = from.points();
    let count = if sampler.is_some() { params.samples } else { points.len() };
    let seed = crate::geom::random::bits(params.seed, pass);
    let mut result: Vec<Reading> = Vec::with_capacity(count);
    let mut at = 0;
    while at < count {
        observer.check()?;
        observer.progress((pass as f64 + at as f64 / count as f64) / 2.0);
        let range = at..(at + CHUNK).min(count);
        at = range.end;
        result.par_extend(range.into_par_iter().filter_map(|n| {
            let (place, normal) = match &sampler {
                Some(sampler) => {
                    let (place, normal) = sampler.sample(seed, n as u64, count);
                    (place, Some(normal))
                }
                None => (points[n], normals.as_ref().map(|normals| normals[n])),
            };
            place.is_finite().then(|| reading(place, normal, to))
        }));
    }
    Ok(result)
}

fn reading(place: DVec3, normal: Option<DVec3>, to: &Reference) -> Reading {
    let near = to.nearest(place);
    let own = normal.filter(|n| *n != DVec3::ZERO);
    // Where the other has no sides, its place lies inside of what is measured, or outside.
    let side = match own {
        Some(n) if near.side == 0.0 => {
            if (near.position - place).dot(n) > 0.0 {
                -1.0
            } else {
                1.0
            }
        }
        _ => near.side,
    };
    let angle_deg = match own {
        Some(n) if near.side != 0.0 => n.cross(near.normal).length().atan2(n.dot(near.normal)).to_degrees(),
        _ => f64::NAN,
    };
    Reading { distance: near.distance, side, angle_deg }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;
    use crate::observe::Silent;
    use crate::synthetic::shapes;

    fn ball(radius: f64) -> Shape {
        Shape::Surface(shapes::sphere(radius, 4))
    }

    #[test]
    fn a_ball_larger_by_a_tenth_lies_outside_by_a_tenth_and_a_smaller_one_inside_also_as_points() {
        let params = CompareParams { samples: 5000, ..CompareParams::default() };
        let points = |radius| Shape::Points(Cloud::new(shapes::sphere(radius, 4).points));
        for (a, sign) in [(1.1, 1.0), (0.9, -1.0)] {
            for (x, y) in [(ball(a), ball(1.0)), (points(a), ball(1.0)), (ball(a), points(1.0))] {
                let found = deviation(&x, &y, &params, &Silent).unwrap();
                let [mean, spread] = found.mean_and_deviation();
                // The chord of a facet lies within 1/200 of the radius.
                assert!(found.signed && (mean - sign * 0.1).abs() < 5e-3 && spread < 5e-3, "{a}: {mean} {spread}");
                assert!((found.share_within(0.106) - 1.0).abs() < 1e-12 && found.share_within(0.094) == 0.0);
                let column = column(&x, &y, &Silent).unwrap();
                assert!(column.iter().all(|d| (d - sign * 0.1).abs() < 6e-3));
            }
            // Two scans without normals have no sides.
            let found = deviation(&points(a), &points(1.0), &params, &Silent).unwrap();
            assert!(!found.signed && found.values.iter().all(|d| (d - 0.1).abs() < 6e-3), "{:?}", found.both);
        }
    }

    #[test]
    fn the_distances_of_two_meshes_are_those_of_the_comparison_of_meshes() {
        let (a, b) = (shapes::cuboid(DVec3::ONE, 4), shapes::cuboid(DVec3::new(1.1, 1.0, 0.9), 5));
        let params = CompareParams { samples: 3000, ..CompareParams::default() };
        let old = crate::mesh::compare(&a, &b, &params, &Silent).unwrap();
        let new = deviation(&Shape::Surface(a), &Shape::Surface(b), &params, &Silent).unwrap();
        assert_eq!((old.a_to_b, old.b_to_a, old.both), (new.a_to_b, new.b_to_a, new.both));
        assert_eq!((Some(old.normal_deg), Some(old.flipped_share)), (new.normal_deg, new.flipped_share));
    }

    #[test]
    fn a_histogram_of_four_classes_has_all_values_and_wild_ones_in_its_ends() {
        let values: Vec<f64> = sorted((0..1000).map(|k| if k == 7 { 1e6 } else { (k % 100) as f64 - 49.5 }).collect());
        let found = Deviation {
            diagonal: 1.0,
            a_to_b: Spread::default(),
            b_to_a: Spread::default(),
            both: Spread::default(),
            normal_deg: None,
            flipped_share: None,
            signed: true,
            sizes: Vec::new(),
            values,
        };
        let histogram = found.histogram(4);
        assert_eq!((histogram.bounds[0], histogram.bounds[2], histogram.bounds[4]), (-49.5, 0.0, 49.5));
        assert!((histogram.shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(histogram.shares.iter().all(|s| (s - 0.25).abs() < 0.011), "{:?}", histogram.shares);
    }
}
