//! From edge vectors of the thinned surface back to every corner of the input.
//!
//! Inside each thinned triangle the stretching is affine. A corner of the input is reached from the mark inside its own
//! triangle by a straight way, which passes no cone and no line; what the way becomes is the sum over the thinned
//! triangles that it crosses.

use super::flat::{Flat, Mark};
use crate::geom::predicates::orient2d;
use crate::layout::map::{SeamlessMap, quarter_turn};
use crate::mesh::{Adjacency, NONE, TriMesh, next, previous};
use glam::{DMat2, DVec2};
use std::collections::VecDeque;

/// A way ends where it is as near to a corner as this, against the longest edge there: beyond, rounding could lead around
/// a cone.
const AT_CORNER: f64 = 1e-9;
/// Numbers are kept in multiples of this, of a unit square: so whole ones can be added without rounding.
const GRAIN: f64 = 1.0 / (1u64 << 30) as f64;
/// Farther from a whole number than this, of a unit square, is not rounding.
const WHOLE: f64 = 1e-3;

/// The stretched surface: a thinned one with its new edge vectors.
pub(super) struct Stretch<'a> {
    flat: &'a Flat,
    /// For each triangle what makes new vectors of old ones, in its chart.
    matrices: Vec<DMat2>,
}

impl<'a> Stretch<'a> {
    /// * `edges` - new vector of each half-edge
    pub fn new(flat: &'a Flat, edges: &[DVec2]) -> Stretch<'a> {
        let of = |e: &[DVec2], t: usize| DMat2::from_cols(e[3 * t], -e[3 * t + 2]);
        let matrix = |t: usize| of(edges, t) * of(&flat.edge, t).inverse();
        Stretch { flat, matrices: (0..flat.len()).map(matrix).collect() }
    }

    /// What becomes of a straight way, in the chart where it begins.
    /// * `t` - the triangle in which it begins; `from` - where, from its first corner
    fn image(&self, t: usize, from: DVec2, way: DVec2) -> DVec2 {
        let (mut t, mut start, mut end) = (t, from, from + way);
        let (mut here, mut turns, mut image) = (from, 0u8, DVec2::ZERO);
        let mut entered = None;
        // More steps than half-edges would be a circle.
        for _ in 0..=3 * self.flat.len() {
            let corners = self.flat.corners(t);
            let exit = exit(corners, entered, start, end).map(|k| 3 * t as u32 + k as u32);
            let Some(h) = exit.filter(|&h| !self.flat.line[h as usize]) else { break };
            let [a, b] = [corners[h as usize % 3], corners[(h as usize + 1) % 3]];
            let (before, after) = (orient2d(a, b, here), orient2d(a, b, end));
            let part = if before > 0.0 { before / (before - after) } else { 0.0 };
            let crossing = here + (end - here) * part;
            image += quarter_turn(self.matrices[t] * (crossing - here), 4 - turns);
            let (o, jump) = (self.flat.opposite[h as usize], self.flat.jump[h as usize]);
            t = o as usize / 3;
            let base = self.flat.corners(t)[next(o) as usize % 3];
            [start, end, here] = [start, end, crossing].map(|p| base + quarter_turn(p - a, jump));
            turns = (turns + jump) % 4;
            entered = Some(o as usize % 3);
        }
        image + quarter_turn(self.matrices[t] * (end - here), 4 - turns)
    }
}

/// The side of a triangle through which a way leaves; `None` where it ends in the triangle.
/// * `entered` - the side through which it came; `None` where it began
fn exit(corners: [DVec2; 3], entered: Option<usize>, start: DVec2, end: DVec2) -> Option<usize> {
    let [a, b, c] = corners;
    let size = (b - a).abs().max_element().max((c - a).abs().max_element());
    if corners.iter().any(|&p| (p - end).abs().max_element() <= AT_CORNER * size) {
        return None;
    }
    let left = corners.map(|p| orient2d(start, end, p) >= 0.0);
    let k = match entered {
        Some(g) if left[(g + 2) % 3] => (g + 1) % 3,
        Some(g) => (g + 2) % 3,
        None => (0..3).find(|&k| !left[k] && left[(k + 1) % 3])?,
    };
    (orient2d(corners[k], corners[(k + 1) % 3], end) < 0.0).then_some(k)
}

/// Corners of each triangle of the input, as far as they are known from inside it: from its mark, in its chart.
pub(super) fn shapes(stretch: &Stretch, map: &SeamlessMap) -> Vec<[DVec2; 3]> {
    let mut shapes = vec![[DVec2::ZERO; 3]; map.uv.len()];
    for (t, marks) in stretch.flat.marks.iter().enumerate() {
        for &Mark { face, at, turns } in marks {
            let [a, b, c] = map.uv[face as usize];
            let middle = (b - a) * 0.25 + (c - a) * 0.5;
            shapes[face as usize] = [DVec2::ZERO, b - a, c - a].map(|p| {
                let image = stretch.image(t, at, quarter_turn(p - middle, turns));
                quarter_turn(image, 4 - turns)
            });
        }
    }
    shapes
}

/// Shifts the charts so that corners lie on whole numbers and those over a spanning tree agree; then rounds.
/// * `shapes` - corners of each triangle, up to a shift
/// * `kept` - for each vertex whether it lies on whole numbers
/// * `line` - for each half-edge whether it lies on a line
///
/// Returns the corners; `None` if what should be whole is not.
pub(super) fn place(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    map: &SeamlessMap,
    mut shapes: Vec<[DVec2; 3]>,
    kept: &[bool],
    line: &[bool],
) -> Option<Vec<[DVec2; 3]>> {
    let mut placed = vec![false; shapes.len()];
    let mut queue = VecDeque::new();
    // Pieces begin at a corner; one pass over all half-edges finds a seed for each.
    for seed in 0..3 * shapes.len() as u32 {
        if placed[seed as usize / 3] || !kept[mesh.origin(seed) as usize] {
            continue;
        }
        shift(&mut shapes, seed, DVec2::ZERO);
        placed[seed as usize / 3] = true;
        queue.push_back(seed / 3);
        while let Some(t) = queue.pop_front() {
            for h in 3 * t..3 * t + 3 {
                let o = adjacency.opposite[h as usize];
                if o != NONE && !placed[o as usize / 3] {
                    let start = shapes[t as usize][h as usize % 3];
                    shift(&mut shapes, next(o), quarter_turn(start, map.jump[h as usize]));
                    placed[o as usize / 3] = true;
                    queue.push_back(o / 3);
                }
            }
        }
    }
    if placed.contains(&false) {
        return None;
    }
    round(mesh, adjacency, map, &mut shapes, kept, line)?;
    Some(shapes)
}

/// Shifts a triangle so that the start of a half-edge lies at `place`.
fn shift(shapes: &mut [[DVec2; 3]], h: u32, place: DVec2) {
    let shape = &mut shapes[h as usize / 3];
    let by = place - shape[h as usize % 3];
    shape.iter_mut().for_each(|p| *p += by);
}

/// The nearest whole number, if it is near.
fn whole(x: f64) -> Option<f64> {
    let near = x.round();
    ((x - near).abs() <= WHOLE).then_some(near)
}

/// Makes whole what should be, and all corners of a vertex agree to the last bit.
fn round(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    map: &SeamlessMap,
    shapes: &mut [[DVec2; 3]],
    kept: &[bool],
    line: &[bool],
) -> Option<()> {
    let at = |shapes: &[[DVec2; 3]], h: u32| shapes[h as usize / 3][h as usize % 3];
    let mut shifts = vec![DVec2::ZERO; map.jump.len()];
    for h in 0..map.jump.len() as u32 {
        let o = adjacency.opposite[h as usize];
        if o == NONE {
            continue;
        }
        let one = |here: u32, there: u32| at(shapes, there) - quarter_turn(at(shapes, here), map.jump[h as usize]);
        let mean = (one(h, next(o)) + one(next(h), o)) * 0.5;
        shifts[h as usize] = DVec2::new(whole(mean.x)?, whole(mean.y)?);
    }
    for v in 0..mesh.points.len() as u32 {
        let fan: Vec<u32> = adjacency.fan(v).collect();
        let Some(&first) = fan.first() else { continue };
        let p = at(shapes, first);
        let mut exact = (p / GRAIN).round() * GRAIN;
        if kept[v as usize] {
            exact = DVec2::new(whole(p.x)?, whole(p.y)?);
        }
        let mut values = Vec::with_capacity(fan.len());
        for n in 0..fan.len() {
            if n > 0 {
                let crossed = previous(fan[n - 1]) as usize;
                exact = quarter_turn(exact, map.jump[crossed]) + shifts[crossed];
            }
            values.push(exact);
        }
        lay_on_lines(&fan, map, line, &mut values)?;
        for (&h, value) in fan.iter().zip(values) {
            shapes[h as usize / 3][h as usize % 3] = value;
        }
    }
    Some(())
}

/// Makes the coordinate across a line whole at a vertex: in the chart at the line, then in all around.
fn lay_on_lines(fan: &[u32], map: &SeamlessMap, line: &[bool], values: &mut [DVec2]) -> Option<()> {
    let on = |n: usize, h: u32| {
        let t = h as usize / 3;
        let edge = map.uv[t][(h as usize % 3 + 1) % 3] - map.uv[t][h as usize % 3];
        line[h as usize].then_some((n, edge.x.abs() > edge.y.abs()))
    };
    let spokes = fan.iter().enumerate().flat_map(|(n, &h)| [on(n, h), on(n, previous(h))]).flatten();
    let spokes: Vec<(usize, bool)> = spokes.collect();
    for (n, along_x) in spokes {
        let c = usize::from(along_x);
        let across = values[n][c];
        let by = whole(across)? - across;
        if by == 0.0 {
            continue;
        }
        // The same shift in every chart, turned as they are.
        let mut step = DVec2::ZERO;
        step[c] = by;
        for m in (0..n).rev() {
            values[m] += quarter_turn(step, 4 - turns_over(&fan[m..n], map));
        }
        values[n] += step;
        for m in n + 1..fan.len() {
            values[m] += quarter_turn(step, turns_over(&fan[n..m], map));
        }
    }
    Some(())
}

/// Quarter turns from the chart of the first half-edge to the one after the last.
fn turns_over(fan: &[u32], map: &SeamlessMap) -> u8 {
    fan.iter().fold(0, |turns, &h| (turns + map.jump[previous(h) as usize]) % 4)
}
