//! Fits of a symmetric network: surfaces behind a plane of symmetry as exact mirror images of those before it.
//!
//! 1. corners and patches are matched with their images; nothing is done unless every patch has one
//! 2. before the plane, boundaries in it are put into it exactly, and where that is asked for the control points next
//!    to them level with them: what their steps from the boundary have along its normal in the plane is taken away,
//!    and the surface has one tangent plane there
//! 3. every patch behind the plane gets the mirror image of its mate, and a patch that crosses the plane becomes its
//!    own: its control points behind the plane are images of those before it. What the shape itself lacks of symmetry
//!    goes to the reliefs.
//!
//! See `docs/methods/surfaces.md`, "Planes of symmetry".

use super::Surface;
use super::basis::{Knots, uniform_knots};
use super::sides::{node, side_len};
use crate::curve::symmetry::Plane;
use crate::geom::polyline;
use crate::grid::Grid;
use crate::mesh::TriMesh;
use crate::network::Network;
use glam::DVec3;

/// Corners and middles of sides nearer to the mirror image of others than this share of the diagonal are their images:
/// far above what a scan lacks of symmetry, far below the size of a patch.
const SAME_PLACE: f64 = 5e-3;
/// A control point next to the plane keeps at least this share of its distance from the boundary: where a patch runs
/// into the plane at a flat angle its surface would turn over there.
const LEAST_AWAY: f64 = 0.2;

/// Puts mirror images of the surfaces before `plane` (on the side of its normal) in the place of those behind it.
/// False, and nothing changed, if the network is not symmetric.
/// * `leveled` - make them level across the plane, too: before seams are smoothed, for it disturbs smooth ones
pub fn mirror_surfaces(
    mesh: &TriMesh,
    network: &Network,
    plane: &Plane,
    leveled: bool,
    surfaces: &mut [Surface],
) -> bool {
    let Some(matched) = Matched::new(mesh, network, plane) else { return false };
    if surfaces.len() != network.patches.len() {
        return false;
    }
    // A patch that is its own image across its diagonal needs as many control points along u as along v.
    let is_own = |p: usize| matched.mates[p].0 == p;
    let turns = |p: usize| matched.mates[p].1.is_multiple_of(2);
    if (0..surfaces.len()).any(|p| is_own(p) && turns(p) && surfaces[p].rows != surfaces[p].cols) {
        return false;
    }
    for p in (0..surfaces.len()).filter(|&p| is_own(p) || matched.is_before(p)) {
        if is_own(p) {
            fold_over(&mut surfaces[p], matched.mates[p].1, plane);
            continue;
        }
        flatten(&mut surfaces[p], &matched, network, plane, p);
        if leveled {
            level(&mut surfaces[p], &matched, network, plane, p);
        }
    }
    for q in (0..surfaces.len()).filter(|&q| !is_own(q) && !matched.is_before(q)) {
        surfaces[q] = image(&surfaces[matched.mates[q].0], &matched, network, plane, q);
    }
    true
}

/// The same for the nodes of grids: what is fitted to them is its own image but for rounding, and conditions that it keeps are kept
/// by the images, too.
pub fn mirror_grids(mesh: &TriMesh, network: &Network, plane: &Plane, grids: &mut [Grid]) -> bool {
    let net = |g: &Grid| Surface {
        rows: g.rows,
        cols: g.cols,
        control: g.points.clone(),
        knots_u: uniform_knots(g.cols),
        knots_v: uniform_knots(g.rows),
    };
    let mut nets: Vec<Surface> = grids.iter().map(net).collect();
    let is_mirrored = mirror_surfaces(mesh, network, plane, false, &mut nets);
    grids.iter_mut().zip(nets).for_each(|(grid, net)| grid.points = net.control);
    is_mirrored
}

/// A network with the images of its parts.
struct Matched {
    /// True for corners in the plane.
    in_plane: Vec<bool>,
    /// True for curves in the plane.
    curve_in_plane: Vec<bool>,
    /// For each patch its mate, and the corner of the mate that is the image of its first.
    mates: Vec<(usize, usize)>,
    /// Heights of the middles of the patches.
    heights: Vec<f64>,
}

impl Matched {
    fn new(mesh: &TriMesh, network: &Network, plane: &Plane) -> Option<Matched> {
        let same = SAME_PLACE * mesh.bounds().diagonal();
        let corners: Vec<DVec3> = network.corners.iter().map(|c| c.place.position(mesh)).collect();
        let images: Vec<usize> =
            corners.iter().map(|p| nearest(&corners, plane.mirror(*p), same)).collect::<Option<_>>()?;
        if (0..images.len()).any(|k| images[images[k]] != k) {
            return None;
        }
        let middles: Vec<DVec3> = network.curves.iter().map(|c| middle(mesh, c)).collect();
        let in_plane: Vec<bool> = images.iter().enumerate().map(|(k, &image)| k == image).collect();
        let on_plane = |c: usize| {
            network.curves[c].corners.iter().all(|&k| in_plane[k as usize]) && plane.height(middles[c]).abs() < same
        };
        let curve_in_plane: Vec<bool> = (0..network.curves.len()).map(on_plane).collect();
        let side = |p: usize, k: usize| network.patches[p].sides[k].curve as usize;
        let count = network.patches.len();
        let mate_of = |q: usize| {
            (0..count).find_map(|p| {
                let turned = |s: usize| {
                    (0..4).all(|k| {
                        let other = (s + 4 - k) % 4;
                        let (a, b) = (network.corner(q, k) as usize, network.corner(p, other) as usize);
                        // Side k runs from corner k; its image runs towards corner `other`.
                        let (c, d) = (side(q, k), side(p, (other + 3) % 4));
                        images[a] == b && plane.mirror(middles[c]).distance(middles[d]) < 2.0 * same
                    })
                };
                (0..4).find(|&s| turned(s)).map(|s| (p, s))
            })
        };
        let mates: Vec<(usize, usize)> = (0..count).map(mate_of).collect::<Option<_>>()?;
        if (0..count).any(|p| mates[mates[p].0].0 != p) {
            return None;
        }
        let heights: Vec<f64> =
            (0..count).map(|p| (0..4).map(|k| plane.height(middles[side(p, k)])).sum::<f64>()).collect();
        Some(Matched { in_plane, curve_in_plane, mates, heights })
    }

    fn is_before(&self, p: usize) -> bool {
        let mate = self.mates[p].0;
        self.heights[p] > self.heights[mate] || (self.heights[p] == self.heights[mate] && p < mate)
    }

    /// True if side `k` of patch `p` lies in the plane.
    fn side_in_plane(&self, network: &Network, p: usize, k: usize) -> bool {
        self.curve_in_plane[network.patches[p].sides[k].curve as usize]
    }
}

fn nearest(places: &[DVec3], p: DVec3, within: f64) -> Option<usize> {
    let all = places.iter().enumerate().map(|(k, q)| (q.distance(p), k));
    all.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).filter(|x| x.0 < within).map(|x| x.1)
}

/// The place halfway along a curve.
fn middle(mesh: &TriMesh, curve: &crate::network::Curve) -> DVec3 {
    let at: Vec<DVec3> = curve.points.iter().map(|p| p.position(mesh)).collect();
    polyline::at_length(&at, polyline::length(at.iter().copied()) / 2.0)
}

/// Control points of surface `p` that lie in the plane.
fn fixed(surface: &Surface, matched: &Matched, network: &Network, p: usize) -> Vec<usize> {
    let mut out = Vec::new();
    for k in 0..4 {
        let count = side_len(surface.rows, surface.cols, k);
        if matched.side_in_plane(network, p, k) {
            out.extend((0..count).map(|n| node(surface.rows, surface.cols, k, n, 0)));
        } else if matched.in_plane[network.corner(p, k) as usize] {
            out.push(node(surface.rows, surface.cols, k, 0, 0));
        }
    }
    out
}

/// Puts boundaries into the plane.
fn flatten(surface: &mut Surface, matched: &Matched, network: &Network, plane: &Plane, p: usize) {
    for k in fixed(surface, matched, network, p) {
        let height = plane.height(surface.control[k]);
        surface.control[k] -= plane.normal * height;
    }
}

/// Puts the control points next to boundaries in the plane level with them, but those of the curves that end there:
/// they belong to two patches.
fn level(surface: &mut Surface, matched: &Matched, network: &Network, plane: &Plane, p: usize) {
    for k in (0..4).filter(|&k| matched.side_in_plane(network, p, k)) {
        for n in 1..side_len(surface.rows, surface.cols, k) - 1 {
            let (rim, inner) = (node(surface.rows, surface.cols, k, n, 0), node(surface.rows, surface.cols, k, n, 1));
            let beside = |n: usize| surface.control[node(surface.rows, surface.cols, k, n, 0)];
            let along = (beside(n + 1) - beside(n - 1)).normalize_or_zero();
            let step = surface.control[inner] - surface.control[rim];
            let away = plane.normal.dot(step).max(LEAST_AWAY * step.length());
            surface.control[inner] = surface.control[rim] + plane.normal * away + along * step.dot(along);
        }
    }
}

/// The mirror image of the surface of the mate of patch `q`, over the parameters of `q`.
fn image(mate: &Surface, matched: &Matched, network: &Network, plane: &Plane, q: usize) -> Surface {
    let (p, s) = matched.mates[q];
    let kept = fixed(mate, matched, network, p);
    let mut control: Vec<DVec3> = mate.control.iter().map(|c| plane.mirror(*c)).collect();
    for k in kept {
        control[k] = mate.control[k];
    }
    // Corner k of q is the image of corner s - k: u and v swap where s is even.
    let swap = s.is_multiple_of(2);
    let (cols, rows) = if swap { (mate.rows, mate.cols) } else { (mate.cols, mate.rows) };
    let [turn_u, turn_v] = turned(s);
    let knots = |of: &[f64], turned: bool| match turned {
        true => Knots::of(of).reversed().list().to_vec(),
        false => of.to_vec(),
    };
    let control_at = |i: usize, j: usize| control[counterpart(mate, s, i, j)];
    let (knots_a, knots_b) = (knots(&mate.knots_u, turn_u), knots(&mate.knots_v, turn_v));
    let (knots_u, knots_v) = if swap { (knots_b, knots_a) } else { (knots_a, knots_b) };
    let control = (0..rows).flat_map(|j| (0..cols).map(move |i| (i, j))).map(|(i, j)| control_at(i, j)).collect();
    Surface { rows, cols, control, knots_u, knots_v }
}

/// Control point of `mate` whose image is `(i, j)` of a patch whose first corner is the image of corner `s` of the
/// mate.
fn counterpart(mate: &Surface, s: usize, i: usize, j: usize) -> usize {
    // The first parameter of the mate is `u` of the patch, or `v` where they swap; turned as the corners tell.
    let (a, b) = if s.is_multiple_of(2) { (j, i) } else { (i, j) };
    let [turn_u, turn_v] = turned(s);
    let a = if turn_u { mate.cols - 1 - a } else { a };
    let b = if turn_v { mate.rows - 1 - b } else { b };
    b * mate.cols + a
}

/// Whether the parameters of the mate run against those of the image.
fn turned(s: usize) -> [bool; 2] {
    [[false, false], [true, false], [true, true], [false, true]][s]
}

/// Makes the surface of a patch that crosses the plane its own image: control points behind the plane become images of
/// their counterparts before it, and those that are their own counterparts go into the plane.
fn fold_over(surface: &mut Surface, s: usize, plane: &Plane) {
    let before = surface.control.clone();
    // Of two counterparts the higher one counts; at the same height neighbours must agree which, so places decide.
    let rank = |k: usize| (plane.height(before[k]), before[k].to_array());
    for j in 0..surface.rows {
        for i in 0..surface.cols {
            let (k, other) = (j * surface.cols + i, counterpart(surface, s, i, j));
            surface.control[k] = if k == other {
                before[k] - plane.normal * plane.height(before[k])
            } else if rank(k) >= rank(other) {
                before[k]
            } else {
                plane.mirror(before[other])
            };
        }
    }
}
