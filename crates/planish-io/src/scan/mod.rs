//! Scans from and to files: the format by the extension.
//!
//! Every reader gives one [`Cloud`]: positions in `f64` less a shift for large coordinates, attributes by name, scanner
//! positions where the file knows them. Points that are marked invalid in the file are left out; coordinates that are
//! not numbers stay and are dropped by the cleaning, so that counts agree with other readers.

mod e57;
mod las;
mod npy;
mod pcd;
mod table;
mod views;

pub use table::check_columns;

use crate::{Place, ReadError, WriteError, atomic, ply};
use glam::DVec3;
use planish::Units;
use planish::cloud::Cloud;
use planish::mesh::Attribute;
use std::path::Path;

/// What the readers of scans are told.
#[derive(Clone, Debug, Default)]
pub struct ScanOptions {
    /// Columns of a text file, e.g. `xyzirgb`, or names parted by commas; `_` or `-` skips one. A guess if empty.
    pub columns: Option<String>,
    /// Classes of a LAS file that are kept; all if empty.
    pub classes: Vec<u8>,
}

/// Extensions that always mean a scan.
pub const SCAN_EXTENSIONS: [&str; 11] = ["e57", "las", "laz", "pcd", "xyz", "txt", "csv", "asc", "pts", "npz", "conf"];
/// Extensions that can be written.
pub const WRITTEN_SCANS: [&str; 5] = ["ply", "las", "laz", "e57", "xyz"];

/// True if the file is a scan: by its extension, for `.ply` by the absence of faces, for `.npy` by a shape of rows.
pub fn is_scan(path: &Path) -> bool {
    let extension = lower(path);
    if SCAN_EXTENSIONS.contains(&extension.as_str()) {
        return true;
    }
    match extension.as_str() {
        "ply" => crate::mesh_file::content(path).is_ok_and(|bytes| ply::is_points(&bytes)),
        "npy" => crate::mesh_file::content(path).is_ok_and(|bytes| npy::is_table(&bytes)),
        _ => false,
    }
}

/// Reads a scan: E57, LAS, LAZ, PLY, PCD, XYZ, TXT, CSV, ASC, PTS, NPY, NPZ, and CONF with the PLY views that it names.
/// # Errors
/// Everything that [`ReadError`] lists. No file makes it panic.
pub fn read_scan(path: impl AsRef<Path>, options: &ScanOptions) -> Result<Cloud, ReadError> {
    let mut cloud = read_in_place(path.as_ref(), options)?;
    shift(&mut cloud);
    Ok(cloud)
}

/// As [`read_scan`], without the points that are too far off to be of the scan ([`crate::far::body`]); and how many these are.
/// # Errors
/// As [`read_scan`].
pub fn read_body(path: impl AsRef<Path>, options: &ScanOptions) -> Result<(Cloud, usize), ReadError> {
    let mut cloud = read_in_place(path.as_ref(), options)?;
    let count = cloud.points.len();
    if let Some(body) = crate::far::body(&cloud.points) {
        cloud = cloud.select(&body);
    }
    shift(&mut cloud);
    let left_out = count - cloud.points.len();
    Ok((cloud, left_out))
}

fn read_in_place(path: &Path, options: &ScanOptions) -> Result<Cloud, ReadError> {
    let extension = lower(path);
    let bytes = crate::mesh_file::content(path)?;
    if bytes.is_empty() {
        return Err(ReadError::Empty);
    }
    let cloud = match extension.as_str() {
        "e57" => e57::read(bytes)?,
        "las" | "laz" => las::read(bytes, &options.classes)?,
        "pcd" => pcd::read(&bytes)?,
        "ply" => {
            let mesh = ply::read_points(&bytes)?;
            Cloud { points: mesh.points, attributes: mesh.attributes, ..Cloud::default() }
        }
        "npy" | "npz" => npy::read(&bytes)?,
        "conf" => views::read(&bytes, path)?,
        "xyz" | "txt" | "csv" | "asc" | "pts" => table::read(&bytes, &extension, options.columns.as_deref())?,
        _ => {
            let known = SCAN_EXTENSIONS.iter().chain(&["ply", "npy"]).map(|e| format!(".{e}")).collect::<Vec<_>>();
            return Err(ReadError::UnknownExtension { extension, known: known.join(", ") });
        }
    };
    if cloud.points.is_empty() {
        return Err(ReadError::NoPoints);
    }
    if cloud.points.len() >= u32::MAX as usize {
        let (count, limit) = (cloud.points.len() as u64, u32::MAX as u64 - 1);
        return Err(ReadError::TooLarge { what: "points", count, limit, place: Place::Byte(0) });
    }
    Ok(cloud)
}

/// Moves a cloud with large coordinates near the origin by whole numbers, so that single precision loses nothing
/// that matters and the way back is exact.
fn shift(cloud: &mut Cloud) {
    let by = crate::shift_of(&cloud.bounds());
    if by != DVec3::ZERO && cloud.shift == DVec3::ZERO {
        cloud.shift = by;
        cloud.points.iter_mut().chain(&mut cloud.scanners).for_each(|p| *p -= by);
    }
}

/// Writes a scan: `.ply`, `.las`, `.laz`, `.e57` or `.xyz`, with the shift added again. The file appears whole or not at all.
/// # Errors
/// [`WriteError::UnknownExtension`], [`WriteError::Nothing`] for no points, [`WriteError::Value`] for coordinates that
/// are no numbers.
pub fn write_scan(path: impl AsRef<Path>, cloud: &Cloud) -> Result<(), WriteError> {
    write_scan_in(path, cloud, Units::M)
}

/// As [`write_scan`], for a cloud in `units`: E57 is in metres by its standard; the other formats do not say.
/// # Errors
/// As [`write_scan`].
pub fn write_scan_in(path: impl AsRef<Path>, cloud: &Cloud, units: Units) -> Result<(), WriteError> {
    let path = path.as_ref();
    let extension = lower(path);
    if !WRITTEN_SCANS.contains(&extension.as_str()) {
        let known = WRITTEN_SCANS.map(|e| format!(".{e}")).join(", ");
        return Err(WriteError::UnknownExtension { extension, known });
    }
    if cloud.points.is_empty() {
        return Err(WriteError::Nothing("the scan has no points"));
    }
    if let Some(v) = cloud.points.iter().position(|p| !p.is_finite()) {
        return Err(WriteError::Value {
            value: format!("the position {}", cloud.points[v]),
            place: Place::Vertex(v),
            hint: "clean the scan first",
        });
    }
    for (k, a) in cloud.attributes.iter().enumerate() {
        if a.values.len() != a.width * cloud.points.len() {
            let what = format!("attribute \"{}\" does not have {} numbers per point", a.name, a.width);
            return Err(WriteError::Inconsistent { what, place: Place::Item("attribute", k) });
        }
    }
    let world: Vec<DVec3> = cloud.points.iter().map(|&p| p + cloud.shift).collect();
    match extension.as_str() {
        "ply" => atomic::write(path, |out| {
            ply::write_points(out, &world, &cloud.attributes, &format!("planish {}", env!("CARGO_PKG_VERSION")))
        }),
        "las" | "laz" => atomic::write(path, |out| las::write(out, &world, cloud, extension == "laz")),
        "e57" => atomic::write_at(path, |at| e57::write(at, &world, cloud, units.metres())),
        _ => atomic::write(path, |out| table::write(out, &world, cloud)),
    }
}

fn lower(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

/// An attribute from a column of numbers.
fn column(name: &str, width: usize, values: Vec<f32>) -> Attribute {
    Attribute { name: name.into(), width, values }
}

/// What a library that reads for us says, as an error of ours.
fn foreign(what: impl std::fmt::Display) -> ReadError {
    let text: String = what.to_string().chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    ReadError::Syntax { what: text, place: Place::Byte(0) }
}

/// Runs a reader of a library that might panic on damaged data, and tells that as an error.
fn guarded<T>(work: impl FnOnce() -> Result<T, ReadError> + std::panic::UnwindSafe) -> Result<T, ReadError> {
    std::panic::catch_unwind(work).unwrap_or_else(|_| Err(foreign("the content contradicts itself")))
}
