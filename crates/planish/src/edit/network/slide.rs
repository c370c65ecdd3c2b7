//! Corners on the boundary of the mesh or on a sharp edge: dragged, they slide along it.
//!
//! The two curves that follow the line at the corner are one chain; the corner goes to the place of the chain that is
//! nearest to where it is dragged and divides it there. So the line stays covered, and nothing leaves it.
//!
//! See `docs/methods/curves.md`, "Sliding corners".

use super::{EditError, Editor, feet};
use crate::curve::between;
use crate::mesh::FacePoint;
use crate::network::Curve;
use crate::network::imprint::{self, Place};
use glam::DVec3;

/// Nearer to a point of the line than this share of the piece is at it.
const AT_POINT: f64 = 1e-9;

/// Where a corner has slid to.
pub(crate) struct Slid {
    /// Its new place.
    pub place: FacePoint,
    /// The curves along the line with their new points.
    pub curves: Vec<(u32, Vec<FacePoint>)>,
}

impl Editor<'_> {
    /// Where `corner` slides to when it is dragged to `to`; nothing if none of its curves follows a line.
    /// # Errors
    /// `Fixed` where it does not lie between two curves along one line, `Meets` at the next corner of the line.
    pub(crate) fn slide(&self, corner: u32, to: DVec3) -> Result<Option<Slid>, EditError> {
        let curves = &self.network.curves;
        let of = |end: u32| &curves[end as usize / 2];
        let bound: Vec<u32> = self.ends_at(corner).into_iter().filter(|&end| !of(end).kind.is_smooth()).collect();
        let [a, b] = match bound[..] {
            [] => return Ok(None),
            [a, b] if of(a).kind == of(b).kind => [a, b],
            _ => return Err(EditError::Fixed { corner, curves: bound.len() }),
        };
        let closed = a / 2 == b / 2;
        // To the corner, and from it on.
        let mut chain = turned(of(a), !closed && a % 2 == 0);
        let seat = chain[chain.len() - 1];
        if !closed {
            chain.extend_from_slice(&turned(of(b), b % 2 == 1)[1..]);
        }
        let at: Vec<DVec3> = chain.iter().map(|p| p.position(self.mesh)).collect();
        let (k, share, _) = feet(&at, to).min_by(|a, b| a.2.total_cmp(&b.2)).expect("a line has pieces");
        let share = if share < AT_POINT {
            0.0
        } else if share > 1.0 - AT_POINT {
            1.0
        } else {
            share
        };
        let last = chain.len() - 2;
        if (k, share) == (0, 0.0) || (k, share) == (last, 1.0) {
            // The end of the line; of a closed one the corner itself.
            let end = if k == 0 { a } else { b };
            return match closed {
                true => Ok(Some(Slid { place: chain[0], curves: Vec::new() })),
                false => Err(EditError::Meets { corner, other: of(end).corners[1 - end as usize % 2] }),
            };
        }
        let place = match share {
            0.0 => chain[k],
            1.0 => chain[k + 1],
            share => between(self.mesh, self.adjacency, &chain[k], &chain[k + 1], share),
        };
        let head = chain[..k + (share > 0.0) as usize].iter().copied().chain([place]);
        let tail = [place].into_iter().chain(chain[k + 1 + (share == 1.0) as usize..].iter().copied());
        let moved = if closed {
            // Around once from the new place; the corner that was is met on the way.
            vec![(a / 2, self.without_seat(tail.chain(head.skip(1)).collect(), seat))]
        } else {
            // The first part runs to the corner, the second from it.
            let [mut first, mut second] = [head.collect(), tail.collect()].map(|part| self.without_seat(part, seat));
            if a % 2 == 0 {
                first.reverse();
            }
            if b % 2 == 1 {
                second.reverse();
            }
            vec![(a / 2, first), (b / 2, second)]
        };
        Ok(Some(Slid { place, curves: moved }))
    }

    /// Points of a line without the place in the middle of an edge where its corner was.
    fn without_seat(&self, mut points: Vec<FacePoint>, seat: FacePoint) -> Vec<FacePoint> {
        let triangles = &self.mesh.triangles;
        let place = |p: &FacePoint| imprint::place_of(self.adjacency, triangles, p);
        if let Some(i) = (1..points.len().saturating_sub(1)).find(|&i| points[i] == seat)
            && matches!(place(&seat), Place::Edge(..))
            && imprint::along_edge(self.adjacency, triangles, &place(&points[i - 1]), &place(&points[i + 1]), 0.5)
                .is_some()
        {
            points.remove(i);
        }
        points
    }
}

/// The points of a curve, turned round or not.
fn turned(curve: &Curve, around: bool) -> Vec<FacePoint> {
    let mut points = curve.points.clone();
    if around {
        points.reverse();
    }
    points
}
