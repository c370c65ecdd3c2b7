//! Numbers of an edit that are none.

use super::{ApplyError, Edit, Forces, SplineMove, Spot};

/// Looks for numbers that are not finite.
/// # Errors
/// `NotFinite` with what the first one is of.
pub(super) fn check(edit: &Edit) -> Result<(), ApplyError> {
    let look = |what: &'static str, numbers: &[f64]| match numbers.iter().all(|x| x.is_finite()) {
        true => Ok(()),
        false => Err(ApplyError::NotFinite { what }),
    };
    let spot = |what: &'static str, spot: &Spot| match spot {
        Spot::Position(p) => look(what, p),
        Spot::Place(p) => look(what, &p.bary),
        Spot::Corner { .. } => Ok(()),
    };
    let weights = |f: &Forces| look("a weight of forces", &[f.fairness, f.curvature]);
    match edit {
        Edit::Paint { picks, snap, .. } => {
            picks.iter().try_for_each(|p| spot("a pick", p))?;
            look("snap", &[*snap])
        }
        Edit::Cut { through, normal, snap } => {
            spot("through", through)?;
            look("normal", normal)?;
            look("snap", &[*snap])
        }
        Edit::Project { points, direction, snap } => {
            points.iter().try_for_each(|p| look("a point", p))?;
            look("direction", direction)?;
            look("snap", &[*snap])
        }
        Edit::FeatureLines { angle_deg, shortest } => look("angle_deg or shortest", &[*angle_deg, *shortest]),
        Edit::AddCorner { at, snap } => {
            spot("at", at)?;
            look("snap", &[*snap])
        }
        Edit::SplitCurve { at, .. } => look("at", &[*at]),
        Edit::DragCorner { to, reach, forces, .. } => {
            spot("to", to)?;
            look("reach", &[*reach])?;
            weights(forces)
        }
        Edit::DragCurve { at, by, width, forces, .. } => {
            look("at or width", &[*at, *width])?;
            look("by", by)?;
            weights(forces)
        }
        Edit::Relax { section, forces, pull, .. } => {
            look("section", &section.unwrap_or_default())?;
            look("the weight of pull", &[pull.as_ref().map_or(0.0, |p| p.weight)])?;
            weights(forces)
        }
        Edit::Spline { moves, .. } => moves.iter().try_for_each(|m| match m {
            SplineMove::Control { by, .. } => look("a move", by),
            SplineMove::Edit { at, by } => look("a move", &[*at, by[0], by[1], by[2]]),
        }),
        Edit::SplitRegion { at, .. } | Edit::Sections { at, .. } => spot("at", at),
        Edit::Complete { sharp_angle_deg, .. } => look("sharp_angle_deg", &[*sharp_angle_deg]),
        Edit::Feature { picks, .. } => picks.iter().try_for_each(|p| spot("a pick", p)),
        Edit::Symmetry { plane } => plane.map_or(Ok(()), |p| {
            look("the point of the plane", &p.point.to_array())?;
            look("the normal of the plane", &p.normal.to_array())
        }),
        Edit::Carry { landmarks, .. } => landmarks.iter().flatten().try_for_each(|p| look("a landmark", p)),
        Edit::Boundaries {}
        | Edit::Join { .. }
        | Edit::DeleteCurves { .. }
        | Edit::DeleteCorner { .. }
        | Edit::Clear {}
        | Edit::DeleteFeature { .. }
        | Edit::Mirror { .. }
        | Edit::Undo { .. }
        | Edit::Redo { .. } => Ok(()),
    }
}
