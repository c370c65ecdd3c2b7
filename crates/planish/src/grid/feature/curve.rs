//! Feature curves: curves painted across a patch that become iso-curves of its grid.
//!
//! [K98] §5.10 and 5.11. A curve of the u family runs from side 3 to side 1, one of the v family from side 0 to
//! side 2. Curves of different families cross once, in an anchor; curves of one family never.
//! 1. the v curves are imprinted, the u curves traced over that: their crossings are anchors
//! 2. the sub-patches between curves are exact disks of their own; every one gets its part of the grid  - §5.11.2
//! 3. curve points slide along their curves  - eq. 5.14 to 5.17, `feature_slide`
//!
//! Departs from [K98]: sub-patches are relaxed one by one with their sides fixed instead of all at once with curve
//! points sliding; every curve point and anchor lies on its curve by construction, and no sub-patch can fold.
//! Sections have their own numbers of points, so one is refined alone by giving it more.

use super::slide;
use super::strand::{Pieces, Strands, cut_family, to_input, to_patch};
use super::{FeatureCurve, FeatureError};
use crate::curve::SurfaceCurve;
use crate::grid::{Grid, GridParams, SideStops, relax_at, rim_node, side};
use crate::mesh::{Adjacency, FacePoint, TriMesh, next};
use crate::network::imprint::{self, Place};
use crate::network::{Corner, Curve, CurveKind, Network, Patch, PatchMesh, Side};
use crate::observe::{Observer, Part};
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Grid cells of every section between feature curves, from low to high; empty for a choice by length.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Sections {
    /// Cells along u of the sections between v curves.
    pub u: Vec<usize>,
    /// Cells along v of the sections between u curves.
    pub v: Vec<usize>,
}

/// A grid with feature curves.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureGrid {
    /// The grid.
    pub grid: Grid,
    /// For each feature curve, in the order given, its row (u family) or column (v family).
    pub lines: Vec<usize>,
    /// The curves as the grid follows them, on the input mesh.
    pub curves: Vec<Vec<DVec3>>,
    /// Anchors: row, column and position of every crossing.
    pub anchors: Vec<(usize, usize, DVec3)>,
}

/// Share of the time that reading the slides takes.
const READING: f64 = 0.3;
/// Fewest cells of a section: with fewer its points would tell nothing of its shape.
pub(crate) const FEWEST_CELLS: usize = 2;

/// Resamples a patch so that its feature curves are iso-curves of the grid, exactly.
/// * `patch` - exact sub-mesh of the mesh `input`
/// * `curves` - those of this patch, in any order and direction
/// * `size` - `(cols, rows)` of the whole grid, divided by the ends of the curves where `sections` does not tell
/// # Errors
/// See [`FeatureError`]; curves are named by their index in `curves`.
/// Source: [K98] §5.11.
pub fn relax_with_features(
    (input, patch): (&TriMesh, &PatchMesh),
    curves: &[FeatureCurve],
    size: (usize, usize),
    sections: &Sections,
    params: &GridParams,
    observer: &dyn Observer,
) -> Result<FeatureGrid, FeatureError> {
    let strands = Strands::new(input, patch, curves)?;
    let means = |list: &[usize]| list.iter().map(|&k| strands.mean_share(k)).collect::<Vec<_>>();
    let cells = [
        cells_between("u", &sections.u, &means(&strands.across), size.0.saturating_sub(1))?,
        cells_between("v", &sections.v, &means(&strands.along), size.1.saturating_sub(1))?,
    ];
    let stops = [0, 1, 2, 3].map(|k| strands.stops(k, &cells));
    relax_along((input, patch), &strands, &cells, &stops, params, observer)
}

/// Feature curves woven into their patch.
pub(crate) struct Woven {
    /// The patch cut along the v curves.
    first: imprint::Cut,
    /// The u curves over that.
    lines: Vec<Vec<FacePoint>>,
    /// The sub-patches between the curves.
    network: Network,
}

/// Steps 1 and 2: the v curves are cut into the patch and the u curves drawn over them.
pub(crate) fn weave(patch: &PatchMesh, strands: &Strands) -> Result<Woven, FeatureError> {
    let mesh = &patch.mesh;
    let adjacency = &strands.adjacency;
    let (across, along) = (&strands.across, &strands.along);
    // 1. The v curves become edges.
    let chains: Vec<Vec<Place>> = across.iter().map(|&k| strands.list[k].places(mesh, adjacency)).collect();
    let first = cut_family(mesh, adjacency, &chains, across)?;
    let ground = &first.mesh;
    let ground_adjacency = Adjacency::new(ground);
    let ground_pieces = Pieces::new(&first.parent);
    let on_ground = |p: &FacePoint| ground_pieces.place(&first, mesh, adjacency, p);
    // 2. The u curves over them, split in anchors.
    let mut lines: Vec<Vec<FacePoint>> = Vec::new();
    for &k in along {
        let places: Option<Vec<FacePoint>> = strands.list[k].points.iter().map(on_ground).collect();
        let chain = SurfaceCurve::open(places.ok_or(FeatureError::Outside { curve: k })?);
        lines.push(chain.trace(ground, &ground_adjacency).map_err(|_| FeatureError::Outside { curve: k })?);
    }
    let line_places: Vec<Vec<Place>> = lines
        .iter()
        .map(|l| l.iter().map(|p| imprint::place_of(&ground_adjacency, &ground.triangles, p)).collect())
        .collect();
    cut_family(ground, &ground_adjacency, &line_places, along)?;
    let mut sketch = Sketch::new(ground, &ground_adjacency, patch, &first.chains);
    for line in &lines {
        sketch.insert_on_side(3, line[0]);
        sketch.insert_on_side(1, line[line.len() - 1]);
    }
    let network = sketch.network(across, along, &lines, &line_places)?;
    Ok(Woven { first, lines, network })
}

/// The grid along strands that are there already, with the cells of every section and the stops of the sides, those
/// of the strands among them.
pub(crate) fn relax_along(
    (input, patch): (&TriMesh, &PatchMesh),
    strands: &Strands,
    cells: &[Vec<usize>; 2],
    stops: &SideStops,
    params: &GridParams,
    observer: &dyn Observer,
) -> Result<FeatureGrid, FeatureError> {
    let mesh = &patch.mesh;
    let adjacency = &strands.adjacency;
    let (across, along) = (&strands.across, &strands.along);
    let Woven { first, lines, network } = weave(patch, strands)?;
    let ground = &first.mesh;
    // 3. Every sub-patch is resampled on its own; shared sides get the same points.
    let sub = imprint::imprint(ground, &network, observer)?;
    let (u, v) = (&cells[0], &cells[1]);
    let (nu, nv) = (u.len(), v.len());
    let starts = |cells: &[usize]| -> Vec<usize> {
        cells.iter().scan(0, |sum, c| Some(std::mem::replace(sum, *sum + c))).collect()
    };
    let (start_u, start_v) = (starts(u), starts(v));
    let (cols, rows) = (u.iter().sum::<usize>() + 1, v.iter().sum::<usize>() + 1);
    let sizes: Vec<(usize, usize)> = (0..nu * nv).map(|p| (u[p % nu] + 1, v[p / nu] + 1)).collect();
    // Where the points of every inner side lie: read from small grids of the sub-patches.
    let slides = slide::read(ground, &sub, nu, params, &Part::new(observer, 0.0, READING))?;
    let sub_stops: Vec<SideStops> = (0..nu * nv)
        .map(|p| {
            let (i, j) = (p % nu, p / nu);
            let part = |side: usize, at_rim: bool, from: usize, count: usize| match at_rim {
                true => part_of(&stops[side], from, from + count, if side.is_multiple_of(2) { cols } else { rows }),
                false => slides[p][side].as_ref().map_or_else(side::Stops::new, |s| s.stops(count)),
            };
            [
                part(0, j == 0, start_u[i], u[i]),
                part(1, i + 1 == nu, start_v[j], v[j]),
                part(2, j + 1 == nv, cols - 1 - start_u[i] - u[i], u[i]),
                part(3, i == 0, rows - 1 - start_v[j] - v[j], v[j]),
            ]
        })
        .collect();
    let rest = Part::new(observer, READING, 1.0 - READING);
    let grids = relax_at(ground, &sub, &sizes, &sub_stops, params, &rest)?;
    // 4. One grid of all.
    let mut grid =
        Grid { rows, cols, points: vec![DVec3::ZERO; rows * cols], places: vec![FacePoint::corner(0, 0); rows * cols] };
    for (p, part) in grids.iter().enumerate() {
        for j in 0..part.rows {
            for i in 0..part.cols {
                let at = (start_v[p / nu] + j) * cols + start_u[p % nu] + i;
                grid.points[at] = part.points[j * part.cols + i];
                let place = part.places[j * part.cols + i];
                grid.places[at] = to_input(input, patch, &to_patch(&first, mesh, adjacency, &place));
            }
        }
    }
    // The boundary as the neighbours have it, bit for bit.
    for (k, chain) in patch.sides.iter().enumerate() {
        let count = if k % 2 == 0 { cols } else { rows };
        let points: Vec<DVec3> = chain.iter().map(|&v| mesh.points[v as usize]).collect();
        let samples = side::resample_at(&points, count, &stops[k]);
        for n in 0..count {
            let node = rim_node(k, n, cols, rows);
            let h = adjacency.outgoing[chain[samples.segment[n] as usize] as usize];
            let mut bary = [0.0; 3];
            bary[h as usize % 3] = 1.0 - samples.fraction[n];
            bary[next(h) as usize % 3] = samples.fraction[n];
            grid.points[node] = samples.points[n];
            grid.places[node] = to_input(input, patch, &FacePoint { face: h / 3, bary });
        }
    }
    let count = across.len() + along.len();
    let mut numbers = vec![0; count];
    let mut followed = vec![Vec::new(); count];
    for (s, &k) in across.iter().enumerate() {
        numbers[k] = start_u[s + 1];
        followed[k] = first.chains[s].iter().map(|&v| ground.points[v as usize]).collect();
    }
    for (s, &k) in along.iter().enumerate() {
        numbers[k] = start_v[s + 1];
        followed[k] = lines[s].iter().map(|p| p.position(ground)).collect();
    }
    let anchors = (1..nv)
        .flat_map(|j| (1..nu).map(move |i| (j, i)))
        .map(|(j, i)| (start_v[j], start_u[i], grid.points[start_v[j] * cols + start_u[i]]))
        .collect();
    Ok(FeatureGrid { grid, lines: numbers, curves: followed, anchors })
}

/// Stops of a side between two of its nodes, as those of that part alone.
fn part_of(stops: &side::Stops, first: usize, last: usize, count: usize) -> side::Stops {
    let share = |node: usize| match node {
        0 => 0.0,
        n if n + 1 == count => 1.0,
        n => stops.iter().find(|s| s.1 == n).map_or(n as f64 / (count - 1) as f64, |s| s.0),
    };
    let (low, high) = (share(first), share(last));
    let inner = stops.iter().filter(|s| s.1 > first && s.1 < last);
    inner.map(|&(s, k)| (((s - low) / (high - low)).clamp(0.0, 1.0), k - first)).collect()
}

/// Refuses another number of sections than there are, unless none is given.
pub(crate) fn check_count(family: &'static str, given: &[usize], needed: usize) -> Result<(), FeatureError> {
    match given.len() {
        n if n == 0 || n == needed => Ok(()),
        n => Err(FeatureError::SectionCount { family, given: n, needed }),
    }
}

/// Cells of every section between curves at `means`, rising: as given, or `cells` of them by share.
pub(crate) fn cells_between(
    family: &'static str,
    given: &[usize],
    means: &[f64],
    cells: usize,
) -> Result<Vec<usize>, FeatureError> {
    let needed = means.len() + 1;
    check_count(family, given, needed)?;
    if !given.is_empty() {
        return Ok(given.iter().map(|&c| c.max(FEWEST_CELLS)).collect());
    }
    if cells < FEWEST_CELLS * needed {
        return Err(FeatureError::TooFine { family, curves: means.len(), cells });
    }
    let mut nodes = vec![0];
    for (k, mean) in means.iter().enumerate() {
        let wanted = (mean * cells as f64).round() as usize;
        let most = cells - FEWEST_CELLS * (needed - 1 - k);
        nodes.push(wanted.clamp(nodes[k] + FEWEST_CELLS, most));
    }
    nodes.push(cells);
    Ok(nodes.windows(2).map(|w| w[1] - w[0]).collect())
}

/// The sub-patches as a network on the mesh cut along the v curves.
struct Sketch<'a> {
    ground: &'a TriMesh,
    adjacency: &'a Adjacency,
    /// The four sides as places in the direction of the sides.
    sides: [Vec<FacePoint>; 4],
    /// The v curves as chains of vertices.
    chains: &'a [Vec<u32>],
}

impl<'a> Sketch<'a> {
    fn new(ground: &'a TriMesh, adjacency: &'a Adjacency, patch: &PatchMesh, chains: &'a [Vec<u32>]) -> Sketch<'a> {
        // The boundary of the cut mesh from corner to corner: that of the patch with the ends of the v curves in it.
        let sides = [0, 1, 2, 3].map(|k| {
            let (first, last) = (patch.sides[k][0], patch.sides[k][patch.sides[k].len() - 1]);
            let mut places = Vec::new();
            let mut v = first;
            loop {
                let h = adjacency.outgoing[v as usize];
                places.push(FacePoint::corner(h / 3, h as usize % 3));
                v = ground.origin(next(h));
                if v == last || places.len() > 3 * ground.triangles.len() {
                    break;
                }
            }
            let h = adjacency.outgoing[last as usize];
            places.push(FacePoint::corner(h / 3, h as usize % 3));
            places
        });
        Sketch { ground, adjacency, sides, chains }
    }

    fn place(&self, p: &FacePoint) -> Place {
        imprint::place_of(self.adjacency, &self.ground.triangles, p)
    }

    /// Puts a place into the side that it lies on.
    fn insert_on_side(&mut self, side: usize, place: FacePoint) {
        let p = self.place(&place);
        if self.sides[side].iter().any(|q| self.place(q) == p) {
            return;
        }
        if let Place::Edge(h, _) = p {
            let start = self.ground.origin(h);
            let at = self.sides[side].iter().position(|q| self.place(q) == Place::Vertex(start));
            // Several on one edge stay in order.
            if let Some(mut at) = at {
                while let Some(q) = self.sides[side].get(at + 1)
                    && let (Place::Edge(g, t), Place::Edge(_, s)) = (self.place(q), p)
                    && g == h
                    && t < s
                {
                    at += 1;
                }
                self.sides[side].insert(at + 1, place);
            }
        }
    }

    /// Pieces of `chain` between the places of `stops`, which it passes in their order.
    fn pieces(&self, chain: &[FacePoint], stops: &[Place]) -> Vec<Vec<FacePoint>> {
        let mut out = vec![Vec::new()];
        let mut ahead = stops.iter().peekable();
        for p in chain {
            let last = out.len() - 1;
            out[last].push(*p);
            if ahead.peek().is_some_and(|&s| *s == self.place(p)) {
                ahead.next();
                out.push(vec![*p]);
            }
        }
        out
    }

    fn network(
        &self,
        across: &[usize],
        along: &[usize],
        lines: &[Vec<FacePoint>],
        places: &[Vec<Place>],
    ) -> Result<Network, FeatureError> {
        let (nu, nv) = (across.len() + 1, along.len() + 1);
        let anchors = self.anchors(across, along, lines, places)?;
        // u lines from low to high v: side 0, the u curves, side 2 turned round; each in nu pieces.
        let ends = |c: usize, e: usize| {
            let chain = &self.chains[c];
            Place::Vertex(if e == 0 { chain[0] } else { chain[chain.len() - 1] })
        };
        let turned = |k: usize| self.sides[k].iter().rev().copied().collect::<Vec<_>>();
        let mut rows = vec![self.pieces(&self.sides[0], &(0..nu - 1).map(|c| ends(c, 0)).collect::<Vec<_>>())];
        for (l, line) in lines.iter().enumerate() {
            rows.push(self.pieces(line, &anchors[l].iter().flatten().copied().collect::<Vec<_>>()));
        }
        rows.push(self.pieces(&turned(2), &(0..nu - 1).map(|c| ends(c, 1)).collect::<Vec<_>>()));
        // v lines from low to high u: side 3 turned round, the v curves with their anchors, side 1.
        let line_end = |l: usize, e: usize| {
            let list = &places[l];
            if e == 0 { list[0] } else { list[list.len() - 1] }
        };
        let mut cols = vec![self.pieces(&turned(3), &(0..nv - 1).map(|l| line_end(l, 0)).collect::<Vec<_>>())];
        for (c, chain) in self.chains.iter().enumerate() {
            let stops: Vec<Place> = (0..nv - 1).filter_map(|l| anchors[l][c]).collect();
            cols.push(self.pieces(&self.with_anchors(chain, &stops), &stops));
        }
        cols.push(self.pieces(&self.sides[1], &(0..nv - 1).map(|l| line_end(l, 1)).collect::<Vec<_>>()));
        for (list, wanted, names) in [(&rows, nu, along), (&cols, nv, across)] {
            for (k, pieces) in list.iter().enumerate() {
                if pieces.len() != wanted || pieces.iter().any(|p| p.len() < 2) {
                    // Curves pass each other in the wrong order: they meet more than once.
                    let at = names.get(k.saturating_sub(1)).or(across.first()).copied().unwrap_or(0);
                    return Err(FeatureError::Outside { curve: at });
                }
            }
        }
        Ok(lattice(rows, cols))
    }

    /// Where each u curve meets each v curve.
    fn anchors(
        &self,
        across: &[usize],
        along: &[usize],
        lines: &[Vec<FacePoint>],
        places: &[Vec<Place>],
    ) -> Result<Vec<Vec<Option<Place>>>, FeatureError> {
        let mut on_chain: BTreeMap<u32, usize> = BTreeMap::new();
        let mut on_edge: BTreeMap<(u32, u32), usize> = BTreeMap::new();
        for (c, chain) in self.chains.iter().enumerate() {
            on_chain.extend(chain.iter().map(|&v| (v, c)));
            on_edge.extend(chain.windows(2).map(|w| ((w[0].min(w[1]), w[0].max(w[1])), c)));
        }
        let mut anchors = vec![vec![None; across.len()]; along.len()];
        for (l, list) in places.iter().enumerate() {
            for p in list {
                let met = match *p {
                    Place::Vertex(v) => on_chain.get(&v),
                    Place::Edge(h, _) => {
                        let (a, b) = (self.ground.origin(h), self.ground.origin(next(h)));
                        on_edge.get(&(a.min(b), a.max(b)))
                    }
                    Place::Face(_) => None,
                };
                if let Some(&c) = met {
                    if anchors[l][c].is_some() {
                        let place = p.position(self.ground);
                        return Err(FeatureError::MeetAgain { a: across[c], b: along[l], times: 2, place });
                    }
                    anchors[l][c] = Some(*p);
                }
            }
            if let Some(c) = anchors[l].iter().position(Option::is_none) {
                let place = lines[l][0].position(self.ground);
                return Err(FeatureError::MeetAgain { a: across[c], b: along[l], times: 0, place });
            }
        }
        Ok(anchors)
    }

    /// A v curve as places, with the anchors that lie on its edges put in.
    fn with_anchors(&self, chain: &[u32], stops: &[Place]) -> Vec<FacePoint> {
        let vertex = |v: u32| {
            let h = self.adjacency.outgoing[v as usize];
            FacePoint::corner(h / 3, h as usize % 3)
        };
        let mut out = vec![vertex(chain[0])];
        for w in chain.windows(2) {
            let mut between: Vec<(f64, Place)> = stops
                .iter()
                .filter_map(|&p| match p {
                    Place::Edge(h, t) => match (self.ground.origin(h), self.ground.origin(next(h))) {
                        (a, b) if (a, b) == (w[0], w[1]) => Some((t, p)),
                        (a, b) if (b, a) == (w[0], w[1]) => Some((1.0 - t, p)),
                        _ => None,
                    },
                    _ => None,
                })
                .collect();
            between.sort_by(|a, b| a.0.total_cmp(&b.0));
            for (_, p) in between {
                let face = p.some_face(self.adjacency);
                out.extend(p.on_face(self.adjacency, &self.ground.triangles, face));
            }
            out.push(vertex(w[1]));
        }
        out
    }
}

/// The network of a lattice of curves.
/// * `rows` - curves along u from low to high v, each in pieces
/// * `cols` - curves along v from low to high u, each in pieces
fn lattice(rows: Vec<Vec<Vec<FacePoint>>>, cols: Vec<Vec<Vec<FacePoint>>>) -> Network {
    let (nu, nv) = (cols.len() - 1, rows.len() - 1);
    let mut network = Network::default();
    let corner = |j: usize, i: usize| (j * (nu + 1) + i) as u32;
    for j in 0..=nv {
        for i in 0..=nu {
            let place = if i < nu { rows[j][i][0] } else { rows[j][nu - 1][rows[j][nu - 1].len() - 1] };
            network.corners.push(Corner { place });
        }
    }
    for (j, pieces) in rows.into_iter().enumerate() {
        for (i, points) in pieces.into_iter().enumerate() {
            network.curves.push(Curve { corners: [corner(j, i), corner(j, i + 1)], kind: CurveKind::Smooth, points });
        }
    }
    let upright = network.curves.len() as u32;
    for (i, pieces) in cols.into_iter().enumerate() {
        for (j, points) in pieces.into_iter().enumerate() {
            network.curves.push(Curve { corners: [corner(j, i), corner(j + 1, i)], kind: CurveKind::Smooth, points });
        }
    }
    for j in 0..nv as u32 {
        for i in 0..nu as u32 {
            let (nu, nv) = (nu as u32, nv as u32);
            network.patches.push(Patch {
                sides: [
                    Side { curve: j * nu + i, reversed: false },
                    Side { curve: upright + (i + 1) * nv + j, reversed: false },
                    Side { curve: (j + 1) * nu + i, reversed: true },
                    Side { curve: upright + i * nv + j, reversed: true },
                ],
            });
        }
    }
    network
}
