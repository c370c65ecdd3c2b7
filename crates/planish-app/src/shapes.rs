//! Scans, meshes and models as shapes that can be compared and moved.

use crate::args::{ScanArgs, SurfaceWord};
use crate::failure::Failure;
use crate::files;
use crate::placed::Placed;
use crate::progress::Interrupt;
use planish::DVec3;
use planish::mesh::FeatureTags;
use planish::model::Units;
use planish::pipeline;
use planish::register::Shape;
use planish_io::report::Input;
use std::path::Path;

/// A shape near the origin.
pub struct Located {
    /// The shape.
    pub shape: Shape,
    /// Sharp edges of a mesh, if the file has them.
    pub tags: Option<FeatureTags>,
    /// What brings it back to its place.
    pub shift: DVec3,
    /// Units of a model, which has its own.
    pub units: Option<Units>,
}

/// Reads a scan, a mesh, or one surface of a model.
/// # Errors
/// If the file is none of them.
pub fn read(path: &Path, scan: &ScanArgs, surface: SurfaceWord) -> Result<Located, Failure> {
    if files::is_model(path) {
        let model = files::model(path)?;
        let made = match surface {
            SurfaceWord::Mesh => Ok(model.mesh.clone()),
            SurfaceWord::Base => pipeline::surface_mesh(&model, &Interrupt),
            SurfaceWord::Displaced => pipeline::displaced_mesh(&model, &Interrupt),
        };
        let mesh = made.map_err(|e| Failure::input(path, e).hint("fit it again with `planish fit`"))?;
        return Ok(Located { shape: Shape::Surface(mesh), tags: None, shift: model.shift, units: Some(model.units) });
    }
    if planish_io::is_scan(path) {
        let mut cloud = files::scan(path, scan)?;
        let shift = std::mem::take(&mut cloud.shift);
        return Ok(Located { shape: Shape::Points(cloud), tags: None, shift, units: None });
    }
    let Placed { mesh, tags, shift, .. } = Placed::read(path)?;
    Ok(Located { shape: Shape::Surface(mesh), tags, shift, units: None })
}

/// The facts of a shape as an input.
pub fn facts(path: &Path, shape: &Shape, units: Units) -> Input {
    match shape {
        Shape::Surface(mesh) => files::mesh_facts(path, mesh, units),
        Shape::Points(cloud) => Input {
            path: crate::words::told(&path.display().to_string()),
            kind: "scan".into(),
            counts: [("points".to_owned(), cloud.points.len() as u64)].into(),
            units: units.symbol().into(),
            diagonal: cloud.bounds().diagonal(),
        },
    }
}
