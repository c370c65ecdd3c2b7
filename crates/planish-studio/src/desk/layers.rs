//! Geometry for pages: made when it is asked for the first time, kept while it is of what is there, named so that a page
//! that has it need not ask.

use super::project::Project;
use super::{Letter, Table, tessellate};
use crate::protocol::frame::Arrays;
use crate::protocol::{Layer, Why};
use crate::web::hub::{Client, Hub};
use axum::body::Bytes;
use planish::DVec3;
use std::collections::BTreeMap;

/// A mesh of more triangles has one of fewer that is shown while the view moves.
const MANY_TRIANGLES: usize = 150_000;

/// Geometry that was asked for.
#[derive(Default)]
pub struct Layers {
    /// Counts what came onto the desk, and what was fitted.
    content: u64,
    fit: u64,
    points: u64,
    relief: u64,
    peer: u64,
    kept: BTreeMap<Layer, (String, Vec<Bytes>)>,
    waiting: BTreeMap<Layer, (String, Vec<Client>)>,
}

impl Layers {
    /// Something else is on the desk.
    pub fn new_content(&mut self) {
        self.content += 1;
        self.kept.clear();
        self.waiting.clear();
    }

    /// Surfaces were fitted.
    pub fn new_fit(&mut self) {
        self.fit += 1;
    }

    /// Points were left out, taken in or looked at.
    pub fn new_points(&mut self) {
        self.points += 1;
    }

    /// Other waves of the reliefs are shown.
    pub fn new_relief(&mut self) {
        self.relief += 1;
    }

    /// Another project is looked at.
    pub fn new_peer(&mut self) {
        self.peer += 1;
    }

    /// Names of all geometry that there is.
    pub fn names(&self, project: &Project) -> BTreeMap<Layer, String> {
        let (content, fit, revision) = (self.content, self.fit, project.revision);
        let mut names = BTreeMap::new();
        if project.scan.is_some() {
            names.insert(Layer::Points, format!("points-{content}-{}", self.points));
        }
        if !project.mesh.triangles.is_empty() {
            names.insert(Layer::Mesh, format!("mesh-{content}"));
            names.insert(Layer::Curves, format!("curves-{content}-{revision}"));
        }
        if project.mesh.triangles.len() > MANY_TRIANGLES {
            names.insert(Layer::Coarse, format!("coarse-{content}"));
        }
        if !project.model.sketch.features.is_empty() {
            names.insert(Layer::Features, format!("features-{content}-{revision}"));
        }
        if project.fit.is_some() {
            for (layer, name) in [(Layer::Surfaces, "surfaces"), (Layer::Isolines, "isolines"), (Layer::Nets, "nets")] {
                names.insert(layer, format!("{name}-{content}-{fit}"));
            }
            names.insert(Layer::Displaced, format!("displaced-{content}-{fit}-{}", self.relief));
        }
        if project.peer.is_some() {
            names.insert(Layer::Peer, format!("peer-{content}-{}", self.peer));
        }
        names
    }

    /// Geometry is ready: those who wait for it get it.
    pub fn built(&mut self, hub: &Hub, layer: Layer, name: &str, frames: Vec<Bytes>) {
        if let Some((wanted, clients)) = self.waiting.get(&layer)
            && wanted == name
        {
            clients.iter().for_each(|client| hub.send(client, &frames));
            self.waiting.remove(&layer);
        }
        self.kept.insert(layer, (name.into(), frames));
    }
}

impl<'env> Table<'_, '_, 'env> {
    /// Sends geometry, as soon as it is ready.
    pub(super) fn geometry(&mut self, client: &Client, id: u32, layer: Layer) {
        let name = self.project.as_ref().and_then(|p| self.desk.layers.names(p).remove(&layer));
        let (Some(project), Some(name)) = (&*self.project, name) else {
            return self.refuse(client, id, Why::of("there is nothing of this kind yet"));
        };
        self.done(client, id, String::new());
        let layers = &mut self.desk.layers;
        if let Some((kept, frames)) = layers.kept.get(&layer)
            && *kept == name
        {
            return self.desk.hub.send(client, frames);
        }
        if let Some((wanted, clients)) = layers.waiting.get_mut(&layer)
            && *wanted == name
        {
            return clients.push(client.clone());
        }
        layers.waiting.insert(layer, (name.clone(), vec![client.clone()]));
        let work = builder(project, layer);
        let post = self.desk.post.clone();
        self.scope.spawn(move || {
            let frames = work().frames(layer, &name);
            let _ = post.send(Letter::Built(layer, name, frames));
        });
    }
}

/// What makes the arrays of a layer, with what it needs.
fn builder(project: &Project, layer: Layer) -> Box<dyn FnOnce() -> Arrays + Send> {
    let center = center(project);
    let (mesh, scan) = (project.mesh.clone(), project.scan.clone());
    let drawing = matches!(layer, Layer::Curves | Layer::Features).then(|| project.model.drawing());
    let short = project.fit.as_ref().and_then(|f| f.short.clone());
    let (known, peer) = (project.known.clone(), project.peer.clone().filter(|_| layer == Layer::Peer));
    let fit = project.fit.as_ref().map(|f| f.model.clone());
    Box::new(move || match (layer, drawing, fit) {
        (Layer::Points, ..) => {
            scan.map(|scan| tessellate::points(&scan, known.as_ref().map(|k| &k.cloud), center)).unwrap_or_default()
        }
        (Layer::Mesh, ..) => tessellate::mesh(&mesh, center, true),
        (Layer::Coarse, ..) => tessellate::coarse(&mesh, center),
        (Layer::Curves, Some(drawing), _) => {
            tessellate::courses(&mesh, center, drawing.network.curves.iter().map(|c| &c.points[..]))
        }
        (Layer::Features, Some(drawing), _) => {
            tessellate::courses(&mesh, center, drawing.sketch.features.iter().map(|f| &f.points[..]))
        }
        (Layer::Surfaces, _, Some(model)) => tessellate::surfaces(&model, center),
        (Layer::Displaced, _, Some(model)) => {
            // Without edits it goes back to the grids, exactly.
            let edited = (!model.layers.stack.is_empty()).then_some(&model.reliefs[..]);
            tessellate::displaced(&model, short.as_ref().map(|s| &s.maps[..]).or(edited), center)
        }
        (Layer::Isolines, _, Some(model)) => tessellate::isolines(&model, center),
        (Layer::Nets, _, Some(model)) => tessellate::nets(&model, center),
        (Layer::Peer, ..) => {
            peer.map(|p| tessellate::mesh(&p.mesh, p.mesh.bounds().center(), false)).unwrap_or_default()
        }
        _ => Arrays::default(),
    })
}

/// What geometry of a project is sent relative to: the middle of its box.
pub fn center(project: &Project) -> DVec3 {
    match &project.scan {
        // It stays where it is while points are left out.
        Some(scan) if project.mesh.triangles.is_empty() => project.left_out.first().unwrap_or(scan).bounds().center(),
        _ => project.mesh.bounds().center(),
    }
}
