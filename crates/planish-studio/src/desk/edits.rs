//! Edits: made at once where they are quick, as jobs where they work on the whole mesh; tried out for previews; and the
//! surfaces that follow them.

use super::Table;
use super::answer::{Answer, with};
use super::beside::other;
use super::jobs::{MEASURE, Outcome};
use super::keep::strokes::follow;
use super::project::{Fit, NO_PROJECT, deviations};
use super::sculpt::SCULPT;
use crate::protocol::state::StageName;
use crate::protocol::{Message, Why};
use crate::web::hub::Client;
use planish::edit::{ApplyError, Edit, Made, apply, preview};
use planish::grid::GridParams;
use planish::mesh::FacePoint;
use planish::model::{Drawing, Model};
use planish::network::Network;
use planish::observe::{Observer, Silent};
use planish::pipeline::{self, Assessed, PipelineObserver, Quality};
use planish::surface::{Resolution, measure_seams};
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

impl<'env> Table<'_, '_, 'env> {
    pub(super) fn edit(&mut self, client: &Client, id: u32, edit: Edit) {
        if takes_long(&edit) && self.project.is_some() && self.ground.is_some() {
            let job = self.start_edit(edit);
            return self.wait_for(client, id, job);
        }
        let Some(project) = self.project else { return self.refuse(client, id, Why::of(NO_PROJECT)) };
        match project.edit(&edit, self.ground, &Silent) {
            Ok(made) => {
                let told = told(&edit, &made);
                self.done(client, id, told);
                self.after_edit();
            }
            Err(refused) => self.refuse(client, id, Why::of(refused)),
        }
    }

    /// The drawing has changed: the file, the surfaces and all pages follow.
    pub(super) fn after_edit(&mut self) {
        self.desk.failed = None;
        if let Some(project) = self.project {
            let curves = project.model.network.curves.len();
            if matches!(&self.desk.resolution, Resolution::PerCurve(list) if list.len() != curves) {
                self.desk.resolution = super::usual_resolution();
            }
        }
        let finished = self.project.as_ref().is_some_and(|p| p.is_finished());
        self.desk.jobs.stop_kind(SCULPT);
        self.desk.jobs.stop_kind("fit");
        self.desk.jobs.stop_kind(MEASURE);
        if finished && self.desk.live {
            // What cannot be fitted is told by the stage.
            let _ = self.fit();
        }
        self.tell_state();
    }

    fn start_edit(&mut self, edit: Edit) -> u32 {
        let (drawing, revision) =
            self.project.as_ref().map_or_else(Default::default, |p| (p.model.drawing(), p.revision));
        let folder = self.project.as_ref().and_then(|p| p.file.parent()).unwrap_or(Path::new("")).to_owned();
        let title = title(&edit);
        let Some(ground) = self.ground else { return 0 };
        self.desk.jobs.start(self.scope, ("edit", title), move |watch| {
            let mut drawing: Drawing = drawing;
            let observer: &dyn Observer = watch;
            let made = apply(&mut drawing, &edit, ground, &|name: &str| other(&folder, name), observer);
            Outcome::Edited(revision, edit, Box::new(made.map(|made| (drawing, made))))
        })
    }

    /// Takes over an edit that a job has made; on a drawing that has changed since it is made again.
    pub(super) fn edited(
        &mut self,
        revision: u64,
        edit: Edit,
        result: Result<(Drawing, Made), ApplyError>,
        asked: &Option<(Client, u32)>,
    ) -> Answer {
        let (Some(project), Some(ground)) = (&mut *self.project, self.ground) else { return Answer::Given };
        if project.revision != revision {
            let job = self.start_edit(edit);
            if let Some((client, id)) = asked {
                self.desk.jobs.asked_by(job, client, *id);
            }
            return Answer::Given;
        }
        let (drawing, made) = match result {
            Ok(made) => made,
            Err(e) => return Answer::Refused(Why::of(e)),
        };
        let told = told(&edit, &made);
        project.take_over(&edit, drawing, made, ground);
        self.after_edit();
        Answer::Done(told)
    }

    pub(super) fn try_out(&mut self, client: &Client, id: u32, edit: Edit) {
        let (Some(project), Some(ground)) = (&*self.project, self.ground) else {
            return self.refuse(client, id, Why::of(NO_PROJECT));
        };
        let tried = preview(&project.model.drawing(), &edit, ground, &|_| Err("is not here".into()), &Silent);
        let (drawing, made) = match tried {
            Ok(tried) => tried,
            Err(e) => return self.refuse(client, id, Why::of(e)),
        };
        let mesh = &project.mesh;
        let course = |points: &[FacePoint]| -> Vec<f32> {
            points.iter().flat_map(|p| p.position(mesh).to_array()).map(|x| x as f32).collect()
        };
        let old = Places::of(&project.model.network);
        let is_new = |c: &&u32| !old.has_course(&drawing.network.curves[**c as usize].points);
        let network = made.curves.iter().filter(is_new).map(|&c| course(&drawing.network.curves[c as usize].points));
        let features = made.features.iter().map(|&f| course(&drawing.sketch.features[f as usize].points));
        let curves = network.chain(features).collect();
        let corner = |c: &u32| drawing.network.corners[*c as usize].place.position(mesh).as_vec3().to_array();
        let corners = made.corners.iter().map(corner).collect();
        self.desk.hub.tell(client, &Message::Tried { id, curves, corners });
    }

    /// Starts to fit surfaces to the curves as they are.
    pub(super) fn fit(&mut self) -> Result<u32, Why> {
        let Some(project) = self.project else { return Err(Why::of(NO_PROJECT)) };
        if !project.is_finished() {
            let why = project
                .faults
                .first()
                .map_or_else(|| "there are no patches yet - hint: draw curves".into(), |f| f.to_string());
            return Err(Why::of(why));
        }
        let (revision, mesh) = (project.revision, Arc::clone(&project.mesh));
        let Model { network, sketch, units, shift, .. } = &project.model;
        let mut model = Model {
            network: network.clone(),
            sketch: sketch.clone(),
            units: *units,
            shift: *shift,
            ..Model::default()
        };
        let coarse = self.desk.coarse;
        let mut params = with(&project.params, &self.desk.resolution);
        if coarse {
            params.grid = coarser(&params.grid);
        }
        model.params = serde_json::to_string(&params).unwrap_or_default();
        // Grids of other parameters cannot be followed.
        let earlier = project.fit.as_ref().filter(|f| f.coarse == coarse).and_then(|f| f.earlier.clone());
        // The new surfaces get the list as it is now.
        self.desk.jobs.stop_kind(SCULPT);
        self.desk.jobs.stop_kind("fit");
        self.desk.jobs.stop_kind(MEASURE);
        let adjacency = self.ground.map(|g| &g.canvas.adjacency);
        let (list, folder) = (if coarse { Vec::new() } else { project.kept.relief.clone() }, project.folder());
        Ok(self.desk.jobs.start(
            self.scope,
            ("fit", if coarse { "Coarse grids" } else { "Fitting surfaces" }),
            move |watch| {
                let observer: &dyn PipelineObserver = watch;
                model.mesh = mesh.as_ref().clone();
                let Some(adjacency) = adjacency else { return Outcome::Fitted(Err(NO_PROJECT.into())) };
                let made = pipeline::remake(&mut model, adjacency, earlier.as_ref(), &params, observer);
                model.mesh = Default::default();
                let mut relief = Vec::new();
                if made.is_ok() {
                    // What cannot be made on these surfaces is tried again, and told, once they are shown.
                    let _ = follow(&mut model, &mut relief, &list, &folder, watch as &dyn Observer);
                }
                let seams = measure_seams(&model.network, &model.surfaces, watch as &dyn Observer);
                Outcome::Fitted(made.map_err(|e| e.to_string()).and_then(|made| {
                    let seams = seams.map_err(|e| e.to_string())?;
                    let (earlier, deviations) = (made.earlier, deviations(&model));
                    let (quality, warnings) = (Quality::new(), Vec::new());
                    let (model, short) = (Arc::new(model), None);
                    Ok(Box::new(Fit {
                        revision,
                        model,
                        earlier,
                        quality,
                        seams,
                        warnings,
                        deviations,
                        coarse,
                        short,
                        relief,
                    }))
                }))
            },
        ))
    }

    /// Starts to measure what was fitted last, where it is of now and not measured yet. It is shown already.
    pub(super) fn measure(&mut self) {
        let Some(project) = self.project else { return };
        let Some(fit) = project.fit.as_ref().filter(|f| f.revision == project.revision && f.quality.is_empty()) else {
            return;
        };
        let (mesh, fitted) = (Arc::clone(&project.mesh), Arc::clone(&fit.model));
        self.desk.jobs.stop_kind(MEASURE);
        self.desk.jobs.start(self.scope, (MEASURE, "Measuring"), move |watch| {
            let model = Model { mesh: mesh.as_ref().clone(), ..fitted.as_ref().clone() };
            Outcome::Measured(pipeline::assess(&model, watch).map(Box::new).map_err(|e| e.to_string()))
        });
    }

    /// Takes over figures of what was fitted last: measuring is stopped before anything else is fitted.
    pub(super) fn measured(&mut self, result: Result<Box<Assessed>, String>) -> Result<(), Why> {
        let Assessed { quality, seams, warnings, .. } = *result.map_err(Why::of)?;
        if let Some(fit) = self.project.as_mut().and_then(|p| p.fit.as_mut()) {
            (fit.quality, fit.seams, fit.warnings) = (quality, seams, warnings);
        }
        Ok(())
    }

    /// Takes over fitted surfaces.
    pub(super) fn fitted(&mut self, result: Result<Box<Fit>, String>) -> Result<(), Why> {
        match result {
            Ok(fit) => {
                self.desk.failed = None;
                self.desk.layers.new_fit();
                if let Some(project) = self.project {
                    project.fitted(*fit);
                }
                if self.follow_list().is_none() {
                    self.measure();
                }
                Ok(())
            }
            Err(why) => {
                self.desk.failed = Some((StageName::Surfaces, why.clone()));
                Err(Why::of(why))
            }
        }
    }
}

/// Grids at which a fit pauses: a quarter of the points along each side, and none made finer where they miss the mesh.
fn coarser(grid: &GridParams) -> GridParams {
    const ALONG: usize = 4;
    let density = grid.density / (ALONG * ALONG) as f64;
    let min_side = ((grid.min_side - 1) / ALONG + 1).max(4);
    GridParams { density, min_side, miss: 1.0, ..grid.clone() }
}

/// All places of the curves of a network. A curve that is divided leaves pieces that are new curves, and nothing new to see.
struct Places(HashSet<(u32, [u64; 3])>);

impl Places {
    fn of(network: &Network) -> Places {
        Places(network.curves.iter().flat_map(|c| &c.points).map(key).collect())
    }

    /// True if a curve runs along curves that were there: its inner places are theirs.
    fn has_course(&self, points: &[FacePoint]) -> bool {
        let inner = points.get(1..points.len().saturating_sub(1)).unwrap_or_default();
        !inner.is_empty() && inner.iter().all(|p| self.0.contains(&key(p)))
    }
}

fn key(place: &FacePoint) -> (u32, [u64; 3]) {
    (place.face, place.bary.map(f64::to_bits))
}

/// Edits that look at the whole mesh.
fn takes_long(edit: &Edit) -> bool {
    match edit {
        Edit::Complete(_) | Edit::Mirror(_) | Edit::Carry(_) => true,
        Edit::Symmetry(symmetry) => symmetry.plane.is_none(),
        Edit::Relax(relax) => relax.curve.is_none(),
        _ => false,
    }
}

fn title(edit: &Edit) -> &'static str {
    match edit {
        Edit::Complete(_) => "Laying out patches",
        Edit::Mirror(_) => "Mirroring",
        Edit::Symmetry(_) => "Looking for the plane of symmetry",
        Edit::Relax(_) => "Relaxing all curves",
        _ => "Carrying a network over",
    }
}

/// What an edit did, in words; nothing where the view shows it.
fn told(edit: &Edit, made: &Made) -> String {
    match (edit, made.changed) {
        (Edit::Undo(_) | Edit::Redo(_), _) => String::new(),
        (_, false) => "Nothing to change.".into(),
        (Edit::Complete(_), _) => format!("{} curves drawn.", made.curves.len()),
        _ => String::new(),
    }
}
