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
use std::collections::{BTreeMap, VecDeque};

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
        for _ in 0..LABEL_ROUNDS {
            energy.measure(&labels);
            let mut changed = 0;
            // A label gets faces in its own turn alone, so that those it had before the round are all.
            for (label, faces) in labels.faces().into_iter().enumerate() {
                observer.check()?;
                changed += energy.expand(&mut labels, label as u32, &faces);
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

    fn cost(&self, f: u32, sheet: &Surface) -> i64 {
        (NAT_STEPS * self.points[f as usize] * self.misfit(f, sheet)).round() as i64
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
    /// * `faces` - those that it has, and others
    fn expand(&self, labels: &mut Labels, label: u32, faces: &[u32]) -> usize {
        let Some(sheet) = labels.sheets[label as usize].clone() else { return 0 };
        let band = self.band(labels, label, faces);
        if band.is_empty() {
            return 0;
        }
        let name = |f: u32| band.binary_search(&f).ok().map(|i| i as u32);
        let mut cut = Cut::new(band.len());
        for (i, &f) in band.iter().enumerate() {
            let own = labels.of[f as usize];
            let stays = labels.sheets[own as usize].as_ref().map_or(i64::MAX / 1_000_000, |s| self.cost(f, s));
            cut.sides(i as u32, stays, self.cost(f, &sheet));
            for h in 3 * f..3 * f + 3 {
                let o = self.lines.adjacency.opposite[h as usize];
                if o == NONE {
                    continue;
                }
                let (other, price) = (labels.of[o as usize / 3], self.price(h));
                match name(o / 3) {
                    // Each edge once.
                    Some(j) if h < o && other == own => cut.link(i as u32, j, price, price),
                    Some(j) if h < o => {
                        cut.sides(j, price, 0);
                        cut.link(i as u32, j, price, 0);
                    }
                    Some(_) => {}
                    None if other == label => cut.sides(i as u32, price, 0),
                    None if other == own => cut.sides(i as u32, 0, price),
                    None => {}
                }
            }
        }
        let takes = cut.least();
        let taken = band.iter().zip(takes).filter(|x| x.1);
        let mut count = 0;
        for (&f, _) in taken {
            labels.of[f as usize] = label;
            count += 1;
        }
        count
    }

    /// The faces of other labels near those of a label, ascending.
    fn band(&self, labels: &Labels, label: u32, faces: &[u32]) -> Vec<u32> {
        let opposite = &self.lines.adjacency.opposite;
        let reach = REACH_CELLS * self.cell;
        let mut from: BTreeMap<u32, u32> = BTreeMap::new();
        let mut queue = VecDeque::new();
        for &f in faces.iter().filter(|&&f| labels.of[f as usize] == label) {
            queue.push_back((f, f));
        }
        while let Some((f, source)) = queue.pop_front() {
            for h in 3 * f..3 * f + 3 {
                let o = opposite[h as usize];
                if o == NONE || labels.of[o as usize / 3] == label || from.contains_key(&(o / 3)) {
                    continue;
                }
                if self.lines.centers[o as usize / 3].distance(self.lines.centers[source as usize]) < reach {
                    from.insert(o / 3, source);
                    queue.push_back((o / 3, source));
                }
            }
        }
        from.into_keys().collect()
    }
}
