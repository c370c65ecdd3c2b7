//! Samples as a field: the blend of their cells.
//!
//! [X03] Xie et al. 2003, §4.2. Far from all samples the field is unknown, or, where holes are to be closed, follows the
//! winding number of the samples.

use super::Field;
use crate::cloud::{Blend, Dipoles, Samples};
use crate::geom::Aabb;
use glam::DVec3;
use rayon::prelude::*;

/// The pseudo-distance changes by at most this much per length near the surface.
const STEEP: f64 = 1.2;
/// From this share of the support on a point is beside the data: cells stand less than .38 supports apart.
const BESIDE: f64 = 0.42;
/// A winding number closer to one half than this says nothing beside cells, and twice as far off all.
const UNSURE: f64 = 0.15;
/// From this share on the winding number decides alone.
const BEYOND: f64 = 0.84;

/// Points in a row that are asked by one thread.
const CHUNK: usize = 64;

/// The blended field of oriented samples.
pub struct SampleField {
    blend: Blend,
    bounds: Aabb,
    /// Widest support.
    widest: f64,
    noise_deg: f64,
    /// Winding number of the samples, where holes are closed.
    closing: Option<Dipoles>,
}

impl SampleField {
    /// The field of `samples`. With `close`, places without data get their side from the winding number.
    pub fn new(samples: &Samples, close: bool) -> SampleField {
        let widest = samples.cells.iter().map(|s| s.support).fold(0.0, f64::max);
        let mut bounds = Aabb::of(samples.samples.iter().map(|s| &s.center));
        bounds.min -= DVec3::splat(0.5 * widest);
        bounds.max += DVec3::splat(0.5 * widest);
        let closing = close
            .then(|| Dipoles::new(&samples.samples.iter().map(|s| (s.center, s.normal * s.area)).collect::<Vec<_>>()));
        SampleField { blend: Blend::new(&samples.cells), bounds, widest, noise_deg: samples.normal_noise_deg, closing }
    }

    /// Value and unit gradient at `p`; NaN where nothing is known.
    pub fn evaluate(&self, p: DVec3) -> (f64, DVec3) {
        let (value, normal, _) = self.evaluate_at(p, true);
        (value, normal)
    }

    /// And whether `p` is in the midst of data; where no cell reaches the gradient only if asked for.
    fn evaluate_at(&self, p: DVec3, slope: bool) -> (f64, DVec3, bool) {
        let Some(here) = self.blend.at(p) else {
            let (value, normal) = self.beyond(p, slope);
            return (value, normal, false);
        };
        // Away from the data the samples together know better than a fit carried on beyond its points: from the cells to
        // the winding number without a step, so that the surface goes on smoothly over a hole.
        if here.aside > BESIDE * BESIDE
            && let Some(dipoles) = &self.closing
        {
            let far = ((here.aside.sqrt() - BESIDE) / (BEYOND - BESIDE)).min(1.0);
            let share = far * far * (3.0 - 2.0 * far);
            let size = self.blend.cells()[here.cell].support;
            // Beside the data the number has no more than its bounds; close to single dipoles it leaves them.
            let winding = |p: DVec3| (0.5 - dipoles.number(p, 0.0)).clamp(-0.5, 0.5) * size;
            let beyond = winding(p);
            // Where both agree on the side the cells know the distance.
            if beyond * here.value > 0.0 {
                return (here.value, here.normal, false);
            }
            let share = share * ((beyond.abs() / size - UNSURE) / UNSURE).clamp(0.0, 1.0);
            let value = here.value + share * (beyond - here.value);
            if !slope {
                return (value, here.normal, false);
            }
            let g = gradient(winding, p, STENCIL * size).unwrap_or(here.normal);
            return (value, here.normal.lerp(g, share).normalize_or(here.normal), false);
        }
        (here.value, here.normal, here.aside <= BESIDE * BESIDE)
    }

    /// Where no cell reaches.
    fn beyond(&self, p: DVec3, slope: bool) -> (f64, DVec3) {
        match &self.closing {
            None => (f64::NAN, DVec3::ZERO),
            Some(dipoles) => {
                let value = |p: DVec3| (0.5 - dipoles.number(p, 0.0)) * self.widest;
                if !slope {
                    return (value(p), DVec3::ZERO);
                }
                (value(p), gradient(value, p, STENCIL * self.widest).unwrap_or(DVec3::ZERO))
            }
        }
    }
}

/// Step of differences of the winding number, in supports: dipoles are about a quarter of one apart.
const STENCIL: f64 = 0.1;

/// Unit gradient by central differences.
fn gradient(value: impl Fn(DVec3) -> f64, p: DVec3, e: f64) -> Option<DVec3> {
    let along = |d: DVec3| value(p + d * e) - value(p - d * e);
    DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)).try_normalize()
}

impl Field for SampleField {
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn value(&self, p: DVec3) -> f64 {
        self.evaluate_at(p, false).0
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        self.evaluate(p).1
    }

    fn values(&self, points: &[DVec3], values: &mut [f64]) {
        values.par_chunks_mut(CHUNK).zip(points.par_chunks(CHUNK)).for_each(|(values, points)| {
            // What the value at one point leaves at the next: the same side, and no distance is too long.
            let mut left: Option<(DVec3, f64)> = None;
            for (v, &p) in values.iter_mut().zip(points) {
                if let Some((q, d)) = left {
                    let rest = d.abs() - STEEP * p.distance(q);
                    if rest > 0.0 {
                        *v = rest.copysign(d);
                        continue;
                    }
                }
                let (value, _, amid) = self.evaluate_at(p, false);
                *v = value;
                // Where holes stay open the next point may be beside the data.
                left = (amid && self.closing.is_some()).then_some((p, value));
            }
        });
    }

    fn crosses(&self, aabb: &Aabb) -> bool {
        let (value, _, amid) = self.evaluate_at(aabb.center(), false);
        // Only in the midst of data the value is a distance; beside it some other surface may be nearer.
        (!amid && self.blend.reached(aabb.min, aabb.max)) || value.abs() <= STEEP * aabb.diagonal() / 2.0
    }

    fn noise_deg(&self) -> f64 {
        self.noise_deg
    }
}
