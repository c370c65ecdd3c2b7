//! A project on the desk: a scan or a mesh with its drawing, what was fitted to it, and its file.

use super::beside::{Branch, Known, Peer, Shown, other};
use super::journal::Journal;
use super::save::Saver;
use crate::protocol::state::Hole;
use planish::DVec3;
use planish::cloud::Cloud;
use planish::edit::{Edit, Ground, Made, Redo, Undo, apply};
use planish::mesh::TriMesh;
use planish::model::{Drawing, HistoryEntry, Model, Units};
use planish::network::{Fault, diagnose};
use planish::observe::{Observer, Silent};
use planish::pipeline::{Earlier, PipelineParams, Quality, Warning};
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
    /// What geometry is sent relative to, where it is not the middle of the box.
    pub middle: Option<DVec3>,
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
        Project {
            mesh,
            scan: None,
            known: None,
            left_out: Vec::new(),
            middle: None,
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
    pub fn of_scan(mut cloud: Cloud, units: Units, file: PathBuf) -> Project {
        let model = Model { units, shift: cloud.shift, ..Model::default() };
        cloud.points.retain(|p| p.is_finite());
        Project { scan: Some(Arc::new(cloud)), ..Project::of_model(model, file, String::new()) }
    }

    /// The project of a scan with the mesh that was made of it.
    pub fn meshed(self, mesh: TriMesh, params: PipelineParams) -> Project {
        Project { mesh: Arc::new(mesh), params, middle: None, ..self }.unsaved()
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
            let (coarse, short) = (false, None);
            self.fit = Some(Fit { revision, model, earlier, quality, seams, warnings, deviations, coarse, short });
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
            let Model { grids, surfaces, reliefs, params, .. } = fit.model.as_ref();
            (self.model.grids, self.model.surfaces, self.model.reliefs) =
                (grids.clone(), surfaces.clone(), reliefs.clone());
            self.model.params.clone_from(params);
            if self.model.history.last().is_none_or(|h| h.command != "fit") {
                self.model.history.push(HistoryEntry { command: "fit".into(), parameters: params.clone() });
            }
            self.save();
        }
        self.fit = Some(fit);
    }

    /// The whole model, for a job or a file.
    pub fn whole(&self) -> Model {
        Model { mesh: self.mesh.as_ref().clone(), ..self.model.clone() }
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
        if self.saver.is_saved() {
            self.journal.clear();
        }
        self.write(post);
    }
}

/// Tells one state of the drawing and its history from another.
fn journal_state(model: &Model) -> u64 {
    super::journal::state_of(&model.drawing(), model.undo.len(), model.redo.len())
}
