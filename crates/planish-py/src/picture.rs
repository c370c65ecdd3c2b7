//! Pictures by the library's ray caster.

use crate::{array, watch};
use numpy::{PyArray1, PyArray3, PyArrayMethods};
use planish::DVec3;
use planish::curve::SurfaceCurve;
use planish::mesh::TriMesh;
use planish::network::Network;
use planish::render::{self, Camera, Line, Look, Paint, RenderError};
use pyo3::prelude::*;

const CLAY: [u8; 3] = [206, 203, 196];
const SEAM: [u8; 3] = [40, 46, 54];
const SHARP: [u8; 3] = [192, 38, 38];
/// Width of drawn curves, pixels.
const LINE_WIDTH: f64 = 1.6;

/// From where a picture is seen.
pub struct View {
    eye: DVec3,
    up: DVec3,
}

impl View {
    /// The given directions; else as in reports.
    pub fn of(eye: Option<&Bound<PyAny>>, up: Option<&Bound<PyAny>>) -> PyResult<View> {
        let eye = eye.map(|e| array::vector(e, "eye")).transpose()?.unwrap_or(DVec3::new(0.62, 0.42, 1.0));
        let up = up.map(|u| array::vector(u, "up")).transpose()?.unwrap_or(DVec3::Y);
        Ok(View { eye, up })
    }
}

/// The curves of a network as lines: dark where smooth, red where sharp.
pub fn lines(mesh: &TriMesh, network: &Network) -> Vec<Line> {
    let line = |c: &planish::network::Curve| Line {
        points: SurfaceCurve::open(c.points.clone()).positions(mesh),
        color: if c.kind.is_smooth() { SEAM } else { SHARP },
        width: LINE_WIDTH,
    };
    network.curves.iter().map(line).collect()
}

/// Draws a mesh with lines on it: (height, width, 4) uint8.
pub fn draw<'py>(
    py: Python<'py>,
    mesh: &TriMesh,
    lines: Vec<Line>,
    view: &View,
    [width, height]: [usize; 2],
) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let image = watch::run(py, "picture", None, |_| -> Result<_, RenderError> {
        let aspect = width as f64 / height.max(1) as f64;
        let camera = Camera::fit(&mesh.bounds(), view.eye, view.up, aspect);
        let look = Look { paint: Paint::Plain(CLAY), lines, ..Look::default() };
        render::render(mesh, &look, &camera, width, height)
    })?;
    PyArray1::from_vec(py, image.rgba).reshape([image.height, image.width, 4])
}
