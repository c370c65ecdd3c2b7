//! `planish run` for many inputs: a folder for each, a table and a report for all.
//!
//! Each run is this program in a process of its own, so that its products are those of a single run and one that fails or is
//! killed takes nothing else along. What is finished stands in the manifest, and is left out the next time. The Python
//! package calls this command, too (`planish.run_many`).

mod expand;
mod manifest;
mod page;

pub use expand::{expanded, folder_names};

use self::manifest::{Manifest, key};
use super::{Session, write_text};
use crate::args::Run;
use crate::failure::{Failure, Status};
use crate::outputs;
use crate::products::{self, Staged};
use crate::{progress, stdout};
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::ffi::OsString;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// How often a run that goes on is looked at.
const GLANCE: Duration = Duration::from_millis(50);
/// How much of what a run tells is kept: its last line counts.
const TOLD: u64 = 1 << 16;

/// One input of a batch.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Its place among the inputs.
    pub index: usize,
    /// The input as it was given, or as a pattern found it.
    pub source: PathBuf,
    /// Where its products are.
    pub folder: PathBuf,
    /// What became of it.
    pub status: Outcome,
    /// Exit status of its run.
    pub exit: i32,
    /// Wall-clock time of the run that made the products, seconds.
    pub seconds: f64,
    /// The message of a run that failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// Figures of quality by key, as in its report.json.
    pub quality: Map<String, Value>,
}

/// What became of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// All products are there.
    Done,
    /// They are there, and miss a tolerance that was demanded.
    Missed,
    /// An earlier run has made them.
    Skipped,
    /// There are none.
    Failed,
}

impl Outcome {
    /// The word for it.
    pub fn word(self) -> &'static str {
        match self {
            Outcome::Done => "done",
            Outcome::Missed => "missed",
            Outcome::Skipped => "skipped",
            Outcome::Failed => "failed",
        }
    }
}

/// Runs them.
/// * `program` - how this program is started anew
/// # Errors
/// If there is no input, or the folder cannot be written to; a run that fails is a row of the table.
pub fn run(session: &Session, args: &Run, program: &[OsString]) -> Result<Status, Failure> {
    let sources = expanded(&args.inputs)?;
    std::fs::create_dir_all(&args.output).map_err(|e| products::unwritable(&args.output, &e))?;
    let own_report = session.stage_report()?;
    let manifest = Manifest::open(&args.output.join(outputs::BATCH_PRODUCTS[0]));
    let names = match (&args.folder, &sources[..]) {
        (Some(name), [_]) => vec![name.clone()],
        (Some(name), _) => return Err(Failure::usage(name, "is a folder for one input")),
        (None, _) => folder_names(&sources),
    };
    let jobs = args.jobs.map_or(1, |n| n.get()).min(sources.len());
    let batch = Batch { args, program, options: options(args, jobs), manifest };
    let next = AtomicUsize::new(0);
    let rows: Mutex<Vec<Row>> = Mutex::new(Vec::new());
    let work = || {
        while !progress::interrupted() {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let (Some(source), Some(name)) = (sources.get(index), names.get(index)) else { return };
            let row = batch.row(index, source, &args.output.join(name));
            if progress::interrupted() {
                return;
            }
            tell(session, &row);
            rows.lock().unwrap_or_else(|e| e.into_inner()).push(row);
        }
    };
    std::thread::scope(|scope| (0..jobs).for_each(|_| _ = scope.spawn(work)));
    if progress::interrupted() {
        return Err(Failure::interrupted());
    }
    let mut rows = rows.into_inner().unwrap_or_else(|e| e.into_inner());
    rows.sort_by_key(|row| row.index);
    let all = json!({ "planish": env!("CARGO_PKG_VERSION"), "command": "run", "runs": rows });
    let text = serde_json::to_string_pretty(&all).map_err(Failure::fault)? + "\n";
    let [_, data, page] = outputs::BATCH_PRODUCTS;
    // Of a batch that another program has parted, each part would write over the others.
    if args.folder.is_none() {
        let staged = Staged::folder(&args.output)?;
        write_text(&staged.path(data), &text)?;
        write_text(&staged.path(page), &page::html(&rows, &args.output))?;
        staged.commit()?;
    }
    if let Some(staged) = own_report {
        write_text(&staged.file_path(), &text)?;
        staged.commit()?;
    }
    if !session.common.quiet {
        let mut lines = page::lines(&rows);
        lines.extend(["".into(), format!("look at  {}", args.output.join(page).display())]);
        lines.iter().all(|line| stdout::table_line(line));
    }
    Ok(verdict(&rows))
}

/// The options of each run: those of the batch, and a share of the cores.
fn options(args: &Run, jobs: usize) -> Vec<OsString> {
    let of_batch = ["--output=", "--jobs=", "--report=", "--folder=", "--json", "--quiet", "--verbose", "--tied"];
    let is_own = |option: &&OsString| {
        let text = option.to_string_lossy();
        !of_batch.iter().any(|o| if o.ends_with('=') { text.starts_with(o) } else { text == *o })
    };
    let mut options: Vec<OsString> = args.given.iter().filter(is_own).cloned().collect();
    if args.common.threads.is_none() {
        let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
        options.push(format!("--threads={}", (cores / jobs).max(1)).into());
    }
    options
}

/// Done, missed, or the status of the worst failure.
fn verdict(rows: &[Row]) -> Status {
    let worst = rows.iter().filter(|r| r.status == Outcome::Failed).map(|r| r.exit).max();
    match worst {
        Some(2) => Status::Usage,
        Some(3) => Status::Input,
        Some(_) => Status::Fault,
        None if rows.iter().any(|r| r.exit == Status::Missed as i32) => Status::Missed,
        None => Status::Done,
    }
}

/// Tells a row as soon as it is there.
fn tell(session: &Session, row: &Row) {
    stdout::json_line(&json!(row));
    let line = match &row.error {
        Some(error) => error.clone(),
        None if session.common.quiet => return,
        None => format!("{}: {} in {:.1} s", row.source.display(), row.status.word(), row.seconds),
    };
    let _ = writeln!(std::io::stderr(), "{}", crate::words::plain(&line));
}

struct Batch<'a> {
    args: &'a Run,
    program: &'a [OsString],
    options: Vec<OsString>,
    manifest: Manifest,
}

impl Batch<'_> {
    fn row(&self, index: usize, source: &Path, folder: &Path) -> Row {
        let row = Row {
            index,
            source: source.to_owned(),
            folder: folder.to_owned(),
            status: Outcome::Failed,
            exit: Status::Input as i32,
            seconds: 0.0,
            error: None,
            quality: Map::new(),
        };
        let key = match key(source, self.args.network.as_deref(), &self.options) {
            Ok(key) => key,
            Err(e) => return Row { error: Some(Failure::input(source, unreadable(&e)).to_string()), ..row },
        };
        if let Some(done) = self.manifest.finished(folder, &key)
            && let Some(quality) = quality(folder)
        {
            let exit = if done.missed { Status::Missed } else { Status::Done } as i32;
            return Row { status: Outcome::Skipped, exit, seconds: done.seconds, quality, ..row };
        }
        let start = Instant::now();
        let ended = self.start(source, folder).and_then(wait);
        let seconds = (start.elapsed().as_secs_f64() * 1e3).round() / 1e3;
        let (exit, told) = match ended {
            Ok(ended) => ended,
            Err(e) => (Status::Fault as i32, Failure::fault(format!("a run cannot be started ({e})")).to_string()),
        };
        let missed = exit == Status::Missed as i32;
        if exit != Status::Done as i32 && !missed {
            let line = told.lines().rfind(|l| l.starts_with("error: ")).map(str::to_owned);
            let error = line.unwrap_or_else(|| format!("error: the run ended with status {exit}"));
            return Row { exit, seconds, error: Some(error), ..row };
        }
        let Some(quality) = quality(folder) else {
            let error = Some(format!("error: {}: its report cannot be read", folder.display()));
            return Row { exit: Status::Fault as i32, seconds, error, ..row };
        };
        let entry = manifest::Entry { key, source: source.display().to_string(), seconds, missed };
        let status = if missed { Outcome::Missed } else { Outcome::Done };
        match self.manifest.add(folder, entry) {
            // The products are there; without its entry the next batch makes them again.
            Ok(()) => Row { status, exit, seconds, quality, ..row },
            Err(e) => {
                let error = Some(products::unwritable(&self.args.output, &e).to_string());
                Row { status, exit, seconds, quality, error, ..row }
            }
        }
    }

    fn start(&self, source: &Path, folder: &Path) -> std::io::Result<Child> {
        let Some((program, before)) = self.program.split_first() else {
            return Err(std::io::Error::other("nothing to start"));
        };
        Command::new(program)
            .args(before)
            .args(["run", "--quiet", "--tied", "--output"])
            .arg(folder)
            .args(&self.options)
            .arg("--")
            .arg(source)
            // It ends when this end of the pipe is closed, also by the death of this process.
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
    }
}

fn unreadable(error: &std::io::Error) -> String {
    format!("cannot be read ({})", products::plain(error))
}

/// The figures in the report of a run.
fn quality(folder: &Path) -> Option<Map<String, Value>> {
    let text = std::fs::read_to_string(folder.join("report.json")).ok()?;
    match serde_json::from_str::<Value>(&text).ok()?.get_mut("quality")?.take() {
        Value::Object(quality) => Some(quality),
        _ => None,
    }
}

/// Waits for the end of a run: its exit status and what it told. After an interrupt the run is told to end, too.
fn wait(mut child: Child) -> std::io::Result<(i32, String)> {
    let mut input = child.stdin.take();
    let told = child.stderr.take();
    let reader = std::thread::spawn(move || {
        let mut text = Vec::new();
        if let Some(mut told) = told {
            let _ = told.by_ref().take(TOLD).read_to_end(&mut text);
            let _ = std::io::copy(&mut told, &mut std::io::sink());
        }
        String::from_utf8_lossy(&text).into_owned()
    });
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status;
        }
        if progress::interrupted() {
            drop(input.take());
        }
        std::thread::sleep(GLANCE);
    };
    let text = reader.join().unwrap_or_default();
    // Without a status a signal ended it.
    Ok((status.code().unwrap_or(Status::Fault as i32), text))
}
