//! Fitted neighbours inside a fit: the CLOSED points of [X03] §5, which weigh more than others, with their normals.
//!
//! A neighbour counts as a few points at its place, and its unit normal `n` as what that many points tell of a slope: the Hermite
//! term `w |g - (g . n) n|²` of the gradient `g` joins the squared values of the quadric (`docs/methods/samples.md`, section 3).
//!
//! Only what a gradient has across the normal is penalised and not its length: the length of the gradient of a general quadric
//! differs from place to place, and with it exact points would no longer give exact quadrics. It stays with Taubin's constraint.

use super::fitted::{Fit, GUIDE_ERROR_NOISE};
use super::height::Frame;
use super::weights::{kernel, tukey};
use crate::cloud::Quadric;
use crate::geom::KdTree;
use glam::DVec3;

/// Points that a fitted neighbour in the middle of a ball counts as.
const CLOSED_WEIGHT: f64 = 4.0;
/// Neighbours of another sheet are not heeded: those that turn by more than this cosine (30 degrees).
const SAME_SHEET_COSINE: f64 = 0.866;

/// A fitted neighbour in the local coordinates of a fit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Guide {
    at: DVec3,
    /// Unit normal; its side is of no meaning.
    normal: DVec3,
    /// Points that its place counts as.
    weight: f64,
    /// Squared radius of its own fit: over the variance of a height, that of a slope.
    reach2: f64,
}

/// The surely fitted neighbours in the ball of `radius` around `p`, of noise `noise`; all in world units.
pub(crate) fn guides(closed: &[Fit], tree: &KdTree, p: DVec3, radius: f64, noise: f64) -> Vec<Guide> {
    let mut found = Vec::new();
    tree.within(p, radius, |i, at, d2| {
        let f = &closed[i as usize];
        if f.error < GUIDE_ERROR_NOISE * noise {
            let weight = CLOSED_WEIGHT * kernel(d2 / (radius * radius));
            found.push(Guide { at: (at - p) / radius, normal: f.normal, weight, reach2: (f.radius / radius).powi(2) });
        }
    });
    found
}

/// Those of the sheet of a model, with their robust weights.
pub(crate) fn heeded(guides: &[Guide], model: &Quadric, noise: f64) -> Vec<Guide> {
    let felt = |g: &Guide| {
        let (d, n) = model.distance(g.at);
        Guide {
            weight: if n.dot(g.normal).abs() > SAME_SHEET_COSINE { g.weight * tukey(d / noise) } else { 0.0 },
            ..*g
        }
    };
    guides.iter().map(felt).filter(|g| g.weight > 0.0).collect()
}

/// Adds the guides to the matrix of squared values of quadrics.
pub(crate) fn add(guides: &[Guide], matrix: &mut [[f64; 10]; 10]) {
    for g in guides {
        let DVec3 { x, y, z } = g.at;
        let value = [x * x, x * y, x * z, y * y, y * z, z * z, x, y, z, 1.0];
        let gradient = [
            DVec3::new(2.0 * x, 0.0, 0.0),
            DVec3::new(y, x, 0.0),
            DVec3::new(z, 0.0, x),
            DVec3::new(0.0, 2.0 * y, 0.0),
            DVec3::new(0.0, z, y),
            DVec3::new(0.0, 0.0, 2.0 * z),
            DVec3::X,
            DVec3::Y,
            DVec3::Z,
            DVec3::ZERO,
        ];
        let Frame { u, v, .. } = Frame::of(g.normal);
        let across = [u, v].map(|t| gradient.map(|d| t.dot(d)));
        let slope = g.weight * g.reach2;
        for i in 0..10 {
            for j in 0..10 {
                let slopes = across[0][i] * across[0][j] + across[1][i] * across[1][j];
                matrix[i][j] += g.weight * value[i] * value[j] + slope * slopes;
            }
        }
    }
}

/// Weighted sum of their squared distances and of the squared sines between their normals and the gradients of a model.
pub(crate) fn squares(guides: &[Guide], model: &Quadric) -> f64 {
    let square = |g: &Guide| {
        let (d, n) = model.distance(g.at);
        g.weight * (d * d + g.reach2 * (1.0 - n.dot(g.normal).powi(2)).max(0.0))
    };
    guides.iter().map(square).sum()
}

/// Sum of their weights.
pub(crate) fn weight(guides: &[Guide]) -> f64 {
    guides.iter().map(|g| g.weight).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::local::fit::{Ball, general, sheet};
    use crate::cloud::local::moments::Moments;
    use crate::cloud::local::points::Points;
    use crate::geom::random;

    /// An ellipsoid whose top is the origin.
    fn ellipsoid() -> Quadric {
        let axes = DVec3::new(1.3, 1.1, 0.9);
        let [a, b, c] = (DVec3::ONE / (axes * axes)).to_array();
        let center = DVec3::new(0.0, 0.0, -axes.z);
        Quadric { center, scale: 1.0, a: [a, 0.0, 0.0, b, 0.0, c, 0.0, 0.0, 0.0, -1.0] }
    }

    fn foot(x: f64, y: f64) -> DVec3 {
        ellipsoid().project(DVec3::new(x, y, 0.0)).0
    }

    /// Points of its cap within half a unit of the top, with noise.
    fn cap(seed: u64, count: u64, noise: f64) -> Points {
        let draw = |k: u64| random::unit(seed, k);
        let at = |k: u64| {
            let gauss = random::normal(draw(4 * k + 2), draw(4 * k + 3));
            foot(draw(4 * k) - 0.5, draw(4 * k + 1) - 0.5) + noise * gauss * DVec3::Z
        };
        (0..count).map(at).collect()
    }

    /// Fitted neighbours around the top.
    fn around() -> Vec<Guide> {
        let guide = |k: u32| {
            let turn = std::f64::consts::TAU * f64::from(k) / 8.0;
            let at = foot(0.4 * turn.cos(), 0.4 * turn.sin());
            Guide { at, normal: -ellipsoid().distance(at).1, weight: CLOSED_WEIGHT, reach2: 0.25 }
        };
        (0..8).map(guide).collect()
    }

    #[test]
    fn exact_points_and_guides_give_an_exact_quadric() {
        let points = cap(1, 60, 0.0);
        // One of another sheet says nothing.
        let stray = Guide { at: DVec3::ZERO, normal: DVec3::X, weight: CLOSED_WEIGHT, reach2: 0.25 };
        let guides: Vec<Guide> = around().into_iter().chain([stray]).collect();
        let (center, weights) = (DVec3::ZERO, vec![1.0; points.len()]);
        let ball = Ball { center, scale: 1.0, points: &points, weights: &weights, guides: &guides, noise: 0.05 };
        let found = sheet(&ball, &Quadric::plane(center, 1.0, DVec3::Z), 5).unwrap();
        assert_eq!(found.parameters, 9.0);
        for k in 0..20 {
            let at = foot(0.4 * random::unit(2, 2 * k) - 0.2, 0.4 * random::unit(2, 2 * k + 1) - 0.2);
            let (d, n) = found.quadric.distance(at);
            assert!(d.abs() < 1e-9 && n.dot(ellipsoid().distance(at).1) > 1.0 - 1e-12, "{d} {n}");
        }
    }

    #[test]
    fn guides_bring_down_the_error_of_the_normals_under_noise_to_a_half() {
        let error = |guides: &[Guide]| -> f64 {
            let start = Quadric::plane(DVec3::ZERO, 1.0, DVec3::Z).a;
            let squares = (0..100).map(|seed| {
                let mut sums = Moments::ZERO;
                cap(seed, 30, 0.03).iter().for_each(|p| sums.add(p, 1.0));
                let found = Quadric { center: DVec3::ZERO, scale: 1.0, a: general(&sums, guides, &start).unwrap() };
                let ends = [foot(0.4, 0.0), foot(-0.2, 0.3)];
                ends.map(|at| 1.0 - found.distance(at).1.dot(ellipsoid().distance(at).1).powi(2)).iter().sum::<f64>()
            });
            squares.sum::<f64>().sqrt()
        };
        let (alone, guided) = (error(&[]), error(&around()));
        assert!(guided < 0.5 * alone, "{guided} {alone}");
    }
}
