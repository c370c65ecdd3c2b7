//! Everything that enters or leaves planish: meshes, STEP, IGES, USD, displacement images, the project file.
//!
//! One file or folder per format. Readers take the whole file into memory, believe no count that the rest of
//! the file has no room for, and say what is wrong and where. Writers leave either the finished file or
//! nothing ([`atomic`]).

pub mod atomic;
mod bricks;
mod error;
mod export;
mod far;
mod gltf;
mod grid_file;
mod grid_write;
mod iges;
mod mapped;
pub mod maps;
mod mesh_file;
mod network_file;
mod obj;
mod obj_surface;
mod place;
mod ply;
mod polygon;
pub mod project;
mod rank;
mod relief_files;
pub mod report;
mod scan;
pub mod script;
mod step;
mod stl;
mod text;
mod tile_files;
mod topology;
mod usd;
mod usd_material;
mod weld;

pub use bricks::{BrickFolder, Gathered, Source};
pub use error::{ReadError, WriteError};
pub use export::{ExportKind, export, export_kind, export_mesh};
pub use far::{FileUnits, file_units, shift_of, single_step};
pub use grid_file::{is_grid, read_grid};
pub use grid_write::write_grid;
pub use iges::{IgesInput, IgesSummary, write_iges};
pub use mapped::MappedMesh;
pub use mesh_file::{
    MeshFormat, Up, WriteOptions, content as read_bytes, read_mesh, read_tagged_mesh, write_mesh, write_patches,
    write_tagged_mesh,
};
pub use network_file::{NetworkFileError, network_json, parse_network, read_network, write_network};
pub use obj_surface::{read_obj_surfaces, write_obj_surfaces};
pub use place::Place;
pub use project::{ProjectError, read_model, write_model};
pub use relief_files::{
    SIDECAR as RELIEF_SIDECAR, image_facts, is_relief_name, read_relief, relief_names, relief_roundtrip, write_relief,
};
pub use scan::{
    SCAN_EXTENSIONS, ScanOptions, ScanWriter, Take, WRITTEN_SCANS, check_columns, is_scan, points_told, read_body,
    read_scan, write_scan, write_scan_in,
};
pub use step::{StepInput, StepSummary, read_step_surfaces, write_step};
pub use tile_files::{TILE_LIST, TilesError, is_tile_name, tile_names, write_tiles};
pub use usd::{UsdInput, write_usd};
pub use usd_material::{UsdMaterial, UsdTexture};
