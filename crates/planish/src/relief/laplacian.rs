//! The Laplacian of a mesh of patches by cotangents, element by element.
//!
//! Pinkall and Polthier 1993, *Computing Discrete Minimal Surfaces and Their Conjugates*, for the weights.

use super::PatchedMesh;
use crate::linalg::SparseCholesky;
use crate::observe::{Cancelled, Observer};
use glam::DVec3;

/// Least thickness of a triangle against its length, for its cotangents.
const THINNEST: f64 = 1e-3;
/// Least mass of a vertex against the mean: vertices of collapsed cells have none of their own.
const LEAST_MASS: f64 = 1e-9;

/// `(i, j, w)`: the energy `w (x_i - x_j)^2` between two vertices.
pub type Bond = (u32, u32, f64);

/// Half a triangle of a cell: each cell is parted along both diagonals, and both parts count by halves; with one of them
/// masses would depend on which.
pub struct Element {
    /// Its vertices; two of them may be one.
    pub vertices: [u32; 3],
    /// Of each vertex.
    pub mass: f64,
    /// Of the edges opposite to the vertices.
    stiffness: [f64; 3],
}

impl Element {
    fn new(points: &[DVec3], vertices: [u32; 3]) -> Element {
        let [a, b, c] = vertices.map(|v| points[v as usize]);
        let double = (b - a).cross(c - a).length();
        // Slivers would have cotangents without end: here they are at least a thousandth as thick as they are long.
        let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
        let area = double.max(THINNEST * longest);
        let stiffness = |p: DVec3, q: DVec3, r: DVec3| if area > 0.0 { (q - p).dot(r - p) / area / 4.0 } else { 0.0 };
        Element {
            vertices,
            mass: double / 12.0,
            stiffness: [stiffness(a, b, c), stiffness(b, c, a), stiffness(c, a, b)],
        }
    }

    /// Of its edges.
    pub fn bonds(&self) -> impl Iterator<Item = Bond> {
        let edges = (0..3).map(|k| (self.vertices[(k + 1) % 3], self.vertices[(k + 2) % 3], self.stiffness[k]));
        edges.filter(|&(i, j, w)| i != j && w != 0.0)
    }
}

/// The elements of all cells.
pub fn elements(base: &PatchedMesh) -> impl Iterator<Item = Element> {
    base.patches.iter().flat_map(move |patch| {
        let cols = patch.cols;
        let cells = (0..patch.rows - 1).flat_map(move |j| (0..cols - 1).map(move |i| j * cols + i));
        cells.flat_map(move |cell| {
            let [a, b, c, d] = [cell, cell + 1, cell + cols + 1, cell + cols].map(|n| patch.vertices[n]);
            [[a, b, c], [a, c, d], [a, b, d], [b, c, d]].map(|t| Element::new(&base.mesh.points, t))
        })
    })
}

/// Gives masses that are none the least that counts as one.
pub fn give_least_mass(mass: &mut [f64]) {
    let mean = mass.iter().sum::<f64>() / mass.len().max(1) as f64;
    mass.iter_mut().for_each(|m| *m = m.max(LEAST_MASS * mean));
}

/// `M + t L` with masses and bonds, `t` in squares of length, factored.
///
/// * `rows` - of each vertex; `u32::MAX` for those whose values are given
/// # Errors
/// [`Cancelled`].
pub fn smoother(
    mass: &[f64],
    bonds: &[Bond],
    rows: &[u32],
    time: f64,
    observer: &dyn Observer,
) -> Result<SparseCholesky, Cancelled> {
    let row = |v: usize| (rows[v] != u32::MAX).then_some(rows[v] as usize);
    let masses = mass.iter().enumerate().filter_map(|(v, &m)| row(v).map(|k| (k, k, m)));
    let mut lower: Vec<(usize, usize, f64)> = masses.collect();
    let size = lower.len();
    for &(i, j, w) in bonds {
        let [i, j] = [i, j].map(|v| row(v as usize));
        lower.extend([i, j].into_iter().flatten().map(|k| (k, k, w * time)));
        if let (Some(i), Some(j)) = (i, j) {
            lower.push((i.max(j), i.min(j), -w * time));
        }
    }
    let factored = SparseCholesky::factor_watched(size, lower, &|| observer.cancelled()).ok_or(Cancelled)?;
    // Masses above 0 and a matrix that is never negative: it is positive.
    Ok(factored.expect("a mass matrix with a Laplacian is positive definite"))
}
