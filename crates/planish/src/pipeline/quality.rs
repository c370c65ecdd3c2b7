//! Figures of quality of a model against its mesh, and what a user should know about them.
//!
//! See `docs/methods/measuring.md`; the keys are in `docs/guide/report.md`.

use super::hint::{across, few, in_script, relax_near};
use super::{Figure, PipelineError, Quality, Warning};
use super::{key, sound};
use crate::geom::is_positive;
use crate::grid::{self, Grid};
use crate::layout::Method;
use crate::mend::Repairs;
use crate::mesh::{self, CompareParams, Comparison, TriMesh};
use crate::model::Model;
use crate::network::{CurveKind, Network, PatchMesh};
use crate::observe::{Cancelled, Observer, Part, counted};
use crate::relief::{self, PatchedMesh};
use crate::surface::basis::uniform_parameters;
use crate::surface::{self, BENT_DEG, Deviation, EdgeInSeam, SeamQuality, Surface};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Quads per knot span and direction, at most, in the mesh that stands for a surface when distances are measured:
/// between them a cubic span with a turn of 30 degrees leaves its chord by less than 1/500 of its length.
const CUTS_PER_SPAN: usize = 6;
/// Fewer quads do if the mesh leaves the surfaces by this share of the distances to be measured (root mean squares):
/// it then adds a thousandth to them.
const CHORD_SHARE: f64 = 0.05;
/// Distances below this share of the diagonal are not told apart: the precision of files with `f32` positions.
const FLOAT_PRECISION: f64 = 1e-7;

/// What [`measure`] finds.
pub(super) struct Measured {
    pub quality: Quality,
    pub seams: Vec<SeamQuality>,
    pub warnings: Vec<Warning>,
}

/// Measures `model` against its mesh.
pub(super) fn measure(
    model: &Model,
    patches: &[PatchMesh],
    repairs: &Repairs,
    observer: &dyn Observer,
) -> Result<Measured, PipelineError> {
    let mut quality = Quality::new();
    let mut warnings = Vec::new();
    let diagonal = model.mesh.bounds().diagonal();
    mesh_figures(&model.mesh, &model.network, repairs, &mut quality, &mut warnings);
    network_figures(&model.network, &mut quality);
    observer.check()?;
    grid_figures(model, patches, &mut quality, &mut warnings, observer)?;
    let seams = seam_figures(model, diagonal, &mut quality, &mut warnings, observer)?;
    sound::figures(model, &mut quality, &mut warnings, observer)?;
    observer.progress(0.1);

    let control: usize = model.surfaces.iter().map(|s| s.control.len()).sum();
    quality.insert(key::SURFACE_CONTROL_POINTS.into(), Figure::Count(control as u64));
    let one = |(s, g): (&Surface, &Grid)| {
        observer.check()?;
        Ok(surface::normal_deviation_of(s, g))
    };
    let patches_off: Result<Vec<Deviation>, Cancelled> = model.surfaces.par_iter().zip(&model.grids).map(one).collect();
    let patches_off = patches_off?;
    let worst = |of: fn(&Deviation) -> f64| patches_off.iter().map(of).fold(0.0, f64::max);
    length(&mut quality, key::SURFACE_PATCH_RMS_MAX, worst(|d| d.rms), diagonal);
    length(&mut quality, key::SURFACE_PATCH_P95_MAX, worst(|d| d.p95), diagonal);
    length(&mut quality, key::SURFACE_PATCH_MAX, worst(|d| d.max), diagonal);
    let base = surface_mesh(model, observer)?;
    distances(&mut quality, "surface", &compare(&model.mesh, &base, &Part::new(observer, 0.1, 0.45))?, diagonal);
    drop(base);
    let displaced = displaced_mesh(model, observer)?;
    distances(
        &mut quality,
        "displaced",
        &compare(&model.mesh, &displaced, &Part::new(observer, 0.55, 0.45))?,
        diagonal,
    );
    relief_figures(model, diagonal, &mut quality, &mut warnings, observer)?;
    observer.progress(1.0);
    Ok(Measured { quality, seams, warnings })
}

/// The surfaces of a model with their displacement as one mesh: its grids.
/// # Errors
/// If the parts of the model do not belong together.
pub fn displaced_mesh(model: &Model, observer: &dyn Observer) -> Result<TriMesh, PipelineError> {
    Ok(relief::displaced_mesh(&model.network, &model.surfaces, &model.reliefs, observer)?)
}

/// As [`displaced_mesh`], with the patches.
/// # Errors
/// As [`displaced_mesh`].
pub fn displaced_patches(model: &Model, observer: &dyn Observer) -> Result<PatchedMesh, PipelineError> {
    Ok(relief::displaced_patches(&model.network, &model.surfaces, &model.reliefs, observer)?)
}

/// The smooth surfaces of a model as one mesh, fine enough to measure distances on.
/// # Errors
/// If the parts of the model do not belong together.
pub fn surface_mesh(model: &Model, observer: &dyn Observer) -> Result<TriMesh, PipelineError> {
    surface_patches(model, observer).map(|patched| patched.mesh)
}

/// As [`surface_mesh`], with the patches.
/// # Errors
/// As [`surface_mesh`].
pub fn surface_patches(model: &Model, observer: &dyn Observer) -> Result<PatchedMesh, PipelineError> {
    // Sampling relies on sound surfaces.
    model.surfaces.iter().try_for_each(Surface::check).map_err(relief::ReliefError::from)?;
    let shapes = relief::span_shapes(&model.surfaces, cuts_to_measure(model, observer)?);
    Ok(relief::surface_patches(&model.network, &model.surfaces, &shapes, observer)?)
}

/// The smooth surfaces of a model as one mesh, with `cuts` quads per knot span and direction.
/// # Errors
/// If the parts of the model do not belong together.
pub fn surface_mesh_cut(model: &Model, cuts: usize, observer: &dyn Observer) -> Result<TriMesh, PipelineError> {
    let shapes = relief::span_shapes(&model.surfaces, cuts);
    Ok(relief::surface_mesh(&model.network, &model.surfaces, &shapes, observer)?)
}

/// Knot spans of all surfaces of a model.
pub fn span_count(model: &Model) -> usize {
    relief::span_shapes(&model.surfaces, 1).iter().map(|[rows, cols]| (rows - 1) * (cols - 1)).sum()
}

/// Quads per knot span that let distances to the surfaces be measured on their mesh.
///
/// A triangle of a net of steps `h` leaves a surface by at most `h^2 (|S_uu| + 2 |S_uv| + |S_vv|) / 8` (Filip,
/// Magedson, Markot 1986, *Surface Algorithms Using Bounds on Derivatives*).
fn cuts_to_measure(model: &Model, observer: &dyn Observer) -> Result<usize, Cancelled> {
    let diagonal = model.mesh.bounds().diagonal();
    let squares = |s: &Surface, wanted: f64| {
        let [rows, cols] = relief::span_shapes(std::slice::from_ref(s), 1)[0];
        let (us, vs) = (uniform_parameters(cols), uniform_parameters(rows));
        let (hu, hv) = (1.0 / (cols - 1) as f64, 1.0 / (rows - 1) as f64);
        let [uu, uv, vv] = [[2, 0], [1, 1], [0, 2]].map(|order| s.sample(&us, &vs, order));
        let leave =
            uu.iter().zip(&uv).zip(&vv).map(|((uu, uv), vv)| {
                (hu * hu * uu.length() + 2.0 * hu * hv * uv.length() + hv * hv * vv.length()) / 8.0
            });
        (leave.map(|e| e * e).sum::<f64>(), us.len() * vs.len(), wanted * wanted * (us.len() * vs.len()) as f64)
    };
    let one = |(s, g): (&Surface, &Grid)| {
        observer.check()?;
        Ok(squares(s, surface::deviation_of(s, g).rms))
    };
    let each: Result<Vec<(f64, usize, f64)>, Cancelled> =
        model.surfaces.par_iter().zip(&model.grids).map(one).collect();
    let each = each?;
    let count = each.iter().map(|e| e.1).sum::<usize>().max(1) as f64;
    let leave = (each.iter().map(|e| e.0).sum::<f64>() / count).sqrt();
    let wanted = CHORD_SHARE * (each.iter().map(|e| e.2).sum::<f64>() / count).sqrt().max(FLOAT_PRECISION * diagonal);
    // A number that is none asks for the finest.
    Ok((1..CUTS_PER_SPAN).find(|&cuts| leave / (cuts * cuts) as f64 <= wanted).unwrap_or(CUTS_PER_SPAN))
}

fn compare(input: &TriMesh, result: &TriMesh, observer: &dyn Observer) -> Result<Comparison, PipelineError> {
    Ok(mesh::compare(input, result, &CompareParams::default(), observer)?)
}

/// Smooth seams first, the widest angle first; then the seams on features.
pub fn worst_seams(seams: &[SeamQuality]) -> Vec<&SeamQuality> {
    let mut order: Vec<&SeamQuality> = seams.iter().collect();
    order.sort_by(|a, b| {
        let sharp = |s: &SeamQuality| !s.kind.is_smooth();
        sharp(a).cmp(&sharp(b)).then(b.angle_max_deg.total_cmp(&a.angle_max_deg)).then(a.curve.cmp(&b.curve))
    });
    order
}

fn length(quality: &mut Quality, key: &str, value: f64, diagonal: f64) {
    quality.insert(key.into(), Figure::Number(value));
    let relative = if diagonal > 0.0 { value / diagonal } else { 0.0 };
    quality.insert(format!("{key}_rel"), Figure::Number(relative));
}

fn distances(quality: &mut Quality, name: &str, found: &Comparison, diagonal: f64) {
    let both = &found.both;
    for (key, value) in [("rms", both.rms), ("max", both.max), ("p95", both.p95)] {
        length(quality, &format!("{name}.{key}"), value, diagonal);
    }
}

/// Edges of the mesh under feature curves: half the number of their ends. Points of a curve that are no vertices
/// of the mesh only divide an edge.
fn feature_edges(network: &Network) -> u64 {
    let mut ends = 0;
    for curve in network.curves.iter().filter(|c| c.kind == CurveKind::Feature) {
        let last = curve.points.len() - 1;
        for (i, point) in curve.points.iter().enumerate() {
            if point.bary.contains(&1.0) {
                ends += if i == 0 || i == last { 1 } else { 2 };
            }
        }
    }
    ends / 2
}

pub(super) fn mesh_figures(
    mesh: &TriMesh,
    network: &Network,
    repairs: &Repairs,
    quality: &mut Quality,
    warnings: &mut Vec<Warning>,
) {
    let facts = mesh::diagnose(mesh);
    quality.insert(key::MESH_TRIANGLES.into(), Figure::Count(facts.triangles as u64));
    quality.insert(key::MESH_WATERTIGHT.into(), Figure::Flag(facts.watertight));
    quality.insert(key::MESH_MANIFOLD.into(), Figure::Flag(facts.manifold));
    quality.insert(key::MESH_FEATURE_EDGES.into(), Figure::Count(feature_edges(network)));
    if repairs.any() {
        warnings.push(Warning::new("mesh_repaired", in_words(repairs), ""));
    }
    if repairs.degenerate_left > 0 {
        let text = format!(
            "{} without height could not be removed.",
            counted(repairs.degenerate_left, "triangle", "triangles")
        );
        warnings.push(Warning::new("mesh_degenerate", text, ""));
    }
    if !facts.watertight {
        let rims = counted(facts.boundary_loops, "boundary", "boundaries");
        let text = format!("The mesh is open: it has {rims}. The surfaces form an open shell, not a solid.");
        warnings.push(Warning::new("mesh_open", text, ""));
    }
    if facts.components > 1 {
        let text = format!("The mesh has {} pieces; each gets patches of its own.", facts.components);
        warnings.push(Warning::new("mesh_pieces", text, ""));
    }
}

/// What was repaired, as one sentence.
fn in_words(repairs: &Repairs) -> String {
    let without_height = repairs.collapsed_edges + repairs.flipped_edges + repairs.trimmed_faces;
    let done = [
        (repairs.welded_vertices, ["vertex", "vertices"], "at one place merged"),
        (repairs.repeated_faces, ["triangle", "triangles"], "with a repeated vertex dropped"),
        (repairs.duplicate_faces, ["duplicate triangle", "duplicate triangles"], "dropped"),
        (repairs.cut_edges, ["edge", "edges"], "of more than two triangles cut"),
        (repairs.one_sided_edges, ["edge", "edges"], "of one-sided pieces cut"),
        (repairs.turned_faces, ["triangle", "triangles"], "turned round"),
        (repairs.turned_components, ["piece", "pieces"], "turned inside out"),
        (repairs.split_vertices, ["vertex", "vertices"], "split"),
        (without_height, ["triangle", "triangles"], "without height removed"),
        (repairs.closed_handles, ["tiny handle", "tiny handles"], "cut and closed"),
        (repairs.closed_holes, ["tiny hole", "tiny holes"], "closed"),
        (repairs.unreferenced_vertices, ["unused vertex", "unused vertices"], "dropped"),
    ];
    let done = done.iter().filter(|(n, ..)| *n > 0);
    let words: Vec<String> = done.map(|(n, [one, many], what)| format!("{} {what}", counted(*n, one, many))).collect();
    format!("The mesh was repaired: {}.", words.join(", "))
}

/// How the patches of each piece were laid, and what to do where they do not follow its form, or follow it and fold.
/// * `pieces` - with their parts of the area; none for a network that was not made here
/// * `quality` - with the folds, where surfaces were made
pub(super) fn method_figures(pieces: &[(f64, Method)], quality: &mut Quality, warnings: &mut Vec<Warning>) {
    let (mut cones, mut deviation, mut along, mut known) = (0, 0.0, 0.0, 0);
    let mut reasons = Vec::new();
    for (share, method) in pieces {
        match method {
            Method::Field { cones: own, deviation_deg, folds } => {
                known += folds;
                cones += own;
                deviation += share * deviation_deg;
                along += share;
            }
            Method::Partition { why } => reasons.extend(why),
        }
    }
    if along > 0.0 {
        quality.insert(key::LAYOUT_CONES.into(), Figure::Count(cones as u64));
        quality.insert(key::LAYOUT_DEVIATION_DEG.into(), Figure::Number(deviation / along));
        quality.insert(key::LAYOUT_ALONG_FORM_SHARE.into(), Figure::Number(along.min(1.0)));
        let is_found = |key: &str| quality.get(key).is_some_and(|n| *n != Figure::Count(0));
        // Where the trial of the layout found folds, even patches have been tried.
        if known == 0 && [key::SEAM_FOLDED, key::GRID_FOLDS].into_iter().any(is_found) {
            let text = "Patches along the form fold; patches of about one size may not.";
            warnings.push(Warning::new("layout_folds", text, "").with_step("--even"));
        }
    }
    // The largest piece comes first.
    let Some(why) = reasons.first() else { return };
    let (of, in_largest) = match (reasons.len(), pieces.len()) {
        (_, 1) => (String::new(), ""),
        (n, all) => (
            format!(" of {n} of {all} pieces, {:.1} % of the area,", 100.0 * (1.0 - along)),
            if n > 1 { " in the largest" } else { "" },
        ),
    };
    let message = format!(
        "The network{of} does not follow the form, for{in_largest} {why}; its patches are even instead. More or fewer sharp edges \
         (the sharp angle of the layout), or another number of patches, may help."
    );
    warnings.push(Warning::new("layout_partition", message, ""));
}

/// What went with ragged borders.
/// * `radius` - as a share of the diagonal
pub(super) fn border_figures(evened: f64, radius: f64, quality: &mut Quality, warnings: &mut Vec<Warning>) {
    if evened <= 0.0 {
        return;
    }
    quality.insert(key::MESH_BORDER_CUT_SHARE.into(), Figure::Number(evened));
    let text = format!(
        "Ragged borders were cut even before patches were laid: {:.1} % of the area went, tatters narrower than {:.2} % of the \
         diagonal among it.",
        100.0 * evened,
        200.0 * radius
    );
    warnings.push(Warning::new("border_evened", text, "").with_step("--even-border 0"));
}

pub(super) fn network_figures(network: &Network, quality: &mut Quality) {
    let mut valence = vec![0usize; network.corners.len()];
    let mut boundary = vec![false; network.corners.len()];
    for curve in &network.curves {
        for &corner in &curve.corners {
            valence[corner as usize] += 1;
            boundary[corner as usize] |= curve.kind == CurveKind::Boundary;
        }
    }
    let regular = |(&n, &rim): (&usize, &bool)| n == if rim { 3 } else { 4 };
    let irregular = valence.iter().zip(&boundary).filter(|c| !regular(*c)).count();
    quality.insert(key::PATCHES_COUNT.into(), Figure::Count(network.patches.len() as u64));
    quality.insert(key::PATCHES_IRREGULAR_CORNERS.into(), Figure::Count(irregular as u64));
}

fn grid_figures(
    model: &Model,
    patches: &[PatchMesh],
    quality: &mut Quality,
    warnings: &mut Vec<Warning>,
    observer: &dyn Observer,
) -> Result<(), Cancelled> {
    let one = |(grid, patch): (&Grid, &PatchMesh)| {
        observer.check()?;
        Ok(grid::measure(grid, patch))
    };
    let grids: Result<Vec<grid::GridQuality>, Cancelled> = model.grids.par_iter().zip(patches).map(one).collect();
    let grids = grids?;
    let folds: usize = grids.iter().map(|g| g.folds).sum();
    let mean = |f: fn(&grid::GridQuality) -> f64| grids.iter().map(f).sum::<f64>() / grids.len().max(1) as f64;
    quality.insert(key::GRID_POINTS.into(), Figure::Count(model.grids.iter().map(|g| g.points.len() as u64).sum()));
    quality.insert(key::GRID_FOLDS.into(), Figure::Count(folds as u64));
    quality.insert(key::GRID_SPACING_CV.into(), Figure::Number(mean(|g| g.spacing_cv)));
    if folds > 0 {
        let places: Vec<String> =
            grids.iter().enumerate().filter(|(_, g)| g.folds > 0).map(|(p, _)| p.to_string()).collect();
        let text = format!(
            "{} folded over. An iso-curve through the middle of the patch helps.",
            counted(folds, "grid cell is", "grid cells are")
        );
        let worst = (0..grids.len()).max_by_key(|&p| (grids[p].folds, std::cmp::Reverse(p))).unwrap_or_default();
        let step = across(&model.grids[worst]);
        warnings.push(Warning::new("grid_folds", text, format!("patches {}", few(&places))).with_step(step));
    }
    Ok(())
}

fn seam_figures(
    model: &Model,
    diagonal: f64,
    quality: &mut Quality,
    warnings: &mut Vec<Warning>,
    observer: &dyn Observer,
) -> Result<Vec<SeamQuality>, Cancelled> {
    let edges = surface::edges_in_seams(&model.network, &model.grids, &model.surfaces);
    let seams = surface::measure_seams_apart(&model.network, &model.surfaces, &edges, observer)?;
    edge_figures(model, &edges, &seams, quality, warnings);
    let gap = seams.iter().map(|s| s.gap_max).fold(0.0, f64::max);
    let smooth: Vec<&SeamQuality> = seams.iter().filter(|s| s.kind.is_smooth()).collect();
    let total: f64 = smooth.iter().map(|s| s.length).sum();
    let squares: f64 = smooth.iter().map(|s| s.length * s.angle_rms_deg * s.angle_rms_deg).sum();
    quality.insert(key::SEAM_COUNT.into(), Figure::Count(seams.len() as u64));
    length(quality, key::SEAM_GAP_MAX, gap, diagonal);
    length(quality, key::SEAM_GAP_BOUND, seams.iter().map(|s| s.gap_bound).fold(0.0, f64::max), diagonal);
    let widest = smooth.iter().map(|s| s.angle_max_deg).fold(0.0, f64::max);
    quality.insert(key::SEAM_ANGLE_MAX_DEG.into(), Figure::Number(widest));
    let widest = smooth.iter().map(|s| s.regular_angle_max_deg).fold(0.0, f64::max);
    quality.insert(key::SEAM_REGULAR_ANGLE_MAX_DEG.into(), Figure::Number(widest));
    let bound = smooth.iter().filter_map(|s| s.regular_angle_bound_deg).fold(0.0, f64::max);
    quality.insert(key::SEAM_REGULAR_ANGLE_BOUND_DEG.into(), Figure::Number(bound));
    let odd: usize = smooth.iter().map(|s| s.odd_ends.iter().filter(|odd| **odd).count()).sum();
    quality.insert(key::SEAM_ODD_ENDS.into(), Figure::Count(odd as u64));
    let inner = inner_angles(model);
    quality.insert(key::SEAM_ANGLE_P95_DEG.into(), Figure::Number(angle_p95(model)));
    let inner_of = |s: &SeamQuality| inner.get(&s.curve).map_or(0.0, |found| found.0);
    let widest = smooth.iter().map(|s| inner_of(s)).fold(0.0, f64::max);
    quality.insert(key::SEAM_INNER_ANGLE_MAX_DEG.into(), Figure::Number(widest));
    let folded: Vec<&&SeamQuality> = smooth.iter().filter(|s| inner_of(s) > FOLDED_DEG).collect();
    quality.insert(key::SEAM_FOLDED.into(), Figure::Count(folded.len() as u64));
    if let Some(at) = folded.first().and_then(|s| inner.get(&s.curve)) {
        let names: Vec<String> = folded.iter().map(|s| s.curve.to_string()).collect();
        let text = format!(
            "{} folded over: the surfaces beside turn back.",
            counted(folded.len(), "smooth seam is", "smooth seams are")
        );
        warnings.push(Warning::new("seam_folds", text, format!("curves {}", few(&names))).with_step(relax_near(at.1)));
    }
    let rms = if total > 0.0 { (squares / total).sqrt() } else { 0.0 };
    quality.insert(key::SEAM_ANGLE_RMS_DEG.into(), Figure::Number(rms));
    let bent = smooth.iter().filter(|s| inner_of(s) > BENT_DEG).count();
    if bent > 0 {
        let text = format!(
            "{bent} of {} by more than {BENT_DEG} degrees somewhere, {widest:.2} at most; \
             along all smooth seams it is {rms:.2} RMS.",
            counted(smooth.len(), "smooth seam bends", "smooth seams bend")
        );
        let mut worst: Vec<&&SeamQuality> = smooth.iter().collect();
        worst.sort_by(|a, b| inner_of(b).total_cmp(&inner_of(a)).then(a.curve.cmp(&b.curve)));
        let worst: Vec<String> = worst.iter().take(3).map(|s| s.curve.to_string()).collect();
        warnings.push(Warning::new("seam_angle", text, format!("curves {}", few(&worst))).with_step("--fit-loss 0.5"));
    }
    Ok(seams)
}

/// Pieces of smooth seams that are not smooth in the grids: their number, their share of the length, where they are.
fn edge_figures(
    model: &Model,
    edges: &[EdgeInSeam],
    seams: &[SeamQuality],
    quality: &mut Quality,
    warnings: &mut Vec<Warning>,
) {
    let length_of = |curve: u32| seams.iter().find(|s| s.curve == curve).map_or(0.0, |s| s.length);
    let whole: f64 = seams.iter().filter(|s| s.kind.is_smooth()).map(|s| s.length).sum();
    let share: f64 = edges.iter().map(|e| length_of(e.curve) * (e.range[1] - e.range[0])).sum();
    quality.insert(key::SEAM_EDGES.into(), Figure::Count(edges.len() as u64));
    quality.insert(key::SEAM_EDGES_SHARE.into(), Figure::Number(if share > 0.0 { share / whole } else { 0.0 }));
    let worst_first = |a: &&EdgeInSeam, b: &&EdgeInSeam| b.angle_deg.total_cmp(&a.angle_deg);
    let mut sorted: Vec<&EdgeInSeam> = edges.iter().collect();
    sorted.sort_by(worst_first);
    let Some(worst) = sorted.first() else { return };
    let text = format!(
        "{} not smooth: the grids meet at more than {} degrees, {:.0} at most. That angle stays.",
        counted(edges.len(), "piece of a seam is", "pieces of seams are"),
        surface::EDGE_ANGLE_DEG,
        worst.angle_deg
    );
    let place = |e: &&EdgeInSeam| {
        let points = &model.network.curves[e.curve as usize].points;
        let middle = (e.range[0] + e.range[1]) / 2.0;
        let at = points.get((middle * points.len().saturating_sub(1) as f64) as usize).map(|p| p.position(&model.mesh));
        let at = at.map_or(String::new(), |p| format!(" at {}", in_script(p)));
        format!("curve {}{at} by {:.0} degrees", e.curve, e.angle_deg)
    };
    let places: Vec<String> = sorted.iter().map(place).collect();
    warnings.push(Warning::new("seam_edges", text, few(&places)));
}

/// Smooth seams whose normals turn by more than this have surfaces that turn back over each other.
pub const FOLDED_DEG: f64 = 90.0;
/// Places of a seam that are looked at are this share of the diagonal apart.
const INNER_STEP: f64 = 2e-3;

/// For each curve the largest angle between the normals beside it and where that is, but for its ends: a corner of an angle near
/// 180 degrees has no normal of its own, and what is measured there says nothing of the seam.
pub fn inner_angles(model: &Model) -> BTreeMap<u32, (f64, DVec3)> {
    inner_angles_of(&model.network, &model.surfaces, model.mesh.bounds().diagonal())
}

/// As [`inner_angles`], of surfaces over the patches of a network.
pub(super) fn inner_angles_of(network: &Network, surfaces: &[Surface], diagonal: f64) -> BTreeMap<u32, (f64, DVec3)> {
    let step = INNER_STEP * diagonal;
    let mut found: BTreeMap<u32, (f64, DVec3)> = BTreeMap::new();
    if !is_positive(step) {
        return found;
    }
    for place in surface::seam_angles(network, surfaces, step).iter().filter(|p| p.angle_deg.is_finite()) {
        let best = found.entry(place.curve).or_insert((0.0, place.point));
        if place.angle_deg > best.0 {
            *best = (place.angle_deg, place.point);
        }
    }
    found
}

/// The angle that 95 of 100 of the length of all smooth seams do not exceed, degrees; 0 without such seams.
fn angle_p95(model: &Model) -> f64 {
    let step = INNER_STEP * model.mesh.bounds().diagonal();
    if !is_positive(step) {
        return 0.0;
    }
    let mut places = surface::seam_angles(&model.network, &model.surfaces, step);
    places.retain(|p| model.network.curves[p.curve as usize].kind.is_smooth() && p.angle_deg.is_finite());
    places.sort_by(|a, b| a.angle_deg.total_cmp(&b.angle_deg).then(a.curve.cmp(&b.curve)));
    let whole: f64 = places.iter().map(|p| p.length).sum();
    let mut below = 0.0;
    let reached = places.iter().find(|p| {
        below += p.length;
        below >= 0.95 * whole
    });
    reached.map_or(0.0, |p| p.angle_deg)
}

fn relief_figures(
    model: &Model,
    diagonal: f64,
    quality: &mut Quality,
    warnings: &mut Vec<Warning>,
    observer: &dyn Observer,
) -> Result<(), PipelineError> {
    let each = model.surfaces.par_iter().zip(&model.reliefs).zip(&model.grids).map(|((surface, relief), grid)| {
        observer.check()?;
        // Of an edited relief that what was baked is what counts.
        let baked = if model.layers.stack.is_empty() { None } else { Some(relief::bake(grid, surface)?) };
        let back = relief::displace(surface, baked.as_ref().unwrap_or(relief))?;
        let miss = back.iter().zip(&grid.points).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        let most = relief.vectors.iter().map(|d| d.length()).fold(0.0, f64::max);
        Ok((miss, most, relief::fold_over(surface, relief)?.len()))
    });
    let each: Vec<(f64, f64, usize)> = each.collect::<Result<_, relief::ReliefError>>()?;
    let texels: usize = model.reliefs.iter().map(|r| r.vectors.len()).sum();
    quality.insert(key::RELIEF_TEXELS.into(), Figure::Count(texels as u64));
    length(quality, key::RELIEF_ROUNDING_MAX, each.iter().map(|e| e.0).fold(0.0, f64::max), diagonal);
    length(quality, key::RELIEF_MAX, each.iter().map(|e| e.1).fold(0.0, f64::max), diagonal);
    let folding: usize = each.iter().map(|e| e.2).sum();
    if folding > 0 {
        let places: Vec<String> =
            each.iter().enumerate().filter(|(_, e)| e.2 > 0).map(|(p, _)| p.to_string()).collect();
        let text = format!(
            "{folding} of {texels} texels displace the surface beyond its centre of curvature: scaling such a map up \
             folds the surface over. More control points there help."
        );
        warnings.push(
            Warning::new("relief_folds", text, format!("patches {}", few(&places))).with_step("--cells-per-span 2"),
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_patches_are_advised_where_those_along_the_form_fold_though_the_trial_did_not_tell_and_nowhere_else() {
        let field = |folds| Method::Field { cones: 8, deviation_deg: 3.0, folds };
        let even = Method::Partition { why: None };
        let steps = |method: &Method, folds: [u64; 2]| {
            let keys = ["grid.folds", "seam.folded"].map(String::from);
            let mut quality: Quality = keys.into_iter().zip(folds.map(Figure::Count)).collect();
            let mut warnings = Vec::new();
            method_figures(&[(1.0, method.clone())], &mut quality, &mut warnings);
            warnings.into_iter().map(|w| w.step).collect::<Vec<String>>()
        };
        assert_eq!([steps(&field(0), [0, 1]), steps(&field(0), [3, 0])], [["--even"], ["--even"]]);
        assert!(
            steps(&field(0), [0, 0]).is_empty()
                && steps(&field(2), [0, 1]).is_empty()
                && steps(&even, [3, 1]).is_empty()
        );
    }
}
