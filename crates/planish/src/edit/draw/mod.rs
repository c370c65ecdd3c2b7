//! Edits that draw curves: one file each, with its check (`docs/guide/edit.md`).

mod boundaries;
mod carry;
mod complete;
mod cut;
mod extend;
mod feature_lines;
mod paint;
mod project;

pub use boundaries::Boundaries;
pub use carry::{Carry, carry_network};
pub use complete::Complete;
pub use cut::Cut;
pub use extend::Extend;
pub use feature_lines::FeatureLines;
pub use paint::Paint;
pub use project::Project;
