//! Cells that turn over against the surface: finding them and opening them again.
//!
//! A cell is folded if one of its corner triangles points against the mean normal of the cells around it and against
//! the mean normal of the surface at its corners. Rough relief tilts single cells against their neighbours, and the
//! cells around the tip of a limb point in all directions; only a fold turns a corner over against both. The corner
//! of a cell at a corner of the patch is left out, for its angle is that of the patch's curves, be it 180 degrees.

use super::Fault;
use super::locate::Spot;
use super::net::{Net, cell_corners, turns_over};
use glam::DVec3;

/// Cells to each side over which the normal is averaged.
const REACH: usize = 2;
/// Sweeps over the folded cells.
const SWEEPS: usize = 12;
/// Moves that are tried, in cells, in each of [`DIRECTIONS`] directions.
const STEPS: [f64; 4] = [0.6, 0.3, 0.15, 0.05];
const DIRECTIONS: usize = 12;
/// Sine of the corner up to which a fold is opened: clear of rounding, flat enough to be reached.
const OPEN: f64 = 0.02;

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
        let (m, n) = (self.cols - 1, self.rows - 1);
        let (i, j) = (c % m, c / m);
        let mut sum = DVec3::ZERO;
        for y in j.saturating_sub(REACH)..(j + REACH + 1).min(n) {
            for x in i.saturating_sub(REACH)..(i + REACH + 1).min(m) {
                let q = cell_corners(self.cols, y * m + x).map(|k| self.points[k]);
                sum += (q[2] - q[0]).cross(q[3] - q[1]);
            }
        }
        let own = cell_corners(self.cols, c).into_iter().map(|k| (self.normal)(k)).sum::<DVec3>();
        [sum.normalize_or_zero(), own.normalize_or_zero()]
    }

    /// Least sine of the corners of cell `c`, each seen along the better of `normals`: negative if the cell is folded.
    fn least_sine(&self, c: usize, normals: [DVec3; 2]) -> f64 {
        let last = self.rows * self.cols - 1;
        let ends = [0, self.cols - 1, last, last + 1 - self.cols];
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

/// Opens folded cells: moves their points, one after the other, to where the worst corner around is best. True if there
/// is none left for certain.
pub fn open_folds(net: &mut Net, cancelled: &(dyn Fn() -> bool + Sync)) -> Result<bool, Fault> {
    let (cols, rows) = (net.cols, net.rows);
    for sweep in 0..SWEEPS {
        let folded = folded_cells(net);
        if folded.is_empty() {
            return Ok(true);
        }
        // A ring more every third sweep: where the folded cells are hemmed in, their neighbours must give way.
        let ring = sweep / 3;
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
        for k in nodes {
            if cancelled() {
                return Err(Fault::Cancelled);
            }
            open_around(net, k);
        }
    }
    Ok(false)
}

/// Least sine of the corners of the four cells around inner point `k`.
pub fn worst_corner(net: &Net, k: usize) -> f64 {
    worst_along(net, k, None)
}

/// The same along given normals of the four cells.
fn worst_along(net: &Net, k: usize, normals: Option<[[DVec3; 2]; 4]>) -> f64 {
    let normal = |k: usize| net.chart.normal(net.spots[k]);
    let sheet = sheet(net, &normal);
    let cells = cells_around(net.cols, k).into_iter().enumerate();
    let sine = |(n, c): (usize, usize)| sheet.least_sine(c, normals.map_or_else(|| sheet.normals(c), |all| all[n]));
    cells.map(sine).fold(f64::INFINITY, f64::min)
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

fn open_around(net: &mut Net, k: usize) {
    let cols = net.cols;
    let normals = {
        let normal = |k: usize| net.chart.normal(net.spots[k]);
        let sheet = sheet(net, &normal);
        cells_around(cols, k).map(|c| sheet.normals(c))
    };
    let mut best = worst_along(net, k, Some(normals));
    let tangents = [(net.points[k + 1] - net.points[k - 1]) / 2.0, (net.points[k + cols] - net.points[k - cols]) / 2.0];
    for step in STEPS {
        let start = net.spots[k];
        let mut found = start;
        for d in 0..DIRECTIONS {
            if best >= OPEN {
                return;
            }
            let (sin, cos) = (d as f64 / DIRECTIONS as f64 * std::f64::consts::TAU).sin_cos();
            place(net, k, net.chart.advance(start, (tangents[0] * cos + tangents[1] * sin) * step));
            let reached = worst_along(net, k, Some(normals));
            if reached > best && !turns_around(net, k) {
                best = reached;
                found = net.spots[k];
            }
            place(net, k, found);
        }
    }
}
