//! Edits: what a person does to the curves of a model, one value each, so that a session can be kept, taken back and
//! replayed.
//!
//! An edit changes a [`Drawing`] and nothing else; the mesh stays, and what was made from the drawing is made anew.
//! Places are world positions (taken to the nearest place of the mesh), places by face, or corners.

mod apply;
mod check;
mod error;
mod keep;
mod mirror;
pub mod network;
mod outcome;
mod place;
mod pull;
mod stroke;

pub use apply::{Ground, apply};
pub use error::ApplyError;
pub use mirror::{Images, carry_network, mirror_network};
pub use outcome::{Made, RelaxedCurve};
pub use place::{Name, Spot};
pub use pull::{Forces, Magnetism, Pull, Scalar, SplineMove};

use crate::curve::PaintMode;
use crate::curve::symmetry::Plane;
use crate::edit::network::Stretch;
use crate::grid::Family;
use crate::model::Drawing;
use crate::network::CurveKind;
use serde::{Deserialize, Serialize};

/// One edit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "edit", rename_all = "snake_case", deny_unknown_fields)]
pub enum Edit {
    /// Paints a curve through picks. Picks go to corners, curves and sharp edges within `snap` of the diagonal; where
    /// the curve meets others, corners divide both.
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
    /// Leads a curve on from its free end through more picks, as [`Edit::Paint`] would.
    Extend {
        /// The curve; the end that it was painted towards is meant if both are free.
        curve: Name,
        /// The picks, in order.
        #[serde(default)]
        picks: Vec<Spot>,
        /// How the way between picks is found.
        #[serde(default)]
        mode: PaintMode,
        /// True to lead it on to its own other end.
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
        curve: Name,
        /// 0 to 1.
        at: f64,
    },
    /// Joins the two curves at a corner.
    Join {
        /// The corner.
        corner: Name,
    },
    /// Deletes curves.
    DeleteCurves {
        /// The curves, numbered as before the edit.
        curves: Vec<Name>,
    },
    /// Deletes a corner without curves or between two.
    DeleteCorner {
        /// The corner.
        corner: Name,
    },
    /// Deletes all corners and curves.
    Clear {},
    /// Moves a corner; its curves follow.
    DragCorner {
        /// The corner.
        corner: Name,
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
        curve: Name,
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
        /// Shares of the length where the curve stays where it is.
        #[serde(default)]
        pins: Vec<f64>,
        /// Stretches with weights of their own.
        #[serde(default)]
        stiffness: Vec<Stretch>,
    },
    /// Relaxes a curve, a section of it, or all curves.
    Relax {
        /// The curve; absent for all that are free to move and do not lie in the plane of symmetry. Of these one stays
        /// as it is where it would run into another.
        #[serde(default)]
        curve: Option<Name>,
        /// Middle and width of the section, shares of the length.
        #[serde(default)]
        section: Option<[f64; 2]>,
        /// How it relaxes.
        #[serde(default)]
        forces: Forces,
        /// What it is drawn to.
        #[serde(default)]
        pull: Option<Pull>,
        /// Shares of the length where the curve stays where it is.
        #[serde(default)]
        pins: Vec<f64>,
        /// Stretches with weights of their own.
        #[serde(default)]
        stiffness: Vec<Stretch>,
    },
    /// Fits a space curve with some control vertices, moves it, and lets the curve follow. Without moves it smooths.
    Spline {
        /// The curve.
        curve: Name,
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
        /// Which iso-curves it is one of; absent to tell it by the sides that its ends lie nearest to.
        #[serde(default)]
        family: Option<Family>,
        /// How the way between picks is found.
        #[serde(default)]
        mode: PaintMode,
        /// What a magnetic stroke is drawn to.
        #[serde(default)]
        magnet: Option<Magnetism>,
    },
    /// Deletes a feature curve.
    DeleteFeature {
        /// Its number.
        feature: Name,
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

/// What `kind` means for an edge line found by its angle.
const LINE_KIND: CurveKind = CurveKind::Feature;
