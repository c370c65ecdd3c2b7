//! What draws, holds and moves curves: scalars ([K98] §3.8.2), weights of snakes (§3.6.2), moves of a space curve (§3.3.3).

use crate::curve::{SnakeParams, Sweep};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A scalar by its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Scalar {
    /// Luminance of the colour of the vertices.
    Luminance,
    /// A channel of an attribute of the vertices, counted from 0.
    Channel {
        /// Name of the attribute.
        attribute: String,
        /// Channel.
        channel: usize,
    },
    /// Mean curvature.
    MeanCurvature,
    /// Gaussian curvature.
    GaussianCurvature,
    /// The greater principal curvature by size.
    MaximumCurvature,
    /// One number per vertex.
    Values(Vec<f64>),
}

/// What a curve is drawn to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pull {
    /// The scalar; curves go to high values.
    pub scalar: Scalar,
    /// True to go to low values.
    #[serde(default)]
    pub low: bool,
    /// Rounds of blending with the neighbours before, which reach about the root of them in edges.
    #[serde(default = "usual_blending")]
    pub blending: usize,
    /// Weight against the forces of the curve.
    #[serde(default = "usual_weight")]
    pub weight: f64,
}

fn usual_blending() -> usize {
    20
}

fn usual_weight() -> f64 {
    10.0
}

/// What a magnetic stroke is drawn to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Magnetism {
    /// Edges sharper than this many degrees.
    Sharp(f64),
    /// Ridges and valleys: high curvature by size.
    Creases,
    /// High values of a scalar.
    Scalar(Scalar),
}

/// How curves relax.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Forces {
    /// Weight of shortness.
    pub fairness: f64,
    /// Weight of stiffness.
    pub curvature: f64,
    /// Weight of even spacing.
    pub arc_length: f64,
    /// Sweeps at most.
    pub sweeps: usize,
    /// Done when no point moves further in a sweep than this share of their distance.
    pub settle: f64,
    /// How points are moved.
    pub sweep: Sweep,
}

impl Default for Forces {
    fn default() -> Forces {
        Forces { fairness: 0.1, curvature: 1.0, arc_length: 1.0, sweeps: 200, settle: 1e-4, sweep: Sweep::CoarseToFine }
    }
}

impl Forces {
    pub(super) fn params(&self) -> SnakeParams {
        let Forces { fairness, curvature, arc_length, sweeps, settle, sweep } = *self;
        SnakeParams { fairness, curvature, arc_length, sweeps, settle, sweep, attraction: 0.0 }
    }
}

/// A move of a space curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    deny_unknown_fields,
    expecting = "a move is { vertex = .., by = [x, y, z] } or { at = .., by = [x, y, z] }"
)]
pub enum SplineMove {
    /// A control vertex, counted from 0, by a vector.
    Control {
        /// The control vertex.
        vertex: usize,
        /// World units.
        by: [f64; 3],
    },
    /// The edit point at a share of the curve, by a vector.
    Edit {
        /// 0 to 1.
        at: f64,
        /// World units.
        by: [f64; 3],
    },
}
