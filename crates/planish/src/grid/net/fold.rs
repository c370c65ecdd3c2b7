//! Cells that turn over against the surface: finding them and opening them again.
//!
//! A cell is folded if one of its corner triangles points against the mean normal of the cells around it and against
//! the mean normal of the surface at its corners. Rough relief tilts single cells against their neighbours, and the
//! cells around the tip of a limb point in all directions; only a fold turns a corner over against both. The corner
//! of a cell at a corner of the patch is left out, for its angle is that of the patch's curves, be it 180 degrees.
//!
//! Garanzha, Kaporin, Kudryavtseva, Protais, Ray, Sokolov, *Foldover-free maps in 50 lines of code*, 2021, is the energy.
//! See `docs/methods/grids.md`, step 7.

use super::{Net, cell_corners, turns_over};
use crate::grid::Fault;
use crate::grid::chart::locate::Spot;
use crate::observe::Observer;
use glam::DVec3;

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
/// Moves that are tried, in cells; if all points moved by less than the last but one, they rest.
const TRIED_MOVES: [f64; 6] = [0.5, 0.25, 0.12, 0.06, 0.03, 0.01];
const STILL: f64 = 0.03;
/// Least area, in cells, that a corner is taken to have, and the part of the worst folded one's that it has besides.
const LEAST_AREA: f64 = 1e-3;
const FOLDED_SHARE: f64 = 0.2;
/// Step of a finite difference, in cells.
const DIFFERENCE: f64 = 1e-4;

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
            if region.sweep(net, strictly) < STILL {
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
        let q = cell_corners(net.cols, c);
        if ends(net.cols, net.rows).contains(&q[k]) {
            return None;
        }
        let at = |n: usize| net.points[q[n % 4]];
        let (e, f) = (at(k + 1) - at(k), at(k + 3) - at(k));
        let [a, b] = [self.size[k % 2], self.size[(k + 1) % 2]];
        Some((e.length_squared() / (a * a) + f.length_squared() / (b * b), e.cross(f).dot(self.normals[c]) / (a * b)))
    }

    /// Energy of the corners that the place of inner point `k` decides.
    fn energy(&self, net: &Net, k: usize) -> f64 {
        let mut sum = 0.0;
        for (n, c) in cells_around(net.cols, k).into_iter().enumerate() {
            // Corner of the cell at `k`; the one across does not see it.
            let own = [2, 3, 1, 0][n];
            for corner in (0..4).filter(|&x| x != (own + 2) % 4) {
                if let Some((squares, area)) = self.corner(net, c, corner) {
                    sum += squares / (area + (area * area + self.least * self.least).sqrt());
                }
            }
        }
        sum
    }

    /// Moves every node once; returns the longest move, in cells.
    fn sweep(&self, net: &mut Net, strictly: bool) -> f64 {
        let length = (self.size[0] * self.size[1]).sqrt();
        let mut longest = 0.0f64;
        for &k in &self.nodes {
            let before = self.energy(net, k);
            let start = net.points[k];
            let normal = net.chart.normal(net.spots[k]);
            let (s, t) = normal.any_orthonormal_pair();
            let slope = |net: &mut Net, direction: DVec3| {
                let mut at = |h: f64| {
                    net.points[k] = start + direction * (h * length);
                    self.energy(net, k)
                };
                let slope = (at(DIFFERENCE) - at(-DIFFERENCE)) / (2.0 * DIFFERENCE);
                net.points[k] = start;
                slope
            };
            let gradient = s * slope(net, s) + t * slope(net, t);
            let downhill = -gradient.normalize_or_zero() * length;
            let spot = net.spots[k];
            for step in TRIED_MOVES {
                place(net, k, net.chart.advance(spot, downhill * step));
                if self.energy(net, k) < before && !(strictly && turns_around(net, k)) {
                    longest = longest.max(step);
                    break;
                }
                place(net, k, spot);
            }
        }
        longest
    }
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
