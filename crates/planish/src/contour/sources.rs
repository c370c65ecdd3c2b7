//! From each kind of source to its mesh in one call: lattice, memory, field, extraction.
//!
//! See `docs/methods/fields.md` for the sources.

use super::{ContourError, ContourParams, Extracted, FieldCreases, extract};
use crate::field::{
    Directed, Field, FieldError, GridParams, Lattice, LatticeError, MeshField, Part, ScalarGrid, Spacing, Thin, sample,
    sample_grid,
};
use crate::mesh::TriMesh;
use crate::observe::{self, Observer};

/// Where the lattice lies and how much memory it may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Size of the cells.
    pub spacing: Spacing,
    /// Bytes that may be used.
    pub memory: u64,
}

/// Why a source gives no mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshingError {
    /// The field cannot be made.
    #[error("{0}")]
    Field(#[from] FieldError),
    /// The surface cannot be extracted.
    #[error("{0}")]
    Contour(#[from] ContourError),
    /// All numbers of a volume are on one side of its level.
    #[error("the samples run from {low} to {high}: the level {level} has no surface; choose a level between them")]
    Level {
        /// The level.
        level: f64,
        /// The least number.
        low: f32,
        /// The greatest number.
        high: f32,
    },
}

impl From<LatticeError> for MeshingError {
    fn from(error: LatticeError) -> MeshingError {
        MeshingError::Field(error.into())
    }
}

/// A mesh and the lattice it was extracted on.
#[derive(Clone, Debug)]
pub struct Meshed {
    /// The mesh with its features.
    pub extracted: Extracted,
    /// The lattice.
    pub lattice: Lattice,
    /// Hits that had to be guessed.
    pub mended: usize,
    /// What is too thin for the lattice; known of meshes only.
    pub thin: Thin,
}

/// Remeshes a triangle mesh, sound or not ([K01] §5.3).
/// # Errors
/// [`MeshingError`].
pub fn from_mesh(
    mesh: &TriMesh,
    sampling: Sampling,
    params: &ContourParams,
    observer: &dyn Observer,
) -> Result<Meshed, MeshingError> {
    let field = MeshField::new(mesh)?;
    let lattice = Lattice::around(&field.bounds(), sampling.spacing)?;
    let area = (0..mesh.triangles.len()).map(|t| mesh.area(t)).sum();
    lattice.check_memory(Some(area), sampling.memory)?;
    let directed = field.sample(&lattice, &observe::Part::new(observer, 0.0, 0.5))?;
    let creases = field.creases(&lattice, params.sharp);
    let extracted = extract(&directed, Some(&creases), params, &observe::Part::new(observer, 0.5, 0.5))?;
    Ok(meshed(extracted, &directed))
}

/// Meshes a tree of solids and meshes.
/// # Errors
/// [`MeshingError`].
pub fn from_part(
    part: &Part,
    sampling: Sampling,
    params: &ContourParams,
    observer: &dyn Observer,
) -> Result<Meshed, MeshingError> {
    if let Some(mesh) = part.as_mesh() {
        return from_mesh(mesh, sampling, params, observer);
    }
    let lattice = lattice_of(part, sampling)?;
    let directed = part.sample(&lattice, &observe::Part::new(observer, 0.0, 0.5))?;
    let creases = FieldCreases::new(part, params.sharp, params.corner);
    let extracted = extract(&directed, Some(&creases), params, &observe::Part::new(observer, 0.5, 0.5))?;
    Ok(meshed(extracted, &directed))
}

/// Meshes any point-wise field.
/// # Errors
/// [`MeshingError`].
pub fn from_field(
    field: &dyn Field,
    sampling: Sampling,
    params: &ContourParams,
    observer: &dyn Observer,
) -> Result<Meshed, MeshingError> {
    let lattice = lattice_of(field, sampling)?;
    on_lattice(field, &lattice, params, observer)
}

/// Meshes any point-wise field on a given lattice.
/// # Errors
/// [`MeshingError`].
pub fn on_lattice(
    field: &dyn Field,
    lattice: &Lattice,
    params: &ContourParams,
    observer: &dyn Observer,
) -> Result<Meshed, MeshingError> {
    let directed = sample(field, lattice, &observe::Part::new(observer, 0.0, 0.5))?;
    let creases = FieldCreases::new(field, params.sharp, params.corner);
    // Noisy gradients would lead the search for features astray.
    let exact = field.noise_deg() == 0.0;
    let creases: Option<&dyn crate::field::Creases> = if exact { Some(&creases) } else { None };
    let extracted = extract(&directed, creases, params, &observe::Part::new(observer, 0.5, 0.5))?;
    Ok(meshed(extracted, &directed))
}

/// Meshes a scalar grid on its own lattice.
/// # Errors
/// [`MeshingError`].
pub fn from_grid(
    grid: &ScalarGrid,
    grid_params: &GridParams,
    memory: u64,
    params: &ContourParams,
    observer: &dyn Observer,
) -> Result<Meshed, MeshingError> {
    let cells = grid.size.map(|n| n.saturating_sub(1));
    let own = Lattice { origin: grid.origin, step: grid.spacing, cells };
    own.check_memory(None, memory)?;
    let directed = sample_grid(grid, grid_params, &observe::Part::new(observer, 0.0, 0.5))?;
    let extracted = extract(&directed, None, params, &observe::Part::new(observer, 0.5, 0.5)).map_err(|e| {
        let known = || grid.values.iter().copied().filter(|v| v.is_finite());
        let (low, high) = (known().fold(f32::INFINITY, f32::min), known().fold(f32::NEG_INFINITY, f32::max));
        let level = grid_params.iso;
        match e {
            ContourError::Nothing { .. } if low <= high => MeshingError::Level { level, low, high },
            e => e.into(),
        }
    })?;
    Ok(meshed(extracted, &directed))
}

fn lattice_of(field: &dyn Field, sampling: Sampling) -> Result<Lattice, MeshingError> {
    let lattice = Lattice::around(&field.bounds(), sampling.spacing)?;
    lattice.check_memory(None, sampling.memory)?;
    Ok(lattice)
}

fn meshed(extracted: Extracted, directed: &Directed) -> Meshed {
    Meshed { extracted, lattice: directed.lattice, mended: directed.mended, thin: directed.thin }
}
