//! Meshes of bricks become one.
//!
//! Neighbours have the same triangles where they meet, but for rounding and for what the sharp lines of one were moved by that the
//! other did not see. So vertices on the cuts are matched by place, and where a cut edge then has no partner the triangles around
//! are taken out and the hole is closed as one of the mesh.

use crate::mend::{close_around, part_fans};
use crate::mesh::{Adjacency, FeatureKind, FeatureTags, MeshParts, NONE, TriMesh, boundary_loops, next};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::{HashMap, HashSet};

/// Vertices on both sides of a cut are one if they are closer than so many cells.
const SAME_VERTEX_CELLS: f64 = 0.3;
/// Rings of triangles around a fault that its lid is made among.
const LID_RINGS: usize = 3;
/// Rounds of that: a hole that no lid fits on is made a ring wider.
const MEND_ROUNDS: usize = 6;

/// What a brick keeps of its mesh.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Piece {
    mesh: TriMesh,
    tags: FeatureTags,
    /// Edges of its triangles beyond which the mesh went on, in their direction.
    cut: Vec<[u32; 2]>,
    /// Distance of raw points, and the face of the piece that is closest; none where that was not kept.
    reached: Vec<(f64, u32)>,
}

impl Piece {
    /// The triangles that are kept.
    pub(super) fn cut(mesh: TriMesh, tags: FeatureTags, kept: &[bool], reached: &[(f64, u32)]) -> Piece {
        let cut = cut_edges(&mesh, kept);
        let faces: Vec<u32> = (0..kept.len() as u32).filter(|&t| kept[t as usize]).collect();
        let part = MeshParts::new(&mesh, &tags).part(&faces);
        let named = |whole: usize, names: &mut dyn Iterator<Item = usize>| {
            let mut own = vec![u32::MAX; whole];
            names.enumerate().for_each(|(new, old)| own[old] = new as u32);
            own
        };
        let face = named(kept.len(), &mut faces.iter().map(|&t| t as usize));
        let vertex = named(mesh.points.len(), &mut part.vertices.iter().map(|&v| v as usize));
        let reached = reached.iter().filter(|r| kept[r.1 as usize]).map(|r| (r.0, face[r.1 as usize]));
        Piece {
            reached: reached.collect(),
            cut: cut.iter().map(|e| e.map(|v| vertex[v as usize])).collect(),
            mesh: part.mesh,
            tags: part.tags,
        }
    }
}

/// The half-edges of what is kept beyond which there was a triangle that is not.
fn cut_edges(mesh: &TriMesh, kept: &[bool]) -> Vec<[u32; 2]> {
    let adjacency = Adjacency::new(mesh);
    let beyond = |h: u32| adjacency.opposite[h as usize];
    (0..3 * mesh.triangles.len() as u32)
        .filter(|&h| kept[h as usize / 3] && beyond(h) != NONE && !kept[beyond(h) as usize / 3])
        .map(|h| [mesh.origin(h), mesh.origin(next(h))])
        .collect()
}

/// The whole.
pub(super) struct Welded {
    pub mesh: TriMesh,
    pub tags: FeatureTags,
    /// As of [`Piece`].
    pub reached: Vec<(f64, u32)>,
}

/// Pieces on their way to be one.
pub(super) struct Welder {
    cell: f64,
    mesh: TriMesh,
    tags: FeatureTags,
    reached: Vec<(f64, u32)>,
    /// Vertices on cuts by the box of space that they lie in, as wide as they may be apart.
    near: HashMap<[i64; 3], Vec<u32>>,
    cut: Vec<[u32; 2]>,
}

impl Welder {
    /// * `cell` - size of the cells of all pieces
    pub(super) fn new(cell: f64) -> Welder {
        let mesh = TriMesh::new(Vec::new(), Vec::new());
        let tags = FeatureTags::default();
        Welder { cell, mesh, tags, reached: Vec::new(), near: HashMap::new(), cut: Vec::new() }
    }

    /// Adds a piece.
    pub(super) fn add(&mut self, piece: Piece) {
        let mut on_cut: Vec<u32> = piece.cut.iter().flatten().copied().collect();
        on_cut.sort_unstable();
        on_cut.dedup();
        let mut name = vec![u32::MAX; piece.mesh.points.len()];
        for (v, known) in self.matches(&on_cut, &piece.mesh.points) {
            name[v as usize] = known;
        }
        for (v, p) in piece.mesh.points.iter().enumerate() {
            let kind = piece.tags.vertices[v];
            if name[v] == u32::MAX {
                name[v] = self.mesh.points.len() as u32;
                self.mesh.points.push(*p);
                self.tags.vertices.push(kind);
            } else {
                let known = &mut self.tags.vertices[name[v] as usize];
                if *known == FeatureKind::None || kind == FeatureKind::Corner {
                    *known = kind;
                }
            }
        }
        for &v in &on_cut {
            let place = self.place(piece.mesh.points[v as usize]);
            let there = self.near.entry(place).or_default();
            if !there.contains(&name[v as usize]) {
                there.push(name[v as usize]);
            }
        }
        let named = |e: &[u32; 2]| e.map(|v| name[v as usize]);
        let first = self.mesh.triangles.len() as u32;
        self.mesh.triangles.extend(piece.mesh.triangles.iter().map(|t| t.map(|v| name[v as usize])));
        self.cut.extend(piece.cut.iter().map(named));
        self.reached.extend(piece.reached.iter().map(|r| (r.0, first + r.1)));
        self.tags.edges.extend(piece.tags.edges.iter().map(named).map(|[a, b]| [a.min(b), a.max(b)]));
    }

    fn place(&self, p: DVec3) -> [i64; 3] {
        (p / (SAME_VERTEX_CELLS * self.cell)).floor().to_array().map(|x| x as i64)
    }

    /// Which vertices of a piece are known, each at most once: the closest first.
    fn matches(&self, on_cut: &[u32], points: &[DVec3]) -> Vec<(u32, u32)> {
        let mut pairs: Vec<(f64, u32, u32)> = Vec::new();
        for &v in on_cut {
            let p = points[v as usize];
            let at = self.place(p);
            for n in 0..27i64 {
                let beside = [at[0] + n % 3 - 1, at[1] + n / 3 % 3 - 1, at[2] + n / 9 - 1];
                let there = self.near.get(&beside).into_iter().flatten();
                pairs.extend(there.map(|&w| (p.distance(self.mesh.points[w as usize]), v, w)));
            }
        }
        pairs.retain(|pair| pair.0 < SAME_VERTEX_CELLS * self.cell);
        pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let (mut named, mut taken) = (HashSet::new(), HashSet::new());
        pairs.retain(|&(_, v, w)| !named.contains(&v) && !taken.contains(&w) && named.insert(v) && taken.insert(w));
        pairs.into_iter().map(|(_, v, w)| (v, w)).collect()
    }

    /// The whole, with all faults mended that can be.
    pub(super) fn finish(mut self) -> Welded {
        let mut faulty = self.faulty();
        let is_mended = !faulty.is_empty();
        for _ in 0..MEND_ROUNDS {
            if faulty.is_empty() {
                break;
            }
            faulty = self.mend(&faulty);
        }
        if is_mended {
            let mut used = vec![false; self.mesh.points.len()];
            self.mesh.triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
            self.tags.keep(&mut self.mesh, &used);
        }
        self.tags.edges.sort_unstable();
        self.tags.edges.dedup();
        Welded { mesh: self.mesh, tags: self.tags, reached: self.reached }
    }

    /// Vertices of cut edges that have not exactly one partner.
    fn faulty(&self) -> HashSet<u32> {
        let mut count: HashMap<[u32; 2], u32> = HashMap::new();
        self.cut.iter().for_each(|&e| *count.entry(e).or_insert(0) += 1);
        let alone = |&&[a, b]: &&[u32; 2]| a == b || count[&[a, b]] != 1 || count.get(&[b, a]).is_none_or(|&n| n != 1);
        self.cut.iter().filter(alone).flatten().copied().collect()
    }

    /// Takes out the triangles around faults and closes the holes. Returns the vertices of those that could not be closed.
    fn mend(&mut self, faulty: &HashSet<u32>) -> HashSet<u32> {
        let triangles = &self.mesh.triangles;
        let gone: Vec<bool> = triangles
            .iter()
            .map(|t| t.iter().any(|v| faulty.contains(v)) || t[0] == t[1] || t[1] == t[2] || t[2] == t[0])
            .collect();
        // What is left around, with names of its own.
        let mut around: HashSet<u32> = HashSet::new();
        triangles.iter().zip(&gone).filter(|t| *t.1).for_each(|(t, _)| around.extend(t));
        let rim = around.clone();
        for _ in 0..LID_RINGS {
            let more: Vec<u32> =
                triangles.iter().filter(|t| t.iter().any(|v| around.contains(v))).flatten().copied().collect();
            around.extend(more);
        }
        let mut names: Vec<u32> = around.into_iter().collect();
        names.sort_unstable();
        let own: HashMap<u32, u32> = names.iter().enumerate().map(|(k, &v)| (v, k as u32)).collect();
        let near: Vec<bool> = triangles.iter().map(|t| t.iter().all(|v| own.contains_key(v))).collect();
        let part: Vec<[u32; 3]> = triangles
            .iter()
            .zip(near.iter().zip(&gone))
            .filter(|(_, (near, gone))| **near && !**gone)
            .map(|(t, _)| t.map(|v| own[&v]))
            .collect();
        let points = names.iter().map(|&v| self.mesh.points[v as usize]).collect();
        let (mut part, source) = part_fans(&TriMesh::new(points, part));
        let kinds = source.iter().map(|&v| self.tags.vertices[names[v as usize] as usize]).collect();
        let mut tags = FeatureTags { vertices: kinds, edges: Vec::new() };
        let is_rim = |v: u32| source.get(v as usize).is_some_and(|&s| rim.contains(&names[s as usize]));
        close_around(&mut part, &mut tags, is_rim);
        // Fans are parted at the hole alone: elsewhere the whole holds them together.
        let is_apart = |v: u32| rim.contains(&v);
        let fresh = self.replace(&near, &names, (&source, &is_apart), &part);
        let left =
            boundary_loops(&Adjacency::new(&part)).into_iter().map(|around| around.into_iter().map(|h| part.origin(h)));
        left.filter(|around| around.clone().all(is_rim)).flatten().map(|v| fresh[v as usize]).collect()
    }

    /// Puts a mended part in the place of the triangles that it was made of. Returns the names of its vertices.
    /// * `names` - the vertices of the whole that it had
    /// * `fans` - of each of its vertices the one of these, and whether one of the whole is more than one now if several have it
    fn replace(
        &mut self,
        near: &[bool],
        names: &[u32],
        fans: (&[u32], &dyn Fn(u32) -> bool),
        part: &TriMesh,
    ) -> Vec<u32> {
        let (source, is_apart) = fans;
        let mut place = vec![u32::MAX; near.len()];
        let mut triangles = Vec::with_capacity(near.len());
        for (t, corners) in self.mesh.triangles.iter().enumerate().filter(|(t, _)| !near[*t]) {
            place[t] = triangles.len() as u32;
            triangles.push(*corners);
        }
        let mut used = HashSet::new();
        let fresh: Vec<u32> = (0..part.points.len())
            .map(|v| {
                let known =
                    source.get(v).map(|&s| names[s as usize]).filter(|&known| used.insert(known) || !is_apart(known));
                known.unwrap_or_else(|| {
                    self.mesh.points.push(part.points[v]);
                    self.tags.vertices.push(FeatureKind::None);
                    self.mesh.points.len() as u32 - 1
                })
            })
            .collect();
        triangles.extend(part.triangles.iter().map(|t| t.map(|v| fresh[v as usize])));
        self.mesh.triangles = triangles;
        self.reached.retain_mut(|r| {
            r.1 = place[r.1 as usize];
            r.1 != u32::MAX
        });
        let sides: HashSet<[u32; 2]> = part
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|e| e.map(|v| fresh[v as usize]))
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        let inside: HashSet<u32> = names.iter().copied().collect();
        self.tags.edges.retain(|e| !e.iter().all(|v| inside.contains(v)) || sides.contains(e));
        fresh
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::random;
    use crate::mesh::diagnose;
    use crate::synthetic::shapes;

    /// The half of a ball on one side of the plane x = 0, where a share of the edges near it was turned and its vertices were moved
    /// by a share of their length.
    fn half(side: f64, share: f64) -> Piece {
        let mut mesh = shapes::sphere(1.0, 5);
        let near = |mesh: &TriMesh, v: u32| mesh.points[v as usize].x.abs() < 0.1;
        let length = mesh.mean_edge();
        let mut draw = 0;
        let mut drawn = || {
            draw += 1;
            random::unit(5, draw)
        };
        for v in 0..mesh.points.len() as u32 {
            let by = DVec3::new(drawn(), drawn(), drawn()) - 0.5;
            if near(&mesh, v) {
                mesh.points[v as usize] += share * length * by;
            }
        }
        let adjacency = Adjacency::new(&mesh);
        let mut taken = HashSet::new();
        for h in 0..3 * mesh.triangles.len() as u32 {
            let o = adjacency.opposite[h as usize];
            let quad = [h / 3, o / 3];
            if h < o && near(&mesh, mesh.origin(h)) && drawn() < share && quad.iter().all(|t| !taken.contains(t)) {
                let apex = |h: u32| mesh.origin(next(next(h)));
                let (a, b, c, d) = (mesh.origin(h), mesh.origin(o), apex(h), apex(o));
                [mesh.triangles[quad[0] as usize], mesh.triangles[quad[1] as usize]] = [[c, a, d], [d, b, c]];
                taken.extend(quad);
            }
        }
        let kept: Vec<bool> = (0..mesh.triangles.len())
            .map(|t| side * mesh.corners(t).iter().sum::<DVec3>().x >= if side > 0.0 { 0.0 } else { f64::MIN_POSITIVE })
            .collect();
        let tags = FeatureTags::from_edges(mesh.points.len(), []);
        Piece::cut(mesh, tags, &kept, &[])
    }

    fn welded(share: f64) -> Welded {
        let mut welder = Welder::new(shapes::sphere(1.0, 5).mean_edge());
        welder.add(half(1.0, 0.0));
        welder.add(half(-1.0, share));
        welder.finish()
    }

    #[test]
    fn halves_of_a_ball_with_the_same_triangles_become_the_ball() {
        let (ball, made) = (shapes::sphere(1.0, 5), welded(0.0).mesh);
        assert_eq!((made.points.len(), made.triangles.len()), (ball.points.len(), ball.triangles.len()));
        assert!(diagnose(&made).watertight);
    }

    #[test]
    fn halves_whose_vertices_and_edges_differ_beside_the_cut_become_one_closed_ball() {
        for share in [0.02, 0.1, 0.3] {
            let made = welded(share);
            let facts = diagnose(&made.mesh);
            assert!(facts.watertight && facts.manifold && facts.genus == Some(0), "{share}: {facts:?}");
            assert!((facts.volume.unwrap() / 4.18879 - 1.0).abs() < 0.005, "{share}: {:?}", facts.volume);
        }
    }
}
