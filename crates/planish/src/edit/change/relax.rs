//! Relaxes curves as snakes ([K98] §3.5 to 3.8): one, a section of it, or all.

use crate::curve::SnakeParams;
use crate::curve::symmetry::Plane;
use crate::edit::change::mirror::ON_PLANE;
use crate::edit::check::{self, Range, within};
use crate::edit::network::{EditError, Holds, Stretch};
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, CurveName, CurveNumber, Forces, Pull, RelaxedCurve};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Relaxes a curve, a section of it, or all curves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Relax {
    /// The curve; absent for all of the network that are free to move and do not lie in the plane of symmetry. Of
    /// these one stays as it is where it would run into another.
    #[serde(default)]
    pub curve: Option<CurveName>,
    /// Middle and width of the section, shares of the length.
    #[serde(default)]
    pub section: Option<[f64; 2]>,
    /// How it relaxes.
    #[serde(default)]
    pub forces: Forces,
    /// What it is drawn to.
    #[serde(default)]
    pub pull: Option<Pull>,
    /// Shares of the length where the curve stays where it is.
    #[serde(default)]
    pub pins: Vec<f64>,
    /// Stretches with weights of their own.
    #[serde(default)]
    pub stiffness: Vec<Stretch>,
}

impl Command for Relax {
    fn check(&self) -> Result<(), ApplyError> {
        self.curve.as_ref().map_or(Ok(()), check::curve)?;
        if let Some([middle, width]) = self.section {
            within("the middle of the section", middle, Range::Share)?;
            within("the width of the section", width, Range::Positive)?;
        }
        if let Some(Pull { weight, .. }) = self.pull {
            within("the weight of pull", weight, Range::NotNegative)?;
        }
        check::forces(&self.forces)?;
        check::holds(&self.pins, &self.stiffness)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let field = self.pull.as_ref().map(|p| work.pull(p)).transpose()?;
        let attraction = self.pull.as_ref().map_or(0.0, |p| p.weight);
        let params = SnakeParams { attraction, ..self.forces.params() };
        let section = self.section.map(|s| (s[0], s[1]));
        let holds = Holds { section, field: field.as_ref(), pins: &self.pins, stiffness: &self.stiffness };
        let Some(curve) = &self.curve else { return relax_all(work, &holds, &params) };
        let curve = work.curve(curve)?;
        let relaxed = work.edit_curve(curve, |e, curve, observer| e.relax_curve(curve, &holds, &params, observer))?;
        work.relaxed.push(RelaxedCurve { curve, relaxed });
        Ok(())
    }

    fn only_moves(&self) -> bool {
        true
    }
}

/// Relaxes one curve after the other; one that would run into another stays as it is.
fn relax_all(work: &mut Work, holds: &Holds, params: &SnakeParams) -> Result<(), ApplyError> {
    let mesh = work.ground.canvas.mesh;
    let plane = work.drawing.sketch.symmetry;
    let near = ON_PLANE * mesh.bounds().diagonal();
    let mut all = Vec::new();
    work.edit(|e, _, observer| -> Result<(), ApplyError> {
        let count = e.network.curves.len();
        let mut faults = e.glance().faults.len();
        for c in 0..count {
            observer.progress(c as f64 / count as f64);
            let curve = &e.network.curves[c];
            let in_plane = |plane: Plane| curve.points.iter().all(|p| plane.height(p.position(mesh)).abs() < near);
            if !curve.kind.is_smooth() || plane.is_some_and(in_plane) {
                continue;
            }
            let (before, corner) = (curve.points.clone(), curve.corners[0]);
            let start = e.network.corners[corner as usize].clone();
            let relaxed = match e.relax_curve(c as u32, holds, params, observer) {
                Ok(relaxed) => relaxed,
                // It shrinks to nothing: it stays as well.
                Err(EditError::Shrunk { .. }) => continue,
                Err(e) => return Err(e.into()),
            };
            let after = e.glance().faults.len();
            if after > faults {
                e.network.curves[c].points = before;
                e.network.corners[corner as usize] = start;
            } else {
                faults = after;
                all.push(RelaxedCurve { curve: CurveNumber::Curve(c as u32), relaxed });
            }
        }
        Ok(())
    })?;
    work.relaxed = all;
    Ok(())
}
