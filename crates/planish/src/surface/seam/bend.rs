//! How the tangent planes beside a curve stand, and how they turn with the control points.
//!
//! A tangent plane beside a curve can only turn about it. With `e` the direction of the curve, `m` the part of the
//! derivative inwards `F_u` that is perpendicular to it and `n` the normal, a change of the control points turns it by
//!
//! ```text
//! ( n . dF_u - (e . F_u) / |G'|  n . dG' ) / |m|
//! ```
//!
//! radians, exact to first order; both derivatives are linear in the two outer rows of control points. Along a smooth
//! seam the turns of both sides and the angle between their normals are to add up to nothing.

use crate::network::Network;
use crate::surface::Surface;
use crate::surface::basis::basis_at;
use crate::surface::fold::{CREDIBLE, MeanNormals};
use crate::surface::sides::{node, place, side_len};
use glam::DVec3;

/// Sine of the angle between the parameter lines below which a normal counts less, by the square: 20 degrees. At 0 it
/// is none.
const SLANT: f64 = 0.342;

/// One side of a patch, seen along its curve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Side {
    pub patch: usize,
    pub side: usize,
    pub reversed: bool,
    pub rows: usize,
    pub cols: usize,
    /// Three over the knot span across that begins at the curve: the derivative of a unit step between the outer two rows.
    pub across: f64,
}

/// A tangent plane beside a curve.
pub(crate) struct Stand {
    /// Unit normal, outside.
    pub normal: DVec3,
    /// Unit vector from the curve into the patch, perpendicular to it.
    pub inward: DVec3,
    /// What it counts: 1, less where the parameter lines meet at a flat or pointed angle.
    pub trust: f64,
    /// How it turns with control points of the patch, radians by unit move.
    pub turn: Vec<(usize, DVec3)>,
}

impl Side {
    /// Side `side` of a patch.
    pub fn of(network: &Network, surfaces: &[Surface], (patch, side): (u32, u8)) -> Side {
        let (patch, side) = (patch as usize, side as usize);
        let s = &surfaces[patch];
        let crossing = if side.is_multiple_of(2) { &s.knots_v } else { &s.knots_u };
        let span = if side == 0 || side == 3 { crossing[4] } else { 1.0 - crossing[crossing.len() - 5] };
        let reversed = network.patches[patch].sides[side].reversed;
        Side { patch, side, reversed, rows: s.rows, cols: s.cols, across: 3.0 / span }
    }

    /// Entry `i` of row `depth`, along the curve.
    pub fn node(&self, i: usize, depth: usize) -> usize {
        let i = if self.reversed { side_len(self.rows, self.cols, self.side) - 1 - i } else { i };
        node(self.rows, self.cols, self.side, i, depth)
    }

    /// What a tangent plane at `t` counts: nothing where it is turned over against the grid, whose mean normals are given.
    pub fn trust(&self, stand: &Stand, means: &[MeanNormals], t: f64) -> f64 {
        let (u, v) = place(self.side, self.reversed, t);
        let mean = means[self.patch].at(u, v);
        if mean == DVec3::ZERO {
            stand.trust
        } else {
            stand.trust * (mean.dot(stand.normal) / CREDIBLE).clamp(0.0, 1.0)
        }
    }

    /// The tangent plane at `t` (0 to 1) along the curve, with `knots` those along it; `None` where it has none.
    pub fn stand(&self, net: &[DVec3], knots: &[f64], t: f64) -> Option<Stand> {
        self.stand_towards(net, knots, t, None)
    }

    /// As [`Side::stand`], turning towards the plane with the unit normal `aim` if that is given.
    pub fn stand_towards(&self, net: &[DVec3], knots: &[f64], t: f64, aim: Option<DVec3>) -> Option<Stand> {
        let (first, [value, slope, _]) = basis_at(knots, t);
        let rim: [usize; 4] = std::array::from_fn(|a| self.node(first + a, 0));
        let inner: [usize; 4] = std::array::from_fn(|a| self.node(first + a, 1));
        let sum = |w: &dyn Fn(usize) -> DVec3| (0..4).map(w).sum::<DVec3>();
        let along = sum(&|a| net[rim[a]] * slope[a]);
        let derivative = sum(&|a| (net[inner[a]] - net[rim[a]]) * value[a]) * self.across;
        let speed = along.length();
        let e = along.try_normalize()?;
        let lean = e.dot(derivative);
        let m = derivative - e * lean;
        let reach = m.length();
        let inward = m.try_normalize()?;
        let normal = (if self.reversed { -e } else { e }).cross(inward);
        let trust = (reach / (derivative.length() * SLANT)).min(1.0).powi(2);
        let way = aim.map_or(normal, |aim| (aim - e * e.dot(aim)).normalize_or(normal));
        let mut turn = Vec::with_capacity(8);
        for a in 0..4 {
            let step = self.across * value[a] / reach;
            turn.push((inner[a], way * step));
            turn.push((rim[a], -way * (step + lean / speed * slope[a] / reach)));
        }
        Some(Stand { normal, inward, trust, turn })
    }
}

/// Angle between the normals beside a seam, radians: positive for a valley. Turns of both sides that add up to minus it close
/// it.
pub(crate) fn fold_angle(a: &Stand, b: &Stand) -> f64 {
    let angle = a.normal.cross(b.normal).length().atan2(a.normal.dot(b.normal));
    if (a.inward + b.inward).dot(a.normal + b.normal) < 0.0 { -angle } else { angle }
}
