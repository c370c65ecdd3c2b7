//! A result against a truth that is known: distances, normals, and what became of the sharp edges.
//!
//! See `docs/methods/measuring.md`, "Truth".

use super::key;
use super::record::Figure;
use super::{PipelineError, Quality, quality};
use crate::geom::KdTree;
use crate::mesh::compare::Sample;
use crate::mesh::{Adjacency, CompareParams, TriMesh, compare_samples, diagnose, next, sharp_edges};
use crate::model::Model;
use crate::network::CurveKind;
use crate::observe::Observer;
use crate::surface::seam_angles;
use glam::DVec3;

/// Edges of the truth that must be found bend by more than this, degrees.
pub const SHARP_DEG: f64 = 40.0;
/// A seam is not false where the truth bends by at least this, degrees.
const BENT_DEG: f64 = 15.0;
/// An edge has its angle if it is met within this, degrees.
pub const ANGLE_DEG: f64 = 3.0;
/// Edges of the truth are asked at steps of this share of the diagonal: finer than any distance that is judged.
const EDGE_STEP: f64 = 5e-4;

/// The zone of the sharp edges: within this share of the diagonal.
const ZONE: f64 = 0.01;
/// An edge has its seam within this share of the diagonal, where noise is less than [`FAINT`] of it and where it is more.
const WITHIN: [f64; 2] = [1e-3, 2e-3];
const FAINT: f64 = 1.5e-3;

/// What became of the sharp edges of a truth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EdgesFound {
    /// Length of the edges of the truth above [`SHARP_DEG`], world units.
    pub length: f64,
    /// Share of that length with a feature seam within the distance asked for.
    pub found: f64,
    /// Share of that length with such a seam whose faces meet at the true angle within [`ANGLE_DEG`].
    pub met: f64,
    /// Share of the length of the feature seams that is nowhere near an edge of the truth.
    pub false_share: f64,
}

/// Places on the edges of a mesh above an angle: position, angle in degrees, and length that each stands for.
fn edge_places(mesh: &TriMesh, angle_deg: f64, step: f64) -> Vec<(DVec3, f64, f64)> {
    let adjacency = Adjacency::new(mesh);
    let sharp = sharp_edges(mesh, &adjacency, angle_deg);
    let mut places = Vec::new();
    for h in (0..sharp.len()).filter(|&h| sharp[h]) {
        let g = adjacency.opposite[h] as usize;
        if g < h {
            continue;
        }
        let (m, n) = (mesh.normal(h / 3), mesh.normal(g / 3));
        let angle = m.cross(n).length().atan2(m.dot(n)).to_degrees();
        let [a, b] = [h as u32, next(h as u32)].map(|h| mesh.points[mesh.origin(h) as usize]);
        let length = a.distance(b);
        let pieces = (length / step).ceil().max(1.0);
        places.extend((0..pieces as usize).map(|k| (a.lerp(b, (k as f64 + 0.5) / pieces), angle, length / pieces)));
    }
    places
}

/// How the feature seams of a model meet the sharp edges of a truth.
/// * `within` - distance at which a seam counts as that of an edge, world units
pub fn edges_found(truth: &TriMesh, model: &Model, within: f64) -> EdgesFound {
    let step = EDGE_STEP * truth.bounds().diagonal();
    let edges = edge_places(truth, SHARP_DEG, step);
    let bent: Vec<DVec3> = edge_places(truth, BENT_DEG, step).iter().map(|p| p.0).collect();
    let seams: Vec<_> = seam_angles(&model.network, &model.surfaces, step)
        .into_iter()
        .filter(|s| model.network.curves[s.curve as usize].kind == CurveKind::Feature)
        .collect();
    let tree = KdTree::new(&seams.iter().map(|s| s.point).collect::<Vec<_>>());
    let (mut length, mut found, mut met) = (0.0, 0.0, 0.0);
    let mut near = Vec::new();
    for &(p, angle, share) in &edges {
        length += share;
        tree.nearest_within(p, 1, within, &mut near);
        if let Some(n) = near.first() {
            found += share;
            // A seam without normals on both sides (a corner of no angle) meets nothing.
            met += if (seams[n.1 as usize].angle_deg - angle).abs() <= ANGLE_DEG { share } else { 0.0 };
        }
    }
    let bent = KdTree::new(&bent);
    let (mut all, mut astray) = (0.0, 0.0);
    for s in &seams {
        all += s.length;
        bent.nearest_within(s.point, 1, within, &mut near);
        astray += if near.is_empty() { s.length } else { 0.0 };
    }
    let share = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
    EdgesFound { length, found: share(found, length), met: share(met, length), false_share: share(astray, all) }
}

/// The distance at which a seam counts as that of an edge when builds are compared, world units: of a true shape and the
/// noise of its scan, not of what a build takes for the noise.
/// * `noise` - standard deviation of the points, share of the diagonal
pub fn edge_reach(truth: &TriMesh, noise: f64) -> f64 {
    WITHIN[usize::from(noise > FAINT)] * truth.bounds().diagonal()
}

/// How near a result is to its truth around the sharp edges.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Zone {
    /// Root mean square of the distances both ways, world units.
    pub rms: f64,
    /// Mean angle between the normals, degrees.
    pub normal_deg: f64,
}

/// Of samples of a truth and a result against each other those within a hundredth of the diagonal of a true edge.
pub fn zone(truth: &TriMesh, samples: &[Sample]) -> Zone {
    let diagonal = truth.bounds().diagonal();
    let edges: Vec<DVec3> = edge_places(truth, SHARP_DEG, EDGE_STEP * diagonal).iter().map(|p| p.0).collect();
    let edges = KdTree::new(&edges);
    let mut near = Vec::new();
    let (mut squares, mut angles, mut count) = (0.0, 0.0, 0);
    for s in samples {
        edges.nearest_within(s.place, 1, ZONE * diagonal, &mut near);
        if !near.is_empty() {
            squares += s.distance * s.distance;
            angles += s.angle_deg;
            count += 1;
        }
    }
    let n = count.max(1) as f64;
    Zone { rms: (squares / n).sqrt(), normal_deg: angles / n }
}

/// Closed, manifold, of as many pieces and handles as the truth.
fn same_topology(truth: &TriMesh, made: &TriMesh) -> bool {
    let (truth, made) = (diagnose(truth), diagnose(made));
    made.watertight == truth.watertight
        && made.manifold
        && made.components == truth.components
        && made.genus == truth.genus
}

/// Figures of a mesh and the model made of it against the truth.
/// * `within` - distance at which a seam counts as that of an edge, world units
/// # Errors
/// If a mesh is damaged or the observer stops.
pub fn truth_figures(
    truth: &TriMesh,
    meshed: &TriMesh,
    model: &Model,
    within: f64,
    observer: &dyn Observer,
) -> Result<Quality, PipelineError> {
    let mut figures = Quality::new();
    let displaced = quality::displaced_mesh(model, observer)?;
    let base = quality::surface_mesh(model, observer)?;
    let params = CompareParams::default();
    for (name, mesh) in [("mesh", meshed), ("surface", &base), ("displaced", &displaced)] {
        let (found, samples) = compare_samples(truth, mesh, &params, observer)?;
        for (what, world) in [("rms", found.both.rms), ("p95", found.both.p95), ("max", found.both.max)] {
            figures.insert(format!("truth.{name}_{what}"), Figure::Number(world));
            figures.insert(format!("truth.{name}_{what}_rel"), Figure::Number(world / found.diagonal));
        }
        figures.insert(format!("truth.{name}_normal_deg"), Figure::Number(found.normal_deg.mean));
        if name == "mesh" {
            figures.insert(key::TRUTH_MESH_ZONE_DEG.into(), Figure::Number(zone(truth, &samples).normal_deg));
        }
    }
    figures.insert(key::TRUTH_MESH_TOPOLOGY.into(), Figure::Flag(same_topology(truth, meshed)));
    let edges = edges_found(truth, model, within);
    let shares = [
        (key::TRUTH_SHARP_LENGTH, edges.length),
        (key::TRUTH_SHARP_FOUND, edges.found),
        (key::TRUTH_SHARP_MET, edges.met),
        (key::TRUTH_SHARP_FALSE, edges.false_share),
    ];
    figures.extend(shares.map(|(key, x)| (key.to_owned(), Figure::Number(x))));
    Ok(figures)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::shapes;

    #[test]
    fn edges_of_a_box_of_1_by_2_by_3_are_24_long_at_90_degrees() {
        let places = edge_places(&shapes::cuboid(DVec3::new(1.0, 2.0, 3.0), 4), 40.0, 0.01);
        let length: f64 = places.iter().map(|p| p.2).sum();
        assert!((length - 24.0).abs() < 1e-9, "{length}");
        assert!(places.iter().all(|p| (p.1 - 90.0).abs() < 1e-9));
    }
}
