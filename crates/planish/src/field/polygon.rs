//! Simple polygons of the plane and the distance from them.
//!
//! Outlines of the solids of `docs/guide/solids.md`.

use crate::geom::predicates::segments_meet;
use glam::DVec2;

/// A simple polygon that runs counter-clockwise.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    points: Vec<DVec2>,
}

/// Why points are no polygon.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PolygonError {
    /// Fewer than three points.
    #[error("a polygon needs at least 3 points, {count} are given")]
    TooFew {
        /// Points given.
        count: usize,
    },
    /// Two sides cross or touch.
    #[error("sides {a} and {b} of the polygon meet; it must not touch itself")]
    Crosses {
        /// One side, from 0: from point `a` to the next.
        a: usize,
        /// The other.
        b: usize,
    },
    /// No area.
    #[error("the polygon has no area")]
    NoArea,
}

impl Polygon {
    /// A polygon through `points`; turned round if it runs clockwise.
    /// # Errors
    /// [`PolygonError`] if the points are no simple polygon.
    pub fn new(mut points: Vec<DVec2>) -> Result<Polygon, PolygonError> {
        let n = points.len();
        if n < 3 {
            return Err(PolygonError::TooFew { count: n });
        }
        for a in 0..n {
            for b in a + 2..n {
                if (b + 1) % n == a {
                    continue;
                }
                if segments_meet(points[a], points[a + 1], points[b], points[(b + 1) % n]) {
                    return Err(PolygonError::Crosses { a, b });
                }
            }
        }
        let area: f64 = (0..n).map(|k| points[k].perp_dot(points[(k + 1) % n])).sum();
        if area == 0.0 || !area.is_finite() {
            return Err(PolygonError::NoArea);
        }
        if area < 0.0 {
            points.reverse();
        }
        Ok(Polygon { points })
    }

    /// Least and greatest coordinates.
    pub fn bounds(&self) -> [DVec2; 2] {
        let low = self.points.iter().fold(DVec2::INFINITY, |a, &b| a.min(b));
        [low, self.points.iter().fold(DVec2::NEG_INFINITY, |a, &b| a.max(b))]
    }

    /// Signed distance (negative inside) and its unit gradient.
    pub fn distance(&self, p: DVec2) -> (f64, DVec2) {
        let n = self.points.len();
        let (mut best, mut nearest, mut normal) = (f64::INFINITY, DVec2::ZERO, DVec2::X);
        let mut inside = false;
        for k in 0..n {
            let (a, b) = (self.points[k], self.points[(k + 1) % n]);
            let d = b - a;
            let q = a + d * ((p - a).dot(d) / d.length_squared()).clamp(0.0, 1.0);
            let l = q.distance_squared(p);
            if l < best {
                (best, nearest, normal) = (l, q, DVec2::new(d.y, -d.x).normalize());
            }
            if (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * d.x {
                inside = !inside;
            }
        }
        let l = best.sqrt();
        // On the outline itself the difference has no direction.
        let out = if l > 1e-9 * self.points[0].distance(self.points[1]) { (p - nearest) / l } else { normal };
        if inside { (-l, if out == normal { normal } else { -out }) } else { (l, out) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clockwise_squares_are_turned_and_crossing_sides_are_told() {
        let square = [(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)].map(|(x, y)| DVec2::new(x, y));
        let p = Polygon::new(square.to_vec()).unwrap();
        assert_eq!(p.distance(DVec2::new(0.5, 0.25)), (-0.25, DVec2::new(0.0, -1.0)));
        assert_eq!(p.distance(DVec2::new(3.0, 0.5)), (2.0, DVec2::X));
        let bow = [square[0], square[2], square[1], square[3]];
        assert_eq!(Polygon::new(bow.to_vec()), Err(PolygonError::Crosses { a: 0, b: 2 }));
        assert_eq!(Polygon::new(square[..2].to_vec()), Err(PolygonError::TooFew { count: 2 }));
    }
}
