//! Seam curves that keep to the planes at their ends, and the normals along them.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §8.1.3.
//!
//! Departs from [K98]: the curve's control points near a corner are not projected one by one; the whole curve moves as
//! little as it can in the metric of its own fit.

use super::FitError;
use super::basis::{BasisRows, uniform_knots, uniform_parameters};
use super::corner::{Plane, Planes, end_derivatives, end_weights};
use super::fit::Direction;
use super::fold::MeanNormals;
use super::sides::place;
use crate::linalg::{Banded, BandedCholesky};
use glam::DVec3;

/// Cosine above which the two planes beside a feature count as one: their own line of intersection would be no
/// direction for the curve any more.
const ONE_PLANE_COSINE: f64 = 0.94;
/// Fewest control points of a curve that is asked to bend as its planes say: each end takes two besides the corner,
/// and a shorter curve would have nothing left to follow its nodes with.
const FEWEST_BENT: usize = 6;
/// Damping of the conditions at the ends, each of diagonal 1: contradicting ones share their miss.
const DAMPING: f64 = 1e-7;
/// How far a leg of the control polygon may change, over its length: a turn of 35 degrees. Curves that are
/// bent more than that turn their patches over.
const LEEWAY: f64 = 0.6;
/// Conditions depend on the direction that they change a little; the second pass sees to that.
const DIRECTION_PASSES: usize = 2;
/// Samples per knot span of a field of normals, enough for its cubic and the products with cubics.
pub(crate) const SPAN_SAMPLES: usize = 6;

/// Number of samples along a curve of `control` control points.
pub(crate) fn sample_count(control: usize) -> usize {
    (control - 3) * SPAN_SAMPLES + 1
}

/// One linear condition on a curve: `<normal, sum of weight * control point> = value`.
struct Condition {
    weights: Vec<(usize, f64)>,
    normal: DVec3,
    value: f64,
}

/// Moves a curve so that at its ends it runs in the planes there and, if asked to, bends as they say.
/// `index` is that of the curve.
pub(crate) fn constrain(
    index: usize,
    curve: &[DVec3],
    planes: [Vec<Plane>; 2],
    bends: bool,
    direction: &Direction,
) -> Vec<DVec3> {
    let mut moved = curve.to_vec();
    if planes.iter().all(Vec::is_empty) {
        return moved;
    }
    // Without the bends if those distort the curve, as it was if its tangents would.
    for bent in [bends, false] {
        for _ in 0..DIRECTION_PASSES {
            moved = meet(curve, &conditions(index, &moved, &planes, bent), direction);
        }
        if keeps_shape(curve, &moved) {
            return moved;
        }
        moved.copy_from_slice(curve);
    }
    moved
}

/// True if no leg of the control polygon turned or grew by more than [`LEEWAY`] of its length.
fn keeps_shape(curve: &[DVec3], moved: &[DVec3]) -> bool {
    let legs = curve.windows(2).zip(moved.windows(2));
    legs.into_iter().all(|(a, b)| ((b[1] - b[0]) - (a[1] - a[0])).length() <= LEEWAY * (a[1] - a[0]).length())
}

fn conditions(at: usize, curve: &[DVec3], planes: &[Vec<Plane>; 2], bent: bool) -> Vec<Condition> {
    let n = curve.len();
    let (first, second) = end_weights(n);
    let mut list = Vec::new();
    for (end, planes) in planes.iter().enumerate() {
        let index = |k: usize| if end == 0 { k } else { n - 1 - k };
        let tangent = end_derivatives(curve, end).0;
        let mut tangency = |normal: DVec3| {
            list.push(Condition {
                weights: vec![(index(1), first[1])],
                normal,
                value: -first[0] * normal.dot(curve[index(0)]),
            });
        };
        if let [a, b] = &planes[..]
            && a.normal.dot(b.normal) > ONE_PLANE_COSINE
        {
            tangency((a.normal + b.normal).normalize());
            continue;
        }
        planes.iter().for_each(|p| tangency(p.normal));
        let turned = planes.iter().find_map(|p| Some((p, p.direction(at, end)?)));
        if let Some((plane, d)) = turned {
            tangency(plane.normal.cross(d));
        }
        for plane in planes.iter().filter(|p| bent && p.credible && n >= FEWEST_BENT) {
            list.push(Condition {
                weights: vec![(index(1), second[1]), (index(2), second[2])],
                normal: plane.normal,
                value: plane.bend(plane.flatten(tangent)) - second[0] * plane.normal.dot(curve[index(0)]),
            });
        }
    }
    list
}

/// The curve nearest to `curve`, in the metric of its fit, that meets the conditions.
fn meet(curve: &[DVec3], conditions: &[Condition], direction: &Direction) -> Vec<DVec3> {
    let n = curve.len();
    let answers: Vec<Vec<f64>> = conditions
        .iter()
        .map(|condition| {
            let mut y = vec![0.0; n - 2];
            condition.weights.iter().for_each(|&(k, w)| y[k - 1] += w);
            direction.factor(1).solve(&mut y);
            y
        })
        .collect();
    let couple = |i: usize, j: usize| {
        let reach: f64 = conditions[i].weights.iter().map(|&(k, w)| w * answers[j][k - 1]).sum();
        reach * conditions[i].normal.dot(conditions[j].normal)
    };
    let scale: Vec<f64> = (0..conditions.len()).map(|i| couple(i, i).sqrt()).collect();
    let mut matrix = Banded::zero(conditions.len(), conditions.len() - 1);
    let mut rhs = Vec::new();
    for (i, condition) in conditions.iter().enumerate() {
        for j in 0..=i {
            matrix.add(i, j, couple(i, j) / (scale[i] * scale[j]) + if i == j { DAMPING } else { 0.0 });
        }
        let now: f64 = condition.weights.iter().map(|&(k, w)| w * condition.normal.dot(curve[k])).sum();
        rhs.push((condition.value - now) / scale[i]);
    }
    let mut moved = curve.to_vec();
    if let Some(factor) = BandedCholesky::factor(matrix) {
        factor.solve(&mut rhs);
        for (i, condition) in conditions.iter().enumerate() {
            for (point, y) in moved[1..n - 1].iter_mut().zip(&answers[i]) {
                *point += condition.normal * (rhs[i] / scale[i] * y);
            }
        }
    }
    moved
}

/// Unit normals along a smooth seam at [`sample_count`] uniform parameters, perpendicular to the curve: a cubic
/// spline through the mean of both patches' normals that starts and turns at the corners as their planes say.
/// * `control` - control points of the curve
/// * `both` - at a parameter of the curve the sum of both patches' normals, of any length
pub(crate) fn normals(
    curve: usize,
    control: &[DVec3],
    planes: &Planes,
    both: impl Fn(f64) -> DVec3,
) -> Result<Vec<DVec3>, FitError> {
    let n = control.len();
    let parameters = uniform_parameters(sample_count(n));
    let mut last = DVec3::Z;
    let mean: Vec<DVec3> = parameters
        .iter()
        .map(|&t| {
            last = both(t).try_normalize().unwrap_or(last);
            last
        })
        .collect();
    let direction = Direction::new(parameters.len(), n, 0.0)?;
    let mut net = vec![DVec3::ZERO; n];
    direction.fit_curve(mean.iter().copied(), &mut net, 0);
    for end in 0..2 {
        if let Some(plane) = planes.at(curve, end).next() {
            let outgoing = plane.flatten(end_derivatives(control, end).0);
            let (first, _) = end_weights(n);
            let (at, beside) = if end == 0 { (0, 1) } else { (n - 1, n - 2) };
            net[at] = plane.normal;
            net[beside] = plane.normal + plane.turn(outgoing) / first[1];
        }
    }
    direction.fit_curve(mean.iter().copied(), &mut net, 2);
    let at = BasisRows::new(&uniform_knots(n), &parameters, 0);
    let field: Vec<DVec3> =
        (0..parameters.len()).map(|s| (0..4).map(|a| net[at.first[s] + a] * at.weights[s][a]).sum()).collect();
    Ok(upright(control, &field, &mean))
}

/// Unit normals along one side of a patch at [`sample_count`] uniform parameters in the direction of its curve,
/// perpendicular to that: those of the patch's own grid within a knot span.
pub(crate) fn own_normals(means: &MeanNormals, side: usize, reversed: bool, control: &[DVec3]) -> Vec<DVec3> {
    let parameters = uniform_parameters(sample_count(control.len()));
    let at = |&t: &f64| {
        let (u, v) = place(side, reversed, t);
        means.at(u, v)
    };
    let field: Vec<DVec3> = parameters.iter().map(at).collect();
    upright(control, &field, &field)
}

/// The part of `field` perpendicular to a curve, unit vectors; where there is none that of `other`, as it is.
fn upright(control: &[DVec3], field: &[DVec3], other: &[DVec3]) -> Vec<DVec3> {
    let along = BasisRows::new(&uniform_knots(control.len()), &uniform_parameters(field.len()), 1);
    let one = |s: usize| {
        let tangent: DVec3 = (0..4).map(|a| control[along.first[s] + a] * along.weights[s][a]).sum();
        let tangent = tangent.normalize_or_zero();
        (field[s] - tangent * tangent.dot(field[s])).try_normalize().unwrap_or(other[s])
    };
    (0..field.len()).map(one).collect()
}
