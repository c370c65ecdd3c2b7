//! Made input: meshes of known shape, parts, and scanners that see them with all the faults of real ones.
//!
//! A machined or cast part is a form of solids that is meshed on its exact edges: its sharp edges are chains
//! of mesh edges at their true angle, its fillets are smooth. A seed moves the dimensions, so that three seeds are three
//! parts of one kind.

mod bracket;
mod casting;
mod demo;
mod even_scan;
mod form;
mod rings;
mod scanner;
pub mod shapes;

pub use bracket::bracket;
pub use casting::casting;
pub use demo::demo;
pub use even_scan::even_scan;
pub use scanner::{ScannerParams, VirtualScan, virtual_scan};

use crate::contour::{ContourParams, MeshingError, Sampling, from_field};
use crate::field::Spacing;
use crate::geom::random;
use crate::mesh::TriMesh;
use crate::observe::Silent;
use form::Form;

/// Memory for the lattice of a part, bytes.
const MEMORY: u64 = 2 << 30;

/// Meshes a form with `cells` cells along its longest side.
fn mesh(form: &Form, cells: usize) -> Result<TriMesh, MeshingError> {
    let sampling = Sampling { spacing: Spacing::Resolution(cells), memory: MEMORY };
    let mut mesh = from_field(form, sampling, &ContourParams::default(), &Silent)?.extracted.mesh;
    mesh.attributes.clear();
    Ok(mesh)
}

/// Dimension number `counter` of a seed: `usual`, up to a share `spread` more or less.
fn dimension(seed: u64, counter: u64, usual: f64, spread: f64) -> f64 {
    usual * (1.0 + spread * (2.0 * random::unit(seed, counter) - 1.0))
}
