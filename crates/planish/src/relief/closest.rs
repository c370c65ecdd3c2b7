//! The places of surfaces closest to points.
//!
//! 1. a mesh of the surfaces, some cells for each knot span, tells patch and parameters to start from
//! 2. Newton's method on the squared distance within `[0, 1]²`, each step cut until the distance falls: [PT97] Piegl, Tiller,
//!    *The NURBS Book*, §6.1, equations 6.3 to 6.7
//!
//! Departs from [PT97]: at a border of the patch the search goes on along it; where the matrix of second derivatives is not
//! definite, as behind a centre of curvature, that of Gauss and Newton takes its place.

use super::ReliefError;
use crate::geom::Bvh;
use crate::mesh::TriMesh;
use crate::observe::Observer;
use crate::surface::Surface;
use crate::surface::basis::uniform_parameters;
use glam::{DMat2, DVec2, DVec3};
use rayon::prelude::*;

/// Cells of the mesh along each knot span: within one a cubic bends once.
const CELLS_PER_SPAN: usize = 4;
/// Steps at most; a start within a cell takes four to six.
const STEPS: usize = 40;
/// Halvings of a step at most: below this it is shorter than the rounding of the parameters.
const HALVINGS: usize = 50;
/// Points that a task takes at once.
const POINTS_PER_TASK: usize = 256;

/// A place on one of several surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePlace {
    /// Which surface.
    pub patch: u32,
    /// Parameters, each from 0 to 1.
    pub uv: DVec2,
    /// Position, world units.
    pub point: DVec3,
    /// From the point that was asked for, world units.
    pub distance: f64,
}

/// The place of the surfaces closest to each point, in the order of the points.
///
/// It is a place where the distance is least around it, the one that the nearest place of a mesh of the surfaces (four cells for
/// each knot span) leads to. Where two sheets lie about equally far, it may be that of the other sheet.
/// # Errors
/// [`ReliefError::Surface`] for what is no surface, [`ReliefError::Count`] for none at all, [`ReliefError::Cancelled`].
///
/// Source: [PT97] §6.1.
pub fn closest(
    surfaces: &[Surface],
    points: &[DVec3],
    observer: &dyn Observer,
) -> Result<Vec<SurfacePlace>, ReliefError> {
    surfaces.iter().try_for_each(Surface::check)?;
    if surfaces.is_empty() {
        return Err(ReliefError::Count { what: "surfaces", found: 0, wanted: 1 });
    }
    let (mesh, starts) = meshed(surfaces);
    let tree = Bvh::watched(&mesh, observer)?;
    let tasks: Vec<Vec<SurfacePlace>> = points
        .par_chunks(POINTS_PER_TASK)
        .map(|points| {
            observer.check()?;
            Ok(points.iter().map(|&p| one(surfaces, &mesh, &tree, &starts, p)).collect())
        })
        .collect::<Result<_, ReliefError>>()?;
    Ok(tasks.concat())
}

/// Parameters of the vertices of the mesh, and the first face of each surface.
struct Starts {
    parameters: Vec<DVec2>,
    first_face: Vec<u32>,
}

/// One mesh of all surfaces.
fn meshed(surfaces: &[Surface]) -> (TriMesh, Starts) {
    let mut mesh = TriMesh::default();
    let mut starts = Starts { parameters: Vec::new(), first_face: Vec::new() };
    for surface in surfaces {
        let [us, vs] = [surface.cols, surface.rows].map(|n| uniform_parameters((n - 3) * CELLS_PER_SPAN + 1));
        let base = mesh.points.len();
        starts.first_face.push(mesh.triangles.len() as u32);
        mesh.points.extend(surface.sample(&us, &vs, [0, 0]));
        starts.parameters.extend(vs.iter().flat_map(|&v| us.iter().map(move |&u| DVec2::new(u, v))));
        for j in 0..vs.len() - 1 {
            for i in 0..us.len() - 1 {
                let at = |i: usize, j: usize| (base + j * us.len() + i) as u32;
                mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
    }
    (mesh, starts)
}

fn one(surfaces: &[Surface], mesh: &TriMesh, tree: &Bvh, starts: &Starts, p: DVec3) -> SurfacePlace {
    let place = tree.closest(p).place;
    let patch = starts.first_face.partition_point(|&first| first <= place.face) - 1;
    let corners = mesh.triangles[place.face as usize];
    let start: DVec2 = corners.iter().zip(place.bary).map(|(&v, share)| starts.parameters[v as usize] * share).sum();
    let uv = refined(&surfaces[patch], start.clamp(DVec2::ZERO, DVec2::ONE), p);
    let point = surfaces[patch].point(uv.x, uv.y);
    SurfacePlace { patch: patch as u32, uv, point, distance: point.distance(p) }
}

/// Parameters where the distance from `p` is least, from `start` on.
fn refined(surface: &Surface, start: DVec2, p: DVec3) -> DVec2 {
    let mut at = start;
    let mut jet = surface.jet(at.x, at.y);
    for _ in 0..STEPS {
        let r = jet.point - p;
        let slope = DVec2::new(jet.u.dot(r), jet.v.dot(r));
        // At a border, what leads out of the patch is no way.
        let blocked = |x: f64, slope: f64| (x <= 0.0 && slope > 0.0) || (x >= 1.0 && slope < 0.0);
        let free = [!blocked(at.x, slope.x), !blocked(at.y, slope.y)];
        let gauss = [jet.u.dot(jet.u), jet.u.dot(jet.v), jet.v.dot(jet.v)];
        let bend = [jet.uu.dot(r), jet.uv.dot(r), jet.vv.dot(r)];
        let Some(step) = step(gauss, bend, slope, free) else { return at };
        let mut scale = 1.0;
        let mut next = None;
        for _ in 0..HALVINGS {
            let there = (at + step * scale).clamp(DVec2::ZERO, DVec2::ONE);
            let found = surface.jet(there.x, there.y);
            if found.point.distance_squared(p) < r.length_squared() {
                next = Some((there, found));
                break;
            }
            scale *= 0.5;
        }
        // Nothing is nearer: this is the place.
        let Some((there, found)) = next else { return at };
        (at, jet) = (there, found);
    }
    at
}

/// Newton's step along the free parameters; none where the distance changes no more.
fn step(gauss: [f64; 3], bend: [f64; 3], slope: DVec2, free: [bool; 2]) -> Option<DVec2> {
    let whole: [f64; 3] = std::array::from_fn(|k| gauss[k] + bend[k]);
    let found = match free {
        [true, true] => {
            let [a, b, c] = if whole[0] > 0.0 && whole[0] * whole[2] > whole[1] * whole[1] { whole } else { gauss };
            let matrix = DMat2::from_cols(DVec2::new(a, b), DVec2::new(b, c));
            if matrix.determinant() > 0.0 { -(matrix.inverse() * slope) } else { -slope / (a + c) }
        }
        [true, false] => DVec2::new(-slope.x / if whole[0] > 0.0 { whole[0] } else { gauss[0] }, 0.0),
        [false, true] => DVec2::new(0.0, -slope.y / if whole[2] > 0.0 { whole[2] } else { gauss[2] }),
        [false, false] => return None,
    };
    (found.is_finite() && found != DVec2::ZERO).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Silent;
    use crate::geom::random;
    use crate::surface::basis::uniform_knots;

    /// A wavy sheet over the unit square.
    fn wavy(shift: DVec3) -> Surface {
        let (rows, cols) = (9, 11);
        let node = |k: usize| {
            let (x, y) = ((k % cols) as f64 / 10.0, (k / cols) as f64 / 8.0);
            shift + DVec3::new(x, y, 0.15 * (5.0 * x).sin() * (4.0 * y).cos())
        };
        let control = (0..rows * cols).map(node).collect();
        Surface { rows, cols, control, knots_u: uniform_knots(cols), knots_v: uniform_knots(rows) }
    }

    fn unit(n: u64, k: u64) -> f64 {
        random::unit(31, 4 * n + k)
    }

    #[test]
    fn points_off_along_the_normal_come_back_to_their_parameters_within_1e_12() {
        let surfaces = [wavy(DVec3::ZERO), wavy(DVec3::new(0.0, 0.0, 2.0))];
        let wanted: Vec<(usize, DVec2)> =
            (0..300).map(|n| (n as usize % 2, DVec2::new(unit(n, 0), unit(n, 1)))).collect();
        let points: Vec<DVec3> = (wanted.iter().enumerate())
            .map(|(n, (patch, uv))| {
                let jet = surfaces[*patch].jet(uv.x, uv.y);
                jet.point + jet.area_vector().normalize() * (0.1 * unit(n as u64, 2) - 0.05)
            })
            .collect();
        let found = closest(&surfaces, &points, &Silent).unwrap();
        for ((found, (patch, uv)), p) in found.iter().zip(&wanted).zip(&points) {
            assert_eq!(found.patch as usize, *patch);
            assert!(found.uv.distance(*uv) < 1e-7, "{:?} {uv}", found.uv);
            assert!((found.distance - surfaces[*patch].point(uv.x, uv.y).distance(*p)).abs() < 1e-12);
        }
    }

    #[test]
    fn no_place_of_a_dense_sampling_is_nearer_than_the_one_found_and_borders_hold() {
        let surface = wavy(DVec3::ZERO);
        let ts = uniform_parameters(400);
        let samples = surface.sample(&ts, &ts, [0, 0]);
        let points: Vec<DVec3> =
            (0..200).map(|n| DVec3::new(unit(n, 0), unit(n, 1), unit(n, 2) - 0.5) * 1.6 - 0.3).collect();
        let found = closest(std::slice::from_ref(&surface), &points, &Silent).unwrap();
        let mut on_border = 0;
        for (found, p) in found.iter().zip(&points) {
            let best = samples.iter().map(|s| s.distance(*p)).fold(f64::INFINITY, f64::min);
            assert!(found.distance <= best + 1e-12, "{} {best}", found.distance);
            assert!((surface.point(found.uv.x, found.uv.y) - found.point).length() == 0.0);
            on_border += usize::from(found.uv.min_element() == 0.0 || found.uv.max_element() == 1.0);
        }
        assert!(on_border > 50, "{on_border}");
        assert!(matches!(closest(&[], &points, &Silent), Err(ReliefError::Count { .. })));
    }
}
