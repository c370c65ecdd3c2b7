//! What is unknown, and the equations along the seams.
//!
//! Unknown is every control point once, however many patches share it; the three coordinates have the same coefficients.

use super::star::Gluing;
use crate::mesh::sets::Sets;
use crate::network::Network;
use crate::surface::Surface;
use crate::surface::basis::{basis_at, span_samples};
use crate::surface::seam::bend::Side;
use crate::surface::sides::{knots_along, node, place, side_len};
use glam::DVec3;

/// Places per knot span at which a seam is held: what the equation leaves is of degree 4 in each span and has no jumps between
/// them, so that it vanishes if it does at four places of each and at the end.
const SPAN_PLACES: usize = 4;
/// No unknown.
const NONE: u32 = u32::MAX;
/// Relative length of the part of a derivative perpendicular to the seam below which there is no angle to speak of.
const FLAT: f64 = 1e-3;

/// Patch, control point and coefficient of the terms of a sum.
type Places = Vec<(usize, usize, f64)>;

/// How a curve is treated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Seam {
    /// One tangent plane, by conditions.
    Exact,
    /// Smooth by a weight: it keeps the angle that it had, or less.
    Weighed,
    /// Sharp, an edge, or a border.
    None,
}

/// Numbers of the unknowns.
pub(super) struct Shared {
    pub count: usize,
    /// For each patch and control point; empty for patches that stay.
    of: Vec<Vec<u32>>,
}

impl Shared {
    /// Unknown are the patches at exact seams, and beside them the insides of patches that share a curve with one of these.
    /// Corners move where smooth seams lead all around.
    /// * `held` - patches of which nothing moves; no exact seam is theirs. All curves leave their corners as they did: between curves
    ///   that do not move there is but one direction for each, and the least error in one turns another by much.
    pub fn new(network: &Network, surfaces: &[Surface], seams: &[Seam], held: &[bool]) -> Shared {
        let sides = |p: usize| network.patches[p].sides.map(|side| side.curve as usize);
        let all = 0..surfaces.len();
        let is_active = |p: usize| sides(p).iter().any(|&c| seams[c] == Seam::Exact);
        let mut moves = vec![false; network.curves.len()];
        all.clone().filter(|&p| is_active(p)).flat_map(sides).for_each(|c| moves[c] = true);
        all.clone().filter(|&p| held[p]).flat_map(sides).for_each(|c| moves[c] = false);
        let is_in = |p: usize| !held[p] && sides(p).iter().any(|&c| moves[c]);
        let mut free = vec![true; network.corners.len()];
        for p in all.clone() {
            for (k, c) in sides(p).into_iter().enumerate() {
                free[network.corner(p, k) as usize] &= is_in(p);
                if seams[c] == Seam::None {
                    network.curves[c].corners.iter().for_each(|&at| free[at as usize] = false);
                }
            }
        }
        let mut leaves = vec![true; network.corners.len()];
        for p in all.clone().filter(|&p| held[p]) {
            (0..4).for_each(|k| leaves[network.corner(p, k) as usize] = false);
        }
        let mut count = 0u32;
        let mut next = |n: usize| {
            count += n as u32;
            count - n as u32
        };
        let corners: Vec<u32> = free.iter().map(|&free| if free { next(1) } else { NONE }).collect();
        let mut curves: Vec<Vec<u32>> = vec![Vec::new(); network.curves.len()];
        let mut of = vec![Vec::new(); surfaces.len()];
        for p in all.filter(|&p| is_in(p)) {
            let (rows, cols) = (surfaces[p].rows, surfaces[p].cols);
            let mut own = vec![NONE; rows * cols];
            for (k, side) in network.patches[p].sides.iter().enumerate() {
                let (c, n) = (side.curve as usize, side_len(rows, cols, k));
                own[node(rows, cols, k, 0, 0)] = corners[network.corner(p, k) as usize];
                if moves[c] {
                    if curves[c].is_empty() {
                        let [start, end] = network.curves[c].corners.map(|at| leaves[at as usize]);
                        let moves = |i: usize| (i > 1 || start) && (i + 2 < n || end);
                        curves[c] = (0..n - 1).map(|i| if i > 0 && moves(i) { next(1) } else { NONE }).collect();
                    }
                    for i in 1..n - 1 {
                        let at = if side.reversed { n - 1 - i } else { i };
                        own[node(rows, cols, k, i, 0)] = curves[c][at];
                    }
                }
            }
            for j in 1..rows - 1 {
                let first = next(cols - 2);
                (1..cols - 1).for_each(|i| own[j * cols + i] = first + i as u32 - 1);
            }
            of[p] = own;
        }
        Shared { count: count as usize, of }
    }

    /// Parts of the network that can be solved by themselves: for each patch the least one of its part.
    /// * `pairs` - patches that hang together by weighed seams
    pub fn parts(&self, pairs: impl Iterator<Item = [usize; 2]>) -> Vec<usize> {
        let mut sets = Sets::new(self.of.len());
        pairs.filter(|pair| pair.iter().all(|&p| self.has(p))).for_each(|[p, q]| {
            sets.join(p as u32, q as u32);
        });
        let mut owners = vec![NONE; self.count];
        for (p, own) in self.of.iter().enumerate() {
            for &k in own.iter().filter(|&&k| k != NONE) {
                match &mut owners[k as usize] {
                    owner if *owner == NONE => *owner = p as u32,
                    owner => {
                        sets.join(*owner, p as u32);
                    }
                }
            }
        }
        (0..self.of.len() as u32).map(|p| sets.root(p) as usize).collect()
    }

    /// True if something of a patch is unknown.
    pub fn has(&self, patch: usize) -> bool {
        !self.of[patch].is_empty()
    }

    /// The number of a control point, if it moves.
    pub fn get(&self, patch: usize, control: usize) -> Option<usize> {
        self.of[patch].get(control).filter(|&&k| k != NONE).map(|&k| k as usize)
    }
}

/// A sum of control points that is to vanish.
pub(super) struct Row {
    /// Patch, control point and coefficient.
    pub places: Places,
    /// The same by unknowns.
    pub terms: Vec<(usize, f64)>,
    /// What its square costs, for weighed seams.
    pub weight: f64,
}

impl Row {
    /// A condition: with coefficients whose squares add up to 1.
    fn condition(shared: &Shared, mut places: Places) -> Row {
        let size = places.iter().map(|p| p.2 * p.2).sum::<f64>().sqrt();
        places.iter_mut().for_each(|p| p.2 /= size);
        Row::new(shared, places, 1.0)
    }

    fn new(shared: &Shared, places: Places, weight: f64) -> Row {
        let mut terms: Vec<(usize, f64)> =
            places.iter().filter_map(|&(p, c, x)| Some((shared.get(p, c)?, x))).collect();
        terms.sort_unstable_by_key(|t| t.0);
        terms.dedup_by(|b, a| {
            let same = a.0 == b.0;
            a.1 += if same { b.1 } else { 0.0 };
            same
        });
        Row { places, terms, weight }
    }

    /// The sum, as the surfaces stand.
    pub fn value(&self, surfaces: &[Surface]) -> DVec3 {
        self.places.iter().map(|&(p, c, x)| surfaces[p].control[c] * x).sum()
    }
}

/// Patch, control point and coefficient of `a_0 F^0_u + a_1 F^1_u + b G'` at `t`.
fn equation(sides: &[Side; 2], knots: &[f64], t: f64, (a, b): ([f64; 2], f64)) -> Places {
    let (first, [value, slope, _]) = basis_at(knots, t);
    let mut places = Vec::with_capacity(12);
    for i in 0..4 {
        let mut on = b * slope[i];
        for (side, a) in sides.iter().zip(a) {
            let step = a * side.across * value[i];
            places.push((side.patch, side.node(first + i, 1), step));
            on -= step;
        }
        places.push((sides[0].patch, sides[0].node(first + i, 0), on));
    }
    places
}

fn sides_of(network: &Network, surfaces: &[Surface], uses: &[(u32, u8)]) -> ([Side; 2], Vec<f64>, Vec<f64>) {
    let knots = knots_along(network, surfaces, uses[0]);
    let places = span_samples(&knots.breaks(), SPAN_PLACES);
    ([0, 1].map(|k| Side::of(network, surfaces, uses[k])), knots.list().to_vec(), places)
}

/// The equations of an exact seam.
pub(super) fn conditions(
    network: &Network,
    surfaces: &[Surface],
    uses: &[(u32, u8)],
    gluing: &Gluing,
    shared: &Shared,
) -> Vec<Row> {
    let (sides, knots, places) = sides_of(network, surfaces, uses);
    let one = |&t: &f64| Row::condition(shared, equation(&sides, &knots, t, gluing.at(t)));
    places.iter().map(one).collect()
}

/// The equations of a weighed seam, with `a` and `b` at each place as the surfaces stand: what is left is the angle, radians.
/// * `cost` - of a radian all along it
pub(super) fn wishes(
    network: &Network,
    surfaces: &[Surface],
    uses: &[(u32, u8)],
    cost: f64,
    shared: &Shared,
) -> Vec<Row> {
    let (sides, knots, places) = sides_of(network, surfaces, uses);
    let one = |&t: &f64| {
        let both = sides.each_ref().map(|side| {
            let (u, v) = place(side.side, side.reversed, t);
            let jet = surfaces[side.patch].jet(u, v);
            let (along, inward) = match side.side {
                0 => (jet.u, jet.v),
                1 => (jet.v, -jet.u),
                2 => (-jet.u, -jet.v),
                _ => (-jet.v, jet.u),
            };
            (if side.reversed { -along } else { along }, inward)
        });
        let along = both[0].0;
        let away = both.map(|(_, f)| f - along * (along.dot(f) / along.length_squared()));
        let reach = away.map(DVec3::length);
        let is_flat = (0..2).any(|k| reach[k].is_nan() || reach[k] <= FLAT * both[k].1.length());
        // Where one side turns back on the other there is nothing to keep.
        if is_flat || away[0].dot(away[1]) >= 0.0 {
            return None;
        }
        let a = [reach[1], reach[0]].map(|r| 2.0 * r / (reach[0] + reach[1]));
        let b = -(both[0].1 * a[0] + both[1].1 * a[1]).dot(along) / along.length_squared();
        let mut row = equation(&sides, &knots, t, (a, b));
        row.iter_mut().for_each(|p| p.2 /= a[0] * reach[0]);
        Some(Row::new(shared, row, cost / places.len() as f64))
    };
    places.iter().filter_map(one).collect()
}
