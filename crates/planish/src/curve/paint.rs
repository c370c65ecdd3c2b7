//! Painting: places picked one after the other become a curve.
//!
//! [K98] §3.2: between two picks a greedy chain of vertices, sampled to places and pulled straight towards the
//! segment in space by CurveAttract. Departs from [K98]: where the greedy chain runs into a dead end the rest is a
//! shortest chain (A*); a piece may also be a geodesic, or be drawn to lines or to a scalar.

use super::canvas::{Canvas, Magnet};
use super::chain::{SurfaceCurve, sample, without_repeats, without_spur};
use super::strip::{nearest_corner, no_way, straighten};
use super::{CurveError, attract};
use crate::geom::polyline;
use crate::mesh::{FacePoint, path};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the way between two picks is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PaintMode {
    /// As near to the straight segment in space as the surface allows.
    #[default]
    Straight,
    /// A shortest way over the surface.
    Geodesic,
    /// Drawn to sharp lines, creases or a scalar.
    Magnetic,
}

/// How strokes are painted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PaintParams {
    /// How the way between two picks is found.
    pub mode: PaintMode,
    /// Distance of the places of a straight piece.
    #[schemars(range(min = 0.1, max = 100.0), extend("unit" = "mean edge"))]
    pub spacing: f64,
    /// Picks nearer to a corner, another curve or a sharp line than this go onto it; 0 turns that off.
    #[schemars(range(min = 0.0, max = 0.1), extend("unit" = "diagonal"))]
    pub snap: f64,
}

impl Default for PaintParams {
    fn default() -> PaintParams {
        PaintParams { mode: PaintMode::Straight, spacing: 1.0, snap: 0.01 }
    }
}

/// What a pick went onto.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Snap {
    /// Nothing: where it was picked.
    Free,
    /// The corner with this number.
    Corner(u32),
    /// The curve with this number, at this place of its points.
    Curve(u32, u32),
    /// A vertex of a sharp line.
    Feature(u32),
}

/// Things that picks snap to.
#[derive(Clone, Copy, Debug, Default)]
pub struct SnapTargets<'a> {
    /// Corners; they win over curves.
    pub corners: &'a [FacePoint],
    /// Curves; they win over sharp lines.
    pub curves: &'a [&'a [FacePoint]],
    /// For each half-edge whether it is on a sharp line; empty for none.
    pub lines: &'a [bool],
}

/// A curve that is being painted: picks, and the ways between them. A pick can be taken back at any time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stroke {
    picks: Vec<FacePoint>,
    /// The way from pick `k` to the one after it; neighbours share a face.
    pieces: Vec<Vec<FacePoint>>,
    closed: bool,
}

impl Stroke {
    /// A stroke without picks.
    pub fn new() -> Stroke {
        Stroke::default()
    }

    /// The picks so far.
    pub fn picks(&self) -> &[FacePoint] {
        &self.picks
    }

    /// Adds a pick and the way to it.
    /// # Errors
    /// `NoWay`, `NoSuchFace`; the stroke is then what it was.
    pub fn add(
        &mut self,
        canvas: &Canvas,
        pick: FacePoint,
        params: &PaintParams,
        magnet: Option<&Magnet>,
    ) -> Result<(), CurveError> {
        let faces = canvas.mesh.triangles.len();
        if pick.face as usize >= faces {
            return Err(CurveError::NoSuchFace { face: pick.face, faces });
        }
        if let Some(&last) = self.picks.last() {
            self.pieces.push(way(canvas, last, pick, params, magnet)?);
        }
        self.picks.push(pick);
        Ok(())
    }

    /// Closes the stroke with the way from the last pick to the first.
    /// # Errors
    /// `TooFewPoints` below three picks, else as [`Stroke::add`].
    pub fn close(&mut self, canvas: &Canvas, params: &PaintParams, magnet: Option<&Magnet>) -> Result<(), CurveError> {
        if self.picks.len() < 3 {
            return Err(CurveError::TooFewPoints { found: self.picks.len(), needed: 3 });
        }
        if !self.closed {
            self.pieces.push(way(canvas, self.picks[self.picks.len() - 1], self.picks[0], params, magnet)?);
            self.closed = true;
        }
        Ok(())
    }

    /// Takes back the closing, or else the last pick. False if there is nothing to take back.
    pub fn undo(&mut self) -> bool {
        if self.closed {
            self.closed = false;
            self.pieces.pop();
            return true;
        }
        self.pieces.pop();
        self.picks.pop().is_some()
    }

    /// The curve so far; neighbours share a face.
    pub fn curve(&self, canvas: &Canvas) -> SurfaceCurve {
        let mut points: Vec<FacePoint> = self.picks.first().copied().into_iter().collect();
        for piece in &self.pieces {
            let joint = points.len() - 1;
            points.extend_from_slice(&piece[1..]);
            without_spur(canvas.mesh, &mut points, joint);
        }
        if self.closed {
            points.pop();
            let (end, place) = (points.len(), |p: &FacePoint| p.position(canvas.mesh));
            let spur = (1..end / 4).take_while(|&k| place(&points[end - k]) == place(&points[k])).count();
            points.truncate(end - spur);
            points.drain(..spur);
        }
        without_repeats(canvas.mesh, &mut points);
        SurfaceCurve { points, closed: self.closed }
    }
}

/// The way between two picks; neighbours share a face.
/// # Errors
/// `NoWay` if there is none.
pub fn way(
    canvas: &Canvas,
    from: FacePoint,
    to: FacePoint,
    params: &PaintParams,
    magnet: Option<&Magnet>,
) -> Result<Vec<FacePoint>, CurveError> {
    let (mesh, adjacency) = (canvas.mesh, &canvas.adjacency);
    if from.face == to.face {
        return Ok(vec![from, to]);
    }
    let (a, b) = (nearest_corner(mesh, &from), nearest_corner(mesh, &to));
    match (params.mode, magnet) {
        (PaintMode::Straight, _) => straight(canvas, from, [a, b], to, params.spacing),
        (PaintMode::Magnetic, Some(magnet)) => {
            let chain = canvas.path(a, b, Some(magnet))?;
            let mut points = vec![from];
            points.extend(path::places(mesh, adjacency, &chain));
            points.push(to);
            SurfaceCurve::open(points).trace(mesh, adjacency)
        }
        _ => {
            let chain = canvas.path(a, b, None)?;
            straighten(mesh, adjacency, from, &chain, to).ok_or_else(|| no_way(mesh, &from, &to))
        }
    }
}

/// A place of a straight piece that slides less than this share of the mean edge has arrived.
const SLIDE: f64 = 0.02;
/// A chain longer than this times the segment runs around something: the segment tells nothing of its course.
const BULGE: f64 = 1.3;
/// A straight piece whose neighbouring places come to lie this many times their mean distance apart is torn; the
/// chain is then pulled to a geodesic instead.
const TORN: f64 = 6.0;

/// A greedy chain of vertices, or a shortest one where that runs into a dead end, sampled to places and drawn to the
/// segment between its ends.
fn straight(
    canvas: &Canvas,
    from: FacePoint,
    [a, b]: [u32; 2],
    to: FacePoint,
    spacing: f64,
) -> Result<Vec<FacePoint>, CurveError> {
    let (mesh, adjacency) = (canvas.mesh, &canvas.adjacency);
    let greedy = canvas.greedy(a, b);
    let shortest = if greedy.is_none() { Some(canvas.path(a, b, None)?) } else { None };
    // From a shortest chain: the greedy one may run far astray, and would take long to pull straight.
    let geodesic = || {
        let own = if shortest.is_none() { canvas.path(a, b, None)? } else { Vec::new() };
        let chain = shortest.as_deref().unwrap_or(&own);
        straighten(mesh, adjacency, from, chain, to).ok_or_else(|| no_way(mesh, &from, &to))
    };
    let chain = greedy.as_deref().or(shortest.as_deref()).unwrap_or(&[]);
    let (p, q) = (from.position(mesh), to.position(mesh));
    let length = polyline::length(chain.iter().map(|&v| mesh.points[v as usize]));
    let segment = p.distance(q);
    if length > BULGE * segment + 2.0 * canvas.edge {
        return geodesic();
    }
    let count = (length / (spacing * canvas.edge)).round().clamp(2.0, 1e6) as usize + 1;
    let mut rough = vec![from];
    rough.extend(path::places(mesh, adjacency, chain));
    rough.push(to);
    let places = sample(mesh, adjacency, &rough, count);
    let tolerance = SLIDE * canvas.edge;
    let gap = TORN * length / (count - 1) as f64;
    let mut drawn: Vec<FacePoint> = vec![from];
    let mut last = p;
    for (k, place) in places[1..count - 1].iter().enumerate() {
        let attractor = p.lerp(q, (k + 1) as f64 / (count - 1) as f64);
        // The place before has come down near this attractor already.
        let before = drawn[drawn.len() - 1];
        let start = if last.distance(attractor) < place.position(mesh).distance(attractor) { before } else { *place };
        let to = attract::slide_within(mesh, adjacency, start, attractor, tolerance);
        let at = to.position(mesh);
        if at.distance(last) > gap {
            return geodesic();
        }
        last = at;
        drawn.push(to);
    }
    if last.distance(q) > gap {
        return geodesic();
    }
    drawn.push(to);
    SurfaceCurve::open(drawn).trace(mesh, adjacency)
}

/// The place that a pick goes onto: the nearest corner, curve or sharp line within the distance of `params`.
pub fn snap(canvas: &Canvas, pick: FacePoint, targets: &SnapTargets, params: &PaintParams) -> (FacePoint, Snap) {
    let mesh = canvas.mesh;
    let p = pick.position(mesh);
    let reach = params.snap * mesh.bounds().diagonal();
    let nearest = |places: &mut dyn Iterator<Item = FacePoint>| {
        places
            .enumerate()
            .map(|(k, place)| (place.position(mesh).distance(p), k, place))
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
            .filter(|x| x.0 <= reach)
    };
    if let Some((_, k, place)) = nearest(&mut targets.corners.iter().copied()) {
        return (place, Snap::Corner(k as u32));
    }
    let on_curve = (targets.curves.iter().enumerate())
        .filter_map(|(c, points)| nearest(&mut points.iter().copied()).map(|(d, k, place)| (d, c, k, place)))
        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    if let Some((_, c, k, place)) = on_curve {
        return (place, Snap::Curve(c as u32, k as u32));
    }
    if let Some(v) = nearest_on_lines(canvas, pick, targets.lines, reach) {
        let h = canvas.adjacency.outgoing[v as usize];
        return (FacePoint::corner(h / 3, h as usize % 3), Snap::Feature(v));
    }
    (pick, Snap::Free)
}

/// The vertex of a sharp line nearest to a pick, looked for among the vertices within `reach` only.
fn nearest_on_lines(canvas: &Canvas, pick: FacePoint, lines: &[bool], reach: f64) -> Option<u32> {
    if lines.len() != 3 * canvas.mesh.triangles.len() {
        return None;
    }
    let mesh = canvas.mesh;
    let p = pick.position(mesh);
    let mut seen: std::collections::BTreeSet<u32> = mesh.triangles[pick.face as usize].into_iter().collect();
    let mut stack: Vec<u32> = seen.iter().copied().collect();
    let mut best: Option<(f64, u32)> = None;
    while let Some(v) = stack.pop() {
        let d = mesh.points[v as usize].distance(p);
        if d > reach {
            continue;
        }
        let on_line = canvas.adjacency.fan(v).any(|h| {
            let g = crate::mesh::previous(h);
            lines[h as usize] || lines[g as usize]
        });
        if on_line && best.is_none_or(|b| (d, v) < b) {
            best = Some((d, v));
        }
        stack.extend(canvas.links(v).iter().map(|l| l.0).filter(|&w| seen.insert(w)));
    }
    best.map(|b| b.1)
}
