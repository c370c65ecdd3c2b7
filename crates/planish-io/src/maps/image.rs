//! Images of maps: OpenEXR with 32 or 16 bit floats, PNG and TIFF with 16 bit whole numbers.

use crate::{Place, ReadError, WriteError, atomic};
use exr::prelude::*;
use planish::relief::layers::Picture;
use serde::{Deserialize, Serialize};
use std::io::{Cursor, Write};
use std::path::Path;
use std::result::Result; // the image library brings one of its own

/// Numbers of an image that Zopfli packs at most: in about five seconds, a twelfth smaller than zlib's best, which larger ones get.
pub(super) const MOST_ZOPFLI: usize = 1 << 19;
/// Compression makes data at most about this many times smaller: an image that claims more is lying.
const LARGEST_RATIO: u64 = 1100;

/// A kind of image file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MapFile {
    /// OpenEXR, 32-bit float: exact.
    #[default]
    Exr,
    /// OpenEXR, 16-bit float.
    ExrHalf,
    /// PNG, 16 bit; 8 where rounded displacements have no more steps.
    Png,
    /// TIFF, 16 bit.
    Tiff,
}

impl MapFile {
    /// The word of a kind.
    pub fn of_word(word: &str) -> Option<MapFile> {
        match word {
            "exr" => Some(MapFile::Exr),
            "exr_half" => Some(MapFile::ExrHalf),
            "png" => Some(MapFile::Png),
            "tiff" => Some(MapFile::Tiff),
            _ => None,
        }
    }

    /// Extension of its files.
    pub fn extension(self) -> &'static str {
        match self {
            MapFile::Exr | MapFile::ExrHalf => "exr",
            MapFile::Png => "png",
            MapFile::Tiff => "tif",
        }
    }

    /// True for whole numbers from 0 to 1.
    pub fn is_whole(self) -> bool {
        matches!(self, MapFile::Png | MapFile::Tiff)
    }
}

/// A kind of file and the bits of its numbers: 32 or 16 in EXR, 16 or 8 in PNG, 16 in TIFF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Store {
    pub file: MapFile,
    pub bits: u32,
}

impl Store {
    /// A kind of file with its usual bits.
    pub fn new(file: MapFile) -> Store {
        Store { file, bits: if file == MapFile::Exr { 32 } else { 16 } }
    }

    /// The number that it holds for `value`.
    pub fn held(self, value: f32) -> f32 {
        match self.file {
            MapFile::Exr if self.bits == 32 => value,
            MapFile::Exr | MapFile::ExrHalf => f16::from_f32(value).to_f32(),
            MapFile::Png | MapFile::Tiff => whole(value, self.bits) as f32 / largest(self.bits),
        }
    }
}

/// The largest whole number of so many bits.
pub(super) fn largest(bits: u32) -> f32 {
    (1u32 << bits).saturating_sub(1) as f32
}

fn whole(value: f32, bits: u32) -> u16 {
    (value.clamp(0.0, 1.0) * largest(bits)).round() as u16
}

/// Pixels from the upper left, row by row, `channels` numbers each.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Raster {
    pub width: usize,
    pub height: usize,
    pub channels: usize,
    pub values: Vec<f32>,
    /// What the numbers are, as the file tells; empty if it does not.
    pub meaning: String,
}

/// Name of the entry for [`Raster::meaning`] in files.
const MEANING: &str = "planishRelief";

/// Writes an image; `note` goes into its metadata.
pub(super) fn write(path: &Path, raster: &Raster, store: Store, note: &str) -> Result<(), WriteError> {
    let bytes = encoded(raster, store, note)?;
    atomic::write(path, |out| Ok(out.write_all(&bytes)?))
}

/// The bytes of an image.
pub(super) fn encoded(raster: &Raster, store: Store, note: &str) -> Result<Vec<u8>, WriteError> {
    let failed = |e: &dyn std::fmt::Display| WriteError::Image(e.to_string());
    let mut bytes = Cursor::new(Vec::new());
    match store.file {
        MapFile::Exr | MapFile::ExrHalf => {
            let way = (store.bits == 16, Compression::ZIP16);
            write_exr(&mut bytes, raster, way, note).map_err(|e| failed(&e))?
        }
        MapFile::Png => write_png(&mut bytes, raster, store.bits, note).map_err(|e| failed(&e))?,
        MapFile::Tiff => write_tiff(&mut bytes, raster, note).map_err(|e| failed(&e))?,
    }
    Ok(bytes.into_inner())
}

/// Names of the channels in EXR.
fn names(channels: usize) -> Vec<String> {
    let usual: &[&str] = match channels {
        1 => &["Y"],
        3 => &["R", "G", "B"],
        4 => &["R", "G", "B", "A"],
        _ => &[],
    };
    if usual.is_empty() {
        (0..channels).map(|k| format!("c{k}")).collect()
    } else {
        usual.iter().map(|n| n.to_string()).collect()
    }
}

/// Bytes of an image with half floats, in lossless ZIP or in DWA as studios use it, and its largest error in a pixel.
pub(super) fn lossy(raster: &Raster, dwa: bool) -> Result<(u64, f64), WriteError> {
    let mut bytes = Cursor::new(Vec::new());
    let compression = if dwa { Compression::DWAA(None) } else { Compression::ZIP16 };
    let failed = |e: &dyn std::fmt::Display| WriteError::Image(e.to_string());
    write_exr(&mut bytes, raster, (true, compression), "").map_err(|e| failed(&e))?;
    let back = read_exr(bytes.get_ref()).map_err(|e| failed(&e))?;
    let pixels = raster.values.chunks_exact(raster.channels).zip(back.values.chunks_exact(back.channels));
    let far = |(a, b): (&[f32], &[f32])| a.iter().zip(b).map(|(x, y)| (*x as f64 - *y as f64).powi(2)).sum::<f64>();
    Ok((bytes.get_ref().len() as u64, pixels.map(far).fold(0.0, f64::max).sqrt()))
}

fn write_exr(
    out: &mut Cursor<Vec<u8>>,
    raster: &Raster,
    (half, compression): (bool, Compression),
    note: &str,
) -> exr::error::UnitResult {
    let channel = |k: usize| raster.values.iter().skip(k).step_by(raster.channels).copied();
    let list = names(raster.channels).into_iter().enumerate().map(|(k, name)| {
        let samples = if half {
            FlatSamples::F16(channel(k).map(f16::from_f32).collect())
        } else {
            FlatSamples::F32(channel(k).collect())
        };
        AnyChannel::new(name.as_str(), samples)
    });
    let encoding = Encoding { compression, blocks: exr::image::Blocks::ScanLines, line_order: LineOrder::Increasing };
    let mut attributes = LayerAttributes { comments: Some(Text::from(note)), ..LayerAttributes::default() };
    if !raster.meaning.is_empty() {
        attributes.other.insert(Text::from(MEANING), AttributeValue::Text(Text::from(raster.meaning.as_str())));
    }
    let channels = AnyChannels::sort(list.collect());
    let layer = Layer::new((raster.width, raster.height), attributes, encoding, channels);
    Image::from_layer(layer).write().to_buffered(out)
}

fn write_png(out: &mut Cursor<Vec<u8>>, raster: &Raster, bits: u32, note: &str) -> Result<(), png::EncodingError> {
    let mut encoder = png::Encoder::new(out, raster.width as u32, raster.height as u32);
    encoder.set_color(match raster.channels {
        1 => png::ColorType::Grayscale,
        2 => png::ColorType::GrayscaleAlpha,
        3 => png::ColorType::Rgb,
        _ => png::ColorType::Rgba,
    });
    encoder.set_depth(if bits == 8 { png::BitDepth::Eight } else { png::BitDepth::Sixteen });
    encoder.add_text_chunk("Comment".into(), note.into())?;
    if !raster.meaning.is_empty() {
        encoder.add_text_chunk(MEANING.into(), raster.meaning.clone())?;
    }
    let bytes: Vec<u8> = match bits {
        8 => raster.values.iter().map(|&x| whole(x, bits) as u8).collect(),
        _ => raster.values.iter().flat_map(|&x| whole(x, bits).to_be_bytes()).collect(),
    };
    if bits == 8 && bytes.len() <= MOST_ZOPFLI {
        let mut packed = Vec::new();
        let filtered = paeth_filtered(&bytes, raster.width * raster.channels, raster.channels);
        zopfli::compress(zopfli::Options::default(), zopfli::Format::Zlib, &filtered[..], &mut packed)?;
        // The end of the file is written when the writer goes.
        return encoder.write_header()?.write_chunk(png::chunk::IDAT, &packed);
    }
    encoder.set_compression(png::Compression::High);
    encoder.write_header()?.write_image_data(&bytes)
}

/// Rows of bytes as PNG keeps them by Paeth's filter: its number, then the differences from what the bytes `back` to the left
/// and above predict.
fn paeth_filtered(bytes: &[u8], row: usize, back: usize) -> Vec<u8> {
    const PAETH: u8 = 4;
    let mut out = Vec::with_capacity(bytes.len() + bytes.len() / row);
    for (k, &byte) in bytes.iter().enumerate() {
        let x = k % row;
        if x == 0 {
            out.push(PAETH);
        }
        let at = |inside: bool, before: usize| if inside { i64::from(bytes[k - before]) } else { 0 };
        let (left, up) = (at(x >= back, back), at(k >= row, row));
        let both = at(x >= back && k >= row, row + back);
        out.push(byte.wrapping_sub(paeth(left, up, both) as u8));
    }
    out
}

/// What Paeth's filter of PNG predicts: of the numbers to the left, above, and to the left above the one nearest to
/// `left + up - both`.
pub(super) fn paeth(left: i64, up: i64, both: i64) -> i64 {
    let [l, u, b] = [(up - both).abs(), (left - both).abs(), (left + up - 2 * both).abs()];
    if l <= u && l <= b {
        left
    } else if u <= b {
        up
    } else {
        both
    }
}

fn write_tiff(out: &mut Cursor<Vec<u8>>, raster: &Raster, note: &str) -> tiff::TiffResult<()> {
    use tiff::encoder::{TiffEncoder, colortype};
    use tiff::tags::Tag;
    let values: Vec<u16> = raster.values.iter().map(|&x| whole(x, 16)).collect();
    let (width, height) = (raster.width as u32, raster.height as u32);
    let note = match raster.meaning.as_str() {
        "" => note.into(),
        meaning => format!("{note}\n{MEANING}: {meaning}"),
    };
    let note = note.as_str();
    let mut encoder = TiffEncoder::new(out)?.with_compression(tiff::encoder::Compression::Deflate(Default::default()));
    match raster.channels {
        1 => {
            let mut image = encoder.new_image::<colortype::Gray16>(width, height)?;
            image.encoder().write_tag(Tag::ImageDescription, note)?;
            image.write_data(&values)
        }
        3 => {
            let mut image = encoder.new_image::<colortype::RGB16>(width, height)?;
            image.encoder().write_tag(Tag::ImageDescription, note)?;
            image.write_data(&values)
        }
        _ => {
            let mut image = encoder.new_image::<colortype::RGBA16>(width, height)?;
            image.encoder().write_tag(Tag::ImageDescription, note)?;
            image.write_data(&values)
        }
    }
}

/// Reads an image; whatever it holds comes back as numbers as the file means them: floats as they are, whole numbers from 0
/// to 1.
pub(super) fn read(path: &Path, name: &str, item: usize) -> Result<Raster, ReadError> {
    let place = || Place::Item("image", item);
    let failed = |source| ReadError::Companion { name: name.into(), source, place: place() };
    let bytes = crate::mesh_file::bytes_of(path).map_err(failed)?;
    let damaged = |what: String| ReadError::Syntax { what: format!("{name}: {what}"), place: place() };
    let extension = crate::mesh_file::extension(path).to_ascii_lowercase();
    let raster = match extension.as_str() {
        "exr" => read_exr(&bytes).map_err(damaged)?,
        "png" => read_png(&bytes).map_err(damaged)?,
        "tif" | "tiff" => read_tiff(&bytes).map_err(damaged)?,
        _ => return Err(damaged("it is no EXR, PNG or TIFF".into())),
    };
    if let Some(k) = raster.values.iter().position(|x| !x.is_finite()) {
        let pixel = k / raster.channels;
        let (x, y) = (pixel % raster.width, pixel / raster.width);
        return Err(damaged(format!("pixel {x}, {y} is {}, not a finite number", raster.values[k])));
    }
    Ok(raster)
}

/// An image to stamp with.
pub(super) fn read_with_alpha(path: &Path, name: &str) -> Result<Picture, ReadError> {
    let extension = crate::mesh_file::extension(path).to_ascii_lowercase();
    if extension != "png" {
        let raster = read(path, name, 0)?;
        let grey = |pixel: &[f32]| [pixel.iter().sum::<f32>() / pixel.len() as f32, 1.0];
        let pixels = raster.values.chunks_exact(raster.channels).map(grey).collect();
        return Ok(Picture { width: raster.width, height: raster.height, pixels });
    }
    let bytes = crate::mesh_file::bytes_of(path)?;
    let place = Place::Item("image", 0);
    let damaged = |what: String| ReadError::Syntax { what: format!("{name}: {what}"), place: place.clone() };
    let Pixels { width, height, channels, numbers, .. } = png_pixels(&bytes).map_err(damaged)?;
    let pixel = |all: &[f32]| match *all {
        [grey] => [grey, 1.0],
        [grey, alpha] => [grey, alpha],
        [r, g, b] => [(r + g + b) / 3.0, 1.0],
        [r, g, b, alpha, ..] => [(r + g + b) / 3.0, alpha],
        [] => [0.0, 0.0],
    };
    Ok(Picture { width, height, pixels: numbers.chunks_exact(channels).map(pixel).collect() })
}

/// Refuses sizes that the bytes cannot hold.
fn plausible(width: usize, height: usize, bytes: &[u8]) -> Result<(), String> {
    if (width as u64).saturating_mul(height as u64) > (bytes.len() as u64).saturating_mul(LARGEST_RATIO) {
        return Err(format!("{width} x {height} pixels are more than it can hold"));
    }
    Ok(())
}

fn read_exr(bytes: &[u8]) -> Result<Raster, String> {
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|e| e.to_string())?;
    let header = meta.headers.first().ok_or("it has no layer")?;
    plausible(header.layer_size.x(), header.layer_size.y(), bytes)?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes();
    let image = image.from_buffered(Cursor::new(bytes)).map_err(|e| e.to_string())?;
    let (width, height) = (image.layer_data.size.x(), image.layer_data.size.y());
    let list = &image.layer_data.channel_data.list;
    let channels = if list.iter().any(|c| c.name == *"R") { names(3) } else { names(1) };
    let mut values = vec![0.0; width * height * channels.len()];
    for (k, name) in channels.iter().enumerate() {
        let found = list.iter().find(|c| c.name == *name.as_str()).or_else(|| list.first().filter(|_| list.len() == 1));
        let samples = &found.ok_or(format!("it has no channel {name}"))?.sample_data;
        if samples.len() != width * height {
            return Err(format!("its channel {name} has a size of its own"));
        }
        let into = values.iter_mut().skip(k).step_by(channels.len());
        match samples {
            FlatSamples::F32(all) => into.zip(all).for_each(|(to, x)| *to = *x),
            FlatSamples::F16(all) => into.zip(all).for_each(|(to, x)| *to = x.to_f32()),
            FlatSamples::U32(_) => return Err("it holds whole numbers; floats are needed".into()),
        }
    }
    let meaning = match image.layer_data.attributes.other.get(&Text::from(MEANING)) {
        Some(AttributeValue::Text(words)) => words.to_string(),
        _ => String::new(),
    };
    Ok(Raster { width, height, channels: channels.len(), values, meaning })
}

fn read_png(bytes: &[u8]) -> Result<Raster, String> {
    let Pixels { width, height, channels, numbers, meaning } = png_pixels(bytes)?;
    Ok(Raster { meaning, ..without_alpha(width, height, channels, numbers) })
}

/// What a PNG holds, its alpha channel among the rest.
struct Pixels {
    width: usize,
    height: usize,
    channels: usize,
    numbers: Vec<f32>,
    /// As [`Raster::meaning`].
    meaning: String,
}

fn png_pixels(bytes: &[u8]) -> Result<Pixels, String> {
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(|e| e.to_string())?;
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    plausible(width, height, bytes)?;
    let mut data = vec![0; reader.output_buffer_size().ok_or("it is too large")?];
    let info = reader.next_frame(&mut data).map_err(|e| e.to_string())?;
    let words = &reader.info().uncompressed_latin1_text;
    let meaning = words.iter().find(|t| t.keyword == MEANING).map(|t| t.text.clone()).unwrap_or_default();
    let numbers: Vec<f32> = match info.bit_depth {
        png::BitDepth::Sixteen => {
            data.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]]) as f32 / largest(16)).collect()
        }
        _ => data.iter().map(|&b| b as f32 / 255.0).collect(),
    };
    Ok(Pixels { width, height, channels: info.color_type.samples(), numbers, meaning })
}

fn read_tiff(bytes: &[u8]) -> Result<Raster, String> {
    use tiff::decoder::{Decoder, DecodingResult};
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(|e| e.to_string())?;
    let (width, height) = decoder.dimensions().map_err(|e| e.to_string())?;
    let (width, height) = (width as usize, height as usize);
    plausible(width, height, bytes)?;
    let note = decoder.get_tag_ascii_string(tiff::tags::Tag::ImageDescription).unwrap_or_default();
    let told = note.lines().find_map(|line| line.strip_prefix(MEANING)?.strip_prefix(": "));
    let meaning = told.unwrap_or_default().to_owned();
    let numbers: Vec<f32> = match decoder.read_image().map_err(|e| e.to_string())? {
        DecodingResult::U16(all) => all.iter().map(|&x| x as f32 / largest(16)).collect(),
        DecodingResult::U8(all) => all.iter().map(|&x| x as f32 / 255.0).collect(),
        DecodingResult::F32(all) => all,
        _ => return Err("its numbers are neither 8 or 16 bit whole ones nor 32 bit floats".into()),
    };
    let pixels = width * height;
    if pixels == 0 || !numbers.len().is_multiple_of(pixels) {
        return Err("its pixels do not all have the same channels".into());
    }
    Ok(Raster { meaning, ..without_alpha(width, height, numbers.len() / pixels, numbers) })
}

/// One or three channels: an alpha channel says nothing of a displacement.
fn without_alpha(width: usize, height: usize, found: usize, numbers: Vec<f32>) -> Raster {
    let channels = if found < 3 { 1 } else { 3 };
    let values = numbers.chunks_exact(found).flat_map(|pixel| pixel[..channels].iter().copied()).collect();
    Raster { width, height, channels, values, meaning: String::new() }
}
