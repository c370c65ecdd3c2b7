//! Noisy points to oriented, denoised samples of a surface.
//!
//! [X03] Xie, Wang, Hua, Qin, Kaufman, *Piecewise C1 Continuous Surface Reconstruction of Noisy Point Clouds via Local
//! Implicit Quadric Regression*, 2003.
//! 1. order, duplicates: [`Cloud`]; stray points: `sites::strays`
//! 2. noise and radius of the fits (§6.1): `sites`, `sites::survey`
//! 3. fits in rising irregularity (§5, fig. 7; §4.1, §6.2): `sites::front`, `local::fit`
//! 4. orientation (§7, fig. 12): `orient`; bodies: `orient::segments`; misaligned views are one sheet: `orient::views`
//! 5. how the sheets of a site join: `cells`
//! 6. points on the surface, outliers: `project`
//!
//! The blend (§4.2, eq. 4) is `blend`, as a field `field::SampleField`. The equations and where each step departs from the
//! paper are in `docs/methods/samples.md`.

mod blend;
pub mod bricks;
mod cells;
mod local;
mod orient;
mod project;
mod sites;
mod stand;

pub use blend::{Blend, Blended};
pub use cells::Cell;
pub use local::Quadric;
pub use orient::Dipoles;
pub(crate) use project::{Brought, Gathered, PointScale};
pub use project::{Cleaned, PointFacts, ProjectParams, project};

use crate::geom::{Aabb, KdTree};
use crate::linalg::eigen3;
use crate::mesh::Attribute;
use crate::observe::{Cancelled, Observer, Part};
use glam::DVec3;
use local::fitted::Fit;
use local::moments;
use orient::Hints;
use orient::{link, views};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sites::{front, strays};

/// A scan: points and whatever else the file told of them. Flat arrays, one entry per point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    /// Positions, world units, less [`Cloud::shift`].
    pub points: Vec<DVec3>,
    /// Added to every position to get those of the file: large coordinates keep their digits.
    pub shift: DVec3,
    /// Named scalars or vectors per point: `normal` (3), `color` (3 or 4, 0 to 1), `intensity`, `classification`, ...
    pub attributes: Vec<Attribute>,
    /// Positions of the scanners, less the shift.
    pub scanners: Vec<DVec3>,
    /// Scanner that saw each point, an index into `scanners`; empty if unknown.
    pub seen_by: Vec<u32>,
}

impl Cloud {
    /// A cloud of bare points.
    pub fn new(points: Vec<DVec3>) -> Cloud {
        Cloud { points, ..Cloud::default() }
    }

    /// Bounding box of the points that are numbers.
    pub fn bounds(&self) -> Aabb {
        Aabb::of(self.points.iter().filter(|p| p.is_finite()))
    }

    /// The attribute of this name and width.
    pub fn attribute(&self, name: &str, width: usize) -> Option<&Attribute> {
        self.attributes.iter().find(|a| a.name == name && a.width == width)
    }

    /// The same with the positions of the file: without a shift.
    pub fn in_place(&self) -> Cloud {
        let mut cloud = self.clone();
        cloud.points.iter_mut().chain(&mut cloud.scanners).for_each(|p| *p += cloud.shift);
        cloud.shift = DVec3::ZERO;
        cloud
    }

    /// Keeps the points of these indices, in their order.
    pub fn select(&self, ids: &[u32]) -> Cloud {
        let attributes = self.attributes.iter().map(|a| a.picked(ids)).collect();
        let seen_by =
            if self.seen_by.is_empty() { Vec::new() } else { ids.iter().map(|&i| self.seen_by[i as usize]).collect() };
        Cloud {
            points: ids.iter().map(|&i| self.points[i as usize]).collect(),
            shift: self.shift,
            attributes,
            scanners: self.scanners.clone(),
            seen_by,
        }
    }
}

/// How to make samples. Nothing has to be set: noise and sizes come from the points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CleanParams {
    /// Do not use the normals of the file for the orientation
    pub ignore_normals: bool,
    /// Residuals above this many noise levels make an outlier
    #[schemars(range(min = 2.0, max = 20.0), extend("unit" = "noise"))]
    pub outlier: f64,
}

impl Default for CleanParams {
    fn default() -> Self {
        CleanParams { ignore_normals: false, outlier: 4.0 }
    }
}

/// Why there are no samples.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CloudError {
    /// Too few different points.
    #[error(
        "{distinct} different points of {given} are left after those that are no numbers or repeat others; at least {needed} are needed"
    )]
    TooFew {
        /// Points given.
        given: usize,
        /// Different finite points.
        distinct: usize,
        /// Points needed.
        needed: usize,
    },
    /// All points on a line.
    #[error("all {points} points lie on a line; a surface needs points beside it")]
    Collinear {
        /// Number of points.
        points: usize,
    },
    /// No neighbourhood looks like a surface.
    #[error("no neighbourhood of the {points} points looks like a surface; the points may be too few or fill a volume")]
    NoSurface {
        /// Number of points.
        points: usize,
    },
    /// What was kept of the scan on the way cannot be had.
    #[error(transparent)]
    Store(#[from] bricks::StoreError),
    /// The observer wants no result any more.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// A fitted sample: position, oriented normal, local quadric, support, irregularity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Place on the surface, world units.
    pub center: DVec3,
    /// Unit normal, outward.
    pub normal: DVec3,
    /// The local surface, positive outside, gradient of length one at the centre.
    pub quadric: Quadric,
    /// Radius of the points that it was fitted to, world units.
    pub radius: f64,
    /// Radius of what it speaks for, world units.
    pub support: f64,
    /// Expected error of the fit, world units.
    pub error: f64,
    /// Weight in the blend: higher for surer fits.
    pub trust: f64,
    /// Standard deviation of the points around it, world units.
    pub noise: f64,
    /// Area that it stands for, world units squared.
    pub area: f64,
    /// Variation of the gradient and noise over the radius.
    pub irregularity: f64,
    /// Priority class, 0 the most regular.
    pub class: u8,
    /// Sheets at its site: 1 regular, 2 crease, 3 and more corner.
    pub sheets: u8,
    /// Whether it is one side of a plate or a gap that was found as such.
    pub plate: bool,
    /// Body that it belongs to, by falling area.
    pub segment: u32,
    /// Share of its meetings with other samples that agree with its orientation, 0 to 1.
    pub confidence: f64,
}

/// All samples of a scan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// The samples.
    pub samples: Vec<Sample>,
    /// How the sheets of the samples join around every site.
    pub cells: Vec<Cell>,
    /// Standard deviation of the points, world units: the middle of all places.
    pub noise: f64,
    /// Distance of neighbouring points, world units: the middle of all places.
    pub spacing: f64,
    /// Typical error of the normals, degrees.
    pub normal_noise_deg: f64,
    /// Distance of sheets that were found side by side, the sides of a plate or a gap, world units: all but a twentieth are
    /// farther apart. Infinite where there are none.
    pub gap: f64,
    /// Whether each segment is closed.
    pub closed: Vec<bool>,
    /// Bounding-box diagonal of the points, world units.
    pub diagonal: f64,
}

/// Fewest different points: those of the smallest ball.
pub const FEWEST_POINTS: usize = 18;

/// Times that sheets which turn out to be one surface, seen twice, are fitted anew.
const JOIN_ROUNDS: usize = 4;

/// Fits oriented samples to a scan.
/// # Errors
/// [`CloudError`] for too few or collinear points, no surface, or if cancelled.
pub fn clean(cloud: &Cloud, params: &CleanParams, observer: &dyn Observer) -> Result<Samples, CloudError> {
    let (points, ids) = distinct(cloud)?;
    let (points, ids, tree) = strays::without(points, ids);
    let part = |from: f64, to: f64| Part::new(observer, from, to - from);
    let mut sites = sites::choose(&points, &tree, &part(0.0, 0.45))?;
    if sites.point.is_empty() {
        return Err(CloudError::NoSurface { points: points.len() });
    }
    let mut open: Vec<u32> = (0..sites.point.len() as u32).collect();
    let mut grown = Vec::new();
    let mut round = 0;
    let (fits, areas, oriented) = loop {
        let [from, to] = if round == 0 { [0.45, 0.85] } else { [0.85, 0.9] };
        grown = front::grow(&tree, &sites, &open, grown, &part(from, to))?;
        let fits = front::supported(&points, grown.clone());
        if fits.is_empty() {
            return Err(CloudError::NoSurface { points: points.len() });
        }
        let centers: Vec<DVec3> = fits.iter().map(|f| f.center).collect();
        let votes = link::votes(&fits, &KdTree::new(&centers));
        let areas: Vec<f64> =
            fits.iter().map(|f| f.owned as f64 * sites.survey[f.site as usize].spacing.powi(2)).collect();
        let known = |of: &Direction| of_fits(&fits, &points, &tree, |i| of(ids[i as usize] as usize));
        let toward = toward_scanner(cloud).map(|of| known(&of));
        let normals = given_normals(cloud).filter(|_| !params.ignore_normals).map(|of| known(&of));
        let hints = Hints { toward: toward.as_deref(), normals: normals.as_deref(), areas: &areas };
        let oriented = orient::orient(&fits, &votes, &hints);
        let twice = if round < JOIN_ROUNDS { views::aside(&fits, &oriented.sign, &hints) } else { Vec::new() };
        if twice.is_empty() {
            break (fits, areas, oriented);
        }
        round += 1;
        sites.join(&tree, &twice);
        open = twice.iter().map(|t| t.0).collect();
        open.sort_unstable();
        grown.retain(|f: &Fit| open.binary_search(&f.site).is_err());
    };
    let mut samples: Vec<Sample> = fits
        .iter()
        .enumerate()
        .map(|(i, f)| {
            let survey = &sites.survey[f.site as usize];
            let sign = oriented.sign[i];
            Sample {
                center: f.center,
                normal: f.normal * sign,
                quadric: if sign < 0.0 { f.quadric.flipped() } else { f.quadric },
                radius: f.radius,
                support: sites.support(f.site as usize),
                error: f.error,
                trust: (survey.radius / f.error.max(1e-6 * survey.radius)).min(1e6).powi(2),
                noise: f.noise,
                area: areas[i],
                irregularity: f.irregularity,
                class: f.class,
                sheets: f.sheets,
                plate: f.gap.is_finite(),
                segment: oriented.segment[i],
                confidence: oriented.confidence[i],
            }
        })
        .collect();
    let of_site: Vec<u32> = fits.iter().map(|f| f.site).collect();
    let cells = cells::cells(&points, &tree, &sites, &samples, &of_site, &part(0.9, 1.0))?;
    // What was chosen by its residuals is moved to where the surface is last.
    for (s, &site) in samples.iter_mut().zip(&of_site) {
        s.quadric = s.quadric.sharpened(s.center, sites.noise(site as usize));
        (s.center, s.normal) = s.quadric.project(s.center);
        s.quadric = s.quadric.normalized_at(s.center);
    }
    observer.progress(1.0);
    let middle = |mut v: Vec<f64>| {
        v.sort_unstable_by(f64::total_cmp);
        v[v.len() / 2]
    };
    // A slope of a fit is off by about twice the noise over radius and root of the points.
    let slope = middle(samples.iter().map(|s| 2.0 * s.error / s.radius).collect());
    Ok(Samples {
        noise: middle(sites.survey.iter().map(|s| s.noise).collect()),
        spacing: middle(sites.survey.iter().map(|s| s.spacing).collect()),
        normal_noise_deg: slope.to_degrees(),
        gap: least_gap(&fits),
        samples,
        cells,
        closed: oriented.closed,
        diagonal: Aabb::of(&points).diagonal(),
    })
}

/// The twentieth part of the gaps between sheets side by side, if more than a hundredth of the fits have one.
fn least_gap(fits: &[Fit]) -> f64 {
    let mut gaps: Vec<f64> = fits.iter().map(|f| f.gap).filter(|g| g.is_finite()).collect();
    gaps.sort_unstable_by(f64::total_cmp);
    if gaps.len() * 100 > fits.len() { gaps[gaps.len() / 20] } else { f64::INFINITY }
}

/// Different finite points in the order of their tree, with the index of each in the cloud.
fn distinct(cloud: &Cloud) -> Result<(Vec<DVec3>, Vec<u32>), CloudError> {
    let finite: Vec<u32> = (0..cloud.points.len() as u32).filter(|&i| cloud.points[i as usize].is_finite()).collect();
    let tree = KdTree::new(&finite.iter().map(|&i| cloud.points[i as usize]).collect::<Vec<_>>());
    let mut ids: Vec<u32> = tree.order().iter().map(|&k| finite[k as usize]).collect();
    // Equal points are neighbours in a leaf, or nearly so; a sort by place finds them all.
    let mut by_place = ids.clone();
    by_place.sort_unstable_by(|&a, &b| {
        let (p, q) = (cloud.points[a as usize], cloud.points[b as usize]);
        p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)).then(p.z.total_cmp(&q.z)).then(a.cmp(&b))
    });
    let mut repeats = vec![false; cloud.points.len()];
    for pair in by_place.windows(2) {
        if cloud.points[pair[0] as usize] == cloud.points[pair[1] as usize] {
            repeats[pair[1] as usize] = true;
        }
    }
    ids.retain(|&i| !repeats[i as usize]);
    if ids.len() < FEWEST_POINTS {
        return Err(CloudError::TooFew { given: cloud.points.len(), distinct: ids.len(), needed: FEWEST_POINTS });
    }
    let points: Vec<DVec3> = ids.iter().map(|&i| cloud.points[i as usize]).collect();
    let center = points.iter().sum::<DVec3>() / points.len() as f64;
    let mut m = moments::Moments::ZERO;
    let size = Aabb::of(&points).diagonal();
    points.iter().for_each(|&p| m.add((p - center) / size, 1.0));
    let (values, _) = eigen3(m.covariance());
    // Rounding of the covariance, relative to the longest direction.
    if values[1] < 1e-14 * values[2] {
        return Err(CloudError::Collinear { points: points.len() });
    }
    Ok((points, ids))
}

/// What a file tells of the outside at a point of it: a unit vector, or zero.
type Direction<'a> = dyn Fn(usize) -> DVec3 + Sync + 'a;

/// Normals of the file, if there are any.
fn given_normals(cloud: &Cloud) -> Option<Box<Direction<'_>>> {
    let normals = &cloud.attribute("normal", 3)?.values;
    Some(Box::new(move |i| DVec3::from_array([0, 1, 2].map(|k| normals[3 * i + k] as f64)).normalize_or_zero()))
}

/// Directions to the scanners, if they are known.
fn toward_scanner(cloud: &Cloud) -> Option<Box<Direction<'_>>> {
    if cloud.scanners.is_empty() || (cloud.seen_by.is_empty() && cloud.scanners.len() != 1) {
        return None;
    }
    Some(Box::new(|i| {
        let by = cloud.seen_by.get(i).copied().unwrap_or(0) as usize;
        cloud.scanners.get(by).map_or(DVec3::ZERO, |s| (*s - cloud.points[i]).normalize_or_zero())
    }))
}

/// Points around a fit that are asked what the file tells of them.
const TOLD: usize = 16;

/// What the file tells of the outside at every fit: the mean over its points, and not over those of another sheet there.
fn of_fits(fits: &[Fit], points: &[DVec3], tree: &KdTree, of: impl Fn(u32) -> DVec3 + Sync) -> Vec<DVec3> {
    (0..fits.len())
        .into_par_iter()
        .map_init(Vec::new, |near, i| {
            let f = &fits[i];
            let other = front::other_sheet(fits, i);
            tree.nearest(f.center, TOLD, near);
            let own = near.iter().map(|n| n.1).filter(|&p| {
                let off = |g: &Fit| g.quadric.distance(points[p as usize]).0.abs();
                other.is_none_or(|j| off(f) <= off(&fits[j]))
            });
            own.map(&of).sum::<DVec3>().normalize_or_zero()
        })
        .collect()
}
