//! Face points: where a feature passes a face between two cells.
//!
//! A face whose segment joins two hits of different surfaces carries one point, where the tangents of the two meet in
//! the plane of the face. It is made from the face's own hits alone and shared by both cells, so sharp lines run from
//! cell to cell without the flips of [K01] §4 (fig. 9), which can fold the mesh:
//! `docs/decisions/0006-certified-cells.md`.

use super::caps::FACE_POINT;
use super::crossings::{edge_point, joined};
use super::twice::{Pass, TwicePassed, low_segments};
use super::{AMBIGUOUS, Chain, FACE_EDGES, MARGIN, UNMOVED_SHARE, links};
use crate::contour::Thresholds;
use crate::contour::walk::Cell;
use crate::field::{Creases, Directed};
use crate::geom::predicates::segments_meet;
use crate::mesh::FeatureKind;
use glam::{DVec2, DVec3};

/// A face point and the hits that it joins.
#[derive(Clone, Copy, Debug)]
struct FacePoint {
    /// Node of the row at which the face lies.
    at: u32,
    /// Names of the two hits, the lesser first.
    hits: [u32; 2],
    p: DVec3,
    /// False for a bend that is no feature.
    tagged: bool,
}

/// All face points, by the axis of their face's normal and the row of its least node.
#[derive(Default)]
pub struct FacePoints {
    start: [Vec<u32>; 3],
    points: [Vec<FacePoint>; 3],
    /// First name of each axis.
    base: [u32; 3],
}

/// Vertices that would rather lie elsewhere: name and place. They were kept in their cell or face.
pub type Wish = (u32, DVec3);

/// What a few layers give.
#[derive(Default)]
pub struct Part {
    points: [Vec<(u32, FacePoint)>; 3],
    wishes: Vec<(usize, u32, u32, [u32; 2], DVec3)>,
}

/// The tangents must cross at an angle with at least this sine.
const CROSSING: f64 = 0.02;
/// A meeting farther outside the face than this, in cells, is no feature of it.
const FARTHEST_MEETING: f64 = 0.75;

/// Face points of the three faces at the least node of each cell.
/// * `twice` - cells with edges that are passed twice
pub fn face_points<'a>(
    field: &Directed,
    limits: &Thresholds,
    refine: Option<&dyn Creases>,
    twice: &TwicePassed,
    cells: impl Iterator<Item = &'a Cell>,
) -> Part {
    let (mut part, base) = (Part::default(), field.first_names());
    for cell in cells {
        // The three faces at the least node; every face between two cells is one of these.
        if twice.contains(cell.at) {
            points_of_crowded_faces(field, limits, refine, (cell, twice), &mut part);
            continue;
        }
        let ambiguous = AMBIGUOUS[cell.config as usize];
        let low = ambiguous & 0b010101;
        let links = links(cell.config, if low == 0 { 0 } else { joined(field, cell, low) });
        for axis in 0..3 {
            let segments = segments(field, cell, &base, &links, 2 * axis);
            let seek = |&[a, b]: &[Pass; 2]| point(field, cell, axis, (limits, refine), (&a, &b));
            let mut found: Vec<Option<Found>> = segments.iter().map(seek).collect();
            if segments.len() == 2 && !apart(axis, &segments, &found) {
                found.fill(None);
            }
            part.add(field, cell, axis, found);
        }
    }
    part
}

/// A face point and where it belongs, if that is elsewhere.
type Found = (FacePoint, Option<DVec3>);

impl Part {
    fn add(&mut self, field: &Directed, cell: &Cell, axis: usize, found: Vec<Option<Found>>) {
        let row = field.lattice.row(cell.at[1], cell.at[2]) as u32;
        for (point, wish) in found.into_iter().flatten() {
            self.points[axis].push((row, point));
            if let Some(wish) = wish {
                self.wishes.push((axis, row, point.at, point.hits, wish));
            }
        }
    }
}

/// The segments of a face of a cell without edges that are passed twice.
fn segments(field: &Directed, cell: &Cell, base: &[u32; 3], links: &Chain, face: usize) -> Vec<[Pass; 2]> {
    let is_here = |e: &&usize| links.next[**e] != FACE_POINT && links.face[**e] as usize == face;
    let pass = |e: usize| {
        let hit = &field.axes[e / 4].hits[cell.hit[e] as usize];
        let id = base[e / 4] + cell.hit[e];
        Pass { id, edge: e as u8, p: edge_point(field, cell, e, hit.t), n: hit.normal }
    };
    FACE_EDGES[face].iter().filter(is_here).map(|&e| [e, links.next[e] as usize].map(pass)).collect()
}

/// The face point of a segment, if it has one.
fn point(
    field: &Directed,
    cell: &Cell,
    axis: usize,
    (limits, refine): (&Thresholds, Option<&dyn Creases>),
    (a, b): (&Pass, &Pass),
) -> Option<Found> {
    let cosine = a.n.dot(b.n);
    let (p, wish, tagged) = if cosine < limits.sharp {
        place(field, cell, axis, refine, (a.p, a.n), (b.p, b.n)).map(|(p, wish)| (p, wish, true))?
    } else if cosine < limits.faint {
        faint(field, cell, axis, refine, (a.p, a.n), (b.p, b.n)).map(|(p, tagged)| (p, None, tagged))?
    } else {
        return None;
    };
    let hits = [a.id.min(b.id), a.id.max(b.id)];
    Some((FacePoint { at: cell.at[0] as u32, hits, p, tagged }, wish))
}

/// Face points of the faces at the least node of a cell with edges that are passed twice. A segment between two hits on one edge
/// has one always: where the source says that what lies between them ends, or where their tangents meet, or else as far into the face as
/// an arc over both reaches. What would meet others comes nearer to its edge, or goes.
fn points_of_crowded_faces(
    field: &Directed,
    limits: &Thresholds,
    refine: Option<&dyn Creases>,
    (cell, twice): (&Cell, &TwicePassed),
    part: &mut Part,
) {
    let hits = twice.hits(field, cell);
    let [i, j, k] = cell.at;
    let (low, far) = (field.lattice.node(i, j, k), field.lattice.node(i + 1, j + 1, k + 1));
    let middle = (low + far) / 2.0;
    for axis in 0..3 {
        let mut high = far;
        high[axis] = low[axis];
        let segments = low_segments(field, cell, &hits, axis);
        let is_tip = |s: &[Pass; 2]| s[0].edge == s[1].edge;
        let own = |s: &[Pass; 2]| {
            let [a, b] = s;
            let met = || point(field, cell, axis, (limits, refine), (a, b));
            if !is_tip(s) {
                return met();
            }
            let between = (a.p + b.p) / 2.0;
            let mut inwards = middle - between;
            (inwards[axis], inwards[a.edge as usize / 4]) = (0.0, 0.0);
            let way = inwards.normalize_or_zero();
            let of = |p: DVec3| {
                let hits = [a.id.min(b.id), a.id.max(b.id)];
                Some((FacePoint { at: cell.at[0] as u32, hits, p, tagged: a.n.dot(b.n) < limits.sharp }, None))
            };
            let told = refine.and_then(|r| r.tip_point(axis, [low, high], (a.p, a.n), (b.p, b.n)));
            let arc = || between + way * arc_height(a, b, way).min(inwards.length());
            match told {
                Some(p) => of(kept(axis, [low, high], p)),
                None => met().or_else(|| of(kept(axis, [low, high], arc()))),
            }
        };
        let mut found: Vec<Option<Found>> = segments.iter().map(own).collect();
        if !apart(axis, &segments, &found) {
            (found.iter_mut().zip(&segments)).filter(|(_, s)| !is_tip(s)).for_each(|(found, _)| *found = None);
        }
        for _ in 0..MOST_HALVINGS {
            if apart(axis, &segments, &found) {
                break;
            }
            for ((point, wish), [a, b]) in found.iter_mut().zip(&segments).filter_map(|(f, s)| Some((f.as_mut()?, s))) {
                *wish = wish.or(Some(point.p));
                point.p = point.p.lerp((a.p + b.p) / 2.0, 0.5);
            }
        }
        part.add(field, cell, axis, found);
    }
}

/// How far an arc reaches over two hits with these normals: as a parabola does, and half a circle at most.
fn arc_height(a: &Pass, b: &Pass, way: DVec3) -> f64 {
    let width = a.p.distance(b.p);
    let along = (b.p - a.p) / width;
    // The slope at either hit.
    let slopes = [a, b].map(|hit| (hit.n.dot(along) / hit.n.dot(way)).abs());
    (width * (slopes[0] + slopes[1]) / 8.0).min(width / 2.0)
}

/// A point of a face as near as can be, but not on its sides.
fn kept(axis: usize, [low, high]: [DVec3; 2], p: DVec3) -> DVec3 {
    let margin = MARGIN * UNMOVED_SHARE * (high - low);
    let mut q = p.clamp(low + margin, high - margin);
    q[axis] = low[axis];
    q
}

/// Halvings after which a point is as near to its edge as numbers can tell.
const MOST_HALVINGS: usize = 24;

/// Where a bend that only the source knows passes the face, and whether it is a feature.
fn faint(
    field: &Directed,
    cell: &Cell,
    axis: usize,
    refine: Option<&dyn Creases>,
    a: (DVec3, DVec3),
    b: (DVec3, DVec3),
) -> Option<(DVec3, bool)> {
    let [i, j, k] = cell.at;
    let (low, mut high) = (field.lattice.node(i, j, k), field.lattice.node(i + 1, j + 1, k + 1));
    high[axis] = low[axis];
    let (mut p, tagged) = refine?.faint_point(axis, low, high, a, b)?;
    p[axis] = low[axis];
    is_clear(axis, [low, high], p).then_some((p, tagged))
}

/// True if a point of a face is clear of its sides.
fn is_clear(axis: usize, [low, high]: [DVec3; 2], p: DVec3) -> bool {
    (0..3).filter(|&u| u != axis).all(|u| {
        let margin = MARGIN * (high[u] - low[u]);
        p[u] > low[u] + margin && p[u] < high[u] - margin
    })
}

/// Where the tangents of two hits meet in the plane of the face, kept in the face; and where they meet indeed, if that is
/// elsewhere.
fn place(
    field: &Directed,
    cell: &Cell,
    axis: usize,
    refine: Option<&dyn Creases>,
    a: (DVec3, DVec3),
    b: (DVec3, DVec3),
) -> Option<(DVec3, Option<DVec3>)> {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let flat = |p: DVec3| DVec2::new(p[u], p[v]);
    let (pa, pb, na, nb) = (flat(a.0), flat(b.0), flat(a.1), flat(b.1));
    let det = na.perp_dot(nb);
    let level = field.lattice.coordinate(axis, cell.at[axis]);
    let lift = |q: DVec2| {
        let mut p = DVec3::ZERO;
        p[axis] = level;
        p[u] = q.x;
        p[v] = q.y;
        p
    };
    let low = DVec2::new(field.lattice.coordinate(u, cell.at[u]), field.lattice.coordinate(v, cell.at[v]));
    let high = DVec2::new(field.lattice.coordinate(u, cell.at[u] + 1), field.lattice.coordinate(v, cell.at[v] + 1));
    let size = high - low;
    let mut meeting = None;
    if det.abs() > CROSSING * na.length() * nb.length() {
        // <na, x> = <na, pa>, <nb, x> = <nb, pb>, from the middle of both.
        let m = (pa + pb) / 2.0;
        let (da, db) = (na.dot(pa - m), nb.dot(pb - m));
        meeting = Some(m + DVec2::new(da * nb.y - db * na.y, na.x * db - nb.x * da) / det);
    }
    if let Some(refine) = refine {
        let guess = lift(meeting.unwrap_or((pa + pb) / 2.0));
        if let Some(p) = refine.face_point(axis, guess, a, b, size.max_element()) {
            meeting = Some(flat(p));
        }
    }
    let q = meeting.filter(|q| q.is_finite())?;
    let far = size * FARTHEST_MEETING;
    if q.cmplt(low - far).any() || q.cmpgt(high + far).any() {
        return None;
    }
    let margin = size * MARGIN;
    let near = margin * UNMOVED_SHARE;
    if q.cmpgt(low + near).all() && q.cmplt(high - near).all() {
        return Some((lift(q), None));
    }
    // Along the feature, so that its vertices keep their order, not across it.
    let kept = lift(q.clamp(low + margin, high - margin));
    let wish = refine.and_then(|r| r.nearest(kept, size.max_element(), &[a, b])).unwrap_or(lift(q));
    Some((kept, Some(wish)))
}

/// True if no two polylines of a face meet.
fn apart(axis: usize, segments: &[[Pass; 2]], found: &[Option<Found>]) -> bool {
    let flat = |p: DVec3| DVec2::new(p[(axis + 1) % 3], p[(axis + 2) % 3]);
    let line = |([a, b], found): (&[Pass; 2], &Option<Found>)| -> Vec<DVec2> {
        [Some(a.p), found.map(|f| f.0.p), Some(b.p)].into_iter().flatten().map(flat).collect()
    };
    let lines: Vec<Vec<DVec2>> = segments.iter().zip(found).map(line).collect();
    let meet =
        |a: &[DVec2], b: &[DVec2]| a.windows(2).any(|s| b.windows(2).any(|t| segments_meet(s[0], s[1], t[0], t[1])));
    (1..lines.len()).all(|n| lines[..n].iter().all(|other| !meet(&lines[n], other)))
}

impl FacePoints {
    /// Puts parts together; names begin at `first`.
    pub fn join(field: &Directed, parts: Vec<Part>, first: u32) -> (FacePoints, Vec<Wish>) {
        let mut all = FacePoints::default();
        let rows = field.lattice.rows();
        let mut name = first;
        for axis in 0..3 {
            all.base[axis] = name;
            let mut start = vec![0u32; rows + 1];
            let mut points: Vec<(u32, FacePoint)> = parts.iter().flat_map(|p| &p.points[axis]).copied().collect();
            points.sort_by_key(|(row, point)| (*row, point.at));
            for (row, point) in points {
                start[row as usize + 1] += 1;
                all.points[axis].push(point);
            }
            for r in 0..rows {
                start[r + 1] += start[r];
            }
            all.start[axis] = start;
            name += all.points[axis].len() as u32;
        }
        let wishes = parts
            .iter()
            .flat_map(|p| &p.wishes)
            .filter_map(|&(axis, row, at, hits, p)| Some((all.lookup(axis, row as usize, at, hits)?.0, p)))
            .collect();
        (all, wishes)
    }

    /// Number of face points.
    pub fn len(&self) -> usize {
        self.points.iter().map(Vec::len).sum()
    }

    /// For all, in the order of their names, what they mark.
    pub fn kinds(&self) -> impl Iterator<Item = FeatureKind> + '_ {
        self.points.iter().flatten().map(|p| if p.tagged { FeatureKind::Edge } else { FeatureKind::None })
    }

    /// All positions in the order of their names.
    pub fn positions(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.points.iter().flatten().map(|p| p.p)
    }

    /// Position of the face point `id`.
    pub fn position(&self, id: u32) -> DVec3 {
        let axis = (0..3).rev().find(|&a| id >= self.base[a] && !self.points[a].is_empty()).unwrap_or(0);
        self.points[axis].get((id - self.base[axis]) as usize).map_or(DVec3::NAN, |p| p.p)
    }

    /// Name, position and whether it is a feature of the face point in face `face` of a cell between two hits.
    pub fn find(&self, field: &Directed, cell: &Cell, face: usize, a: u32, b: u32) -> Option<(u32, DVec3, bool)> {
        let axis = face / 2;
        let mut at = cell.at;
        at[axis] += face & 1;
        self.lookup(axis, field.lattice.row(at[1], at[2]), at[0] as u32, [a.min(b), a.max(b)])
    }

    fn lookup(&self, axis: usize, row: usize, at: u32, hits: [u32; 2]) -> Option<(u32, DVec3, bool)> {
        let start = self.start[axis].get(row)?;
        let end = self.start[axis].get(row + 1)?;
        let points = &self.points[axis][*start as usize..*end as usize];
        let first = points.partition_point(|p| p.at < at);
        let n = points[first..].iter().take_while(|p| p.at == at).position(|p| p.hits == hits)?;
        let point = &points[first + n];
        Some((self.base[axis] + *start + (first + n) as u32, point.p, point.tagged))
    }
}
