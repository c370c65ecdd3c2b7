//! STEP (ISO 10303-21): B-spline patches as AP242 (`write`); faces of any of its protocols as triangles, or as the surfaces that they
//! are (`read`).

mod read;
mod style;
mod text;
mod write;

pub use read::read_step_surfaces;
pub(crate) use read::{read, units};
pub use write::{StepInput, StepSummary, write_step};
