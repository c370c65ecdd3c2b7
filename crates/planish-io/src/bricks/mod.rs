//! A scan on disk in bricks: what is too large for memory, and what the machines of a cluster share.
//!
//! A folder of plain files: `bricks` (which there are), `points-<k>` of each, and, once they are made, `facts-<k>`, `stands-<k>`
//! and `cells-<k>` of its samples. Each file appears whole or not at all, and making it again gives the same bytes: a process that
//! dies loses nothing but its own work.
//!
//! 1. points read piece by piece, parted at medians - `part`      2. the folder as a store - here

mod part;

use crate::scan::ScanOptions;
use crate::{ReadError, atomic};
use glam::DVec3;
use part::{Record, records};
use planish::cloud::Cloud;
use planish::cloud::bricks::{Brick, BrickCells, BrickFacts, BrickSamples, BrickStands, BrickStore, StoreError};
use planish::geom::Aabb;
use planish::mesh::Attribute;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The file that tells which bricks there are.
const MANIFEST: &str = "bricks";

/// A folder with a scan in bricks.
#[derive(Clone, Debug)]
pub struct BrickFolder {
    folder: PathBuf,
    manifest: Manifest,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Manifest {
    bricks: Vec<Brick>,
    /// Added to every position to get those of the file.
    shift: DVec3,
    scanners: Vec<DVec3>,
    has_normals: bool,
    /// Points of the file, numbers or not, without those left out.
    points: u64,
    /// Points that were too far off to be of the scan.
    left_out: u64,
}

impl BrickFolder {
    /// Parts a scan into bricks of at most `most` points, those of [`planish::cloud::bricks::Partition::new`], in a folder. PLY with
    /// binary points, LAS, LAZ and E57 are read piece by piece, other formats as a whole.
    /// * `folder` - there, and empty
    /// # Errors
    /// As of [`crate::read_body`], or if the folder cannot be written.
    pub fn create(scan: &Path, options: &ScanOptions, folder: &Path, most: usize) -> Result<BrickFolder, ReadError> {
        let manifest = part::part(scan, options, folder, most)?;
        let made = BrickFolder { folder: folder.to_path_buf(), manifest };
        made.write(MANIFEST, &made.manifest).map_err(|e| ReadError::Io(std::io::Error::other(e)))?;
        Ok(made)
    }

    /// A folder that was made before, by this process or another one.
    /// # Errors
    /// If it is none.
    pub fn open(folder: &Path) -> Result<BrickFolder, StoreError> {
        let mut opened = BrickFolder { folder: folder.to_path_buf(), manifest: Manifest::default() };
        opened.manifest = opened.read(MANIFEST)?;
        Ok(opened)
    }

    /// Added to every position to get those of the file.
    pub fn shift(&self) -> DVec3 {
        self.manifest.shift
    }

    /// Points of the file without those left out.
    pub fn points(&self) -> u64 {
        self.manifest.points
    }

    /// Points that were too far off to be of the scan.
    pub fn left_out(&self) -> u64 {
        self.manifest.left_out
    }

    /// Box of the points, less the shift.
    pub fn bounds(&self) -> Aabb {
        Aabb::of(self.manifest.bricks.iter().flat_map(|b| [&b.bounds.min, &b.bounds.max]))
    }

    /// Keeps something in the folder by a name.
    /// # Errors
    /// If it cannot be written.
    pub fn write<T: Serialize>(&self, name: &str, what: &T) -> Result<(), StoreError> {
        let path = self.folder.join(name);
        let told = |e: &dyn std::fmt::Display| StoreError(format!("{}: cannot be written: {e}", path.display()));
        atomic::write(&path, |out| postcard::to_io(what, out).map(drop).map_err(std::io::Error::other)).map_err(|e| told(&e))
    }

    /// What was kept in the folder by a name.
    /// # Errors
    /// If it is not there, or damaged.
    pub fn read<T: DeserializeOwned>(&self, name: &str) -> Result<T, StoreError> {
        let path = self.folder.join(name);
        let told = |e: &dyn std::fmt::Display| StoreError(format!("{}: {e}", path.display()));
        let bytes = std::fs::read(&path).map_err(|e| told(&e))?;
        postcard::from_bytes(&bytes).map_err(|_| told(&"is damaged, or of another version of planish"))
    }

    /// True if something is kept by this name.
    pub fn has(&self, name: &str) -> bool {
        self.folder.join(name).is_file()
    }
}

impl Default for Manifest {
    fn default() -> Manifest {
        Manifest {
            bricks: Vec::new(),
            shift: DVec3::ZERO,
            scanners: Vec::new(),
            has_normals: false,
            points: 0,
            left_out: 0,
        }
    }
}

/// The file with the points of a brick.
fn points_file(folder: &Path, brick: usize) -> PathBuf {
    folder.join(format!("points-{brick:05}"))
}

/// Names of what is kept of the samples of a brick.
fn named(what: &str, brick: usize) -> String {
    format!("{what}-{brick:05}")
}

impl BrickStore for BrickFolder {
    fn bricks(&self) -> &[Brick] {
        &self.manifest.bricks
    }

    fn around(&self, brick: usize, halo: f64) -> Result<Cloud, StoreError> {
        let bricks = self.bricks();
        let reach = bricks[brick].reach(halo);
        let inside = |p: DVec3| p.cmpge(reach.min).all() && p.cmplt(reach.max).all();
        let mut found: Vec<Record> = Vec::new();
        for (k, _) in bricks.iter().enumerate().filter(|(k, b)| *k == brick || b.bounds.meets(&reach)) {
            let path = points_file(&self.folder, k);
            let taken = records(&path, &mut |r| {
                if k == brick || inside(r.point) {
                    found.push(r);
                }
            });
            taken.map_err(|e| StoreError(format!("{}: {e}", path.display())))?;
        }
        found.sort_unstable_by_key(|r| r.index);
        let mut cloud = Cloud::new(found.iter().map(|r| r.point).collect());
        cloud.shift = self.manifest.shift;
        if self.manifest.has_normals {
            let values = found.iter().flat_map(|r| r.normal).collect();
            cloud.attributes.push(Attribute { name: "normal".into(), width: 3, values });
        }
        if !self.manifest.scanners.is_empty() {
            cloud.scanners.clone_from(&self.manifest.scanners);
            cloud.seen_by = found.iter().map(|r| r.seen_by).collect();
        }
        Ok(cloud)
    }

    fn keep(&self, brick: usize, samples: BrickSamples) -> Result<(), StoreError> {
        self.write(&named("stands", brick), &samples.stands)?;
        self.write(&named("cells", brick), &samples.cells)?;
        // The last one: where it is all are.
        self.write(&named("facts", brick), &samples.facts)
    }

    fn facts(&self, brick: usize) -> Result<BrickFacts, StoreError> {
        self.read(&named("facts", brick))
    }

    fn stands(&self, brick: usize) -> Result<Arc<BrickStands>, StoreError> {
        self.read(&named("stands", brick)).map(Arc::new)
    }

    fn cells(&self, brick: usize) -> Result<Arc<BrickCells>, StoreError> {
        self.read(&named("cells", brick)).map(Arc::new)
    }

    fn held(&self) -> u64 {
        HELD
    }
}

/// The winding number's tree, where holes are closed: an eighth of the points have a sample, of some 100 bytes in it.
const HELD: u64 = 12;
