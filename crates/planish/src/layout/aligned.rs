//! Layouts that follow the form: cross field, injective seamless map, whole numbers.
//!
//! 1. an even proxy mesh of the input ([`proxy`]);
//! 2. the smoothest cross field along its lines and principal directions ([`crate::network::field`]);
//! 3. the seamless map of that field, without flipped triangles ([`map`]);
//! 4. whole numbers for its cones and lines, for any number of patches ([`integers`]), and the smoothest map with them;
//! 5. the grid of whole numbers is the network.
//!
//! Where a step cannot do its work the next gentler one is tried ([`Attempt`]); what was left out is told.

use super::embed::{self, EmbedError};
use super::fan;
use super::integers::{self, QuantizeError, Scale};
use super::map::{self, Charts, SeamlessMap};
use super::proxy::{self, Proxy, Sizing};
use super::recut::Bench;
use super::{LayoutParams, SETTLING_PER_SMOOTHING, improve};
use crate::mesh::{NONE, TriMesh, next};
use crate::network::Network;
use crate::network::field::{self, FieldParams};
use crate::observe::{Cancelled, Observer};
use glam::{DMat2, DVec3};
use planish_sparse::SparseCholesky;
use std::f64::consts::FRAC_PI_2;

/// Triangles of the proxy: the seamless maps of the measured meshes were made on 5 000 to 6 000 (two fifths of a second).
const PROXY_TRIANGLES: usize = 6_000;

/// Radius of the mean of principal directions, in sides of a patch of [`TYPICAL_PATCHES`].
const RADIUS_TO_SIDE: f64 = 0.4;

/// Opposite cones nearer than this, in the same sides, are taken for noise.
const PAIR_TO_SIDE: f64 = 0.5;

/// Patches of a typical layout, which the scale of directions goes by.
const TYPICAL_PATCHES: f64 = 100.0;

/// Rounds of making the proxy finer where cones are tight; each halves its edges there.
const REFINEMENTS: usize = 2;

/// How gently the field follows the form, and on how fine a proxy.
struct Attempt {
    triangles: usize,
    curvature: f64,
    smoothing: f64,
}

/// The attempts in their order: the field with principal directions, on a finer proxy, and without principal directions.
const ATTEMPTS: [Attempt; 3] = [
    Attempt { triangles: PROXY_TRIANGLES, curvature: 1.0, smoothing: 1.0 },
    Attempt { triangles: 2 * PROXY_TRIANGLES, curvature: 1.0, smoothing: 1.0 },
    Attempt { triangles: PROXY_TRIANGLES, curvature: 0.0, smoothing: 1.0 },
];

/// A mesh with its seamless map.
struct Aligned {
    proxy: Proxy,
    charts: Charts,
    mapped: map::Mapped,
}

impl Aligned {
    /// The map of a mesh.
    ///
    /// A triangle whose corners are all bound, by lines or as cones, may get no area on whole numbers. Where cones are that
    /// near to lines and to each other the proxy is made finer, until none is.
    fn on(
        (mesh, sharp): (&TriMesh, &[bool]),
        attempt: &Attempt,
        observer: &dyn Observer,
    ) -> Result<Option<Aligned>, Cancelled> {
        let mut sizing = Sizing::even(mesh, attempt.triangles);
        let mut rounds = REFINEMENTS;
        let (proxy, charts) = loop {
            let Some(proxy) = proxy::proxy(mesh, sharp, &[], &sizing, observer) else { return Ok(None) };
            let charts = charts(&proxy, attempt, observer)?;
            let tight = tight(&proxy, &charts);
            if tight.is_empty() || rounds == 0 {
                break (proxy, charts);
            }
            rounds -= 1;
            let edges: Vec<f64> = tight.iter().map(|&p| sizing.at(p) / 2.0).collect();
            tight.into_iter().zip(edges).for_each(|(place, edge)| sizing.shorten(place, edge));
        };
        let mapped = map::seamless(&proxy.mesh, &proxy.adjacency, &proxy.lines, &charts, observer)?;
        Ok(mapped.map(|mapped| Aligned { proxy, charts, mapped }))
    }
}

/// The charts of the field on a proxy.
fn charts(proxy: &Proxy, attempt: &Attempt, observer: &dyn Observer) -> Result<Charts, Cancelled> {
    let Proxy { mesh, adjacency, lines, .. } = proxy;
    let area: f64 = (0..mesh.triangles.len()).map(|f| mesh.area(f)).sum();
    let side = (area / TYPICAL_PATCHES).sqrt();
    let params = FieldParams {
        curvature: attempt.curvature,
        smoothing: attempt.smoothing,
        radius: RADIUS_TO_SIDE * side,
        pair_distance: PAIR_TO_SIDE * side,
    };
    let field = field::field(mesh, adjacency, lines, &params, observer)?;
    Ok(Charts::new(mesh, adjacency, lines, &field))
}

/// The cones beside a line or another cone.
fn tight(proxy: &Proxy, charts: &Charts) -> Vec<DVec3> {
    let Proxy { mesh, adjacency, lines, .. } = proxy;
    let on_line = |h: u32| lines[h as usize] || adjacency.opposite[h as usize] == NONE;
    let mut lined = vec![false; mesh.points.len()];
    for h in (0..lines.len() as u32).filter(|&h| on_line(h)) {
        lined[mesh.origin(h) as usize] = true;
        lined[mesh.origin(next(h)) as usize] = true;
    }
    let corners = charts.corners();
    let is_tight = |v: u32| {
        let bound = |h: u32| lined[mesh.origin(next(h)) as usize] || corners[mesh.origin(next(h)) as usize];
        corners[v as usize] && !lined[v as usize] && adjacency.fan(v).any(bound)
    };
    (0..mesh.points.len() as u32).filter(|&v| is_tight(v)).map(|v| mesh.points[v as usize]).collect()
}

/// Why no network follows the form.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum AlignError {
    /// Corners that are given need not be corners of the field.
    #[error("its corners are given")]
    Corners,
    /// There is no even mesh or no map.
    #[error("the mesh cannot be mapped")]
    Unmapped,
    /// The map is not one-to-one.
    #[error("its map stays folded in {faults} places")]
    Folded {
        /// Faces and vertices.
        faults: usize,
    },
    /// Patches that run along the form would be slanted or bend too much.
    #[error("patches along its form would be slanted")]
    Skewed,
    /// Another number of patches than the one asked for.
    #[error("patches along its form would be {found}")]
    Count {
        /// How many they would be.
        found: usize,
    },
    /// The whole numbers.
    #[error("{0}")]
    Quantize(#[from] QuantizeError),
    /// The cells.
    #[error("{0}")]
    Embed(#[from] EmbedError),
    /// Cells are not where they should be.
    #[error("its cells do not lie in the mesh as they should")]
    Misplaced,
    /// Stopped by the observer.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// A patch whose isolines cross more than this off a right angle is hard to fit; so many of the patches may, degrees.
const MOST_SKEW_DEG: f64 = 35.0;

/// The normal of a patch turns by at most this from side to side: a quarter and a third of it, radians.
const MOST_TURN: f64 = 2.1;

/// What is smaller than this part of a patch's side is detail that its grid carries, and does not turn its normal.
const DETAIL_TO_SIDE: f64 = 0.5;

/// Part of the patches that has to keep both.
const KEPT: f64 = 0.95;

/// Numbers of patches that are tried, in those of the coarsest network: as few as the form needs.
const GROWTH: [f64; 8] = [1.0, 1.4, 2.0, 2.8, 4.0, 5.7, 8.0, 11.3];

/// More patches than this are not tried where nobody asked for them.
const MOST_UNASKED: f64 = 300.0;

/// Numbers that are tried in place of one that was asked for and that the form does not allow.
const NEAR_ASKED: [f64; 4] = [1.0, 1.1, 0.9, 1.2];

/// A number of patches that was asked for is missed by at most this part of it.
const MOST_MISSED: f64 = 0.25;

/// How well patches are shaped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fitness {
    /// Greatest angle off a right one between isolines, on [`KEPT`] of the patches, degrees.
    pub skew_deg: f64,
    /// Greatest turn of the normal across a patch, on [`KEPT`] of the patches, radians.
    pub turn: f64,
}

impl Fitness {
    fn is_good(self) -> bool {
        self.skew_deg <= MOST_SKEW_DEG && self.turn <= MOST_TURN
    }
}

/// A network that follows the form.
pub(super) struct Laid {
    pub network: Network,
    pub cones: usize,
    /// Mean angle between the patches' isolines and the field, degrees.
    pub deviation_deg: f64,
}

/// The network of `mesh` that follows its form, with the number of patches that `params` ask for or as few as the form
/// needs.
/// # Errors
/// [`AlignError`] says why there is none.
pub(super) fn lay(
    mesh: &TriMesh,
    sharp: &[bool],
    corners: &[bool],
    params: &LayoutParams,
    observer: &dyn Observer,
) -> Result<Laid, AlignError> {
    if corners.iter().any(|c| *c) {
        return Err(AlignError::Corners);
    }
    let mut why = AlignError::Unmapped;
    for attempt in &ATTEMPTS {
        // A finer proxy of the same form has patches of the same shape.
        if matches!(why, AlignError::Skewed | AlignError::Count { .. }) && attempt.triangles > PROXY_TRIANGLES {
            continue;
        }
        let Some(aligned) = Aligned::on((mesh, sharp), attempt, observer)? else {
            observer.check()?;
            continue;
        };
        observer.progress(0.3);
        let laid = match aligned.mapped.faults() {
            0 => aligned.choose(params, observer),
            faults => Err(AlignError::Folded { faults }),
        };
        match laid {
            Ok(laid) => return Ok(laid),
            Err(AlignError::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(e) => why = e,
        }
    }
    Err(why)
}

impl Aligned {
    /// The first network that does, of the numbers of patches in question.
    fn choose(&self, params: &LayoutParams, observer: &dyn Observer) -> Result<Laid, AlignError> {
        let scale = |growth: f64, of: usize| Scale::Squares(((of as f64 * growth).round() as usize).max(1));
        let least = if params.patches > 0 && !params.coarsest {
            params.patches
        } else {
            integers::quantize(
                &self.proxy.mesh,
                &self.proxy.adjacency,
                &self.mapped.map,
                &self.proxy.lines,
                Scale::Coarsest,
                observer,
            )?
            .squares
        };
        let growth: &[f64] = if params.patches > 0 { &NEAR_ASKED } else { &GROWTH };
        let mut why = AlignError::Skewed;
        for (i, &growth) in growth.iter().enumerate() {
            if i > 0 && params.patches == 0 && growth * least as f64 > MOST_UNASKED {
                break;
            }
            observer.progress(0.3 + 0.6 * i as f64 / NEAR_ASKED.len() as f64);
            let coarsest = growth == 1.0 && params.patches == 0;
            let scale = if coarsest { Scale::Coarsest } else { scale(growth, least) };
            match self.laid(scale, params, observer) {
                Err(AlignError::Cancelled(cancelled)) => return Err(cancelled.into()),
                Err(e) => why = e,
                Ok(laid) => {
                    let found = laid.network.patches.len();
                    if params.patches == 0
                        || found.abs_diff(params.patches) as f64 <= MOST_MISSED * params.patches as f64
                    {
                        return Ok(laid);
                    }
                    why = AlignError::Count { found };
                }
            }
        }
        Err(why)
    }

    /// The network at a scale, if its patches are well shaped or the coarsest is asked for.
    fn laid(&self, scale: Scale, params: &LayoutParams, observer: &dyn Observer) -> Result<Laid, AlignError> {
        let mapped = self.integers(scale, observer)?;
        match mapped.faults() {
            0 if params.coarsest || self.fitness(&mapped.map).is_good() => {
                let network = self.network(&mapped.map, params, observer)?;
                let cones = self.charts.index.iter().filter(|i| **i != 0).count();
                Ok(Laid { network, cones, deviation_deg: mapped.deviation_deg })
            }
            0 => Err(AlignError::Skewed),
            faults => Err(AlignError::Folded { faults }),
        }
    }

    /// How well the patches of the integer map `map` are shaped.
    pub fn fitness(&self, map: &SeamlessMap) -> Fitness {
        let mesh = &self.proxy.mesh;
        let normals = self.normals(map);
        let mut on_line = vec![false; mesh.points.len()];
        for h in (0..self.proxy.lines.len() as u32).filter(|&h| self.proxy.lines[h as usize]) {
            on_line[mesh.origin(h) as usize] = true;
        }
        let mut skew = Vec::with_capacity(map.uv.len());
        let mut turn = Vec::with_capacity(map.uv.len());
        for (f, [a, b, c]) in map.uv.iter().enumerate() {
            let [p, q, r] = field::flat(mesh, f);
            // Change of the surface, and of its normal, by u and v.
            let by_uv = DMat2::from_cols(*b - *a, *c - *a).inverse();
            let surface = DMat2::from_cols(q - p, r - p) * by_uv;
            // By patches, not by area: a squeezed one counts as much as a wide one.
            let part = (*b - *a).perp_dot(*c - *a);
            let off = surface.x_axis.angle_to(surface.y_axis).abs() - FRAC_PI_2;
            skew.push((off.abs().to_degrees(), part));
            let on_line = mesh.triangles[f].iter().any(|&v| on_line[v as usize]);
            let [l, m, n] = mesh.triangles[f].map(|v| normals[v as usize]);
            let (along, across) = (m - l, n - l);
            let change = [by_uv.x_axis, by_uv.y_axis].map(|d| (along * d.x + across * d.y).length());
            // Normals of vertices on lines are means over both sides.
            turn.push((if on_line { 0.0 } else { change[0].max(change[1]) }, part));
        }
        Fitness { skew_deg: kept(skew), turn: kept(turn) }
    }

    /// The normals of the vertices as a patch sees them: what is smaller than it is detail that a grid carries. One step of
    /// diffusion over [`DETAIL_TO_SIDE`] of its side, not across lines.
    fn normals(&self, map: &SeamlessMap) -> Vec<DVec3> {
        let Proxy { mesh, adjacency, lines, .. } = &self.proxy;
        let mut normals = mesh.vertex_normals();
        let area: f64 = (0..mesh.triangles.len()).map(|f| mesh.area(f)).sum();
        let squares: f64 = map.uv.iter().map(|[a, b, c]| (*b - *a).perp_dot(*c - *a) / 2.0).sum();
        let time = (DETAIL_TO_SIDE * DETAIL_TO_SIDE * area / squares.max(1.0)) / 4.0;
        let mut lined = vec![false; mesh.points.len()];
        (0..lines.len() as u32).filter(|&h| lines[h as usize]).for_each(|h| lined[mesh.origin(h) as usize] = true);
        let mut entries = Vec::with_capacity(4 * lines.len());
        let mut around = vec![0.0; mesh.points.len()];
        for h in 0..lines.len() as u32 {
            let (a, b) = (mesh.origin(h) as usize, mesh.origin(next(h)) as usize);
            around[a] += mesh.area(h as usize / 3) / 3.0;
            if h < adjacency.opposite[h as usize] && !lined[a] && !lined[b] {
                // Proxies are even: all their triangles are taken for equilateral.
                let weight = time / 3f64.sqrt();
                entries.extend([(a, a, weight), (b, b, weight), (a.max(b), a.min(b), -weight)]);
            }
        }
        entries.extend(around.iter().enumerate().map(|(v, &a)| (v, v, a.max(f64::MIN_POSITIVE))));
        let Ok(system) = SparseCholesky::factor(normals.len(), &entries) else { return normals };
        for axis in 0..3 {
            let mut one: Vec<f64> = normals.iter().zip(&around).map(|(n, a)| a * n[axis]).collect();
            system.solve(&mut one);
            normals.iter_mut().zip(one).for_each(|(n, x)| n[axis] = x);
        }
        normals.into_iter().map(DVec3::normalize_or_zero).collect()
    }

    /// The smoothest integer map at a scale.
    fn integers(&self, scale: Scale, observer: &dyn Observer) -> Result<map::Mapped, QuantizeError> {
        let Proxy { mesh, adjacency, lines, .. } = &self.proxy;
        let whole = integers::quantize(mesh, adjacency, &self.mapped.map, lines, scale, observer)?;
        let smooth =
            map::smooth_integers(mesh, adjacency, lines, &self.charts, (&self.mapped.map.uv, &whole.uv), observer)?;
        smooth.ok_or(QuantizeError::Tight)
    }

    /// The network of the integer map `map`, settled as `params` say: what the map squeezes is spread.
    fn network(
        &self,
        map: &SeamlessMap,
        params: &LayoutParams,
        observer: &dyn Observer,
    ) -> Result<Network, AlignError> {
        let Proxy { mesh, adjacency, lines, .. } = &self.proxy;
        let complex = embed::embed(mesh, adjacency, lines, map)?;
        let mut bench = Bench::new(mesh, adjacency, complex).ok_or(AlignError::Misplaced)?;
        let (patches, rounds) = (bench.complex.live_cells().count(), SETTLING_PER_SMOOTHING * params.smoothing);
        improve::settle(&mut bench, patches, rounds, observer).map_err(|_| Cancelled)?;
        let complex = self.proxy.back(&bench.complex).ok_or(AlignError::Misplaced)?;
        let (fine, fine_adjacency) = self.proxy.fine();
        let mut bench = Bench::new(fine, fine_adjacency, complex).ok_or(AlignError::Misplaced)?;
        improve::straighten(&mut bench, observer).map_err(|_| Cancelled)?;
        fan::spread(&mut bench);
        Ok(self.proxy.network(&bench.complex))
    }
}

/// The value that [`KEPT`] of the weight does not exceed.
fn kept(mut values: Vec<(f64, f64)>) -> f64 {
    values.retain(|v| v.0.is_finite());
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole: f64 = values.iter().map(|v| v.1).sum();
    let mut sum = 0.0;
    let reached = values.iter().find(|v| {
        sum += v.1;
        sum >= KEPT * whole
    });
    reached.map_or(0.0, |v| v.0)
}
