//! Checks that edits share: numbers that are not finite, or out of their range (`docs/guide/edit.md`).
//!
//! All answer `NotFinite` or `OutOfRange` with what the number is of.

use super::network::Stretch;
use super::{ApplyError, CurveName, Forces, Magnetism, Name, Spot};
use crate::curve::PaintMode;

/// Weights of a place may leave 0 to 1 by this: rounding.
const ROUNDING: f64 = 1e-9;

/// What a number may be.
pub(super) enum Range {
    /// 0 or more.
    NotNegative,
    /// More than 0.
    Positive,
    /// A share of a length, ends included.
    Share,
    /// An angle between faces, degrees.
    Angle,
}

pub(super) fn within(what: &'static str, value: f64, range: Range) -> Result<(), ApplyError> {
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

pub(super) fn count(what: &'static str, value: usize, least: usize, wanted: &'static str) -> Result<(), ApplyError> {
    if value >= least { Ok(()) } else { Err(ApplyError::OutOfRange { what, value: value as f64, wanted }) }
}

/// Numbers that are finite.
pub(super) fn finite(what: &'static str, numbers: &[f64]) -> Result<(), ApplyError> {
    if numbers.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(ApplyError::NotFinite { what }) }
}

/// A direction that is one.
pub(super) fn direction(what: &'static str, v: &[f64; 3]) -> Result<(), ApplyError> {
    finite(what, v)?;
    within(what, v.iter().map(|x| x * x).sum::<f64>().sqrt(), Range::Positive)
}

pub(super) fn forces(f: &Forces) -> Result<(), ApplyError> {
    within("fairness", f.fairness, Range::NotNegative)?;
    within("curvature", f.curvature, Range::NotNegative)?;
    within("arc_length", f.arc_length, Range::NotNegative)?;
    within("the sum of fairness, curvature and arc_length", f.fairness + f.curvature + f.arc_length, Range::Positive)?;
    within("settle", f.settle, Range::NotNegative)?;
    count("sweeps", f.sweeps, 1, "1 or more")
}

pub(super) fn holds(pins: &[f64], stiffness: &[Stretch]) -> Result<(), ApplyError> {
    pins.iter().try_for_each(|&p| within("a pin", p, Range::Share))?;
    stiffness.iter().try_for_each(|s| {
        within("the start of a stretch", s.from, Range::Share)?;
        within("the end of a stretch", s.to, Range::Share)?;
        within("the length of a stretch", s.to - s.from, Range::Positive)?;
        within("the fairness of a stretch", s.fairness, Range::NotNegative)?;
        within("the curvature of a stretch", s.curvature, Range::NotNegative)
    })
}

pub(super) fn magnetism(magnet: Option<&Magnetism>, mode: PaintMode) -> Result<(), ApplyError> {
    match magnet {
        Some(_) if mode != PaintMode::Magnetic => Err(ApplyError::IdleMagnet),
        Some(Magnetism::Sharp(angle)) => within("the angle of the magnet", *angle, Range::Angle),
        _ => Ok(()),
    }
}

pub(super) fn picks(picks: &[Spot]) -> Result<(), ApplyError> {
    picks.iter().try_for_each(|p| spot("a pick", p))
}

/// A place that is one, as far as its numbers tell.
pub(super) fn spot(what: &'static str, spot: &Spot) -> Result<(), ApplyError> {
    let place = match spot {
        Spot::Position(p) => return finite(what, p),
        Spot::Place(place) => place,
        Spot::Corner { .. } => return Ok(()),
    };
    finite(what, &place.bary)?;
    if let Some(&value) = place.bary.iter().find(|b| !(-ROUNDING..=1.0 + ROUNDING).contains(*b)) {
        return Err(ApplyError::OutOfRange { what: "a weight of bary", value, wanted: "between 0 and 1" });
    }
    let sum: f64 = place.bary.iter().sum();
    match (sum - 1.0).abs() <= ROUNDING {
        true => Ok(()),
        false => Err(ApplyError::OutOfRange { what: "the sum of the weights of bary", value: sum, wanted: "1" }),
    }
}

pub(super) fn name(name: &Name) -> Result<(), ApplyError> {
    match name {
        Name::Number(_) => Ok(()),
        Name::Near { near } => finite("near", near),
    }
}

pub(super) fn curve(curve: &CurveName) -> Result<(), ApplyError> {
    match curve {
        CurveName::Network(of) | CurveName::Feature { feature: of } => name(of),
    }
}
