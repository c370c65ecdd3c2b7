//! Jobs: what takes long, each on a thread of its own with a copy of what it works on. They tell how far they are, and stop
//! when they are told.

use super::beside::{Known, Peer, Shown};
use super::keep::preparation::{Basis, Preparation};
use super::keep::strokes::Sculpted;
use super::project::Fit;
use super::{Letter, Project};
use crate::StudioError;
use crate::protocol::state::{Job, StageName};
use planish::edit::{ApplyError, Edit, Made};
use planish::model::Drawing;
use planish::observe::Observer;
use planish::pipeline::{Assessed, PipelineObserver, StageRecord};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};
use std::thread::Scope;
use std::time::{Duration, Instant};

/// Kind of the jobs that measure what was fitted.
pub const MEASURE: &str = "measure";

/// Pages hear of the progress of a job this often.
const TELL_EVERY: Duration = Duration::from_millis(100);

/// What came of a job.
pub enum Outcome {
    /// A file was read, or a part made.
    Opened(Result<Box<Project>, String>),
    /// Steps to a mesh were made or taken back; or why not, and at which stage.
    Prepared(Result<Box<Prepared>, (StageName, String)>),
    /// Points of a scan were looked at.
    Cleaned(Result<Arc<Known>, String>),
    /// Reliefs of a revision were parted.
    Parted(Result<(u64, Shown), String>),
    /// The relief of a revision was edited.
    Sculpted(u64, Box<Sculpted>),
    /// Another project was read.
    Looked(Result<Peer, String>),
    /// An edit was made on the drawing of a revision.
    Edited(u64, Edit, Box<Result<(Drawing, Made), ApplyError>>),
    /// Surfaces were fitted.
    Fitted(Result<Box<Fit>, String>),
    /// What was fitted last was measured.
    Measured(Result<Box<Assessed>, String>),
    /// A file was made: the request, and where it is fetched.
    Exported(Result<super::exports::Ready, String>),
    /// It came to an end that nobody foresaw.
    Fault(String),
}

/// What steps to a mesh have made.
pub struct Prepared {
    /// What came of them.
    pub basis: Basis,
    /// The steps before.
    pub from: Preparation,
    /// The steps now.
    pub to: Preparation,
    /// Edits that are to be made again after them.
    pub then: usize,
    /// In words.
    pub told: String,
}

/// A running job.
struct Running {
    kind: &'static str,
    job: Job,
    /// Who asked for it: page and number of the request.
    asked: Option<(crate::web::hub::Client, u32)>,
    stop: Arc<AtomicBool>,
}

/// All running jobs.
pub struct Jobs {
    post: Sender<Letter>,
    pool: Arc<rayon::ThreadPool>,
    /// For what nobody waits for: the next fit need not wait until it has stopped.
    aside: Arc<rayon::ThreadPool>,
    running: Arc<Mutex<Vec<Running>>>,
    last: u32,
}

impl Jobs {
    /// No jobs. One core stays for edits.
    pub fn new(post: Sender<Letter>) -> Result<Jobs, StudioError> {
        let threads = rayon::current_num_threads().saturating_sub(1).max(1);
        let pool = || {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.map(Arc::new).map_err(|e| StudioError::System(e.to_string()))
        };
        Ok(Jobs { post, pool: pool()?, aside: pool()?, running: Arc::default(), last: 0 })
    }

    /// Starts a job that borrows what lies on the desk.
    pub fn start<'scope, 'env>(
        &mut self,
        scope: &'scope Scope<'scope, 'env>,
        (kind, title): (&'static str, &str),
        work: impl FnOnce(&Watch) -> Outcome + Send + 'scope,
    ) -> u32 {
        let (number, whole) = self.prepare(kind, title, work);
        scope.spawn(whole);
        number
    }

    /// Starts a job that needs nothing of the desk.
    pub fn start_free(
        &mut self,
        kind: &'static str,
        title: &str,
        work: impl FnOnce(&Watch) -> Outcome + Send + 'static,
    ) -> u32 {
        let (number, whole) = self.prepare(kind, title, work);
        std::thread::spawn(whole);
        number
    }

    fn prepare<'w>(
        &mut self,
        kind: &'static str,
        title: &str,
        work: impl FnOnce(&Watch) -> Outcome + Send + 'w,
    ) -> (u32, impl FnOnce() + Send + 'w) {
        self.last += 1;
        let number = self.last;
        let stop = Arc::new(AtomicBool::new(false));
        let job = Job { job: number, title: title.into(), stage: String::new(), fraction: 0.0, can_stop: true };
        let watch = Watch {
            number,
            stop: stop.clone(),
            running: self.running.clone(),
            post: Mutex::new(self.post.clone()),
            told: Mutex::new(Instant::now()),
        };
        self.lock().push(Running { kind, job, asked: None, stop });
        let pool = if kind == MEASURE { &self.aside } else { &self.pool };
        let (post, pool) = (self.post.clone(), pool.clone());
        let whole = move || {
            let made = catch_unwind(AssertUnwindSafe(|| pool.install(|| work(&watch))));
            let outcome = made.unwrap_or_else(|panic| {
                let text = panic.downcast_ref::<String>().cloned();
                Outcome::Fault(text.or(panic.downcast_ref::<&str>().map(|s| s.to_string())).unwrap_or_default())
            });
            let _ = post.send(Letter::Ended(number, outcome));
        };
        (number, whole)
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Running>> {
        self.running.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// Who is answered when a job ends.
    pub fn asked_by(&mut self, number: u32, client: &crate::web::hub::Client, id: u32) {
        if let Some(running) = self.lock().iter_mut().find(|r| r.job.job == number) {
            running.asked = Some((client.clone(), id));
        }
    }

    /// Takes a job that has ended from the list: who asked for it, and whether it was told to stop.
    pub fn end(&mut self, number: u32) -> (Option<(crate::web::hub::Client, u32)>, bool) {
        let mut running = self.lock();
        let Some(at) = running.iter().position(|r| r.job.job == number) else { return (None, true) };
        let ended = running.remove(at);
        (ended.asked, ended.stop.load(Ordering::Relaxed))
    }

    /// Tells a job to stop. False if there is none of this number.
    pub fn stop(&self, number: u32) -> bool {
        let running = self.lock();
        let found = running.iter().find(|r| r.job.job == number);
        found.inspect(|r| r.stop.store(true, Ordering::Relaxed)).is_some()
    }

    /// Tells all jobs of a kind to stop.
    pub fn stop_kind(&self, kind: &str) {
        self.lock().iter().filter(|r| r.kind == kind).for_each(|r| r.stop.store(true, Ordering::Relaxed));
    }

    /// Tells all jobs to stop; what they still make is of nothing on the desk.
    pub fn stop_all(&self) {
        let mut running = self.lock();
        running.iter().for_each(|r| r.stop.store(true, Ordering::Relaxed));
        running.clear();
    }

    /// True if a job of this kind runs and was not told to stop.
    pub fn has(&self, kind: &str) -> bool {
        self.lock().iter().any(|r| r.kind == kind && !r.stop.load(Ordering::Relaxed))
    }

    /// All of them.
    pub fn list(&self) -> Vec<Job> {
        self.lock().iter().map(|r| r.job.clone()).collect()
    }
}

/// Watches one job.
pub struct Watch {
    number: u32,
    stop: Arc<AtomicBool>,
    running: Arc<Mutex<Vec<Running>>>,
    post: Mutex<Sender<Letter>>,
    told: Mutex<Instant>,
}

impl Watch {
    fn tell(&self, change: impl FnOnce(&mut Job)) {
        let mut running = self.running.lock().unwrap_or_else(|e| e.into_inner());
        if let Some(running) = running.iter_mut().find(|r| r.job.job == self.number) {
            change(&mut running.job);
        }
        drop(running);
        let mut told = self.told.lock().unwrap_or_else(|e| e.into_inner());
        if told.elapsed() >= TELL_EVERY {
            *told = Instant::now();
            let _ = self.post.lock().unwrap_or_else(|e| e.into_inner()).send(Letter::Progress);
        }
    }
}

impl Observer for Watch {
    fn progress(&self, fraction: f64) {
        self.tell(|job| job.fraction = fraction);
    }

    fn cancelled(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

impl PipelineObserver for Watch {
    fn begins(&self, name: &'static str, of_run: f64) {
        self.tell(|job| {
            job.stage = name.into();
            job.fraction = of_run;
        });
    }

    fn progress(&self, _of_stage: f64, of_run: f64) {
        self.tell(|job| job.fraction = of_run);
    }

    fn ends(&self, _record: &StageRecord) {}

    fn cancelled(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}
