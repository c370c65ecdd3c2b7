//! The program: `main` -> `run` -> exit status. Commands live in `commands`, one file each.

mod args;
mod commands;
mod failure;
mod files;
mod options;
mod outputs;
mod pictures;
mod products;
mod progress;
mod summary;

use clap::Parser;
use failure::{Failure, Status};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::sync::Mutex;

fn main() -> ExitCode {
    let cli = match args::Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // A closed pipe behind `planish --help | head` is no fault of the user.
            let _ = error.print();
            return if error.use_stderr() { Status::Usage.into() } else { Status::Done.into() };
        }
    };
    guarded(|| commands::run(cli))
}

/// Runs `work`; failures and panics become one line on stderr and an exit status.
fn guarded(work: impl FnOnce() -> Result<Status, Failure>) -> ExitCode {
    static FAULT: Mutex<Option<String>> = Mutex::new(None);
    std::panic::set_hook(Box::new(|info| {
        let place = info.location().map(|l| format!(" ({}:{})", l.file(), l.line())).unwrap_or_default();
        let text = info.payload_as_str().unwrap_or("no message").replace('\n', " ");
        // The first panic is the cause; those of other threads follow from it.
        FAULT.lock().unwrap_or_else(|e| e.into_inner()).get_or_insert(format!("{text}{place}"));
    }));
    let outcome = catch_unwind(AssertUnwindSafe(work));
    let _ = std::panic::take_hook();
    let outcome = outcome.unwrap_or_else(|_| {
        let text = FAULT.lock().unwrap_or_else(|e| e.into_inner()).take().unwrap_or_default();
        Err(Failure::fault(text))
    });
    match outcome {
        Ok(status) => status.into(),
        Err(failure) => {
            failure.print();
            failure.status.into()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_status_4_and_a_failure_keeps_its_own() {
        let code = |c: ExitCode| format!("{c:?}");
        assert_eq!(code(guarded(|| panic!("index out of range"))), code(ExitCode::from(4)));
        assert_eq!(code(guarded(|| Err(Failure::input("a.ply", "is empty")))), code(ExitCode::from(3)));
        assert_eq!(code(guarded(|| Ok(Status::Missed))), code(ExitCode::from(1)));
    }
}
