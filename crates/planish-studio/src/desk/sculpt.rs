//! Edits of the relief by hand: strokes of a brush, smoothing, erasing. The list of them is what counts; the relief follows it as a
//! job, and surfaces that are fitted anew get all of them again.

use super::Table;
use super::jobs::Outcome;
use super::project::{NO_PROJECT, Project};
use crate::protocol::Why;
use crate::web::hub::Client;
use planish::model::{HistoryEntry, Model};
use planish::observe::Observer;
use planish::relief::Relief;
use planish::relief::layers::{self, Layers, Picture, ReliefEdit};
use std::path::Path;
use std::sync::Arc;

const NO_RELIEF: &str = "there is no relief yet - hint: fit surfaces first";
/// Kind of the jobs that edit a relief.
pub const SCULPT: &str = "sculpt";

/// A relief with edits.
pub struct Sculpted {
    /// The edits.
    pub edits: Vec<ReliefEdit>,
    /// What they lie above, and they.
    pub layers: Layers,
    /// All of it together.
    pub reliefs: Vec<Relief>,
}

/// Makes the relief of a model follow a list of edits: takes those back that it has and the list has not, and makes the others. An edit
/// that cannot be made ends it, and is told; those before it are made.
/// * `has` - the edits that it has, and has afterwards
/// * `folder` - where images of stamps are
pub fn follow(
    model: &mut Model,
    has: &mut Vec<ReliefEdit>,
    list: &[ReliefEdit],
    folder: &Path,
    observer: &dyn Observer,
) -> Result<(), String> {
    let shared = has.iter().zip(list).take_while(|(a, b)| a == b).count();
    while has.len() > shared {
        model.undo_relief();
        has.pop();
    }
    let pictures = |name: &str| -> Result<Picture, String> {
        match Path::new(name).file_name() == Some(name.as_ref()) {
            true => planish_io::maps::read_picture(&folder.join(name)).map_err(|e| format!("{name}: {e}")),
            false => Err(format!("{name} is not a file of the project's folder")),
        }
    };
    for edit in &list[shared..] {
        let Model { layers, reliefs, network, surfaces, .. } = &mut *model;
        layers.begin(reliefs);
        let made = layers::edit(layers, (network, surfaces), edit, &pictures, observer).map_err(|e| e.to_string())?;
        model.record_relief(entry_of(edit), made.stack);
        has.push(edit.clone());
    }
    Ok(())
}

fn entry_of(edit: &ReliefEdit) -> HistoryEntry {
    HistoryEntry { command: edit.name().into(), parameters: serde_json::to_string(edit).unwrap_or_default() }
}

/// The edits that the relief of a model has; none if some are not of a script.
pub fn edits_of(layers: &Layers) -> Vec<ReliefEdit> {
    let edit = |past: &layers::Past| serde_json::from_str(&past.parameters).ok();
    layers.undo.iter().map(edit).collect::<Option<_>>().unwrap_or_default()
}

impl Project {
    /// True if the relief that is there is of the drawing as it is.
    fn has_relief(&self) -> bool {
        self.fit.as_ref().is_some_and(|f| f.revision == self.revision && !f.coarse && !f.model.reliefs.is_empty())
    }
}

impl Project {
    /// Takes the relief with its edits over from what was fitted, where that is of the drawing as it is.
    pub(super) fn take_relief(&mut self) {
        let Some(fit) = self.fit.as_ref().filter(|f| f.revision == self.revision && !f.coarse) else { return };
        (self.model.layers, self.model.reliefs) = (fit.model.layers.clone(), fit.model.reliefs.clone());
        self.model.history.retain(|h| serde_json::from_str::<ReliefEdit>(&h.parameters).is_err());
        self.model.history.extend(fit.relief.iter().map(entry_of));
    }
}

impl<'env> Table<'_, '_, 'env> {
    /// Makes an edit of the relief.
    pub(super) fn sculpt(&mut self, client: &Client, id: u32, edit: ReliefEdit) {
        self.list(client, id, |project| {
            project.kept.relief.push(edit);
            project.kept.relief_undone.clear();
            true
        });
    }

    /// Takes edits of the relief back.
    pub(super) fn unsculpt(&mut self, client: &Client, id: u32, count: usize) {
        self.list(client, id, |project| {
            let moved = (0..count).map_while(|_| project.kept.relief.pop());
            let before = project.kept.relief_undone.len();
            project.kept.relief_undone.extend(moved);
            project.kept.relief_undone.len() > before
        });
    }

    /// Makes edits of the relief again that were taken back.
    pub(super) fn resculpt(&mut self, client: &Client, id: u32, count: usize) {
        self.list(client, id, |project| {
            let moved = (0..count).map_while(|_| project.kept.relief_undone.pop());
            let before = project.kept.relief.len();
            project.kept.relief.extend(moved);
            project.kept.relief.len() > before
        });
    }

    /// Changes the list of edits; the relief follows.
    fn list(&mut self, client: &Client, id: u32, change: impl FnOnce(&mut Project) -> bool) {
        let Some(project) = &mut *self.project else { return self.refuse(client, id, Why::of(NO_PROJECT)) };
        if !project.has_relief() {
            return self.refuse(client, id, Why::of(NO_RELIEF));
        }
        if !change(project) {
            return self.refuse(client, id, Why::of("there is no edit of the relief left"));
        }
        project.keep();
        match self.follow_list() {
            Some(job) => self.wait_for(client, id, job),
            None => self.done(client, id, String::new()),
        }
    }

    /// Starts to make the relief follow the list, if it does not.
    pub(super) fn follow_list(&mut self) -> Option<u32> {
        let project = self.project.as_ref().filter(|p| p.has_relief())?;
        let fit = project.fit.as_ref()?;
        self.desk.jobs.stop_kind(SCULPT);
        if fit.relief == project.kept.relief {
            return None;
        }
        let (model, mut has, list) = (fit.model.clone(), fit.relief.clone(), project.kept.relief.clone());
        let (revision, folder) = (fit.revision, project.folder());
        Some(self.desk.jobs.start(self.scope, (SCULPT, "Editing the relief"), move |watch| {
            let mut model = Model { grids: Vec::new(), ..model.as_ref().clone() };
            let result = follow(&mut model, &mut has, &list, &folder, watch as &dyn Observer);
            let Model { layers, reliefs, .. } = model;
            Outcome::Sculpted(revision, result.map(|()| Box::new(Sculpted { edits: has, layers, reliefs })))
        }))
    }

    /// Takes over an edited relief. What cannot be made goes from the list.
    pub(super) fn sculpted(&mut self, revision: u64, result: Result<Box<Sculpted>, String>) -> Result<(), Why> {
        let Some(project) = &mut *self.project else { return Ok(()) };
        let Some(fit) = project.fit.as_mut().filter(|f| f.revision == revision) else { return Ok(()) };
        let Sculpted { edits, layers, reliefs } = match result {
            Ok(made) => *made,
            Err(why) => {
                project.kept.relief.pop();
                project.keep();
                return Err(Why::of(why));
            }
        };
        let model = Arc::make_mut(&mut fit.model);
        (model.layers, model.reliefs) = (layers, reliefs);
        (fit.relief, fit.short) = (edits, None);
        fit.quality.clear();
        project.take_relief();
        project.keep();
        self.desk.layers.new_relief();
        self.measure();
        Ok(())
    }
}
