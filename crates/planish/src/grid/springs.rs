//! The grid of one patch: coarse to fine, relaxed at every resolution.
//!
//! [K98] §5.5 and 5.6. The start is the regular grid of the chart; where a part sticks out of the patch the chart
//! holds it in a small spot, so the coarsest grid is first drawn into such parts by [`even`], which measures along
//! the curves and not between their points. Then [`settle`] balances spacing against angles at every resolution.

use super::chart::Chart;
use super::even::{even, unevenness};
use super::locate::Spot;
use super::net::{Net, is_twisted};
use super::settle::settle;
use super::{Fault, GridParams};

/// Cells along the longer direction from which a grid is not made coarser.
const COARSEST: usize = 32;
/// Cells along the shorter direction that coarser grids keep.
const COARSEST_SHORT: usize = 8;
/// Rounds of Gauss-Newton at the coarsest resolution and at those after it.
const FIRST_ROUNDS: usize = 16;
const LATER_ROUNDS: [usize; 3] = [8, 5, 3];

/// Rounds of drawing out that are tried one after the other, and the mean square unevenness of the spacing, a
/// quarter, from which on the first is good enough.
const EVEN_ROUNDS: [usize; 3] = [12, 3, 0];
const GOOD_UNEVENNESS: f64 = 0.0625;
/// Sweeps of smoothing around twisted cells.
const UNTWIST_SWEEPS: usize = 40;

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
    Ok(untwisted(net, cancelled)?.spots)
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
    let mut best: Option<((usize, f64), Net<'a>)> = None;
    for rounds in EVEN_ROUNDS {
        let net = even(Net::regular(chart, cols, rows), rounds, cancelled)?;
        let net = settle(net, FIRST_ROUNDS, params, cancelled)?;
        let score = (net.twists(), unevenness(&net));
        let good = score.0 == 0 && score.1 < GOOD_UNEVENNESS;
        if best.as_ref().is_none_or(|(b, _)| score < *b) {
            best = Some((score, net));
        }
        if good {
            break;
        }
    }
    Ok(best.map_or_else(|| Net::regular(chart, cols, rows), |(_, net)| net))
}

/// Smooths around the cells that are twisted on the surface, as long as their number falls.
fn untwisted<'a>(net: Net<'a>, cancelled: &(dyn Fn() -> bool + Sync)) -> Result<Net<'a>, Fault> {
    let mut best = net.twists();
    let (mut kept, mut net) = (net.clone(), net);
    for sweep in 0..UNTWIST_SWEEPS {
        if best == 0 {
            break;
        }
        if cancelled() {
            return Err(Fault::Cancelled);
        }
        let (cols, rows) = (net.cols, net.rows);
        let mut weak = vec![false; cols * rows];
        let reach = 1 + sweep / 10;
        for c in (0..(cols - 1) * (rows - 1)).filter(|&c| is_twisted(&net.points, cols, c)) {
            let (x, y) = (c % (cols - 1), c / (cols - 1));
            for j in (y + 1).saturating_sub(reach)..(y + 1 + reach).min(rows) {
                for i in (x + 1).saturating_sub(reach)..(x + 1 + reach).min(cols) {
                    weak[j * cols + i] = true;
                }
            }
        }
        net = net.moved(false, &|k, fraction| {
            if !weak[k] {
                return net.spots[k];
            }
            let p = &net.points;
            let mean = (p[k - 1] + p[k + 1] + p[k - cols] + p[k + cols]) / 4.0;
            net.chart.advance(net.spots[k], (mean - p[k]) * (0.7 * fraction))
        });
        let count = net.twists();
        if count < best {
            best = count;
            kept = net.clone();
        }
    }
    Ok(kept)
}
