//! Tags: which vertices and edges of a mesh are sharp. Extraction sets them ([K01] §4.2), smoothing and decimation keep
//! them (§5.2, 5.3).

use super::{Attribute, TriMesh};
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// What a vertex marks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum FeatureKind {
    /// Nothing.
    #[default]
    None,
    /// A place on a sharp edge.
    Edge,
    /// A corner, where sharp edges meet or end.
    Corner,
}

/// Features of a mesh.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FeatureTags {
    /// For each vertex what it marks.
    pub vertices: Vec<FeatureKind>,
    /// Sharp edges: two vertices each, the lesser first, ascending.
    pub edges: Vec<[u32; 2]>,
}

/// Name of the attribute that holds the kinds: 0 none, 1 edge, 2 corner.
pub const FEATURE: &str = "feature";

impl FeatureTags {
    /// Tags of a mesh of `vertices` vertices from its sharp edges, in any order; `corners` are corners whatever their
    /// edges. Edges come out sorted, without repetition.
    pub fn from_edges(vertices: usize, edges: impl IntoIterator<Item = [u32; 2]>) -> FeatureTags {
        let mut edges: Vec<[u32; 2]> = edges.into_iter().map(|[a, b]| [a.min(b), a.max(b)]).collect();
        edges.sort_unstable();
        edges.dedup();
        let mut kinds = vec![FeatureKind::None; vertices];
        let mut count = vec![0u32; vertices];
        for &v in edges.iter().flatten() {
            count[v as usize] += 1;
        }
        for (kind, n) in kinds.iter_mut().zip(count) {
            *kind = match n {
                0 => FeatureKind::None,
                2 => FeatureKind::Edge,
                _ => FeatureKind::Corner,
            };
        }
        FeatureTags { vertices: kinds, edges }
    }

    /// The tags of the same mesh with other `edges`. A corner of two edges stays one.
    pub(crate) fn with_edges(&self, edges: impl IntoIterator<Item = [u32; 2]>) -> FeatureTags {
        let count = self.vertices.len();
        let mut tags = FeatureTags::from_edges(count, edges);
        // What is a corner though two edges meet there.
        let plain = FeatureTags::from_edges(count, self.edges.iter().copied());
        for (v, kind) in tags.vertices.iter_mut().enumerate() {
            let was_corner = self.vertices[v] == FeatureKind::Corner && plain.vertices[v] == FeatureKind::Edge;
            if *kind == FeatureKind::Edge && was_corner {
                *kind = FeatureKind::Corner;
            }
        }
        tags
    }

    /// Marks the half-edges of `mesh`, whose tags these are, on the tagged edges.
    pub(crate) fn on(&self, mesh: &TriMesh) -> Vec<bool> {
        let ends = |h: u32| (mesh.origin(h), mesh.origin(super::next(h)));
        (0..3 * mesh.triangles.len() as u32)
            .into_par_iter()
            .map(|h| {
                let (a, b) = ends(h);
                self.edges.binary_search(&[a.min(b), a.max(b)]).is_ok()
            })
            .collect()
    }

    /// Marks the half-edges of `mesh` that lie on the tagged edges of `input`, told by the positions of their ends: `mesh`
    /// is `input` after a repair, which names its vertices anew.
    pub fn half_edges(&self, input: &TriMesh, mesh: &TriMesh) -> Vec<bool> {
        let key = |a: DVec3, b: DVec3| {
            let (a, b) = (a.to_array().map(f64::to_bits), b.to_array().map(f64::to_bits));
            if a < b { [a, b] } else { [b, a] }
        };
        let point = |v: u32| input.points.get(v as usize).copied().unwrap_or(DVec3::NAN);
        let mut edges: Vec<[[u64; 3]; 2]> = self.edges.iter().map(|e| key(point(e[0]), point(e[1]))).collect();
        edges.sort_unstable();
        let ends = |h: u32| (mesh.points[mesh.origin(h) as usize], mesh.points[mesh.origin(super::next(h)) as usize]);
        (0..3 * mesh.triangles.len() as u32)
            .map(|h| {
                let (a, b) = ends(h);
                edges.binary_search(&key(a, b)).is_ok()
            })
            .collect()
    }

    /// Leaves out the vertices of `mesh` that do not stay, with their triangles and tags.
    pub fn keep(&mut self, mesh: &mut TriMesh, stays: &[bool]) {
        let mut kept = Vec::new();
        let mut fresh = vec![u32::MAX; mesh.points.len()];
        for v in (0..mesh.points.len()).filter(|&v| stays[v]) {
            fresh[v] = kept.len() as u32;
            kept.push(v);
        }
        for a in &mut mesh.attributes {
            let width = a.width;
            a.values = kept.iter().flat_map(|&v| a.values[v * width..(v + 1) * width].to_vec()).collect();
        }
        mesh.points = kept.iter().map(|&v| mesh.points[v]).collect();
        mesh.triangles.retain(|t| t.iter().all(|&v| stays[v as usize]));
        mesh.triangles.iter_mut().for_each(|t| *t = t.map(|v| fresh[v as usize]));
        self.edges.retain(|e| e.iter().all(|&v| stays[v as usize]));
        self.edges.iter_mut().for_each(|e| *e = e.map(|v| fresh[v as usize]));
        self.vertices = kept.iter().map(|&v| self.vertices[v]).collect();
    }

    /// The kinds as an attribute of the mesh.
    pub fn attribute(&self) -> Attribute {
        let value = |k: &FeatureKind| match k {
            FeatureKind::None => 0.0,
            FeatureKind::Edge => 1.0,
            FeatureKind::Corner => 2.0,
        };
        Attribute { name: FEATURE.into(), width: 1, values: self.vertices.iter().map(value).collect() }
    }

    /// Puts the kinds into the mesh, in place of others.
    pub fn mark(&self, mesh: &mut TriMesh) {
        mesh.attributes.retain(|a| a.name != FEATURE);
        if !self.edges.is_empty() || self.vertices.iter().any(|&k| k != FeatureKind::None) {
            mesh.attributes.push(self.attribute());
        }
    }

    /// Tags of a mesh from its attribute and `edges`, if it has the attribute.
    pub fn of(mesh: &TriMesh, edges: Vec<[u32; 2]>) -> Option<FeatureTags> {
        let attribute = mesh.attributes.iter().find(|a| a.name == FEATURE && a.width == 1)?;
        let kind = |v: &f32| match v.round() as i32 {
            1 => FeatureKind::Edge,
            2 => FeatureKind::Corner,
            _ => FeatureKind::None,
        };
        Some(FeatureTags { vertices: attribute.values.iter().map(kind).collect(), edges })
    }
}
