//! A fitted place of the surface: what [X03] §5 calls a CLOSED point. See `docs/methods/samples.md`, section 4.

use crate::cloud::Quadric;
use glam::DVec3;

/// Fits that guide others have an expected error below this share of the noise.
pub(crate) const GUIDE_ERROR_NOISE: f64 = 0.35;

/// A fitted sample of the surface: not oriented yet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit {
    pub quadric: Quadric,
    pub center: DVec3,
    pub normal: DVec3,
    /// Radius of the points it was fitted to, world units.
    pub radius: f64,
    /// Standard deviation of the points around it.
    pub noise: f64,
    /// That over the noise of the region, at least 1.
    pub thickness: f64,
    /// Expected error.
    pub error: f64,
    pub irregularity: f64,
    pub class: u8,
    /// The site it stands on.
    pub site: u32,
    /// Number of sheets of that site.
    pub sheets: u8,
    /// Distance to the other sheet of a plate or a gap, world units; infinite where there is none.
    pub gap: f64,
    /// Points that it explains better than its neighbours do.
    pub owned: u32,
}
