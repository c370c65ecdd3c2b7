//! Texels of all kinds: [K98] §7.2 (vectors), §7.3 (scalar maps), §7.4 (normals).

use super::super::frame::{Frame, at_nodes, frames};
use super::super::resample::{spread, world_vectors};
use super::super::seam::{Member, seam_nodes};
use super::super::{Displaced, PatchedMesh, Relief, ReliefError, surface_patches};
use super::rays::heights;
use super::tangent::tangent_frames;
use super::texels::{local, scalars};
use super::{MapFrame, MapKind, MapParams, PatchMap};
use crate::mesh::TriMesh;
use crate::observe::Observer;
use crate::surface::Surface;
use glam::DVec3;
use rayon::prelude::*;

/// Normals of two patches at a place are one if they differ by less; a seam that is meant sharp stays one.
const SHARP_DEG: f64 = 30.0;

/// The maps of all patches, in their order.
///
/// * `mesh` - the mesh that was fitted, for heights by rays
///
/// # Errors
/// Lists that do not fit together; [`ReliefError::Cancelled`].
pub fn render(
    displaced: &Displaced,
    mesh: &TriMesh,
    params: &MapParams,
    observer: &dyn Observer,
) -> Result<Vec<PatchMap>, ReliefError> {
    displaced.check()?;
    let Displaced { network, surfaces, reliefs } = *displaced;
    let shapes: Vec<[usize; 2]> = reliefs.iter().map(|r| params.shape([r.rows, r.cols])).collect();
    let seams = seam_nodes(network, &shapes)?;
    let mut maps = match params.kind {
        MapKind::Vector => vectors(displaced, &shapes, params, observer)?,
        MapKind::Normal => normals(displaced, &shapes, &seams, params, observer)?,
        MapKind::Height => heights(displaced, mesh, &shapes, observer)?,
        kind => {
            let one = |((s, r), &shape): ((&Surface, &Relief), &[usize; 2])| {
                observer.check()?;
                let fine = local(s, r, shape);
                let number = |d: &DVec3| if kind == MapKind::Length { d.length() } else { d.z };
                Ok(scalars(shape, fine.iter().map(number)))
            };
            surfaces.par_iter().zip(reliefs).zip(&shapes).map(one).collect::<Result<_, ReliefError>>()?
        }
    };
    if params.kind.channels() == 1 {
        average(&mut maps, &seams);
    } else if params.frame == MapFrame::Object && params.kind == MapKind::Vector {
        share(&mut maps, &seams);
    }
    Ok(maps)
}

/// Maps of vectors.
fn packed([rows, cols]: [usize; 2], vectors: &[DVec3], params: &MapParams) -> PatchMap {
    let values = vectors.iter().flat_map(|d| params.order.to_channels(d.as_vec3().to_array())).collect();
    PatchMap { rows, cols, channels: 3, values }
}

/// The frames of the texels of a patch in tangent space of its base mesh.
pub(super) fn mesh_frames(
    displaced: &Displaced,
    shapes: &[[usize; 2]],
    observer: &dyn Observer,
) -> Result<Vec<Vec<Frame>>, ReliefError> {
    let base = surface_patches(displaced.network, displaced.surfaces, shapes, observer)?;
    let one = |((surface, nodes), &[rows, cols]): ((&Surface, &super::super::PatchNodes), &[usize; 2])| {
        observer.check()?;
        let points: Vec<DVec3> = nodes.vertices.iter().map(|&v| base.mesh.points[v as usize]).collect();
        Ok(tangent_frames(&points, frames(surface, rows, cols), &nodes.triangles, [rows, cols]))
    };
    displaced.surfaces.par_iter().zip(&base.patches).zip(shapes).map(one).collect()
}

fn vectors(
    displaced: &Displaced,
    shapes: &[[usize; 2]],
    params: &MapParams,
    observer: &dyn Observer,
) -> Result<Vec<PatchMap>, ReliefError> {
    let Displaced { surfaces, reliefs, .. } = *displaced;
    let world = |s: &Surface, r: &Relief, shape| spread(&world_vectors(s, r), [r.rows, r.cols], shape);
    if params.frame == MapFrame::Tangent {
        let frames = mesh_frames(displaced, shapes, observer)?;
        let one = |(p, frames): (usize, &Vec<Frame>)| {
            let fine = world(&surfaces[p], &reliefs[p], shapes[p]);
            let vectors: Vec<DVec3> = fine.iter().zip(frames).map(|(d, f)| f.local_from_world(*d)).collect();
            packed(shapes[p], &vectors, params)
        };
        return Ok(frames.par_iter().enumerate().map(one).collect());
    }
    let one = |((s, r), &shape): ((&Surface, &Relief), &[usize; 2])| {
        observer.check()?;
        let fine = if params.frame == MapFrame::Object { world(s, r, shape) } else { local(s, r, shape) };
        Ok(packed(shape, &fine, params))
    };
    surfaces.par_iter().zip(reliefs).zip(shapes).map(one).collect()
}

/// Unit normals of the displaced surface at the texels, by differences; over smooth seams those of all patches there.
fn normals(
    displaced: &Displaced,
    shapes: &[[usize; 2]],
    seams: &[Vec<Member>],
    params: &MapParams,
    observer: &dyn Observer,
) -> Result<Vec<PatchMap>, ReliefError> {
    let Displaced { surfaces, reliefs, .. } = *displaced;
    let one = |((s, r), &shape): ((&Surface, &Relief), &[usize; 2])| {
        observer.check()?;
        let mut points = spread(&world_vectors(s, r), [r.rows, r.cols], shape);
        at_nodes(s, shape[0], shape[1], &mut points, |p, at, _| *p += at);
        Ok(across(&points, shape))
    };
    let mut all: Vec<Vec<DVec3>> =
        surfaces.par_iter().zip(reliefs).zip(shapes).map(one).collect::<Result<_, ReliefError>>()?;
    let sharp = SHARP_DEG.to_radians().cos();
    for members in seams {
        let here: Vec<DVec3> = members.iter().map(|&(p, n)| all[p as usize][n as usize]).collect();
        for (&(p, n), own) in members.iter().zip(&here) {
            let alike = |n: &&DVec3| n.normalize_or_zero().dot(own.normalize_or_zero()) >= sharp;
            all[p as usize][n as usize] = here.iter().filter(alike).sum::<DVec3>();
        }
    }
    let frames = match params.frame {
        MapFrame::Tangent => Some(mesh_frames(displaced, shapes, observer)?),
        _ => None,
    };
    let finish = |(p, mut normals): (usize, Vec<DVec3>)| {
        let [rows, cols] = shapes[p];
        let in_frame = |n: &mut DVec3, frame: &Frame, turned: bool| {
            let unit = n.try_normalize().unwrap_or(frame.normal);
            *n = if turned { frame.local_from_world(unit) } else { unit };
        };
        match &frames {
            Some(frames) => normals.iter_mut().zip(&frames[p]).for_each(|(n, f)| in_frame(n, f, true)),
            None => {
                let turned = params.frame == MapFrame::Surface;
                at_nodes(&surfaces[p], rows, cols, &mut normals, |n, _, f| in_frame(n, &f, turned));
            }
        }
        packed(shapes[p], &normals, params)
    };
    Ok(all.into_par_iter().enumerate().map(finish).collect())
}

/// Products of the differences along and across, central inside and one-sided at the border.
fn across(points: &[DVec3], [rows, cols]: [usize; 2]) -> Vec<DVec3> {
    let ends = |i: usize, n: usize| (i.saturating_sub(1), (i + 1).min(n - 1));
    let one = |k: usize| {
        let (i, j) = (k % cols, k / cols);
        let ((west, east), (south, north)) = (ends(i, cols), ends(j, rows));
        let along = (points[j * cols + east] - points[j * cols + west]) / (east - west) as f64;
        let up = (points[north * cols + i] - points[south * cols + i]) / (north - south) as f64;
        along.cross(up)
    };
    (0..points.len()).map(one).collect()
}

/// Gives all texels of a place their mean.
pub(super) fn average(maps: &mut [PatchMap], seams: &[Vec<Member>]) {
    for members in seams {
        let sum: f64 = members.iter().map(|&(p, n)| maps[p as usize].values[n as usize] as f64).sum();
        let mean = (sum / members.len() as f64) as f32;
        members.iter().for_each(|&(p, n)| maps[p as usize].values[n as usize] = mean);
    }
}

/// Gives all texels of a place what the first has: they differ by rounding alone.
fn share(maps: &mut [PatchMap], seams: &[Vec<Member>]) {
    for members in seams {
        let (p, n) = members[0];
        let first: Vec<f32> = maps[p as usize].texel(n as usize).to_vec();
        for &(p, n) in &members[1..] {
            let map = &mut maps[p as usize];
            map.values[n as usize * map.channels..][..first.len()].copy_from_slice(&first);
        }
    }
}

/// The base mesh with a vertex for each texel, and the unit normals of its nodes: what a map in tangent space is meant
/// for.
///
/// # Errors
/// As [`render`].
pub fn base_mesh(
    displaced: &Displaced,
    params: &MapParams,
    observer: &dyn Observer,
) -> Result<(PatchedMesh, Vec<Vec<DVec3>>), ReliefError> {
    displaced.check()?;
    let shapes: Vec<[usize; 2]> = displaced.reliefs.iter().map(|r| params.shape([r.rows, r.cols])).collect();
    let base = surface_patches(displaced.network, displaced.surfaces, &shapes, observer)?;
    let normals =
        |(s, &[rows, cols]): (&Surface, &[usize; 2])| frames(s, rows, cols).iter().map(|f| f.normal).collect();
    Ok((base, displaced.surfaces.par_iter().zip(&shapes).map(normals).collect()))
}
