//! Corners of the boundary, and which of its turns are none of the form's.
//!
//! The boundary of a scan is ragged: it turns by more than a corner does, and back. With `t_i` what it turns by at vertex
//! `i` and `c_i` the quarter turns of a corner there, the directions that are left deviate from smooth ones, by
//! `min over phi of the integral of (rho - phi)^2 + reach^2 phi'^2`, by
//! `reach / 2 * sum over i, j of (t_i - c_i pi/2) (t_j - c_j pi/2) exp(-|s_i - s_j| / reach)`, `s` being length along the
//! boundary. Corners are taken one by one, the best first, so what turns back within three quarters of the reach has none.
//!
//! A field that follows every edge of a tooth has two cones beside it. So teeth are ironed: what turns at a vertex is spread
//! along the boundary by the same weights, and the difference goes into the turns on crossing edges, as for acute sectors
//! ([`super::acute`]). No turn is lost, so it is a closed form, and no cone comes from it.

use super::chains::Chains;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// What noise may add to a turn, radians.
const NOISE: f64 = 0.05;

/// A boundary that turns by less than this has no corner: half of a quarter turn, and noise.
pub(super) const CORNER_TURN: f64 = FRAC_PI_4 + NOISE;

/// Once around a boundary that is far shorter than the reach leaves no more than this of a value, so that sums have an end.
const NEARLY_ALL: f64 = 1.0 - 1e-9;

/// The boundary as a field is to see it; all for each sector.
pub(super) struct Rims {
    /// Quarter turns; none off the boundary.
    pub width: Vec<Option<i32>>,
    /// What a corner is wider than its quarter turns, where that is to be opened, radians.
    pub excess: Vec<f64>,
    /// What the field is to turn by besides, radians.
    pub ironed: Vec<f64>,
}

/// The boundary's corners and teeth.
/// * `border` - the sectors of the boundary that nothing else passes through
/// * `narrow` - reach of a boundary that is even, and distance of corners
/// * `wide` - reach of one that is ragged: at half of its vertices it turns by more than noise beyond an even turn
pub(super) fn rims(chains: &Chains, border: &[usize], narrow: f64, wide: f64) -> Rims {
    let count = chains.sectors.len();
    let mut rims = Rims { width: vec![None; count], excess: vec![0.0; count], ironed: vec![0.0; count] };
    for at in chains.runs(border) {
        let turn: Vec<f64> = at.iter().map(|&i| PI - chains.sectors[i].angle).collect();
        let faces: Vec<i32> = at.iter().map(|&i| chains.sectors[i].spokes.len() as i32).collect();
        let mut run = Run::new(chains, &at, narrow);
        let mut rough: Vec<f64> = run.teeth(&turn).iter().map(|t| t.abs()).collect();
        rough.sort_unstable_by(f64::total_cmp);
        let is_ragged = rough[rough.len() / 2] > NOISE;
        if is_ragged {
            run = Run::new(chains, &at, wide);
        }
        let corners = run.corners(&turn, &faces);
        let left = |k: usize| turn[k] - f64::from(corners[k]) * FRAC_PI_2;
        let is_opened = |k: usize| !is_ragged && corners[k] != 0;
        let spread: Vec<f64> = (0..at.len()).map(|k| if is_opened(k) { 0.0 } else { left(k) }).collect();
        for (k, tooth) in run.teeth(&spread).into_iter().enumerate() {
            rims.width[at[k]] = Some(2 - corners[k]);
            rims.excess[at[k]] = if is_opened(k) { -left(k) } else { 0.0 };
            rims.ironed[at[k]] = -tooth;
        }
        let mut sharpest: Vec<usize> = (0..at.len()).filter(|&k| corners[k] != 0).collect();
        sharpest.sort_by(|&a, &b| turn[b].abs().total_cmp(&turn[a].abs()).then(a.cmp(&b)));
        sharpest.into_iter().for_each(|k| rims.join(chains, at[k], narrow));
    }
    rims
}

impl Rims {
    /// The quarter turns of the corner at a sector; 0 where there is none.
    fn corner(&self, i: usize) -> i32 {
        2 - self.width[i].unwrap_or(2)
    }

    /// Takes into a corner those within `apart` that turn the same way, for a map has no room between them: outward ones
    /// make it acute, inward ones have as many quarter turns there as its faces have room for.
    fn join(&mut self, chains: &Chains, to: usize, apart: f64) {
        for from in chains.near(to, apart, |_| false) {
            let (own, other) = (self.corner(to), self.corner(from));
            let is_full = own < 0 && own + other < 2 - chains.sectors[to].spokes.len() as i32;
            if from == to || own * other <= 0 || is_full {
                continue;
            }
            let moved = f64::from(other) * FRAC_PI_2;
            self.ironed[from] -= moved;
            self.ironed[to] += moved;
            self.width[from] = Some(2);
            if own > 0 {
                self.excess[to] -= moved;
            } else {
                self.width[to] = Some(2 - own - other);
            }
        }
    }
}

/// Vertices that follow each other along the boundary.
struct Run {
    /// Weight of each for the next one; the last has none for the first where the boundary does not go around.
    fade: Vec<f64>,
    /// Length that each stands for.
    length: Vec<f64>,
}

impl Run {
    fn new(chains: &Chains, at: &[usize], reach: f64) -> Run {
        let n = at.len();
        let is_closed = n > 2 && chains.ways[0][at[n - 1]] == Some(at[0]);
        let fade = |k: usize| (-chains.distance(at[k], at[(k + 1) % n]) / reach).exp();
        Run {
            fade: (0..n).map(|k| if k + 1 < n || is_closed { fade(k) } else { 0.0 }).collect(),
            length: at.iter().map(|&i| chains.length(i)).collect(),
        }
    }

    /// For each vertex the sum of the values of all, by the weights `exp(-|s| / reach)`; around a closed boundary again and
    /// again, and 1 for the vertex itself.
    fn sums(&self, values: &[f64]) -> Vec<f64> {
        let (n, fade) = (values.len(), &self.fade);
        // What once around leaves of a value.
        let left = fade.iter().product::<f64>().min(NEARLY_ALL);
        let ahead = carried((0..n).map(|k| (values[k], fade[k])), left);
        let mut behind = carried((0..n).rev().map(|k| (values[k], fade[(k + n - 1) % n])), left);
        behind.reverse();
        let own = (1.0 + left) / (1.0 - left);
        (0..n).map(|k| (values[k] + ahead[k] + behind[k]) / own).collect()
    }

    /// Quarter turns of the corners.
    /// * `turn` - what the boundary turns by at each vertex
    /// * `faces` - beside each: as many quarter turns have room
    fn corners(&self, turn: &[f64], faces: &[i32]) -> Vec<i32> {
        let mut rest = turn.to_vec();
        let mut corners = vec![0; turn.len()];
        loop {
            let sums = self.sums(&rest);
            let has_room = |&k: &usize| if sums[k] > 0.0 { corners[k] < 1 } else { corners[k] > 2 - faces[k].max(2) };
            let best = (0..turn.len()).filter(has_room).max_by(|&a, &b| sums[a].abs().total_cmp(&sums[b].abs()));
            let Some(k) = best.filter(|&k| sums[k].abs() > CORNER_TURN) else { return corners };
            let quarter = if sums[k] > 0.0 { 1 } else { -1 };
            corners[k] += quarter;
            rest[k] -= f64::from(quarter) * FRAC_PI_2;
        }
    }

    /// By how much more than evenly each vertex turns. They sum to nothing.
    fn teeth(&self, turn: &[f64]) -> Vec<f64> {
        let whole = self.sums(&self.length);
        let shares: Vec<f64> = turn.iter().zip(&whole).map(|(turn, whole)| turn / whole).collect();
        let even = self.sums(&shares);
        turn.iter().zip(even).zip(&self.length).map(|((turn, even), length)| turn - even * length).collect()
    }
}

/// What comes to each vertex of those before it, each with its value and its weight for the next one.
/// * `left` - what once around leaves of a value
fn carried(run: impl Iterator<Item = (f64, f64)> + Clone, left: f64) -> Vec<f64> {
    let next = |carried: f64, (value, fade)| (carried + value) * fade;
    let start = run.clone().fold(0.0, next) / (1.0 - left);
    run.scan(start, |carried, at| Some(std::mem::replace(carried, next(*carried, at)))).collect()
}

#[cfg(test)]
mod tests {
    use super::super::sectors::{Sector, sectors};
    use super::*;
    use crate::mesh::{Adjacency, TriMesh};
    use crate::synthetic::shapes;

    /// Reaches, in squares of the sheet.
    const NARROW: f64 = 1.5;
    const WIDE: f64 = 8.0;

    /// A sheet of 41 by 21 squares without those that `is_cut` names by column and row.
    fn sheet(is_cut: impl Fn(u32, u32) -> bool) -> TriMesh {
        let full = shapes::rectangle(41.0, 21.0, 41, 21);
        let low = full.bounds().min;
        let square = |f: usize| (full.corners(f).into_iter().sum::<glam::DVec3>() / 3.0 - low).floor();
        let kept = |f: &usize| !is_cut(square(*f).x as u32, square(*f).y as u32);
        let triangles: Vec<[u32; 3]> = (0..full.triangles.len()).filter(kept).map(|f| full.triangles[f]).collect();
        let mut used: Vec<u32> = triangles.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        let fresh = |v: u32| used.binary_search(&v).expect("a used vertex") as u32;
        let points = used.iter().map(|&v| full.points[v as usize]).collect();
        TriMesh::new(points, triangles.into_iter().map(|t| t.map(fresh)).collect())
    }

    /// Every other square along the two long sides.
    fn is_gap(x: u32, y: u32) -> bool {
        x % 2 == 1 && !(1..20).contains(&y)
    }

    /// The sectors of the boundary and what they are to be.
    fn seen(mesh: &TriMesh) -> (Vec<Sector>, Rims) {
        let sectors = sectors(mesh, &Adjacency::new(mesh), &vec![false; 3 * mesh.triangles.len()]);
        let chains = Chains::new(mesh, &sectors, |_| true);
        let border: Vec<usize> = (0..sectors.len()).collect();
        let rims = rims(&chains, &border, NARROW, WIDE);
        (sectors, rims)
    }

    /// Widths other than half a turn, in order.
    fn corners(mesh: &TriMesh) -> Vec<i32> {
        let mut corners: Vec<i32> = seen(mesh).1.width.into_iter().flatten().filter(|&w| w != 2).collect();
        corners.sort_unstable();
        corners
    }

    #[test]
    fn a_clean_border_keeps_all_its_corners() {
        assert_eq!(corners(&sheet(|_, _| false)), [1; 4]);
        // A notch three squares wide and two deep.
        assert_eq!(corners(&sheet(|x, y| (10..13).contains(&x) && y >= 19)), [1, 1, 1, 1, 1, 1, 3, 3]);
    }

    #[test]
    fn the_end_of_a_tongue_of_one_square_is_one_acute_corner() {
        let mesh = sheet(|x, y| y >= 11 && x != 20);
        assert_eq!(corners(&mesh), [1, 1, 1, 1, 1, 3, 3]);
        let (_, rims) = seen(&mesh);
        let opened: Vec<f64> = rims.excess.into_iter().filter(|e| e.abs() > 1e-9).collect();
        assert!(opened.len() == 1 && (opened[0] + FRAC_PI_2).abs() < 1e-9, "{opened:?}");
    }

    #[test]
    fn a_ragged_border_has_the_corners_of_the_sheet_and_none_at_its_teeth() {
        assert_eq!(corners(&sheet(is_gap)), [1; 4]);
    }

    #[test]
    fn ironing_loses_no_turn_and_leaves_a_field_that_hardly_turns_at_teeth() {
        let (sectors, rims) = seen(&sheet(is_gap));
        assert!(rims.ironed.iter().sum::<f64>().abs() < 1e-9);
        // Besides its quarter turns.
        let turned = |i: usize| {
            let own = sectors[i].angle - f64::from(rims.width[i].expect("on the boundary")) * FRAC_PI_2;
            (own - rims.ironed[i] - rims.excess[i]).abs()
        };
        let most = (0..sectors.len()).map(turned).fold(0.0, f64::max);
        let teeth = sectors.iter().map(|s| (s.angle - PI).abs()).fold(0.0, f64::max);
        assert!(teeth > 1.5 && most < 0.2, "{teeth} {most}");
    }
}
