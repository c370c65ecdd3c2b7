//! The table of headline figures with their floors: `figures.json`.

use super::measure::Figures;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// Which way a figure is better.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Better {
    Higher,
    Lower,
}

/// A figure that is guarded.
#[derive(Clone, Copy, Debug)]
pub struct Headline {
    /// Key in the report.
    pub key: &'static str,
    pub unit: &'static str,
    /// Units in one of the report.
    pub scale: f64,
    pub better: Better,
    /// How far from the median the floor is at least, in units and as a share of the median: three seeds may agree by
    /// chance.
    pub least_room: [f64; 2],
}

const fn headline(
    key: &'static str,
    (unit, scale): (&'static str, f64),
    better: Better,
    least_room: [f64; 2],
) -> Headline {
    Headline { key, unit, scale, better, least_room }
}

const SHARE: (&str, f64) = ("%", 100.0);
const LENGTH: (&str, f64) = ("% of the diagonal", 100.0);
const ANGLE: (&str, f64) = ("degrees", 1.0);
const COUNT: (&str, f64) = ("", 1.0);
const CPU: &str = "cpu";

/// The figures of a row, in the order of the table. What `truth.` begins is held against the part that was scanned,
/// what does not against the mesh of the scan.
pub const HEADLINES: [Headline; 19] = [
    headline("truth.sharp_found", SHARE, Better::Higher, [1.0, 0.0]),
    headline("truth.sharp_met", SHARE, Better::Higher, [2.0, 0.0]),
    headline("truth.sharp_false", SHARE, Better::Lower, [1.0, 0.0]),
    headline("truth.mesh_topology", COUNT, Better::Higher, [0.0, 0.0]),
    headline("truth.mesh_rms_rel", LENGTH, Better::Lower, [0.0, 0.03]),
    headline("truth.mesh_zone_deg", ANGLE, Better::Lower, [0.0, 0.03]),
    headline("patches.count", COUNT, Better::Lower, [0.0, 0.05]),
    headline("grid.folds", COUNT, Better::Lower, [2.0, 0.05]),
    headline("surface.rms_rel", LENGTH, Better::Lower, [0.0, 0.05]),
    headline("surface.max_rel", LENGTH, Better::Lower, [0.0, 0.1]),
    headline("displaced.rms_rel", LENGTH, Better::Lower, [0.0, 0.05]),
    headline("displaced.max_rel", LENGTH, Better::Lower, [0.0, 0.1]),
    headline("truth.surface_rms_rel", LENGTH, Better::Lower, [0.0, 0.05]),
    headline("truth.surface_max_rel", LENGTH, Better::Lower, [0.0, 0.1]),
    headline("truth.displaced_rms_rel", LENGTH, Better::Lower, [0.0, 0.05]),
    headline("truth.displaced_max_rel", LENGTH, Better::Lower, [0.0, 0.1]),
    headline("seam.angle_rms_deg", ANGLE, Better::Lower, [0.0, 0.05]),
    headline("seam.angle_max_deg", ANGLE, Better::Lower, [0.0, 0.1]),
    // Held by the least of the seeds: what else the machine does takes time and gives none.
    headline(CPU, ("calibration loops", 1.0), Better::Lower, [0.0, 1.0]),
];

/// A figure of a row as it was when the table was taken, in the unit of its headline.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Kept {
    pub unit: String,
    pub median: f64,
    /// Least and greatest of the seeds.
    pub spread: [f64; 2],
    /// The median may not be worse than this: a floor where higher is better, else a ceiling.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub floor: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ceiling: Option<f64>,
}

type Table = BTreeMap<String, BTreeMap<String, Kept>>;

/// A floor is at most this share of the median away from it: one seed of three that goes astray makes no guard loose.
const MOST_ROOM: f64 = 0.5;
/// Shares are at most so many percent away.
const MOST_SHARE: f64 = 5.0;

/// Significant digits in the table.
const DIGITS: i32 = 4;

/// `x` with the digits of the table, rounded by `round`.
fn digits(x: f64, round: fn(f64) -> f64) -> f64 {
    if x == 0.0 {
        return 0.0;
    }
    let unit = 10f64.powi(DIGITS - 1 - x.abs().log10().floor() as i32);
    round(x * unit) / unit
}

impl Headline {
    /// The entry of the table for measured values, lowest first: the floor is the spread of the seeds below the median,
    /// so that a change which only draws other numbers passes, but not farther than the most room.
    fn keep(&self, [low, median, high]: [f64; 3]) -> Kept {
        let least = self.least_room[0].max(self.least_room[1] * median);
        let most = if self.unit == SHARE.0 { MOST_SHARE } else { MOST_ROOM * median };
        // Of the time the spread is the machine's.
        let room = if self.key == CPU { least } else { (high - low).min(most).max(least) };
        let (floor, ceiling) = match self.better {
            Better::Higher => (Some(digits((median - room).max(0.0), f64::floor)), None),
            Better::Lower => (None, Some(digits(median + room, f64::ceil))),
        };
        let spread = [digits(low, f64::floor), digits(high, f64::ceil)];
        Kept { unit: self.unit.into(), median: digits(median, f64::round), spread, floor, ceiling }
    }

    /// Least, median and greatest of the runs in the unit of the table; nothing if no run has the figure.
    pub fn of(&self, runs: &[Figures]) -> Option<[f64; 3]> {
        super::measure::spread(runs.iter().filter_map(|run| Some(run.get(self.key)? * self.scale)).collect())
    }
}

fn path() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/regress/figures.json"))
}

pub fn read() -> Table {
    let text = std::fs::read_to_string(path()).unwrap_or_else(|_| "{}".into());
    serde_json::from_str(&text).expect("figures.json is a table of figures")
}

/// A line for each figure.
fn text(table: &Table) -> String {
    let mut text = String::from("{\n");
    for (r, (row, figures)) in table.iter().enumerate() {
        let _ = writeln!(text, "  \"{row}\": {{");
        let known: Vec<_> = HEADLINES.iter().filter_map(|h| Some((h.key, figures.get(h.key)?))).collect();
        for (f, (key, kept)) in known.iter().enumerate() {
            let kept = serde_json::to_string(kept).expect("numbers and names");
            let comma = if f + 1 < known.len() { "," } else { "" };
            let _ = writeln!(text, "    \"{key}\": {kept}{comma}");
        }
        text += if r + 1 < table.len() { "  },\n" } else { "  }\n" };
    }
    text + "}\n"
}

/// Rows are taken beside each other and written one after the other.
static WRITING: Mutex<()> = Mutex::new(());

/// Replaces one row of the table by what was measured.
pub fn write(row: &str, runs: &[Figures]) {
    let _guard = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
    let mut table = read();
    let kept = HEADLINES.iter().filter_map(|h| Some((h.key.to_owned(), h.keep(h.of(runs)?)))).collect();
    table.insert(row.into(), kept);
    std::fs::write(path(), text(&table)).expect("figures.json can be written");
}

/// The row of a table beside what was measured, a line for each figure, and those that are worse than their floor.
pub fn judge(row: &str, runs: &[Figures]) -> (String, Vec<&'static str>) {
    let table = read();
    let Some(kept) = table.get(row) else { return (format!("{row} is not in figures.json"), vec!["all"]) };
    let mut lines = format!("{row}\n{:26}{:>10}{:>24}{:>10}{:>10}\n", "", "median", "spread", "floor", "kept");
    let mut worse = Vec::new();
    for headline in HEADLINES {
        let (Some([low, median, high]), Some(kept)) = (headline.of(runs), kept.get(headline.key)) else {
            // Only the time may be unknown, where the system does not tell it.
            if headline.key != CPU {
                worse.push(headline.key);
            }
            let _ = writeln!(lines, "{:26}not measured or not kept", headline.key);
            continue;
        };
        let floor = kept.floor.or(kept.ceiling).unwrap_or(f64::NAN);
        let held = if headline.key == CPU { low } else { median };
        let (holds, better) = match headline.better {
            Better::Higher => (held >= floor, held - kept.median > kept.median - floor),
            Better::Lower => (held <= floor, kept.median - held > floor - kept.median),
        };
        let word = match (holds, better) {
            (false, _) => "  WORSE",
            (_, true) => "  better: raise the floor",
            _ => "",
        };
        if !holds {
            worse.push(headline.key);
        }
        let spread = format!("{low:.4} .. {high:.4}");
        let (key, unit, was) = (headline.key, headline.unit, kept.median);
        let _ = writeln!(lines, "{key:26}{median:10.4}{spread:>24}{floor:10.4}{was:10.4} {unit}{word}");
    }
    (lines, worse)
}
