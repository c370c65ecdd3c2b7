//! Edits of the relief by hand: strokes of a brush, smoothing, erasing. The list of them is what counts; the relief follows it as a
//! job, and surfaces that are fitted anew get all of them again.

use super::Table;
use super::jobs::Outcome;
use super::keep::strokes::{Sculpted, entry_of, follow};
use super::project::{NO_PROJECT, Project};
use crate::protocol::Why;
use crate::web::hub::Client;
use planish::model::Model;
use planish::observe::Observer;
use planish::relief::layers::ReliefEdit;
use std::sync::Arc;

const NO_RELIEF: &str = "there is no relief yet - hint: fit surfaces first";
/// Kind of the jobs that edit a relief.
pub const SCULPT: &str = "sculpt";

impl Project {
    /// True if the relief that is there is of the drawing as it is.
    fn has_relief(&self) -> bool {
        self.fit.as_ref().is_some_and(|f| f.revision == self.revision && !f.coarse && !f.model.reliefs.is_empty())
    }

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
        let (model, mut edits, list) = (fit.model.clone(), fit.relief.clone(), project.kept.relief.clone());
        let (revision, folder) = (fit.revision, project.folder());
        Some(self.desk.jobs.start(self.scope, (SCULPT, "Editing the relief"), move |watch| {
            let Model { network, surfaces, reliefs, layers, .. } = model.as_ref();
            let (network, surfaces) = (network.clone(), surfaces.clone());
            let (reliefs, layers) = (reliefs.clone(), layers.clone());
            let mut model = Model { network, surfaces, reliefs, layers, ..Model::default() };
            let trouble = follow(&mut model, &mut edits, &list, &folder, watch as &dyn Observer).err();
            let Model { layers, reliefs, .. } = model;
            Outcome::Sculpted(revision, Box::new(Sculpted { edits, layers, reliefs, trouble }))
        }))
    }

    /// An edit of the relief was stopped, by nobody who makes another: the list is what the relief has.
    pub(super) fn unsculpted(&mut self) {
        let Some(project) = self.project.as_mut().filter(|p| p.has_relief()) else { return };
        let has = project.fit.as_ref().map(|f| f.relief.clone());
        if let Some(has) = has.filter(|_| !self.desk.jobs.has(SCULPT) && !self.desk.jobs.has("fit")) {
            project.kept.relief = has;
            project.keep();
        }
    }

    /// Takes over an edited relief. An edit that cannot be made goes from the list, and the others are made.
    pub(super) fn sculpted(&mut self, revision: u64, made: Sculpted) -> Result<(), Why> {
        let Some(project) = &mut *self.project else { return Ok(()) };
        let Some(fit) = project.fit.as_mut().filter(|f| f.revision == revision) else { return Ok(()) };
        let Sculpted { edits, layers, reliefs, trouble } = made;
        let model = Arc::make_mut(&mut fit.model);
        (model.layers, model.reliefs) = (layers, reliefs);
        if trouble.is_some() && edits.len() < project.kept.relief.len() {
            project.kept.relief.remove(edits.len());
        }
        (fit.relief, fit.short) = (edits, None);
        fit.quality.clear();
        project.take_relief();
        project.keep();
        self.desk.layers.new_relief();
        if self.follow_list().is_none() {
            self.measure();
        }
        trouble.map_or(Ok(()), |why| Err(Why::of(why)))
    }
}
