//! Edits of feature curves and of the sections between them ([K98] §5.10, §5.11.4).

mod delete_feature;
mod draw_feature;
mod sections;

pub use delete_feature::DeleteFeature;
pub(super) use delete_feature::delete;
pub use draw_feature::Feature;
pub use sections::Sections;

use crate::grid::{self, Family};

/// Takes back the cells that are given across curves of a family: with one curve more or less they are of other
/// sections.
fn forget_cells(sections: &mut Vec<(u32, grid::Sections)>, patch: u32, family: Family) {
    for (_, cells) in sections.iter_mut().filter(|s| s.0 == patch) {
        match family {
            Family::V => cells.u.clear(),
            Family::U => cells.v.clear(),
        }
    }
    sections.retain(|(_, cells)| !cells.u.is_empty() || !cells.v.is_empty());
}
