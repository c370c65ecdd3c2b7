//! A scan on disk in bricks: what is too large for memory, and what the machines of a cluster share.
//!
//! A folder of plain files: `bricks` (which there are), `points-<k>` of each, and, once they are made, `facts-<k>`, `stands-<k>`
//! and `cells-<k>` of its samples. `bricks` is written when all points are there; from then on each file appears whole or not at all,
//! and making it again gives the same bytes: a process that dies loses nothing but its own work.
//!
//! 1. points read piece by piece, parted at medians - `part`      2. the folder as a store - here

mod part;

use crate::scan::{Ending, ScanOptions, Take, pieces, scale_colors};
use crate::{ReadError, atomic};
use glam::DVec3;
pub use part::Gathered;
use part::{Record, records};
use planish::cloud::Cloud;
use planish::cloud::bricks::{
    Brick, BrickCells, BrickFacts, BrickSamples, BrickStands, BrickStore, StoreError, bounds_of,
};
use planish::geom::Aabb;
use planish::mesh::Attribute;
use planish::observe::{Observer, Silent};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Parts of at most so many points without other attributes are parted in memory, of fewer with them: records, places and order take some
/// 300 MB, less than a brick at work.
const AT_ONCE: u64 = 1 << 22;
/// The file that tells which bricks there are.
const MANIFEST: &str = "bricks";

/// Points in pieces.
pub type Source<'a> = dyn FnMut(&mut Take) -> Result<(), ReadError> + 'a;

/// A folder with a scan in bricks.
#[derive(Clone, Debug)]
pub struct BrickFolder {
    folder: PathBuf,
    manifest: Manifest,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Manifest {
    bricks: Vec<Brick>,
    /// Added to every position to get those of the file.
    shift: DVec3,
    scanners: Vec<DVec3>,
    has_normals: bool,
    /// Name and width of what else the file tells of its points.
    columns: Vec<(String, usize)>,
    /// Columns that the format has room for and no point of the file has.
    bare: Vec<String>,
    color_scale: Option<f64>,
    /// Points of the file, numbers or not, without those left out.
    points: u64,
    /// Points that were too far off to be of the scan.
    left_out: u64,
}

impl Manifest {
    /// Bytes of all columns of a point.
    fn more(&self) -> usize {
        4 * self.columns.iter().map(|c| c.1).sum::<usize>()
    }
}

impl BrickFolder {
    /// Parts a scan into bricks of at most `most` points, those of [`planish::cloud::bricks::Partition::new`], in a folder. PLY with
    /// binary points, LAS, LAZ, E57 and texts are read piece by piece, other formats as a whole.
    /// * `folder` - there, and empty
    /// # Errors
    /// As of [`crate::read_body`], or if the folder cannot be written.
    pub fn create(
        scan: &Path,
        options: &ScanOptions,
        folder: &Path,
        most: usize,
        observer: &dyn Observer,
    ) -> Result<BrickFolder, ReadError> {
        BrickFolder::created(scan, options, folder, (most, AT_ONCE), observer)
    }

    fn created(
        scan: &Path,
        options: &ScanOptions,
        folder: &Path,
        most: (usize, u64),
        observer: &dyn Observer,
    ) -> Result<BrickFolder, ReadError> {
        let mut ending = Ending::default();
        let mut source = |take: &mut Take| {
            ending = pieces(scan, options, take)?;
            Ok(())
        };
        let mut gathered = part::gather(&mut source, folder, observer)?;
        gathered.manifest.bare = ending.bare.into_iter().map(str::to_owned).collect();
        gathered.manifest.color_scale = ending.color_scale;
        BrickFolder::parted(gathered, most, observer)
    }

    /// Writes points that come in pieces from elsewhere into a folder, to be parted by [`BrickFolder::of_gathered`].
    /// * `source` - gives each piece to what it is called with; all have the same attributes, and the last one has all scanners
    /// # Errors
    /// What the source says, [`ReadError::NoPoints`], or if the folder cannot be written.
    pub fn gather(source: &mut Source, folder: &Path) -> Result<Gathered, ReadError> {
        part::gather(source, folder, &Silent)
    }

    /// As [`BrickFolder::create`], of points that were gathered.
    /// # Errors
    /// If the folder cannot be written, or if cancelled.
    pub fn of_gathered(gathered: Gathered, most: usize, observer: &dyn Observer) -> Result<BrickFolder, ReadError> {
        BrickFolder::parted(gathered, (most, AT_ONCE), observer)
    }

    fn parted(gathered: Gathered, most: (usize, u64), observer: &dyn Observer) -> Result<BrickFolder, ReadError> {
        let (folder, manifest) = part::part(gathered, most, observer)?;
        let made = BrickFolder { folder, manifest };
        made.write(MANIFEST, &made.manifest).map_err(|e| part::lost(&made.folder, std::io::Error::other(e)))?;
        Ok(made)
    }

    /// Removes what parting a scan leaves in a folder.
    pub fn discard(folder: &Path) {
        let is_part = |name: &str| name == MANIFEST || ["part", "body", "points-"].iter().any(|p| name.starts_with(p));
        let names = std::fs::read_dir(folder).into_iter().flatten().flatten();
        names.filter(|e| is_part(&e.file_name().to_string_lossy())).for_each(|e| _ = std::fs::remove_file(e.path()));
    }

    /// A folder that was made before, by this process or another one.
    /// # Errors
    /// If it is none.
    pub fn open(folder: &Path) -> Result<BrickFolder, StoreError> {
        Ok(BrickFolder { folder: folder.to_path_buf(), manifest: kept(folder, MANIFEST)? })
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
        bounds_of(&self.manifest.bricks)
    }

    /// Keeps something in the folder by a name.
    /// # Errors
    /// If it cannot be written.
    pub fn write<T: Serialize>(&self, name: &str, what: &T) -> Result<(), StoreError> {
        let path = self.folder.join(name);
        let told = |e: &dyn std::fmt::Display| StoreError(format!("{}: cannot be written: {e}", path.display()));
        atomic::write(&path, |out| postcard::to_io(what, out).map(drop).map_err(std::io::Error::other))
            .map_err(|e| told(&e))
    }

    /// What was kept in the folder by a name.
    /// # Errors
    /// If it is not there, or damaged.
    pub fn read<T: DeserializeOwned>(&self, name: &str) -> Result<T, StoreError> {
        kept(&self.folder, name)
    }
}

impl BrickFolder {
    /// Passes the points of a brick by, each with the bytes of its columns.
    fn records(&self, brick: usize, see: &mut dyn FnMut(Record, &[u8])) -> Result<(), StoreError> {
        let path = points_file(&self.folder, brick);
        records(&path, self.manifest.more(), &Silent, see).map_err(|e| StoreError(format!("{}: {e}", path.display())))
    }

    /// Points with what tells of the outside.
    fn cloud<'a>(&self, found: impl Iterator<Item = &'a Record> + Clone) -> Cloud {
        let mut cloud = Cloud::new(found.clone().map(|r| r.point).collect());
        cloud.shift = self.manifest.shift;
        if self.manifest.has_normals {
            let values = found.clone().flat_map(|r| r.normal).collect();
            cloud.attributes.push(Attribute { name: "normal".into(), width: 3, values });
        }
        if !self.manifest.scanners.is_empty() {
            cloud.scanners.clone_from(&self.manifest.scanners);
            cloud.seen_by = found.map(|r| r.seen_by).collect();
        }
        cloud
    }
}

fn kept<T: DeserializeOwned>(folder: &Path, name: &str) -> Result<T, StoreError> {
    let path = folder.join(name);
    let told = |e: &dyn std::fmt::Display| StoreError(format!("{}: {e}", path.display()));
    let bytes = std::fs::read(&path).map_err(|e| told(&e))?;
    postcard::from_bytes(&bytes).map_err(|_| told(&"is damaged, or of another version of planish"))
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
        let mut found: Vec<Record> = Vec::new();
        for k in (0..bricks.len()).filter(|&k| bricks[k].bounds.meets(&reach)) {
            self.records(k, &mut |r, _| {
                if bricks[brick].is_near(r.point, halo) {
                    found.push(r);
                }
            })?;
        }
        found.sort_unstable_by_key(|r| r.index);
        Ok(self.cloud(found.iter()))
    }

    fn points_in(&self, brick: usize) -> Result<Cloud, StoreError> {
        let mut found: Vec<(Record, usize)> = Vec::new();
        let mut numbers: Vec<f32> = Vec::new();
        self.records(brick, &mut |r, rest| {
            found.push((r, found.len()));
            numbers.extend(rest.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])));
        })?;
        found.sort_unstable_by_key(|r| r.0.index);
        let mut cloud = self.cloud(found.iter().map(|r| &r.0));
        let all = self.manifest.more() / 4;
        let mut before = 0;
        for (name, width) in &self.manifest.columns {
            let from = before;
            before += width;
            if self.manifest.bare.contains(name) {
                continue;
            }
            let values = found.iter().flat_map(|r| &numbers[all * r.1 + from..][..*width]).copied().collect();
            cloud.attributes.push(Attribute { name: name.clone(), width: *width, values });
        }
        scale_colors(&mut cloud.attributes, self.manifest.color_scale);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{read_body, write_scan};
    use planish::cloud::bricks::CloudStore;
    use planish::pipeline::{ScanMeshed, ScanParams, mesh_bricks};
    use planish::synthetic::{demo, even_scan};

    const MOST: usize = 700;

    /// The folder of a scan whose parts are parted on disk down to 2000 points, and the same scan as it is read whole.
    fn both(scan: &Cloud, name: &str) -> (tempfile::TempDir, BrickFolder, Cloud) {
        let room = tempfile::tempdir().unwrap();
        let file = room.path().join(name);
        write_scan(&file, scan).unwrap();
        let folder = room.path().join("folder");
        std::fs::create_dir(&folder).unwrap();
        let made = BrickFolder::created(&file, &ScanOptions::default(), &folder, (MOST, 2000), &Silent).unwrap();
        let (whole, left_out) = read_body(&file, &ScanOptions::default()).unwrap();
        assert_eq!((made.left_out(), made.points()), (left_out as u64, whole.points.len() as u64));
        (room, made, whole)
    }

    fn scan_of(points: usize) -> Cloud {
        even_scan(&demo(1, 20_000), points, 0.004, 1)
    }

    fn scan() -> Cloud {
        scan_of(9_000)
    }

    /// All that a brick is made of is the same on disk as in memory.
    fn same(folder: &BrickFolder, whole: &Cloud) {
        let memory = CloudStore::new(whole, MOST);
        assert_eq!(folder.bricks(), memory.bricks());
        assert!(folder.bricks().len() > 12);
        for k in 0..folder.bricks().len() {
            for halo in [0.0, 0.3] {
                let (disk, memory) = (folder.around(k, halo).unwrap(), memory.around(k, halo).unwrap());
                assert_eq!(disk.attribute("normal", 3), memory.attribute("normal", 3));
                assert_eq!((disk.points, disk.shift), (memory.points, memory.shift));
                assert_eq!((disk.scanners, disk.seen_by), (memory.scanners, memory.seen_by));
            }
            assert_eq!(folder.points_in(k).unwrap(), memory.points_in(k).unwrap());
        }
    }

    #[test]
    fn points_at_map_coordinates_with_normals_wild_ones_and_equal_ones_are_parted_as_in_memory() {
        let mut cloud = scan();
        let map = DVec3::new(515_380.0, 4_918_360.0, 2_300.0);
        cloud.points.iter_mut().for_each(|p| *p += map);
        cloud.points[5] = DVec3::new(0.0, 1e9, 0.0);
        // More on one plane than a brick has points: a cut between equal numbers.
        (1000..5000).for_each(|k| cloud.points[k].x = cloud.points[1000].x);
        let values = (0..3 * cloud.points.len()).map(|k| (k as f32).sin()).collect();
        let column = |name: &str, width: usize, values| Attribute { name: name.into(), width, values };
        let colors = (0..3 * cloud.points.len()).map(|k| (k % 256) as f32 / 255.0).collect();
        let reflectance = (0..cloud.points.len()).map(|k| (k as f32).cos()).collect();
        cloud.attributes =
            vec![column("normal", 3, values), column("color", 3, colors), column("reflectance", 1, reflectance)];
        let (_room, folder, whole) = both(&cloud, "map.ply");
        assert_eq!(folder.left_out(), 1);
        same(&folder, &whole);
    }

    #[test]
    fn stations_and_formats_of_scanners_are_parted_as_in_memory() {
        let mut cloud = scan();
        cloud.scanners = vec![DVec3::new(9.0, 0.0, 0.0), DVec3::new(0.0, 9.0, 0.0)];
        cloud.seen_by = (0..cloud.points.len() as u32).map(|i| i % 2).collect();
        let (_room, folder, whole) = both(&cloud, "stations.e57");
        assert_eq!(whole.scanners.len(), 2);
        same(&folder, &whole);
        let (_room, folder, whole) = both(&scan(), "lines.laz");
        same(&folder, &whole);
        let mut cloud = scan();
        let colors = (0..3 * cloud.points.len()).map(|k| (k % 256) as f32 / 255.0).collect();
        cloud.attributes = vec![Attribute { name: "color".into(), width: 3, values: colors }];
        let (_room, folder, whole) = both(&cloud, "table.xyz");
        same(&folder, &whole);
    }

    #[test]
    fn parting_stops_wherever_it_is_no_longer_wanted() {
        use std::sync::atomic::{AtomicUsize, Ordering};
        struct Looks(AtomicUsize);
        impl Observer for Looks {
            fn progress(&self, _fraction: f64) {}

            fn cancelled(&self) -> bool {
                self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |n| n.checked_sub(1)).is_err()
            }
        }
        let (room, ..) = both(&scan(), "scan.ply");
        let file = room.path().join("scan.ply");
        let parted = |looks: usize| {
            let folder = tempfile::tempdir().unwrap();
            let observer = Looks(AtomicUsize::new(looks));
            BrickFolder::created(&file, &ScanOptions::default(), folder.path(), (MOST, 2000), &observer)
        };
        let enough = (0..).find(|&looks| parted(looks).is_ok()).unwrap();
        // Passes over the whole, its parts, and each brick.
        assert!(enough > 30, "{enough}");
        assert!((0..enough).all(|looks| matches!(parted(looks), Err(ReadError::Cancelled(_)))));
    }

    #[test]
    fn a_scan_on_disk_has_the_mesh_of_the_same_in_memory_and_a_damaged_folder_is_told() {
        let (room, folder, whole) = both(&scan_of(3_000), "scan.ply");
        let bits = |made: &ScanMeshed| {
            let mesh = &made.meshed.extracted.mesh;
            (mesh.points.iter().map(|p| p.to_array().map(f64::to_bits)).collect::<Vec<_>>(), mesh.triangles.clone())
        };
        let params = ScanParams::default();
        let disk = mesh_bricks(&folder, &params, &Silent).unwrap();
        let memory = mesh_bricks(&CloudStore::new(&whole, MOST), &params, &Silent).unwrap();
        assert!(bits(&disk) == bits(&memory));
        assert_eq!(disk.facts, memory.facts);
        let again = BrickFolder::open(&folder.folder).unwrap();
        assert_eq!((again.bricks(), again.facts(3)), (folder.bricks(), folder.facts(3)));
        std::fs::write(folder.folder.join("cells-00003"), b"no cells").unwrap();
        let told = folder.cells(3).unwrap_err().0;
        assert!(told.ends_with("cells-00003: is damaged, or of another version of planish"), "{told}");
        std::fs::remove_file(folder.folder.join(MANIFEST)).unwrap();
        assert!(BrickFolder::open(&folder.folder).is_err());
        let (scan, nowhere) = (room.path().join("scan.ply"), room.path().join("nowhere"));
        let told =
            BrickFolder::create(&scan, &ScanOptions::default(), &nowhere, MOST, &Silent).unwrap_err().to_string();
        assert!(told.starts_with("its points cannot be kept in ") && told.contains("make room there"), "{told}");
    }
}
