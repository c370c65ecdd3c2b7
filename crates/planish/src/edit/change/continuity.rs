//! What the seam along a curve is to be.

use crate::edit::check;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, Name};
use crate::network::{CurveKind, Seam};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Makes the seams along curves smooth or sharp, whatever the mesh has there. A sharp curve counts as one on a sharp edge:
/// it stays where it is until it is made smooth. An edge under a smooth one is rounded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Continuity {
    /// The curves; none of them on the boundary of the mesh.
    pub curves: Vec<Name>,
    /// What their seams are to be.
    pub seam: Seam,
}

impl Command for Continuity {
    fn check(&self) -> Result<(), ApplyError> {
        self.curves.iter().try_for_each(check::name)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        for name in &self.curves {
            let curve = work.network_curve(name)?;
            let kind = &mut work.drawing.network.curves[curve as usize].kind;
            if *kind == CurveKind::Boundary {
                return Err(ApplyError::NoSeam { curve });
            }
            *kind = self.seam.into();
        }
        Ok(())
    }

    fn only_moves(&self) -> bool {
        true
    }
}
