//! Numbers of an edit that are none, or out of their range.

use super::network::Stretch;
use super::{ApplyError, Edit, Forces, Magnetism, Name, Pull, SplineMove, Spot};
use crate::curve::PaintMode;

/// Cells of a section at most: a grid as fine as the finest displacement maps.
const MOST_CELLS: usize = 2048;

/// Control vertices of a cubic space curve.
const FEWEST_CONTROL: usize = 4;
/// More would follow every edge of any mesh, and the system for them is dense.
const MOST_CONTROL: usize = 1000;
/// Weights of a place may leave 0 to 1 by this: rounding.
const ROUNDING: f64 = 1e-9;

/// What a number may be.
enum Range {
    /// 0 or more.
    NotNegative,
    /// More than 0.
    Positive,
    /// A share of a length, ends included.
    Share,
    /// An angle between faces, degrees.
    Angle,
}

fn within(what: &'static str, value: f64, range: Range) -> Result<(), ApplyError> {
    let (fits, wanted) = match range {
        Range::NotNegative => (value >= 0.0, "0 or more"),
        Range::Positive => (value > 0.0, "more than 0"),
        Range::Share => ((0.0..=1.0).contains(&value), "between 0 and 1"),
        Range::Angle => ((0.0..180.0).contains(&value), "between 0 and 180 degrees"),
    };
    if !value.is_finite() {
        return Err(ApplyError::NotFinite { what });
    }
    if fits { Ok(()) } else { Err(ApplyError::OutOfRange { what, value, wanted }) }
}

fn count(what: &'static str, value: usize, least: usize, wanted: &'static str) -> Result<(), ApplyError> {
    if value >= least { Ok(()) } else { Err(ApplyError::OutOfRange { what, value: value as f64, wanted }) }
}

/// A direction that is one.
fn direction(what: &'static str, v: &[f64; 3]) -> Result<(), ApplyError> {
    if !v.iter().all(|x| x.is_finite()) {
        return Err(ApplyError::NotFinite { what });
    }
    within(what, v.iter().map(|x| x * x).sum::<f64>().sqrt(), Range::Positive)
}

fn forces(f: &Forces) -> Result<(), ApplyError> {
    within("fairness", f.fairness, Range::NotNegative)?;
    within("curvature", f.curvature, Range::NotNegative)?;
    within("arc_length", f.arc_length, Range::NotNegative)?;
    within("the sum of fairness, curvature and arc_length", f.fairness + f.curvature + f.arc_length, Range::Positive)?;
    within("settle", f.settle, Range::NotNegative)?;
    count("sweeps", f.sweeps, 1, "1 or more")
}

fn holds(pins: &[f64], stiffness: &[Stretch]) -> Result<(), ApplyError> {
    pins.iter().try_for_each(|&p| within("a pin", p, Range::Share))?;
    stiffness.iter().try_for_each(|s| {
        within("the start of a stretch", s.from, Range::Share)?;
        within("the end of a stretch", s.to, Range::Share)?;
        within("the length of a stretch", s.to - s.from, Range::Positive)?;
        within("the fairness of a stretch", s.fairness, Range::NotNegative)?;
        within("the curvature of a stretch", s.curvature, Range::NotNegative)
    })
}

fn magnetism(magnet: Option<&Magnetism>, mode: PaintMode) -> Result<(), ApplyError> {
    match magnet {
        Some(_) if mode != PaintMode::Magnetic => Err(ApplyError::IdleMagnet),
        Some(Magnetism::Sharp(angle)) => within("the angle of the magnet", *angle, Range::Angle),
        _ => Ok(()),
    }
}

/// Looks for numbers that are not finite or out of their range.
/// # Errors
/// `NotFinite`, `OutOfRange` with what the first one is of.
pub(super) fn check(edit: &Edit) -> Result<(), ApplyError> {
    let look = |what: &'static str, numbers: &[f64]| match numbers.iter().all(|x| x.is_finite()) {
        true => Ok(()),
        false => Err(ApplyError::NotFinite { what }),
    };
    let spot = |what: &'static str, spot: &Spot| match spot {
        Spot::Position(p) => look(what, p),
        Spot::Place(p) => {
            look(what, &p.bary)?;
            p.bary.iter().try_for_each(|&b| match (-ROUNDING..=1.0 + ROUNDING).contains(&b) {
                true => Ok(()),
                false => Err(ApplyError::OutOfRange { what: "a weight of bary", value: b, wanted: "between 0 and 1" }),
            })?;
            let sum: f64 = p.bary.iter().sum();
            match (sum - 1.0).abs() <= ROUNDING {
                true => Ok(()),
                false => {
                    Err(ApplyError::OutOfRange { what: "the sum of the weights of bary", value: sum, wanted: "1" })
                }
            }
        }
        Spot::Corner { .. } => Ok(()),
    };
    let name = |name: &Name| match name {
        Name::Number(_) => Ok(()),
        Name::Near { near } => look("near", near),
    };
    match edit {
        Edit::Paint { picks, mode, magnet, snap, .. } => {
            picks.iter().try_for_each(|p| spot("a pick", p))?;
            magnetism(magnet.as_ref(), *mode)?;
            within("snap", *snap, Range::NotNegative)
        }
        Edit::Extend { curve, picks, mode, magnet, snap, .. } => {
            name(curve)?;
            picks.iter().try_for_each(|p| spot("a pick", p))?;
            magnetism(magnet.as_ref(), *mode)?;
            within("snap", *snap, Range::NotNegative)
        }
        Edit::Cut { through, normal, snap } => {
            spot("through", through)?;
            direction("the length of normal", normal)?;
            within("snap", *snap, Range::NotNegative)
        }
        Edit::Project { points, direction, snap } => {
            points.iter().try_for_each(|p| look("a point", p))?;
            look("direction", direction)?;
            within("snap", *snap, Range::NotNegative)
        }
        Edit::FeatureLines { angle_deg, shortest } => {
            within("angle_deg", *angle_deg, Range::Angle)?;
            within("shortest", *shortest, Range::NotNegative)
        }
        Edit::AddCorner { at, snap } => {
            spot("at", at)?;
            within("snap", *snap, Range::NotNegative)
        }
        Edit::SplitCurve { curve, at } => {
            name(curve)?;
            within("at", *at, Range::Share)
        }
        Edit::DragCorner { corner, to, reach, forces: f } => {
            name(corner)?;
            spot("to", to)?;
            within("reach", *reach, Range::Positive)?;
            forces(f)
        }
        Edit::DragCurve { curve, at, by, width, forces: f, pins, stiffness } => {
            name(curve)?;
            within("at", *at, Range::Share)?;
            look("by", by)?;
            within("width", *width, Range::Positive)?;
            forces(f)?;
            holds(pins, stiffness)
        }
        Edit::Relax { curve, section, forces: f, pull, pins, stiffness } => {
            curve.as_ref().map_or(Ok(()), name)?;
            if let Some([middle, width]) = section {
                within("the middle of the section", *middle, Range::Share)?;
                within("the width of the section", *width, Range::Positive)?;
            }
            if let Some(Pull { weight, .. }) = pull {
                within("the weight of pull", *weight, Range::NotNegative)?;
            }
            forces(f)?;
            holds(pins, stiffness)
        }
        Edit::Spline { curve, control, moves } => {
            name(curve)?;
            if !(FEWEST_CONTROL..=MOST_CONTROL).contains(control) {
                let wanted = "between 4 and 1000";
                return Err(ApplyError::OutOfRange { what: "control", value: *control as f64, wanted });
            }
            moves.iter().try_for_each(|m| match m {
                SplineMove::Control { by, .. } => look("a move", by),
                SplineMove::Edit { at, by } => {
                    within("the place of a move", *at, Range::Share)?;
                    look("a move", by)
                }
            })
        }
        Edit::SplitRegion { at, .. } => spot("at", at),
        Edit::Sections { at, u, v } => {
            spot("at", at)?;
            u.iter().chain(v).try_for_each(|&c| match c {
                2..=MOST_CELLS => Ok(()),
                c => Err(ApplyError::OutOfRange {
                    what: "the number of cells of a section",
                    value: c as f64,
                    wanted: "between 2 and 2048",
                }),
            })
        }
        Edit::Complete { patches, sharp_angle_deg } => {
            count("patches", *patches, 1, "1 or more")?;
            within("sharp_angle_deg", *sharp_angle_deg, Range::Angle)
        }
        Edit::Feature { picks, mode, magnet, .. } => {
            picks.iter().try_for_each(|p| spot("a pick", p))?;
            magnetism(magnet.as_ref(), *mode)
        }
        Edit::Symmetry { plane } => plane.map_or(Ok(()), |p| {
            look("the point of the plane", &p.point.to_array())?;
            direction("the length of the plane's normal", &p.normal.to_array())
        }),
        Edit::Carry { landmarks, .. } => landmarks.iter().flatten().try_for_each(|p| look("a landmark", p)),
        Edit::Join { corner } | Edit::DeleteCorner { corner } => name(corner),
        Edit::DeleteCurves { curves } => curves.iter().try_for_each(name),
        Edit::DeleteFeature { feature } => name(feature),
        Edit::Boundaries {} | Edit::Clear {} | Edit::Mirror { .. } | Edit::Undo { .. } | Edit::Redo { .. } => Ok(()),
    }
}
