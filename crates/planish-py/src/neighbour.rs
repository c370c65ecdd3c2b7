//! What the Python modules of the package do for an object: other libraries, pictures in notebooks, pickling.

use pyo3::prelude::*;

/// Calls a function of `planish.neighbours`, which imports the other library only now.
pub fn there<'py, T>(object: &Bound<'py, T>, function: &str) -> PyResult<Bound<'py, PyAny>> {
    of(object.as_any(), "planish.neighbours", function)
}

/// Calls a function of a Python module of the package.
pub fn of<'py>(object: &Bound<'py, PyAny>, module: &str, function: &str) -> PyResult<Bound<'py, PyAny>> {
    object.py().import(module)?.call_method1(function, (object,))
}
