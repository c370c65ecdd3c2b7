//! The sidecar `relief.json` of maps, version 2: everything that an image itself does not say. Version 1, one 32-bit EXR
//! per patch in the surface's frame, is that of `relief_files`.

use super::image::MapFile;
use crate::relief_files::SIDECAR;
use crate::{Place, ReadError, WriteError, atomic};
use planish::Units;
use planish::relief::maps::MapParams;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::Path;

/// Version that is written, and the newest that is read.
const VERSION: u32 = 2;

/// What is told of maps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sidecar {
    /// Version.
    pub planish_relief: u32,
    /// The program.
    pub generator: String,
    /// Unit of the displacements.
    pub units: Units,
    /// How the maps were made.
    pub params: MapParams,
    /// Kind of the image files.
    pub file: MapFile,
    /// Bits of each number in the files; sidecars without it have whole numbers of 16.
    #[serde(default)]
    pub bits: Option<u32>,
    /// A displacement is `(value - mid_level) * scale` of what the image holds.
    pub mid_level: f64,
    /// See `mid_level`.
    pub scale: f64,
    /// The same in metres; of normals, which have no length, nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale_metres: Option<f64>,
    /// True where the first row of the images is `v = 0`.
    pub upside_down: bool,
    /// Where a row of `n` texels of a patch is sampled for the parameter `u`.
    pub uv: String,
    /// Largest length of a displacement.
    pub largest: f64,
    /// Largest error of a displacement that rounding may have made; nothing where numbers are as they are.
    pub max_error: Option<f64>,
    /// How a preset's program wires the map.
    pub wiring: String,
    /// Sum over the surfaces that the maps belong to.
    pub surfaces: u32,
    /// Sum over the relief that they were made of; sidecars without it do not tell.
    #[serde(default)]
    pub relief: Option<u32>,
    /// The images.
    pub images: Vec<ImageEntry>,
    /// The patches, in their order.
    pub patches: Vec<PatchEntry>,
    /// Images of vertex attributes with the same layout.
    pub attributes: Vec<AttributeEntry>,
    /// Other files written beside the maps: the base mesh, the wiring.
    pub companions: Vec<String>,
}

/// An image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageEntry {
    /// File beside the sidecar.
    pub file: String,
    /// Pixels across.
    pub width: usize,
    /// Pixels from top to bottom.
    pub height: usize,
}

/// Where a patch lies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PatchEntry {
    /// Number of the image.
    pub image: usize,
    /// Texels from the left.
    pub x: usize,
    /// Texels from below (from above where `upside_down`).
    pub y: usize,
    /// Texels along `u`.
    pub width: usize,
    /// Texels along `v`.
    pub height: usize,
}

/// A vertex attribute.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AttributeEntry {
    /// Its name.
    pub name: String,
    /// A value is `(number - mid_level) * scale`; sidecars without it have 0.
    #[serde(default)]
    pub mid_level: f64,
    /// See `mid_level`.
    pub scale: f64,
    /// Its files, in the order of the images.
    pub files: Vec<String>,
}

/// Writes the sidecar.
pub(super) fn write(folder: &Path, sidecar: &Sidecar) -> Result<(), WriteError> {
    let mut text = Vec::new();
    let mut lines = serde_json::Serializer::with_formatter(&mut text, Lines::default());
    sidecar.serialize(&mut lines).map_err(|e| WriteError::Image(e.to_string()))?;
    text.push(b'\n');
    atomic::write(&folder.join(SIDECAR), |out| Ok(out.write_all(&text)?))
}

/// JSON with a line for each entry of the sidecar and for each element of its lists: a patch takes one, not seven.
#[derive(Default)]
struct Lines {
    depth: usize,
}

impl Lines {
    /// What stands before an element: a new line as far as these go.
    fn part<W: ?Sized + Write>(&self, out: &mut W, first: bool) -> std::io::Result<()> {
        let comma = if first { "" } else { "," };
        match self.depth {
            0..=2 => write!(out, "{comma}\n{:1$}", "", 2 * self.depth),
            _ => write!(out, "{comma}{}", if first { "" } else { " " }),
        }
    }

    fn open<W: ?Sized + Write>(&mut self, out: &mut W, bracket: &str) -> std::io::Result<()> {
        self.depth += 1;
        out.write_all(bracket.as_bytes())
    }

    fn close<W: ?Sized + Write>(&mut self, out: &mut W, bracket: &str) -> std::io::Result<()> {
        self.depth -= 1;
        if self.depth < 2 { write!(out, "\n{:2$}{}", "", bracket, 2 * self.depth) } else { write!(out, "{bracket}") }
    }
}

impl serde_json::ser::Formatter for Lines {
    fn begin_array<W: ?Sized + Write>(&mut self, out: &mut W) -> std::io::Result<()> {
        self.open(out, "[")
    }
    fn end_array<W: ?Sized + Write>(&mut self, out: &mut W) -> std::io::Result<()> {
        self.close(out, "]")
    }
    fn begin_array_value<W: ?Sized + Write>(&mut self, out: &mut W, first: bool) -> std::io::Result<()> {
        self.part(out, first)
    }
    fn begin_object<W: ?Sized + Write>(&mut self, out: &mut W) -> std::io::Result<()> {
        self.open(out, "{")
    }
    fn end_object<W: ?Sized + Write>(&mut self, out: &mut W) -> std::io::Result<()> {
        self.close(out, "}")
    }
    fn begin_object_key<W: ?Sized + Write>(&mut self, out: &mut W, first: bool) -> std::io::Result<()> {
        self.part(out, first)
    }
    fn begin_object_value<W: ?Sized + Write>(&mut self, out: &mut W) -> std::io::Result<()> {
        out.write_all(b": ")
    }
}

/// The version and the program of a new sidecar.
pub(super) fn head() -> (u32, String) {
    (VERSION, concat!("planish ", env!("CARGO_PKG_VERSION")).into())
}

/// Reads the sidecar and checks what it says of sizes.
pub(super) fn read(folder: &Path) -> Result<Sidecar, ReadError> {
    let failed = |source| ReadError::Companion { name: SIDECAR.into(), source, place: Place::Byte(0) };
    let text = crate::mesh_file::bytes_of(&folder.join(SIDECAR)).map_err(failed)?;
    #[derive(Deserialize)]
    struct Version {
        planish_relief: u32,
    }
    let wrong = |e: serde_json::Error| ReadError::Syntax {
        what: format!("{SIDECAR} is not that of maps: {}", e.to_string().split(" at line ").next().unwrap_or_default()),
        place: Place::Line(e.line()),
    };
    let version: Version = serde_json::from_slice(&text).map_err(wrong)?;
    if version.planish_relief != VERSION {
        return Err(ReadError::Unsupported {
            what: format!("version {} of {SIDECAR}", version.planish_relief),
            place: Place::Line(1),
            hint: "write the maps with `planish relief export`",
        });
    }
    let sidecar: Sidecar = serde_json::from_slice(&text).map_err(wrong)?;
    let damaged = |what: String, p: usize| Err(ReadError::Syntax { what, place: Place::Item("patch", p) });
    if !(sidecar.scale > 0.0 && sidecar.scale.is_finite() && sidecar.mid_level.is_finite()) {
        return damaged(format!("{SIDECAR}: scale and mid-level are no numbers of a map"), 0);
    }
    if sidecar
        .bits
        .is_some_and(|b| if sidecar.file.is_whole() { ![8, 16].contains(&b) } else { ![16, 32].contains(&b) })
    {
        return damaged(format!("{SIDECAR}: no image file has numbers of so many bits"), 0);
    }
    for (p, entry) in sidecar.patches.iter().enumerate() {
        let fits =
            |at: usize, size: usize, whole: usize| size >= 2 && at.checked_add(size).is_some_and(|end| end <= whole);
        match sidecar.images.get(entry.image) {
            Some(i) if fits(entry.x, entry.width, i.width) && fits(entry.y, entry.height, i.height) => {}
            _ => return damaged(format!("{SIDECAR}: the patch lies outside of its image"), p),
        }
    }
    let plain = |name: &String| Path::new(name).file_name().is_some_and(|n| n == name.as_str());
    match sidecar.images.iter().position(|i| !plain(&i.file)) {
        Some(k) => damaged(format!("{SIDECAR}: image {k} lies in another folder"), 0),
        None => Ok(sidecar),
    }
}
