//! Replaces one side of a plane of symmetry by the image of the other.
//!
//! See `docs/methods/curves.md`, "Mirroring".

use crate::curve::symmetry::Plane;
use crate::curve::{SurfaceCurve, between, slide_to};
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, Ground, Images};
use crate::mesh::FacePoint;
use crate::network::{Corner, Curve, Network};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Replaces the curves, feature curves and sections behind the plane of symmetry by mirror images of those before it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mirror {
    /// True for the other way round.
    #[serde(default)]
    pub swap: bool,
}

impl Command for Mirror {
    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let mut plane = work.drawing.sketch.symmetry.ok_or(ApplyError::NoPlane)?;
        if self.swap {
            plane.normal = -plane.normal;
        }
        let (network, images) = mirror_network(work.ground, &work.drawing.network, &plane)?;
        work.drawing.network = network;
        work.images = Some((plane, images));
        Ok(())
    }
}

/// A corner nearer to the plane than this share of the diagonal lies on it.
pub(in crate::edit) const ON_PLANE: f64 = 2e-3;

/// The part of an open curve before `plane`, and from the plane on its image; nothing unless it crosses the plane once.
pub(in crate::edit) fn across(ground: &Ground, curve: &SurfaceCurve, plane: &Plane) -> Option<SurfaceCurve> {
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
    let kept = before_plane(ground, network, plane)?;
    let mut out = Network::default();
    let numbers = mirror_corners(ground, network, plane, &kept, &mut out);
    let mut images = Images { number: vec![None; network.curves.len()], image: Vec::new() };
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

/// The curves that stay, with their points and how they lie; those that cross the plane are whole again, their part
/// behind it the image of that before it.
fn before_plane(
    ground: &Ground,
    network: &Network,
    plane: &Plane,
) -> Result<Vec<(usize, Vec<FacePoint>, Kind)>, ApplyError> {
    let mesh = ground.canvas.mesh;
    let near = ON_PLANE * mesh.bounds().diagonal();
    let height = |p: &FacePoint| plane.height(p.position(mesh));
    let mut kept = Vec::new();
    for (c, curve) in network.curves.iter().enumerate() {
        let (low, high) =
            curve.points.iter().map(height).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        if low >= -near {
            let kind = if high <= near { Kind::InPlane } else { Kind::Before };
            kept.push((c, curve.points.clone(), kind));
        } else if high >= near {
            let heights = [0, curve.points.len() - 1].map(|k| height(&curve.points[k]));
            let whole = match heights.map(|h| h.abs() > near) {
                [true, true] if heights[0] * heights[1] < 0.0 => {
                    across(ground, &SurfaceCurve::open(curve.points.clone()), plane)
                }
                _ => None,
            };
            let Some(whole) = whole else {
                let last = curve.points.iter().rev().min_by(|a, b| height(a).abs().total_cmp(&height(b).abs()));
                let place = last.map_or([0.0; 3], |p| p.position(mesh).to_array());
                return Err(ApplyError::AcrossPlane { curve: c, place });
            };
            kept.push((c, whole.points, Kind::Across { from_start: heights[0] > 0.0 }));
        }
    }
    Ok(kept)
}

/// Adds the corners of curves that stay and their images; tells for each corner its number before the plane and that
/// of its image.
fn mirror_corners(
    ground: &Ground,
    network: &Network,
    plane: &Plane,
    kept: &[(usize, Vec<FacePoint>, Kind)],
    out: &mut Network,
) -> Vec<Option<[u32; 2]>> {
    let (mesh, adjacency, bvh) = (ground.canvas.mesh, &ground.canvas.adjacency, &ground.bvh);
    let near = ON_PLANE * mesh.bounds().diagonal();
    let mut numbers: Vec<Option<[u32; 2]>> = vec![None; network.corners.len()];
    for (c, _, kind) in kept {
        let [a, b] = network.curves[*c].corners;
        // Of a curve across the plane only the corner before it counts; the other one becomes its image.
        let ends = match kind {
            Kind::Across { from_start: true } => vec![a],
            Kind::Across { from_start: false } => vec![b],
            _ => vec![a, b],
        };
        for k in ends {
            if numbers[k as usize].is_some() {
                continue;
            }
            let place = network.corners[k as usize].place;
            let p = place.position(mesh);
            let first = out.corners.len() as u32;
            if plane.height(p).abs() <= near {
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
    numbers
}
