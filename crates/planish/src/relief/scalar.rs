//! Reliefs seen as one number per node, and where they fold the surface over.
//!
//! [K98] Krishnamurthy, *Fitting Smooth Surfaces to Dense Polygon Meshes*, §7.3: the two scalar maps.

use super::{Relief, ReliefError, bake::check};
use crate::surface::basis::uniform_parameters;
use crate::surface::{Jet, Surface};

/// Displacement along the normal at every node, world units ([K98] §7.3, second kind).
pub fn normal_component(relief: &Relief) -> Vec<f64> {
    relief.vectors.iter().map(|d| d.z).collect()
}

/// Length of the displacement at every node, world units ([K98] §7.3, first kind).
pub fn length(relief: &Relief) -> Vec<f64> {
    relief.vectors.iter().map(|d| d.length()).collect()
}

/// Indices of the nodes that are displaced to a focal point of the surface or beyond, where neighbouring normals
/// cross and the displaced surface may fold over: `n k >= 1` for a principal curvature `k` by the normal.
///
/// # Errors
/// [`ReliefError::Shape`] if the relief's vectors are not `rows * cols`, [`ReliefError::Surface`] if the surface is malformed.
pub fn fold_over(surface: &Surface, relief: &Relief) -> Result<Vec<usize>, ReliefError> {
    let Relief { rows, cols, ref vectors } = *relief;
    check(rows, cols, vectors.len())?;
    surface.check()?;
    let (us, vs) = (uniform_parameters(cols), uniform_parameters(rows));
    let [u, v, uu, uv, vv] = [[1, 0], [0, 1], [2, 0], [1, 1], [0, 2]].map(|order| surface.sample(&us, &vs, order));
    let folds = |i: usize| {
        let jet = Jet { u: u[i], v: v[i], uu: uu[i], uv: uv[i], vv: vv[i], ..Jet::default() };
        jet.curvatures().is_some_and(|k| k.iter().any(|k| k * vectors[i].z >= 1.0))
    };
    Ok((0..vectors.len()).filter(|&i| folds(i)).collect())
}
