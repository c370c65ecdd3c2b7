//! The objects that many stages make and take: meshes, curves, networks, models. Their methods are in a file for each.

use crate::error::class;
use planish::DVec3;
use planish::Units;
use planish::contour;
use planish::curve::SurfaceCurve;
use planish::geom::{Bvh, FacePoint};
use planish::mesh::{Adjacency, FeatureTags, TriMesh};
use planish::model::{HistoryEntry, Model};
use planish::network::{Network, PatchMesh};
use planish::pipeline::{Assessed, Fitted, PipelineParams};
use pyo3::prelude::*;
use serde_json::{Value, json};
use std::sync::{Arc, OnceLock};

/// A mesh with what is made of it once and then shared.
#[derive(Default)]
pub struct Body {
    /// The mesh.
    pub mesh: TriMesh,
    /// Its features, where they are known.
    pub tags: Option<FeatureTags>,
    adjacency: OnceLock<Adjacency>,
    bvh: OnceLock<Bvh>,
}

impl Body {
    /// A mesh whose indices have been checked.
    pub fn new(mesh: TriMesh, tags: Option<FeatureTags>) -> Arc<Body> {
        Arc::new(Body { mesh, tags, ..Body::default() })
    }

    /// Its neighbourhoods.
    pub fn adjacency(&self) -> &Adjacency {
        self.adjacency.get_or_init(|| Adjacency::new(&self.mesh))
    }

    /// Its tree of boxes.
    pub fn bvh(&self) -> &Bvh {
        self.bvh.get_or_init(|| Bvh::new(&self.mesh))
    }

    /// The place nearest to a position.
    pub fn place(&self, position: DVec3) -> FacePoint {
        self.bvh().closest(position).place
    }
}

/// A triangle mesh: flat arrays, named quantities per vertex, sharp edges where they are known.
///
/// Mesh(points, triangles, *, attributes=None, feature_edges=None)
///
/// * points: (n, 3) float64, world units. Copied once: a mesh never changes, and other threads may change your array.
/// * triangles: (m, 3) integers, vertex indices counter-clockwise seen from outside.
/// * attributes: dict of (n,) or (n, width) float32, such as "color" (3 or 4 columns, 0 to 1).
/// * feature_edges: (k, 2) integers, edges that are sharp whatever their angle.
///
/// Raises TypeError and ValueError that name the argument and the first entry that is wrong.
#[pyclass(frozen, module = "planish", name = "Mesh")]
pub struct PyMesh {
    /// The mesh.
    pub body: Arc<Body>,
    /// What the stage that made it tells.
    pub facts: Value,
}

impl PyMesh {
    /// A mesh with what the stage that made it tells.
    pub fn new(mesh: TriMesh, tags: Option<FeatureTags>, facts: Value) -> PyMesh {
        PyMesh { body: Body::new(mesh, tags), facts }
    }

    /// A mesh that others share.
    pub fn shared(body: Arc<Body>) -> PyMesh {
        PyMesh { body, facts: json!({}) }
    }

    /// What extraction made, with its figures.
    pub fn meshed(made: contour::Meshed, more: Value) -> PyMesh {
        let counts = made.extracted.counts;
        let mut facts = json!({
            "voxel": made.lattice.step.x, "lattice": made.lattice.cells, "cells": counts.cells,
            "fallback_cells": counts.fallbacks, "pushed_cells": counts.pushed, "clamped_features": counts.kept,
            "mended_hits": made.mended, "thin_edges": made.thin.edges, "thin_width": made.thin.width,
        });
        if let (Some(facts), Value::Object(more)) = (facts.as_object_mut(), more) {
            facts.extend(more);
        }
        PyMesh::new(made.extracted.mesh, Some(made.extracted.tags), facts)
    }
}

/// A curve on a mesh: a chain of face points.
///
/// Curve(mesh, faces, bary, *, closed=False)
///
/// * faces: (n,) triangle of each point; bary: (n, 3) weights of its corners, from 0 to 1, that sum to 1
///
/// Mostly made by `Mesh.geodesic`, `paint`, `section`, `boundaries`, `sharp_lines`.
#[pyclass(frozen, module = "planish", name = "Curve")]
pub struct PyCurve {
    /// The mesh that it lies on.
    pub body: Arc<Body>,
    /// The curve.
    pub curve: SurfaceCurve,
    /// What the stage that made it tells.
    pub facts: Value,
}

impl PyCurve {
    /// A curve on a mesh.
    pub fn new(body: Arc<Body>, curve: SurfaceCurve) -> PyCurve {
        PyCurve { body, curve, facts: json!({}) }
    }
}

/// A network of corners, curves and four-sided patches on a mesh.
///
/// Made by `Mesh.layout`, `Network.read`, `Network.from_json`, or drawn by `Model.edit`.
#[pyclass(frozen, module = "planish", name = "Network")]
pub struct PyNetwork {
    /// The mesh that it lies on.
    pub body: Arc<Body>,
    /// The network.
    pub network: Network,
    /// What the stage that made it tells.
    pub facts: Value,
    /// Its patches, once some of them were relaxed.
    pub patches: OnceLock<Vec<PatchMesh>>,
}

impl PyNetwork {
    /// A network on a mesh.
    pub fn new(body: Arc<Body>, network: Network, facts: Value) -> PyNetwork {
        PyNetwork { body, network, facts, patches: OnceLock::new() }
    }
}

/// A model: mesh, network, grids, surfaces, reliefs and history; the content of one project file.
///
/// Made by `Mesh.fit`, `Network.fit`, `Cloud.fit`, `Mesh.model` and `planish.read`. A model never changes: edits and fits
/// return another one.
#[pyclass(frozen, module = "planish", name = "Model")]
pub struct PyModel {
    /// The model.
    pub model: Model,
    /// What is known of it.
    pub found: Found,
    /// Its mesh, once it was asked for.
    pub body: OnceLock<Arc<Body>>,
}

/// What the stages that made a model tell; empty for one that was read.
#[derive(Clone, Default)]
pub struct Found {
    /// Figures of quality.
    pub quality: Value,
    /// How the patches meet.
    pub seams: Value,
    /// What a user should know.
    pub warnings: Value,
    /// The stages that ran.
    pub stages: Value,
    /// What the last edit did.
    pub edit: Value,
}

impl PyModel {
    /// A model of which nothing more is known.
    pub fn new(model: Model) -> PyModel {
        let (quality, seams, warnings, stages, edit) = (json!({}), json!([]), json!([]), json!([]), json!({}));
        PyModel { model, found: Found { quality, seams, warnings, stages, edit }, body: OnceLock::new() }
    }

    /// A model that was fitted anew.
    pub fn fitted(fitted: Fitted, params: &PipelineParams, units: Units) -> PyResult<PyModel> {
        let Fitted { mut model, stages, quality, seams, warnings } = fitted;
        model.units = units;
        recorded(&mut model, "fit", params)?;
        Ok(PyModel::new(model).with(Assessed { stages, quality, seams, warnings }))
    }

    /// With what was found of it.
    pub fn with(mut self, found: Assessed) -> PyModel {
        self.found.quality = json!(found.quality);
        self.found.seams = json!(found.seams);
        self.found.warnings = json!(found.warnings);
        self.found.stages = json!(found.stages);
        self
    }
}

/// Puts a fit into the model's history.
pub fn recorded(model: &mut Model, command: &str, params: &PipelineParams) -> PyResult<()> {
    let wrong = |e: serde_json::Error| class::InternalError::new_err(e.to_string());
    model.params = serde_json::to_string(params).map_err(wrong)?;
    model.history.push(HistoryEntry { command: command.into(), parameters: model.params.clone() });
    Ok(())
}
