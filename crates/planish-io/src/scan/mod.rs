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
mod writer;

pub use table::check_columns;
pub use writer::ScanWriter;

use crate::{Place, ReadError, WriteError, atomic, ply};
use glam::DVec3;
use planish::Units;
use planish::cloud::Cloud;
use planish::mesh::{Attribute, TriMesh};
use std::fs::File;
use std::io::{BufReader, Read};
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
        "ply" => opened(path).is_ok_and(|mut file| ply::is_points(&mut file)),
        "npy" => crate::mesh_file::content(path).is_ok_and(|bytes| npy::is_table(&bytes)),
        _ => false,
    }
}

/// Points that the header of a scan tells of, or lines of a text; `None` for formats that are read whole, and for what is damaged.
pub fn points_told(path: &Path) -> Option<u64> {
    let mut file = opened(path).ok()?;
    match lower(path).as_str() {
        "e57" => e57::told(file).ok(),
        "las" | "laz" => las::told(file).ok(),
        "ply" => ply::told(&mut file).ok(),
        "xyz" | "txt" | "csv" | "asc" | "pts" => table::told(file).ok(),
        _ => None,
    }
}

fn opened(path: &Path) -> Result<BufReader<File>, ReadError> {
    crate::mesh_file::opened(path).map(BufReader::new)
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
    let mut cloud = Cloud::default();
    let ending = pieces(path, options, &mut |piece| {
        append(&mut cloud, piece);
        Ok(())
    })?;
    if cloud.points.is_empty() {
        return Err(ReadError::NoPoints);
    }
    if cloud.points.len() >= u32::MAX as usize {
        let (count, limit) = (cloud.points.len() as u64, u32::MAX as u64 - 1);
        return Err(ReadError::TooLarge { what: "points", count, limit, place: Place::Byte(0) });
    }
    cloud.attributes.retain(|a| !ending.bare.contains(&a.name.as_str()));
    scale_colors(&mut cloud.attributes, ending.color_scale);
    if cloud.scanners.is_empty() {
        cloud.seen_by.clear();
    }
    Ok(cloud)
}

/// What takes pieces of a scan.
pub type Take<'a> = dyn FnMut(Cloud) -> Result<(), ReadError> + 'a;

/// Points that are read at once.
const PIECE: usize = 1 << 16;

/// What is known of the attributes at the end of a file alone.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Ending {
    /// Those that the format has room for and no point of the file has.
    pub bare: Vec<&'static str>,
    /// What the three numbers of a colour are to be multiplied by, if they are not as they should be.
    pub color_scale: Option<f64>,
}

/// Brings the numbers of colours to what they should be.
/// * `scale` - as of [`Ending`]
pub(crate) fn scale_colors(attributes: &mut [Attribute], scale: Option<f64>) {
    let Some(scale) = scale else { return };
    for a in attributes.iter_mut().filter(|a| a.name == "color" && a.width == 3) {
        a.values.iter_mut().for_each(|x| *x = (f64::from(*x) * scale) as f32);
    }
}

/// Reads a scan piece by piece, where the format allows; else it is one piece. All pieces have the same attributes, and the last
/// one has all scanners.
/// # Errors
/// As of [`read_scan`], or what `take` says.
pub(crate) fn pieces(path: &Path, options: &ScanOptions, take: &mut Take) -> Result<Ending, ReadError> {
    let extension = lower(path);
    let file = opened(path)?;
    if file.get_ref().metadata()?.len() == 0 {
        return Err(ReadError::Empty);
    }
    let whole = || crate::mesh_file::content(path);
    let cloud = match extension.as_str() {
        "e57" => return e57::pieces(file, take),
        "las" | "laz" => return las::pieces(file, &options.classes, take),
        "ply" => {
            let mut points =
                |mesh: TriMesh| take(Cloud { points: mesh.points, attributes: mesh.attributes, ..Cloud::default() });
            return ply::pieces(file, PIECE, &mut points).map(|()| Ending::default());
        }
        "pcd" => pcd::read(&whole()?)?,
        "npy" | "npz" => npy::read(&whole()?)?,
        "conf" => views::read(&whole()?, path)?,
        "xyz" | "txt" | "csv" | "asc" | "pts" => {
            return table::pieces(file, &extension, options.columns.as_deref(), take);
        }
        _ => {
            let known = SCAN_EXTENSIONS.iter().chain(&["ply", "npy"]).map(|e| format!(".{e}")).collect::<Vec<_>>();
            return Err(ReadError::UnknownExtension { extension, known: known.join(", ") });
        }
    };
    take(cloud).map(|()| Ending::default())
}

/// Adds a piece of a scan to the rest.
fn append(cloud: &mut Cloud, piece: Cloud) {
    if cloud.points.is_empty() {
        *cloud = piece;
        return;
    }
    cloud.points.extend(piece.points);
    cloud.attributes.iter_mut().zip(piece.attributes).for_each(|(all, more)| all.values.extend(more.values));
    cloud.seen_by.extend(piece.seen_by);
    cloud.scanners = piece.scanners;
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
    let extension = written_extension(path)?;
    if cloud.points.is_empty() {
        return Err(WriteError::Nothing("the scan has no points"));
    }
    check(cloud)?;
    let world: Vec<DVec3> = cloud.points.iter().map(|&p| p + cloud.shift).collect();
    match extension.as_str() {
        "ply" => atomic::write(path, |out| ply::write_points(out, &world, &cloud.attributes, GENERATOR)),
        "las" | "laz" => atomic::write(path, |out| las::write(out, &world, cloud, extension == "laz")),
        "e57" => atomic::write_at(path, |at| e57::write(at, &world, cloud, units.metres())),
        _ => atomic::write(path, |out| table::write(out, &world, cloud)),
    }
}

/// The extension of a scan that can be written.
fn written_extension(path: &Path) -> Result<String, WriteError> {
    let extension = lower(path);
    if WRITTEN_SCANS.contains(&extension.as_str()) {
        return Ok(extension);
    }
    let known = WRITTEN_SCANS.map(|e| format!(".{e}")).join(", ");
    Err(WriteError::UnknownExtension { extension, known })
}

/// Refuses what no format can hold.
fn check(cloud: &Cloud) -> Result<(), WriteError> {
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
    Ok(())
}

/// What the files say they were written by.
const GENERATOR: &str = concat!("planish ", env!("CARGO_PKG_VERSION"));

fn lower(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

/// An attribute from a column of numbers.
fn column(name: &str, width: usize, values: Vec<f32>) -> Attribute {
    Attribute { name: name.into(), width, values }
}

/// Refuses a file that does not begin with the mark of its format.
fn check_mark(file: &mut impl Read, format: &'static str, mark: &str) -> Result<(), ReadError> {
    let mut found = vec![0; mark.len()];
    if file.read_exact(&mut found).is_err() || found != mark.as_bytes() {
        return Err(ReadError::WrongFormat {
            expected: format,
            found: "something else",
            hint: format!("name a file that begins with {mark}"),
        });
    }
    Ok(())
}

/// What a library that reads for us says, as an error of ours.
fn foreign(what: impl std::fmt::Display) -> ReadError {
    let text: String = what.to_string().chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    ReadError::Syntax { what: text, place: Place::Byte(0) }
}

/// Runs a reader of a library that might panic on damaged data, and tells that as an error.
fn guarded<T>(work: impl FnOnce() -> Result<T, ReadError>) -> Result<T, ReadError> {
    // What it was writing to is not looked at after an error.
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(work))
        .unwrap_or_else(|_| Err(foreign("the content contradicts itself")))
}
