//! Sets the plane of symmetry of a drawing, or finds it (`docs/methods/curves.md`, "Mirroring").

use crate::curve::symmetry::{self, Plane};
use crate::edit::check;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Sets the plane of symmetry, or finds it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Symmetry {
    /// The plane; absent to find it.
    #[serde(default)]
    pub plane: Option<Plane>,
}

impl Command for Symmetry {
    fn check(&self) -> Result<(), ApplyError> {
        self.plane.map_or(Ok(()), |p| {
            check::finite("the point of the plane", &p.point.to_array())?;
            check::direction("the length of the plane's normal", &p.normal.to_array())
        })
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let plane = match self.plane {
            Some(plane) => Plane { normal: plane.normal.normalize_or_zero(), ..plane },
            None => symmetry::find(work.ground.canvas.mesh, &work.ground.bvh, work.observer)?.0,
        };
        work.drawing.sketch.symmetry = Some(plane);
        Ok(())
    }
}
