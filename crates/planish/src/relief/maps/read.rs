//! Maps back to reliefs. What nobody changed keeps the digits that the relief has; only changed texels are read.

use super::super::frame::{Frame, frames};
use super::super::resample::resample_all;
use super::super::{Displaced, Relief, ReliefError};
use super::render::mesh_frames;
use super::{MapFrame, MapKind, MapParams, PatchMap};
use crate::observe::Observer;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// The reliefs that maps mean, at their texels.
///
/// * `displaced` - the model with the relief as it was when the maps were made
/// * `maps` - as they are now, and `made` as they were made: a texel that is the same in both is taken from the relief
///
/// A texel of one number changes the part along the normal; of a length, the length along its direction.
///
/// # Errors
/// [`ReliefError::Count`], [`ReliefError::Shape`] if they are not one map per patch of the size and the channels that
/// `params` say; [`ReliefError::NoHeights`] for maps of normals.
pub fn read_back(
    displaced: &Displaced,
    params: &MapParams,
    maps: &[PatchMap],
    made: &[PatchMap],
    observer: &dyn Observer,
) -> Result<Vec<Relief>, ReliefError> {
    if params.kind == MapKind::Normal {
        return Err(ReliefError::NoHeights);
    }
    for (what, found) in [("maps", maps.len()), ("maps made", made.len())] {
        if found != displaced.reliefs.len() {
            return Err(ReliefError::Count { what, found, wanted: displaced.reliefs.len() });
        }
    }
    let shapes: Vec<[usize; 2]> = maps.iter().map(|m| [m.rows, m.cols]).collect();
    for (patch, (map, made)) in maps.iter().zip(made).enumerate() {
        let PatchMap { rows, cols, channels, ref values } = *map;
        let fits = channels == params.kind.channels() && values.len() == rows * cols * channels;
        if !fits || (made.rows, made.cols, made.values.len()) != (rows, cols, values.len()) {
            return Err(ReliefError::Shape { patch, rows, cols, found: values.len() / channels.max(1) });
        }
    }
    let mut reliefs = resample_all(displaced, &shapes)?;
    let tangent = match params.frame {
        MapFrame::Tangent if params.kind == MapKind::Vector => Some(mesh_frames(displaced, &shapes, observer)?),
        _ => None,
    };
    let one = |(p, relief): (usize, &mut Relief)| {
        observer.check()?;
        let (map, made) = (&maps[p], &made[p]);
        let changed: Vec<usize> = (0..relief.vectors.len()).filter(|&k| map.texel(k) != made.texel(k)).collect();
        if changed.is_empty() {
            return Ok(());
        }
        let own = match (params.kind, params.frame) {
            (MapKind::Vector, MapFrame::Object | MapFrame::Tangent) => {
                frames(&displaced.surfaces[p], relief.rows, relief.cols)
            }
            _ => Vec::new(),
        };
        for k in changed {
            let d = &mut relief.vectors[k];
            let frame = |frames: &[Frame]| frames[k];
            *d = match params.kind {
                MapKind::Length => rescaled(*d, map.values[k] as f64),
                MapKind::Scalar | MapKind::Height => DVec3 { z: map.values[k] as f64, ..*d },
                _ => {
                    let texel = map.texel(k);
                    let told = Vec3::from(params.order.from_channels([texel[0], texel[1], texel[2]])).as_dvec3();
                    match (&params.frame, &tangent) {
                        (MapFrame::Surface, _) => told,
                        (_, Some(mesh)) => frame(&own).local_from_world(frame(&mesh[p]).world_from_local(told)),
                        (_, None) => frame(&own).local_from_world(told),
                    }
                }
            };
        }
        Ok(())
    };
    reliefs.par_iter_mut().enumerate().map(one).collect::<Result<(), ReliefError>>()?;
    Ok(reliefs)
}

/// A vector of another length; along the normal where it had none.
fn rescaled(d: DVec3, length: f64) -> DVec3 {
    d.try_normalize().unwrap_or(DVec3::Z) * length
}
