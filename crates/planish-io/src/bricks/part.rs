//! The points of a file in bricks: as [`Partition::new`] parts them, with files in the place of memory.

use super::{Manifest, Source, points_file};
use crate::ReadError;
use crate::far::{self, shift_of};
use crate::rank::ranked;
use glam::DVec3;
use planish::cloud::Cloud;
use planish::cloud::bricks::{Brick, Partition};
use planish::geom::{Aabb, is_positive};
use planish::mesh::Attribute;
use planish::observe::{Cancelled, Observer};
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

/// Bytes of a record, without the other attributes of its point: these follow it, four bytes for each number.
const RECORD: usize = 44;
/// Records between two looks at the observer: chosen, some 3 MB of a file.
const RECORDS_PER_LOOK: usize = 1 << 16;
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

/// Passes all records of a file by, each with the bytes of its other attributes.
/// * `more` - how many these are
/// # Errors
/// If the file cannot be read; [`Cancelled`] in an error of its own.
pub(super) fn records(
    path: &Path,
    more: usize,
    observer: &dyn Observer,
    see: &mut dyn FnMut(Record, &[u8]),
) -> io::Result<()> {
    let mut file = BufReader::with_capacity(BUFFER, File::open(path)?);
    let (mut bytes, mut rest) = ([0; RECORD], vec![0; more]);
    for k in 0usize.. {
        if file.fill_buf()?.is_empty() {
            break;
        }
        if k.is_multiple_of(RECORDS_PER_LOOK) {
            observer.check().map_err(io::Error::other)?;
        }
        file.read_exact(&mut bytes)?;
        file.read_exact(&mut rest)?;
        see(Record::of(&bytes), &rest);
    }
    Ok(())
}

/// Records on their way to a file, with what is known of them.
struct Sheaf {
    path: PathBuf,
    out: BufWriter<File>,
    count: u64,
    bounds: Aabb,
    more: usize,
}

impl Sheaf {
    fn new(path: PathBuf, more: usize) -> io::Result<Sheaf> {
        let out = BufWriter::with_capacity(BUFFER, File::create(&path)?);
        Ok(Sheaf { path, out, count: 0, bounds: Aabb::EMPTY, more })
    }

    fn push(&mut self, record: &Record, rest: &[u8]) -> io::Result<()> {
        self.count += 1;
        self.bounds = Aabb { min: self.bounds.min.min(record.point), max: self.bounds.max.max(record.point) };
        self.out.write_all(&record.bytes())?;
        self.out.write_all(rest)
    }

    fn close(mut self) -> io::Result<Part> {
        self.out.flush()?;
        Ok(Part { path: self.path, count: self.count, bounds: self.bounds, more: self.more })
    }
}

/// Some of the points, in a file of their own.
struct Part {
    path: PathBuf,
    count: u64,
    bounds: Aabb,
    /// Bytes of the other attributes of each.
    more: usize,
}

impl Part {
    fn records(&self, observer: &dyn Observer, see: &mut dyn FnMut(Record, &[u8])) -> io::Result<()> {
        records(&self.path, self.more, observer, see)
    }
}

/// Where points are parted.
#[derive(Clone, Copy)]
struct Room<'a> {
    folder: &'a Path,
    /// Points of a brick, and those that are parted in memory.
    most: (usize, u64),
    observer: &'a dyn Observer,
}

/// The points of a scan in a file, as they came.
pub struct Gathered {
    folder: PathBuf,
    all: Sheaf,
    pub(super) manifest: Manifest,
}

/// Writes the points of a scan into a file.
pub(super) fn gather(source: &mut Source, folder: &Path, observer: &dyn Observer) -> Result<Gathered, ReadError> {
    let lost = |error: io::Error| lost(folder, error);
    let mut manifest = Manifest::default();
    let mut all: Option<Sheaf> = None;
    let mut rest = Vec::new();
    let mut count = 0u64;
    source(&mut |piece: Cloud| {
        observer.check()?;
        if piece.points.is_empty() {
            manifest.scanners.clone_from(&piece.scanners);
            return Ok(());
        }
        let normals = piece.attribute("normal", 3).map(|a| &a.values);
        let others: Vec<&Attribute> = piece.attributes.iter().filter(|a| !is_normal(a)).collect();
        let all = match &mut all {
            Some(all) => all,
            None => {
                manifest.columns = others.iter().map(|a| (a.name.clone(), a.width)).collect();
                all.insert(Sheaf::new(folder.join("part"), manifest.more()).map_err(lost)?)
            }
        };
        if !others.iter().map(|a| (&a.name, a.width)).eq(manifest.columns.iter().map(|c| (&c.0, c.1))) {
            return Err(ReadError::Header {
                what: "a piece tells other things of its points than the first one".into(),
                place: crate::Place::Byte(0),
                hint: "give all pieces the same attributes",
            });
        }
        manifest.has_normals |= normals.is_some();
        manifest.scanners.clone_from(&piece.scanners);
        for (i, &point) in piece.points.iter().enumerate() {
            let index = u32::try_from(count).ok().filter(|&i| i < u32::MAX).ok_or_else(|| too_many(count))?;
            count += 1;
            if point.is_finite() {
                let normal = normals.map_or([0.0; 3], |n| [n[3 * i], n[3 * i + 1], n[3 * i + 2]]);
                let seen_by =
                    piece.seen_by.get(i).copied().unwrap_or(if piece.scanners.len() == 1 { 0 } else { u32::MAX });
                rest.clear();
                for a in &others {
                    a.values[i * a.width..][..a.width].iter().for_each(|x| rest.extend(x.to_le_bytes()));
                }
                all.push(&Record { index, point, normal, seen_by }, &rest).map_err(lost)?;
            }
        }
        Ok(())
    })?;
    let Some(all) = all.filter(|_| count > 0) else { return Err(ReadError::NoPoints) };
    manifest.points = count;
    Ok(Gathered { folder: folder.to_path_buf(), all, manifest })
}

/// Parts points into bricks and writes those of each.
/// * `most` - points of a brick, and those that are parted in memory
pub(super) fn part(
    gathered: Gathered,
    most: (usize, u64),
    observer: &dyn Observer,
) -> Result<(PathBuf, Manifest), ReadError> {
    let Gathered { folder, all, mut manifest } = gathered;
    sorted_out(all, Room { folder: &folder, most, observer }, &mut manifest).map_err(|e| lost(&folder, e))?;
    manifest.points -= manifest.left_out;
    Ok((folder, manifest))
}

/// Leaves out what is far off, moves the rest near the origin and parts it.
fn sorted_out(all: Sheaf, room: Room, manifest: &mut Manifest) -> io::Result<()> {
    let all = all.close()?;
    let pass = |see: &mut dyn FnMut(DVec3)| all.records(room.observer, &mut |r, _| see(r.point));
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
    let mut body = Sheaf::new(room.folder.join("body"), all.more)?;
    sift(&all, room.observer, |r, rest| {
        if is_in(r.point) { body.push(&Record { point: r.point - manifest.shift, ..*r }, rest) } else { Ok(()) }
    })?;
    let body = body.close()?;
    manifest.left_out = all.count - body.count;
    std::fs::remove_file(&all.path)?;
    let space = Aabb { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY };
    divide(body, room, space, &mut manifest.bricks)
}

/// That points cannot be kept in a folder, or are no longer wanted.
pub(super) fn lost(folder: &Path, error: io::Error) -> ReadError {
    if error.get_ref().is_some_and(|e| e.is::<Cancelled>()) {
        return ReadError::Cancelled(Cancelled);
    }
    ReadError::Kept { folder: folder.display().to_string(), error }
}

/// Normals have a place of their own in a record.
fn is_normal(a: &Attribute) -> bool {
    a.name == "normal" && a.width == 3
}

fn too_many(count: u64) -> ReadError {
    ReadError::TooLarge { what: "points", count, limit: u32::MAX as u64 - 1, place: crate::Place::Byte(0) }
}

/// Passes records to something that may fail.
fn sift(
    part: &Part,
    observer: &dyn Observer,
    mut take: impl FnMut(&Record, &[u8]) -> io::Result<()>,
) -> io::Result<()> {
    let mut failed = Ok(());
    part.records(observer, &mut |r, rest| {
        if failed.is_ok() {
            failed = take(&r, rest);
        }
    })?;
    failed
}

/// Parts points until there are few enough to be parted in memory.
fn divide(part: Part, room: Room, aabb: Aabb, bricks: &mut Vec<Brick>) -> io::Result<()> {
    let size = part.bounds.size();
    let axis = (0..3).fold(0, |best, a| if size[a] > size[best] { a } else { best });
    let (brick, at_once) = room.most;
    let at_once = at_once * RECORD as u64 / (RECORD + part.more) as u64;
    if part.count <= at_once.max(brick as u64) || !is_positive(size[axis]) {
        return write(part, room, aabb, bricks);
    }
    let cut = cut(&part, room.observer, axis)?;
    let name = |which: &str| part.path.with_file_name(format!("{}{which}", name_of(&part.path)));
    let (mut low, mut high) = (Sheaf::new(name("0"), part.more)?, Sheaf::new(name("1"), part.more)?);
    sift(&part, room.observer, |r, rest| if r.point[axis] >= cut { high.push(r, rest) } else { low.push(r, rest) })?;
    let (low, high) = (low.close()?, high.close()?);
    std::fs::remove_file(&part.path)?;
    let (mut below, mut above) = (aabb, aabb);
    (below.max[axis], above.min[axis]) = (cut, cut);
    divide(low, room, below, bricks)?;
    divide(high, room, above, bricks)
}

fn name_of(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Where points are cut, as [`Partition::new`] cuts them.
fn cut(part: &Part, observer: &dyn Observer, axis: usize) -> io::Result<f64> {
    let [cut] = ranked(part.count / 2, &|see| part.records(observer, &mut |r, _| see([r.point[axis]])))?;
    if part.bounds.min[axis] < cut {
        return Ok(cut);
    }
    let mut next = f64::INFINITY;
    part.records(observer, &mut |r, _| {
        if r.point[axis] > cut {
            next = next.min(r.point[axis]);
        }
    })?;
    Ok(next)
}

/// Parts points in memory and writes the bricks.
fn write(part: Part, room: Room, aabb: Aabb, bricks: &mut Vec<Brick>) -> io::Result<()> {
    let mut held = Vec::with_capacity(part.count as usize);
    let mut rests = Vec::with_capacity(part.more * part.count as usize);
    part.records(room.observer, &mut |r, rest| {
        held.push(r);
        rests.extend_from_slice(rest);
    })?;
    std::fs::remove_file(&part.path)?;
    let points: Vec<DVec3> = held.iter().map(|r| r.point).collect();
    let parted = Partition::within(&points, room.most.0, aabb, room.observer);
    let partition = parted.map_err(io::Error::other)?;
    let from = planish::cloud::bricks::points_of(bricks);
    for brick in partition.bricks {
        let mut out = Sheaf::new(points_file(room.folder, bricks.len()), part.more)?;
        let rest = |i: usize| &rests[part.more * i..][..part.more];
        for some in partition.order[brick.range.clone()].chunks(RECORDS_PER_LOOK) {
            room.observer.check().map_err(io::Error::other)?;
            some.iter().try_for_each(|&i| out.push(&held[i as usize], rest(i as usize)))?;
        }
        out.close()?;
        bricks.push(Brick { range: from + brick.range.start..from + brick.range.end, ..brick });
    }
    Ok(())
}
