//! Polygons to triangles.
//!
//! Convex polygons become fans. Concave ones lose their ears one by one in the plane of their area vector
//! [Meisters 1975, *Polygons have ears*], so that no triangle lies outside the polygon. Polygons that cross
//! themselves have no such triangulation: what is left when no ear is found becomes a fan.

use crate::{Place, ReadError};
use glam::{DVec2, DVec3};
use planish::mesh::TriMesh;

/// Corners above which a concave polygon becomes a fan: clipping ears takes up to the cube of the corners, and
/// no modelling program writes faces like that.
const LARGEST_CLIPPED: usize = 512;

/// The largest coordinate whose squared areas (fourth powers) stay far from the largest `f64`.
const LARGEST_COORDINATE: f64 = 1e60;

/// Faces of any number of corners, one after the other.
#[derive(Default)]
pub(crate) struct Polygons {
    /// Vertex indices of all corners.
    pub corners: Vec<u32>,
    /// For each face the end of its corners; empty as long as every face is a triangle.
    ends: Vec<usize>,
    count: usize,
}

impl Polygons {
    /// Room for `faces` triangles.
    pub fn with_capacity(faces: usize) -> Polygons {
        Polygons { corners: Vec::with_capacity(3 * faces), ..Default::default() }
    }

    /// Number of faces.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Closes the face whose corners were pushed since the last call.
    pub fn close(&mut self) {
        let start = self.start(self.count);
        let size = self.corners.len() - start;
        if size != 3 && self.ends.is_empty() {
            self.ends.extend((1..=self.count).map(|f| 3 * f));
        }
        self.count += 1;
        if size != 3 || !self.ends.is_empty() {
            self.ends.push(self.corners.len());
        }
    }

    fn start(&self, face: usize) -> usize {
        match (self.ends.is_empty(), face) {
            (true, _) => 3 * face,
            (_, 0) => 0,
            _ => self.ends[face - 1],
        }
    }

    fn end(&self, face: usize) -> usize {
        if self.ends.is_empty() { 3 * face + 3 } else { self.ends[face] }
    }

    /// The faces as triangles over `points`. Triangles that name a vertex twice have neither area nor
    /// neighbours and are left out.
    /// * `place` - where face `f` stands, for messages
    pub fn triangulate(&self, points: &[DVec3], place: impl Fn(usize) -> Place) -> Result<Vec<[u32; 3]>, ReadError> {
        let mut triangles = Vec::with_capacity(self.count);
        for face in 0..self.count {
            let corners = &self.corners[self.start(face)..self.end(face)];
            if let Some(&bad) = corners.iter().find(|&&v| v as usize >= points.len()) {
                return Err(ReadError::Index { index: bad as i64, vertices: points.len(), place: place(face) });
            }
            match *corners {
                [a, b, c] => push(&mut triangles, [a, b, c]),
                _ if corners.len() < 3 => {
                    return Err(ReadError::SmallFace { corners: corners.len(), place: place(face) });
                }
                _ => cut(points, corners, &mut triangles),
            }
        }
        Ok(triangles)
    }
}

/// The finished mesh, if it is one: finite coordinates, at least one triangle.
pub(crate) fn checked(mesh: TriMesh, faces: usize) -> Result<TriMesh, ReadError> {
    for (v, p) in mesh.points.iter().enumerate() {
        for value in p.to_array() {
            if value.is_nan() || value.abs() > LARGEST_COORDINATE {
                return Err(ReadError::Coordinate { value, place: Place::Vertex(v) });
            }
        }
    }
    if mesh.triangles.is_empty() {
        return Err(ReadError::NoFaces { vertices: mesh.points.len(), faces });
    }
    Ok(mesh)
}

fn push(triangles: &mut Vec<[u32; 3]>, [a, b, c]: [u32; 3]) {
    if a != b && b != c && c != a {
        triangles.push([a, b, c]);
    }
}

/// Triangles of one polygon of four or more corners.
fn cut(points: &[DVec3], corners: &[u32], triangles: &mut Vec<[u32; 3]>) {
    let mut left: Vec<(u32, DVec2)> = corners.iter().copied().zip(flatten(points, corners)).collect();
    let turn = |a: DVec2, b: DVec2, c: DVec2| (b - a).perp_dot(c - b);
    let n = left.len();
    let convex = (0..n).all(|k| turn(left[k].1, left[(k + 1) % n].1, left[(k + 2) % n].1) >= 0.0);
    if !convex && n <= LARGEST_CLIPPED {
        let (mut k, mut tried) = (0, 0);
        while left.len() > 3 && tried < left.len() {
            let n = left.len();
            let [a, b, c] = [left[(k + n - 1) % n], left[k % n], left[(k + 1) % n]];
            let ear = turn(a.1, b.1, c.1) > 0.0
                && !left.iter().any(|&(v, p)| {
                    v != a.0
                        && v != b.0
                        && v != c.0
                        && turn(a.1, b.1, p) >= 0.0
                        && turn(b.1, c.1, p) >= 0.0
                        && turn(c.1, a.1, p) >= 0.0
                });
            if ear {
                push(triangles, [a.0, b.0, c.0]);
                left.remove(k % n);
                tried = 0;
            } else {
                k += 1;
                tried += 1;
            }
            k %= left.len();
        }
    }
    for k in 1..left.len() - 1 {
        push(triangles, [left[0].0, left[k].0, left[k + 1].0]);
    }
}

/// The corners in the plane across the polygon's area vector, counter-clockwise: the coordinate along which
/// the area vector is longest is left out.
fn flatten(points: &[DVec3], corners: &[u32]) -> Vec<DVec2> {
    let at = |k: usize| points[corners[k % corners.len()] as usize];
    let origin = at(0);
    let area: DVec3 = (0..corners.len()).map(|k| (at(k) - origin).cross(at(k + 1) - origin)).sum();
    let axis = (0..3).max_by(|&i, &j| area[i].abs().total_cmp(&area[j].abs())).unwrap_or(2);
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let sign = if area[axis] < 0.0 { -1.0 } else { 1.0 };
    (0..corners.len()).map(|k| at(k) - origin).map(|p| DVec2::new(p[i], sign * p[j])).collect()
}
