//! The executable: the command line in, the exit status out.

use std::process::ExitCode;

fn main() -> ExitCode {
    planish_app::run(std::env::args_os()).into()
}
