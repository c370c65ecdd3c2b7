//! Local changes of an extracted mesh: vertices moved, merged and added ([`insert`]), each kept only if the mesh stays embedded.
//!
//! A change is allowed if no triangle that it touches then meets any other triangle in more than they share, by exact
//! signs; so the certificate of the extraction holds after every step. What may be near is known from the cells: a
//! triangle that was never touched lies in its cell.
//!
//! See `docs/methods/contour.md`, step 7.

mod insert;

use crate::field::Directed;
use crate::geom::predicates::Walled;
use crate::mesh::{DEGENERATE_AREA, TriMesh};
use glam::DVec3;

/// A cell with the numbers of its first triangle and of that after the last.
pub type CellRange = ([u32; 3], u32, u32);

/// A triangle that is no more.
pub const GONE: [u32; 3] = [u32::MAX; 3];
/// Name of no star.
const NONE: u32 = u32::MAX;
/// A triangle leans if its normal has a cosine below this with those of all hits among its corners.
const LEANING_COSINE: f64 = 0.5;
/// Changed triangles within so many cells are compared with the same others.
const COMPARED_CELLS: f64 = 5.0;
/// Rounding may put a place into the next cell if it is this near, in cells.
const CELL_SLACK: f64 = 1e-6;
/// A vertex reaches over so many triangles at most.
const MOST_FLIPS: usize = 4;

/// Whether a move may make triangles lean.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Lean {
    /// No more of them than before.
    NoMore,
    /// As many as it takes.
    Any,
}

/// A mesh in the cells of its field, around some vertices.
pub struct Local<'a> {
    /// The mesh. Merged triangles stay as [`GONE`].
    pub mesh: &'a mut TriMesh,
    field: &'a Directed,
    /// Cells along the axes.
    size: [usize; 3],
    /// Cells in the order of z, y, x.
    cells: Vec<CellRange>,
    /// First of `cells` in each row (z, y).
    rows: Vec<u32>,
    /// Number of each vertex's star.
    which: Vec<u32>,
    stars: Vec<Vec<u32>>,
    /// Triangles that may have left their cell, as lists of rows: the last of each row, counted from 1.
    last: Vec<u32>,
    strays: Vec<Stray>,
    /// Boxes of all changes, in their order.
    changes: Vec<[DVec3; 2]>,
    /// Triangles that were looked at in the search of this number.
    seen: Vec<u32>,
    search: u32,
    /// Room for the triangles of a check.
    own: Vec<Placed>,
    least: f64,
}

/// A triangle that may reach into the cells `from..=to` of a row.
struct Stray {
    triangle: u32,
    from: i32,
    to: i32,
    /// The one before in its row, counted from 1.
    before: u32,
}

/// Two triangles whose common edge turns.
struct Flip {
    triangles: [u32; 2],
    /// The edge that they share.
    edge: [u32; 2],
    before: [[u32; 3]; 2],
    after: [[u32; 3]; 2],
}

/// A changed triangle with its box and what parts it from others.
struct Placed {
    names: [u32; 3],
    p: [DVec3; 3],
    low: DVec3,
    high: DVec3,
    walled: Walled,
}

impl Placed {
    /// True if the triangle meets another with this box in more than they share.
    fn meets(&self, p: [DVec3; 3], names: [u32; 3], [low, high]: [DVec3; 2]) -> bool {
        !(low.cmpgt(self.high).any() || high.cmplt(self.low).any()) && self.walled.meets(p, names)
    }
}

impl<'a> Local<'a> {
    /// Makes ready for changes of `seeds` and their neighbours.
    /// * `cells` - all cells with triangles, in the order of z, y, x
    pub fn new(mesh: &'a mut TriMesh, field: &'a Directed, cells: Vec<CellRange>, seeds: &[u32]) -> Local<'a> {
        let mut which = vec![NONE; mesh.points.len()];
        for &v in seeds {
            which[v as usize] = 0;
        }
        // Seeds and their neighbours: a merge hands the star of one to the other.
        let near: Vec<[u32; 3]> =
            mesh.triangles.iter().filter(|t| t.iter().any(|&v| which[v as usize] == 0)).copied().collect();
        let mut count = 0;
        which.fill(NONE);
        for &v in near.iter().flatten() {
            if which[v as usize] == NONE {
                which[v as usize] = count;
                count += 1;
            }
        }
        let mut stars = vec![Vec::new(); count as usize];
        for (t, triangle) in mesh.triangles.iter().enumerate() {
            for &v in triangle {
                if let Some(star) = stars.get_mut(which[v as usize] as usize) {
                    star.push(t as u32);
                }
            }
        }
        let least = 2.0 * DEGENERATE_AREA * mesh.bounds().diagonal().powi(2);
        // Merged cells may reach beyond the lattice.
        let mut size = field.lattice.cells;
        for (c, ..) in &cells {
            size = [0, 1, 2].map(|a| size[a].max(c[a] as usize + 1));
        }
        let [_, ny, nz] = size;
        let mut rows = vec![0; ny * nz + 1];
        for (c, ..) in &cells {
            rows[c[2] as usize * ny + c[1] as usize + 1] += 1;
        }
        for r in 0..ny * nz {
            rows[r + 1] += rows[r];
        }
        let (last, seen) = (vec![0; ny * nz], vec![0; mesh.triangles.len()]);
        let (strays, changes) = (Vec::new(), Vec::new());
        Local {
            mesh,
            field,
            size,
            cells,
            rows,
            which,
            stars,
            last,
            strays,
            changes,
            seen,
            search: 0,
            own: Vec::new(),
            least,
        }
    }

    /// Number of changes so far.
    pub fn changes(&self) -> usize {
        self.changes.len()
    }

    /// True if something changed in the box of `points` and the triangles around the neighbours of `v` after the first
    /// `since` changes.
    pub fn changed(&self, since: usize, v: u32, points: impl Iterator<Item = DVec3>) -> bool {
        if since == self.changes.len() {
            return false;
        }
        let (mut low, mut high) = (self.position(v), self.position(v));
        let mut with = |p: DVec3| (low, high) = (low.min(p), high.max(p));
        points.for_each(&mut with);
        for &t in self.star(v) {
            for &w in self.mesh.triangles[t as usize].iter().filter(|&&w| w != v) {
                self.star(w).iter().flat_map(|&t| self.mesh.corners(t as usize)).for_each(&mut with);
            }
        }
        self.changes[since..].iter().any(|[l, h]| !(l.cmpgt(high).any() || h.cmplt(low).any()))
    }

    /// Triangles around a vertex near the seeds.
    pub fn star(&self, v: u32) -> &[u32] {
        self.stars.get(self.which[v as usize] as usize).map_or(&[], Vec::as_slice)
    }

    /// Neighbours of a vertex near the seeds, ascending.
    pub fn neighbours(&self, v: u32) -> Vec<u32> {
        let mut all: Vec<u32> =
            self.star(v).iter().flat_map(|&t| self.mesh.triangles[t as usize]).filter(|&w| w != v).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Position of a vertex.
    pub fn position(&self, v: u32) -> DVec3 {
        self.mesh.points[v as usize]
    }

    /// Moves vertices together, if the mesh stays embedded and triangles lean as `lean` says; returns whether.
    pub fn shift(&mut self, moves: &[(u32, DVec3)], lean: Lean) -> bool {
        // What is too far from the seeds has no star that could be checked.
        if moves.iter().any(|m| self.star(m.0).is_empty()) {
            return false;
        }
        let mut changed: Vec<u32> = Vec::with_capacity(8 * moves.len());
        moves.iter().for_each(|m| changed.extend(self.star(m.0)));
        if moves.len() > 1 {
            changed.sort_unstable();
            changed.dedup();
        }
        let leaning = self.leaning(&changed);
        let areas: Vec<f64> = changed.iter().map(|&t| self.mesh.area(t as usize)).collect();
        let before: Vec<DVec3> = moves.iter().map(|m| self.position(m.0)).collect();
        for &(v, p) in moves {
            self.mesh.points[v as usize] = p;
        }
        let kept = self.is_wide(&changed, &areas)
            && (lean == Lean::Any || self.leaning(&changed) <= leaning)
            && self.is_embedded(&changed);
        if kept {
            self.stray(&changed, before.into_iter());
        } else {
            for (m, p) in moves.iter().zip(before) {
                self.mesh.points[m.0 as usize] = p;
            }
        }
        kept
    }

    /// Merges `v` into its neighbour `w`, which moves to `at`, if the mesh stays a manifold and embedded and no more
    /// triangles lean than before; returns whether.
    pub fn merge(&mut self, v: u32, w: u32, at: DVec3) -> bool {
        let (of_v, of_w) = (self.star(v).to_vec(), self.star(w).to_vec());
        let (near_v, near_w) = (self.neighbours(v), self.neighbours(w));
        let shared = near_v.iter().filter(|x| near_w.binary_search(x).is_ok()).count();
        let has = |t: &u32, x: u32| self.mesh.triangles[*t as usize].contains(&x);
        let (dying, moving): (Vec<u32>, Vec<u32>) = of_v.iter().partition(|t| has(t, w));
        // The link condition, on closed stars only.
        if dying.len() != 2
            || shared != 2
            || near_v.len() != of_v.len()
            || near_w.len() != of_w.len()
            || moving.is_empty()
        {
            return false;
        }
        let (from, lost) = (self.position(w), self.position(v));
        let all: Vec<u32> = {
            let mut all = [of_v.as_slice(), of_w.as_slice()].concat();
            all.sort_unstable();
            all.dedup();
            all
        };
        let leaning = self.leaning(&all);
        let mut changed = moving.clone();
        if at != from {
            changed.extend(of_w.iter().filter(|t| !dying.contains(t)));
        }
        let areas: Vec<f64> = changed.iter().map(|&t| self.mesh.area(t as usize)).collect();
        let saved: Vec<[u32; 3]> = all.iter().map(|&t| self.mesh.triangles[t as usize]).collect();
        for &t in &dying {
            self.mesh.triangles[t as usize] = GONE;
        }
        for &t in &moving {
            let triangle = &mut self.mesh.triangles[t as usize];
            *triangle = triangle.map(|x| if x == v { w } else { x });
        }
        self.mesh.points[w as usize] = at;
        let kept = self.is_wide(&changed, &areas) && self.leaning(&all) <= leaning && self.is_embedded(&changed);
        if !kept {
            for (&t, saved) in all.iter().zip(saved) {
                self.mesh.triangles[t as usize] = saved;
            }
            self.mesh.points[w as usize] = from;
            return false;
        }
        for x in near_v.into_iter().chain([v]) {
            if let Some(star) = self.stars.get_mut(self.which[x as usize] as usize) {
                star.retain(|t| !dying.contains(t));
            }
        }
        if let Some(star) = self.stars.get_mut(self.which[w as usize] as usize) {
            star.extend(&moving);
        }
        if let Some(star) = self.stars.get_mut(self.which[v as usize] as usize) {
            star.clear();
        }
        self.stray(&changed, [from, lost].into_iter());
        true
    }

    /// True if two vertices are neighbours.
    pub fn are_neighbours(&self, v: u32, w: u32) -> bool {
        self.star(v).iter().any(|&t| self.mesh.triangles[t as usize].contains(&w))
    }

    /// Makes `v` and `w` neighbours by a flip of the edge between them ([K01] fig. 9), if there is one, the mesh stays
    /// embedded and no more triangles lean than before; returns whether.
    pub fn flip_to(&mut self, v: u32, w: u32) -> bool {
        self.flip_if(v, w, true).is_some()
    }

    /// [`Local::shift`] of `v` over triangles that are in its way: a vertex may have to reach over the next ones to
    /// find its place. All or nothing.
    /// * `fixed` - edges that may not be flipped
    pub fn flip_and_shift(&mut self, v: u32, to: DVec3, fixed: impl Fn(u32, u32) -> bool) -> bool {
        self.reach_over(v, to, &fixed) || {
            let beyond = self.beyond(v);
            beyond.into_iter().any(|w| match self.flip_between(v, w) {
                Some(flip) if !fixed(flip.edge[0], flip.edge[1]) => self.flipped_and_shifted(v, to, vec![flip]),
                _ => false,
            })
        }
    }

    /// Makes `v` and `w` neighbours by one flip or two, if the mesh stays embedded and no more triangles lean than
    /// before; returns whether.
    /// * `fixed` - edges that may not be flipped
    pub fn connect(&mut self, v: u32, w: u32, fixed: impl Fn(u32, u32) -> bool) -> bool {
        let at = self.position(v);
        let free = |f: &Flip| !fixed(f.edge[0], f.edge[1]);
        if let Some(flip) = self.flip_between(v, w).filter(free)
            && self.flipped_and_shifted(v, at, vec![flip])
        {
            return true;
        }
        self.beyond(v).into_iter().any(|x| {
            let Some(first) = self.flip_between(v, x).filter(free) else { return false };
            // The second goes over one of the two edges that the first lays open.
            let second = [0, 1].into_iter().find_map(|k| {
                let (s, a) = (first.after[k], first.edge[k]);
                let own = first.triangles[k];
                let shares = |t: &&u32| {
                    let names = self.mesh.triangles[**t as usize];
                    !first.triangles.contains(t) && [a, x, w].iter().all(|n| names.contains(n))
                };
                let t = *self.star(w).iter().find(shares)?;
                // v a x and w x a become v a w and w x v, or with a and x exchanged.
                let i = s.iter().position(|&n| n == v)?;
                let edge = [s[(i + 1) % 3], s[(i + 2) % 3]];
                let before = [s, self.mesh.triangles[t as usize]];
                Some(Flip { triangles: [own, t], edge, before, after: [[v, edge[0], w], [w, edge[1], v]] })
            });
            second.filter(free).is_some_and(|second| self.flipped_and_shifted(v, at, vec![first, second]))
        })
    }

    /// Flips away what is in the way of `v`, one after another.
    fn reach_over(&mut self, v: u32, to: DVec3, fixed: &impl Fn(u32, u32) -> bool) -> bool {
        let from = self.position(v);
        let mut flips: Vec<Flip> = Vec::new();
        let mut star = self.star(v).to_vec();
        let mut clear = false;
        while flips.len() < MOST_FLIPS {
            self.mesh.points[v as usize] = to;
            let bars = self.in_the_way(&star);
            self.mesh.points[v as usize] = from;
            if bars.is_empty() {
                clear = true;
                break;
            }
            let next = bars.iter().find_map(|&t| {
                let own = self.mesh.triangles[t as usize];
                let beside = |s: &&u32| {
                    let shared = |x: &&u32| **x != v && own.contains(x);
                    self.mesh.triangles[**s as usize].iter().filter(shared).count() == 2
                };
                let s = *star.iter().find(beside)?;
                let before = [self.mesh.triangles[s as usize], own];
                let w = *own.iter().find(|x| !before[0].contains(x))?;
                let at = before[0].iter().position(|&x| x == v)?;
                let edge = [before[0][(at + 1) % 3], before[0][(at + 2) % 3]];
                let new = !star.iter().any(|&s| self.mesh.triangles[s as usize].contains(&w));
                let after = [[v, edge[0], w], [w, edge[1], v]];
                (new && !fixed(edge[0], edge[1])).then_some(Flip { triangles: [s, t], edge, before, after })
            });
            let Some(flip) = next else { break };
            self.set(&flip, flip.after);
            star.push(flip.triangles[1]);
            flips.push(flip);
        }
        for flip in flips.iter().rev() {
            self.set(flip, flip.before);
        }
        clear && !flips.is_empty() && self.flipped_and_shifted(v, to, flips)
    }

    /// Flips, one after another, and then a shift of `v`, if all is well in the end.
    fn flipped_and_shifted(&mut self, v: u32, to: DVec3, flips: Vec<Flip>) -> bool {
        let from = self.position(v);
        let mut changed = self.star(v).to_vec();
        changed.extend(flips.iter().map(|f| f.triangles[1]));
        let leaning = self.leaning(&changed);
        let areas: Vec<f64> = changed.iter().map(|&t| self.mesh.area(t as usize)).collect();
        self.mesh.points[v as usize] = to;
        flips.iter().for_each(|f| self.set(f, f.after));
        let kept = self.is_wide(&changed, &areas) && self.leaning(&changed) <= leaning && self.is_embedded(&changed);
        if kept {
            flips.iter().for_each(|f| self.adopt(f));
            self.stray(&changed, [from].into_iter());
        } else {
            self.mesh.points[v as usize] = from;
            flips.iter().rev().for_each(|f| self.set(f, f.before));
        }
        kept
    }

    /// Makes `v` and `w` neighbours by a flip if need be and merges them at the place of `w`. All or nothing.
    pub fn flip_and_merge(&mut self, v: u32, w: u32) -> bool {
        if self.are_neighbours(v, w) {
            return self.merge(v, w, self.position(w));
        }
        let Some([a, b]) = self.flip_if(v, w, false) else { return false };
        let merged = self.merge(v, w, self.position(w));
        if !merged {
            self.flip_if(a, b, false);
        }
        merged
    }

    /// Vertices opposite of `v` over the edges of its star, ascending.
    pub fn beyond(&self, v: u32) -> Vec<u32> {
        let ring = self.neighbours(v);
        let mut beyond: Vec<u32> = ring
            .iter()
            .flat_map(|&a| self.star(a))
            .map(|&t| self.mesh.triangles[t as usize])
            .filter(|t| !t.contains(&v) && t.iter().filter(|x| ring.binary_search(x).is_ok()).count() == 2)
            .flatten()
            .filter(|w| ring.binary_search(w).is_err())
            .collect();
        beyond.sort_unstable();
        beyond.dedup();
        beyond
    }

    /// The flip that makes `v` and `w` neighbours, if there is one.
    fn flip_between(&self, v: u32, w: u32) -> Option<Flip> {
        let shared = |s: &[u32; 3], t: &[u32; 3]| s.iter().filter(|x| t.contains(x)).count() == 2;
        let (s, t) = self.star(v).iter().find_map(|&s| {
            let own = self.mesh.triangles[s as usize];
            let other = self.star(w).iter().find(|&&t| shared(&own, &self.mesh.triangles[t as usize]));
            other.map(|&t| (s, t))
        })?;
        if self.are_neighbours(v, w) {
            return None;
        }
        let before = [self.mesh.triangles[s as usize], self.mesh.triangles[t as usize]];
        // v a b and w b a become v a w and w b v.
        let at = before[0].iter().position(|&x| x == v).unwrap_or(0);
        let edge = [before[0][(at + 1) % 3], before[0][(at + 2) % 3]];
        Some(Flip { triangles: [s, t], edge, before, after: [[v, edge[0], w], [w, edge[1], v]] })
    }

    fn set(&mut self, flip: &Flip, to: [[u32; 3]; 2]) {
        for (t, names) in flip.triangles.into_iter().zip(to) {
            self.mesh.triangles[t as usize] = names;
        }
    }

    /// Stars after a flip.
    fn adopt(&mut self, flip: &Flip) {
        let ([s, t], [a, b], [v, _, w]) = (flip.triangles, flip.edge, flip.after[0]);
        let mut change = |x: u32, lost: Option<u32>, won: Option<u32>| {
            if let Some(star) = self.stars.get_mut(self.which[x as usize] as usize) {
                star.retain(|t| Some(*t) != lost);
                star.extend(won);
            }
        };
        change(v, None, Some(t));
        change(w, None, Some(s));
        change(a, Some(t), None);
        change(b, Some(s), None);
    }

    /// Returns the edge that was flipped.
    fn flip_if(&mut self, v: u32, w: u32, upright: bool) -> Option<[u32; 2]> {
        let flip = self.flip_between(v, w)?;
        let changed = flip.triangles;
        let leaning = self.leaning(&changed);
        let areas = changed.map(|t| self.mesh.area(t as usize));
        self.set(&flip, flip.after);
        let kept = self.is_wide(&changed, &areas)
            && (!upright || self.leaning(&changed) <= leaning)
            && self.is_embedded(&changed);
        if !kept {
            self.set(&flip, flip.before);
            return None;
        }
        self.adopt(&flip);
        self.stray(&changed, std::iter::empty());
        Some(flip.edge)
    }

    /// True if the triangles beside the edge from `v` to `w` turn by more than `cosine`.
    pub fn is_sharp(&self, v: u32, w: u32, cosine: f64) -> bool {
        let beside: Vec<DVec3> = self
            .star(v)
            .iter()
            .filter(|&&t| self.mesh.triangles[t as usize].contains(&w))
            .map(|&t| self.mesh.normal(t as usize))
            .collect();
        beside.len() == 2 && beside[0].dot(beside[1]) < cosine
    }

    /// True if no triangle has too little area, or less than it had if that was too little already.
    fn is_wide(&self, changed: &[u32], before: &[f64]) -> bool {
        changed.iter().zip(before).all(|(&t, &b)| {
            let area = self.mesh.area(t as usize);
            area > self.least || area > b
        })
    }

    /// Triangles that lean away from the normals of all hits among their corners; those that face against them weigh
    /// twice.
    fn leaning(&self, triangles: &[u32]) -> usize {
        triangles
            .iter()
            .map(|&t| {
                let names = self.mesh.triangles[t as usize];
                if names == GONE {
                    return 0;
                }
                let n = self.mesh.area_vector(t as usize);
                let best = names.iter().filter_map(|&v| self.normal(v)).map(|m| m.dot(n)).fold(f64::NAN, f64::max);
                let against = best <= 0.0;
                (against || best * best <= LEANING_COSINE * LEANING_COSINE * n.length_squared()) as usize
                    + against as usize
            })
            .sum()
    }

    /// Triangles around `v` that face against their hits.
    pub fn turned(&self, v: u32) -> usize {
        let against = |t: u32| {
            let n = self.mesh.normal(t as usize);
            let names = self.mesh.triangles[t as usize];
            names.iter().filter_map(|&v| self.normal(v)).map(|m| m.dot(n)).fold(f64::NAN, f64::max) <= 0.0
        };
        self.star(v).iter().filter(|&&t| against(t)).count()
    }

    /// Normal of a hit; none for other vertices.
    pub fn normal(&self, v: u32) -> Option<DVec3> {
        self.field.normal(v)
    }

    /// True if the changed triangles, as they are now, meet nothing and not each other.
    fn is_embedded(&mut self, changed: &[u32]) -> bool {
        let own = self.placed(changed);
        let apart = |n: usize, s: &Placed| own[..n].iter().all(|t| !s.meets(t.p, t.names, [t.low, t.high]));
        let embedded = own.iter().enumerate().all(|(n, s)| apart(n, s)) && {
            // One look at the cells around all of them, unless they reach far.
            let [low, high] = bounds(&own);
            if (high - low).cmple(self.field.lattice.step * COMPARED_CELLS).all() {
                self.is_free(&own, low, high)
            } else {
                own.iter().all(|t| {
                    // What was seen at another triangle has to be seen again.
                    self.search += 1;
                    changed.iter().for_each(|&t| self.seen[t as usize] = self.search);
                    self.is_free(std::slice::from_ref(t), t.low, t.high)
                })
            }
        };
        self.own = own;
        embedded
    }

    /// The changed triangles as they are now; they count as seen in a new search.
    fn placed(&mut self, changed: &[u32]) -> Vec<Placed> {
        self.search += 1;
        let mut own = std::mem::take(&mut self.own);
        own.clear();
        for &t in changed {
            self.seen[t as usize] = self.search;
            let (names, p) = (self.mesh.triangles[t as usize], self.mesh.corners(t as usize));
            let (low, high) = (p[0].min(p[1]).min(p[2]), p[0].max(p[1]).max(p[2]));
            own.push(Placed { names, p, low, high, walled: Walled::new(p, names) });
        }
        own
    }

    fn cell(&self, p: DVec3) -> [i64; 3] {
        let l = &self.field.lattice;
        ((p - l.origin) / l.step).floor().to_array().map(|x| x as i64)
    }

    /// First and last cells of the lattice that a box reaches into; a vertex may lie on the very face of its cell.
    fn reach(&self, low: DVec3, high: DVec3) -> [[i64; 2]; 3] {
        let l = &self.field.lattice;
        let (low, high) = (self.cell(low - l.step * CELL_SLACK), self.cell(high + l.step * CELL_SLACK));
        [0, 1, 2].map(|a| [low[a].max(0), high[a].min(self.size[a] as i64 - 1)])
    }

    /// Notes a change: triangles as they are now, and where their vertices were before.
    fn stray(&mut self, changed: &[u32], before: impl Iterator<Item = DVec3>) {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &t in changed {
            let [a, b, c] = self.mesh.corners(t as usize);
            let (l, h) = (a.min(b).min(c), a.max(b).max(c));
            (low, high) = (low.min(l), high.max(h));
            let [[x0, x1], [y0, y1], [z0, z1]] = self.reach(l, h);
            for z in z0..=z1 {
                for y in y0..=y1 {
                    self.put(z as usize * self.size[1] + y as usize, t, x0 as i32, x1 as i32);
                }
            }
        }
        before.for_each(|p| (low, high) = (low.min(p), high.max(p)));
        self.changes.push([low, high]);
    }

    fn put(&mut self, row: usize, triangle: u32, from: i32, to: i32) {
        let mut at = self.last[row];
        while at != 0 {
            let stray = &mut self.strays[at as usize - 1];
            if stray.triangle == triangle {
                (stray.from, stray.to) = (stray.from.min(from), stray.to.max(to));
                return;
            }
            at = stray.before;
        }
        self.strays.push(Stray { triangle, from, to, before: self.last[row] });
        self.last[row] = self.strays.len() as u32;
    }

    /// True if no triangle that reaches into a box and was not seen in this search meets one of `own`.
    fn is_free(&mut self, own: &[Placed], low: DVec3, high: DVec3) -> bool {
        self.search(own, low, high, |_| true)
    }

    /// Triangles that meet those given.
    fn in_the_way(&mut self, changed: &[u32]) -> Vec<u32> {
        let own = self.placed(changed);
        let [low, high] = bounds(&own);
        let mut found = Vec::new();
        self.search(&own, low, high, |t| {
            found.push(t);
            false
        });
        self.own = own;
        found
    }

    /// Calls `enough` for triangles that reach into a box, were not seen in this search and meet one of `own`; false if
    /// it was enough.
    fn search(&mut self, own: &[Placed], low: DVec3, high: DVec3, mut enough: impl FnMut(u32) -> bool) -> bool {
        let [[x0, x1], [y0, y1], [z0, z1]] = self.reach(low, high);
        for z in z0..=z1 {
            for y in y0..=y1 {
                let row = z as usize * self.size[1] + y as usize;
                let mut at = self.rows[row] as usize;
                let end = self.rows[row + 1] as usize;
                at += self.cells[at..end].partition_point(|(c, ..)| (c[0] as i64) < x0);
                while at < end && self.cells[at].0[0] as i64 <= x1 {
                    let (_, first, last) = self.cells[at];
                    if (first..last).any(|t| self.bars(t, own, low, high) && enough(t)) {
                        return false;
                    }
                    at += 1;
                }
                let mut at = self.last[row];
                while at != 0 {
                    let Stray { triangle, from, to, before } = self.strays[at as usize - 1];
                    let near = from as i64 <= x1 && to as i64 >= x0;
                    if near && self.bars(triangle, own, low, high) && enough(triangle) {
                        return false;
                    }
                    at = before;
                }
            }
        }
        true
    }

    /// True if triangle `t`, not seen before, meets one of `own`, all of which lie in a box.
    fn bars(&mut self, t: u32, own: &[Placed], low: DVec3, high: DVec3) -> bool {
        if std::mem::replace(&mut self.seen[t as usize], self.search) == self.search
            || self.mesh.triangles[t as usize] == GONE
        {
            return false;
        }
        let p = self.mesh.corners(t as usize);
        let other = [p[0].min(p[1]).min(p[2]), p[0].max(p[1]).max(p[2])];
        !(other[0].cmpgt(high).any() || other[1].cmplt(low).any())
            && own.iter().any(|s| s.meets(p, self.mesh.triangles[t as usize], other))
    }
}

/// The box of triangles.
fn bounds(own: &[Placed]) -> [DVec3; 2] {
    let low = own.iter().fold(DVec3::INFINITY, |low, t| low.min(t.low));
    [low, own.iter().fold(DVec3::NEG_INFINITY, |high, t| high.max(t.high))]
}
