//! Points parted into bricks of at most so many, by planes across the longest side of what is to be parted (Bentley 1975,
//! *Multidimensional Binary Search Trees*).
//!
//! The bricks follow from the points alone, so that what is made of them does not depend on the machine.

use crate::geom::{Aabb, is_positive};
use crate::observe::{Cancelled, Observer, Silent};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A box of space with the points in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Brick {
    /// The box: points on its lower faces are in it, those on its upper ones are not. Infinite where no brick is beyond.
    pub aabb: Aabb,
    /// Box of its points, world units.
    pub bounds: Aabb,
    /// Its points, as a range of [`Partition::order`].
    pub range: std::ops::Range<usize>,
}

impl Brick {
    /// Is a point in the box?
    pub fn holds(&self, p: DVec3) -> bool {
        self.is_near(p, 0.0)
    }

    /// Is a point in the box or within `halo` of it, along the axes?
    pub fn is_near(&self, p: DVec3, halo: f64) -> bool {
        let reach = self.reach(halo);
        p.cmpge(reach.min).all() && p.cmplt(reach.max).all()
    }

    /// The box and what is within `halo` of it, along the axes.
    pub fn reach(&self, halo: f64) -> Aabb {
        Aabb { min: self.aabb.min - halo, max: self.aabb.max + halo }
    }
}

/// Bricks that fill all space.
#[derive(Clone, Debug, PartialEq)]
pub struct Partition {
    /// The bricks.
    pub bricks: Vec<Brick>,
    /// All finite points, as indices, brick after brick.
    pub order: Vec<u32>,
}

impl Partition {
    /// Parts the finite ones of `points` into bricks of at most `most`, but for points that lie in one place.
    pub fn new(points: &[DVec3], most: usize) -> Partition {
        let everywhere = Aabb { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY };
        Partition::within(points, most, everywhere, &Silent).expect("it is silent")
    }

    /// As [`Partition::new`], for bricks that fill a box.
    /// # Errors
    /// [`Cancelled`] by the observer.
    pub fn within(points: &[DVec3], most: usize, aabb: Aabb, observer: &dyn Observer) -> Result<Partition, Cancelled> {
        let mut order: Vec<u32> = (0..points.len() as u32).filter(|&i| points[i as usize].is_finite()).collect();
        let mut bricks = Vec::new();
        divide(Parted { points, most: most.max(1), observer }, &mut order, 0, aabb, &mut bricks)?;
        Ok(Partition { bricks, order })
    }

    /// The points in a brick or within `halo` of it, as ascending indices.
    pub fn around(&self, points: &[DVec3], brick: usize, halo: f64) -> Vec<u32> {
        let reach = self.bricks[brick].reach(halo);
        let mut found = Vec::new();
        for (k, other) in self.bricks.iter().enumerate() {
            let own = &self.order[other.range.clone()];
            if k == brick {
                found.extend(own);
            } else if other.bounds.meets(&reach) {
                found.extend(own.iter().filter(|&&i| self.bricks[brick].is_near(points[i as usize], halo)));
            }
        }
        found.sort_unstable();
        found
    }
}

/// What is parted, and into bricks of how many points at most.
#[derive(Clone, Copy)]
struct Parted<'a> {
    points: &'a [DVec3],
    most: usize,
    observer: &'a dyn Observer,
}

/// The median of some places: what lies on the cut is beyond it. Where all below lies on it, too, the next place.
fn cut(mut places: Vec<f64>, least: f64) -> f64 {
    let middle = places.len() / 2;
    let (_, &mut median, _) = places.select_nth_unstable_by(middle, f64::total_cmp);
    match least < median {
        true => median,
        false => places.into_iter().filter(|&x| x > median).fold(f64::INFINITY, f64::min),
    }
}

/// Brings those that are below to the front, and both sorts keep their order. Returns how many are below.
fn part_stably(order: &mut [u32], is_below: impl Fn(u32) -> bool) -> usize {
    let (below, above): (Vec<u32>, Vec<u32>) = order.iter().partition(|&&i| is_below(i));
    order[..below.len()].copy_from_slice(&below);
    order[below.len()..].copy_from_slice(&above);
    below.len()
}

/// * `order` - indices of some of the points, ascending; they become ascending in each brick
/// * `from` - how many are in the bricks before
fn divide(
    parted: Parted,
    order: &mut [u32],
    from: usize,
    aabb: Aabb,
    bricks: &mut Vec<Brick>,
) -> Result<(), Cancelled> {
    parted.observer.check()?;
    let bounds = Aabb::of(order.iter().map(|&i| &parted.points[i as usize]));
    let size = bounds.size();
    let axis = (0..3).fold(0, |best, a| if size[a] > size[best] { a } else { best });
    if order.len() <= parted.most || !is_positive(size[axis]) {
        bricks.push(Brick { aabb, bounds, range: from..from + order.len() });
        return Ok(());
    }
    let at = |i: u32| parted.points[i as usize][axis];
    let cut = cut(order.iter().map(|&i| at(i)).collect(), bounds.min[axis]);
    parted.observer.check()?;
    let split = part_stably(order, |i| at(i) < cut);
    let (mut below, mut above) = (aabb, aabb);
    (below.max[axis], above.min[axis]) = (cut, cut);
    let (low, high) = order.split_at_mut(split);
    divide(parted, low, from, below, bricks)?;
    divide(parted, high, from + split, above, bricks)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;

    #[test]
    fn every_point_is_in_one_brick_and_a_halo_holds_exactly_what_is_near() {
        let n = 10_000u64;
        // One third in one place, one third on a line, a NaN.
        let place = |i: u64| {
            let r = |k: u64| random::unit(3, 3 * i + k);
            if i.is_multiple_of(3) {
                DVec3::splat(0.5)
            } else {
                DVec3::new(r(0), if i % 3 == 1 { 0.5 } else { r(1) }, r(2))
            }
        };
        let mut points: Vec<DVec3> = (0..n).map(place).collect();
        points[7] = DVec3::NAN;
        let parts = Partition::new(&points, 500);
        let mut all = parts.order.clone();
        all.sort_unstable();
        assert_eq!(all, (0..n as u32).filter(|&i| i != 7).collect::<Vec<_>>());
        for (k, brick) in parts.bricks.iter().enumerate() {
            let own = &parts.order[brick.range.clone()];
            assert!(own.len() <= 500 || brick.bounds.size() == DVec3::ZERO, "{}", own.len());
            for &i in own {
                let p = points[i as usize];
                assert_eq!(parts.bricks.iter().filter(|b| b.holds(p)).count(), 1);
                assert!(brick.holds(p));
            }
            let near = parts.around(&points, k, 0.1);
            let reach = brick.reach(0.1);
            let expected = (0..n as u32).filter(|&i| {
                let p = points[i as usize];
                p.cmpge(reach.min).all() && p.cmplt(reach.max).all()
            });
            assert_eq!(near, expected.collect::<Vec<_>>());
        }
    }
}
