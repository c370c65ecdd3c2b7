//! Cells that turn over against the surface: finding them and opening them again.
//!
//! A cell is folded if one of its corner triangles points against the mean normal of the cells around it and against
//! the mean normal of the surface at its corners. Rough relief tilts single cells against their neighbours, and the
//! cells around the tip of a limb point in all directions; only a fold turns a corner over against both. The corner
//! of a cell at a corner of the patch is left out, for its angle is that of the patch's curves, be it 180 degrees.
//!
//! Garanzha, Kaporin, Kudryavtseva, Protais, Ray, Sokolov, *Foldover-free maps in 50 lines of code*, 2021, is the energy.
//! See `docs/methods/grids.md`, step 7.

use super::settle::LARGEST_MOVE;
use super::{Net, cell_corners, turns_over};
use crate::grid::Fault;
use crate::grid::chart::locate::Spot;
use crate::observe::Observer;
use glam::{DMat2, DVec2, DVec3};

/// Cells to each side over which the normal is averaged.
const NORMAL_CELLS: usize = 2;
/// Folded cells, per point of the net, up to which they are opened one by one, and the part of those of a round
/// that may be left for another, which a handful is worth in any case.
const FEW_FOLDS: f64 = 0.2;
const WORTHWHILE_LEFT: f64 = 0.75;
const HANDFUL: usize = 8;
/// Rounds of opening folds, each with a ring of cells more than the one before, and sweeps over the points in each.
const OPENING_ROUNDS: usize = 8;
const RINGS: usize = 2;
const OPENING_SWEEPS: usize = 24;
/// Parts of a step that are tried, and the length in cells below which points rest.
const TRIED_PARTS: [f64; 5] = [1.0, 0.5, 0.25, 0.12, 0.06];
const STILL: f64 = 0.03;
/// Least area, in cells, that a corner is taken to have, and the part of the worst folded one's that it has besides.
const LEAST_AREA: f64 = 1e-3;
const FOLDED_SHARE: f64 = 0.2;
/// Least curvature of the energy that a step counts on, against the greatest; chosen: steps along flat
/// directions stay finite.
const LEAST_CURVATURE: f64 = 1e-3;

/// Grid points with the normal of the surface at each.
pub struct Sheet<'a> {
    pub points: &'a [DVec3],
    pub normal: &'a dyn Fn(usize) -> DVec3,
    pub cols: usize,
    pub rows: usize,
}

impl Sheet<'_> {
    /// Mean normals around cell `c`: of the cells, and of the surface at its corners.
    fn normals(&self, c: usize) -> [DVec3; 2] {
        let sum = self.around(c).map(|q| (q[2] - q[0]).cross(q[3] - q[1])).sum::<DVec3>();
        let own = cell_corners(self.cols, c).into_iter().map(|k| (self.normal)(k)).sum::<DVec3>();
        [sum.normalize_or_zero(), own.normalize_or_zero()]
    }

    /// Corners of the cells around cell `c`, itself among them.
    fn around(&self, c: usize) -> impl Iterator<Item = [DVec3; 4]> {
        let (m, n) = (self.cols - 1, self.rows - 1);
        let (i, j) = (c % m, c / m);
        let lines = j.saturating_sub(NORMAL_CELLS)..(j + NORMAL_CELLS + 1).min(n);
        lines.flat_map(move |y| {
            let places = i.saturating_sub(NORMAL_CELLS)..(i + NORMAL_CELLS + 1).min(m);
            places.map(move |x| cell_corners(self.cols, y * m + x).map(|k| self.points[k]))
        })
    }

    /// Least sine of the corners of cell `c`, each seen along the better of `normals`: negative if the cell is folded.
    fn least_sine(&self, c: usize, normals: [DVec3; 2]) -> f64 {
        let ends = ends(self.cols, self.rows);
        let k = cell_corners(self.cols, c);
        let sine = |n: usize| {
            let p = self.points[k[n]];
            let (e, f) = (self.points[k[(n + 1) % 4]] - p, self.points[k[(n + 3) % 4]] - p);
            let lengths = e.length() * f.length();
            let cross = e.cross(f);
            if lengths > 0.0 { cross.dot(normals[0]).max(cross.dot(normals[1])) / lengths } else { 0.0 }
        };
        (0..4).filter(|&n| k[n] != ends[n]).map(sine).fold(1.0, f64::min)
    }

    /// Indices of the folded cells.
    pub fn folded_cells(&self) -> Vec<usize> {
        let cells = 0..(self.cols - 1) * (self.rows - 1);
        cells.filter(|&c| self.least_sine(c, self.normals(c)) < 0.0).collect()
    }
}

/// Indices of the points at the corners of the patch.
fn ends(cols: usize, rows: usize) -> [usize; 4] {
    [0, cols - 1, rows * cols - 1, (rows - 1) * cols]
}

/// Indices of the folded cells of a net.
pub fn folded_cells(net: &Net) -> Vec<usize> {
    sheet(net, &|k| net.chart.normal(net.spots[k])).folded_cells()
}

fn sheet<'a>(net: &'a Net, normal: &'a dyn Fn(usize) -> DVec3) -> Sheet<'a> {
    Sheet { points: &net.points, normal, cols: net.cols, rows: net.rows }
}

/// Indices of the four cells around inner point `k`.
fn cells_around(cols: usize, k: usize) -> [usize; 4] {
    let first = (k / cols - 1) * (cols - 1) + k % cols - 1;
    [first, first + 1, first + cols - 1, first + cols]
}

/// Opens folded cells: lets the points around them move to where the cells keep their shape, as far as they do not turn
/// over. `strictly`: nor turn over in the square, as nets that are made finer must not; a last net need not heed
/// that where the chart bends what is straight. True if there is none left for certain.
///
/// Source: Garanzha, Kaporin, Kudryavtseva, Protais, Ray and Sokolov 2021: the squares of the edges over twice the
/// area, where an area that is not positive is taken for a small one; the smaller, the less is folded.
pub fn open_folds(net: &mut Net, strictly: bool, observer: &dyn Observer) -> Result<bool, Fault> {
    let mut before = (net.points.len() as f64 * FEW_FOLDS) as usize;
    for round in 0..OPENING_ROUNDS {
        let folded = folded_cells(net);
        if folded.is_empty() {
            return Ok(true);
        }
        if folded.len() > before {
            break;
        }
        before = before.min((folded.len() as f64 * WORTHWHILE_LEFT) as usize).max(HANDFUL);
        let region = Region::new(net, &folded, RINGS + round);
        for _ in 0..OPENING_SWEEPS {
            observer.check()?;
            if region.sweep(net, strictly) < STILL || region.is_open(net) {
                break;
            }
        }
    }
    Ok(false)
}

/// The points around folded cells, and how their cells are to be.
struct Region {
    nodes: Vec<usize>,
    /// For each cell of the net the normal that it is seen along, if it is around a node.
    normals: Vec<DVec3>,
    /// Mean lengths of the edges along u and v: a cell is to have these.
    size: [f64; 2],
    /// What an area that is not positive is taken for, over that of such a cell.
    least: f64,
}

impl Region {
    fn new(net: &Net, folded: &[usize], ring: usize) -> Region {
        let (cols, rows) = (net.cols, net.rows);
        let mut nodes: Vec<usize> = folded
            .iter()
            .flat_map(|&c| {
                let k = cell_corners(cols, c)[0];
                let (i, j) = (k % cols, k / cols);
                let lines = j.saturating_sub(ring)..(j + 2 + ring).min(rows);
                lines.flat_map(move |y| (i.saturating_sub(ring)..(i + 2 + ring).min(cols)).map(move |x| y * cols + x))
            })
            .filter(|&k| net.is_inner(k))
            .collect();
        nodes.sort_unstable();
        nodes.dedup();
        let normal = |k: usize| net.chart.normal(net.spots[k]);
        let sheet = sheet(net, &normal);
        let better = |c: usize| {
            let [around, own] = sheet.normals(c);
            let flat = sheet.least_sine(c, [around; 2]) >= sheet.least_sine(c, [own; 2]);
            if flat { around } else { own }
        };
        let mut cells: Vec<usize> = nodes.iter().flat_map(|&k| cells_around(cols, k)).collect();
        cells.sort_unstable();
        cells.dedup();
        let mut normals = vec![DVec3::ZERO; (cols - 1) * (rows - 1)];
        cells.iter().for_each(|&c| normals[c] = better(c));
        let mean = |stride: usize| {
            let lengths = nodes.iter().map(|&k| net.points[k].distance(net.points[k + stride]));
            (lengths.sum::<f64>() / nodes.len() as f64).max(f64::MIN_POSITIVE)
        };
        let mut region = Region { size: [mean(1), mean(cols)], nodes, normals, least: 0.0 };
        let corners = cells.iter().flat_map(|&c| (0..4).map(move |k| (c, k)));
        let worst = corners.filter_map(|(c, k)| region.corner(net, c, k)).map(|x| x.1).fold(0.0, f64::min);
        region.least = LEAST_AREA.hypot(worst * FOLDED_SHARE);
        region
    }

    /// Sum of the squares of both edges of corner `k` of cell `c`, and twice its area, in units of the
    /// wanted; nothing at a corner of the patch.
    fn corner(&self, net: &Net, c: usize, k: usize) -> Option<(f64, f64)> {
        let (e, f, [a, b]) = self.edges(net, c, k)?;
        Some((e.length_squared() / (a * a) + f.length_squared() / (b * b), e.cross(f).dot(self.normals[c]) / (a * b)))
    }

    /// Both edges of a corner and how long they are to be; nothing at a corner of the patch.
    fn edges(&self, net: &Net, c: usize, k: usize) -> Option<(DVec3, DVec3, [f64; 2])> {
        let q = cell_corners(net.cols, c);
        if ends(net.cols, net.rows).contains(&q[k]) {
            return None;
        }
        let at = |n: usize| net.points[q[n % 4]];
        Some((at(k + 1) - at(k), at(k + 3) - at(k), [self.size[k % 2], self.size[(k + 1) % 2]]))
    }

    /// The corners that the place of inner point `k` decides: cell, corner, and how many corners on from there the point is.
    fn corners(cols: usize, k: usize) -> impl Iterator<Item = (usize, usize, usize)> {
        // Corner of each of the cells at `k`; the one across does not see it.
        let own = cells_around(cols, k).into_iter().zip([2, 3, 1, 0]);
        own.flat_map(|(c, own)| [0, 1, 3].map(|on| (c, (own + 4 - on) % 4, on)))
    }

    /// Energy of the corners that the place of inner point `k` decides.
    fn energy(&self, net: &Net, k: usize) -> f64 {
        let of = |(c, corner, _)| {
            let (squares, area) = self.corner(net, c, corner)?;
            Some(squares / (area + area.hypot(self.least)))
        };
        Self::corners(net.cols, k).filter_map(of).sum()
    }

    /// Gradient and Hessian of that energy by moves of the point along two unit vectors. The squares are quadratic in its
    /// place, and the area of a corner is affine.
    fn slopes(&self, net: &Net, k: usize, along: [DVec3; 2]) -> (DVec2, DMat2) {
        let (mut gradient, mut hessian) = (DVec2::ZERO, DMat2::ZERO);
        let outer = |x: DVec2, y: DVec2| DMat2::from_cols(x * y.x, x * y.y);
        for (c, corner, on) in Self::corners(net.cols, k) {
            let Some((e, f, [a, b])) = self.edges(net, c, corner) else { continue };
            let normal = self.normals[c] / (a * b);
            let (e_part, f_part) = (2.0 / (a * a), 2.0 / (b * b));
            let (by_squares, bend, by_area) = match on {
                0 => (-e * e_part - f * f_part, e_part + f_part, (e - f).cross(normal)),
                1 => (e * e_part, e_part, f.cross(normal)),
                _ => (f * f_part, f_part, normal.cross(e)),
            };
            let flat = |v: DVec3| DVec2::new(v.dot(along[0]), v.dot(along[1]));
            let (by_squares, by_area) = (flat(by_squares), flat(by_area));
            let squares = (e.length_squared() * e_part + f.length_squared() * f_part) / 2.0;
            let area = e.cross(f).dot(normal);
            let root = area.hypot(self.least);
            // g = area + root, its first derivative and its second, both over g.
            let g = area + root;
            let first = by_area / root;
            let second = outer(by_area, by_area) * (self.least * self.least / (root * root * root * g));
            gradient += (by_squares - first * squares) / g;
            let mixed = outer(by_squares, first) + outer(first, by_squares);
            let own = outer(first, first) * 2.0 - second;
            hessian += (DMat2::from_diagonal(DVec2::splat(bend)) - mixed + own * squares) * (1.0 / g);
        }
        (gradient, hessian)
    }

    /// True if no corner of a cell around a node is turned over.
    fn is_open(&self, net: &Net) -> bool {
        let is_over = |(c, corner, _)| self.corner(net, c, corner).is_some_and(|(_, area)| area <= 0.0);
        !self.nodes.iter().any(|&k| Self::corners(net.cols, k).any(is_over))
    }

    /// Moves every node once, by a step of Newton or a part of it; returns the longest move, in cells.
    fn sweep(&self, net: &mut Net, strictly: bool) -> f64 {
        let length = (self.size[0] * self.size[1]).sqrt();
        let mut longest = 0.0f64;
        for &k in &self.nodes {
            let before = self.energy(net, k);
            let spot = net.spots[k];
            let (s, t) = net.chart.normal(spot).any_orthonormal_pair();
            let (gradient, hessian) = self.slopes(net, k, [s, t]);
            let step = downhill(gradient, hessian).clamp_length_max(LARGEST_MOVE * length);
            for part in TRIED_PARTS {
                place(net, k, net.chart.advance(spot, (s * step.x + t * step.y) * part));
                if self.energy(net, k) < before && !(strictly && turns_around(net, k)) {
                    longest = longest.max(part * step.length() / length);
                    break;
                }
                place(net, k, spot);
            }
        }
        longest
    }
}

/// The step of Newton towards lower energy, where it bends upwards and where it does not: by the amounts of the eigenvalues.
fn downhill(gradient: DVec2, hessian: DMat2) -> DVec2 {
    let [a, b, c] = [hessian.x_axis.x, hessian.x_axis.y, hessian.y_axis.y];
    let (mean, spread) = ((a + c) / 2.0, ((a - c) / 2.0).hypot(b));
    let first = DVec2::from_angle((2.0 * b).atan2(a - c) / 2.0);
    let values = [mean + spread, mean - spread].map(f64::abs);
    let least = LEAST_CURVATURE * values[0].max(values[1]);
    let step = |v: DVec2, value: f64| v * -v.dot(gradient) / value.max(least).max(f64::MIN_POSITIVE);
    step(first, values[0]) + step(first.perp(), values[1])
}

/// Least sine of the corners of the four cells around inner point `k`.
pub fn worst_corner(net: &Net, k: usize) -> f64 {
    let normal = |k: usize| net.chart.normal(net.spots[k]);
    let sheet = sheet(net, &normal);
    let cells = cells_around(net.cols, k).into_iter();
    cells.map(|c| sheet.least_sine(c, sheet.normals(c))).fold(f64::INFINITY, f64::min)
}

/// Moves inner point `k` to `spot`, and returns where it was.
pub fn place(net: &mut Net, k: usize, spot: Spot) -> Spot {
    let before = net.spots[k];
    (net.spots[k], net.uv[k], net.points[k]) = (spot, net.chart.uv_of(spot), net.chart.position(spot));
    before
}

/// True if one of the four cells around inner point `k` is not convex in the square.
pub fn turns_around(net: &Net, k: usize) -> bool {
    cells_around(net.cols, k).into_iter().any(|c| turns_over(&net.uv, net.cols, c))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::chart::Chart;
    use crate::grid::chart::tests::chart;

    /// A net of 7 x 7 points whose middle one lies beyond its neighbour.
    fn folded(chart: &Chart) -> Net<'_> {
        let mut net = Net::regular(chart, 7, 7);
        let from = net.spots[24];
        place(&mut net, 24, chart.locate(DVec2::new(0.74, 0.55), from.triangle));
        net
    }

    #[test]
    fn slopes_of_the_energy_are_its_differences_within_1e_6_and_a_pulled_point_comes_back() {
        let chart = chart(|s, t| DVec3::new(s, t, 0.2 * s * t));
        let mut net = folded(&chart);
        let cells = folded_cells(&net);
        assert!(!cells.is_empty());
        let region = Region::new(&net, &cells, RINGS);
        for k in [16, 24, 25] {
            let (s, t) = net.chart.normal(net.spots[k]).any_orthonormal_pair();
            let start = net.points[k];
            let (gradient, hessian) = region.slopes(&net, k, [s, t]);
            let step = 1e-5;
            let mut slopes_at = |move_by: DVec3| {
                net.points[k] = start + move_by;
                let found = (region.energy(&net, k), region.slopes(&net, k, [s, t]).0);
                net.points[k] = start;
                found
            };
            for (i, axis) in [s, t].into_iter().enumerate() {
                let [(less, before), (more, after)] = [-step, step].map(|h| slopes_at(axis * h));
                let scale = hessian.x_axis.length().max(1.0);
                assert!((gradient[i] - (more - less) / (2.0 * step)).abs() < 1e-6 * scale, "gradient {k}");
                assert!((hessian.col(i) - (after - before) / (2.0 * step)).length() < 1e-6 * scale, "Hessian {k}");
            }
        }
        assert!(open_folds(&mut net, false, &crate::Silent).expect("not cancelled"));
        assert!(folded_cells(&net).is_empty());
    }
}
