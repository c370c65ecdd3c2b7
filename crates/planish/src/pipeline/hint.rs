//! What warnings say of places, and the steps that they give to paste.

use crate::grid::Grid;
use glam::DVec3;

/// The step of a script that draws an iso-curve through the middle of a grid.
pub(super) fn across(grid: &Grid) -> String {
    let pick = |row: usize| in_script(grid.points[row * grid.cols + grid.cols / 2]);
    let picks = [0, grid.rows / 2, grid.rows - 1].map(pick).join(", ");
    format!("[[step]]\nedit = \"feature\"\nmode = \"geodesic\"\npicks = [{picks}]")
}

/// A coordinate as a script has it: what is left out is far below what moves a curve.
pub(super) fn in_script(p: DVec3) -> String {
    let [x, y, z] = p.to_array().map(|x| (x * 1e6).round() / 1e6);
    format!("[{x}, {y}, {z}]")
}

/// The step of a script that lets the curve near a place come to rest.
pub(super) fn relax_near(at: DVec3) -> String {
    format!("[[step]]\nedit = \"relax\"\ncurve = {{ near = {} }}", in_script(at))
}

/// The first few of a list, in words.
pub(super) fn few(names: &[String]) -> String {
    const MOST_NAMES: usize = 8;
    let head = names[..names.len().min(MOST_NAMES)].join(", ");
    if names.len() > MOST_NAMES { format!("{head} and {} more", names.len() - MOST_NAMES) } else { head }
}
