//! A sample as others see it.

use super::Sample;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A sample without its fit: where it stands, and what is known there. Fields as of [`Sample`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Stand {
    pub center: DVec3,
    pub normal: DVec3,
    pub area: f64,
    pub radius: f64,
    pub support: f64,
    pub noise: f64,
    pub irregularity: f64,
    pub confidence: f64,
    pub plate: bool,
    /// Body that it belongs to: of the scan, or of a brick as long as it is one's own.
    pub segment: u32,
}

impl Stand {
    pub fn of(s: &Sample) -> Stand {
        let Sample { center, normal, area, radius, support, noise, irregularity, confidence, plate, segment, .. } = *s;
        Stand { center, normal, area, radius, support, noise, irregularity, confidence, plate, segment }
    }
}
