//! Counts of what a repair did (`docs/methods/mend.md`, "Repair").

use serde::{Deserialize, Serialize};

/// What [`repair`](super::repair) did; all zero for a sound mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Repairs {
    /// Vertices merged into another at exactly the same place.
    pub welded_vertices: usize,
    /// Triangles dropped because they named a vertex twice.
    pub repeated_faces: usize,
    /// Triangles dropped because they repeated another.
    pub duplicate_faces: usize,
    /// Edges of more than two triangles, cut.
    pub cut_edges: usize,
    /// Edges cut because their piece was one-sided.
    pub one_sided_edges: usize,
    /// Triangles turned to agree with their neighbours.
    pub turned_faces: usize,
    /// Closed pieces turned because they were inside out.
    pub turned_components: usize,
    /// Vertices made by splitting others, one per fan.
    pub split_vertices: usize,
    /// Edges collapsed to remove triangles without height.
    pub collapsed_edges: usize,
    /// Edges flipped to remove triangles without height.
    pub flipped_edges: usize,
    /// Triangles without height dropped at the boundary.
    pub trimmed_faces: usize,
    /// Handles too small to be meant, cut and closed.
    pub closed_handles: usize,
    /// Holes too small to be meant, closed.
    pub closed_holes: usize,
    /// Triangles without height that could not be removed without tearing the surface.
    pub degenerate_left: usize,
    /// Vertices dropped because no triangle used them.
    pub unreferenced_vertices: usize,
}

impl Repairs {
    /// True if anything was changed.
    pub fn any(&self) -> bool {
        Repairs { degenerate_left: 0, ..*self } != Repairs::default()
    }
}
