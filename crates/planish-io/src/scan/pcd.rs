//! PCD: the format of the Point Cloud Library, ascii, binary and compressed.

use super::column;
use crate::text::{Lines, shown};
use crate::{Place, ReadError};
use glam::{DQuat, DVec3};
use planish::cloud::Cloud;

/// A viewpoint at the origin is believed within this many sizes of the cloud.
const FARTHEST: f64 = 10.0;

struct Field {
    name: String,
    size: usize,
    kind: u8,
    count: usize,
}

fn fault(what: impl Into<String>, line: usize) -> ReadError {
    ReadError::Header {
        what: what.into(),
        place: Place::Line(line),
        hint: "write it again with the program it is from",
    }
}

pub(super) fn read(bytes: &[u8]) -> Result<Cloud, ReadError> {
    let mut lines = Lines::new(bytes, 0, 1);
    let header = header(&mut lines)?;
    let find = |name: &str| header.fields.iter().position(|f| f.name == name);
    let (Some(x), Some(y), Some(z)) = (find("x"), find("y"), find("z")) else {
        return Err(fault("the fields have no x, y and z", lines.number()));
    };
    let body = &bytes[lines.at()..];
    let table = match header.data.as_str() {
        "ascii" => header.ascii(body.len(), &mut lines)?,
        "binary" => header.binary(body, lines.at())?,
        "binary_compressed" => header.compressed(body, lines.at())?,
        other => return Err(fault(format!("data \"{}\" is not read", shown(other.as_bytes())), lines.number())),
    };
    Ok(assemble(&header.fields, table, header.count, [x, y, z], &header.pose))
}

/// What stands before the points.
struct Header {
    fields: Vec<Field>,
    /// Points.
    count: usize,
    /// How they are written.
    data: String,
    /// Position and quaternion of the scanner, as far as they are there.
    pose: Vec<f64>,
}

/// Reads the lines up to that which begins with DATA.
fn header(lines: &mut Lines) -> Result<Header, ReadError> {
    let (mut fields, mut points, mut data) = (Vec::<Field>::new(), None, None);
    let mut pose: Vec<f64> = Vec::new();
    while let Some(line) = lines.next_line() {
        let text = String::from_utf8_lossy(line);
        let mut words = text.split_whitespace();
        let at = lines.number();
        let Some(key) = words.next() else { continue };
        let rest: Vec<&str> = words.collect();
        match key {
            "FIELDS" | "COLUMNS" => {
                fields = rest.iter().map(|n| Field { name: n.to_string(), size: 4, kind: b'F', count: 1 }).collect();
            }
            "SIZE" | "COUNT" => {
                let numbers = rest.iter().map(|w| w.parse::<usize>().ok()).collect::<Option<Vec<usize>>>();
                let n = numbers.filter(|n| n.len() == fields.len());
                let n = n.ok_or_else(|| fault(format!("{key} does not match FIELDS"), at))?;
                for (f, n) in fields.iter_mut().zip(n) {
                    if n == 0 || n > 1 << 20 || (key == "SIZE" && ![1, 2, 4, 8].contains(&n)) {
                        return Err(fault(format!("{key} {n} is no size"), at));
                    }
                    *(if key == "SIZE" { &mut f.size } else { &mut f.count }) = n;
                }
            }
            "TYPE" => {
                if rest.len() != fields.len() {
                    return Err(fault("TYPE does not match FIELDS", at));
                }
                for (f, t) in fields.iter_mut().zip(&rest) {
                    f.kind = t.as_bytes()[0];
                }
            }
            "VIEWPOINT" => pose = rest.iter().filter_map(|w| w.parse().ok()).collect(),
            "POINTS" => points = rest.first().and_then(|w| w.parse::<usize>().ok()),
            "DATA" => {
                data = rest.first().map(|w| w.to_string());
                break;
            }
            k if k.starts_with('#') || ["VERSION", "WIDTH", "HEIGHT"].contains(&k) => {}
            k => return Err(fault(format!("\"{}\" is no line of a PCD header", shown(k.as_bytes())), at)),
        }
    }
    let line = lines.number();
    let data = data.ok_or_else(|| fault("there is no line DATA", line))?;
    let count = points.ok_or_else(|| fault("there is no line POINTS", line))?;
    Ok(Header { fields, count, data, pose })
}

/// Tables have a column for each number of a point; `start` is where the body begins in the file.
impl Header {
    /// Bytes of a point.
    fn size(&self) -> usize {
        self.fields.iter().map(|f| f.size * f.count).sum()
    }

    /// Numbers of a point.
    fn width(&self) -> usize {
        self.fields.iter().map(|f| f.count).sum()
    }

    fn short(&self, needed: usize, left: usize, start: usize) -> ReadError {
        let (what, place) = (format!("{} points", self.count), Place::Byte(start));
        ReadError::Truncated { what, needed: needed as u64, left: left as u64, place }
    }

    fn ascii(&self, length: usize, lines: &mut Lines) -> Result<Vec<Vec<f64>>, ReadError> {
        let (width, start) = (self.width(), lines.at());
        // A number takes a character and a blank.
        let needed = self.count.saturating_mul(2 * width);
        if needed > length + 1 {
            return Err(self.short(needed, length, start));
        }
        let mut table = vec![Vec::with_capacity(self.count); width];
        for i in 0..self.count {
            let Some(words) = lines.next_words() else { return Err(self.short(self.count, i, start)) };
            let row: Vec<&[u8]> = words.collect();
            if row.len() < width {
                let what = format!("a line has {} numbers instead of {width}", row.len());
                return Err(ReadError::Syntax { what, place: Place::Line(lines.number()) });
            }
            for (column, w) in table.iter_mut().zip(row) {
                column.push(crate::text::real(w, || Place::Line(lines.number()))?);
            }
        }
        Ok(table)
    }

    fn binary(&self, body: &[u8], start: usize) -> Result<Vec<Vec<f64>>, ReadError> {
        let needed = self.count.saturating_mul(self.size());
        if needed > body.len() {
            return Err(self.short(needed, body.len(), start));
        }
        let mut table = vec![Vec::with_capacity(self.count); self.width()];
        for record in body[..needed].chunks_exact(self.size().max(1)) {
            let (mut at, mut k) = (0, 0);
            for f in &self.fields {
                for _ in 0..f.count {
                    table[k].push(number(&record[at..at + f.size], f.kind));
                    at += f.size;
                    k += 1;
                }
            }
        }
        Ok(table)
    }

    /// Field by field, packed by LZF.
    fn compressed(&self, body: &[u8], start: usize) -> Result<Vec<Vec<f64>>, ReadError> {
        if body.len() < 8 {
            return Err(self.short(8, body.len(), start));
        }
        let word = |at: usize| u32::from_le_bytes([body[at], body[at + 1], body[at + 2], body[at + 3]]) as usize;
        let (packed, plain) = (word(0), word(4));
        let needed = self.count.saturating_mul(self.size());
        if packed > body.len() - 8 {
            return Err(self.short(packed, body.len() - 8, start));
        }
        // The densest LZF code makes 264 bytes of three.
        if plain < needed || plain / 88 > packed {
            return Err(self.short(needed, plain.min(packed * 88), start));
        }
        let content = unpack(&body[8..8 + packed], plain).ok_or_else(|| ReadError::Syntax {
            what: "the packed points are damaged".into(),
            place: Place::Byte(start),
        })?;
        let mut table: Vec<Vec<f64>> = Vec::new();
        let mut at = 0;
        for f in &self.fields {
            let first = table.len();
            table.resize(first + f.count, Vec::with_capacity(self.count));
            for i in 0..self.count {
                for k in 0..f.count {
                    let from = at + (i * f.count + k) * f.size;
                    table[first + k].push(number(&content[from..from + f.size], f.kind));
                }
            }
            at += self.count * f.count * f.size;
        }
        Ok(table)
    }
}

fn assemble(fields: &[Field], table: Vec<Vec<f64>>, count: usize, axes: [usize; 3], pose: &[f64]) -> Cloud {
    let first: Vec<usize> = fields
        .iter()
        .scan(0, |at, f| {
            let own = *at;
            *at += f.count;
            Some(own)
        })
        .collect();
    let axis = axes.map(|k| &table[first[k]]);
    // Invalid points of an organised cloud are not numbers.
    let kept: Vec<usize> = (0..count).filter(|&i| axis.iter().all(|a| a[i].is_finite())).collect();
    let mut cloud = Cloud::new(kept.iter().map(|&i| DVec3::new(axis[0][i], axis[1][i], axis[2][i])).collect());
    let find = |name: &str| fields.iter().position(|f| f.name == name).map(|k| first[k]);
    if let (Some(a), Some(b), Some(c)) = (find("normal_x"), find("normal_y"), find("normal_z")) {
        let values = kept.iter().flat_map(|&i| [a, b, c].map(|k| table[k][i] as f32)).collect();
        cloud.attributes.push(column("normal", 3, values));
    }
    if let Some(k) = fields.iter().position(|f| f.name == "rgb" || f.name == "rgba") {
        let values = kept
            .iter()
            .flat_map(|&i| {
                let x = table[first[k]][i];
                // Packed into the bits of a float, or a whole number.
                let bits = if fields[k].kind == b'F' { (x as f32).to_bits() } else { x as i64 as u32 };
                [16, 8, 0].map(|s| (bits >> s & 255) as f32 / 255.0)
            })
            .collect();
        cloud.attributes.push(column("color", 3, values));
    }
    if let Some(k) = find("intensity") {
        cloud.attributes.push(column("intensity", 1, kept.iter().map(|&i| table[k][i] as f32).collect()));
    }
    if let &[x, y, z, w, a, b, c] = pose {
        let turn = DQuat::from_xyzw(a, b, c, w);
        let known = turn.is_finite() && (turn.length() - 1.0).abs() < 1e-3;
        let at = DVec3::new(x, y, z);
        // Writers that know no viewpoint put the origin there. It is one if the points lie before it, and not a world away.
        let bounds = cloud.bounds();
        let nearest = at.clamp(bounds.min, bounds.max).distance(at);
        let told = at != DVec3::ZERO || (w - 1.0).abs() > 1e-9;
        if known && (told || (nearest > 0.0 && nearest < FARTHEST * bounds.diagonal())) {
            // The points are in the frame of the sensor already moved by the writer; only the position is told.
            cloud.scanners = vec![at];
            cloud.seen_by = vec![0; cloud.points.len()];
        }
    }
    cloud
}

fn number(bytes: &[u8], kind: u8) -> f64 {
    match (kind, bytes) {
        (b'F', &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]) as f64,
        (b'F', b) if b.len() == 8 => f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]),
        (b'U', b) => b.iter().rev().fold(0u64, |n, &x| n << 8 | x as u64) as f64,
        (_, b) => {
            let n = b.iter().rev().fold(0u64, |n, &x| n << 8 | x as u64);
            let free = 64 - 8 * b.len() as u32;
            ((n << free) as i64 >> free) as f64
        }
    }
}

/// LZF: runs of plain bytes and copies of what came before.
fn unpack(packed: &[u8], size: usize) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(size);
    let mut at = 0;
    while at < packed.len() {
        let control = packed[at] as usize;
        at += 1;
        if control < 32 {
            out.extend_from_slice(packed.get(at..at + control + 1)?);
            at += control + 1;
        } else {
            let mut length = control >> 5;
            if length == 7 {
                length += *packed.get(at)? as usize;
                at += 1;
            }
            let back = ((control & 31) << 8 | *packed.get(at)? as usize) + 1;
            at += 1;
            let from = out.len().checked_sub(back)?;
            for k in 0..length + 2 {
                out.push(out[from + k]);
            }
        }
        if out.len() > size {
            return None;
        }
    }
    (out.len() == size).then_some(out)
}
