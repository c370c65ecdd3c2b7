//! Where an edit applies: patches, a ball in space or a tube along places with a soft border, an image as a mask.

use super::super::{Relief, ReliefError};
use super::chain::{comes_near, distance_along};
use super::ground::{Ground, Place, Texel};
use super::projection::{Pictures, Projection, Spot};
use crate::geom::is_positive;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A part of the surface: what all of its keys name together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Region {
    /// Only these patches; all if none are named.
    pub patches: Vec<u32>,
    /// Middle of a ball, and of the image.
    pub at: Option<Place>,
    /// Places that a tube runs along in the place of the ball, joined by straight lines in space. The other side of a thin wall is not
    /// in it.
    pub path: Vec<Place>,
    /// Radius of the ball or the tube, units of the model; 0 beside an image for no ball.
    pub radius: f64,
    /// Width of the soft border inside it, units of the model.
    pub feather: f64,
    /// File of an image beside the script, laid on the surface as that of a stamp: white, times alpha, is in the region, black
    /// is not, and grey is in it by its share.
    pub image: Option<String>,
    /// Direction that is up in the image, as it appears seen along the normal.
    pub up: Option<[f64; 3]>,
    /// Width of the image on the surface, units of the model.
    pub width: Option<f64>,
    /// How far above and below its middle the image reaches, units of the model [default: half the width].
    pub depth: Option<f64>,
    /// All that is not in it.
    pub outside: bool,
}

/// A region whose places and image were found.
struct Found {
    ball: Option<DVec3>,
    tube: Vec<(DVec3, DVec3)>,
    mask: Option<Projection>,
}

impl Region {
    /// # Errors
    /// [`ReliefError::Edit`] for what cannot be meant.
    fn found(&self, ground: &Ground, pictures: &Pictures) -> Result<Found, ReliefError> {
        let refused = |what: String| Err(ReliefError::Edit { what });
        if let Some(p) = self.patches.iter().find(|&&p| p as usize >= ground.shapes.len()) {
            return refused(format!("there is no patch {p} among {}", ground.shapes.len()));
        }
        if self.feather.is_nan() || self.feather < 0.0 {
            return refused("the feather is a width of 0 or more".into());
        }
        let is_tube = !self.path.is_empty();
        if self.at.is_none() && !is_tube && (self.radius != 0.0 || self.feather != 0.0) {
            return refused(
                "radius and feather of a region are those of a ball or a tube; give its middle, at, or its path".into(),
            );
        }
        if is_tube && (self.at.is_some() || self.image.is_some()) {
            return refused("a region is along a path, or around a place: give one of path and at".into());
        }
        let mask = match (&self.image, &self.at, self.up, self.width) {
            (Some(name), Some(at), Some(up), Some(width)) => {
                let picture = pictures(name).map_err(|what| ReliefError::Edit { what })?;
                let spot = Spot { what: "image of the region", at, up, width, depth: self.depth };
                Some(Projection::new(ground, picture, &spot)?)
            }
            (Some(_), ..) => return refused("a region with an image needs at, up and width".into()),
            (None, _, None, None) if self.depth.is_none() => None,
            _ => return refused("up, width and depth of a region are those of its image; name the image".into()),
        };
        let is_ball = self.at.is_some() && (mask.is_none() || self.radius != 0.0);
        if (is_ball || is_tube) && !is_positive(self.radius) {
            return refused("a region around a place or along a path needs a radius above 0".into());
        }
        let tube = self.path.iter().map(|place| ground.locate(place, "the region")).collect::<Result<_, _>>()?;
        let place = self.at.as_ref().map(|place| ground.locate(place, "the region")).transpose()?;
        Ok(Found { ball: place.filter(|_| is_ball).map(|(middle, _)| middle), tube, mask })
    }

    /// The shares of all nodes of the patches, from 0 to 1; `None` where a patch is left out altogether.
    /// * `pictures` - gives the image of a mask
    /// # Errors
    /// [`ReliefError::Edit`] for what cannot be meant.
    pub(super) fn shares(&self, ground: &Ground, pictures: &Pictures) -> Result<Vec<Option<Vec<f64>>>, ReliefError> {
        let Found { ball, tube, mask } = self.found(ground, pictures)?;
        let points: Vec<DVec3> = tube.iter().map(|(p, _)| *p).collect();
        let share = |p: usize| {
            let is_near = tube.is_empty() || comes_near(ground, p, &points, self.radius);
            let named = is_near && (self.patches.is_empty() || self.patches.contains(&(p as u32)));
            let inside = |node: &Texel| {
                let away = match ball {
                    Some(middle) => Some(node.0.distance(middle)),
                    None if tube.is_empty() => None,
                    None => Some(distance_along(&tube, node)),
                };
                let near = away.map_or(1.0, |away| fade(self.radius - away, self.feather));
                let share = |mask: &Projection| mask.at(node, ground.spacings[p]).into_iter().product::<f64>();
                let shown = mask.as_ref().map_or(1.0, |mask| share(mask).clamp(0.0, 1.0));
                let within = if named { near * shown } else { 0.0 };
                if self.outside { 1.0 - within } else { within }
            };
            let shares: Vec<f64> = ground.nodes[p].iter().map(inside).collect();
            shares.iter().any(|&x| x > 0.0).then_some(shares)
        };
        Ok((0..ground.shapes.len()).map(share).collect())
    }

    /// What a layer is inside the region: each displacement times its share.
    /// # Errors
    /// As [`Region::shares`].
    pub(super) fn weaken(&self, ground: &Ground, pictures: &Pictures, maps: &mut [Relief]) -> Result<(), ReliefError> {
        if *self == Region::default() {
            return Ok(());
        }
        for (map, shares) in maps.iter_mut().zip(self.shares(ground, pictures)?) {
            match shares {
                Some(shares) => map.vectors.iter_mut().zip(shares).for_each(|(d, share)| *d *= share),
                None => map.vectors.clear(),
            }
        }
        ground.agree(maps);
        Ok(())
    }
}

/// From 0 at the border to 1 at `width` inside it, without a bend at either end.
pub(super) fn fade(inside: f64, width: f64) -> f64 {
    if inside < 0.0 {
        return 0.0;
    }
    let t = if width > 0.0 { (inside / width).min(1.0) } else { 1.0 };
    t * t * (3.0 - 2.0 * t)
}
