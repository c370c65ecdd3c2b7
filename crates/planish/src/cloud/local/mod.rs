//! Local fits: quadrics to the points of a ball ([X03] §4.1, §6.2), and what two or more of them say together about a place.

pub(crate) mod fit;
pub(crate) mod fitted;
pub(crate) mod guides;
pub(crate) mod height;
pub(crate) mod joints;
pub(crate) mod moments;
pub(crate) mod nest;
pub(crate) mod points;
mod quadric;
pub(crate) mod weights;

pub use quadric::Quadric;
