//! Following the lines of the grid through the triangles, from vertex to vertex.

use super::lattice::{Change, Lattice, Spot, cross, minus, turned};
use crate::mesh::{NONE, next, previous};

/// A way out of a node along the grid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Port {
    /// The corner, by the half-edge that leaves it, in whose chart the way starts.
    pub corner: u32,
    /// Its direction there, in quarter turns from the first axis.
    pub direction: u8,
    /// The half-edge whose edge it runs along, if it does: of the corner's triangle, to or from the corner.
    pub along: Option<u32>,
}

impl Port {
    /// True if both are the same way out of the same vertex.
    pub fn is(&self, lattice: &Lattice, other: &Port) -> bool {
        let edge = |e: u32| e.min(lattice.adjacency.opposite[e as usize]);
        match (self.along, other.along) {
            (Some(a), Some(b)) => edge(a) == edge(b),
            (None, None) => (self.corner, self.direction) == (other.corner, other.direction),
            _ => false,
        }
    }
}

/// What a line of the grid meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Met {
    Vertex(u32),
    /// The edge with this half-edge (the lower of the two), at this fraction of the way from its start.
    Edge(u32, [i64; 2]),
}

/// One step along an axis.
fn axis(direction: u8) -> Spot {
    turned([1, 0], direction)
}

/// How direction `d` leaves a corner, if it does inside or at the first edge of its triangle; at the `last` also at the
/// other edge.
fn leaving(lattice: &Lattice, corner: u32, direction: u8, last: bool) -> Option<Port> {
    let (d, own) = (axis(direction), lattice.at(corner));
    let [a, b] = [next(corner), previous(corner)].map(|h| minus(lattice.at(h), own));
    let ahead = |e: Spot| cross(e, d) == 0 && e[0] * d[0] + e[1] * d[1] > 0;
    let along = match () {
        _ if ahead(a) => Some(corner),
        _ if last && ahead(b) => Some(previous(corner)),
        _ if cross(a, d) > 0 && cross(d, b) > 0 => None,
        _ => return None,
    };
    Some(Port { corner, direction, along })
}

/// The ways out of vertex `v`, which lies on an integer point, counter-clockwise.
pub(super) fn ports(lattice: &Lattice, v: u32) -> Vec<Port> {
    let mut ports = Vec::new();
    for corner in lattice.adjacency.fan(v) {
        let last = lattice.adjacency.opposite[previous(corner) as usize] == NONE;
        let first = minus(lattice.at(next(corner)), lattice.at(corner));
        // Directions in the order met from the first edge: it lies in the quarter that begins at the first of them.
        let start = (0..4).find(|&d| {
            let (low, high) = (axis(d), axis(d + 1));
            cross(low, first) >= 0 && cross(first, high) > 0
        });
        let turns = (0..4).map(|k| (start.unwrap_or(0) + k) % 4);
        let on_axis = start.is_some_and(|d| cross(axis(d), first) == 0);
        // The direction behind the first edge is met last.
        let turns = turns.skip(!on_axis as usize).chain(start.filter(|_| !on_axis));
        ports.extend(turns.filter_map(|d| leaving(lattice, corner, d, last)));
    }
    ports
}

/// A line of the grid on its way: a point of it and its direction, in the chart where it is.
#[derive(Clone, Copy)]
struct Ray {
    through: Spot,
    direction: u8,
}

impl Ray {
    fn moved(self, change: Change) -> Ray {
        Ray { through: change.of(self.through), direction: (self.direction + change.turns) % 4 }
    }
}

/// Follows the grid from a port to the next node. Returns what it meets on the way, that node's vertex included, and the
/// way back from there; `None` if it meets a line or the boundary between nodes, or goes on for ever.
pub(super) fn follow(lattice: &Lattice, node: &[u32], port: Port) -> Option<(Vec<Met>, Port)> {
    let mut met = Vec::new();
    let mut port = port;
    let mut ray = Ray { through: lattice.at(port.corner), direction: port.direction };
    for _ in 0..lattice.uv.len() {
        // To the next vertex: `back` is the way back from there.
        let back = match port.along {
            Some(e) => {
                let corner = if e == port.corner { next(e) } else { e };
                Port { corner, direction: (ray.direction + 2) % 4, along: Some(e) }
            }
            None => {
                let corner = cross_triangles(lattice, port.corner, &mut ray, &mut met)?;
                Port { corner, direction: (ray.direction + 2) % 4, along: None }
            }
        };
        let v = lattice.mesh.origin(back.corner);
        met.push(Met::Vertex(v));
        if node[v as usize] != NONE {
            return Some((met, back));
        }
        port = onwards(lattice, back.corner, &mut ray)?;
    }
    None
}

/// Follows the ray from a corner through triangles to the vertex that it meets: returns its corner.
fn cross_triangles(lattice: &Lattice, corner: u32, ray: &mut Ray, met: &mut Vec<Met>) -> Option<u32> {
    let mut out = next(corner);
    for _ in 0..lattice.uv.len() {
        if lattice.line[out as usize] {
            return None;
        }
        met.push(meeting(lattice, out, ray));
        *ray = ray.moved(lattice.change[out as usize]);
        let entry = lattice.adjacency.opposite[out as usize];
        let far = previous(entry);
        let side = cross(axis(ray.direction), minus(lattice.at(far), ray.through));
        // The ray has the start of the edge on its left: with the far corner there, too, it leaves by the other edge.
        out = match side {
            0 => return Some(far),
            s if s > 0 => next(entry),
            _ => far,
        };
    }
    None
}

/// Where a ray crosses a half-edge.
fn meeting(lattice: &Lattice, h: u32, ray: &Ray) -> Met {
    let i = ray.direction.is_multiple_of(2) as usize;
    let (from, to) = (lattice.at(h)[i], lattice.at(next(h))[i]);
    let sign = (to - from).signum();
    let (part, whole) = (sign * (ray.through[i] - from), sign * (to - from));
    let o = lattice.adjacency.opposite[h as usize];
    if o < h { Met::Edge(o, [whole - part, whole]) } else { Met::Edge(h, [part, whole]) }
}

/// How the ray goes on from the vertex of a corner, in whose chart it arrived.
fn onwards(lattice: &Lattice, corner: u32, ray: &mut Ray) -> Option<Port> {
    let (arrived, mut at) = (*ray, corner);
    loop {
        let turn = previous(at);
        let o = lattice.adjacency.opposite[turn as usize];
        if let Some(port) = leaving(lattice, at, ray.direction, o == NONE) {
            return Some(port);
        }
        if o == NONE {
            break;
        }
        *ray = ray.moved(lattice.change[turn as usize]);
        at = o;
        if at == corner {
            return None;
        }
    }
    // The rest of the triangles lies on the other side of the boundary.
    (*ray, at) = (arrived, corner);
    while lattice.adjacency.opposite[at as usize] != NONE {
        *ray = ray.moved(lattice.change[at as usize]);
        at = next(lattice.adjacency.opposite[at as usize]);
        if let Some(port) = leaving(lattice, at, ray.direction, false) {
            return Some(port);
        }
    }
    None
}
