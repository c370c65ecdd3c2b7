//! Meshes with the coordinates of maps: moved near the origin for the work, and back where the file can hold it.

use crate::failure::Failure;
use planish::DVec3;
use planish::mesh::{FeatureTags, TriMesh};
use planish::model::Model;
use planish::network::Network;
use planish::pipeline::{Input, Warning};
use planish::surface::Surface;
use planish_io::report::number;
use planish_io::{MappedMesh, WriteError, WriteOptions};
use std::path::Path;

/// Steps of single precision above this share of the diagonal are told: they are seen in the surface.
const COARSE: f64 = 1e-5;

/// A mesh as it was read, near the origin.
pub struct Placed {
    /// The mesh.
    pub mesh: TriMesh,
    /// Its sharp edges, if the file has them.
    pub tags: Option<FeatureTags>,
    /// What brings it back to its place.
    pub shift: DVec3,
    /// Step of its coordinates, if it is coarse against the mesh.
    coarse: Option<f64>,
}

impl Placed {
    /// Moves a mesh near the origin, if it is far from there.
    pub fn new(mut mesh: TriMesh, tags: Option<FeatureTags>) -> Placed {
        let bounds = mesh.bounds();
        let shift = planish_io::shift_of(&bounds);
        let step = planish_io::single_step(&mesh.points).filter(|step| *step > COARSE * bounds.diagonal());
        if shift != DVec3::ZERO {
            mesh.points.iter_mut().for_each(|p| *p -= shift);
        }
        Placed { mesh, tags, shift, coarse: step }
    }

    /// Reads a mesh.
    /// # Errors
    /// If the file is no usable mesh.
    pub fn read(path: &Path) -> Result<Placed, Failure> {
        let (mesh, tags) = crate::files::tagged_mesh(path)?;
        Ok(Placed::new(mesh, tags))
    }

    /// The mesh as an input of the pipeline.
    pub fn input(&self, network: Option<Network>) -> Input<'_> {
        Input::Mesh { mesh: &self.mesh, tags: self.tags.as_ref(), network }
    }

    /// That digits are missing in the input.
    pub fn warning(&self, unit: &str) -> Option<Warning> {
        let (step, diagonal) = (self.coarse?, self.mesh.bounds().diagonal());
        let text = format!(
            "The coordinates of the input have too few digits: they come in steps of {} {unit}, {} % of the diagonal. Write \
             it again in double precision, or near the origin.",
            number(step),
            number(100.0 * step / diagonal)
        );
        Some(Warning::new("digits_missing", text, ""))
    }
}

/// True if a file of this name holds the digits of far coordinates: PLY, OBJ and STEP do, STL and GLB have single precision.
pub fn holds(path: &Path) -> bool {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    !matches!(extension.as_str(), "stl" | "glb")
}

/// What to tell of files that stay near the origin.
/// * `which` - the files, as the beginning of a sentence
pub fn moved(shift: DVec3, which: &str) -> Option<Warning> {
    let [x, y, z] = shift.to_array();
    let text =
        format!("{which} near the origin, for its numbers have too few digits. Add {x} {y} {z} to be back in place.");
    (shift != DVec3::ZERO).then(|| Warning::new("coordinates_moved", text, ""))
}

/// Writes a mesh that was moved in its place, if the file can hold it; the warning tells of one that cannot.
/// # Errors
/// As [`planish_io::write_tagged_mesh`].
pub fn write(
    path: &Path,
    mesh: &TriMesh,
    tags: &FeatureTags,
    shift: DVec3,
    options: &WriteOptions,
) -> Result<Option<Warning>, WriteError> {
    if shift == DVec3::ZERO || !holds(path) {
        planish_io::write_tagged_mesh(path, mesh, tags, options)?;
        return Ok(moved(shift, "The mesh lies"));
    }
    let mut back = mesh.clone();
    back.points.iter_mut().for_each(|p| *p += shift);
    planish_io::write_tagged_mesh(path, &back, tags, options)?;
    Ok(None)
}

/// As [`write`], with what the format holds of patches: groups, texture coordinates.
/// # Errors
/// As [`planish_io::write_patches`].
pub fn write_patches(
    path: &Path,
    mesh: MappedMesh,
    shift: DVec3,
    options: &WriteOptions,
) -> Result<Option<Warning>, WriteError> {
    let is_moved = shift != DVec3::ZERO && !holds(path);
    let mesh = if is_moved { mesh } else { mesh.shifted(shift) };
    planish_io::write_patches(path, &mesh, options)?;
    Ok(if is_moved { moved(shift, "The mesh lies") } else { None })
}

/// The surfaces of a model in their place.
pub fn surfaces(model: &Model) -> Vec<Surface> {
    let mut surfaces = model.surfaces.clone();
    surfaces.iter_mut().flat_map(|s| &mut s.control).for_each(|p| *p += model.shift);
    surfaces
}
