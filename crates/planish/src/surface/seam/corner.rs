//! Tangent planes where smooth seams meet.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §8.1.3: the control points around a corner
//! come into one plane, the mean of the tangent planes there.
//!
//! Departs from [K98]: feature and boundary curves part a corner into sectors with a plane each.

use crate::network::Network;
use crate::surface::Surface;
use crate::surface::fold::MeanNormals;
use crate::surface::sides::place;
use glam::DVec3;

/// Largest angle between a patch's own normal and the mean of its sector, radians: beyond it (the tip of a sharp
/// cone) there is no tangent plane, and the corner stays as it is.
const MOST_SECTOR_ANGLE: f64 = 1.3;
/// Sine between two features of a sector above which they span its plane themselves.
const SPANNING_SINE: f64 = 0.5;
/// How far a plane spanned by features may lean from the mean of the tangent planes, cosine.
const LEAN_COSINE: f64 = 0.8;
/// Angles that a patch may have between its sides at a corner within smooth seams, radians: 20 to 160 degrees. At 0 and
/// 180 it has no normal there, beyond them the normal points inwards.
const WEDGE: std::ops::RangeInclusive<f64> = 0.35..=2.79;
/// The tangent plane of a sector.
#[derive(Clone, Debug)]
pub(crate) struct Plane {
    pub normal: DVec3,
    /// Directions in the plane that it may still tilt in: two where smooth seams lead all around, none where sharp
    /// curves hold it.
    pub tilts: Vec<DVec3>,
    /// Directions for the ends of curves whose own would leave a patch with an angle below zero or above 180 degrees.
    spread: Vec<((usize, usize), DVec3)>,
}

impl Plane {
    /// The unit direction in which an end of a curve must leave, if its own does not do.
    pub fn direction(&self, curve: usize, end: usize) -> Option<DVec3> {
        self.spread.iter().find(|(e, _)| *e == (curve, end)).map(|(_, d)| *d)
    }
}

/// The planes of all sectors with a smooth seam.
pub(crate) struct Planes {
    planes: Vec<Plane>,
    /// For each curve and end the sectors that it bounds or runs in.
    of_end: Vec<[Vec<usize>; 2]>,
}

impl Planes {
    /// Number of planes.
    pub fn len(&self) -> usize {
        self.planes.len()
    }

    /// The plane of this number.
    pub fn get(&self, number: usize) -> &Plane {
        &self.planes[number]
    }

    /// Numbers of the planes at an end.
    pub fn numbers(&self, curve: usize, end: usize) -> &[usize] {
        &self.of_end[curve][end]
    }

    /// Planes at an end (0 or 1) of a curve: at most one for a smooth curve, at most two for a feature.
    pub fn at(&self, curve: usize, end: usize) -> impl Iterator<Item = &Plane> {
        self.of_end[curve][end].iter().map(|&s| &self.planes[s])
    }
}

/// The direction of a curve at one of its ends, outgoing; its length is that of the first leg of the control polygon.
pub(crate) fn leg(curve: &[DVec3], end: usize) -> DVec3 {
    let n = curve.len();
    if end == 0 { curve[1] - curve[0] } else { curve[n - 2] - curve[n - 1] }
}

/// One patch at one of its corners, seen outgoing.
struct Wedge {
    /// `(curve, end)` of the two sides that meet.
    ends: [(usize, usize); 2],
    /// Unit normal, zero where there is none, and the angle between the sides.
    normal: DVec3,
    /// That of the grid around.
    grid: DVec3,
    angle: f64,
}

/// The curve ends of a patch at one of its corners: of the side that starts there, of the one before.
pub(crate) fn ends(network: &Network, patch: usize, k: usize) -> [(usize, usize); 2] {
    let (next, before) = (network.patches[patch].sides[k], network.patches[patch].sides[(k + 3) % 4]);
    [(next.curve as usize, usize::from(next.reversed)), (before.curve as usize, usize::from(!before.reversed))]
}

/// Patches around a corner, or between two sharp or boundary curves there, with smooth seams between them.
pub(crate) struct Sector {
    /// Corner `w % 4` of patch `w / 4`.
    pub wedges: Vec<usize>,
    /// Ends of the curves in and beside it, rising.
    pub ends: Vec<(usize, usize)>,
    /// True if smooth seams lead all around.
    pub closed: bool,
}

/// All sectors with a smooth seam, by their first wedge.
/// * `is_smooth` - true if a curve is to be smooth at an end (0 or 1)
pub(crate) fn sectors(network: &Network, is_smooth: &dyn Fn(usize, usize) -> bool) -> Vec<Sector> {
    let count = 4 * network.patches.len();
    let mut around: Vec<[Vec<usize>; 2]> = vec![Default::default(); network.curves.len()];
    for w in 0..count {
        ends(network, w / 4, w % 4).iter().for_each(|&(c, e)| around[c][e].push(w));
    }
    let mut root: Vec<usize> = (0..count).collect();
    fn find(root: &[usize], mut w: usize) -> usize {
        while root[w] != w {
            w = root[w];
        }
        w
    }
    let mut joined = vec![false; count];
    for (c, ends) in around.iter().enumerate() {
        for (_, list) in ends.iter().enumerate().filter(|(e, list)| list.len() > 1 && is_smooth(c, *e)) {
            for pair in list.windows(2) {
                let (a, b) = (find(&root, pair[0]), find(&root, pair[1]));
                root[a.max(b)] = a.min(b);
                joined[pair[0]] = true;
                joined[pair[1]] = true;
            }
        }
    }
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); count];
    (0..count).filter(|&w| joined[w]).for_each(|w| members[find(&root, w)].push(w));
    let sector = |wedges: Vec<usize>| {
        let mut ends: Vec<(usize, usize)> = wedges.iter().flat_map(|&w| ends(network, w / 4, w % 4)).collect();
        ends.sort_unstable();
        ends.dedup();
        let closed = ends.iter().all(|&(c, e)| is_smooth(c, e) && around[c][e].len() == 2);
        Sector { wedges, ends, closed }
    };
    members.into_iter().filter(|m| !m.is_empty()).map(sector).collect()
}

/// Finds the sectors of all corners and their planes.
/// * `surfaces` - as fitted, and as they were where they are held: a sector with such a surface has its plane
/// * `is_smooth` - as [`sectors`] has it
pub(crate) fn planes(
    network: &Network,
    surfaces: [&[Surface]; 2],
    held: &[bool],
    means: &[MeanNormals],
    curves: &[Vec<DVec3>],
    is_smooth: &dyn Fn(usize, usize) -> bool,
) -> Planes {
    let wedges: Vec<Wedge> = (0..4 * held.len())
        .map(|w| wedge(network, &surfaces[usize::from(held[w / 4])][w / 4], &means[w / 4], w / 4, w % 4))
        .collect();
    let mut found = Planes { planes: Vec::new(), of_end: vec![Default::default(); network.curves.len()] };
    for Sector { wedges: members, ends, closed } in sectors(network, is_smooth) {
        let stays: Vec<&Wedge> = members.iter().filter(|&&w| held[w / 4]).map(|&w| &wedges[w]).collect();
        let sector: Vec<&Wedge> = members.iter().map(|&w| &wedges[w]).collect();
        let found_plane = match stays.is_empty() {
            true => plane(&sector, &ends, closed, curves, is_smooth),
            false => plane(&stays, &[], false, curves, is_smooth),
        };
        if let Some(plane) = found_plane {
            for (c, e) in ends {
                found.of_end[c][e].push(found.planes.len());
            }
            found.planes.push(plane);
        }
    }
    found
}

fn wedge(network: &Network, surface: &Surface, means: &MeanNormals, patch: usize, k: usize) -> Wedge {
    let (u, v) = place(k, false, 0.0);
    let jet = surface.jet(u, v);
    let (to_u, to_v) = (1.0 - 2.0 * u, 1.0 - 2.0 * v);
    Wedge {
        ends: ends(network, patch, k),
        normal: means.mend(jet.area_vector(), u, v),
        grid: means.at(u, v),
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
            let d = leg(&curves[c], e);
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

fn plane(
    sector: &[&Wedge],
    ends: &[(usize, usize)],
    closed: bool,
    curves: &[Vec<DVec3>],
    is_smooth: &dyn Fn(usize, usize) -> bool,
) -> Option<Plane> {
    let within = |own: fn(&Wedge) -> DVec3, normal: DVec3| {
        sector.iter().all(|w| own(w) == DVec3::ZERO || own(w).dot(normal) >= MOST_SECTOR_ANGLE.cos())
    };
    let mean_of = |own: fn(&Wedge) -> DVec3| sector.iter().map(|w| own(w) * w.angle).sum::<DVec3>().try_normalize();
    // A fit may turn over in a corner; its grid then still tells how the surface stands there.
    let mean = [(|w: &Wedge| w.normal) as fn(&Wedge) -> DVec3, |w: &Wedge| w.grid]
        .into_iter()
        .find_map(|own| mean_of(own).filter(|mean| within(own, *mean)))?;
    let tangents: Vec<DVec3> =
        ends.iter().filter(|&&(c, e)| !is_smooth(c, e)).map(|&(c, e)| leg(&curves[c], e).normalize_or_zero()).collect();
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
    let (x, y) = normal.any_orthonormal_pair();
    let tilts = if closed { vec![x, y] } else { Vec::new() };
    let spread = if ends.is_empty() { Vec::new() } else { spread(sector, normal, curves) };
    Some(Plane { normal, tilts, spread })
}
