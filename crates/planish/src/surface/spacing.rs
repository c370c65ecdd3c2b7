//! Where the knots along a chord stand: as few as keep the patches that it crosses within a tolerance.
//!
//! Each direction of a patch is looked at alone. What the least-squares fit of its rows leaves is, squared, what the
//! direction adds to the square of the whole, since the fits along both directions are orthogonal projections ([K98] eq. 6.1).
//! Spans that leave too much are halved until none does. From what is left in each span follows how long a cubic may be
//! there, since its error goes with the fourth power of its length; knots at equal steps of that measure equalise the error
//! (de Boor 1973, *Good approximation by splines with variable knots*), and their number is the least that keeps the tolerance.

use super::FitError;
use super::basis::Knots;
use super::fit::{Direction, FEWEST_CONTROL, project_rows};
use super::resolution::{Measure, Spacing};
use crate::grid::Grid;
use glam::DVec3;

/// Order of the error of a cubic in the length of its spans.
const ORDER: f64 = 4.0;
/// How far the length of a span may be corrected by what it leaves: twice as long or half. Beyond that the fourth power is
/// no guide.
const MOST_STRETCH: f64 = 2.0;
/// Steps to which the factor is found by which spans are closer than they need be.
const FACTOR_STEP: f64 = 1e-6;
/// What [`Spaced::refine`] multiplies the number of spans by: enough to halve the error and more.
const FINER: f64 = 1.25;

/// The patches that a chord crosses, and what its knots have to be.
pub(crate) struct Chord {
    /// Nodes of the grids along it.
    nodes: usize,
    /// Fewest cells of the grids within a span.
    cells: f64,
    double: bool,
    both_ways: bool,
    /// Control points that a patch asks for, whatever the tolerance.
    pub asked: Option<usize>,
    /// Patch, direction (0 along `u`, 1 along `v`), and whether it runs against the chord.
    pub strands: Vec<(usize, usize, bool)>,
}

/// A chord with knots: how close they have to be along it, and how many spans there are.
pub(crate) struct Spaced {
    /// For each cell along the chord the spans per cell that a fit needs; at most `most` over the number of cells.
    dense: Vec<f64>,
    spans: usize,
    /// Most spans that the grids carry.
    most: usize,
    double: bool,
    /// How many times the tolerance a patch misses with as many spans as the grids carry; 0 if all keep it.
    pub excess: f64,
    /// Control points that were asked for, whatever the grid carries.
    asked: Option<usize>,
}

impl Chord {
    pub fn new(nodes: usize, cells: f64, double: bool, both_ways: bool) -> Chord {
        Chord { nodes, cells, double, both_ways, asked: None, strands: Vec::new() }
    }

    fn knots(&self, breaks: &[f64]) -> Knots {
        Knots::at(breaks, self.double)
    }

    /// Most spans that the grids carry.
    fn most(&self) -> usize {
        let by_cells = (self.nodes.saturating_sub(1) as f64 / self.cells) as usize;
        // As many control points as nodes.
        let by_nodes = if self.double { self.nodes.saturating_sub(2) / 2 } else { self.nodes.saturating_sub(3) };
        by_cells.min(by_nodes).max(1)
    }

    /// The fewest spans that keep the measure of every patch below `allowed` (world units), or as many as its grids carry.
    pub fn space(
        &self,
        grids: &[Grid],
        normals: &[Vec<DVec3>],
        measure: Measure,
        spacing: Spacing,
        allowed: f64,
    ) -> Result<Spaced, FitError> {
        if let Some(control) = self.asked {
            return Ok(Spaced::even(self, control));
        }
        if self.strands.is_empty() || self.nodes < FEWEST_CONTROL {
            return Ok(Spaced::even(self, FEWEST_CONTROL));
        }
        // Both directions together keep what each keeps of half the square.
        let allowed = allowed / 2f64.sqrt();
        let dense = match spacing {
            Spacing::Even => vec![1.0 / self.shortest(); self.nodes - 1],
            Spacing::Fitted => self.dense(grids, normals, measure, allowed)?,
        };
        let mut spaced = Spaced { dense, spans: 1, most: self.most(), double: self.double, excess: 0.0, asked: None };
        let excess = |spans: usize, spaced: &mut Spaced| -> Result<f64, FitError> {
            spaced.spans = spans;
            let left = self.left(grids, normals, &spaced.knots())?;
            Ok(left.iter().map(|strand| measure.of(strand) / allowed).fold(0.0, f64::max))
        };
        // The least that does: doubled until one does, then halved between.
        let (mut low, mut high) = (0, 1);
        loop {
            let found = excess(high, &mut spaced)?;
            if found <= 1.0 {
                break;
            }
            if high == spaced.most {
                spaced.excess = found;
                return Ok(spaced);
            }
            (low, high) = (high, (2 * high).min(spaced.most));
        }
        while high - low > 1 {
            let middle = (low + high) / 2;
            if excess(middle, &mut spaced)? <= 1.0 {
                high = middle;
            } else {
                low = middle;
            }
        }
        spaced.spans = high;
        Ok(spaced)
    }

    /// Least length of a span, cells.
    fn shortest(&self) -> f64 {
        (self.nodes - 1) as f64 / self.most() as f64
    }

    /// How many spans a fit needs in each cell, from halving spans that leave too much.
    fn dense(
        &self,
        grids: &[Grid],
        normals: &[Vec<DVec3>],
        measure: Measure,
        allowed: f64,
    ) -> Result<Vec<f64>, FitError> {
        let (cells, shortest) = ((self.nodes - 1) as f64, self.shortest());
        let mut breaks = vec![0.0, 1.0];
        let (spans, worst) = loop {
            let left = self.left(grids, normals, &self.knots(&breaks))?;
            let lines: Vec<usize> = left.iter().map(|of| of.len() / self.nodes).collect();
            let part = |w: &[f64], strand: usize| -> f64 {
                let [from, to] = [w[0], w[1]].map(|t| (t * cells).round() as usize);
                measure.of(&left[strand][from * lines[strand]..(to + 1).min(self.nodes) * lines[strand]])
            };
            let over: Vec<bool> = left.iter().map(|of| measure.of(of) > allowed).collect();
            let halved: Vec<bool> = breaks
                .windows(2)
                .map(|w| {
                    let can = (w[1] - w[0]) * cells >= 2.0 * shortest;
                    can && (0..left.len()).any(|s| over[s] && part(w, s) > allowed)
                })
                .collect();
            if !halved.contains(&true) {
                let worst: Vec<f64> =
                    breaks.windows(2).map(|w| (0..left.len()).map(|s| part(w, s)).fold(0.0, f64::max)).collect();
                break (breaks, worst);
            }
            let mut finer = vec![0.0];
            for (w, halve) in breaks.windows(2).zip(halved) {
                finer.extend(halve.then_some((w[0] + w[1]) / 2.0));
                finer.push(w[1]);
            }
            breaks = finer;
        };
        // Spans per cell.
        let dense: Vec<f64> = spans
            .windows(2)
            .zip(&worst)
            .map(|(w, left)| {
                let stretch = (allowed / left.max(f64::MIN_POSITIVE)).powf(1.0 / ORDER);
                1.0 / ((w[1] - w[0]) * cells * stretch.clamp(1.0 / MOST_STRETCH, MOST_STRETCH))
            })
            .collect();
        let at = |cell: f64| dense[spans[1..].partition_point(|&b| b * cells <= cell).min(dense.len() - 1)];
        let of = |cell: usize| {
            let middle = cell as f64 + 0.5;
            let here = if self.both_ways { at(middle).max(at(cells - middle)) } else { at(middle) };
            here.min(1.0 / shortest)
        };
        Ok((0..self.nodes - 1).map(of).collect())
    }

    /// What the fits of the rows with these knots leave in each strand at each node along the normal, by nodes along the chord.
    fn left(&self, grids: &[Grid], normals: &[Vec<DVec3>], knots: &Knots) -> Result<Vec<Vec<f64>>, FitError> {
        let forward = Direction::new(self.nodes, knots, 0.0)?;
        let backward = Direction::new(self.nodes, &knots.reversed(), 0.0)?;
        let one = |&(patch, axis, reversed): &(usize, usize, bool)| {
            let grid = &grids[patch];
            let direction = if reversed { &backward } else { &forward };
            let lines = if axis == 0 { grid.rows } else { grid.cols };
            let mut left = vec![0.0; grid.points.len()];
            let mut put = |node: usize, line: usize, off: DVec3| {
                let at = if axis == 0 { line * grid.cols + node } else { node * grid.cols + line };
                let node = if reversed { self.nodes - 1 - node } else { node };
                let normal = normals[patch][at];
                left[node * lines + line] = if normal == DVec3::ZERO { off.length() } else { off.dot(normal).abs() };
            };
            if axis == 0 {
                for (line, row) in grid.points.chunks_exact(grid.cols).enumerate() {
                    let mut fit = direction.project(row.iter().copied());
                    direction.factor(0).solve(&mut fit);
                    for (node, point) in row.iter().enumerate() {
                        let (first, w) = (direction.basis.first[node], direction.basis.weights[node]);
                        put(node, line, (0..4).map(|a| fit[first + a] * w[a]).sum::<DVec3>() - *point);
                    }
                }
            } else {
                let mut fit = project_rows(&grid.points, grid.cols, &direction.basis, direction.control());
                direction.factor(0).solve(&mut fit);
                for (node, row) in grid.points.chunks_exact(grid.cols).enumerate() {
                    let (first, w) = (direction.basis.first[node], direction.basis.weights[node]);
                    for (line, point) in row.iter().enumerate() {
                        let at = |a: usize| fit[(first + a) * grid.cols + line];
                        put(node, line, (0..4).map(|a| at(a) * w[a]).sum::<DVec3>() - *point);
                    }
                }
            }
            left
        };
        Ok(self.strands.iter().map(one).collect())
    }
}

impl Spaced {
    /// Knots at equal steps for so many control points.
    pub fn even(chord: &Chord, control: usize) -> Spaced {
        // Double knots have an even number.
        let control = match chord.double && control % 2 == 1 {
            true if control < chord.nodes => control + 1,
            true => control - 1,
            false => control,
        };
        Spaced { dense: Vec::new(), spans: 1, most: 1, double: chord.double, excess: 0.0, asked: Some(control) }
    }

    /// Control points.
    pub fn control(&self) -> usize {
        self.asked.unwrap_or(if self.double { 2 * self.spans + 2 } else { self.spans + 3 })
    }

    pub fn knots(&self) -> Knots {
        match self.asked {
            Some(control) if self.double => Knots::double(control),
            Some(control) => Knots::uniform(control),
            None => Knots::at(&self.breaks(), self.double),
        }
    }

    /// Where the need for spans has grown by equal steps.
    fn breaks(&self) -> Vec<f64> {
        let (cells, spans) = (self.dense.len(), self.spans as f64);
        let densest = self.most as f64 / cells as f64;
        // More spans than are needed stand closer, but nowhere closer than the grids carry.
        let sum = |factor: f64| -> f64 { self.dense.iter().map(|d| (d * factor).min(densest)).sum() };
        let mut high = 1.0;
        if sum(1.0) < spans {
            let mut low = 1.0;
            high = densest / self.dense.iter().copied().fold(densest, f64::min);
            while high - low > FACTOR_STEP * low {
                let middle = (low + high) / 2.0;
                if sum(middle) < spans { low = middle } else { high = middle }
            }
        }
        let need: Vec<f64> = self.dense.iter().map(|d| (d * high).min(densest)).collect();
        let mut grown = vec![0.0];
        need.iter().for_each(|n| grown.push(grown[grown.len() - 1] + n));
        let at = |k: usize| {
            let step = grown[cells] * k as f64 / spans;
            let cell = grown.partition_point(|&g| g <= step).clamp(1, cells) - 1;
            (cell as f64 + (step - grown[cell]) / need[cell]) / cells as f64
        };
        [0.0].into_iter().chain((1..self.spans).map(at)).chain([1.0]).collect()
    }

    /// A quarter more spans. False if the grid carries no more, or the number was given.
    pub fn refine(&mut self) -> bool {
        let finer = ((self.spans as f64 * FINER).ceil() as usize).min(self.most);
        let is_finer = self.asked.is_none() && finer > self.spans;
        if is_finer {
            self.spans = finer;
        }
        is_finer
    }
}
