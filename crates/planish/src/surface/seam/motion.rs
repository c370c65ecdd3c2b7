//! What is unknown: how control points on and beside seams may move.

use super::corner::leg;
use super::work::{Filled, Work};
use crate::surface::sides::{node, place, side_len};
use glam::DVec3;

/// No unknown.
const NONE: u32 = u32::MAX;

/// How a control point moves: at most three unknowns with their directions.
pub(crate) type Motion = [(u32, DVec3); 3];
pub(crate) const FIXED: Motion = [(NONE, DVec3::ZERO); 3];

pub(crate) fn terms(motion: &Motion) -> impl Iterator<Item = (usize, DVec3)> {
    motion.iter().filter(|(unknown, _)| *unknown != NONE).map(|&(unknown, way)| (unknown as usize, way))
}

/// The Greville abscissa of a control point: where it pulls most.
pub(crate) fn greville(knots: &[f64], i: usize) -> f64 {
    (knots[i + 1] + knots[i + 2] + knots[i + 3]) / 3.0
}

/// The number of unknowns and the motions of all control points.
pub(crate) fn motions(work: &Work, filled: &[Filled], curves: &[Vec<DVec3>]) -> (usize, Vec<Vec<Motion>>) {
    let mut count = 0u32;
    let mut next = || {
        count += 1;
        count - 1
    };
    let normal = |p: usize, u: f64, v: f64| work.means[p].mend(filled[p].surface.jet(u, v).area_vector(), u, v);
    let tilts: Vec<Vec<u32>> =
        (0..work.planes.len()).map(|k| work.planes.get(k).tilts.iter().map(|_| next()).collect()).collect();
    // What may tilt may go along its normal, too.
    let lifts: Vec<u32> = tilts.iter().map(|tilts| if tilts.is_empty() { NONE } else { next() }).collect();
    let mut motions: Vec<Vec<Motion>> = filled.iter().map(|f| vec![FIXED; f.surface.control.len()]).collect();
    for c in (0..work.uses.len()).filter(|&c| work.is_smooth_seam(c) && !work.is_held(c)) {
        let (n, knots) = (work.knots[c].control(), work.knots[c].list());
        for i in 1..n - 1 {
            if !work.meets.is_smooth_within(c, [knots[i], knots[i + 4]]) {
                continue;
            }
            let end = if i == 1 { Some(0) } else { (i == n - 2).then_some(1) };
            if end.is_some_and(|e| !work.meets.is_smooth(c, e as f64)) {
                continue;
            }
            let plane = end.and_then(|e| Some((e, *work.planes.numbers(c, e).first()?)));
            let motion = match plane {
                Some((e, number)) => {
                    let (plane, leg) = (work.planes.get(number), leg(&curves[c], e));
                    let mut motion = FIXED;
                    for (slot, (&unknown, axis)) in motion.iter_mut().zip(tilts[number].iter().zip(&plane.tilts)) {
                        *slot = (unknown, plane.normal * axis.dot(leg));
                    }
                    let lift = (lifts[number], plane.normal);
                    for side in work.uses[c].iter().map(|&at| work.side(at)) {
                        motions[side.patch][side.node(e * (n - 1), 0)] = [lift, FIXED[0], FIXED[0]];
                    }
                    motion[2] = lift;
                    motion
                }
                None => {
                    let both = work.uses[c].iter().map(|&at| {
                        let side = work.side(at);
                        let (u, v) = place(side.side, side.reversed, greville(knots, i));
                        normal(side.patch, u, v)
                    });
                    [(next(), both.sum::<DVec3>().normalize_or(DVec3::Z)), FIXED[0], FIXED[0]]
                }
            };
            for &at in &work.uses[c] {
                let side = work.side(at);
                motions[side.patch][side.node(i, 0)] = motion;
            }
        }
    }
    for (p, f) in filled.iter().enumerate().filter(|(p, _)| !work.held[*p]) {
        let s = &f.surface;
        for j in 1..s.rows - 1 {
            for i in (1..s.cols - 1).filter(|&i| j == 1 || j == s.rows - 2 || i == 1 || i == s.cols - 2) {
                let way = normal(p, greville(&s.knots_u, i), greville(&s.knots_v, j));
                motions[p][j * s.cols + i] = [(next(), way), FIXED[0], FIXED[0]];
            }
        }
    }
    (count as usize, motions)
}

/// For each unknown the sum of squares of what it moves over the distances to the next row of control points.
pub(crate) fn holds(filled: &[Filled], unknowns: usize, motions: &[Vec<Motion>]) -> Vec<f64> {
    let mut holds = vec![0.0; unknowns];
    for (Filled { surface, .. }, motions) in filled.iter().zip(motions) {
        let (rows, cols, net) = (surface.rows, surface.cols, &surface.control);
        for k in 0..4 {
            let n = side_len(rows, cols, k);
            let longest = (0..n).map(|i| step(net, rows, cols, k, i)).fold(0.0, f64::max);
            for i in 0..n {
                // Rows may touch; a thousandth of the longest step keeps the hold finite.
                let reach = step(net, rows, cols, k, i).max(1e-3 * longest);
                for depth in 0..2 {
                    for (unknown, way) in terms(&motions[node(rows, cols, k, i, depth)]).filter(|_| reach > 0.0) {
                        holds[unknown] += (way.length() / reach).powi(2);
                    }
                }
            }
        }
    }
    holds
}

/// Distance between the outer two rows along a side.
pub(crate) fn step(net: &[DVec3], rows: usize, cols: usize, side: usize, i: usize) -> f64 {
    net[node(rows, cols, side, i, 0)].distance(net[node(rows, cols, side, i, 1)])
}
