//! Cross fields: four directions in every triangle, a quarter turn apart, that a network of four-sided patches follows.
//!
//! One complex number per face, `z = exp(4 i theta)`, is the same for the four directions of a cross. The field is as
//! smooth as it can be beside three demands: it runs along sharp lines and boundaries (hard), along principal directions
//! where the surface has any (soft, [`curvature`]), and it has one quarter of a turn in every acute sector between two
//! lines ([`acute`]); otherwise such a sector would have no angle left in the map.
//!
//! Knöppel, Crane, Pinkall, Schröder, *Globally Optimal Direction Fields*, 2013, for the energy; Viertel and Osting, *An
//! Approach to Quad Meshing Based on Harmonic Cross-Valued Maps and the Ginzburg-Landau Theory*, 2019, for the steps of
//! diffusion and normalising; `docs/methods/layout.md`, step 2.

mod acute;
mod chains;
pub(crate) mod cones;
mod curvature;
mod rims;
pub(crate) mod sectors;
mod widths;

use crate::mesh::{Adjacency, NONE, TriMesh};
use crate::observe::{Cancelled, Observer};
use glam::DVec2;
use planish_sparse::SparseCholesky;
use std::f64::consts::PI;

/// Steps of diffusion, each followed by making all crosses of length one: more change nothing that is seen.
const DIFFUSION_STEPS: usize = 6;

/// What one step of diffusion holds of the step before, against the smoothness energy of the whole surface. It is the
/// area, in parts of the surface, within which cones cancel each other in a step: 1 / 100.
const MEMORY: f64 = 100.0;

/// A trace of the start, so that the first step has one answer on surfaces without any direction, such as a ball.
const START_MEMORY: f64 = 1e-3;

/// Weight of the principal directions of the whole surface against its smoothness energy: a twentieth of each face's share
/// on the meshes of 5 000 faces on which it was measured (maps of six measured meshes deviate 5 degrees from the field).
const CURVATURE_WEIGHT: f64 = 250.0;

/// Least radius of a mean of principal directions, in mean edges: less shows the triangles, not the surface.
const LEAST_RADIUS: f64 = 2.0;

/// A cross field on a mesh.
#[derive(Clone, Debug)]
pub struct CrossField {
    /// For each face the angle from its first edge to one of the four directions, counter-clockwise, radians.
    pub theta: Vec<f64>,
    /// For each half-edge what is added to an angle of its face to get that of the same direction in the face across:
    /// radians; 0 on the boundary. Acute sectors between lines are opened to a quarter turn.
    pub transport: Vec<f64>,
    /// The part of `transport` that opens acute sectors; 0 elsewhere.
    pub opening: Vec<f64>,
    /// Principal direction of each face as an angle like `theta`, and how much it counts, 0 to 1.
    pub principal: Vec<(f64, f64)>,
}

/// Parameters of [`field`].
#[derive(Clone, Copy, Debug)]
pub struct FieldParams {
    /// Weight of principal directions, against that which is derived for smooth surfaces: 0 ignores them.
    pub curvature: f64,
    /// How far crosses are smoothed in each step: larger gives fewer cones.
    pub smoothing: f64,
    /// Radius within which principal directions are averaged, world units; at least two mean edges are taken.
    pub radius: f64,
    /// Opposite cones nearer to each other than this are taken for noise where the field can do without, and what a ragged
    /// boundary turns by is averaged within it before its corners are told; world units.
    pub pair_distance: f64,
}

/// Angle of each half-edge in its face, from the face's first edge, radians.
pub(crate) fn edge_angles(mesh: &TriMesh) -> Vec<f64> {
    let angles = |f: usize| {
        let [a, b, c] = flat(mesh, f);
        [b - a, c - b, a - c].map(DVec2::to_angle)
    };
    (0..mesh.triangles.len()).flat_map(angles).collect()
}

/// The corners of a face in its plane: the first at the origin, the second on the first axis.
pub(crate) fn flat(mesh: &TriMesh, f: usize) -> [DVec2; 3] {
    let [a, b, c] = mesh.corners(f);
    let x = (b - a).normalize_or_zero();
    let across = (c - a) - (c - a).dot(x) * x;
    [DVec2::ZERO, DVec2::new(a.distance(b), 0.0), DVec2::new((c - a).dot(x), across.length())]
}

/// The smoothest cross field of `mesh` that runs along its `lines` (per half-edge) and boundaries and, by `params`, along
/// its principal directions.
/// # Errors
/// `Cancelled`.
pub fn field(
    mesh: &TriMesh,
    adjacency: &Adjacency,
    lines: &[bool],
    params: &FieldParams,
    observer: &dyn Observer,
) -> Result<CrossField, Cancelled> {
    let angle = edge_angles(mesh);
    let radius = params.radius.max(LEAST_RADIUS * mesh.mean_edge());
    let opening = acute::openings(mesh, adjacency, lines, radius, params.pair_distance, observer)?;
    let transport: Vec<f64> = (0..angle.len())
        .map(|h| match adjacency.opposite[h] {
            NONE => 0.0,
            o if h < o as usize => angle[o as usize] + PI - angle[h] + opening[h],
            o => -(angle[h] + PI - angle[o as usize]) + opening[h],
        })
        .collect();
    let principal = curvature::principal_directions(mesh, adjacency, lines, radius, observer)?;
    let energy = Energy::new(mesh, adjacency, lines, &angle, &transport);
    let theta = energy.diffuse(&principal, params, observer)?;
    let mut field = CrossField { theta, transport, opening, principal };
    cones::drop_pairs(mesh, adjacency, &energy, &mut field, params.pair_distance, observer)?;
    Ok(field)
}

/// Weight of smoothness across the edge of half-edge `h`: none across lines.
fn edge_weight(mesh: &TriMesh, adjacency: &Adjacency, lines: &[bool], h: u32) -> f64 {
    let o = adjacency.opposite[h as usize];
    if o == NONE || lines[h as usize] {
        return 0.0;
    }
    let area = mesh.area(h as usize / 3) + mesh.area(o as usize / 3);
    mesh.edge_length(h).powi(2) / area.max(f64::MIN_POSITIVE)
}

/// Numbers for the faces that are not fixed, [`NONE`] for the others, and how many there are.
fn numbered(fixed: &[Option<DVec2>]) -> (Vec<u32>, usize) {
    let mut free = 0;
    let number = |f: &Option<DVec2>| match f {
        Some(_) => NONE,
        None => {
            free += 1;
            free - 1
        }
    };
    let number = fixed.iter().map(number).collect();
    (number, free as usize)
}

/// The smoothness of a field, with the faces beside lines fixed.
struct Energy {
    /// The cross of each face that is fixed.
    fixed: Vec<Option<DVec2>>,
    /// Number of each face among the free ones.
    number: Vec<u32>,
    free: usize,
    /// Pairs of faces, weight, and four times the angle from the first to the second.
    pairs: Vec<(u32, u32, f64, f64)>,
    /// Area of each face as a part of the whole.
    share: Vec<f64>,
}

impl Energy {
    fn new(mesh: &TriMesh, adjacency: &Adjacency, lines: &[bool], angle: &[f64], transport: &[f64]) -> Energy {
        let faces = mesh.triangles.len();
        let mut fixed = vec![None; faces];
        for h in (0..angle.len()).rev() {
            if lines[h] || adjacency.opposite[h] == NONE {
                fixed[h / 3] = Some(DVec2::from_angle(4.0 * angle[h]));
            }
        }
        let (number, free) = numbered(&fixed);
        let pairs = (0..angle.len() as u32)
            .filter(|&h| adjacency.opposite[h as usize] != NONE && h < adjacency.opposite[h as usize])
            .map(|h| {
                let weight = edge_weight(mesh, adjacency, lines, h);
                (h / 3, adjacency.opposite[h as usize] / 3, weight, 4.0 * transport[h as usize])
            })
            .filter(|p| p.2 > 0.0)
            .collect();
        let area: Vec<f64> = (0..faces).map(|f| mesh.area(f)).collect();
        let whole: f64 = area.iter().sum();
        let share = area.iter().map(|a| a / whole.max(f64::MIN_POSITIVE)).collect();
        Energy { fixed, number, free, pairs, share }
    }

    /// The field after all steps of diffusion, as angles.
    fn diffuse(
        &self,
        principal: &[(f64, f64)],
        params: &FieldParams,
        observer: &dyn Observer,
    ) -> Result<Vec<f64>, Cancelled> {
        let wanted: Vec<DVec2> = principal.iter().map(|p| DVec2::from_angle(4.0 * p.0)).collect();
        let pull: Vec<f64> =
            principal.iter().zip(&self.share).map(|(p, s)| params.curvature * CURVATURE_WEIGHT * p.1 * s).collect();
        let z = self.fixed.iter().zip(&wanted).map(|(f, &w)| f.unwrap_or(w)).collect();
        let z = self.steps(1, START_MEMORY, (&pull, &wanted), z, observer)?;
        let z = self.steps(DIFFUSION_STEPS, MEMORY / params.smoothing.max(1e-3), (&pull, &wanted), z, observer)?;
        Ok(z.into_iter().map(|z| z.to_angle() / 4.0).collect())
    }

    /// The field `theta` with the faces that are `loose` as smooth as they can be between the others.
    fn smooth_there(&self, theta: &[f64], loose: &[bool], observer: &dyn Observer) -> Result<Vec<f64>, Cancelled> {
        let z: Vec<DVec2> = theta.iter().map(|t| DVec2::from_angle(4.0 * t)).collect();
        let fixed: Vec<Option<DVec2>> =
            (0..z.len()).map(|f| if loose[f] { self.fixed[f] } else { Some(z[f]) }).collect();
        let (number, free) = numbered(&fixed);
        let there = Energy { fixed, number, free, pairs: self.pairs.clone(), share: self.share.clone() };
        let z = there.steps(DIFFUSION_STEPS, START_MEMORY, (&vec![0.0; z.len()], &z), z.clone(), observer)?;
        Ok(z.into_iter().map(|z| z.to_angle() / 4.0).collect())
    }

    /// Steps of diffusion from `z`. `pull` holds each face at the cross `wanted`, `memory` at that of the step before.
    fn steps(
        &self,
        count: usize,
        memory: f64,
        (pull, wanted): (&[f64], &[DVec2]),
        mut z: Vec<DVec2>,
        observer: &dyn Observer,
    ) -> Result<Vec<DVec2>, Cancelled> {
        let Some(factor) = self.factor(pull, memory, observer)? else { return Ok(z) };
        for _ in 0..count {
            let mut rhs = vec![0.0; 2 * self.free];
            for (f, &n) in self.number.iter().enumerate().filter(|(_, n)| **n != NONE) {
                let sum = pull[f] * wanted[f] + memory * self.share[f] * z[f];
                rhs[2 * n as usize] += sum.x;
                rhs[2 * n as usize + 1] += sum.y;
            }
            for &(f, g, weight, turn) in &self.pairs {
                for (from, to, turn) in [(f, g, turn), (g, f, -turn)] {
                    if let (Some(known), n) = (self.fixed[from as usize], self.number[to as usize] as usize)
                        && n != NONE as usize
                    {
                        let sum = weight * DVec2::from_angle(turn).rotate(known);
                        rhs[2 * n] += sum.x;
                        rhs[2 * n + 1] += sum.y;
                    }
                }
            }
            factor.solve(&mut rhs);
            for (f, &n) in self.number.iter().enumerate().filter(|(_, n)| **n != NONE) {
                z[f] = DVec2::new(rhs[2 * n as usize], rhs[2 * n as usize + 1]).try_normalize().unwrap_or(z[f]);
            }
            observer.check()?;
        }
        Ok(z)
    }

    /// The factored system of one step; `None` if no face is free.
    fn factor(&self, pull: &[f64], memory: f64, observer: &dyn Observer) -> Result<Option<SparseCholesky>, Cancelled> {
        if self.free == 0 {
            return Ok(None);
        }
        let mut entries: Vec<(usize, usize, f64)> = Vec::with_capacity(2 * self.free + 6 * self.pairs.len());
        let mut diagonal = vec![0.0; self.free];
        for (f, &n) in self.number.iter().enumerate().filter(|(_, n)| **n != NONE) {
            diagonal[n as usize] += pull[f] + memory * self.share[f];
        }
        for &(f, g, weight, turn) in &self.pairs {
            let [a, b] = [f, g].map(|f| self.number[f as usize]);
            for n in [a, b].into_iter().filter(|&n| n != NONE) {
                diagonal[n as usize] += weight;
            }
            if a == NONE || b == NONE {
                continue;
            }
            // The block of row g and column f turns by `turn`, that of row f and column g back.
            let (row, column, turn) = if b > a { (b, a, turn) } else { (a, b, -turn) };
            let (row, column) = (2 * row as usize, 2 * column as usize);
            let (sin, cos) = turn.sin_cos();
            entries.push((row, column, -weight * cos));
            entries.push((row, column + 1, weight * sin));
            entries.push((row + 1, column, -weight * sin));
            entries.push((row + 1, column + 1, -weight * cos));
        }
        for (n, &d) in diagonal.iter().enumerate() {
            entries.push((2 * n, 2 * n, d));
            entries.push((2 * n + 1, 2 * n + 1, d));
        }
        match SparseCholesky::factor_watched(2 * self.free, entries, &|| observer.cancelled()) {
            None => Err(Cancelled),
            Some(factor) => Ok(factor.ok()),
        }
    }
}
