//! Cells that turn over against the surface: finding them and opening them again.
//!
//! A cell is folded if one of its corner triangles points against the mean normal around the cell. Rough relief
//! tilts single cells, but only a fold turns a corner right over. The corner of a cell at a corner of the patch is
//! left out, for its angle is that of the patch's curves, be it 180 degrees.

use super::Fault;
use super::locate::Spot;
use super::net::{Net, cell_corners, turns_over};
use glam::{DVec2, DVec3};

/// Cells to each side over which the normal is averaged.
const REACH: usize = 2;
/// Sweeps over the folded cells.
const SWEEPS: usize = 12;
/// Moves that are tried, in cells, in each of [`DIRECTIONS`] directions.
const STEPS: [f64; 4] = [0.6, 0.3, 0.15, 0.05];
const DIRECTIONS: usize = 12;
/// Sine of the corner up to which a fold is opened: clear of rounding, flat enough to be reached.
const OPEN: f64 = 0.02;

/// Sum of the area vectors of the cells around cell `c` of `cols x rows` points.
fn normal(points: &[DVec3], cols: usize, rows: usize, c: usize) -> DVec3 {
    let (m, n) = (cols - 1, rows - 1);
    let (i, j) = (c % m, c / m);
    let mut sum = DVec3::ZERO;
    for y in j.saturating_sub(REACH)..(j + REACH + 1).min(n) {
        for x in i.saturating_sub(REACH)..(i + REACH + 1).min(m) {
            let q = cell_corners(cols, y * m + x).map(|k| points[k]);
            sum += (q[2] - q[0]).cross(q[3] - q[1]);
        }
    }
    sum.normalize_or_zero()
}

/// Least sine of the corners of cell `c`, seen along `normal`: negative if the cell is folded.
fn least_sine(points: &[DVec3], cols: usize, rows: usize, c: usize, normal: DVec3) -> f64 {
    let last = rows * cols - 1;
    let ends = [0, cols - 1, last, last + 1 - cols];
    let k = cell_corners(cols, c);
    let sine = |n: usize| {
        let p = points[k[n]];
        let (e, f) = (points[k[(n + 1) % 4]] - p, points[k[(n + 3) % 4]] - p);
        let lengths = e.length() * f.length();
        if lengths > 0.0 { e.cross(f).dot(normal) / lengths } else { 0.0 }
    };
    (0..4).filter(|&n| k[n] != ends[n]).map(sine).fold(1.0, f64::min)
}

/// Indices of the folded cells of `cols x rows` points.
pub fn folded_cells(points: &[DVec3], cols: usize, rows: usize) -> Vec<usize> {
    let cells = 0..(cols - 1) * (rows - 1);
    cells.filter(|&c| least_sine(points, cols, rows, c, normal(points, cols, rows, c)) < 0.0).collect()
}

/// Opens folded cells: moves their points, one after the other, to where the worst corner around is best.
pub fn open_folds(net: &mut Net, cancelled: &(dyn Fn() -> bool + Sync)) -> Result<(), Fault> {
    let (cols, rows) = (net.cols, net.rows);
    for sweep in 0..SWEEPS {
        let folded = folded_cells(&net.points, cols, rows);
        if folded.is_empty() {
            break;
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
    Ok(())
}

fn open_around(net: &mut Net, k: usize) {
    let (cols, rows) = (net.cols, net.rows);
    let first = (k / cols - 1) * (cols - 1) + k % cols - 1;
    let cells = [first, first + 1, first + cols - 1, first + cols];
    let normals = cells.map(|c| normal(&net.points, cols, rows, c));
    let worst = |points: &[DVec3]| {
        let sines = cells.iter().zip(normals).map(|(&c, n)| least_sine(points, cols, rows, c, n));
        sines.fold(f64::INFINITY, f64::min)
    };
    let mut best = worst(&net.points);
    let tangents = [(net.points[k + 1] - net.points[k - 1]) / 2.0, (net.points[k + cols] - net.points[k - cols]) / 2.0];
    for step in STEPS {
        let kept: (Spot, DVec2, DVec3) = (net.spots[k], net.uv[k], net.points[k]);
        let mut found = kept;
        for d in 0..DIRECTIONS {
            if best >= OPEN {
                return;
            }
            let (sin, cos) = (d as f64 / DIRECTIONS as f64 * std::f64::consts::TAU).sin_cos();
            let spot = net.chart.advance(kept.0, (tangents[0] * cos + tangents[1] * sin) * step);
            (net.uv[k], net.points[k]) = (net.chart.uv_of(spot), net.chart.position(spot));
            let reached = worst(&net.points);
            if reached > best && !cells.iter().any(|&c| turns_over(&net.uv, cols, c)) {
                best = reached;
                found = (spot, net.uv[k], net.points[k]);
            }
            (net.spots[k], net.uv[k], net.points[k]) = found;
        }
    }
}
