//! Arrays of a project: numbers to compressed little-endian blobs and back.

use super::ProjectError;
use planish::DVec3;
use planish::mesh::FacePoint;
use rayon::prelude::*;
use rusqlite::{Connection, Transaction, params};
use std::collections::BTreeSet;
use std::io::Read;

/// The fastest level: scans compress little better at higher ones, and saving must not be felt.
const LEVEL: i32 = 1;

/// An array of numbers.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Array {
    F64(Vec<f64>),
    F32(Vec<f32>),
    U32(Vec<u32>),
}

impl Array {
    /// Coordinates of points, one after the other.
    pub fn points(points: &[DVec3]) -> Array {
        Array::F64(points.iter().flat_map(|p| p.to_array()).collect())
    }

    fn kind(&self) -> &'static str {
        match self {
            Array::F64(_) => "f64",
            Array::F32(_) => "f32",
            Array::U32(_) => "u32",
        }
    }

    fn len(&self) -> usize {
        match self {
            Array::F64(x) => x.len(),
            Array::F32(x) => x.len(),
            Array::U32(x) => x.len(),
        }
    }

    fn bytes(&self) -> Vec<u8> {
        match self {
            Array::F64(x) => x.iter().flat_map(|x| x.to_le_bytes()).collect(),
            Array::F32(x) => x.iter().flat_map(|x| x.to_le_bytes()).collect(),
            Array::U32(x) => x.iter().flat_map(|x| x.to_le_bytes()).collect(),
        }
    }
}

/// Arrays gathered for writing; their numbers in the file are their order, from 1.
#[derive(Default)]
pub(super) struct Arrays {
    arrays: Vec<Array>,
}

impl Arrays {
    /// Adds an array; returns its number.
    pub fn add(&mut self, array: Array) -> i64 {
        self.arrays.push(array);
        self.arrays.len() as i64
    }

    /// Compresses all arrays, in parallel, and writes them.
    pub fn write(self, transaction: &Transaction) -> Result<(), ProjectError> {
        let compressed: Vec<Vec<u8>> =
            self.arrays.par_iter().map(|a| zstd::bulk::compress(&a.bytes(), LEVEL)).collect::<Result<_, _>>()?;
        let mut insert =
            transaction.prepare("INSERT INTO array (id, kind, count, checksum, data) VALUES (?1, ?2, ?3, ?4, ?5)")?;
        for (k, (array, data)) in self.arrays.iter().zip(&compressed).enumerate() {
            let checksum = checksum(array.kind(), array.len() as u64, data);
            insert.execute(params![k as i64 + 1, array.kind(), array.len() as i64, checksum, data])?;
        }
        Ok(())
    }
}

/// CRC-32 over type, count and compressed bytes: a damaged blob never reaches the decompressor.
fn checksum(kind: &str, count: u64, data: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(kind.as_bytes());
    hasher.update(&count.to_le_bytes());
    hasher.update(data);
    hasher.finalize()
}

/// All arrays together may take so many bytes for each byte of their file, and [`FREE`] more: what is measured or fitted
/// compresses ten times at best, forged arrays of zeros thousands of times.
const MOST_RATIO: u64 = 1000;
/// Bytes that the arrays of even the smallest file may take.
const FREE: u64 = 64 << 20;

/// Arrays in a file, read and expanded when they are asked for; each is taken once, so that no row can ask for the numbers of
/// another again.
pub(super) struct Loaded<'a> {
    connection: &'a Connection,
    taken: BTreeSet<i64>,
    /// Bytes that may still be expanded.
    left: u64,
}

struct Row {
    id: i64,
    kind: String,
    count: i64,
    checksum: u32,
    data: Vec<u8>,
}

impl Loaded<'_> {
    /// The arrays of a file of `bytes`.
    pub fn new(connection: &Connection, bytes: u64) -> Loaded<'_> {
        Loaded { connection, taken: BTreeSet::new(), left: bytes.saturating_mul(MOST_RATIO).saturating_add(FREE) }
    }

    /// Array `id`, which must be of a kind and, if that is known, hold `count` numbers.
    fn take(&mut self, id: i64, kind: &str, count: Option<usize>) -> Result<Array, ProjectError> {
        let missing = || damaged(format!("it is missing, named twice or not of {kind}"), "array", id);
        if !self.taken.insert(id) {
            return Err(missing());
        }
        let mut select =
            self.connection.prepare_cached("SELECT kind, count, checksum, data FROM array WHERE id = ?1")?;
        let found = select.query_row([id], |row| {
            Ok(Row { id, kind: row.get(0)?, count: row.get(1)?, checksum: row.get(2)?, data: row.get(3)? })
        });
        let row = match found {
            Err(rusqlite::Error::QueryReturnedNoRows) => return Err(missing()),
            found => found?,
        };
        if row.kind != kind {
            return Err(missing());
        }
        if count.is_some_and(|count| row.count != count as i64) {
            return Err(damaged(format!("{} numbers are not the points expected", row.count), "array", id));
        }
        if checksum(kind, row.count as u64, &row.data) != row.checksum {
            return Err(ProjectError::Checksum { array: id });
        }
        let size = if kind == "f64" { 8 } else { 4 };
        let needed = (row.count.max(0) as u64).saturating_mul(size);
        self.left = self.left.checked_sub(needed).ok_or_else(|| {
            damaged(format!("it claims {needed} bytes, more than a file of this size holds"), "array", id)
        })?;
        expand(row)
    }

    /// Array `id`, which must hold `f64`.
    pub fn f64(&mut self, id: i64) -> Result<Vec<f64>, ProjectError> {
        match self.take(id, "f64", None)? {
            Array::F64(x) => Ok(x),
            _ => Err(damaged("it is of another type".into(), "array", id)),
        }
    }

    /// Array `id`, which must hold `f32`.
    pub fn f32(&mut self, id: i64) -> Result<Vec<f32>, ProjectError> {
        match self.take(id, "f32", None)? {
            Array::F32(x) => Ok(x),
            _ => Err(damaged("it is of another type".into(), "array", id)),
        }
    }

    /// Array `id`, which must hold `u32`.
    pub fn u32(&mut self, id: i64) -> Result<Vec<u32>, ProjectError> {
        match self.take(id, "u32", None)? {
            Array::U32(x) => Ok(x),
            _ => Err(damaged("it is of another type".into(), "array", id)),
        }
    }

    /// Array `id` as points with finite coordinates; `count` of them if that is given.
    pub fn points(&mut self, id: i64, count: Option<usize>) -> Result<Vec<DVec3>, ProjectError> {
        let Array::F64(x) = self.take(id, "f64", count.map(|n| n.saturating_mul(3)))? else {
            return Err(damaged("it is of another type".into(), "array", id));
        };
        if x.len() % 3 != 0 || count.is_some_and(|count| 3 * count != x.len()) || !x.iter().all(|x| x.is_finite()) {
            return Err(damaged(format!("{} numbers are not the points expected", x.len()), "array", id));
        }
        Ok(x.chunks_exact(3).map(DVec3::from_slice).collect())
    }
}

pub(super) fn add_places<'a>(arrays: &mut Arrays, places: impl Iterator<Item = &'a FacePoint>) -> (i64, i64) {
    let (mut faces, mut weights) = (Vec::new(), Vec::new());
    for place in places {
        faces.push(place.face);
        weights.extend(place.bary);
    }
    (arrays.add(Array::U32(faces)), arrays.add(Array::F64(weights)))
}

/// Places on the mesh out of their arrays.
pub(super) fn places(
    arrays: &mut Loaded<'_>,
    faces: i64,
    weights: i64,
    count: usize,
) -> Result<Vec<FacePoint>, ProjectError> {
    let (f, w) = (arrays.u32(faces)?, arrays.f64(weights)?);
    if w.len() != 3 * f.len() || f.iter().any(|&f| f as usize >= count) || !w.chunks_exact(3).all(are_weights) {
        return Err(damaged("the places are not on the mesh".into(), "array", faces));
    }
    Ok(f.iter().zip(w.chunks_exact(3)).map(|(&face, w)| FacePoint { face, bary: [w[0], w[1], w[2]] }).collect())
}

/// Rounding in weights of places; far above what computing leaves, far below what would lie beside its triangle.
const WEIGHT_SLACK: f64 = 1e-3;

/// True for three weights from 0 to 1 that sum to 1: those of a place on its triangle.
pub(super) fn are_weights(bary: &[f64]) -> bool {
    let sum: f64 = bary.iter().sum();
    bary.iter().all(|b| (-WEIGHT_SLACK..=1.0 + WEIGHT_SLACK).contains(b)) && (sum - 1.0).abs() <= WEIGHT_SLACK
}

pub(super) fn damaged(what: String, table: &str, row: i64) -> ProjectError {
    ProjectError::Damaged { what, place: format!("{table} {row}") }
}

fn expand(row: Row) -> Result<Array, ProjectError> {
    let count = u64::try_from(row.count).map_err(|_| damaged("its count is negative".into(), "array", row.id))?;
    let size = if row.kind == "f64" { 8 } else { 4 };
    let needed = count.saturating_mul(size);
    // Grows as bytes come, and stops one after the count: a false count cannot take memory.
    let mut bytes = Vec::new();
    zstd::stream::read::Decoder::new(row.data.as_slice())?.take(needed.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 != needed {
        return Err(damaged(format!("it holds {} bytes instead of {needed}", bytes.len()), "array", row.id));
    }
    Ok(match row.kind.as_str() {
        "f64" => {
            let number = |b: &[u8]| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]);
            Array::F64(bytes.chunks_exact(8).map(number).collect())
        }
        "f32" => Array::F32(bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()),
        "u32" => Array::U32(bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()),
        other => return Err(damaged(format!("unknown type \"{other}\""), "array", row.id)),
    })
}
