//! Surface curves: chains of places on a dense mesh that a person paints, pulls and lets relax.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, ch. 3 and appendix A.
//! 1. representation, tracing over the faces  - §3.1, [`SurfaceCurve`], [`connect`]
//! 2. painting between picks                  - §3.2, [`Stroke`] on a [`Canvas`]
//! 3. space curves that carry a curve along   - §3.3, [`attract`], [`SplineEdit`]
//! 4. snakes                                  - §3.5 to 3.8, [`Snake`]
//! 5. scalars that draw a snake               - §3.8.2, [`ScalarField`]
//! 6. sections, projections, lines of a mesh  - [`section`]; curves of another mesh [`carry`]; [`symmetry`]
//!
//! Departs from [K98]: two neighbours may lie any number of faces apart; [`connect`] finds the faces between
//! them, so a curve may be sampled as coarsely as its shape allows.

use crate::observe::Cancelled;

pub mod attract;
mod canvas;
pub mod carry;
mod chain;
mod curvature;
mod paint;
mod scalar;
pub mod section;
mod snake;
mod spline_edit;
mod strip;
pub mod symmetry;

pub use attract::{attract, slide_to};
pub use canvas::{Canvas, Magnet};
pub use chain::SurfaceCurve;
pub(crate) use chain::{between, without_repeats};
pub use curvature::{VertexCurvature, vertex_curvature};
pub use paint::{PaintMode, PaintParams, Snap, SnapTargets, Stroke, snap, way};
pub use scalar::ScalarField;
pub use snake::{Energy, Relaxed, Section, Snake, SnakeParams, Sweep};
pub use spline_edit::SplineEdit;
pub use strip::{connect, straighten};

/// Why there is no curve.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CurveError {
    /// Two places lie on pieces of the mesh that do not hang together.
    #[error(
        "no way over the surface from ({:.6}, {:.6}, {:.6}) to ({:.6}, {:.6}, {:.6}); pick both on one piece of the mesh",
        from[0], from[1], from[2], to[0], to[1], to[2]
    )]
    NoWay {
        /// World position of the first.
        from: [f64; 3],
        /// World position of the second.
        to: [f64; 3],
    },
    /// A place names a face that is not there.
    #[error("face {face} is not there, the mesh has {faces}; use the mesh that the curve was made on")]
    NoSuchFace {
        /// The face named.
        face: u32,
        /// Faces of the mesh.
        faces: usize,
    },
    /// A curve needs more points.
    #[error("too few points for a curve ({found}); give at least {needed}")]
    TooFewPoints {
        /// Points given.
        found: usize,
        /// Points needed.
        needed: usize,
    },
    /// A plane, a ray or a polyline meets no surface.
    #[error("nothing of the surface is met {place}; move it onto the mesh")]
    NothingMet {
        /// Where.
        place: &'static str,
    },
    /// A scalar has another number of values than the mesh has vertices.
    #[error("{found} values for {wanted} vertices; give one per vertex")]
    ValueCount {
        /// Values given.
        found: usize,
        /// Vertices.
        wanted: usize,
    },
    /// Landmarks do not fix a map from one shape to the other.
    #[error("the {count} landmarks do not fix a map ({why}); give at least four that do not lie in a plane")]
    Landmarks {
        /// Landmarks given.
        count: usize,
        /// What is wrong.
        why: &'static str,
    },
    /// The shape has no plane of symmetry to speak of.
    #[error(
        "no plane of symmetry: the best misses by {:.2} % of the diagonal; name the plane, or allow more",
        100.0 * miss
    )]
    NotSymmetric {
        /// Mean distance of mirrored points from the surface over the diagonal.
        miss: f64,
    },
    /// A point, section or control vertex of a curve is named that is not there.
    #[error("{what} {index} is not there, there are {count}; count from 0")]
    NoSuchPart {
        /// What is named.
        what: &'static str,
        /// Its number.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// Stopped by the observer.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}
