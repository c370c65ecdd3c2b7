//! Feature curves brought onto the mesh of their patch: places found again on cut triangles, ends led to the sides,
//! curves of one family cut in together.
//!
//! See `docs/methods/curves.md`, "Feature curves"; [K98] §5.10.1 paints them on the patch.

use super::{Family, FeatureCurve, FeatureError};
use crate::curve::SurfaceCurve;
use crate::geom::tolerance;
use crate::grid::side;
use crate::mesh::{Adjacency, FacePoint, TriMesh, next};
use crate::network::imprint::{self, Place};
use crate::network::{ImprintError, PatchMesh};
use glam::DVec3;
use std::collections::BTreeMap;

/// The feature curves of one patch on its mesh.
pub(crate) struct Strands {
    /// Adjacency of the patch mesh.
    pub adjacency: Adjacency,
    pub list: Vec<Strand>,
    /// The v curves from low to high u, and the u curves from low to high v.
    pub across: Vec<usize>,
    pub along: Vec<usize>,
}

impl Strands {
    pub fn new(input: &TriMesh, patch: &PatchMesh, curves: &[FeatureCurve]) -> Result<Strands, FeatureError> {
        let adjacency = Adjacency::new(&patch.mesh);
        let pieces = Pieces::new(&patch.face_origin);
        let list = (curves.iter().enumerate())
            .map(|(k, curve)| strand(input, patch, &adjacency, &pieces, k, curve))
            .collect::<Result<Vec<_>, _>>()?;
        let sorted = |family: Family| {
            let mut own: Vec<usize> = (0..curves.len()).filter(|&k| curves[k].family == family).collect();
            own.sort_by(|&a, &b| list[a].shares[0].total_cmp(&list[b].shares[0]).then(a.cmp(&b)));
            own
        };
        let (across, along) = (sorted(Family::V), sorted(Family::U));
        Ok(Strands { adjacency, list, across, along })
    }

    pub fn mean_share(&self, k: usize) -> f64 {
        (self.list[k].shares[0] + self.list[k].shares[1]) / 2.0
    }

    /// Stops that the curves put into side `k`, in its direction.
    pub fn stops(&self, k: usize, cells: &[Vec<usize>; 2]) -> side::Stops {
        let (own, cells) = if k.is_multiple_of(2) { (&self.across, &cells[0]) } else { (&self.along, &cells[1]) };
        let total: usize = cells.iter().sum();
        // The low ends of v curves lie on side 0, those of u curves on side 3.
        let end = if matches!(k, 0 | 3) { 0 } else { 1 };
        let mut node = 0;
        let rising: side::Stops = (own.iter().zip(cells))
            .map(|(&c, n)| {
                node += n;
                (side::stop_share(self.list[c].shares[end]), node)
            })
            .collect();
        if k >= 2 { side::turned(&rising, total + 1) } else { rising }
    }
}

/// A feature curve on the patch mesh.
pub(crate) struct Strand {
    pub points: Vec<FacePoint>,
    /// Shares of the lengths of its two sides, each counted from the low end of the other parameter.
    shares: [f64; 2],
}

impl Strand {
    pub fn places(&self, mesh: &TriMesh, adjacency: &Adjacency) -> Vec<Place> {
        self.points.iter().map(|p| imprint::place_of(adjacency, &mesh.triangles, p)).collect()
    }
}

/// Brings a curve onto the patch mesh and leads its ends to their sides.
fn strand(
    input: &TriMesh,
    patch: &PatchMesh,
    adjacency: &Adjacency,
    pieces: &Pieces,
    index: usize,
    curve: &FeatureCurve,
) -> Result<Strand, FeatureError> {
    let outside = FeatureError::Outside { curve: index };
    let mesh = &patch.mesh;
    let on_rim = |p: &FacePoint| match imprint::place_of(adjacency, &mesh.triangles, p) {
        Place::Vertex(v) => adjacency.is_boundary_vertex(v),
        Place::Edge(h, _) => adjacency.opposite[h as usize] == crate::mesh::NONE,
        Place::Face(_) => false,
    };
    let mut inner: Vec<FacePoint> =
        curve.points.iter().filter_map(|p| pieces.in_patch(input, patch, p)).filter(|p| !on_rim(p)).collect();
    if inner.is_empty() {
        return Err(outside);
    }
    let sides = if curve.family == Family::V { [0, 2] } else { [3, 1] };
    let ends = [inner[0], inner[inner.len() - 1]].map(|p| p.position(mesh));
    let away = |side: usize, p: DVec3| nearest_on_side(patch, side, p).2;
    if away(sides[0], ends[0]) + away(sides[1], ends[1]) > away(sides[0], ends[1]) + away(sides[1], ends[0]) {
        inner.reverse();
    }
    let ends = [inner[0], inner[inner.len() - 1]].map(|p| p.position(mesh));
    let mut shares = [0.0; 2];
    let mut places = Vec::with_capacity(inner.len() + 2);
    for e in 0..2 {
        let (place, share, _) = nearest_on_side(patch, sides[e], ends[e]);
        if !(share > 0.0 && share < 1.0) {
            return Err(FeatureError::AtCorner { curve: index });
        }
        // Sides 2 and 3 run against their parameter.
        shares[e] = if sides[e] >= 2 { 1.0 - share } else { share };
        let h = adjacency.outgoing[patch.sides[sides[e]][place.0] as usize];
        let mut bary = [0.0; 3];
        bary[h as usize % 3] = 1.0 - place.1;
        bary[next(h) as usize % 3] = place.1;
        let end = FacePoint { face: h / 3, bary };
        if e == 0 {
            places.push(end);
            places.append(&mut inner);
        } else {
            places.push(end);
        }
    }
    let points = SurfaceCurve::open(places).trace(mesh, adjacency).map_err(|_| outside.clone())?;
    if points.len() < 3 && points.iter().all(on_rim) || points[1..points.len() - 1].iter().any(on_rim) {
        return Err(outside);
    }
    Ok(Strand { points, shares })
}

/// Nearest place of a side: segment and share of it, share of the side's length, distance.
fn nearest_on_side(patch: &PatchMesh, side: usize, p: DVec3) -> ((usize, f64), f64, f64) {
    let at: Vec<DVec3> = patch.sides[side].iter().map(|&v| patch.mesh.points[v as usize]).collect();
    let (mut best, mut sum) = (((0, 0.0), 0.0, f64::INFINITY), 0.0);
    for (k, w) in at.windows(2).enumerate() {
        let d = w[1] - w[0];
        let square = d.length_squared();
        let s = if square > 0.0 { ((p - w[0]).dot(d) / square).clamp(0.0, 1.0) } else { 0.0 };
        let away = p.distance(w[0] + d * s);
        if away < best.2 {
            // The start of a segment is the end of the one before it.
            best = ((k, s), sum + d.length() * s, away);
        }
        sum += d.length();
    }
    (best.0, best.1 / sum.max(f64::MIN_POSITIVE), best.2)
}

/// Cuts along curves of one family; they must not meet.
pub(crate) fn cut_family(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    chains: &[Vec<Place>],
    names: &[usize],
) -> Result<imprint::Cut, FeatureError> {
    let borrowed: Vec<&[Place]> = chains.iter().map(|c| &c[..]).collect();
    let cut = imprint::cut(mesh, adjacency, &borrowed).map_err(|e| match e {
        ImprintError::Crossing { ref curves, x, y, z } if curves.len() > 1 => {
            let mut two: Vec<usize> = curves.iter().map(|&c| names[c]).collect();
            two.sort_unstable();
            two.dedup();
            match two[..] {
                [a, b, ..] => FeatureError::Cross { a, b, place: DVec3::new(x, y, z) },
                _ => e.into(),
            }
        }
        other => other.into(),
    })?;
    let mut owner: BTreeMap<u32, usize> = BTreeMap::new();
    for (c, chain) in cut.chains.iter().enumerate() {
        for &v in chain {
            if let Some(&other) = owner.get(&v)
                && other != c
            {
                let (a, b) = (names[other].min(names[c]), names[other].max(names[c]));
                return Err(FeatureError::Cross { a, b, place: cut.mesh.points[v as usize] });
            }
            owner.insert(v, c);
        }
    }
    Ok(cut)
}

/// Triangles by the face that they are a part of.
pub(crate) struct Pieces {
    of: BTreeMap<u32, Vec<u32>>,
}

impl Pieces {
    pub fn new(parent: &[u32]) -> Pieces {
        let mut of: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for (t, &f) in parent.iter().enumerate() {
            of.entry(f).or_default().push(t as u32);
        }
        Pieces { of }
    }

    /// A place of the input on the patch mesh, if it is there.
    fn in_patch(&self, input: &TriMesh, patch: &PatchMesh, p: &FacePoint) -> Option<FacePoint> {
        // A place of an edge or vertex may be named on a face that the patch does not have.
        self.best(p.face, |t| {
            let corners = patch.mesh.triangles[t as usize]
                .map(|v| patch.origin[v as usize].weights_on(input, patch.face_origin[t as usize]));
            inside(corners, p.bary)
        })
    }

    /// A place of the uncut mesh on the cut one.
    pub fn place(&self, cut: &imprint::Cut, mesh: &TriMesh, adjacency: &Adjacency, p: &FacePoint) -> Option<FacePoint> {
        self.best(p.face, |t| {
            let corners = cut.mesh.triangles[t as usize].map(|v| {
                cut.origin[v as usize].on_face(adjacency, &mesh.triangles, p.face).map_or([0.0; 3], |q| q.bary)
            });
            inside(corners, p.bary)
        })
    }

    /// The place on that part of a face which holds it best by its `weights`, if it is there.
    fn best(&self, face: u32, weights: impl Fn(u32) -> [f64; 3]) -> Option<FacePoint> {
        let own = self.of.get(&face).into_iter().flatten().copied();
        own.map(|t| (t, weights(t)))
            .max_by(|a, b| least(&a.1).total_cmp(&least(&b.1)).then(b.0.cmp(&a.0)))
            .filter(|(_, w)| least(w) > -SLACK)
            .map(|(face, w)| FacePoint { face, bary: snapped(w) })
    }
}

/// Weights this far below zero are rounding: the place is on the edge.
const SLACK: f64 = 1e-7;

fn least(w: &[f64; 3]) -> f64 {
    w[0].min(w[1]).min(w[2])
}

/// Weights without rounding below zero, and exactly zero where they are next to it.
fn snapped(w: [f64; 3]) -> [f64; 3] {
    let w = w.map(|x| if x < tolerance::RELATIVE.sqrt() { 0.0 } else { x });
    let sum: f64 = w.iter().sum();
    w.map(|x| x / sum)
}

/// Barycentric coordinates of `p` in the triangle `corners`, all in the coordinates of one face; far outside for a
/// triangle without area.
fn inside(corners: [[f64; 3]; 3], p: [f64; 3]) -> [f64; 3] {
    let flat = |w: [f64; 3]| glam::DVec2::new(w[1], w[2]);
    let [a, b, c] = corners.map(flat);
    let q = flat(p);
    let area = (b - a).perp_dot(c - a);
    if area == 0.0 {
        return [-1.0; 3];
    }
    [(c - b).perp_dot(q - b) / area, (a - c).perp_dot(q - c) / area, (b - a).perp_dot(q - a) / area]
}

/// A place of the cut mesh on the uncut one.
pub(crate) fn to_patch(cut: &imprint::Cut, mesh: &TriMesh, adjacency: &Adjacency, p: &FacePoint) -> FacePoint {
    let parent = cut.parent[p.face as usize];
    let mut bary = [0.0; 3];
    for (k, &v) in cut.mesh.triangles[p.face as usize].iter().enumerate() {
        if let Some(q) = cut.origin[v as usize].on_face(adjacency, &mesh.triangles, parent) {
            (0..3).for_each(|i| bary[i] += p.bary[k] * q.bary[i]);
        }
    }
    normal(parent, bary)
}

/// A place of the patch mesh on the input.
pub(crate) fn to_input(input: &TriMesh, patch: &PatchMesh, p: &FacePoint) -> FacePoint {
    let face = patch.face_origin[p.face as usize];
    let mut bary = [0.0; 3];
    for (k, &v) in patch.mesh.triangles[p.face as usize].iter().enumerate() {
        let w = patch.origin[v as usize].weights_on(input, face);
        (0..3).for_each(|i| bary[i] += p.bary[k] * w[i]);
    }
    normal(face, bary)
}

fn normal(face: u32, bary: [f64; 3]) -> FacePoint {
    let sum: f64 = bary.iter().sum();
    FacePoint { face, bary: bary.map(|b| b / sum) }
}
