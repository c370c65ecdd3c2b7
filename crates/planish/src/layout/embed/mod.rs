//! From an integer-grid map to the complex of its unit squares, drawn on the mesh that was mapped.
//!
//! 1. the map is put on a lattice where sums and signs are exact, and vertices are moved, in the map only, until every
//!    integer point has one ([`lattice`]): the nodes;
//! 2. the lines of the grid are followed from node to node through the triangles ([`trace`]): the arcs;
//! 3. around every node its arcs are known in order, so the cells follow: the unit squares.
//!
//! Ebke, Bommes, Campen, Kobbelt, *QEx: Robust Quad Mesh Extraction*, 2013, trace in the same way, but leave the
//! integer points inside triangles.

mod lattice;
#[cfg(test)]
mod tests;
mod trace;

use crate::layout::complex::{Arc, Complex, Node};
use crate::layout::map::SeamlessMap;
use crate::layout::proxy::Proxy;
use crate::layout::recut::keep_apart;
use crate::mesh::{Adjacency, NONE, TriMesh, next};
use crate::network::CurveKind;
use crate::network::imprint::Place;
use crate::observe::counted;
use lattice::{Freedom, Lattice, UNIT, cross, is_whole, minus};
use std::collections::HashMap;
use std::rc::Rc;
use trace::{Met, Port};

/// Curves that cross one edge keep at least this distance from each other and from its ends, as a fraction of the edge
/// (less where many cross).
const CROSSINGS_APART: f64 = 0.02;

/// Every integer point of a map needs a vertex. Where too few can get there edges are to be this long in unit squares: four
/// vertices for one square. Chosen.
const EDGE_TO_SQUARE: f64 = 0.5;

/// Why the squares of a map cannot be drawn on its mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum EmbedError {
    /// The charts of two triangles do not fit.
    #[error(
        "the charts on both sides of half-edge {half_edge} are not a whole number apart - hint: round the map first"
    )]
    Torn {
        /// The half-edge.
        half_edge: u32,
    },
    /// A cone, a corner or a line is not on the grid.
    #[error("vertex {vertex} must lie on the grid and does not - hint: round the map first")]
    NotWhole {
        /// The vertex.
        vertex: u32,
    },
    /// A triangle is turned over or has no area.
    #[error("triangle {face} has no area in the map - hint: untangle the map first")]
    Flipped {
        /// The triangle.
        face: u32,
    },
    /// The map winds around a vertex twice or more, though all triangles are upright.
    #[error(
        "the map winds more than once around vertex {vertex}, which is no cone - hint: untangle it from another start"
    )]
    Wound {
        /// The vertex.
        vertex: u32,
    },
    /// There are more integer points than vertices that could stand there.
    #[error("no vertex can stand at integer points of {} - hint: use a finer mesh or larger squares", counted(.faces.len(), "triangle", "triangles"))]
    Crowded {
        /// The triangles.
        faces: Vec<u32>,
    },
    /// The lines of the grid do not close to squares.
    #[error("the grid lines from vertex {vertex} do not close to squares - hint: check the cones of the map")]
    Open {
        /// The vertex.
        vertex: u32,
    },
}

/// The unit squares of an integer-grid map as a complex on `mesh`.
///
/// Nodes are the integer points of the map; those that stay are ends, corners and junctions of lines. What runs along
/// lines or the boundary is said to do so. All cells have four sides.
/// * `lines` - for each half-edge whether it is on a sharp line, which must be a line of the grid; boundaries always are
/// * `map` - all triangles upright; changes between charts whole; cones, ends, corners and junctions of lines whole
///
/// # Errors
/// [`EmbedError`] names the part of the map that is not so, or that the mesh is too coarse for.
pub(super) fn embed(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    lines: &[bool],
    map: &SeamlessMap,
) -> Result<Complex, EmbedError> {
    let mut lattice = Lattice::new(mesh, adjacency, lines, map)?;
    lattice.occupy()?;
    let mut node = vec![NONE; mesh.points.len()];
    let mut complex = Complex::default();
    let mut ports: Vec<Vec<Port>> = Vec::new();
    for v in 0..mesh.points.len() as u32 {
        let h = adjacency.outgoing[v as usize];
        if h != NONE && is_whole(lattice.at(h)) {
            node[v as usize] = complex.nodes.len() as u32;
            let lined = adjacency.fan(v).any(|h| lattice.line[h as usize]);
            let stays = lined && lattice.freedom[v as usize] == Freedom::Stays;
            complex.nodes.push(Node { vertex: v, stays });
            ports.push(trace::ports(&lattice, v));
        }
    }
    let half = arcs(&lattice, &node, &ports, &mut complex)?;
    cells(&lattice, &ports, &half, &mut complex)?;
    Ok(complex)
}

/// [`embed`] on a proxy that gets back as many vertices as the squares need.
/// # Errors
/// [`EmbedError`], of `proxy` as it is.
pub(super) fn embed_on(proxy: &Rc<Proxy>, map: &SeamlessMap) -> Result<(Rc<Proxy>, Complex), EmbedError> {
    let drawn = |proxy: &Proxy, map: &SeamlessMap| embed(&proxy.mesh, &proxy.adjacency, &proxy.lines, map);
    let fault = match drawn(proxy, map) {
        Ok(complex) => return Ok((Rc::clone(proxy), complex)),
        Err(fault) => fault,
    };
    let mut left = fault.clone();
    let mut finer: Option<(Proxy, SeamlessMap)> = None;
    while let EmbedError::Crowded { faces } = &left {
        let (proxy, map) = finer.as_ref().map_or((&**proxy, map), |(proxy, map)| (proxy, map));
        let Some((proxy, map)) = proxy.regained(faces, map, EDGE_TO_SQUARE) else { break };
        match drawn(&proxy, &map) {
            Ok(complex) => return Ok((Rc::new(proxy), complex)),
            Err(fault) => left = fault,
        }
        finer = Some((proxy, map));
    }
    Err(fault)
}

/// Follows the grid from every port once; returns for each port of each node the half-arc that leaves there.
fn arcs(
    lattice: &Lattice,
    node: &[u32],
    ports: &[Vec<Port>],
    complex: &mut Complex,
) -> Result<Vec<Vec<u32>>, EmbedError> {
    let mut half: Vec<Vec<u32>> = ports.iter().map(|p| vec![NONE; p.len()]).collect();
    let mut on_edge: HashMap<u32, Vec<([i64; 2], u32, usize)>> = HashMap::new();
    for n in 0..ports.len() {
        for i in 0..ports[n].len() {
            if half[n][i] != NONE {
                continue;
            }
            let vertex = complex.nodes[n].vertex;
            let open = EmbedError::Open { vertex };
            let (met, last) = trace::follow(lattice, node, ports[n][i]).ok_or(open.clone())?;
            let m = node[lattice.mesh.origin(last.corner) as usize] as usize;
            let j = ports[m].iter().position(|p| p.is(lattice, &last)).ok_or(open.clone())?;
            if half[m][j] != NONE || (m, j) == (n, i) {
                return Err(open);
            }
            let a = complex.arcs.len() as u32;
            (half[n][i], half[m][j]) = (2 * a, 2 * a + 1);
            let mut chain = vec![Place::Vertex(vertex)];
            for place in met {
                chain.push(match place {
                    Met::Vertex(v) => Place::Vertex(v),
                    Met::Edge(h, part) => {
                        on_edge.entry(h).or_default().push((part, a, chain.len()));
                        Place::Edge(h, part[0] as f64 / part[1] as f64)
                    }
                });
            }
            let kind = match ports[n][i].along {
                Some(e) if lattice.adjacency.opposite[e as usize] == NONE => CurveKind::Boundary,
                Some(e) if lattice.line[e as usize] => CurveKind::Feature,
                _ => CurveKind::Smooth,
            };
            complex.arcs.push(Some(Arc { nodes: [n as u32, m as u32], kind, chain, cells: [NONE; 2] }));
        }
    }
    for (h, mut met) in on_edge {
        // Fractions compare exactly: no order is lost to rounding.
        met.sort_by(|(p, ..), (q, ..)| (p[0] as i128 * q[1] as i128).cmp(&(q[0] as i128 * p[1] as i128)));
        let mut parts: Vec<f64> = met.iter().map(|(p, ..)| p[0] as f64 / p[1] as f64).collect();
        keep_apart(&mut parts, CROSSINGS_APART);
        for ((_, a, i), part) in met.into_iter().zip(parts) {
            if let Some(arc) = &mut complex.arcs[a as usize] {
                arc.chain[i] = Place::Edge(h, part);
            }
        }
    }
    Ok(half)
}

/// Closes the cells: at the end of a half-arc the next one around its left is the one clockwise from where it came.
fn cells(lattice: &Lattice, ports: &[Vec<Port>], half: &[Vec<u32>], complex: &mut Complex) -> Result<(), EmbedError> {
    let mut leaves = vec![(NONE, 0); 2 * complex.arcs.len()];
    for (n, list) in half.iter().enumerate() {
        list.iter().enumerate().for_each(|(i, &h)| leaves[h as usize] = (n as u32, i));
    }
    let after = |h: u32| {
        let (n, i) = leaves[h as usize ^ 1];
        let open = lattice.adjacency.is_boundary_vertex(complex.nodes[n as usize].vertex);
        let count = ports[n as usize].len();
        (i > 0 || !open).then(|| half[n as usize][(i + count - 1) % count])
    };
    let mut cell = vec![NONE; 2 * complex.arcs.len()];
    let mut cells = Vec::new();
    for h in 0..cell.len() as u32 {
        if cell[h as usize] != NONE || after(h).is_none() {
            continue;
        }
        let open = EmbedError::Open { vertex: complex.nodes[leaves[h as usize].0 as usize].vertex };
        let mut sides = vec![h];
        while let Some(g) = after(sides[sides.len() - 1])
            && g != h
            && sides.len() < 5
        {
            sides.push(g);
        }
        if sides.len() != 4 || sides.iter().any(|&s| cell[s as usize] != NONE) || after(sides[3]) != Some(h) {
            return Err(open);
        }
        sides.iter().for_each(|&s| cell[s as usize] = cells.len() as u32);
        cells.push(Some(sides));
    }
    complex.cells = cells;
    for (a, arc) in complex.arcs.iter_mut().enumerate() {
        if let Some(arc) = arc {
            arc.cells = [cell[2 * a], cell[2 * a + 1]];
        }
    }
    let doubled: i128 = lattice.uv.iter().map(|&[a, b, c]| cross(minus(b, a), minus(c, a))).sum();
    let squares = 2 * complex.cells.len() as i128 * UNIT as i128 * UNIT as i128;
    // Squares that the grid does not name would be missing from the area.
    if doubled == squares { Ok(()) } else { Err(EmbedError::Open { vertex: next(0) }) }
}
