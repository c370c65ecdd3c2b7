//! Curves on a mesh.

use crate::objects::{PyCurve, PyMesh};
use crate::params::Given;
use crate::{array, json, watch};
use numpy::{PyArray1, PyArray2};
use planish::curve::{CurveError, ScalarField, Snake, SnakeParams, SurfaceCurve};
use planish::geom::FacePoint;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;

#[pymethods]
impl PyCurve {
    #[new]
    #[pyo3(signature = (mesh, faces, bary, *, closed=false))]
    fn py_new(py: Python, mesh: &PyMesh, faces: &Bound<PyAny>, bary: &Bound<PyAny>, closed: bool) -> PyResult<PyCurve> {
        let tall = py.import("numpy")?.call_method1("reshape", (faces, (-1, 1)))?;
        let faces = array::indices::<1>(&tall, "faces", mesh.body.mesh.triangles.len())?;
        let bary = array::points(bary, "bary")?;
        let rows = bary.rows::<3>();
        if rows.len() != faces.len() {
            let what = format!("bary: {} rows for {} faces; give one each", rows.len(), faces.len());
            return Err(PyValueError::new_err(what));
        }
        if let Some(at) =
            rows.iter().position(|b| b.iter().any(|&x| x < 0.0) || (b.iter().sum::<f64>() - 1.0).abs() > SLACK)
        {
            return Err(PyValueError::new_err(format!(
                "bary[{at}]: three weights from 0 to 1 that sum to 1 are needed"
            )));
        }
        let points = faces.iter().zip(rows).map(|(&[face], &bary)| FacePoint { face, bary }).collect();
        let curve = SurfaceCurve { points, closed };
        curve.check(&mesh.body.mesh).map_err(|e| crate::error::told(py, &e))?;
        Ok(PyCurve::new(mesh.body.clone(), curve))
    }

    /// Positions, (n, 3), world units.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::vectors(py, self.curve.positions(&self.body.mesh))
    }

    /// Triangle of each point, (n,) uint32.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_iter(py, self.curve.points.iter().map(|p| p.face))
    }

    /// Weights of the corners of its triangle for each point, (n, 3).
    #[getter]
    fn bary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::rows(py, self.curve.points.iter().map(|p| p.bary).collect())
    }

    /// Whether the last point is joined to the first.
    #[getter]
    fn closed(&self) -> bool {
        self.curve.closed
    }

    /// Length, world units.
    #[getter]
    fn length(&self) -> f64 {
        self.curve.length(&self.body.mesh)
    }

    /// The mesh that it lies on.
    #[getter]
    fn mesh(&self) -> PyMesh {
        PyMesh::shared(self.body.clone())
    }

    /// What a relaxation did: `sweeps`, `settled`, `last_move`, `energy` before and after.
    #[getter]
    fn facts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to(py, &self.facts)
    }

    /// The curve as a snake that has come to rest: fair, even, drawn to a scalar if there is one. Raises CurveError.
    ///
    /// * pinned: indices of points that stay; the ends of an open curve stay always
    /// * scalar: (vertices of the mesh,) numbers that draw the curve to their ridges
    ///
    /// Source: Krishnamurthy 1998, sections 3.5 to 3.8.
    #[pyo3(signature = (*, pinned=None, scalar=None, progress=None, **parameters))]
    fn relax(
        &self,
        py: Python,
        pinned: Option<Vec<usize>>,
        scalar: Option<&Bound<PyAny>>,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyCurve> {
        let mut given = Given::new("Curve.relax", parameters)?;
        let params: SnakeParams = given.take()?;
        given.done()?;
        let body = &self.body;
        let values = scalar.map(|s| array::reals(s, "scalar", &[body.mesh.points.len()])).transpose()?;
        let values = values.map(|v| v.flat().to_vec());
        let (curve, relaxed) = watch::run(py, "curve", progress, |o| -> Result<_, CurveError> {
            let field = values.map(|values| ScalarField::new(&body.mesh, values)).transpose()?;
            let mut snake = Snake::new(&body.mesh, body.adjacency(), &self.curve)?;
            if let Some(field) = &field {
                snake = snake.attracted_to(field)?;
            }
            for &index in pinned.iter().flatten() {
                snake.pin(index, true)?;
            }
            let relaxed = snake.relax(&params, o.one())?;
            Ok((snake.curve(), relaxed))
        })?;
        Ok(PyCurve { facts: json!(relaxed), ..PyCurve::new(body.clone(), curve) })
    }

    /// The same course with so many points, evenly spaced. Raises CurveError.
    fn resampled(&self, py: Python, count: usize) -> PyResult<PyCurve> {
        let body = &self.body;
        let curve = watch::run(py, "curve", None, |_| self.curve.resampled(&body.mesh, body.adjacency(), count))?;
        Ok(PyCurve::new(body.clone(), curve))
    }

    /// The same course with points about so far apart, world units. Raises CurveError.
    fn spaced(&self, py: Python, spacing: f64) -> PyResult<PyCurve> {
        let body = &self.body;
        let curve = watch::run(py, "curve", None, |_| self.curve.spaced(&body.mesh, body.adjacency(), spacing))?;
        Ok(PyCurve::new(body.clone(), curve))
    }

    fn __len__(&self) -> usize {
        self.curve.points.len()
    }

    fn __repr__(&self) -> String {
        let (n, length) = (self.curve.points.len(), self.length());
        format!(
            "<planish.Curve: {n} points, {}, length {length:.4}>",
            if self.curve.closed { "closed" } else { "open" }
        )
    }
}

/// Weights may miss a sum of 1 by this: what single precision makes of them.
const SLACK: f64 = 1e-6;
