//! Edits that change, move and delete what is drawn: one file each, with its check (`docs/guide/edit.md`).

mod add_corner;
mod clear;
mod continuity;
mod delete_corner;
mod delete_curves;
mod drag_corner;
mod drag_curve;
mod join;
pub(super) mod mirror;
mod relax;
mod spline;
mod split_curve;
mod split_region;
mod symmetry;

pub use add_corner::AddCorner;
pub use clear::Clear;
pub use continuity::Continuity;
pub use delete_corner::DeleteCorner;
pub use delete_curves::DeleteCurves;
pub use drag_corner::DragCorner;
pub use drag_curve::DragCurve;
pub use join::Join;
pub use mirror::{Mirror, mirror_network};
pub use relax::Relax;
pub use spline::{Spline, handles};
pub use split_curve::SplitCurve;
pub use split_region::SplitRegion;
pub use symmetry::Symmetry;
