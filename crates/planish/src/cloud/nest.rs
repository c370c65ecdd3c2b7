//! Which nested maxima and minima of sheets explain points.
//!
//! METHODS 1.2 after Ohtake, Belyaev, Alexa, Turk, Seidel, *Multi-level Partition of Unity Implicits*, 2003, §4: near an
//! edge a quadric is no model, but the maximum or minimum of two is; a corner nests them.
//!
//! Departs from the source: sheets are not told by the angle of normals but by the likelihood of the points under the
//! zero set of the nesting, so the faces of a wedge are found as well as the two sides of a plate. A union of sheets
//! would not do: it lets every point choose its sheet, and noise alone then pays for a second one. For the same reason a
//! point above which the surface lies m-fold pays 2 ln m: twice the area has half the density of points.

use super::points::{Join, joined_cost};
use glam::DVec3;

/// Most sheets that are nested: a corner of four faces.
pub(super) const MOST: usize = 4;
/// Residuals count up to this many noise levels.
pub(super) const LIMIT: f64 = 3.0;

/// A place belongs to the surface if the nesting is this close to zero there, in noise levels.
const ON: f64 = 0.25;

/// One sheet as the points see it.
#[derive(Clone, Debug)]
pub(super) struct Seen {
    /// Signed distance of every point, in noise levels.
    pub residuals: Vec<f64>,
    /// Unit normal in the middle of the points.
    pub normal: DVec3,
    /// What it must explain to be chosen, in squared noise levels.
    pub price: f64,
}

impl Seen {
    /// The same sheet counted with this sign.
    fn turned(&self, sign: f64) -> Seen {
        Seen {
            residuals: self.residuals.iter().map(|r| sign * r).collect(),
            normal: sign * self.normal,
            price: self.price,
        }
    }
}

/// Nested maxima and minima.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Nesting {
    /// Sheets from the innermost outwards, as indices into what was asked.
    pub order: Vec<usize>,
    /// Bit k: sheet `order[k]` counts with the other sign.
    pub flipped: u8,
    /// Bit k: sheet `order[k]` is joined by the minimum.
    pub concave: u8,
    /// Sum of squared residuals, each at most the square of [`LIMIT`], and of what folds of the surface cost.
    pub cost: f64,
    /// Cost and the prices of its sheets.
    pub total: f64,
}

/// Sheets that are tried in each step: those whose union with the chosen ones explains most.
const TRIED: usize = 6;
/// Structures are compared on about this many points; the best of each step is then asked of all.
const ENOUGH: usize = 60;

/// Sum of squared residuals (in noise levels), each at most the square of [`LIMIT`].
pub(super) fn cost(residuals: &[f64]) -> f64 {
    joined_cost(&[(residuals, Join::Nearest)])
}

/// The nesting of least cost plus prices, of at most `most` sheets.
///
/// * `asked` - the sheets; the first wins ties
/// * `free` - the signs of the sheets are not known to fit each other
pub(super) fn nest(asked: &[Seen], free: bool, most: usize) -> Option<Nesting> {
    let first =
        (0..asked.len()).map(|i| (cost(&asked[i].residuals) + asked[i].price, i)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let price = |order: &[usize]| order.iter().map(|&k| asked[k].price).sum::<f64>();
    let mut best =
        Nesting { order: vec![first.1], flipped: 0, concave: 0, cost: first.0 - asked[first.1].price, total: first.0 };
    let step = asked[0].residuals.len().div_ceil(ENOUGH).max(1);
    let all: Vec<&[f64]> = asked.iter().map(|a| &a.residuals[..]).collect();
    let thinned: Vec<Vec<f64>> = all.iter().map(|r| r.iter().step_by(step).copied().collect()).collect();
    let some: Vec<&[f64]> = thinned.iter().map(|r| &r[..]).collect();
    // One sheet after the other, each the best that can be joined to those chosen, in all nestings of the set. The second
    // may come with another first: between the two sides of a plate one sheet alone does best in the middle.
    while best.order.len() < most.min(MOST) {
        let sets: Vec<Vec<usize>> = if best.order.len() == 1 {
            (0..asked.len()).flat_map(|i| (0..i).map(move |j| vec![j, i])).collect()
        } else {
            let others = (0..asked.len()).filter(|i| !best.order.contains(i));
            others.map(|i| best.order.iter().copied().chain([i]).collect()).collect()
        };
        // No nesting explains more than the union.
        let mut bound: Vec<(f64, Vec<usize>)> = sets
            .into_iter()
            .map(|set| (nearest_cost(set.iter().map(|&i| all[i])) + price(&set), set))
            .filter(|b| b.0 < best.total)
            .collect();
        bound.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
        bound.truncate(TRIED);
        let mut next: Option<Nesting> = None;
        for (union, set) in bound {
            let limit = next.as_ref().map_or(best.total, |n| n.total);
            if union >= limit {
                break;
            }
            let priced = price(&set);
            let mut found: Option<Nesting> = None;
            for order in orders(&set) {
                let joints = order.len() - 1;
                let signs = if free { 1u8 << joints } else { 1 };
                for flips in 0..signs {
                    for ops in 0..1u8 << joints {
                        let (flipped, concave) = (flips << 1, ops << 1);
                        let part = nesting_cost(&some, &order, flipped, concave);
                        if found.as_ref().is_none_or(|n| part < n.cost) {
                            found = Some(Nesting { order: order.clone(), flipped, concave, cost: part, total: 0.0 });
                        }
                    }
                }
            }
            let Some(mut found) = found else { continue };
            found.cost = nesting_cost(&all, &found.order, found.flipped, found.concave);
            if found.cost + priced < limit {
                let set: Vec<Seen> =
                    found.order.iter().enumerate().map(|(k, &i)| asked[i].turned(sign(found.flipped, k))).collect();
                found.cost += folds(&set, found.concave);
                found.total = found.cost + priced;
                if found.total < limit {
                    next = Some(found);
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

/// Cost if every point belonged to the sheet nearest to it.
fn nearest_cost<'a>(rows: impl Iterator<Item = &'a [f64]>) -> f64 {
    let mut signed = [([].as_slice(), Join::Nearest); MOST];
    let count = signed.iter_mut().zip(rows).map(|(s, row)| s.0 = row).count();
    joined_cost(&signed[..count])
}

/// Cost of a nesting of these sheets.
fn nesting_cost(rows: &[&[f64]], order: &[usize], flipped: u8, concave: u8) -> f64 {
    let mut signed = [([].as_slice(), Join::Nearest); MOST];
    for (k, (s, &i)) in signed.iter_mut().zip(order).enumerate() {
        let sign = sign(flipped, k);
        *s = (rows[i], if concave >> k & 1 == 1 { Join::Least(sign) } else { Join::Greatest(sign) });
    }
    joined_cost(&signed[..order.len()])
}

fn sign(flipped: u8, k: usize) -> f64 {
    if flipped >> k & 1 == 1 { -1.0 } else { 1.0 }
}

/// The sheet that decides where the sheets have these values, and its value.
pub(super) fn joined(values: impl IntoIterator<Item = f64>, concave: u8) -> (usize, f64) {
    let mut values = values.into_iter().enumerate();
    let first = values.next().unwrap_or((0, f64::NAN));
    values.fold(first, |best, next| if (next.1 < best.1) == (concave >> next.0 & 1 == 1) { next } else { best })
}

/// What the points pay for lying above several sheets of the surface at once: twice the logarithm of how many.
pub(super) fn folds(sheets: &[Seen], concave: u8) -> f64 {
    let m = sheets.len();
    let mut turn = [[0.0; MOST]; MOST];
    for j in 0..m {
        for k in 0..m {
            turn[j][k] = sheets[j].normal.dot(sheets[k].normal);
        }
    }
    let mut price = 0.0;
    for q in 0..sheets[0].residuals.len() {
        let mut at = [0.0; MOST];
        (0..m).for_each(|k| at[k] = sheets[k].residuals[q]);
        // The foot of the point on sheet k is part of the surface if the nesting vanishes there. Sheets at right angles
        // do not lie above each other; a foot on the edge itself would count as if they did.
        let own = (0..m).fold(0, |a, k| if at[k].abs() < at[a].abs() { k } else { a });
        let mut layers = 1.0;
        for k in (0..m).filter(|&k| k != own) {
            let foot = |j: usize| if j == k { 0.0 } else { at[j] - at[k] * turn[j][k] };
            let mut f = foot(0);
            for j in 1..m {
                f = if concave >> j & 1 == 1 { f.min(foot(j)) } else { f.max(foot(j)) };
            }
            if f.abs() < ON {
                layers += turn[k][own].abs();
            }
        }
        if layers > 1.0 {
            price += 2.0 * f64::ln(layers);
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
