//! Coordinates of maps: far from the origin against the size of what has them, and what one of their units is.

use crate::rank::ranked;
use crate::step;
use glam::DVec3;
use planish::Units;
use planish::geom::Aabb;
use std::io;
use std::path::Path;

/// Coordinates this many times larger than the shape are far.
const FAR: f64 = 100.0;

/// By how much a shape with such bounds is moved to lie near the origin, so that single precision loses nothing that
/// matters: whole numbers, so that the way back is exact; zero for what is not far.
pub fn shift_of(bounds: &Aabb) -> DVec3 {
    let (size, center) = (bounds.diagonal(), bounds.center());
    if center.is_finite() && size > 0.0 && center.length() > FAR * size { center.round() } else { DVec3::ZERO }
}

/// The points of the body of a scan, where others are so far from it that nothing lies between: wild ranges, and returns that a
/// scanner marks by the origin of a map. `None` if all are of one body.
pub fn body(points: &[DVec3]) -> Option<Vec<u32>> {
    let finite = || points.iter().copied().filter(|p| p.is_finite());
    let pass = |see: &mut dyn FnMut(DVec3)| {
        finite().for_each(see);
        Ok(())
    };
    let (middle, reach) = reach(finite().count() as u64, &pass).ok()??;
    // What is no number stays: the cleaning counts it.
    let is_far = |i: u32| points[i as usize].distance(middle) > reach;
    Some((0..points.len() as u32).filter(|&i| !is_far(i)).collect())
}

/// Finite points, passed by as often as wanted.
pub(crate) type Passed<'a> = dyn Fn(&mut dyn FnMut(DVec3)) -> io::Result<()> + 'a;

/// The middle of a scan and how far its body reaches, if anything lies beyond.
///
/// From the middle of the points (the median of each coordinate) outwards a body has no gap of more than [`FAR`] times; the half
/// of the points that lies nearest is in it anyway.
/// # Errors
/// Those of the passes.
pub(crate) fn reach(count: u64, pass: &Passed) -> io::Result<Option<(DVec3, f64)>> {
    if count < LEAST {
        return Ok(None);
    }
    let middle = DVec3::from_array(ranked(count / 2, &|see| pass(&mut |p| see(p.to_array())))?);
    // Distances by their power of two: the gap is so wide that some powers between have none.
    let mut powers = vec![(0u64, f64::INFINITY, 0.0f64); POWERS];
    pass(&mut |p| {
        let away = p.distance(middle);
        let (count, least, most) = &mut powers[(away.to_bits() >> MANTISSA) as usize % POWERS];
        (*count, *least, *most) = (*count + 1, least.min(away), most.max(away));
    })?;
    powers.retain(|p| p.0 > 0);
    let mut nearer = 0;
    let gap = powers.windows(2).find(|pair| {
        nearer += pair[0].0;
        nearer > count / 2 && pair[0].2 > 0.0 && pair[1].1 > FAR * pair[0].2
    });
    Ok(gap.map(|pair| (middle, pair[0].2)))
}

/// Bits of the mantissa of a number, and powers of two that numbers may have.
const MANTISSA: u32 = 52;
const POWERS: usize = 1 << 11;
/// Points that have a middle worth the name.
const LEAST: u64 = 10;

/// Step between neighbouring numbers of single precision at the largest coordinate, if all coordinates are of single precision;
/// `None` if any is finer.
pub fn single_step(points: &[DVec3]) -> Option<f64> {
    let largest = points.iter().flat_map(|p| p.to_array()).map(f64::abs).fold(0.0, f64::max) as f32;
    let is_single = points.iter().flat_map(|p| p.to_array()).all(|x| x as f32 as f64 == x);
    (is_single && largest.is_finite()).then(|| largest.next_up() as f64 - largest as f64)
}

/// What a file tells of its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileUnits {
    /// Its format has one unit (glTF and E57 are in metres), or the file tells its own (STEP).
    Standard(Units),
    /// Its format does not say, but files of it nearly always have this one: LAS and LAZ.
    Usual(Units),
    /// Nobody knows.
    Unknown,
}

/// What the format of a file, by its extension, tells of its unit.
pub fn file_units(path: &Path) -> FileUnits {
    match path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase().as_str() {
        "glb" | "gltf" | "e57" => FileUnits::Standard(Units::M),
        "las" | "laz" => FileUnits::Usual(Units::M),
        // It says so itself.
        "step" | "stp" => crate::read_bytes(path)
            .ok()
            .and_then(|bytes| step::units(&bytes).ok())
            .map_or(FileUnits::Unknown, FileUnits::Standard),
        _ => FileUnits::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wild_point_and_returns_at_the_origin_of_a_map_are_no_body_and_a_body_of_two_parts_is_one() {
        let ball = |k: usize| DVec3::new((k as f64).sin(), (k as f64 * 1.7).cos(), (k as f64 * 0.3).sin());
        let mut points: Vec<DVec3> = (0..300).map(ball).collect();
        assert_eq!(body(&points), None);
        points.push(DVec3::new(1e12, 0.0, 0.0));
        points.push(DVec3::new(f64::NAN, 0.0, 0.0));
        let kept = body(&points).unwrap();
        assert!(kept.len() == 301 && !kept.contains(&300));
        let map = DVec3::new(515_380.0, 4_918_360.0, 0.0);
        let mut points: Vec<DVec3> = (0..300).map(|k| ball(k) + map).collect();
        points.extend([DVec3::ZERO; 30]);
        assert_eq!(body(&points).unwrap(), (0..300).collect::<Vec<u32>>());
        // Fifty sizes apart: a part and a sphere beside it.
        let apart: Vec<DVec3> = (0..300).map(|k| ball(k) + DVec3::X * if k < 100 { 50.0 } else { 0.0 }).collect();
        assert_eq!(body(&apart), None);
    }

    #[test]
    fn a_shape_of_2_m_at_utm_coordinates_is_moved_by_whole_numbers_and_its_single_precision_is_half_a_metre() {
        let corner = DVec3::new(515_380.25, 4_918_360.5, 2_330.0);
        let bounds = Aabb::of(&[corner, corner + DVec3::splat(2.0)]);
        assert_eq!(shift_of(&bounds), DVec3::new(515_381.0, 4_918_362.0, 2_331.0));
        assert_eq!(shift_of(&Aabb::of(&[DVec3::ZERO, DVec3::splat(2.0)])), DVec3::ZERO);
        assert_eq!(single_step(&[corner]), Some(0.5));
        assert_eq!(single_step(&[corner + DVec3::splat(0.1)]), None);
    }
}
