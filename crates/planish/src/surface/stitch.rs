//! Seams smoothed: patches on both sides of a smooth seam get one tangent plane along it, those on a sharp edge the angle of
//! their grids.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §8.1.3.
//! 1. a plane for each corner - `corner`      2. curves that respect it, a normal along each - `seam_curve`
//! 3. the ring of control points inside a patch's boundary turned into those normals
//! 4. everything further inside fitted again for that
//!
//! On a sharp edge each patch has normals of its own, those of its grid within a knot span: a fit swings there, by what
//! bends further inside and by the noise of the edge.
//!
//! Departs from [K98]: there the seam's control point is moved onto the line between its two neighbours at equal
//! spacing, which is exact, but asks every seam to leave a corner as the continuation of another; around corners of
//! valence 3, 5 or more it cannot. Here both patches are fitted to one field of normals instead: least squares over
//! the ring, whose miss falls with the fourth power of the knot spacing. With simple knots it does not vanish around
//! corners of valence other than 4 (Peters and Fan): the seams are smooth within the angle that `measure_seams`
//! tells.

use super::basis::{basis_at, is_uniform, uniform_knots, uniform_parameters};
use super::corner::{Plane, Planes, planes};
use super::fit::{Directions, project_net, solve_inside, surface_of};
use super::fold::{MeanNormals, folds};
use super::network_fit::{fill, patch_directions};
use super::seam_curve::{SPAN_SAMPLES, constrain, normals, own_normals};
use super::sides::{along_curve, check, check_grids, is_smooth, node, place, side_len};
use super::{FitError, Surface};
use crate::grid::Grid;
use crate::linalg::{Banded, BandedCholesky};
use crate::network::{CurveKind, Network, Patch};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Diagonals of the ring's matrix: samples couple four neighbours of three numbers, and folding the ring into a
/// line doubles the distance.
const RING_BAND: usize = 23;

/// Share of the way of a feature's curve that the rows of control points beside it go along, itself first: the slopes across it
/// stay.
const FOLLOW: [f64; 3] = [1.0, 1.0, 0.5];

/// Share of the stiffness that features have: where they end at a smooth seam, that comes first.
const ANGLES: f64 = 0.3;

/// What the stiffness is multiplied by, one after the other, while a patch comes out folded.
const EASING: [f64; 4] = [1.0, 0.3, 0.1, 0.0];

/// How to smooth seams.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StitchParams {
    /// How much a radian of angle between normals counts against moving a control point by its distance from the
    /// seam. Large values give smaller angles, small ones leave the fit as it is.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub stiffness: f64,
}

impl Default for StitchParams {
    /// 30: angles fall by a decade and the fit loses a tenth to a third of its accuracy near the seams.
    fn default() -> StitchParams {
        StitchParams { stiffness: 30.0 }
    }
}

/// Gives the patches on both sides of every smooth seam one tangent plane along it, as nearly as simple knots can, and
/// those on both sides of a feature seam the slopes of their grids.
///
/// * `grids` - those that `surfaces` were fitted to
/// * `surfaces` - as [`super::fit_network`] returns them
///
/// Corners stay where they are and seams stay without gaps; control points near seams move and all others are fitted again
/// for that. A network without seams comes back as it is.
///
/// # Errors
/// Lists that do not fit the network or each other, knots that are not uniform, or the observer's wish.
///
/// Source: [K98] §8.1.3.
pub fn stitch(
    network: &Network,
    grids: &[Grid],
    surfaces: &[Surface],
    params: &StitchParams,
    observer: &dyn Observer,
) -> Result<Vec<Surface>, FitError> {
    if !(params.stiffness >= 0.0 && params.stiffness.is_finite()) {
        return Err(FitError::Parameter { name: "stiffness", value: params.stiffness, wanted: "0 or more" });
    }
    let Some(work) = Work::new(network, grids, surfaces)? else { return Ok(surfaces.to_vec()) };
    let stop = || observer.check();
    let curves = work.curves();
    stop()?;
    let filled = work.filled(&curves, observer)?;
    observer.progress(0.5);
    let fields = work.fields(&filled, &curves)?;
    stop()?;
    let stitched = (0..filled.len())
        .into_par_iter()
        .map(|p| work.turned(p, &filled[p], &work.targets(p, &fields, &curves, params.stiffness)))
        .collect();
    stop()?;
    observer.progress(1.0);
    Ok(stitched)
}

/// The network at work: what all steps ask.
struct Work<'a> {
    network: &'a Network,
    grids: &'a [Grid],
    surfaces: &'a [Surface],
    /// For each curve the patches on it and their sides.
    uses: Vec<Vec<(u32, u8)>>,
    /// Points of the grids and control points along every curve.
    nodes: Vec<usize>,
    counts: Vec<usize>,
    directions: Directions,
    means: Vec<MeanNormals>,
    /// Curves as fitted, and the planes at their ends.
    fitted: Vec<Vec<DVec3>>,
    planes: Planes,
}

/// A patch fitted inside its moved curves, and the projection of its grid that all its nets share.
struct Filled {
    surface: Surface,
    projection: Vec<DVec3>,
}

impl<'a> Work<'a> {
    /// `None` if no two patches meet.
    fn new(network: &'a Network, grids: &'a [Grid], surfaces: &'a [Surface]) -> Result<Option<Work<'a>>, FitError> {
        let nodes = check_grids(network, grids)?;
        let shapes: Vec<_> = surfaces.iter().map(|s| (s.rows, s.cols, s.control.len())).collect();
        let counts = check(network, "surfaces", &shapes)?;
        surfaces.iter().try_for_each(Surface::check)?;
        let uneven = |s: &Surface| !is_uniform(&s.knots_u) || !is_uniform(&s.knots_v);
        if let Some(patch) = surfaces.iter().position(uneven) {
            return Err(FitError::Knots { patch });
        }
        let uses = network.uses();
        if !uses.iter().any(|uses| uses.len() == 2) {
            return Ok(None);
        }
        let directions = Directions::new(nodes.iter().zip(&counts).filter(|(n, _)| **n > 0).map(|(&n, &c)| (n, c)))?;
        let curve = |uses: &Vec<(u32, u8)>| {
            uses.first().map_or_else(Vec::new, |&(p, k)| {
                let (s, side) = (&surfaces[p as usize], network.patches[p as usize].sides[k as usize]);
                along_curve(&s.control, s.rows, s.cols, k as usize, side.reversed, 0)
            })
        };
        let fitted: Vec<Vec<DVec3>> = uses.iter().map(curve).collect();
        let means: Vec<MeanNormals> =
            grids.par_iter().zip(surfaces).map(|(g, s)| MeanNormals::new(g, [s.cols, s.rows])).collect();
        let planes = planes(network, surfaces, &means, &fitted);
        Ok(Some(Work { network, grids, surfaces, uses, nodes, counts, directions, means, fitted, planes }))
    }

    fn is_seam(&self, curve: usize, kind: CurveKind) -> bool {
        self.network.curves[curve].kind == kind && self.uses[curve].len() == 2
    }

    /// The curves, moved so that they respect the planes at their ends.
    fn curves(&self) -> Vec<Vec<DVec3>> {
        let one = |c: usize| {
            if self.uses[c].is_empty() {
                return Vec::new();
            }
            let ends: [Vec<Plane>; 2] = [0, 1].map(|e| self.planes.at(c, e).cloned().collect());
            // How a feature bends is its own affair: by the planes of two faces at once it would leave its nodes, and the
            // patches beside it would turn their slopes after it.
            let bends = is_smooth(&self.network.curves[c]);
            constrain(c, &self.fitted[c], ends, bends, self.directions.get(self.nodes[c], self.counts[c]))
        };
        (0..self.uses.len()).into_par_iter().map(one).collect()
    }

    /// The patches with their inside fitted to the moved curves: what the normals are taken from.
    fn filled(&self, curves: &[Vec<DVec3>], observer: &dyn Observer) -> Result<Vec<Filled>, FitError> {
        let one = |(p, patch): (usize, &Patch)| {
            if observer.cancelled() {
                return None;
            }
            let [along_u, along_v] = patch_directions(patch, &self.grids[p], &self.directions, &self.counts);
            let projection = project_net(&follow(self.network, p, &self.surfaces[p], curves), along_u, along_v);
            let net = fill(patch, curves, &projection, along_u, along_v);
            Some(Filled { surface: surface_of(net, along_u, along_v), projection })
        };
        self.network.patches.par_iter().enumerate().map(one).collect::<Option<_>>().ok_or(Cancelled.into())
    }

    /// The normals along every smooth seam; none along other curves.
    fn fields(&self, filled: &[Filled], curves: &[Vec<DVec3>]) -> Result<Vec<Vec<DVec3>>, FitError> {
        let one = |c: usize| match self.uses[c][..] {
            [a, b] if self.is_seam(c, CurveKind::Smooth) => {
                let normal = |(p, k): (u32, u8), t: f64| {
                    let (p, k) = (p as usize, k as usize);
                    let (u, v) = place(k, self.network.patches[p].sides[k].reversed, t);
                    self.means[p].mend(filled[p].surface.jet(u, v).area_vector(), u, v)
                };
                normals(c, &curves[c], &self.planes, |t| [a, b].into_iter().map(|at| normal(at, t)).sum())
            }
            _ => Ok(Vec::new()),
        };
        // The first error by number of the curve, whichever thread finds its own first.
        let found: Vec<Result<Vec<DVec3>, FitError>> = (0..self.uses.len()).into_par_iter().map(one).collect();
        found.into_iter().collect()
    }

    /// What the four sides of a patch are to be like.
    fn targets(&self, patch: usize, fields: &[Vec<DVec3>], curves: &[Vec<DVec3>], stiffness: f64) -> [Target; 4] {
        std::array::from_fn(|k| {
            let side = self.network.patches[patch].sides[k];
            let c = side.curve as usize;
            let (mut normals, stiffness) = if self.is_seam(c, CurveKind::Feature) {
                (own_normals(&self.means[patch], k, side.reversed, &curves[c]), ANGLES * stiffness)
            } else {
                (fields[c].clone(), stiffness)
            };
            if side.reversed {
                normals.reverse();
            }
            Target { normals, stiffness }
        })
    }

    /// A patch with its ring turned into the normals, as far as it does not fold by that.
    fn turned(&self, patch: usize, filled: &Filled, targets: &[Target; 4]) -> Surface {
        let Filled { surface, projection } = filled;
        let grid = &self.grids[patch];
        let [along_u, along_v] = patch_directions(&self.network.patches[patch], grid, &self.directions, &self.counts);
        let mut best = surface.clone();
        let mut fewest = usize::MAX;
        for easing in EASING {
            let mut net = surface.control.clone();
            turn_ring(&mut net, along_v.control(), along_u.control(), targets, easing);
            solve_inside(&mut net, projection, along_u, along_v, 2);
            let surface = surface_of(net, along_u, along_v);
            let count = folds(&surface, grid);
            if count < fewest {
                (best, fewest) = (surface, count);
            }
            if fewest == 0 {
                break;
            }
        }
        best
    }
}

/// The control net of a patch with what is on and beside its features moved along with their curves.
fn follow(network: &Network, patch: usize, surface: &Surface, curves: &[Vec<DVec3>]) -> Vec<DVec3> {
    let Surface { rows, cols, control, .. } = surface;
    let mut net = control.clone();
    for (k, side) in network.patches[patch].sides.iter().enumerate() {
        if is_smooth(&network.curves[side.curve as usize]) {
            continue;
        }
        let curve = &curves[side.curve as usize];
        let n = side_len(*rows, *cols, k);
        // Not beyond the middle: the other side moves as its own curve does.
        let deepest = side_len(*rows, *cols, k + 1).div_ceil(2);
        for i in 0..n {
            let way = curve[if side.reversed { n - 1 - i } else { i }] - control[node(*rows, *cols, k, i, 0)];
            for (depth, share) in FOLLOW.into_iter().enumerate().take(deepest) {
                net[node(*rows, *cols, k, i, depth)] += way * share;
            }
        }
    }
    net
}

/// What a surface is to be like along a side.
struct Target {
    /// Normals at even parameters, in the direction of the side; none where it is free.
    normals: Vec<DVec3>,
    /// How much they count, as in [`StitchParams`].
    stiffness: f64,
}

/// Moves the ring of control points next to the boundary so that along every side the derivative across it is
/// perpendicular to the normals there, and as little as that allows.
/// * `easing` - share of the stiffness of the targets
fn turn_ring(net: &mut [DVec3], rows: usize, cols: usize, targets: &[Target; 4], easing: f64) {
    let mut ring = Vec::new();
    let mut rank = vec![usize::MAX; net.len()];
    for k in 0..4 {
        for i in 1..side_len(rows, cols, k) - 1 {
            let at = node(rows, cols, k, i, 1);
            if rank[at] == usize::MAX {
                rank[at] = ring.len();
                ring.push(at);
            }
        }
    }
    // Fold the ring into a line: 0, L-1, 1, L-2, ...
    let length = ring.len();
    let mut reach = vec![f64::INFINITY; length];
    for r in rank.iter_mut().filter(|r| **r != usize::MAX) {
        *r = if *r < length.div_ceil(2) { 2 * *r } else { 2 * (length - 1 - *r) + 1 };
    }
    let mut matrix = Banded::zero(3 * length, RING_BAND.min(3 * length - 1));
    let mut rhs = vec![0.0; 3 * length];
    let mut any = false;
    for (k, target) in targets.iter().enumerate() {
        let n = side_len(rows, cols, k);
        for i in 1..n - 1 {
            let (rim, inner) = (node(rows, cols, k, i, 0), node(rows, cols, k, i, 1));
            let entry = &mut reach[rank[inner]];
            *entry = entry.min(net[rim].distance(net[inner]));
        }
        if target.normals.is_empty() {
            continue;
        }
        any = true;
        let knots = uniform_knots(n);
        for (t, &normal) in uniform_parameters(target.normals.len()).into_iter().zip(&target.normals) {
            let (first, [weights, ..]) = basis_at(&knots, t);
            let across: DVec3 = (0..4)
                .map(|a| {
                    let (rim, inner) = (node(rows, cols, k, first + a, 0), node(rows, cols, k, first + a, 1));
                    (net[inner] - net[rim]) * weights[a]
                })
                .sum();
            let size = across.length_squared();
            if size == 0.0 {
                continue;
            }
            let weight = (target.stiffness * easing).powi(2) / (size * SPAN_SAMPLES as f64);
            for a in (0..4).filter(|a| (1..n - 1).contains(&(first + a))) {
                let i = 3 * rank[node(rows, cols, k, first + a, 1)];
                for x in 0..3 {
                    rhs[i + x] -= weight * weights[a] * normal[x] * across.dot(normal);
                }
                for b in (0..4).filter(|b| (1..n - 1).contains(&(first + b))) {
                    let j = 3 * rank[node(rows, cols, k, first + b, 1)];
                    for x in 0..3 {
                        for y in (0..3).filter(|y| i + x >= j + y) {
                            matrix.add(i + x, j + y, weight * weights[a] * weights[b] * normal[x] * normal[y]);
                        }
                    }
                }
            }
        }
    }
    let longest = reach.iter().copied().fold(0.0, f64::max);
    if !any || longest == 0.0 {
        return;
    }
    for (r, reach) in reach.iter().enumerate() {
        // A control point that lies on the boundary may move as one at a thousandth of the longest reach.
        let hold = reach.max(1e-3 * longest).powi(-2);
        (0..3).for_each(|x| matrix.add(3 * r + x, 3 * r + x, hold));
    }
    if let Some(factor) = BandedCholesky::factor(matrix) {
        factor.solve(&mut rhs);
        for at in ring {
            let r = 3 * rank[at];
            net[at] += DVec3::new(rhs[r], rhs[r + 1], rhs[r + 2]);
        }
    }
}
