//! Everything that enters or leaves planish: meshes, STEP, displacement images, the project file.
//!
//! One file or folder per format. Readers take the whole file into memory, believe no count that the rest of
//! the file has no room for, and say what is wrong and where. Writers leave either the finished file or
//! nothing ([`atomic`]).

pub mod atomic;
mod error;
mod export;
mod gltf;
mod grid_file;
mod mesh_file;
mod network_file;
mod obj;
mod place;
mod ply;
mod polygon;
pub mod project;
mod relief_files;
pub mod report;
mod scan;
pub mod script;
mod step;
mod stl;
mod text;
mod weld;

pub use error::{ReadError, WriteError};
pub use export::{ExportKind, export, export_kind, export_mesh};
pub use grid_file::{is_grid, read_grid};
pub use mesh_file::{MeshFormat, Up, WriteOptions, read_mesh, read_tagged_mesh, write_mesh, write_tagged_mesh};
pub use network_file::{NetworkFileError, read_network, write_network};
pub use place::Place;
pub use project::{ProjectError, read_model, write_model};
pub use relief_files::{read_relief, relief_names, relief_roundtrip, write_relief};
pub use scan::{SCAN_EXTENSIONS, ScanOptions, WRITTEN_SCANS, is_scan, read_scan, write_scan};
pub use step::{StepInput, StepSummary, write_step};
