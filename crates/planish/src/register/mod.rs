//! Where shapes lie: moving them, cutting a part out, the best fit of one on another, and how far they are apart.
//!
//! 1. moves, and the best one between pairs of points: [`Placement`]   2. a plane's side of a shape: [`crop_mesh`]
//! 3. the closest place of a surface or a scan, and its side: [`Reference`]   4. best fit: [`align`]
//! 5. signed distances, their spread and histogram: [`deviation`]

mod align;
mod crop;
mod deviation;
mod placement;
mod reference;

pub use align::{AlignError, AlignParams, Aligned, align};
pub use crop::{HalfSpace, crop_cloud, crop_mesh};
pub use deviation::{Deviation, DeviationError, Histogram, column, deviation};
pub use placement::{Placement, PlacementError};
pub use reference::{Near, Reference, Shape};
