//! Grids of a whole network with feature curves in some of its patches.
//!
//! A feature curve ends on curves of the network; the grids on both sides of such a curve share their nodes, so the
//! curve gets a stop there and the grid beyond it follows ([`crate::grid::side`]). Numbers of cells go along chords.
//!
//! See `docs/methods/curves.md`, "Feature curves".

use super::curve::{FEWEST_CELLS, Sections, cells_between, check_count, relax_along, weave};
use super::strand::Strands;
use super::{Family, FeatureCurve, FeatureError};
use crate::grid::{Grid, GridError, GridParams, SideStops, relax_at, side};
use crate::mesh::{FacePoint, TriMesh};
use crate::network::{Network, PatchMesh};
use crate::observe::{Observer, Part};
use std::collections::BTreeMap;

/// Ends of two feature curves on one curve of the network nearer than this share of its length are the same place:
/// one curve drawn on over several patches.
const SAME_END: f64 = 1e-6;

/// What is drawn in the patches of a network: feature curves with the patch that each is in, and for some patches the
/// cells between theirs.
pub type Drawn<'a> = (&'a [FeatureCurve], &'a [(u32, Sections)]);

/// Relaxes patches in this process.
pub struct Here<'a> {
    /// The mesh that places refer to.
    pub input: &'a TriMesh,
    /// Its network.
    pub network: &'a Network,
    /// The patches of the network.
    pub patches: &'a [PatchMesh],
    /// Feature curves and sections; mostly empty.
    pub drawn: Drawn<'a>,
    /// How grids are made.
    pub params: &'a GridParams,
}

/// The family that a curve from side to side of a patch is of, by the sides that its ends lie nearest to.
/// * `patch` - exact sub-mesh of `input`
pub fn family_of(input: &TriMesh, patch: &PatchMesh, points: &[FacePoint]) -> Family {
    let [Some(first), Some(last)] = [points.first(), points.last()] else { return Family::U };
    let ends = [first, last].map(|p| p.position(input));
    let away = |side: usize, end: usize| {
        let chain = patch.sides[side].iter().map(|&v| patch.mesh.points[v as usize].distance(ends[end]));
        chain.fold(f64::INFINITY, f64::min)
    };
    let miss = |k: usize| (away(k, 0) + away(k + 2, 1)).min(away(k, 1) + away(k + 2, 0));
    if miss(0) < miss(1) { Family::V } else { Family::U }
}

/// Looks whether the feature curves of a patch, and its sections if they are given, suit it, without making its grid.
/// * `patch` - its number, and its exact sub-mesh of `input`
/// * `features` - those of all patches
/// # Errors
/// See [`FeatureError`]; curves are named by their index.
pub fn check_features(
    input: &TriMesh,
    (number, patch): (u32, &PatchMesh),
    features: &[FeatureCurve],
    sections: Option<&Sections>,
) -> Result<(), FeatureError> {
    let own: Vec<usize> = (0..features.len()).filter(|&k| features[k].patch == number).collect();
    let curves: Vec<FeatureCurve> = own.iter().map(|&k| features[k].clone()).collect();
    let strands = Strands::new(input, patch, &curves).map_err(|e| named(e, &own))?;
    if !curves.is_empty() {
        weave(patch, &strands).map_err(|e| named(e, &own))?;
    }
    let none = Sections::default();
    let sections = sections.unwrap_or(&none);
    for (family, given, list) in [("u", &sections.u, &strands.across), ("v", &sections.v, &strands.along)] {
        check_count(family, given, list.len() + 1)?;
    }
    Ok(())
}

impl Here<'_> {
    /// Resamples some of the patches, `which`, rising; those with feature curves follow them exactly.
    /// * `sizes` - as of [`crate::grid::choose_sizes`], of all patches; numbers given by sections go over them along their chord
    ///   ([`give_sums`])
    /// # Errors
    /// See [`FeatureError`]; curves are named by their index.
    pub(crate) fn relax_some(
        &self,
        which: &[usize],
        sizes: &[(usize, usize)],
        observer: &dyn Observer,
    ) -> Result<Vec<Grid>, FeatureError> {
        let Here { input, network, patches, drawn: (features, sections), params } = *self;
        if patches.len() != sizes.len() || patches.len() != network.patches.len() {
            return Err(GridError::SizeCount { patches: patches.len(), sizes: sizes.len() }.into());
        }
        let mut of_patch: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (k, feature) in features.iter().enumerate() {
            if feature.patch as usize >= patches.len() {
                return Err(FeatureError::NoSuchPatch { curve: k, patch: feature.patch, patches: patches.len() });
            }
            of_patch.entry(feature.patch as usize).or_default().push(k);
        }
        let given = |p: usize| sections.iter().rfind(|s| s.0 as usize == p).map(|s| &s.1);
        let mut strands: BTreeMap<usize, (Strands, [Vec<usize>; 2])> = BTreeMap::new();
        for (&p, own) in &of_patch {
            let curves: Vec<FeatureCurve> = own.iter().map(|&k| features[k].clone()).collect();
            let found = Strands::new(input, &patches[p], &curves).map_err(|e| named(e, own))?;
            let means = |list: &[usize]| list.iter().map(|&k| found.mean_share(k)).collect::<Vec<_>>();
            let none = Sections::default();
            let sections = given(p).unwrap_or(&none);
            let cells = [
                cells_between("u", &sections.u, &means(&found.across), sizes[p].0 - 1)?,
                cells_between("v", &sections.v, &means(&found.along), sizes[p].1 - 1)?,
            ];
            strands.insert(p, (found, cells));
        }
        let on_curve = stops_of_curves(network, &strands, sizes)?;
        let stops: Vec<SideStops> = (network.patches.iter().zip(sizes))
            .map(|(patch, size)| {
                std::array::from_fn(|k| {
                    let side = patch.sides[k];
                    let count = if k % 2 == 0 { size.0 } else { size.1 };
                    let own = on_curve.get(&side.curve).cloned().unwrap_or_default();
                    if side.reversed { side::turned(&own, count) } else { own }
                })
            })
            .collect();
        // Patches without feature curves together, those with them one by one.
        let plain: Vec<usize> = which.iter().copied().filter(|p| !strands.contains_key(p)).collect();
        let pick = |list: &[usize]| -> (Vec<PatchMesh>, Vec<(usize, usize)>, Vec<SideStops>) {
            let patches = list.iter().map(|&p| patches[p].clone()).collect();
            (patches, list.iter().map(|&p| sizes[p]).collect(), list.iter().map(|&p| stops[p].clone()).collect())
        };
        let (some, some_sizes, some_stops) = pick(&plain);
        let each = 1.0 / which.len().max(1) as f64;
        let first = Part::new(observer, 0.0, plain.len() as f64 * each);
        let made = relax_at(input, &some, &some_sizes, &some_stops, params, &first).map_err(|e| of_plain(e, &plain))?;
        let mut grids: BTreeMap<usize, Grid> = plain.into_iter().zip(made).collect();
        for (&p, (found, cells)) in strands.iter().filter(|s| which.contains(s.0)) {
            let part = Part::new(observer, grids.len() as f64 * each, each);
            let made = relax_along((input, &patches[p]), found, cells, &stops[p], params, &part);
            grids.insert(p, made.map_err(|e| named(e, &of_patch[&p]))?.grid);
        }
        Ok(grids.into_values().collect())
    }
}

/// An error of some patches with the number of the patch in the network.
fn of_plain(error: GridError, plain: &[usize]) -> GridError {
    let name = |patch: usize| plain.get(patch).copied().unwrap_or(patch);
    match error {
        GridError::NotADisk { patch, reason } => GridError::NotADisk { patch: name(patch), reason },
        GridError::DegenerateSide { patch, side } => GridError::DegenerateSide { patch: name(patch), side },
        GridError::Folded { patch, triangles } => GridError::Folded { patch: name(patch), triangles },
        GridError::TooSmall { patch, cols, rows } => GridError::TooSmall { patch: name(patch), cols, rows },
        other => other,
    }
}

/// An error of one patch with the curves' numbers in the network.
fn named(error: FeatureError, own: &[usize]) -> FeatureError {
    let name = |k: usize| own.get(k).copied().unwrap_or(k);
    match error {
        FeatureError::Cross { a, b, place } => FeatureError::Cross { a: name(a), b: name(b), place },
        FeatureError::MeetAgain { a, b, times, place } => {
            FeatureError::MeetAgain { a: name(a), b: name(b), times, place }
        }
        FeatureError::Outside { curve } => FeatureError::Outside { curve: name(curve) },
        FeatureError::AtCorner { curve } => FeatureError::AtCorner { curve: name(curve) },
        other => other,
    }
}

/// Puts the sums of given sections in the place of the sizes along their chords.
pub(crate) fn give_sums(
    network: &Network,
    (features, sections): Drawn,
    sizes: &mut [(usize, usize)],
) -> Result<(), FeatureError> {
    let chords = network.chords();
    let chord = |p: usize, k: usize| chords[network.patches[p].sides[k].curve as usize];
    let mut sums: BTreeMap<u32, usize> = BTreeMap::new();
    for &(p, ref sections) in sections.iter().filter(|s| (s.0 as usize) < network.patches.len()) {
        let p = p as usize;
        let curves = |family: Family| features.iter().filter(|f| f.patch as usize == p && f.family == family).count();
        check_count("u", &sections.u, curves(Family::V) + 1)?;
        check_count("v", &sections.v, curves(Family::U) + 1)?;
        for (k, cells) in [(0, &sections.u), (1, &sections.v)] {
            if cells.is_empty() {
                continue;
            }
            let sum = cells.iter().map(|&c| c.max(FEWEST_CELLS)).sum();
            let other = *sums.entry(chord(p, k)).or_insert(sum);
            if other != sum {
                return Err(FeatureError::SumsDiffer { patch: p, given: sum, other });
            }
        }
    }
    for (p, size) in sizes.iter_mut().enumerate() {
        if let Some(&sum) = sums.get(&chord(p, 0)) {
            size.0 = sum + 1;
        }
        if let Some(&sum) = sums.get(&chord(p, 1)) {
            size.1 = sum + 1;
        }
    }
    Ok(())
}

/// The stops of every curve of the network, in its direction.
fn stops_of_curves(
    network: &Network,
    strands: &BTreeMap<usize, (Strands, [Vec<usize>; 2])>,
    sizes: &[(usize, usize)],
) -> Result<BTreeMap<u32, side::Stops>, FeatureError> {
    let mut on_curve: BTreeMap<u32, side::Stops> = BTreeMap::new();
    for (&p, (found, cells)) in strands {
        for k in 0..4 {
            let side = network.patches[p].sides[k];
            let count = if k % 2 == 0 { sizes[p].0 } else { sizes[p].1 };
            let own = found.stops(k, cells);
            let own = if side.reversed { side::turned(&own, count) } else { own };
            let list = on_curve.entry(side.curve).or_default();
            for (share, node) in own {
                if !list.iter().any(|s| (s.0 - share).abs() < SAME_END && s.1 == node) {
                    list.push((share, node));
                }
            }
        }
    }
    for (&curve, list) in &mut on_curve {
        list.sort_by(|a, b| a.0.total_cmp(&b.0));
        let rising = list.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 < w[1].1);
        if !rising {
            return Err(FeatureError::EndsClash { curve: curve as usize });
        }
    }
    Ok(on_curve)
}
