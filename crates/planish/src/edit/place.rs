//! Places, corners and curves as a script names them (`docs/guide/edit.md`).

use crate::mesh::FacePoint;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A place as a script names it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    deny_unknown_fields,
    expecting = "a place is [x, y, z], { face = .., bary = [..] } or { corner = .. }"
)]
pub enum Spot {
    /// A world position; the nearest place of the mesh is meant.
    Position([f64; 3]),
    /// A place by its face.
    Place(FacePoint),
    /// A corner of the network.
    Corner {
        /// Its number.
        corner: u32,
    },
}

/// A corner, a curve of the network or a feature curve as a script names it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, deny_unknown_fields, expecting = "a number counted from 0, or { near = [x, y, z] }, is wanted")]
pub enum Name {
    /// By its number.
    Number(u32),
    /// By a world position: the nearest one is meant.
    Near {
        /// World units.
        near: [f64; 3],
    },
}

/// A curve as a script names it: one of the network, or a feature curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    deny_unknown_fields,
    expecting = "a number counted from 0, { near = [x, y, z] } or { feature = .. } is wanted"
)]
pub enum CurveName {
    /// A curve of the network.
    Network(Name),
    /// A feature curve.
    Feature {
        /// Which one.
        feature: Name,
    },
}

/// A curve by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CurveNumber {
    /// One of the network.
    Curve(u32),
    /// A feature curve.
    Feature(u32),
}

/// Share of the diagonal within which picks go to what is there.
pub(super) fn usual_snap() -> f64 {
    0.01
}
