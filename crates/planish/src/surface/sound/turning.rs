//! Proof that a surface nowhere points against the grid that it was fitted to: between samples, too.
//!
//! 1. On a knot span the surface is a bicubic Bézier patch. Its derivatives by `u` and `v` have the degrees (2, 3) and (3, 2), so
//!    `(S_u x S_v) . d` with a fixed direction `d`, the mean normal of the grid around, is a polynomial of degree (5, 5).
//! 2. It lies between its least and its greatest Bernstein coefficient (Farin 2002, *Curves and Surfaces for CAGD*, ch. 6). If all
//!    are positive, the piece does not turn over. A coefficient of a corner is a value: where one is negative, it does.
//! 3. Pieces that neither says anything of are quartered.
//!
//! See `docs/methods/surfaces.md`, "Sound surfaces".

use super::bezier::{Bezier, patches};
use crate::grid::Grid;
use crate::surface::Surface;
use crate::surface::fold::MeanNormals;
use glam::DVec3;

/// Products smaller than this share of what they are made of are zero: corners with an angle of 0 or 180 degrees, and rounding.
const FLAT: f64 = 1e-9;
/// How often a knot span is quartered at most: to the 64th part in each direction, finer than any grid.
const QUARTERINGS: u32 = 6;
/// `C(2, i) C(3, k) / C(5, i + k)`: Bernstein coefficients of a product of degrees 2 and 3.
const PRODUCT: [[f64; 4]; 3] = [[1.0, 0.6, 0.3, 0.1], [0.4, 0.6, 0.6, 0.4], [0.1, 0.3, 0.6, 1.0]];

/// What is known of the normals of a surface against those of its grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Turning {
    /// Places where the surface points against its grid: one for each knot span that has any.
    pub over: Vec<DVec3>,
    /// The middles of pieces, one for each knot span, of which neither is shown.
    pub open: Vec<DVec3>,
}

impl Turning {
    /// True if it is proven that the surface nowhere points against its grid, but perhaps in its corners.
    pub fn is_proven(&self) -> bool {
        self.over.is_empty() && self.open.is_empty()
    }
}

/// Looks at every piece of a surface whether it points against the grid that it was fitted to, by the mean normal of the cells
/// within a knot span. The corners themselves do not count: one with an angle of 0 or 180 degrees has no normal.
pub fn turning(surface: &Surface, grid: &Grid) -> Turning {
    let means = MeanNormals::new(grid, [surface.cols, surface.rows]);
    let mut found = Turning::default();
    for span in patches(surface) {
        let mut left = vec![(span, 0)];
        let mut open = None;
        while let Some((piece, quarterings)) = left.pop() {
            match look(&piece, &means) {
                Look::Sound => {}
                Look::Over(place) => {
                    found.over.push(place);
                    open = None;
                    break;
                }
                Look::Unknown if quarterings == QUARTERINGS => _ = open.get_or_insert(middle(&piece.net)),
                Look::Unknown => left.extend(piece.quarters().map(|quarter| (quarter, quarterings + 1))),
            }
        }
        found.open.extend(open);
    }
    found
}

enum Look {
    Sound,
    Over(DVec3),
    Unknown,
}

fn middle(net: &[[DVec3; 4]; 4]) -> DVec3 {
    (net[1][1] + net[1][2] + net[2][1] + net[2][2]) / 4.0
}

fn look(piece: &Bezier, means: &MeanNormals) -> Look {
    let (along_u, along_v) = (piece.along_u(), piece.along_v());
    let mean = means.at((piece.u[0] + piece.u[1]) / 2.0, (piece.v[0] + piece.v[1]) / 2.0);
    // A grid that cancels out says nothing: then the piece is held against itself.
    let own = || along_u.iter().flatten().sum::<DVec3>().cross(along_v.iter().flatten().sum()).normalize_or_zero();
    let direction = if mean == DVec3::ZERO { own() } else { mean };
    let longest = |steps: &mut dyn Iterator<Item = &DVec3>| steps.map(|d| d.length()).fold(0.0, f64::max);
    let zero = FLAT * longest(&mut along_u.iter().flatten()) * longest(&mut along_v.iter().flatten());
    let values = coefficients(&along_u, &along_v, direction);
    let is_zero = |x: f64| x.abs() <= zero;
    // Zeros in corners, or along a whole side that has collapsed, leave the inside positive.
    let side = |q: usize, p: usize| match [q, p].map(|k| [0, 5].contains(&k)) {
        [true, true] => true,
        [true, false] => values[q].iter().all(|x| is_zero(*x)),
        [false, true] => values.iter().all(|row| is_zero(row[p])),
        [false, false] => false,
    };
    let fits = |(q, p): (usize, usize)| values[q][p] > zero || is_zero(values[q][p]) && side(q, p);
    if (0..6).all(|q| (0..6).all(|p| fits((q, p)))) && values.iter().flatten().any(|x| *x > zero) {
        return Look::Sound;
    }
    for (a, b) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let (u, v) = (piece.u[a], piece.v[b]);
        let is_corner = [0.0, 1.0].contains(&u) && [0.0, 1.0].contains(&v);
        if values[5 * b][5 * a] >= -zero || is_corner {
            continue;
        }
        // The mean normal of the piece lags behind that of the place.
        let area = along_u[3 * b][2 * a].cross(along_v[2 * b][3 * a]);
        if area.dot(means.at(u, v)) < 0.0 {
            return Look::Over(piece.net[3 * b][3 * a]);
        }
    }
    Look::Unknown
}

/// Bernstein coefficients of `(S_u x S_v) . d` but for a positive factor, `[along v][along u]`.
fn coefficients(along_u: &[[DVec3; 3]; 4], along_v: &[[DVec3; 4]; 3], d: DVec3) -> [[f64; 6]; 6] {
    let across = along_v.map(|row| row.map(|step| step.cross(d)));
    let mut sums = [[0.0; 6]; 6];
    for (j, row) in along_u.iter().enumerate() {
        for (l, across) in across.iter().enumerate() {
            let weight = PRODUCT[l][j];
            for (i, step) in row.iter().enumerate() {
                for (k, across) in across.iter().enumerate() {
                    sums[j + l][i + k] += weight * PRODUCT[i][k] * step.dot(*across);
                }
            }
        }
    }
    sums
}
