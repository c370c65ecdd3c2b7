//! LAS and LAZ: airborne and terrestrial laser scans.

use super::{column, foreign, guarded};
use crate::{Place, ReadError, WriteError};
use glam::DVec3;
use las::point::Format;
use las::{Builder, Color, Point, Reader, Transform, Vector, Writer};
use planish::cloud::Cloud;
use std::io::{Cursor, Write};

/// Points read at once.
const PIECE: u64 = 1 << 16;

/// Bytes of the first point of a compressed chunk, which is not compressed: the shortest format has 20.
const CHUNK: u64 = 20;

/// Refuses compressed points whose table names more chunks than the file has room for: the library that reads them takes memory
/// for as many as it is told.
fn check_chunks(bytes: &[u8]) -> Result<(), ReadError> {
    let piece = |at: u64| bytes.get(at as usize..).unwrap_or_default();
    let word = |at: u64| piece(at).first_chunk().map(|b| u32::from_le_bytes(*b));
    let long = |at: u64| piece(at).first_chunk().map(|b| i64::from_le_bytes(*b));
    // The upper bits of the point format tell that the points are compressed.
    if bytes.get(104).is_none_or(|format| format & 0xc0 == 0) {
        return Ok(());
    }
    let size = bytes.len() as u64;
    // A writer that could not go back leaves the place of the table at the end of the file.
    let table = match word(96).and_then(|points| long(points as u64)) {
        Some(-1) => long(size.saturating_sub(8)),
        found => found,
    };
    let Some(chunks) = table.and_then(|at| word(u64::try_from(at).ok()?.checked_add(4)?)) else { return Ok(()) };
    let needed = chunks as u64 * CHUNK;
    if needed > size {
        let place = Place::Byte(table.unwrap_or_default() as usize);
        return Err(ReadError::Truncated { what: format!("{chunks} chunks of points"), needed, left: size, place });
    }
    Ok(())
}

pub(super) fn read(bytes: Vec<u8>, classes: &[u8]) -> Result<Cloud, ReadError> {
    if !bytes.starts_with(b"LASF") {
        return Err(ReadError::WrongFormat {
            expected: "LAS",
            found: "something else",
            hint: "name a file that begins with LASF".into(),
        });
    }
    let size = bytes.len() as u64;
    check_chunks(&bytes)?;
    let classes = classes.to_vec();
    guarded(move || {
        let mut reader = Reader::new(Cursor::new(bytes)).map_err(foreign)?;
        let count = reader.header().number_of_points();
        // Uncompressed records are all there; a compressed point takes more than a hundredth of a byte.
        let record = if reader.header().point_format().is_compressed {
            0.01
        } else {
            reader.header().point_format().len() as f64
        };
        if count as f64 * record > size as f64 {
            let (what, needed) = (format!("{count} points"), (count as f64 * record) as u64);
            return Err(ReadError::Truncated { what, needed, left: size, place: Place::Byte(0) });
        }
        let mut cloud = Cloud::default();
        let (mut intensity, mut class, mut color) = (Vec::new(), Vec::new(), Vec::new());
        let mut has_color = false;
        let mut done = 0;
        while done < count {
            let wanted = PIECE.min(count - done);
            let data = reader.read_points(wanted).map_err(foreign)?;
            let mut got = 0;
            for point in data.points() {
                let p = point.map_err(foreign)?;
                got += 1;
                let c = u8::from(p.classification);
                if !classes.is_empty() && !classes.contains(&c) {
                    continue;
                }
                cloud.points.push(DVec3::new(p.x, p.y, p.z));
                intensity.push(p.intensity as f32 / 65535.0);
                class.push(c as f32);
                let rgb = p.color.unwrap_or_default();
                has_color |= rgb.red | rgb.green | rgb.blue != 0;
                color.extend([rgb.red, rgb.green, rgb.blue].map(|x| x as f32 / 65535.0));
            }
            if got < wanted {
                return Err(ReadError::Truncated {
                    what: format!("{count} points"),
                    needed: count,
                    left: done + got,
                    place: Place::Item("point", (done + got) as usize),
                });
            }
            done += got;
        }
        if count > 0 && cloud.points.is_empty() {
            return Err(ReadError::Header {
                what: format!("none of the {count} points is of the wanted classes"),
                place: Place::Byte(0),
                hint: "choose other classes",
            });
        }
        cloud.attributes.push(column("intensity", 1, intensity));
        cloud.attributes.push(column("classification", 1, class));
        if has_color {
            cloud.attributes.push(column("color", 3, color));
        }
        Ok(cloud)
    })
}

/// Steps of a coordinate over the size of the cloud: fine enough for any scanner, coarse enough for 31 bits.
const STEPS: f64 = 1e9;

/// Writes LAS 1.2, compressed (LAZ) or not. The file is made in memory first: the library panics where a disk is full.
pub(super) fn write(out: &mut impl Write, world: &[DVec3], cloud: &Cloud, compressed: bool) -> Result<(), WriteError> {
    let fault = |e: las::Error| WriteError::Io(std::io::Error::other(e));
    let bounds = planish::geom::Aabb::of(world);
    let mut builder = Builder::from((1, 2));
    let color = cloud.attribute("color", 3);
    let intensity = cloud.attribute("intensity", 1);
    let class = cloud.attribute("classification", 1);
    builder.point_format = Format::new(if color.is_some() { 2 } else { 0 }).map_err(fault)?;
    builder.point_format.is_compressed = compressed;
    builder.generating_software = format!("planish {}", env!("CARGO_PKG_VERSION"));
    let axis = |k: usize| {
        let size = bounds.size()[k].max(bounds.diagonal() * 1e-3).max(1e-6);
        // A power of ten, as other programs expect.
        let scale = 10f64.powf((size / STEPS).log10().ceil());
        Transform { scale, offset: bounds.center()[k].round() }
    };
    builder.transforms = Vector { x: axis(0), y: axis(1), z: axis(2) };
    let header = builder.into_header().map_err(fault)?;
    let mut writer = Writer::new(Cursor::new(Vec::new()), header).map_err(fault)?;
    for (i, p) in world.iter().enumerate() {
        let whole = |x: f32| (x.clamp(0.0, 1.0) * 65535.0).round() as u16;
        let point = Point {
            x: p.x,
            y: p.y,
            z: p.z,
            intensity: intensity.map_or(0, |a| whole(a.values[i])),
            classification: class
                .and_then(|a| las::point::Classification::new(a.values[i].clamp(0.0, 31.0) as u8).ok())
                .unwrap_or_default(),
            color: color.map(|a| {
                let c = &a.values[3 * i..3 * i + 3];
                Color::new(whole(c[0]), whole(c[1]), whole(c[2]))
            }),
            return_number: 1,
            number_of_returns: 1,
            ..Point::default()
        };
        writer.write_point(point).map_err(fault)?;
    }
    Ok(out.write_all(writer.into_inner().map_err(fault)?.get_ref())?)
}
