//! Where the knots along a chord stand: as few as keep the patches that it crosses within a tolerance.
//!
//! Each direction of a patch is looked at alone. What the least-squares fit of its rows leaves is, squared, what the
//! direction adds to the square of the whole, since the fits along both directions are orthogonal projections ([K98] eq. 6.1).
//! Spans that leave too much are halved until none does. From what is left in each span follows how long a cubic may be
//! there, since its error goes with the fourth power of its length; knots at equal steps of that measure equalise the error
//! (de Boor 1973, *Good approximation by splines with variable knots*), and their number is the least that keeps the tolerance.
//! The measure is taken again on the knots that are found, as long as that takes fewer. No span is longer than another and the way
//! to it, and there are two at least.

use super::FitError;
use super::basis::Knots;
use super::fit::{Direction, FEWEST_CONTROL, project_rows};
use super::params::{KnotSpacing, Measure};
use crate::grid::Grid;
use glam::DVec3;

/// Order of the error of a cubic in the length of its spans.
const ORDER: f64 = 4.0;
/// How far the length of a span may be corrected by what it leaves: twice as long or half. Beyond that the fourth power is
/// no guide.
const MOST_STRETCH: f64 = 2.0;
/// Spans of a tolerance at least: the seams on both sides move two rows of control points each, and one is left between them.
const FEWEST_SPANS: usize = 2;
/// How much longer a span may be than another, of the way between them: neighbours of which one is more than twice as long as
/// the other swing beside a bend.
const GROWTH: f64 = 1.0;
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
#[derive(Clone)]
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
        spacing: KnotSpacing,
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
        let fits = Fits { chord: self, grids, normals, measure, allowed };
        let dense = match spacing {
            KnotSpacing::Even => vec![1.0 / self.shortest(); self.nodes - 1],
            KnotSpacing::Fitted => fits.dense(&fits.halved()?)?,
        };
        let mut spaced = Spaced { dense, spans: 1, most: self.most(), double: self.double, excess: 0.0, asked: None };
        // Doubled until one does, then halved between.
        let fewest = FEWEST_SPANS.min(spaced.most);
        let (mut low, mut high) = (fewest - 1, fewest);
        loop {
            spaced.spans = high;
            let excess = fits.excess(&spaced)?;
            if excess <= 1.0 {
                break;
            }
            if high == spaced.most {
                return Ok(Spaced { excess, ..spaced });
            }
            (low, high) = (high, (2 * high).min(spaced.most));
        }
        let mut best = fits.least(spaced, low, high)?;
        if spacing == KnotSpacing::Even {
            return Ok(best);
        }
        // Spans that were halved beside a bend may be longer once those at the bend are short.
        while best.spans > fewest {
            let spaced = Spaced { dense: fits.dense(&best.breaks())?, spans: best.spans - 1, ..best.clone() };
            if fits.excess(&spaced)? > 1.0 {
                break;
            }
            best = fits.least(spaced, fewest - 1, best.spans - 1)?;
        }
        Ok(best)
    }

    /// Least length of a span, cells.
    fn shortest(&self) -> f64 {
        (self.nodes - 1) as f64 / self.most() as f64
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

/// The fits of the rows of what a chord crosses, one strand after the other, and what they may leave.
struct Fits<'a> {
    chord: &'a Chord,
    grids: &'a [Grid],
    normals: &'a [Vec<DVec3>],
    measure: Measure,
    /// World units.
    allowed: f64,
}

impl Fits<'_> {
    fn left(&self, knots: &Knots) -> Result<Vec<Vec<f64>>, FitError> {
        self.chord.left(self.grids, self.normals, knots)
    }

    /// How many times what is allowed the worst of the strands leaves.
    fn excess(&self, spaced: &Spaced) -> Result<f64, FitError> {
        let left = self.left(&spaced.knots())?;
        Ok(left.iter().map(|strand| self.measure.of(strand) / self.allowed).fold(0.0, f64::max))
    }

    /// The fewest spans that leave no more than is allowed: more than `low`, at most `high`, which do.
    fn least(&self, mut spaced: Spaced, mut low: usize, mut high: usize) -> Result<Spaced, FitError> {
        while high - low > 1 {
            spaced.spans = (low + high) / 2;
            if self.excess(&spaced)? <= 1.0 {
                high = spaced.spans;
            } else {
                low = spaced.spans;
            }
        }
        Ok(Spaced { spans: high, ..spaced })
    }

    /// What a strand leaves in each span.
    fn in_spans(&self, breaks: &[f64], left: &[f64]) -> Vec<f64> {
        let (nodes, lines) = (self.chord.nodes, left.len() / self.chord.nodes);
        let part = |w: &[f64]| {
            let [from, to] = [w[0], w[1]].map(|t| t * (nodes - 1) as f64);
            let (from, to) = (from.floor() as usize, (to.ceil() as usize).min(nodes - 1));
            self.measure.of(&left[from * lines..(to + 1) * lines])
        };
        breaks.windows(2).map(part).collect()
    }

    /// Spans halved until none leaves too much, or they are as short as the grids carry.
    fn halved(&self) -> Result<Vec<f64>, FitError> {
        let (cells, shortest) = ((self.chord.nodes - 1) as f64, self.chord.shortest());
        let mut breaks = vec![0.0, 1.0];
        loop {
            let mut halve = vec![false; breaks.len() - 1];
            for strand in self.left(&self.chord.knots(&breaks))?.iter().filter(|of| self.measure.of(of) > self.allowed)
            {
                let parts = self.in_spans(&breaks, strand);
                halve.iter_mut().zip(parts).for_each(|(halve, part)| *halve |= part > self.allowed);
            }
            let lengths = breaks.windows(2).map(|w| (w[1] - w[0]) * cells);
            halve.iter_mut().zip(lengths).for_each(|(halve, length)| *halve &= length >= 2.0 * shortest);
            if !halve.contains(&true) {
                return Ok(breaks);
            }
            let mut finer = vec![0.0];
            for (w, halve) in breaks.windows(2).zip(halve) {
                finer.extend(halve.then_some((w[0] + w[1]) / 2.0));
                finer.push(w[1]);
            }
            breaks = finer;
        }
    }

    /// How many spans a fit needs in each cell, by what it leaves with these spans.
    fn dense(&self, breaks: &[f64]) -> Result<Vec<f64>, FitError> {
        let (cells, shortest) = ((self.chord.nodes - 1) as f64, self.chord.shortest());
        let mut worst = vec![0.0f64; breaks.len() - 1];
        for strand in self.left(&self.chord.knots(breaks))? {
            worst.iter_mut().zip(self.in_spans(breaks, &strand)).for_each(|(worst, part)| *worst = worst.max(part));
        }
        let long = |(w, left): (&[f64], &f64)| {
            let stretch = (self.allowed / left.max(f64::MIN_POSITIVE)).powf(1.0 / ORDER);
            (w[1] - w[0]) * cells * stretch.clamp(1.0 / MOST_STRETCH, MOST_STRETCH)
        };
        let long: Vec<f64> = breaks.windows(2).zip(&worst).map(long).collect();
        let at = |cell: f64| long[breaks[1..].partition_point(|&b| b * cells <= cell).min(long.len() - 1)];
        let mut long: Vec<f64> = (0..self.chord.nodes - 1)
            .map(|cell| {
                let middle = cell as f64 + 0.5;
                let here = if self.chord.both_ways { at(middle).min(at(cells - middle)) } else { at(middle) };
                here.max(shortest)
            })
            .collect();
        for cell in 1..long.len() {
            long[cell] = long[cell].min(long[cell - 1] + GROWTH);
        }
        for cell in (1..long.len()).rev() {
            long[cell - 1] = long[cell - 1].min(long[cell] + GROWTH);
        }
        Ok(long.into_iter().map(f64::recip).collect())
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
