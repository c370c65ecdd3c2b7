//! planish turns scans and dense triangle meshes into networks of B-spline patches with displacement maps.
//!
//! Pure computing: no files, no command line. Data flows one way; a stage knows the stages before it and
//! nothing of those after it ([`pipeline`] alone knows their order).

pub mod geom;
pub mod grid;
pub mod linalg;
pub mod mesh;
pub mod model;
pub mod network;
pub mod observe;
pub mod pipeline;
pub mod relief;
pub mod render;
pub mod surface;

pub use glam::{DVec2, DVec3};
pub use model::{HistoryEntry, Model, Units, UnknownUnit};
pub use observe::{Observer, Silent};
