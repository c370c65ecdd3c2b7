//! The cell complex of a layout: nodes, arcs and cells embedded in the working mesh.
//!
//! They become the corners, curves and patches of a network; a cell may have any number of sides until then.
//! A half-arc is `2 arc + reversed`; the cell of a half-arc lies on its left. Cells are disks at all times:
//! `docs/decisions/0005-spade-and-convex-maps.md`.

use crate::mesh::NONE;
use crate::network::CurveKind;
use crate::network::imprint::Place;

/// An arc between two nodes.
#[derive(Clone, Debug)]
pub(super) struct Arc {
    pub nodes: [u32; 2],
    pub kind: CurveKind,
    /// Places on the working mesh, both ends included.
    pub chain: Vec<Place>,
    /// Cells to the left and to the right; [`NONE`] outside the mesh.
    pub cells: [u32; 2],
}

/// A node; all nodes are vertices of the working mesh.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub vertex: u32,
    /// It keeps its place: a corner of a sharp line or of the boundary, or the tip of a limb.
    pub stays: bool,
}

/// The complex. Arcs and cells that are gone are `None`.
#[derive(Clone, Debug, Default)]
pub(super) struct Complex {
    pub nodes: Vec<Node>,
    pub arcs: Vec<Option<Arc>>,
    /// The half-arcs around each cell, counter-clockwise.
    pub cells: Vec<Option<Vec<u32>>>,
}

impl Complex {
    pub fn arc(&self, half: u32) -> &Arc {
        self.arcs[half as usize / 2].as_ref().expect("a live arc")
    }

    /// Node at the start of a half-arc.
    pub fn from(&self, half: u32) -> u32 {
        self.arc(half).nodes[half as usize % 2]
    }

    /// Node at the end of a half-arc.
    pub fn to(&self, half: u32) -> u32 {
        self.from(half ^ 1)
    }

    /// Cell to the left of a half-arc.
    pub fn cell(&self, half: u32) -> u32 {
        self.arc(half).cells[half as usize % 2]
    }

    pub fn live_arcs(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.arcs.len() as u32).filter(|&a| self.arcs[a as usize].is_some())
    }

    pub fn live_cells(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.cells.len() as u32).filter(|&c| self.cells[c as usize].is_some())
    }

    pub fn loop_of(&self, cell: u32) -> &[u32] {
        self.cells[cell as usize].as_ref().expect("a live cell")
    }

    /// Marks the cells with a node of a marked one.
    pub fn with_neighbours(&self, marked: &[bool]) -> Vec<bool> {
        let nodes_of = |c: u32| self.loop_of(c).iter().map(|&h| self.from(h) as usize);
        let mut near = vec![false; self.nodes.len()];
        self.live_cells().filter(|&c| marked[c as usize]).flat_map(nodes_of).for_each(|n| near[n] = true);
        let mut wider = vec![false; self.cells.len()];
        self.live_cells().for_each(|c| wider[c as usize] = nodes_of(c).any(|n| near[n]));
        wider
    }

    /// The half-arc after `half` around its cell.
    pub fn following(&self, half: u32) -> u32 {
        let sides = self.loop_of(self.cell(half));
        let i = sides.iter().position(|&h| h == half).expect("a side of its cell");
        sides[(i + 1) % sides.len()]
    }

    /// Outgoing half-arcs of one node, counter-clockwise.
    pub fn star(&self, node: u32) -> Vec<u32> {
        let out: Vec<u32> =
            self.live_arcs().flat_map(|a| [2 * a, 2 * a + 1]).filter(|&h| self.from(h) == node).collect();
        self.around(&out)
    }

    /// Sorts the outgoing half-arcs of a node counter-clockwise; on the boundary from the first.
    fn around(&self, out: &[u32]) -> Vec<u32> {
        let before = |h: u32| {
            let sides = self.loop_of(self.cell(h));
            let i = sides.iter().position(|&g| g == h).expect("a side of its cell");
            sides[(i + sides.len() - 1) % sides.len()]
        };
        let Some(&any) = out.first() else { return Vec::new() };
        let first = out.iter().copied().find(|&h| self.cell(h ^ 1) == NONE).unwrap_or(any);
        let mut star = vec![first];
        loop {
            let h = star[star.len() - 1];
            if self.cell(h) == NONE {
                break;
            }
            let turned = before(h) ^ 1;
            if turned == first || star.len() > out.len() {
                break;
            }
            star.push(turned);
        }
        star
    }

    /// [`Complex::star`] of every node.
    pub fn stars(&self) -> Vec<Vec<u32>> {
        let mut out = vec![Vec::new(); self.nodes.len()];
        for h in self.live_arcs().flat_map(|a| [2 * a, 2 * a + 1]) {
            out[self.from(h) as usize].push(h);
        }
        out.iter().map(|out| self.around(out)).collect()
    }

    /// Makes the arcs of two half-arcs that leave a node one, from the end of `left` to that of `right`, and returns it: it has the number of
    /// the first. The sides of cells are as before.
    pub fn join_arcs(&mut self, left: u32, right: u32) -> u32 {
        let chain = |h: u32| {
            let mut chain: Vec<Place> = self.arc(h).chain.clone();
            if h % 2 == 1 {
                chain.reverse();
            }
            chain
        };
        let mut places = chain(left ^ 1);
        places.extend(chain(right).into_iter().skip(1));
        let arc = Arc {
            nodes: [self.to(left), self.to(right)],
            kind: self.arc(left).kind,
            chain: places,
            cells: [self.cell(left ^ 1), self.cell(left)],
        };
        self.arcs[right as usize / 2] = None;
        self.arcs[left as usize / 2] = Some(arc);
        left / 2
    }

    /// Splits arc `a` at the inner place `at` of its chain, which must be a vertex; returns the new node.
    pub fn split_arc(&mut self, a: u32, at: usize) -> u32 {
        let Arc { nodes, kind, chain, cells } = self.arcs[a as usize].take().expect("a live arc");
        let Place::Vertex(vertex) = chain[at] else { panic!("arcs are split at vertices") };
        let node = self.nodes.len() as u32;
        self.nodes.push(Node { vertex, stays: false });
        let second = self.arcs.len() as u32;
        let (head, tail) = (chain[..=at].to_vec(), chain[at..].to_vec());
        self.arcs[a as usize] = Some(Arc { nodes: [nodes[0], node], kind, chain: head, cells });
        self.arcs.push(Some(Arc { nodes: [node, nodes[1]], kind, chain: tail, cells }));
        for (side, &cell) in cells.iter().enumerate() {
            if cell == NONE {
                continue;
            }
            let sides = self.cells[cell as usize].as_mut().expect("a live cell");
            let half = 2 * a + side as u32;
            let i = sides.iter().position(|&h| h == half).expect("the arc bounds its cell");
            // Along the arc the new piece comes after, against it before.
            sides.insert(i + 1 - side, 2 * second + side as u32);
        }
        node
    }
}
