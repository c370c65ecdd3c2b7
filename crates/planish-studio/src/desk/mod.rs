//! The desk: one thread that owns the project. Requests of all pages come to it one after the other; what takes long runs as
//! a job beside it, on a copy, and its result is taken over if it still fits.
//!
//! 1. what lies on it - `content`, `project`, `beside`
//! 2. answers - `answer`, `edits`, `scan`, `patch`, `sculpt`, `branches`, `export`
//! 3. jobs - `jobs`
//! 4. nothing is lost - `keep`      5. what pages see - `state`, `layers`, `tessellate`

mod answer;
mod beside;
mod branches;
mod content;
mod edits;
mod export;
mod exports;
mod jobs;
mod keep;
mod layers;
mod patch;
mod project;
mod scan;
mod sculpt;
mod state;
mod tessellate;

pub use exports::Exports;

use crate::StudioError;
use crate::protocol::{Layer, Message, Request, Why};
use crate::web::hub::{Client, Hub};
use content::Content;
use jobs::{Jobs, Outcome};
use layers::Layers;
use planish::edit::Ground;
use planish::model::Units;
use planish::surface::Resolution;
use project::Project;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender};

/// What comes to the desk.
pub enum Letter {
    /// A page has connected.
    Hello(Client),
    /// A page asks for something.
    Ask(Client, Request),
    /// A file was dropped on a page.
    Dropped(Upload),
    /// A job is done.
    Ended(u32, Outcome),
    /// Jobs have got on.
    Progress,
    /// Geometry is ready.
    Built(Layer, String, Vec<axum::body::Bytes>),
    /// The file was written, up to a change of this number, or not.
    Saved(u64, Result<(), String>),
    /// The program ends.
    Stop,
}

/// A file that a page has sent.
pub struct Upload {
    /// Where its bytes are.
    pub file: tempfile::TempPath,
    /// The name that the user had for it.
    pub name: String,
}

/// Where everything happens.
pub struct Desk {
    pub(super) hub: Hub,
    inbox: Receiver<Letter>,
    pub(super) post: Sender<Letter>,
    /// Projects are in it.
    folder: PathBuf,
    /// Unit of what does not tell its own.
    units: Option<Units>,
    exports: Arc<Exports>,
    jobs: Jobs,
    layers: Layers,
    /// Choices that all pages share.
    resolution: Resolution,
    live: bool,
    /// True while fits pause at coarse grids.
    coarse: bool,
    /// What the last failed job was refused for, by the stage.
    failed: Option<(crate::protocol::state::StageName, String)>,
}

impl Desk {
    /// A desk with nothing on it.
    pub fn new(
        hub: Hub,
        (post, inbox): (Sender<Letter>, Receiver<Letter>),
        place: (PathBuf, Option<Units>),
        exports: Arc<Exports>,
    ) -> Result<Desk, StudioError> {
        let (folder, units) = place;
        let jobs = Jobs::new(post.clone())?;
        let (resolution, live) = (usual_resolution(), true);
        let layers = Layers::default();
        let coarse = false;
        Ok(Desk { hub, inbox, post, folder, units, exports, jobs, layers, resolution, live, coarse, failed: None })
    }

    /// Works until the program ends.
    /// * `first` - the file to begin with
    pub fn run(mut self, first: Option<PathBuf>) {
        let mut content = Content::Nothing;
        if let Some(path) = first {
            self.read(path);
        }
        loop {
            self.layers.new_content();
            self.failed = None;
            self.coarse = false;
            content = match content {
                Content::End => return,
                Content::Nothing => self.sit(&mut None, None),
                Content::Project(mut project) => {
                    let mesh = Arc::clone(&project.mesh);
                    let ground = (!mesh.triangles.is_empty()).then(|| Ground::new(&mesh));
                    project.go_on(ground.as_ref());
                    project.recover(ground.as_ref());
                    let mut project = Some(*project);
                    let next = self.sit(&mut project, ground.as_ref());
                    if let Some(project) = &mut project {
                        project.close();
                    }
                    next
                }
            };
        }
    }

    /// Works on one project, or waits for one. Returns what comes next.
    fn sit(&mut self, project: &mut Option<Project>, ground: Option<&Ground>) -> Content {
        // Jobs borrow the ground: all have ended when this returns.
        std::thread::scope(|scope| {
            let mut table = Table { desk: self, project, ground, scope };
            if table.follow_list().is_none() {
                table.measure();
            }
            table.tell_state();
            let next = loop {
                let Ok(letter) = table.desk.inbox.recv() else { break Content::End };
                if let Some(next) = table.open(letter) {
                    break next;
                }
            };
            table.desk.jobs.stop_all();
            next
        })
    }
}

/// A tolerance of a thousandth of the diagonal, as everywhere.
fn usual_resolution() -> Resolution {
    planish::surface::FitParams::default().resolution
}

/// The desk with what lies on it.
struct Table<'t, 'scope, 'env> {
    desk: &'t mut Desk,
    project: &'t mut Option<Project>,
    ground: Option<&'env Ground<'env>>,
    scope: &'scope std::thread::Scope<'scope, 'env>,
}

impl Table<'_, '_, '_> {
    /// Deals with one letter; tells if something else comes onto the desk.
    fn open(&mut self, letter: Letter) -> Option<Content> {
        match letter {
            Letter::Hello(client) => {
                let state = self.state();
                self.desk.hub.tell(&client, &Message::State(Box::new(state)));
                None
            }
            Letter::Ask(client, request) => self.answer(&client, request),
            Letter::Dropped(upload) => {
                self.desk.take_in(upload);
                self.tell_state();
                None
            }
            Letter::Ended(job, outcome) => self.ended(job, outcome),
            Letter::Progress => {
                let jobs = self.desk.jobs.list();
                self.desk.hub.tell_all(&Message::Progress { jobs });
                None
            }
            Letter::Built(layer, name, frames) => {
                self.desk.layers.built(&self.desk.hub, layer, &name, frames);
                None
            }
            Letter::Saved(change, result) => {
                if let Some(project) = self.project {
                    project.saved(change, result, &self.desk.post);
                    self.tell_state();
                }
                None
            }
            Letter::Stop => Some(Content::End),
        }
    }

    /// Tells all pages how everything stands.
    fn tell_state(&mut self) {
        if let Some(project) = self.project {
            project.write(&self.desk.post);
        }
        let state = self.state();
        self.desk.hub.tell_all(&Message::State(Box::new(state)));
    }

    fn refuse(&self, client: &Client, id: u32, why: Why) {
        self.desk.hub.tell(client, &Message::Refused { id, why });
    }
}
