//! The sides of patches in their row-major arrays, be they nodes or control points.
//!
//! Layout of the control net as in [K98] fig. 8.2.

use super::basis::Knots;
use super::{FEWEST_CONTROL, FitError, Surface};
use crate::geom::{Aabb, tolerance};
use crate::grid::Grid;
use crate::network::{Curve, Network};
use glam::DVec3;

/// Index of entry `i` along side `side`, `depth` rows in from it, of a `rows x cols` array; `i` runs in the
/// direction of the side.
pub(crate) fn node(rows: usize, cols: usize, side: usize, i: usize, depth: usize) -> usize {
    let (u, v) = match side {
        0 => (i, depth),
        1 => (cols - 1 - depth, i),
        2 => (cols - 1 - i, rows - 1 - depth),
        _ => (depth, rows - 1 - i),
    };
    v * cols + u
}

/// Entries along a side.
pub(crate) fn side_len(rows: usize, cols: usize, side: usize) -> usize {
    if side.is_multiple_of(2) { cols } else { rows }
}

/// Row `depth` of an array along a side, in the direction of the side's curve.
pub(crate) fn along_curve(
    array: &[DVec3],
    rows: usize,
    cols: usize,
    side: usize,
    reversed: bool,
    depth: usize,
) -> Vec<DVec3> {
    let n = side_len(rows, cols, side);
    (0..n).map(|i| array[node(rows, cols, side, if reversed { n - 1 - i } else { i }, depth)]).collect()
}

/// For each curve the points along it as its first patch has them; empty for a curve without a patch.
pub(crate) fn curve_nodes(network: &Network, uses: &[Vec<(u32, u8)>], grids: &[Grid]) -> Vec<Vec<DVec3>> {
    uses.iter()
        .map(|uses| {
            uses.first().map_or_else(Vec::new, |&(p, k)| {
                let (grid, side) = (&grids[p as usize], network.patches[p as usize].sides[k as usize]);
                along_curve(&grid.points, grid.rows, grid.cols, k as usize, side.reversed, 0)
            })
        })
        .collect()
}

/// Where surfaces have the corners of the network, for each `(patch, corner)` that is wanted.
pub(crate) fn corners_of(
    network: &Network,
    surfaces: &[Surface],
    is_wanted: impl Fn(usize, u32) -> bool,
) -> Vec<Option<DVec3>> {
    let mut corners = vec![None; network.corners.len()];
    for (p, s) in surfaces.iter().enumerate() {
        for k in 0..4 {
            let corner = network.corner(p, k);
            if is_wanted(p, corner) {
                corners[corner as usize] = Some(s.control[node(s.rows, s.cols, k, 0, 0)]);
            }
        }
    }
    corners
}

/// Checks that arrays of one kind (`what`) are one per patch, shaped as they say, and agree in number along
/// every curve. Returns the count along each curve, 0 for a curve without a patch.
pub(crate) fn check(
    network: &Network,
    what: &'static str,
    shapes: &[(usize, usize, usize)],
) -> Result<Vec<usize>, FitError> {
    if shapes.len() != network.patches.len() {
        return Err(FitError::Count { what, found: shapes.len(), wanted: network.patches.len() });
    }
    let mut counts = vec![0; network.curves.len()];
    for (p, (patch, &(rows, cols, points))) in network.patches.iter().zip(shapes).enumerate() {
        if rows < 2 || cols < 2 || points != rows * cols {
            return Err(FitError::Shape { patch: p, rows, cols, points });
        }
        for (k, side) in patch.sides.iter().enumerate() {
            let n = side_len(rows, cols, k);
            match counts.get_mut(side.curve as usize) {
                None => return Err(FitError::NoSuchCurve { patch: p, curve: side.curve }),
                Some(count) if *count == 0 => *count = n,
                Some(&mut first) if first != n => {
                    return Err(FitError::Mismatch { curve: side.curve as usize, first, second: n });
                }
                Some(_) => {}
            }
        }
    }
    Ok(counts)
}

/// Knots of a surface along a side, in the direction of the side's curve.
pub(crate) fn knots_along(network: &Network, surfaces: &[Surface], (patch, side): (u32, u8)) -> Knots {
    let (surface, k) = (&surfaces[patch as usize], side as usize);
    let knots = Knots::of(if k.is_multiple_of(2) { &surface.knots_u } else { &surface.knots_v });
    if (k >= 2) != network.patches[patch as usize].sides[k].reversed { knots.reversed() } else { knots }
}

/// Knots along every curve as the surfaces `which` have them, in the direction of the curve; those of a single span for curves
/// beside none of these.
pub(crate) fn knots(network: &Network, surfaces: &[Surface], which: &[usize]) -> Result<Vec<Knots>, FitError> {
    let mut found = vec![None; network.curves.len()];
    for &patch in which {
        for (k, side) in network.patches[patch].sides.iter().enumerate() {
            let knots = knots_along(network, surfaces, (patch as u32, k as u8));
            let first = found[side.curve as usize].get_or_insert_with(|| knots.clone());
            if *first != knots {
                return Err(FitError::Knots { patch });
            }
        }
    }
    Ok(found.into_iter().map(|knots| knots.unwrap_or_else(|| Knots::uniform(FEWEST_CONTROL))).collect())
}

/// Checks grids as [`check`] does, and that their points are finite and meet along the curves.
pub(crate) fn check_grids(network: &Network, grids: &[Grid]) -> Result<Vec<usize>, FitError> {
    let shapes: Vec<_> = grids.iter().map(|g| (g.rows, g.cols, g.points.len())).collect();
    let counts = check(network, "grids", &shapes)?;
    if let Some(patch) = grids.iter().position(|g| g.points.iter().any(|p| !p.is_finite())) {
        return Err(FitError::NotFinite { patch });
    }
    let uses = network.uses();
    let nodes = curve_nodes(network, &uses, grids);
    let close = tolerance::length(diagonal(grids));
    for (curve, uses) in uses.iter().enumerate() {
        for &(p, k) in uses.iter().skip(1) {
            let (grid, side) = (&grids[p as usize], network.patches[p as usize].sides[k as usize]);
            let other = along_curve(&grid.points, grid.rows, grid.cols, k as usize, side.reversed, 0);
            let gap = nodes[curve].iter().zip(&other).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            if gap > close {
                return Err(FitError::OpenSeam { curve, gap });
            }
        }
    }
    Ok(counts)
}

/// Diagonal of the box around all nodes.
pub(crate) fn diagonal(grids: &[Grid]) -> f64 {
    let boxes: Vec<DVec3> = grids
        .iter()
        .filter(|g| !g.points.is_empty())
        .flat_map(|g| {
            let b = Aabb::of(&g.points);
            [b.min, b.max]
        })
        .collect();
    if boxes.is_empty() { 0.0 } else { Aabb::of(&boxes).diagonal() }
}

/// Parameters on a patch of the place `t` (0 to 1) along `curve`, seen through side `side` of a patch.
pub(crate) fn place(side: usize, reversed: bool, t: f64) -> (f64, f64) {
    let s = if reversed { 1.0 - t } else { t };
    match side {
        0 => (s, 0.0),
        1 => (1.0, s),
        2 => (1.0 - s, 1.0),
        _ => (0.0, 1.0 - s),
    }
}

/// True if the curve is to have the same tangent plane on both sides.
pub(crate) fn is_smooth(curve: &Curve) -> bool {
    curve.kind.is_smooth()
}
