//! A scan in bricks on disk, step by step: what `planish mesh` does with large scans, for those who share the steps out.

use crate::cloud::{PyCloud, mesh_of, scan_params};
use crate::error::{told, told_of};
use crate::objects::PyMesh;
use crate::params::Given;
use crate::watch::{self, Both};
use planish::cloud::bricks::{BrickStore, StoreError, halo};
use planish::pipeline::{BRICK_POINTS, BrickMesh, BrickPlan, BrickWelder, ScanError, ScanParams, clean_brick};
use planish_io::{BrickFolder, Gathered, ReadError, ScanOptions};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// Names in the folder: how everything is to be made, what was settled for all bricks, and the mesh of each.
const RECIPE: &str = "recipe";
const PLAN: &str = "plan";

// Python sees the default as it is written.
const _: () = assert!(BRICK_POINTS == 524_288);

fn mesh_name(brick: usize) -> String {
    format!("mesh-{brick:05}")
}

/// A scan that lies in a folder, in bricks of at most so many points, and is meshed brick by brick: by one process or by many that
/// share the folder.
///
///     bricks = Bricks.create("scan.e57", "folder", voxel=0.5)
///     for k in range(len(bricks)): bricks.clean(k)       # each in any process: Bricks("folder").clean(k)
///     bricks.settle()                                    # once, when all are clean
///     for k in range(len(bricks)): bricks.mesh(k)        # again each in any process
///     mesh = bricks.weld()
///
/// Bricks(folder) opens one that was made before. A step can be done again, and gives the same bytes. The mesh is that of
/// `Cloud.mesh` for scans of more than 524 288 points: the bricks follow from the points and from `most` alone. Raises CloudError.
///
/// Source: docs/methods/bricks.md.
#[pyclass(frozen, module = "planish", name = "Bricks")]
pub struct PyBricks {
    folder: BrickFolder,
    recipe: Recipe,
    plan: OnceLock<Arc<BrickPlan>>,
}

/// How all bricks are made.
#[derive(Clone, serde::Serialize, serde::Deserialize)]
struct Recipe {
    params: ScanParams,
    halo: f64,
}

impl PyBricks {
    fn check(&self, brick: usize) -> PyResult<()> {
        let count = self.folder.bricks().len();
        if brick < count { Ok(()) } else { Err(PyIndexError::new_err(format!("brick {brick}: there are {count}"))) }
    }

    /// What was settled, read once.
    fn plan(&self) -> Result<Arc<BrickPlan>, StoreError> {
        if let Some(plan) = self.plan.get() {
            return Ok(plan.clone());
        }
        let plan = Arc::new(self.folder.read(PLAN)?);
        Ok(self.plan.get_or_init(|| plan).clone())
    }
}

/// The points of the pieces that an iterable gives.
fn gathered(scan: &Bound<PyAny>, folder: &Path) -> PyResult<Gathered> {
    let pieces = scan.try_iter()?;
    let mut raised = None;
    let made = BrickFolder::gather(
        &mut |take| {
            for piece in &pieces {
                let cloud = piece.and_then(|p| {
                    scan.py().check_signals()?;
                    Ok(p.cast::<PyCloud>()?.get().cloud.clone())
                });
                match cloud {
                    // Pieces may be moved, each by another shift.
                    Ok(cloud) => take(cloud.in_place())?,
                    Err(e) => {
                        // Told in the place of what the reader says then.
                        raised = Some(e);
                        return Err(ReadError::NoPoints);
                    }
                }
            }
            Ok(())
        },
        folder,
    );
    match raised {
        Some(raised) => Err(raised),
        None => made.map_err(|e| told(scan.py(), &e)),
    }
}

fn of_store(e: StoreError) -> ScanError {
    ScanError::Cloud(e.into())
}

#[pymethods]
impl PyBricks {
    #[new]
    fn py_new(py: Python, folder: PathBuf) -> PyResult<PyBricks> {
        let open = || {
            let opened = BrickFolder::open(&folder)?;
            let recipe = opened.read(RECIPE)?;
            Ok::<PyBricks, StoreError>(PyBricks { folder: opened, recipe, plan: OnceLock::new() })
        };
        py.detach(open).map_err(|e| told(py, &e))
    }

    /// Parts the points of a scan into bricks in a folder. PLY with binary points, LAS, LAZ, E57 and texts are read piece by piece: memory
    /// does not grow with the scan. Raises FileError, CloudError.
    ///
    /// * scan: the file, or an iterable of `Cloud`s that are its pieces (`neighbours.from_parquet`): all with the same attributes
    /// * folder: made if it is not there, refused unless it is empty
    /// * most: points of a brick; other bricks give a mesh that differs by less than the noise
    /// * columns, classes: as of `read`
    /// * the keywords of `Cloud.mesh`; memory is what one brick's lattice may take
    #[staticmethod]
    #[pyo3(signature = (scan, folder, *, most=524288, columns=None, classes=None, close=None, memory=None, progress=None, **parameters))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn create(
        py: Python,
        scan: &Bound<PyAny>,
        folder: PathBuf,
        most: usize,
        columns: Option<String>,
        classes: Option<Vec<u8>>,
        close: Option<bool>,
        memory: Option<f64>,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyBricks> {
        let mut given = Given::new("Bricks.create", parameters)?;
        let params = scan_params(&mut given, close, memory)?;
        given.done()?;
        if most == 0 {
            return Err(PyValueError::new_err("most=0: at least 1 is needed"));
        }
        let unusable = |e: std::io::Error| StoreError(format!("{}: {e}", folder.display()));
        let empty = || {
            std::fs::create_dir_all(&folder).map_err(unusable)?;
            match std::fs::read_dir(&folder).map_err(unusable)?.next() {
                None => Ok(()),
                Some(_) => Err(StoreError(format!(
                    "{}: is not empty - hint: name an empty folder, or open what is there with Bricks(folder)",
                    folder.display()
                ))),
            }
        };
        empty().map_err(|e| told(py, &e))?;
        let options = ScanOptions { columns, classes: classes.unwrap_or_default() };
        let make = || {
            let made = match scan.extract::<PathBuf>() {
                Ok(file) => {
                    let create = |o: &dyn Both| match BrickFolder::create(&file, &options, &folder, most, o.one()) {
                        Err(ReadError::Cancelled(c)) => Err(c),
                        made => Ok(made),
                    };
                    watch::run(py, "points", progress, create)?.map_err(|e| told_of(py, &file, &e))?
                }
                Err(_) => {
                    let gathered = gathered(scan, &folder)?;
                    watch::run(py, "points", progress, |o| BrickFolder::of_gathered(gathered, most, o.one()))?
                }
            };
            watch::run(py, "bricks", progress, |o| {
                let halo = halo(&made, &params.clean, o.one())?;
                let recipe = Recipe { params: params.clone(), halo };
                made.write(RECIPE, &recipe).map_err(of_store)?;
                Ok::<PyBricks, ScanError>(PyBricks { folder: made.clone(), recipe, plan: OnceLock::new() })
            })
        };
        // Nothing stays that another try would refuse.
        make().inspect_err(|_| BrickFolder::discard(&folder))
    }

    fn __len__(&self) -> usize {
        self.folder.bricks().len()
    }

    /// Points of the scan.
    #[getter]
    fn points(&self) -> u64 {
        self.folder.points()
    }

    /// Fits the samples of a brick, and keeps them in the folder. Raises CloudError, IndexError.
    #[pyo3(signature = (brick, *, progress=None))]
    fn clean(&self, py: Python, brick: usize, progress: Option<&Bound<PyAny>>) -> PyResult<()> {
        self.check(brick)?;
        let Recipe { params, halo } = &self.recipe;
        watch::run(py, "samples", progress, |o| {
            Ok::<(), ScanError>(clean_brick(&self.folder, brick, *halo, &params.clean, o.one())?)
        })
    }

    /// Settles what one brick cannot know, when all have their samples: which way they look, the lattice, whether holes are
    /// closed. Raises CloudError.
    #[pyo3(signature = (*, progress=None))]
    fn settle(&self, py: Python, progress: Option<&Bound<PyAny>>) -> PyResult<()> {
        let Recipe { params, halo } = &self.recipe;
        watch::run(py, "sides", progress, |_| {
            let plan = BrickPlan::new(&self.folder, *halo, params)?;
            self.folder.write(PLAN, &plan).map_err(of_store)
        })
    }

    /// Meshes a brick, when all is settled, and keeps its mesh in the folder. Raises CloudError, ContourError, IndexError.
    #[pyo3(signature = (brick, *, progress=None))]
    fn mesh(&self, py: Python, brick: usize, progress: Option<&Bound<PyAny>>) -> PyResult<()> {
        self.check(brick)?;
        watch::run(py, "mesh", progress, |o| {
            let plan = self.plan().map_err(of_store)?;
            let made = plan.mesh(&self.folder, brick, &self.recipe.params, o.one())?;
            self.folder.write(&mesh_name(brick), &made).map_err(of_store)
        })
    }

    /// The points of a brick on the surface, when all is settled, without outliers: as of `Samples.project`, with the noise and the
    /// sides of the whole scan. Raises CloudError, IndexError.
    ///
    /// * outliers: keep outliers, flagged
    /// * spacing: distance of the points that are kept, world units; across bricks they may be closer
    #[pyo3(signature = (brick, *, progress=None, **parameters))]
    fn project(
        &self,
        py: Python,
        brick: usize,
        progress: Option<&Bound<PyAny>>,
        parameters: Option<&Bound<PyDict>>,
    ) -> PyResult<PyCloud> {
        self.check(brick)?;
        let mut given = Given::new("Bricks.project", parameters)?;
        let params = ScanParams { points: given.take()?, ..self.recipe.params.clone() };
        given.done()?;
        let made = watch::run(py, "points", progress, |o| {
            let plan = self.plan().map_err(of_store)?;
            plan.project(&self.folder, brick, &params, o.one())
        })?;
        Ok(PyCloud::cleaned(made))
    }

    /// The meshes of all bricks as one. Raises CloudError, ContourError.
    #[pyo3(signature = (*, progress=None))]
    fn weld(&self, py: Python, progress: Option<&Bound<PyAny>>) -> PyResult<PyMesh> {
        let welded = watch::run(py, "weld", progress, |o| {
            let plan = self.plan().map_err(of_store)?;
            let mut welder = BrickWelder::new(&plan);
            let count = self.folder.bricks().len();
            for k in 0..count {
                o.one().check()?;
                welder.add(self.folder.read::<BrickMesh>(&mesh_name(k)).map_err(of_store)?);
                o.one().progress(k as f64 / count as f64);
            }
            welder.finish()
        })?;
        Ok(mesh_of(welded))
    }
}
