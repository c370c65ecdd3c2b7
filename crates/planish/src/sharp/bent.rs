//! Edges beside which the surface bends are split.
//!
//! The vertices of a mesh that was made of a field lie on its surface, the faces do not: along an edge of length l on which
//! the surface turns by t the surface is l t / 8 away. What is fitted to the faces of a bore, whose ends are lines, is a barrel.
//!
//! The way from the middle of an edge e to the surface is that of a parabola, `(n_b (e . n_b) - n_a (e . n_a)) / 8`
//! with the normals `n_a` and `n_b` at its ends: Vlachos, Peters, Boyd, Mitchell, *Curved PN Triangles*, 2001, has
//! cubics of the same normals. On a sharp line the parts of e across its tangents at both ends take the place of the
//! parts along the normals. See `docs/methods/sharp.md`, step 6.

use super::lines::Lines;
use crate::mesh::intersect::intersections_of;
use crate::mesh::{FeatureKind, FeatureTags, TriMesh, next, previous};
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;

/// The least way over the edge's length: 4.6 degrees from end to end.
const LEAST_BEND: f64 = 0.01;
/// An edge that leaves a surface or line by more than this (sine of 40 degrees) has no bend but a kink.
const KINK_COSINE: f64 = 0.64;
/// A piece turns from the face it is a part of by less than this cosine (60 degrees).
const PIECE_TURN_COSINE: f64 = 0.5;

/// Splits the edges that pass `least` or more beside the surface, the new vertices on it. Returns how many.
///
/// No face turns over, and none comes to meet another.
/// # Errors
/// [`Cancelled`]; the mesh is then as it was.
pub fn split_bent(
    mesh: &mut TriMesh,
    tags: &mut FeatureTags,
    least: f64,
    observer: &dyn Observer,
) -> Result<usize, Cancelled> {
    let mut splits = bends(mesh, tags, least);
    let refined = loop {
        observer.check()?;
        let refined = Refined::new(mesh, &splits);
        let mut bad: Vec<u32> = refined.turned(mesh);
        if bad.is_empty() {
            let pairs = intersections_of(&refined.mesh, |t| refined.is_piece(mesh, t), observer)?.into_iter().flatten();
            bad = pairs.map(|t| refined.parent[t as usize]).collect();
        }
        let before = splits.len();
        let ends = |h: u32| (mesh.origin(h), mesh.origin(next(h)));
        let of_bad: Vec<(u32, u32)> =
            bad.iter().flat_map(|t| 3 * t..3 * t + 3).map(|h| lesser_first(ends(h))).collect();
        splits.retain(|s| !of_bad.contains(&s.ends));
        if splits.len() == before {
            break refined;
        }
    };
    let middle = |e: &[u32; 2]| splits.binary_search_by_key(&(e[0], e[1]), |s| s.ends).ok();
    let first = mesh.points.len() as u32;
    let mut vertices = tags.vertices.clone();
    vertices.resize(refined.mesh.points.len(), FeatureKind::None);
    let mut edges: Vec<[u32; 2]> = Vec::new();
    for e in &tags.edges {
        match middle(e) {
            Some(k) => {
                let m = first + k as u32;
                vertices[m as usize] = FeatureKind::Edge;
                edges.extend([[e[0], m], [e[1], m]]);
            }
            None => edges.push(*e),
        }
    }
    edges.sort_unstable();
    *tags = FeatureTags { vertices, edges };
    *mesh = refined.mesh;
    Ok(splits.len())
}

/// An edge that is split: its ends, the lesser first, and where its middle goes.
struct Split {
    ends: (u32, u32),
    at: DVec3,
}

fn lesser_first((a, b): (u32, u32)) -> (u32, u32) {
    (a.min(b), a.max(b))
}

/// The edges that pass `least` or more beside the surface, ascending by their ends.
fn bends(mesh: &TriMesh, tags: &FeatureTags, least: f64) -> Vec<Split> {
    let lines = Lines::new(mesh, tags);
    let sum = |corners: &mut dyn Iterator<Item = u32>| -> DVec3 {
        let all = corners.map(|h| corner_angle(mesh, h) * lines.areas[h as usize / 3].normalize_or_zero());
        all.sum::<DVec3>().normalize_or_zero()
    };
    // Normals of vertices, and on lines those of their sectors.
    let whole = |v: u32| if lines.on_line[v as usize] { DVec3::ZERO } else { sum(&mut lines.adjacency.fan(v)) };
    let normals: Vec<DVec3> = (0..mesh.points.len() as u32).into_par_iter().map(whole).collect();
    let normal = |h: u32| {
        let v = mesh.origin(h);
        if !lines.on_line[v as usize] {
            return normals[v as usize];
        }
        let own = lines.sectors(v).into_iter().find(|sector| sector.contains(&(h / 3))).unwrap_or_default();
        sum(&mut lines.adjacency.fan(v).filter(|g| own.contains(&(g / 3))))
    };
    // The tangent of every line at its vertices.
    let mut along: Vec<Vec<u32>> = vec![Vec::new(); mesh.points.len()];
    for e in &tags.edges {
        along[e[0] as usize].push(e[1]);
        along[e[1] as usize].push(e[0]);
    }
    let tangent = |v: u32| match along[v as usize][..] {
        [a, b] if tags.vertices[v as usize] == FeatureKind::Edge => {
            let [p, a, b] = [v, a, b].map(|v| mesh.points[v as usize]);
            // That of the circle through the three.
            ((p - a) / (p - a).length_squared() + (b - p) / (b - p).length_squared()).normalize_or_zero()
        }
        _ => DVec3::ZERO,
    };
    let bend = |h: u32| -> Option<Split> {
        let (a, b) = (mesh.origin(h), mesh.origin(next(h)));
        let other = lines.adjacency.opposite[h as usize];
        // Each edge once; the boundary stays.
        if other == crate::mesh::NONE || a > b {
            return None;
        }
        let [p, q] = [a, b].map(|v| mesh.points[v as usize]);
        let e = q - p;
        let aside = if lines.tagged[h as usize] {
            [a, b].map(tangent).map(|t| if t == DVec3::ZERO { t } else { e - t * e.dot(t) })
        } else {
            [h, next(h)].map(normal).map(|n| n * e.dot(n))
        };
        let way = (aside[1] - aside[0]) / 8.0;
        let is_bent = way.length() >= least.max(LEAST_BEND * e.length());
        let is_kink = aside.iter().any(|x| x.length() > KINK_COSINE * e.length());
        (is_bent && !is_kink).then(|| Split { ends: (a, b), at: (p + q) / 2.0 + way })
    };
    let mut found: Vec<Split> = (0..3 * mesh.triangles.len() as u32).into_par_iter().filter_map(bend).collect();
    found.sort_unstable_by_key(|s| s.ends);
    found
}

/// Angle of a face at the origin of its half-edge `h`.
fn corner_angle(mesh: &TriMesh, h: u32) -> f64 {
    let [p, a, b] = [h, next(h), previous(h)].map(|h| mesh.points[mesh.origin(h) as usize]);
    (a - p).angle_between(b - p)
}

/// A mesh with split edges.
struct Refined {
    mesh: TriMesh,
    /// The face that each face is a part of.
    parent: Vec<u32>,
}

impl Refined {
    fn new(mesh: &TriMesh, splits: &[Split]) -> Refined {
        let first = mesh.points.len() as u32;
        let mut points = mesh.points.clone();
        points.extend(splits.iter().map(|s| s.at));
        let middle = |a: u32, b: u32| {
            splits.binary_search_by_key(&lesser_first((a, b)), |s| s.ends).ok().map(|k| first + k as u32)
        };
        let (mut triangles, mut parent) = (Vec::with_capacity(mesh.triangles.len()), Vec::new());
        for (t, &[a, b, c]) in mesh.triangles.iter().enumerate() {
            let corners = [a, b, c];
            let middles = [middle(a, b), middle(b, c), middle(c, a)];
            // Turned so that the edges that are split come first.
            let turn = |k: usize| -> [u32; 3] { std::array::from_fn(|i| corners[(i + k) % 3]) };
            let pieces = match middles {
                [None, None, None] => vec![corners],
                [Some(m), None, None] => halves(turn(0), m),
                [None, Some(m), None] => halves(turn(1), m),
                [None, None, Some(m)] => halves(turn(2), m),
                [Some(m), Some(n), None] => thirds(&points, turn(0), [m, n]),
                [None, Some(m), Some(n)] => thirds(&points, turn(1), [m, n]),
                [Some(n), None, Some(m)] => thirds(&points, turn(2), [m, n]),
                [Some(m), Some(n), Some(o)] => vec![[a, m, o], [m, b, n], [o, n, c], [m, n, o]],
            };
            parent.extend(pieces.iter().map(|_| t as u32));
            triangles.extend(pieces);
        }
        let mut attributes = mesh.attributes.clone();
        for attribute in &mut attributes {
            let width = attribute.width;
            for s in splits {
                let [a, b] = [s.ends.0, s.ends.1].map(|v| v as usize * width);
                (0..width)
                    .for_each(|k| attribute.values.push((attribute.values[a + k] + attribute.values[b + k]) / 2.0));
            }
        }
        Refined { mesh: TriMesh { points, triangles, attributes }, parent }
    }

    /// True if a face is not a whole one of `mesh`.
    fn is_piece(&self, mesh: &TriMesh, t: u32) -> bool {
        self.mesh.triangles[t as usize] != mesh.triangles[self.parent[t as usize] as usize]
    }

    /// The faces of `mesh` that have a piece which looks elsewhere.
    fn turned(&self, mesh: &TriMesh) -> Vec<u32> {
        let is_turned = |t: &usize| {
            let parent = self.parent[*t];
            self.is_piece(mesh, *t as u32) && self.mesh.normal(*t).dot(mesh.normal(parent as usize)) < PIECE_TURN_COSINE
        };
        (0..self.parent.len()).into_par_iter().filter(is_turned).map(|t| self.parent[t]).collect()
    }
}

/// A triangle whose first edge has a middle.
fn halves([a, b, c]: [u32; 3], m: u32) -> Vec<[u32; 3]> {
    vec![[a, m, c], [m, b, c]]
}

/// A triangle whose first two edges have a middle; the shorter diagonal parts what is left.
fn thirds(points: &[DVec3], [a, b, c]: [u32; 3], [m, n]: [u32; 2]) -> Vec<[u32; 3]> {
    let length = |i: u32, j: u32| points[i as usize].distance_squared(points[j as usize]);
    let rest = if length(a, n) < length(m, c) { [[a, m, n], [a, n, c]] } else { [[a, m, c], [m, n, c]] };
    vec![[m, b, n], rest[0], rest[1]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Adjacency, NONE, self_intersections};
    use crate::synthetic::shapes;

    #[test]
    fn the_edges_of_a_coarse_tube_and_its_rims_are_split_onto_it() {
        // A tube of radius 1, 24 corners around, with flat ends: cells as in the bore of a casting's scan.
        let (count, rows, high) = (24u32, 5u32, 0.26);
        let angle = |k: u32| 2.0 * std::f64::consts::PI * f64::from(k) / f64::from(count);
        let ring = |z: f64, r: f64| (0..count).map(move |k| DVec3::new(r * angle(k).cos(), r * angle(k).sin(), z));
        let mut points: Vec<DVec3> = (0..rows).flat_map(|i| ring(high * f64::from(i), 1.0)).collect();
        let top = high * f64::from(rows - 1);
        points.extend([DVec3::ZERO, DVec3::Z * top]);
        let mut triangles = Vec::new();
        for k in 0..count {
            let l = (k + 1) % count;
            for i in 0..rows - 1 {
                let [a, b, c, d] = [i * count + k, i * count + l, (i + 1) * count + k, (i + 1) * count + l];
                triangles.extend([[a, b, d], [a, d, c]]);
            }
            let last = (rows - 1) * count;
            triangles.extend([[rows * count, l, k], [rows * count + 1, last + k, last + l]]);
        }
        let rims = [0, rows - 1]
            .into_iter()
            .flat_map(|i| (0..count).map(move |k| [i * count + k, i * count + (k + 1) % count]));
        let mut mesh = TriMesh::new(points, triangles);
        let mut tags = FeatureTags::from_edges(mesh.points.len(), rims);
        let split = split_bent(&mut mesh, &mut tags, 1e-3, &crate::Silent).unwrap();
        // All edges around and across the rows are split, those along the axis and in the flat ends are not.
        assert_eq!(split, (count * rows + count * (rows - 1)) as usize);
        let off = |p: &DVec3| (p.truncate().length() - 1.0).abs();
        let worst = mesh.points.iter().filter(|p| p.truncate().length() > 0.5).map(off).fold(0.0, f64::max);
        assert!(worst < 2e-4, "{worst}");
        assert_eq!(tags, FeatureTags::from_edges(mesh.points.len(), tags.edges.clone()));
        assert_eq!(tags.edges.len(), 4 * count as usize);
        assert!(Adjacency::new(&mesh).opposite.iter().all(|&h| h != NONE));
        // What is flat enough stays as it is.
        assert_eq!(split_bent(&mut mesh, &mut tags, 1e-2, &crate::Silent).unwrap(), 0);
    }

    #[test]
    fn an_edge_of_a_ball_stays_where_the_way_outwards_meets_a_plate() {
        let ball = shapes::sphere(1.0, 1);
        let edges = 3 * ball.triangles.len() / 2;
        let [a, b, _] = ball.corners(0);
        let (middle, along) = ((a + b) / 2.0, (b - a).normalize());
        let (out, across) = (middle.normalize(), middle.normalize().cross(along));
        let corner = |x: f64, y: f64| (middle.length() + 1.0) / 2.0 * out + 0.25 * (x * along + y * across);
        let mut mesh = ball.clone();
        let first = mesh.points.len() as u32;
        mesh.points.extend([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
        mesh.triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t: [u32; 3]| t.map(|v| first + v)));
        let mut tags = FeatureTags::from_edges(mesh.points.len(), []);
        let split = split_bent(&mut mesh, &mut tags, 1e-3, &crate::Silent).unwrap();
        // All but those of the two faces there.
        assert_eq!(split, edges - 5);
        assert_eq!(self_intersections(&mesh), Vec::<[u32; 2]>::new());
    }

    #[test]
    fn a_box_stays_as_it_is() {
        let mut mesh = shapes::cuboid(DVec3::ONE, 4);
        let before = mesh.clone();
        let sharp = crate::mesh::sharp_edges(&mesh, &Adjacency::new(&mesh), 40.0);
        let edges = (0..sharp.len() as u32).filter(|&h| sharp[h as usize]);
        let mut tags =
            FeatureTags::from_edges(mesh.points.len(), edges.map(|h| [mesh.origin(h), mesh.origin(next(h))]));
        assert_eq!(split_bent(&mut mesh, &mut tags, 1e-9, &crate::Silent).unwrap(), 0);
        assert_eq!(mesh, before);
    }
}
