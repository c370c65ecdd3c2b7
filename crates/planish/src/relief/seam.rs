//! Nodes of different patches that are one place, and what they agree on.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §8.2.
//!
//! Departs from [K98]: not the numbers of two boundary rows are averaged but the world vectors that they mean, since
//! each row is meant in a frame of its own.

use super::{Displaced, Relief, ReliefError, frame_at};
use crate::network::Network;
use crate::surface::node;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A node of a patch: `(patch, node)`.
pub type Member = (u32, u32);

/// What the two sides of a seam agree on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Agreement {
    /// The mean of all patches that meet there.
    #[default]
    Average,
    /// What the patch of the lowest number says.
    First,
    /// What the patch of the highest number says.
    Last,
}

/// The places that more than one node has, each with its nodes in the order of the patches.
///
/// * `shapes` - nodes of each patch along `v` and along `u`
///
/// # Errors
/// [`ReliefError::Count`], [`ReliefError::Mismatch`] where shapes and network do not fit, [`ReliefError::Network`].
pub fn seam_nodes(network: &Network, shapes: &[[usize; 2]]) -> Result<Vec<Vec<Member>>, ReliefError> {
    if shapes.len() != network.patches.len() {
        return Err(ReliefError::Count { what: "shapes", found: shapes.len(), wanted: network.patches.len() });
    }
    let mut corners: Vec<Vec<Member>> = vec![Vec::new(); network.corners.len()];
    let mut curves: Vec<Vec<Vec<Member>>> = vec![Vec::new(); network.curves.len()];
    for (p, (patch, &[rows, cols])) in network.patches.iter().zip(shapes).enumerate() {
        let wrong = ReliefError::Network { patch: p };
        for (k, side) in patch.sides.iter().enumerate() {
            let n = if k % 2 == 0 { cols } else { rows };
            let curve = network.curves.get(side.curve as usize).ok_or(wrong.clone())?;
            let along = &mut curves[side.curve as usize];
            if along.is_empty() {
                along.resize(n, Vec::new());
            } else if along.len() != n {
                return Err(ReliefError::Mismatch { curve: side.curve as usize, first: along.len(), second: n });
            }
            for i in 0..n {
                let member = (p as u32, node(rows, cols, k, i, 0) as u32);
                let at = if side.reversed { n - 1 - i } else { i };
                let list = match at {
                    0 => corners.get_mut(curve.corners[0] as usize),
                    a if a == n - 1 => corners.get_mut(curve.corners[1] as usize),
                    a => along.get_mut(a),
                };
                let list = list.ok_or(wrong.clone())?;
                if !list.contains(&member) {
                    list.push(member);
                }
            }
        }
    }
    let all = corners.into_iter().chain(curves.into_iter().flatten());
    Ok(all.filter(|members| members.len() > 1).collect())
}

/// Makes all patches displace a shared place to one point.
///
/// # Errors
/// As [`seam_nodes`].
///
/// Source: [K98] §8.2.
pub fn agree(
    network: &Network,
    surfaces: &[crate::surface::Surface],
    reliefs: &mut [Relief],
    how: Agreement,
) -> Result<(), ReliefError> {
    let shapes: Vec<[usize; 2]> = reliefs.iter().map(|r| [r.rows, r.cols]).collect();
    for members in seam_nodes(network, &shapes)? {
        let frame = |&(p, n): &Member| {
            let [rows, cols] = shapes[p as usize];
            let (i, j) = (n as usize % cols, n as usize / cols);
            frame_at(&surfaces[p as usize], i as f64 / (cols - 1) as f64, j as f64 / (rows - 1) as f64)
        };
        let frames: Vec<_> = members.iter().map(frame).collect();
        let worlds: Vec<DVec3> = members
            .iter()
            .zip(&frames)
            .map(|(&(p, n), f)| f.world_from_local(reliefs[p as usize].vectors[n as usize]))
            .collect();
        let one = match how {
            Agreement::Average => worlds.iter().sum::<DVec3>() / worlds.len() as f64,
            Agreement::First => worlds[0],
            Agreement::Last => worlds[worlds.len() - 1],
        };
        for ((&(p, n), f), world) in members.iter().zip(&frames).zip(&worlds) {
            // What agrees already keeps its digits.
            if *world != one {
                reliefs[p as usize].vectors[n as usize] = f.local_from_world(one);
            }
        }
    }
    Ok(())
}

/// Largest distance between the points to which patches displace one place.
///
/// # Errors
/// As [`seam_nodes`].
pub fn widest_crack(displaced: &Displaced) -> Result<f64, ReliefError> {
    let Displaced { network, surfaces, reliefs } = *displaced;
    let shapes: Vec<[usize; 2]> = reliefs.iter().map(|r| [r.rows, r.cols]).collect();
    let mut widest: f64 = 0.0;
    for members in seam_nodes(network, &shapes)? {
        let points: Vec<DVec3> = members
            .iter()
            .map(|&(p, n)| {
                let ([rows, cols], surface) = (shapes[p as usize], &surfaces[p as usize]);
                let (i, j) = (n as usize % cols, n as usize / cols);
                let (u, v) = (i as f64 / (cols - 1) as f64, j as f64 / (rows - 1) as f64);
                let d = reliefs[p as usize].vectors[n as usize];
                surface.point(u, v) + frame_at(surface, u, v).world_from_local(d)
            })
            .collect();
        widest = points.iter().map(|p| p.distance(points[0])).fold(widest, f64::max);
    }
    Ok(widest)
}
