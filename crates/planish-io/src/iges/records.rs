//! The card images of an IGES file: sections of lines of 80 columns, numbers and strings in them.

use crate::{Place, WriteError};
use planish::DVec3;
use std::fmt::Write;

/// Columns of a line for the start and the global section.
const WIDTH: usize = 72;
/// Columns of a line for parameters; behind them stands the entity that they belong to.
const PARAMETERS: usize = 64;
/// Lines that a section may have: their numbers have seven digits.
const LINES: usize = 9_999_999;

/// What the directory tells of an entity besides its type and form.
#[derive(Clone, Copy)]
pub(super) enum Role {
    /// It stands for itself.
    Free,
    /// It is a part of another entity.
    Part,
    /// It lives in the parameters of a surface and is a part of another entity.
    Flat,
    /// It says what others point to: a colour, a name.
    Definition,
}

impl Role {
    /// The status number: visible, subordinate, use, hierarchy.
    fn status(self) -> &'static str {
        match self {
            Role::Free => "00000000",
            Role::Part => "00010000",
            Role::Flat => "00010500",
            Role::Definition => "00010200",
        }
    }
}

/// What people see of an entity.
#[derive(Clone, Copy, Default)]
pub(super) struct Mark {
    /// A word of up to eight letters and the number behind it.
    pub label: Option<(&'static str, usize)>,
    /// Pointer to its colour.
    pub color: Option<usize>,
    /// Pointer to its name.
    pub name: Option<usize>,
}

/// Directory and parameters as they grow.
#[derive(Default)]
pub(super) struct Records {
    directory: String,
    parameters: String,
    entities: usize,
    lines: usize,
}

impl Records {
    /// Adds an entity; returns what others name it by: the number of its line in the directory.
    /// * `kind` - its type and form
    pub fn add(&mut self, kind: [u32; 2], role: Role, mark: Mark, values: &[String]) -> usize {
        let pointer = 2 * self.entities + 1;
        self.entities += 1;
        let first = self.lines + 1;
        let number = kind[0].to_string();
        // Behind the parameters of the entity: no associations, one property.
        let name: Vec<String> =
            mark.name.map(|p| ["0".into(), "1".into(), p.to_string()]).into_iter().flatten().collect();
        let all: Vec<&str> = std::iter::once(&number).chain(values).chain(&name).map(String::as_str).collect();
        for line in packed(&all, PARAMETERS) {
            self.lines += 1;
            // Writing to a string does not fail.
            let _ = writeln!(self.parameters, "{line:PARAMETERS$} {pointer:>7}P{:>7}", self.lines);
        }
        let count = self.lines + 1 - first;
        let (kind, form) = (kind[0], kind[1]);
        let (label, number) = mark.label.unwrap_or(("", 0));
        // A colour that is defined is pointed to by a negative number.
        let color = mark.color.map_or("0".into(), |p| format!("-{p}"));
        let _ = writeln!(
            self.directory,
            "{kind:>8}{first:>8}{zero:>8}{zero:>8}{zero:>8}{zero:>8}{zero:>8}{zero:>8}{status}D{pointer:>7}",
            zero = 0,
            status = role.status(),
        );
        let _ = writeln!(
            self.directory,
            "{kind:>8}{zero:>8}{color:>8}{count:>8}{form:>8}{blank:>8}{blank:>8}{label:>8}{number:>8}D{:>7}",
            pointer + 1,
            zero = 0,
            blank = "",
        );
        pointer
    }

    /// The whole file.
    /// # Errors
    /// `WriteError::Value` if a section has more lines than the format can count.
    pub fn finish(self, start: &str, global: &[String]) -> Result<String, WriteError> {
        if self.lines.max(2 * self.entities) > LINES {
            let value = format!("an IGES file of {} lines", self.lines);
            let hint = "the format counts to 9 999 999; write STEP";
            return Err(WriteError::Value { value, place: Place::Line(LINES), hint });
        }
        let mut text = String::new();
        let _ = writeln!(text, "{start:WIDTH$}S{:>7}", 1);
        let global: Vec<&str> = global.iter().map(String::as_str).collect();
        let global = packed(&global, WIDTH);
        for (k, line) in global.iter().enumerate() {
            let _ = writeln!(text, "{line:WIDTH$}G{:>7}", k + 1);
        }
        text.push_str(&self.directory);
        text.push_str(&self.parameters);
        let counts = format!("S{:>7}G{:>7}D{:>7}P{:>7}", 1, global.len(), 2 * self.entities, self.lines);
        let _ = writeln!(text, "{counts:WIDTH$}T{:>7}", 1);
        Ok(text)
    }
}

/// Values with their delimiters on lines. A value stays on one line, unless it is a string that is longer than a line.
fn packed(values: &[&str], width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for (k, value) in values.iter().enumerate() {
        let value = format!("{value}{}", if k + 1 < values.len() { ',' } else { ';' });
        let mut rest = value.as_str();
        while !rest.is_empty() {
            let used = lines.last().map_or(0, String::len);
            if used > 0 && used + rest.len() > width {
                lines.push(String::new());
                continue;
            }
            let (now, later) = rest.split_at(rest.len().min(width));
            if let Some(line) = lines.last_mut() {
                line.push_str(now);
            }
            rest = later;
        }
    }
    lines
}

/// The shortest real that reads back as the same bits, with a point; a D before an exponent is double precision.
pub(super) fn real(x: f64) -> String {
    let short = format!("{x:?}");
    match short.split_once('e') {
        Some((mantissa, exponent)) if mantissa.contains('.') => format!("{mantissa}D{exponent}"),
        Some((mantissa, exponent)) => format!("{mantissa}.D{exponent}"),
        None => short.strip_suffix(".0").map(|whole| format!("{whole}.")).unwrap_or(short),
    }
}

/// The coordinates of a point.
pub(super) fn coordinates(p: DVec3) -> impl Iterator<Item = String> {
    p.to_array().into_iter().map(real)
}

/// A string with its length before it; what is not ASCII, which the format cannot hold, becomes `_`.
pub(super) fn text(words: &str) -> String {
    let plain: String = words.chars().map(|c| if (' '..='~').contains(&c) { c } else { '_' }).collect();
    // An empty string is left out: the default.
    if plain.is_empty() { plain } else { format!("{}H{plain}", plain.len()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reals_have_a_point_and_a_d_and_read_back_as_the_same_bits() {
        for (x, shown) in [(1.0, "1."), (-0.1, "-0.1"), (1e-7, "1.D-7"), (1.5e300, "1.5D300"), (0.0, "0.")] {
            assert_eq!(real(x), shown);
        }
        for x in [1.0 / 3.0, std::f64::consts::PI * 1e-20, 123_456_789.123_456_79] {
            assert_eq!(real(x).replace('D', "e").parse::<f64>().unwrap().to_bits(), x.to_bits());
        }
    }

    #[test]
    fn values_stay_on_a_line_of_10_columns_and_only_longer_strings_are_cut() {
        assert_eq!(packed(&["1234", "5678", "9"], 10), ["1234,5678,", "9;"]);
        assert_eq!(packed(&["12345", "67890"], 10), ["12345,", "67890;"]);
        assert_eq!(packed(&["1", "12Habcdefghijkl", "2"], 10), ["1,", "12Habcdefg", "hijkl,2;"]);
        assert_eq!((text("ä,b"), text("")), ("3H_,b".into(), String::new()));
    }
}
