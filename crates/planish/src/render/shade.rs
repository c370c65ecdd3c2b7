//! Light on the samples, and samples to pixels.

use super::camera::Frame;
use super::color::{encoded, field_color, linear, signed_color};
use super::visible::{NOTHING, Seen};
use super::{FINE, Image, Look, Paint};
use crate::geom::random;
use crate::mesh::{Adjacency, NONE, TriMesh, next, sharp_edges};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Colour of a sample in linear light; `None` where nothing is seen.
pub(super) type Sample = Option<Vec3>;

/// Steps of the colour table: finer than a byte of colour can show.
const TABLE: usize = 1024;

pub(super) fn shade(mesh: &TriMesh, look: &Look, frame: &Frame, seen: &Seen) -> Vec<Sample> {
    let own = look.normals.ok_or_else(|| corner_normals(mesh, look.crease_deg, seen));
    let normals = |face: u32| match &own {
        Ok(own) => mesh.triangles[face as usize].map(|v| own[v as usize]),
        Err(smoothed) => smoothed.of(face),
    };
    let open = if look.hollows > 0.0 { openness(mesh, frame, seen) } else { Vec::new() };
    let color_at = if let Paint::Signed { .. } = look.paint { signed_color } else { field_color };
    let table: Vec<Vec3> = (0..=TABLE).map(|k| light(color_at(k as f64 / TABLE as f64))).collect();
    let shaded = |i: usize| {
        let face = seen.face[i];
        let (x, y) = (i % frame.width, i / frame.width);
        let ray = frame.ray(x as f64 + 0.5, y as f64 + 0.5);
        let corners = mesh.corners(face as usize);
        let bary = weights(corners, frame.camera.eye, ray);
        let [l, m, n] = normals(face);
        let mut normal = (l * bary[0] + m * bary[1] + n * bary[2]).normalize_or(-frame.camera.forward);
        let geometric = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let back = geometric.dot(ray) > 0.0;
        if back {
            normal = -normal;
        }
        let open = if open.is_empty() { 1.0 } else { open[(y / FINE) * (frame.width / FINE) + x / FINE] };
        let open = 1.0 - look.hollows as f32 * (1.0 - open);
        let lit = studio(frame, normal, ray.normalize(), open);
        let mut base = base_color(mesh, look.paint, &table, face as usize, bary);
        if let Paint::Zebra { stripes } = look.paint {
            base = zebra(frame, normal, ray.normalize(), stripes);
        }
        if back {
            // The inside of open surfaces: darker and cooler.
            base *= Vec3::new(0.55, 0.62, 0.72);
        }
        base * lit.0 + Vec3::splat(lit.1)
    };
    // Light hardly changes between samples of one triangle in one pixel; stripes do.
    let is_even = !matches!(look.paint, Paint::Zebra { .. });
    let mut samples = vec![None; seen.face.len()];
    samples.par_chunks_mut(FINE * frame.width).enumerate().for_each(|(row, samples)| {
        let faces = &seen.face[row * FINE * frame.width..];
        for column in (0..frame.width).step_by(FINE) {
            let pixel: [usize; FINE * FINE] = std::array::from_fn(|s| s / FINE * frame.width + column + s % FINE);
            for (s, &i) in pixel.iter().enumerate().filter(|&(_, &i)| faces[i] != NOTHING) {
                let same = pixel[..s].iter().find(|&&j| is_even && faces[j] == faces[i]);
                samples[i] = same.map_or_else(|| Some(shaded(row * FINE * frame.width + i)), |&j| samples[j]);
            }
        }
    });
    samples
}

fn light(color: [u8; 3]) -> Vec3 {
    Vec3::from_array(color.map(linear))
}

fn base_color(mesh: &TriMesh, paint: Paint, table: &[Vec3], face: usize, bary: [f64; 3]) -> Vec3 {
    let blend = |of: &dyn Fn(usize) -> Vec3| {
        let t = mesh.triangles[face].map(|v| v as usize);
        of(t[0]) * bary[0] as f32 + of(t[1]) * bary[1] as f32 + of(t[2]) * bary[2] as f32
    };
    match paint {
        Paint::Plain(c) => light(c),
        Paint::PerTriangle(c) => light(c[face]),
        Paint::PerVertex(c) => blend(&|v| light(c[v])),
        Paint::Field { values, range, .. } => by_number(mesh, values, range, table, face, bary),
        Paint::Signed { values, reach, .. } => by_number(mesh, values, [-reach, reach], table, face, bary),
        Paint::Zebra { .. } => Vec3::ONE,
    }
}

/// The colour of a number between those of the corners.
fn by_number(mesh: &TriMesh, values: &[f64], range: [f64; 2], table: &[Vec3], face: usize, bary: [f64; 3]) -> Vec3 {
    let t = mesh.triangles[face].map(|v| values[v as usize]);
    let value = t[0] * bary[0] + t[1] * bary[1] + t[2] * bary[2];
    let x = if range[1] > range[0] { (value - range[0]) / (range[1] - range[0]) } else { 0.5 };
    if x.is_nan() { light(field_color(f64::NAN)) } else { table[(x.clamp(0.0, 1.0) * TABLE as f64) as usize] }
}

/// Barycentric weights of the place where the ray meets the triangle's plane, pulled into the triangle.
fn weights([a, b, c]: [DVec3; 3], eye: DVec3, ray: DVec3) -> [f64; 3] {
    let n = (b - a).cross(c - a);
    let p = eye + ray * ((a - eye).dot(n) / ray.dot(n));
    let square = n.length_squared();
    let v = (p - a).cross(c - a).dot(n) / square;
    let w = (b - a).cross(p - a).dot(n) / square;
    if !(v + w).is_finite() {
        return [1.0 / 3.0; 3];
    }
    let raw = [(1.0 - v - w).clamp(0.0, 1.0), v.clamp(0.0, 1.0), w.clamp(0.0, 1.0)];
    let sum = raw[0] + raw[1] + raw[2];
    raw.map(|x| x / sum)
}

/// A large soft lamp over the left shoulder, a weak one from the right, light from above and a little from
/// below; returns the factor of the surface colour and the shine on top of it.
fn studio(frame: &Frame, normal: DVec3, view: DVec3, open: f32) -> (Vec3, f32) {
    let c = &frame.camera;
    let place = |x: f64, y: f64, z: f64| (c.right * x + c.up * y - c.forward * z).normalize();
    let (key, fill, rim) = (place(-0.55, 0.75, 0.65), place(0.85, 0.1, 0.55), place(0.4, 0.5, -0.75));
    // Lamps of some size reach round the edge of shadow.
    let soft = |l: DVec3, size: f64| (((normal.dot(l) + size) / (1.0 + size)).max(0.0) as f32).powf(1.3);
    let sky = 0.5 + 0.5 * normal.dot(c.up) as f32;
    let ambient = Vec3::new(0.10, 0.11, 0.125).lerp(Vec3::new(0.25, 0.255, 0.26), sky) * open;
    let direct = Vec3::new(1.0, 0.97, 0.92) * (0.80 * soft(key, 0.2))
        + Vec3::new(0.80, 0.88, 1.0) * (0.20 * soft(fill, 0.3))
        + Vec3::splat(0.10 * soft(rim, 0.1));
    let half = (key - view).normalize();
    let shine = 0.06 * (normal.dot(half).max(0.0) as f32).powf(38.0);
    // Hollows shade lamps less than the light from all around.
    (ambient + direct * (0.45 + 0.55 * open), shine * open)
}

/// Stripes of the mirrored view by its angle to the upright plane of the camera.
fn zebra(frame: &Frame, normal: DVec3, view: DVec3, stripes: f64) -> Vec3 {
    let mirrored = view - normal * (2.0 * view.dot(normal));
    let angle = mirrored.dot(frame.camera.right).clamp(-1.0, 1.0).acos();
    if (angle * stripes / std::f64::consts::PI * 2.0).floor() as i64 % 2 == 0 {
        Vec3::splat(0.02)
    } else {
        Vec3::splat(0.95)
    }
}

/// Normals at the corners of the triangles that are seen.
struct CornerNormals {
    /// Place among `normals`, for each triangle that is seen.
    place: Vec<u32>,
    normals: Vec<[DVec3; 3]>,
}

impl CornerNormals {
    fn of(&self, face: u32) -> [DVec3; 3] {
        self.normals[self.place[face as usize] as usize]
    }
}

/// Mean over the triangles of the fan at a corner that no sharp edge parts.
fn corner_normals(mesh: &TriMesh, crease_deg: f64, seen: &Seen) -> CornerNormals {
    let mut place = vec![NOTHING; mesh.triangles.len()];
    let mut faces = Vec::new();
    for &face in seen.face.iter().filter(|&&f| f != NOTHING) {
        let place = &mut place[face as usize];
        if *place == NOTHING {
            *place = faces.len() as u32;
            faces.push(face);
        }
    }
    if crease_deg <= 0.0 {
        let normals = faces.par_iter().map(|&f| [mesh.area_vector(f as usize).normalize_or_zero(); 3]).collect();
        return CornerNormals { place, normals };
    }
    let adjacency = Adjacency::new(mesh);
    let sharp = sharp_edges(mesh, &adjacency, crease_deg);
    let passable = |h: u32| adjacency.opposite[h as usize] != NONE && !sharp[h as usize];
    let facet = |h: u32| mesh.area_vector(h as usize / 3);
    let at = |corner: u32| {
        let mut sum = facet(corner);
        // Counter-clockwise over the edge that comes in, then clockwise over the edge that goes out.
        let mut h = corner;
        loop {
            let incoming = crate::mesh::previous(h);
            if !passable(incoming) {
                break;
            }
            h = adjacency.opposite[incoming as usize];
            if h == corner {
                return sum.normalize_or_zero();
            }
            sum += facet(h);
        }
        let mut h = corner;
        while passable(h) {
            h = next(adjacency.opposite[h as usize]);
            sum += facet(h);
        }
        sum.normalize_or_zero()
    };
    let normals = faces.par_iter().map(|&f| [0, 1, 2].map(|k| at(3 * f + k))).collect();
    CornerNormals { place, normals }
}

/// Directions looked at per pixel to find hollows.
const LOOKS: usize = 20;
/// Reach of a hollow, as a share of the bounding-box diagonal.
const HOLLOW_REACH: f64 = 0.06;

/// How open each pixel lies (0 to 1), from the depths around it: a neighbour that stands above the tangent plane
/// takes light away.
fn openness(mesh: &TriMesh, frame: &Frame, seen: &Seen) -> Vec<f32> {
    let (width, height) = (frame.width / FINE, frame.height / FINE);
    let reach = HOLLOW_REACH * mesh.bounds().diagonal();
    let sample = |i: usize| (i / width * FINE, i % width * FINE);
    // Not a number where nothing is seen: such a place takes no light.
    let places: Vec<DVec3> = (0..width * height)
        .into_par_iter()
        .map(|i| {
            let (y, x) = sample(i);
            let at = y * frame.width + x;
            let ray = frame.ray(x as f64 + 0.5, y as f64 + 0.5);
            if seen.face[at] == NOTHING { DVec3::NAN } else { frame.camera.eye + ray * seen.depth[at] as f64 }
        })
        .collect();
    // A spiral, turned differently at each pixel of a 4 x 4 tile; the blur below evens it out.
    let spiral = |tile: usize| {
        let turn = random::unit(1, tile as u64) * std::f64::consts::TAU;
        std::array::from_fn(|k| (turn + 2.399_963 * k as f64).sin_cos())
    };
    let spirals: [[(f64, f64); LOOKS]; 16] = std::array::from_fn(spiral);
    let raw: Vec<f32> = (0..width * height)
        .into_par_iter()
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let p = places[i];
            if p.is_nan() {
                return 1.0;
            }
            let (row, column) = sample(i);
            let face = seen.face[row * frame.width + column];
            let mut n = mesh.normal(face as usize);
            if n.dot(p - frame.camera.eye) > 0.0 {
                n = -n;
            }
            let depth = (p - frame.camera.eye).dot(frame.camera.forward);
            let pixels = reach / (depth * frame.step * FINE as f64);
            let mut taken = 0.0;
            for (k, (sin, cos)) in spirals[x % 4 + 4 * (y % 4)].iter().enumerate() {
                let r = pixels * ((k as f64 + 0.5) / LOOKS as f64);
                let (u, v) = (x as f64 + r * cos, y as f64 + r * sin);
                if u < 0.0 || v < 0.0 || u >= width as f64 || v >= height as f64 {
                    continue;
                }
                let away = places[v as usize * width + u as usize] - p;
                let above = away.dot(n);
                if above > 0.0 {
                    let far = away.length();
                    // A small tilt is the curvature of the facet's surroundings, not a wall.
                    let rise = (above / far - 0.1).max(0.0);
                    taken += rise * (1.0 - (far / (1.5 * reach)).min(1.0));
                }
            }
            (1.0 - 2.2 * taken / LOOKS as f64).clamp(0.0, 1.0) as f32
        })
        .collect();
    // Mean over 4 x 4 pixels of about the same depth.
    (0..width * height)
        .into_par_iter()
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let depth = |x: usize, y: usize| seen.depth[y * FINE * frame.width + x * FINE];
            let own = depth(x, y);
            if own.is_infinite() {
                return 1.0;
            }
            let (mut sum, mut count) = (0.0, 0.0);
            for v in y.saturating_sub(2)..(y + 2).min(height) {
                for u in x.saturating_sub(2)..(x + 2).min(width) {
                    if (depth(u, v) - own).abs() < 0.5 * reach as f32 {
                        sum += raw[v * width + u];
                        count += 1.0;
                    }
                }
            }
            sum / count
        })
        .collect()
}

/// Samples to pixels, over the background.
pub(super) fn average(samples: &[Sample], width: usize, height: usize, background: Option<[u8; 3]>) -> Image {
    let ground = background.map(light);
    let rgba = (0..width * height)
        .into_par_iter()
        .flat_map_iter(|i| {
            let (x, y) = (i % width, i / width);
            let (mut sum, mut count) = (Vec3::ZERO, 0);
            for s in 0..FINE * FINE {
                if let Some(c) = samples[(y * FINE + s / FINE) * width * FINE + x * FINE + s % FINE] {
                    sum += c.min(Vec3::ONE);
                    count += 1;
                }
            }
            let share = count as f32 / (FINE * FINE) as f32;
            let (color, alpha) = match ground {
                Some(g) => (sum / (FINE * FINE) as f32 + g * (1.0 - share), 255),
                None if count == 0 => (Vec3::ZERO, 0),
                None => (sum / count as f32, (255.0 * share + 0.5) as u8),
            };
            let [r, g, b] = color.to_array().map(encoded);
            [r, g, b, alpha]
        })
        .collect();
    Image { width, height, rgba }
}
