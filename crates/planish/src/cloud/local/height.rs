//! Height fields `z = a u² + b uv + c v² + d u + e v + f` over a tangent plane: family A of [X03] §4.1 and §6.2.

use super::moments::Moments;
use crate::linalg::{eigen3, small_cholesky};
use glam::DVec3;

/// Right-handed orthonormal axes with `n` along the surface normal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub u: DVec3,
    pub v: DVec3,
    pub n: DVec3,
}

impl Frame {
    pub(crate) fn of(n: DVec3) -> Frame {
        // The axis farthest from n gives the steadiest tangent; ties go to the first.
        let a = n.abs();
        let axis = if a.x <= a.y && a.x <= a.z {
            DVec3::X
        } else if a.y <= a.z {
            DVec3::Y
        } else {
            DVec3::Z
        };
        let u = axis.cross(n).normalize();
        Frame { u, v: n.cross(u), n }
    }

    /// Frame of the plane of least squared distances.
    pub(crate) fn of_moments(m: &Moments) -> Frame {
        let (_, axes) = eigen3(m.covariance());
        Frame::of(axes[0])
    }
}

/// Coefficients of a height field in its frame: n = a uu + b uv + c vv + d u + e v + f.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Height {
    pub frame: Frame,
    pub c: [f64; 6],
}

impl Height {
    #[inline]
    pub(crate) fn residual(&self, y: DVec3) -> f64 {
        let (u, v) = (self.frame.u.dot(y), self.frame.v.dot(y));
        let c = &self.c;
        self.frame.n.dot(y) - (u * (c[0] * u + c[1] * v + c[3]) + v * (c[2] * v + c[4]) + c[5])
    }

    /// As coefficients of a quadric in local coordinates.
    pub(crate) fn implicit(&self) -> [f64; 10] {
        let t = directions(&self.frame);
        let mut a = t[0];
        for k in 0..6 {
            for i in 0..10 {
                a[i] -= self.c[k] * t[k + 1][i];
            }
        }
        a
    }

    /// The frame whose normal is the gradient at the foot of the origin.
    fn tilted(&self) -> Frame {
        Frame::of((self.frame.n - self.c[3] * self.frame.u - self.c[4] * self.frame.v).normalize())
    }
}

/// Coefficients of n, uu, uv, vv, u, v, 1 as quadrics.
fn directions(f: &Frame) -> [[f64; 10]; 7] {
    let product = |a: DVec3, b: DVec3| {
        [
            a.x * b.x,
            a.x * b.y + a.y * b.x,
            a.x * b.z + a.z * b.x,
            a.y * b.y,
            a.y * b.z + a.z * b.y,
            a.z * b.z,
            0.0,
            0.0,
            0.0,
            0.0,
        ]
    };
    let linear = |a: DVec3| [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, a.x, a.y, a.z, 0.0];
    let mut one = [0.0; 10];
    one[9] = 1.0;
    [linear(f.n), product(f.u, f.u), product(f.u, f.v), product(f.v, f.v), linear(f.u), linear(f.v), one]
}

/// Least-squares height field in a frame. `None` if the points do not determine one.
pub(crate) fn height(matrix: &[[f64; 10]; 10], frame: Frame) -> Option<Height> {
    let t = directions(&frame);
    let mut g = [[0.0; 6]; 6];
    let mut b = [0.0; 6];
    let mut image = [[0.0; 10]; 7];
    for k in 0..7 {
        for i in 0..10 {
            if t[k][i] != 0.0 {
                for j in 0..10 {
                    image[k][j] += t[k][i] * matrix[i][j];
                }
            }
        }
    }
    let dot = |a: &[f64; 10], b: &[f64; 10]| (0..10).map(|i| a[i] * b[i]).sum::<f64>();
    for i in 0..6 {
        b[i] = dot(&image[0], &t[i + 1]);
        for j in 0..=i {
            g[i][j] = dot(&image[i + 1], &t[j + 1]);
        }
    }
    ridge(&mut g);
    small_cholesky::solve(&mut g, &mut b).then_some(Height { frame, c: b })
}

/// A height field in the frame of the points, once more in the frame of its own gradient.
pub(crate) fn framed_height(matrix: &[[f64; 10]; 10], start: Frame) -> Option<Height> {
    let first = height(matrix, start)?;
    // Below six degrees the frame makes no difference to a height field that shows.
    if first.c[3].hypot(first.c[4]) < 0.1 {
        return Some(first);
    }
    height(matrix, first.tilted())
}

/// A relative ridge at the level of rounding: collinear points leave directions without data.
fn ridge<const N: usize>(g: &mut [[f64; N]; N]) {
    for (i, row) in g.iter_mut().enumerate() {
        row[i] += 1e-13 * row[i] + 1e-300;
    }
}
