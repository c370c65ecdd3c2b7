//! Pictures of meshes without a graphics card.
//!
//! 1. which triangle each sample of the picture sees ([`visible`])  2. shade the samples (studio light, soft
//!    darkening of hollows, colours, fields, zebra stripes)  3. lines over it, hidden ones left out
//! 4. average 2 x 2 samples per pixel  5. scale bar
//!
//! Visibility is scan conversion with a depth buffer: at one ray per sample it sees what ray casting sees, in a
//! tenth of the time.

mod camera;
mod color;
mod font;
mod overlay;
mod shade;
mod visible;

pub use camera::Camera;
pub use color::{even_colors, field_color, signed_color};

use crate::mesh::TriMesh;
use glam::DVec3;

/// A picture, row by row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Red, green, blue, alpha (not premultiplied), sRGB, 4 bytes per pixel.
    pub rgba: Vec<u8>,
}

impl Image {
    /// Colours a pixel, opaque; one beside the picture is left out.
    fn put(&mut self, x: usize, y: usize, color: [u8; 3]) {
        if x < self.width && y < self.height {
            let at = 4 * (y * self.width + x);
            self.rgba[at..at + 4].copy_from_slice(&[color[0], color[1], color[2], 255]);
        }
    }
}

/// What the surface is painted with. Colours are sRGB.
#[derive(Clone, Copy, Debug)]
pub enum Paint<'a> {
    /// One colour all over.
    Plain([u8; 3]),
    /// A colour per triangle.
    PerTriangle(&'a [[u8; 3]]),
    /// A colour per vertex, blended over the triangles.
    PerVertex(&'a [[u8; 3]]),
    /// A number per vertex through [`field_color`], with a scale bar.
    Field {
        /// The numbers; those that are not finite are grey.
        values: &'a [f64],
        /// Numbers at the ends of the colour scale.
        range: [f64; 2],
        /// Written over the scale bar (digits, letters and `.,:+-/%()`).
        label: &'a str,
    },
    /// A number per vertex with a side: blue below zero, pale at zero, red above, with a scale bar.
    Signed {
        /// The numbers; those that are not finite are grey.
        values: &'a [f64],
        /// Numbers at the ends of the colour scale are this far from zero.
        reach: f64,
        /// As for [`Paint::Field`].
        label: &'a str,
    },
    /// Stripes as long parallel lamps would reflect, that many over the half sphere; they move with the view.
    /// Stripes are continuous where the surface is tangent-continuous, and smooth where its curvature is.
    Zebra {
        /// Number of stripes.
        stripes: f64,
    },
}

/// A polyline drawn over the surface where it is not hidden.
#[derive(Clone, Debug)]
pub struct Line {
    /// Its points, world units.
    pub points: Vec<DVec3>,
    /// sRGB.
    pub color: [u8; 3],
    /// Width in pixels.
    pub width: f64,
}

/// A short text at a place, drawn where the place is not hidden.
#[derive(Clone, Debug)]
pub struct Label {
    /// The place, world units.
    pub place: DVec3,
    /// Digits, letters and `.,:+-/%()`.
    pub text: String,
    /// sRGB of the plate that it stands on.
    pub color: [u8; 3],
}

/// How a mesh is to look.
#[derive(Clone, Debug)]
pub struct Look<'a> {
    /// What it is painted with.
    pub paint: Paint<'a>,
    /// Unit normals of the vertices, of surfaces that know their own; without them those of the facets are smoothed.
    pub normals: Option<&'a [DVec3]>,
    /// Normals are smoothed except over edges sharper than this many degrees; 0 shows every facet.
    pub crease_deg: f64,
    /// Darkening of hollows, 0 (none) to 1.
    pub hollows: f64,
    /// Polylines.
    pub lines: Vec<Line>,
    /// Texts; of two that would cover each other the first is drawn.
    pub labels: Vec<Label>,
    /// sRGB, or transparent.
    pub background: Option<[u8; 3]>,
}

impl Default for Look<'_> {
    fn default() -> Self {
        Look {
            paint: Paint::Plain([222, 214, 200]),
            normals: None,
            crease_deg: 35.0,
            hollows: 0.8,
            lines: Vec::new(),
            labels: Vec::new(),
            background: Some([255, 255, 255]),
        }
    }
}

/// Why a picture cannot be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RenderError {
    /// The picture has no pixels or is larger than [`LARGEST`] a side.
    #[error("a picture of {width} x {height} pixels; each side must be 1 to {LARGEST}")]
    Size {
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
    },
    /// Colours, numbers or normals do not match the mesh.
    #[error("{found} colours, numbers or normals for {wanted} {what}; one each is needed")]
    Count {
        /// `triangles` or `vertices`.
        what: &'static str,
        /// How many there are.
        wanted: usize,
        /// How many were given.
        found: usize,
    },
}

/// Largest side of a picture: its samples then take about 6 GB, and indices stay far from overflow.
pub const LARGEST: usize = 8192;

/// Samples per pixel along each side.
const FINE: usize = 2;

/// Draws `mesh` as seen by `camera`. Triangles with a corner behind the camera or not finite are left out.
/// # Errors
/// [`RenderError`] for impossible sizes and for paint that does not match the mesh.
pub fn render(mesh: &TriMesh, look: &Look, camera: &Camera, width: usize, height: usize) -> Result<Image, RenderError> {
    if width == 0 || height == 0 || width > LARGEST || height > LARGEST {
        return Err(RenderError::Size { width, height });
    }
    let (what, wanted, found) = match look.paint {
        Paint::PerTriangle(c) => ("triangles", mesh.triangles.len(), c.len()),
        Paint::PerVertex(c) => ("vertices", mesh.points.len(), c.len()),
        Paint::Field { values, .. } | Paint::Signed { values, .. } => ("vertices", mesh.points.len(), values.len()),
        _ => ("", 0, 0),
    };
    if wanted != found {
        return Err(RenderError::Count { what, wanted, found });
    }
    if let Some(normals) = look.normals.filter(|n| n.len() != mesh.points.len()) {
        let (wanted, found) = (mesh.points.len(), normals.len());
        return Err(RenderError::Count { what: "vertices", wanted, found });
    }
    let frame = camera.frame(width * FINE, height * FINE);
    let seen = visible::see(mesh, &frame);
    let mut samples = shade::shade(mesh, look, &frame, &seen);
    overlay::draw_lines(&mut samples, look, &frame, &seen, mesh.bounds().diagonal());
    let mut image = shade::average(&samples, width, height, look.background);
    overlay::draw_labels(&mut image, look, &frame, &seen, mesh.bounds().diagonal());
    match look.paint {
        Paint::Field { range, label, .. } => overlay::draw_bar(&mut image, range, label, field_color),
        Paint::Signed { reach, label, .. } => overlay::draw_bar(&mut image, [-reach, reach], label, signed_color),
        _ => {}
    }
    Ok(image)
}
