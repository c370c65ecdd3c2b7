//! How many control points each curve of a network gets, and where their knots stand.
//!
//! Curves on opposite sides of a patch share their knots (a chord), so these are chosen per chord: as given, or as few as
//! a tolerance needs (`spacing`).

use super::FitError;
use super::basis::Knots;
use super::fit::FEWEST_CONTROL;
use super::params::{Continuity, FitParams, Resolution};
use super::quality::normal;
use super::seam::corner::sectors;
use super::spacing::{Chord, Spaced};
use crate::grid::Grid;
use crate::network::{Along, Network};
use crate::observe::Observer;
use glam::DVec3;
use rayon::prelude::*;

/// Steps of the search for the tolerance that a budget of control points allows: to a fiftieth of a factor of 1000.
const BUDGET_STEPS: usize = 9;
/// Largest factor by which a budget may widen the tolerance.
const BUDGET_FACTOR: f64 = 1e3;

/// The knots of a network: how they were chosen, and how they may be made finer.
pub(crate) struct Plan {
    along: Vec<Along>,
    /// For each curve the number of its chord in `chords`.
    of: Vec<usize>,
    chords: Vec<Spaced>,
}

impl Plan {
    /// * `nodes` - points of the grids along each curve
    /// * `allowed` - the distance of a tolerance, world units
    pub fn new(
        network: &Network,
        grids: &[Grid],
        nodes: &[usize],
        params: &FitParams,
        allowed: f64,
        observer: &dyn Observer,
    ) -> Result<Plan, FitError> {
        let along = network.directed_chords();
        let double = match params.continuity {
            Continuity::C0 | Continuity::G1 => vec![false; network.curves.len()],
            Continuity::G1Double => double(network, &along),
            Continuity::G1Exact => seams(network, &along),
        };
        let mut of = vec![usize::MAX; along.len()];
        let mut chords: Vec<Chord> = Vec::new();
        for (c, run) in along.iter().enumerate() {
            if run.chord as usize == c {
                of[c] = chords.len();
                chords.push(Chord::new(nodes[c], params.cells_per_span, double[c], run.both_ways));
            }
            of[c] = of[run.chord as usize];
        }
        for (p, patch) in network.patches.iter().enumerate() {
            for axis in 0..2 {
                let side = patch.sides[axis];
                let chord = &mut chords[of[side.curve as usize]];
                chord.strands.push((p, axis, side.reversed != along[side.curve as usize].reversed));
            }
        }
        let asked = counts_at(network, &of, chords.len(), &params.control_at)?;
        chords.iter_mut().zip(asked).for_each(|(chord, count)| chord.asked = count);
        let chords = match &params.resolution {
            Resolution::Tolerance(_) => spaced(grids, &chords, params, allowed, observer)?,
            given => {
                let counts = given_counts(network, &of, chords.len(), given)?;
                let even = |(chord, count): (&Chord, usize)| Spaced::even(chord, chord.asked.unwrap_or(count));
                chords.iter().zip(counts).map(even).collect()
            }
        };
        Ok(Plan { along, of, chords })
    }

    /// The knots along every curve, in its direction.
    pub fn knots(&self) -> Vec<Knots> {
        let knots: Vec<Knots> = self.chords.iter().map(|chord| chord.knots()).collect();
        let one = |(c, run): (usize, &Along)| {
            let knots = &knots[self.of[c]];
            if run.reversed { knots.reversed() } else { knots.clone() }
        };
        self.along.iter().enumerate().map(one).collect()
    }

    /// For each curve how many times the tolerance a patch misses along its chord with as many spans as the grids carry; 0 if
    /// all keep it.
    pub fn excess(&self) -> Vec<f64> {
        self.of.iter().map(|&chord| self.chords[chord].excess).collect()
    }

    /// Gives the chords of these curves about a quarter more spans, as far as their grids carry them. False if none got more.
    pub fn refine(&mut self, curves: impl Iterator<Item = usize>) -> bool {
        let mut which: Vec<usize> = curves.map(|c| self.of[c]).collect();
        which.sort_unstable();
        which.dedup();
        which.into_iter().filter(|&chord| self.chords[chord].refine()).count() > 0
    }
}

/// The control points of the patches with these knots along the chords.
fn total(chords: &[Chord], spaced: &[Spaced]) -> usize {
    let mut sizes = std::collections::BTreeMap::<usize, usize>::new();
    for (chord, spaced) in chords.iter().zip(spaced) {
        for &(patch, ..) in &chord.strands {
            *sizes.entry(patch).or_insert(1) *= spaced.control();
        }
    }
    sizes.values().sum()
}

/// Knots for a tolerance, within the budget.
fn spaced(
    grids: &[Grid],
    chords: &[Chord],
    params: &FitParams,
    allowed: f64,
    observer: &dyn Observer,
) -> Result<Vec<Spaced>, FitError> {
    let normals: Vec<Vec<DVec3>> =
        grids.par_iter().map(|grid| (0..grid.points.len()).map(|node| normal(grid, node)).collect()).collect();
    let try_at = |allowed: f64| -> Result<Vec<Spaced>, FitError> {
        let one = |chord: &Chord| {
            observer.check()?;
            chord.space(grids, &normals, params.tolerance_of, params.knots, allowed)
        };
        chords.par_iter().map(one).collect::<Vec<_>>().into_iter().collect()
    };
    let found = try_at(allowed)?;
    let Some(most) = params.max_control.filter(|&most| total(chords, &found) > most) else { return Ok(found) };
    let (mut low, mut high) = (0.0, BUDGET_FACTOR.ln());
    let mut best = try_at(allowed * BUDGET_FACTOR)?;
    if total(chords, &best) > most {
        return Err(FitError::Budget { most, least: total(chords, &best) });
    }
    for _ in 0..BUDGET_STEPS {
        let middle = (low + high) / 2.0;
        let found = try_at(allowed * f64::exp(middle))?;
        if total(chords, &found) > most {
            low = middle;
        } else {
            (high, best) = (middle, found);
        }
    }
    Ok(best)
}

/// Counts of the chords that single patches ask for.
fn counts_at(
    network: &Network,
    of: &[usize],
    chords: usize,
    asked: &[[usize; 3]],
) -> Result<Vec<Option<usize>>, FitError> {
    let mut wanted = vec![None; chords];
    for &[patch, along_u, along_v] in asked {
        let Some(sides) = network.patches.get(patch).map(|p| p.sides) else {
            return Err(FitError::NoSuchPatch { patch, patches: network.patches.len() });
        };
        for (side, control) in sides.into_iter().zip([along_u, along_v]) {
            if control < FEWEST_CONTROL {
                return Err(FitError::TooFewControl { control });
            }
            let entry = &mut wanted[of[side.curve as usize]];
            *entry = Some(entry.map_or(control, |before: usize| before.max(control)));
        }
    }
    Ok(wanted)
}

/// Counts of the chords as they are given, the largest of their curves.
fn given_counts(network: &Network, of: &[usize], chords: usize, given: &Resolution) -> Result<Vec<usize>, FitError> {
    let mut wanted = vec![FEWEST_CONTROL; chords];
    let mut want = |curve: usize, count: usize| {
        let entry = &mut wanted[of[curve]];
        *entry = count.max(*entry);
    };
    let enough = |counts: &[usize]| match counts.iter().find(|&&c| c < FEWEST_CONTROL) {
        Some(&control) => Err(FitError::TooFewControl { control }),
        None => Ok(()),
    };
    match given {
        Resolution::Control(count) => {
            enough(count)?;
            for patch in &network.patches {
                (0..4).for_each(|k| want(patch.sides[k].curve as usize, count[k % 2]));
            }
        }
        Resolution::PerCurve(list) => {
            if list.len() != network.curves.len() {
                return Err(FitError::Count { what: "counts", found: list.len(), wanted: network.curves.len() });
            }
            enough(list)?;
            list.iter().enumerate().for_each(|(c, &n)| want(c, n));
        }
        Resolution::Tolerance(_) => {}
    }
    Ok(wanted)
}

/// For each curve whether its knots are double: in the chords of smooth seams that end in an irregular corner, that is in a
/// sector without sharp curves of other than four patches, or between two of these of other than two.
///
/// There the parameter directions across the seam are no continuation of each other, and with simple knots the seam could
/// only be one cubic from end to end (`docs/methods/surfaces.md`, "Smooth seams").
fn double(network: &Network, along: &[Along]) -> Vec<bool> {
    let mut double = vec![false; network.curves.len()];
    let is_smooth = |c: usize| network.curves[c].kind.is_smooth();
    for sector in sectors(network, &|c, _| is_smooth(c)) {
        if sector.wedges.len() != if sector.closed { 4 } else { 2 } {
            for &(curve, _) in sector.ends.iter().filter(|(c, _)| is_smooth(*c)) {
                double[along[curve].chord as usize] = true;
            }
        }
    }
    along.iter().map(|run| double[run.chord as usize]).collect()
}

/// For each curve whether its chord has a smooth seam.
fn seams(network: &Network, along: &[Along]) -> Vec<bool> {
    let mut double = vec![false; network.curves.len()];
    for (c, uses) in network.uses().iter().enumerate() {
        double[along[c].chord as usize] |= uses.len() == 2 && network.curves[c].kind.is_smooth();
    }
    along.iter().map(|run| double[run.chord as usize]).collect()
}
