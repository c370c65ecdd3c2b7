//! Whole vectors that turn the isolines of a map least: cells become oblong rather than sheared.
//!
//! With few squares a cone, every corner is moved by a good part of a square. What that costs depends on where it goes: along
//! isolines it makes cells longer or shorter, across them it shears them, and sheared cells have flat and pointed corners. The
//! energy of a map with Jacobians `J`, relative to squares of the size asked for, is
//! ```text
//! E = sum over triangles of  area ( arg² u + arg² v + STRETCH (stretch² u + stretch² v) ),   stretch g = (|g| - 1/|g|) / 2
//! ```
//! with `u` and `v` the gradients of both coordinates, as complex numbers along the axes that they should lie on. Areas and sizes are
//! those of the surface: a seamless map squeezes limbs, which would get too few squares by their size in the map.
//!
//! It is lowered by walks, as in [`super::walks`]. A step of a walk changes one triangle, so its cost is known, and a walk that
//! lowers the energy is a cycle of negative cost in the graph of all steps, which is found as Bellman 1958, *On a Routing
//! Problem*, finds shortest ways. Where a cycle goes through a triangle more than once, its steps change the costs of each other:
//! its cost is then measured, and if it is no gain its steps cost more until another walk changes something.

use super::walks::{State, Whole, unit};
use crate::mesh::{NONE, next, previous};
use crate::observe::{Cancelled, Observer};
use glam::{DMat2, DVec2, I64Vec2};

/// Weight of stretching beside turning: a square twice as long as asked for costs as much as isolines turned by 19 degrees. Chosen:
/// .1 to .4 were tried on six to ten measured meshes; with less, strips of cells find no room; with more, cells are sheared.
const STRETCH: f64 = 0.2;

/// Where the map squeezes or stretches the surface by more than this, squares are not asked to make up for all of it. Chosen.
const MOST_GROWTH: f64 = 5.0;

/// Walks in succession that lower the energy by their steps but not when measured, until none is sought any more. Chosen.
const MAX_FAILURES: usize = 100;

/// What counts as a gain, against an energy of 1 of the whole map.
const GAIN: f64 = 1e-9;

/// Rounds over all steps in search of a cycle, one for each of its steps at most. Chosen.
const MAX_ROUNDS: usize = 400;

/// The energy of triangles.
pub(super) struct Form {
    /// For each triangle what makes its Jacobian of its first two edges.
    inverse: Vec<DMat2>,
    /// Part of the area of the surface.
    share: Vec<f64>,
    /// Of a square.
    price: f64,
}

impl Form {
    /// * `parts` - of each face of the input of the area of the surface and of the map
    /// * `scale` - of the squares asked for, against the map in the mean
    /// * `price` - energy of each square besides, for more or fewer of them
    pub fn new(whole: &Whole, parts: &[DVec2], scale: f64, price: f64) -> Form {
        let edges = |t: usize| DMat2::from_cols(whole.flat.edge[3 * t], whole.flat.edge[3 * t + 1]);
        let total: f64 = (0..whole.flat.len()).map(|t| edges(t).determinant()).sum();
        // How much longer the surface is there than in the map; where no mark lies as in the mean.
        let growth = |t: usize| {
            let sum: DVec2 = whole.flat.marks[t].iter().map(|mark| parts[mark.face as usize]).sum();
            if sum.y > 0.0 { (sum.x / sum.y).sqrt().clamp(1.0 / MOST_GROWTH, MOST_GROWTH) } else { 1.0 }
        };
        Form {
            inverse: (0..whole.flat.len()).map(|t| (edges(t) * scale * growth(t)).inverse()).collect(),
            share: (0..whole.flat.len()).map(|t| edges(t).determinant() / total * growth(t).powi(2)).collect(),
            price,
        }
    }

    /// Energy of a triangle with these first two edges; infinite if it is not upright.
    fn of(&self, t: usize, first: I64Vec2, second: I64Vec2) -> f64 {
        if first.perp_dot(second) <= 0 {
            return f64::INFINITY;
        }
        let jacobian = DMat2::from_cols(first.as_dvec2(), second.as_dvec2()) * self.inverse[t];
        let rows = jacobian.transpose();
        let squares = first.perp_dot(second) as f64 / 2.0;
        self.share[t] * (cost(rows.x_axis) + cost(-rows.y_axis.perp())) + self.price * squares
    }

    fn at(&self, whole: &Whole, t: usize) -> f64 {
        self.of(t, whole.q[3 * t], whole.q[3 * t + 1])
    }

    /// Energy of some triangles.
    pub fn sum(&self, whole: &Whole, triangles: impl IntoIterator<Item = usize>) -> f64 {
        triangles.into_iter().map(|t| self.at(whole, t)).sum()
    }
}

/// Cost of a gradient that should be a unit along the first axis.
fn cost(gradient: DVec2) -> f64 {
    let length = gradient.length();
    let stretch = (length - 1.0 / length) / 2.0;
    gradient.to_angle().powi(2) + STRETCH * stretch * stretch
}

/// A step through a triangle: what a change that arrived costs when it is undone on the half-edge `exit`.
#[derive(Clone, Copy)]
struct Step {
    cost: f64,
    exit: u32,
    /// The state beyond.
    to: State,
}

/// Steps of a cycle, each as the state where it begins and which of the two steps from there.
type Cycle = Vec<(State, usize)>;

/// The graph of all steps.
struct Steps {
    /// The two steps from each state; one that may not be taken costs infinity.
    of: Vec<[Step; 2]>,
    /// The one node for all that lies beyond the rim.
    rim: State,
    /// The states that are reached from there.
    entries: Vec<State>,
}

impl Steps {
    fn new(whole: &Whole, form: &Form) -> Steps {
        let rim = 4 * whole.q.len() as u32;
        let enters = |&s: &State| whole.flat.opposite[s as usize / 4] == NONE && whole.is_free(s / 4, s % 4);
        let none = Step { cost: f64::INFINITY, exit: NONE, to: rim };
        let mut steps = Steps { of: vec![[none; 2]; rim as usize], rim, entries: (0..rim).filter(enters).collect() };
        (0..whole.flat.len()).for_each(|t| steps.renew(whole, form, t));
        steps
    }

    /// Takes the costs of the steps through a triangle as it is now.
    fn renew(&mut self, whole: &Whole, form: &Form, t: usize) {
        let now = form.at(whole, t);
        for state in 12 * t as u32..12 * (t as u32 + 1) {
            let (came, direction) = (state / 4, state % 4);
            self.of[state as usize] = [next(came), previous(came)].map(|exit| {
                let mut q: [I64Vec2; 3] = std::array::from_fn(|k| whole.q[3 * t + k]);
                q[came as usize % 3] += unit(direction);
                q[exit as usize % 3] -= unit(direction);
                let cost = if whole.is_free(exit, direction) { form.of(t, q[0], q[1]) - now } else { f64::INFINITY };
                let to = match whole.flat.opposite[exit as usize] {
                    NONE => self.rim,
                    o => 4 * o + (direction + u32::from(whole.flat.jump[exit as usize])) % 4,
                };
                Step { cost, exit, to }
            });
        }
    }

    /// Some cycles of negative cost; none if there are none.
    fn cycles(&self) -> Vec<Cycle> {
        let mut distance = vec![0.0; self.of.len() + 1];
        let mut before: Vec<Option<(State, usize)>> = vec![None; distance.len()];
        for _ in 0..MAX_ROUNDS {
            let mut is_done = true;
            let mut reach = |from: State, k: usize, to: State, cost: f64| {
                let through = distance[from as usize] + cost;
                if through < distance[to as usize] - f64::EPSILON {
                    distance[to as usize] = through;
                    before[to as usize] = Some((from, k));
                    is_done = false;
                }
            };
            self.entries.iter().for_each(|&entry| reach(self.rim, 0, entry, 0.0));
            for (state, steps) in self.of.iter().enumerate() {
                steps.iter().enumerate().for_each(|(k, step)| reach(state as u32, k, step.to, step.cost));
            }
            let found = if is_done { Vec::new() } else { cycles(&before) };
            if is_done || !found.is_empty() {
                return found;
            }
        }
        Vec::new()
    }

    /// What a cycle changes: half-edges, and by what.
    fn changes(&self, cycle: &Cycle) -> Vec<(u32, I64Vec2)> {
        let mut changes = Vec::with_capacity(cycle.len());
        for (n, &(state, k)) in cycle.iter().enumerate() {
            if state != self.rim {
                changes.push((self.of[state as usize][k].exit, -unit(state % 4)));
            } else {
                // The cycle is listed from its end: the state that comes after the rim stands before it.
                let entry = cycle[(n + cycle.len() - 1) % cycle.len()].0;
                changes.push((entry / 4, unit(entry % 4)));
            }
        }
        changes
    }

    fn cost(&self, cycle: &Cycle) -> f64 {
        let inside = cycle.iter().filter(|s| s.0 != self.rim);
        inside.map(|&(state, k)| self.of[state as usize][k].cost).sum()
    }
}

/// The cycles of a graph in which one node at most comes before each, from their ends.
fn cycles(before: &[Option<(State, usize)>]) -> Vec<Cycle> {
    let mut seen = vec![NONE; before.len()];
    let mut found = Vec::new();
    for root in 0..before.len() as u32 {
        let mut at = root;
        while let (NONE, Some((from, _))) = (seen[at as usize], before[at as usize]) {
            seen[at as usize] = root;
            at = from;
        }
        // The way back from the root runs into itself, and not into that from another or to an end.
        if seen[at as usize] == root {
            let mut cycle = Vec::new();
            let mut back = at;
            while let Some((from, k)) = before[back as usize] {
                cycle.push((from, k));
                back = from;
                if back == at {
                    break;
                }
            }
            found.push(cycle);
        }
    }
    found
}

/// Lowers the energy until no walk of unit changes does.
/// * `parts`, `scale`, `price` - as in [`Form::new`]
/// # Errors
/// [`Cancelled`] by the observer.
pub(super) fn descend(
    whole: &mut Whole,
    parts: &[DVec2],
    scale: f64,
    price: f64,
    observer: &dyn Observer,
) -> Result<(), Cancelled> {
    let form = Form::new(whole, parts, scale, price);
    let mut steps = Steps::new(whole, &form);
    // Triangles whose steps are out of date, or cost more than they do.
    let mut stale: Vec<usize> = Vec::new();
    let mut failures = 0;
    while failures < MAX_FAILURES {
        observer.check()?;
        let cycles = steps.cycles();
        if cycles.is_empty() {
            break;
        }
        for cycle in cycles {
            let changes = steps.changes(&cycle);
            let beyond = |h: u32| Some(whole.flat.opposite[h as usize]).filter(|&o| o != NONE);
            let mut touched: Vec<usize> =
                changes.iter().flat_map(|&(h, _)| [Some(h), beyond(h)]).flatten().map(|h| h as usize / 3).collect();
            touched.sort_unstable();
            touched.dedup();
            let now = form.sum(whole, touched.iter().copied());
            changes.iter().for_each(|&(h, by)| whole.change(h, by));
            let rise = form.sum(whole, touched.iter().copied()) - now;
            if rise < -GAIN {
                failures = 0;
                stale.append(&mut touched);
                stale.drain(..).for_each(|t| steps.renew(whole, &form, t));
                continue;
            }
            changes.iter().for_each(|&(h, by)| whole.change(h, -by));
            failures += 1;
            stale.append(&mut touched);
            let more = (rise.clamp(0.0, 1.0) + 2.0 * GAIN - steps.cost(&cycle)) / changes.len() as f64;
            for (state, k) in cycle.into_iter().filter(|s| s.0 != steps.rim) {
                steps.of[state as usize][k].cost += more;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gradient_costs_nothing_as_it_should_be_and_as_much_turned_by_19_degrees_as_half_or_twice_as_long() {
        assert_eq!(cost(DVec2::X), 0.0);
        let turned = cost(DVec2::from_angle(19.2f64.to_radians()));
        for length in [0.5, 2.0] {
            assert!((cost(DVec2::new(length, 0.0)) - turned).abs() < 1e-3);
        }
        assert!((cost(DVec2::new(0.0, 1.0)) - std::f64::consts::FRAC_PI_2.powi(2)).abs() < 1e-12);
    }

    #[test]
    fn of_two_cycles_and_a_way_that_leads_into_one_both_cycles_are_found_once() {
        // 0 -> 1 -> 2 -> 0, 3 -> 4 -> 3, 2 -> 5, and 6 alone.
        let before = [2, 0, 1, 4, 3, 2, NONE].map(|n| (n != NONE).then_some((n, 0)));
        let mut found: Vec<Vec<State>> =
            cycles(&before).into_iter().map(|c| c.into_iter().map(|s| s.0).collect()).collect();
        found.iter_mut().for_each(|cycle| cycle.sort_unstable());
        assert_eq!(found, [vec![0, 1, 2], vec![3, 4]]);
    }
}
