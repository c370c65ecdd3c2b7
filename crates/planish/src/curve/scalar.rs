//! Scalars on the vertices that draw curves: colour, curvature, anything.
//!
//! [K98] §3.8.2. The gradient at a vertex is the paper's sum over its edges with every edge weighted by the inverse
//! of its squared length and the whole by two over their number, which makes it the gradient itself on a regular
//! ring instead of a number that depends on edge lengths.

use super::CurveError;
use super::curvature::vertex_curvature;
use crate::mesh::path::neighbours;
use crate::mesh::{Adjacency, Attribute, FacePoint, TriMesh};
use glam::DVec3;
use rayon::prelude::*;

/// A number per vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScalarField {
    /// One number per vertex.
    pub values: Vec<f64>,
}

/// Weights of red, green and blue in the luminance (ITU-R BT.709).
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

impl ScalarField {
    /// A user's own numbers.
    /// # Errors
    /// `ValueCount` unless there is one per vertex.
    pub fn new(mesh: &TriMesh, values: Vec<f64>) -> Result<ScalarField, CurveError> {
        if values.len() != mesh.points.len() {
            return Err(CurveError::ValueCount { found: values.len(), wanted: mesh.points.len() });
        }
        Ok(ScalarField { values })
    }

    /// Channel `channel` of an attribute.
    /// # Errors
    /// `NoSuchPart` for a channel that it does not have, `ValueCount` if it does not fit the mesh.
    pub fn channel(mesh: &TriMesh, attribute: &Attribute, channel: usize) -> Result<ScalarField, CurveError> {
        if channel >= attribute.width {
            return Err(CurveError::NoSuchPart { what: "channel", index: channel, count: attribute.width });
        }
        let values = attribute.values.chunks_exact(attribute.width).map(|x| x[channel] as f64).collect();
        ScalarField::new(mesh, values)
    }

    /// Luminance of a colour of three or four channels.
    /// # Errors
    /// `NoSuchPart` for fewer channels, `ValueCount` if it does not fit the mesh.
    pub fn luminance(mesh: &TriMesh, color: &Attribute) -> Result<ScalarField, CurveError> {
        if color.width < 3 {
            return Err(CurveError::NoSuchPart { what: "channel", index: 2, count: color.width });
        }
        let luma = |x: &[f32]| (0..3).map(|k| LUMINANCE[k] * x[k] as f64).sum();
        ScalarField::new(mesh, color.values.chunks_exact(color.width).map(luma).collect())
    }

    /// Mean curvature (half the sum of the principal ones; positive where the surface is convex), 1 / world unit.
    pub fn mean_curvature(mesh: &TriMesh, adjacency: &Adjacency) -> ScalarField {
        let values = vertex_curvature(mesh, adjacency).iter().map(|c| (c.most + c.least) / 2.0).collect();
        ScalarField { values }
    }

    /// Gaussian curvature (the product of the principal ones), 1 / world unit squared.
    pub fn gaussian_curvature(mesh: &TriMesh, adjacency: &Adjacency) -> ScalarField {
        ScalarField { values: vertex_curvature(mesh, adjacency).iter().map(|c| c.most * c.least).collect() }
    }

    /// The greater of the two principal curvatures by size, 1 / world unit: high along ridges and valleys.
    pub fn maximum_curvature(mesh: &TriMesh, adjacency: &Adjacency) -> ScalarField {
        let values = vertex_curvature(mesh, adjacency).iter().map(|c| c.most.abs().max(c.least.abs())).collect();
        ScalarField { values }
    }

    /// Low and high values turned round: draws to what was low.
    pub fn negated(&self) -> ScalarField {
        ScalarField { values: self.values.iter().map(|s| -s).collect() }
    }

    /// Blended with the neighbours `rounds` times: gives a ribbon of one colour a ridge to be drawn to, and takes
    /// out noise. Reaches about the root of `rounds` edges far.
    pub fn smoothed(&self, mesh: &TriMesh, adjacency: &Adjacency, rounds: usize) -> ScalarField {
        let mut values = self.values.clone();
        for _ in 0..rounds {
            values = (0..values.len() as u32)
                .into_par_iter()
                .map(|v| {
                    if adjacency.outgoing[v as usize] == crate::mesh::NONE {
                        return values[v as usize];
                    }
                    let (sum, count) = neighbours(mesh, adjacency, v)
                        .fold((0.0, 0.0), |(s, n), (w, _)| (s + values[w as usize], n + 1.0));
                    (values[v as usize] + sum / count) / 2.0
                })
                .collect();
        }
        ScalarField { values }
    }

    /// Least and greatest value (of the finite ones).
    pub fn range(&self) -> (f64, f64) {
        let finite = self.values.iter().copied().filter(|s| s.is_finite());
        finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), s| (l.min(s), h.max(s)))
    }

    /// Value at a place.
    pub fn at(&self, mesh: &TriMesh, place: &FacePoint) -> f64 {
        let t = mesh.triangles[place.face as usize];
        (0..3).map(|k| place.bary[k] * self.values[t[k] as usize]).sum()
    }

    /// Gradient at a vertex, in space; only its part along the surface counts.
    /// Source: [K98] §3.8.2 with the weights of the head of this file.
    pub fn vertex_gradient(&self, mesh: &TriMesh, adjacency: &Adjacency, v: u32) -> DVec3 {
        let (p, s) = (mesh.points[v as usize], self.values[v as usize]);
        let (mut sum, mut count) = (DVec3::ZERO, 0.0);
        for (w, _) in neighbours(mesh, adjacency, v) {
            let d = mesh.points[w as usize] - p;
            let square = d.length_squared();
            if square > 0.0 {
                sum += d * ((self.values[w as usize] - s) / square);
                count += 1.0;
            }
        }
        if count > 0.0 { sum * (2.0 / count) } else { DVec3::ZERO }
    }

    /// Gradient at a place, blended from those of the corners of its face.
    pub fn gradient(&self, mesh: &TriMesh, adjacency: &Adjacency, place: &FacePoint) -> DVec3 {
        let t = mesh.triangles[place.face as usize];
        (0..3).map(|k| self.vertex_gradient(mesh, adjacency, t[k]) * place.bary[k]).sum()
    }
}
