//! Networks mirrored across a plane of symmetry, and carried from one shape to another.

use super::{ApplyError, Ground};
use crate::curve::carry::{LandmarkMap, carry_curve, carry_place};
use crate::curve::symmetry::Plane;
use crate::curve::{SurfaceCurve, connect, slide_to};
use crate::mesh::{FacePoint, TriMesh, sharp_edges};
use crate::network::{Corner, Curve, CurveKind, Network};
use crate::observe::Observer;

/// A corner nearer to the plane than this share of the diagonal lies on it.
pub(super) const ON_PLANE: f64 = 2e-3;

/// The curves before `plane` (on the side of its normal) and in it, and their mirror images; curves behind it go.
/// Every curve lies on one side, with corners where it meets the plane; those corners are moved into it.
/// # Errors
/// `AcrossPlane` for a curve that crosses the plane between its ends; `Curve` if an image cannot be drawn.
pub fn mirror_network(ground: &Ground, network: &Network, plane: &Plane) -> Result<Network, ApplyError> {
    let (mesh, adjacency, bvh) = (ground.canvas.mesh, &ground.canvas.adjacency, &ground.bvh);
    let near = ON_PLANE * mesh.bounds().diagonal();
    let height = |p: &FacePoint| plane.height(p.position(mesh));
    let mut out = Network::default();
    // Old corner -> its number before the plane, and that of its image.
    let mut numbers: Vec<Option<[u32; 2]>> = vec![None; network.corners.len()];
    let mut kept = Vec::new();
    for (c, curve) in network.curves.iter().enumerate() {
        let tops =
            curve.points.iter().map(height).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        if tops.1 < near && tops.0 < -near {
            continue;
        }
        if tops.0 < -near {
            let worst = curve.points.iter().min_by(|a, b| height(a).abs().total_cmp(&height(b).abs()));
            let place = worst.map_or([0.0; 3], |p| p.position(mesh).to_array());
            return Err(ApplyError::AcrossPlane { curve: c, place });
        }
        kept.push((curve, tops.1 <= near));
        for k in curve.corners {
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
    for (curve, in_plane) in kept {
        let ends = |image: usize| curve.corners.map(|k| numbers[k as usize].map_or(0, |n| n[image]));
        for image in 0..=(!in_plane) as usize {
            let corners = ends(image);
            let mut places: Vec<FacePoint> = match image {
                0 => curve.points.clone(),
                _ => curve.points.iter().map(|p| plane.mirror_place(mesh, bvh, p)).collect(),
            };
            let last = places.len() - 1;
            places[0] = out.corners[corners[0] as usize].place;
            places[last] = out.corners[corners[1] as usize].place;
            let points = SurfaceCurve::open(places).trace(mesh, adjacency)?;
            out.curves.push(Curve { corners, kind: curve.kind, points });
        }
    }
    Ok(out)
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
