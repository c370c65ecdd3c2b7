//! The collapsing itself, on half-edges.
//!
//! Garland and Heckbert 1997; Lindstrom and Turk 1998; `docs/methods/contour.md`, "Decimation".

use super::DecimateError;
use super::queue::{Entry, Queue};
use crate::mesh::{Adjacency, Attribute, FeatureKind, FeatureTags, NONE, TriMesh, next, previous};
use crate::observe::Observer;
use glam::{DMat3, DVec3};

/// A sum of squared distances from planes, by area, relative to the middle of the mesh.
#[derive(Clone, Copy, Default)]
struct Quadric {
    a: [f64; 6],
    b: DVec3,
    c: f64,
    weight: f64,
}

impl Quadric {
    fn plane(n: DVec3, p: DVec3, weight: f64) -> Quadric {
        let d = -n.dot(p);
        let w = n * weight;
        Quadric {
            a: [w.x * n.x, w.x * n.y, w.x * n.z, w.y * n.y, w.y * n.z, w.z * n.z],
            b: w * d,
            c: weight * d * d,
            weight,
        }
    }

    fn add(&mut self, o: &Quadric) {
        for k in 0..6 {
            self.a[k] += o.a[k];
        }
        self.b += o.b;
        self.c += o.c;
        self.weight += o.weight;
    }

    fn plus(mut self, o: &Quadric) -> Quadric {
        self.add(o);
        self
    }

    fn times(&self, p: DVec3) -> DVec3 {
        let a = &self.a;
        DVec3::new(
            a[0] * p.x + a[1] * p.y + a[2] * p.z,
            a[1] * p.x + a[3] * p.y + a[4] * p.z,
            a[2] * p.x + a[4] * p.y + a[5] * p.z,
        )
    }

    fn at(&self, p: DVec3) -> f64 {
        (p.dot(self.times(p)) + 2.0 * self.b.dot(p) + self.c).max(0.0)
    }

    /// The best place, drawn to `near` where the planes leave it free.
    fn best(&self, near: DVec3) -> DVec3 {
        let a = &self.a;
        let pull = PULL * (a[0] + a[3] + a[5]);
        let m = DMat3::from_cols(
            DVec3::new(a[0] + pull, a[1], a[2]),
            DVec3::new(a[1], a[3] + pull, a[4]),
            DVec3::new(a[2], a[4], a[5] + pull),
        );
        let x = near - m.inverse() * (self.times(near) + self.b);
        if x.is_finite() { x } else { near }
    }
}

/// Pull towards the edge, relative to the quadric: keeps places on flat and straight parts evenly spread.
const PULL: f64 = 1e-4;
/// Weight of the planes that hold a sharp line in place, relative to those of the surface.
const LINE_WEIGHT: f64 = 4.0;
/// A triangle may turn so far (cosine), and its height shrink to this share of its longest edge.
const FACE_TURN_COSINE: f64 = 0.2;
const SLIVER: f64 = 0.001;
/// The normal of a triangle whose height is below this share of its longest edge tells nothing.
const THIN_TRIANGLE: f64 = 0.1;
/// Collapses between two looks at the observer.
const LOOK: usize = 1 << 12;

/// State of a mesh that is being decimated.
pub struct Collapse<'a> {
    mesh: &'a TriMesh,
    center: DVec3,
    points: Vec<DVec3>,
    attributes: Vec<Attribute>,
    triangles: Vec<[u32; 3]>,
    alive: Vec<bool>,
    count: usize,
    opposite: Vec<u32>,
    outgoing: Vec<u32>,
    /// For each half-edge whether it is a feature (or on the boundary).
    feature: Vec<bool>,
    kind: Vec<Kind>,
    /// For each vertex the planes of what is around it now.
    quadrics: Vec<Quadric>,
    /// For each half-edge the last collapse that moved an end of it, counted from one; [`NONE`] where it is gone.
    stamp: Vec<u32>,
    /// For each vertex whether it ever moved.
    moved: Vec<bool>,
    changes: u32,
    tolerances: Vec<f64>,
    queue: Queue,
    /// All collapses, in their order.
    log: Vec<Step>,
    /// Neighbours of the ends of an edge.
    rings: [Vec<u32>; 2],
    spokes: Vec<u32>,
}

/// A collapse: the half-edge whose start is merged into its end, and where.
#[derive(Clone, Copy)]
pub struct Step {
    half_edge: u32,
    p: DVec3,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Free,
    Line,
    Fixed,
}

impl<'a> Collapse<'a> {
    /// Prepares a mesh.
    /// * `locked` - these vertices stay
    /// * `tolerances` - for each vertex the mean distance that it may be off the planes around it
    /// * `before` - what was done once is done again as far as it can be
    pub fn new(
        mesh: &'a TriMesh,
        tags: &FeatureTags,
        locked: &[bool],
        tolerances: Vec<f64>,
        before: &[Step],
    ) -> Result<Collapse<'a>, DecimateError> {
        let adjacency = Adjacency::new(mesh);
        let unsound = unsound_edges(mesh, &adjacency);
        if unsound > 0 {
            return Err(DecimateError::NotManifold { edges: unsound });
        }
        let center = mesh.bounds().center();
        let points: Vec<DVec3> = mesh.points.iter().map(|p| *p - center).collect();
        let half_edges = adjacency.opposite.len();
        let mut feature = vec![false; half_edges];
        let mut lines = vec![0u32; points.len()];
        let mut around = vec![0u32; points.len()];
        for h in 0..half_edges as u32 {
            let (a, b) = (mesh.origin(h), mesh.origin(next(h)));
            around[a as usize] += 1;
            let open = adjacency.opposite[h as usize] == NONE;
            if open || tags.edges.binary_search(&[a.min(b), a.max(b)]).is_ok() {
                feature[h as usize] = true;
                if open || a < b {
                    lines[a as usize] += 1;
                    lines[b as usize] += 1;
                }
            }
        }
        let kind = (0..points.len())
            .map(|v| match (lines[v], tags.vertices[v]) {
                _ if locked[v] => Kind::Fixed,
                // Two fans that touch in a vertex would come apart.
                _ if adjacency.fan(v as u32).count() as u32 != around[v] => Kind::Fixed,
                (_, FeatureKind::Corner) => Kind::Fixed,
                (0, FeatureKind::None) => Kind::Free,
                (2, _) => Kind::Line,
                _ => Kind::Fixed,
            })
            .collect();
        let mut collapse = Collapse {
            mesh,
            center,
            attributes: mesh.attributes.clone(),
            triangles: mesh.triangles.clone(),
            alive: vec![true; mesh.triangles.len()],
            count: mesh.triangles.len(),
            opposite: adjacency.opposite,
            outgoing: adjacency.outgoing,
            feature,
            kind,
            quadrics: vec![Quadric::default(); points.len()],
            stamp: vec![0; half_edges],
            moved: vec![false; points.len()],
            changes: 0,
            tolerances,
            queue: Queue::new(0.0),
            log: Vec::new(),
            rings: Default::default(),
            spokes: Vec::new(),
            points,
        };
        (0..collapse.triangles.len() as u32).for_each(|t| collapse.account(t, 1.0));
        collapse.replay(before);
        collapse.queue();
        Ok(collapse)
    }

    /// Does what an earlier round did, but for vertices that are fixed now, what goes too far for tolerances that were
    /// tightened since, and what would have come of them.
    fn replay(&mut self, before: &[Step]) {
        let mut other = vec![false; self.points.len()];
        for step in before {
            let h = step.half_edge;
            if !self.alive[h as usize / 3] {
                continue;
            }
            let (a, b) = self.ends(h);
            let changed = other[a as usize] || other[b as usize];
            let fixed = self.kind[a as usize] == Kind::Fixed && self.points[a as usize] != step.p
                || self.kind[b as usize] == Kind::Fixed && self.points[b as usize] != step.p;
            if changed || fixed || !self.is_within(a, b, self.sum(a, b).at(step.p)) || !self.allowed(h, step.p) {
                (other[a as usize], other[b as usize]) = (true, true);
            } else {
                self.collapse(h, step.p);
                self.log.push(*step);
            }
        }
    }

    /// Adds what triangle `t` holds in place to its corners, or takes it away: its plane, and planes upright on it
    /// through its lines.
    /// * `share` - 1 or -1
    fn account(&mut self, t: u32, share: f64) {
        let corners = self.triangles[t as usize];
        let p = corners.map(|v| self.points[v as usize]);
        let n = (p[1] - p[0]).cross(p[2] - p[0]);
        let area = n.length();
        if area == 0.0 {
            return;
        }
        let plane = Quadric::plane(n / area, p[0], share * area / 6.0);
        corners.iter().for_each(|&v| self.quadrics[v as usize].add(&plane));
        for k in (0..3).filter(|&k| self.feature[3 * t as usize + k]) {
            let end = (k + 1) % 3;
            let d = p[end] - p[k];
            let upright = n.cross(d).normalize_or_zero();
            let plane = Quadric::plane(upright, p[k], share * LINE_WEIGHT * d.length_squared() / 6.0);
            let plane = Quadric { weight: 0.0, ..plane };
            [k, end].into_iter().for_each(|k| self.quadrics[corners[k] as usize].add(&plane));
        }
    }

    /// Puts all edges into the queue.
    fn queue(&mut self) {
        let edge = |&h: &u32| {
            let g = self.opposite[h as usize];
            self.alive[h as usize / 3] && (g == NONE || h < g)
        };
        let half_edges = self.opposite.len() as u32;
        let all: Vec<(f64, Entry)> = (0..half_edges).filter(edge).filter_map(|h| self.entry(h)).collect();
        // No quadric is ever worse than all planes together, seen from the farthest place.
        let greatest = all.iter().map(|e| e.0).fold(0.0, f64::max) * all.len() as f64;
        self.queue = Queue::new(greatest);
        all.into_iter().for_each(|(cost, entry)| self.queue.push(cost, entry));
    }

    /// Collapses until `count` triangles are left or all that could follow are farther than tolerated.
    pub fn run(&mut self, count: usize, observer: &dyn Observer) -> Result<(), DecimateError> {
        let start = self.count;
        let mut steps = 0;
        let mut before = self.count;
        while self.count > count {
            let Some(Entry { half_edge: h, stamp }) = self.queue.pop() else {
                // What was not allowed once may be now.
                if self.count == before {
                    break;
                }
                before = self.count;
                self.queue();
                continue;
            };
            if self.stamp[h as usize] != stamp {
                continue;
            }
            let (a, b) = self.ends(h);
            let Some((p, cost)) = self.place(h) else { continue };
            // The ends are as they were, but what lies around them is not.
            if self.queue.passed(cost) {
                self.queue_edge(h);
                continue;
            }
            if self.is_within(a, b, cost) && self.allowed(h, p) {
                self.collapse(h, p);
                self.log.push(Step { half_edge: h, p });
                self.queue_around(b);
            }
            steps += 1;
            if steps % LOOK == 0 {
                observer.check()?;
                observer.progress((start - self.count) as f64 / (start - count.min(start - 1)) as f64);
            }
        }
        Ok(())
    }

    /// The collapses so far.
    pub fn take_log(&mut self) -> Vec<Step> {
        std::mem::take(&mut self.log)
    }

    /// The mesh, its tags, and for each vertex the one of the input that it comes from.
    pub fn finish(self) -> (TriMesh, FeatureTags, Vec<u32>) {
        let mut name = vec![u32::MAX; self.points.len()];
        let mut source = Vec::new();
        let mut triangles = Vec::with_capacity(self.count);
        for (_, triangle) in self.triangles.iter().enumerate().filter(|(t, _)| self.alive[*t]) {
            triangles.push(triangle.map(|v| {
                if name[v as usize] == u32::MAX {
                    name[v as usize] = source.len() as u32;
                    source.push(v);
                }
                name[v as usize]
            }));
        }
        let points = source
            .iter()
            .map(|&v| {
                // Vertices that never moved keep their bits.
                if self.moved[v as usize] {
                    self.points[v as usize] + self.center
                } else {
                    self.mesh.points[v as usize]
                }
            })
            .collect();
        let mut edges = Vec::new();
        for h in (0..self.feature.len() as u32).filter(|&h| self.alive[h as usize / 3] && self.feature[h as usize]) {
            if self.opposite[h as usize] != NONE {
                let (a, b) = self.ends(h);
                edges.push([name[a as usize], name[b as usize]]);
            }
        }
        let tags = FeatureTags::from_edges(source.len(), edges);
        let mut mesh = TriMesh::new(points, triangles);
        mesh.attributes =
            self.attributes.iter().filter(|a| a.name != crate::mesh::FEATURE).map(|a| a.picked(&source)).collect();
        (mesh, tags, source)
    }

    fn ends(&self, h: u32) -> (u32, u32) {
        (self.from(h), self.from(next(h)))
    }

    fn from(&self, h: u32) -> u32 {
        self.triangles[h as usize / 3][h as usize % 3]
    }

    /// The entry of an edge in the queue.
    fn entry(&self, h: u32) -> Option<(f64, Entry)> {
        let (_, cost) = self.place(h)?;
        Some((cost, Entry { half_edge: h, stamp: self.stamp[h as usize] }))
    }

    /// Where the two ends of an edge would meet, and the error there; `None` if they must not.
    fn place(&self, h: u32) -> Option<(DVec3, f64)> {
        let (a, b) = self.ends(h);
        let (ka, kb) = (self.kind[a as usize], self.kind[b as usize]);
        let (pa, pb) = (self.points[a as usize], self.points[b as usize]);
        let q = self.sum(a, b);
        let line = self.feature[h as usize];
        let p = match (ka, kb) {
            (Kind::Fixed, Kind::Fixed) => return None,
            (Kind::Free, Kind::Free) => {
                let middle = (pa + pb) / 2.0;
                let p = q.best(middle);
                // Nearly parallel planes meet far away.
                if p.distance_squared(middle) > 4.0 * pa.distance_squared(pb) { middle } else { p }
            }
            (Kind::Free, _) => pb,
            (_, Kind::Free) => pa,
            _ if !line => return None,
            (Kind::Fixed, _) => pa,
            (_, Kind::Fixed) => pb,
            (Kind::Line, Kind::Line) => {
                // On the edge itself.
                let d = pb - pa;
                let slope = d.dot(q.times(pa) + q.b);
                let bend = d.dot(q.times(d));
                let s = if bend > 0.0 { (-slope / bend).clamp(0.0, 1.0) } else { 0.5 };
                pa + d * s
            }
        };
        Some((p, q.at(p)))
    }

    /// What is around both of two vertices.
    fn sum(&self, a: u32, b: u32) -> Quadric {
        self.quadrics[a as usize].plus(&self.quadrics[b as usize])
    }

    /// True if two vertices tolerate the error of their merging.
    fn is_within(&self, a: u32, b: u32, cost: f64) -> bool {
        let tolerance = self.tolerances[a as usize].min(self.tolerances[b as usize]);
        let weight = self.quadrics[a as usize].weight + self.quadrics[b as usize].weight;
        // Without a tolerance and without area there is no number to compare with.
        let is_beyond = cost > tolerance * tolerance * weight;
        !is_beyond
    }

    /// Half-edges that leave `v`.
    fn fan(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        let first = self.outgoing[v as usize];
        let mut h = first;
        std::iter::from_fn(move || {
            if h == NONE {
                return None;
            }
            let here = h;
            let turned = self.opposite[previous(h) as usize];
            h = if turned == first { NONE } else { turned };
            Some(here)
        })
    }

    /// Neighbours of `v`.
    fn neighbours(&self, v: u32, out: &mut Vec<u32>) {
        out.clear();
        for h in self.fan(v) {
            out.push(self.from(next(h)));
            if self.opposite[previous(h) as usize] == NONE {
                out.push(self.from(previous(h)));
            }
        }
    }

    fn allowed(&mut self, h: u32, p: DVec3) -> bool {
        let mut rings = std::mem::take(&mut self.rings);
        let allowed = self.allows(h, p, &mut rings);
        self.rings = rings;
        allowed
    }

    fn allows(&self, h: u32, p: DVec3, [na, nb]: &mut [Vec<u32>; 2]) -> bool {
        let (a, b) = self.ends(h);
        let g = self.opposite[h as usize];
        let sides = [Some(h), (g != NONE).then_some(g)];
        let on_rim = |v: u32| {
            self.fan(v).any(|h| self.opposite[h as usize] == NONE || self.opposite[previous(h) as usize] == NONE)
        };
        // Two places of the boundary that are joined across the mesh must stay apart.
        if g != NONE && on_rim(a) && on_rim(b) {
            return false;
        }
        // Common neighbours are the two apices and no others.
        self.neighbours(a, na);
        self.neighbours(b, nb);
        if na.iter().filter(|v| nb.contains(v)).count() != sides.iter().flatten().count() {
            return false;
        }
        // A tetrahedron has nothing to lose.
        if g != NONE && na.len() == 3 && nb.len() == 3 {
            return false;
        }
        for side in sides.into_iter().flatten() {
            let (x, y) = (next(side), previous(side));
            // Two sharp lines, or two boundaries, would fall together.
            if self.feature[x as usize] && self.feature[y as usize] {
                return false;
            }
            if self.opposite[x as usize] == NONE && self.opposite[y as usize] == NONE {
                return false;
            }
        }
        let mut around = DVec3::ZERO;
        for h in self.fan(a).chain(self.fan(b)) {
            let [x, y, z] = self.triangles[h as usize / 3].map(|v| self.points[v as usize]);
            around += (y - x).cross(z - x);
        }
        for (v, other) in [(a, b), (b, a)] {
            for h in self.fan(v) {
                let (x, y) = (self.from(next(h)), self.from(previous(h)));
                if x == other || y == other {
                    continue;
                }
                let (px, py) = (self.points[x as usize], self.points[y as usize]);
                let pv = self.points[v as usize];
                let (old, new) = ((px - pv).cross(py - pv), (px - p).cross(py - p));
                let (lo, ln) = (old.length(), new.length());
                let longest = (px - p).length_squared().max((py - p).length_squared()).max((px - py).length_squared());
                let before = (px - pv).length_squared().max((py - pv).length_squared()).max((px - py).length_squared());
                // The normal of a sliver tells nothing; what is around does.
                let (facing, length) = if lo < THIN_TRIANGLE * before { (around, around.length()) } else { (old, lo) };
                if facing.dot(new) < FACE_TURN_COSINE * length * ln || ln == 0.0 {
                    return false;
                }
                // Slivers may stay, but not arise.
                if ln < SLIVER * longest && ln / longest < lo / before {
                    return false;
                }
            }
        }
        true
    }

    /// Merges the start of `h` into its end, at `p`.
    fn collapse(&mut self, h: u32, p: DVec3) {
        let (a, b) = self.ends(h);
        let (pa, pb) = (self.points[a as usize], self.points[b as usize]);
        let d = pb - pa;
        let s = ((p - pa).dot(d) / d.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0) as f32;
        for attribute in &mut self.attributes {
            for k in 0..attribute.width {
                let (x, y) = (a as usize * attribute.width + k, b as usize * attribute.width + k);
                attribute.values[y] = attribute.values[x] * (1.0 - s) + attribute.values[y] * s;
            }
        }
        if self.kind[a as usize] == Kind::Fixed || self.kind[b as usize] == Kind::Free {
            self.kind[b as usize] = self.kind[a as usize];
        }
        let g = self.opposite[h as usize];
        let mut spokes = std::mem::take(&mut self.spokes);
        spokes.clear();
        spokes.extend(self.fan(b).filter(|f| ![h, g].iter().any(|side| *side != NONE && side / 3 == f / 3)));
        let own = spokes.len();
        spokes.extend(self.fan(a));
        spokes.iter().for_each(|&f| self.account(f / 3, -1.0));
        self.points[b as usize] = p;
        self.tolerances[b as usize] = self.tolerances[a as usize].min(self.tolerances[b as usize]);
        for &f in &spokes[own..] {
            self.triangles[f as usize / 3][f as usize % 3] = b;
        }
        let mut rest = NONE;
        for side in [h, g] {
            if side == NONE {
                continue;
            }
            let (x, y) = (next(side), previous(side));
            let (ox, oy) = (self.opposite[x as usize], self.opposite[y as usize]);
            let feature = self.feature[x as usize] || self.feature[y as usize];
            let apex = self.from(y);
            if ox != NONE {
                self.opposite[ox as usize] = oy;
                self.feature[ox as usize] = feature || oy == NONE;
            }
            if oy != NONE {
                self.opposite[oy as usize] = ox;
                self.feature[oy as usize] = feature || ox == NONE;
            }
            self.alive[side as usize / 3] = false;
            [side, x, y].iter().for_each(|&h| self.stamp[h as usize] = NONE);
            self.count -= 1;
            // A half-edge of a living triangle that leaves the apex, and one that leaves b.
            let (leaves_apex, leaves_b) = if ox != NONE { (ox, next(ox)) } else { (next(oy), oy) };
            let pick = |one: u32, v: u32, this: &Self| if this.from(one) == v { one } else { this.leaving(one, v) };
            self.outgoing[apex as usize] = self.settled(pick(leaves_apex, apex, self));
            rest = pick(leaves_b, b, self);
        }
        self.outgoing[b as usize] = self.settled(rest);
        self.changes += 1;
        self.moved[b as usize] = true;
        self.outgoing[a as usize] = NONE;
        spokes.clear();
        spokes.extend(self.fan(b));
        for &f in &spokes {
            self.account(f / 3, 1.0);
            let g = self.opposite[f as usize];
            self.stamp[f as usize] = self.changes;
            self.stamp[if g == NONE { f } else { g } as usize] = self.changes;
            // The other edge at `b`, which has no other triangle at the boundary.
            self.stamp[previous(f) as usize] = self.changes;
        }
        self.spokes = spokes;
    }

    /// Puts all edges at `v` into the queue.
    fn queue_around(&mut self, v: u32) {
        let mut spokes = std::mem::take(&mut self.spokes);
        spokes.clear();
        spokes.extend(self.fan(v));
        for &f in &spokes {
            let edges = [Some(f), (self.opposite[previous(f) as usize] == NONE).then(|| previous(f))];
            edges.into_iter().flatten().for_each(|e| self.queue_edge(e));
        }
        self.spokes = spokes;
    }

    fn queue_edge(&mut self, h: u32) {
        if let Some((cost, entry)) = self.entry(h) {
            self.queue.push(cost, entry);
        }
    }

    /// The half-edge of the triangle of `h` that leaves `v`.
    fn leaving(&self, h: u32, v: u32) -> u32 {
        let first = h - h % 3;
        (first..first + 3).find(|&h| self.from(h) == v).unwrap_or(h)
    }

    /// Turns back around the start of `h` to the boundary, so that a fan sees all triangles.
    fn settled(&self, h: u32) -> u32 {
        let mut at = h;
        loop {
            let g = self.opposite[at as usize];
            if g == NONE {
                return at;
            }
            at = next(g);
            if at == h {
                return h;
            }
        }
    }
}

/// Edges with more than two triangles, or two that run the same way: adjacency takes them for boundaries.
fn unsound_edges(mesh: &TriMesh, adjacency: &Adjacency) -> usize {
    let mut open: Vec<[u32; 2]> = (0..adjacency.opposite.len() as u32)
        .filter(|&h| adjacency.opposite[h as usize] == NONE)
        .map(|h| {
            let (a, b) = (mesh.origin(h), mesh.origin(next(h)));
            [a.min(b), a.max(b)]
        })
        .collect();
    open.sort_unstable();
    open.chunk_by(|a, b| a == b).filter(|run| run.len() > 1).count()
}
