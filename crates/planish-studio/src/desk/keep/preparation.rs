//! Steps of a hand from the points to the mesh: points left out, the mesh made, holes closed. They are taken back and made again
//! as edits are, also after a restart, for a step does the same to the same points.
//!
//! 1. the steps      2. what they are made on, and the way from one state to another

use super::lasso::Lasso;
use crate::desk::beside::Known;
use planish::DVec3;
use planish::cloud::Cloud;
use planish::field::Spacing;
use planish::mend;
use planish::mesh::{FeatureTags, TriMesh};
use planish::model::HistoryEntry;
use planish::observe::Observer;
use planish::pipeline::{self, PipelineParams, ScanParams};
use planish_io::ScanOptions;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What is told where points are wanted.
pub const NO_SCAN: &str = "there is no scan here - hint: drop one on the page";

/// A step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "step", rename_all = "snake_case", deny_unknown_fields)]
pub enum PrepStep {
    /// Points were left out.
    LeaveOut(Lasso),
    /// A mesh was made of the points.
    Mesh {
        /// Holes closed, left open, or as the scan is.
        close: Option<bool>,
        /// Cells; those that suit the scan if absent.
        cells: Option<Spacing>,
    },
    /// A hole of the mesh was closed.
    CloseHole {
        /// A place of its rim.
        place: [f64; 3],
        /// Vertices and triangles before it: a lid comes behind them.
        before: [usize; 2],
    },
}

impl PrepStep {
    /// Its name in the history.
    pub fn name(&self) -> &'static str {
        match self {
            PrepStep::LeaveOut(_) => "leave_out",
            PrepStep::Mesh { .. } => "mesh",
            PrepStep::CloseHole { .. } => "close_hole",
        }
    }
}

/// The steps of a project so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Preparation {
    /// Fingerprint of the points that they begin with.
    pub origin: u64,
    /// The name of the scan beside the project, if it has one.
    pub scan: Option<String>,
    /// Steps, oldest first.
    pub done: Vec<PrepStep>,
    /// Steps taken back that can be made again, the next one last.
    pub undone: Vec<PrepStep>,
    /// Edits that can be made again after these, the next one first.
    pub ahead: Vec<HistoryEntry>,
}

impl Preparation {
    /// No step on these points.
    pub fn on(points: &[DVec3], scan: Option<String>) -> Preparation {
        Preparation { origin: fingerprint(points), scan, ..Preparation::default() }
    }

    /// True if nothing can be taken back or made again.
    pub fn is_empty(&self) -> bool {
        self.done.is_empty() && self.undone.is_empty()
    }

    /// With another step made; what was taken back cannot be made again.
    pub fn with(&self, step: PrepStep) -> Preparation {
        let mut after = Preparation { undone: Vec::new(), ahead: Vec::new(), ..self.clone() };
        after.done.push(step);
        after
    }

    /// With so many steps done, of all that there are.
    pub fn at(&self, done: usize) -> Preparation {
        let mut after = self.clone();
        while after.done.len() > done
            && let Some(step) = after.done.pop()
        {
            after.undone.push(step);
        }
        while after.done.len() < done
            && let Some(step) = after.undone.pop()
        {
            after.done.push(step);
        }
        after
    }
}

/// A fingerprint of points (FNV-1a over words of 64 bits).
fn fingerprint(points: &[DVec3]) -> u64 {
    let words = points.iter().flat_map(|p| p.to_array()).map(f64::to_bits);
    words.fold(0xcbf2_9ce4_8422_2325, |hash, word| (hash ^ word).wrapping_mul(0x0100_0000_01b3).rotate_left(29))
}

/// What the steps are made on, and what came of them.
#[derive(Clone)]
pub struct Basis {
    /// Where the scan is.
    pub folder: PathBuf,
    /// The points.
    pub scan: Option<Arc<Cloud>>,
    /// The points before each time that some were left out.
    pub left_out: Vec<Arc<Cloud>>,
    /// What is known of the points.
    pub known: Option<Arc<Known>>,
    /// The mesh; empty if there is none yet.
    pub mesh: Arc<TriMesh>,
    /// Parameters of the stages that follow.
    pub params: PipelineParams,
}

impl Basis {
    /// Goes from some steps to others: back to the last that both have, and on from there.
    /// # Errors
    /// In words, if a step cannot be made; and if a mesh is to be made again and its scan is not to be found.
    pub fn walk(mut self, from: &Preparation, to: &Preparation, observer: &dyn Observer) -> Result<Basis, String> {
        let shared = from.done.iter().zip(&to.done).take_while(|(a, b)| a == b).count();
        from.done[shared..].iter().rev().for_each(|step| self.take_back(step));
        let mut next = shared;
        if self.mesh.triangles.is_empty() {
            // The mesh that they share was replaced by another: it is made again.
            let is_mesh = |step: &PrepStep| matches!(step, PrepStep::Mesh { .. });
            next = to.done[..shared].iter().rposition(is_mesh).unwrap_or(shared);
            self.find_scan(to, next)?;
        }
        for (k, step) in to.done.iter().enumerate().skip(next) {
            if matches!(step, PrepStep::Mesh { .. }) {
                self.find_scan(to, k)?;
            }
            self.make(step, observer)?;
        }
        Ok(self)
    }

    fn take_back(&mut self, step: &PrepStep) {
        match step {
            PrepStep::LeaveOut(_) => {
                if let Some(before) = self.left_out.pop() {
                    (self.scan, self.known) = (Some(before), None);
                }
            }
            PrepStep::Mesh { .. } => self.mesh = Arc::default(),
            PrepStep::CloseHole { before: [vertices, triangles], .. } => {
                let mut mesh = self.mesh.as_ref().clone();
                mesh.points.truncate(*vertices);
                mesh.triangles.truncate(*triangles);
                mesh.attributes.iter_mut().for_each(|a| a.values.truncate(a.width * vertices));
                self.mesh = Arc::new(mesh);
            }
        }
    }

    /// Reads the scan where it is not there, and leaves out what the first `count` steps leave out.
    fn find_scan(&mut self, steps: &Preparation, count: usize) -> Result<(), String> {
        if self.scan.is_some() {
            return Ok(());
        }
        let name = steps.scan.as_ref().ok_or(NO_SCAN)?;
        let cloud = read_scan(&self.folder.join(name)).map_err(|e| format!("{name}: {e}"))?;
        if fingerprint(&cloud.points) != steps.origin {
            return Err(format!("{name} is not the scan that the mesh was made of"));
        }
        self.scan = Some(Arc::new(cloud));
        steps.done[..count].iter().try_for_each(|step| match step {
            PrepStep::LeaveOut(lasso) => self.leave_out(lasso),
            PrepStep::Mesh { .. } | PrepStep::CloseHole { .. } => Ok(()),
        })
    }

    fn make(&mut self, step: &PrepStep, observer: &dyn Observer) -> Result<(), String> {
        match step {
            PrepStep::LeaveOut(lasso) => self.leave_out(lasso),
            PrepStep::Mesh { close, cells } => {
                let scan = self.scan.as_ref().ok_or(NO_SCAN)?;
                let params = ScanParams { close: *close, cells: *cells, ..ScanParams::default() };
                let made = match &self.known {
                    Some(known) => pipeline::mesh_samples(scan, known.samples.clone(), &params, observer),
                    None => pipeline::mesh_scan(scan, &params, observer),
                }
                .map_err(|e| e.to_string())?;
                self.params = pipeline::params_for(&made);
                let (mesh, _) = mend::repair(&made.meshed.extracted.mesh, observer).map_err(|e| e.to_string())?;
                self.mesh = Arc::new(mesh);
                Ok(())
            }
            PrepStep::CloseHole { place, before } => {
                let mut mesh = self.mesh.as_ref().clone();
                let mut tags = FeatureTags::from_edges(mesh.points.len(), []);
                let is_here = [mesh.points.len(), mesh.triangles.len()] == *before;
                if !(is_here && mend::close_hole(&mut mesh, &mut tags, DVec3::from_array(*place))) {
                    let why = "this hole cannot be closed: its boundary has more edges than a lid can have, or touches \
                               itself - hint: make the mesh anew with its holes closed";
                    return Err(why.into());
                }
                self.mesh = Arc::new(mesh);
                Ok(())
            }
        }
    }

    fn leave_out(&mut self, lasso: &Lasso) -> Result<(), String> {
        let scan = self.scan.as_ref().ok_or(NO_SCAN)?;
        let keep: Vec<u32> =
            (0..scan.points.len() as u32).filter(|&k| lasso.holds(scan.points[k as usize]) == lasso.outside).collect();
        if keep.len() == scan.points.len() || keep.is_empty() {
            return Err(if keep.is_empty() { "no points would be left" } else { "no points lie there" }.into());
        }
        let less = Arc::new(scan.select(&keep));
        self.left_out.extend(self.scan.replace(less));
        self.known = None;
        Ok(())
    }
}

/// How many points of a scan are left out.
/// * `before` - the scan before each time that some were
pub fn count_left_out(scan: Option<&Arc<Cloud>>, before: &[Arc<Cloud>]) -> usize {
    let now = scan.map_or(0, |s| s.points.len());
    before.first().map_or(0, |all| all.points.len() - now)
}

/// Reads a scan: every place of it is a number.
/// # Errors
/// In words.
pub fn read_scan(path: &Path) -> Result<Cloud, String> {
    let cloud = planish_io::read_scan(path, &ScanOptions::default()).map_err(|e| e.to_string())?;
    let keep: Vec<u32> = (0..cloud.points.len() as u32).filter(|&k| cloud.points[k as usize].is_finite()).collect();
    Ok(if keep.len() < cloud.points.len() { cloud.select(&keep) } else { cloud })
}

#[cfg(test)]
mod tests {
    use super::*;
    use planish::Silent;
    use planish::mesh::Attribute;
    use planish::synthetic::shapes;

    #[test]
    fn a_lid_taken_back_leaves_the_mesh_that_was_there_and_made_again_it_is_the_same_lid() {
        let mut mesh = shapes::sphere(1.0, 3);
        mesh.triangles.retain(|t| t.iter().any(|&v| mesh.points[v as usize].z < 0.8));
        let values = (0..mesh.points.len()).map(|k| k as f32).collect();
        mesh.attributes.push(Attribute { name: "heat".into(), width: 1, values });
        let top = (mesh.points.iter().filter(|p| p.z < 0.99)).max_by(|a, b| a.z.total_cmp(&b.z)).unwrap().to_array();
        let before = [mesh.points.len(), mesh.triangles.len()];
        let (start, params) = (Preparation::on(&mesh.points, None), PipelineParams::default());
        let closed = start.with(PrepStep::CloseHole { place: top, before });
        let (mesh, folder) = (Arc::new(mesh), PathBuf::new());
        let basis = Basis { folder, scan: None, left_out: Vec::new(), known: None, mesh: mesh.clone(), params };
        let with_lid = basis.walk(&start, &closed, &Silent).unwrap();
        assert!(with_lid.mesh.triangles.len() > before[1]);
        let without = with_lid.clone().walk(&closed, &closed.at(0), &Silent).unwrap();
        assert_eq!(without.mesh, mesh);
        let again = without.walk(&closed.at(0), &closed.at(0).at(1), &Silent).unwrap();
        assert_eq!(again.mesh, with_lid.mesh);
        assert_eq!(closed.at(0).at(7), closed);
    }
}
