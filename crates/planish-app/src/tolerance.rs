//! Tolerances as users write them, with one meaning in every command: `0.05` and `0.05mm` are lengths, the first in
//! units of the input; `0.02%` is a share of the diagonal of the input's box.

use planish::Units;
use std::fmt;
use std::str::FromStr;

/// A length, or a share of the diagonal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// A length in units of the input.
    Length(f64),
    /// A length in a unit of its own.
    LengthIn(f64, Units),
    /// A share of the diagonal: 0.0002 for `0.02%`.
    Share(f64),
}

/// What lengths and shares of an input refer to.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// Diagonal of the box, units of the input.
    pub diagonal: f64,
    /// What one unit of the input is.
    pub units: Units,
}

impl Scale {
    /// Before the input is known, to check options: any size will do.
    pub const UNKNOWN: Scale = Scale { diagonal: 1.0, units: Units::Mm };
}

impl Tolerance {
    /// The length, units of the input.
    pub fn length(self, scale: Scale) -> f64 {
        match self {
            Tolerance::Length(x) => x,
            Tolerance::LengthIn(x, units) => x * (units.metres() / scale.units.metres()),
            Tolerance::Share(x) => x * scale.diagonal,
        }
    }

    /// The share of the diagonal.
    pub fn share(self, scale: Scale) -> f64 {
        match self {
            Tolerance::Share(x) => x,
            length => length.length(scale) / scale.diagonal,
        }
    }
}

/// What is asked of a text that is none.
pub const WANTED: &str =
    "a number above 0 is needed, alone, with a unit (0.05mm) or as a share of the diagonal (0.02%)";

impl FromStr for Tolerance {
    type Err = String;

    fn from_str(text: &str) -> Result<Tolerance, String> {
        let at =
            text.find(|c: char| c == '%' || c.is_ascii_alphabetic() && !matches!(c, 'e' | 'E')).unwrap_or(text.len());
        let (number, unit) = text.split_at(at);
        let x = match number.trim().parse::<f64>() {
            Ok(x) if x > 0.0 && x.is_finite() => x,
            _ => return Err(WANTED.into()),
        };
        match unit.trim() {
            "" => Ok(Tolerance::Length(x)),
            "%" => Ok(Tolerance::Share(x / 100.0)),
            unit => unit.parse().map(|units| Tolerance::LengthIn(x, units)).map_err(|_| WANTED.into()),
        }
    }
}

/// As it is written on the command line.
impl fmt::Display for Tolerance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Tolerance::Length(x) => write!(f, "{x}"),
            Tolerance::LengthIn(x, units) => write!(f, "{x}{units}"),
            Tolerance::Share(x) => write!(f, "{}%", x * 100.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tolerance_is_one_length_in_every_way_of_writing_it() {
        let part = Scale { diagonal: 10.0, units: Units::In };
        for text in ["0.02", "0.02in", "0.508mm", "0.0508 cm", "5.08e-4m", "0.2%", "2e-1 %"] {
            let tolerance: Tolerance = text.parse().unwrap();
            assert!((tolerance.length(part) - 0.02).abs() < 1e-15, "{text}");
            assert!((tolerance.share(part) - 0.002).abs() < 1e-15, "{text}");
        }
        for text in ["", "mm", "-1", "0", "0%", "nan", "inf", "1e999", "5ft", "1,5", "0.05mm2", "1 2", "e", "5%%"] {
            assert_eq!(text.parse::<Tolerance>(), Err(WANTED.to_owned()), "{text}");
        }
    }
}
