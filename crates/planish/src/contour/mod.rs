//! Directed fields to triangle meshes with exact edges and corners.
//!
//! [K01] Kobbelt, Botsch, Schwanecke, Seidel, *Feature Sensitive Surface Extraction from Volume Data*, §4.
//! 1. one walk over all cells: a first bound of the feature test  - §4.2; smooth cells are done at once ([`survey`](self))
//! 2. loops of each other cell ([`cell`](self))  - §4, one rule per face
//! 3. feature test and vertex  - §4.2, §4.3, eq. 1      4. face points  - in place of the flips of §4, fig. 9
//! 5. patches that are embedded by construction or by exact signs
//!
//! Departs from [K01]: the result is certified. Every vertex lies in its cell, cells meet in shared polylines, and a
//! cell's patches are accepted only if they are embedded and disjoint; so the mesh is manifold, closed where the field
//! is known, and free of self-intersections, in parallel and without looking at neighbours. Feature vertices that
//! belong elsewhere (an edge that pokes through a cell without changing a corner) are moved there afterwards, each only
//! if exact signs allow it ([`polish`](self)).

mod cell;
#[cfg(test)]
mod certificate;
mod octree;
mod polish;
mod sources;
mod survey;
mod walk;

use crate::contour::cell::face::FacePoints;
use crate::contour::cell::patch::{FIRST_INNER, Patcher, Scratch, Sheet};
use crate::contour::cell::twice::TwicePassed;
use crate::contour::octree::Octree;
use crate::contour::polish::local::CellRange;
use crate::contour::survey::Survey;
use crate::field::directed::Hits;
use crate::field::{Creases, Directed};
use crate::mesh::{FeatureKind, FeatureTags, TriMesh};
use crate::observe::{Cancelled, Observer};
use cell::face;
pub use polish::FieldCreases;
pub use sources::{Meshed, MeshingError, Sampling, from_field, from_grid, from_mesh, from_part, on_lattice};

use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How to extract.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ContourParams {
    /// Two normals in a cell make a feature if their cosine is below this (theta_sharp)
    #[schemars(range(min = -1.0, max = 1.0), extend("unit" = "cosine"))]
    pub sharp: f64,
    /// A feature is a corner if a normal leaves the plane of the most opposed two by more than this (phi_corner)
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "sine"))]
    pub corner: f64,
    /// No features: the standard algorithm
    pub plain: bool,
    /// Merge cells where the surface is flat within this distance; all cells have one size if not given
    #[schemars(range(min = 0.0), extend("unit" = "input units"))]
    pub adaptive: Option<f64>,
}

impl Default for ContourParams {
    fn default() -> Self {
        ContourParams { sharp: 0.9, corner: 0.7, plain: false, adaptive: None }
    }
}

/// Why there is no mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ContourError {
    /// The surface passes no cell.
    #[error("the surface passes none of the {} x {} x {} cells; use a smaller voxel or check the input", cells[0], cells[1], cells[2])]
    Nothing {
        /// Cells along the axes.
        cells: [usize; 3],
    },
    /// More vertices than can be named.
    #[error("{vertices} vertices are more than a mesh can hold (2147483647); use a larger voxel")]
    TooLarge {
        /// Vertices of the mesh.
        vertices: usize,
    },
    /// The observer wants no result any more.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// A mesh with its features.
#[derive(Clone, Debug)]
pub struct Extracted {
    /// The mesh, with the attribute `feature`.
    pub mesh: TriMesh,
    /// Its feature vertices and edges.
    pub tags: FeatureTags,
    /// Figures.
    pub counts: ContourCounts,
}

/// What happened in the cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ContourCounts {
    /// Cells that the surface passes.
    pub cells: usize,
    /// Cells whose feature had to be given up.
    pub fallbacks: usize,
    /// Cells whose patches were pushed in from the boundary: coarse but embedded.
    pub pushed: usize,
    /// Feature vertices that belong outside their cell and could be moved there, and those that could not.
    pub moved: usize,
    /// Feature vertices that stayed in their cell though they belong elsewhere.
    pub kept: usize,
}

impl std::ops::AddAssign for ContourCounts {
    fn add_assign(&mut self, other: ContourCounts) {
        self.cells += other.cells;
        self.fallbacks += other.fallbacks;
        self.pushed += other.pushed;
        self.moved += other.moved;
        self.kept += other.kept;
    }
}

/// Thresholds of one run.
pub struct Thresholds {
    /// Cosine below which two normals make a feature.
    pub sharp: f64,
    /// Sine above which a feature is a corner.
    pub corner: f64,
    /// Cosine below which the source may know of a feature: at least `sharp`.
    pub faint: f64,
}

/// Layers of cells that a task takes at once, and cells with edges that are passed twice.
const LAYERS_PER_TASK: usize = 8;
const CROWDED_PER_TASK: usize = 256;
/// Normals within one merged cell of the standard algorithm differ by less than this (cosine).
const SMOOTH_COSINE: f64 = 0.9;
/// Normals that differ by less than so many times their noise are no evidence of a feature.
const NOISE: f64 = 3.0;

/// Extracts the surface of a directed field.
/// * `creases` - corrects the features, where the source knows them better than its hits tell
/// # Errors
/// [`ContourError`] if there is no surface, it is too large, or if cancelled.
/// Source: [K01] §4.
pub fn extract(
    field: &Directed,
    creases: Option<&dyn Creases>,
    params: &ContourParams,
    observer: &dyn Observer,
) -> Result<Extracted, ContourError> {
    let creases = creases.filter(|_| !params.plain);
    let limits = thresholds(field, creases, params);
    // The standard algorithm has a hit where two nodes differ, and nowhere else.
    let twice = if params.plain { TwicePassed::default() } else { TwicePassed::new(field) };
    let lists = if params.plain { vec![&field.axes] } else { vec![&field.axes, &field.twice] };
    let hits: usize = lists.iter().copied().flatten().map(Hits::len).sum();
    if hits as u64 >= FIRST_INNER as u64 {
        return Err(ContourError::TooLarge { vertices: hits });
    }
    let layers = field.lattice.cells[2];
    let chunks: Vec<(usize, usize)> =
        (0..layers).step_by(LAYERS_PER_TASK).map(|from| (from, (from + LAYERS_PER_TASK).min(layers))).collect();

    let mut points = hit_positions(field, &lists);
    // Standard cells have no features to keep, but no reason to bend either.
    let sharp = if params.plain { SMOOTH_COSINE } else { limits.faint };
    let tolerance = params.adaptive.filter(|t| *t > 0.0);
    let octree = tolerance.map(|tolerance| larger_cells(field, &chunks, &twice, (sharp, tolerance)));
    let merged = |at: [usize; 3]| octree.as_ref().is_some_and(|o| o.is_merged(at));
    let crowded = twice.cells(field);
    let surveys: Option<Vec<Survey>> = chunks
        .par_iter()
        .map(|&layers| {
            (!observer.cancelled()).then(|| survey::survey(field, &points, &limits, layers, (&twice, merged)))
        })
        .collect();
    let surveys = surveys.ok_or(Cancelled)?;
    observer.progress(0.3);
    let of_others = surveys.par_iter().map(|survey| {
        let cells = survey.others.iter().filter(|_| !params.plain).map(|(cell, _)| cell);
        (!observer.cancelled()).then(|| face::face_points(field, &limits, creases, &twice, cells))
    });
    let of_crowded = crowded
        .par_chunks(CROWDED_PER_TASK)
        .map(|cells| (!observer.cancelled()).then(|| face::face_points(field, &limits, creases, &twice, cells.iter())));
    let parts: Option<Vec<face::Part>> = of_others.chain(of_crowded).collect();
    let (faces, mut wishes) = FacePoints::join(field, parts.ok_or(Cancelled)?, hits as u32);
    observer.progress(0.6);
    let (base, refine) = (field.first_names(), creases);
    let patcher = Patcher { field, points: &points, limits: &limits, faces: &faces, refine, base, twice: &twice };
    let sheets = sheets(&patcher, &surveys, merged, observer);
    let mut sheets = sheets.ok_or(Cancelled)?;
    let mut surveys = surveys;
    let of_crowded = |cells: &[walk::Cell]| {
        let (mut sheet, mut scratch) = (Sheet::default(), Scratch::default());
        cells.iter().for_each(|cell| patcher.patch(cell, &mut scratch, &mut sheet));
        sheet
    };
    sheets.par_extend(crowded.par_chunks(CROWDED_PER_TASK).map(of_crowded));
    surveys.resize_with(sheets.len(), Survey::default);
    if let Some(octree) = &octree {
        // Larger cells come after all others.
        sheets.push(octree.patches());
        surveys.push(Survey::default());
    }
    observer.progress(0.8);

    let outer = hits + faces.len();
    let inner: usize = sheets.iter().map(|s| s.inner.len()).sum();
    if (outer + inner) as u64 >= FIRST_INNER as u64 {
        return Err(ContourError::TooLarge { vertices: outer + inner });
    }
    points.reserve(faces.len() + inner);
    points.extend(faces.positions());
    let mut kinds = vec![FeatureKind::None; hits];
    kinds.extend(faces.kinds());
    let Joined { mut mesh, mut tags, mut counts } = joined(points, kinds, &surveys, &sheets, &mut wishes);
    let (vertices, triangles) = (mesh.points.len(), mesh.triangles.len());
    if triangles == 0 {
        return Err(ContourError::Nothing { cells: field.lattice.cells });
    }
    let cells = || cells_of(&surveys, &sheets, octree.is_none() && crowded.is_empty());
    let source = polish::Source { creases, sharp: limits.sharp };
    let polished = polish::polish(&mut mesh, &mut tags, field, &wishes, cells, &source);
    (counts.moved, counts.kept) = (polished.moved, polished.kept);
    // Every hit is a vertex, but at the boundary of what is known, in larger cells, and where vertices were merged or added.
    let unchanged = mesh.triangles.len() == triangles && mesh.points.len() == vertices;
    let complete = !field.sides.unknown && octree.is_none() && unchanged;
    let mut extracted = Extracted { mesh, tags: in_order(tags), counts };
    if !complete {
        drop_unused(&mut extracted);
    }
    extracted.tags.mark(&mut extracted.mesh);
    observer.progress(1.0);
    Ok(extracted)
}

/// All cells with their triangles, in the order of z, y, x.
/// * `is_ordered` - those of the surveys are in that order
fn cells_of(surveys: &[Survey], sheets: &[Sheet], is_ordered: bool) -> Vec<CellRange> {
    let (mut cells, mut first) = (Vec::new(), 0);
    for (survey, sheet) in surveys.iter().zip(sheets) {
        survey.merged_cells(sheet, first, &mut cells);
        first += (survey.triangles() + sheet.triangles.len()) as u32;
    }
    if !is_ordered {
        cells.par_sort_unstable_by_key(|c| [c.0[2], c.0[1], c.0[0]]);
    }
    cells
}

/// What is cut out of the cells of each survey that are neither standard nor in a larger cell; `None` where the observer stops it.
fn sheets(
    patcher: &Patcher,
    surveys: &[Survey],
    is_merged: impl Fn([usize; 3]) -> bool + Sync,
    observer: &dyn Observer,
) -> Option<Vec<Sheet>> {
    let of = |survey: &Survey| {
        let (mut sheet, mut scratch) = (Sheet::default(), Scratch::default());
        for (cell, before) in survey.others.iter().filter(|(cell, _)| !is_merged(cell.at)) {
            patcher.patch(cell, &mut scratch, &mut sheet);
            sheet.before.push(*before);
        }
        sheet
    };
    surveys.par_iter().map(|survey| (!observer.cancelled()).then(|| of(survey))).collect()
}

/// The cells that flat ones are merged to.
/// * `chunks` - layers of each task
/// * `twice` - cells that stay as they are
fn larger_cells<'a>(
    field: &'a Directed,
    chunks: &[(usize, usize)],
    twice: &TwicePassed,
    (sharp, tolerance): (f64, f64),
) -> Octree<'a> {
    let cells = chunks.par_iter().flat_map_iter(|&(from, to)| {
        let (base, mut cells) = (field.first_names(), Vec::new());
        walk::walk(field, from, to, |cell| {
            if !twice.contains(cell.at) {
                cells.push(octree::candidate(cell, base));
            }
        });
        cells
    });
    let crowded = twice.cells(field).into_iter().map(|cell| (cell.at.map(|x| x as u32), None));
    let cells: Vec<octree::Candidate> = cells.collect::<Vec<_>>().into_iter().chain(crowded).collect();
    Octree::new(field, cells, sharp, tolerance)
}

/// All parts of a surface in one mesh.
struct Joined {
    mesh: TriMesh,
    /// Edges in any order.
    tags: FeatureTags,
    counts: ContourCounts,
}

/// Joins the parts; their wishes come after the others.
/// * `points`, `kinds` - of the vertices on the edges and faces of cells
fn joined(
    mut points: Vec<DVec3>,
    mut kinds: Vec<FeatureKind>,
    surveys: &[Survey],
    sheets: &[Sheet],
    wishes: &mut Vec<(u32, DVec3)>,
) -> Joined {
    let mut counts = ContourCounts::default();
    let count = surveys.iter().map(Survey::triangles).chain(sheets.iter().map(|s| s.triangles.len())).sum();
    let (mut triangles, mut edges) = (Vec::with_capacity(count), Vec::new());
    for (survey, sheet) in surveys.iter().zip(sheets) {
        // Inner vertices get their numbers after all those before.
        let first = points.len() as u32;
        let name = |id: u32| if id >= FIRST_INNER { id - FIRST_INNER + first } else { id };
        survey.merge(sheet, name, &mut triangles);
        edges.extend(sheet.edges.iter().map(|e| e.map(name)));
        wishes.extend(sheet.wishes.iter().map(|(id, p)| (name(*id), *p)));
        points.extend(sheet.inner.iter().map(|i| i.p));
        kinds.extend(sheet.inner.iter().map(|i| i.kind));
        counts.cells += survey.len() + sheet.cells.len();
        counts.fallbacks += sheet.fallbacks;
        counts.pushed += sheet.pushed;
    }
    Joined { mesh: TriMesh::new(points, triangles), tags: FeatureTags { vertices: kinds, edges }, counts }
}

fn thresholds(field: &Directed, creases: Option<&dyn Creases>, params: &ContourParams) -> Thresholds {
    if params.plain {
        return Thresholds { sharp: -2.0, corner: 2.0, faint: -2.0 };
    }
    let noise = (NOISE * field.noise_deg).min(180.0).to_radians().cos();
    let sharp = params.sharp.min(noise);
    Thresholds { sharp, corner: params.corner, faint: creases.map_or(sharp, |c| c.faint().max(sharp)) }
}

/// Features whose edges came in any order, as [`FeatureTags`] has them.
fn in_order(mut tags: FeatureTags) -> FeatureTags {
    tags.edges.iter_mut().for_each(|[a, b]| (*a, *b) = ((*a).min(*b), (*a).max(*b)));
    tags.edges.par_sort_unstable();
    tags.edges.dedup();
    tags
}

/// Rows whose hits a task places at once.
const ROWS: usize = 4096;

/// Positions of all hits by their names.
fn hit_positions(field: &Directed, lists: &[&[Hits; 3]]) -> Vec<DVec3> {
    let rows = field.lattice.rows();
    let tasks = |lists: &[Hits; 3]| -> Vec<(usize, usize)> {
        let axes = (0..3).filter(|&axis| !lists[axis].is_empty());
        axes.flat_map(|axis| (0..rows).step_by(ROWS).map(move |r| (axis, r))).collect()
    };
    let mut points = Vec::with_capacity(lists.iter().copied().flatten().map(Hits::len).sum());
    for lists in lists {
        let of = |(axis, from): (usize, usize)| {
            let (hits, to) = (&lists[axis], (from + ROWS).min(rows));
            let mut points = Vec::with_capacity((hits.start[to] - hits.start[from]) as usize);
            for row in from..to {
                points.extend((hits.start[row]..hits.start[row + 1]).map(|n| field.place(axis, row, hits, n as usize)));
            }
            points
        };
        let parts: Vec<Vec<DVec3>> = tasks(lists).into_par_iter().map(of).collect();
        parts.iter().for_each(|part| points.extend_from_slice(part));
    }
    points
}

/// Leaves out vertices that no triangle uses: hits at the boundary of what is known.
fn drop_unused(extracted: &mut Extracted) {
    let mesh = &mut extracted.mesh;
    let mut used = vec![false; mesh.points.len()];
    for &v in mesh.triangles.iter().flatten() {
        used[v as usize] = true;
    }
    if used.iter().all(|&u| u) {
        return;
    }
    let mut name = vec![u32::MAX; used.len()];
    let mut count = 0;
    for v in 0..used.len() {
        if used[v] {
            name[v] = count;
            mesh.points[count as usize] = mesh.points[v];
            extracted.tags.vertices[count as usize] = extracted.tags.vertices[v];
            count += 1;
        }
    }
    mesh.points.truncate(count as usize);
    extracted.tags.vertices.truncate(count as usize);
    for t in &mut mesh.triangles {
        *t = t.map(|v| name[v as usize]);
    }
    extracted.tags.edges.retain(|e| e.iter().all(|&v| used[v as usize]));
    for e in &mut extracted.tags.edges {
        *e = e.map(|v| name[v as usize]);
    }
}
