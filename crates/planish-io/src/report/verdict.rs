//! The verdict on a result: usable, to be looked at, or broken, with the reasons in the order in which they matter.

use super::Report;
use super::words::{count, number, percent};
use planish::pipeline::key;

/// What a figure says of the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum State {
    /// As it should be.
    Good,
    /// Somebody should look at it.
    Look,
    /// Not usable as it is.
    Broken,
}

impl State {
    /// Its name in the style sheet.
    pub fn class(self) -> &'static str {
        match self {
            State::Good => "good",
            State::Look => "look",
            State::Broken => "broken",
        }
    }

    /// The verdict in a word or two.
    pub fn word(self) -> &'static str {
        match self {
            State::Good => "Usable",
            State::Look => "Look at it",
            State::Broken => "Broken",
        }
    }
}

/// Neighbours this far apart, as a share of the diagonal, are apart for CAD programs, which join edges within a thousandth of a
/// millimetre on parts of ten centimetres.
const GAP_REL: f64 = 1e-5;
/// Displaced surfaces that leave the input by this share of the diagonal (RMS) are another shape.
const LOST_REL: f64 = 5e-3;
/// More folded cells than this share of all, and it is not a few places but the grids.
const FOLDS_SHARE: f64 = 1e-3;
/// Smooth seams bent by more are seen in reflections: the zebra stripes jump.
const BENT_DEG: f64 = 2.0;
/// Evidence for the orientation below this share leaves it open which side is outside.
const SURE: f64 = 0.95;

/// The state of one figure, by its key; none for figures that are neither good nor bad.
pub fn state_of(report: &Report, key: &str) -> Option<State> {
    let value = report.figure(key)?;
    let relative = report.figure(&format!("{key}_rel"));
    let found = match key {
        key::MESH_MANIFOLD if value == 0.0 => State::Broken,
        key::MESH_WATERTIGHT if value == 0.0 => State::Look,
        key::MESH_MANIFOLD | key::MESH_WATERTIGHT => State::Good,
        key::SEAM_FOLDED => {
            if value > 0.0 {
                State::Broken
            } else {
                State::Good
            }
        }
        // A folded seam is told as such, and its angle says no more.
        key::SEAM_INNER_ANGLE_MAX_DEG if report.figure(key::SEAM_FOLDED).is_some_and(|n| n > 0.0) => return None,
        key::SEAM_INNER_ANGLE_MAX_DEG => {
            if value > BENT_DEG {
                State::Look
            } else {
                State::Good
            }
        }
        key::SEAM_GAP_MAX => {
            if relative? > GAP_REL {
                State::Broken
            } else {
                State::Good
            }
        }
        key::DISPLACED_RMS => {
            if relative? > LOST_REL {
                State::Broken
            } else {
                State::Good
            }
        }
        key::GRID_FOLDS => {
            let cells = report.figure(key::GRID_POINTS).unwrap_or(0.0);
            match value {
                0.0 => State::Good,
                folds if folds > FOLDS_SHARE * cells => State::Broken,
                _ => State::Look,
            }
        }
        key::SURFACE_CROSSINGS if value > 0.0 => State::Broken,
        key::SURFACE_TURNED if value > 0.0 => State::Look,
        key::SURFACE_CROSSINGS | key::SURFACE_TURNED => State::Good,
        key::SCAN_CONFIDENCE => {
            if value < SURE {
                State::Look
            } else {
                State::Good
            }
        }
        _ => return None,
    };
    Some(found)
}

/// Figures that decide, the gravest first.
const DECISIVE: [&str; 10] = [
    key::MESH_MANIFOLD,
    key::DISPLACED_RMS,
    key::SEAM_GAP_MAX,
    key::SEAM_FOLDED,
    key::SURFACE_CROSSINGS,
    key::GRID_FOLDS,
    key::SURFACE_TURNED,
    key::SCAN_CONFIDENCE,
    key::SEAM_INNER_ANGLE_MAX_DEG,
    key::MESH_WATERTIGHT,
];
/// Warnings that ask for a look, and why.
const CODES: [(&str, &str); 5] = [
    ("tolerance_missed", "the demanded tolerance is missed"),
    ("digits_missing", "the input has too few digits"),
    ("units_guessed", "the unit is a guess"),
    ("mesh_degenerate", "triangles without height could not be removed"),
    ("relief_folds", "some displacements reach beyond the centre of curvature"),
];

/// The verdict on a report with a result, and the reasons, the gravest first.
pub fn verdict(report: &Report) -> (State, Vec<(State, String)>) {
    let mut reasons: Vec<(State, String)> = Vec::new();
    for key in DECISIVE {
        if let Some(state) = state_of(report, key).filter(|s| *s != State::Good) {
            reasons.push((state, reason(report, key)));
        }
    }
    for (code, why) in CODES {
        if report.warnings.iter().any(|w| w.code == code) {
            reasons.push((State::Look, why.to_owned()));
        }
    }
    // Stable: within a state the order above stays.
    reasons.sort_by_key(|r| std::cmp::Reverse(r.0));
    let worst = reasons.first().map_or(State::Good, |r| r.0);
    (worst, reasons)
}

fn reason(report: &Report, key: &str) -> String {
    let value = report.figure(key).unwrap_or(0.0);
    match key {
        key::MESH_MANIFOLD => "the mesh is not manifold".into(),
        key::DISPLACED_RMS => format!("with displacement the result leaves the input by {}", report.length(key)),
        key::SEAM_GAP_MAX => format!("neighbours are apart by {}", report.length(key)),
        key::SEAM_FOLDED if value == 1.0 => "one smooth seam is folded over".into(),
        key::SEAM_FOLDED => format!("{} smooth seams are folded over", count(value as u64)),
        key::GRID_FOLDS => {
            let cells = report.figure(key::GRID_POINTS).unwrap_or(1.0).max(1.0);
            let are = if value == 1.0 { "cell is" } else { "cells are" };
            format!("{} grid {are} folded ({})", count(value as u64), percent(value / cells))
        }
        key::SURFACE_CROSSINGS if value == 1.0 => "surfaces cross in one place".into(),
        key::SURFACE_CROSSINGS => format!("{} pairs of surfaces cross", count(value as u64)),
        key::SURFACE_TURNED if value == 1.0 => "one surface turns over somewhere".into(),
        key::SURFACE_TURNED => format!("{} surfaces turn over somewhere", count(value as u64)),
        key::SCAN_CONFIDENCE => format!("only {} of the evidence agrees on which side is outside", percent(value)),
        key::SEAM_INNER_ANGLE_MAX_DEG => format!("a smooth seam bends by {}°", number(value)),
        _ => "the shape is open: a shell, no solid".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Input;
    use planish::pipeline::{Figure, Warning};

    fn report(figures: &[(&str, f64)]) -> Report {
        let mut report = Report::new("run", Input { diagonal: 100.0, units: "mm".into(), ..Input::default() });
        report.quality.extend(figures.iter().map(|(key, x)| (key.to_string(), Figure::Number(*x))));
        report
    }

    #[test]
    fn a_sound_result_is_usable_and_folds_gaps_and_doubts_are_told_with_the_gravest_first() {
        let sound = [("mesh.manifold", 1.0), ("mesh.watertight", 1.0), ("seam.folded", 0.0), ("grid.folds", 0.0)];
        assert_eq!(verdict(&report(&sound)), (State::Good, Vec::new()));
        let mut doubtful = report(&[("mesh.watertight", 0.0), ("seam.inner_angle_max_deg", 3.0), ("seam.folded", 0.0)]);
        doubtful.warnings.push(Warning::new("units_guessed", "", ""));
        let (state, reasons) = verdict(&doubtful);
        assert_eq!((state, reasons.len()), (State::Look, 3));
        assert!(reasons[0].1.contains("bends by 3.00°") && reasons[2].1.contains("unit"), "{reasons:?}");
        let broken = report(&[
            ("mesh.watertight", 0.0),
            ("seam.folded", 2.0),
            ("seam.gap_max", 0.1),
            ("seam.gap_max_rel", 1e-3),
            ("grid.folds", 6196.0),
            ("grid.points", 20_000.0),
        ]);
        let crossed = report(&[("surface.crossings", 2.0), ("surface.turned", 1.0)]);
        let (state, reasons) = verdict(&crossed);
        assert_eq!((state, reasons.len()), (State::Broken, 2));
        assert!(reasons[0].1.contains("2 pairs") && reasons[1].0 == State::Look, "{reasons:?}");
        let (state, reasons) = verdict(&broken);
        let order: Vec<State> = reasons.iter().map(|r| r.0).collect();
        assert_eq!((state, order), (State::Broken, vec![State::Broken, State::Broken, State::Broken, State::Look]));
        assert!(reasons[0].1.contains("apart by 0.100 mm") && reasons[2].1.contains("6\u{202f}196"), "{reasons:?}");
    }
}
