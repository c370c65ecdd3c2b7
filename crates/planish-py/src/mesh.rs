//! Triangle meshes.

use crate::cloud::PyCloud;
use crate::error::{class, told, told_of};
use crate::objects::{Body, PyCurve, PyMesh, PyModel, PyNetwork};
use crate::params::{Given, pipeline_params};
use crate::words::{self, sampling};
use crate::{array, json, neighbour, picture, view, watch};
use numpy::{PyArray1, PyArray2, PyArray3};
use planish::DVec3;
use planish::contour::{self, ContourParams};
use planish::curve::{Canvas, CurveError, Stroke, connect, section, symmetry, vertex_curvature};
use planish::geom::FacePoint;
use planish::mesh::{FeatureTags, TriMesh};
use planish::network::Network;
use planish::pipeline::{self, PipelineError, PipelineParams};
use planish::register::{self, AlignParams, Shape};
use planish::{mend, mesh};
use planish_io::WriteOptions;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;

impl PyMesh {
    fn places(&self, positions: &[[f64; 3]]) -> Vec<FacePoint> {
        positions.iter().map(|&p| self.body.place(DVec3::from_array(p))).collect()
    }

    fn refuse_empty(&self, py: Python) -> PyResult<()> {
        if self.body.mesh.triangles.is_empty() {
            return Err(told(py, &mesh::MeshError::Empty));
        }
        Ok(())
    }
}

#[pymethods]
impl PyMesh {
    #[new]
    #[pyo3(signature = (points, triangles, *, attributes=None, feature_edges=None))]
    fn py_new(
        points: &Bound<PyAny>,
        triangles: &Bound<PyAny>,
        attributes: Option<&Bound<PyDict>>,
        feature_edges: Option<&Bound<PyAny>>,
    ) -> PyResult<PyMesh> {
        let read = array::points(points, "points")?;
        let count = read.rows::<3>().len();
        let triangles = array::indices::<3>(triangles, "triangles", count)?;
        let edges = feature_edges.map(|edges| array::indices::<2>(edges, "feature_edges", count)).transpose()?;
        let mesh = TriMesh { points: read.vectors(), triangles, attributes: array::attributes(attributes, count)? };
        Ok(PyMesh::new(mesh, edges.map(|edges| FeatureTags::from_edges(count, edges)), json!({})))
    }

    /// Vertex positions, (n, 3) float64, world units; a read-only view of the mesh's own memory.
    #[getter]
    fn points<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        view::vectors(&slf.get().body.mesh.points, slf.clone().into_any())
    }

    /// Vertex indices, (m, 3) uint32; a read-only view of the mesh's own memory.
    #[getter]
    fn triangles<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        view::rows(slf.get().body.mesh.triangles.as_flattened(), 3, slf.clone().into_any())
    }

    /// Named quantities per vertex: read-only views (n,) or (n, width) float32.
    #[getter]
    fn attributes<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        array::attribute_views(&slf.get().body.mesh.attributes, slf.as_any())
    }

    /// Sharp edges, (k, 2) uint32, or None where nobody has looked for them.
    #[getter]
    fn feature_edges<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArray2<u32>>>> {
        let tags = slf.get().body.tags.as_ref();
        tags.map(|tags| view::rows(tags.edges.as_flattened(), 2, slf.clone().into_any())).transpose()
    }

    /// What the stage that made the mesh tells of it: voxel, repairs, noise ...
    #[getter]
    fn facts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to(py, &self.facts)
    }

    /// Bounding box, (2, 3): least and greatest corner.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::corners(py, self.body.mesh.bounds())
    }

    /// Length of the bounding box's diagonal, world units.
    #[getter]
    fn diagonal(&self) -> f64 {
        self.body.mesh.bounds().diagonal()
    }

    /// Mean length of the edges, world units.
    #[getter]
    fn mean_edge(&self) -> f64 {
        self.body.mesh.mean_edge()
    }

    /// Unit vertex normals, (n, 3), weighted by the area of the triangles around.
    fn vertex_normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::vectors(py, py.detach(|| self.body.mesh.vertex_normals()))
    }

    /// What is in the mesh and what is wrong with it: counts, genus, area, volume, watertight, manifold ...
    fn diagnose<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to(py, &watch::sure(py, "diagnose", |_| mesh::diagnose(&self.body.mesh))?)
    }

    /// One manifold surface: vertices welded, triangles turned alike, slivers, tiny handles and holes gone.
    ///
    /// Returns a mesh whose `facts` count what was done. Raises MeshError.
    #[pyo3(signature = (*, progress=None))]
    fn repair(&self, py: Python, progress: Option<&Bound<PyAny>>) -> PyResult<PyMesh> {
        let body = &self.body;
        let (mesh, repairs) = watch::run(py, "repair", progress, |o| mend::repair(&body.mesh, o.one()))?;
        // Tags stay with the edges that are still there.
        let tags = body.tags.as_ref().map(|tags| {
            let sharp = tags.half_edges(&body.mesh, &mesh);
            let edge = |h: u32| [mesh.origin(h), mesh.origin(mesh::next(h))];
            let edges = (0..sharp.len() as u32).filter(|&h| sharp[h as usize]).map(edge);
            FeatureTags::from_edges(mesh.points.len(), edges)
        });
        Ok(PyMesh::new(mesh, tags, json!(repairs)))
    }

    /// Ragged borders cut even: what is narrower than twice `radius` (world units) goes, unless it is as large as 25 squares of it. For a
    /// manifold mesh; a closed one stays as it is.
    ///
    /// Returns a mesh whose `facts` tell `cut_share`, the part of the area that went. Raises ValueError for a radius that is not above 0.
    #[pyo3(signature = (radius, *, progress=None))]
    fn even_borders(&self, py: Python, radius: f64, progress: Option<&Bound<PyAny>>) -> PyResult<PyMesh> {
        if !(radius > 0.0 && radius.is_finite()) {
            return Err(PyValueError::new_err(format!("radius={radius}: a number above 0 is needed")));
        }
        let mut mesh = self.body.mesh.clone();
        let none = || FeatureTags::from_edges(mesh.points.len(), []);
        let mut tags = self.body.tags.clone().unwrap_or_else(none);
        let cut = watch::run(py, "borders", progress, |o| mend::even_borders(&mut mesh, &mut tags, radius, o.one()))?;
        let tags = self.body.tags.is_some().then_some(tags);
        Ok(PyMesh::new(mesh, tags, json!({ "cut_share": cut })))
    }

    /// The mesh in tiles: cubes of side `size`, by their place: tile (i, j, k) is the cube from `size * (i, j, k)` on. Each triangle is in
    /// the tile of its middle; vertices on the border of two tiles are the same numbers in both. Raises ValueError.
    fn tiles<'py>(&self, py: Python<'py>, size: f64) -> PyResult<Bound<'py, PyDict>> {
        let Body { mesh, tags, .. } = &*self.body;
        let none = FeatureTags::default();
        let mut parts = mesh::MeshParts::new(mesh, tags.as_ref().unwrap_or(&none));
        let made = PyDict::new(py);
        let cut = mesh::tiles(mesh, size, DVec3::ZERO).map_err(|e| PyValueError::new_err(e.to_string()))?;
        for ([i, j, k], faces) in cut {
            let part = parts.part(&faces);
            let tags = tags.is_some().then_some(part.tags);
            made.set_item((i, j, k), PyMesh::new(part.mesh, tags, json!({})))?;
        }
        Ok(made)
    }

    /// The mesh without its noise; sharp edges stay. Raises MeshError.
    #[pyo3(signature = (*, progress=None, **parameters))]
    fn smooth(
        &self,
        py: Python,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyMesh> {
        let mut given = Given::new("Mesh.smooth", parameters)?;
        let params = given.take()?;
        given.done()?;
        let Body { mesh, tags, .. } = &*self.body;
        let made = watch::run(py, "smooth", progress, |o| mesh::smooth(mesh, tags.as_ref(), &params, o.one()))?;
        let facts = json!({ "noise": made.noise, "kept": made.kept });
        Ok(PyMesh::new(made.mesh, tags.clone(), facts))
    }

    /// A mesh of fewer triangles; sharp edges stay. Raises MeshError.
    #[pyo3(signature = (*, progress=None, **parameters))]
    fn decimate(
        &self,
        py: Python,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyMesh> {
        let mut given = Given::new("Mesh.decimate", parameters)?;
        let params = given.take()?;
        given.done()?;
        let Body { mesh, tags, .. } = &*self.body;
        let made = watch::run(py, "decimate", progress, |o| mesh::decimate(mesh, tags.as_ref(), &params, o.one()))?;
        let facts = json!({ "self_intersections": made.self_intersections, "distance": made.distance });
        Ok(PyMesh::new(made.mesh, Some(made.tags), facts))
    }

    /// A closed mesh with sharp edges from this one, sound or not: rasterised and extracted anew.
    ///
    /// * voxel, resolution: edge of a cell in world units, or cells along the longest side (129)
    /// * memory: GB that the lattice may take (8)
    ///
    /// Raises FieldError, ContourError. Source: Kobbelt et al. 2001, section 5.3.
    #[pyo3(signature = (*, memory=None, progress=None, **parameters))]
    fn remesh(
        &self,
        py: Python,
        memory: Option<f64>,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyMesh> {
        let mut given = Given::new("Mesh.remesh", parameters)?;
        let spacing = given.take::<pipeline::ScanParams>()?.cells;
        let params: ContourParams = given.take()?;
        given.done()?;
        let sampling = sampling(spacing, memory)?;
        let made =
            watch::run(py, "mesh", progress, |o| contour::from_mesh(&self.body.mesh, sampling, &params, o.one()))?;
        Ok(PyMesh::meshed(made, json!({})))
    }

    /// A network of four-sided patches to start from, on the repaired mesh. Raises MeshError, LayoutError.
    #[pyo3(signature = (*, progress=None, **parameters))]
    fn layout(
        &self,
        py: Python,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyNetwork> {
        let mut given = Given::new("Mesh.layout", parameters)?;
        let params = given.take()?;
        given.done()?;
        let Body { mesh, tags, .. } = &*self.body;
        let made = watch::run(py, "layout", progress, |o| pipeline::layout(mesh, tags.as_ref(), &params, o.run()))?;
        Ok(PyNetwork::new(Body::new(made.mesh, None), made.network, json!({ "quality": made.quality })))
    }

    /// Grids, surfaces, seams and reliefs on this mesh: a model.
    ///
    /// * network: on the repaired mesh, as `layout` returns it; None for an automatic one
    /// * tolerance, control, per_curve: how fine the surfaces are; one of them
    ///
    /// Raises the error of the first stage that fails.
    #[pyo3(signature = (network=None, *, units="mm", progress=None, **parameters))]
    fn fit(
        &self,
        py: Python,
        network: Option<&PyNetwork>,
        units: &str,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyModel> {
        let params = pipeline_params("Mesh.fit", PipelineParams::default(), parameters)?;
        let units = words::units(units)?;
        let Body { mesh, tags, .. } = &*self.body;
        let fitted = match network {
            None => watch::run(py, "fit", progress, |o| pipeline::fit(mesh, tags.as_ref(), None, &params, o.run()))?,
            Some(network) => {
                let (mine, drawn) = (&self.body, &network.body);
                let repaired = |o: &dyn watch::Both| -> Result<_, PipelineError> {
                    let fits = Arc::ptr_eq(mine, drawn)
                        || mend::repair(&mine.mesh, o.one())?.0.triangles == drawn.mesh.triangles;
                    if !fits {
                        return Ok(None);
                    }
                    pipeline::fit(&drawn.mesh, None, Some(network.network.clone()), &params, o.run()).map(Some)
                };
                watch::run(py, "fit", progress, repaired)?.ok_or_else(|| other_mesh(py))?
            }
        };
        PyModel::fitted(fitted, &params, units)
    }

    /// A model with this mesh, repaired, and a network or nothing drawn on it: what `Model.edit` starts from.
    #[pyo3(signature = (network=None, *, units="mm"))]
    fn model(&self, py: Python, network: Option<&PyNetwork>, units: &str) -> PyResult<PyModel> {
        let units = words::units(units)?;
        let (mesh, network) = match network {
            Some(network) => (network.body.mesh.clone(), network.network.clone()),
            None => {
                let (mesh, _) = watch::run(py, "repair", None, |o| mend::repair(&self.body.mesh, o.one()))?;
                (mesh, Network::default())
            }
        };
        Ok(PyModel::new(planish::Model { mesh, network, units, ..Default::default() }))
    }

    /// Distances and normal errors between this surface and another: a dict of spreads (mean, rms, p95, max) in world
    /// units (`a_to_b`, `b_to_a`, `both`), as shares of the diagonal (`both_rel`) and in degrees (`normal_deg`).
    ///
    /// Raises CompareError.
    #[pyo3(signature = (other, *, progress=None, **parameters))]
    fn compare<'py>(
        &self,
        py: Python<'py>,
        other: &PyMesh,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut given = Given::new("Mesh.compare", parameters)?;
        let params = given.take()?;
        given.done()?;
        let (a, b) = (&self.body.mesh, &other.body.mesh);
        json::to(py, &watch::run(py, "compare", progress, |o| mesh::compare(a, b, &params, o.one()))?)
    }

    /// The mesh brought onto another mesh or a cloud: the best rigid fit. `facts` tells `linear` (3 x 3, rows) and `shift`, which
    /// bring a point there as `linear @ p + shift`, the `median` distance before and after in world units, and whether it `settled`.
    ///
    /// * near: start only from where the mesh is
    ///
    /// Raises CompareError, MeshError. Source: docs/methods/measuring.md.
    #[pyo3(signature = (other, *, near=false, progress=None))]
    fn align(&self, py: Python, other: &Bound<PyAny>, near: bool, progress: Option<&Bound<PyAny>>) -> PyResult<PyMesh> {
        let fixed = if let Ok(mesh) = other.cast::<PyMesh>() {
            Shape::Surface(mesh.get().body.mesh.clone())
        } else if let Ok(cloud) = other.cast::<PyCloud>() {
            Shape::Points(cloud.get().cloud.as_ref().clone())
        } else {
            return Err(PyTypeError::new_err("other: a Mesh or a Cloud is needed"));
        };
        let moving = Shape::Surface(self.body.mesh.clone());
        let params = AlignParams { near, ..AlignParams::default() };
        let found = watch::run(py, "align", progress, |o| register::align(&moving, &fixed, &params, o.one()))?;
        let mut mesh = self.body.mesh.clone();
        found.placement.mesh(&mut mesh);
        let linear = found.placement.linear.transpose().to_cols_array_2d();
        let facts = json!({
            "linear": linear, "shift": found.placement.shift.to_array(), "median": found.median,
            "rounds": found.rounds, "settled": found.settled,
        });
        Ok(PyMesh::new(mesh, self.body.tags.clone(), facts))
    }

    /// The places of the mesh nearest to points (k, 3): a dict of `position` (k, 3), `distance` (k,) in world units,
    /// `face` (k,) and `bary` (k, 3).
    fn closest<'py>(&self, py: Python<'py>, points: &Bound<PyAny>) -> PyResult<Bound<'py, PyDict>> {
        use rayon::prelude::*;
        self.refuse_empty(py)?;
        let read = array::points(points, "points")?;
        let rows = read.rows::<3>();
        let hits: Vec<_> = watch::sure(py, "closest", |_| {
            let bvh = self.body.bvh();
            rows.par_iter().map(|&p| bvh.closest(DVec3::from_array(p))).collect()
        })?;
        let found = PyDict::new(py);
        found.set_item("position", array::vectors(py, hits.iter().map(|h| h.position).collect())?)?;
        found.set_item("distance", PyArray1::from_iter(py, hits.iter().map(|h| h.distance)))?;
        array::places(py, &hits.iter().map(|h| h.place).collect::<Vec<_>>(), &found)?;
        Ok(found)
    }

    /// Principal curvatures at the vertices: a dict of `most` and `least` (n,) in 1 / world units, positive where the
    /// surface is convex, and `direction` (n, 3) of the first.
    fn curvature<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let body = &self.body;
        let all = watch::sure(py, "curvature", |_| vertex_curvature(&body.mesh, body.adjacency()))?;
        let found = PyDict::new(py);
        found.set_item("most", PyArray1::from_iter(py, all.iter().map(|c| c.most)))?;
        found.set_item("least", PyArray1::from_iter(py, all.iter().map(|c| c.least)))?;
        found.set_item("direction", array::vectors(py, all.iter().map(|c| c.direction).collect())?)?;
        Ok(found)
    }

    /// A short way over the surface between two positions (3,), each taken to its nearest place. Raises CurveError.
    fn geodesic(&self, py: Python, start: &Bound<PyAny>, end: &Bound<PyAny>) -> PyResult<PyCurve> {
        self.refuse_empty(py)?;
        let [start, end] = [array::vector(start, "start")?, array::vector(end, "end")?].map(|p| self.body.place(p));
        let body = &self.body;
        let points = watch::run(py, "curve", None, |_| connect(&body.mesh, body.adjacency(), start, end))?;
        Ok(PyCurve::new(body.clone(), planish::curve::SurfaceCurve::open(points)))
    }

    /// A stroke through picks (k, 3), each taken to its nearest place.
    ///
    /// * mode: "straight", "geodesic" or "magnetic" (drawn to creases)
    ///
    /// Raises CurveError. Source: Krishnamurthy 1998, section 3.2.
    #[pyo3(signature = (picks, *, closed=false, **parameters))]
    fn paint(
        &self,
        py: Python,
        picks: &Bound<PyAny>,
        closed: bool,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyCurve> {
        self.refuse_empty(py)?;
        let mut given = Given::new("Mesh.paint", parameters)?;
        let params = given.take()?;
        given.done()?;
        let read = array::points(picks, "picks")?;
        let places = self.places(read.rows());
        let body = &self.body;
        let curve = watch::run(py, "curve", None, |_| -> Result<_, CurveError> {
            let canvas = Canvas::with_adjacency(&body.mesh, body.adjacency().clone());
            let mut stroke = Stroke::new();
            for &place in &places {
                stroke.add(&canvas, place, &params, None)?;
            }
            if closed {
                stroke.close(&canvas, &params, None)?;
            }
            Ok(stroke.curve(&canvas))
        })?;
        Ok(PyCurve::new(body.clone(), curve))
    }

    /// The cut of the mesh by a plane, through the place nearest to `point` (3,). Raises CurveError.
    fn section(&self, py: Python, point: &Bound<PyAny>, normal: &Bound<PyAny>) -> PyResult<PyCurve> {
        self.refuse_empty(py)?;
        let (point, normal) = (array::vector(point, "point")?, array::vector(normal, "normal")?);
        let body = &self.body;
        let cut = |_: &dyn watch::Both| {
            let start = body.place(point);
            let point = start.position(&body.mesh);
            section::cut_plane(&body.mesh, body.adjacency(), point, normal, start.face)
        };
        Ok(PyCurve::new(body.clone(), watch::run(py, "curve", None, cut)?))
    }

    /// The boundaries of the mesh as closed curves.
    fn boundaries(&self, py: Python) -> PyResult<Vec<PyCurve>> {
        let body = &self.body;
        let curves = watch::sure(py, "curve", |_| section::boundaries(&body.mesh, body.adjacency()))?;
        Ok(curves.into_iter().map(|c| PyCurve::new(body.clone(), c)).collect())
    }

    /// Lines of edges whose faces meet at more than an angle, in degrees.
    #[pyo3(signature = (angle_deg=40.0))]
    fn sharp_lines(&self, py: Python, angle_deg: f64) -> PyResult<Vec<PyCurve>> {
        let body = &self.body;
        let curves = watch::sure(py, "curve", |_| {
            section::lines(&body.mesh, body.adjacency(), &mesh::sharp_edges(&body.mesh, body.adjacency(), angle_deg))
        })?;
        Ok(curves.into_iter().map(|c| PyCurve::new(body.clone(), c)).collect())
    }

    /// The plane of symmetry: a dict of `point`, `normal` (3 numbers each) and `miss`, the distance of the mesh to its
    /// image as a share of the diagonal. Raises CurveError.
    fn symmetry<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.refuse_empty(py)?;
        let find = |o: &dyn watch::Both| symmetry::find(&self.body.mesh, self.body.bvh(), o.one());
        let (plane, miss) = watch::run(py, "symmetry", None, find)?;
        json::to(py, &json!({ "point": plane.point.to_array(), "normal": plane.normal.to_array(), "miss": miss }))
    }

    /// A picture, (height, width, 4) uint8: red, green, blue, alpha. Raises RenderError.
    ///
    /// * eye: direction from the mesh towards the eye (3,); up: the one that points up (3,)
    #[pyo3(signature = (width=640, height=480, *, eye=None, up=None))]
    fn picture<'py>(
        &self,
        py: Python<'py>,
        width: usize,
        height: usize,
        eye: Option<&Bound<PyAny>>,
        up: Option<&Bound<PyAny>>,
    ) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let look = picture::View::of(eye, up)?;
        picture::draw(py, &self.body.mesh, Vec::new(), &look, [width, height])
    }

    /// Writes the mesh: .ply (with its sharp edges), .obj, .stl or .glb. Raises FileError.
    ///
    /// * units: "mm", "cm", "m" or "in"; up: the axis that points up, "y" or "z"
    #[pyo3(signature = (path, *, units="mm", up="y"))]
    fn write(&self, py: Python, path: PathBuf, units: &str, up: &str) -> PyResult<()> {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let options = WriteOptions { units: words::units(units)?, up: words::up(up)?, name };
        let Body { mesh, tags, .. } = &*self.body;
        let write = || match tags {
            Some(tags) => planish_io::write_tagged_mesh(&path, mesh, tags, &options),
            None => planish_io::write_mesh(&path, mesh, &options),
        };
        py.detach(write).map_err(|e| told_of(py, &path, &e))
    }

    /// As a trimesh.Trimesh.
    fn to_trimesh<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        neighbour::there(slf, "to_trimesh")
    }

    /// As an open3d.geometry.TriangleMesh.
    fn to_open3d<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        neighbour::there(slf, "to_open3d")
    }

    /// As a pyvista.PolyData.
    fn to_pyvista<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        neighbour::there(slf, "to_pyvista")
    }

    /// As a meshio.Mesh.
    fn to_meshio<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        neighbour::there(slf, "to_meshio")
    }

    fn __repr__(&self) -> String {
        let mesh = &self.body.mesh;
        let size = mesh.bounds().size().max(DVec3::ZERO);
        let sharp = self.body.tags.as_ref().map_or(String::new(), |t| format!(", {} sharp edges", t.edges.len()));
        let (n, m) = (mesh.points.len(), mesh.triangles.len());
        format!("<planish.Mesh: {n} vertices, {m} triangles{sharp}, {:.4} x {:.4} x {:.4}>", size.x, size.y, size.z)
    }

    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        neighbour::of(slf.as_any(), "planish._picture", "html")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        neighbour::of(slf.as_any(), "planish._pickle", "mesh")
    }
}

fn other_mesh(py: Python) -> PyErr {
    let message = "the network was made for another mesh - hint: use it with the mesh that it was made for".to_owned();
    crate::error::hinted(py, class::NetworkError::new_err(message.clone()), &message)
}
