//! Where a picture is taken from.

use crate::geom::Aabb;
use glam::DVec3;

/// A perspective camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position, world units.
    pub eye: DVec3,
    /// Unit vector to the right of the picture.
    pub right: DVec3,
    /// Unit vector to the top of the picture.
    pub up: DVec3,
    /// Unit vector into the picture.
    pub forward: DVec3,
    /// Tangent of half the vertical opening angle.
    pub slope: f64,
}

/// Tangent of half the vertical opening: about that of a portrait lens, so that forms are not distorted.
const SLOPE: f64 = 0.22;
/// Free rim around the box, as a share of the picture.
const RIM: f64 = 0.06;

impl Camera {
    /// A camera that looks at the middle of `bounds` from `toward_eye`, just so far away that the box fits a
    /// picture of `aspect` (width over height). `up` points to the top of the picture.
    pub fn fit(bounds: &Aabb, toward_eye: DVec3, up: DVec3, aspect: f64) -> Camera {
        let corner = |k: usize| {
            let pick = |bit: usize| if k >> bit & 1 == 1 { bounds.max } else { bounds.min };
            DVec3::new(pick(0).x, pick(1).y, pick(2).z)
        };
        let corners: [DVec3; 8] = std::array::from_fn(corner);
        Camera::around(&corners, toward_eye, up, aspect)
    }

    /// As [`Camera::fit`], but as near as the points themselves allow, and centred on what is seen of them.
    pub fn around(points: &[DVec3], toward_eye: DVec3, up: DVec3, aspect: f64) -> Camera {
        let forward = -toward_eye.normalize_or(DVec3::Y);
        let right = forward.cross(up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
        let up = right.cross(forward);
        let seen = Aabb::of(
            &points
                .iter()
                .filter(|p| p.is_finite())
                .map(|p| DVec3::new(p.dot(right), p.dot(up), p.dot(forward)))
                .collect::<Vec<_>>(),
        );
        let middle = if seen.diagonal() > 0.0 { seen.center() } else { seen.min.clamp(DVec3::MIN, DVec3::MAX) };
        let center = right * middle.x + up * middle.y + forward * middle.z;
        let inner = SLOPE * (1.0 - RIM);
        let away = points
            .iter()
            .map(|&p| p - center)
            .map(|d| (d.dot(right).abs() / aspect).max(d.dot(up).abs()) / inner - d.dot(forward))
            .fold(f64::MIN_POSITIVE, f64::max);
        Camera { eye: center - forward * away, right, up, forward, slope: SLOPE }
    }

    /// The camera over a raster of samples.
    pub(super) fn frame(&self, width: usize, height: usize) -> Frame {
        let step = 2.0 * self.slope / height as f64;
        Frame { camera: *self, width, height, step }
    }
}

/// A camera and its raster.
#[derive(Clone, Copy)]
pub(super) struct Frame {
    pub camera: Camera,
    pub width: usize,
    pub height: usize,
    /// Side of a sample at depth 1.
    pub step: f64,
}

impl Frame {
    /// Raster position and depth (along the viewing direction) of a point.
    pub fn project(&self, p: DVec3) -> (f64, f64, f64) {
        let d = p - self.camera.eye;
        let depth = d.dot(self.camera.forward);
        let x = d.dot(self.camera.right) / depth / self.step + self.width as f64 / 2.0;
        let y = -d.dot(self.camera.up) / depth / self.step + self.height as f64 / 2.0;
        (x, y, depth)
    }

    /// Direction through a raster position, of depth 1.
    pub fn ray(&self, x: f64, y: f64) -> DVec3 {
        let (u, v) = ((x - self.width as f64 / 2.0) * self.step, (self.height as f64 / 2.0 - y) * self.step);
        self.camera.forward + self.camera.right * u + self.camera.up * v
    }
}
