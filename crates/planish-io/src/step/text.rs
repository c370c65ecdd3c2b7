//! The text of a STEP file: numbered entities, reals, strings.

use planish::DVec3;
use std::collections::HashMap;
use std::fmt::Write;

/// The data section as it grows.
#[derive(Default)]
pub(super) struct Entities {
    body: String,
    last: usize,
    /// Numbers of the points written so far, by their bits: looked up only, so its order does not matter.
    points: HashMap<[u64; 3], usize>,
}

impl Entities {
    /// Adds an entity; returns its number.
    pub fn add(&mut self, entity: String) -> usize {
        self.last += 1;
        // Writing to a string does not fail.
        let _ = writeln!(self.body, "#{}={entity};", self.last);
        self.last
    }

    /// A point; the same place is written once.
    pub fn point(&mut self, p: DVec3) -> usize {
        let key = p.to_array().map(f64::to_bits);
        if let Some(&id) = self.points.get(&key) {
            return id;
        }
        let id = self.add(format!("CARTESIAN_POINT('',({},{},{}))", real(p.x), real(p.y), real(p.z)));
        self.points.insert(key, id);
        id
    }

    /// A list of points.
    pub fn points(&mut self, points: &[DVec3]) -> String {
        let ids: Vec<usize> = points.iter().map(|&p| self.point(p)).collect();
        list(&ids)
    }

    pub fn finish(self) -> String {
        self.body
    }
}

/// A list of references.
pub(super) fn list(ids: &[usize]) -> String {
    let words: Vec<String> = ids.iter().map(|id| format!("#{id}")).collect();
    format!("({})", words.join(","))
}

/// The shortest real that reads back as the same bits; a STEP real has a point and a capital E.
pub(super) fn real(x: f64) -> String {
    let short = format!("{x:?}");
    match short.split_once('e') {
        Some((mantissa, exponent)) if mantissa.contains('.') => format!("{mantissa}E{exponent}"),
        Some((mantissa, exponent)) => format!("{mantissa}.E{exponent}"),
        None => short.strip_suffix(".0").map(|whole| format!("{whole}.")).unwrap_or(short),
    }
}

/// A quoted string: quotes and backslashes doubled, everything outside ASCII as UTF-16.
pub(super) fn text(words: &str) -> String {
    let mut out = String::from("'");
    for c in words.chars() {
        match c {
            '\'' => out.push_str("''"),
            '\\' => out.push_str("\\\\"),
            ' '..='~' => out.push(c),
            _ => {
                out.push_str("\\X2\\");
                let mut units = [0; 2];
                for unit in c.encode_utf16(&mut units) {
                    let _ = write!(out, "{unit:04X}");
                }
                out.push_str("\\X0\\");
            }
        }
    }
    out.push('\'');
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reals_have_a_point_and_read_back_as_the_same_bits() {
        for (x, shown) in [(1.0, "1."), (-0.1, "-0.1"), (1e-7, "1.E-7"), (1.5e300, "1.5E300"), (0.0, "0.")] {
            assert_eq!(real(x), shown);
        }
        for x in [1.0 / 3.0, std::f64::consts::PI * 1e-20, 123_456_789.123_456_79] {
            assert_eq!(real(x).parse::<f64>().unwrap().to_bits(), x.to_bits());
        }
    }

    #[test]
    fn strings_double_quotes_and_escape_what_is_not_ascii() {
        assert_eq!(text("it's \\ ä"), "'it''s \\\\ \\X2\\00E4\\X0\\'");
    }
}
