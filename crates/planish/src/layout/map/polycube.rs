//! Made meshes whose seamless map is known: surfaces of unions of voxels, flat pieces of voxels, tori.
//!
//! Each side of a voxel is cut into `fine` x `fine` squares of two triangles each. The chart of a triangle is the lattice
//! of its plane, in units of those squares, so every number of a map is a whole one, or a multiple of 2^-6 once shaken.

use super::{SeamlessMap, quarter_turn};
use crate::geom::random;
use crate::mesh::{Adjacency, NONE, TriMesh};
use glam::{DVec2, DVec3};
use std::collections::HashMap;

/// A mesh with its map, and its lines.
pub(in crate::layout) struct Charted {
    pub mesh: TriMesh,
    pub adjacency: Adjacency,
    pub map: SeamlessMap,
    /// For each half-edge whether it lies on an edge of the solid or on the boundary.
    pub lines: Vec<bool>,
    /// Sides of voxels that are covered.
    pub sides: usize,
}

/// A corner of a small square: its name in space, its position and its place in the chart.
type Spot = ([i32; 3], DVec3, DVec2);

/// Surface of a union of voxels, which must meet in whole sides wherever they meet in an edge or a corner.
pub(in crate::layout) fn solid(voxels: &[[i32; 3]], fine: i32) -> Charted {
    let mut squares = Vec::new();
    let mut sides = 0;
    for voxel in voxels {
        for (axis, out) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
            let mut beyond = *voxel;
            beyond[axis] += 2 * out - 1;
            if voxels.contains(&beyond) {
                continue;
            }
            sides += 1;
            // Axes of the chart, so that their cross product points outwards.
            let (b, c) = if out == 1 { ((axis + 1) % 3, (axis + 2) % 3) } else { ((axis + 2) % 3, (axis + 1) % 3) };
            for (i, j) in (0..fine).flat_map(|i| (0..fine).map(move |j| (i, j))) {
                squares.push([(0, 0), (1, 0), (1, 1), (0, 1)].map(|(di, dj)| {
                    let mut at = voxel.map(|x| x * fine);
                    at[axis] += out * fine;
                    at[b] += i + di;
                    at[c] += j + dj;
                    let position = DVec3::from(at.map(f64::from)) / f64::from(fine);
                    (at, position, DVec2::new(f64::from(at[b]), f64::from(at[c])))
                }));
            }
        }
    }
    charted(&squares, sides)
}

/// A box of `size` voxels.
pub(in crate::layout) fn cuboid(size: [i32; 3]) -> Vec<[i32; 3]> {
    let [x, y, z] = size.map(|n| 0..n);
    x.flat_map(|i| y.clone().map(move |j| (i, j))).flat_map(|(i, j)| z.clone().map(move |k| [i, j, k])).collect()
}

/// A union of `count` voxels grown at random, whose surface is a manifold.
pub(in crate::layout) fn random_union(seed: u64, count: usize) -> Vec<[i32; 3]> {
    let mut voxels = vec![[0, 0, 0]];
    let mut draws = (0u64..).map(|n| random::bits(seed, n));
    while voxels.len() < count {
        let mut draw = |below: u64| draws.next().map_or(0, |bits| (bits % below) as usize);
        let mut grown = voxels[draw(voxels.len() as u64)];
        grown[draw(3)] += if draw(2) == 0 { 1 } else { -1 };
        if voxels.contains(&grown) {
            continue;
        }
        voxels.push(grown);
        if !is_manifold(&solid(&voxels, 1)) {
            voxels.pop();
        }
    }
    voxels
}

/// Whether each edge has two triangles and the triangles around each vertex are one fan.
fn is_manifold(made: &Charted) -> bool {
    let mut around = vec![0; made.mesh.points.len()];
    made.mesh.triangles.iter().flatten().for_each(|&v| around[v as usize] += 1);
    let fan = |v: usize| made.adjacency.fan(v as u32).count();
    !made.adjacency.opposite.contains(&NONE) && (0..around.len()).all(|v| fan(v) == around[v])
}

/// A piece of the plane made of unit squares, with a boundary.
pub(in crate::layout) fn flat(cells: &[[i32; 2]], fine: i32) -> Charted {
    let mut squares = Vec::new();
    for cell in cells {
        for (i, j) in (0..fine).flat_map(|i| (0..fine).map(move |j| (i, j))) {
            squares.push([(0, 0), (1, 0), (1, 1), (0, 1)].map(|(di, dj)| {
                let at = [cell[0] * fine + i + di, cell[1] * fine + j + dj];
                let uv = DVec2::new(f64::from(at[0]), f64::from(at[1]));
                ([at[0], at[1], 0], (uv / f64::from(fine)).extend(0.0), uv)
            }));
        }
    }
    charted(&squares, cells.len())
}

/// A rectangle of `around` x `across` unit squares whose opposite sides are glued, without a line.
pub(in crate::layout) fn torus(around: i32, across: i32, fine: i32) -> Charted {
    let (m, n) = (around * fine, across * fine);
    let mut squares = Vec::new();
    for (i, j) in (0..m).flat_map(|i| (0..n).map(move |j| (i, j))) {
        squares.push([(0, 0), (1, 0), (1, 1), (0, 1)].map(|(di, dj)| {
            let (x, y) = (i + di, j + dj);
            let turn = |k: i32, of: i32| f64::from(k) / f64::from(of) * std::f64::consts::TAU;
            let (a, b) = (turn(x, m), turn(y, n));
            let position = DVec3::new((3.0 + b.cos()) * a.cos(), (3.0 + b.cos()) * a.sin(), b.sin());
            ([x % m, y % n, 0], position, DVec2::new(f64::from(x), f64::from(y)))
        }));
    }
    charted(&squares, (around * across) as usize)
}

/// Two triangles a square, with corners of one name joined; the jumps follow from the charts.
fn charted(squares: &[[Spot; 4]], sides: usize) -> Charted {
    let (mut points, mut triangles, mut uv) = (Vec::new(), Vec::new(), Vec::new());
    let mut named: HashMap<[i32; 3], u32> = HashMap::new();
    for (n, square) in squares.iter().enumerate() {
        let vertex = square.map(|(name, position, _)| {
            *named.entry(name).or_insert_with(|| {
                points.push(position);
                points.len() as u32 - 1
            })
        });
        // Diagonals both ways, so that no direction is favoured.
        let cut = if n % 3 == 0 { [[0, 1, 2], [0, 2, 3]] } else { [[0, 1, 3], [1, 2, 3]] };
        for corners in cut {
            triangles.push(corners.map(|k| vertex[k]));
            uv.push(corners.map(|k: usize| square[k].2));
        }
    }
    let mesh = TriMesh::new(points, triangles);
    let adjacency = Adjacency::new(&mesh);
    let edge = |h: usize| -> DVec2 { uv[h / 3][(h % 3 + 1) % 3] - uv[h / 3][h % 3] };
    let jump_of = |h: usize| match adjacency.opposite[h] {
        NONE => 0,
        o => (0..4).find(|&j| quarter_turn(edge(h), j) == -edge(o as usize)).expect("charts fit along edges"),
    };
    let jump: Vec<u8> = (0..3 * mesh.triangles.len()).map(jump_of).collect();
    let lines = (0..jump.len()).map(|h| match adjacency.opposite[h] {
        NONE => true,
        o => mesh.normal(h / 3).dot(mesh.normal(o as usize / 3)) < 0.5,
    });
    let lines = lines.collect();
    Charted { map: SeamlessMap { uv, jump }, lines, adjacency, mesh, sides }
}

impl Charted {
    /// Moves the vertices that lie inside a plane by up to a quarter of a small square, in space and in the map.
    pub(in crate::layout) fn shaken(mut self, seed: u64) -> Charted {
        for v in 0..self.mesh.points.len() as u32 {
            let around: Vec<u32> = self.adjacency.fan(v).collect();
            let first = self.mesh.normal(around[0] as usize / 3);
            let plane = |&h: &u32| self.map.jump[h as usize] == 0 && self.mesh.normal(h as usize / 3).dot(first) > 0.9;
            if self.adjacency.is_boundary_vertex(v) || !around.iter().all(plane) {
                continue;
            }
            let step = |k: u64| ((random::unit(seed, 2 * u64::from(v) + k) - 0.5) * 32.0).round() / 64.0;
            let shift = DVec2::new(step(0), step(1));
            let [a, b, c] = [0, 1, 2].map(|k| {
                let (t, i) = (around[0] as usize / 3, around[0] as usize % 3);
                (self.map.uv[t][(i + k) % 3], self.mesh.points[self.mesh.triangles[t][(i + k) % 3] as usize])
            });
            let (p, q) = (b.0 - a.0, c.0 - a.0);
            let (x, y) = (shift.perp_dot(q) / p.perp_dot(q), p.perp_dot(shift) / p.perp_dot(q));
            self.mesh.points[v as usize] += (b.1 - a.1) * x + (c.1 - a.1) * y;
            for h in around {
                self.map.uv[h as usize / 3][h as usize % 3] += shift;
            }
        }
        self
    }

    /// The same stretched in the map: `x` becomes `x + x² / 256` along each axis of the lattice, so that equal sides of voxels
    /// are no longer equal.
    pub(in crate::layout) fn stretched(mut self) -> Charted {
        for p in self.map.uv.iter_mut().flatten() {
            *p += *p * *p / 256.0;
        }
        self
    }

    /// The same with charts of their own: each turned by quarters and shifted, all of another scale, so that nothing is exact
    /// any more.
    pub(in crate::layout) fn recharted(mut self, seed: u64) -> Charted {
        let turns = |t: usize| (random::bits(seed, t as u64) % 4) as u8;
        for (t, corners) in self.map.uv.iter_mut().enumerate() {
            let shift = DVec2::new(random::unit(seed + 1, t as u64), random::unit(seed + 2, t as u64));
            *corners = corners.map(|p| (quarter_turn(p, turns(t)) + shift) / 3.0);
        }
        for h in 0..self.map.jump.len() {
            let o = self.adjacency.opposite[h];
            if o != NONE {
                self.map.jump[h] = (self.map.jump[h] + turns(o as usize / 3) + 4 - turns(h / 3)) % 4;
            }
        }
        self
    }

    /// The same with its triangles in another order, each begun at another corner.
    pub(in crate::layout) fn reordered(&self, seed: u64) -> Charted {
        let mut order: Vec<usize> = (0..self.mesh.triangles.len()).collect();
        order.sort_by_key(|&t| random::bits(seed, t as u64));
        let turned = |t: usize| [0, 1, 2].map(|k| (k + t) % 3);
        let triangles = order.iter().map(|&t| turned(t).map(|k| self.mesh.triangles[t][k])).collect();
        let uv = order.iter().map(|&t| turned(t).map(|k| self.map.uv[t][k])).collect();
        let halves: Vec<usize> = order.iter().flat_map(|&t| turned(t).map(|k| 3 * t + k)).collect();
        let mesh = TriMesh::new(self.mesh.points.clone(), triangles);
        Charted {
            adjacency: Adjacency::new(&mesh),
            mesh,
            map: SeamlessMap { uv, jump: halves.iter().map(|&h| self.map.jump[h]).collect() },
            lines: halves.iter().map(|&h| self.lines[h]).collect(),
            sides: self.sides,
        }
    }

    /// The mesh and the map beside those of `other`, as another component.
    pub(in crate::layout) fn beside(mut self, other: &Charted) -> Charted {
        let start = self.mesh.points.len() as u32;
        let right = DVec3::X * (self.mesh.bounds().max.x - other.mesh.bounds().min.x + 1.0);
        self.mesh.points.extend(other.mesh.points.iter().map(|&p| p + right));
        self.mesh.triangles.extend(other.mesh.triangles.iter().map(|t| t.map(|v| v + start)));
        self.map.uv.extend(&other.map.uv);
        self.map.jump.extend(&other.map.jump);
        self.lines.extend(&other.lines);
        Charted { adjacency: Adjacency::new(&self.mesh), sides: self.sides + other.sides, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quarter turns around each inner vertex, modulo 4.
    fn turns(made: &Charted) -> Vec<u8> {
        let count = made.mesh.points.len() as u32;
        let inner = (0..count).filter(|&v| !made.adjacency.is_boundary_vertex(v));
        inner.map(|v| made.adjacency.fan(v).map(|h| made.map.jump[h as usize]).sum::<u8>() % 4).collect()
    }

    fn area(made: &Charted) -> f64 {
        made.map.uv.iter().map(|[a, b, c]| (*b - *a).perp_dot(*c - *a) / 2.0).sum()
    }

    #[test]
    fn a_cube_has_8_cones_a_torus_none_and_each_side_of_a_voxel_has_fine_squared_units_of_area() {
        let cube = solid(&cuboid([1, 1, 1]), 4);
        assert_eq!((cube.sides, turns(&cube).iter().filter(|&&t| t != 0).count()), (6, 8));
        assert_eq!(area(&cube), 6.0 * 16.0);
        assert_eq!(cube.lines.iter().filter(|&&l| l).count(), 2 * 12 * 4);
        let ring = torus(3, 2, 4);
        assert_eq!((area(&ring), turns(&ring).iter().any(|&t| t != 0)), (6.0 * 16.0, false));
        assert_eq!(ring.lines.iter().filter(|&&l| l).count(), 0);
        let corner = flat(&[[0, 0], [1, 0], [0, 1]], 4);
        for seed in 0..4 {
            assert!(is_manifold(&solid(&random_union(seed, 20), 1)));
        }
        assert!(!is_manifold(&solid(&[[0, 0, 0], [1, 1, 0]], 1)));
        assert_eq!((area(&corner), corner.lines.iter().filter(|&&l| l).count()), (3.0 * 16.0, 8 * 4));
    }

    #[test]
    fn shaking_and_reordering_keep_the_seams_and_every_triangle_counter_clockwise() {
        let made = solid(&cuboid([1, 2, 3]), 4).beside(&torus(2, 1, 5)).shaken(3).reordered(7);
        assert_eq!(made.sides, 22 + 2);
        assert_eq!(area(&made), 22.0 * 16.0 + 2.0 * 25.0);
        let edge = |h: u32| {
            made.map.uv[h as usize / 3][(h as usize % 3 + 1) % 3] - made.map.uv[h as usize / 3][h as usize % 3]
        };
        for h in 0..made.map.jump.len() as u32 {
            assert_eq!(quarter_turn(edge(h), made.map.jump[h as usize]), -edge(made.adjacency.opposite[h as usize]));
        }
        assert!(made.map.uv.iter().all(|[a, b, c]| (*b - *a).perp_dot(*c - *a) > 0.0));
    }
}
