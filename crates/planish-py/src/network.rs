//! Networks of four-sided patches, and grids of them.

use crate::error::{told, told_of};
use crate::objects::{Body, PyMesh, PyModel, PyNetwork};
use crate::params::{Given, pipeline_params};
use crate::surface::PyGrid;
use crate::{array, json, watch};
use numpy::{PyArray1, PyArray2};
use planish::curve::SurfaceCurve;
use planish::grid::{self, FeatureError, Grid, GridParams, Relaxer};
use planish::network::{CurveKind, Network, diagnose, imprint};
use planish::pipeline::{self, PipelineError, PipelineParams};
use planish::{DVec3, Observer};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyCFunction, PyDict};
use serde_json::json;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Time between two looks whether the result is still wanted.
const LOOK: Duration = Duration::from_millis(20);

/// A patch is divided into this many along a side at most: with eight cells each, its grid has the longest sides there are.
const MOST_DIVISIONS: usize = 128;

/// What is left to do until a network is finished, as a dict: `finished`, and `faults` as texts.
pub fn told_faults<'py>(py: Python<'py>, body: &Body, network: &Network) -> PyResult<Bound<'py, PyAny>> {
    let found = watch::sure(py, "network", |_| diagnose(&body.mesh, body.adjacency(), network))?;
    let faults: Vec<String> = found.faults.iter().map(|f| f.to_string()).collect();
    let finished = found.is_finished() && !network.patches.is_empty();
    json::to(py, &json!({ "finished": finished, "faults": faults, "patches": network.patches.len() }))
}

#[pymethods]
impl PyNetwork {
    /// Reads a network (.json) that was made for `mesh`, as repair leaves it. Raises FileError.
    #[staticmethod]
    fn read(py: Python, path: PathBuf, mesh: &PyMesh) -> PyResult<PyNetwork> {
        let body = repaired(py, mesh)?;
        let network = planish_io::read_network(&path, &body.mesh).map_err(|e| told_of(py, &path, &e))?;
        Ok(PyNetwork::new(body, network, json!({})))
    }

    /// Reads the text that `to_json` writes; the mesh as `read`. Raises FileError.
    #[staticmethod]
    fn from_json(py: Python, text: &str, mesh: &PyMesh) -> PyResult<PyNetwork> {
        let body = repaired(py, mesh)?;
        let network = planish_io::parse_network(text.as_bytes(), &body.mesh).map_err(|e| told(py, &e))?;
        Ok(PyNetwork::new(body, network, json!({})))
    }

    /// The text of its file.
    fn to_json(&self) -> String {
        planish_io::network_json(&self.network, &self.body.mesh)
    }

    /// Writes it as .json. Raises FileError.
    fn write(&self, py: Python, path: PathBuf) -> PyResult<()> {
        planish_io::write_network(&path, &self.network, &self.body.mesh).map_err(|e| told_of(py, &path, &e))
    }

    /// The mesh that it lies on: the repaired one.
    #[getter]
    fn mesh(&self) -> PyMesh {
        PyMesh::shared(self.body.clone())
    }

    /// Positions of the corners, (n, 3), world units.
    #[getter]
    fn corners<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let at: Vec<DVec3> = self.network.corners.iter().map(|c| c.place.position(&self.body.mesh)).collect();
        array::vectors(py, at)
    }

    /// The curves: positions from corner to corner, (k, 3) each, world units.
    #[getter]
    fn curves<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        let course = |c: &planish::network::Curve| SurfaceCurve::open(c.points.clone()).positions(&self.body.mesh);
        self.network.curves.iter().map(|c| array::vectors(py, course(c))).collect()
    }

    /// Corners at the start and the end of each curve, (curves, 2) uint32.
    #[getter]
    fn curve_corners<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        array::rows(py, self.network.curves.iter().map(|c| c.corners).collect())
    }

    /// What each curve follows: "smooth" surface, a sharp "feature", a "rounded" one made smooth, or the "boundary".
    #[getter]
    fn curve_kinds(&self) -> Vec<&'static str> {
        let word = |kind| match kind {
            CurveKind::Smooth => "smooth",
            CurveKind::Rounded => "rounded",
            CurveKind::Feature => "feature",
            CurveKind::Boundary => "boundary",
        };
        self.network.curves.iter().map(|c| word(c.kind)).collect()
    }

    /// The four curves of each patch, (patches, 4) uint32, counter-clockwise seen from outside.
    #[getter]
    fn patches<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        array::rows(py, self.network.patches.iter().map(|p| p.sides.map(|s| s.curve)).collect())
    }

    /// The four corners of each patch, (patches, 4) uint32, counter-clockwise seen from outside.
    #[getter]
    fn patch_corners<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let four = |p: usize| [0, 1, 2, 3].map(|k| self.network.corner(p, k));
        array::rows(py, (0..self.network.patches.len()).map(four).collect())
    }

    /// The chord of each curve, (curves,) uint32: curves on opposite sides of a patch share one, and their counts.
    #[getter]
    fn chords<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_vec(py, self.network.chords())
    }

    /// What the layout tells of itself.
    #[getter]
    fn facts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to(py, &self.facts)
    }

    /// What is left to do until every part of the mesh is a patch: a dict of `finished`, `patches`, `faults`.
    fn diagnose<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        told_faults(py, &self.body, &self.network)
    }

    /// The patches resampled to regular grids, one each. Raises NetworkError, GridError.
    ///
    /// Source: Krishnamurthy 1998, chapter 5.
    #[pyo3(signature = (*, progress=None, **parameters))]
    fn grids(
        &self,
        py: Python,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<Vec<PyGrid>> {
        let mut given = Given::new("Network.grids", parameters)?;
        let params = given.take()?;
        given.done()?;
        let (mesh, network) = (&self.body.mesh, &self.network);
        let grids = watch::run(py, "grids", progress, |o| -> Result<_, PipelineError> {
            let patches = imprint(mesh, network, o.one())?;
            Ok(grid::resample(mesh, network, &patches, (&[], &[]), &params, o.one())?)
        })?;
        Ok(grids.into_iter().map(PyGrid::new).collect())
    }

    /// The network with `by` times `by` patches in the place of each, which meet along the rows and columns of its grid. What curves
    /// follow stays. Raises ValueError, NetworkError, GridError.
    ///
    /// Source: docs/methods/layout.md, "Many patches".
    #[pyo3(signature = (by=2, *, progress=None))]
    fn divided(&self, py: Python, by: usize, progress: Option<&Bound<PyAny>>) -> PyResult<PyNetwork> {
        if !(1..=MOST_DIVISIONS).contains(&by) {
            return Err(PyValueError::new_err(format!("by={by}: 1 to {MOST_DIVISIONS} are possible")));
        }
        let (mesh, params) = (&self.body.mesh, GridParams::default());
        let divide = |o: &dyn watch::Both| grid::divide(mesh, &self.network, by, &params, o.one());
        Ok(PyNetwork::new(self.body.clone(), watch::run(py, "divide", progress, divide)?, json!({})))
    }

    /// Grids of some patches, of given sizes: what `fit` asks `relax` for. Raises ValueError, NetworkError, GridError.
    ///
    /// * patches: (n,), rising
    /// * sizes: (n, 2), points of each along u and v
    #[pyo3(signature = (patches, sizes, *, progress=None, **parameters))]
    fn relax(
        &self,
        py: Python,
        patches: &Bound<PyAny>,
        sizes: &Bound<PyAny>,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<Vec<PyGrid>> {
        let mut given = Given::new("Network.relax", parameters)?;
        let params: GridParams = given.take()?;
        given.done()?;
        let count = self.network.patches.len();
        let column = py.import("numpy")?.call_method1("reshape", (patches, (-1, 1)))?;
        let which: Vec<usize> =
            array::indices::<1>(&column, "patches", count)?.into_iter().map(|[p]| p as usize).collect();
        let given = array::indices::<2>(sizes, "sizes", params.max_side + 1)?;
        if given.len() != which.len() || !which.is_sorted_by(|a, b| a < b) {
            return Err(PyValueError::new_err("patches, sizes: patches rise, and each has one size"));
        }
        let mut sizes = vec![(2, 2); count];
        which.iter().zip(given).for_each(|(&p, [cols, rows])| sizes[p] = (cols as usize, rows as usize));
        let (input, network) = (&self.body.mesh, &self.network);
        let grids = watch::run(py, "grids", progress, |o| -> Result<_, PipelineError> {
            let patches = match self.patches.get() {
                Some(patches) => patches,
                None => {
                    let made = imprint(input, network, o.one())?;
                    self.patches.get_or_init(|| made)
                }
            };
            let here = grid::Here { input, network, patches, drawn: (&[], &[]), params: &params };
            Ok(here.relax(&which, &sizes, o.one())?)
        })?;
        Ok(grids.into_iter().map(PyGrid::new).collect())
    }

    /// Grids, surfaces, seams and reliefs on this network: a model. Raises the error of the first stage that fails, and what `relax`
    /// raises.
    ///
    /// * tolerance, control, per_curve: how fine the surfaces are; one of them
    /// * relax: called for grids of some patches in the place of `Network.relax`, as `relax(patches, sizes, stopped)`, and returns
    ///   them; other processes may make them. `stopped()` is True once the result is no longer wanted
    #[pyo3(signature = (*, units="mm", relax=None, progress=None, **parameters))]
    fn fit(
        &self,
        py: Python,
        units: &str,
        relax: Option<Bound<PyAny>>,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyModel> {
        let params = pipeline_params("Network.fit", PipelineParams::default(), parameters)?;
        let units = crate::words::units(units)?;
        let (mesh, network) = (&self.body.mesh, self.network.clone());
        let fitted = match relax {
            None => watch::run(py, "fit", progress, |o| pipeline::fit(mesh, None, Some(network), &params, o.run()))?,
            Some(relax) => {
                let others = Others { relax: relax.unbind(), raised: Mutex::new(None) };
                let fit = |o: &dyn watch::Both| pipeline::fit_by(&others, mesh, network, &params, o.run());
                watch::run(py, "fit", progress, fit).map_err(|e| others.raised().unwrap_or(e))?
            }
        };
        PyModel::fitted(fitted, &params, units)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        crate::neighbour::of(slf.as_any(), "planish._pickle", "network")
    }

    fn __repr__(&self) -> String {
        let Network { corners, curves, patches } = &self.network;
        format!("<planish.Network: {} patches, {} curves, {} corners>", patches.len(), curves.len(), corners.len())
    }

    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        crate::neighbour::of(slf.as_any(), "planish._picture", "html")
    }

    /// A picture of the curves on the mesh, (height, width, 4) uint8; see `Mesh.picture`. Raises RenderError.
    #[pyo3(signature = (width=640, height=480, *, eye=None, up=None))]
    fn picture<'py>(
        &self,
        py: Python<'py>,
        width: usize,
        height: usize,
        eye: Option<&Bound<PyAny>>,
        up: Option<&Bound<PyAny>>,
    ) -> PyResult<Bound<'py, numpy::PyArray3<u8>>> {
        let view = crate::picture::View::of(eye, up)?;
        let lines = crate::picture::lines(&self.body.mesh, &self.network);
        crate::picture::draw(py, &self.body.mesh, lines, &view, [width, height])
    }
}

/// A function written in Python that relaxes patches. What it raises is kept.
struct Others {
    relax: Py<PyAny>,
    raised: Mutex<Option<PyErr>>,
}

impl Others {
    fn raised(&self) -> Option<PyErr> {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

impl Relaxer for Others {
    fn relax(
        &self,
        which: &[usize],
        sizes: &[(usize, usize)],
        observer: &dyn Observer,
    ) -> Result<Vec<Grid>, FeatureError> {
        let stopped = Arc::new(AtomicBool::new(false));
        let ask = |py: Python| -> PyResult<Vec<Grid>> {
            let patches = PyArray1::from_iter(py, which.iter().map(|&p| p as u32));
            let sizes = which.iter().map(|&p| [sizes[p].0 as u32, sizes[p].1 as u32]).collect();
            let flag = stopped.clone();
            let stopped = PyCFunction::new_closure(py, None, None, move |_, _| flag.load(Ordering::Relaxed))?;
            let made = self.relax.bind(py).call1((patches, array::rows(py, sizes)?, stopped))?;
            made.try_iter()?.map(|grid| Ok(grid?.cast::<PyGrid>()?.get().grid.clone())).collect()
        };
        let done = AtomicBool::new(false);
        let answer = std::thread::scope(|scope| {
            // Python asks the flag, and the flag asks the observer.
            scope.spawn(|| {
                while !done.load(Ordering::Relaxed) {
                    stopped.store(observer.cancelled(), Ordering::Relaxed);
                    std::thread::sleep(LOOK);
                }
            });
            let answer = Python::attach(ask);
            done.store(true, Ordering::Relaxed);
            answer
        });
        observer.check().map_err(grid::GridError::from)?;
        let wrong = |what: String| FeatureError::Elsewhere { what };
        let grids = answer.map_err(|error| {
            let told = wrong(error.to_string());
            *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            told
        })?;
        let fits = |(&p, g): (&usize, &Grid)| (g.cols, g.rows) == sizes[p];
        if grids.len() != which.len() || !which.iter().zip(&grids).all(fits) {
            return Err(wrong(format!("relax returned no grids of the sizes of the {} patches", which.len())));
        }
        Ok(grids)
    }
}

/// The mesh as repair leaves it: networks lie on that.
fn repaired(py: Python, mesh: &PyMesh) -> PyResult<Arc<Body>> {
    let (made, _) = watch::run(py, "repair", None, |o| planish::mend::repair(&mesh.body.mesh, o.one()))?;
    Ok(if made == mesh.body.mesh { mesh.body.clone() } else { Body::new(made, None) })
}
