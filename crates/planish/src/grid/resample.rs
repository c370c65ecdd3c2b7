//! Grids of a whole network: sizes chosen, patches relaxed, and grids that miss detail made finer.
//!
//! [K98] §5.6 ends at a density; here misses decide (`docs/methods/grids.md`, step 8).

use super::feature::FeatureError;
use super::feature::network::{Drawn, Here, give_sums};
use super::quality::{folds, miss};
use super::sizes::{bounds, total};
use super::{Grid, GridError, GridParams, Job, choose_sizes, relax_jobs};
use crate::mesh::TriMesh;
use crate::network::{Network, PatchMesh};
use crate::observe::{Observer, Part};
use rayon::prelude::*;

/// Rounds of refinement; each may double a side.
const REFINEMENT_ROUNDS: usize = 3;

/// Least and greatest factor by which a side gets more points in a round. A grid misses a smooth bump by the square
/// of its spacing, so the root of what is too much tells how much finer it must be.
const FACTOR: [f64; 2] = [1.25, 2.0];

/// A grid with folds is refined as if it missed this many times what is allowed: cells turn over where relief is
/// rougher than they are wide.
const FOLDED_MISS: f64 = 2.0;

/// Refinement may multiply the number of points by this ...
const MOST_GROWTH: f64 = 3.0;
/// ... and where it would do more, a miss must be this much greater to count, as often as needed.
const LESS: f64 = 1.4;

/// A patch that finer cells leave with more than this part of its need is past help (a fourth is hoped for), and one
/// that they leave with more folds: none reach down a needle, and cells finer than crumpled relief turn over with it.
const HELPED: f64 = 0.7;
/// Patches are tried alone if that takes at most this part of the points that refinement would add.
const TRIAL_SHARE: f64 = 0.5;

/// Both directions are refined if the greater bend is less than this part from the other.
const EVEN_BEND: f64 = 0.7;

/// Share of the first round in the time of all.
const FIRST_SHARE: f64 = 0.6;

/// Resamples every patch of `network`, with sides as [`choose_sizes`] gives them and more where a grid misses its
/// patch by more than `params.miss` of the diagonal of `input` or is folded: at most [`REFINEMENT_ROUNDS`] times, each up to
/// [`FACTOR`] along a side, and up to [`MOST_GROWTH`] times the points of the start, `params.max_side` and `params.max_points`.
///
/// Where a grid still misses more after a few rounds, it is what is reached: [`super::measure`] tells.
/// * `drawn` - feature curves, which become iso-curves of the grids of their patches; cells that sections give go over
///   what the patches want. Mostly empty.
/// # Errors
/// See [`FeatureError`].
pub fn resample(
    input: &TriMesh,
    network: &Network,
    patches: &[PatchMesh],
    drawn: Drawn,
    params: &GridParams,
    observer: &dyn Observer,
) -> Result<Vec<Grid>, FeatureError> {
    resample_by(&Here { input, network, patches, drawn, params }, (input, network, patches), drawn, params, observer)
}

/// As [`resample`], with the patches relaxed by `relaxer`.
/// # Errors
/// As [`resample`], and those of `relaxer`.
pub fn resample_by(
    relaxer: &dyn Relaxer,
    (input, network, patches): (&TriMesh, &Network, &[PatchMesh]),
    drawn: Drawn,
    params: &GridParams,
    observer: &dyn Observer,
) -> Result<Vec<Grid>, FeatureError> {
    params.validate()?;
    let mut sizes = choose_sizes(network, patches, params);
    give_sums(network, drawn, &mut sizes)?;
    let all: Vec<usize> = (0..patches.len()).collect();
    let mut grids = relaxer.relax(&all, &sizes, &Part::new(observer, 0.0, FIRST_SHARE))?;
    let allowed = params.miss * input.bounds().diagonal();
    let chords = network.chords();
    let [_, most] = bounds(params);
    let budget = ((MOST_GROWTH * total(&sizes) as f64) as usize).min(params.max_points);
    let mut suspects = all;
    let mut past_help = vec![false; patches.len()];
    // What was wrong with the patches that asked for the last round.
    let mut before: Vec<Option<Fault>> = vec![None; patches.len()];
    for round in 0..REFINEMENT_ROUNDS {
        observer.check().map_err(GridError::from)?;
        let fault = |p: usize, grid: &Grid| {
            let folds = folds(grid, &patches[p]);
            let floor = if folds > 0 { FOLDED_MISS * allowed } else { 0.0 };
            Fault { folds, miss: miss(grid, &patches[p]).0.max(floor) }
        };
        suspects.retain(|&p| !past_help[p]);
        let faults: Vec<Fault> = suspects.par_iter().map(|&p| fault(p, &grids[p])).collect();
        for (&p, now) in suspects.iter().zip(&faults) {
            past_help[p] = before[p].take().is_some_and(|before| !now.helped(before));
        }
        let wants = |past_help: &[bool]| -> Vec<(usize, f64)> {
            suspects.iter().zip(&faults).map(|(&p, f)| (p, if past_help[p] { 0.0 } else { f.miss })).collect()
        };
        let misses = wants(&past_help);
        // Long chords carry one patch's need far: where that asks for too many points, only the worst are heeded.
        let wish = |misses: &[(usize, f64)]| -> Result<Vec<Size>, FeatureError> {
            let mut limit = allowed;
            loop {
                let mut wanted = finer(network, &chords, &grids, misses, limit, most);
                give_sums(network, drawn, &mut wanted)?;
                if total(&wanted) <= budget || wanted == sizes {
                    return Ok(wanted);
                }
                limit *= LESS;
            }
        };
        let mut wanted = wish(&misses)?;
        let share = (1.0 - FIRST_SHARE) / REFINEMENT_ROUNDS as f64;
        let start = FIRST_SHARE + share * round as f64;
        let needy: Vec<usize> = (0..suspects.len()).filter(|&k| misses[k].1 > allowed).collect();
        let tried: Vec<usize> = needy.iter().map(|&k| suspects[k]).collect();
        needy.iter().for_each(|&k| before[suspects[k]] = Some(faults[k]));
        let added = total(&wanted).saturating_sub(total(&sizes));
        let trial: usize = tried.iter().map(|&p| wanted[p].0 * wanted[p].1).sum();
        if trial as f64 <= TRIAL_SHARE * added as f64 {
            for (&k, grid) in needy.iter().zip(relaxer.relax(&tried, &wanted, &Part::new(observer, start, 0.0))?) {
                past_help[suspects[k]] = !fault(suspects[k], &grid).helped(faults[k]);
            }
            wanted = wish(&wants(&past_help))?;
        }
        suspects = (0..patches.len()).filter(|&p| wanted[p] != sizes[p]).collect();
        if suspects.is_empty() {
            break;
        }
        for (&p, grid) in suspects.iter().zip(relaxer.relax(&suspects, &wanted, &Part::new(observer, start, share))?) {
            grids[p] = grid;
        }
        sizes = wanted;
    }
    Ok(grids)
}

/// Who relaxes patches: [`Here`], or other processes in its place.
pub trait Relaxer: Sync {
    /// Grids of some of the patches of a network, rising, by the sizes of all: what [`Here`] makes of them, to the bit.
    /// # Errors
    /// See [`FeatureError`].
    fn relax(&self, which: &[usize], sizes: &[Size], observer: &dyn Observer) -> Result<Vec<Grid>, FeatureError>;
}

impl Relaxer for Here<'_> {
    fn relax(&self, which: &[usize], sizes: &[Size], observer: &dyn Observer) -> Result<Vec<Grid>, FeatureError> {
        let Here { input, patches, drawn, params, .. } = *self;
        if drawn.0.is_empty() && drawn.1.is_empty() {
            let jobs: Vec<Job> = which.iter().map(|&p| (p, &patches[p], sizes[p])).collect();
            return Ok(relax_jobs(input, &jobs, &[], params, observer)?);
        }
        self.relax_some(which, sizes, observer)
    }
}

/// Gives twice the cells to the chords of some curves, the neediest first where not all have room: up to [`MOST_GROWTH`] times
/// the points of `start`, `params.max_side` and `params.max_points`. False if none got more.
///
/// * `need` - for each curve how much it needs finer grids; 0 for not at all
/// # Errors
/// See [`FeatureError`].
pub fn densify(
    relaxer: &dyn Relaxer,
    (network, drawn): (&Network, Drawn),
    (grids, start): (&mut [Grid], usize),
    need: &[f64],
    params: &GridParams,
    observer: &dyn Observer,
) -> Result<bool, FeatureError> {
    let chords = network.chords();
    let mut most_of = vec![0.0f64; chords.len()];
    for (&chord, &need) in chords.iter().zip(need) {
        most_of[chord as usize] = most_of[chord as usize].max(need);
    }
    let [_, most] = bounds(params);
    let budget = ((MOST_GROWTH * start as f64) as usize).min(params.max_points);
    let before: Vec<Size> = grids.iter().map(|g| (g.cols, g.rows)).collect();
    let sized = |least: f64| -> Result<Vec<Size>, FeatureError> {
        let count = |count: usize, curve: u32| {
            let need = most_of[chords[curve as usize] as usize];
            if need >= least { (2 * count - 1).min(most).max(count) } else { count }
        };
        let sides = network.patches.iter().zip(&before);
        let mut sizes: Vec<Size> =
            sides.map(|(p, s)| (count(s.0, p.sides[0].curve), count(s.1, p.sides[1].curve))).collect();
        give_sums(network, drawn, &mut sizes)?;
        Ok(sizes)
    };
    // The most of the neediest that there is room for.
    let mut needs: Vec<f64> = need.iter().copied().filter(|n| *n > 0.0).collect();
    needs.sort_unstable_by(|a, b| b.total_cmp(a));
    needs.dedup();
    let (mut room, mut too_many) = (0, needs.len() + 1);
    let mut sizes = before.clone();
    while too_many - room > 1 {
        let middle = if too_many > needs.len() { needs.len() } else { (room + too_many) / 2 };
        let wanted = sized(needs.get(middle - 1).copied().unwrap_or(f64::INFINITY))?;
        if total(&wanted) <= budget {
            (room, sizes) = (middle, wanted);
        } else {
            too_many = middle;
        }
    }
    let which: Vec<usize> = (0..grids.len()).filter(|&p| sizes[p] != before[p]).collect();
    for (&p, grid) in which.iter().zip(relaxer.relax(&which, &sizes, observer)?) {
        grids[p] = grid;
    }
    Ok(!which.is_empty())
}

/// Points along u and v.
pub type Size = (usize, usize);

/// What is wrong with a grid.
#[derive(Clone, Copy)]
struct Fault {
    folds: usize,
    /// Greatest miss of a vertex, and at least what a folded grid counts as, world units.
    miss: f64,
}

impl Fault {
    /// Whether finer cells were of use.
    fn helped(self, before: Fault) -> bool {
        self.miss <= HELPED * before.miss && self.folds <= before.folds
    }
}

/// Sizes with more points along the chords of patches that miss more than `limit`.
/// * `misses` - patches, and what each misses
fn finer(
    network: &Network,
    chords: &[u32],
    grids: &[Grid],
    misses: &[(usize, f64)],
    limit: f64,
    most: usize,
) -> Vec<(usize, usize)> {
    let mut factor = vec![1.0f64; chords.len()];
    for &(p, miss) in misses.iter().filter(|m| m.1 > limit) {
        for (side, coarse) in network.patches[p].sides.iter().zip(coarse(&grids[p])) {
            let f = &mut factor[chords[side.curve as usize] as usize];
            *f = if coarse { f.max((miss / limit).sqrt().clamp(FACTOR[0], FACTOR[1])) } else { *f };
        }
    }
    let count = |count: usize, curve: u32| {
        let f = factor[chords[curve as usize] as usize];
        ((count as f64 * f).round() as usize).min(most).max(count)
    };
    let sized = network.patches.iter().zip(grids);
    sized.map(|(p, g)| (count(g.cols, p.sides[0].curve), count(g.rows, p.sides[1].curve))).collect()
}

/// Whether a grid is too coarse along u and along v: where curves of one direction bend far less between their points
/// than those of the other, more points along them would not help.
fn coarse(grid: &Grid) -> [bool; 2] {
    let (cols, rows) = (grid.cols, grid.rows);
    let bend = |stride: usize, k: usize| {
        let p = &grid.points;
        (p[k - stride] + p[k + stride] - 2.0 * p[k]).length()
    };
    let greatest = |stride: usize, of: &mut dyn Iterator<Item = usize>| of.map(|k| bend(stride, k)).fold(0.0, f64::max);
    let along = greatest(1, &mut (0..rows).flat_map(|j| (1..cols - 1).map(move |i| j * cols + i)));
    let across = greatest(cols, &mut (1..rows - 1).flat_map(|j| (0..cols).map(move |i| j * cols + i)));
    [along >= EVEN_BEND * across, across >= EVEN_BEND * along]
}
