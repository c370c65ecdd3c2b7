//! Automatic layout: a network of four-sided patches on any manifold mesh.
//!
//! 1. sharp lines and boundaries are fixed; long edges are split ([`proxy::refine`]);
//! 2. a centroidal partition into disks between the fixed lines ([`partition`], [`partition::outline`]);
//! 3. all cells are made even and parted into quads ([`partition::polygon`]);
//! 4. nodes, arcs and connectivity are improved by changes inside the union of a few cells, each drawn in a one-to-one
//!    map of that union ([`recut`]), so that nothing ever crosses or gets lost; this happens on a coarser mesh of the
//!    same surface, and the arcs are carried back ([`proxy::coarse`]);
//! 5. arcs are made fair and leave their nodes at even angles ([`fair`]).
//!
//! The papers have no automatic layout; the method with its energy is in `docs/methods/layout.md`, the choice of maps in
//! `docs/decisions/0005-spade-and-convex-maps.md`.

mod aligned;
mod complex;
mod embed;
mod fair;
mod fill;
mod fitness;
mod improve;
mod integers;
mod lines;
mod map;
mod partition;
mod proxy;
mod recut;
mod shape;
mod slide;
mod strips;

pub use crate::layout::aligned::count_is_near;
use crate::layout::aligned::{AlignError, Search, Worth};
use crate::layout::complex::Complex;
use crate::layout::partition::{outline, polygon, tips};
use crate::layout::proxy::refine::Refined;
use crate::layout::proxy::{coarse, refine};
use crate::layout::recut::Bench;
use crate::mesh::{Adjacency, FacePoint, FeatureTags, MeshParts, NONE, TriMesh, components, next};
use crate::network::imprint::{self, Shared};
use crate::network::{Corner, Curve, Network, Patch, Side};
use crate::observe::{Cancelled, Observer, Part, counted};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::collections::HashSet;

/// Edges of the working mesh against the side of a patch: short enough for a curve to find its way.
const EDGE_TO_SIDE: f64 = 0.12;

/// Attempts with edges of half the length each, where the working mesh proves too coarse.
const MESH_ATTEMPTS: usize = 5;

/// Triangles of the working mesh at most, for each one of the input and for each patch. Even ones of [`EDGE_TO_SIDE`] are
/// 160 a patch (2.3 / EDGE_TO_SIDE^2), and up to four times as many where halving passes that length. Strips and needles,
/// which would take any number, are followed less closely.
const WORK_PER_TRIANGLE: usize = 4;
const WORK_PER_PATCH: usize = 640;

/// Attempts at the number of patches asked for: the features decide how many patches a partition gives.
const COUNT_ATTEMPTS: usize = 3;

/// No part of the surface lies further from the middle of its first cell than this, in sides of a patch, even if
/// features use up the number of patches elsewhere.
const COVER: f64 = 2.4;

/// Patches smaller than this part of the mean stand on specks and slivers and do not count as forced.
const CROWDED: f64 = 0.05;

/// Triangles of the mesh for each patch at least: a square of two.
const TRIANGLES_PER_PATCH: usize = 2;
/// Part of the patches of the first draft that counts as forced by the features.
const FORCED: f64 = 0.85;

/// Rounds of settling for each round of smoothing asked for: a round redraws disjoint unions only.
const SETTLING_PER_SMOOTHING: usize = 8;

/// The last settling is for patches of this part of the size: meshes for it are that much finer. Chosen, so that their edges are
/// shorter than the radius within which the ground of a corner is taken.
const FINISH_TO_SIDE: f64 = 0.5;

/// Patches of a typical layout; default ones of the measured meshes have 33 to 285. The scale of directions goes by their side, and
/// pieces of less area than one are small.
pub(crate) const TYPICAL_PATCHES: f64 = 100.0;

/// More patches along the form than this are not tried where nobody asked for them: where lines and cones alone need more, the
/// partition does with fewer. Chosen.
const MOST_UNASKED: usize = 300;

/// Unless its patches fold: then up to so many times as many along the form are tried. Chosen.
const MORE_UNFOLDED: usize = 2;

/// Patches of a partition where no number is asked for.
const PARTITION_PATCHES: usize = 120;

/// Parameters of [`layout`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LayoutParams {
    /// Number of patches to aim at; 0 for as few as the form needs. Sharp lines may force more.
    #[schemars(range(min = 0, max = 100_000))]
    pub patches: usize,
    /// As few patches as the form allows, however they are shaped.
    pub coarsest: bool,
    /// Patches of about one size, whatever the form: where those along the form fold or wind.
    pub even: bool,
    /// Edges whose faces meet at more than this angle are sharp and become patch boundaries.
    #[schemars(range(min = 1.0, max = 180.0), extend("unit" = "deg"))]
    pub sharp_angle_deg: f64,
    /// Sharp lines with a loose end that are shorter than this fraction of the diagonal are surface detail, and so
    /// are closed ones half as long.
    #[schemars(range(min = 0.0, max = 1.0), extend("unit" = "diagonal"))]
    pub feature_length: f64,
    /// Rounds of making corners and curves even at the end.
    #[schemars(range(min = 0, max = 50))]
    pub smoothing: usize,
}

impl Default for LayoutParams {
    fn default() -> LayoutParams {
        LayoutParams {
            patches: 0,
            coarsest: false,
            even: false,
            sharp_angle_deg: 40.0,
            feature_length: 0.1,
            smoothing: 3,
        }
    }
}

/// Why no layout was made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LayoutError {
    /// The mesh has no faces.
    #[error("the mesh has no faces")]
    Empty,
    /// The mesh is not an oriented manifold.
    #[error("{edges} edges of the mesh have more than two faces or faces that disagree - hint: repair the mesh first")]
    NotManifold {
        /// Number of such edges.
        edges: usize,
    },
    /// There are more pieces than [`most_patches`].
    #[error(
        "the mesh has {pieces} pieces of {triangles} triangles together, too few for a patch on each - hint: loose triangles are no \
         surface, see `planish info`"
    )]
    Loose {
        /// Number of pieces.
        pieces: usize,
        /// Triangles of the mesh.
        triangles: usize,
    },
    /// The faces do not allow a network, even when split.
    #[error("no four-sided network was found on {faces} faces - hint: look for degenerate faces with `planish info`")]
    Stuck {
        /// Faces of the mesh.
        faces: usize,
    },
    /// Stopped by the observer.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// Lines that are known before a network is laid; each may be empty.
#[derive(Clone, Copy, Debug, Default)]
pub struct Known<'a> {
    /// For each half-edge whether it is sharp, whatever the angles say; short and loose lines of them are left out as with
    /// any. Empty to go by the angles.
    pub sharp: &'a [bool],
    /// For each half-edge whether it becomes a patch boundary like a feature line.
    pub lines: &'a [bool],
    /// For each vertex of such lines whether it becomes a corner.
    pub corners: &'a [bool],
}

/// Tries networks before one is taken.
pub trait Trial: Sync {
    /// Number of places where surfaces over the patches of `network`, which covers `mesh`, turn over.
    /// # Errors
    /// [`Cancelled`] by the observer.
    fn folds(&self, mesh: &TriMesh, network: &Network, observer: &dyn Observer) -> Result<usize, Cancelled>;
}

/// How the patches of a piece of a mesh were laid.
#[derive(Clone, Debug, PartialEq)]
pub enum Method {
    /// Along a cross field, by a map of it.
    Field {
        /// Places where the field has three or five directions.
        cones: usize,
        /// Mean angle between the isolines of the patches and the field, degrees.
        deviation_deg: f64,
        /// Places where a trial finds surfaces folded; even patches do no better then.
        folds: usize,
    },
    /// By a partition into even cells, improved one by one: where there is no usable map, or where that was asked for.
    Partition {
        /// Why there is no usable map, if that is the reason.
        why: Option<String>,
    },
}

/// A network with the story of its making.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// The network.
    pub network: Network,
    /// For each piece of the mesh its part of the area and how its patches were laid; small pieces are one together.
    pub pieces: Vec<(f64, Method)>,
}

/// Faces of a mesh that are laid out by themselves.
struct Piece<'a> {
    mesh: &'a TriMesh,
    /// For each half-edge whether it lies on a line that is a patch boundary.
    sharp: &'a [bool],
    /// For each vertex whether it is to be a corner; may be empty.
    corners: &'a [bool],
    /// Part of the area of the whole mesh.
    share: f64,
}

/// Lays a conforming network of four-sided patches on `mesh`, an oriented manifold with or without boundary.
///
/// Each piece of the mesh gets a network of its own: what is in the way of one is not in that of another.
///
/// Sharp lines and boundaries lie on patch boundaries; every patch is an exact disk ([`crate::network::imprint`]).
/// * `trial` - tells whether patches along the form are good enough, or those of a partition better; without it their shapes do
/// # Errors
/// `NotManifold` for a mesh that needs repair, `Loose` for single triangles, `Stuck` if its faces are degenerate beyond use;
/// `Cancelled`.
pub fn layout(
    mesh: &TriMesh,
    known: Known,
    params: &LayoutParams,
    trial: Option<&dyn Trial>,
    observer: &dyn Observer,
) -> Result<Layout, LayoutError> {
    let Known { sharp: tagged, lines, corners } = known;
    check(mesh)?;
    let adjacency = Adjacency::new(mesh);
    let (piece_of, pieces) = components(&adjacency);
    if pieces > most_patches(mesh) {
        return Err(LayoutError::Loose { pieces, triangles: mesh.triangles.len() });
    }
    let mut sharp = lines::feature_lines(mesh, &adjacency, tagged, params, observer)?;
    sharp.iter_mut().zip(lines).for_each(|(s, &line)| *s |= line);
    let groups = grouped(mesh, &piece_of, pieces);
    if let [_] = groups[..] {
        let piece = Piece { mesh, sharp: &sharp, corners, share: 1.0 };
        let (network, method) = lay(&piece, params, trial, observer)?;
        return Ok(Layout { network, pieces: vec![(1.0, method)] });
    }
    let (none, mut start) = (FeatureTags::default(), 0.0);
    let mut parts = MeshParts::new(mesh, &none);
    let mut laid = Layout { network: Network::default(), pieces: Vec::with_capacity(groups.len()) };
    for (faces, share) in &groups {
        let part = parts.part(faces);
        let sharp: Vec<bool> = faces.iter().flat_map(|&f| &sharp[3 * f as usize..][..3]).copied().collect();
        let corners: Vec<bool> = part.vertices.iter().filter_map(|&v| corners.get(v as usize).copied()).collect();
        let piece = Piece { mesh: &part.mesh, sharp: &sharp, corners: &corners, share: *share };
        let (network, method) = lay(&piece, params, trial, &Part::new(observer, start, *share))?;
        append(&mut laid.network, network, faces);
        laid.pieces.push((*share, method));
        start += share;
    }
    Ok(laid)
}

/// The pieces of a mesh with their shares of its area, the largest first; those too small for one of [`TYPICAL_PATCHES`] are
/// the last one together.
/// * `piece_of` - for each face its piece
fn grouped(mesh: &TriMesh, piece_of: &[u32], pieces: usize) -> Vec<(Vec<u32>, f64)> {
    let mut found: Vec<(Vec<u32>, f64)> = vec![Default::default(); pieces];
    for (f, &piece) in piece_of.iter().enumerate() {
        found[piece as usize].0.push(f as u32);
        found[piece as usize].1 += mesh.area(f);
    }
    let whole: f64 = found.iter().map(|(_, area)| area).sum();
    found.iter_mut().for_each(|(_, area)| *area /= whole);
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    let large = found.iter().take_while(|(_, share)| share * TYPICAL_PATCHES >= 1.0).count().max(1);
    let small = found.split_off(large.min(found.len()));
    if !small.is_empty() {
        let mut faces: Vec<u32> = small.iter().flat_map(|(faces, _)| faces).copied().collect();
        faces.sort_unstable();
        found.push((faces, small.iter().map(|(_, share)| share).sum()));
    }
    found
}

/// Puts the network of some faces of a mesh beside another.
fn append(network: &mut Network, mut piece: Network, faces: &[u32]) {
    let (corners, curves) = (network.corners.len() as u32, network.curves.len() as u32);
    piece.corners.iter_mut().for_each(|c| c.place.face = faces[c.place.face as usize]);
    for curve in &mut piece.curves {
        curve.corners.iter_mut().for_each(|c| *c += corners);
        curve.points.iter_mut().for_each(|p| p.face = faces[p.face as usize]);
    }
    piece.patches.iter_mut().flat_map(|p| &mut p.sides).for_each(|s| s.curve += curves);
    network.corners.append(&mut piece.corners);
    network.curves.append(&mut piece.curves);
    network.patches.append(&mut piece.patches);
}

/// The network of a piece along its form, or of a partition where that folds in fewer places, is worth more or was asked for. A number of
/// patches is asked for of the whole mesh.
fn lay(
    piece: &Piece,
    params: &LayoutParams,
    trial: Option<&dyn Trial>,
    observer: &dyn Observer,
) -> Result<(Network, Method), LayoutError> {
    let of_piece = |patches: usize| ((piece.share * patches as f64).round() as usize).max(1);
    let params = &match params.patches {
        0 => params.clone(),
        patches => LayoutParams { patches: of_piece(patches).min(most_patches(piece.mesh)), ..params.clone() },
    };
    let trial = trial.filter(|_| !params.coarsest);
    let along = (!params.even)
        .then(|| aligned::lay(piece, params, Search { trial, most: MOST_UNASKED, is_last: false }, observer));
    let many = match along {
        Some(Err(AlignError::Count { found })) => Some(found),
        _ => None,
    };
    let (along, why) = match along {
        None => (None, None),
        Some(Ok(laid)) if params.coarsest || laid.is_sound() => return Ok(laid.into()),
        Some(Ok(laid)) if laid.worth.is_kept() => {
            let why = match laid.folds.filter(|folds| *folds > 0) {
                Some(folds) => format!("surfaces along its form would fold in {}", counted(folds, "place", "places")),
                None => "patches along its form would be covered less well by grids".to_owned(),
            };
            (Some(laid), Some(why))
        }
        Some(Ok(laid)) => {
            let found = laid.network.patches.len();
            (Some(laid), Some(AlignError::Count { found }.to_string()))
        }
        Some(Err(AlignError::Cancelled(cancelled))) => return Err(cancelled.into()),
        Some(Err(why)) => (None, Some(why.to_string())),
    };
    let asked = aligned::asked(params);
    let patches = match params.patches {
        _ if params.coarsest => 1,
        0 => of_piece(PARTITION_PATCHES),
        patches => patches,
    };
    let (network, good_part) = partitioned(piece, &LayoutParams { patches, ..params.clone() }, observer)?;
    if along.is_none() && many.is_none() {
        return Ok((network, Method::Partition { why }));
    }
    let worth = Worth::new(network.patches.len(), asked, good_part);
    let folds = tried(trial, piece.mesh, &network, observer)?;
    let most = MORE_UNFOLDED * network.patches.len();
    let along = if folds.is_some_and(|folds| folds > 0) && many.is_some_and(|many| many <= most) {
        match aligned::lay(piece, params, Search { trial, most, is_last: true }, &Part::new(observer, 1.0, 0.0)) {
            Err(AlignError::Cancelled(cancelled)) => return Err(cancelled.into()),
            laid => laid.ok(),
        }
    } else {
        along
    };
    let Some(laid) = along else { return Ok((network, Method::Partition { why })) };
    // Where neither is good the form is followed, unless that is worse.
    let is_better = match by_folds(folds, laid.folds) {
        Ordering::Less => worth.is_kept() || !laid.worth.is_kept(),
        Ordering::Equal => worth.exceeds(laid.worth),
        Ordering::Greater => worth.is_kept() && !laid.worth.is_kept(),
    };
    Ok(if is_better { (network, Method::Partition { why }) } else { laid.into() })
}

/// Which of two networks folds in fewer places. Numbers that differ by no more than the standard deviation of two such counts (their
/// sum is its square, where places are independent) are equal, and so are those that nobody counted.
fn by_folds(one: Option<usize>, other: Option<usize>) -> Ordering {
    let (Some(one), Some(other)) = (one, other) else { return Ordering::Equal };
    let by = one.abs_diff(other);
    if by.saturating_mul(by) > one.saturating_add(other) { one.cmp(&other) } else { Ordering::Equal }
}

/// What a trial says of a network, if there is one.
fn tried(
    trial: Option<&dyn Trial>,
    mesh: &TriMesh,
    network: &Network,
    observer: &dyn Observer,
) -> Result<Option<usize>, Cancelled> {
    trial.map(|trial| trial.folds(mesh, network, &Part::new(observer, 1.0, 0.0))).transpose()
}

impl From<aligned::Laid> for (Network, Method) {
    fn from(aligned::Laid { network, cones, deviation_deg, folds, .. }: aligned::Laid) -> (Network, Method) {
        (network, Method::Field { cones, deviation_deg, folds: folds.unwrap_or_default() })
    }
}

/// Patches that a mesh has room for: finer ones would have no two triangles each to follow.
pub fn most_patches(mesh: &TriMesh) -> usize {
    (mesh.triangles.len() / TRIANGLES_PER_PATCH).max(1)
}

/// The network of a partition, and the part of its patches that a grid covers well.
fn partitioned(
    &Piece { mesh, sharp, corners, .. }: &Piece,
    params: &LayoutParams,
    observer: &dyn Observer,
) -> Result<(Network, f64), LayoutError> {
    let adjacency = Adjacency::new(mesh);
    let area: f64 = (0..mesh.triangles.len()).map(|f| mesh.area(f)).sum();
    let side = (area / params.patches.max(1) as f64).sqrt();
    let mut edge = EDGE_TO_SIDE * side;
    let mut fixed = vec![false; mesh.points.len()];
    for h in 0..sharp.len() as u32 {
        if sharp[h as usize] || adjacency.opposite[h as usize] == NONE {
            fixed[mesh.origin(h) as usize] = true;
            fixed[mesh.origin(next(h)) as usize] = true;
        }
    }
    let most = WORK_PER_TRIANGLE * mesh.triangles.len() + WORK_PER_PATCH * params.patches;
    let mut before = 0;
    for _ in 0..MESH_ATTEMPTS {
        let work = refine::refine(mesh, edge, &fixed, most);
        // No room for shorter edges.
        if work.mesh.triangles.len() == before {
            break;
        }
        before = work.mesh.triangles.len();
        if let Some((work, complex)) = draft(work, (sharp, corners), side, params, observer)? {
            let work_adjacency = Adjacency::new(&work.mesh);
            if let Some(mut bench) = Bench::new(&work.mesh, &work_adjacency, complex)
                && improve::quads(&mut bench)
            {
                // Features may force more patches than asked for; shape is not given up for the number.
                let forced = bench.shapes().iter().flatten().filter(|s| s.area > CROWDED * side * side).count();
                let patches = params.patches.max((FORCED * forced as f64) as usize);
                let good = |bench: &mut Bench| make_good(bench, side, patches, params, observer);
                if coarsely(&mut bench, side, observer, good)? {
                    improve::straighten(&mut bench, observer)?;
                } else {
                    good(&mut bench)?;
                }
                finish(&mut bench, params, observer)?;
                observer.progress(1.0);
                return Ok((
                    network(&work, &work_adjacency, &bench.complex),
                    fitness::good_part(&fitness::covers(&bench)),
                ));
            }
        }
        edge /= 2.0;
    }
    Err(LayoutError::Stuck { faces: mesh.triangles.len() })
}

/// Does `work` on a coarser mesh, for patches with sides of about `side`, where a change costs less. False, and nothing
/// changes, if that mesh would not be much smaller or the way back fails.
fn coarsely(
    bench: &mut Bench,
    side: f64,
    observer: &dyn Observer,
    work: impl FnOnce(&mut Bench) -> Result<(), LayoutError>,
) -> Result<bool, LayoutError> {
    let Some(mut coarse) = coarse::coarsen(bench.mesh, bench.adjacency, &bench.complex, side, observer) else {
        return Ok(false);
    };
    let adjacency = Adjacency::new(&coarse.mesh);
    let complex = std::mem::take(&mut coarse.complex);
    let Some(mut on_coarse) = Bench::new(&coarse.mesh, &adjacency, complex) else { return Ok(false) };
    work(&mut on_coarse)?;
    let complex = coarse.refined(bench.mesh, bench.adjacency, &on_coarse.complex);
    let back = complex.and_then(|complex| Bench::new(bench.mesh, bench.adjacency, complex));
    Ok(back.map(|back| *bench = back).is_some())
}

/// The last steps on the mesh itself: patches that a grid would not cover well are drawn anew with their corners on flat ground,
/// and curves become fair.
fn finish(bench: &mut Bench, params: &LayoutParams, observer: &dyn Observer) -> Result<(), LayoutError> {
    let rounds = SETTLING_PER_SMOOTHING * params.smoothing;
    let area: f64 = (0..bench.mesh.triangles.len()).map(|f| bench.mesh.area(f)).sum();
    let side = (area / bench.complex.live_cells().count().max(1) as f64).sqrt();
    let settle = |bench: &mut Bench| improve::settle_uncovered(bench, rounds, observer);
    if !coarsely(bench, FINISH_TO_SIDE * side, observer, settle)? {
        settle(bench)?;
    }
    fair::fair(bench);
    Ok(())
}

/// Relaxes the cells and improves their connectivity, towards `patches` of them with sides of about `side`.
fn make_good(
    bench: &mut Bench,
    side: f64,
    patches: usize,
    params: &LayoutParams,
    observer: &dyn Observer,
) -> Result<(), LayoutError> {
    improve::relax(bench, observer)?;
    let lines = bench.lines();
    let tips = tips::tips(&partition::Ground::new(bench.mesh, bench.adjacency, &lines), side);
    tips::plant(bench, &tips, patches);
    improve::settle(bench, patches, SETTLING_PER_SMOOTHING, observer)?;
    improve::improve(bench, patches, observer)?;
    improve::relax(bench, observer)?;
    improve::settle(bench, patches, SETTLING_PER_SMOOTHING * params.smoothing, observer)
}

fn check(mesh: &TriMesh) -> Result<(), LayoutError> {
    if mesh.triangles.is_empty() {
        return Err(LayoutError::Empty);
    }
    let adjacency = Adjacency::new(mesh);
    let mut edges: std::collections::HashMap<[u32; 2], u32> = std::collections::HashMap::new();
    for (h, &o) in adjacency.opposite.iter().enumerate() {
        if o == NONE {
            let t = mesh.triangles[h / 3];
            let (a, b) = (t[h % 3], t[(h + 1) % 3]);
            *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    match edges.values().filter(|&&n| n > 1).count() {
        0 => Ok(()),
        edges => Err(LayoutError::NotManifold { edges }),
    }
}

/// The complex of even cells, with about as many quads to come as asked for, and the working mesh that it lies on.
/// `None` if the cells cannot be made even.
fn draft(
    work: Refined,
    (sharp, given): (&[bool], &[bool]),
    side: f64,
    params: &LayoutParams,
    observer: &dyn Observer,
) -> Result<Option<(Refined, Complex)>, LayoutError> {
    let adjacency = Adjacency::new(&work.mesh);
    let work_sharp = carry(&work, sharp);
    let ground = partition::Ground::new(&work.mesh, &adjacency, &work_sharp);
    let mut cells = (params.patches as f64 / 2.0).max(1.0);
    // A cell becomes two patches or so, and needles reach over any number of sides.
    let faces = work.parent.iter().map(|p| p.0 as usize + 1).max().unwrap_or(0);
    let most = (faces / TRIANGLES_PER_PATCH).max(PARTITION_PATCHES) / 2;
    let mut best: Option<(usize, Refined, Complex)> = None;
    for attempt in 0..COUNT_ATTEMPTS {
        observer.progress(0.1 * attempt as f64);
        let (label, count) = partition::partition(&ground, cells.round() as usize, (COVER * side, most), observer)?;
        let (finer, mut complex) = draw(&work, &ground, (sharp, given), &label, count, side / 4.0);
        if !polygon::make_even(&finer.mesh, &mut complex) {
            break;
        }
        let quads: usize = complex.live_cells().map(|c| complex.loop_of(c).len() / 2 - 1).sum();
        let miss = quads.abs_diff(params.patches);
        if best.as_ref().is_none_or(|b| miss < b.0) {
            best = Some((miss, finer, complex));
        }
        let ratio = params.patches as f64 / quads.max(1) as f64;
        let fewest = cells.round() < 2.0 || count as f64 > 1.5 * cells;
        if (0.9..1.1).contains(&ratio) || (ratio < 1.0 && fewest) {
            break;
        }
        cells = (cells * ratio).max(1.0);
    }
    Ok(best.map(|b| (b.1, b.2)))
}

/// The complex of labelled cells. Arcs of a single edge get an inner vertex: the working mesh is split there.
fn draw(
    work: &Refined,
    ground: &partition::Ground,
    (sharp, given): (&[bool], &[bool]),
    label: &[u32],
    count: usize,
    reach: f64,
) -> (Refined, Complex) {
    let complex = outline::outline(ground, label, count, &corners(ground, given, reach));
    let short: HashSet<[u32; 2]> = complex
        .live_arcs()
        .filter_map(|a| match complex.arc(2 * a).chain[..] {
            [imprint::Place::Vertex(a), imprint::Place::Vertex(b)] => Some([a.min(b), a.max(b)]),
            _ => None,
        })
        .collect();
    let (finer, from) = refine::split(work, &work.edges(|_, ends| short.contains(&ends)));
    let label: Vec<u32> = from.iter().map(|&f| label[f as usize]).collect();
    let adjacency = Adjacency::new(&finer.mesh);
    let finer_sharp = carry(&finer, sharp);
    let ground = partition::Ground::new(&finer.mesh, &adjacency, &finer_sharp);
    let complex = outline::outline(&ground, &label, count, &corners(&ground, given, reach));
    (finer, complex)
}

/// Corners of the fixed lines, those given among them (the working mesh keeps the numbers of the vertices).
fn corners(ground: &partition::Ground, given: &[bool], reach: f64) -> Vec<bool> {
    let mut corner = outline::corners(ground, reach);
    corner.iter_mut().zip(given).for_each(|(c, &g)| *c |= g);
    corner
}

/// The sharp half-edges of the working mesh: the pieces of those of the input.
fn carry(work: &Refined, sharp: &[bool]) -> Vec<bool> {
    work.edges(|h, _| work.edge_of(h).is_some_and(|of| sharp[of as usize]))
}

/// The complex as a network on the input mesh.
fn network(work: &Refined, adjacency: &Adjacency, complex: &Complex) -> Network {
    let triangles = &work.mesh.triangles;
    let mut corner_of = vec![NONE; complex.nodes.len()];
    let mut curve_of = vec![NONE; complex.arcs.len()];
    let mut out = Network::default();
    for a in complex.live_arcs() {
        let arc = complex.arc(2 * a);
        let corners = arc.nodes.map(|n| {
            if corner_of[n as usize] == NONE {
                corner_of[n as usize] = out.corners.len() as u32;
                let f = adjacency.outgoing[complex.nodes[n as usize].vertex as usize] / 3;
                let k = triangles[f as usize].iter().position(|&v| v == complex.nodes[n as usize].vertex);
                let at = FacePoint::corner(f, k.expect("a corner of its face"));
                out.corners.push(Corner { place: work.to_input(f, at.bary) });
            }
            corner_of[n as usize]
        });
        let mut points: Vec<FacePoint> = Vec::with_capacity(arc.chain.len());
        for pair in arc.chain.windows(2) {
            let face = match imprint::shared_face(adjacency, triangles, &pair[0], &pair[1]) {
                Some(Shared::Face(f)) => f,
                _ => common_face(adjacency, triangles, pair),
            };
            for (place, wanted) in [(pair[0], points.is_empty()), (pair[1], true)] {
                if wanted {
                    let at = place.on_face(adjacency, triangles, face).expect("both places lie on the shared face");
                    points.push(work.to_input(face, at.bary));
                }
            }
        }
        curve_of[a as usize] = out.curves.len() as u32;
        out.curves.push(Curve { corners, kind: arc.kind, points });
    }
    for c in complex.live_cells() {
        let sides = complex.loop_of(c);
        let sides =
            std::array::from_fn(|k| Side { curve: curve_of[sides[k] as usize / 2], reversed: sides[k] % 2 == 1 });
        out.patches.push(Patch { sides });
    }
    out
}

/// A face with both places, which lie on one edge.
fn common_face(adjacency: &Adjacency, triangles: &[[u32; 3]], pair: &[imprint::Place]) -> u32 {
    let around: Vec<u32> = match pair[0] {
        imprint::Place::Vertex(v) => adjacency.fan(v).map(|h| h / 3).collect(),
        place => vec![place.some_face(adjacency)],
    };
    around
        .into_iter()
        .find(|&f| pair.iter().all(|p| p.on_face(adjacency, triangles, f).is_some()))
        .expect("neighbouring places share a face")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Silent;
    use crate::network::imprint::imprint;
    use crate::synthetic::shapes;
    use glam::DVec3;

    #[test]
    fn a_ball_has_6_patches_along_its_form_and_60_to_240_even_ones_where_these_are_asked_for() {
        let mesh = shapes::sphere(1.0, 4);
        let laid = |even| {
            let params = LayoutParams { even, ..LayoutParams::default() };
            layout(&mesh, Known::default(), &params, None, &Silent).unwrap()
        };
        let [form, even] = [false, true].map(laid);
        assert!(matches!(form.pieces[..], [(_, Method::Field { .. })]), "{:?}", form.pieces);
        assert_eq!((form.network.patches.len(), even.pieces), (6, vec![(1.0, Method::Partition { why: None })]));
        assert!((PARTITION_PATCHES / 2..2 * PARTITION_PATCHES).contains(&even.network.patches.len()));
    }

    #[test]
    fn a_square_sheet_with_a_round_hole_has_a_patch_between_the_hole_and_each_side() {
        let side = |u: f64| {
            let (k, t) = ((4.0 * u) as usize % 4, (4.0 * u).fract());
            let corner = |k: usize| [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]][k % 4].into();
            glam::DVec2::lerp(corner(k), corner(k + 1), t)
        };
        let hole = |u: f64| 0.4 * glam::DVec2::from_angle(std::f64::consts::TAU * (u - 0.375));
        let mesh = shapes::sheet(80, 20, true, false, |u, v| side(u).lerp(hole(u), v).extend(0.0));
        let laid = layout(&mesh, Known::default(), &LayoutParams::default(), None, &Silent).unwrap();
        assert!(matches!(laid.pieces[..], [(_, Method::Field { .. })]), "{:?}", laid.pieces);
        assert_eq!(laid.network.patches.len(), 4);
    }

    /// Finds `self.1` folds in networks of fewer than `self.0` patches, and `self.2` in others.
    struct Verdict(usize, usize, usize);

    impl Trial for Verdict {
        fn folds(&self, _: &TriMesh, network: &Network, _: &dyn Observer) -> Result<usize, Cancelled> {
            Ok(if network.patches.len() < self.0 { self.1 } else { self.2 })
        }
    }

    #[test]
    fn even_patches_take_the_place_of_those_along_the_form_where_these_fold_more_often_than_by_chance() {
        let mesh = shapes::sphere(1.0, 4);
        let count = |few: usize, many: usize| {
            let trial = Verdict(PARTITION_PATCHES / 2, few, many);
            let laid = layout(&mesh, Known::default(), &LayoutParams::default(), Some(&trial), &Silent).unwrap();
            (laid.network.patches.len() == 6, laid.pieces.into_iter().next().unwrap().1)
        };
        assert!(matches!(count(0, 9), (true, Method::Field { folds: 0, .. })));
        // By chance.
        assert!(matches!(count(3, 1), (true, Method::Field { folds: 3, .. })));
        let (is_form, method) = count(3, 0);
        let why = "surfaces along its form would fold in 3 places".to_owned();
        assert!(!is_form && method == Method::Partition { why: Some(why) });
    }

    #[test]
    fn each_piece_of_a_mesh_gets_a_network_of_its_own_and_small_ones_get_one_together() {
        let mut mesh = TriMesh::default();
        for (size, at) in [(2.0, 0.0), (1.0, 3.0), (0.1, 5.0), (0.05, 6.0)] {
            let cube = shapes::cuboid(DVec3::splat(size), 5);
            let base = mesh.points.len() as u32;
            mesh.points.extend(cube.points.iter().map(|&p| p + at * DVec3::X));
            // Not piece by piece.
            let triangles = cube.triangles.iter().map(|t| t.map(|v| v + base));
            mesh.triangles = triangles.chain(mesh.triangles.iter().copied()).collect();
        }
        let laid = layout(&mesh, Known::default(), &LayoutParams::default(), None, &Silent).unwrap();
        let area = 4.0 + 1.0 + 0.01 + 0.0025;
        for (&(share, ref method), wanted) in laid.pieces.iter().zip([4.0, 1.0, 0.0125]) {
            assert!((share - wanted / area).abs() < 1e-9);
            assert!(matches!(method, Method::Field { .. }), "{method:?}");
        }
        assert_eq!((laid.pieces.len(), laid.network.patches.len()), (3, 24));
        let patches = imprint(&mesh, &laid.network, &Silent).expect("disks");
        let covered: f64 =
            patches.iter().map(|p| (0..p.mesh.triangles.len()).map(|f| p.mesh.area(f)).sum::<f64>()).sum();
        assert!((covered - 6.0 * area).abs() < 1e-9, "{covered}");
    }

    #[test]
    fn a_piece_that_no_map_follows_leaves_the_others_to_their_form() {
        // Corners that are given need not be corners of the field.
        let mesh = shapes::two_spheres(3);
        let mut corners = vec![false; mesh.points.len()];
        corners[0] = true;
        let mut lines = vec![false; 3 * mesh.triangles.len()];
        let adjacency = Adjacency::new(&mesh);
        let h = adjacency.outgoing[0];
        lines[h as usize] = true;
        lines[adjacency.opposite[h as usize] as usize] = true;
        let known = Known { sharp: &[], lines: &lines, corners: &corners };
        let laid = layout(&mesh, known, &LayoutParams::default(), None, &Silent).unwrap();
        assert!(
            matches!(laid.pieces[..], [(_, Method::Partition { .. }), (_, Method::Field { .. })]),
            "{:?}",
            laid.pieces
        );
    }
}
