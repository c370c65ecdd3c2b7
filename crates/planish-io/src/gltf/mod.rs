//! glTF 2.0, as `.gltf` with its buffers beside or inside it and as `.glb`.
//!
//! Own reader instead of a crate's: a mesh needs a small part of the format, accessors are checked against
//! their buffers before memory is taken, and nodes that form a ring are found. Nothing but numbers is read
//! from the files beside it, and none outside its folder.
//!
//! Coordinates are neither turned nor scaled on reading: what the nodes' transforms give is the result, by the
//! standard in metres with Y up.

mod document;
mod read;
mod write;

pub(crate) use read::read;
pub(crate) use write::{write, write_patches};
