//! A coarser mesh to lay out on: the same surface with fewer vertices, and the way back.
//!
//! Vertices away from lines and nodes are taken out one by one; the polygon that is left is the fan of the best
//! neighbour. The arcs are kept in step ([`super::strands`]), down and up again, so that a network of the coarse mesh
//! is one of the fine mesh. (The idea of carrying a map through such steps is that of Lee et al., MAPS, 1998; here only
//! the arcs are carried.)

use super::strands::{Star, Strands};
use crate::geom::predicates::orient2d;
use crate::layout::complex::Complex;
use crate::mesh::{Adjacency, NONE, TriMesh};
use crate::network::imprint::Place;
use crate::observe::Observer;
use glam::DVec3;

/// A vertex may go to a neighbour that is nearer than this, in sides of a patch, and leave edges as long as that: a cell
/// keeps some hundred faces.
const COLLAPSE_REACH: f64 = 0.09;
const LONGEST: f64 = 0.14;

/// Cosine of the greatest turn of a face: limbs and ridges stay.
const FACE_TURN_COSINE: f64 = 0.8;

/// Greatest number of neighbours.
const VALENCE: usize = 12;

/// Least shape of a face (1 for an equilateral triangle), unless it was worse before.
const LEAST_FACE_SHAPE: f64 = 0.15;

/// Passes over all vertices; each takes out at most one in four.
const COARSENING_PASSES: usize = 24;

/// A pass that takes out less than this part of the vertices is the last one.
const WORTHWHILE_PASS: f64 = 0.01;

/// The coarse mesh must be smaller than this part of the fine one to be worth it.
const SMALLER: f64 = 0.6;

/// The coarse mesh.
pub(in crate::layout) struct Coarse {
    pub mesh: TriMesh,
    /// The complex on it.
    pub complex: Complex,
    /// For each of its vertices and faces that of the fine mesh.
    vertex: Vec<u32>,
    face: Vec<u32>,
    /// Vertices taken out, in this order.
    stars: Vec<Star>,
}

/// A mesh that loses vertices.
struct Melt<'a> {
    points: &'a [DVec3],
    triangles: Vec<[u32; 3]>,
    /// Faces around each vertex; none around one that is gone.
    around: Vec<Vec<u32>>,
    /// Vertices that stay.
    stays: Vec<bool>,
    longest: f64,
    near: f64,
}

/// A coarser mesh with `complex` on it; `side` is that of a patch. `None` if it would not be much smaller.
pub(in crate::layout) fn coarsen(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    complex: &Complex,
    side: f64,
    observer: &dyn Observer,
) -> Option<Coarse> {
    let faces = mesh.triangles.len();
    let names: Vec<u32> = (0..mesh.points.len().max(faces) as u32).collect();
    let mut strands = Strands::new((mesh, adjacency), complex, (&names, &names), faces)?;
    let mut melt = Melt {
        points: &mesh.points,
        triangles: mesh.triangles.clone(),
        around: vec![Vec::new(); mesh.points.len()],
        stays: fixed(mesh, adjacency, complex),
        longest: LONGEST * side,
        near: COLLAPSE_REACH * side,
    };
    for (f, t) in mesh.triangles.iter().enumerate() {
        t.iter().for_each(|&v| melt.around[v as usize].push(f as u32));
    }
    let mut stars = Vec::new();
    let mut left: Vec<u32> = (0..mesh.points.len() as u32).filter(|&v| !melt.stays[v as usize]).collect();
    for _ in 0..COARSENING_PASSES {
        let mut quiet = vec![true; mesh.points.len()];
        let before = left.len();
        left.retain(|&v| {
            let star = quiet[v as usize].then(|| melt.plan(v)).flatten();
            if let Some(star) = &star {
                star.ring.iter().for_each(|&r| quiet[r as usize] = false);
                strands.take_out(star, melt.points);
                melt.take_out(star);
            }
            let keep = star.is_none();
            stars.extend(star);
            keep
        });
        if ((before - left.len()) as f64) < WORTHWHILE_PASS * before as f64 || observer.cancelled() {
            break;
        }
    }
    let vertex: Vec<u32> = (0..mesh.points.len() as u32).filter(|&v| !melt.around[v as usize].is_empty()).collect();
    if vertex.len() as f64 > SMALLER * mesh.points.len() as f64 {
        return None;
    }
    let mut number = vec![NONE; mesh.points.len()];
    vertex.iter().enumerate().for_each(|(i, &v)| number[v as usize] = i as u32);
    let mut gone = vec![false; faces];
    for star in &stars {
        for f in [star.faces[0], star.faces[star.faces.len() - 1]] {
            gone[f as usize] = true;
        }
    }
    let face: Vec<u32> = (0..faces as u32).filter(|&f| !gone[f as usize]).collect();
    let points = vertex.iter().map(|&v| mesh.points[v as usize]).collect();
    let triangles = face.iter().map(|&f| melt.triangles[f as usize].map(|v| number[v as usize])).collect();
    let coarse = TriMesh::new(points, triangles);
    let mut complex = complex.clone();
    complex.nodes.iter_mut().for_each(|n| n.vertex = number[n.vertex as usize]);
    strands.put((&coarse, &Adjacency::new(&coarse)), |v| number[v as usize], &mut complex)?;
    Some(Coarse { mesh: coarse, complex, vertex, face, stars })
}

impl Coarse {
    /// A complex of the coarse mesh on the fine one.
    pub fn refined(&self, mesh: &TriMesh, adjacency: &Adjacency, complex: &Complex) -> Option<Complex> {
        let own = Adjacency::new(&self.mesh);
        let names = (&self.vertex[..], &self.face[..]);
        let mut strands = Strands::new((&self.mesh, &own), complex, names, mesh.triangles.len())?;
        for star in self.stars.iter().rev() {
            strands.put_in(star, &mesh.points);
        }
        let mut complex = complex.clone();
        complex.nodes.iter_mut().for_each(|n| n.vertex = self.vertex[n.vertex as usize]);
        strands.put((mesh, adjacency), |v| v, &mut complex)?;
        Some(complex)
    }
}

/// Vertices that must not go: nodes, and all of lines and boundaries.
fn fixed(mesh: &TriMesh, adjacency: &Adjacency, complex: &Complex) -> Vec<bool> {
    let mut fixed: Vec<bool> = (0..mesh.points.len() as u32)
        .map(|v| adjacency.outgoing[v as usize] == NONE || adjacency.is_boundary_vertex(v))
        .collect();
    complex.nodes.iter().for_each(|n| fixed[n.vertex as usize] = true);
    for a in complex.live_arcs() {
        let arc = complex.arc(2 * a);
        if !arc.kind.is_smooth() {
            for place in &arc.chain {
                if let Place::Vertex(v) = *place {
                    fixed[v as usize] = true;
                }
            }
        }
    }
    fixed
}

impl Melt<'_> {
    /// How vertex `v` can be taken out best, if it can.
    fn plan(&self, v: u32) -> Option<Star> {
        let mut star = self.star(v)?;
        let n = star.ring.len();
        let flat = star.flat(self.points);
        let at = |i: usize| self.points[star.ring[i] as usize];
        let here = self.points[v as usize];
        let normal: Vec<DVec3> = (0..n).map(|i| (at(i) - here).cross(at((i + 1) % n) - here)).collect();
        let mean = normal.iter().sum::<DVec3>().normalize_or_zero();
        let old = (0..n).map(|i| shape([here, at(i), at((i + 1) % n)])).fold(f64::INFINITY, f64::min);
        let mut best: Option<(f64, usize)> = None;
        for apex in (0..n).filter(|&i| at(i).distance(here) < self.near) {
            let ring = |i: usize| (apex + i) % n;
            let mut least = f64::INFINITY;
            let fits = (1..n - 1).all(|i| {
                let (i, j) = (ring(i), ring(i + 1));
                let face = (at(i) - at(apex)).cross(at(j) - at(apex));
                least = least.min(shape([at(apex), at(i), at(j)]));
                orient2d(flat[apex], flat[i], flat[j]) > 0.0
                    && face.dot(mean) > FACE_TURN_COSINE * face.length()
                    && normal[i].dot(face) > 0.0
                    && least > LEAST_FACE_SHAPE.min(old)
                    && best.is_none_or(|b| least > b.0)
            });
            let spans = |i: usize| {
                let (a, b) = (star.ring[apex], star.ring[ring(i)]);
                at(apex).distance(at(ring(i))) < self.longest
                    && !(self.stays[a as usize] && self.stays[b as usize])
                    && !self.joined(a, b)
            };
            let full = self.around[star.ring[apex] as usize].len() + n - 4 > VALENCE;
            if fits && !full && (2..n - 1).all(spans) {
                best = Some((least, apex));
            }
        }
        let (_, apex) = best?;
        // A corner of the ring with three faces would be left with two.
        let thin = |i: usize| self.around[star.ring[i] as usize].len() <= 3;
        if thin((apex + 1) % n) || thin((apex + n - 1) % n) {
            return None;
        }
        star.ring.rotate_left(apex);
        star.faces.rotate_left(apex);
        Some(star)
    }

    /// The faces around a vertex, in order.
    fn star(&self, v: u32) -> Option<Star> {
        let faces = &self.around[v as usize];
        let corner = |f: u32| {
            let t = self.triangles[f as usize];
            let k = t.iter().position(|&x| x == v).expect("a face around the vertex");
            (t[(k + 1) % 3], t[(k + 2) % 3])
        };
        let mut star = Star {
            vertex: v,
            ring: Vec::with_capacity(faces.len()),
            faces: Vec::with_capacity(faces.len()),
            line: None,
        };
        let mut at = corner(*faces.first()?).0;
        for _ in 0..faces.len() {
            let (f, to) = faces.iter().find_map(|&f| {
                let (from, to) = corner(f);
                (from == at).then_some((f, to))
            })?;
            star.ring.push(at);
            star.faces.push(f);
            at = to;
        }
        (at == star.ring[0] && faces.len() >= 3 && faces.len() <= VALENCE).then_some(star)
    }

    /// True if an edge joins two vertices.
    fn joined(&self, a: u32, b: u32) -> bool {
        self.around[a as usize].iter().any(|&f| self.triangles[f as usize].contains(&b))
    }

    fn take_out(&mut self, star: &Star) {
        let n = star.ring.len();
        let apex = star.ring[0];
        for &f in star.fan() {
            let t = &mut self.triangles[f as usize];
            let k = t.iter().position(|&x| x == star.vertex).expect("a face around the vertex");
            t[k] = apex;
        }
        let (first, last) = (star.faces[0], star.faces[n - 1]);
        self.around[star.ring[1] as usize].retain(|&f| f != first);
        self.around[star.ring[n - 1] as usize].retain(|&f| f != last);
        self.around[apex as usize].retain(|&f| f != first && f != last);
        self.around[apex as usize].extend_from_slice(star.fan());
        self.around[star.vertex as usize] = Vec::new();
    }
}

/// Shape of a triangle: 1 for an equilateral one, 0 for one without area.
fn shape([a, b, c]: [DVec3; 3]) -> f64 {
    let longest = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
    2.0 * 3f64.sqrt() * (b - a).cross(c - a).length() / longest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Silent;
    use crate::layout::proxy::refine;
    use crate::layout::recut::Bench;
    use crate::layout::{LayoutParams, draft, improve};
    use crate::synthetic::shapes;

    #[test]
    fn arcs_hold_together_on_a_third_of_the_vertices_and_back_on_all() {
        let torus = shapes::torus(1.0, 0.4, 240, 120);
        let params = LayoutParams { patches: 60, ..LayoutParams::default() };
        let sharp = vec![false; 3 * torus.triangles.len()];
        let work = refine::refine(&torus, f64::INFINITY, &vec![false; torus.points.len()], usize::MAX);
        let side = (4.0 * std::f64::consts::PI.powi(2) * 0.4 / 60.0f64).sqrt();
        let (work, complex) = draft(work, (&sharp, &[]), side, &params, &Silent).unwrap().unwrap();
        let adjacency = Adjacency::new(&work.mesh);
        let mut bench = Bench::new(&work.mesh, &adjacency, complex).unwrap();
        assert!(improve::quads(&mut bench));
        let coarse = coarsen(&work.mesh, &adjacency, &bench.complex, side, &Silent).unwrap();
        assert!(3 * coarse.mesh.points.len() < work.mesh.points.len(), "{}", coarse.mesh.points.len());
        let own = Adjacency::new(&coarse.mesh);
        let on_coarse = Bench::new(&coarse.mesh, &own, coarse.complex.clone()).expect("an embedding");
        let back = coarse.refined(&work.mesh, &adjacency, &on_coarse.complex).unwrap();
        let back = Bench::new(&work.mesh, &adjacency, back).expect("an embedding");
        assert_eq!(back.complex.live_cells().count(), bench.complex.live_cells().count());
        let area = |bench: &Bench| bench.shapes().iter().flatten().map(|s| s.area).sum::<f64>();
        assert!((area(&back) - area(&bench)).abs() < 1e-9 * area(&bench));
    }
}
