//! Scalar grids (volume images), and how they are read.
//!
//! Input of [K01] §4.1; see `docs/methods/fields.md`.

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A regular grid of numbers, x fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct ScalarGrid {
    /// Samples along each axis.
    pub size: [usize; 3],
    /// Position of the first sample, world units.
    pub origin: DVec3,
    /// Distance between samples along each axis, world units.
    pub spacing: DVec3,
    /// The numbers. Shared: fields and meshes made from a volume do not copy it.
    pub values: Arc<Vec<f32>>,
}

/// How gradients are estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GradientRule {
    /// As trilinear, but beside sharp edges from the side on which the numbers go on straight; hits, too
    #[default]
    OneSided,
    /// Of the trilinear interpolant: the exact difference along the edge
    Trilinear,
    /// Central differences at the nodes, interpolated: smoother
    Central,
}

/// On which side of the level the body lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Body {
    /// Where numbers are below the level, as in distance fields
    #[default]
    Below,
    /// Where numbers are above the level, as in tomography
    Above,
}

/// How a grid is read as a field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GridParams {
    /// The level of the surface, in the grid's numbers
    pub iso: f64,
    /// On which side of the level the body lies
    pub body: Body,
    /// How normals are estimated
    pub gradient: GradientRule,
    /// Close the surface where it meets the border of the grid
    pub close: bool,
}

impl Default for GridParams {
    fn default() -> Self {
        GridParams { iso: 0.0, body: Body::Below, gradient: GradientRule::OneSided, close: true }
    }
}
