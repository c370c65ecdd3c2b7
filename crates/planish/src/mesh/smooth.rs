//! Noise off a mesh, features kept.
//!
//! Bivariate off the features: face normals are filtered by place and by normal (Zheng, Fu, Au and Tai 2011, *Bilateral
//! Normal Filtering for Mesh Denoising*), then vertices follow the normals (Sun, Rosin, Martin and Langbein 2007, *Fast
//! and Effective Feature-Preserving Mesh Denoising*, eq. 6). No normal looks across a tagged feature edge. Univariate
//! along the features (Kobbelt et al. 2001, §5.2): the vertices of a line are relaxed along it with Taubin's pair of
//! factors, then pulled into the planes of both sides; corners stay.
//!
//! Volume is restored by a shift along the normals. What would turn a triangle or make two meet is taken back.

use super::intersect::intersections_of;
use super::soup::check_some;
use super::{Adjacency, FeatureKind, FeatureTags, MeshError, NONE, TriMesh, next, previous};
use crate::geom::is_positive;
use crate::observe::{Cancelled, Observer};
use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How to smooth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SmoothParams {
    /// Size of the noise (standard deviation of the positions); estimated from the mesh if not given
    #[schemars(range(min = 0.0), extend("unit" = "input units"))]
    pub noise: Option<f64>,
    /// How much is done, in terms of that size: 1 removes what is of the size of the noise
    #[schemars(range(min = 0.0, max = 10.0), extend("unit" = "noise"))]
    pub strength: f64,
}

impl Default for SmoothParams {
    fn default() -> Self {
        SmoothParams { noise: None, strength: 1.0 }
    }
}

/// Why a mesh cannot be smoothed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SmoothError {
    /// The mesh is damaged.
    #[error("{0}")]
    Mesh(#[from] MeshError),
    /// A size that is none.
    #[error("a {what} of {value} is none; give a number of at least 0")]
    Size {
        /// Which size.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// The observer wants no result any more.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// A smoothed mesh.
#[derive(Clone, Debug)]
pub struct Smoothed {
    /// The mesh.
    pub mesh: TriMesh,
    /// Size of the noise that was assumed, world units.
    pub noise: f64,
    /// Vertices that were put back where they came from, as triangles would have turned or met.
    pub kept: usize,
}

/// Rounds of the normal filter, and of the vertices that follow. More of them flatten curved parts: on the fandisk, the
/// joint and the rocker arm with noise of 0.05, 0.1 and 0.2 % of the diagonal, twelve of each leave 0.9 to 4 times the
/// error.
const NORMAL_ROUNDS: usize = 6;
const VERTEX_ROUNDS: usize = 8;
/// Width of the filter over normals: so many times the noise of a normal, and at least and at most so much (length of
/// the difference of two unit vectors).
const RANGE: f64 = 0.8;
const RANGE_LEAST: f64 = 0.04;
const RANGE_MOST: f64 = 0.55;
/// Taubin's factors along lines: the second undoes the shrinking of the first.
const RELAX: f64 = 0.5;
const UNSHRINK: f64 = -0.53;
/// Rounds of taking back what meets.
const GUARD_ROUNDS: usize = 8;

/// Smooths a mesh.
/// * `tags` - its features; without tags edges are kept by the filter alone
/// # Errors
/// [`SmoothError`] for damaged meshes, sizes that are none, or if cancelled.
pub fn smooth(
    mesh: &TriMesh,
    tags: Option<&FeatureTags>,
    params: &SmoothParams,
    observer: &dyn Observer,
) -> Result<Smoothed, SmoothError> {
    check_some(mesh)?;
    for (what, value) in [("noise", params.noise.unwrap_or(0.0)), ("strength", params.strength)] {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(SmoothError::Size { what, value });
        }
    }
    let adjacency = Adjacency::new(mesh);
    let none = FeatureTags { vertices: vec![FeatureKind::None; mesh.points.len()], edges: Vec::new() };
    let tags = tags.filter(|t| t.vertices.len() == mesh.points.len()).unwrap_or(&none);
    let noise = params.noise.unwrap_or_else(|| estimate(mesh, &adjacency));
    let size = noise * params.strength;
    if size == 0.0 {
        return Ok(Smoothed { mesh: mesh.clone(), noise, kept: 0 });
    }
    observer.check()?;
    let filter = Filter::new(mesh, &adjacency, tags, size, observer)?;
    let mut normals: Vec<DVec3> = (0..mesh.triangles.len()).into_par_iter().map(|t| mesh.normal(t)).collect();
    for round in 0..NORMAL_ROUNDS {
        observer.check()?;
        normals = filter.filtered(&normals, observer)?;
        observer.progress(0.6 * (round + 1) as f64 / NORMAL_ROUNDS as f64);
    }
    let mut points = mesh.points.clone();
    for round in 0..VERTEX_ROUNDS {
        observer.check()?;
        points = filter.followed(&points, &normals);
        for factor in [RELAX, UNSHRINK] {
            points = filter.relaxed(points, factor);
        }
        observer.progress(0.6 + 0.3 * (round + 1) as f64 / VERTEX_ROUNDS as f64);
    }
    let mut smooth = TriMesh { points, ..mesh.clone() };
    observer.check()?;
    restore_volume(mesh, &mut smooth, &adjacency, tags);
    let kept = guard(mesh, &mut smooth, observer)?;
    observer.progress(1.0);
    Ok(Smoothed { mesh: smooth, noise, kept })
}

/// Size of the noise: from the distances of vertices to the planes through their neighbours, robustly.
fn estimate(mesh: &TriMesh, adjacency: &Adjacency) -> f64 {
    let normals = mesh.vertex_normals();
    let mut away: Vec<f64> = (0..mesh.points.len() as u32)
        .into_par_iter()
        .filter(|&v| !adjacency.is_boundary_vertex(v))
        .map(|v| {
            let (mut sum, mut count) = (DVec3::ZERO, 0.0);
            for h in adjacency.fan(v) {
                sum += mesh.points[mesh.origin(next(h)) as usize];
                count += 1.0;
            }
            // The mean of k neighbours has 1/k of the variance itself.
            let spread = f64::sqrt(1.0 + 1.0 / count);
            (normals[v as usize].dot(mesh.points[v as usize] - sum / count) / spread).abs()
        })
        .collect();
    if away.is_empty() {
        return 0.0;
    }
    let middle = away.len() / 2;
    // The median of the absolute values is 0.6745 of the standard deviation.
    *away.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.6745
}

struct Filter<'a> {
    mesh: &'a TriMesh,
    adjacency: &'a Adjacency,
    kinds: &'a [FeatureKind],
    /// Neighbours of each triangle that share a vertex with it, with no feature between, and their weights by place.
    around: Lists<(u32, f64)>,
    range: f64,
    /// The two neighbours on a line of its vertices.
    lines: Vec<[u32; 2]>,
}

impl<'a> Filter<'a> {
    fn new(
        mesh: &'a TriMesh,
        adjacency: &'a Adjacency,
        tags: &'a FeatureTags,
        size: f64,
        observer: &dyn Observer,
    ) -> Result<Filter<'a>, Cancelled> {
        let mut line_ends: Vec<(u32, u32)> = tags.edges.iter().flat_map(|&[a, b]| [(a, b), (b, a)]).collect();
        line_ends.sort_unstable();
        let mut lines = vec![[NONE; 2]; mesh.points.len()];
        for run in line_ends.chunk_by(|x, y| x.0 == y.0) {
            if let [(v, a), (_, b)] = *run {
                lines[v as usize] = [a, b];
            }
        }
        let centers: Vec<DVec3> =
            (0..mesh.triangles.len()).into_par_iter().map(|t| mesh.corners(t).iter().sum::<DVec3>() / 3.0).collect();
        let edge = mesh.mean_edge();
        let first = first_rings(mesh, adjacency, tags, observer)?;
        // Two rings: triangles around the triangles around.
        let around = Lists::new(mesh.triangles.len(), observer, |t, marks, list| {
            let mut add = |s: u32| {
                if std::mem::replace(&mut marks[s as usize], t) != t {
                    let d2 = centers[t as usize].distance_squared(centers[s as usize]);
                    list.push((s, mesh.area(s as usize) * (-d2 / (2.0 * edge * edge)).exp()));
                }
            };
            first.of(t).iter().for_each(|&s| add(s));
            first.of(t).iter().flat_map(|&s| first.of(s)).filter(|&&s| s != t).for_each(|&s| add(s));
        })?;
        // A vertex that is off by the noise turns its triangles by about the noise over their height.
        let turn = 2.0 * size / (edge * 0.866);
        let range = (RANGE * turn).clamp(RANGE_LEAST, RANGE_MOST);
        Ok(Filter { mesh, adjacency, kinds: &tags.vertices, around, range, lines })
    }

    /// One round of the normal filter.
    fn filtered(&self, normals: &[DVec3], observer: &dyn Observer) -> Result<Vec<DVec3>, Cancelled> {
        let two = 2.0 * self.range * self.range;
        (0..normals.len())
            .into_par_iter()
            .map(|t| {
                observer.check()?;
                let n = normals[t];
                let mut sum = n * self.mesh.area(t);
                for &(s, weight) in self.around.of(t as u32) {
                    let m = normals[s as usize];
                    sum += m * (weight * (-n.distance_squared(m) / two).exp());
                }
                Ok(sum.try_normalize().unwrap_or(n))
            })
            .collect()
    }

    /// Vertices moved towards the planes of their triangles.
    fn followed(&self, points: &[DVec3], normals: &[DVec3]) -> Vec<DVec3> {
        (0..points.len() as u32)
            .into_par_iter()
            .map(|v| {
                let p = points[v as usize];
                if self.kinds[v as usize] == FeatureKind::Corner || self.adjacency.is_boundary_vertex(v) {
                    return p;
                }
                let (mut sum, mut count) = (DVec3::ZERO, 0.0);
                for h in self.adjacency.fan(v) {
                    let t = h as usize / 3;
                    let c = self.mesh.triangles[t].iter().map(|&w| points[w as usize]).sum::<DVec3>() / 3.0;
                    sum += normals[t] * normals[t].dot(c - p);
                    count += 1.0;
                }
                if count > 0.0 { p + sum / count } else { p }
            })
            .collect()
    }

    /// Line vertices moved towards the middle of their neighbours on the line.
    fn relaxed(&self, points: Vec<DVec3>, factor: f64) -> Vec<DVec3> {
        (0..points.len())
            .into_par_iter()
            .map(|v| match self.lines[v] {
                [a, b] if a != NONE && self.kinds[v] == FeatureKind::Edge => {
                    let middle = (points[a as usize] + points[b as usize]) / 2.0;
                    points[v] + (middle - points[v]) * factor
                }
                _ => points[v],
            })
            .collect()
    }
}

/// A list for each triangle, one behind the other.
struct Lists<T> {
    start: Vec<usize>,
    all: Vec<T>,
}

/// Triangles whose lists are made together: enough of them to be worth the marks of a thread.
const TOGETHER: usize = 4096;

impl<T: Copy + Send + Sync> Lists<T> {
    /// Makes the lists of `count` triangles; `fill` is given marks of all triangles to tell by its own number what it
    /// has met.
    fn new(
        count: usize,
        observer: &dyn Observer,
        fill: impl Fn(u32, &mut [u32], &mut Vec<T>) + Sync,
    ) -> Result<Lists<T>, Cancelled> {
        let parts = (0..count.div_ceil(TOGETHER))
            .into_par_iter()
            .map_init(
                || vec![NONE; count],
                |marks, k| {
                    observer.check()?;
                    let (mut ends, mut list) = (Vec::with_capacity(TOGETHER), Vec::new());
                    for t in k * TOGETHER..((k + 1) * TOGETHER).min(count) {
                        fill(t as u32, marks, &mut list);
                        ends.push(list.len());
                    }
                    Ok((ends, list))
                },
            )
            .collect::<Result<Vec<_>, Cancelled>>()?;
        let mut lists = Lists { start: vec![0], all: Vec::with_capacity(parts.iter().map(|p| p.1.len()).sum()) };
        for (ends, list) in parts {
            let before = lists.all.len();
            lists.start.extend(ends.into_iter().map(|end| before + end));
            lists.all.extend(list);
        }
        Ok(lists)
    }

    fn of(&self, t: u32) -> &[T] {
        &self.all[self.start[t as usize]..self.start[t as usize + 1]]
    }
}

/// Steps around a corner at most: more triangles around one than this are no surface to smooth over.
const MOST_AROUND: usize = 32;

/// For each triangle those that share a vertex with it, met by turning around its corners both ways until a feature or
/// a rim.
fn first_rings(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    tags: &FeatureTags,
    observer: &dyn Observer,
) -> Result<Lists<u32>, Cancelled> {
    let is_line = |h: u32| {
        let (a, b) = (mesh.origin(h), mesh.origin(next(h)));
        tags.edges.binary_search(&[a.min(b), a.max(b)]).is_ok()
    };
    Lists::new(mesh.triangles.len(), observer, |t, marks, list| {
        marks[t as usize] = t;
        for corner in 3 * t..3 * t + 3 {
            for back in [false, true] {
                let mut h = corner;
                for _ in 0..MOST_AROUND {
                    let across = if back { h } else { previous(h) };
                    let g = adjacency.opposite[across as usize];
                    if g == NONE || is_line(across) {
                        break;
                    }
                    h = if back { next(g) } else { g };
                    if h / 3 == t {
                        break;
                    }
                    if std::mem::replace(&mut marks[h as usize / 3], t) != t {
                        list.push(h / 3);
                    }
                }
            }
        }
    })
}

/// Shifts a closed mesh along its normals to the volume of the other.
fn restore_volume(from: &TriMesh, to: &mut TriMesh, adjacency: &Adjacency, tags: &FeatureTags) {
    if adjacency.opposite.contains(&NONE) {
        return;
    }
    let center = from.bounds().center();
    let volume = |m: &TriMesh| -> f64 {
        (0..m.triangles.len())
            .map(|t| {
                let [a, b, c] = m.corners(t).map(|p| p - center);
                a.dot(b.cross(c)) / 6.0
            })
            .sum()
    };
    let area: f64 = (0..to.triangles.len()).map(|t| to.area(t)).sum();
    if !is_positive(area) {
        return;
    }
    let shift = (volume(from) - volume(to)) / area;
    let normals = to.vertex_normals();
    for ((p, n), kind) in to.points.iter_mut().zip(normals).zip(&tags.vertices) {
        if *kind == FeatureKind::None {
            *p += n * shift;
        }
    }
}

/// Puts back vertices of triangles that turned over or that meet now and did not before; returns how many.
fn guard(from: &TriMesh, to: &mut TriMesh, observer: &dyn Observer) -> Result<usize, Cancelled> {
    // What met before is asked for only when something meets.
    let mut known: Option<Vec<[u32; 2]>> = None;
    let mut kept = vec![false; from.points.len()];
    // Pairs that no round has moved since they were asked about are as they were.
    let mut moved = vec![true; from.triangles.len()];
    for round in 0..GUARD_ROUNDS {
        let mut bad: Vec<u32> = (0..to.triangles.len() as u32)
            .into_par_iter()
            .filter(|&t| {
                let (a, b) = (from.area_vector(t as usize), to.area_vector(t as usize));
                a.dot(b) <= 0.0 && a != DVec3::ZERO && !to.triangles[t as usize].iter().all(|&v| kept[v as usize])
            })
            .collect();
        let meeting = intersections_of(to, |t| moved[t as usize], observer)?;
        if !meeting.is_empty() {
            let own = match known.take() {
                Some(own) => own,
                None => intersections_of(from, |_| true, observer)?,
            };
            bad.extend(meeting.into_iter().filter(|p| own.binary_search(p).is_err()).flatten());
            known = Some(own);
        }
        if bad.is_empty() {
            break;
        }
        let mut ring = vec![false; kept.len()];
        for &t in &bad {
            to.triangles[t as usize].iter().for_each(|&v| ring[v as usize] = true);
        }
        // A growing neighbourhood: in the end everything is as it was.
        for _ in 0..round {
            let before = ring.clone();
            for t in to.triangles.iter().filter(|t| t.iter().any(|&v| before[v as usize])) {
                t.iter().for_each(|&v| ring[v as usize] = true);
            }
        }
        for v in (0..ring.len()).filter(|&v| ring[v]) {
            kept[v] = true;
            to.points[v] = from.points[v];
        }
        moved = to.triangles.iter().map(|t| t.iter().any(|&v| ring[v as usize])).collect();
        if round + 1 == GUARD_ROUNDS {
            to.points.clone_from(&from.points);
            kept.fill(true);
        }
    }
    Ok(kept.into_iter().filter(|&k| k).count())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Silent;
    use crate::geom::random;
    use crate::mesh::diagnose;
    use crate::synthetic::shapes;

    fn noisy(mesh: &TriMesh, size: f64) -> TriMesh {
        let normals = mesh.vertex_normals();
        let mut out = mesh.clone();
        for (v, (p, n)) in out.points.iter_mut().zip(normals).enumerate() {
            // The sum of twelve uniform numbers is nearly normal.
            let g: f64 = (0..12).map(|k| random::unit(4, 12 * v as u64 + k)).sum::<f64>() - 6.0;
            *p += n * g * size;
        }
        out
    }

    #[test]
    fn sphere_with_noise_of_half_a_percent_comes_back_to_a_third_of_it_with_its_volume() {
        let sphere = shapes::sphere(1.0, 5);
        let rough = noisy(&sphere, 0.005);
        let found = smooth(&rough, None, &SmoothParams::default(), &Silent).unwrap();
        assert!((found.noise - 0.005).abs() < 0.0015, "{}", found.noise);
        let rms = |m: &TriMesh| {
            (m.points.iter().map(|p| (p.length() - 1.0).powi(2)).sum::<f64>() / m.points.len() as f64).sqrt()
        };
        assert!(rms(&found.mesh) < rms(&rough) / 3.0, "{} {}", rms(&found.mesh), rms(&rough));
        let volume = |m: &TriMesh| diagnose(m).volume.unwrap();
        assert!((volume(&found.mesh) - volume(&rough)).abs() < 1e-4 * volume(&rough));
    }

    #[test]
    fn cube_keeps_its_tagged_edges_straight_and_corners_in_place() {
        let cube = shapes::cuboid(DVec3::ONE, 16);
        let adjacency = Adjacency::new(&cube);
        let sharp = crate::mesh::sharp_edges(&cube, &adjacency, 40.0);
        let edges =
            (0..sharp.len() as u32).filter(|&h| sharp[h as usize]).map(|h| [cube.origin(h), cube.origin(next(h))]);
        let tags = FeatureTags::from_edges(cube.points.len(), edges);
        let mut rough = noisy(&cube, 0.004);
        for (v, kind) in tags.vertices.iter().enumerate() {
            if *kind == FeatureKind::Corner {
                rough.points[v] = cube.points[v];
            }
        }
        let found = smooth(&rough, Some(&tags), &SmoothParams::default(), &Silent).unwrap();
        let low = cube.bounds().min;
        let mut worst: f64 = 0.0;
        for (v, p) in found.mesh.points.iter().enumerate() {
            match tags.vertices[v] {
                FeatureKind::Corner => assert_eq!(*p, cube.points[v]),
                FeatureKind::Edge => worst = worst.max(p.distance(cube.points[v])),
                FeatureKind::None => {}
            }
        }
        assert!(worst < 0.012, "{worst} from {low}");
        assert!(crate::mesh::self_intersections(&found.mesh).is_empty());
    }

    #[test]
    fn no_noise_changes_nothing() {
        let cube = shapes::cuboid(DVec3::ONE, 4);
        let found = smooth(&cube, None, &SmoothParams { noise: Some(0.0), strength: 1.0 }, &Silent).unwrap();
        assert_eq!(found.mesh, cube);
    }
}
