//! The program inside the package.

use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;

/// Runs the program with a command line, the program's name first, and returns its exit status. It takes the whole
/// process; `planish.run` runs it in one of its own.
///
/// program: how it is started anew, for the runs of a batch.
#[pyfunction]
pub fn main(py: Python, args: Vec<OsString>, program: Vec<OsString>) -> u8 {
    py.detach(|| planish_app::run(args, &program))
}

/// The names of the folders that a batch makes for its inputs: stems, with the extension where two have one stem.
#[pyfunction]
pub fn folder_names(sources: Vec<PathBuf>) -> Vec<String> {
    planish_app::folder_names(&sources)
}
