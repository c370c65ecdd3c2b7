//! The flanks of sharp lines: the surface on each side, estimated from as wide a neighbourhood as is consistent (Lepski's rule).
//!
//! [GN97] A. Goldenshluger, A. Nemirovski, *On spatially adaptive estimation of nonparametric regression*, 1997: among
//! estimates from nested windows the most precise one is taken with which all less precise ones agree as far as their
//! noise allows. Where a flank goes on straight the window grows to ten cells; where it bends it stays small, and no
//! threshold has to know which. See `docs/methods/sharp.md`, step 2.
//!
//! A flank is a polynomial over its tangent plane: a plane, one that bends along the line, or a quadric.

use super::lines::{Lines, Seen};
use crate::linalg::solve_dense;
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;

/// Widths of the windows, in cells.
const WINDOW_CELLS: [f64; 5] = [2.0, 3.0, 4.5, 6.75, 10.0];
/// Terms of the polynomials among `1, x, y, y², x², xy` with `y` along the line: a plane, one that bends along the line, and a
/// quadric.
const MODELS: [usize; 3] = [3, 4, 6];
/// A window must stand for so many points of the scan: one more than a plane has terms.
const FEWEST_WINDOW_POINTS: f64 = 4.0;
/// Squared difference up to which two estimates agree, over the variance of that difference: about one standard deviation.
/// Less follows the noise, more rounds off what bends. Unbiased risk (Mallows' C_p) would have 2; decision 0016 tells what
/// that does.
const AGREE_SQUARED: f64 = 0.98;
/// Least share of an estimate's own variance that counts as that of its difference to a more precise one.
const SHARED: f64 = 0.25;
/// Estimates from beyond a rounding need this weight in their first `CLOSE_WINDOWS` windows: what is seen from afar alone may bend in between.
const CLOSE_WINDOWS: usize = 2;
const CLOSE_POINTS: f64 = 2.0;
/// Radius of the first normal and of the direction of the line, cells.
const NEAR_CELLS: f64 = 3.0;
/// What lies this near to a line, in cells, may be the rounding of an edge.
const ROUNDING_CELLS: f64 = 1.5;

/// The scales of a mesh that was made of a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScanScale {
    /// Standard deviation of the points, world units.
    pub noise: f64,
    /// Distance of neighbouring points, world units.
    pub spacing: f64,
    /// Edge of a cell of the mesh, world units.
    pub cell: f64,
}

/// One side of a line at one of its vertices.
#[derive(Clone, Debug)]
pub(super) struct Flank {
    /// The vertex.
    pub at: DVec3,
    /// Across the line, along it, and outwards.
    pub axes: [DVec3; 3],
    /// Coefficients of `1, x, y, y², x², xy`.
    terms: [f64; 6],
    /// Variance of the slope across the line.
    pub variance: f64,
    /// The surface beside the vertex as told by what is beyond [`ROUNDING_CELLS`] of lines alone; `None` if too little is.
    pub beyond: Option<Plane>,
    /// Faces around the vertex on this side.
    pub sector: Vec<u32>,
}

/// A plane beside a vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    /// Unit normal, outwards.
    pub normal: DVec3,
    /// Distance of the vertex from the plane, positive outside.
    pub off: f64,
    /// Variance of that distance.
    pub variance: f64,
}

impl Flank {
    fn place(&self, p: DVec3) -> (f64, f64, f64) {
        let d = p - self.at;
        (d.dot(self.axes[0]), d.dot(self.axes[1]), d.dot(self.axes[2]))
    }

    /// Unit normal beside `p`.
    pub fn normal(&self, p: DVec3) -> DVec3 {
        self.beside(p).1
    }

    /// Distance of `p`, to first order, positive outside, and the unit normal beside it.
    pub fn beside(&self, p: DVec3) -> (f64, DVec3) {
        let ((x, y, z), c) = (self.place(p), &self.terms);
        let (across, along) = (c[1] + 2.0 * c[4] * x + c[5] * y, c[2] + 2.0 * c[3] * y + c[5] * x);
        let normal = (self.axes[2] - self.axes[0] * across - self.axes[1] * along).normalize();
        let height = z - (c[0] + c[1] * x + c[2] * y + c[3] * y * y + c[4] * x * x + c[5] * x * y);
        (height * normal.dot(self.axes[2]), normal)
    }
}

impl Lines<'_> {
    /// The flanks of every vertex on a line that parts its surroundings, in the order of the vertices; none where one of them
    /// is not known.
    pub fn flanks(&self, scale: &ScanScale, observer: &dyn Observer) -> Result<Vec<(u32, Vec<Flank>)>, Cancelled> {
        let inside = |v: &u32| self.on_line[*v as usize] && !self.adjacency.is_boundary_vertex(*v);
        let vertices: Vec<u32> = (0..self.on_line.len() as u32).filter(inside).collect();
        let seen = || Seen::new(self.mesh.triangles.len());
        let beside = |seen: &mut Seen, &v: &u32| {
            observer.check()?;
            let at = self.mesh.points[v as usize];
            let near = |f: u32| self.centers[f as usize].distance(at) < ROUNDING_CELLS * scale.cell;
            Ok(self.sectors(v).iter().flat_map(|sector| self.grow(sector, seen, near)).collect())
        };
        let mut is_beside = vec![false; self.mesh.triangles.len()];
        let found: Result<Vec<Vec<u32>>, Cancelled> = vertices.par_iter().map_init(seen, beside).collect();
        found?.into_iter().flatten().for_each(|f| is_beside[f as usize] = true);
        let found = vertices.into_par_iter().map_init(seen, |seen, v| {
            observer.check()?;
            let Some(along) = self.direction(v, NEAR_CELLS * scale.cell) else { return Ok(None) };
            let one = |sector| self.flank((v, along), sector, scale, &is_beside, seen);
            let flanks: Option<Vec<Flank>> = self.sectors(v).into_iter().map(one).collect();
            Ok(flanks.filter(|f| f.len() > 1).map(|flanks| (v, flanks)))
        });
        Ok(found.collect::<Result<Vec<_>, Cancelled>>()?.into_iter().flatten().collect())
    }

    /// The flank beside a vertex, `v`, of a line that runs `along` there.
    fn flank(
        &self,
        (v, along): (u32, DVec3),
        sector: Vec<u32>,
        scale: &ScanScale,
        is_beside: &[bool],
        seen: &mut Seen,
    ) -> Option<Flank> {
        let at = self.mesh.points[v as usize];
        let off = |f: u32| self.centers[f as usize].distance(at);
        let near = self.grow(&sector, seen, |f| off(f) < NEAR_CELLS * scale.cell);
        let outwards = near.iter().map(|&f| self.areas[f as usize]).sum::<DVec3>().try_normalize()?;
        let y = (along - outwards * outwards.dot(along)).try_normalize()?;
        let axes = [outwards.cross(y), y, outwards];
        let widest = WINDOW_CELLS[WINDOW_CELLS.len() - 1] * scale.cell;
        // What each window has more than the one before: all, and what is beyond the rounding.
        let mut rings: [[Moments; WINDOW_CELLS.len()]; 2] = Default::default();
        for f in self.grow(&sector, seen, |f| off(f) < widest && self.is_facing(f, outwards)) {
            let p = (self.centers[f as usize] - at) / scale.cell;
            let away = p.length();
            let Some(ring) = WINDOW_CELLS.iter().position(|radius| away <= *radius) else { continue };
            // How many points of the scan a face stands for.
            let weight = self.areas[f as usize].length() / (scale.spacing * scale.spacing);
            for rings in &mut rings[..if is_beside[f as usize] { 1 } else { 2 }] {
                rings[ring].add(p.dot(axes[0]), p.dot(axes[1]), p.dot(axes[2]), weight);
            }
        }
        let noise = scale.noise / scale.cell;
        let mut beyond = best(&rings[1], noise).map(|estimate| estimate.plane(axes, scale.cell));
        // What is seen from afar alone may bend in between.
        let close: f64 = rings[1][..CLOSE_WINDOWS].iter().map(|ring| ring.matrix[0][0]).sum();
        if let Some(plane) = beyond.as_mut().filter(|_| close < CLOSE_POINTS) {
            plane.variance = f64::INFINITY;
        }
        let Estimate { mut terms, variance } = best(&rings[0], noise)?;
        let s = scale.cell;
        terms.iter_mut().zip([s, 1.0, 1.0, 1.0 / s, 1.0 / s, 1.0 / s]).for_each(|(c, unit)| *c *= unit);
        Some(Flank { at, axes, terms, variance: variance[1], beyond, sector })
    }
}

/// The most precise estimate that agrees with all less precise ones.
fn best(rings: &[Moments], noise: f64) -> Option<Estimate> {
    let mut sums = Moments::default();
    let mut found: Vec<Estimate> = Vec::new();
    for ring in rings {
        sums.join(ring);
        if sums.matrix[0][0] >= FEWEST_WINDOW_POINTS {
            found.extend(MODELS.iter().filter_map(|&terms| sums.fit(terms, noise)));
        }
    }
    found.sort_by(|a, b| b.variance[1].total_cmp(&a.variance[1]));
    let best = (0..found.len()).rev().find(|&j| found[..j].iter().all(|i| found[j].agrees(i)))?;
    Some(found.swap_remove(best))
}

/// Weighted sums of products of `1, x, y, y², x², xy`, lengths in cells.
#[derive(Default)]
pub(super) struct Moments {
    matrix: [[f64; 6]; 6],
    rhs: [f64; 6],
}

impl Moments {
    pub fn add(&mut self, x: f64, y: f64, z: f64, weight: f64) {
        let row = [1.0, x, y, y * y, x * x, x * y];
        for i in 0..6 {
            for j in 0..=i {
                self.matrix[i][j] += weight * row[i] * row[j];
            }
            self.rhs[i] += weight * row[i] * z;
        }
    }

    fn join(&mut self, other: &Moments) {
        for i in 0..6 {
            for j in 0..=i {
                self.matrix[i][j] += other.matrix[i][j];
            }
            self.rhs[i] += other.rhs[i];
        }
    }

    /// Least squares with the first `n` terms, of points with this noise.
    pub fn fit(&self, n: usize, noise: f64) -> Option<Estimate> {
        let mut matrix: Vec<f64> = Vec::with_capacity(n * n);
        let mut columns: Vec<f64> = Vec::with_capacity(4 * n);
        for i in 0..n {
            matrix.extend((0..n).map(|j| self.matrix[i.max(j)][i.min(j)]));
            columns.push(self.rhs[i]);
            columns.extend((0..3).map(|k| if i == k { 1.0 } else { 0.0 }));
        }
        if !solve_dense(&mut matrix, &mut columns, n, 4) {
            return None;
        }
        let mut terms = [0.0; 6];
        (0..n).for_each(|i| terms[i] = columns[4 * i]);
        Some(Estimate { terms, variance: [0, 1, 2].map(|k| noise * noise * columns[4 * k + k + 1].max(0.0)) })
    }
}

/// A polynomial, and the variances of its height and of its slopes across and along the line.
#[derive(Clone)]
pub(super) struct Estimate {
    terms: [f64; 6],
    variance: [f64; 3],
}

impl Estimate {
    /// The plane beside the vertex.
    /// * `axes` - of the polynomial; `cell` - its unit of length
    pub fn plane(&self, axes: [DVec3; 3], cell: f64) -> Plane {
        let normal = (axes[2] - axes[0] * self.terms[1] - axes[1] * self.terms[2]).normalize();
        let upright = cell * normal.dot(axes[2]);
        Plane { normal, off: -self.terms[0] * upright, variance: self.variance[0] * upright * upright }
    }

    /// The height at a place of the polynomial's plane, in its unit of length, and the unit normal there.
    pub fn beside(&self, x: f64, y: f64, axes: [DVec3; 3]) -> (f64, DVec3) {
        let c = &self.terms;
        let (across, along) = (c[1] + 2.0 * c[4] * x + c[5] * y, c[2] + 2.0 * c[3] * y + c[5] * x);
        let normal = (axes[2] - axes[0] * across - axes[1] * along).normalize();
        (c[0] + c[1] * x + c[2] * y + c[3] * y * y + c[4] * x * x + c[5] * x * y, normal)
    }

    /// True if a less precise estimate differs by no more than its noise.
    fn agrees(&self, coarse: &Estimate) -> bool {
        (0..3).all(|k| {
            let (own, other) = (self.variance[k], coarse.variance[k]);
            (self.terms[k] - coarse.terms[k]).powi(2) <= AGREE_SQUARED * (other - own).max(SHARED * other)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::FeatureTags;
    use crate::synthetic::shapes;
    use std::f64::consts::PI;

    #[test]
    fn variance_of_the_slope_beside_a_line_in_a_plane_is_that_of_the_points_of_a_half_disc_within_2_percent() {
        // A line across the middle of a flat sheet of fine triangles: each flank is a half disc of the widest window.
        let n = 240;
        let mesh = shapes::rectangle(2.4, 2.4, n, n);
        let middle = (mesh.bounds().min.x + mesh.bounds().max.x) / 2.0;
        let on = |v: u32| (mesh.points[v as usize].x - middle).abs() < 1e-9;
        let edges = mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let tags = FeatureTags::from_edges(mesh.points.len(), edges.filter(|&[a, b]| on(a) && on(b)));
        assert_eq!(tags.edges.len(), n);
        let lines = Lines::new(&mesh, &tags);
        let scale = ScanScale { noise: 0.01, spacing: 0.02, cell: 0.1 };
        let flanks = lines.flanks(&scale, &crate::observe::Silent).expect("nobody cancels");
        let center = mesh.bounds().center();
        let (_, beside) = (flanks.iter())
            .min_by(|a, b| a.1[0].at.distance(center).total_cmp(&b.1[0].at.distance(center)))
            .expect("a vertex in the middle of the line");
        // Second moment of a half disc across its straight side, about its own middle.
        let radius = WINDOW_CELLS[WINDOW_CELLS.len() - 1] * scale.cell;
        let moment = radius.powi(4) * (PI / 8.0 - 8.0 / (9.0 * PI));
        let expected = (scale.noise * scale.spacing).powi(2) / moment;
        for flank in beside {
            let ratio = flank.variance / expected;
            assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
        }
    }
}
