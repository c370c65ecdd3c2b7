//! The orthonormal frame of displacements, in place of the one of [K98] eq. 7.1: `docs/methods/relief.md`.

use crate::surface::basis::{BasisRows, uniform_parameters};
use crate::surface::{Jet, RowSampler, Surface};
use glam::DVec3;
use rayon::prelude::*;

/// Relative size below which `S_u` (against the control net) or the sine between `S_u` and `S_v` counts as zero:
/// above it a frame has at least half of its digits.
const DEGENERATE: f64 = 1e-8;
/// First step towards the middle of the patch where the frame is degenerate; doubled until it is not. Far below a
/// knot span, so that the frame is still that of the place.
const FIRST_STEP: f64 = 1.0 / 1024.0;

/// An orthonormal right-handed frame at a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// `T = S_u / |S_u|`.
    pub tangent: DVec3,
    /// `B = N x T`.
    pub bitangent: DVec3,
    /// `N = S_u x S_v / |S_u x S_v|`.
    pub normal: DVec3,
}

impl Frame {
    /// World vector of `(t, b, n)`.
    pub fn world_from_local(&self, local: DVec3) -> DVec3 {
        self.tangent * local.x + self.bitangent * local.y + self.normal * local.z
    }

    /// `(t, b, n)` of a world vector.
    pub fn local_from_world(&self, world: DVec3) -> DVec3 {
        DVec3::new(self.tangent.dot(world), self.bitangent.dot(world), self.normal.dot(world))
    }

    /// The frame of two derivatives; `None` where they are too short against `size` or too parallel.
    fn of(s_u: DVec3, s_v: DVec3, size: f64) -> Option<Frame> {
        let (u, v) = (s_u.length(), s_v.length());
        let area = s_u.cross(s_v);
        let short = DEGENERATE * size;
        if !(u > short && v > short && area.length() > DEGENERATE * u * v) {
            return None;
        }
        let (tangent, normal) = (s_u / u, area.normalize());
        Some(Frame { tangent, bitangent: normal.cross(tangent), normal })
    }
}

/// The frame of `surface` at `(u, v)`.
///
/// Where `S_u` or `S_u x S_v` vanishes (a collapsed side, a corner whose sides are in line) it is the frame at the
/// first place that has one on the way to the middle of the patch, in steps of 1/1024 of the way, doubled each
/// time; for a surface without any the world axes.
pub fn frame_at(surface: &Surface, u: f64, v: f64) -> Frame {
    let jet = surface.jet(u, v);
    frame_or_near(surface, &jet, u, v, size_of(surface))
}

fn frame_or_near(surface: &Surface, jet: &Jet, u: f64, v: f64, size: f64) -> Frame {
    if let Some(frame) = Frame::of(jet.u, jet.v, size) {
        return frame;
    }
    let mut step = FIRST_STEP;
    while step <= 1.0 {
        let near = surface.jet(u + (0.5 - u) * step, v + (0.5 - v) * step);
        if let Some(frame) = Frame::of(near.u, near.v, size) {
            return frame;
        }
        step *= 2.0;
    }
    Frame { tangent: DVec3::X, bitangent: DVec3::Y, normal: DVec3::Z }
}

/// The frames of `surface` at the nodes of a `rows x cols` grid, row-major.
pub fn frames(surface: &Surface, rows: usize, cols: usize) -> Vec<Frame> {
    let mut out = vec![Frame { tangent: DVec3::X, bitangent: DVec3::Y, normal: DVec3::Z }; rows * cols];
    at_nodes(surface, rows, cols, &mut out, |out, _, frame| *out = frame);
    out
}

/// Calls `visit` with each of the `rows * cols` items, the surface point and the frame at its node.
pub(super) fn at_nodes<T: Send>(
    surface: &Surface,
    rows: usize,
    cols: usize,
    items: &mut [T],
    visit: impl Fn(&mut T, DVec3, Frame) + Sync,
) {
    let (us, vs) = (uniform_parameters(cols), uniform_parameters(rows));
    let along_u = [0, 1].map(|order| BasisRows::new(&surface.knots_u, &us, order));
    let sampler = RowSampler::new(surface, &along_u);
    let size = size_of(surface);
    items.par_chunks_mut(cols).zip(vs).for_each(|(row, v)| {
        let (narrow, slope) = (sampler.narrow(v, 0), sampler.narrow(v, 1));
        for (i, item) in row.iter_mut().enumerate() {
            let jet = Jet {
                point: sampler.node(&narrow, i, 0),
                u: sampler.node(&narrow, i, 1),
                v: sampler.node(&slope, i, 0),
                ..Jet::default()
            };
            visit(item, jet.point, frame_or_near(surface, &jet, us[i], v, size));
        }
    });
}

/// Diagonal of the control net: what "short" is measured against.
fn size_of(surface: &Surface) -> f64 {
    crate::geom::Aabb::of(&surface.control).diagonal()
}
