//! Why a fit is not possible: what is wrong, by how much, and the way out (`docs/guide/fit.md`).

use crate::observe::Cancelled;

/// Errors of the surface stage.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// A direction has fewer nodes than control points.
    #[error("{points} grid points cannot carry {control} control points; refine the grid or ask for fewer")]
    TooFewPoints {
        /// Nodes along the direction.
        points: usize,
        /// Control points asked for.
        control: usize,
    },
    /// Fewer control points than a cubic span has.
    #[error("{control} control points along a side are too few; a cubic needs 4")]
    TooFewControl {
        /// Control points asked for.
        control: usize,
    },
    /// The normal matrix is singular to rounding.
    #[error("{points} grid points do not determine {control} control points; ask for fewer")]
    Singular {
        /// Nodes along the direction.
        points: usize,
        /// Control points asked for.
        control: usize,
    },
    /// A grid's point list has the wrong length or a grid is too small.
    #[error("the grid of patch {patch} is {rows} x {cols} but has {points} points; make the grid again")]
    Shape {
        /// The patch.
        patch: usize,
        /// Nodes along `v`.
        rows: usize,
        /// Nodes along `u`.
        cols: usize,
        /// Points found.
        points: usize,
    },
    /// One list entry per patch or curve is needed.
    #[error("{found} {what} were given for {wanted}; give one each")]
    Count {
        /// What the list holds.
        what: &'static str,
        /// Entries found.
        found: usize,
        /// Entries needed.
        wanted: usize,
    },
    /// A side names a curve that does not exist.
    #[error("patch {patch} uses curve {curve}, which the network does not have")]
    NoSuchCurve {
        /// The patch.
        patch: usize,
        /// The curve.
        curve: u32,
    },
    /// A coordinate is not a number.
    #[error("the grid of patch {patch} has a coordinate that is not finite")]
    NotFinite {
        /// The patch.
        patch: usize,
    },
    /// Two patches disagree on the number of nodes or control points along their curve.
    #[error("curve {curve} has {first} points on one side and {second} on the other; give its chord one count")]
    Mismatch {
        /// The curve.
        curve: usize,
        /// Count on the first side.
        first: usize,
        /// Count on another.
        second: usize,
    },
    /// Two patches disagree on the places of the nodes along their curve.
    #[error("the grids at curve {curve} are {gap:.3e} apart; make them from one network")]
    OpenSeam {
        /// The curve.
        curve: usize,
        /// Largest distance, world units.
        gap: f64,
    },
    /// A tolerance or another parameter makes no sense.
    #[error("{name} is {value}; it must be {wanted}")]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        wanted: &'static str,
    },
    /// Control points are asked for at a patch that does not exist.
    #[error(
        "control points are asked for at patch {patch}, but there are {patches}, counted from 0; `planish info` lists them"
    )]
    NoSuchPatch {
        /// The patch.
        patch: usize,
        /// Patches of the network.
        patches: usize,
    },
    /// A budget of control points that no tolerance keeps.
    #[error("{most} control points in all are too few, {least} are needed; raise the limit, or give fewer patches")]
    Budget {
        /// The budget.
        most: usize,
        /// What was needed at the widest tolerance.
        least: usize,
    },
    /// A surface that cannot be evaluated.
    #[error("the surface is malformed: {what}; fit it again")]
    Malformed {
        /// What is wrong.
        what: &'static str,
    },
    /// Two patches disagree on the knots along their curve.
    #[error("patch {patch} has other knots along a side than its neighbour; fit the surfaces again")]
    Knots {
        /// The patch.
        patch: usize,
    },
    /// The system of the seams is singular to rounding.
    #[error("the system of {unknowns} unknowns along the seams is singular; fit with fewer control points")]
    Unsolvable {
        /// Unknowns.
        unknowns: usize,
    },
    /// The observer asked to stop.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}
