//! Penalised least squares: a grid of points to a clamped uniform bicubic B-spline, with a weight on its bends.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §4.3.2 eq. 4.4 and §6.2: with nodes at
//! uniform parameters, `P = B_u X B_v^T` separates into curve fits. The grid is read once, to form
//! `B_u^T P B_v`; everything after that has the size of the control net.
//!
//! Departs from [K98]: the outer rings of control points can be given (exact seams), then the others are the
//! solution for those; and a term for the bends of the control net can be added to the distances of the nodes, as in
//! P-splines (Eilers, Marx 1996, *Flexible Smoothing with B-splines and Penalties*), which [K98] §4.2.1 argues against.
//! [`super::FitParams::smoothing`] says why it is there.

use super::basis::{BasisRows, Knots, uniform_parameters};
use super::{FitError, Surface};
use crate::linalg::{Banded, BandedCholesky};
use glam::DVec3;
use std::collections::BTreeMap;

/// Fewest control points along one direction: one cubic span.
pub const FEWEST_CONTROL: usize = 4;

/// Points per block of a row that are summed up together: four rows of data and four of sums stay in the
/// first-level cache.
const POINTS_PER_BLOCK: usize = 128;

/// Fits a clamped uniform bicubic B-spline to a grid of points.
///
/// * `points` - `rows * cols` of them, row-major, world units; node `(i, j)` has the parameters `(i / (cols - 1), j /
///   (rows - 1))`
/// * `control` - control points along `v` and along `u`: `[rows, cols]`, each `4..=` the grid's count
///
/// # Errors
/// [`FitError::TooFewPoints`] if a direction has fewer points than control points,
/// [`FitError::TooFewControl`] below four, [`FitError::Shape`] if the number of points is not `rows * cols`.
///
/// Source: [K98] §4.3.2, eq. 4.4.
pub fn fit(points: &[DVec3], rows: usize, cols: usize, control: [usize; 2]) -> Result<Surface, FitError> {
    if points.len() != rows * cols {
        return Err(FitError::Shape { patch: 0, rows, cols, points: points.len() });
    }
    let (along_v, along_u) = (uniform(rows, control[0])?, uniform(cols, control[1])?);
    let projection = project(points, &along_u, &along_v);
    let mut net = vec![DVec3::ZERO; control[0] * control[1]];
    solve_inside(&mut net, &projection, &along_u, &along_v, 0);
    Ok(surface_of(net, &along_u, &along_v))
}

fn uniform(count: usize, control: usize) -> Result<Direction, FitError> {
    if control < FEWEST_CONTROL {
        return Err(FitError::TooFewControl { control });
    }
    Direction::new(count, &Knots::uniform(control), 0.0)
}

/// What a fit of `count` nodes by `control` control points needs in one direction.
#[derive(Clone, Debug)]
pub(crate) struct Direction {
    pub knots: Knots,
    pub basis: BasisRows,
    /// Normal matrix `B^T B`.
    gram: Banded,
    /// Its factors without the outer 0, 1 or 2 control points on either side.
    factors: [BandedCholesky; 3],
}

impl Direction {
    /// * `smoothing` - weight of the bends of the control polygon against the distances of the nodes that fall on one
    ///   control point: 0 for plain least squares; large values leave straight lines, and of a surface with given
    ///   boundary the bilinear blend of that boundary
    pub fn new(count: usize, knots: &Knots, smoothing: f64) -> Result<Direction, FitError> {
        let control = knots.control();
        if count < control {
            return Err(FitError::TooFewPoints { points: count, control });
        }
        let basis = BasisRows::new(knots.list(), &uniform_parameters(count), 0);
        let mut gram = Banded::zero(control, 3);
        for (&first, w) in basis.first.iter().zip(&basis.weights) {
            for a in 0..4 {
                for b in 0..=a {
                    gram.add(first + a, first + b, w[a] * w[b]);
                }
            }
        }
        add_bends(&mut gram, knots, smoothing * (count - 1) as f64);
        let factor = |inset: usize| {
            BandedCholesky::factor(gram.part(inset..control - inset))
                .ok_or(FitError::Singular { points: count, control })
        };
        let factors = [factor(0)?, factor(1)?, factor(2)?];
        Ok(Direction { knots: knots.clone(), basis, gram, factors })
    }

    pub fn control(&self) -> usize {
        self.gram.len()
    }

    /// The same with a weight of bends.
    pub fn smoothed(&self, smoothing: f64) -> Result<Direction, FitError> {
        Direction::new(self.basis.len(), &self.knots, smoothing)
    }

    /// Entry of the normal matrix.
    pub fn gram(&self, i: usize, j: usize) -> f64 {
        self.gram.get(i, j)
    }

    /// The columns in which row `i` of the normal matrix may be non-zero.
    pub fn near(&self, i: usize) -> std::ops::Range<usize> {
        self.gram.columns(i)
    }

    pub fn factor(&self, inset: usize) -> &BandedCholesky {
        &self.factors[inset]
    }

    /// `B^T x` for one value per node.
    pub fn project(&self, nodes: impl Iterator<Item = DVec3>) -> Vec<DVec3> {
        let mut sums = vec![DVec3::ZERO; self.control()];
        for ((p, &first), w) in nodes.zip(&self.basis.first).zip(&self.basis.weights) {
            for a in 0..4 {
                sums[first + a] += p * w[a];
            }
        }
        sums
    }

    /// Fits a curve to one point per node, keeping the outer `inset` values of `net` on either side.
    pub fn fit_curve(&self, nodes: impl Iterator<Item = DVec3>, net: &mut [DVec3], inset: usize) {
        let n = net.len();
        let mut rhs = self.project(nodes);
        for (i, sum) in (inset..).zip(&mut rhs[inset..n - inset]) {
            for j in self.gram.columns(i).filter(|&j| j < inset || j >= n - inset) {
                *sum -= net[j] * self.gram.get(i, j);
            }
        }
        self.factors[inset].solve(&mut rhs[inset..n - inset]);
        net[inset..n - inset].copy_from_slice(&rhs[inset..n - inset]);
    }

    /// A fitted curve with its ends moved to these places, where there are any, and what is between them fitted again for that.
    pub fn with_ends(&self, mut curve: Vec<DVec3>, ends: [Option<DVec3>; 2]) -> Vec<DVec3> {
        let last = curve.len() - 1;
        let mut moves = vec![DVec3::ZERO; curve.len()];
        for (end, at) in [0, last].into_iter().zip(ends) {
            moves[end] = at.map_or(DVec3::ZERO, |at| at - curve[end]);
        }
        self.fit_curve(std::iter::repeat(DVec3::ZERO), &mut moves, 1);
        curve.iter_mut().zip(moves).for_each(|(point, way)| *point += way);
        // To the bit.
        (curve[0], curve[last]) = (ends[0].unwrap_or(curve[0]), ends[1].unwrap_or(curve[last]));
        curve
    }
}

/// Adds `weight` per unit of the parameter times the squared second differences of the control points by their Greville
/// abscissae, in steps of the knots around so that they are `1, -2, 1` inside where these are at equal steps: `B^T B` becomes
/// the matrix of a smoothing spline. Straight lines at constant speed cost nothing.
fn add_bends(gram: &mut Banded, knots: &Knots, weight: f64) {
    if weight == 0.0 {
        return;
    }
    let (n, knots) = (gram.len(), knots.list());
    let place = |i: usize| (knots[i + 1] + knots[i + 2] + knots[i + 3]) / 3.0;
    for i in 1..n - 1 {
        // Mean step of the control points that the function spans.
        let steps = (i.min(3) + (n - 1 - i).min(3) - 2) as f64;
        let step = (knots[i + 4] - knots[i]) / steps;
        let (before, after) = (step / (place(i) - place(i - 1)), step / (place(i + 1) - place(i)));
        let row = [before, -before - after, after];
        for a in 0..3 {
            for b in 0..=a {
                gram.add(i - 1 + a, i - 1 + b, weight * step * row[a] * row[b]);
            }
        }
    }
}

/// Nodes and knots of a direction.
pub(crate) type Layout = (usize, Knots);

/// The directions of a whole network, factored once per layout.
pub(crate) struct Directions(BTreeMap<Layout, Direction>);

impl Directions {
    /// Of these layouts, from both ends.
    pub fn new(layouts: impl Iterator<Item = Layout>) -> Result<Directions, FitError> {
        Directions::smoothed(layouts, 0.0)
    }

    /// The same with a weight of bends.
    pub fn smoothed(layouts: impl Iterator<Item = Layout>, smoothing: f64) -> Result<Directions, FitError> {
        let mut map = BTreeMap::new();
        for (count, knots) in layouts {
            for knots in [knots.reversed(), knots] {
                if !map.contains_key(&(count, knots.clone())) {
                    let direction = Direction::new(count, &knots, smoothing)?;
                    map.insert((count, knots), direction);
                }
            }
        }
        Ok(Directions(map))
    }

    /// The direction of one of the layouts given to `new`.
    pub fn get(&self, count: usize, knots: &Knots) -> &Direction {
        &self.0[&(count, knots.clone())]
    }
}

/// `B_v^T P B_u`: the grid as far as the fit sees it, control net shaped.
pub(crate) fn project(points: &[DVec3], along_u: &Direction, along_v: &Direction) -> Vec<DVec3> {
    let cols = along_u.basis.len();
    let narrow = project_rows(points, cols, &along_v.basis, along_v.control());
    let mut net = Vec::with_capacity(along_u.control() * along_v.control());
    for row in narrow.chunks_exact(cols) {
        net.extend(along_u.project(row.iter().copied()));
    }
    net
}

/// `B^T P`: sums rows of `width` points into one row per control point.
pub(crate) fn project_rows(points: &[DVec3], width: usize, basis: &BasisRows, control: usize) -> Vec<DVec3> {
    let mut out = vec![DVec3::ZERO; control * width];
    let mut j = 0;
    while j < basis.len() {
        let first = basis.first[j];
        let span = basis.first[j..].iter().take_while(|&&f| f == first).count();
        let (r0, rest) = out[first * width..(first + 4) * width].split_at_mut(width);
        let (r1, rest) = rest.split_at_mut(width);
        let (r2, r3) = rest.split_at_mut(width);
        for start in (0..width).step_by(POINTS_PER_BLOCK) {
            let block = start..(start + POINTS_PER_BLOCK).min(width);
            let sums = [&mut r0[block.clone()], &mut r1[block.clone()], &mut r2[block.clone()], &mut r3[block.clone()]];
            sum_block(sums, &points[j * width..(j + span) * width], width, block, &basis.weights[j..j + span]);
        }
        j += span;
    }
    out
}

/// Adds rows of data, each with its four weights, to four rows of sums.
fn sum_block(
    sums: [&mut [DVec3]; 4],
    rows: &[DVec3],
    width: usize,
    block: std::ops::Range<usize>,
    weights: &[[f64; 4]],
) {
    let [s0, s1, s2, s3] = sums;
    let n = block.len();
    let (s0, s1, s2, s3) = (&mut s0[..n], &mut s1[..n], &mut s2[..n], &mut s3[..n]);
    let row = |r: usize| &rows[r * width + block.start..r * width + block.end];
    let mut r = 0;
    while r + 4 <= weights.len() {
        let [a, b, c, d] = [weights[r], weights[r + 1], weights[r + 2], weights[r + 3]];
        let (p, q, x, y) = (&row(r)[..n], &row(r + 1)[..n], &row(r + 2)[..n], &row(r + 3)[..n]);
        for i in 0..n {
            s0[i] += p[i] * a[0] + q[i] * b[0] + x[i] * c[0] + y[i] * d[0];
            s1[i] += p[i] * a[1] + q[i] * b[1] + x[i] * c[1] + y[i] * d[1];
            s2[i] += p[i] * a[2] + q[i] * b[2] + x[i] * c[2] + y[i] * d[2];
            s3[i] += p[i] * a[3] + q[i] * b[3] + x[i] * c[3] + y[i] * d[3];
        }
        r += 4;
    }
    for (r, a) in weights.iter().enumerate().skip(r) {
        let p = &row(r)[..n];
        for i in 0..n {
            s0[i] += p[i] * a[0];
            s1[i] += p[i] * a[1];
            s2[i] += p[i] * a[2];
            s3[i] += p[i] * a[3];
        }
    }
}

/// Solves for the control points that have at least `inset` (0, 1 or 2) rings outside them; those rings of
/// `net` are given and stay.
pub(crate) fn solve_inside(
    net: &mut [DVec3],
    projection: &[DVec3],
    along_u: &Direction,
    along_v: &Direction,
    inset: usize,
) {
    let (m, n) = (along_u.control(), along_v.control());
    let (inner_m, inner_n) = (m - 2 * inset, n - 2 * inset);
    if inner_m == 0 || inner_n == 0 {
        return;
    }
    let inside = |i: usize, j: usize| i >= inset && i < m - inset && j >= inset && j < n - inset;
    let mut rhs = Vec::with_capacity(inner_m * inner_n);
    if inset == 0 {
        rhs.extend_from_slice(projection);
    } else {
        // G_v C G_u of the given rings, rows first.
        let mut half = vec![DVec3::ZERO; m * n];
        for j in 0..n {
            for i in inset..m - inset {
                half[j * m + i] = along_u
                    .gram
                    .columns(i)
                    .filter(|&k| !inside(k, j))
                    .fold(DVec3::ZERO, |sum, k| sum + net[j * m + k] * along_u.gram.get(i, k));
            }
        }
        for j in inset..n - inset {
            for i in inset..m - inset {
                let given =
                    along_v.gram.columns(j).fold(DVec3::ZERO, |sum, k| sum + half[k * m + i] * along_v.gram.get(j, k));
                rhs.push(projection[j * m + i] - given);
            }
        }
    }
    along_v.factor(inset).solve(&mut rhs);
    for (row, j) in rhs.chunks_exact_mut(inner_m).zip(inset..) {
        along_u.factor(inset).solve(row);
        net[j * m + inset..j * m + m - inset].copy_from_slice(row);
    }
}

/// What [`project`] would give for nodes on the surface of this net: a fit to it moves the surface least.
pub(crate) fn project_net(net: &[DVec3], along_u: &Direction, along_v: &Direction) -> Vec<DVec3> {
    let (m, n) = (along_u.control(), along_v.control());
    let times = |gram: &Banded, i: usize, at: &dyn Fn(usize) -> DVec3| -> DVec3 {
        gram.columns(i).fold(DVec3::ZERO, |sum, k| sum + at(k) * gram.get(i, k))
    };
    let mut half = Vec::with_capacity(m * n);
    for j in 0..n {
        half.extend((0..m).map(|i| times(&along_u.gram, i, &|k| net[j * m + k])));
    }
    let mut out = Vec::with_capacity(m * n);
    for j in 0..n {
        out.extend((0..m).map(|i| times(&along_v.gram, j, &|k| half[k * m + i])));
    }
    out
}

/// The surface of a control net.
pub(crate) fn surface_of(control: Vec<DVec3>, along_u: &Direction, along_v: &Direction) -> Surface {
    Surface {
        rows: along_v.control(),
        cols: along_u.control(),
        control,
        knots_u: along_u.knots.list().to_vec(),
        knots_v: along_v.knots.list().to_vec(),
    }
}
