//! Points as lines of numbers: XYZ, TXT, CSV, ASC, PTS.

use super::column;
use crate::text::{Lines, shown};
use crate::{Place, ReadError, WriteError};
use glam::DVec3;
use planish::cloud::Cloud;
use std::io::Write;

/// Columns of one line, split at blanks, commas, semicolons and tabs.
fn words(line: &[u8]) -> Vec<&[u8]> {
    line.split(|b| b.is_ascii_whitespace() || *b == b',' || *b == b';').filter(|w| !w.is_empty()).collect()
}

fn number(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// Reads points. `columns` names them; without it a header line does, else their number and range.
pub(super) fn read(bytes: &[u8], extension: &str, columns: Option<&str>) -> Result<Cloud, ReadError> {
    let mut lines = Lines::new(bytes, 0, 1);
    let mut names: Option<Vec<String>> = columns.map(parse_columns).transpose()?;
    let mut rows: Vec<f64> = Vec::new();
    let mut width = 0;
    let mut count = 0;
    let mut header_seen = false;
    while let Some(line) = lines.next_line() {
        let mut line = line.trim_ascii();
        let comment = line.starts_with(b"#") || line.starts_with(b"//");
        if comment {
            line = line.trim_ascii_start().strip_prefix(b"//").unwrap_or(&line[1..]).trim_ascii();
        }
        let found = words(line);
        if found.is_empty() {
            continue;
        }
        let numbers: Vec<Option<f64>> = found.iter().map(|w| number(w)).collect();
        if comment || numbers.iter().all(Option::is_none) {
            // A line of words before the data names the columns.
            if count == 0 && numbers.iter().all(Option::is_none) && found.len() >= 3 && !header_seen {
                let header: Vec<String> =
                    found.iter().map(|w| String::from_utf8_lossy(w).trim_matches('"').to_ascii_lowercase()).collect();
                if names.is_none() && header.iter().any(|n| canonical(n) == "x") {
                    names = Some(header);
                    header_seen = true;
                }
                continue;
            }
            if comment || count == 0 {
                continue;
            }
        }
        // PTS begins each scan with the number of its points.
        if found.len() == 1 && (extension == "pts" || count == 0) && numbers[0].is_some_and(|n| n.fract() == 0.0) {
            continue;
        }
        if width == 0 {
            width = found.len();
            if width < 3 {
                let what = format!("a line has {width} numbers, a point needs 3");
                return Err(ReadError::Syntax { what, place: Place::Line(lines.number()) });
            }
        }
        if found.len() < width {
            let what = format!("a line has {} numbers, those before have {width}", found.len());
            return Err(ReadError::Syntax { what, place: Place::Line(lines.number()) });
        }
        for k in 0..width {
            let Some(x) = numbers[k] else {
                let what = format!("\"{}\" is not a number", shown(found[k]));
                return Err(ReadError::Syntax { what, place: Place::Line(lines.number()) });
            };
            rows.push(x);
        }
        count += 1;
    }
    if count == 0 {
        return Err(ReadError::NoPoints);
    }
    let names = names.unwrap_or_else(|| guess(&rows, width, extension));
    assemble(&rows, width, count, &names)
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
        what: format!("the columns \"{text}\" name no x, y and z"),
        place: Place::Line(1),
        hint: "name them, for example xyzirgb or x,y,z,intensity",
    })
}

/// Short and long names of one thing.
fn canonical(name: &str) -> &str {
    match name {
        "x" | "easting" | "//x" => "x",
        "y" | "northing" => "y",
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
        at + 3 <= width && rows.chunks(width).take(1000).all(|r| test([r[at], r[at + 1], r[at + 2]]))
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

fn assemble(rows: &[f64], width: usize, count: usize, names: &[String]) -> Result<Cloud, ReadError> {
    let find = |name: &str| names.iter().take(width).position(|n| canonical(n) == name);
    let (Some(x), Some(y), Some(z)) = (find("x"), find("y"), find("z")) else {
        return Err(ReadError::Header {
            what: format!("{width} columns hold no x, y and z"),
            place: Place::Line(1),
            hint: "name them with --columns, for example xyzirgb",
        });
    };
    let mut cloud = Cloud::new((0..count).map(|i| &rows[i * width..]).map(|r| DVec3::new(r[x], r[y], r[z])).collect());
    let mut used = vec![x, y, z];
    let groups = [("normal", ["nx", "ny", "nz"]), ("color", ["red", "green", "blue"])];
    for (name, members) in groups {
        let found: Vec<usize> = members.iter().filter_map(|m| find(m)).collect();
        if found.len() == 3 {
            let most = rows.chunks(width).flat_map(|r| found.iter().map(|&k| r[k])).fold(0.0, f64::max);
            let scale = match name {
                "color" if most > 255.0 => 1.0 / 65535.0,
                "color" if most > 1.0 => 1.0 / 255.0,
                _ => 1.0,
            };
            let values = rows.chunks(width).flat_map(|r| found.iter().map(|&k| (r[k] * scale) as f32)).collect();
            cloud.attributes.push(column(name, 3, values));
            used.extend(found);
        }
    }
    for (k, name) in names.iter().enumerate().take(width) {
        if !used.contains(&k) && !["_", "-"].contains(&name.as_str()) {
            let values = rows.chunks(width).map(|r| r[k] as f32).collect();
            cloud.attributes.push(column(canonical(name), 1, values));
        }
    }
    Ok(cloud)
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
