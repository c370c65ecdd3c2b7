//! Milling: a stock box without the volumes that a tool sweeps.
//!
//! METHODS 2.1 ([K01] §5.1, milling): a tool is a convex body of revolution, so its sweep along a straight move is
//! convex, and the distance from it is the least over the move of the distance from the tool. That is a convex function
//! of the place on the move: closed forms where the move is level or upright or the tool is ball-ended, a search
//! otherwise. Moves sit in a tree of boxes.

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

    /// Distance and gradient in the half plane `(from the axis, above the tip)`; the shaft has no upper end.
    fn distance(&self, p: DVec2) -> (f64, DVec2) {
        // A half strip, shrunk by the rim and grown by it again.
        let rim = self.rim();
        let q = DVec2::new(p.x - (self.radius() - rim), rim - p.y);
        let out = q.max(DVec2::ZERO);
        let l = out.length();
        if l > 0.0 {
            let g = out / l;
            (l - rim, DVec2::new(g.x, -g.y))
        } else if q.x > q.y {
            (q.x - rim, DVec2::X)
        } else {
            (q.y - rim, DVec2::NEG_Y)
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
const LEAF: usize = 4;
/// Steps of the search along a sloped move: each leaves 62 % of the room.
const STEPS: usize = 44;

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
        if moves.len() <= LEAF {
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

    /// Distance from one swept volume, and its gradient.
    fn swept(&self, m: &Move, p: DVec3) -> (f64, DVec3) {
        let tool = self.tools[m.tool];
        let d = m.to - m.from;
        let at = |s: f64| {
            let q = p - m.from - d * s;
            let rho = q.truncate().length();
            let (value, g) = tool.distance(DVec2::new(rho, q.z));
            let out = if rho > 0.0 { q.truncate() / rho } else { DVec2::X };
            (value, DVec3::new(out.x * g.x, out.y * g.x, g.y))
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
        for _ in 0..STEPS {
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

    /// Distance from everything that the tools sweep, and its gradient.
    fn cut(&self, p: DVec3) -> (f64, DVec3) {
        let mut best = (f64::INFINITY, DVec3::Z);
        if self.nodes.is_empty() {
            return best;
        }
        let reach = |n: &Node| {
            let flat = (n.bounds.min - p).max(p - n.bounds.max).truncate().max(DVec2::ZERO).length() - n.radius;
            let below = n.bounds.min.z - p.z;
            flat.max(below)
        };
        let mut stack = [0u32; 64];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let at = stack[top] as usize;
            let node = &self.nodes[at];
            if reach(node) >= best.0 {
                continue;
            }
            if node.second == 0 {
                for m in &self.moves[node.first as usize..(node.first + node.count) as usize] {
                    let found = self.swept(m, p);
                    if found.0 < best.0 {
                        best = found;
                    }
                }
                continue;
            }
            let (one, other) = (at as u32 + 1, node.second);
            let (a, b) = (reach(&self.nodes[one as usize]), reach(&self.nodes[other as usize]));
            // The nearer one on top.
            (stack[top], stack[top + 1]) = if a <= b { (other, one) } else { (one, other) };
            top += 2;
        }
        best
    }

    fn evaluate(&self, p: DVec3) -> (f64, DVec3) {
        let half = self.stock.size() / 2.0;
        let (stock, g) = super::Solid::Cuboid { size: half * 2.0, round: 0.0 }.evaluate(p - self.stock.center());
        let (cut, h) = self.cut(p);
        if -cut > stock { (-cut, -h) } else { (stock, g) }
    }
}

impl Field for Milling {
    fn bounds(&self) -> Aabb {
        self.stock
    }

    fn value(&self, p: DVec3) -> f64 {
        self.evaluate(p).0
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        self.evaluate(p).1
    }

    fn crosses(&self, aabb: &Aabb) -> bool {
        // Both are distances: they change by no more than the way.
        self.value(aabb.center()).abs() <= aabb.diagonal() / 2.0
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
                            tool.distance(DVec2::new(q.truncate().length(), q.z)).0
                        })
                        .fold(f64::INFINITY, f64::min);
                    let found = milling.cut(p).0;
                    assert!(found <= least + 1e-9 && found > least - 4e-4, "{tool:?} {to} {p}: {found} {least}");
                }
            }
        }
    }
}
