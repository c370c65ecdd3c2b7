//! What other programs want of a map: kind, frame, channels, file and layout, as one table.

use super::{AxisOrder, MapFrame, MapKind, SheetKind};

/// What a program wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preset {
    /// The program.
    pub name: &'static str,
    /// What the texels hold.
    pub kind: MapKind,
    /// The frame of vectors and normals.
    pub frame: MapFrame,
    /// Which part of a vector stands in which channel.
    pub order: AxisOrder,
    /// Kind of file, by the word of the option `--file`.
    pub file: &'static str,
    /// How patches are laid out.
    pub sheets: SheetKind,
    /// True where the first row of the image is `v = 0`.
    pub upside_down: bool,
    /// How it is wired there, for the sidecar. `{mid_level}`, `{scale}` and `{scale_cm}` stand for what the files have, the last
    /// one in centimetres.
    pub wiring: &'static str,
}

/// The programs, in the order of their names. Channel orders and settings are those of the programs' manuals, but for
/// glTF, Unreal and ZBrush (common use); Blender's was measured by a bake.
pub const PRESETS: [Preset; 8] = [
    Preset {
        name: "arnold",
        kind: MapKind::Vector,
        frame: MapFrame::Tangent,
        order: AxisOrder::Tnb,
        file: "exr",
        sheets: SheetKind::Udim,
        upside_down: false,
        wiring: "vector_map: order XZY, tangent_space on, color_to_signed off, scale {scale}; image in linear (raw) colour",
    },
    Preset {
        name: "blender",
        kind: MapKind::Vector,
        frame: MapFrame::Tangent,
        order: AxisOrder::Tnb,
        file: "exr",
        sheets: SheetKind::Udim,
        upside_down: false,
        wiring: "Vector Displacement: space Tangent, midlevel {mid_level}, scale {scale}; image colour space Non-Color, material \
                 displacement Displacement Only",
    },
    Preset {
        name: "gltf",
        kind: MapKind::Normal,
        frame: MapFrame::Tangent,
        order: AxisOrder::Tbn,
        file: "png",
        sheets: SheetKind::Atlas,
        upside_down: false,
        wiring: "normalTexture with scale 1; glTF has no displacement: use the displaced mesh for the shape",
    },
    Preset {
        name: "mudbox",
        kind: MapKind::Vector,
        frame: MapFrame::Tangent,
        order: AxisOrder::Tnb,
        file: "exr",
        sheets: SheetKind::Udim,
        upside_down: false,
        wiring: "vector displacement, Absolute Tangent, 32 bit",
    },
    Preset {
        name: "renderman",
        kind: MapKind::Vector,
        frame: MapFrame::Object,
        order: AxisOrder::Tbn,
        file: "exr",
        sheets: SheetKind::Udim,
        upside_down: false,
        wiring: "PxrDispTransform: Generic Vector, vectorSpace Object, height {scale}, remap None; set the displacement bound to \
                 the largest displacement",
    },
    Preset {
        name: "unreal",
        kind: MapKind::Scalar,
        frame: MapFrame::Surface,
        order: AxisOrder::TbnDown,
        file: "png",
        sheets: SheetKind::Atlas,
        upside_down: false,
        wiring: "linear (not sRGB) texture; displacement centre {mid_level}, magnitude {scale_cm}, which is the scale of this file in \
                 centimetres",
    },
    Preset {
        name: "usd",
        kind: MapKind::Scalar,
        frame: MapFrame::Surface,
        order: AxisOrder::Tbn,
        file: "exr",
        sheets: SheetKind::Udim,
        upside_down: false,
        wiring: "relief.usda: UsdPreviewSurface displacement by UsdUVTexture, raw, on the base mesh",
    },
    Preset {
        name: "zbrush",
        kind: MapKind::Scalar,
        frame: MapFrame::Surface,
        order: AxisOrder::Tbn,
        file: "tiff",
        sheets: SheetKind::Atlas,
        upside_down: true,
        wiring: "16 bit displacement with mid {mid_level}, image turned upside down (Flip V); intensity from the scale of this file, \
                 {scale}",
    },
];

/// The preset of a program.
pub fn preset(name: &str) -> Option<&'static Preset> {
    PRESETS.iter().find(|p| p.name == name)
}
