//! A chart: a patch flattened one-to-one into the unit square.
//!
//! Convex combination map (Tutte 1963, Floater 1997): the sides go to the sides of the square by arc length, every
//! inner vertex to a positively weighted mean of its neighbours, which cannot fold. Cotangent weights keep it
//! harmonic and reproduce a flat square; where they are negative they may fold a few triangles, which are then
//! mended one by one, or else the weights are clamped to positive ones, or are inverse lengths. Symmetric: one sparse Cholesky
//! serves.
//!
//! Two things break the theorem and are seen to here: an inner edge whose ends lie on one side of the square (it
//! would flatten a whole piece) is halved first, which leaves the surface as it is; and rounding, where a long
//! thin part shrinks below what `f64` resolves. Then weights that spread out the shrunken triangles (Yoshizawa,
//! Belyaev and Seidel 2004, made symmetric) and moving single vertices into the kernel of their ring follow. A needle that
//! is a hundred times as long as around stays a point all the same; no grid point ever meets it.

pub(crate) mod locate;
pub(crate) mod loosen;
pub(crate) mod walk;

use super::chart::locate::orientation;
use super::chart::loosen::loosen;
use super::{Fault, SideStops, side};
use crate::geom::tolerance;
use crate::geom::tolerance::divisor;
use crate::linalg::SparseCholesky;
use crate::mesh::{Adjacency, FacePoint, NONE, TriMesh, next};
use crate::network::PatchMesh;
use crate::observe::{Cancelled, Observer};
use glam::{DVec2, DVec3};

/// Bounds of a cotangent weight: below, the weight would no longer hold a vertex; above, the slivers of scans would
/// freeze theirs and ruin the condition of the system. They bind at angles of about 179 and 1 degrees.
const WEIGHT_RANGE: [f64; 2] = [0.02, 50.0];
/// Fraction of folded triangles up to which a map is mended vertex by vertex instead of given up: the exact
/// cotangent map folds a few obtuse triangles of a scan and is far smoother elsewhere than the clamped one.
const FEW_FOLDS: f64 = 0.02;
/// Rounds of spreading when the plain maps fold by rounding, and the exponent of the area ratio in each.
const SPREAD_ROUNDS: usize = 8;
const SPREAD_POWER: f64 = 0.5;
/// Sweeps that move vertices of folded triangles into the kernel of their ring.
const UNTANGLE_SWEEPS: usize = 50;

/// Triangles of this size in the square may be turned over: they are one place.
const UNRESOLVED: f64 = 1e-9;

/// A patch flattened into the unit square.
pub struct Chart {
    /// World positions.
    pub points: Vec<DVec3>,
    /// Triangles, counter-clockwise in the square where they are larger than a rounding error.
    pub triangles: Vec<[u32; 3]>,
    /// For each half-edge the opposite one.
    pub opposite: Vec<u32>,
    /// Place of each vertex in the square.
    pub uv: Vec<DVec2>,
    /// For each triangle the input face and the places of its three corners in it.
    pub frames: Vec<(u32, [[f64; 3]; 3])>,
    /// For each side and each of its segments the triangle there and the corner where the segment starts.
    pub rim: [Vec<(u32, u8)>; 4],
}

/// Flattens `patch`; `stops` are those of its sides, which get `counts` points along u and v.
pub fn flatten(
    input: &TriMesh,
    patch: &PatchMesh,
    stops: &SideStops,
    counts: [usize; 2],
    observer: &dyn Observer,
) -> Result<Chart, Fault> {
    let stop = || observer.check();
    let adjacency = check(patch)?;
    stop()?;
    let (mut chart, boundary) = split(input, patch, &adjacency);
    stop()?;
    let halved = chart.triangles.len() > patch.mesh.triangles.len();
    let adjacency = if halved { Adjacency::of(&chart.triangles, chart.points.len()) } else { adjacency };
    stop()?;
    for (k, rim) in chart.rim.iter_mut().enumerate() {
        for &v in &patch.sides[k][..patch.sides[k].len() - 1] {
            let h = adjacency.outgoing[v as usize];
            rim.push((h / 3, (h % 3) as u8));
        }
    }
    chart.opposite = adjacency.opposite;
    chart.uv = vec![DVec2::ZERO; chart.points.len()];
    for (k, chain) in patch.sides.iter().enumerate() {
        let points: Vec<DVec3> = chain.iter().map(|&v| patch.mesh.points[v as usize]).collect();
        for (&v, s) in chain.iter().zip(side::fractions_at(&points, counts[k % 2], &stops[k])) {
            chart.uv[v as usize] = match k {
                0 => DVec2::new(s, 0.0),
                1 => DVec2::new(1.0, s),
                2 => DVec2::new(1.0 - s, 1.0),
                _ => DVec2::new(0.0, 1.0 - s),
            };
        }
    }
    chart.solve_without_folds(&boundary, observer)?;
    let length =
        |k: usize| side::length(&patch.sides[k].iter().map(|&v| patch.mesh.points[v as usize]).collect::<Vec<_>>());
    loosen(&mut chart, &boundary, DVec2::new(length(0) + length(2), length(1) + length(3)) / 2.0);
    Ok(chart)
}

/// Looks whether the patch is a disk whose boundary is its four sides; returns its adjacency.
fn check(patch: &PatchMesh) -> Result<Adjacency, Fault> {
    let mesh = &patch.mesh;
    let n = mesh.points.len();
    if patch.origin.len() != n
        || patch.face_origin.len() != mesh.triangles.len()
        || mesh.triangles.iter().flatten().chain(patch.sides.iter().flatten()).any(|&v| v as usize >= n)
    {
        return Err(Fault::NotADisk("its arrays do not fit each other"));
    }
    if mesh.points.iter().any(|p| !p.is_finite()) {
        return Err(Fault::NotADisk("a position is not a finite number"));
    }
    let diagonal = mesh.bounds().diagonal();
    for (k, chain) in patch.sides.iter().enumerate() {
        if chain.len() < 2 || chain[chain.len() - 1] != patch.sides[(k + 1) % 4][0] {
            return Err(Fault::NotADisk("its sides do not meet at four corners"));
        }
        let points: Vec<DVec3> = chain.iter().map(|&v| mesh.points[v as usize]).collect();
        if side::length(&points) <= tolerance::length(diagonal) {
            return Err(Fault::DegenerateSide(k));
        }
    }
    let adjacency = Adjacency::new(mesh);
    let rim = adjacency.opposite.iter().filter(|&&h| h == NONE).count();
    let mut walked = 0;
    for chain in &patch.sides {
        for pair in chain.windows(2) {
            let h = adjacency.outgoing[pair[0] as usize];
            let follows = h != NONE
                && adjacency.opposite[h as usize] == NONE
                && mesh.triangles[h as usize / 3][next(h) as usize % 3] == pair[1];
            if !follows {
                return Err(Fault::NotADisk("a side does not follow its boundary counter-clockwise"));
            }
            walked += 1;
        }
    }
    if walked != rim {
        return Err(Fault::NotADisk("its four sides are not its whole boundary"));
    }
    let edges = (adjacency.opposite.len() + rim) / 2;
    if n + mesh.triangles.len() != edges + 1 {
        return Err(Fault::NotADisk("its Euler characteristic is not 1"));
    }
    Ok(adjacency)
}

/// Copies the patch, halving every inner edge whose two ends lie on one side. Returns the chart without its map and
/// for each vertex whether it lies on the boundary.
fn split(input: &TriMesh, patch: &PatchMesh, adjacency: &Adjacency) -> (Chart, Vec<bool>) {
    let mesh = &patch.mesh;
    let mut sides_of = vec![0u8; mesh.points.len()];
    for (k, chain) in patch.sides.iter().enumerate() {
        for &v in chain {
            sides_of[v as usize] |= 1 << k;
        }
    }
    let mut boundary: Vec<bool> = sides_of.iter().map(|&s| s != 0).collect();
    let mut points = mesh.points.clone();
    let corner_in_face = |t: usize, v: u32| {
        let face = patch.face_origin[t];
        place_in_face(input, patch.origin[v as usize], face, mesh.points[v as usize])
    };
    // Halved edges: half-edge -> midpoint, and the place of the midpoint.
    let mut middle = vec![NONE; adjacency.opposite.len()];
    let mut middle_places: Vec<FacePoint> = Vec::new();
    for h in 0..adjacency.opposite.len() {
        let g = adjacency.opposite[h];
        let (t, k) = (h / 3, h % 3);
        let (a, b) = (mesh.triangles[t][k], mesh.triangles[t][(k + 1) % 3]);
        if g == NONE || (g as usize) < h || sides_of[a as usize] & sides_of[b as usize] == 0 {
            continue;
        }
        let (pa, pb) = (corner_in_face(t, a), corner_in_face(t, b));
        let bary = [0, 1, 2].map(|k| (pa[k] + pb[k]) / 2.0);
        middle[h] = points.len() as u32;
        middle[g as usize] = points.len() as u32;
        points.push((mesh.points[a as usize] + mesh.points[b as usize]) / 2.0);
        middle_places.push(FacePoint { face: patch.face_origin[t], bary });
        boundary.push(false);
    }
    let mut triangles = Vec::with_capacity(mesh.triangles.len());
    let mut frames = Vec::with_capacity(mesh.triangles.len());
    for (t, &[a, b, c]) in mesh.triangles.iter().enumerate() {
        let m = [middle[3 * t], middle[3 * t + 1], middle[3 * t + 2]];
        if m == [NONE; 3] {
            triangles.push([a, b, c]);
            frames.push((patch.face_origin[t], [a, b, c].map(|v| corner_in_face(t, v))));
            continue;
        }
        let parts: Vec<[u32; 3]> = match m.map(|m| m != NONE) {
            [false, false, false] => vec![[a, b, c]],
            [true, false, false] => vec![[a, m[0], c], [m[0], b, c]],
            [false, true, false] => vec![[b, m[1], a], [m[1], c, a]],
            [false, false, true] => vec![[c, m[2], b], [m[2], a, b]],
            [true, true, false] => vec![[m[0], b, m[1]], [a, m[0], m[1]], [a, m[1], c]],
            [false, true, true] => vec![[m[1], c, m[2]], [b, m[1], m[2]], [b, m[2], a]],
            [true, false, true] => vec![[m[2], a, m[0]], [c, m[2], m[0]], [c, m[0], b]],
            [true, true, true] => vec![[a, m[0], m[2]], [m[0], b, m[1]], [m[2], m[1], c], [m[0], m[1], m[2]]],
        };
        for part in parts {
            let corners = part.map(|v| match (v as usize).checked_sub(mesh.points.len()) {
                None => corner_in_face(t, v),
                Some(i) => place_in_face(input, middle_places[i], patch.face_origin[t], points[v as usize]),
            });
            triangles.push(part);
            frames.push((patch.face_origin[t], corners));
        }
    }
    let chart = Chart { points, triangles, opposite: Vec::new(), uv: Vec::new(), frames, rim: Default::default() };
    (chart, boundary)
}

/// Barycentric coordinates in `face` of a place that may be given in a neighbour of it.
fn place_in_face(input: &TriMesh, place: FacePoint, face: u32, position: DVec3) -> [f64; 3] {
    if place.face == face {
        return place.bary;
    }
    let (from, to) = (input.triangles[place.face as usize], input.triangles[face as usize]);
    let mut bary = [0.0; 3];
    let mut shared = true;
    for (v, weight) in from.into_iter().zip(place.bary) {
        if weight != 0.0 {
            match to.iter().position(|&w| w == v) {
                Some(j) => bary[j] = weight,
                None => shared = false,
            }
        }
    }
    if shared { bary } else { project(input.corners(face as usize), position) }
}

/// Barycentric coordinates, clamped to the triangle, of the projection of `p` to its plane.
fn project([a, b, c]: [DVec3; 3], p: DVec3) -> [f64; 3] {
    let n = (b - a).cross(c - a);
    let mut w = [(c - b).cross(p - b).dot(n), (a - c).cross(p - c).dot(n), (b - a).cross(p - a).dot(n)];
    w = w.map(|x| x.max(0.0));
    let sum = w[0] + w[1] + w[2];
    if sum > 0.0 {
        return w.map(|x| x / sum);
    }
    let nearest = [a, b, c].map(|q| q.distance_squared(p));
    let k = (0..3).min_by(|&i, &j| nearest[i].total_cmp(&nearest[j])).unwrap_or(0);
    FacePoint::corner(0, k).bary
}

impl Chart {
    /// World position of a spot.
    pub fn position(&self, spot: super::chart::locate::Spot) -> DVec3 {
        let [a, b, c] = self.triangles[spot.triangle as usize].map(|v| self.points[v as usize]);
        a * spot.bary[0] + b * spot.bary[1] + c * spot.bary[2]
    }

    /// Unit normal of the surface at a spot; zero on a degenerate triangle.
    pub fn normal(&self, spot: super::chart::locate::Spot) -> DVec3 {
        let [a, b, c] = self.triangles[spot.triangle as usize].map(|v| self.points[v as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// A spot as a place on the input mesh.
    pub fn place(&self, spot: super::chart::locate::Spot) -> FacePoint {
        let (face, corners) = self.frames[spot.triangle as usize];
        let mut bary = [0.0; 3];
        for (w, corner) in spot.bary.iter().zip(corners) {
            for k in 0..3 {
                bary[k] += w * corner[k];
            }
        }
        let sum: f64 = bary.iter().sum();
        FacePoint { face, bary: bary.map(|b| b / sum) }
    }

    /// Number of triangles that are not counter-clockwise in the square.
    pub fn folds(&self) -> usize {
        self.folded().count()
    }

    fn folded(&self) -> impl Iterator<Item = &[u32; 3]> {
        self.triangles.iter().filter(|t| self.orientation_of(t) <= 0.0)
    }

    fn orientation_of(&self, triangle: &[u32; 3]) -> f64 {
        let [a, b, c] = triangle.map(|v| self.uv[v as usize]);
        orientation(a, b, c)
    }

    /// Clamped cotangent of each corner, as the weight of the half-edge across it.
    fn cotangents(&self) -> Vec<f64> {
        let mut weights = Vec::with_capacity(3 * self.triangles.len());
        for triangle in &self.triangles {
            let p = triangle.map(|v| self.points[v as usize]);
            for k in 0..3 {
                let (o, a, b) = (p[(k + 2) % 3], p[k], p[(k + 1) % 3]);
                let (e, f) = (a - o, b - o);
                let cross = e.cross(f).length();
                let cot = if cross > 0.0 { e.dot(f) / cross } else { WEIGHT_RANGE[0] };
                weights.push(cot / 2.0);
            }
        }
        weights
    }

    /// Half the inverse of the length of each half-edge's edge, with the mean length as unit: positive on any triangle. With equal
    /// weights what lies behind `n` needles that start and end on one side of the square would be nearer to that side by a factor for
    /// each of them; with these it is nearer about as it is on the surface.
    fn inverse_lengths(&self) -> Vec<f64> {
        let length = |h: usize| {
            let [a, b] = [h % 3, (h + 1) % 3].map(|k| self.points[self.triangles[h / 3][k] as usize]);
            a.distance(b)
        };
        let lengths: Vec<f64> = (0..3 * self.triangles.len()).map(length).collect();
        let mean = lengths.iter().sum::<f64>() / lengths.len().max(1) as f64;
        lengths.iter().map(|l| mean / divisor(*l) / 2.0).collect()
    }

    fn solve_without_folds(&mut self, boundary: &[bool], observer: &dyn Observer) -> Result<(), Fault> {
        let cotangents = self.cotangents();
        let inverse = self.inverse_lengths();
        let few = 1 + (FEW_FOLDS * self.triangles.len() as f64) as usize;
        for (weights, clamped) in [(&cotangents, false), (&cotangents, true), (&inverse, false)] {
            let limit = |w: f64| if clamped { w.clamp(WEIGHT_RANGE[0], WEIGHT_RANGE[1]) } else { w };
            if self.solve(boundary, weights, &limit, observer).is_ok() {
                let folds = self.folds();
                if folds > 0 && folds <= few {
                    self.untangle(boundary);
                }
                if self.folds() == 0 {
                    return Ok(());
                }
            }
            observer.check()?;
        }
        // Spread: a triangle that came out too small gets softer springs, which lets it grow.
        let mut weights = inverse;
        for _ in 0..SPREAD_ROUNDS {
            let ratios = self.area_ratios();
            for (t, ratio) in ratios.iter().enumerate() {
                for w in &mut weights[3 * t..3 * t + 3] {
                    *w /= ratio.powf(SPREAD_POWER);
                }
            }
            let plain = |w: f64| w.max(f64::MIN_POSITIVE);
            if self.solve(boundary, &weights, &plain, observer).is_err() {
                break;
            }
            if self.folds() == 0 {
                return Ok(());
            }
            observer.check()?;
        }
        self.untangle(boundary);
        let size = |&[a, b, c]: &[u32; 3]| {
            let [a, b, c] = [a, b, c].map(|v| self.uv[v as usize]);
            a.distance(b).max(a.distance(c))
        };
        match self.folded().filter(|t| size(t) > UNRESOLVED).count() {
            0 => Ok(()),
            count => Err(Fault::Folded(count)),
        }
    }

    /// World area over square area of every triangle, 1 for the whole, within 1e±6.
    fn area_ratios(&self) -> Vec<f64> {
        let world = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| self.points[v as usize]);
            (b - a).cross(c - a).length() / 2.0
        };
        let total: f64 = self.triangles.iter().map(world).sum();
        let floor = total * 1e-3 / self.triangles.len() as f64;
        let ratio = |t: &[u32; 3]| {
            let area = divisor(self.orientation_of(t) / 2.0);
            ((world(t).max(floor) / total) / area).clamp(1e-6, 1e6)
        };
        self.triangles.iter().map(ratio).collect()
    }

    /// Moves every inner vertex to the weighted mean of its neighbours; `weights` per half-edge, the two of an edge
    /// are added and passed through `clamp`.
    fn solve(
        &mut self,
        boundary: &[bool],
        weights: &[f64],
        clamp: &dyn Fn(f64) -> f64,
        observer: &dyn Observer,
    ) -> Result<(), Fault> {
        let mut index = vec![NONE; boundary.len()];
        let mut n = 0u32;
        for (v, _) in boundary.iter().enumerate().filter(|(_, b)| !**b) {
            index[v] = n;
            n += 1;
        }
        if n == 0 {
            return Ok(());
        }
        let n = n as usize;
        let mut lower = Vec::with_capacity(2 * self.opposite.len());
        let mut diagonal = vec![0.0; n];
        let mut sides = vec![0.0; 2 * n];
        for h in 0..self.opposite.len() {
            let g = self.opposite[h];
            if g == NONE || (g as usize) < h {
                continue;
            }
            let w = clamp(weights[h] + weights[g as usize]);
            let (a, b) = (self.triangles[h / 3][h % 3], self.triangles[h / 3][(h % 3 + 1) % 3]);
            for (a, b) in [(a, b), (b, a)] {
                let i = index[a as usize];
                if i == NONE {
                    continue;
                }
                let i = i as usize;
                diagonal[i] += w;
                match index[b as usize] {
                    NONE => {
                        sides[i] += w * self.uv[b as usize].x;
                        sides[n + i] += w * self.uv[b as usize].y;
                    }
                    j if (j as usize) < i => lower.push((i, j as usize, -w)),
                    _ => {}
                }
            }
        }
        lower.extend(diagonal.iter().enumerate().map(|(i, &d)| (i, i, d)));
        let factor = match SparseCholesky::factor_watched(n, lower, &|| observer.cancelled()) {
            Some(factor) => factor.map_err(|_| Fault::Folded(self.triangles.len()))?,
            None => return Err(Cancelled.into()),
        };
        factor.solve(&mut sides);
        if sides.iter().any(|x| !x.is_finite()) {
            return Err(Fault::Folded(self.triangles.len()));
        }
        for (v, &i) in index.iter().enumerate().filter(|(_, i)| **i != NONE) {
            self.uv[v] = DVec2::new(sides[i as usize], sides[n + i as usize]);
        }
        Ok(())
    }

    /// Moves the vertices of folded triangles to the best place within their ring, sweep after sweep.
    fn untangle(&mut self, boundary: &[bool]) {
        let adjacency = Adjacency::of(&self.triangles, self.points.len());
        for _ in 0..UNTANGLE_SWEEPS {
            let mut bad: Vec<u32> = self.folded().flatten().copied().collect();
            if bad.is_empty() {
                return;
            }
            bad.sort_unstable();
            bad.dedup();
            for v in bad.into_iter().filter(|&v| !boundary[v as usize]) {
                let ring: Vec<[DVec2; 2]> = adjacency
                    .fan(v)
                    .map(|h| {
                        let t = self.triangles[h as usize / 3];
                        let k = h as usize % 3;
                        [self.uv[t[(k + 1) % 3] as usize], self.uv[t[(k + 2) % 3] as usize]]
                    })
                    .collect();
                self.uv[v as usize] = deepest_place(&ring, self.uv[v as usize]);
            }
        }
    }
}

/// The place with the largest smallest distance to the left of all `edges`, by stepping towards the worst edge's
/// inside with shrinking steps from the better of `start` and the mean of the ring.
fn deepest_place(edges: &[[DVec2; 2]], start: DVec2) -> DVec2 {
    let mean = edges.iter().map(|e| e[0]).sum::<DVec2>() / edges.len() as f64;
    let size = edges.iter().map(|e| e[0].distance(mean)).fold(0.0, f64::max);
    let depth = |p: DVec2| {
        let mut worst = (f64::INFINITY, DVec2::ZERO);
        for [a, b] in edges {
            let inward = (*b - *a).perp().normalize_or_zero();
            let d = inward.dot(p - *a);
            if d < worst.0 {
                worst = (d, inward);
            }
        }
        worst
    };
    let mut best = if depth(mean).0 > depth(start).0 { mean } else { start };
    let mut p = best;
    let mut step = size / 2.0;
    for _ in 0..60 {
        p += depth(p).1 * step;
        if depth(p).0 > depth(best).0 {
            best = p;
        } else {
            step *= 0.8;
            p = best + (p - best) * 0.5;
        }
    }
    best
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// Chart of a sheet of 21 x 21 vertices at `shape(s, t)`.
    pub fn chart(shape: impl Fn(f64, f64) -> DVec3) -> Chart {
        let n = 21u32;
        let points = (0..n * n).map(|k| shape((k % n) as f64 / 20.0, (k / n) as f64 / 20.0)).collect();
        let cells = (0..n - 1).flat_map(|j| (0..n - 1).map(move |i| j * n + i));
        let triangles = cells.flat_map(|a| [[a, a + 1, a + 1 + n], [a, a + 1 + n, a + n]]).collect();
        let sides = [
            (0..n).collect(),
            (0..n).map(|j| j * n + n - 1).collect(),
            (0..n).rev().map(|i| (n - 1) * n + i).collect(),
            (0..n).rev().map(|j| j * n).collect(),
        ];
        flat(TriMesh::new(points, triangles), sides)
    }

    /// Chart of a whole mesh with these sides.
    fn flat(input: TriMesh, sides: [Vec<u32>; 4]) -> Chart {
        let mut origin = vec![FacePoint::corner(0, 0); input.points.len()];
        for (f, t) in input.triangles.iter().enumerate() {
            (0..3).for_each(|k| origin[t[k] as usize] = FacePoint::corner(f as u32, k));
        }
        let face_origin = (0..input.triangles.len() as u32).collect();
        let patch = PatchMesh { mesh: input.clone(), origin, face_origin, sides };
        flatten(&input, &patch, &SideStops::default(), [2, 2], &crate::Silent).expect("a flat chart")
    }

    #[test]
    fn a_flat_sheet_maps_to_itself_within_1e_12() {
        let chart = chart(|s, t| DVec3::new(s, t, 0.0));
        for (uv, p) in chart.uv.iter().zip(&chart.points) {
            assert!(uv.distance(p.truncate()) < 1e-12);
        }
    }

    #[test]
    fn needles_across_a_side_that_bulges_map_without_folds() {
        // Two triangles lead from each chord of the right side to the next, as CAD programs write cylinders: 20 long, and .04 and .002
        // apart by turns.
        const CHORDS: u32 = 40;
        let level = |k: u32| f64::from(k) / f64::from(CHORDS);
        let x = |k: u32| 0.042 * f64::from(k / 2) + 0.04 * f64::from(k % 2);
        let end = |k: u32, sign: f64| DVec3::new(x(k), sign * 10.0 * (1.0 - level(k).powi(2)).sqrt(), 0.0);
        let mut points = vec![DVec3::new(-1.0, -10.0, 0.0), DVec3::new(-1.0, 10.0, 0.0)];
        points.extend((0..CHORDS).flat_map(|k| [end(k, -1.0), end(k, 1.0)]));
        points.push(end(CHORDS, 1.0));
        let (low, high, tip) = (|k: u32| 2 + 2 * k, |k: u32| 3 + 2 * k, 2 + 2 * CHORDS);
        let mut triangles = vec![[0, low(0), high(0)], [0, high(0), 1]];
        triangles.extend((1..CHORDS).flat_map(|k| [[low(k - 1), low(k), high(k)], [low(k - 1), high(k), high(k - 1)]]));
        triangles.push([low(CHORDS - 1), tip, high(CHORDS - 1)]);
        let right = (0..CHORDS).map(low).chain([tip]).chain((0..CHORDS).rev().map(high)).collect();
        let sides = [vec![0, low(0)], right, vec![high(0), 1], vec![1, 0]];
        assert_eq!(flat(TriMesh::new(points, triangles), sides).folds(), 0);
    }

    #[test]
    fn a_spike_of_400_times_the_cell_maps_without_folds() {
        let bump = |s: f64, t: f64| (-300.0 * ((s - 0.5).powi(2) + (t - 0.45).powi(2))).exp();
        assert_eq!(chart(|s, t| DVec3::new(s, t, 20.0 * bump(s, t))).folds(), 0);
    }
}
