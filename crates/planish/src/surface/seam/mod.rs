//! How the surfaces of neighbours meet.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §8.1.
//! 1. planes at corners - `corner`      2. curves in them - `curve`      3. edges that were not found - `meet`
//! 4. one system of all seams - `stitch`: `work`, `miss`, `motion` (what is unknown), `wish` and `bend` (angles), `ring` (what
//!    moves cost), `system`, `sums`      5. bounds on what is left - `certificate`

pub(super) mod bend;
pub(super) mod certificate;
pub(super) mod corner;
mod curve;
mod meet;
pub(super) mod miss;
mod motion;
mod params;
mod ring;
mod stitch;
mod sums;
mod system;
mod wish;
mod work;

pub use meet::{EDGE_ANGLE_DEG, EdgeInSeam, edges_in_seams};
pub use params::{BENT_DEG, StitchParams};
pub use stitch::{stitch, stitch_near};
