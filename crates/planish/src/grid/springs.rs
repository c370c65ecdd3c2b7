//! The grid of one patch: coarse to fine, relaxed at every resolution.
//!
//! [K98] §5.5 and 5.6. The start is the regular grid of the chart; where a part sticks out of the patch the chart
//! holds it in a small spot, so the coarsest grid is first drawn into such parts by [`even`], which measures along
//! the curves and not between their points. Then [`settle`] balances spacing against angles at every resolution.

use super::chart::Chart;
use super::even::{even, unevenness};
use super::fold::{folded_cells, open_folds};
use super::locate::Spot;
use super::net::Net;
use super::settle::settle;
use super::{Fault, GridParams};

/// Cells along the longer direction from which a grid is not made coarser.
const COARSEST: usize = 32;
/// Cells along the shorter direction that coarser grids keep.
const COARSEST_SHORT: usize = 8;
/// Rounds of Gauss-Newton at the coarsest resolution and at those after it.
const FIRST_ROUNDS: usize = 16;
const LATER_ROUNDS: [usize; 3] = [8, 5, 3];

/// Rounds of drawing out that are tried one after the other.
const EVEN_ROUNDS: [usize; 3] = [12, 3, 0];
/// Score of a coarsest grid: its mean square unevenness plus this times the fraction of folded cells. One that is
/// uneven by a quarter with few folds is good enough; nothing else is then tried.
const FOLD_COST: f64 = 5.0;
const GOOD_SCORE: f64 = 0.0625;

/// The spots of `cols x rows` grid points in `chart`, row-major.
pub fn relax(
    chart: &Chart,
    cols: usize,
    rows: usize,
    params: &GridParams,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Spot>, Fault> {
    let mut levels = vec![(cols, rows)];
    while let Some(&(c, r)) = levels.last()
        && (c - 1).max(r - 1) >= 2 * COARSEST
    {
        let halved = |n: usize| if n > 2 * COARSEST_SHORT { (n - 1).div_ceil(2) + 1 } else { n };
        levels.push((halved(c), halved(r)));
    }
    let (c, r) = levels[levels.len() - 1];
    let mut net = coarsest(chart, c, r, params, cancelled)?;
    for (k, &(c, r)) in levels.iter().rev().skip(1).enumerate() {
        net = net.resampled(c, r);
        net = settle(net, LATER_ROUNDS[k.min(LATER_ROUNDS.len() - 1)], params, cancelled)?;
    }
    open_folds(&mut net, cancelled)?;
    Ok(net.spots)
}

/// The settled coarsest grid. Drawing it out fully suits protruding parts; where the rim of the patch runs in deep
/// bays it can crumple the grid, and less of it is better: the best of several is taken.
fn coarsest<'a>(
    chart: &'a Chart,
    cols: usize,
    rows: usize,
    params: &GridParams,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Net<'a>, Fault> {
    let mut best: Option<(f64, Net<'a>)> = None;
    for rounds in EVEN_ROUNDS {
        let mut net = even(Net::regular(chart, cols, rows), rounds, cancelled)?;
        net = settle(net, FIRST_ROUNDS, params, cancelled)?;
        open_folds(&mut net, cancelled)?;
        let folded = folded_cells(&net.points, cols, rows).len() as f64 / (net.points.len() as f64);
        let score = unevenness(&net) + FOLD_COST * folded;
        if best.as_ref().is_none_or(|(b, _)| score < *b) {
            best = Some((score, net));
        }
        if score < GOOD_SCORE {
            break;
        }
    }
    Ok(best.map_or_else(|| Net::regular(chart, cols, rows), |(_, net)| net))
}
