//! Reliefs as images of any resolution: displacement, heights, normals, and vertex attributes in the same places.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §7.2 to 7.4.
//! 1. what a texel holds - `render`      2. tangent space of a mesh - `tangent`      3. heights by rays - `rays`
//! 4. where patches lie in images - `sheet`      5. and back to a relief - `read`      6. other programs - `preset`
//!
//! A texel is a *node*: the first and the last lie on the border of the patch, so that two patches have the same
//! places along their seam.

mod attribute;
mod preset;
mod rays;
mod read;
mod render;
mod sheet;
mod tangent;
mod texels;

pub use attribute::attribute_maps;
pub use preset::{PRESETS, Preset, preset};
pub use read::read_back;
pub use render::{base_mesh, render};
pub use sheet::{Sheet, SheetKind, Spot, pack};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the texels of a map hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MapKind {
    /// The displacement as a vector.
    #[default]
    Vector,
    /// Its part along the normal of the surface: for displacement and bump inputs of one channel.
    Scalar,
    /// Its length.
    Length,
    /// Heights along the normal by rays to the mesh that was fitted, where they meet it.
    Height,
    /// The unit normal of the displaced surface: a normal map.
    Normal,
}

impl MapKind {
    /// Channels of an image.
    pub fn channels(self) -> usize {
        if matches!(self, MapKind::Vector | MapKind::Normal) { 3 } else { 1 }
    }

    /// The word for it in files.
    pub fn word(self) -> &'static str {
        match self {
            MapKind::Vector => "vector",
            MapKind::Scalar => "scalar",
            MapKind::Length => "length",
            MapKind::Height => "height",
            MapKind::Normal => "normal",
        }
    }
}

/// The frame that vectors of a map are meant in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MapFrame {
    /// The surface's own: tangent along `u`, bitangent, normal.
    #[default]
    Surface,
    /// The axes of the model: x, y, z.
    Object,
    /// MikkTSpace of the base mesh with a vertex for each texel: what renderers of meshes use.
    Tangent,
}

/// Which part of a vector stands in which channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AxisOrder {
    /// Tangent, bitangent, normal; x, y, z in object space; a green channel that points up (OpenGL).
    #[default]
    Tbn,
    /// Tangent, normal, bitangent (Mudbox, Blender, Arnold); x, z, y in object space.
    Tnb,
    /// Tangent, bitangent turned round, normal; a green channel that points down (DirectX).
    TbnDown,
}

impl AxisOrder {
    /// Channels of a vector.
    pub fn to_channels(self, [t, b, n]: [f32; 3]) -> [f32; 3] {
        match self {
            AxisOrder::Tbn => [t, b, n],
            AxisOrder::Tnb => [t, n, b],
            AxisOrder::TbnDown => [t, -b, n],
        }
    }

    /// The vector of channels: each order is its own inverse.
    pub fn from_channels(self, channels: [f32; 3]) -> [f32; 3] {
        self.to_channels(channels)
    }
}

/// How maps are made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MapParams {
    /// What the texels hold.
    pub kind: MapKind,
    /// The frame that vectors and normals are meant in.
    pub frame: MapFrame,
    /// Which part of a vector stands in which channel.
    pub order: AxisOrder,
    /// Texels along each side of each patch; 0 for those of the relief itself.
    #[schemars(range(min = 0, max = 16384))]
    pub texels: usize,
    /// How patches are laid out: an image each, all in one, or UDIM tiles.
    pub sheets: SheetKind,
    /// Texels around each patch of an atlas or a tile that repeat its border.
    #[schemars(range(min = 0, max = 256))]
    pub gutter: usize,
    /// Pixels along a side of a UDIM tile.
    #[schemars(range(min = 16, max = 16384))]
    pub tile: usize,
}

impl Default for MapParams {
    fn default() -> MapParams {
        MapParams {
            kind: MapKind::default(),
            frame: MapFrame::default(),
            order: AxisOrder::default(),
            texels: 0,
            sheets: SheetKind::default(),
            gutter: 4,
            tile: 4096,
        }
    }
}

impl MapParams {
    /// Texels of a patch whose relief has these nodes, `[rows, cols]`.
    pub fn shape(&self, nodes: [usize; 2]) -> [usize; 2] {
        if self.texels < 2 { nodes } else { [self.texels; 2] }
    }
}

/// The map of one patch, row-major from `v = 0` as the relief.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PatchMap {
    /// Texels along `v`.
    pub rows: usize,
    /// Texels along `u`.
    pub cols: usize,
    /// Numbers per texel.
    pub channels: usize,
    /// `channels` numbers per texel.
    pub values: Vec<f32>,
}

impl PatchMap {
    /// The numbers of a texel.
    pub fn texel(&self, k: usize) -> &[f32] {
        &self.values[k * self.channels..][..self.channels]
    }
}
