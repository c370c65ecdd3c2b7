//! Where an edit applies: patches, a ball in space, a soft border.

use super::ground::{Ground, Place};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A part of the surface.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Region {
    /// Only these patches; all if none are named.
    pub patches: Vec<u32>,
    /// Middle of a ball.
    pub at: Option<Place>,
    /// Radius of the ball, units of the model.
    pub radius: f64,
    /// Width of the soft border inside the ball, units of the model.
    pub feather: f64,
    /// All that is not in it.
    pub outside: bool,
}

impl Region {
    /// What cannot be meant.
    pub(super) fn fault(&self, ground: &Ground) -> Option<String> {
        if let Some(p) = self.patches.iter().find(|&&p| p as usize >= ground.shapes.len()) {
            return Some(format!("there is no patch {p} among {}", ground.shapes.len()));
        }
        match &self.at {
            Some(_) if !(self.radius > 0.0) => Some("a region around a place needs a radius above 0".into()),
            Some(place) if ground.locate(place).is_none() => Some("the place of the region is on no patch".into()),
            _ if !(self.feather >= 0.0) => Some("the feather is a width of 0 or more".into()),
            _ => None,
        }
    }

    /// The shares of all nodes of the patches, from 0 to 1; `None` where a patch is left out altogether.
    pub(super) fn shares(&self, ground: &Ground) -> Vec<Option<Vec<f64>>> {
        let ball = self.at.as_ref().and_then(|place| ground.locate(place)).map(|(p, _)| p);
        let share = |p: usize| {
            let named = self.patches.is_empty() || self.patches.contains(&(p as u32));
            if ball.is_none() && named == self.outside {
                return None;
            }
            let inside = ground.nodes[p].iter().map(|(at, _)| {
                let near = ball.map_or(1.0, |middle| fade(self.radius - at.distance(middle), self.feather));
                if named { near } else { 0.0 }
            });
            let shares: Vec<f64> = inside.map(|x| if self.outside { 1.0 - x } else { x }).collect();
            shares.iter().any(|&x| x > 0.0).then_some(shares)
        };
        (0..ground.shapes.len()).map(share).collect()
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
