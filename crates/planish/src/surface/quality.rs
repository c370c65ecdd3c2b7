//! How near the surfaces are to their grids and how well they meet.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §6.2 eq. 6.1 (parametric distance) and
//! §8.1.1 (normals along a seam; here their angle in degrees).

use super::basis::{BasisRows, span_samples, uniform_parameters};
use super::seam::certificate::{Rim, angle_bound, gap_bound};
use super::sides::{knots_along, place};
use super::{EdgeInSeam, RowSampler, Surface};
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
/// Angles of a patch between its sides at a corner with which a seam can be expected to be smooth, degrees.
const REGULAR_DEG: std::ops::RangeInclusive<f64> = 25.0..=150.0;
/// How far inside a patch the normal is that one in its corner is held against, of the patch: a corner with a reflex angle
/// points inwards, and does so nowhere else.
const INSIDE: f64 = 0.02;
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

/// Distances of the nodes of one grid from its surface along the normals of the grid: what a tolerance bounds. Sideways a
/// surface may lie off its grid and still be on the mesh.
pub fn normal_deviation_of(surface: &Surface, grid: &Grid) -> Deviation {
    summary(heights(surface, grid))
}

/// Root of the mean square of the distances of all nodes from their surfaces along the normals of the grids.
pub fn normal_rms(surfaces: &[Surface], grids: &[Grid]) -> f64 {
    let sums: Vec<(f64, usize)> = surfaces
        .par_iter()
        .zip(grids)
        .map(|(s, g)| (heights(s, g).iter().map(|h| h * h).sum(), g.points.len()))
        .collect();
    let (sum, count) = sums.iter().fold((0.0, 0), |(a, b), (c, d)| (a + c, b + d));
    if count > 0 { (sum / count as f64).sqrt() } else { 0.0 }
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

pub(super) fn distances(surface: &Surface, grid: &Grid) -> Vec<f64> {
    offsets(surface, grid).into_iter().map(DVec3::length).collect()
}

/// The ways from the nodes of a grid to the surface at their parameters.
pub(super) fn offsets(surface: &Surface, grid: &Grid) -> Vec<DVec3> {
    let along_u = [BasisRows::new(&surface.knots_u, &uniform_parameters(grid.cols), 0)];
    let sampler = RowSampler::new(surface, &along_u);
    let mut out = vec![DVec3::ZERO; grid.points.len()];
    let cols = grid.cols.max(1);
    out.par_chunks_mut(cols).zip(grid.points.par_chunks(cols)).zip(uniform_parameters(grid.rows)).for_each(
        |((out, nodes), v)| {
            let narrow = sampler.narrow(v, 0);
            for (i, (d, p)) in out.iter_mut().zip(nodes).enumerate() {
                *d = sampler.node(&narrow, i, 0) - *p;
            }
        },
    );
    out
}

/// How far a surface is from each node of its grid along the normal.
pub(super) fn heights(surface: &Surface, grid: &Grid) -> Vec<f64> {
    let along = |(i, off): (usize, DVec3)| off.dot(normal(grid, i)).abs();
    offsets(surface, grid).into_iter().enumerate().map(along).collect()
}

/// Normal of a grid at a node, by the differences of its neighbours; zero where these have no area.
pub(super) fn normal(grid: &Grid, node: usize) -> DVec3 {
    let (row, col) = (node / grid.cols, node % grid.cols);
    let at = |row: usize, col: usize| grid.points[row * grid.cols + col];
    let along = at(row, (col + 1).min(grid.cols - 1)) - at(row, col.saturating_sub(1));
    let up = at((row + 1).min(grid.rows - 1), col) - at(row.saturating_sub(1), col);
    along.cross(up).normalize_or_zero()
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
    /// What that distance nowhere exceeds, between samples neither.
    pub gap_bound: f64,
    /// Largest angle between the two normals, ends included, degrees.
    pub angle_max_deg: f64,
    /// The same without the first knot span beside corners of less than 25 or more than 150 degrees, and without places
    /// where a surface has no normal or the grids meet at an edge.
    pub regular_angle_max_deg: f64,
    /// What that angle nowhere exceeds, between samples neither; at most a fiftieth above the largest. `None` for a seam that is
    /// meant to have an angle.
    pub regular_angle_bound_deg: Option<f64>,
    /// Ends at which a patch has such a corner.
    pub odd_ends: [bool; 2],
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
/// Surfaces must be those of the network's patches. Samples where a surface has no normal (a corner with an angle of 0, of
/// 180 degrees, or of more, where `S_u x S_v` points inwards) count for the gap only.
pub fn measure_seams(
    network: &Network,
    surfaces: &[Surface],
    observer: &dyn Observer,
) -> Result<Vec<SeamQuality>, Cancelled> {
    measure_seams_apart(network, surfaces, &[], observer)
}

/// As [`measure_seams`], with regular angles and their bound away from `edges`, at which a seam is not to be smooth
/// ([`super::edges_in_seams`]).
pub fn measure_seams_apart(
    network: &Network,
    surfaces: &[Surface],
    edges: &[EdgeInSeam],
    observer: &dyn Observer,
) -> Result<Vec<SeamQuality>, Cancelled> {
    let uses = network.uses();
    (0..uses.len())
        .into_par_iter()
        .filter(|&c| uses[c].len() == 2 && uses[c].iter().all(|&(p, _)| (p as usize) < surfaces.len()))
        .map(|c| {
            observer.check()?;
            let edges: Vec<[f64; 2]> = edges.iter().filter(|e| e.curve as usize == c).map(|e| e.range).collect();
            Ok(measure(network, surfaces, c, [uses[c][0], uses[c][1]], &edges))
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

fn measure(
    network: &Network,
    surfaces: &[Surface],
    curve: usize,
    uses: [(u32, u8); 2],
    edges: &[[f64; 2]],
) -> SeamQuality {
    let breaks = knots_along(network, surfaces, uses[0]).breaks();
    let per_span = SPAN_SAMPLES.max((SEAM_SAMPLES - 1).div_ceil(breaks.len() - 1));
    let places = span_samples(&breaks, 2 * per_span);
    let jets: Vec<[super::Jet; 2]> = places
        .iter()
        .map(|&t| {
            uses.map(|(p, k)| {
                let side = network.patches[p as usize].sides[k as usize];
                let (u, v) = place(k as usize, side.reversed, t);
                surfaces[p as usize].jet(u, v)
            })
        })
        .collect();
    let gap_max = jets.iter().map(|[a, b]| a.point.distance(b.point)).fold(0.0, f64::max);
    let corners = [0.0, 1.0].map(|t| {
        uses.map(|(p, k)| {
            let side = network.patches[p as usize].sides[k as usize];
            let (u, v) = place(k as usize, side.reversed, t);
            corner(&surfaces[p as usize], u, v)
        })
    });
    let odd_ends = corners.map(|sides| sides.iter().any(|c| c.is_none_or(|deg| !REGULAR_DEG.contains(&deg))));
    let last = jets.len() - 1;
    let angle = |at: usize| {
        let [a, b] = &jets[at];
        let end = if at == 0 { Some(0) } else { (at == last).then_some(1) };
        if end.is_some_and(|end| corners[end].iter().any(Option::is_none)) {
            return None;
        }
        let has_normal = |j: &super::Jet| j.area_vector().length() > FLAT * j.u.length() * j.v.length();
        let (na, nb) = (a.area_vector().normalize_or_zero(), b.area_vector().normalize_or_zero());
        (has_normal(a) && has_normal(b)).then(|| na.cross(nb).length().atan2(na.dot(nb)).to_degrees())
    };
    let angle_max = (0..=last).filter_map(angle).fold(0.0, f64::max);
    let ends = [[0.0, breaks[1]], [1.0, breaks[breaks.len() - 2]]];
    let [from, to] = [0, 1].map(|k| ends[k][usize::from(odd_ends[k])]);
    let ranges = without([from, to], edges);
    let regular = |at: &usize| ranges.iter().any(|[from, to]| (*from..=*to).contains(&places[*at]));
    let regular_angle_max = (0..=last).filter(regular).filter_map(angle).fold(0.0, f64::max);
    let rims = uses.map(|(p, k)| {
        let side = network.patches[p as usize].sides[k as usize];
        Rim::new(&surfaces[p as usize], k as usize, side.reversed)
    });
    let kind = network.curves[curve].kind;
    let on = |range: &[f64; 2]| angle_bound(&rims, *range, regular_angle_max.to_radians()).to_degrees();
    let bound = kind.is_smooth().then(|| ranges.iter().map(on).fold(0.0, f64::max));
    let (mut length, mut known, mut squares, mut sum) = (0.0, 0.0, 0.0, 0.0);
    for middle in (1..last).step_by(2) {
        let chord = jets[middle - 1][0].point.distance(jets[middle + 1][0].point);
        length += chord;
        if let Some(angle) = angle(middle) {
            known += chord;
            squares += chord * angle * angle;
            sum += chord * angle;
        }
    }
    let known = if known > 0.0 { known } else { 1.0 };
    SeamQuality {
        curve: curve as u32,
        kind,
        gap_max,
        gap_bound: gap_bound(&rims),
        angle_max_deg: angle_max,
        regular_angle_max_deg: regular_angle_max,
        regular_angle_bound_deg: bound,
        odd_ends,
        angle_rms_deg: (squares / known).sqrt(),
        angle_mean_deg: sum / known,
        length,
    }
}

/// A range without pieces that rise and do not overlap.
fn without([from, to]: [f64; 2], pieces: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut left = Vec::new();
    let mut at = from;
    for [a, b] in pieces {
        left.push([at, a.min(to)]);
        at = at.max(*b);
    }
    left.push([at, to]);
    left.retain(|[a, b]| a < b);
    left
}

/// Angle of a surface between its sides in its corner `(u, v)`, degrees; `None` where it is reflex or none.
fn corner(surface: &Surface, u: f64, v: f64) -> Option<f64> {
    let (to_u, to_v) = (1.0 - 2.0 * u, 1.0 - 2.0 * v);
    let (jet, inside) = (surface.jet(u, v), surface.jet(u + to_u * INSIDE, v + to_v * INSIDE));
    let area = jet.area_vector();
    let is_corner = area.length() > FLAT * jet.u.length() * jet.v.length() && area.dot(inside.area_vector()) > 0.0;
    is_corner.then(|| area.length().atan2(to_u * to_v * jet.u.dot(jet.v)).to_degrees())
}
