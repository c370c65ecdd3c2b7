//! Progress on stderr, and the signals that end the program.

use crate::failure::Status;
use crate::products;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use planish::Observer;
use planish::pipeline::{PipelineObserver, StageRecord};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

/// A stage shows its bar once it has run for this long: shorter ones would only flicker.
const SHOW_AFTER: Duration = Duration::from_millis(500);
/// After Ctrl-C a stage has this long to notice; then the program ends without it. The promise is one second.
const GRACE: Duration = Duration::from_millis(800);
/// Steps of a bar.
const STEPS: u64 = 1000;

static CANCELLED: AtomicBool = AtomicBool::new(false);

/// Makes Ctrl-C, SIGTERM and a hangup end the program within a second, with nothing half-written left. A hangup that the
/// parent had ignored (`nohup`) stays ignored.
pub fn watch_interrupts() {
    let mut ends = vec![SIGINT, SIGTERM];
    #[cfg(unix)]
    if !is_hangup_ignored() {
        ends.push(signal_hook::consts::SIGHUP);
    }
    // A system that refuses a handler ends the program its own way.
    let Ok(mut signals) = Signals::new(ends) else { return };
    std::thread::spawn(move || {
        if signals.forever().next().is_some() {
            end();
        }
    });
}

/// Makes the end of standard input end the program, too: a batch that is killed takes its runs along.
pub fn watch_input() {
    std::thread::spawn(|| {
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        end();
    });
}

/// Ends the program: by itself where it notices in time, else by force.
fn end() {
    CANCELLED.store(true, Ordering::SeqCst);
    std::thread::sleep(GRACE);
    let _ = writeln!(std::io::stderr(), "{}", crate::failure::Failure::interrupted());
    products::abandon_and_exit(Status::Interrupted as u8);
}

/// True if SIGHUP was ignored when the program started. Systems that do not tell count as not.
#[cfg(unix)]
fn is_hangup_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|l| l.strip_prefix("SigIgn:")).map(|m| u64::from_str_radix(m.trim(), 16));
    matches!(mask, Some(Ok(mask)) if mask >> (signal_hook::consts::SIGHUP - 1) & 1 == 1)
}

/// True once the user has pressed Ctrl-C.
pub fn interrupted() -> bool {
    CANCELLED.load(Ordering::SeqCst)
}

/// Watches for Ctrl-C alone, in steps that need no bar of their own.
pub struct Interrupt;

impl Observer for Interrupt {
    fn progress(&self, _fraction: f64) {}
    fn cancelled(&self) -> bool {
        interrupted()
    }
}

/// Bars for the stages of a command: one per stage that takes longer than half a second, on stderr when it
/// is a terminal.
pub struct Bars {
    bars: bool,
    verbose: bool,
    current: Mutex<Option<Current>>,
    /// When the pipeline began.
    began: OnceLock<Instant>,
}

struct Current {
    bar: ProgressBar,
    since: Instant,
    shown: bool,
}

impl Bars {
    /// Bars unless `quiet`; with `verbose` a line for each stage that ends.
    pub fn new(quiet: bool, verbose: bool) -> Bars {
        let bars = !quiet && std::io::stderr().is_terminal();
        Bars { bars, verbose: verbose && !quiet, current: Mutex::new(None), began: OnceLock::new() }
    }

    /// Runs one step outside the pipeline (reading, writing, drawing) under a bar of its own.
    pub fn step<T>(&self, name: &'static str, work: impl FnOnce(&dyn Observer) -> T) -> (T, StageRecord) {
        self.open(name);
        let start = Instant::now();
        let result = work(self);
        let (seconds, peak_bytes) = (start.elapsed().as_secs_f64(), peak_bytes());
        let record = StageRecord { name: name.into(), seconds, peak_bytes, counts: Default::default() };
        self.ends(&record);
        (result, record)
    }

    /// Opens the bar of a stage or a step.
    fn open(&self, name: &'static str) {
        if !self.bars {
            return;
        }
        let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::hidden());
        // The bar takes what the terminal has room for: a line that is too long would be drawn anew with every step.
        let style = ProgressStyle::with_template("{prefix:>9} {wide_bar} {percent:>3} % {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_prefix(name);
        if let Ok(mut current) = self.current.lock() {
            *current = Some(Current { bar, since: Instant::now(), shown: false });
        }
    }

    /// * `of_run` - the fraction of the whole run, where that is known
    fn advance(&self, fraction: f64, of_run: Option<f64>) {
        let Ok(mut current) = self.current.lock() else { return };
        let Some(current) = current.as_mut() else { return };
        current.bar.set_position((fraction * STEPS as f64) as u64);
        let left = match (of_run, self.began.get()) {
            (Some(of_run), Some(began)) => left(began.elapsed(), of_run).map(|left| format!("{left} left in all")),
            _ => left(current.since.elapsed(), fraction).map(|left| format!("{left} left")),
        };
        current.bar.set_message(left.unwrap_or_default());
        if !current.shown && current.since.elapsed() > SHOW_AFTER {
            current.bar.set_draw_target(ProgressDrawTarget::stderr());
            current.shown = true;
        }
    }
}

/// Below this fraction nobody knows how long the rest takes.
const TOLD_FROM: f64 = 0.02;

/// The time that is left of something that has come to a fraction.
fn left(elapsed: Duration, fraction: f64) -> Option<String> {
    if fraction < TOLD_FROM {
        return None;
    }
    let seconds = (elapsed.as_secs_f64() * (1.0 / fraction.min(1.0) - 1.0)).round() as u64;
    Some(match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, m, s) => format!("{m} min {s:02} s"),
        (h, m, _) => format!("{h} h {m:02} min"),
    })
}

impl Observer for Bars {
    fn progress(&self, fraction: f64) {
        self.advance(fraction, None);
    }

    fn cancelled(&self) -> bool {
        interrupted()
    }
}

impl PipelineObserver for Bars {
    fn begins(&self, name: &'static str, _of_run: f64) {
        self.began.get_or_init(Instant::now);
        self.open(name);
    }

    fn progress(&self, of_stage: f64, of_run: f64) {
        self.advance(of_stage, Some(of_run));
    }

    fn ends(&self, record: &StageRecord) {
        if let Ok(mut current) = self.current.lock()
            && let Some(done) = current.take()
        {
            done.bar.finish_and_clear();
        }
        if self.verbose {
            let counts: Vec<String> = record.counts.iter().map(|(key, n)| format!("{key} {n}")).collect();
            let line = format!("{:>9} {:8.2} s  {}", record.name, record.seconds, counts.join(", "));
            let _ = writeln!(std::io::stderr(), "{}", line.trim_end());
        }
    }

    fn cancelled(&self) -> bool {
        interrupted()
    }

    fn peak_bytes(&self) -> u64 {
        peak_bytes()
    }
}

impl Drop for Bars {
    fn drop(&mut self) {
        if let Ok(mut current) = self.current.lock()
            && let Some(unfinished) = current.take()
        {
            unfinished.bar.finish_and_clear();
        }
    }
}

/// Largest memory that this process has held, in bytes; 0 where the system does not tell.
pub fn peak_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|l| l.trim().strip_suffix("kB")).and_then(|n| n.trim().parse::<u64>().ok());
    kilobytes.unwrap_or(0) * 1024
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_that_of_the_whole_run() {
        let after = |seconds: u64, fraction: f64| left(Duration::from_secs(seconds), fraction);
        assert_eq!(after(10, 0.25).as_deref(), Some("30 s"));
        assert_eq!(after(60, 0.25).as_deref(), Some("3 min 00 s"));
        assert_eq!(after(3600, 0.5).as_deref(), Some("1 h 00 min"));
        assert_eq!(after(5, 1.0).as_deref(), Some("0 s"));
        assert_eq!(after(1, 0.001), None);
        let mut bars = Bars::new(true, false);
        bars.bars = true;
        PipelineObserver::begins(&bars, "layout", 0.0);
        bars.began.get().expect("the run has begun");
        PipelineObserver::progress(&bars, 0.9, 0.3);
        let told = bars.current.lock().unwrap().as_ref().unwrap().bar.message();
        assert!(told.ends_with(" left in all"), "{told}");
    }
}
