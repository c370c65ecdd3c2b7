//! Every point moved onto the surface, with normal, curvature and flags; sharp lines of the samples.
//!
//! [X03] §8.1, eq. 5 and 6 (curvatures); `docs/methods/samples.md`, section 8. Outliers are flagged and not deleted. Sharp lines
//! are made of the points beside a second sheet, moved to where both sheets meet, thinned and joined. Points come as a whole or brick
//! by brick ([`super::bricks::bring`]).

use super::sites::cover;
use super::stand::Stand;
use super::{Blend, Cell, Cloud, CloudError, Samples};
use crate::geom::{Aabb, KdTree, is_positive};
use crate::mesh::Attribute;
use crate::observe::Observer;
use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Samples asked for each point.
const SAMPLES_PER_POINT: usize = 10;
/// Samples of two sheets meet at an edge if their normals differ by more than this, degrees.
const SHARP_DEG: f64 = 30.0;
/// Points within this many noise levels (and one spacing) of a second sheet are feature points.
const FEATURE_NOISE: f64 = 2.0;
/// Distance of points of a sharp line, in spacings.
const LINE_SPACING: f64 = 3.0;
/// Steps to the surface at most.
const PROJECTION_STEPS: usize = 4;
/// Points between two looks at the observer.
const POINTS_PER_CHUNK: usize = 1 << 15;

/// Which points are kept.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ProjectParams {
    /// Distance of the points that are kept, world units; 0 keeps all
    #[schemars(range(min = 0.0), extend("unit" = "length"))]
    pub spacing: f64,
    /// Keep outliers, flagged; they are left out of a thinned cloud in any case
    pub outliers: bool,
}

/// The cleaned cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cleaned {
    /// Points on the surface, with `normal`, `curvature` (mean), `gauss`, `irregularity`, `noise`, `segment`, `feature`,
    /// `outlier`, `confidence`, and the attributes of the scan.
    pub cloud: Cloud,
    /// For each point of the scan whether it is an outlier or no number.
    pub strays: Vec<bool>,
    /// What is known of all points together.
    pub facts: PointFacts,
}

/// What is known of the points of a scan on its surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointFacts {
    /// Points that were kept.
    pub kept: usize,
    /// Sharp lines.
    pub lines: Vec<Vec<DVec3>>,
    /// Number of outliers among the points that are numbers.
    pub outliers: usize,
    /// Root of the mean squared distance of the points that are no outliers to the surface, world units.
    pub moved_rms: f64,
}

/// A point on the surface.
#[derive(Clone, Copy)]
struct Placed {
    at: DVec3,
    normal: DVec3,
    sample: u32,
    moved: f64,
    /// Mean and Gaussian curvature.
    mean: f64,
    gauss: f64,
    edge: Option<DVec3>,
    outlier: bool,
}

/// Moves every point of a scan to the surface of its samples.
/// * `outlier` - residual in noise levels from which a point is one
/// # Errors
/// [`CloudError::Cancelled`].
pub fn project(
    cloud: &Cloud,
    samples: &Samples,
    outlier: f64,
    params: &ProjectParams,
    observer: &dyn Observer,
) -> Result<Cleaned, CloudError> {
    let stands = samples.samples.iter().map(Stand::of).collect();
    let Samples { noise, spacing, diagonal, .. } = *samples;
    let scale = PointScale { noise, spacing, diagonal, outlier };
    let brought = Brought::new(cloud, stands, &samples.cells, &scale, observer)?;
    let mut gathered = Gathered::new(spacing, params);
    let Cleaned { cloud, strays, .. } = gathered.add(cloud, brought);
    observer.progress(1.0);
    Ok(Cleaned { cloud, strays, facts: gathered.finish() })
}

/// What points are measured by, world units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PointScale {
    /// As of [`Samples`].
    pub noise: f64,
    pub spacing: f64,
    pub diagonal: f64,
    /// Residual in noise levels from which a point is an outlier.
    pub outlier: f64,
}

/// Points brought to the surface: all of a scan, or those of a brick.
pub(crate) struct Brought {
    /// Those that are numbers, as indices.
    finite: Vec<u32>,
    /// Of each of these its place.
    placed: Vec<Placed>,
    stands: Vec<Stand>,
}

impl Brought {
    /// Brings points to the surface.
    /// * `stands`, `cells` - all that reach them
    /// # Errors
    /// [`CloudError::Cancelled`].
    pub(super) fn new(
        cloud: &Cloud,
        stands: Vec<Stand>,
        cells: &[Cell],
        scale: &PointScale,
        observer: &dyn Observer,
    ) -> Result<Brought, CloudError> {
        let finite: Vec<u32> =
            (0..cloud.points.len() as u32).filter(|&i| cloud.points[i as usize].is_finite()).collect();
        let mut placed: Vec<Placed> = Vec::with_capacity(finite.len());
        if stands.is_empty() {
            placed
                .extend(finite.iter().map(|&i| Placed::stray(cloud.points[i as usize], DVec3::ZERO, 0, f64::INFINITY)));
            return Ok(Brought { finite, placed, stands });
        }
        let tree = KdTree::new(&stands.iter().map(|s| s.center).collect::<Vec<_>>());
        let blend = Blend::new(cells);
        while placed.len() < finite.len() {
            observer.check()?;
            observer.progress(placed.len() as f64 / finite.len() as f64);
            let range = placed.len()..(placed.len() + POINTS_PER_CHUNK).min(finite.len());
            placed.par_extend(range.into_par_iter().map_init(Vec::new, |near, k| {
                place(cloud.points[finite[k] as usize], (&stands, &tree), &blend, scale, near)
            }));
        }
        Ok(Brought { finite, placed, stands })
    }
}

/// The points of a scan on their way to be one cloud, piece by piece.
pub(crate) struct Gathered<'a> {
    params: &'a ProjectParams,
    /// Distance of points of sharp lines, world units.
    gap: f64,
    edges: Vec<DVec3>,
    /// Points that were kept so far, where they are thinned.
    thinned: Vec<DVec3>,
    kept: usize,
    outliers: usize,
    /// Number of the others, and sum of their squared distances to the surface.
    inner: usize,
    moved: f64,
}

impl<'a> Gathered<'a> {
    /// Nothing yet.
    /// * `spacing` - of the points
    pub fn new(spacing: f64, params: &'a ProjectParams) -> Gathered<'a> {
        let (edges, thinned) = (Vec::new(), Vec::new());
        Gathered { params, gap: LINE_SPACING * spacing, edges, thinned, kept: 0, outliers: 0, inner: 0, moved: 0.0 }
    }

    /// Adds a piece: its points as they are kept, and which of them are strays; without facts.
    pub fn add(&mut self, cloud: &Cloud, piece: Brought) -> Cleaned {
        let Brought { finite, placed, stands } = piece;
        let inner = placed.iter().filter(|p| !p.outlier);
        self.moved += inner.clone().map(|p| p.moved * p.moved).sum::<f64>();
        let count = inner.count();
        self.inner += count;
        self.outliers += placed.len() - count;
        self.edges.extend(placed.iter().filter_map(|p| p.edge));
        let mut strays = vec![true; cloud.points.len()];
        placed.iter().zip(&finite).for_each(|(p, &i)| strays[i as usize] = p.outlier);
        let kept = self.chosen(&placed);
        self.kept += kept.len();
        let mut result = cloud.select(&kept.iter().map(|&k| finite[k as usize]).collect::<Vec<_>>());
        result.points = kept.iter().map(|&k| placed[k as usize].at).collect();
        describe(&mut result, &kept.iter().map(|&k| &placed[k as usize]).collect::<Vec<_>>(), &stands);
        Cleaned { cloud: result, strays, facts: PointFacts::default() }
    }

    /// The points that are kept.
    fn chosen(&mut self, placed: &[Placed]) -> Vec<u32> {
        let spacing = self.params.spacing;
        if spacing <= 0.0 {
            let stays = |k: &u32| !placed[*k as usize].outlier || self.params.outliers;
            return (0..placed.len() as u32).filter(stays).collect();
        }
        let mut kept: Vec<u32> = (0..placed.len() as u32).filter(|&k| !placed[k as usize].outlier).collect();
        let at = |k: &u32| placed[*k as usize].at;
        let mut reach = Aabb::of(&kept.iter().map(at).collect::<Vec<_>>());
        reach = Aabb { min: reach.min - spacing, max: reach.max + spacing };
        let before: Vec<DVec3> = self.thinned.iter().copied().filter(|p| reach.contains(*p)).collect();
        if !before.is_empty() {
            let (tree, mut near) = (KdTree::new(&before), Vec::new());
            kept.retain(|k| {
                tree.nearest_within(at(k), 1, spacing, &mut near);
                near.is_empty()
            });
        }
        let order = KdTree::new(&kept.iter().map(at).collect::<Vec<_>>());
        let sorted: Vec<u32> = order.order().iter().map(|&k| kept[k as usize]).collect();
        let points: Vec<DVec3> = sorted.iter().map(at).collect();
        let chosen = cover(&points, &KdTree::new(&points), |_| spacing);
        self.thinned.extend(chosen.iter().map(|&i| points[i as usize]));
        chosen.into_iter().map(|i| sorted[i as usize]).collect()
    }

    /// What is known of all points.
    pub fn finish(self) -> PointFacts {
        PointFacts {
            kept: self.kept,
            lines: feature_lines(&self.edges, self.gap),
            outliers: self.outliers,
            moved_rms: (self.moved / self.inner.max(1) as f64).sqrt(),
        }
    }
}

/// Gives the points of a cloud what is known of their places, before their own attributes.
fn describe(cloud: &mut Cloud, placed: &[&Placed], stands: &[Stand]) {
    let column = |name: &str, of: &dyn Fn(&Placed) -> f64| Attribute {
        name: name.into(),
        width: 1,
        values: placed.iter().map(|p| of(p) as f32).collect(),
    };
    let known = |name: &str, of: &dyn Fn(&Stand) -> f64| {
        // Where there are no samples at all nothing is known.
        column(name, &|p| stands.get(p.sample as usize).map_or(0.0, of))
    };
    let normal = Attribute {
        name: "normal".into(),
        width: 3,
        values: placed.iter().flat_map(|p| p.normal.to_array().map(|x| x as f32)).collect(),
    };
    let mut attributes = vec![
        normal,
        column("curvature", &|p| p.mean),
        column("gauss", &|p| p.gauss),
        known("irregularity", &|s| s.irregularity),
        known("noise", &|s| s.noise),
        known("segment", &|s| f64::from(s.segment)),
        column("feature", &|p| f64::from(u8::from(p.edge.is_some()))),
        column("outlier", &|p| f64::from(u8::from(p.outlier))),
        known("confidence", &|s| s.confidence),
    ];
    let named = |name: &str| attributes.iter().any(|a| a.name == name);
    let own: Vec<Attribute> = cloud.attributes.drain(..).filter(|a| !named(&a.name)).collect();
    attributes.extend(own);
    cloud.attributes = attributes;
}

impl Placed {
    /// A point that is not of the surface.
    fn stray(p: DVec3, normal: DVec3, sample: u32, moved: f64) -> Placed {
        Placed { at: p, normal, sample, moved, mean: 0.0, gauss: 0.0, edge: None, outlier: true }
    }
}

fn place(
    p: DVec3,
    (stands, tree): (&[Stand], &KdTree),
    blend: &Blend,
    scale: &PointScale,
    near: &mut Vec<(f64, u32)>,
) -> Placed {
    tree.nearest(p, SAMPLES_PER_POINT, near);
    let first = near.first().map_or(0, |n| n.1);
    let stray = |moved: f64| Placed::stray(p, stands[first as usize].normal, first, moved);
    // Down the gradient to the surface; the blend is no exact distance, so more than once.
    let mut at = p;
    let mut here = None;
    for _ in 0..PROJECTION_STEPS {
        let Some(b) = blend.at(at) else { return stray(f64::INFINITY) };
        let normal = blend.normal(at, &b);
        at -= b.value * normal;
        here = Some((b, normal));
        if b.value.abs() < 1e-9 * scale.diagonal {
            break;
        }
    }
    let Some((here, normal)) = here else { return stray(f64::INFINITY) };
    // The sample that stands for the point: near, and of its side.
    let sample = near
        .iter()
        .find(|n| stands[n.1 as usize].normal.dot(normal) > SHARP_DEG.to_radians().cos())
        .map_or(first, |n| n.1);
    let s = &stands[sample as usize];
    let moved = at.distance(p);
    let noise = s.noise.max(scale.noise);
    let off = near.first().is_none_or(|n| n.0.sqrt() > s.support + scale.outlier * noise);
    if moved > scale.outlier * noise.max(1e-9 * s.radius) || off || !at.is_finite() {
        return stray(moved);
    }
    // The sheets of the heaviest cell: the one here tells the curvature, another close by an edge.
    let cell = &blend.cells()[here.cell];
    let sheets = &cell.sheets[..cell.count as usize];
    let own = sheets
        .iter()
        .map(|q| (q.distance(at), q))
        .filter(|((_, n), _)| n.dot(normal) > SHARP_DEG.to_radians().cos())
        .min_by(|a, b| a.0.0.abs().total_cmp(&b.0.0.abs()));
    let (mut edge, mut bend) = (None, (0.0, 0.0));
    if let Some((_, own)) = own {
        bend = own.curvature(at);
        edge = sheets
            .iter()
            .filter(|q| {
                let (d, n) = q.distance(at);
                n.dot(normal) < SHARP_DEG.to_radians().cos() && d.abs() < FEATURE_NOISE * noise + scale.spacing
            })
            .find_map(|q| meet(*own, *q, at));
    }
    Placed { at, normal, sample, moved, mean: bend.1, gauss: bend.0, edge, outlier: false }
}

/// Where two sheets meet, near a point: alternating steps onto both.
fn meet(a: super::Quadric, b: super::Quadric, p: DVec3) -> Option<DVec3> {
    let mut x = p;
    for _ in 0..6 {
        let ((d, n), (e, m)) = (a.distance(x), b.distance(x));
        // The least step that satisfies both to first order.
        let c = n.dot(m);
        let det = 1.0 - c * c;
        if det.is_nan() || det <= 1e-6 {
            return None;
        }
        let (s, t) = ((d - c * e) / det, (e - c * d) / det);
        x -= s * n + t * m;
    }
    x.is_finite().then_some(x)
}

/// Joins thinned feature points: every point to the nearest one on each of two sides.
fn feature_lines(all: &[DVec3], gap: f64) -> Vec<Vec<DVec3>> {
    if all.len() < 2 || !is_positive(gap) {
        return Vec::new();
    }
    let tree = KdTree::new(all);
    let sorted: Vec<DVec3> = tree.order().iter().map(|&i| all[i as usize]).collect();
    let sorted_tree = KdTree::new(&sorted);
    let points: Vec<DVec3> = cover(&sorted, &sorted_tree, |_| gap).into_iter().map(|i| sorted[i as usize]).collect();
    let tree = KdTree::new(&points);
    let mut near = Vec::new();
    let mut links: Vec<Vec<u32>> = vec![Vec::new(); points.len()];
    for (i, &p) in points.iter().enumerate() {
        tree.nearest_within(p, 7, 2.0 * gap, &mut near);
        let mut first: Option<DVec3> = None;
        for n in near.iter().filter(|n| n.1 as usize != i) {
            let way = (points[n.1 as usize] - p).normalize_or_zero();
            match first {
                None => first = Some(way),
                // The second neighbour lies on the other side.
                Some(f) if f.dot(way) < -0.3 => {
                    links[i].push(n.1);
                    break;
                }
                Some(_) => continue,
            }
            links[i].push(n.1);
        }
    }
    // Both ends must want a link.
    let mutual: Vec<Vec<u32>> = (0..points.len())
        .map(|i| links[i].iter().copied().filter(|&j| links[j as usize].contains(&(i as u32))).collect())
        .collect();
    let mut seen = vec![false; points.len()];
    let mut lines = Vec::new();
    // Open lines from their ends, then loops.
    for loops in [false, true] {
        for start in 0..points.len() {
            if seen[start] || mutual[start].is_empty() || (!loops && mutual[start].len() != 1) {
                continue;
            }
            let mut line = vec![points[start]];
            seen[start] = true;
            let mut at = start;
            while let Some(&next) = mutual[at].iter().find(|&&j| !seen[j as usize]) {
                seen[next as usize] = true;
                line.push(points[next as usize]);
                at = next as usize;
            }
            if loops && mutual[at].contains(&(start as u32)) && line.len() > 2 {
                line.push(points[start]);
            }
            if line.len() > 2 {
                lines.push(line);
            }
        }
    }
    lines
}
