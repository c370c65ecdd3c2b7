//! Acute sectors between sharp lines are opened to a quarter turn.
//!
//! A cross that runs along both lines of a sector of less than 45 degrees would turn by nothing between them: no angle is
//! left for the sector in a map, and its faces have no area there. So the sector is declared to be a quarter turn wide:
//! directions are turned a little more at every edge that is crossed in it. The extra turn is a 1-form on edges that is
//! small and nearly closed, so that it spreads over the faces around and no cones come from it.
//!
//! Desobry, Coudert-Osmont, Corman, Ray, Sokolov, *Designing 2D and 3D Non-Orthogonal Frame Fields*, 2021.

use super::edge_weight;
use super::sectors::{Sector, corner_angle, sectors};
use super::widths::{Widths, widths};
use crate::mesh::{Adjacency, NONE, TriMesh, next, previous};
use crate::observe::{Cancelled, Observer};
use planish_sparse::SparseCholesky;
use std::f64::consts::{FRAC_PI_4, TAU};

/// A sector this much below a right angle is acute: what is left of a right angle on noise needs no opening, radians.
const ACUTE_MARGIN: f64 = 0.05;

/// Turns that follow each other within this are one corner, in mean edges: a tooth is two edges long.
const ONE_CORNER: f64 = 1.5;

/// Weight of what the extra turns around a vertex sum to, against the turns themselves.
const CURL_WEIGHT: f64 = 0.05;

/// Weight of the sums that are demanded, against the largest of the others: they hold to its inverse.
const DEMAND: f64 = 1e8;

/// For each half-edge the extra turn on crossing it from its face, radians; opposite half-edges have opposite turns.
/// * `radius` - what the surface turns by within less than this is spread over as much
/// * `teeth` - reach of the corners of a ragged boundary
pub(super) fn openings(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    lines: &[bool],
    radius: f64,
    teeth: f64,
    observer: &dyn Observer,
) -> Result<Vec<f64>, Cancelled> {
    let sectors = sectors(mesh, adjacency, lines);
    let narrow = ONE_CORNER * mesh.mean_edge();
    let Widths { width, excess, ironed } =
        widths(mesh, &sectors, |v| adjacency.is_boundary_vertex(v), narrow, narrow.max(teeth));
    let is_opened = |(&width, &excess): (&i32, &f64)| {
        width == 1 && excess < -ACUTE_MARGIN || excess.abs() > FRAC_PI_4 - ACUTE_MARGIN
    };
    let demands: Vec<f64> =
        width.iter().zip(&excess).map(|sector| if is_opened(sector) { *sector.1 } else { 0.0 }).collect();
    let mut on_lines = vec![false; mesh.points.len()];
    sectors.iter().for_each(|s| on_lines[s.vertex as usize] = true);
    let mut form = Form::new(mesh, adjacency, lines, &sectors, on_lines);
    let spread = spread(mesh, adjacency, &form.on_lines, radius, observer)?;
    let spread = form.solve(&ironed, &spread, 1.0, observer)?;
    if demands.iter().all(|d| *d == 0.0) {
        return Ok(spread);
    }
    let opened = form.solve(&demands, &vec![0.0; mesh.points.len()], CURL_WEIGHT, observer)?;
    Ok(spread.iter().zip(opened).map(|(a, b)| a + b).collect())
}

/// 1-forms on the edges that are no lines.
struct Form<'a> {
    adjacency: &'a Adjacency,
    sectors: &'a [Sector],
    on_lines: Vec<bool>,
    /// Number of each half-edge's unknown.
    number: Vec<u32>,
    /// Weight of each unknown.
    weight: Vec<f64>,
}

impl<'a> Form<'a> {
    fn new(
        mesh: &TriMesh,
        adjacency: &'a Adjacency,
        lines: &[bool],
        sectors: &'a [Sector],
        on_lines: Vec<bool>,
    ) -> Form<'a> {
        let mut form =
            Form { adjacency, sectors, on_lines, number: vec![NONE; 3 * mesh.triangles.len()], weight: Vec::new() };
        for h in 0..form.number.len() as u32 {
            let o = adjacency.opposite[h as usize];
            if o != NONE && h < o && !lines[h as usize] {
                let count = form.weight.len() as u32;
                (form.number[h as usize], form.number[o as usize]) = (count, count);
                form.weight.push(edge_weight(mesh, adjacency, lines, h));
            }
        }
        form
    }

    /// The least 1-form with these sums: over each sector (held) and around each vertex off the lines (with this weight
    /// beside the form itself; at 1 it is held as well).
    fn solve(
        &mut self,
        in_sectors: &[f64],
        around: &[f64],
        curl: f64,
        observer: &dyn Observer,
    ) -> Result<Vec<f64>, Cancelled> {
        let count = self.weight.len();
        let heaviest = self.weight.iter().fold(0.0f64, |m, w| m.max(*w));
        let held = DEMAND * heaviest;
        let curl = if curl < 1.0 { curl } else { held };
        let mut entries: Vec<(usize, usize, f64)> = self.weight.iter().enumerate().map(|(i, &w)| (i, i, w)).collect();
        let mut rhs = vec![0.0; count];
        let sign = |h: u32| if h < self.adjacency.opposite[h as usize] { 1.0 } else { -1.0 };
        let mut demand = |spokes: &[u32], turn: f64, weight: f64| {
            // On the way around, edges are crossed out of the faces before them.
            let crossed: Vec<u32> = spokes.iter().map(|&h| self.adjacency.opposite[h as usize]).collect();
            for (i, &g) in crossed.iter().enumerate() {
                rhs[self.number[g as usize] as usize] += weight * turn * sign(g);
                for &h in &crossed[..=i] {
                    let [a, b] = [g, h].map(|h| self.number[h as usize] as usize);
                    entries.push((a.max(b), a.min(b), weight * sign(g) * sign(h)));
                }
            }
        };
        for (sector, &turn) in self.sectors.iter().zip(in_sectors) {
            demand(&sector.spokes[1..], turn, held);
        }
        for (v, &turn) in around.iter().enumerate() {
            if !self.on_lines[v] && self.adjacency.outgoing[v] != NONE {
                demand(&self.adjacency.fan(v as u32).collect::<Vec<u32>>(), turn, curl);
            }
        }
        let factor = SparseCholesky::factor_watched(count, entries, &|| observer.cancelled()).ok_or(Cancelled)?;
        // Faces without area leave it singular; then everything stays as it is.
        if let Ok(factor) = factor {
            factor.solve(&mut rhs);
        } else {
            rhs.fill(0.0);
        }
        let value = |(h, &n): (usize, &u32)| if n == NONE { 0.0 } else { sign(h as u32) * rhs[n as usize] };
        Ok(self.number.iter().enumerate().map(value).collect())
    }
}

/// For each vertex off the lines how much more it is to turn by when the curvature of the surface is spread over a radius.
fn spread(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    on_lines: &[bool],
    radius: f64,
    observer: &dyn Observer,
) -> Result<Vec<f64>, Cancelled> {
    let count = mesh.points.len();
    let mut defect = vec![0.0; count];
    let mut area = vec![0.0; count];
    for h in 0..3 * mesh.triangles.len() as u32 {
        let v = mesh.origin(h) as usize;
        defect[v] -= corner_angle(mesh, h);
        area[v] += mesh.area(h as usize / 3) / 3.0;
    }
    let free = |v: usize| !on_lines[v] && adjacency.outgoing[v] != NONE;
    (0..count).for_each(|v| defect[v] = if free(v) { defect[v] + TAU } else { 0.0 });
    // One step of diffusion of the density: (area + time * Laplacian) density = defect; the defects keep their sum.
    let time = radius * radius / 4.0;
    let mut entries: Vec<(usize, usize, f64)> =
        area.iter().enumerate().map(|(v, area)| (v, v, area.max(f64::MIN_POSITIVE))).collect();
    for h in 0..3 * mesh.triangles.len() as u32 {
        let o = adjacency.opposite[h as usize];
        let (a, b) = (mesh.origin(h) as usize, mesh.origin(next(h)) as usize);
        if o != NONE && h < o && free(a) && free(b) {
            let weight = time * cotangents(mesh, h, o).max(0.0);
            entries.extend([(a, a, weight), (b, b, weight), (a.max(b), a.min(b), -weight)]);
        }
    }
    let factor = SparseCholesky::factor_watched(count, entries, &|| observer.cancelled()).ok_or(Cancelled)?;
    let Ok(factor) = factor else { return Ok(vec![0.0; count]) };
    let mut density = defect.clone();
    factor.solve(&mut density);
    Ok((0..count).map(|v| if free(v) { density[v] * area[v] - defect[v] } else { 0.0 }).collect())
}

/// Half the sum of the cotangents of the angles opposite an edge.
fn cotangents(mesh: &TriMesh, h: u32, o: u32) -> f64 {
    let one = |h: u32| {
        let angle = corner_angle(mesh, previous(h));
        angle.cos() / angle.sin().max(1e-6)
    };
    (one(h) + one(o)) / 2.0
}
