//! Networks: corners, curves and four-sided patches on a mesh ([K98] fig. 1.3: boundary curves).
//!
//! See `docs/methods/curves.md`, "Networks", and `docs/guide/formats.md` for the file.

pub(crate) mod diagnose;
pub(crate) mod disk;
pub mod field;
pub(crate) mod imprint;
mod reimprint;

pub use diagnose::{Diagnosis, Fault, Region, diagnose, glance};
pub use imprint::{ImprintError, imprint};
pub use reimprint::{changed_patches, reimprint, reimprint_over};

use crate::mesh::{FacePoint, TriMesh};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A conforming network of four-sided patches.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Network {
    /// Places where curves end.
    pub corners: Vec<Corner>,
    /// Boundary curves between corners.
    pub curves: Vec<Curve>,
    /// Four-sided patches.
    pub patches: Vec<Patch>,
}

/// A place where curves end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Corner {
    /// Its place on the mesh.
    pub place: FacePoint,
}

/// What a curve follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CurveKind {
    /// Runs over smooth surface: the seam along it is to be smooth as far as the fit can afford it.
    Smooth,
    /// Follows a sharp edge, or is wanted sharp; the seam along it is C0 on purpose.
    Feature,
    /// Follows the boundary of the mesh; it has one patch only.
    Boundary,
    /// Is wanted smooth by a person: an edge under it is rounded, whatever that costs the fit.
    Rounded,
}

impl CurveKind {
    /// True if the patches on both sides are to have one tangent plane along the curve.
    pub fn is_smooth(self) -> bool {
        matches!(self, CurveKind::Smooth | CurveKind::Rounded)
    }
}

/// How two patches are to meet along their curve, whatever the mesh has there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Seam {
    /// With one tangent plane, as nearly as the patches can; an edge under the curve is rounded.
    Smooth,
    /// At the angle that each patch has by itself: C0.
    Sharp,
}

impl From<Seam> for CurveKind {
    fn from(seam: Seam) -> CurveKind {
        match seam {
            Seam::Smooth => CurveKind::Rounded,
            Seam::Sharp => CurveKind::Feature,
        }
    }
}

/// A boundary curve between two corners.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// Corners at the start and at the end.
    pub corners: [u32; 2],
    /// What it follows.
    pub kind: CurveKind,
    /// Face points from corner to corner, both included; neighbours share a face.
    pub points: Vec<FacePoint>,
}

/// How a curve runs along its chord.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Along {
    /// The chord, called by the first of its curves.
    pub chord: u32,
    /// True if the curve runs against that first one.
    pub reversed: bool,
    /// True if the chord comes back to a curve from its other end, as on a Moebius strip: what holds for it has to hold from
    /// both ends.
    pub both_ways: bool,
}

/// One side of a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Side {
    /// Index of the curve.
    pub curve: u32,
    /// True if the side runs against the curve's own direction.
    pub reversed: bool,
}

/// A four-sided patch.
///
/// Its sides run counter-clockwise seen from outside. With `u` along side 0 and `v` along side 1: side 0 is
/// `v = 0` with `u` rising, side 1 `u = 1` with `v` rising, side 2 `v = 1` with `u` falling, side 3 `u = 0`
/// with `v` falling. So the surface normal `S_u x S_v` points outside.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Patch {
    /// The four sides.
    pub sides: [Side; 4],
}

/// The exact sub-mesh of a patch: a disk, cut out of the mesh along the curves.
#[derive(Clone, Debug)]
pub struct PatchMesh {
    /// Its own triangles over its own vertices (no attributes).
    pub mesh: TriMesh,
    /// For each vertex its place on the input mesh.
    pub origin: Vec<FacePoint>,
    /// For each triangle the face of the input mesh that it is a part of.
    pub face_origin: Vec<u32>,
    /// For each side (order and direction of [`Patch`]) its vertices from corner to corner, both included.
    pub sides: [Vec<u32>; 4],
}

impl Network {
    /// Corner at the start of side `k` of `patch`.
    pub fn corner(&self, patch: usize, k: usize) -> u32 {
        let side = self.patches[patch].sides[k];
        self.curves[side.curve as usize].corners[side.reversed as usize]
    }

    /// For each curve the patch sides that use it, as `(patch, side)`.
    pub fn uses(&self) -> Vec<Vec<(u32, u8)>> {
        let mut uses = vec![Vec::new(); self.curves.len()];
        for (p, patch) in self.patches.iter().enumerate() {
            for (k, side) in patch.sides.iter().enumerate() {
                uses[side.curve as usize].push((p as u32, k as u8));
            }
        }
        uses
    }

    /// For each curve its chord: curves on opposite sides of a patch belong to one chord, and all curves of
    /// a chord share their number of grid points and of control points.
    pub fn chords(&self) -> Vec<u32> {
        self.directed_chords().into_iter().map(|along| along.chord).collect()
    }

    /// For each curve its chord and how it runs along it: opposite sides of a patch run the same way, seen from the patch.
    pub fn directed_chords(&self) -> Vec<Along> {
        // Of each curve another of its chord, and whether it runs against that one.
        let mut parent: Vec<(u32, bool)> = (0..self.curves.len() as u32).map(|c| (c, false)).collect();
        fn root(parent: &mut [(u32, bool)], c: u32) -> (u32, bool) {
            let (above, against) = parent[c as usize];
            if above == c {
                return (c, false);
            }
            let (top, turned) = root(parent, above);
            parent[c as usize] = (top, turned != against);
            parent[c as usize]
        }
        let mut both_ways = vec![false; self.curves.len()];
        for patch in &self.patches {
            for k in 0..2 {
                let [one, other] = [patch.sides[k], patch.sides[k + 2]];
                let (a, a_turned) = root(&mut parent, one.curve);
                let (b, b_turned) = root(&mut parent, other.curve);
                // Both sides run counter-clockwise, so against each other.
                let against = (one.reversed != a_turned) == (other.reversed != b_turned);
                let (low, high) = (a.min(b), a.max(b));
                if low == high {
                    both_ways[low as usize] |= against;
                } else {
                    parent[high as usize] = (low, against);
                    both_ways[low as usize] |= both_ways[high as usize];
                }
            }
        }
        let along = |c: u32| {
            let (chord, reversed) = root(&mut parent, c);
            Along { chord, reversed, both_ways: both_ways[chord as usize] }
        };
        (0..self.curves.len() as u32).map(along).collect()
    }
}
