//! Made input: the demonstration part, plain shapes and the virtual scanner, for trying out and for tests.

use crate::cloud::PyCloud;
use crate::objects::PyMesh;
use crate::params::Given;
use crate::watch;
use planish::DVec3;
use planish::synthetic::{self, shapes};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;

/// The part of `planish demo`: sharp edges, pockets and fine relief, about two units tall.
#[pyfunction]
#[pyo3(signature = (seed=0, triangles=60_000))]
pub fn demo_part(py: Python, seed: u64, triangles: usize) -> PyResult<PyMesh> {
    let mesh = watch::sure(py, "part", |_| synthetic::demo(seed, triangles))?;
    Ok(PyMesh::new(mesh, None, json!({})))
}

/// A ball of 20 * 4^level triangles.
#[pyfunction]
#[pyo3(signature = (radius=1.0, level=4))]
pub fn sphere(py: Python, radius: f64, level: usize) -> PyResult<PyMesh> {
    if !(radius > 0.0 && radius.is_finite()) || level > LEVELS {
        return Err(PyValueError::new_err(format!("radius above 0 and level of at most {LEVELS} are needed")));
    }
    let mesh = watch::sure(py, "part", |_| shapes::sphere(radius, level))?;
    Ok(PyMesh::new(mesh, None, json!({})))
}

/// A box with so many cells along each edge, its middle in the origin.
#[pyfunction]
#[pyo3(signature = (size=(1.0, 1.0, 1.0), cells=8), text_signature = "(size=(1.0, 1.0, 1.0), cells=8)")]
pub fn cuboid(py: Python, size: (f64, f64, f64), cells: usize) -> PyResult<PyMesh> {
    let size = DVec3::new(size.0, size.1, size.2);
    if !(size.is_finite() && size.min_element() > 0.0) || cells == 0 || cells > CELLS {
        return Err(PyValueError::new_err(format!("sizes above 0 and from 1 to {CELLS} cells are needed")));
    }
    let mesh = watch::sure(py, "part", |_| shapes::cuboid(size, cells))?;
    Ok(PyMesh::new(mesh, None, json!({})))
}

/// Finest ball and box: 5 and 12 million triangles.
const LEVELS: usize = 9;
const CELLS: usize = 1000;

/// A scan of a mesh with the faults of real ones: noise along the rays, wrong ranges, stations a little out of place.
/// Raises CloudError.
#[pyfunction]
#[pyo3(signature = (mesh, *, progress=None, **parameters))]
pub fn virtual_scan(
    py: Python,
    mesh: &PyMesh,
    progress: Option<&Bound<PyAny>>,
    parameters: Option<&Bound<PyDict>>,
) -> PyResult<PyCloud> {
    let mut given = Given::new("virtual_scan", parameters)?;
    let params = given.take()?;
    given.done()?;
    let scan = watch::run(py, "scan", progress, |o| synthetic::virtual_scan(&mesh.body.mesh, &params, o.one()))?;
    Ok(PyCloud::new(scan.cloud))
}
