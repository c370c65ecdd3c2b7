//! The sectors that lines part the surroundings of a vertex into.

use crate::mesh::{Adjacency, NONE, TriMesh, next, previous};

/// A run of faces around a vertex of a line, from one line to the next, counter-clockwise.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sector {
    /// The vertex.
    pub vertex: u32,
    /// Outgoing half-edges, one for each face of the sector; the first lies on a line.
    pub spokes: Vec<u32>,
    /// Angle between the two lines, radians.
    pub angle: f64,
}

/// The sectors of all vertices on lines and boundaries, by vertex. A line with one end at the vertex has one sector that
/// goes all around.
pub(crate) fn sectors(mesh: &TriMesh, adjacency: &Adjacency, lines: &[bool]) -> Vec<Sector> {
    let mut out = Vec::new();
    for v in 0..mesh.points.len() as u32 {
        let mut fan: Vec<u32> =
            if adjacency.outgoing[v as usize] == NONE { Vec::new() } else { adjacency.fan(v).collect() };
        let on_line = |h: u32| lines[h as usize] || adjacency.opposite[h as usize] == NONE;
        let Some(first) = fan.iter().position(|&h| on_line(h)) else { continue };
        fan.rotate_left(first);
        let starts: Vec<usize> = (0..fan.len()).filter(|&i| on_line(fan[i])).collect();
        for (i, &start) in starts.iter().enumerate() {
            let end = starts.get(i + 1).copied().unwrap_or(fan.len());
            let spokes = fan[start..end].to_vec();
            let angle = spokes.iter().map(|&h| corner_angle(mesh, h)).sum();
            out.push(Sector { vertex: v, spokes, angle });
        }
    }
    out
}

/// Angle of the face of `h` at the vertex where `h` starts, radians.
pub(crate) fn corner_angle(mesh: &TriMesh, h: u32) -> f64 {
    let [at, to, from] = [h, next(h), previous(h)].map(|h| mesh.points[mesh.origin(h) as usize]);
    (to - at).cross(from - at).length().atan2((to - at).dot(from - at))
}
