//! What page and server say to each other. Control is JSON, one message per text frame; geometry comes in binary frames.
//!
//! The types of the page are written from these (`tests/protocol.rs`), and both sides read the golden messages in `protocol/`.

pub mod frame;
pub mod state;

use planish::edit::{CurveName, Edit};
use planish::relief::layers::ReliefEdit;
use planish::surface::Resolution;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
pub use state::State;

/// Version of the protocol: a page of another version loads itself anew.
pub const VERSION: u32 = 1;

/// What the page asks for. Every request is answered once, by `done`, `refused`, or what it asks for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// An edit made, as one entry of the history.
    Edit {
        /// Number of the request.
        id: u32,
        /// The edit, as a script has it.
        edit: Edit,
    },
    /// An edit tried on a copy: what would come of it.
    Try {
        /// Number of the request.
        id: u32,
        /// The edit.
        edit: Edit,
    },
    /// Surfaces made anew from the curves.
    Fit {
        /// Number of the request.
        id: u32,
        /// True to pause at coarse grids, so that one sees early how they run.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        coarse: bool,
    },
    /// One patch tried alone with numbers of control points of its own, or with the fewest that keep a tolerance.
    TryPatch {
        /// Number of the request.
        id: u32,
        /// The patch.
        patch: u32,
        /// Along u and v; absent for the fewest that keep the tolerance.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        control: Option<[usize; 2]>,
        /// Largest RMS distance, world units.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        tolerance: Option<f64>,
    },
    /// Control vertices of the space curve that a curve would be drawn through.
    Handles {
        /// Number of the request.
        id: u32,
        /// The curve.
        curve: CurveName,
        /// How many.
        control: usize,
    },
    /// The displacement map of a patch.
    Map {
        /// Number of the request.
        id: u32,
        /// The patch.
        patch: u32,
    },
    /// Reliefs shown as they are, or only their waves shorter than a length.
    Relief {
        /// Number of the request.
        id: u32,
        /// The longest waves that are shown, world units; all if absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        longest: Option<f64>,
    },
    /// An edit of the relief, as a script of `planish relief` has it. Surfaces that are made anew get it again.
    Sculpt {
        /// Number of the request.
        id: u32,
        /// The edit.
        edit: ReliefEdit,
    },
    /// Edits of the relief taken back.
    Unsculpt {
        /// Number of the request.
        id: u32,
        /// How many.
        count: usize,
    },
    /// Edits of the relief made again.
    Resculpt {
        /// Number of the request.
        id: u32,
        /// How many.
        count: usize,
    },
    /// Noise, normals and outliers of the scan.
    Clean {
        /// Number of the request.
        id: u32,
    },
    /// Points of the scan left out: those within a line around them on the screen, or those without.
    Lasso {
        /// Number of the request.
        id: u32,
        /// From the places that geometry is sent in to clip space, column by column.
        view: [f64; 16],
        /// Corners of the line, from -1 to 1.
        line: Vec<[f64; 2]>,
        /// True to leave out what lies without.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        outside: bool,
    },
    /// One hole of the mesh closed; before curves are drawn.
    CloseHole {
        /// Number of the request.
        id: u32,
        /// Its number.
        hole: u32,
    },
    /// Another project of the folder looked at, so that its network can be carried over.
    Peer {
        /// Number of the request.
        id: u32,
        /// Its file name; absent to put it away.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        file: Option<String>,
    },
    /// Edits that were left for others, taken up again.
    Branch {
        /// Number of the request.
        id: u32,
        /// Which.
        branch: u32,
    },
    /// How fine surfaces are, and whether they follow every edit.
    Setting {
        /// Number of the request.
        id: u32,
        /// How many control points.
        resolution: Resolution,
        /// True to make surfaces anew after every edit.
        live: bool,
    },
    /// A mesh made of the scan.
    Mesh {
        /// Number of the request.
        id: u32,
        /// Holes closed (true), left open (false) or as the scan is (absent).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        close: Option<bool>,
        /// Cells along the longest side; those that suit the scan if absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        resolution: Option<usize>,
        /// The edge of a cell, world units; in place of their number.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        voxel: Option<f64>,
    },
    /// A job ended without its result.
    Cancel {
        /// Number of the request.
        id: u32,
        /// The job.
        job: u32,
    },
    /// Geometry by name; it comes in binary frames.
    Get {
        /// Number of the request.
        id: u32,
        /// Which.
        layer: Layer,
    },
    /// A file made of the model, to be downloaded.
    Export {
        /// Number of the request.
        id: u32,
        /// What kind of file.
        format: Format,
    },
    /// The edits as a script.
    Script {
        /// Number of the request.
        id: u32,
        /// True for those of the relief.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        relief: bool,
    },
    /// A made part to try things on.
    Sample {
        /// Number of the request.
        id: u32,
        /// Which.
        sample: Sample,
    },
    /// A project of the folder opened.
    Open {
        /// Number of the request.
        id: u32,
        /// Its file name.
        file: String,
    },
    /// The project put away, for another one.
    Close {
        /// Number of the request.
        id: u32,
    },
}

impl Request {
    /// Its number.
    pub fn id(&self) -> u32 {
        match *self {
            Request::Edit { id, .. }
            | Request::Try { id, .. }
            | Request::Fit { id, .. }
            | Request::TryPatch { id, .. }
            | Request::Handles { id, .. }
            | Request::Map { id, .. }
            | Request::Relief { id, .. }
            | Request::Sculpt { id, .. }
            | Request::Unsculpt { id, .. }
            | Request::Resculpt { id, .. }
            | Request::Clean { id }
            | Request::Lasso { id, .. }
            | Request::CloseHole { id, .. }
            | Request::Peer { id, .. }
            | Request::Branch { id, .. }
            | Request::Setting { id, .. }
            | Request::Mesh { id, .. }
            | Request::Cancel { id, .. }
            | Request::Get { id, .. }
            | Request::Export { id, .. }
            | Request::Script { id, .. }
            | Request::Sample { id, .. }
            | Request::Open { id, .. }
            | Request::Close { id } => id,
        }
    }
}

/// Geometry that a view shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Layer {
    /// Points of the scan.
    Points,
    /// The mesh.
    Mesh,
    /// A mesh of fewer triangles, shown while the view moves.
    Coarse,
    /// Curves of the network.
    Curves,
    /// Feature curves.
    Features,
    /// The fitted surfaces, with what is measured on them.
    Surfaces,
    /// The surfaces with their relief.
    Displaced,
    /// Iso-curves of the grids.
    Isolines,
    /// Control nets.
    Nets,
    /// The mesh of the other project that is looked at.
    Peer,
}

/// A file to be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// STEP AP242.
    Step,
    /// IGES 5.3.
    Iges,
    /// USD with patches and the displaced mesh.
    Usd,
    /// The displaced mesh as GLB.
    Glb,
    /// The displaced mesh as PLY.
    Ply,
    /// The report as a page.
    Report,
}

/// A made part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sample {
    /// The demonstration part as a mesh.
    Part,
    /// A noisy scan of it.
    Scan,
    /// A bracket as a mesh.
    Bracket,
}

/// What the server says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Message {
    /// The first message of a connection.
    Welcome {
        /// Version of the protocol.
        protocol: u32,
        /// Version of the program.
        version: String,
        /// Names this run of the server: names of geometry are of one run.
        run: String,
    },
    /// Everything but geometry, after every change.
    State(Box<State>),
    /// A request is done.
    Done {
        /// Number of the request.
        id: u32,
        /// The job that goes on with it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        job: Option<u32>,
        /// What it did, in words.
        #[serde(default, skip_serializing_if = "String::is_empty")]
        told: String,
    },
    /// A request is refused, or its job failed.
    Refused {
        /// Number of the request; 0 for what nobody asked for.
        id: u32,
        /// What is wrong and what to do.
        why: Why,
    },
    /// What an edit would do.
    Tried {
        /// Number of the request.
        id: u32,
        /// Courses of curves that would be new or changed, x, y and z in turn.
        curves: Vec<Vec<f32>>,
        /// Corners that would be new or moved.
        corners: Vec<[f32; 3]>,
    },
    /// How near a patch alone comes.
    TriedPatch {
        /// Number of the request.
        id: u32,
        /// Control points along u and v.
        control: [usize; 2],
        /// Root of the mean square distance to its grid, world units.
        rms: f64,
        /// Largest distance, world units.
        max: f64,
    },
    /// Control vertices of a curve.
    Handles {
        /// Number of the request.
        id: u32,
        /// World positions.
        points: Vec<[f64; 3]>,
    },
    /// A displacement map.
    Map {
        /// Number of the request.
        id: u32,
        /// Texels along u.
        cols: u32,
        /// Texels along v.
        rows: u32,
        /// Heights along the normal, world units, the row of v = 0 first.
        heights: Vec<f32>,
        /// Root of the mean square displacement.
        rms: f64,
        /// Largest displacement.
        most: f64,
    },
    /// How far jobs are.
    Progress {
        /// All running jobs.
        jobs: Vec<state::Job>,
    },
    /// The edits as a script.
    Script {
        /// Number of the request.
        id: u32,
        /// TOML for `planish edit`.
        text: String,
    },
    /// A file is ready.
    Exported {
        /// Number of the request.
        id: u32,
        /// Where it is fetched.
        url: String,
        /// Its name.
        name: String,
        /// Its size, bytes.
        bytes: u64,
    },
}

/// Why something was refused.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Why {
    /// What is wrong.
    pub message: String,
    /// The way out; empty if there is none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub hint: String,
    /// Where, world units.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<[f64; 3]>,
}

impl Why {
    /// What an error of the library says: `what is wrong (where) - hint: what to do`, the place as three numbers.
    pub fn of(error: impl std::fmt::Display) -> Why {
        let text = error.to_string();
        let (message, hint) = text.split_once(" - hint: ").unwrap_or((&text, ""));
        Why { place: place_in(message), message: message.into(), hint: hint.into() }
    }
}

/// The first three numbers in brackets.
fn place_in(text: &str) -> Option<[f64; 3]> {
    text.split('(').skip(1).find_map(|part| {
        let numbers: Option<Vec<f64>> = part.split_once(')')?.0.split(',').map(|n| n.trim().parse().ok()).collect();
        numbers?.try_into().ok().filter(|p: &[f64; 3]| p.iter().all(|x| x.is_finite()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_keeps_message_hint_and_place_apart() {
        let why = Why::of("no curves run around (1.5, -2, 0.25) yet - hint: draw some");
        assert_eq!(why.place, Some([1.5, -2.0, 0.25]));
        assert_eq!(
            (why.message.as_str(), why.hint.as_str()),
            ("no curves run around (1.5, -2, 0.25) yet", "draw some")
        );
        assert_eq!(Why::of("it is a folder (byte 0)").place, None);
        assert_eq!(Why::of("step 1 (paint) at (1, 2, 3)").place, Some([1.0, 2.0, 3.0]));
    }
}
