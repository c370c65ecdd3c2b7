//! The guard: what the library reaches on scans of synthetic parts stays above the floors of `regress/figures.json`.
//!
//! Three parts, three levels of noise, three seeds each; a figure is the median of its seeds. The same build has the
//! same figures on any machine, but for the time. `PLANISH_FIGURES=write` takes the table anew (CONTRIBUTING tells when).

#[path = "regress/cpu.rs"]
mod cpu;
#[path = "regress/measure.rs"]
mod measure;
#[path = "regress/table.rs"]
mod table;

use measure::{Figures, NOISES, PARTS, SEEDS};
use std::sync::{Condvar, LazyLock, Mutex, PoisonError};
use std::thread;

/// Cores that no run has taken. Runs of all rows share them: the last row would keep one busy and the others waiting.
static FREE: LazyLock<Mutex<usize>> =
    LazyLock::new(|| Mutex::new(thread::available_parallelism().map_or(1, usize::from)));
static FREED: Condvar = Condvar::new();

/// A core of a run, free again when this goes.
struct Core;

impl Core {
    fn take() -> Core {
        let free = FREE.lock().unwrap_or_else(PoisonError::into_inner);
        *FREED.wait_while(free, |free| *free == 0).unwrap_or_else(PoisonError::into_inner) -= 1;
        Core
    }
}

impl Drop for Core {
    fn drop(&mut self) {
        *FREE.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        FREED.notify_one();
    }
}

fn guard(part: &str, percent: f64) {
    let run = |seed: u64| {
        let _core = Core::take();
        let found = measure::measure(&measure::scan(part, percent, seed));
        found.unwrap_or_else(|e| panic!("{part}, noise {percent} %, seed {seed}: {e}"))
    };
    let runs: Vec<Figures> = thread::scope(|scope| {
        let started = SEEDS.map(|seed| scope.spawn(move || run(seed)));
        started.map(|one| one.join().unwrap_or_else(|fault| std::panic::resume_unwind(fault))).into()
    });
    let row = measure::row_name(part, percent);
    if std::env::var("PLANISH_FIGURES").is_ok_and(|word| word == "write") {
        table::write(&row, &runs);
    }
    let (lines, worse) = table::judge(&row, &runs);
    assert!(worse.is_empty(), "worse than the floor: {}\n{lines}", worse.join(", "));
    #[allow(clippy::print_stdout)] // seen with --nocapture
    {
        println!("{lines}");
    }
}

macro_rules! guards {
    ($($(#[$mark:meta])* $test:ident: $part:literal, $percent:literal;)*) => {
        $(#[test]
        $(#[$mark])*
        fn $test() {
            guard($part, $percent);
        })*

        #[test]
        fn every_part_and_noise_has_a_guard_and_a_row() {
            let guarded = [$(measure::row_name($part, $percent)),*];
            let all = PARTS.iter().flat_map(|part| NOISES.map(|noise| measure::row_name(part, noise)));
            assert!(all.eq(guarded.iter().cloned()));
            assert!(table::read().keys().all(|row| guarded.contains(row)));
        }
    };
}

guards! {
    demo_scanned_at_noise_of_0_1_percent_keeps_its_headline_figures: "demo", 0.1;
    demo_scanned_at_noise_of_0_25_percent_keeps_its_headline_figures: "demo", 0.25;
    demo_scanned_at_noise_of_0_5_percent_keeps_its_headline_figures: "demo", 0.5;
    #[ignore = "with the other long row nearly half of the time of all: make guard"]
    casting_scanned_at_noise_of_0_1_percent_keeps_its_headline_figures: "casting", 0.1;
    casting_scanned_at_noise_of_0_25_percent_keeps_its_headline_figures: "casting", 0.25;
    #[ignore = "with the other long row nearly half of the time of all: make guard"]
    casting_scanned_at_noise_of_0_5_percent_keeps_its_headline_figures: "casting", 0.5;
    bracket_scanned_at_noise_of_0_1_percent_keeps_its_headline_figures: "bracket", 0.1;
    bracket_scanned_at_noise_of_0_25_percent_keeps_its_headline_figures: "bracket", 0.25;
    bracket_scanned_at_noise_of_0_5_percent_keeps_its_headline_figures: "bracket", 0.5;
}
