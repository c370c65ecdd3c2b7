//! The studio: a page that draws patches on a scan, and the server behind it. `planish studio` calls [`serve`].
//!
//! 1. `protocol` - what page and server say to each other: JSON for control, binary frames for geometry
//! 2. `desk` - the one thread that owns the project: edits, history, jobs, saving
//! 3. `web` - the page, sockets and uploads on the loopback interface
//!
//! See `docs/guide/studio.md` and `docs/decisions/0024-studio.md`.

mod desk;
mod error;
pub mod protocol;
mod web;

pub use error::StudioError;
pub use web::{Options, Place, has_page, serve};
