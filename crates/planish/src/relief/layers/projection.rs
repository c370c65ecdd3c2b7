//! An image laid on the surface along the normal of a place: what stamps and masks see of it.
//!
//! Williams 1983, *Pyramidal Parametrics*: each level has half the pixels of the one before. Nodes that stand further apart than
//! pixels take the levels whose pixels are as far apart as they are, else lines of the image would break into steps.

use super::ground::{Ground, Place, Texel};
use crate::geom::is_positive;
use crate::relief::ReliefError;
use glam::{DVec2, DVec3};

/// An image to stamp or to mask with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Pixels across.
    pub width: usize,
    /// Pixels from top to bottom.
    pub height: usize,
    /// Grey and alpha of each pixel, 0 to 1, from the upper left.
    pub pixels: Vec<[f32; 2]>,
}

/// Gives the image of a name, or why there is none.
pub type Pictures<'a> = dyn Fn(&str) -> Result<Picture, String> + 'a;

impl Picture {
    /// Each pixel the mean of four; grey counts by its alpha, and beyond the border there is none.
    fn halved(&self) -> Picture {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let pixel = |k: usize| {
            let (i, j) = (k % width * 2, k / width * 2);
            let four = [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)].into_iter();
            let inside = four.filter(|&(i, j)| i < self.width && j < self.height);
            let sum = inside
                .map(|(i, j)| self.pixels[j * self.width + i])
                .fold([0.0; 2], |s, [g, a]| [s[0] + g * a, s[1] + a]);
            [if sum[1] > 0.0 { sum[0] / sum[1] } else { 0.0 }, sum[1] / 4.0]
        };
        Picture { width, height, pixels: (0..width * height).map(pixel).collect() }
    }

    /// Grey and alpha at `(x, y)` in pixels from the upper left corner, bilinear; transparent outside.
    fn at(&self, x: f64, y: f64) -> [f64; 2] {
        let (x, y) = (x - 0.5, y - 0.5);
        let (i, j) = (x.floor(), y.floor());
        let (s, t) = (x - i, y - j);
        let pixel = |di: f64, dj: f64| {
            let (i, j) = (i + di, j + dj);
            let inside = i >= 0.0 && j >= 0.0 && i < self.width as f64 && j < self.height as f64;
            let [g, a] = if inside { self.pixels[j as usize * self.width + i as usize] } else { [0.0, 0.0] };
            DVec2::new(g as f64, a as f64)
        };
        let low = pixel(0.0, 0.0).lerp(pixel(1.0, 0.0), s);
        low.lerp(pixel(0.0, 1.0).lerp(pixel(1.0, 1.0), s), t).to_array()
    }
}

/// An image at all sizes, each with half as many pixels along a side as the one before.
struct Pyramid(Vec<Picture>);

impl Pyramid {
    fn new(picture: Picture) -> Pyramid {
        let mut levels = vec![picture];
        while let Some(last) = levels.last().filter(|last| last.width.max(last.height) > 1) {
            levels.push(last.halved());
        }
        Pyramid(levels)
    }

    /// Grey and alpha at `(x, y)` in pixels of the first level, for samples `apart` of its pixels away from each other.
    fn at(&self, x: f64, y: f64, apart: f64) -> [f64; 2] {
        let level = apart.log2().clamp(0.0, (self.0.len() - 1) as f64);
        let of = |k: usize| {
            let side = (1u64 << k) as f64;
            DVec2::from(self.0[k].at(x / side, y / side))
        };
        let (fine, coarse) = (level.floor() as usize, level.ceil() as usize);
        of(fine).lerp(of(coarse), level - level.floor()).to_array()
    }
}

/// Where an image lies.
pub(super) struct Spot<'a> {
    /// What is laid there, for messages: "stamp".
    pub what: &'a str,
    /// Its middle.
    pub at: &'a Place,
    /// Direction that is up in the image.
    pub up: [f64; 3],
    /// Width, units of the model.
    pub width: f64,
    /// How far above and below the middle it reaches; half the width unless given.
    pub depth: Option<f64>,
}

/// An image in its place.
pub(super) struct Projection {
    picture: Pyramid,
    /// Pixels across and from top to bottom.
    size: [usize; 2],
    /// Its middle on the surface.
    pub middle: DVec3,
    normal: DVec3,
    right: DVec3,
    up: DVec3,
    /// Side of a pixel, units of the model.
    pixel: f64,
    depth: f64,
}

impl Projection {
    /// # Errors
    /// [`ReliefError::Edit`]: what is wrong with the place or the image.
    pub fn new(ground: &Ground, picture: Picture, spot: &Spot) -> Result<Projection, ReliefError> {
        let what = spot.what;
        let refused = |words: &str| ReliefError::Edit { what: words.replace("{}", what) };
        if !(spot.width > 0.0 && spot.width.is_finite()) {
            return Err(refused("the {} needs a width above 0"));
        }
        if picture.width == 0 || picture.pixels.len() != picture.width * picture.height {
            return Err(refused("the image of the {} is empty"));
        }
        let depth = spot.depth.unwrap_or(spot.width / 2.0);
        if !is_positive(depth) {
            return Err(refused("the {} needs a depth above 0"));
        }
        let (middle, normal) = ground.locate(spot.at, &format!("the {what}"))?;
        let up = DVec3::from(spot.up);
        let up = (up - normal * normal.dot(up))
            .try_normalize()
            .ok_or_else(|| refused("what is up for the {} is along the normal; give another direction"))?;
        let size = [picture.width, picture.height];
        let pixel = spot.width / picture.width as f64;
        let picture = Pyramid::new(picture);
        Ok(Projection { picture, size, middle, normal, right: up.cross(normal), up, pixel, depth })
    }

    /// Grey and alpha at a node; nothing further along the normal than the depth, and on what faces away.
    /// * `spacing` - how far away other nodes are, units of the model
    pub fn at(&self, (at, frame): &Texel, spacing: f64) -> [f64; 2] {
        let d = *at - self.middle;
        if d.dot(self.normal).abs() > self.depth || frame.normal.dot(self.normal) <= 0.0 {
            return [0.0, 0.0];
        }
        let x = d.dot(self.right) / self.pixel + self.size[0] as f64 / 2.0;
        let y = self.size[1] as f64 / 2.0 - d.dot(self.up) / self.pixel;
        self.picture.at(x, y, spacing / self.pixel)
    }

    /// Further from the middle than this there is nothing of it, units of the model.
    pub fn reach(&self) -> f64 {
        let [wide, tall] = self.size.map(|n| self.pixel * n as f64);
        (wide.hypot(tall) / 2.0).hypot(self.depth)
    }
}
