//! Features of point-wise fields, found again nearer by.
//!
//! The tangents at two hits meet within second order of the cell size of the feature. Asked again close to that place,
//! the same two surfaces have tangents that meet much nearer to it: each round gains the square of the last.
//!
//! See `docs/methods/fields.md`, "Creases of sources"; [K01] §4.3 takes the tangents of the hits once.

use crate::contour::cell::feature::{Shape, classify, solve};
use crate::field::sample::root;
use crate::field::{Creases, Field};
use crate::geom::Aabb;
use glam::DVec3;

/// Corrects features by asking the field.
pub struct FieldCreases<'a> {
    field: &'a dyn Field,
    sharp: f64,
    corner: f64,
}

/// Fractions of the way from the feature to the hits at which the surfaces are asked again.
const HIT_FRACTIONS: [f64; 3] = [0.3, 0.03, 0.002];
/// The surface is sought on both sides of the tangent, within this fraction of the distance.
const SEARCH_SPAN: f64 = 0.7;
/// All surfaces pass a corner within this fraction of the search's reach.
const OFF_CORNER: f64 = 1e-6;
/// Normals that still belong to the same surface (cosine).
const SAME_SURFACE_COSINE: f64 = 0.8;

impl<'a> FieldCreases<'a> {
    /// Asks `field`; `sharp` and `corner` are the thresholds of the extraction.
    pub fn new(field: &'a dyn Field, sharp: f64, corner: f64) -> FieldCreases<'a> {
        FieldCreases { field, sharp, corner }
    }

    /// The surface of the hit (`s`, `n`) near `p`, at `share` of the way to the hit: a tangent plane of it there.
    fn again(&self, p: DVec3, (s, n): (DVec3, DVec3), share: f64, within: Option<usize>) -> Option<(DVec3, DVec3)> {
        let mut way = s - p;
        let mut across = n;
        if let Some(axis) = within {
            way[axis] = 0.0;
            across[axis] = 0.0;
        }
        let across = across.try_normalize()?;
        let q = p + way * share;
        let span = SEARCH_SPAN * share * way.length();
        let at = |t: f64| q + across * (span * (2.0 * t - 1.0));
        let ends = [at(0.0), at(1.0)];
        let near = self.field.within(&Aabb { min: ends[0].min(ends[1]), max: ends[0].max(ends[1]) });
        let field = near.as_deref().unwrap_or(self.field);
        let (f0, f1) = (field.value(ends[0]), field.value(ends[1]));
        // Inside below the tangent, outside above.
        if !(f0 < 0.0 && f1 >= 0.0) {
            return None;
        }
        let found = at(root(|t| field.value(at(t)), f0, f1));
        let normal = field.gradient(found);
        (normal.dot(n) > SAME_SURFACE_COSINE).then_some((found, normal))
    }
}

impl Creases for FieldCreases<'_> {
    fn face_point(&self, axis: usize, guess: DVec3, a: (DVec3, DVec3), b: (DVec3, DVec3), size: f64) -> Option<DVec3> {
        let mut p = guess;
        let mut found = None;
        for share in HIT_FRACTIONS {
            let (Some(s), Some(t)) = (self.again(p, a, share, Some(axis)), self.again(p, b, share, Some(axis))) else {
                break;
            };
            let mut plane = DVec3::ZERO;
            plane[axis] = 1.0;
            let across = s.1.cross(plane).dot(t.1);
            if across.abs() < 0.02 {
                break;
            }
            let q = solve(&[s, t, (guess, plane)], p, Shape::Corner);
            let is_near = q.distance(guess) < size;
            if !is_near {
                break;
            }
            p = q;
            p[axis] = guess[axis];
            found = Some(p);
        }
        found
    }

    fn inner_point(
        &self,
        guess: DVec3,
        through: &[DVec3],
        corner: bool,
        [low, high]: [DVec3; 2],
        hits: &[(DVec3, DVec3)],
    ) -> Option<DVec3> {
        let size = (high - low).max_element();
        let mut p = guess;
        let mut found = None;
        for share in HIT_FRACTIONS {
            let planes: Vec<_> = hits.iter().filter_map(|&hit| self.again(p, hit, share, None)).collect();
            let normals: Vec<DVec3> = planes.iter().map(|p| p.1).collect();
            let shape = classify(&normals, self.sharp, self.corner);
            if shape == Shape::Smooth {
                break;
            }
            let shape = if corner && shape == Shape::Corner { Shape::Corner } else { Shape::Edge };
            // Along an edge the point stays where it is, between the places at which the edge passes the cell.
            let near = if shape == Shape::Edge && through.len() == 2 { (through[0] + through[1]) / 2.0 } else { p };
            let near = if found.is_some() { p } else { near };
            let q = solve(&planes, near, shape);
            let is_near = q.distance(guess) < size;
            if !is_near {
                break;
            }
            p = q;
            found = Some(p);
        }
        found
    }

    fn nearest(&self, p: DVec3, reach: f64, hits: &[(DVec3, DVec3)]) -> Option<DVec3> {
        let mut found = solve(hits, p, Shape::Edge);
        for share in HIT_FRACTIONS {
            let planes: Vec<_> = hits.iter().filter_map(|&hit| self.again(found, hit, share, None)).collect();
            let normals: Vec<DVec3> = planes.iter().map(|p| p.1).collect();
            if classify(&normals, self.sharp, self.corner) == Shape::Smooth {
                break;
            }
            found = solve(&planes, found, Shape::Edge);
        }
        (found.distance(p) < reach).then_some(found)
    }
    fn corner_near(&self, guess: DVec3, reach: f64, hits: &[(DVec3, DVec3)]) -> Option<DVec3> {
        let normals: Vec<DVec3> = hits.iter().map(|h| h.1).collect();
        if classify(&normals, self.sharp, self.corner) != Shape::Corner {
            return None;
        }
        let mut p = solve(hits, guess, Shape::Corner);
        for share in HIT_FRACTIONS {
            let is_near = p.distance(guess) < reach;
            if !is_near {
                return None;
            }
            let planes: Vec<_> = hits.iter().filter_map(|&hit| self.again(p, hit, share, None)).collect();
            let normals: Vec<DVec3> = planes.iter().map(|p| p.1).collect();
            if classify(&normals, self.sharp, self.corner) != Shape::Corner {
                return None;
            }
            p = solve(&planes, p, Shape::Corner);
        }
        // Where three surfaces do not meet in a point there is none.
        let off = |&(s, n): &(DVec3, DVec3)| n.dot(p - s).abs() > OFF_CORNER * reach;
        let last: Vec<_> = hits.iter().filter_map(|&hit| self.again(p, hit, HIT_FRACTIONS[2], None)).collect();
        (p.distance(guess) < reach && !last.iter().any(off)).then_some(p)
    }
}
