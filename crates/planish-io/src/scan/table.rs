//! Points as lines of numbers: XYZ, TXT, CSV, ASC, PTS.

use super::{Ending, Take, column};
use crate::text::{Lines, shown};
use crate::{Place, ReadError, WriteError};
use glam::DVec3;
use planish::cloud::Cloud;
use std::io::{self, Read, Write};

/// The columns of one line, and whether a comma in them is a decimal point.
struct Row<'a> {
    words: Vec<&'a [u8]>,
    decimal_comma: bool,
}

/// Splits a line: at semicolons if it has any, else at blanks where each word is a number with a decimal comma (as `1,5 2,5
/// 3,5` is), else at blanks and commas. Between two separators that are no blanks stands a column, be it an empty one. What is
/// quoted is one column.
fn split(line: &[u8]) -> Row<'_> {
    let bare = |w: &[u8]| -> bool { !w.is_empty() };
    let is_blank = |b: &u8| b.is_ascii_whitespace();
    if line.contains(&b';') {
        return Row { words: columns_at(line, b';'), decimal_comma: true };
    }
    let apart: Vec<&[u8]> = line.split(is_blank).filter(|w| bare(w)).collect();
    let commas = |w: &[u8]| w.iter().filter(|&&b| b == b',').count();
    let is_inner = |w: &[u8]| w.first() != Some(&b',') && w.last() != Some(&b',');
    let decimal = apart.len() >= 3
        && line.contains(&b',')
        && !line.contains(&b'.')
        && apart.iter().all(|w| commas(w) <= 1 && is_inner(w) && real(w, true).is_some());
    if decimal || !line.contains(&b',') {
        return Row { words: apart.into_iter().map(unquoted).collect(), decimal_comma: decimal };
    }
    let decimal_comma = line.contains(&b'"');
    let words = columns_at(line, b',').into_iter();
    // Blanks part columns as well, but for a header of names with blanks in quotes.
    let words = words.flat_map(|w| {
        if w.is_empty() || decimal_comma { vec![w] } else { w.split(is_blank).filter(|w| bare(w)).collect() }
    });
    Row { words: words.collect(), decimal_comma }
}

/// The columns between separators outside quotes, without the quotes; an empty last one is none.
fn columns_at(line: &[u8], separator: u8) -> Vec<&[u8]> {
    let mut inside = false;
    let mut words: Vec<&[u8]> = line
        .split(|&b| {
            inside ^= b == b'"';
            b == separator && !inside
        })
        .map(unquoted)
        .collect();
    if words.last().is_some_and(|w| w.is_empty()) {
        words.pop();
    }
    words
}

fn unquoted(word: &[u8]) -> &[u8] {
    let word = word.trim_ascii();
    word.strip_prefix(b"\"").and_then(|w| w.strip_suffix(b"\"")).unwrap_or(word).trim_ascii()
}

fn real(word: &[u8], decimal_comma: bool) -> Option<f64> {
    let text = std::str::from_utf8(word).ok()?;
    match text.split_once(',') {
        Some((whole, rest)) if decimal_comma && !text.contains('.') => format!("{whole}.{rest}").parse().ok(),
        _ => text.parse().ok(),
    }
}

/// Bytes that are read at once, up to the end of a line: chosen, some 50 000 points.
const BLOCK_BYTES: usize = 1 << 21;
/// Rows that columns are guessed from.
const GUESSED_FROM: usize = 1000;

/// Reads points piece by piece. `columns` names them; without it a header line does, else their number and range.
pub(super) fn pieces(
    file: impl Read,
    extension: &str,
    columns: Option<&str>,
    take: &mut Take,
) -> Result<Ending, ReadError> {
    in_blocks(file, Reader::new(extension, columns)?, BLOCK_BYTES, take)
}

fn in_blocks(mut file: impl Read, mut reader: Reader, size: usize, take: &mut Take) -> Result<Ending, ReadError> {
    let (mut block, mut rows) = (Vec::new(), Vec::new());
    let mut is_last = false;
    while !is_last {
        let before = block.len();
        let more = (&mut file).take(size as u64).read_to_end(&mut block)?;
        is_last = more < size;
        // What was read before has no end of a line, but for a \r as its last byte, which a \n may follow.
        let from = before.saturating_sub(1);
        let is_end =
            |k: usize| block[k] == b'\n' || (block[k] == b'\r' && k + 1 < block.len() && block[k + 1] != b'\n');
        let end = if is_last { block.len() } else { (from..block.len()).rfind(|&k| is_end(k)).map_or(0, |k| k + 1) };
        rows.append(&mut reader.rows(&block[..end])?);
        block.drain(..end);
        let is_known = is_last || reader.names.is_some() || rows.len() >= GUESSED_FROM * reader.width;
        if !rows.is_empty() && is_known {
            take(reader.cloud(&rows)?)?;
            rows.clear();
        }
    }
    if reader.count == 0 {
        return Err(ReadError::NoPoints);
    }
    // Colours are bytes or pairs of them if they do not fit into what is less.
    let color_scale = match reader.brightest {
        most if most > 255.0 => Some(1.0 / 65535.0),
        most if most > 1.0 => Some(1.0 / 255.0),
        _ => None,
    };
    Ok(Ending { bare: Vec::new(), color_scale })
}

/// How many points a file has at most: its lines.
pub(super) fn told(mut file: impl Read) -> io::Result<u64> {
    let (mut block, mut ends) = (vec![0; BLOCK_BYTES], [0, 0]);
    loop {
        let read = file.read(&mut block)?;
        if read == 0 {
            return Ok(1 + ends[0].max(ends[1]));
        }
        for (count, end) in ends.iter_mut().zip(*b"\n\r") {
            *count += block[..read].iter().filter(|&&b| b == end).count() as u64;
        }
    }
}

/// What is known of a file so far.
struct Reader<'a> {
    extension: &'a str,
    names: Option<Vec<String>>,
    /// A line of words before the data, and its number.
    header: Option<(Vec<String>, usize)>,
    /// Numbers of a line; 0 before the first.
    width: usize,
    count: usize,
    lines: usize,
    /// The largest number of a colour.
    brightest: f64,
}

impl<'a> Reader<'a> {
    fn new(extension: &'a str, columns: Option<&str>) -> Result<Reader<'a>, ReadError> {
        let names = columns.map(parse_columns).transpose()?;
        Ok(Reader { extension, names, header: None, width: 0, count: 0, lines: 0, brightest: 0.0 })
    }

    /// The numbers of the next lines.
    fn rows(&mut self, bytes: &[u8]) -> Result<Vec<f64>, ReadError> {
        let mut lines = Lines::new(bytes, 0, self.lines + 1);
        let mut rows: Vec<f64> = Vec::new();
        while let Some(line) = lines.next_line() {
            self.lines = lines.number();
            let place = Place::Line(self.lines);
            let mut line = line.trim_ascii();
            let comment = line.starts_with(b"#") || line.starts_with(b"//");
            if comment {
                line = line.trim_ascii_start().strip_prefix(b"//").unwrap_or(&line[1..]).trim_ascii();
            }
            let Row { words: found, decimal_comma } = split(line);
            if found.is_empty() {
                continue;
            }
            let numbers: Vec<Option<f64>> = found.iter().map(|w| real(w, decimal_comma)).collect();
            if comment || numbers.iter().all(Option::is_none) {
                // A line of words before the data names the columns.
                if self.count == 0 && numbers.iter().all(Option::is_none) && found.len() >= 3 {
                    let words: Vec<String> =
                        found.iter().map(|w| String::from_utf8_lossy(w).to_ascii_lowercase()).collect();
                    // A line of words that names no x may be a remark, unless it has as many words as there are columns.
                    let names_x = words.iter().any(|n| canonical(n) == "x");
                    if names_x || !comment && self.header.is_none() {
                        self.header = Some((words, self.lines));
                    }
                    continue;
                }
                if comment || self.count == 0 {
                    continue;
                }
            }
            // PTS begins each scan with the number of its points.
            let is_count = self.extension == "pts" || self.count == 0;
            if found.len() == 1 && is_count && numbers[0].is_some_and(|n| n.fract() == 0.0) {
                continue;
            }
            if self.width == 0 {
                if let (None, Some((words, line))) = (&self.names, &self.header) {
                    self.names = named(words, found.len(), *line)?;
                }
                if found.len() < 3 {
                    let what = format!("a line has {} numbers, a point needs 3", found.len());
                    return Err(ReadError::Syntax { what, place });
                }
                self.width = found.len();
            }
            if found.len() < self.width {
                let what = format!("a line has {} numbers, those before have {}", found.len(), self.width);
                return Err(ReadError::Syntax { what, place });
            }
            for k in 0..self.width {
                let Some(x) = numbers[k] else {
                    let what = format!("\"{}\" is not a number", shown(found[k]));
                    return Err(ReadError::Syntax { what, place });
                };
                rows.push(x);
            }
            self.count += 1;
        }
        Ok(rows)
    }

    /// The points of rows, with colours as they are in the file.
    fn cloud(&mut self, rows: &[f64]) -> Result<Cloud, ReadError> {
        let names = self.names.get_or_insert_with(|| guess(rows, self.width, self.extension));
        let (cloud, brightest) = assemble(rows, self.width, names)?;
        self.brightest = self.brightest.max(brightest);
        Ok(cloud)
    }
}

/// The names of a header line over rows of `width` numbers; `None` if it is a remark.
/// # Errors
/// With the names, if x, y and z are not among those of a header.
fn named(words: &[String], width: usize, line: usize) -> Result<Option<Vec<String>>, ReadError> {
    let has = |axis: &str| words.iter().any(|w| canonical(w) == axis);
    if ["x", "y", "z"].into_iter().all(has) {
        return Ok(Some(words.to_vec()));
    }
    if words.len() != width {
        return Ok(None);
    }
    let list: Vec<String> = words.iter().take(MOST_NAMES).map(|w| shown(w.as_bytes())).collect();
    let more = if words.len() > MOST_NAMES { " ..." } else { "" };
    Err(ReadError::Header {
        what: format!("of the columns {}{more} nobody knows which are x, y and z", list.join(", ")),
        place: Place::Line(line),
        hint: "name them in their order with --columns, for example _,x,y,z",
    })
}

/// Columns that a message lists at most.
const MOST_NAMES: usize = 12;

/// Checks the names in `--columns` before any file is read.
/// # Errors
/// If x, y and z are not among them.
pub fn check_columns(text: &str) -> Result<(), ReadError> {
    parse_columns(text).map(drop)
}

/// The names in `--columns`: letters of their own (`xyzirgb`, `nnn` for a normal) or words parted by commas.
fn parse_columns(text: &str) -> Result<Vec<String>, ReadError> {
    let words: Vec<String> = if text.contains(',') {
        text.split(',').map(|w| w.trim().to_ascii_lowercase()).collect()
    } else {
        let mut normals = ["nx", "ny", "nz"].into_iter();
        text.chars()
            .map(|c| match c.to_ascii_lowercase() {
                'n' => normals.next().unwrap_or("_").to_string(),
                c => c.to_string(),
            })
            .collect()
    };
    if ["x", "y", "z"].iter().all(|a| words.iter().any(|w| canonical(w) == *a)) {
        return Ok(words);
    }
    Err(ReadError::Header {
        what: format!("the columns \"{}\" name no x, y and z", shown(text.as_bytes())),
        place: Place::Line(1),
        hint: "name them, for example xyzirgb or x,y,z,intensity",
    })
}

/// Short and long names of one thing.
fn canonical(name: &str) -> &str {
    // `x [m]`, `height (m)`: a unit belongs to no name.
    match name.split(['[', '(']).next().unwrap_or(name).trim() {
        "x" | "easting" | "east" | "//x" => "x",
        "y" | "northing" | "north" => "y",
        "z" | "height" | "elevation" => "z",
        "r" | "red" => "red",
        "g" | "green" => "green",
        "b" | "blue" => "blue",
        "i" | "intensity" | "reflectance" => "intensity",
        "nx" | "normal_x" => "nx",
        "ny" | "normal_y" => "ny",
        "nz" | "normal_z" => "nz",
        other => other,
    }
}

/// Columns after x, y, z: three of unit length are a normal, three whole numbers to 255 a colour, one an intensity.
fn guess(rows: &[f64], width: usize, extension: &str) -> Vec<String> {
    let mut names: Vec<String> = ["x", "y", "z"].map(String::from).into();
    let triple = |at: usize, test: &dyn Fn([f64; 3]) -> bool| {
        at + 3 <= width && rows.chunks(width).take(GUESSED_FROM).all(|r| test([r[at], r[at + 1], r[at + 2]]))
    };
    while names.len() < width {
        let at = names.len();
        if triple(at, &|v| ((v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt() - 1.0).abs() < 0.02) {
            names.extend(["nx", "ny", "nz"].map(String::from));
        } else if (extension != "pts" || at > 3)
            && triple(at, &|v| v.iter().all(|x| x.fract() == 0.0 && (0.0..=255.0).contains(x)))
        {
            names.extend(["red", "green", "blue"].map(String::from));
        } else if at == 3 {
            names.push("intensity".into());
        } else {
            names.push(format!("column_{}", at + 1));
        }
    }
    names
}

/// The points of rows, with colours as they are, and the largest number of a colour.
fn assemble(rows: &[f64], width: usize, names: &[String]) -> Result<(Cloud, f64), ReadError> {
    let find = |name: &str| names.iter().take(width).position(|n| canonical(n) == name);
    let (Some(x), Some(y), Some(z)) = (find("x"), find("y"), find("z")) else {
        return Err(ReadError::Header {
            what: format!("{width} columns hold no x, y and z"),
            place: Place::Line(1),
            hint: "name them with --columns, for example xyzirgb",
        });
    };
    let mut cloud = Cloud::new(rows.chunks(width).map(|r| DVec3::new(r[x], r[y], r[z])).collect());
    let mut used = vec![x, y, z];
    let mut brightest: f64 = 0.0;
    let groups = [("normal", ["nx", "ny", "nz"]), ("color", ["red", "green", "blue"])];
    for (name, members) in groups {
        let found: Vec<usize> = members.iter().filter_map(|m| find(m)).collect();
        if found.len() == 3 {
            let values = || rows.chunks(width).flat_map(|r| found.iter().map(|&k| r[k]));
            if name == "color" {
                brightest = values().fold(0.0, f64::max);
            }
            cloud.attributes.push(column(name, 3, values().map(|x| x as f32).collect()));
            used.extend(found);
        }
    }
    for (k, name) in names.iter().enumerate().take(width) {
        if !used.contains(&k) && !["_", "-"].contains(&name.as_str()) {
            let values = rows.chunks(width).map(|r| r[k] as f32).collect();
            cloud.attributes.push(column(canonical(name), 1, values));
        }
    }
    Ok((cloud, brightest))
}

/// Writes `x y z` and, if there are, normal, colour (0 to 255) and the single numbers, with a header line.
pub(super) fn write<W: Write>(out: &mut W, world: &[DVec3], cloud: &Cloud) -> Result<(), WriteError> {
    writeln!(out, concat!("# planish ", env!("CARGO_PKG_VERSION")))?;
    let mut head = String::from("# x y z");
    for a in &cloud.attributes {
        match (a.name.as_str(), a.width) {
            ("normal", 3) => head += " nx ny nz",
            ("color", 3) => head += " red green blue",
            (name, 1) => head += &format!(" {}", name.replace(char::is_whitespace, "_")),
            _ => {}
        }
    }
    writeln!(out, "{head}")?;
    for (i, p) in world.iter().enumerate() {
        write!(out, "{} {} {}", p.x, p.y, p.z)?;
        for a in &cloud.attributes {
            let values = &a.values[a.width * i..a.width * (i + 1)];
            match (a.name.as_str(), a.width) {
                ("color", 3) => {
                    for x in values {
                        write!(out, " {}", (x.clamp(0.0, 1.0) * 255.0).round())?;
                    }
                }
                ("normal", 3) | (_, 1) => {
                    for x in values {
                        write!(out, " {x}")?;
                    }
                }
                _ => {}
            }
        }
        writeln!(out)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_in_blocks_of_any_size_is_the_same_with_the_same_lines_in_its_errors() {
        let text: String = (0..300).map(|k| format!("{k} {} 0.5 {} 7 9\r\n", 2 * k, k % 256)).collect();
        let text = format!("# made by nobody\nx y z red green blue\n{text}");
        let read = |text: &str, size: usize| {
            let mut cloud = Cloud::default();
            let ending = in_blocks(text.as_bytes(), Reader::new("xyz", None)?, size, &mut |piece| {
                crate::scan::append(&mut cloud, piece);
                Ok(())
            })?;
            Ok::<_, ReadError>((cloud, ending.color_scale))
        };
        let whole = read(&text, BLOCK_BYTES).unwrap();
        assert_eq!((whole.0.points.len(), whole.1), (300, Some(1.0 / 255.0)));
        for size in [7, 64, 1000] {
            for ends in ["\r\n", "\n", "\r"] {
                assert_eq!(read(&text.replace("\r\n", "\n").replace('\n', ends), size).unwrap(), whole);
            }
        }
        assert_eq!([&text, &text.replace("\r\n", "\r")].map(|t| told(t.as_bytes()).unwrap()), [303, 301]);
        let wrong = text.replace("150 300 0.5 150 7 9", "150 300 0.5 x 7 9");
        let why = |size: usize| read(&wrong, size).unwrap_err().to_string();
        assert!(why(64) == why(BLOCK_BYTES) && why(64).contains("line 153"), "{}", why(64));
    }
}
