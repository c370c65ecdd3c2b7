//! What lines look like that a part does not have: loose ends, needless junctions, jogs, slivers beside them.

use crate::geom::KdTree;
use crate::mesh::{Adjacency, FeatureTags, TriMesh, folded_back, next, sharp_edges};
use glam::DVec3;
use std::collections::BTreeMap;

/// A line that turns by more than this at a vertex, degrees, has a corner or a jog there.
pub const TURN_DEG: f64 = 40.0;
/// A triangle lower than this share of its longest edge is a sliver.
pub const SLIVER: f64 = 0.05;

/// Counts of a mesh with lines.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Census {
    /// Length of all lines, world units.
    pub length: f64,
    /// Vertices where three lines or more meet.
    pub junctions: usize,
    /// Vertices inside the surface where a line ends.
    pub ends: usize,
    /// Vertices where a line turns by more than [`TURN_DEG`].
    pub turns: usize,
    /// Triangles with a corner on a line that are lower than [`SLIVER`] of their longest edge.
    pub slivers: usize,
    /// Pairs of neighbours in the whole mesh that are folded back on one another.
    pub folded_back: usize,
}

/// Counts what lines have.
/// * `tags` - of `mesh`
pub fn census(mesh: &TriMesh, tags: &FeatureTags) -> Census {
    let adjacency = Adjacency::new(mesh);
    let at = |v: u32| mesh.points[v as usize];
    let mut beside: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for &[a, b] in &tags.edges {
        beside.entry(a).or_default().push(b);
        beside.entry(b).or_default().push(a);
    }
    let turns = |v: u32, others: &[u32]| match others {
        [a, b] => (at(v) - at(*a)).angle_between(at(*b) - at(v)) > TURN_DEG.to_radians(),
        _ => false,
    };
    let is_sliver = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
        mesh.triangles[t].iter().any(|v| beside.contains_key(v)) && (b - a).cross(c - a).length() < SLIVER * longest
    };
    Census {
        length: tags.edges.iter().map(|e| at(e[0]).distance(at(e[1]))).sum(),
        junctions: beside.values().filter(|o| o.len() > 2).count(),
        ends: beside.iter().filter(|(v, o)| o.len() == 1 && !adjacency.is_boundary_vertex(**v)).count(),
        turns: beside.iter().filter(|(v, o)| turns(**v, o)).count(),
        slivers: (0..mesh.triangles.len()).filter(|&t| is_sliver(t)).count(),
        folded_back: folded_back(mesh, &adjacency).len(),
    }
}

/// Edges of a true shape that must be found bend by more than the first, degrees; a line is not false where the shape bends by
/// the second or more.
pub const TRUE_EDGE_DEG: [f64; 2] = [40.0, 15.0];
/// Lines are asked at steps of this share of the diagonal: finer than any distance that is judged.
const STEP: f64 = 5e-4;

/// What became of the sharp edges of a true shape in a mesh of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinesFound {
    /// Share of the length of the shape's edges with a line within the distance asked for.
    pub found: f64,
    /// Share of the length of the lines that is nowhere near an edge of the shape.
    pub false_share: f64,
}

/// Holds lines against the sharp edges of a true shape, [`TRUE_EDGE_DEG`].
/// * `tags` - of `mesh`
/// * `within` - distance at which a line is that of an edge, world units
pub fn lines_found(truth: &TriMesh, mesh: &TriMesh, tags: &FeatureTags, within: f64) -> LinesFound {
    let step = STEP * truth.bounds().diagonal();
    let adjacency = Adjacency::new(truth);
    let bent = |angle_deg: f64| {
        let sharp = sharp_edges(truth, &adjacency, angle_deg);
        let once = (0..sharp.len() as u32).filter(|&h| sharp[h as usize] && h < adjacency.opposite[h as usize]);
        places(truth, once.map(|h| [truth.origin(h), truth.origin(next(h))]), step)
    };
    let lines = places(mesh, tags.edges.iter().copied(), step);
    let [edges, bends] = TRUE_EDGE_DEG.map(bent);
    LinesFound {
        found: share_near(&edges, &lines, within),
        false_share: if lines.is_empty() { 0.0 } else { 1.0 - share_near(&lines, &bends, within) },
    }
}

/// Places along edges, and the length that each stands for.
fn places(mesh: &TriMesh, edges: impl Iterator<Item = [u32; 2]>, step: f64) -> Vec<(DVec3, f64)> {
    let mut places = Vec::new();
    for [a, b] in edges.map(|e| e.map(|v| mesh.points[v as usize])) {
        let pieces = (a.distance(b) / step).ceil().max(1.0);
        let part = |k: usize| (a.lerp(b, (k as f64 + 0.5) / pieces), a.distance(b) / pieces);
        places.extend((0..pieces as usize).map(part));
    }
    places
}

/// Share of the length of places that have one of the others within a distance; 1 if there are none.
fn share_near(places: &[(DVec3, f64)], others: &[(DVec3, f64)], within: f64) -> f64 {
    let tree = KdTree::new(&others.iter().map(|o| o.0).collect::<Vec<_>>());
    let (mut near, mut all, mut found) = (Vec::new(), 0.0, 0.0);
    for &(p, length) in places {
        tree.nearest_within(p, 1, within, &mut near);
        all += length;
        found += if near.is_empty() { 0.0 } else { length };
    }
    if all > 0.0 { found / all } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::shapes;

    #[test]
    fn the_edges_of_a_box_meet_at_8_corners_and_have_no_ends_turns_or_slivers() {
        let mesh = shapes::cuboid(DVec3::ONE, 4);
        let sharp = crate::mesh::sharp_edges(&mesh, &Adjacency::new(&mesh), 40.0);
        let ends = |h: usize| [mesh.origin(h as u32), mesh.origin(crate::mesh::next(h as u32))];
        let tags = FeatureTags::from_edges(mesh.points.len(), (0..sharp.len()).filter(|&h| sharp[h]).map(ends));
        let found = census(&mesh, &tags);
        let expected = Census { length: found.length, junctions: 8, ..Census::default() };
        assert_eq!(found, expected);
        assert!((found.length - 12.0).abs() < 1e-9);
        // Without one edge of the box: two ends at the places where corners of two lines are left.
        let most = mesh.bounds().max;
        let is_kept = |e: &&[u32; 2]| {
            e.iter().any(|&v| (mesh.points[v as usize].truncate() - most.truncate()).abs().max_element() > 1e-9)
        };
        let fewer = FeatureTags::from_edges(mesh.points.len(), tags.edges.iter().filter(is_kept).copied());
        let found = census(&mesh, &fewer);
        assert_eq!((found.junctions, found.ends, found.turns), (6, 0, 2));
    }
}
