//! Snakes: surface curves that relax under fairness, stiffness, even spacing and the pull of a scalar.
//!
//! [K98] §3.5 to 3.8, eq. 3.5 to 3.16. With `C_i = (v_{i-1} + v_{i+1}) / 2 - v_i`, all in the tangent plane:
//!   F_fair = C_i     F_curv = 2 C_i - C_{i-1} - C_{i+1}     F_arc = (|t_max| - |t_other|) t_max / |t_max| / 2
//! and the sum over the distances 2^r (eq. 3.16) lets every point feel the whole curve at once.
//!
//! Departs from [K98]:
//! - eq. 3.15 is taken with the absolute difference and half the step; as printed points run off or overshoot;
//! - all distances 2^r count alike, not by 2^-r: with that a bend over m points goes by one part in m a sweep only;
//! - the coarse forces rest where chords over many points balance, which on a curved surface is not where the fine
//!   ones do. They bring the curve near; the last sweeps solve the fine forces together (Gauss-Newton on moves in
//!   the tangent planes, a banded system), so the rest is that of the energy and takes a few sweeps;
//! - tangent planes are those of blended vertex normals, not of single faces, which scatter on scans;
//! - the pull of a scalar is a step to its ridge along the normal of the curve, so that its weight does not depend
//!   on the units of the scalar.

mod even;

use super::chain::SurfaceCurve;
use super::{CurveError, ScalarField};
use crate::geom::is_positive;
use crate::linalg::{Banded, BandedCholesky};
use crate::mesh::{Adjacency, FacePoint, TriMesh, move_point_on_surface};
use crate::observe::Observer;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Explicit steps go this far along the forces: below the bound for the highest frequency of all terms together.
const EXPLICIT_STEP: f64 = 0.45;
/// Largest eigenvalues of the terms, against F_fair: they bound the explicit step.
const STIFFEST: f64 = 4.0;
/// Coarse-to-fine sweeps hand over to the fine solve when the largest move has not fallen by this factor in
/// [`STALL`] sweeps.
const STALL_FACTOR: f64 = 0.7;
const STALL: usize = 3;
/// Coarse-to-fine sweeps at most: an impulse crosses the curve in one.
const COARSE_SWEEPS: usize = 24;
/// Least damping of the fine solve as a share of its mean diagonal; where it leads nowhere (a free loop slides along
/// itself under no force at all, and bending surfaces are felt by the forces but not by the system) the damping grows
/// by steps to the greatest, as of Levenberg and Marquardt.
const DAMPING: f64 = 1e-9;
const DAMPING_STEP: f64 = 1e3;
const GREATEST_DAMPING: f64 = 1e2;
/// Share by which the damping falls again after a sweep that went well.
const RELIEF: f64 = 0.1;
/// Shares of a fine step that are tried until one lowers the energy.
const SHARES: [f64; 2] = [1.0, 0.3];
/// Longest fine move, in mean spacings of the points: beyond, tangent planes tell little.
const LONGEST_MOVE: f64 = 24.0;
/// Longest step to the ridge of a scalar, in mean spacings.
const RIDGE_STEP: f64 = 1.0;
/// "No slot", "no face".
const NONE: u32 = u32::MAX;

/// How points are moved in one sweep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sweep {
    /// By the forces of their next neighbours. The plain way; its sweeps grow with the square of the points.
    Single,
    /// By the forces of neighbours at all distances 2^r, then by fine solves.
    #[default]
    CoarseToFine,
    /// By fine solves alone.
    Solve,
}

/// Weights and limits of a relaxation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SnakeParams {
    /// Weight of shortness: an elastic band.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub fairness: f64,
    /// Weight of stiffness: a wire that spreads its bends; the curve is tangent-continuous at the ends of a section.
    #[schemars(range(min = 0.0, max = 1_000_000.0))]
    pub curvature: f64,
    /// Weight of even spacing.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub arc_length: f64,
    /// Weight of the pull of a scalar.
    #[schemars(range(min = 0.0, max = 1_000_000.0))]
    pub attraction: f64,
    /// How points are moved.
    pub sweep: Sweep,
    /// Sweeps at most.
    #[schemars(range(min = 1, max = 10_000_000))]
    pub sweeps: usize,
    /// Done when no point moves further in a sweep than this.
    #[schemars(range(min = 1e-12, max = 1.0), extend("unit" = "spacing"))]
    pub settle: f64,
}

impl Default for SnakeParams {
    fn default() -> SnakeParams {
        SnakeParams {
            fairness: 1.0,
            curvature: 0.0,
            arc_length: 1.0,
            attraction: 0.0,
            sweep: Sweep::CoarseToFine,
            sweeps: 200,
            settle: 1e-4,
        }
    }
}

/// A stretch of a curve with its own weights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Section {
    /// First point.
    pub first: usize,
    /// Number of points; on a closed curve they may run over its start.
    pub count: usize,
    /// Factor on the weight of fairness.
    pub fairness: f64,
    /// Factor on the weight of curvature.
    pub curvature: f64,
}

/// Energy of a snake by its terms, world units squared, weights included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Energy {
    /// `K_fair / 4` times the sum of squared distances of neighbours.
    pub fairness: f64,
    /// `K_curv` times the sum of the squared tangential `C_i`.
    pub curvature: f64,
    /// `K_arc / 4` times the sum of squared differences of neighbouring distances.
    pub arc_length: f64,
}

impl Energy {
    /// All terms together.
    pub fn total(&self) -> f64 {
        self.fairness + self.curvature + self.arc_length
    }
}

/// What a relaxation did.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Relaxed {
    /// Sweeps made.
    pub sweeps: usize,
    /// Those of them that were fine solves.
    pub solves: usize,
    /// Energy before and after.
    pub energy: [Energy; 2],
    /// Largest move of the last sweep, in mean spacings.
    pub last_move: f64,
    /// True if the curve has come to rest within the limits.
    pub settled: bool,
}

/// A surface curve under forces.
#[derive(Clone)]
pub struct Snake<'m> {
    mesh: &'m TriMesh,
    adjacency: &'m Adjacency,
    field: Option<&'m ScalarField>,
    closed: bool,
    points: Vec<FacePoint>,
    at: Vec<DVec3>,
    /// For each point the face and its three vertex normals.
    normals: Vec<(u32, [DVec3; 3])>,
    /// Vertex normals met so far.
    vertex_normals: HashMap<u32, DVec3>,
    pinned: Vec<bool>,
    /// False outside the edit section.
    open: Vec<bool>,
    /// Factors of fairness and curvature.
    factors: Vec<[f64; 2]>,
    /// Damping of the next fine solve.
    damping: f64,
}

impl<'m> Snake<'m> {
    /// A snake on a curve. The ends of an open curve are pinned for good.
    /// # Errors
    /// `TooFewPoints` below three points, `NoSuchFace`.
    pub fn new(mesh: &'m TriMesh, adjacency: &'m Adjacency, curve: &SurfaceCurve) -> Result<Snake<'m>, CurveError> {
        let n = curve.points.len();
        if n < 3 {
            return Err(CurveError::TooFewPoints { found: n, needed: 3 });
        }
        curve.check(mesh)?;
        let mut snake = Snake {
            mesh,
            adjacency,
            field: None,
            closed: curve.closed,
            points: curve.points.clone(),
            at: curve.positions(mesh),
            normals: vec![(NONE, [DVec3::ZERO; 3]); n],
            vertex_normals: HashMap::new(),
            pinned: vec![false; n],
            open: vec![true; n],
            factors: vec![[1.0; 2]; n],
            damping: DAMPING,
        };
        if !curve.closed {
            snake.pinned[0] = true;
            snake.pinned[n - 1] = true;
        }
        Ok(snake)
    }

    /// The scalar that pulls the curve to its high values.
    pub fn attracted_to(mut self, field: &'m ScalarField) -> Result<Snake<'m>, CurveError> {
        let (found, wanted) = (field.values.len(), self.mesh.points.len());
        if found != wanted {
            return Err(CurveError::ValueCount { found, wanted });
        }
        self.field = Some(field);
        Ok(self)
    }

    /// The curve as it is.
    pub fn curve(&self) -> SurfaceCurve {
        SurfaceCurve { points: self.points.clone(), closed: self.closed }
    }

    /// Positions of the points, world units.
    pub fn positions(&self) -> &[DVec3] {
        &self.at
    }

    /// Pins a point where it is, or frees it; the ends of an open curve stay pinned.
    /// # Errors
    /// `NoSuchPart`.
    pub fn pin(&mut self, index: usize, pinned: bool) -> Result<(), CurveError> {
        self.look(index)?;
        let end = !self.closed && (index == 0 || index + 1 == self.points.len());
        self.pinned[index] = pinned || end;
        Ok(())
    }

    /// Lets only the inner points of a section move: from `first` on `count` points, whose first and last are its
    /// fixed ends. On a closed curve the section may run over the start.
    /// # Errors
    /// `NoSuchPart`.
    pub fn edit_section(&mut self, first: usize, count: usize) -> Result<(), CurveError> {
        self.look(first)?;
        let n = self.points.len();
        if count < 3 || count > n + self.closed as usize || (!self.closed && first + count > n) {
            return Err(CurveError::NoSuchPart { what: "point", index: first + count.max(3) - 1, count: n });
        }
        self.open = vec![false; n];
        for k in 1..count - 1 {
            self.open[(first + k) % n] = true;
        }
        Ok(())
    }

    /// Gives a section its own weights.
    /// # Errors
    /// `NoSuchPart`.
    pub fn stiffen(&mut self, section: &Section) -> Result<(), CurveError> {
        self.look(section.first)?;
        let n = self.points.len();
        if section.count > n || (!self.closed && section.first + section.count > n) {
            return Err(CurveError::NoSuchPart { what: "point", index: section.first + section.count, count: n });
        }
        for k in 0..section.count {
            self.factors[(section.first + k) % n] = [section.fairness.max(0.0), section.curvature.max(0.0)];
        }
        Ok(())
    }

    fn look(&self, index: usize) -> Result<(), CurveError> {
        match index < self.points.len() {
            true => Ok(()),
            false => Err(CurveError::NoSuchPart { what: "point", index, count: self.points.len() }),
        }
    }

    /// Drags the edit point `index` by `force` (world units; only its part along the surface counts) and pins it.
    /// # Errors
    /// `NoSuchPart`; also for the ends of an open curve, which stay where they are.
    /// Source: [K98] §3.8.1.
    pub fn drag(&mut self, index: usize, force: DVec3) -> Result<(), CurveError> {
        self.look(index)?;
        if !self.closed && (index == 0 || index + 1 == self.points.len()) {
            return Err(CurveError::NoSuchPart { what: "inner point", index, count: self.points.len() });
        }
        self.move_to(index, move_point_on_surface(self.mesh, self.adjacency, self.points[index], force));
        self.pinned[index] = true;
        Ok(())
    }

    fn move_to(&mut self, index: usize, place: FacePoint) {
        self.points[index] = place;
        self.at[index] = place.position(self.mesh);
    }

    /// Index of the neighbour `step` points on, if there is one.
    fn along(&self, i: usize, step: isize) -> Option<usize> {
        let n = self.points.len() as isize;
        let k = i as isize + step;
        if self.closed { Some(k.rem_euclid(n) as usize) } else { (0..n).contains(&k).then_some(k as usize) }
    }

    fn moves(&self, i: usize) -> bool {
        self.open[i] && !self.pinned[i]
    }

    /// Mean distance of neighbours, world units.
    pub fn spacing(&self) -> f64 {
        let n = self.points.len();
        let segments = if self.closed { n } else { n - 1 };
        (0..segments).map(|i| self.at[i].distance(self.at[(i + 1) % n])).sum::<f64>() / segments as f64
    }

    /// Unit normal of the blended surface at point `i`.
    fn normal(&mut self, i: usize) -> DVec3 {
        let p = self.points[i];
        if self.normals[i].0 != p.face {
            let (mesh, adjacency) = (self.mesh, self.adjacency);
            let of = |v: u32| -> DVec3 {
                adjacency.fan(v).map(|h| mesh.area_vector(h as usize / 3)).sum::<DVec3>().normalize_or_zero()
            };
            let corners = mesh.triangles[p.face as usize];
            self.normals[i] = (p.face, corners.map(|v| *self.vertex_normals.entry(v).or_insert_with(|| of(v))));
        }
        let n = self.normals[i].1;
        (n[0] * p.bary[0] + n[1] * p.bary[1] + n[2] * p.bary[2]).normalize_or_zero()
    }

    /// The energy as the curve is.
    pub fn energy(&mut self, params: &SnakeParams) -> Energy {
        let n = self.points.len();
        let mut energy = Energy::default();
        for i in 0..n {
            let Some(j) = self.along(i, 1) else { continue };
            let l = self.at[i].distance(self.at[j]);
            energy.fairness += self.link_weight(i, j, params) / 4.0 * l * l;
            let Some(h) = self.along(i, -1) else { continue };
            let d = l - self.at[h].distance(self.at[i]);
            energy.arc_length += params.arc_length / 4.0 * d * d;
            let weight = params.curvature * self.factors[i][1];
            if weight > 0.0 {
                let normal = self.normal(i);
                let c = (self.at[h] + self.at[j]) / 2.0 - self.at[i];
                energy.curvature += weight * (c - normal * c.dot(normal)).length_squared();
            }
        }
        energy
    }

    fn link_weight(&self, i: usize, j: usize, params: &SnakeParams) -> f64 {
        params.fairness * (self.factors[i][0] + self.factors[j][0]) / 2.0
    }

    /// One explicit sweep; `coarse` takes the forces of all levels. Returns the largest move, world units.
    /// Source: [K98] eq. 3.13 to 3.16.
    fn explicit(&mut self, params: &SnakeParams, coarse: bool) -> f64 {
        let n = self.points.len();
        let mut moves = vec![DVec3::ZERO; n];
        let normals: Vec<DVec3> = (0..n).map(|i| self.normal(i)).collect();
        let reach = self.reaches();
        for i in 0..n {
            if !self.moves(i) {
                continue;
            }
            let (kf, kc) = (params.fairness * self.factors[i][0], params.curvature * self.factors[i][1]);
            let (mut force, mut levels) = (DVec3::ZERO, 0.0);
            let flat = |v: DVec3, m: usize| v - normals[m] * v.dot(normals[m]);
            let mid = |a: usize, b: usize, m: usize| flat((self.at[a] + self.at[b]) / 2.0 - self.at[m], m);
            let mut step = 1usize;
            while step < n {
                let s = step as isize;
                if reach[i][0].min(reach[i][1]) < step {
                    break;
                }
                let (Some(a), Some(b)) = (self.along(i, -s), self.along(i, s)) else { break };
                levels += 1.0;
                let c = mid(a, b, i);
                force += c * kf;
                if kc > 0.0 {
                    let side = |m: usize, t: isize| self.along(m, t).map_or(DVec3::ZERO, |far| mid(i, far, m));
                    force += (c * 2.0 - side(a, -s) - side(b, s)) * kc;
                }
                if !coarse {
                    break;
                }
                step *= 2;
            }
            let (a, b) = (self.along(i, -1), self.along(i, 1));
            if let (Some(a), Some(b)) = (a, b) {
                let (t, u) = (self.at[a] - self.at[i], self.at[b] - self.at[i]);
                let (far, near) = if t.length() > u.length() { (t, u) } else { (u, t) };
                force += far.normalize_or_zero() * ((far.length() - near.length()) / 2.0 * params.arc_length);
            }
            let bound = (kf + STIFFEST * kc) * f64::max(levels, 1.0) + params.arc_length;
            if bound > 0.0 {
                moves[i] = flat(force, i) * (2.0 * EXPLICIT_STEP / bound);
            }
            if let Some((normal, step)) = self.ridge_step(i, params) {
                moves[i] += normal * (step * EXPLICIT_STEP * params.attraction / (params.attraction + bound));
            }
        }
        self.apply(&moves)
    }

    /// For each point how far its neighbours reach back and ahead without passing a fixed point.
    fn reaches(&self) -> Vec<[usize; 2]> {
        let n = self.points.len();
        let mut reach = vec![[n; 2]; n];
        // Two rounds carry the counts over the start of a closed curve.
        for (side, forward) in [(0, true), (1, false)] {
            let mut run = if self.closed { n } else { 0 };
            for k in 0..2 * n {
                let i = if forward { k % n } else { n - 1 - k % n };
                if !self.closed && k % n == 0 {
                    run = 0;
                }
                reach[i][side] = run.min(n);
                run = if self.moves(i) { run + 1 } else { 1 };
            }
        }
        reach
    }

    /// Moves every point over the surface; returns the largest move as asked for.
    fn apply(&mut self, moves: &[DVec3]) -> f64 {
        let mut largest = 0.0f64;
        for (i, &by) in moves.iter().enumerate() {
            if by != DVec3::ZERO {
                self.move_to(i, move_point_on_surface(self.mesh, self.adjacency, self.points[i], by));
                largest = largest.max(by.length());
            }
        }
        largest
    }

    /// In-surface normal of the curve at point `i` and the step along it to the ridge of the scalar.
    fn ridge_step(&mut self, i: usize, params: &SnakeParams) -> Option<(DVec3, f64)> {
        let field = self.field.filter(|_| params.attraction > 0.0)?;
        let (a, b) = (self.along(i, -1)?, self.along(i, 1)?);
        let tangent = self.at[b] - self.at[a];
        let normal = self.normal(i).cross(tangent).normalize_or_zero();
        let reach = RIDGE_STEP * tangent.length() / 2.0;
        if normal == DVec3::ZERO || !is_positive(reach) {
            return None;
        }
        let slope = |p: &FacePoint| field.gradient(self.mesh, self.adjacency, p).dot(normal);
        let aside = |d: f64| move_point_on_surface(self.mesh, self.adjacency, self.points[i], normal * d);
        let here = slope(&self.points[i]);
        if here == 0.0 || !here.is_finite() {
            return None;
        }
        // Secant step to the zero of the slope; uphill by all of the reach where the scalar does not bend down.
        let ahead = reach.copysign(here);
        let there = slope(&aside(ahead));
        let step = if here * (here - there) > 0.0 { (here / (here - there)).min(1.0) * ahead } else { ahead };
        Some((normal, step))
    }

    /// One fine solve: Gauss-Newton on moves in the tangent planes. Returns the largest move, world units, and
    /// whether the energy fell.
    fn solve(&mut self, params: &SnakeParams) -> (f64, bool) {
        let Some(mut system) = self.system() else { return (0.0, false) };
        self.add_forces(params, &mut system);
        let pulled = self.field.is_some() && params.attraction > 0.0;
        if pulled {
            for i in 0..self.points.len() {
                if system.slot[i] != NONE
                    && let Some((normal, step)) = self.ridge_step(i, params)
                {
                    system.add(&[(i, normal)], -step, params.attraction);
                }
            }
        }
        let longest = LONGEST_MOVE * self.spacing();
        let before = self.energy(params).total();
        let (points, at) = (self.points.clone(), self.at.clone());
        let mut damping = self.damping;
        while damping <= GREATEST_DAMPING {
            let Some(mut moves) = system.solve(damping) else {
                damping *= DAMPING_STEP;
                continue;
            };
            let reach = moves.iter().map(|m| m.length()).fold(0.0, f64::max);
            if reach > longest {
                moves.iter_mut().for_each(|m| *m *= longest / reach);
            }
            if pulled {
                // The pull has no energy of its own to compare.
                return (self.apply(&moves), true);
            }
            let mut taken = 1.0;
            for share in SHARES {
                moves.iter_mut().for_each(|m| *m *= share / taken);
                taken = share;
                let largest = self.apply(&moves);
                if self.energy(params).total() < before {
                    self.damping = (damping * RELIEF).max(DAMPING);
                    return (largest, true);
                }
                self.points.copy_from_slice(&points);
                self.at.copy_from_slice(&at);
            }
            damping *= DAMPING_STEP;
        }
        (0.0, false)
    }

    /// The system of the points that move, still without a term; none if no point does.
    fn system(&mut self) -> Option<System> {
        let n = self.points.len();
        let mut slot = vec![NONE; n];
        let mut count = 0u32;
        // A free closed curve is folded flat, so that its ends lie beside each other in the system.
        let whole = self.closed && (0..n).all(|i| self.moves(i));
        let start = if whole { 0 } else { (0..n).find(|&i| !self.moves(i)).unwrap_or(0) };
        for k in 0..n {
            let i = match whole {
                true if k % 2 == 0 => k / 2,
                true => n - 1 - k / 2,
                false => (start + k) % n,
            };
            if self.moves(i) {
                slot[i] = count;
                count += 1;
            }
        }
        let basis = |i: usize| match self.normal(i) {
            DVec3::ZERO => [DVec3::X, DVec3::Y],
            normal => <[DVec3; 2]>::from(normal.any_orthonormal_pair()),
        };
        let bases = (0..n).map(basis).collect();
        let band = 2 * if whole { 5 } else { 2 } + 1;
        let (matrix, rhs) = (Banded::zero(2 * count as usize, band), vec![0.0; 2 * count as usize]);
        (count > 0).then_some(System { slot, bases, matrix, rhs, terms: Vec::with_capacity(6) })
    }

    /// Adds the fine forces: fairness, even spacing and stiffness.
    fn add_forces(&self, params: &SnakeParams, system: &mut System) {
        for i in 0..self.points.len() {
            let Some(j) = self.along(i, 1) else { continue };
            let d = self.at[j] - self.at[i];
            let near = system.slot[i] != NONE || system.slot[j] != NONE;
            let weight = self.link_weight(i, j, params) / 2.0;
            if near && weight > 0.0 {
                for axis in DVec3::AXES {
                    system.add(&[(i, -axis), (j, axis)], d.dot(axis), weight);
                }
            }
            let Some(h) = self.along(i, -1) else { continue };
            if !near && system.slot[h] == NONE {
                continue;
            }
            let before = self.at[i] - self.at[h];
            let (u, w) = (d.normalize_or_zero(), before.normalize_or_zero());
            if params.arc_length > 0.0 {
                let residual = d.length() - before.length();
                system.add(&[(h, w), (i, -u - w), (j, u)], residual, params.arc_length / 2.0);
            }
            let stiff = 2.0 * params.curvature * self.factors[i][1];
            if stiff > 0.0 {
                let c = (d - before) / 2.0;
                for axis in system.bases[i] {
                    system.add(&[(h, axis / 2.0), (i, -axis), (j, axis / 2.0)], c.dot(axis), stiff);
                }
            }
        }
    }

    /// One sweep of a kind. Returns the largest move in mean spacings.
    pub fn step(&mut self, params: &SnakeParams, sweep: Sweep) -> f64 {
        let spacing = self.spacing().max(f64::MIN_POSITIVE);
        let moved = match sweep {
            Sweep::Single => self.explicit(params, false),
            Sweep::CoarseToFine => self.explicit(params, true),
            Sweep::Solve => self.solve(params).0,
        };
        moved / spacing
    }

    /// Relaxes until nothing moves any more.
    /// # Errors
    /// `Cancelled`.
    pub fn relax(&mut self, params: &SnakeParams, observer: &dyn Observer) -> Result<Relaxed, CurveError> {
        let first = self.energy(params);
        let mut out = Relaxed { sweeps: 0, solves: 0, energy: [first, first], last_move: 0.0, settled: false };
        let mut kind = params.sweep;
        let mut past: Vec<f64> = Vec::new();
        while out.sweeps < params.sweeps && !out.settled {
            observer.check()?;
            out.last_move = self.step(params, kind);
            out.sweeps += 1;
            out.solves += (kind == Sweep::Solve) as usize;
            match kind {
                Sweep::CoarseToFine => {
                    past.push(out.last_move);
                    let stalled = past.len() > STALL && past[past.len() - 1 - STALL] * STALL_FACTOR < out.last_move;
                    if stalled || out.last_move < params.settle || past.len() >= COARSE_SWEEPS {
                        kind = Sweep::Solve;
                    }
                }
                Sweep::Single => out.settled = out.last_move < params.settle,
                // A solve that finds no lower energy stands still.
                Sweep::Solve => out.settled = out.last_move < params.settle,
            }
            observer.progress(out.sweeps as f64 / params.sweeps as f64);
        }
        if params.arc_length > 0.0 {
            self.even_out(observer)?;
        }
        out.energy[1] = self.energy(params);
        Ok(out)
    }
}

/// Normal equations of the fine solve: two moves in the tangent plane for each point that moves.
struct System {
    /// Number of each point among those that move, or [`NONE`].
    slot: Vec<u32>,
    /// Directions of the moves of each point.
    bases: Vec<[DVec3; 2]>,
    matrix: Banded,
    rhs: Vec<f64>,
    terms: Vec<(usize, f64)>,
}

impl System {
    /// Adds `weight` times the square of `residual + sum of part x move of its point`.
    fn add(&mut self, parts: &[(usize, DVec3)], residual: f64, weight: f64) {
        self.terms.clear();
        for &(i, g) in parts.iter().filter(|part| self.slot[part.0] != NONE) {
            for (c, axis) in self.bases[i].iter().enumerate() {
                self.terms.push((2 * self.slot[i] as usize + c, g.dot(*axis)));
            }
        }
        for (k, &(i, g)) in self.terms.iter().enumerate() {
            self.rhs[i] -= weight * g * residual;
            for &(j, f) in &self.terms[..=k] {
                self.matrix.add(i, j, weight * g * f);
            }
        }
    }

    /// The moves of all points, world units; none if the matrix with `damping` of its mean diagonal is singular.
    fn solve(&self, damping: f64) -> Option<Vec<DVec3>> {
        let (mut matrix, mut rhs) = (self.matrix.clone(), self.rhs.clone());
        let n = matrix.len();
        let mean = (0..n).map(|i| matrix.get(i, i)).sum::<f64>() / n as f64;
        if !is_positive(mean) {
            return None;
        }
        for i in 0..n {
            matrix.add(i, i, damping * mean);
        }
        BandedCholesky::factor(matrix)?.solve(&mut rhs);
        let step = |(&slot, basis): (&u32, &[DVec3; 2])| match slot {
            NONE => DVec3::ZERO,
            s => basis[0] * rhs[2 * s as usize] + basis[1] * rhs[2 * s as usize + 1],
        };
        rhs.iter().all(|x| x.is_finite()).then(|| self.slot.iter().zip(&self.bases).map(step).collect())
    }
}
