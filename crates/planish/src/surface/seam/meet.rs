//! At what angle two grids meet along a seam that is labelled smooth.
//!
//! A sharp line that was not found leaves seams on it that are called smooth. Where rounding them would take the surfaces far
//! from their grids they keep their angle. So each grid's normal is continued to the seam from two strips beside it, which
//! gives the angle in the data. A smooth surface has to turn by it within a knot span `h` on either side: by an arc that
//! leaves the edge by `angle h / 4`, half of it outside and half inside.

use super::miss::Misses;
use crate::grid::Grid;
use crate::network::{CurveKind, Network};
use crate::surface::Surface;
use crate::surface::basis::uniform_parameters;
use crate::surface::fold::MeanNormals;
use crate::surface::sides::{along_curve, knots_along, place};
use rayon::prelude::*;

/// Angle of two grids above which they meet at an edge, degrees: that of the sharp edges of an automatic network
/// ([`crate::layout::LayoutParams::sharp_angle_deg`]).
pub const EDGE_ANGLE_DEG: f64 = 40.0;
/// How often what a fit misses (RMS) the rounding of an edge may be: below that it is not the worst place of the fit. Largest
/// distances are 9.7 to 24 times the RMS of five measured models.
const FAR: f64 = 8.0;
/// Share of the angle of its grids above which a seam is told to have kept it.
const KEPT: f64 = 0.5;

/// Which spans of smooth seams stay sharp.
pub(crate) struct Meets {
    /// For each curve the end and the state of every knot span; none for curves that are no such seams.
    sharp: Vec<Vec<(f64, bool)>>,
}

/// A seam and its sides: patch, side and direction.
struct Seam<'a> {
    curve: usize,
    sides: [(usize, usize, bool); 2],
    /// Where knot spans begin and end.
    breaks: &'a [f64],
}

impl<'a> Seam<'a> {
    /// All of a kind with these breaks along the curves.
    fn all(network: &Network, kind: CurveKind, breaks: &'a [Vec<f64>]) -> Vec<Seam<'a>> {
        let one = |(curve, uses): (usize, &Vec<(u32, u8)>)| {
            let &[a, b] = &uses[..] else { return None };
            let side =
                |(p, k): (u32, u8)| (p as usize, k as usize, network.patches[p as usize].sides[k as usize].reversed);
            (network.curves[curve].kind == kind).then(|| Seam {
                curve,
                sides: [side(a), side(b)],
                breaks: &breaks[curve],
            })
        };
        network.uses().iter().enumerate().filter_map(one).collect()
    }

    fn spans(&self) -> std::ops::Range<usize> {
        0..self.breaks.len().saturating_sub(1)
    }

    fn middle(&self, span: usize) -> f64 {
        (self.breaks[span] + self.breaks[span + 1]) / 2.0
    }

    /// The angle between the grids in the middle of a span, radians.
    fn angle(&self, means: &[MeanNormals], span: usize) -> f64 {
        let [a, b] = self.sides.map(|(p, k, reversed)| {
            let (u, v) = place(k, reversed, self.middle(span));
            means[p].beside(k, u, v)
        });
        a.cross(b).length().atan2(a.dot(b))
    }

    /// What an arc within a knot span on either side leaves an edge of a radian by, half outside and half inside.
    fn rounding(&self, grids: &[Grid], means: &[MeanNormals], span: usize) -> f64 {
        let [a, b] = self.sides.map(|(p, k, reversed)| {
            let (grid, depth) = (&grids[p], means[p].reach(k));
            let [rim, inner] = [0, depth].map(|d| along_curve(&grid.points, grid.rows, grid.cols, k, reversed, d));
            let at = (self.middle(span) * (rim.len() - 1) as f64).round() as usize;
            rim[at].distance(inner[at])
        });
        let harmonic = if a + b > 0.0 { 2.0 * a * b / (a + b) } else { 0.0 };
        harmonic / 8.0
    }
}

impl Meets {
    /// * `breaks` - where knot spans begin and end along each curve
    /// * `misses` - what the fit misses
    pub fn new(
        network: &Network,
        grids: &[Grid],
        means: &[MeanNormals],
        breaks: &[Vec<f64>],
        misses: &Misses,
    ) -> Meets {
        let of = |seam: &Seam| -> Vec<(f64, bool)> {
            let miss = seam.sides.iter().map(|&(p, ..)| misses.afford(p) / 2.0).sum::<f64>().sqrt();
            let is_sharp = |span: usize| {
                let angle = seam.angle(means, span);
                angle > EDGE_ANGLE_DEG.to_radians() && angle * seam.rounding(grids, means, span) > FAR * miss
            };
            seam.spans().map(|span| (seam.breaks[span + 1], is_sharp(span))).collect()
        };
        let seams = Seam::all(network, CurveKind::Smooth, breaks);
        let found: Vec<Vec<(f64, bool)>> = seams.par_iter().map(of).collect();
        let mut sharp = vec![Vec::new(); network.curves.len()];
        seams.iter().zip(found).for_each(|(seam, found)| sharp[seam.curve] = found);
        Meets { sharp }
    }

    /// True if a smooth seam is to be smooth at the place `t` (0 to 1) along it.
    pub fn is_smooth(&self, curve: usize, t: f64) -> bool {
        let sharp = &self.sharp[curve];
        let at = sharp.partition_point(|(end, _)| *end <= t).min(sharp.len().saturating_sub(1));
        !sharp.get(at).is_some_and(|(_, sharp)| *sharp)
    }

    /// True if a smooth seam is to be smooth somewhere within `[from, to]`.
    pub fn is_smooth_within(&self, curve: usize, [from, to]: [f64; 2]) -> bool {
        let sharp = &self.sharp[curve];
        // By the middles of spans: those that only touch the range do not count.
        let inside = |k: usize| {
            let begin = if k == 0 { 0.0 } else { sharp[k - 1].0 };
            let middle = (begin + sharp[k].0) / 2.0;
            middle > from && middle < to
        };
        sharp.is_empty() || (0..sharp.len()).any(|k| inside(k) && !sharp[k].1)
    }
}

/// For each patch beside curves that a person calls smooth, how far rounding these takes it from its grid.
pub(crate) fn roundings(
    network: &Network,
    grids: &[Grid],
    means: &[MeanNormals],
    breaks: &[Vec<f64>],
) -> Vec<Option<f64>> {
    let mut found = vec![None; grids.len()];
    for seam in Seam::all(network, CurveKind::Rounded, breaks) {
        let needed = |span: usize| seam.angle(means, span) * seam.rounding(grids, means, span);
        let most = seam.spans().map(needed).fold(0.0, f64::max);
        for (p, ..) in seam.sides {
            found[p] = Some(found[p].map_or(most, |other: f64| other.max(most)));
        }
    }
    found
}

/// A piece of a seam that is labelled smooth, along which the grids of its patches meet at an edge and the surfaces do, too.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeInSeam {
    /// Index of the curve.
    pub curve: u32,
    /// Where it begins and ends along the curve, 0 to 1.
    pub range: [f64; 2],
    /// Largest angle between the grids there, degrees.
    pub angle_deg: f64,
}

/// Finds the pieces of smooth seams whose grids meet at more than [`EDGE_ANGLE_DEG`] and whose surfaces keep more than half of
/// that, by curve. Nothing is found without grids.
pub fn edges_in_seams(network: &Network, grids: &[Grid], surfaces: &[Surface]) -> Vec<EdgeInSeam> {
    if grids.len() != network.patches.len() || surfaces.len() != grids.len() {
        return Vec::new();
    }
    let means: Vec<MeanNormals> =
        grids.par_iter().zip(surfaces).map(|(g, s)| MeanNormals::new(g, [s.cols, s.rows])).collect();
    let breaks =
        |uses: &Vec<(u32, u8)>| uses.first().map_or_else(Vec::new, |&at| knots_along(network, surfaces, at).breaks());
    let breaks: Vec<Vec<f64>> = network.uses().iter().map(breaks).collect();
    let of = |seam: &Seam| {
        let mut found: Vec<EdgeInSeam> = Vec::new();
        for span in seam.spans() {
            let angle = seam.angle(&means, span);
            if angle <= EDGE_ANGLE_DEG.to_radians() || kept(seam, surfaces, span) <= KEPT * angle {
                continue;
            }
            let [from, to] = [seam.breaks[span], seam.breaks[span + 1]];
            let angle_deg = angle.to_degrees();
            match found.last_mut().filter(|last| last.range[1] == from) {
                Some(last) => (last.range[1], last.angle_deg) = (to, last.angle_deg.max(angle_deg)),
                None => found.push(EdgeInSeam { curve: seam.curve as u32, range: [from, to], angle_deg }),
            }
        }
        found
    };
    Seam::all(network, CurveKind::Smooth, &breaks).par_iter().flat_map_iter(of).collect()
}

/// Places of a span at which its surfaces are asked for their angle: both ends and the middle.
const ASKED: usize = 3;

/// The largest angle between the surfaces along a span, radians.
fn kept(seam: &Seam, surfaces: &[Surface], span: usize) -> f64 {
    let angle = |share: f64| {
        let t = seam.breaks[span] * (1.0 - share) + seam.breaks[span + 1] * share;
        let [a, b] = seam.sides.map(|(p, k, reversed)| {
            let (u, v) = place(k, reversed, t);
            surfaces[p].jet(u, v).area_vector().normalize_or_zero()
        });
        a.cross(b).length().atan2(a.dot(b))
    };
    uniform_parameters(ASKED).into_iter().map(angle).fold(0.0, f64::max)
}
