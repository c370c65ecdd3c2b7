//! Triangles of a face: constrained Delaunay in the parameters of its surface.

use super::edges::Fineness;
use super::shape::Surface;
use super::trim::Node;
use glam::DVec3;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};
use std::collections::{BTreeMap, HashMap};
use std::f64::consts::{FRAC_PI_4, TAU};

/// Nearer to the boundary than this part of the way between two lines no point is put inside.
pub(super) const MARGIN: f64 = 0.25;

/// Points inside a face at most: what triangulating them takes stays below a quarter of a gigabyte.
pub(super) const MOST_INSIDE: usize = 1_000_000;

/// Crossings of lines that are looked at for that, at most: some seconds.
const MOST_CROSSINGS: usize = 100 * MOST_INSIDE;

/// A corner of a triangle of a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Corner {
    /// A point of its rings.
    Ring(u32),
    /// A point of its own.
    Own(u32),
}

/// The triangles of a face.
#[derive(Default)]
pub(super) struct FaceMesh {
    pub points: Vec<DVec3>,
    pub triangles: Vec<[Corner; 3]>,
}

/// Why a face has no triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum FaceFault {
    /// Its rings bound nothing.
    Unbounded,
    /// So many points inside.
    TooMany(usize),
}

/// A vertex of the triangulation; without a corner where two lines of the boundary cross.
struct Site {
    at: Point2<f64>,
    corner: Option<Corner>,
}

impl HasPosition for Site {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.at
    }
}

/// The triangles between the rings of a face, counter-clockwise seen from where the surface's own normal points.
pub(super) fn triangulated(surface: &Surface, rings: &[Vec<Node>], fineness: Fineness) -> Result<FaceMesh, FaceFault> {
    let lines = Lines::new(surface, rings, fineness)?;
    let site = |uv: [f64; 2]| Point2::new(lines.number(0, uv[0]), lines.number(1, uv[1]));
    let mut sites: Vec<Site> = Vec::new();
    // Places by their bits: looked up only.
    let mut known: HashMap<[u64; 2], usize> = HashMap::new();
    let mut put = |at: Point2<f64>, corner: Corner, sites: &mut Vec<Site>| {
        *known.entry([at.x, at.y].map(f64::to_bits)).or_insert_with(|| {
            sites.push(Site { at, corner: Some(corner) });
            sites.len() - 1
        })
    };
    let mut constraints: Vec<[usize; 2]> = Vec::new();
    for ring in rings {
        let ids: Vec<usize> = ring.iter().map(|&(uv, point)| put(site(uv), Corner::Ring(point), &mut sites)).collect();
        constraints.extend((0..ids.len()).map(|k| [ids[k], ids[(k + 1) % ids.len()]]));
    }
    let region = Region::new(&constraints.iter().map(|pair| pair.map(|k| sites[k].at)).collect::<Vec<_>>());
    let mut made = FaceMesh::default();
    for uv in lines.inside(&region)? {
        put(site(uv), Corner::Own(made.points.len() as u32), &mut sites);
        made.points.push(surface.at(uv));
    }
    let is_wrong = |x: f64| spade::validate_coordinate(x).is_err();
    if sites.iter().any(|s| is_wrong(s.at.x) || is_wrong(s.at.y)) {
        return Err(FaceFault::Unbounded);
    }
    let handles: Vec<_> = (0..sites.len()).map(spade::handles::FixedVertexHandle::from_index).collect();
    let delaunay = ConstrainedDelaunayTriangulation::<Site>::bulk_load_cdt(sites, Vec::new());
    let Some(mut delaunay) = delaunay.ok().filter(|d| d.num_vertices() == handles.len()) else {
        return Err(FaceFault::Unbounded);
    };
    // A line that the boundary runs along there and back parts nothing.
    let mut runs: BTreeMap<[usize; 2], usize> = BTreeMap::new();
    constraints.iter().for_each(|[a, b]| *runs.entry([*a.min(b), *a.max(b)]).or_default() += 1);
    for [a, b] in runs.into_iter().filter(|([a, b], n)| a != b && n % 2 == 1).map(|(pair, _)| pair) {
        delaunay.add_constraint_and_split(handles[a], handles[b], |at| Site { at, corner: None });
    }
    let is_inside = inside_faces(&delaunay);
    let mut corners = Vec::new();
    for vertex in delaunay.vertices() {
        let Site { at, corner } = *vertex.data();
        corners.push(corner.unwrap_or_else(|| {
            made.points.push(surface.at([lines.parameter(0, at.x), lines.parameter(1, at.y)]));
            Corner::Own(made.points.len() as u32 - 1)
        }));
    }
    for face in delaunay.inner_faces() {
        let [a, b, c] = face.vertices().map(|v| corners[v.fix().index()]);
        // Two corners are one at a pole.
        if is_inside[face.fix().index()] && a != b && b != c && c != a {
            made.triangles.push([a, b, c]);
        }
    }
    Ok(made)
}

/// For each face whether an odd number of lines of the boundary lies between it and the outer face.
fn inside_faces(delaunay: &ConstrainedDelaunayTriangulation<Site>) -> Vec<bool> {
    let outer = delaunay.outer_face().fix().index();
    let mut beside = vec![Vec::new(); delaunay.num_all_faces()];
    for edge in delaunay.directed_edges() {
        let across = edge.rev().face().fix().index();
        beside[edge.face().fix().index()].push((across, edge.is_constraint_edge()));
    }
    let mut inside: Vec<Option<bool>> = vec![None; beside.len()];
    inside[outer] = Some(false);
    let mut waiting = vec![outer];
    while let Some(face) = waiting.pop() {
        for &(next, is_line) in &beside[face] {
            if inside[next].is_none() {
                inside[next] = inside[face].map(|is_in| is_in != is_line);
                waiting.push(next);
            }
        }
    }
    inside.into_iter().map(|is_in| is_in == Some(true)).collect()
}

/// Lines of parameters over a face, as close as its surface bends, the first and the last at its ends.
///
/// Triangles are Delaunay where lines are one apart in both directions, so that none reaches over more lines than it must: a
/// cylinder needs many lines along its axis and none across.
struct Lines {
    at: [Vec<f64>; 2],
}

impl Lines {
    fn new(surface: &Surface, rings: &[Vec<Node>], fineness: Fineness) -> Result<Lines, FaceFault> {
        let bounds = [0, 1].map(|k| {
            let values = || rings.iter().flatten().map(|(uv, _)| uv[k]);
            [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)]
        });
        if bounds.iter().any(|[a, b]| !(b > a && (b - a).is_finite())) {
            return Err(FaceFault::Unbounded);
        }
        let stops = [0, 1].map(|axis| stops(surface, axis, bounds[axis]));
        // A stretch between two stops is looked at in parts, so that there are enough of them on either axis.
        let parts = [0, 1].map(|axis| LEAST_PARTS.div_ceil(stops[axis].len() - 1));
        let middles = [0, 1].map(|axis| {
            let n = parts[axis];
            let middles = |w: &[f64]| {
                let [a, b] = [w[0], w[1]];
                (0..n).map(move |k| a + (b - a) * (k as f64 + 0.5) / n as f64)
            };
            stops[axis].windows(2).flat_map(middles).collect::<Vec<f64>>()
        });
        let at = [0, 1].map(|axis| {
            let place = |t: f64, s: f64| surface.at(if axis == 0 { [t, s] } else { [s, t] });
            let mut lines = vec![bounds[axis][0]];
            for (w, middles_here) in stops[axis].windows(2).zip(middles[axis].chunks(parts[axis])) {
                let half = (w[1] - w[0]) / parts[axis] as f64 / 2.0;
                let mut most = 0.0f64;
                for (&t, (j, &s)) in
                    middles_here.iter().flat_map(|t| middles[1 - axis].iter().enumerate().map(move |s| (t, s)))
                {
                    let [p, q, r] = [t - half, t, t + half].map(|t| place(t, s));
                    let normal = normal_at(surface, axis, t, s, bounds);
                    let mut sag = (q - (p + r) / 2.0).dot(normal).abs();
                    if surface.twists() {
                        // Of the diagonal of a part, which a triangle has for an edge.
                        let k = j / parts[1 - axis];
                        let across = (stops[1 - axis][k + 1] - stops[1 - axis][k]) / parts[1 - axis] as f64 / 2.0;
                        let corner = |a: f64, b: f64| place(t + a * half, s + b * across);
                        let twist = corner(1.0, 1.0) + corner(-1.0, -1.0) - corner(1.0, -1.0) - corner(-1.0, 1.0);
                        sag += twist.dot(normal).abs() / 4.0;
                    }
                    if sag > FLAT * fineness.distance {
                        let turn = 2.0 * (q - p).angle_between(r - q);
                        let turns = if turn.is_finite() { turn / fineness.turn } else { 1.0 };
                        most = most.max((sag / fineness.distance).sqrt()).max(turns);
                    }
                }
                let pieces = (most * parts[axis] as f64).ceil().clamp(1.0, MOST_INSIDE as f64) as usize;
                lines.extend((1..=pieces).map(|k| w[0] + (w[1] - w[0]) * k as f64 / pieces as f64));
            }
            lines
        });
        Ok(Lines { at })
    }

    /// The number of the line at a parameter, between lines a part of one; on a line but for rounding it is that of the line.
    fn number(&self, axis: usize, t: f64) -> f64 {
        let lines = &self.at[axis];
        let k = lines.partition_point(|&line| line <= t).clamp(1, lines.len() - 1) - 1;
        let number = k as f64 + (t - lines[k]) / (lines[k + 1] - lines[k]);
        if (number - number.round()).abs() <= ON_LINE { number.round() } else { number }
    }

    /// The parameter at the number of a line.
    fn parameter(&self, axis: usize, number: f64) -> f64 {
        let lines = &self.at[axis];
        let k = (number.max(0.0) as usize).min(lines.len() - 2);
        lines[k] + (lines[k + 1] - lines[k]) * (number - k as f64)
    }

    /// Crossings of lines within a region, not too near to its boundary.
    fn inside(&self, region: &Region) -> Result<Vec<[f64; 2]>, FaceFault> {
        let all = self.at[0].len() * self.at[1].len();
        if all > MOST_CROSSINGS {
            return Err(FaceFault::TooMany(all));
        }
        let mut found = Vec::new();
        for j in 1..self.at[1].len() - 1 {
            let rows = [-MARGIN, 0.0, MARGIN].map(|off| region.row(j as f64 + off));
            for i in 1..self.at[0].len() - 1 {
                if rows.iter().all(|row| [-MARGIN, MARGIN].iter().all(|off| within(row, i as f64 + off))) {
                    found.push([self.at[0][i], self.at[1][j]]);
                }
            }
            if found.len() > MOST_INSIDE {
                return Err(FaceFault::TooMany(found.len()));
            }
        }
        Ok(found)
    }
}

/// Parts of either axis in which the bend of a surface is looked at, at least.
const LEAST_PARTS: usize = 16;
/// Part of the way between two lines that rounding may take a place off one.
const ON_LINE: f64 = 1e-9;
/// Share of the allowed distance below which a bend is none: what is flat turns no normal.
const FLAT: f64 = 1e-3;

/// Where lines of a face have to be at least: at its ends, where its surface may change, and eight times around an axis.
fn stops(surface: &Surface, axis: usize, [from, to]: [f64; 2]) -> Vec<f64> {
    let period = surface.periods()[axis];
    let mut own = surface.breaks(axis);
    if own.is_empty() && period == Some(TAU) {
        own = (0..8).map(|k| k as f64 * FRAC_PI_4).collect();
    }
    let periods = period.map_or(vec![0.0], |p| {
        let low = ((from - own.first().copied().unwrap_or(0.0)) / p).floor() as i64 - 1;
        (low..low + 4).map(|k| k as f64 * p).collect()
    });
    let tiny = 1e-9 * (to - from);
    let mut stops: Vec<f64> = periods.iter().flat_map(|p| own.iter().map(move |t| t + p)).collect();
    stops.retain(|t| *t > from + tiny && *t < to - tiny);
    stops.sort_by(f64::total_cmp);
    stops.dedup_by(|a, b| (*a - *b).abs() <= tiny);
    stops.insert(0, from);
    stops.push(to);
    stops
}

/// Normal of a surface by differences of a thousandth of the face; zero where it has none.
fn normal_at(surface: &Surface, axis: usize, t: f64, s: f64, bounds: [[f64; 2]; 2]) -> DVec3 {
    let [u, v] = if axis == 0 { [t, s] } else { [s, t] };
    let [hu, hv] = bounds.map(|[a, b]| 1e-3 * (b - a));
    let du = surface.at([u + hu, v]) - surface.at([u - hu, v]);
    let dv = surface.at([u, v + hv]) - surface.at([u, v - hv]);
    du.cross(dv).normalize_or_zero()
}

/// What lies within closed lines an odd number of times.
struct Region {
    low: f64,
    step: f64,
    /// Lines by the rows that they cross.
    rows: Vec<Vec<[Point2<f64>; 2]>>,
}

impl Region {
    fn new(lines: &[[Point2<f64>; 2]]) -> Region {
        let ends = || lines.iter().flatten().map(|p| p.y);
        let (low, high) = (ends().fold(f64::INFINITY, f64::min), ends().fold(f64::NEG_INFINITY, f64::max));
        let count = lines.len().max(1);
        let step = ((high - low) / count as f64).max(f64::MIN_POSITIVE);
        let mut rows = vec![Vec::new(); count];
        let row = |y: f64| (((y - low) / step) as usize).min(count - 1);
        for line in lines {
            let [a, b] = [line[0].y.min(line[1].y), line[0].y.max(line[1].y)];
            rows[row(a)..=row(b)].iter_mut().for_each(|row| row.push(*line));
        }
        Region { low, step, rows }
    }

    /// Where the lines cross a height, in order.
    fn row(&self, y: f64) -> Vec<f64> {
        let k = (y - self.low) / self.step;
        let Some(lines) = (k >= 0.0).then(|| self.rows.get((k as usize).min(self.rows.len() - 1))).flatten() else {
            return Vec::new();
        };
        let crossing =
            |[a, b]: &[Point2<f64>; 2]| ((a.y > y) != (b.y > y)).then(|| a.x + (b.x - a.x) * (y - a.y) / (b.y - a.y));
        let mut found: Vec<f64> = lines.iter().filter_map(crossing).collect();
        found.sort_by(f64::total_cmp);
        found
    }
}

fn within(row: &[f64], x: f64) -> bool {
    row.partition_point(|c| *c <= x) % 2 == 1
}
