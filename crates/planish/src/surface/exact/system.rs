//! The fit of all patches under the equations of their seams.
//!
//! With `W` the distances that count, those along the normal and a little of those in the tangent plane:
//!
//! ```text
//! sum over nodes |S - P|^2_W  +  bends  +  sum over weighed seams  w angle^2      under  C x = 0
//! ```
//!
//! The equations are kept by multipliers (augmented Lagrangian: Nocedal, Wright 2006, *Numerical Optimization*, §17.3), which
//! asks nothing of their independence: around corners they repeat each other. `W` is replaced by the identity on the left side:
//! as `W` is nowhere larger, each pass goes downhill, and one factorisation of one coordinate serves many passes of all three
//! (the foot points of the nodes move with the surface).

use super::rows::{Row, Shared};
use crate::grid::Grid;
use crate::linalg::{SparseCholesky, SparsePattern};
use crate::network::Network;
use crate::observe::{Cancelled, Observer};
use crate::surface::basis::{Knots, uniform_parameters};
use crate::surface::fit::{Direction, Directions, project, project_net};
use crate::surface::network_fit::patch_directions;
use crate::surface::quality::offsets;
use crate::surface::sides::{knots, node, side_len};
use crate::surface::{FitError, Surface};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Arc;

/// What a distance in the tangent plane counts beside one along the normal, squared: nodes may slide, but not without end.
const SLIDE: f64 = 0.05 * 0.05;

/// The fit of a network: what does not change while its seams are made exact.
pub(super) struct Fit<'a> {
    pub network: &'a Network,
    pub grids: &'a [Grid],
    knots: Vec<Knots>,
    /// With the weight of bends, and without.
    directions: Directions,
    plain: Directions,
    /// For each patch the sides whose nodes count more, as the curves stay where they are.
    held: Vec<[bool; 4]>,
}

impl<'a> Fit<'a> {
    /// * `counts` - nodes along the curves
    /// * `is_held` - true for curves that are to stay as near to their nodes as they can
    pub fn new(
        network: &'a Network,
        grids: &'a [Grid],
        surfaces: &[Surface],
        counts: &[usize],
        (smoothing, is_held): (f64, &dyn Fn(usize) -> bool),
    ) -> Result<Fit<'a>, FitError> {
        let all: Vec<usize> = (0..surfaces.len()).collect();
        let knots = knots(network, surfaces, &all)?;
        let layouts = (0..counts.len()).filter(|&c| counts[c] > 0).map(|c| (counts[c], knots[c].clone()));
        let directions = Directions::smoothed(layouts.clone(), smoothing)?;
        let plain = Directions::new(layouts)?;
        let held = network.patches.iter().map(|p| p.sides.map(|side| is_held(side.curve as usize))).collect();
        Ok(Fit { network, grids, knots, directions, plain, held })
    }

    fn along<'b>(&'b self, patch: usize, of: &'b Directions) -> [&'b Direction; 2] {
        patch_directions(&self.network.patches[patch], &self.grids[patch], of, &self.knots)
    }

    /// What the nodes of a held side count beside once: as much as the whole patch along them, so that the curve is fitted first.
    fn held_weight(&self, patch: usize, side: usize) -> f64 {
        let grid = &self.grids[patch];
        side_len(grid.rows, grid.cols, side + 1) as f64
    }

    /// The entries that a patch adds to the normal matrix, lower triangle.
    fn entries(&self, patch: usize, shared: &Shared) -> Vec<(usize, usize, f64)> {
        let [along_u, along_v] = self.along(patch, &self.directions);
        let (cols, rows) = (along_u.control(), along_v.control());
        let mut found = Vec::new();
        for c in 0..rows * cols {
            let Some(a) = shared.get(patch, c) else { continue };
            let (i, j) = (c % cols, c / cols);
            for l in along_v.near(j) {
                for k in along_u.near(i) {
                    if let Some(b) = shared.get(patch, l * cols + k).filter(|&b| b <= a) {
                        found.push((a, b, along_v.gram(j, l) * along_u.gram(i, k)));
                    }
                }
            }
        }
        for side in (0..4).filter(|&side| self.held[patch][side]) {
            let (along, weight) = (if side % 2 == 0 { along_u } else { along_v }, self.held_weight(patch, side));
            let turned = |i: usize| if side < 2 { i } else { along.control() - 1 - i };
            let at = |i: usize| shared.get(patch, node(rows, cols, side, turned(i), 0));
            for i in 0..along.control() {
                for k in along.near(i) {
                    if let (Some(a), Some(b)) = (at(i), at(k))
                        && b <= a
                    {
                        found.push((a, b, weight * along.gram(i, k)));
                    }
                }
            }
        }
        found
    }

    /// What pulls at the control points of a patch.
    /// * `normals` - at the nodes
    fn forces(&self, patch: usize, surface: &Surface, normals: &[DVec3]) -> Vec<DVec3> {
        let target = &self.grids[patch];
        let mut off = offsets(surface, target);
        let (rows, cols) = (target.rows, target.cols);
        let mut counts = vec![1.0; off.len()];
        for side in (0..4).filter(|&side| self.held[patch][side]) {
            let more = self.held_weight(patch, side);
            (0..side_len(rows, cols, side)).for_each(|i| counts[node(rows, cols, side, i, 0)] += more);
        }
        for ((off, n), count) in off.iter_mut().zip(normals).zip(counts) {
            let along = *n * n.dot(*off);
            *off = if count > 1.0 || *n == DVec3::ZERO { *off * count } else { along + (*off - along) * SLIDE };
        }
        let [plain, bent] = [&self.plain, &self.directions].map(|of| self.along(patch, of));
        let pull = project(&off, plain[0], plain[1]);
        let [plain, bent] = [plain, bent].map(|[u, v]| project_net(&surface.control, u, v));
        (0..pull.len()).map(|k| plain[k] - bent[k] - pull[k]).collect()
    }
}

/// The system in one round: the matrix and where its solution stands.
pub(super) struct System<'a> {
    fit: &'a Fit<'a>,
    shared: &'a Shared,
    pub surfaces: Vec<Surface>,
    conditions: Vec<Row>,
    wishes: Vec<Row>,
    multipliers: Vec<DVec3>,
    normals: Vec<Vec<DVec3>>,
}

impl<'a> System<'a> {
    pub fn new(fit: &'a Fit<'a>, shared: &'a Shared, surfaces: &[Surface]) -> System<'a> {
        let surfaces = surfaces.to_vec();
        System {
            fit,
            shared,
            surfaces,
            conditions: Vec::new(),
            wishes: Vec::new(),
            multipliers: Vec::new(),
            normals: Vec::new(),
        }
    }

    /// Takes other coefficients along the seams, and the normals as the surfaces stand.
    pub fn renew(&mut self, conditions: Vec<Row>, wishes: Vec<Row>) {
        self.multipliers.resize(conditions.len(), DVec3::ZERO);
        (self.conditions, self.wishes) = (conditions, wishes);
        let normals = |p: usize| {
            let (grid, surface) = (&self.fit.grids[p], &self.surfaces[p]);
            if !self.shared.has(p) {
                return Vec::new();
            }
            let [us, vs] = [grid.cols, grid.rows].map(uniform_parameters);
            let [u, v] = [[1, 0], [0, 1]].map(|order| surface.sample(&us, &vs, order));
            u.iter().zip(&v).map(|(u, v)| u.cross(*v).normalize_or_zero()).collect()
        };
        self.normals = (0..self.surfaces.len()).into_par_iter().map(normals).collect();
    }

    /// Factors the matrix with the squares of the conditions weighed `stiff` times what a control point weighs in the mean.
    pub fn factor(&self, stiff: f64, observer: &dyn Observer) -> Result<(SparseCholesky, f64), FitError> {
        let n = self.shared.count;
        let patches = (0..self.surfaces.len()).into_par_iter().filter(|&p| self.shared.has(p));
        let mut entries: Vec<(usize, usize, f64)> =
            patches.map(|p| self.fit.entries(p, self.shared)).collect::<Vec<_>>().concat();
        let mean = entries.iter().filter(|(a, b, _)| a == b).map(|e| e.2).sum::<f64>() / n as f64;
        let weight = stiff * mean;
        let rows =
            self.conditions.iter().map(|row| (row, weight)).chain(self.wishes.iter().map(|row| (row, row.weight)));
        for (row, weight) in rows {
            for (k, &(a, x)) in row.terms.iter().enumerate() {
                entries.extend(row.terms[..=k].iter().map(|&(b, y)| (a, b, weight * x * y)));
            }
        }
        let (places, values): (Vec<_>, Vec<_>) = entries.into_iter().map(|(a, b, x)| ((a, b), x)).unzip();
        let unsolvable = |_| FitError::Unsolvable { unknowns: n };
        let pattern = SparsePattern::watched(n, places, &|| observer.cancelled()).ok_or(Cancelled)?;
        let pattern = Arc::new(pattern.map_err(unsolvable)?);
        let factor = pattern.factor_watched(values, &|| observer.cancelled()).ok_or(Cancelled)?;
        Ok((factor.map_err(unsolvable)?, weight))
    }

    /// Conjugate gradients with the factored matrix in front, then one step of the multipliers. Nodes keep their normals meanwhile, so
    /// that all is linear.
    pub fn descend(
        &mut self,
        factored: &(SparseCholesky, f64),
        steps: usize,
        observer: &dyn Observer,
    ) -> Result<(), FitError> {
        let weight = factored.1;
        let mut rest = self.pulls(weight);
        let mut way = self.solved(factored, &rest);
        let mut gain = dot(&rest, &way);
        for _ in 0..steps {
            observer.check()?;
            self.advance(&way, 1.0);
            let there = self.pulls(weight);
            let turned: Vec<DVec3> = rest.iter().zip(&there).map(|(a, b)| *a - *b).collect();
            let cost = dot(&way, &turned);
            let step = if cost > 0.0 { gain / cost } else { 0.0 };
            self.advance(&way, step - 1.0);
            rest.iter_mut().zip(&turned).for_each(|(r, t)| *r -= *t * step);
            let steepest = self.solved(factored, &rest);
            let left = dot(&rest, &steepest);
            let keep = if gain > 0.0 { left / gain } else { 0.0 };
            gain = left;
            way.iter_mut().zip(&steepest).for_each(|(w, s)| *w = *s + *w * keep);
        }
        for (row, multiplier) in self.conditions.iter().zip(&mut self.multipliers) {
            *multiplier += row.value(&self.surfaces) * weight;
        }
        Ok(())
    }

    /// Goes from here towards the nearest place where the conditions hold. Returns the most that one still misses, world units.
    pub fn settle(&mut self, factored: &(SparseCholesky, f64)) -> f64 {
        let mut pulls = vec![DVec3::ZERO; self.shared.count];
        for row in &self.conditions {
            let by = row.value(&self.surfaces) * factored.1;
            row.terms.iter().for_each(|&(k, x)| pulls[k] -= by * x);
        }
        let way = self.solved(factored, &pulls);
        self.advance(&way, 1.0);
        self.conditions.iter().map(|row| row.value(&self.surfaces).length()).fold(0.0, f64::max)
    }

    /// What pulls at all unknowns, as the surfaces stand.
    fn pulls(&self, weight: f64) -> Vec<DVec3> {
        let forces = |p: usize| match self.shared.has(p) {
            true => self.fit.forces(p, &self.surfaces[p], &self.normals[p]),
            false => Vec::new(),
        };
        let forces: Vec<Vec<DVec3>> = (0..self.surfaces.len()).into_par_iter().map(forces).collect();
        let mut pulls = vec![DVec3::ZERO; self.shared.count];
        for (p, forces) in forces.iter().enumerate() {
            for (c, force) in forces.iter().enumerate() {
                if let Some(k) = self.shared.get(p, c) {
                    pulls[k] += *force;
                }
            }
        }
        let mut pull = |row: &Row, by: DVec3| row.terms.iter().for_each(|&(k, x)| pulls[k] -= by * x);
        for (row, multiplier) in self.conditions.iter().zip(&self.multipliers) {
            pull(row, *multiplier + row.value(&self.surfaces) * weight);
        }
        self.wishes.iter().for_each(|row| pull(row, row.value(&self.surfaces) * row.weight));
        pulls
    }

    fn solved(&self, factored: &(SparseCholesky, f64), pulls: &[DVec3]) -> Vec<DVec3> {
        let n = self.shared.count;
        let mut rhs: Vec<f64> = (0..3).flat_map(|axis| pulls.iter().map(move |p| p[axis])).collect();
        factored.0.solve(&mut rhs);
        (0..n).map(|k| DVec3::new(rhs[k], rhs[n + k], rhs[2 * n + k])).collect()
    }

    /// Moves all unknowns by so many times these ways.
    fn advance(&mut self, ways: &[DVec3], times: f64) {
        for (p, surface) in self.surfaces.iter_mut().enumerate() {
            for (c, point) in surface.control.iter_mut().enumerate() {
                if let Some(k) = self.shared.get(p, c) {
                    *point += ways[k] * times;
                }
            }
        }
    }
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}
