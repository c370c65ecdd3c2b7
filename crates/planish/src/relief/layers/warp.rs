//! A smooth map of space that takes places of one model exactly to places of another.
//!
//! 1. the affine map of least squares, or the similarity where the places do not fill space: [U91] Umeyama, *Least-Squares
//!    Estimation of Transformation Parameters Between Two Point Patterns*, IEEE PAMI 13(4), 1991, eq. 40 to 43
//! 2. what is left at the pairs, by a sum of multiquadrics and a constant: [H71] Hardy, *Multiquadric Equations of
//!    Topography and Other Irregular Surfaces*, J. Geophys. Res. 76(8), 1971; solvable for any places that are apart by
//!    [M86] Micchelli, *Interpolation of Scattered Data*, Constr. Approx. 2, 1986
//!
//! Departs from thin plates in space, whose kernel `r` has the tip of a cone at every pair: a multiquadric
//! `sqrt(r^2 + c^2)` is round there, so detail does not turn abruptly at the pairs.

use super::super::{Displaced, ReliefError, closest};
use super::ground::{Ground, Place};
use crate::geom::{Aabb, is_positive};
use crate::linalg::{eigen3, solve_dense};
use crate::observe::Observer;
use crate::register::Placement;
use crate::surface::Surface;
use glam::{DMat3, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Pairs at most: the system is dense, and 2000 take some seconds.
const MOST_PAIRS: usize = 2000;
/// Least extent of the places across against the longest for an affine map: below it the third direction rests on too little.
const FLAT: f64 = 0.1;
/// Pairs from which on the map is affine: its 12 numbers rest on 18 then, and not on chance.
const AFFINE_PAIRS: usize = 6;
/// Rounding of the kernel against the mean distance of a place to the next.
const ROUND: f64 = 0.5;
/// Places nearer than this share of the diagonal are one.
const SAME: f64 = 1e-6;
/// Furthest that a place may be from its surface, share of the diagonal: detail is not as high, other units are further.
const AWAY: f64 = 0.05;
/// Steps of the iteration for the rotation in a matrix; it doubles the digits with each.
const POLAR_STEPS: usize = 32;

/// A place on the model that has the detail, and where it is on the model that gets it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlacePair {
    /// On the model that has the detail.
    pub from: Place,
    /// On the model that gets it.
    pub to: Place,
}

/// A smooth map of space: `x -> A x + b + sum of w_i sqrt(|x - p_i|^2 + c^2)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Warp {
    linear: DMat3,
    shift: DVec3,
    places: Vec<DVec3>,
    weights: Vec<DVec3>,
    /// `c` of the kernel, units of the model.
    round: f64,
    /// Largest distance at a pair that the affine or similar map leaves, units of the model.
    pub bent: f64,
    /// True if that map is affine, false if it is a similarity.
    pub affine: bool,
}

/// What the map does around a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turn {
    /// The rotation in its derivative.
    pub rotation: DMat3,
    /// How much longer lengths become: the third root of the change of volume.
    pub scale: f64,
}

impl Warp {
    /// The map that takes the first place of each pair to the second.
    ///
    /// # Errors
    /// [`ReliefError::Edit`] for fewer than 3 or more than 2000 pairs, places that are not finite or on a line, two pairs at one
    /// place, and pairs that are mirror images.
    ///
    /// Source: [U91], [H71].
    pub fn of_pairs(pairs: &[[DVec3; 2]]) -> Result<Warp, ReliefError> {
        let refused = |what: String| Err(ReliefError::Edit { what });
        if pairs.len() < 3 || pairs.len() > MOST_PAIRS {
            return refused(format!(
                "{} pairs are given; 3 to {MOST_PAIRS} are needed, six or more are better",
                pairs.len()
            ));
        }
        if let Some(k) = pairs.iter().position(|p| !p[0].is_finite() || !p[1].is_finite()) {
            return refused(format!("pair {} has a number that is not finite", k + 1));
        }
        for side in 0..2 {
            let size = Aabb::of(pairs.iter().map(|p| &p[side])).diagonal();
            for (k, a) in pairs.iter().enumerate() {
                let is_apart = |b: &[DVec3; 2]| a[side].distance(b[side]) > SAME * size;
                if let Some(l) = pairs[..k].iter().position(|b| !is_apart(b)) {
                    let whose = ["from", "to"][side];
                    return refused(format!(
                        "pairs {} and {} have the same place `{whose}`; take one away",
                        l + 1,
                        k + 1
                    ));
                }
            }
        }
        let (linear, shift, affine) = base(pairs)?;
        if !is_positive(linear.determinant()) {
            return refused("the pairs make a mirror image; transfer does not mirror".into());
        }
        let places: Vec<DVec3> = pairs.iter().map(|p| p[0]).collect();
        let left: Vec<DVec3> = pairs.iter().map(|[p, q]| *q - (linear * *p + shift)).collect();
        let next = |(k, p): (usize, &DVec3)| {
            let others = places.iter().enumerate().filter(|(l, _)| *l != k);
            others.map(|(_, q)| p.distance(*q)).fold(f64::INFINITY, f64::min)
        };
        let round = ROUND * places.iter().enumerate().map(next).sum::<f64>() / places.len() as f64;
        let mut warp = Warp { linear, shift, weights: Vec::new(), round, bent: longest(&left), affine, places };
        warp.bend(&left)?;
        Ok(warp)
    }

    /// Solves for the weights of the kernels, which sum to zero, and the constant.
    fn bend(&mut self, left: &[DVec3]) -> Result<(), ReliefError> {
        let n = self.places.len();
        let mut matrix = vec![0.0; (n + 1) * (n + 1)];
        let mut values = vec![0.0; (n + 1) * 3];
        for (i, p) in self.places.iter().enumerate() {
            for (j, q) in self.places.iter().enumerate() {
                matrix[i * (n + 1) + j] = self.kernel(*p - *q);
            }
            (matrix[i * (n + 1) + n], matrix[n * (n + 1) + i]) = (1.0, 1.0);
            values[3 * i..3 * i + 3].copy_from_slice(&left[i].to_array());
        }
        if !solve_dense(&mut matrix, &mut values, n + 1, 3) {
            return Err(ReliefError::Edit {
                what: "some pairs are too close to each other; take one of them away".into(),
            });
        }
        self.weights = values.chunks_exact(3).map(DVec3::from_slice).collect();
        self.shift += self.weights.pop().unwrap_or_default();
        Ok(())
    }

    fn kernel(&self, d: DVec3) -> f64 {
        d.length_squared().sqrt().hypot(self.round)
    }

    /// Where a point goes.
    pub fn point(&self, x: DVec3) -> DVec3 {
        let bent: DVec3 = self.places.iter().zip(&self.weights).map(|(p, w)| *w * self.kernel(x - *p)).sum();
        self.linear * x + self.shift + bent
    }

    /// Rotation and stretch of the map at a point; `None` where it folds space over.
    pub(super) fn turn(&self, x: DVec3) -> Option<Turn> {
        let mut slope = self.linear;
        for (p, w) in self.places.iter().zip(&self.weights) {
            let along = (x - *p) / self.kernel(x - *p);
            slope += DMat3::from_cols(*w * along.x, *w * along.y, *w * along.z);
        }
        let volume = slope.determinant();
        (volume > 0.0).then(|| Turn { rotation: rotation_in(slope), scale: volume.cbrt() })
    }
}

/// The rotation nearest to a matrix that does not mirror: Higham, *Computing the Polar Decomposition*, SIAM J. Sci. Stat. Comput.
/// 7(4), 1986, eq. 3.1.
fn rotation_in(matrix: DMat3) -> DMat3 {
    let mut r = matrix * matrix.determinant().cbrt().recip();
    for _ in 0..POLAR_STEPS {
        let next = (r + r.inverse().transpose()) * 0.5;
        if next == r {
            break;
        }
        r = next;
    }
    r
}

/// The affine map of least squares where the places fill space, else the similarity; true for the affine one.
fn base(pairs: &[[DVec3; 2]]) -> Result<(DMat3, DVec3, bool), ReliefError> {
    let turned = Placement::of_pairs(pairs)
        .map_err(|_| ReliefError::Edit { what: "the pairs are on a line; give one beside it".into() })?;
    let middle = |k: usize| pairs.iter().map(|pair| pair[k]).sum::<DVec3>() / pairs.len() as f64;
    let (from, to) = (middle(0), middle(1));
    let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
    let both = |[p, q]: &[DVec3; 2]| (*p - from, *q - to);
    let (mut spread, mut across) = (DMat3::ZERO, DMat3::ZERO);
    for (p, q) in pairs.iter().map(both) {
        spread += outer(p, p);
        across += outer(q, p);
    }
    let (values, _) = eigen3(spread);
    let fills = values[0].max(0.0).sqrt() > FLAT * values[2].sqrt();
    if fills {
        // With a sign, the volume tells a mirror image also where the map is to be a similarity.
        let affine = across * spread.inverse();
        if pairs.len() >= AFFINE_PAIRS || affine.determinant() <= 0.0 {
            return Ok((affine, to - affine * from, true));
        }
    }
    // [U91] eq. 42: the scale that goes with the rotation.
    let [along, size] = pairs
        .iter()
        .map(both)
        .fold([0.0; 2], |[along, size], (p, q)| [along + q.dot(turned.linear * p), size + p.length_squared()]);
    let linear = turned.linear * (along / size);
    Ok((linear, to - linear * from, false))
}

fn longest(vectors: &[DVec3]) -> f64 {
    vectors.iter().map(|d| d.length()).fold(0.0, f64::max)
}

/// The map that takes places on one model to places on another, each put on its smooth surface first.
///
/// # Errors
/// As [`Warp::of_pairs`]; [`ReliefError::Edit`] for places that are on no patch or far from the surface;
/// [`ReliefError::Cancelled`].
pub fn warp(
    ground: &Ground,
    from: &Displaced,
    pairs: &[PlacePair],
    observer: &dyn Observer,
) -> Result<Warp, ReliefError> {
    let on = |surfaces: &[Surface], pick: &dyn Fn(&PlacePair) -> Place, whose: &str| {
        let places: Vec<Place> = pairs.iter().map(pick).collect();
        put_on(surfaces, &places, whose, observer)
    };
    let starts = on(from.surfaces, &|pair| pair.from, "from")?;
    let ends = on(ground.surfaces, &|pair| pair.to, "to")?;
    let both: Vec<[DVec3; 2]> = starts.into_iter().zip(ends).map(|(p, q)| [p, q]).collect();
    Warp::of_pairs(&both)
}

/// The points of the surfaces that places name.
fn put_on(
    surfaces: &[Surface],
    places: &[Place],
    whose: &str,
    observer: &dyn Observer,
) -> Result<Vec<DVec3>, ReliefError> {
    let refused = |k: usize, what: String| ReliefError::Edit { what: format!("pair {}, `{whose}`: {what}", k + 1) };
    let limit = AWAY * Aabb::of(surfaces.iter().flat_map(|s| &s.control)).diagonal();
    let mut points = Vec::with_capacity(places.len());
    for (k, place) in places.iter().enumerate() {
        points.push(match *place {
            Place::Space(at) => DVec3::from(at),
            Place::Patch { patch, u, v } => {
                let surface = surfaces
                    .get(patch as usize)
                    .ok_or_else(|| refused(k, format!("there is no patch {patch} among {}", surfaces.len())))?;
                if !((0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v)) {
                    return Err(refused(k, "u and v are numbers from 0 to 1".into()));
                }
                surface.point(u, v)
            }
        });
        if !points[k].is_finite() {
            return Err(refused(k, "a number is not finite".into()));
        }
    }
    let found = closest(surfaces, &points, observer)?;
    let is_on = |distance: f64| distance <= limit;
    if let Some((k, far)) = found.iter().enumerate().find(|(_, f)| !is_on(f.distance)) {
        let what = format!("the place is {:.4} away from the surface; give one on it", far.distance);
        return Err(refused(k, what));
    }
    Ok(found.into_iter().map(|f| f.point).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;

    fn cloud(count: u64) -> Vec<DVec3> {
        (0..count).map(|n| DVec3::from(std::array::from_fn(|k| random::unit(5, 3 * n + k as u64)))).collect()
    }

    #[test]
    fn an_affine_map_comes_out_within_1e_12_and_a_similarity_of_a_plane_too() {
        let linear = DMat3::from_rotation_x(0.7) * DMat3::from_diagonal(DVec3::new(1.0, 2.0, 0.5));
        let pairs: Vec<[DVec3; 2]> = cloud(9).into_iter().map(|p| [p, linear * p + DVec3::ONE]).collect();
        let warp = Warp::of_pairs(&pairs).unwrap();
        assert!(warp.affine && warp.bent < 1e-12);
        let x = DVec3::new(3.0, -2.0, 1.0);
        assert!(warp.point(x).distance(linear * x + DVec3::ONE) < 1e-11);
        let turn = warp.turn(x).unwrap();
        assert!(
            (turn.scale - 1.0).abs() < 1e-12
                && (turn.rotation * turn.rotation.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-12)
        );
        let linear = DMat3::from_rotation_y(-1.1) * 3.0;
        let flat = |p: DVec3| DVec3::new(p.x, p.y, 0.0);
        let pairs: Vec<[DVec3; 2]> = cloud(5).into_iter().map(|p| [flat(p), linear * flat(p)]).collect();
        let warp = Warp::of_pairs(&pairs).unwrap();
        assert!(!warp.affine && warp.point(x).distance(linear * x) < 1e-12);
        assert!((warp.turn(x).unwrap().scale - 3.0).abs() < 1e-12);
    }

    #[test]
    fn pairs_that_no_affine_map_joins_are_joined_within_1e_10_and_the_derivative_is_that_of_differences() {
        let bend = |p: DVec3| p + DVec3::new(0.2 * p.y * p.y, 0.1 * (3.0 * p.x).sin(), 0.0);
        let pairs: Vec<[DVec3; 2]> = cloud(30).into_iter().map(|p| [p, bend(p)]).collect();
        let warp = Warp::of_pairs(&pairs).unwrap();
        assert!(warp.bent > 1e-3);
        assert!(pairs.iter().all(|[p, q]| warp.point(*p).distance(*q) < 1e-10));
        let (x, h) = (DVec3::new(0.4, 0.5, 0.6), 1e-5);
        let slope = DMat3::from_cols(
            warp.point(x + DVec3::X * h) - warp.point(x - DVec3::X * h),
            warp.point(x + DVec3::Y * h) - warp.point(x - DVec3::Y * h),
            warp.point(x + DVec3::Z * h) - warp.point(x - DVec3::Z * h),
        ) * (0.5 / h);
        assert!((warp.turn(x).unwrap().scale.powi(3) - slope.determinant()).abs() < 1e-8);
    }

    #[test]
    fn pairs_that_tell_no_map_are_refused() {
        let told = |pairs: &[[DVec3; 2]]| Warp::of_pairs(pairs).unwrap_err().to_string();
        let same = |points: &[DVec3]| points.iter().map(|&p| [p, p]).collect::<Vec<_>>();
        assert!(told(&same(&cloud(2))).contains("2 pairs are given"));
        assert!(told(&same(&[DVec3::ZERO, DVec3::X, DVec3::X * 3.0])).contains("on a line"));
        assert!(told(&same(&[DVec3::ZERO, DVec3::X, DVec3::NAN])).contains("pair 3 has a number"));
        assert!(told(&same(&[DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X])).contains("pairs 2 and 4"));
        let mirrored: Vec<[DVec3; 2]> = cloud(8).into_iter().map(|p| [p, p * DVec3::new(-1.0, 1.0, 1.0)]).collect();
        assert!(told(&mirrored).contains("mirror image") && told(&mirrored[..5]).contains("mirror image"));
    }
}
