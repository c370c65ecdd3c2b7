//! NumPy arrays as scans: rows of at least three numbers, alone (NPY) or the first such one of an archive (NPZ).

use super::column;
use crate::{Place, ReadError};
use glam::DVec3;
use planish::cloud::Cloud;

fn fault(what: impl Into<String>) -> ReadError {
    ReadError::Header {
        what: what.into(),
        place: Place::Byte(0),
        hint: "save an array of shape (n, 3) with numpy.save",
    }
}

/// Type, order and shape of an array, and where its numbers begin.
struct Head {
    word: String,
    fortran: bool,
    shape: Vec<usize>,
    start: usize,
}

fn head(bytes: &[u8]) -> Result<Head, ReadError> {
    if !bytes.starts_with(b"\x93NUMPY") || bytes.len() < 12 {
        return Err(fault("it is no NumPy array"));
    }
    let (start, length) = match bytes[6] {
        1 => (10usize, u16::from_le_bytes([bytes[8], bytes[9]]) as usize),
        _ => (12, u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]) as usize),
    };
    let text = bytes.get(start..start.saturating_add(length)).ok_or_else(|| fault("the header is cut off"))?;
    let text = String::from_utf8_lossy(text).into_owned();
    let entry = |key: &str| {
        let at = text.find(&format!("'{key}'"))?;
        text[at..].split_once(':').map(|(_, rest)| rest.trim_start().to_owned())
    };
    let word = entry("descr").and_then(|t| t.split('\'').nth(1).map(str::to_owned));
    let shape = entry("shape").ok_or_else(|| fault("the header has no \"shape\""))?;
    let inner = shape.trim_start_matches('(').split(')').next().unwrap_or_default().to_owned();
    Ok(Head {
        word: word.ok_or_else(|| fault("the header has no plain \"descr\""))?,
        fortran: entry("fortran_order").is_some_and(|v| v.starts_with("True")),
        shape: inner.split(',').filter_map(|w| w.trim().parse().ok()).collect(),
        start: start + length,
    })
}

/// True for an array of rows.
pub(super) fn is_table(bytes: &[u8]) -> bool {
    head(bytes).is_ok_and(|h| h.shape.len() == 2 && h.shape[1] >= 3)
}

pub(super) fn read(bytes: &[u8]) -> Result<Cloud, ReadError> {
    if !bytes.starts_with(b"PK") {
        return array(bytes);
    }
    let mut last = fault("the archive holds no array");
    for member in members(bytes)? {
        match array(&member) {
            Ok(cloud) => return Ok(cloud),
            Err(e) => last = e,
        }
    }
    Err(last)
}

fn array(bytes: &[u8]) -> Result<Cloud, ReadError> {
    let head = head(bytes)?;
    let &[n, width] = &head.shape[..] else {
        return Err(fault(format!("an array of {} dimensions is no table of points", head.shape.len())));
    };
    if width < 3 {
        return Err(fault(format!("rows of {width} numbers are no points")));
    }
    let unread = || fault(format!("numbers of type \"{}\" are not read", head.word));
    // A letter of more than one byte is no order of bytes.
    let (order, kind) = head.word.split_at_checked(1).ok_or_else(unread)?;
    let size = match kind {
        "f4" | "i4" => 4,
        "f8" | "i8" => 8,
        _ => return Err(unread()),
    };
    let body = &bytes[head.start.min(bytes.len())..];
    let needed = n.saturating_mul(width).saturating_mul(size);
    if needed > body.len() {
        let (needed, left) = (needed as u64, body.len() as u64);
        return Err(ReadError::Truncated { what: format!("{n} points"), needed, left, place: Place::Byte(head.start) });
    }
    let at = |i: usize, k: usize| {
        let slot = if head.fortran { k * n + i } else { i * width + k };
        let mut b = [0u8; 8];
        b[..size].copy_from_slice(&body[slot * size..(slot + 1) * size]);
        if order == ">" {
            b[..size].reverse();
        }
        match kind {
            "f4" => f32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f64,
            "i4" => i32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f64,
            "i8" => i64::from_le_bytes(b) as f64,
            _ => f64::from_le_bytes(b),
        }
    };
    let mut cloud = Cloud::new((0..n).map(|i| DVec3::new(at(i, 0), at(i, 1), at(i, 2))).collect());
    let unit = |i: usize| {
        let v = DVec3::new(at(i, 3), at(i, 4), at(i, 5));
        (v.length() - 1.0).abs() < 0.02
    };
    if width == 6 && (0..n.min(1000)).all(unit) {
        let values = (0..n).flat_map(|i| [3, 4, 5].map(|k| at(i, k) as f32)).collect();
        cloud.attributes.push(column("normal", 3, values));
    }
    Ok(cloud)
}

/// The members of a ZIP archive, stored or deflated, from its central directory.
fn members(bytes: &[u8]) -> Result<Vec<Vec<u8>>, ReadError> {
    let damaged = || ReadError::Syntax { what: "the archive is damaged".into(), place: Place::Byte(0) };
    let u16_at = |at: usize| bytes.get(at..at + 2).map(|b| u16::from_le_bytes([b[0], b[1]]) as usize);
    let u32_at = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let end = bytes.windows(4).rposition(|w| w == b"PK\x05\x06").ok_or_else(damaged)?;
    let count = u16_at(end + 10).ok_or_else(damaged)?;
    let mut at = u32_at(end + 16).ok_or_else(damaged)?;
    let mut found = Vec::new();
    for _ in 0..count {
        if bytes.get(at..at + 4) != Some(b"PK\x01\x02") {
            return Err(damaged());
        }
        let field = |k: usize| u32_at(at + k).ok_or_else(damaged);
        let short = |k: usize| u16_at(at + k).ok_or_else(damaged);
        let (method, packed, plain, local) = (short(10)?, field(20)?, field(24)?, field(42)?);
        let skip = |k: usize| u16_at(local + k).ok_or_else(damaged);
        let start = local + 30 + skip(26)? + skip(28)?;
        let body = bytes.get(start..start.saturating_add(packed)).ok_or_else(damaged)?;
        match method {
            0 => found.push(body.to_vec()),
            // Deflate makes at most 1032 bytes of one.
            8 if plain / 1032 <= packed => {
                let inflated = miniz_oxide::inflate::decompress_to_vec_with_limit(body, plain);
                found.push(inflated.map_err(|_| damaged())?);
            }
            _ => return Err(damaged()),
        }
        at += 46 + short(28)? + short(30)? + short(32)?;
    }
    Ok(found)
}
