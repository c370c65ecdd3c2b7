//! The program as a function: [`run`] -> exit status. Commands live in `commands`, one file each. The executable calls it, and so
//! does the Python package, whose wheel has the program inside.

mod args;
mod check;
mod commands;
mod failure;
mod files;
mod options;
mod outputs;
mod pictures;
mod placed;
mod products;
mod progress;
mod shapes;
mod stdout;
mod streams;
mod summary;
mod tolerance;
mod usage;
mod words;

use failure::{Failure, Status};
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;

pub use commands::{folder_names, with_hint};

/// Runs the program and returns its exit status. It takes the whole process: its thread pool, its handlers of signals, and
/// after an interrupt it ends the process.
/// * `args` - the command line, the program's name first
/// * `program` - how this program is started anew, for the runs of a batch: the path of an executable, and what it needs
///   before a command
pub fn run(args: impl IntoIterator<Item = OsString>, program: &[OsString]) -> u8 {
    let cli = match args::Cli::read(args) {
        Ok(cli) => cli,
        Err(error) => {
            usage::tell(&error);
            return if error.use_stderr() { Status::Usage as u8 } else { Status::Done as u8 };
        }
    };
    guarded(|| commands::run(cli, program)) as u8
}

/// Runs `work`; failures and panics become one line on stderr and an exit status.
fn guarded(work: impl FnOnce() -> Result<Status, Failure>) -> Status {
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
    outcome.unwrap_or_else(|failure| {
        failure.print();
        failure.status
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_status_4_and_a_failure_keeps_its_own() {
        assert_eq!(guarded(|| panic!("index out of range")) as u8, 4);
        assert_eq!(guarded(|| Err(Failure::input("a.ply", "is empty"))) as u8, 3);
        assert_eq!(guarded(|| Ok(Status::Missed)) as u8, 1);
    }
}
