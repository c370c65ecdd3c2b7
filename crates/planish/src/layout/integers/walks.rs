//! Whole edge vectors on a flat surface, changed by walks from triangle to triangle.
//!
//! Coudert-Osmont, Desobry, Heistermann, Bommes, Ray, Sokolov 2024, *Quad Mesh Quantization Without a T-Mesh*, §5. A change
//! `c` of one edge of a triangle is undone by `-c` on another, which changes the triangle beyond by `c` turned as the
//! charts are; a walk that comes back to where it began, or runs from rim to rim, keeps all triangles closed.
//!
//! Departs from the paper in where vectors come from: they are rounded, and what that leaves open in the triangles is
//! carried along walks to where it cancels, instead of an elimination over the integers. It always does: the sum of all
//! that is open is even, or zero where no cone turns it.

use super::flat::{FLIPPED, Flat, quality};
use crate::geom::graph::{Dense, Reached, Search};
use crate::geom::is_positive;
use crate::geom::random;
use crate::layout::map::quarter_turn;
use crate::mesh::{NONE, next, previous};
use crate::observe::{Cancelled, Observer};
use glam::{DVec2, I64Vec2};
use std::collections::BTreeMap;

/// Edges shorter than this part of the mean, squared, weigh as if they were as long.
const SHORT: f64 = 1e-4;
/// Cost of a step beside what it worsens: of two walks that worsen alike the shorter is taken.
const STEP: f64 = 0.4;
/// Cost of a step that turns a triangle over; the walk may pass there again and turn it back.
const OVERTURNED: f64 = 1e4;
/// Steps of scale until all triangles are upright, and their factor.
const SCALES: usize = 40;
const SCALE_STEP: f64 = std::f64::consts::SQRT_2;
/// Passes over all edges with one length of change.
const SWEEPS: u64 = 12;
/// How far walks are looked for.
#[derive(Clone, Copy)]
struct Reach {
    /// Limit of the cost of a walk: so many times what its first change gains, and `on_top`.
    gains: f64,
    on_top: f64,
    /// States that all searches together may settle.
    states: usize,
}

/// While walks are plenty: longer ones come last, they are few.
const NEAR: Reach = Reach { gains: 3.0, on_top: 20.0 * STEP, states: usize::MAX };
/// Walks of any length that turn nothing over. A search may settle all states, so their work grows with the square of the
/// triangles; it is bounded to some seconds, sixteen times what 200 triangles need.
const FAR: Reach = Reach { gains: 0.0, on_top: OVERTURNED, states: 1 << 24 };
/// What counts as an improvement, against the sum of all.
const GAIN: f64 = 1e-9;
/// Seed of the order in which edges are tried.
const SEED: u64 = 26;

/// The unit vector of a direction, 0 to 3 counter-clockwise from x.
pub(super) fn unit(direction: u32) -> I64Vec2 {
    [I64Vec2::X, I64Vec2::Y, I64Vec2::NEG_X, I64Vec2::NEG_Y][direction as usize % 4]
}

/// `v` turned counter-clockwise by quarters.
fn turned(v: I64Vec2, turns: u8) -> I64Vec2 {
    match turns % 4 {
        0 => v,
        1 => I64Vec2::new(-v.y, v.x),
        2 => -v,
        _ => I64Vec2::new(v.y, -v.x),
    }
}

/// Least quality of a flipped triangle in the map.
const UPRIGHT: f64 = 1e-4;

/// A change that arrived: half-edge and direction as `4 h + direction`.
pub(super) type State = u32;

/// Whole edge vectors of a flat surface.
#[derive(Clone)]
pub(super) struct Whole {
    /// The surface. Its edges may be flipped.
    pub flat: Flat,
    /// Vector of each half-edge, in its chart.
    pub q: Vec<I64Vec2>,
    /// For each half-edge what its deviation weighs.
    weight: Vec<f64>,
    /// Wished vector of each half-edge.
    wish: Vec<DVec2>,
    /// Mean square length of the edges of the map.
    mean: f64,
    /// States that searches have settled.
    settled: usize,
}

/// Where a search began and what ends it.
enum Goal<'a> {
    /// The state it began with: the walk closes.
    Start,
    /// The rim.
    Rim,
    /// A triangle in which something is open that the arriving change closes, or the rim.
    Open(&'a [I64Vec2]),
}

impl Whole {
    /// The vectors rounded at the least scale at which all triangles of a piece can be upright.
    /// * `scale` - of the map, to begin with
    /// # Errors
    /// `Ok(None)` if no scale is large enough.
    pub fn start(flat: Flat, scale: f64, observer: &dyn Observer) -> Result<Option<Whole>, Cancelled> {
        let pieces = pieces(&flat);
        let mut scales = vec![scale; pieces.iter().max().map_or(0, |&p| p as usize + 1)];
        let mean = flat.edge.iter().map(|e| e.length_squared()).sum::<f64>() / flat.edge.len().max(1) as f64;
        let weight = flat.edge.iter().map(|&e| weight(e, mean)).collect();
        let mut whole = Whole { flat, q: Vec::new(), weight, wish: Vec::new(), mean, settled: 0 };
        for _ in 0..SCALES {
            observer.check()?;
            let at = |h: usize| whole.flat.edge[h] * scales[pieces[h / 3] as usize];
            whole.wish = (0..whole.flat.edge.len()).map(at).collect();
            whole.round();
            if !whole.close() {
                return Ok(None);
            }
            let mut upright = true;
            let before = scales.clone();
            for (t, &piece) in pieces.iter().enumerate() {
                if whole.twice_area(t) <= 0 {
                    let piece = piece as usize;
                    (scales[piece], upright) = (before[piece] * SCALE_STEP, false);
                }
            }
            if upright {
                return Ok(Some(whole));
            }
        }
        Ok(None)
    }

    /// Number of unit squares.
    pub fn squares(&self) -> i64 {
        (0..self.flat.len()).map(|t| self.twice_area(t)).sum::<i64>() / 2
    }

    /// Wishes for edges as short as can be.
    pub fn wish_least(&mut self) {
        self.wish.fill(DVec2::ZERO);
    }

    /// Flips edges that are not Delaunay in the stretched surface, where the triangles stay upright in the map as well: what
    /// keeps triangles upright then hinders walks less. True if any was.
    pub fn flip_edges(&mut self) -> bool {
        let mut flipped = false;
        for h in 0..self.q.len() as u32 {
            let o = self.flat.opposite[h as usize];
            if o == NONE || o / 3 == h / 3 || self.flat.line[h as usize] {
                continue;
            }
            let turns = (4 - self.flat.jump[h as usize]) % 4;
            let across = |h: u32| [turned(self.q[h as usize], turns), turned(self.q[next(h) as usize], turns)];
            let (b, [_, d]) = (self.q[h as usize], across(o));
            let places = [b, b + self.q[next(h) as usize], I64Vec2::ZERO, d];
            let det = |[i, j, k]: [usize; 3]| (places[j] - places[i]).perp_dot(places[k] - places[i]);
            // Cotangents against the edge, by twice the areas.
            let cotangent = |i: usize| (places[0] - places[i]).dot(places[2] - places[i]) as f64;
            let sum = cotangent(1) / det([0, 1, 2]) as f64 + cotangent(3) / det([0, 2, 3]) as f64;
            let is_gain = sum < -GAIN;
            if !is_gain || FLIPPED.iter().any(|&t| det(t) <= 0) {
                continue;
            }
            let Some(patch) = self.flat.pair(h) else { continue };
            if FLIPPED.iter().any(|t| quality(t.map(|i| patch.places[i])) < UPRIGHT) {
                // The chart beyond has been turned all the same.
                for g in 3 * (o / 3)..3 * (o / 3) + 3 {
                    self.q[g as usize] = turned(self.q[g as usize], turns);
                    self.wish[g as usize] = quarter_turn(self.wish[g as usize], turns);
                }
                continue;
            }
            self.flat.replace(&patch, &FLIPPED, None);
            for (t, corners) in patch.triangles.iter().zip(FLIPPED) {
                for k in 0..3 {
                    let g = 3 * *t as usize + k;
                    self.q[g] = places[corners[(k + 1) % 3]] - places[corners[k]];
                    self.wish[g] = DVec2::ZERO;
                    self.weight[g] = weight(self.flat.edge[g], self.mean);
                }
            }
            flipped = true;
        }
        flipped
    }

    /// Weighted square deviation from what is wished.
    pub fn energy(&self) -> f64 {
        (0..self.q.len()).map(|h| self.cost(h as u32, self.q[h])).sum()
    }

    fn twice_area(&self, t: usize) -> i64 {
        self.q[3 * t].perp_dot(self.q[3 * t + 1])
    }

    fn cost(&self, h: u32, q: I64Vec2) -> f64 {
        self.weight[h as usize] * (q.as_dvec2() - self.wish[h as usize]).length_squared()
    }

    /// Whether a half-edge may change in a direction: on lines along them only.
    pub fn is_free(&self, h: u32, direction: u32) -> bool {
        let along_x = self.flat.edge[h as usize].x.abs() > self.flat.edge[h as usize].y.abs();
        !self.flat.line[h as usize] || along_x == direction.is_multiple_of(2)
    }

    /// Changes a half-edge, and the other half of its edge.
    pub fn change(&mut self, h: u32, by: I64Vec2) {
        self.q[h as usize] += by;
        let o = self.flat.opposite[h as usize];
        if o != NONE {
            self.q[o as usize] -= turned(by, self.flat.jump[h as usize]);
        }
    }

    /// The nearest whole vectors; triangles stay open.
    fn round(&mut self) {
        let near = |h: u32| {
            let wish = self.wish[h as usize].round();
            let part = |direction: u32, x: f64| if self.is_free(h, direction) { x as i64 } else { 0 };
            I64Vec2::new(part(0, wish.x), part(1, wish.y))
        };
        let mut rounded: Vec<I64Vec2> = (0..self.wish.len() as u32).map(near).collect();
        for h in 0..rounded.len() {
            let o = self.flat.opposite[h];
            if o != NONE && o as usize > h {
                rounded[o as usize] = -turned(rounded[h], self.flat.jump[h]);
            }
        }
        self.q = rounded;
    }

    /// Carries what is open in triangles to where it cancels.
    fn close(&mut self) -> bool {
        let gap = |q: &[I64Vec2], t: usize| q[3 * t] + q[3 * t + 1] + q[3 * t + 2];
        let mut open: Vec<I64Vec2> = (0..self.flat.len()).map(|t| gap(&self.q, t)).collect();
        for t in 0..open.len() {
            while open[t] != I64Vec2::ZERO {
                let direction = (0..4).find(|&d| open[t].dot(unit(d)) > 0).unwrap_or(0);
                open[t] -= unit(direction);
                // As if the excess had come in by each of the three sides.
                let sources: Vec<State> = (0..3).map(|k| 4 * (3 * t as u32 + k) + direction).collect();
                let Some(walk) = self.search(&sources, 1, Goal::Open(&open), f64::INFINITY) else { return false };
                let mut touched: Vec<usize> = walk.iter().map(|w| w.0 as usize / 3).collect();
                for &(h, by) in &walk {
                    self.change(h, by);
                    touched.extend(self.flat.opposite.get(h as usize).filter(|&&o| o != NONE).map(|&o| o as usize / 3));
                }
                touched.iter().for_each(|&t| open[t] = gap(&self.q, t));
            }
        }
        true
    }

    /// The cheapest walk from one of some states to the goal, as changes of half-edges.
    /// * `size` - length of the change
    fn search(&mut self, sources: &[State], size: i64, goal: Goal, limit: f64) -> Option<Vec<(u32, I64Vec2)>> {
        let mut search = Search::over(Dense::new(4 * self.q.len()));
        for &state in sources {
            search.reach(state, 0.0, NONE);
        }
        // Cost of the best end so far, the state before it and the half-edge changed last.
        let mut best = (limit, NONE, NONE);
        while let Some((state, distance)) = search.settle() {
            self.settled += 1;
            if distance >= best.0 {
                break;
            }
            let (came, direction) = (state / 4, state % 4);
            if let Goal::Open(open) = goal
                && distance > 0.0
                && open[came as usize / 3].dot(unit(direction)) < 0
            {
                best = (distance, state, NONE);
                break;
            }
            for h in [next(came), previous(came)] {
                let Some(cost) = self.step_cost(came, direction, h, size) else { continue };
                let o = self.flat.opposite[h as usize];
                let total = distance + cost;
                let reached =
                    if o == NONE { NONE } else { 4 * o + (direction + u32::from(self.flat.jump[h as usize])) % 4 };
                let ends = match goal {
                    Goal::Start => reached == sources[0],
                    Goal::Rim | Goal::Open(_) => reached == NONE,
                };
                if ends && total < best.0 {
                    best = (total, state, h);
                } else if !ends && reached != NONE && total < best.0 {
                    search.reach(reached, total, state);
                }
            }
        }
        let (_, state, last) = best;
        if state == NONE {
            return None;
        }
        let mut walk = Vec::new();
        if last != NONE {
            walk.push((last, -unit(state % 4) * size));
        }
        for pair in search.reached.chain(state).windows(2) {
            // From the second to the first, over the edge of the first.
            walk.push((self.flat.opposite[pair[0] as usize / 4], -unit(pair[1] % 4) * size));
        }
        Some(walk)
    }

    /// Cost of undoing, on half-edge `h`, a change that half-edge `came` of the same triangle has had; `None` where a
    /// line forbids it.
    fn step_cost(&self, came: u32, direction: u32, h: u32, size: i64) -> Option<f64> {
        if !self.is_free(h, direction) {
            return None;
        }
        let change = unit(direction) * size;
        let (arrived, left) = (self.q[came as usize] + change, self.q[h as usize] - change);
        let twice_area = if h == next(came) { arrived.perp_dot(left) } else { left.perp_dot(arrived) };
        let rise = self.cost(h, left) - self.cost(h, self.q[h as usize]);
        let overturned = if twice_area <= 0 { OVERTURNED } else { 0.0 };
        Some(STEP + rise.max(0.0) + overturned)
    }

    /// Lowers the energy by short walks, from long changes to unit ones, until none is found.
    /// # Errors
    /// [`Cancelled`] by the observer.
    pub fn descend(&mut self, observer: &dyn Observer) -> Result<(), Cancelled> {
        let longest = self.q.iter().zip(&self.wish).map(|(q, w)| (q.as_dvec2() - *w).abs().max_element());
        let longest = longest.fold(0.0, f64::max);
        let mut size = 1;
        while (2 * size) as f64 <= longest {
            size *= 2;
        }
        while size > 0 {
            self.sweeps(size, NEAR, observer)?;
            size /= 2;
        }
        Ok(())
    }

    /// Lowers the energy by walks of any length, each a search of the whole surface.
    /// # Errors
    /// [`Cancelled`] by the observer.
    pub fn descend_far(&mut self, observer: &dyn Observer) -> Result<(), Cancelled> {
        self.sweeps(1, FAR, observer)
    }

    /// Tries all edges with one length of change until nothing is gained.
    fn sweeps(&mut self, size: i64, reach: Reach, observer: &dyn Observer) -> Result<(), Cancelled> {
        let most = self.settled.saturating_add(reach.states);
        for number in 0..SWEEPS {
            if !self.sweep(size, reach, (number, most), observer)? {
                break;
            }
        }
        Ok(())
    }

    /// Tries each edge once; true if something was gained and there is more to try.
    /// * `number` - of the sweep
    /// * `most` - where the count of settled states ends it
    fn sweep(
        &mut self,
        size: i64,
        reach: Reach,
        (number, most): (u64, usize),
        observer: &dyn Observer,
    ) -> Result<bool, Cancelled> {
        let opposite = &self.flat.opposite;
        let mut order: Vec<u32> = (0..opposite.len() as u32).filter(|&h| opposite[h as usize] > h).collect();
        order.sort_by_key(|&h| random::bits(SEED + number, u64::from(h)));
        let least = GAIN * self.energy();
        let mut gained = false;
        for h in order {
            observer.check()?;
            if self.settled > most {
                return Ok(false);
            }
            for direction in 0..4 {
                while self.improve(h, direction, size, reach, least) {
                    gained = true;
                }
            }
        }
        Ok(gained)
    }

    /// Applies the cheapest walk that begins with a change of a half-edge, if that is a gain.
    fn improve(&mut self, h: u32, direction: u32, size: i64, reach: Reach, least: f64) -> bool {
        let change = unit(direction) * size;
        let now = self.q[h as usize];
        let gain = self.cost(h, now) - self.cost(h, now + change);
        if !self.is_free(h, direction) || !is_positive(gain) {
            return false;
        }
        let limit = reach.gains * gain + reach.on_top;
        let o = self.flat.opposite[h as usize];
        let walk = if o == NONE {
            let walk = self.search(&[4 * h + direction], size, Goal::Rim, limit);
            walk.map(|mut walk| {
                walk.push((h, change));
                walk
            })
        } else {
            let turned = (direction + 2 + u32::from(self.flat.jump[h as usize])) % 4;
            self.search(&[4 * o + turned], size, Goal::Start, limit)
        };
        walk.is_some_and(|walk| self.apply(&walk, least))
    }

    /// Applies a walk if it lowers the energy and leaves all triangles upright.
    fn apply(&mut self, walk: &[(u32, I64Vec2)], least: f64) -> bool {
        // Each edge once, whichever half the walk names.
        let mut sums: BTreeMap<u32, I64Vec2> = BTreeMap::new();
        for &(h, by) in walk {
            let o = self.flat.opposite[h as usize];
            let (h, by) = if o < h { (o, -turned(by, self.flat.jump[h as usize])) } else { (h, by) };
            *sums.entry(h).or_default() += by;
        }
        let rise = |(&h, &by): (&u32, &I64Vec2)| {
            let q = self.q[h as usize];
            self.cost(h, q + by) - self.cost(h, q)
        };
        if sums.iter().map(rise).sum::<f64>() >= -least {
            return false;
        }
        sums.iter().for_each(|(&h, &by)| self.change(h, by));
        let upright = |h: u32| h == NONE || self.twice_area(h as usize / 3) > 0;
        if sums.keys().all(|&h| upright(h) && upright(self.flat.opposite[h as usize])) {
            return true;
        }
        sums.iter().for_each(|(&h, &by)| self.change(h, -by));
        false
    }
}

/// What the deviation of an edge weighs.
fn weight(edge: DVec2, mean: f64) -> f64 {
    mean / edge.length_squared().max(SHORT * mean)
}

/// For each triangle the number of its connected piece.
fn pieces(flat: &Flat) -> Vec<u32> {
    let mut label = vec![NONE; flat.len()];
    let mut count = 0;
    for seed in 0..flat.len() {
        if label[seed] != NONE {
            continue;
        }
        let mut stack = vec![seed];
        label[seed] = count;
        while let Some(t) = stack.pop() {
            for o in &flat.opposite[3 * t..3 * t + 3] {
                if *o != NONE && label[*o as usize / 3] == NONE {
                    label[*o as usize / 3] = count;
                    stack.push(*o as usize / 3);
                }
            }
        }
        count += 1;
    }
    label
}
