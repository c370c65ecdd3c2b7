//! Layouts that follow the form: cross field, injective seamless map, whole numbers.
//!
//! 1. an even proxy mesh of the input ([`super::proxy`]);
//! 2. the smoothest cross field along its lines and principal directions ([`crate::network::field`]);
//! 3. the seamless map of that field, without flipped triangles ([`map`]);
//! 4. whole numbers for its cones and lines, for any number of patches ([`integers`]), and the smoothest map with them;
//! 5. the grid of whole numbers is the network.
//!
//! Where a step cannot do its work the next gentler one is tried ([`Attempt`]); what was left out is told.

use super::complex::Complex;
use super::embed::{self, EmbedError};
use super::fitness::{self, Price};
use super::integers::{self, IntegerMap, QuantizeError, Scale};
use super::map::{self, Charts, ConeCare, Effort};
use super::proxy::{Proxy, Sizing, Source};
use super::recut::Bench;
use super::strips::chords::{self, Order};
use super::{LayoutParams, Piece, SETTLING_PER_SMOOTHING, TYPICAL_PATCHES, Trial, by_folds, finish, improve, tried};
use crate::mesh::TriMesh;
use crate::network::Network;
use crate::network::field::{self, FieldParams};
use crate::observe::{Cancelled, Observer, counted};
use glam::DVec3;
use std::cmp::Ordering;
use std::collections::VecDeque;
use std::rc::Rc;

/// Triangles of the proxy: the seamless maps of the measured meshes were made on 5 000 to 6 000 (two fifths of a second). A
/// piece of a mesh has as many times the square root of its share of the area, half-way between edges of one length on all
/// pieces and as many triangles on each; chosen.
const PROXY_TRIANGLES: f64 = 6_000.0;

/// A proxy that has more times the triangles wanted, for its lines are dense, is not mapped: time and memory of a map grow
/// faster than its triangles. Chosen; the measured meshes that were tried do not meet it.
const MOST_TO_WANTED: usize = 4;

/// Radius of the mean of principal directions, in sides of a patch of [`TYPICAL_PATCHES`].
const RADIUS_TO_SIDE: f64 = 0.4;

/// Opposite cones nearer than this, in the same sides, are taken for noise.
const PAIR_TO_SIDE: f64 = 0.5;

/// Rounds of making the proxy finer where cones are tight; each halves its edges there.
const REFINEMENTS: usize = 2;

/// Rounds of making it finer where there was no room for whole numbers.
const FINER_ROUNDS: usize = 1;

/// One way to a map.
struct Attempt {
    /// Weight of principal directions.
    curvature: f64,
    /// Whether cones beside lines are moved off.
    roomy: bool,
}

/// The attempts in their order.
const ATTEMPTS: [Attempt; 3] = [
    Attempt { curvature: 1.0, roomy: false },
    Attempt { curvature: 1.0, roomy: true },
    Attempt { curvature: 0.0, roomy: true },
];

/// A mesh with its seamless map.
struct Aligned {
    proxy: Rc<Proxy>,
    charts: Charts,
    mapped: map::Mapped,
}

impl Aligned {
    /// The map of a mesh on a proxy with edges as `sizing` asks for.
    ///
    /// A triangle whose corners are all bound, by lines or as cones, may get no area on whole numbers. Where cones are that
    /// near to lines and to each other the proxy is made finer, until none is.
    fn on(
        source: &mut Source,
        attempt: &Attempt,
        sizing: &mut Sizing,
        effort: &Effort,
        observer: &dyn Observer,
    ) -> Result<Option<Aligned>, AlignError> {
        let mut rounds = REFINEMENTS;
        let (proxy, mut charts) = loop {
            let Some(proxy) = source.proxy(sizing, observer) else { return Ok(None) };
            let most = MOST_TO_WANTED * sizing.triangles(source.mesh);
            if proxy.mesh.triangles.len() > most {
                return Err(AlignError::Dense { found: proxy.mesh.triangles.len(), most });
            }
            let charts = charts(&proxy, attempt, false, observer)?.with_effort(effort);
            let tight = charts.tight.iter().map(|&v| proxy.mesh.points[v as usize]);
            let halved = tight.map(|p| (p, sizing.at(p) / 2.0)).collect();
            if rounds == 0 || !sizing.shorten(halved) {
                break (proxy, charts);
            }
            rounds -= 1;
        };
        let map = |charts: &Charts| map::seamless(&proxy.mesh, &proxy.adjacency, &proxy.lines, charts, observer);
        let mut mapped = map(&charts)?;
        if mapped.as_ref().is_some_and(|mapped| !mapped.is_injective()) && !effort.is_spent() {
            let settled = self::charts(&proxy, attempt, true, observer)?.with_effort(effort);
            if let Some(other) =
                map(&settled)?.filter(|other| mapped.as_ref().is_none_or(|m| other.faults() < m.faults()))
            {
                (charts, mapped) = (settled, Some(other));
            }
        }
        Ok(mapped.map(|mapped| Aligned { proxy, charts, mapped }))
    }
}

/// The charts of the field on a proxy.
/// * `settled` - as [`ConeCare`] has it
fn charts(proxy: &Proxy, attempt: &Attempt, settled: bool, observer: &dyn Observer) -> Result<Charts, Cancelled> {
    let Proxy { mesh, adjacency, lines, .. } = proxy;
    let area: f64 = (0..mesh.triangles.len()).map(|f| mesh.area(f)).sum();
    let side = (area / TYPICAL_PATCHES).sqrt();
    let params = FieldParams {
        curvature: attempt.curvature,
        smoothing: 1.0,
        radius: RADIUS_TO_SIDE * side,
        pair_distance: PAIR_TO_SIDE * side,
    };
    let field = field::field(mesh, adjacency, lines, &params, observer)?;
    Ok(Charts::new(mesh, adjacency, lines, &field, ConeCare { roomy: attempt.roomy, settled }))
}

/// A place with the length of edges that is wanted there.
type Wanted = (DVec3, f64);

/// Why no network follows the form.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum AlignError {
    /// Corners that are given need not be corners of the field.
    #[error("its corners are given")]
    Corners,
    /// There is no even mesh or no map.
    #[error("the mesh cannot be mapped")]
    Unmapped,
    /// Lines and boundaries leave no room for an even mesh of some thousand triangles.
    #[error("its lines are so dense that an even mesh has {found} triangles, and maps are for {most} at most")]
    Dense {
        /// Triangles of the proxy.
        found: usize,
        /// The most that are mapped.
        most: usize,
    },
    /// The map is not one-to-one.
    #[error("its map stays folded in {}", counted(*faults, "place", "places"))]
    Folded {
        /// Faces and vertices.
        faults: usize,
    },
    /// Triangles of the proxy leave no way to whole numbers.
    #[error("its patches have no room in {}", counted(.places.len(), "place", "places"))]
    Cramped {
        /// Where, and how long edges may be there.
        places: Vec<Wanted>,
    },
    /// Far more patches than a partition needs.
    #[error("patches along its form would be {found}")]
    Count {
        /// How many they would be.
        found: usize,
    },
    /// The same, by its corners alone: another map would have no fewer.
    #[error("the corners of its sharp edges and boundaries ask for {least} patches along its form at least")]
    LeastCount {
        /// How many they ask for.
        least: usize,
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

impl AlignError {
    /// Which of two is told: what stands in the way of an attempt that has a one-to-one map, else that of the later one.
    fn or(self, later: AlignError) -> AlignError {
        let is_of_map = |e: &AlignError| matches!(e, AlignError::Unmapped | AlignError::Folded { .. });
        if is_of_map(&later) && !is_of_map(&self) { self } else { later }
    }

    /// Where a finer proxy may help.
    fn places(&self) -> &[Wanted] {
        match self {
            AlignError::Cramped { places } => places,
            _ => &[],
        }
    }
}

/// Numbers of squares that are tried, in those of the coarsest network: as few as the form needs.
const GROWTH: [f64; 8] = [1.0, 1.4, 2.0, 2.8, 4.0, 5.7, 8.0, 11.3];

/// How a network along the form is sought.
#[derive(Clone, Copy)]
pub(super) struct Search<'a> {
    /// What tells whether a network will do; without it the shapes of its cells do.
    pub trial: Option<&'a dyn Trial>,
    /// Squares at most that are tried where nobody asked for a number.
    pub most: usize,
    /// True to take the first network over which surfaces do not fold, for all else does.
    pub is_last: bool,
}

impl Search<'_> {
    /// True if there is no need for another map.
    fn ends_with(&self, laid: &Laid) -> bool {
        laid.is_final() || (self.is_last && laid.folds == Some(0))
    }
}

/// Networks of one map over which surfaces are tried at most. Chosen.
const MOST_TRIED: usize = 2;

/// Numbers that are tried in place of one that was asked for and that the form does not allow.
const NEAR_ASKED: [f64; 4] = [1.0, 1.1, 0.9, 1.2];

/// A network has the number of patches that was asked for if it misses it by at most this part of it.
const MOST_MISSED: f64 = 0.2;

/// A network that follows the form.
pub(super) struct Laid {
    pub network: Network,
    pub cones: usize,
    /// Mean angle between the patches' isolines and the field, degrees.
    pub deviation_deg: f64,
    /// What it is worth, on the proxy.
    pub worth: Worth,
    /// The same on the mesh.
    on_mesh: Worth,
    /// Places where a trial finds surfaces folded; `None` without one.
    pub folds: Option<usize>,
    /// True if no number in question is good and this is none of the lines' doing: another map would hardly be better.
    is_far: bool,
}

impl Laid {
    /// True if there is no need for another map: this is good, or the form leaves no hope of a good one.
    fn is_final(&self) -> bool {
        self.worth.is_kept() && (self.worth.is_enough() || self.is_far)
    }

    /// True if this is taken rather than the other.
    fn is_better(&self, other: &Laid) -> bool {
        match self.worth.missed.total_cmp(&other.worth.missed).then(by_folds(self.folds, other.folds)) {
            Ordering::Less => true,
            Ordering::Greater => false,
            Ordering::Equal => self.on_mesh.is_better(other.on_mesh),
        }
    }

    /// True if a partition need not be looked at either.
    pub fn is_sound(&self) -> bool {
        self.is_final() && self.folds.is_none_or(|folds| folds == 0)
    }
}

/// What a network is worth: the number that was asked for first, then how well grids cover it, then how coarse it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Worth {
    patches: usize,
    /// Logarithm of the ratio of its patches to the number asked for, 0 if near enough or if none was.
    missed: f64,
    /// Part of the patches that a grid covers well.
    good_part: f64,
    /// True if that is large enough on the proxy.
    is_good: bool,
}

impl Worth {
    pub fn new(patches: usize, asked: Option<usize>, good_part: f64) -> Worth {
        let missed = match asked {
            Some(asked) if !count_is_near(patches, asked) => (patches as f64 / asked as f64).ln().abs(),
            _ => 0.0,
        };
        Worth { patches, missed, good_part, is_good: fitness::is_good(good_part) }
    }

    /// True if there is no need to look for another.
    pub fn is_enough(self) -> bool {
        self.missed == 0.0 && self.is_good
    }

    /// True for the number that was asked for.
    pub fn is_kept(self) -> bool {
        self.missed == 0.0
    }

    /// True if this is worth more.
    pub fn exceeds(self, other: Worth) -> bool {
        self.missed < other.missed || (self.missed == other.missed && self.good_part > other.good_part)
    }

    /// True if this, along the form as the other is, is taken rather than that: for it is good, or of two good ones the coarser.
    /// Of two others it is the one worth more, or the coarser where no more parts them than chance: good parts of so many
    /// patches have a standard deviation.
    fn is_better(self, other: Worth) -> bool {
        let variance = |worth: Worth| worth.good_part * (1.0 - worth.good_part) / worth.patches.max(1) as f64;
        let by = (self.good_part - other.good_part).abs();
        let is_chance = self.missed == other.missed && by < (variance(self) + variance(other)).sqrt();
        match (self.is_enough(), other.is_enough()) {
            (false, false) if !is_chance => self.exceeds(other),
            (one, two) if one == two => self.patches < other.patches,
            (is_enough, _) => is_enough,
        }
    }
}

/// The number of patches that is asked for, if there is one.
pub(super) fn asked(params: &LayoutParams) -> Option<usize> {
    (params.patches > 0 && !params.coarsest).then_some(params.patches)
}

/// The network of `mesh` that follows its form, with the number of patches that `params` ask for or as few as the form
/// needs; the best there is, where none is good.
/// # Errors
/// [`AlignError`] says why there is none.
pub(super) fn lay(
    &Piece { mesh, sharp, corners, share }: &Piece,
    params: &LayoutParams,
    search: Search,
    observer: &dyn Observer,
) -> Result<Laid, AlignError> {
    if corners.iter().any(|c| *c) {
        return Err(AlignError::Corners);
    }
    let mut why = AlignError::Unmapped;
    let mut best: Option<Laid> = None;
    let mut has_tight = false;
    let effort = Effort::new(share);
    let mut source = Source::new(mesh, sharp, (PROXY_TRIANGLES * share.sqrt()) as usize);
    for attempt in &ATTEMPTS {
        // Where no cone is to be moved it would be the same again.
        if attempt.roomy && attempt.curvature > 0.0 && !has_tight {
            continue;
        }
        let mut sizing = source.even().clone();
        for _ in 0..=FINER_ROUNDS {
            let aligned = match Aligned::on(&mut source, attempt, &mut sizing, &effort, observer) {
                Ok(Some(aligned)) => aligned,
                Ok(None) => {
                    observer.check()?;
                    break;
                }
                Err(dense @ AlignError::Dense { .. }) => return best.ok_or(dense),
                Err(cancelled) => return Err(cancelled),
            };
            has_tight |= !aligned.charts.tight.is_empty();
            observer.progress(0.3);
            let (laid, trouble) = aligned.choose(params, (mesh, search), observer)?;
            if let Some(laid) = laid
                && best.as_ref().is_none_or(|best| laid.is_better(best))
            {
                best = Some(laid);
            }
            // A coarser one may be good as well.
            let is_open = trouble.is_some() && asked(params).is_none();
            if best.as_ref().is_some_and(|best| params.coarsest || search.ends_with(best) && !is_open) {
                break;
            }
            let Some(trouble) = trouble else { break };
            let places = trouble.places().to_vec();
            why = why.or(trouble);
            if effort.is_spent() || matches!(why, AlignError::LeastCount { .. }) {
                return best.ok_or(why);
            }
            // Where no number had room, or none that had is the one asked for, finer edges hardly ever help.
            if best.as_ref().is_none_or(|best| !best.worth.is_kept()) || !sizing.shorten(places) {
                break;
            }
        }
        if best.as_ref().is_some_and(|best| params.coarsest || search.ends_with(best)) {
            break;
        }
    }
    best.ok_or(why)
}

/// A layout on the proxy.
struct Draft {
    proxy: Rc<Proxy>,
    complex: Complex,
    worth: Worth,
    /// True if most of its cells lay on open surface before rows that no grid needs went.
    is_open: bool,
    deviation_deg: f64,
}

impl Aligned {
    /// The network of fewest squares that is good, of the numbers in question, else the best; and what was in the way of
    /// others that would be preferred. Where surfaces over it fold, the next best may take its place.
    ///
    /// Where the first is not good the largest number comes next: if that is not good either those between hardly ever are.
    fn choose(
        &self,
        params: &LayoutParams,
        (mesh, search): (&TriMesh, Search),
        observer: &dyn Observer,
    ) -> Result<(Option<Laid>, Option<AlignError>), Cancelled> {
        if let Err(folded) = self.unfolded(&self.mapped) {
            return Ok((None, Some(folded)));
        }
        let mut scales = match self.scales(params, search.most, observer) {
            Ok(scales) => VecDeque::from(scales),
            Err(AlignError::Cancelled(cancelled)) => return Err(cancelled),
            Err(e) => return Ok((None, Some(e))),
        };
        let (first, largest) = (scales.front().copied(), scales.iter().copied().max());
        let count = scales.len();
        // The best comes first.
        let (mut drafts, mut trouble, mut is_far): (Vec<Draft>, Option<(Scale, AlignError)>, bool) =
            (Vec::new(), None, false);
        while let Some(scale) = scales.pop_front() {
            observer.progress(0.9 - 0.6 * (scales.len() + 1) as f64 / count as f64);
            match self.quantized(scale, observer).and_then(|whole| self.draft(&whole, params, observer)) {
                Ok(draft) => {
                    let is_enough = draft.worth.is_enough();
                    let is_largest = Some(scale) == largest;
                    if is_largest && !is_enough {
                        is_far = draft.is_open;
                    } else if drafts.is_empty() && draft.worth.is_kept() && !is_enough {
                        scales.make_contiguous().sort_by_key(|&scale| (Some(scale) != largest, scale));
                    }
                    if drafts.first().is_none_or(|best| draft.worth.is_better(best.worth)) {
                        drafts.insert(0, draft);
                        trouble = trouble.filter(|(other, _)| !is_enough || *other < scale);
                    } else {
                        drafts.push(draft);
                    }
                    // Below a good largest number there may be others.
                    if is_enough != is_largest {
                        break;
                    }
                }
                Err(AlignError::Cancelled(cancelled)) => return Err(cancelled),
                Err(e) => trouble = Some((scale, e)),
            }
            if self.charts.effort.is_spent() {
                break;
            }
            // What has no room for two numbers of squares has none for more.
            if Some(scale) != first
                && drafts.is_empty()
                && trouble.as_ref().is_some_and(|(_, e)| !e.places().is_empty())
            {
                break;
            }
        }
        let (best, misplaced) = self.best_of(drafts, is_far, params, (mesh, search), observer)?;
        Ok((best, misplaced.or(trouble.map(|(_, e)| e))))
    }

    /// The first of some drafts over which surfaces do not fold, else the best; and what was in the way of others.
    fn best_of(
        &self,
        drafts: Vec<Draft>,
        is_far: bool,
        params: &LayoutParams,
        (mesh, search): (&TriMesh, Search),
        observer: &dyn Observer,
    ) -> Result<(Option<Laid>, Option<AlignError>), Cancelled> {
        let (mut best, mut trouble): (Option<Laid>, Option<AlignError>) = (None, None);
        // Each comes without the strips that it is better without, and with them where surfaces fold that way.
        let mut waiting: VecDeque<(Draft, bool)> = drafts.into_iter().map(|draft| (draft, true)).collect();
        let mut left = if search.trial.is_some() { MOST_TRIED } else { 1 };
        while let Some((mut draft, is_whole)) = waiting.pop_front().filter(|_| left > 0) {
            let closed = if is_whole { self.closed(&draft, params, observer) } else { Ok(None) };
            match closed {
                Ok(Some(closed)) => waiting.push_front((std::mem::replace(&mut draft, closed), false)),
                Err(AlignError::Cancelled(cancelled)) => return Err(cancelled),
                _ => {}
            }
            match self.laid(draft, is_far, params, observer) {
                Ok(mut laid) => {
                    left -= 1;
                    laid.folds = tried(search.trial, mesh, &laid.network, observer)?;
                    if best.as_ref().is_none_or(|best| laid.is_better(best)) {
                        best = Some(laid);
                    }
                }
                Err(AlignError::Cancelled(cancelled)) => return Err(cancelled),
                Err(e) => trouble = Some(e),
            }
            if best.as_ref().is_some_and(|best| best.folds.is_none_or(|folds| folds == 0)) {
                break;
            }
        }
        Ok((best, trouble))
    }

    /// The scales in question, in the order in which they are tried.
    /// # Errors
    /// [`AlignError`], among others `Count` and `LeastCount`.
    fn scales(&self, params: &LayoutParams, most: usize, observer: &dyn Observer) -> Result<Vec<Scale>, AlignError> {
        if let Some(asked) = asked(params) {
            return Ok(NEAR_ASKED.map(|near| Scale::Squares(((near * asked as f64).round() as usize).max(1))).to_vec());
        }
        if params.coarsest {
            return Ok(vec![Scale::Coarsest]);
        }
        let Proxy { mesh, adjacency, lines, .. } = &*self.proxy;
        let least = integers::least_squares(mesh, adjacency, &self.mapped.map, lines);
        if least > most {
            return Err(AlignError::LeastCount { least });
        }
        let least = self.quantized(Scale::Coarsest, observer)?.squares;
        if least > most {
            return Err(AlignError::Count { found: least });
        }
        let numbers = GROWTH.map(|n| n * least as f64).into_iter().filter(|n| *n <= most as f64);
        Ok(numbers.map(|n| Scale::Squares(n as usize)).collect())
    }

    /// Whole numbers for the cones and lines.
    fn quantized(&self, scale: Scale, observer: &dyn Observer) -> Result<IntegerMap, AlignError> {
        let Proxy { mesh, adjacency, lines, .. } = &*self.proxy;
        match integers::quantize(mesh, adjacency, &self.mapped.map, lines, scale, observer) {
            Err(QuantizeError::Cancelled(cancelled)) => Err(cancelled.into()),
            whole => Ok(whole?),
        }
    }

    /// The layout on the proxy whose cells are the unit squares, settled as `params` say: what the map squeezes is spread.
    fn draft(&self, whole: &IntegerMap, params: &LayoutParams, observer: &dyn Observer) -> Result<Draft, AlignError> {
        let Proxy { mesh, adjacency, lines, .. } = &*self.proxy;
        let from = &self.mapped.map.uv;
        let mapped = map::smooth_integers(mesh, adjacency, lines, &self.charts, (from, &whole.uv), observer)?;
        let mapped = mapped.map_err(|faces| AlignError::Cramped { places: self.halved(&faces) })?;
        self.unfolded(&mapped)?;
        let (proxy, complex) = embed::embed_on(&self.proxy, &mapped.map)?;
        let Proxy { mesh, adjacency, .. } = &*proxy;
        let mut bench = Bench::new(mesh, adjacency, complex).ok_or(AlignError::Misplaced)?;
        let rounds = SETTLING_PER_SMOOTHING * params.smoothing;
        let squares = bench.complex.live_cells().count();
        improve::settle_along_lines(&mut bench, squares, rounds, observer).map_err(|_| Cancelled)?;
        let mut covers = fitness::covers(&bench);
        if !params.coarsest && !fitness::is_good(fitness::good_part(&covers)) {
            // Whole numbers have cones in the way of each other.
            improve::improve(&mut bench, squares, observer).map_err(|_| Cancelled)?;
            improve::settle_along_lines(&mut bench, squares, rounds, observer).map_err(|_| Cancelled)?;
            covers = fitness::covers(&bench);
        }
        let good_part = fitness::good_part(&covers);
        let joined = fitness::joined(&bench, params.patches);
        let patches = joined.live_cells().count();
        if patches < covers.len() && !params.coarsest {
            bench = Bench::new(mesh, adjacency, joined).ok_or(AlignError::Misplaced)?;
            improve::settle_along_lines(&mut bench, patches, rounds, observer).map_err(|_| Cancelled)?;
        }
        let complex = bench.complex;
        let worth = Worth::new(complex.live_cells().count(), asked(params), good_part);
        Ok(Draft { proxy, complex, worth, is_open: fitness::is_open(&covers), deviation_deg: mapped.deviation_deg })
    }

    /// A good draft without the strips of cells that it is better without; `None` if there are none.
    fn closed(
        &self,
        draft: &Draft,
        params: &LayoutParams,
        observer: &dyn Observer,
    ) -> Result<Option<Draft>, AlignError> {
        if !draft.worth.is_good {
            return Ok(None);
        }
        let Proxy { mesh, adjacency, .. } = &*draft.proxy;
        let rounds = SETTLING_PER_SMOOTHING * params.smoothing;
        let settle = |bench: &mut Bench, fresh: Vec<bool>| {
            let patches = bench.complex.live_cells().count();
            improve::settle_along_lines_around(bench, (patches, rounds), fresh, observer).map_err(|_| Cancelled)
        };
        let close = |order: Order| {
            let mut bench = Bench::new(mesh, adjacency, draft.complex.clone()).ok_or(AlignError::Misplaced)?;
            let has_overtaken = chords::close(&mut bench, (order, params.patches), settle, Price::of)?;
            Ok::<_, AlignError>((bench, has_overtaken))
        };
        let (mut bench, has_overtaken) = close(Order::ByGain)?;
        if has_overtaken {
            let (other, _) = close(Order::RingsLast)?;
            bench = if Price::of(&other) < Price::of(&bench) { other } else { bench };
        }
        let patches = bench.complex.live_cells().count();
        Ok((patches < draft.worth.patches).then(|| Draft {
            proxy: draft.proxy.clone(),
            complex: bench.complex,
            worth: Worth { patches, ..draft.worth },
            is_open: draft.is_open,
            deviation_deg: draft.deviation_deg,
        }))
    }

    /// # Errors
    /// `Folded` if a map is not one-to-one.
    fn unfolded(&self, mapped: &map::Mapped) -> Result<(), AlignError> {
        match mapped.faults() {
            0 => Ok(()),
            faults => Err(AlignError::Folded { faults }),
        }
    }

    /// Where these faces of the proxy are, with half of their edges.
    fn halved(&self, faces: &[u32]) -> Vec<Wanted> {
        let mesh = &self.proxy.mesh;
        let middle = |f: u32| mesh.corners(f as usize).into_iter().sum::<DVec3>() / 3.0;
        let edges = |f: u32| (3 * f..3 * f + 3).map(|h| mesh.edge_length(h)).sum::<f64>();
        faces.iter().map(|&f| (middle(f), edges(f) / 6.0)).collect()
    }

    /// A layout brought to the mesh.
    fn laid(
        &self,
        draft: Draft,
        is_far: bool,
        params: &LayoutParams,
        observer: &dyn Observer,
    ) -> Result<Laid, AlignError> {
        let Draft { proxy, complex, worth, deviation_deg, .. } = draft;
        let complex = proxy.back(&complex).ok_or(AlignError::Misplaced)?;
        let (fine, fine_adjacency) = proxy.fine();
        let mut bench = Bench::new(fine, fine_adjacency, complex).ok_or(AlignError::Misplaced)?;
        improve::straighten(&mut bench, observer).map_err(|_| Cancelled)?;
        finish(&mut bench, params, observer).map_err(|_| Cancelled)?;
        let cones = self.charts.index.iter().filter(|i| **i != 0).count();
        let on_mesh = Worth { good_part: fitness::good_part(&fitness::covers(&bench)), ..worth };
        Ok(Laid { network: proxy.network(&bench.complex), cones, deviation_deg, worth, on_mesh, folds: None, is_far })
    }
}

/// True if a network of so many patches has the number that was asked for: within a fifth.
pub fn count_is_near(found: usize, asked: usize) -> bool {
    found.abs_diff(asked) as f64 <= MOST_MISSED * asked as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_network_of_the_number_asked_for_is_final_if_it_is_good_or_if_no_number_outweighs_its_bad_cells() {
        let is_final = |patches, good_part, is_far| {
            let worth = Worth::new(patches, Some(60), good_part);
            Laid {
                network: Network::default(),
                cones: 0,
                deviation_deg: 0.0,
                worth,
                on_mesh: worth,
                folds: None,
                is_far,
            }
            .is_final()
        };
        assert!(is_final(60, 0.95, false) && is_final(60, 0.4, true));
        assert!(!is_final(60, 0.85, false) && !is_final(110, 0.4, true));
    }

    #[test]
    fn of_two_attempts_what_stands_in_the_way_of_the_one_with_a_map_is_told() {
        let cramped = || AlignError::Cramped { places: Vec::new() };
        let folded = || AlignError::Folded { faults: 20 };
        assert_eq!(cramped().or(folded()), cramped());
        assert_eq!(folded().or(cramped()), cramped());
        assert_eq!(AlignError::Unmapped.or(folded()), folded());
        assert_eq!(cramped().or(AlignError::LeastCount { least: 400 }), AlignError::LeastCount { least: 400 });
    }

    #[test]
    fn a_network_nearer_to_the_number_asked_for_is_worth_more_and_among_those_that_have_it_the_better_one() {
        let worth = |patches, good_part| Worth::new(patches, Some(60), good_part);
        assert!(worth(110, 0.5).exceeds(worth(317, 1.0)) && worth(40, 0.5).exceeds(worth(110, 1.0)));
        assert!(!worth(110, 0.5).is_enough() && !worth(110, 1.0).is_kept());
        assert!(
            worth(50, 0.9).exceeds(worth(60, 0.8))
                && worth(72, 1.0).is_enough()
                && worth(48, 1.0).is_kept()
                && !worth(73, 1.0).is_kept()
        );
        // What differs by less than a standard deviation is the same, and the coarser one is taken; of two good ones, too.
        let any = |patches, good_part| Worth::new(patches, None, good_part);
        assert!(any(171, 0.851).is_better(any(219, 0.857)) && !any(219, 0.857).is_better(any(171, 0.851)));
        assert!(any(219, 0.857).is_better(any(124, 0.758)) && any(60, 0.91).is_better(any(90, 1.0)));
        // Where no number is asked for, any has it.
        assert!(Worth::new(317, None, 0.9).exceeds(Worth::new(60, None, 0.8)));
    }
}
