//! From points to a mesh, by hand: what is known of the points, and requests for the steps of `preparation`.

use super::Table;
use super::answer::Answer;
use super::beside::Known;
use super::content::Content;
use super::jobs::{Outcome, Prepared};
use super::keep::lasso::Lasso;
use super::keep::preparation::{Basis, NO_SCAN, PrepStep, Preparation, count_left_out};
use super::project::{NO_PROJECT, Project};
use crate::protocol::state::StageName;
use crate::protocol::{Why, state};
use crate::web::hub::Client;
use planish::cloud::{self, CleanParams, Cloud, ProjectParams};
use planish::edit::{Edit, Redo, Undo};
use planish::field::Spacing;
use planish::mesh::{Adjacency, TriMesh, boundary_loops, next};
use planish::observe::Observer;
use std::sync::Arc;

/// Holes that are told at most.
const MOST_HOLES: usize = 50;
const HAS_EDITS: &str = "curves are drawn on the mesh that is there - hint: take them back first";
const HAS_MESH: &str = "the mesh is made already - hint: take it back first";

fn know(scan: &Cloud, observer: &dyn Observer) -> Result<Known, String> {
    let params = CleanParams::default();
    let samples = cloud::clean(scan, &params, observer).map_err(|e| e.to_string())?;
    let all = ProjectParams { spacing: 0.0, outliers: true };
    let found = cloud::project(scan, &samples, params.outlier, &all, observer).map_err(|e| e.to_string())?;
    Ok(Known { samples, cloud: found.cloud, outliers: found.facts.outliers })
}

impl<'env> Table<'_, '_, 'env> {
    /// Looks at the points of the scan.
    pub(super) fn clean(&mut self, client: &Client, id: u32) {
        let Some(scan) = self.project.as_ref().and_then(|p| p.scan.clone()) else {
            return self.refuse(client, id, Why::of(NO_SCAN));
        };
        let job = self.desk.jobs.start(self.scope, ("clean", "Looking at the points"), move |watch| {
            let observer: &dyn Observer = watch;
            Outcome::Cleaned(know(&scan, observer).map(Arc::new))
        });
        self.wait_for(client, id, job);
    }

    /// Makes a mesh of the scan.
    pub(super) fn mesh(&mut self, client: &Client, id: u32, close: Option<bool>, cells: Option<Spacing>) {
        self.step(client, id, "Making a mesh of the scan", |project| {
            let has_scan = project.scan.is_some() || project.kept.preparation.scan.is_some();
            if has_scan { Ok(PrepStep::Mesh { close, cells }) } else { Err(NO_SCAN) }
        });
    }

    /// Leaves points out.
    /// * `lasso` - its places are relative to what geometry is sent relative to
    pub(super) fn lasso(&mut self, client: &Client, id: u32, mut lasso: Lasso) {
        self.step(client, id, "Leaving points out", |project| match &project.scan {
            None => Err(NO_SCAN),
            Some(_) if !project.mesh.triangles.is_empty() => Err(HAS_MESH),
            Some(_) => {
                lasso.middle = super::layers::center(project).to_array();
                Ok(PrepStep::LeaveOut(lasso))
            }
        });
    }

    /// Closes one hole.
    pub(super) fn close_hole(&mut self, client: &Client, id: u32, hole: u32) {
        self.step(client, id, "Closing a hole", |project| {
            let hole = project.holes.get(hole as usize).ok_or("there is no such hole")?;
            let before = [project.mesh.points.len(), project.mesh.triangles.len()];
            Ok(PrepStep::CloseHole { place: hole.place, before })
        });
    }

    /// Makes another step, where no edits stand on what it changes.
    fn step(
        &mut self,
        client: &Client,
        id: u32,
        title: &'static str,
        step: impl FnOnce(&Project) -> Result<PrepStep, &'static str>,
    ) {
        let Some(project) = &*self.project else { return self.refuse(client, id, Why::of(NO_PROJECT)) };
        if project.has_edits() {
            return self.refuse(client, id, Why::of(HAS_EDITS));
        }
        match step(project) {
            Ok(step) => {
                let to = project.kept.preparation.with(step);
                self.prepare(client, id, title, to, 0);
            }
            Err(why) => self.refuse(client, id, Why::of(why)),
        }
    }

    /// Takes steps back, or makes them again, where an undo or redo goes farther than the edits do. False if it does not.
    pub(super) fn walk(&mut self, client: &Client, id: u32, edit: &Edit) -> bool {
        let (Some(project), ground) = (&mut *self.project, self.ground) else { return false };
        let Preparation { done, undone, .. } = &project.kept.preparation;
        let (done, undone, edits) = (done.len(), undone.len(), project.model.undo.len());
        match *edit {
            // A network that no edit has drawn is of a command: it stays on its mesh.
            Edit::Undo(Undo { count }) if count > edits && done > 0 && !project.is_drawn_by_others() => {
                if edits > 0
                    && let Err(why) = project.edit(&Edit::Undo(Undo { count: edits }), ground, &planish::Silent)
                {
                    self.refuse(client, id, Why::of(why));
                    return true;
                }
                let to = project.kept.preparation.at(done.saturating_sub(count - edits));
                let to = Preparation { ahead: project.ahead(), ..to };
                if edits > 0 {
                    self.after_edit();
                }
                self.prepare(client, id, "Going back", to, 0);
                true
            }
            Edit::Redo(Redo { count }) if undone > 0 => {
                let to = project.kept.preparation.at(done + count);
                self.prepare(client, id, "Going on", to, count.saturating_sub(undone));
                true
            }
            _ => false,
        }
    }

    /// Goes to other steps, as a job.
    /// * `then` - edits that are made again after them
    fn prepare(&mut self, client: &Client, id: u32, title: &'static str, to: Preparation, then: usize) {
        let Some(project) = &*self.project else { return };
        let (from, basis) = (project.kept.preparation.clone(), project.basis());
        let job = self.desk.jobs.start(self.scope, ("mesh", title), move |watch| {
            let observer: &dyn Observer = watch;
            let left_out = |basis: &Basis| count_left_out(basis.scan.as_ref(), &basis.left_out);
            let before = left_out(&basis);
            Outcome::Prepared(match basis.walk(&from, &to, observer) {
                Ok(basis) => {
                    let gone = left_out(&basis).saturating_sub(before);
                    let s = if gone == 1 { "" } else { "s" };
                    let told = if gone > 0 { format!("{gone} point{s} left out.") } else { String::new() };
                    Ok(Box::new(Prepared { basis, from, to, then, told }))
                }
                Err(why) => {
                    let stage = match to.done.last() {
                        Some(PrepStep::LeaveOut(_)) | None => StageName::Scan,
                        _ => StageName::Mesh,
                    };
                    Err((stage, why))
                }
            })
        });
        self.wait_for(client, id, job);
    }

    /// Takes over what steps have made.
    pub(super) fn prepared(&mut self, result: Result<Box<Prepared>, (StageName, String)>) -> (Answer, Option<Content>) {
        let made = match result {
            Ok(made) => *made,
            Err((stage, why)) => {
                if stage == StageName::Mesh {
                    self.desk.failed = Some((stage, why.clone()));
                }
                return (Answer::Refused(Why::of(why)), None);
            }
        };
        let is_of_now = |p: &mut Project| p.kept.preparation == made.from && !p.has_edits();
        match self.project.take_if(is_of_now) {
            Some(project) => {
                let next = Content::Project(Box::new(project.prepared(made.basis, made.to, made.then)));
                (Answer::Done(made.told), Some(next))
            }
            None => (Answer::Refused(Why::of("something else was changed in the meantime")), None),
        }
    }
}

/// Holes of a mesh, the longest first.
pub fn holes(mesh: &TriMesh, adjacency: &Adjacency) -> Vec<state::Hole> {
    let at = |h: u32| mesh.points[mesh.origin(h) as usize];
    let hole = |around: &Vec<u32>| state::Hole {
        around: around.iter().map(|&h| at(h).distance(at(next(h)))).sum(),
        place: at(around[0]).to_array(),
    };
    let mut found: Vec<state::Hole> = boundary_loops(adjacency).iter().map(hole).collect();
    found.sort_by(|a, b| b.around.total_cmp(&a.around));
    found.truncate(MOST_HOLES);
    found
}

impl Project {
    /// Looks for holes, while they can be closed.
    pub(super) fn look_for_holes(&mut self, adjacency: &Adjacency) {
        self.holes = if self.model.network.curves.is_empty() { holes(&self.mesh, adjacency) } else { Vec::new() };
    }
}
