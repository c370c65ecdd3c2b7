//! Tiles of a mesh: a PLY for each in a folder, and `tiles.json`, which says where each lies.

use crate::{WriteError, WriteOptions, write_tagged_mesh};
use glam::DVec3;
use planish::mesh::{FeatureTags, MeshParts, TileError, TriMesh, tiles};
use planish::observe::{Cancelled, Observer};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The list of the tiles.
pub const TILE_LIST: &str = "tiles.json";
/// Of the list.
const VERSION: u32 = 1;

#[derive(Serialize, Deserialize)]
struct TileList {
    planish_tiles: u32,
    generator: String,
    units: String,
    /// Side of the cubes.
    size: f64,
    triangles: usize,
    tiles: Vec<TileFile>,
}

#[derive(Serialize, Deserialize)]
struct TileFile {
    file: String,
    /// The cube from `size * tile` to `size * (tile + 1)`.
    tile: [i64; 3],
    triangles: usize,
    vertices: usize,
    min: [f64; 3],
    max: [f64; 3],
}

/// Why no tiles were written.
#[derive(Debug, thiserror::Error)]
pub enum TilesError {
    /// The mesh is not cut.
    #[error(transparent)]
    Tile(#[from] TileError),
    /// A file is not written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The observer no longer wanted them.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// Writes the tiles of a mesh into a folder and returns how many there are. Vertices on the border of two tiles have the same bits in both.
/// * `size` - side of a tile, units of the mesh
/// * `shift` - brings the mesh back to its place; tiles are those of the place
/// # Errors
/// [`TilesError`].
pub fn write_tiles(
    folder: &Path,
    mesh: &TriMesh,
    tags: &FeatureTags,
    (size, shift): (f64, DVec3),
    options: &WriteOptions,
    observer: &dyn Observer,
) -> Result<usize, TilesError> {
    let mut parts = MeshParts::new(mesh, tags);
    let mut list = TileList {
        planish_tiles: VERSION,
        generator: options.generator(),
        units: options.units.symbol().into(),
        size,
        triangles: mesh.triangles.len(),
        tiles: Vec::new(),
    };
    for (tile @ [i, j, k], faces) in tiles(mesh, size, shift)? {
        observer.check()?;
        let mut part = parts.part(&faces);
        part.mesh.points.iter_mut().for_each(|p| *p += shift);
        let file = format!("tile_{i}_{j}_{k}.ply");
        write_tagged_mesh(folder.join(&file), &part.mesh, &part.tags, options)?;
        let bounds = part.mesh.bounds();
        list.tiles.push(TileFile {
            file,
            tile,
            triangles: faces.len(),
            vertices: part.mesh.points.len(),
            min: bounds.min.to_array(),
            max: bounds.max.to_array(),
        });
    }
    let text = serde_json::to_string_pretty(&list).map_err(|e| WriteError::Io(e.into()))?;
    std::fs::write(folder.join(TILE_LIST), text + "\n").map_err(WriteError::Io)?;
    Ok(list.tiles.len())
}

/// True for a name that a file of [`write_tiles`] has.
pub fn is_tile_name(name: &str) -> bool {
    let places = name.strip_prefix("tile_").and_then(|n| n.strip_suffix(".ply"));
    let is_tile = |p: &str| p.split('_').count() == 3 && p.split('_').all(|n| n.parse::<i64>().is_ok());
    name == TILE_LIST || places.is_some_and(is_tile)
}

/// Names of the files that the list in a folder names, and its own; none where there is no list of this program.
pub fn tile_names(folder: &Path) -> Vec<String> {
    let Ok(text) = crate::mesh_file::bytes_of(&folder.join(TILE_LIST)) else { return Vec::new() };
    let Ok(list) = serde_json::from_slice::<TileList>(&text) else { return Vec::new() };
    let files = list.tiles.into_iter().map(|t| t.file).filter(|name| is_tile_name(name));
    files.chain([TILE_LIST.into()]).collect()
}
