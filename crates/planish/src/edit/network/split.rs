//! Regions of three, five and six sides split into four-sided patches, and the rest of a network completed.
//!
//! A split is drawn in a one-to-one map of the region to a disk with strictly convex boundary, where straight lines
//! between boundary points lie inside and cross at most once: new curves can neither leave the region nor touch its
//! sides. Where a split puts a corner into the side of a neighbour of four sides, the split goes on through that
//! neighbour to its opposite side, and so on, until it ends in another split region or at the boundary.
//!
//! See `docs/methods/curves.md`, "Regions" and "Completing"; the convex map is that of
//! `docs/decisions/0005-spade-and-convex-maps.md`.

use super::{EditError, Editor};
use crate::curve::without_repeats;
use crate::layout::{Known, LayoutParams, layout, most_patches};
use crate::mesh::{Adjacency, FacePoint, NONE, next};
use crate::network::diagnose::{Regions, regions};
use crate::network::disk::{Disk, Met};
use crate::network::{Corner, Curve, CurveKind, ImprintError, Network};
use crate::observe::Observer;
use glam::DVec3;
use std::f64::consts::TAU;

/// Layouts tried around the curves of a network until the mesh can hold one, ...
const COMPLETIONS: usize = 3;
/// ... each with this part more of the patches asked for.
const OTHER_PATCHES: usize = 8;

/// Patches that one split may run through: more than any chord of a network has.
const LONGEST_CHORD: usize = 10_000;

impl Editor<'_> {
    /// Splits region `region` (numbered as by [`crate::network::diagnose()`]) of three, five or six sides into four-sided
    /// patches. `from` turns the split: the side that is divided of five, a corner that the new curve starts in of six;
    /// without it the new curve starts in the flattest corner. Neighbours of four sides that get a corner into a side
    /// are split across. Returns the number of curves added.
    /// # Errors
    /// `NoSuchPart`, `NoSplit` for other regions, `Imprint` if the curves are not in order.
    pub fn split_region(&mut self, region: u32, from: Option<usize>) -> Result<usize, EditError> {
        let found = regions(self.mesh, self.adjacency, &self.network)?;
        let bounded: Vec<usize> = (0..found.parts.len()).filter(|&r| !found.parts[r].0.is_empty()).collect();
        let count = bounded.len();
        let &part =
            bounded.get(region as usize).ok_or(EditError::NoSuchPart { what: "region", index: region, count })?;
        let sides = found.parts[part].0.iter().map(Vec::len).sum();
        if found.parts[part].0.len() != 1 || found.open[part] || !matches!(sides, 3 | 5 | 6) {
            return Err(EditError::NoSplit { region, sides });
        }
        let whole = self.network.clone();
        let before = self.network.curves.len();
        let result = self.split_part(&found, part, from).and_then(|corners| self.split_on(corners));
        if let Err(e) = result {
            self.network = whole;
            return Err(e);
        }
        Ok(self.network.curves.len() - before)
    }

    /// Number of the region with curves around it that a place lies in, as [`crate::network::diagnose()`] numbers them.
    /// # Errors
    /// `Imprint` if the curves are not in order, `NoRegion` in a part of the mesh without curves.
    pub fn region_at(&self, place: &FacePoint) -> Result<u32, EditError> {
        let found = regions(self.mesh, self.adjacency, &self.network)?;
        let p = place.position(self.mesh);
        let cut = &found.drawn.cut;
        let away = |f: u32| (cut.mesh.corners(f as usize).into_iter().sum::<DVec3>() / 3.0).distance(p);
        let bounded: Vec<&Vec<u32>> = found.parts.iter().filter(|p| !p.0.is_empty()).map(|p| &p.1).collect();
        let near = bounded.iter().enumerate().flat_map(|(k, faces)| {
            faces.iter().filter(|&&f| cut.parent[f as usize] == place.face).map(move |&f| (away(f), k as u32))
        });
        let found = near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|x| x.1);
        found.ok_or(EditError::NoRegion { place: p })
    }

    /// Splits one region; returns the corners put into its sides.
    fn split_part(&mut self, found: &Regions, part: usize, from: Option<usize>) -> Result<Vec<u32>, EditError> {
        let canvas = Flat::new(found, part).ok_or(EditError::NoSplit { region: part as u32, sides: 0 })?;
        let n = canvas.starts.len();
        let mut lines: Vec<(u32, u32)> = Vec::new();
        let mut middles: Vec<usize> = Vec::new();
        let corner = |k: usize| canvas.disk.boundary[canvas.starts[k % n]];
        match n {
            3 => {
                middles = vec![0, 1, 2];
                let center = canvas.center();
                lines.extend((0..3).map(|k| (canvas.middle(k), center)));
            }
            5 => {
                // The side across from the flattest corner.
                let flattest = (0..5).max_by(|&i, &j| canvas.flatness(found, i).total_cmp(&canvas.flatness(found, j)));
                let k = from.unwrap_or(flattest.unwrap_or(0) + 2) % 5;
                middles = vec![k];
                lines.push((canvas.middle(k), corner(k + 3)));
            }
            _ => {
                let both = |i: usize| canvas.flatness(found, i) + canvas.flatness(found, i + 3);
                let flattest = (0..3).max_by(|&i, &j| both(i).total_cmp(&both(j)));
                let k = from.unwrap_or(flattest.unwrap_or(0)) % 3;
                lines.push((corner(k), corner(k + 3)));
            }
        }
        let drawn: Option<Vec<Vec<FacePoint>>> = lines.iter().map(|&(a, b)| canvas.line(self, found, a, b)).collect();
        let drawn = drawn.ok_or(EditError::NoSplit { region: part as u32, sides: n })?;
        // Corners into the sides: by place, since splitting renumbers the points of curves.
        let mut added = Vec::new();
        for &k in &middles {
            let half = found.parts[part].0[0][k];
            let place = canvas.place(self, found, canvas.middle(k));
            added.push(self.split_curve_at_place(half / 2, place)?);
        }
        for points in drawn {
            let ends = [points[0], points[points.len() - 1]].map(|p| self.corner_at(p));
            self.push_line(ends, points);
        }
        Ok(added)
    }

    /// Carries on from corners in sides of four-sided regions to the opposite sides.
    fn split_on(&mut self, corners: Vec<u32>) -> Result<(), EditError> {
        let mut waiting = corners;
        for _ in 0..LONGEST_CHORD {
            let Some(corner) = waiting.pop() else { break };
            let found = regions(self.mesh, self.adjacency, &self.network)?;
            // The region that has the corner between two pieces of a side.
            let ends = self.ends_at(corner);
            let meets = |half: u32, end: u32| ends.contains(&(half ^ end));
            let seat = (0..found.parts.len()).find_map(|r| {
                let loops = &found.parts[r].0;
                let n = loops.first().map_or(0, Vec::len);
                if loops.len() != 1 || found.open[r] || !matches!(n, 5 | 6) || ends.len() != 3 {
                    return None;
                }
                let one = &loops[0];
                (0..n).find(|&k| meets(one[k], 1) && meets(one[(k + 1) % n], 0)).map(|k| (r, (k + 1) % n))
            });
            let Some((part, k)) = seat else { continue };
            let one = &found.parts[part].0[0];
            let n = one.len();
            let no_split = EditError::NoSplit { region: part as u32, sides: n };
            let canvas = Flat::new(&found, part).ok_or(no_split.clone())?;
            let a = canvas.disk.boundary[canvas.starts[k]];
            // Of five sides to the middle of the side across, of six to the corner across, which a split before has
            // put there.
            let b = if n == 5 { canvas.middle((k + 2) % 5) } else { canvas.disk.boundary[canvas.starts[(k + 3) % 6]] };
            let points = canvas.line(self, &found, a, b).ok_or(no_split)?;
            let (first, last) = (points[0], points[points.len() - 1]);
            let end = if n == 5 {
                let divided = self.split_curve_at_place(one[(k + 2) % 5] / 2, last)?;
                waiting.push(divided);
                divided
            } else {
                self.corner_at(last)
            };
            let start = self.corner_at(first);
            self.push_line([start, end], points);
        }
        Ok(())
    }

    /// Adds a new curve whose ends are the places of its corners, to the bit: those of the line have gone through the
    /// cut mesh and back.
    fn push_line(&mut self, corners: [u32; 2], mut points: Vec<FacePoint>) {
        let last = points.len() - 1;
        points[0] = self.network.corners[corners[0] as usize].place;
        points[last] = self.network.corners[corners[1] as usize].place;
        self.network.curves.push(Curve { corners, kind: CurveKind::Smooth, points });
    }

    /// Splits a curve at the point of it that lies at `place`.
    fn split_curve_at_place(&mut self, curve: u32, place: FacePoint) -> Result<u32, EditError> {
        let p = place.position(self.mesh);
        let points = &self.network.curves[curve as usize].points;
        let nearest = (1..points.len().saturating_sub(1)).min_by(|&i, &j| {
            let d = |k: usize| points[k].position(self.mesh).distance(p);
            d(i).total_cmp(&d(j))
        });
        let k = nearest.ok_or(EditError::AtEnd { curve })?;
        let place = points[k];
        let (head, tail) = (points[..=k].to_vec(), points[k..].to_vec());
        Ok(self.part_curve(curve, place, head, tail))
    }

    /// The corner nearest to a place, or a new one if none lies there.
    fn corner_at(&mut self, place: FacePoint) -> u32 {
        let p = place.position(self.mesh);
        let near = self.network.corners.iter().enumerate().map(|(k, c)| (c.place.position(self.mesh).distance(p), k));
        let limit = crate::geom::tolerance::length(self.mesh.bounds().diagonal());
        match near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))) {
            Some((d, k)) if d <= limit => k as u32,
            _ => {
                self.network.corners.push(Corner { place });
                self.network.corners.len() as u32 - 1
            }
        }
    }

    /// Lays out everything that the curves do not part into patches yet. The curves stay where they are, bit for bit
    /// where they are not divided; new corners may come to lie on them. No curves of the result cross.
    /// # Errors
    /// `Imprint` if curves cross, `Layout` if there is no layout around them, `Entangled` if there is none that the
    /// mesh can hold.
    pub fn complete(&mut self, params: &LayoutParams, observer: &dyn Observer) -> Result<(), EditError> {
        let found = regions(self.mesh, self.adjacency, &self.network)?;
        let asked = params.patches.min(most_patches(self.mesh));
        let mut wrong = None;
        for attempt in 0..COMPLETIONS {
            // With other numbers of patches curves run elsewhere.
            let patches = asked + attempt * asked.div_ceil(OTHER_PATCHES);
            let network = self.completed(&found, &LayoutParams { patches, ..params.clone() }, observer)?;
            match regions(self.mesh, self.adjacency, &network) {
                Ok(_) => {
                    self.network = network;
                    return Ok(());
                }
                Err(e) => wrong = wrong.or(Some(e)),
            }
        }
        match wrong {
            Some(ImprintError::Crossing { x, y, z, .. } | ImprintError::Jump { x, y, z, .. }) => {
                Err(EditError::Entangled { place: DVec3::new(x, y, z) })
            }
            Some(other) => Err(other.into()),
            None => Ok(()),
        }
    }

    /// The network with everything laid out that the curves do not part into patches yet.
    fn completed(&self, found: &Regions, params: &LayoutParams, observer: &dyn Observer) -> Result<Network, EditError> {
        let drawn = &found.drawn;
        let mut corner = vec![false; drawn.cut.mesh.points.len()];
        for (curve, chain) in self.network.curves.iter().zip(&drawn.cut.chains) {
            debug_assert_eq!(curve.points.len(), chain.len());
            for &v in [chain.first(), chain.last()].into_iter().flatten() {
                corner[v as usize] = true;
            }
        }
        let mut kind = vec![None; drawn.barrier.len()];
        for (half, edges) in drawn.halves.iter().enumerate() {
            for &h in edges.iter().filter(|&&h| h != NONE) {
                kind[h as usize] = Some(self.network.curves[half / 2].kind);
            }
        }
        let known = Known { lines: &drawn.barrier, corners: &corner, ..Known::default() };
        let laid = layout(&drawn.cut.mesh, known, params, None, observer)?.network;
        let triangles = &drawn.cut.mesh.triangles;
        let to_input = |p: &FacePoint| drawn.cut.to_uncut(self.adjacency, &self.mesh.triangles, p.face, p.bary);
        let mut network = Network { patches: laid.patches.clone(), ..Network::default() };
        network.corners = laid.corners.iter().map(|c| Corner { place: to_input(&c.place) }).collect();
        for curve in &laid.curves {
            // A curve along a user's line keeps the user's kind: lines of smooth curves are not sharp.
            let user = curve.points.windows(2).find_map(|w| line_of(triangles, &drawn.adjacency, &kind, w));
            network.curves.push(Curve {
                corners: curve.corners,
                kind: user.unwrap_or(curve.kind),
                points: curve.points.iter().map(to_input).collect(),
            });
        }
        Ok(network)
    }
}

/// What the edge with both places is part of, if they lie on one edge that is marked.
fn line_of(
    triangles: &[[u32; 3]],
    adjacency: &Adjacency,
    kind: &[Option<CurveKind>],
    pair: &[FacePoint],
) -> Option<CurveKind> {
    let place = |p: &FacePoint| crate::network::imprint::place_of(adjacency, triangles, p);
    let (a, b) = (place(&pair[0]), place(&pair[1]));
    let face = match crate::network::imprint::shared_face(adjacency, triangles, &a, &b)? {
        crate::network::imprint::Shared::Edge => {
            let around = [pair[0].face, pair[1].face].into_iter().chain(match a {
                crate::network::imprint::Place::Vertex(v) => adjacency.fan(v).map(|h| h / 3).collect::<Vec<_>>(),
                _ => Vec::new(),
            });
            around.into_iter().find(|&f| [a, b].iter().all(|p| p.on_face(adjacency, triangles, f).is_some()))?
        }
        crate::network::imprint::Shared::Face(_) => return None,
    };
    let on = [a, b].map(|p| p.on_face(adjacency, triangles, face));
    let zero = (0..3).find(|&k| on.iter().flatten().all(|p| p.bary[k] == 0.0))?;
    kind[3 * face as usize + (zero + 1) % 3]
}

/// A region as a disk with its map.
struct Flat {
    disk: Disk,
    uv: Vec<glam::DVec2>,
    /// Index in the boundary of the disk at which each side starts.
    starts: Vec<usize>,
}

impl Flat {
    fn new(found: &Regions, part: usize) -> Option<Flat> {
        let (loops, faces) = &found.parts[part];
        let drawn = &found.drawn;
        let one = &loops[0];
        let start = drawn.halves[one[0] as usize][0];
        let barrier = |h: u32| drawn.barrier[h as usize];
        let disk = Disk::new(&drawn.cut.mesh.triangles, &drawn.adjacency, faces, barrier, start)?;
        let counts: Vec<usize> = one.iter().map(|&h| drawn.halves[h as usize].len()).collect();
        if counts.iter().sum::<usize>() != disk.boundary.len() {
            return None;
        }
        let mut starts = Vec::with_capacity(one.len());
        let mut angles = Vec::with_capacity(disk.boundary.len());
        let side = TAU / one.len() as f64;
        for (k, &count) in counts.iter().enumerate() {
            starts.push(angles.len());
            let at = |i: usize| {
                let i = (starts[k] + i) % disk.boundary.len();
                drawn.cut.mesh.points[disk.vertices[disk.boundary[i] as usize] as usize]
            };
            let mut sums = vec![0.0];
            for i in 0..count {
                // Never nothing, so that the boundary stays strictly convex.
                let length = at(i).distance(at(i + 1)).max(f64::MIN_POSITIVE);
                sums.push(sums[i] + length);
            }
            let total = sums[count];
            angles.extend((0..count).map(|i| side * (k as f64 + sums[i] / total)));
        }
        let uv = disk.circle_map(&drawn.cut.mesh.points, &angles)?;
        Some(Flat { disk, uv, starts })
    }

    /// The inner boundary vertex nearest to the middle of a side.
    fn middle(&self, k: usize) -> u32 {
        let n = self.starts.len();
        let (first, last) = (self.starts[k], self.starts.get(k + 1).copied().unwrap_or(self.disk.boundary.len()));
        let angle = TAU * (k as f64 + 0.5) / n as f64;
        let goal = glam::DVec2::from_angle(angle);
        let inner = (first + 1).min(last - 1)..last;
        let vertex = |i: usize| self.disk.boundary[i];
        let best = inner.min_by(|&i, &j| {
            let d = |i: usize| self.uv[vertex(i) as usize].distance(goal);
            d(i).total_cmp(&d(j))
        });
        vertex(best.unwrap_or(first))
    }

    /// How straight the boundary runs on at corner `k`: -1 for a spike, 1 for no corner at all.
    fn flatness(&self, found: &Regions, k: usize) -> f64 {
        let n = self.disk.boundary.len();
        let at = |i: usize| {
            let v = self.disk.vertices[self.disk.boundary[i % n] as usize];
            found.drawn.cut.mesh.points[v as usize]
        };
        let i = self.starts[k % self.starts.len()] + n;
        let (before, after) = ((at(i) - at(i - 1)).normalize_or_zero(), (at(i + 1) - at(i)).normalize_or_zero());
        before.dot(after)
    }

    /// The inner vertex nearest to the middle of the map.
    fn center(&self) -> u32 {
        let rim: std::collections::BTreeSet<u32> = self.disk.boundary.iter().copied().collect();
        let inner = (0..self.uv.len() as u32).filter(|v| !rim.contains(v));
        let best = inner
            .min_by(|&i, &j| self.uv[i as usize].length().total_cmp(&self.uv[j as usize].length()).then(i.cmp(&j)));
        best.unwrap_or(0)
    }

    /// A vertex of the disk as a place of the input.
    fn place(&self, editor: &Editor, found: &Regions, v: u32) -> FacePoint {
        let drawn = &found.drawn;
        let h = self.disk.adjacency.outgoing[v as usize];
        let face = self.disk.faces[h as usize / 3];
        let mut bary = [0.0; 3];
        bary[h as usize % 3] = 1.0;
        drawn.cut.to_uncut(editor.adjacency, &editor.mesh.triangles, face, bary)
    }

    /// The straight line of the map between two vertices, as places of the input; neighbours share a face.
    fn line(&self, editor: &Editor, found: &Regions, a: u32, b: u32) -> Option<Vec<FacePoint>> {
        let met = self.disk.straight(&self.uv, a, b)?;
        let mut points = vec![self.place(editor, found, a)];
        for m in met {
            points.push(match m {
                Met::Vertex(v) => self.place(editor, found, v),
                Met::Edge(p, q, t) => {
                    let h = self.disk.adjacency.fan(p).find(|&h| self.disk.from(next(h)) == q);
                    let (h, forward) = match h {
                        Some(h) => (h, true),
                        None => (self.disk.adjacency.fan(q).find(|&h| self.disk.from(next(h)) == p)?, false),
                    };
                    let mut bary = [0.0; 3];
                    let (i, j) = (h as usize % 3, next(h) as usize % 3);
                    (bary[i], bary[j]) = if forward { (1.0 - t, t) } else { (t, 1.0 - t) };
                    let face = self.disk.faces[h as usize / 3];
                    found.drawn.cut.to_uncut(editor.adjacency, &editor.mesh.triangles, face, bary)
                }
            });
        }
        points.push(self.place(editor, found, b));
        // A line that grazes a vertex crosses several edges there within rounding.
        without_repeats(editor.mesh, &mut points);
        (points.len() > 1).then_some(points)
    }
}
