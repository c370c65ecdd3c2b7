//! Pairs of places in files: TOML and CSV.

use super::super::edit::read_text;
use crate::failure::Failure;
use crate::files;
use planish::DVec3;
use planish::relief::layers::{Place, PlacePair};
use serde::Deserialize;
use std::path::Path;

/// The way out that is told of every broken file.
const HINT: &str = "write [[pair]] tables with `from` and `to`, or lines of six numbers";

/// A list of pairs as it stands in its file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Pairs {
    /// The pairs.
    #[serde(default)]
    pair: Vec<PlacePair>,
}

/// Reads pairs of places; those in space come near the origin, as the models are.
/// * `shifts` - what brings the models back to their places: that of FROM, that of MODEL
/// # Errors
/// For a file that is no such list.
pub fn read(path: &Path, shifts: [DVec3; 2]) -> Result<Vec<PlacePair>, Failure> {
    files::check_extension(path, &["toml", "csv"])?;
    let text = read_text(path)?;
    let is_csv = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
    let mut pairs = if is_csv { of_lines(&text) } else { of_tables(&text) }
        .map_err(|what| Failure::input(path, what).hint(HINT))?;
    let near = |place: &mut Place, shift: DVec3| {
        if let Place::Space(at) = place {
            *at = (DVec3::from(*at) - shift).to_array();
        }
    };
    for pair in &mut pairs {
        near(&mut pair.from, shifts[0]);
        near(&mut pair.to, shifts[1]);
    }
    Ok(pairs)
}

fn of_tables(text: &str) -> Result<Vec<PlacePair>, String> {
    let told = |e: toml::de::Error| {
        let line = e.span().map_or(1, |s| text[..s.start.min(text.len())].matches('\n').count() + 1);
        format!("{} (line {line})", e.message().trim().replace('\n', ", "))
    };
    toml::from_str::<Pairs>(text).map(|list| list.pair).map_err(told)
}

/// Six numbers a line, between commas, semicolons or blanks. Empty lines, what follows a `#` and a first line of names are left out.
fn of_lines(text: &str) -> Result<Vec<PlacePair>, String> {
    let mut pairs = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default();
        let words: Vec<&str> = line.split([',', ';', ' ', '\t']).filter(|w| !w.trim().is_empty()).collect();
        let numbers: Vec<f64> = words.iter().filter_map(|w| w.trim().parse().ok()).collect();
        let is_head = pairs.is_empty() && numbers.is_empty();
        match numbers[..] {
            _ if is_head => {}
            [a, b, c, d, e, f] if words.len() == 6 => {
                pairs.push(PlacePair { from: Place::Space([a, b, c]), to: Place::Space([d, e, f]) });
            }
            _ => return Err(format!("six numbers are needed in line {}", k + 1)),
        }
    }
    Ok(pairs)
}
