//! Least cuts: nodes that each take one of two sides, where sides have costs and so do links between them.
//!
//! The least cost is a greatest flow (Ford, Fulkerson 1956, *Maximal flow through a network*), found by Dinic 1970,
//! *Algorithm for solution of a problem of maximum flow in networks with power estimation*: shortest ways first, all of one
//! length at a time. Costs are whole numbers, so that the result is exact.

use super::NONE;
use std::collections::VecDeque;

/// A link that something can flow along.
struct Arc {
    to: u32,
    /// The next arc of the same node.
    next: u32,
    left: i64,
}

/// Nodes with costs of their sides, and links between them.
pub struct Cut {
    arcs: Vec<Arc>,
    first: Vec<u32>,
    /// For each node what the first side costs more than the second.
    excess: Vec<i64>,
}

impl Cut {
    /// So many nodes without costs.
    pub fn new(nodes: usize) -> Cut {
        // Room for a side and three links of each.
        Cut { arcs: Vec::with_capacity(8 * nodes), first: vec![NONE; nodes + 2], excess: vec![0; nodes] }
    }

    /// Adds the costs of a node on the first side and on the second one.
    pub fn sides(&mut self, node: u32, first: i64, second: i64) {
        self.excess[node as usize] += first - second;
    }

    /// Adds the cost of `a` on the first side with `b` on the second, and of `b` on the first with `a` on the second.
    /// * `there`, `back` - not negative
    pub fn link(&mut self, a: u32, b: u32, there: i64, back: i64) {
        for (from, to, left) in [(a, b, there), (b, a, back)] {
            self.arcs.push(Arc { to, next: self.first[from as usize], left });
            self.first[from as usize] = self.arcs.len() as u32 - 1;
        }
    }

    /// For each node whether it is on the second side, where all costs together are least; nodes that may be on either
    /// are on the first.
    pub fn least(mut self) -> Vec<bool> {
        let nodes = self.excess.len() as u32;
        let (source, sink) = (nodes, nodes + 1);
        for v in 0..nodes {
            match self.excess[v as usize] {
                0 => {}
                x if x < 0 => self.link(source, v, -x, 0),
                x => self.link(v, sink, x, 0),
            }
        }
        let mut level = self.levels(source);
        while level[sink as usize] != NONE {
            let mut at = self.first.clone();
            while self.augment(source, sink, &level, &mut at) {}
            level = self.levels(source);
        }
        // What can still be filled from the sink's side is second; the rest stays first.
        let second = self.reaching(sink);
        (0..nodes as usize).map(|v| second[v]).collect()
    }

    /// Steps from `source` along arcs with room; [`NONE`] where there is no way.
    fn levels(&self, source: u32) -> Vec<u32> {
        let mut level = vec![NONE; self.first.len()];
        level[source as usize] = 0;
        let mut queue = VecDeque::from([source]);
        while let Some(v) = queue.pop_front() {
            let mut a = self.first[v as usize];
            while a != NONE {
                let Arc { to, next, left } = self.arcs[a as usize];
                if left > 0 && level[to as usize] == NONE {
                    level[to as usize] = level[v as usize] + 1;
                    queue.push_back(to);
                }
                a = next;
            }
        }
        level
    }

    /// Sends as much as goes along one more way of rising levels; false if there is none.
    /// * `at` - for each node the arc that is tried next
    fn augment(&mut self, source: u32, sink: u32, level: &[u32], at: &mut [u32]) -> bool {
        let mut way: Vec<u32> = Vec::new();
        let mut v = source;
        while v != sink {
            let a = at[v as usize];
            if a == NONE {
                // A dead end: back, and not here again.
                let Some(last) = way.pop() else { return false };
                v = self.arcs[last as usize ^ 1].to;
                at[v as usize] = self.arcs[last as usize].next;
                continue;
            }
            let Arc { to, next, left } = self.arcs[a as usize];
            if left > 0 && level[to as usize] == level[v as usize] + 1 {
                way.push(a);
                v = to;
            } else {
                at[v as usize] = next;
            }
        }
        let flow = way.iter().map(|&a| self.arcs[a as usize].left).min().unwrap_or(0);
        for a in way {
            self.arcs[a as usize].left -= flow;
            self.arcs[a as usize ^ 1].left += flow;
        }
        true
    }

    /// The nodes from which something can still flow to `sink`.
    fn reaching(&self, sink: u32) -> Vec<bool> {
        let mut found = vec![false; self.first.len()];
        found[sink as usize] = true;
        let mut stack = vec![sink];
        while let Some(v) = stack.pop() {
            let mut a = self.first[v as usize];
            while a != NONE {
                let Arc { to, next, .. } = self.arcs[a as usize];
                if self.arcs[a as usize ^ 1].left > 0 && !std::mem::replace(&mut found[to as usize], true) {
                    stack.push(to);
                }
                a = next;
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random::unit;

    #[test]
    fn sides_of_200_graphs_of_10_nodes_cost_as_little_as_the_best_of_all_1024() {
        let mut drawn = 0;
        let mut draw = |n: u64| {
            drawn += 1;
            (unit(7, drawn) * n as f64) as u64
        };
        for _ in 0..200 {
            let costs: Vec<[i64; 2]> = (0..10).map(|_| [draw(20) as i64, draw(20) as i64]).collect();
            let links: Vec<(u32, u32, [i64; 2])> = (0..20)
                .map(|_| (draw(10) as u32, draw(10) as u32, [draw(8) as i64, draw(8) as i64]))
                .filter(|l| l.0 != l.1)
                .collect();
            let cost = |second: &dyn Fn(usize) -> bool| -> i64 {
                let own: i64 = (0..10).map(|v| costs[v][usize::from(second(v))]).sum();
                let between =
                    links.iter().map(|&(a, b, [there, back])| match (second(a as usize), second(b as usize)) {
                        (false, true) => there,
                        (true, false) => back,
                        _ => 0,
                    });
                own + between.sum::<i64>()
            };
            let mut cut = Cut::new(10);
            (0..10).for_each(|v| cut.sides(v, costs[v as usize][0], costs[v as usize][1]));
            links.iter().for_each(|&(a, b, [there, back])| cut.link(a, b, there, back));
            let found = cut.least();
            let best = (0..1024).map(|mask: usize| cost(&|v| mask >> v & 1 == 1)).min().unwrap();
            assert_eq!(cost(&|v| found[v]), best);
        }
    }
}
