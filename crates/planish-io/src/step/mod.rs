//! STEP (ISO 10303-21): B-spline patches as AP242 (`write`), and faces of any of its protocols as triangles (`read`).

mod read;
mod text;
mod write;

pub(crate) use read::{read, units};
pub use write::{StepInput, StepSummary, write_step};
