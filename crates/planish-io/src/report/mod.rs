//! The report of a run: `report.json` for programs, `report.html` for people.
//!
//! Both are written from one [`Report`]; the page adds pictures. Keys are documented in the guide and only
//! ever added to.

mod gallery;
mod page;
mod verdict;
mod words;

pub use gallery::{Picture, Place, Scale};
pub use page::{html, table_page};
pub use verdict::{State, verdict};
pub use words::{count, distance, number, percent};

use planish::edit::CurveNumber;
use planish::pipeline::{Figure, Quality, StageRecord, Warning};
use planish::register::Histogram;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a command tells of its work.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Version of the program.
    pub planish: String,
    /// Name of the command.
    pub command: String,
    /// What went in.
    pub input: Input,
    /// Stages in the order they ran.
    pub stages: Vec<StageRecord>,
    /// Figures of quality by key: flat; distances in input units, with `_rel` fractions of the diagonal.
    pub quality: Quality,
    /// What a user should know.
    pub warnings: Vec<Warning>,
    /// Seams, worst first; absent where no seam was measured.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub seams: Vec<SeamRow>,
    /// What every edit of a script did; absent for other commands.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub edits: Vec<EditRow>,
    /// Distances in classes; absent but after `compare`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub histogram: Option<Histogram>,
}

/// What one edit of a script did. Numbers are those after it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EditRow {
    /// Its number in the script, from 1.
    pub step: usize,
    /// Its line in the script, from 1.
    pub line: usize,
    /// Its name.
    pub edit: String,
    /// False if the drawing is what it was.
    pub changed: bool,
    /// Corners that are new or have moved.
    pub corners: Vec<u32>,
    /// Curves that are new or have another course.
    pub curves: Vec<u32>,
    /// Feature curves that are new.
    pub features: Vec<u32>,
    /// How curves relaxed.
    pub relaxed: Vec<RelaxedRow>,
    /// How many things are to be put right before all of the mesh is patches; null where no curve changed.
    pub faults: Option<usize>,
}

/// How a curve relaxed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RelaxedRow {
    /// The curve: `curve` or `feature` with its number.
    #[serde(flatten)]
    pub curve: CurveNumber,
    /// Sweeps made.
    pub sweeps: usize,
    /// True if it came to rest.
    pub settled: bool,
    /// Largest move of the last sweep over the distance of its points.
    pub last_move: f64,
    /// Energy before and after, input units squared.
    pub energy: [f64; 2],
    /// The same by its terms: fairness, curvature, arc length.
    pub terms: [[f64; 3]; 2],
}

/// What went into a command.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Input {
    /// Path as the user gave it.
    pub path: String,
    /// `mesh`, `model` or `network`.
    pub kind: String,
    /// How many of what.
    pub counts: BTreeMap<String, u64>,
    /// What one unit of a coordinate is: `mm`, `cm`, `m`, `in`.
    pub units: String,
    /// Diagonal of the bounding box, input units.
    pub diagonal: f64,
}

/// One seam between two patches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeamRow {
    /// Curve of the network.
    pub curve: u32,
    /// The patches on its two sides.
    pub patches: [u32; 2],
    /// True along a feature: such a seam is meant to have an angle.
    pub feature: bool,
    /// Length of the seam, input units.
    pub length: f64,
    /// Largest distance between the two boundaries, input units.
    pub gap_max: f64,
    /// Largest angle between the two normals, degrees.
    pub angle_max_deg: f64,
    /// Root mean square of that angle, degrees.
    pub angle_rms_deg: f64,
    /// Largest angle but at the ends, where a surface may have no normal of its own, degrees.
    #[serde(default)]
    pub inner_angle_max_deg: f64,
    /// True if the surfaces beside it turn back over each other.
    #[serde(default)]
    pub folded: bool,
}

impl Report {
    /// A report without results yet.
    pub fn new(command: &str, input: Input) -> Report {
        Report {
            planish: env!("CARGO_PKG_VERSION").into(),
            command: command.into(),
            input,
            stages: Vec::new(),
            quality: Quality::new(),
            warnings: Vec::new(),
            seams: Vec::new(),
            edits: Vec::new(),
            histogram: None,
        }
    }

    /// The report as JSON text.
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }

    /// A figure by its key, as a number.
    pub fn figure(&self, key: &str) -> Option<f64> {
        self.quality.get(key).map(|f| f.value())
    }

    /// A length among the figures in words, with its share of the diagonal that the figure `KEY_rel` tells.
    pub fn length(&self, key: &str) -> String {
        let value = self.figure(key).unwrap_or(0.0);
        match self.figure(&format!("{key}_rel")) {
            Some(share) if share > 0.0 => distance(value, value / share, &self.input.units),
            _ => distance(value, self.input.diagonal, &self.input.units),
        }
    }

    /// A yes-or-no figure by its key.
    pub fn flag(&self, key: &str) -> Option<bool> {
        match self.quality.get(key) {
            Some(Figure::Flag(yes)) => Some(*yes),
            _ => None,
        }
    }
}
