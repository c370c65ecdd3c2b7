//! Changes of the complex inside a few cells: their union, a disk, is mapped to a circle and cut again along
//! straight lines of the map. New arcs can therefore neither cross nor leave the union.
//!
//! Tutte, *How to Draw a Graph*, 1963; `docs/decisions/0005-spade-and-convex-maps.md`.

use super::complex::{Arc, Complex, Node};
use super::shape::{Shape, Trace};
use crate::mesh::disjoint::disjoint;
use crate::mesh::{Adjacency, NONE, TriMesh, next};
use crate::network::CurveKind;
use crate::network::disk::{Disk, Met};
use crate::network::imprint::{self, Cut, ImprintError, Place, along_edge, canonical, flood, half_edge};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// A new node is looked for within this radius of the unit circle, so that no cell is left a sliver.
const INNER_RADIUS: f64 = 0.85;

/// Curves that cross one edge keep at least this distance from each other and from its ends, as a fraction
/// of the edge (less where many cross).
const CROSSINGS_APART: f64 = 0.02;

/// A change inside the union of some cells.
#[derive(Clone, Debug, Default)]
pub(super) struct Change {
    /// Cells to replace; their union must be a disk.
    pub cells: Vec<u32>,
    /// Arcs inside the union, which go.
    pub removed: Vec<u32>,
    /// Straight lines between corners of the union (positions in its outline).
    pub lines: Vec<(usize, usize)>,
    /// Corners of the union joined to a new node inside.
    pub spokes: Vec<usize>,
    /// The node that the new one replaces, if any.
    pub center: Option<u32>,
    /// The vertex of the working mesh where the new node stands; in the middle, if none is given.
    pub pin: Option<u32>,
    /// The new node keeps its place from now on.
    pub stays: bool,
}

/// The complex cut into the working mesh.
pub(super) struct Embedding {
    pub cut: Cut,
    pub adjacency: Adjacency,
    /// For each half-edge of the cut mesh its half-arc.
    pub half_arc: Vec<u32>,
    /// First half-edge of each half-arc.
    first: Vec<u32>,
    /// Faces of each cell, sorted.
    pub members: Vec<Vec<u32>>,
}

/// The union of the cells of a change, mapped to the unit circle.
pub(super) struct Union {
    pub disk: Disk,
    /// Half-arcs around it.
    pub outline: Vec<u32>,
    /// Where each of them starts in the boundary of the disk.
    pub corners: Vec<usize>,
    pub uv: Vec<DVec2>,
}

/// What a change comes to, once drawn.
pub(super) struct Drawn {
    outline: Vec<u32>,
    lines: Vec<Vec<Place>>,
    spokes: Vec<Vec<Place>>,
    center: u32,
}

impl Embedding {
    /// Cuts the complex into the mesh and checks that every cell is where it should be.
    /// # Errors
    /// The arcs that may be at fault.
    pub fn new(mesh: &TriMesh, adjacency: &Adjacency, complex: &Complex) -> Result<Embedding, Vec<u32>> {
        let empty: &[Place] = &[];
        let curves: Vec<&[Place]> = complex.arcs.iter().map(|a| a.as_ref().map_or(empty, |a| &a.chain[..])).collect();
        let cut = imprint::cut(mesh, adjacency, &curves).map_err(|fault| match fault {
            ImprintError::Crossing { curves, .. } => curves.into_iter().map(|c| c as u32).collect(),
            ImprintError::Jump { curve, .. } => vec![curve as u32],
            _ => Vec::new(),
        })?;
        let cut_adjacency = Adjacency::new(&cut.mesh);
        let mut half_arc = vec![NONE; 3 * cut.mesh.triangles.len()];
        let mut first = vec![NONE; 2 * complex.arcs.len()];
        let mut seeds = Vec::new();
        for a in complex.live_arcs() {
            let chain = &cut.chains[a as usize];
            for (reversed, cell) in complex.arc(2 * a).cells.into_iter().enumerate() {
                if cell == NONE {
                    continue;
                }
                let half = 2 * a + reversed as u32;
                for i in 0..chain.len() - 1 {
                    let (x, y) = if reversed == 0 { (chain[i], chain[i + 1]) } else { (chain[i + 1], chain[i]) };
                    let h = half_edge(&cut.mesh.triangles, &cut_adjacency, x, y).ok_or_else(|| vec![a])?;
                    if half_arc[h as usize] != NONE {
                        return Err(vec![a, half_arc[h as usize] / 2]); // two arcs on one edge
                    }
                    half_arc[h as usize] = half;
                    seeds.push((h, cell));
                    if i == if reversed == 0 { 0 } else { chain.len() - 2 } {
                        first[half as usize] = h;
                    }
                }
            }
        }
        let barrier: Vec<bool> = half_arc.iter().map(|&a| a != NONE).collect();
        let around = |c: u32| complex.loop_of(c).iter().map(|h| h / 2).collect::<Vec<u32>>();
        let label = flood(&cut, &cut_adjacency, &barrier, &seeds)
            .map_err(|(a, b)| around(a).into_iter().chain(around(b)).collect::<Vec<u32>>())?;
        let mut members = vec![Vec::new(); complex.cells.len()];
        for (f, &c) in label.iter().enumerate() {
            members.get_mut(c as usize).ok_or_else(Vec::new)?.push(f as u32);
        }
        Ok(Embedding { cut, adjacency: cut_adjacency, half_arc, first, members })
    }

    /// The union of a change in its map.
    pub fn map(&self, complex: &Complex, change: &Change) -> Option<Union> {
        let (disk, outline, corners) = self.union(complex, change)?;
        let uv = disk.circle_map(&self.cut.mesh.points, &self.angles(&disk, &corners))?;
        Some(Union { disk, outline, corners, uv })
    }

    /// The vertex of a union where its node inside stands: at `pin`, if given.
    pub fn place_inside(&self, union: &Union, pin: Option<u32>) -> Option<u32> {
        match pin {
            Some(pin) => union.disk.vertices.iter().position(|&v| v == pin).map(|v| v as u32),
            None => self.middle(&union.disk, &union.uv),
        }
    }

    /// Position of a vertex of a union.
    pub fn position(&self, union: &Union, v: u32) -> DVec3 {
        self.cut.mesh.points[union.disk.vertices[v as usize] as usize]
    }

    /// The union of a change as a disk, its outline and the position of each outline corner in the disk's
    /// boundary.
    pub fn union(&self, complex: &Complex, change: &Change) -> Option<(Disk, Vec<u32>, Vec<usize>)> {
        let outline = outline(complex, change)?;
        let mut faces: Vec<u32> = change.cells.iter().flat_map(|&c| self.members[c as usize].iter().copied()).collect();
        faces.sort_unstable();
        let barrier = |h: u32| {
            let a = self.half_arc[h as usize];
            a != NONE && !change.removed.contains(&(a / 2))
        };
        let start = self.first[outline[0] as usize];
        let disk = Disk::new(&self.cut.mesh.triangles, &self.adjacency, &faces, barrier, start)?;
        let mut at = 0;
        let mut corners = Vec::with_capacity(outline.len());
        for &half in &outline {
            corners.push(at);
            at += self.cut.chains[half as usize / 2].len() - 1;
        }
        (at == disk.boundary.len()).then_some((disk, outline, corners))
    }

    /// Draws a change; `None` if it cannot be.
    pub fn draw(&self, mesh: &TriMesh, adjacency: &Adjacency, complex: &Complex, change: &Change) -> Option<Drawn> {
        let union = self.map(complex, change)?;
        let Union { disk, corners, uv, .. } = &union;
        let line = |a: u32, b: u32| self.line((mesh, adjacency), (disk, uv), [a, b]);
        let corner = |i: usize| disk.boundary[corners[i]];
        let lines = change.lines.iter().map(|&(i, j)| line(corner(i), corner(j))).collect::<Option<Vec<_>>>()?;
        let (mut spokes, mut center) = (Vec::new(), NONE);
        if !change.spokes.is_empty() {
            let v = self.place_inside(&union, change.pin)?;
            let Place::Vertex(w) = self.cut.origin[disk.vertices[v as usize] as usize] else { return None };
            center = w;
            spokes = change.spokes.iter().map(|&i| line(v, corner(i))).collect::<Option<Vec<_>>>()?;
        }
        Some(Drawn { outline: union.outline, lines, spokes, center })
    }

    /// Angles of the boundary vertices on the circle; `corners` are positions in the boundary, rising from the
    /// first by at most one turn.
    pub fn angles(&self, disk: &Disk, corners: &[usize]) -> Vec<f64> {
        let at = |v: u32| self.cut.mesh.points[disk.vertices[v as usize] as usize];
        let n = disk.boundary.len();
        // Half of the circle shared evenly among the sides, half by their length.
        let step: Vec<f64> = (0..n).map(|i| at(disk.boundary[i]).distance(at(disk.boundary[(i + 1) % n]))).collect();
        let total: f64 = step.iter().sum();
        let mut angles = vec![0.0; n];
        let mut angle = 0.0;
        for (k, &from) in corners.iter().enumerate() {
            let to = corners.get(k + 1).copied().unwrap_or(corners[0] + n);
            let length: f64 = (from..to).map(|i| step[i % n]).sum();
            let share = std::f64::consts::TAU * (0.5 / corners.len() as f64 + 0.5 * length / total);
            let mut run = 0.0;
            for i in from..to {
                let even = (i - from) as f64 / (to - from) as f64;
                // A little evenness keeps the vertices of tiny steps apart.
                let part = if length > 0.0 { 0.95 * run / length + 0.05 * even } else { even };
                angles[i % n] = angle + share * part;
                run += step[i % n];
            }
            angle += share;
        }
        angles
    }

    /// The straight line of the map `uv` between two vertices of the disk, as places of the working mesh.
    pub fn line(
        &self,
        (mesh, adjacency): (&TriMesh, &Adjacency),
        (disk, uv): (&Disk, &[DVec2]),
        ends: [u32; 2],
    ) -> Option<Vec<Place>> {
        self.polyline((mesh, adjacency), (disk, uv), ends, &[])
    }

    /// The same through points of the map.
    pub fn polyline(
        &self,
        (mesh, adjacency): (&TriMesh, &Adjacency),
        (disk, uv): (&Disk, &[DVec2]),
        [a, b]: [u32; 2],
        via: &[DVec2],
    ) -> Option<Vec<Place>> {
        let met = disk.polyline(uv, a, via, b)?;
        let places = met.iter().filter_map(|m| self.on_ground(mesh, adjacency, disk, m));
        let name = |v: u32| self.cut.origin[disk.vertices[v as usize] as usize];
        Some(tighten(mesh, adjacency, [name(a)].into_iter().chain(places).chain([name(b)]).collect()))
    }

    /// The cells around a vertex of the working mesh, ascending.
    pub fn cells_at(&self, vertex: u32) -> Vec<u32> {
        let faces: Vec<u32> = self.adjacency.fan(vertex).map(|h| h / 3).collect();
        let holds = |&c: &u32| faces.iter().any(|f| self.members[c as usize].binary_search(f).is_ok());
        (0..self.members.len() as u32).filter(holds).collect()
    }

    /// Shape of every cell; `None` for those that are gone or not four-sided.
    pub fn shapes(&self, complex: &Complex) -> Vec<Option<Shape>> {
        let shape = |c: u32| {
            let sides: [u32; 4] = complex.cells[c as usize].as_deref()?.try_into().ok()?;
            let members = &self.members[c as usize];
            let start = |h: u32| {
                let chain = &self.cut.chains[h as usize / 2];
                if h.is_multiple_of(2) { chain[0] } else { chain[chain.len() - 1] }
            };
            let trace = |h: u32| {
                let points: Vec<DVec3> =
                    self.cut.chains[h as usize / 2].iter().map(|&v| self.cut.mesh.points[v as usize]).collect();
                let trace = Trace::of(&points);
                if h.is_multiple_of(2) { trace } else { trace.reversed() }
            };
            let normal = |h: u32| {
                let around = self.adjacency.fan(start(h)).map(|g| g / 3);
                let own = around.filter(|f| members.binary_search(f).is_ok());
                own.map(|f| self.cut.mesh.area_vector(f as usize)).sum::<DVec3>().normalize_or_zero()
            };
            Some(Shape {
                corners: sides.map(|h| self.cut.mesh.points[start(h) as usize]),
                sides: sides.map(trace),
                normals: sides.map(normal),
                area: members.iter().map(|&f| self.cut.mesh.area(f as usize)).sum(),
            })
        };
        (0..complex.cells.len() as u32).into_par_iter().map(shape).collect()
    }

    /// The vertices inside a disk that are vertices of the working mesh: places for a node.
    pub fn free_vertices(&self, disk: &Disk) -> Vec<u32> {
        let mut on_boundary = vec![false; disk.vertices.len()];
        for &v in &disk.boundary {
            on_boundary[v as usize] = true;
        }
        (0..disk.vertices.len() as u32)
            .filter(|&v| !on_boundary[v as usize])
            .filter(|&v| matches!(self.cut.origin[disk.vertices[v as usize] as usize], Place::Vertex(_)))
            .collect()
    }

    /// The vertex of the working mesh, inside the disk, nearest to the centroid of the disk's area.
    fn middle(&self, disk: &Disk, uv: &[DVec2]) -> Option<u32> {
        let at = |v: u32| self.cut.mesh.points[disk.vertices[v as usize] as usize];
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        for t in &disk.triangles {
            let [a, b, c] = t.map(at);
            let area = (b - a).cross(c - a).length();
            sum += (a + b + c) / 3.0 * area;
            total += area;
        }
        let mean = sum / total;
        self.free_vertices(disk).into_iter().min_by(|&v, &w| {
            let key = |v: u32| (uv[v as usize].length() > INNER_RADIUS, at(v).distance_squared(mean));
            let (a, b) = (key(v), key(w));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        })
    }

    /// Where a line's meeting lies on the working mesh; `None` inside a face, where a chord will do.
    fn on_ground(&self, mesh: &TriMesh, adjacency: &Adjacency, disk: &Disk, met: &Met) -> Option<Place> {
        let name = |v: u32| self.cut.origin[disk.vertices[v as usize] as usize];
        match *met {
            Met::Vertex(v) => match name(v) {
                Place::Face(_) => None,
                place => Some(place),
            },
            Met::Edge(p, q, t) => {
                let (a, b) = (name(p), name(q));
                along_edge(adjacency, &mesh.triangles, &a, &b, t)
            }
        }
    }
}

/// The half-arcs around the union of a change, counter-clockwise.
pub(super) fn outline(complex: &Complex, change: &Change) -> Option<Vec<u32>> {
    Some(outline_with_cells(complex, change)?.into_iter().map(|x| x.0).collect())
}

/// The outline with the number of cells of the union at the start of each half-arc.
pub(super) fn outline_with_cells(complex: &Complex, change: &Change) -> Option<Vec<(u32, usize)>> {
    let gone = |h: u32| change.removed.contains(&(h / 2));
    let next_of = |h: u32| {
        let sides = complex.loop_of(complex.cell(h));
        let i = sides.iter().position(|&s| s == h).expect("a side of its cell");
        sides[(i + 1) % sides.len()]
    };
    let outer: usize = change.cells.iter().map(|&c| complex.loop_of(c).iter().filter(|&&h| !gone(h)).count()).sum();
    let start = change.cells.iter().flat_map(|&c| complex.loop_of(c)).copied().find(|&h| !gone(h))?;
    let mut around: Vec<(u32, usize)> = Vec::new();
    let mut at = start;
    loop {
        let mut h = next_of(at);
        let mut cells = 1;
        while gone(h) {
            h = next_of(h ^ 1);
            cells += 1;
            if cells > 4 * change.removed.len() + 4 {
                return None;
            }
        }
        around.push((h, cells));
        if h == start {
            break;
        }
        if around.len() > outer {
            return None;
        }
        at = h;
    }
    around.rotate_right(1);
    (around.len() == outer).then_some(around)
}

/// Takes out of a chain what turns back in the edge it came from.
pub(super) fn tighten(mesh: &TriMesh, adjacency: &Adjacency, chain: Vec<Place>) -> Vec<Place> {
    let ends =
        |h: u32| [mesh.triangles[h as usize / 3][h as usize % 3], mesh.triangles[h as usize / 3][next(h) as usize % 3]];
    let named = |p: Place| match p {
        Place::Edge(h, t) => canonical(adjacency, h, t),
        other => other,
    };
    let mut out: Vec<Place> = Vec::with_capacity(chain.len());
    for place in chain.into_iter().map(named) {
        match (out.last().copied(), place) {
            (Some(Place::Edge(g, _)), Place::Edge(h, _)) if g == h => {
                out.pop();
            }
            (Some(Place::Vertex(v)), Place::Edge(h, _)) if ends(h).contains(&v) => {}
            (Some(Place::Vertex(v)), Place::Vertex(w)) if v == w => {}
            (_, Place::Vertex(w)) => {
                while let Some(Place::Edge(h, _)) = out.last()
                    && ends(*h).contains(&w)
                {
                    out.pop();
                }
                out.push(place);
            }
            _ => out.push(place),
        }
    }
    out
}

/// A complex with its embedding, kept in step.
pub(super) struct Bench<'a> {
    pub mesh: &'a TriMesh,
    pub adjacency: &'a Adjacency,
    pub complex: Complex,
    pub embedding: Embedding,
}

impl<'a> Bench<'a> {
    /// `None` if the complex is not properly embedded.
    pub fn new(mesh: &'a TriMesh, adjacency: &'a Adjacency, complex: Complex) -> Option<Bench<'a>> {
        let embedding = Embedding::new(mesh, adjacency, &complex).ok()?;
        Some(Bench { mesh, adjacency, complex, embedding })
    }

    /// Shape of every cell; `None` for those that are gone or not four-sided.
    pub fn shapes(&self) -> Vec<Option<Shape>> {
        self.embedding.shapes(&self.complex)
    }

    /// The half-edges of the mesh on sharp lines.
    pub fn lines(&self) -> Vec<bool> {
        let mut lines = vec![false; self.adjacency.opposite.len()];
        for a in self.complex.live_arcs() {
            let arc = self.complex.arc(2 * a);
            for pair in arc.chain.windows(2).filter(|_| arc.kind == CurveKind::Feature) {
                if let [Place::Vertex(v), Place::Vertex(w)] = *pair {
                    for (from, to) in [(v, w), (w, v)] {
                        if let Some(h) = half_edge(&self.mesh.triangles, self.adjacency, from, to) {
                            lines[h as usize] = true;
                        }
                    }
                }
            }
        }
        lines
    }

    /// Makes `changes`, whose cells must be disjoint, each if it can be drawn. Returns how many were made; where
    /// the result does not hold together, the change at fault is left out.
    pub fn apply(&mut self, changes: &[Change]) -> usize {
        if changes.is_empty() {
            return 0;
        }
        let drawn: Vec<Option<Drawn>> = changes
            .par_iter()
            .map(|change| self.embedding.draw(self.mesh, self.adjacency, &self.complex, change))
            .collect();
        let edits = changes.iter().zip(drawn).filter_map(|(change, drawn)| Some((change, drawn?))).collect();
        self.commit(edits, |complex, (change, drawn)| replace(complex, change, drawn))
    }

    /// Puts `edits` into the complex; `put` makes one and returns the arcs it touched. Edits that would break
    /// the embedding are left out. Returns how many were made.
    pub fn commit<E>(&mut self, mut edits: Vec<E>, put: impl Fn(&mut Complex, &E) -> Vec<u32>) -> usize {
        let before = self.complex.clone();
        while !edits.is_empty() {
            let touched: Vec<Vec<u32>> = edits.iter().map(|e| put(&mut self.complex, e)).collect();
            spread(&mut self.complex);
            match Embedding::new(self.mesh, self.adjacency, &self.complex) {
                Ok(embedding) => {
                    self.embedding = embedding;
                    return edits.len();
                }
                Err(blamed) => {
                    self.complex = before.clone();
                    let count = edits.len();
                    let mut good = touched.iter().map(|arcs| !arcs.iter().any(|a| blamed.contains(a)));
                    edits.retain(|_| good.next().expect("as many as edits"));
                    if edits.len() == count {
                        edits.truncate(count / 2); // nobody to blame: the fault lies in one of the halves
                    }
                }
            }
        }
        0
    }

    /// Makes the changes that `plan` builds for `items`, given the stars of all nodes, in batches of disjoint ones.
    pub fn sweep(&mut self, items: &[u32], plan: impl Fn(&Complex, &[Vec<u32>], u32) -> Option<Change>) -> usize {
        let mut waiting = items.to_vec();
        let mut made = 0;
        while !waiting.is_empty() {
            let stars = self.complex.stars();
            let planned = waiting.iter().filter_map(|&item| Some((item, plan(&self.complex, &stars, item)?)));
            let (now, later) = disjoint(planned, |(_, change)| change.cells.clone(), |(_, change)| Some(change));
            made += self.apply(&now);
            waiting = later.into_iter().map(|x| x.0).collect();
        }
        made
    }
}

/// Puts a drawn change into the complex; returns its new arcs.
pub(super) fn replace(complex: &mut Complex, change: &Change, drawn: &Drawn) -> Vec<u32> {
    let mut free_arcs: Vec<u32> = change.removed.iter().rev().copied().collect();
    let mut free_cells: Vec<u32> = change.cells.iter().rev().copied().collect();
    for &a in &change.removed {
        complex.arcs[a as usize] = None;
    }
    for &c in &change.cells {
        complex.cells[c as usize] = None;
    }
    let corner: Vec<u32> = drawn.outline.iter().map(|&h| complex.from(h)).collect();
    let n = corner.len();
    let mut add_arc = |complex: &mut Complex, nodes: [u32; 2], chain: Vec<Place>| -> u32 {
        let arc = Some(Arc { nodes, kind: CurveKind::Smooth, chain, cells: [NONE; 2] });
        match free_arcs.pop() {
            Some(a) => {
                complex.arcs[a as usize] = arc;
                a
            }
            None => {
                complex.arcs.push(arc);
                complex.arcs.len() as u32 - 1
            }
        }
    };
    // Faces as lists of (position of the start, half-arc).
    let whole: Vec<(usize, u32)> = drawn.outline.iter().enumerate().map(|(i, &h)| (i, h)).collect();
    let mut faces = vec![whole];
    let mut touched = Vec::new();
    for (&(i, j), chain) in change.lines.iter().zip(&drawn.lines) {
        let a = add_arc(complex, [corner[i], corner[j]], chain.clone());
        touched.push(a);
        let k = faces
            .iter()
            .position(|f| f.iter().any(|x| x.0 == i) && f.iter().any(|x| x.0 == j))
            .expect("lines of a change do not cross");
        let mut face = faces.swap_remove(k);
        let start = face.iter().position(|x| x.0 == i).expect("found above");
        face.rotate_left(start);
        let middle = face.iter().position(|x| x.0 == j).expect("found above");
        let mut rest = face.split_off(middle);
        face.push((j, 2 * a + 1));
        rest.push((i, 2 * a));
        faces.push(face);
        faces.push(rest);
    }
    if !change.spokes.is_empty() {
        let center = match change.center {
            Some(node) => {
                complex.nodes[node as usize] = Node { vertex: drawn.center, stays: change.stays };
                node
            }
            None => {
                complex.nodes.push(Node { vertex: drawn.center, stays: change.stays });
                complex.nodes.len() as u32 - 1
            }
        };
        let arcs: Vec<u32> = change
            .spokes
            .iter()
            .zip(&drawn.spokes)
            .map(|(&i, chain)| add_arc(complex, [center, corner[i]], chain.clone()))
            .collect();
        touched.extend_from_slice(&arcs);
        let within = |f: &Vec<(usize, u32)>| change.spokes.iter().all(|&i| f.iter().any(|x| x.0 == i));
        let k = faces.iter().position(within).expect("all spokes lie in one face");
        let whole = faces.swap_remove(k);
        for (k, &i) in change.spokes.iter().enumerate() {
            let l = (k + 1) % arcs.len();
            let j = change.spokes[l];
            let mut face: Vec<(usize, u32)> = Vec::new();
            let mut at = whole.iter().position(|x| x.0 == i).expect("found above");
            while face.is_empty() || whole[at].0 != j {
                face.push(whole[at]);
                at = (at + 1) % whole.len();
            }
            face.push((j, 2 * arcs[l] + 1));
            face.push((n, 2 * arcs[k]));
            faces.push(face);
        }
    }
    for face in faces {
        let c = free_cells.pop().unwrap_or_else(|| {
            complex.cells.push(None);
            complex.cells.len() as u32 - 1
        });
        let sides: Vec<u32> = face.into_iter().map(|x| x.1).collect();
        for &h in &sides {
            complex.arcs[h as usize / 2].as_mut().expect("a live arc").cells[h as usize % 2] = c;
        }
        complex.cells[c as usize] = Some(sides);
    }
    touched
}

/// Moves the crossings of every edge apart, keeping their order.
fn spread(complex: &mut Complex) {
    let mut on_edge: Vec<(u32, f64, u32, u32)> = Vec::new();
    for a in complex.live_arcs() {
        for (i, place) in complex.arc(2 * a).chain.iter().enumerate() {
            if let Place::Edge(h, t) = *place {
                on_edge.push((h, t, a, i as u32));
            }
        }
    }
    on_edge.sort_by(|x, y| x.0.cmp(&y.0).then(x.1.total_cmp(&y.1)).then((x.2, x.3).cmp(&(y.2, y.3))));
    for run in on_edge.chunk_by_mut(|x, y| x.0 == y.0) {
        let mut parts: Vec<f64> = run.iter().map(|x| x.1).collect();
        keep_apart(&mut parts, CROSSINGS_APART);
        for (&(h, _, a, i), t) in run.iter().zip(parts) {
            complex.arcs[a as usize].as_mut().expect("a live arc").chain[i as usize] = Place::Edge(h, t);
        }
    }
}

/// Moves places along an edge, given in rising order, at least `gap` away from each other and from its ends (less where
/// many share it).
pub(super) fn keep_apart(parts: &mut [f64], gap: f64) {
    let gap = gap.min(0.5 / (parts.len() + 1) as f64);
    let mut least = gap;
    for part in parts.iter_mut() {
        *part = part.max(least);
        least = *part + gap;
    }
    let mut most = 1.0 - gap;
    for part in parts.iter_mut().rev() {
        *part = part.min(most);
        most = *part - gap;
    }
}
