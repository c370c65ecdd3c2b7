//! Tangent planes and curvature where smooth seams meet.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §8.1.3: the control points around a corner
//! come into one plane, the mean of the tangent planes there.
//!
//! Departs from [K98]: feature and boundary curves part a corner into sectors with a plane each; and every sector also
//! gets one second fundamental form, so that the normals along its seams start with a turn that agrees. Without
//! that two seams ask different things of the twist control point between them, and the angle stays large near the
//! corner whatever the resolution.

use super::Surface;
use super::fold::MeanNormals;
use super::sides::{is_smooth, place};
use crate::network::Network;
use glam::{DMat3, DVec3};

/// Largest angle between a patch's own normal and the mean of its sector, radians: beyond it (the tip of a sharp
/// cone) there is no tangent plane, and the corner stays as it is.
const MOST_SECTOR_ANGLE: f64 = 1.3;
/// Sine between two features of a sector above which they span its plane themselves.
const SPANNING_SINE: f64 = 0.5;
/// How far a plane spanned by features may lean from the mean of the tangent planes, cosine.
const LEAN_COSINE: f64 = 0.8;
/// Largest turn of the normal within the first knot span, radians: more cannot be told from noise. Seams are not
/// made to bend by it then, and the normals turn by this much.
const MOST_SPAN_TURN: f64 = 1.0;
/// Angles that a patch may have between its sides at a corner within smooth seams, radians: 20 to 160 degrees. At 0 and
/// 180 it has no normal there, beyond them the normal points inwards.
const WEDGE: std::ops::RangeInclusive<f64> = 0.35..=2.79;
/// Weight of "no curvature" in the second fundamental form, against one for each seam: only decides for sectors
/// too thin to say.
const CALM: f64 = 1e-6;

/// The tangent plane of a sector with its second fundamental form.
#[derive(Clone, Debug)]
pub(crate) struct Plane {
    pub normal: DVec3,
    axes: [DVec3; 2],
    /// `L, M, N` in `axes`.
    form: DVec3,
    /// Directions for the ends of curves whose own would leave a patch with an angle below zero or above 180 degrees.
    spread: Vec<((usize, usize), DVec3)>,
    /// False where the seams bend too fast for their knots to be told how.
    pub credible: bool,
}

impl Plane {
    /// Normal curvature form of a direction: `II(d, d)`.
    pub fn bend(&self, d: DVec3) -> f64 {
        let (x, y) = (self.axes[0].dot(d), self.axes[1].dot(d));
        self.form.dot(DVec3::new(x * x, 2.0 * x * y, y * y))
    }

    /// How the normal turns along `d`: minus the shape operator.
    pub fn turn(&self, d: DVec3) -> DVec3 {
        let (x, y) = (self.axes[0].dot(d), self.axes[1].dot(d));
        -self.axes[0] * (self.form.x * x + self.form.y * y) - self.axes[1] * (self.form.y * x + self.form.z * y)
    }

    /// The unit direction in which an end of a curve must leave, if its own does not do.
    pub fn direction(&self, curve: usize, end: usize) -> Option<DVec3> {
        self.spread.iter().find(|(e, _)| *e == (curve, end)).map(|(_, d)| *d)
    }

    /// The part of `d` in the plane.
    pub fn flatten(&self, d: DVec3) -> DVec3 {
        d - self.normal * self.normal.dot(d)
    }
}

/// The planes of all sectors with a smooth seam.
pub(crate) struct Planes {
    planes: Vec<Plane>,
    /// For each curve and end the sectors that it bounds or runs in.
    of_end: Vec<[Vec<usize>; 2]>,
}

impl Planes {
    /// Planes at an end (0 or 1) of a curve: at most one for a smooth curve, at most two for a feature.
    pub fn at(&self, curve: usize, end: usize) -> impl Iterator<Item = &Plane> {
        self.of_end[curve][end].iter().map(|&s| &self.planes[s])
    }
}

/// First derivative at an end of a curve, outgoing, and second derivative.
pub(crate) fn end_derivatives(curve: &[DVec3], end: usize) -> (DVec3, DVec3) {
    let n = curve.len();
    let c = |k: usize| curve[if end == 0 { k } else { n - 1 - k }];
    let (first, second) = end_weights(n);
    (c(0) * first[0] + c(1) * first[1], c(0) * second[0] + c(1) * second[1] + c(2) * second[2])
}

/// Weights of the first control points in the first and second derivative at an end.
pub(crate) fn end_weights(n: usize) -> ([f64; 2], [f64; 3]) {
    let (_, [_, first, second]) = super::basis::basis_at(&super::basis::uniform_knots(n), 0.0);
    ([first[0], first[1]], [second[0], second[1], second[2]])
}

/// One patch at one of its corners, seen outgoing.
struct Wedge {
    /// `(curve, end)` of the two sides that meet.
    ends: [(usize, usize); 2],
    u: DVec3,
    v: DVec3,
    twist: DVec3,
    /// Unit normal, zero where there is none, and the angle between the sides.
    normal: DVec3,
    angle: f64,
}

/// Finds the sectors of all corners and their planes.
pub(crate) fn planes(network: &Network, surfaces: &[Surface], means: &[MeanNormals], curves: &[Vec<DVec3>]) -> Planes {
    let wedges: Vec<Wedge> =
        (0..4 * surfaces.len()).map(|w| wedge(network, &surfaces[w / 4], &means[w / 4], w / 4, w % 4)).collect();
    let mut around: Vec<[Vec<usize>; 2]> = vec![Default::default(); network.curves.len()];
    for (w, wedge) in wedges.iter().enumerate() {
        wedge.ends.iter().for_each(|&(c, e)| around[c][e].push(w));
    }
    let mut root: Vec<usize> = (0..wedges.len()).collect();
    fn find(root: &[usize], mut w: usize) -> usize {
        while root[w] != w {
            w = root[w];
        }
        w
    }
    let mut joined = vec![false; wedges.len()];
    for (_, ends) in network.curves.iter().zip(&around).filter(|(c, _)| is_smooth(c)) {
        for list in ends.iter().filter(|list| list.len() > 1) {
            for pair in list.windows(2) {
                let (a, b) = (find(&root, pair[0]), find(&root, pair[1]));
                root[a.max(b)] = a.min(b);
                joined[pair[0]] = true;
                joined[pair[1]] = true;
            }
        }
    }
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); wedges.len()];
    (0..wedges.len()).filter(|&w| joined[w]).for_each(|w| members[find(&root, w)].push(w));
    let mut found = Planes { planes: Vec::new(), of_end: vec![Default::default(); network.curves.len()] };
    for sector in members.iter().filter(|m| !m.is_empty()) {
        let mut ends: Vec<(usize, usize)> = sector.iter().flat_map(|&w| wedges[w].ends).collect();
        ends.sort_unstable();
        ends.dedup();
        let sector: Vec<&Wedge> = sector.iter().map(|&w| &wedges[w]).collect();
        if let Some(plane) = plane(network, &sector, &ends, curves) {
            for (c, e) in ends {
                found.of_end[c][e].push(found.planes.len());
            }
            found.planes.push(plane);
        }
    }
    found
}

fn wedge(network: &Network, surface: &Surface, means: &MeanNormals, patch: usize, k: usize) -> Wedge {
    let (next, before) = (network.patches[patch].sides[k], network.patches[patch].sides[(k + 3) % 4]);
    let (u, v) = place(k, false, 0.0);
    let jet = surface.jet(u, v);
    let (to_u, to_v) = (1.0 - 2.0 * u, 1.0 - 2.0 * v);
    Wedge {
        ends: [
            (next.curve as usize, usize::from(next.reversed)),
            (before.curve as usize, usize::from(!before.reversed)),
        ],
        u: jet.u * to_u,
        v: jet.v * to_v,
        twist: jet.uv * to_u * to_v,
        normal: means.mend(jet.area_vector(), u, v),
        angle: jet.area_vector().length().atan2(to_u * to_v * jet.u.dot(jet.v)),
    }
}

/// New directions for the curves around a corner inside smooth seams where the angle of a patch is out of bounds:
/// the angles nearest to the given ones that are within them and add up to a full turn. Empty if all is well, or if
/// the sector does not close.
fn spread(sector: &[&Wedge], normal: DVec3, curves: &[Vec<DVec3>]) -> Vec<((usize, usize), DVec3)> {
    use std::f64::consts::{FRAC_PI_2, TAU};
    let n = sector.len();
    let mut order = vec![0];
    while order.len() < n {
        let last = sector[order[order.len() - 1]].ends[1];
        match (1..n).find(|k| !order.contains(k) && sector[*k].ends[0] == last) {
            Some(next) => order.push(next),
            None => return Vec::new(),
        }
    }
    if n < 3 || sector[order[n - 1]].ends[1] != sector[0].ends[0] {
        return Vec::new();
    }
    let (x, y) = normal.any_orthonormal_pair();
    let bearing: Vec<f64> = order
        .iter()
        .map(|&w| {
            let (c, e) = sector[w].ends[0];
            let d = end_derivatives(&curves[c], e).0;
            normal.dot(x.cross(y)).signum() * d.dot(y).atan2(d.dot(x))
        })
        .collect();
    // From -90 to 270 degrees: a patch turned over has a small negative angle, one bent outwards more than 180.
    let angle = |k: usize| (bearing[(k + 1) % n] - bearing[k] + FRAC_PI_2).rem_euclid(TAU) - FRAC_PI_2;
    let angles: Vec<f64> = (0..n).map(angle).collect();
    if angles.iter().all(|a| WEDGE.contains(a)) {
        return Vec::new();
    }
    let moved = |shift: f64| angles.iter().map(move |a| (a + shift).clamp(*WEDGE.start(), *WEDGE.end()));
    let (mut low, mut high) = (-TAU, TAU);
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if moved(middle).sum::<f64>() < TAU { low = middle } else { high = middle }
    }
    let mut ends = Vec::new();
    let (mut at, mut turns, mut bearings) = (bearing[0], DVec3::ZERO, Vec::new());
    for (k, step) in moved(low).enumerate() {
        bearings.push(at);
        turns += DVec3::new((bearing[k] - at).cos(), (bearing[k] - at).sin(), 0.0);
        at += step;
    }
    let turn = turns.y.atan2(turns.x);
    for (&w, bearing) in order.iter().zip(bearings) {
        let (sin, cos) = (bearing + turn).sin_cos();
        ends.push((sector[w].ends[0], x * cos + y * (normal.dot(x.cross(y)).signum() * sin)));
    }
    ends
}

fn plane(network: &Network, sector: &[&Wedge], ends: &[(usize, usize)], curves: &[Vec<DVec3>]) -> Option<Plane> {
    let mean = sector.iter().map(|w| w.normal * w.angle).sum::<DVec3>().try_normalize()?;
    let tangents: Vec<DVec3> = ends
        .iter()
        .filter(|(c, _)| !is_smooth(&network.curves[*c]))
        .map(|&(c, e)| end_derivatives(&curves[c], e).0.normalize_or_zero())
        .collect();
    let normal = match tangents[..] {
        [a, b] => {
            let across = a.cross(b);
            let spanned = across.normalize_or_zero() * across.dot(mean).signum();
            if across.length() > SPANNING_SINE && spanned.dot(mean) > LEAN_COSINE {
                spanned
            } else {
                let along = (a - b).normalize_or_zero();
                (mean - along * along.dot(mean)).try_normalize().filter(|n| n.dot(mean) > LEAN_COSINE).unwrap_or(mean)
            }
        }
        _ => mean,
    };
    if sector.iter().any(|w| w.normal != DVec3::ZERO && w.normal.dot(normal) < MOST_SECTOR_ANGLE.cos()) {
        return None;
    }
    let (x, y) = normal.any_orthonormal_pair();
    let mut plane =
        Plane { normal, axes: [x, y], form: DVec3::ZERO, spread: spread(sector, normal, curves), credible: true };
    // Least squares for L, M, N from the seams' normal curvature and the patches' twist.
    // The form's own norm, L² + 2 M² + N², does not depend on the axes.
    let (mut matrix, mut rhs) = (DMat3::from_diagonal(DVec3::new(1.0, 2.0, 1.0) * CALM), DVec3::ZERO);
    let mut row = |a: DVec3, b: DVec3, value: f64| {
        let scale = a.length() * b.length();
        if scale > 0.0 {
            let (a, b) = ((a.dot(x), a.dot(y)), (b.dot(x), b.dot(y)));
            let row = DVec3::new(a.0 * b.0, a.0 * b.1 + a.1 * b.0, a.1 * b.1) / scale;
            matrix += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
            rhs += row * (value / scale);
        }
    };
    for &(c, e) in ends {
        let (first, second) = end_derivatives(&curves[c], e);
        row(first, first, normal.dot(second));
    }
    for wedge in sector {
        row(wedge.u, wedge.v, normal.dot(wedge.twist));
    }
    plane.form = matrix.inverse() * rhs;
    // What a noisy or very coarse fit says of curvature may be a fold within its first span.
    let steepest = ends
        .iter()
        .map(|&(c, e)| plane.turn(end_derivatives(&curves[c], e).0).length() / (curves[c].len() - 3) as f64)
        .fold(0.0, f64::max);
    plane.credible = steepest <= MOST_SPAN_TURN;
    plane.form *= (MOST_SPAN_TURN / steepest).min(1.0);
    plane.form.is_finite().then_some(plane)
}
