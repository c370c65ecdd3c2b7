//! The form without its short waves: [K98] §7.5, where a fit to the smoothed grid is what a user expects of one.

mod energy;

use self::energy::{Energy, Pieces};
use super::laplacian::{elements, give_least_mass};
use super::{PatchedMesh, ReliefError, surface_patches};
use crate::grid::Grid;
use crate::network::{Network, Patch};
use crate::observe::Observer;
use crate::surface::basis::uniform_parameters;
use crate::surface::{FEWEST_CONTROL, FitParams, KnotSpacing, Resolution, Surface, check_grids, fit_network, node};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::FRAC_PI_4;

/// The grids with only what is longer than `wavelength`, on as many nodes as that takes.
///
/// Sharp curves and borders are parted first, by themselves, and the surface between them up to them. Places stay where these lines
/// end, meet, or turn by more than half a right angle.
///
/// * `surfaces` - lengths are measured on them
/// * `counts` - nodes along each curve: equal along chords, no more than the grids have, some for each of the waves
///
/// # Errors
/// As [`super::surface_patches`]; [`ReliefError::Cancelled`].
pub fn long_waves(
    network: &Network,
    grids: &[Grid],
    surfaces: &[Surface],
    (counts, wavelength): (&[usize], f64),
    observer: &dyn Observer,
) -> Result<Vec<Grid>, ReliefError> {
    let grids = thinned(network, grids, counts, observer)?;
    let shapes: Vec<[usize; 2]> = grids.iter().map(|g| [g.rows, g.cols]).collect();
    let base = surface_patches(network, surfaces, &shapes, observer)?;
    let nodes: Vec<Vec<DVec3>> = grids.iter().map(|g| g.points.clone()).collect();
    let mut places = base.gather(&nodes);
    let lines = Lines::new(network, &base);
    let on_lines: Vec<DVec3> = lines.vertices.iter().map(|&v| places[v as usize]).collect();
    let parted = Energy::new(lines.pieces, wavelength, observer)?.low_pass(&on_lines, observer)?;
    lines.vertices.iter().zip(parted).for_each(|(&v, p)| places[v as usize] = p);
    let long = Energy::new(pieces(&base, &lines.vertices), wavelength, observer)?.low_pass(&places, observer)?;
    let one = |(grid, points): (Grid, Vec<DVec3>)| Grid { points, ..grid };
    Ok(grids.into_iter().zip(base.scatter(&long)).map(one).collect())
}

/// The grids on fewer nodes: those of splines of least squares with a knot span between nodes, so that what is shorter does not come
/// back as something longer.
fn thinned(
    network: &Network,
    grids: &[Grid],
    counts: &[usize],
    observer: &dyn Observer,
) -> Result<Vec<Grid>, ReliefError> {
    let shape = |patch: &Patch| [1, 0].map(|k| counts[patch.sides[k].curve as usize]);
    let shapes: Vec<[usize; 2]> = network.patches.iter().map(shape).collect();
    if grids.iter().zip(&shapes).all(|(g, s)| [g.rows, g.cols] == *s) {
        return Ok(grids.to_vec());
    }
    let nodes = check_grids(network, grids)?;
    let control = |(curve, &count): (usize, &usize)| (count + FEWEST_CONTROL - 2).min(nodes[curve]).max(FEWEST_CONTROL);
    let resolution = Resolution::PerCurve(counts.iter().enumerate().map(control).collect());
    let params = FitParams { resolution, smoothing: 0.0, knots: KnotSpacing::Even, ..FitParams::default() };
    let splines = fit_network(network, grids, &params, observer)?;
    let sampled = |(surface, &[rows, cols]): (&Surface, &[usize; 2])| {
        let points = surface.sample(&uniform_parameters(cols), &uniform_parameters(rows), [0, 0]);
        Grid { rows, cols, points, places: Vec::new() }
    };
    Ok(splines.par_iter().zip(&shapes).map(sampled).collect())
}

/// The surface between lines.
fn pieces(base: &PatchedMesh, lines: &[u32]) -> Pieces {
    let mut pieces = Pieces::of(base.mesh.points.len());
    lines.iter().for_each(|&v| pieces.fixed[v as usize] = true);
    for element in elements(base) {
        element.vertices.iter().for_each(|&v| pieces.mass[v as usize] += element.mass);
        pieces.bonds.extend(element.bonds());
        if element.vertices.iter().all(|&v| !pieces.fixed[v as usize]) {
            pieces.inner.extend(element.bonds());
        }
    }
    give_least_mass(&mut pieces.mass);
    pieces
}

/// Sharp curves and borders.
struct Lines {
    /// The vertices on them.
    vertices: Vec<u32>,
    /// Of these vertices.
    pieces: Pieces,
}

impl Lines {
    fn new(network: &Network, base: &PatchedMesh) -> Lines {
        let (mut vertices, mut number) = (Vec::new(), vec![u32::MAX; base.mesh.points.len()]);
        let mut segments: Vec<[u32; 2]> = Vec::new();
        let mut seen: Vec<bool> = network.curves.iter().map(|c| c.kind.is_smooth()).collect();
        for (patch, nodes) in network.patches.iter().zip(&base.patches) {
            for (k, side) in patch.sides.iter().enumerate() {
                if std::mem::replace(&mut seen[side.curve as usize], true) {
                    continue;
                }
                let count = if k % 2 == 0 { nodes.cols } else { nodes.rows };
                let along = (0..count).map(|i| {
                    let v = nodes.vertices[node(nodes.rows, nodes.cols, k, i, 0)];
                    if number[v as usize] == u32::MAX {
                        number[v as usize] = vertices.len() as u32;
                        vertices.push(v);
                    }
                    number[v as usize]
                });
                let along: Vec<u32> = along.collect();
                segments.extend(along.windows(2).filter(|w| w[0] != w[1]).map(|w| [w[0], w[1]]));
            }
        }
        let at = |i: u32| base.mesh.points[vertices[i as usize] as usize];
        let mut beside: Vec<Vec<DVec3>> = vec![Vec::new(); vertices.len()];
        for &[i, j] in &segments {
            beside[i as usize].push((at(j) - at(i)).normalize_or_zero());
            beside[j as usize].push((at(i) - at(j)).normalize_or_zero());
        }
        let mut pieces = Pieces::of(vertices.len());
        pieces.fixed = beside.iter().map(|d| d.len() != 2 || d[0].dot(-d[1]) < FRAC_PI_4.cos()).collect();
        for [i, j] in segments {
            let length = at(i).distance(at(j));
            [i, j].iter().for_each(|&k| pieces.mass[k as usize] += length / 2.0);
            if length > 0.0 {
                pieces.bonds.push((i, j, 1.0 / length));
                if !pieces.fixed[i as usize] && !pieces.fixed[j as usize] {
                    pieces.inner.push((i, j, 1.0 / length));
                }
            }
        }
        give_least_mass(&mut pieces.mass);
        Lines { vertices, pieces }
    }
}
