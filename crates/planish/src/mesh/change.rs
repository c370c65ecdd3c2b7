//! Local changes of triangles: collapse, flip, split, drop, and back again.
//!
//! What a change asks and does is the same everywhere, and is here: which triangles are around a vertex or beyond an edge,
//! whether the surface stays a manifold (the link condition of Dey, Edelsbrunner, Guha, Nekhayev, *Topology preserving edge
//! contraction*, 1999), which lines go along, and what was there before. Why a change is made, and whether triangles may
//! look as they would, is for the caller: it asks for the corners first ([`Flip`]) or takes a [`Change`] back.
//!
//! * Names stay. A triangle keeps its index until [`Changing::into_triangles`], which leaves out those that are gone; a
//!   vertex that is collapsed has no triangle any more. So a list per triangle or vertex of the caller's stays right.
//! * No vertex moves, so places and attributes of vertices need no carrying; those of a split's vertex are the caller's.
//! * Lines are edges by their ends. A collapse takes them along, a split parts them, and no line is flipped.

use std::collections::BTreeSet;

/// Triangles that are changed one place at a time.
pub(crate) struct Changing {
    /// The triangles; `None` where one is gone.
    triangles: Vec<Option<[u32; 3]>>,
    /// Triangles around each vertex, in no order.
    stars: Vec<Vec<u32>>,
    /// Edges of lines, the lesser vertex first.
    pub lines: BTreeSet<[u32; 2]>,
}

/// What was before a change.
pub(crate) struct Change {
    triangles: Vec<(u32, Option<[u32; 3]>)>,
    stars: Vec<(u32, Vec<u32>)>,
    removed: Vec<[u32; 2]>,
    added: Vec<[u32; 2]>,
}

/// An edge that can be flipped: the two triangles at it and the corners that they would have.
pub(crate) struct Flip {
    pub triangles: [u32; 2],
    pub corners: [[u32; 3]; 2],
    /// The ends of the edge, and of the one in its place.
    pub edge: [u32; 2],
    pub tips: [u32; 2],
}

fn lesser_first(v: u32, w: u32) -> [u32; 2] {
    [v.min(w), v.max(w)]
}

impl Change {
    /// The triangles that are other than before.
    pub fn triangles(&self) -> impl Iterator<Item = u32> {
        self.triangles.iter().map(|t| t.0)
    }
}

impl Changing {
    /// Triangles over so many vertices.
    /// * `lines` - edges of lines, the lesser vertex first
    pub fn new(triangles: &[[u32; 3]], vertices: usize, lines: &[[u32; 2]]) -> Changing {
        let mut stars = vec![Vec::new(); vertices];
        for (t, triangle) in triangles.iter().enumerate() {
            triangle.iter().for_each(|&v| stars[v as usize].push(t as u32));
        }
        Changing {
            triangles: triangles.iter().copied().map(Some).collect(),
            stars,
            lines: lines.iter().copied().collect(),
        }
    }

    /// The triangles that are left, in their order.
    pub fn into_triangles(self) -> Vec<[u32; 3]> {
        self.triangles.into_iter().flatten().collect()
    }

    /// One more than the greatest index of a triangle.
    pub fn len(&self) -> u32 {
        self.triangles.len() as u32
    }

    /// Corners of a triangle, if it is there.
    pub fn get(&self, t: u32) -> Option<[u32; 3]> {
        self.triangles[t as usize]
    }

    /// Corners of a triangle of which the caller knows that it is there.
    pub fn corners(&self, t: u32) -> [u32; 3] {
        self.triangles[t as usize].unwrap_or_default()
    }

    /// Triangles around a vertex.
    pub fn star(&self, v: u32) -> &[u32] {
        &self.stars[v as usize]
    }

    /// Neighbours of a vertex, ascending.
    pub fn around(&self, v: u32) -> Vec<u32> {
        let mut around: Vec<u32> = self.star(v).iter().flat_map(|&t| self.corners(t)).filter(|&x| x != v).collect();
        around.sort_unstable();
        around.dedup();
        around
    }

    /// True for a vertex on no boundary: there are as many triangles around it as neighbours.
    pub fn is_inner(&self, v: u32) -> bool {
        self.around(v).len() == self.star(v).len()
    }

    /// True if a line runs along the edge between two vertices.
    pub fn is_line(&self, v: u32, w: u32) -> bool {
        self.lines.contains(&lesser_first(v, w))
    }

    /// True if an edge joins two vertices.
    pub fn joined(&self, v: u32, w: u32) -> bool {
        self.star(v).iter().any(|&t| self.corners(t).contains(&w))
    }

    /// The triangle on the other side of the edge between `a` and `b` of `t`; `None` at the boundary.
    pub fn beyond(&self, t: u32, [a, b]: [u32; 2]) -> Option<u32> {
        let mut others = self.star(a).iter().copied().filter(|&s| s != t && self.corners(s).contains(&b));
        let other = others.next()?;
        others.next().is_none().then_some(other)
    }

    /// True if the surface stays a manifold when neighbours `v` and `w` become one: only the corners over their edge are
    /// neighbours of both, the edge does not join two boundaries, and more than a lone triangle or tetrahedron is left.
    pub fn is_collapsible(&self, v: u32, w: u32) -> bool {
        let (own, other) = (self.around(v), self.around(w));
        let shared = own.iter().filter(|x| other.binary_search(x).is_ok()).count();
        let beside = self.star(v).iter().filter(|&&t| self.corners(t).contains(&w)).count();
        let is_bridge = beside == 2 && !self.is_inner(v) && !self.is_inner(w);
        shared == beside && (1..=2).contains(&beside) && !is_bridge && own.len() + other.len() >= 2 * shared + 3
    }

    /// Lets `v` become its neighbour `w`; lines at `v` lead to `w`.
    pub fn collapse(&mut self, v: u32, w: u32) -> Change {
        let star = self.stars[v as usize].clone();
        let mut change = self.before(&star);
        for t in star {
            let corners = self.corners(t);
            if corners.contains(&w) {
                corners.iter().for_each(|&x| self.stars[x as usize].retain(|&s| s != t));
                self.triangles[t as usize] = None;
            } else {
                self.triangles[t as usize] = Some(corners.map(|x| if x == v { w } else { x }));
                self.stars[w as usize].push(t);
            }
        }
        self.stars[v as usize].clear();
        let on_lines: Vec<u32> = change.stars.iter().map(|s| s.0).filter(|&x| x != v && self.is_line(v, x)).collect();
        for x in on_lines {
            self.lines.remove(&lesser_first(v, x));
            change.removed.push(lesser_first(v, x));
            if x != w && self.lines.insert(lesser_first(w, x)) {
                change.added.push(lesser_first(w, x));
            }
        }
        change
    }

    /// The flip of edge `k` of triangle `t`, if it has another side, no line runs along it, and no edge would come to join
    /// vertices a second time.
    pub fn flip_of(&self, t: u32, k: usize) -> Option<Flip> {
        let corners = self.get(t)?;
        let [a, b, c] = [0, 1, 2].map(|i| corners[(k + i) % 3]);
        let other = self.beyond(t, [a, b])?;
        let d = self.corners(other).into_iter().find(|&x| x != a && x != b)?;
        let is_free = c != d && !self.is_line(a, b) && !self.joined(c, d);
        is_free.then_some(Flip { triangles: [t, other], corners: [[a, d, c], [d, b, c]], edge: [a, b], tips: [c, d] })
    }

    /// Flips an edge.
    pub fn flip(&mut self, flip: &Flip) -> Change {
        let change = self.before(&flip.triangles);
        let ([t, other], [a, b], [c, d]) = (flip.triangles, flip.edge, flip.tips);
        self.triangles[t as usize] = Some(flip.corners[0]);
        self.triangles[other as usize] = Some(flip.corners[1]);
        self.stars[a as usize].retain(|&s| s != other);
        self.stars[b as usize].retain(|&s| s != t);
        self.stars[c as usize].push(other);
        self.stars[d as usize].push(t);
        change
    }

    /// Leads the line along edge `k` of triangle `t` by way of the tip over it, and flips the edge; `None` if that would join
    /// vertices a second time.
    pub fn part_line(&mut self, t: u32, k: usize) -> Option<Change> {
        let corners = self.get(t)?;
        let [a, b, c] = [0, 1, 2].map(|i| corners[(k + i) % 3]);
        let was_line = self.lines.remove(&lesser_first(a, b));
        let Some(flip) = self.flip_of(t, k).filter(|_| was_line) else {
            self.lines.extend(was_line.then(|| lesser_first(a, b)));
            return None;
        };
        let mut change = self.flip(&flip);
        change.removed.push(lesser_first(a, b));
        for edge in [lesser_first(a, c), lesser_first(b, c)] {
            if self.lines.insert(edge) {
                change.added.push(edge);
            }
        }
        Some(change)
    }

    /// Splits edge `k` of triangle `t` by a new vertex, whose index is the result: one more than the greatest so far. The
    /// halves with the starts of the edge's half-edges keep the names of the triangles.
    pub fn split(&mut self, t: u32, k: usize) -> (u32, Change) {
        let middle = self.stars.len() as u32;
        self.stars.push(Vec::new());
        let corners = self.corners(t);
        let [a, b] = [0, 1].map(|i| corners[(k + i) % 3]);
        let both: Vec<u32> = std::iter::once(t).chain(self.beyond(t, [a, b])).collect();
        let mut change = self.before(&both);
        change.stars.push((middle, Vec::new()));
        for (s, [from, to]) in both.into_iter().zip([[a, b], [b, a]]) {
            let tip = self.corners(s).into_iter().find(|&x| x != a && x != b).unwrap_or_default();
            let fresh = self.len();
            change.triangles.push((fresh, None));
            self.triangles[s as usize] = Some([from, middle, tip]);
            self.triangles.push(Some([middle, to, tip]));
            self.stars[to as usize].retain(|&x| x != s);
            self.stars[to as usize].push(fresh);
            self.stars[tip as usize].push(fresh);
            self.stars[middle as usize].extend([s, fresh]);
        }
        if self.lines.remove(&lesser_first(a, b)) {
            change.removed.push(lesser_first(a, b));
            change.added = vec![[a, middle], [b, middle]];
            self.lines.extend(&change.added);
        }
        (middle, change)
    }

    /// Takes a triangle out.
    pub fn drop(&mut self, t: u32) -> Change {
        let change = self.before(&[t]);
        self.corners(t).iter().for_each(|&v| self.stars[v as usize].retain(|&s| s != t));
        self.triangles[t as usize] = None;
        change
    }

    /// Takes back a change. Of changes that touch each other the last one goes first.
    pub fn undo(&mut self, change: Change) {
        change.triangles.into_iter().for_each(|(t, was)| self.triangles[t as usize] = was);
        change.stars.into_iter().for_each(|(v, was)| self.stars[v as usize] = was);
        change.added.iter().for_each(|edge| {
            self.lines.remove(edge);
        });
        self.lines.extend(change.removed);
    }

    /// What is there before these triangles change.
    fn before(&self, triangles: &[u32]) -> Change {
        let vertices: BTreeSet<u32> = triangles.iter().flat_map(|&t| self.corners(t)).collect();
        Change {
            triangles: triangles.iter().map(|&t| (t, self.triangles[t as usize])).collect(),
            stars: vertices.into_iter().map(|v| (v, self.stars[v as usize].clone())).collect(),
            removed: Vec::new(),
            added: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{TriMesh, diagnose};
    use crate::synthetic::shapes;

    fn state(c: &Changing) -> (Vec<Option<[u32; 3]>>, BTreeSet<[u32; 2]>) {
        (c.triangles.clone(), c.lines.clone())
    }

    /// Checks that stars and triangles agree.
    fn agree(c: &Changing) {
        for v in 0..c.stars.len() as u32 {
            let mut star = c.star(v).to_vec();
            star.sort_unstable();
            let own: Vec<u32> = (0..c.len()).filter(|&t| c.get(t).is_some_and(|x| x.contains(&v))).collect();
            assert_eq!(star, own, "around {v}");
        }
    }

    #[test]
    fn sixty_changes_of_a_ball_leave_a_sphere_and_taken_back_leave_the_ball() {
        let ball = shapes::sphere(1.0, 2);
        let line: Vec<[u32; 2]> = ball.triangles[..20].iter().map(|t| lesser_first(t[0], t[1])).collect();
        let mut c = Changing::new(&ball.triangles, ball.points.len(), &line);
        let mut points = ball.points.clone();
        let mut done = Vec::new();
        for i in 0..60u32 {
            let was = state(&c);
            let t = (0..c.len()).map(|k| (k + 37 * i) % c.len()).find(|&t| c.get(t).is_some()).unwrap();
            let [a, b, _] = c.corners(t);
            let change = match i % 3 {
                0 => {
                    let (m, change) = c.split(t, 0);
                    assert_eq!(m as usize, points.len());
                    points.push(points[a as usize].midpoint(points[b as usize]));
                    Some(change)
                }
                1 => c.flip_of(t, 1).map(|flip| c.flip(&flip)),
                _ => c.is_collapsible(a, b).then(|| c.collapse(a, b)),
            };
            if let Some(change) = change {
                agree(&c);
                done.push((was, change));
            }
        }
        assert!(done.len() > 40, "{}", done.len());
        let now = diagnose(&TriMesh::new(points, c.triangles.iter().flatten().copied().collect()));
        assert!(now.manifold && now.boundary_loops == 0 && now.components == 1 && now.genus == Some(0), "{now:?}");
        while let Some((was, change)) = done.pop() {
            c.undo(change);
            assert_eq!((&was.0[..], was.1), (&c.triangles[..was.0.len()], c.lines.clone()));
            agree(&c);
        }
    }

    #[test]
    fn an_edge_between_two_boundaries_and_one_of_a_tetrahedron_cannot_be_collapsed() {
        // A strip of two cells: the edge across its middle joins both long sides.
        let strip = shapes::rectangle(2.0, 1.0, 2, 1);
        let c = Changing::new(&strip.triangles, strip.points.len(), &[]);
        let across = (0..6u32)
            .flat_map(|v| c.around(v).into_iter().map(move |w| [v, w]))
            .find(|&[v, w]| c.star(v).iter().filter(|&&t| c.corners(t).contains(&w)).count() == 2);
        let [v, w] = across.unwrap();
        assert!(!c.is_inner(v) && !c.is_inner(w) && !c.is_collapsible(v, w));
        let tetrahedron = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        assert!(!Changing::new(&tetrahedron, 4, &[]).is_collapsible(0, 1));
        // Its edges cannot be flipped: the tips are joined already.
        assert!((0..12).all(|h| Changing::new(&tetrahedron, 4, &[]).flip_of(h / 3, h as usize % 3).is_none()));
    }
}
