//! How near the surfaces are to their grids and how well they meet.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §6.2 eq. 6.1 (parametric distance) and
//! §8.1.1 (normals along a seam; here their angle in degrees).

use super::basis::{BasisRows, uniform_parameters};
use super::sides::place;
use super::{RowSampler, Surface};
use crate::geom::polyline;
use crate::grid::Grid;
use crate::network::{CurveKind, Network};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Fewest samples along a seam.
const SEAM_SAMPLES: usize = 33;
/// Samples per knot span of a longer one: a cubic's error between knots has at most three extremes.
const SPAN_SAMPLES: usize = 4;
/// Relative length of `S_u x S_v` below which a surface has no normal there.
const FLAT: f64 = 1e-9;

/// Parametric distances of grid nodes from their surfaces, world units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Deviation {
    /// Largest.
    pub max: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// 95 of 100 are not larger.
    pub p95: f64,
}

/// Parametric distances of all nodes of all grids from their surfaces ([K98] eq. 6.1).
pub fn deviation(surfaces: &[Surface], grids: &[Grid]) -> Deviation {
    summary(surfaces.par_iter().zip(grids).map(|(s, g)| distances(s, g)).collect::<Vec<_>>().concat())
}

/// Parametric distances of the nodes of one grid from its surface.
pub fn deviation_of(surface: &Surface, grid: &Grid) -> Deviation {
    summary(distances(surface, grid))
}

fn summary(mut distances: Vec<f64>) -> Deviation {
    if distances.is_empty() {
        return Deviation::default();
    }
    let n = distances.len();
    let rms = (distances.iter().map(|d| d * d).sum::<f64>() / n as f64).sqrt();
    let max = distances.iter().copied().fold(0.0, f64::max);
    let (_, p95, _) = distances.select_nth_unstable_by((n - 1) * 95 / 100, f64::total_cmp);
    Deviation { max, rms, p95: *p95 }
}

fn distances(surface: &Surface, grid: &Grid) -> Vec<f64> {
    let along_u = [BasisRows::new(&surface.knots_u, &uniform_parameters(grid.cols), 0)];
    let sampler = RowSampler::new(surface, &along_u);
    let mut out = vec![0.0; grid.points.len()];
    let cols = grid.cols.max(1);
    out.par_chunks_mut(cols).zip(grid.points.par_chunks(cols)).zip(uniform_parameters(grid.rows)).for_each(
        |((out, nodes), v)| {
            let narrow = sampler.narrow(v, 0);
            for (i, (d, p)) in out.iter_mut().zip(nodes).enumerate() {
                *d = sampler.node(&narrow, i, 0).distance(*p);
            }
        },
    );
    out
}

/// How two patches meet along one curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeamQuality {
    /// Index of the curve.
    pub curve: u32,
    /// What it follows; a feature seam is meant to have an angle.
    pub kind: CurveKind,
    /// Largest distance between the two boundaries at equal parameters, world units.
    pub gap_max: f64,
    /// Largest angle between the two normals, ends included, degrees.
    pub angle_max_deg: f64,
    /// Root of the mean square of the angle over the length of the seam, degrees.
    pub angle_rms_deg: f64,
    /// Mean angle over the length of the seam, degrees.
    pub angle_mean_deg: f64,
    /// Length of the seam, world units.
    pub length: f64,
}

/// Measures every curve that has a patch on both sides, in the order of the curves, in 32 pieces or more: means by the
/// midpoint rule, largest values at the ends of the pieces, too.
///
/// Surfaces must be those of the network's patches. Samples where a surface has no normal (a corner with an
/// angle of 0 or 180 degrees) count for the gap only.
pub fn measure_seams(
    network: &Network,
    surfaces: &[Surface],
    observer: &dyn Observer,
) -> Result<Vec<SeamQuality>, Cancelled> {
    let uses = network.uses();
    (0..uses.len())
        .into_par_iter()
        .filter(|&c| uses[c].len() == 2 && uses[c].iter().all(|&(p, _)| (p as usize) < surfaces.len()))
        .map(|c| {
            observer.check()?;
            Ok(measure(network, surfaces, c, [uses[c][0], uses[c][1]]))
        })
        .collect()
}

/// A place on a seam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeamAngle {
    /// Index of the curve.
    pub curve: u32,
    /// The place on the first of the two surfaces.
    pub point: DVec3,
    /// Angle between the two normals, degrees; not a number where a surface has none.
    pub angle_deg: f64,
    /// Length that it stands for, world units.
    pub length: f64,
}

/// Angles along every curve that has a patch on both sides, in the order of the curves, at even parameters about `step`
/// apart (world units).
///
/// Surfaces must be those of the network's patches.
pub fn seam_angles(network: &Network, surfaces: &[Surface], step: f64) -> Vec<SeamAngle> {
    let uses = network.uses();
    let one = |c: usize| {
        let both = [uses[c][0], uses[c][1]];
        let jets = |t: f64| {
            both.map(|(p, k)| {
                let side = network.patches[p as usize].sides[k as usize];
                let (u, v) = place(k as usize, side.reversed, t);
                surfaces[p as usize].jet(u, v)
            })
        };
        let coarse: Vec<DVec3> = uniform_parameters(SEAM_SAMPLES).into_iter().map(|t| jets(t)[0].point).collect();
        let length = polyline::length(coarse);
        let pieces = (length / step).ceil().clamp(1.0, MOST_ANGLES);
        let even = (0..pieces as usize).map(move |i| (i as f64 + 0.5) / pieces);
        even.map(|t| {
            let [a, b] = jets(t);
            let [m, n] = [&a, &b].map(|j| j.area_vector().normalize_or(DVec3::NAN));
            let angle_deg = m.cross(n).length().atan2(m.dot(n)).to_degrees();
            SeamAngle { curve: c as u32, point: a.point, angle_deg, length: length / pieces }
        })
        .collect::<Vec<_>>()
    };
    (0..uses.len())
        .into_par_iter()
        .filter(|&c| uses[c].len() == 2 && uses[c].iter().all(|&(p, _)| (p as usize) < surfaces.len()))
        .flat_map_iter(one)
        .collect()
}

/// Places on one seam at most.
const MOST_ANGLES: f64 = 1e5;

fn measure(network: &Network, surfaces: &[Surface], curve: usize, uses: [(u32, u8); 2]) -> SeamQuality {
    let (first, k) = (&surfaces[uses[0].0 as usize], uses[0].1);
    let spans = if k % 2 == 0 { first.cols } else { first.rows } - 3;
    let samples = SEAM_SAMPLES.max(SPAN_SAMPLES * spans + 1);
    let jets: Vec<[super::Jet; 2]> = uniform_parameters(2 * samples - 1)
        .into_iter()
        .map(|t| {
            uses.map(|(p, k)| {
                let side = network.patches[p as usize].sides[k as usize];
                let (u, v) = place(k as usize, side.reversed, t);
                surfaces[p as usize].jet(u, v)
            })
        })
        .collect();
    let gap_max = jets.iter().map(|[a, b]| a.point.distance(b.point)).fold(0.0, f64::max);
    let angle = |[a, b]: &[super::Jet; 2]| {
        let has_normal = |j: &super::Jet| j.area_vector().length() > FLAT * j.u.length() * j.v.length();
        let (na, nb) = (a.area_vector().normalize_or_zero(), b.area_vector().normalize_or_zero());
        (has_normal(a) && has_normal(b)).then(|| na.cross(nb).length().atan2(na.dot(nb)).to_degrees())
    };
    let angle_max = jets.iter().filter_map(angle).fold(0.0, f64::max);
    let (mut length, mut known, mut squares, mut sum) = (0.0, 0.0, 0.0, 0.0);
    for piece in jets.windows(3).step_by(2) {
        let chord = piece[0][0].point.distance(piece[2][0].point);
        length += chord;
        if let Some(angle) = angle(&piece[1]) {
            known += chord;
            squares += chord * angle * angle;
            sum += chord * angle;
        }
    }
    let known = if known > 0.0 { known } else { 1.0 };
    SeamQuality {
        curve: curve as u32,
        kind: network.curves[curve].kind,
        gap_max,
        angle_max_deg: angle_max,
        angle_rms_deg: (squares / known).sqrt(),
        angle_mean_deg: sum / known,
        length,
    }
}
