//! Feature curves: curves inside a patch that must become iso-curves of its grid.

pub(crate) mod curve;
pub(crate) mod network;
mod slide;
mod strand;
