//! Curve points slid along their feature curves, so that iso-curves cross them without a bend.
//!
//! [K98] §5.11.3, eq. 5.15 to 5.17: a curve point moves along its curve under the part of the fairness of the curve
//! of the other family that crosses there, and under the arc length of its own.
//!
//! Departs from [K98]: points do not slide while the grid relaxes, and the weights of eq. 5.17 are constants. The
//! sub-patches are relaxed twice at a fixed small size; the shift of every point towards the straight way between the
//! nodes a few cells off on both sides gives a map of even shares to slid ones, one for every section, in which
//! fairness and even spacing are balanced. The map does not depend on the numbers of cells, so a section can be
//! refined alone. As sub-patches are relaxed one by one, there is no common relaxation along which weights could
//! change.

use crate::geom::{is_positive, polyline};
use crate::grid::side::{Stops, stop_share, turned};
use crate::grid::{Grid, GridError, GridParams, SideStops, relax_at, rim_node};
use crate::mesh::TriMesh;
use crate::network::PatchMesh;
use crate::observe::{Observer, Part};
use glam::DVec3;

/// Cells of the sub-patches in both directions from which slides are read.
const SUB_PATCH_CELLS: usize = 16;
/// A point is to lie on the straight way between the nodes this many cells off on both sides.
const STRAIGHT_CELLS: usize = 4;
/// Rounds of relaxing and sliding: the nodes off the curve follow its points.
const SLIDE_ROUNDS: usize = 2;
/// Weight of even spacing against fairness.
const EVEN_WEIGHT: f64 = 0.5;
/// Neighbours on a curve keep at least this share of their even distance.
const LEAST_GAP: f64 = 0.4;

/// A map of even shares of a section of a curve to the shares where its points lie.
#[derive(Clone, Debug)]
pub(crate) struct Slide {
    /// At even shares, 0 to 1.
    at: Vec<f64>,
    /// True for a side that runs against the curve.
    against: bool,
}

impl Slide {
    /// A stop for every inner node of the side with `count` cells.
    pub fn stops(&self, count: usize) -> Stops {
        let with: Stops = (1..count).map(|k| (stop_share(self.share(k as f64 / count as f64)), k)).collect();
        if self.against { turned(&with, count + 1) } else { with }
    }

    /// Share of a point that lies at `even` without sliding.
    fn share(&self, even: f64) -> f64 {
        let x = even * (self.at.len() - 1) as f64;
        let k = (x as usize).min(self.at.len() - 2);
        self.at[k] + (self.at[k + 1] - self.at[k]) * (x - k as f64)
    }
}

/// For every sub-patch and side the slide of the feature curve there, nothing at the boundary of the patch.
/// * `sub` - the sub-patches between the curves, `nu` of them in a row
/// # Errors
/// As [`crate::grid::relax`].
pub(crate) fn read(
    ground: &TriMesh,
    sub: &[PatchMesh],
    nu: usize,
    params: &GridParams,
    observer: &dyn Observer,
) -> Result<Vec<[Option<Slide>; 4]>, GridError> {
    // Detail counts nothing here.
    let params = GridParams { miss: f64::INFINITY, ..params.clone() };
    let sizes = vec![(SUB_PATCH_CELLS + 1, SUB_PATCH_CELLS + 1); sub.len()];
    let sides = |p: usize| {
        // Side 1 runs with the v curve and side 3 beyond against it; side 0 above the u curve with it, side 2 below against.
        let across = (!(p + 1).is_multiple_of(nu)).then_some([(p, 1), (p + 1, 3)]);
        let along = (p + nu < sub.len()).then_some([(p + nu, 0), (p, 2)]);
        across.into_iter().chain(along)
    };
    let pairs: Vec<[(usize, usize); 2]> = (0..sub.len()).flat_map(sides).collect();
    let mut out: Vec<[Option<Slide>; 4]> = vec![[None, None, None, None]; sub.len()];
    for &[(p, with), (q, against)] in &pairs {
        let at: Vec<f64> = (0..=SUB_PATCH_CELLS).map(|k| k as f64 / SUB_PATCH_CELLS as f64).collect();
        out[p][with] = Some(Slide { at: at.clone(), against: false });
        out[q][against] = Some(Slide { at, against: true });
    }
    for round in 0..SLIDE_ROUNDS {
        let stops: Vec<SideStops> = out
            .iter()
            .map(|s| s.each_ref().map(|s| s.as_ref().map_or_else(Stops::new, |s| s.stops(SUB_PATCH_CELLS))))
            .collect();
        let part = Part::new(observer, round as f64 / SLIDE_ROUNDS as f64, 1.0 / SLIDE_ROUNDS as f64);
        let grids = relax_at(ground, sub, &sizes, &stops, &params, &part)?;
        for &[(p, with), (q, against)] in &pairs {
            let before = out[p][with].take().map_or_else(Vec::new, |s| s.at);
            let at = slid(&before, (&sub[p], with, &grids[p]), (against, &grids[q]));
            out[p][with] = Some(Slide { at: at.clone(), against: false });
            out[q][against] = Some(Slide { at, against: true });
        }
    }
    Ok(out)
}

/// Shares of the points of the side that two sub-patches share, from those `before`: side `k` of `patch`, and a side of
/// `other` against it.
fn slid(before: &[f64], (patch, k, grid): (&PatchMesh, usize, &Grid), other: (usize, &Grid)) -> Vec<f64> {
    let length = polyline::length(patch.sides[k].iter().map(|&v| patch.mesh.points[v as usize]));
    let point = |n: usize| grid.points[rim_node(k, n, grid.cols, grid.rows)];
    if !is_positive(length) {
        return balanced(before);
    }
    let mut wanted = before.to_vec();
    for (n, wanted) in (1..).zip(&mut wanted[1..SUB_PATCH_CELLS]) {
        let (a, p) = (inward(grid, k, n), point(n));
        let b = inward(other.1, other.0, SUB_PATCH_CELLS - n);
        let (near, far) = (a.distance(p), b.distance(p));
        if near + far > 0.0 {
            let between = a.lerp(b, near / (near + far));
            let along = (point(n + 1) - point(n - 1)).normalize_or_zero();
            *wanted += (between - p).dot(along) / length;
        }
    }
    balanced(&wanted)
}

/// The node [`STRAIGHT_CELLS`] cells in from the `n`-th point of side `k`.
fn inward(grid: &Grid, k: usize, n: usize) -> DVec3 {
    let step: isize = match k {
        0 => grid.cols as isize,
        1 => -1,
        2 => -(grid.cols as isize),
        _ => 1,
    };
    let rim = rim_node(k, n, grid.cols, grid.rows) as isize;
    grid.points[(rim + step * STRAIGHT_CELLS as isize) as usize]
}

/// Shares near the wanted ones and evenly spaced: the least of `sum (t - wanted)² + EVEN_WEIGHT sum (gap - even gap)²`, drawn
/// back to even where gaps would get too small.
fn balanced(wanted: &[f64]) -> Vec<f64> {
    let cells = wanted.len() - 1;
    let even = 1.0 / cells as f64;
    // A tridiagonal system with 1 + 2 EVEN_WEIGHT on the diagonal and -EVEN_WEIGHT beside it.
    let diagonal = 1.0 + 2.0 * EVEN_WEIGHT;
    let (mut upper, mut rhs) = (vec![0.0; cells + 1], vec![0.0; cells + 1]);
    for k in 1..cells {
        let before = if k > 1 { -EVEN_WEIGHT } else { 0.0 };
        let own = wanted[k] + if k + 1 == cells { EVEN_WEIGHT } else { 0.0 };
        let pivot = diagonal - before * upper[k - 1];
        upper[k] = -EVEN_WEIGHT / pivot;
        rhs[k] = (own - before * rhs[k - 1]) / pivot;
    }
    let mut at = vec![0.0; cells + 1];
    at[cells] = 1.0;
    for k in (1..cells).rev() {
        at[k] = rhs[k] - if k + 1 < cells { upper[k] * at[k + 1] } else { 0.0 };
    }
    let least = at.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
    let share = if least < LEAST_GAP * even { (1.0 - LEAST_GAP) * even / (even - least) } else { 1.0 };
    (0..=cells).map(|k| k as f64 * even + share * (at[k] - k as f64 * even)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_that_are_wanted_evenly_stay_to_1e_12_and_gaps_keep_two_fifths() {
        let even: Vec<f64> = (0..=SUB_PATCH_CELLS).map(|k| k as f64 / SUB_PATCH_CELLS as f64).collect();
        for (a, b) in balanced(&even).iter().zip(&even) {
            assert!((a - b).abs() < 1e-12);
        }
        let crowded: Vec<f64> = even.iter().map(|s| s.powi(6)).collect();
        let at = balanced(&crowded);
        let gaps: Vec<f64> = at.windows(2).map(|w| w[1] - w[0]).collect();
        assert!(gaps.iter().all(|g| *g > 0.399 / SUB_PATCH_CELLS as f64), "{gaps:?}");
        assert!((at[0], at[SUB_PATCH_CELLS]) == (0.0, 1.0) && at[SUB_PATCH_CELLS / 2] < 0.45);
    }

    #[test]
    fn the_balance_solves_its_equations_within_1e_12() {
        let wanted: Vec<f64> =
            (0..=SUB_PATCH_CELLS).map(|k| k as f64 / SUB_PATCH_CELLS as f64 + 0.01 * (k as f64).sin()).collect();
        let mut wanted = wanted;
        (wanted[0], wanted[SUB_PATCH_CELLS]) = (0.0, 1.0);
        let at = balanced(&wanted);
        for k in 1..SUB_PATCH_CELLS {
            let residual = at[k] - wanted[k] + EVEN_WEIGHT * (2.0 * at[k] - at[k - 1] - at[k + 1]);
            assert!(residual.abs() < 1e-12, "{k} {residual}");
        }
    }
}
