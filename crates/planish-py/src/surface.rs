//! Grids, B-spline surfaces and reliefs.

use crate::error::told;
use crate::objects::PyMesh;
use crate::{array, json, neighbour, view, watch};
use numpy::{PyArray1, PyArray2, PyArray3};
use planish::DVec3;
use planish::geom::FacePoint;
use planish::grid::Grid;
use planish::relief::{self, Relief};
use planish::surface::basis::uniform_knots;
use planish::surface::{self, Jet, Surface};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use serde_json::json;

/// A patch resampled to a regular grid of points on the mesh.
///
/// Grid(points, *, face, bary)
///
/// * points: (rows, cols, 3); `points[j, i]` has `i` along u and `j` along v
/// * face, bary: the same points as places on the mesh, row by row, (rows * cols,) uint32 and (rows * cols, 3); see `places`
///
/// Made by `Network.grids` and `Model.grids`, too.
#[pyclass(frozen, module = "planish", name = "Grid")]
pub struct PyGrid {
    /// The grid.
    pub grid: Grid,
}

impl PyGrid {
    /// A grid.
    pub fn new(grid: Grid) -> PyGrid {
        PyGrid { grid }
    }
}

#[pymethods]
impl PyGrid {
    #[new]
    #[pyo3(signature = (points, *, face, bary))]
    fn py_new(points: &Bound<PyAny>, face: &Bound<PyAny>, bary: &Bound<PyAny>) -> PyResult<PyGrid> {
        let read = array::reals(points, "points", &[0, 0, 3])?;
        array::finite(read.flat(), "points", 3)?;
        let (rows, cols) = (read.shape()[0], read.shape()[1]);
        if rows < 2 || cols < 2 {
            return Err(PyValueError::new_err(format!("points: {rows} x {cols} are no grid; give at least 2 x 2")));
        }
        let face = face.call_method1("reshape", ((-1, 1),))?;
        let face = array::indices::<1>(&face, "face", u32::MAX as usize)?;
        let bary = array::reals(bary, "bary", &[rows * cols, 3])?;
        if face.len() != rows * cols {
            return Err(PyValueError::new_err(format!("face: {} are needed, not {}", rows * cols, face.len())));
        }
        let place = |([face], &bary): (&[u32; 1], &[f64; 3])| FacePoint { face: *face, bary };
        let places = face.iter().zip(bary.rows::<3>()).map(place).collect();
        Ok(PyGrid::new(Grid { rows, cols, points: read.vectors(), places }))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        neighbour::of(slf.as_any(), "planish._pickle", "grid")
    }

    /// Positions, (rows, cols, 3), world units; a read-only view of the grid's own memory.
    #[getter]
    fn points<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let Grid { rows, cols, ref points, .. } = slf.get().grid;
        view::nodes(points, [rows, cols], slf.clone().into_any())
    }

    /// The same points as places on the mesh: a dict of `face` (rows * cols,) and `bary` (rows * cols, 3).
    #[getter]
    fn places<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(py);
        array::places(py, &self.grid.places, &found)?;
        Ok(found)
    }

    /// Points along v and along u.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.grid.rows, self.grid.cols)
    }

    fn __repr__(&self) -> String {
        format!("<planish.Grid: {} x {} points>", self.grid.rows, self.grid.cols)
    }
}

/// A bicubic B-spline surface over [0, 1]².
///
/// Surface(control, *, knots_u=None, knots_v=None)
///
/// * control: (rows, cols, 3), at least 4 x 4, rows along v; copied once
/// * knots_u, knots_v: (cols + 4,) and (rows + 4,), clamped, rising from 0 to 1; None for uniform ones
///
/// Raises FitError for what is no surface.
#[pyclass(frozen, module = "planish", name = "Surface")]
pub struct PySurface {
    /// The surface.
    pub surface: Surface,
}

/// The places of surfaces closest to points.
pub fn closest<'py>(
    py: Python<'py>,
    surfaces: &[Surface],
    points: &Bound<PyAny>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let read = array::points(points, "points")?;
    let points = read.vectors();
    let all = watch::run(py, "closest", progress, |o| relief::closest(surfaces, &points, o.one()))?;
    let found = PyDict::new(py);
    found.set_item("uv", array::rows(py, all.iter().map(|p| p.uv.to_array()).collect())?)?;
    found.set_item("point", array::vectors(py, all.iter().map(|p| p.point).collect())?)?;
    found.set_item("distance", PyArray1::from_iter(py, all.iter().map(|p| p.distance)))?;
    found.set_item("patch", PyArray1::from_iter(py, all.iter().map(|p| p.patch)))?;
    Ok(found)
}

/// One vector of a jet.
type Part = fn(&Jet) -> DVec3;

impl PySurface {
    /// What `of` tells of the surface at parameters (n, 2).
    fn each<T: Send>(
        &self,
        py: Python,
        uv: &Bound<PyAny>,
        of: impl Fn(&Surface, f64, f64) -> T + Sync + Send,
    ) -> PyResult<Vec<T>> {
        let read = array::reals(uv, "uv", &[0, 2])?;
        let rows = read.rows::<2>();
        if let Some(at) = rows.iter().position(|uv| !uv.iter().all(|x| (0.0..=1.0).contains(x))) {
            return Err(PyValueError::new_err(format!("uv[{at}]: {:?} is not from 0 to 1", rows[at])));
        }
        watch::sure(py, "surface", |_| {
            rows.par_iter().with_min_len(256).map(|&[u, v]| of(&self.surface, u, v)).collect()
        })
    }
}

#[pymethods]
impl PySurface {
    #[new]
    #[pyo3(signature = (control, *, knots_u=None, knots_v=None))]
    fn py_new(
        py: Python,
        control: &Bound<PyAny>,
        knots_u: Option<&Bound<PyAny>>,
        knots_v: Option<&Bound<PyAny>>,
    ) -> PyResult<PySurface> {
        let read = array::reals(control, "control", &[0, 0, 3])?;
        let (rows, cols) = (read.shape()[0], read.shape()[1]);
        let knots = |given: Option<&Bound<PyAny>>, name: &str, control: usize| match given {
            Some(given) => array::reals(given, name, &[0]).map(|k| k.flat().to_vec()),
            None => Ok(if control < surface::FEWEST_CONTROL { Vec::new() } else { uniform_knots(control) }),
        };
        let (knots_u, knots_v) = (knots(knots_u, "knots_u", cols)?, knots(knots_v, "knots_v", rows)?);
        let surface = Surface { rows, cols, control: read.vectors(), knots_u, knots_v };
        surface.check().map_err(|e| told(py, &e))?;
        Ok(PySurface { surface })
    }

    /// The surface nearest to a grid of points (rows, cols, 3) by least squares, with so many control points along v and
    /// along u. Raises FitError.
    ///
    /// Source: Krishnamurthy 1998, section 4.3.2, equation 4.4.
    #[staticmethod]
    fn fit(py: Python, points: &Bound<PyAny>, control: (usize, usize)) -> PyResult<PySurface> {
        let read = array::reals(points, "points", &[0, 0, 3])?;
        array::finite(read.flat(), "points", 3)?;
        let (rows, cols, points) = (read.shape()[0], read.shape()[1], read.vectors());
        let control = [control.0, control.1];
        let surface = watch::run(py, "surface", None, |_| surface::fit(&points, rows, cols, control))?;
        Ok(PySurface { surface })
    }

    /// Control points, (rows, cols, 3), world units; a read-only view of the surface's own memory.
    #[getter]
    fn control<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let Surface { rows, cols, ref control, .. } = slf.get().surface;
        view::nodes(control, [rows, cols], slf.clone().into_any())
    }

    /// Knots along u, (cols + 4,).
    #[getter]
    fn knots_u<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        view::numbers(&slf.get().surface.knots_u, slf.clone().into_any())
    }

    /// Knots along v, (rows + 4,).
    #[getter]
    fn knots_v<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        view::numbers(&slf.get().surface.knots_v, slf.clone().into_any())
    }

    /// Positions at parameters (n, 2), each from 0 to 1: (n, 3), world units.
    fn evaluate<'py>(&self, py: Python<'py>, uv: &Bound<PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::vectors(py, self.each(py, uv, |s, u, v| s.point(u, v))?)
    }

    /// Positions and derivatives at parameters (n, 2): a dict of `point`, `u`, `v`, `uu`, `uv`, `vv`, (n, 3) each.
    fn derivatives<'py>(&self, py: Python<'py>, uv: &Bound<PyAny>) -> PyResult<Bound<'py, PyDict>> {
        let jets = self.each(py, uv, Surface::jet)?;
        let found = PyDict::new(py);
        let parts: [(&str, Part); 6] = [
            ("point", |j| j.point),
            ("u", |j| j.u),
            ("v", |j| j.v),
            ("uu", |j| j.uu),
            ("uv", |j| j.uv),
            ("vv", |j| j.vv),
        ];
        for (name, part) in parts {
            found.set_item(name, array::vectors(py, jets.iter().map(part).collect())?)?;
        }
        Ok(found)
    }

    /// Unit normals at parameters (n, 2): (n, 3), outward; zero where the surface has none.
    fn normals<'py>(&self, py: Python<'py>, uv: &Bound<PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::vectors(py, self.each(py, uv, |s, u, v| s.jet(u, v).area_vector().normalize_or_zero())?)
    }

    /// Principal curvatures at parameters (n, 2): (n, 2), the larger first, 1 / world units; NaN where there are none.
    fn curvatures<'py>(&self, py: Python<'py>, uv: &Bound<PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::rows(py, self.each(py, uv, |s, u, v| s.jet(u, v).curvatures().unwrap_or([f64::NAN; 2]))?)
    }

    /// The places of the surface closest to points (n, 3): a dict of `uv` (n, 2), each from 0 to 1, `point` (n, 3) and `distance`
    /// (n,), world units. Raises FitError.
    ///
    /// Where two sheets of it lie about equally far from a point, it may be that of the other sheet.
    ///
    /// Source: Piegl and Tiller 1997, section 6.1.
    #[pyo3(signature = (points, *, progress=None))]
    fn closest<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<PyAny>,
        progress: Option<&Bound<PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let found = closest(py, std::slice::from_ref(&self.surface), points, progress)?;
        // There is but one.
        found.del_item("patch")?;
        Ok(found)
    }

    /// Positions at all pairs of `us` (m,) and `vs` (n,), from 0 to 1: (n, m, 3), world units. Far faster than one by one.
    fn sample<'py>(
        &self,
        py: Python<'py>,
        us: &Bound<PyAny>,
        vs: &Bound<PyAny>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let [us, vs] = [array::reals(us, "us", &[0])?, array::reals(vs, "vs", &[0])?];
        for (name, all) in [("us", us.flat()), ("vs", vs.flat())] {
            if let Some(at) = all.iter().position(|x| !(0.0..=1.0).contains(x)) {
                return Err(PyValueError::new_err(format!("{name}[{at}]: {} is not from 0 to 1", all[at])));
            }
        }
        let (us, vs) = (us.flat(), vs.flat());
        let points = watch::sure(py, "surface", |_| self.surface.sample(us, vs, [0, 0]))?;
        array::nodes(py, points, [vs.len(), us.len()])
    }

    /// The displacement map that leads from the surface to a grid. Raises ReliefError.
    fn bake(&self, py: Python, grid: &PyGrid) -> PyResult<PyRelief> {
        let relief = relief::bake(&grid.grid, &self.surface).map_err(|e| told(py, &e))?;
        Ok(PyRelief::new(relief))
    }

    /// Positions of the surface with its displacement, (rows, cols, 3), world units. Raises ReliefError.
    fn displace<'py>(&self, py: Python<'py>, relief: &PyRelief) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let Relief { rows, cols, .. } = relief.relief;
        let points = watch::run(py, "relief", None, |_| relief::displace(&self.surface, &relief.relief))?;
        array::nodes(py, points, [rows, cols])
    }

    /// How far the surface is from the points of a grid at their parameters: a dict of `max`, `rms`, `p95`, world units.
    fn deviation<'py>(&self, py: Python<'py>, grid: &PyGrid) -> PyResult<Bound<'py, PyAny>> {
        json::to(py, &watch::sure(py, "surface", |_| surface::deviation_of(&self.surface, &grid.grid))?)
    }

    /// A mesh of (rows, cols) points of the surface. Raises ReliefError.
    #[pyo3(signature = (rows=33, cols=33))]
    fn mesh(&self, py: Python, rows: usize, cols: usize) -> PyResult<PyMesh> {
        let [us, vs] = [cols, rows].map(surface::basis::uniform_parameters);
        let make = |_: &dyn watch::Both| relief::patch_mesh(self.surface.sample(&us, &vs, [0, 0]), rows, cols);
        Ok(PyMesh::new(watch::run(py, "mesh", None, make)?, None, json!({})))
    }

    /// As a scipy.interpolate.NdBSpline: called with (v, u), returns positions.
    fn to_scipy<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        neighbour::there(slf, "surface_to_scipy")
    }

    /// As a dict in the manner of geomdl: degrees, sizes, control points (v fastest), knot vectors.
    fn to_geomdl<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        neighbour::there(slf, "surface_to_geomdl")
    }

    /// As a splipy.Surface.
    fn to_splipy<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        neighbour::there(slf, "surface_to_splipy")
    }

    fn __repr__(&self) -> String {
        format!("<planish.Surface: {} x {} control points>", self.surface.rows, self.surface.cols)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        neighbour::of(slf.as_any(), "planish._pickle", "surface")
    }
}

/// A vector displacement map: at each node of a grid (t, b, n) in the frame of the surface there.
///
/// Relief(vectors)
///
/// * vectors: (rows, cols, 3), world units: along the u tangent, the normal x tangent, and the normal; copied once
#[pyclass(frozen, module = "planish", name = "Relief")]
pub struct PyRelief {
    relief: Relief,
}

impl PyRelief {
    /// A relief.
    pub fn new(relief: Relief) -> PyRelief {
        PyRelief { relief }
    }

    /// That of the library.
    pub fn relief(&self) -> &Relief {
        &self.relief
    }
}

#[pymethods]
impl PyRelief {
    #[new]
    fn py_new(vectors: &Bound<PyAny>) -> PyResult<PyRelief> {
        let read = array::reals(vectors, "vectors", &[0, 0, 3])?;
        array::finite(read.flat(), "vectors", 3)?;
        Ok(PyRelief::new(Relief { rows: read.shape()[0], cols: read.shape()[1], vectors: read.vectors() }))
    }

    /// Displacements, (rows, cols, 3), world units; a read-only view of the map's own memory.
    #[getter]
    fn vectors<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let Relief { rows, cols, ref vectors } = slf.get().relief;
        view::nodes(vectors, [rows, cols], slf.clone().into_any())
    }

    /// Nodes along v and along u.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.relief.rows, self.relief.cols)
    }

    /// Indices (k,) of the nodes where the displaced surface may fold over, in the order of `vectors`. Raises ReliefError.
    fn fold_over<'py>(&self, py: Python<'py>, surface: &PySurface) -> PyResult<Bound<'py, PyArray1<u64>>> {
        let found = watch::run(py, "relief", None, |_| relief::fold_over(&surface.surface, &self.relief))?;
        Ok(PyArray1::from_iter(py, found.into_iter().map(|i| i as u64)))
    }

    fn __repr__(&self) -> String {
        let most = self.relief.vectors.iter().map(|v| v.length()).fold(0.0, f64::max);
        format!("<planish.Relief: {} x {} nodes, longest {most:.3e}>", self.relief.rows, self.relief.cols)
    }
}
