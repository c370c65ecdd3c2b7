//! Reliefs from elsewhere: from patch to patch, one patch tiled over others, and from another model of the same shape.
//!
//! [K98] fig. 7.5: a map that is meant in the frame of the surface fits any patch.

use super::super::frame::{at_nodes, frames};
use super::super::resample::world_vectors;
use super::super::{Displaced, Relief, ReliefError, surface_patches};
use super::ground::Ground;
use super::warp::Warp;
use crate::geom::Bvh;
use crate::mesh::{FacePoint, TriMesh};
use crate::observe::Observer;
use crate::surface::Surface;
use glam::{DQuat, DVec3};
use rayon::prelude::*;

/// The relief of a patch on others, each at its own shape; patches that are not named get nothing.
///
/// * `source` - the relief that is copied
/// * `pairs` - `(turns, patch)`: the patches that get it, turned by quarters against the clock
pub fn paste(ground: &Ground, source: &Relief, pairs: &[(u32, u32)]) -> Vec<Relief> {
    let mut maps = ground.nothing();
    for &(turns, patch) in pairs {
        let [rows, cols] = ground.shapes[patch as usize];
        let one = |k: usize| {
            let (i, j) = (k % cols, k / cols);
            let (u, v) = (i as f64 / (cols - 1) as f64, j as f64 / (rows - 1) as f64);
            let (u, v) = match turns % 4 {
                0 => (u, v),
                1 => (v, 1.0 - u),
                2 => (1.0 - u, 1.0 - v),
                _ => (1.0 - v, u),
            };
            turned(sampled(source, u, v), turns)
        };
        maps[patch as usize].vectors = (0..rows * cols).map(one).collect();
    }
    ground.agree(&mut maps);
    maps
}

/// Tangential parts turned by quarters against the clock, as the map is.
pub(super) fn turned(d: DVec3, turns: u32) -> DVec3 {
    match turns % 4 {
        0 => d,
        1 => DVec3::new(-d.y, d.x, d.z),
        2 => DVec3::new(-d.x, -d.y, d.z),
        _ => DVec3::new(d.y, -d.x, d.z),
    }
}

/// Bilinear, in the numbers of the map.
fn sampled(relief: &Relief, u: f64, v: f64) -> DVec3 {
    let along = |t: f64, n: usize| {
        let x = t.clamp(0.0, 1.0) * (n - 1) as f64;
        let cell = (x.floor() as usize).min(n - 2);
        (cell, x - cell as f64)
    };
    let ((i, s), (j, t)) = (along(u, relief.cols), along(v, relief.rows));
    let at = |i: usize, j: usize| relief.vectors[j * relief.cols + i];
    at(i, j).lerp(at(i + 1, j), s).lerp(at(i, j + 1).lerp(at(i + 1, j + 1), s), t)
}

/// The relief of a patch repeated over others, `times` along `u` and along `v`, every second one mirrored so that the
/// repeats join without a seam.
pub fn tile(ground: &Ground, source: &Relief, patches: &[u32], times: [u32; 2]) -> Vec<Relief> {
    let mut maps = ground.nothing();
    let fold = |t: f64, n: u32| {
        let x = t * n as f64;
        let (cell, part) = (x.floor().min(n as f64 - 1.0), x - x.floor().min(n as f64 - 1.0));
        if cell as u32 % 2 == 1 { (1.0 - part, -1.0) } else { (part, 1.0) }
    };
    for &patch in patches {
        let [rows, cols] = ground.shapes[patch as usize];
        let one = |k: usize| {
            let (i, j) = (k % cols, k / cols);
            let (u, along) = fold(i as f64 / (cols - 1) as f64, times[0].max(1));
            let (v, up) = fold(j as f64 / (rows - 1) as f64, times[1].max(1));
            sampled(source, u, v) * DVec3::new(along, up, 1.0)
        };
        maps[patch as usize].vectors = (0..rows * cols).into_par_iter().map(one).collect();
    }
    ground.agree(&mut maps);
    maps
}

/// The relief of another model at the closest points of its base surface.
///
/// Without a map both models have the same shape and place, and displacements are meant in space. With one, the closest point is
/// looked for on the surface that the map has moved, and the displacement goes along in the frame of the surface: the part along
/// the normal stays along the normal, the rest turns with the map, and all of it is as much longer as the map makes lengths there.
///
/// * `warp` - the map from the other model to this one
/// * `reach` - further away than this nothing is taken over, units of the model
///
/// Returns the maps and the number of texels that found nothing.
/// # Errors
/// If the parts of the other model do not fit together; [`ReliefError::Cancelled`].
pub fn transfer(
    ground: &Ground,
    from: &Displaced,
    warp: Option<&Warp>,
    reach: f64,
    observer: &dyn Observer,
) -> Result<(Vec<Relief>, usize), ReliefError> {
    let source = Source::new(from, warp, observer)?;
    let tree = Bvh::watched(&source.mesh, observer)?;
    let one = |(surface, &[rows, cols]): (&Surface, &[usize; 2])| {
        observer.check()?;
        let mut found = vec![(DVec3::ZERO, true); rows * cols];
        at_nodes(surface, rows, cols, &mut found, |to, at, frame| {
            let hit = tree.closest(at);
            let detail = (hit.distance <= reach).then(|| source.detail(hit.place, frame.normal)).flatten();
            *to = (frame.local_from_world(detail.unwrap_or_default()), detail.is_some());
        });
        Ok(found)
    };
    let found: Vec<Vec<(DVec3, bool)>> =
        ground.surfaces.par_iter().zip(&ground.shapes).map(one).collect::<Result<_, ReliefError>>()?;
    let missed = found.iter().flatten().filter(|(_, hit)| !hit).count();
    let relief = |(texels, &[rows, cols]): (Vec<(DVec3, bool)>, &[usize; 2])| Relief {
        rows,
        cols,
        vectors: texels.into_iter().map(|(d, _)| d).collect(),
    };
    let mut maps: Vec<Relief> = found.into_iter().zip(&ground.shapes).map(relief).collect();
    ground.agree(&mut maps);
    Ok((maps, missed))
}

/// The base surface of the other model, moved by the map, with what its vertices hold.
struct Source {
    mesh: TriMesh,
    /// Displacements that are turned and stretched by the map, world units.
    detail: Vec<DVec3>,
    /// Normals of the surface, turned by the map. Empty without one.
    normals: Vec<DVec3>,
    /// False where the map folds space over.
    sound: Vec<bool>,
}

impl Source {
    fn new(from: &Displaced, warp: Option<&Warp>, observer: &dyn Observer) -> Result<Source, ReliefError> {
        from.check()?;
        let shapes: Vec<[usize; 2]> = from.reliefs.iter().map(|r| [r.rows, r.cols]).collect();
        let base = surface_patches(from.network, from.surfaces, &shapes, observer)?;
        let count = base.mesh.points.len();
        let mut source =
            Source { mesh: base.mesh, detail: vec![DVec3::ZERO; count], normals: Vec::new(), sound: Vec::new() };
        let world = |(s, r): (&Surface, &Relief)| world_vectors(s, r);
        let vectors: Vec<Vec<DVec3>> = from.surfaces.par_iter().zip(from.reliefs).map(world).collect();
        for (nodes, vectors) in base.patches.iter().zip(&vectors) {
            nodes.vertices.iter().zip(vectors).for_each(|(&v, &d)| source.detail[v as usize] = d);
        }
        let Some(warp) = warp else { return Ok(source) };
        source.normals = vec![DVec3::ZERO; count];
        for (nodes, surface) in base.patches.iter().zip(from.surfaces) {
            let frames = frames(surface, nodes.rows, nodes.cols);
            nodes.vertices.iter().zip(frames).for_each(|(&v, f)| source.normals[v as usize] += f.normal);
        }
        observer.check()?;
        let turns: Vec<_> = source.mesh.points.par_iter().map(|p| warp.turn(*p)).collect();
        source.mesh.points.par_iter_mut().for_each(|p| *p = warp.point(*p));
        source.sound = turns.iter().map(Option::is_some).collect();
        for (k, turn) in turns.into_iter().enumerate() {
            let Some(turn) = turn else { continue };
            source.detail[k] = turn.rotation * source.detail[k] * turn.scale;
            source.normals[k] = (turn.rotation * source.normals[k]).normalize_or_zero();
        }
        Ok(source)
    }

    /// The displacement at a place, as it is meant on a surface of this normal; `None` where there is none.
    fn detail(&self, place: FacePoint, normal: DVec3) -> Option<DVec3> {
        let corners = self.mesh.triangles[place.face as usize].map(|v| v as usize);
        let mean =
            |values: &[DVec3]| corners.iter().zip(place.bary).map(|(&v, share)| values[v] * share).sum::<DVec3>();
        let d = mean(&self.detail);
        if self.normals.is_empty() {
            return Some(d);
        }
        let own = mean(&self.normals).try_normalize()?;
        // What faces the other way is the far side of a thin wall.
        let faces = own.dot(normal) > 0.0 && corners.iter().all(|&v| self.sound[v]);
        faces.then(|| DQuat::from_rotation_arc(own, normal) * d)
    }
}
