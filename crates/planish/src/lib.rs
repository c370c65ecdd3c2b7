//! planish turns scans and dense triangle meshes into networks of B-spline patches with displacement maps.
//!
//! Pure computing: no files, no command line. Data flows one way; a stage knows the stages before it and
//! nothing of those after it ([`pipeline`] alone knows their order).
//!
//! ```
//! use planish::synthetic::shapes;
//! use planish::layout::LayoutParams;
//! use planish::pipeline::{self, PipelineParams};
//!
//! let ball = shapes::sphere(10.0, 4);
//! let params = PipelineParams { layout: LayoutParams { patches: 24, ..Default::default() }, ..Default::default() };
//! let fitted = pipeline::fit(&ball, None, None, &params, &planish::Silent)?;
//! assert_eq!(fitted.model.surfaces.len(), fitted.model.network.patches.len());
//! // Surface plus relief is the grid again, to rounding.
//! assert!(fitted.quality["relief.rounding_max_rel"].value() < 1e-12);
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
pub mod relief;
pub mod render;
pub mod sharp;
pub mod surface;
pub mod synthetic;

pub use glam::{DVec2, DVec3};
pub use model::{HistoryEntry, Model, Units, UnknownUnit};
pub use observe::{Observer, Silent};
