//! Sharp lines of the mesh of a scan: what is around them, and between them (`docs/methods/sharp.md`).

use crate::mesh::{Adjacency, FeatureTags, NONE, TriMesh, next};
use glam::DVec3;
use rayon::prelude::*;

/// A face that turns away from a normal by more than 60 degrees (cosine) is on another side.
const FACING_COSINE: f64 = 0.5;

/// A mesh with its sharp lines.
pub(super) struct Lines<'a> {
    pub mesh: &'a TriMesh,
    pub adjacency: Adjacency,
    /// Half-edges on lines.
    pub tagged: Vec<bool>,
    /// Vertices on lines.
    pub on_line: Vec<bool>,
    /// Middles of the faces.
    pub centers: Vec<DVec3>,
    /// Unit normals of the faces times their areas.
    pub areas: Vec<DVec3>,
}

/// Marks of the faces that a search has seen.
pub(super) struct Seen {
    mark: Vec<u32>,
    round: u32,
}

impl Seen {
    pub fn new(faces: usize) -> Seen {
        Seen { mark: vec![0; faces], round: 0 }
    }

    fn insert(&mut self, face: u32) -> bool {
        std::mem::replace(&mut self.mark[face as usize], self.round) != self.round
    }
}

impl Lines<'_> {
    /// The lines that `tags` mark.
    pub fn new<'a>(mesh: &'a TriMesh, tags: &FeatureTags) -> Lines<'a> {
        let faces = 0..mesh.triangles.len();
        let center = |t: usize| mesh.corners(t).into_iter().sum::<DVec3>() / 3.0;
        let mut lines = Lines {
            mesh,
            adjacency: Adjacency::new(mesh),
            tagged: Vec::new(),
            on_line: Vec::new(),
            centers: faces.clone().into_par_iter().map(center).collect(),
            areas: faces.into_par_iter().map(|t| mesh.area_vector(t) / 2.0).collect(),
        };
        lines.mark(tags);
        lines
    }

    /// Makes what `tags` mark the lines.
    pub fn mark(&mut self, tags: &FeatureTags) {
        self.tagged = tags.on(self.mesh);
        self.on_line = vec![false; self.mesh.points.len()];
        tags.edges.iter().flatten().for_each(|&v| self.on_line[v as usize] = true);
    }

    /// The faces around `v` between its lines, sector by sector.
    pub fn sectors(&self, v: u32) -> Vec<Vec<u32>> {
        let fan: Vec<u32> = self.adjacency.fan(v).collect();
        let start = fan.iter().position(|&h| self.tagged[h as usize]).unwrap_or(0);
        let mut sectors: Vec<Vec<u32>> = Vec::new();
        for i in 0..fan.len() {
            let h = fan[(start + i) % fan.len()];
            match sectors.last_mut() {
                Some(last) if !self.tagged[h as usize] => last.push(h / 3),
                _ => sectors.push(vec![h / 3]),
            }
        }
        sectors
    }

    /// The faces around `v`.
    pub fn star(&self, v: u32) -> Vec<u32> {
        self.adjacency.fan(v).map(|h| h / 3).collect()
    }

    /// Faces joined with those of `sector` not across a line, as far as they are welcome; `sector` first.
    pub fn grow(&self, sector: &[u32], seen: &mut Seen, welcome: impl Fn(u32) -> bool) -> Vec<u32> {
        seen.round += 1;
        let mut faces = sector.to_vec();
        faces.iter().for_each(|&f| _ = seen.insert(f));
        let mut at = 0;
        while at < faces.len() {
            for h in 3 * faces[at]..3 * faces[at] + 3 {
                let o = self.adjacency.opposite[h as usize];
                if o != NONE && !self.tagged[h as usize] && seen.insert(o / 3) && welcome(o / 3) {
                    faces.push(o / 3);
                }
            }
            at += 1;
        }
        faces
    }

    /// True if a face looks the way of `normal`.
    pub fn is_facing(&self, face: u32, normal: DVec3) -> bool {
        let area = self.areas[face as usize];
        area.dot(normal) > FACING_COSINE * area.length()
    }

    /// The half-edges on lines that leave `v`.
    fn leaving(&self, v: u32) -> impl Iterator<Item = u32> {
        self.adjacency.fan(v).filter(|&h| self.tagged[h as usize])
    }

    /// The vertices of a line that begins with half-edge `h`, behind its first, until it is `length` long, ends, or meets others.
    fn onwards(&self, mut h: u32, length: f64) -> Vec<u32> {
        let from = self.mesh.origin(h);
        let mut found = Vec::new();
        let mut run = 0.0;
        loop {
            let [a, b] = [self.mesh.origin(h), self.mesh.origin(next(h))];
            found.push(b);
            run += self.mesh.points[a as usize].distance(self.mesh.points[b as usize]);
            let mut on = self.leaving(b).filter(|&o| self.mesh.origin(next(o)) != a);
            match (on.next(), on.next()) {
                (Some(o), None) if run < length && b != from => h = o,
                _ => return found,
            }
        }
    }

    /// The vertices of the lines around `v`, each line followed for `length`; `v` is one.
    pub fn around(&self, v: u32, length: f64) -> Vec<u32> {
        std::iter::once(v).chain(self.leaving(v).flat_map(|h| self.onwards(h, length))).collect()
    }

    /// The line's direction at `v`, `length` long each way; at a corner that of one line.
    pub fn direction(&self, v: u32, length: f64) -> Option<DVec3> {
        let at = |v: u32| self.mesh.points[v as usize];
        let mut ends = self.leaving(v).filter_map(|h| self.onwards(h, length).last().map(|&end| at(end)));
        match (ends.next(), ends.next(), ends.next()) {
            (Some(a), Some(b), None) => Some(b - a),
            (Some(a), ..) => Some(a - at(v)),
            _ => None,
        }
    }
}
