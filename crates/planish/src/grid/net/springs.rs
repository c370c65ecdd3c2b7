//! The grid of one patch: coarse to fine, relaxed at every resolution.
//!
//! [K98] §5.5 and 5.6. The start is the regular grid of the chart; where a part sticks out of the patch the chart
//! holds it in a small spot, so the coarsest grid is first drawn into such parts by [`even`], which measures along
//! the curves and not between their points. Then [`settle`] balances spacing against angles at every resolution.

use super::Net;
use super::catch::catch;
use super::even::{even, unevenness};
use super::fold::{folded_cells, open_folds};
use super::settle::{CG_STEPS, settle};
use crate::grid::chart::Chart;
use crate::grid::chart::locate::Spot;
use crate::grid::{Fault, GridParams};
use crate::observe::Observer;

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

/// The spots of `cols x rows` grid points in `chart`, row-major; vertices that they miss by more than `caught` (world
/// units) are caught.
pub fn relax(
    chart: &Chart,
    cols: usize,
    rows: usize,
    params: &GridParams,
    caught: f64,
    observer: &dyn Observer,
) -> Result<Vec<Spot>, Fault> {
    let mut levels = vec![(cols, rows)];
    while let Some(&(c, r)) = levels.last()
        && (c - 1).max(r - 1) >= 2 * COARSEST
    {
        let halved = |n: usize| if n > 2 * COARSEST_SHORT { (n - 1).div_ceil(2) + 1 } else { n };
        levels.push((halved(c), halved(r)));
    }
    let (c, r) = levels[levels.len() - 1];
    let mut net = coarsest(chart, c, r, params, observer)?;
    for (k, &(c, r)) in levels.iter().rev().skip(1).enumerate() {
        net = net.resampled(c, r);
        let rounds = LATER_ROUNDS[k.min(LATER_ROUNDS.len() - 1)];
        net = settle(net, (rounds, CG_STEPS), params, observer)?;
    }
    catch(&mut net, caught, observer)?;
    open_folds(&mut net, false, observer)?;
    Ok(net.spots)
}

/// The settled coarsest grid. Drawing it out fully suits protruding parts; where the boundary of the patch runs in deep
/// bays it can crumple the grid, and less of it is better: the best of several is taken.
fn coarsest<'a>(
    chart: &'a Chart,
    cols: usize,
    rows: usize,
    params: &GridParams,
    observer: &dyn Observer,
) -> Result<Net<'a>, Fault> {
    let mut best: Option<(f64, Net<'a>)> = None;
    for rounds in EVEN_ROUNDS {
        let mut net = even(Net::regular(chart, cols, rows), rounds, observer)?;
        net = settle(net, (FIRST_ROUNDS, CG_STEPS), params, observer)?;
        let mut tried = Vec::new();
        if !folded_cells(&net).is_empty() {
            open_folds(&mut net, true, observer)?;
            // What the folds have pulled along may be even again; no cell turns over on the way.
            tried.push(settle(net.clone(), (LATER_ROUNDS[0], CG_STEPS), params, observer)?);
        }
        tried.push(net);
        for net in tried {
            let folded = folded_cells(&net).len() as f64 / (net.points.len() as f64);
            let score = unevenness(&net) + FOLD_COST * folded;
            if best.as_ref().is_none_or(|(b, _)| score < *b) {
                best = Some((score, net));
            }
        }
        if best.as_ref().is_some_and(|(score, _)| *score < GOOD_SCORE) {
            break;
        }
    }
    Ok(best.map_or_else(|| Net::regular(chart, cols, rows), |(_, net)| net))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DVec3;
    use crate::grid::chart::tests::chart;
    use crate::grid::net::turns_over;

    #[test]
    fn every_cell_of_a_grid_over_a_steep_bump_is_convex_in_the_chart() {
        let bump = |s: f64, t: f64| (-30.0 * ((s - 0.6).powi(2) + (t - 0.45).powi(2))).exp();
        let chart = chart(|s, t| DVec3::new(s, t, 1.5 * bump(s, t)));
        for (cols, rows) in [(9, 9), (40, 71), (130, 100)] {
            let spots = relax(&chart, cols, rows, &GridParams::default(), 1e-3, &crate::Silent).expect("a grid");
            let uv: Vec<_> = spots.iter().map(|&s| chart.uv_of(s)).collect();
            let turned = (0..(cols - 1) * (rows - 1)).filter(|&c| turns_over(&uv, cols, c)).count();
            assert_eq!(turned, 0, "{cols} x {rows}");
        }
    }
}
