//! Milling: a stock box without the volumes that a tool sweeps.
//!
//! [K01] §5.1, milling: a tool is a convex body of revolution, so its sweep along a straight move is
//! convex, and the distance from it is the least over the move of the distance from the tool. That is a convex function
//! of the place on the move: closed forms where the move is level or upright or the tool is ball-ended, a search
//! otherwise. Moves sit in a tree of boxes; in a small box of space only those are looked at that can be the nearest one
//! somewhere in it, and of these, from the nearest on, only as many as their distances from its middle leave a chance.

use super::Field;
use crate::geom::Aabb;
use glam::{DVec2, DVec3};

/// A tool; its axis is z, its tip the lowest point of the axis. Lengths in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tool {
    /// A half ball at the end of a shaft.
    Ball {
        /// Radius of both.
        radius: f64,
    },
    /// A flat end.
    Flat {
        /// Radius of the shaft.
        radius: f64,
    },
    /// A flat end with a rounded rim.
    Bull {
        /// Radius of the shaft.
        radius: f64,
        /// Radius of the rim, less than that of the shaft.
        corner: f64,
    },
}

impl Tool {
    /// Radius of the shaft.
    pub fn radius(&self) -> f64 {
        match self {
            Tool::Ball { radius } | Tool::Flat { radius } | Tool::Bull { radius, .. } => *radius,
        }
    }

    /// Radius of the rim: that of the shaft for a ball end, zero for a flat one.
    fn rim(&self) -> f64 {
        match self {
            Tool::Ball { radius } => *radius,
            Tool::Flat { .. } => 0.0,
            Tool::Bull { corner, .. } => *corner,
        }
    }

    /// A half strip in the half plane `(from the axis, above the tip)`: the tool shrunk by its rim. How far a point lies
    /// beyond its two sides; the shaft has no upper end.
    fn beyond(&self, p: DVec2) -> DVec2 {
        let rim = self.rim();
        DVec2::new(p.x - (self.radius() - rim), rim - p.y)
    }

    /// Distance in the half plane.
    fn distance(&self, p: DVec2) -> f64 {
        let q = self.beyond(p);
        let l = q.max(DVec2::ZERO).length();
        if l > 0.0 { l - self.rim() } else { q.max_element() - self.rim() }
    }

    /// Gradient of the distance.
    fn gradient(&self, p: DVec2) -> DVec2 {
        let q = self.beyond(p);
        let out = q.max(DVec2::ZERO);
        let l = out.length();
        if l > 0.0 {
            let g = out / l;
            DVec2::new(g.x, -g.y)
        } else if q.x > q.y {
            DVec2::X
        } else {
            DVec2::NEG_Y
        }
    }
}

/// One straight move of the tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Start of the tip.
    pub from: DVec3,
    /// End of the tip.
    pub to: DVec3,
    /// Which of the tools.
    pub tool: usize,
}

/// Stock without the swept volumes of all moves.
pub struct Milling {
    stock: Aabb,
    tools: Vec<Tool>,
    moves: Vec<Move>,
    nodes: Vec<Node>,
}

struct Node {
    /// Around the places of the tool's axis; the tool reaches its radius farther, and upwards without end.
    bounds: Aabb,
    radius: f64,
    first: u32,
    count: u32,
    second: u32,
}

/// Moves in a leaf at most.
const MOVES_PER_LEAF: usize = 4;
/// Steps of the search along a sloped move: each leaves 62 % of the room.
const SECTION_STEPS: usize = 44;

impl Milling {
    /// Stock and moves. A move names its tool by its place in `tools`.
    pub fn new(stock: Aabb, tools: Vec<Tool>, moves: Vec<Move>) -> Milling {
        let mut milling = Milling { stock, tools, moves, nodes: Vec::new() };
        let mut moves = std::mem::take(&mut milling.moves);
        if !moves.is_empty() {
            milling.build(&mut moves, 0);
        }
        milling.moves = moves;
        milling
    }

    fn build(&mut self, moves: &mut [Move], first: usize) {
        let at = self.nodes.len();
        let bounds = Aabb::of(moves.iter().flat_map(|m| [&m.from, &m.to]));
        let radius = moves.iter().map(|m| self.tools[m.tool].radius()).fold(0.0, f64::max);
        self.nodes.push(Node { bounds, radius, first: first as u32, count: moves.len() as u32, second: 0 });
        if moves.len() <= MOVES_PER_LEAF {
            return;
        }
        let size = bounds.size();
        let axis = (0..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
        // Stable, so that equal moves keep their order.
        moves.sort_by(|a, b| (a.from[axis] + a.to[axis]).total_cmp(&(b.from[axis] + b.to[axis])));
        let middle = moves.len() / 2;
        let (left, right) = moves.split_at_mut(middle);
        self.build(left, first);
        self.nodes[at].second = self.nodes.len() as u32;
        self.build(right, first + middle);
    }

    /// Distance from one swept volume, and the place of the move that it is taken from.
    fn swept(&self, m: &Move, p: DVec3) -> (f64, f64) {
        let tool = self.tools[m.tool];
        let d = m.to - m.from;
        let at = |s: f64| {
            let q = p - m.from - d * s;
            (tool.distance(DVec2::new(q.truncate().length(), q.z)), s)
        };
        let plan = d.truncate().length_squared();
        // The place of the move that is nearest in plan.
        let level = |low: f64, high: f64| {
            let s = if plan > 0.0 { (p - m.from).truncate().dot(d.truncate()) / plan } else { 0.0 };
            s.clamp(low, high)
        };
        if d.z == 0.0 {
            return at(level(0.0, 1.0));
        }
        if plan == 0.0 {
            // Upright: the lowest place of the tip has all the others above it.
            return at(if d.z < 0.0 { 1.0 } else { 0.0 });
        }
        if let Tool::Ball { radius } = tool {
            // The shaft where the point is above the ball's centre, the ball everywhere.
            let s = ((p - DVec3::Z * radius - m.from).dot(d) / d.length_squared()).clamp(0.0, 1.0);
            let ball = at(s);
            let level_of = (p.z - radius - m.from.z) / d.z;
            let (low, high) = if d.z > 0.0 { (0.0, level_of.min(1.0)) } else { (level_of.max(0.0), 1.0) };
            if low > high {
                return ball;
            }
            let shaft = at(level(low, high));
            return if shaft.0 < ball.0 { shaft } else { ball };
        }
        // Golden section on a convex function.
        let golden = (5f64.sqrt() - 1.0) / 2.0;
        let (mut a, mut b) = (0.0, 1.0);
        let (mut x, mut y) = (1.0 - golden, golden);
        let (mut fx, mut fy) = (at(x), at(y));
        for _ in 0..SECTION_STEPS {
            if fx.0 <= fy.0 {
                (b, y, fy) = (y, x, fx);
                x = b - golden * (b - a);
                fx = at(x);
            } else {
                (a, x, fx) = (x, y, fy);
                y = a + golden * (b - a);
                fy = at(y);
            }
        }
        [at(0.0), at(1.0), fy].into_iter().fold(fx, |best, f| if f.0 < best.0 { f } else { best })
    }

    /// Gradient of the distance from the tool at a place of a move.
    fn slope(&self, m: &Move, s: f64, p: DVec3) -> DVec3 {
        let q = p - m.from - (m.to - m.from) * s;
        let rho = q.truncate().length();
        let g = self.tools[m.tool].gradient(DVec2::new(rho, q.z));
        let out = if rho > 0.0 { q.truncate() / rho } else { DVec2::X };
        DVec3::new(out.x * g.x, out.y * g.x, g.y)
    }

    /// No move under a node is nearer to `p` than this.
    fn reach(&self, at: u32, p: DVec3) -> f64 {
        let n = &self.nodes[at as usize];
        let flat = (n.bounds.min - p).max(p - n.bounds.max).truncate().max(DVec2::ZERO).length() - n.radius;
        flat.max(n.bounds.min.z - p.z)
    }

    /// Visits the moves that may be nearer to `p` than `limit`, which `visit` may lower, the nearest first.
    fn visit(&self, p: DVec3, limit: &mut f64, mut visit: impl FnMut(u32, &mut f64)) {
        if self.nodes.is_empty() {
            return;
        }
        let mut stack = [(0u32, f64::NEG_INFINITY); 64];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let (at, reach) = stack[top];
            // Not less: of moves at the same distance the first counts.
            if reach > *limit {
                continue;
            }
            let node = &self.nodes[at as usize];
            if node.second == 0 {
                (node.first..node.first + node.count).for_each(|m| visit(m, limit));
                continue;
            }
            let (a, b) = ((at + 1, self.reach(at + 1, p)), (node.second, self.reach(node.second, p)));
            // The nearer one on top.
            (stack[top], stack[top + 1]) = if a.1 <= b.1 { (b, a) } else { (a, b) };
            top += 2;
        }
    }

    /// The nearest of everything that the tools sweep.
    fn cut(&self, p: DVec3) -> Nearest {
        let mut nearest = Nearest::default();
        let mut limit = f64::INFINITY;
        self.visit(p, &mut limit, |m, limit| {
            nearest.take(m, self.swept(&self.moves[m as usize], p));
            *limit = nearest.value;
        });
        nearest
    }

    /// Distance and gradient of the stock.
    fn stock(&self, p: DVec3) -> (f64, DVec3) {
        let half = self.stock.size() / 2.0;
        super::Solid::Cuboid { size: half * 2.0, round: 0.0 }.evaluate(p - self.stock.center())
    }

    /// The value at `p`, where the swept volumes have this distance.
    fn value_of(&self, p: DVec3, cut: f64) -> f64 {
        let stock = self.stock(p).0;
        if -cut > stock { -cut } else { stock }
    }

    /// The gradient at `p`, where this is the nearest of the swept volumes.
    fn gradient_of(&self, p: DVec3, cut: &Nearest) -> DVec3 {
        let (stock, h) = self.stock(p);
        if -cut.value > stock {
            -self.moves.get(cut.at as usize).map_or(DVec3::Z, |m| self.slope(m, cut.place, p))
        } else {
            h
        }
    }
}

/// The nearest of some moves; of those at the same distance the first.
struct Nearest {
    value: f64,
    /// Place of the move that the distance is taken from.
    place: f64,
    at: u32,
}

impl Default for Nearest {
    fn default() -> Nearest {
        Nearest { value: f64::INFINITY, place: 0.0, at: u32::MAX }
    }
}

impl Nearest {
    fn take(&mut self, at: u32, (value, place): (f64, f64)) {
        if value < self.value || (value == self.value && at < self.at) {
            *self = Nearest { value, place, at };
        }
    }
}

/// A milled body in a small box: the moves that decide there.
struct Corner<'a> {
    milling: &'a Milling,
    /// Middle of the box.
    center: DVec3,
    /// Moves with their distances from the middle, the nearest first.
    moves: Vec<(f64, u32)>,
}

impl<'a> Corner<'a> {
    /// The moves that can be the nearest one at any place of a box: distances change by no more than the way.
    fn new(milling: &'a Milling, aabb: &Aabb, among: Option<&Corner>) -> Corner<'a> {
        let (center, way) = (aabb.center(), SLACK * aabb.diagonal());
        let mut moves: Vec<(f64, u32)> = Vec::new();
        let mut least = f64::INFINITY;
        let take = |m: u32, limit: &mut f64| {
            let value = milling.swept(&milling.moves[m as usize], center).0;
            least = least.min(value);
            *limit = least + way;
            if value <= *limit {
                moves.push((value, m));
            }
        };
        let mut limit = f64::INFINITY;
        match among {
            Some(corner) => corner.visit(center, &mut limit, take),
            None => milling.visit(center, &mut limit, take),
        }
        moves.retain(|m| m.0 <= limit);
        moves.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Corner { milling, center, moves }
    }

    /// Visits the moves that may be nearer to `p` than `limit`, which `visit` may lower: as far as `p` is from the middle,
    /// a distance can have fallen since there.
    fn visit(&self, p: DVec3, limit: &mut f64, mut visit: impl FnMut(u32, &mut f64)) {
        let way = SLACK * p.distance(self.center) + TINY * self.milling.stock.diagonal();
        for &(value, m) in &self.moves {
            if value - way > *limit {
                break;
            }
            visit(m, limit);
        }
    }

    fn cut(&self, p: DVec3) -> Nearest {
        let mut nearest = Nearest::default();
        let mut limit = f64::INFINITY;
        self.visit(p, &mut limit, |m, limit| {
            nearest.take(m, self.milling.swept(&self.milling.moves[m as usize], p));
            *limit = nearest.value;
        });
        nearest
    }
}

/// Rounding of distances, as a fraction of the stock's diagonal.
const TINY: f64 = 1e-12;

/// Twice the way from the middle of a box to its corners, a little more for rounding.
const SLACK: f64 = 1.000_001;

/// A box gets a list of its own if its diagonal is smaller than this part of the stock's: larger ones meet most moves.
const SMALL: f64 = 0.1;

/// True if a surface of `field`, which is made of distances, can cross a box: they change by no more than the way.
fn crosses(field: &dyn Field, aabb: &Aabb) -> bool {
    field.value(aabb.center()).abs() <= aabb.diagonal() / 2.0
}

impl Field for Corner<'_> {
    fn bounds(&self) -> Aabb {
        self.milling.stock
    }

    fn value(&self, p: DVec3) -> f64 {
        // What is asked first is the middle.
        let middle = self.moves.first().filter(|_| p == self.center);
        let cut = middle.map_or_else(|| self.cut(p).value, |m| m.0);
        self.milling.value_of(p, cut)
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        self.milling.gradient_of(p, &self.cut(p))
    }

    fn crosses(&self, aabb: &Aabb) -> bool {
        crosses(self, aabb)
    }

    fn within(&self, aabb: &Aabb) -> Option<Box<dyn Field + '_>> {
        Some(Box::new(Corner::new(self.milling, aabb, Some(self))))
    }
}

impl Field for Milling {
    fn bounds(&self) -> Aabb {
        self.stock
    }

    fn value(&self, p: DVec3) -> f64 {
        self.value_of(p, self.cut(p).value)
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        self.gradient_of(p, &self.cut(p))
    }

    fn crosses(&self, aabb: &Aabb) -> bool {
        crosses(self, aabb)
    }

    fn within(&self, aabb: &Aabb) -> Option<Box<dyn Field + '_>> {
        let small = aabb.diagonal() < SMALL * self.stock.diagonal();
        small.then(|| Box::new(Corner::new(self, aabb, None)) as Box<dyn Field>)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;

    #[test]
    fn sloped_sweeps_are_the_least_of_2000_places_of_the_tool_within_their_spacing() {
        let stock = Aabb { min: DVec3::splat(-1e3), max: DVec3::splat(1e3) };
        for tool in [Tool::Ball { radius: 0.5 }, Tool::Flat { radius: 0.4 }, Tool::Bull { radius: 0.5, corner: 0.2 }] {
            for (n, to) in [DVec3::new(1.0, 0.5, -0.7), DVec3::new(0.8, 0.0, 0.0), DVec3::new(0.0, 0.0, -0.6)]
                .into_iter()
                .enumerate()
            {
                let m = Move { from: DVec3::ZERO, to, tool: 0 };
                let milling = Milling::new(stock, vec![tool], vec![m]);
                for k in 0..200u64 {
                    let r = |a| 3.0 * random::unit(n as u64, 3 * k + a) - 1.2;
                    let p = DVec3::new(r(0), r(1), r(2));
                    let least = (0..=2000)
                        .map(|s| {
                            let q = p - to * s as f64 / 2000.0;
                            tool.distance(DVec2::new(q.truncate().length(), q.z))
                        })
                        .fold(f64::INFINITY, f64::min);
                    let found = milling.cut(p).value;
                    assert!(found <= least + 1e-9 && found > least - 4e-4, "{tool:?} {to} {p}: {found} {least}");
                }
            }
        }
    }

    #[test]
    fn in_small_boxes_of_300_moves_values_and_gradients_are_bitwise_those_of_the_whole() {
        let stock = Aabb { min: DVec3::ZERO, max: DVec3::splat(10.0) };
        let r = |a: u64, b: u64| random::unit(a, b);
        let place = |n: u64| DVec3::new(10.0 * r(n, 0), 10.0 * r(n, 1), 4.0 + 6.0 * r(n, 2));
        let tools =
            vec![Tool::Ball { radius: 0.5 }, Tool::Flat { radius: 0.4 }, Tool::Bull { radius: 0.5, corner: 0.2 }];
        let moves = (0..300).map(|n| Move { from: place(n), to: place(n + 1), tool: n as usize % 3 }).collect();
        let milling = Milling::new(stock, tools, moves);
        for n in 0..400u64 {
            let low = DVec3::new(10.0 * r(n, 10), 10.0 * r(n, 11), 10.0 * r(n, 12));
            let aabb = Aabb { min: low, max: low + DVec3::splat(0.3) };
            let near = milling.within(&aabb).expect("a small box");
            let nearer = near.within(&Aabb { min: low, max: low + DVec3::splat(0.2) }).expect("a smaller box");
            for k in 0..8 {
                let p = low + 0.2 * DVec3::new(r(n, 20 + k), r(n, 30 + k), r(n, 40 + k));
                for field in [&*near, &*nearer] {
                    assert_eq!(field.value(p).to_bits(), milling.value(p).to_bits(), "{p}");
                    assert_eq!(field.gradient(p), milling.gradient(p), "{p}");
                }
            }
        }
    }
}
