//! Sharp lines of an extracted mesh: where they run, and how their ends are joined along the lines of the source.
//!
//! See `docs/methods/contour.md`, step 7.

use super::local::Local;
use crate::field::Creases;
use crate::geom::KdTree;
use crate::mesh::{FeatureKind, FeatureTags};
use glam::DVec3;

/// A vertex that is this near to a corner of the source is there, in cells.
pub const TAKEN: f64 = 1e-6;
/// An edge follows a line of the source if it is nowhere farther from one, in cells.
const ALONG_LINE_CELLS: f64 = 0.1;
/// A line of the source is missed where the mesh is farther from it than this, in cells, and is looked for as far as
/// that.
const MISSED: f64 = 0.02;
const ALONG_SIDE: f64 = 0.75;
/// Places on an edge at which that is asked.
const PLACES_ON_EDGE: [f64; 3] = [0.25, 0.5, 0.75];

/// Where lines run: for each feature vertex those beside it on its lines.
pub struct Lines {
    /// What each vertex of the mesh marks.
    pub kinds: Vec<FeatureKind>,
    /// Length of a cell.
    pub size: f64,
    /// All vertices of lines, ascending.
    names: Vec<u32>,
    beside: Vec<Vec<u32>>,
}

impl Lines {
    /// Lines of features whose edges come in any order.
    pub fn new(tags: FeatureTags, size: f64) -> Lines {
        let mut names: Vec<u32> = tags.edges.iter().flatten().copied().collect();
        names.sort_unstable();
        names.dedup();
        let mut lines = Lines { kinds: tags.vertices, size, beside: vec![Vec::new(); names.len()], names };
        tags.edges.iter().for_each(|&[a, b]| lines.join(a, b));
        lines
    }

    /// The features as they are now; edges in any order.
    pub fn into_tags(self) -> FeatureTags {
        let edges =
            self.vertices().flat_map(|(v, beside)| beside.iter().filter(move |w| v < **w).map(move |&w| [v, w]));
        FeatureTags { edges: edges.collect(), vertices: self.kinds }
    }

    /// Vertices where lines end, meet or have a corner, with those beside them.
    pub fn special(&self) -> impl Iterator<Item = (u32, &[u32])> {
        self.vertices().filter(|(v, beside)| beside.len() != 2 || self.kinds[*v as usize] == FeatureKind::Corner)
    }

    /// Vertices with others beside them, ascending.
    pub fn vertices(&self) -> impl Iterator<Item = (u32, &[u32])> {
        let all = self.names.iter().zip(&self.beside).map(|(&v, beside)| (v, beside.as_slice()));
        all.filter(|(_, beside)| !beside.is_empty())
    }

    pub fn beside(&self, v: u32) -> &[u32] {
        self.names.binary_search(&v).map_or(&[], |n| &self.beside[n])
    }

    pub fn join(&mut self, v: u32, w: u32) {
        for (a, b) in [(v, w), (w, v)] {
            let n = self.names.binary_search(&a).unwrap_or_else(|n| {
                self.names.insert(n, a);
                self.beside.insert(n, Vec::new());
                n
            });
            if !self.beside[n].contains(&b) {
                self.beside[n].push(b);
            }
        }
    }

    pub fn part(&mut self, v: u32, w: u32) {
        for (a, b) in [(v, w), (w, v)] {
            if let Ok(n) = self.names.binary_search(&a) {
                self.beside[n].retain(|&x| x != b);
            }
        }
    }

    /// `v` becomes `w`.
    pub fn merge(&mut self, v: u32, w: u32) {
        let Ok(n) = self.names.binary_search(&v) else { return };
        for x in std::mem::take(&mut self.beside[n]) {
            if let Ok(n) = self.names.binary_search(&x) {
                self.beside[n].retain(|&y| y != v);
            }
            if x != w {
                self.join(x, w);
            }
        }
    }
}

/// Lets lines follow those of a source that lists its corners: two lines that share a cell may have been taken for one.
/// Edges that follow none are lines no more, and vertices where lines meet or end are joined with the next along a line
/// of the source, over an edge that is there or that flips make.
/// * `came` - vertices at corners that no line meets yet
pub fn follow(
    local: &mut Local,
    lines: &mut Lines,
    sharp: f64,
    creases: &dyn Creases,
    corners: &[DVec3],
    came: &[u32],
) {
    let size = lines.size;
    let tree = KdTree::new(corners);
    let is_corner = |p: DVec3| {
        let mut found = false;
        tree.within(p, TAKEN * size, |_, _, _| found = true);
        found
    };
    let along = |a: DVec3, b: DVec3| {
        PLACES_ON_EDGE.iter().all(|&s| creases.nearest(a.lerp(b, s), ALONG_LINE_CELLS * size, &[]).is_some())
    };
    let mut nodes: Vec<u32> = lines
        .vertices()
        .filter(|(v, beside)| beside.len() == 1 || lines.kinds[*v as usize] == FeatureKind::Corner)
        .map(|(v, _)| v)
        .filter(|&v| !local.star(v).is_empty())
        .collect();
    nodes.extend(came);
    for &v in &nodes {
        for w in lines.beside(v).to_vec() {
            let (a, b) = (local.position(v), local.position(w));
            let between = |x: &u32| {
                let p = local.position(*x);
                let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                lines.beside(w).contains(x) && p.distance(a.lerp(b, t)) < ALONG_LINE_CELLS * size
            };
            if lines.beside(v).iter().any(between) || !(along(a, b) || is_corner(a) && is_corner(b)) {
                lines.part(v, w);
            }
        }
    }
    for v in nodes {
        let mut near = local.neighbours(v);
        near.extend(near.clone().into_iter().flat_map(|w| local.neighbours(w)));
        near.sort_unstable();
        near.dedup();
        for w in near {
            let own = lines.beside(v);
            let joins = lines.kinds[w as usize] != FeatureKind::None
                && !own.contains(&w)
                && !own.iter().any(|x| lines.beside(w).contains(x))
                && along(local.position(v), local.position(w));
            let fixed = |a: u32, b: u32| lines.beside(a).contains(&b);
            if w != v
                && joins
                && (local.are_neighbours(v, w) || local.connect(v, w, fixed))
                && local.is_sharp(v, w, sharp)
            {
                lines.join(v, w);
            }
        }
        if lines.beside(v).len() == 2 && !is_corner(local.position(v)) {
            lines.kinds[v as usize] = FeatureKind::Edge;
        }
    }
}

/// Vertices for lines of the source that share the faces of cells with others: a face carries one point. Places where
/// the mesh passes by become new vertices; returns them.
pub fn insert_missing(local: &mut Local, lines: &mut Lines, crowded: &[(DVec3, [DVec3; 2])]) -> Vec<u32> {
    let mut made = Vec::new();
    for &place in crowded {
        let fixed = |a: u32, b: u32| lines.beside(a).contains(&b);
        if let Some(v) = local.insert(place, [MISSED * lines.size, ALONG_SIDE * lines.size], fixed) {
            lines.kinds.push(FeatureKind::Edge);
            made.push(v);
        }
    }
    made
}

/// Joins loose ends of lines with what they end beside: over an edge that is there, or that a flip makes.
pub fn join_ends(local: &mut Local, lines: &mut Lines, sharp: f64) {
    let ends: Vec<u32> = lines.vertices().filter(|(_, beside)| beside.len() == 1).map(|(v, _)| v).collect();
    for v in ends {
        if lines.beside(v).len() != 1 || local.star(v).is_empty() {
            continue;
        }
        let joins = |w: u32, lines: &Lines| {
            let beside = lines.beside(w);
            w != v
                && !beside.contains(&v)
                && (beside.len() == 1 || (lines.kinds[w as usize] == FeatureKind::Corner && !beside.is_empty()))
        };
        let ring = local.neighbours(v);
        if let Some(&w) = ring.iter().find(|&&w| joins(w, lines) && local.is_sharp(v, w, sharp)) {
            lines.join(v, w);
            continue;
        }
        // Vertices opposite over an edge of the star.
        for w in local.beyond(v) {
            if joins(w, lines) && local.flip_to(v, w) {
                if local.is_sharp(v, w, sharp) {
                    lines.join(v, w);
                }
                break;
            }
        }
    }
}
