//! Sharp lines of a mesh: where they run, and how their vertices come to lie on them.
//!
//! The extraction of a scan tags edges as sharp where two sheets of its field meet. The tags have gaps and spurs, and
//! noise puts their vertices beside the true edge. [`mend_lines`] makes whole lines of them; [`fair_lines`] moves
//! them to where the surfaces on both sides meet. See `docs/methods/sharp.md`; alternatives are in
//! `docs/decisions/0016-sharp-line-alternatives.md`.

mod bent;
mod borders;
mod broken_lines;
mod census;
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
pub use broken_lines::mend_lines;
pub(crate) use broken_lines::{bridge_gaps, cut_spikes};
pub use census::{
    Census, FOLDED_BACK_DEG, LinesFound, SLIVER, TRUE_EDGE_DEG, TURN_DEG, census, folded_back, lines_found,
};
pub use fair_lines::fair_lines;
pub use flanks::ScanScale;
pub use slivers::tidy_lines;
