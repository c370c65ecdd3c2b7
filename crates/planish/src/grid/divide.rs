//! A network made finer: every patch divided along the iso-curves of its grid.
//!
//! Curves are divided evenly by their length. In a patch, the rows and columns of a relaxed grid that lie between these places become
//! curves, drawn straight from node to node in the chart of the patch, where they cannot cross.

use super::chart::locate::Spot;
use super::{Fault, GridError, GridParams, SideStops, chart, springs};
use crate::curve::{between, without_repeats};
use crate::geom::polyline;
use crate::geom::tolerance::AT_VERTEX;
use crate::mesh::{Adjacency, FacePoint, TriMesh};
use crate::network::{Corner, Curve, CurveKind, ImprintError, Network, Patch, PatchMesh, Side, imprint};
use crate::observe::{Cancelled, Observer, Part};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Cells of the grid along each new curve: enough for it to bend as its neighbours do.
const CELLS: usize = 8;

/// Why a network was not divided.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DivideError {
    /// The network, or the divided one, is not in order.
    #[error(transparent)]
    Imprint(#[from] ImprintError),
    /// A patch has no grid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The observer no longer wanted the result.
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

/// A network with `by` times `by` patches in the place of each, in their order.
///
/// Curves keep what they follow; the new ones between are smooth.
/// * `params` - how square and how straight cells are; their number is given
/// # Errors
/// See [`DivideError`].
pub fn divide(
    mesh: &TriMesh,
    network: &Network,
    by: usize,
    params: &GridParams,
    observer: &dyn Observer,
) -> Result<Network, DivideError> {
    if by < 2 {
        return Ok(network.clone());
    }
    let adjacency = Adjacency::new(mesh);
    let patches = imprint(mesh, network, &Part::new(observer, 0.0, 0.1))?;
    let mut divided = Network { corners: network.corners.clone(), ..Network::default() };
    let sides: Vec<Pieces> =
        network.curves.iter().map(|curve| pieces(mesh, &adjacency, curve, by, &mut divided)).collect();
    let part = Part::new(observer, 0.1, 0.7);
    let done = AtomicUsize::new(0);
    let drawn = |(p, patch): (usize, &PatchMesh)| {
        part.check()?;
        let lattice = Lattice::new(mesh, patch, by, params, &part).map_err(|fault| fault.of_patch(p))?;
        part.progress((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / patches.len() as f64);
        Ok(lattice)
    };
    let lattices: Vec<Result<Lattice, GridError>> = patches.par_iter().with_max_len(1).enumerate().map(drawn).collect();
    for (patch, lattice) in network.patches.iter().zip(lattices) {
        lattice?.put(mesh, patch, &sides, &mut divided);
    }
    imprint(mesh, &divided, &Part::new(observer, 0.8, 0.2))?;
    Ok(divided)
}

/// What became of a curve, in its direction.
struct Pieces {
    /// Corners, both ends included.
    corners: Vec<u32>,
    curves: Vec<u32>,
}

impl Pieces {
    /// Corner `m` of the pieces, from the start of a side.
    fn corner(&self, side: Side, m: usize) -> u32 {
        let last = self.curves.len();
        self.corners[if side.reversed { last - m } else { m }]
    }

    /// Piece `m` from the start of a side, as a side.
    fn piece(&self, side: Side, m: usize) -> Side {
        let last = self.curves.len() - 1;
        Side { curve: self.curves[if side.reversed { last - m } else { m }], reversed: side.reversed }
    }
}

/// Puts the pieces of a curve, of the same length each, into a network.
fn pieces(mesh: &TriMesh, adjacency: &Adjacency, curve: &Curve, by: usize, into: &mut Network) -> Pieces {
    let points = &curve.points;
    let mut along = polyline::Along::new(points.iter().map(|p| p.position(mesh)));
    let length = along.length();
    let mut made = Pieces { corners: vec![curve.corners[0]], curves: Vec::new() };
    let mut piece = vec![points[0]];
    let mut next = 1;
    for m in 1..=by {
        if m == by {
            piece.extend_from_slice(&points[next..]);
            made.corners.push(curve.corners[1]);
        } else {
            let (segment, share) = along.advance(length * m as f64 / by as f64);
            piece.extend_from_slice(&points[next..next.max(segment + 1)]);
            next = next.max(segment + 1);
            let place = between(mesh, adjacency, &points[segment], &points[segment + 1], share);
            made.corners.push(into.corners.len() as u32);
            into.corners.push(Corner { place });
            piece.push(place);
        }
        let end = piece[piece.len() - 1];
        without_repeats(mesh, &mut piece);
        made.curves.push(into.curves.len() as u32);
        let corners = [made.corners[m - 1], made.corners[m]];
        into.curves.push(Curve { corners, kind: curve.kind, points: std::mem::replace(&mut piece, vec![end]) });
    }
    made
}

/// The new corners and curves inside a patch.
struct Lattice {
    by: usize,
    /// Places of the inner corners, row by row.
    corners: Vec<FacePoint>,
    /// For each inner row, then for each inner column: what each of its pieces meets between its ends.
    lines: [Vec<Vec<FacePoint>>; 2],
}

impl Lattice {
    fn new(
        mesh: &TriMesh,
        patch: &PatchMesh,
        by: usize,
        params: &GridParams,
        observer: &dyn Observer,
    ) -> Result<Lattice, Fault> {
        let count = by * CELLS + 1;
        let chart = chart::flatten(mesh, patch, &SideStops::default(), [count, count], observer)?;
        // Vertices that the grid misses are no matter here.
        let spots = springs::relax(&chart, count, count, params, f64::INFINITY, observer)?;
        let spot = |i: usize, j: usize| spots[j * count + i];
        let piece = |nodes: Vec<Spot>| {
            let mut places = Vec::new();
            for (k, pair) in nodes.windows(2).enumerate() {
                if k > 0 {
                    places.push(chart.place(pair[0]));
                }
                let [p, q] = [pair[0], pair[1]].map(|s| chart.uv_of(s));
                places.extend(chart.crossings(p, pair[0].triangle, q).into_iter().map(|s| chart.place(s)));
            }
            places
        };
        let inner = || (1..by).flat_map(|line| (0..by).map(move |m| (line * CELLS, m * CELLS)));
        let rows = inner().map(|(j, i)| piece((i..=i + CELLS).map(|i| spot(i, j)).collect())).collect();
        let columns = inner().map(|(i, j)| piece((j..=j + CELLS).map(|j| spot(i, j)).collect())).collect();
        let nodes = (1..by).flat_map(|j| (1..by).map(move |i| (i * CELLS, j * CELLS)));
        Ok(Lattice { by, corners: nodes.map(|(i, j)| chart.place(spot(i, j))).collect(), lines: [rows, columns] })
    }

    /// Puts the patches, and what is new between them, into a network.
    fn put(self, mesh: &TriMesh, patch: &Patch, pieces: &[Pieces], into: &mut Network) {
        let Lattice { by, corners, lines: [rows, columns] } = self;
        let first = into.corners.len() as u32;
        into.corners.extend(corners.into_iter().map(|place| Corner { place }));
        let of = |k: usize| (&pieces[patch.sides[k].curve as usize], patch.sides[k]);
        let on_side = |k: usize, m: usize| of(k).0.corner(of(k).1, m);
        let corner = |i: usize, j: usize| match (i, j) {
            (_, 0) => on_side(0, i),
            (_, j) if j == by => on_side(2, by - i),
            (0, _) => on_side(3, by - j),
            (i, _) if i == by => on_side(1, j),
            _ => first + ((j - 1) * (by - 1) + i - 1) as u32,
        };
        let mut draw = |ends: [u32; 2], between: Vec<FacePoint>| {
            let [start, end] = ends.map(|c| into.corners[c as usize].place);
            let mut points: Vec<FacePoint> = [start].into_iter().chain(between).chain([end]).collect();
            // A node on a side is where it was cut, but for rounding: what is met there is the end itself.
            let at: Vec<DVec3> = points.iter().map(|p| p.position(mesh)).collect();
            let near = AT_VERTEX * polyline::length(at.iter().copied());
            let mut at_end = at.iter().map(|p| p.distance(at[0]).min(p.distance(at[at.len() - 1])) <= near);
            points.retain(|_| !at_end.next().expect("as many as points"));
            points.insert(0, start);
            points.push(end);
            without_repeats(mesh, &mut points);
            into.curves.push(Curve { corners: ends, kind: CurveKind::Smooth, points });
            into.curves.len() as u32 - 1
        };
        let line = |k: usize| (k / by + 1, k % by);
        let draw_row = |(k, places)| {
            let (j, i) = line(k);
            draw([corner(i, j), corner(i + 1, j)], places)
        };
        let rows: Vec<u32> = rows.into_iter().enumerate().map(draw_row).collect();
        let draw_column = |(k, places)| {
            let (i, j) = line(k);
            draw([corner(i, j), corner(i, j + 1)], places)
        };
        let columns: Vec<u32> = columns.into_iter().enumerate().map(draw_column).collect();
        let piece = |k: usize, m: usize| of(k).0.piece(of(k).1, m);
        let turned = |side: Side| Side { reversed: !side.reversed, ..side };
        // From (i, j) on along u, and along v.
        let along_u = |i: usize, j: usize| match j {
            0 => piece(0, i),
            _ if j == by => turned(piece(2, by - 1 - i)),
            _ => Side { curve: rows[(j - 1) * by + i], reversed: false },
        };
        let along_v = |i: usize, j: usize| match i {
            0 => turned(piece(3, by - 1 - j)),
            _ if i == by => piece(1, j),
            _ => Side { curve: columns[(i - 1) * by + j], reversed: false },
        };
        for (j, i) in (0..by).flat_map(|j| (0..by).map(move |i| (j, i))) {
            let sides = [along_u(i, j), along_v(i + 1, j), turned(along_u(i, j + 1)), turned(along_v(i, j))];
            into.patches.push(Patch { sides });
        }
    }
}
