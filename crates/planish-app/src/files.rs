//! Inputs: meshes, models and networks from files, with what the user is told when they cannot be used.

use crate::failure::Failure;
use crate::products::{self, Staged};
use planish::cloud::Cloud;
use planish::cloud::bricks::StoreError;
use planish::mesh::{FeatureTags, TriMesh};
use planish::model::{Model, Units};
use planish::network::Network;
use planish::pipeline::{BRICK_POINTS, Warning};
use planish::{DVec3, Observer};
use planish_io::report::{Input, count};
use planish_io::{BrickFolder, ScanWriter, WriteError};
use std::path::Path;

/// A mesh or a model.
pub enum Content {
    /// A mesh.
    Mesh(TriMesh),
    /// A model.
    Model(Box<Model>),
}

/// Refuses what is a scan by its name.
fn no_scan(path: &Path) -> Result<(), Failure> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if planish_io::SCAN_EXTENSIONS.contains(&extension.as_str()) {
        return Err(Failure::input(path, "is a scan, not a mesh").hint("make a mesh of it with `planish mesh` first"));
    }
    Ok(())
}

/// Reads a mesh.
/// # Errors
/// If the file is no usable mesh.
pub fn mesh(path: &Path) -> Result<TriMesh, Failure> {
    no_scan(path)?;
    if is_model(path) {
        return Err(
            Failure::input(path, "is a model, not a mesh").hint("export its mesh with `planish export --surface mesh`")
        );
    }
    planish_io::read_mesh(path).map_err(|e| Failure::input(path, e))
}

/// Reads a mesh with its feature tags, if it has any.
/// # Errors
/// If the file is no usable mesh.
pub fn tagged_mesh(path: &Path) -> Result<(TriMesh, Option<FeatureTags>), Failure> {
    if is_model(path) {
        return mesh(path).map(|m| (m, None));
    }
    no_scan(path)?;
    planish_io::read_tagged_mesh(path).map_err(|e| Failure::input(path, e))
}

/// Reads a scan with all its points.
/// # Errors
/// If the file is no usable scan.
pub fn scan(path: &Path, options: &crate::args::ScanArgs) -> Result<Cloud, Failure> {
    let options = planish_io::ScanOptions { columns: options.columns.clone(), classes: options.classes.clone() };
    planish_io::read_scan(path, &options).map_err(|e| Failure::input(path, e))
}

/// A scan whose points are used.
pub enum Scan {
    /// In memory.
    Whole(Cloud),
    /// In a folder, of more points than a brick has.
    Bricks(BrickFolder),
}

impl Scan {
    /// Reads a scan, and what to tell of points that are too far off to be of it.
    /// * `room` - where a large scan may lie in bricks meanwhile; without it all are in memory
    /// # Errors
    /// If the file is no usable scan, or the folder cannot be written.
    pub fn read(
        path: &Path,
        options: &crate::args::ScanArgs,
        room: Option<&Staged>,
        observer: &dyn Observer,
    ) -> Result<(Scan, Option<Warning>), Failure> {
        let options = planish_io::ScanOptions { columns: options.columns.clone(), classes: options.classes.clone() };
        let wrong = |e: planish_io::ReadError| Failure::input(path, e);
        let is_large = |_: &&Staged| planish_io::points_told(path).is_some_and(|n| n > BRICK_POINTS as u64);
        if let Some(room) = room.filter(is_large) {
            let folder = room.path("bricks");
            std::fs::create_dir(&folder).map_err(|e| products::unwritable(&folder, &e))?;
            let bricks = BrickFolder::create(path, &options, &folder, BRICK_POINTS, observer).map_err(wrong)?;
            // A text has lines without a point.
            if bricks.points() > BRICK_POINTS as u64 {
                let left_out = bricks.left_out();
                return Ok((Scan::Bricks(bricks), far_off(left_out)));
            }
        }
        let (cloud, left_out) = planish_io::read_body(path, &options).map_err(wrong)?;
        Ok((Scan::Whole(cloud), far_off(left_out as u64)))
    }

    /// What brings its points back to their place.
    pub fn shift(&self) -> DVec3 {
        match self {
            Scan::Whole(cloud) => cloud.shift,
            Scan::Bricks(bricks) => bricks.shift(),
        }
    }

    /// Number of points, and diagonal of their box.
    pub fn size(&self) -> (u64, f64) {
        match self {
            Scan::Whole(cloud) => (cloud.points.len() as u64, cloud.bounds().diagonal()),
            Scan::Bricks(bricks) => (bricks.points(), bricks.bounds().diagonal()),
        }
    }
}

/// Points on their way to a file, piece by piece, from inside a stage.
pub struct PointsFile {
    writer: ScanWriter,
    failed: Option<WriteError>,
}

impl PointsFile {
    /// An empty one.
    /// # Errors
    /// [`WriteError::UnknownExtension`].
    pub fn create(path: &Path, units: Units) -> Result<PointsFile, WriteError> {
        Ok(PointsFile { writer: ScanWriter::create(path, units)?, failed: None })
    }

    /// Adds a piece.
    /// # Errors
    /// What the stage is told; [`PointsFile::failure`] has the rest.
    pub fn add(&mut self, piece: Cloud) -> Result<(), StoreError> {
        self.writer.add(piece).map_err(|e| {
            let told = StoreError(e.to_string());
            self.failed = Some(e);
            told
        })
    }

    /// Why a piece was not added.
    pub fn failure(&mut self) -> Option<WriteError> {
        self.failed.take()
    }

    /// Writes the file.
    /// # Errors
    /// If it cannot be written, or has no points.
    pub fn finish(self) -> Result<(), WriteError> {
        self.writer.finish()
    }
}

fn far_off(left_out: u64) -> Option<Warning> {
    let text = format!(
        "{} points lie more than a hundred times further off than the rest and are left out: wild ranges, or returns that the \
         scanner marks as invalid.",
        count(left_out)
    );
    (left_out > 0).then(|| Warning::new("points_far_off", text, ""))
}

/// Reads a model.
/// # Errors
/// If the file is no usable model.
pub fn model(path: &Path) -> Result<Model, Failure> {
    planish_io::read_model(path).map_err(|e| Failure::input(path, e))
}

/// Reads a mesh or a model, by the extension.
/// # Errors
/// If the file is neither.
pub fn content(path: &Path) -> Result<Content, Failure> {
    if is_model(path) { Ok(Content::Model(Box::new(model(path)?))) } else { Ok(Content::Mesh(mesh(path)?)) }
}

/// True for the name of a project file.
pub fn is_model(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("planish"))
}

/// The facts of a mesh as an input.
pub fn mesh_facts(path: &Path, mesh: &TriMesh, units: Units) -> Input {
    Input {
        path: crate::words::told(&path.display().to_string()),
        kind: "mesh".into(),
        counts: [("triangles", mesh.triangles.len()), ("vertices", mesh.points.len())]
            .map(|(what, n)| (what.to_owned(), n as u64))
            .into(),
        units: units.symbol().into(),
        diagonal: mesh.bounds().diagonal(),
    }
}

/// The facts of a model as an input.
pub fn model_facts(path: &Path, model: &Model, units: Units) -> Input {
    let control: usize = model.surfaces.iter().map(|s| s.control.len()).sum();
    let facts = [("patches", model.network.patches.len()), ("control points", control)];
    Input {
        kind: "model".into(),
        counts: facts.map(|(what, n)| (what.to_owned(), n as u64)).into(),
        ..mesh_facts(path, &model.mesh, units)
    }
}

/// Refuses an output whose extension is not one of `wanted`.
/// # Errors
/// With the extensions that are possible.
pub fn check_extension(path: &Path, wanted: &[&str]) -> Result<(), Failure> {
    let found = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if wanted.contains(&found.as_str()) {
        return Ok(());
    }
    let list: Vec<String> = wanted.iter().map(|e| format!(".{e}")).collect();
    Err(Failure::usage(path, "has an extension that names no format for this").hint(format!("use {}", list.join(", "))))
}

/// Reads a network on `input`, if one is given. Its places lie on the mesh as repair leaves it.
/// # Errors
/// If the file is no network, or one of another mesh.
pub fn optional_network(path: Option<&Path>, input: &TriMesh) -> Result<Option<Network>, Failure> {
    let Some(path) = path else { return Ok(None) };
    let (repaired, _) =
        planish::mend::repair(input, &crate::progress::Interrupt).map_err(|e| Failure::input(path, e))?;
    planish_io::read_network(path, &repaired).map(Some).map_err(|e| Failure::input(path, e))
}
