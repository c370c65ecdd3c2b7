//! Where patches lie in images: one each, all in one atlas, or on UDIM tiles; rectangles on shelves, the highest first.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Tiles in a row of UDIM numbers: 1001 to 1010, then 1011.
const TILES_IN_A_ROW: usize = 10;

/// How patches are laid out in images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SheetKind {
    /// An image for each patch.
    #[default]
    Patch,
    /// All in one image.
    Atlas,
    /// As many square tiles as are needed.
    Udim,
}

/// Where a patch lies: its image, and the lower left of its texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spot {
    /// Number of the image.
    pub image: usize,
    /// Texels from the left.
    pub x: usize,
    /// Texels from below.
    pub y: usize,
}

/// Images with the places of the patches.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// How they are laid out.
    pub kind: SheetKind,
    /// Width and height of each image.
    pub images: Vec<[usize; 2]>,
    /// For each patch its place.
    pub spots: Vec<Spot>,
    /// Texels around each patch that repeat its border.
    pub gutter: usize,
}

impl Sheet {
    /// UDIM number of an image; `None` for other sheets.
    pub fn udim(&self, image: usize) -> Option<usize> {
        (self.kind == SheetKind::Udim).then_some(1001 + image)
    }

    /// Texture coordinates of node `(i, j)` of a patch, from the lower left.
    pub fn uv(&self, patch: usize, i: usize, j: usize) -> [f32; 2] {
        let Spot { image, x, y } = self.spots[patch];
        let [width, height] = self.images[image];
        let tile = match self.kind {
            SheetKind::Udim => [image % TILES_IN_A_ROW, image / TILES_IN_A_ROW],
            _ => [0, 0],
        };
        let along = |tile: usize, at: usize, size: usize| (tile as f64 + (at as f64 + 0.5) / size as f64) as f32;
        [along(tile[0], x + i, width), along(tile[1], y + j, height)]
    }
}

/// Lays patches out.
///
/// * `shapes` - texels of each patch along `v` and along `u`
/// * `tile` - pixels along a side of a tile
///
/// # Errors
/// The patch that does not fit on a tile.
pub fn pack(shapes: &[[usize; 2]], kind: SheetKind, gutter: usize, tile: usize) -> Result<Sheet, usize> {
    let sizes: Vec<[usize; 2]> = shapes.iter().map(|&[rows, cols]| [cols + 2 * gutter, rows + 2 * gutter]).collect();
    let page = match kind {
        SheetKind::Patch => {
            let images = shapes.iter().map(|&[rows, cols]| [cols, rows]).collect();
            let spots = (0..shapes.len()).map(|image| Spot { image, x: 0, y: 0 }).collect();
            return Ok(Sheet { kind, images, spots, gutter: 0 });
        }
        SheetKind::Atlas => {
            // As near to a square as the shelves come out.
            let area: usize = sizes.iter().map(|[w, h]| w * h).sum();
            let widest = sizes.iter().map(|s| s[0]).max().unwrap_or(1);
            [((area as f64).sqrt().ceil() as usize).max(widest), usize::MAX]
        }
        SheetKind::Udim => [tile, tile],
    };
    if let Some(patch) = sizes.iter().position(|s| s[0] > page[0] || s[1] > page[1]) {
        return Err(patch);
    }
    let (spots, used) = shelves(&sizes, page);
    let spots = spots.into_iter().map(|s| Spot { x: s.x + gutter, y: s.y + gutter, ..s }).collect();
    let count = used.len();
    let images = if kind == SheetKind::Udim { vec![page; count] } else { used };
    Ok(Sheet { kind, images, spots, gutter })
}

/// Places of rectangles on pages, and the width and height that each page uses.
fn shelves(sizes: &[[usize; 2]], page: [usize; 2]) -> (Vec<Spot>, Vec<[usize; 2]>) {
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_by_key(|&p| (std::cmp::Reverse(sizes[p][1]), p));
    let mut spots = vec![Spot { image: 0, x: 0, y: 0 }; sizes.len()];
    let mut used: Vec<[usize; 2]> = vec![[0, 0]];
    // The lower left of what comes next, and the height of its shelf.
    let (mut x, mut y, mut high) = (0, 0, 0);
    for p in order {
        let [width, height] = sizes[p];
        if x + width > page[0] {
            (x, y, high) = (0, y + high, 0);
        }
        if height > page[1] - y {
            (x, y, high) = (0, 0, 0);
            used.push([0, 0]);
        }
        let image = used.len() - 1;
        spots[p] = Spot { image, x, y };
        used[image] = [used[image][0].max(x + width), used[image][1].max(y + height)];
        x += width;
        high = high.max(height);
    }
    (spots, used)
}
