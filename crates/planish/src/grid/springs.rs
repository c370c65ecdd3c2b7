//! The grid of one patch, moved over its chart until it is even.

use super::chart::Chart;
use super::locate::Spot;
use super::{Fault, GridParams};
use glam::DVec2;

/// The spots of `cols x rows` grid points in `chart`, row-major.
pub fn relax(
    chart: &Chart,
    cols: usize,
    rows: usize,
    _params: &GridParams,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Spot>, Fault> {
    let mut spots: Vec<Spot> = Vec::with_capacity(cols * rows);
    for j in 0..rows {
        if cancelled() {
            return Err(Fault::Cancelled);
        }
        for i in 0..cols {
            let uv = DVec2::new(i as f64 / (cols - 1) as f64, j as f64 / (rows - 1) as f64);
            let hint = match (i, j) {
                (0, 0) => 0,
                (0, _) => spots[(j - 1) * cols].triangle,
                _ => spots[j * cols + i - 1].triangle,
            };
            spots.push(chart.locate(uv, hint));
        }
    }
    Ok(spots)
}
