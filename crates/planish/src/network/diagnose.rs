//! What is not yet a four-sided disk patch in a network that is being edited, and why.
//!
//! The curves are imprinted; around every corner they are ordered as the faces there, so the loops around the
//! regions between them can be walked. [`glance`] imprints only the faces that the curves touch and tells by the
//! loops alone: its time depends on the curves, not on the mesh. [`diagnose`] imprints the whole mesh and also looks
//! whether every region is a disk.
//!
//! See `docs/methods/curves.md`, "Regions"; patches are the faces of the graph of curves.

use super::disk::Disk;
use super::imprint::{self, Cut, ImprintError, Place};
use super::{Network, Patch, Side};
use crate::mesh::{Adjacency, FacePoint, NONE, TriMesh, next, previous};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// A part of the mesh between curves.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// The closed loops of curves around it, each with the region on the left of its sides.
    pub loops: Vec<Vec<Side>>,
    /// World position of a place in it.
    pub place: DVec3,
}

/// Something to be put right before every part of the mesh is a four-sided patch.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Fault {
    /// The curves cannot be imprinted: they cross, jump or leave the mesh.
    #[error(transparent)]
    Curves(#[from] ImprintError),
    /// A curve ends where nothing else does.
    #[error(
        "curve {curve} ends alone in corner {corner} at ({:.6}, {:.6}, {:.6}) - hint: lead it on to another corner or delete it",
        place.x, place.y, place.z
    )]
    Dangling {
        /// The curve.
        curve: u32,
        /// Its free end.
        corner: u32,
        /// World position of the corner.
        place: DVec3,
    },
    /// A corner without curves.
    #[error("corner {corner} at ({:.6}, {:.6}, {:.6}) has no curves - hint: draw one to it or delete it",
        place.x, place.y, place.z)]
    LooseCorner {
        /// The corner.
        corner: u32,
        /// Its world position.
        place: DVec3,
    },
    /// A region with another number of sides than four.
    #[error(
        "the region at ({:.6}, {:.6}, {:.6}) has {} side{}, not 4 - hint: {}",
        place.x, place.y, place.z, sides.len(), if sides.len() == 1 { "" } else { "s" }, offer(sides.len())
    )]
    NotFourSided {
        /// Its sides.
        sides: Vec<Side>,
        /// World position of a place in it.
        place: DVec3,
    },
    /// A region with holes.
    #[error(
        "the region at ({:.6}, {:.6}, {:.6}) has {loops} loops of curves around it, not one - hint: join them by curves",
        place.x, place.y, place.z
    )]
    Holes {
        /// Loops around it.
        loops: usize,
        /// World position of a place in it.
        place: DVec3,
    },
    /// A region with a handle or a tunnel.
    #[error("the region at ({:.6}, {:.6}, {:.6}) has a handle - hint: lead a curve around it", place.x, place.y, place.z)]
    Handle {
        /// World position of a place in it.
        place: DVec3,
    },
    /// A region that runs to a boundary of the mesh without a curve along it.
    #[error(
        "no curve runs along the boundary of the mesh at ({:.6}, {:.6}, {:.6}) - hint: add the boundary as a curve, or complete the network",
        place.x, place.y, place.z
    )]
    OpenBoundary {
        /// World position of a place on it.
        place: DVec3,
    },
    /// A piece of the mesh without any curve.
    #[error(
        "a piece of {triangles} triangles at ({:.6}, {:.6}, {:.6}) has no curves - hint: complete the network",
        place.x, place.y, place.z
    )]
    Bare {
        /// Triangles of the imprinted piece.
        triangles: usize,
        /// World position of a place on it.
        place: DVec3,
    },
}

/// The way out for a region with `sides` sides.
fn offer(sides: usize) -> &'static str {
    match sides {
        3 => "split it into three patches around its middle",
        5 => "split it in two from the middle of one side to the corner across",
        6 => "split it in two from corner to corner",
        _ => "draw more curves through it, or complete the network",
    }
}

/// What [`diagnose`] and [`glance`] find.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Diagnosis {
    /// The patches: regions with one loop of four sides.
    pub patches: Vec<Patch>,
    /// All regions that have curves around them, in the order of their first sides.
    pub regions: Vec<Region>,
    /// What is to be put right; empty for a finished network.
    pub faults: Vec<Fault>,
}

impl Diagnosis {
    /// True if the network is finished.
    pub fn is_finished(&self) -> bool {
        self.faults.is_empty()
    }
}

/// Curves imprinted, with the half-edges to their left.
pub(crate) struct Drawn {
    pub cut: Cut,
    pub adjacency: Adjacency,
    /// For each half-curve `2 curve + reversed` its half-edges in its direction; [`NONE`] where the mesh ends.
    pub halves: Vec<Vec<u32>>,
    /// For each half-edge of the cut mesh whether a curve runs along it.
    pub barrier: Vec<bool>,
}

pub(crate) fn draw(mesh: &TriMesh, adjacency: &Adjacency, chains: &[Vec<Place>]) -> Result<Drawn, ImprintError> {
    let borrowed: Vec<&[Place]> = chains.iter().map(|c| &c[..]).collect();
    let cut = imprint::cut(mesh, adjacency, &borrowed)?;
    let own = Adjacency::new(&cut.mesh);
    let mut barrier = vec![false; own.opposite.len()];
    let mut halves = Vec::with_capacity(2 * chains.len());
    let mut taken: BTreeMap<u32, usize> = BTreeMap::new();
    for (c, chain) in cut.chains.iter().enumerate() {
        let mut sides = [Vec::with_capacity(chain.len()), Vec::with_capacity(chain.len())];
        for pair in chain.windows(2) {
            let both = [
                imprint::half_edge(&cut.mesh.triangles, &own, pair[0], pair[1]),
                imprint::half_edge(&cut.mesh.triangles, &own, pair[1], pair[0]),
            ];
            let p = cut.mesh.points[pair[0] as usize];
            if both == [None, None] {
                return Err(ImprintError::Jump { curve: c, x: p.x, y: p.y, z: p.z });
            }
            for (side, h) in sides.iter_mut().zip(both) {
                side.push(h.unwrap_or(NONE));
                if let Some(h) = h {
                    barrier[h as usize] = true;
                    // Two curves along one edge are as bad as two that cross.
                    if let Some(other) = taken.insert(h, c) {
                        return Err(ImprintError::Crossing { curves: vec![other, c], x: p.x, y: p.y, z: p.z });
                    }
                }
            }
        }
        // Curves may meet at their ends only.
        sides[1].reverse();
        halves.extend(sides);
    }
    let mut inner: BTreeMap<u32, usize> = BTreeMap::new();
    for (c, chain) in cut.chains.iter().enumerate() {
        for &v in &chain[1..chain.len().saturating_sub(1).max(1)] {
            if let Some(other) = inner.insert(v, c) {
                let p = cut.mesh.points[v as usize];
                return Err(ImprintError::Crossing { curves: vec![other, c], x: p.x, y: p.y, z: p.z });
            }
        }
    }
    for (c, chain) in cut.chains.iter().enumerate() {
        for v in [chain.first(), chain.last()].into_iter().flatten() {
            if let Some(&other) = inner.get(v) {
                let p = cut.mesh.points[*v as usize];
                return Err(ImprintError::Crossing { curves: vec![other, c], x: p.x, y: p.y, z: p.z });
            }
        }
    }
    Ok(Drawn { cut, adjacency: own, halves, barrier })
}

/// The places of all curves.
/// # Errors
/// `NoSuchFace`.
pub(crate) fn chains(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    network: &Network,
) -> Result<Vec<Vec<Place>>, ImprintError> {
    let faces = mesh.triangles.len();
    network
        .curves
        .iter()
        .enumerate()
        .map(|(c, curve)| match curve.points.iter().find(|p| p.face as usize >= faces) {
            Some(p) => Err(ImprintError::NoSuchFace { curve: c, face: p.face, faces }),
            None => Ok(curve.points.iter().map(|p| imprint::place_of(adjacency, &mesh.triangles, p)).collect()),
        })
        .collect()
}

/// The loops of half-curves around the regions, and for each whether it runs along an open boundary without curve.
pub(crate) fn loops(drawn: &Drawn) -> Vec<(Vec<u32>, bool)> {
    let Drawn { cut, adjacency, halves, .. } = drawn;
    let triangles = &cut.mesh.triangles;
    let from = |h: u32| triangles[h as usize / 3][h as usize % 3];
    // Outgoing half-curves of every end, in the order of the edges around it.
    let mut outgoing: BTreeMap<u32, Vec<(u32, u32)>> = BTreeMap::new();
    for (c, chain) in cut.chains.iter().enumerate() {
        if chain.len() > 1 {
            outgoing.entry(chain[0]).or_default().push((chain[1], 2 * c as u32));
            outgoing.entry(chain[chain.len() - 1]).or_default().push((chain[chain.len() - 2], 2 * c as u32 + 1));
        }
    }
    let mut turn: BTreeMap<u32, (u32, bool)> = BTreeMap::new();
    for (&v, list) in &outgoing {
        let mut order: BTreeMap<u32, usize> = BTreeMap::new();
        let mut last = NONE;
        for h in adjacency.fan(v) {
            order.insert(from(next(h)), order.len());
            last = previous(h);
        }
        if last != NONE && adjacency.opposite[last as usize] == NONE {
            order.insert(from(last), order.len());
        }
        let mut sorted: Vec<(usize, u32)> =
            list.iter().map(|&(to, half)| (order.get(&to).copied().unwrap_or(usize::MAX), half)).collect();
        sorted.sort_unstable();
        let open = adjacency.is_boundary_vertex(v);
        for k in 0..sorted.len() {
            // Clockwise from the way back is the next side of the region on the left.
            let before = sorted[(k + sorted.len() - 1) % sorted.len()].1;
            turn.insert(sorted[k].1, (before, open && k == 0));
        }
    }
    let mut seen = vec![false; halves.len()];
    let mut found = Vec::new();
    for start in 0..halves.len() as u32 {
        if seen[start as usize] || halves[start as usize].first().is_none_or(|&h| h == NONE) {
            continue;
        }
        let (mut one, mut open, mut half) = (Vec::new(), false, start);
        while !seen[half as usize] {
            seen[half as usize] = true;
            one.push(half);
            let Some(&(ahead, over)) = turn.get(&(half ^ 1)) else { break };
            open |= over || halves[ahead as usize].first().is_none_or(|&h| h == NONE);
            half = ahead;
        }
        found.push((one, open));
    }
    found
}

fn side(half: u32) -> Side {
    Side { curve: half / 2, reversed: half % 2 == 1 }
}

/// Faults that the corners alone tell.
fn corner_faults(mesh: &TriMesh, network: &Network) -> Vec<Fault> {
    let mut ends = vec![Vec::new(); network.corners.len()];
    for (c, curve) in network.curves.iter().enumerate() {
        for k in curve.corners {
            ends[k as usize].push(c as u32);
        }
    }
    let faces = mesh.triangles.len();
    let place = |k: usize| match network.corners[k].place {
        p if (p.face as usize) < faces => p.position(mesh),
        _ => DVec3::NAN,
    };
    let fault = |(k, list): (usize, &Vec<u32>)| match list[..] {
        [] => Some(Fault::LooseCorner { corner: k as u32, place: place(k) }),
        [curve] => Some(Fault::Dangling { curve, corner: k as u32, place: place(k) }),
        _ => None,
    };
    ends.iter().enumerate().filter_map(fault).collect()
}

/// Tells at a glance, from the faces that the curves touch alone. Regions of four sides count as patches whether or
/// not they are disks: [`diagnose`] looks at that.
pub fn glance(mesh: &TriMesh, adjacency: &Adjacency, network: &Network) -> Diagnosis {
    let mut found = Diagnosis { faults: corner_faults(mesh, network), ..Diagnosis::default() };
    let chains = match chains(mesh, adjacency, network) {
        Ok(chains) => chains,
        Err(e) => {
            found.faults.push(e.into());
            return found;
        }
    };
    let (part, chains) = part(mesh, adjacency, &chains);
    let own = Adjacency::new(&part);
    let drawn = match draw(&part, &own, &chains) {
        Ok(drawn) => drawn,
        Err(e) => {
            found.faults.push(e.into());
            return found;
        }
    };
    for (one, _) in loops(&drawn) {
        let h = drawn.halves[one[0] as usize][0];
        let place = drawn.cut.mesh.corners(h as usize / 3).into_iter().sum::<DVec3>() / 3.0;
        let sides: Vec<Side> = one.iter().map(|&h| side(h)).collect();
        match sides[..] {
            [a, b, c, d] => found.patches.push(Patch { sides: [a, b, c, d] }),
            _ => found.faults.push(Fault::NotFourSided { sides: sides.clone(), place }),
        }
        found.regions.push(Region { loops: vec![sides], place });
    }
    found
}

/// The faces that hold a place of the curves as a mesh of their own, and the curves on it.
fn part(mesh: &TriMesh, adjacency: &Adjacency, chains: &[Vec<Place>]) -> (TriMesh, Vec<Vec<Place>>) {
    let mut faces = BTreeSet::new();
    for place in chains.iter().flatten() {
        faces.extend(place.faces(adjacency));
    }
    let number: BTreeMap<u32, u32> = faces.iter().enumerate().map(|(k, &f)| (f, k as u32)).collect();
    let mut vertices: BTreeMap<u32, u32> = BTreeMap::new();
    let mut points = Vec::new();
    let triangles = faces
        .iter()
        .map(|&f| {
            mesh.triangles[f as usize].map(|v| {
                *vertices.entry(v).or_insert_with(|| {
                    points.push(mesh.points[v as usize]);
                    points.len() as u32 - 1
                })
            })
        })
        .collect();
    let part = TriMesh::new(points, triangles);
    let own = Adjacency::new(&part);
    let moved = |place: &Place| match *place {
        Place::Vertex(v) => Place::Vertex(vertices[&v]),
        Place::Edge(h, t) => imprint::canonical(&own, 3 * number[&(h / 3)] + h % 3, t),
        Place::Face(p) => Place::Face(FacePoint { face: number[&p.face], bary: p.bary }),
    };
    let chains = chains.iter().map(|c| c.iter().map(moved).collect()).collect();
    (part, chains)
}

/// The regions of a network with their triangles, for splitting.
pub(crate) struct Regions {
    pub drawn: Drawn,
    /// For each region its loops of half-curves and its triangles of the cut mesh.
    pub parts: Vec<(Vec<Vec<u32>>, Vec<u32>)>,
    pub open: Vec<bool>,
}

pub(crate) fn regions(mesh: &TriMesh, adjacency: &Adjacency, network: &Network) -> Result<Regions, ImprintError> {
    let chains = chains(mesh, adjacency, network)?;
    let drawn = draw(mesh, adjacency, &chains)?;
    let triangles = drawn.cut.mesh.triangles.len();
    let mut label = vec![NONE; triangles];
    let mut parts: Vec<(Vec<Vec<u32>>, Vec<u32>)> = Vec::new();
    let mut open = Vec::new();
    let mut stack = Vec::new();
    let found = loops(&drawn);
    let seeds = found.iter().map(|(one, _)| drawn.halves[one[0] as usize][0] / 3).chain(0..triangles as u32);
    for seed in seeds {
        if label[seed as usize] != NONE {
            continue;
        }
        let name = parts.len() as u32;
        label[seed as usize] = name;
        stack.push(seed);
        let mut faces = Vec::new();
        while let Some(f) = stack.pop() {
            faces.push(f);
            for h in 3 * f..3 * f + 3 {
                let o = drawn.adjacency.opposite[h as usize];
                if !drawn.barrier[h as usize] && o != NONE && label[o as usize / 3] == NONE {
                    label[o as usize / 3] = name;
                    stack.push(o / 3);
                }
            }
        }
        faces.sort_unstable();
        parts.push((Vec::new(), faces));
        open.push(false);
    }
    for (one, over) in found {
        let name = label[drawn.halves[one[0] as usize][0] as usize / 3] as usize;
        parts[name].0.push(one);
        open[name] |= over;
    }
    // A boundary of the mesh without a curve along it belongs to the region there.
    for h in 0..drawn.adjacency.opposite.len() {
        if drawn.adjacency.opposite[h] == NONE && !drawn.barrier[h] {
            open[label[h / 3] as usize] = true;
        }
    }
    Ok(Regions { drawn, parts, open })
}

/// Looks at the whole mesh: which regions are four-sided disks, and what is wrong with the others.
pub fn diagnose(mesh: &TriMesh, adjacency: &Adjacency, network: &Network) -> Diagnosis {
    let mut found = Diagnosis { faults: corner_faults(mesh, network), ..Diagnosis::default() };
    let regions = match regions(mesh, adjacency, network) {
        Ok(regions) => regions,
        Err(e) => {
            found.faults.push(e.into());
            return found;
        }
    };
    let drawn = &regions.drawn;
    for ((loops, faces), &open) in regions.parts.iter().zip(&regions.open) {
        let seed = match loops.first() {
            Some(one) => drawn.halves[one[0] as usize][0] / 3,
            None => faces[0],
        };
        let place = drawn.cut.mesh.corners(seed as usize).into_iter().sum::<DVec3>() / 3.0;
        if loops.is_empty() {
            found.faults.push(Fault::Bare { triangles: faces.len(), place });
            continue;
        }
        let sides: Vec<Vec<Side>> = loops.iter().map(|l| l.iter().map(|&h| side(h)).collect()).collect();
        if open {
            let free = |&h: &u32| drawn.adjacency.opposite[h as usize] == NONE && !drawn.barrier[h as usize];
            let at = faces.iter().flat_map(|&f| 3 * f..3 * f + 3).find(free);
            let place = at.map_or(place, |h| drawn.cut.mesh.corners(h as usize / 3)[h as usize % 3]);
            found.faults.push(Fault::OpenBoundary { place });
        } else if loops.len() > 1 {
            found.faults.push(Fault::Holes { loops: loops.len(), place });
        } else {
            let start = drawn.halves[loops[0][0] as usize][0];
            let barrier = |h: u32| drawn.barrier[h as usize];
            let disk = Disk::new(&drawn.cut.mesh.triangles, &drawn.adjacency, faces, barrier, start);
            match (disk, &sides[0][..]) {
                (None, _) => found.faults.push(Fault::Handle { place }),
                (Some(_), &[a, b, c, d]) => found.patches.push(Patch { sides: [a, b, c, d] }),
                (Some(_), other) => found.faults.push(Fault::NotFourSided { sides: other.to_vec(), place }),
            }
        }
        found.regions.push(Region { loops: sides, place });
    }
    found
}
