//! Maps of all kinds as images in a folder, and back.
//!
//! An image stands upright: its top row is `v = 1` (but where `upside_down` says otherwise). A texel is a node of the patch:
//! sampled at `(u (n - 1) + 0.5) / n` neighbouring patches agree along their seam.

mod image;
mod rounding;
mod sidecar;
mod wiring;

pub use image::MapFile;
pub use sidecar::{ImageEntry, PatchEntry, Sidecar};
pub use wiring::{materialx, usd_materials};

use crate::{Place, ReadError, WriteError};
use glam::DVec3;
use image::{Raster, Store};
use planish::Units;
use planish::relief::Relief;
use planish::relief::layers::Picture;
use planish::relief::maps::{self, MapKind, MapParams, PatchMap, Sheet, SheetKind};
use planish::surface::Surface;
use rayon::prelude::*;
use rounding::Rounded;
use sidecar::AttributeEntry;
use std::borrow::Cow;
use std::path::Path;

/// How maps are written.
#[derive(Clone, Debug)]
pub struct MapOptions {
    /// How they were made.
    pub params: MapParams,
    /// Kind of the files.
    pub file: MapFile,
    /// True where the first row of the images is `v = 0`.
    pub upside_down: bool,
    /// Largest error of a displacement that rounding may make, units of the model; `None` rounds as little as the file does.
    pub max_error: Option<f64>,
    /// How another program wires them. `{mid_level}`, `{scale}` and `{scale_cm}` in it become what the files have, the last one in
    /// centimetres.
    pub wiring: String,
    /// Sum over the relief that they were made of ([`relief_sum`]), to tell older maps; `None` if it is not known.
    pub relief: Option<u32>,
    /// Unit of the model.
    pub units: Units,
    /// Other files that are written beside the maps.
    pub companions: Vec<String>,
}

/// How numbers stand in the images.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Coding {
    store: Store,
    mid_level: f64,
    scale: f64,
}

impl Coding {
    fn new(kind: MapKind, maps: &[PatchMap], file: MapFile) -> Coding {
        let (mid_level, scale) = match (file.is_whole(), kind) {
            (false, _) => (0.0, 1.0),
            (true, MapKind::Normal) => (0.5, 2.0),
            (true, MapKind::Length) => (0.0, most(maps)),
            (true, _) => (0.5, 2.0 * most(maps)),
        };
        Coding { store: Store::new(file), mid_level, scale }
    }

    /// That of a vertex attribute: numbers from 0 to 1, as colours are, stay as they are; those below 0 lie below the middle.
    fn of_attribute(maps: &[PatchMap], file: MapFile) -> Coding {
        let all = || maps.iter().flat_map(|m| &m.values);
        let (mid_level, scale) = match file.is_whole() {
            true if all().any(|&x| x < 0.0) => (0.5, 2.0 * most(maps)),
            true if all().any(|&x| x > 1.0) => (0.0, most(maps)),
            _ => (0.0, 1.0),
        };
        Coding { store: Store::new(file), mid_level, scale }
    }

    /// That of rounded maps: whole numbers count steps, floats take 16 bits where these hold every number exactly.
    fn of_steps(rounded: &Rounded, file: MapFile) -> Coding {
        if !file.is_whole() {
            let half = Store { file, bits: 16 };
            let exact = |map: &PatchMap| map.values.iter().all(|&x| half.held(x) == x);
            let store = if rounded.maps.iter().all(exact) { half } else { Store::new(MapFile::Exr) };
            return Coding { store: Store { file, ..store }, mid_level: 0.0, scale: 1.0 };
        }
        let [low, high] = rounded.range;
        let bits = if file == MapFile::Png && high - low <= image::largest(8) as i64 { 8 } else { 16 };
        let steps = image::largest(bits) as i64;
        // In the middle, or as near to it as the range lets it.
        let zero = (steps / 2 + 1).clamp(-low, steps - high);
        let store = Store { file, bits };
        Coding { store, mid_level: zero as f64 / steps as f64, scale: rounded.step * steps as f64 }
    }

    /// What the image holds for a number.
    fn coded(&self, x: f32) -> f32 {
        self.store.held((x as f64 / self.scale + self.mid_level) as f32)
    }

    /// The number that the image means.
    fn meant(&self, held: f32) -> f32 {
        ((held as f64 - self.mid_level) * self.scale) as f32
    }
}

/// The largest number of some maps, its sign left out; 1 where there is none but 0.
fn most(maps: &[PatchMap]) -> f64 {
    let most = maps.iter().flat_map(|m| &m.values).map(|x| x.abs()).fold(0.0, f32::max) as f64;
    if most > 0.0 { most } else { 1.0 }
}

/// Maps as they are written, and how.
struct Prepared<'a> {
    maps: Cow<'a, [PatchMap]>,
    coding: Coding,
    /// The bound by which they were rounded, if they were.
    max_error: Option<f64>,
}

/// The maps as they are written: rounded if an error is allowed.
/// # Errors
/// `WriteError::TooFine` for a bound that such files cannot keep.
fn prepared(
    maps: &[PatchMap],
    kind: MapKind,
    file: MapFile,
    max_error: Option<f64>,
) -> Result<Prepared<'_>, WriteError> {
    let plain = Prepared { maps: Cow::Borrowed(maps), coding: Coding::new(kind, maps, file), max_error: None };
    let Some(error) = max_error.filter(|e| *e > 0.0) else { return Ok(plain) };
    if file.is_whole() {
        let least = rounding::least_whole(maps);
        if error < least {
            return Err(too_fine(error, least, "16-bit whole numbers"));
        }
    }
    let rounded = rounding::is_coarse(maps, error, file).then(|| rounding::rounded(maps, error, file));
    if let Some(rounded) = rounded {
        let coding = Coding::of_steps(&rounded, file);
        // 32-bit floats in files of halves would be no files of halves.
        if file != MapFile::ExrHalf || coding.store.bits == 16 {
            return Ok(Prepared { maps: Cow::Owned(rounded.maps), coding, max_error: Some(error) });
        }
    }
    // Floats are finer than the bound, or as near as they can be.
    let least = largest_error(maps, &held(maps, &plain.coding));
    if least > error {
        return Err(too_fine(error, least, "half floats"));
    }
    Ok(plain)
}

/// * `least` - the least error that these `numbers` can keep
fn too_fine(error: f64, least: f64, numbers: &str) -> WriteError {
    // Two digits, rounded up: what is told must do.
    let digit = 10f64.powf(least.log10().floor() - 1.0);
    let least = (least / digit).ceil() * digit;
    WriteError::TooFine(format!("{numbers} cannot keep an error of {error:e} here; the least they can is {least:.1e}"))
}

/// The numbers that images hold for those of maps, as they are read.
fn held(maps: &[PatchMap], coding: &Coding) -> Vec<PatchMap> {
    let one = |map: &PatchMap| PatchMap {
        values: map.values.iter().map(|&x| coding.meant(coding.coded(x))).collect(),
        ..*map
    };
    maps.par_iter().map(one).collect()
}

/// A sum over all displacements, to tell whether a relief is still the one that maps were made of.
pub fn relief_sum(reliefs: &[Relief]) -> u32 {
    sum_over(reliefs.iter().map(|r| (r.rows, r.cols, &r.vectors[..])))
}

/// A sum over rows, columns and vectors.
fn sum_over<'a>(all: impl Iterator<Item = (usize, usize, &'a [DVec3])>) -> u32 {
    let mut sum = crc32fast::Hasher::new();
    for (rows, cols, vectors) in all {
        sum.update(&(rows as u64).to_le_bytes());
        sum.update(&(cols as u64).to_le_bytes());
        vectors.iter().flat_map(|d| d.to_array()).for_each(|x| sum.update(&x.to_le_bytes()));
    }
    sum.finalize()
}

/// What the texels of maps are, as images tell it themselves: kind, and of vectors frame and order.
fn meaning(params: &MapParams) -> String {
    let word = |value: serde_json::Result<serde_json::Value>| value.ok().and_then(|v| v.as_str().map(str::to_owned));
    let of_vectors = || {
        [word(serde_json::to_value(params.frame)), word(serde_json::to_value(params.order))]
            .map(Option::unwrap_or_default)
    };
    match params.kind.channels() {
        1 => params.kind.word().into(),
        _ => format!("{} {}", params.kind.word(), of_vectors().join(" ")),
    }
}

/// A sum over the control points, to tell maps of another model.
pub fn surfaces_sum(surfaces: &[Surface]) -> u32 {
    sum_over(surfaces.iter().map(|s| (s.rows, s.cols, &s.control[..])))
}

/// Name of an image: `patch_0007.exr`, `atlas.exr`, `relief.1001.exr`; with an attribute's name in front of it.
fn image_name(sheet: &Sheet, image: usize, file: MapFile, attribute: Option<&str>) -> String {
    let extension = file.extension();
    let plain = |name: &str| name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect::<String>();
    let stem = attribute.map(plain);
    let prefix = stem.as_ref().map_or(String::new(), |s| format!("{s}_"));
    match (sheet.kind, sheet.udim(image)) {
        (_, Some(tile)) => format!("{}.{tile}.{extension}", stem.as_deref().unwrap_or("relief")),
        (SheetKind::Atlas, _) => format!("{prefix}atlas.{extension}"),
        _ => format!("{prefix}patch_{image:04}.{extension}"),
    }
}

/// That all numbers of some maps are finite; `what` they are.
fn all_finite(maps: &[PatchMap], what: &str, hint: &'static str) -> Result<(), WriteError> {
    match maps.iter().position(|m| !m.values.iter().all(|x| x.is_finite())) {
        None => Ok(()),
        Some(patch) => {
            let value = format!("{what} that is not finite in 32 bits");
            Err(WriteError::Value { value, place: Place::Item("patch", patch), hint })
        }
    }
}

/// Writes maps of all patches, then the sidecar: where it is, all images are. Returns the sidecar.
///
/// * `attributes` - maps of vertex attributes with their names, of the same shapes
///
/// # Errors
/// `WriteError::Nothing` without maps; `WriteError::TooFine` for a bound that the files cannot keep; `WriteError::Inconsistent` if
/// maps and sheet do not fit; `WriteError::Value` for numbers that are not finite; those of writing.
pub fn write_maps(
    folder: impl AsRef<Path>,
    maps: &[PatchMap],
    attributes: &[(String, Vec<PatchMap>)],
    sheet: &Sheet,
    surfaces: &[Surface],
    options: &MapOptions,
) -> Result<Sidecar, WriteError> {
    let folder = folder.as_ref();
    if maps.is_empty() {
        return Err(WriteError::Nothing("the model has no reliefs"));
    }
    if maps.len() != sheet.spots.len() {
        let what = format!("{} maps for {} places", maps.len(), sheet.spots.len());
        return Err(WriteError::Inconsistent { what, place: Place::Item("patch", maps.len()) });
    }
    all_finite(maps, "a displacement", "fit the network again, or scale the model to other units")?;
    for (name, maps) in attributes {
        all_finite(maps, &format!("\"{name}\""), "leave out --attributes, or mend the values of the mesh")?;
    }
    std::fs::create_dir_all(folder)?;
    let Prepared { maps: rounded, coding, max_error } =
        prepared(maps, options.params.kind, options.file, options.max_error)?;
    let images = write_images(folder, &rounded, sheet, coding, None, options)?;
    let mut told = Vec::new();
    for (name, maps) in attributes {
        let coding = Coding::of_attribute(maps, options.file);
        let files = write_images(folder, maps, sheet, coding, Some(name), options)?;
        told.push(AttributeEntry {
            name: name.clone(),
            mid_level: coding.mid_level,
            scale: coding.scale,
            files: files.into_iter().map(|i| i.file).collect(),
        });
    }
    let (planish_relief, generator) = sidecar::head();
    let entry =
        |(m, s): (&PatchMap, &maps::Spot)| PatchEntry { image: s.image, x: s.x, y: s.y, width: m.cols, height: m.rows };
    let length = |m: &PatchMap| {
        m.values.chunks_exact(m.channels).map(|t| t.iter().map(|&x| f64::from(x).powi(2)).sum()).fold(0.0, f64::max)
    };
    let sidecar = Sidecar {
        planish_relief,
        generator,
        units: options.units,
        params: options.params.clone(),
        file: options.file,
        bits: Some(coding.store.bits),
        mid_level: coding.mid_level,
        scale: coding.scale,
        scale_metres: (options.params.kind != MapKind::Normal).then(|| coding.scale * options.units.metres()),
        upside_down: options.upside_down,
        uv: "(u (n - 1) + 0.5) / n".into(),
        largest: maps.iter().map(length).fold(0.0, f64::max).sqrt(),
        max_error,
        wiring: wired(&options.wiring, &coding, options.units),
        surfaces: surfaces_sum(surfaces),
        relief: options.relief,
        images,
        patches: maps.iter().zip(&sheet.spots).map(entry).collect(),
        attributes: told,
        companions: options.companions.clone(),
    };
    sidecar::write(folder, &sidecar)?;
    Ok(sidecar)
}

/// The words of a preset with the numbers of the files.
fn wired(words: &str, coding: &Coding, units: Units) -> String {
    /// Digits that a person types.
    const DIGITS: usize = 6;
    let typed = |x: f64| format!("{:.*e}", DIGITS - 1, x).parse::<f64>().unwrap_or(x).to_string();
    let centimetres = coding.scale * units.metres() / Units::Cm.metres();
    // Of the mid-level all digits count: 0.5 is not quite that of whole steps.
    words
        .replace("{mid_level}", &coding.mid_level.to_string())
        .replace("{scale_cm}", &typed(centimetres))
        .replace("{scale}", &typed(coding.scale))
}

fn write_images(
    folder: &Path,
    maps: &[PatchMap],
    sheet: &Sheet,
    coding: Coding,
    attribute: Option<&str>,
    options: &MapOptions,
) -> Result<Vec<ImageEntry>, WriteError> {
    let is_length = attribute.is_none() && options.params.kind != MapKind::Normal;
    let unit = if is_length { format!(" {}", options.units) } else { String::new() };
    let note = format!("planish relief: value = (number - {}) * {}{unit}", coding.mid_level, coding.scale);
    let one = |(k, &[width, height]): (usize, &[usize; 2])| {
        let mut raster = painted(maps, sheet, k, &coding);
        if options.upside_down {
            turn(&mut raster);
        }
        if attribute.is_none() {
            raster.meaning = meaning(&options.params);
        }
        let file = image_name(sheet, k, coding.store.file, attribute);
        image::write(&folder.join(&file), &raster, coding.store, &note)?;
        Ok(ImageEntry { file, width, height })
    };
    sheet.images.par_iter().enumerate().map(one).collect()
}

/// An image with its patches and their gutters; what is left over means no displacement.
fn painted(maps: &[PatchMap], sheet: &Sheet, image: usize, coding: &Coding) -> Raster {
    let [width, height] = sheet.images[image];
    let channels = maps[0].channels;
    let mut values = vec![coding.coded(0.0); width * height * channels];
    for (map, spot) in maps.iter().zip(&sheet.spots).filter(|(_, s)| s.image == image) {
        let gutter = sheet.gutter;
        for y in 0..map.rows + 2 * gutter {
            let j = y.saturating_sub(gutter).min(map.rows - 1);
            let row = height - 1 - (spot.y + y - gutter);
            for x in 0..map.cols + 2 * gutter {
                let i = x.saturating_sub(gutter).min(map.cols - 1);
                let to = (row * width + spot.x + x - gutter) * channels;
                let texel = map.texel(j * map.cols + i);
                values[to..to + channels].iter_mut().zip(texel).for_each(|(to, &x)| *to = coding.coded(x));
            }
        }
    }
    Raster { width, height, channels, values, meaning: String::new() }
}

/// What other ways to write the same maps take: bytes of all images and the largest error, as half floats in lossless ZIP and in DWA.
/// # Errors
/// `WriteError::Image` if the image library refuses.
pub fn other_ways(maps: &[PatchMap], sheet: &Sheet) -> Result<[(u64, f64); 2], WriteError> {
    let coding = Coding { store: Store::new(MapFile::Exr), mid_level: 0.0, scale: 1.0 };
    let way = |dwa: bool| -> Result<(u64, f64), WriteError> {
        let one = |k: usize| image::lossy(&painted(maps, sheet, k, &coding), dwa);
        let each: Vec<(u64, f64)> =
            (0..sheet.images.len()).into_par_iter().map(one).collect::<Result<_, WriteError>>()?;
        Ok((each.iter().map(|e| e.0).sum(), each.iter().map(|e| e.1).fold(0.0, f64::max)))
    };
    Ok([way(false)?, way(true)?])
}

/// The fewest bytes: what the maps take, rounded by at most `max_error`, in one PNG without gutters, and the largest error;
/// `None` where that would take long, or 16 bits do not hold the steps.
/// # Errors
/// `WriteError::Image` if the image library refuses.
pub fn in_one_png(maps: &[PatchMap], kind: MapKind, max_error: f64) -> Result<Option<(u64, f64)>, WriteError> {
    let shapes: Vec<[usize; 2]> = maps.iter().map(|m| [m.rows, m.cols]).collect();
    let Ok(sheet) = maps::pack(&shapes, SheetKind::Atlas, 0, 0) else { return Ok(None) };
    let Ok(Prepared { maps: rounded, coding, .. }) = prepared(maps, kind, MapFile::Png, Some(max_error)) else {
        return Ok(None);
    };
    let raster = painted(&rounded, &sheet, 0, &coding);
    if raster.values.len() > image::MOST_ZOPFLI {
        return Ok(None);
    }
    let bytes = image::encoded(&raster, coding.store, "")?.len() as u64;
    Ok(Some((bytes, largest_error(maps, &held(&rounded, &coding)))))
}

/// Largest distance between the texels of two sets of maps of the same shapes.
pub fn largest_error(a: &[PatchMap], b: &[PatchMap]) -> f64 {
    let far = |(a, b): (&PatchMap, &PatchMap)| {
        let texel =
            |(x, y): (&[f32], &[f32])| x.iter().zip(y).map(|(x, y)| (*x as f64 - *y as f64).powi(2)).sum::<f64>();
        a.values.chunks_exact(a.channels).zip(b.values.chunks_exact(b.channels)).map(texel).fold(0.0, f64::max)
    };
    a.iter().zip(b).map(far).fold(0.0, f64::max).sqrt()
}

fn turn(raster: &mut Raster) {
    let row = raster.width * raster.channels;
    let turned = raster.values.chunks_exact(row).rev().flatten().copied().collect();
    raster.values = turned;
}

/// Reads an image to stamp with: EXR, PNG or TIFF; the mean of its colours, and its alpha where it has one.
/// # Errors
/// As [`read_maps`], for one image.
pub fn read_picture(path: &Path) -> Result<Picture, ReadError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    image::read_with_alpha(path, &name)
}

/// Maps that were read.
#[derive(Clone, Debug)]
pub struct ReadMaps {
    /// What is told of them.
    pub sidecar: Sidecar,
    /// One per patch.
    pub maps: Vec<PatchMap>,
}

/// Reads the maps in a folder.
/// # Errors
/// `ReadError` for a folder without sidecar, or an image that is missing, damaged, of another size or number of channels than
/// the sidecar says, with numbers that are not finite, or that tells of another kind, frame or order.
pub fn read_maps(folder: impl AsRef<Path>) -> Result<ReadMaps, ReadError> {
    let folder = folder.as_ref();
    let sidecar = sidecar::read(folder)?;
    let channels = sidecar.params.kind.channels();
    let one = |(k, entry): (usize, &ImageEntry)| {
        let mut raster = image::read(&folder.join(&entry.file), &entry.file, k)?;
        let wrong = |what: String| ReadError::Syntax {
            what: format!("{}: {what}", entry.file),
            place: Place::Item("image", k),
        };
        if (raster.width, raster.height) != (entry.width, entry.height) {
            let [w, h] = [raster.width, raster.height];
            return Err(wrong(format!("it has {w} x {h} pixels, not {} x {}", entry.width, entry.height)));
        }
        let meaning = meaning(&sidecar.params);
        if !raster.meaning.is_empty() && raster.meaning != meaning {
            return Err(ReadError::Header {
                what: format!(
                    "{}: it holds \"{}\", and relief.json tells of \"{meaning}\"",
                    entry.file, raster.meaning
                ),
                place: Place::Item("image", k),
                hint: "import images with the sidecar that was written beside them",
            });
        }
        if raster.channels < channels {
            return Err(wrong(format!("it has {} channel, not {channels}", raster.channels)));
        }
        if raster.channels > channels {
            let found = raster.channels;
            raster.values = raster.values.chunks_exact(found).flat_map(|p| p[..channels].to_vec()).collect();
            raster.channels = channels;
        }
        if sidecar.upside_down {
            turn(&mut raster);
        }
        Ok(raster)
    };
    let rasters: Vec<Raster> = sidecar.images.par_iter().enumerate().map(one).collect::<Result<_, ReadError>>()?;
    let coding = coding_of(&sidecar);
    let cut = |entry: &PatchEntry| {
        let raster = &rasters[entry.image];
        let mut values = Vec::with_capacity(entry.width * entry.height * channels);
        for j in 0..entry.height {
            let row = raster.height - 1 - (entry.y + j);
            let from = (row * raster.width + entry.x) * channels;
            values.extend(raster.values[from..from + entry.width * channels].iter().map(|&x| coding.meant(x)));
        }
        PatchMap { rows: entry.height, cols: entry.width, channels, values }
    };
    let maps = sidecar.patches.par_iter().map(cut).collect();
    Ok(ReadMaps { maps, sidecar })
}

fn coding_of(sidecar: &Sidecar) -> Coding {
    let store = match sidecar.file {
        MapFile::Png | MapFile::Tiff => Store { file: sidecar.file, bits: sidecar.bits.unwrap_or(16) },
        floats => Store::new(floats),
    };
    Coding { store, mid_level: sidecar.mid_level, scale: sidecar.scale }
}

/// The numbers of maps as they come back from files: what was written of them as `sidecar` tells.
pub fn as_read(maps: Vec<PatchMap>, sidecar: &Sidecar) -> Vec<PatchMap> {
    let coding = coding_of(sidecar);
    let maps = match sidecar.max_error.filter(|e| *e > 0.0) {
        // A relief that has grown since may be too large for steps so small.
        Some(error) if rounding::is_coarse(&maps, error, sidecar.file) => {
            rounding::rounded(&maps, error, sidecar.file).maps
        }
        _ => maps,
    };
    held(&maps, &coding)
}
