//! Shortest paths over a graph whose nodes are numbered.
//!
//! Dijkstra 1959, *A Note on Two Problems in Connexion with Graphs*; with a bound of the way ahead Hart, Nilsson and Raphael
//! 1968, *A Formal Basis for the Heuristic Determination of Minimum Cost Paths* (A*).
//!
//! The caller turns the crank, so that it alone says which ways there are and when enough is known:
//! ```text
//! let mut search = Search::dense(nodes);
//! search.reach(source, 0.0, NONE);                    // as many sources as wanted
//! while let Some((node, distance)) = search.settle() {  // nearest first, equally near ones by index
//!     for (other, length) in links of node {
//!         search.reach(other, distance + length, node);
//!     }
//! }
//! ```

use super::NONE;
use std::cmp::{Ordering, Reverse};
use std::collections::{BinaryHeap, HashMap};

/// A node that waits, with the length of the way through it as far as known, and its distance.
struct Waiting {
    estimate: f64,
    node: u32,
    distance: f64,
}

impl Ord for Waiting {
    fn cmp(&self, other: &Waiting) -> Ordering {
        let nearer = self.estimate.total_cmp(&other.estimate);
        nearer.then(self.node.cmp(&other.node)).then(self.distance.total_cmp(&other.distance))
    }
}
impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Waiting) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Waiting {
    fn eq(&self, other: &Waiting) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Waiting {}

/// Nodes by rising estimate, ties by index. A node may wait more than once.
#[derive(Default)]
pub struct Queue(BinaryHeap<Reverse<Waiting>>);

impl Queue {
    /// Lets a node wait.
    pub fn push(&mut self, estimate: f64, node: u32, distance: f64) {
        self.0.push(Reverse(Waiting { estimate, node, distance }));
    }

    /// The node of least estimate and its distance.
    pub fn pop(&mut self) -> Option<(u32, f64)> {
        self.0.pop().map(|Reverse(w)| (w.node, w.distance))
    }
}

/// What a search knows of the nodes: how far each is, and by what it was reached.
pub trait Reached {
    /// Distance of a node, infinite where not reached.
    fn distance(&self, node: u32) -> f64;
    /// What the caller named as the last step to a node; [`NONE`] at sources and where not reached.
    fn via(&self, node: u32) -> u32;
    /// Notes a way to a node.
    fn set(&mut self, node: u32, distance: f64, via: u32);

    /// The nodes from `node` back to its source, where `via` is the node before.
    fn chain(&self, node: u32) -> Vec<u32> {
        let mut chain = vec![node];
        let mut at = node;
        while self.via(at) != NONE {
            at = self.via(at);
            chain.push(at);
        }
        chain
    }
}

/// An entry for each node: for searches that reach most of the graph.
#[derive(Clone, Debug, PartialEq)]
pub struct Dense {
    /// For each node its distance, infinite where not reached.
    pub distance: Vec<f64>,
    /// For each node the last step to it ([`NONE`] at sources and where not reached).
    pub via: Vec<u32>,
}

impl Dense {
    /// Nothing reached yet of so many nodes.
    pub fn new(nodes: usize) -> Dense {
        Dense { distance: vec![f64::INFINITY; nodes], via: vec![NONE; nodes] }
    }
}

impl Reached for Dense {
    fn distance(&self, node: u32) -> f64 {
        self.distance[node as usize]
    }

    fn via(&self, node: u32) -> u32 {
        self.via[node as usize]
    }

    fn set(&mut self, node: u32, distance: f64, via: u32) {
        self.distance[node as usize] = distance;
        self.via[node as usize] = via;
    }
}

/// Distance and last step of the nodes reached: for searches that stay near their sources.
pub type Sparse = HashMap<u32, (f64, u32)>;

impl Reached for Sparse {
    fn distance(&self, node: u32) -> f64 {
        self.get(&node).map_or(f64::INFINITY, |r| r.0)
    }

    fn via(&self, node: u32) -> u32 {
        self.get(&node).map_or(NONE, |r| r.1)
    }

    fn set(&mut self, node: u32, distance: f64, via: u32) {
        self.insert(node, (distance, via));
    }
}

impl<R: Reached> Reached for &mut R {
    fn distance(&self, node: u32) -> f64 {
        (**self).distance(node)
    }

    fn via(&self, node: u32) -> u32 {
        (**self).via(node)
    }

    fn set(&mut self, node: u32, distance: f64, via: u32) {
        (**self).set(node, distance, via);
    }
}

/// A search under way.
pub struct Search<R> {
    /// What is known so far. Distances are final for the nodes that [`Search::settle`] has returned.
    pub reached: R,
    queue: Queue,
}

impl Search<Dense> {
    /// A search that keeps an entry for each of `nodes` nodes.
    pub fn dense(nodes: usize) -> Search<Dense> {
        Search::over(Dense::new(nodes))
    }
}

impl Search<Sparse> {
    /// A search whose memory grows with the nodes it reaches.
    pub fn sparse() -> Search<Sparse> {
        Search::over(Sparse::new())
    }
}

impl<R: Reached> Search<R> {
    /// A search that goes on from what is known.
    pub fn over(reached: R) -> Search<R> {
        Search { reached, queue: Queue::default() }
    }

    /// Notes a way of length `distance` to a node with its last step, if none as short is known.
    pub fn reach(&mut self, node: u32, distance: f64, via: u32) {
        self.reach_towards(node, distance, via, 0.0);
    }

    /// The same with a lower bound of what lies between the node and the goal.
    pub fn reach_towards(&mut self, node: u32, distance: f64, via: u32, ahead: f64) {
        if distance < self.reached.distance(node) {
            self.reached.set(node, distance, via);
            self.queue.push(distance + ahead, node, distance);
        }
    }

    /// The next node in the order of (distance and way ahead, index), and its distance; `None` when all have been.
    pub fn settle(&mut self) -> Option<(u32, f64)> {
        loop {
            let (node, distance) = self.queue.pop()?;
            // A shorter way was found while this one waited.
            if distance <= self.reached.distance(node) {
                return Some((node, distance));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Links of the nodes of a square lattice of `n` by `n`, every one of length 1.
    fn links(n: u32, v: u32) -> impl Iterator<Item = u32> {
        let (x, y) = (v % n, v / n);
        let beside = [(x > 0).then(|| v - 1), (x + 1 < n).then_some(v + 1)];
        beside.into_iter().chain([(y > 0).then(|| v - n), (y + 1 < n).then_some(v + n)]).flatten()
    }

    fn search<R: Reached>(mut search: Search<R>, n: u32, sources: &[u32]) -> (R, Vec<(u32, f64)>) {
        sources.iter().for_each(|&v| search.reach(v, 0.0, NONE));
        let mut order = Vec::new();
        while let Some((v, d)) = search.settle() {
            order.push((v, d));
            links(n, v).for_each(|w| search.reach(w, d + 1.0, v));
        }
        (search.reached, order)
    }

    #[test]
    fn distances_on_a_lattice_of_7_by_7_are_steps_and_nodes_come_by_distance_and_index() {
        let (dense, order) = search(Search::dense(49), 7, &[0, 48]);
        for v in 0..49u32 {
            let steps = v % 7 + v / 7;
            assert_eq!(dense.distance(v), steps.min(12 - steps) as f64);
        }
        assert!(order.len() == 49 && order.is_sorted_by(|a, b| (a.1, a.0) < (b.1, b.0)), "{order:?}");
        let (sparse, again) = search(Search::sparse(), 7, &[0, 48]);
        assert_eq!(order, again);
        assert!((0..49).all(|v| sparse.via(v) == dense.via(v)));
    }

    #[test]
    fn a_bound_of_the_way_ahead_finds_the_same_distance_of_12_steps_and_settles_no_node_behind_the_goal() {
        let mut search = Search::sparse();
        // From the middle of one side of the lattice to the middle of the other; what lies ahead is known here.
        let ahead = |v: u32| (v % 13).abs_diff(12) as f64 + (v / 13).abs_diff(6) as f64;
        search.reach_towards(6 * 13, 0.0, NONE, ahead(6 * 13));
        let mut settled = 0;
        while let Some((v, d)) = search.settle() {
            settled += 1;
            if v == 6 * 13 + 12 {
                break;
            }
            links(13, v).for_each(|w| search.reach_towards(w, d + 1.0, v, ahead(w)));
        }
        assert_eq!((search.reached.distance(6 * 13 + 12), settled), (12.0, 13));
        assert_eq!(search.reached.chain(6 * 13 + 12).len(), 13);
    }
}
