//! Draws edges sharper than an angle as curves (`docs/methods/layout.md`, step 1, has the automatic choice).

use crate::curve::{SurfaceCurve, section};
use crate::edit::check::{Range, within};
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command};
use crate::geom::tolerance;
use crate::mesh::{FacePoint, TriMesh, sharp_edges};
use crate::network::{CurveKind, Network};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Edges sharper than an angle as curves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FeatureLines {
    /// Degrees.
    pub angle_deg: f64,
    /// Lines shorter than this share of the diagonal are left out.
    #[serde(default)]
    pub shortest: f64,
}

impl Command for FeatureLines {
    fn check(&self) -> Result<(), ApplyError> {
        within("angle_deg", self.angle_deg, Range::Angle)?;
        within("shortest", self.shortest, Range::NotNegative)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let canvas = &work.ground.canvas;
        let (mesh, adjacency) = (canvas.mesh, &canvas.adjacency);
        let lines = section::lines(mesh, adjacency, &sharp_edges(mesh, adjacency, self.angle_deg));
        let least = self.shortest * mesh.bounds().diagonal();
        let lines = lines.iter().filter(|l| l.length(mesh) >= least);
        for line in lines.flat_map(|l| uncovered(mesh, l, &work.drawing.network)).collect::<Vec<_>>() {
            work.add(&line, CurveKind::Feature, tolerance::RELATIVE)?;
        }
        Ok(())
    }
}

/// The parts of a line along edges where no curve runs yet.
fn uncovered(mesh: &TriMesh, line: &SurfaceCurve, network: &Network) -> Vec<SurfaceCurve> {
    let vertex = |p: &FacePoint| (0..3).find(|&k| p.bary[k] == 1.0).map(|k| mesh.triangles[p.face as usize][k]);
    let edge = |w: &[FacePoint]| match [vertex(&w[0]), vertex(&w[1])] {
        [Some(a), Some(b)] => Some((a.min(b), a.max(b))),
        _ => None,
    };
    let taken: BTreeSet<(u32, u32)> =
        network.curves.iter().flat_map(|c| c.points.windows(2)).filter_map(edge).collect();
    let mut points = line.points.clone();
    points.extend(line.points.first().filter(|_| line.closed));
    let is_free = |w: &[FacePoint]| edge(w).is_none_or(|e| !taken.contains(&e));
    if points.windows(2).all(is_free) {
        return vec![line.clone()];
    }
    let mut parts: Vec<Vec<FacePoint>> = Vec::new();
    let mut goes_on = false;
    for w in points.windows(2) {
        match (is_free(w), parts.last_mut().filter(|_| goes_on)) {
            (true, Some(part)) => part.push(w[1]),
            (true, None) => parts.push(w.to_vec()),
            (false, _) => {}
        }
        goes_on = is_free(w);
    }
    parts.into_iter().map(SurfaceCurve::open).collect()
}
