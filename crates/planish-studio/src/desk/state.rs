//! The state of a project as pages see it.

use super::keep::preparation::{PrepStep, Preparation, count_left_out};
use super::layers::center;
use super::project::{Fit, Project};
use super::{Table, content};
use crate::protocol::state::{Curve, Fault, Fitted, Kind, Offer, Patch, Seam, Stage, StageName, Standing, State, Step};
use crate::protocol::{Why, state};
use planish::DVec3;
use planish::grid::Family;
use planish::mesh::TriMesh;
use planish::model::{Drawing, HistoryEntry, Sketch};
use planish::network::{self, CurveKind};
use planish::pipeline::worst_seams;
use std::path::Path;

/// Seams that are told at most.
const MOST_SEAMS: usize = 200;

impl Table<'_, '_, '_> {
    /// Everything but geometry.
    pub(super) fn state(&self) -> State {
        let (resolution, live) = (self.desk.resolution.clone(), self.desk.live);
        let jobs = self.desk.jobs.list();
        let Some(project) = &*self.project else {
            let files = content::projects(&self.desk.folder);
            return State { files, jobs, ..State::empty(resolution, live) };
        };
        let Drawing { network, sketch } = project.model.drawing();
        let mesh = &project.mesh;
        let of_now = project.fit.as_ref().filter(|f| f.revision == project.revision);
        let corner = |c: &network::Corner| c.place.position(mesh).as_vec3().to_array();
        State {
            revision: project.revision,
            project: Some(facts(project)),
            files: others(project),
            stages: self.stages(project),
            corners: network.corners.iter().map(corner).collect(),
            curves: network.curves.iter().map(|c| curve(mesh, c)).collect::<Vec<_>>(),
            patches: patches(&network, &sketch, of_now),
            features: sketch.features.iter().map(|f| f.patch).collect(),
            faults: project.faults.iter().map(fault).collect(),
            symmetry: sketch.symmetry.map(|p| [p.point.to_array(), p.normal.to_array()]),
            done: done(project),
            undone: undone(project),
            layers: self.desk.layers.names(project),
            resolution,
            live,
            figures: of_now.map_or_else(Default::default, |f| {
                f.quality.iter().map(|(key, figure)| (key.clone(), figure.value())).collect()
            }),
            seams: of_now.map_or_else(Vec::new, seams),
            warnings: of_now.map_or_else(Vec::new, |f| f.warnings.iter().map(|w| w.message.clone()).collect()),
            jobs,
            cleaned: project.known.as_ref().map(|k| k.told()),
            left_out: count_left_out(project.scan.as_ref(), &project.left_out) as u64,
            holes: project.holes.clone(),
            branches: project.told_branches(),
            longest: of_now.and_then(|f| f.short.as_ref()).map(|s| s.longest),
            peer: project.peer.as_ref().map(|p| p.told()),
            relief_done: project.kept.relief.iter().map(|e| e.name().into()).collect(),
            relief_undone: project.kept.relief_undone.iter().map(|e| e.name().into()).collect(),
        }
        .with_control(of_now)
    }

    fn stages(&self, project: &Project) -> Vec<Stage> {
        let jobs = &self.desk.jobs;
        let standing = |name: StageName, is: Standing, note: String| {
            let running = match name {
                StageName::Mesh => jobs.has("mesh"),
                StageName::Curves => jobs.has("edit"),
                StageName::Surfaces => jobs.has("fit"),
                StageName::Scan | StageName::Patches => false,
            };
            match &self.desk.failed {
                _ if running => Stage { name, is: Standing::Running, note },
                Some((failed, why)) if *failed == name => Stage { name, is: Standing::Failed, note: why.clone() },
                _ => Stage { name, is, note },
            }
        };
        let there = |yes: bool| if yes { Standing::Fresh } else { Standing::Empty };
        let (network, scan) = (&project.model.network, project.scan.as_ref());
        let (curves, patches, faults) = (network.curves.len(), network.patches.len(), project.faults.len());
        let parted = match (patches, faults) {
            (0, _) => Standing::Empty,
            (_, 0) => Standing::Fresh,
            _ => Standing::Partial,
        };
        let (fitted, surfaces) = match &project.fit {
            Some(fit) if fit.revision == project.revision && fit.coarse => {
                (Standing::Partial, fit.model.surfaces.len())
            }
            Some(fit) if fit.revision == project.revision => (Standing::Fresh, fit.model.surfaces.len()),
            Some(fit) => (Standing::Stale, fit.model.surfaces.len()),
            None => (Standing::Empty, 0),
        };
        let count = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
        let points = scan.map_or(0, |s| s.points.len());
        vec![
            standing(StageName::Scan, there(scan.is_some()), count(points, "point")),
            standing(
                StageName::Mesh,
                there(!project.mesh.triangles.is_empty()),
                count(project.mesh.triangles.len(), "triangle"),
            ),
            standing(StageName::Curves, there(curves > 0), count(curves, "curve")),
            standing(StageName::Patches, parted, parted_note(patches, faults)),
            standing(StageName::Surfaces, fitted, count(surfaces, "surface")),
        ]
    }
}

impl State {
    /// With the control points along each curve.
    fn with_control(mut self, fit: Option<&Fit>) -> State {
        let Some(fit) = fit else { return self };
        for (patch, surface) in fit.model.network.patches.iter().zip(&fit.model.surfaces) {
            for (k, side) in patch.sides.iter().enumerate() {
                let count = [surface.cols, surface.rows][k % 2] as u32;
                if let Some(curve) = self.curves.get_mut(side.curve as usize) {
                    curve.control = Some(count);
                }
            }
        }
        self
    }
}

fn facts(project: &Project) -> state::Project {
    let bounds = match &project.scan {
        Some(scan) if project.mesh.triangles.is_empty() => scan.bounds(),
        _ => project.mesh.bounds(),
    };
    state::Project {
        name: project.file.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        file: project.file.display().to_string(),
        saved: project.mesh.triangles.is_empty() || project.saver.is_saved(),
        unsaved: project.saver.trouble.clone(),
        units: project.model.units.symbol().into(),
        triangles: project.mesh.triangles.len() as u64,
        points: project.scan.as_ref().map_or(0, |s| s.points.len() as u64),
        center: center(project).to_array(),
        diagonal: bounds.diagonal(),
        coloured: project.mesh.attributes.iter().any(|a| a.name == "color"),
        notice: project.notice.clone(),
    }
}

/// Other projects in the folder of a project.
fn others(project: &Project) -> Vec<String> {
    let folder = project.file.parent().unwrap_or(Path::new(""));
    let own = project.file.file_name().unwrap_or_default();
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    content::projects(folder).into_iter().filter(|f| f.as_str() != own).collect()
}

fn parted_note(patches: usize, faults: usize) -> String {
    let words = format!("{patches} {}", if patches == 1 { "patch" } else { "patches" });
    if faults > 0 { format!("{words}, {faults} to put right") } else { words }
}

fn curve(mesh: &TriMesh, curve: &network::Curve) -> Curve {
    let at: Vec<DVec3> = curve.points.iter().map(|p| p.position(mesh)).collect();
    let kind = match curve.kind {
        CurveKind::Smooth | CurveKind::Rounded => Kind::Smooth,
        CurveKind::Feature => Kind::Feature,
        CurveKind::Boundary => Kind::Boundary,
    };
    let length = at.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>() as f32;
    Curve { ends: curve.corners, kind, length, control: None }
}

fn patches(network: &network::Network, sketch: &Sketch, fit: Option<&Fit>) -> Vec<Patch> {
    let fitted = |p: usize| {
        let (surface, found) = fit.and_then(|f| Some((f.model.surfaces.get(p)?, f.deviations.get(p)?)))?;
        let grid = fit?.model.grids.get(p)?;
        let cells = [grid.cols as u32 - 1, grid.rows as u32 - 1];
        Some(Fitted { control: [surface.cols as u32, surface.rows as u32], cells, rms: found.rms, max: found.max })
    };
    let patch = |(p, patch): (usize, &network::Patch)| {
        let asked = sketch.sections.iter().find(|s| s.0 as usize == p).map(|s| &s.1);
        let sections =
            asked.map_or_else(Default::default, |s| [&s.u, &s.v].map(|l| l.iter().map(|&n| n as u32).collect()));
        // Curves that run along v part the patch along u.
        let of =
            |family: Family| sketch.features.iter().filter(|f| f.patch as usize == p && f.family == family).count();
        let parts = [Family::V, Family::U].map(|f| of(f) as u32 + 1);
        Patch { curves: patch.sides.map(|s| s.curve), sections, parts, fitted: fitted(p) }
    };
    network.patches.iter().enumerate().map(patch).collect()
}

fn fault(fault: &network::Fault) -> Fault {
    let offer = match fault {
        network::Fault::NotFourSided { sides, .. } if matches!(sides.len(), 3 | 5 | 6) => Some(Offer::SplitRegion),
        network::Fault::OpenBoundary { .. } => Some(Offer::Boundaries),
        network::Fault::LooseCorner { .. } => Some(Offer::DeleteCorner),
        _ => None,
    };
    Fault { why: Why::of(fault), offer }
}

/// Steps to the mesh and edits, oldest first.
fn done(project: &Project) -> Vec<Step> {
    let edits = &project.model.undo;
    let before_next = edits.windows(2).map(|w| step(&w[0].entry, Some(&w[1].other)));
    let last = edits.last().map(|s| step(&s.entry, Some(&project.model.drawing())));
    project.kept.preparation.done.iter().map(prepared).chain(before_next).chain(last).collect()
}

/// What can be made again, the next one last.
fn undone(project: &Project) -> Vec<Step> {
    let Preparation { undone, ahead, .. } = &project.kept.preparation;
    let edits = project.model.redo.iter().map(|s| step(&s.entry, Some(&s.other)));
    edits.chain(ahead.iter().rev().map(|e| step(e, None))).chain(undone.iter().map(prepared)).collect()
}

fn step(entry: &HistoryEntry, after: Option<&Drawing>) -> Step {
    let counts =
        after.map(|d| [d.network.corners.len(), d.network.curves.len(), d.network.patches.len()].map(|n| n as u32));
    Step { edit: entry.command.clone(), counts }
}

fn prepared(step: &PrepStep) -> Step {
    Step { edit: step.name().into(), counts: None }
}

fn seams(fit: &Fit) -> Vec<Seam> {
    let seam = |s: &planish::surface::SeamQuality| Seam {
        curve: s.curve,
        angle_deg: s.angle_max_deg,
        gap: s.gap_max,
        sharp: !s.kind.is_smooth(),
    };
    worst_seams(&fit.seams).into_iter().take(MOST_SEAMS).map(seam).collect()
}
