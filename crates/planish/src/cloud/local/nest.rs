//! Which nested maxima and minima of sheets explain points.
//!
//! Ohtake, Belyaev, Alexa, Turk, Seidel, *Multi-level Partition of Unity Implicits*, 2003, §4: near an edge a quadric
//! is no model, but the maximum or minimum of two is; a corner nests them.
//!
//! Departs from the source: sheets are not told by the angle of normals but by the likelihood of the points under the
//! zero set of the nesting, so the faces of a wedge are found as well as the two sides of a plate. A union of sheets
//! would not do: it lets every point choose its sheet, and noise alone then pays for a second one. For the same reason a
//! point above which the surface lies m-fold pays 2 ln m: twice the area has half the density of points.

use super::joints::{Join, capped, folded, joined_cost, nearest_cost, thinned};
use glam::DVec3;

/// Most sheets that are nested: a corner of four faces.
pub(crate) const MOST_NESTED: usize = 4;

/// A place belongs to the surface if the nesting is this close to zero there, in noise levels.
const ON_SURFACE_NOISE: f64 = 0.25;

/// One sheet as the points see it.
#[derive(Clone, Debug)]
pub(crate) struct Seen {
    /// Signed distance of every point, in noise levels.
    pub residuals: Vec<f64>,
    /// Unit normal in the middle of the points.
    pub normal: DVec3,
    /// What it must explain to be chosen, in squared noise levels.
    pub price: f64,
}

/// A sheet of a nesting.
#[derive(Clone, Copy)]
pub(crate) struct Face<'a> {
    /// Signed distance of every point, in noise levels.
    pub residuals: &'a [f64],
    /// 1, or -1 if the sheet counts turned over.
    pub sign: f64,
    /// Unit normal of the sheet as it is.
    pub normal: DVec3,
}

/// Nested maxima and minima.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Nesting {
    /// Sheets from the innermost outwards, as indices into what was asked.
    pub order: Vec<usize>,
    /// Bit k: sheet `order[k]` counts with the other sign.
    pub flipped: u8,
    /// Bit k: sheet `order[k]` is joined by the minimum.
    pub concave: u8,
    /// Sum of squared residuals, each at most the square of [`LIMIT`], and of what folds of the surface cost.
    pub cost: f64,
    /// What folds cost of that.
    pub folds: f64,
    /// Cost and the prices of its sheets.
    pub total: f64,
}

/// Sheets that are tried in each step: those whose union with the chosen ones explains most.
const STRUCTURES_TRIED: usize = 6;
/// Structures are compared on about this many points; the best of each step is then asked of all.
const COMPARED_POINTS: usize = 60;

/// Sum of squared residuals (in noise levels), each at most the square of [`LIMIT`].
pub(crate) fn cost(residuals: &[f64]) -> f64 {
    joined_cost(&[(residuals, Join::Greatest(1.0))], f64::INFINITY)
}

/// A few of the sheets that are asked, ascending but for the last; places past `count` are zero.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Set {
    items: [usize; MOST_NESTED],
    count: usize,
}

impl Set {
    fn of(items: &[usize]) -> Set {
        let mut set = Set { items: [0; MOST_NESTED], count: items.len() };
        set.items[..items.len()].copy_from_slice(items);
        set
    }

    fn with(mut self, item: usize) -> Set {
        self.items[self.count] = item;
        self.count += 1;
        self
    }

    fn items(&self) -> &[usize] {
        &self.items[..self.count]
    }
}

/// The nesting of least cost plus prices, of at most `most` sheets.
///
/// * `asked` - the sheets; the first wins ties
/// * `free` - the signs of the sheets are not known to fit each other
pub(crate) fn nest(asked: &[Seen], free: bool, most: usize) -> Option<Nesting> {
    let squares: Vec<Vec<f64>> = asked.iter().map(|a| capped(&a.residuals)).collect();
    let alone = |i: usize| nearest_cost(&[&squares[i]], f64::INFINITY);
    let first = (0..asked.len()).map(|i| (alone(i) + asked[i].price, i)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let price = |order: &[usize]| order.iter().map(|&k| asked[k].price).sum::<f64>();
    let mut best = Nesting {
        order: vec![first.1],
        flipped: 0,
        concave: 0,
        cost: first.0 - asked[first.1].price,
        folds: 0.0,
        total: first.0,
    };
    let step = asked[0].residuals.len().div_ceil(COMPARED_POINTS).max(1);
    let all: Vec<&[f64]> = asked.iter().map(|a| &a.residuals[..]).collect();
    let mut compared: Vec<Vec<f64>> = vec![Vec::new(); asked.len()];
    // One sheet after the other, each the best that can be joined to those chosen, in all nestings of the set. The second
    // may come with another first: between the two sides of a plate one sheet alone does best in the middle.
    while best.order.len() < most.min(MOST_NESTED) {
        let chosen = Set::of(&best.order);
        // No nesting explains more than the union. The sets whose unions explain most, rising:
        let mut bound: Vec<(f64, Set)> = Vec::with_capacity(STRUCTURES_TRIED + 1);
        let mut hear = |set: Set| {
            let priced = price(set.items());
            let least = if bound.len() == STRUCTURES_TRIED { bound[STRUCTURES_TRIED - 1].0 } else { best.total };
            let mut rows = [[].as_slice(); MOST_NESTED];
            rows.iter_mut().zip(set.items()).for_each(|(row, &i)| *row = &squares[i]);
            let union = nearest_cost(&rows[..set.count], least - priced) + priced;
            if union > least || union >= best.total {
                return;
            }
            let at = bound.partition_point(|b| b.0.total_cmp(&union).then_with(|| b.1.cmp(&set)).is_lt());
            bound.insert(at, (union, set));
            bound.truncate(STRUCTURES_TRIED);
        };
        if chosen.count == 1 {
            (0..asked.len()).for_each(|i| (0..i).for_each(|j| hear(Set::of(&[j, i]))));
        } else {
            (0..asked.len()).filter(|i| !best.order.contains(i)).for_each(|i| hear(chosen.with(i)));
        }
        if bound.is_empty() {
            break;
        }
        let ways = ways(chosen.count + 1, free);
        let mut next: Option<Nesting> = None;
        for (union, set) in bound {
            let limit = next.as_ref().map_or(best.total, |n| n.total);
            if union >= limit {
                break;
            }
            for &i in set.items() {
                if compared[i].is_empty() {
                    compared[i] = thinned(all[i], step);
                }
            }
            let priced = price(set.items());
            let mut found: Option<(f64, &Way)> = None;
            for way in &ways {
                let least = found.map_or(f64::INFINITY, |f| f.0);
                let part = nesting_cost(|k| &compared[set.items[k]], way, least);
                if part < least {
                    found = Some((part, way));
                }
            }
            let Some((_, way)) = found else { continue };
            let cost = nesting_cost(|k| all[set.items[k]], way, limit - priced);
            if cost + priced < limit {
                let order: Vec<usize> = way.order.items().iter().map(|&k| set.items[k]).collect();
                let face = |(k, &i): (usize, &usize)| Face {
                    residuals: all[i],
                    sign: sign(way.flipped, k),
                    normal: asked[i].normal,
                };
                let faces: Vec<Face> = order.iter().enumerate().map(face).collect();
                let folds = folds(&faces, way.concave);
                let cost = cost + folds;
                let total = cost + priced;
                if total < limit {
                    next = Some(Nesting { order, flipped: way.flipped, concave: way.concave, cost, folds, total });
                }
            }
        }
        match next {
            Some(n) => best = n,
            None => break,
        }
    }
    Some(best)
}

/// A way to nest a few sheets.
struct Way {
    /// Places of the sheets among them, from the innermost outwards.
    order: Set,
    /// Bit k: sheet `order[k]` counts with the other sign.
    flipped: u8,
    /// Bit k: sheet `order[k]` is joined by the minimum.
    concave: u8,
}

/// All ways to nest `count` sheets.
/// * `free` - with all signs; else with their own, and only those that give different functions
fn ways(count: usize, free: bool) -> Vec<Way> {
    let joints = count - 1;
    let signs = if free { 1u8 << joints } else { 1 };
    let mut ways = Vec::new();
    for order in orders(&[0, 1, 2, 3][..count]) {
        for (flips, ops) in (0..signs).flat_map(|flips| (0..1u8 << joints).map(move |ops| (flips, ops))) {
            if free || !repeats(&order, ops << 1) {
                ways.push(Way { order: Set::of(&order), flipped: flips << 1, concave: ops << 1 });
            }
        }
    }
    ways
}

/// Does an order give the same function as one that comes before it in [`orders`]? Neighbours that are joined alike commute.
fn repeats(order: &[usize], concave: u8) -> bool {
    (2..order.len()).any(|k| {
        let alike = (concave >> k ^ concave >> (k - 1)) & 1 == 0;
        alike && (order[k] > order[k - 1] || (k == 2 && order[k] > order[0]))
    })
}

/// Cost of a nesting of these sheets, or something above `limit`, if it is.
fn nesting_cost<'a>(row: impl Fn(usize) -> &'a [f64], way: &Way, limit: f64) -> f64 {
    let mut signed = [([].as_slice(), Join::Greatest(1.0)); MOST_NESTED];
    for (k, (s, &i)) in signed.iter_mut().zip(way.order.items()).enumerate() {
        let sign = sign(way.flipped, k);
        *s = (row(i), if way.concave >> k & 1 == 1 { Join::Least(sign) } else { Join::Greatest(sign) });
    }
    joined_cost(&signed[..way.order.count], limit)
}

fn sign(flipped: u8, k: usize) -> f64 {
    if flipped >> k & 1 == 1 { -1.0 } else { 1.0 }
}

/// The sheet that decides where the sheets have these values, and its value.
pub(crate) fn joined(values: impl IntoIterator<Item = f64>, concave: u8) -> (usize, f64) {
    let mut values = values.into_iter().enumerate();
    let first = values.next().unwrap_or((0, f64::NAN));
    values.fold(first, |best, next| if (next.1 < best.1) == (concave >> next.0 & 1 == 1) { next } else { best })
}

/// What the points pay for lying above several sheets of the surface at once: twice the logarithm of how many.
pub(crate) fn folds(sheets: &[Face], concave: u8) -> f64 {
    match *sheets {
        [] | [_] => 0.0,
        [a, b] => {
            let turn = (a.sign * a.normal).dot(b.sign * b.normal);
            let rows = [(a.residuals, a.sign), (b.residuals, b.sign)];
            let above = folded(rows, turn, concave >> 1 & 1 == 1, ON_SURFACE_NOISE);
            above as f64 * 2.0 * turn.abs().ln_1p()
        }
        [a, b, c] => folds_of([a, b, c], concave),
        [a, b, c, d, ..] => folds_of::<MOST_NESTED>([a, b, c, d], concave),
    }
}

/// As [`folds`], of as many sheets as the compiler is told.
fn folds_of<const M: usize>(sheets: [Face; M], concave: u8) -> f64 {
    let directions = sheets.map(|s| s.sign * s.normal);
    let turn = directions.map(|a| directions.map(|b| a.dot(b)));
    let least: [bool; M] = std::array::from_fn(|j| concave >> j & 1 == 1);
    // Logarithms by the sheet of the point and the set of those above it.
    let mut known = [[f64::NAN; 1 << MOST_NESTED]; M];
    let mut price = 0.0;
    for q in 0..sheets[0].residuals.len() {
        let at = sheets.map(|s| s.sign * s.residuals[q]);
        // The foot of the point on sheet k is part of the surface if the nesting vanishes there. Sheets at right angles
        // do not lie above each other; a foot on the edge itself would count as if they did.
        let own = (0..M).fold(0, |a, k| if at[k].abs() < at[a].abs() { k } else { a });
        let (mut layers, mut above) = (1.0, 0);
        for k in (0..M).filter(|&k| k != own) {
            let foot = |j: usize| if j == k { 0.0 } else { at[j] - at[k] * turn[j][k] };
            let f = (1..M).fold(foot(0), |f, j| if least[j] { f.min(foot(j)) } else { f.max(foot(j)) });
            if f.abs() < ON_SURFACE_NOISE {
                layers += turn[k][own].abs();
                above |= 1 << k;
            }
        }
        if above != 0 {
            let log: &mut f64 = &mut known[own][above];
            if log.is_nan() {
                *log = 2.0 * f64::ln(layers);
            }
            price += *log;
        }
    }
    price
}

/// All orders of a few sheets; the first two stand as they come, since joining two is the same both ways.
fn orders(items: &[usize]) -> Vec<Vec<usize>> {
    if items.len() < 3 {
        return vec![items.to_vec()];
    }
    let mut all = Vec::new();
    for last in 0..items.len() {
        let rest: Vec<usize> = (0..items.len()).filter(|&k| k != last).map(|k| items[k]).collect();
        for mut order in orders(&rest) {
            order.push(items[last]);
            all.push(order);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;
    use glam::DVec3;

    fn gauss(n: u64) -> f64 {
        random::normal(random::unit(9, 2 * n), random::unit(9, 2 * n + 1))
    }

    /// Distances to planes in noise levels, of points on the boundary of a corner of a cube 40 levels wide.
    fn corner(faces: usize) -> Vec<Seen> {
        let points: Vec<DVec3> = (0..300u64)
            .map(|i| {
                let mut p = DVec3::new(-40.0 * random::unit(1, 2 * i), -40.0 * random::unit(1, 2 * i + 1), 0.0);
                p = [p, DVec3::new(p.z, p.x, p.y), DVec3::new(p.x, p.z, p.y)][i as usize % faces];
                p + DVec3::new(gauss(3 * i), gauss(3 * i + 1), gauss(3 * i + 2))
            })
            .collect();
        let planes = [DVec3::Z, DVec3::X, DVec3::Y];
        planes
            .map(|normal| Seen { residuals: points.iter().map(|p| p.dot(normal)).collect(), normal, price: 14.0 })
            .to_vec()
    }

    #[test]
    fn a_plane_an_edge_and_a_corner_need_one_two_and_three_sheets() {
        for faces in 1..=3 {
            let all = corner(faces);
            let found = nest(&all, false, 4).unwrap();
            let mut order = found.order.clone();
            order.sort_unstable();
            assert_eq!(order, (0..faces).collect::<Vec<_>>());
            assert_eq!(found.concave, 0);
            assert!(found.cost < 1.2 * 300.0, "{}", found.cost);
        }
    }

    #[test]
    fn without_signs_a_corner_of_three_faces_is_found_up_to_its_side() {
        let mut all = corner(3);
        all[1].normal = -all[1].normal;
        all[1].residuals.iter_mut().for_each(|r| *r = -*r);
        let found = nest(&all, true, 4).unwrap();
        assert_eq!(found.order.len(), 3);
        assert!(found.cost < 1.2 * 300.0);
        assert!(nest(&all, false, 4).unwrap().cost > found.cost + 100.0);
    }

    #[test]
    fn noise_alone_does_not_pay_for_a_second_sheet_one_or_two_and_a_half_levels_away() {
        for seed in 0..20 {
            let r: Vec<f64> = (0..200).map(|k| gauss(200 * seed + k)).collect();
            let all = [0.0, -1.0, 1.0, -2.5, 2.5].map(|o| Seen {
                residuals: r.iter().map(|d| d + o).collect(),
                normal: DVec3::Z,
                price: 14.0,
            });
            assert_eq!(nest(&all, true, 4).unwrap().order, [0]);
        }
    }
}
