//! Models: mesh, network, grids, surfaces, reliefs and how they came to be; edits, files.

use crate::error::{class, hinted, told, told_of};
use crate::network::told_faults;
use crate::objects::{Body, PyMesh, PyModel, PyNetwork, recorded};
use crate::params::pipeline_params;
use crate::surface::{PyGrid, PyRelief, PySurface};
use crate::{array, json, picture, relief, watch};
use numpy::{PyArray1, PyArray3};
use planish::edit::{self, ApplyError, Edit, Ground, Made, Redo, Undo};
use planish::mesh::TriMesh;
use planish::model::{Drawing, HistoryEntry, Model};
use planish::pipeline::{self, Assessed, Earlier, PipelineError, PipelineParams};
use planish::surface;
use planish_io::{ExportKind, StepInput, WriteError, WriteOptions};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

impl PyModel {
    fn body(&self) -> &Arc<Body> {
        self.body.get_or_init(|| Body::new(self.model.mesh.clone(), None))
    }

    /// The parameters that the model was made with.
    fn stored(&self) -> PyResult<PipelineParams> {
        let wrong =
            |e| PyValueError::new_err(format!("the model has parameters of another version ({e}); fit its mesh"));
        if self.model.params.is_empty() {
            return Ok(PipelineParams::default());
        }
        serde_json::from_str(&self.model.params).map_err(wrong)
    }

    /// The model after an edit.
    fn edited(&self, py: Python, edit: &Edit, progress: Option<&Bound<PyAny>>) -> PyResult<PyModel> {
        let mut model = self.model.clone();
        let made = match edit {
            Edit::Undo(Undo { count }) => moved(py, &mut model, *count, "undo", Model::undo)?,
            Edit::Redo(Redo { count }) => moved(py, &mut model, *count, "redo", Model::redo)?,
            edit => {
                let (drawing, made) = watch::run(py, "edit", progress, |o| -> Result<_, ApplyError> {
                    let mut drawing = model.drawing();
                    let made = edit::apply(&mut drawing, edit, &Ground::new(&model.mesh), &other, o.one())?;
                    Ok((drawing, made))
                })?;
                model.record(HistoryEntry { command: edit.name(), parameters: edit.parameters() }, drawing);
                made
            }
        };
        let mut next = PyModel::new(model);
        let faults = made.faults.map(|all| all.iter().map(|f| f.to_string()).collect::<Vec<_>>());
        next.found.edit = json!({
            "changed": made.changed, "corners": made.corners, "curves": made.curves, "features": made.features,
            "relaxed": made.relaxed, "faults": faults,
        });
        Ok(next)
    }

    /// The same model with what its last edit did.
    fn after(mut self, told: Value) -> PyModel {
        self.found.edit = told;
        self
    }

    /// The surface of the model that a word names.
    fn surface_of(&self, py: Python, word: &str) -> PyResult<TriMesh> {
        let model = &self.model;
        match word {
            "mesh" => Ok(model.mesh.clone()),
            "base" => watch::run(py, "mesh", None, |o| pipeline::surface_mesh(model, o.one())),
            "displaced" => watch::run(py, "mesh", None, |o| pipeline::displaced_mesh(model, o.one())),
            _ => Err(PyValueError::new_err(format!("surface={word:?}: \"displaced\", \"base\" or \"mesh\" is needed"))),
        }
    }
}

/// Takes edits back, or makes them again.
fn moved(py: Python, model: &mut Model, count: usize, word: &str, step: fn(&mut Model) -> bool) -> PyResult<Made> {
    let before = model.drawing();
    for _ in 0..count {
        if !step(model) {
            let message = format!("there is nothing left to {word} - hint: ask for fewer");
            return Err(hinted(py, class::EditError::new_err(message.clone()), &message));
        }
    }
    Ok(Made::between(&before, &model.drawing()))
}

/// Another model, for edits that carry its network over.
fn other(path: &str) -> Result<(TriMesh, Drawing), String> {
    let model = planish_io::read_model(path).map_err(|e| e.to_string())?;
    let drawing = model.drawing();
    Ok((model.mesh, drawing))
}

/// An edit from its dict.
fn parsed(step: Value) -> PyResult<Edit> {
    let name = step.get("edit").and_then(Value::as_str).unwrap_or("").to_owned();
    serde_json::from_value(step).map_err(|e| {
        let text = format!("{name}: {e}");
        if text.contains("unknown field") { PyTypeError::new_err(text) } else { PyValueError::new_err(text) }
    })
}

#[pymethods]
impl PyModel {
    /// Reads a project (.planish). Raises FileError.
    #[staticmethod]
    fn read(py: Python, path: PathBuf) -> PyResult<PyModel> {
        crate::files::model(py, &path)
    }

    /// Writes the project (.planish), whole or not at all. Raises FileError.
    fn save(&self, py: Python, path: PathBuf) -> PyResult<()> {
        py.detach(|| planish_io::write_model(&path, &self.model)).map_err(|e| told_of(py, &path, &e))
    }

    /// Writes the model in another program's format, by the extension. Raises FileError, and ReliefError if its parts do
    /// not belong together.
    ///
    /// * .step, .stp, .igs, .iges: the surfaces; .usda: the surfaces and a mesh; .ply, .obj, .stl, .glb: a mesh; .json: the
    ///   network; no extension: a folder of displacement maps (EXR)
    /// * .3dm by rhino3dm, .usdc and .usdz by usd-core, where these are installed
    /// * surface: which one a mesh format gets: "displaced", "base" or "mesh"; up: the axis that points up, "y" or "z"
    #[pyo3(signature = (path, *, surface="displaced", up="y"))]
    fn export(slf: &Bound<Self>, path: PathBuf, surface: &str, up: &str) -> PyResult<()> {
        let (this, py) = (slf.get(), slf.py());
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        if ["3dm", "usdc", "usdz"].contains(&extension.as_str()) {
            crate::words::up(up)?;
            return py.import("planish._formats")?.call_method1("export", (slf, path, surface, up)).map(drop);
        }
        let model = &this.model;
        let wrong = |e: WriteError| told_of(py, &path, &e);
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let options = WriteOptions { units: model.units, up: crate::words::up(up)?, name };
        let mesh = match planish_io::export_kind(&path).map_err(wrong)? {
            ExportKind::Mesh => Some(this.surface_of(py, surface)?),
            _ => None,
        };
        let patches = match planish_io::export_kind(&path).map_err(wrong)? {
            ExportKind::Usd => Some(watch::run(py, "export", None, |o| pipeline::displaced_patches(model, o.one()))?),
            _ => None,
        };
        let write = || match planish_io::export_kind(&path)? {
            ExportKind::Relief => planish_io::write_relief(&path, &model.reliefs, model.units),
            ExportKind::Network => planish_io::write_network(&path, &model.network, &model.mesh),
            ExportKind::Step => {
                let (network, surfaces) = (&model.network, model.surfaces.as_slice());
                let step = StepInput { network, surfaces, units: model.units, name: &options.name, time: None };
                planish_io::write_step(&path, &step).map(drop)
            }
            ExportKind::Iges | ExportKind::Usd => {
                planish_io::export(&path, model, || patches.unwrap_or_default()).map(drop)
            }
            ExportKind::Mesh => planish_io::write_mesh(&path, mesh.as_ref().unwrap_or(&model.mesh), &options),
        };
        py.detach(write).map_err(wrong)
    }

    /// The mesh that everything lies on.
    #[getter]
    fn mesh(&self) -> PyMesh {
        PyMesh::shared(self.body().clone())
    }

    /// Corners, curves and patches on the mesh.
    #[getter]
    fn network(&self) -> PyNetwork {
        PyNetwork::new(self.body().clone(), self.model.network.clone(), json!({}))
    }

    /// One grid per patch; empty until the model is fitted.
    #[getter]
    fn grids(&self) -> Vec<PyGrid> {
        self.model.grids.iter().cloned().map(PyGrid::new).collect()
    }

    /// One B-spline surface per patch; empty until the model is fitted.
    #[getter]
    fn surfaces(&self) -> Vec<PySurface> {
        self.model.surfaces.iter().map(|s| PySurface { surface: s.clone() }).collect()
    }

    /// One displacement map per patch; empty until the model is fitted.
    #[getter]
    fn reliefs(&self) -> Vec<PyRelief> {
        self.model.reliefs.iter().cloned().map(PyRelief::new).collect()
    }

    /// What one unit of a coordinate is: "mm", "cm", "m" or "in".
    #[getter]
    fn units(&self) -> &'static str {
        self.model.units.symbol()
    }

    /// Parameters of the stages that made the model.
    #[getter]
    fn params<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to(py, &serde_json::from_str::<Value>(&self.model.params).unwrap_or(json!({})))
    }

    /// The commands that led here, oldest first: dicts of `command` and `parameters`.
    #[getter]
    fn history<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let parsed = |text: &str| serde_json::from_str::<Value>(text).unwrap_or(json!({}));
        let one = |h: &HistoryEntry| json!({ "command": h.command, "parameters": parsed(&h.parameters) });
        json::to(py, &self.model.history.iter().map(one).collect::<Vec<_>>())
    }

    /// Figures of quality by key, as in report.json; empty for a model that was read (`assess` measures it).
    #[getter]
    fn quality<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to(py, &self.found.quality)
    }

    /// How the patches meet, one dict per curve: `gap_max` in world units, `angle_max_deg`, `length` ...
    #[getter]
    fn seams<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to(py, &self.found.seams)
    }

    /// What a user should know: dicts of `code`, `message`, `where`.
    #[getter]
    fn warnings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to(py, &self.found.warnings)
    }

    /// The stages that ran: dicts of `name`, `seconds`, `counts`.
    #[getter]
    fn stages<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to(py, &self.found.stages)
    }

    /// What the last edit did: `changed`, and numbers of `corners`, `curves`, `features`; `relaxed`; `faults` left.
    #[getter]
    fn facts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to(py, &self.found.edit)
    }

    /// What is left to do until every part of the mesh is a patch: a dict of `finished`, `patches`, `faults`.
    fn diagnose<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        told_faults(py, self.body(), &self.model.network)
    }

    /// The model after one edit; surfaces and reliefs are dropped, `fit` makes them anew.
    ///
    /// * name, fields: the edit and what it takes, as in a script of `planish edit` (docs/guide/edit.md), such as
    ///   `model.edit("drag_corner", corner=3, to=[1, 2, 3])`
    ///
    /// Raises EditError; TypeError and ValueError for fields that the edit does not have.
    #[pyo3(signature = (name, /, *, progress=None, **fields))]
    fn edit(
        &self,
        py: Python,
        name: &str,
        progress: Option<&Bound<PyAny>>,
        fields: Option<&Bound<PyDict>>,
    ) -> PyResult<PyModel> {
        let mut step = fields.map(|f| json::of(f.as_any())).transpose()?.unwrap_or(json!({}));
        step["edit"] = json!(name);
        self.edited(py, &parsed(step)?, progress)
    }

    /// The model after edits, one dict each with its name under "edit": as `edit`, one after the other.
    fn edit_all(&self, py: Python, steps: Vec<Bound<PyDict>>) -> PyResult<PyModel> {
        let edits = steps.iter().map(|s| parsed(json::of(s.as_any())?)).collect::<PyResult<Vec<_>>>()?;
        let mut model = PyModel { model: self.model.clone(), found: self.found.clone(), body: OnceLock::new() };
        for edit in &edits {
            model = model.edited(py, edit, None)?;
        }
        Ok(model)
    }

    /// The model before its last edits. Raises EditError if there are fewer.
    #[pyo3(signature = (count=1))]
    fn undo(&self, py: Python, count: usize) -> PyResult<PyModel> {
        self.edited(py, &Edit::Undo(Undo { count }), None)
    }

    /// The model with edits that were taken back made again. Raises EditError if there are fewer.
    #[pyo3(signature = (count=1))]
    fn redo(&self, py: Python, count: usize) -> PyResult<PyModel> {
        self.edited(py, &Edit::Redo(Redo { count }), None)
    }

    /// The model with surfaces, seams and reliefs made anew; with grids made anew, too, where an edit dropped them or a
    /// parameter of the grids is given. Raises the error of the first stage that fails.
    ///
    /// * keywords as of `Mesh.fit`; what is not given stays as the model has it
    #[pyo3(signature = (*, progress=None, **parameters))]
    fn fit(
        &self,
        py: Python,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyModel> {
        let stored = self.stored()?;
        let params = pipeline_params("Model.fit", stored.clone(), parameters)?;
        let same_grids = json!(params.grid) == json!(stored.grid);
        let gridded = !self.model.grids.is_empty() && same_grids;
        let mut model = self.model.clone();
        let earlier = if gridded { Earlier::of(&model) } else { None };
        let found = watch::run(py, "fit", progress, |o| -> Result<Assessed, PipelineError> {
            if !gridded {
                return pipeline::rework(&mut model, earlier.as_ref(), &params, o.run());
            }
            let mut stages = pipeline::refit(&mut model, &params, o.run())?;
            let found = pipeline::assess(&model, o.run())?;
            stages.extend(found.stages);
            Ok(Assessed { stages, ..found })
        })?;
        recorded(&mut model, if gridded { "refit" } else { "fit" }, &params)?;
        Ok(PyModel::new(model).with(found))
    }

    /// The model with its figures measured: those of one that was read. Raises CompareError, NetworkError.
    #[pyo3(signature = (*, progress=None))]
    fn assess(&self, py: Python, progress: Option<&Bound<PyAny>>) -> PyResult<PyModel> {
        let found = watch::run(py, "measure", progress, |o| pipeline::assess(&self.model, o.run()))?;
        Ok(PyModel::new(self.model.clone()).with(found))
    }

    /// The model with an edit of its relief: a stroke, a stamp, a filter ... as a layer. Raises ReliefError; TypeError and
    /// ValueError for fields that the edit does not have.
    ///
    /// * name, fields: the edit and what it takes, as in a script of `planish relief edit` (docs/guide/relief.md), such as
    ///   `model.edit_relief("scale", amount=2)`; also "undo" and "redo"
    #[pyo3(signature = (name, /, *, progress=None, **fields))]
    fn edit_relief(
        &self,
        py: Python,
        name: &str,
        progress: Option<&Bound<PyAny>>,
        fields: Option<&Bound<PyDict>>,
    ) -> PyResult<PyModel> {
        let (model, told) = relief::edited(py, &self.model, relief::step(name, fields)?, progress)?;
        Ok(PyModel::new(model).after(told))
    }

    /// The model with the detail of another of the same shape, as a layer: at each texel the displacement that the other has at
    /// the closest place of its surfaces, meant in space. `facts` tells `texels`, and how many `missed`. Raises ReliefError.
    ///
    /// * points: (n, 2, 3), n places on the other model and where each is on this one, for models of a similar, not equal shape;
    ///   displacements go along in the frame of the surface then
    /// * reach: further away than this nothing is taken over, world units; 2 % of the diagonal unless given, 10 % with points
    ///
    /// Source: Krishnamurthy 1998, figure 7.5; docs/methods/relief.md.
    #[pyo3(signature = (other, *, points=None, reach=None, progress=None))]
    fn transfer_relief(
        &self,
        py: Python,
        other: &PyModel,
        points: Option<&Bound<PyAny>>,
        reach: Option<f64>,
        progress: Option<&Bound<PyAny>>,
    ) -> PyResult<PyModel> {
        let (model, told) = relief::transferred(py, &self.model, &other.model, (reach, points), progress)?;
        Ok(PyModel::new(model).after(told))
    }

    /// The model with other displacement maps, one for each patch in the shapes that they have; what they change is a layer. At
    /// seams both sides take their mean. Raises ReliefError, ValueError.
    #[pyo3(signature = (reliefs, *, name="set"))]
    fn with_reliefs(&self, py: Python, reliefs: Vec<PyRef<PyRelief>>, name: &str) -> PyResult<PyModel> {
        Ok(PyModel::new(relief::replaced(py, &self.model, &reliefs, name)?))
    }

    /// The same shape with surfaces that hold all that is longer than `wavelength` (world units) and maps of the rest. Raises
    /// the error of the first stage that fails.
    ///
    /// Source: Krishnamurthy 1998, section 7.5.
    #[pyo3(signature = (wavelength, *, progress=None))]
    fn part_relief(&self, py: Python, wavelength: f64, progress: Option<&Bound<PyAny>>) -> PyResult<PyModel> {
        if !(wavelength > 0.0 && wavelength.is_finite()) {
            return Err(PyValueError::new_err(format!("wavelength={wavelength}: a length above 0 is needed")));
        }
        let (params, mut model) = (self.stored()?, self.model.clone());
        watch::run(py, "part", progress, |o| pipeline::part_at(&mut model, wavelength, &params, o.run()))?;
        let parameters = json!({ "wavelength": wavelength }).to_string();
        model.history.push(HistoryEntry { command: "relief part".into(), parameters });
        Ok(PyModel::new(model))
    }

    /// The same shape, with its edits, on surfaces of other numbers of control points. Raises the error of the first stage that
    /// fails.
    ///
    /// * keywords as of `Mesh.fit`
    ///
    /// Source: Krishnamurthy 1998, section 7.6.
    #[pyo3(signature = (*, progress=None, **parameters))]
    fn level_relief(
        &self,
        py: Python,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyModel> {
        let params = pipeline_params("Model.level_relief", self.stored()?, parameters)?;
        let mut model = self.model.clone();
        watch::run(py, "level", progress, |o| pipeline::relevel(&mut model, &params, o.run()))?;
        recorded(&mut model, "relief level", &params)?;
        Ok(PyModel::new(model))
    }

    /// The model on other surfaces of its network, one for each patch; the relief goes along. Where their borders are apart, both
    /// take the mean. Raises ReliefError and the error of the first stage that fails.
    #[pyo3(signature = (surfaces, *, progress=None))]
    fn deform(
        &self,
        py: Python,
        surfaces: Vec<PyRef<PySurface>>,
        progress: Option<&Bound<PyAny>>,
    ) -> PyResult<PyModel> {
        let wanted = self.model.surfaces.len();
        if surfaces.len() != wanted {
            let what = format!("surfaces: {} are given, and the model has {wanted}", surfaces.len());
            return Err(PyValueError::new_err(what));
        }
        let mut given: Vec<surface::Surface> = surfaces.iter().map(|s| s.surface.clone()).collect();
        pipeline::join(&self.model.network, &mut given).map_err(|e| told(py, &e))?;
        let mut model = watch::run(py, "deform", progress, |o| pipeline::deform(&self.model, given, o.one()))?;
        model.history.push(HistoryEntry { command: "deform".into(), parameters: "{}".into() });
        Ok(PyModel::new(model))
    }

    /// The places of the surfaces closest to points (n, 3): a dict of `patch` (n,), `uv` (n, 2), `point` (n, 3) and `distance`
    /// (n,), world units. Raises FitError, ReliefError for a model without surfaces.
    #[pyo3(signature = (points, *, progress=None))]
    fn closest<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<PyAny>,
        progress: Option<&Bound<PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        crate::surface::closest(py, &self.model.surfaces, points, progress)
    }

    /// A mesh of the model: "displaced" (all detail), "base" (the B-spline surfaces alone) or "mesh" (what it was fitted
    /// to). Raises ReliefError.
    #[pyo3(signature = (surface="displaced"))]
    fn surface_mesh(&self, py: Python, surface: &str) -> PyResult<PyMesh> {
        Ok(PyMesh::new(self.surface_of(py, surface)?, None, json!({})))
    }

    /// Angles between the patches along the seams, about every `step` (world units): a dict of `point` (k, 3),
    /// `angle_deg`, `length` (what each stands for, world units) and `curve` (k,).
    fn seam_angles<'py>(&self, py: Python<'py>, step: f64) -> PyResult<Bound<'py, PyDict>> {
        if !(step > 0.0 && step.is_finite()) {
            return Err(PyValueError::new_err(format!("step={step}: a length above 0 is needed")));
        }
        let model = &self.model;
        if model.surfaces.len() != model.network.patches.len() {
            return Err(told(py, &planish::surface::FitError::Malformed { what: "the model has no surfaces yet" }));
        }
        let all = watch::sure(py, "seams", |_| surface::seam_angles(&model.network, &model.surfaces, step))?;
        let found = PyDict::new(py);
        found.set_item("point", array::vectors(py, all.iter().map(|a| a.point).collect())?)?;
        found.set_item("angle_deg", PyArray1::from_iter(py, all.iter().map(|a| a.angle_deg)))?;
        found.set_item("length", PyArray1::from_iter(py, all.iter().map(|a| a.length)))?;
        found.set_item("curve", PyArray1::from_iter(py, all.iter().map(|a| a.curve)))?;
        Ok(found)
    }

    /// A picture of the displaced surfaces, or of the network while there are none; see `Mesh.picture`.
    #[pyo3(signature = (width=640, height=480, *, eye=None, up=None))]
    fn picture<'py>(
        &self,
        py: Python<'py>,
        width: usize,
        height: usize,
        eye: Option<&Bound<PyAny>>,
        up: Option<&Bound<PyAny>>,
    ) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let view = picture::View::of(eye, up)?;
        let lines = picture::lines(&self.model.mesh, &self.model.network);
        if self.model.surfaces.is_empty() {
            return picture::draw(py, &self.model.mesh, lines, &view, [width, height]);
        }
        picture::draw(py, &self.surface_of(py, "displaced")?, Vec::new(), &view, [width, height])
    }

    fn __repr__(&self) -> String {
        let Model { network, surfaces, mesh, units, .. } = &self.model;
        let control: usize = surfaces.iter().map(|s| s.control.len()).sum();
        let (patches, faces) = (network.patches.len(), mesh.triangles.len());
        let fitted = if surfaces.is_empty() { "no surfaces yet".into() } else { format!("{control} control points") };
        format!("<planish.Model: {patches} patches, {fitted}, on {faces} triangles, in {units}>")
    }

    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        crate::neighbour::of(slf.as_any(), "planish._picture", "html")
    }
}
