//! The flanks of sharp lines: the surface on each side, estimated from as wide a neighbourhood as is consistent.
//!
//! [GN97] A. Goldenshluger, A. Nemirovski, *On spatially adaptive estimation of nonparametric regression*, 1997: among
//! estimates from nested windows the most precise one is taken with which all less precise ones agree as far as their
//! noise allows. Where a flank goes on straight the window grows to ten cells; where it bends it stays small, and no
//! threshold has to know which.
//!
//! A flank is a polynomial over its tangent plane: a plane, one that bends along the line, or a quadric.

use super::{Adjacency, FeatureTags, NONE, TriMesh, next};
use crate::linalg::solve_dense;
use glam::DVec3;
use rayon::prelude::*;

/// Widths of the windows, in cells.
const RADII: [f64; 5] = [2.0, 3.0, 4.5, 6.75, 10.0];
/// Terms of the polynomials among `1, x, y, y², x², xy` with `y` along the line: a plane, one that bends along the line, and a
/// quadric.
const MODELS: [usize; 3] = [3, 4, 6];
/// A window must stand for so many points of the scan.
const FEWEST: f64 = 8.0;
/// Standard deviations within which estimates agree. Less follows the noise, more rounds off what bends: of 0.7 to 3 this kept
/// most angles at noise of .1 and .25 % of the diagonal.
const AGREE: f64 = 1.4;
/// Least share of an estimate's own variance that counts as that of its difference to a more precise one.
const SHARED: f64 = 0.25;
/// A first normal comes from within so many cells.
const NEAR: f64 = 3.0;
/// A flank ends where its faces turn away from that by more than 60 degrees (cosine).
const FACING: f64 = 0.5;

/// A mesh with its sharp lines.
pub(super) struct Lines<'a> {
    pub mesh: &'a TriMesh,
    adjacency: Adjacency,
    /// Half-edges on lines.
    tagged: Vec<bool>,
    /// Vertices on lines.
    pub on_line: Vec<bool>,
    centers: Vec<DVec3>,
    /// Area vectors.
    areas: Vec<DVec3>,
}

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
    axes: [DVec3; 3],
    /// Coefficients of `1, x, y, y², x², xy`.
    terms: [f64; 6],
    /// Variance of the slope across the line.
    pub variance: f64,
    /// Faces around the vertex on this side.
    pub sector: Vec<u32>,
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
        let mut on_line = vec![false; mesh.points.len()];
        tags.edges.iter().flatten().for_each(|&v| on_line[v as usize] = true);
        let faces = 0..mesh.triangles.len();
        let center = |t: usize| mesh.corners(t).into_iter().sum::<DVec3>() / 3.0;
        Lines {
            mesh,
            adjacency: Adjacency::new(mesh),
            tagged: tags.on(mesh),
            on_line,
            centers: faces.clone().into_par_iter().map(center).collect(),
            areas: faces.into_par_iter().map(|t| mesh.area_vector(t)).collect(),
        }
    }

    /// The faces around `v` between its lines, sector by sector.
    fn sectors(&self, v: u32) -> Vec<Vec<u32>> {
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

    /// True if a face looks the way of `flank`.
    pub fn is_facing(&self, face: u32, flank: &Flank) -> bool {
        self.faces(face, flank.axes[2])
    }

    fn faces(&self, face: u32, normal: DVec3) -> bool {
        let area = self.areas[face as usize];
        area.dot(normal) > FACING * area.length()
    }

    /// The flanks of every vertex on a line that parts its surroundings, in the order of the vertices; none where one of them
    /// is not known.
    pub fn flanks(&self, scale: &ScanScale) -> Vec<(u32, Vec<Flank>)> {
        let vertices: Vec<u32> = (0..self.on_line.len() as u32).filter(|&v| self.on_line[v as usize]).collect();
        let found = vertices.into_par_iter().map_init(
            || Seen::new(self.mesh.triangles.len()),
            |seen, v| {
                if self.adjacency.is_boundary_vertex(v) {
                    return None;
                }
                let sectors = self.sectors(v);
                let along = self.direction(v, scale.cell)?;
                let flanks: Option<Vec<Flank>> =
                    sectors.into_iter().map(|sector| self.flank(v, sector, along, scale, seen)).collect();
                flanks.filter(|f| f.len() > 1).map(|flanks| (v, flanks))
            },
        );
        found.flatten().collect()
    }

    /// The line's direction at `v`, over [`NEAR`] cells; at a corner that of one line.
    fn direction(&self, v: u32, cell: f64) -> Option<DVec3> {
        let mut ends = self.tagged_from(v).map(|h| self.follow(h, NEAR * cell));
        match (ends.next(), ends.next(), ends.next()) {
            (Some(a), Some(b), None) => Some(b - a),
            (Some(a), ..) => Some(a - self.mesh.points[v as usize]),
            _ => None,
        }
    }

    fn tagged_from(&self, v: u32) -> impl Iterator<Item = u32> {
        self.adjacency.fan(v).filter(|&h| self.tagged[h as usize])
    }

    /// Where a line that begins with half-edge `h` is after `length`, or where it ends or meets others.
    fn follow(&self, mut h: u32, length: f64) -> DVec3 {
        let from = self.mesh.origin(h);
        let mut run = 0.0;
        loop {
            let [a, b] = [self.mesh.origin(h), self.mesh.origin(next(h))];
            let end = self.mesh.points[b as usize];
            run += self.mesh.points[a as usize].distance(end);
            let mut on = self.tagged_from(b).filter(|&o| self.mesh.origin(next(o)) != a);
            match (on.next(), on.next()) {
                (Some(o), None) if run < length && b != from => h = o,
                _ => return end,
            }
        }
    }

    fn flank(&self, v: u32, sector: Vec<u32>, along: DVec3, scale: &ScanScale, seen: &mut Seen) -> Option<Flank> {
        let at = self.mesh.points[v as usize];
        let off = |f: u32| self.centers[f as usize].distance(at);
        let near = self.grow(&sector, seen, |f| off(f) < NEAR * scale.cell);
        let outwards = near.iter().map(|&f| self.areas[f as usize]).sum::<DVec3>().try_normalize()?;
        let y = (along - outwards * outwards.dot(along)).try_normalize()?;
        let axes = [outwards.cross(y), y, outwards];
        let widest = RADII[RADII.len() - 1] * scale.cell;
        // What each window has beyond the one before.
        let mut rings: [Moments; RADII.len()] = Default::default();
        for f in self.grow(&sector, seen, |f| off(f) < widest && self.faces(f, outwards)) {
            let p = (self.centers[f as usize] - at) / scale.cell;
            let away = p.length();
            let Some(ring) = RADII.iter().position(|radius| away <= *radius) else { continue };
            // How many points of the scan a face stands for.
            let weight = self.areas[f as usize].length() / (scale.spacing * scale.spacing);
            rings[ring].add(p.dot(axes[0]), p.dot(axes[1]), p.dot(axes[2]), weight);
        }
        let mut sums = Moments::default();
        let mut found: Vec<Estimate> = Vec::new();
        for ring in &rings {
            sums.join(ring);
            if sums.matrix[0][0] >= FEWEST {
                found.extend(MODELS.iter().filter_map(|&terms| sums.fit(terms, scale.noise / scale.cell)));
            }
        }
        found.sort_by(|a, b| b.variance[1].total_cmp(&a.variance[1]));
        let best = (0..found.len()).rev().find(|&j| found[..j].iter().all(|i| found[j].agrees(i)))?;
        let Estimate { mut terms, variance } = found[best].clone();
        let s = scale.cell;
        terms.iter_mut().zip([s, 1.0, 1.0, 1.0 / s, 1.0 / s, 1.0 / s]).for_each(|(c, unit)| *c *= unit);
        Some(Flank { at, axes, terms, variance: variance[1], sector })
    }
}

/// Weighted sums of products of `1, x, y, y², x², xy`, lengths in cells.
#[derive(Default)]
struct Moments {
    matrix: [[f64; 6]; 6],
    rhs: [f64; 6],
}

impl Moments {
    fn add(&mut self, x: f64, y: f64, z: f64, weight: f64) {
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
    fn fit(&self, n: usize, noise: f64) -> Option<Estimate> {
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
struct Estimate {
    terms: [f64; 6],
    variance: [f64; 3],
}

impl Estimate {
    /// True if a less precise estimate differs by no more than its noise.
    fn agrees(&self, coarse: &Estimate) -> bool {
        (0..3).all(|k| {
            let (own, other) = (self.variance[k], coarse.variance[k]);
            (self.terms[k] - coarse.terms[k]).powi(2) <= AGREE * AGREE * (other - own).max(SHARED * other)
        })
    }
}
