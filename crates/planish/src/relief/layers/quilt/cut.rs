//! The cut of least cost between two sets of cells of a grid: Dinic, *Algorithm for Solution of a Problem of Maximum Flow in
//! Networks with Power Estimation*, Soviet Math. Doklady 11, 1970.

use std::collections::VecDeque;

/// What a cell of the grid is to the cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cell {
    /// Not part of the graph.
    Out,
    /// On either side.
    Free,
    /// On the side of what is there.
    Old,
    /// On the side of what is new.
    New,
}

const NEIGHBOURS: [(isize, isize); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];
const UNREACHED: u32 = u32::MAX;

/// A grid with the capacities from each cell to its neighbours that are left.
struct Flow<'a> {
    width: usize,
    cells: &'a [Cell],
    left: Vec<[u64; 4]>,
    level: Vec<u32>,
}

/// For each cell true if it is on the side of the old ones, at the least sum of what is cut.
/// * `cost` - of a cut between two neighbours; the same both ways
pub(super) fn old_side(width: usize, cells: &[Cell], cost: impl Fn(usize, usize) -> u64) -> Vec<bool> {
    let mut flow = Flow { width, cells, left: vec![[0; 4]; cells.len()], level: Vec::new() };
    for k in (0..cells.len()).filter(|&k| cells[k] != Cell::Out) {
        for way in 0..4 {
            if let Some(next) = flow.next(k, way) {
                flow.left[k][way] = cost(k, next);
            }
        }
    }
    while flow.reach() {
        flow.block();
    }
    flow.level.iter().map(|&l| l != UNREACHED).collect()
}

impl Flow<'_> {
    fn next(&self, k: usize, way: usize) -> Option<usize> {
        let (dx, dy) = NEIGHBOURS[way];
        let x = (k % self.width).checked_add_signed(dx).filter(|&x| x < self.width)?;
        let y = (k / self.width).checked_add_signed(dy)?;
        let next = y * self.width + x;
        (next < self.cells.len() && self.cells[next] != Cell::Out).then_some(next)
    }

    /// Steps from the old cells over what is left; false if no new one is reached.
    fn reach(&mut self) -> bool {
        self.level = self.cells.iter().map(|&c| if c == Cell::Old { 0 } else { UNREACHED }).collect();
        let mut queue: VecDeque<usize> = (0..self.cells.len()).filter(|&k| self.cells[k] == Cell::Old).collect();
        let mut found = false;
        while let Some(k) = queue.pop_front() {
            found |= self.cells[k] == Cell::New;
            for way in 0..4 {
                match self.next(k, way) {
                    Some(next) if self.left[k][way] > 0 && self.level[next] == UNREACHED => {
                        self.level[next] = self.level[k] + 1;
                        queue.push_back(next);
                    }
                    _ => {}
                }
            }
        }
        found
    }

    /// Fills all shortest ways.
    fn block(&mut self) {
        let mut tried = vec![0; self.cells.len()];
        for start in (0..self.cells.len()).filter(|&k| self.cells[k] == Cell::Old) {
            let mut path: Vec<(usize, usize)> = Vec::new();
            let mut k = start;
            loop {
                if self.cells[k] == Cell::New {
                    let most = path.iter().map(|&(k, way)| self.left[k][way]).min().unwrap_or(0);
                    for &(k, way) in &path {
                        self.left[k][way] -= most;
                        if let Some(next) = self.next(k, way) {
                            self.left[next][(way + 2) % 4] += most;
                        }
                    }
                    path.clear();
                    k = start;
                }
                let open = (tried[k]..4).find_map(|way| {
                    let next = self.next(k, way)?;
                    (self.left[k][way] > 0 && self.level[next] == self.level[k] + 1).then_some((way, next))
                });
                match open {
                    Some((way, next)) => {
                        tried[k] = way;
                        path.push((k, way));
                        k = next;
                    }
                    None => {
                        tried[k] = 4;
                        let Some((back, _)) = path.pop() else { break };
                        k = back;
                        tried[k] += 1;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cut_goes_through_the_cheap_column() {
        let cells: Vec<Cell> = (0..5 * 4)
            .map(|k| match k % 5 {
                0 => Cell::Old,
                4 => Cell::New,
                _ => Cell::Free,
            })
            .collect();
        let cost = |a: usize, b: usize| if a % 5 + b % 5 == 5 { 1 } else { 7 };
        let old = old_side(5, &cells, cost);
        for (k, old) in old.into_iter().enumerate() {
            assert_eq!(old, k % 5 < 3, "{k}");
        }
    }
}
