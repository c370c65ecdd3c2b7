//! Surfaces that cross each other, or themselves.
//!
//! 1. Facets stand for the surfaces: triangles with their corners on them, which neighbours share along their curves. What facets
//!    leave the surfaces by is bounded (Filip, Magedson, Markot 1986, *Surface Algorithms Using Bounds on Derivatives*), and so is
//!    the depth of a crossing that they do not show.
//! 2. Pairs of facets that meet in more than what they share, by exact signs (`mesh::intersect`).
//! 3. From each such pair Newton's method looks for a place where both surfaces are: three equations for four parameters, so the
//!    shortest step is taken. What it finds counts where the surfaces have an angle there and it is not on the boundaries of both:
//!    neighbours meet along their curves, and a surface is everywhere where it is itself.

use super::bezier::{Bezier, patches};
use crate::geom::{Aabb, tolerance};
use crate::mesh::TriMesh;
use crate::mesh::intersect::intersections_of;
use crate::observe::{Cancelled, Observer};
use crate::surface::Surface;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Steps of Newton's method: it doubles its digits, of which there are sixteen, once it is near.
const NEWTON_STEPS: usize = 20;
/// Pairs of facets that are tried for two patches at most: a curve along which they cross has many, and one is enough.
const MOST_TRIES: usize = 64;
/// Sine of the angle between the normals below which surfaces touch rather than cross. The place is known to 1e-12 of the
/// diagonal, so that the surfaces are on both sides of each other within a billionth of it.
const LEAST_SINE: f64 = 1e-3;
/// Parameters nearer than this to a boundary are on it, and places of one patch nearer than this to each other are one place.
const ON_BOUNDARY: f64 = 1e-6;

/// Where a triangle of a mesh of surfaces is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet {
    /// Its patch.
    pub patch: u32,
    /// The parameters of its middle.
    pub place: [f64; 2],
}

/// Two patches that cross, or one that crosses itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Their numbers, rising; twice the same where a patch crosses itself.
    pub patches: [u32; 2],
    /// A place where they do.
    pub place: DVec3,
    /// The angle between their normals there, degrees.
    pub angle_deg: f64,
}

/// Finds the patches that cross each other or themselves, one place for each pair of them, by their numbers.
///
/// Nothing is found within a facet of a curve that both patches have, nor what is less deep than twice [`facet_error`].
/// * `mesh` - triangles with corners on the surfaces, with common vertices where neighbours meet
/// * `facets` - one for each of its triangles
/// # Errors
/// [`Cancelled`].
pub fn crossings(
    surfaces: &[Surface],
    mesh: &TriMesh,
    facets: &[Facet],
    observer: &dyn Observer,
) -> Result<Vec<Crossing>, Cancelled> {
    let mut groups: BTreeMap<[u32; 2], Vec<[u32; 2]>> = BTreeMap::new();
    for pair in intersections_of(mesh, |_| true, observer)? {
        let [a, b] = pair.map(|t| facets[t as usize].patch);
        let (key, pair) = if a <= b { ([a, b], pair) } else { ([b, a], [pair[1], pair[0]]) };
        groups.entry(key).or_default().push(pair);
    }
    let near = tolerance::length(Aabb::of(&mesh.points).diagonal());
    let groups: Vec<([u32; 2], Vec<[u32; 2]>)> = groups.into_iter().collect();
    let search = |(patches, pairs): &([u32; 2], Vec<[u32; 2]>)| {
        observer.check()?;
        let [a, b] = patches.map(|p| &surfaces[p as usize]);
        let step = pairs.len().div_ceil(MOST_TRIES);
        let meet = |pair: &[u32; 2]| {
            let [p, q] = pair.map(|t| facets[t as usize].place);
            let (place, angle_deg) = common(a, b, [p[0], p[1], q[0], q[1]], near)?;
            Some(Crossing { patches: *patches, place, angle_deg })
        };
        Ok(pairs.iter().step_by(step).find_map(meet))
    };
    let found: Result<Vec<Option<Crossing>>, Cancelled> = groups.par_iter().map(search).collect();
    Ok(found?.into_iter().flatten().collect())
}

/// A place that two surfaces have in common and where they cross, from parameters near it; with the angle of their normals,
/// degrees.
/// * `near` - what counts as one place, world units
fn common(a: &Surface, b: &Surface, start: [f64; 4], near: f64) -> Option<(DVec3, f64)> {
    let mut x = start;
    for _ in 0..NEWTON_STEPS {
        let (at_a, at_b) = (a.jet(x[0], x[1]), b.jet(x[2], x[3]));
        let apart = at_a.point - at_b.point;
        if apart.length() <= near {
            let [m, n] = [at_a, at_b].map(|jet| jet.area_vector().normalize_or_zero());
            let sine = m.cross(n).length();
            let is_own = std::ptr::eq(a, b) && (x[0] - x[2]).abs().max((x[1] - x[3]).abs()) <= ON_BOUNDARY;
            let is_crossing =
                sine >= LEAST_SINE && !is_own && !(is_on_boundary(x[0], x[1]) && is_on_boundary(x[2], x[3]));
            return is_crossing.then(|| (at_a.point, sine.atan2(m.dot(n)).to_degrees()));
        }
        let ways = [at_a.u, at_a.v, -at_b.u, -at_b.v];
        let square = ways.iter().fold(DMat3::ZERO, |sum, w| sum + DMat3::from_cols(*w * w.x, *w * w.y, *w * w.z));
        let back = square.inverse() * apart;
        if !back.is_finite() {
            return None;
        }
        for (x, way) in x.iter_mut().zip(ways) {
            *x = (*x - way.dot(back)).clamp(0.0, 1.0);
        }
    }
    None
}

fn is_on_boundary(u: f64, v: f64) -> bool {
    [u, 1.0 - u, v, 1.0 - v].iter().any(|x| *x <= ON_BOUNDARY)
}

/// What triangles leave a surface by at most, world units, if their corners are nodes of even steps in its parameters and their
/// sides lie along these or across a cell.
/// * `shape` - nodes along `v` and along `u`
pub fn facet_error(surface: &Surface, shape: [usize; 2]) -> f64 {
    let [hv, hu] = shape.map(|nodes| 1.0 / nodes.saturating_sub(1).max(1) as f64);
    let leave = |piece: &Bezier| {
        let [uu, uv, vv] = piece.bends();
        (hu * hu * uu + 2.0 * hu * hv * uv + hv * hv * vv) / 8.0
    };
    patches(surface).iter().map(leave).fold(0.0, f64::max)
}
