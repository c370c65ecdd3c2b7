//! Everything that enters or leaves planish: meshes, STEP, displacement images, the project file.
//!
//! One file or folder per format. Readers take the whole file into memory, believe no count that the rest of
//! the file has no room for, and say what is wrong and where. Writers leave either the finished file or
//! nothing ([`atomic`]).

pub mod atomic;
mod error;
mod gltf;
mod mesh_file;
mod network_file;
mod obj;
mod place;
mod ply;
mod polygon;
pub mod report;
mod stl;
mod text;
mod weld;

pub use error::{ReadError, WriteError};
pub use mesh_file::{MeshFormat, Up, WriteOptions, read_mesh, write_mesh};
pub use network_file::{NetworkFileError, read_network, write_network};
pub use place::Place;
