//! Brings a polyline onto the mesh ([K98] §3.3.1, CurveAttract).

use crate::curve::section;
use crate::edit::check::{self, Range, within};
use crate::edit::place::usual_snap;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command};
use crate::network::CurveKind;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A polyline brought onto the mesh: along `direction`, or to the nearest places.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Project {
    /// World positions.
    pub points: Vec<[f64; 3]>,
    /// Zero for the nearest places.
    #[serde(default)]
    pub direction: [f64; 3],
    /// Share of the diagonal.
    #[serde(default = "usual_snap")]
    pub snap: f64,
}

impl Command for Project {
    fn check(&self) -> Result<(), ApplyError> {
        self.points.iter().try_for_each(|p| check::finite("a point", p))?;
        check::finite("direction", &self.direction)?;
        within("snap", self.snap, Range::NotNegative)
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let direction = DVec3::from_array(self.direction);
        if direction == DVec3::ZERO {
            self.points.iter().try_for_each(|p| work.nearest(*p).map(drop))?;
        }
        let points: Vec<DVec3> = self.points.iter().map(|p| DVec3::from_array(*p)).collect();
        let canvas = &work.ground.canvas;
        let (mesh, adjacency) = (canvas.mesh, &canvas.adjacency);
        let curve = section::project(mesh, adjacency, &work.ground.bvh, &points, direction, canvas.edge)?;
        work.add(&curve, CurveKind::Smooth, self.snap)
    }
}
