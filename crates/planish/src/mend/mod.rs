//! Meshes made fit for use: one manifold surface without slivers, tiny handles, holes or ragged boundaries.
//!
//! See `docs/methods/mend.md`.

mod border;
mod handles;
mod holes;
mod lids;
mod repair;
mod repairs;
pub(crate) mod rims;
mod slivers;
mod trim;

pub use border::{MendParams, even_borders};
pub(crate) use holes::close_around;
pub use holes::{close_hole, close_holes};
pub use repair::{part_fans, repair, weld};
pub use repairs::Repairs;
pub(crate) use rims::finish;
pub use trim::trim;
