//! Polylines: lengths along them and places at a length.

use glam::DVec3;

/// Length of a polyline.
pub fn length(points: impl IntoIterator<Item = DVec3>) -> f64 {
    let mut points = points.into_iter();
    let Some(mut last) = points.next() else { return 0.0 };
    let mut sum = 0.0;
    for p in points {
        sum += last.distance(p);
        last = p;
    }
    sum
}

/// For each point the length of the polyline up to it: 0 at the first, the whole length at the last.
pub fn arc_lengths(points: impl IntoIterator<Item = DVec3>) -> Vec<f64> {
    let mut sum = 0.0;
    let mut last = None;
    let along = points.into_iter().map(|p| {
        sum += last.map_or(0.0, |q: DVec3| q.distance(p));
        last = Some(p);
        sum
    });
    along.collect()
}

/// A walk along a polyline, by its length.
pub struct Along {
    sums: Vec<f64>,
    segment: usize,
}

impl Along {
    /// A walk from the first point of a polyline of two or more.
    pub fn new(points: impl IntoIterator<Item = DVec3>) -> Along {
        Along { sums: arc_lengths(points), segment: 0 }
    }

    /// The whole length.
    pub fn length(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    /// Goes on to a length, no less than the one before: the segment there and the share of it, 0 to 1.
    pub fn advance(&mut self, target: f64) -> (usize, f64) {
        while self.segment + 2 < self.sums.len() && self.sums[self.segment + 1] <= target {
            self.segment += 1;
        }
        let start = self.sums[self.segment];
        let span = self.sums[self.segment + 1] - start;
        (self.segment, if span > 0.0 { ((target - start) / span).clamp(0.0, 1.0) } else { 0.0 })
    }
}

/// The place at `target` of the length of a polyline; its last point beyond that, the origin if it has none.
pub fn at_length(points: &[DVec3], target: f64) -> DVec3 {
    let mut left = target;
    for w in points.windows(2) {
        let step = w[0].distance(w[1]);
        if left <= step {
            return w[0].lerp(w[1], if step > 0.0 { left / step } else { 0.0 });
        }
        left -= step;
    }
    points.last().copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_of_side_2_is_6_long_over_three_sides_and_halfway_lies_in_the_middle_of_the_second() {
        let square = [DVec3::ZERO, 2.0 * DVec3::X, DVec3::new(2.0, 2.0, 0.0), 2.0 * DVec3::Y];
        assert_eq!(length(square), 6.0);
        assert_eq!(arc_lengths(square), [0.0, 2.0, 4.0, 6.0]);
        assert_eq!(at_length(&square, 3.0), DVec3::new(2.0, 1.0, 0.0));
        assert_eq!((at_length(&square, 0.0), at_length(&square, 7.0)), (square[0], square[3]));
        let mut along = Along::new(square);
        assert_eq!(
            [0.0, 1.0, 2.0, 5.0, 6.0].map(|s| along.advance(s)),
            [(0, 0.0), (0, 0.5), (1, 0.0), (2, 0.5), (2, 1.0)]
        );
        assert_eq!((length([]), length([DVec3::X]), arc_lengths([DVec3::X])), (0.0, 0.0, vec![0.0]));
    }
}
