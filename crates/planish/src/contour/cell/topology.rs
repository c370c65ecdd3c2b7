//! What the trilinear interpolant does inside a cell whose boundary shows more than one loop.
//!
//! Loops are usually spanned by one disk each; two may be joined by a tunnel instead. The Euler number of the part of
//! the cell below the level tells which: by Morse theory on the cell (a stratified space), it is the sum over corners
//! that are least among their neighbours, saddles of faces that rise inwards (-1 each), and saddles inside, each if it
//! lies below the level. The patches then have the Euler number 2 X(below) - X(boundary below), which falls two short
//! of the number of loops for a tunnel. (The tables of Chernyaev 1995 and Grosso 2016 answer the same question by
//! cases.)

use super::FACES;
use crate::linalg::eigen3;
use glam::DVec3;

/// The trilinear interpolant of a cell over the unit cube; `f[c]` at corner `c`.
pub struct Trilinear {
    f: [f64; 8],
    /// f = c0 + cx x + cy y + cz z + cxy xy + cyz yz + czx zx + cxyz xyz
    c: [f64; 8],
}

impl Trilinear {
    /// From the values at the corners.
    pub fn new(f: [f64; 8]) -> Trilinear {
        let c0 = f[0];
        let (cx, cy, cz) = (f[1] - c0, f[2] - c0, f[4] - c0);
        let cxy = f[3] - c0 - cx - cy;
        let cyz = f[6] - c0 - cy - cz;
        let czx = f[5] - c0 - cx - cz;
        let cxyz = f[7] - c0 - cx - cy - cz - cxy - cyz - czx;
        Trilinear { f, c: [c0, cx, cy, cz, cxy, cyz, czx, cxyz] }
    }

    /// Value at `p` in the unit cube.
    pub fn value(&self, p: DVec3) -> f64 {
        let [c0, cx, cy, cz, cxy, cyz, czx, cxyz] = self.c;
        let DVec3 { x, y, z } = p;
        c0 + cx * x + cy * y + cz * z + cxy * x * y + cyz * y * z + czx * z * x + cxyz * x * y * z
    }

    /// Gradient at `p`.
    pub fn gradient(&self, p: DVec3) -> DVec3 {
        let [_, cx, cy, cz, cxy, cyz, czx, cxyz] = self.c;
        let DVec3 { x, y, z } = p;
        DVec3::new(
            cx + cxy * y + czx * z + cxyz * y * z,
            cy + cxy * x + cyz * z + cxyz * z * x,
            cz + cyz * y + czx * x + cxyz * x * y,
        )
    }

    /// Euler number of the part of the cell below zero.
    pub fn euler_below(&self) -> i32 {
        let f = &self.f;
        let mut euler = 0;
        for c in 0..8 {
            let least = [1, 2, 4].iter().all(|&bit| f[c] < f[c ^ bit]);
            euler += (f[c] < 0.0 && least) as i32;
        }
        for face in 0..6 {
            if let Some(p) = self.face_saddle(face) {
                let mut inward = DVec3::ZERO;
                inward[face / 2] = if face % 2 == 0 { 1.0 } else { -1.0 };
                if self.value(p) < 0.0 && self.gradient(p).dot(inward) > 0.0 {
                    euler -= 1;
                }
            }
        }
        for p in self.saddles() {
            if self.value(p) < 0.0 {
                euler += self.sign_of_saddle(p);
            }
        }
        euler
    }

    /// +1 for a saddle with an even number of falling directions, -1 with an odd one: the sign of the determinant of
    /// the Hessian, whose diagonal is zero.
    fn sign_of_saddle(&self, p: DVec3) -> i32 {
        let [_, _, _, _, cxy, cyz, czx, cxyz] = self.c;
        let (xy, yz, zx) = (cxy + cxyz * p.z, cyz + cxyz * p.x, czx + cxyz * p.y);
        if xy * yz * zx > 0.0 { 1 } else { -1 }
    }

    /// The saddle of the bilinear interpolant of a face, if it lies inside the face.
    fn face_saddle(&self, face: usize) -> Option<DVec3> {
        // Corners around the face: 0, 1, 2, 3.
        let c = FACES[face];
        let [a, b, d, e] = c.map(|c| self.f[c]);
        let bend = a + d - b - e;
        // In the coordinates along 0 -> 1 and 0 -> 3.
        let (s, t) = ((a - e) / bend, (a - b) / bend);
        let inside = |x: f64| x > 0.0 && x < 1.0;
        if !(inside(s) && inside(t)) {
            return None;
        }
        let at = |c: usize| DVec3::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2 & 1) as f64);
        let o = at(c[0]);
        Some(o + (at(c[1]) - o) * s + (at(c[3]) - o) * t)
    }

    /// Critical points inside the cell, at most two.
    pub fn saddles(&self) -> Vec<DVec3> {
        let [_, cx, cy, cz, cxy, cyz, czx, cxyz] = self.c;
        let scale = self.f.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let mut found = Vec::new();
        if cxyz.abs() > NO_CUBIC_TERM * scale {
            // With X = cxyz x + cyz and so on, grad f = 0 reads Y Z = A, Z X = B, X Y = C.
            let (a, b, c) = (cxy * czx - cx * cxyz, cxy * cyz - cy * cxyz, cyz * czx - cz * cxyz);
            let product = a * b * c;
            if product > 0.0 {
                let root = product.sqrt();
                for sign in [1.0, -1.0] {
                    let (x, y, z) = (sign * root / a, sign * root / b, sign * root / c);
                    found.push(DVec3::new((x - cyz) / cxyz, (y - czx) / cxyz, (z - cxy) / cxyz));
                }
            }
        } else {
            // A quadratic: its gradient is linear.
            let m =
                glam::DMat3::from_cols(DVec3::new(0.0, cxy, czx), DVec3::new(cxy, 0.0, cyz), DVec3::new(czx, cyz, 0.0));
            let det = m.determinant();
            if det.abs() > (NO_CUBIC_TERM * scale).powi(3) {
                found.push(m.inverse() * -DVec3::new(cx, cy, cz));
            }
        }
        found.retain(|p| p.cmpgt(DVec3::ZERO).all() && p.cmplt(DVec3::ONE).all());
        found
    }

    /// Two corners, on the same side of the level but in different regions of the boundary, that a path inside the cell
    /// joins over a saddle: where following the value away from the level from the saddle leads both ways.
    pub fn joined_corners(&self, region: &[usize; 8]) -> Option<[usize; 2]> {
        for saddle in self.saddles() {
            let sign = if self.value(saddle) < 0.0 { -1.0 } else { 1.0 };
            let [_, _, _, _, cxy, cyz, czx, cxyz] = self.c;
            let (xy, yz, zx) = (cxy + cxyz * saddle.z, cyz + cxyz * saddle.x, czx + cxyz * saddle.y);
            let hessian =
                glam::DMat3::from_cols(DVec3::new(0.0, xy, zx), DVec3::new(xy, 0.0, yz), DVec3::new(zx, yz, 0.0));
            let (values, vectors) = eigen3(hessian);
            // Directions in which the value goes away from the level: one for a saddle that joins.
            let away: Vec<usize> = (0..3).filter(|&k| values[k] * sign > 0.0).collect();
            let [one] = away[..] else { continue };
            let ends = [1.0, -1.0].map(|way| self.climb(saddle + vectors[one] * way * SADDLE_START, sign));
            if region[ends[0]] != region[ends[1]] {
                return Some(ends);
            }
        }
        None
    }

    /// The corner of the cell that is reached by following the value away from the level.
    fn climb(&self, mut p: DVec3, sign: f64) -> usize {
        for _ in 0..MOST_SADDLE_STEPS {
            let mut g = self.gradient(p) * sign;
            // On the boundary only along it.
            for k in 0..3 {
                if (p[k] <= 0.0 && g[k] < 0.0) || (p[k] >= 1.0 && g[k] > 0.0) {
                    g[k] = 0.0;
                }
            }
            let g = g.normalize_or_zero();
            if g == DVec3::ZERO {
                break;
            }
            p = (p + g * SADDLE_STEP).clamp(DVec3::ZERO, DVec3::ONE);
        }
        (p.x > 0.5) as usize | ((p.y > 0.5) as usize) << 1 | ((p.z > 0.5) as usize) << 2
    }
}

/// The cubic term counts as none below this fraction of the values.
const NO_CUBIC_TERM: f64 = 1e-12;
/// Length of the first step from a saddle and of the others, of the cell.
const SADDLE_START: f64 = 1e-3;
const SADDLE_STEP: f64 = 0.01;
/// Steps until a corner is reached for sure: a path across the cell is a few edges long.
const MOST_SADDLE_STEPS: usize = 600;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opposite_corners_below_are_two_pieces_or_one_by_the_value_in_the_middle() {
        let mut f = [1.0; 8];
        (f[0], f[7]) = (-0.5, -0.5);
        assert_eq!(Trilinear::new(f).euler_below(), 2);
        (f[0], f[7]) = (-9.0, -9.0);
        let t = Trilinear::new(f);
        // Joined through the middle, and free space is a ring around.
        assert!(t.value(DVec3::splat(0.5)) < 0.0);
        assert_eq!(t.euler_below(), 1);
    }

    #[test]
    fn euler_number_agrees_with_counting_on_a_fine_grid_for_300_random_cells() {
        for n in 0..300u64 {
            let f = std::array::from_fn(|c| crate::geom::random::unit(5, 8 * n + c as u64) - 0.5);
            let t = Trilinear::new(f);
            assert_eq!(t.euler_below(), counted(&t), "{n}: {f:?}");
        }
    }

    /// Euler number of the union of small cubes below: those whose middle is below, as a cubical complex.
    fn counted(t: &Trilinear) -> i32 {
        const N: usize = 48;
        let below = |x: isize, y: isize, z: isize| {
            let inside = |v: isize| v >= 0 && v < N as isize;
            let at = |v: isize| v as f64 / (N - 1) as f64;
            inside(x) && inside(y) && inside(z) && t.value(DVec3::new(at(x), at(y), at(z))) < 0.0
        };
        // Nodes as cubes, joined through faces only: vertices - edges + squares - cubes of the grid of nodes.
        let mut euler = 0;
        for z in 0..N as isize {
            for y in 0..N as isize {
                for x in 0..N as isize {
                    let b = |dx: isize, dy: isize, dz: isize| below(x + dx, y + dy, z + dz);
                    if !b(0, 0, 0) {
                        continue;
                    }
                    euler += 1;
                    euler -= b(1, 0, 0) as i32 + b(0, 1, 0) as i32 + b(0, 0, 1) as i32;
                    euler += (b(1, 0, 0) && b(0, 1, 0) && b(1, 1, 0)) as i32;
                    euler += (b(1, 0, 0) && b(0, 0, 1) && b(1, 0, 1)) as i32;
                    euler += (b(0, 1, 0) && b(0, 0, 1) && b(0, 1, 1)) as i32;
                    let all = (0..8).all(|c: isize| b(c & 1, c >> 1 & 1, c >> 2 & 1));
                    euler -= all as i32;
                }
            }
        }
        euler
    }
}
