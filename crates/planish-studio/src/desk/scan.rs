//! From points to a mesh, by hand: what is known of the points, points left out, holes closed one by one.

use super::Table;
use super::beside::Known;
use super::content::Content;
use super::jobs::Outcome;
use super::project::{NO_PROJECT, Project};
use crate::protocol::{Why, state};
use crate::web::hub::Client;
use planish::DVec3;
use planish::cloud::{self, CleanParams, Cloud, ProjectParams};
use planish::field::Spacing;
use planish::geom::is_positive;
use planish::mend;
use planish::mesh::{Adjacency, FeatureTags, TriMesh, boundary_loops, next};
use planish::observe::Observer;
use planish::pipeline::{self, ScanParams};
use std::sync::Arc;

/// Holes that are told at most.
const MOST_HOLES: usize = 50;
const NO_SCAN: &str = "there is no scan here - hint: drop one on the page";
const HAS_CURVES: &str =
    "curves are drawn on the mesh that is there - hint: put the project away and open the scan again";

fn know(scan: &Cloud, observer: &dyn Observer) -> Result<Known, String> {
    let params = CleanParams::default();
    let samples = cloud::clean(scan, &params, observer).map_err(|e| e.to_string())?;
    let all = ProjectParams { spacing: 0.0, outliers: true };
    let found = cloud::project(scan, &samples, params.outlier, &all, observer).map_err(|e| e.to_string())?;
    Ok(Known { samples, cloud: found.cloud, outliers: found.outliers })
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
        let Some(project) = &*self.project else { return self.refuse(client, id, Why::of(NO_PROJECT)) };
        let Some(scan) = project.scan.clone() else { return self.refuse(client, id, Why::of(NO_SCAN)) };
        if !project.model.network.curves.is_empty() {
            return self.refuse(client, id, Why::of(HAS_CURVES));
        }
        let known = project.known.clone();
        let params = ScanParams { close, cells, ..ScanParams::default() };
        let job = self.desk.jobs.start(self.scope, ("mesh", "Making a mesh of the scan"), move |watch| {
            let observer: &dyn Observer = watch;
            let made = match &known {
                Some(known) => pipeline::mesh_samples(&scan, known.samples.clone(), &params, observer),
                None => pipeline::mesh_scan(&scan, &params, observer),
            };
            let made = made.map_err(|e| e.to_string()).and_then(|made| {
                let suited = pipeline::params_for(&made);
                let (mesh, _) = mend::repair(&made.meshed.extracted.mesh, observer).map_err(|e| e.to_string())?;
                Ok(Box::new((mesh, Some(suited))))
            });
            Outcome::Meshed(made)
        });
        self.wait_for(client, id, job);
    }

    /// Leaves points out.
    pub(super) fn lasso(&mut self, client: &Client, id: u32, lasso: &Lasso) {
        let Some(project) = &mut *self.project else { return self.refuse(client, id, Why::of(NO_PROJECT)) };
        let Some(scan) = &project.scan else { return self.refuse(client, id, Why::of(NO_SCAN)) };
        if !project.mesh.triangles.is_empty() {
            let why = "the mesh is made already - hint: put the project away and open the scan again";
            return self.refuse(client, id, Why::of(why));
        }
        let center = scan.bounds().center();
        let inside = |p: &DVec3| lasso.holds((*p - project.middle.unwrap_or(center)).to_array());
        let keep: Vec<u32> =
            (0..scan.points.len() as u32).filter(|&k| inside(&scan.points[k as usize]) == lasso.outside).collect();
        let gone = scan.points.len() - keep.len();
        if gone == 0 || keep.is_empty() {
            let why = if gone == 0 { "no points lie there" } else { "no points would be left" };
            return self.refuse(client, id, Why::of(why));
        }
        let less = Arc::new(scan.select(&keep));
        // Geometry stays relative to the middle that it was sent with.
        project.middle.get_or_insert(center);
        let before = project.scan.replace(less);
        project.left_out.extend(before);
        self.points_changed();
        self.done(client, id, format!("{gone} point{} left out.", if gone == 1 { "" } else { "s" }));
        self.tell_state();
    }

    /// Takes points in again.
    pub(super) fn take_in(&mut self, client: &Client, id: u32, all: bool) {
        let Some(project) = &mut *self.project else { return self.refuse(client, id, Why::of(NO_PROJECT)) };
        let back = if all { project.left_out.drain(..).next() } else { project.left_out.pop() };
        let Some(back) = back else { return self.refuse(client, id, Why::of("no points are left out")) };
        project.scan = Some(back);
        self.points_changed();
        self.done(client, id, String::new());
        self.tell_state();
    }

    fn points_changed(&mut self) {
        self.desk.jobs.stop_kind("clean");
        self.desk.layers.new_points();
        if let Some(project) = &mut *self.project {
            project.known = None;
        }
    }

    /// Closes one hole.
    pub(super) fn close_hole(&mut self, client: &Client, id: u32, hole: u32) {
        let Some(project) = &*self.project else { return self.refuse(client, id, Why::of(NO_PROJECT)) };
        let Some(hole) = project.holes.get(hole as usize).copied() else {
            return self.refuse(client, id, Why::of("there is no such hole"));
        };
        if !project.model.network.curves.is_empty() {
            return self.refuse(client, id, Why::of(HAS_CURVES));
        }
        let mesh = project.mesh.clone();
        let job = self.desk.jobs.start(self.scope, ("mesh", "Closing a hole"), move |_| {
            let mut mesh = mesh.as_ref().clone();
            let mut tags = FeatureTags::from_edges(mesh.points.len(), []);
            let is_closed = mend::close_hole(&mut mesh, &mut tags, DVec3::from_array(hole.place));
            let why = "this hole cannot be closed: its boundary has more edges than a lid can have, or touches itself - \
                       hint: make the mesh anew with its holes closed";
            Outcome::Meshed(if is_closed { Ok(Box::new((mesh, None))) } else { Err(why.into()) })
        });
        self.wait_for(client, id, job);
    }

    /// Takes over a mesh.
    pub(super) fn meshed(&mut self, mesh: TriMesh, params: Option<pipeline::PipelineParams>) -> Option<Content> {
        let project = self.project.take()?;
        let params = params.unwrap_or_else(|| project.params.clone());
        Some(Content::Project(Box::new(project.meshed(mesh, params))))
    }
}

/// A line around points on the screen.
pub struct Lasso {
    /// From places to clip space, column by column.
    pub view: [f64; 16],
    /// Its corners.
    pub line: Vec<[f64; 2]>,
    /// True for what lies without it.
    pub outside: bool,
}

impl Lasso {
    /// True for a place that is seen within the line.
    fn holds(&self, p: [f64; 3]) -> bool {
        let row = |r: usize| (0..3).map(|k| self.view[4 * k + r] * p[k]).sum::<f64>() + self.view[12 + r];
        let w = row(3);
        if !is_positive(w) {
            return false;
        }
        let (x, y) = (row(0) / w, row(1) / w);
        let n = self.line.len();
        let crosses = |k: usize| {
            let ([ax, ay], [bx, by]) = (self.line[k], self.line[(k + 1) % n]);
            (ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax)
        };
        (0..n).filter(|&k| crosses(k)).count() % 2 == 1
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lasso_holds_what_is_seen_within_it_and_nothing_behind_the_eye() {
        let mut view = [0.0; 16];
        [0, 5, 10, 11].iter().for_each(|&k| view[k] = 1.0);
        // The eye looks along z, w is z.
        let line = vec![[0.0, 0.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]];
        let lasso = Lasso { view, line, outside: false };
        assert!(lasso.holds([0.25, 0.25, 1.0]) && lasso.holds([0.5, 0.5, 2.0]));
        assert!(!lasso.holds([0.75, 0.25, 1.0]) && !lasso.holds([-0.25, -0.25, -1.0]));
    }
}
