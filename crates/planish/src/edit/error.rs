//! Why an edit was not made: what is wrong, where, and what to do (`docs/guide/edit.md`).

use super::network::EditError;
use crate::curve::CurveError;
use crate::grid::FeatureError;
use crate::observe::Cancelled;

/// Why an edit was not made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ApplyError {
    /// The edit of the network.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// A curve.
    #[error(transparent)]
    Curve(#[from] CurveError),
    /// A corner that is not there.
    #[error("corner {corner} is not there, there are {count} - hint: they are counted from 0")]
    NoSuchCorner {
        /// The corner.
        corner: u32,
        /// How many there are.
        count: usize,
    },
    /// A place or a number that is not finite.
    #[error("{what} is not a finite number - hint: give numbers in the units of the mesh")]
    NotFinite {
        /// What it is of.
        what: &'static str,
    },
    /// A number that is out of its range.
    #[error("{what} is {value}, not {wanted} - hint: give a number in that range")]
    OutOfRange {
        /// What it is of.
        what: &'static str,
        /// The number.
        value: f64,
        /// What it may be, in words.
        wanted: &'static str,
    },
    /// A magnet for a stroke that is not drawn to anything.
    #[error("a magnet draws magnetic strokes alone - hint: add mode = \"magnetic\", or leave the magnet away")]
    IdleMagnet,
    /// A curve along which no two patches meet.
    #[error("curve {curve} follows the boundary of the mesh and has no seam - hint: leave it out")]
    NoSeam {
        /// The curve.
        curve: u32,
    },
    /// A move further than the mesh is wide.
    #[error("a move by {:.1} times the diagonal leads off the mesh - hint: check the units", share)]
    TooFar {
        /// Its length over the diagonal.
        share: f64,
    },
    /// A curve, corner or feature curve is looked for by a place where there is none.
    #[error("there is no {what} yet - hint: draw one")]
    NoneYet {
        /// `corner`, `curve` or `feature curve`.
        what: &'static str,
    },
    /// A curve without free end.
    #[error("no end of curve {curve} is free - hint: paint a new curve from where it is to go on")]
    NotFree {
        /// The curve.
        curve: u32,
    },
    /// A feature curve is not divided and not closed.
    #[error(
        "feature curve {feature} runs from side to side of its patch as one - hint: paint a curve along it to divide the patch"
    )]
    SideToSide {
        /// The feature curve.
        feature: u32,
    },
    /// Feature curves or sections that do not suit their patch.
    #[error(transparent)]
    Feature(#[from] FeatureError),
    /// A position far off the mesh.
    #[error(
        "({:.6}, {:.6}, {:.6}) is {:.0} % of the diagonal off the mesh - hint: check the units and the axes",
        place[0], place[1], place[2], 100.0 * away
    )]
    OffMesh {
        /// The position.
        place: [f64; 3],
        /// Its distance over the diagonal.
        away: f64,
    },
    /// No patch where one is wanted.
    #[error("there is no patch at ({:.6}, {:.6}, {:.6}) yet - hint: finish the curves around it", place[0], place[1], place[2])]
    NoPatch {
        /// The place.
        place: [f64; 3],
    },
    /// A feature curve that is not there.
    #[error("feature curve {feature} is not there, there are {count} - hint: they are counted from 0")]
    NoSuchFeature {
        /// Its number.
        feature: u32,
        /// How many there are.
        count: usize,
    },
    /// The vertices have no such attribute.
    #[error("the vertices have no \"{name}\" - hint: use {there}")]
    NoSuchAttribute {
        /// The name asked for.
        name: String,
        /// The names there are.
        there: String,
    },
    /// Mirroring without a plane.
    #[error("no plane of symmetry is set - hint: an edit \"symmetry\" sets or finds one")]
    NoPlane,
    /// A curve crosses the plane of symmetry more than once.
    #[error("curve {curve} crosses the plane of symmetry more than once, at ({:.6}, {:.6}, {:.6}) the last time - hint: divide it there, or delete it", place[0], place[1], place[2])]
    AcrossPlane {
        /// The curve.
        curve: usize,
        /// The place.
        place: [f64; 3],
    },
    /// The other model cannot be read.
    #[error("{name}: {what}")]
    Other {
        /// Its name.
        name: String,
        /// What is wrong.
        what: String,
    },
    /// An edit of the history where a drawing is edited.
    #[error("edits are taken back and made again on the model, not on a drawing - hint: apply them to the model")]
    NotADrawing,
    /// Stopped by the observer.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}
