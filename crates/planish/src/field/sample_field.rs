//! Samples as a field: the blend of their cells.
//!
//! [X03] Xie et al. 2003, §4.2. Far from all samples the field is unknown, or, where holes are to be closed, follows the
//! winding number of the samples.

use super::Field;
use crate::cloud::{Blend, Blended, Cell, Dipoles, Samples};
use crate::geom::Aabb;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What a cell says changes by at most this much per length.
const STEEP: f64 = 1.2;
/// From this share of the support on a point is beside the data: cells stand less than .38 supports apart.
const BESIDE: f64 = 0.42;
/// A winding number closer to one half than this says nothing beside cells, and twice as far off all.
const UNSURE_WINDING: f64 = 0.15;
/// From this share on the winding number decides alone.
const BEYOND: f64 = 0.84;

/// Places on edges are sought to this fraction of an edge: a cell is a few noise levels wide, and the coordinates of a mesh
/// file have 24 bits.
const PRECISION: f64 = 1e-6;

/// The blended field of oriented samples.
pub struct SampleField {
    blend: Blend,
    bounds: Aabb,
    /// Widest support.
    widest: f64,
    noise_deg: f64,
    /// Winding number of the samples, where holes are closed.
    closing: Option<Arc<Dipoles>>,
}

/// What a field of samples is measured by.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct FieldScale {
    /// Box of the centres of all samples, world units.
    pub bounds: Aabb,
    /// Widest support of a cell, world units.
    pub widest: f64,
    /// Typical error of the normals, degrees.
    pub noise_deg: f64,
}

impl SampleField {
    /// The field of `samples`. With `close`, places without data get their side from the winding number.
    pub fn new(samples: &Samples, close: bool) -> SampleField {
        let bounds = Aabb::of(samples.samples.iter().map(|s| &s.center));
        let dipoles =
            || Dipoles::new(&samples.samples.iter().map(|s| (s.center, s.normal * s.area)).collect::<Vec<_>>());
        let widest = samples.cells.iter().map(|s| s.support).fold(0.0, f64::max);
        let scale = FieldScale { bounds, widest, noise_deg: samples.normal_noise_deg };
        SampleField::of_cells(&samples.cells, &scale, close.then(|| Arc::new(dipoles())))
    }

    /// The field of some cells of a larger whole.
    /// * `closing` - all samples of the whole, where places without data get their side from the winding number
    pub fn of_cells(cells: &[Cell], scale: &FieldScale, closing: Option<Arc<Dipoles>>) -> SampleField {
        let FieldScale { mut bounds, widest, noise_deg } = *scale;
        bounds.min -= DVec3::splat(0.5 * widest);
        bounds.max += DVec3::splat(0.5 * widest);
        SampleField { blend: Blend::new(cells), bounds, widest, noise_deg, closing }
    }

    /// The value at `p` from what the cells say there; NaN where nothing is known.
    fn value_of(&self, here: Option<Blended>, p: DVec3) -> f64 {
        match here {
            None => self.beyond(p, false).0,
            Some(here) => {
                self.aside(&here, p).map_or(here.value, |(_, share, beyond)| here.value + share * (beyond - here.value))
            }
        }
    }

    /// The unit gradient at `p` from what the cells say there, and from theirs.
    fn gradient_of(&self, here: Option<Blended>, p: DVec3, own: impl Fn(&Blended) -> DVec3) -> DVec3 {
        let Some(here) = here else { return self.beyond(p, true).1 };
        let normal = own(&here);
        self.aside(&here, p).map_or(normal, |(winding, share, _)| {
            let size = self.blend.cells()[here.cell].support;
            let g = gradient(winding, p, STENCIL * size).unwrap_or(normal);
            normal.lerp(g, share).normalize_or(normal)
        })
    }

    /// What the winding number says beside the data, as a value, the share of that, and the value at `p`.
    ///
    /// Away from the data the samples together know better than a fit carried on beyond its points: from the cells to the
    /// winding number without a step, so that the surface goes on smoothly over a hole.
    fn aside(&self, here: &Blended, p: DVec3) -> Option<(impl Fn(DVec3) -> f64, f64, f64)> {
        let dipoles = self.closing.as_ref().filter(|_| !amid(here))?;
        let far = ((here.aside.sqrt() - BESIDE) / (BEYOND - BESIDE)).min(1.0);
        let share = far * far * (3.0 - 2.0 * far);
        let size = self.blend.cells()[here.cell].support;
        // Beside the data the number has no more than its bounds; close to single dipoles it leaves them.
        let winding = move |p: DVec3| (0.5 - dipoles.number(p, 0.0)).clamp(-0.5, 0.5) * size;
        let beyond = winding(p);
        // Where both agree on the side the cells know the distance.
        if beyond * here.value > 0.0 {
            return None;
        }
        let share = share * ((beyond.abs() / size - UNSURE_WINDING) / UNSURE_WINDING).clamp(0.0, 1.0);
        Some((winding, share, beyond))
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

/// Is a place in the midst of data?
fn amid(here: &Blended) -> bool {
    here.aside <= BESIDE * BESIDE
}

impl Field for SampleField {
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn value(&self, p: DVec3) -> f64 {
        self.value_of(self.blend.at(p), p)
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        self.gradient_of(self.blend.at(p), p, |here| self.blend.normal(p, here))
    }

    fn crosses(&self, aabb: &Aabb) -> bool {
        Near { field: self, cells: self.blend.reaching(aabb) }.crosses(aabb)
    }

    fn within(&self, aabb: &Aabb) -> Option<Box<dyn Field + '_>> {
        Some(Box::new(Near { field: self, cells: self.blend.reaching(aabb) }))
    }

    fn noise_deg(&self) -> f64 {
        self.noise_deg
    }

    fn precision(&self) -> f64 {
        PRECISION
    }
}

/// The field in a box: few cells reach it.
struct Near<'a> {
    field: &'a SampleField,
    /// Ascending.
    cells: Vec<u32>,
}

impl Near<'_> {
    fn here(&self, p: DVec3) -> Option<Blended> {
        self.field.blend.at_of(&self.cells, p)
    }
}

impl Field for Near<'_> {
    fn bounds(&self) -> Aabb {
        self.field.bounds
    }

    fn value(&self, p: DVec3) -> f64 {
        self.field.value_of(self.here(p), p)
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        self.field.gradient_of(self.here(p), p, |here| self.field.blend.normal_of(&self.cells, p, here))
    }

    fn crosses(&self, aabb: &Aabb) -> bool {
        // The value is a mean of what the cells say: where all are on one side, so is it.
        let (center, reach) = (aabb.center(), STEEP * aabb.diagonal() / 2.0);
        let mut values = self.cells.iter().map(|&i| self.field.blend.cells()[i as usize].evaluate(center).0);
        let side = values.clone().next().map(f64::signum);
        if side.is_some_and(|side| !values.all(|d| d.is_finite() && d * side > reach)) {
            return true;
        }
        // In the midst of data the winding number has no say.
        if self.here(center).as_ref().is_some_and(amid) {
            return false;
        }
        let Some(dipoles) = &self.field.closing else { return side.is_some() };
        dipoles.side(center, aabb.diagonal() / 2.0).is_none_or(|s| side.is_some_and(|side| side != s))
    }

    fn within(&self, aabb: &Aabb) -> Option<Box<dyn Field + '_>> {
        let cells =
            self.cells.iter().copied().filter(|&i| self.field.blend.cells()[i as usize].reaches(aabb)).collect();
        Some(Box::new(Near { field: self.field, cells }))
    }

    fn noise_deg(&self) -> f64 {
        self.field.noise_deg
    }

    fn precision(&self) -> f64 {
        PRECISION
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cell, CleanParams, Cloud, Quadric, clean};
    use crate::geom::random;
    use crate::observe::Silent;

    /// A scan of half a sphere, with noise of a hundredth of its radius.
    fn bowl() -> Samples {
        let point = |i: u64| {
            let r = |k: u64| random::unit(8, 8 * i + k);
            let (z, a) = (r(0), std::f64::consts::TAU * r(1));
            let s = (1.0 - z * z).sqrt();
            let noise = [0, 1, 2].map(|k| random::normal(r(2 + 2 * k), r(3 + 2 * k)));
            DVec3::new(s * a.cos(), s * a.sin(), z) + 0.01 * DVec3::from_array(noise)
        };
        clean(&Cloud::new((0..4000).map(point).collect()), &CleanParams::default(), &Silent).unwrap()
    }

    #[test]
    fn a_box_that_a_trusted_face_far_off_calls_deep_inside_is_not_ruled_out_where_a_near_face_passes_it() {
        // Both faces of a plate of thickness 10.
        let face = |height: f64, up: f64, trust: f64| {
            let center = DVec3::Z * height;
            let sheets = [Quadric::plane(center, 9.0, DVec3::Z * up); 4];
            Cell { center, support: 9.0, trust, sheets, count: 1, concave: 0 }
        };
        let samples = Samples { cells: vec![face(0.0, -1.0, 100.0), face(10.0, 1.0, 1.0)], ..Samples::default() };
        let field = SampleField::new(&samples, false);
        let center = DVec3::Z * 7.9;
        let aabb = Aabb { min: center - 3.0, max: center + 3.0 };
        assert!(field.value(center) < -STEEP * aabb.diagonal() / 2.0, "{}", field.value(center));
        assert!(field.value(DVec3::Z * 10.5) > 0.0 && field.crosses(&aabb));
    }

    #[test]
    fn boxes_answer_the_same_bits_and_what_they_rule_out_is_on_one_side() {
        let samples = bowl();
        for close in [false, true] {
            let field = SampleField::new(&samples, close);
            let (mut ruled, mut left) = (0, 0);
            for i in 0..300 {
                let r = |k: u64| random::unit(9, 100 * i + k);
                let low = DVec3::new(3.0 * r(0) - 1.5, 3.0 * r(1) - 1.5, 2.0 * r(2) - 0.5);
                let aabb = Aabb { min: low, max: low + 0.3 * r(3) };
                let half = Aabb { min: low, max: aabb.center() };
                let near = field.within(&aabb).unwrap();
                let nearer = near.within(&half).unwrap();
                let place = |k: u64| low + half.size() * DVec3::new(r(4 + 3 * k), r(5 + 3 * k), r(6 + 3 * k));
                let inside: Vec<DVec3> = (0..20).map(place).collect();
                for &p in &inside {
                    let bits = |f: &dyn Field| (f.value(p).to_bits(), f.gradient(p).to_array().map(f64::to_bits));
                    assert_eq!(bits(&field), bits(&*near));
                    assert_eq!(bits(&field), bits(&*nearer));
                }
                assert_eq!(field.crosses(&half), nearer.crosses(&half));
                if field.crosses(&half) {
                    left += 1;
                } else {
                    ruled += 1;
                    let side = field.side(half.center());
                    assert!(inside.iter().all(|&p| field.side(p) == side), "{half:?}");
                }
            }
            assert!(ruled > 30 && left > 30, "{ruled} {left}");
        }
    }
}
