//! How many control points each curve of a network gets.
//!
//! Curves on opposite sides of a patch share their count (a chord), so the counts are chosen per chord. For a
//! tolerance each patch direction is looked at alone: the least-squares residual of a curve fit of all its rows
//! bounds from below what that direction contributes to the parametric error ([K98] eq. 6.1), and since the two
//! directions are orthogonal projections their squares add up to the square of the whole.

use super::FitError;
use super::basis::Knots;
use super::fit::{Direction, FEWEST_CONTROL, project_rows};
use super::seam::corner::sectors;
use super::sides::is_smooth;
use crate::grid::Grid;
use crate::network::Network;
use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Counts tried for a tolerance: each about a quarter above the one before, enough to halve a fourth-order
/// error at every step and to stay within a quarter of the smallest count that does.
const LADDER: [usize; 19] = [5, 6, 7, 8, 10, 12, 15, 19, 24, 30, 38, 48, 60, 75, 94, 118, 148, 185, 232];

/// How fine the control nets are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Resolution {
    /// Control points along `u` and along `v` of every patch, each at least 4. A chord that runs along `u` in
    /// one patch and along `v` in another gets the larger number.
    Control(#[schemars(inner(range(min = 4, max = 8193)))] [usize; 2]),
    /// Control points along every curve of the network, each at least 4. A chord gets the largest number
    /// among its curves.
    PerCurve(#[schemars(inner(range(min = 4, max = 8193)))] Vec<usize>),
    /// Largest RMS of the parametric distance over a patch, as a fraction of the bounding-box diagonal.
    #[schemars(description = "Largest RMS distance over a patch")]
    Tolerance(#[schemars(extend("exclusiveMinimum" = 0.0, "tolerance" = "share"))] f64),
}

/// Control points along each curve for `resolution`; a tolerance gets at most `most`.
pub(crate) fn counts(
    network: &Network,
    grids: &[Grid],
    most: &[usize],
    resolution: &Resolution,
    diagonal: f64,
) -> Result<Vec<usize>, FitError> {
    let mut wanted = vec![FEWEST_CONTROL; network.curves.len()];
    let mut want = |curve: u32, count: usize| {
        let entry = &mut wanted[curve as usize];
        *entry = count.max(*entry);
    };
    match resolution {
        Resolution::Control(count) => {
            if let Some(&control) = count.iter().find(|&&c| c < FEWEST_CONTROL) {
                return Err(FitError::TooFewControl { control });
            }
            for patch in &network.patches {
                (0..4).for_each(|k| want(patch.sides[k].curve, count[k % 2]));
            }
        }
        Resolution::PerCurve(list) => {
            if list.len() != network.curves.len() {
                return Err(FitError::Count { what: "counts", found: list.len(), wanted: network.curves.len() });
            }
            if let Some(&control) = list.iter().find(|&&c| c < FEWEST_CONTROL) {
                return Err(FitError::TooFewControl { control });
            }
            list.iter().enumerate().for_each(|(c, &n)| want(c as u32, n));
        }
        &Resolution::Tolerance(fraction) => {
            if !(fraction > 0.0 && fraction.is_finite()) {
                return Err(FitError::Parameter { name: "tolerance", value: fraction, wanted: "above 0" });
            }
            let each = fraction * diagonal / 2f64.sqrt();
            let found: Vec<Result<[usize; 2], FitError>> =
                grids.par_iter().map(|g| Ok([fewest(g, true, each)?, fewest(g, false, each)?])).collect();
            for (patch, found) in network.patches.iter().zip(found) {
                let found = found?;
                (0..4).for_each(|k| want(patch.sides[k].curve, found[k % 2]));
            }
        }
    }
    let most = matches!(resolution, Resolution::Tolerance(_)).then_some(most);
    Ok(level(network, wanted, most))
}

/// Gives every curve the largest count of its chord, at most `most` of it.
pub(crate) fn level(network: &Network, mut counts: Vec<usize>, most: Option<&[usize]>) -> Vec<usize> {
    let chords = network.chords();
    for (c, &chord) in chords.iter().enumerate() {
        let bound = most.map_or(usize::MAX, |most| most[c]);
        counts[chord as usize] = counts[chord as usize].max(counts[c]).min(bound);
    }
    chords.iter().map(|&chord| counts[chord as usize]).collect()
}

/// Knots along every curve: double in the chords of smooth seams that end in an irregular corner, that is in a sector
/// without sharp curves of other than four patches, or between two of these of other than two.
///
/// There the parameter directions across the seam are no continuation of each other, and with simple knots the seam could
/// only be one cubic from end to end (`docs/methods/surfaces.md`, "Smooth seams").
pub(crate) fn knots(network: &Network) -> Vec<Knots> {
    let chords = network.chords();
    let mut double = vec![false; network.curves.len()];
    for sector in sectors(network, &|c, _| is_smooth(&network.curves[c])) {
        if sector.wedges.len() != if sector.closed { 4 } else { 2 } {
            for &(curve, _) in sector.ends.iter().filter(|(c, _)| is_smooth(&network.curves[*c])) {
                double[chords[curve] as usize] = true;
            }
        }
    }
    chords.iter().map(|&chord| if double[chord as usize] { Knots::Double } else { Knots::Simple }).collect()
}

/// The counts nearest to these that the knots can have, at most one control point for every node.
pub(crate) fn possible(counts: Vec<usize>, kinds: &[Knots], nodes: &[usize]) -> Vec<usize> {
    counts.into_iter().zip(kinds).zip(nodes).map(|((count, kind), &nodes)| kind.possible(count, nodes)).collect()
}

/// The next count to try after `count` did not do.
pub(crate) fn finer(count: usize) -> usize {
    LADDER.iter().copied().find(|&l| l > count).unwrap_or(count + count.div_ceil(4))
}

/// Fewest control points along one direction of a grid whose curve fits leave an RMS residual below `rms`.
fn fewest(grid: &Grid, along_u: bool, rms: f64) -> Result<usize, FitError> {
    let (count, lines) = if along_u { (grid.cols, grid.rows) } else { (grid.rows, grid.cols) };
    let middle = grid.points[grid.points.len() / 2];
    let centred: Vec<DVec3> = grid.points.iter().map(|&p| p - middle).collect();
    let total: f64 = centred.iter().map(|p| p.length_squared()).sum();
    let allowed = rms * rms * (count * lines) as f64;
    for control in LADDER.into_iter().take_while(|&l| l < count) {
        let direction = Direction::new(count, control, Knots::Simple, 0.0)?;
        // |P|² - |projection|²: what the fit of every line leaves.
        let mut explained = 0.0;
        if along_u {
            for row in centred.chunks_exact(grid.cols) {
                let rhs = direction.project(row.iter().copied());
                let mut x = rhs.clone();
                direction.factor(0).solve(&mut x);
                explained += rhs.iter().zip(&x).map(|(a, b)| a.dot(*b)).sum::<f64>();
            }
        } else {
            let rhs = project_rows(&centred, grid.cols, &direction.basis, control);
            let mut x = rhs.clone();
            direction.factor(0).solve(&mut x);
            explained += rhs.iter().zip(&x).map(|(a, b)| a.dot(*b)).sum::<f64>();
        }
        if total - explained <= allowed {
            return Ok(control);
        }
    }
    Ok(count.max(FEWEST_CONTROL))
}
