//! Pictures in which the quality of surfaces is seen: reflected stripes, and combs of curvature. Both are drawn from the B-splines, by
//! their own normals and second derivatives, so that what their seams do is seen and not what a mesh makes of it.

use planish::DVec3;
use planish::mesh::TriMesh;
use planish::model::Model;
use planish::relief::{self, ReliefError};
use planish::render::Line;
use planish::surface::Surface;
use planish::surface::basis::uniform_parameters;

/// Teeth of a comb stand this share of the diagonal apart: a few pixels of a large picture.
const TOOTH_DISTANCE: f64 = 1.0 / 320.0;
/// Fewest and most steps between the teeth of one curve.
const TEETH: [usize; 2] = [8, 400];
/// Places of a curve that its length is measured at.
const LENGTH_CHORDS: usize = 16;
/// Length of a tooth at the curvature that 95 of 100 places do not exceed, as a share of the diagonal.
const TOOTH_LENGTH: f64 = 0.02;
/// No tooth is longer than this many times that.
const LONGEST_TO_USUAL: f64 = 2.0;
/// Teeth shorter than this share of the diagonal, less than a pixel, are left out: of a flat curve the sign of its curvature is noise.
const SHORTEST_TOOTH: f64 = 1.0 / 2000.0;
/// Combs of convex curves (bent away from the outside) and of hollow ones, and of nothing: curves themselves.
const CONVEX: [u8; 3] = [24, 78, 160];
const HOLLOW: [u8; 3] = [196, 88, 16];
const CURVE: [u8; 3] = [40, 46, 54];
/// Widths of seams and of the middles of patches, pixels.
const SEAM_WIDTH: f64 = 1.8;
const MIDDLE_WIDTH: f64 = 0.8;

/// The surfaces side by side, each with vertices of its own, and their normals there; none where `S_u x S_v = 0`.
/// * `cuts` - quads per knot span
/// # Errors
/// None for surfaces of a model.
pub fn with_normals(model: &Model, cuts: usize) -> Result<(TriMesh, Vec<DVec3>), ReliefError> {
    let (mut all, mut normals) = (TriMesh::default(), Vec::new());
    for (surface, [rows, cols]) in model.surfaces.iter().zip(relief::span_shapes(&model.surfaces, cuts)) {
        let (us, vs) = (uniform_parameters(cols), uniform_parameters(rows));
        let [points, along_u, along_v] = [[0, 0], [1, 0], [0, 1]].map(|order| surface.sample(&us, &vs, order));
        normals.extend(along_u.iter().zip(&along_v).map(|(u, v)| u.cross(*v).normalize_or_zero()));
        let patch = relief::patch_mesh(points, rows, cols)?;
        let first = all.points.len() as u32;
        all.points.extend(patch.points);
        all.triangles.extend(patch.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    Ok((all, normals))
}

/// A place on a curve of a surface.
#[derive(Clone, Copy, Debug)]
struct Tooth {
    place: DVec3,
    normal: DVec3,
    /// Normal curvature along the curve: below zero where it bends away from the outside.
    curvature: f64,
}

/// Combs as lines, and the radius for which a tooth is [`TOOTH_LENGTH`] of the diagonal long, world units.
pub struct Combs {
    pub lines: Vec<Line>,
    pub radius: f64,
}

/// Combs along every curve of a network, once for each patch beside it, and along the middles of every patch in both directions,
/// which go on across the seams.
pub fn combs(model: &Model) -> Combs {
    let diagonal = model.mesh.bounds().diagonal();
    let middles = |s: &Surface| [true, false].map(|along_u| (teeth(s, along_u, 0.5, diagonal), MIDDLE_WIDTH));
    let rims = |s: &Surface| {
        [(true, 0.0), (false, 1.0), (true, 1.0), (false, 0.0)]
            .map(|(along_u, at)| (teeth(s, along_u, at, diagonal), SEAM_WIDTH))
    };
    let all: Vec<(Vec<Tooth>, f64)> =
        model.surfaces.iter().flat_map(|s| middles(s).into_iter().chain(rims(s))).collect();
    let mut sizes: Vec<f64> =
        all.iter().flat_map(|comb| &comb.0).map(|t| t.curvature.abs()).filter(|c| c.is_finite()).collect();
    sizes.sort_by(f64::total_cmp);
    // Flat shapes have combs without teeth.
    let usual = sizes.get(sizes.len() * 95 / 100).copied().unwrap_or(0.0).max(1e-9 / diagonal);
    let scale = Scale {
        curvature: TOOTH_LENGTH * diagonal / usual,
        shortest: SHORTEST_TOOTH * diagonal,
        longest: LONGEST_TO_USUAL * TOOTH_LENGTH * diagonal,
    };
    Combs { lines: all.iter().flat_map(|(teeth, width)| comb(teeth, scale, *width)).collect(), radius: 1.0 / usual }
}

/// How long teeth are.
#[derive(Clone, Copy)]
struct Scale {
    /// For a curvature of 1.
    curvature: f64,
    /// Shorter ones are left out, and longer ones cut off, world units.
    shortest: f64,
    longest: f64,
}

/// Places of the line of a surface where its other parameter is `at`.
fn teeth(surface: &Surface, along_u: bool, at: f64, diagonal: f64) -> Vec<Tooth> {
    let jet = |t: f64| if along_u { surface.jet(t, at) } else { surface.jet(at, t) };
    let chords: Vec<DVec3> = uniform_parameters(LENGTH_CHORDS + 1).into_iter().map(|t| jet(t).point).collect();
    let length: f64 = chords.windows(2).map(|w| w[0].distance(w[1])).sum();
    let steps = ((length / (TOOTH_DISTANCE * diagonal)).ceil() as usize).clamp(TEETH[0], TEETH[1]);
    let tooth = |t: f64| {
        let jet = jet(t);
        let normal = jet.area_vector().try_normalize()?;
        let (first, second) = if along_u { (jet.u, jet.uu) } else { (jet.v, jet.vv) };
        let curvature = second.dot(normal) / first.length_squared();
        curvature.is_finite().then_some(Tooth { place: jet.point, normal, curvature })
    };
    uniform_parameters(steps + 1).into_iter().filter_map(tooth).collect()
}

/// The curve, its teeth and the line over their ends. All teeth point outside, or one would not see those of hollows.
/// * `width` - of the curve, pixels
fn comb(teeth: &[Tooth], scale: Scale, width: f64) -> Vec<Line> {
    let length = |t: &Tooth| (t.curvature.abs() * scale.curvature).min(scale.longest);
    let end = |t: &Tooth| t.place + t.normal * length(t);
    let is_seen = |t: &Tooth| length(t) >= scale.shortest;
    let color = |t: &Tooth| if t.curvature > 0.0 { HOLLOW } else { CONVEX };
    let mut lines = vec![Line { points: teeth.iter().map(|t| t.place).collect(), color: CURVE, width }];
    let shown = teeth.iter().filter(|t| is_seen(t));
    lines.extend(shown.map(|t| Line { points: vec![t.place, end(t)], color: color(t), width: 0.6 }));
    let pairs = teeth.windows(2).filter(|w| w.iter().any(is_seen));
    lines.extend(pairs.map(|w| Line { points: w.iter().map(end).collect(), color: color(&w[0]), width: 1.2 }));
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use planish::surface::fit;

    fn surface(shape: impl Fn(f64, f64) -> DVec3) -> Surface {
        let at = uniform_parameters(33);
        let points: Vec<DVec3> =
            at.iter().flat_map(|&v| at.iter().map(move |&u| (u, v))).map(|(u, v)| shape(u, v)).collect();
        fit(&points, 33, 33, [12, 12]).unwrap()
    }

    #[test]
    fn teeth_of_a_cylinder_are_one_over_its_radius_around_and_none_along_within_a_thousandth() {
        // The normal points away from the axis.
        let tube = surface(|u, v| DVec3::new(2.0 * (1.2 * u).cos(), 2.0 * (1.2 * u).sin(), 3.0 * v));
        for (along_u, wanted) in [(true, -0.5), (false, 0.0)] {
            for at in [0.0, 0.5, 1.0] {
                let teeth = teeth(&tube, along_u, at, 4.0);
                assert!(teeth.len() >= 9);
                assert!(teeth.iter().all(|t| (t.curvature - wanted).abs() < 1e-3), "{at}: {teeth:?}");
                assert!(teeth.iter().all(|t| t.normal.dot(DVec3::new(t.place.x, t.place.y, 0.0)) > 1.999));
            }
        }
        let hollow = surface(|u, v| DVec3::new(2.0 * (1.2 * v).cos(), 2.0 * (1.2 * v).sin(), 3.0 * u));
        assert!(teeth(&hollow, false, 0.5, 4.0).iter().all(|t| (t.curvature - 0.5).abs() < 1e-3));
    }

    #[test]
    fn a_comb_has_a_tooth_of_scaled_length_at_every_place_and_none_is_longer_than_the_longest() {
        let ball = surface(|u, v| {
            let (a, b) = (0.8 * u, 0.8 * v - 0.4);
            DVec3::new(a.cos() * b.cos(), a.sin() * b.cos(), b.sin())
        });
        let teeth = teeth(&ball, true, 0.5, 1.0);
        let scale = Scale { curvature: 0.3, shortest: 1e-3, longest: 1.0 };
        let lines = comb(&teeth, scale, 1.0);
        assert_eq!(lines.len(), 1 + teeth.len() + teeth.len() - 1);
        let lengths: Vec<f64> = lines[1..=teeth.len()].iter().map(|l| l.points[0].distance(l.points[1])).collect();
        assert!(lengths.iter().all(|l| (l - 0.3).abs() < 1e-3), "{lengths:?}");
        let short = comb(&teeth, Scale { longest: 0.1, ..scale }, 1.0);
        assert!(short[1..=teeth.len()].iter().all(|l| l.points[0].distance(l.points[1]) < 0.1 + 1e-12));
        assert_eq!(comb(&teeth, Scale { shortest: 0.4, ..scale }, 1.0).len(), 1);
    }
}
