//! Sharp lines of a mesh: where they run, and how their vertices come to lie on them.
//!
//! The extraction of a scan tags edges as sharp where two sheets of its field meet. The tags have gaps and spurs, and
//! noise puts their vertices beside the true edge. [`mend_lines`] makes whole lines of them; [`fair_lines`] moves
//! them to where the surfaces on both sides meet. See `docs/methods/sharp.md`; alternatives are in
//! `docs/decisions/0016-sharp-line-alternatives.md`.

mod bent;
mod broken_lines;
mod fair_lines;
mod flanks;
mod lines;
mod merging;
mod rounded;

pub(crate) use bent::split_bent;
pub use broken_lines::mend_lines;
pub(crate) use broken_lines::{bridge_gaps, cut_spikes};
pub use fair_lines::fair_lines;
pub use flanks::ScanScale;
