//! Curves drawn across others: corners divide both where they meet.
//!
//! Both are chains whose neighbours share a face, so they meet where two pieces in one face do, or in a vertex that both
//! pass. What is met within the snap distance of a corner goes through that corner.
//!
//! See `docs/methods/curves.md`, "Meetings".

use super::{EditError, Editor};
use crate::curve::{CurveError, SurfaceCurve, between};
use crate::mesh::FacePoint;
use crate::network::CurveKind;
use crate::network::imprint::{self, Place};
use glam::DVec2;
use std::collections::BTreeMap;

/// Pieces meet up to this share beyond their ends: rounding, where they touch in an end.
const BEYOND: f64 = 1e-9;
/// Sine of the angle below which two pieces count as parallel: their crossing would be noise.
const PARALLEL: f64 = 1e-9;
/// A piece between two meetings at one corner, shorter than this many snap distances, is left out: the curve only
/// brushes past the corner.
const BRUSH: f64 = 4.0;

/// Places nearer than this share of the diagonal are one: a meeting is found on both sides of an edge, by other roundings.
const TINY: f64 = 1e-9;

/// A meeting of a new chain with a curve: where on the chain, as piece and share of it, and the place.
#[derive(Clone, Copy, Debug)]
struct Meeting {
    at: f64,
    place: FacePoint,
}

/// A corner on the new chain: where the piece before ends and where the next one starts.
struct Stop {
    corner: u32,
    enter: f64,
    leave: f64,
}

impl Editor<'_> {
    /// As [`Editor::add_curve`]; where the curve crosses or touches others, corners divide both, and where it runs along
    /// the edges of another it is left out. A closed curve that meets others starts at a meeting. Returns the new curves
    /// in their order along it.
    /// # Errors
    /// `Curve` if it does not lie on the mesh or has no length.
    pub fn draw_curve(&mut self, curve: &SurfaceCurve, kind: CurveKind, snap: f64) -> Result<Vec<u32>, EditError> {
        let mut chain = curve.trace(self.mesh, self.adjacency)?;
        let tiny = TINY * self.mesh.bounds().diagonal();
        if SurfaceCurve::open(chain.clone()).length(self.mesh) <= tiny {
            return Err(CurveError::TooFewPoints { found: 1, needed: 2 }.into());
        }
        let met = self.meetings(&chain);
        if met.is_empty() {
            self.add_curve(curve, kind, snap)?;
            return self.divided(snap);
        }
        let last = chain.len() - 1;
        if self.shared(&chain).iter().all(|&s| s) {
            return Ok(Vec::new());
        }
        let (start, end) = if curve.closed {
            // Not within a stretch that another curve runs along.
            let shared = self.shared(&chain);
            let is_start = |m: &&Meeting| !shared[(m.at as usize).min(last - 1)];
            let first = *met.iter().find(is_start).unwrap_or(&met[0]);
            let k = first.at as usize;
            let mut turned = vec![first.place];
            turned.extend_from_slice(&chain[k + 1..]);
            turned.extend_from_slice(&chain[1..=k]);
            turned.push(first.place);
            chain = turned;
            let corner = self.corner_on(first.place, tiny);
            (corner, corner)
        } else {
            (self.add_corner(chain[0], snap)?, self.add_corner(chain[last], snap)?)
        };
        let at: Vec<_> = chain.iter().map(|p| p.position(self.mesh)).collect();
        let mut sums = vec![0.0];
        for w in at.windows(2) {
            sums.push(sums[sums.len() - 1] + w[0].distance(w[1]));
        }
        let along = |x: f64| {
            let k = (x as usize).min(sums.len() - 2);
            sums[k] + (x - k as f64) * (sums[k + 1] - sums[k])
        };
        let short = BRUSH * snap + tiny;
        let shared = self.shared(&chain);
        // True between two pieces that others run along.
        let inside = |x: f64| {
            let k = x as usize;
            let before = if x > k as f64 { shared.get(k) } else { k.checked_sub(1).and_then(|k| shared.get(k)) };
            before == Some(&true) && shared.get(k) == Some(&true)
        };
        let mut stops = vec![Stop { corner: start, enter: 0.0, leave: 0.0 }];
        for meeting in self.meetings(&chain).into_iter().filter(|m| !inside(m.at)) {
            let corner = self.corner_on(meeting.place, snap.max(tiny));
            let before = &mut stops[..];
            match before.last_mut() {
                Some(s) if s.corner == corner && along(meeting.at) - along(s.leave) <= short => s.leave = meeting.at,
                _ => stops.push(Stop { corner, enter: meeting.at, leave: meeting.at }),
            }
        }
        let whole = (chain.len() - 1) as f64;
        match stops.last() {
            Some(s) if stops.len() > 1 && s.corner == end && along(whole) - along(s.leave) <= short => {}
            _ => stops.push(Stop { corner: end, enter: whole, leave: whole }),
        }
        let mut added = Vec::with_capacity(stops.len() - 1);
        for pair in stops.windows(2) {
            let (from, to) = (pair[0].leave, pair[1].enter);
            // A stretch that another curve runs along is there already.
            if (from as usize..to.ceil() as usize).all(|k| shared.get(k) == Some(&true)) {
                continue;
            }
            let place = |x: f64| {
                let k = (x as usize).min(chain.len() - 2);
                between(self.mesh, self.adjacency, &chain[k], &chain[k + 1], x - k as f64)
            };
            let mut piece = vec![place(from)];
            piece.extend((0..chain.len()).filter(|&k| (k as f64) > from && (k as f64) < to).map(|k| chain[k]));
            piece.push(place(to));
            self.push_between([pair[0].corner, pair[1].corner], &piece, kind)?;
            added.extend(self.divided(snap)?);
        }
        Ok(added)
    }

    /// Divides the last curve where its ways to corners within the snap distance cross what the chain itself does not.
    fn divided(&mut self, snap: f64) -> Result<Vec<u32>, EditError> {
        let last = self.network.curves.len() - 1;
        let Some(curve) = self.network.curves.pop() else { return Ok(Vec::new()) };
        let tiny = TINY * self.mesh.bounds().diagonal();
        let ends = curve.corners.map(|k| self.network.corners[k as usize].place.position(self.mesh));
        let is_inside = |m: &Meeting| ends.iter().all(|e| e.distance(m.place.position(self.mesh)) > tiny);
        if snap > 0.0 && self.meetings(&curve.points).iter().any(is_inside) {
            return self.draw_curve(&SurfaceCurve::open(curve.points), curve.kind, 0.0);
        }
        self.network.curves.push(curve);
        Ok(vec![last as u32])
    }

    /// For each piece of a chain whether it runs along an edge of the mesh that curves run along from end to end.
    fn shared(&self, chain: &[FacePoint]) -> Vec<bool> {
        let triangles = &self.mesh.triangles;
        let place = |p: &FacePoint| imprint::place_of(self.adjacency, triangles, p);
        // The edge that two places lie on, by its lower half-edge, and how much of it lies between them.
        let along = |pair: &[FacePoint]| -> Option<(u32, f64)> {
            let (a, b) = (place(&pair[0]), place(&pair[1]));
            match imprint::along_edge(self.adjacency, triangles, &a, &b, 0.5)? {
                Place::Edge(h, middle) => {
                    let start = match a {
                        Place::Edge(_, t) => t,
                        Place::Vertex(v) if v == self.mesh.origin(h) => 0.0,
                        _ => 1.0,
                    };
                    Some((h, 2.0 * (middle - start).abs()))
                }
                _ => None,
            }
        };
        let mut covered: BTreeMap<u32, f64> = BTreeMap::new();
        for (h, part) in self.network.curves.iter().flat_map(|c| c.points.windows(2)).filter_map(along) {
            *covered.entry(h).or_default() += part;
        }
        let whole = |h: u32| covered.get(&h).is_some_and(|&part| part > 1.0 - BEYOND);
        chain.windows(2).map(|pair| along(pair).is_some_and(|(h, _)| whole(h))).collect()
    }

    /// The corner within `reach` of a place on a curve, else a new one that divides the curve.
    fn corner_on(&mut self, place: FacePoint, reach: f64) -> u32 {
        let p = place.position(self.mesh);
        let near = self.network.corners.iter().enumerate().map(|(k, c)| (c.place.position(self.mesh).distance(p), k));
        let near = near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).filter(|x| x.0 <= reach);
        if let Some((_, k)) = near {
            return k as u32;
        }
        let divided = self.nearest_on_curves(p, reach).and_then(|on| self.split_at(on.curve, on.at).ok());
        divided.unwrap_or_else(|| {
            self.network.corners.push(crate::network::Corner { place });
            self.network.corners.len() as u32 - 1
        })
    }

    /// Where a chain meets the curves, in its order.
    fn meetings(&self, chain: &[FacePoint]) -> Vec<Meeting> {
        let (mesh, adjacency) = (self.mesh, self.adjacency);
        let place = |p: &FacePoint| imprint::place_of(adjacency, &mesh.triangles, p);
        let flat = |p: &Place, face: u32| {
            p.on_face(adjacency, &mesh.triangles, face).map(|p| DVec2::new(p.bary[1], p.bary[2]))
        };
        let own: Vec<Place> = chain.iter().map(place).collect();
        let mut in_face: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        let mut at_vertex: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (k, w) in own.windows(2).enumerate() {
            self.common_faces(&w[0], &w[1]).into_iter().for_each(|f| in_face.entry(f).or_default().push(k));
        }
        for (k, p) in own.iter().enumerate() {
            if let Place::Vertex(v) = *p {
                at_vertex.entry(v).or_default().push(k);
            }
        }
        let mut found = Vec::new();
        for curve in &self.network.curves {
            let places: Vec<Place> = curve.points.iter().map(place).collect();
            for (p, q) in places.iter().zip(&curve.points) {
                let Place::Vertex(v) = p else { continue };
                let here = at_vertex.get(v).into_iter().flatten();
                found.extend(here.map(|&k| Meeting { at: k as f64, place: *q }));
            }
            for (w, ends) in places.windows(2).zip(curve.points.windows(2)) {
                for face in self.common_faces(&w[0], &w[1]) {
                    let Some(pieces) = in_face.get(&face) else { continue };
                    let [Some(c), Some(d)] = [flat(&w[0], face), flat(&w[1], face)] else { continue };
                    for &k in pieces {
                        let [Some(a), Some(b)] = [flat(&own[k], face), flat(&own[k + 1], face)] else { continue };
                        if let Some([s, t]) = meet(a, b, c, d) {
                            let place = between(mesh, adjacency, &ends[0], &ends[1], t);
                            found.push(Meeting { at: k as f64 + s, place });
                        }
                    }
                }
            }
        }
        found.sort_by(|x, y| x.at.total_cmp(&y.at));
        found
    }

    /// The faces that two places both lie on: two where the way between them runs along an edge.
    fn common_faces(&self, a: &Place, b: &Place) -> Vec<u32> {
        let adjacency = self.adjacency;
        let on = |p: &Place, face: u32| p.on_face(adjacency, &self.mesh.triangles, face).is_some();
        a.faces(adjacency).into_iter().filter(|&f| on(b, f)).collect()
    }
}

/// Shares of two straight pieces where they meet; nothing for parallel ones.
fn meet(a: DVec2, b: DVec2, c: DVec2, d: DVec2) -> Option<[f64; 2]> {
    let (r, q, o) = (b - a, d - c, c - a);
    let sine = r.perp_dot(q);
    if sine.abs() <= PARALLEL * r.length() * q.length() {
        return None;
    }
    let shares = [o.perp_dot(q) / sine, o.perp_dot(r) / sine];
    let within = |x: &f64| (-BEYOND..=1.0 + BEYOND).contains(x);
    shares.iter().all(within).then(|| shares.map(|x| x.clamp(0.0, 1.0)))
}
