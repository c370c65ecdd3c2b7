//! Handles too small to be meant: cut through and closed.
//!
//! Scans merged from many views carry tunnels and bridges of a few triangles (Guskov and Wood 2001, *Topological Noise
//! Removal*). Around each of them a layout would need many tiny patches.
//! 1. balls cover the surface; Euler's number tells whether the piece of surface in a ball holds a whole handle
//! 2. in such a piece shortest paths from one vertex make a tree; a spanning tree of the dual graph takes of the other
//!    edges those that close the longest loops, and the shortest loop of those left over goes around a handle (Erickson
//!    and Whittlesey 2005, *Greedy Optimal Homotopy and Homology Generators*)
//! 3. the surface is cut along it, and both boundaries are filled with the triangles of least area (`lids`)
//! 4. both boundaries then shrink back from each other: the two lids would lie in one place

use crate::geom::Aabb;
use crate::geom::graph::{self, Dense, Reached};
use crate::mesh::intersect::intersections_of;
use crate::mesh::sets::Sets;
use crate::mesh::{Adjacency, NONE, TriMesh, next, previous};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;

/// A handle or a hole with a loop shorter than this share of the diagonal is none: less than a three-hundredth wide.
pub const TINY_LOOP: f64 = 0.01;
/// Balls reach so many such loops: both loops of a tangled handle lie within.
const BALL_LOOPS: f64 = 1.5;
/// Each round cuts loops that are apart; tangles of more handles than this are rare.
const CUTTING_ROUNDS: usize = 24;
/// A loop is found again from a vertex of its own, which makes it shorter, at most so often.
const TIGHTENED: usize = 3;
/// The triangulation is cubic in the number of vertices of a loop.
const MOST_VERTICES: usize = 96;

/// Shares of the way to their neighbours that the vertices of cut loops go, the best one first. Chosen: half the way leaves both
/// sides about an edge apart; the others are for where surfaces are close.
const BACK_SHARES: [f64; 4] = [0.5, 0.25, 0.1, 0.02];

/// Handles that were cut.
#[derive(Default)]
pub(super) struct Handles {
    /// How many.
    pub count: usize,
    /// The vertices of both sides of their loops.
    loops: Vec<u32>,
}

impl Handles {
    /// Takes the two sides of every loop apart: each vertex goes towards its neighbours that are on none, by the largest share
    /// that brings about the fewest crossings.
    /// * `id` - of each vertex that was cut its number in the mesh, or [`NONE`]
    pub fn part(&self, mesh: &mut TriMesh, id: &[u32], observer: &dyn Observer) -> Result<(), Cancelled> {
        let mut on_loop = vec![false; mesh.points.len()];
        let loops: Vec<u32> = self.loops.iter().map(|&v| id[v as usize]).filter(|&v| v != NONE).collect();
        loops.iter().for_each(|&v| on_loop[v as usize] = true);
        let adjacency = Adjacency::new(mesh);
        let step = |&v: &u32| {
            let beside = adjacency.fan(v).flat_map(|h| [mesh.origin(next(h)), mesh.origin(previous(h))]);
            let mut beside: Vec<u32> = beside.filter(|&w| !on_loop[w as usize]).collect();
            beside.sort_unstable();
            beside.dedup();
            let sum: DVec3 = beside.iter().map(|&w| mesh.points[w as usize]).sum();
            if beside.is_empty() { DVec3::ZERO } else { sum / beside.len() as f64 - mesh.points[v as usize] }
        };
        let steps: Vec<DVec3> = loops.iter().map(step).collect();
        let was: Vec<DVec3> = loops.iter().map(|&v| mesh.points[v as usize]).collect();
        let place = |mesh: &mut TriMesh, share: f64| {
            for ((&v, was), step) in loops.iter().zip(&was).zip(&steps) {
                mesh.points[v as usize] = *was + share * *step;
            }
        };
        let mut best = (usize::MAX, 0.0);
        for share in BACK_SHARES {
            place(mesh, share);
            let moved = |t: u32| mesh.triangles[t as usize].iter().any(|&v| on_loop[v as usize]);
            let crossings = intersections_of(mesh, moved, observer)?.len();
            if crossings < best.0 {
                best = (crossings, share);
            }
            if crossings == 0 {
                break;
            }
        }
        place(mesh, best.1);
        Ok(())
    }
}

/// Cuts the handles of an oriented manifold that are shorter around than [`TINY_LOOP`].
pub(super) fn close(
    mesh: &TriMesh,
    triangles: &mut Vec<[u32; 3]>,
    source: &mut Vec<u32>,
    observer: &dyn Observer,
) -> Result<Handles, Cancelled> {
    let size = TINY_LOOP * Aabb::of(&mesh.points).diagonal();
    let mut handles = Handles::default();
    let mut seeds: Option<Vec<u32>> = None;
    for _ in 0..CUTTING_ROUNDS {
        let adjacency = Adjacency::of(triangles, source.len());
        let mut search = Search {
            mesh,
            triangles,
            source,
            adjacency: &adjacency,
            local: vec![NONE; triangles.len()],
            reached: Dense::new(source.len()),
        };
        if seeds.is_none() && search.genus(&(0..triangles.len() as u32).collect::<Vec<_>>()) == 0 {
            break;
        }
        let suspects = search.suspects(seeds.take(), BALL_LOOPS * size);
        let mut busy = vec![false; source.len()];
        let mut loops = Vec::new();
        // Where a loop nearby is cut in this round, or one is found, there may be more. Where there is none that is short,
        // cuts elsewhere make none.
        let mut again = Vec::new();
        for &seed in &suspects {
            observer.check()?;
            if busy[seed as usize] {
                again.push(seed);
                continue;
            }
            let Some(found) = search.tight_loop(seed, BALL_LOOPS * size, size) else { continue };
            again.push(seed);
            // Two loops around one handle would cut a piece off.
            let piece = search.piece(found[0], BALL_LOOPS * size);
            let vertices = || piece.iter().flat_map(|&t| triangles[t as usize]);
            if !vertices().any(|v| busy[v as usize]) {
                vertices().for_each(|v| busy[v as usize] = true);
                loops.extend(cap(&found, &search).map(|cap| (found, cap)));
            }
        }
        for (around, cap) in &loops {
            handles.loops.extend(around.iter().copied().chain((source.len() as u32..).take(around.len())));
            cut(around, cap, triangles, source, &adjacency);
        }
        handles.count += loops.len();
        if loops.is_empty() {
            break;
        }
        seeds = Some(again);
    }
    Ok(handles)
}

/// Pieces of a surface around vertices.
struct Search<'a> {
    mesh: &'a TriMesh,
    triangles: &'a [[u32; 3]],
    source: &'a [u32],
    adjacency: &'a Adjacency,
    /// Place of a triangle in the piece that is looked at.
    local: Vec<u32>,
    /// Distance of a vertex from the root, and the half-edge that led there.
    reached: Dense,
}

impl Search<'_> {
    fn at(&self, v: u32) -> DVec3 {
        self.mesh.points[self.source[v as usize] as usize]
    }

    fn origin(&self, h: u32) -> u32 {
        crate::mesh::soup::origin(self.triangles, h)
    }

    /// The triangles around `seed` that lie within a ball and hang together.
    fn piece(&mut self, seed: u32, radius: f64) -> Vec<u32> {
        let middle = self.at(seed);
        let within = |s: &Self, t: u32| {
            s.triangles[t as usize].iter().all(|&v| s.at(v).distance_squared(middle) < radius * radius)
        };
        let mut piece = Vec::new();
        let first = self.adjacency.outgoing[seed as usize];
        if first != NONE && within(self, first / 3) {
            self.local[first as usize / 3] = 0;
            piece.push(first / 3);
        }
        let mut k = 0;
        while k < piece.len() {
            for h in 3 * piece[k]..3 * piece[k] + 3 {
                let g = self.adjacency.opposite[h as usize];
                if g != NONE && self.local[g as usize / 3] == NONE && within(self, g / 3) {
                    self.local[g as usize / 3] = piece.len() as u32;
                    piece.push(g / 3);
                }
            }
            k += 1;
        }
        piece.iter().for_each(|&t| self.local[t as usize] = NONE);
        piece
    }

    fn enter(&mut self, piece: &[u32]) {
        piece.iter().enumerate().for_each(|(k, &t)| self.local[t as usize] = k as u32);
    }

    fn leave(&mut self, piece: &[u32]) {
        piece.iter().for_each(|&t| self.local[t as usize] = NONE);
    }

    /// Is there nothing of the piece that was entered on the other side of `h`?
    fn rim(&self, h: u32) -> bool {
        let g = self.adjacency.opposite[h as usize];
        g == NONE || self.local[g as usize / 3] == NONE
    }

    /// For every half-edge of the boundary, in the order of the piece, the place of the least one of its loop.
    fn rim_loops(&self, piece: &[u32]) -> (Vec<u32>, Vec<u32>) {
        let mut rim: Vec<u32> = piece.iter().flat_map(|&t| 3 * t..3 * t + 3).filter(|&h| self.rim(h)).collect();
        rim.sort_unstable();
        let mut sets = Sets::new(rim.len());
        for k in 0..rim.len() {
            // Turn around the end until the boundary goes on.
            let mut g = next(rim[k]);
            while !self.rim(g) {
                g = next(self.adjacency.opposite[g as usize]);
            }
            sets.join(k as u32, rim.binary_search(&g).expect("the rim goes on") as u32);
        }
        let roots = (0..rim.len() as u32).map(|k| sets.root(k)).collect();
        (rim, roots)
    }

    /// Handles of a piece, all its boundaries filled.
    fn genus(&mut self, piece: &[u32]) -> usize {
        self.enter(piece);
        let (rim, roots) = self.rim_loops(piece);
        let mut sets = Sets::new(piece.len());
        for (k, &t) in piece.iter().enumerate() {
            for h in 3 * t..3 * t + 3 {
                if !self.rim(h) {
                    sets.join(k as u32, self.local[self.adjacency.opposite[h as usize] as usize / 3]);
                }
            }
        }
        let components = (0..piece.len() as u32).filter(|&k| sets.root(k) == k).count();
        self.leave(piece);
        let mut on_rim: Vec<u32> = rim.iter().map(|&h| self.origin(h)).collect();
        on_rim.sort_unstable();
        let mut inner: Vec<u32> = piece.iter().flat_map(|&t| self.triangles[t as usize]).collect();
        inner.sort_unstable();
        inner.dedup();
        inner.retain(|v| on_rim.binary_search(v).is_err());
        let loops = (0..roots.len()).filter(|&k| roots[k] == k as u32).count();
        // Where the piece touches itself at a vertex of its boundary, that vertex counts once for each time.
        let vertices = inner.len() + rim.len();
        let edges = (3 * piece.len() + rim.len()) / 2;
        (2 * components + edges).saturating_sub(vertices + piece.len() + loops) / 2
    }

    /// Vertices whose ball holds a handle; of all balls that cover the surface if no vertices are given.
    fn suspects(&mut self, given: Option<Vec<u32>>, radius: f64) -> Vec<u32> {
        let mut covered = vec![false; self.source.len()];
        let seeds = given.unwrap_or_else(|| (0..self.source.len() as u32).collect());
        let mut found = Vec::new();
        for seed in seeds {
            if std::mem::replace(&mut covered[seed as usize], true) {
                continue;
            }
            let piece = self.piece(seed, radius);
            let middle = self.at(seed);
            for &v in piece.iter().flat_map(|&t| &self.triangles[t as usize]) {
                covered[v as usize] |= self.at(v).distance_squared(middle) < radius * radius / 9.0;
            }
            if self.genus(&piece) > 0 {
                found.push(seed);
            }
        }
        found
    }

    /// A short loop around a handle near `seed`, at most `longest` long.
    fn tight_loop(&mut self, seed: u32, radius: f64, longest: f64) -> Option<Vec<u32>> {
        let (mut best, mut length) = self.shortest_loop(seed, radius)?;
        for _ in 0..TIGHTENED {
            match self.shortest_loop(best[best.len() / 2], radius) {
                Some((found, shorter)) if shorter < length => (best, length) = (found, shorter),
                _ => break,
            }
        }
        let inside = best.iter().all(|&v| !self.adjacency.is_boundary_vertex(v));
        (length <= longest && inside && best.len() <= MOST_VERTICES).then_some(best)
    }

    /// The shortest loop through about `root` that goes around a handle of its ball, and its length.
    fn shortest_loop(&mut self, root: u32, radius: f64) -> Option<(Vec<u32>, f64)> {
        let piece = self.piece(root, radius);
        self.enter(&piece);
        let visited = self.tree(root);
        let (rim, roots) = self.rim_loops(&piece);
        let in_tree = |s: &Self, h: u32| {
            let g = s.adjacency.opposite[h as usize];
            let led = |e: u32, v: u32| s.reached.via(v) == e;
            [h, g].into_iter().any(|e| e != NONE && (led(e, s.origin(e)) || led(e, s.end(e))))
        };
        let mut edges: Vec<(f64, u32)> = Vec::new();
        for h in piece.iter().flat_map(|&t| 3 * t..3 * t + 3) {
            let g = self.adjacency.opposite[h as usize];
            if (self.rim(h) || h < g) && !in_tree(self, h) {
                let (a, b) = (self.origin(h), self.end(h));
                let length = self.reached.distance(a) + self.at(a).distance(self.at(b)) + self.reached.distance(b);
                edges.push((length, h));
            }
        }
        edges.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut sets = Sets::new(piece.len() + rim.len());
        let mut last = None;
        for (_, h) in edges {
            let here = self.local[h as usize / 3];
            let there = match self.rim(h) {
                true => piece.len() as u32 + roots[rim.binary_search(&h).expect("at the rim")],
                false => self.local[self.adjacency.opposite[h as usize] as usize / 3],
            };
            if !sets.join(here, there) {
                last = Some(h);
            }
        }
        let found = last.map(|h| {
            let mut ways = [self.origin(h), self.end(h)].map(|v| self.way(v));
            // Both ways end at the root; the loop parts from where they meet.
            while let [.., a, _] = ways[0][..]
                && let [.., b, _] = ways[1][..]
                && a == b
            {
                ways.iter_mut().for_each(|w| {
                    w.pop();
                });
            }
            let [mut there, back] = ways;
            there.reverse();
            there.extend(&back[..back.len() - 1]);
            let length =
                (0..there.len()).map(|k| self.at(there[k]).distance(self.at(there[(k + 1) % there.len()]))).sum();
            (there, length)
        });
        self.leave(&piece);
        visited.iter().for_each(|&v| self.reached.set(v, f64::INFINITY, NONE));
        found.filter(|f| f.0.len() > 2)
    }

    fn end(&self, h: u32) -> u32 {
        self.origin(next(h))
    }

    /// Shortest paths from `root` in the piece that was entered, each with the half-edge of its last step; returns the
    /// vertices reached.
    fn tree(&mut self, root: u32) -> Vec<u32> {
        let mut search = graph::Search::over(std::mem::replace(&mut self.reached, Dense::new(0)));
        let mut visited = Vec::new();
        search.reach(root, 0.0, NONE);
        while let Some((v, so_far)) = search.settle() {
            visited.push(v);
            for h in self.adjacency.fan(v) {
                // Edges that begin here, and on a boundary the one that ends here and has no other side.
                for (e, w) in [(h, self.end(h)), (previous(h), self.origin(previous(h)))] {
                    let outside = self.local[e as usize / 3] == NONE && self.rim(e);
                    if outside || e != h && self.adjacency.opposite[e as usize] != NONE {
                        continue;
                    }
                    search.reach(w, so_far + self.at(v).distance(self.at(w)), e);
                }
            }
        }
        self.reached = search.reached;
        visited
    }

    /// Vertices from `v` back to the root.
    fn way(&self, v: u32) -> Vec<u32> {
        let mut way = vec![v];
        loop {
            let v = way[way.len() - 1];
            let h = self.reached.via(v);
            if h == NONE {
                return way;
            }
            way.push(if self.end(h) == v { self.origin(h) } else { self.end(h) });
        }
    }
}

/// Triangles of least area over a loop. `None` where all would use an edge that the surface has already.
fn cap(around: &[u32], search: &Search) -> Option<Vec<[usize; 3]>> {
    let n = around.len();
    let points: Vec<DVec3> = around.iter().map(|&v| search.at(v)).collect();
    let taken = |i: usize, j: usize| {
        let beside = j == i + 1 || (i == 0 && j == n - 1);
        let ring = |v: u32| search.adjacency.fan(v).flat_map(|h| search.triangles[h as usize / 3]);
        !beside && ring(around[i]).any(|w| w == around[j])
    };
    super::lids::least_area(&points, taken)
}

/// Parts the surface along a loop and fills both boundaries.
fn cut(
    around: &[u32],
    cap: &[[usize; 3]],
    triangles: &mut Vec<[u32; 3]>,
    source: &mut Vec<u32>,
    adjacency: &Adjacency,
) {
    let n = around.len();
    let fresh: Vec<u32> = (0..n as u32).map(|k| source.len() as u32 + k).collect();
    let at_end = |t: &[[u32; 3]], h: u32| crate::mesh::soup::origin(t, next(h));
    // Before any triangle is changed: those on the right of the loop at each of its vertices.
    let right: Vec<Vec<u32>> = (0..n)
        .map(|k| {
            let (before, after) = (around[(k + n - 1) % n], around[(k + 1) % n]);
            let fan: Vec<u32> = adjacency.fan(around[k]).collect();
            let place = |w: u32| fan.iter().position(|&h| at_end(triangles, h) == w).expect("a neighbour on the loop");
            let (out, back) = (place(after), place(before));
            // Counter-clockwise from the way on to the way back lies the left side.
            (0..fan.len()).map(|i| fan[(back + i) % fan.len()]).take((out + fan.len() - back) % fan.len()).collect()
        })
        .collect();
    source.extend(around.iter().map(|&v| source[v as usize]).collect::<Vec<_>>());
    for (k, sector) in right.iter().enumerate() {
        for &h in sector {
            triangles[h as usize / 3][h as usize % 3] = fresh[k];
        }
    }
    // The left side runs along the loop, so its cap runs against it; the right side the other way.
    triangles.extend(cap.iter().map(|&[i, j, k]| [around[k], around[j], around[i]]));
    triangles.extend(cap.iter().map(|&[i, j, k]| [fresh[i], fresh[j], fresh[k]]));
}

#[cfg(test)]
mod tests {
    use crate::mend::repair;
    use crate::mesh::{TriMesh, diagnose, self_intersections};
    use crate::synthetic::shapes;
    use glam::DVec3;

    /// Two spheres of radius 1 and distance 40, one with a tube of six triangles from one of its faces to another.
    fn with_a_handle() -> TriMesh {
        let mut mesh = shapes::sphere(1.0, 4);
        let disjoint = |t: &[u32; 3]| !t.iter().any(|v| mesh.triangles[0].contains(v));
        let away = |t: &[u32; 3]| (mesh.points[t[0] as usize] - mesh.points[mesh.triangles[0][0] as usize]).length();
        let near = (0..mesh.triangles.len())
            .filter(|&t| disjoint(&mesh.triangles[t]))
            .find(|&t| (0.15..0.3).contains(&away(&mesh.triangles[t])))
            .expect("a face close by");
        let (a, b) = (mesh.triangles[0], mesh.triangles.swap_remove(near));
        mesh.triangles.swap_remove(0);
        // Without a twist.
        let at = |v: u32| mesh.points[v as usize];
        let length = |turn: &usize| (0..3).map(|k| at(a[k]).distance(at(b[(turn + 3 - k) % 3]))).sum::<f64>();
        let turn = (0..3).min_by(|x, y| length(x).total_cmp(&length(y))).unwrap();
        for k in 0..3 {
            let (a0, a1, b0, b1) = (a[k], a[(k + 1) % 3], b[(turn + 3 - k) % 3], b[(turn + 5 - k) % 3]);
            mesh.triangles.extend([[a0, a1, b1], [a0, b1, b0]]);
        }
        let other = shapes::sphere(1.0, 3);
        let first = mesh.points.len() as u32;
        mesh.points.extend(other.points.iter().map(|p| *p + 40.0 * DVec3::X));
        mesh.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
        mesh
    }

    #[test]
    fn a_handle_of_six_triangles_is_closed_without_crossings_and_the_vertices_of_its_loop_alone_move() {
        let mesh = with_a_handle();
        assert_eq!((diagnose(&mesh).genus, self_intersections(&mesh).len()), (Some(1), 0));
        let (mended, done) = repair(&mesh, &crate::Silent).unwrap();
        let facts = diagnose(&mended);
        assert_eq!((done.closed_handles, facts.genus, facts.components), (1, Some(0), 2));
        assert!(facts.watertight && facts.manifold);
        assert_eq!(self_intersections(&mended).len(), 0);
        let moved = mended.points.iter().filter(|p| !mesh.points.contains(p)).count();
        assert!((1..=6).contains(&moved), "{moved}");
    }

    #[test]
    fn a_handle_beside_a_hole_is_closed_and_nothing_comes_off() {
        let whole = with_a_handle();
        // The tube follows the faces of its sphere.
        let tube = shapes::sphere(1.0, 4).triangles.len() - 2;
        let at = whole.corners(tube)[0];
        for far in [0.1, 0.2, 0.3] {
            let mut mesh = whole.clone();
            let hole = (0..tube)
                .filter(|&t| mesh.corners(t).iter().all(|p| p.distance(at) > far))
                .min_by(|&a, &b| mesh.corners(a)[0].distance(at).total_cmp(&mesh.corners(b)[0].distance(at)))
                .expect("a face of the sphere");
            mesh.triangles.swap_remove(hole);
            let (mended, done) = repair(&mesh, &crate::Silent).unwrap();
            let facts = diagnose(&mended);
            assert_eq!((done.closed_handles, facts.genus, facts.components), (1, Some(0), 2));
            assert_eq!((done.closed_holes, facts.boundary_loops), (1, 0));
        }
    }

    #[test]
    fn thick_handles_and_thin_rings_stay() {
        for thin in [0.3, 0.002] {
            let mesh = shapes::torus(1.0, thin, 96, 12);
            let (mended, done) = repair(&mesh, &crate::Silent).unwrap();
            assert_eq!(done.closed_handles, 0);
            assert_eq!(mended, mesh);
        }
    }
}
