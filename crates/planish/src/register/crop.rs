//! A plane's side of a shape. Triangles are cut along the plane (Sutherland and Hodgman, *Reentrant Polygon Clipping*, 1974),
//! and the new vertices of an edge are one for both of its triangles, so that no crack opens.

use crate::cloud::Cloud;
use crate::mesh::{FeatureTags, TriMesh};
use glam::DVec3;
use std::collections::BTreeMap;

/// The side of a plane: places `p` with `normal . p >= offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Direction into the side; of any length.
    pub normal: DVec3,
    /// Where the plane lies: `normal . p` of its points.
    pub offset: f64,
}

impl HalfSpace {
    /// The six sides whose common part is a box.
    pub fn of_box(min: DVec3, max: DVec3) -> [HalfSpace; 6] {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        std::array::from_fn(|k| {
            let (axis, sign) = (axes[k / 2], if k % 2 == 0 { 1.0 } else { -1.0 });
            let bound = if k % 2 == 0 { min } else { max };
            HalfSpace { normal: axis * sign, offset: sign * bound.dot(axis) }
        })
    }

    fn height(&self, p: DVec3) -> f64 {
        self.normal.dot(p) - self.offset
    }
}

/// The points of a scan on this side, in their order.
pub fn crop_cloud(cloud: &Cloud, side: &HalfSpace) -> Cloud {
    let ids: Vec<u32> =
        (0..cloud.points.len() as u32).filter(|&i| side.height(cloud.points[i as usize]) >= 0.0).collect();
    cloud.select(&ids)
}

/// The part of a mesh on this side, cut exactly at the plane; it is open there. Attributes of new vertices lie between those
/// of the ends of their edges; tagged edges are cut with it.
pub fn crop_mesh(mesh: &TriMesh, tags: Option<&FeatureTags>, side: &HalfSpace) -> (TriMesh, Option<FeatureTags>) {
    let heights = mesh.points.iter().map(|p| side.height(*p)).collect();
    let mut cut = Cut { heights, mesh, out: Vec::new() };
    let mut fresh = BTreeMap::new();
    let mut triangles = Vec::new();
    for t in &mesh.triangles {
        let mut polygon: Vec<u32> = Vec::with_capacity(4);
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            if cut.is_in(a) {
                polygon.push(cut.kept(&mut fresh, a));
            }
            if cut.crosses(a, b) {
                polygon.push(cut.between(&mut fresh, a, b));
            }
        }
        triangles.extend((1..polygon.len().saturating_sub(1)).map(|k| [polygon[0], polygon[k], polygon[k + 1]]));
    }
    // An end that lies on the plane itself makes triangles of two vertices.
    triangles.retain(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]);
    let tags = tags.map(|tags| {
        let mut edges = Vec::new();
        for &[a, b] in &tags.edges {
            let mut ends: Vec<u32> =
                [a, b].into_iter().filter(|&v| cut.is_in(v)).filter_map(|v| fresh.get(&[v, v]).copied()).collect();
            ends.extend(fresh.get(&[a.min(b), a.max(b)]).copied().filter(|_| cut.crosses(a, b)));
            if let [x, y] = ends[..] {
                edges.push([x, y]);
            }
        }
        FeatureTags::from_edges(cut.out.len(), edges)
    });
    (cut.finish(triangles), tags)
}

struct Cut<'a> {
    mesh: &'a TriMesh,
    heights: Vec<f64>,
    /// For each new vertex the two old ones that it lies between (twice the same for one that stays), and how far.
    out: Vec<(u32, u32, f64)>,
}

impl Cut<'_> {
    fn is_in(&self, v: u32) -> bool {
        self.heights[v as usize] >= 0.0
    }

    fn crosses(&self, a: u32, b: u32) -> bool {
        // An end on the plane is in: what leaves there has its cut at that end, which is kept already.
        self.is_in(a) != self.is_in(b) && self.heights[a as usize] != 0.0 && self.heights[b as usize] != 0.0
    }

    fn kept(&mut self, fresh: &mut BTreeMap<[u32; 2], u32>, v: u32) -> u32 {
        *fresh.entry([v, v]).or_insert_with(|| {
            self.out.push((v, v, 0.0));
            self.out.len() as u32 - 1
        })
    }

    fn between(&mut self, fresh: &mut BTreeMap<[u32; 2], u32>, a: u32, b: u32) -> u32 {
        let (a, b) = (a.min(b), a.max(b));
        *fresh.entry([a, b]).or_insert_with(|| {
            let (x, y) = (self.heights[a as usize], self.heights[b as usize]);
            self.out.push((a, b, x / (x - y)));
            self.out.len() as u32 - 1
        })
    }

    fn finish(self, triangles: Vec<[u32; 3]>) -> TriMesh {
        let points = &self.mesh.points;
        let place = |&(a, b, t): &(u32, u32, f64)| {
            if a == b { points[a as usize] } else { points[a as usize].lerp(points[b as usize], t) }
        };
        let mut mesh = TriMesh::new(self.out.iter().map(place).collect(), triangles);
        mesh.attributes = self.mesh.attributes.clone();
        for attribute in &mut mesh.attributes {
            let (width, old) = (attribute.width, std::mem::take(&mut attribute.values));
            for &(a, b, t) in &self.out {
                for k in 0..width {
                    let [x, y] = [a, b].map(|v| old[v as usize * width + k]);
                    attribute.values.push(if a == b { x } else { x + (y - x) * t as f32 });
                }
            }
        }
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Adjacency, diagnose, next, sharp_edges};
    use crate::synthetic::shapes;

    #[test]
    fn a_box_cut_by_a_slanted_plane_has_the_area_of_its_part_and_one_boundary() {
        let mesh = shapes::cuboid(DVec3::new(1.0, 2.0, 3.0), 4);
        let min = mesh.bounds().min;
        // Half of the height of the sides, whose plane is no plane of vertices.
        let side = HalfSpace { normal: DVec3::new(0.0, 0.0, 2.0), offset: 2.0 * (min.z + 1.3) };
        let (cut, _) = crop_mesh(&mesh, None, &side);
        let found = diagnose(&cut);
        assert!((found.area - (2.0 + 2.0 * 1.7 * 3.0)).abs() < 1e-12, "{}", found.area);
        assert_eq!((found.boundary_loops, found.components, found.manifold), (1, 1, true));
        // The two parts are the whole, also where the plane goes through vertices.
        for offset in [0.0, 0.25, 1e-9] {
            let plane = HalfSpace { normal: DVec3::new(0.3, 1.0, 0.2), offset };
            let other = HalfSpace { normal: -plane.normal, offset: -offset };
            let area = |side: &HalfSpace| diagnose(&crop_mesh(&mesh, None, side).0).area;
            assert!((area(&plane) + area(&other) - 22.0).abs() < 1e-9, "{offset}");
        }
    }

    #[test]
    fn a_box_of_a_box_keeps_what_lies_in_both_with_its_sharp_edges() {
        let mesh = shapes::cuboid(DVec3::ONE, 4);
        let tags = FeatureTags::from_edges(
            mesh.points.len(),
            sharp_edges(&mesh, &Adjacency::new(&mesh), 30.0)
                .into_iter()
                .enumerate()
                .filter(|(_, sharp)| *sharp)
                .map(|(h, _)| [mesh.origin(h as u32), mesh.origin(next(h as u32))]),
        );
        let min = mesh.bounds().min;
        let (mut cut, mut kept) = (mesh.clone(), Some(tags));
        for side in HalfSpace::of_box(min - 1.0, min + 0.6) {
            (cut, kept) = crop_mesh(&cut, kept.as_ref(), &side);
        }
        assert!((diagnose(&cut).area - 3.0 * 0.36).abs() < 1e-12);
        // Three edges of the corner, of .25, .25 and .1 each.
        let kept = kept.unwrap();
        let length: f64 =
            kept.edges.iter().map(|e| cut.points[e[0] as usize].distance(cut.points[e[1] as usize])).sum();
        assert!((length - 1.8).abs() < 1e-12, "{length}");
        let cloud = Cloud::new(mesh.points.clone());
        let left = crop_cloud(&cloud, &HalfSpace { normal: DVec3::X, offset: min.x + 0.7 });
        assert!(left.points.iter().all(|p| p.x >= min.x + 0.7) && left.points.len() == 16 + 25);
    }
}
