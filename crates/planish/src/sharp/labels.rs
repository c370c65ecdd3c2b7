//! Labels: each face of a mesh carries the sheet that it is a part of.
//!
//! [IB12] Isack, Boykov, *Energy-Based Geometric Multi-Model Fitting*, 2012 (PEARL): models are proposed, every place
//! takes one of them by an energy of fit and smoothness, models are fitted anew to the places that took them, and so on.
//! [BVZ01] Boykov, Veksler, Zabih, *Fast Approximate Energy Minimization via Graph Cuts*, 2001, §5: one label after another
//! may take what it wants, each time the best set of faces of all (alpha expansion).
//!
//! The energy, in nats, is `sum_f n_f (rho(h_f) + rho(d_f)) + sum_e n_e`: `h` and `d` are the distance of a face from its sheet
//! and the angle between their normals over the usual ones, `rho(x) = min(x^2, 9) / 2`, `n_f` the number of points that the
//! face stands for. A border costs `n_e`, one for each spacing of its length where the mesh is flat, less where it bends.

use super::charts::{self, Surface};
use super::flanks::ScanScale;
use super::lines::Lines;
use crate::geom::cut::Cut;
use crate::mesh::NONE;
use crate::observe::{Cancelled, Observer};
use rayon::prelude::*;
use std::collections::VecDeque;

/// Beyond three usual deviations a face says only that it does not belong.
const MOST_SQUARED: f64 = 9.0;
/// A border costs this share of its length where the mesh bends by as much as at a sharp edge, or more.
const BENT_SHARE: f64 = 0.2;
/// A label may take faces within so many cells of what it has: as far as extraction shifts an edge.
const REACH_CELLS: f64 = 3.0;
/// A sheet has an area of so many cells at least: more than the triangles around a single vertex have, which extraction may have put
/// beside its place. What is smaller goes to the sheets around it.
const LEAST_SHEET_CELLS: f64 = 2.0;
/// Rounds of taking and fitting.
const LABEL_ROUNDS: usize = 4;
/// Least usual angle between normals, radians, and least usual distance, cells: exact meshes have none.
const LEAST_TURN: f64 = 0.02;
const LEAST_OFF_CELLS: f64 = 0.01;
/// Steps of a nat that cuts count in.
const NAT_STEPS: f64 = 1e4;

/// Labels of the faces of a mesh, and the sheets that they stand for.
pub(super) struct Labels {
    /// For each face its label.
    pub of: Vec<u32>,
    /// For each label its sheet; `None` if it has too few faces.
    pub sheets: Vec<Option<Surface>>,
}

/// What the energy needs.
struct Energy<'a> {
    lines: &'a Lines<'a>,
    /// Points that each face stands for.
    points: Vec<f64>,
    /// Cost of a border along each half-edge, nats.
    border: Vec<f64>,
    /// Usual distance from a sheet, world units, and usual angle between normals, radians.
    usual: [f64; 2],
    cell: f64,
}

impl Labels {
    /// The labels of least energy.
    /// * `bends` - for each half-edge the angle between the faces beside it; `sharp` - that of a sharp edge; radians
    pub fn new(
        lines: &Lines,
        bends: &[f64],
        scale: &ScanScale,
        sharp: f64,
        observer: &dyn Observer,
    ) -> Result<Labels, Cancelled> {
        let (of, count) = charts::charts(lines, bends, sharp, scale.cell);
        observer.check()?;
        let mut labels = Labels { of, sheets: vec![None; count as usize] };
        let price = |h: usize| {
            let share = 1.0 - (1.0 - BENT_SHARE) * (bends[h] / sharp).min(1.0);
            share * lines.mesh.edge_length(h as u32) / scale.spacing
        };
        let mut energy = Energy {
            lines,
            points: lines.areas.iter().map(|a| a.length() / (scale.spacing * scale.spacing)).collect(),
            border: (0..bends.len()).map(price).collect(),
            usual: [LEAST_OFF_CELLS * scale.cell, LEAST_TURN],
            cell: scale.cell,
        };
        labels.fit(&energy);
        let mut band = Band { faces: Vec::new(), place: vec![NONE; labels.of.len()] };
        for _ in 0..LABEL_ROUNDS {
            energy.measure(&labels);
            let mut stays: Vec<i64> = (0..labels.of.len() as u32)
                .into_par_iter()
                .map(|f| energy.cost(f, labels.sheets[labels.of[f as usize] as usize].as_ref()))
                .collect();
            let mut changed = 0;
            // A label gets faces in its own turn alone, so that those it had before the round are all.
            for (label, faces) in labels.faces().into_iter().enumerate() {
                observer.check()?;
                band.fill(&energy, &labels, label as u32, &faces);
                changed += energy.expand(&mut labels, label as u32, &band, &mut stays);
            }
            labels.fit(&energy);
            if changed == 0 {
                break;
            }
        }
        Ok(labels)
    }

    /// The faces of every label.
    pub fn faces(&self) -> Vec<Vec<u32>> {
        let mut faces = vec![Vec::new(); self.sheets.len()];
        self.of.iter().enumerate().for_each(|(f, &label)| faces[label as usize].push(f as u32));
        faces
    }

    /// Fits the sheets to their faces, what does not belong left out.
    fn fit(&mut self, energy: &Energy) {
        let was = std::mem::take(&mut self.sheets);
        let one = |(faces, was): (Vec<u32>, Option<Surface>)| {
            let Some(was) = was else { return Surface::fit(energy.lines, &faces, energy.cell, |_| 1.0) };
            let weight = |f: u32| if energy.misfit(f, &was) < MOST_SQUARED / 2.0 { 1.0 } else { 0.0 };
            Surface::fit(energy.lines, &faces, energy.cell, weight).or(Some(was))
        };
        let count = was.len();
        self.sheets = vec![None; count];
        let faces = self.faces();
        self.sheets = faces
            .into_par_iter()
            .zip(was)
            .map(|(faces, was)| if energy.is_sheet(&faces) { one((faces, was)) } else { None })
            .collect();
    }
}

impl Energy<'_> {
    /// True if so many faces are enough for a sheet.
    fn is_sheet(&self, faces: &[u32]) -> bool {
        let area: f64 = faces.iter().map(|&f| self.lines.areas[f as usize].length()).sum();
        area >= LEAST_SHEET_CELLS * self.cell * self.cell
    }

    /// Distance of a face from a sheet and angle between their normals.
    fn off(&self, f: u32, sheet: &Surface) -> [f64; 2] {
        let (off, normal) = sheet.beside(self.lines.centers[f as usize]);
        let area = self.lines.areas[f as usize];
        [off.abs(), area.cross(normal).length().atan2(area.dot(normal))]
    }

    /// What a face costs with a sheet, for each of its points.
    fn misfit(&self, f: u32, sheet: &Surface) -> f64 {
        let off = self.off(f, sheet);
        (0..2).map(|k| (off[k] / self.usual[k]).powi(2).min(MOST_SQUARED) / 2.0).sum()
    }

    /// What all points of a face cost with a sheet, in steps; without one, more than with any.
    fn cost(&self, f: u32, sheet: Option<&Surface>) -> i64 {
        let of = |sheet| (NAT_STEPS * self.points[f as usize] * self.misfit(f, sheet)).round() as i64;
        sheet.map_or(i64::MAX / 1_000_000, of)
    }

    fn price(&self, h: u32) -> i64 {
        (NAT_STEPS * self.border[h as usize]).round() as i64
    }

    /// Takes the usual deviations from those of all faces: medians of normal ones (factor 1.4826) by area.
    fn measure(&mut self, labels: &Labels) {
        let of = |f: usize| {
            let sheet = labels.sheets[labels.of[f] as usize].as_ref()?;
            Some((self.off(f as u32, sheet), self.points[f]))
        };
        let offs: Vec<([f64; 2], f64)> = (0..labels.of.len()).into_par_iter().filter_map(of).collect();
        for (k, least) in [LEAST_OFF_CELLS * self.cell, LEAST_TURN].into_iter().enumerate() {
            let mut sorted: Vec<(f64, f64)> = offs.iter().map(|o| (o.0[k], o.1)).collect();
            sorted.par_sort_by(|a, b| a.0.total_cmp(&b.0));
            let half = sorted.iter().map(|s| s.1).sum::<f64>() / 2.0;
            let mut sum = 0.0;
            let middle = sorted.iter().find(|s| {
                sum += s.1;
                sum >= half
            });
            self.usual[k] = least.max(1.4826 * middle.map_or(0.0, |m| m.0));
        }
    }

    /// Lets a label take the faces around it that it wants; returns how many it took.
    /// * `band` - those faces; `stays` - what each face costs with the sheet that it has
    fn expand(&self, labels: &mut Labels, label: u32, band: &Band, stays: &mut [i64]) -> usize {
        let sheet = labels.sheets[label as usize].as_ref();
        if sheet.is_none() || band.faces.is_empty() {
            return 0;
        }
        let goes: Vec<i64> = band.faces.iter().map(|&f| self.cost(f, sheet)).collect();
        let mut cut = Cut::new(band.faces.len());
        for ((i, &f), goes) in (0..).zip(&band.faces).zip(&goes) {
            let own = labels.of[f as usize];
            cut.sides(i, stays[f as usize], *goes);
            for h in 3 * f..3 * f + 3 {
                let o = self.lines.adjacency.opposite[h as usize];
                if o == NONE {
                    continue;
                }
                let (other, price) = (labels.of[o as usize / 3], self.price(h));
                match band.place[o as usize / 3] {
                    NONE if other == label => cut.sides(i, price, 0),
                    NONE if other == own => cut.sides(i, 0, price),
                    NONE => {}
                    // Each edge once.
                    j if h < o && other == own => cut.link(i, j, price, price),
                    j if h < o => {
                        cut.sides(j, price, 0);
                        cut.link(i, j, price, 0);
                    }
                    _ => {}
                }
            }
        }
        let takes = cut.least();
        let mut count = 0;
        for ((&f, goes), _) in band.faces.iter().zip(goes).zip(takes).filter(|x| x.1) {
            labels.of[f as usize] = label;
            stays[f as usize] = goes;
            count += 1;
        }
        count
    }
}

/// The faces of other labels near those of a label.
struct Band {
    /// Ascending.
    faces: Vec<u32>,
    /// For each face of the mesh its place among these, or [`NONE`].
    place: Vec<u32>,
}

impl Band {
    /// Takes the faces near those of another label.
    /// * `faces` - those that it has, and others
    fn fill(&mut self, energy: &Energy, labels: &Labels, label: u32, faces: &[u32]) {
        let Band { faces: found, place } = self;
        found.drain(..).for_each(|f| place[f as usize] = NONE);
        if labels.sheets[label as usize].is_none() {
            return;
        }
        let Lines { adjacency, centers, .. } = energy.lines;
        let reach = REACH_CELLS * energy.cell;
        let own = faces.iter().filter(|&&f| labels.of[f as usize] == label);
        let mut queue: VecDeque<(u32, u32)> = own.map(|&f| (f, f)).collect();
        while let Some((f, source)) = queue.pop_front() {
            for h in 3 * f..3 * f + 3 {
                let o = adjacency.opposite[h as usize];
                if o == NONE || labels.of[o as usize / 3] == label || place[o as usize / 3] != NONE {
                    continue;
                }
                if centers[o as usize / 3].distance(centers[source as usize]) < reach {
                    place[o as usize / 3] = source;
                    found.push(o / 3);
                    queue.push_back((o / 3, source));
                }
            }
        }
        found.sort_unstable();
        found.iter().zip(0..).for_each(|(&f, k)| place[f as usize] = k);
    }
}
