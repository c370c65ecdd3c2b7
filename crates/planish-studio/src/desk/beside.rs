//! What lies beside a project: what is known of its points, reliefs that are shown in the place of its own, other ways of its
//! history, another project that is looked at.

use crate::protocol::state;
use planish::cloud::{Cloud, Samples};
use planish::edit::Edit;
use planish::mesh::TriMesh;
use planish::model::{Drawing, HistoryEntry};
use planish::pipeline::voxel_for;
use planish::relief::Relief;
use std::path::Path;
use std::sync::Arc;

/// What is known of the points of a scan.
pub struct Known {
    /// The samples, from which the mesh is made.
    pub samples: Samples,
    /// The points on their surface, in the order of the scan, with their attributes.
    pub cloud: Cloud,
    /// Points that are outliers.
    pub outliers: usize,
}

impl Known {
    /// What pages are told of it.
    pub fn told(&self) -> state::Cleaned {
        let Samples { noise, spacing, closed, .. } = &self.samples;
        state::Cleaned {
            noise: *noise,
            spacing: *spacing,
            outliers: self.outliers as u64,
            parts: closed.len() as u32,
            voxel: voxel_for(&self.samples),
        }
    }
}

/// Reliefs that are shown in the place of those of the model.
#[derive(Clone)]
pub struct Shown {
    /// The longest waves in them, world units.
    pub longest: f64,
    /// One for each patch.
    pub maps: Arc<Vec<Relief>>,
}

/// All edits of one way, from the beginning on.
pub type Branch = Vec<HistoryEntry>;

/// The edit of an entry of the history; none if it is of another version.
pub fn edit_of(entry: &HistoryEntry) -> Option<Edit> {
    let mut value: serde_json::Value = serde_json::from_str(&entry.parameters).ok()?;
    value.as_object_mut()?.insert("edit".into(), entry.command.clone().into());
    serde_json::from_value(value).ok()
}

/// The other project.
#[derive(Clone)]
pub struct Peer {
    /// Its file name.
    pub file: String,
    /// Its mesh.
    pub mesh: Arc<TriMesh>,
    /// Its drawing.
    pub drawing: Arc<Drawing>,
}

impl Peer {
    /// What pages are told of it.
    pub fn told(&self) -> state::Peer {
        let bounds = self.mesh.bounds();
        state::Peer {
            file: self.file.clone(),
            center: bounds.center().to_array(),
            diagonal: bounds.diagonal(),
            curves: self.drawing.network.curves.len() as u32,
        }
    }
}

/// Another model of a folder, by its bare name.
pub fn other(folder: &Path, name: &str) -> Result<(TriMesh, Drawing), String> {
    if Path::new(name).file_name() != Some(name.as_ref()) {
        return Err("is not a file of the project's folder".into());
    }
    let model = planish_io::read_model(folder.join(name)).map_err(|e| e.to_string())?;
    let drawing = model.drawing();
    Ok((model.mesh, drawing))
}
