//! A project on the desk: a scan or a mesh with its drawing, what was fitted to it, and its file.

use super::beside::{Branch, Known, Peer, Shown, edit_of, other};
use super::keep::journal::Journal;
use super::keep::kept::{self, Kept};
use super::keep::preparation::{Basis, Preparation};
use super::keep::save::Saver;
use super::keep::strokes;
use crate::protocol::state::Hole;
use planish::cloud::Cloud;
use planish::edit::{Edit, Ground, Made, Redo, Undo, apply};
use planish::mesh::TriMesh;
use planish::model::{Drawing, HistoryEntry, Model, Step, Units};
use planish::network::{Fault, diagnose};
use planish::observe::{Observer, Silent};
use planish::pipeline::{Earlier, PipelineParams, Quality, Warning};
use planish::relief::layers::ReliefEdit;
use planish::surface::{Deviation, SeamQuality, deviation_of};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What is told where a project is wanted.
pub const NO_PROJECT: &str = "no project is open - hint: drop a file on the page";

/// A project.
pub struct Project {
    /// The mesh, which no edit changes; empty while there is a scan alone.
    pub mesh: Arc<TriMesh>,
    /// Everything else; its own mesh is empty.
    pub model: Model,
    /// The scan that it was made of, if that is known.
    pub scan: Option<Arc<Cloud>>,
    /// What is known of its points, if somebody has asked.
    pub known: Option<Arc<Known>>,
    /// The scan before each time that points were left out.
    pub left_out: Vec<Arc<Cloud>>,
    /// Steps to the mesh, and edits of the relief.
    pub kept: Kept,
    /// The edits that can be made again after them, with their drawings; as far as this session has made them.
    ahead: Vec<Step>,
    /// Edits that are to be made again as soon as there is a mesh.
    then: usize,
    /// Holes of the mesh, while they can be closed.
    pub holes: Vec<Hole>,
    /// Edits that were left for others.
    pub branches: Vec<Branch>,
    /// Another project that is looked at.
    pub peer: Option<Peer>,
    /// Its file.
    pub file: PathBuf,
    /// What to know of how it was opened.
    pub notice: String,
    /// Rises with every change of the drawing.
    pub revision: u64,
    /// What is left to put right.
    pub faults: Vec<Fault>,
    /// What was fitted last.
    pub fit: Option<Fit>,
    /// Parameters of the stages, other than how fine surfaces are.
    pub params: PipelineParams,
    pub(super) saver: Saver,
    journal: Journal,
}

/// What was fitted, and to which drawing.
pub struct Fit {
    /// Revision that it is of.
    pub revision: u64,
    /// The model with its surfaces, without mesh and history.
    pub model: Arc<Model>,
    /// Where the next fit begins.
    pub earlier: Option<Earlier>,
    /// Figures.
    pub quality: Quality,
    /// Seams.
    pub seams: Vec<SeamQuality>,
    /// What to know of it.
    pub warnings: Vec<Warning>,
    /// Distances of each surface to its grid.
    pub deviations: Vec<Deviation>,
    /// True if its grids are coarse: a pause on the way.
    pub coarse: bool,
    /// The reliefs that are shown, if not those of the model.
    pub short: Option<Shown>,
    /// Edits that its relief has.
    pub relief: Vec<ReliefEdit>,
}

/// Distances of each surface of a model to its grid.
pub fn deviations(model: &Model) -> Vec<Deviation> {
    model.surfaces.iter().zip(&model.grids).map(|(s, g)| deviation_of(s, g)).collect()
}

/// Why an edit was not made.
pub enum Refused {
    /// The library refuses.
    Apply(planish::edit::ApplyError),
    /// There is no such step in the history.
    Nothing(&'static str),
    /// There is no mesh yet.
    NoMesh,
}

impl std::fmt::Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Refused::Apply(e) => e.fmt(f),
            Refused::Nothing(what) => f.write_str(what),
            Refused::NoMesh => f.write_str("there is no mesh yet - hint: make one of the scan first"),
        }
    }
}

impl Project {
    /// A project on a model.
    pub fn of_model(mut model: Model, file: PathBuf, notice: String) -> Project {
        let mesh = Arc::new(std::mem::take(&mut model.mesh));
        let params = serde_json::from_str(&model.params).unwrap_or_default();
        let journal = Journal::new(&file);
        let mut kept = Kept::of(&model.studio).unwrap_or_else(|| Kept::on(&mesh.points, None));
        if !model.layers.stack.is_empty() {
            // Another command may have changed it.
            kept.relief = strokes::edits_of(&model.layers);
        }
        Project {
            mesh,
            scan: None,
            known: None,
            left_out: Vec::new(),
            kept,
            ahead: Vec::new(),
            then: 0,
            holes: Vec::new(),
            branches: Vec::new(),
            peer: None,
            notice,
            revision: 1,
            faults: Vec::new(),
            fit: None,
            params,
            saver: Saver::new(&file),
            journal,
            file,
            model,
        }
        .with_fit()
    }

    /// A project on a scan, without a mesh.
    /// * `name` - of the scan, if it lies beside the project
    pub fn of_scan(cloud: Cloud, name: Option<String>, units: Units, file: PathBuf) -> Project {
        let model = Model { units, shift: cloud.shift, ..Model::default() };
        let kept = Kept::on(&cloud.points, name);
        Project { scan: Some(Arc::new(cloud)), kept, ..Project::of_model(model, file, String::new()) }
    }

    /// What steps to the mesh are made on.
    pub fn basis(&self) -> Basis {
        Basis {
            folder: self.folder(),
            scan: self.scan.clone(),
            left_out: self.left_out.clone(),
            known: self.known.clone(),
            mesh: self.mesh.clone(),
            params: self.params.clone(),
        }
    }

    /// Where its file is.
    pub fn folder(&self) -> PathBuf {
        self.file.parent().unwrap_or(Path::new("")).to_owned()
    }

    /// True if something is drawn, or can be taken back, on the mesh as it is.
    pub fn has_edits(&self) -> bool {
        !self.model.undo.is_empty() || self.has_curves()
    }

    /// True if there are curves.
    pub fn has_curves(&self) -> bool {
        !self.model.network.curves.is_empty()
    }

    /// True if there were curves before the first edit.
    pub fn is_drawn_by_others(&self) -> bool {
        self.model.undo.first().map_or(self.has_curves(), |s| !s.other.network.curves.is_empty())
    }

    /// Edits that can be made again once all steps to the mesh are, the next one first.
    pub fn ahead(&self) -> Vec<HistoryEntry> {
        match self.kept.preparation.undone[..] {
            [] => self.model.redo.iter().rev().map(|s| s.entry.clone()).collect(),
            _ => self.kept.preparation.ahead.clone(),
        }
    }

    /// The project after other steps to the mesh, with nothing drawn. The steps are on the disk when this returns.
    /// * `then` - edits that are to be made again as soon as there is a mesh
    pub fn prepared(mut self, basis: Basis, preparation: Preparation, then: usize) -> Project {
        if !self.model.redo.is_empty() {
            self.ahead = std::mem::take(&mut self.model.redo);
        }
        self.kept.preparation = preparation;
        self.kept.write(&self.file);
        // Its edits were taken back.
        self.journal.clear();
        self.rebuilt(basis, then)
    }

    /// The project on another basis.
    fn rebuilt(self, basis: Basis, then: usize) -> Project {
        let Model { units, shift, history, .. } = self.model;
        let Basis { scan, left_out, known, mesh, params, .. } = basis;
        let (model, fit) = (Model { units, shift, history, ..Model::default() }, None);
        let (faults, branches, revision) = (Vec::new(), Vec::new(), self.revision + 1);
        Project { scan, left_out, known, mesh, params, model, fit, faults, branches, revision, then, ..self }.unsaved()
    }

    /// Brings what is kept besides the drawing to the disk.
    pub fn keep(&mut self) {
        self.kept.write(&self.file);
        self.save();
    }

    /// Takes up steps to the mesh and edits of the relief that were made but are in no project file.
    pub fn take_up(mut self, observer: &dyn Observer) -> Project {
        let Some(found) = Kept::read(&self.file, self.kept.preparation.origin) else { return self };
        let Kept { preparation, relief, relief_undone } = found;
        (self.kept.relief, self.kept.relief_undone) = (relief, relief_undone);
        if preparation.done == self.kept.preparation.done {
            return self;
        }
        match self.basis().walk(&self.kept.preparation, &preparation, observer) {
            Ok(basis) => {
                let notice = "Goes on where the last session was left, before its mesh was saved.".into();
                self.kept.preparation = preparation;
                // Edits that came after the steps are in the journal.
                Project { notice, ..self.rebuilt(basis, 0) }
            }
            Err(why) => Project { notice: format!("The last session is not taken up: {why}"), ..self },
        }
    }

    /// Gets the edits ready that can be made again after the steps to the mesh, and makes those that were asked for.
    pub fn go_on(&mut self, ground: Option<&Ground>) {
        let preparation = &mut self.kept.preparation;
        if !preparation.undone.is_empty() || preparation.ahead.is_empty() {
            return;
        }
        let Some(ground) = ground else { return };
        let entries = std::mem::take(&mut preparation.ahead);
        let kept = std::mem::take(&mut self.ahead);
        if kept.iter().rev().map(|s| &s.entry).eq(&entries) {
            self.model.redo = kept;
        } else {
            let edits = entries.iter().map_while(edit_of);
            let made = edits.map_while(|edit| self.make(&edit, ground, &Silent).ok()).count();
            (0..made).for_each(|_| {
                self.model.undo();
            });
        }
        self.revision += 1;
        self.look(ground);
        self.save();
        let count = std::mem::take(&mut self.then);
        if count > 0 {
            // What cannot be made again stays in the list.
            let _ = self.edit(&Edit::Redo(Redo { count }), Some(ground), &Silent);
        }
    }

    /// One that no file holds yet.
    pub fn unsaved(mut self) -> Project {
        self.saver.changed();
        self
    }

    /// The surfaces that came with the file.
    fn with_fit(mut self) -> Project {
        if !self.model.surfaces.is_empty() {
            let model = Model { undo: Vec::new(), redo: Vec::new(), ..self.model.clone() };
            let earlier = Earlier::of(&model);
            let (quality, seams) = (Quality::new(), Vec::new());
            let (warnings, deviations) = (Vec::new(), deviations(&model));
            let (revision, model) = (self.revision, Arc::new(model));
            let (coarse, short, relief) = (false, None, strokes::edits_of(&model.layers));
            self.fit =
                Some(Fit { revision, model, earlier, quality, seams, warnings, deviations, coarse, short, relief });
        }
        self
    }

    /// Makes edits again that were told as done but are not in the file: after a crash.
    pub fn recover(&mut self, ground: Option<&Ground>) {
        let Some(ground) = ground else { return };
        let lost = self.journal.lost(journal_state(&self.model));
        let count = lost.len();
        for edit in lost {
            if self.make(&edit, ground, &Silent).is_err() {
                break;
            }
        }
        if count > 0 {
            let s = if count == 1 { "" } else { "s" };
            self.notice = format!("{count} edit{s} of the last session came back from its journal.");
        }
        self.look(ground);
        self.look_for_holes(&ground.canvas.adjacency);
        self.save();
    }

    /// Makes an edit on the drawing, and keeps it in the history and the journal.
    /// # Errors
    /// [`Refused`]; the project is what it was.
    pub fn edit(&mut self, edit: &Edit, ground: Option<&Ground>, observer: &dyn Observer) -> Result<Made, Refused> {
        let ground = ground.ok_or(Refused::NoMesh)?;
        let before = journal_state(&self.model);
        let made = self.make(edit, ground, observer)?;
        self.journal.add(edit, before, journal_state(&self.model));
        self.save();
        Ok(made)
    }

    /// Takes over a drawing that a job has made of the drawing as it is.
    pub fn take_over(&mut self, edit: &Edit, drawing: Drawing, made: Made, ground: &Ground) {
        let before = journal_state(&self.model);
        self.record(edit, drawing, &made, ground);
        self.journal.add(edit, before, journal_state(&self.model));
        self.save();
    }

    fn make(&mut self, edit: &Edit, ground: &Ground, observer: &dyn Observer) -> Result<Made, Refused> {
        let before = self.model.drawing();
        let steps = |count: usize, step: &mut dyn FnMut() -> bool| (0..count).filter(|_| step()).count();
        let (moved, nothing) = match edit {
            Edit::Undo(Undo { count }) => {
                (steps(*count, &mut || self.model.undo()), "there is nothing left to take back")
            }
            Edit::Redo(Redo { count }) => {
                (steps(*count, &mut || self.model.redo()), "there is nothing left to make again")
            }
            edit => {
                let mut drawing = before;
                let folder = self.file.parent().unwrap_or(Path::new("")).to_owned();
                let others = |name: &str| other(&folder, name);
                let made = apply(&mut drawing, edit, ground, &others, observer).map_err(Refused::Apply)?;
                self.record(edit, drawing, &made, ground);
                return Ok(made);
            }
        };
        if moved == 0 {
            return Err(Refused::Nothing(nothing));
        }
        self.revision += 1;
        self.look(ground);
        Ok(Made::between(&before, &self.model.drawing()))
    }

    fn record(&mut self, edit: &Edit, drawing: Drawing, made: &Made, ground: &Ground) {
        self.fork();
        self.model.record(HistoryEntry { command: edit.name(), parameters: edit.parameters() }, drawing);
        self.revision += 1;
        match &made.faults {
            Some(faults) => self.faults.clone_from(faults),
            None => self.look(ground),
        }
    }

    /// Looks what is left to put right.
    fn look(&mut self, ground: &Ground) {
        self.faults = diagnose(&self.mesh, &ground.canvas.adjacency, &self.model.network).faults;
    }

    /// True if every part of the mesh is a patch.
    pub fn is_finished(&self) -> bool {
        self.faults.is_empty() && !self.model.network.patches.is_empty()
    }

    /// Takes over what a job has fitted. Surfaces of an older drawing are shown, but not kept.
    pub fn fitted(&mut self, fit: Fit) {
        if fit.revision == self.revision && !fit.coarse {
            let Model { grids, surfaces, params, .. } = fit.model.as_ref();
            (self.model.grids, self.model.surfaces) = (grids.clone(), surfaces.clone());
            self.model.params.clone_from(params);
            if self.model.history.last().is_none_or(|h| h.command != "fit") {
                self.model.history.push(HistoryEntry { command: "fit".into(), parameters: params.clone() });
            }
            self.save();
        }
        self.fit = Some(fit);
        self.take_relief();
    }

    /// The whole model, for a job or a file.
    pub fn whole(&self) -> Model {
        Model { mesh: self.mesh.as_ref().clone(), studio: self.kept.json(), ..self.model.clone() }
    }

    fn save(&mut self) {
        self.saver.changed();
    }

    /// Writes the file, as far as it is not, and leaves nothing beside it.
    pub fn close(&mut self) {
        if self.mesh.triangles.is_empty() {
            return;
        }
        if self.saver.is_saved() || self.saver.finish(&self.whole()) {
            self.journal.remove();
            kept::remove(&self.file);
        }
    }

    /// Begins to write the file, if it has changed and nothing is being written.
    pub fn write(&mut self, post: &std::sync::mpsc::Sender<super::Letter>) {
        if !self.mesh.triangles.is_empty() && self.saver.is_due() {
            let model = self.whole();
            self.saver.begin(model, post.clone());
        }
    }

    /// The file was written, or not.
    pub fn saved(&mut self, change: u64, result: Result<(), String>, post: &std::sync::mpsc::Sender<super::Letter>) {
        self.saver.ended(change, result);
        match self.saver.is_saved() {
            true if !self.mesh.triangles.is_empty() => {
                self.journal.clear();
                kept::remove(&self.file);
            }
            // The file that was written is of before the steps; theirs is the newer one.
            _ => self.kept.write(&self.file),
        }
        self.write(post);
    }
}

/// Tells one state of the drawing and its history from another.
fn journal_state(model: &Model) -> u64 {
    super::keep::journal::state_of(&model.drawing(), model.undo.len(), model.redo.len())
}

#[cfg(test)]
mod tests {
    use super::super::keep::preparation::PrepStep;
    use super::*;
    use planish::synthetic::shapes;

    #[test]
    fn a_hole_closed_and_an_edit_after_it_come_back_where_neither_was_saved() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("ball.planish");
        let mut mesh = shapes::sphere(1.0, 3);
        mesh.triangles.retain(|t| t.iter().any(|&v| mesh.points[v as usize].z < 0.8));
        let top = mesh.points.iter().filter(|p| p.z < 0.99).max_by(|a, b| a.z.total_cmp(&b.z)).unwrap().to_array();
        planish_io::write_model(&file, &Model { mesh, ..Model::default() }).unwrap();
        let open = || {
            let model = planish_io::read_model(&file).unwrap();
            Project::of_model(model, file.clone(), String::new()).take_up(&Silent)
        };
        let before = open();
        let counts = [before.mesh.points.len(), before.mesh.triangles.len()];
        let to = before.kept.preparation.with(PrepStep::CloseHole { place: top, before: counts });
        let basis = before.basis().walk(&before.kept.preparation, &to, &Silent).unwrap();
        let mut closed = before.prepared(basis, to, 0);
        let lid = closed.mesh.triangles.len();
        assert!(lid > counts[1]);
        let mesh = closed.mesh.clone();
        let ground = Ground::new(&mesh);
        let corner: Edit = serde_json::from_str(r#"{"edit":"add_corner","at":[0,0,1]}"#).unwrap();
        assert!(closed.edit(&corner, Some(&ground), &Silent).is_ok());
        // The project file was never written: all is beside it.
        drop(closed);
        let mut again = open();
        assert_eq!(again.mesh.triangles.len(), lid);
        let mesh = again.mesh.clone();
        let ground = Ground::new(&mesh);
        again.go_on(Some(&ground));
        again.recover(Some(&ground));
        assert_eq!((again.model.network.corners.len(), again.model.undo.len()), (1, 1));
    }
}
