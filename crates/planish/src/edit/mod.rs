//! Edits: what a person does to the curves of a model, one value each, so that a session can be kept, taken back and
//! replayed.
//!
//! An edit changes a [`Drawing`] and nothing else; the mesh stays, and what was made from the drawing is made anew.
//! Places are world positions (taken to the nearest place of the mesh), places by face, or corners.

mod apply;
mod check;
mod keep;
mod mirror;

pub use apply::{Ground, apply};
pub use mirror::{Images, carry_network, mirror_network};

use crate::curve::symmetry::Plane;
use crate::curve::{CurveError, PaintMode, Sweep};
use crate::grid::Family;
use crate::mesh::FacePoint;
use crate::model::Drawing;
use crate::network::{CurveKind, EditError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A place as a script names it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Spot {
    /// A world position; the nearest place of the mesh is meant.
    Position([f64; 3]),
    /// A place by its face.
    Place(FacePoint),
    /// A corner of the network.
    Corner {
        /// Its number.
        corner: u32,
    },
}

/// A scalar by its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Scalar {
    /// Luminance of the colour of the vertices.
    Luminance,
    /// A channel of an attribute of the vertices, counted from 0.
    Channel {
        /// Name of the attribute.
        attribute: String,
        /// Channel.
        channel: usize,
    },
    /// Mean curvature.
    MeanCurvature,
    /// Gaussian curvature.
    GaussianCurvature,
    /// The greater principal curvature by size.
    MaximumCurvature,
    /// One number per vertex.
    Values(Vec<f64>),
}

/// What a curve is drawn to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pull {
    /// The scalar; curves go to high values.
    pub scalar: Scalar,
    /// True to go to low values.
    #[serde(default)]
    pub low: bool,
    /// Rounds of blending with the neighbours before, which reach about the root of them in edges.
    #[serde(default = "usual_blending")]
    pub blending: usize,
    /// Weight against the forces of the curve.
    #[serde(default = "usual_weight")]
    pub weight: f64,
}

fn usual_blending() -> usize {
    20
}

fn usual_weight() -> f64 {
    10.0
}

/// What a magnetic stroke is drawn to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Magnetism {
    /// Edges sharper than this many degrees.
    Sharp(f64),
    /// Ridges and valleys: high curvature by size.
    Creases,
    /// High values of a scalar.
    Scalar(Scalar),
}

/// How curves relax.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Forces {
    /// Weight of shortness.
    pub fairness: f64,
    /// Weight of stiffness.
    pub curvature: f64,
    /// Sweeps at most.
    pub sweeps: usize,
    /// How points are moved.
    pub sweep: Sweep,
}

impl Default for Forces {
    fn default() -> Forces {
        Forces { fairness: 0.1, curvature: 1.0, sweeps: 200, sweep: Sweep::CoarseToFine }
    }
}

/// A move of a space curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum SplineMove {
    /// A control vertex, counted from 0, by a vector.
    Control {
        /// The control vertex.
        vertex: usize,
        /// World units.
        by: [f64; 3],
    },
    /// The edit point at a share of the curve, by a vector.
    Edit {
        /// 0 to 1.
        at: f64,
        /// World units.
        by: [f64; 3],
    },
}

/// One edit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "edit", rename_all = "snake_case", deny_unknown_fields)]
pub enum Edit {
    /// Paints a curve through picks. Its ends go to corners and curves within `snap` of the diagonal.
    Paint {
        /// The picks, in order.
        picks: Vec<Spot>,
        /// How the way between picks is found.
        #[serde(default)]
        mode: PaintMode,
        /// True for a closed curve.
        #[serde(default)]
        closed: bool,
        /// What a magnetic stroke is drawn to.
        #[serde(default)]
        magnet: Option<Magnetism>,
        /// Share of the diagonal.
        #[serde(default = "usual_snap")]
        snap: f64,
    },
    /// The cut by a plane, as a curve.
    Cut {
        /// A place on the cut.
        through: Spot,
        /// Normal of the plane.
        normal: [f64; 3],
        /// Share of the diagonal.
        #[serde(default = "usual_snap")]
        snap: f64,
    },
    /// A polyline brought onto the mesh: along `direction`, or to the nearest places.
    Project {
        /// World positions.
        points: Vec<[f64; 3]>,
        /// Zero for the nearest places.
        #[serde(default)]
        direction: [f64; 3],
        /// Share of the diagonal.
        #[serde(default = "usual_snap")]
        snap: f64,
    },
    /// The boundaries of the mesh as curves, where there are none yet.
    Boundaries {},
    /// Edges sharper than an angle as curves.
    FeatureLines {
        /// Degrees.
        angle_deg: f64,
        /// Lines shorter than this share of the diagonal are left out.
        #[serde(default)]
        shortest: f64,
    },
    /// A corner; on a curve it divides it.
    AddCorner {
        /// Where.
        at: Spot,
        /// Share of the diagonal.
        #[serde(default = "usual_snap")]
        snap: f64,
    },
    /// Divides a curve at a share of its length.
    SplitCurve {
        /// The curve.
        curve: u32,
        /// 0 to 1.
        at: f64,
    },
    /// Joins the two curves at a corner.
    Join {
        /// The corner.
        corner: u32,
    },
    /// Deletes curves.
    DeleteCurves {
        /// The curves, numbered as before the edit.
        curves: Vec<u32>,
    },
    /// Deletes a corner without curves or between two.
    DeleteCorner {
        /// The corner.
        corner: u32,
    },
    /// Deletes all corners and curves.
    Clear {},
    /// Moves a corner; its curves follow.
    DragCorner {
        /// The corner.
        corner: u32,
        /// Where to.
        to: Spot,
        /// Share of each curve that relaxes.
        #[serde(default = "usual_reach")]
        reach: f64,
        /// How it relaxes.
        #[serde(default)]
        forces: Forces,
    },
    /// Pulls a point of a curve; a section around it relaxes.
    DragCurve {
        /// The curve.
        curve: u32,
        /// Share of its length.
        at: f64,
        /// World units.
        by: [f64; 3],
        /// Share of the length that relaxes.
        #[serde(default = "usual_width")]
        width: f64,
        /// How it relaxes.
        #[serde(default)]
        forces: Forces,
    },
    /// Relaxes a curve, a section of it, or all curves.
    Relax {
        /// The curve; absent for all that are free to move and do not lie in the plane of symmetry. Of these one stays
        /// as it is where it would run into another.
        #[serde(default)]
        curve: Option<u32>,
        /// Middle and width of the section, shares of the length.
        #[serde(default)]
        section: Option<[f64; 2]>,
        /// How it relaxes.
        #[serde(default)]
        forces: Forces,
        /// What it is drawn to.
        #[serde(default)]
        pull: Option<Pull>,
    },
    /// Fits a space curve with some control vertices, moves it, and lets the curve follow. Without moves it smooths.
    Spline {
        /// The curve.
        curve: u32,
        /// Control vertices.
        control: usize,
        /// Moves, one after the other.
        #[serde(default)]
        moves: Vec<SplineMove>,
    },
    /// Splits a region of 3, 5 or 6 sides into four-sided patches.
    SplitRegion {
        /// A place in the region.
        at: Spot,
        /// Turns the split; absent for the flattest corner.
        #[serde(default)]
        from: Option<usize>,
    },
    /// Lays out everything that is not parted yet.
    Complete {
        /// Patches to aim at, over the whole mesh.
        patches: usize,
        /// Edges sharper than this become curves, degrees.
        #[serde(default = "usual_sharp")]
        sharp_angle_deg: f64,
    },
    /// A feature curve of a patch, painted through picks.
    Feature {
        /// The picks, from side to side; the patch is that of the middle one.
        picks: Vec<Spot>,
        /// Which iso-curves it is one of.
        family: Family,
        /// How the way between picks is found.
        #[serde(default)]
        mode: PaintMode,
    },
    /// Deletes a feature curve.
    DeleteFeature {
        /// Its number.
        feature: u32,
    },
    /// Gives the numbers of cells between the feature curves of a patch; empty lists take them back.
    Sections {
        /// A place in the patch.
        at: Spot,
        /// Along u.
        #[serde(default)]
        u: Vec<usize>,
        /// Along v.
        #[serde(default)]
        v: Vec<usize>,
    },
    /// Sets the plane of symmetry, or finds it.
    Symmetry {
        /// The plane; absent to find it.
        #[serde(default)]
        plane: Option<Plane>,
    },
    /// Replaces the curves, feature curves and sections behind the plane of symmetry by mirror images of those before it.
    Mirror {
        /// True for the other way round.
        #[serde(default)]
        swap: bool,
    },
    /// Carries the network of another model over, by landmarks on both.
    Carry {
        /// The other model, as the script names it.
        from: String,
        /// Positions on it with those on this one.
        landmarks: Vec<[[f64; 3]; 2]>,
    },
    /// Takes back the last edits.
    Undo {
        /// How many.
        #[serde(default = "once")]
        count: usize,
    },
    /// Makes edits again that were taken back.
    Redo {
        /// How many.
        #[serde(default = "once")]
        count: usize,
    },
}

fn usual_snap() -> f64 {
    0.01
}
fn usual_reach() -> f64 {
    0.6
}
fn usual_width() -> f64 {
    0.6
}
fn usual_sharp() -> f64 {
    40.0
}
fn once() -> usize {
    1
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
}

/// Another model by the name that a script has for it: its mesh and its drawing.
pub type Others<'a> = dyn Fn(&str) -> Result<(crate::mesh::TriMesh, Drawing), String> + 'a;

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
    Cancelled,
}

/// What `kind` means for an edge line found by its angle.
const LINE_KIND: CurveKind = CurveKind::Feature;
