//! Networks mirrored across a plane of symmetry, and carried from one shape to another.

use super::{ApplyError, Ground};
use crate::curve::carry::{LandmarkMap, carry_curve, carry_place};
use crate::curve::symmetry::Plane;
use crate::curve::{SurfaceCurve, between, connect, slide_to};
use crate::mesh::{FacePoint, TriMesh, sharp_edges};
use crate::network::{Corner, Curve, CurveKind, Network};
use crate::observe::Observer;

/// A corner nearer to the plane than this share of the diagonal lies on it.
pub(super) const ON_PLANE: f64 = 2e-3;

/// What became of the curves of a network that was mirrored.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Images {
    /// For each curve of the network before its number now; nothing if it lay behind the plane.
    pub number: Vec<Option<u32>>,
    /// For each curve now its image; curves in the plane and those that cross it are their own.
    pub image: Vec<u32>,
}

impl Images {
    /// The number now of a curve of the network before.
    pub fn kept(&self, curve: u32) -> Option<u32> {
        self.number.get(curve as usize).copied().flatten()
    }
}

/// The part of an open curve before `plane`, and from the plane on its image; nothing unless it crosses the plane once.
pub(super) fn across(ground: &Ground, curve: &SurfaceCurve, plane: &Plane) -> Option<SurfaceCurve> {
    let (mesh, adjacency, bvh) = (ground.canvas.mesh, &ground.canvas.adjacency, &ground.bvh);
    let heights: Vec<f64> = curve.points.iter().map(|p| plane.height(p.position(mesh))).collect();
    let signs: Vec<usize> = (1..heights.len()).filter(|&k| (heights[k - 1] > 0.0) != (heights[k] > 0.0)).collect();
    let [at] = signs[..] else { return None };
    let share = heights[at - 1] / (heights[at - 1] - heights[at]);
    let middle = between(mesh, adjacency, &curve.points[at - 1], &curve.points[at], share);
    let mut half = if heights[0] > 0.0 { curve.points[..at].to_vec() } else { curve.points[at..].to_vec() };
    if heights[0] <= 0.0 {
        half.reverse();
    }
    let images: Vec<FacePoint> = half.iter().rev().map(|p| plane.mirror_place(mesh, bvh, p)).collect();
    half.push(middle);
    half.extend(images);
    if heights[0] <= 0.0 {
        half.reverse();
    }
    SurfaceCurve::open(half).trace(mesh, adjacency).ok().map(SurfaceCurve::open)
}

/// The curves before `plane` (on the side of its normal) and in it, and their mirror images; curves behind it go. A
/// curve that crosses the plane goes on behind it as its own image; corners near the plane are moved into it.
/// # Errors
/// `AcrossPlane` for a curve that crosses the plane more than once; `Curve` if an image cannot be drawn.
pub fn mirror_network(ground: &Ground, network: &Network, plane: &Plane) -> Result<(Network, Images), ApplyError> {
    let (mesh, adjacency, bvh) = (ground.canvas.mesh, &ground.canvas.adjacency, &ground.bvh);
    let near = ON_PLANE * mesh.bounds().diagonal();
    let height = |p: &FacePoint| plane.height(p.position(mesh));
    let mut out = Network::default();
    let mut images = Images { number: vec![None; network.curves.len()], image: Vec::new() };
    // Old corner -> its number before the plane, and that of its image.
    let mut numbers: Vec<Option<[u32; 2]>> = vec![None; network.corners.len()];
    let mut kept = Vec::new();
    for (c, curve) in network.curves.iter().enumerate() {
        let tops =
            curve.points.iter().map(height).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        if tops.1 < near && tops.0 < -near {
            continue;
        }
        let crosses = tops.0 < -near;
        let mut ends = curve.corners.to_vec();
        if crosses {
            let last = curve.points.len() - 1;
            let worst = curve.points.iter().rev().min_by(|a, b| height(a).abs().total_cmp(&height(b).abs()));
            let place = worst.map_or([0.0; 3], |p| p.position(mesh).to_array());
            let open = SurfaceCurve::open(curve.points.clone());
            let heights = [0, last].map(|k| height(&curve.points[k]));
            let whole = match heights.map(|h| h.abs() > near) {
                [true, true] if heights[0] * heights[1] < 0.0 => across(ground, &open, plane),
                _ => None,
            };
            let Some(whole) = whole else { return Err(ApplyError::AcrossPlane { curve: c, place }) };
            // Only the corner before the plane counts; the other one becomes its image.
            ends = vec![curve.corners[(heights[0] < 0.0) as usize]];
            kept.push((c, whole.points, Kind::Across { from_start: heights[0] > 0.0 }));
        } else {
            let kind = if tops.1 <= near { Kind::InPlane } else { Kind::Before };
            kept.push((c, curve.points.clone(), kind));
        }
        for k in ends {
            if numbers[k as usize].is_some() {
                continue;
            }
            let place = network.corners[k as usize].place;
            let first = out.corners.len() as u32;
            if height(&place).abs() <= near {
                let p = place.position(mesh);
                let foot = slide_to(mesh, adjacency, place, p - plane.normal * plane.height(p));
                out.corners.push(Corner { place: foot });
                numbers[k as usize] = Some([first; 2]);
            } else {
                out.corners.push(Corner { place });
                out.corners.push(Corner { place: plane.mirror_place(mesh, bvh, &place) });
                numbers[k as usize] = Some([first, first + 1]);
            }
        }
    }
    for (c, points, kind) in kept {
        let curve = &network.curves[c];
        let number = |k: u32, image: usize| numbers[k as usize].map_or(0, |n| n[image]);
        let first = out.curves.len() as u32;
        images.number[c] = Some(first);
        match kind {
            Kind::Before => images.image.extend([first + 1, first]),
            Kind::InPlane | Kind::Across { .. } => images.image.push(first),
        }
        for image in 0..=matches!(kind, Kind::Before) as usize {
            let corners = match kind {
                Kind::Across { from_start: true } => [0, 1].map(|image| number(curve.corners[0], image)),
                Kind::Across { from_start: false } => [1, 0].map(|image| number(curve.corners[1], image)),
                _ => curve.corners.map(|k| number(k, image)),
            };
            let mut places: Vec<FacePoint> = match image {
                0 => points.clone(),
                _ => points.iter().map(|p| plane.mirror_place(mesh, bvh, p)).collect(),
            };
            let last = places.len() - 1;
            places[0] = out.corners[corners[0] as usize].place;
            places[last] = out.corners[corners[1] as usize].place;
            let points = SurfaceCurve::open(places).trace(mesh, adjacency)?;
            out.curves.push(Curve { corners, kind: curve.kind, points });
        }
    }
    Ok((out, images))
}

/// How a curve lies to the plane.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Before,
    InPlane,
    /// It crosses the plane; from its start on it lies before it, or behind it.
    Across {
        from_start: bool,
    },
}

/// Sharp edges of the mesh for a curve carried to one, degrees.
const SHARP_DEG: f64 = 40.0;

/// Carries a network of another mesh of the same class of shapes over: corners to the nearest places of where the map
/// takes them, curves relaxed between them. Lines along sharp edges and boundaries are carried as smooth curves where
/// the mesh has none there.
/// # Errors
/// `Curve` if a curve cannot be drawn; `Cancelled`.
pub fn carry_network(
    map: &LandmarkMap,
    from: &TriMesh,
    network: &Network,
    ground: &Ground,
    observer: &dyn Observer,
) -> Result<Network, ApplyError> {
    let (mesh, adjacency, bvh) = (ground.canvas.mesh, &ground.canvas.adjacency, &ground.bvh);
    let mut out = Network { patches: network.patches.clone(), ..Network::default() };
    out.corners = network.corners.iter().map(|c| Corner { place: carry_place(map, from, bvh, &c.place) }).collect();
    let sharp = sharp_edges(mesh, adjacency, SHARP_DEG);
    for (k, curve) in network.curves.iter().enumerate() {
        if observer.cancelled() {
            return Err(ApplyError::Cancelled);
        }
        observer.progress(k as f64 / network.curves.len() as f64);
        let ends = curve.corners.map(|c| out.corners[c as usize].place);
        let open = SurfaceCurve::open(curve.points.clone());
        let even = open.resampled(from, &crate::mesh::Adjacency::new(from), curve.points.len().clamp(9, 400))?;
        let carried = carry_curve(map, from, (mesh, adjacency, bvh), &even, Some(ends), observer)?;
        let points = carried.trace(mesh, adjacency)?;
        let on_edges = points.windows(2).all(|w| {
            let way = connect(mesh, adjacency, w[0], w[1]);
            way.is_ok_and(|_| (0..3).any(|k| w[0].bary[k] == 0.0 && sharp[3 * w[0].face as usize + (k + 1) % 3]))
        });
        let kind = if on_edges { curve.kind } else { CurveKind::Smooth };
        out.curves.push(Curve { corners: curve.corners, kind, points });
    }
    Ok(out)
}
