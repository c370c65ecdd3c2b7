//! The points of a file in bricks: as [`Partition::new`] parts them, with files in the place of memory.

use super::{Manifest, Source, points_file};
use crate::ReadError;
use crate::far::{self, shift_of};
use crate::rank::ranked;
use glam::DVec3;
use planish::cloud::Cloud;
use planish::cloud::bricks::{Brick, Partition};
use planish::geom::{Aabb, is_positive};
use std::fs::File;
use std::io::{self, BufRead, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

/// A point on disk.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record {
    /// Its place in the file, counted without those left out.
    pub index: u32,
    pub point: DVec3,
    pub normal: [f32; 3],
    pub seen_by: u32,
}

/// Bytes of a record.
const RECORD: usize = 44;
/// Bytes read or written at once.
const BUFFER: usize = 1 << 20;

impl Record {
    fn bytes(&self) -> [u8; RECORD] {
        let mut bytes = [0; RECORD];
        let mut at = 0;
        let mut put = |number: &[u8]| {
            bytes[at..at + number.len()].copy_from_slice(number);
            at += number.len();
        };
        put(&self.index.to_le_bytes());
        self.point.to_array().iter().for_each(|x| put(&x.to_le_bytes()));
        self.normal.iter().for_each(|x| put(&x.to_le_bytes()));
        put(&self.seen_by.to_le_bytes());
        bytes
    }

    fn of(bytes: &[u8; RECORD]) -> Record {
        let word = |at: usize| [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
        let long = |k: usize| {
            let [low, high] = [word(4 + 8 * k), word(8 + 8 * k)];
            f64::from_bits(u64::from(u32::from_le_bytes(high)) << 32 | u64::from(u32::from_le_bytes(low)))
        };
        Record {
            index: u32::from_le_bytes(word(0)),
            point: DVec3::new(long(0), long(1), long(2)),
            normal: [28, 32, 36].map(|at| f32::from_le_bytes(word(at))),
            seen_by: u32::from_le_bytes(word(40)),
        }
    }
}

/// Passes all records of a file by.
pub(super) fn records(path: &Path, see: &mut dyn FnMut(Record)) -> io::Result<()> {
    let mut file = BufReader::with_capacity(BUFFER, File::open(path)?);
    let mut bytes = [0; RECORD];
    while !file.fill_buf()?.is_empty() {
        file.read_exact(&mut bytes)?;
        see(Record::of(&bytes));
    }
    Ok(())
}

/// Records on their way to a file, with what is known of them.
struct Sheaf {
    path: PathBuf,
    out: BufWriter<File>,
    count: u64,
    bounds: Aabb,
}

impl Sheaf {
    fn new(path: PathBuf) -> io::Result<Sheaf> {
        let out = BufWriter::with_capacity(BUFFER, File::create(&path)?);
        Ok(Sheaf { path, out, count: 0, bounds: Aabb::EMPTY })
    }

    fn push(&mut self, record: &Record) -> io::Result<()> {
        self.count += 1;
        self.bounds = Aabb { min: self.bounds.min.min(record.point), max: self.bounds.max.max(record.point) };
        self.out.write_all(&record.bytes())
    }

    fn close(mut self) -> io::Result<Part> {
        self.out.flush()?;
        Ok(Part { path: self.path, count: self.count, bounds: self.bounds })
    }
}

/// Some of the points, in a file of their own.
struct Part {
    path: PathBuf,
    count: u64,
    bounds: Aabb,
}

/// Parts a scan into bricks and writes the points of each.
/// * `most` - points of a brick, and those that are parted in memory
pub(super) fn part(source: &mut Source, folder: &Path, most: (usize, u64)) -> Result<Manifest, ReadError> {
    let lost = |error: io::Error| lost(folder, error);
    let mut manifest = Manifest::default();
    let mut all = Sheaf::new(folder.join("part")).map_err(lost)?;
    let mut count = 0u64;
    source(&mut |piece: Cloud| {
        let normals = piece.attribute("normal", 3).map(|a| &a.values);
        manifest.has_normals |= normals.is_some();
        manifest.scanners.clone_from(&piece.scanners);
        for (i, &point) in piece.points.iter().enumerate() {
            let index = u32::try_from(count).ok().filter(|&i| i < u32::MAX).ok_or_else(|| too_many(count))?;
            count += 1;
            if point.is_finite() {
                let normal = normals.map_or([0.0; 3], |n| [n[3 * i], n[3 * i + 1], n[3 * i + 2]]);
                let seen_by =
                    piece.seen_by.get(i).copied().unwrap_or(if piece.scanners.len() == 1 { 0 } else { u32::MAX });
                all.push(&Record { index, point, normal, seen_by }).map_err(lost)?;
            }
        }
        Ok(())
    })?;
    if count == 0 {
        return Err(ReadError::NoPoints);
    }
    sorted_out(all, folder, most, &mut manifest).map_err(lost)?;
    manifest.points = count - manifest.left_out;
    Ok(manifest)
}

/// Leaves out what is far off, moves the rest near the origin and parts it.
fn sorted_out(all: Sheaf, folder: &Path, most: (usize, u64), manifest: &mut Manifest) -> io::Result<()> {
    let all = all.close()?;
    let pass = |see: &mut dyn FnMut(DVec3)| records(&all.path, &mut |r| see(r.point));
    let reach = far::reach(all.count, &pass)?;
    let is_in = |p: DVec3| reach.is_none_or(|(middle, reach)| p.distance(middle) <= reach);
    let mut bounds = Aabb::EMPTY;
    pass(&mut |p| {
        if is_in(p) {
            bounds = Aabb { min: bounds.min.min(p), max: bounds.max.max(p) };
        }
    })?;
    manifest.shift = shift_of(&bounds);
    manifest.scanners.iter_mut().for_each(|s| *s -= manifest.shift);
    let mut body = Sheaf::new(folder.join("body"))?;
    sift(&all, |r| if is_in(r.point) { body.push(&Record { point: r.point - manifest.shift, ..*r }) } else { Ok(()) })?;
    let body = body.close()?;
    manifest.left_out = all.count - body.count;
    std::fs::remove_file(&all.path)?;
    let space = Aabb { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY };
    divide(body, folder, space, most, &mut manifest.bricks)
}

/// That points cannot be kept in a folder.
pub(super) fn lost(folder: &Path, error: io::Error) -> ReadError {
    ReadError::Kept { folder: folder.display().to_string(), error }
}

fn too_many(count: u64) -> ReadError {
    ReadError::TooLarge { what: "points", count, limit: u32::MAX as u64 - 1, place: crate::Place::Byte(0) }
}

/// Passes records to something that may fail.
fn sift(part: &Part, mut take: impl FnMut(&Record) -> io::Result<()>) -> io::Result<()> {
    let mut failed = Ok(());
    records(&part.path, &mut |r| {
        if failed.is_ok() {
            failed = take(&r);
        }
    })?;
    failed
}

/// Parts points until there are few enough to be parted in memory.
fn divide(part: Part, folder: &Path, aabb: Aabb, most: (usize, u64), bricks: &mut Vec<Brick>) -> io::Result<()> {
    let size = part.bounds.size();
    let axis = (0..3).fold(0, |best, a| if size[a] > size[best] { a } else { best });
    if part.count <= most.1.max(most.0 as u64) || !is_positive(size[axis]) {
        return write(part, folder, aabb, most.0, bricks);
    }
    let cut = cut(&part, axis)?;
    let name = |which: &str| part.path.with_file_name(format!("{}{which}", name_of(&part.path)));
    let (mut low, mut high) = (Sheaf::new(name("0"))?, Sheaf::new(name("1"))?);
    sift(&part, |r| if r.point[axis] >= cut { high.push(r) } else { low.push(r) })?;
    let (low, high) = (low.close()?, high.close()?);
    std::fs::remove_file(&part.path)?;
    let (mut below, mut above) = (aabb, aabb);
    (below.max[axis], above.min[axis]) = (cut, cut);
    divide(low, folder, below, most, bricks)?;
    divide(high, folder, above, most, bricks)
}

fn name_of(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Where points are cut, as [`Partition::new`] cuts them.
fn cut(part: &Part, axis: usize) -> io::Result<f64> {
    let [cut] = ranked(part.count / 2, &|see| records(&part.path, &mut |r| see([r.point[axis]])))?;
    if part.bounds.min[axis] < cut {
        return Ok(cut);
    }
    let mut next = f64::INFINITY;
    records(&part.path, &mut |r| {
        if r.point[axis] > cut {
            next = next.min(r.point[axis]);
        }
    })?;
    Ok(next)
}

/// Parts points in memory and writes the bricks.
fn write(part: Part, folder: &Path, aabb: Aabb, most: usize, bricks: &mut Vec<Brick>) -> io::Result<()> {
    let mut held = Vec::with_capacity(part.count as usize);
    records(&part.path, &mut |r| held.push(r))?;
    std::fs::remove_file(&part.path)?;
    let points: Vec<DVec3> = held.iter().map(|r| r.point).collect();
    let partition = Partition::within(&points, most, aabb);
    let from = planish::cloud::bricks::points_of(bricks);
    for brick in partition.bricks {
        let mut out = Sheaf::new(points_file(folder, bricks.len()))?;
        partition.order[brick.range.clone()].iter().try_for_each(|&i| out.push(&held[i as usize]))?;
        out.close()?;
        bricks.push(Brick { range: from + brick.range.start..from + brick.range.end, ..brick });
    }
    Ok(())
}
