//! Catching detail: a settled grid runs evenly over ridges and tips and cuts them off; where a vertex of the patch is
//! missed, the nearest free point of the grid moves onto it, if no cell turns over.
//!
//! Goes beyond [K98], whose grids catch a ridge only by being finer.

use super::fold::{place, turns_around, worst_corner};
use super::{Net, cell_corners};
use crate::geom::{Bvh, closest_in_triangle};
use crate::grid::Fault;
use crate::grid::chart::Chart;
use crate::grid::chart::locate::Spot;
use crate::grid::quality::{halves, surface};
use crate::mesh::NONE;
use crate::observe::Observer;
use rayon::prelude::*;

/// Sweeps over the missed vertices; each sees the points that the one before moved.
const CATCH_SWEEPS: usize = 3;

/// Rings of cells around a node in which the surface is looked for before all of it is.
const RINGS: [usize; 3] = [1, 3, 8];

/// Nearer than this part of what is allowed is near enough, whatever the rounding.
const CLEARLY: f64 = 1.0 - 1e-6;

/// Least sine of the corners of cells around a moved point, unless they were worse before.
const LEAST_SINE: f64 = 0.15;

/// Moves points of `net` onto vertices of its chart that lie further than `allowed` from the grid's surface.
pub fn catch(net: &mut Net, allowed: f64, observer: &dyn Observer) -> Result<(), Fault> {
    let spots = vertex_spots(net.chart);
    let mut moved = vec![false; net.points.len()];
    for _ in 0..CATCH_SWEEPS {
        observer.check()?;
        let suspects = suspects(net, allowed);
        if suspects.is_empty() {
            break;
        }
        let bvh = Bvh::new(&surface(&net.points, net.cols, net.rows));
        let points = &net.chart.points;
        let mut missed: Vec<(f64, usize, usize)> = suspects
            .into_par_iter()
            .map(|v| {
                let hit = bvh.closest(points[v]);
                (hit.distance, v, hit.place.face as usize / 2)
            })
            .filter(|m| m.0 > allowed)
            .collect();
        missed.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut any = false;
        for (_, v, cell) in missed {
            let mut corners = cell_corners(net.cols, cell).map(|k| (net.points[k].distance(points[v]), k));
            corners.sort_by(|a, b| a.0.total_cmp(&b.0));
            for (_, k) in corners {
                if net.is_inner(k) && !moved[k] && put(net, k, spots[v]) {
                    moved[k] = true;
                    any = true;
                    break;
                }
            }
        }
        if !any {
            break;
        }
    }
    Ok(())
}

/// Vertices of the chart that may lie further than `allowed` from the grid's surface: those that the cells around the
/// node nearest in the chart do not come near enough to. All others do not, so looking at these alone changes nothing.
fn suspects(net: &Net, allowed: f64) -> Vec<usize> {
    let (cols, rows) = (net.cols, net.rows);
    let points = &net.chart.points;
    let mut near = vec![NONE; points.len()];
    for (k, spot) in net.spots.iter().enumerate() {
        for v in net.chart.triangles[spot.triangle as usize] {
            if near[v as usize] == NONE {
                near[v as usize] = k as u32;
            }
        }
    }
    for triangle in &net.chart.triangles {
        if let Some(k) = triangle.iter().map(|&v| near[v as usize]).find(|&k| k != NONE) {
            for &v in triangle {
                if near[v as usize] == NONE {
                    near[v as usize] = k;
                }
            }
        }
    }
    let within = |v: usize, ring: usize| {
        let (i, j) = (near[v] as usize % cols, near[v] as usize / cols);
        let lines = j.saturating_sub(ring)..(j + ring).min(rows - 1);
        lines.into_iter().any(|y| {
            (i.saturating_sub(ring)..(i + ring).min(cols - 1)).any(|x| {
                let corners = cell_corners(cols, y * (cols - 1) + x).map(|k| net.points[k]);
                halves(corners).into_iter().any(|t| {
                    let (square, _) = closest_in_triangle(&t.map(|k| corners[k]), points[v]);
                    square.sqrt() <= allowed * CLEARLY
                })
            })
        })
    };
    let at_node = |v: usize| points[v].distance(net.points[near[v] as usize]) <= allowed * CLEARLY;
    let found = |v: usize| at_node(v) || RINGS.into_iter().any(|ring| within(v, ring));
    let far = |&v: &usize| near[v] == NONE || !found(v);
    (0..points.len()).into_par_iter().filter(far).collect()
}

/// A spot for every vertex of the chart.
fn vertex_spots(chart: &Chart) -> Vec<Spot> {
    let mut spots = vec![Spot { triangle: 0, bary: [1.0, 0.0, 0.0] }; chart.points.len()];
    for (t, triangle) in chart.triangles.iter().enumerate() {
        for (k, &v) in triangle.iter().enumerate() {
            let mut bary = [0.0; 3];
            bary[k] = 1.0;
            spots[v as usize] = Spot { triangle: t as u32, bary };
        }
    }
    spots
}

/// Moves point `k` to `spot` unless a cell turns over or gets much worse. True if it moved.
fn put(net: &mut Net, k: usize, spot: Spot) -> bool {
    let before = worst_corner(net, k);
    let kept = place(net, k, spot);
    let bad = turns_around(net, k) || worst_corner(net, k) < before.min(LEAST_SINE);
    if bad {
        place(net, k, kept);
    }
    !bad
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DVec3;
    use crate::grid::chart::tests::chart;

    #[test]
    fn a_ridge_between_the_points_of_a_grid_is_caught_without_folds() {
        // The ridge runs along s = 0.45, a line of vertices of the chart and none of the grid.
        let chart = chart(|s, t| DVec3::new(s, t, (0.1 - (s - 0.45).abs()).max(0.0)));
        let mut net = Net::regular(&chart, 9, 9);
        let missed = |net: &Net| {
            let bvh = Bvh::new(&surface(&net.points, 9, 9));
            chart.points.iter().filter(|&&p| bvh.closest(p).distance > 0.01).count()
        };
        let before = missed(&net);
        catch(&mut net, 0.01, &crate::Silent).expect("not cancelled");
        assert!(3 * missed(&net) < before, "{} of {before}", missed(&net));
        assert!((0..64).all(|c| !crate::grid::net::turns_over(&net.uv, 9, c)));
    }
}
