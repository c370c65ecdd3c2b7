//! Scans and the samples that are fitted to them.

use crate::error::told_of;
use crate::field::PyField;
use crate::objects::{PyMesh, PyModel};
use crate::params::{Given, take_pipeline};
use crate::words::bytes;
use crate::{array, json, neighbour, view, watch};
use numpy::{PyArray1, PyArray2};
use planish::DVec3;
use planish::cloud::{self, Cleaned, Cloud, ProjectParams, Sample, Samples};
use planish::field::SampleField;
use planish::mesh::Attribute;
use planish::pipeline::{self, Input, PipelineParams, RunParams, ScanMeshed, ScanParams};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// A scan: points and whatever else is known of them.
///
/// Cloud(points, *, normals=None, colors=None, attributes=None, scanners=None, seen_by=None, shift=None)
///
/// * points: (n, 3) float64, world units. Copied once: a cloud never changes, and other threads may change your array.
///   Points that are not finite may be among them; no stage uses them.
/// * normals: (n, 3); colors: (n, 3) or (n, 4) from 0 to 1; attributes: dict of (n,) or (n, width)
/// * scanners: (s, 3) positions of the scanners; seen_by: (n,) which of them saw each point
/// * shift: (3,) added to every position to get those of the file, for coordinates far from the origin
///
/// Raises TypeError and ValueError that name the argument.
#[pyclass(frozen, module = "planish", name = "Cloud")]
pub struct PyCloud {
    /// The points.
    pub cloud: Arc<Cloud>,
    facts: Value,
}

impl PyCloud {
    /// A cloud.
    pub fn new(cloud: Cloud) -> PyCloud {
        PyCloud { cloud: Arc::new(cloud), facts: json!({}) }
    }

    /// What cleaning made of a cloud.
    pub fn cleaned(made: Cleaned) -> PyCloud {
        let lines: Vec<Vec<[f64; 3]>> =
            made.facts.lines.iter().map(|l| l.iter().map(|p| p.to_array()).collect()).collect();
        let facts = json!({ "outliers": made.facts.outliers, "moved_rms": made.facts.moved_rms, "lines": lines });
        PyCloud { cloud: Arc::new(made.cloud), facts }
    }
}

/// The parameters of meshing a scan.
pub fn scan_params(given: &mut Given, close: Option<bool>, memory: Option<f64>) -> PyResult<ScanParams> {
    let base = ScanParams { close, memory: bytes(memory)?, ..given.take()? };
    Ok(ScanParams { clean: given.take()?, contour: given.take()?, ..base })
}

/// A scan's mesh with its figures.
pub fn mesh_of(made: ScanMeshed) -> PyMesh {
    let more = json!({
        "noise": made.facts.noise, "spacing": made.facts.spacing, "specks": made.specks, "closed": made.closed,
        "lids": made.lids, "to_points_rms": made.to_points.0, "to_points_mean": made.to_points.1,
    });
    PyMesh::meshed(made.meshed, more)
}

#[pymethods]
impl PyCloud {
    #[new]
    #[pyo3(signature = (points, *, normals=None, colors=None, attributes=None, scanners=None, seen_by=None, shift=None))]
    fn py_new(
        points: &Bound<PyAny>,
        normals: Option<&Bound<PyAny>>,
        colors: Option<&Bound<PyAny>>,
        attributes: Option<&Bound<PyDict>>,
        scanners: Option<&Bound<PyAny>>,
        seen_by: Option<&Bound<PyAny>>,
        shift: Option<&Bound<PyAny>>,
    ) -> PyResult<PyCloud> {
        let read = array::reals(points, "points", &[0, 3])?;
        let count = read.rows::<3>().len();
        let mut attributes = array::attributes(attributes, count)?;
        for (name, given) in [("normal", normals), ("color", colors)] {
            let Some(given) = given else { continue };
            let plural = format!("{name}s");
            let values = array::singles(given, &plural, &[0, 0])?;
            let (found, width) = (values.shape()[0], values.shape()[1]);
            if found != count || !(width == 3 || (name == "color" && width == 4)) {
                let what = format!("{plural}: an array of shape ({count}, 3) is needed, not ({found}, {width})");
                return Err(PyValueError::new_err(what));
            }
            attributes.push(Attribute { name: name.into(), width, values: values.flat().to_vec() });
        }
        let scanners = scanners.map(|s| array::points(s, "scanners")).transpose()?.map(|s| s.vectors());
        let scanners = scanners.unwrap_or_default();
        let seen_by = seen_by.map(|s| seen(s, count, scanners.len())).transpose()?.unwrap_or_default();
        let shift = shift.map(|s| array::vector(s, "shift")).transpose()?.unwrap_or_default();
        Ok(PyCloud::new(Cloud { points: read.vectors(), shift, attributes, scanners, seen_by }))
    }

    /// Positions, (n, 3) float64, less the shift; a read-only view of the cloud's own memory.
    #[getter]
    fn points<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        view::vectors(&slf.get().cloud.points, slf.clone().into_any())
    }

    /// Named quantities per point: read-only views (n,) or (n, width) float32.
    #[getter]
    fn attributes<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        array::attribute_views(&slf.get().cloud.attributes, slf.as_any())
    }

    /// Positions of the scanners, (s, 3), less the shift.
    #[getter]
    fn scanners<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        view::vectors(&slf.get().cloud.scanners, slf.clone().into_any())
    }

    /// Scanner that saw each point, (n,) uint32; empty if unknown.
    #[getter]
    fn seen_by<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<u32>>> {
        view::numbers(&slf.get().cloud.seen_by, slf.clone().into_any())
    }

    /// Added to every position to get those of the file: three numbers, world units.
    #[getter]
    fn shift(&self) -> [f64; 3] {
        self.cloud.shift.to_array()
    }

    /// What the stage that made the cloud tells of it: `outliers`, `moved_rms`, sharp `lines`.
    #[getter]
    fn facts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to(py, &self.facts)
    }

    /// Bounding box of the finite points, (2, 3): least and greatest corner.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::corners(py, self.cloud.bounds())
    }

    /// Length of the bounding box's diagonal, world units.
    #[getter]
    fn diagonal(&self) -> f64 {
        self.cloud.bounds().diagonal()
    }

    /// Oriented, denoised samples of the surface. Raises CloudError.
    ///
    /// Source: Xie et al. 2003; docs/methods/samples.md.
    #[pyo3(signature = (*, progress=None, **parameters))]
    fn clean(
        &self,
        py: Python,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PySamples> {
        let mut given = Given::new("Cloud.clean", parameters)?;
        let params = given.take()?;
        given.done()?;
        let samples = watch::run(py, "samples", progress, |o| cloud::clean(&self.cloud, &params, o.one()))?;
        Ok(PySamples { samples: Arc::new(samples), cloud: self.cloud.clone() })
    }

    /// A closed mesh with sharp edges from the scan. Raises CloudError, FieldError, ContourError.
    ///
    /// * voxel, resolution: edge of a cell in world units, or cells along the longest side; else what suits the points
    /// * close: close all holes (True), none (False), or as the scan is (None)
    /// * memory: GB that the lattice may take (8)
    #[pyo3(signature = (*, close=None, memory=None, progress=None, **parameters))]
    fn mesh(
        &self,
        py: Python,
        close: Option<bool>,
        memory: Option<f64>,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyMesh> {
        let mut given = Given::new("Cloud.mesh", parameters)?;
        let params = scan_params(&mut given, close, memory)?;
        given.done()?;
        let made = watch::run(py, "mesh", progress, |o| pipeline::mesh_scan(&self.cloud, &params, o.one()))?;
        Ok(mesh_of(made))
    }

    /// Everything, from the scan to a model with the parameters that suit its noise. Raises the error of the first stage
    /// that fails.
    ///
    /// * the keywords of `Cloud.mesh` and `Mesh.fit`
    #[pyo3(signature = (*, close=None, memory=None, units="mm", progress=None, **parameters))]
    fn fit(
        &self,
        py: Python,
        close: Option<bool>,
        memory: Option<f64>,
        units: &str,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyModel> {
        let mut given = Given::new("Cloud.fit", parameters)?;
        let scan = ScanParams { points: given.take::<ProjectParams>()?, ..scan_params(&mut given, close, memory)? };
        let units = crate::words::units(units)?;
        // Checked before the work; what suits the scan is known in the middle of it.
        take_pipeline(&mut given, PipelineParams::default())?;
        given.done()?;
        let keywords = Mutex::new(Given::new("Cloud.fit", parameters)?);
        let stages = move |suited: PipelineParams, _diagonal: f64| {
            let mut given = keywords.lock().unwrap_or_else(PoisonError::into_inner);
            take_pipeline(&mut given, suited.clone()).unwrap_or(suited)
        };
        let cloud = &self.cloud;
        let run = watch::run(py, "fit", progress, move |o| {
            pipeline::run(Input::Scan(cloud), &RunParams { scan, stages: Box::new(stages) }, o.run())
        })?;
        PyModel::fitted(run.fitted, &run.params, units)
    }

    /// The points of these indices (k,), in their order.
    fn select(&self, ids: &Bound<PyAny>) -> PyResult<PyCloud> {
        let ids = column(ids, "ids", self.cloud.points.len())?;
        Ok(PyCloud::new(self.cloud.select(&ids)))
    }

    /// Writes the points: .ply or .xyz (all columns), .las, .laz or .e57. Raises FileError.
    fn write(&self, py: Python, path: PathBuf) -> PyResult<()> {
        py.detach(|| planish_io::write_scan(&path, &self.cloud)).map_err(|e| told_of(py, &path, &e))
    }

    /// As an open3d.geometry.PointCloud.
    fn to_open3d<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        neighbour::there(slf, "cloud_to_open3d")
    }

    /// As a pyvista.PolyData.
    fn to_pyvista<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        neighbour::there(slf, "cloud_to_pyvista")
    }

    /// As a trimesh.PointCloud.
    fn to_trimesh<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        neighbour::there(slf, "cloud_to_trimesh")
    }

    fn __len__(&self) -> usize {
        self.cloud.points.len()
    }

    fn __repr__(&self) -> String {
        let size = self.cloud.bounds().size().max(DVec3::ZERO);
        let names: Vec<&str> = self.cloud.attributes.iter().map(|a| a.name.as_str()).collect();
        let with = if names.is_empty() { String::new() } else { format!(" with {}", names.join(", ")) };
        let n = self.cloud.points.len();
        format!("<planish.Cloud: {n} points{with}, {:.4} x {:.4} x {:.4}>", size.x, size.y, size.z)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        neighbour::of(slf.as_any(), "planish._pickle", "cloud")
    }
}

/// Indices `(k,)`, each below `count`.
fn column(any: &Bound<PyAny>, name: &str, count: usize) -> PyResult<Vec<u32>> {
    let tall = any.py().import("numpy")?.call_method1("reshape", (any, (-1, 1)))?;
    Ok(array::indices::<1>(&tall, name, count)?.into_flattened())
}

fn seen(any: &Bound<PyAny>, points: usize, scanners: usize) -> PyResult<Vec<u32>> {
    let seen = column(any, "seen_by", scanners)?;
    if seen.len() != points {
        let what = format!("seen_by: {} entries for {points} points; give one each", seen.len());
        return Err(PyValueError::new_err(what));
    }
    Ok(seen)
}

/// Samples of a scan: places on the surface with normals, local quadrics and what is known of each.
///
/// Made by `Cloud.clean`. Arrays have one entry per sample.
#[pyclass(frozen, module = "planish", name = "Samples")]
pub struct PySamples {
    samples: Arc<Samples>,
    cloud: Arc<Cloud>,
}

impl PySamples {
    fn numbers<'py>(&self, py: Python<'py>, of: impl Fn(&Sample) -> f64) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.samples.samples.iter().map(of))
    }

    fn vectors<'py>(&self, py: Python<'py>, of: impl Fn(&Sample) -> DVec3) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::vectors(py, self.samples.samples.iter().map(of).collect())
    }
}

#[pymethods]
impl PySamples {
    /// Places on the surface, (n, 3), world units.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.vectors(py, |s| s.center)
    }

    /// Unit normals, (n, 3), outward.
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.vectors(py, |s| s.normal)
    }

    /// Radius of the points that each was fitted to, (n,), world units.
    #[getter]
    fn radius<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.numbers(py, |s| s.radius)
    }

    /// Radius of what each speaks for, (n,), world units.
    #[getter]
    fn support<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.numbers(py, |s| s.support)
    }

    /// Expected error of each fit, (n,), world units.
    #[getter]
    fn error<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.numbers(py, |s| s.error)
    }

    /// Standard deviation of the points around each, (n,), world units.
    #[getter]
    fn local_noise<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.numbers(py, |s| s.noise)
    }

    /// Area that each stands for, (n,), world units squared.
    #[getter]
    fn area<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.numbers(py, |s| s.area)
    }

    /// Variation of the gradient and noise over the radius, (n,).
    #[getter]
    fn irregularity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.numbers(py, |s| s.irregularity)
    }

    /// Share of its meetings with other samples that agree with its orientation, (n,), 0 to 1.
    #[getter]
    fn confidence<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.numbers(py, |s| s.confidence)
    }

    /// Sheets at its site, (n,) uint8: 1 regular, 2 crease, 3 and more corner.
    #[getter]
    fn sheets<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u8>> {
        PyArray1::from_iter(py, self.samples.samples.iter().map(|s| s.sheets))
    }

    /// Body that each belongs to, (n,) uint32, by falling area.
    #[getter]
    fn segment<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_iter(py, self.samples.samples.iter().map(|s| s.segment))
    }

    /// Whether each segment is closed.
    #[getter]
    fn closed(&self) -> Vec<bool> {
        self.samples.closed.clone()
    }

    /// Standard deviation of the points, world units: the middle of all places.
    #[getter]
    fn noise(&self) -> f64 {
        self.samples.noise
    }

    /// Distance of neighbouring points, world units: the middle of all places.
    #[getter]
    fn spacing(&self) -> f64 {
        self.samples.spacing
    }

    /// Typical error of the normals, degrees.
    #[getter]
    fn normal_noise_deg(&self) -> f64 {
        self.samples.normal_noise_deg
    }

    /// Distance of sheets that lie side by side, world units; infinite where there are none.
    #[getter]
    fn gap(&self) -> f64 {
        self.samples.gap
    }

    /// Bounding-box diagonal of the points, world units.
    #[getter]
    fn diagonal(&self) -> f64 {
        self.samples.diagonal
    }

    /// The edge of a cell that suits the samples, world units: the default of `mesh`.
    #[getter]
    fn voxel(&self) -> f64 {
        pipeline::voxel_for(&self.samples)
    }

    /// The points of the scan on the surface, without outliers, each with normal, curvature, noise, segment, feature and
    /// confidence. Raises CloudError.
    ///
    /// * outlier: residuals above this many noise levels make an outlier (4)
    #[pyo3(signature = (*, progress=None, **parameters))]
    fn project(
        &self,
        py: Python,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyCloud> {
        let mut given = Given::new("Samples.project", parameters)?;
        let outlier = given.take::<cloud::CleanParams>()?.outlier;
        let params: ProjectParams = given.take()?;
        given.done()?;
        let (cloud, samples) = (&self.cloud, &self.samples);
        let made = watch::run(py, "points", progress, |o| cloud::project(cloud, samples, outlier, &params, o.one()))?;
        Ok(PyCloud::cleaned(made))
    }

    /// A closed mesh with sharp edges from the samples. Raises FieldError, ContourError.
    ///
    /// * voxel, resolution: edge of a cell in world units, or cells along the longest side; else what suits the samples
    /// * close: close all holes (True), none (False), or as the scan is (None)
    /// * memory: GB that the lattice may take (8)
    #[pyo3(signature = (*, close=None, memory=None, progress=None, **parameters))]
    fn mesh(
        &self,
        py: Python,
        close: Option<bool>,
        memory: Option<f64>,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyMesh> {
        let mut given = Given::new("Samples.mesh", parameters)?;
        let base = ScanParams { close, memory: bytes(memory)?, ..given.take()? };
        let params = ScanParams { contour: given.take()?, ..base };
        given.done()?;
        let made = watch::run(py, "mesh", progress, |o| {
            pipeline::mesh_samples(&self.cloud, (*self.samples).clone(), &params, o.one())
        })?;
        Ok(mesh_of(made))
    }

    /// The blended field of the samples.
    ///
    /// * close: places without data get their side from the winding number
    #[pyo3(signature = (*, close=false))]
    fn field(&self, py: Python, close: bool) -> PyResult<PyField> {
        let field = watch::sure(py, "field", |_| SampleField::new(&self.samples, close))?;
        Ok(PyField::new(Box::new(field), "samples"))
    }

    fn __len__(&self) -> usize {
        self.samples.samples.len()
    }

    fn __repr__(&self) -> String {
        let s = &self.samples;
        let (n, segments) = (s.samples.len(), s.closed.len());
        format!(
            "<planish.Samples: {n} samples in {segments} segments, noise {:.3e}, spacing {:.3e}>",
            s.noise, s.spacing
        )
    }
}
