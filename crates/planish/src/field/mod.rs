//! Fields: what is inside, what is outside, and where a grid line passes from one to the other.
//!
//! [K01] Kobbelt, Botsch, Schwanecke, Seidel, *Feature Sensitive Surface Extraction from Volume Data*, §3.
//!
//! Two interfaces, both towards the same product, the directed distance field ([`Directed`]): the sides of the
//! nodes of a lattice, and on every lattice edge whose ends differ one hit with its normal.
//!
//! * [`Field`] answers point by point: solids, blended point samples, swept tools. [`sample`] walks the lattice
//!   for it, skips what [`Field::crosses`] rules out, and finds the hits by bracketing.
//! * Sources that know better how to fill whole lines make a [`Directed`] themselves: meshes by rasterising,
//!   scalar grids row by row.
//!
//! Directed fields on one lattice combine by `csg`.
//!
//! Departs from [K01]: hits are kept only on edges that change side (§3 stores three distances per node), in rows
//! of the lattice, so memory grows with the surface; and a field may not know a side at all ([`Side::Unknown`]),
//! where the surface then stays open.

mod creases;
pub mod csg;
pub mod directed;
mod grid_field;
mod kink;
mod lattice;
mod levels;
mod mesh_field;
mod part;
mod polygon;
pub mod sample;
mod sample_field;
mod scalar_grid;
mod solid;
mod sweep;
mod winding;

pub use creases::MeshCreases;
pub use directed::{Directed, Thin};
pub use grid_field::sample_grid;
pub use lattice::{Lattice, LatticeError, Spacing};
pub use levels::Levels;
pub use mesh_field::MeshField;
pub use part::{MeshBody, Part};
pub use polygon::{Polygon, PolygonError};
pub use sample::sample;
pub use sample_field::{FieldScale, SampleField};
pub use scalar_grid::{Body, GradientRule, GridParams, ScalarGrid};
pub use solid::{Formula, FormulaError, Solid};
pub use sweep::{Milling, Move, Tool};
pub use winding::Winding;

use crate::geom::Aabb;
use crate::mesh::MeshError;
use crate::observe::Cancelled;
use glam::DVec3;

/// Why a field cannot be made or sampled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FieldError {
    /// A mesh is damaged.
    #[error("{0}")]
    Mesh(MeshError),
    /// The lattice is no lattice, or too large.
    #[error("{0}")]
    Lattice(#[from] LatticeError),
    /// A scalar grid contradicts itself.
    #[error("{what}; write the volume again from its source")]
    Grid {
        /// What is wrong.
        what: String,
    },
    /// The observer wants no result any more.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// On which side of the surface a point lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// In the body.
    Inside,
    /// In the free space.
    Outside,
    /// The field has no data here: no surface passes between this point and any other.
    Unknown,
}

/// A field that is asked point by point.
///
/// Only [`Field::bounds`], [`Field::value`] and [`Field::gradient`] must be written; the others have defaults that
/// are right but may be slow.
///
/// A value is a *pseudo-distance*: negative inside, positive outside, continuous where it is known, zero on the
/// surface. It need not be a metric distance; what counts is its sign, its zero set, and its gradient there.
/// All answers must be functions of the point alone (the same bits on any thread and in any order).
pub trait Field: Sync {
    /// A box that holds the whole surface; outside it everything is [`Side::Outside`] or unknown.
    fn bounds(&self) -> Aabb;

    /// The pseudo-distance at `p`, world units; NaN where the field does not know.
    fn value(&self, p: DVec3) -> f64;

    /// Unit gradient of the value at `p`, outward near the surface. Zero where there is none (unknown or flat).
    /// Asked at hits, where it is the normal of the surface.
    fn gradient(&self, p: DVec3) -> DVec3;

    /// The side of `p`. A value of exactly zero is outside (the one rule for ties everywhere).
    fn side(&self, p: DVec3) -> Side {
        side_of(self.value(p))
    }

    /// Values at many points, in the same order; a hook for fields that answer batches faster.
    /// `values` has the length of `points`.
    fn values(&self, points: &[DVec3], values: &mut [f64]) {
        for (v, &p) in values.iter_mut().zip(points) {
            *v = self.value(p);
        }
    }

    /// Gradients at many points, in the same order; `gradients` has the length of `points`.
    fn gradients(&self, points: &[DVec3], gradients: &mut [DVec3]) {
        for (g, &p) in gradients.iter_mut().zip(points) {
            *g = self.gradient(p);
        }
    }

    /// True if [`Field::values`] of many points cost far less than one by one: then hits on many edges are sought at once.
    fn in_batches(&self) -> bool {
        false
    }

    /// May the surface cross this box, or may the box hold points of known and unknown side? `false` promises that
    /// all points of the box are on one side, that of its centre. The default says yes to everything, so that
    /// nothing is missed and nothing skipped.
    fn crosses(&self, _aabb: &Aabb) -> bool {
        true
    }

    /// The same field, bit for bit, for points of this box, where it answers faster there; a hook for fields of many
    /// parts of which a small box meets few.
    fn within(&self, _aabb: &Aabb) -> Option<Box<dyn Field + '_>> {
        None
    }

    /// Places on edges of a lattice are sought to this fraction of an edge.
    fn precision(&self) -> f64 {
        1e-13
    }

    /// Typical angle by which [`Field::gradient`] misses the true normal, degrees: 0 for exact sources. Normals that
    /// differ by less than about three times this are no evidence of a feature; the extractor widens its
    /// threshold accordingly.
    fn noise_deg(&self) -> f64 {
        0.0
    }
}

/// The side that a value stands for.
pub fn side_of(value: f64) -> Side {
    if value.is_nan() {
        Side::Unknown
    } else if value < 0.0 {
        Side::Inside
    } else {
        Side::Outside
    }
}

/// A source that knows its sharp edges better than the hits around a cell tell.
///
/// The extractor guesses where a feature passes a face of a cell, and where it runs inside; a source may correct that.
pub trait Creases: Sync {
    /// Where the feature between two hits passes the plane of nodes perpendicular to `axis` through `guess`; `None`
    /// if the guess is as good as anything. `a` and `b` are position and normal of the hits, `size` that of a cell.
    fn face_point(&self, axis: usize, guess: DVec3, a: (DVec3, DVec3), b: (DVec3, DVec3), size: f64) -> Option<DVec3>;

    /// A place of the feature inside the cell near `guess`; `through` are the points at which it passes the cell's faces,
    /// `corner` whether several features seem to meet here, `bounds` the lowest and the highest corner of the cell, `hits`
    /// the positions and normals around.
    fn inner_point(
        &self,
        guess: DVec3,
        through: &[DVec3],
        corner: bool,
        bounds: [DVec3; 2],
        hits: &[(DVec3, DVec3)],
    ) -> Option<DVec3>;

    /// The place of a feature nearest to `p`, within `reach`: where a vertex goes that had to stay in its cell. `hits`
    /// are the positions and normals around.
    fn nearest(&self, p: DVec3, reach: f64, hits: &[(DVec3, DVec3)]) -> Option<DVec3>;

    /// Cosine of the normals of two hits above which the source knows no bend between them. Bends between the threshold
    /// of the extraction and this are taken where [`Creases::faint_point`] knows them.
    fn faint(&self) -> f64 {
        -1.0
    }

    /// Where a bend fainter than the threshold passes the square from `low` to `high` in the plane of nodes
    /// perpendicular to `axis`, between two hits, and whether it is part of a feature; `None` if there is none.
    fn faint_point(
        &self,
        _axis: usize,
        _low: DVec3,
        _high: DVec3,
        _a: (DVec3, DVec3),
        _b: (DVec3, DVec3),
    ) -> Option<(DVec3, bool)> {
        None
    }

    /// Where what lies between two hits on one side of the square from `low` to `high`, which is perpendicular to `axis`, ends inside
    /// of it; `None` if the source cannot tell.
    fn tip_point(&self, _axis: usize, _square: [DVec3; 2], _a: (DVec3, DVec3), _b: (DVec3, DVec3)) -> Option<DVec3> {
        None
    }

    /// The place of a bend inside the cell from `low` to `high` nearest to `guess`.
    fn bend(&self, _guess: DVec3, _low: DVec3, _high: DVec3) -> Option<DVec3> {
        None
    }

    /// The corner that the surfaces of `hits` have within `reach` of `guess`, where the source can be asked for it but
    /// does not list its corners.
    fn corner_near(&self, _guess: DVec3, _reach: f64, _hits: &[(DVec3, DVec3)]) -> Option<DVec3> {
        None
    }

    /// The corners that are known, where features meet, bend or end; none where the source cannot list them.
    fn corners(&self) -> Vec<DVec3> {
        Vec::new()
    }

    /// Where two features pass one face of a cell, which has one point for them: places on both and around, each with the
    /// normals of both sides, where the source can list them.
    fn crowded(&self) -> Vec<(DVec3, [DVec3; 2])> {
        Vec::new()
    }
}
