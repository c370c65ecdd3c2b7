//! A network whose seams are smoothed: what all steps ask, and the fit that moves are counted from.

use super::bend::Side;
use super::corner::{Plane, Planes, planes};
use super::curve::constrain;
use super::meet::{Meets, roundings};
use super::miss::Misses;
use super::params::StitchParams;
use crate::grid::Grid;
use crate::network::{Network, Patch};
use crate::observe::{Cancelled, Observer};
use crate::surface::basis::Knots;
use crate::surface::fit::{Direction, Directions, Layout, project_net, surface_of};
use crate::surface::fold::MeanNormals;
use crate::surface::network_fit::{fill, patch_directions};
use crate::surface::sides::{along_curve, check, check_grids, corners_of, is_smooth, knots, node, side_len};
use crate::surface::{FitError, Surface};
use glam::DVec3;
use rayon::prelude::*;

/// Share of the way of a feature's curve that the rows of control points beside it go along, itself first: the slopes across it
/// stay.
const FOLLOW: [f64; 3] = [1.0, 1.0, 0.5];

/// The network at work: what all steps ask.
pub(crate) struct Work<'a> {
    pub network: &'a Network,
    pub grids: &'a [Grid],
    pub surfaces: &'a [Surface],
    /// For each curve the patches on it and their sides.
    pub uses: Vec<Vec<(u32, u8)>>,
    /// Points of the grids along every curve, and its knots.
    pub nodes: Vec<usize>,
    pub knots: Vec<Knots>,
    /// With the bends of moves, and without.
    pub directions: Directions,
    plain: Directions,
    pub means: Vec<MeanNormals>,
    /// Curves as fitted, and the planes at their ends.
    pub fitted: Vec<Vec<DVec3>>,
    pub planes: Planes,
    pub meets: Meets,
    pub misses: Misses,
    /// For each patch beside curves that a person calls smooth, how far rounding these takes it from its grid: it may lose
    /// what it has to.
    pub rounded: Vec<Option<f64>>,
    /// What a patch may lose, over the squared move that it can afford; and for each patch what it may lose to seams that bend
    /// much, which is more where the tolerance of the fit leaves it more.
    pub share: f64,
    pub shares: Vec<f64>,
    /// Surfaces that stay, and which; those of [`Work::surfaces`] are for the others.
    pub before: &'a [Surface],
    pub held: Vec<bool>,
}

/// A patch fitted inside its moved curves, and the projection of its grid that all its nets share.
pub(crate) struct Filled {
    pub surface: Surface,
    pub projection: Vec<DVec3>,
}

impl<'a> Work<'a> {
    /// `None` if no two patches meet.
    /// * `before`, `held` - smoothed surfaces and which of them stay; as many as patches
    pub fn new(
        network: &'a Network,
        grids: &'a [Grid],
        surfaces: &'a [Surface],
        before: &'a [Surface],
        held: Vec<bool>,
        params: &StitchParams,
    ) -> Result<Option<Work<'a>>, FitError> {
        let nodes = check_grids(network, grids)?;
        let shapes: Vec<_> = surfaces.iter().map(|s| (s.rows, s.cols, s.control.len())).collect();
        check(network, "surfaces", &shapes)?;
        surfaces.iter().try_for_each(Surface::check)?;
        let all: Vec<usize> = (0..surfaces.len()).collect();
        let knots = knots(network, surfaces, &all)?;
        let uses = network.uses();
        if !uses.iter().any(|uses| uses.len() == 2) {
            return Ok(None);
        }
        let layouts = (0..nodes.len()).filter(|&c| nodes[c] > 0).map(|c| (nodes[c], knots[c].clone()));
        let curve = |uses: &Vec<(u32, u8)>| {
            let held = uses.iter().find(|(p, _)| held[*p as usize]);
            held.or(uses.first()).map_or_else(Vec::new, |&(p, k)| {
                let s = if held.is_some() { &before[p as usize] } else { &surfaces[p as usize] };
                let side = network.patches[p as usize].sides[k as usize];
                along_curve(&s.control, s.rows, s.cols, k as usize, side.reversed, 0)
            })
        };
        let [directions, plain] = [params.smoothing, 0.0].map(|weight| Directions::smoothed(layouts.clone(), weight));
        let (directions, plain) = (directions?, plain?);
        let corners = corners_of(network, before, |p, _| held[p]);
        let mut fitted: Vec<Vec<DVec3>> = uses.iter().map(curve).collect();
        for (c, fitted) in
            fitted.iter_mut().enumerate().filter(|(c, _)| !uses[*c].iter().any(|(p, _)| held[*p as usize]))
        {
            let ends = network.curves[c].corners.map(|k| corners[k as usize]);
            if ends.iter().any(Option::is_some) {
                *fitted = directions.get(nodes[c], &knots[c]).with_ends(std::mem::take(fitted), ends);
            }
        }
        let means: Vec<MeanNormals> =
            grids.par_iter().zip(surfaces).map(|(g, s)| MeanNormals::new(g, [s.cols, s.rows])).collect();
        let misses = Misses::new(surfaces, grids);
        let breaks: Vec<Vec<f64>> = knots.iter().map(Knots::breaks).collect();
        let meets = Meets::new(network, grids, &means, &breaks, &misses);
        let smooth = |c: usize, end: usize| is_smooth(&network.curves[c]) && meets.is_smooth(c, end as f64);
        let share = (1.0 + params.fit_loss).powi(2) - 1.0;
        let room = |p: usize| misses.left_of(params.tolerance, p) / misses.afford(p);
        let shares = (0..grids.len()).map(|p| share * room(p).max(1.0)).collect();
        let rounded = roundings(network, grids, &means, &breaks);
        let planes = planes(network, [surfaces, before], &held, &means, &fitted, &smooth);
        Ok(Some(Work {
            network,
            grids,
            surfaces,
            uses,
            nodes,
            knots,
            directions,
            plain,
            means,
            fitted,
            planes,
            meets,
            misses,
            rounded,
            share,
            shares,
            before,
            held,
        }))
    }

    /// True if a curve bounds a patch that stays.
    pub fn is_held(&self, curve: usize) -> bool {
        self.uses[curve].iter().any(|(p, _)| self.held[*p as usize])
    }

    /// Patches that do not stay.
    pub fn free(&self) -> impl ParallelIterator<Item = usize> + '_ {
        (0..self.held.len()).into_par_iter().filter(|&p| !self.held[p])
    }

    /// The squared move that a patch can afford, times its nodes.
    pub fn afford(&self, patch: usize) -> f64 {
        let nodes = self.grids[patch].points.len() as f64;
        self.misses.afford_all(patch) + nodes * self.rounded[patch].unwrap_or(0.0).powi(2)
    }

    pub fn is_smooth_seam(&self, curve: usize) -> bool {
        is_smooth(&self.network.curves[curve]) && self.uses[curve].len() == 2
    }

    /// The curves, moved so that they respect the planes at their ends.
    pub fn curves(&self) -> Vec<Vec<DVec3>> {
        let one = |c: usize| {
            if self.uses[c].is_empty() {
                return Vec::new();
            }
            if self.is_held(c) {
                return self.fitted[c].clone();
            }
            let ends: [Vec<Plane>; 2] = [0, 1].map(|e| self.planes.at(c, e).cloned().collect());
            let direction = self.directions.get(self.nodes[c], &self.knots[c]);
            constrain(c, &self.fitted[c], &ends, direction)
        };
        (0..self.uses.len()).into_par_iter().map(one).collect()
    }

    /// The patches with their inside fitted to the moved curves: what moves are counted from.
    pub fn filled(&self, curves: &[Vec<DVec3>], observer: &dyn Observer) -> Result<Vec<Filled>, FitError> {
        let one = |(p, patch): (usize, &Patch)| {
            if observer.cancelled() {
                return None;
            }
            if self.held[p] {
                return Some(Filled { surface: self.before[p].clone(), projection: Vec::new() });
            }
            let [along_u, along_v] = self.along(p);
            let projection = project_net(&follow(self.network, p, &self.surfaces[p], curves), along_u, along_v);
            let net = fill(patch, curves, &projection, along_u, along_v);
            Some(Filled { surface: surface_of(net, along_u, along_v), projection })
        };
        self.network.patches.par_iter().enumerate().map(one).collect::<Option<_>>().ok_or(Cancelled.into())
    }

    /// The directions of a patch.
    pub fn along(&self, patch: usize) -> [&Direction; 2] {
        let (shape, grid) = (&self.network.patches[patch], &self.grids[patch]);
        patch_directions(shape, grid, &self.directions, &self.knots)
    }

    /// What moves of all control points of a patch cost its fit: the sum of the squares of what its nodes move.
    pub fn loss(&self, patch: usize, moves: &[DVec3]) -> f64 {
        let (shape, grid) = (&self.network.patches[patch], &self.grids[patch]);
        let [along_u, along_v] = patch_directions(shape, grid, &self.plain, &self.knots);
        project_net(moves, along_u, along_v).iter().zip(moves).map(|(a, b)| a.dot(*b)).sum()
    }

    /// A side of a patch as its curve sees it.
    pub fn side(&self, at: (u32, u8)) -> Side {
        Side::of(self.network, self.surfaces, at)
    }
}

/// The control net of a patch with what is on and beside its features moved along with their curves.
pub(crate) fn follow(network: &Network, patch: usize, surface: &Surface, curves: &[Vec<DVec3>]) -> Vec<DVec3> {
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

pub(crate) fn shape(work: &Work, p: usize) -> [Layout; 2] {
    work.along(p).map(|d| (d.basis.len(), d.knots.clone()))
}
