//! A map without flipped triangles from one with some.
//!
//! Rounds of minimising the barrier energy ([`Maps::barrier`]), each with less softness, as its authors prescribe. The
//! steps are those of L-BFGS (Nocedal and Wright, *Numerical Optimization*, algorithm 7.4) with the Laplacian of the map as
//! its first Hessian, as Kovalsky, Galun and Lipman do (*Accelerated Quadratic Proxy*, 2016): some ten steps a round do, on
//! meshes of any size.

use super::energy::Maps;
use crate::observe::{Cancelled, Observer};
use planish_sparse::SparseCholesky;

/// Rounds after which a map that still has flipped faces is given up.
const UNTANGLING_ROUNDS: usize = 40;

/// A round without softness that gains less than this part of the energy is the last.
const EVEN: f64 = 0.01;

/// Steps of L-BFGS in a round.
const STEPS: usize = 30;

/// Pairs of step and change of gradient that L-BFGS remembers.
const MEMORY: usize = 12;

/// Part of the predicted fall of the energy that a step has to reach (Armijo's rule), and how often a step is halved.
const WORTH: f64 = 1e-4;
const HALVINGS: usize = 30;

/// A step that gains less than this part of the energy ends the round.
const SETTLED: f64 = 1e-5;

/// Moves the free unknowns until all that the barrier guards is positive; true if that is reached.
///
/// `softness` is that of the first round, where something is not; without any the barrier is hard from the start.
pub(super) fn untangle(
    maps: &Maps,
    laplacian: &SparseCholesky,
    free: &mut Vec<f64>,
    softness: f64,
    observer: &dyn Observer,
) -> Result<bool, Cancelled> {
    let mut x = maps.seams.coordinates(free);
    let mut least = maps.least_guarded(&x);
    let mut softness = if least > 0.0 { 0.0 } else { softness };
    for _ in 0..UNTANGLING_ROUNDS {
        let before = maps.barrier(&x, softness).0;
        let after = descend(maps, laplacian, free, softness, observer)?;
        // Where no step was taken the harder barriers of later rounds took none either, on all maps that were looked at.
        if softness > 0.0 && after >= before {
            break;
        }
        x = maps.seams.coordinates(free);
        least = maps.least_guarded(&x);
        if maps.is_spent() {
            break;
        }
        if least > 0.0 {
            if softness == 0.0 && after > (1.0 - EVEN) * before {
                return Ok(true);
            }
            softness = 0.0;
            continue;
        }
        // The rule of the paper's section 3: so much softer that the energy of the present map surely falls on.
        let sigma = (1.0 - after / before).max(0.1);
        let root = (least * least + softness * softness).sqrt();
        softness = ((1.0 - sigma * root / (least.abs() + root)) * softness).max(0.003 * least.abs());
    }
    Ok(least > 0.0)
}

/// One round; returns the energy at its end.
fn descend(
    maps: &Maps,
    laplacian: &SparseCholesky,
    free: &mut Vec<f64>,
    softness: f64,
    observer: &dyn Observer,
) -> Result<f64, Cancelled> {
    let evaluate = |free: &[f64]| maps.barrier(&maps.seams.coordinates(free), softness);
    let (mut energy, mut gradient) = evaluate(free);
    let mut pairs: Vec<(Vec<f64>, Vec<f64>, f64)> = Vec::new();
    for _ in 0..STEPS {
        observer.check()?;
        if maps.is_spent() {
            break;
        }
        let step = direction(laplacian, &gradient, &pairs);
        let slope = dot(&step, &gradient);
        if slope >= 0.0 {
            pairs.clear();
            if slope == 0.0 {
                break;
            }
            continue;
        }
        let Some(Taken { length, free: tried, energy: e, gradient: g }) = fall(&evaluate, free, &step, (energy, slope))
        else {
            break;
        };
        let moved: Vec<f64> = step.iter().map(|s| length * s).collect();
        let change: Vec<f64> = g.iter().zip(&gradient).map(|(new, old)| new - old).collect();
        let curvature = dot(&moved, &change);
        if curvature > 1e-12 * dot(&moved, &moved).sqrt() * dot(&change, &change).sqrt() {
            pairs.push((moved, change, 1.0 / curvature));
            if pairs.len() > MEMORY {
                pairs.remove(0);
            }
        }
        let gain = energy - e;
        (*free, energy, gradient) = (tried, e, g);
        if gain < SETTLED * energy.abs() {
            break;
        }
    }
    Ok(energy)
}

/// A step that was taken, or a part of it.
pub(super) struct Taken {
    /// The part.
    pub length: f64,
    /// Where it led: unknowns, their energy and its gradient.
    pub free: Vec<f64>,
    pub energy: f64,
    pub gradient: Vec<f64>,
}

/// Takes a step, halved as often as needed for the energy to fall as much as predicted; `None` if that does not help.
/// * `evaluate` - energy and gradient
/// * `energy`, `slope` - the energy before, and its change along the step
pub(super) fn fall(
    evaluate: &impl Fn(&[f64]) -> (f64, Vec<f64>),
    free: &[f64],
    step: &[f64],
    (energy, slope): (f64, f64),
) -> Option<Taken> {
    let take = |length: f64| {
        let free: Vec<f64> = free.iter().zip(step).map(|(x, s)| x + length * s).collect();
        let (energy, gradient) = evaluate(&free);
        Taken { length, free, energy, gradient }
    };
    let lengths = std::iter::successors(Some(1.0), |length| Some(length / 2.0)).take(HALVINGS);
    lengths.map(take).find(|taken| taken.energy <= energy + WORTH * taken.length * slope)
}

/// The two-loop recursion.
fn direction(laplacian: &SparseCholesky, gradient: &[f64], pairs: &[(Vec<f64>, Vec<f64>, f64)]) -> Vec<f64> {
    let mut q: Vec<f64> = gradient.iter().map(|g| -g).collect();
    let mut part = vec![0.0; pairs.len()];
    for (i, (moved, change, inverse)) in pairs.iter().enumerate().rev() {
        part[i] = inverse * dot(moved, &q);
        q.iter_mut().zip(change).for_each(|(q, c)| *q -= part[i] * c);
    }
    laplacian.solve(&mut q);
    if let Some((moved, change, _)) = pairs.last() {
        let mut turned = change.clone();
        laplacian.solve(&mut turned);
        let scale = dot(moved, change) / dot(change, &turned).max(f64::MIN_POSITIVE);
        q.iter_mut().for_each(|q| *q *= scale);
    }
    for (i, (moved, change, inverse)) in pairs.iter().enumerate() {
        let back = inverse * dot(change, &q);
        q.iter_mut().zip(moved).for_each(|(q, m)| *q += (part[i] - back) * m);
    }
    q
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
