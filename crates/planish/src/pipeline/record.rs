//! What a run tells of itself: stages with their times, figures of quality, warnings.
//!
//! The keys are in `docs/guide/report.md`.

use crate::observe::Observer;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::time::Instant;

/// Watches a run of several stages.
pub trait PipelineObserver: Sync {
    /// Stage `name` begins; so far `of_run` (0 to 1) of the whole run is done.
    fn begins(&self, name: &'static str, of_run: f64);
    /// The running stage has done `of_stage` of itself, the run `of_run` (both 0 to 1).
    fn progress(&self, of_stage: f64, of_run: f64);
    /// A stage is done.
    fn ends(&self, record: &StageRecord);
    /// True when the result is no longer wanted.
    fn cancelled(&self) -> bool;
    /// Largest memory that the process has held so far, in bytes; 0 where nobody knows.
    fn peak_bytes(&self) -> u64 {
        0
    }
}

/// One stage of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageRecord {
    /// Name of the stage.
    pub name: String,
    /// Wall-clock time, seconds.
    pub seconds: f64,
    /// Largest memory that the process had held when the stage ended, bytes; 0 where nobody knows.
    pub peak_bytes: u64,
    /// What it worked on and made.
    pub counts: BTreeMap<String, u64>,
}

/// A figure of quality.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Figure {
    /// Yes or no.
    Flag(bool),
    /// How many.
    Count(u64),
    /// A distance in input units, an angle in degrees, or a fraction: the key says which.
    Number(f64),
}

impl Figure {
    /// As a number: yes is 1, no is 0.
    pub fn value(self) -> f64 {
        match self {
            Figure::Flag(yes) => yes as u8 as f64,
            Figure::Count(n) => n as f64,
            Figure::Number(x) => x,
        }
    }
}

/// Figures of quality by key; the keys are documented in the guide.
pub type Quality = BTreeMap<String, Figure>;

/// Something a user should know about a result that was reached nevertheless.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Warning {
    /// Short name for programs, `snake_case`.
    pub code: String,
    /// One sentence for people.
    pub message: String,
    /// Place: a patch, a curve or coordinates; empty when it is the whole.
    #[serde(rename = "where")]
    pub place: String,
    /// What helps, to be pasted: options of a command, or a step of a script for `planish edit`; empty if there is nothing.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub step: String,
}

impl Warning {
    /// A warning.
    pub fn new(code: &str, message: impl Into<String>, place: impl Into<String>) -> Warning {
        Warning { code: code.into(), message: message.into(), place: place.into(), step: String::new() }
    }

    /// The same with what helps.
    pub fn with_step(self, step: impl Into<String>) -> Warning {
        Warning { step: step.into(), ..self }
    }
}

/// Runs the stages of one run one after the other and keeps their records.
pub(super) struct Clock<'a> {
    observer: &'a dyn PipelineObserver,
    weights: &'a [(&'static str, f64)],
    /// Records of the finished stages.
    pub records: Vec<StageRecord>,
}

impl<'a> Clock<'a> {
    /// A clock for the stages in `weights`, each with its usual share of the time.
    pub fn new(observer: &'a dyn PipelineObserver, weights: &'a [(&'static str, f64)]) -> Clock<'a> {
        Clock { observer, weights, records: Vec::new() }
    }

    /// Runs stage `name` and keeps its record, with the counts that `counts` reads from the result.
    pub fn stage<T, E, const N: usize>(
        &mut self,
        name: &'static str,
        work: impl FnOnce(&dyn Observer) -> Result<T, E>,
        counts: impl FnOnce(&T) -> [(&'static str, usize); N],
    ) -> Result<T, E> {
        let total: f64 = self.weights.iter().map(|w| w.1).sum();
        let before: f64 = self.weights.iter().take_while(|w| w.0 != name).map(|w| w.1).sum::<f64>() / total;
        let share = self.weights.iter().find(|w| w.0 == name).map_or(0.0, |w| w.1) / total;
        self.observer.begins(name, before);
        let start = Instant::now();
        let result = work(&Stage { observer: self.observer, before, share, reached: Mutex::new(0.0) })?;
        let record = StageRecord {
            name: name.into(),
            seconds: start.elapsed().as_secs_f64(),
            peak_bytes: self.observer.peak_bytes(),
            counts: counts(&result).map(|(key, n)| (key.to_owned(), n as u64)).into(),
        };
        self.observer.ends(&record);
        self.records.push(record);
        Ok(result)
    }
}

/// One stage of a run: it watches for the observer of the run.
struct Stage<'a> {
    observer: &'a dyn PipelineObserver,
    before: f64,
    share: f64,
    reached: Mutex<f64>,
}

impl Observer for Stage<'_> {
    fn progress(&self, fraction: f64) {
        // Threads report in any order: a bar must not run back.
        let Ok(mut reached) = self.reached.lock() else { return };
        *reached = fraction.clamp(*reached, 1.0);
        self.observer.progress(*reached, self.before + self.share * *reached);
    }

    fn cancelled(&self) -> bool {
        self.observer.cancelled()
    }
}

/// A [`PipelineObserver`] that passes nothing on.
impl PipelineObserver for crate::observe::Silent {
    fn begins(&self, _name: &'static str, _of_run: f64) {}
    fn progress(&self, _of_stage: f64, _of_run: f64) {}
    fn ends(&self, _record: &StageRecord) {}
    fn cancelled(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Log(Mutex<Vec<f64>>);
    impl PipelineObserver for Log {
        fn begins(&self, _name: &'static str, of_run: f64) {
            self.0.lock().unwrap().push(of_run);
        }
        fn progress(&self, _of_stage: f64, of_run: f64) {
            self.0.lock().unwrap().push(of_run);
        }
        fn ends(&self, _record: &StageRecord) {}
        fn cancelled(&self) -> bool {
            false
        }
    }

    #[test]
    fn progress_of_a_run_rises_by_the_stages_weights_and_never_falls() {
        let log = Log(Mutex::new(Vec::new()));
        let mut clock = Clock::new(&log, &[("one", 1.0), ("two", 3.0)]);
        let half = |o: &dyn Observer| {
            o.progress(0.5);
            Ok::<_, ()>(())
        };
        clock.stage("one", half, |_| [("things", 7)]).unwrap();
        let work = |o: &dyn Observer| {
            o.progress(0.8);
            o.progress(0.4);
            Ok::<_, ()>(())
        };
        clock.stage("two", work, |_| []).unwrap();
        for (got, want) in log.0.lock().unwrap().iter().zip([0.0, 0.125, 0.25, 0.85, 0.85]) {
            assert!((got - want).abs() < 1e-12, "{got} for {want}");
        }
        assert_eq!(clock.records[0].counts["things"], 7);
    }

    #[test]
    fn a_failed_stage_leaves_no_record() {
        let mut clock = Clock::new(&crate::Silent, &[("one", 1.0)]);
        assert_eq!(clock.stage("one", |_| Err::<(), _>("no"), |_| []), Err("no"));
        assert!(clock.records.is_empty());
    }
}
