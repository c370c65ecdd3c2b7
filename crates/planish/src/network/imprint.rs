//! Imprints curves into a mesh: every crossed triangle is split along them, so that each patch becomes an
//! exact sub-mesh.
//!
//! 1. every curve point becomes a vertex: one of the mesh, a new one on an edge, or a new one in a face;
//! 2. every face with new vertices or a curve through it is triangulated again, alone, with the pieces of the
//!    curves as constraints; points of an edge are sorted along it, so both faces agree;
//! 3. the faces on both sides of the curves are flooded and named after the patch they belong to.
//!
//! See `docs/decisions/0005-spade-and-convex-maps.md`.

use super::disk::{self, Disk};
use super::{Network, PatchMesh};
use crate::geom::tolerance::ON_EDGE;
use crate::mesh::{Adjacency, FacePoint, NONE, TriMesh, next};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};
use std::collections::{HashMap, HashSet};

/// Outward bulge of the points of an edge in the flat picture of a face, as a fraction of the face. It makes
/// them strictly convex, so that rounding can neither hide one nor leave a gap along the edge.
const BULGE: f64 = 1e-7;

/// Why curves could not be imprinted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImprintError {
    /// A curve names a face that the mesh does not have.
    #[error(
        "curve {curve} lies on face {face}, the mesh has {faces} faces - hint: use the mesh that the network was made for"
    )]
    NoSuchFace {
        /// Index of the curve.
        curve: usize,
        /// Index of the face.
        face: u32,
        /// Faces of the mesh.
        faces: usize,
    },
    /// Two neighbouring points of a curve share no face.
    #[error(
        "curve {curve} jumps at ({x:.6}, {y:.6}, {z:.6}): neighbouring points must share a face - hint: add points between"
    )]
    Jump {
        /// Index of the curve.
        curve: usize,
        /// Place.
        x: f64,
        /// Place.
        y: f64,
        /// Place.
        z: f64,
    },
    /// Two curves cross or touch between their ends.
    #[error("two of the curves {curves:?} cross at ({x:.6}, {y:.6}, {z:.6}) - hint: move one of them apart")]
    Crossing {
        /// The curves through the face where they cross.
        curves: Vec<usize>,
        /// Place.
        x: f64,
        /// Place.
        y: f64,
        /// Place.
        z: f64,
    },
    /// The curves around a patch do not bound a disk with these four sides.
    #[error("patch {patch} is not a disk between its four sides ({why}) - hint: check its curves and their direction")]
    NotADisk {
        /// Index of the patch.
        patch: usize,
        /// What is wrong.
        why: &'static str,
    },
    /// A part of the mesh belongs to no patch.
    #[error("{faces} triangles near ({x:.6}, {y:.6}, {z:.6}) belong to no patch - hint: close the network around them")]
    Uncovered {
        /// Triangles of the part.
        faces: usize,
        /// Place.
        x: f64,
        /// Place.
        y: f64,
        /// Place.
        z: f64,
    },
    /// The observer no longer wanted the result.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// A place on a mesh by what it lies on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Place {
    /// A vertex.
    Vertex(u32),
    /// On the edge with this half-edge (the lower of the two), `t` of the way from its start.
    Edge(u32, f64),
    /// Inside a face.
    Face(FacePoint),
}

/// A mesh cut along curves.
#[derive(Clone, Debug)]
pub(crate) struct Cut {
    /// The cut mesh; its first vertices are those of the uncut one.
    pub mesh: TriMesh,
    /// Where each vertex lies on the uncut mesh.
    pub origin: Vec<Place>,
    /// The uncut face that each triangle is a part of.
    pub parent: Vec<u32>,
    /// For each curve its vertices.
    pub chains: Vec<Vec<u32>>,
}

/// The place of a face point, canonical for all faces that share it.
pub(crate) fn place_of(adjacency: &Adjacency, triangles: &[[u32; 3]], point: &FacePoint) -> Place {
    let corner = |k: usize| triangles[point.face as usize][k];
    let near: Vec<usize> = (0..3).filter(|&k| point.bary[k] > ON_EDGE).collect();
    match near[..] {
        [k] => Place::Vertex(corner(k)),
        [a, b] => {
            let k = if (a + 1) % 3 == b { a } else { b };
            let h = 3 * point.face + k as u32;
            let t = point.bary[(k + 1) % 3] / (point.bary[k] + point.bary[(k + 1) % 3]);
            canonical(adjacency, h, t)
        }
        _ => Place::Face(*point),
    }
}

/// The place `t` of the way along half-edge `h`, named by the lower half-edge of the edge.
pub(crate) fn canonical(adjacency: &Adjacency, h: u32, t: f64) -> Place {
    let o = adjacency.opposite[h as usize];
    if o < h { Place::Edge(o, 1.0 - t) } else { Place::Edge(h, t) }
}

impl Place {
    /// True on a boundary edge of the mesh or at the end of one.
    pub fn is_on_boundary(&self, adjacency: &Adjacency) -> bool {
        match *self {
            Place::Vertex(v) => adjacency.is_boundary_vertex(v),
            Place::Edge(h, _) => adjacency.opposite[h as usize] == NONE,
            Place::Face(_) => false,
        }
    }

    /// All faces that it lies on.
    pub fn faces(&self, adjacency: &Adjacency) -> Vec<u32> {
        match *self {
            Place::Vertex(v) => adjacency.fan(v).map(|h| h / 3).collect(),
            Place::Edge(h, _) => {
                let o = adjacency.opposite[h as usize];
                if o == NONE { vec![h / 3] } else { vec![h / 3, o / 3] }
            }
            Place::Face(p) => vec![p.face],
        }
    }

    /// World position.
    pub fn position(&self, mesh: &TriMesh) -> DVec3 {
        match *self {
            Place::Vertex(v) => mesh.points[v as usize],
            Place::Edge(h, t) => {
                let corners = mesh.corners(h as usize / 3);
                corners[h as usize % 3].lerp(corners[next(h) as usize % 3], t)
            }
            Place::Face(p) => p.position(mesh),
        }
    }

    /// The same place as a face point of `face`, if it lies on that face.
    pub fn on_face(&self, adjacency: &Adjacency, triangles: &[[u32; 3]], face: u32) -> Option<FacePoint> {
        let mut bary = [0.0; 3];
        match *self {
            Place::Vertex(v) => bary[triangles[face as usize].iter().position(|&w| w == v)?] = 1.0,
            Place::Edge(h, t) => {
                let (k, t) = if h / 3 == face {
                    ((h % 3) as usize, t)
                } else {
                    let o = adjacency.opposite[h as usize];
                    if o == NONE || o / 3 != face {
                        return None;
                    }
                    ((o % 3) as usize, 1.0 - t)
                };
                bary[k] = 1.0 - t;
                bary[(k + 1) % 3] = t;
            }
            Place::Face(p) if p.face == face => bary = p.bary,
            Place::Face(_) => return None,
        }
        Some(FacePoint { face, bary })
    }

    /// Some face that the place lies on.
    pub fn some_face(&self, adjacency: &Adjacency) -> u32 {
        match *self {
            Place::Vertex(v) => adjacency.outgoing[v as usize] / 3,
            Place::Edge(h, _) => h / 3,
            Place::Face(p) => p.face,
        }
    }
}

/// What two places of a curve have in common, if anything.
pub(crate) fn shared_face(adjacency: &Adjacency, triangles: &[[u32; 3]], a: &Place, b: &Place) -> Option<Shared> {
    let other = b.faces(adjacency);
    let face = a.faces(adjacency).into_iter().filter(|f| other.contains(f)).min()?;
    let ends = |h: u32| [triangles[h as usize / 3][h as usize % 3], triangles[h as usize / 3][next(h) as usize % 3]];
    let along = match (*a, *b) {
        (Place::Vertex(_), Place::Vertex(_)) => true,
        (Place::Vertex(v), Place::Edge(h, _)) | (Place::Edge(h, _), Place::Vertex(v)) => ends(h).contains(&v),
        (Place::Edge(g, _), Place::Edge(h, _)) => g == h,
        _ => false,
    };
    Some(if along { Shared::Edge } else { Shared::Face(face) })
}

/// The place `t` of the way from `a` to `b` if both lie on one edge of the mesh.
pub(crate) fn along_edge(adjacency: &Adjacency, triangles: &[[u32; 3]], a: &Place, b: &Place, t: f64) -> Option<Place> {
    if shared_face(adjacency, triangles, a, b) != Some(Shared::Edge) {
        return None;
    }
    let h = match (*a, *b) {
        (Place::Edge(h, _), _) | (_, Place::Edge(h, _)) => h,
        (Place::Vertex(v), Place::Vertex(w)) => {
            let h = half_edge(triangles, adjacency, v, w).or_else(|| half_edge(triangles, adjacency, w, v))?;
            h.min(adjacency.opposite[h as usize])
        }
        _ => return None,
    };
    let along = |place: &Place| match *place {
        Place::Edge(_, t) => t,
        Place::Vertex(v) if triangles[h as usize / 3][next(h) as usize % 3] == v => 1.0,
        _ => 0.0,
    };
    Some(Place::Edge(h, along(a) + (along(b) - along(a)) * t))
}

/// What two neighbouring places of a curve have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shared {
    /// Both lie on one edge.
    Edge,
    /// Both lie on this face and on no common edge.
    Face(u32),
}

/// Cuts `mesh` along the curves of `network` into one exact disk sub-mesh per patch.
/// # Errors
/// `ImprintError` names the curve or patch that is not in order, with its place; [`ImprintError::Cancelled`].
pub fn imprint(mesh: &TriMesh, network: &Network, observer: &dyn Observer) -> Result<Vec<PatchMesh>, ImprintError> {
    let adjacency = Adjacency::new(mesh);
    let faces = mesh.triangles.len();
    let mut curves: Vec<Vec<Place>> = Vec::with_capacity(network.curves.len());
    for (c, curve) in network.curves.iter().enumerate() {
        if let Some(p) = curve.points.iter().find(|p| p.face as usize >= faces) {
            return Err(ImprintError::NoSuchFace { curve: c, face: p.face, faces });
        }
        observer.check()?;
        curves.push(curve.points.iter().map(|p| place_of(&adjacency, &mesh.triangles, p)).collect());
    }
    let chains: Vec<Chain> = curves.into_iter().enumerate().map(|(curve, places)| Chain { curve, places }).collect();
    let whole: Vec<usize> = (0..chains.len()).collect();
    let all: Vec<usize> = (0..network.patches.len()).collect();
    let (made, lost) = cut_out((mesh, &adjacency), network, &chains, &whole, &all, observer)?;
    match lost {
        Some((faces, p)) => Err(ImprintError::Uncovered { faces, x: p.x, y: p.y, z: p.z }),
        None => Ok(made),
    }
}

/// Places in a row along a curve.
pub(crate) struct Chain {
    /// The curve that it is (a part of).
    pub curve: usize,
    /// Its places.
    pub places: Vec<Place>,
}

/// Patches, and how many triangles belong to none of them, with the place of one.
type CutOut = (Vec<PatchMesh>, Option<(usize, DVec3)>);

/// Cuts `mesh` along `chains` and takes out the patches `which` of `network`.
/// * `whole` - for each curve the chain that is all of it; only those of the sides of `which` are asked for
/// # Errors
/// As [`imprint`], but for parts that belong to no patch.
pub(crate) fn cut_out(
    (mesh, adjacency): (&TriMesh, &Adjacency),
    network: &Network,
    chains: &[Chain],
    whole: &[usize],
    which: &[usize],
    observer: &dyn Observer,
) -> Result<CutOut, ImprintError> {
    let borrowed: Vec<&[Place]> = chains.iter().map(|c| &c.places[..]).collect();
    let cut = cut(mesh, adjacency, &borrowed).map_err(|e| of_curve(e, chains))?;
    observer.progress(0.5);
    observer.check()?;
    let cut_adjacency = Adjacency::new(&cut.mesh);
    let mut barrier = vec![false; 3 * cut.mesh.triangles.len()];
    let mut left: Vec<Vec<u32>> = Vec::with_capacity(cut.chains.len());
    let mut right: Vec<Vec<u32>> = Vec::with_capacity(cut.chains.len());
    for (c, chain) in cut.chains.iter().enumerate() {
        let (mut l, mut r) = (Vec::new(), Vec::new());
        for pair in chain.windows(2) {
            let forward = half_edge(&cut.mesh.triangles, &cut_adjacency, pair[0], pair[1]);
            let backward = half_edge(&cut.mesh.triangles, &cut_adjacency, pair[1], pair[0]);
            if forward.is_none() && backward.is_none() {
                let p = cut.mesh.points[pair[0] as usize];
                return Err(ImprintError::Jump { curve: chains[c].curve, x: p.x, y: p.y, z: p.z });
            }
            for h in [forward, backward].into_iter().flatten() {
                barrier[h as usize] = true;
            }
            l.push(forward.unwrap_or(NONE));
            r.push(backward.unwrap_or(NONE));
        }
        r.reverse();
        left.push(l);
        right.push(r);
    }
    let side_edges = |p: usize, k: usize| {
        let side = network.patches[p].sides[k];
        let chain = whole[side.curve as usize];
        if side.reversed { &right[chain] } else { &left[chain] }
    };
    let mut seeds = Vec::new();
    for (n, &p) in which.iter().enumerate() {
        for k in 0..4 {
            for &h in side_edges(p, k) {
                if h == NONE {
                    return Err(ImprintError::NotADisk { patch: p, why: "a side has no surface on its left" });
                }
                seeds.push((h, n as u32));
            }
        }
    }
    observer.check()?;
    let name = flood(&cut, &cut_adjacency, &barrier, &seeds)
        .map_err(|(a, _)| ImprintError::NotADisk { patch: which[a as usize], why: "it runs into another patch" })?;
    let mut members = vec![Vec::new(); which.len()];
    let mut lost = Vec::new();
    for (f, &p) in name.iter().enumerate() {
        if p == NONE { lost.push(f) } else { members[p as usize].push(f as u32) }
    }
    let lost = lost.first().map(|&f| (lost.len(), cut.mesh.corners(f)[0]));
    // A part that no patch covers is told before a patch that is not in order.
    if lost.is_some() && which.len() == network.patches.len() {
        return Ok((Vec::new(), lost));
    }
    let made: Result<Vec<PatchMesh>, ImprintError> = members
        .par_iter()
        .zip(which)
        .map(|(faces, &p)| {
            observer.check()?;
            let not = |why| ImprintError::NotADisk { patch: p, why };
            let first = *side_edges(p, 0).first().ok_or(not("a side has no length"))?;
            let disk = Disk::new(&cut.mesh.triangles, &cut_adjacency, faces, |h| barrier[h as usize], first)
                .ok_or(not("it has a hole or a handle"))?;
            let counts: [usize; 4] = std::array::from_fn(|k| side_edges(p, k).len());
            if counts.contains(&0) || counts.iter().sum::<usize>() != disk.boundary.len() {
                return Err(not("its sides do not close"));
            }
            let mut at = 0;
            let sides = counts.map(|n| {
                let side = (at..=at + n).map(|i| disk.boundary[i % disk.boundary.len()]).collect();
                at += n;
                side
            });
            Ok(patch_mesh(mesh, adjacency, &cut, &disk, sides))
        })
        .collect();
    Ok((made?, lost))
}

/// An error of chains with the numbers of their curves.
fn of_curve(error: ImprintError, chains: &[Chain]) -> ImprintError {
    let name = |c: usize| chains.get(c).map_or(c, |chain| chain.curve);
    match error {
        ImprintError::Jump { curve, x, y, z } => ImprintError::Jump { curve: name(curve), x, y, z },
        ImprintError::Crossing { curves, x, y, z } => {
            let mut curves: Vec<usize> = curves.into_iter().map(name).collect();
            curves.dedup();
            ImprintError::Crossing { curves, x, y, z }
        }
        other => other,
    }
}

/// A patch as a mesh of its own.
fn patch_mesh(mesh: &TriMesh, adjacency: &Adjacency, cut: &Cut, disk: &disk::Disk, sides: [Vec<u32>; 4]) -> PatchMesh {
    let face_origin: Vec<u32> = disk.faces.iter().map(|&f| cut.parent[f as usize]).collect();
    let mut origin = vec![FacePoint::corner(0, 0); disk.vertices.len()];
    for (triangle, &face) in disk.triangles.iter().zip(&face_origin) {
        for &v in triangle {
            let place = cut.origin[disk.vertices[v as usize] as usize];
            origin[v as usize] =
                place.on_face(adjacency, &mesh.triangles, face).expect("a corner lies on its own face");
        }
    }
    let points = disk.vertices.iter().map(|&v| cut.mesh.points[v as usize]).collect();
    PatchMesh { mesh: TriMesh::new(points, disk.triangles.clone()), origin, face_origin, sides }
}

/// Cuts `mesh` along `curves`.
/// # Errors
/// `Jump` where neighbouring places share no face, `Crossing` where two curves cross.
pub(crate) fn cut(mesh: &TriMesh, adjacency: &Adjacency, curves: &[&[Place]]) -> Result<Cut, ImprintError> {
    let mut points = mesh.points.clone();
    let mut origin: Vec<Place> = (0..points.len() as u32).map(Place::Vertex).collect();
    let mut marks = Marks::default();
    let Marks { on_edge, in_face, segments } = &mut marks;
    let mut chains = Vec::with_capacity(curves.len());
    for (c, curve) in curves.iter().enumerate() {
        let mut chain: Vec<u32> = Vec::with_capacity(curve.len());
        for place in curve.iter() {
            let mut add = |points: &mut Vec<DVec3>| {
                points.push(place.position(mesh));
                origin.push(*place);
                points.len() as u32 - 1
            };
            let v = match *place {
                Place::Vertex(v) => v,
                Place::Edge(h, t) => {
                    let list = on_edge.entry(h).or_default();
                    match list.iter().find(|x| x.0 == t) {
                        Some(&(_, v)) => v,
                        None => {
                            let v = add(&mut points);
                            list.push((t, v));
                            v
                        }
                    }
                }
                Place::Face(p) => {
                    let list = in_face.entry(p.face).or_default();
                    match list.iter().find(|x| x.0 == p) {
                        Some(&(_, v)) => v,
                        None => {
                            let v = add(&mut points);
                            list.push((p, v));
                            v
                        }
                    }
                }
            };
            chain.push(v);
        }
        for (i, pair) in curve.windows(2).enumerate() {
            match shared_face(adjacency, &mesh.triangles, &pair[0], &pair[1]) {
                Some(Shared::Face(f)) => {
                    segments.entry(f).or_default().push(Segment { ends: [chain[i], chain[i + 1]], curve: c })
                }
                Some(Shared::Edge) => {}
                None => {
                    let p = points[chain[i] as usize];
                    return Err(ImprintError::Jump { curve: c, x: p.x, y: p.y, z: p.z });
                }
            }
        }
        chains.push(chain);
    }
    for list in on_edge.values_mut() {
        list.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    let mut touched = vec![false; mesh.triangles.len()];
    for &h in on_edge.keys() {
        touched[h as usize / 3] = true;
        let o = adjacency.opposite[h as usize];
        if o != NONE {
            touched[o as usize / 3] = true;
        }
    }
    for &f in in_face.keys().chain(segments.keys()) {
        touched[f as usize] = true;
    }
    let split: Vec<u32> = (0..touched.len() as u32).filter(|&f| touched[f as usize]).collect();
    let pieces: Vec<Vec<[u32; 3]>> =
        split.par_iter().map(|&f| split_face(f, mesh, adjacency, &marks, &points)).collect::<Result<_, _>>()?;
    let mut triangles = Vec::with_capacity(mesh.triangles.len() + 3 * split.len());
    let mut parent = Vec::with_capacity(triangles.capacity());
    for f in (0..mesh.triangles.len()).filter(|&f| !touched[f]) {
        triangles.push(mesh.triangles[f]);
        parent.push(f as u32);
    }
    for (&f, piece) in split.iter().zip(&pieces) {
        triangles.extend_from_slice(piece);
        parent.extend(std::iter::repeat_n(f, piece.len()));
    }
    Ok(Cut { mesh: TriMesh::new(points, triangles), origin, parent, chains })
}

/// A piece of a curve across one face.
#[derive(Clone, Copy, Debug)]
struct Segment {
    ends: [u32; 2],
    curve: usize,
}

/// What curves leave on a mesh: new vertices on edges, by the lower half-edge and in order along it, those in faces, and
/// pieces of curves across faces.
#[derive(Default)]
struct Marks {
    on_edge: HashMap<u32, Vec<(f64, u32)>>,
    in_face: HashMap<u32, Vec<(FacePoint, u32)>>,
    segments: HashMap<u32, Vec<Segment>>,
}

/// The place `t` of the way along side `k` of a face in its flat picture, where the sides bulge.
fn on_side(k: usize, t: f64) -> Point2<f64> {
    const CORNERS: [[f64; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    const OUT: [[f64; 2]; 3] = [[0.0, -1.0], [1.0, 1.0], [-1.0, 0.0]];
    let (a, b) = (CORNERS[k], CORNERS[(k + 1) % 3]);
    let bulge = BULGE * t * (1.0 - t);
    Point2::new(a[0] + (b[0] - a[0]) * t + OUT[k][0] * bulge, a[1] + (b[1] - a[1]) * t + OUT[k][1] * bulge)
}

impl Cut {
    /// A place of the cut mesh as one of the uncut mesh, by its weights in a face of the cut mesh: the same, bit for
    /// bit, from all faces that it lies on. What does not cross on the cut mesh does not cross on the uncut one either:
    /// inside a face places go by the flat picture, in which its pieces lie side by side.
    pub fn to_uncut(&self, adjacency: &Adjacency, triangles: &[[u32; 3]], face: u32, bary: [f64; 3]) -> FacePoint {
        let corners = self.mesh.triangles[face as usize];
        let mut on: Vec<(u32, f64)> = (0..3).filter(|&k| bary[k] != 0.0).map(|k| (corners[k], bary[k])).collect();
        on.sort_unstable_by_key(|x| x.0);
        let origin = |v: u32| self.origin[v as usize];
        let edge = match on[..] {
            [(v, _)] => Some(origin(v)),
            [(a, x), (b, y)] => along_edge(adjacency, triangles, &origin(a), &origin(b), y / (x + y)),
            _ => None,
        };
        if let Some(place) = edge {
            let on = place.on_face(adjacency, triangles, place.some_face(adjacency));
            return on.expect("a place lies on its own face");
        }
        let parent = self.parent[face as usize];
        let (mut sum, mut total) = ([0.0; 2], 0.0);
        for (v, weight) in on {
            let at = origin(v).on_face(adjacency, triangles, parent).expect("a corner lies on the uncut face");
            let at = match (0..3).find(|&k| at.bary[k] == 0.0) {
                Some(k) => on_side((k + 1) % 3, at.bary[(k + 2) % 3]),
                None => Point2::new(at.bary[1], at.bary[2]),
            };
            sum = [sum[0] + weight * at.x, sum[1] + weight * at.y];
            total += weight;
        }
        // Beside a side that bulges it may lie beyond it, or be taken for a place on it.
        let [x, y] = sum.map(|s| (s / total).max(2.0 * ON_EDGE));
        let room = ((1.0 - 2.0 * ON_EDGE) / (x + y)).min(1.0);
        let [x, y] = [x * room, y * room];
        FacePoint { face: parent, bary: [1.0 - x - y, x, y] }
    }
}

/// Triangulates one face with its new vertices and curve pieces.
fn split_face(
    f: u32,
    mesh: &TriMesh,
    adjacency: &Adjacency,
    marks: &Marks,
    points: &[DVec3],
) -> Result<Vec<[u32; 3]>, ImprintError> {
    // Vertices with their places in the flat picture; those of the boundary, in order; and the sides that each lies on.
    let (mut names, mut flat, mut ring, mut sides) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for k in 0..3 {
        ring.push(names.len());
        names.push(mesh.triangles[f as usize][k]);
        flat.push(on_side(k, 0.0));
        sides.push(1u8 << k | 1 << ((k + 2) % 3));
        let h = 3 * f + k as u32;
        let o = adjacency.opposite[h as usize];
        let mine = marks.on_edge.get(&if o < h { o } else { h }).map_or(&[][..], |l| &l[..]);
        let first = ring.len();
        for &(t, v) in mine {
            ring.push(names.len());
            names.push(v);
            flat.push(on_side(k, if o < h { 1.0 - t } else { t }));
            sides.push(1 << k);
        }
        if o < h {
            ring[first..].reverse();
        }
    }
    for (p, v) in marks.in_face.get(&f).map_or(&[][..], |l| &l[..]) {
        names.push(*v);
        flat.push(Point2::new(p.bary[1], p.bary[2]));
    }
    let pieces = marks.segments.get(&f).map_or(&[][..], |l| &l[..]);
    let crossing = |v: u32| {
        let p = points[v as usize];
        let mut curves: Vec<usize> = pieces.iter().map(|s| s.curve).collect();
        curves.dedup();
        ImprintError::Crossing { curves, x: p.x, y: p.y, z: p.z }
    };
    let mut cdt = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    let mut handles = Vec::with_capacity(flat.len());
    let mut owner = Vec::with_capacity(flat.len());
    for (p, &v) in flat.iter().zip(&names) {
        let handle = cdt.insert(*p).map_err(|_| crossing(v))?;
        if handle.index() != owner.len() {
            return Err(crossing(v)); // two points of one place
        }
        owner.push(v);
        handles.push((v, handle));
    }
    handles.sort_by_key(|x| x.0);
    let handle_of = |v: u32| handles[handles.binary_search_by_key(&v, |x| x.0).expect("a point of the face")].1;
    for &Segment { ends: [a, b], .. } in pieces {
        let (x, y) = (handle_of(a), handle_of(b));
        if cdt.try_add_constraint(x, y).is_empty() && !cdt.exists_constraint(x, y) {
            return Err(crossing(a));
        }
    }
    sides.resize(names.len(), 0);
    let triangles = |cdt: &ConstrainedDelaunayTriangulation<Point2<f64>>| -> Vec<[usize; 3]> {
        cdt.inner_faces().map(|t| t.vertices().map(|v| v.index())).collect()
    };
    let mut made = triangles(&cdt);
    if !is_within(&made, &ring, names.len()) {
        // Points of a side lie so near each other that rounding takes its bulge away.
        for (k, &a) in ring.iter().enumerate() {
            let [x, y] = [a, ring[(k + 1) % ring.len()]].map(|i| handle_of(names[i]));
            if cdt.try_add_constraint(x, y).is_empty() && !cdt.exists_constraint(x, y) {
                return Err(crossing(names[a]));
            }
        }
        made = within(triangles(&cdt), &ring);
        if !is_within(&made, &ring, names.len()) {
            return Err(crossing(names[ring[0]]));
        }
    }
    flip_flat(&mut made, &sides);
    Ok(made.into_iter().map(|t| t.map(|i| owner[i])).collect())
}

fn edges(t: &[usize; 3]) -> [[usize; 2]; 3] {
    [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]
}

fn rim(ring: &[usize]) -> impl Iterator<Item = [usize; 2]> {
    (0..ring.len()).map(|k| [ring[k], ring[(k + 1) % ring.len()]])
}

/// True if triangles over `points` points fill what is inside `ring`, and that alone: their number is that of Euler's
/// formula, and all edges of the ring are theirs.
fn is_within(triangles: &[[usize; 3]], ring: &[usize], points: usize) -> bool {
    triangles.len() + ring.len() + 2 == 2 * points && rim(ring).all(|e| triangles.iter().any(|t| edges(t).contains(&e)))
}

/// The triangles inside `ring`, given all inside its convex hull.
fn within(mut triangles: Vec<[usize; 3]>, ring: &[usize]) -> Vec<[usize; 3]> {
    let rim: HashSet<[usize; 2]> = rim(ring).collect();
    loop {
        let there: HashSet<[usize; 2]> = triangles.iter().flat_map(edges).collect();
        let count = triangles.len();
        triangles.retain(|t| edges(t).iter().all(|e| rim.contains(e) || there.contains(&[e[1], e[0]])));
        if triangles.len() == count {
            return triangles;
        }
    }
}

/// Flips away triangles between three points of one side: their long edges run beside the side, and the face across it
/// may have the same.
fn flip_flat(triangles: &mut [[usize; 3]], sides: &[u8]) {
    let flat = |t: &[usize; 3]| sides[t[0]] & sides[t[1]] & sides[t[2]] != 0;
    loop {
        let found = (0..triangles.len()).filter(|&i| flat(&triangles[i])).find_map(|i| {
            let t = triangles[i];
            (0..3).find_map(|k| {
                let (a, b, c) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
                let across = |u: &[usize; 3]| edges(u).iter().position(|e| *e == [b, a]);
                let j = triangles.iter().position(|u| !flat(u) && across(u).is_some())?;
                let d = triangles[j][(across(&triangles[j])? + 2) % 3];
                Some((i, j, [d, b, c], [c, a, d]))
            })
        });
        let Some((i, j, first, second)) = found else { return };
        (triangles[i], triangles[j]) = (first, second);
    }
}

/// Names the faces of a cut mesh: `seeds` are `(chain edge start, chain edge end, name)`, the face to the left
/// of that edge bears the name. Returns for each face its name or [`NONE`].
/// # Errors
/// The pair of names that met in one part.
pub(crate) fn flood(
    cut: &Cut,
    adjacency: &Adjacency,
    barrier: &[bool],
    seeds: &[(u32, u32)],
) -> Result<Vec<u32>, (u32, u32)> {
    let mut name = vec![NONE; cut.mesh.triangles.len()];
    let mut stack = Vec::new();
    for &(h, label) in seeds {
        let f = h / 3;
        if name[f as usize] == label {
            continue;
        }
        if name[f as usize] != NONE {
            return Err((name[f as usize], label));
        }
        name[f as usize] = label;
        stack.push(f);
        while let Some(f) = stack.pop() {
            for g in 3 * f..3 * f + 3 {
                let o = adjacency.opposite[g as usize];
                if barrier[g as usize] || o == NONE {
                    continue;
                }
                match name[o as usize / 3] {
                    NONE => {
                        name[o as usize / 3] = label;
                        stack.push(o / 3);
                    }
                    other if other != label => return Err((other, label)),
                    _ => {}
                }
            }
        }
    }
    Ok(name)
}

/// The half-edge of `adjacency` from vertex `a` to vertex `b`.
pub(crate) fn half_edge(triangles: &[[u32; 3]], adjacency: &Adjacency, a: u32, b: u32) -> Option<u32> {
    adjacency.fan(a).find(|&h| triangles[h as usize / 3][next(h) as usize % 3] == b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::shapes;

    /// Half-edges without another face.
    fn free(mesh: &TriMesh) -> usize {
        Adjacency::new(mesh).opposite.iter().filter(|&&o| o == NONE).count()
    }

    #[test]
    fn points_of_a_side_1e_9_or_less_apart_leave_no_gap_between_its_faces() {
        let mesh = shapes::rectangle(1.0, 1.0, 1, 1);
        let adjacency = Adjacency::new(&mesh);
        let h = (0..6).find(|&h| adjacency.opposite[h as usize] > h && adjacency.opposite[h as usize] != NONE).unwrap();
        let apex = mesh.origin(crate::mesh::previous(h));
        for k in 0..300 {
            let first = 0.003 * k as f64 + 1e-9;
            for gap in [1e-9, 1e-12] {
                let curves: Vec<Vec<Place>> =
                    (0..5).map(|i| vec![Place::Vertex(apex), Place::Edge(h, first + gap * i as f64)]).collect();
                let borrowed: Vec<&[Place]> = curves.iter().map(|c| &c[..]).collect();
                let cut = cut(&mesh, &adjacency, &borrowed).unwrap();
                assert_eq!(free(&cut.mesh), 4, "{first} {gap}");
            }
        }
    }

    #[test]
    fn a_place_of_the_cut_mesh_is_the_same_bits_of_the_uncut_one_from_all_its_faces() {
        let mesh = shapes::sphere(1.0, 2);
        let adjacency = Adjacency::new(&mesh);
        let curve = |seed: u32| -> Vec<Place> {
            let from = FacePoint { face: seed, bary: [0.21, 0.33, 0.46] };
            let to = FacePoint { face: (seed * 37 + 151) % mesh.triangles.len() as u32, bary: [0.6, 0.3, 0.1] };
            let way = crate::curve::connect(&mesh, &adjacency, from, to).unwrap();
            way.iter().map(|p| place_of(&adjacency, &mesh.triangles, p)).collect()
        };
        let mut looked = 0;
        for seed in 0..60 {
            let curve = curve(seed);
            let cut = cut(&mesh, &adjacency, &[&curve]).unwrap();
            let own = Adjacency::new(&cut.mesh);
            let to_uncut = |face, bary| cut.to_uncut(&adjacency, &mesh.triangles, face, bary);
            for h in 0..own.opposite.len() as u32 {
                let (o, mut a, mut b) = (own.opposite[h as usize], [0.0; 3], [0.0; 3]);
                (a[h as usize % 3], a[next(h) as usize % 3]) = (0.75, 0.25);
                (b[next(o) as usize % 3], b[o as usize % 3]) = (0.75, 0.25);
                assert_eq!(to_uncut(h / 3, a), to_uncut(o / 3, b));
                let corner = FacePoint::corner(h / 3, h as usize % 3);
                let there = FacePoint::corner(o / 3, next(o) as usize % 3);
                let place = to_uncut(h / 3, corner.bary);
                assert_eq!(place, to_uncut(o / 3, there.bary));
                // And it is the place that was cut.
                let origin = cut.origin[cut.mesh.triangles[h as usize / 3][h as usize % 3] as usize];
                assert_eq!(place_of(&adjacency, &mesh.triangles, &place), origin);
                looked += 1;
            }
        }
        assert!(looked > 50_000);
    }
}
