//! Edits: what a person does to the curves of a model, one value each, so that a session can be kept, taken back and
//! replayed.
//!
//! An edit changes a [`Drawing`] and nothing else; the mesh stays, and what was made from the drawing is made anew.
//! Places are world positions (taken to the nearest place of the mesh), places by face, or corners.
//! One file per edit, with its check: `draw/`, `change/`, `feature/`. A new one is a file there, a variant of [`Edit`]
//! and a line of `Edit::command`.
//!
//! See `docs/guide/edit.md` and, for why scripts are TOML, `docs/decisions/0011-toml-for-scripts.md`.

mod apply;
mod change;
mod check;
mod draw;
mod error;
mod feature;
mod history;
mod keep;
pub mod network;
mod outcome;
mod place;
mod pull;
mod stroke;
mod work;

pub use apply::{apply, preview};
pub use change::{
    AddCorner, Clear, Continuity, DeleteCorner, DeleteCurves, DragCorner, DragCurve, Join, Mirror, Relax, Spline,
    SplitCurve, SplitRegion, Symmetry, handles, mirror_network,
};
pub use draw::{Boundaries, Carry, Complete, Cut, Extend, FeatureLines, Paint, Project, carry_network};
pub use error::ApplyError;
pub use feature::{DeleteFeature, Feature, Sections};
pub use history::{Redo, Undo};
pub use outcome::{Images, Made, RelaxedCurve};
pub use place::{CurveName, CurveNumber, Name, Spot};
pub use pull::{Forces, Magnetism, Pull, Scalar, SplineMove};
pub use work::Ground;

use crate::model::Drawing;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use work::Work;

/// One edit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "edit", rename_all = "snake_case")]
pub enum Edit {
    /// A stroke through picks.
    Paint(Paint),
    /// A curve led on from its free end.
    Extend(Extend),
    /// The cut by a plane.
    Cut(Cut),
    /// A polyline brought onto the mesh.
    Project(Project),
    /// The boundaries of the mesh.
    Boundaries(Boundaries),
    /// Sharp edges.
    FeatureLines(FeatureLines),
    /// A corner more.
    AddCorner(AddCorner),
    /// A curve divided.
    SplitCurve(SplitCurve),
    /// Two curves joined.
    Join(Join),
    /// Curves less.
    DeleteCurves(DeleteCurves),
    /// A corner less.
    DeleteCorner(DeleteCorner),
    /// All corners and curves less.
    Clear(Clear),
    /// A corner dragged.
    DragCorner(DragCorner),
    /// Seams along curves made smooth or sharp.
    Continuity(Continuity),
    /// A curve pulled.
    DragCurve(DragCurve),
    /// Curves relaxed.
    Relax(Relax),
    /// A curve drawn through a space curve.
    Spline(Spline),
    /// A region split into patches.
    SplitRegion(SplitRegion),
    /// The rest laid out by the program.
    Complete(Complete),
    /// A feature curve painted.
    Feature(Feature),
    /// A feature curve less.
    DeleteFeature(DeleteFeature),
    /// Cells between feature curves.
    Sections(Sections),
    /// The plane of symmetry.
    Symmetry(Symmetry),
    /// One side replaced by the image of the other.
    Mirror(Mirror),
    /// A network carried over from another shape.
    Carry(Carry),
    /// Edits taken back.
    Undo(Undo),
    /// Edits made again.
    Redo(Redo),
}

impl Edit {
    /// Its name in a script and in the history.
    pub fn name(&self) -> String {
        let value = serde_json::to_value(self).unwrap_or_default();
        value.get("edit").and_then(|v| v.as_str()).unwrap_or("edit").to_string()
    }

    /// Its parameters as one JSON object, for the history.
    pub fn parameters(&self) -> String {
        let mut value = serde_json::to_value(self).unwrap_or_default();
        if let Some(map) = value.as_object_mut() {
            map.remove("edit");
        }
        value.to_string()
    }

    /// The one place that knows all edits.
    fn command(&self) -> &dyn Command {
        match self {
            Edit::Paint(edit) => edit,
            Edit::Extend(edit) => edit,
            Edit::Cut(edit) => edit,
            Edit::Project(edit) => edit,
            Edit::Boundaries(edit) => edit,
            Edit::FeatureLines(edit) => edit,
            Edit::AddCorner(edit) => edit,
            Edit::SplitCurve(edit) => edit,
            Edit::Join(edit) => edit,
            Edit::DeleteCurves(edit) => edit,
            Edit::DeleteCorner(edit) => edit,
            Edit::Clear(edit) => edit,
            Edit::DragCorner(edit) => edit,
            Edit::Continuity(edit) => edit,
            Edit::DragCurve(edit) => edit,
            Edit::Relax(edit) => edit,
            Edit::Spline(edit) => edit,
            Edit::SplitRegion(edit) => edit,
            Edit::Complete(edit) => edit,
            Edit::Feature(edit) => edit,
            Edit::DeleteFeature(edit) => edit,
            Edit::Sections(edit) => edit,
            Edit::Symmetry(edit) => edit,
            Edit::Mirror(edit) => edit,
            Edit::Carry(edit) => edit,
            Edit::Undo(edit) => edit,
            Edit::Redo(edit) => edit,
        }
    }
}

/// What every edit is: numbers that are looked at first, and a change of the drawing.
trait Command {
    /// Looks for numbers that are not finite or out of their range.
    /// # Errors
    /// `NotFinite`, `OutOfRange` with what the first one is of; `IdleMagnet`.
    fn check(&self) -> Result<(), ApplyError> {
        Ok(())
    }

    /// Changes the drawing. On an error it may be left half-changed: [`apply`] puts back what it was.
    fn apply(&self, work: &mut Work) -> Result<(), ApplyError>;

    /// True if curves and corners keep their numbers and what they join, so that patches keep theirs.
    fn only_moves(&self) -> bool {
        false
    }
}

/// Another model by the name that a script has for it: its mesh and its drawing.
pub type Others<'a> = dyn Fn(&str) -> Result<(crate::mesh::TriMesh, Drawing), String> + 'a;
