//! What is asked along seams: the angle there, and how it changes with the control points.

use super::bend::{Side, Stand, fold_angle};
use super::params::StitchParams;
use super::work::Work;
use crate::surface::basis::{BasisRows, span_samples};
use crate::surface::fold::MeanNormals;
use crate::surface::sides::{is_smooth, place};
use glam::DVec3;

/// Samples of the angle per knot span: products of the cubics of both sides have no more extremes.
const SPAN_SAMPLES: usize = 5;
/// Weights of a seam: at 1 the tolerance of the angle all along it costs what its patches can afford to lose. It begins where
/// the angles of a fit (degrees where the tolerance is hundredths) cost no more than that, and ends where the angle is in
/// effect a condition.
pub(crate) const FIRST_WEIGHT: f64 = 1e-3;
pub(crate) const MOST_WEIGHT: f64 = 1e4;

/// What is asked along a curve: of the two sides of a smooth seam together, of one side of a sharp one by its grid.
pub(crate) struct Wish {
    pub sides: Vec<Side>,
    pub knots: Vec<f64>,
    /// Normals at the samples, for a side of a sharp seam.
    pub own: Vec<DVec3>,
    pub samples: Vec<f64>,
    pub tolerance: f64,
    pub weight: f64,
    /// Largest weight that it may have, and the angle before it was last raised.
    pub ceiling: f64,
    pub last: f64,
    /// True while the angle is too large for its linearisation.
    pub aims: bool,
}

/// An angle and how it changes: `(patch, control point, gradient)`.
pub(crate) struct Turn {
    pub angle: f64,
    pub trust: f64,
    pub gradient: Vec<(usize, usize, DVec3)>,
}

impl Wish {
    /// The angle at sample `s`; `None` where a side has no tangent plane.
    pub fn turn(&self, nets: &[Vec<DVec3>], means: &[MeanNormals], s: usize) -> Option<Turn> {
        let t = self.samples[s];
        let stands: Vec<Stand> =
            self.sides.iter().map(|side| side.stand(&nets[side.patch], &self.knots, t)).collect::<Option<_>>()?;
        let angle = match &stands[..] {
            [a, b] => fold_angle(a, b),
            [a, ..] => a.inward.dot(self.own[s]).atan2(a.normal.dot(self.own[s])),
            [] => return None,
        };
        let trust = self.sides.iter().zip(&stands).map(|(side, s)| side.trust(s, means, t)).fold(1.0, f64::min);
        let gradient = self.sides.iter().zip(&stands);
        let gradient = gradient.flat_map(|(side, s)| s.turn.iter().map(|&(c, way)| (side.patch, c, way))).collect();
        Some(Turn { angle, trust, gradient })
    }

    /// The angles of both sides of a seam with the mean of their normals at sample `s`, each made credible by its grid.
    pub fn aims(&self, nets: &[Vec<DVec3>], means: &[MeanNormals], s: usize) -> Vec<Turn> {
        let t = self.samples[s];
        let mended = |side: &Side| {
            let (u, v) = place(side.side, side.reversed, t);
            let normal = side.stand(&nets[side.patch], &self.knots, t).map_or(DVec3::ZERO, |stand| stand.normal);
            means[side.patch].mend(normal, u, v)
        };
        let Some(aim) = self.sides.iter().map(mended).sum::<DVec3>().try_normalize() else { return Vec::new() };
        let one = |side: &Side| {
            let stand = side.stand_towards(&nets[side.patch], &self.knots, t, Some(aim))?;
            let gradient = stand.turn.iter().map(|&(c, way)| (side.patch, c, way)).collect();
            // Twice the squares of the halves are the square of the whole.
            Some(Turn { angle: stand.inward.dot(aim), trust: 2.0 * side.trust(&stand, means, t), gradient })
        };
        self.sides.iter().filter_map(one).collect()
    }

    /// Samples at which the normals that are to agree are more than a right angle apart: there the sides of a seam turn back on each
    /// other.
    pub fn turned_back(&self, nets: &[Vec<DVec3>], means: &[MeanNormals]) -> usize {
        let angles = (0..self.samples.len()).filter_map(|s| self.turn(nets, means, s));
        angles.filter(|turn| turn.angle.abs() > std::f64::consts::FRAC_PI_2).count()
    }

    /// Largest angle where a normal is to be trusted, and the sum of the trusted squares.
    pub fn angles(&self, nets: &[Vec<DVec3>], means: &[MeanNormals]) -> (f64, f64) {
        let all = (0..self.samples.len()).filter_map(|s| self.turn(nets, means, s));
        all.fold((0.0, 0.0), |(most, squares), t| {
            (if t.trust == 1.0 { t.angle.abs().max(most) } else { most }, squares + t.trust * t.angle * t.angle)
        })
    }
}

/// What is asked along all seams.
pub(crate) fn wishes(work: &Work, curves: &[Vec<DVec3>], params: &StitchParams) -> Vec<Wish> {
    let mut wishes = Vec::new();
    for (curve, uses) in work.uses.iter().enumerate().filter(|(_, uses)| uses.len() == 2) {
        if uses.iter().all(|(p, _)| work.held[*p as usize]) {
            continue;
        }
        let knots = work.knots[curve].list().to_vec();
        let samples = span_samples(&work.knots[curve].breaks(), SPAN_SAMPLES);
        let sides: Vec<Side> = uses.iter().map(|&at| work.side(at)).collect();
        let some =
            |which: &dyn Fn(f64) -> bool| -> Vec<f64> { samples.iter().copied().filter(|&t| which(t)).collect() };
        let wish = |sides: Vec<Side>, own: Vec<DVec3>, samples: Vec<f64>, tolerance: f64| {
            let knots = knots.clone();
            Wish {
                sides,
                knots,
                own,
                samples,
                tolerance: tolerance.to_radians(),
                weight: FIRST_WEIGHT,
                ceiling: MOST_WEIGHT,
                last: f64::INFINITY,
                aims: false,
            }
        };
        if is_smooth(&work.network.curves[curve]) {
            let smooth = some(&|t| work.meets.is_smooth(curve, t));
            if !smooth.is_empty() {
                wishes.push(wish(sides.clone(), Vec::new(), smooth, params.angle_tolerance));
            }
        }
        let sharp = some(&|t| !is_smooth(&work.network.curves[curve]) || !work.meets.is_smooth(curve, t));
        if !sharp.is_empty() {
            for side in sides.into_iter().filter(|side| !work.held[side.patch]) {
                let own = own_normals(&work.means[side.patch], &side, &knots, &curves[curve], &sharp);
                wishes.push(wish(vec![side], own, sharp.clone(), params.sharp_tolerance));
            }
        }
    }
    wishes
}

/// Unit normals along one side of a patch, perpendicular to its curve: those of the patch's own grid,
/// continued to it.
pub(crate) fn own_normals(
    means: &MeanNormals,
    side: &Side,
    knots: &[f64],
    control: &[DVec3],
    samples: &[f64],
) -> Vec<DVec3> {
    let along = BasisRows::new(knots, samples, 1);
    let one = |(s, &t): (usize, &f64)| {
        let (u, v) = place(side.side, side.reversed, t);
        let tangent: DVec3 = (0..4).map(|a| control[along.first[s] + a] * along.weights[s][a]).sum();
        let (tangent, field) = (tangent.normalize_or_zero(), means.at(u, v));
        (field - tangent * tangent.dot(field)).try_normalize().unwrap_or(field)
    };
    samples.iter().enumerate().map(one).collect()
}
