//! Trees of solids and meshes.
//!
//! A part is sampled leaf by leaf (meshes by rasterising, solids point by point) and put together on the directed
//! distances ([`super::csg`], [K01] §3); what has no directed form, an offset of a mesh, is sampled point by point. As a
//! [`Field`] the same tree answers where features of the combination lie.

use super::csg::{self, Operation};
use super::{Directed, Field, FieldError, Lattice, MeshField, Solid, Winding};
use crate::geom::{Aabb, Bvh};
use crate::mesh::{MeshError, TriMesh};
use crate::observe::Observer;
use glam::{DQuat, DVec3};

/// A solid, a mesh, or what is made of such.
pub enum Part {
    /// A solid.
    Solid(Solid),
    /// The inside of a mesh.
    Mesh(Box<MeshBody>),
    /// The first combined with all others in turn.
    Combined(Operation, Vec<Part>),
    /// All points within a distance; a negative one takes away.
    Offset(Box<Part>, f64),
}

/// A mesh that answers point by point: distance to the nearest place, sign by the winding number.
pub struct MeshBody {
    mesh: TriMesh,
    bvh: Bvh,
    winding: Winding,
    bounds: Aabb,
}

impl MeshBody {
    /// A body of a mesh, which may have holes and intersections.
    /// # Errors
    /// [`FieldError::Mesh`] for damaged or empty meshes.
    pub fn new(mesh: TriMesh) -> Result<MeshBody, FieldError> {
        let bounds = MeshField::new(&mesh)?.bounds();
        if !(0..mesh.triangles.len()).any(|t| mesh.area(t) > 0.0) {
            return Err(FieldError::Mesh(MeshError::Empty));
        }
        Ok(MeshBody { bvh: Bvh::new(&mesh), winding: Winding::new(&mesh), bounds, mesh })
    }

    /// The mesh.
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    fn evaluate(&self, p: DVec3) -> (f64, DVec3) {
        let hit = self.bvh.closest(p);
        let sign = if self.winding.number(p) > 0.5 { -1.0 } else { 1.0 };
        let normal = self.mesh.normal(hit.place.face as usize);
        // On the surface the difference has no direction; beside it the normal says the same but on edges.
        let near = hit.distance <= ON_SURFACE * self.bounds.diagonal();
        let out = if near { normal } else { (p - hit.position) / hit.distance * sign };
        (hit.distance * sign, out)
    }
}

/// Nearer than this fraction of the diagonal a point counts as on the surface.
const ON_SURFACE: f64 = 1e-9;

impl Part {
    /// The part scaled, then turned, then moved.
    /// # Errors
    /// [`FieldError::Mesh`] if a mesh does not survive it.
    pub fn placed(self, scale: f64, turn: DQuat, shift: DVec3) -> Result<Part, FieldError> {
        if scale == 1.0 && turn == DQuat::IDENTITY && shift == DVec3::ZERO {
            return Ok(self);
        }
        Ok(match self {
            Part::Solid(solid) => Part::Solid(Solid::Placed { solid: Box::new(solid), scale, turn, shift }),
            Part::Mesh(body) => {
                let mut mesh = body.mesh;
                mesh.points.iter_mut().for_each(|p| *p = turn * (*p * scale) + shift);
                Part::Mesh(Box::new(MeshBody::new(mesh)?))
            }
            Part::Combined(operation, parts) => {
                let parts: Result<Vec<Part>, FieldError> =
                    parts.into_iter().map(|p| p.placed(scale, turn, shift)).collect();
                Part::Combined(operation, parts?)
            }
            Part::Offset(part, distance) => Part::Offset(Box::new(part.placed(scale, turn, shift)?), distance * scale),
        })
    }

    /// Parts combined; solids alone stay one solid, whose features are exact.
    pub fn combined(operation: Operation, parts: Vec<Part>) -> Part {
        if !parts.iter().all(|p| matches!(p, Part::Solid(_))) {
            return Part::Combined(operation, parts);
        }
        let solids = parts.into_iter().filter_map(|p| match p {
            Part::Solid(s) => Some(s),
            _ => None,
        });
        let solids = solids.collect();
        Part::Solid(match operation {
            Operation::Union => Solid::Union(solids),
            Operation::Intersection => Solid::Intersection(solids),
            Operation::Difference => Solid::Difference(solids),
        })
    }

    /// The part with everything within `distance`.
    pub fn offset(self, distance: f64) -> Part {
        match self {
            Part::Solid(solid) => Part::Solid(solid.offset(distance)),
            part => Part::Offset(Box::new(part), distance),
        }
    }

    /// The only mesh, if the part is nothing else.
    pub fn as_mesh(&self) -> Option<&TriMesh> {
        match self {
            Part::Mesh(body) => Some(&body.mesh),
            _ => None,
        }
    }

    /// Samples the part.
    /// # Errors
    /// [`FieldError`] for meshes that cannot be used, or if cancelled.
    pub fn sample(&self, lattice: &Lattice, observer: &dyn Observer) -> Result<Directed, FieldError> {
        match self {
            Part::Mesh(body) => MeshField::new(&body.mesh)?.sample(lattice, observer),
            Part::Combined(operation, parts) => {
                let mut all: Option<Directed> = None;
                for part in parts {
                    let one = part.sample(lattice, observer)?;
                    all = Some(match all {
                        Some(all) => csg::combine(&all, &one, *operation),
                        None => one,
                    });
                }
                all.ok_or(FieldError::Mesh(MeshError::Empty))
            }
            Part::Solid(_) | Part::Offset(..) => super::sample(self, lattice, observer),
        }
    }

    fn evaluate(&self, p: DVec3) -> (f64, DVec3) {
        match self {
            Part::Solid(solid) => solid.evaluate(p),
            Part::Mesh(body) => body.evaluate(p),
            Part::Offset(part, distance) => {
                let (d, g) = part.evaluate(p);
                (d - distance, g)
            }
            Part::Combined(operation, parts) => {
                let mut best: Option<(f64, DVec3)> = None;
                for (n, part) in parts.iter().enumerate() {
                    let (mut d, mut g) = part.evaluate(p);
                    if *operation == Operation::Difference && n > 0 {
                        (d, g) = (-d, -g);
                    }
                    let better = |b: f64| if *operation == Operation::Union { d < b } else { d > b };
                    if best.is_none_or(|b| better(b.0)) {
                        best = Some((d, g));
                    }
                }
                best.unwrap_or((f64::INFINITY, DVec3::ZERO))
            }
        }
    }

    fn interval(&self, aabb: &Aabb) -> [f64; 2] {
        match self {
            Part::Solid(solid) => solid.interval(aabb),
            Part::Offset(part, distance) => part.interval(aabb).map(|v| v - distance),
            Part::Mesh(body) => {
                let d = body.evaluate(aabb.center()).0;
                let reach = aabb.diagonal() / 2.0;
                // Through a gap the sign changes without the distance being small: nothing is promised near one.
                if d.abs() > reach && !body.winding.crosses(aabb) { [d - reach, d + reach] } else { [-reach, reach] }
            }
            Part::Combined(operation, parts) => {
                let mut all: Option<[f64; 2]> = None;
                for (n, part) in parts.iter().enumerate() {
                    let [a, b] = part.interval(aabb);
                    let own = if *operation == Operation::Difference && n > 0 { [-b, -a] } else { [a, b] };
                    all = Some(match (all, operation) {
                        (None, _) => own,
                        (Some(x), Operation::Union) => [x[0].min(own[0]), x[1].min(own[1])],
                        (Some(x), _) => [x[0].max(own[0]), x[1].max(own[1])],
                    });
                }
                all.unwrap_or([f64::INFINITY; 2])
            }
        }
    }
}

impl Field for Part {
    fn bounds(&self) -> Aabb {
        match self {
            Part::Solid(solid) => solid.bounding_box(),
            Part::Mesh(body) => body.bounds,
            Part::Offset(part, distance) => {
                let b = part.bounds();
                Aabb { min: b.min - *distance, max: b.max + *distance }
            }
            Part::Combined(operation, parts) => {
                let mut boxes = parts.iter().map(Part::bounds);
                let first = boxes.next().unwrap_or(Aabb::EMPTY);
                match operation {
                    Operation::Difference => first,
                    Operation::Union => boxes.fold(first, |a, b| Aabb { min: a.min.min(b.min), max: a.max.max(b.max) }),
                    Operation::Intersection => {
                        boxes.fold(first, |a, b| Aabb { min: a.min.max(b.min), max: a.max.min(b.max) })
                    }
                }
            }
        }
    }

    fn value(&self, p: DVec3) -> f64 {
        self.evaluate(p).0
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        self.evaluate(p).1
    }

    fn crosses(&self, aabb: &Aabb) -> bool {
        let [low, high] = self.interval(aabb);
        low < 0.0 && high >= 0.0
    }
}
