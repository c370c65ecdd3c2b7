//! What an edit did: new and changed corners and curves, relaxations, what is left to put right (`docs/guide/edit.md`).

use super::CurveNumber;
use crate::curve::Relaxed;
use crate::model::Drawing;
use crate::network::{Curve, Fault};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// A relaxation and the curve that it was of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RelaxedCurve {
    /// The curve: `curve` or `feature` with its number.
    #[serde(flatten)]
    pub curve: CurveNumber,
    /// Sweeps, energy and whether it came to rest.
    #[serde(flatten)]
    pub relaxed: Relaxed,
}

/// What an edit did. All numbers are those after it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Made {
    /// False if the drawing is what it was.
    pub changed: bool,
    /// Corners that are new or have moved.
    pub corners: Vec<u32>,
    /// Curves that are new or have another course or another seam.
    pub curves: Vec<u32>,
    /// Feature curves that are new or have another course.
    pub features: Vec<u32>,
    /// Curves that were relaxed.
    pub relaxed: Vec<RelaxedCurve>,
    /// What is to be put right before every part of the mesh is a patch, where the edit changed curves; else nothing.
    pub faults: Option<Vec<Fault>>,
}

impl Made {
    /// What differs between two drawings.
    pub fn between(before: &Drawing, after: &Drawing) -> Made {
        let bits = |p: &crate::mesh::FacePoint| (p.face, p.bary.map(f64::to_bits));
        let new = |old: BTreeSet<Vec<_>>, now: Vec<Vec<_>>| -> Vec<u32> {
            (0..now.len()).filter(|&k| !old.contains(&now[k])).map(|k| k as u32).collect()
        };
        let corners = |d: &Drawing| d.network.corners.iter().map(|c| vec![bits(&c.place)]).collect::<Vec<_>>();
        let curves = |d: &Drawing| {
            let one = |c: &Curve| c.points.iter().map(bits).chain([(c.kind as u32, [0; 3])]).collect();
            d.network.curves.iter().map(one).collect::<Vec<_>>()
        };
        let features =
            |d: &Drawing| d.sketch.features.iter().map(|f| f.points.iter().map(bits).collect()).collect::<Vec<_>>();
        let old = |list: Vec<Vec<_>>| list.into_iter().collect::<BTreeSet<_>>();
        Made {
            changed: before != after,
            corners: new(old(corners(before)), corners(after)),
            curves: new(old(curves(before)), curves(after)),
            features: new(old(features(before)), features(after)),
            ..Made::default()
        }
    }
}

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
