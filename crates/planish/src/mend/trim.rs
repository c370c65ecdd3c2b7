//! Cuts a mesh along the line where a function on its vertices is zero (`docs/methods/mend.md`, "Open scans").

use crate::mesh::{Attribute, FeatureKind, FeatureTags, NONE, TriMesh};
use std::collections::BTreeMap;

/// A cut this close to an end of an edge, as a share of it, goes through that end: triangles keep a height.
const SNAP_SHARE: f64 = 0.15;

/// Keeps the part of a mesh where `level`, given for each vertex, is positive; triangles are cut along its zero line.
/// Tags of features are cut, too. Where the line passes close to a vertex it goes through it.
pub fn trim(mesh: &mut TriMesh, tags: &mut FeatureTags, level: &[f64]) {
    let level = snapped(mesh, level);
    let mut cuts: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    // Of each new vertex the two old ones, and how far it is from the first to the second.
    let mut made: Vec<([u32; 2], f64)> = Vec::new();
    let old = mesh.points.len() as u32;
    let mut triangles = Vec::new();
    for t in &mesh.triangles {
        let at = t.map(|v| level[v as usize]);
        if !at.iter().any(|&a| a > 0.0) {
            continue;
        }
        if at.iter().all(|&a| a >= 0.0) {
            triangles.push(*t);
            continue;
        }
        let mut kept: Vec<u32> = Vec::with_capacity(4);
        for k in 0..3 {
            let (v, w) = (t[k], t[(k + 1) % 3]);
            let (a, b) = (at[k], at[(k + 1) % 3]);
            if a >= 0.0 {
                kept.push(v);
            }
            if a * b < 0.0 {
                kept.push(*cuts.entry([v.min(w), v.max(w)]).or_insert_with(|| {
                    let (low, high) = if v < w { (a, b) } else { (b, a) };
                    made.push(([v.min(w), v.max(w)], low / (low - high)));
                    old + made.len() as u32 - 1
                }));
            }
        }
        triangles.extend((2..kept.len()).map(|k| [kept[0], kept[k - 1], kept[k]]));
    }
    let kind = |v: u32| tags.vertices.get(v as usize).copied().unwrap_or_default();
    let point = |v: u32| mesh.points[v as usize];
    let mut points = mesh.points.clone();
    points.extend(made.iter().map(|&([a, b], t)| point(a).lerp(point(b), t)));
    let mut kinds: Vec<FeatureKind> = (0..old).map(kind).collect();
    let mut edges = Vec::new();
    kinds.resize(points.len(), FeatureKind::None);
    for &[a, b] in &tags.edges {
        match cuts.get(&[a, b]) {
            Some(&m) => {
                kinds[m as usize] = FeatureKind::Edge;
                edges.push([if level[a as usize] > 0.0 { a } else { b }, m]);
            }
            None => edges.push([a, b]),
        }
    }
    let mut fresh = vec![NONE; points.len()];
    let mut used = Vec::new();
    triangles.iter().flatten().for_each(|&v| fresh[v as usize] = 0);
    for v in 0..points.len() as u32 {
        if fresh[v as usize] == 0 {
            fresh[v as usize] = used.len() as u32;
            used.push(v);
        }
    }
    let attributes = mesh.attributes.iter().map(|a| {
        let own = |v: u32, k: usize| a.values[v as usize * a.width + k];
        let value = |v: u32, k: usize| match v.checked_sub(old) {
            None => own(v, k),
            Some(m) => {
                let ([p, q], t) = made[m as usize];
                own(p, k) + t as f32 * (own(q, k) - own(p, k))
            }
        };
        let values = used.iter().flat_map(|&v| (0..a.width).map(move |k| (v, k))).map(|(v, k)| value(v, k)).collect();
        Attribute { name: a.name.clone(), width: a.width, values }
    });
    let attributes = attributes.collect();
    // An edge goes on where a triangle still has it.
    let mut sides: Vec<[u32; 2]> =
        triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).map(|[a, b]| [a.min(b), a.max(b)]).collect();
    sides.sort_unstable();
    edges.retain(|&[a, b]| sides.binary_search(&[a.min(b), a.max(b)]).is_ok());
    let mut edges: Vec<[u32; 2]> = edges.into_iter().map(|e| e.map(|v| fresh[v as usize])).collect();
    edges.iter_mut().for_each(|e| e.sort_unstable());
    edges.sort_unstable();
    *tags = FeatureTags { vertices: used.iter().map(|&v| kinds[v as usize]).collect(), edges };
    *mesh = TriMesh {
        points: used.iter().map(|&v| points[v as usize]).collect(),
        triangles: triangles.into_iter().map(|t| t.map(|v| fresh[v as usize])).collect(),
        attributes,
    };
}

/// The level, zero at vertices that the line passes close by.
fn snapped(mesh: &TriMesh, level: &[f64]) -> Vec<f64> {
    let mut snapped = level.to_vec();
    for t in &mesh.triangles {
        for k in 0..3 {
            let (v, w) = (t[k] as usize, t[(k + 1) % 3] as usize);
            let (a, b) = (level[v], level[w]);
            if a * b < 0.0 {
                let part = a / (a - b);
                if part < SNAP_SHARE {
                    snapped[v] = 0.0;
                }
                if 1.0 - part < SNAP_SHARE {
                    snapped[w] = 0.0;
                }
            }
        }
    }
    snapped
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::diagnose;
    use crate::synthetic::shapes;

    #[test]
    fn a_sheet_cut_along_a_slanted_line_loses_exactly_its_other_side_and_keeps_half_of_a_tagged_line() {
        let mut mesh = shapes::rectangle(2.0, 2.0, 20, 20);
        let (low, mut tagged) = (mesh.bounds().min, Vec::new());
        // The middle row is tagged.
        let row = |mesh: &TriMesh, v: u32| (mesh.points[v as usize].y - low.y - 1.0).abs() < 1e-9;
        for t in mesh.triangles.clone() {
            for k in 0..3 {
                if row(&mesh, t[k]) && row(&mesh, t[(k + 1) % 3]) {
                    tagged.push([t[k], t[(k + 1) % 3]]);
                }
            }
        }
        let mut tags = FeatureTags::from_edges(mesh.points.len(), tagged);
        assert_eq!(tags.edges.len(), 20);
        let line = |p: glam::DVec3| p.x - low.x - 0.633 - 0.21 * (p.y - low.y);
        let level: Vec<f64> = mesh.points.iter().map(|&p| line(p)).collect();
        trim(&mut mesh, &mut tags, &level);
        let facts = diagnose(&mesh);
        assert!(facts.manifold && facts.components == 1 && facts.boundary_loops == 1);
        // Snapping moves the line by at most .15 of an edge of .1 (.14 across).
        let width = 2.0 - 0.633 - 0.21;
        assert!((facts.area - 2.0 * width).abs() < 0.04, "{} for {}", facts.area, 2.0 * width);
        assert!(mesh.points.iter().all(|&p| line(p) > -0.022));
        let length: f64 =
            tags.edges.iter().map(|e| mesh.points[e[0] as usize].distance(mesh.points[e[1] as usize])).sum();
        assert!((length - width).abs() < 0.022, "{length} for {width}");
        assert!((0..mesh.triangles.len()).all(|t| mesh.area(t) > 1e-4 * 0.005));
    }
}
