//! A line around points on the screen.

use planish::DVec3;
use planish::geom::is_positive;
use serde::{Deserialize, Serialize};

/// A line around points on the screen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lasso {
    /// What places are relative to.
    pub middle: [f64; 3],
    /// From places to clip space, column by column.
    pub view: [f64; 16],
    /// Its corners.
    pub line: Vec<[f64; 2]>,
    /// True for what lies without it.
    pub outside: bool,
}

impl Lasso {
    /// True for a place that is seen within the line.
    pub fn holds(&self, place: DVec3) -> bool {
        let p = (place - DVec3::from_array(self.middle)).to_array();
        let row = |r: usize| (0..3).map(|k| self.view[4 * k + r] * p[k]).sum::<f64>() + self.view[12 + r];
        let w = row(3);
        if !is_positive(w) {
            return false;
        }
        let (x, y) = (row(0) / w, row(1) / w);
        let n = self.line.len();
        let crosses = |k: usize| {
            let ([ax, ay], [bx, by]) = (self.line[k], self.line[(k + 1) % n]);
            (ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax)
        };
        (0..n).filter(|&k| crosses(k)).count() % 2 == 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lasso_holds_what_is_seen_within_it_and_nothing_behind_the_eye() {
        let mut view = [0.0; 16];
        [0, 5, 10, 11].iter().for_each(|&k| view[k] = 1.0);
        // The eye looks along z from the middle, w is z.
        let line = vec![[0.0, 0.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]];
        let lasso = Lasso { middle: [7.0, 0.0, 0.0], view, line, outside: false };
        let holds = |p: [f64; 3]| lasso.holds(DVec3::from_array(p));
        assert!(holds([7.25, 0.25, 1.0]) && holds([7.5, 0.5, 2.0]));
        assert!(!holds([7.75, 0.25, 1.0]) && !holds([6.75, -0.25, -1.0]));
    }
}
