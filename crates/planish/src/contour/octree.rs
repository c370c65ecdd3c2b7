//! Adaptive extraction: cells merged into larger ones where the surface is flat.
//!
//! Eight cells become one, level by level, where all that they hold of the surface is one smooth sheet within the
//! tolerance of a plane. The larger cell's loop is made face by face: a face towards a cell at least as large carries one
//! straight segment, any other face inherits the polyline of the smaller cells beyond it. Both sides of a face thus see
//! the same polyline and no crack can open ([K01] §6 leaves these gaps to be filled); and as the larger cell is convex,
//! too, its fan is embedded like any other.

use super::cell::caps::Corner;
use super::cell::patch::{self, Inner, Sheet};
use super::cell::{AMBIGUOUS, CROSSED, links};
use super::walk::Cell;
use crate::field::Directed;
use crate::mesh::FeatureKind;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::HashMap;

/// A cell of some level whose part of the surface is one flat sheet.
struct Block {
    /// For each face the names of the hits at which its polyline begins and ends.
    faces: [Option<[u32; 2]>; 6],
    /// Hits in it, some more than once.
    hits: Vec<u32>,
}

/// Blocks of all levels; from level 0, the cells.
pub struct Octree<'a> {
    field: &'a Directed,
    base: [u32; 3],
    /// Flat blocks by place, for looking up.
    levels: Vec<HashMap<[u32; 3], Block>>,
    /// Blocks that are in no larger one, in order.
    leaves: Vec<(usize, [u32; 3])>,
}

/// A cell that the surface passes, before it is known to be flat.
pub type Candidate = ([u32; 3], Option<[Option<[u32; 2]>; 6]>);

/// A cell's segments on its faces, if it has one loop and no face of two segments.
pub fn candidate(cell: &Cell, base: [u32; 3]) -> Candidate {
    let at = cell.at.map(|x| x as u32);
    if AMBIGUOUS[cell.config as usize] != 0 {
        return (at, None);
    }
    let links = links(cell.config, 0);
    let crossed = CROSSED[cell.config as usize];
    let mut faces = [None; 6];
    let first = crossed.trailing_zeros() as usize;
    let (mut e, mut count) = (first, 0);
    loop {
        let next = links.next[e] as usize;
        let name = |e: usize| base[e / 4] + cell.hit[e];
        faces[links.face[e] as usize] = Some([name(e), name(next)]);
        count += 1;
        e = next;
        if e == first {
            break;
        }
    }
    (at, (count == crossed.count_ones()).then_some(faces))
}

impl<'a> Octree<'a> {
    /// Merges cells.
    /// * `cells` - all cells that the surface passes
    /// * `sharp` - cosine below which two normals make a feature
    /// * `tolerance` - distance from a plane that is still flat, world units
    pub fn new(field: &'a Directed, cells: Vec<Candidate>, sharp: f64, tolerance: f64) -> Octree<'a> {
        let mut octree = Octree { field, base: field.first_names(), levels: Vec::new(), leaves: Vec::new() };
        // Places of all cells of the level, and those of them that are flat.
        let mut current: Vec<([u32; 3], Option<Block>)> = cells
            .into_par_iter()
            .map(|(at, faces)| {
                let block = faces.map(|faces| Block { faces, hits: faces.iter().flatten().map(|s| s[0]).collect() });
                (at, block.filter(|b| octree.is_flat(&b.hits, sharp, f64::INFINITY)))
            })
            .collect();
        while current.iter().any(|c| c.1.is_some()) {
            // Eight neighbours side by side.
            let parent = |at: [u32; 3]| at.map(|x| x / 2);
            current.par_sort_by_key(|c| {
                let [x, y, z] = parent(c.0);
                ([z, y, x], [c.0[2], c.0[1], c.0[0]])
            });
            let groups: Vec<&[([u32; 3], Option<Block>)]> =
                current.chunk_by(|a, b| parent(a.0) == parent(b.0)).collect();
            let next: Vec<([u32; 3], Option<Block>)> = groups
                .par_iter()
                .map(|group| {
                    let merged = octree
                        .merged(octree.levels.len() + 1, group)
                        .filter(|b| octree.is_flat(&b.hits, sharp, tolerance));
                    (parent(group[0].0), merged)
                })
                .collect();
            octree.levels.push(current.into_iter().filter_map(|(at, b)| Some((at, b?))).collect());
            current = next;
        }
        octree.collect_leaves();
        octree
    }

    fn position(&self, id: u32) -> DVec3 {
        let axis = (0..3).rev().find(|&a| id >= self.base[a] && !self.field.axes[a].is_empty()).unwrap_or(0);
        let n = (id - self.base[axis]) as usize;
        let row = self.field.axes[axis].start.partition_point(|&s| s as usize <= n) - 1;
        self.field.position(axis, row, n)
    }

    fn normal(&self, id: u32) -> DVec3 {
        let axis = (0..3).rev().find(|&a| id >= self.base[a] && !self.field.axes[a].is_empty()).unwrap_or(0);
        self.field.axes[axis].hits[(id - self.base[axis]) as usize].normal
    }

    /// True if all hits lie within the tolerance of one plane and face one way.
    fn is_flat(&self, hits: &[u32], sharp: f64, tolerance: f64) -> bool {
        let mean = hits.iter().map(|&h| self.normal(h)).sum::<DVec3>().normalize_or_zero();
        // Twice the deviation from the mean is what two normals differ by at most.
        let limit = ((1.0 + sharp) / 2.0).max(0.0).sqrt();
        if !hits.iter().all(|&h| self.normal(h).dot(mean) > limit) {
            return false;
        }
        if tolerance == f64::INFINITY {
            return true;
        }
        let heights = || hits.iter().map(|&h| mean.dot(self.position(h)));
        heights().fold(f64::NEG_INFINITY, f64::max) - heights().fold(f64::INFINITY, f64::min) <= tolerance
    }

    /// Least and greatest corner of a block.
    fn bounds(&self, level: usize, at: [u32; 3]) -> [DVec3; 2] {
        let size = 1usize << level;
        [0, 1].map(|d| {
            // The last block may reach beyond the lattice: it still is a box.
            let [i, j, k] = at.map(|x| (x as usize + d) * size);
            self.field.lattice.node(i, j, k)
        })
    }

    /// Up to eight neighbours as one block of `level`, if all are flat and each face carries one polyline at most.
    fn merged(&self, level: usize, group: &[([u32; 3], Option<Block>)]) -> Option<Block> {
        let [low, high] = self.bounds(level, group.first()?.0.map(|x| x / 2));
        let mut faces = [None; 6];
        let mut hits = Vec::new();
        for (_, child) in group {
            hits.extend(&child.as_ref()?.hits);
        }
        hits.sort_unstable();
        hits.dedup();
        for (f, face) in faces.iter_mut().enumerate() {
            let segments: Vec<[u32; 2]> = group
                .iter()
                .filter(|(at, _)| at[f / 2] as usize & 1 == f & 1)
                .filter_map(|(_, child)| child.as_ref()?.faces[f])
                .collect();
            if segments.is_empty() {
                continue;
            }
            let path = chained(&segments)?;
            let ends = [*path.first()?, *path.last()?];
            // Both ends on one edge: the segment would lie in two faces.
            let (a, b) = (self.position(ends[0]), self.position(ends[1]));
            let shared = |k: usize| a[k] == b[k] && (a[k] == low[k] || a[k] == high[k]);
            if ends[0] == ends[1] || (0..3).filter(|&k| shared(k)).count() > 1 {
                return None;
            }
            *face = Some(ends);
        }
        let segments: Vec<[u32; 2]> = faces.iter().flatten().copied().collect();
        ring(&segments)?;
        Some(Block { faces, hits })
    }

    fn collect_leaves(&mut self) {
        for level in 1..self.levels.len() {
            let mut leaves: Vec<[u32; 3]> = self.levels[level]
                .keys()
                .filter(|at| self.levels.get(level + 1).is_none_or(|up| !up.contains_key(&at.map(|x| x / 2))))
                .copied()
                .collect();
            leaves.sort_unstable_by_key(|at| [at[2], at[1], at[0]]);
            self.leaves.extend(leaves.into_iter().map(|at| (level, at)));
        }
    }

    /// True if a cell is part of a larger one.
    pub fn is_merged(&self, at: [usize; 3]) -> bool {
        self.levels.get(1).is_some_and(|l| l.contains_key(&at.map(|x| (x / 2) as u32)))
    }

    /// Patches of all larger cells.
    pub fn patches(&self) -> Sheet {
        let sheets: Vec<Sheet> = self
            .leaves
            .par_chunks(256)
            .map(|leaves| {
                let mut sheet = Sheet::default();
                leaves.iter().for_each(|&(level, at)| self.patch(level, at, &mut sheet));
                sheet
            })
            .collect();
        let mut all = Sheet::default();
        for sheet in sheets {
            let (inner, first) = (all.inner.len() as u32, all.triangles.len() as u32);
            let name = |id: u32| if id >= patch::FIRST_INNER { id + inner } else { id };
            all.triangles.extend(sheet.triangles.iter().map(|t| t.map(name)));
            all.inner.extend(&sheet.inner);
            all.cells.extend(sheet.cells.iter().map(|&(at, a, b)| (at, a + first, b + first)));
        }
        all
    }

    fn patch(&self, level: usize, at: [u32; 3], sheet: &mut Sheet) {
        let mut segments = Vec::new();
        for face in 0..6 {
            self.polyline(level, at, face, &mut segments);
        }
        let Some(names) = ring(&segments) else { return };
        let size = 1usize << level;
        let [low, high] = self.bounds(level, at);
        let l: Vec<Corner> = names
            .iter()
            .map(|&id| {
                let p = self.position(id);
                let mut faces = 0;
                for axis in 0..3 {
                    faces |= ((p[axis] == low[axis]) as u8) << (2 * axis)
                        | ((p[axis] == high[axis]) as u8) << (2 * axis + 1);
                }
                Corner { id, p, n: self.normal(id), faces, edge: 0, face: 0, tagged: false }
            })
            .collect();
        let first = sheet.triangles.len() as u32;
        if !patch::flat(&l, &mut sheet.triangles) {
            let p = patch::inside(patch::center(&l), low, high).0;
            sheet.inner.push(Inner { p, kind: FeatureKind::None });
            patch::fan(&l, patch::FIRST_INNER + sheet.inner.len() as u32 - 1, &mut sheet.triangles);
        }
        // Whoever looks for triangles nearby finds them in every cell of the block.
        let end = sheet.triangles.len() as u32;
        let [x, y, z] = at.map(|x| x * size as u32);
        for k in 0..size as u32 {
            for j in 0..size as u32 {
                sheet.cells.extend((0..size as u32).map(|i| ([x + i, y + j, z + k], first, end)));
            }
        }
    }

    /// The segments of a block on one of its faces, as fine as the neighbour beyond it is.
    fn polyline(&self, level: usize, at: [u32; 3], face: usize, out: &mut Vec<[u32; 2]>) {
        let Some(block) = self.levels[level].get(&at) else { return };
        let Some(segment) = block.faces[face] else { return };
        let mut beyond = at.map(|x| x as i64);
        beyond[face / 2] += if face & 1 == 1 { 1 } else { -1 };
        let neighbour = beyond.map(|x| x.max(0) as u32);
        if level == 0 || self.levels[level].contains_key(&neighbour) {
            out.push(segment);
            return;
        }
        for c in 0..8u32 {
            if (c >> (face / 2) & 1) as usize == face & 1 {
                let child = [2 * at[0] + (c & 1), 2 * at[1] + (c >> 1 & 1), 2 * at[2] + (c >> 2 & 1)];
                self.polyline(level - 1, child, face, out);
            }
        }
    }
}

/// Segments as one open path of names.
fn chained(segments: &[[u32; 2]]) -> Option<Vec<u32>> {
    let start = segments.iter().find(|s| segments.iter().all(|t| t[1] != s[0]))?;
    let mut path = vec![start[0], start[1]];
    while let Some(next) = segments.iter().find(|s| s[0] == path[path.len() - 1]) {
        if path.len() > segments.len() {
            return None;
        }
        path.push(next[1]);
    }
    (path.len() == segments.len() + 1).then_some(path)
}

/// Segments as one closed ring of names.
fn ring(segments: &[[u32; 2]]) -> Option<Vec<u32>> {
    let first = segments.first()?;
    let mut names = vec![first[0]];
    let mut at = first[1];
    while at != first[0] {
        if names.len() > segments.len() {
            return None;
        }
        names.push(at);
        at = segments.iter().find(|s| s[0] == at)?[1];
    }
    (names.len() == segments.len()).then_some(names)
}
