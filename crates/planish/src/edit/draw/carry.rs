//! Carries the network of another shape over, by landmarks on both.
//!
//! `crate::curve::carry` after Duchon 1977; corners go to the nearest places, curves relax between them ([K98] §3.5).

use crate::curve::SurfaceCurve;
use crate::curve::carry::{LandmarkMap, carry_curve, carry_place};
use crate::curve::connect;
use crate::edit::check;
use crate::edit::work::Work;
use crate::edit::{ApplyError, Command, Ground};
use crate::mesh::{Adjacency, TriMesh, sharp_edges};
use crate::network::{Corner, Curve, CurveKind, Network};
use crate::observe::Observer;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Carries the network of another model over, by landmarks on both.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Carry {
    /// The other model, as the script names it.
    pub from: String,
    /// Positions on it with those on this one.
    pub landmarks: Vec<[[f64; 3]; 2]>,
}

impl Command for Carry {
    fn check(&self) -> Result<(), ApplyError> {
        self.landmarks.iter().flatten().try_for_each(|p| check::finite("a landmark", p))
    }

    fn apply(&self, work: &mut Work) -> Result<(), ApplyError> {
        let refused = |what| ApplyError::Other { name: self.from.clone(), what };
        let (other, drawing) = (work.others)(&self.from).map_err(refused)?;
        let [a, b] = [0, 1].map(|k| self.landmarks.iter().map(|l| DVec3::from_array(l[k])).collect::<Vec<_>>());
        let map = LandmarkMap::new(&a, &b)?;
        work.drawing.network = carry_network(&map, &other, &drawing.network, work.ground, work.observer)?;
        Ok(())
    }
}

/// Sharp edges of the mesh for a curve carried to one, degrees.
const SHARP_DEG: f64 = 40.0;

/// Carries a network of another mesh of the same class of shapes over: corners to the nearest places of where the map
/// takes them, curves relaxed between them. Lines along sharp edges and boundaries are carried as smooth curves where
/// the mesh has none there.
/// # Errors
/// `Curve` if a curve cannot be drawn; `Cancelled`.
pub fn carry_network(
    map: &LandmarkMap,
    from: &TriMesh,
    network: &Network,
    ground: &Ground,
    observer: &dyn Observer,
) -> Result<Network, ApplyError> {
    let (mesh, adjacency, bvh) = (ground.canvas.mesh, &ground.canvas.adjacency, &ground.bvh);
    let mut out = Network { patches: network.patches.clone(), ..Network::default() };
    out.corners = network.corners.iter().map(|c| Corner { place: carry_place(map, from, bvh, &c.place) }).collect();
    let sharp = sharp_edges(mesh, adjacency, SHARP_DEG);
    for (k, curve) in network.curves.iter().enumerate() {
        observer.check()?;
        observer.progress(k as f64 / network.curves.len() as f64);
        let ends = curve.corners.map(|c| out.corners[c as usize].place);
        let open = SurfaceCurve::open(curve.points.clone());
        let even = open.resampled(from, &Adjacency::new(from), curve.points.len().clamp(9, 400))?;
        let carried = carry_curve(map, from, (mesh, adjacency, bvh), &even, Some(ends), observer)?;
        let points = carried.trace(mesh, adjacency)?;
        let on_edges = points.windows(2).all(|w| {
            let way = connect(mesh, adjacency, w[0], w[1]);
            way.is_ok_and(|_| (0..3).any(|k| w[0].bary[k] == 0.0 && sharp[3 * w[0].face as usize + (k + 1) % 3]))
        });
        let kind = if on_edges { curve.kind } else { CurveKind::Smooth };
        out.curves.push(Curve { corners: curve.corners, kind, points });
    }
    Ok(out)
}
