//! Reading by the extension.

use crate::cloud::PyCloud;
use crate::error::{class, told_of};
use crate::field::{PyField, PyVolume};
use crate::objects::{PyMesh, PyModel};
use planish_io::script::Script;
use planish_io::{MeshFormat, ScanOptions};
use pyo3::prelude::*;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Reads a file by its extension, as the commands do:
///
/// * a scan (.e57 .las .laz .pcd .xyz .txt .csv .asc .pts .npz .conf, .ply without faces, .npy of rows): Cloud
/// * a mesh (.ply .obj .stl .glb .gltf, .step .stp as triangles): Mesh
/// * a volume (.nrrd, .npy with three axes): Volume
/// * a script of solids or a milling job (.toml): Field
/// * a project (.planish): Model
///
/// columns: those of a text scan, letters (xyzirgb, n for a normal, _ skips) or names parted by commas; classes: those
/// of a LAS scan that are kept. Raises FileError.
#[pyfunction]
#[pyo3(signature = (path, *, columns=None, classes=None))]
pub fn read(py: Python, path: PathBuf, columns: Option<String>, classes: Option<Vec<u8>>) -> PyResult<Py<PyAny>> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let path = path.as_path();
    if extension == "planish" {
        return to_py(py, model(py, path)?);
    }
    if extension == "toml" {
        return to_py(py, script(py, path)?);
    }
    let is_scan = planish_io::is_scan(path);
    if planish_io::is_grid(path) && !is_scan {
        let grid = py.detach(|| planish_io::read_grid(path)).map_err(|e| told_of(py, path, &e))?;
        return to_py(py, PyVolume::new(grid));
    }
    if is_scan {
        let options = ScanOptions { columns, classes: classes.unwrap_or_default() };
        let cloud = py.detach(|| planish_io::read_scan(path, &options)).map_err(|e| told_of(py, path, &e))?;
        return to_py(py, PyCloud::new(cloud));
    }
    if MeshFormat::of(path).is_none() {
        let list = |all: &[&str]| all.iter().map(|e| format!(".{e}")).collect::<Vec<_>>().join(", ");
        let message = format!(
            "{}: unknown extension \"{extension}\" - hint: meshes are {}; scans {}; volumes .nrrd, .npy; scripts .toml; projects .planish",
            path.display(),
            list(&MeshFormat::ALL.map(MeshFormat::extension)),
            list(&planish_io::SCAN_EXTENSIONS)
        );
        return Err(crate::error::hinted(py, class::FileError::new_err(message.clone()), &message));
    }
    let (mesh, tags) = py.detach(|| planish_io::read_tagged_mesh(path)).map_err(|e| told_of(py, path, &e))?;
    to_py(py, PyMesh::new(mesh, tags, json!({})))
}

fn to_py<T: pyo3::PyClass + Into<PyClassInitializer<T>>>(py: Python, object: T) -> PyResult<Py<PyAny>> {
    Ok(Py::new(py, object)?.into_any())
}

/// Reads a project.
/// # Errors
/// FileError.
pub fn model(py: Python, path: &Path) -> PyResult<PyModel> {
    let model = py.detach(|| planish_io::read_model(path)).map_err(|e| told_of(py, path, &e))?;
    Ok(PyModel::new(model))
}

fn script(py: Python, path: &Path) -> PyResult<PyField> {
    let file = py.detach(|| planish_io::script::read_script(path)).map_err(|e| told_of(py, path, &e))?;
    Ok(match file.script {
        Script::Part(part) => PyField::part(part),
        Script::Job(job) => PyField::new(Box::new(job), "a milling job"),
    })
}
