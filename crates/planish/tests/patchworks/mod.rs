//! Hand-made networks with their grids: closed, open, toroidal and odd ones.
#![allow(dead_code)] // every test file uses some of them

use glam::DVec3;
use planish::Silent;
use planish::grid::Grid;
use planish::mesh::FacePoint;
use planish::network::{Corner, Curve, CurveKind, Network, Patch, Side};
use planish::relief::{self, Relief};
use planish::surface::{self, FitParams, Resolution, Surface};
use std::collections::BTreeMap;

/// Patches over shared corners. Curves are made for each pair of corners and label met, in order.
pub struct Patchwork {
    pub network: Network,
    pub grids: Vec<Grid>,
}

/// Surfaces of so many control points in each direction, not smoothed, and the reliefs over them.
pub fn fitted(work: &Patchwork, control: usize) -> (Vec<Surface>, Vec<Relief>) {
    let params = FitParams {
        resolution: Resolution::Control([control, control]),
        cells_per_span: 1.0,
        smoothing: 0.0,
        ..FitParams::default()
    };
    let surfaces = surface::fit_network(&work.network, &work.grids, &params, &Silent).unwrap();
    let reliefs = work.grids.iter().zip(&surfaces).map(|(g, s)| relief::bake(g, s).unwrap()).collect();
    (surfaces, reliefs)
}

/// Builds a network from patches given by their four corner ids; `labels` tell curves with equal ends apart.
pub fn network(corner_count: usize, patches: &[[(u32, u32); 4]], kind: impl Fn(u32, u32) -> CurveKind) -> Network {
    let place = FacePoint::corner(0, 0);
    let mut network = Network { corners: vec![Corner { place }; corner_count], ..Network::default() };
    let mut known: BTreeMap<(u32, u32, u32), u32> = BTreeMap::new();
    for patch in patches {
        let sides = std::array::from_fn(|k| {
            let ((a, label), (b, _)) = (patch[k], patch[(k + 1) % 4]);
            if let Some(&curve) = known.get(&(a, b, label)) {
                return Side { curve, reversed: false };
            }
            if let Some(&curve) = known.get(&(b, a, label)) {
                return Side { curve, reversed: true };
            }
            let curve = network.curves.len() as u32;
            known.insert((a, b, label), curve);
            network.curves.push(Curve { corners: [a, b], kind: kind(a, b), points: Vec::new() });
            Side { curve, reversed: false }
        });
        network.patches.push(Patch { sides });
    }
    let uses = network.uses();
    for (curve, uses) in network.curves.iter_mut().zip(uses) {
        if uses.len() == 1 {
            curve.kind = CurveKind::Boundary;
        }
    }
    network
}

pub fn grid(rows: usize, cols: usize, point: impl Fn(f64, f64) -> DVec3) -> Grid {
    let mut points = Vec::new();
    for j in 0..rows {
        for i in 0..cols {
            points.push(point(i as f64 / (cols - 1) as f64, j as f64 / (rows - 1) as f64));
        }
    }
    Grid { rows, cols, points, places: Vec::new() }
}

/// Makes the boundary nodes of later patches bit-identical to those of the first that has them.
pub fn share_boundaries(network: &Network, grids: &mut [Grid]) {
    let mut curves: Vec<Vec<DVec3>> = vec![Vec::new(); network.curves.len()];
    let mut corners: Vec<Option<DVec3>> = vec![None; network.corners.len()];
    for (patch, grid) in network.patches.iter().zip(grids) {
        for (k, side) in patch.sides.iter().enumerate() {
            let n = if k % 2 == 0 { grid.cols } else { grid.rows };
            let index = |i: usize| {
                let (u, v) = match k {
                    0 => (i, 0),
                    1 => (grid.cols - 1, i),
                    2 => (grid.cols - 1 - i, grid.rows - 1),
                    _ => (0, grid.rows - 1 - i),
                };
                v * grid.cols + u
            };
            let curve = &mut curves[side.curve as usize];
            if curve.is_empty() {
                *curve = (0..n).map(|i| grid.points[index(if side.reversed { n - 1 - i } else { i })]).collect();
                let ends = network.curves[side.curve as usize].corners;
                curve[0] = *corners[ends[0] as usize].get_or_insert(curve[0]);
                curve[n - 1] = *corners[ends[1] as usize].get_or_insert(curve[n - 1]);
            }
            assert_eq!(curve.len(), n);
            for i in 0..n {
                let shared = curve[if side.reversed { n - 1 - i } else { i }];
                let here = &mut grid.points[index(i)];
                assert!(here.distance(shared) < 1e-9, "the test's own grids do not meet");
                *here = shared;
            }
        }
    }
}

/// The six faces of a cube `[-1, 1]³`, all corners of valence 3, moved by `shape`; `nodes` per side.
pub fn cube(nodes: usize, kind: CurveKind, shape: impl Fn(DVec3) -> DVec3) -> Patchwork {
    let corner = |c: u32| DVec3::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2) as f64) * 2.0 - 1.0;
    // Counter-clockwise seen from outside.
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let network = network(8, &faces.map(|f| f.map(|c| (c, 0))), |_, _| kind);
    let mut grids: Vec<Grid> = faces
        .iter()
        .map(|f| {
            let [a, b, c, d] = f.map(corner);
            grid(nodes, nodes, |u, v| shape((a.lerp(b, u)).lerp(d.lerp(c, u), v)))
        })
        .collect();
    share_boundaries(&network, &mut grids);
    Patchwork { network, grids }
}

/// Cube to unit sphere with even spacing.
pub fn to_sphere(p: DVec3) -> DVec3 {
    (p * (std::f64::consts::FRAC_PI_4)).map(f64::tan).normalize()
}

/// An organic closed shape: an ellipsoid with bumps of a tenth of its size.
pub fn blob(p: DVec3) -> DVec3 {
    let s = to_sphere(p);
    let bump = 1.0 + 0.1 * (3.0 * s.x + 0.4).sin() * (2.0 * s.y).cos() + 0.08 * (4.0 * s.z + s.x).sin();
    s * DVec3::new(1.3, 1.0, 0.8) * bump
}

/// The same with waves of .4 % of its size, shorter than a knot span.
pub fn rough_blob(p: DVec3) -> DVec3 {
    let b = blob(p);
    let wave = |a: f64| ((b.x * 91.7 + b.y * 57.3 + b.z * 77.1 + a) * 13.0).sin();
    b + 0.004 * DVec3::new(wave(0.0), wave(1.7), wave(2.9))
}

/// A rectangle of `across x up` patches over `[0, across] x [0, up]`, moved by `shape`; closed in a direction if
/// `wrap` says so. Every patch has `nodes` of [cols, rows].
pub fn sheet(
    across: usize,
    up: usize,
    wrap: [bool; 2],
    nodes: [usize; 2],
    shape: impl Fn(f64, f64) -> DVec3,
) -> Patchwork {
    let wide = if wrap[0] { across } else { across + 1 };
    let high = if wrap[1] { up } else { up + 1 };
    let id = |i: usize, j: usize| ((j % high) * wide + i % wide) as u32;
    let mut patches = Vec::new();
    for j in 0..up {
        for i in 0..across {
            // Labels keep the curves of a direction that closes on one or two patches apart.
            let (row, column) = ((j % high) as u32 * 2, (i % wide) as u32 * 2 + 1);
            let (next_row, next_column) = (((j + 1) % high) as u32 * 2, ((i + 1) % wide) as u32 * 2 + 1);
            let along = (i as u32) << 16;
            let upward = (j as u32) << 16;
            patches.push([
                (id(i, j), row | along),
                (id(i + 1, j), next_column | upward),
                (id(i + 1, j + 1), next_row | along),
                (id(i, j + 1), column | upward),
            ]);
        }
    }
    // A closed curve (both ends one corner) has no direction of its own: the far side runs against it.
    let mut network = network(wide * high, &patches, |_, _| CurveKind::Smooth);
    for (p, patch) in network.patches.iter_mut().enumerate() {
        for k in 0..4 {
            let (a, b) = (patches[p][k].0, patches[p][(k + 1) % 4].0);
            if a == b {
                patch.sides[k].reversed = k >= 2;
            }
        }
    }
    let mut grids = Vec::new();
    for j in 0..up {
        for i in 0..across {
            grids.push(grid(nodes[1], nodes[0], |u, v| shape(i as f64 + u, j as f64 + v)));
        }
    }
    share_boundaries(&network, &mut grids);
    Patchwork { network, grids }
}

/// A torus of `4 x 4` patches, radii 2 and 0.7.
pub fn torus(nodes: usize) -> Patchwork {
    sheet(4, 4, [true, true], [nodes, nodes], |x, y| {
        let (a, b) = (x * std::f64::consts::FRAC_PI_2, y * std::f64::consts::FRAC_PI_2);
        let r = 2.0 + 0.7 * b.cos();
        DVec3::new(r * a.cos(), r * a.sin(), 0.7 * b.sin())
    })
}

/// An open wavy sheet of `2 x 3` patches.
pub fn wavy(nodes: [usize; 2]) -> Patchwork {
    sheet(2, 3, [false, false], nodes, |x, y| DVec3::new(x, y, 0.2 * (1.3 * x + 0.5 * y).sin() * (y - 0.3).cos()))
}

/// One patch rolled to a tube: its sides 1 and 3 are one curve.
pub fn tube(nodes: [usize; 2]) -> Patchwork {
    sheet(1, 1, [true, false], nodes, |x, y| {
        let a = x * std::f64::consts::TAU;
        DVec3::new(a.cos(), a.sin(), 2.0 * y)
    })
}

/// One patch closed to a torus: both pairs of sides are one curve each.
pub fn one_patch_torus(nodes: [usize; 2]) -> Patchwork {
    sheet(1, 1, [true, true], nodes, |x, y| {
        let (a, b) = (x * std::f64::consts::TAU, y * std::f64::consts::TAU);
        let r = 2.0 + 0.7 * b.cos();
        DVec3::new(r * a.cos(), r * a.sin(), 0.7 * b.sin())
    })
}

/// One patch folded shut like a purse: sides 0 and 1 are one curve, and sides 2 and 3 another, each used in both
/// directions. A closed surface of the sphere's kind with two corners of valence 1 and one of valence 2.
pub fn purse(nodes: usize) -> Patchwork {
    let place = FacePoint::corner(0, 0);
    let curve = |a, b| Curve { corners: [a, b], kind: CurveKind::Smooth, points: Vec::new() };
    let side = |curve, reversed| Side { curve, reversed };
    // Corners around the patch: 0, 1, 0, 2.
    let network = Network {
        corners: vec![Corner { place }; 3],
        curves: vec![curve(0, 1), curve(0, 2)],
        patches: vec![Patch { sides: [side(0, false), side(0, true), side(1, false), side(1, true)] }],
    };
    // Over the square, points mirrored at the diagonal from corner 1 to corner 3 are one on the boundary.
    let mut grids = vec![grid(nodes, nodes, |u, v| {
        let (x, y) = (u - v, u + v - 1.0);
        let rim = (1.0 - x.abs() - y.abs()).max(0.0);
        DVec3::new(x, y.abs(), rim * if y < 0.0 { 1.0 } else { -1.0 } * (u * (1.0 - u) * v * (1.0 - v)).sqrt())
    })];
    share_boundaries(&network, &mut grids);
    Patchwork { network, grids }
}
