//! One exception class per stage, with the messages of the command line.
//!
//! Each error enum of the library has its class here; enums that pass on those of other stages pass on their class, too.

use planish::cloud::CloudError;
use planish::cloud::bricks::StoreError;
use planish::contour::{ContourError, MeshingError};
use planish::curve::CurveError;
use planish::edit::ApplyError;
use planish::field::{FieldError, FormulaError, LatticeError};
use planish::grid::{DivideError, FeatureError, GridError};
use planish::layout::LayoutError;
use planish::mesh::{CompareError, DecimateError, MeshError, SmoothError};
use planish::network::ImprintError;
use planish::pipeline::{PipelineError, ScanError};
use planish::register::AlignError;
use planish::relief::ReliefError;
use planish::render::RenderError;
use planish::surface::FitError;
use planish_io::script::ScriptError;
use planish_io::{NetworkFileError, ProjectError, ReadError, WriteError};
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyKeyboardInterrupt};
use pyo3::prelude::*;

/// The exception classes.
pub mod class {
    use super::*;

    create_exception!(
        planish,
        Error,
        PyException,
        "What planish tells when it cannot do what was asked; one class below it for each stage.\n\n`hint`: what to do about it, or None."
    );
    create_exception!(planish, FileError, Error, "A file cannot be read or written.");
    create_exception!(planish, CloudError, Error, "A scan gives no samples.");
    create_exception!(planish, FieldError, Error, "A field cannot be made or sampled.");
    create_exception!(planish, ContourError, Error, "A field gives no mesh.");
    create_exception!(planish, MeshError, Error, "A mesh is damaged, or cannot be smoothed or decimated.");
    create_exception!(planish, CurveError, Error, "A curve cannot be drawn or relaxed.");
    create_exception!(planish, NetworkError, Error, "A network does not part its mesh into patches.");
    create_exception!(planish, LayoutError, Error, "A mesh gets no automatic network.");
    create_exception!(planish, EditError, Error, "An edit cannot be made.");
    create_exception!(planish, GridError, Error, "A patch cannot be resampled.");
    create_exception!(planish, FitError, Error, "A surface cannot be fitted or evaluated.");
    create_exception!(planish, ReliefError, Error, "A displacement map cannot be made or applied.");
    create_exception!(planish, CompareError, Error, "Two surfaces cannot be compared.");
    create_exception!(planish, RenderError, Error, "A picture cannot be drawn.");
    create_exception!(
        planish,
        RunError,
        Error,
        "The program ended without a result.\n\n`status`: its exit status (2 wrong usage, 3 unusable input, 4 internal fault)."
    );
    create_exception!(planish, InternalError, Error, "A defect of planish: please report it.");
}

/// An error of the library that knows its exception.
pub trait Told: std::error::Error + Send + Sync + 'static {
    /// The exception with this message.
    fn exception(&self, message: String) -> PyErr;
}

macro_rules! told {
    ($($error:ty => $class:ident),* $(,)?) => {
        $(impl Told for $error {
            fn exception(&self, message: String) -> PyErr {
                class::$class::new_err(message)
            }
        })*
    };
}

told! {
    ReadError => FileError, WriteError => FileError, ProjectError => FileError, ScriptError => FileError,
    NetworkFileError => FileError, CloudError => CloudError, FieldError => FieldError, LatticeError => FieldError, FormulaError => FieldError,
    ContourError => ContourError, MeshError => MeshError, SmoothError => MeshError, DecimateError => MeshError,
    CurveError => CurveError, ImprintError => NetworkError, LayoutError => LayoutError, ApplyError => EditError,
    GridError => GridError, FeatureError => GridError, FitError => FitError, ReliefError => ReliefError,
    CompareError => CompareError, AlignError => CompareError, RenderError => RenderError,
}

impl Told for MeshingError {
    fn exception(&self, message: String) -> PyErr {
        match self {
            MeshingError::Field(e) => e.exception(message),
            MeshingError::Contour(e) => e.exception(message),
            MeshingError::Level { .. } => class::ContourError::new_err(message),
        }
    }
}

impl Told for DivideError {
    fn exception(&self, message: String) -> PyErr {
        match self {
            DivideError::Imprint(e) => e.exception(message),
            DivideError::Grid(e) => e.exception(message),
            DivideError::Cancelled(_) => class::Error::new_err(message),
        }
    }
}

impl Told for StoreError {
    fn exception(&self, message: String) -> PyErr {
        class::CloudError::new_err(message)
    }
}

impl Told for ScanError {
    fn exception(&self, message: String) -> PyErr {
        match self {
            ScanError::Cloud(e) => e.exception(message),
            ScanError::Mesh(e) => e.exception(message),
            ScanError::Memory { .. } => class::CloudError::new_err(message),
            ScanError::Cancelled(_) => class::Error::new_err(message),
        }
    }
}

impl Told for PipelineError {
    fn exception(&self, message: String) -> PyErr {
        match self {
            PipelineError::Mesh(e) => e.exception(message),
            PipelineError::Layout(e) => e.exception(message),
            PipelineError::Network(e) => e.exception(message),
            PipelineError::Grid(e) => e.exception(message),
            PipelineError::Feature(e) => e.exception(message),
            PipelineError::Fit(e) => e.exception(message),
            PipelineError::Relief(e) => e.exception(message),
            PipelineError::Compare(e) => e.exception(message),
            PipelineError::Scan(e) => e.exception(message),
            PipelineError::Cloud(e) => e.exception(message),
            PipelineError::Cancelled(_) => class::Error::new_err(message),
        }
    }
}

/// A stage that was stopped by nothing else than the observer.
impl Told for planish::observe::Cancelled {
    fn exception(&self, _message: String) -> PyErr {
        PyKeyboardInterrupt::new_err(())
    }
}

/// The exception of an error of the library.
pub fn told(py: Python, error: &impl Told) -> PyErr {
    let message = planish_app::with_hint(&error.to_string());
    hinted(py, error.exception(message.clone()), &message)
}

/// The exception of an error about a file, whose name comes first as on the command line.
pub fn told_of(py: Python, path: &std::path::Path, error: &impl Told) -> PyErr {
    let message = format!("{}: {}", path.display(), planish_app::with_hint(&error.to_string()));
    hinted(py, error.exception(message.clone()), &message)
}

/// Sets the attribute `hint` of an exception from its message.
pub fn hinted(py: Python, error: PyErr, message: &str) -> PyErr {
    let hint = message.rsplit_once(" - hint: ").map(|(_, hint)| hint);
    match error.value(py).setattr("hint", hint) {
        Ok(()) => error,
        Err(other) => other,
    }
}
