//! Disks cut out of a mesh: their own numbering, a convex map to the plane, straight lines in it.
//!
//! The map is Tutte's: boundary on a circle, every inner vertex a positive average of its neighbours, which is
//! one to one whatever the shape. The weights are cotangents kept positive, so it is nearly harmonic.
//!
//! Tutte, *How to Draw a Graph*, 1963; Floater, *Parametrization and smooth approximation of surface triangulations*, 1997;
//! `docs/decisions/0005-spade-and-convex-maps.md`.

use crate::linalg::{SparseCholesky, envelope};
use crate::mesh::{Adjacency, NONE, next, previous};
use glam::{DVec2, DVec3};
use robust::{Coord, orient2d};

/// Least weight of an edge in the map, against the cotangent weight 1 of a right isosceles triangle: keeps
/// the map one to one where triangles are obtuse.
const LEAST_WEIGHT: f64 = 0.05;

/// Greatest weight: a sliver must not outweigh all its neighbours by more than the solver's digits.
const GREATEST_WEIGHT: f64 = 1e4;

/// A disk of triangles, cut open along its boundary.
#[derive(Clone, Debug)]
pub(crate) struct Disk {
    /// Triangles over the disk's own vertices.
    pub triangles: Vec<[u32; 3]>,
    /// For each of its vertices the vertex of the mesh.
    pub vertices: Vec<u32>,
    /// For each of its triangles the face of the mesh.
    pub faces: Vec<u32>,
    /// Its boundary, counter-clockwise, from the start of the first half-edge given.
    pub boundary: Vec<u32>,
    /// Its own adjacency.
    pub adjacency: Adjacency,
}

impl Disk {
    /// The disk of `faces` (sorted), cut open at the half-edges for which `barrier` holds; its boundary starts
    /// with half-edge `start` of the mesh. `None` if it is not a disk.
    pub fn new(
        triangles: &[[u32; 3]],
        adjacency: &Adjacency,
        faces: &[u32],
        barrier: impl Fn(u32) -> bool,
        start: u32,
    ) -> Option<Disk> {
        let local = |f: u32| faces.binary_search(&f).ok().map(|i| i as u32);
        let mut opposite = vec![NONE; 3 * faces.len()];
        for (i, &f) in faces.iter().enumerate() {
            for k in 0..3 {
                let h = 3 * f + k;
                let o = adjacency.opposite[h as usize];
                if !barrier(h) && o != NONE {
                    if let Some(j) = local(o / 3) {
                        opposite[3 * i + k as usize] = 3 * j + o % 3;
                    } else {
                        return None; // the region leaks
                    }
                }
            }
        }
        let mut own = vec![NONE; 3 * faces.len()];
        let mut vertices = Vec::new();
        let mut outgoing = Vec::new();
        for h in 0..own.len() as u32 {
            if own[h as usize] != NONE {
                continue;
            }
            let mut first = h;
            loop {
                let o = opposite[first as usize];
                if o == NONE || next(o) == h {
                    break;
                }
                first = next(o);
            }
            let name = vertices.len() as u32;
            vertices.push(triangles[faces[h as usize / 3] as usize][h as usize % 3]);
            outgoing.push(first);
            let mut g = first;
            loop {
                own[g as usize] = name;
                let turned = opposite[previous(g) as usize];
                if turned == NONE || turned == first {
                    break;
                }
                g = turned;
            }
        }
        let triangles: Vec<[u32; 3]> = own.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        let first = 3 * local(start / 3)? + start % 3;
        let mut boundary = Vec::new();
        let mut h = first;
        loop {
            if opposite[h as usize] != NONE || boundary.len() > own.len() {
                return None;
            }
            boundary.push(own[h as usize]);
            h = next(h);
            while opposite[h as usize] != NONE {
                h = next(opposite[h as usize]);
            }
            if h == first {
                break;
            }
        }
        let open = opposite.iter().filter(|&&o| o == NONE).count();
        let euler = vertices.len() as i64 - (3 * faces.len() + open) as i64 / 2 + faces.len() as i64;
        if open != boundary.len() || euler != 1 {
            return None;
        }
        let adjacency = Adjacency { opposite, outgoing };
        Some(Disk { triangles, vertices, faces: faces.to_vec(), boundary, adjacency })
    }

    /// Maps the disk into the unit circle; `angles` (radians, rising) are those of the boundary vertices.
    /// `points` are positions of the mesh's vertices. `None` if the system cannot be solved.
    pub fn circle_map(&self, points: &[DVec3], angles: &[f64]) -> Option<Vec<DVec2>> {
        let n = self.vertices.len();
        let mut uv = vec![DVec2::ZERO; n];
        let mut unknown = vec![0u32; n];
        for (&v, &a) in self.boundary.iter().zip(angles) {
            uv[v as usize] = DVec2::from_angle(a);
            unknown[v as usize] = NONE;
        }
        let mut count = 0u32;
        for u in unknown.iter_mut().filter(|u| **u != NONE) {
            *u = count;
            count += 1;
        }
        if count == 0 {
            return Some(uv);
        }
        let m = count as usize;
        let position = |v: u32| points[self.vertices[v as usize] as usize];
        let mut lower = Vec::with_capacity(8 * m);
        let mut diagonal = vec![0.0; m];
        let mut rhs = vec![DVec2::ZERO; m];
        for h in 0..self.adjacency.opposite.len() as u32 {
            let o = self.adjacency.opposite[h as usize];
            if o < h {
                continue;
            }
            let (a, b) = (self.from(h), self.from(next(h)));
            let mut w = 0.0;
            for g in [h, o].into_iter().filter(|&g| g != NONE) {
                let apex = position(self.from(previous(g)));
                let (x, y) = (position(a) - apex, position(b) - apex);
                w += x.dot(y) / x.cross(y).length().max(f64::MIN_POSITIVE) / 2.0;
            }
            let w = if w.is_finite() { w.clamp(LEAST_WEIGHT, GREATEST_WEIGHT) } else { 1.0 };
            let (i, j) = (unknown[a as usize], unknown[b as usize]);
            for (x, y, other) in [(i, j, b), (j, i, a)] {
                if x == NONE {
                    continue;
                }
                diagonal[x as usize] += w;
                if y == NONE {
                    rhs[x as usize] += w * uv[other as usize];
                } else if x > y {
                    lower.push((x as usize, y as usize, -w));
                }
            }
        }
        lower.extend(diagonal.iter().enumerate().map(|(i, &d)| (i, i, d)));
        if m <= envelope::MOST_UNKNOWNS {
            envelope::solve(m, &lower, &mut rhs)?;
        } else {
            let mut columns: Vec<f64> = rhs.iter().map(|p| p.x).chain(rhs.iter().map(|p| p.y)).collect();
            SparseCholesky::factor(m, &lower).ok()?.solve(&mut columns);
            rhs = (0..m).map(|i| DVec2::new(columns[i], columns[m + i])).collect();
        }
        for (v, &u) in unknown.iter().enumerate() {
            if u != NONE {
                uv[v] = rhs[u as usize];
            }
        }
        uv.iter().all(|p| p.is_finite()).then_some(uv)
    }

    /// Start vertex of half-edge `h`.
    pub fn from(&self, h: u32) -> u32 {
        self.triangles[h as usize / 3][h as usize % 3]
    }

    /// What the straight segment from vertex `a` to vertex `b` meets in the map `uv`, ends excluded. `None`
    /// if it runs along the boundary or the map is folded there.
    pub fn straight(&self, uv: &[DVec2], a: u32, b: u32) -> Option<Vec<Met>> {
        self.polyline(uv, a, &[], b)
    }

    /// The same for the line from `a` to `b` through the points `via` of the map.
    pub fn polyline(&self, uv: &[DVec2], a: u32, via: &[DVec2], b: u32) -> Option<Vec<Met>> {
        let mut met = Vec::new();
        let mut at = At::Vertex(a);
        for &point in via {
            at = self.march(uv, at, Goal::Point(point), &mut met)?;
        }
        self.march(uv, at, Goal::Vertex(b), &mut met)?;
        Some(met)
    }

    /// Walks straight from `at` to `goal` in the map `uv`, and tells what is met on the way.
    fn march(&self, uv: &[DVec2], mut at: At, goal: Goal, met: &mut Vec<Met>) -> Option<At> {
        let march = March { disk: self, uv, goal };
        let mut steps = 0;
        loop {
            steps += 1;
            if steps > self.vertices.len() {
                return None;
            }
            let mut way = match at {
                At::Vertex(v) => march.leave_vertex(v)?,
                At::Face(f, from) => march.leave_face(f, from)?,
            };
            if let Way::Across { source, edge } = way {
                way = march.cross(source, edge, &mut steps, met)?;
            }
            match way {
                Way::Arrived(at) => return Some(at),
                Way::Through(v) => {
                    met.push(Met::Vertex(v));
                    at = At::Vertex(v);
                }
                Way::Across { .. } => return None,
            }
        }
    }
}

/// A straight walk in a map.
struct March<'a> {
    disk: &'a Disk,
    uv: &'a [DVec2],
    goal: Goal,
}

/// How a walk goes on.
enum Way {
    /// It is where it was to go.
    Arrived(At),
    /// To a vertex that lies on the line.
    Through(u32),
    /// Across an edge, on the line from `source`.
    Across { source: Coord<f64>, edge: u32 },
}

impl March<'_> {
    fn place(&self, v: u32) -> Coord<f64> {
        coord(self.uv[v as usize])
    }

    fn end(&self) -> DVec2 {
        match self.goal {
            Goal::Vertex(b) => self.uv[b as usize],
            Goal::Point(p) => p,
        }
    }

    /// Half-edges of a triangle with their ends.
    fn edges(&self, f: u32) -> impl Iterator<Item = (u32, u32, u32)> {
        (3 * f..3 * f + 3).map(|h| (h, self.disk.from(h), self.disk.from(next(h))))
    }

    fn arrived(&self, f: u32) -> Option<At> {
        match self.goal {
            Goal::Vertex(b) => self.disk.triangles[f as usize].contains(&b).then_some(At::Vertex(b)),
            Goal::Point(p) => (self.edges(f))
                .all(|(_, a, b)| orient2d(self.place(a), self.place(b), coord(p)) >= 0.0)
                .then_some(At::Face(f, p)),
        }
    }

    fn leave_vertex(&self, v: u32) -> Option<Way> {
        let (disk, uv, end) = (self.disk, self.uv, self.end());
        let target = coord(end);
        let mut way = None;
        for h in disk.adjacency.fan(v) {
            let (p, q) = (disk.from(next(h)), disk.from(previous(h)));
            if let Goal::Vertex(b) = self.goal {
                for (w, edge) in [(p, h), (q, previous(h))] {
                    if w == b {
                        let open = disk.adjacency.opposite[edge as usize] == NONE;
                        return if open { None } else { Some(Way::Arrived(At::Vertex(b))) };
                    }
                }
            } else if let Some(at) = self.arrived(h / 3) {
                return Some(Way::Arrived(at));
            }
            let (right, left) =
                (orient2d(self.place(v), self.place(p), target), orient2d(self.place(v), self.place(q), target));
            let ahead = |w: u32| (uv[w as usize] - uv[v as usize]).dot(end - uv[v as usize]) > 0.0;
            if right == 0.0 && ahead(p) {
                way = Some(Way::Through(p));
            } else if left == 0.0 && ahead(q) {
                way = Some(Way::Through(q));
            } else if right > 0.0 && left < 0.0 {
                way = Some(Way::Across { source: self.place(v), edge: next(h) });
            }
        }
        way
    }

    fn leave_face(&self, f: u32, from: DVec2) -> Option<Way> {
        if let Some(at) = self.arrived(f) {
            return Some(Way::Arrived(at));
        }
        let (source, target) = (coord(from), coord(self.end()));
        let (edge, p, q) = self.edges(f).find(|&(_, p, q)| {
            orient2d(self.place(p), self.place(q), target) < 0.0
                && orient2d(source, target, self.place(p)) <= 0.0
                && orient2d(source, target, self.place(q)) >= 0.0
        })?;
        let on_line = [p, q].into_iter().find(|&w| orient2d(source, target, self.place(w)) == 0.0);
        Some(on_line.map_or(Way::Across { source, edge }, Way::Through))
    }

    /// Crosses edge after edge until the walk arrives or meets a vertex.
    fn cross(&self, source: Coord<f64>, mut edge: u32, steps: &mut usize, met: &mut Vec<Met>) -> Option<Way> {
        let (disk, target) = (self.disk, coord(self.end()));
        loop {
            *steps += 1;
            if *steps > 3 * disk.triangles.len() {
                return None;
            }
            let (p, q) = (disk.from(edge), disk.from(next(edge)));
            let (right, left) = (-orient2d(source, target, self.place(p)), orient2d(source, target, self.place(q)));
            if right <= 0.0 || left <= 0.0 {
                return None;
            }
            met.push(Met::Edge(p, q, right / (right + left)));
            let other = disk.adjacency.opposite[edge as usize];
            if other == NONE {
                return None;
            }
            if let Some(at) = self.arrived(other / 3) {
                return Some(Way::Arrived(at));
            }
            let r = disk.from(previous(other));
            let side = orient2d(source, target, self.place(r));
            if side == 0.0 {
                return Some(Way::Through(r));
            }
            edge = if side > 0.0 { next(other) } else { previous(other) };
        }
    }
}

fn coord(p: DVec2) -> Coord<f64> {
    Coord { x: p.x, y: p.y }
}

/// Where a line in a map is.
#[derive(Clone, Copy)]
enum At {
    Vertex(u32),
    /// In a triangle, at a point of the map.
    Face(u32, DVec2),
}

/// Where a line in a map goes.
#[derive(Clone, Copy)]
enum Goal {
    Vertex(u32),
    Point(DVec2),
}

/// What a line meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Met {
    /// A vertex of the disk.
    Vertex(u32),
    /// The edge between two vertices, the fraction of the way from the first.
    Edge(u32, u32, f64),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriMesh;

    /// A square of `n` x `n` cells in the plane, which is its own map.
    fn square(n: u32) -> (Disk, Vec<DVec2>) {
        let point = |k: u32| DVec3::new((k % (n + 1)) as f64, (k / (n + 1)) as f64, 0.0);
        let cell = |k: u32| {
            let a = k / n * (n + 1) + k % n;
            [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
        };
        let mesh = TriMesh::new((0..(n + 1) * (n + 1)).map(point).collect(), (0..n * n).flat_map(cell).collect());
        let adjacency = Adjacency::new(&mesh);
        let faces: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
        let open = |h: u32| adjacency.opposite[h as usize] == NONE;
        let start = (0..adjacency.opposite.len() as u32).find(|&h| open(h)).expect("a rim");
        let disk = Disk::new(&mesh.triangles, &adjacency, &faces, open, start).expect("a disk");
        let uv = disk.vertices.iter().map(|&v| mesh.points[v as usize].truncate()).collect();
        (disk, uv)
    }

    fn vertex(uv: &[DVec2], x: f64, y: f64) -> u32 {
        uv.iter().position(|p| *p == DVec2::new(x, y)).expect("a vertex") as u32
    }

    #[test]
    fn a_line_through_three_places_meets_the_mesh_on_its_segments_within_1e_12_and_in_order() {
        let (disk, uv) = square(9);
        let (a, b) = (vertex(&uv, 1.0, 1.0), vertex(&uv, 8.0, 7.0));
        let via = [DVec2::new(3.3, 6.2), DVec2::new(3.4, 6.1), DVec2::new(6.1, 2.7)];
        let stops = [uv[a as usize], via[0], via[1], via[2], uv[b as usize]];
        let met = disk.polyline(&uv, a, &via, b).expect("a line");
        let mut part = 0;
        let mut last = 0.0;
        for m in met {
            let p = match m {
                Met::Vertex(v) => uv[v as usize],
                Met::Edge(p, q, t) => uv[p as usize].lerp(uv[q as usize], t),
            };
            let off = |k: usize| {
                let (line, at) = (stops[k + 1] - stops[k], p - stops[k]);
                (line.perp_dot(at).abs() / line.length(), at.dot(line) / line.length_squared())
            };
            while off(part).0 > 1e-12 || off(part).1 > 1.0 {
                (part, last) = (part + 1, 0.0);
                assert!(part < 4, "{p} lies on no segment");
            }
            assert!(off(part).1 >= last, "{p} lies before what was met before");
            last = off(part).1;
        }
        assert_eq!(part, 3);
    }

    #[test]
    fn a_line_through_vertices_of_the_mesh_meets_them() {
        let (disk, uv) = square(6);
        let (a, b) = (vertex(&uv, 1.0, 1.0), vertex(&uv, 4.0, 4.0));
        let want: Vec<Met> = [2.0, 3.0].iter().map(|&x| Met::Vertex(vertex(&uv, x, x))).collect();
        assert_eq!(disk.straight(&uv, a, b), Some(want));
    }
}
