//! Feature curves: curves inside a patch that must become iso-curves of its grid.
//!
//! [K98] §5.9 to 5.11; `docs/methods/curves.md`, "Feature curves".

pub(crate) mod curve;
pub(crate) mod network;
mod slide;
mod strand;

use super::GridError;
use crate::mesh::FacePoint;
use crate::network::ImprintError;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which iso-curves a feature curve is one of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// Runs along u, from side 3 to side 1: `v` is constant on it.
    U,
    /// Runs along v, from side 0 to side 2: `u` is constant on it.
    V,
}

/// A curve across a patch that its grid is to follow.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FeatureCurve {
    /// The patch.
    pub patch: u32,
    /// Which iso-curves it is one of.
    pub family: Family,
    /// Places on the mesh, from side to side; ends are led on to the nearest place of their side.
    pub points: Vec<FacePoint>,
}

/// Why a patch cannot follow its feature curves.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FeatureError {
    /// Two curves of one family cross or touch.
    #[error(
        "feature curves {a} and {b} of one family cross at ({:.6}, {:.6}, {:.6}) - hint: delete one or move it apart",
        place.x, place.y, place.z
    )]
    Cross {
        /// The first.
        a: usize,
        /// The second.
        b: usize,
        /// World position.
        place: DVec3,
    },
    /// Two curves of different families cross more than once.
    #[error(
        "feature curves {a} and {b} meet {times} times, near ({:.6}, {:.6}, {:.6}), not once - hint: move one of them",
        place.x, place.y, place.z
    )]
    MeetAgain {
        /// The first.
        a: usize,
        /// The second.
        b: usize,
        /// Number of times.
        times: usize,
        /// World position of the last.
        place: DVec3,
    },
    /// A curve has no place inside the patch, or leaves it.
    #[error("feature curve {curve} does not run through the inside of its patch - hint: draw it from side to side")]
    Outside {
        /// The curve.
        curve: usize,
    },
    /// A curve ends in a corner of the patch.
    #[error("feature curve {curve} ends in a corner of its patch - hint: end it on the side between the corners")]
    AtCorner {
        /// The curve.
        curve: usize,
    },
    /// The numbers of sections and curves do not agree.
    #[error("{given} sections along {family} are given, {needed} are between the curves - hint: give one number each")]
    SectionCount {
        /// `u` or `v`.
        family: &'static str,
        /// Sections given.
        given: usize,
        /// Sections there are.
        needed: usize,
    },
    /// More curves than a grid has room for.
    #[error(
        "{curves} feature curves across {cells} cells along {family} are too many - hint: raise the density, or give sections"
    )]
    TooFine {
        /// `u` or `v`.
        family: &'static str,
        /// Curves.
        curves: usize,
        /// Cells.
        cells: usize,
    },
    /// Feature curves of neighbouring patches end on their common curve so that no nodes suit both.
    #[error(
        "feature curves on both sides of curve {curve} ask for its nodes in different orders - hint: end them at the same places, or give the sections of one patch"
    )]
    EndsClash {
        /// The curve of the network.
        curve: usize,
    },
    /// Sections of patches in one row ask for different numbers of cells.
    #[error(
        "patch {patch} is given {given} cells where its row of patches has {other} - hint: give the same sum, or sections for one patch alone"
    )]
    SumsDiffer {
        /// The patch.
        patch: usize,
        /// Cells given.
        given: usize,
        /// Cells of the row.
        other: usize,
    },
    /// A feature curve names a patch that is not there.
    #[error("feature curve {curve} is in patch {patch}, there are {patches} - hint: delete it and draw it again")]
    NoSuchPatch {
        /// The curve.
        curve: usize,
        /// The patch named.
        patch: u32,
        /// Patches.
        patches: usize,
    },
    /// Part of the patch cannot be resampled.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The curves cannot be imprinted.
    #[error(transparent)]
    Imprint(#[from] ImprintError),
    /// Who relaxes patches in the place of this process has failed.
    #[error("the patches were not relaxed: {what}")]
    Elsewhere {
        /// Why.
        what: String,
    },
}
