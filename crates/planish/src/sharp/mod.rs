//! Sharp lines of a mesh: where they run, and how their vertices come to lie on them.
//!
//! Noise hides parts of the edges of a scan's mesh, and puts their vertices beside their place. [`find_lines`] labels the faces by the
//! sheets that they are parts of, whose borders are the lines; [`fair_lines`] moves them to where the surfaces on both sides
//! meet; [`tidy_lines`] takes out the slivers beside them. See `docs/methods/sharp.md`; alternatives are in `docs/decisions/0016-sharp-line-alternatives.md`.

mod bent;
mod borders;
mod broken_lines;
mod charts;
mod fair_lines;
mod flanks;
mod labels;
mod lines;
mod merging;
mod rounded;
mod slivers;

pub(crate) use bent::split_bent;
pub use borders::find_lines;
pub(crate) use broken_lines::{Fineness, bridge_gaps, cut_spikes};
pub use fair_lines::fair_lines;
pub use flanks::ScanScale;
pub use slivers::tidy_lines;
