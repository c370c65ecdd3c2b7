//! Draws the cut of the mesh by a plane as a curve (`docs/guide/edit.md`).

use crate::curve::section;
use crate::edit::check::{self, Range, within};
use crate::edit::place::usual_snap;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, Spot};
use crate::network::CurveKind;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The cut by a plane, as a curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// A place on the cut.
    pub through: Spot,
    /// Normal of the plane.
    pub normal: [f64; 3],
    /// Share of the diagonal.
    #[serde(default = "usual_snap")]
    pub snap: f64,
}

impl Command for Cut {
    fn check(&self) -> Result<(), ApplyError> {
        check::spot("through", &self.through)?;
        check::direction("the length of normal", &self.normal)?;
        within("snap", self.snap, Range::NotNegative)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let canvas = &work.ground.canvas;
        let place = work.place(&self.through)?;
        let point = place.position(canvas.mesh);
        let normal = DVec3::from_array(self.normal);
        let curve = section::cut_plane(canvas.mesh, &canvas.adjacency, point, normal, place.face)?;
        work.add(&curve, CurveKind::Smooth, self.snap)
    }
}
