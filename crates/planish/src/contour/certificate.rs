//! The certificate on random trilinear grids: closed, manifold, free of self-intersections, with the Euler number of the
//! interpolant.
//!
//! See `docs/methods/contour.md`, steps 5 and 6.

use super::cell::topology::Trilinear;
use super::{ContourParams, Extracted, extract};
use crate::Silent;
use crate::field::{GridParams, ScalarGrid, sample_grid};
use crate::geom::random;
use crate::mesh::{diagnose, self_intersections};
use glam::DVec3;
use std::sync::Arc;

/// A grid of random numbers inside and positive ones on its border.
fn random_grid(seed: u64, n: usize) -> ScalarGrid {
    let values = (0..n * n * n)
        .map(|v| {
            let border = [v % n, v / n % n, v / n / n].iter().any(|&x| x == 0 || x == n - 1);
            let r = random::unit(seed, v as u64) as f32;
            if border { r + 0.05 } else { 2.0 * r - 1.0 }
        })
        .collect();
    ScalarGrid {
        size: [n; 3],
        origin: DVec3::new(0.1, -0.2, 0.3),
        spacing: DVec3::new(1.0, 0.8, 1.3),
        values: Arc::new(values),
    }
}

/// Euler number of the part of a grid below zero, from those of cells, faces, edges and nodes.
fn euler_below(grid: &ScalarGrid) -> i32 {
    let n = grid.size[0];
    let f = |i: usize, j: usize, k: usize| grid.values[(k * n + j) * n + i] as f64;
    let mut euler = 0;
    for k in 0..n {
        for j in 0..n {
            for i in 0..n {
                let at = |d: usize| f(i + (d & 1), j + (d >> 1 & 1), k + (d >> 2 & 1));
                let has = |d: usize| i + (d & 1) < n && j + (d >> 1 & 1) < n && k + (d >> 2 & 1) < n;
                euler -= (at(0) < 0.0) as i32;
                for d in [1, 2, 4].into_iter().filter(|&d| has(d)) {
                    euler += (at(0) < 0.0 || at(d) < 0.0) as i32;
                }
                for (a, b) in [(1, 2), (2, 4), (4, 1)].into_iter().filter(|(a, b)| has(a | b)) {
                    let v = [at(0), at(a), at(b), at(a | b)];
                    let below = v.map(|x| x < 0.0);
                    let alternate = below[0] == below[3] && below[1] == below[2] && below[0] != below[1];
                    euler -= if alternate {
                        // Two corners below: one piece or two, by the sign of the saddle.
                        let saddle = (v[0] * v[3] - v[1] * v[2]) / (v[0] + v[3] - v[1] - v[2]);
                        if saddle < 0.0 { 1 } else { 2 }
                    } else {
                        below.contains(&true) as i32
                    };
                }
                if has(7) {
                    euler += Trilinear::new(std::array::from_fn(at)).euler_below();
                }
            }
        }
    }
    euler
}

fn extracted(grid: &ScalarGrid, plain: bool) -> Extracted {
    let field = sample_grid(grid, &GridParams { close: false, ..Default::default() }, &Silent).unwrap();
    extract(&field, None, &ContourParams { plain, ..Default::default() }, &Silent).unwrap()
}

#[test]
fn ten_thousand_random_grids_give_sound_meshes_with_the_euler_number_of_the_interpolant() {
    let (mut cells, mut pushed, mut wrong) = (0, 0, 0);
    for seed in 0..10_000u64 {
        let n = 4 + (seed % 3) as usize;
        let grid = random_grid(seed, n);
        if grid.values.iter().all(|&v| v >= 0.0) {
            continue;
        }
        // Sharp and plain by turns.
        let found = extracted(&grid, seed % 2 == 0);
        let d = diagnose(&found.mesh);
        assert!(d.watertight && d.manifold && d.flipped_faces == 0, "{seed}: {d:?}");
        assert_eq!(self_intersections(&found.mesh), Vec::<[u32; 2]>::new(), "{seed}");
        wrong += (d.euler != 2 * euler_below(&grid) as i64) as usize;
        cells += found.counts.cells;
        pushed += found.counts.pushed;
    }
    assert_eq!(wrong, 0, "grids with another Euler number");
    // Noise at the scale of the cells is the worst that there is.
    assert!(pushed * 4 < cells, "{pushed} of {cells} cells pushed in");
}
