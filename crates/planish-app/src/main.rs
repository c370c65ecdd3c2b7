//! The executable: the command line in, the exit status out.

use std::process::ExitCode;

fn main() -> ExitCode {
    // Where the system does not tell the path of an executable, its name is looked for again.
    let program = std::env::current_exe().map_or_else(|_| "planish".into(), |path| path.into_os_string());
    planish_app::run(std::env::args_os(), &[program]).into()
}
