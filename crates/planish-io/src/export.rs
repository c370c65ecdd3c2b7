//! A model as what its file name asks for.

use crate::{
    IgesInput, MappedMesh, MeshFormat, StepInput, UsdInput, WriteError, WriteOptions, write_iges, write_mesh,
    write_network, write_patches, write_relief, write_step, write_usd,
};
use planish::Model;
use planish::mesh::TriMesh;
use planish::relief::PatchedMesh;
use std::path::Path;

/// What a file name asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportKind {
    /// `.step`, `.stp`: the surfaces.
    Step,
    /// `.igs`, `.iges`: the surfaces.
    Iges,
    /// `.usda`: the surfaces and their mesh.
    Usd,
    /// `.ply`, `.obj`, `.stl`, `.glb`: the displaced surface as a mesh.
    Mesh,
    /// `.json`: the network.
    Network,
    /// No extension, or a folder that is there: a folder with the displacement maps.
    Relief,
}

/// What the name of `path` asks for.
/// # Errors
/// `WriteError::UnknownExtension`, which lists the known ones.
pub fn export_kind(path: impl AsRef<Path>) -> Result<ExportKind, WriteError> {
    let path = path.as_ref();
    let extension = crate::mesh_file::extension(path);
    match extension.to_ascii_lowercase().as_str() {
        "step" | "stp" => Ok(ExportKind::Step),
        "igs" | "iges" => Ok(ExportKind::Iges),
        "usda" => Ok(ExportKind::Usd),
        "json" => Ok(ExportKind::Network),
        _ if MeshFormat::of(path).is_some_and(|f| f != MeshFormat::Gltf) => Ok(ExportKind::Mesh),
        "" => Ok(ExportKind::Relief),
        _ if path.is_dir() => Ok(ExportKind::Relief),
        _ => Err(WriteError::UnknownExtension {
            extension,
            known: ".step, .stp, .igs, .iges, .usda, .ply, .obj, .stl, .glb, .json for the network, or a folder for the displacement maps"
                .into(),
        }),
    }
}

/// Writes `model` as the name of `path` asks for (see [`ExportKind`]).
/// * `displaced` - makes the displaced surface; called only if a mesh is asked for
/// # Errors
/// Those of [`write_step`], [`write_iges`], [`write_usd`], [`write_mesh`], [`write_network`], [`write_relief`] and [`export_kind`].
pub fn export(
    path: impl AsRef<Path>,
    model: &Model,
    displaced: impl FnOnce() -> PatchedMesh,
) -> Result<ExportKind, WriteError> {
    let path = path.as_ref();
    let kind = export_kind(path)?;
    match kind {
        ExportKind::Step => {
            let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
            let (network, surfaces) = (&model.network, model.surfaces.as_slice());
            write_step(path, &StepInput { network, surfaces, units: model.units, name: &name, time: None })?;
        }
        ExportKind::Iges => {
            let name = &options(path, model).name;
            let (network, surfaces) = (&model.network, model.surfaces.as_slice());
            write_iges(path, &IgesInput { network, surfaces, units: model.units, name })?;
        }
        ExportKind::Usd => {
            let mesh = MappedMesh::new(displaced(), &model.reliefs);
            let (surfaces, mesh) = (model.surfaces.as_slice(), Some(("displaced", &mesh)));
            write_usd(
                path,
                &UsdInput { surfaces, mesh, shift: model.shift, materials: &[], options: &options(path, model) },
            )?;
        }
        ExportKind::Mesh => {
            write_patches(path, &MappedMesh::new(displaced(), &model.reliefs), &options(path, model))?;
        }
        ExportKind::Network => write_network(path, &model.network, &model.mesh)?,
        ExportKind::Relief => write_relief(path, &model.reliefs, model.units)?,
    }
    Ok(kind)
}

/// Writes a mesh of `model` with its unit; the object is named after the file.
/// # Errors
/// Those of [`write_mesh`].
pub fn export_mesh(path: impl AsRef<Path>, mesh: &TriMesh, model: &Model) -> Result<(), WriteError> {
    let path = path.as_ref();
    write_mesh(path, mesh, &options(path, model))
}

fn options(path: &Path, model: &Model) -> WriteOptions {
    let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    WriteOptions { units: model.units, name, ..Default::default() }
}
