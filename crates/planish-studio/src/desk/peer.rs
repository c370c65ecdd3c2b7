//! Another project of the folder that is looked at, so that places of both can be matched and its network carried over.

use super::jobs::Outcome;
use super::project::NO_PROJECT;
use super::{Table, content};
use crate::protocol::{Why, state};
use crate::web::hub::Client;
use planish::mesh::TriMesh;
use planish::model::Drawing;
use std::path::Path;
use std::sync::Arc;

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

impl<'env> Table<'_, '_, 'env> {
    /// Looks at another project, or at none.
    pub(super) fn peer(&mut self, client: &Client, id: u32, file: Option<String>) {
        let Some(project) = &mut *self.project else { return self.refuse(client, id, Why::of(NO_PROJECT)) };
        let Some(file) = file else {
            project.peer = None;
            self.done(client, id, String::new());
            return self.tell_state();
        };
        let folder = project.file.parent().unwrap_or(Path::new("")).to_owned();
        if !content::is_project(Path::new(&file)) || folder.join(&file) == project.file {
            return self.refuse(client, id, Why::of(format!("{file} is no other project of this folder")));
        }
        let job = self.desk.jobs.start_free("peer", &format!("Reading {file}"), move |_| {
            let read = other(&folder, &file).map_err(|e| format!("{file}: {e}"));
            Outcome::Looked(read.map(|(mesh, drawing)| Peer { file, mesh: Arc::new(mesh), drawing: Arc::new(drawing) }))
        });
        self.wait_for(client, id, job);
    }
}
