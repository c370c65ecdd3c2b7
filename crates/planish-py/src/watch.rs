//! Long calls: without the interpreter's lock, with progress, and stopped by Ctrl-C.
//!
//! The stage runs on a thread of its own. The thread that called waits without the lock and wakes every [`TICK`] to look
//! for signals and to tell the progress: so Python code runs on the calling thread alone, and all exceptions come up there.

use crate::error::{Told, class, told};
use planish::observe::{Cancelled, Observer};
use planish::pipeline::{PipelineObserver, StageRecord};
use pyo3::prelude::*;
use rayon::ThreadPool;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// Time between two looks for signals: a tenth of what Ctrl-C may take.
const TICK: Duration = Duration::from_millis(20);
/// Looks between two reports of progress.
const LOOKS_PER_REPORT: u32 = 5;

/// The threads that stages run on, if a number was asked for.
static POOL: Mutex<Option<Arc<ThreadPool>>> = Mutex::new(None);

/// Sets the number of threads that stages use from now on; None for one per core (or what RAYON_NUM_THREADS says).
///
/// Results do not depend on it: the same input and options give the same bytes.
#[pyfunction]
#[pyo3(signature = (threads, /))]
pub fn set_threads(threads: Option<usize>) -> PyResult<()> {
    let fault = |e: rayon::ThreadPoolBuildError| class::InternalError::new_err(e.to_string());
    let made = match threads {
        Some(0) => return Err(pyo3::exceptions::PyValueError::new_err("threads=0: at least 1 is needed")),
        Some(n) => Some(Arc::new(rayon::ThreadPoolBuilder::new().num_threads(n).build().map_err(fault)?)),
        None => None,
    };
    *POOL.lock().unwrap_or_else(PoisonError::into_inner) = made;
    Ok(())
}

/// What a running stage tells and is told.
struct Watch {
    now: Mutex<(&'static str, f64)>,
    cancelled: AtomicBool,
}

impl Watch {
    fn set(&self, stage: Option<&'static str>, fraction: f64) {
        let mut now = self.now.lock().unwrap_or_else(PoisonError::into_inner);
        // Threads report in any order: progress does not run back.
        *now = (stage.unwrap_or(now.0), now.1.max(fraction.min(1.0)));
    }
}

impl Observer for Watch {
    fn progress(&self, fraction: f64) {
        self.set(None, fraction);
    }

    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

impl PipelineObserver for Watch {
    fn begins(&self, name: &'static str, of_run: f64) {
        self.set(Some(name), of_run);
    }

    fn progress(&self, _of_stage: f64, of_run: f64) {
        self.set(None, of_run);
    }

    fn ends(&self, _record: &StageRecord) {}

    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

/// What a run of several stages looks at, and a single stage.
pub trait Both: Observer + PipelineObserver {
    /// As the observer of one stage.
    fn one(&self) -> &dyn Observer;
    /// As that of a run.
    fn run(&self) -> &dyn PipelineObserver;
}

impl Both for Watch {
    fn one(&self) -> &dyn Observer {
        self
    }

    fn run(&self) -> &dyn PipelineObserver {
        self
    }
}

/// Runs a stage.
/// * `name` - of the stage, for `progress`
/// * `progress` - None, True for a bar, or called with the name of the stage and the share (0 to 1) that is done
///
/// # Errors
/// The exception of the stage's error; what a signal or `progress` raised.
pub fn run<T: Send, E: Told>(
    py: Python,
    name: &'static str,
    progress: Option<&Bound<PyAny>>,
    work: impl FnOnce(&dyn Both) -> Result<T, E> + Send,
) -> PyResult<T> {
    let tell = Tell::new(py, progress)?;
    let watch = Watch { now: Mutex::new((name, 0.0)), cancelled: AtomicBool::new(false) };
    let (outcome, raised) = watched(py, &watch, &tell, work);
    let closed = tell.close(&watch, raised.is_none() && matches!(outcome, Ok(Ok(_))));
    if let Some(raised) = raised {
        return Err(raised);
    }
    match outcome {
        Ok(Ok(made)) => closed.map(|()| made),
        Ok(Err(error)) if Cancelled::is_cause_of(&error) => Err(told(py, &Cancelled)),
        Ok(Err(error)) => Err(told(py, &error)),
        Err(panic) => Err(fault(py, panic.as_ref())),
    }
}

/// As [`run`], for work that cannot fail.
/// # Errors
/// What a signal raised.
pub fn sure<T: Send>(py: Python, name: &'static str, work: impl FnOnce(&dyn Both) -> T + Send) -> PyResult<T> {
    run(py, name, None, |o| Ok::<T, Cancelled>(work(o)))
}

type Outcome<T, E> = thread::Result<Result<T, E>>;

/// Runs the work on another thread and waits; with what was raised meanwhile.
fn watched<T: Send, E: Told>(
    py: Python,
    watch: &Watch,
    tell: &Tell,
    work: impl FnOnce(&dyn Both) -> Result<T, E> + Send,
) -> (Outcome<T, E>, Option<PyErr>) {
    let pool = POOL.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let (done, wait) = channel();
    let wait = Mutex::new(wait);
    let sleep = |limit: Option<Duration>| {
        let wait = wait.lock().unwrap_or_else(PoisonError::into_inner);
        match limit {
            Some(limit) => wait.recv_timeout(limit) == Err(RecvTimeoutError::Timeout),
            None => wait.recv().is_err(),
        }
    };
    thread::scope(|scope| {
        let worker = scope.spawn(move || {
            let work = || catch_unwind(AssertUnwindSafe(|| work(watch)));
            let outcome = match &pool {
                Some(pool) => pool.install(work),
                None => work(),
            };
            // The caller waits for this and for nothing else.
            let _ = done.send(());
            outcome
        });
        let (mut raised, mut looks) = (None, 0);
        while py.detach(|| sleep(Some(TICK))) {
            looks += 1;
            let report = || if looks % LOOKS_PER_REPORT == 0 { tell.say(watch) } else { Ok(()) };
            if let Err(error) = py.check_signals().and_then(|()| report()) {
                raised = Some(error);
                watch.cancelled.store(true, Ordering::Relaxed);
                py.detach(|| sleep(None));
                break;
            }
        }
        (py.detach(|| worker.join()).unwrap_or_else(Err), raised)
    })
}

/// Where progress goes.
enum Tell<'py> {
    Nowhere,
    To(Bound<'py, PyAny>),
    Bar(Bound<'py, PyAny>),
}

impl<'py> Tell<'py> {
    fn new(py: Python<'py>, progress: Option<&Bound<'py, PyAny>>) -> PyResult<Tell<'py>> {
        let Some(progress) = progress.filter(|p| !p.is_none()) else { return Ok(Tell::Nowhere) };
        if let Ok(wanted) = progress.extract::<bool>() {
            let bar = || py.import("planish._progress")?.call_method0("Bar");
            return Ok(if wanted { Tell::Bar(bar()?) } else { Tell::Nowhere });
        }
        if !progress.is_callable() {
            let what = "progress: None, True or a function of the stage's name and the share done is needed";
            return Err(pyo3::exceptions::PyTypeError::new_err(what));
        }
        Ok(Tell::To(progress.clone()))
    }

    fn say(&self, watch: &Watch) -> PyResult<()> {
        let now = *watch.now.lock().unwrap_or_else(PoisonError::into_inner);
        match self {
            Tell::Nowhere => Ok(()),
            Tell::To(to) | Tell::Bar(to) => to.call1(now).map(drop),
        }
    }

    /// Tells the end, where there was one.
    fn close(&self, watch: &Watch, done: bool) -> PyResult<()> {
        if done {
            watch.set(None, 1.0);
            self.say(watch)?;
        }
        match self {
            Tell::Bar(bar) => bar.call_method0("close").map(drop),
            _ => Ok(()),
        }
    }
}

/// The exception of a panic.
fn fault(py: Python, panic: &(dyn Any + Send)) -> PyErr {
    let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    let hint = "this is a defect of planish; please report it with what you called and, if you may, the input";
    let message = format!("internal fault: {} - hint: {hint}", text.unwrap_or("no message"));
    crate::error::hinted(py, class::InternalError::new_err(message.clone()), &message)
}
