//! Smooth cells: one loop whose normals are alike, which is nearly all of them.
//!
//! Of the cells that the surface passes these need no more than a table and the flattest fan over their hits; they are
//! done in one walk. The others are kept for face points and patches ([`super::cell::patch`]): cells with several loops, with an
//! ambiguous face, or with normals that may make a feature ([K01] §4.2).

use super::Thresholds;
use super::cell::RING;
use super::cell::patch::{Sheet, best_fan};
use super::cell::twice::TwicePassed;
use super::polish::local::CellRange;
use super::walk::{Cell, walk};
use crate::field::Directed;
use glam::DVec3;

/// The cells of a few layers.
#[derive(Default)]
pub struct Survey {
    /// Triangles of smooth cells.
    triangles: Vec<[u32; 3]>,
    /// Smooth cells, and the numbers of their first triangles.
    cells: Vec<([u32; 3], u32)>,
    /// All others, each with the number of triangles of smooth cells before it.
    pub others: Vec<(Cell, u32)>,
}

/// The sine of half an angle is safe from rounding by so much.
const ROUNDING: f64 = 1e-9;

/// Looks at the cells of the layers `from..to`.
/// * `points` - positions of the hits
/// * `twice`, `merged` - cells to leave out, and those to leave out where they are smooth
pub fn survey(
    field: &Directed,
    points: &[DVec3],
    limits: &Thresholds,
    (from, to): (usize, usize),
    (twice, merged): (&TwicePassed, impl Fn([usize; 3]) -> bool),
) -> Survey {
    let (mut found, base) = (Survey::default(), field.first_names());
    // Two normals this near to a third have a cosine above the threshold.
    let alike = ((1.0 + limits.faint) / 2.0).max(0.0).sqrt() + ROUNDING;
    walk(field, from, to, |cell| {
        if twice.contains(cell.at) {
            return;
        }
        let before = found.triangles.len() as u32;
        let (count, edges) = &RING[cell.config as usize];
        let edges = &edges[..*count as usize];
        let hit = |e: usize| (e / 4, cell.hit[e]);
        let normal = |e: u8| {
            let (axis, n) = hit(e as usize);
            field.axes[axis].hits[n as usize].normal
        };
        let smooth = !edges.is_empty()
            && (limits.faint <= -1.0 || {
                let first = normal(edges[0]);
                edges[1..].iter().all(|&e| first.dot(normal(e)) > alike)
            });
        if smooth && merged(cell.at) {
            return;
        }
        let mut ids = [0; 6];
        let mut at = [DVec3::ZERO; 6];
        for (k, &e) in edges.iter().enumerate() {
            let (axis, n) = hit(e as usize);
            ids[k] = base[axis] + n;
            at[k] = points[ids[k] as usize];
        }
        let free = |_: usize, _: usize| true;
        let start = match edges.len() {
            _ if !smooth => None,
            3 => Some(0),
            4 => best_fan(&at[..4], free),
            5 => best_fan(&at[..5], free),
            _ => best_fan(&at, free),
        };
        let Some(s) = start else {
            found.others.push((cell.clone(), before));
            return;
        };
        let id = |k: usize| ids[if s + k < edges.len() { s + k } else { s + k - edges.len() }];
        found.cells.push((cell.at.map(|x| x as u32), before));
        for k in 1..edges.len() - 1 {
            found.triangles.push([id(0), id(k), id(k + 1)]);
        }
    });
    found
}

impl Survey {
    /// Number of smooth cells.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Number of triangles of smooth cells.
    pub fn triangles(&self) -> usize {
        self.triangles.len()
    }

    /// The triangles of smooth cells and those of `sheet` in the order of their cells; a sheet that tells nothing of
    /// smooth cells comes after them.
    /// * `name` - names of the vertices of the sheet
    pub fn merge(&self, sheet: &Sheet, name: impl Fn(u32) -> u32, triangles: &mut Vec<[u32; 3]>) {
        let mut done = 0;
        for (&(_, from, to), &before) in sheet.cells.iter().zip(&sheet.before) {
            triangles.extend_from_slice(&self.triangles[done..before as usize]);
            done = before as usize;
            triangles.extend(sheet.triangles[from as usize..to as usize].iter().map(|t| t.map(&name)));
        }
        triangles.extend_from_slice(&self.triangles[done..]);
        if sheet.before.is_empty() {
            triangles.extend(sheet.triangles.iter().map(|t| t.map(&name)));
        }
    }

    /// All cells with the numbers of their triangles, in their order; the first has the number `first`.
    pub fn merged_cells(&self, sheet: &Sheet, first: u32, cells: &mut Vec<CellRange>) {
        let ends = self.cells[1.min(self.cells.len())..].iter().map(|c| c.1).chain([self.triangles.len() as u32]);
        let mut smooth = self.cells.iter().zip(ends).peekable();
        let mut others = sheet.cells.iter().zip(&sheet.before).peekable();
        let mut at = first;
        loop {
            let next = match (smooth.peek(), others.peek()) {
                (Some((s, _)), o) if o.is_none_or(|o| s.1 < *o.1) => smooth.next().map(|(c, end)| (c.0, end - c.1)),
                (_, Some(_)) => others.next().map(|((place, from, to), _)| (*place, to - from)),
                _ => None,
            };
            let Some((place, count)) = next else { break };
            cells.push((place, at, at + count));
            at += count;
        }
        if sheet.before.is_empty() {
            cells.extend(sheet.cells.iter().map(|&(place, from, to)| (place, at + from, at + to)));
        }
    }
}
