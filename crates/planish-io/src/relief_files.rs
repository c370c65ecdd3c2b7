//! Displacement maps as OpenEXR images with a sidecar.
//!
//! One image per patch, 32-bit float, ZIP (lossless): `R` = tangent `t`, `G` = bitangent `b`, `B` = normal `n` in
//! the frame of [`planish::relief::Relief`], in units of the model, with zero for no displacement. (Blender reads
//! tangent-space vector maps as R = tangent, G = normal, B = bitangent: swap G and B there.)
//!
//! The pixels are the values at the *nodes* of the grid, its border included, not at the centres of texels: a
//! map of n pixels is sampled at `(u (n - 1) + 0.5) / n`, so that neighbouring patches agree along their seam. The
//! image stands upright as textures do: its top row is `v = 1`, row `y` is grid row `rows - 1 - y`.

use crate::{Place, ReadError, WriteError, atomic};
use exr::prelude::*;
use planish::grid::Grid;
use planish::relief::{self, Relief};
use planish::surface::Surface;
use planish::{DVec3, Units};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::Path;
use std::result::Result; // the image library brings one of its own

/// Version of the sidecar that is written, and the newest that is read.
const VERSION: u32 = 1;
/// Deflate makes data at most 1032 times smaller: an image that claims more than this is lying.
const LARGEST_RATIO: u64 = 1100;
/// Name of the sidecar.
pub const SIDECAR: &str = "relief.json";

/// The sidecar `relief.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Sidecar {
    planish_relief: u32,
    generator: String,
    /// Unit of the displacements.
    units: Units,
    /// Orthonormal frame of the surface that the vectors are meant in.
    frame: String,
    /// What the channels hold.
    channels: Channels,
    /// `node`: the first and the last pixel lie on the border of the patch.
    sampling: String,
    /// Where to sample a row of `n` pixels for the parameter `u`; the same for `v` with the image's height.
    uv: String,
    /// Which row of the image is which row of the grid.
    rows: String,
    /// Value of no displacement.
    mid_level: f64,
    /// Largest length of a displacement of all patches.
    largest: f64,
    patches: Vec<Entry>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Channels {
    #[serde(rename = "R")]
    r: String,
    #[serde(rename = "G")]
    g: String,
    #[serde(rename = "B")]
    b: String,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Entry {
    patch: usize,
    file: String,
    width: usize,
    height: usize,
    largest: f64,
}

/// Writes one EXR per patch and `relief.json` into `folder`, which is made if it is not there. The sidecar is
/// written last: where it is, all images are.
/// # Errors
/// `WriteError::Nothing` without reliefs; `WriteError::Inconsistent` for a relief whose number of vectors is not
/// its size; `WriteError::Value` for a displacement that is not finite as `f32`.
pub fn write_relief(folder: impl AsRef<Path>, reliefs: &[Relief], units: Units) -> Result<(), WriteError> {
    let folder = folder.as_ref();
    if reliefs.is_empty() {
        return Err(WriteError::Nothing("the model has no reliefs"));
    }
    for (p, relief) in reliefs.iter().enumerate() {
        let place = Place::Item("patch", p);
        if relief.vectors.len() != relief.rows * relief.cols || relief.vectors.is_empty() {
            let what = format!("{} vectors for {} x {}", relief.vectors.len(), relief.rows, relief.cols);
            return Err(WriteError::Inconsistent { what, place });
        }
        if let Some(d) = relief.vectors.iter().find(|d| !d.as_vec3().is_finite()) {
            let hint = "bake the relief again";
            return Err(WriteError::Value { value: format!("displacement {d}"), place, hint });
        }
    }
    std::fs::create_dir_all(folder)?;
    let mut patches = Vec::new();
    for (patch, relief) in reliefs.iter().enumerate() {
        let file = format!("patch_{patch:04}.exr");
        write_image(&folder.join(&file), relief)?;
        let largest = relief.vectors.iter().map(|d| d.length()).fold(0.0, f64::max);
        patches.push(Entry { patch, file, width: relief.cols, height: relief.rows, largest });
    }
    let sidecar = Sidecar {
        planish_relief: VERSION,
        generator: concat!("planish ", env!("CARGO_PKG_VERSION")).into(),
        units,
        frame: "tangent = S_u / |S_u|, normal = S_u x S_v / |S_u x S_v|, bitangent = normal x tangent".into(),
        channels: Channels { r: "tangent".into(), g: "bitangent".into(), b: "normal".into() },
        sampling: "node".into(),
        uv: "(u (n - 1) + 0.5) / n".into(),
        rows: "top row is v = 1".into(),
        mid_level: 0.0,
        largest: patches.iter().map(|p| p.largest).fold(0.0, f64::max),
        patches,
    };
    let text = serde_json::to_string_pretty(&sidecar).map_err(|e| WriteError::Image(e.to_string()))?;
    atomic::write(&folder.join(SIDECAR), |out| Ok(writeln!(out, "{text}")?))
}

fn write_image(path: &Path, relief: &Relief) -> Result<(), WriteError> {
    let (width, height) = (relief.cols, relief.rows);
    let at = |pixel: Vec2<usize>| {
        let d = relief.vectors[(height - 1 - pixel.y()) * width + pixel.x()].as_vec3();
        (d.x, d.y, d.z)
    };
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: exr::image::Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let layer = Layer::new((width, height), LayerAttributes::default(), encoding, SpecificChannels::rgb(at));
    let mut bytes = std::io::Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).map_err(|e| WriteError::Image(e.to_string()))?;
    atomic::write(path, |out| Ok(out.write_all(bytes.get_ref())?))
}

/// True for the name of a map that [`write_relief`] may write, and for that of the sidecar.
pub fn is_relief_name(name: &str) -> bool {
    let Some((stem, extension)) = name.rsplit_once('.') else { return false };
    if !["exr", "png", "tif"].contains(&extension) {
        return name == SIDECAR;
    }
    let number = stem.strip_prefix("patch_").or_else(|| stem.strip_prefix("relief."));
    stem == "atlas" || number.is_some_and(|n| n.len() >= 4 && n.bytes().all(|b| b.is_ascii_digit()))
}

/// Names of the maps that the sidecar in a folder lists, and its own; none where there is no sidecar of this program.
pub fn relief_names(folder: impl AsRef<Path>) -> Vec<String> {
    #[derive(Deserialize)]
    struct Names {
        #[serde(rename = "planish_relief")]
        _version: u32,
        patches: Vec<Name>,
        #[serde(default)]
        images: Vec<Name>,
        #[serde(default)]
        attributes: Vec<Files>,
        #[serde(default)]
        companions: Vec<String>,
    }
    /// A patch of the first version, an image of the second.
    #[derive(Deserialize)]
    struct Name {
        #[serde(default)]
        file: String,
    }
    #[derive(Deserialize)]
    struct Files {
        #[serde(default)]
        files: Vec<String>,
    }
    let Ok(text) = crate::mesh_file::bytes_of(&folder.as_ref().join(SIDECAR)) else { return Vec::new() };
    let Ok(names) = serde_json::from_slice::<Names>(&text) else { return Vec::new() };
    // A name with a folder in it would lead elsewhere.
    let is_plain = |name: &String| Path::new(name).file_name().is_some_and(|n| n == name.as_str());
    let files = names.patches.into_iter().chain(names.images).map(|n| n.file);
    let files = files.chain(names.attributes.into_iter().flat_map(|a| a.files)).chain(names.companions);
    files.filter(|name| !name.is_empty() && is_plain(name)).chain([SIDECAR.into()]).collect()
}

/// Reads what [`write_relief`] wrote; returns the reliefs in the order of the patches, and their unit.
/// # Errors
/// `ReadError` for a folder without sidecar, a newer sidecar, other channels or sampling than those above, an image
/// that is missing, damaged, of another size than the sidecar says or with values that are not finite.
pub fn read_relief(folder: impl AsRef<Path>) -> Result<(Vec<Relief>, Units), ReadError> {
    let folder = folder.as_ref();
    let text = crate::mesh_file::bytes_of(&folder.join(SIDECAR)).map_err(|source| ReadError::Companion {
        name: SIDECAR.into(),
        source,
        place: Place::Byte(0),
    })?;
    let sidecar: Sidecar = serde_json::from_slice(&text).map_err(|e| ReadError::Syntax {
        what: format!("{SIDECAR} is not a relief: {}", e.to_string().split(" at line ").next().unwrap_or_default()),
        place: Place::Line(e.line()),
    })?;
    let unsupported = |what: String| {
        let hint = "write the relief with this version of planish";
        Err(ReadError::Unsupported { what, place: Place::Line(1), hint })
    };
    if sidecar.planish_relief > VERSION {
        return unsupported(format!("version {} of {SIDECAR}", sidecar.planish_relief));
    }
    let c = &sidecar.channels;
    if [c.r.as_str(), &c.g, &c.b, &sidecar.sampling, &sidecar.rows]
        != ["tangent", "bitangent", "normal", "node", "top row is v = 1"]
    {
        return unsupported("another order of channels, sampling or rows".into());
    }
    let mut reliefs = Vec::new();
    for (p, entry) in sidecar.patches.iter().enumerate() {
        let name = Path::new(&entry.file);
        if entry.patch != p || name.components().count() != 1 || name.file_name().is_none() {
            let what = format!("entry {p} of {SIDECAR} is out of order or names no file of its folder");
            return Err(ReadError::Syntax { what, place: Place::Item("patch", p) });
        }
        reliefs.push(read_image(&folder.join(name), entry)?);
    }
    Ok((reliefs, sidecar.units))
}

/// Largest distance of the surfaces with the displacement maps of `folder` to the grids that the maps were made of, units
/// of the model: what another program gets back of the grids. Maps hold single precision, so it is some 1e-7 of the
/// displacements.
/// # Errors
/// Those of [`read_relief`]; `ReadError::Syntax` for maps of another model.
pub fn relief_roundtrip(folder: impl AsRef<Path>, surfaces: &[Surface], grids: &[Grid]) -> Result<f64, ReadError> {
    let (reliefs, _) = read_relief(folder)?;
    if reliefs.len() != surfaces.len() || reliefs.len() != grids.len() {
        let what = format!("{} maps for {} surfaces and {} grids", reliefs.len(), surfaces.len(), grids.len());
        return Err(ReadError::Syntax { what, place: Place::Line(1) });
    }
    let mut largest: f64 = 0.0;
    for (p, ((relief, surface), grid)) in reliefs.iter().zip(surfaces).zip(grids).enumerate() {
        let other = |what: String| ReadError::Syntax { what, place: Place::Item("patch", p) };
        let points = relief::displace(surface, relief).map_err(|e| other(e.to_string()))?;
        if (relief.rows, relief.cols, points.len()) != (grid.rows, grid.cols, grid.points.len()) {
            let (map, nodes) = ((relief.cols, relief.rows), (grid.cols, grid.rows));
            return Err(other(format!("a map of {map:?} pixels for a grid of {nodes:?} nodes")));
        }
        largest = points.iter().zip(&grid.points).map(|(a, b)| a.distance(*b)).fold(largest, f64::max);
    }
    Ok(largest)
}

/// Size and channels of an EXR image, by its header: columns, rows, names.
/// # Errors
/// `ReadError` for what is no EXR image.
pub fn image_facts(path: impl AsRef<Path>) -> Result<(usize, usize, Vec<String>), ReadError> {
    let bytes = crate::mesh_file::content(path.as_ref())?;
    let damaged = |what: String| ReadError::Syntax { what, place: Place::Byte(0) };
    let meta = exr::meta::MetaData::read_from_buffered(std::io::Cursor::new(&bytes), false);
    let meta = meta.map_err(|e| damaged(e.to_string()))?;
    let header = meta.headers.first().ok_or_else(|| damaged("the image has no layer".into()))?;
    let names = header.channels.list.iter().map(|c| c.name.to_string()).collect();
    Ok((header.layer_size.x(), header.layer_size.y(), names))
}

fn read_image(path: &Path, entry: &Entry) -> Result<Relief, ReadError> {
    let place = || Place::Item("patch", entry.patch);
    let damaged = |what: String| ReadError::Syntax { what: format!("{}: {what}", entry.file), place: place() };
    let failed = |source| ReadError::Companion { name: entry.file.clone(), source, place: place() };
    let bytes = crate::mesh_file::bytes_of(path).map_err(failed)?;
    let pixels = (entry.width as u64).saturating_mul(entry.height as u64);
    // Twelve bytes a pixel, before they were compressed.
    if pixels.saturating_mul(12) > (bytes.len() as u64).saturating_mul(LARGEST_RATIO) {
        return Err(damaged(format!("{} x {} pixels are more than it can hold", entry.width, entry.height)));
    }
    let meta = exr::meta::MetaData::read_from_buffered(std::io::Cursor::new(&bytes), false);
    let meta = meta.map_err(|e| damaged(e.to_string()))?;
    let size = meta.headers.first().map(|h| h.layer_size);
    if meta.headers.len() != 1 || size != Some(Vec2(entry.width, entry.height)) {
        return Err(damaged(format!("it is not one layer of {} x {} pixels", entry.width, entry.height)));
    }
    let image = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let image = image.from_buffered(std::io::Cursor::new(&bytes)).map_err(|e| damaged(e.to_string()))?;
    let channel = |name: &str| {
        let list = &image.layer_data.channel_data.list;
        match list.iter().find(|c| c.name == *name).map(|c| &c.sample_data) {
            Some(FlatSamples::F32(samples)) if samples.len() as u64 == pixels => Ok(samples),
            _ => Err(damaged(format!("it has no 32-bit float channel {name}"))),
        }
    };
    let (t, b, n) = (channel("R")?, channel("G")?, channel("B")?);
    let (rows, cols) = (entry.height, entry.width);
    let mut vectors = Vec::with_capacity(rows * cols);
    for j in 0..rows {
        for i in 0..cols {
            let k = (rows - 1 - j) * cols + i;
            vectors.push(DVec3::new(t[k] as f64, b[k] as f64, n[k] as f64));
        }
    }
    if let Some(d) = vectors.iter().find(|d| !d.is_finite()) {
        return Err(damaged(format!("displacement {d} is not finite")));
    }
    Ok(Relief { rows, cols, vectors })
}
