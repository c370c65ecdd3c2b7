//! Coordinates of maps: far from the origin against the size of what has them, and what one of their units is.

use glam::DVec3;
use planish::Units;
use planish::geom::Aabb;
use std::path::Path;

/// Coordinates this many times larger than the shape are far.
const FAR: f64 = 100.0;

/// By how much a shape with such bounds is moved to lie near the origin, so that single precision loses nothing that
/// matters: whole numbers, so that the way back is exact; zero for what is not far.
pub fn shift_of(bounds: &Aabb) -> DVec3 {
    let (size, center) = (bounds.diagonal(), bounds.center());
    if center.is_finite() && size > 0.0 && center.length() > FAR * size { center.round() } else { DVec3::ZERO }
}

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
    /// Its format has one unit: glTF and E57 are in metres.
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
        _ => FileUnits::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
