//! The program inside the package.

use pyo3::prelude::*;
use std::ffi::OsString;

/// Runs the program with a command line, the program's name first, and returns its exit status. It takes the whole
/// process; `planish.run` runs it in one of its own.
#[pyfunction]
pub fn main(py: Python, args: Vec<OsString>) -> u8 {
    py.detach(|| planish_app::run(args))
}
