//! Seam curves that keep to the planes at their ends.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §8.1.3.
//!
//! Departs from [K98]: the curve's control points near a corner are not projected one by one; the whole curve moves as
//! little as it can in the metric of its own fit.

use super::corner::Plane;
use crate::linalg::{Banded, BandedCholesky};
use crate::surface::fit::Direction;
use glam::DVec3;

/// Cosine above which the two planes beside a feature count as one: their own line of intersection would be no
/// direction for the curve any more.
const ONE_PLANE_COSINE: f64 = 0.94;
/// Damping of the conditions at the ends, each of diagonal 1: contradicting ones share their miss.
const DAMPING: f64 = 1e-7;
/// How far a leg of the control polygon may change, over its length: a turn of 35 degrees. Curves that are
/// bent more than that turn their patches over.
const LEEWAY: f64 = 0.6;
/// One linear condition on a curve: `<normal, control point> = value`.
struct Condition {
    point: usize,
    normal: DVec3,
    value: f64,
}

/// Moves a curve so that at its ends it runs in the planes there. `index` is that of the curve.
pub(crate) fn constrain(index: usize, curve: &[DVec3], planes: &[Vec<Plane>; 2], direction: &Direction) -> Vec<DVec3> {
    if planes.iter().all(Vec::is_empty) {
        return curve.to_vec();
    }
    let conditions = conditions(index, curve, planes);
    let moved = meet(curve, &conditions, direction);
    if keeps_shape(curve, &moved) { moved } else { curve.to_vec() }
}

/// True if no leg of the control polygon turned or grew by more than [`LEEWAY`] of its length.
fn keeps_shape(curve: &[DVec3], moved: &[DVec3]) -> bool {
    let legs = curve.windows(2).zip(moved.windows(2));
    legs.into_iter().all(|(a, b)| ((b[1] - b[0]) - (a[1] - a[0])).length() <= LEEWAY * (a[1] - a[0]).length())
}

fn conditions(at: usize, curve: &[DVec3], planes: &[Vec<Plane>; 2]) -> Vec<Condition> {
    let n = curve.len();
    let mut list = Vec::new();
    for (end, planes) in planes.iter().enumerate() {
        let (corner, point) = if end == 0 { (0, 1) } else { (n - 1, n - 2) };
        let mut tangency = |normal: DVec3| list.push(Condition { point, normal, value: normal.dot(curve[corner]) });
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
            y[condition.point - 1] = 1.0;
            direction.factor(1).solve(&mut y);
            y
        })
        .collect();
    let couple =
        |i: usize, j: usize| answers[j][conditions[i].point - 1] * conditions[i].normal.dot(conditions[j].normal);
    let scale: Vec<f64> = (0..conditions.len()).map(|i| couple(i, i).sqrt()).collect();
    let mut matrix = Banded::zero(conditions.len(), conditions.len() - 1);
    let mut rhs = Vec::new();
    for (i, condition) in conditions.iter().enumerate() {
        for j in 0..=i {
            matrix.add(i, j, couple(i, j) / (scale[i] * scale[j]) + if i == j { DAMPING } else { 0.0 });
        }
        rhs.push((condition.value - condition.normal.dot(curve[condition.point])) / scale[i]);
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
