//! What comes onto the desk: nothing, or a project from a file, a scan, a mesh or a made part.

use super::jobs::Outcome;
use super::keep::preparation::read_scan;
use super::keep::{journal, kept};
use super::project::Project;
use super::{Desk, Upload};
use crate::protocol::Sample;
use planish::mesh::TriMesh;
use planish::model::{Model, Units};
use planish::observe::Observer;
use planish::synthetic::{self, ScannerParams, virtual_scan};
use planish_io::FileUnits;
use std::path::{Path, PathBuf};

/// What lies on the desk next.
pub enum Content {
    /// The start page.
    Nothing,
    /// A project.
    Project(Box<Project>),
    /// Nothing ever again.
    End,
}

/// Triangles of the made part.
const PART_TRIANGLES: usize = 40_000;
/// Cells along the longest side of the made bracket.
const BRACKET_CELLS: usize = 80;
/// Points of the made scan: enough for its edges, and meshed while one waits.
const SCAN_POINTS: usize = 60_000;

impl Desk {
    /// Reads a file as a job.
    pub(super) fn read(&mut self, path: PathBuf) -> u32 {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let (folder, units) = (path.parent().unwrap_or(Path::new("")).to_owned(), self.units);
        self.jobs.start_free("read", &format!("Reading {name}"), move |watch| {
            Outcome::Opened(read(&path, &name, &folder, units, watch).map(Box::new))
        })
    }

    /// Reads a file that was dropped on a page.
    pub(super) fn take_in(&mut self, upload: Upload) {
        let (folder, units) = (self.folder.clone(), self.units);
        self.jobs.start_free("read", &format!("Reading {}", upload.name), move |watch| {
            let file: &Path = &upload.file;
            Outcome::Opened(read(file, &upload.name, &folder, units, watch).map(Box::new))
        });
    }

    /// Makes a part as a job.
    pub(super) fn sample(&mut self, sample: Sample) -> u32 {
        let folder = self.folder.clone();
        self.jobs.start_free("sample", "Making the part", move |watch| {
            Outcome::Opened(made(sample, &folder, watch).map(Box::new))
        })
    }
}

/// Reads a project, a mesh or a scan. A project that is there already goes on.
/// * `name` - the name that the user has for it; `path` may be another
/// * `folder` - where its project file is
fn read(
    path: &Path,
    name: &str,
    folder: &Path,
    units: Option<Units>,
    observer: &dyn Observer,
) -> Result<Project, String> {
    let told = |e: &dyn std::fmt::Display| format!("{name}: {e}");
    if is_project(Path::new(name)) {
        let model = planish_io::read_model(path).map_err(|e| told(&e))?;
        let own = folder.join(name);
        // A project from elsewhere gets a file of its own here.
        let file = if same(&own, path) { own } else { free_name(folder, name) };
        return Ok(Project::of_model(model, file, String::new()).take_up(observer));
    }
    let units = units.unwrap_or(match planish_io::file_units(Path::new(name)) {
        FileUnits::Standard(units) | FileUnits::Usual(units) => units,
        FileUnits::Unknown => Units::default(),
    });
    let file = folder.join(Path::new(name).with_extension("planish").file_name().unwrap_or_default());
    let is_beside = same(&folder.join(name), path);
    if is_beside && file.exists() {
        let model = planish_io::read_model(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        let notice = format!("Goes on with {}, which was made of this file before.", file.display());
        return Ok(Project::of_model(model, file, notice).take_up(observer));
    }
    let file = if file.exists() { free_name(folder, &file.to_string_lossy()) } else { file };
    if planish_io::is_scan(path) {
        let cloud = read_scan(path).map_err(|e| told(&e))?;
        let scan = is_beside.then(|| name.to_owned());
        return Ok(Project::of_scan(cloud, scan, units, file).take_up(observer));
    }
    let mesh = planish_io::read_mesh(path).map_err(|e| told(&e))?;
    of_mesh(mesh, units, file, observer).map(|p| p.take_up(observer)).map_err(|e| told(&e))
}

/// A project on a mesh, which is repaired and brought near the origin.
fn of_mesh(mut mesh: TriMesh, units: Units, file: PathBuf, observer: &dyn Observer) -> Result<Project, String> {
    let shift = planish_io::shift_of(&mesh.bounds());
    mesh.points.iter_mut().for_each(|p| *p -= shift);
    let (mesh, _) = planish::mend::repair(&mesh, observer).map_err(|e| e.to_string())?;
    Ok(Project::of_model(Model { mesh, units, shift, ..Model::default() }, file, String::new()).unsaved())
}

fn made(sample: Sample, folder: &Path, observer: &dyn Observer) -> Result<Project, String> {
    let name = |name: &str| match folder.join(name).with_extension("planish") {
        file if file.exists() => free_name(folder, &file.to_string_lossy()),
        file => file,
    };
    match sample {
        Sample::Part => of_mesh(synthetic::demo(0, PART_TRIANGLES), Units::Mm, name("part"), observer),
        Sample::Bracket => {
            let mesh = synthetic::bracket(0, BRACKET_CELLS).map_err(|e| e.to_string())?;
            of_mesh(mesh, Units::Mm, name("bracket"), observer)
        }
        Sample::Scan => {
            let part = synthetic::demo(0, PART_TRIANGLES);
            let params = ScannerParams { points: SCAN_POINTS, ..ScannerParams::default() };
            let scanned = virtual_scan(&part, &params, observer).map_err(|e| e.to_string())?;
            Ok(Project::of_scan(scanned.cloud, None, Units::Mm, name("scan")))
        }
    }
}

/// True for the name of a project.
pub fn is_project(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("planish"))
}

fn same(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// A name in the folder that no file has: `part.planish`, `part-2.planish` ...
fn free_name(folder: &Path, name: &str) -> PathBuf {
    let stem = Path::new(name).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let named = |k: usize| match k {
        1 => folder.join(format!("{stem}.planish")),
        k => folder.join(format!("{stem}-{k}.planish")),
    };
    let beside = |p: &Path| [journal::path_of(p), kept::path_of(p)];
    (1..).map(named).find(|p| !p.exists() && !beside(p).iter().any(|b| b.exists())).unwrap_or_else(|| named(1))
}

/// Projects in a folder, by name.
pub fn projects(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .filter(|e| is_project(&e.path()) && e.path().is_file())
        .map(|e| e.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}
