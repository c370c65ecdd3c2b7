//! The edits of a relief, as values: what a script or a program asks for, and the stack of layers that comes of it.

use super::super::resample::{from_world, world_vectors};
use super::super::{Displaced, Relief, ReliefError, resample_all};
use super::bands;
use super::brush::{Stamp, Stroke};
use super::filter::Filter;
use super::ground::{Ground, refused};
use super::projection::Pictures;
use super::quilt::{self, Synthesise};
use super::region::Region;
use super::transfer;
use super::{Layer, Layers};
use crate::geom::is_positive;
use crate::network::Network;
use crate::observe::Observer;
use crate::surface::{Jet, Surface};
use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An edit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "edit", rename_all = "snake_case")]
pub enum ReliefEdit {
    /// Weakens or strengthens a layer, or all.
    Scale(Scale),
    /// Parts the baked relief into bands of wavelengths.
    Split(Split),
    /// Blurs.
    Blur(Blur),
    /// Sharpens.
    Sharpen(Sharpen),
    /// Flattens what is lower than a height.
    Threshold(Threshold),
    /// Draws with a brush.
    Stroke(Stroke),
    /// Presses an image in.
    Stamp(Stamp),
    /// Takes all displacement away.
    Erase(Erase),
    /// Repeats the relief of one patch on others.
    Tile(Tile),
    /// Grows more of the relief of one patch on others, without repeats.
    Synthesise(Synthesise),
    /// Keeps displacements within the focal radius of the surface.
    Limit(Limit),
    /// Gives the maps other numbers of texels.
    Resample(Resample),
    /// Takes a layer off the stack.
    Remove(Remove),
}

/// `scale`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scale {
    /// What the layer is multiplied by, on top of what it was.
    pub factor: f64,
    /// Name of the layer; all of them if it is left out.
    #[serde(default)]
    pub layer: Option<String>,
    /// Only here: makes a layer of the difference.
    #[serde(default)]
    pub region: Option<Region>,
}

/// `split`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Split {
    /// The wavelengths at which it is parted, units of the model.
    pub wavelengths: Vec<f64>,
}

/// `blur`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Blur {
    /// Standard deviation, units of the model.
    pub radius: f64,
    /// Only here.
    #[serde(default)]
    pub region: Region,
}

/// `sharpen`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sharpen {
    /// Standard deviation of the blur whose difference is added, units of the model.
    pub radius: f64,
    /// How much of it is added: 1 doubles what is finer than the radius.
    pub amount: f64,
    /// Only here.
    #[serde(default)]
    pub region: Region,
}

/// `threshold`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Threshold {
    /// Displacements shorter than this are taken away, units of the model.
    pub height: f64,
    /// Only here.
    #[serde(default)]
    pub region: Region,
}

/// `erase`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Erase {
    /// Only here.
    pub region: Region,
}

/// `tile`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tile {
    /// The patch that is repeated.
    pub from: u32,
    /// The patches that get it instead of their own.
    pub to: Vec<u32>,
    /// Repeats along `u` and along `v`, every second one mirrored.
    #[serde(default = "once")]
    pub times: [u32; 2],
    /// Only here.
    #[serde(default)]
    pub region: Region,
}

fn once() -> [u32; 2] {
    [1, 1]
}

/// `limit`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Limit {
    /// Share of the focal radius that a displacement may reach.
    pub share: f64,
}

impl Default for Limit {
    fn default() -> Limit {
        Limit { share: 0.9 }
    }
}

/// `resample`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Resample {
    /// Texels along each side of each patch.
    pub texels: usize,
}

/// `remove`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Remove {
    /// Name of the layer.
    pub layer: String,
}

/// What came of an edit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layered {
    /// The layers now.
    pub stack: Vec<Layer>,
    /// In words, what there is to tell: bands with their figures, numbers of texels.
    pub told: Vec<String>,
    /// True if it has made a layer that moves nothing.
    pub idle: bool,
}

/// Makes an edit: adds its maps to the pool of `layers` and returns the new stack, for [`Layers::record`].
///
/// * `pictures` - gives the image of a stamp or of a mask
///
/// # Errors
/// [`ReliefError::Edit`] for what cannot be meant, and for what displaces a place by more than the model is long; those of the
/// parts; [`ReliefError::Cancelled`].
pub fn edit(
    layers: &mut Layers,
    (network, surfaces): (&Network, &[Surface]),
    edit: &ReliefEdit,
    pictures: &Pictures,
    observer: &dyn Observer,
) -> Result<Layered, ReliefError> {
    let made = stacked(layers, (network, surfaces), edit, pictures, observer)?;
    let sum = Layers::sum_of(&layers.pool, &made.stack).unwrap_or_default();
    Displaced { network, surfaces, reliefs: &sum }.check_lengths()?;
    Ok(made)
}

/// Makes an edit, whatever lengths come of it.
fn stacked(
    layers: &mut Layers,
    (network, surfaces): (&Network, &[Surface]),
    edit: &ReliefEdit,
    pictures: &Pictures,
    observer: &dyn Observer,
) -> Result<Layered, ReliefError> {
    let total = layers.sum().ok_or_else(|| refused("the model has no relief; fit it first"))?;
    let now = Displaced { network, surfaces, reliefs: &total };
    now.check()?;
    let done = |stack| Ok(Layered { stack, ..Layered::default() });
    match edit {
        ReliefEdit::Remove(Remove { layer }) => {
            let at = named(&layers.stack, layer)?;
            let mut stack = layers.stack.clone();
            stack.remove(at);
            if stack.is_empty() {
                return Err(refused("the only layer cannot be removed; erase it"));
            }
            done(stack)
        }
        ReliefEdit::Scale(Scale { factor, layer, region: None }) => {
            if !factor.is_finite() {
                return Err(refused("the factor is no number"));
            }
            let which = layer.as_deref().map(|name| named(&layers.stack, name)).transpose()?;
            let mut stack = layers.stack.clone();
            let chosen = stack.iter_mut().enumerate().filter(|(k, _)| which.is_none_or(|w| w == *k));
            chosen.for_each(|(_, l)| l.amount *= factor);
            done(stack)
        }
        ReliefEdit::Split(s) => split(layers, &now, s, observer),
        ReliefEdit::Resample(r) => {
            if !(2..=16384).contains(&r.texels) {
                return Err(refused(format!("{} texels are asked for; give 2 to 16384", r.texels)));
            }
            done(reshaped(layers, network, surfaces, &vec![[r.texels; 2]; total.len()])?)
        }
        other => {
            let shapes = total.iter().map(|r| [r.rows, r.cols]).collect();
            let ground = Ground::new(network, surfaces, shapes)?;
            let (maps, told) = layer_of(other, &ground, &now, pictures, observer)?;
            let name = fresh(&layers.stack, word(other));
            let mut stack = layers.stack.clone();
            let idle = maps.iter().flat_map(|m| &m.vectors).all(|d| *d == DVec3::ZERO);
            stack.push(layers.added(&name, false, maps));
            Ok(Layered { stack, told, idle })
        }
    }
}

fn word(edit: &ReliefEdit) -> &'static str {
    match edit {
        ReliefEdit::Scale(_) => "scale",
        ReliefEdit::Split(_) => "split",
        ReliefEdit::Blur(_) => "blur",
        ReliefEdit::Sharpen(_) => "sharpen",
        ReliefEdit::Threshold(_) => "threshold",
        ReliefEdit::Stroke(_) => "stroke",
        ReliefEdit::Stamp(_) => "stamp",
        ReliefEdit::Erase(_) => "erase",
        ReliefEdit::Tile(_) => "tile",
        ReliefEdit::Synthesise(_) => "synthesise",
        ReliefEdit::Limit(_) => "limit",
        ReliefEdit::Resample(_) => "resample",
        ReliefEdit::Remove(_) => "remove",
    }
}

impl ReliefEdit {
    /// Its name.
    pub fn name(&self) -> &'static str {
        word(self)
    }
}

fn named(stack: &[Layer], name: &str) -> Result<usize, ReliefError> {
    stack.iter().position(|l| l.name == name).ok_or_else(|| {
        let names: Vec<&str> = stack.iter().map(|l| l.name.as_str()).collect();
        refused(format!("there is no layer \"{name}\"; there are {}", names.join(", ")))
    })
}

/// A name that no layer has yet: `stroke`, `stroke 2` ...
pub(super) fn fresh(stack: &[Layer], word: &str) -> String {
    let is_free = |name: &String| stack.iter().all(|l| l.name != *name);
    let numbered = (2..).map(|k| format!("{word} {k}"));
    std::iter::once(word.to_string()).chain(numbered).find(is_free).unwrap_or_default()
}

impl Layers {
    /// A stack with one more layer of maps that came from elsewhere.
    pub fn with(&mut self, word: &str, maps: Vec<Relief>) -> Vec<Layer> {
        let mut stack = self.stack.clone();
        let name = fresh(&stack, word);
        stack.push(self.added(&name, false, maps));
        stack
    }

    /// All layers at other shapes.
    /// # Errors
    /// As [`resample_all`].
    pub fn reshaped(
        &mut self,
        network: &Network,
        surfaces: &[Surface],
        shapes: &[[usize; 2]],
    ) -> Result<Vec<Layer>, ReliefError> {
        reshaped(self, network, surfaces, shapes)
    }
}

fn reshaped(
    layers: &mut Layers,
    network: &Network,
    surfaces: &[Surface],
    shapes: &[[usize; 2]],
) -> Result<Vec<Layer>, ReliefError> {
    let mut stack = Vec::with_capacity(layers.stack.len());
    for layer in layers.stack.clone() {
        let filled = super::scaled(&layers.pool[layer.maps], 1.0);
        let maps = resample_all(&Displaced { network, surfaces, reliefs: &filled }, shapes)?;
        stack.push(Layer { maps: layers.added(&layer.name, layer.baked, maps).maps, ..layer });
    }
    Ok(stack)
}

/// Bands in the place of what was baked; edits stay above them.
fn split(layers: &mut Layers, now: &Displaced, split: &Split, observer: &dyn Observer) -> Result<Layered, ReliefError> {
    if split.wavelengths.is_empty() || split.wavelengths.iter().any(|w| !(*w > 0.0 && w.is_finite())) {
        return Err(refused("wavelengths above 0 are needed"));
    }
    let (baked, edits): (Vec<Layer>, Vec<Layer>) = layers.stack.iter().cloned().partition(|l| l.baked);
    let only = Layers { pool: layers.pool.clone(), stack: baked, ..Layers::default() };
    let total = only.sum().ok_or_else(|| refused("no layer is left of what was baked"))?;
    let bands = bands::split(&Displaced { reliefs: &total, ..*now }, &split.wavelengths, observer)?;
    let all: f64 = bands.iter().map(|b| b.rms * b.rms).sum();
    let (mut stack, mut told) = (Vec::new(), Vec::new());
    for (k, band) in bands.into_iter().enumerate() {
        let name = format!("band {k}");
        let range = match (band.above, band.below) {
            (Some(a), Some(b)) => format!("{a} to {b}"),
            (Some(a), None) => format!("longer than {a}"),
            (None, Some(b)) => format!("shorter than {b}"),
            (None, None) => "all".into(),
        };
        let share = if all > 0.0 { 100.0 * band.rms * band.rms / all } else { 0.0 };
        told.push(format!("{name}: {range}, RMS {:.6}, {share:.3} % of the energy", band.rms));
        stack.push(layers.added(&name, true, band.maps));
    }
    stack.extend(edits);
    Ok(Layered { stack, told, idle: false })
}

type Made = (Vec<Relief>, Vec<String>);

/// The maps of a new layer.
fn layer_of(
    edit: &ReliefEdit,
    ground: &Ground,
    now: &Displaced,
    pictures: &Pictures,
    observer: &dyn Observer,
) -> Result<Made, ReliefError> {
    let plain = |maps: Vec<Relief>| Ok((maps, Vec::new()));
    let weakened = |mut maps: Vec<Relief>, region: &Region| {
        region.weaken(ground, pictures, &mut maps)?;
        Ok((maps, Vec::new()))
    };
    // What changes what is there, where the region lets it.
    let within = |region: &Region, change: &(dyn Fn(usize, usize, DVec3) -> DVec3 + Sync)| {
        within(ground, &region.shares(ground, pictures)?, now.reliefs, change)
    };
    match edit {
        ReliefEdit::Stroke(stroke) => weakened(stroke.layer(ground)?, &stroke.region),
        ReliefEdit::Stamp(stamp) => {
            let image = pictures(&stamp.image).map_err(refused)?;
            weakened(stamp.layer(ground, image, now.reliefs)?, &stamp.region)
        }
        ReliefEdit::Blur(Blur { radius, region }) => {
            let soft = blurred(now, *radius, observer)?;
            plain(within(region, &|p, k, d| soft[p].vectors[k] - d)?)
        }
        ReliefEdit::Sharpen(Sharpen { radius, amount, region }) => {
            let soft = blurred(now, *radius, observer)?;
            plain(within(region, &|p, k, d| (d - soft[p].vectors[k]) * *amount)?)
        }
        ReliefEdit::Threshold(Threshold { height, region }) => {
            if !is_positive(*height) {
                return Err(refused("a threshold needs a height above 0"));
            }
            let low = |_: usize, _: usize, d: DVec3| if d.length() < *height { -d } else { DVec3::ZERO };
            plain(within(region, &low)?)
        }
        ReliefEdit::Erase(Erase { region }) => plain(within(region, &|_, _, d| -d)?),
        ReliefEdit::Scale(Scale { factor, region, .. }) => {
            let region = region.clone().unwrap_or_default();
            plain(within(&region, &|_, _, d| d * (factor - 1.0))?)
        }
        ReliefEdit::Tile(t) => weakened(tiled(ground, now.reliefs, t)?, &t.region),
        ReliefEdit::Synthesise(s) => weakened(quilt::synthesised(ground, now.reliefs, s, observer)?, &s.region),
        ReliefEdit::Limit(limit) => limited(ground, now, limit),
        _ => Err(refused("this edit makes no layer")),
    }
}

fn blurred(now: &Displaced, radius: f64, observer: &dyn Observer) -> Result<Vec<Relief>, ReliefError> {
    if !(radius > 0.0 && radius.is_finite()) {
        return Err(refused("a radius above 0 is needed"));
    }
    let Displaced { network, surfaces, reliefs } = *now;
    let shapes: Vec<[usize; 2]> = reliefs.iter().map(|r| [r.rows, r.cols]).collect();
    let filter = Filter::new(network, surfaces, &shapes, observer)?;
    let world: Vec<Vec<DVec3>> = surfaces.par_iter().zip(reliefs).map(|(s, r)| world_vectors(s, r)).collect();
    let soft = filter.base.scatter(&filter.blur(&filter.base.gather(&world), radius, observer)?);
    Ok(surfaces.par_iter().zip(shapes).zip(soft).map(|((s, shape), d)| from_world(s, shape, d)).collect())
}

/// A change of every node, by its share.
fn within(
    ground: &Ground,
    shares: &[Option<Vec<f64>>],
    now: &[Relief],
    change: &(dyn Fn(usize, usize, DVec3) -> DVec3 + Sync),
) -> Result<Vec<Relief>, ReliefError> {
    let mut maps = ground.nothing();
    maps.par_iter_mut().zip(shares).enumerate().for_each(|(p, (map, shares))| {
        let Some(shares) = shares else { return };
        let one = |(k, (d, share)): (usize, (&DVec3, &f64))| {
            if *share > 0.0 { change(p, k, *d) * *share } else { DVec3::ZERO }
        };
        map.vectors = now[p].vectors.iter().zip(shares).enumerate().map(one).collect();
    });
    ground.agree(&mut maps);
    Ok(maps)
}

fn tiled(ground: &Ground, now: &[Relief], tile: &Tile) -> Result<Vec<Relief>, ReliefError> {
    let count = now.len() as u32;
    if let Some(p) = tile.to.iter().chain([&tile.from]).find(|&&p| p >= count) {
        return Err(refused(format!("there is no patch {p} among {count}")));
    }
    if tile.times.contains(&0) {
        return Err(refused("at least one repeat in each direction is needed"));
    }
    let mut maps = transfer::tile(ground, &now[tile.from as usize], &tile.to, tile.times);
    // What was there gives way.
    for &p in &tile.to {
        let p = p as usize;
        maps[p].vectors.iter_mut().zip(&now[p].vectors).for_each(|(d, old)| *d -= *old);
    }
    ground.agree(&mut maps);
    Ok(maps)
}

/// The layer that brings displacements back within a share of the focal radius.
///
/// Source: [K98] §7.1 tells that displaced surfaces may intersect themselves; `n k < 1` is where they do not fold at the node.
fn limited(ground: &Ground, now: &Displaced, limit: &Limit) -> Result<Made, ReliefError> {
    if !(limit.share > 0.0 && limit.share <= 1.0) {
        return Err(refused("a share of the focal radius above 0 and at most 1 is needed"));
    }
    let mut maps = ground.nothing();
    let counts: Vec<usize> = maps
        .par_iter_mut()
        .enumerate()
        .map(|(p, map)| {
            let (surface, relief) = (&now.surfaces[p], &now.reliefs[p]);
            let allowed =
                |k: usize| focal(surface, [map.rows, map.cols], k, relief.vectors[k].z).map(|f| f * limit.share);
            let over: Vec<(usize, f64)> = (0..relief.vectors.len())
                .filter_map(|k| {
                    let (z, most) = (relief.vectors[k].z, allowed(k)?);
                    (z.abs() > most.abs()).then_some((k, most - z))
                })
                .collect();
            if !over.is_empty() {
                map.vectors = vec![DVec3::ZERO; map.rows * map.cols];
                over.iter().for_each(|&(k, dz)| map.vectors[k].z = dz);
            }
            over.len()
        })
        .collect();
    // The mean would leave the side that bends more beyond its limit.
    ground.agree_on_most(&mut maps);
    Ok((maps, vec![format!("{} texels brought back", counts.iter().sum::<usize>())]))
}

/// The displacement along the normal on the side of `z` at which normals cross; `None` if they do not on that side.
fn focal(surface: &Surface, [rows, cols]: [usize; 2], k: usize, z: f64) -> Option<f64> {
    let (u, v) = ((k % cols) as f64 / (cols - 1) as f64, (k / cols) as f64 / (rows - 1) as f64);
    let jet: Jet = surface.jet(u, v);
    let bends = jet.curvatures()?;
    let most = bends.iter().map(|c| c * z.signum()).fold(0.0, f64::max);
    (most > 0.0).then(|| z.signum() / most)
}
