//! The state of a project as a page sees it: everything but geometry.

use super::{Layer, Why};
use planish::surface::Resolution;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Everything but geometry.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct State {
    /// Rises with every change of the drawing.
    pub revision: u64,
    /// The project; absent on the start page.
    pub project: Option<Project>,
    /// Projects in the folder, for the start page.
    pub files: Vec<String>,
    /// The stages in the order of the pipeline.
    pub stages: Vec<Stage>,
    /// Corners of the network.
    pub corners: Vec<[f32; 3]>,
    /// Curves of the network.
    pub curves: Vec<Curve>,
    /// Patches of the network.
    pub patches: Vec<Patch>,
    /// Feature curves: the patch that each is of.
    pub features: Vec<u32>,
    /// What is to be put right before all of the mesh is patches.
    pub faults: Vec<Fault>,
    /// Point and normal of the plane of symmetry.
    pub symmetry: Option<[[f64; 3]; 2]>,
    /// Edits that can be taken back, oldest first.
    pub done: Vec<Step>,
    /// Edits that can be made again, the next one last.
    pub undone: Vec<Step>,
    /// Geometry that there is, each with its name of now.
    pub layers: BTreeMap<Layer, String>,
    /// How fine surfaces are.
    pub resolution: Resolution,
    /// True if surfaces follow every edit.
    pub live: bool,
    /// Figures of quality; keys are those of the report.
    pub figures: BTreeMap<String, f64>,
    /// Seams, worst first.
    pub seams: Vec<Seam>,
    /// What the user should know of the surfaces.
    pub warnings: Vec<String>,
    /// Running jobs.
    pub jobs: Vec<Job>,
    /// What is known of the points of the scan.
    pub cleaned: Option<Cleaned>,
    /// Points of the scan that were left out by hand.
    pub left_out: u64,
    /// Holes of the mesh, the longest first, while they can be closed.
    pub holes: Vec<Hole>,
    /// Edits that were left for others, until the project is put away.
    pub branches: Vec<Branch>,
    /// The longest waves that the relief is shown with, world units.
    pub longest: Option<f64>,
    /// The other project that is looked at.
    pub peer: Option<Peer>,
    /// Edits of the relief, oldest first, by their names in a script.
    pub relief_done: Vec<String>,
    /// Those that can be made again, the next one last.
    pub relief_undone: Vec<String>,
}

impl State {
    /// The state without a project.
    pub fn empty(resolution: Resolution, live: bool) -> State {
        State {
            revision: 0,
            project: None,
            files: Vec::new(),
            stages: Vec::new(),
            corners: Vec::new(),
            curves: Vec::new(),
            patches: Vec::new(),
            features: Vec::new(),
            faults: Vec::new(),
            symmetry: None,
            done: Vec::new(),
            undone: Vec::new(),
            layers: BTreeMap::new(),
            resolution,
            live,
            figures: BTreeMap::new(),
            seams: Vec::new(),
            warnings: Vec::new(),
            jobs: Vec::new(),
            cleaned: None,
            left_out: 0,
            holes: Vec::new(),
            branches: Vec::new(),
            longest: None,
            peer: None,
            relief_done: Vec::new(),
            relief_undone: Vec::new(),
        }
    }
}

/// What is known of the points of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cleaned {
    /// Standard deviation of the points, world units.
    pub noise: f64,
    /// Distance of neighbouring points, world units.
    pub spacing: f64,
    /// Points that are outliers.
    pub outliers: u64,
    /// Pieces of surface that do not hang together.
    pub parts: u32,
    /// The edge of a cell that suits them, world units.
    pub voxel: f64,
}

/// A hole of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hole {
    /// Its length around, world units.
    pub around: f64,
    /// A place on it, world units.
    pub place: [f64; 3],
}

/// Edits that were left for others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Branch {
    /// Edits from the beginning on.
    pub edits: u32,
    /// Those of them that the drawing of now does not have, by their names in a script.
    pub own: Vec<String>,
}

/// Another project that is looked at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Peer {
    /// Its file name.
    pub file: String,
    /// Middle of its box; its geometry is sent relative to it.
    pub center: [f64; 3],
    /// Diagonal of its box.
    pub diagonal: f64,
    /// Curves of its network.
    pub curves: u32,
}

/// A project.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Project {
    /// Its name.
    pub name: String,
    /// Its file.
    pub file: String,
    /// True if the file holds all that was done.
    pub saved: bool,
    /// Why it cannot be saved.
    pub unsaved: Option<String>,
    /// Symbol of the unit of length.
    pub units: String,
    /// Triangles of the mesh.
    pub triangles: u64,
    /// Points of the scan.
    pub points: u64,
    /// Middle of the box; geometry is sent relative to it.
    pub center: [f64; 3],
    /// Diagonal of the box.
    pub diagonal: f64,
    /// True if the vertices of the mesh have colours.
    pub coloured: bool,
    /// What to know of how it was opened.
    pub notice: String,
}

/// A stage of the pipeline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// Which.
    pub name: StageName,
    /// How it stands.
    pub is: Standing,
    /// In words: how many, or why it failed.
    pub note: String,
}

/// Stages that the strip shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StageName {
    /// Points.
    Scan,
    /// Triangles.
    Mesh,
    /// Curves.
    Curves,
    /// Four-sided patches.
    Patches,
    /// B-splines with relief.
    Surfaces,
}

/// How a stage stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// Nothing there yet.
    Empty,
    /// There, but not all of it.
    Partial,
    /// There and of what is before it.
    Fresh,
    /// There, but of what was before it earlier.
    Stale,
    /// At work.
    Running,
    /// It could not be made.
    Failed,
}

/// A curve of the network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Curve {
    /// Corners at its ends.
    pub ends: [u32; 2],
    /// What it follows.
    pub kind: Kind,
    /// World units.
    pub length: f32,
    /// Control points along it, if it has surfaces.
    pub control: Option<u32>,
}

/// What a curve follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Smooth surface.
    Smooth,
    /// A sharp edge, or wanted sharp.
    Feature,
    /// The boundary of the mesh.
    Boundary,
}

/// A patch of the network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Patch {
    /// Its curves.
    pub curves: [u32; 4],
    /// Cells of its grid that were asked for, section by section: along u, and along v. Empty where they are left to the program.
    pub sections: [Vec<u32>; 2],
    /// Sections that its feature curves make along u and along v.
    pub parts: [u32; 2],
    /// Its surface, if it has one.
    pub fitted: Option<Fitted>,
}

/// The surface of a patch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fitted {
    /// Control points along u and v.
    pub control: [u32; 2],
    /// Cells of its grid along u and v.
    pub cells: [u32; 2],
    /// Root of the mean square distance to the mesh, world units.
    pub rms: f64,
    /// Largest distance, world units.
    pub max: f64,
}

/// Something to be put right.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// What, where and how.
    pub why: Why,
    /// An edit that puts it right.
    pub offer: Option<Offer>,
}

/// An edit that puts a fault right.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Offer {
    /// The region split.
    SplitRegion,
    /// The boundaries of the mesh drawn.
    Boundaries,
    /// The corner deleted.
    DeleteCorner,
}

/// A step of the history: one to the mesh, or an edit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// Its name in a script.
    pub edit: String,
    /// Corners, curves and patches after it; absent for a step to the mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub counts: Option<[u32; 3]>,
}

/// A seam between two patches.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Seam {
    /// Its curve.
    pub curve: u32,
    /// Largest angle, degrees.
    pub angle_deg: f64,
    /// Largest gap, world units.
    pub gap: f64,
    /// True if it is sharp on purpose.
    pub sharp: bool,
}

/// A running job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Job {
    /// Its number.
    pub job: u32,
    /// What it makes.
    pub title: String,
    /// The stage that it is at.
    pub stage: String,
    /// 0 to 1.
    pub fraction: f64,
    /// True if it can be ended early.
    pub can_stop: bool,
}
