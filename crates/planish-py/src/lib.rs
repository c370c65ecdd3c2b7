//! The Python package `planish`: the library's stages for NumPy, and the program inside the wheel.
//!
//! One file per stage, the objects that stages share in [`objects`]; every method is a stage's public function, its keywords are the stage's parameters ([`params`]).
//! * arrays in and out - [`array`], [`view`]      * long calls: progress, Ctrl-C, no lock - [`watch`]
//! * one exception class per stage - [`error`]
//!
//! All classes are frozen: an object never changes after it was made, so threads may share it. The Python modules beside it
//! are in `python/planish/`; its stubs are `python/planish/_planish.pyi`, by hand.

mod array;
mod bricks;
mod cloud;
mod curve;
mod error;
mod field;
mod files;
mod json;
mod made;
mod mesh;
mod model;
mod neighbour;
mod network;
mod objects;
mod params;
mod picture;
mod program;
mod relief;
mod surface;
mod view;
mod watch;
mod words;

use pyo3::prelude::*;

/// The compiled part of planish.
#[pymodule(gil_used = false)]
mod _planish {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::bricks::PyBricks;
    #[pymodule_export]
    use crate::cloud::{PyCloud, PySamples};
    #[pymodule_export]
    use crate::error::class::{
        CloudError, CompareError, ContourError, CurveError, EditError, Error, FieldError, FileError, FitError,
        GridError, InternalError, LayoutError, MeshError, NetworkError, ReliefError, RenderError, RunError,
    };
    #[pymodule_export]
    use crate::field::{PyField, PyVolume};
    #[pymodule_export]
    use crate::files::read;
    #[pymodule_export]
    use crate::made::{cuboid, demo_part, sphere, virtual_scan};
    #[pymodule_export]
    use crate::objects::{PyCurve, PyMesh, PyModel, PyNetwork};
    #[pymodule_export]
    use crate::params::{keywords, schema};
    #[pymodule_export]
    use crate::program::{folder_names, main};
    #[pymodule_export]
    use crate::surface::{PyGrid, PyRelief, PySurface};
    #[pymodule_export]
    use crate::watch::set_threads;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        // Every exception has a hint, if only none.
        module.getattr("Error")?.setattr("hint", module.py().None())?;
        module.getattr("RunError")?.setattr("status", 0)
    }

    /// The address at which planish reads an array of shape (n, 3): that of the array itself where it is not copied.
    #[pyfunction]
    fn seen_at(points: &Bound<'_, PyAny>) -> PyResult<usize> {
        Ok(crate::array::points(points, "points")?.flat().as_ptr() as usize)
    }
}
