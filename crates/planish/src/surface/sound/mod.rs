//! Whether surfaces are sound: that none turns over (`turning`), and which cross (`crossing`). Both look at every place, not at
//! samples: by Bernstein coefficients, and by facets with a bound on what leaves them.

mod bezier;
mod crossing;
mod turning;

pub use crossing::{Crossing, Facet, crossings, facet_error};
pub use turning::{Turning, turning};
