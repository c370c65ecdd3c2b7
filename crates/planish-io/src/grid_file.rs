//! Volume images: NRRD (raw and gzip, attached) and NumPy arrays.
//!
//! The header is checked against the data before anything is allocated: a volume whose header claims more than the file
//! holds is refused.

use crate::text::shown;
use crate::{Place, ReadError};
use planish::DVec3;
use planish::field::ScalarGrid;
use rayon::prelude::*;
use std::borrow::Cow;
use std::io::Read;
use std::path::Path;

/// Reads a volume: `.nrrd` or `.npy`.
///
/// NRRD: three dimensions, x fastest; spacings or an axis-parallel `space directions`, and the origin, are respected.
/// NumPy: an array indexed `[x, y, z]`, in either order of memory; it carries no spacing: samples are one unit apart.
/// Numbers become `f32`.
/// # Errors
/// [`ReadError`]: header and data disagree, or the file uses what is not read.
pub fn read_grid(path: impl AsRef<Path>) -> Result<ScalarGrid, ReadError> {
    let path = path.as_ref();
    let metadata = std::fs::metadata(path)?;
    if !metadata.is_file() {
        return Err(ReadError::NotAFile(if metadata.is_dir() { "a folder" } else { "a pipe or a device" }));
    }
    if metadata.len() == 0 {
        return Err(ReadError::Empty);
    }
    match path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase().as_str() {
        "nrrd" => nrrd(&std::fs::read(path)?),
        "npy" => npy(std::fs::File::open(path)?, metadata.len()),
        other => Err(ReadError::UnknownExtension { extension: other.into(), known: ".nrrd, .npy".into() }),
    }
}

/// True for the name of a volume.
pub fn is_grid(path: &Path) -> bool {
    path.extension()
        .and_then(|e| e.to_str())
        .is_some_and(|e| ["nrrd", "npy"].contains(&e.to_ascii_lowercase().as_str()))
}

/// Numbers that a thread converts at a time: a quarter of a megabyte of `f32`.
const CHUNK: usize = 1 << 16;
/// Edge of the tiles that an array is turned around in: sixteen `f32` are one line of the cache.
const TILE: usize = 16;

/// A number type of a volume.
#[derive(Clone, Copy, PartialEq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::I64 | Scalar::U64 | Scalar::F64 => 8,
        }
    }

    /// The numbers of `bytes`, as many as `numbers` has room for.
    fn convert(self, bytes: &[u8], big: bool, numbers: &mut [f32]) {
        /// Each number by its `N` bytes.
        fn each<const N: usize>(bytes: &[u8], numbers: &mut [f32], number: impl Fn([u8; N]) -> f32 + Sync) {
            let (all, _) = bytes.as_chunks::<N>();
            numbers.par_chunks_mut(CHUNK).zip(all.par_chunks(CHUNK)).for_each(|(numbers, all)| {
                numbers.iter_mut().zip(all).for_each(|(n, bytes)| *n = number(*bytes));
            });
        }
        macro_rules! each {
            ($t:ty) => {
                if big {
                    each(bytes, numbers, |b| <$t>::from_be_bytes(b) as f32)
                } else {
                    each(bytes, numbers, |b| <$t>::from_le_bytes(b) as f32)
                }
            };
        }
        match self {
            Scalar::I8 => each!(i8),
            Scalar::U8 => each!(u8),
            Scalar::I16 => each!(i16),
            Scalar::U16 => each!(u16),
            Scalar::I32 => each!(i32),
            Scalar::U32 => each!(u32),
            Scalar::I64 => each!(i64),
            Scalar::U64 => each!(u64),
            Scalar::F32 => each!(f32),
            Scalar::F64 => each!(f64),
        }
    }
}

/// Number of samples, if it can be counted.
fn count(size: [usize; 3], place: Place) -> Result<usize, ReadError> {
    let [x, y, z] = size;
    x.checked_mul(y).and_then(|n| n.checked_mul(z)).filter(|&n| n <= 1 << 40).ok_or(ReadError::TooLarge {
        what: "samples",
        count: u64::MAX,
        limit: 1 << 40,
        place,
    })
}

fn header_fault(what: impl Into<String>, line: usize, hint: &'static str) -> ReadError {
    ReadError::Header { what: what.into(), place: Place::Line(line), hint }
}

fn nrrd(bytes: &[u8]) -> Result<ScalarGrid, ReadError> {
    if !bytes.starts_with(b"NRRD") {
        let hint = "name a volume: .nrrd or .npy".into();
        return Err(ReadError::WrongFormat { expected: "NRRD", found: "something else", hint });
    }
    let header = nrrd_header(bytes)?;
    let NrrdHeader { big, spacing, origin, data, line, .. } = header;
    let missing = |what: &str| header_fault(format!("the header has no \"{what}\""), line, "write the file again");
    let kind = header.kind.ok_or_else(|| missing("type"))?;
    let (size, size_line) = header.size.ok_or_else(|| missing("sizes"))?;
    let (encoding, encoding_line) = header.encoding.ok_or_else(|| missing("encoding"))?;
    let samples = count(size, Place::Line(size_line))?;
    let needed = samples * kind.size();
    let body = match encoding.as_str() {
        "raw" => Cow::Borrowed(&bytes[data..]),
        "gzip" | "gz" => {
            // One byte more than there may be tells that there is too much; a bomb fills no memory.
            let mut out = Vec::with_capacity(needed.min(bytes.len() * 8));
            let mut reader = flate2::read::MultiGzDecoder::new(&bytes[data..]).take(needed as u64 + 1);
            reader.read_to_end(&mut out).map_err(|e| ReadError::Syntax {
                what: format!("the compressed data is damaged ({e})"),
                place: Place::Byte(data),
            })?;
            Cow::Owned(out)
        }
        other => return Err(unsupported(format!("the encoding \"{other}\""), encoding_line)),
    };
    agree(body.len() as u64, needed, size, data)?;
    let mut values = vec![0.0; samples];
    kind.convert(&body, big, &mut values);
    checked(ScalarGrid { size, origin, spacing, values: values.into() }, line)
}

/// The fields of an NRRD header, with their lines where a fault would be told.
struct NrrdHeader {
    kind: Option<Scalar>,
    size: Option<([usize; 3], usize)>,
    encoding: Option<(String, usize)>,
    /// The high byte comes first.
    big: bool,
    spacing: DVec3,
    origin: DVec3,
    /// Where the numbers begin.
    data: usize,
    /// Last line.
    line: usize,
}

fn nrrd_header(bytes: &[u8]) -> Result<NrrdHeader, ReadError> {
    let mut kind = None;
    let mut size = None;
    let mut encoding = None;
    let mut big = false;
    let mut spacing = DVec3::ONE;
    let mut origin = DVec3::ZERO;
    let mut at = 0;
    let mut line = 0;
    loop {
        let Some(end) = bytes[at..].iter().position(|&b| b == b'\n') else {
            return Err(header_fault(
                "the header has no end (an empty line)",
                line + 1,
                "copy or write the file again",
            ));
        };
        let text = bytes[at..at + end].trim_ascii();
        at += end + 1;
        line += 1;
        if text.is_empty() {
            return Ok(NrrdHeader { kind, size, encoding, big, spacing, origin, data: at, line });
        }
        if line == 1 || text.starts_with(b"#") {
            continue;
        }
        let text = String::from_utf8_lossy(text).into_owned();
        // `key:=value` is a note.
        let Some((key, value)) = text.split_once(':').filter(|(_, v)| !v.starts_with('=')) else {
            if text.contains(":=") {
                continue;
            }
            return Err(header_fault(
                format!("\"{}\" is no field", shown(text.as_bytes())),
                line,
                "fields are `name: value`",
            ));
        };
        let value = value.trim();
        let three = |what: &str| -> Result<[f64; 3], ReadError> {
            let words: Vec<f64> = value.split_whitespace().filter_map(|w| w.parse().ok()).collect();
            match words[..] {
                [a, b, c] => Ok([a, b, c]),
                _ => Err(header_fault(format!("\"{what}\" must be three numbers"), line, "only 3-D volumes are read")),
            }
        };
        match key.trim() {
            "type" => kind = Some(nrrd_type(value).ok_or_else(|| unsupported(format!("the type \"{value}\""), line))?),
            "dimension" if value == "3" => {}
            "dimension" => return Err(unsupported(format!("a volume of {value} dimensions"), line)),
            "sizes" => {
                let s = three("sizes")?;
                if s.iter().any(|v| *v < 1.0 || v.fract() != 0.0 || *v > 1e9) {
                    return Err(header_fault("\"sizes\" must be whole numbers above 0", line, "write the file again"));
                }
                size = Some((s.map(|v| v as usize), line));
            }
            "encoding" => encoding = Some((value.to_ascii_lowercase(), line)),
            "endian" => big = value == "big",
            "spacings" => spacing = DVec3::from_array(three("spacings")?),
            "axis mins" => origin = DVec3::from_array(three("axis mins")?),
            "space directions" => spacing = directions(value, line)?,
            "space origin" => {
                let words: Vec<f64> =
                    value.trim_matches(['(', ')']).split(',').filter_map(|w| w.trim().parse().ok()).collect();
                let [x, y, z] = words[..] else {
                    return Err(header_fault("\"space origin\" must be (x,y,z)", line, "write the file again"));
                };
                origin = DVec3::new(x, y, z);
            }
            "data file" | "datafile" => return Err(unsupported("a detached header".into(), line)),
            "byte skip" | "line skip" if value != "0" => return Err(unsupported(format!("\"{key}\""), line)),
            _ => {}
        }
    }
}

/// Axis-parallel directions as spacings.
fn directions(value: &str, line: usize) -> Result<DVec3, ReadError> {
    let vectors: Vec<Vec<f64>> = value
        .split(')')
        .filter(|v| v.contains('('))
        .map(|v| v.trim().trim_start_matches('(').split(',').filter_map(|w| w.trim().parse().ok()).collect())
        .collect();
    let mut spacing = DVec3::ZERO;
    if vectors.len() != 3 || vectors.iter().any(|v| v.len() != 3) {
        return Err(header_fault("\"space directions\" must be three vectors", line, "write the file again"));
    }
    for (k, v) in vectors.iter().enumerate() {
        if (0..3).any(|c| c != k && v[c].abs() > 1e-9 * v[k].abs()) || v[k] <= 0.0 {
            return Err(unsupported("a volume that is turned or mirrored".into(), line));
        }
        spacing[k] = v[k];
    }
    Ok(spacing)
}

fn unsupported(what: String, line: usize) -> ReadError {
    ReadError::Unsupported {
        what,
        place: Place::Line(line),
        hint: "write it as one file: 3-D, scalar, axis-parallel, raw or gzip",
    }
}

/// Refuses data of another length than the header says.
fn agree(left: u64, needed: usize, size: [usize; 3], at: usize) -> Result<(), ReadError> {
    let what = format!("{} x {} x {} samples", size[0], size[1], size[2]);
    if left < needed as u64 {
        return Err(ReadError::Truncated { what, needed: needed as u64, left, place: Place::Byte(at) });
    }
    if left > needed as u64 {
        let what = format!("{what} take {needed} bytes, but there are more");
        return Err(ReadError::Syntax { what, place: Place::Byte(at + needed) });
    }
    Ok(())
}

fn checked(grid: ScalarGrid, line: usize) -> Result<ScalarGrid, ReadError> {
    let fine = grid.spacing.min_element() > 0.0 && grid.spacing.is_finite() && grid.origin.is_finite();
    if fine {
        return Ok(grid);
    }
    Err(header_fault("spacing or origin is no number, or a spacing is not above 0", line, "write the file again"))
}

fn nrrd_type(word: &str) -> Option<Scalar> {
    Some(match word {
        "signed char" | "int8" | "int8_t" => Scalar::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Scalar::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Scalar::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Scalar::U16,
        "int" | "signed int" | "int32" | "int32_t" => Scalar::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Scalar::U32,
        "longlong" | "long long" | "long long int" | "int64" | "int64_t" => Scalar::I64,
        "ulonglong" | "unsigned long long" | "uint64" | "uint64_t" => Scalar::U64,
        "float" => Scalar::F32,
        "double" => Scalar::F64,
        _ => return None,
    })
}

fn npy(mut file: impl Read, length: u64) -> Result<ScalarGrid, ReadError> {
    let fault = |what: String| ReadError::Header { what, place: Place::Byte(10), hint: "save it with numpy.save" };
    let mut head = [0; 12];
    let short = length < head.len() as u64;
    let head = &mut head[..if short { 0 } else { 10 }];
    file.read_exact(head)?;
    if !head.starts_with(b"\x93NUMPY") {
        let hint = "name a volume: .nrrd or .npy".into();
        return Err(ReadError::WrongFormat { expected: "NumPy", found: "something else", hint });
    }
    let (start, header_length) = match head[6] {
        1 => (10, u16::from_le_bytes([head[8], head[9]]) as usize),
        _ => {
            let mut rest = [0; 2];
            file.read_exact(&mut rest)?;
            (12, u32::from_le_bytes([head[8], head[9], rest[0], rest[1]]) as usize)
        }
    };
    let left = length - start as u64;
    if header_length as u64 > left {
        let needed = header_length as u64;
        return Err(ReadError::Truncated { what: "the header".into(), needed, left, place: Place::Byte(start) });
    }
    let mut header = vec![0; header_length];
    file.read_exact(&mut header)?;
    let header = String::from_utf8_lossy(&header).into_owned();
    let entry = |key: &str| {
        let at = header.find(&format!("'{key}'"))?;
        header[at..].split_once(':').map(|(_, rest)| rest.trim_start().to_owned())
    };
    let quoted = |text: &str| text.split('\'').nth(1).map(str::to_owned);
    let descr =
        entry("descr").as_deref().and_then(quoted).ok_or_else(|| fault("the header has no \"descr\"".into()))?;
    // A letter of more than one byte is no order of bytes.
    let (order, word) = descr.split_at_checked(1).unwrap_or_default();
    let kind = match word {
        "i1" => Scalar::I8,
        "u1" | "b1" => Scalar::U8,
        "i2" => Scalar::I16,
        "u2" => Scalar::U16,
        "i4" => Scalar::I32,
        "u4" => Scalar::U32,
        "i8" => Scalar::I64,
        "u8" => Scalar::U64,
        "f4" => Scalar::F32,
        "f8" => Scalar::F64,
        _ => return Err(fault(format!("numbers of type \"{}\" are not read", shown(descr.as_bytes())))),
    };
    let fortran = entry("fortran_order").is_some_and(|v| v.starts_with("True"));
    let shape = entry("shape").ok_or_else(|| fault("the header has no \"shape\"".into()))?;
    let inner = shape.trim_start_matches('(').split(')').next().unwrap_or_default();
    let shape: Vec<usize> = inner.split(',').filter_map(|w| w.trim().parse().ok()).collect();
    let &[nx, ny, nz] = &shape[..] else {
        return Err(fault(format!("an array of {} dimensions is no volume", shape.len())));
    };
    let size = [nx, ny, nz];
    let samples = count(size, Place::Byte(start))?;
    agree(left - header_length as u64, samples.saturating_mul(kind.size()), size, start + header_length)?;
    let mut values = vec![0.0; samples];
    let mut bytes = Vec::new();
    let mut next = |numbers: &mut [f32]| {
        bytes.resize(numbers.len() * kind.size(), 0);
        file.read_exact(&mut bytes)?;
        kind.convert(&bytes, order == ">", numbers);
        Ok::<_, std::io::Error>(())
    };
    if fortran {
        values.chunks_mut(16 * CHUNK).try_for_each(next)?;
    } else {
        // The last index, z, is the fastest in memory: slices of equal x come one after the other.
        let slice = ny * nz;
        let mut numbers = vec![0.0; TILE.min(nx) * slice];
        for first in (0..nx).step_by(TILE) {
            let numbers = &mut numbers[..TILE.min(nx - first) * slice];
            next(numbers)?;
            place_slices(numbers, first, &mut values, size);
        }
    }
    Ok(ScalarGrid { size, origin: DVec3::ZERO, spacing: DVec3::ONE, values: values.into() })
}

/// Puts slices of equal x, from `first` on and with z as the fastest index, among `values`, whose fastest is x.
fn place_slices(slices: &[f32], first: usize, values: &mut [f32], [nx, ny, nz]: [usize; 3]) {
    let layer = nx * ny;
    values.par_chunks_mut((TILE * layer).max(1)).enumerate().for_each(|(block, layers)| {
        let low = block * TILE;
        let count = layers.len() / layer;
        for j in 0..ny {
            for (i, slice) in slices.chunks_exact(ny * nz).enumerate() {
                let run = &slice[j * nz + low..][..count];
                for (k, &number) in run.iter().enumerate() {
                    layers[k * layer + j * nx + first + i] = number;
                }
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn saved(name: &str, bytes: &[u8]) -> Result<ScalarGrid, ReadError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        read_grid(path)
    }

    fn body() -> Vec<u8> {
        (0..24u32).flat_map(|v| (v as f32).to_le_bytes()).collect()
    }

    const HEAD: &str = "NRRD0004\n# note\ntype: float\ndimension: 3\nsizes: 2 3 4\nendian: little\nspace directions: (0.5,0,0) (0,1,0) (0,0,2)\nspace origin: (1,2,3)\n";

    #[test]
    fn nrrd_raw_and_gzip_give_the_same_numbers_with_spacing_and_origin() {
        let raw = [format!("{HEAD}encoding: raw\n\n").into_bytes(), body()].concat();
        let grid = saved("a.nrrd", &raw).unwrap();
        assert_eq!(
            (grid.size, grid.spacing, grid.origin),
            ([2, 3, 4], DVec3::new(0.5, 1.0, 2.0), DVec3::new(1.0, 2.0, 3.0))
        );
        assert_eq!(grid.values[5], 5.0);
        let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        packed.write_all(&body()).unwrap();
        let gzip = [format!("{HEAD}encoding: gzip\n\n").into_bytes(), packed.finish().unwrap()].concat();
        assert_eq!(saved("a.nrrd", &gzip).unwrap(), grid);
    }

    #[test]
    fn npy_is_indexed_x_y_z_in_either_order_of_memory() {
        let file = |fortran: &str| {
            let mut header = format!("{{'descr': '<f4', 'fortran_order': {fortran}, 'shape': (2, 3, 4), }}");
            while (10 + header.len() + 1) % 64 != 0 {
                header.push(' ');
            }
            header.push('\n');
            [b"\x93NUMPY\x01\x00".as_slice(), &(header.len() as u16).to_le_bytes(), header.as_bytes(), &body()].concat()
        };
        let c = saved("a.npy", &file("False")).unwrap();
        // Element [1, 2, 3] is the last in memory, [1, 0, 0] the thirteenth.
        assert_eq!((c.values[23], c.values[1]), (23.0, 12.0));
        assert_eq!(saved("a.npy", &file("True")).unwrap().values[1], 1.0);
    }

    #[test]
    fn headers_that_disagree_with_the_data_are_refused() {
        let short = [format!("{HEAD}encoding: raw\n\n").into_bytes(), body()[..90].to_vec()].concat();
        assert!(matches!(saved("a.nrrd", &short), Err(ReadError::Truncated { needed: 96, left: 90, .. })));
        let long = [format!("{HEAD}encoding: raw\n\n").into_bytes(), body(), vec![0; 4]].concat();
        assert!(matches!(saved("a.nrrd", &long), Err(ReadError::Syntax { .. })));
        let turned = HEAD.replace("(0.5,0,0)", "(0.5,0.1,0)");
        let turned = [format!("{turned}encoding: raw\n\n").into_bytes(), body()].concat();
        assert!(matches!(saved("a.nrrd", &turned), Err(ReadError::Unsupported { .. })));
        assert!(matches!(saved("a.nrrd", b"NRRD0004\ntype: float\n"), Err(ReadError::Header { .. })));
        assert!(matches!(saved("a.npy", b"\x93NUMPY\x01\x00\xff\xff{}"), Err(ReadError::Truncated { .. })));
    }
}
