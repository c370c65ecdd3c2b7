//! The pictures of a report: one point of view, from the input to the zebra stripes.

mod quality;

use crate::failure::Failure;
use planish::DVec3;
use planish::geom::Bvh;
use planish::mesh::TriMesh;
use planish::model::{Drawing, Model};
use planish::pipeline;
use planish::register::Shape;
use planish::relief;
use planish::render::{self, Camera, Image, Label, Line, Look, Paint};
use planish_io::Up;
use planish_io::report::{Picture, Place, Report, Scale, number};
use rayon::prelude::*;

/// Pixels of a picture: two stand side by side on a page, sharp on screens of twice the usual density.
const SIZE: (usize, usize) = (1200, 900);
/// Pixels of a picture that is as wide as the page.
const WIDE: (usize, usize) = (2000, 1500);
/// Pixels of one of the six sides: three stand side by side.
const SIDE: (usize, usize) = (720, 540);
/// Numbers that are drawn: more would be a grey cloud.
const NUMBERS: usize = 400;
/// Curves whose numbers are drawn: those that the table of seams has.
const NUMBERED_CURVES: usize = 15;
const ASPECT: f64 = SIZE.0 as f64 / SIZE.1 as f64;
/// Free rim around the shape, as a share of half the picture.
const RIM: f64 = 0.06;
/// Steps of the colour scale on the page.
const SCALE_STEPS: usize = 12;
/// Iso-curves drawn across a patch in each direction, besides its boundary.
const ISO_CURVES: usize = 4;
const CLAY: [u8; 3] = [206, 203, 196];
const STEEL: [u8; 3] = [170, 190, 210];
const ISO_COLOR: [u8; 3] = [255, 255, 255];
const SEAM_COLOR: [u8; 3] = [40, 46, 54];
const FEATURE_COLOR: [u8; 3] = [192, 38, 38];
const GROUND: [u8; 3] = [250, 250, 251];
/// Stripes over the half sphere: enough to show a kink of half a degree, few enough to be told apart.
const STRIPES: f64 = 9.0;

/// Quads of the mesh that stands for the surfaces, about: half of those seen from all sides are visible.
const QUADS: usize = 2 * SIZE.0 * SIZE.1;
/// Quads per knot span and direction at most.
const CUTS_PER_SPAN: usize = 8;
/// Steps of the colour table: finer than a byte of colour can show.
const COLORS: usize = 1024;

/// Titles of the two pictures under a slider.
const SLIDER: [&str; 2] = ["Surfaces", "Displaced"];

/// Points of a scan as they came: as many as a picture of it shows.
pub struct Raw {
    /// One of so many points of the surface is shown; of outliers all, up to [`DOTS`].
    step: usize,
    points: Vec<DVec3>,
    strays: Vec<DVec3>,
    /// How many there are of both.
    count: [usize; 2],
}

impl Raw {
    /// None yet of so many.
    pub fn new(total: u64) -> Raw {
        let step = total.div_ceil(DOTS as u64).max(1) as usize;
        Raw { step, points: Vec::new(), strays: Vec::new(), count: [0; 2] }
    }

    /// Adds points.
    /// * `strays` - which are outliers
    pub fn add(&mut self, points: &[DVec3], strays: &[bool]) {
        for (p, &off) in points.iter().zip(strays) {
            let count = &mut self.count[usize::from(off)];
            if off && *count < DOTS {
                self.strays.push(*p);
            } else if !off && count.is_multiple_of(self.step) {
                self.points.push(*p);
            }
            *count += 1;
        }
    }
}

/// Draws all pictures of a report.
/// * `raw` - the points of a scan
/// # Errors
/// If the parts of the model do not belong together.
pub fn pictures(model: &Model, raw: Option<&Raw>, report: &Report, up: Up) -> Result<Vec<Picture>, Failure> {
    let (up, toward) = view(up);
    let camera = close_up(Camera::fit(&model.mesh.bounds(), toward, up, ASPECT), &model.mesh);
    // The page is the ground, light or dark.
    let draw_as = |mesh: &TriMesh, look: Look, size: (usize, usize)| {
        let look = Look { background: None, ..look };
        let image = render::render(mesh, &look, &camera, size.0, size.1).map_err(Failure::fault)?;
        png(&image)
    };
    let draw = |mesh: &TriMesh, look: Look| draw_as(mesh, look, SIZE);
    // One quad per sample is as fine as can be seen.
    let cuts = (QUADS / pipeline::span_count(model).max(1)).isqrt().clamp(1, CUTS_PER_SPAN);
    let base = pipeline::surface_mesh_cut(model, cuts, &crate::progress::Interrupt).map_err(Failure::fault)?;
    let displaced = pipeline::displaced_mesh(model, &crate::progress::Interrupt).map_err(Failure::fault)?;
    let unit = report.input.units.as_str();
    let mut pictures = Vec::new();
    let mut add = |title: &str, caption: String, png: Vec<u8>| {
        let place = if SLIDER.contains(&title) { Place::Slider } else { Place::Gallery };
        pictures.push(Picture { title: title.into(), caption, png, scale: None, place });
    };

    if let Some(raw) = raw {
        let (dots, colors) = dots(raw, &model.mesh);
        let look = Look { paint: Paint::PerTriangle(&colors), hollows: 0.0, ..Look::default() };
        let caption = format!("{} raw points as they came, {} outliers in red.", raw.count[0], raw.count[1]);
        add("Scan", caption, draw(&dots, look)?);
    }
    let input = draw(&model.mesh, Look { paint: Paint::Plain(CLAY), ..Look::default() })?;
    let triangles = model.mesh.triangles.len();
    match raw {
        Some(_) => add("Mesh", format!("The mesh made from the points, {triangles} triangles."), input),
        None => add("Input", format!("The mesh after repair, {triangles} triangles."), input),
    }

    let (painted, colors) = patches(model)?;
    let look = Look { paint: Paint::PerTriangle(&colors), lines: curves(model), hollows: 0.5, ..Look::default() };
    let caption = "One colour per patch, with iso-curves of its grid in white. Dark lines are smooth seams, red lines \
                   follow sharp edges or the boundary.";
    add("Patches", caption.into(), draw(&painted, look)?);

    let look = Look {
        paint: Paint::PerTriangle(&colors),
        lines: outlines(model),
        labels: numbers(model, report),
        hollows: 0.3,
        ..Look::default()
    };
    let caption = "Numbers of the patches, and in red those of the seams that bend most: as in the table, in warnings and in \
                   scripts for `planish edit`.";
    add("Numbers", caption.into(), draw(&painted, look)?);

    let look = Look { paint: Paint::Plain(STEEL), ..Look::default() };
    add("Surfaces", "The B-spline surfaces alone, as they are in surface.step.".into(), draw(&base, look.clone())?);
    let caption = "The same surfaces with their displacement maps, as in preview.glb.";
    add("Displaced", caption.into(), draw(&displaced, look)?);

    let (values, top) = deviation(&model.mesh, &base);
    let table: Vec<[u8; 3]> = (0..=COLORS).map(|k| render::field_color(k as f64 / COLORS as f64)).collect();
    let colors: Vec<[u8; 3]> =
        values.iter().map(|d| table[((d / top).clamp(0.0, 1.0) * COLORS as f64).round() as usize]).collect();
    let caption = "Distance of the input from the surfaces without displacement: what the maps have to carry. 98 of 100 \
                   places lie within the scale.";
    let look = Look { paint: Paint::PerVertex(&colors), hollows: 0.0, ..Look::default() };
    add("Deviation", caption.into(), draw(&model.mesh, look)?);

    let steps = (0..=SCALE_STEPS).map(|k| render::field_color(k as f64 / SCALE_STEPS as f64));
    let labels = [0.0, 0.5, 1.0].map(|x| format!("{} {unit}", number(x * top)));
    if let Some(picture) = pictures.iter_mut().find(|p| p.title == "Deviation") {
        picture.scale = Some(Scale { colors: steps.collect(), labels: labels.into() });
    }
    pictures.extend(seams(model, cuts, |mesh, look| draw_as(mesh, look, WIDE))?);
    pictures.extend(sides(&displaced, up)?);
    Ok(pictures)
}

/// What shows how surfaces meet: stripes and combs.
/// * `cuts` - quads per knot span
fn seams(
    model: &Model,
    cuts: usize,
    draw: impl Fn(&TriMesh, Look) -> Result<Vec<u8>, Failure>,
) -> Result<[Picture; 2], Failure> {
    let (mesh, normals) = quality::with_normals(model, cuts).map_err(Failure::fault)?;
    let picture = |title: &str, caption: String, look: Look| {
        let png = draw(&mesh, Look { normals: Some(&normals), hollows: 0.0, ..look })?;
        Ok(Picture { title: title.into(), caption, png, scale: None, place: Place::Wide })
    };
    let stripes = "Reflected stripes on the surfaces, by their own normals. Where the surface bends across a seam a stripe jumps; \
                   where only its curvature changes it has a kink.";
    let paint = Paint::Zebra { stripes: STRIPES };
    let zebra = picture("Zebra stripes", stripes.into(), Look { paint, ..Look::default() })?;
    let quality::Combs { lines, radius } = quality::combs(model);
    let teeth = format!(
        "Combs along the seams and along the middles of the patches: the longer a tooth, the more the surface bends along the curve; \
         blue outwards, orange inwards. Where the ends of the teeth step at a seam, the curvature does. A tooth of 1/50 of the diagonal \
         is a radius of {} {}.",
        number(radius),
        model.units.symbol()
    );
    let combs = picture("Combs of curvature", teeth, Look { paint: Paint::Plain(CLAY), lines, ..Look::default() })?;
    Ok([zebra, combs])
}

/// A shape from its six sides.
fn sides(mesh: &TriMesh, up: DVec3) -> Result<Vec<Picture>, Failure> {
    let front = if up == DVec3::Y { DVec3::Z } else { -DVec3::Y };
    let right = up.cross(front);
    let views = [
        ("Front", front, up),
        ("Back", -front, up),
        ("Right", right, up),
        ("Left", -right, up),
        ("Top", up, -front),
        ("Bottom", -up, front),
    ];
    let draw = |(title, toward, up): (&str, DVec3, DVec3)| {
        let aspect = SIDE.0 as f64 / SIDE.1 as f64;
        let camera = Camera::around(&mesh.points, toward, up, aspect);
        let look = Look { paint: Paint::Plain(STEEL), background: None, ..Look::default() };
        let image = render::render(mesh, &look, &camera, SIDE.0, SIDE.1).map_err(Failure::fault)?;
        let png = png(&image)?;
        Ok(Picture { title: title.into(), caption: String::new(), png, scale: None, place: Place::Side })
    };
    views.into_iter().map(draw).collect()
}

/// Numbers of the seams that bend most, at their middles, and of the patches, at theirs.
fn numbers(model: &Model, report: &Report) -> Vec<Label> {
    let mut worst: Vec<_> = report.seams.iter().filter(|s| !s.feature).collect();
    worst.sort_by(|a, b| b.inner_angle_max_deg.total_cmp(&a.inner_angle_max_deg));
    let seams = worst.into_iter().take(NUMBERED_CURVES).map(|seam| {
        let points = &model.network.curves[seam.curve as usize].points;
        let place = points[points.len() / 2].position(&model.mesh);
        Label { place, text: seam.curve.to_string(), color: [255, 170, 160] }
    });
    let patches = model.grids.iter().enumerate().take(NUMBERS).map(|(p, grid)| {
        let place = grid.points[grid.rows / 2 * grid.cols + grid.cols / 2];
        Label { place, text: p.to_string(), color: [255, 255, 255] }
    });
    seams.chain(patches).collect()
}

/// What a picture of a drawing shows.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct View {
    /// Direction from the shape towards the eye.
    pub toward: [f64; 3],
    /// The direction that is up.
    pub up: [f64; 3],
    /// Shows only what lies within a distance of a place: `[x, y, z, distance]`, world units.
    pub around: Option<[f64; 4]>,
}

impl Default for View {
    fn default() -> View {
        View { toward: [0.62, 0.42, 1.0], up: [0.0, 1.0, 0.0], around: None }
    }
}

const SMOOTH_COLOR: [u8; 3] = [24, 78, 160];
const ISO_FEATURE_COLOR: [u8; 3] = [20, 140, 60];

/// A drawing on its mesh: finished patches in colours, curves in blue, those on sharp edges and boundaries in red,
/// feature curves in green, corners as dots.
/// # Errors
/// If the picture cannot be drawn.
pub fn drawing(mesh: &TriMesh, drawing: &Drawing, view: &View) -> Result<Vec<u8>, Failure> {
    let network = &drawing.network;
    let toward = DVec3::from_array(view.toward);
    let up = DVec3::from_array(view.up);
    let camera = match view.around {
        Some([x, y, z, r]) => {
            let center = DVec3::new(x, y, z);
            let near = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|a| [center - a * r, center + a * r]);
            Camera::around(&near.collect::<Vec<_>>(), toward, up, ASPECT)
        }
        None => close_up(Camera::fit(&mesh.bounds(), toward, up, ASPECT), mesh),
    };
    let palette = render::even_colors(network.patches.len());
    let cut = planish::network::imprint(mesh, network, &crate::progress::Interrupt).ok();
    let (mut all, mut colors) = (TriMesh::default(), Vec::new());
    for (patch, color) in cut.iter().flatten().zip(&palette) {
        let first = all.points.len() as u32;
        all.points.extend(&patch.mesh.points);
        all.triangles.extend(patch.mesh.triangles.iter().map(|t| t.map(|v| v + first)));
        colors.resize(all.triangles.len(), *color);
    }
    let mut lines: Vec<Line> = Vec::new();
    let mut add = |places: &[planish::mesh::FacePoint], color: [u8; 3], width: f64| {
        lines.push(Line { points: places.iter().map(|p| p.position(mesh)).collect(), color, width });
    };
    for curve in &network.curves {
        let color = if curve.kind.is_smooth() { SMOOTH_COLOR } else { FEATURE_COLOR };
        add(&curve.points, color, 2.4);
    }
    for feature in &drawing.sketch.features {
        add(&feature.points, ISO_FEATURE_COLOR, 2.4);
    }
    for corner in &network.corners {
        add(&[corner.place, corner.place], SEAM_COLOR, 6.0);
    }
    let (shown, paint) = match all.triangles.is_empty() {
        true => (mesh, Paint::Plain(CLAY)),
        false => (&all, Paint::PerTriangle(&colors)),
    };
    let look = Look { paint, lines, hollows: 0.6, background: Some(GROUND), ..Look::default() };
    let image = render::render(shown, &look, &camera, SIZE.0, SIZE.1).map_err(Failure::fault)?;
    png(&image)
}

/// A displaced surface in clay, with the curves of its network.
/// * `marked` - vertices that are drawn in red
/// # Errors
/// If the picture cannot be drawn.
pub fn clay(mesh: &TriMesh, curves: Vec<Vec<DVec3>>, marked: &[bool], view: &View) -> Result<Vec<u8>, Failure> {
    let (toward, up) = (DVec3::from_array(view.toward), DVec3::from_array(view.up));
    let camera = close_up(Camera::fit(&mesh.bounds(), toward, up, ASPECT), mesh);
    let line = |points: Vec<DVec3>| Line { points, color: SEAM_COLOR, width: 1.4 };
    let lines = curves.into_iter().map(line).collect();
    let colors: Vec<[u8; 3]> = marked.iter().map(|&red| if red { FEATURE_COLOR } else { CLAY }).collect();
    let paint = Paint::PerVertex(&colors);
    let look = Look { paint, lines, hollows: 0.6, background: Some(GROUND), ..Look::default() };
    png(&render::render(mesh, &look, &camera, SIZE.0, SIZE.1).map_err(Failure::fault)?)
}

/// A shape coloured by a number for each vertex or point: blue below zero, red above, grey where there is none.
/// * `reach` - the number at the ends of the scale
/// # Errors
/// If the picture cannot be drawn.
pub fn coloured(shape: &Shape, values: &[f64], reach: f64, up: Up, unit: &str) -> Result<Vec<u8>, Failure> {
    let (up, toward) = view(up);
    let (mesh, values) = match shape {
        Shape::Surface(mesh) => (mesh.clone(), values.to_vec()),
        Shape::Points(cloud) => facing(&cloud.points, values, toward),
    };
    let camera = close_up(Camera::fit(&mesh.bounds(), toward, up, ASPECT), &mesh);
    let label = format!("distance, {unit}");
    let paint = Paint::Signed { values: &values, reach, label: &label };
    let look = Look { paint, hollows: 0.0, background: Some(GROUND), ..Look::default() };
    let image = render::render(&mesh, &look, &camera, SIZE.0, SIZE.1).map_err(Failure::fault)?;
    png(&image)
}

/// Which way is up, and the direction from the shape towards the eye.
fn view(up: Up) -> (DVec3, DVec3) {
    match up {
        Up::Y => (DVec3::Y, DVec3::new(0.62, 0.42, 1.0)),
        Up::Z => (DVec3::Z, DVec3::new(-0.85, -0.75, 0.6)),
    }
}

/// Points that have a number as small triangles that face the eye.
fn facing(points: &[DVec3], values: &[f64], toward: DVec3) -> (TriMesh, Vec<f64>) {
    let ids: Vec<usize> = (0..points.len()).filter(|&i| values[i].is_finite()).collect();
    let step = ids.len().div_ceil(DOTS).max(1);
    let shown: Vec<usize> = ids.into_iter().step_by(step).collect();
    let diagonal = planish::geom::Aabb::of(shown.iter().map(|&i| &points[i])).diagonal();
    // As if they lay on a square of the size of the box.
    let side = diagonal / (shown.len().max(1) as f64).sqrt() / 2.0;
    let u = toward.any_orthogonal_vector().normalize() * side;
    let v = toward.normalize().cross(u);
    let (mut mesh, mut numbers) = (TriMesh::default(), Vec::new());
    for i in shown {
        let first = mesh.points.len() as u32;
        mesh.points.extend([-u - 0.6 * v, u - 0.6 * v, 1.2 * v].map(|d| points[i] + d));
        mesh.triangles.push([first, first + 1, first + 2]);
        numbers.extend([values[i]; 3]);
    }
    (mesh, numbers)
}

/// `camera` moved so that `mesh` just fills the picture.
fn close_up(camera: Camera, mesh: &TriMesh) -> Camera {
    let mut camera = camera;
    // Moving aside changes the perspective a little: the second round settles it.
    for _ in 0..3 {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let slopes = [camera.slope * ASPECT, camera.slope].map(|s| s * (1.0 - RIM));
        let seen = |p: &DVec3| {
            let q = *p - camera.eye;
            (q.dot(camera.forward), [q.dot(camera.right) / slopes[0], q.dot(camera.up) / slopes[1]])
        };
        // In units of the distance at which a point touches the picture's side: x - depth and x + depth.
        for (depth, place) in mesh.points.iter().map(seen) {
            for k in 0..2 {
                low[k] = low[k].min(place[k] + depth);
                high[k] = high[k].max(place[k] - depth);
            }
        }
        if !low.iter().chain(&high).all(|x| x.is_finite()) {
            return camera;
        }
        let aside = [0, 1].map(|k| (high[k] + low[k]) / 2.0 * slopes[k]);
        let nearer = [0, 1].map(|k| (low[k] - high[k]) / 2.0);
        camera.eye += camera.right * aside[0] + camera.up * aside[1] + camera.forward * nearer[0].min(nearer[1]);
    }
    camera
}

/// The displaced patches side by side, each triangle in the colour of its patch.
fn patches(model: &Model) -> Result<(TriMesh, Vec<[u8; 3]>), Failure> {
    let palette = render::even_colors(model.network.patches.len());
    let (mut all, mut colors) = (TriMesh::default(), Vec::new());
    for (grid, color) in model.grids.iter().zip(palette) {
        let patch = relief::patch_mesh(grid.points.clone(), grid.rows, grid.cols).map_err(Failure::fault)?;
        let first = all.points.len() as u32;
        all.points.extend(patch.points);
        all.triangles.extend(patch.triangles.iter().map(|t| t.map(|v| v + first)));
        colors.resize(all.triangles.len(), color);
    }
    Ok((all, colors))
}

/// Iso-curves of the grids and the curves of the network.
fn curves(model: &Model) -> Vec<Line> {
    let mut lines = Vec::new();
    for grid in &model.grids {
        let inner = |count: usize| (1..=ISO_CURVES).map(move |k| k * (count - 1) / (ISO_CURVES + 1));
        for i in inner(grid.cols) {
            let points = (0..grid.rows).map(|j| grid.points[j * grid.cols + i]).collect();
            lines.push(Line { points, color: ISO_COLOR, width: 0.8 });
        }
        for j in inner(grid.rows) {
            let points = grid.points[j * grid.cols..(j + 1) * grid.cols].to_vec();
            lines.push(Line { points, color: ISO_COLOR, width: 0.8 });
        }
    }
    lines.extend(outlines(model));
    lines
}

/// The curves of the network.
fn outlines(model: &Model) -> Vec<Line> {
    let line = |curve: &planish::network::Curve| {
        let points = curve.points.iter().map(|p| p.position(&model.mesh)).collect();
        let (color, width) = if curve.kind.is_smooth() { (SEAM_COLOR, 1.6) } else { (FEATURE_COLOR, 2.2) };
        Line { points, color, width }
    };
    model.network.curves.iter().map(line).collect()
}

/// Points as small triangles that lie like the surface beside them, outliers in a colour of their own and facing up.
fn dots(raw: &Raw, mesh: &TriMesh) -> (TriMesh, Vec<[u8; 3]>) {
    let Raw { points, strays, count, .. } = raw;
    let tree = Bvh::new(mesh);
    let area: f64 = (0..mesh.triangles.len()).map(|t| mesh.area(t)).sum();
    // The dots of all points together cover a share of the surface: what lies behind shows through.
    let side = (COVERED * area / count[0].max(1) as f64).sqrt();
    let finite = |p: &&DVec3| p.is_finite();
    let plain: Vec<(DVec3, DVec3)> =
        points.par_iter().filter(finite).map(|p| (*p, mesh.normal(tree.closest(*p).place.face as usize))).collect();
    // Only strays around the shape are in the picture.
    let bounds = mesh.bounds();
    let reach = bounds.diagonal();
    let red = strays.iter().filter(finite).filter(|p| p.distance(bounds.center()) < reach).map(|p| (*p, DVec3::Z));
    let count = plain.len();
    let (mut dots, mut colors) = (TriMesh::default(), Vec::new());
    for (k, (p, n)) in plain.into_iter().chain(red).enumerate() {
        let u = n.try_normalize().unwrap_or(DVec3::Z).any_orthonormal_vector();
        let v = n.cross(u);
        let size = if k < count { side } else { 2.0 * side };
        let first = dots.points.len() as u32;
        dots.points.extend([-u - 0.6 * v, u - 0.6 * v, 1.2 * v].map(|d| p + size * d));
        dots.triangles.push([first, first + 1, first + 2]);
        colors.push(if k < count { CLAY } else { FEATURE_COLOR });
    }
    (dots, colors)
}

/// Share of the surface that its dots cover, and how many dots are drawn at most.
const COVERED: f64 = 0.25;
const DOTS: usize = 1_000_000;

/// Distance of each vertex from the surfaces, and the end of a scale that 98 of 100 of them keep.
fn deviation(mesh: &TriMesh, surface: &TriMesh) -> (Vec<f64>, f64) {
    let tree = Bvh::new(surface);
    let values: Vec<f64> = mesh.points.par_iter().map(|p| tree.closest(*p).distance).collect();
    let mut sorted = values.clone();
    sorted.sort_by(f64::total_cmp);
    let top = sorted.get(sorted.len() * 98 / 100).copied().unwrap_or(0.0);
    // A surface that is exact has a scale nevertheless.
    let least = mesh.bounds().diagonal() * 1e-9;
    (values, top.max(least).max(f64::MIN_POSITIVE))
}

/// A picture as a PNG file.
fn png(image: &Image) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, image.width as u32, image.height as u32);
    // An opaque ground needs no fourth byte.
    let is_opaque = image.rgba.chunks_exact(4).all(|p| p[3] == 255);
    encoder.set_color(if is_opaque { png::ColorType::Rgb } else { png::ColorType::Rgba });
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Balanced);
    encoder
        .add_text_chunk("Software".into(), concat!("planish ", env!("CARGO_PKG_VERSION")).into())
        .map_err(Failure::fault)?;
    let mut writer = encoder.write_header().map_err(Failure::fault)?;
    let kept = if is_opaque { 3 } else { 4 };
    let bytes_of: Vec<u8> = image.rgba.chunks_exact(4).flat_map(|p| &p[..kept]).copied().collect();
    writer.write_image_data(&bytes_of).map_err(Failure::fault)?;
    writer.finish().map_err(Failure::fault)?;
    Ok(bytes)
}
