//! Strokes and stamps: heights along the normal, by distance in space, so that they go on over seams.

use super::super::Relief;
use super::chain::{comes_near, distance_along};
use super::ground::{Ground, Place, Texel};
use super::projection::{Picture, Projection, Spot};
use super::region::{Region, fade};
use crate::relief::ReliefError;
use glam::DVec3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A brush drawn along places: full height in the middle, nothing at the radius.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stroke {
    /// The places, joined by straight lines in space.
    pub path: Vec<Place>,
    /// Radius, units of the model.
    pub radius: f64,
    /// Height in the middle, units of the model; below 0 it engraves.
    pub height: f64,
    /// Share of the radius over which it fades: 1 is soft, 0 has an upright border.
    #[serde(default = "soft")]
    pub softness: f64,
    /// Only here.
    #[serde(default)]
    pub region: Region,
}

fn soft() -> f64 {
    1.0
}

/// An image pressed into the surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stamp {
    /// File of the image, beside the script.
    pub image: String,
    /// Its middle.
    pub at: Place,
    /// Direction that is up in the image, as it appears seen along the normal.
    pub up: [f64; 3],
    /// Width on the surface, units of the model.
    pub width: f64,
    /// Height of white, units of the model; below 0 it engraves.
    pub height: f64,
    /// How far above and below the middle it reaches, units of the model [default: half the width].
    #[serde(default)]
    pub depth: Option<f64>,
    /// What is there gives way to the stamp where its alpha is 1; else it is added.
    #[serde(default)]
    pub replace: bool,
    /// Only here.
    #[serde(default)]
    pub region: Region,
}

/// Heights of some nodes of the patches as a layer on which both sides of seams agree.
fn raised(
    ground: &Ground,
    reach: impl Fn(usize) -> bool + Sync,
    height: impl Fn(usize, usize) -> f64 + Sync,
) -> Vec<Relief> {
    let mut maps = ground.nothing();
    maps.par_iter_mut().enumerate().filter(|(p, _)| reach(*p)).for_each(|(p, map)| {
        let heights: Vec<f64> = (0..ground.nodes[p].len()).into_par_iter().map(|k| height(p, k)).collect();
        if heights.iter().any(|&h| h != 0.0) {
            map.vectors = heights.into_iter().map(|h| DVec3::new(0.0, 0.0, h)).collect();
        }
    });
    ground.agree(&mut maps);
    maps
}

impl Stroke {
    /// The layer; patches that it does not touch have no vectors.
    /// # Errors
    /// [`ReliefError::Edit`]: what is wrong with it.
    pub fn layer(&self, ground: &Ground) -> Result<Vec<Relief>, ReliefError> {
        let refused = |words: &str| ReliefError::Edit { what: words.into() };
        if !(self.radius > 0.0 && self.radius.is_finite() && self.height.is_finite()) {
            return Err(refused("a stroke needs a radius above 0 and a height"));
        }
        if self.path.is_empty() {
            return Err(refused("a stroke needs places on patches that are there"));
        }
        let path: Vec<(DVec3, DVec3)> =
            self.path.iter().map(|place| ground.locate(place, "the stroke")).collect::<Result<_, _>>()?;
        let points: Vec<DVec3> = path.iter().map(|(p, _)| *p).collect();
        let height = |p: usize, k: usize| {
            let inside = self.radius - distance_along(&path, &ground.nodes[p][k]);
            if inside > 0.0 { self.height * fade(inside, self.softness.clamp(0.0, 1.0) * self.radius) } else { 0.0 }
        };
        Ok(raised(ground, |p| comes_near(ground, p, &points, self.radius), height))
    }
}

impl Stamp {
    /// The layer.
    /// * `now` - the relief that gives way, where it does
    /// # Errors
    /// [`ReliefError::Edit`]: what is wrong with it.
    pub(super) fn layer(&self, ground: &Ground, picture: Picture, now: &[Relief]) -> Result<Vec<Relief>, ReliefError> {
        if !self.height.is_finite() {
            return Err(ReliefError::Edit { what: "a stamp needs a height".into() });
        }
        let spot = Spot { what: "stamp", at: &self.at, up: self.up, width: self.width, depth: self.depth };
        let image = Projection::new(ground, picture, &spot)?;
        let reach = image.reach();
        let near = |p: usize| comes_near(ground, p, &[image.middle], reach);
        let seen = |p: usize, node: &Texel| image.at(node, ground.spacings[p]);
        let height = |p: usize, k: usize| seen(p, &ground.nodes[p][k]).into_iter().product::<f64>() * self.height;
        let mut maps = raised(ground, near, height);
        if self.replace {
            for (p, map) in maps.iter_mut().enumerate().filter(|(p, _)| near(*p)) {
                let alphas: Vec<f64> = ground.nodes[p].iter().map(|node| seen(p, node)[1]).collect();
                if alphas.iter().any(|&a| a > 0.0) && map.vectors.is_empty() {
                    map.vectors = vec![DVec3::ZERO; map.rows * map.cols];
                }
                let below = alphas.iter().zip(&now[p].vectors);
                map.vectors.iter_mut().zip(below).for_each(|(d, (a, old))| *d -= *old * *a);
            }
            ground.agree(&mut maps);
        }
        Ok(maps)
    }
}
