//! Fields: solids and milling jobs from scripts, blended samples, functions written in Python; and volumes.

use crate::error::{told, told_of};
use crate::objects::PyMesh;
use crate::params::Given;
use crate::words::{bytes, sampling};
use crate::{array, view, watch};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use planish::DVec3;
use planish::contour::{self, ContourParams, MeshingError};
use planish::field::{self, Field, Part, ScalarGrid};
use planish::geom::Aabb;
use planish::observe::Cancelled;
use planish::pipeline::ScanParams;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// What a field is asked by.
enum Source {
    /// Stages know more of solids and meshes than their values.
    Part(Part),
    /// Point by point.
    Any(Box<dyn Field + Send>),
    /// In Python.
    Function(Function),
}

/// A field: negative inside, positive outside, zero on the surface.
///
/// Field(function, bounds, *, gradient=None, noise_deg=0.0, exact=False)
///
/// * function: called with points (n, 3) float64, returns n values: pseudo-distances in world units, NaN where unknown.
///   It must answer the same for the same point and is called from several threads, one at a time. Or a formula of x, y and z
///   as text, such as "x^2 + y^2 - 1" (docs/guide/solids.md has what it may say): its gradients are exact, and the body ends
///   at the box.
/// * bounds: (2, 3), least and greatest corner of a box that holds the whole surface
/// * gradient: called with points (n, 3), returns (n, 3); None for differences of the function's values
/// * noise_deg: typical angle by which gradients miss the true normal, degrees; normals that differ by less than three
///   times this make no sharp edge
/// * exact: ask the function about each place of a sharp edge, one point at a time: 50 times slower, and needed only where
///   edges are sharper and surfaces more curved than the cells can show. Else edges lie where the surfaces beside them meet.
///
/// Also made by `planish.read` from a script of solids or a milling job, and by `Samples.field`.
#[pyclass(frozen, module = "planish", name = "Field")]
pub struct PyField {
    source: Source,
    kind: &'static str,
}

impl PyField {
    /// A field of the library.
    pub fn new(field: Box<dyn Field + Send>, kind: &'static str) -> PyField {
        PyField { source: Source::Any(field), kind }
    }

    /// A tree of solids and meshes.
    pub fn part(part: Part) -> PyField {
        PyField { source: Source::Part(part), kind: "solids" }
    }

    fn field(&self) -> &dyn Field {
        match &self.source {
            Source::Part(part) => part,
            Source::Any(field) => field.as_ref(),
            Source::Function(function) => function,
        }
    }

    /// Runs a stage; what a function raised goes before what the stage says.
    fn run<T: Send>(
        &self,
        py: Python,
        name: &'static str,
        progress: Option<&Bound<PyAny>>,
        work: impl FnOnce(&dyn watch::Both) -> Result<T, MeshingError> + Send,
    ) -> PyResult<T> {
        let made = watch::run(py, name, progress, |o| match &self.source {
            Source::Function(function) if function.failed() => Err(field::FieldError::from(Cancelled).into()),
            _ => work(o),
        });
        match &self.source {
            Source::Function(function) => function.raised().map_or(made, Err),
            _ => made,
        }
    }
}

#[pymethods]
impl PyField {
    #[new]
    #[pyo3(signature = (function, bounds, *, gradient=None, noise_deg=0.0, exact=false))]
    fn py_new(
        function: Bound<PyAny>,
        bounds: &Bound<PyAny>,
        gradient: Option<Bound<PyAny>>,
        noise_deg: f64,
        exact: bool,
    ) -> PyResult<PyField> {
        if let Ok(text) = function.extract::<String>() {
            let given = gradient.is_some() || noise_deg != 0.0 || exact;
            if given {
                let what = "gradient, noise_deg and exact are for functions: a formula has exact gradients";
                return Err(PyTypeError::new_err(what));
            }
            let formula = field::Formula::parse(&text).map_err(|e| told(function.py(), &e))?;
            let bounds = array::bounds(bounds, "bounds")?;
            let part = Part::Solid(field::Solid::of_formula(formula, &bounds));
            return Ok(PyField { source: Source::Part(part), kind: "a formula" });
        }
        for (name, given) in [("function", Some(&function)), ("gradient", gradient.as_ref())] {
            if given.is_some_and(|f| !f.is_callable()) {
                return Err(PyTypeError::new_err(format!("{name}: something that can be called is needed")));
            }
        }
        if !(0.0..=180.0).contains(&noise_deg) {
            return Err(PyValueError::new_err(format!("noise_deg={noise_deg}: a number from 0 to 180 is needed")));
        }
        let bounds = array::bounds(bounds, "bounds")?;
        let function = Function {
            values: function.unbind(),
            gradients: gradient.map(Bound::unbind),
            bounds,
            noise_deg: if exact { noise_deg } else { noise_deg.max(LEAST_NOISE_DEG) },
            failed: AtomicBool::new(false),
            raised: Mutex::new(None),
        };
        Ok(PyField { source: Source::Function(function), kind: "function" })
    }

    /// A box that holds the whole surface, (2, 3).
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::corners(py, self.field().bounds())
    }

    /// Values at points (n, 3): (n,) pseudo-distances, world units; NaN where the field does not know.
    fn values<'py>(&self, py: Python<'py>, points: &Bound<PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let read = array::points(points, "points")?;
        let points = read.vectors();
        let values = self.run(py, "values", None, |_| {
            let mut values = vec![0.0; points.len()];
            self.field().values(&points, &mut values);
            Ok(values)
        })?;
        Ok(PyArray1::from_vec(py, values))
    }

    /// Unit gradients at points (n, 3): (n, 3), outward near the surface; zero where there is none.
    fn gradients<'py>(&self, py: Python<'py>, points: &Bound<PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let read = array::points(points, "points")?;
        let points = read.vectors();
        let gradients = self.run(py, "gradients", None, |_| {
            let mut gradients = vec![DVec3::ZERO; points.len()];
            self.field().gradients(&points, &mut gradients);
            Ok(gradients)
        })?;
        array::vectors(py, gradients)
    }

    /// A mesh with sharp edges of where the field is zero. Raises FieldError, ContourError, and what a function raises.
    ///
    /// * voxel, resolution: edge of a cell in world units, or cells along the longest side (129)
    /// * memory: GB that the lattice may take (8)
    ///
    /// Source: Kobbelt et al. 2001, section 4; docs/methods/contour.md.
    #[pyo3(signature = (*, memory=None, progress=None, **parameters))]
    fn mesh(
        &self,
        py: Python,
        memory: Option<f64>,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyMesh> {
        let mut given = Given::new("Field.mesh", parameters)?;
        let spacing = given.take::<ScanParams>()?.cells;
        let params: ContourParams = given.take()?;
        given.done()?;
        let sampling = sampling(spacing, memory)?;
        let made = self.run(py, "mesh", progress, |o| match &self.source {
            Source::Part(part) => contour::from_part(part, sampling, &params, o.one()),
            Source::Any(field) => contour::from_field(field.as_ref(), sampling, &params, o.one()),
            Source::Function(function) => {
                let watched = Watched { function, observer: o.one() };
                contour::from_field(function, sampling, &params, &watched)
            }
        })?;
        Ok(PyMesh::meshed(made, json!({})))
    }

    /// The field's values on a lattice around its surface, as a volume: float32, NaN where it does not know. Raises FieldError.
    ///
    /// * voxel, resolution: distance of the values in world units, or cells along the longest side (129)
    /// * memory: GB that the values may take (8)
    #[pyo3(signature = (*, memory=None, progress=None, **parameters))]
    fn sample(
        &self,
        py: Python,
        memory: Option<f64>,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyVolume> {
        let mut given = Given::new("Field.sample", parameters)?;
        let sampling = sampling(given.take::<ScanParams>()?.cells, memory)?;
        given.done()?;
        let sampled = |field: &dyn Field, o: &dyn planish::Observer| {
            Ok(ScalarGrid::of_field(field, sampling.spacing, sampling.memory, o)?)
        };
        let grid = self.run(py, "sample", progress, |o| match &self.source {
            Source::Function(function) => sampled(function, &Watched { function, observer: o.one() }),
            _ => sampled(self.field(), o.one()),
        })?;
        Ok(PyVolume::new(grid))
    }

    fn __repr__(&self) -> String {
        let Aabb { min, max } = self.field().bounds();
        format!("<planish.Field of {}: {min:.4} to {max:.4}>", self.kind)
    }
}

/// A function written in Python. What it raises first is kept, and stops the stage that asked.
struct Function {
    values: Py<PyAny>,
    gradients: Option<Py<PyAny>>,
    bounds: Aabb,
    noise_deg: f64,
    failed: AtomicBool,
    raised: Mutex<Option<PyErr>>,
}

/// Noise that changes no threshold, degrees: fields with noise are not asked point by point about their sharp edges.
const LEAST_NOISE_DEG: f64 = 1e-6;

/// Half the distance over which gradients are differences, as a share of the box's diagonal: the cube root of a double's
/// precision, where the error of rounding is that of the third derivative.
const DIFFERENCE: f64 = 6e-6;

impl Function {
    fn failed(&self) -> bool {
        self.failed.load(Ordering::Relaxed)
    }

    /// What was raised, once.
    fn raised(&self) -> Option<PyErr> {
        let raised = self.raised.lock().unwrap_or_else(PoisonError::into_inner).take();
        self.failed.store(false, Ordering::Relaxed);
        raised
    }

    /// Asks in Python: `width` numbers for each point.
    fn ask(&self, function: &Py<PyAny>, name: &str, points: &[DVec3], width: usize) -> Option<Vec<f64>> {
        if self.failed() {
            return None;
        }
        let ask = |py: Python| -> PyResult<Vec<f64>> {
            let answer = function.bind(py).call1((array::vectors(py, points.to_vec())?,))?;
            let shape: &[usize] = if width == 1 { &[points.len()] } else { &[points.len(), width] };
            // A length of 0 would mean any: there is always a point.
            Ok(array::reals(&answer, name, shape)?.flat().to_vec())
        };
        Python::attach(|py| match ask(py) {
            Ok(answer) => Some(answer),
            Err(error) => {
                self.failed.store(true, Ordering::Relaxed);
                self.raised.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
                None
            }
        })
    }

    /// Gradients by central differences.
    fn differences(&self, points: &[DVec3], gradients: &mut [DVec3]) {
        let step = DIFFERENCE * self.bounds.diagonal();
        let around = |p: DVec3| DVec3::AXES.into_iter().flat_map(move |axis| [p - axis * step, p + axis * step]);
        let places: Vec<DVec3> = points.iter().copied().flat_map(around).collect();
        let mut values = vec![0.0; places.len()];
        self.values(&places, &mut values);
        for (gradient, v) in gradients.iter_mut().zip(values.as_chunks::<6>().0) {
            *gradient = DVec3::new(v[1] - v[0], v[3] - v[2], v[5] - v[4]).normalize_or_zero();
        }
    }
}

impl Field for Function {
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn value(&self, p: DVec3) -> f64 {
        let mut value = [f64::NAN];
        self.values(&[p], &mut value);
        value[0]
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        let mut gradient = [DVec3::ZERO];
        self.gradients(&[p], &mut gradient);
        gradient[0]
    }

    fn values(&self, points: &[DVec3], values: &mut [f64]) {
        if points.is_empty() {
            return;
        }
        match self.ask(&self.values, "what function returned", points, 1) {
            Some(answer) => values.copy_from_slice(&answer),
            None => values.fill(f64::NAN),
        }
    }

    fn gradients(&self, points: &[DVec3], gradients: &mut [DVec3]) {
        let Some(function) = self.gradients.as_ref().filter(|_| !points.is_empty()) else {
            return self.differences(points, gradients);
        };
        match self.ask(function, "what gradient returned", points, 3) {
            Some(answer) => {
                let rows = answer.as_chunks::<3>().0.iter();
                gradients.iter_mut().zip(rows).for_each(|(g, &a)| *g = DVec3::from_array(a).normalize_or_zero());
            }
            None => gradients.fill(DVec3::ZERO),
        }
    }

    fn in_batches(&self) -> bool {
        true
    }

    fn noise_deg(&self) -> f64 {
        self.noise_deg
    }
}

/// Stops a stage as soon as the function that it asks has failed.
struct Watched<'a> {
    function: &'a Function,
    observer: &'a dyn planish::Observer,
}

impl planish::Observer for Watched<'_> {
    fn progress(&self, fraction: f64) {
        self.observer.progress(fraction);
    }

    fn cancelled(&self) -> bool {
        self.function.failed() || self.observer.cancelled()
    }
}

/// A volume: a regular grid of numbers.
///
/// Volume(values, *, spacing=1.0, origin=(0, 0, 0))
///
/// * values: (nz, ny, nx) float32, x fastest, as tomographs write and as SimpleITK and pynrrd (order="C") read them.
///   Copied once: a volume never changes.
/// * spacing: one number or (x, y, z), distance of the numbers in world units; origin: (x, y, z) of the first
#[pyclass(frozen, module = "planish", name = "Volume")]
pub struct PyVolume {
    grid: ScalarGrid,
}

impl PyVolume {
    /// A volume of the library.
    pub fn new(grid: ScalarGrid) -> PyVolume {
        PyVolume { grid }
    }
}

#[pymethods]
impl PyVolume {
    #[new]
    #[pyo3(signature = (values, *, spacing=None, origin=None))]
    fn py_new(
        values: &Bound<PyAny>,
        spacing: Option<&Bound<PyAny>>,
        origin: Option<&Bound<PyAny>>,
    ) -> PyResult<PyVolume> {
        let read = array::singles(values, "values", &[0, 0, 0])?;
        let size = [2, 1, 0].map(|axis| read.shape()[axis]);
        if let Some(few) = size.iter().find(|&&n| n < 2) {
            return Err(PyValueError::new_err(format!("values: at least 2 along each axis are needed, not {few}")));
        }
        let spacing = match spacing {
            None => DVec3::ONE,
            Some(given) => given.extract::<f64>().map(DVec3::splat).or_else(|_| array::vector(given, "spacing"))?,
        };
        if !(spacing.is_finite() && spacing.min_element() > 0.0) {
            return Err(PyValueError::new_err(format!("spacing={spacing}: numbers above 0 are needed")));
        }
        let origin = origin.map(|o| array::vector(o, "origin")).transpose()?.unwrap_or_default();
        Ok(PyVolume::new(ScalarGrid { size, origin, spacing, values: Arc::new(read.flat().to_vec()) }))
    }

    /// The numbers, (nz, ny, nx) float32; a read-only view of the volume's own memory.
    #[getter]
    fn values<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let ScalarGrid { size: [nx, ny, nz], values, .. } = &slf.get().grid;
        view::numbers(values, slf.clone().into_any())?.reshape([*nz, *ny, *nx])
    }

    /// Distance of the numbers along x, y and z, world units.
    #[getter]
    fn spacing(&self) -> [f64; 3] {
        self.grid.spacing.to_array()
    }

    /// Position of the first number, world units.
    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.grid.origin.to_array()
    }

    /// A mesh with sharp edges of where the numbers pass a level. Raises FieldError, ContourError.
    ///
    /// * iso: the level (0); body: "below" or "above" it
    /// * memory: GB that the lattice may take (8)
    #[pyo3(signature = (*, memory=None, progress=None, **parameters))]
    fn mesh(
        &self,
        py: Python,
        memory: Option<f64>,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyMesh> {
        let mut given = Given::new("Volume.mesh", parameters)?;
        let volume = given.take()?;
        let params: ContourParams = given.take()?;
        given.done()?;
        let memory = bytes(memory)?;
        let made =
            watch::run(py, "mesh", progress, |o| contour::from_grid(&self.grid, &volume, memory, &params, o.one()))?;
        Ok(PyMesh::meshed(made, json!({})))
    }

    /// Writes the volume, whole or not at all: .nrrd with spacing and origin, or .npy, an array indexed [x, y, z] that carries
    /// neither. Raises FileError.
    fn write(&self, py: Python, path: PathBuf) -> PyResult<()> {
        py.detach(|| planish_io::write_grid(&path, &self.grid)).map_err(|e| told_of(py, &path, &e))
    }

    fn __repr__(&self) -> String {
        let [x, y, z] = self.grid.size;
        format!("<planish.Volume: {x} x {y} x {z}, spacing {}>", self.grid.spacing)
    }
}
