//! planish turns scans and dense triangle meshes into networks of B-spline patches with displacement maps.
//!
//! Pure computing: no files, no command line. Data flows one way; a stage knows the stages before it and
//! nothing of those after it ([`pipeline`] alone knows their order).
//!
//! ```
//! use planish::layout::LayoutParams;
//! use planish::pipeline::{self, Input, PipelineParams, RunParams};
//! use planish::synthetic::shapes;
//!
//! let ball = shapes::sphere(10.0, 4);
//! // What is wanted otherwise than suits the input: a scan would be `Input::Scan(&cloud)`.
//! // Lengths are shares of the diagonal, which comes along.
//! let stages = |suited: PipelineParams, _diagonal: f64| PipelineParams { layout: LayoutParams { patches: 24, ..suited.layout }, ..suited };
//! let params = RunParams { stages: Box::new(stages), ..RunParams::default() };
//! let run = pipeline::run(Input::from(&ball), &params, &planish::Silent)?;
//! let model = &run.fitted.model;
//! assert_eq!(model.surfaces.len(), model.network.patches.len());
//! // Surface plus relief is the grid again, to rounding.
//! assert!(run.fitted.quality["relief.rounding_max_rel"].value() < 1e-12);
//! # Ok::<(), pipeline::PipelineError>(())
//! ```

pub mod cloud;
pub mod contour;
pub mod curve;
pub mod edit;
pub mod field;
pub mod geom;
pub mod grid;
pub mod layout;
pub mod linalg;
pub mod mend;
pub mod mesh;
pub mod model;
pub mod network;
pub mod observe;
pub mod pipeline;
pub mod register;
pub mod relief;
pub mod render;
pub mod sharp;
pub mod surface;
pub mod synthetic;

pub use glam::{DVec2, DVec3};
pub use model::{HistoryEntry, Model, Units, UnknownUnit};
pub use observe::{Observer, Silent};
