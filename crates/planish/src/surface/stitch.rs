//! Smooth seams: one system of least squares over the outer control points of the whole network.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §8.1.3.
//!
//! Unknown are the moves, along the normal, of the control points on smooth seams and in the ring beside all sides; the
//! inside follows as the fit has it. What they cost the fit and what is left of the angles is minimised together:
//!
//! ```text
//! sum over patches  (RMS of the move / loss)^2  +  sum over seams  weight (RMS angle / tolerance)^2
//! ```
//!
//! The angle is linearised (Gauss-Newton) and the weight of a seam is raised while it misses the tolerance and its
//! patches can afford it. No control point moves by more than its place can afford ([`Places`]). Control points next to a corner move as one plane. Departs from [K98], which moves every control
//! point of a seam onto the line between its neighbours: around corners of other than four patches that cannot be.

use super::basis::{Knots, uniform_parameters};
use super::bend::{Side, Stand, fold_angle};
use super::corner::{Plane, Planes, leg, planes};
use super::fit::{Directions, project_net, solve_inside, surface_of};
use super::fold::{MeanNormals, folds};
use super::network_fit::{fill, patch_directions};
use super::places::Places;
use super::quality::distances;
use super::ring::Condensed;
use super::seam_curve::constrain;
use super::sides::{along_curve, check, check_grids, diagonal, is_smooth, knots, node, side_len};
use super::{FitError, Surface};
use crate::grid::Grid;
use crate::linalg::SparseCholesky;
use crate::network::{CurveKind, Network, Patch};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Share of the way of a feature's curve that the rows of control points beside it go along, itself first: the slopes across it
/// stay.
const FOLLOW: [f64; 3] = [1.0, 1.0, 0.5];
/// Samples of the angle per knot span: products of the cubics of both sides have no more extremes.
const SPAN_SAMPLES: usize = 5;
/// Rounds of the system: a Gauss-Newton step doubles the digits, so three settle it once weights stay.
const FEWEST_ROUNDS: usize = 3;
const ROUNDS: usize = 20;
/// Rounds at the end, in which no weight of a seam is raised any more.
const LAST_ROUNDS: usize = 8;
/// Weights of a seam: at 1 the tolerance of the angle all along it costs what its patches can afford to lose. It begins where
/// the angles of a fit (degrees where the tolerance is hundredths) cost no more than that, and ends where the angle is in
/// effect a condition.
const FIRST_WEIGHT: f64 = 1e-3;
const MOST_WEIGHT: f64 = 1e4;
/// Weight that seams around a folded patch keep at least: a hundredth of the first.
const LEAST_WEIGHT: f64 = 1e-5;
/// What a seam's weight is raised by while it misses the tolerance.
const RAISE: f64 = 3.0;
/// From weight 1 on a raise has to bring the angle of a seam below this share of what it was, or it is the last.
const HELPS: f64 = 0.95;
/// Share of the tolerance that the RMS of the angle along a seam may have.
const RMS_SHARE: f64 = 0.4;
/// How often its share of the loss a single patch may lose while the whole has not lost its own.
const LOCAL: f64 = 2.0;
/// How often its share a single place may lose: at a share of a fifth it moves by about what the fit misses there anyhow.
const PLACE: f64 = 4.0;
/// What a place may lose however near the fit is there, of the diagonal: a hundredth of what a fit misses by default. Corners of
/// other than four patches ask single control points for more than the rest, and of a fit that near nobody sees it.
const NEGLIGIBLE: f64 = 1e-5;
/// What the weights around a folded patch are lowered by, and how often.
const EASE: f64 = 0.1;
const EASINGS: usize = 4;
/// Passes in which patches that turned over get their curves back: neighbours may turn over in turn.
const REVERTS: usize = 3;
/// The loss is measured against a fit that misses by this share of the diagonal at least: rounding.
const EXACT: f64 = 1e-9;
/// What a round's move as long as the way to the next row of control points costs: turns beyond what is linearised take
/// several rounds.
const HOLD: f64 = 1.0;
/// Largest angle along a seam that is linearised, radians; above, both sides turn towards the mean of their normals.
const AIMED: f64 = 0.1;
/// No unknown.
const NONE: u32 = u32::MAX;

/// How to smooth seams.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StitchParams {
    /// Largest angle between the normals along smooth seams, degrees.
    #[schemars(extend("exclusiveMinimum" = 0.0, "unit" = "degrees"))]
    pub angle_tolerance: f64,
    /// Largest angle by which a sharp seam's sides may turn from the normals of their own grids, degrees.
    #[schemars(extend("exclusiveMinimum" = 0.0, "unit" = "degrees"))]
    pub sharp_tolerance: f64,
    /// Share by which the RMS distance of the fit may grow for the seams' sake.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub fit_loss: f64,
    /// Read from models of earlier versions, and not used.
    #[serde(skip_serializing)]
    #[schemars(skip)]
    pub stiffness: Option<f64>,
}

impl Default for StitchParams {
    /// .05 degrees, which reflections do not show; a degree for sharp seams; a tenth.
    fn default() -> StitchParams {
        StitchParams { angle_tolerance: 0.05, sharp_tolerance: 1.0, fit_loss: 0.1, stiffness: None }
    }
}

impl StitchParams {
    fn check(&self) -> Result<(), FitError> {
        let above = |name, value: f64, wanted, is: bool| match is && value.is_finite() {
            true => Ok(()),
            false => Err(FitError::Parameter { name, value, wanted }),
        };
        above("angle_tolerance", self.angle_tolerance, "above 0", self.angle_tolerance > 0.0)?;
        above("sharp_tolerance", self.sharp_tolerance, "above 0", self.sharp_tolerance > 0.0)?;
        above("fit_loss", self.fit_loss, "0 or more", self.fit_loss >= 0.0)
    }
}

/// Gives the patches on both sides of every smooth seam one tangent plane along it, to the tolerance of the angle where the fit
/// can afford it, and those on both sides of a feature seam the slopes of their grids.
///
/// * `grids` - those that `surfaces` were fitted to
/// * `surfaces` - as [`super::fit_network`] returns them
///
/// Corners stay where they are and seams stay without gaps; control points near seams move and all others are fitted again
/// for that. A network without seams comes back as it is.
///
/// # Errors
/// Lists that do not fit the network or each other, knots that are neither simple nor double at equal steps, or the observer's
/// wish.
///
/// Source: [K98] §8.1.3.
pub fn stitch(
    network: &Network,
    grids: &[Grid],
    surfaces: &[Surface],
    params: &StitchParams,
    observer: &dyn Observer,
) -> Result<Vec<Surface>, FitError> {
    params.check()?;
    let Some(work) = Work::new(network, grids, surfaces)? else { return Ok(surfaces.to_vec()) };
    observer.check()?;
    let before: Vec<usize> = surfaces.par_iter().zip(grids).map(|(s, g)| folds(s, g)).collect();
    let mut curves = work.curves();
    let mut filled = work.filled(&curves, observer)?;
    for _ in 0..REVERTS {
        let worse = |p: &usize| folds(&filled[*p].surface, &grids[*p]) > before[*p];
        let worse: Vec<usize> = (0..filled.len()).into_par_iter().filter(worse).collect();
        if worse.is_empty() {
            break;
        }
        // A patch that its planes turn over keeps its curves.
        for c in worse.iter().flat_map(|&p| network.patches[p].sides).map(|side| side.curve as usize) {
            curves[c].clone_from(&work.fitted[c]);
        }
        filled = work.filled(&curves, observer)?;
    }
    observer.progress(0.2);
    let mut system = System::new(&work, &filled, &curves, params);
    for easing in 0..=EASINGS {
        system.settle(observer)?;
        let made: Vec<Surface> = (0..filled.len()).into_par_iter().map(|p| system.surface(p)).collect();
        let worse: Vec<usize> =
            (0..made.len()).into_par_iter().filter(|&p| folds(&made[p], &grids[p]) > before[p]).collect();
        observer.progress(0.2 + 0.8 * (easing + 1) as f64 / (EASINGS + 1) as f64);
        if worse.is_empty() || easing == EASINGS {
            observer.progress(1.0);
            return Ok(made);
        }
        system.ease(&worse);
    }
    unreachable!("the last easing returns")
}

/// The network at work: what all steps ask.
struct Work<'a> {
    network: &'a Network,
    grids: &'a [Grid],
    surfaces: &'a [Surface],
    /// For each curve the patches on it and their sides.
    uses: Vec<Vec<(u32, u8)>>,
    /// Points of the grids and control points along every curve, and its knots.
    nodes: Vec<usize>,
    counts: Vec<usize>,
    kinds: Vec<Knots>,
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
        let all: Vec<usize> = (0..surfaces.len()).collect();
        let kinds = knots(network, surfaces, &all)?;
        let uses = network.uses();
        if !uses.iter().any(|uses| uses.len() == 2) {
            return Ok(None);
        }
        let layouts = (0..nodes.len()).filter(|&c| nodes[c] > 0).map(|c| (nodes[c], counts[c], kinds[c]));
        let directions = Directions::new(layouts)?;
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
        Ok(Some(Work { network, grids, surfaces, uses, nodes, counts, kinds, directions, means, fitted, planes }))
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
            let direction = self.directions.get((self.nodes[c], self.counts[c], self.kinds[c]));
            constrain(c, &self.fitted[c], &ends, direction)
        };
        (0..self.uses.len()).into_par_iter().map(one).collect()
    }

    /// The patches with their inside fitted to the moved curves: what moves are counted from.
    fn filled(&self, curves: &[Vec<DVec3>], observer: &dyn Observer) -> Result<Vec<Filled>, FitError> {
        let one = |(p, patch): (usize, &Patch)| {
            if observer.cancelled() {
                return None;
            }
            let [along_u, along_v] = self.along(p);
            let projection = project_net(&follow(self.network, p, &self.surfaces[p], curves), along_u, along_v);
            let net = fill(patch, curves, &projection, along_u, along_v);
            Some(Filled { surface: surface_of(net, along_u, along_v), projection })
        };
        self.network.patches.par_iter().enumerate().map(one).collect::<Option<_>>().ok_or(Cancelled.into())
    }

    /// The directions of a patch.
    fn along(&self, patch: usize) -> [&super::fit::Direction; 2] {
        let (shape, grid) = (&self.network.patches[patch], &self.grids[patch]);
        patch_directions(shape, grid, &self.directions, &self.counts, &self.kinds)
    }

    /// A side of a patch as its curve sees it.
    fn side(&self, (patch, k): (u32, u8)) -> Side {
        let (patch, side) = (patch as usize, k as usize);
        let s = &self.surfaces[patch];
        let crossing = if side.is_multiple_of(2) { &s.knots_v } else { &s.knots_u };
        let reversed = self.network.patches[patch].sides[side].reversed;
        Side { patch, side, reversed, rows: s.rows, cols: s.cols, across: 3.0 / crossing[4] }
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

/// How a control point moves: at most two unknowns with their directions.
type Motion = [(u32, DVec3); 2];
const FIXED: Motion = [(NONE, DVec3::ZERO); 2];

fn terms(motion: &Motion) -> impl Iterator<Item = (usize, DVec3)> {
    motion.iter().filter(|(unknown, _)| *unknown != NONE).map(|&(unknown, way)| (unknown as usize, way))
}

/// What is asked along a curve: of the two sides of a smooth seam together, of one side of a sharp one by its grid.
struct Wish {
    sides: Vec<Side>,
    knots: Vec<f64>,
    /// Normals at the samples, for a side of a sharp seam.
    own: Vec<DVec3>,
    samples: Vec<f64>,
    tolerance: f64,
    weight: f64,
    /// Largest weight that it may have, and the angle before it was last raised.
    ceiling: f64,
    last: f64,
    /// True while the angle is too large for its linearisation.
    aims: bool,
}

/// An angle and how it changes: `(patch, control point, gradient)`.
struct Turn {
    angle: f64,
    trust: f64,
    gradient: Vec<(usize, usize, DVec3)>,
}

impl Wish {
    /// The angle at sample `s`; `None` where a side has no tangent plane.
    fn turn(&self, nets: &[Vec<DVec3>], means: &[MeanNormals], s: usize) -> Option<Turn> {
        let t = self.samples[s];
        let stands: Vec<Stand> =
            self.sides.iter().map(|side| side.stand(&nets[side.patch], &self.knots, t)).collect::<Option<_>>()?;
        let angle = match &stands[..] {
            [a, b] => fold_angle(a, b),
            [a, ..] => a.inward.dot(self.own[s]).atan2(a.normal.dot(self.own[s])),
            [] => return None,
        };
        let trust = self.sides.iter().zip(&stands).map(|(side, s)| side.trust(s, means, t)).fold(1.0, f64::min);
        let gradient = self.sides.iter().zip(&stands);
        let gradient = gradient.flat_map(|(side, s)| s.turn.iter().map(|&(c, way)| (side.patch, c, way))).collect();
        Some(Turn { angle, trust, gradient })
    }

    /// The angles of both sides of a seam with the mean of their normals at sample `s`, each made credible by its grid.
    fn aims(&self, nets: &[Vec<DVec3>], means: &[MeanNormals], s: usize) -> Vec<Turn> {
        let t = self.samples[s];
        let mended = |side: &Side| {
            let (u, v) = super::sides::place(side.side, side.reversed, t);
            let normal = side.stand(&nets[side.patch], &self.knots, t).map_or(DVec3::ZERO, |stand| stand.normal);
            means[side.patch].mend(normal, u, v)
        };
        let Some(aim) = self.sides.iter().map(mended).sum::<DVec3>().try_normalize() else { return Vec::new() };
        let one = |side: &Side| {
            let stand = side.stand_towards(&nets[side.patch], &self.knots, t, Some(aim))?;
            let gradient = stand.turn.iter().map(|&(c, way)| (side.patch, c, way)).collect();
            // Twice the squares of the halves are the square of the whole.
            Some(Turn { angle: stand.inward.dot(aim), trust: 2.0 * side.trust(&stand, means, t), gradient })
        };
        self.sides.iter().filter_map(one).collect()
    }

    /// Largest angle where a normal is to be trusted, and the sum of the trusted squares.
    fn angles(&self, nets: &[Vec<DVec3>], means: &[MeanNormals]) -> (f64, f64) {
        let all = (0..self.samples.len()).filter_map(|s| self.turn(nets, means, s));
        all.fold((0.0, 0.0), |(most, squares), t| {
            (if t.trust == 1.0 { t.angle.abs().max(most) } else { most }, squares + t.trust * t.angle * t.angle)
        })
    }
}

/// The system: what is unknown, what is asked, and where it stands.
struct System<'a> {
    work: &'a Work<'a>,
    filled: &'a [Filled],
    condensed: Vec<Arc<Condensed>>,
    unknowns: usize,
    motions: Vec<Vec<Motion>>,
    wishes: Vec<Wish>,
    nets: Vec<Vec<DVec3>>,
    /// For each patch the squared move that it can afford, times its nodes.
    afford: Vec<f64>,
    places: Vec<Places>,
    share: f64,
    /// For each unknown one over the square of the move that is as long as the way to the next row of control points.
    holds: Vec<f64>,
}

impl<'a> System<'a> {
    fn new(work: &'a Work<'a>, filled: &'a [Filled], curves: &[Vec<DVec3>], params: &StitchParams) -> System<'a> {
        let shapes: BTreeMap<_, _> = (0..filled.len()).map(|p| (shape(work, p), p)).collect();
        let one = |(shape, p): (_, usize)| {
            let [along_u, along_v] = work.along(p);
            (shape, Arc::new(Condensed::new(along_u, along_v)))
        };
        let condensed: BTreeMap<_, Arc<Condensed>> = shapes.into_iter().map(one).collect();
        let condensed: Vec<Arc<Condensed>> = (0..filled.len()).map(|p| condensed[&shape(work, p)].clone()).collect();
        let (unknowns, motions) = motions(work, filled, curves);
        let nets = filled.iter().map(|f| f.surface.control.clone()).collect();
        let nodes = |p: usize| work.grids[p].points.len() as f64;
        let at_nodes: Vec<Vec<f64>> = (work.surfaces.par_iter().zip(work.grids))
            .map(|(s, g)| distances(s, g).into_iter().map(|d| d * d).collect())
            .collect();
        let squares: Vec<f64> = at_nodes.iter().map(|squares| squares.iter().sum()).collect();
        let count: f64 = (0..filled.len()).map(nodes).sum();
        let mean = squares.iter().sum::<f64>() / count + (EXACT * diagonal(work.grids)).powi(2);
        let afford = (0..filled.len()).map(|p| (squares[p] + mean * nodes(p)) / 2.0).collect();
        let share = (1.0 + params.fit_loss).powi(2) - 1.0;
        let negligible = (NEGLIGIBLE * diagonal(work.grids)).powi(2);
        let places = |p: usize| {
            let cols = work.grids[p].cols;
            let allowed = |around: f64| PLACE * share * (around + mean) / 2.0 + negligible;
            Places::new(&work.surfaces[p], &at_nodes[p], cols, &condensed[p], allowed)
        };
        let places = (0..filled.len()).into_par_iter().map(places).collect();
        let holds = holds(filled, unknowns, &motions);
        let wishes = wishes(work, curves, params);
        System { work, filled, condensed, unknowns, motions, wishes, nets, afford, places, share, holds }
    }

    /// Moves of the outer control points of a patch.
    fn moves(&self, p: usize) -> Vec<DVec3> {
        let from = &self.filled[p].surface.control;
        self.condensed[p].outer.iter().map(|&c| self.nets[p][c] - from[c]).collect()
    }

    /// True if no place has lost more than it may.
    fn places_keep(&self) -> bool {
        (0..self.nets.len()).into_par_iter().all(|p| self.places[p].keep(&self.moves(p)))
    }

    /// Changes the weights of all places by what they lost.
    fn weigh(&mut self) {
        let moves: Vec<Vec<DVec3>> = (0..self.nets.len()).into_par_iter().map(|p| self.moves(p)).collect();
        self.places.par_iter_mut().zip(&moves).for_each(|(places, moves)| places.weigh(moves));
    }

    /// Squared move of a patch over what it can afford.
    fn cost(&self, p: usize) -> f64 {
        let condensed = &self.condensed[p];
        let moves = self.moves(p);
        let row = |r: usize| moves[r].dot(condensed.row(r).iter().zip(&moves).map(|(k, m)| *m * *k).sum());
        (0..moves.len()).map(row).sum::<f64>() / self.afford[p]
    }

    /// Squared move of the whole over what it can afford.
    fn spent(&self) -> f64 {
        let costs: Vec<f64> = (0..self.nets.len()).into_par_iter().map(|p| self.cost(p) * self.afford[p]).collect();
        costs.iter().sum::<f64>() / self.afford.iter().sum::<f64>()
    }

    /// Solves until all seams meet the tolerance or none can be raised further.
    fn settle(&mut self, observer: &dyn Observer) -> Result<(), FitError> {
        if self.unknowns == 0 {
            return Ok(());
        }
        for round in 0..ROUNDS {
            observer.check()?;
            for wish in &mut self.wishes {
                wish.aims = wish.own.is_empty() && wish.angles(&self.nets, &self.work.means).0 > AIMED;
            }
            self.step(observer)?;
            let costs: Vec<f64> = (0..self.nets.len()).into_par_iter().map(|p| self.cost(p)).collect();
            let found: Vec<(f64, f64)> =
                self.wishes.par_iter().map(|w| w.angles(&self.nets, &self.work.means)).collect();
            let mut raised = false;
            let spent = self.spent() >= self.share;
            for (wish, (most, squares)) in self.wishes.iter_mut().zip(found) {
                let rms = (squares / wish.samples.len() as f64).sqrt();
                let missed = most > wish.tolerance || rms > RMS_SHARE * wish.tolerance;
                // A seam that turns far may fold its patches over; it does not get more than they can afford.
                let bound = if spent {
                    0.0
                } else if wish.aims {
                    self.share
                } else {
                    LOCAL * self.share
                };
                let helps = wish.weight < 1.0 || most.max(rms) < HELPS * wish.last;
                if missed && helps && wish.weight < wish.ceiling && wish.sides.iter().all(|s| costs[s.patch] < bound) {
                    wish.weight = (wish.weight * RAISE).min(wish.ceiling);
                    wish.last = most.max(rms);
                    raised = true;
                }
            }
            if !raised && round + 1 >= FEWEST_ROUNDS {
                break;
            }
            self.weigh();
        }
        // The last raises may have cost more than there was, in the whole or in some places.
        for round in 0..ROUNDS {
            let spent = self.spent() > self.share;
            if !spent && (round >= LAST_ROUNDS || self.places_keep()) {
                break;
            }
            observer.check()?;
            if spent {
                for wish in &mut self.wishes {
                    wish.weight /= RAISE.sqrt();
                }
            }
            self.weigh();
            self.step(observer)?;
        }
        Ok(())
    }

    /// One round of Gauss-Newton.
    fn step(&mut self, observer: &dyn Observer) -> Result<(), FitError> {
        let patches: Vec<Terms> = (0..self.nets.len()).into_par_iter().map(|p| self.fit_terms(p)).collect();
        let seams: Vec<Terms> = self.wishes.par_iter().map(|w| self.seam_terms(w)).collect();
        let mut lower = Vec::new();
        let mut rhs = vec![0.0; self.unknowns];
        for (k, hold) in self.holds.iter().enumerate() {
            lower.push((k, k, HOLD * hold));
        }
        for (matrix, side) in patches.into_iter().chain(seams) {
            lower.extend(matrix);
            side.into_iter().for_each(|(k, value)| rhs[k] += value);
        }
        let unknowns = self.unknowns;
        let factor = SparseCholesky::factor_watched(unknowns, lower, &|| observer.cancelled()).ok_or(Cancelled)?;
        let factor = factor.map_err(|_| FitError::Unsolvable { unknowns })?;
        factor.solve(&mut rhs);
        for (net, motions) in self.nets.iter_mut().zip(&self.motions) {
            for (place, motion) in net.iter_mut().zip(motions) {
                *place = terms(motion).fold(*place, |at, (k, way)| at + way * rhs[k]);
            }
        }
        Ok(())
    }

    /// The part of the normal equations that one patch adds.
    fn fit_terms(&self, p: usize) -> Terms {
        let (condensed, motions) = (&self.condensed[p], &self.motions[p]);
        let all = condensed.outer.iter().flat_map(|&c| terms(&motions[c])).map(|(k, _)| k);
        let mut sums = Sums::new(all.collect());
        let ranked: Vec<Vec<(usize, DVec3)>> = condensed
            .outer
            .iter()
            .map(|&c| terms(&motions[c]).map(|(k, way)| (sums.rank(k), way / self.afford[p].sqrt())).collect())
            .collect();
        let moves: Vec<DVec3> = self.moves(p).into_iter().map(|m| m / self.afford[p].sqrt()).collect();
        let mut row = Vec::new();
        for (r, own) in ranked.iter().enumerate().filter(|(_, own)| !own.is_empty()) {
            row.clear();
            row.extend_from_slice(condensed.row(r));
            row[r] *= self.places[p].weights[r];
            let force: DVec3 = moves.iter().zip(&row).map(|(m, k)| *m * *k).sum();
            for &(a, way) in own {
                sums.rhs[a] -= way.dot(force);
                for (others, k) in ranked.iter().zip(&row) {
                    for &(b, other) in others.iter().filter(|(b, _)| *b <= a) {
                        sums.add(a, b, k * way.dot(other));
                    }
                }
            }
        }
        sums.done()
    }

    fn seam_terms(&self, wish: &Wish) -> Terms {
        let scale = wish.weight / 2.0 / (wish.samples.len() as f64 * wish.tolerance.powi(2));
        let turns = |s: usize| match wish.aims {
            true => wish.aims(&self.nets, &self.work.means, s),
            false => wish.turn(&self.nets, &self.work.means, s).into_iter().collect(),
        };
        let turns: Vec<Turn> = match scale > 0.0 {
            true => (0..wish.samples.len()).flat_map(turns).filter(|t| t.trust > 0.0).collect(),
            false => Vec::new(),
        };
        let rows: Vec<Vec<(usize, f64)>> = turns
            .iter()
            .map(|turn| {
                let parts = turn.gradient.iter();
                parts
                    .flat_map(|&(p, c, gradient)| {
                        terms(&self.motions[p][c]).map(move |(k, way)| (k, gradient.dot(way)))
                    })
                    .collect()
            })
            .collect();
        let mut sums = Sums::new(rows.iter().flatten().map(|&(k, _)| k).collect());
        for (turn, row) in turns.iter().zip(&rows) {
            let weight = scale * turn.trust;
            let row: Vec<(usize, f64)> = row.iter().map(|&(k, x)| (sums.rank(k), x)).collect();
            for &(a, x) in &row {
                sums.rhs[a] -= weight * x * turn.angle;
                row.iter().filter(|(b, _)| *b <= a).for_each(|&(b, y)| sums.add(a, b, weight * x * y));
            }
        }
        sums.done()
    }

    /// Lowers the weights around some patches, and starts there anew.
    fn ease(&mut self, patches: &[usize]) {
        for wish in self.wishes.iter_mut().filter(|w| w.sides.iter().any(|s| patches.contains(&s.patch))) {
            wish.ceiling = (wish.weight.min(1.0) * EASE).max(LEAST_WEIGHT);
        }
        for wish in &mut self.wishes {
            (wish.weight, wish.last) = (FIRST_WEIGHT.min(wish.ceiling), f64::INFINITY);
        }
        self.places.iter_mut().for_each(Places::reset);
        self.nets = self.filled.iter().map(|f| f.surface.control.clone()).collect();
    }

    /// The surface of a patch with its inside fitted again.
    fn surface(&self, p: usize) -> Surface {
        let [along_u, along_v] = self.work.along(p);
        let mut net = self.nets[p].clone();
        solve_inside(&mut net, &self.filled[p].projection, along_u, along_v, 2);
        surface_of(net, along_u, along_v)
    }
}

/// Normal equations of a few unknowns.
struct Sums {
    /// The unknowns, rising.
    unknowns: Vec<usize>,
    /// Lower triangle of a square matrix, row-major.
    matrix: Vec<f64>,
    rhs: Vec<f64>,
}

impl Sums {
    fn new(mut unknowns: Vec<usize>) -> Sums {
        unknowns.sort_unstable();
        unknowns.dedup();
        let n = unknowns.len();
        Sums { unknowns, matrix: vec![0.0; n * n], rhs: vec![0.0; n] }
    }

    /// The number of an unknown among these.
    fn rank(&self, unknown: usize) -> usize {
        self.unknowns.partition_point(|&u| u < unknown)
    }

    fn add(&mut self, row: usize, column: usize, value: f64) {
        self.matrix[row * self.rhs.len() + column] += value;
    }

    fn done(self) -> Terms {
        let n = self.rhs.len();
        let lower = (0..n).flat_map(|a| (0..=a).map(move |b| (a, b)));
        let lower = lower.map(|(a, b)| (self.unknowns[a], self.unknowns[b], self.matrix[a * n + b])).collect();
        (lower, self.unknowns.iter().copied().zip(self.rhs.iter().copied()).collect())
    }
}

/// What a part adds to the normal equations: lower triangle and right side.
type Terms = (Vec<(usize, usize, f64)>, Vec<(usize, f64)>);

fn shape(work: &Work, p: usize) -> [super::fit::Layout; 2] {
    work.along(p).map(|d| (d.basis.len(), d.control(), d.kind))
}

/// The Greville abscissa of a control point: where it pulls most.
fn greville(knots: &[f64], i: usize) -> f64 {
    (knots[i + 1] + knots[i + 2] + knots[i + 3]) / 3.0
}

/// The number of unknowns and the motions of all control points.
fn motions(work: &Work, filled: &[Filled], curves: &[Vec<DVec3>]) -> (usize, Vec<Vec<Motion>>) {
    let mut count = 0u32;
    let mut next = || {
        count += 1;
        count - 1
    };
    let normal = |p: usize, u: f64, v: f64| work.means[p].mend(filled[p].surface.jet(u, v).area_vector(), u, v);
    let tilts: Vec<Vec<u32>> =
        (0..work.planes.len()).map(|k| work.planes.get(k).tilts.iter().map(|_| next()).collect()).collect();
    let mut motions: Vec<Vec<Motion>> = filled.iter().map(|f| vec![FIXED; f.surface.control.len()]).collect();
    for c in (0..work.uses.len()).filter(|&c| work.is_seam(c, CurveKind::Smooth)) {
        let n = work.counts[c];
        let knots = work.kinds[c].list(n);
        for i in 1..n - 1 {
            let end = if i == 1 { Some(0) } else { (i == n - 2).then_some(1) };
            let plane = end.and_then(|e| Some((e, *work.planes.numbers(c, e).first()?)));
            let motion = match plane {
                Some((e, number)) => {
                    let (plane, leg) = (work.planes.get(number), leg(&curves[c], e));
                    let mut motion = FIXED;
                    for (slot, (&unknown, axis)) in motion.iter_mut().zip(tilts[number].iter().zip(&plane.tilts)) {
                        *slot = (unknown, plane.normal * axis.dot(leg));
                    }
                    motion
                }
                None => {
                    let both = work.uses[c].iter().map(|&at| {
                        let side = work.side(at);
                        let (u, v) = super::sides::place(side.side, side.reversed, greville(&knots, i));
                        normal(side.patch, u, v)
                    });
                    [(next(), both.sum::<DVec3>().normalize_or(DVec3::Z)), (NONE, DVec3::ZERO)]
                }
            };
            for &at in &work.uses[c] {
                let side = work.side(at);
                motions[side.patch][side.node(i, 0)] = motion;
            }
        }
    }
    for (p, f) in filled.iter().enumerate() {
        let s = &f.surface;
        for j in 1..s.rows - 1 {
            for i in (1..s.cols - 1).filter(|&i| j == 1 || j == s.rows - 2 || i == 1 || i == s.cols - 2) {
                let way = normal(p, greville(&s.knots_u, i), greville(&s.knots_v, j));
                motions[p][j * s.cols + i] = [(next(), way), (NONE, DVec3::ZERO)];
            }
        }
    }
    (count as usize, motions)
}

/// For each unknown the sum of squares of what it moves over the distances to the next row of control points.
fn holds(filled: &[Filled], unknowns: usize, motions: &[Vec<Motion>]) -> Vec<f64> {
    let mut holds = vec![0.0; unknowns];
    for (Filled { surface, .. }, motions) in filled.iter().zip(motions) {
        let (rows, cols, net) = (surface.rows, surface.cols, &surface.control);
        for k in 0..4 {
            let n = side_len(rows, cols, k);
            let longest = (0..n).map(|i| step(net, rows, cols, k, i)).fold(0.0, f64::max);
            for i in 0..n {
                // Rows may touch; a thousandth of the longest step keeps the hold finite.
                let reach = step(net, rows, cols, k, i).max(1e-3 * longest);
                for depth in 0..2 {
                    for (unknown, way) in terms(&motions[node(rows, cols, k, i, depth)]).filter(|_| reach > 0.0) {
                        holds[unknown] += (way.length() / reach).powi(2);
                    }
                }
            }
        }
    }
    holds
}

/// Distance between the outer two rows along a side.
fn step(net: &[DVec3], rows: usize, cols: usize, side: usize, i: usize) -> f64 {
    net[node(rows, cols, side, i, 0)].distance(net[node(rows, cols, side, i, 1)])
}

/// What is asked along all seams.
fn wishes(work: &Work, curves: &[Vec<DVec3>], params: &StitchParams) -> Vec<Wish> {
    let mut wishes = Vec::new();
    for (curve, uses) in work.uses.iter().enumerate().filter(|(_, uses)| uses.len() == 2) {
        let n = work.counts[curve];
        let knots = work.kinds[curve].list(n);
        let samples = uniform_parameters(SPAN_SAMPLES * work.kinds[curve].spans(n) + 1);
        let sides: Vec<Side> = uses.iter().map(|&at| work.side(at)).collect();
        let wish = |sides: Vec<Side>, own: Vec<DVec3>, tolerance: f64| {
            let (knots, samples) = (knots.clone(), samples.clone());
            Wish {
                sides,
                knots,
                own,
                samples,
                tolerance: tolerance.to_radians(),
                weight: FIRST_WEIGHT,
                ceiling: MOST_WEIGHT,
                last: f64::INFINITY,
                aims: false,
            }
        };
        if is_smooth(&work.network.curves[curve]) {
            wishes.push(wish(sides, Vec::new(), params.angle_tolerance));
        } else {
            for side in sides {
                let own = own_normals(&work.means[side.patch], &side, &knots, &curves[curve], &samples);
                wishes.push(wish(vec![side], own, params.sharp_tolerance));
            }
        }
    }
    wishes
}

/// Unit normals along one side of a patch, perpendicular to its curve: those of the patch's own grid,
/// continued to it.
fn own_normals(means: &MeanNormals, side: &Side, knots: &[f64], control: &[DVec3], samples: &[f64]) -> Vec<DVec3> {
    let along = super::basis::BasisRows::new(knots, samples, 1);
    let one = |(s, &t): (usize, &f64)| {
        let (u, v) = super::sides::place(side.side, side.reversed, t);
        let tangent: DVec3 = (0..4).map(|a| control[along.first[s] + a] * along.weights[s][a]).sum();
        let (tangent, field) = (tangent.normalize_or_zero(), means.at(u, v));
        (field - tangent * tangent.dot(field)).try_normalize().unwrap_or(field)
    };
    samples.iter().enumerate().map(one).collect()
}
