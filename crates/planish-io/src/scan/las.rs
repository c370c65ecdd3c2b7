//! LAS and LAZ: airborne and terrestrial laser scans.

use super::{Ending, PIECE, Take, check_mark, column, foreign, guarded};
use crate::{Place, ReadError, WriteError};
use glam::DVec3;
use las::point::Format;
use las::{Builder, Color, Point, Reader, Transform, Vector, Writer};
use planish::cloud::Cloud;
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek, SeekFrom, Write};

/// Bytes of the first point of a compressed chunk, which is not compressed: the shortest format has 20.
const CHUNK: u64 = 20;

/// Bytes of records that are unpacked at a time: those of [`PIECE`] points in the longest standard format, which has 67. A
/// header may tell of longer ones.
const PIECE_BYTES: usize = 67 * PIECE;

/// Refuses compressed points whose table names more chunks than the file has room for: the library that reads them takes memory
/// for as many as it is told.
fn check_chunks(file: &mut (impl Read + Seek), size: u64) -> Result<(), ReadError> {
    let mut piece = |at: u64, bytes: &mut [u8]| -> bool {
        file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(bytes)).is_ok()
    };
    let mut format = [0; 1];
    // The upper bits of the point format tell that the points are compressed.
    if !piece(104, &mut format) || format[0] & 0xc0 == 0 {
        return Ok(());
    }
    let (mut word, mut long) = ([0; 4], [0; 8]);
    if !piece(96, &mut word) || !piece(u64::from(u32::from_le_bytes(word)), &mut long) {
        return Ok(());
    }
    // A writer that could not go back leaves the place of the table at the end of the file.
    if i64::from_le_bytes(long) == -1 && !piece(size.saturating_sub(8), &mut long) {
        return Ok(());
    }
    let Ok(table) = u64::try_from(i64::from_le_bytes(long)) else { return Ok(()) };
    if !table.checked_add(4).is_some_and(|at| piece(at, &mut word)) {
        return Ok(());
    }
    let chunks = u32::from_le_bytes(word);
    let needed = u64::from(chunks) * CHUNK;
    if needed > size {
        let place = Place::Byte(table as usize);
        return Err(ReadError::Truncated { what: format!("{chunks} chunks of points"), needed, left: size, place });
    }
    Ok(())
}

/// How many points the header tells of.
pub(super) fn told(mut file: BufReader<File>) -> Result<u64, ReadError> {
    let size = file.get_ref().metadata()?.len();
    check_chunks(&mut file, size)?;
    file.rewind()?;
    guarded(move || Ok(Reader::new(file).map_err(foreign)?.header().number_of_points()))
}

pub(super) fn pieces(mut file: BufReader<File>, classes: &[u8], take: &mut Take) -> Result<Ending, ReadError> {
    check_mark(&mut file, "LAS", "LASF")?;
    let size = file.get_ref().metadata()?.len();
    check_chunks(&mut file, size)?;
    file.rewind()?;
    guarded(move || {
        let mut reader = Reader::new(file).map_err(foreign)?;
        let count = reader.header().number_of_points();
        // Uncompressed records are all there; a compressed point takes more than a hundredth of a byte.
        let length = usize::from(reader.header().point_format().len());
        let record = if reader.header().point_format().is_compressed { 0.01 } else { length as f64 };
        if count as f64 * record > size as f64 {
            let (what, needed) = (format!("{count} points"), (count as f64 * record) as u64);
            return Err(ReadError::Truncated { what, needed, left: size, place: Place::Byte(0) });
        }
        let piece_points = PIECE.min(PIECE_BYTES / length.max(1)) as u64;
        let (mut done, mut taken) = (0, 0);
        let mut has_color = false;
        while done < count {
            let wanted = piece_points.min(count - done);
            let data = reader.read_points(wanted).map_err(foreign)?;
            let mut piece = Cloud::default();
            let (mut intensity, mut class, mut color) = (Vec::new(), Vec::new(), Vec::new());
            let mut got = 0;
            for point in data.points() {
                let p = point.map_err(foreign)?;
                got += 1;
                let c = u8::from(p.classification);
                if !classes.is_empty() && !classes.contains(&c) {
                    continue;
                }
                piece.points.push(DVec3::new(p.x, p.y, p.z));
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
            taken += piece.points.len();
            piece.attributes =
                vec![column("intensity", 1, intensity), column("classification", 1, class), column("color", 3, color)];
            take(piece)?;
        }
        if count > 0 && taken == 0 {
            return Err(ReadError::Header {
                what: format!("none of the {count} points is of the wanted classes"),
                place: Place::Byte(0),
                hint: "choose other classes",
            });
        }
        Ok(Ending { bare: if has_color { Vec::new() } else { vec!["color"] }, ..Ending::default() })
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
