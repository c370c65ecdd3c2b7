//! Edits a curve through the control vertices of a space curve ([K98] §3.3.2 and 3.3.3).

use crate::curve::{Canvas, SplineEdit, SurfaceCurve};
use crate::edit::check::{self, Range, within};
use crate::edit::work::{Ground, Work};
use crate::edit::{ApplyError, Command, CurveName, Others, SplineMove};
use crate::model::Drawing;
use crate::observe::Silent;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Control vertices of a cubic space curve.
const FEWEST_CONTROL: usize = 4;
/// More would follow every edge of any mesh, and the system for them is dense.
const MOST_CONTROL: usize = 1000;

/// A curve at even places, and the space curve through them.
fn spline_of(canvas: &Canvas, course: &SurfaceCurve, control: usize) -> Result<(SurfaceCurve, SplineEdit), ApplyError> {
    let (mesh, adjacency) = (canvas.mesh, &canvas.adjacency);
    let even = course.spaced(mesh, adjacency, canvas.edge)?;
    // A short curve still has as many places as its spline has vertices.
    let even = even.resampled(mesh, adjacency, even.points.len().max(2 * control))?;
    let spline = SplineEdit::fit(mesh, &even, control)?;
    Ok((even, spline))
}

/// Control vertices of the space curve that a [`Spline`] edit of a curve would begin with, world units.
/// * `control` - how many, `4..=1000`
/// # Errors
/// As the edit.
pub fn handles(
    drawing: &Drawing,
    curve: &CurveName,
    control: usize,
    ground: &Ground,
) -> Result<Vec<DVec3>, ApplyError> {
    let edit = Spline { curve: *curve, control, moves: Vec::new() };
    edit.check()?;
    let mut copy = drawing.clone();
    let others: &Others = &|_| Err("no other model is looked at".into());
    let mut work = Work { ground, drawing: &mut copy, others, observer: &Silent, relaxed: Vec::new(), images: None };
    let curve = work.curve(curve)?;
    work.edit_curve(curve, |e, curve, _| spline_of(&ground.canvas, &e.course(curve), control).map(|(_, s)| s.control))
}

/// Fits a space curve with some control vertices, moves it, and lets the curve follow. Without moves it smooths.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spline {
    /// The curve.
    pub curve: CurveName,
    /// Control vertices.
    pub control: usize,
    /// Moves, one after the other.
    #[serde(default)]
    pub moves: Vec<SplineMove>,
}

impl Command for Spline {
    fn check(&self) -> Result<(), ApplyError> {
        check::curve(&self.curve)?;
        if !(FEWEST_CONTROL..=MOST_CONTROL).contains(&self.control) {
            let wanted = "between 4 and 1000";
            return Err(ApplyError::OutOfRange { what: "control", value: self.control as f64, wanted });
        }
        self.moves.iter().try_for_each(|m| match m {
            SplineMove::Control { by, .. } => check::finite("a move", by),
            SplineMove::Edit { at, by } => {
                within("the place of a move", *at, Range::Share)?;
                check::finite("a move", by)
            }
        })
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let curve = work.curve(&self.curve)?;
        self.moves.iter().try_for_each(|m| match m {
            SplineMove::Control { by, .. } | SplineMove::Edit { by, .. } => work.shift(by).map(drop),
        })?;
        let canvas = &work.ground.canvas;
        let (mesh, adjacency) = (canvas.mesh, &canvas.adjacency);
        work.edit_curve(curve, |e, curve, _| -> Result<(), ApplyError> {
            let (even, mut spline) = spline_of(canvas, &e.course(curve), self.control)?;
            for m in &self.moves {
                match *m {
                    SplineMove::Control { vertex, by } => {
                        let at = spline.control.get(vertex).copied().unwrap_or_default();
                        spline.move_control(vertex, at + DVec3::from_array(by))?;
                    }
                    SplineMove::Edit { at, by } => {
                        spline.move_edit_point(at, spline.position(at) + DVec3::from_array(by));
                    }
                }
            }
            Ok(e.replace_curve(curve, &spline.carry(mesh, adjacency, &even))?)
        })
    }

    fn only_moves(&self) -> bool {
        true
    }
}
