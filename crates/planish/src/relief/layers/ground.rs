//! Places and normals of all texels of a model: made once, shared by all edits.

use super::super::frame::{Frame, at_nodes};
use super::super::seam::{Member, seam_nodes};
use super::super::{Relief, ReliefError, diagonal};
use crate::geom::Aabb;
use crate::network::Network;
use crate::surface::Surface;
use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A place: in space, or on a patch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Place {
    /// `[x, y, z]`; the nearest place of the surface is meant.
    Space([f64; 3]),
    /// `{ patch = 3, u = 0.5, v = 0.5 }`.
    Patch {
        /// The patch.
        patch: u32,
        /// From 0 to 1.
        u: f64,
        /// From 0 to 1.
        v: f64,
    },
}

/// A node: its place on the surface and its frame.
pub(super) type Texel = (DVec3, Frame);

/// What edits stand on.
pub struct Ground<'a> {
    /// The network.
    pub network: &'a Network,
    /// The surfaces.
    pub surfaces: &'a [Surface],
    /// Nodes of each patch along `v` and along `u`.
    pub shapes: Vec<[usize; 2]>,
    /// For each patch and node its place on the surface and its frame.
    pub(super) nodes: Vec<Vec<Texel>>,
    pub(super) boxes: Vec<Aabb>,
    /// Mean distance of neighbouring nodes of each patch, units of the model.
    pub(super) spacings: Vec<f64>,
    seams: Vec<Vec<Member>>,
}

/// Why an edit of a relief could not be made.
pub(crate) fn refused(what: impl Into<String>) -> ReliefError {
    ReliefError::Edit { what: what.into() }
}

impl<'a> Ground<'a> {
    /// * `shapes` - of the reliefs
    /// # Errors
    /// [`ReliefError`] if the parts do not fit together.
    pub fn new(
        network: &'a Network,
        surfaces: &'a [Surface],
        shapes: Vec<[usize; 2]>,
    ) -> Result<Ground<'a>, ReliefError> {
        if surfaces.len() != network.patches.len() {
            return Err(ReliefError::Count { what: "surfaces", found: surfaces.len(), wanted: network.patches.len() });
        }
        surfaces.iter().try_for_each(Surface::check)?;
        let seams = seam_nodes(network, &shapes)?;
        let none = Frame { tangent: DVec3::X, bitangent: DVec3::Y, normal: DVec3::Z };
        let one = |(surface, &[rows, cols]): (&Surface, &[usize; 2])| {
            let mut nodes = vec![(DVec3::ZERO, none); rows * cols];
            at_nodes(surface, rows, cols, &mut nodes, |to, at, frame| *to = (at, frame));
            nodes
        };
        let nodes: Vec<Vec<(DVec3, Frame)>> = surfaces.par_iter().zip(&shapes).map(one).collect();
        let boxes = nodes.iter().map(|n| Aabb::of(n.iter().map(|(p, _)| p))).collect();
        let spacings = nodes.iter().zip(&shapes).map(|(nodes, &[rows, cols])| spacing(nodes, rows, cols)).collect();
        Ok(Ground { network, surfaces, shapes, nodes, boxes, spacings, seams })
    }

    /// Point and normal of a place: of one in space, those of the nearest node.
    /// * `what` - whose place it is, for messages: "the stroke"
    /// # Errors
    /// [`ReliefError::Edit`] for a patch that is not there, parameters beyond it, or a place in space that is further from the
    /// surface than the model is long.
    pub(super) fn locate(&self, place: &Place, what: &str) -> Result<(DVec3, DVec3), ReliefError> {
        match *place {
            Place::Patch { patch, u, v } => {
                let surface = self.surfaces.get(patch as usize).ok_or_else(|| {
                    refused(format!(
                        "the place of {what} is on no patch: there is no patch {patch} among {}",
                        self.surfaces.len()
                    ))
                })?;
                if ![u, v].iter().all(|t| (0.0..=1.0).contains(t)) {
                    return Err(refused(format!(
                        "the place of {what} is beyond patch {patch}: u and v go from 0 to 1"
                    )));
                }
                Ok((surface.point(u, v), super::super::frame_at(surface, u, v).normal))
            }
            Place::Space(at) => {
                let at = DVec3::from(at);
                let nearest = |nodes: &Vec<(DVec3, Frame)>| {
                    let near = |a: &&(DVec3, Frame), b: &&(DVec3, Frame)| {
                        a.0.distance_squared(at).total_cmp(&b.0.distance_squared(at))
                    };
                    nodes.iter().min_by(near).copied()
                };
                let all: Vec<Option<(DVec3, Frame)>> = self.nodes.par_iter().map(nearest).collect();
                let near = |a: &(DVec3, Frame), b: &(DVec3, Frame)| {
                    a.0.distance_squared(at).total_cmp(&b.0.distance_squared(at))
                };
                let found = all.into_iter().flatten().min_by(near).filter(|_| at.is_finite());
                let (point, frame) = found.ok_or_else(|| refused(format!("the place of {what} is no place")))?;
                let (far, size) = (point.distance(at), diagonal(self.surfaces));
                if far > size {
                    let far = format!("{far:.3} away from the surface, further than the model is long ({size:.3})");
                    return Err(refused(format!("the place of {what} is {far}")));
                }
                Ok((point, frame.normal))
            }
        }
    }

    /// Gives both sides of seams the mean of their world vectors; patches without vectors have none to say.
    pub(super) fn agree(&self, maps: &mut [Relief]) {
        self.agree_on(maps, |told| told.iter().map(|t| t.0).sum::<DVec3>() / told.len() as f64);
    }

    /// Gives all sides of seams one vector that goes as far along the normal of each as it says, or further: where normals are
    /// within a right angle, for what one of them adds takes nothing from the others then.
    pub(super) fn agree_on_most(&self, maps: &mut [Relief]) {
        self.agree_on(maps, |told| {
            let further = |sum: DVec3, (world, normal): &(DVec3, DVec3)| {
                let wanted = world.dot(*normal);
                let short = wanted - sum.dot(*normal);
                if short * wanted > 0.0 { sum + *normal * short } else { sum }
            };
            told.iter().fold(DVec3::ZERO, further)
        });
    }

    /// * `choice` - of the world vectors that sides say, each with the side's normal
    fn agree_on(&self, maps: &mut [Relief], choice: impl Fn(&[(DVec3, DVec3)]) -> DVec3) {
        for members in &self.seams {
            let told = |&&(p, _): &&Member| !maps[p as usize].vectors.is_empty();
            if members.iter().filter(told).count() == 0 {
                continue;
            }
            let world = |&(p, n): &Member| {
                let d = maps[p as usize].vectors.get(n as usize).copied().unwrap_or_default();
                let frame = &self.nodes[p as usize][n as usize].1;
                (frame.world_from_local(d), frame.normal)
            };
            let worlds: Vec<(DVec3, DVec3)> = members.iter().map(world).collect();
            if worlds.iter().all(|w| w.0 == DVec3::ZERO) {
                continue;
            }
            let one = choice(&worlds);
            for &(p, n) in members {
                let (p, n) = (p as usize, n as usize);
                if maps[p].vectors.is_empty() {
                    maps[p].vectors = vec![DVec3::ZERO; maps[p].rows * maps[p].cols];
                }
                maps[p].vectors[n] = self.nodes[p][n].1.local_from_world(one);
            }
        }
    }

    /// The places that more than one node has, each with its nodes.
    pub(super) fn seams(&self) -> &[Vec<Member>] {
        &self.seams
    }

    /// Maps without any displacement.
    pub(super) fn nothing(&self) -> Vec<Relief> {
        self.shapes.iter().map(|&[rows, cols]| Relief { rows, cols, vectors: Vec::new() }).collect()
    }
}

/// Mean distance of neighbouring nodes.
fn spacing(nodes: &[Texel], rows: usize, cols: usize) -> f64 {
    let along = nodes.chunks_exact(cols).flat_map(|row| row.windows(2).map(|w| w[0].0.distance(w[1].0)));
    let across = nodes.iter().zip(nodes.iter().skip(cols)).map(|(a, b)| a.0.distance(b.0));
    along.chain(across).sum::<f64>() / (rows * (cols - 1) + cols * (rows - 1)).max(1) as f64
}
