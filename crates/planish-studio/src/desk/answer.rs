//! Answers to requests, and what becomes of jobs that end.

use super::beside::{Peer, other};
use super::content::{self, Content};
use super::jobs::Outcome;
use super::keep::lasso::Lasso;
use super::project::{NO_PROJECT, Project};
use super::{Table, export};
use crate::protocol::{Message, Request, Why};
use crate::web::hub::Client;
use planish::field::Spacing;
use planish::pipeline;
use planish::surface::Resolution;
use std::path::Path;
use std::sync::Arc;

impl<'env> Table<'_, '_, 'env> {
    /// Answers a request; tells if something else comes onto the desk.
    pub(super) fn answer(&mut self, client: &Client, request: Request) -> Option<Content> {
        let id = request.id();
        match request {
            Request::Edit { edit, .. } => {
                if !self.walk(client, id, &edit) {
                    self.edit(client, id, edit);
                }
            }
            Request::Try { edit, .. } => self.try_out(client, id, edit),
            Request::Fit { coarse, .. } => {
                self.desk.coarse = coarse;
                match self.fit() {
                    Ok(job) => self.wait_for(client, id, job),
                    Err(why) => self.refuse(client, id, why),
                }
            }
            Request::TryPatch { patch, control, tolerance, .. } => {
                self.try_patch(client, id, patch, control, tolerance);
            }
            Request::Handles { curve, control, .. } => self.handles(client, id, &curve, control),
            Request::Map { patch, .. } => self.map(client, id, patch),
            Request::Relief { longest, .. } => self.relief(client, id, longest),
            Request::Sculpt { edit, .. } => self.sculpt(client, id, edit),
            Request::Unsculpt { count, .. } => self.unsculpt(client, id, count),
            Request::Resculpt { count, .. } => self.resculpt(client, id, count),
            Request::Clean { .. } => self.clean(client, id),
            Request::Lasso { view, line, outside, .. } => {
                self.lasso(client, id, Lasso { middle: [0.0; 3], view, line, outside });
            }
            Request::CloseHole { hole, .. } => self.close_hole(client, id, hole),
            Request::Peer { file, .. } => self.peer(client, id, file),
            Request::Branch { branch, .. } => self.branch(client, id, branch),
            Request::Setting { resolution, live, .. } => self.set(client, id, resolution, live),
            Request::Mesh { close, resolution, voxel, .. } => match cells(resolution, voxel) {
                Ok(cells) => self.mesh(client, id, close, cells),
                Err(why) => self.refuse(client, id, Why::of(why)),
            },
            Request::Cancel { job, .. } => match self.desk.jobs.stop(job) {
                true => self.done(client, id, String::new()),
                false => self.refuse(client, id, Why::of("this job has ended already")),
            },
            Request::Get { layer, .. } => self.geometry(client, id, layer),
            Request::Export { format, .. } => self.export(client, id, format),
            Request::Script { relief, .. } => match self.project.as_ref().map(|p| export::script(p, relief)) {
                Some(Ok(text)) => self.desk.hub.tell(client, &Message::Script { id, text }),
                Some(Err(why)) => self.refuse(client, id, Why::of(why)),
                None => self.refuse(client, id, Why::of(NO_PROJECT)),
            },
            Request::Sample { sample, .. } => {
                let job = self.desk.sample(sample);
                self.wait_for(client, id, job);
            }
            Request::Open { file, .. } => self.open_project(client, id, &file),
            Request::Close { .. } => {
                self.done(client, id, String::new());
                return Some(Content::Nothing);
            }
        }
        None
    }

    pub(super) fn done(&self, client: &Client, id: u32, told: String) {
        self.desk.hub.tell(client, &Message::Done { id, job: None, told });
    }

    /// The request is done once the job is.
    pub(super) fn wait_for(&mut self, client: &Client, id: u32, job: u32) {
        self.desk.jobs.asked_by(job, client, id);
        self.tell_state();
    }

    fn open_project(&mut self, client: &Client, id: u32, file: &str) {
        let is_bare = Path::new(file).file_name() == Some(file.as_ref());
        let path = self.desk.folder.join(file);
        if !is_bare || !content::is_project(&path) || !path.is_file() {
            return self.refuse(client, id, Why::of(format!("{file} is no project of this folder")));
        }
        let job = self.desk.read(path);
        self.wait_for(client, id, job);
    }

    fn set(&mut self, client: &Client, id: u32, resolution: Resolution, live: bool) {
        if let Err(why) = suits(&resolution, self.project.as_ref()) {
            return self.refuse(client, id, Why::of(why));
        }
        let changed = self.desk.resolution != resolution;
        self.desk.resolution = resolution;
        self.desk.live = live;
        let finished = self.project.as_ref().is_some_and(Project::is_finished);
        let is_stale = self.project.as_ref().is_some_and(|p| p.fit.as_ref().is_none_or(|f| f.revision != p.revision));
        if finished && (changed || (live && is_stale)) {
            match self.fit() {
                Ok(job) => return self.wait_for(client, id, job),
                Err(why) => self.refuse(client, id, why),
            }
        } else {
            self.done(client, id, String::new());
        }
        self.tell_state();
    }

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

    /// Takes over what a job has made, and answers who asked for it.
    pub(super) fn ended(&mut self, job: u32, outcome: Outcome) -> Option<Content> {
        let (asked, stopped) = self.desk.jobs.end(job);
        if stopped {
            if let Some((client, id)) = &asked {
                self.refuse(client, *id, Why::of("it was stopped"));
            }
            if matches!(outcome, Outcome::Sculpted(..)) {
                self.unsculpted();
            }
            self.tell_state();
            return None;
        }
        let (answer, next) = self.take_over(outcome, &asked);
        match (answer, &asked) {
            (Answer::Done(told), Some((client, id))) => self.done(client, *id, told),
            (Answer::Refused(why), Some((client, id))) => self.refuse(client, *id, why),
            (Answer::Refused(why), None) => self.desk.hub.tell_all(&Message::Refused { id: 0, why }),
            (Answer::Done(_), None) | (Answer::Given, _) => {}
        }
        // What comes onto the desk tells its own.
        if next.is_none() {
            self.tell_state();
        }
        next
    }

    fn take_over(&mut self, outcome: Outcome, asked: &Option<(Client, u32)>) -> (Answer, Option<Content>) {
        let done = || Answer::Done(String::new());
        match outcome {
            Outcome::Opened(Ok(project)) => (Answer::Done(project.notice.clone()), Some(Content::Project(project))),
            Outcome::Prepared(result) => self.prepared(result),
            Outcome::Cleaned(Ok(known)) => {
                self.desk.layers.new_points();
                if let Some(project) = &mut *self.project {
                    project.known = Some(known);
                }
                (done(), None)
            }
            Outcome::Parted(Ok((revision, shown))) => {
                self.parted(revision, shown);
                (done(), None)
            }
            Outcome::Sculpted(revision, made) => {
                (self.sculpted(revision, *made).map_or_else(Answer::Refused, |()| done()), None)
            }
            Outcome::Looked(Ok(peer)) => {
                self.desk.layers.new_peer();
                if let Some(project) = &mut *self.project {
                    project.peer = Some(peer);
                }
                (done(), None)
            }
            Outcome::Cleaned(Err(why)) | Outcome::Parted(Err(why)) | Outcome::Looked(Err(why)) => {
                (Answer::Refused(Why::of(why)), None)
            }
            Outcome::Edited(revision, edit, result) => (self.edited(revision, edit, *result, asked), None),
            Outcome::Fitted(result) => (self.fitted(result).map_or_else(Answer::Refused, |()| done()), None),
            Outcome::Measured(result) => (self.measured(result).map_or_else(Answer::Refused, |()| done()), None),
            Outcome::Exported(Ok(ready)) => {
                let Some((client, id)) = asked else { return (Answer::Given, None) };
                let (url, name, bytes) = self.desk.exports.keep(ready);
                self.desk.hub.tell(client, &Message::Exported { id: *id, url, name, bytes });
                (Answer::Given, None)
            }
            Outcome::Opened(Err(why)) | Outcome::Exported(Err(why)) => (Answer::Refused(Why::of(why)), None),
            Outcome::Fault(text) => {
                let why = format!("an internal fault: {text} - hint: please report it");
                (Answer::Refused(Why::of(why)), None)
            }
        }
    }
}

/// What the one who asked for a job is told at its end.
pub(super) enum Answer {
    /// It is done, in words.
    Done(String),
    /// It failed.
    Refused(Why),
    /// Told already, or later.
    Given,
}

/// Cells of a mesh to be made: by their number along the longest side, or by their edge.
fn cells(resolution: Option<usize>, voxel: Option<f64>) -> Result<Option<Spacing>, &'static str> {
    match (resolution, voxel) {
        (_, Some(edge)) if !(edge > 0.0 && edge.is_finite()) => Err("the edge of a cell is a length above 0"),
        (_, Some(edge)) => Ok(Some(Spacing::Voxel(edge))),
        (resolution, None) => Ok(resolution.map(Spacing::Resolution)),
    }
}

/// Fewest and most control points along a curve.
const CONTROL: std::ops::RangeInclusive<usize> = 4..=512;

/// Looks whether a choice can be met.
fn suits(resolution: &Resolution, project: Option<&Project>) -> Result<(), String> {
    let curves = project.map_or(0, |p| p.model.network.curves.len());
    let range = || format!("control points along a curve are between {} and {}", CONTROL.start(), CONTROL.end());
    match resolution {
        Resolution::Tolerance(t) if !(*t > 0.0 && *t < 1.0) => {
            Err("a tolerance is a share of the diagonal, above 0 and below 1".into())
        }
        Resolution::Control(both) if !both.iter().all(|c| CONTROL.contains(c)) => Err(range()),
        Resolution::PerCurve(list) if !list.iter().all(|c| CONTROL.contains(c)) => Err(range()),
        Resolution::PerCurve(list) if list.len() != curves => {
            Err(format!("{} numbers were given for {curves} curves", list.len()))
        }
        _ => Ok(()),
    }
}

/// Parameters of a fit with a choice in place.
pub(super) fn with(params: &pipeline::PipelineParams, resolution: &Resolution) -> pipeline::PipelineParams {
    let mut params = params.clone();
    params.fit.resolution = resolution.clone();
    params
}
