//! Editing a network: corners and curves added, split, joined, deleted and dragged.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §3.8.1 (edit points and edit sections). Patches are
//! the faces of the graph of curves, so an edit changes curves alone and the patches follow ([`crate::network::diagnose`]). A
//! network may be unfinished between edits; nothing is refused that can be put right.

mod cross;
mod relax;
mod slide;
mod split;

pub use relax::{Holds, Stretch};

use crate::curve::{CurveError, SurfaceCurve};
use crate::geom::polyline;
use crate::layout::LayoutError;
use crate::mesh::{Adjacency, CurvePlace, FacePoint, NONE, TriMesh, move_point_on_curve, next};
use crate::network::diagnose::{Diagnosis, diagnose, glance};
use crate::network::{Corner, Curve, CurveKind, ImprintError, Network};
use glam::DVec3;

/// Why an edit cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EditError {
    /// A corner or curve is named that is not there.
    #[error("{what} {index} is not there, there are {count} - hint: they are counted from 0")]
    NoSuchPart {
        /// `corner`, `curve` or `region`.
        what: &'static str,
        /// Its number.
        index: u32,
        /// How many there are.
        count: usize,
    },
    /// Only a corner between two curves can be joined away.
    #[error(
        "corner {corner} does not lie between two curves (ends of others there: {curves}) - hint: delete the others first; the corner of a closed curve stays"
    )]
    NotBetweenTwo {
        /// The corner.
        corner: u32,
        /// Ends of curves there.
        curves: usize,
    },
    /// A corner with curves that are not to be joined.
    #[error("corner {corner} still ends {curves} curves - hint: delete them first")]
    InUse {
        /// The corner.
        corner: u32,
        /// Ends of curves there.
        curves: usize,
    },
    /// A split at the end of a curve.
    #[error("curve {curve} stays where it is at its ends - hint: give a place between 0 and 1")]
    AtEnd {
        /// The curve.
        curve: u32,
    },
    /// A curve that follows an edge or the boundary is not dragged away from it.
    #[error(
        "curve {curve} follows {line} and stays on it - hint: drag its corners along it, or delete it and draw a new one"
    )]
    Bound {
        /// The curve.
        curve: u32,
        /// What it follows.
        line: &'static str,
    },
    /// A corner that cannot slide along the lines that its curves follow.
    #[error(
        "corner {corner} ends {curves} curves along sharp edges or boundaries and stays there - hint: one between two of them slides along"
    )]
    Fixed {
        /// The corner.
        corner: u32,
        /// Ends of such curves there.
        curves: usize,
    },
    /// A corner that slides along a line comes to the next one.
    #[error(
        "corner {corner} slides along its line and would meet corner {other} there - hint: drag it less far, or delete corner {other} first"
    )]
    Meets {
        /// The corner.
        corner: u32,
        /// The corner that it meets.
        other: u32,
    },
    /// A closed curve that its forces draw together.
    #[error(
        "curve {curve} shrinks to nothing under these forces - hint: pin some of it, relax sections of it, or draw it to a scalar"
    )]
    Shrunk {
        /// The curve.
        curve: u32,
    },
    /// A region that no offered split suits.
    #[error("region {region} has {sides} sides around one loop - hint: 3, 5 and 6 sides can be split")]
    NoSplit {
        /// Number of the region.
        region: u32,
        /// Its sides.
        sides: usize,
    },
    /// No curves run around a place.
    #[error(
        "no curves run around ({:.6}, {:.6}, {:.6}) yet - hint: draw some, or complete the network",
        place.x, place.y, place.z
    )]
    NoRegion {
        /// World position.
        place: DVec3,
    },
    /// Curves run so near each other that none can be laid out between them.
    #[error(
        "the rest cannot be laid out between the curves at ({:.6}, {:.6}, {:.6}): there is next to no room - hint: move them apart there, or let them meet",
        place.x, place.y, place.z
    )]
    Entangled {
        /// World position.
        place: DVec3,
    },
    /// A curve cannot be made.
    #[error(transparent)]
    Curve(#[from] CurveError),
    /// The curves cannot be imprinted.
    #[error(transparent)]
    Imprint(#[from] ImprintError),
    /// The rest cannot be laid out.
    #[error(transparent)]
    Layout(#[from] LayoutError),
}

/// A network under edit on its mesh.
#[derive(Clone, Debug)]
pub struct Editor<'m> {
    /// The mesh.
    pub mesh: &'m TriMesh,
    /// Its adjacency.
    pub adjacency: &'m Adjacency,
    /// The network; its patches are those of the last [`Editor::diagnose`].
    pub network: Network,
}

/// Where on a curve: its points and the share of the piece after one of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OnCurve {
    pub curve: u32,
    pub at: CurvePlace,
    pub distance: f64,
}

impl<'m> Editor<'m> {
    /// An editor on a network.
    pub fn new(mesh: &'m TriMesh, adjacency: &'m Adjacency, network: Network) -> Editor<'m> {
        Editor { mesh, adjacency, network }
    }

    pub(crate) fn corner(&self, index: u32) -> Result<&Corner, EditError> {
        let count = self.network.corners.len();
        self.network.corners.get(index as usize).ok_or(EditError::NoSuchPart { what: "corner", index, count })
    }

    fn curve(&self, index: u32) -> Result<&Curve, EditError> {
        let count = self.network.curves.len();
        self.network.curves.get(index as usize).ok_or(EditError::NoSuchPart { what: "curve", index, count })
    }

    /// Ends of curves at a corner, as `2 curve + end`.
    pub fn ends_at(&self, corner: u32) -> Vec<u32> {
        let curves = self.network.curves.iter().enumerate();
        curves
            .flat_map(|(c, curve)| {
                (0..2).filter(move |&e| curve.corners[e] == corner).map(move |e| 2 * c as u32 + e as u32)
            })
            .collect()
    }

    pub(crate) fn positions(&self, curve: u32) -> Vec<DVec3> {
        self.network.curves[curve as usize].points.iter().map(|p| p.position(self.mesh)).collect()
    }

    /// The place on a curve nearest to `p` within `reach`, ends excluded.
    pub(crate) fn nearest_on_curves(&self, p: DVec3, reach: f64) -> Option<OnCurve> {
        let mut best: Option<OnCurve> = None;
        for c in 0..self.network.curves.len() as u32 {
            let at = self.positions(c);
            for (k, share, distance) in feet(&at, p) {
                let end = (k == 0 && share == 0.0) || (k + 2 == at.len() && share == 1.0);
                if !end && distance <= reach && best.is_none_or(|b| distance < b.distance) {
                    best = Some(OnCurve { curve: c, at: CurvePlace { segment: k, share }, distance });
                }
            }
        }
        best
    }

    /// The corner at a place: one within `snap` (world units), else a new one, which splits the curve that it lies
    /// on if one is within `snap`.
    /// # Errors
    /// `Curve` for a place that is not on the mesh.
    pub fn add_corner(&mut self, place: FacePoint, snap: f64) -> Result<u32, EditError> {
        let faces = self.mesh.triangles.len();
        if place.face as usize >= faces {
            return Err(CurveError::NoSuchFace { face: place.face, faces }.into());
        }
        let p = place.position(self.mesh);
        let near = self.network.corners.iter().enumerate().map(|(k, c)| (c.place.position(self.mesh).distance(p), k));
        if let Some((_, k)) = near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).filter(|x| x.0 <= snap) {
            return Ok(k as u32);
        }
        if let Some(on) = self.nearest_on_curves(p, snap) {
            return self.split_at(on.curve, on.at);
        }
        self.network.corners.push(Corner { place });
        Ok(self.network.corners.len() as u32 - 1)
    }

    /// Adds a curve. Its ends go to corners or curves within `snap` (world units), else new corners are made; a
    /// closed curve gets one corner at its start. Returns its number.
    /// # Errors
    /// `Curve` if it does not lie on the mesh.
    pub fn add_curve(&mut self, curve: &SurfaceCurve, kind: CurveKind, snap: f64) -> Result<u32, EditError> {
        let chain = curve.trace(self.mesh, self.adjacency)?;
        let first = self.add_corner(chain[0], snap)?;
        let last = if curve.closed { first } else { self.add_corner(chain[chain.len() - 1], snap)? };
        self.push_between([first, last], &chain, kind)
    }

    /// Adds a curve between two corners along a chain from about one to about the other.
    pub(crate) fn push_between(
        &mut self,
        corners: [u32; 2],
        chain: &[FacePoint],
        kind: CurveKind,
    ) -> Result<u32, EditError> {
        let ends = corners.map(|k| self.network.corners[k as usize].place);
        let mut places = vec![ends[0]];
        // The piece within the snap distance of an end gives way to the straight way to the corner.
        let at: Vec<DVec3> = chain.iter().map(|p| p.position(self.mesh)).collect();
        let tops = ends.map(|p| p.position(self.mesh));
        let moved = [tops[0].distance(at[0]), tops[1].distance(at[at.len() - 1])];
        let inner =
            (1..chain.len() - 1).filter(|&i| at[i].distance(tops[0]) > moved[0] && at[i].distance(tops[1]) > moved[1]);
        places.extend(inner.map(|i| chain[i]));
        places.push(ends[1]);
        let points = SurfaceCurve::open(places).trace(self.mesh, self.adjacency)?;
        self.network.curves.push(Curve { corners, kind, points });
        Ok(self.network.curves.len() as u32 - 1)
    }

    /// Splits a curve at `share` of its length; returns the new corner. The second part is the last curve.
    /// # Errors
    /// `NoSuchPart`, `AtEnd`.
    pub fn split_curve(&mut self, curve: u32, share: f64) -> Result<u32, EditError> {
        self.curve(curve)?;
        if !(share > 0.0 && share < 1.0) {
            return Err(EditError::AtEnd { curve });
        }
        let at = self.positions(curve);
        let length = polyline::length(at.iter().copied());
        let place = move_point_on_curve(&at, false, CurvePlace { segment: 0, share: 0.0 }, share * length);
        self.split_at(curve, place)
    }

    pub(crate) fn split_at(&mut self, curve: u32, at: CurvePlace) -> Result<u32, EditError> {
        let points = &self.network.curves[curve as usize].points;
        let last = points.len() - 1;
        let CurvePlace { segment, share } = at;
        if (segment == 0 && share <= 0.0) || (segment + 1 >= last + (share < 1.0) as usize && share >= 1.0) {
            return Err(EditError::AtEnd { curve });
        }
        let (mut head, mut tail) = (points[..=segment].to_vec(), points[segment + 1..].to_vec());
        let place = if share <= 0.0 {
            points[segment]
        } else if share >= 1.0 {
            points[segment + 1]
        } else {
            crate::curve::between(self.mesh, self.adjacency, &points[segment], &points[segment + 1], share)
        };
        if head[head.len() - 1] != place {
            head.push(place);
        }
        if tail[0] != place {
            tail.insert(0, place);
        }
        Ok(self.part_curve(curve, place, head, tail))
    }

    /// Puts a corner between the two parts of a curve; the second part becomes the last curve. Returns the corner.
    fn part_curve(&mut self, curve: u32, place: FacePoint, head: Vec<FacePoint>, tail: Vec<FacePoint>) -> u32 {
        let corner = self.network.corners.len() as u32;
        self.network.corners.push(Corner { place });
        let old = &mut self.network.curves[curve as usize];
        let second = Curve { corners: [corner, old.corners[1]], kind: old.kind, points: tail };
        (old.points, old.corners[1]) = (head, corner);
        self.network.curves.push(second);
        corner
    }

    /// Joins the two curves at a corner into one and takes the corner away. Returns the curve.
    /// # Errors
    /// `NoSuchPart`, `NotBetweenTwo`.
    pub fn join(&mut self, corner: u32) -> Result<u32, EditError> {
        self.corner(corner)?;
        let ends = self.ends_at(corner);
        let [a, b] = ends[..] else { return Err(EditError::NotBetweenTwo { corner, curves: ends.len() }) };
        if a / 2 == b / 2 {
            return Err(EditError::NotBetweenTwo { corner, curves: 1 });
        }
        let mut first = self.network.curves[a as usize / 2].clone();
        if a % 2 == 0 {
            first.points.reverse();
            first.corners.reverse();
        }
        let mut second = self.network.curves[b as usize / 2].clone();
        if b % 2 == 1 {
            second.points.reverse();
            second.corners.reverse();
        }
        first.points.extend_from_slice(&second.points[1..]);
        first.corners[1] = second.corners[1];
        if second.kind.is_smooth() && first.kind != CurveKind::Rounded {
            first.kind = second.kind;
        }
        let kept = (a / 2).min(b / 2);
        self.network.curves[kept as usize] = first;
        self.remove_curve((a / 2).max(b / 2));
        self.remove_corner(corner);
        Ok(kept)
    }

    /// Deletes a curve; corners that are left without curves go with it.
    /// # Errors
    /// `NoSuchPart`.
    pub fn delete_curve(&mut self, curve: u32) -> Result<(), EditError> {
        let [a, b] = self.curve(curve)?.corners;
        self.remove_curve(curve);
        for k in [a.max(b), a.min(b)] {
            if self.ends_at(k).is_empty() && (k as usize) < self.network.corners.len() {
                self.remove_corner(k);
            }
            if a == b {
                break;
            }
        }
        Ok(())
    }

    /// Deletes a corner: one without curves, or one between two, which are joined.
    /// # Errors
    /// `NoSuchPart`, `InUse`.
    pub fn delete_corner(&mut self, corner: u32) -> Result<(), EditError> {
        self.corner(corner)?;
        let curves = self.ends_at(corner).len();
        match curves {
            0 => self.remove_corner(corner),
            2 => {
                self.join(corner)?;
            }
            _ => return Err(EditError::InUse { corner, curves }),
        }
        Ok(())
    }

    fn remove_curve(&mut self, curve: u32) {
        self.network.curves.remove(curve as usize);
        self.network.patches.clear();
    }

    fn remove_corner(&mut self, corner: u32) {
        self.network.corners.remove(corner as usize);
        for k in self.network.curves.iter_mut().flat_map(|c| &mut c.corners) {
            if *k > corner {
                *k -= 1;
            }
        }
    }

    /// A curve that is free to move.
    pub(crate) fn movable(&self, curve: u32) -> Result<&Curve, EditError> {
        let found = self.curve(curve)?;
        match found.kind {
            CurveKind::Smooth | CurveKind::Rounded => Ok(found),
            CurveKind::Feature => Err(EditError::Bound { curve, line: "a sharp edge" }),
            CurveKind::Boundary => Err(EditError::Bound { curve, line: "the boundary of the mesh" }),
        }
    }

    /// Adds the boundaries of the mesh as curves where none runs along them: one corner each, more where curves end.
    /// # Errors
    /// `Curve`.
    pub fn add_boundaries(&mut self) -> Result<Vec<u32>, EditError> {
        let mut added = Vec::new();
        for one in crate::mesh::boundary_loops(self.adjacency) {
            let on: std::collections::BTreeSet<u32> = one.iter().map(|&h| self.mesh.origin(h)).collect();
            let vertex =
                |p: &FacePoint| (0..3).find(|&k| p.bary[k] == 1.0).map(|k| self.mesh.triangles[p.face as usize][k]);
            let covered = self.network.curves.iter().any(|c| {
                c.points.windows(2).any(|w| {
                    matches!((vertex(&w[0]), vertex(&w[1])), (Some(a), Some(b)) if on.contains(&a) && on.contains(&b))
                })
            });
            if covered {
                continue;
            }
            // Corners that lie on the loop, at vertices or between.
            let mut stops: Vec<(usize, f64, u32)> = Vec::new();
            for (k, corner) in self.network.corners.iter().enumerate() {
                let p = corner.place;
                for (i, &h) in one.iter().enumerate() {
                    let (a, b) = (h as usize % 3, next(h) as usize % 3);
                    let o = self.adjacency.opposite[h as usize];
                    if p.face == h / 3 && o == NONE && p.bary[3 - a - b] == 0.0 && p.bary[a] > 0.0 {
                        stops.push((i, p.bary[b], k as u32));
                    } else if vertex(&p) == Some(self.mesh.origin(h)) && p.face != h / 3 {
                        stops.push((i, 0.0, k as u32));
                    }
                }
            }
            stops.sort_by(|x, y| x.0.cmp(&y.0).then(x.1.total_cmp(&y.1)));
            stops.dedup_by_key(|s| s.2);
            let corner = |h: u32| FacePoint::corner(h / 3, h as usize % 3);
            if stops.is_empty() {
                self.network.corners.push(Corner { place: corner(one[0]) });
                stops.push((0, 0.0, self.network.corners.len() as u32 - 1));
            }
            for (k, &(i, _, from)) in stops.iter().enumerate() {
                let (j, _, to) = stops[(k + 1) % stops.len()];
                let mut points = vec![self.network.corners[from as usize].place];
                let n = one.len();
                let span = if stops.len() == 1 { n } else { (j + n - i) % n };
                points.extend((1..=span).map(|s| corner(one[(i + s) % n])));
                let end = self.network.corners[to as usize].place;
                if points.len() > 1 && points[points.len() - 1].position(self.mesh) == end.position(self.mesh) {
                    points.pop();
                }
                points.push(end);
                self.network.curves.push(Curve { corners: [from, to], kind: CurveKind::Boundary, points });
                added.push(self.network.curves.len() as u32 - 1);
            }
        }
        Ok(added)
    }

    /// Tells at a glance what is not in order, from the curves alone ([`glance`]).
    pub fn glance(&self) -> Diagnosis {
        glance(self.mesh, self.adjacency, &self.network)
    }

    /// Looks at the whole mesh and takes the patches found ([`diagnose`]).
    pub fn diagnose(&mut self) -> Diagnosis {
        let found = diagnose(self.mesh, self.adjacency, &self.network);
        self.network.patches = found.patches.clone();
        found
    }
}

/// The place of every piece of a chain that is nearest to `p`: number of the piece, share of it, and distance.
pub(crate) fn feet(chain: &[DVec3], p: DVec3) -> impl Iterator<Item = (usize, f64, f64)> {
    chain.windows(2).enumerate().map(move |(k, w)| {
        let d = w[1] - w[0];
        let square = d.length_squared();
        let share = if square > 0.0 { ((p - w[0]).dot(d) / square).clamp(0.0, 1.0) } else { 0.0 };
        (k, share, p.distance(w[0] + d * share))
    })
}
